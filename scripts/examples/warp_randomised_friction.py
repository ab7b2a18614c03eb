"""Does a controller that was trained with one friction work with another, and one trained with many?

A lever on a spring follows steps of its goal, pulled by a tendon in a canal, in 256 worlds of MuJoCo Warp with
coefficients of their own. Four weights make the tension: of the goal, of the goal by whether it is above or below the
last, of the measured error and of the speed. The cross-entropy method finds them: of 32 sets, each tried in eight
worlds, the best eight say where to look next; once in worlds that rub alike, once with coefficients drawn anew in every
round. Needs the extra warp. Run it:
python scripts/examples/warp_randomised_friction.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
MODEL = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody><body name="link">
<joint name="hinge" axis="0 -1 0" range="-10 100" stiffness="0.05" damping="0.0025" armature="4e-5"/>
<geom type="capsule" size="0.006" fromto="0 0 0 0.05 0 0" density="1200" contype="0" conaffinity="0"/></body>
</worldbody><tendon><fixed name="flexor"><joint joint="hinge" coef="-0.008"/></fixed></tendon>
<actuator><motor name="pull" tendon="flexor" gear="-1" ctrlrange="0 20" ctrllimited="true"/></actuator></mujoco>"""
ROUNDS, SETS, BEST, WORLDS = 15, 32, 8, 256
ALIKE, LEAST, MOST, TURN = 0.1, 0.02, 0.3, 1.5  # coefficients; rad, by which the canal turns
PERIOD, STEPS = 0.01, 5  # s, between tensions; steps of 2 ms in it
GOALS, HELD = np.deg2rad([50.0, 25.0, 60.0, 35.0]), 50  # each for so many periods
WANTED = np.repeat(GOALS, HELD)
WAYS = np.repeat(np.sign(np.diff(GOALS, prepend=0.0)), HELD)  # up and down
SCALES = np.array([0.05 / 0.008, 0.05 / 0.008, 30.0, 0.3])  # N/rad, N s/rad
NOISE = np.deg2rad(0.3)  # of the angle that is measured

wp.config.log_level = wp.LOG_ERROR  # without a line for every kernel
model = mujoco.MjModel.from_xml_string(MODEL)
m, d = mjw.put_model(model), mjw.make_data(model, nworld=WORLDS, njmax=4, nconmax=1)
law = {"coulomb": ALIKE, "curvature_offset": TURN, "stiction_ratio": 1.0, "viscous": 0.0}
friction = fp.mujoco.warp.add_friction(m, d, model, tendons={"flexor": law})
with wp.ScopedCapture() as capture:
    for _ in range(STEPS):
        mjw.step(m, d)


def tried(weights, coulomb):
    """Return the angles, rad, and tensions, N, of all worlds, shape (times, worlds)."""
    mjw.reset_data(m, d)
    friction.coulomb.assign(coulomb.astype(np.float32)[:, None])
    random, angles, tensions = np.random.default_rng(1), [], []
    for goal, way in zip(WANTED, WAYS, strict=True):
        angle = d.qpos.numpy()[:, 0] + NOISE * random.standard_normal(WORLDS)
        known = [np.full(WORLDS, goal), np.full(WORLDS, goal * way), goal - angle, -d.qvel.numpy()[:, 0]]
        tension = np.clip((weights * SCALES * np.transpose(known)).sum(axis=1), 0.0, 20.0)
        d.ctrl.assign(tension.astype(np.float32)[:, None])
        wp.capture_launch(capture.graph)
        angles.append(d.qpos.numpy()[:, 0].copy())
        tensions.append(tension)
    return np.array(angles), np.array(tensions)


def errors(angles):
    """Return the mean error of every world in the last half of what each goal is held for, deg."""
    settled = np.arange(WANTED.size) % HELD >= HELD // 2
    return np.rad2deg(abs(angles - WANTED[:, None])[settled].mean(axis=0))


def trained(drawn):
    """Return weights that were trained with coefficients that a function draws, shape (worlds,)."""
    random, middle, spread = np.random.default_rng(0), np.array([1.0, 0.0, 0.0, 0.0]), np.full(4, 0.3)
    for _ in range(ROUNDS):
        sets = middle + spread * random.standard_normal((SETS, 4))
        angles, tensions = tried(np.repeat(sets, WORLDS // SETS, axis=0), drawn(random))
        # Tensions that jump cost too: 1 N from one to the next as much as 1 deg.
        costs = errors(angles) + abs(np.diff(tensions, axis=0)).mean(axis=0)
        best = sets[np.argsort(costs.reshape(SETS, -1).mean(axis=1))[:BEST]]
        middle, spread = best.mean(axis=0), best.std(axis=0) + 0.01
    return middle


def drawn_anew(random):
    """Return coefficients, of which every set of weights meets the same eight."""
    return np.tile(random.uniform(LEAST, MOST, WORLDS // SETS), SETS)


weights = {"one friction": trained(lambda _: np.full(WORLDS, ALIKE)), "many frictions": trained(drawn_anew)}
coulomb = np.linspace(LEAST, MOST, WORLDS)
angles = {name: tried(np.tile(each, (WORLDS, 1)), coulomb)[0] for name, each in weights.items()}
found = {name: errors(each) for name, each in angles.items()}
alike, many = ((float(np.interp(ALIKE, coulomb, each)), each.max()) for each in found.values())
print(
    f"Trained with a coefficient of {ALIKE:g}, it misses goals by {alike[0]:.1f} deg there and by up to "
    f"{alike[1]:.1f} deg elsewhere; trained with {LEAST:g} to {MOST:g}, by {many[0]:.1f} and {many[1]:.1f} deg."
)

plt.style.use("finger_pin.views.plots.finger_pin")
figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9), layout="constrained")
times = PERIOD * np.arange(1, WANTED.size + 1)
right.plot(times, np.rad2deg(WANTED), "k:", label="goal")
for name in weights:
    left.plot(coulomb[::8], found[name][::8], label=name)
    right.plot(times, np.rad2deg(angles[name][:, -1]), label=name)
left.axvline(ALIKE, color="0.5", linestyle=":")
left.set(xlabel="coefficient of friction", ylabel="error (deg)", ylim=(0.0, None))
left.legend(title="trained with")
right.set(xlabel="time (s)", ylabel=f"angle where it is {MOST:g} (deg)")
right.legend()
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "warp_randomised_friction.png")
