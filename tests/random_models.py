"""Random models that a scenario file can describe: trees, fingers and hands, with features drawn from a table.

A seed says all: which kind of model, which features, and their numbers, over decades. Each feature draws from a
generator of its own, so that a model without one of them keeps the numbers of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from random_fingers import CHAIN_FEATURES, Feature, chain, cogging, direction, swing
from random_surroundings import TREE_FEATURES, wrench
from random_trees import tendon_coupling, tree

from finger_pin.description.caching import cached_property
from finger_pin.description.loading import read_scenario
from finger_pin.description.scenario import Scenario

Table = dict[str, Any]

#: How often a model has each feature that its kind may have.
SHARE = 0.35
#: Time that runs take, s.
DURATION = 0.01


@dataclass(frozen=True)
class RandomModel:
    """A model that a seed has drawn.

    Attributes:
        seed: The seed.
        kind: tree, finger or hand.
        features: Those of its kind that it has, in the order in which they were added.
        table: What `read_scenario` reads.
    """

    seed: int
    kind: str
    features: tuple[str, ...]
    table: Table = field(repr=False)

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario, checked."""
        return read_scenario(self.table)

    def rng(self, *purpose: int) -> np.random.Generator:
        """Return a generator for what is done with the model."""
        return np.random.default_rng([self.seed, 10**6, *purpose])

    def without(self, *features: str) -> RandomModel:
        """Return the same model without some features; what needs them goes as well."""
        return _built(self.seed, self.kind, [name for name in self.features if name not in features])


def random_model(seed: int, without: Collection[str] = (), kind: str | None = None) -> RandomModel:
    """Return the model of a seed, without some features, of any kind or of one."""
    rng = np.random.default_rng(seed)
    kinds = [*FEATURES]
    drawn = kinds[int(rng.choice(len(kinds), p=[0.6, 0.25, 0.15]))]
    kind = kind or drawn
    names = [name for name, draw in zip(FEATURES[kind], rng.random(len(FEATURES[kind])), strict=True) if draw < SHARE]
    return _built(seed, kind, [name for name in names if name not in without])


def _built(seed: int, kind: str, names: list[str]) -> RandomModel:
    table, has = BASES[kind](np.random.default_rng([seed, 0])), []
    every = [*FEATURES[kind]]
    for name in names:
        # A feature says whether the model had a place for it.
        if FEATURES[kind][name](np.random.default_rng([seed, 1, every.index(name)]), table):
            has.append(name)
    return RandomModel(seed, kind, tuple(has), table)


def _run(finger_or_hand: Table) -> Table:
    simulation = {"duration": DURATION, "sample_rate": 20.0 / DURATION}
    controller = {"kind": "tensions"}
    return {"name": "random", **finger_or_hand, "controller": controller, "environment": {}, "simulation": simulation}


def _tree(rng: np.random.Generator) -> Table:
    finger = tree(rng)
    table = _run({"finger": finger})
    return table | {"simulation": table["simulation"] | {"initial": {"position": _posture(rng, finger)}}}


def _finger(rng: np.random.Generator) -> Table:
    finger = chain(rng)
    table = _run({"finger": finger})
    table["simulation"]["initial"] = {"position": _posture(rng, finger)}
    table["controller"]["tensions"] = {name: swing(rng, 1.0, 5.0) for name in finger["tendons"]}
    return table


def _hand(rng: np.random.Generator) -> Table:
    placed, position, controllers = {}, {}, {}
    for k in range(2):
        finger = chain(rng)
        name = f"finger_{k}"
        place = {"position": rng.uniform(-0.05, 0.05, 3).tolist(), "orientation": rng.uniform(-1.0, 1.0, 3).tolist()}
        placed[name] = {"finger": finger, **place, "scale": float(rng.uniform(0.7, 1.5))}
        position |= {f"{name}.{joint}": angle for joint, angle in _posture(rng, finger).items()}
        controllers[name] = {"tensions": {tendon: swing(rng, 1.0, 5.0) for tendon in finger["tendons"]}}
    hand = {"name": "random", "gravity": (9.81 * direction(rng)).tolist(), "fingers": placed}
    table = _run({"hand": hand})
    table["controller"]["fingers"] = controllers
    table["simulation"]["initial"] = {"position": position}
    return table


def _posture(rng: np.random.Generator, finger: Table) -> dict[str, float]:
    """Return angles within the middle half of the ranges."""
    shares = rng.uniform(0.25, 0.75, len(finger["joints"]))
    ranges = [each["range"] for each in finger["joints"].values()]
    angles = [low + share * (high - low) for (low, high), share in zip(ranges, shares, strict=True)]
    return dict(zip(finger["joints"], map(float, angles), strict=True))


def _swinging(rng: np.random.Generator, table: Table) -> bool:
    """Let inputs swing."""
    controllers = [table["controller"], *table["controller"].get("fingers", {}).values()]
    signals = [
        signal
        for controller in controllers
        for key in ("tensions", "inputs", "tendon_winding", "spool_angle")
        for signal in controller.get(key, {}).values()
    ]
    for signal in signals:
        signal |= {"amplitude": 0.5 * signal["offset"], "frequency": float(rng.uniform(1.0, 50.0))}
    return bool(signals)


def _tip_force(rng: np.random.Generator, table: Table) -> bool:
    table["environment"]["fingertip_force"] = rng.normal(size=3).tolist()
    return True


def _palm_path(rng: np.random.Generator, table: Table) -> bool:
    """Shake the palm along and about some axes."""
    coordinates = rng.permutation(["x", "y", "z", "roll", "pitch", "yaw"])[: int(rng.integers(1, 7))]
    path = {
        str(each): {"amplitude": float(rng.uniform(0.005, 0.05)), "frequency": float(rng.uniform(1.0, 10.0))}
        for each in coordinates
    }
    table["hand"]["palm"] = {"path": path}
    return True


def _start_time(rng: np.random.Generator, table: Table) -> bool:
    table["simulation"]["start_time"] = float(rng.uniform(0.1, 2.0))
    return True


def _each_finger(feature: Feature) -> Feature:
    """Return a feature of a finger as one of a hand, whose fingers have it one by one."""

    def added(rng: np.random.Generator, table: Table) -> bool:
        acted, seed = False, int(rng.integers(2**32))
        for name, placed in table["hand"]["fingers"].items():
            part = {"finger": placed["finger"], "controller": table["controller"]["fingers"][name]}
            # The fingers of a hand have one law of joint friction.
            acted |= feature(np.random.default_rng(seed), part)
        return acted

    return added


_OF_RUNS: dict[str, Feature] = {"swinging inputs": _swinging, "start time": _start_time, "tip force": _tip_force}
#: All features by the kind of model that may have them, one a line in the tables of the modules that add them.
FEATURES: dict[str, dict[str, Feature]] = {
    "tree": TREE_FEATURES | _OF_RUNS | {"tendon coupling": tendon_coupling, "wrench": wrench, "cogging": cogging},
    "finger": CHAIN_FEATURES | _OF_RUNS | {"cogging": cogging},
    "hand": {name: _each_finger(feature) for name, feature in CHAIN_FEATURES.items()}
    | _OF_RUNS
    | {"palm path": _palm_path, "cogging": _each_finger(cogging)},
}
BASES: dict[str, Callable[[np.random.Generator], Table]] = {"tree": _tree, "finger": _finger, "hand": _hand}
