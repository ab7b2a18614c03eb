"""I have measured what my tendon loses. How does that get into a simulation?

Sixty real readings of two load cells, force in and force out of a tendon that is drawn through a half turn, give its
friction with intervals; the simulation then runs with these. Run it:
python scripts/examples/measured_friction.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")

# A bench that ships: a scenario with a table [identify], and a CSV file beside it.
BENCH = Path(fp.__file__).parent / "description" / "benches" / "transmission.toml"
found = fp.identify(BENCH)
measured = {str(name): float(found.estimate.sel(parameter=name)) for name in found.parameter.values}
for name, value in measured.items():
    low, high = (float(found[end].sel(parameter=name)) for end in ("lower", "upper"))
    print(f"{name} = {value:.4f}, 95 % interval {low:.4f} to {high:.4f}")

smooth, rough = fp.simulate("reversals"), fp.simulate(fp.load_scenario("reversals", measured))
peaks = [float(each.tendon_command.max()) for each in (smooth, rough)]
print(f"With the measured friction reversals pulls with up to {peaks[1]:.1f} N in place of {peaks[0]:.1f} N.")

# What the fit says of the bench: the capstan law over a half turn, less the drag.
coulomb, drag = measured.values()
kept = np.exp(-coulomb * np.pi)
readings = np.genfromtxt(BENCH.with_suffix(".csv"), delimiter=",", names=True, comments="#")
loads = np.array([0.0, readings["force_in_N"].max()])  # N
plt.style.use("finger_pin.views.plots.finger_pin")
figure, (bench, finger) = plt.subplots(1, 2, figsize=(8.0, 3.4), layout="constrained")
bench.plot(loads, loads, color="0.6", linewidth=1.0, label="no friction")
bench.plot(loads, kept * loads - 0.5 * (1.0 + kept) * drag, color="C1", label="fit")
bench.plot(readings["force_in_N"], readings["force_out_N"], ".", alpha=0.5, label="60 readings")
bench.set(xlabel="force in (N)", ylabel="force out (N)", xlim=(0.0, None), ylim=(0.0, None))
for result, name in ((smooth, "as the paper has it"), (rough, "as measured")):
    finger.plot(result.time, result.tendon_command.sel(tendon="T3"), label=name)
finger.set(xlabel="time (s)", ylabel="command of T3 in reversals (N)")
finger.set_ylim(0.0, 24.0)
for axes in (bench, finger):
    axes.legend(loc="upper left")
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "measured_friction.png")
