"""What the page of this room shows works as it is shown."""

import re
from pathlib import Path

import pytest

import finger_pin as fp
import finger_pin.description

PAGE = (Path(finger_pin.description.__file__).parent / "README.md").read_text("utf-8")
BLOCKS = {kind: re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL) for kind in ("toml", "csv", "python")}


@pytest.mark.parametrize("text", BLOCKS["toml"])
def test_every_scenario_of_the_page_runs(text, tmp_path):
    (motion,) = BLOCKS["csv"]
    (tmp_path / "motion.csv").write_text(motion)
    path = tmp_path / "shown.toml"
    path.write_text(text)
    result = fp.simulate(fp.load_scenario(path, {"simulation.duration": 0.005}))
    assert result.sizes["time"] == 6


def test_the_python_of_the_page_runs_from_top_to_bottom():
    names = {}
    for text in BLOCKS["python"]:
        exec(compile(text, "README.md", "exec"), names)
    assert float(names["second"].joint_reference[0, 0]) == pytest.approx(float(names["first"].joint_reference[-1, 0]))
