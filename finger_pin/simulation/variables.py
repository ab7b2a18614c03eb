"""The variables that a result can have: signals of its finger, references, commands, and the energy account."""

from __future__ import annotations

from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.palm import PrescribedJoints
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.rows import LOST
from finger_pin.mechanism.signal_table import ALWAYS
from finger_pin.mechanism.signals import WORLD_FRAME, Quantity, Section
from finger_pin.simulation.contact_variables import contact_coordinates
from finger_pin.simulation.energy import flow_terms, stored_terms
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.typing import Array

#: A variable that is left out of a whole result where nothing limits tensions.
SHORTFALL = "torque_shortfall"
RESIDUAL = "energy_residual"
#: What a run that goes on needs of its loops' last sample, in the order of `LoopMemory`.
LOOP_VARIABLES = ("position_loop_age", "position_loop_error", "position_loop_integral", "position_loop_voltage")


def _commanded_tension(run: SampledTrajectory) -> Array:
    routing, command = run.loop.finger.routing, run.control.tension
    # A winch is commanded a length.
    return np.where(np.append(routing.winched, np.zeros(routing.passive, dtype=bool)), 0.0, command)


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


def _spool_angle(run: SampledTrajectory) -> Array:
    actuators = run.loop.finger.actuators
    angles = np.zeros((len(run.times), len(actuators.names)))
    if run.spool_goals is not None:
        angles[:, actuators.holds] = run.spool_goals
    return angles


def _winding(run: SampledTrajectory) -> Array:
    routing, actuators = run.loop.finger.routing, run.loop.finger.actuators
    lengths = np.zeros((len(run.times), len(routing.tendons)))
    winched = np.flatnonzero(routing.winched)
    lengths[:, winched] = run.control.tension[:, winched]
    lengths[:, actuators.tendons] = run.wound_lengths(_spool_angle(run))
    return lengths


def _holds_spools(loop: ClosedLoop) -> bool:
    return bool(loop.finger.actuators.holds.any()) and (loop.drives is None or loop.drives.compiled is not None)


def _loop_age(run: SampledTrajectory) -> Array:
    assert run.loop.drives is not None and run.loop.drives.compiled is not None
    drives = run.loop.drives.compiled
    elapsed: Array = run.times - drives.first - drives.period * drives.latest(run.times)
    return np.maximum(elapsed, 0.0)


def _loop_sample(run: SampledTrajectory, history: str) -> Array:
    """Return what position loops had at their last sample; zero for motors without one."""
    assert run.loop.drives is not None and run.loop.drives.compiled is not None
    drives = run.loop.drives.compiled
    values = np.zeros((len(run.times), len(run.loop.finger.actuators.names)))
    values[:, run.loop.finger.actuators.holds] = drives.zero_order_hold(getattr(drives, history), run.times)
    return values


def _palm(run: SampledTrajectory, motion: str, part: int) -> Array:
    value: Array = getattr(run.loop.palm, motion)(run.times)[part]
    return value


def _palm_orientation(run: SampledTrajectory) -> Array:
    return np.array([pin.Quaternion(rotation).coeffs() for rotation in _palm(run, "place", 1)])


_of_run = partial(Quantity, of_finger=False)
_JOINT, _MOTOR, _TIP = ("joint",), ("motor",), ("fingertip", "axis")
_of_palm = partial(_of_run, frame=WORLD_FRAME)

#: The variables of a run beside the signals of its finger.
RUN_SECTIONS = (
    Section(
        ALWAYS,
        lambda loop: True,
        {
            "joint_reference": _of_run(_JOINT, "rad", "desired joint angle", attrgetter("reference.position"), "20"),
            "tracking_error": _of_run(
                _JOINT,
                "rad",
                "desired less actual joint angle",
                lambda run: run.reference.position - run.state.position,
            ),
            "fingertip_position": _of_run(_TIP, "m", "fingertip position", attrgetter("motion.tip"), "1"),
            "fingertip_force": _of_run(_TIP, "N", "force on the fingertip", attrgetter("force"), "6"),
            "tendon_command": _of_run(("tendon",), "N", "commanded or planned tension", _commanded_tension, "21b"),
            "joint_torque_command": _of_run(_JOINT, "N m", "desired joint torque", attrgetter("control.torque"), "19"),
            SHORTFALL: _of_run(_JOINT, "N m", "desired torque that tension limits keep from being planned", _shortfall),
        },
    ),
    Section(
        "With a motion of the joints that is given",
        lambda loop: isinstance(loop.prescribed_motion, PrescribedJoints),
        {"joint_effort": _of_run(_JOINT, "N m", "torque that the given motion of a joint takes", _effort, "18")},
    ),
    Section(
        "With motors in position drive",
        _holds_spools,
        {"spool_angle": _of_run(_MOTOR, "rad", "commanded angle of a spool in position drive, else 0", _spool_angle)},
    ),
    Section(
        "With motors in position drive or winches",
        lambda loop: _holds_spools(loop) or loop.finger.routing.winched.any(),
        {"tendon_winding": _of_run(("tendon",), "m", "commanded length of cord that is wound in, else 0", _winding)},
    ),
    Section(
        "With a palm that moves",
        lambda loop: loop.palm,
        {
            "palm_position": _of_palm(
                ("axis",), "m", "place of the palm in the world", partial(_palm, motion="place", part=0)
            ),
            "palm_orientation": _of_palm(
                ("quaternion",), "1", "rotation of the palm to the world, x, y, z, w", _palm_orientation
            ),
            "palm_velocity": _of_palm(
                ("axis",), "m/s", "velocity of the palm in the world", partial(_palm, motion="velocity", part=0)
            ),
            "palm_angular_velocity": _of_palm(
                ("axis",), "rad/s", "angular velocity of the palm", partial(_palm, motion="velocity", part=1)
            ),
        },
    ),
    Section(
        "With position loops of motors",
        lambda loop: loop.drives is not None and loop.drives.compiled is not None,
        {
            LOOP_VARIABLES[0]: _of_run((), "s", "time since the last sample of the position loops", _loop_age),
            LOOP_VARIABLES[1]: _of_run(
                _MOTOR,
                "rad",
                "commanded less measured angle at the last sample of a position loop, else 0",
                partial(_loop_sample, history="errors"),
            ),
            LOOP_VARIABLES[2]: _of_run(
                _MOTOR,
                "rad s",
                "integral of the error of a position loop, as the loop has it, else 0",
                partial(_loop_sample, history="integrals"),
            ),
            LOOP_VARIABLES[3]: _of_run(
                _MOTOR,
                "V",
                "voltage that a position loop has asked for; 1e30 where the motor is let go",
                partial(_loop_sample, history="voltages"),
            ),
        },
    ),
)


def variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return all variables that a result of a loop can have, by name."""
    finger = loop.finger
    table = {name: each for section in RUN_SECTIONS if section.holds(loop) for name, each in section.signals.items()}
    tips = ("tip",) if _tip_names(loop) else ("finger",)
    dims = (*(tips if len(finger.rigid_body.tips) > 1 else ()), "axis")
    table |= {name: each._replace(dims=dims) for name, each in table.items() if each.dims == _TIP}
    return finger.signal_table | table | _sensor_variables(loop) | _account_variables(loop)


def _sensor_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the readings of a sampled controller's sensors, each held until the next sample."""

    def reading(run: SampledTrajectory, name: str) -> Array:
        return run.loop.controller.measured(name, run.times)

    return {
        f"measured_{sensor.name}": _of_run(
            (sensor.dimension,) if sensor.dimension else (),
            sensor.units,
            f"{sensor.name.replace('_', ' ')} as the controller measures it",
            partial(reading, name=sensor.name),
        )
        for sensor in loop.controller.sensors
    }


def _account_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the stored energies, the powers, their integrals and the residual of the account, by name."""

    def stored(run: SampledTrajectory, name: str) -> Array:
        return run.stored[name]

    def power(run: SampledTrajectory, name: str) -> Array:
        return run.powers[name]

    def work(run: SampledTrajectory, name: str) -> Array:
        return run.account.works[name]

    table = {}
    for term in stored_terms(loop.finger):
        value, text = partial(stored, name=term.name), f"energy stored: {term.label}"
        table[f"energy_{term.name}"] = _of_run((), "J", text, value, energy_term=term)
    # Supplied powers come before losses.
    for term in sorted(flow_terms(loop.finger.mechanism.energies), key=lambda term: term.kind == LOST):
        name, text = term.name, f"{term.kind}: {term.label}"
        exchanged = partial(work, name=name)
        table[f"power_{name}"] = _of_run((), "W", f"power {text}", partial(power, name=name), energy_term=term)
        table[f"energy_exchanged_{name}"] = _of_run((), "J", f"energy {text}", exchanged, energy_term=term)
    text = "stored energy less its start, less supplied, plus lost: zero for an exact integration"
    return table | {RESIDUAL: _of_run((), "J", text, attrgetter("account.residual"))}


def _tip_names(loop: ClosedLoop) -> tuple[str, ...]:
    """Return the names of the fingertips of a tree; none where a hand's fingers have one each."""
    tips, hand = loop.finger.description.tree.tip_names, loop.finger.description.hand
    return tips if hand is None or tips != tuple(hand.fingers) else ()


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
    if tips := _tip_names(loop):
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
