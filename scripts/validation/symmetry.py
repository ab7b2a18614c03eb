"""Symmetries: left and right, and the units of length, mass and time, change nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import load_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulator import Simulator
from finger_pin.typing import Array
from validation.check import Comparison, Section, compare

TITLE = "Mirror and units"
_WIDTH, _MASS = 0.01, 0.02


@dataclass(frozen=True, eq=False)
class Twins:
    """Two motions that must be one: joint angles, rad, stiction of tendons, N, and of joints, N m."""

    position: Comparison
    tendon_stiction: Comparison
    joint_stiction: Comparison


def mirrored() -> Twins:
    """Move the paper's finger and its mirror image in y: T1 and T2 swap, joint 1 turns the other way."""
    finger = Finger(load_finger("ub_stand_in"))
    left = Simulator(finger, [0.1, 0.4, 0.5, 0.3], rtol=1e-8, atol_scale=1e-8)
    right = Simulator(finger, [-0.1, 0.4, 0.5, 0.3], rtol=1e-8, atol_scale=1e-8)
    rows: list[list[tuple[Array, Array]]] = []
    for tension in ([1.5, 1.0, 5.0, 3.5], [1.0, 2.0, 4.0, 3.0], [3.0, 1.0, 6.0, 4.5]):
        one = left.step(tension, 0.02, [0.1, 0.2, -0.1])
        other = right.step([tension[1], tension[0], *tension[2:]], 0.02, [0.1, -0.2, -0.1])
        flipped = np.array([-1.0, 1.0, 1.0, 1.0])
        rows.append(
            [
                (other.position * flipped, one.position),
                (other.tendon_stiction[[1, 0, 2, 3, 4]], one.tendon_stiction),
                (other.joint_stiction * flipped, one.joint_stiction),
            ]
        )
    pairs = [Comparison(*(np.array(side) for side in zip(*kind, strict=True))) for kind in zip(*rows, strict=True)]
    return Twins(*pairs)


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint angles, rad, and tendon stiction in the unit of force, at three times."""

    angles: Array
    forces: Array


def in_units(length: float, mass: float, time: float) -> Motion:
    """Move a finger of two joints described in other units, every option of law (9) on.

    Args:
        length: Units in a metre.
        mass: Units in a kilogram.
        time: Units in a second.
    """
    force = mass * length / time**2
    tendon, torque = force / length, force * length
    radii = {"F": {"a": 8e-3, "b": 6e-3}, "E": {"a": -8e-3, "b": -6e-3}, "S": {"a": 5e-3, "b": -6e-3}}
    described = {
        "name": "scaled",
        "gravity": [0.0, -9.81 * length / time**2, 0.0],
        "joints": {
            name: {
                "range": [-0.5, 0.5],
                "link": {"length": size * length, "width": _WIDTH * length, "mass": _MASS * mass},
            }
            for name, size in (("a", 0.05), ("b", 0.04))
        },
        "tendons": {
            name: {
                "curvature_offset": 1.3,
                "crossings": {joint: {"radius": radius * length} for joint, radius in each.items()},
            }
            for name, each in radii.items()
        },
        "tendon_friction": {
            "stiffness": 5e4 * tendon,
            "viscous": tendon * time,
            "stribeck_velocity": 0.01 * length / time,
            "floor": 1e-4 * force,
            "stribeck_exponent": 2,
            "micro_damping": 2.0 * tendon * time,
        },
        "joint_friction": {
            "coulomb": 2.5e-4 * length,
            "stiction": 3.5e-4 * length,
            "stiffness": 5.0 * torque,
            "viscous": 1e-3 * torque * time,
            "stribeck_velocity": 0.1 / time,
            "floor": 1e-7 * torque,
            "stribeck_exponent": 2,
            "micro_damping": 1e-3 * torque * time,
        },
        "stroke_limiter": {"stiffness": 50.0 * torque, "damping": 0.5 * time},
    }
    finger = Finger(FingerDescription.model_validate(described))
    sim = Simulator(finger, [0.1, 0.2], rtol=1e-9, atol_scale=1e-9, method="Rodas5P")
    angles, forces = [], []
    for tension in ([3.0, 1.0, 2.0], [1.0, 4.0, 1.0], [5.0, 1.0, 0.5]):
        state = sim.step(np.array(tension) * force, 0.05 * time)
        angles.append(state.position)
        forces.append(state.tendon_stiction / force)
    return Motion(np.array(angles), np.array(forces))


def measure() -> Section:
    """Compare a finger with its mirror image, and with itself in other units."""
    twins, here, there = mirrored(), in_units(1.0, 1.0, 1.0), in_units(1.5, 3.0, 0.5)
    mirror, units = "mirror image of the finger", "same finger in SI units"
    return Section.of(
        [
            compare("joint angles of the mirrored motion", mirror, twins.position.largest, 1e-6, "rad"),
            compare("tendon stiction of the mirrored motion", mirror, twins.tendon_stiction.largest, 1e-4, "N"),
            compare("joint stiction of the mirrored motion", mirror, twins.joint_stiction.largest, 1e-6, "N m"),
            compare("joint angles in other units", units, Comparison(there.angles, here.angles).largest, 1e-6, "rad"),
            compare("tendon stiction in other units", units, Comparison(there.forces, here.forces).largest, 1e-5, "N"),
        ]
    )
