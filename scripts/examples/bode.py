"""How do I get a linear model of a finger into python-control, and is it right?

The planar finger at rest, held by three tendons: from the tension of one to the angle of a joint. At rest friction is a
stiff spring; of a finger that slides only viscous friction is left. Runs with small tensions over time stand beside the
curve. Needs the extra examples. Run it: python scripts/examples/bode.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
POSTURE, TENSION = np.array([0.5, 0.6]), np.array([3.73, 3.07, 3.0])  # rad, N: what holds it there
TENDON, JOINT, AMPLITUDE = "flexor_distal", "joint_position.distal", 1e-3  # N, within which bristles are linear


def system(lin, states):
    """Return the model with some of the states, from the tendon's tension to the joint's angle, in rad/N."""
    a, c = lin.A.sel(state=states, by_state=states), lin.C.sel(output=[JOINT], by_state=states)
    return control.ss(a, lin.B.sel(state=states, input=[f"tendon_command.{TENDON}"]), c, 0.0)


def simulated(frequency):
    """Return the amplitude of the angle over that of the tension in a run of 30 periods, rad/N."""
    sine = {"frequency": frequency, "amplitude": AMPLITUDE}
    tensions = {name: {"offset": float(each)} for name, each in zip(finger.routing.tendons, TENSION, strict=True)}
    scenario = fp.Scenario.model_validate(
        {
            "name": "shaken",
            "finger": finger.description,
            "controller": {"kind": "tensions", "tensions": tensions | {TENDON: tensions[TENDON] | sine}},
            "simulation": {"duration": 30.0 / frequency, "sample_rate": 50.0 * frequency, "rtol": 1e-9},
        }
    )
    angle = fp.simulate(scenario, initial=finger.rest_state(POSTURE)).joint_position.sel(joint="distal")
    late = angle[-500:]  # ten periods: what the start has excited is gone
    phase = 2.0 * np.pi * frequency * late.time.values
    waves = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(phase)])
    return np.hypot(*np.linalg.lstsq(waves, late.values, rcond=None)[0][:2]) / AMPLITUDE


finger = fp.Finger("planar")
lin = fp.linearise(finger, finger.rest_state(POSTURE), TENSION)
moving = [name for name in lin.state.values if name.startswith(("joint_position", "joint_velocity"))]
at_rest, sliding = system(lin, list(lin.state.values)), system(lin, moving)
frequencies, tried = np.geomspace(10.0, 1000.0, 300), np.geomspace(20.0, 800.0, 6)  # Hz
gain = abs(at_rest(2.0j * np.pi * frequencies))
runs, linear = np.array([simulated(each) for each in tried]), abs(at_rest(2.0j * np.pi * tried))
worst = 100.0 * abs(runs / linear - 1.0).max()
print(
    f"At rest {1e6 * gain[0]:.0f} microradians per newton, resonance at {frequencies[gain.argmax()]:.0f} Hz; "
    f"runs differ from the linear model by at most {worst:.1f} %."
)

plt.style.use("finger_pin.views.plots.finger_pin")
figure, axes = plt.subplots(2, figsize=(6.0, 4.6), sharex=True, layout="constrained")
for model, name in ((at_rest, "at rest"), (sliding, "sliding")):
    magnitude, phase, _ = control.frequency_response(model, 2.0 * np.pi * frequencies)
    axes[0].loglog(frequencies, magnitude, label=name)
    axes[1].semilogx(frequencies, np.rad2deg(np.unwrap(phase)))
axes[0].plot(tried, runs, "k.", label="runs of 1 mN")
axes[0].set_ylabel("gain (rad/N)")
axes[1].set(ylabel="phase (deg)", xlabel="frequency (Hz)")
axes[0].legend()
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "bode.png")
