"""Processes that simulate side by side on this machine: how many, and how to start them."""

from __future__ import annotations

import multiprocessing
import multiprocessing.forkserver
import os
from collections.abc import Iterator
from contextlib import contextmanager

from finger_pin.core.compilation import CACHE_FOLDER

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
        with single_threaded():
            # Its processes have the environment in which it was started.
            multiprocessing.forkserver.ensure_running()
        return context
    return multiprocessing.get_context("spawn")


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let processes that are started meanwhile use one thread each."""
    earlier = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in earlier.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
