"""Does the grasp hold, and how hard do the fingers press?

A hand of five tendon-driven fingers closes on a cylinder of 150 g, lifts it off a table and turns its palm up. Run it:
python scripts/examples/grasp.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

import finger_pin as fp

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")

result = fp.simulate("grasp")
world = fp.in_world(result)  # as seen from the room, not from the palm
height = 100.0 * world.object_position.sel(object="cylinder", axis="z")  # cm
squeeze = {}  # N, of each finger on the cylinder
for finger in ("thumb", "index", "middle", "ring", "little"):
    pairs = [name for name in result.contact.values if name.startswith(finger) and "-cylinder" in name]
    squeeze[finger] = result.contact_normal_force.sel(contact=pairs).sum("contact")
pairs = [name for name in result.contact.values if "-cylinder" in name]
carried = world.contact_force.sel(contact=pairs).sum("contact")  # N, on the cylinder
hardest = max(squeeze, key=lambda finger: float(squeeze[finger].max()))
print(
    f"The cylinder ends {float(height[-1] - height[0]):.1f} cm higher, carried by {float(carried[-1, 2]):.3f} N; "
    f"the {hardest} presses hardest, with up to {float(squeeze[hardest].max()):.1f} N."
)

plt.style.use("finger_pin.views.plots.finger_pin")
figure, (top, bottom) = plt.subplots(2, figsize=(7.0, 4.4), sharex=True, layout="constrained")
for finger, force in squeeze.items():
    top.plot(result.time, force, label=finger)
top.plot(result.time, carried.sel(axis="z"), "k:", label="carried, upwards")
top.set_ylabel("force on the cylinder (N)")
top.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
bottom.plot(result.time, height - height[0])
bottom.set(ylabel="cylinder, lifted (cm)", xlabel="time (s)")
for axes in (top, bottom):
    for start, end in ((0.02, 0.3), (0.5, 1.1), (1.2, 1.6)):
        axes.axvspan(start, end, color="0.94", zorder=0)
for middle, text in ((0.16, "close"), (0.8, "lift"), (1.4, "turn")):
    bottom.text(middle, 1.0, text, ha="center")
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "grasp.png")
