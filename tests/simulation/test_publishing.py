"""One set of results takes the place of another at one instant, whatever fails and whoever is killed."""

import errno
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from test_files import contents, load_text, publish, visible

import finger_pin as fp
from finger_pin.description.loading import load_scenario
from finger_pin.simulation.result_folder import ResultFolder


def short(duration):
    """Return one variable of a result: a file that is written in no time."""
    return fp.simulate(load_scenario("reversals", {"simulation.duration": duration}))[["joint_position"]]


@pytest.fixture(scope="module")
def result():
    return short(0.002)


@pytest.mark.parametrize("failing", range(1, 13))
def test_a_failure_while_publishing_leaves_one_whole_set_and_the_earlier_one_if_it_is_told(
    tmp_path, result, monkeypatch, failing
):
    publish(tmp_path, result, figures=["a.png", "b.png"])
    before, calls = visible(tmp_path), []
    replace, symlink = os.replace, os.symlink

    def refusing(function):
        def refuse(source, target):
            calls.append(target)
            if len(calls) == failing:
                raise OSError(28, "No space left on device")
            function(source, target)

        return refuse

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refusing(replace))
        patch.setattr(os, "symlink", refusing(symlink))
        try:
            publish(tmp_path, result, figures=["c.png"])
        except OSError as error:
            assert "No space" in str(error)
            assert visible(tmp_path) == before
        else:
            assert set(visible(tmp_path)) == {"scenario.toml", "trajectory.nc", "animation.html", "figures/c.png"}
    publish(tmp_path, result, figures=["d.png"])
    assert [name for name in contents(tmp_path) if name.startswith((".", "figures/"))] == ["figures/d.png"]


def test_where_there_are_no_links_results_are_replaced_file_by_file(tmp_path, result, monkeypatch):
    def refuse(*arguments):
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(os, "symlink", refuse)
    monkeypatch.setattr(os, "link", refuse)
    publish(tmp_path, result, figures=["a.png", "b.png"])
    publish(tmp_path, result, figures=["b.png", "c.png"], animation=False)
    assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc", "figures", "figures/b.png", "figures/c.png"}


#: Publishes a set of results into a copy of a folder, over and over; every process is killed at another system call.
KILLED = """
import os, shutil, signal
from pathlib import Path

from finger_pin.simulation.result_folder import ResultFolder


def killing(function):
    def call(*arguments, **options):
        global calls
        calls += 1
        if calls == 1 + number // 2 and number % 2 == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        function(*arguments, **options)
        if calls == 1 + number // 2 and number % 2 == 1:
            os.kill(os.getpid(), signal.SIGKILL)

    return call


number, calls, survived = 0, 0, False
while not survived:
    shutil.copytree("old", f"at{number}")
    child = os.fork()
    if child == 0:
        with ResultFolder(f"at{number}") as folder:
            shutil.copytree("new", folder.stage, dirs_exist_ok=True)
            for name in ("rename", "replace", "link", "symlink", "unlink", "rmdir"):
                setattr(os, name, killing(getattr(os, name)))
            folder.publish()
        os._exit(0)
    survived = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    number += 1
print(number)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory, result):
    """Folders in which a process was killed right before and after every change, and the two sets of results."""
    home = tmp_path_factory.mktemp("killed")
    other = short(0.003)
    publish(home / "old", result, figures=["a.png", "b.png"])
    publish(home / "new", other, figures=["b.png", "c.png"], animation=False)
    done = subprocess.run([sys.executable, "-c", KILLED], cwd=home, capture_output=True, text=True, check=True)
    sets = [visible(home / name) for name in ("old", "new")]
    return [home / f"at{number}" for number in range(int(done.stdout))], sets


@pytest.mark.slow
def test_a_run_killed_at_any_instant_of_publishing_leaves_one_whole_set_to_any_reader(killed):
    """The earlier set up to one instant and the new one after it, without anybody's help."""
    folders, (old, new) = killed
    found = [visible(folder) for folder in folders]
    switched = found.index(new)
    assert all(each == old for each in found[:switched])
    assert all(each == new for each in found[switched:])
    # 5 earlier files, 6 names, the decision: one change each at the least, and as many that tidy up.
    assert 2 * 11 < switched < len(folders) - 10
    assert fp.load(folders[switched]).attrs["scenario"] == load_text(new)
    assert load_scenario(folders[switched] / "scenario.toml").simulation.duration == 0.003


@pytest.mark.slow
def test_the_next_run_tidies_up_after_any_kill(killed, tmp_path, monkeypatch, result):
    monkeypatch.setattr("finger_pin.files._PATIENCE", 0.0)
    for folder in killed[0]:
        copy = tmp_path / folder.name
        shutil.copytree(folder, copy, symlinks=True)
        stale = list(copy.glob(".unfinished-*"))
        for each in stale:
            os.utime(each, (0.0, 0.0))
        publish(copy, result, figures=["d.png"])
        expected = {"scenario.toml", "trajectory.nc", "animation.html", "figures", "figures/d.png"}
        assert set(contents(copy)) == expected


def test_a_run_that_is_going_on_keeps_its_stage(tmp_path, result):
    with ResultFolder(tmp_path) as living:
        with ResultFolder(tmp_path):
            pass
        assert living.stage.exists()
        # Even one that another run took for dead is made anew.
        shutil.rmtree(living.stage.parent)
        living.write(result)
        living.publish()
    assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc"}


def test_who_finishes_publishing_just_then_is_not_in_the_way(tmp_path, result, monkeypatch):
    folder, rename, tries = ResultFolder(tmp_path), os.rename, []
    folder.write(result)

    def once_too_early(source, target):
        tries.append(target)
        if len(tries) == 1:
            raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY))
        rename(source, target)

    monkeypatch.setattr(os, "rename", once_too_early)
    folder.publish()
    assert len(tries) == 2 and set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc"}


def test_runs_that_publish_at_the_same_time_do_not_mix(tmp_path, result):
    other = short(0.003)
    for _ in range(5):
        # netCDF is not for several threads: only what is ready is published at the same time.
        folders = [ResultFolder(tmp_path) for _ in range(4)]
        for folder, each in zip(folders, (result, other, result, other), strict=True):
            folder.write(each)
        with ThreadPoolExecutor() as pool:
            list(pool.map(ResultFolder.publish, folders))
        assert load_text(visible(tmp_path)) == fp.load(tmp_path).attrs["scenario"]
        assert set(contents(tmp_path)) == {"scenario.toml", "trajectory.nc"}
