"""Random fingers in wide ranges: where an integrator meets stiff impacts, kinks, tiny masses and near locking."""

from __future__ import annotations

from typing import Any

import numpy as np

import finger_pin as fp

MOST_JOINTS, MOST_PASSIVE = 7, 3
DURATION = 0.3


def wild_scenario(seed: int) -> fp.Scenario:
    """Return the scenario of a seed, valid, 0.3 s at default tolerances.

    A third of the fingers start beyond a limit, a third start moving fast.
    """
    rng = np.random.default_rng(seed)

    def magnitude(low: float, high: float, *, none: float = 0.0) -> float:
        """Return a number of any order of magnitude between bounds, or zero with a probability."""
        value = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        return 0.0 if rng.random() < none else value

    count = int(rng.integers(1, MOST_JOINTS + 1))
    passive = int(rng.integers(0, min(MOST_PASSIVE, (count - 1) // 2 + count % 2, count - 1) + 1))
    names = [f"j{index}" for index in range(1, count + 1)]
    joints = {name: _joint(rng, magnitude) for name in names}
    coulomb = magnitude(1e-5, 2e-3, none=0.1)
    scenario: dict[str, Any] = {
        "name": f"wild_{seed}",
        "finger": {
            "name": "wild",
            "joints": joints,
            "tendons": _tendons(rng, magnitude, names, passive),
            **_frictions(rng, magnitude, coulomb),
            "passive_tendon": {"stiffness": magnitude(1e3, 3e5), "mass": magnitude(1e-6, 1e-3)},
            "stroke_limiter": {"stiffness": magnitude(1.0, 1e5), "damping": magnitude(1e-2, 100.0, none=0.1)},
        },
        "controller": {
            "gain": magnitude(1e-2, 10.0),
            "minimum_tension": magnitude(0.1, 10.0),
            "passive_tension": magnitude(0.1, 10.0),
        },
        "simulation": {"duration": DURATION},
    }
    if not passive:
        # Drawn all the same, so that a seed's other numbers do not depend on it.
        del scenario["finger"]["passive_tendon"], scenario["controller"]["passive_tension"]
    followed = fp.FingerDescription.model_validate(scenario["finger"])
    coupling = _followers(followed)
    scenario["reference"] = {
        "joints": {
            name: {
                "offset": float(np.mean(joints[name]["range"])),
                "amplitude": float(rng.uniform(0.0, 0.7) * np.ptp(joints[name]["range"])),
                "frequency": magnitude(0.1, 5.0),
            }
            for index, name in enumerate(names)
            if index not in coupling
        }
    }
    initial = _initial(rng, magnitude, joints)
    if initial:
        scenario["simulation"]["initial"] = initial
    return fp.Scenario.model_validate(scenario)


def _frictions(rng: np.random.Generator, magnitude: Any, coulomb: float) -> dict[str, Any]:
    """Return the friction of tendons and of joints, whose Coulomb coefficient is given."""
    return {
        "tendon_friction": {
            "coulomb": magnitude(1e-3, 0.5, none=0.1),
            "stiction_ratio": float(rng.uniform(1.0, 3.0)),
            "stiffness": magnitude(1e3, 1e6),
            "viscous": magnitude(1e-3, 10.0, none=0.2),
            "stribeck_velocity": magnitude(1e-4, 0.1),
            "floor": magnitude(1e-8, 1e-3),
        },
        "joint_friction": {
            "coulomb": coulomb,
            "stiction": coulomb * float(rng.uniform(1.0, 2.0)),
            "stiffness": magnitude(0.1, 100.0),
            "viscous": magnitude(1e-6, 1e-2, none=0.2),
            "stribeck_velocity": magnitude(1e-3, 1.0),
            "floor": magnitude(1e-9, 1e-6),
        },
    }


def _initial(rng: np.random.Generator, magnitude: Any, joints: dict[str, Any]) -> dict[str, Any]:
    """Return a start: one in three with a joint beyond its range, one in three in motion."""
    initial: dict[str, Any] = {}
    if rng.random() < 1 / 3:
        name = str(rng.choice(list(joints)))
        lower, upper = joints[name]["range"]
        beyond = magnitude(1e-3, 0.5)
        initial["position"] = {name: upper + beyond if rng.random() < 0.5 else lower - beyond}
    if rng.random() < 1 / 3:
        initial["velocity"] = {name: float(rng.normal() * magnitude(0.1, 30.0)) for name in joints}
    return initial


def _joint(rng: np.random.Generator, magnitude: Any) -> dict[str, Any]:
    lower = float(rng.uniform(-1.5, 0.5))
    link = {
        "length": magnitude(5e-3, 0.1),
        "width": magnitude(2e-3, 0.03),
        "mass": magnitude(1e-4, 0.3),
        "twist": float(rng.choice([0.0, 0.0, np.pi / 2])),
    }
    return {"range": [lower, lower + float(rng.uniform(0.1, 1.8))], "link": link}


def _tendons(rng: np.random.Generator, magnitude: Any, names: list[str], passive: int) -> dict[str, Any]:
    """Return tendons with force closure: the last actuated one opposes a positive combination of all others."""
    count = len(names)
    rows = []
    for first in rng.choice(count - 1, passive, replace=False) if passive else ():
        row = np.zeros(count)
        row[first : first + 2] = -magnitude(1e-3, 2e-2), magnitude(1e-3, 2e-2)
        rows.append(row)
    for last in range(count - passive):
        row = np.zeros(count)
        reach = count if last == count - passive - 1 else int(rng.integers(1, count + 1))
        row[:reach] = [rng.choice([-1.0, 1.0]) * magnitude(5e-4, 2e-2) for _ in range(reach)]
        rows.append(row)
    weights = rng.uniform(0.3, 1.0, len(rows))
    rows.append(-weights @ np.array(rows) / np.sqrt(len(rows)))
    tendons = {}
    for index, row in enumerate(rows):
        crossed = np.flatnonzero(row)
        tendons[f"T{index}"] = {
            "kind": "passive" if index < passive else "actuated",
            "curvature_offset": float(rng.uniform(0.0, 2.0)),
            "crossings": {names[j]: {"radius": float(row[j]), "bends": bool(rng.random() < 0.5)} for j in crossed},
        }
    return tendons


def _followers(finger: fp.FingerDescription) -> tuple[int, ...]:
    from finger_pin.description.coupling import PassiveCoupling
    from finger_pin.description.routing import Routing

    routing = Routing.from_description(finger)
    return tuple(PassiveCoupling.from_routing(routing, np.zeros(routing.passive)).followers)
