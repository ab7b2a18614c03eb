"""Closed solutions of special fingers: friction of a sliding tendon, and free motions of the links."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import ellipj, ellipk

from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.finger_description import FingerDescription
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulator import Simulator
from finger_pin.typing import Array
from finger_pin.views.plots.style import BLACK, BLUE, GREY, new_figure, styled
from validation.check import Check, Comparison, Picture, Section, compare

TITLE = "Closed forms"
FRICTIONLESS: dict[str, Any] = {
    "tendon_friction": {"coulomb": 0.0, "viscous": 0.0, "floor": 1e-12, "stiffness": 1e-6},
    "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0, "floor": 1e-15, "stiffness": 1e-12},
}
RADIUS, LENGTH, MASS, WIDTH = 8e-3, 0.05, 0.02, 0.01
#: Sliding friction alone: mu_e = 0.3 on a path that turns by 1.3 rad, under a command of 5 N.
SURFACE, CURVATURE, COMMAND = 0.3, 1.3, 5.0
SLIDING: dict[str, Any] = {"coulomb": SURFACE, "stiction_ratio": 1.0, "viscous": 0.0}


def make(joints: Mapping[str, float], tendons: Mapping[str, Mapping[str, float]], **sections: Any) -> Finger:
    """Return a planar finger: every joint turns about z, y is up, wide ranges.

    Args:
        joints: Length of the link after every joint, m.
        tendons: Radii by joint, m, by tendon.
        sections: Further sections of the description.
    """
    described = {
        "name": "planar",
        "gravity": [0.0, -9.81, 0.0],
        "joints": {
            name: {"range": [-12.0, 12.0], "link": {"length": length, "width": WIDTH, "mass": MASS}}
            for name, length in joints.items()
        },
        "tendons": {
            name: {
                "curvature_offset": CURVATURE,
                "crossings": {joint: {"radius": radius} for joint, radius in each.items()},
            }
            for name, each in tendons.items()
        },
    }
    return Finger(FingerDescription.model_validate(described | sections))


def one_joint(**sections: Any) -> Finger:
    """Return a finger of one joint with a flexor and an extensor."""
    return make({"j": LENGTH}, {"F": {"j": RADIUS}, "E": {"j": -RADIUS}}, **sections)


@dataclass(frozen=True, eq=False)
class Slide:
    """The first tendon while it slides at a constant velocity.

    Attributes:
        travel: Shape (m,), m.
        stiction: F^s, shape (m,), N.
        tension: Delivered at the end, N.
    """

    travel: Array
    stiction: Array
    tension: float


def slide(finger: Finger, velocity: float, travel: float = 2e-3, stiction: float = 0.0) -> Slide:
    """Let the first tendon slide under the command, by the compiled rates; the classic method of order 4."""
    core, steps = CompiledFinger(finger), 700
    x = finger.rest_state(np.zeros(1))
    x[1], x[2] = velocity / RADIUS, stiction
    tension = np.array([COMMAND, COMMAND])
    h = travel / abs(velocity) / steps
    record = []
    for _ in range(steps):
        slopes: list[float] = []
        for share in (0.0, 0.5, 0.5, 1.0):
            at = x.copy()
            at[2] += share * h * (slopes[-1] if slopes else 0.0)
            slopes.append(float(core.evaluate(at, tension).rate[2]))
        x[2] += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
        record.append(x[2])
    delivered = float(core.evaluate(x, tension).strands[0])
    return Slide(np.arange(1, steps + 1, dtype=np.float64) * velocity * h, np.array(record), delivered)


def capstan_tension(velocity: float) -> float:
    """Return f exp(-mu_e phi) where the tendon is pulled in, f exp(mu_e phi) where it is let out, N."""
    return COMMAND * math.exp(-math.copysign(SURFACE * CURVATURE, velocity))


def hysteresis() -> tuple[Slide, Slide]:
    """Pull a tendon in and let it out again under a constant command."""
    finger = one_joint(tendon_friction=SLIDING)
    pulled = slide(finger, 1e-3)
    return pulled, slide(finger, -1e-3, stiction=float(pulled.stiction[-1]))


def friction_coefficient(ratio: float, velocity: float) -> float:
    """Return the friction of steady sliding over its normal force, with a stiction ratio rho."""
    law = {"coulomb": SURFACE, "stiction_ratio": ratio, "viscous": 0.0}
    tension = slide(one_joint(tendon_friction=law), velocity).tension
    return (COMMAND - tension) / (COMMAND + tension)


def pendulum() -> tuple[float, float]:
    """Return moment of inertia about the joint, kg m2, and m g c, N m, of the link as a solid cylinder."""
    inertia = MASS * (WIDTH**2 / 16.0 + LENGTH**2 / 12.0) + MASS * (LENGTH / 2.0) ** 2
    return inertia, MASS * 9.81 * LENGTH / 2.0


def hanging_angle(finger: Finger) -> float:
    """Return the angle of the first joint, rad, at which a straight finger hangs: where gravity's torque is zero."""
    straight = np.zeros(len(finger.routing.joints))
    return -math.copysign(math.pi / 2.0, finger.rigid_body.gravity_torque(straight)[0])


def swing(amplitude: float, shares: Array) -> Comparison:
    """Swing a finger with loose tendons; at shares of its period it is where the pendulum is, exactly.

    sin(psi / 2) = k cd(omega t, k), with k = sin(amplitude / 2).
    """
    finger = one_joint(**FRICTIONLESS)
    inertia, moment = pendulum()
    hanging = hanging_angle(finger)
    sim = Simulator(finger, [hanging + amplitude], rtol=1e-9, atol_scale=1e-9, method="Rodas5P")
    omega, k = math.sqrt(moment / inertia), math.sin(amplitude / 2.0)
    period = 4.0 * ellipk(k * k) / omega
    measured, expected = [], []
    for share in shares:
        state = sim.step(np.zeros(2), float(share) * period - sim.time)
        _, cn, dn, _ = ellipj(omega * sim.time, k * k)
        measured.append(state.position[0] - hanging)
        expected.append(2.0 * math.asin(k * cn / dn))
    return Comparison(np.array(measured), np.array(expected))


def chain_modes() -> list[tuple[float, Comparison]]:
    """Return the frequency of every mode, Hz, of three hanging links, and small oscillations in it, rad.

    M and K are written down independently. Absolute angles psi_i of the links: M_ij from the velocities of the mass
    centres, K = diag(moments of the weights); the joints turn by differences of them.
    """
    lengths, names = [0.05, 0.04, 0.03], ["a", "b", "c"]
    tendons = {"F": {n: RADIUS for n in names}, "E": {n: -RADIUS for n in names}}
    finger = make(dict(zip(names, lengths, strict=True)), tendons, **FRICTIONLESS)
    mass, stiffness = np.zeros((3, 3)), np.zeros((3, 3))
    for i, length in enumerate(lengths):
        arm = np.array([*lengths[:i], length / 2.0, *np.zeros(2 - i)])
        mass += MASS * np.outer(arm, arm)
        mass[i, i] += MASS * (WIDTH**2 / 16.0 + length**2 / 12.0)
        stiffness += MASS * 9.81 * np.diag(arm)
    squares, modes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    relative = np.array([[1.0, 0, 0], [-1.0, 1.0, 0], [0, -1.0, 1.0]])
    hanging = np.array([hanging_angle(finger), 0.0, 0.0])
    found = []
    for square, mode in sorted(zip(squares, modes.T, strict=True), key=lambda pair: pair[0]):
        shape = relative @ mode
        start = 1e-4 * shape / np.max(np.abs(shape))
        sim = Simulator(finger, hanging + start, rtol=1e-8, atol_scale=1e-11, method="Rodas5P")
        omega = math.sqrt(square)
        measured, expected = [], []
        for turn in (0.3, 0.5, 1.0, 2.0):
            state = sim.step(np.zeros(2), 2.0 * math.pi * turn / omega - sim.time)
            measured.append(state.position - hanging)
            expected.append(start * math.cos(omega * sim.time))
        found.append((omega / (2.0 * math.pi), Comparison(np.array(measured), np.array(expected))))
    return found


def bristle_oscillation() -> Comparison:
    """Let a sticking joint swing on its bristles without gravity; angles over the undamped amplitude.

    I theta'' + sigma_1 theta' + sigma_0 theta = 0, exactly to first order in theta.
    """
    micro, stiffness, speed = 2e-5, 0.5, 1e-3
    joint = {
        "coulomb": 0.05,
        "stiction": 0.05,
        "viscous": 0.0,
        "stiffness": stiffness,
        "micro_damping": micro,
        "floor": 1e3,
    }
    finger = one_joint(**FRICTIONLESS | {"joint_friction": joint, "gravity": [0.0, 0.0, 0.0]})
    inertia, _ = pendulum()
    sim = Simulator(finger, [0.0], rtol=1e-9, atol_scale=1e-12, method="Rodas5P")
    x = sim.x
    x[1] = speed
    sim.x = x
    decay = micro / (2.0 * inertia)
    omega = math.sqrt(stiffness / inertia - decay**2)
    measured, expected = [], []
    for turn in (0.2, 0.5, 0.9, 3.1):
        state = sim.step(np.zeros(2), 2.0 * math.pi * turn / omega - sim.time)
        measured.append(state.position[0] * omega / speed)
        expected.append(math.exp(-decay * sim.time) * math.sin(omega * sim.time))
    return Comparison(np.array(measured), np.array(expected))


def measure() -> Section:
    """Compare friction and free motions with their closed forms."""
    checks: list[Check] = []
    pulled, released = hysteresis()
    for name, run, velocity in (("pulled in", pulled, 1e-3), ("let out", released, -1e-3)):
        expected = capstan_tension(velocity)
        what = f"tension of a tendon that is {name}"
        checks.append(compare(what, "capstan law", run.tension, 1e-9 * expected, "N", expected=expected))
    width = 2.0 * COMMAND * math.sinh(SURFACE * CURVATURE)
    gap = released.tension - pulled.tension
    checks.append(compare("width of the hysteresis loop", "2 f sinh(mu_e phi)", gap, 1e-8, "N", expected=width))
    for ratio in (1.5, 2.0):
        found = friction_coefficient(ratio, 1e-9) / friction_coefficient(ratio, 1.0)
        what = f"break-away over sliding friction, rho = {ratio:g}"
        checks.append(compare(what, "stiction ratio rho", found, 1e-6 * ratio, "1", expected=ratio))
    for amplitude in (0.1, 1.0, 2.5):
        found = swing(amplitude, np.array([0.1, 0.25, 0.4, 0.5, 1.0, 3.0, 10.0])).largest
        what = f"swing of {amplitude:g} rad, ten periods"
        checks.append(compare(what, "pendulum, Jacobi's elliptic functions", found, 2e-6 * amplitude, "rad"))
    for frequency, motion in chain_modes():
        what = f"three hanging links in their mode of {frequency:.3g} Hz, two periods"
        checks.append(compare(what, "eigenvalues of M and K", motion.largest, 1e-9, "rad"))
    what = "sticking joint on its bristles, three periods, over its amplitude"
    checks.append(compare(what, "damped oscillator", bristle_oscillation().largest, 1e-6, "1"))
    return Section.of(
        checks,
        Picture(
            plot_friction_and_swing(pulled, released),
            "Left: a tendon pulled in and let out again; the dashed lines are the capstan law. "
            "Right: a large swing of one link with loose tendons, on the exact solution.",
        ),
    )


@styled
def plot_friction_and_swing(pulled: Slide, released: Slide) -> Figure:
    """Draw the hysteresis loop of a tendon and the swing of a link."""
    figure = new_figure(9.5, 3.4, "constrained")
    left, right = figure.subplots(1, 2)
    travel = np.concatenate([pulled.travel, pulled.travel[-1] + released.travel])
    friction = np.concatenate([pulled.stiction, released.stiction])
    left.plot(1e3 * travel, COMMAND - friction, color=BLUE)
    for velocity in (1.0, -1.0):
        left.axhline(capstan_tension(velocity), color=GREY, linestyle="--", linewidth=1.0)
    left.set(xlabel="travel of the tendon (mm)", ylabel="delivered tension (N)", title="hysteresis under 5 N")
    shares = np.linspace(0.01, 2.0, 200)
    motion = swing(2.5, shares)
    right.plot(shares, motion.expected, color=BLACK, label="elliptic functions")
    right.plot(shares[::5], motion.measured[::5], "o", color=BLUE, markersize=3.5, label="finger_pin")
    right.set(xlabel="time (periods)", ylabel="angle (rad)", title="swing of 2.5 rad")
    right.set_ylim(top=4.2)
    right.legend(loc="upper right", ncols=2)
    return figure
