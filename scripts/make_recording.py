"""Writes the recordings of benches that are made up; the numbers that they hide stand in the benches."""

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
from intervals import Made, motion
from scipy.integrate import solve_ivp

COULOMB, DRAG, DELAY, TURN = 0.12, 0.4, 0.03, np.pi / 2.0
# Of the pressing finger: least and greatest tensions, N, and where its joints start, rad.
RAMPS, POSTURE = ((3.0, 9.0), (1.3, 3.2), (1.0, 1.0)), (0.7, 0.2)
# Of a finger of three joints: what its cord turns them with, m, and their springs, N m/rad.
ARMS, SPRINGS = np.array([0.010, 0.008, 0.006]), np.array([0.08, 0.05, 0.03])


def to_and_fro() -> Made:
    """Return four seconds of a tendon that is drawn through a quarter turn."""
    found = motion(np.random.default_rng(23), COULOMB, DRAG, DELAY, TURN)
    return dict(zip(["time_s", "force_in_N", "force_out_N", "angle_rad"], found.values(), strict=True))


def weights() -> Made:
    """Return readings of a servo that lifts weights and lets them down, by its torque balance written out."""
    radius, gravity, constant, dry, viscous, lifting, lowering = 0.008, 9.80665, 0.37, 0.012, 4.6e-3, 0.22, 0.08
    weight, speed, way = (
        each.ravel()
        for each in np.meshgrid([0.2, 0.5, 0.8, 1.1, 1.4, 1.7], [1.0, 1.0, 1.0, 3.0, 3.0, 3.0], [1.0, -1.0])
    )
    load = radius * gravity * weight
    lost = dry + viscous * speed + np.where(way > 0.0, lifting, lowering) * load
    current = (load + way * lost) / constant + np.random.default_rng(29).normal(0.0, 4e-3, load.size)
    return {"weight_kg": weight, "spool_speed_rad_s": way * speed, "current_A": current}


def winding() -> Made:
    """Return four seconds of a servo, its current led to and fro, that winds a tendon against a spring."""
    spool, drum, constant, inertia, spring = 0.008, 0.02, 0.37, 1.895e-3, 0.4
    arm, bearing, tendon, damping = 0.02 * (0.04**2 / 3.0 + 0.01**2 / 4.0), 2e-3, 3e4, 10.0
    dry, viscous, winding_in, paying_out, bristles = 0.012, 4.6e-3, 0.22, 0.08, 50.0
    time = np.arange(0.0, 4.0, 0.01)

    def current(at: Any) -> Any:
        return 0.15 - 0.15 * np.cos(2.0 * np.pi * at * np.where(at < 2.0, 0.5, 1.0))

    def rate(at: float, state: np.ndarray) -> list[float]:
        angle, speed, turned, turning, friction = state
        stretch, stretching = spool * angle - drum * turned, spool * speed - drum * turning
        pull = max(tendon * stretch + damping * stretching, 0.0)
        level = dry + (winding_in if speed > 0.0 else paying_out) * spool * pull
        torque = constant * current(at)
        return [
            speed,
            (torque - friction - viscous * speed - spool * pull) / inertia,
            turning,
            (drum * pull - spring * turned - bearing * turning) / arm,
            bristles * (speed - friction * abs(speed) / level),
        ]

    found = solve_ivp(rate, (0.0, time[-1]), np.zeros(5), "Radau", time, rtol=1e-8, atol=1e-10, max_step=0.01)
    step, noise = 2.0 * np.pi / 4096, np.random.default_rng(31).normal(0.0, 1e-3, time.size)
    return {"time_s": time, "current_A": current(time), "angle_rad": step * np.round((found.y[0] + noise) / step) + 0.0}


def pressing() -> Made:
    """Return six seconds of a planar finger of two links whose pad rests against a load cell, its tendons ramped."""
    lengths, masses, pad, reach = (0.045, 0.032), (0.0101, 0.0056), 0.0075, 0.032 - 0.0075
    inertias = [
        m * (length**2 / 12.0 + (w / 2.0) ** 2 / 4.0)
        for m, length, w in zip(masses, lengths, (0.017, 0.015), strict=True)
    ]
    arms = np.array([[0.006, 0.0], [0.002, 0.0055], [-0.008, -0.0055]])
    turns, bends = np.array([0.3, 0.4, 0.4]), np.array([0.0, 1.0, 1.0])
    coulomb, bristles, viscous, bearing, gravity = 0.14, 5e4, 1.0, 1e-3, 9.81
    height, stiffness, damping, sticking, sideways, lag = 0.055, 1e3, 2.0, 0.8, 7e3, 1e-3

    def tension(time: Any) -> Any:
        return np.stack([np.interp(time, [1.0, 3.0, 4.0, 6.0], [low, high, high, low]) for low, high in RAMPS])

    def pushed(state: np.ndarray) -> tuple[float, float, np.ndarray, float]:
        """Return the forces along and across the cell, the lever arms of both, and how fast the pad's bristle bends."""
        angle, rate, bend = state[:2], state[2:4], state[7]
        sines, cosines = np.sin(np.cumsum(angle)), np.cos(np.cumsum(angle))
        depth = lengths[0] * sines[0] + reach * sines[1] + pad - height
        lever = pad - depth / 2.0
        across = np.array([lengths[0] * cosines[0] + reach * cosines[1], reach * cosines[1]])
        along = -np.array([lengths[0] * sines[0] + reach * sines[1] + lever, reach * sines[1] + lever])
        normal = max(stiffness * max(depth, 0.0) * (1.0 + damping * across @ rate), 0.0)
        wanted = bend + lag * along @ rate
        share = min(1.0, sticking * normal / max(sideways * abs(wanted), 1e-12))
        return share * sideways * wanted, normal, np.stack([along, across]), (share * wanted - bend) / lag

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        angle, speed, friction = state[:2], state[2:4], state[4:7]
        given, sliding = tension(time), arms @ speed
        delivered = np.maximum(given - friction - viscous * sliding, 0.0)
        share = np.tanh(coulomb * (turns + bends * angle[0]) / 2.0)
        level = np.maximum(share * (given + np.maximum(given - friction, 0.0)), 1e-4)
        side, normal, levers, bending = pushed(state)
        first, second = masses[0], masses[1]
        near, far, turned = lengths[0] / 2.0, lengths[1] / 2.0, lengths[0] * lengths[1] / 2.0 * second
        own, joined = inertias[1] + second * far**2, turned * np.cos(angle[1])
        mass = np.array([[inertias[0] + first * near**2 + second * lengths[0] ** 2, 0.0], [0.0, 0.0]]) + own
        mass += joined * np.array([[2.0, 1.0], [1.0, 0.0]])
        swing = turned * np.sin(angle[1]) * np.array([-speed[1] * (2.0 * speed[0] + speed[1]), speed[0] ** 2])
        tip = second * far * np.cos(angle[0] + angle[1])
        weight = gravity * np.array([(first * near + second * lengths[0]) * np.cos(angle[0]) + tip, tip])
        torque = arms.T @ delivered - bearing * speed - swing - weight - levers.T @ np.array([side, normal])
        bristle = bristles * (sliding - friction * np.abs(sliding) / level)
        return np.concatenate([speed, np.linalg.solve(mass, torque), bristle, [bending]])

    time, start = np.arange(0.0, 6.5, 0.02), np.array([*POSTURE, *np.zeros(6)])
    found = solve_ivp(rate, (0.0, time[-1]), start, "Radau", time, rtol=1e-7, atol=1e-10, max_step=0.02)
    force = np.array([pushed(state)[1] for state in found.y.T])
    noise = np.random.default_rng(37).normal(0.0, 4e-3, time.size)
    pulls = dict(zip(["proximal_N", "distal_N", "extensor_N"], tension(time), strict=True))
    return {"time_s": time, **pulls, "cell_N": force + 0.05 + noise}


def postures() -> Made:
    """Return angles of three joints under hanging weights, shaken until nothing holds their springs: k theta = r T."""
    pull = np.repeat([1.0, 2.0, 3.0, 4.0, 5.0], 3)
    angle = pull[:, None] * ARMS / SPRINGS + np.random.default_rng(41).normal(0.0, np.deg2rad(0.7), (pull.size, 3))
    read = dict(zip(("mcp_deg", "pip_deg", "dip_deg"), np.rad2deg(angle).T, strict=True))
    return {"weight_kg": pull / 9.80665, **read}


def spool_finger() -> Made:
    """Return three joints on springs whose cord a spool winds in and lets out, twice, filmed at 25 Hz.

    Inertia is left out: at these speeds it takes 1e-4 of what the springs do. The cord rubs where it bends.
    """
    spool, cord, coulomb, bristles, damping = 0.008, 2e4, 0.18, 5e4 / 3.0, np.array([2e-3, 1e-3, 5e-4])
    time = np.arange(0.0, 6.0, 0.04)

    def turned(at: Any) -> Any:
        return 1.4 - 1.4 * np.cos(2.0 * np.pi * np.asarray(at) / 3.0)

    def rate(at: float, state: np.ndarray) -> np.ndarray:
        angle, friction = state[:3], state[3:]
        arriving = [max(cord * (spool * float(turned(at)) - ARMS @ angle), 0.0)]
        for held in friction:
            arriving.append(max(arriving[-1] - held, 0.0))
        before, behind = np.array(arriving[:-1]), np.array(arriving[1:])
        speed = (ARMS * behind - SPRINGS * angle) / damping
        sliding = np.cumsum((ARMS * speed)[::-1])[::-1]
        level = np.maximum(np.tanh(0.5 * coulomb * np.abs(angle)) * (before + behind), 1e-4)
        return np.concatenate([speed, bristles * (sliding - friction * np.abs(sliding) / level)])

    found = solve_ivp(rate, (0.0, time[-1]), np.zeros(6), "Radau", time, rtol=1e-7, atol=1e-9, max_step=0.02)
    rng, rows = np.random.default_rng(43), []
    for run in ("first", "second"):
        angle = np.rad2deg(found.y[:3] + rng.normal(0.0, 8e-3, (3, time.size)))
        read = dict(zip(("mcp_deg", "pip_deg", "dip_deg"), angle, strict=True))
        rows.append({"run": np.full(time.size, run), "time_s": time, "spool_rad": turned(time), **read})
    return {name: np.concatenate([each[name] for each in rows]) for name in rows[0]}


MADE = {
    "to_and_fro": to_and_fro,
    "weights": weights,
    "winding": winding,
    "pressing": pressing,
    "postures": postures,
    "spool_finger": spool_finger,
}


def main(arguments: list[str] | None = None) -> int:
    """Write the CSV file that is named, the recording of the bench that has its name."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help=f"{', '.join(MADE)}, with .csv")
    path = parser.parse_args(arguments).file
    if path.stem not in MADE or path.suffix != ".csv":
        parser.error(f"FILE: {path}: must be one of {', '.join(MADE)}, with .csv")
    found = MADE[path.stem]()
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(found)
        rows = zip(*found.values(), strict=True)
        writer.writerows([[v if isinstance(v, str) else f"{v:.4f}" for v in row] for row in rows])
    return 0


if __name__ == "__main__":
    sys.exit(main())
