"""Measure the simulator: time against error, against MuJoCo, in steps, in many runs, and as a main job.

Every part is saved as soon as it is measured, and an interrupted benchmark goes on from there; parts are measured anew
when the code has changed. Times are the least of several turns that the compared jobs take in alternation, and ratios
are of times from one run. Run it on a quiet machine.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from command_line import DONE, INTERRUPTED, NOT_WRITTEN, Parser, complain

PROGRAM = "benchmark.py"
PACKAGES = ("finger-pin", "numpy", "scipy", "numba", "pin", "mujoco", "scikit-sundae")
STAGES = ("work-precision", "step-interface", "joints", "mujoco", "many-runs", "main-job")


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write; return the exit code."""
    options = parse(arguments)
    from benchmarks.store import Store, say, write

    try:
        options.output.mkdir(parents=True, exist_ok=True)
        store = Store(options.output, options.quick, options.fresh)
        around = surroundings()
        stages = {}
        for name in options.only:
            stages[name] = stage(name).measure(store)
            if stages[name] is None:
                say(f"{name}: left out, what it needs is not installed")
        from benchmarks import report
        from benchmarks.targets import targets

        reached = targets(stages)
        lines = report.text(stages, reached, options.quick)
        whole = {"surroundings": around, "quick": options.quick, "stages": stages}
        whole["targets"] = [each._asdict() for each in reached]
        write(options.output / "benchmark.json", json.dumps(whole, indent=1))
        write(options.output / "benchmark.txt", lines)
        draw(stages, options.output)
    except KeyboardInterrupt:
        complain(PROGRAM, f"interrupted; what was measured is in {options.output}")
        return INTERRUPTED
    except OSError as error:
        complain(PROGRAM, f"{options.output}: cannot be written: {error.strerror or error}")
        return NOT_WRITTEN
    from finger_pin.commands.console import print_text

    print_text(f"{lines}\n\nResults are in {options.output}")
    return DONE


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Parse a command line, or exit."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    parser.add_argument("--quick", action="store_true", help="shorter and fewer runs, to see that all works")
    parser.add_argument("--only", type=chosen, default=STAGES, metavar="STAGES", help=f"of {','.join(STAGES)}")
    parser.add_argument("--fresh", action="store_true", help="measure every part anew")
    parser.add_argument(
        "--output", type=Path, default=Path("results/benchmark"), metavar="DIR", help="default %(default)s"
    )
    return parser.read(arguments)


def chosen(names: str) -> tuple[str, ...]:
    """Parse names of stages with commas between; keep their usual order."""
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in STAGES:
            raise argparse.ArgumentTypeError(f"{name}: no such stage; there are {', '.join(STAGES)}")
    return tuple(name for name in STAGES if name in wanted)


def stage(name: str) -> Any:
    """Return the module of a stage."""
    from benchmarks import chains, many, mujoco_loop, processes, stepping, work_precision

    modules = (work_precision, stepping, chains, mujoco_loop, many, processes)
    return dict(zip(STAGES, modules, strict=True))[name]


def surroundings() -> dict[str, Any]:
    """Return what the times depend on besides the code."""
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


if __name__ == "__main__":
    sys.exit(main())
