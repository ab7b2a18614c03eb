"""Objects that stand in the world while a palm moves and turns among them."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger

HAND = """
[hand]
name = "one"
gravity = [0.0, 0.0, -9.81]
[hand.fingers.only]
finger = "ub_stand_in"
"""
#: At rest at first, so that the palm's frame is the world's when the ball is thrown.
TUMBLE = """
[hand.palm.path]
x = { kind = "points", times = [0.0, 0.3], values = [0.0, 0.05] }
z = { kind = "points", times = [0.1, 0.4], values = [0.0, -0.04] }
roll = { kind = "points", times = [0.0, 0.35], values = [0.0, 0.9] }
pitch = { kind = "points", times = [0.0, 0.4], values = [0.0, -0.6] }
yaw = { kind = "points", times = [0.05, 0.4], values = [0.0, 1.2] }
"""
#: Thrown onto a tilted slab, where the ball bounces, slides and rolls; far from the finger.
THROWN = """
[environment.objects.slab]
shape = "box"
frame = "world"
sides = [0.5, 0.5, 0.02]
position = [0.7, 0.1, -0.05]
orientation = [0.1, 0.05, 0.0, 1.0]
[environment.objects.ball]
shape = "sphere"
radius = 0.015
mass = 0.03
position = [0.7, 0.1, 0.02]
velocity = [0.2, -0.1, -0.5]
angular_velocity = [3.0, 20.0, -5.0]
[simulation]
duration = 0.4
rtol = 1e-8
atol_scale = 1e-8
"""
#: A finger bends onto a post beside it.
POST = """
[reference.joints.only.proximal]
kind = "points"
times = [0.0, 0.3]
values = [0.2, 0.8]
[environment.objects.post]
shape = "capsule"
radius = 0.01
length = 0.2
position = [0.085, 0.0, 0.055]
orientation = [1.0, 0.0, 0.0, 1.0]
"""
DRIVE = '{ kind = "samples", times = [0.0, 0.5], values = [0.0, %g] }'


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    folder = tmp_path_factory.mktemp("standing")

    def from_text(*parts):
        path = folder / "scene.toml"
        path.write_text("".join(parts))
        return fp.load_scenario(path)

    return from_text


@pytest.fixture(scope="module")
def swept(load):
    """The palm turns and carries the finger along the post."""
    return load(HAND, TUMBLE, POST, 'frame = "world"\n', "[simulation]\nduration = 0.4\n")


@pytest.mark.slow
def test_what_a_ball_does_on_a_slab_does_not_depend_on_a_palm_that_tumbles_beside_them(load):
    still, moved = fp.simulate(load(HAND, THROWN)), fp.simulate(load(HAND, TUMBLE, THROWN))
    seen = fp.in_world(moved)
    assert np.ptp(still.object_position.values, axis=0).max() > 0.05
    # It bounces, and rolls at last.
    assert int(np.count_nonzero(still.contact_normal_force.sum("contact"))) > 20
    for name, known in (("position", 2e-7), ("orientation", 1e-5), ("velocity", 1e-5), ("angular_velocity", 1e-3)):
        one, other = (each[f"object_{name}"].sel(object="ball").values for each in (seen, still))
        if name == "orientation":
            one = one * np.sign(np.sum(one * other, axis=-1, keepdims=True))
        assert one == pytest.approx(other, abs=known), name
    for name, known in (("contact_force", 2e-3), ("contact_point", 5e-6), ("contact_normal", 1e-6)):
        assert seen[name].sum("contact").values == pytest.approx(still[name].sum("contact").values, abs=known), name


def test_a_palm_that_goes_on_evenly_feels_what_one_at_rest_feels_of_a_post_that_comes(load):
    tight = "[simulation]\nduration = 0.5\nrtol = 1e-8\natol_scale = 1e-8\n"
    moving = load(HAND, "[hand.palm.path]\nz = " + DRIVE % -0.03, POST, 'frame = "world"\n', tight)
    coming = load(HAND, POST, "[environment.objects.post.path]\nz = " + DRIVE % 0.03, "\n" + tight)
    one, other = fp.simulate(moving), fp.simulate(coming)
    assert float(one.contact_normal_force.max()) > 0.2
    assert one.joint_position.values == pytest.approx(other.joint_position.values, abs=1e-7)


def test_the_palm_pays_for_what_a_post_stops_and_the_account_closes(swept):
    result = fp.simulate(swept)
    pressed = result.contact_normal_force.sum("contact").values
    assert pressed.max() > 0.2
    assert "energy_exchanged_objects" not in result
    exchanged = sum(float(abs(result[name]).max()) for name in result if name.startswith("energy_exchanged_"))
    assert float(abs(result.energy_residual).max()) < 1e-6 * exchanged


def test_both_evaluations_agree_on_a_world_that_turns(swept):
    loop, times = ClosedLoop.from_scenario(swept), np.array([0.07, 0.31])
    x = np.stack([loop.initial_state()] * 2)
    state, rng = loop.finger.layout.unpack(x), np.random.default_rng(3)
    moved = (state.velocity, 1.0), (state.world_velocity, 1.0), (state.world_position, 0.01), (state.contact_bend, 1e-5)
    for each, size in moved:
        each[:] += size * rng.normal(size=each.shape)
    state.position[:, 1] = 0.7
    command, base, force = np.ones((2, loop.finger.mechanism.channels)), loop.base(times), np.zeros((2, 3))
    readable = loop.finger.evaluate(x, command, force, base)
    compiled = CompiledFinger(loop.finger).evaluate(x, command, force, base)
    assert np.any(readable.mechanism.rows["contacts"].force)
    assert compiled.rate == pytest.approx(readable.rate, rel=1e-8, abs=1e-8)
    for one, other in zip(compiled.mechanism.account(), readable.mechanism.account(), strict=True):
        for name in other:
            assert one[name] == pytest.approx(other[name], rel=1e-8, abs=1e-12)


def test_a_prepared_run_from_a_given_state_has_the_world_where_the_palm_s_path_has_it(load):
    scenario = load(HAND, TUMBLE, POST, 'frame = "world"\n', "[simulation]\nduration = 0.02\nstart_time = 0.2\n")
    loop = ClosedLoop.from_scenario(scenario)
    start, unplaced = loop.initial_state(), loop.initial_state()
    state = loop.finger.layout.unpack(unplaced)
    assert np.abs(state.world_position).max() > 0.01
    state.world_position[:] = state.world_velocity[:] = 0.0
    prepared = fp.prepare(scenario)
    np.testing.assert_array_equal(
        prepared.run(initial=unplaced)["joint_position"], prepared.run(initial=start)["joint_position"]
    )
    again = fp.simulate(scenario, initial=unplaced).joint_position.values
    np.testing.assert_array_equal(prepared.run(initial=unplaced)["joint_position"], again)
