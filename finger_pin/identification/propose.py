"""Optimal design of the next experiment: ranking of motions by their sensitivities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.residuals.motions import labelled
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.simulation.prepared import prepare
from finger_pin.simulation.recording import RunArrays
from finger_pin.typing import Array


def propose(
    scenario: ScenarioLike,
    candidates: Mapping[str, Mapping[str, Any]],
    parameters: Mapping[str, Sequence[float]],
    outputs: Mapping[str, float],
    *,
    overrides: Mapping[str, Any] | None = None,
    finger: FingerLike | None = None,
    prior: Mapping[str, float] | None = None,
    rate: float = 100.0,
) -> xr.Dataset:
    """Rank motions by their information on the parameters: D-optimal, the greatest determinant first.

        fp.propose("canal", {"slow": {...}, "fast": {...}}, {"finger.tendon_friction.coulomb": (0.01, 1.0)},
                   {"tendon_tension.T1": 0.05})

    Args:
        scenario: The scenario to identify, its name, or the path of a file.
        candidates: By name, the entries in which the motion of each differs.
        parameters: By dotted key, the least and the greatest value; sure to that much without any motion.
        outputs: Signals that would be measured, by variable.label, and their noise, SI, rms.
        overrides: Entries of all of them, such as what is known by now.
        finger: Replaces the finger that the scenario describes, as for `fp.simulate`.
        prior: By key, standard deviations that earlier recordings have left, in units of the parameter.
        rate: Of independent samples, Hz: of a model at 1 kHz only some are.

    Returns:
        Along ``candidate``, the best first: ``log_determinant``, and by ``parameter`` the ``deviation`` that the motion
        would leave, together with what is known.
    """
    _check(candidates, parameters, outputs, prior or {})
    keys = list(parameters)
    low, high = np.array(list(parameters.values()), dtype=float).T
    # Without a prior, bounds are two deviations from their middle.
    deviations = np.array([(prior or {}).get(key, (b - a) / 4.0) for key, a, b in zip(keys, low, high, strict=True)])
    variables = tuple(dict.fromkeys(name.partition(".")[0] for name in outputs))
    outcomes: dict[str, tuple[float, Array]] = {}
    for name, candidate in candidates.items():
        entries = {**(overrides or {}), "simulation.sample_rate": rate, **candidate}
        run = prepare(load_scenario(scenario, entries), keys, variables, finger=finger).run(sensitivities=True)
        information = np.diag(1.0 / deviations**2) + sum(_information(run, *each) for each in outputs.items())
        scaled = information * np.outer(deviations, deviations)
        outcomes[name] = (float(np.linalg.slogdet(scaled)[1]), np.sqrt(np.diag(np.linalg.inv(scaled))) * deviations)
    order = sorted(outcomes, key=lambda name: -outcomes[name][0])
    determinant = {"units": "1", "long_name": "of the information over that without it"}
    return xr.Dataset(
        {
            "log_determinant": ("candidate", [outcomes[name][0] for name in order], determinant),
            "deviation": (("candidate", "parameter"), [outcomes[name][1] for name in order]),
        },
        {"candidate": order, "parameter": keys},
    )


def _information(run: RunArrays, output: str, noise: float) -> Array:
    """Return the Fisher information of an output with noise, shape (p, p), while the derivatives hold."""
    by_label = np.moveaxis(run.slopes[output.partition(".")[0]], 0, -1)
    slopes = labelled(run, output, "outputs", by_label).T[:, run.time < run.attrs["sensitivities_lost"]]
    return np.asarray(slopes @ slopes.T / noise**2)


def _check(
    candidates: Mapping[str, Any],
    parameters: Mapping[str, Sequence[float]],
    outputs: Mapping[str, float],
    prior: Mapping[str, float],
) -> None:
    for entry, table in (("candidates", candidates), ("parameters", parameters), ("outputs", outputs)):
        if not table:
            raise InputError(entry, "must have at least one entry")
    for key, bounds in parameters.items():
        is_pair = np.shape(bounds) == (2,) and all(isinstance(each, Real) for each in bounds)
        if not (is_pair and -np.inf < bounds[0] < bounds[1] < np.inf):
            raise InputError(f"parameters.{key}", "must be the least and the greatest value", bounds)
    for entry, numbers in (("outputs", outputs), ("prior", prior)):
        for key, value in numbers.items():
            if not (isinstance(value, Real) and 0.0 < value < np.inf):
                raise InputError(f"{entry}.{key}", "must be a number above 0", value)
    for key in prior:
        if key not in parameters:
            raise InputError(f"prior.{key}", f"is none of the parameters {', '.join(parameters)}")
