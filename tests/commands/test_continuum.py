"""The comparison of frictions on a continuum robot: coefficients of made-up recordings in closed form are met again."""

import continuum
import numpy as np
import pytest

# A cord that is wound by a servo turns by a right angle and stretches a spring: k z = K (p + w - z) less friction.
STIFFNESS, GAIN, PRETENSION, TURN = 200.0, 600.0, 0.01, np.pi / 2.0
XML = f"""<mujoco><option gravity="0 0 0"/><worldbody><site name="servo"/><site name="turn" pos="0.1 0 0"/>
<body pos="0.1 0 -0.2"><joint name="z" type="slide" axis="0 0 1" stiffness="{STIFFNESS}" damping="30"/>
<geom size="0.01" mass="0.1"/><site name="end"/><site name="force_site_tip"/></body></worldbody>
<tendon><spatial name="cord"><site site="servo"/><site site="turn"/><site site="end"/></spatial></tendon>
<actuator><position tendon="cord" kp="{GAIN}" forcelimited="true" forcerange="-100 0"/></actuator>
<keyframe><key name="pretension" ctrl="{0.3 - PRETENSION}"/></keyframe></mujoco>"""
WOUND = 1e-3 * np.concatenate([np.linspace(0.0, 30.0, 7), np.linspace(25, 0, 6), np.linspace(8, 24, 3)])[:, None]


def settled(bounds):
    """Return the tip's path where it rests anywhere between two positions that a friction leaves it."""
    z, path = 0.0, []
    for pulled in PRETENSION + WOUND[:, 0]:
        z = np.clip(z, *bounds(pulled))
        path.append((0.0, 0.0, z))
    return np.array(path)


def under_loss(loss):
    return settled(lambda w: ((GAIN * w - loss) / (STIFFNESS + GAIN), (GAIN * w + loss) / (STIFFNESS + GAIN)))


def under_capstan(coulomb):
    gains = [GAIN * np.exp(way * coulomb * TURN) for way in (-1.0, 1.0)]
    return settled(lambda w: [gain * w / (STIFFNESS + gain) for gain in gains])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "truth", "path"), [("constant loss", 0.8, under_loss), ("capstan with bristles", 0.15, under_capstan)]
)
def test_the_coefficient_of_a_recording_in_closed_form_is_met(name, truth, path):
    law = continuum.LAWS[name]
    recording = continuum.Recording(WOUND, path(truth))
    best, error = continuum.fit(XML, law, recording, 0.5)
    assert best == pytest.approx(truth, rel=0.12)
    _, without = continuum.fit(XML, continuum.LAWS["none"], recording, 0.5)
    assert error < 0.15 * without
    assert continuum.fit(XML, law, continuum.Recording(WOUND, path(0.0)), 0.5)[0] == 0.0
    tips = continuum.replay(XML, law, truth, WOUND, 0.5)
    assert continuum.tip_error(recording.tip, tips) < 0.04 * without


def test_an_offset_of_servos_takes_from_what_is_wound_in_and_adds_to_what_is_let_go():
    offset = 0.4e-3
    tips = continuum.replay(XML, continuum.LAWS["constant offset of servos"], offset, WOUND, 0.5)
    # The repository's tanh of steps in mm.
    expected = GAIN * (PRETENSION + WOUND[:, 0] - offset * np.tanh(1000.0 * np.diff(WOUND[:, 0], prepend=0.0)))
    assert 0.2 + tips[:, 2] == pytest.approx(expected / (STIFFNESS + GAIN), abs=2e-5)


def test_the_error_is_the_distance_less_its_mean():
    measured = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    # Less (1.5, 2, 0) both are off by 2.5.
    assert continuum.tip_error(measured, np.full((2, 3), 7.0)) == pytest.approx(2.5)


def test_recordings_are_read_cord_by_cord_in_metres(tmp_path):
    pulls, readings = tmp_path / "pulls.csv", tmp_path / "train.csv"
    pulls.write_text("pattern_label\nrep1_tendon1_id4_pull\nrep1_tendon0_id9_pull\nneutral\n")
    readings.write_text("servo_4_mm,servo_9_mm,tip_x,tip_y,tip_z\n1,2,3,4,5\n")
    wound, tip = continuum.read(readings, pulls)
    assert wound == pytest.approx(np.array([[2e-3, 1e-3]]))
    assert tip == pytest.approx(np.array([[3e-3, 4e-3, 5e-3]]))


def test_a_folder_without_the_robot_is_refused_in_a_line(tmp_path, capsys):
    assert continuum.main([str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "clone" in line and "ContinuumRoboticsLab/opencr-mujoco" in line and str(tmp_path) in line
