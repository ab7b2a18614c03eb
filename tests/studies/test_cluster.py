"""Sweeps on a real local Dask cluster, one of whose workers is killed in mid-run."""

import importlib
import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from planted import DIES, GAIN, SLOW

import finger_pin as fp
from finger_pin.studies import ExecutorError

distributed = pytest.importorskip("distributed")

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SHORT = {"simulation.duration": 0.02}
METRICS = [SLOW, "tracking_rms", "tension_peak"]
GAINS = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def executor(cluster):
    with distributed.Client(cluster, set_as_default=False) as client:
        yield client.get_executor(pure=False)


@pytest.mark.slow
def test_a_killed_worker_costs_no_run_and_doubles_none_and_all_are_those_of_threads(cluster, executor, tmp_path):
    victim = cluster.workers[0].pid
    seen = []

    def kill(finished, failed, total):
        if finished == 2 and not seen:
            os.kill(victim, signal.SIGKILL)
            seen.append(victim)

    over = {"controller.gain": GAINS}
    away = fp.sweep(
        "reversals", over, metrics=METRICS, overrides=SHORT, output=tmp_path,
        executor=executor, progress=kill,
    )  # fmt: skip
    assert seen == [victim]
    keys = [json.loads(line)["key"] for line in (tmp_path / "runs.jsonl").read_text().splitlines()]
    assert len(keys) == len(set(keys)) == len(GAINS)
    assert set(away["status"].values) == {"done"}
    here = fp.sweep("reversals", over, metrics=METRICS, overrides=SHORT, executor=ThreadPoolExecutor(2))
    assert away.identical(here)


@pytest.mark.slow
def test_a_run_that_kills_its_workers_is_recorded_with_its_reason(cluster, executor):
    with distributed.Client(cluster) as client:
        client.run_on_scheduler(lambda dask_scheduler: setattr(dask_scheduler, "allowed_failures", 1))
    result = fp.sweep(
        "reversals", {"controller.gain": [1.0, 2.0]}, metrics=[DIES], overrides=SHORT,
        executor=executor,
    )  # fmt: skip
    assert result["status"].values[1] == "failed"
    assert "died" in str(result["reason"].values[1])


@pytest.mark.slow
def test_a_stop_ends_a_sweep_on_a_cluster(executor):
    done = []
    result = fp.sweep(
        "reversals", {"controller.gain": GAINS}, metrics=[SLOW], overrides=SHORT,
        executor=executor, progress=lambda *numbers: done.append(numbers[0]),
        stop=lambda: bool(done) and done[-1] >= 2,
    )  # fmt: skip
    assert (result["status"] == "missing").any()
    np.testing.assert_array_equal(
        *(result[name].values[result["status"] == "done"] for name in ("slow_gain", "controller.gain"))
    )


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told_and_what_was_done_stays(tmp_path):
    def leave(finished, failed, total):
        if finished == 2:
            own.close()

    over, folder = {"controller.gain": GAINS}, tmp_path / "out"
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0", silence_logs=50
    ) as own:
        away = distributed.Client(own, set_as_default=False).get_executor(pure=False)
        with pytest.raises(ExecutorError, match="the executor cannot go on"):
            fp.sweep("reversals", over, metrics=[SLOW], overrides=SHORT, output=folder, executor=away, progress=leave)
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 2
    again = fp.sweep("reversals", over, metrics=[SLOW], overrides=SHORT, output=folder, executor=ThreadPoolExecutor(2))
    np.testing.assert_array_equal(again["slow_gain"], GAINS)


@pytest.mark.slow
def test_workers_of_another_source_are_refused(executor, monkeypatch):
    monkeypatch.setattr("finger_pin.studies.records.source_digest", lambda: "another")
    with pytest.raises(ExecutorError, match=r"a worker has another finger_pin \(\d.*\), not that of source another"):
        fp.sweep("reversals", {"controller.gain": [1.0]}, metrics=[GAIN], overrides=SHORT, executor=executor)


@pytest.mark.slow
def test_the_command_line_runs_on_a_cluster(cluster, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(SCRIPTS))
    main = importlib.import_module("sweep").main
    arguments = ["--over", "controller.gain=1,2", "--metric", "tracking_rms", "--set", "simulation.duration=0.02"]
    assert main([*arguments, "--scheduler", cluster.scheduler_address]) == 0
    assert "2 runs: 2 done" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "not an address"])
def test_a_missing_scheduler_is_reported_in_one_line(address, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("finger_pin.commands.options._CONNECTION_TIMEOUT", 0.3)
    monkeypatch.syspath_prepend(str(SCRIPTS))
    main = importlib.import_module("sweep").main
    assert main(["--over", "controller.gain=1,2", "--scheduler", address, "--quiet"]) == 2
    told = capsys.readouterr().err
    assert "--scheduler" in told and len(told.splitlines()) == 1
    assert not (tmp_path / "results").exists()
