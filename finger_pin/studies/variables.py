"""Variables of a search: a range each, for one key or for several that go together."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from finger_pin.description.parameters import FingerDescription, Tendon
from finger_pin.exceptions import InputError
from finger_pin.studies.designs import Point, Range
from finger_pin.studies.keys import Starting
from finger_pin.studies.spelling import parse_range

#: Least winding radius that a search of radii tries, m: a thinner pulley bends a tendon too sharply.
LEAST_RADIUS = 3e-3


@dataclass(frozen=True)
class Variable:
    """A number that a search varies.

    Attributes:
        keys: The keys that hold it.
        signs: 1 or -1 for each: a key with -1 holds the negative of the first one.
        range: Of the first key.
    """

    keys: tuple[str, ...]
    signs: tuple[int, ...]
    range: Range

    def at(self, share: float) -> Point:
        """Return the numbers of all keys at a share of the way from low to high."""
        value = float(self.range.at(share))
        return {key: sign * value for key, sign in zip(self.keys, self.signs, strict=True)}

    def describe(self) -> dict[str, Any]:
        """Return it for a TOML file."""
        own = {"low": self.range.low, "high": self.range.high, "logarithmic": self.range.logarithmic}
        return {"keys": list(self.keys), "signs": list(self.signs), **own}


def parse_variable(text: str) -> Variable:
    """Return the variable of ``KEY=LOW:HIGH`` or, for keys that go together, ``KEY,KEY2,-KEY3=LOW:HIGH``.

    Raises:
        InputError: If it is neither.
    """
    names, found = parse_range(text)
    keys, signs = [], []
    for name in names.split(","):
        spelt = re.fullmatch(r"\s*(-?)\s*(\S+)\s*", name)
        if spelt is None:
            raise InputError("over", "must be KEY=LOW:HIGH, or KEY,KEY2,-KEY3=LOW:HIGH for keys that go together", text)
        keys.append(spelt[2])
        signs.append(-1 if spelt[1] else 1)
    if signs[0] < 0:
        raise InputError("over", "the range is that of the first key, which has no sign", text)
    return Variable(tuple(keys), tuple(signs), found)


def radii(finger: FingerDescription) -> list[Variable]:
    """Return the winding radii of a finger as variables: from `LEAST_RADIUS` to half the width of the joint's link.

    Radii of zero stay so, and so do signs. Tendons that cross the same joints at radii alike but for their signs are
    mirror images, and stay so.
    """
    variables: dict[Any, list[tuple[str, float]]] = {}
    widths = {}
    for name, tendon in finger.tendons.items():
        for joint, crossing in tendon.crossings.items():
            link = finger.joints[joint].link
            if crossing.radius and link is not None and 0.5 * link.width > LEAST_RADIUS:
                widths[joint] = 0.5 * link.width
                key = f"finger.tendons.{name}.crossings.{joint}.radius"
                variables.setdefault((_shape(tendon), joint), []).append((key, crossing.radius))
    made = []
    for (_, joint), members in variables.items():
        first = members[0][1]
        ends = (LEAST_RADIUS, widths[joint]) if first > 0.0 else (-widths[joint], -LEAST_RADIUS)
        signs = tuple(1 if radius * first > 0.0 else -1 for _, radius in members)
        made.append(Variable(tuple(key for key, _ in members), signs, Range(*ends)))
    return made


def check_variables(variables: Sequence[Variable], starting: Starting) -> None:
    """Raise unless there are variables, and every one of their keys can hold a number of its range.

    Raises:
        InputError: Naming the key.
    """
    if not variables:
        raise InputError("over", "at least one key is needed")
    seen: set[str] = set()
    for variable in variables:
        variable.range.check(variable.keys[0])
        for key, sign in zip(variable.keys, variable.signs, strict=True):
            if key in seen:
                raise InputError(key, "must not come twice")
            seen.add(key)
            starting.check(key, [sign * float(variable.range.at(share)) for share in (0.5, 0.0, 1.0)])


def point_at(variables: Sequence[Variable], shares: Sequence[float]) -> Point:
    """Return the numbers of all keys at shares of the ways from low to high, one per variable."""
    return {key: value for v, share in zip(variables, shares, strict=True) for key, value in v.at(share).items()}


def start_of(variables: Sequence[Variable], starting: Starting) -> Mapping[str, float]:
    """Return the numbers that the scenario itself has at the keys."""
    return {key: starting.number(key) for variable in variables for key in variable.keys}


def _shape(tendon: Tendon) -> Any:
    return tendon.kind, tuple((joint, abs(crossing.radius)) for joint, crossing in tendon.crossings.items())
