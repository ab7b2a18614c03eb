"""How do I make the tendons of a MuJoCo model rub, inside mj_step?

A servo pulls the flexor of a MuJoCo finger slowly in and lets it out again, with and without friction in its canal.
Needs the extra mujoco. Run it: python scripts/examples/mj_step_friction.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
MODEL = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body name="link">
<joint name="hinge" axis="0 -1 0" range="-10 90" stiffness="0.05" damping="0.0002" armature="1e-5"/>
<geom type="capsule" size="0.006" fromto="0 0 0 0.05 0 0" density="1200"/></body></worldbody>
<tendon><fixed name="flexor"><joint joint="hinge" coef="-0.008"/></fixed></tendon>
<actuator><motor name="pull" tendon="flexor" gear="-1" ctrlrange="0 12"/></actuator></mujoco>"""
COULOMB, TURN = 0.12, 1.5  # of the cord on its canal; rad, by which the canal turns
time = np.arange(0.0, 8.0, 0.001)  # s
pull = 8.0 * np.interp(time, [0.0, 4.0, 8.0], [0.0, 1.0, 0.0])  # N


def angles(model):
    """Return the angle of the hinge over time, deg."""
    data, found = mujoco.MjData(model), np.zeros(time.size)
    for step, force in enumerate(pull):
        data.ctrl[0] = force
        mujoco.mj_step(model, data)
        found[step] = np.rad2deg(data.qpos[0])
    return found


spec = mujoco.MjSpec.from_string(MODEL)
smooth = angles(spec.compile())
law = {"coulomb": COULOMB, "curvature_offset": TURN, "stiction_ratio": 1.0, "viscous": 0.0}
fp.mujoco.add_friction(spec, tendons={"flexor": law})  # this line is all
rough = angles(spec.compile())

winding_in = time < 4.0
there = np.interp(40.0, rough[winding_in], pull[winding_in])  # N, that bend it to 40 deg
back = np.interp(40.0, rough[~winding_in][::-1], pull[~winding_in][::-1])  # N, that let it come back to 40 deg
print(f"To bend it to 40 deg takes {there:.2f} N; it stays there down to {back:.2f} N, {there / back:.2f} times less.")

plt.style.use("finger_pin.views.plots.finger_pin")
figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
axes.plot(pull, smooth, color="0.5", label="MuJoCo alone")
axes.plot(pull, rough, label="with friction of the tendon")
axes.set(xlabel="pull at the canal's entrance (N)", ylabel="angle (deg)")
axes.legend()
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "mj_step_friction.png")
