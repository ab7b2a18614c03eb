"""The places where tendons rub: one for each tendon, or one for every bend."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.description.cords import CordPart
from finger_pin.description.finger_description import FingerDescription


class Wrap(NamedTuple):
    """A place where a tendon bends and rubs; it slides as fast as the part beyond gets shorter.

    Attributes:
        name: Of its first joint; along a path its number, from 1.
        first: Index of its first leg along a path.
        last: Index after its last one.
        offset: Curvature that its joints and its path do not show, rad.
        crossed: The joints that the tendon crosses from here on.
        share: Its part of the tendon's stiffness, viscous friction, micro-damping and drag.
    """

    name: str
    first: int
    last: int
    offset: float
    crossed: frozenset[str]
    share: float


def find_wraps(description: FingerDescription, tendon: str, branch: int = 0) -> tuple[Wrap, ...]:
    """Return the places where a tendon of a finger, or else one of its tree, rubs.

    There is one, unless ``tendon_friction.place`` says that tendons rub at their bends: then one for each bend past
    which they slide at another speed. What they have of ``curvature_offset`` is shared by the places that bend.

    Args:
        description: The finger.
        tendon: Name of one of its tendons, or of a tendon of its tree.
        branch: Behind which of its pulleys, from 1; before the first one by default.
    """
    cord = description.cord(tendon)
    described, part = description.tendons.get(tendon), cord.parts[branch]
    elements, starts = part.elements, [0]
    if description.tendon_friction.place == "bends" and (described is None or described.kind == "actuated"):
        elements = part.sliding()
        for k, element in enumerate(elements):
            if element.bends and any(before.moves for before in elements[starts[-1] : k]):
                starts.append(k)
    places = list(zip(starts, [*starts[1:], len(elements)], strict=True))
    bent = [any(element.bends for element in elements[first:last]) for first, last in places]
    bent = bent if any(bent) else [True, *bent[1:]]
    offset = 0.0 if branch else cord.curvature_offset
    arms = sum(element.radius is not None for element in part.elements)
    return tuple(
        Wrap(
            next((element.name for element in elements[first:last] if element.bends), elements[first].name)
            if elements
            else "",
            max(first - arms, 0),
            max(last - arms, 0),
            sum(element.curvature_offset for element in elements[first:last]) + offset * bends / sum(bent),
            CordPart(1.0, part.elements[first:]).crossed,
            1.0 / len(places),
        )
        for (first, last), bends in zip(places, bent, strict=True)
    )
