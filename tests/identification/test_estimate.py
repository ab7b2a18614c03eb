"""Minima of readings in closed form, against scipy's least squares."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import norm

import finger_pin as fp
from finger_pin.description.loading import load_bench
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.recordings import read_recording
from finger_pin.identification.search.gauss_newton import LOSSES, fit
from finger_pin.identification.search.objective import Objective
from finger_pin.identification.search.search import starting_points

COULOMB, DRAG, TURN = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag", 2.5
LOAD = np.repeat([3.0, 6.0, 9.0, 12.0, 15.0], 6)


def delivered(values):
    """Tension that leaves a canal, by the capstan law and a drag."""
    coulomb, drag = values
    return LOAD * np.exp(-coulomb * TURN) - drag / (1.0 + np.tanh(coulomb * TURN / 2.0))


def problem_of(measured, bounds):
    columns = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}
    entries = {"parameters": bounds, "recordings": {"pull": {"kind": "steady", "speed": 0.05, **columns}}}
    scenario, settings = load_bench("canal", {"finger.tendons.T1.curvature_offset": TURN}, entries)
    data = {"in": LOAD, "out": measured}
    return fitted_residuals(scenario, settings, [read_recording("pull", settings.recordings["pull"], data)])


@pytest.mark.slow
@pytest.mark.parametrize(("loss", "greatest"), [*((loss, 3.0) for loss in LOSSES), ("linear", 0.3), ("soft_l1", 0.3)])
def test_a_minimum_is_that_of_least_squares_with_the_same_loss_and_bounds_inside_and_at_one(loss, greatest):
    measured = delivered((0.12, 0.4)) + np.random.default_rng(5).normal(0.0, 0.05, LOAD.size)
    measured[[4, 20]] += 0.4
    bounds = {COULOMB: (0.005, 1.0), DRAG: (0.0, greatest)}
    objective = Objective(problem_of(measured, bounds))
    parameters = objective.function.parameters
    for start in starting_points(objective, parameters.start, 2, 0):
        found = fit(objective, start, loss=loss)
        # The deviation beyond which readings are outliers: 1.4826 median sizes of a normal distribution.
        size = np.median(np.abs(found.residuals[0])) / norm.ppf(0.75)
        expected = least_squares(
            lambda values: measured - delivered(values),
            (0.2, 0.1),
            bounds=np.transpose(list(bounds.values())),
            loss=loss,
            f_scale=size,
            xtol=1e-12,
            ftol=1e-14,
        )
        assert found.converged
        np.testing.assert_allclose(parameters.values(found.z), expected.x, rtol=2e-4)


COLUMNS = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}


@pytest.mark.parametrize("coulomb", [None, (0.0, 1.0)], ids=["drag alone", "drag and coefficient"])
def test_a_search_that_starts_below_the_floor_of_the_law_ends_at_the_least_squares_of_readings(coulomb):
    """Without friction all readings are their loads: no number has a slope there. In minus out has the drag as mean."""
    measured = delivered((0.12 if coulomb else 0.0, 0.4)) + np.random.default_rng(6).normal(0.0, 0.05, LOAD.size)
    entries = {COULOMB: 0.0, DRAG: 0.0, "finger.tendons.T1.curvature_offset": TURN}
    result = fp.identify(
        "canal",
        parameters={DRAG: (0.0, 3.0)} | ({COULOMB: coulomb} if coulomb else {}),
        recordings={"pull": {"kind": "steady", "speed": 0.05, **COLUMNS}},
        data={"pull": {"in": LOAD, "out": measured}},
        overrides=entries,
        starts=1,
        profiles=False,
        refits=False,
    )
    estimate = dict(zip(result.parameter.values, result.estimate.values, strict=True))
    if coulomb is None:
        assert estimate[DRAG] == pytest.approx(np.mean(LOAD - measured), rel=1e-6)
        assert float(result.noise[0]) == pytest.approx(np.std(LOAD - measured), rel=1e-6)
        return
    slope, offset = np.polyfit(LOAD, measured, 1)
    assert estimate[COULOMB] == pytest.approx(-np.log(slope) / TURN, rel=1e-5)
    assert estimate[DRAG] == pytest.approx(-offset * (1.0 + np.tanh(-np.log(slope) / 2.0)), rel=1e-4)


def test_a_search_that_starts_below_the_floor_of_the_law_ends_at_the_least_squares_of_a_motion():
    time = np.arange(0.0, 1.01, 0.02)
    pull = 3.0 + 4.0 * time
    measured = pull - 0.4 + np.random.default_rng(7).normal(0.0, 0.02, time.size)
    late = time >= 0.3 - 1e-9
    result = fp.identify(
        "canal",
        parameters={DRAG: (0.0, 3.0)},
        recordings={"pull": {"time": "t", "settle": 0.3, **COLUMNS}},
        data={"pull": {"t": time, "in": pull, "out": measured}},
        overrides={COULOMB: 0.0, DRAG: 0.0},
        starts=1,
        profiles=False,
        refits=False,
    )
    # Bristles and viscous friction take some millinewtons.
    assert float(result.estimate[0]) == pytest.approx(np.mean((pull - measured)[late]), abs=5e-3)


def test_starts_fill_the_bounds_evenly_and_again_alike_from_the_same_seed():
    """Of eight Sobol points every eighth of every range has one (a (0, 3)-net in base 2)."""
    objective = Objective(problem_of(delivered((0.12, 0.4)), {COULOMB: (0.005, 1.0), DRAG: (0.0, 3.0)}))
    (low, high), start = objective.box, objective.function.parameters.start
    first, again, other = (np.array(starting_points(objective, start, 3, seed)[1:]) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    eighths = np.sort(np.floor(8.0 * (first - low) / (high - low)), axis=0)
    np.testing.assert_array_equal(eighths, np.transpose([np.arange(8.0)] * 2))
    assert len(starting_points(objective, start, 1, 0)) == 1


@pytest.mark.parametrize("gain", [1.0, 1.1])
def test_what_is_found_of_an_output_leaves_the_same_when_it_is_written_at_its_column(gain):
    """A load cell that tells gain (f + 0.5 N): f is its column over the gain less 0.5 N."""
    noise = np.random.default_rng(8).normal(0.0, 0.01, LOAD.size)
    measured = gain * (delivered((0.12, 0.4)) + 0.5 + noise)

    def fitted(column, bounds):
        recording = {"kind": "steady", "speed": 0.05, **COLUMNS}
        recording["outputs"] = {"tendon_tension.T1": {"column": "out", **column}}
        if bounds:
            recording["parameters"] = {f"tendon_tension.T1.{key}": each for key, each in bounds.items()}
        return fp.identify(
            "canal",
            # Coefficient and gain are one slope: beside a gain it is known.
            parameters={COULOMB: (0.005, 1.0) if gain == 1.0 else (0.1199, 0.1201)},
            recordings={"pull": recording},
            data={"pull": {"in": LOAD, "out": measured}},
            overrides={DRAG: 0.4, "finger.tendons.T1.curvature_offset": TURN},
            starts=1,
            profiles=False,
            refits=False,
        )

    bounds = {"offset": (-2.0, 2.0)} | ({"scale": (0.5, 2.0)} if gain != 1.0 else {})
    sought = fitted({}, bounds)
    found = dict(zip(bounds, sought.estimate.values[1:].tolist(), strict=True))
    assert found["offset"] == pytest.approx(-0.5, abs=0.05)
    assert found.get("scale", 1.0) == pytest.approx(1.0 / gain, abs=0.01)
    written = fitted(found, {})
    np.testing.assert_allclose(written.estimate[0], sought.estimate[0], rtol=1e-5)
    # Residuals are those of the column as it is compared: in its own numbers, or in those that it is led to.
    np.testing.assert_allclose(written.residual, found.get("scale", 1.0) * sought.residual, atol=1e-6)


def test_a_scale_of_an_output_that_may_be_zero_is_refused():
    with pytest.raises(fp.InputError, match=r"T1\.scale = \[-1\.0, 1\.0\]: must not reach 0"):
        problem_of(LOAD, {COULOMB: (0.005, 1.0), "recordings.*.tendon_tension.T1.scale": (-1.0, 1.0)})
