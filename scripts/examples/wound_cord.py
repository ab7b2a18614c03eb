"""One cord bends three joints: why does the last one hold when the cord is let out?

A servo winds a cord in and lets it out again; the cord rubs at each of its bends. Run it:
python scripts/examples/wound_cord.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import numpy as np

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")

plain = {"finger.tendon_friction.stiction_ratio": 1.0, "finger.tendon_friction.viscous": 0.0}  # Coulomb friction alone
result = fp.simulate(fp.load_scenario("wound", plain))
entering = result.spool_tension.sel(tendon="flexor")  # N
arriving = result.wrap_tension.sel(wrap="flexor.dip")  # N, behind the last of three bends
angles = np.rad2deg(result.joint_position)
shares = {}
for time, doing in ((1.5, "While the cord is wound in"), (4.0, "While it is let out")):
    now = result.time.sel(time=time, method="nearest")
    shares[time] = float(arriving.sel(time=now) / entering.sel(time=now))
    first, last = (float(angles.sel(time=now, joint=joint)) for joint in ("mcp", "dip"))
    print(
        f"{doing}, {shares[time]:.2f} of its tension reaches the last joint; "
        f"mcp is at {first:.0f} deg, dip at {last:.0f} deg."
    )

fp.plots.save_figure(fp.plots.plot_bends(result, titles=False), FOLDER / "wound_cord.png")
