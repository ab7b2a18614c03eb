"""The main job as a person runs it: scripts/simulate.py in a new process, with an empty and with a warm cache."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.store import Store, say

_SCRIPT = Path(__file__).resolve().parents[1] / "simulate.py"
_LATER = 3
_KIB = 1024


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
    began = time.perf_counter()
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    elapsed = time.perf_counter() - began
    if process.returncode:
        raise RuntimeError(f"simulate.py ended with exit code {process.returncode}")
    # Linux counts in KiB, macOS in bytes.
    unit = 1 if sys.platform == "darwin" else _KIB
    return {"wall_time": elapsed, "processor_time": usage.ru_utime + usage.ru_stime, "memory": usage.ru_maxrss * unit}
