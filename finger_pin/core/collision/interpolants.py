"""Continuous collision detection in Python, for any integrator whose interpolants are polynomials.

The path of each coordinate is that of its Bernstein coefficients; of a quaternion, twice that over its least length is
the angle. Only paths are compared with gaps, which costs more looks than the compiled core takes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import comb

from finger_pin.core.addresses.shape_code import GAP_OUT, OUT
from finger_pin.core.collision.broad_phase import GAP_ACCURACY
from finger_pin.core.collision.continuous import MIN_PARTING_PATH, PARTING_PATH_PER_DEPTH
from finger_pin.core.evaluation.attitude_charts import Charts
from finger_pin.core.steps.trajectory import Meeting
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.core.tables.path_tables import PIECE
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.typing import Array

#: Maps times, shape (m,), to packed states, shape (m, size): a polynomial within a step.
Interpolant = Callable[[Array], Array]
# The highest degree of an interpolant, that of LSODA.
_MAX_DEGREE = 12
# Rounding of a gap, m: 15 times what the inverse that makes Bernstein coefficients of values, of row sums up to 2,900,
# makes of the spacing of doubles at a metre.
_GAP_ROUNDING = 1e-11
# Bisections for the moment of a meeting: to 2^-12 of the interval.
_MEETING_BISECTIONS = 12
# Least interval that is halved, in parts of the time or s, whichever is more, as in `step_events`.
_MIN_INTERVAL = 1e-12
# Part of the step before its end, 1, over which a gap is compared with that at the end to see whether it closes.
_APPROACH_SHARE = 1e-3


def meetings(mechanism: Mechanism) -> Meeting | None:
    """Return the finder of touches that a step passes over; None without contacts."""
    return _Meetings(mechanism) if np.any(compile_mechanism(mechanism)[0].touch) else None


class _Meetings:
    """The least opening of every gap, kept from step to step."""

    def __init__(self, mechanism: Mechanism) -> None:
        structure, parameters = compile_mechanism(mechanism)
        self._mechanism, self._charts = mechanism, Charts.from_mechanism(mechanism)
        self._paths, self._geometry = structure.paths, parameters.paths
        self._bodies, self._kinds = len(structure.parents), structure.kinds
        pieces = list(dict.fromkeys(leg.piece for table in mechanism.rows for legs in table.paths for leg in legs))
        self._pieces = [(e, piece) for e, piece in enumerate(pieces) if piece.shape.columns > 1]
        self._clear = np.zeros(len(pieces))
        self._time = -np.inf
        nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(_MAX_DEGREE + 1) / _MAX_DEGREE)
        powers = np.arange(_MAX_DEGREE + 1)
        basis = comb(_MAX_DEGREE, powers) * nodes[:, None] ** powers * (1.0 - nodes[:, None]) ** (_MAX_DEGREE - powers)
        self._nodes, self._to_control = nodes, np.linalg.inv(basis)

    def __call__(self, start: float, end: float, interpolate: Interpolant) -> float | None:
        """Return the time of the first meeting that a step passes over, as `Meeting`, None without one."""
        if start != self._time:
            # From another moment than that where the last step ended.
            self._clear[:] = 0.0
        first, paths = np.inf, self._path_bounds(start, end, interpolate)
        ahead = self._clear - paths
        for e, _ in self._pieces:
            if not ahead[e] > 0.0:
                ahead[e], meeting = self._scan(e, start, end, interpolate)
                first = min(first, meeting)
        if first < end - _MIN_INTERVAL * max(1.0, abs(end)):
            return first
        self._clear, self._time = ahead, end
        return None

    def _path_bounds(self, start: float, end: float, interpolate: Interpolant) -> Array:
        """Return bounds of the paths of each piece's bodies against each other, shape (E,), m."""
        paths, charts = self._paths, self._charts
        packed = self._to_control @ interpolate(start + (end - start) * self._nodes)
        control = np.zeros((_MAX_DEGREE + 1, self._bodies))
        of_bodies = charts.cores < self._bodies
        control[:, charts.cores[of_bodies]] = packed[:, charts.plain[of_bodies]]
        steps = np.diff(control, axis=0)
        path = np.abs(steps).sum(axis=0)
        for at, i in zip(charts.quaternions, charts.angles, strict=True):
            turn = float(np.linalg.norm(np.diff(packed[:, at : at + 4], axis=0), axis=1).sum())
            least = float(np.linalg.norm(packed[0, at : at + 4])) - turn
            path[i] = 2.0 * turn / least if least > 0.0 else np.inf
        against = np.abs(
            steps[:, paths.at] - np.where(paths.opposing_coordinate >= 0, steps[:, paths.opposing_coordinate], 0.0)
        ).sum(axis=0)
        paths_of_coordinates = np.where(paths.opposing_coordinate >= 0, against, path[paths.at])
        levers = np.where(paths_of_coordinates > 0.0, self._geometry.motion_bounds, 0.0)
        bounds = np.zeros(len(paths.columns))
        for e, _ in self._pieces:
            entries = slice(paths.start[e], paths.start[e + 1])
            bounds[e] = float(levers[entries] @ np.where(levers[entries] > 0.0, paths_of_coordinates[entries], 0.0))
            carries = (paths.moves[entries, PIECE.frame] > paths.moves[entries, PIECE.first]) & (
                self._kinds[paths.at[entries]] == 0
            )
            turned = float(paths_of_coordinates[entries][carries].sum()) if np.isinf(self._geometry.extents[e]) else 0.0
            if turned > 0.0:
                distance = self._gap_and_distance(e, interpolate(np.array([start]))[0])[1]
                bounds[e] = (bounds[e] + turned * distance) / (1.0 - turned) if turned < 1.0 else np.inf
        return bounds

    def _gap_and_distance(self, e: int, x: Array) -> tuple[float, float]:
        """Return a gap at a packed state, and the distance of the first body's core from the second's frame, m."""
        mechanism, piece = self._mechanism, dict(self._pieces)[e]
        q = np.array(x[: mechanism.body.model.nq])
        for at in self._charts.quaternions:
            q[at : at + 4] /= np.linalg.norm(q[at : at + 4])
        placements, _ = mechanism.body.placements(q)
        frame = placements[piece.joint] * piece.frame
        ends = [frame.actInv(placements[end.joint].act(np.asarray(end.point, dtype=float))) for end in piece.ends]
        middle = float(np.linalg.norm(0.5 * (ends[0] + ends[1])))
        if middle > piece.reach:
            return middle - piece.reach, middle + float(self._geometry.cores[e])
        out = np.zeros(OUT)
        piece.shape.value(np.concatenate(ends), piece.parameters, out)
        return float(out[GAP_OUT.gap]), middle + float(self._geometry.cores[e])

    def _scan(self, e: int, start: float, end: float, interpolate: Interpolant) -> tuple[float, float]:
        """Return a bound of the gap at the end, and the time of a touch that ends before it, else infinity."""

        def gap(time: float) -> float:
            return self._gap_and_distance(e, interpolate(np.array([time]))[0])[0]

        def clear(one: tuple[float, float], two: tuple[float, float]) -> bool:
            path = self._path_bounds(one[0], two[0], interpolate)[e]
            if min(one[1], two[1]) < 0.0:
                return bool(path < PARTING_PATH_PER_DEPTH * (abs(one[1]) + abs(two[1])) + MIN_PARTING_PATH)
            return bool(path < one[1] + two[1] + _GAP_ROUNDING)

        one, looks = (start, gap(start)), [(end, gap(end))]
        last, parted, met, shortest = looks[0][1], one[1] >= 0.0, np.inf, _MIN_INTERVAL * max(1.0, abs(end))
        if max(one[1], last) < 0.0:
            return last - GAP_ACCURACY, np.inf
        while looks:
            two = looks[-1]
            if two[0] - one[0] > shortest and not clear(one, two):
                middle = 0.5 * (one[0] + two[0])
                looks.append((middle, gap(middle)))
                continue
            if two[1] >= 0.0:
                if np.isfinite(met):
                    return last - GAP_ACCURACY, met
                parted = True
            elif parted and not np.isfinite(met):
                early, met = one[0], two[0]
                for _ in range(_MEETING_BISECTIONS):
                    middle = 0.5 * (early + met)
                    early, met = (early, middle) if gap(middle) < 0.0 else (middle, met)
            one = looks.pop()
        # What is inside at the end, and still approaches, is felt from there on.
        felt = last < gap(end - _APPROACH_SHARE * (end - start))
        return last - GAP_ACCURACY, np.inf if felt else met
