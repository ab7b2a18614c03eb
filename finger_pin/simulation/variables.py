"""The variables that a result can have, each with its unit, name and equation, computed when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.palm import PrescribedJoints
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.rows import RowSignals
from finger_pin.simulation.contact_variables import contact_coordinates, contact_value, contact_variables
from finger_pin.simulation.row_variables import account_variables, cord_variables, extra_row_variables, motor_variables
from finger_pin.simulation.sampled_trajectory import BASE_FRAME, WORLD_FRAME, Quantity, SampledTrajectory, state_block
from finger_pin.typing import Array

_JOINT, _TENDON, _PASSIVE = ("time", "joint"), ("time", "tendon"), ("time", "passive_tendon")
_MOTORS, _TIME = ("time", "motor"), ("time",)
#: A variable that is left out of a whole result where nothing limits tensions.
SHORTFALL = "torque_shortfall"


def variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return all variables that a result of a loop can have, by name."""
    table = {
        "joint_position": state_block("position"),
        "joint_velocity": state_block("velocity"),
        "joint_acceleration": Quantity(
            _JOINT, lambda run: run.finger.acceleration, "rad/s2", "joint acceleration", "18"
        ),
        "joint_reference": Quantity(_JOINT, lambda run: run.reference.position, "rad", "desired joint angle", "20"),
        "tracking_error": Quantity(
            _JOINT, lambda run: run.reference.position - run.state.position, "rad", "desired less actual joint angle"
        ),
    }
    tip_dims = ("tip",) if loop.finger.description.tree.tip_names else ("finger",)
    dims = ("time", *(tip_dims if len(loop.finger.rigid_body.tips) > 1 else ()), "axis")
    table |= {
        "fingertip_position": Quantity(dims, lambda run: run.motion.tip, "m", "fingertip position", "1"),
        **_tendon_variables(),
        "joint_torque_command": Quantity(_JOINT, lambda run: run.control.torque, "N m", "desired joint torque", "19"),
        "joint_torque": Quantity(_JOINT, lambda run: run.finger.tendon_torque, "N m", "torque of the tendons", "11"),
        "joint_friction": Quantity(
            _JOINT, lambda run: run.finger.joints.friction, "N m", "joint friction torque", "9c"
        ),
        "joint_reaction": Quantity(_JOINT, lambda run: run.finger.joints.reaction, "N", "joint reaction force", "17"),
        "limiter_torque": Quantity(_JOINT, lambda run: run.finger.limiter_torque, "N m", "stroke limiter torque", "2"),
        "fingertip_force": Quantity(dims, lambda run: run.force, "N", "force on the fingertip", "6"),
        "spring_torque": Quantity(_JOINT, lambda run: run.finger.spring_torque, "N m", "torque of the joints' springs"),
        "external_torque": Quantity(
            _JOINT, lambda run: run.finger.external_torque, "N m", "torque of the fingertip force", "6"
        ),
        SHORTFALL: Quantity(_JOINT, _shortfall, "N m", "desired torque that tension limits keep from being planned"),
    }
    if isinstance(loop.prescribed_motion, PrescribedJoints):
        table["joint_effort"] = Quantity(_JOINT, _effort, "N m", "torque that the given motion of a joint takes", "18")
    if loop.finger.layout.names_of("joint_stiction"):
        table["joint_stiction"] = state_block("joint_stiction")
    if loop.finger.layout.names_of("elastic_stiction"):
        table["elastic_stiction"] = state_block("elastic_stiction")
    table |= (
        _wrap_variables(loop)
        | cord_variables(loop.finger)
        | _winding_variables(loop)
        | _palm_variables(loop)
        | motor_variables(loop)
        | _passive_tendon_variables(loop)
        | _sensor_variables(loop)
        | _contact_and_row_variables(loop)
    )
    for name, quantity in table.items():
        if frame := _frame(name, quantity):
            table[name] = quantity._replace(frame=frame)
    return table


def _tendon_variables() -> dict[str, Quantity]:
    return {
        "tendon_command": Quantity(_TENDON, _commanded_tension, "N", "commanded or planned tension", "21b"),
        "tendon_tension": Quantity(
            _TENDON,
            lambda run: run.loop.finger.routing.tendon_tension(run.finger.tendons.strands),
            "N",
            "delivered tension; distal half of a passive tendon",
            "12",
        ),
        "tendon_velocity": Quantity(_TENDON, lambda run: run.finger.tendons.velocity, "m/s", "sliding velocity", "3"),
        "tendon_friction": Quantity(
            _TENDON, lambda run: run.finger.tendons.friction, "N", "tendon friction force", "9c"
        ),
        "tendon_stiction": state_block("tendon_stiction"),
        "tendon_normal_force": Quantity(
            _TENDON, lambda run: run.finger.tendons.normal, "N", "sum of the tensions at both ends", "14"
        ),
        "tendon_friction_coefficient": Quantity(
            _TENDON, lambda run: run.finger.tendons.coefficient, "1", "Coulomb coefficient", "16"
        ),
        "tendon_curvature": Quantity(
            _TENDON, lambda run: run.finger.tendons.curvature, "rad", "total curvature of the path", "15"
        ),
    }


def _commanded_tension(run: SampledTrajectory) -> Array:
    routing, command = run.loop.finger.routing, run.control.tension
    # A winch is commanded a length.
    return np.where(np.append(routing.winched, np.zeros(routing.passive, dtype=bool)), 0.0, command)


def _winding_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the commands to spools in position drive and to winches; zero elsewhere."""
    routing, actuators = loop.finger.routing, loop.finger.actuators

    def angle(run: SampledTrajectory) -> Array:
        angles = np.zeros((len(run.times), len(actuators.names)))
        if run.spool_goals is not None:
            angles[:, actuators.holds] = run.spool_goals
        return angles

    def length(run: SampledTrajectory) -> Array:
        lengths = np.zeros((len(run.times), len(routing.tendons)))
        winched = np.flatnonzero(routing.winched)
        lengths[:, winched] = run.control.tension[:, winched]
        lengths[:, actuators.tendons] = run.wound_lengths(angle(run))
        return lengths

    text = "tension at the canal's entrance: at a spool, of an ideal source, or of a passive tendon's proximal half"
    table = {}
    if actuators.names or routing.winched.any():
        table["spool_tension"] = Quantity(_TENDON, lambda run: run.finger.tendons.entering, "N", text)
    if actuators.holds.any() and (loop.drives is None or loop.drives.compiled is not None):
        table["spool_angle"] = Quantity(_MOTORS, angle, "rad", "commanded angle of a spool in position drive, else 0")
    if "spool_angle" in table or routing.winched.any():
        table["tendon_winding"] = Quantity(_TENDON, length, "m", "commanded length of cord that is wound in, else 0")
    return table


def _wrap_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the signals of tendons that rub at several places."""
    if not loop.finger.wraps:
        return {}

    def wrap_signal(run: SampledTrajectory, signal: Callable[[RowSignals], Array]) -> Array:
        return run.finger.tendons.at_wraps(signal)

    signals: dict[str, tuple[Callable[[RowSignals], Array], str, str]] = {
        "wrap_friction": (lambda wraps: wraps["friction"], "N", "friction force at every bend of a tendon"),
        "wrap_velocity": (lambda wraps: wraps.row.speed, "m/s", "sliding velocity at every bend of a tendon"),
        "wrap_curvature": (lambda wraps: wraps.row.curvature, "rad", "curvature of every bend of a tendon"),
        "wrap_level": (lambda wraps: wraps["level"], "N", "friction of steady sliding at every bend of a tendon"),
    }
    tension = Quantity(
        ("time", "wrap"), lambda run: run.finger.tendons.wrap_tension, "N", "tension behind every bend of a tendon"
    )
    return {"wrap_tension": tension} | {
        name: Quantity(("time", "wrap"), partial(wrap_signal, signal=signal), unit, text)
        for name, (signal, unit, text) in signals.items()
    }


def _frame(name: str, variable: Quantity) -> str:
    """Return the frame of a variable with components: the base, but the world for the motion of the palm."""
    if not {"axis", "quaternion"} & set(variable.dims):
        return ""
    return WORLD_FRAME if name.startswith("palm_") else BASE_FRAME


def _contact_and_row_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    table = {
        name: Quantity(dims, partial(contact_value, name=name), units, text)
        for name, (dims, units, text) in contact_variables(loop.finger).items()
    }
    return table | extra_row_variables(loop.finger.extra_rows) | account_variables(loop.finger)


def _shortfall(run: SampledTrajectory) -> Array:
    missing = run.control.torque_deficit
    return np.zeros_like(run.state.position) if missing is None else missing


def _effort(run: SampledTrajectory) -> Array:
    """Return M a + h less the torques that the finger exerts itself, shape (m, n), N m."""
    loop, state, mechanism = run.loop, run.state, run.finger.mechanism
    assert loop.prescribed_motion is not None
    motion = zip(state.position, state.velocity, loop.prescribed_motion.signal.derivative(run.times, 2), strict=True)
    torque = np.array([loop.finger.rigid_body.inverse_dynamics(*joint_motion) for joint_motion in motion])
    return np.asarray(torque - (mechanism.torque + mechanism.external)[:, : torque.shape[1]])


def _palm_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    if loop.palm is None:
        return {}
    path = loop.palm

    def orientation(run: SampledTrajectory) -> Array:
        return np.array([pin.Quaternion(rotation).coeffs() for rotation in path.place(run.times)[1]])

    text = "rotation of the palm to the world, x, y, z, w"
    return {
        "palm_position": Quantity(
            ("time", "axis"), lambda run: path.place(run.times)[0], "m", "place of the palm in the world"
        ),
        "palm_orientation": Quantity(("time", "quaternion"), orientation, "1", text),
        "palm_velocity": Quantity(
            ("time", "axis"), lambda run: path.velocity(run.times)[0], "m/s", "velocity of the palm in the world"
        ),
        "palm_angular_velocity": Quantity(
            ("time", "axis"), lambda run: path.velocity(run.times)[1], "rad/s", "angular velocity of the palm"
        ),
    }


def _passive_tendon_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    count, actuated = loop.finger.routing.passive, loop.finger.routing.actuated
    if not count:
        return {}
    # One passive tendon, the common case, needs no separate dimension.
    single = count == 1
    dims = ("time",) if single else _PASSIVE

    def squeezed(values: Array) -> Array:
        return values[:, 0] if single else values

    def proximal(run: SampledTrajectory) -> Array:
        return squeezed(run.finger.tendons.strands[..., actuated::2])

    return {
        "passive_tension_proximal": Quantity(dims, proximal, "N", "tension of the proximal half", "12"),
        **{name: state_block(name, single) for name in ("passive_position", "passive_velocity")},
    }


def _sensor_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the readings of a sampled controller's sensors, each held until the next sample."""

    def reading(run: SampledTrajectory, name: str) -> Array:
        return run.loop.controller.measured(name, run.times)

    return {
        f"measured_{sensor.name}": Quantity(
            ("time", sensor.dimension) if sensor.dimension else _TIME,
            partial(reading, name=sensor.name),
            sensor.units,
            f"{sensor.name.replace('_', ' ')} as the controller measures it",
        )
        for sensor in loop.controller.sensors
    }


def coordinates(scenario: Scenario, loop: ClosedLoop, times: Array) -> dict[str, Any]:
    """Return the coordinates of a result."""
    routing, finger = loop.finger.routing, loop.finger
    labels: dict[str, Any] = {
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "joint": ("joint", list(routing.joints), {"long_name": "joint"}),
        "tendon": ("tendon", list(routing.tendons), {"long_name": "tendon"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the base frame"}),
    }
    labels |= {"cord": ("cord", cords, {"long_name": "cord of a tree"})} if (cords := list(finger.cord_names)) else {}
    labels |= {table.group: list(table.names) for table in finger.extra_rows} | contact_coordinates(finger)
    labels |= {each.dimension: list(each.labels) for each in loop.controller.sensors if each.labels}
    if scenario.hand is not None and len(scenario.hand.fingers) > 1:
        labels["finger"] = list(scenario.hand.fingers)
    if tips := finger.description.tree.tip_names:
        labels["tip"] = ("tip", list(tips), {"long_name": "fingertip"})
    if finger.wraps:
        labels["wrap"] = ("wrap", list(finger.wrap_names), {"long_name": "bend of a tendon"})
    if routing.passive > 1:
        labels["passive_tendon"] = list(routing.passive_names)
    if elastic_names := finger.layout.names_of("elastic_stiction"):
        labels["elastic_tendon"] = (
            "elastic_tendon",
            list(elastic_names),
            {"long_name": "tendon or half of one, that stretches"},
        )
    if finger.actuators.names:
        labels["motor"] = ("motor", list(finger.actuators.names), {"long_name": "motor"})
    if finger.actuators.loose_names:
        labels["spool"] = ("spool", list(finger.actuators.loose_names), {"long_name": "motor of the spool"})
    return labels
