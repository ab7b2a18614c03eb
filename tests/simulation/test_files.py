"""Files and folders of results: whole or not at all, of one run and never of two."""

import os
import shutil
import stat
import subprocess
import sys
import threading

import pytest

import finger_pin as fp
from finger_pin.description.loading import load_scenario
from finger_pin.exceptions import InputError
from finger_pin.files import replacing
from finger_pin.simulation.results import ResultFolder


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture(scope="module")
def result():
    scenario = load_scenario("fig6", {"simulation.duration": 0.002, "simulation.sample_rate": 1000})
    return fp.simulate(scenario)


def publish(folder, result, *, figures=(), animation=True):
    with ResultFolder(folder) as results:
        results.write(result)
        if animation:
            (results.stage / "animation.html").write_text("new")
        for name in figures:
            (results.stage / "figures").mkdir(exist_ok=True)
            (results.stage / "figures" / name).write_bytes(b"new")
        results.publish()


def test_a_file_appears_when_it_is_complete(tmp_path):
    target = tmp_path / "a file.txt"
    with replacing(target) as temporary:
        with open(temporary, "w") as file:
            file.write("text")
        assert not target.exists()
    assert contents(tmp_path) == {"a file.txt": b"text"}


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt])
def test_an_earlier_file_survives_an_error_and_nothing_else_stays(tmp_path, error):
    target = tmp_path / "file.txt"
    target.write_text("earlier")
    with pytest.raises(error), replacing(target) as temporary:
        with open(temporary, "w") as file:
            file.write("half")
        raise error
    assert contents(tmp_path) == {"file.txt": b"earlier"}


def test_a_temporary_file_has_the_suffix_of_its_target(tmp_path):
    with replacing(tmp_path / "page.html") as temporary:
        assert temporary.endswith(".html")


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_file_has_the_permissions_of_any_other(tmp_path):
    mask = os.umask(0o027)
    try:
        with replacing(tmp_path / "file.txt"):
            pass
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "file.txt").stat().st_mode) == 0o640
    assert os.umask(mask) == mask


def test_a_file_in_a_folder_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "no" / "file.txt"):
        pass
    assert contents(tmp_path) == {}


def test_results_appear_when_they_are_published(tmp_path, result):
    folder = tmp_path / "with space é" / "run"
    with ResultFolder(folder) as results:
        results.write(result)
        assert not (folder / "trajectory.nc").exists()
        results.publish()
    assert set(contents(folder)) == {"scenario.toml", "trajectory.nc"}
    assert fp.load_result(folder / "trajectory.nc").equals(result)


def test_without_publishing_the_folder_is_as_it_was(tmp_path, result):
    publish(tmp_path / "run", result, figures=["a.png"])
    before = contents(tmp_path)
    with pytest.raises(KeyboardInterrupt), ResultFolder(tmp_path / "run") as results:
        results.write(result)
        raise KeyboardInterrupt
    assert contents(tmp_path) == before


def test_without_publishing_no_folder_is_left_behind(tmp_path, result):
    (tmp_path / "there").mkdir()
    with ResultFolder(tmp_path / "there" / "a" / "b") as results:
        results.write(result)
    assert contents(tmp_path) == {"there": None}


def test_results_of_an_earlier_run_that_the_new_one_lacks_are_removed(tmp_path, result):
    publish(tmp_path, result, figures=["a.png", "b.png"])
    publish(tmp_path, result, figures=["b.png", "c.png"], animation=False)
    assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc", "figures", "figures/b.png", "figures/c.png"}
    publish(tmp_path, result, animation=False)
    assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc"}


def test_other_files_in_the_folder_stay(tmp_path, result):
    publish(tmp_path, result, figures=["a.png"])
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "figures" / "a.svg").write_text("mine")
    publish(tmp_path, result)
    kept = contents(tmp_path)
    assert kept["notes.txt"] == kept["figures/a.svg"] == b"mine"
    assert "figures/a.png" not in kept


@pytest.mark.parametrize("name", ["scenario.toml", "trajectory.nc", "animation.html", "figures/mine.png"])
def test_files_that_no_run_wrote_are_not_replaced(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    before = contents(tmp_path)
    with pytest.raises(InputError, match=rf"output = .*holds a {name.split('/')[-1]} that is not from a run"):
        ResultFolder(tmp_path)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("failing", range(1, 12))
def test_a_failure_while_moving_puts_the_earlier_results_back(tmp_path, result, monkeypatch, failing):
    publish(tmp_path, result, figures=["a.png", "b.png"])
    before = contents(tmp_path)
    rename, calls = os.rename, []

    def refuse(source, target):
        calls.append(target)
        if len(calls) == failing:
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse)
    with pytest.raises(OSError, match="No space"):
        publish(tmp_path, result, figures=["c.png"])
    assert contents(tmp_path) == before


def test_at_no_instant_do_results_of_two_runs_lie_side_by_side(tmp_path, result, monkeypatch):
    publish(tmp_path, result, figures=["a.png", "b.png"])
    earlier = {name: (tmp_path / name).stat().st_ino for name, data in contents(tmp_path).items() if data is not None}
    rename, mixes = os.rename, []

    def watch(source, target):
        rename(source, target)
        present = [
            path
            for path in tmp_path.rglob("*")
            if path.is_file() and not path.relative_to(tmp_path).as_posix().startswith(".")
        ]
        old = [earlier.get(path.relative_to(tmp_path).as_posix()) == path.stat().st_ino for path in present]
        mixes.append(any(old) and not all(old))

    monkeypatch.setattr(os, "rename", watch)
    publish(tmp_path, result, figures=["b.png", "c.png"])
    assert len(mixes) == 12
    assert not any(mixes)


def test_a_folder_that_cannot_be_made_is_an_error_that_says_why(tmp_path):
    (tmp_path / "file").write_text("mine")
    for path, says in (
        (tmp_path / "file", "is a file"),
        (tmp_path / "file" / "below", "cannot be written: Not a directory"),
        (tmp_path / ("n" * 300), "cannot be written: File name too long"),
        (tmp_path / "a\0b", "cannot be written"),
    ):
        with pytest.raises(InputError, match=says) as caught:
            ResultFolder(path)
        assert caught.value.entry == "output"
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "figures").write_text("mine")
    with pytest.raises(InputError, match="figures is a file"):
        ResultFolder(tmp_path / "run")
    assert set(contents(tmp_path)) == {"file", "run", "run/figures"}


def test_a_folder_without_permission_is_an_error_and_leaves_nothing(tmp_path, monkeypatch):
    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkdtemp", refuse)
    with pytest.raises(InputError, match="cannot be written: Permission denied"):
        ResultFolder(tmp_path / "a" / "b")
    assert contents(tmp_path) == {}


def test_the_scenario_in_the_folder_loads_as_the_one_that_was_simulated(tmp_path, result):
    publish(tmp_path, result)
    scenario = load_scenario(tmp_path / "scenario.toml")
    assert fp.to_toml(scenario) == result.attrs["scenario"]


def test_what_the_netcdf_library_makes_of_a_full_disk_is_an_os_error(tmp_path, result, monkeypatch):
    def fail(*arguments, **options):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(type(result), "to_netcdf", fail)
    with pytest.raises(OSError, match="HDF error"), ResultFolder(tmp_path) as results:
        results.write(result)
    assert contents(tmp_path) == {}


#: Publishes a set of results into a copy of a folder, over and over; every process is killed at another rename.
KILLED = """
import os, shutil, signal, sys
from pathlib import Path

from finger_pin.simulation.results import ResultFolder

rename, calls = os.rename, 0


def killing(source, target):
    global calls
    calls += 1
    if calls == 1 + number // 2 and number % 2 == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    rename(source, target)
    if calls == 1 + number // 2 and number % 2 == 1:
        os.kill(os.getpid(), signal.SIGKILL)


number, survived = 0, False
while not survived:
    shutil.copytree("old", f"at{number}")
    child = os.fork()
    if child == 0:
        with ResultFolder(f"at{number}") as folder:
            shutil.copytree("new", folder.stage, dirs_exist_ok=True)
            os.rename = killing
            folder.publish()
        os._exit(0)
    survived = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    number += 1
print(number)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory, result):
    """Folders in which a process was killed right before and right after every rename, and the two sets of results."""
    home = tmp_path_factory.mktemp("killed")
    other = fp.simulate(load_scenario("fig6", {"simulation.duration": 0.003, "simulation.sample_rate": 1000}))
    publish(home / "old", result, figures=["a.png", "b.png"])
    publish(home / "new", other, figures=["b.png", "c.png"], animation=False)
    done = subprocess.run([sys.executable, "-c", KILLED], cwd=home, capture_output=True, text=True, check=True)
    count = int(done.stdout)
    # 5 earlier files, 4 new ones, the decision and its end; before and after each, and once undisturbed.
    assert count == 2 * 11 + 1
    sets = [contents(home / name) for name in ("old", "new")]
    return [home / f"at{number}" for number in range(count)], sets


def read(folder):
    fp.load_result(folder / "trajectory.nc")


def resolve(folder):
    load_scenario(folder / "scenario.toml")


def begin_another(folder):
    with ResultFolder(folder):
        pass


@pytest.mark.parametrize("look", [read, resolve, begin_another])
def test_a_run_killed_at_any_instant_of_publishing_leaves_one_whole_set_to_whoever_looks_next(killed, tmp_path, look):
    """The earlier set before the decision, which is the first rename, and the new one after it."""
    folders, (old, new) = killed
    for number, folder in enumerate(folders):
        copy = tmp_path / folder.name
        shutil.copytree(folder, copy)
        look(copy)
        found = {name: data for name, data in contents(copy).items() if not name.startswith(".unfinished-")}
        assert found == (old if number == 0 else new), number


def test_what_killed_runs_had_begun_is_removed_by_the_next_run_but_not_that_of_a_living_one(killed, tmp_path):
    folders, (_, new) = killed
    folder = tmp_path / "run"
    shutil.copytree(folders[0], folder)
    assert list(folder.glob(".unfinished-*"))
    with ResultFolder(folder) as living:
        shutil.copytree(folders[-1], living.stage, dirs_exist_ok=True)
        with ResultFolder(folder):
            pass
        assert list(folder.glob(".unfinished-*")) == [living.stage]
        living.publish()
    assert contents(folder) == new


def test_a_reader_waits_for_a_run_that_is_just_publishing(tmp_path, result, monkeypatch):
    publish(tmp_path, result, figures=["a.png"])
    earlier = (tmp_path / "trajectory.nc").stat().st_ino
    rename, half, go_on = os.rename, threading.Event(), threading.Event()

    def slow(source, target):
        rename(source, target)
        if os.path.basename(target) == "scenario.toml" and ".publishing" not in str(target):
            half.set()
            assert go_on.wait(60.0)

    monkeypatch.setattr(os, "rename", slow)
    seen = []

    def look():
        fp.load_result(tmp_path / "trajectory.nc")
        seen.append((tmp_path / "trajectory.nc").stat().st_ino)

    writer = threading.Thread(target=publish, args=(tmp_path, result))
    reader = threading.Thread(target=look)
    writer.start()
    assert half.wait(60.0)
    reader.start()
    reader.join(0.2)
    assert reader.is_alive() and not seen
    go_on.set()
    writer.join()
    reader.join()
    assert seen and seen[0] != earlier
    assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc", "animation.html"}
