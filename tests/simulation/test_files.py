"""Files and folders of results: whole or not at all, of one run and never of two."""

import errno
import os
import signal
import stat
from concurrent.futures import ThreadPoolExecutor

import pytest

import finger_pin as fp
from finger_pin.description.loading import load_scenario
from finger_pin.exceptions import InputError
from finger_pin.files import replacing, write_text
from finger_pin.simulation.result_folder import ResultFolder
from finger_pin.views.summary import summarize
from finger_pin.views.viewer import write_animation


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def visible(folder):
    """Return the files that a reader finds by their names, hidden ones aside."""
    return {name: data for name, data in contents(folder).items() if not name.startswith(".") and data is not None}


def load_text(files):
    """Return the scenario of a set of results, without the line that marks it."""
    return files["scenario.toml"].decode("utf-8").partition("\n")[2]


@pytest.fixture(scope="module")
def result():
    scenario = load_scenario("reversals", {"simulation.duration": 0.002, "simulation.sample_rate": 1000})
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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes by name here")
def test_a_pipe_gets_the_text_and_stays_a_pipe(tmp_path):
    os.mkfifo(pipe := tmp_path / "out")
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_text)
        write_text(pipe, "a finger")
    assert read.result() == "a finger"
    assert [each.name for each in tmp_path.iterdir()] == ["out"] and pipe.is_fifo()


def test_results_appear_when_they_are_published(tmp_path, result):
    folder = tmp_path / "with space é" / "run"
    with ResultFolder(folder) as results:
        results.write(result)
        assert not (folder / "trajectory.nc").exists()
        results.publish()
    assert set(contents(folder)) == {"scenario.toml", "trajectory.nc"}
    assert fp.load(folder / "trajectory.nc").equals(result)


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


def test_a_folder_that_cannot_be_made_is_an_error_that_says_why(tmp_path):
    (tmp_path / "file").write_text("mine")
    for path, kind, says in (
        (tmp_path / "file", InputError, "output = .*is a file"),
        (tmp_path / "file" / "below", NotADirectoryError, "Not a directory"),
        (tmp_path / ("n" * 300), OSError, "File name too long"),
        (tmp_path / "a\0b", InputError, "output"),
    ):
        with pytest.raises(kind, match=says):
            ResultFolder(path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "figures").write_text("mine")
    with pytest.raises(InputError, match="figures is a file"):
        ResultFolder(tmp_path / "run")
    assert set(contents(tmp_path)) == {"file", "run", "run/figures"}


def test_a_folder_without_permission_is_an_error_and_leaves_nothing(tmp_path, monkeypatch):
    mkdir = os.mkdir

    def refuse(path, *arguments):
        if "unfinished" in str(path):
            raise PermissionError(13, "Permission denied")
        mkdir(path, *arguments)

    monkeypatch.setattr(os, "mkdir", refuse)
    with pytest.raises(PermissionError):
        ResultFolder(tmp_path / "a" / "b")
    assert contents(tmp_path) == {}


def test_the_scenario_in_the_folder_loads_as_the_one_that_was_simulated(tmp_path, result):
    publish(tmp_path, result)
    scenario = load_scenario(tmp_path / "scenario.toml")
    assert fp.to_toml(scenario) == result.attrs["scenario"]


def test_what_the_netcdf_library_cannot_write_is_an_os_error(tmp_path, result, monkeypatch):
    def fail(*arguments, **options):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(type(result), "to_netcdf", fail)
    with pytest.raises(OSError, match="HDF error"), ResultFolder(tmp_path) as results:
        results.write(result)
    assert contents(tmp_path) == {}


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_disk_that_is_full_is_said_to_be_so(tmp_path, result):
    """The library says "HDF error"; a file that may not grow is as good as a full disk, and needs no mount."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    former = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
        with pytest.raises(OSError) as caught:
            fp.save(result, tmp_path / "result.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, former)
    assert caught.value.errno == errno.EFBIG
    assert contents(tmp_path) == {}


def test_a_result_is_loaded_from_its_folder(tmp_path, result):
    publish(tmp_path, result)
    assert fp.load(tmp_path).equals(result)


@pytest.mark.parametrize("part", ["no time", "no samples"])
def test_a_result_without_samples_is_told_so_by_all_that_read_one(tmp_path, result, part):
    broken = result.isel(time=0, drop=True) if part == "no time" else result.isel(time=slice(0, 0))
    fp.save(broken, tmp_path / "r.nc")
    broken = fp.load(tmp_path / "r.nc")
    doors = (
        lambda: fp.save(broken, tmp_path / "r.csv"),
        lambda: summarize(broken),
        lambda: write_animation(broken, tmp_path / "r.html"),
        lambda: fp.simulate("reversals", initial=broken),
    )
    for door in doors:
        with pytest.raises(InputError, match=r"result\.time: (is missing|must have at least one sample)"):
            door()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_that_nobody_writes_is_refused_and_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    empty = pytest.importorskip("mujoco").MjSpec()
    doors = {
        "s.toml": fp.load_scenario,
        "f.toml": fp.load_finger,
        "r.nc": fp.load,
        "m.csv": lambda name: fp.load_scenario("reversals", {"reference.file": name}),
        "h.xml": fp.from_mujoco,
        "t.toml": lambda name: fp.from_mujoco(empty, tendons=name),
    }
    for name, door in doors.items():
        os.mkfifo(name)
        # What waits nevertheless is ended by the default action of the signal.
        signal.alarm(60)
        with pytest.raises((InputError, OSError), match="is a pipe"):
            door(name)
        signal.alarm(0)
