"""The pool of processes: what a dead one costs, stops, and scripts without a guard."""

import os
import signal
import subprocess
import sys
import time

import planted
import pytest

from finger_pin.studies.processes import Lost, Pool


def never():
    return False


@pytest.fixture
def pool():
    with Pool(2) as pool:
        yield pool


@pytest.mark.parametrize("helping", [False, True])
def test_every_item_is_done_once_and_comes_with_its_index(pool, helping):
    found = list(pool.do(planted.tripled, range(20), never, helping=helping))
    assert sorted(found) == [(number, 3 * number) for number in range(20)]


def test_a_process_that_dies_every_time_costs_its_own_item_and_is_told(pool):
    found = dict(pool.do(planted.kills, [1, 2, 3, 4], never))
    assert found == {0: 1, 1: Lost("its process ended 2 times, killed by SIGKILL"), 2: 3, 3: 4}


def test_a_process_that_is_killed_while_it_sends_costs_nothing(pool, tmp_path):
    mark = tmp_path / "mark"
    answers = pool.do(planted.sends_much_or_waits, [(mark, True), (mark, False)], never)
    assert next(answers) == (1, "waited")
    # While nobody takes the other answer, which no pipe can hold, its sender does not come to an end.
    time.sleep(0.3)
    os.kill(int(mark.read_text()), signal.SIGKILL)
    assert list(answers) == [(0, "again")]


def test_what_raises_is_told_in_one_line_and_its_process_goes_on(pool):
    assert dict(pool.do(planted.raises, [7], never)) == {0: Lost("ArithmeticError: planted 7")}
    assert dict(pool.do(planted.tripled, [7], never)) == {0: 21}


def test_what_is_defined_where_no_module_can_be_imported_is_sent_by_value(pool):
    factor = 5
    assert dict(pool.do(lambda number: factor * number, [2], never)) == {0: 10}


def test_a_stop_leaves_the_rest_and_the_pool_can_be_used_again(pool):
    done = []
    for _, value in pool.do(planted.tripled, range(100), lambda: len(done) >= 5):
        done.append(value)
    assert len(done) < 100
    assert dict(pool.do(planted.tripled, [1], never)) == {0: 3}


SWEEP = """
import finger_pin as fp
from finger_pin.studies import Metric

FACTOR = 2.0


def doubled(run):
    return FACTOR * run.scenario.controller.gain


result = fp.sweep("fig6", {"controller.gain": [1.0, 3.0]}, metrics=[Metric("doubled", "N m/rad", "doubled", doubled)])
print(result["doubled"].values, end="")
"""
RUNS = """
runs = [fp.load_scenario("fig6", {"simulation.duration": 0.3, "controller.gain": 1.0 + 0.01 * n}) for n in range(40)]
stacked = fp.simulate_many(runs, workers=2, variables=["tracking_error"])
print("", int(stacked["tracking_error"].notnull().all()), end="")
"""


def ends_of(tmp_path, arguments, **options):
    settings = {"cwd": tmp_path, "capture_output": True, "text": True, "encoding": "utf-8", "timeout": 100}
    ended = subprocess.run([sys.executable, *arguments], **settings, **options)
    return ended.returncode, ended.stdout, ended.stderr


def test_a_plain_script_without_a_guard_works_with_a_metric_of_its_own(tmp_path):
    (tmp_path / "plain.py").write_text(SWEEP + RUNS)
    assert ends_of(tmp_path, ["plain.py"]) == (0, "[2. 6.] 1", "")


def test_what_is_typed_works_with_a_metric_of_its_own(tmp_path):
    assert ends_of(tmp_path, ["-"], input=SWEEP) == (0, "[2. 6.]", "")


def test_the_server_compiles_nothing_where_this_process_is_about_to(tmp_path):
    code = (
        "import os\n"
        "from finger_pin.studies.machine import WARM\n"
        "from finger_pin.studies.processes import Pool\n"
        "with Pool(1) as pool:\n"
        "    print(list(pool.do(os.getenv, [WARM], lambda: False)))\n"
    )
    environment = {**os.environ, "FINGER_PIN_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[(0, '0')]\n", "")
