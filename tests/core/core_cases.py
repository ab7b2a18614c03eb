"""Fingers, closed loops and states on which the compiled core is compared with the readable model."""

import warnings
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop, compiled_control
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import CompiledFunction, Matrix, StructType, Vector, call, call_at, unpack
from finger_pin.core.signals.bound_models import BoundModel
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.core.tables.model import MODEL
from finger_pin.exceptions import LeftOutWarning
from finger_pin.mechanism.state import State

BODIES = ("ub_stand_in", "planar", "dexmart_index", "tree", "hand")
LOOPS = tuple(
    name + push
    for push in ("", "_pushed")
    for name in ("reversals", "stick_slip", "two_passive", "none_passive", "lugre", "meeting_axes", "servos", "carried")
)
FORCE = np.array([0.3, -0.2, 0.4])


def tree_model():
    """Seven joints on two branches of one trunk: revolute and prismatic, about main and inclined axes, with rotors."""
    pin.seed(5)
    turned = np.array([0.48, -0.6, 0.64])
    joints = [
        ("trunk", 0, pin.JointModelRZ()),
        ("left", 1, pin.JointModelRX()),
        ("left_twig", 2, pin.JointModelRevoluteUnaligned(turned)),
        ("left_slide", 2, pin.JointModelPZ()),
        ("left_tip", 4, pin.JointModelRY()),
        ("right", 1, pin.JointModelPrismaticUnaligned(turned[[2, 0, 1]])),
        ("right_tip", 6, pin.JointModelRevoluteUnaligned(turned[[1, 2, 0]])),
    ]
    model = pin.Model()
    for name, parent, kind in joints:
        index = model.addJoint(parent, kind, pin.SE3.Random(), name)
        model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Random())
    model.addFrame(pin.Frame("tip", 5, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.armature[:] = np.linspace(0.1, 0.7, model.nv)
    return model


def on_model(model, joints, tip, gravity):
    """A finger on a foreign model: every tendon crosses every joint, the last one passive."""
    rng = np.random.default_rng(8)
    tendons = {
        f"T{i}": {
            "kind": "passive" if i == len(joints) else "actuated",
            "curvature_offset": 0.4,
            "crossings": {name: {"radius": radius, "bends": True} for name, radius in zip(joints, row, strict=True)},
        }
        for i, row in enumerate(rng.uniform(-0.01, 0.01, (len(joints) + 1, len(joints))).tolist())
    }
    description = fp.FingerDescription.model_validate(
        {
            "name": "foreign",
            "gravity": gravity,
            "joints": {name: {"range": [-1.0, 1.0]} for name in joints},
            "tendons": tendons,
        }
    )
    with warnings.catch_warnings():
        # Ranges, damping and friction of the models are not what is compared.
        warnings.simplefilter("ignore", LeftOutWarning)
        return fp.Finger.from_model(description, model, {name: name for name in joints}, tip)


def two_passive():
    """`reversals` with a second passive tendon, between the proximal and the medial joint."""
    table = fp.load_scenario("reversals").model_dump()
    table["finger"]["tendons"]["T6"] = {
        "kind": "passive",
        "curvature_offset": 0.3,
        "crossings": {"proximal": {"radius": -3e-3}, "medial": {"radius": 3e-3}},
    }
    del table["reference"]["joints"]["medial"]
    return fp.Scenario.model_validate(table)


def none_passive():
    """The finger `planar`, all of whose tendons are actuated, bending and stretching."""
    swing = {"offset": 0.5, "amplitude": 0.3}
    joints = {"proximal": swing | {"frequency": 0.7}, "distal": swing | {"frequency": 0.9, "phase": 2.0}}
    return fp.Scenario.model_validate(
        {
            "name": "planar_swing",
            "finger": fp.load_finger("planar").model_dump(),
            "controller": {},
            "reference": {"joints": joints},
        }
    )


def lugre():
    """`two_passive` with micro-damping and Stribeck exponents of its own for every tendon and joint."""
    table = two_passive().model_dump()
    table["finger"]["tendon_friction"] |= {
        "micro_damping": [2.0, 0.0, 1.0, 1.5, 0.5, 2.0],
        "stribeck_exponent": [2, 1, 2, 1, 2, 1],
    }
    table["finger"]["joint_friction"] |= {"micro_damping": [2e-3, 1e-3, 0.0, 2.5e-3], "stribeck_exponent": [1, 2, 2, 1]}
    return fp.Scenario.model_validate(table)


def servos():
    """`reversals` with damping, two tendons on one spool by position, one by tension, one ideal source."""
    # Soft tendons: differences of the friction of stiff ones would have to be finer than rounding allows.
    both = {"tendons": ["T4", "T1"], "spool_radius": [0.006, 0.004], "drive": "position", "pretension": [2.0, 3.0]}
    one = {"tendons": ["T3"], "spool_radius": 0.005, "friction_compensation": 0.7}
    actuators = {
        "both": {"motor": "STS3215", "tendon_rigidity": 500.0, **both},
        "one": {"motor": "XL330-M288", "tendon_rigidity": 500.0, **one},
    }
    return fp.load_scenario("reversals", {"controller.damping": [0.02, 0.01, 0.0, 0.03], "finger.actuators": actuators})


class Unpowered:
    """Position drives that are switched off."""

    channels = slice(3, 4)

    def voltages(self, time):
        return np.zeros((*np.shape(time), 1))

    def planned(self, time, reference, control):
        return control


def carried():
    """The thumb of a hand whose palm swings about and along all axes."""
    names, rates = ("x", "y", "z", "roll", "pitch", "yaw"), (1.1, 1.7, 2.3, 1.3, 0.9, 1.9)
    path = {
        name: {"amplitude": 0.05 if index < 3 else 0.5, "frequency": rate, "phase": 0.3 * index}
        for index, (name, rate) in enumerate(zip(names, rates, strict=True))
    }
    return fp.load_scenario("hand", {"hand.palm.path": path}).parts()["thumb"]


def without_abduction_link(loop):
    """A loop whose first two joint axes meet in a point."""
    model = loop.finger.rigid_body.model.copy()
    placement = model.jointPlacements[2].copy()
    placement.translation = np.zeros(3)
    model.jointPlacements[2] = placement
    joints = {name: name for name in loop.finger.routing.joints}
    finger = fp.Finger.from_model(loop.finger.description, model, joints, "fingertip")
    return replace(loop, finger=finger, dynamics=finger)


class Condensed(NamedTuple):
    model: int
    time: float
    x: Vector
    g: float
    rate: Vector
    r: Vector
    columns: Matrix


CONDENSED = StructType(Condensed)


@CompiledFunction
def _condensed(address, _number):
    condensed = unpack(address, CONDENSED)
    model, x, r = unpack(condensed.model, MODEL), condensed.x, condensed.r
    for c in range(x.size):
        model.state[c] = x[c]
    call_at(model.evaluate, condensed.model, condensed.time)
    for c in range(x.size):
        condensed.rate[c] = model.rate[c]
    call_at(model.linearise, condensed.model, condensed.time)
    solved = call_at(model.condense, condensed.model, condensed.g)
    for c in range(r.size):
        r[c] = 1.0
        solve(model.linear, r, condensed.columns[c])
        r[c] = 0.0
    return solved


def condensed(*arguments):
    """Fill the state rate, and the solutions of (g - J) u = r for unit vectors r; return false if there are none."""
    return call(_condensed, Condensed(*arguments), CONDENSED) == 1


class Bound:
    """A mechanism under inputs, compiled and bound to memory.

    Attributes:
        mechanism: The mechanism.
        model: Its structure, parameters, inputs and memory.
    """

    def __init__(self, mechanism, control, force=None):
        """Bind a mechanism; ``force`` acts at its tips."""
        structure, parameters = compile_mechanism(mechanism)
        if force is not None and np.any(force):
            parameters.tip_force[:] = force
            parameters = parameters._replace(has_tip_force=True)
        self.mechanism = mechanism
        self._bound = BoundModel(structure, parameters, [table.law for table in mechanism.rows], control)
        self.model = self._bound.model

    def solve(self, time, x, g):
        """Return the rate, the matrix that solves (g - J) u = r + f_t s, by columns (r | s), and if there is one."""
        # Compiled code checks no sizes, and writes as many numbers as its own state has.
        assert len(x) == len(self.model.state), "a state with quaternions is another one in compiled code"
        rate = np.zeros(len(x))
        columns = np.zeros((len(x) + 1, len(x)))
        solved = condensed(self._bound.address, time, x, g, rate, np.zeros(len(x) + 1), columns)
        return rate, np.ascontiguousarray(columns.T), solved


@dataclass(frozen=True, eq=False)
class Case:
    """A closed loop, readable and compiled."""

    loop: ClosedLoop
    control: Any
    bound: Bound

    @classmethod
    def of(cls, loop, control=None):
        control = control or compiled_control(loop)
        return cls(loop, control, Bound(loop.finger.mechanism, control, loop.fingertip_force))

    def held(self):
        """The same under tensions that are held: those that stand in its control."""
        mechanism = self.loop.finger.mechanism
        return Case.of(self.loop, held_control(mechanism.channels, mechanism.coordinates))

    @property
    def layout(self):
        return self.loop.finger.layout

    @property
    def kinds(self):
        """Indices of every kind of state that there is: positions, velocities, ..."""
        return [part for part in vars(self.layout.unpack(np.arange(self.layout.size))).values() if len(part)]

    def states(self, rng, count):
        """Random states beyond the ranges and between slack and tight, slow and fast."""
        finger, vector = self.loop.finger, self.layout.unpack(np.zeros(self.layout.size))
        tendons, passive, motors = (
            len(each) for each in (vector.tendon_stiction, vector.passive_position, vector.motor_position)
        )
        lower, upper = finger.stroke_limiter.lower, finger.stroke_limiter.upper

        def spread(size, low, high):
            return rng.normal(size=(count, size)) * 10.0 ** rng.uniform(low, high, (count, 1))

        q = rng.uniform(lower - 0.15 * (upper - lower), upper + 0.15 * (upper - lower), (count, len(lower)))
        state = State(
            position=q,
            passive_position=finger.tendons.rest_position(q) + spread(passive, -5.0, -3.0),
            velocity=spread(len(lower), -2.0, 1.0),
            passive_velocity=spread(passive, -4.0, -1.0),
            tendon_stiction=spread(tendons, -2.0, 0.8),
            joint_stiction=spread(len(lower), -5.0, -2.0),
            motor_position=finger.actuators.angle(q) + spread(motors, -3.0, -1.0),
            motor_velocity=spread(motors, -2.0, 1.0),
            gearbox_stiction=spread(motors, -4.0, -2.0),
        )
        return self.layout.pack(state)

    def solve(self, time, x, g):
        """Return the compiled rate, and the solver of (g - J) u = r; see `Bound.solve`."""
        return self.bound.solve(time, x, g)

    def part(self, method="Rodas5P", rtol=1e-6, atol=1e-6, x=None, step=None):
        """A compiled integration; by default from the start of the loop, with the first step that it takes itself."""
        start = self.loop.initial_state() if x is None else x
        scales, force = self.layout.scales(), self.loop.fingertip_force
        stepper = Stepper(
            self.loop.finger.mechanism, self.control, start, TABLEAUS[method](), rtol, atol * scales, force
        )
        (part,) = stepper.parts
        if step is not None:
            part.memory.step_size[0] = step
        return part


def relative(found, expected):
    """The largest distance between rows, each over the norm of the row that is expected; zeros must be zeros."""
    found, expected = (np.reshape(each, (len(expected), -1)) for each in (found, expected))
    return np.max(np.linalg.norm(found - expected, axis=1) / np.maximum(np.linalg.norm(expected, axis=1), 1e-300))
