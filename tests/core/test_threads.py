"""Cores that threads may use, as the system tells them."""

import multiprocessing
import os
import threading

import pytest

from finger_pin import threads
from finger_pin.description.caching import cached_property


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes are bound to cores on Linux alone")
@pytest.mark.parametrize(
    ("told", "cores"), [("max 100000", 8), ("250000 100000", 3), ("50000 100000", 1), ("900000 100000", 8), (None, 8)]
)
def test_a_container_with_less_time_than_cores_uses_as_many_as_its_time_is_worth(monkeypatch, tmp_path, told, cores):
    """As Linux writes it: time and period, us (cgroup v2, cpu.max)."""
    if told is not None:
        (tmp_path / "cpu.max").write_text(told + "\n")
    monkeypatch.setattr(threads, "_CPU_MAX", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    threads._share.cache_clear()
    try:
        assert threads.usable_cores() == cores
    finally:
        threads._share.cache_clear()


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(threads, "usable_cores", lambda: 2)
    threads.pool.cache_clear()
    yield
    threads.pool.cache_clear()


def test_tasks_go_on_side_by_side_and_return_in_order(two_cores):
    """Two that wait for each other end only if both are under way."""
    both = threading.Barrier(2, timeout=120.0)

    def task(number):
        if number < 2:
            both.wait()
        return number**2

    assert threads.in_threads(task, range(40)) == [number**2 for number in range(40)]
    with pytest.raises(ZeroDivisionError):
        threads.in_threads(lambda number: 1 // (number - 30), range(40))


def _squares(count):
    return threads.in_threads(lambda number: number**2, range(count))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(two_cores):
    assert _squares(3) == [0, 1, 4]
    with multiprocessing.get_context("fork").Pool(1) as processes:
        assert processes.apply_async(_squares, (5,)).get(timeout=120.0) == [0, 1, 4, 9, 16]


def _ends(work):
    """Return whether a thread comes to its end."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(30.0)
    return not thread.is_alive()


def test_a_property_waits_for_threads_that_compute_the_same_property_of_others(two_cores, monkeypatch):
    """Before Python 3.12 that of `functools` has one lock for all objects, which would keep the other thread out."""
    monkeypatch.setattr(threads, "threads", lambda: 2)
    both = threading.Barrier(2, timeout=60.0)

    class Node:
        def __init__(self, *parts):
            self.parts = parts

        @cached_property
        def number(self):
            return sum(threads.in_threads(count, self.parts)) if self.parts else 1

    def count(part):
        both.wait()
        return part.number

    values = []
    assert _ends(lambda: values.append(Node(Node(), Node()).number))
    assert values == [2]


def test_only_tasks_that_are_under_way_are_waited_for(two_cores, monkeypatch):
    """Threads that are busy with what others have asked for hold up nobody who can do without them."""
    monkeypatch.setattr(threads, "threads", lambda: 2)
    end = threading.Event()
    busy = [threads.pool().submit(end.wait, 120.0) for _ in range(2)]
    try:
        assert _ends(lambda: threads.in_threads(abs, [1, 2, 3]))
    finally:
        end.set()
    assert all(each.result() for each in busy)


def test_of_two_threads_that_compute_a_property_the_first_one_counts():
    together = threading.Barrier(2, timeout=60.0)

    class Made:
        @cached_property
        def thing(self):
            together.wait()
            return object()

    made, seen = Made(), []
    others = [threading.Thread(target=lambda: seen.append(made.thing)) for _ in range(2)]
    for each in others:
        each.start()
    for each in others:
        each.join()
    assert seen[0] is seen[1] is made.thing


class _Slow:
    """Computed by a thread that waits for an event."""

    computing, end = threading.Event(), threading.Event()

    @cached_property
    def number(self):
        self.computing.set()
        return 7 if threading.current_thread() is threading.main_thread() else self.end.wait(120.0)


def _number():
    return _Slow().number


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_process_forked_while_a_thread_computes_waits_for_no_lock_of_that_thread():
    """A property with a lock for all objects would be locked in the new process for ever."""
    other = threading.Thread(target=_number)
    other.start()
    assert _Slow.computing.wait(120.0)
    try:
        with multiprocessing.get_context("fork").Pool(1) as processes:
            assert processes.apply_async(_number).get(timeout=120.0) == 7
    finally:
        _Slow.end.set()
        other.join()
