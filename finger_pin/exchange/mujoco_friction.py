"""The table of frictions in a MuJoCo model: a `tuple` of the name of the actuator that stands for them.

Elements of a tuple name an object and carry a number, and follow their objects when models are attached, renamed or
written as XML. A friction is a run of elements: its object with how many they are, the object of the solver's row that
it acts in with the ratio of their speeds, its object again with each parameter, and what loads or bends it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: The plugin, and the actuator and tuple that `add_friction` makes.
PLUGIN = "finger_pin.friction"
NAME = "finger_pin_friction"
#: Its attribute: how many frictions there are.
COUNT = "frictions"

#: What tells an actuator that it has no input; in a group that users do not switch off.
NO_INPUT, GROUP = 16, 30
#: The solver makes a row of what has a friction loss: at least this, which XML keeps.
LEAST_LOSS = 1e-6
#: Kinds of friction: of a tendon that is pulled, of a joint's pin (17), of a slide that is a passive tendon's mass
#: (14c), of a fixed tendon over one joint that is pulled by what drives the joint, and of a branch behind a pulley.
TENDON, PIN, MASS, LINK, BRANCH = range(5)
#: What elements of a friction carry, in order.
LENGTH, RATIO, KIND, COULOMB, STATIC, STIFFNESS, VISCOUS, STRIBECK = range(8)
FLOOR, EXPONENT, MICRO, DRAG, OFFSET, HARDENING, SHARE, LOADS, HEAD = range(8, 17)
#: What of each friction stands in `plugin_state`.
LEVEL, FORCE, LOAD, TURN, SIGNALS = range(5)


@dataclass(frozen=True)
class PluginFriction:
    """A friction.

    Attributes:
        kind: `TENDON`, `PIN`, `MASS`, `LINK` or `BRANCH`.
        name: Of the tendon or joint.
        row: Name of the tendon or joint in whose row it acts.
        row_of_joint: Whether that is a joint.
        ratio: Its speed over the row's.
        law: coulomb, static, stiffness, viscous, stribeck_velocity, floor, stribeck_exponent, micro_damping, drag,
            curvature_offset, hardening.
        more: Elements that bend or load it: whether it is a joint, its name, and a number.
        share: Of a `LINK`, tension over the joint's drive: one over the arm and the number of tendons that pull the
            same way; negative where another one pulls the other way, so that it is slack while that is driven. Of a
            `BRANCH`, how many frictions before it that of its tendon stands, which is the first of ``more``, with one
            over the pulley's divisor.
        held: Whether a tendon has a limit or an equality, which pull it too.
    """

    kind: int
    name: str
    row: str
    row_of_joint: bool
    ratio: float
    law: tuple[float, ...]
    more: tuple[tuple[bool, str, float], ...] = ()
    share: float = 0.0
    held: bool = False

    @property
    def of_joint(self) -> bool:
        """Whether it is a joint's."""
        return self.kind not in (TENDON, LINK, BRANCH)

    @property
    def least(self) -> float:
        """The level without load, N or N m."""
        return max(self.law[5], self.law[8])

    def elements(self) -> Iterator[tuple[str, str, float]]:
        """Yield the elements of the table: kind and name of an object, and a number."""
        own = "joint" if self.of_joint else "tendon"
        yield own, self.name, float(HEAD + len(self.more))
        yield ("joint" if self.row_of_joint else "tendon"), self.row, self.ratio
        for value in (float(self.kind), *self.law, self.share, float(self.loads)):
            yield own, self.name, value
        for of_joint, name, value in self.more:
            yield ("joint" if of_joint else "tendon"), name, value

    @property
    def loads(self) -> int:
        """Number of entries of `act`, after the bristles of all, with which the solver's last forces load it."""
        return 3 if self.kind == PIN else int(self.held)

    @property
    def states(self) -> int:
        """Number of entries of `act`."""
        return 1 + self.loads
