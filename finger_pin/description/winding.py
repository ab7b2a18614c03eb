"""Winding of tendons: which of them an ideal winch winds, and which commands fit motors and tendons."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from finger_pin.description.finger_description import FingerDescription, HandSettings
from finger_pin.description.parameters import Tendon, Winch
from finger_pin.description.signals import SignalSettings
from finger_pin.description.tree_actuators import drivers
from finger_pin.description.validation import problem, suggestion


def with_winches(finger: FingerDescription, tendons: Sequence[str]) -> FingerDescription:
    """Return a finger with an ideal winch at those of some tendons that have neither a winch nor a motor.

    Tendons of a tree that nothing drives are among them.
    """
    driven = {tendon for each in finger.actuators.values() for tendon in each.tendons}
    tree, pulled = finger.tree, {*finger.tendons, *(each.along for each in finger.tendons.values())}
    pulled |= {name for name in tree.tendons if drivers(tree.actuators, "tendon", name)}
    added = {name: Tendon(along=name, winch=Winch()) for name in tree.tendons if name in tendons and name not in pulled}
    added |= {
        name: tendon.updated(winch=Winch())
        for name, tendon in finger.tendons.items()
        if name in tendons and name not in driven and tendon.kind == "actuated" and tendon.winch is None
    }
    return finger.updated(tendons={**finger.tendons, **added}) if added else finger


def hand_with_winches(hand: HandSettings, tendons: Mapping[str, Collection[str]]) -> HandSettings:
    """Return a hand with ideal winches at some tendons, by finger, that no motor pulls."""
    fingers = {}
    for name, placed in hand.fingers.items():
        wound = tuple(each.removeprefix(f"{name}.") for each in tendons[name])
        finger = with_winches(placed.finger, wound)
        fingers[name] = placed if finger is placed.finger else placed.updated(finger=finger)
    changed = any(fingers[name] is not placed for name, placed in hand.fingers.items())
    return hand.updated(fingers=fingers) if changed else hand


def check_winding(
    finger: FingerDescription,
    angles: Collection[str],
    lengths: Collection[str],
    voltages: Mapping[str, SignalSettings],
    kind: str,
) -> None:
    """Raise the error of a command, by motor or tendon, that does not fit the finger, another one or the controller."""
    motors, names = finger.actuators, finger.actuated_names
    winder = {tendon: motor for motor, each in motors.items() for tendon in each.tendons}
    wound: dict[str, str] = {}
    for table, commanded in (("spool_angle", angles), ("motor_voltage", voltages)):
        for name in commanded:
            entry = f"controller.{table}.{name}"
            instead = f"controller.tendon_winding.{name}" if name in names else ""
            _check_name(entry, name, "motor", tuple(motors), instead)
            _check_drive(entry, name, finger)
            if name in wound:
                raise problem(entry, f"has two sources: {wound[name]} turns the same spool; leave one out")
            wound[name] = entry
    for name, signal in voltages.items():
        supply = motors[name].motor.voltage
        if signal.greatest > supply:
            allowed = f"reaches {signal.greatest:.4g} V, beyond the supply of finger.actuators.{name}.motor.voltage"
            raise problem(f"controller.motor_voltage.{name}", allowed, supply)
    for name in lengths:
        entry = f"controller.tendon_winding.{name}"
        instead = f"controller.spool_angle.{name}" if name in motors else ""
        for servo in drivers(finger.tree.actuators, "tendon", name):
            instead = f"the input of its actuator, controller.inputs.{servo}"
        _check_name(entry, name, "actuated tendon", names, instead)
        if name in winder:
            motor = winder[name]
            _check_drive(entry, motor, finger)
            if motor in wound:
                raise problem(entry, f"has two sources: {wound[motor]} turns the same spool; leave one out")
            wound[motor] = entry
    winched = [name for name, tendon in finger.tendons.items() if tendon.winch is not None]
    if winched and kind == "proportional":
        allowed = f'must be "tensions": ideal winches wind {", ".join(winched)} in open loop'
        raise problem("controller.kind", allowed, kind)


def check_supplies(
    finger: FingerDescription, supplies: Mapping[str, SignalSettings], voltages: Collection[str]
) -> None:
    """Raise the error of a supply over time that no loop has, or that its motor cannot bear."""
    for name, signal in supplies.items():
        entry, motors = f"controller.supply_voltage.{name}", finger.actuators
        _check_name(entry, name, "motor", tuple(motors), "")
        _check_drive(entry, name, finger)
        if name in voltages:
            raise problem(entry, f"has no effect: controller.motor_voltage.{name} is in place of the loop")
        low, high, most = signal.lowest, signal.highest, motors[name].motor.voltage
        if low < 0.0 or high > most:
            reach = f"reaches from {low:.4g} to {high:.4g} V"
            raise problem(entry, f"{reach}, beyond 0 V to finger.actuators.{name}.motor.voltage", most)


def check_sources(finger: FingerDescription, tensions: Iterable[str]) -> None:
    """Raise the error of a tendon that is given tensions while a motor or a winch holds its length."""
    holding = {
        tendon: (f"finger.actuators.{name} holds the angle of its spool", f"controller.spool_angle.{name} (rad) or ")
        for name, each in finger.actuators.items()
        if each.drive == "position"
        for tendon in each.tendons
    }
    winched = {name: ("a winch holds its length", "") for name, each in finger.tendons.items() if each.winch}
    for tendon in tensions:
        if tendon in (by := holding | winched):
            reason, angle = by[tendon]
            allowed = f"has two sources: {reason}; wind it by {angle}controller.tendon_winding.{tendon} (m)"
            raise problem(f"controller.tensions.{tendon}", allowed)


def _check_name(entry: str, name: str, kind: str, names: tuple[str, ...], instead: str) -> None:
    if name not in names:
        hint = f"; give {instead}" if instead else suggestion(name, names)
        raise problem(entry, f"no such {kind}; there are {', '.join(names) or 'none'}{hint}")


def _check_drive(entry: str, motor: str, finger: FingerDescription) -> None:
    if finger.actuators[motor].drive != "position":
        raise problem(entry, f'finger.actuators.{motor} must have drive = "position" for that')
