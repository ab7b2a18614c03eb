"""The store and the folder of a study: what is there is whole, and stays."""

import os

import pytest

import finger_pin as fp
from finger_pin.studies.store import RunRecord, Store, open_store


def record(key, value=1.0):
    return RunRecord(key, {"controller.gain": value}, "done", "", {"losses": value}, 0.1)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "runs.jsonl"


def test_what_was_appended_is_read_again(path):
    store = Store(path)
    store.append(record("a", float("inf")))
    store.append(record("b", 0.1 + 0.2))
    assert Store(path).records == {"a": record("a", float("inf")), "b": record("b", 0.1 + 0.2)}


@pytest.mark.parametrize("left", [1, 20, -1])
def test_a_broken_last_line_is_cut_off_told_and_written_anew(path, left):
    store = Store(path)
    store.append(record("a"))
    kept = path.read_bytes()
    store.append(record("b"))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(kept) + left] if left > 0 else whole[:left])
    with pytest.warns(UserWarning, match=r"runs.jsonl: lines that are not whole, or no records: 1; their runs are"):
        store = Store(path)
    assert set(store.records) == {"a"}
    store.append(record("b"))
    assert path.read_bytes() == whole


def test_lines_that_are_no_records_do_not_count_and_are_told(path):
    path.write_text('nonsense\n{"key": "a"}\n[1]\n\n')
    with pytest.warns(UserWarning, match="no records: 4; their runs are done again"):
        assert Store(path).records == {}


def test_a_record_is_on_disk_before_append_returns(path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append(path.read_bytes()))
    Store(path).append(record("a"))
    assert synced == [f"{record('a').to_json()}\n".encode()]


def test_a_store_without_a_file_keeps_records_for_itself():
    store = Store()
    store.append(record("a"))
    assert set(store.records) == {"a"}


def asks(**entries):
    return {"finger_pin": "1", "sweep": {"values": {"controller.gain": [1.0]}}, **entries}


def test_the_same_study_goes_on_and_another_one_is_refused_with_what_differs(tmp_path):
    with open_store(tmp_path / "a" / "b", asks(), ["sweep.nc"]) as store:
        store.append(record("a"))
    with open_store(tmp_path / "a" / "b", asks(), ["sweep.nc"]) as store:
        assert set(store.records) == {"a"}
    before = {each: each.read_bytes() for each in (tmp_path / "a" / "b").iterdir()}
    other = asks(sweep={"values": {"controller.gain": [2.0]}})
    with pytest.raises(fp.InputError, match=r"sweep.values.controller.gain differs.*--restart"):
        open_store(tmp_path / "a" / "b", other, ["sweep.nc"]).__enter__()
    assert {each: each.read_bytes() for each in (tmp_path / "a" / "b").iterdir()} == before


def test_a_restart_drops_what_was_made_and_nothing_else(tmp_path):
    with open_store(tmp_path, asks(), ["sweep.nc"]) as store:
        store.append(record("a"))
    (tmp_path / "sweep.nc").touch()
    (tmp_path / "notes.txt").touch()
    with open_store(tmp_path, asks(more=1), ["sweep.nc"], restart=True) as store:
        assert not store.records
    assert {each.name for each in tmp_path.iterdir()} == {"notes.txt", "runs.jsonl", "study.toml"}
    assert "more = 1" in (tmp_path / "study.toml").read_text()


@pytest.mark.parametrize("restart", [False, True])
@pytest.mark.parametrize("name", ["study.toml", "runs.jsonl", "sweep.nc"])
def test_files_that_no_study_wrote_are_left_alone(tmp_path, name, restart):
    (tmp_path / name).write_text("mine")
    with pytest.raises(fp.InputError, match="not of a study"):
        open_store(tmp_path, asks(), ["sweep.nc"], restart=restart).__enter__()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [(name, "mine")]


def test_one_study_at_a_time_works_in_a_folder_and_a_killed_one_is_not_in_the_way(tmp_path):
    # What a killed process leaves.
    (tmp_path / ".lock").touch()
    with open_store(tmp_path, asks(), []):
        with pytest.raises(fp.InputError, match="another process"):
            open_store(tmp_path, asks(), []).__enter__()
    with open_store(tmp_path, asks(), []):
        pass
    assert {each.name for each in tmp_path.iterdir()} == {"study.toml", "runs.jsonl"}


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(fp.InputError, match="cannot be written"):
        open_store(tmp_path / "file" / "sub", asks(), []).__enter__()
