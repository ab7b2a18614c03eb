"""Where models of MuJoCo start beyond their ranges, sites on wraps, and constraints that MuJoCo makes softer."""

import math

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import InputError, StartWarning

HINGE = """<mujoco><compiler angle="radian"/><worldbody><body name="f"><joint name="f" axis="0 1 0" {joint}/>
<geom type="capsule" size=".008" fromto="0 0 0 .08 0 0" mass=".03" contype="0" conaffinity="0"/></body></worldbody>
{rest}</mujoco>"""
OUTSIDE = 'range="0.2 1.4" armature="0.08" damping="0.6" frictionloss="0.12"'


def hinge(joint, rest=""):
    return fp.from_mujoco(mujoco.MjModel.from_xml_string(HINGE.format(joint=joint, rest=rest)))


def test_a_reference_beyond_its_range_starts_at_the_edge_and_is_listed():
    hand = hinge(OUTSIDE)
    assert hand.tree.keyframes["reference"].position == {"f": 0.2}
    assert hand.tree.left_out == ("keyframe reference: its 0 for joint f, beyond the range, is 0.2 here",)
    np.testing.assert_array_equal(fp.Simulator(hand).state.position, [0.2])


def test_a_keyframe_beyond_a_range_less_its_margin_starts_at_the_edge_of_that():
    hand = hinge(f'{OUTSIDE} margin="0.1"', '<keyframe><key name="open" qpos="1.5"/></keyframe>')
    assert hand.tree.keyframes["open"].position["f"] == pytest.approx(1.3, rel=1e-15)


def test_a_start_beyond_a_range_is_warned_of_with_its_depth_and_energy():
    # Where an equality may want it there the posture stays.
    hand = hinge(OUTSIDE, '<equality><joint joint1="f" polycoef="0 0 0 0 0"/></equality>')
    assert hand.tree.keyframes["reference"].position == {"f": 0.0}
    energy = 0.5 * hand.stroke_limiter.stiffness[0] * 0.2**2
    with pytest.warns(StartWarning, match=rf"joint f: 0\.2 rad beyond 0\.2 to 1\.4, {energy:.2g} J in its stop"):
        fp.Simulator(hand)
    fp.Simulator(hand, [0.2])


def test_a_cord_that_starts_beyond_its_range_is_warned_of():
    rest = '<tendon><fixed name="c" range="-0.01 0.01" limited="true"><joint joint="f" coef="0.1"/></fixed></tendon>'
    hand = hinge('ref="0.3" range="0 1"', rest)
    energy = 0.5 * hand.tree.tendons["c"].limit_stiffness * 0.02**2
    with pytest.warns(StartWarning, match=rf"cord c: 0\.02 m beyond -0\.01 to 0\.01, {energy:.2g} J in its stop"):
        fp.Simulator(hand)


def test_a_simulator_starts_where_muj_co_does():
    np.testing.assert_array_equal(fp.Simulator(hinge('ref="0.3" range="0 1"')).state.position, [0.3])


PRESS = """<mujoco><default><geom solimp="0 0.9 0.01" solref=".02 1"/></default><worldbody>
<geom name="table" type="box" size=".1 .1 .02" pos="0 0 -.02"/><body pos="0 0 .0301"><joint type="slide" axis="0 0 1"
damping="40"/><geom name="pad" type="sphere" size=".03" mass=".4"/></body></worldbody></mujoco>"""


def test_what_sinks_deeper_in_muj_co_by_its_solimp_is_listed_with_both_depths():
    model = mujoco.MjModel.from_xml_string(PRESS)
    data = mujoco.MjData(model)
    while data.time < 3.0:
        mujoco.mj_step(model, data)
    # Of d = 0.9 alone, F = k d^2 r / ((1 - d) A) with k = 1 / (d timeconst)^2: r = g (1 - d) timeconst^2.
    theirs, ours = -1e3 * (data.qpos[0] + 1e-4), 1e3 * 9.81 * 0.1 * 0.02**2
    (line,) = fp.from_mujoco(model).tree.left_out
    expected = f"table and pad: {theirs:.3g} for {ours:.3g} mm"
    assert line == f"solimp of geoms, by which they sink under their weight: {expected}"


def test_a_stop_that_gives_more_in_muj_co_by_its_solimp_is_listed_and_muj_co_s_default_is_not():
    assert hinge('range="0 1"').tree.left_out == ()
    (line,) = hinge('range="0 1" solimplimit="0 0.9 0.01" solreflimit=".02 1"').tree.left_out
    # As of the pad above: the same inertia on both sides.
    assert line.startswith("stops of joint f: by its solimp it gives 0.00544 under the weight of what it holds, ")


WRAP = """<mujoco><compiler angle="radian"/><worldbody><site name="o" pos="-.03 0 .005"/>
<body name="b" euler="{turn}"><joint name="a" axis="0 1 0" range="-1 1"/>
<geom type="sphere" size=".004" mass=".01" contype="0" conaffinity="0"/><geom name="c" type="cylinder" size=".01 .01"
euler="1.5707963267948966 0 0" mass=".01" contype="0" conaffinity="0"/><site name="s" pos="0 {height} 0"/>
<site name="e" pos="{place}"/></body></worldbody>
<tendon><spatial name="t"><site site="o"/><geom geom="c" {side}/><site site="e"/></spatial></tendon></mujoco>"""


@pytest.mark.parametrize("place", [".03 0 .005", ".01 0 0", ".006 0 .008"], ids=["outside", "on it", "on it, up"])
@pytest.mark.parametrize("side, height", [("", 0.0), ('sidesite="s"', 0.03), ('sidesite="s"', 0.0)])
@pytest.mark.parametrize("turn", ["0 0 0", "0.3 0.4 0.5", "0.7 -0.4 1.5"])
def test_paths_from_sites_on_a_cylinder_and_by_side_sites_on_its_axis_are_muj_co_s(turn, side, height, place):
    model = mujoco.MjModel.from_xml_string(WRAP.format(turn=turn, side=side, height=height, place=place))
    data, description = mujoco.MjData(model), fp.from_mujoco(model)
    hand = fp.Finger(description)
    for angle in (0.0, 0.3):
        data.qpos[0] = angle
        mujoco.mj_forward(model, data)
        assert hand.paths.length([angle])[0] == pytest.approx(data.ten_length[0], abs=1e-9)
        assert hand.paths.arms([angle])[0, 0] == pytest.approx(data.ten_J[0], abs=1e-7)
    line = "wrap c: its side site is on its axis, on no side of it"
    assert description.tree.left_out == ((line,) if height else ())


def test_a_model_in_millimetres_is_refused_by_the_name_of_its_site():
    text = WRAP.format(turn="0 0 0", side="", height=0, place="30 0 5")
    with pytest.raises(InputError, match=r"^tendons\.t\.e\.position\[0\] = 30\.0: .*is it in millimetres\?"):
        fp.from_mujoco(mujoco.MjModel.from_xml_string(text))


def test_a_weld_whose_torquescale_is_zero_holds_one_point_and_a_small_one_is_listed():
    free = '<body name="{0}" pos="{1} 0 0"><freejoint/><geom type="box" size=".02 .02 .02" mass=".1"/></body>'
    bodies = free.format("a", 0) + free.format("b", 0.1)
    text = f"""<mujoco><worldbody>{bodies}</worldbody>
    <equality><weld name="w" body1="a" body2="b" torquescale="SCALE"/></equality></mujoco>"""

    def read(scale):
        return fp.from_mujoco(mujoco.MjModel.from_xml_string(text.replace("SCALE", str(scale)))).tree

    assert [*read(0).loops] == ["w"]
    assert [*read(1).loops] == ["w_0", "w_1", "w_2"]
    assert not any("torquescale" in line for line in read(1).left_out)
    assert any(line.startswith("equality w: torquescale 1e-05 is ") for line in read(1e-5).left_out)
    assert math.isclose(sum(each.stiffness for each in read(1).loops.values()), read(0).loops["w"].stiffness)
