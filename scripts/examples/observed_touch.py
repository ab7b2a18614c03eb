"""What does a finger do of which one can read the motor alone, and does it touch something?

A servo winds in a cord that rubs 20 % more than the model says, and something presses on the tip for 0.4 s. Beside the
finger an observer is told angle and current of the motor, a thousand times a second. Run it:
python scripts/examples/observed_touch.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
PERIOD, ENCODER, CURRENT = 1e-3, 2 * np.pi / 4096, 1e-3  # s; steps of both sensors, rad and A
PRESSED, FORCE = (1.0, 1.4), [0.0, -1.0, 0.0]  # s, N

model = fp.load_scenario("wound")
friction = "finger.tendon_friction.coulomb"
real = fp.load_scenario("wound", {friction: 1.2 * model.finger.tendon_friction.coulomb})
finger = fp.Simulator.from_scenario(real, goals=True)
observer = fp.observe(model)  # it takes friction to be known to 10 %, and knows nothing of what presses
touches = []  # s, from when the observer says that it is touched to when it no longer does
for k in range(2500):
    goal = np.interp(k * PERIOD, [0.2, 2.2], [0.0, 2.8])  # rad, of the spool
    finger.step([goal], PERIOD, FORCE if PRESSED[0] <= k * PERIOD < PRESSED[1] else None)
    angle, current = finger.state.motor_position.item(), finger.signals()["motor_current"].item()
    readings = {
        "motor_position.servo": ENCODER * round(angle / ENCODER),
        "motor_current.servo": CURRENT * round(current / CURRENT),
    }
    now = observer.step(readings)
    if now.touched.any() != len(touches) % 2:
        touches.append(now.time)

result, truth = observer.result(), finger.result()
errors = np.rad2deg(result.joint_position - truth.joint_position.sel(time=result.time, method="nearest").values)
halves = np.rad2deg(result.joint_position_high - result.joint_position_low) / 2
for span, when in ((slice(0.5, 1.0), "Until something presses"), (slice(1.6, 2.5), "Afterwards")):
    error, half = (errors.sel(time=span) ** 2).mean("time") ** 0.5, halves.sel(time=span).mean("time")
    told = [
        f"{joint} by {error.sel(joint=joint):.1f} deg (+-{half.sel(joint=joint):.1f})" for joint in error.joint.values
    ]
    print(f"{when}, the observer is off in {', '.join(told)}.")
print(
    f"It was pressed from {PRESSED[0]} to {PRESSED[1]} s, and seen to be from {touches[0]:.3f} to {touches[1]:.3f} s."
)
fp.plots.save_figure(fp.plots.plot_observed(result, truth, width="page"), FOLDER / "observed_touch.png")
