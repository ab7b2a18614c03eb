"""Threads for tasks that release the GIL, and the memory of the machine."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import ceil, inf
from pathlib import Path
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


# In a container of Linux: time that all its processes may use, and in which time, us.
_CPU_MAX = Path("/sys/fs/cgroup/cpu.max")


def usable_cores() -> int:
    """Return the number of cores that this process may use, limited by a container's quota."""
    # Only Linux binds processes to cores.
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, ceil(min(bound, _share())))


@cache
def _share() -> float:
    """Return the number of cores that a container's limit of time allows; infinite without a limit."""
    try:
        time, period = _CPU_MAX.read_text().split()
        return float(time) / float(period)
    except (OSError, ValueError, ZeroDivisionError):
        return inf


def threads() -> int:
    """Return the maximum number of threads of `in_threads`."""
    return usable_cores() if threading.current_thread() is threading.main_thread() else 1


def in_threads(task: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Return the results of a task that releases the GIL, done for all items side by side, in their order.

    Only what the main thread does is spread: who runs many at once has no core to spare.
    """
    workers = min(len(items), threads())
    if workers < 2:
        return [task(item) for item in items]
    results: dict[int, _Result] = {}
    # Whoever is free takes the next one.
    left = iter(range(len(items)))

    def work() -> None:
        for index in left:
            results[index] = task(items[index])

    others = [pool().submit(work) for _ in range(workers - 1)]
    try:
        work()
    finally:
        # Whose turn has not come has nothing left to do. Cheaper than `concurrent.futures.wait` by a short task's time.
        failures = [other.exception() for other in others if not other.cancel()]
    for failure in failures:
        if failure is not None:
            raise failure
    return [results[index] for index in range(len(items))]


@cache
def pool() -> ThreadPoolExecutor:
    """Return the persistent thread pool, since starting threads takes longer than many tasks."""
    return ThreadPoolExecutor(usable_cores(), "finger_pin")


if hasattr(os, "register_at_fork"):
    # A forked process has none of the threads.
    os.register_at_fork(after_in_child=pool.cache_clear)


def physical_memory() -> float:
    """Return the size of the machine's memory, bytes; infinite where the system does not tell."""
    return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else inf


def wait_for(thread: threading.Thread, close: Callable[[], None]) -> None:
    """Wait until a thread has ended; if the user interrupts (Ctrl-C), call a function that ends it."""
    try:
        while thread.is_alive():
            thread.join(0.2)
    except KeyboardInterrupt:
        close()
