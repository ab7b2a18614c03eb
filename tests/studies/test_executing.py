"""Executors: what is given to them comes back once, whatever they are; stops, and scripts without a guard."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import planted
import pytest

import finger_pin as fp
from finger_pin.studies.executing import Crew, Lost


def never():
    return False


class Serial:
    """The least that an executor is: it does all at once, in the present thread."""

    def submit(self, function, *arguments):
        found = Future()
        found.set_result(function(*arguments))
        return found


@pytest.fixture(params=[None, "threads", "processes", "own"])
def crew(request):
    made = {"threads": ThreadPoolExecutor, "processes": ProcessPoolExecutor}.get(request.param)
    executor = Serial() if request.param == "own" else made and made(2)
    with Crew(executor) as crew:
        yield crew
    if made:
        executor.shutdown()


def test_every_item_is_done_once_and_comes_with_its_index_by_any_executor(crew):
    found = list(crew.do(planted.tripled, range(20), never))
    assert sorted(found) == [(number, 3 * number) for number in range(20)]
    factor = 5
    assert dict(crew.do(lambda number, stop: factor * number, [2], never)) == {0: 10}


def test_what_raises_is_told_in_one_line_and_the_others_go_on():
    with Crew(workers=2) as crew:
        (lost,) = dict(crew.do(planted.raises, [7], never)).values()
        assert isinstance(lost, Lost) and lost.reason == "ArithmeticError: planted 7" and not lost.undone
        assert dict(crew.do(planted.tripled, [7], never)) == {0: 21}


def test_a_stop_ends_what_runs_in_threads_and_leaves_the_rest():
    begun, ended = [], threading.Event()

    def endless(number, stop):
        begun.append(number)
        while not stop():
            time.sleep(0.001)
        ended.set()

    with Crew(workers=1) as crew:
        assert list(crew.do(endless, range(9), lambda: bool(begun))) == []
        assert ended.wait(10.0)
        assert dict(crew.do(planted.tripled, [1], never)) == {0: 3}
    assert begun == [0]


@pytest.mark.parametrize(("options", "entry"), [({"executor": 3}, "executor"), ({"workers": 0}, "workers")])
def test_what_is_no_executor_is_refused(options, entry):
    with pytest.raises(fp.InputError) as caught:
        fp.simulate_many(["fig6"], **options)
    assert caught.value.entry == entry


SWEEP = """
import finger_pin as fp
from finger_pin.studies import Metric

FACTOR = 2.0


def doubled(run):
    return FACTOR * run.scenario.controller.gain


result = fp.sweep("fig6", {"controller.gain": [1.0, 3.0]}, metrics=[Metric("doubled", "N m/rad", "doubled", doubled)])
print(result["doubled"].values, end="")
"""


def test_what_is_typed_works_without_a_guard_and_with_a_metric_of_its_own(tmp_path):
    settings = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 100, "env": os.environ}
    ended = subprocess.run([sys.executable, "-"], input=SWEEP, **settings)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "[2. 6.]", "")
