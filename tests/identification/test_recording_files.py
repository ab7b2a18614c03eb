"""Files of recordings: read as spreadsheets write them, refused in one line."""

import numpy as np
import pytest

from finger_pin.commands.application import run
from finger_pin.description.recordings.columns import read_columns

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
    "text",
    [
        GOOD,
        "\ufeff" + GOOD,
        GOOD.replace("in,out", '"in","out"').replace("\n", "\r\n"),
        GOOD.replace(",", ";"),
        GOOD.replace(",", ";").replace(".", ","),
        GOOD.replace(",", "\t"),
        "# a rig\n" + GOOD.replace("\n9", "\n# a break\n9"),
    ],
    ids=["plain", "byte order mark", "quoted, carriage returns", "semicolons", "decimal commas", "tabs", "comments"],
)
def test_files_are_read_as_spreadsheets_write_them(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_bytes(text.encode())
    table = read_columns("file", path)
    np.testing.assert_array_equal([table["in"], table["out"]], [[3, 6, 9, 12], [2.1, 4.4, 6.9, 9.3]])
