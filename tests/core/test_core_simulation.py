"""Whole simulations by the compiled core: methods agree, energy closes, sampled control converges, nothing is lost."""

from dataclasses import dataclass

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.interface import ControlSignals
from finger_pin.control.proportional import ProportionalController
from finger_pin.core.stepping.stepper import TABLEAUS
from finger_pin.exceptions import IntegrationError, Interrupted

METHODS = tuple(TABLEAUS)
#: Every kind of signal that follows from the state, with what is little of it.
SIGNALS = {"joint_position": 1e-3, "tendon_tension": 1.0, "tendon_stiction": 1.0, "fingertip_position": 1e-4}


def run(scenario, *, tolerance=1e-6, duration=None, method="Rodas5P", rate=1000.0, **options):
    """Simulate a scenario at one tolerance for all."""
    settings = {"method": method, "rtol": tolerance, "atol_scale": tolerance, "sample_rate": rate}
    if duration is not None:
        settings["duration"] = duration
    changed = scenario.updated(simulation=settings)
    return fp.simulate(changed, **options)


def gap(result, exact):
    """The largest difference of all signals at common times, each in units of a little of its own."""
    exact = exact.sel(time=result.time)
    return max(float(abs(result[name] - exact[name]).max()) / little for name, little in SIGNALS.items())


def open_share(result):
    """The energy that is not accounted for, over what the actuators supplied."""
    return float(abs(result.energy_residual).max() / abs(result.energy_exchanged_actuators).max())


@pytest.fixture(scope="module")
def exact(scenarios):
    """Motions at the tightest tolerance, by the method of lower order."""
    durations = {"reversals": 1.0, "stick_slip": 0.3, "none_passive": 1.0, "lugre": 0.3}
    return {
        name: run(scenarios[name], tolerance=1e-11, duration=duration, method="Rodas4")
        for name, duration in durations.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reversals", "stick_slip", "none_passive", "lugre"])
@pytest.mark.parametrize("method", METHODS)
def test_compiled_methods_approach_one_motion_as_tolerances_shrink(scenarios, exact, name, method):
    """Through kinks, stiction and reversals: over two hundredths of the tolerance, ten times smaller for each."""
    duration = float(exact[name].time[-1])
    gaps = [
        gap(run(scenarios[name], tolerance=tolerance, duration=duration, method=method), exact[name])
        for tolerance in (1e-5, 1e-7, 1e-9)
    ]
    assert gaps[0] > gaps[1] > gaps[2] and gaps[0] > 100.0 * gaps[2], gaps
    assert gaps[2] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(("name", "duration", "tolerance"), [("none_passive", 0.01, 1e-8), ("lugre", 0.005, 1e-8)])
def test_scipy_s_radau_on_the_readable_model_gives_the_same_motion(scenarios, exact, name, duration, tolerance):
    assert gap(run(scenarios[name], tolerance=tolerance, duration=duration, method="Radau"), exact[name]) < 1e-4


# A linearised flow makes too much of errors where joints stick and slip.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::finger_pin.exceptions.AccuracyWarning")
@pytest.mark.parametrize(
    ("name", "method"), [*zip(["reversals", "stick_slip", "none_passive", "two_passive"], 2 * METHODS, strict=True)]
)
def test_the_energy_account_of_a_whole_simulation_closes_and_the_better_the_tighter(scenarios, name, method):
    """At the default tolerance to a millionth of what the actuators supply; durations are the scenarios' own."""
    duration = {"none_passive": 3.0, "two_passive": 2.0}.get(name)
    shares = [
        open_share(run(scenarios[name], tolerance=tolerance, duration=duration, method=method))
        for tolerance in (1e-4, 1e-6, 1e-8)
    ]
    assert shares[1] < 2e-6
    assert shares[0] > 5.0 * shares[1] > 25.0 * shares[2]


@pytest.fixture(scope="module")
def damped(scenarios):
    """`reversals` with joints so viscous that a small delay of the control has a small effect."""
    table = scenarios["reversals"].model_dump()
    table["finger"]["joint_friction"]["viscous"] = 0.02
    return fp.Scenario.model_validate(table)


@pytest.mark.slow
def test_sampled_control_converges_to_the_continuous_one_with_first_order_in_the_period(damped):
    continuous = run(damped, tolerance=1e-10, duration=0.4, rate=200.0)
    errors = []
    for period in (2.5e-3, 1.25e-3, 6.25e-4):
        sampled = run(damped, tolerance=1e-9, duration=0.4, rate=200.0, control_period=period)
        errors.append(float(abs(sampled.joint_position - continuous.joint_position).max()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("period", "method"), [(5e-3, METHODS[0]), (1e-3, METHODS[1]), (7e-4, METHODS[0])])
def test_the_energy_account_closes_under_sampled_control_and_the_better_the_tighter(scenarios, method, period):
    """The work of a step counts the tensions that were held in it, not those that begin at its end."""
    shares = [
        open_share(run(scenarios["reversals"], tolerance=tolerance, duration=0.3, method=method, control_period=period))
        for tolerance in (1e-5, 1e-7)
    ]
    assert shares[0] < 1e-4
    assert shares[0] > 5.0 * shares[1]


def test_recorded_tensions_are_held_within_a_period_and_step_at_its_multiples(scenarios):
    """3 ms over samples of 0.5 ms: six of each, and each is the law (19)-(22) at the sample that begins the period."""
    scenario, period = scenarios["reversals"], 6
    result = run(scenario, duration=0.0215, rate=2000.0, control_period=3e-3)
    commands = result.tendon_command.values[:, :4]
    assert len(commands) == 44
    controller = ProportionalController.from_scenario(scenario, fp.Finger(scenario.finger).routing)
    for k in range(0, len(commands), period):
        held = commands[k : k + period]
        assert np.all(held == held[0])
        torque = controller.gain * result.tracking_error.values[k]
        minimal = torque @ controller.inverse.T
        level = np.max((controller.minimum - minimal) / controller.internal)
        np.testing.assert_allclose(held[0], (minimal + level * controller.internal)[:4], rtol=1e-9)
        if k > 0:
            assert np.any(held[0] != commands[k - 1])


@dataclass
class Mine:
    """The law (19)-(22) written anew, in Python; breaks if it is told to."""

    coupling: np.ndarray
    broken_after: float = np.inf

    def command(self, time, reference, position, velocity):
        torque = reference.position - position
        shortest = np.linalg.lstsq(self.coupling.T, np.moveaxis(np.atleast_2d(torque), -1, 0), rcond=None)[0].T
        values, vectors = np.linalg.eigh(self.coupling @ self.coupling.T)
        internal = vectors[:, 0] / vectors[np.argmax(np.abs(vectors[:, 0])), 0]
        assert values[0] < 1e-12 * values[-1]
        tension = shortest + np.max((1.0 - shortest) / internal, axis=1)[:, None] * internal
        tension[np.broadcast_to(np.asarray(time) > self.broken_after, len(tension))] = np.nan
        return ControlSignals(torque, tension.reshape(*np.shape(position)[:-1], len(internal)))


@pytest.fixture(scope="module")
def coupling(scenarios):
    return fp.Finger(scenarios["reversals"].finger).coupling


@pytest.mark.slow
def test_a_continuous_controller_in_python_is_integrated_by_scipy_and_gives_the_same_motion(scenarios, exact, coupling):
    result = run(scenarios["reversals"], tolerance=1e-8, duration=0.008, controller=Mine(coupling))
    assert result.attrs["method"] == "Radau"
    assert run(scenarios["reversals"], duration=0.01).attrs["method"] == "Rodas5P"
    assert gap(result, exact["reversals"]) < 1e-4


def test_a_sampled_controller_in_python_gives_the_motion_of_the_built_in_one(scenarios, coupling):
    settings = {"tolerance": 1e-10, "duration": 0.1, "control_period": 2e-3}
    built_in = run(scenarios["reversals"], **settings)
    result = run(scenarios["reversals"], controller=Mine(coupling), **settings)
    assert result.attrs["method"] == "Rodas5P"
    assert gap(result, built_in) < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_controller_that_breaks_ends_the_simulation_there_and_keeps_what_was_computed(
    scenarios, coupling, method
):
    settings = {"duration": 0.05, "control_period": 2e-3, "method": method}
    whole = run(scenarios["reversals"], controller=Mine(coupling), **settings)
    with pytest.raises(IntegrationError) as caught:
        run(scenarios["reversals"], controller=Mine(coupling, broken_after=0.0199), **settings)
    error = caught.value
    assert error.time == pytest.approx(0.02, rel=1e-12)
    assert "controller = nan: tensions must be finite" in error.reason and "that of T1" in error.reason
    kept = error.result
    assert len(kept.time) >= 20
    for name in ("joint_position", "tendon_tension", "energy_residual"):
        np.testing.assert_array_equal(kept[name][:20], whole[name][:20])
    for name, values in kept.data_vars.items():
        assert np.all(np.isfinite(values)), name


@pytest.mark.parametrize("period", [None, 2e-3], ids=["continuous", "sampled"])
def test_a_stop_keeps_what_was_computed(scenarios, period):
    """What an undisturbed run computes up to there, bit by bit but for sums over pieces of other lengths (energies).

    At the very end a controller is not asked any more.
    """
    settings = {"duration": 1.0, "control_period": period}
    seen = []
    with pytest.raises(Interrupted) as caught:
        run(scenarios["reversals"], progress=seen.append, stop=lambda: seen[-1] > 0.3, **settings)
    kept = caught.value.result
    assert 0.3 < caught.value.time < 0.95
    assert seen[-1] == caught.value.time == kept.attrs["end_time"]
    assert np.all(np.diff(seen) > 0.0)
    same = slice(0, len(kept.time) - 1)
    whole = run(scenarios["reversals"], **settings).isel(time=same)
    for name in kept.data_vars:
        rounding = 1e-15 if name.startswith("energy_") else 0.0
        np.testing.assert_allclose(kept[name].isel(time=same), whole[name], rtol=0.0, atol=rounding, err_msg=name)


@pytest.mark.parametrize("period", [None, 3e-3], ids=["continuous", "sampled"])
def test_the_same_simulation_twice_gives_the_same_bits(scenarios, period):
    first, second = (run(scenarios["stick_slip"], duration=0.1, control_period=period) for _ in range(2))
    for name in first.data_vars:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)
    assert first.attrs["solver_steps"] == second.attrs["solver_steps"] > 100


def test_a_failure_of_the_core_tells_time_reason_and_advice_and_keeps_what_was_computed(scenarios, monkeypatch):
    """Whatever the reason: here the integrator is told that its steps have become too short."""
    from finger_pin.core.stepping.island_stepper import IslandIntegrator
    from finger_pin.core.steps import integration

    advance = IslandIntegrator.advance

    def failing(self, *given):
        status, steps = advance(self, *given)
        if self.time > 0.2:
            self.memory.limiting_state[0] = 9.0
            return integration.UNDERFLOW, steps
        return status, steps

    monkeypatch.setattr(IslandIntegrator, "advance", failing)
    with pytest.raises(IntegrationError) as caught:
        run(scenarios["reversals"], duration=1.0)
    monkeypatch.undo()
    error = caught.value
    assert 0.2 < error.time < 0.9
    assert error.reason.endswith("the error is largest in passive_velocity[T5]")
    assert error.advice in str(error) and f"t = {error.time:.6g} s" in str(error)
    whole = run(scenarios["reversals"], duration=1.0).isel(time=slice(0, len(error.result.time)))
    for name in [each for each in whole if each.startswith("energy_exchanged_")] + ["joint_position"]:
        np.testing.assert_array_equal(error.result[name], whole[name])
