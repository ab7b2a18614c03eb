"""I have a MuJoCo model of a hand: how does it move if its tendons rub?

Reads a finger that one cord bends against springs, moves it in MuJoCo and here, without friction and with it. Needs
the extra mujoco. Run it: python scripts/examples/mujoco_hand.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
MODEL = """<mujoco><option timestep="0.0005"/><default><joint axis="0 1 0" range="-10 100" armature="1e-5"/>
<geom type="capsule" density="1100" contype="0" conaffinity="0"/></default><worldbody>
<site name="palm" pos="-0.02 0 -0.008"/><body name="proximal"><joint name="mcp" stiffness="0.06" damping="4e-4"/>
<geom size="0.007" fromto="0 0 0 0.045 0 0"/><site name="p1" pos="0.01 0 -0.01"/><site name="p2" pos="0.035 0 -0.01"/>
<body name="distal" pos="0.045 0 0"><joint name="pip" stiffness="0.04" damping="4e-4"/>
<geom size="0.006" fromto="0 0 0 0.03 0 0"/><site name="d1" pos="0.01 0 -0.009"/></body></body></worldbody>
<tendon><spatial name="flexor"><site site="palm"/><site site="p1"/><site site="p2"/><site site="d1"/></spatial></tendon>
<actuator><motor name="pull" tendon="flexor" gear="-1" ctrlrange="0 10"/></actuator></mujoco>"""
PULL = {"offset": 3.0, "amplitude": -3.0, "frequency": 0.25, "phase": 0.5 * np.pi}  # N, Hz, rad: 0 to 6 N and back

model = mujoco.MjModel.from_xml_string(MODEL)
data, theirs = mujoco.MjData(model), []
for _ in range(8000):
    data.ctrl[0] = 3.0 - 3.0 * np.cos(0.5 * np.pi * data.time)
    mujoco.mj_step(model, data)
    theirs.append([data.time, np.rad2deg(data.qpos[1])])

scenario = fp.Scenario.model_validate(
    {
        "name": "hook",
        "finger": fp.from_mujoco(model),
        "controller": {"kind": "tensions", "tensions": {"pull": PULL}},
        "simulation": {"duration": 4.0},
    }
)
angles = {}
for coulomb in (0.0, 0.15):  # of the tendon on its guides; pins rub with an arm in m
    rubs = dict.fromkeys(("finger.joint_friction.coulomb", "finger.joint_friction.stiction"), 2e-3 * coulomb)
    rubs |= {"finger.tendon_friction.coulomb": coulomb, "finger.tendon_friction.viscous": 0.0}
    result = fp.simulate(fp.load_scenario(scenario, rubs))
    angles[coulomb] = np.rad2deg(result.joint_position.sel(joint="pip"))
smooth, rough = angles.values()
apart = float(abs(smooth.values - np.interp(result.time, *np.transpose(theirs))).max())
at_3_newton = [float(rough.sel(time=time)) for time in (1.0, 3.0)]
print(
    f"Without friction the motion is MuJoCo's to {apart:.2f} deg. With friction 3 N hold the outer joint at "
    f"{at_3_newton[0]:.0f} deg while it closes, at {at_3_newton[1]:.0f} deg while it opens."
)

pull = 3.0 - 3.0 * np.cos(0.5 * np.pi * result.time)
plt.style.use("finger_pin.views.plots.finger_pin")
figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
axes.plot(pull, rough, label="with friction")
axes.plot(pull, smooth, label="without friction")
axes.plot(*np.transpose([[3.0 - 3.0 * np.cos(0.5 * np.pi * t), q] for t, q in theirs]), "k:", label="MuJoCo")
axes.set(xlabel="pull (N)", ylabel="angle of the outer joint (deg)")
axes.legend()
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "mujoco_hand.png")
