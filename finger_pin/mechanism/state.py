"""The packed state vector: the only place that knows its order and sizes.

    | theta |  o  | p | theta_m | theta' |  o' | p' | theta_m' |  z  | F^s they hold | tendons | joints | gears |
    |   n   | 7 f | p |    m    |   n    | 6 f | p  |    m     | 2 c |       h       |    t    |   n    |   m   |

n joints, f free objects (o is position and quaternion; o' velocity and angular velocity), t tendons, p of them passive,
m motors, h tendons on spools and halves of passive ones with hysteresis, these first, c contacts with bristles bent by
z: 19 numbers for the paper's finger, which has neither motors nor contacts. States of drives of one's own follow what
tendons hold, those of other rows of one's own follow all. Where objects stand in the world around a palm that moves,
the six joints of the world that it sees follow o and o'. Of a tree, states of its actuators follow z, and F^s of the
tendons that these pull, and of branches behind pulleys, that of the other tendons.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class State:
    """The state by name; every array may have leading dimensions, such as time.

    Attributes:
        position: theta, shape (..., n), rad.
        passive_position: p_5, shape (..., p), m.
        velocity: theta', shape (..., n), rad/s.
        passive_velocity: p_5', shape (..., p), m/s.
        tendon_stiction: F^s of the tendons, shape (..., t), N.
        joint_stiction: F^s of the joints, shape (..., n), N m.
        further: States of rows of one's own, shape (..., f); zero if left out, as what follows.
        motor_position: theta_m, shape (..., m), rad.
        motor_velocity: theta_m', shape (..., m), rad/s.
        gearbox_stiction: F^s of the gearboxes, shape (..., m), N m.
        object_pose: Position, m, base frame, and unit quaternion x, y, z, w of every free object, shape (..., 7 f).
        object_velocity: Velocity, m/s, base frame, and angular velocity, rad/s, in its own, shape (..., 6 f).
        world_position: Of the world that a palm sees: less its roll, pitch, yaw, rad, x, y and z, m, shape (..., 6);
            (..., 0) where nothing stands there.
        world_velocity: Its rate, rad/s and m/s.
        contact_bend: z of the contacts, two tangents each, shape (..., 2 c), m.
        elastic_stiction: F^s that tendons hold against their stretch, halves of passive ones first, shape (..., h), N.
        drives: States of drives of one's own, shape (..., d); they follow what tendons hold.
        actuator_state: States of a tree's actuators that have some, shape (..., k).
        canal_stiction: F^s of a tree's tendons that no drive pulls, and of branches behind pulleys, shape (..., c), N.
    """

    position: Array
    passive_position: Array
    velocity: Array
    passive_velocity: Array
    tendon_stiction: Array
    joint_stiction: Array
    further: Array | None = None
    motor_position: Array | None = None
    motor_velocity: Array | None = None
    gearbox_stiction: Array | None = None
    object_pose: Array | None = None
    object_velocity: Array | None = None
    world_position: Array | None = None
    world_velocity: Array | None = None
    contact_bend: Array | None = None
    elastic_stiction: Array | None = None
    drives: Array | None = None
    actuator_state: Array | None = None
    canal_stiction: Array | None = None

    @property
    def q(self) -> Array:
        """The position, as Pinocchio calls it."""
        return self.position

    @property
    def v(self) -> Array:
        """The velocity, as Pinocchio calls it."""
        return self.velocity


@dataclass(frozen=True)
class Layout:
    """Sizes and order of the packed state.

    Attributes:
        joints: Names of the joints.
        tendons: Names of the tendons, the passive ones last.
        passive: Number of passive tendons.
        further: Name and scale of every state of further rows, which follow.
        ringing: Angular frequencies of the lumped masses on their two halves, one for each passive tendon, rad/s.
        motors: Names of the motors.
        objects: Names of the free objects.
        world: Names of the joints of the world that a palm sees.
        contacts: Names of the contacts.
        held: Names of the halves of passive tendons, and then of the tendons on spools, with hysteresis.
        drives: Name and scale of every state of drives of one's own.
        actuators: Names of a tree's actuators with states.
        canals: Names of the canals of a tree, with branches.
    """

    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    passive: int
    further: tuple[tuple[str, float], ...] = ()
    ringing: tuple[float, ...] = ()
    motors: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    world: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    drives: tuple[tuple[str, float], ...] = ()
    actuators: tuple[str, ...] = ()
    canals: tuple[str, ...] = ()

    @cached_property
    def _blocks(self) -> dict[str, tuple[tuple[str, ...], float]]:
        """Names and the scale of every block, in order."""
        passive = self.tendons[len(self.tendons) - self.passive :]
        poses, rates, bends = (
            tuple(f"{name}.{part}" for name in names for part in parts.split())
            for names, parts in (
                (self.objects, "x y z qx qy qz qw"),
                (self.objects, "vx vy vz wx wy wz"),
                (self.contacts, "1 2"),
            )
        )
        return {
            "position": (self.joints, 1.0),
            "object_pose": (poses, 1.0),
            "world_position": (self.world, 1.0),
            "passive_position": (passive, 1e-3),
            "motor_position": (self.motors, 1.0),
            "velocity": (self.joints, 10.0),
            "object_velocity": (rates, 10.0),
            "world_velocity": (self.world, 10.0),
            "passive_velocity": (passive, 0.1),
            "motor_velocity": (self.motors, 10.0),
            "contact_bend": (bends, 1e-5),
            "actuator_state": (self.actuators, 1.0),
            "elastic_stiction": (self.held, 1.0),
            "drives": (tuple(name for name, _ in self.drives), 1.0),
            "tendon_stiction": (self.tendons, 1.0),
            "canal_stiction": (self.canals, 1.0),
            "joint_stiction": (self.joints, 1e-2),
            "gearbox_stiction": (self.motors, 1e-2),
            "further": (tuple(name for name, _ in self.further), 1.0),
        }

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the blocks, in order."""
        return tuple(len(names) for names, _ in self._blocks.values())

    @cached_property
    def size(self) -> int:
        """Length of the packed state."""
        return sum(self.sizes)

    @cached_property
    def _parts(self) -> dict[str, slice]:
        ends = np.cumsum(self.sizes)
        parts = (slice(int(end) - size, int(end)) for end, size in zip(ends, self.sizes, strict=True))
        return dict(zip(self._blocks, parts, strict=True))

    @cached_property
    def _filled(self) -> list[tuple[str, slice]]:
        return [(name, part) for name, part in self._parts.items() if part.stop > part.start]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for every number of the packed state."""
        prefixes = dict.fromkeys(("position", "velocity"), "joint_")
        return tuple(
            name if kind in ("further", "drives") else f"{prefixes.get(kind, '')}{kind}[{name}]"
            for kind, (names, _) in self._blocks.items()
            for name in names
        )

    def pack(self, state: State) -> Array:
        """Return the packed vector, shape (..., size)."""
        lead, blocks = state.position.shape[:-1], []
        for kind, size in zip(self._blocks, self.sizes, strict=True):
            given = getattr(state, kind)
            blocks.append(np.zeros((*lead, size)) if given is None else given)
        return np.concatenate(blocks, axis=-1)

    def unpack(self, x: Array) -> State:
        """Return views of a packed vector, shape (..., size).

        Raises:
            ValueError: If the last dimension has the wrong size.
        """
        if x.shape[-1] != self.size:
            raise ValueError(f"a packed state has {self.size} numbers, not {x.shape[-1]}")
        # Of a frozen class the constructor takes longer than all else in a step's answer.
        state, nothing = object.__new__(State), x[..., :0]
        vars(state).update(dict.fromkeys(self._parts, nothing))
        vars(state).update([(name, x[..., part]) for name, part in self._filled])
        return state

    def scales(self) -> Array:
        """Return one typical magnitude per number of the state, for absolute tolerances; shape (size,).

        Angles 1 rad, velocities 10 rad/s, passive tendon 1 mm and 0.1 m/s, stiction 1 N and 1e-2 N m: the size of
        each in ordinary motion of a finger, so that one factor serves them all. A lumped mass that rings has the
        velocity that goes with 1 % of its position: an oscillation too small to matter in the one is not followed
        in the other.
        """
        return self._scales.copy()

    @cached_property
    def _scales(self) -> Array:
        scales = np.repeat([scale for _, scale in self._blocks.values()], self.sizes)
        for kind, states in (("further", self.further), ("drives", self.drives)):
            scales[self._parts[kind]] = [scale for _, scale in states]
        if self.ringing:
            passive = self._parts["passive_velocity"]
            scales[passive] = np.maximum(scales[passive], 1e-5 * np.array(self.ringing))
        if self.objects:
            # An object moves by centimetres where a joint turns by a radian.
            poses, rates = (self._parts[kind] for kind in ("object_pose", "object_velocity"))
            scales[poses].reshape(-1, 7)[:, :3] = 1e-2
            scales[rates].reshape(-1, 6)[:, :3] = 0.1
        scales[self._parts["world_position"]][3:] = 1e-2
        scales[self._parts["world_velocity"]][3:] = 0.1
        return scales
