"""Files of recordings: read as spreadsheets write them, refused in one line."""

import numpy as np
import pytest

from finger_pin.commands.application import run
from finger_pin.description.recordings.bench import Column, RecordingSettings
from finger_pin.description.recordings.columns import Table, read_signals
from finger_pin.description.recordings.csv_files import TableFormat, read_columns
from finger_pin.description.recordings.units import in_si
from finger_pin.description.validation import validate
from finger_pin.exceptions import InputError
from finger_pin.identification.residuals.recordings import read_recording, wraparound_warning

BENCH = """
extends = "canal"
[identify.parameters]
"finger.tendon_friction.coulomb" = [0.005, 1.0]
[identify.recordings.table]
file = "mine.csv"
kind = "steady"
speed = 0.05
inputs = { "tendon_command.T1" = "in" }
outputs = { "tendon_tension.T1" = "out" }
"""
GOOD = "in,out\n3,2.1\n6,4.4\n9,6.9\n12,9.3\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD.replace("\n6,", "\nsix,"), "column in has no number in row 2"),
        (GOOD.replace("4.4", "4.4.1"), "column out has no number in row 2"),
        ('in,out\n"3,0","2,1"\n"6,0","4,4"\n', '"3,0": column in has no number in row 1'),
        (GOOD.replace("3,", "-3,"), "a tendon only pulls"),
        (GOOD.replace("out", "in"), "must name every column, each once"),
        (GOOD.replace("in,", "in [kg],"), "column in [kg] is in kg, which is no unit known here; write unit"),
        (GOOD.replace("out", "out (Newton)"), "column out (Newton) is in Newton, which is no unit known here"),
        (GOOD.replace("out", "out (mm)"), "is a unit of what is in m, and this is in N"),
        (GOOD + "1\n", "row 5 has 1 values, the header names 2"),
        ("", "must have a header"),
        ("in,out\n", "must have a header"),
        (GOOD.replace("out", "aus°").encode("cp1252"), "is not a text file in UTF-8"),
        (None, "there is no such file"),
    ],
)
def test_wrong_files_are_refused_in_one_line_and_nothing_is_written(tmp_path, capsys, text, said):
    bench = tmp_path / "bench.toml"
    bench.write_text(BENCH)
    if text is not None:
        (tmp_path / "mine.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert run("identify", [str(bench), "--output", str(tmp_path / "out"), "--quiet"]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told and "\n" not in told and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "form"),
    [
        (GOOD, {}),
        ("\ufeff" + GOOD, {}),
        (GOOD.replace("in,out", '"in","out"').replace("\n", "\r\n"), {}),
        (GOOD.replace(",", ";"), {}),
        (GOOD.replace(",", ";").replace(".", ","), {}),
        (GOOD.replace(",", "\t"), {}),
        ("# a rig\n" + GOOD.replace("\n9", "\n# a break\n9"), {}),
        (GOOD.replace("\n", ",\n"), {}),
        (GOOD.replace("\n", ";;\n").replace(",", ";"), {}),
        (GOOD.replace("\n", ",\n").replace("out,", "out"), {}),
        (GOOD.replace("4.4\n", "4.4,\n"), {}),
        (("größe,°\n\n" + GOOD).encode("cp1252"), {"encoding": "cp1252", "skip_rows": 2}),
        (GOOD.encode("utf-16"), {"encoding": "utf-16"}),
        (GOOD.replace("\n3", "\nN,N\n3"), {"skip_rows": [2]}),
        ("\ufeff" + GOOD, {"encoding": "UTF-8"}),
    ],
)
def test_files_are_read_as_spreadsheets_write_them(tmp_path, text, form):
    path = tmp_path / "mine.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    table = read_columns("file", path, validate(TableFormat, form, ()))
    np.testing.assert_array_equal([table["in"], table["out"]], [[3, 6, 9, 12], [2.1, 4.4, 6.9, 9.3]])


def test_separators_at_the_end_hide_no_missing_and_no_further_cells(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text("in,out,\n3,,\n6,4.4,\n")
    np.testing.assert_array_equal(read_columns("file", path)["out"], [np.nan, 4.4])
    path.write_text("in,out,\n3,2,1\n6,4.4,\n")
    with pytest.raises(InputError, match="row 1 has 3 values, the header names 2"):
        read_columns("file", path)


SECONDS = [0.0, 0.25, 1.5]
DATES = ["2025-11-16T23:59:59.123456789", "2025-11-16T23:59:59.373456789", "2025-11-17T00:00:00.623456789"]


@pytest.mark.parametrize(
    ("cells", "column"),
    [
        (DATES, {}),
        ([f"{date}Z" for date in DATES], {}),
        ([date.replace("T", " ").replace(".", ",") + "+01" for date in DATES], {}),
        ([f"{DATES[0]}Z", f"{DATES[1].replace('T23', 'T22')}-01:00", "2025-11-17T05:30:00.623456789+0530"], {}),
        ([1763300000123456789, 1763300000373456789, 1763300001623456789], {"unit": "ns"}),
        ([1763300000.0, 1763300000.25, 1763300001.5], {}),
        ([4294967290, 249994, 1499994], {"unit": "us", "period": 2.0**32}),
        ([500, 750, 2000], {"unit": "ms", "offset": -0.5}),
    ],
)
def test_times_are_dates_epochs_and_timers_that_come_round(cells, column):
    times = Table("x", {"t": cells, "y": [1.0, 2.0, 3.0]}).times("time", Column(column="t", **column))
    # Doubles tell nanoseconds of an epoch to a quarter of a microsecond.
    np.testing.assert_allclose(times - times[0], np.array(SECONDS), rtol=0, atol=3e-7)
    assert times[0] == 0.0 or "period" in column


@pytest.mark.parametrize(
    ("start", "apart", "rows", "spans"),
    [
        # 100 Hz in ms, 1 kHz in ms of half a second, 1 kHz in us, and what may be 1 Hz in us or 1 kHz in ns.
        (0.0, 10.0, 10, "0.09 s in ms or 90 s in s"),
        (0.0, 1.0, 501, "0.5 s in ms or 500 s in s"),
        (84213.0, 1e3, 501, "0.5 s in us or 500 s in ms or 500000 s in s"),
        (7e9, 1e6, 501, "0.5 s in ns or 500 s in us or 5e+08 s in s"),
        # An epoch tells its unit: 2025 in ns, us and ms.
        (1.7633e18, 1e6, 501, "0.5 s in ns or 5e+08 s in s"),
        (1.7633e15, 1e5, 501, "50 s in us or 5e+07 s in s"),
        (1.7633e12, 1e2, 501, "50 s in ms or 50000 s in s"),
        # Half a second of a clock that has run for two seconds, in ns: no epoch has rows a thousand seconds apart.
        (2e9, 1e6, 501, "0.5 s in ns or 500 s in us or 5e+08 s in s"),
    ],
)
def test_times_of_no_unit_are_asked_about_with_the_time_that_they_take_in_each_unit(start, apart, rows, spans):
    table = Table("x", {"t": start + apart * np.arange(rows)})
    with pytest.raises(InputError) as error:
        table.times("time", Column(column="t"))
    assert f"its {rows} rows take {spans}: write" in str(error.value)
    assert f'unit = "{spans.split(" s in ")[1].split()[0]}"' in str(error.value)
    times = table.times("time", Column(column="t", unit="s"))
    assert times[-1] - times[0] == pytest.approx(apart * (rows - 1), rel=1e-6)


@pytest.mark.parametrize(("start", "apart"), [(0.0, 0.99), (1.7633e9, 2.0)])
def test_seconds_that_samples_take_are_not_asked_about(start, apart):
    times = Table("x", {"t": start + apart * np.arange(10)}).times("time", Column(column="t"))
    assert times[-1] - times[0] == pytest.approx(9.0 * apart, rel=1e-6)


def test_rows_without_times_follow_each_other_at_their_rate():
    data = {"pull": [1.0, 2.0, 3.0], "angle": [0.0, 0.1, 0.2]}
    np.testing.assert_allclose(recording(data, time=None, sample_rate=50.0).time, [0.0, 0.02, 0.04], rtol=1e-12)


def test_an_epoch_in_a_file_of_signals_begins_at_zero(tmp_path):
    (tmp_path / "a.csv").write_bytes("rig µ\ntime,medial (°)\n1763300000,0\n1763300002,90\n".encode("cp1252"))
    source = {"path": "a.csv", "encoding": "cp1252", "skip_rows": 1}
    medial = read_signals("reference.file", source, tmp_path, lambda _: "rad")["medial"]
    assert list(medial["times"]) == [0.0, 2.0] and list(medial["values"]) == [0.0, np.pi / 2]


MOTION = {"time": "t", "inputs": {"tendon_command.T1": "pull"}, "outputs": {"joint_position.drum": "angle"}}


def recording(data, **change):
    settings = validate(RecordingSettings, {**MOTION, **change}, ("identify", "recordings", "one"))
    return read_recording("one", settings, data)


def test_rows_of_one_time_are_refused_or_their_mean_is_one_row():
    data = {"t": [0.0, 0.25, 0.25, 0.25, 0.5], "pull": [1, 2, 3, 7, 9], "angle": [0.5, 0.1, np.nan, 0.3, np.nan]}
    with pytest.raises(InputError, match='row 2 to the next, which has the same time; repeated_times = "mean"'):
        recording(data)
    one = recording(data, repeated_times="mean")
    np.testing.assert_array_equal([one.time, one.inputs["tendon_command.T1"]], [[0.0, 0.25, 0.5], [1, 4, 9]])
    np.testing.assert_allclose(one.outputs["joint_position.drum"], [0.5, 0.2, np.nan])
    assert one.speed.shape == (3,)
    with pytest.raises(InputError, match="times must increase"):
        recording({**data, "t": [0.0, 0.25, 0.25, 0.1, 0.5]}, repeated_times="mean")


def test_ticks_that_come_round_are_unwrapped_and_told_without_a_period():
    turns = 0.9 + np.append(np.linspace(0.0, 2.5, 40), np.linspace(2.4, -1.5, 40))
    ticks = np.where(np.arange(80) % 7 == 3, np.nan, np.round(4096 * turns) % 4096)
    data = {"t": 0.1 * np.arange(80.0), "pull": np.ones(80), "angle": ticks}
    column = {"column": "angle", "scale": 2 * np.pi / 4096}
    one = recording(data, outputs={"motor_position.M1": {**column, "period": 4096}})
    known = np.where(np.isnan(ticks), np.nan, 2 * np.pi * np.round(4096 * turns) / 4096)
    np.testing.assert_allclose(one.outputs["motor_position.M1"], known, rtol=1e-12)
    # 0.9 + 0.064 turns are below one, a further step is not.
    assert not wraparound_warning(one)
    said = wraparound_warning(recording(data, outputs={"motor_position.M1": column}))
    assert "jumps by a turn after row 2:" in said and said.endswith("write period = 4096")
    # Goals jump as angles do, and degrees by 360.
    goals = {"time": "t", "inputs": {"spool_angle.M1": "goal (deg)"}, "outputs": {"motor_current.M1": "pull"}}
    wrapped = {"t": data["t"], "pull": data["pull"], "goal (deg)": 360.0 * (turns % 1.0)}
    assert wraparound_warning(recording(wrapped, **goals)).endswith("write period = 360")


REFUSED = [
    ({"encoding": "cp9999"}, "encoding: must be the name of a text encoding"),
    ({"encoding": "hex"}, "encoding: must be the name of a text encoding"),
    ({"skip_rows": -1}, "skip_rows: must be a number of lines before the header"),
    ({"skip_rows": [0]}, "skip_rows: counts lines from 1"),
    ({"repeated_times": "first"}, "repeated_times: must be one of refuse, mean"),
    ({"outputs": {"joint_position.drum": {"column": "angle", "period": 0}}}, "period: must be above 0"),
    ({"outputs": {"joint_position.drum": {"column": "angle", "period": 0.3}}}, "period: must be above 0.5"),
    ({"outputs": {"joint_position.drum": {"column": "angle", "period": 0.8}}}, "the way from row 1 to the next"),
    ({"time": "word"}, "no date of ISO 8601 in row 1"),
    ({"time": "mixed"}, "dates with a zone and dates without one"),
    ({"time": {"column": "date", "unit": "s"}}, "time.unit: is for numbers"),
    ({"kind": "steady", "time": None, "repeated_times": "mean"}, "repeated_times: is for motions only"),
    ({"time": None}, "time: is missing: the column of times"),
    ({"sample_rate": 100.0}, "sample_rate = 100.0: is for rows without times: leave out this or time"),
    ({"time": None, "sample_rate": 9.0, "repeated_times": "mean"}, "leave out this or repeated_times"),
    ({"kind": "steady", "time": None, "sample_rate": 9.0, "speed": 1.0}, "sample_rate: is for motions only"),
    ({"outputs": {"joint_position.drum": {"column": "angle", "hold": True}}}, "hold = true: is for inputs of motions"),
    ({"time": {"column": "t", "hold": True}}, "time.hold = true: is for inputs of motions"),
]


@pytest.mark.parametrize(("change", "said"), REFUSED)
def test_a_format_that_says_nothing_sensible_is_refused(change, said):
    data = {"t": [0.0, 0.1, 0.2], "pull": [1, 2, 3], "angle": [0.0, 0.4, 0.5], "word": ["now", "then", "later"]}
    data |= {"date": DATES, "mixed": [*DATES[:2], f"{DATES[2]}Z"]}
    with pytest.raises(InputError) as error:
        recording(data, **change)
    assert all(words in str(error.value) for words in said.split(": "))


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("\N{DEGREE SIGN}/s", "rad/s", np.pi / 180),
        ("\N{MICRO SIGN}m", "m", 1e-6),
        ("mN\N{MIDDLE DOT}m", "N m", 1e-3),
        ("Nm", "N m", 1.0),
        # 16 avoirdupois ounces are a pound.
        ("ozf in", "N m", 0.45359237 / 16 * 9.80665 * 0.0254),
        ("mm/min", "m/s", 1e-3 / 60),
        ("kV", "V", 1e3),
    ],
)
def test_units_are_read_as_others_spell_them(unit, si, factor):
    assert in_si("x", unit, si) == pytest.approx(factor, rel=1e-12)
    with pytest.raises(InputError, match=f"is a unit of what is in {si}"):
        in_si("x", unit, "A")


def test_a_scale_leads_from_any_unit_in_brackets_to_si():
    data = {"t": [0.0, 0.1], "pull [counts]": [10.0, 20.0], "angle": [0.0, 0.1]}
    one = recording(data, inputs={"tendon_command.T1": {"column": "pull", "scale": 0.5}})
    np.testing.assert_array_equal(one.inputs["tendon_command.T1"], [5.0, 10.0])
    with pytest.raises(InputError, match="is in counts, which is no unit known here"):
        recording(data)
