"""Coverage of 95 % intervals: identification of made-up recordings, whose numbers are known.

Steady readings come from the capstan law with a drag, with a wrong zero of the load cell and noise. Motions come from
the same canal on a drum with a spring, integrated by scipy: bristles of the tendon, a load cell that tells late, and
noise of which neighbours err alike. Both are written out here. How often the model is said to miss something is printed
too: of two runs of each motion under the same pull, fitted with all that they were made with, and without the drag.
"""

import argparse
import sys
from collections.abc import Callable

import numpy as np
import scipy

import finger_pin as fp

COULOMB, DRAG = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag"
OFFSET, DELAY = (f"recordings.*.tendon_tension.T1.{what}" for what in ("offset", "delay"))
TURN, NOISE = 2.5, 0.08
STEADY = {
    "kind": "steady",
    "speed": {"column": "way", "scale": 0.05},
    "inputs": {"tendon_command.T1": "in"},
    "outputs": {"tendon_tension.T1": "out"},
}
MOTION = {
    "time": "t",
    "inputs": {"tendon_command.T1": "in"},
    "outputs": {"tendon_tension.T1": "out", "joint_position.drum": "angle"},
}
Made = dict[str, np.ndarray]


def readings(rng: np.random.Generator, coulomb: float, drag: float, offset: float) -> Made:
    """Return twelve loads to and fro, three readings each."""
    load = np.repeat(np.linspace(3.0, 15.0, 6), 6)
    way = np.tile([1.0, 1.0, 1.0, -1.0, -1.0, -1.0], 6)
    out = load * np.exp(-way * coulomb * TURN) - way * drag / (1.0 + way * np.tanh(coulomb * TURN / 2.0))
    return {"in": load, "way": way, "out": out - offset + rng.normal(0.0, NOISE, load.size)}


def motion(rng: np.random.Generator, coulomb: float, drag: float, delay: float, turn: float = TURN) -> Made:
    """Return 4 s at 100 Hz: drawn in, let out and drawn in again; force with a correlation of 0.6, angle with none."""
    # Drum and bristles of the scenario `canal`: a rod 40 mm long, 20 mm thick, about its end; SI.
    radius, inertia, stiffness, damping, bristles = 0.02, 0.02 * (0.04**2 / 3.0 + 0.01**2 / 4.0), 0.2, 2e-3, 5e4
    share = np.tanh(coulomb * turn / 2.0)

    def pull(time):
        return 6.0 - 6.0 * np.cos(2.0 * np.pi * 0.4 * time)

    def rate(time, state):
        angle, speed, friction = state
        sliding, given = radius * speed, pull(time)
        level = share * max(2.0 * given - friction, 0.0) + drag
        bending = bristles * (sliding - friction * abs(sliding) / level)
        return [speed, (radius * max(given - friction, 0.0) - stiffness * angle - damping * speed) / inertia, bending]

    time = np.arange(0.0, 4.0, 0.01)
    grid = np.union1d(time, np.maximum(time - delay, 0.0))
    found = scipy.integrate.solve_ivp(
        rate, (0.0, grid[-1]), [0.0, 0.0, 0.0], "LSODA", grid, rtol=1e-9, atol=1e-11, max_step=0.01
    )
    force = np.interp(np.maximum(time - delay, 0.0), grid, np.maximum(pull(grid) - found.y[2], 0.0))
    fresh, noise = rng.normal(size=time.size), np.zeros(time.size)
    for k in range(time.size):
        noise[k] = 0.6 * noise[k - 1] + 0.8 * fresh[k] if k else fresh[k]
    angle = np.interp(time, grid, found.y[0]) + rng.normal(0.0, 2e-3, time.size)
    return {"t": time, "in": pull(time), "out": force + 0.05 * noise, "angle": angle}


def held(
    count: int,
    make: Callable[..., Made],
    recording: dict[str, object],
    bounds: dict[str, tuple[float, float]],
    truths: list[tuple[float, float]],
    runs: int = 1,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return whether each interval holds the truth, shape (count, p), and whether the model is said to miss something.

    A further recording of each data set is held out: the share of its force inside the band, and half the band over
    1.96 times the error, rms, come third, shape (count, 2).

    Args:
        count: Of data sets.
        make: Function that makes one.
        recording: As in a file.
        bounds: Of the parameters, by key.
        truths: Between which numbers the truth of each is drawn; of more than there are bounds the last are not sought.
        runs: How often each motion is repeated.
        seed: Of draws and noise.
    """
    rng, rows, missed, bands = np.random.default_rng(seed), [], [], []
    names = ["pull", *(f"repeat_{k}" for k in range(1, runs))]
    for _ in range(count):
        truth = [rng.uniform(*each) for each in truths]
        result = fp.identify(
            "canal",
            parameters=bounds,
            recordings=dict.fromkeys(names, recording) | {"later": {**recording, "held_out": True}},
            data={name: make(rng, *truth) for name in (*names, "later")},
            overrides={"finger.tendons.T1.curvature_offset": TURN},
            starts=1,
        )
        sought = np.array(truth[: len(bounds)])
        rows.append((result.lower.values <= sought) & (sought <= result.upper.values))
        missed.append(bool((result.lack_of_fit < 0.01).any()))
        bands.append([float(result[f"prediction_{what}"][0]) for what in ("within", "band_ratio")])
    return np.array(rows), np.array(missed), np.array(bands)


def punctual(rng: np.random.Generator, coulomb: float, drag: float) -> Made:
    """Return a motion whose load cell is not late."""
    return motion(rng, coulomb, drag, 0.0)


FRICTIONS = {COULOMB: (0.005, 1.0), DRAG: (0.0, 3.0)}
KINDS = {
    "steady": (readings, STEADY, {**FRICTIONS, OFFSET: (-2.0, 2.0)}, [(0.05, 0.3), (0.2, 1.0), (-0.5, 0.5)]),
    "repeated": (punctual, {**MOTION, "settle": 0.1}, FRICTIONS, [(0.05, 0.3), (0.2, 1.0)], 2),
    "lacking": (punctual, {**MOTION, "settle": 0.1}, {COULOMB: (0.005, 1.0)}, [(0.05, 0.3), (0.2, 1.0)], 2),
    "motion": (motion, MOTION, {**FRICTIONS, DELAY: (0.0, 0.1)}, [(0.05, 0.3), (0.2, 1.0), (0.01, 0.05)]),
}


def main(arguments: list[str] | None = None) -> int:
    """Print the share of intervals that hold the truth, by parameter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, help="data sets of each kind")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)}; by default all")
    given = parser.parse_args(arguments)
    if wrong := set(given.kinds) - set(KINDS):
        parser.error(f"KIND: {', '.join(wrong)}: must be one of {', '.join(KINDS)}")
    for kind in given.kinds or KINDS:
        found, missed, bands = held(given.count, *KINDS[kind])
        for key, share in zip(KINDS[kind][2], found.mean(axis=0), strict=True):
            print(f"{kind} {key}: {share:.1%} of {len(found)}")
        print(f"{kind}: said to miss something in {missed.mean():.1%}")
        within, ratio = bands.mean(axis=0)
        print(f"{kind}: {within:.1%} of held-out samples inside the band, half of which is {ratio:.2f} times 1.96 rms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
