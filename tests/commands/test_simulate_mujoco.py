"""`simulate --mujoco`: the hand of a MuJoCo model moves, and what cannot be is said."""

import shutil
import tomllib

import numpy as np
import pytest
import xarray as xr
from unpacked_page import unpacked

from finger_pin.commands.application import run_function
from finger_pin.commands.simulate_command import simulate

HAND = """<mujoco><compiler angle="radian"/><worldbody><site name="base" pos="0 0 0.02"/>
<body><joint name="finger:joint" axis="0 1 0" range="-0.2 1.5" damping="0.01"/>
 <geom type="capsule" size="0.01" fromto="0 0 0 0.1 0 0"/><site name="end" pos="0.05 0 0.01"/></body></worldbody>
<tendon><spatial name="flexor"><site site="base"/><site site="end"/></spatial></tendon>
<actuator><position name="servo" joint="finger:joint" kp="1" ctrlrange="0 1"/></actuator></mujoco>"""


@pytest.mark.slow
def test_a_mujoco_hand_is_simulated_and_its_scenario_runs_again(tmp_path, capsys):
    (tmp_path / "one.xml").write_text(HAND)
    output = tmp_path / "out"
    arguments = ["--mujoco", str(tmp_path / "one.xml"), "--duration", "0.5", "--output", str(output)]
    assert run_function(simulate, arguments) == 0
    said = capsys.readouterr().out
    assert "Not carried over" not in said
    assert "servo" in said and "finger_joint" in said
    assert sorted(each.name for each in (output / "figures").iterdir()) == ["energy.png", "motion.png"]
    scene, _ = unpacked((output / "animation.html").read_text("utf-8"))
    solids = [each["object"]["geometries"][0]["type"] for each in scene["commands"] if each["type"] == "set_object"]
    assert "finger_joint_link" in scene["links"] and "CylinderGeometry" in solids
    result = xr.load_dataset(output / "trajectory.nc")
    assert np.ptp(result.joint_position.values) > 0.3
    shutil.copy(output / "scenario.toml", tmp_path / "again.toml")
    again = ["--no-figures", "--quiet", "--output", str(tmp_path / "again"), str(tmp_path / "again.toml")]
    assert run_function(simulate, again) == 0
    repeated = xr.load_dataset(tmp_path / "again" / "trajectory.nc")
    np.testing.assert_array_equal(repeated.joint_position, result.joint_position)


def test_a_model_that_is_refused_leaves_one_line_and_nothing_else(tmp_path, capsys):
    (tmp_path / "one.xml").write_text(HAND.replace("<tendon>", "<tendn>"))
    assert run_function(simulate, ["--mujoco", str(tmp_path / "one.xml"), "--output", str(tmp_path / "out")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_model_without_actuators_says_that_nothing_drives_it(tmp_path, capsys):
    (tmp_path / "one.xml").write_text(HAND[: HAND.index("<tendon>")] + "</mujoco>")
    arguments = ["--mujoco", str(tmp_path / "one.xml"), "--duration", "0.05", "--no-figures"]
    assert run_function(simulate, [*arguments, "--output", str(tmp_path / "out")]) == 0
    assert "one: it falls, as nothing drives it" in capsys.readouterr().out


def test_motors_without_a_range_are_held_at_zero_and_named(tmp_path, capsys):
    motors = '<motor name="loose" joint="finger:joint"/><motor name="tame" joint="finger:joint" ctrlrange="0 1"/>'
    (tmp_path / "one.xml").write_text(HAND.replace("<actuator>", f"<actuator>{motors}"))
    arguments = ["--mujoco", str(tmp_path / "one.xml"), "--duration", "0.05", "--no-figures"]
    assert run_function(simulate, [*arguments, "--output", str(tmp_path / "out")]) == 0
    assert "Held at zero, as their controls have no range: loose\n" in capsys.readouterr().out
    inputs = tomllib.loads((tmp_path / "out" / "scenario.toml").read_text("utf-8"))["controller"]["inputs"]
    moved = {name for name, each in inputs.items() if each.get("offset") or each.get("amplitude")}
    assert moved == {"servo", "tame"}
