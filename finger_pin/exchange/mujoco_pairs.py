"""The pairs of geoms that MuJoCo lets collide, and the friction between them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from finger_pin.description.surface import Surface
from finger_pin.exchange.mujoco_compliance import contact_numbers
from finger_pin.exchange.mujoco_names import Table, model_name
from finger_pin.exchange.mujoco_unsupported import ElementReader, disabled
from finger_pin.typing import Array

Pair = tuple[int, int]
# More pairs than these are counted, not named.
_NAMED = 4
_SAME = 1e-9
# MuJoCo's least number.
_LEAST_MIX = 1e-15


class Pairs(ElementReader):
    """Reads the pairs of geoms that may touch."""

    def met(self, geoms: Iterable[int]) -> dict[Pair, Array]:
        """Return the coefficients of sliding, turning and rolling, by pair, zero where `condim` has none.

        A pair is meant by the bits of both geoms, and by no exclusion, or listed itself; its bodies are not welded, nor
        a body and its parent. Of two geoms the greater numbers count, or those of the one with the higher priority.
        """
        model, known = self.model, sorted(geoms)
        coefficients = {pair: self._mixed(*pair) for pair in itertools.combinations(known, 2) if self._meant(*pair)}
        for k in range(model.npair):
            pair = sorted((int(model.pair_geom1[k]), int(model.pair_geom2[k])))
            if set(pair) <= set(known):
                coefficients[pair[0], pair[1]] = _kept(int(model.pair_dim[k]), model.pair_friction[k][[0, 2, 3]])
        return coefficients

    def _meant(self, a: int, b: int) -> bool:
        model, weld = self.model, self.model.body_weldid
        types, affinities = model.geom_contype, model.geom_conaffinity
        if not (types[a] & affinities[b] or types[b] & affinities[a]):
            return False
        one, other = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
        first, second = int(weld[one]), int(weld[other])
        if not self.moves[[one, other]].any():
            return False
        parents = weld[model.body_parentid[second]] == first or weld[model.body_parentid[first]] == second
        # The world is nobody's parent.
        related = first and second and parents and "filterparent" not in disabled(self.mujoco, model)
        return first != second and not related and (one << 16) + other not in model.exclude_signature

    def _mixed(self, a: int, b: int) -> Array:
        model = self.model
        dims, priority = model.geom_condim[[a, b]], model.geom_priority[[a, b]]
        first = int(np.argmax(priority)) if priority[0] != priority[1] else None
        if first is not None:
            return _kept(int(dims[first]), model.geom_friction[(a, b)[first]])
        return _kept(int(np.max(dims)), np.maximum(model.geom_friction[a], model.geom_friction[b]))

    def surfaces(self, met: dict[Pair, Array]) -> dict[int, Table]:
        """Return friction, torsion, stiffness and damping of each geom, of which the smaller of two is their pair's.

        No other numbers do if these do not; the pairs of which a number is greater than in MuJoCo are listed.
        """
        friction = self._shared("friction", {pair: float(numbers[0]) for pair, numbers in met.items()})
        pressing = {pair: self._pressing(pair, numbers) for pair, numbers in met.items()}
        stiffness = self._shared("stiffness, N/m,", {pair: each[0] for pair, each in pressing.items()}, moves=False)
        damping = self._shared("damping, s/m,", {pair: each[1] for pair, each in pressing.items()}, moves=False)
        # Torsion shares its limit with sliding, and has none where that is zero.
        torsion = self._shared("torsion, m,", {pair: each[1] * (each[0] > 0.0) for pair, each in met.items()})
        alone = [self._pair(pair) for pair, each in met.items() if each[1] and not each[0]]
        rolling = [self._pair(pair) for pair, each in met.items() if each[2]]
        for what, pairs in (("torsional without sliding friction", alone), ("rolling friction (condim 6)", rolling)):
            if pairs:
                self.rest.add(f"{what} of geoms: {_few(pairs)}")
        columns = {"friction": friction, "torsion": torsion, "stiffness": stiffness, "damping": damping}
        return {i: {name: values[i] for name, values in columns.items()} for i in friction}

    def _shared(self, what: str, wanted: dict[Pair, float], moves: bool = True) -> dict[int, float]:
        """Return a number for each geom so that no pair gets too little; list the pairs that get more."""
        numbers: dict[int, float] = {}
        for pair, number in wanted.items():
            for i in pair:
                numbers[i] = max(numbers.get(i, 0.0), number)
        least = {pair: min(numbers[i] for i in pair) for pair in wanted}
        wrong = [
            f"{self._pair(pair)}: {least[pair]:.3g} for {number:.3g}"
            for pair, number in wanted.items()
            if least[pair] > (1.0 + _SAME) * number + _SAME
        ]
        if wrong:
            self.rest.add(f"{what} of pairs of geoms, which is greater here: {_few(wrong)}", moves)
        return numbers

    def _pressing(self, pair: Pair, friction: Array) -> tuple[float, float]:
        """Return the stiffness of a contact of two geoms at one point, N/m, and its damping, s/m.

        In a pyramid of friction, edges of slope mu share the load: of n directions 2 n, of 2 mu^2 (1 + mu^2) R each.
        """
        model, bodies = self.model, self.model.geom_bodyid[[*pair]]
        mobility = float(np.sum(model.body_invweight0[bodies, 0]))
        if not mobility:
            return Surface().stiffness, Surface().damping
        stiffness, damping = contact_numbers(self, *self._softness(pair), mobility)
        if model.opt.cone == self.mujoco.mjtCone.mjCONE_PYRAMIDAL and friction[0]:
            directions = 2 + np.count_nonzero(friction[[1, 2, 2]])
            stiffness *= float(model.opt.impratio) * directions / (friction[0] ** 2 * (1.0 + friction[0] ** 2))
        return float(stiffness), damping

    def _softness(self, pair: Pair) -> tuple[Array, Array]:
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

    def _pair(self, pair: Pair) -> str:
        return " and ".join(model_name(self.model, "geom", i) for i in pair)


def _kept(dim: int, friction: Array) -> Array:
    """Return the coefficients of sliding, turning and rolling that a contact dimension uses, others zero."""
    return np.asarray(friction) * [dim >= 3, dim >= 4, dim >= 6]


def _few(lines: list[str]) -> str:
    more = f", and {len(lines) - _NAMED} more" if len(lines) > _NAMED else ""
    return ", ".join(lines[:_NAMED]) + more
