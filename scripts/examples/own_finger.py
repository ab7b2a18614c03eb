"""How do I describe a finger of my own and see it move?

Two joints, three tendons, one file of TOML. Run it: python scripts/examples/own_finger.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
TRIGGER = """
[finger]
name = "trigger"
gravity = [0.0, -9.81, 0.0]          # m/s2; both axes are z, so that the finger moves in a vertical plane
joints.base = { range = [-0.2, 1.6], link = { length = 0.05, width = 0.016, mass = 0.015 } }   # rad, m, kg
joints.tip = { range = [-0.2, 1.6], link = { length = 0.03, width = 0.012, mass = 0.008 } }
tendons.bend.crossings = { base = { radius = 0.007 } }                                         # m
tendons.curl.crossings = { base = { radius = 0.004, bends = true }, tip = { radius = 0.006 } }
tendons.open.crossings = { base = { radius = -0.009, bends = true }, tip = { radius = -0.006 } }
tendon_friction.coulomb = 0.1        # of the cord in its canal

[controller]
gain = 2.0                           # N m/rad
damping = 2e-3                       # N m s/rad
minimum_tension = 1.0                # N

[reference.joints]
base = { offset = 0.6, amplitude = 0.4, frequency = 0.5 }              # rad, Hz
tip = { offset = 0.7, amplitude = 0.5, frequency = 0.5, phase = 1.0 }
"""

FOLDER.mkdir(parents=True, exist_ok=True)
path = FOLDER / "trigger.toml"
path.write_text(TRIGGER, encoding="utf-8")

scenario = fp.load_scenario(path, {"simulation.duration": 4.0})
weight = fp.Finger(scenario.finger).static_torque(np.zeros(2))  # N m, of gravity on the stretched finger
result = fp.simulate(scenario)
error = np.rad2deg(float((result.tracking_error**2).mean() ** 0.5))
print(f"Stretched out it weighs {1e3 * weight[0]:.2f} mN m at its base; it follows its motion to {error:.2f} deg rms.")

plt.style.use("finger_pin.views.plots.finger_pin")
figure, (top, bottom) = plt.subplots(2, figsize=(7.0, 4.2), sharex=True, layout="constrained")
top.plot(result.time, np.rad2deg(result.joint_position), label=result.joint.values)
top.plot(result.time, np.rad2deg(result.joint_reference), "k:", linewidth=1.0, label=["reference", None])
bottom.plot(result.time, result.tendon_tension, label=result.tendon.values)
top.set_ylabel("angle (deg)")
bottom.set(ylabel="tension (N)", xlabel="time (s)")
for axes in (top, bottom):
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
figure.savefig(FOLDER / "own_finger.png")
