"""The places where tendons rub: one for each tendon, or one for every bend."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.description.finger import FingerDescription


class Wrap(NamedTuple):
    """A place where a tendon rubs: it bends there, and slides as fast as what is beyond gets shorter.

    Attributes:
        name: Of its first joint; along a path its number, from 1.
        first: Index of its first crossing or leg.
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


class _Stretch(NamedTuple):
    """A crossing or a leg.

    Attributes:
        name: Of its joint, or its number.
        bends: Whether the tendon bends there.
        moves: Whether it changes the tendon's length.
        offset: Curvature of its own, rad.
        crossed: The joints that it crosses.
    """

    name: str
    bends: bool
    moves: bool
    offset: float
    crossed: frozenset[str]


def _stretches(description: FingerDescription, tendon: str, branch: int) -> tuple[list[_Stretch], float]:
    """Return the stretches of a tendon, or of a branch of it, and the curvature that is not of any one of them."""
    own, tree = description.tendons.get(tendon), description.tree_or_empty
    if own is not None and own.along is None:
        found = [
            _Stretch(name, each.bends > 0.0 or offset > 0.0, bool(each.radius), offset, frozenset({name}))
            for name, each in own.crossings.items()
            for offset in [each.curvature_offset]
        ]
        return found, own.curvature_offset
    route = tree.tendons[str(own.along) if own else tendon]
    offset = 0.0 if branch else route.curvature_offset + (own.curvature_offset if own else 0.0)
    if route.path is None:
        around = route.wound.items()
        return [_Stretch(name, bool(r), bool(r), 0.0, frozenset({name})) for name, r in around], offset
    legs = enumerate(tree.legs(str(own.along) if own else tendon)[branch], start=1)
    return [_Stretch(str(k), k > 1 or wraps, bool(crossed), 0.0, crossed) for k, (wraps, crossed) in legs], offset


def find_wraps(description: FingerDescription, tendon: str, branch: int = 0) -> tuple[Wrap, ...]:
    """Return the places where a tendon of a finger, or else one of its tree, rubs.

    There is one, unless ``tendon_friction.place`` says that tendons rub at their bends: then one for each bend past
    which they slide at another speed. What they have of ``curvature_offset`` is shared by the places that bend.

    Args:
        description: The finger.
        tendon: Name of one of its tendons, or of a tendon of its tree.
        branch: Behind which of its pulleys, from 1; before the first one by default.
    """
    stretches, offset = _stretches(description, tendon, branch)
    own, starts, end = description.tendons.get(tendon), [0], len(stretches)
    if description.tendon_friction.place == "bends" and (own is None or own.kind == "actuated"):
        # What is beyond the last stretch that changes its length never slides.
        end = max((k + 1 for k, each in enumerate(stretches) if each.moves), default=end)
        for k, each in enumerate(stretches[:end]):
            if each.bends and any(before.moves for before in stretches[starts[-1] : k]):
                starts.append(k)
    places = list(zip(starts, [*starts[1:], end], strict=True))
    bent = [any(each.bends for each in stretches[first:last]) for first, last in places]
    bent = bent if any(bent) else [True, *bent[1:]]
    return tuple(
        Wrap(
            next((each.name for each in stretches[first:last] if each.bends), stretches[first].name)
            if stretches
            else "",
            first,
            last,
            sum(each.offset for each in stretches[first:last]) + offset * bends / sum(bent),
            frozenset().union(*(each.crossed for each in stretches[first:])),
            1.0 / len(places),
        )
        for (first, last), bends in zip(places, bent, strict=True)
    )
