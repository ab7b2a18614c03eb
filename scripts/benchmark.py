"""Measure the simulator: time against error, against MuJoCo, in steps, in many runs, and as a main job."""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from finger_pin.commands.application import run_function
from finger_pin.commands.console import error_note, print_text
from finger_pin.commands.options import Output, invalid
from finger_pin.files import write_text

PACKAGES = ("finger-pin", "numpy", "scipy", "numba", "pin", "mujoco", "mujoco-warp", "scikit-sundae")
#: The stages in their order, and the module of each.
STAGES = {
    "work-precision": "work_precision",
    "step-interface": "stepping",
    "joints": "chains",
    "growth": "growth",
    "hand": "hands",
    "contact": "contacts",
    "mujoco": "mujoco_loop",
    "mujoco-friction": "mujoco_friction",
    "mujoco-warp-friction": "mujoco_warp_friction",
    "learning": "learning",
    "prepared": "prepared",
    "identification": "identification",
    "many-runs": "many",
    "main-job": "processes",
}


def benchmark(
    quick: Annotated[bool, typer.Option("--quick", help="Shorter and fewer runs, to see that all works.")] = False,
    only: Annotated[str, typer.Option(metavar="STAGES", help=f"Some of {','.join(STAGES)}.")] = ",".join(STAGES),
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure every part anew.")] = False,
    output: Output = Path("results/benchmark"),
) -> None:
    """Measure the simulator: time against error, against MuJoCo, in steps, in many runs, and as a main job.

    Every part is saved as soon as it is measured, and an interrupted benchmark continues there; parts are measured
    anew when the code has changed. Times are the least of several turns that the compared jobs take in alternation, and
    ratios are of times from one run. Run it on a quiet machine.
    """
    names, begun = chosen(only), time.monotonic()
    from benchmarks.store import Store, say

    output.mkdir(parents=True, exist_ok=True)
    with error_note(f"what was measured is in {output}"):
        store = Store(output, quick, fresh)
        around = machine()
        stages = {}
        for name in names:
            stages[name] = stage(name).measure(store)
            if stages[name] is None:
                say(f"{name}: left out, what it needs is not installed")
        from benchmarks import report
        from benchmarks.targets import targets

        reached = targets(stages)
        lines = report.text(stages, reached, quick)
        whole = {"machine": around, "quick": quick, "stages": stages}
        whole["targets"] = [each._asdict() for each in reached]
        write_text(output / "benchmark.json", json.dumps(whole, indent=1) + "\n")
        write_text(output / "benchmark.txt", lines + "\n")
        draw(stages, output)
    print_text(f"{lines}\n\nMeasured in {(time.monotonic() - begun) / 60.0:.1f} min. Results are in {output}")


def chosen(names: str) -> tuple[str, ...]:
    """Parse names of stages with commas between; keep their usual order."""
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in STAGES:
            raise invalid("--only", f"{name}: no such stage; there are {', '.join(STAGES)}")
    return tuple(name for name in STAGES if name in wanted)


def stage(name: str) -> Any:
    """Return the module of a stage."""
    return import_module(f"benchmarks.{STAGES[name]}")


def machine() -> dict[str, Any]:
    """Return the circumstances of the times: processor, system, versions."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg(),
        "system": platform.system(),
        "python": platform.python_version(),
        "versions": versions,
    }


def processor() -> str:
    """Return the processor's name as far as the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def draw(stages: dict[str, Any], folder: Path) -> None:
    """Write the figures of the stages that have some."""
    from benchmarks import report

    from finger_pin.views.plots import save_figure

    if stages.get("work-precision"):
        save_figure(report.plot_work_precision(stages["work-precision"]), folder / "work_precision.png")
    if stages.get("joints"):
        save_figure(report.plot_joints(stages["joints"]), folder / "joints.png")


main = partial(run_function, benchmark)

if __name__ == "__main__":
    sys.exit(main())
