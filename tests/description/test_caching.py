"""What is remembered: the same thing for the same parts, up to a number of things, also in a forked process."""

import copy
import gc
import os
import pickle
import signal
import threading
import time
import weakref

import pytest

import finger_pin as fp
from finger_pin.description.caching import memoised


class Thing:
    """It holds what it is given."""

    def __init__(self, other=None):
        """Hold a thing."""
        self.other = other


def remembering(most=32):
    """Return a function of a number, and of how to make what belongs to it, that remembers the latest values."""
    return memoised(lambda number, make: (number,), most)(lambda number, make: make())


def test_the_same_parts_have_the_same_thing_and_those_used_last_stay():
    known = remembering(3)
    made = [known(number, Thing) for number in range(3)]
    assert known(0, Thing) is made[0]
    known(3, Thing)
    assert all(known(number, Thing) is made[number] for number in (0, 2))
    assert known(1, Thing) is not made[1]


@pytest.mark.slow
def test_no_more_live_than_are_remembered_and_nothing_else_of_a_call_does():
    living, arguments, known = weakref.WeakSet(), weakref.WeakSet(), remembering(5)

    def maker():
        other = Thing()
        arguments.add(other)

        def make():
            thing = Thing() if other else None
            living.add(thing)
            return thing

        return make

    for number in range(50):
        known(number, maker())
    gc.collect()
    assert (len(living), len(arguments)) == (5, 0)


def test_descriptions_are_told_apart_by_identity_also_when_one_has_gone():
    """A description that is freed leaves its address to the next one."""
    known = memoised(lambda description: (description,))(lambda description: description.name)
    for number in range(100):
        description = fp.load_finger("ub").updated(name=f"finger{number}")
        assert known(description) == f"finger{number}"
        del description


def test_what_follows_from_a_description_is_held_once_and_not_by_changed_copies_and_pickles():
    finger = fp.load_finger("ub")
    assert finger.numbers is finger.numbers and finger.bodies is finger.bodies
    changed = finger.updated(tendon_friction={"coulomb": 0.3})
    assert changed.numbers["tendon_friction"]["coulomb"].tolist() == [0.3] * len(finger.tendons)
    assert changed == finger.updated(tendon_friction={"coulomb": 0.3}) and changed != finger
    assert changed.numbers["joint_friction"] is finger.numbers["joint_friction"]
    for same in (pickle.loads(pickle.dumps(finger)), copy.copy(finger)):
        assert vars(same).keys() == type(finger).model_fields.keys() and same == finger


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_process_that_is_forked_while_a_thread_remembers_remembers_too():
    inside, known = threading.Event(), remembering()

    def slow():
        inside.set()
        time.sleep(0.2)

    thread = threading.Thread(target=lambda: known(0, slow))
    thread.start()
    inside.wait(120.0)
    child = os.fork()
    if not child:
        signal.alarm(120)
        known(1, Thing)
        known(0, Thing)
        os._exit(0)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
