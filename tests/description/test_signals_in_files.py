"""References, tensions and forces over time in TOML and CSV: what they become, and what is wrong with them.

Whatever is read stays as it was.
"""

import tomllib

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import InputError

MOTION = "time,abduction,medial\n0.0,0.0,0.2\n0.5, 0.1, 0.3\n\n1.0,0.0,0.4\n"


def write(folder, name, text):
    path = folder / name
    path.write_text(text)
    return path


def test_columns_of_a_file_beside_the_scenario_become_samples_of_their_joints(tmp_path):
    write(tmp_path, "motion.csv", MOTION)
    path = write(tmp_path, "mine.toml", 'extends = "reversals"\n[reference]\nfile = "motion.csv"\n')
    joints = fp.load_scenario(path).reference.joints
    assert joints["medial"].kind == "samples" and joints["medial"].times == (0.0, 0.5, 1.0)
    assert joints["medial"].values == (0.2, 0.3, 0.4) and joints["medial"].offset == 0.0
    assert joints["proximal"] == fp.load_scenario("reversals").reference.joints["proximal"]


def test_a_path_in_an_override_is_relative_to_the_working_directory(tmp_path, monkeypatch):
    write(tmp_path, "motion.csv", MOTION)
    monkeypatch.chdir(tmp_path)
    assert fp.load_scenario("reversals", {"reference.file": "motion.csv"}).reference.joints["medial"].kind == "samples"


def test_the_written_scenario_needs_no_other_file(tmp_path):
    motion = write(tmp_path, "motion.csv", MOTION)
    pulls = write(tmp_path, "pulls.csv", "time,T1,T3\n0,1,4\n2,2,5\n")
    force = write(tmp_path, "force.csv", "time,z\n0,0\n2,-0.5\n")
    scenario = fp.load_scenario(
        "reversals",
        {
            "reference.file": str(motion),
            "controller": {"kind": "tensions", "file": str(pulls)},
            "environment.fingertip_force_file": str(force),
        },
    )
    for path in (motion, pulls, force):
        path.unlink()
    assert fp.load_scenario(write(tmp_path, "again.toml", fp.to_toml(scenario))) == scenario
    assert scenario.controller.tensions["T3"].values == (4.0, 5.0)
    assert scenario.environment.fingertip_force_signal["z"].values == (0.0, -0.5)


def test_a_signal_of_another_kind_replaces_the_one_that_is_extended_and_keeps_nothing_of_it(tmp_path):
    path = write(
        tmp_path,
        "mine.toml",
        'extends = "reversals"\n[reference.joints.medial]\nkind = "step"\ntime = 1.0\nheight = 0.2\n',
    )
    medial = fp.load_scenario(path).reference.joints["medial"]
    assert (medial.amplitude, medial.offset, medial.height) == (0.0, 0.0, 0.2)


def test_the_kind_may_be_overridden_before_or_after_what_belongs_to_it():
    key = "reference.joints.medial"
    overrides = {f"{key}.time": 1.0, f"{key}.height": 0.2, f"{key}.kind": "step", f"{key}.offset": 0.1}
    medial = fp.load_scenario("reversals", overrides).reference.joints["medial"]
    assert (medial.kind, medial.amplitude, medial.offset, medial.height) == ("step", 0.0, 0.1, 0.2)


def test_entries_that_are_not_set_are_not_written():
    written = tomllib.loads(fp.to_toml(fp.load_scenario("reversals")))
    assert "tensions" not in written["controller"] and set(written["environment"]) == {"fingertip_force"}
    assert set(written["reference"]["joints"]["medial"]) == {"kind", "offset", "amplitude", "frequency", "phase"}


KEY = "reference.joints.medial"
POINTS = {"kind": "points", "times": [0.0, 1.0], "values": [0.0, 0.5]}
WRONG = [
    ({KEY: {"kind": "step", "time": 1.0}}, f"{KEY}.height", 'is missing: kind = "step" needs time, height'),
    ({KEY: {"kind": "sine", "duration": 1.0}}, f"{KEY}.duration", 'is for kind = "ramp", not "sine"'),
    ({KEY: {"kind": "stop"}}, f"{KEY}.kind", "did you mean step?"),
    ({KEY: POINTS | {"times": [0.0, 1.0, 2.0]}}, f"{KEY}.values", "must be 3 numbers, one for each of times"),
    ({KEY: POINTS | {"times": [0.0, 0.0]}}, f"{KEY}.times[1]", "times must increase"),
    ({KEY: POINTS | {"values": [0.0, 45.0]}}, f"{KEY}.values[1]", "is it in degrees?"),
    ({KEY: POINTS | {"values": 0.5}}, f"{KEY}.values", "must be a list of numbers"),
    ({KEY: POINTS | {"times": "proximal"}}, f"{KEY}.times", "or the name of another signal here that has one"),
    ({KEY: POINTS | {"times": [0.0], "values": [0.5]}}, f"{KEY}.times", "must be 2 to 1000000 numbers"),
    ({"reference.joints.distal": POINTS}, "reference.joints.distal", "follows from the passive tendon (20)"),
    ({"reference.joints.medail": POINTS}, "reference.joints.medail", "did you mean medial?"),
    ({"controller.tensions.T1": {"offset": 1.0}}, "controller.tensions", 'is for controller.kind = "tensions"'),
    ({"environment.fingertip_force_signal.w": {}}, "environment.fingertip_force_signal.w", "the axes are x, y, z"),
    ({"reference.file": 3}, "reference.file", "must be the path of a CSV file"),
    ({"simulation.initial.position.medail": 0.1}, "simulation.initial.position.medail", "did you mean medial?"),
    ({"simulation.initial.position.medial": 30}, "simulation.initial.position.medial", "is it in degrees?"),
    ({"simulation.initial.velocity.distal": "x"}, "simulation.initial.velocity.distal", "must be a number"),
]


@pytest.mark.parametrize(("overrides", "entry", "said"), WRONG, ids=[each[1] for each in WRONG])
def test_a_wrong_entry_is_named_in_one_line(overrides, entry, said):
    with pytest.raises(InputError) as caught:
        fp.load_scenario("reversals", overrides)
    assert caught.value.entry == entry
    assert said in str(caught.value) and "\n" not in str(caught.value)


PULLS = [
    ({"tensions": {"T5": {"offset": 1.0}}}, "controller.tensions.T5", "is a passive tendon, which has no actuator"),
    ({"tensions": {"T7": {"offset": 1.0}}}, "controller.tensions.T7", "no such tendon; actuated are T1, T2, T3, T4"),
    ({"tensions": {"T1": {"offset": 1.0, "amplitude": 1.5}}}, "controller.tensions.T1", "not -0.5 N"),
    ({"gain": 2.0}, "controller.gain", "has no effect"),
]


@pytest.mark.parametrize(("table", "entry", "said"), PULLS, ids=[each[1] for each in PULLS])
def test_tensions_that_cannot_be_are_named_in_one_line(table, entry, said):
    with pytest.raises(InputError) as caught:
        fp.load_scenario("reversals", {"controller": {"kind": "tensions"} | table})
    assert caught.value.entry == entry and said in str(caught.value)


COLUMNS = [
    ("", "must have a header and rows"),
    ("seconds,medial\n0,1\n1,2\n", 'no column is called time or t; there are seconds, medial; write time = "NAME"'),
    ("time,medial,medial\n0,1,1\n1,2,2\n", "each once"),
    ("time,medial (rad),medial (deg)\n0,1,1\n1,2,2\n", "two columns are of the same signal"),
    ("time,medial\n0,1\n", "two rows at least"),
    ("time,medial\n0,1\n1,2,3\n", "row 2 has 3 values, the header names 2"),
    ("time,medial\n0,1\n1,x\n", "column medial has no number in row 2"),
    ("time,medial\n0,1\n1,nan\n", "column medial has no number in row 2"),
    ("time,medial\n0,1\n1,\n", "column medial has no number in row 2"),
    ("time,medial\n1,1\n\n1,1\n", "times must increase, two rows at least, and do not from row 1 to the next"),
    ("time,medial (mm)\n0,1\n1,1\n", "is a unit of what is in m, and this is in rad"),
    ("t,medial\n0,1\n500,1\n1000,1\n", "its 3 rows take 0.001 s in us or 1 s in ms or 1000 s in s: write {"),
    ("t,medial\n0,10\n1,30\n", "rad (is it in degrees?)"),
    ("time,distal\n0,1\n1,1\n", "follows from the passive tendon (20); leave it out"),
    ("time,medail\n0,1\n1,1\n", "did you mean medial?"),
]


@pytest.mark.parametrize(("text", "said"), COLUMNS)
def test_an_error_in_a_file_of_columns_is_named_in_one_line(tmp_path, text, said):
    path = write(tmp_path, "motion.csv", text)
    with pytest.raises(InputError) as caught:
        fp.load_scenario("reversals", {"reference.file": str(path)})
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_many_samples_are_read_alike_at_once_and_row_by_row_and_written_bit_for_bit(tmp_path):
    times, angles = np.arange(10_001) / 3.0, np.random.default_rng(1).uniform(0.0, 1.0, 10_001)
    rows = [f"{time!r}, {angle!r}" for time, angle in zip(times.tolist(), angles.tolist(), strict=True)]
    loaded = []
    # What is quoted is read row by row.
    for header in ("time,medial", 'time,"medial"'):
        path = write(tmp_path, "motion.csv", "\n".join([header, *rows]))
        loaded.append(fp.load_scenario("reversals", {"reference.file": str(path)}))
    medial = loaded[0].reference.joints["medial"]
    assert loaded[0] == loaded[1] and medial.times == tuple(times) and medial.values == tuple(angles)
    text = fp.to_toml(loaded[0])
    assert fp.load_scenario(write(tmp_path, "again.toml", text)) == loaded[0] and len(text) < 250_000
    # Both signals of another file, and their times once, in 4 letters for 3 of 8 bytes each.
    both = "\n".join(["time,medial,proximal", *(f"{row},0.25" for row in rows)])
    given = fp.load_scenario("reversals", {"reference.file": str(write(tmp_path, "both.csv", both))})
    doubles = 3 * 8 * len(times) * 4 / 3
    assert doubles < len(fp.to_toml(given)) < doubles + 10_000
    assert fp.load_scenario(write(tmp_path, "both.toml", fp.to_toml(given))) == given
    cut = write(tmp_path, "cut.toml", text.replace("times = 'base64:", "times = 'base64:?"))
    with pytest.raises(InputError, match=r"medial.times = .*: must be a list of numbers"):
        fp.load_scenario(cut)


def test_a_missing_file_of_columns_is_named():
    with pytest.raises(InputError, match=r"reference.file .*nowhere.csv: there is no such file"):
        fp.load_scenario("reversals", {"reference.file": "nowhere.csv"})


SPELT = [
    "time;proximal;medial\n0;0.1;0.1\n0.5;0.3;0.2\n1;0.7;0.4\n",
    "# a rig\nt\tproximal\tmedial\n0\t0,1\t0,1\n# a break\n0,5\t0,3\t0,2\n1\t0,7\t0,4\n",
    "Time [ms],proximal,medial (mrad)\n0,0.1,100\n500,0.3,200\n1000,0.7,400\n",
    '"time_ms";"medial";"proximal_mrad"\n"0";"0,1";100\n"500";"0,2";300\n"1000";"0,4";700\n',
]


@pytest.mark.parametrize("text", SPELT, ids=["semicolons", "decimal commas", "units", "units in names"])
def test_a_motion_is_read_from_the_files_that_recordings_are_read_from(tmp_path, text):
    joints = fp.load_scenario(
        "reversals", {"reference.file": str(write(tmp_path, "motion.csv", text))}
    ).reference.joints
    assert joints["medial"].times == joints["proximal"].times == pytest.approx((0.0, 0.5, 1.0), abs=1e-15)
    assert joints["proximal"].values == pytest.approx((0.1, 0.3, 0.7), abs=1e-15)
    assert joints["medial"].values == pytest.approx((0.1, 0.2, 0.4), abs=1e-15)


def test_a_table_tells_the_times_names_units_and_delays_of_a_files_columns(tmp_path):
    write(tmp_path, "rig.csv", "n,clock,q1,q2\n1,0,0,18\n2,500,9,36\n3,1000,18,54\n")
    path = write(
        tmp_path,
        "mine.toml",
        'extends = "reversals"\n[reference.file]\npath = "rig.csv"\ntime = { column = "clock", unit = "ms" }\n'
        'columns = { medial = { column = "q2", unit = "deg", delay = 0.1 } }\n',
    )
    joints = fp.load_scenario(path).reference.joints
    assert joints["medial"].values == pytest.approx(np.pi * np.array([0.1, 0.2, 0.3]))
    assert joints["medial"].times == pytest.approx((-0.1, 0.4, 0.9))
    assert joints["proximal"] == fp.load_scenario("reversals").reference.joints["proximal"]
    for change, said in [
        (("clock", "clack"), 'reference.file.time = "clack": no such column'),
        (("delay", "dely"), "did you mean reference.file.columns.medial.delay?"),
        (('"ms"', '"ms", delay = 0.1'), "reference.file.time.delay = 0.1: is for signals"),
    ]:
        path.write_text(path.read_text().replace(*change))
        with pytest.raises(InputError) as caught:
            fp.load_scenario(path)
        assert said in str(caught.value) and "\n" not in str(caught.value)
        path.write_text(path.read_text().replace(*reversed(change)))


def test_slow_motions_are_taken_where_the_unit_says_so(tmp_path):
    motion = write(tmp_path, "motion.csv", "t (s),medial\n0,0.1\n500,0.2\n1000,0.3\n")
    assert fp.load_scenario("reversals", {"reference.file": str(motion)}).reference.joints["medial"].times[-1] == 1000.0


def frozen(value):
    """Return a table as text in which nothing of it is left out; a description is the same object."""
    if isinstance(value, dict):
        return {key: frozen(each) for key, each in value.items()}
    return [frozen(each) for each in value] if isinstance(value, list) else repr(value)


@pytest.mark.parametrize("base", ["hand", "servo_bench", "reversals"])
def test_loading_changes_neither_the_table_nor_the_overrides_that_it_is_given(tmp_path, monkeypatch, base):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motion.csv").write_text("time,medial\n0.0,0.2\n1.0,0.4\n")
    table = tomllib.loads(fp.to_toml(fp.load_scenario(base)))
    points = {"kind": "points", "times": [0.0, 1.0], "values": [0.0, 0.1]}
    if base == "hand":
        table["hand"]["fingers"] |= {"index": "ub_stand_in", "ring": {"finger": {"base": "ub_stand_in"}, "scale": 1.1}}
        table["hand"]["palm"]["path"] = {"x": points, "y": points | {"times": "x"}}
        overrides = {"hand.fingers": {"little": "ub_stand_in"}, "hand.fingers.*.finger.passive_tendon": {"mass": 1e-5}}
    elif base == "servo_bench":
        table["finger"]["actuators"]["M1"]["motor"] = "XL330-M288"
        overrides = {"finger.actuators.*.motor": {"base": "XL330-M288"}, "finger.joint_friction.law": "coulomb"}
    else:
        table["reference"] = {"file": {"path": "motion.csv"}, "joints": {"medial": points}}
        overrides = {"finger": {"base": "ub_stand_in"}}
    given, shipped = frozen([table, overrides]), fp.to_toml(fp.load_scenario(base))
    changed = read_scenario(table, overrides)
    assert frozen([table, overrides]) == given
    assert fp.to_toml(changed) != shipped == fp.to_toml(fp.load_scenario(base, {"name": base}))
