"""Signals of a finger at a state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.routing import Routing
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.evaluation import ContactPoints, Evaluation
from finger_pin.mechanism.object_scene import Scene
from finger_pin.mechanism.rows import Energy, RowSignals, weighted_sum
from finger_pin.mechanism.sheaths import SHEATHS
from finger_pin.mechanism.state import State
from finger_pin.typing import Array

#: Frames of signals with components; the base's, a palm's if there is one, is that of all but the palm's own.
BASE_FRAME, WORLD_FRAME = "base", "world"


class Quantity(NamedTuple):
    """A signal, which is a variable of results, where time comes before its dimensions.

    Attributes:
        dims: Names of its dimensions.
        units: SI.
        long_name: In words.
        value: Function that returns its values from `FingerSignals`, or what else it is a signal of.
        equation: Number of its equation in the paper; empty for none.
        frame: Whose axes its components are along, `BASE_FRAME` or `WORLD_FRAME`.
        energy_term: Its part in the energy account, if any.
        of_finger: Whether it is one of `FingerSignals`, and does not follow from the state alone.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    value: Callable[[Any], Array]
    equation: str = ""
    frame: str = BASE_FRAME
    energy_term: Energy | None = None
    of_finger: bool = True

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the variable: unit, name, equation, its frame if it has components, its part in the account."""
        metadata = {"units": self.units, "long_name": self.long_name}
        if {"axis", "quaternion"} & {*self.dims}:
            metadata["frame"] = self.frame
        if self.energy_term is not None:
            metadata |= {"account": self.energy_term.kind, "label": self.energy_term.label}
        return metadata | {"equation": f"({self.equation})"} if self.equation else metadata


class Section(NamedTuple):
    """Signals that exist together.

    Attributes:
        title: When they exist, in words.
        holds: Whether a finger, or what else they are signals of, has them.
        signals: By name.
    """

    title: str
    holds: Callable[[Any], object]
    signals: dict[str, Quantity]


class SignalSource(Protocol):
    """What signals are read from, a `Finger`; see there."""

    routing: Routing
    scene: Scene | None
    drive_matrices: dict[str, Array]
    wraps: dict[str, Array]

    @property
    def signal_table(self) -> dict[str, Quantity]:
        """Its signals by name."""


@dataclass(frozen=True, eq=False)
class FingerSignals:
    """All signals of a finger at one state or at many (leading dimensions are kept), computed when they are asked for.

        signals = finger.evaluate(x, tensions)
        print(signals["joint_friction"])  # N m, shape (..., n)

    Names are those of the variables of a result.

    Attributes:
        finger: The finger.
        state: The state, unpacked.
        command: f^a, shape (..., a), N.
        fingertip_force: F, shape (3,) or (..., 3), of several fingers (f, 3) or (..., f, 3), N, base frame.
        mechanism: The same of the mechanism, with what every row does.
    """

    finger: SignalSource
    state: State
    command: Array
    fingertip_force: Array
    mechanism: Evaluation

    def __getitem__(self, name: str) -> Array:
        """Return a signal by its name.

        Raises:
            InputError: If there is no such signal of a finger, or this one has no such parts.
        """
        table = self.finger.signal_table
        if name not in table:
            raise InputError("signal", f"the finger has no such signal; it has {choices(name, table)}", name)
        return table[name].value(self)

    @property
    def rows(self) -> Mapping[str, RowSignals]:
        """Signals of the rows, by table."""
        return self.mechanism.rows

    @property
    def rate(self) -> Array:
        """Time derivative of the packed state, shape (..., size)."""
        return self.mechanism.rate

    @cached_property
    def strands(self) -> Array:
        """Tensions f of (12), of actuated tendons and of both halves of each passive one, shape (..., s), N."""
        strands = np.concatenate([self.rows["driven_tendons"].force, self.rows["passive_halves"].force], axis=-1)
        for table, weights in self.finger.drive_matrices.items():
            strands = strands + weighted_sum(self.rows[table].force, weights.T)
        for table, weights in self.finger.wraps.items():
            strands = strands + weighted_sum(
                self.rows[table].force, weights.T @ np.eye(len(weights), strands.shape[-1])
            )
        return strands

    @cached_property
    def touching(self) -> ContactPoints:
        """Contacts in space, of many states."""
        assert self.finger.scene is not None
        return self.mechanism.touching or self.finger.scene.touching(self.state, self.of_contacts("force"))

    def of_contacts(self, field: str) -> Array:
        """Return a field of the rows of contacts."""
        assert self.finger.scene is not None
        return self.field(self.finger.scene.contacts.group, field)

    def contact_force(self, arm: int) -> Array:
        """Return the force of every contact along one of its arms: the normal, two tangents, and its spin."""
        assert self.finger.scene is not None
        return self.of_contacts("force")[..., arm :: self.finger.scene.contacts.law.arms]

    def at_joints(self, attribute: str) -> Array:
        """Return the part of the joints in what the mechanism's evaluation has of all coordinates, shape (..., n)."""
        values: Array = getattr(self.mechanism, attribute)
        return values[..., : self.state.position.shape[-1]]

    def field(self, group: str, field: str) -> Array:
        """Return a field of the rows of a table, see `RowSignals.field`."""
        return self.rows[group].field(field)

    def at_first_place(self, field: str) -> Array:
        """Return a field of the rows where every tendon rubs first, shape (..., t)."""
        return np.concatenate([self.rows[name].field(field) for name in ("driven_tendons", "passive_tendons")], axis=-1)

    def at_all_places(self, field: str) -> Array:
        """Return the sum of a field over all places where each tendon rubs, also in sheaths, shape (..., t)."""
        places = self.finger.wraps | ({SHEATHS: self.sheath_weights} if self.sheath_weights.size else {})
        further = (weighted_sum(self.rows[name].field(field), at.T) for name, at in places.items())
        return sum(further, self.at_first_place(field))

    @property
    def sheath_weights(self) -> Array:
        """Weights of places in sheaths in sums over tendons, shape (t, k); k = 0 without any."""
        tendons = len(self.finger.routing.tendons)
        return self.finger.drive_matrices.get(SHEATHS, np.zeros((tendons, 0)))[:tendons]

    def at_places(self, field: str) -> Array:
        """Return a field at every place of the tendons that rub at several, in the order of `Finger.wrap_names`."""
        first = self.rows["driven_tendons"].field(field)[..., self.wrapped]
        return np.concatenate([first, *(self.rows[name].field(field) for name in self.finger.wraps)], axis=-1)

    @property
    def has_several_places(self) -> NDArray[np.bool_]:
        """Whether each tendon rubs at several places, shape (t,)."""
        several = np.zeros(len(self.finger.routing.tendons), dtype=bool)
        for weights in self.finger.wraps.values():
            several |= np.any(weights, axis=1)
        return several

    @property
    def wrapped(self) -> NDArray[np.intp]:
        """Which actuated tendons rub at several places."""
        return np.flatnonzero(self.has_several_places[: self.finger.routing.actuated])
