"""The table of contacts between the solids of a scene."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

import numpy as np

from finger_pin.description.surface import Surface
from finger_pin.exceptions import InputError
from finger_pin.laws.contact_law import CONTACT, TORSIONAL_CONTACT
from finger_pin.mechanism.contact_features import ContactPart, solid_contacts
from finger_pin.mechanism.gaps import ELLIPSOIDS, PRISM
from finger_pin.mechanism.path_elements import PathElement, PathTerm, Place, piece_lengths
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Energy, Rows
from finger_pin.mechanism.solids import Solid
from finger_pin.typing import Array

#: How deep bodies may be in each other at the start, m.
DEEPEST_START = 1e-3
_LOSSES = (
    Energy("contacts_impact", "contacts, impact"),
    Energy("contacts_sliding", "contacts sliding"),
    Energy("contacts_micro_damping", "contacts' bristles"),
)


def contact_rows(
    solids: Sequence[Solid], width: int, within: Collection[frozenset[str]] = (), never: Collection[frozenset[str]] = ()
) -> Rows:
    """Return the contacts of all pairs that can touch: not of one group, not both fixed, and within reach.

    Args:
        solids: Links and objects.
        width: Number of coordinates.
        within: Pairs of one group, by their names, that touch all the same.
        never: Pairs that do not touch, by their names.

    Returns:
        A table of contacts named ``link-object``, numbered where a pair has several.
    """
    names: list[str] = []
    numbers: list[tuple[float, ...]] = []
    pieces: list[PathElement] = []
    for number, (one, other) in enumerate(itertools.combinations(solids, 2)):
        pair = frozenset((one.name, other.name))
        never_touching = pair in never or (one.group == other.group and pair not in within)
        if never_touching or (one.prescribed and other.prescribed) or one.never_meets(other):
            continue
        touches = list(solid_contacts(one, other))
        for index, (a, part, w, prism) in enumerate(touches):
            piece = _piece(a, part, w, prism, number)
            names.append(f"{a.name}-{w.name}" + (f".{index}" if len(touches) > 1 else ""))
            numbers.append(tuple(law_parameters(a.surface, w.surface).values()))
            pieces.append(piece)
    parameters = np.array(numbers).reshape(-1, len(CONTACT.parameters)).T
    # One that resists spinning makes rows of four arms of all.
    law = TORSIONAL_CONTACT if parameters[-1].any() else CONTACT
    paths = tuple((PathTerm(piece, column),) for piece in pieces for column in range(law.arms))
    arm = np.zeros((len(paths), width))
    return Rows("contacts", law, tuple(names), parameters, arm, paths=paths, powers=_LOSSES)


def _piece(a: Solid, part: ContactPart, w: Solid, prism: tuple[float, ...], pair: int) -> PathElement:
    """Return the gap between a part of one solid and the whole of another."""
    # Of a sphere, too, the way out of an ellipsoid is known however deep.
    curved = bool(part.third) and w.shape in ("sphere", "ellipsoid")
    half = 0.5 * float(np.linalg.norm(part.ends[1] - part.ends[0]))
    return PathElement(
        ELLIPSOIDS if curved else PRISM,
        np.array(
            [part.third, *(3 * w.sizes)[:3]] if curved else [part.radius, part.disc, part.along, part.third, *prism]
        ),
        tuple(Place(a.joint, a.place.act(end)) for end in part.ends),
        w.joint,
        w.place,
        half + part.breadth + part.radius + w.reach,
        part.breadth,
        w.reach - (0.0 if w.shape == "ellipsoid" else prism[-1]),
        pair,
    )


def check_start(contacts: Rows, body: RigidBody, q: Array) -> None:
    """Refuse a configuration of shape (nq,) in which bodies are deep in each other."""
    gaps = piece_lengths(body, q, [legs[0].piece for legs in contacts.paths[:: contacts.law.arms]])
    # What is as deep but for rounding, and for the measure of another program, is not deeper.
    if gaps.size and gaps.min() < -1.001 * DEEPEST_START:
        deep, most = -1e3 * float(gaps.min()), 1e3 * DEEPEST_START
        allowed = f"starts {deep:.4g} mm deep in each other, at most {most:g} mm"
        pair = contacts.names[int(np.argmin(gaps))]
        raise InputError(
            f"environment.objects: {pair}", f"{allowed}; move the object, or let the joints start elsewhere"
        )


def law_parameters(one: Surface | None, other: Surface | None) -> dict[str, float]:
    """Return the law's parameters between two surfaces: of each the smaller; None leaves it to the other."""
    surfaces = [each for each in (one, other) if each is not None] or [Surface()]
    least: dict[str, float] = {name: min(getattr(each, name) for each in surfaces) for name in Surface.model_fields}
    kinetic, torsion = least["friction"], least["torsion"]
    least |= {"kinetic": kinetic, "static": kinetic * least["stiction_ratio"]}
    least |= {"torsion_radius": torsion / kinetic if torsion else 0.0}
    return {name: least[name] for name in CONTACT.parameters}
