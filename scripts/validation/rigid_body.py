"""The compiled rigid body against Pinocchio, on fingers and on an arm of six joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import load_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array
from validation.check import Check, Comparison, Section, compare

TITLE = "Rigid body"
STATES = 1000
TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Compared:
    """Largest differences from Pinocchio, each over the largest value or row."""

    acceleration: float
    tip: float
    kinetic: float
    potential: float


def arm() -> Finger:
    """Return a finger on Pinocchio's own sample manipulator, with six joints about different axes."""
    model = pin.buildSampleModelManipulator()
    names = list(model.names)[1:]
    model.addFrame(pin.Frame("tip", model.njoints - 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    rng = np.random.default_rng(8)
    described = {
        "name": "arm",
        "gravity": (1.0, -2.0, -9.0),
        "joints": {name: {"range": [-1.0, 1.0]} for name in names},
        "tendons": {
            f"T{i}": {"crossings": {name: {"radius": float(rng.uniform(-0.01, 0.01))} for name in names}}
            for i in range(len(names) + 1)
        },
    }
    return Finger.from_model(FingerDescription.model_validate(described), model, {n: n for n in names}, "tip")


def states(finger: Finger) -> tuple[Array, Array]:
    """Return random packed states, shape (1000, size), and tensions, shape (1000, a)."""
    rng, layout, size = np.random.default_rng(2), finger.layout, STATES
    x = np.zeros((size, layout.size))
    state = layout.unpack(x)
    state.position[:] = rng.uniform(-3.0, 3.0, state.position.shape)
    state.velocity[:] = 10.0 * rng.normal(size=state.velocity.shape)
    state.tendon_stiction[:] = 1e-2 * rng.normal(size=state.tendon_stiction.shape)
    state.joint_stiction[:] = 1e-2 * rng.normal(size=state.joint_stiction.shape)
    return x, rng.uniform(0.0, 5.0, (size, finger.routing.actuated))


def against_pinocchio(finger: Finger) -> Compared:
    """Compare accelerations under all torques of (18), the fingertip and the energies at random states."""
    x, command = states(finger)
    core = CompiledFinger(finger)
    signals = core.evaluate(x, command)
    q, v = signals.state.position, signals.state.velocity
    torque = signals["joint_torque"] - signals["joint_friction"] - signals["limiter_torque"]
    moved = core.motion(q, v)
    model, data = finger.rigid_body.model, finger.rigid_body.model.createData()
    acceleration, tips, kinetic, potential = [], [], [], []
    for row in zip(q, v, torque, strict=True):
        acceleration.append(pin.aba(model, data, *row).copy())
        pin.framesForwardKinematics(model, data, row[0])
        tips.append(data.oMf[finger.rigid_body.tip_frame].translation.copy())
        kinetic.append(pin.computeKineticEnergy(model, data, row[0], row[1]))
        potential.append(pin.computePotentialEnergy(model, data, row[0]))
    return Compared(
        relative(signals["joint_acceleration"], np.array(acceleration)),
        Comparison(moved.tip, np.array(tips)).largest,
        relative(moved.kinetic_energy, np.array(kinetic)),
        Comparison(moved.potential_energy, np.array(potential)).largest / float(np.max(np.abs(potential))),
    )


def relative(found: Array, expected: Array) -> float:
    """Return the largest distance between rows, each over the norm of the row that is expected."""
    found, expected = (np.reshape(each, (len(expected), -1)) for each in (found, expected))
    return float(np.max(np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)))


def measure() -> Section:
    """Compare every shipped finger and the arm."""
    fingers = {name: Finger(load_finger(name)) for name in ("ub_stand_in", "dexmart_index", "planar")}
    checks: list[Check] = []
    for name, finger in {**fingers, "six-joint arm": arm()}.items():
        found = against_pinocchio(finger)
        for quantity, gap, unit in (
            ("acceleration under all torques, relative", found.acceleration, "1"),
            ("fingertip", found.tip, "m"),
            ("kinetic energy, relative", found.kinetic, "1"),
            ("potential energy, relative", found.potential, "1"),
        ):
            checks.append(compare(f"{name}: {quantity}, {STATES} states", "Pinocchio", gap, TOLERANCE, unit))
    return Section.of(checks)
