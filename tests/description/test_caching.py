"""What is remembered: the same thing for the same parts, within a bound in bytes, also in a forked process."""

import os
import signal
import threading
import time
import weakref

import numpy as np
import pytest

from finger_pin.description.caching import LIMIT, memoised

MEGABYTE = 2**20


class Thing:
    """It holds an array, or what else it is given."""

    def __init__(self, size=0, other=None):
        """Hold so many bytes."""
        self.numbers, self.other = np.zeros(size, dtype=np.uint8), other


def remembering(most=128):
    """Return a function of a number, and of how to make what belongs to it, that remembers the latest values."""
    return memoised(lambda number, make: (number,), most)(lambda number, make: make())


def test_the_same_parts_have_the_same_thing_and_the_latest_ones_stay():
    known = remembering(3)
    made = [known(number, Thing) for number in range(5)]
    assert all(known(number, Thing) is made[number] for number in (2, 3, 4))
    assert known(0, Thing) is not made[0]


def test_all_that_is_remembered_has_one_bound_in_bytes():
    """Of 200 arrays of a megabyte in two places as many live as the bound has megabytes, the latest of both."""
    places, living = [remembering(1024), remembering(1024)], weakref.WeakSet()

    def made():
        thing = Thing(MEGABYTE)
        living.add(thing)
        return thing

    for number in range(100):
        for place in places:
            place(number, made)
    most = LIMIT // MEGABYTE
    assert 0.75 * most <= len(living) <= most
    kept = len(living)
    for place in places:
        place(99, made)
    assert len(living) == kept


def test_what_is_larger_than_the_bound_is_remembered_until_the_next_comes():
    known = remembering()
    large = known(0, lambda: Thing(LIMIT + 1))
    assert known(0, Thing) is large
    known(1, Thing)
    assert known(0, Thing) is not large


def test_what_many_share_counts_once():
    """Fifty things that refer to one of half the bound would be 25 times the bound together."""
    large, small = remembering(), remembering()
    shared = large(0, lambda: Thing(LIMIT // 2))
    made = [small(number, lambda: Thing(other=shared)) for number in range(50)]
    assert large(0, Thing) is shared
    assert all(small(number, Thing) is each for number, each in enumerate(made))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_process_that_is_forked_while_a_thread_remembers_remembers_too():
    inside, known = threading.Event(), remembering()

    class Slow:
        def __sizeof__(self):
            inside.set()
            time.sleep(0.2)
            return 0

    thread = threading.Thread(target=lambda: known(0, Slow))
    thread.start()
    inside.wait(120.0)
    child = os.fork()
    if not child:
        signal.alarm(120)
        known(1, Thing)
        os._exit(0)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
