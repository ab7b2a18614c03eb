"""How do I spread a study over the workers of a cluster?

How well a finger tracks, over the gain of its controller and the friction of its tendons, in the two processes of a
local Dask cluster; Client("tcp://HOST:8786") in place of LocalCluster reaches a real one. Needs the
extra dask. Run it: python scripts/examples/sweep_on_dask.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

from dask.distributed import Client, LocalCluster

import finger_pin as fp

OVER = {
    "controller.gain": [0.5, 1.0, 2.0, 4.0],  # N m/rad
    "finger.tendon_friction.coulomb": [0.03, 0.06, 0.12, 0.24],
}


def main(folder):
    """Run the study and draw its map."""
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:
        workers = client.ncores()
        study = fp.sweep(
            "reversals",
            OVER,
            metrics=["tracking_rms", "tension_peak"],
            overrides={"simulation.duration": 1.0},
            executor=client.get_executor(pure=False),
        )
    best = study.tracking_rms.where(study.tracking_rms == study.tracking_rms.min(), drop=True).squeeze()
    print(
        f"{study.tracking_rms.size} runs by {len(workers)} processes. Best tracking, {1e3 * float(best):.1f} mrad rms, "
        f"is at gain {float(best['controller.gain']):g} and friction {float(best['finger.tendon_friction.coulomb']):g}."
    )
    fp.plots.save_figure(fp.plots.plot_sweep(study), folder / "sweep_on_dask.png")
    return study


if __name__ == "__main__":  # workers import this file
    study = main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples"))
