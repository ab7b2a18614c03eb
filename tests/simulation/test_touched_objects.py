"""Fingers that touch objects: what a result says of it, and that it is the same by any way."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.exceptions import AccuracyWarning
from finger_pin.simulation.initial_state import packed_state
from finger_pin.views.summary import summarize

#: A ball that falls on the fingertip, off it, and on the floor.
BALL = """
finger = "ub_stand_in"
[reference.joints.proximal]
offset = 0.1
[environment.objects.ball]
shape = "sphere"
radius = 0.015
mass = 0.02
position = [0.11, 0.004, 0.045]
[environment.objects.floor]
shape = "half_space"
position = [0.0, 0.0, -0.03]
"""


@pytest.fixture(scope="module")
def pressed():
    return fp.simulate(fp.load_scenario("press", {"simulation.duration": 3.0}))


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("scene") / "ball.toml"
    file.write_text(BALL)
    return file


@pytest.fixture(scope="module")
def pushed(scene):
    return fp.simulate(fp.load_scenario(scene, {"simulation.duration": 1.2}))


def test_the_pad_touches_the_plate_sticks_and_slides_within_the_cone(pressed):
    contact = pressed.sel(contact="distal-plate")
    normal, friction = contact.contact_normal_force.values, contact.contact_friction.values
    closed = contact.contact_gap.values < 0.0
    assert np.array_equal(normal > 0.0, closed) and closed.any() and not closed.all()
    assert np.all(friction <= 0.65 * normal + 1e-12)
    # At the edge of the cone it slides, inside it sticks.
    sliding = contact.contact_slip.values > 1e-4
    assert sliding.any() and np.all(friction[sliding] >= 0.5 * normal[sliding] * (1.0 - 1e-9))
    inside = closed & (friction < 0.49 * normal)
    assert inside.any() and contact.contact_slip.values[inside].max() < 1e-12


def test_the_contact_force_is_normal_and_friction_together_and_lies_on_the_plate(pressed):
    contact = pressed.sel(contact="distal-plate")
    force, closed = contact.contact_force.values, contact.contact_gap.values < 0.0
    # The plate is above: the finger pushes it up, its normal points down, and the point lies on its surface.
    assert force[closed, 2] == pytest.approx(contact.contact_normal_force.values[closed], rel=1e-12)
    assert np.hypot(*force[closed, :2].T) == pytest.approx(contact.contact_friction.values[closed], rel=1e-12)
    assert contact.contact_normal.values[closed] == pytest.approx(np.tile([0.0, 0.0, -1.0], (closed.sum(), 1)))
    middle = 0.05 - 0.5 * contact.contact_gap.values[closed]
    assert contact.contact_point.values[closed, 2] == pytest.approx(middle, abs=1e-12)


def test_the_summary_says_how_hard_each_contact_pushed_and_how_long_it_slid(pressed):
    line = next(line for line in summarize(pressed).splitlines() if line.startswith("  distal-plate "))
    contact = pressed.sel(contact="distal-plate")
    normal, slip = contact.contact_normal_force.values, contact.contact_slip.values
    shares = [100.0 * np.mean(normal > 0.0), 100.0 * np.mean((normal > 0.0) & (slip > 1e-6))]
    found = [float(each) for each in line.replace("%", "").split()[1:]]
    assert found == pytest.approx([normal.max(), contact.contact_friction.values.max(), *shares], abs=0.06)


def test_what_pushes_back_loads_every_joint_as_the_same_force_at_the_fingertip_would(pressed):
    """(17) knows of a force beyond a joint, not of where it acts."""
    at = pressed.isel(time=1200)
    assert float(at.contact_normal_force.max()) > 0.5
    finger = fp.Finger("ub")
    x = finger.rest_state(at.joint_position.values, at.joint_velocity.values)
    state = finger.layout.unpack(x)
    state.passive_position[:] = at.passive_position.values
    state.passive_velocity[:] = at.passive_velocity.values
    state.tendon_stiction[:], state.joint_stiction[:] = at.tendon_stiction.values, at.joint_stiction.values
    back = -at.contact_force.sel(contact="distal-plate").values
    found = finger.evaluate(x, at.tendon_command.values[:4], back)
    assert found["joint_reaction"] == pytest.approx(at.joint_reaction.values, rel=1e-9)
    without = finger.evaluate(x, at.tendon_command.values[:4])["joint_reaction"]
    assert np.abs(found["joint_reaction"] - without).min() > 1e-3


@pytest.mark.parametrize("result", ["pressed", "pushed"])
def test_the_account_closes_with_contacts_and_free_objects(result, request):
    found = request.getfixturevalue(result)
    moved = sum(float(np.abs(found[name]).max()) for name in found if name.startswith("energy_exchanged_"))
    assert float(np.abs(found.energy_residual).max()) < 1e-5 * moved
    assert float(found.energy_exchanged_contacts_sliding[-1]) >= 0.0
    assert float(found.energy_contacts.max()) > 0.0


def test_a_free_ball_bounces_off_the_finger_and_comes_to_rest_on_the_floor(pushed):
    assert float(pushed.contact_normal_force.sel(contact="distal-ball").max()) > 0.5
    assert np.linalg.norm(pushed.object_orientation.values, axis=-1) == pytest.approx(1.0, abs=1e-12)
    height = pushed.object_position.sel(object="ball", axis="z").values
    # Free fall before it meets anything.
    assert height[30] == pytest.approx(0.045 - 0.5 * 9.81 * 0.03**2, abs=1e-8)
    weight = 0.02 * 9.81
    assert height[-1] == pytest.approx(-0.03 + 0.015 - weight / 1e4, abs=1e-7)
    on_floor = pushed.contact_force.sel(contact="ball-floor").values[-1]
    assert on_floor == pytest.approx([0.0, 0.0, -weight], abs=1e-3 * weight)


@pytest.mark.parametrize("name", ["press", "scene"])
def test_the_compiled_evaluation_is_the_readable_one(name, request):
    described = fp.load_scenario("press" if name == "press" else request.getfixturevalue(name))
    loop = ClosedLoop.from_scenario(described)
    rng = np.random.default_rng(4)
    x = np.tile(loop.initial_state(), (6, 1))
    x += 1e-3 * rng.normal(size=x.shape)
    x[:, 1] += 0.36 if name == "press" else 0.0
    x[:, 6] -= 0.0 if name == "press" else 0.02
    state = loop.finger.layout.unpack(x)
    if state.object_pose.size:
        state.object_pose[:, 3:] /= np.linalg.norm(state.object_pose[:, 3:], axis=1, keepdims=True)
    command = np.full((6, 4), 2.0)
    readable, compiled = loop.finger.evaluate(x, command), CompiledFinger(loop.finger).evaluate(x, command)
    assert np.abs(readable.mechanism.rows["contacts"].force).max() > 0.1
    scale = 1.0 + np.abs(readable.rate)
    assert np.abs((compiled.rate - readable.rate) / scale).max() < 1e-8
    found, pushing = compiled.mechanism.touching, readable.mechanism.rows["contacts"].force
    expected = loop.finger.scene.touching(state, pushing)
    for part in ("force", "point", "normal"):
        np.testing.assert_allclose(getattr(found, part), getattr(expected, part), rtol=1e-7, atol=1e-9, err_msg=part)


def test_a_result_is_continued_where_it_ended(scene, pushed):
    whole = pushed
    first = fp.simulate(fp.load_scenario(scene, {"simulation.duration": 0.5}))
    later = {"simulation.duration": 0.7, "simulation.start_time": 0.5}
    second = fp.simulate(fp.load_scenario(scene, later), initial=first)
    for name in ("joint_position", "object_position", "object_orientation"):
        assert second[name].values[-1] == pytest.approx(whole[name].values[-1], abs=2e-6), name
    with pytest.raises(fp.InputError, match="other contacts"):
        fp.simulate(fp.load_scenario("press", later), initial=first)


def test_a_start_inside_an_object_is_refused_by_name():
    inside = fp.load_scenario("press", {"environment.objects.plate.position": [0.0, 0.0, 0.01]})
    with pytest.raises(fp.InputError, match=r"environment\.objects: \w+-plate: starts .* mm deep"):
        fp.simulate(inside)


def test_an_object_cannot_have_the_name_of_a_joint(tmp_path):
    file = tmp_path / "same.toml"
    file.write_text('extends = "press"\n[environment.objects.medial]\nshape = "sphere"\nradius = 0.01\nmass = 0.01\n')
    with pytest.raises(fp.InputError, match="a joint has this name"):
        fp.simulate(fp.load_scenario(file))


@pytest.mark.slow
def test_two_fingers_hold_a_ball_until_friction_can_no_longer_carry_it():
    """Its weight is carried by friction at two pads; it falls no earlier than mu times both normal forces allow."""
    found = fp.simulate(fp.load_scenario("pinch", {"simulation.duration": 4.6}))
    pads = found.sel(contact=["left.distal-ball", "right.distal-ball"])
    held = found.time < 3.0
    # Down is x, and the palm is shaken at 3 and 4 Hz: over whole periods what carries the ball is its weight.
    carried = pads.contact_force.sel(axis="x").sum("contact").where(held & (found.time >= 1.0), drop=True)
    assert float(carried.std()) > 0.05
    assert float(carried.mean()) == pytest.approx(-0.03 * 9.81, rel=1e-2)
    slip = pads.contact_slip.where(held & (found.time > 0.5), drop=True)
    assert float(slip.max()) < 1e-9
    depth = found.object_position.sel(object="ball", axis="x")
    assert float(depth.where(held, drop=True).max()) < 0.093 and float(depth[-1]) > 0.12
    lost = int(np.argmax(depth.values > 0.1))
    moved = sum(float(np.abs(found[name]).max()) for name in found if name.startswith("energy_exchanged_"))
    assert float(np.abs(found.energy_residual).max()) < 1e-4 * moved
    level = pads.contact_level.sum("contact")
    assert float(level[lost - 60 : lost].min()) < 0.03 * 9.81 < float(level[3000])


def test_a_contact_too_stiff_for_its_tolerance_is_named():
    stiff = {"simulation.duration": 0.72, "environment.objects.plate.surface.stiffness": 2e11}
    with pytest.warns(AccuracyWarning, match=r"^distal-plate is too stiff .* by 5e-12 m, .* to about 1e-07 m") as said:
        found = fp.simulate(fp.load_scenario("press", stiff))
    assert "\n" not in str(said[0].message) and found.attrs["accuracy"] == str(said[0].message)


@pytest.mark.slow
def test_powers_of_many_states_are_those_of_each_alone(scene, pushed):
    loop = ClosedLoop.from_scenario(fp.load_scenario(scene)).compiled()
    x = np.array([last_state(loop.finger, pushed, k) for k in range(0, 1200, 8)])
    times = 8e-3 * np.arange(len(x))
    alone = np.concatenate([loop.powers(times[k : k + 1], x[k : k + 1]) for k in range(len(x))])
    assert loop.powers(times, x) == pytest.approx(alone, rel=1e-12, abs=1e-18)
    # What slept meanwhile has met the ball.
    assert alone[:, [each.name for each in loop.finger.mechanism.energies.powers].index("contacts_impact")].max() > 0.0


def last_state(finger, result, k):
    return packed_state(result.isel(time=slice(k, k + 1)), finger)


@pytest.mark.slow
@pytest.mark.parametrize("touch", [None, True, False])
def test_fingers_touch_each_other_without_objects_where_they_are_told_to(touch):
    """One is led into its neighbour: through it, or up to it."""
    into = {"kind": "points", "times": [0.0, 0.2], "values": [0.0, 0.3], "amplitude": 0.0}
    led = {"simulation.duration": 0.3, "reference.joints.index.abduction": into, "hand.fingers_touch": touch}
    hand = fp.simulate(fp.load_scenario("hand", {key: value for key, value in led.items() if value is not None}))
    assert ("contact" in hand.coords) == bool(touch)
    if touch:
        pushed = hand.contact_normal_force.max("time").values
        assert {str(name).split(".")[0] for name in hand.contact.values[pushed > 0.1]} == {"index"}
        assert float(hand.contact_gap.min()) > -1e-3


def test_fingers_that_are_told_not_to_touch_still_touch_objects():
    described = fp.load_scenario("grasp", {"hand.fingers_touch": False})
    finger = fp.Finger(described.finger, objects=described.environment.objects)
    assert all("cylinder" in name or "table" in name for name in finger.scene.contacts.names)


def test_methods_that_may_pass_over_touches_say_so_unless_their_steps_are_bounded():
    short = {"simulation.duration": 1e-5, "simulation.method": "BDF"}
    with pytest.warns(
        AccuracyWarning, match=r"BDF sees touches at the ends of its steps only: give simulation.max_step"
    ):
        fp.simulate(fp.load_scenario("press", short))
    result = fp.simulate(fp.load_scenario("press", short | {"simulation.max_step": 5e-7}))
    assert result.attrs["solver_steps"] >= 20
    with pytest.raises(fp.InputError, match=r"simulation.max_step = 1e-05: is for methods of scipy"):
        fp.simulate(fp.load_scenario("press", {"simulation.duration": 2e-4, "simulation.max_step": 1e-5}))
