"""Energies and powers of the rows: their names, units and kinds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from finger_pin.mechanism.rows import Rows

STORED, SUPPLIED, LOST = "stored", "supplied", "lost"


class Energy(NamedTuple):
    """An energy, J, that is stored, or a power, W, that is supplied or lost; tables may share one.

    Attributes:
        name: In a result it follows ``energy_`` or ``power_``.
        label: A few words for people.
        kind: `STORED`, `SUPPLIED` or `LOST`; a table of rows takes it from its law.
    """

    name: str
    label: str
    kind: str = STORED


def energy(given: Energy | str) -> Energy:
    """Return an energy; one that is given by its name has that for a label, too."""
    return Energy(given, given.replace("_", " ")) if isinstance(given, str) else given


#: The powers that a moving base supplies, and what moves objects along paths.
BASE, GUIDED = Energy("palm", "motion of the palm", SUPPLIED), Energy("objects", "motion of objects", SUPPLIED)


@dataclass(frozen=True, eq=False)
class Energies:
    """The energies and powers of all rows, each once.

    Attributes:
        stored: Energies.
        powers: Powers, supplied and lost.
    """

    stored: tuple[Energy, ...]
    powers: tuple[Energy, ...]

    @classmethod
    def of(cls, rows: Sequence[Rows], moved: bool = False, guided: bool = False) -> Energies:
        """Collect those of tables, and those of moved coordinates and of a base that moves."""
        base = ((GUIDED,) if guided else ()) + ((BASE,) if moved else ())
        return cls(_once(table.stored for table in rows), (*_once(p for table in rows for p in table.powers), *base))


def _once(energies: Iterable[Energy]) -> tuple[Energy, ...]:
    found: dict[str, Energy] = {}
    for each in energies:
        found.setdefault(each.name, each)
    return tuple(found.values())
