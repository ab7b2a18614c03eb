"""An observer: angles, tensions and contact forces from motor signals, with bands, one period after the other."""

from __future__ import annotations

import copy
import time
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import scipy.stats
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.core.jit import pack
from finger_pin.core.stepping.period_map import PeriodMap
from finger_pin.description.loading import ScenarioLike, load_scenario, to_toml
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import as_packed
from finger_pin.mechanism.finger import Finger
from finger_pin.observation.estimate import TENSIONS, Band, Estimate
from finger_pin.observation.filter import FILTER_ARGS, JUMP, FilterArgs, correct, predict, spread
from finger_pin.observation.noise import assumed_forces, hidden_tension, period_noise, start_covariance, start_state
from finger_pin.observation.record import Record
from finger_pin.observation.sensors import Sensors
from finger_pin.observation.touch import TouchMonitor
from finger_pin.observation.uncertainty import Uncertainty
from finger_pin.simulation.frames import scene_metadata
from finger_pin.simulation.simulator import Simulator
from finger_pin.typing import Array

# The longest correction by a reading, of the scale of each number; tolerance of the prediction: 1e-4 is no truer.
_REACH, _TOLERANCE = 0.05, 1e-3
# After so many periods without a reading that fits the estimate is off by as much, of the scale of each number.
_MAX_MISSED, _LOST = 50, 0.1


class Observer:
    """What a finger does, from readings of its sensors, with bands, one period after the other.

        observer = fp.observe("wound")
        observer.start(motor_position={"servo": 0.0})
        while True:
            now = observer.step({"motor_position.servo": angle, "motor_current.servo": current})

    Attributes:
        finger: The finger of the model, without surroundings: what it touches is to be found.
        uncertainty: Numbers of the model that are not known exactly.
        sensors: What may be read.
        period: s.
        level: Of the bands.
        tips: At which forces are estimated; empty of a finger's only one.
        removed: Names of the scenario's objects, which the model does not have.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        *,
        uncertain: Mapping[str, float] | xr.Dataset | None = None,
        sensors: Mapping[str, Mapping[str, float]] | None = None,
        forces: Iterable[str] | Mapping[str, float] = ("fingertip",),
        period: float = 1e-3,
        level: float = 0.95,
    ) -> None:
        """Make a model of a scenario's finger, and start at rest where the scenario does; see `observe`."""
        loaded, forces = load_scenario(scenario), forces if isinstance(forces, Mapping) else tuple(forces)
        self._again = partial(type(self), loaded, uncertain=uncertain, sensors=sensors, forces=forces)
        self._again.keywords.update(period=period, level=level)
        if not 0.0 < period <= 0.1:
            raise InputError("period", "must be above 0 and at most 0.1 s", period)
        if not 0.0 < level < 1.0:
            raise InputError("level", "must be above 0 and below 1", level)
        # What surrounds the finger is not known to it.
        self.removed, loaded = tuple(loaded.environment.objects or ()), loaded.updated(environment={"objects": {}})
        finger = self.finger = Finger(loaded.finger)
        self.scenario, self.period, self.level = loaded, float(period), float(level)
        self.uncertainty = Uncertainty.from_scenario(loaded, finger, uncertain)
        self._rest = Simulator.from_scenario(loaded, finger=finger).x
        self._periods = PeriodMap(
            finger, self._rest, self.uncertainty.varied, currents=True, rtol=_TOLERANCE, atol_scale=_TOLERANCE
        )
        tips = finger.description.tree.tip_names or (tuple(loaded.hand.fingers) if loaded.hand else ("",))
        self._force_at, self._force_deviation = assumed_forces(tips, forces)
        self.tips = tuple(tips[k // 3] for k in self._force_at[::3])
        names = [f"fingertip_force.{tips[k // 3]}.{'xyz'[k % 3]}".replace("..", ".") for k in self._force_at]
        self.sensors = Sensors.from_finger(finger, names, sensors)
        self._quantile = float(scipy.stats.norm.ppf(0.5 + 0.5 * level))
        watched = [name for name in TENSIONS if name in finger.signal_table]
        self._hidden = np.tile(self._quantile * hidden_tension(finger, self.sensors), len(watched))
        self._each = len(watched), len(finger.routing.tendons)
        self._periods.watch(watched)
        size, held = len(self._periods.x), self._periods.derivatives.shape[1]
        self._columns = np.r_[
            np.arange(size), size + len(self._periods.inputs) + self._force_at, held - len(self.uncertainty.keys) : held
        ]
        self._covariance = np.zeros((len(self._columns), len(self._columns)))
        levels = self._periods.limit_bristles()
        self._levels = np.minimum(levels, finger.layout.scales(), out=levels)
        self._bind((), self.period)
        self.start()

    def _bind(self, read: tuple[str, ...], h: float) -> None:
        """Bind the filter to the sensors that are read, and to a period, s."""
        periods, finger = self._periods, self.finger
        size, forces, inputs = len(periods.x), len(self._force_at), len(periods.inputs)
        wide = size + forces + len(self.uncertainty.keys)
        noise, decay = period_noise(finger, self._force_deviation, h)
        self._filter = FilterArgs(
            advance=periods.advance_address,
            limit=periods.limit_address,
            period=periods.address,
            state=periods.x,
            forces=periods.forces,
            derivatives=periods.derivatives,
            covariance=self._covariance,
            map=np.zeros((size, wide)),
            product=np.zeros((size, wide)),
            force_at=self._force_at,
            decay=decay,
            noise=noise,
            input_variance=np.zeros(inputs),
            places=self.sensors.places(read),
            readings=np.full(len(read), np.nan),
            variance=np.array([self.sensors.deviation[name] for name in read], dtype=float) ** 2,
            levels=self._levels,
            reach=_REACH * finger.layout.scales(),
            innovations=np.zeros(len(read)),
            gain=np.zeros(wide),
            slopes=periods.watched()[1],
            columns=self._columns,
            signal_variance=np.zeros(len(self._hidden)),
            considered=np.zeros(size),
            distance=np.zeros(forces // 3),
        )
        self._block, self._bound = pack(self._filter, FILTER_ARGS), (read, h)

    def start(
        self,
        motor_position: Mapping[str, float] | None = None,
        position: ArrayLike | None = None,
        *,
        state: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
    ) -> Estimate:
        """Start at rest at time zero, with a new record; return the estimate there.

        Args:
            motor_position: By motor theta_m, rad; others wind their tendons just taut.
            position: theta, shape (n,), rad; by default where the scenario's finger starts, or what the motors tell.
            state: Packed state, shape (size,), in place of both.
            covariance: Of the state, shape (size, size); by default 0.01 rad, and bristles of half their levels.

        Raises:
            InputError: Naming the argument that is wrong.
        """
        finger, periods = self.finger, self._periods
        size, joints = len(periods.x), len(finger.routing.joints)
        if state is None:
            x, left_open = start_state(self.scenario, finger, self._rest.copy(), motor_position or {}, position)
        else:
            x, left_open = as_packed(finger, state, "state"), np.zeros((joints, joints))
        periods.restart(x, 0.0)
        periods.inputs[:] = periods.forces[:] = 0.0
        levels = periods.limit_bristles()
        p = self._covariance
        p[:] = 0.0
        p[:size, :size] = start_covariance(finger, self.sensors, levels) if covariance is None else covariance
        p[:joints, :joints] += left_open if covariance is None else 0.0
        at = np.arange(size, len(p))
        p[at, at] = np.concatenate([self._force_deviation, self.uncertainty.deviations]) ** 2
        self._last, self._missed = dict[str, float](), 0
        self._touch, self._record = TouchMonitor(len(self.tips)), Record(finger, self.tips)
        return self._estimate(self._spread(), (), "")

    def step(self, readings: Mapping[str, float], period: float | None = None) -> Estimate:
        """Go on by a period, and correct what is known by the readings at its end.

        Args:
            readings: By name, in SI: every input, ``motor_current.M1``, A, or ``tensions.T1``, N, and what sensors
                read, ``motor_position.M1``, rad. NaN is a reading that is missing.
            period: s; by default that of the observer.

        Raises:
            InputError: If a name is none, or an input is left out.
        """
        begin, whole = time.perf_counter(), self.period if period is None else float(period)
        if not 0.0 < whole < np.inf:
            raise InputError("period", "must be above 0 s", period)
        read = tuple(name for name in readings if name in self.sensors.states)
        if len(read) + len(self.sensors.inputs) != len(readings) or not self.sensors.inputs.keys() <= readings.keys():
            self.sensors.check(readings)
        pieces = max(1, round(whole / self.period))  # over a gap the model goes on by itself
        h = whole / pieces
        if self._bound[0] != read or abs(self._bound[1] - h) > 1e-9 * h:
            self._bind(read, h)
        skipped, failure, held = list[str](), "", (self._periods.inputs, self._filter.input_variance)
        for piece in range(pieces):
            skipped = self.sensors.hold(readings, self._last, (piece + 0.5) / pieces, 1.0 / pieces, *held)
            failure = self._predict(h) or failure
        self._last |= {name: float(readings[name]) for name in self.sensors.inputs if np.isfinite(readings[name])}
        self._filter.readings[:] = [readings[name] for name in read]
        taken = correct(self._block.address)
        innovations = self._filter.innovations.tolist()
        skipped += [name for name, each in zip(read, innovations, strict=True) if not abs(each) <= JUMP]
        self._count_missed(taken, len(read))
        tension = self._spread()
        self._touch.follow(innovations, self._filter.distance.tolist(), self.time, whole)
        estimate = self._estimate(tension, tuple(skipped), failure)
        self._record.add(estimate, time.perf_counter() - begin)
        return estimate

    def _predict(self, h: float) -> str:
        """Predict over a period, s, or go on from the last estimate where that fails; return why it did."""
        periods, end = self._periods, self._periods.time + h
        x, force = periods.x.copy(), periods.forces.copy()
        if not (status := predict(self._block.address, end)):
            return ""
        failure = periods.failure(status)
        periods.restart(x)
        periods.forces[:] = force
        if predict(self._block.address, end):
            # The estimate stays as it was, and is less certain.
            periods.restart(x, end)
            periods.forces[:] = force
            np.einsum("ii->i", self._covariance)[: len(x)] += self._filter.noise[: len(x)]
        return failure

    def _spread(self) -> Array:
        """Fill what the covariance says of signals; return the tensions that are watched, N."""
        tension = self._periods.watched()[0].copy()
        spread(self._block.address)
        return tension

    def _count_missed(self, taken: int, read: int) -> None:
        """Count periods without a reading that fits: after many the estimate is lost."""
        self._missed = 0 if taken or not read else self._missed + 1
        if self._missed > _MAX_MISSED:
            self._missed, scale = 0, self.finger.layout.scales()
            np.einsum("ii->i", self._covariance)[: len(scale)] += (_LOST * scale) ** 2

    def result(self) -> xr.Dataset:
        """Return the Dataset of all steps since the start; ends of bands end in ``_low`` and ``_high``.

        Raises:
            InputError: If nothing has been observed.
        """
        attributes = {
            "name": self.scenario.name,
            "scenario": to_toml(self.scenario),
            **scene_metadata(self.scenario),
            "level": self.level,
            "period": self.period,
            "uncertain": list(self.uncertainty.keys),
            "removed_objects": list(self.removed),
        }
        return self._record.dataset(attributes)

    @property
    def time(self) -> float:
        """Time from the start, s."""
        return self._periods.time

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy by making an equal one in the same state: what compiled code has of it are addresses."""
        arrays = *self._periods.state_snapshot, self._covariance
        state = {name: getattr(self, name) for name in ("_last", "_missed", "_touch", "_record")}
        return self._again, (), copy.deepcopy((arrays, state))

    def __setstate__(self, state: tuple[tuple[Array, ...], dict[str, Any]]) -> None:
        """Go on from a state."""
        for own, other in zip((*self._periods.state_snapshot, self._covariance), state[0], strict=True):
            own[:] = other
        vars(self).update(state[1])

    def _estimate(self, tension: Array, skipped: tuple[str, ...], failure: str) -> Estimate:
        """Return the present estimate."""
        periods, quantile = self._periods, self._quantile
        size, joints, forces = len(periods.x), len(self.finger.routing.joints), len(self._force_at)
        deviation = np.sqrt(np.maximum(self._covariance.diagonal()[: size + forces], 0.0))
        half = np.maximum(quantile * np.sqrt(self._filter.signal_variance), self._hidden - tension)
        force = periods.forces.ravel()[self._force_at]
        arriving, *entering = zip(tension.reshape(self._each), half.reshape(self._each), strict=True)
        return Estimate(
            time=self.time,
            joint_position=Band.around(periods.x[:joints].copy(), quantile * deviation[:joints]),
            tendon_tension=Band.around(*arriving, 0.0),
            spool_tension=Band.around(*entering[0], 0.0) if entering else None,
            fingertip_force=Band.around(force.reshape(-1, 3), quantile * deviation[size:].reshape(-1, 3)),
            touched=self._touch.touched,
            since=self._touch.since.copy(),
            consistency=self._touch.consistency,
            observable={
                "joint_position": 1.0 - self._filter.considered[:joints],
                "fingertip_force": 1.0 - (deviation[size:] / self._force_deviation).reshape(-1, 3) ** 2,
            },
            skipped=skipped,
            failure=failure,
        )
