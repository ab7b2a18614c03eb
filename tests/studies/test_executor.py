"""Executors: what is given to them comes back once, whatever they are; stops, and scripts without a guard."""

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial

import numpy as np
import planted
import pytest

import finger_pin as fp
from finger_pin.studies.executor import error_line, open_executor, run_tasks


def never():
    return False


class Serial:
    """The least that an executor is: it does all at once, in the present thread."""

    def submit(self, function, *arguments):
        found = Future()
        found.set_result(function(*arguments))
        return found


@pytest.fixture(params=[None, "threads", "processes", "own"])
def executor(request):
    made = {"threads": ThreadPoolExecutor, "processes": ProcessPoolExecutor}.get(request.param)
    given = Serial() if request.param == "own" else made and made(2)
    with open_executor(given) as executor:
        yield executor
    if made:
        given.shutdown()


def test_every_item_is_done_once_and_comes_with_its_index_by_any_executor(executor):
    found = list(run_tasks(executor, planted.tripled, range(20), never))
    assert sorted(found) == [(number, 3 * number) for number in range(20)]
    factor = 5
    assert dict(run_tasks(executor, lambda number, stop: factor * number, [2], never)) == {0: 10}


def test_a_process_reads_what_all_tasks_share_once():
    with ProcessPoolExecutor(1) as processes:
        counts = dict(run_tasks(processes, partial(planted.count, seen=[]), "abc", never))
    assert counts == {0: 1, 1: 2, 2: 3}


def test_what_raises_is_told_in_one_line_and_the_others_go_on():
    with open_executor(workers=2) as executor:
        (failed,) = dict(run_tasks(executor, planted.raises, [7], never)).values()
        assert isinstance(failed, ArithmeticError) and error_line(failed) == "ArithmeticError: planted 7"
        assert dict(run_tasks(executor, planted.tripled, [7], never)) == {0: 21}


def test_a_stop_ends_what_runs_in_threads_and_leaves_the_rest():
    begun, ended = [], threading.Event()

    def endless(number, stop):
        begun.append(number)
        while not stop():
            time.sleep(0.001)
        ended.set()

    with open_executor(workers=1) as executor:
        assert list(run_tasks(executor, endless, range(9), lambda: bool(begun))) == []
        assert ended.wait(120.0)
        assert dict(run_tasks(executor, planted.tripled, [1], never)) == {0: 3}
    assert begun == [0]


GAINS, SHORT = (0.5, 1.0, 2.0), {"simulation.duration": 0.02}
STUDIES = {
    "many": lambda **options: fp.simulate_many(
        [fp.load_scenario("reversals", {**SHORT, "controller.gain": gain}) for gain in GAINS],
        **{"workers": 1} | options,
    ),
    "sweep": lambda **options: fp.sweep(
        "reversals", {"controller.gain": GAINS}, overrides=SHORT, **{"executor": Serial()} | options
    ),
    "optimise": lambda **options: fp.optimise(
        "reversals",
        ["controller.gain=0.5:4"],
        overrides=SHORT,
        constraints=[],
        effort=fp.studies.Effort(population=4),
        **{"executor": Serial()} | options,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES)
def test_ctrl_c_in_python_keeps_the_runs_that_are_finished(study):
    def press(done, *others):
        if done == 1:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="interrupted after 1 ") as caught:
        STUDIES[study](progress=press)
    result = caught.value.result
    if study == "many":
        assert (result.run.values.tolist(), result.failure.values.tolist()) == ([0], [""])
        assert result.scenario.values.tolist() == [
            fp.to_toml(fp.load_scenario("reversals", {**SHORT, "controller.gain": 0.5}))
        ]
        alone = fp.simulate(fp.load_scenario("reversals", {**SHORT, "controller.gain": GAINS[0]})).joint_position
        assert (result.joint_position[0].values == alone.values).all()
    else:
        assert result.status.values[0] == "done" and set(result.status.values[1:]) <= {"missing"}
        assert np.isfinite(result.tracking_rms.values[0])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize(
    "error",
    [
        fp.InputError("a.b", "must be 1", 2),
        fp.IntegrationError(0.5, "stuck", "less"),
        fp.exceptions.StudyError("why", None),
        fp.exceptions.Interrupted(0.5),
    ],
)
def test_what_is_raised_comes_out_of_another_process_with_all_that_it_says(error):
    error.add_note("a note")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == str(error) and vars(again) == vars(error)


class Forgetful:
    """It takes work and returns no future."""

    def submit(self, function, *arguments):
        pass


@pytest.mark.parametrize("study", STUDIES)
@pytest.mark.parametrize("given", [3, "threads", ThreadPoolExecutor, Forgetful(), multiprocessing.get_context("fork")])
def test_an_argument_that_is_no_executor_is_refused_in_one_line(study, given):
    asked = {"many": {"workers": None, "executor": given}}.get(study, {"executor": given})
    with pytest.raises(fp.InputError, match=r"^executor[^\n]*must be a concurrent.futures.Executor[^\n]*$"):
        STUDIES[study](**asked)


@pytest.mark.parametrize("workers", [0, 2.5, "2", True])
def test_a_number_of_threads_is_a_whole_number(workers):
    with pytest.raises(fp.InputError, match=r"^workers[^\n]*$"):
        fp.simulate_many(["reversals"], workers=workers)


@pytest.mark.parametrize("study", STUDIES)
def test_an_executor_that_has_been_shut_down_is_named_in_one_line(study):
    over = ThreadPoolExecutor(1)
    over.shutdown()
    asked = {"many": {"workers": None, "executor": over}}.get(study, {"executor": over})
    with pytest.raises(fp.exceptions.FingerPinError, match=r"^[^\n]*cannot schedule new futures after shutdown[^\n]*$"):
        STUDIES[study](**asked)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_stop_ends_what_other_processes_run_and_no_more_is_begun(tmp_path, method, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def marked(kind):
        return {each.name.removeprefix(kind) for each in tmp_path.glob(f"{kind}*")}

    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(method)) as executor:
        work = partial(planted.waits_to_be_stopped, folder=tmp_path)
        assert list(run_tasks(executor, work, range(40), lambda: bool(marked("begun")))) == []
    # The executor had fetched three more than the two that ran.
    assert 1 <= len(marked("begun")) <= 2 and marked("stopped") == marked("begun")
    assert not marked("finger_pin-")


SWEEP = """
import finger_pin as fp
from finger_pin.studies import Metric

FACTOR = 2.0


def doubled(run):
    return FACTOR * run.scenario.controller.gain


metrics = [Metric("doubled", "N m/rad", "doubled", doubled)]
result = fp.sweep("reversals", {"controller.gain": [1.0, 3.0]}, metrics=metrics)
print(result["doubled"].values, end="")
"""


@pytest.mark.slow
def test_what_is_typed_works_without_a_guard_and_with_a_metric_of_its_own(tmp_path):
    settings = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 100, "env": os.environ}
    ended = subprocess.run([sys.executable, "-"], input=SWEEP, **settings)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "[2. 6.]", "")
