"""Force closure that depends on the posture, on a routing whose arms have closed forms."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.proportional import RoutedController
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import ClosureWarning
from finger_pin.references.reference import ReferenceSignals
from finger_pin.views.summary import summarize

HEIGHT, REACH = 0.01, 0.03


def finger_table(height=HEIGHT, limit=1.0):
    """One hinge about y with two tendons from (-reach, +-height) at the base to (reach, +-height) on the link."""
    tendons = {}
    for name, z in (("upper", HEIGHT), ("lower", -height)):
        ends = {"from": (None, -REACH), "to": ("link", REACH)}
        tendons[name] = {
            "path": {
                point: {"kind": "point", "position": [x, 0.0, z], **({"body": body} if body else {})}
                for point, (body, x) in ends.items()
            }
        }
    return {
        "name": "one",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {"hinge": {"range": [-limit, limit], "spring": {"stiffness": 0.0, "damping": 2e-3}}},
        "tendons": {name: {"along": name} for name in tendons},
        "tree": {
            "bodies": {"link": {"mass": 0.02, "inertia": [1e-5] * 3 + [0.0] * 3}},
            "joints": {"hinge": {"body": "link", "axis": [0.0, 1.0, 0.0]}},
            "tendons": tendons,
            "tip": {"body": "link", "position": [REACH, 0.0, 0.0]},
        },
    }


def finger(**changes):
    return fp.Finger(fp.FingerDescription.model_validate(finger_table(**changes)))


def scenario(reference, **changes):
    return fp.Scenario.model_validate(
        {
            "name": "one",
            "finger": finger_table(**changes) | {"tendon_friction": {"coulomb": 0.0}},
            "controller": {"gain": 0.5, "minimum_tension": 2.0},
            "reference": {"joints": {"hinge": reference}},
            "simulation": {"duration": 0.5, "sample_rate": 100.0},
        }
    )


def arm(theta, z):
    """-dL/dtheta of L = |R_y(theta) (reach, z) - (-reach, z)|, from the law of cosines."""
    radius, rest = np.hypot(REACH, z), np.pi - 2.0 * np.arctan2(z, REACH)
    # About y, a positive angle lowers the link's end: the upper tendon's points move apart.
    opening = rest + theta
    return -(radius**2) * np.sin(opening) / (radius * np.sqrt(2.0 - 2.0 * np.cos(opening)))


@pytest.mark.parametrize("theta", [-0.7, 0.0, 0.4])
def test_arms_at_a_posture_follow_the_law_of_cosines(theta):
    expected = [arm(theta, HEIGHT), -arm(-theta, HEIGHT)]
    np.testing.assert_allclose(finger().coupling_at([theta])[:, 0], expected, rtol=1e-12)


def test_internal_tensions_balance_at_every_posture():
    found = fp.analysis.closure_over_range(finger(limit=0.3), samples=16)
    assert found.holds
    arms = finger(limit=0.3).coupling_at(found.positions)[..., 0]
    np.testing.assert_allclose(np.sum(arms * found.tension, axis=1), 0.0, atol=1e-12)
    assert "force closure everywhere" in str(found)


def test_a_routing_that_loses_closure_says_where():
    """The upper tendon passes the axis where its points and the hinge are in line, at 2 atan(height / reach)."""
    lost = 2.0 * np.arctan2(HEIGHT, REACH)
    assert arm(lost, HEIGHT) == pytest.approx(0.0, abs=1e-12)
    found = fp.analysis.closure_over_range(finger(limit=1.0), samples=64)
    assert not found.holds
    np.testing.assert_array_equal(found.tension.min(axis=1) > 0.0, np.abs(found.positions[:, 0]) < lost)
    assert str(found) == f"no force closure at hinge {found.worst[0]:.3g}"
    with pytest.warns(ClosureWarning, match="no force closure at hinge"):
        result = fp.simulate(scenario({}, limit=1.0))
    assert result.attrs["closure"] in summarize(result).replace("\n", " ")


def test_statics_of_a_posed_finger_are_those_of_its_arms_there():
    posed = fp.analysis.posed(finger(limit=0.3), [0.2])
    upper, lower = posed.routing.coupling[:, 0]
    assert upper < 0.0 < lower
    internal = posed.routing.force_closure().tension
    assert internal[0] / internal[1] == pytest.approx(-lower / upper)
    # What one tendon at its limit exerts at the tip, with the other slack.
    forces = fp.analysis.force_polytope(posed, [0.2], maximum_tension=10.0)
    pushes = np.linalg.norm(forces.vertices, axis=1)
    np.testing.assert_allclose(np.sort(pushes), np.sort([-10.0 * upper / REACH, 10.0 * lower / REACH]), rtol=1e-9)
    # Moving up, friction M S of the sum of tensions takes all that the pulling tendon adds where M is its arm.
    critical = fp.analysis.critical_friction(posed, [0.2], velocity=[-1.0])
    assert critical.coefficient == pytest.approx(-upper, rel=1e-6)


@pytest.mark.slow
def test_motors_pull_tendons_along_paths_through_spools_and_stretch():
    table = finger_table(limit=0.3)
    table["actuators"] = {
        f"M{k}": {"motor": "XL330-M288", "tendons": [name], "spool_radius": 0.005}
        for k, name in enumerate(table["tendons"])
    }
    tensions = {"upper": {"offset": 3.0, "amplitude": 2.0, "frequency": 2.0}, "lower": {"offset": 3.0}}
    pulled = read_scenario(
        {
            "name": "servos",
            "finger": table,
            "controller": {"kind": "tensions", "tensions": tensions},
            "simulation": {"duration": 0.2, "initial": {"position": {"hinge": 0.1}}},
        }
    )
    result = fp.simulate(pulled)
    # At the start spools hold the tensions; then the finger moves, and the account closes.
    np.testing.assert_allclose(result.spool_tension[0], [3.0, 3.0], rtol=1e-9)
    assert np.ptp(result.joint_position.values) > 1e-3
    assert np.abs(result.energy_residual).max() < 1e-7
    hand = fp.Finger(pulled.finger)
    x = hand.rest_state(np.array([0.2]), np.array([1.0]), np.array([3.0, 2.0]))
    # Spools go with the joint at the arms of the posture.
    expected = hand.coupling_at([0.2])[:, 0] / 0.005
    np.testing.assert_allclose(hand.layout.unpack(x).motor_velocity, expected, rtol=1e-12)
    found = hand.evaluate(x, np.array([3.0, 2.0]))
    np.testing.assert_allclose(found.strands, [3.0, 2.0], atol=0.02)
    np.testing.assert_allclose(found["joint_torque"], found.strands @ hand.coupling_at([0.2]), rtol=1e-9)
    np.testing.assert_allclose(CompiledFinger(hand).evaluate(x, np.array([3.0, 2.0])).rate, found.rate, atol=1e-6)


def test_an_analysis_that_needs_a_posture_asks_for_one():
    with pytest.raises(fp.InputError, match=r"depends on the posture \(fp\.analysis\.posed"):
        fp.analysis.critical_friction(finger())


def test_a_fingertip_that_no_joint_moves_has_no_forces():
    table = finger_table()
    del table["tree"]["tip"]
    still = fp.analysis.posed(fp.Finger(fp.FingerDescription.model_validate(table)), [0.2])
    with pytest.raises(fp.InputError, match="no joint moves the fingertip"):
        fp.analysis.force_polytope(still, [0.2], maximum_tension=10.0)


def test_locking_over_the_range_is_worst_where_an_arm_is_shortest():
    """Without tendon friction the finger locks at the arm of the pulling tendon, which is least at an end."""
    free = finger_table(limit=0.3) | {"tendon_friction": {"coulomb": 0.0}}
    hinge = fp.Finger(fp.FingerDescription.model_validate(free))
    critical, posture = fp.analysis.locking_over_range(hinge, samples=16)
    assert abs(posture[0]) == pytest.approx(0.3, abs=1e-3)
    assert critical.coefficient == pytest.approx(np.abs(hinge.coupling_at(posture)).min(), rel=1e-6)


@pytest.mark.slow
def test_the_controller_holds_tensions_at_the_minimum_and_follows_its_reference():
    moving = scenario({"amplitude": 0.2, "frequency": 1.0}, limit=0.3)
    controller = fp.control.build_controller(moving)
    assert isinstance(controller, RoutedController)
    positions, still = np.linspace(-0.3, 0.3, 7)[:, None], np.zeros((7, 1))
    asked = controller.command(0.0, ReferenceSignals(still, still), positions, still)
    np.testing.assert_allclose(asked.tension.min(axis=1), 2.0, rtol=1e-12)
    torque = np.sum(finger(limit=0.3).coupling_at(positions)[..., 0] * asked.tension, axis=1)
    np.testing.assert_allclose(torque, -0.5 * positions[:, 0], atol=1e-14)
    result = fp.simulate(moving, control_period=0.002)
    assert np.abs(result.tracking_error).max() < 0.05
    assert np.abs(result.energy_residual).max() < 1e-6


def test_a_wanted_fingertip_force_adds_its_torque_where_tendons_run_along_paths():
    """F_z at the reach r from a hinge about y turns it by -r cos(theta) F_z, at theta = 0.2 for 0.5 N."""
    pressing = scenario({}, limit=0.3).model_dump(exclude_none=True)
    pressing["controller"]["fingertip_force"] = {"z": {"offset": 0.5}}
    still = ReferenceSignals(np.full(1, 0.2), np.zeros(1))
    asked = fp.control.build_controller(read_scenario(pressing)).command(0.0, still, np.full(1, 0.2), np.zeros(1))
    expected = -REACH * np.cos(0.2) * 0.5
    assert asked.torque[0] == pytest.approx(expected, rel=1e-12)
    arms = finger(limit=0.3).coupling_at(np.full((1, 1), 0.2))[0, :, 0]
    assert arms @ asked.tension == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_servos_in_position_drive_turn_a_hinge_by_the_lengths_of_its_paths():
    """L by the law of cosines; with the arms of the middle posture spools would stand 0.095 rad from where they do."""
    driven = scenario({"offset": 0.25}, limit=0.5).model_dump(exclude_none=True)
    motor = {"motor": "XL330-M288", "spool_radius": 0.005, "drive": "position"}
    loop = {"position_loop": {"proportional": 9.2}, "tendon_rigidity": 5e3, "tendon_length": 0.2}
    driven["finger"]["actuators"] = {name: {**motor, **loop, "tendons": [name]} for name in ("upper", "lower")}
    driven["simulation"]["initial"] = {"position": {"hinge": 0.0}}
    end = fp.simulate(read_scenario(driven)).isel(time=-1)
    assert float(end.joint_position[0]) == pytest.approx(0.25, abs=2e-3)
    opening = np.pi - 2.0 * np.arctan2(HEIGHT, REACH) + np.array([0.0, 0.25, -0.25])
    length = np.hypot(REACH, HEIGHT) * np.sqrt(2.0 - 2.0 * np.cos(opening))
    stretched = end.spool_tension.values * 0.2 / 5e3
    np.testing.assert_allclose(end.motor_position, (length[0] - length[1:] + stretched) / 0.005, atol=2e-3)


@pytest.mark.slow
def test_the_margin_of_a_hand_is_that_of_its_weakest_finger_alone():
    hand = fp.load_hand("ub_hand")
    alone = [fp.analysis.closure_over_range(finger, 8).tension.min() for finger in hand.hand.built().values()]
    together = fp.analysis.closure_over_range(hand, 8)
    assert together.holds
    np.testing.assert_allclose(together.margin, min(alone), rtol=1e-9)
