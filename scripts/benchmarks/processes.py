"""The main job as a person runs it: scripts/simulate.py in a new process, with an empty and with a warm cache."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.store import Store, say

_SCRIPT = Path(__file__).resolve().parents[1] / "simulate.py"
_LATER = 3
_KIB = 1024
# A new process counts the memory of the one that it was forked from as its own: a small one starts the job.
_MEASURE = """
import resource, subprocess, sys, time
began = time.perf_counter()
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
elapsed = time.perf_counter() - began
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print(elapsed, usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(code)
"""


def measure(store: Store) -> dict[str, Any]:
    """Return wall times and peak memory."""
    return store.part("main-job", lambda: _study(["--duration", "0.5"] if store.quick else []))


def _study(options: list[str]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        runs = []
        for index in range(1 + _LATER):
            runs.append(_run(options, Path(folder)))
            say(f"  {'first' if index == 0 else 'later'} run: {runs[-1]['wall_time']:.1f} s")
    first, later = runs[0], min(runs[1:], key=lambda run: run["wall_time"])
    return {
        "options": options,
        "first": first["wall_time"],
        "first_processor_time": first["processor_time"],
        "first_memory": first["memory"],
        "later": later["wall_time"],
        "later_processor_time": later["processor_time"],
        "later_memory": max(run["memory"] for run in runs[1:]),
    }


def _run(options: list[str], folder: Path) -> dict[str, float]:
    """Run the script to its end; return its wall and processor times, s, and its peak memory, bytes."""
    command = [sys.executable, str(_SCRIPT), *options, "--quiet", "--output", str(folder / "results")]
    environment = {**os.environ, "FINGER_PIN_CACHE_DIR": str(folder / "cache")}
    measured = [sys.executable, "-S", "-c", _MEASURE, *command]
    done = subprocess.run(measured, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"simulate.py ended with exit code {done.returncode}")
    wall_time, processor_time, memory = map(float, done.stdout.split()[-3:])
    # Linux counts in KiB, macOS in bytes.
    unit = 1 if sys.platform == "darwin" else _KIB
    return {"wall_time": wall_time, "processor_time": processor_time, "memory": memory * unit}
