"""Which controller tracks best, and what does it pay in tension?

The paper's finger and motion under four controllers, all sampled at 1 kHz. Run it:
python scripts/examples/compare_controllers.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
SAMPLED = {"simulation.duration": 4.0, "controller.sampling.period": 1e-3}  # s
DAMPED = SAMPLED | {"controller.damping": [3e-3, 3e-3, 0.0, 0.0], "controller.gravity_compensation": True}
TENDONS = DAMPED | {"controller.tendon_friction_feedforward.share": 1.0}
CONTROLLERS = {
    "proportional (the paper's)": SAMPLED,
    "PD and gravity": DAMPED,
    "and friction of tendons": TENDONS,
    "and friction of joints": TENDONS | {"controller.joint_friction_compensation.share": 1.0},
}

errors, peaks = {}, {}
for name, changed in CONTROLLERS.items():
    result = fp.simulate(fp.load_scenario("reversals", changed)).sel(time=slice(1.0, None))  # without the start
    errors[name] = np.rad2deg(float((result.tracking_error**2).mean() ** 0.5))
    peaks[name] = float(result.tendon_command.max())
    print(f"{name}: {errors[name]:.3f} deg rms, at most {peaks[name]:.1f} N")
first, *_, last = errors.values()
print(f"Compensating friction tracks {first / last:.1f} times better, with smaller peaks of tension.")

plt.style.use("finger_pin.views.plots.finger_pin")
figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 2.6), sharey=True, layout="constrained")
left.barh(list(errors), errors.values(), color="C1")
right.barh(list(peaks), peaks.values(), color="C0")
left.invert_yaxis()
left.set_xlabel("tracking error (deg rms)")
right.set_xlabel("peak tension (N)")
for axes in (left, right):
    axes.bar_label(axes.containers[0], fmt="%.2f", padding=3, fontsize="small")
    axes.grid(visible=False, axis="y")
    axes.margins(x=0.15)
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "compare_controllers.png")
