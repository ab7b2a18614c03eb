"""Actuators, equalities and keyframes of a tree of bodies, as MJCF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree import Tree
from finger_pin.description.tree_actuators import TreeActuator
from finger_pin.description.tree_couplings import Coupling
from finger_pin.description.tree_parts import Keyframe
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf_compliance import Mobility, soft
from finger_pin.mechanism.xml_numbers import numbers
from finger_pin.typing import Array

# Highest power of a coupling in MJCF.
_MAX_POWER = 4
# Least step for which delayed controls are buffered, s.
_DELAY_STEP = 1e-4
# Greatest tension of an ideal source without a limit, N.
_MAX_TENSION = 1e3


def add_equalities(
    root: ET.Element, description: FingerDescription, bodies: Mapping[str | None, ET.Element], mobility: Mobility
) -> None:
    """Add couplings of joints and tendons, and loops by a site on each body.

    Args:
        root: Of the MJCF.
        description: The finger.
        bodies: Elements by body; that of the world by None.
        mobility: Of its joints, tendons and bodies.
    """
    tree = description.tree
    table = ET.SubElement(root, "equality")
    for name, coupling in tree.couplings.items():
        kind, of_kind = ("joint", mobility.joints) if coupling.joint else ("tendon", mobility.tendons)
        names = [coupling.follower, *([coupling.other] if coupling.other else [])]
        softness = soft(coupling.stiffness, coupling.damping, sum(of_kind[each] for each in names))
        named = {f"{kind}{k + 1}": each for k, each in enumerate(names)}
        polynomial = _polynomial(f"{description.entry('tree.couplings', name)}.powers", coupling, description)
        ET.SubElement(table, kind, {"name": name, **named, "polycoef": numbers(*polynomial), **softness})
    for name, loop in tree.loops.items():
        ends = ((loop.body, loop.position), (loop.other, loop.other_position))
        for k, (body, position) in enumerate(ends, 1):
            ET.SubElement(bodies[body], "site", name=f"{name}_{k}", pos=numbers(*position))
        softness = soft(loop.stiffness, loop.damping, sum(mobility.bodies[body] for body, _ in ends if body))
        ET.SubElement(table, "connect", {"name": name, "site1": f"{name}_1", "site2": f"{name}_2", **softness})


def _polynomial(entry: str, coupling: Coupling, description: FingerDescription) -> list[float]:
    """Return the polynomial of a coupling in MuJoCo's terms: both joints count from their references."""
    absolute = Polynomial([coupling.offset, coupling.slope, *coupling.higher])
    # Lengths of tendons count from their references here as well.
    references = {} if coupling.tendon else {name: each.reference for name, each in description.tree.joints.items()}
    starts = [references.get(end, 0.0) if end else 0.0 for end in (coupling.joint, coupling.other)]
    coefficients = (absolute(Polynomial([starts[1], 1.0])) - starts[0]).coef
    if np.any(coefficients[_MAX_POWER + 1 :]):
        raise InputError(entry, f"is not written: MuJoCo has powers up to {_MAX_POWER}", list(coupling.higher))
    return [*coefficients[: _MAX_POWER + 1].tolist(), *[0.0] * (_MAX_POWER + 1 - len(coefficients))]


def add_actuators(
    root: ET.Element, description: FingerDescription, step: float, bodies: Mapping[str | None, ET.Element]
) -> None:
    """Add the motors of tendons that ideal sources pull, and the actuators of a tree, for a time step, s.

    Bodies are elements by name; that of the world by None.
    """
    table = ET.SubElement(root, "actuator")
    for name, tendon in description.tendons.items():
        entry = description.entry("tendons", name)
        if tendon.kind == "passive" or tendon.winch is not None:
            key = "winch" if tendon.winch else "kind"
            raise InputError(f"{entry}.{key}", "is not written: a tendon beside a tree is pulled by an ideal source")
        limits = {"ctrllimited": "true", "ctrlrange": numbers(0.0, tendon.maximum_tension or _MAX_TENSION)}
        ET.SubElement(table, "motor", {"name": name, "tendon": tendon.along or name, "gear": "-1", **limits})
    for k, (name, actuator) in enumerate(description.tree.actuators.items()):
        entry, attributes = description.entry("tree.actuators", name), {"name": name, "gear": numbers(actuator.gear)}
        attributes |= _at_sites(entry, k, actuator, description.tree, bodies) or dict([actuator.drives])
        attributes |= _limits("ctrl", actuator.input_range) | _limits("force", actuator.force_range)
        if actuator.delay:
            samples = math.ceil(actuator.delay / min(step, _DELAY_STEP)) + 2
            attributes |= {"delay": numbers(actuator.delay), "nsample": str(samples)}
        kind, law = _law(entry, actuator)
        ET.SubElement(table, kind, attributes | law)


def _at_sites(
    entry: str, k: int, actuator: TreeActuator, tree: Tree, bodies: Mapping[str | None, ET.Element]
) -> dict[str, str]:
    """Return what makes the k-th actuator a wrench, with the sites that it acts at; nothing if it is none."""
    if (wrench := actuator.wrench) is None:
        return {}
    site, refsite = f"wrench_{k}", f"wrench_{k}_from"
    ET.SubElement(bodies[wrench.body], "site", name=site, pos=numbers(*wrench.position))
    attributes = {"site": site, "gear": numbers(*(actuator.gear * each for each in (*wrench.force, *wrench.torque)))}
    if wrench.axes == "body":
        return attributes
    if any(wrench.force) and not tree.movers(wrench.other) <= tree.movers(wrench.body):
        allowed = "is not written: MuJoCo lets a force react at refsite, as here where that is on the base or carries"
        raise InputError(f"{entry}.wrench.other", f"{allowed} {wrench.body}", wrench.other)
    ET.SubElement(bodies[wrench.other], "site", name=refsite, pos=numbers(*wrench.other_position))
    return attributes | {"refsite": refsite}


def _limits(prefix: str, ends: Sequence[float] | None) -> dict[str, str]:
    return {f"{prefix}limited": "true", f"{prefix}range": numbers(*ends)} if ends is not None else {}


def _law(entry: str, actuator: TreeActuator) -> tuple[str, dict[str, str]]:
    """Return the element and the law of an actuator."""
    if (muscle := actuator.muscle) is not None:
        shape = {key: numbers(getattr(muscle, key)) for key in ("force", "lmin", "lmax", "vmax", "fpmax", "fvmax")}
        shape |= {"range": numbers(*muscle.range), "lengthrange": numbers(*muscle.length_range)}
        return "muscle", shape | {"timeconst": numbers(*muscle.time_constants), "tausmooth": numbers(muscle.smoothing)}
    if actuator.integral or actuator.slew is not None:
        # MuJoCo's PID knows no other.
        if actuator.by_length != -actuator.gain or actuator.offset or actuator.time_constant:
            allowed = "with integral or slew is written for gain = -by_length, without offset and time_constant"
            raise InputError(entry, allowed)
        pid = {"kp": actuator.gain, "kv": -actuator.by_speed, "ki": actuator.integral, "slewmax": actuator.slew or 0.0}
        if actuator.state_range is not None:
            low, high = actuator.state_range
            if not actuator.integral or low != -high:
                allowed = "is not written: MuJoCo's PID limits the sum of the error alike to both sides"
                raise InputError(f"{entry}.state_range", allowed, [low, high])
            pid["imax"] = high
        return "pid", {key: numbers(value) for key, value in pid.items() if value}
    affine = {"gaintype": "fixed", "gainprm": numbers(actuator.gain), "biastype": "affine"}
    affine["biasprm"] = numbers(actuator.offset, actuator.by_length, actuator.by_speed)
    if actuator.integrates:
        affine["dyntype"] = "integrator"
    elif actuator.time_constant:
        affine |= {"dyntype": "filterexact", "dynprm": numbers(actuator.time_constant)}
    return "general", affine | _limits("act", actuator.state_range)


def add_keyframes(
    root: ET.Element,
    description: FingerDescription,
    posture: Sequence[float] | None,
    body_pose: Callable[[str, Array], pin.SE3],
) -> None:
    """Add the keyframes, or one called start with a posture, shape (n,), rad, on top of the first.

    The place of a body at a posture, shape (n,), is that of mocap bodies.
    """
    tree, table = description.tree, ET.SubElement(root, "keyframe")
    keyframes = dict(tree.keyframes)
    if posture is not None:
        if len(posture) != len(tree.joints):
            raise InputError("posture", f"must be {len(tree.joints)} numbers, one per joint", list(posture))
        first = next(iter(keyframes.values()), Keyframe())
        keyframes = {"start": first.updated(position=dict(zip(tree.joints, map(float, posture), strict=True)))}
    bodies = [*root.iterfind("worldbody//body")]
    for name, keyframe in keyframes.items():
        qpos, qvel, objects = list[float](), list[float](), tree.objects_at(keyframe)
        for body in bodies:
            free_joint = body.find("freejoint") is not None or body.find("joint[@type='free']") is not None
            for joint in () if free_joint else (each.get("name", "") for each in body.findall("joint")):
                qpos.append(keyframe.position.get(joint, tree.joints[joint].reference))
                qvel.append(keyframe.velocity.get(joint, 0.0))
            if free_joint:
                free = objects[body.get("name", "")]
                qpos += [*free.position, *np.roll(free.quaternion, 1).tolist()]
                qvel += [*free.velocity, *free.angular_velocity]
        q = np.array([keyframe.position.get(name, joint.reference) for name, joint in tree.joints.items()])
        mocap_poses = [body_pose(body.get("name", ""), q) for body in bodies if body.get("mocap")]
        actuators = root.findall("actuator/*")
        ctrl = list[float]()
        for element in actuators:
            # The second control of pid is a speed.
            ctrl += [keyframe.inputs.get(element.get("name", ""), 0.0), *[0.0] * (element.tag == "pid")]
        states = {"qpos": numbers(*qpos), "qvel": numbers(*qvel)} | ({"ctrl": numbers(*ctrl)} if actuators else {})
        if mocap_poses:
            states["mpos"] = numbers(*np.concatenate([each.translation for each in mocap_poses]))
            turns = [np.roll(pin.Quaternion(each.rotation).coeffs(), 1) for each in mocap_poses]
            states["mquat"] = numbers(*np.concatenate(turns))
        ET.SubElement(table, "key", {"name": name, **states})
