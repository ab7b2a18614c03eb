"""Random scenarios with impacts: joints thrown against limits, plates pushed, objects pinched, grasped, dropped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import finger_pin as fp


def _surface(rng: np.random.Generator, *, stiff: float = 5.5) -> dict[str, float]:
    """Return a surface of any hardness from a soft fingertip's on, of any bounce and grip."""
    return {
        "stiffness": float(10 ** rng.uniform(3.5, stiff)),
        "damping": float(rng.choice([0.0, 0.5, 2.0])),
        "friction": float(rng.uniform(0.2, 0.9)),
        "stiction_ratio": float(rng.choice([1.0, 1.3])),
    }


def _limiters(rng: np.random.Generator) -> fp.Scenario:
    """Drive joints of the paper's finger beyond their ranges, half of them thrown, with a force at the fingertip."""
    overrides: dict[str, Any] = {
        "simulation.duration": 1.0,
        "finger.stroke_limiter.stiffness": float(10 ** rng.uniform(1.0, 3.5)),
        "finger.stroke_limiter.damping": float(rng.choice([0.0, 0.5, 5.0])),
        "finger.joint_friction.coulomb": float(2.5e-4 * rng.uniform(0.2, 1.0)),
        "controller.gain": float(10 ** rng.uniform(-0.5, 0.5)),
        "environment.fingertip_force": rng.normal(0.0, 0.6, 3).tolist(),
    }
    for name in ("proximal", "medial"):
        overrides |= {
            f"reference.joints.{name}.frequency": float(rng.uniform(0.5, 1.5)),
            f"reference.joints.{name}.amplitude": float(-rng.uniform(0.4, 0.7)),
            f"reference.joints.{name}.offset": float(rng.uniform(0.6, 0.9)),
        }
    if rng.random() < 0.5:
        overrides["simulation.initial.velocity.proximal"] = float(rng.normal(0.0, 20.0))
    return fp.load_scenario("reversals", overrides)


def _press(rng: np.random.Generator) -> fp.Scenario:
    """Flex onto a plate, push, drag along it and let go, within a second and a half."""
    quick, surface = 0.15, _surface(rng)
    times = [0.0, 1.2, 1.6, 3.6, 4.0, 6.0, 6.4, 7.6]
    plate = "environment.objects.plate"
    return fp.load_scenario(
        "press",
        {
            "simulation.duration": 1.5,
            "controller.gain": float(10 ** rng.uniform(-0.3, 0.3)),
            "reference.joints.proximal.times": [quick * time for time in times],
            "reference.joints.medial.times": [quick * time for time in times],
            f"{plate}.position": [0.0, 0.0, float(rng.uniform(0.046, 0.051))],
        }
        | {f"{plate}.surface.{name}": value for name, value in surface.items()},
    )


def _pinch(rng: np.random.Generator) -> fp.Scenario:
    """Shake a ball that is pinched, let it go, and let it fall on a tray that moves."""
    overrides: dict[str, Any] = {
        "simulation.duration": 0.8,
        "hand.palm.path.y.amplitude": float(0.012 * rng.uniform(0.0, 1.5)),
        "hand.palm.path.x.frequency": float(rng.uniform(2.0, 6.0)),
        "environment.objects.ball.mass": float(10 ** rng.uniform(-2.0, -1.2)),
        "environment.objects.tray.position": [float(rng.uniform(0.11, 0.2)), 0.0, 0.0],
    }
    lets_go = [0.2, float(rng.uniform(0.3, 0.5))]
    for side in ("left", "right"):
        overrides |= {f"reference.joints.{side}.{joint}.times": lets_go for joint in ("proximal", "medial")}
    for each in ("ball", "tray"):
        overrides |= {f"environment.objects.{each}.surface.{name}": v for name, v in _surface(rng, stiff=4.5).items()}
    return fp.load_scenario("pinch", overrides)


def _grasp(rng: np.random.Generator) -> fp.Scenario:
    """Close a hand on a cylinder, and lift it."""
    surface = "environment.objects.cylinder.surface"
    return fp.load_scenario(
        "grasp",
        {
            "simulation.duration": 0.6,
            "controller.gain": float(10 ** rng.uniform(-0.2, 0.2)),
            "hand.palm.path.z.times": [0.3, 0.5],
            "hand.palm.path.z.values": [0.0, float(rng.uniform(0.01, 0.05))],
            "environment.objects.cylinder.mass": float(10 ** rng.uniform(-1.5, -0.5)),
        }
        | {f"{surface}.{name}": value for name, value in _surface(rng, stiff=4.5).items()},
    )


def _drops(rng: np.random.Generator) -> fp.Scenario:
    """Drop a ball, capsule, box or can, spinning, on a floor beside a finger at rest or on the finger itself."""
    shape, size = str(rng.choice(["sphere", "capsule", "box", "cylinder"])), float(rng.uniform(0.004, 0.01))
    sizes: dict[str, Any] = {"radius": size}
    if shape == "box":
        sizes = {"sides": (2.0 * size * rng.uniform(0.5, 1.5, 3)).tolist()}
    elif shape != "sphere":
        sizes |= {"length": float(size * rng.uniform(1.0, 4.0))}
    on_finger = rng.random() < 0.3
    place = [rng.uniform(0.03, 0.08) if on_finger else 0.3, 0.0, rng.uniform(0.06, 0.12)]
    thing = sizes | {
        "shape": shape,
        "mass": float(10 ** rng.uniform(-3.0, -1.0)),
        "position": [float(each) for each in place],
        "orientation": rng.normal(size=4).tolist(),
        "velocity": rng.normal(0.0, 0.2, 3).tolist(),
        "angular_velocity": rng.normal(0.0, 5.0, 3).tolist(),
        "surface": _surface(rng),
    }
    floor = {"shape": "half_space", "position": [0.0, 0.0, -0.03], "surface": _surface(rng)}
    return fp.Scenario.model_validate(
        {
            "name": "drops",
            "finger": fp.load_scenario("reversals").finger,
            "environment": {"objects": {"floor": floor, "thing": thing}},
            "simulation": {"duration": 0.4, "sample_rate": 1000.0},
        }
    )


FAMILIES: dict[str, Callable[[np.random.Generator], fp.Scenario]] = {
    "limiters": _limiters,
    "press": _press,
    "pinch": _pinch,
    "grasp": _grasp,
    "drops": _drops,
}


def impact_scenario(family: str, seed: int) -> fp.Scenario:
    """Return the scenario of a family and a seed, at a random tolerance between 1e-3 and 1e-7."""
    rng = np.random.default_rng([list(FAMILIES).index(family), seed])
    scenario = FAMILIES[family](rng)
    return at_tolerance(scenario, float(10.0 ** rng.uniform(-7.0, -3.0)))


def at_tolerance(scenario: fp.Scenario, tolerance: float) -> fp.Scenario:
    """Return a scenario with another tolerance."""
    return scenario.updated(simulation={"rtol": tolerance, "atol_scale": tolerance})
