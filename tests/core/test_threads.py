"""Cores that threads may use, as the system tells them."""

import os

import pytest

from finger_pin.core import threads


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
