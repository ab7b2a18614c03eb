"""The problem of an identification: parameters, bounds, and residuals of its recordings."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.likelihood import (
    NoiseGrowth,
    block_means,
    minus_twice_likelihood,
    noise_groups,
    numbered,
)
from finger_pin.identification.limits import Limits
from finger_pin.identification.recordings import RecordedSignal, RecordingModel, ScenarioMap, unit_of
from finger_pin.identification.scenario_parameters import (
    ScenarioPart,
    acts_on,
    check_duplicates,
    check_shadowing,
    is_scenario_key,
    key_in,
    recording_pattern,
    scenario_parts,
)
from finger_pin.threads import in_threads
from finger_pin.typing import Array

# Tolerances of fine and rough runs over the scenario's, and the least number of block means of every output in rough
# searches, at least twice that of parameters: of a ringing signal each block covers some cycles.
_FINE_TOLERANCE, _ROUGH_TOLERANCE, _MEAN_COUNT = 0.1, 10.0, 40


class Stopped(Exception):
    """Stop of an identification that its caller asked for."""


@dataclass(eq=False)
class Problem:
    """Recordings and the parameters to be found in them; positive ones are searched for as logarithms.

    Attributes:
        scenario: Scenario with all other numbers.
        keys: Dotted keys.
        low: Least values.
        high: Greatest values.
        models: A model for each recording.
        signals: All outputs, in the order of the models.
        groups: Number of the output of each, whose windows are several signals.
        noise_groups: Number of the noise of each.
        fixed: Values that the scenario is given first, by key.
        stop: Asked before every evaluation.
        evaluations: Number of scenarios computed.
        best: The least objective so far, and where.
        is_fine: Whether runs have smaller tolerances than the scenario's.
        units: SI units of all columns, by recording and name.
        block_sizes: Number of consecutive samples whose mean is fitted in place of each, by signal; empty for one.
    """

    scenario: Scenario
    keys: tuple[str, ...]
    low: Array
    high: Array
    models: Sequence[RecordingModel]
    signals: Sequence[RecordedSignal]
    fixed: Mapping[str, float]
    stop: Callable[[], bool] = lambda: False
    evaluations: int = 0
    best: tuple[float, Array] = (math.inf, np.zeros(0))
    is_fine: bool = False
    block_sizes: Sequence[int] = ()

    def __post_init__(self) -> None:
        """Check that every key allows its bounds; nuisance parameters of the recordings join the parameters."""
        self.requested_count = len(self.keys)
        self.groups = numbered([f"{signal.recording}.{signal.name}" for signal in self.signals])
        self.noise_groups = noise_groups(self.signals)
        self.growth = NoiseGrowth.from_signals(self.signals, self.noise_groups)
        self._slopes: tuple[Array, list[Array]] | None = None
        nuisances = [
            nuisance for model in self.models for nuisance in model.nuisance_parameters if nuisance.key not in self.keys
        ]
        self.keys = (*self.keys, *(nuisance.key for nuisance in nuisances))
        self.low = np.append(self.low, [nuisance.low for nuisance in nuisances])
        self.high = np.append(self.high, [nuisance.high for nuisance in nuisances])
        recordings = [model.recording for model in self.models]
        columns = [(each.name, name) for each in recordings for name in (*each.inputs, *each.outputs)]
        self.units = {f"{recording}.{name}": unit_of(name) for recording, name in columns}
        check_duplicates(self.keys, dict.fromkeys(each.name for each in recordings))
        requested = self.keys[: self.requested_count]
        self._scenario_indices = np.flatnonzero([is_scenario_key(key, self.units) for key in requested])
        keys = tuple(self.keys[k] for k in self._scenario_indices)

        for recording in recordings:
            check_shadowing(recording.name, recording.settings, [*keys, *self.fixed])
        self._parts = scenario_parts([(each.scenario, each.recording.name) for each in self.models], keys, self.fixed)
        self.logarithmic = self.low > 0.0
        # One recording stands for all that limit parameters alike.
        by_recording = {model.recording.name: k for k, model in reversed(list(enumerate(self.models)))}
        constraining = {m.recording.name for m in self.models if m.recording.settings.values} | {
            name for name in by_recording for key in keys if recording_pattern(key) and acts_on(key, name)
        }
        parts = [self._parts[k] for k in sorted({0, *(by_recording[name] for name in constraining)})]
        low, high = self.low[self._scenario_indices], self.high[self._scenario_indices]
        self._limits = Limits.from_parts(parts, keys, low, high)
        start_values: dict[str, Any] = {nuisance.key: nuisance.start for nuisance in nuisances}
        for scenario_part in reversed(parts):
            start_values |= zip([keys[k] for k in scenario_part.indices], scenario_part.family.values, strict=True)
        neutral = {"offset": 0.0, "scale": 1.0, "delay": 0.0}
        middle = self.values(0.5 * (self.to_search(self.low) + self.to_search(self.high)))
        default_start = [start_values.get(key, neutral.get(key.rpartition(".")[2])) for key in self.keys]
        start = [float(v) if isinstance(v, int | float) else m for v, m in zip(default_start, middle, strict=True)]
        self.start: Array = self.feasible(self.to_search(np.clip(start, self.low, self.high)))

    def feasible(self, z: Array, free: NDArray[np.bool_] | None = None) -> Array:
        """Return z, shape (p,), or the nearest allowed point, by changing only the free parameters (all by default)."""
        values, indices = self.values(z), self._scenario_indices
        allowed = self._limits.nearest_allowed(values[indices], None if free is None else free[indices])
        changed = allowed != values[indices]
        values[indices] = allowed
        return self.to_search(values) if changed.any() else z

    @property
    def has_motion(self) -> bool:
        """Whether a recording is of a motion."""
        return any(signal.ordered for signal in self.signals)

    @property
    def least_noise(self) -> Array:
        """The least standard deviation of the residuals of every signal, shape (s,), in its unit."""
        return self.growth.floor

    def to_search(self, values: Array) -> Array:
        """Return the search variables of values: logarithms of positive ones."""
        safe = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(safe), values)

    def values(self, z: Array) -> Array:
        """Return the values that are searched for at z."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, z, 0.0)), z)

    @property
    def box(self) -> tuple[Array, Array]:
        """The bounds of the search."""
        return self.to_search(self.low), self.to_search(self.high)

    def residuals(self, z: Array) -> list[Array]:
        """Return the residuals of every signal, shape (m,) each; infinite where values do not go together.

        They are measured less computed, where noise grows with readings over that growth.
        """
        errors = self.errors(z)
        if not all(np.isfinite(e).all() for e in errors):
            return self._averaged(errors)
        residuals = self._averaged(self.growth.weigh(errors) if self.growth.active else errors)
        objective = minus_twice_likelihood(residuals, np.ones(len(residuals)), self.noise_groups, self.least_noise)
        if objective < self.best[0]:
            self.best = (objective, z.copy())
        return residuals

    def errors(self, z: Array) -> list[Array]:
        """Return the errors of every signal, measured less computed, shape (m,) each, or infinite ones."""
        if self.stop():
            raise Stopped
        self.evaluations += 1
        values = self.values(z)
        try:
            points = [scenario_map(values) for scenario_map in self.scenario_maps()]
        except InputError:
            return [np.full(len(s.measured), np.inf) for s in self.signals]
        pairs = list(zip(self.models, points, strict=True))
        # Closed forms do not release the GIL.
        by_model = in_threads(_compute, pairs) if self.has_motion else map(_compute, pairs)
        computed = [output for outputs in by_model for output in outputs]
        errors = [s.measured - c[s.rows] for s, c in zip(self.signals, computed, strict=True)]
        return errors if all(np.isfinite(e).all() for e in errors) else [np.full(len(e), np.inf) for e in errors]

    def slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of the residuals by z, shape (m, p) each."""
        if self._slopes is not None and np.array_equal(self._slopes[0], z):
            return self._slopes[1]
        slopes = self.error_slopes(z)
        slopes = self._averaged(self.growth.weigh_slopes(self.errors(z), slopes) if self.growth.active else slopes)
        self._slopes = (z.copy(), slopes)
        return slopes

    def error_slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of measured less computed by z, shape (m, p) each."""
        if self.stop():
            raise Stopped
        values = self.values(z)
        sizes = np.where(self.logarithmic, values, self.high - self.low)
        derivatives = [
            each
            for model, scenario_map in zip(self.models, self.scenario_maps(), strict=True)
            for each in model.slopes(scenario_map, values, sizes)
        ]
        self.evaluations += 2 * len(z)
        stretch = np.where(self.logarithmic, values, 1.0)
        return [-each[s.rows] * stretch for each, s in zip(derivatives, self.signals, strict=True)]

    def thread_copy(self) -> Problem:
        """Return a copy of the problem with separate memory, for another thread."""
        twin = copy.copy(self)
        twin.models = [copy.copy(model) for model in self.models]
        twin.evaluations, twin.best = 0, (math.inf, np.zeros(0))
        return twin

    def fine(self) -> Problem:
        """Return the same problem, computed with smaller errors: those of runs make the likelihood jump from z to z.

        With thousands of samples, it jumps by as much as a quarter of the rise at an interval's end.
        """
        twin = self._with_tolerances(_FINE_TOLERANCE)
        twin.is_fine = True
        return twin

    def rough(self) -> Problem:
        """Return the same problem for means over some cycles of motions, computed with larger errors.

        Where something rings, a likelihood of samples has a minimum for every cycle by which a model is late; that of
        means over some cycles has few.
        """
        twin = self._with_tolerances(_ROUGH_TOLERANCE)
        twin.block_sizes = self._block_sizes()
        return twin

    def block_means(self, values: Sequence[Array]) -> list[Array]:
        """Return block means, as in rough searches, of residuals of every signal or of their slopes."""
        return block_means(values, self._block_sizes())

    def _block_sizes(self) -> list[int]:
        """Return the number of consecutive samples per block in rough searches, by signal."""
        groups, count = self.groups, [len(signal.measured) for signal in self.signals]
        size = np.bincount(groups, count)[groups]
        share = np.minimum(size / max(_MEAN_COUNT, 2 * len(self.keys)), count)
        return [max(int(n), 1) if s.ordered else 1 for s, n in zip(self.signals, share, strict=True)]

    def _with_tolerances(self, factor: float) -> Problem:
        twin = self.thread_copy()
        twin._slopes = None
        for model in twin.models:
            model.scale_tolerances(factor)
        return twin

    def _averaged(self, values: list[Array]) -> list[Array]:
        """Return values averaged over the problem's blocks of samples, if any."""
        return block_means(values, self.block_sizes) if self.block_sizes else values

    def join(self, twin: Problem) -> None:
        """Add the evaluations of a twin, and take its best point if that is better, or if there is none yet."""
        self.evaluations += twin.evaluations
        if list(twin.block_sizes) != list(self.block_sizes):
            self.best = self.best if len(self.best[1]) else (math.inf, twin.best[1])
            return
        self._slopes = twin._slopes or self._slopes
        self.best = min(self.best, twin.best, key=lambda point: point[0])

    def scenario_maps(self) -> list[ScenarioMap]:
        """Return, for every model, the map from values to its scenario and nuisance parameters."""
        nuisance_indices = sorted({*range(len(self.keys))} - {*self._scenario_indices.tolist()})

        def scenario_map(part: ScenarioPart, recording: str) -> ScenarioMap:
            keys = [(k, key_in(self.keys[k], recording)) for k in nuisance_indices]

            def scenario_at(values: Array) -> tuple[Scenario, dict[str, float]]:
                return part.scenario_at(values[self._scenario_indices]), {key: float(values[k]) for k, key in keys}

            return scenario_at

        return [scenario_map(part, model.recording.name) for part, model in zip(self._parts, self.models, strict=True)]

    def subset(self, masks: Sequence[NDArray[np.bool_]]) -> Problem:
        """Return the problem with some of the samples of every signal."""
        by_sample = ("measured", "rows", "instant", "load", "replicate")
        signals = [
            replace(signal, **{name: getattr(signal, name)[samples] for name in by_sample})
            for signal, samples in zip(self.signals, masks, strict=True)
        ]
        count = self.requested_count
        keys, low, high = self.keys[:count], self.low[:count], self.high[:count]
        return Problem(self.scenario, keys, low, high, self.models, signals, self.fixed, self.stop)


def _compute(pair: tuple[RecordingModel, tuple[Scenario, dict[str, float]]]) -> list[Array]:
    """Return the outputs of a recording at a place."""
    model, place = pair
    return model.compute(*place)
