"""My sweep was killed. Is what it had computed lost?

A sweep runs in a process of its own, which is killed in the middle; the same call then does what is left. Run it:
python scripts/examples/kill_and_resume.py [FOLDER FOR THE PICTURE]
"""

import shutil
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
STUDY = FOLDER / "kill_and_resume"
GAINS = [round(float(gain), 3) for gain in np.geomspace(0.3, 6.0, 16)]  # N m/rad


def records():
    """Return the lines of the file that keeps a line for every finished run."""
    path = STUDY / "runs.jsonl"
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


shutil.rmtree(STUDY, ignore_errors=True)
over = f"controller.gain={','.join(map(str, GAINS))}"
command = [sys.executable, "-m", "finger_pin", "sweep", "reversals", "--over", over, "--metric", "tracking_rms"]
process = subprocess.Popen([*command, "--workers", "1", "--quiet", "--output", str(STUDY)])
while len(records()) < 5 and process.poll() is None:
    time.sleep(0.01)
process.kill()
process.wait()
kept = records()

told = []
study = fp.sweep(
    "reversals",
    {"controller.gain": GAINS},
    metrics=["tracking_rms"],
    output=STUDY,
    progress=lambda finished, failed, total: told.append(finished),
)
print(
    f"Killed after {len(kept)} of {len(GAINS)} runs: the same call began with {told[0]} and did {len(GAINS) - told[0]}."
)

plt.style.use("finger_pin.views.plots.finger_pin")
figure, axes = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
for part, name in ((slice(None, told[0]), "before it was killed"), (slice(told[0], None), "after")):
    axes.plot(GAINS[part], 1e3 * study.tracking_rms[part], "o", markersize=4.0, label=name)
axes.set(xlabel="gain (N m/rad)", ylabel="tracking error (mrad rms)")
axes.legend()
figure.savefig(FOLDER / "kill_and_resume.png")
