"""Objects moved along paths, and what they push and drag, in closed form."""

import numpy as np
import pytest
from core_cases import condensed

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop, compiled_control
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper

G, MASS, STIFFNESS = 9.81, 0.05, 1e4
HEIGHT, FREQUENCY = 0.01, 1.0
OMEGA = 2.0 * np.pi * FREQUENCY
#: A plate that goes up and down under a ball, which starts with the plate's velocity.
LIFT = f"""
finger = "ub_stand_in"
[environment.objects.ball]
shape = "sphere"
radius = 0.02
mass = {MASS}
position = [0.3, 0.0, {-0.08 - MASS * G / STIFFNESS}]
velocity = [0.0, 0.0, {HEIGHT * OMEGA}]
surface = {{ stiffness = {STIFFNESS}, damping = 2.0 }}
[environment.objects.plate]
shape = "half_space"
position = [0.0, 0.0, -0.1]
path = {{ z = {{ amplitude = {HEIGHT}, frequency = {FREQUENCY} }} }}
[simulation]
duration = 1.25
rtol = 1e-8
atol_scale = 1e-8
"""
#: A block on a belt that moves on by a metre in half a second, too fast for friction to follow.
FRICTION = 0.5
BELT = f"""
finger = "ub_stand_in"
[environment.objects.block]
shape = "box"
sides = [0.04, 0.04, 0.01]
mass = 0.2
position = [0.3, 0.0, {-0.095 - 0.2 * G / 4.0 / 1e5}]
surface = {{ stiffness = 1e5, friction = {FRICTION}, tangential_stiffness = 1e5, damping = 5.0 }}
[environment.objects.belt]
shape = "half_space"
position = [0.0, 0.0, -0.1]
path.y = {{ kind = "points", times = [0.0, 0.5], values = [0.0, 1.0] }}
[simulation]
duration = 1.5
"""


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("moved")
    for name, text in (("lift", LIFT), ("belt", BELT)):
        (folder / f"{name}.toml").write_text(text)
    return {name: fp.load_scenario(folder / f"{name}.toml") for name in ("lift", "belt")}


@pytest.fixture(scope="module")
def lifted(scenes):
    return fp.simulate(scenes["lift"])


def test_a_plate_that_rises_and_falls_carries_the_ball_with_its_weight_and_inertia(lifted):
    time = lifted.time.values
    place = lifted.object_position.sel(object="plate").values
    assert place == pytest.approx(np.outer(HEIGHT * np.sin(OMEGA * time) - 0.1, [0.0, 0.0, 1.0]), abs=1e-7)
    # The ball on its contact is a spring far stiffer than the motion is fast.
    expected = MASS * (G - HEIGHT * OMEGA**2 * np.sin(OMEGA * time))
    assert lifted.contact_normal_force.sel(contact="ball-plate").values == pytest.approx(expected, rel=2e-3)


def test_the_account_has_what_the_plate_gives_as_work_against_weight_and_inertia(lifted):
    given = lifted.energy_exchanged_objects.values
    # On the top, at rest, after a quarter and after five quarters of a period.
    for k in (250, 1250):
        height = lifted.object_position.sel(object="ball", axis="z").values[[0, k]]
        expected = MASS * G * np.diff(height)[0] - 0.5 * MASS * (HEIGHT * OMEGA) ** 2
        assert given[k] == pytest.approx(expected, rel=2e-4)
    assert float(np.abs(lifted.energy_residual).max()) < 1e-5 * np.ptp(given)


def test_a_belt_drags_a_block_with_the_force_of_sliding_until_it_sticks_at_the_speed_of_the_belt(scenes):
    result = fp.simulate(scenes["belt"])
    moved = result.object_velocity.sel(axis="y")
    block, belt = (moved.sel(object=name).values for name in ("block", "belt"))
    # The belt runs ahead of the block, which friction accelerates alike all the time.
    assert np.all(belt[50:350] > block[50:350] + 0.1)
    assert np.diff(block[[50, 350]])[0] / 0.3 == pytest.approx(FRICTION * G, rel=1e-3)
    # The belt stands at last, the block still slides, and stops.
    assert block[500] > 1.0 and abs(block[-1]) < 1e-9
    slid = block[500] ** 2 / (2.0 * FRICTION * G)
    place = result.object_position.sel(object="block", axis="y").values
    assert place[-1] - place[500] == pytest.approx(slid, rel=2e-3)


def test_both_evaluations_agree_while_objects_are_moved(scenes):
    loop = ClosedLoop.from_scenario(scenes["lift"])
    times = np.array([0.1, 0.37])
    x = np.stack([loop.initial_state()] * 2)
    state = loop.finger.layout.unpack(x)
    # The ball moves as it likes, the plate does not turn.
    state.object_velocity[:, :6] += 1e-2 * np.random.default_rng(1).normal(size=(2, 6))
    command = np.ones((2, loop.finger.mechanism.channels))
    base, force = loop.base(times), np.zeros((2, 3))
    readable = loop.finger.evaluate(x, command, force, base)
    compiled = CompiledFinger(loop.finger).evaluate(x, command, force, base)
    assert compiled.rate == pytest.approx(readable.rate, rel=1e-9, abs=1e-9)
    for one, other in zip(compiled.mechanism.account(), readable.mechanism.account(), strict=True):
        for name in other:
            assert one[name] == pytest.approx(other[name], rel=1e-8, abs=1e-12)
    plate = readable.rate[:, loop.finger.layout.size // 2 :]
    assert np.any(np.isclose(plate, (-HEIGHT * OMEGA**2 * np.sin(OMEGA * times))[:, None], rtol=1e-12), axis=1).all()


def test_the_linear_system_knows_how_the_path_goes_on(scenes):
    loop = ClosedLoop.from_scenario(scenes["lift"]).compiled()
    layout, start = loop.finger.layout, loop.initial_state()
    stepper = Stepper(
        loop.finger.mechanism, compiled_control(loop), start, TABLEAUS["Rodas5P"](), 1e-6, 1e-6 * layout.scales()
    )
    part = next(each for each in stepper.parts if len(each.attitude))
    size, time, step = len(part.x), 0.1, 1e-6
    columns, rate = np.zeros((size + 1, size)), np.zeros(size)

    def rates(at):
        condensed(part.model.address, at, part.x, 1e3, rate, np.zeros(size + 1), columns)
        return rate.copy()

    by_time = (rates(time + step) - rates(time - step)) / (2.0 * step)
    rates(time)
    assert np.abs(by_time).max() == pytest.approx(HEIGHT * OMEGA**3 * np.cos(OMEGA * time), rel=1e-6)
    assert columns[-1] == pytest.approx(columns[:-1].T @ by_time, rel=1e-6, abs=1e-9)


def test_a_simulator_moves_objects_along_their_paths_and_records_them(scenes):
    described = scenes["lift"]
    sim = fp.Simulator(fp.Finger(described.finger, objects=described.environment.objects))
    for _ in range(50):
        sim.step([1.0, 1.0, 4.4, 3.1], 5e-3)
    place = sim.result().object_position.sel(object="plate", axis="z")
    assert place.values == pytest.approx(HEIGHT * np.sin(OMEGA * place.time.values) - 0.1, abs=1e-7)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ("mass = 0.1\npath.z.amplitude = 0.01", "path: is for objects without a mass"),
        ("path.yaw.amplitude = 0.01", "path.yaw: no such coordinate; there are x, y, z"),
        ('path.z = { kind = "step", time = 1.0, height = 0.1 }', "must be one of sine, points, samples"),
    ],
)
def test_a_wrong_path_is_one_clear_line(entries, message, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(f'finger = "ub_stand_in"\n[environment.objects.thing]\nshape = "sphere"\nradius = 0.1\n{entries}\n')
    with pytest.raises(fp.InputError, match=message) as caught:
        fp.load_scenario(file)
    assert str(caught.value).startswith("environment.objects.thing") and "\n" not in str(caught.value)


def test_objects_are_not_moved_around_a_palm_that_moves(tmp_path):
    changed = {"environment.objects.tray.path.x.amplitude": 0.01, "simulation.duration": 0.01}
    with pytest.raises(fp.InputError, match=r"^environment\.objects\.tray\.path: is for a palm at rest"):
        fp.simulate(fp.load_scenario("pinch", changed))
