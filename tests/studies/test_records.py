"""Records of a study in its folder: what is there is whole, stays, and is shared with other processes."""

import os
import threading
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

import filelock
import pytest
from planted import DIES

import finger_pin as fp
from finger_pin.studies.keys import BaseScenario
from finger_pin.studies.records import RunRecord, open_study

BASE = BaseScenario.from_scenario("reversals")


def record(key, value=1.0):
    return RunRecord(key, {"controller.gain": value}, "done", "", {"losses": value}, 0.1)


@contextmanager
def opened(folder, restart=False):
    with open_study(BASE, (), folder, ["sweep.nc"], None, None, restart) as study:
        yield study


def test_what_was_appended_is_read_again_and_known_to_be_on_disk(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append((tmp_path / "runs.jsonl").read_text().count("\n")))
    with opened(tmp_path) as study:
        study.append(record("a", float("inf")))
        study.append(record("b", 0.1 + 0.2))
    assert synced == [1, 2]
    with opened(tmp_path) as study:
        assert study.records == {"a": record("a", float("inf")), "b": record("b", 0.1 + 0.2)}


def test_without_a_folder_records_are_kept_in_memory():
    with opened(None) as study:
        study.append(record("a"))
        assert set(study.records) == {"a"}


@pytest.mark.parametrize("left", [1, 20, -1])
def test_half_a_line_of_a_killed_process_is_cut_off_and_told_when_it_is_read(tmp_path, left):
    path = tmp_path / "runs.jsonl"
    with opened(tmp_path) as study:
        study.append(record("a"))
        kept = path.read_bytes()
        # Another process begins a line, and is killed.
        path.write_bytes(kept + kept[:left])
        study.append(record("b"))
    whole = path.read_bytes()
    assert whole.splitlines()[0] == kept.strip() and len(whole.splitlines()) == 2
    path.write_bytes(whole + kept[:left])
    with pytest.warns(UserWarning, match=r"runs.jsonl: lines that are not whole, or no records: 1; their runs are"):
        with opened(tmp_path) as study:
            assert study.records == {"a": record("a"), "b": record("b")}
    assert path.read_bytes() == whole


def test_lines_that_are_no_records_do_not_count_and_are_told(tmp_path):
    (tmp_path / "runs.jsonl").write_text('{"key": "a"}\n[1]\n\n')
    with pytest.warns(UserWarning, match="no records: 3; their runs are done again"), opened(tmp_path) as study:
        assert study.records == {}


def test_processes_share_a_folder_and_wait_for_each_other_to_write(tmp_path):
    with opened(tmp_path) as one, opened(tmp_path) as other:
        one.append(record("a"))
        writer = threading.Thread(target=other.append, args=[record("b")])
        with filelock.FileLock(tmp_path / ".lock"):
            writer.start()
            writer.join(0.2)
            assert (tmp_path / "runs.jsonl").read_text().count("\n") == 1
        writer.join()
    with opened(tmp_path) as study:
        assert set(study.records) == {"a", "b"}


def test_a_restart_drops_what_was_made_and_nothing_else(tmp_path):
    with opened(tmp_path) as study:
        study.append(record("a"))
    (tmp_path / "sweep.nc").touch()
    (tmp_path / "notes.txt").touch()
    with opened(tmp_path, restart=True) as study:
        assert not study.records
    assert {each.name for each in tmp_path.iterdir()} == {"notes.txt", "runs.jsonl", ".lock"}
    assert (tmp_path / "runs.jsonl").read_bytes() == b""


@pytest.mark.parametrize("restart", [False, True])
@pytest.mark.parametrize("name", ["study.toml", "runs.jsonl", "sweep.nc"])
def test_files_that_no_study_of_this_kind_wrote_are_left_alone(tmp_path, name, restart):
    (tmp_path / name).write_text("mine")
    with pytest.raises(fp.InputError, match=rf"^output[^\n]*holds a {name} of[^\n]*name another folder$"):
        opened(tmp_path, restart).__enter__()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [(name, "mine")]


def test_a_folder_that_cannot_be_made_or_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder" / "runs.jsonl").mkdir(parents=True)
    for folder in (tmp_path / "file" / "sub", tmp_path / "folder"):
        with pytest.raises(fp.InputError, match="cannot be written"):
            opened(folder).__enter__()


def test_a_run_that_kills_its_process_twice_is_marked_failed_and_the_others_are_done():
    with ProcessPoolExecutor(2) as pool:
        result = fp.sweep(
            "reversals",
            {"controller.gain": [2.0, 1.0, 3.0]},
            metrics=[DIES],
            overrides={"simulation.duration": 0.02},
            executor=pool,
        )
    assert result["status"].values.tolist() == ["failed", "done", "done"]
    assert "killed its process twice" in str(result["reason"].values[0])
