"""References that lock a finger or do not."""

import numpy as np

import finger_pin as fp


def steps(coefficient, duration=2.0):
    """Abduction and proximal swing one way, medial and distal the other, half a period: the worst directions."""
    overrides = {"simulation.duration": duration, "simulation.sample_rate": 100.0}
    overrides |= {f"finger.joint_friction.{name}": coefficient for name in ("coulomb", "stiction")}
    swings = {"abduction": (0.0, 8.0), "proximal": (35.0, 25.0), "medial": (35.0, -25.0)}
    for name, (offset, amplitude) in swings.items():
        overrides[f"reference.joints.{name}"] = {
            "offset": np.deg2rad(offset),
            "amplitude": np.deg2rad(amplitude),
            "frequency": 0.25,
            "phase": 0.5 * np.pi,
        }
    return fp.load_scenario("reversals", overrides)
