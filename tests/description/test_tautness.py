"""Springs in place of force closure: the spare tension by hand, at its corner, and what the controller makes of it."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.routing import Routing
from finger_pin.description.tautness import Tautness
from finger_pin.exceptions import InputError

OPENING = {"joints": {"a": (0.02, -1.0), "b": (0.01, -0.8)}, "tendons": {"F": {"a": 6}, "G": {"a": 2, "b": 5}}}


@pytest.fixture
def described(network):
    def make(joints, tendons, passive=(), low=0.0, high=1.5):
        springs = {
            name: {"range": [low, high], "spring": {"stiffness": stiffness, "rest": rest}}
            for name, (stiffness, rest) in joints.items()
        }
        return fp.FingerDescription.model_validate(network(joints, tendons, passive).model_dump() | {"joints": springs})

    return make


def tautness(description, minimum, coupling=None):
    routing = Routing.from_description(description)
    coupling = coupling or PassiveCoupling.from_routing(routing, np.full(routing.passive, 1e-4))
    return Tautness.from_finger(description, routing, coupling, np.broadcast_to(minimum, len(routing.tendons)))


def test_one_flexor_against_one_spring_has_the_least_tension_where_the_spring_is_relaxed_most(described):
    """F = k (theta - theta_0) / r = 0.02 * 0.5 / 6e-3 at theta = 0."""
    found = tautness(described({"a": (0.02, -0.5)}, {"F": {"a": 6}}), 0.7)
    assert found.spare == pytest.approx(0.02 * 0.5 / 6e-3 - 0.7, rel=1e-9)
    assert found.posture == pytest.approx([0.0]) and found.holds


def test_a_tendon_over_two_joints_takes_from_the_other_where_it_pulls_most(described):
    """At theta = (0, 1.5): g = 0.01 * 2.3 / 5e-3 = 4.6 N, and f = (0.02 * 1.0 - 2e-3 * 4.6) / 6e-3 = 1.8 N."""
    found = tautness(described(**OPENING), 0.0)
    corners = {}
    for a in (0.0, 1.5):
        for b in (0.0, 1.5):
            g = 0.01 * (b + 0.8) / 5e-3
            corners[a, b] = min(g, (0.02 * (a + 1.0) - 2e-3 * g) / 6e-3)
    worst = min(corners, key=corners.get)
    assert tuple(found.posture) == worst
    assert found.spare == pytest.approx(corners[worst], rel=1e-9)


@pytest.mark.slow
def test_no_posture_within_the_ranges_is_worse_than_the_worst_corner(described):
    description = described(**OPENING)
    least = tautness(description, 0.3).spare
    draw = np.random.default_rng(8)
    for point in draw.uniform(0.0, 1.5, (40, 2)):
        single = described(**OPENING, low=0.0, high=1.5)
        at = {
            name: joint.updated(range=(float(angle), float(angle) + 1e-12))
            for (name, joint), angle in zip(single.joints.items(), point, strict=True)
        }
        assert tautness(single.updated(joints=at), 0.3).spare >= least - 1e-9


def test_a_spring_that_is_relaxed_within_the_range_leaves_the_tendon_slack(described):
    found = tautness(described({"a": (0.02, 0.5)}, {"F": {"a": 6}}), 0.0)
    assert not found.holds and found.spare == pytest.approx(-0.02 * 0.5 / 6e-3)
    assert "1.67 N short of its minimum tension at a 0 rad" in str(found)


def test_a_joint_without_spring_or_antagonist_is_held_by_no_tensions(described):
    description = described({"a": (0.02, -1.0), "b": (0.01, -1.0)}, {"F": {"a": 6}})
    found = tautness(description, 0.0)
    assert not found.holds and found.spare == -np.inf
    assert "no tensions hold it against its springs at a 0, b 0 rad" in str(found)


def test_a_follower_is_looked_at_where_its_passive_tendon_puts_it(described):
    """P carries 1 N at 1e4 N/m: theta_b = (3 theta_a - 0.1) / 4; joint b then balances 4 f_P = k_b (theta_b + 2)."""
    description = described({"a": (0.08, -1.0), "b": (0.01, -2.0)}, {"F": {"a": 6}, "P": {"a": -3, "b": 4}}, ["P"])
    found = tautness(description, 0.0)
    spare = []
    for a in (0.0, 1.5):
        b = (3e-3 * a - 1.0 / 1e4) / 4e-3
        f_p = 0.01 * (b + 2.0) / 4e-3
        spare.append(min(f_p, (0.08 * (a + 1.0) + 3e-3 * f_p) / 6e-3))
    assert found.spare == pytest.approx(min(spare), rel=1e-9)


FLEXORS = """
[finger]
name = "flexors"
[finger.joints.a]
range = [0.0, 1.5]
spring = { stiffness = 0.02, rest = -1.0 }
link = { length = 0.045, width = 0.017, mass = 0.01 }
[finger.joints.b]
range = [0.0, 1.5]
spring = { stiffness = 0.01, rest = -0.8, damping = 1e-5 }
link = { length = 0.03, width = 0.015, mass = 0.006 }
[finger.tendons.F]
crossings = { a = { radius = 0.006 } }
[finger.tendons.G]
crossings = { a = { radius = 0.002 }, b = { radius = 0.005 } }
[reference.joints.a]
offset = 0.4
amplitude = 0.3
frequency = 2.0
[reference.joints.b]
offset = 0.6
[controller]
minimum_tension = 0.2
[simulation]
duration = 0.05
"""


@pytest.fixture
def flexors(tmp_path):
    path = tmp_path / "flexors.toml"
    path.write_text(FLEXORS)
    return path


@pytest.mark.slow
def test_a_finger_that_tendons_only_close_is_simulated_against_its_springs(flexors):
    result = fp.simulate(fp.load_scenario(flexors))
    assert float(abs(result.tracking_error).max()) < 0.03
    assert float(result.tendon_command.min()) >= 0.2
    theta = result.joint_position.values
    springs = np.column_stack([0.02 * (theta[:, 0] + 1.0), 0.01 * (theta[:, 1] + 0.8)])
    error = result.joint_reference.values - theta
    np.testing.assert_allclose(result.joint_torque_command, error + springs, rtol=1e-9)
    coupling = np.array([[6e-3, 0.0], [2e-3, 5e-3]])
    np.testing.assert_allclose(result.tendon_command.values @ coupling, error + springs, atol=1e-9)
    assert "self_locking_margin" not in result.attrs


def test_tensions_never_fall_below_the_minimum_whatever_torque_is_asked_for(flexors):
    controller = fp.control.build_controller(fp.load_scenario(flexors))
    for torque in np.random.default_rng(2).normal(0.0, 0.1, (50, 2)):
        plan = controller.distribution.plan(torque, controller.minimum)
        assert plan.tension.min() >= 0.2
        np.testing.assert_allclose(plan.tension @ [[6e-3, 0.0], [2e-3, 5e-3]], torque - plan.torque_deficit, atol=1e-9)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("controller.minimum_tension", 2.0, "0.4 N short of its minimum tension at a 0, b 0 rad"),
        ("finger.joints.a.spring.rest", 0.5, "short of its minimum tension at a 0, b 1.5 rad"),
        ("finger.joints.b.range", [-1.0, 0.5], "at a 0, b -1 rad"),
    ],
)
def test_springs_that_cannot_keep_the_tendons_taut_are_refused_with_the_posture(flexors, key, value, said):
    with pytest.raises(InputError) as caught:
        fp.load_scenario(flexors, {key: value})
    assert caught.value.entry == "finger.tendons"
    assert "no force closure" in str(caught.value) and said in str(caught.value) and "\n" not in str(caught.value)


def test_without_springs_force_closure_is_asked_for_as_before(flexors):
    with pytest.raises(InputError, match=r"too few tendons\); the controller needs force closure"):
        fp.load_scenario(flexors, {f"finger.joints.{name}": {"range": [0.0, 1.5]} for name in "ab"})


def test_the_paper_s_controller_holds_the_springs_where_it_is_told_to(tmp_path):
    sprung = {"finger.joints.medial.spring": {"stiffness": 0.05, "rest": -0.2}}
    plain = fp.control.build_controller(fp.load_scenario("reversals", sprung))
    told = fp.control.build_controller(fp.load_scenario("reversals", sprung | {"controller.spring_compensation": True}))
    position = np.array([0.0, 0.3, 0.6, 0.4])
    torques = []
    for controller in (plain, told):
        reference = type("At", (), {"position": position, "velocity": np.zeros(4)})
        torques.append(controller.command(0.0, reference, position, np.zeros(4)).torque)
    np.testing.assert_allclose(torques[1] - torques[0], [0.0, 0.0, 0.05 * 0.8, 0.0], atol=1e-14)


FLEXOR = """
[finger]
name = "flexor"
gravity = [0.0, 0.0, 0.0]
joints.a.range = [0.0, 1.6]
joints.a.link = { length = 0.05, width = 0.01, mass = 0.01 }
joints.a.spring = { stiffness = 0.3, damping = 0.01 }
joints.b.range = [0.0, 1.6]
joints.b.link = { length = 0.03, width = 0.01, mass = 0.01 }
joints.b.spring = { stiffness = 0.1, damping = 0.01 }
tendons.F.crossings = { a = { radius = 0.01 }, b = { radius = 0.006 } }
tendon_friction = { coulomb = 0.0, viscous = 0.0 }
joint_friction = { coulomb = 0.0, stiction = 0.0 }
[simulation]
duration = 1.5
"""


@pytest.fixture
def flexor(tmp_path):
    path = tmp_path / "flexor.toml"
    path.write_text(FLEXOR)
    return path


def test_one_flexor_over_two_joints_with_springs_runs_in_open_loop_by_itself(flexor):
    """With the minimum tension of 1 N, or 5 N by a signal, each joint rests at r f / k."""
    for more, tension in (({}, 1.0), ({"controller.tensions.F.offset": 5.0}, 5.0)):
        scenario = fp.load_scenario(flexor, more)
        assert scenario.controller.kind == "tensions"
        end = fp.simulate(scenario).joint_position.values[-1]
        np.testing.assert_allclose(end, tension * np.array([0.01 / 0.3, 0.006 / 0.1]), rtol=2e-2)


@pytest.mark.parametrize("key", ["reference.joints.a.offset", "controller.gain", "controller.damping"])
def test_a_closed_loop_that_is_asked_of_it_is_refused_with_the_way_out(flexor, key):
    with pytest.raises(InputError, match=r'no tensions hold it.*kind = "tensions" can do without') as caught:
        fp.load_scenario(flexor, {key: 0.3})
    assert caught.value.entry == "finger.tendons"


@pytest.mark.slow
def test_in_a_hand_only_the_finger_that_needs_it_is_in_open_loop(flexor, tmp_path):
    flexor.write_text(FLEXOR.partition("[simulation]")[0].replace("[finger]\n", ""))
    hand = """
[hand]
name = "two"
[hand.fingers]
one.finger = "flexor.toml"
two.finger = "ub_stand_in"
[controller]
minimum_tension = 2.0
[simulation]
duration = 0.01
"""
    path = tmp_path / "hand.toml"
    path.write_text(hand)
    scenario = fp.load_scenario(path)
    kinds = {name: part.controller.kind for name, part in scenario.parts().items()}
    assert kinds == {"one": "tensions", "two": "proportional"}
    assert scenario.parts()["one"].controller.minimum_tension == 2.0
    again = tmp_path / "again.toml"
    again.write_text(fp.to_toml(scenario))
    assert fp.load_scenario(again).controller == scenario.controller
    np.testing.assert_allclose(fp.simulate(scenario).tendon_command.sel(tendon="one.F"), 2.0)
