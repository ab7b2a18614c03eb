"""This machine: how many of its cores may be used, and how processes start on it."""

from __future__ import annotations

import multiprocessing
import multiprocessing.forkserver
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from finger_pin.core.compilation import CACHE_FOLDER, is_cached

#: Variable of the environment: whether the server that processes are copied from loads compiled code.
WARM = "FINGER_PIN_WARM"
# Matrices of a finger are too small for several threads to help, and the cores are taken by the processes.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        # Only Linux binds processes to cores.
        return os.cpu_count() or 1


def process_context() -> multiprocessing.context.BaseContext:
    """Return how to start processes: from a clean server where the cache serves them, else as copies of this one.

    The server begins to start at once, so that it is there when processes are.
    """
    methods = multiprocessing.get_all_start_methods()
    if CACHE_FOLDER is None and "fork" in methods:
        return multiprocessing.get_context("fork")
    if "forkserver" in methods:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["finger_pin.studies.preloaded"])
        # Its processes have the environment in which it was started. What is not compiled yet is compiled here, once.
        with _environment({**dict.fromkeys(_THREADS, "1"), WARM: "1" if is_cached() else "0"}):
            multiprocessing.forkserver.ensure_running()
        return context
    return multiprocessing.get_context("spawn")


@contextmanager
def _environment(entries: Mapping[str, str]) -> Iterator[None]:
    """Give processes that are started meanwhile other variables of the environment."""
    earlier = {name: os.environ.get(name) for name in entries}
    os.environ.update(entries)
    try:
        yield
    finally:
        for name, value in earlier.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
