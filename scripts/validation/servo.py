"""A servo that ships against recordings of a real one, which swings a weight under its own position loop.

The load of gears that count the torques of motor and tendons alike is N = |T + tau|: twice what they hold. The same
equations, written out and stepped apart from the package, stand beside ours, with that load and with |T - tau|.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import finger_pin as fp
from finger_pin.description.actuators import PositionLoop
from finger_pin.typing import Array
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, new_figure, styled
from validation.check import Check, Picture, Section, compare

TITLE = "An XL330 that swings a weight, against recordings"
SOURCE = "Rhoban, 12 recordings"
#: Of the bench, kg and m; and by how much its zero is off in the fit that the numbers of the motor are of, rad.
MASS, LENGTH, ZERO, GRAVITY = 0.49, 0.1, 0.02807, 9.80665
#: The published fit M4 as it ships: K_t, R, J, c0, m0, m1, w, p, b.
FIT = (0.3862, 3.403, 1.895e-3, 8.76e-3, 0.0680, 0.0738, 2.558, 0.76, 4.62e-3)
#: U / V over the error at a gain of 1 in the servo's register, 1/rad: 4096 steps a turn, 885 for all of the voltage.
STEPS = 4096.0 / (2.0 * np.pi) / 885.0
DIVISOR = 256.0
_SPOOL, _STEP = 0.01, 5e-4
#: Bristles give by level / sigma_0 = 0.15 N m / 50 N m/rad either way, gears of the equations do not, rad.
GIVING = 6e-3


@dataclass(frozen=True, eq=False)
class Recording:
    """One motion of the bench.

    Attributes:
        name: Which motion, and the gain in the servo's register.
        gain: That gain.
        supply: Its mean voltage, V.
        time: Shape (m,), s.
        goal: Shape (m,), rad.
        position: Shape (m,), rad; hanging down is zero.
        share: Of the voltage that was applied, shape (m,).
    """

    name: str
    gain: float
    supply: float
    time: Array
    goal: Array
    position: Array
    share: Array

    def error(self, position: Array) -> float:
        """Return the root mean square by which a motion misses what was recorded, rad."""
        return float(np.sqrt(np.mean((position - self.position) ** 2)))


@cache
def recordings() -> tuple[Recording, ...]:
    """Return all of them."""
    with resources.as_file(resources.files("finger_pin.description") / "benches" / "servo_pendulum.csv") as path:
        table = pd.read_csv(path, comment="#")
    found = []
    for name, every in table.groupby("recording", sort=False):
        rows = every.iloc[::2]
        columns = (rows[each].to_numpy(dtype=float) for each in ("time_s", "goal_rad", "position_rad", "pwm_885"))
        time, goal, position, pwm = columns
        gain, supply = float(str(name).split("kp")[1]), float(rows["supply_V"].mean())
        found.append(Recording(str(name), gain, supply, time - time[0], goal, position, pwm / 885.0))
    return tuple(found)


def simulated(recording: Recording) -> Array:
    """Return the angle of a joint without friction that the servo turns by two stiff tendons, shape (m,), rad."""
    shipped = fp.load_scenario("servo_bench").finger.actuators["M1"].motor
    most = recording.supply / shipped.constants[1]
    servo = {
        "motor": shipped.updated(voltage=recording.supply, maximum_current=most).model_dump(exclude_none=True),
        "tendons": ["up", "down"],
        "spool_radius": _SPOOL,
        "drive": "position",
        "position_loop": {"proportional": recording.gain * STEPS / DIVISOR},
        "tendon_rigidity": 3e5,
        "tendon_damping": 200.0,
        # What the weight needs on this spool is at most 50 N: neither goes slack.
        "pretension": 150.0,
    }
    link = {"length": LENGTH, "width": 1e-3, "mass": MASS, "centre_of_mass": LENGTH, "transverse_inertia": 1e-7}
    radii = {"up": _SPOOL, "down": -_SPOOL}
    finger = {
        "name": "pendulum",
        "gravity": [GRAVITY * np.cos(ZERO), -GRAVITY * np.sin(ZERO), 0.0],
        "joints": {"pivot": {"range": [-6.0, 6.0], "link": link}},
        "tendons": {
            name: {"curvature_offset": 0.0, "crossings": {"pivot": {"radius": radius}}}
            for name, radius in radii.items()
        },
        "tendon_friction": {"coulomb": 0.0, "viscous": 0.0, "floor": 1e-9},
        "joint_friction": {"coulomb": 0.0, "viscous": 0.0, "stiction": 0.0, "floor": 1e-9},
        "actuators": {"servo": servo},
    }
    settings = {
        "duration": float(recording.time[-1]),
        "sample_rate": 200.0,
        "initial": {"position": {"pivot": float(recording.position[0])}},
    }
    scenario = fp.Scenario.model_validate({"name": "pendulum", "finger": finger, "simulation": settings})
    result = fp.simulate(scenario, reference=(recording.time, recording.goal[:, None]))
    return np.interp(recording.time, result.time.values, result.joint_position.values[:, 0])


def written_out(side: float) -> list[Array]:
    """Return the angles of all recordings by the published equations, N = |side T + tau|, each of shape (m,), rad.

    Friction stops a motion within a step, or takes all of its level.
    """
    constant, resistance, inertia, base, by_load, more_by_load, velocity, exponent, viscous = FIT
    every = recordings()
    gain = np.array([each.gain for each in every]) * STEPS / DIVISOR
    supply = np.array([each.supply for each in every])
    times = np.arange(0.0, max(each.time[-1] for each in every), _STEP)
    goals = np.array([np.interp(times, each.time, each.goal) for each in every]).T
    angle, speed = np.array([each.position[0] for each in every]), np.zeros(len(every))
    whole, angles = inertia + MASS * LENGTH**2, np.empty(goals.shape)
    for k, goal in enumerate(goals):
        angles[k] = angle
        voltage = supply * np.clip(gain * (goal - angle), -1.0, 1.0)
        torque = constant * (voltage - constant * speed) / resistance
        load = MASS * GRAVITY * LENGTH * np.sin(angle + ZERO)
        carried = np.abs(side * load + torque)
        level = base + carried * (by_load + more_by_load * np.exp(-(np.abs(speed / velocity) ** exponent)))
        stopping = whole / _STEP * speed + torque - load
        most = level + viscous * np.abs(speed)
        taken = np.clip(stopping, -most, most)
        speed = speed + _STEP / whole * (torque - load - taken)
        angle = angle + _STEP * speed
    return [np.interp(each.time, times, angles[:, k]) for k, each in enumerate(every)]


def measured_gain() -> float:
    """Return the voltage's share over the error at the gain that the servo ships with, 400, 1/rad.

    Of the slow motions, where the short time between what is told of the goal and of the voltage counts least.
    """
    slow = [each for each in recordings() if not each.name.startswith("st")]
    asked = np.concatenate([each.gain / 400.0 * (each.goal - each.position) for each in slow])
    share = np.concatenate([each.share for each in slow])
    within = np.abs(share) < 0.99
    return float(asked[within] @ share[within] / (asked[within] @ asked[within]))


@dataclass(frozen=True, eq=False)
class Swings:
    """The errors of all recordings, shape (12,), rad: ours, and of the equations with the sum and the difference."""

    ours: Array
    added: Array
    subtracted: Array


def swing() -> Swings:
    """Swing the weight in all the ways."""
    every = recordings()
    moved = ([simulated(each) for each in every], written_out(1.0), written_out(-1.0))
    errors = [np.array([a.error(b) for a, b in zip(every, angles, strict=True)]) for angles in moved]
    return Swings(*errors)


def measure() -> Section:
    """Compare the motions, and the gain, with what was recorded."""
    every, found, checks = recordings(), swing(), list[Check]()
    for recording, ours, added in zip(every, found.ours, found.added, strict=True):
        what = f"rms by which {recording.name} is missed, and by the published equations"
        checks.append(compare(what, SOURCE, ours, GIVING, "rad", expected=added))
    ours, other = (float(np.sqrt(np.mean(each**2))) for each in (found.ours, found.subtracted))
    what = "rms of all over that of the equations with N = |T - tau|"
    checks.append(compare(what, SOURCE, ours / other, 0.9, "1", note="At most 0.9: the sum is what gears carry."))
    gain = PositionLoop().proportional
    what = "gain of a position loop as it ships"
    checks.append(compare(what, SOURCE, gain, 0.01, "1/rad", expected=measured_gain()))
    caption = "What was recorded, ours, and the equations with N = |T - tau|, which would let the weight down too far."
    return Section.of(checks, Picture(plot(every[:2]), caption))


@styled
def plot(shown: tuple[Recording, ...]) -> Figure:
    """Draw the first recordings and what simulations make of them."""
    figure = new_figure(9.5, 3.2, "constrained")
    for axes, recording, other in zip(figure.subplots(1, len(shown)), shown, written_out(-1.0), strict=False):
        axes.plot(recording.time, recording.position, color=BLACK, label="recorded")
        axes.plot(recording.time, simulated(recording), color=BLUE, label="finger_pin")
        axes.plot(recording.time, other, color=VERMILLION, linestyle="--", label=r"$N = |T - \tau|$")
        axes.set(xlabel="time (s)", ylabel="angle (rad)", title=recording.name)
    axes.legend()
    return figure
