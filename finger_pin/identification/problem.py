"""The problem of an identification: parameters, bounds, and residuals of its recordings."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.threads import in_threads
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.likelihood import NoiseGrowth, means_of, minus_twice_likelihood
from finger_pin.identification.limits import Limits
from finger_pin.identification.recordings import At, RecordedSignal, RecordingModel, unit_of
from finger_pin.identification.scenario_parameters import (
    ScenarioPart,
    acts_on,
    check_apart,
    check_single,
    is_of_scenario,
    key_in,
    owner,
)
from finger_pin.typing import Array

# Tolerances of fine and rough runs over the scenario's, and the number of means of every output that rough searches
# compare, at least twice that of parameters: where something rings each is over some cycles.
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
        fixed: Values that the scenario is given first, by key.
        stop: Asked before every evaluation.
        evaluations: Number of scenarios computed.
        best: The least objective so far, and where.
        finely: Whether the errors of what is computed are smaller than the scenario asks.
        units: SI units of all columns, by recording and name.
        means: Of how many samples in a row, at the most, the mean is met in place of each, by signal; none: of one.
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
    finely: bool = False
    means: Sequence[int] = ()

    def __post_init__(self) -> None:
        """Check that every key allows its bounds; nuisance parameters of the recordings join the parameters."""
        self.asked = len(self.keys)
        self.growth = NoiseGrowth.from_signals(self.signals, self.groups)
        self._slopes: tuple[Array, list[Array]] | None = None
        further = [
            nuisance for model in self.models for nuisance in model.nuisance_parameters if nuisance.key not in self.keys
        ]
        self.keys = (*self.keys, *(nuisance.key for nuisance in further))
        self.low = np.append(self.low, [nuisance.low for nuisance in further])
        self.high = np.append(self.high, [nuisance.high for nuisance in further])
        recordings = [model.recording for model in self.models]
        self.units = {
            f"{each.name}.{name}": unit_of(name) for each in recordings for name in (*each.inputs, *each.outputs)
        }
        check_single(self.keys, dict.fromkeys(each.name for each in recordings))
        self._numbers = np.array(
            [k for k, key in enumerate(self.keys[: self.asked]) if is_of_scenario(key, self.units)], dtype=int
        )
        keys = tuple(self.keys[k] for k in self._numbers)

        def part(model: RecordingModel) -> ScenarioPart:
            scenario = model.scenario
            check_apart(model.recording.name, model.recording.settings, [*keys, *self.fixed])
            if self.fixed:
                scenario = ParametrisedScenario(scenario, tuple(self.fixed)).with_values(list(self.fixed.values()))
            return ScenarioPart.from_keys(scenario, model.recording.name, keys)

        self._parts = [part(model) for model in self.models]
        self.logarithmic = self.low > 0.0
        # Of recordings that are alike in what limits parameters one is enough.
        by_recording = {model.recording.name: k for k, model in reversed(list(enumerate(self.models)))}
        constraining = {m.recording.name for m in self.models if m.recording.settings.values} | {
            name for name in by_recording for key in keys if owner(key) and acts_on(key, name)
        }
        parts = [self._parts[k] for k in sorted({0, *(by_recording[name] for name in constraining)})]
        self._limits = Limits.from_parts(parts, keys, self.low[self._numbers], self.high[self._numbers])
        known: dict[str, Any] = {nuisance.key: nuisance.start for nuisance in further}
        for part_of_recording in reversed(parts):
            known |= zip([keys[k] for k in part_of_recording.places], part_of_recording.family.values, strict=True)
        neutral = {"offset": 0.0, "scale": 1.0, "delay": 0.0}
        middle = self.values(0.5 * (self.to_search(self.low) + self.to_search(self.high)))
        known_values = [known.get(key, neutral.get(key.rpartition(".")[2])) for key in self.keys]
        start = [float(v) if isinstance(v, int | float) else m for v, m in zip(known_values, middle, strict=True)]
        self.start: Array = self.feasible(self.to_search(np.clip(start, self.low, self.high)))

    def feasible(self, z: Array, free: NDArray[np.bool_] | None = None) -> Array:
        """Return z, shape (p,), or the nearest allowed point, by changing only the free parameters (all by default)."""
        values, places = self.values(z), self._numbers
        allowed = self._limits.nearest(values[places], None if free is None else free[places])
        changed = allowed != values[places]
        values[places] = allowed
        return self.to_search(values) if changed.any() else z

    @property
    def moves(self) -> bool:
        """Whether a recording is of a motion."""
        return any(signal.ordered for signal in self.signals)

    @property
    def groups(self) -> NDArray[np.intp]:
        """The number of the output that every signal is of: windows of one share its noise."""
        names = [f"{signal.recording}.{signal.name}" for signal in self.signals]
        order = list(dict.fromkeys(names))
        return np.array([order.index(name) for name in names], dtype=np.intp)

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
            return self._smooth(errors)
        residuals = self._smooth(self.growth.weigh(errors) if self.growth.acts else errors)
        objective = minus_twice_likelihood(residuals, np.ones(len(residuals)), self.groups, self.least_noise)
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
            places = [at(values) for at in self._places()]
        except InputError:
            return [np.full(len(s.measured), np.inf) for s in self.signals]
        pairs = list(zip(self.models, places, strict=True))
        # Closed forms hold Python's lock.
        by_model = in_threads(_compute, pairs) if self.moves else map(_compute, pairs)
        computed = [output for outputs in by_model for output in outputs]
        errors = [s.measured - c[s.rows] for s, c in zip(self.signals, computed, strict=True)]
        return errors if all(np.isfinite(e).all() for e in errors) else [np.full(len(e), np.inf) for e in errors]

    def slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of the residuals by z, shape (m, p) each."""
        if self._slopes is not None and np.array_equal(self._slopes[0], z):
            return self._slopes[1]
        slopes = self.error_slopes(z)
        slopes = self._smooth(self.growth.weigh_slopes(self.errors(z), slopes) if self.growth.acts else slopes)
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
            for model, at in zip(self.models, self._places(), strict=True)
            for each in model.slopes(at, values, sizes)
        ]
        self.evaluations += 2 * len(z)
        stretch = np.where(self.logarithmic, values, 1.0)
        return [-each[s.rows] * stretch for each, s in zip(derivatives, self.signals, strict=True)]

    def alone(self) -> Problem:
        """Return a copy of the problem with separate memory, for another thread."""
        twin = copy.copy(self)
        twin.models = [copy.copy(model) for model in self.models]
        twin.evaluations, twin.best = 0, (math.inf, np.zeros(0))
        return twin

    def fine(self) -> Problem:
        """Return the same problem, computed with smaller errors: those of runs make the likelihood jump from z to z.

        Where thousands of samples tell a number, it jumps by as much as a quarter of what ends an interval.
        """
        twin = self._tuned(_FINE_TOLERANCE)
        twin.finely = True
        return twin

    def rough(self) -> Problem:
        """Return the same problem for means over some cycles of motions, computed with larger errors.

        Where something rings, a likelihood of samples has a minimum for every cycle by which a model is late; that of
        means over some cycles has few.
        """
        twin = self._tuned(_ROUGH_TOLERANCE)
        twin.means = self._stretches()
        return twin

    def averaged(self, values: Sequence[Array]) -> list[Array]:
        """Return the means that count roughly of residuals of every signal, or of their slopes."""
        return means_of(values, self._stretches())

    def _stretches(self) -> list[int]:
        """Return the number of samples in a row whose mean counts in rough searches, by signal."""
        groups, count = self.groups, [len(signal.measured) for signal in self.signals]
        size = np.bincount(groups, count)[groups]
        share = np.minimum(size / max(_MEAN_COUNT, 2 * len(self.keys)), count)
        return [max(int(n), 1) if s.ordered else 1 for s, n in zip(self.signals, share, strict=True)]

    def _tuned(self, factor: float) -> Problem:
        twin = self.alone()
        twin._slopes = None
        for model in twin.models:
            model.tune(factor)
        return twin

    def _smooth(self, values: list[Array]) -> list[Array]:
        """Return means of as many samples in a row as are asked for."""
        return means_of(values, self.means) if self.means else values

    def join(self, twin: Problem) -> None:
        """Add the evaluations of a twin, and take its best point if that is better, or if there is none yet."""
        self.evaluations += twin.evaluations
        if list(twin.means) != list(self.means):
            self.best = self.best if len(self.best[1]) else (math.inf, twin.best[1])
            return
        self._slopes = twin._slopes or self._slopes
        self.best = min(self.best, twin.best, key=lambda point: point[0])

    def _places(self) -> list[At]:
        """Return the scenario at given values, and the numbers of recordings themselves, for every model."""
        others = sorted({*range(len(self.keys))} - {*self._numbers.tolist()})

        def of(part: ScenarioPart, recording: str) -> At:
            keys = [(k, key_in(self.keys[k], recording)) for k in others]

            def at(values: Array) -> tuple[Scenario, dict[str, float]]:
                return part.at(values[self._numbers]), {key: float(values[k]) for k, key in keys}

            return at

        return [of(part, model.recording.name) for part, model in zip(self._parts, self.models, strict=True)]

    def subset(self, kept: Sequence[NDArray[np.bool_]]) -> Problem:
        """Return the problem with some of the samples of every signal."""
        by_sample = ("measured", "rows", "instant", "load", "replicate")
        signals = [
            replace(signal, **{name: getattr(signal, name)[samples] for name in by_sample})
            for signal, samples in zip(self.signals, kept, strict=True)
        ]
        bounds = self.keys[: self.asked], self.low[: self.asked], self.high[: self.asked]
        return Problem(self.scenario, *bounds, self.models, signals, self.fixed, self.stop)


def _compute(pair: tuple[RecordingModel, tuple[Scenario, dict[str, float]]]) -> list[Array]:
    """Return the outputs of a recording at a place."""
    model, place = pair
    return model.compute(*place)
