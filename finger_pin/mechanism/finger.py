"""The wiring of Fig. 5: tendons, joint friction, stroke limiters and rigid body, joined by equation (18)."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.objects import Object
from finger_pin.exceptions import InputError
from finger_pin.mechanism.assembly import ConstructorArgs, Parts, assemble, check_joints
from finger_pin.mechanism.changed_parameters import with_changed_parameters
from finger_pin.mechanism.evaluation import Evaluation, Outputs, check_outputs
from finger_pin.mechanism.from_pinocchio import on_model
from finger_pin.mechanism.groups import CANALS
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.signal_table import finger_signals
from finger_pin.mechanism.signals import FingerSignals, Quantity
from finger_pin.mechanism.state import Motion, as_floats
from finger_pin.mechanism.tree_mechanism import build_body
from finger_pin.typing import Array


class Finger:
    """A tendon-driven finger: dynamics for any controller, solver or loop.

    Attributes:
        description: Description that it was built from.
        rigid_body: M, C, G, J and forward dynamics, on Pinocchio.
        routing: H_c, H_c2, curvature matrix, crossing sets, force closure.
        tendons: The tendon layer.
        actuators: The motors that pull tendons.
        joint_friction: The friction of the joints.
        stroke_limiter: The stroke limiters.
        springs: The springs of the joints.
        layout: Order and sizes of the packed state.
        mechanism: All of it as coordinates and rows.
        paths: The tendons as functions of the posture.
        extra_rows: Tables of rows that were added, those of a tree first.
        wraps: By table of wraps beyond the first ones, which row is of which tendon, shape (t, rows).
        drive_matrices: Weights with which drives and passive tendons' hysteresis pull the strands, by table, (s, k).
        constructor_args: What it was built from besides its description.
        visuals: The solids of a model of the user's own (`from_model`); None of one that is made of links.
        scene: Objects and contacts; None without any.
    """

    def __init__(
        self,
        description: DescriptionLike,
        rigid_body: RigidBody | None = None,
        rows: Sequence[Rows] = (),
        objects: Mapping[str, Object] | None = None,
        tables: Mapping[str, Callable[[Rows], Rows]] | None = None,
    ) -> None:
        """Build a finger.

        Args:
            description: The finger, its name, or the path of its file. A hand is all its fingers together, whose joints
                and tendons have dotted names.
            rigid_body: A rigid body whose joints the description names in order; by default the one that the
                description's links make.
            rows: Further tables of rows, with laws of one's own, for the coordinates (theta, p, theta_m).
            objects: Objects that its links may touch, by name; without any they do not touch each other either.
            tables: By group of one of its tables, such as ``driven_tendons``, a function that returns what stands in
                its place: the same rows, with as many states, with at least the same parameters and signals.

        Raises:
            InputError: If the joints of the two differ, or one has several coordinates; with objects, if a link has no
                size, or an object the name of a joint; if there is no such table, or what replaces it is no such one.
        """
        self.description = description = describe(description)
        self.constructor_args = ConstructorArgs(rigid_body, tuple(rows), objects, dict(tables or {}))
        self.rigid_body, self.paths = build_body(description, rigid_body)
        if rigid_body is not None:
            check_joints(rigid_body, description)
        parts = Parts.from_description(description)
        self.routing, self.tendons, self.actuators, self.joint_friction, self.stroke_limiter, self.springs = parts
        self.visuals: pin.GeometryModel | None = None
        whole = assemble(description, self.rigid_body, self.paths, parts, self.constructor_args)
        self.mechanism, self.scene, self.layout, self.drive_matrices, self.wraps, self.extra_rows = whole

    def __repr__(self) -> str:
        """Return name, joints and tendons."""
        return f"<Finger {self.description.outline}>"

    @classmethod
    def from_model(
        cls,
        description: FingerDescription,
        model: pin.Model,
        joints: Mapping[str, str] | Mapping[str, Mapping[str, str]],
        tip_frame: str | Mapping[str, str],
        configuration: Array | None = None,
        base_axis: Sequence[float] | Mapping[str, Sequence[float]] = (1.0, 0.0, 0.0),
        visuals: pin.GeometryModel | None = None,
    ) -> Finger:
        """Route tendons on some joints of any Pinocchio model; its other joints are locked.

        Of a hand several fingers are routed at once: ``joints``, ``tip_frame`` and ``base_axis`` are then by finger.
        The places in its description do not count.

        Args:
            description: No links needed. Its gravity, friction and ranges replace the model's (`LeftOutWarning`).
            model: For example a whole hand. Continuous joints have an angle for coordinate here.
            joints: For every joint of the description, in the model's order, the name of the model's joint.
            tip_frame: Frame of the fingertip in the model.
            configuration: Position at which the other joints are locked, shape (nq,); neutral by default.
            base_axis: e_1 of (17), the unit vector along which the tendons run at the base; model's base frame.
            visuals: Solids of the model, meshes among them, for `view` and `write_animation` with ``finger=``.

        Raises:
            InputError: If a joint is missing, given twice or out of the model's order, or has several coordinates,
                follows another (mimic), or the configuration has the wrong size.
        """
        body, shown = on_model(description, model, joints, tip_frame, configuration, base_axis, visuals)
        finger = cls(description, body)
        finger.visuals = shown
        return finger

    def changed(self, description: FingerDescription, objects: Mapping[str, Object] | None) -> Finger:
        """Return the finger that another description and other objects make, with the body and rows that were given."""
        if (finger := with_changed_parameters(self, description, objects)) is None:
            args = self.constructor_args
            finger = Finger(description, args.rigid_body, args.rows, objects, args.tables)
            finger.visuals = self.visuals
            if finger.layout == self.layout:
                # With all that follows from it.
                finger.layout = self.layout
        return finger

    def with_prescribed_joints(self) -> Finger:
        """Return the same finger whose joints are moved along a motion, whatever effort that takes.

        Raises:
            InputError: If its palm, some of its joints or objects around it are moved along paths as well.
        """
        if self.mechanism.moved or np.any(self.mechanism.prescribed >= 0):
            joints_led = next(iter(self.description.tree.on_paths), None)
            entry = f"{self.description.entry('tree.joints', joints_led)}.path" if joints_led else "environment.objects"
            entry = "hand.palm.path" if self.mechanism.moved else entry
            raise InputError(entry, "a path cannot stand beside a motion of the joints that is given: leave it out")
        finger = copy.copy(self)
        whole, joints = self.mechanism, len(self.routing.joints)
        prescribed = np.append(np.arange(joints), np.full(whole.coordinates - joints, -1))
        parts = whole.body, whole.listed, whole.lumps, whole.inertia, whole.channels
        finger.mechanism = Mechanism(*parts, prescribed=prescribed, tendons=whole.tendons)
        return finger

    @property
    def coupling(self) -> Array:
        """H_c, shape (t, n), m, (3)."""
        return self.routing.coupling

    @property
    def led_joints(self) -> NDArray[np.bool_]:
        """Mask of the joints that are moved along paths, shape (n,)."""
        return np.isin(self.routing.joints, [*self.description.tree.on_paths])

    @property
    def strand_coupling(self) -> Array:
        """H_c2, shape (s, n), m, (10)."""
        return self.routing.strand_coupling

    def rest_state(self, position: Array, velocity: Array | None = None, tension: Array | None = None) -> Array:
        """Return a packed state with relaxed bristles, the masses of passive tendons in the middle, taut, and spools.

        Args:
            position: theta, shape (n,), rad.
            velocity: theta', shape (n,), rad/s, with which masses and spools go; at rest by default.
            tension: Of the elastic tendons on spools, shape (a,), N; by default they are just taut.
        """
        x = np.zeros(self.layout.size)
        state, middle = self.layout.unpack(x), self.tendons.rest_position
        joints = len(self.routing.joints)
        state.position[:] = as_floats("position", position, joints, single=True)
        state.velocity[:] = 0.0 if velocity is None else as_floats("velocity", velocity, joints, single=True)
        state.passive_position[:], state.passive_velocity[:] = middle(state.position), middle(state.velocity)
        if self.actuators.names:
            angle, excursion = self.actuators.angle, self.excursion(state.position)
            state.motor_position[:] = angle(state.position, tension, excursion)
            moved = (state.velocity @ self.coupling_at(state.position).T)[: self.routing.actuated]
            state.motor_velocity[:] = angle(state.velocity, None, moved) - angle(state.velocity, None, 0.0 * moved)
            loose = self.actuators.loose
            state.spool_position[:], state.spool_velocity[:] = state.motor_position[loose], state.motor_velocity[loose]
        if self.scene is not None:
            state.object_pose[:], state.object_velocity[:] = self.scene.start()
        return x

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs u: of actuated tendons (or of their winding), then of a tree's actuators."""
        names = zip(self.routing.tendons, self.routing.winched, strict=False)
        inputs = (f"tendon_winding.{name}" if winched else name for name, winched in names)
        return (*inputs, *self.description.tree.actuators)

    def evaluate(
        self,
        x: Array,
        inputs: Array,
        fingertip_force: Array | None = None,
        base: Array | None = None,
        outputs: Outputs = "all",
    ) -> FingerSignals:
        """Return all signals of (18) at a packed state.

        Args:
            x: Packed state, shape (size,) or (m, size).
            inputs: u, shape (a,) or (m, a): tensions f^a, N; of a motor in position drive its voltage, V; of an ideal
                winch the length that is wound in, m.
            fingertip_force: F, shape (3,) or (m, 3), of several fingers (f, 3) or (m, f, 3), N, base frame; none by
                default.
            base: Motion of a hand's palm, the numbers of `base_motion`, shape (27,) or (m, 27); at rest by default.
            outputs: "all", "no_acceleration" or "row_forces": others need not be computed; here all are.

        Raises:
            InputError: If there are no such outputs, or an argument has another shape.
        """
        check_outputs(outputs)
        x, inputs, fingertip_force = self._arguments(x, inputs, fingertip_force)
        return self.signals(x, inputs, fingertip_force, self.mechanism.evaluate(x, inputs, fingertip_force, base))

    def _arguments(self, x: Array, inputs: Array, force: Array | None) -> tuple[Array, Array, Array | None]:
        """Return packed states, inputs and fingertip forces as floats."""
        packed = as_floats("x", x, self.layout.size), as_floats("inputs", inputs, self.mechanism.channels)
        return *packed, None if force is None else as_floats("fingertip_force", force, 3)

    def signals(self, x: Array, inputs: Array, fingertip_force: Array | None, evaluation: Evaluation) -> FingerSignals:
        """Return an evaluation of the mechanism by the names of the paper."""
        force = np.zeros(3) if fingertip_force is None else np.asarray(fingertip_force, dtype=float)
        return FingerSignals(self, self.layout.unpack(x), inputs, force, evaluation)

    @cached_property
    def signal_table(self) -> dict[str, Quantity]:
        """Its signals by name, which are variables of its results."""
        return finger_signals(self)

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the functions of its signals, which cannot be pickled."""
        return {name: value for name, value in vars(self).items() if name != "signal_table"}

    @property
    def wrap_names(self) -> tuple[str, ...]:
        """Names of the places of tendons that rub at several: all first ones, all second ones, and so on."""
        rubbing = list(zip(self.routing.tendons, self.tendons.wraps, strict=False))
        first = [f"{name}.{places[0].name}" for name, places in rubbing if len(places) > 1]
        return (*first, *(name for table in self.extra_rows if table.group in self.wraps for name in table.names))

    @property
    def cord_names(self) -> tuple[str, ...]:
        """Names of the cords of a tree that servos, muscles and springs pull, in the order of `cord_tension`."""
        return next((table.names for table in self.extra_rows if table.group == CANALS), ())

    def coupling_at(self, position: Array) -> Array:
        """Return H_c at postures, shape (..., n), with the arms that tendons along paths have there: (..., t, n), m."""
        return self.paths.coupling(as_floats("position", position, len(self.routing.joints)))

    def excursion(self, position: Array) -> Array:
        """Return l of the actuated tendons at theta, shape (..., n), also of those along paths; shape (..., a), m."""
        position = as_floats("position", position, len(self.routing.joints))
        return self.paths.excursion(position)[..., : self.routing.actuated]

    def powers(
        self, x: Array, inputs: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, shape (m, powers), W, in the order of `Energies`, and J^T F, shape (m, N)."""
        evaluation = self.mechanism.evaluate(*self._arguments(x, inputs, fingertip_force), base)
        return np.stack(list(evaluation.account()[1].values()), axis=-1), evaluation.external

    def static_torque(self, position: Array) -> Array:
        """Return the torque that holds the finger at rest at theta, shape (n,): G and the springs' torque, N m."""
        position = as_floats("position", position, len(self.routing.joints), single=True)
        return self.rigid_body.gravity_torque(position) + self.springs.torque(position, np.zeros_like(position))

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (..., n).

        With a base that moves, energies are those of the motion in the world, where the base has no height.
        """
        joints = len(self.routing.joints)
        arguments = as_floats("position", position, joints), as_floats("velocity", velocity, joints)
        kinematics = self.rigid_body.kinematics(*arguments, base)
        return Motion(kinematics.tip, kinematics.kinetic_energy, kinematics.potential_energy)

    def rhs(self, time: float, x: Array, inputs: Array, fingertip_force: Array | None = None) -> Array:
        """Return the time derivative of the packed state, for custom solvers; ``time`` is not used."""
        return self.mechanism.evaluate(*self._arguments(x, inputs, fingertip_force)).rate


#: A hand is a finger whose joints form a tree.
Hand = Finger
