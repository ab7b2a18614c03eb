"""The table of frictions in a MuJoCo model: a `tuple` of the name of the actuator that stands for them.

Elements of a tuple name an object and carry a number, and follow their objects when models are attached, renamed or
written as XML. A friction is a run of elements: its object with how many they are, the object of the solver's row that
it acts in with the ratio of their speeds, its object again with each parameter, and what loads or bends it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.exceptions import InputError

#: The plugin, and the actuator and tuple that `add_friction` makes.
PLUGIN = "finger_pin.friction"
NAME = "finger_pin_friction"
#: Its attribute: how many frictions there are.
COUNT = "frictions"

#: The setting of an actuator without an input, and a group that users do not switch off.
NO_INPUT, GROUP = 16, 30
#: The least friction loss for which the solver makes a row, and which XML keeps.
LEAST_LOSS = 1e-6
#: Kinds of friction: of a tendon that is pulled, of a joint's pin (17), of a slide that is a passive tendon's mass
#: (14c), of a fixed tendon over one joint that is pulled by what drives the joint, and of a branch behind a pulley.
TENDON, PIN, MASS, LINK, BRANCH = range(5)


def check_friction(description: FingerDescription, at_bends: bool) -> None:
    """Refuse friction that no step of MuJoCo computes: of joints not by (9) or by direction, of tendons at bends.

    Raises:
        InputError: Naming the entry.
    """
    law = description.joint_friction.law
    if law != "lugre" and any(description.bearings):
        allowed = 'must be "lugre", law (9), the only one that is computed in the step of MuJoCo; or leave out friction'
        raise InputError("finger.joint_friction.law", allowed, law)
    asymmetry = description.joint_friction.drag_asymmetry
    if np.any(asymmetry):
        allowed = "must be 0: friction in the step of MuJoCo is alike in both directions; or leave out friction"
        raise InputError("finger.joint_friction.drag_asymmetry", allowed, asymmetry)
    if at_bends:
        allowed = 'must be "canal": a tendon of MuJoCo has one tension; or leave out friction'
        raise InputError("finger.tendon_friction.place", allowed, description.tendon_friction.place)


class Coefficients(NamedTuple):
    """Coefficients of a friction's law; stiction is a ratio for tendons, and N m for joints."""

    coulomb: float
    stiction: float
    stiffness: float
    viscous: float
    stribeck_velocity: float
    floor: float
    stribeck_exponent: float
    micro_damping: float
    drag: float
    curvature_offset: float
    hardening: float


class ElementPlaces(NamedTuple):
    """Places of the first elements of a friction, named after what they carry; elements of `linked` follow."""

    length: int
    ratio: int
    kind: int
    coulomb: int
    stiction: int
    stiffness: int
    viscous: int
    stribeck_velocity: int
    floor: int
    stribeck_exponent: int
    micro_damping: int
    drag: int
    curvature_offset: int
    hardening: int
    share: int
    loads: int


class SignalPlaces(NamedTuple):
    """Places of a friction's signals in `plugin_state`."""

    level: int
    force: int
    load: int
    turn: int


HEAD, SIGNALS = len(ElementPlaces._fields), len(SignalPlaces._fields)
ELEMENT, SIGNAL = ElementPlaces(*range(HEAD)), SignalPlaces(*range(SIGNALS))


@dataclass(frozen=True)
class PluginFriction:
    """A friction.

    Attributes:
        kind: `TENDON`, `PIN`, `MASS`, `LINK` or `BRANCH`.
        name: Of the tendon or joint.
        row: Name of the tendon or joint in whose row it acts.
        row_of_joint: Whether that is a joint.
        ratio: Its speed over the row's.
        law: Coefficients of its law.
        linked: Elements that bend or load it: whether it is a joint, its name, and a number.
        share: Of a `LINK`, tension over the joint's drive: one over the arm and the number of tendons that pull the
            same way; negative where another one pulls the other way, so that it is slack while that is driven. Of a
            `BRANCH`, how many frictions before it that of its tendon stands, which is the first of ``linked``, with one
            over the pulley's divisor.
        constrained: Whether a tendon has a limit or an equality, which pull it too.
    """

    kind: int
    name: str
    row: str
    row_of_joint: bool
    ratio: float
    law: Coefficients
    linked: tuple[tuple[bool, str, float], ...] = ()
    share: float = 0.0
    constrained: bool = False

    @property
    def of_joint(self) -> bool:
        """True for the friction of a joint."""
        return self.kind not in (TENDON, LINK, BRANCH)

    @property
    def least_level(self) -> float:
        """The level without load, N or N m."""
        return max(self.law.floor, self.law.drag)

    def elements(self) -> Iterator[tuple[str, str, float]]:
        """Yield the elements of the table: kind and name of an object, and a number."""
        owner = "joint" if self.of_joint else "tendon"
        length, kind, loads = float(HEAD + len(self.linked)), float(self.kind), float(self.loads)
        carried = {"length": length, "ratio": self.ratio, "kind": kind, "share": self.share, "loads": loads}
        carried |= self.law._asdict()
        row = ("joint" if self.row_of_joint else "tendon"), self.row
        for name in ElementPlaces._fields:
            yield *(row if name == "ratio" else (owner, self.name)), carried[name]
        for of_joint, name, value in self.linked:
            yield ("joint" if of_joint else "tendon"), name, value

    @property
    def loads(self) -> int:
        """Number of entries of `act`, after the bristles of all, with which the solver's last forces load it."""
        return 3 if self.kind == PIN else int(self.constrained)

    @property
    def states(self) -> int:
        """Number of entries of `act`."""
        return 1 + self.loads
