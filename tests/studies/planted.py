"""Metrics that misbehave, in a module that worker processes can import."""

import os
import signal
import time
from pathlib import Path

from finger_pin.exceptions import IntegrationError
from finger_pin.studies import Metric


def gain(run):
    """The gain itself, which needs no simulation."""
    return float(run.scenario.controller.gain)


def cheap(run):
    return gain(run)


def dear(run):
    return 1.0 / gain(run)


def slow_gain(run):
    time.sleep(0.15)
    return gain(run)


def dies_at_two(run):
    if gain(run) == 2.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return gain(run)


def dies_once_at_two(run):
    """Die unless an earlier attempt has left a mark in the folder that the scenario's title names."""
    mark = Path(run.scenario.title, "mark")
    if gain(run) == 2.0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return gain(run)


def raises_at_two(run):
    if gain(run) == 2.0:
        raise ArithmeticError("planted\nin two lines")
    return gain(run)


def stops_at_two(run):
    if gain(run) == 2.0:
        raise IntegrationError(0.01, "the step is too small", "a smaller simulation.rtol", run.result)
    return gain(run)


GAIN, CHEAP, DEAR, SLOW, DIES, DIES_ONCE, RAISES, STOPS = (
    Metric(function.__name__, "N m/rad", "planted", function)
    for function in (gain, cheap, dear, slow_gain, dies_at_two, dies_once_at_two, raises_at_two, stops_at_two)
)


def tripled(number, stop):
    return 3 * number


def count(number, stop, seen):
    """Return how many tasks have been given the same list."""
    seen.append(number)
    return len(seen)


def raises(number, stop):
    raise ArithmeticError(f"planted\n{number}")


def waits_to_be_stopped(number, stop, folder):
    """Wait for a stop, at most half a minute, between two marks."""
    Path(folder, f"begun{number}").touch()
    for _ in range(3000):
        if stop():
            Path(folder, f"stopped{number}").touch()
            return
        time.sleep(0.01)
