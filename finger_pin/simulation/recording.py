"""Results as an xarray Dataset: every signal with its unit, name and equation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.textbook import Trajectory
from finger_pin.description.loading import to_toml
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.kinematics import Motion
from finger_pin.mechanism.rows import Rows
from finger_pin.simulation.account import Account, account
from finger_pin.simulation.following import Following
from finger_pin.simulation.recorded import Recording
from finger_pin.simulation.touching import contact_coordinates, contact_variables

if TYPE_CHECKING:
    pass

_JOINT, _TENDON, _PASSIVE = ("time", "joint"), ("time", "tendon"), ("time", "passive_tendon")
_MOTOR = ("time", "motor")
_PACKAGES = ("finger-pin", "pin", "numpy", "scipy", "xarray")
_STORED = {
    "kinetic": "kinetic energy",
    "gravity": "potential energy of gravity",
    "passive_tendon": "elastic energy of the passive tendons",
    "limiter": "elastic energy of the stroke limiters",
    "joint_springs": "elastic energy of the joints' springs",
    "tendon_spring": "elastic energy of the tendons' springs",
    "tendon_limit": "elastic energy of the tendons' limits",
    "coupling": "elastic energy of the couplings of joints",
    "tendon_bristles": "elastic energy of the tendons' bristles",
    "joint_bristles": "elastic energy of the joints' bristles",
    "contacts": "elastic energy of contacts",
    "objects_kinetic": "kinetic energy of free objects",
    "objects_gravity": "potential energy of free objects",
    "elastic_tendons": "elastic energy of the tendons on spools",
    "gearboxes": "elastic energy of the gearboxes' bristles",
    "rotors": "kinetic energy of the rotors",
}
_EXCHANGED = {
    "actuators": "supplied by the actuators",
    "electrical": "supplied by the motors' electronics",
    "fingertip": "supplied by the fingertip force",
    "motor_heat": "lost as heat in the motors' windings",
    "gearbox_coulomb": "lost by gears sliding",
    "gearbox_viscous": "lost in the gears' viscous friction",
    "elastic_damping": "lost as tendons on spools stretch",
    "palm": "supplied by what moves the palm",
    "objects": "supplied by what moves objects",
    "tendon_coulomb": "lost by tendons sliding",
    "tendon_viscous": "lost in the tendons' viscous friction",
    "tendon_micro_damping": "lost in the tendons' micro-damping",
    "joint_coulomb": "lost by joints sliding",
    "joint_viscous": "lost in the joints' viscous friction",
    "joint_micro_damping": "lost in the joints' micro-damping",
    "limiter": "lost in the stroke limiters",
    "joint_springs": "lost in the joints' springs",
    "contacts_impact": "lost in contacts along their normals",
    "contacts_sliding": "lost in contacts sliding",
    "contacts_micro_damping": "lost in the bristles of contacts",
    "slack": "booked where a tension is cut at zero",
    "tendon_spring_damping": "lost in the tendons' dampers",
    "tendon_limit_limiter": "lost where tendons are at their limits",
    "tendon_dry_friction_coulomb": "lost by tendons sliding dry",
    "coupling_damping": "lost in the couplings of joints",
}


def record(
    scenario: Scenario,
    loop: ClosedLoop,
    trajectory: Trajectory,
    method: str,
    times: Array | None = None,
    following: Following | None = None,
    text: str = "",
) -> Recording:
    """Return all signals of a trajectory at times, by default the scenario's, as far as the trajectory goes.

    The signals are recomputed from the states by the evaluation that the dynamics use; what has followed the motion
    knows them already, at the scenario's times. The scenario's text is written anew unless it is given.
    """
    times = scenario.sample_times() if times is None else times
    times = times[times <= trajectory.breakpoints[-1] * (1.0 + 1e-12)]
    known = following.finish(len(times)) if following is not None else None
    if known is None:
        signals, done = loop.evaluate(times, trajectory.interpolate(times)), None
        motion = loop.motion(times, signals.finger.state)
    else:
        signals, motion, done = known
    kept = account(loop, trajectory, times, signals, motion, done)
    routing = loop.finger.routing
    further = loop.finger.further
    variables = _signals(loop, times, signals, motion) | contact_variables(loop.finger, signals.finger)
    variables |= _further(further, signals.finger.mechanism) | _energies(kept)
    coordinates: dict[str, Any] = {
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "joint": ("joint", list(routing.joints), {"long_name": "joint"}),
        "tendon": ("tendon", list(routing.tendons), {"long_name": "tendon"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the base frame"}),
    }
    coordinates |= {table.group: list(table.names) for table in further} | contact_coordinates(loop.finger)
    if scenario.hand is not None and len(scenario.hand.fingers) > 1:
        coordinates["finger"] = list(scenario.hand.fingers)
    if routing.passive > 1:
        coordinates["passive_tendon"] = list(routing.passive_names)
    if loop.finger.actuators.names:
        coordinates["motor"] = ("motor", list(loop.finger.actuators.names), {"long_name": "motor"})
    return Recording(variables, coordinates, _attributes(scenario, text or to_toml(scenario), trajectory, method))


def _signals(
    loop: ClosedLoop, times: Array, signals: LoopSignals, motion: Motion
) -> dict[str, tuple[Any, Array, dict[str, str]]]:
    finger, tendons, joints, state = signals.finger, signals.finger.tendons, signals.finger.joints, signals.finger.state
    actuated, passive = loop.finger.routing.actuated, loop.finger.routing.passive
    halves = tendons.strands[..., actuated:]
    tension = loop.finger.routing.tendon_tension(tendons.strands)
    error = signals.reference.position - state.position
    force = np.broadcast_to(finger.fingertip_force, motion.tip.shape)
    tip = ("time", "axis") if motion.tip.ndim == 2 else ("time", "finger", "axis")
    table: dict[str, tuple[Any, Array, dict[str, str]]] = {
        "joint_position": _entry(_JOINT, state.position, "rad", "joint angle"),
        "joint_velocity": _entry(_JOINT, state.velocity, "rad/s", "joint velocity"),
        "joint_acceleration": _entry(_JOINT, finger.acceleration, "rad/s2", "joint acceleration", "18"),
        "joint_reference": _entry(_JOINT, signals.reference.position, "rad", "desired joint angle", "20"),
        "tracking_error": _entry(_JOINT, error, "rad", "desired less actual joint angle"),
        "fingertip_position": _entry(tip, motion.tip, "m", "fingertip position", "1"),
        "tendon_command": _entry(_TENDON, signals.control.tension, "N", "commanded or planned tension", "21b"),
        "tendon_tension": _entry(_TENDON, tension, "N", "delivered tension; distal half of a passive tendon", "12"),
        "tendon_velocity": _entry(_TENDON, tendons.velocity, "m/s", "sliding velocity", "3"),
        "tendon_friction": _entry(_TENDON, tendons.friction, "N", "tendon friction force", "9c"),
        "tendon_stiction": _entry(_TENDON, state.tendon_stiction, "N", "tendon stiction force", "9a"),
        "tendon_normal_force": _entry(_TENDON, tendons.normal, "N", "sum of the tensions at both ends", "14"),
        "tendon_friction_coefficient": _entry(_TENDON, tendons.coefficient, "1", "Coulomb coefficient", "16"),
        "tendon_curvature": _entry(_TENDON, tendons.curvature, "rad", "total curvature of the path", "15"),
        "joint_torque_command": _entry(_JOINT, signals.control.torque, "N m", "desired joint torque", "19"),
        "joint_torque": _entry(_JOINT, finger.tendon_torque, "N m", "torque of the tendons", "11"),
        "joint_friction": _entry(_JOINT, joints.friction, "N m", "joint friction torque", "9c"),
        "joint_stiction": _entry(_JOINT, state.joint_stiction, "N m", "joint stiction torque", "9a"),
        "joint_reaction": _entry(_JOINT, joints.reaction, "N", "joint reaction force", "17"),
        "limiter_torque": _entry(_JOINT, finger.limiter_torque, "N m", "stroke limiter torque", "2"),
        "fingertip_force": _entry(tip, force, "N", "force on the fingertip", "6"),
        "spring_torque": _entry(_JOINT, finger.spring_torque, "N m", "torque of the joints' springs"),
        "external_torque": _entry(_JOINT, finger.external_torque, "N m", "torque of the fingertip force", "6"),
    }
    if loop.palm is not None:
        place, rotation = loop.palm.place(times)
        quaternions = [pin.Quaternion(each).coeffs() for each in rotation]
        table["palm_position"] = _entry(("time", "axis"), place, "m", "place of the palm in the world")
        text = "rotation of the palm to the world, x, y, z, w"
        table["palm_orientation"] = _entry(("time", "quaternion"), np.array(quaternions), "1", text)
    if signals.control.shortfall is not None:
        text = "desired torque that tension limits keep from being planned"
        table["torque_shortfall"] = _entry(_JOINT, signals.control.shortfall, "N m", text)
    motors = finger.motors
    if motors is not None and state.motor_position is not None:
        assert state.motor_velocity is not None and state.gearbox_stiction is not None
        text = "tension at the canal's entrance: at a spool, of an ideal source, or of a passive tendon's proximal half"
        table |= {
            "motor_position": _entry(_MOTOR, state.motor_position, "rad", "angle of the spool"),
            "motor_velocity": _entry(_MOTOR, state.motor_velocity, "rad/s", "velocity of the spool"),
            "motor_current": _entry(_MOTOR, motors.current, "A", "current"),
            "motor_voltage": _entry(_MOTOR, motors.voltage, "V", "voltage"),
            "motor_torque": _entry(_MOTOR, motors.torque, "N m", "torque of the motor, at the spool"),
            "gearbox_friction": _entry(_MOTOR, motors.friction, "N m", "friction torque of the gearbox", "9c"),
            "gearbox_stiction": _entry(_MOTOR, state.gearbox_stiction, "N m", "its stiction torque", "9a"),
            "gearbox_load": _entry(_MOTOR, motors.load, "N m", "torque that the gears carry"),
            "spool_tension": _entry(_TENDON, tendons.entering, "N", text),
        }
    if passive:
        shared = {
            "passive_tension_proximal": (halves[..., 0::2], "N", "tension of the proximal half", "12"),
            "passive_position": (state.passive_position, "m", "position of the lumped mass", "13"),
            "passive_velocity": (state.passive_velocity, "m/s", "velocity of the lumped mass", "13"),
        }
        for name, (values, unit, long_name, equation) in shared.items():
            # One passive tendon, the common case, needs no dimension of its own.
            single = passive == 1
            dims = ("time",) if single else _PASSIVE
            table[name] = _entry(dims, values[:, 0] if single else values, unit, long_name, equation)
    return table


def _further(tables: tuple[Rows, ...], found: Evaluation) -> dict[str, tuple[Any, Array, dict[str, str]]]:
    """Return what rows of a user's own see and show, by table."""
    shown = {}
    for table in tables:
        own, dims = found.rows[table.group], ("time", table.group)
        values = {"force": own.force, "length": own.row.length, "speed": own.row.speed}
        values |= dict(zip(table.law.signals, own.signals, strict=True))
        if np.any(table.channels >= 0):
            values["input"] = own.row.command
        if table.law.scale is not None:
            values["state"] = own.row.state
        for name, value in values.items():
            shown[f"{table.group}_{name}"] = _entry(dims, value, "SI", f"{name} of {table.law.name}")
    return shown


def _energies(kept: Account) -> dict[str, tuple[Any, Array, dict[str, str]]]:
    table = {}
    for name, values in kept.stored.items():
        table[f"energy_{name}"] = _entry("time", values, "J", _STORED.get(name, f"energy stored in {name}"))
    for name in sorted(kept.works.names, key=[*_EXCHANGED, *kept.works.names].index):
        other = f"supplied by {name}" if name in kept.works.supplies else f"lost in {name}"
        text = _EXCHANGED.get(name, other)
        table[f"power_{name}"] = _entry("time", kept.powers[name], "W", f"power {text}")
        table[f"energy_exchanged_{name}"] = _entry("time", kept.works[name], "J", f"energy {text}")
    text = "stored energy less its start, less supplied, plus lost: zero for an exact integration"
    table["energy_residual"] = _entry("time", kept.residual, "J", text)
    return table


def _entry(
    dims: Any, values: Array, units: str, long_name: str, equation: str = ""
) -> tuple[Any, Array, dict[str, str]]:
    attributes = {"units": units, "long_name": long_name}
    if equation:
        attributes["equation"] = f"({equation})"
    return dims, np.asarray(values), attributes


def _attributes(scenario: Scenario, text: str, trajectory: Trajectory, method: str) -> dict[str, Any]:
    settings = scenario.simulation
    statistics: Mapping[str, Any] = {f"solver_{key}": value for key, value in asdict(trajectory.statistics).items()}
    return {
        "title": scenario.title or scenario.name,
        "scenario": text,
        "method": method,
        "rtol": settings.rtol,
        "atol_scale": settings.atol_scale,
        "end_time": float(trajectory.breakpoints[-1]),
        **statistics,
        **_versions(),
    }


@cache
def _versions() -> Mapping[str, str]:
    return {f"version_{name.replace('-', '_')}": metadata.version(name) for name in _PACKAGES}
