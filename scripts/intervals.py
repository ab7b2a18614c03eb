"""How often 95 % intervals hold the truth: identification of made-up readings whose numbers are known.

The readings come from the capstan law with a drag, written out here, with a wrong zero of the load cell and noise.
"""

import sys

import numpy as np

import finger_pin as fp

KEYS = ("finger.tendon_friction.coulomb", "finger.tendon_friction.drag", "recordings.pull.tendon_tension.T1.offset")
BOUNDS = ((0.005, 1.0), (0.0, 3.0), (-2.0, 2.0))
TURN, NOISE = 2.5, 0.08


def readings(rng: np.random.Generator, coulomb: float, drag: float, offset: float) -> dict[str, np.ndarray]:
    """Return twelve loads to and fro, three readings each."""
    load = np.repeat(np.linspace(3.0, 15.0, 6), 6)
    way = np.tile([1.0, 1.0, 1.0, -1.0, -1.0, -1.0], 6)
    out = load * np.exp(-way * coulomb * TURN) - way * drag / (1.0 + way * np.tanh(coulomb * TURN / 2.0))
    return {"in": load, "way": way, "out": out + offset + rng.normal(0.0, NOISE, load.size)}


def main(arguments: list[str] | None = None) -> int:
    """Print the share of intervals that hold the truth, by parameter."""
    count = int((sys.argv[1:] if arguments is None else arguments)[0])
    recording = {
        "kind": "steady",
        "speed": {"column": "way", "scale": 0.05},
        "inputs": {"tendon_command.T1": "in"},
        "outputs": {"tendon_tension.T1": "out"},
    }
    rng, held = np.random.default_rng(0), np.zeros(len(KEYS))
    for _ in range(count):
        truth = [rng.uniform(0.05, 0.3), rng.uniform(0.2, 1.0), rng.uniform(-0.5, 0.5)]
        result = fp.identify(
            "canal",
            parameters=dict(zip(KEYS, BOUNDS, strict=True)),
            recordings={"pull": recording},
            data={"pull": readings(rng, *truth)},
            overrides={"finger.tendons.T1.curvature_offset": TURN},
            starts=1,
        )
        held += (result.lower.values <= truth) & (truth <= result.upper.values)
    for key, share in zip(KEYS, held / count, strict=True):
        print(f"{key}: {share:.1%} of {count}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
