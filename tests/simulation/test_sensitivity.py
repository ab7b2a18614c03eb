"""Sensitivities of a run against differences of whole runs at tight tolerances, and against closed forms."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.simulation.sensitivity import repeat_steps
from finger_pin.simulation.setup import Setup

VARIABLES = ("joint_position", "tendon_tension")
FRICTION = ["finger.tendon_friction.coulomb", "finger.joint_friction.viscous", "simulation.initial.position.medial"]
POSED = {"simulation.duration": 0.3, "simulation.initial.position.medial": 0.2}
LED = {
    "simulation.duration": 0.15,
    "environment.objects.plate.position": [0.0, 0.0, 0.0296],
    "environment.objects.plate.path.x": {"kind": "points", "times": [0.0, 0.15], "values": [0.0, 0.01]},
    "environment.objects.plate.path.z": {"kind": "points", "times": [0.0, 0.15], "values": [0.0, -0.002]},
}
TIGHT = {"simulation.rtol": 1e-11, "simulation.atol_scale": 1e-11}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "entries", "keys", "variables", "bound"),
    [
        # Until 0.7 s another tension takes the lead in (22), twice.
        ("reversals", POSED | {"simulation.duration": 0.7}, FRICTION, VARIABLES, 1e-3),
        # Of the last number the rotors feel the most.
        ("servo", POSED, [*FRICTION, "finger.actuators.*.motor.friction.viscous"], VARIABLES, 3e-3),
        # A pad that touches a plate, sticks and slips.
        ("press", {"simulation.duration": 2.0}, ["environment.objects.plate.surface.friction"], VARIABLES, 1.5e-2),
        # A plate that is led along the pad and away from it, whatever it feels; where a tendon begins to slide its
        # slope jumps, and one of 151 samples may fall on the other side of that.
        (
            "press",
            LED,
            ["environment.objects.plate.surface.friction", "finger.tendon_friction.coulomb[2,3,4]"],
            VARIABLES,
            1e-2,
        ),
        # A free ball between two pads.
        ("pinch", {"simulation.duration": 0.1}, ["environment.objects.ball.mass"], ("object_position",), 1e-2),
    ],
)
def test_sensitivities_are_the_differences_of_tight_runs(name, entries, keys, variables, bound):
    prepared = fp.prepare(fp.load_scenario(name, entries), keys, variables)
    exact = fp.prepare(fp.load_scenario(name, entries | TIGHT), keys, variables)
    values = np.array(prepared.values, dtype=float)
    run = prepared.run(values, sensitivities=True)
    assert run.attrs["sensitivities_lost"] == np.inf
    for k, value in enumerate(values):
        change = np.where(np.arange(len(values)) == k, 1e-5 * value, 0.0)
        ends = [exact.run(values + way * change) for way in (1.0, -1.0)]
        for variable in variables:
            expected = (ends[0][variable] - ends[1][variable]) / (2e-5 * value)
            error = np.sqrt(np.mean((run.slopes[variable][k] - expected) ** 2))
            assert error < bound * np.sqrt(np.mean(expected**2)), (variable, keys[k])


@pytest.mark.slow
def test_a_loop_with_an_encoder_that_rounds_feels_a_parameter_as_one_that_reads_exactly_does():
    """Between the encoder's steps nothing comes back to the loop, so that there it would seem to run open."""
    key, entries = "finger.actuators.servo.position_loop.proportional", {"simulation.duration": 1.0}
    run = fp.prepare(fp.load_scenario("wound", entries), [key], VARIABLES).run(sensitivities=True)
    exact = {"finger.actuators.servo.motor": {"base": "XL330-M288", "encoder": {"resolution": 0.0}}}
    tight = fp.prepare(fp.load_scenario("wound", entries | exact | TIGHT), [key], VARIABLES)
    ends = [tight.run([9.2 * change]) for change in (1.001, 0.999)]
    for variable in VARIABLES:
        expected = (ends[0][variable] - ends[1][variable]) / (2e-3 * 9.2)
        error = np.sqrt(np.mean((run.slopes[variable][0] - expected) ** 2))
        assert error < 1e-2 * np.sqrt(np.mean(expected**2)), variable


def test_differences_on_the_same_steps_and_branches_do_not_depend_on_the_change():
    # Before 0.7 s the pad touches; one that touches a little later or not yet must not differ by a leap.
    prepared = fp.prepare(
        fp.load_scenario("press", {"simulation.duration": 0.7}), ["finger.tendon_friction.coulomb[2,3,4]"]
    )
    (value,) = prepared.values
    trajectory = Setup.from_scenario(prepared.scenario()).integrate()
    changes = value * np.array([0.0, -1e-6, -1e-7, 1e-7])
    setups = [Setup.from_scenario(prepared.scenario([value + change])) for change in changes]
    times = np.linspace(0.0, 0.7, 701)
    same, *moved = (each.interpolate(times)[:, :4] for each in repeat_steps(trajectory, setups))
    np.testing.assert_allclose(same, trajectory.interpolate(times)[:, :4], atol=1e-12)
    slopes = [(each - same) / change for each, change in zip(moved, changes[1:], strict=True)]
    for each in slopes[1:]:
        assert np.max(np.abs(each - slopes[0])) < 0.05 * np.max(np.abs(slopes[0]))


def test_a_later_jump_of_a_tension_is_the_same_motion_later():
    # At rest until then nothing else knows the time: d theta / d t0 = -theta'.
    jump = {"kind": "step", "time": 0.3, "height": 5.0}
    scenario = fp.load_scenario("canal", {"controller.tensions.T1": jump, "simulation.duration": 0.8})
    prepared = fp.prepare(scenario, ["controller.tensions.T1.time"], ["joint_position", "joint_velocity"])
    run = prepared.run(sensitivities=True)
    after = run.time > 0.31
    np.testing.assert_allclose(
        run.slopes["joint_position"][0][after], -run["joint_velocity"][after], atol=2e-4 * np.ptp(run["joint_velocity"])
    )


def test_a_drum_on_a_spring_has_the_derivatives_of_the_damped_oscillator():
    # Its tendon is slack: I theta'' + c theta' + k theta = 0.
    stiffness, damping = "finger.joints.drum.spring.stiffness", "finger.joint_friction.viscous"
    entries = {
        "controller.tensions.T1.height": 0.0,
        "finger.tendon_friction.coulomb": 0.0,
        "simulation.duration": 0.4,
        "simulation.initial.position.drum": 0.5,
    }
    scenario = fp.load_scenario("canal", entries)
    keys = [stiffness, damping, "simulation.initial.position.drum"]
    run = fp.prepare(scenario, keys, ["joint_position"]).run(sensitivities=True)
    link = scenario.finger.joints["drum"].link
    body = fp.Finger(scenario.finger).rigid_body.model.inertias[1]
    inertia = body.inertia[2, 2] + body.mass * body.lever @ body.lever
    assert link.mass == body.mass

    def swing(k, c, start):
        rate = np.sqrt(k / inertia - (c / (2.0 * inertia)) ** 2)
        fading = c / (2.0 * inertia)
        return start * np.exp(-fading * run.time) * (np.cos(rate * run.time) + fading / rate * np.sin(rate * run.time))

    own = np.array([scenario.finger.joints["drum"].spring.stiffness, scenario.finger.joint_friction.viscous, 0.5])
    np.testing.assert_allclose(run["joint_position"][:, 0], swing(*own), atol=1e-4)
    for k in range(3):
        change = 1e-20j * (np.arange(3) == k)
        expected = swing(*(own + change)).imag / 1e-20
        error = run.slopes["joint_position"][k][:, 0] - expected
        assert np.max(np.abs(error)) < 1e-3 * np.max(np.abs(expected)), keys[k]


def test_of_a_sampled_controller_they_are_the_differences_of_tight_runs_too():
    entries = {"simulation.duration": 0.1, "controller.sampling.period": 0.005}
    keys = ["controller.gain"]
    run = fp.prepare(fp.load_scenario("reversals", entries), keys).run(sensitivities=True)
    exact = fp.prepare(fp.load_scenario("reversals", entries | TIGHT), keys)
    up, down = exact.run([1.0 + 1e-5]), exact.run([1.0 - 1e-5])
    expected = (up["joint_position"] - down["joint_position"]) / 2e-5
    error = run.slopes["joint_position"][0] - expected
    assert np.max(np.abs(error)) < 1e-2 * np.max(np.abs(expected))


@pytest.mark.slow
def test_of_a_hand_whose_controller_is_sampled_every_finger_keeps_steps_of_its_own():
    entries = {"simulation.duration": 0.05, "simulation.sample_rate": 200.0, "controller.sampling": {"period": 5e-3}}
    keys = ["hand.fingers.index.finger.tendon_friction.coulomb[2,3,4]"]
    prepared, exact = (
        fp.prepare(fp.load_scenario("hand", entries | more), keys, ["joint_position"]) for more in ({}, TIGHT)
    )
    (value,) = prepared.values
    slopes = prepared.run(sensitivities=True).slopes["joint_position"][0]
    ends = [exact.run([value * (1.0 + way)])["joint_position"] for way in (1e-5, -1e-5)]
    expected = (ends[0] - ends[1]) / (2e-5 * value)
    assert np.sqrt(np.mean((slopes - expected) ** 2)) < 1e-2 * np.sqrt(np.mean(expected**2))


@pytest.mark.slow
def test_each_finger_of_a_hand_feels_numbers_of_its_own_alone():
    entries = {"simulation.duration": 0.05, "simulation.sample_rate": 200.0}
    keys = [f"hand.fingers.{name}.finger.tendon_friction.coulomb[2,3,4]" for name in ("middle", "thumb")]
    prepared, exact = (
        fp.prepare(fp.load_scenario("hand", entries | more), keys, ["joint_position"]) for more in ({}, TIGHT)
    )
    values = np.array(prepared.values)
    run = prepared.run(sensitivities=True)
    for k, name in enumerate(("middle", "thumb")):
        change = 1e-5 * values * (np.arange(2) == k)
        ends = [exact.run(values + way * change)["joint_position"] for way in (1.0, -1.0)]
        expected, slopes = (ends[0] - ends[1]) / (2.0 * change[k]), run.slopes["joint_position"][k]
        own = np.array([joint.startswith(name) for joint in run["joint"]])
        assert np.sqrt(np.mean((slopes - expected) ** 2)) < 1e-3 * np.sqrt(np.mean(expected**2))
        assert np.any(slopes[:, own] != 0.0) and np.all(slopes[:, ~own] == 0.0)


def test_a_value_without_a_derivative_is_refused():
    prepared = fp.prepare(fp.load_scenario("reversals", {"simulation.duration": 0.01}), ["simulation.method"])
    with pytest.raises(fp.InputError, match="single numbers"):
        prepared.run(["Rodas4"], sensitivities=True)
