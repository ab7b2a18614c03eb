"""The pairs of geoms that MuJoCo lets collide, and the friction between them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from finger_pin.description.surface import Surface
from finger_pin.exchange.mujoco_compliance import contact_numbers, depths_at_rest
from finger_pin.exchange.mujoco_names import Table, model_name
from finger_pin.exchange.mujoco_unsupported import ElementReader, disabled
from finger_pin.typing import Array

Pair = tuple[int, int]
# Greatest number of pairs to name; more are counted.
_MAX_NAMED = 4
_TOLERANCE = 1e-9
# Less than this, 1/kg, is rounding: of a body about whose mass centre a joint turns.
_LEAST_MOBILITY = 1e-12
# MuJoCo's least number.
_LEAST_MIX = 1e-15


class Pairs(ElementReader):
    """Reads the pairs of geoms that may touch."""

    def coefficients(self, geoms: Iterable[int]) -> dict[Pair, Array]:
        """Return the coefficients of sliding, turning and rolling, by pair, zero where `condim` has none.

        A pair is meant by the bits of both geoms, and by no exclusion, or listed itself; its bodies are not welded, nor
        a body and its parent. Of two geoms the greater numbers count, or those of the one with the higher priority.
        """
        model, indices = self.model, sorted(geoms)
        pairs = [pair for pair in itertools.combinations(indices, 2) if self._may_collide(*pair)]
        coefficients = {pair: self._mixed_friction(*pair) for pair in pairs}
        for k in range(model.npair):
            pair = sorted((int(model.pair_geom1[k]), int(model.pair_geom2[k])))
            if set(pair) <= set(indices):
                coefficients[pair[0], pair[1]] = _used(int(model.pair_dim[k]), model.pair_friction[k][[0, 2, 3]])
        return coefficients

    def _may_collide(self, a: int, b: int) -> bool:
        model, weld = self.model, self.model.body_weldid
        types, affinities = model.geom_contype, model.geom_conaffinity
        if not (types[a] & affinities[b] or types[b] & affinities[a]):
            return False
        lower_body, upper_body = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
        first, second = int(weld[lower_body]), int(weld[upper_body])
        if not self.moves[[lower_body, upper_body]].any():
            return False
        parents = weld[model.body_parentid[second]] == first or weld[model.body_parentid[first]] == second
        # The world is nobody's parent.
        related = first and second and parents and "filterparent" not in disabled(self.mujoco, model)
        return first != second and not related and (lower_body << 16) + upper_body not in model.exclude_signature

    def _mixed_friction(self, a: int, b: int) -> Array:
        model = self.model
        dims, priority = model.geom_condim[[a, b]], model.geom_priority[[a, b]]
        dominant = int(np.argmax(priority)) if priority[0] != priority[1] else None
        if dominant is not None:
            return _used(int(dims[dominant]), model.geom_friction[(a, b)[dominant]])
        return _used(int(np.max(dims)), np.maximum(model.geom_friction[a], model.geom_friction[b]))

    def surfaces(self, coefficients: dict[Pair, Array]) -> dict[int, Table]:
        """Return friction, torsion, stiffness and damping of each geom, of which the smaller of two is their pair's.

        No other numbers do if these do not; the pairs of which a number is greater than in MuJoCo are listed.
        """
        friction = self._geom_values("friction", {pair: float(numbers[0]) for pair, numbers in coefficients.items()})
        normal = {pair: self._stiffness_and_damping(pair, numbers) for pair, numbers in coefficients.items()}
        stiffness = self._geom_values("stiffness, N/m,", {pair: each[0] for pair, each in normal.items()}, moves=False)
        damping = self._geom_values("damping, s/m,", {pair: each[1] for pair, each in normal.items()}, moves=False)
        depths = {pair: depths_at_rest(self, *self._solver_parameters(pair)) for pair in coefficients}
        sinks = [
            f"{self._pair_name(pair)}: {1e3 * each[0]:.3g} for {1e3 * each[1]:.3g} mm"
            for pair, each in depths.items()
            if each
        ]
        if sinks:
            self.left_out.add(f"solimp of geoms, by which they sink under their weight: {_summary(sinks)}", moves=False)
        # Torsion shares its limit with sliding, and has none where that is zero.
        limited = {pair: each[1] * (each[0] > 0.0) for pair, each in coefficients.items()}
        torsion = self._geom_values("torsion, m,", limited)
        torsion_only = [self._pair_name(pair) for pair, each in coefficients.items() if each[1] and not each[0]]
        rolling = [self._pair_name(pair) for pair, each in coefficients.items() if each[2]]
        lists = {"torsional without sliding friction": torsion_only, "rolling friction (condim 6)": rolling}
        for what, pairs in lists.items():
            if pairs:
                self.left_out.add(f"{what} of geoms: {_summary(pairs)}")
        columns = {"friction": friction, "torsion": torsion, "stiffness": stiffness, "damping": damping}
        return {i: {name: values[i] for name, values in columns.items()} for i in friction}

    def _geom_values(self, quantity: str, values: dict[Pair, float], moves: bool = True) -> dict[int, float]:
        """Return a number for each geom so that no pair gets too little; list the pairs that get more."""
        numbers: dict[int, float] = {}
        for pair, number in values.items():
            for i in pair:
                numbers[i] = max(numbers.get(i, 0.0), number)
        least = {pair: min(numbers[i] for i in pair) for pair in values}
        exceeding = [
            f"{self._pair_name(pair)}: {least[pair]:.3g} for {number:.3g}"
            for pair, number in values.items()
            if least[pair] > (1.0 + _TOLERANCE) * number + _TOLERANCE
        ]
        if exceeding:
            self.left_out.add(f"{quantity} of pairs of geoms, which is greater here: {_summary(exceeding)}", moves)
        return numbers

    def _stiffness_and_damping(self, pair: Pair, friction: Array) -> tuple[float, float]:
        """Return the stiffness of a contact of two geoms at one point, N/m, and its damping, s/m.

        In a pyramid of friction, edges of slope mu share the load: of n directions 2 n, of 2 mu^2 (1 + mu^2) R each.
        """
        model, bodies = self.model, self.model.geom_bodyid[[*pair]]
        mobility = float(np.sum(model.body_invweight0[bodies, 0]))
        if mobility < _LEAST_MOBILITY:
            return Surface().stiffness, Surface().damping
        stiffness, damping = contact_numbers(self, *self._solver_parameters(pair), mobility)
        if model.opt.cone == self.mujoco.mjtCone.mjCONE_PYRAMIDAL and friction[0]:
            directions = 2 + np.count_nonzero(friction[[1, 2, 2]])
            stiffness *= float(model.opt.impratio) * directions / (friction[0] ** 2 * (1.0 + friction[0] ** 2))
        return float(stiffness), damping

    def _solver_parameters(self, pair: Pair) -> tuple[Array, Array]:
        """Return solref and solimp of a pair, mixed as `mj_contactParam` does."""
        model, geoms = self.model, [*pair]
        for k in range(model.npair):
            if {int(model.pair_geom1[k]), int(model.pair_geom2[k])} == {*pair}:
                return model.pair_solref[k], model.pair_solimp[k]
        priority, mix = model.geom_priority[geoms], np.maximum(model.geom_solmix[geoms], _LEAST_MIX)
        shares = mix / mix.sum() if priority[0] == priority[1] else 1.0 * (priority == priority.max())
        solref, solimp = model.geom_solref[geoms], model.geom_solimp[geoms]
        both_timed = bool(np.all(solref[:, 0] > 0.0)) or priority[0] != priority[1]
        return shares @ solref if both_timed else solref.min(axis=0), shares @ solimp

    def _pair_name(self, pair: Pair) -> str:
        return " and ".join(model_name(self.model, "geom", i) for i in pair)


def _used(dim: int, friction: Array) -> Array:
    """Return the coefficients of sliding, turning and rolling that a contact dimension uses, others zero."""
    return np.asarray(friction) * [dim >= 3, dim >= 4, dim >= 6]


def _summary(lines: list[str]) -> str:
    suffix = f", and {len(lines) - _MAX_NAMED} more" if len(lines) > _MAX_NAMED else ""
    return ", ".join(lines[:_MAX_NAMED]) + suffix
