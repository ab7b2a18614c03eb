"""Fingers that springs return: the band of tensions against the closed form of one joint, and against runs."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.studies.metrics import METRICS, Run

MU, STATIC, STIFFNESS, RADIUS, TURN = 0.2, 6e-4, 0.08, 8e-3, 1.1


def one_joint(times, values, **more):
    """A joint with a spring that is at rest at zero, and a cord that turns by TURN before it and by its angle there."""
    joint = {"range": [0.0, 1.5], "link": {"length": 0.05, "width": 0.012, "mass": 0.02}}
    table = {
        "name": "one",
        "finger": {
            "name": "one",
            "gravity": [0.0, 0.0, 0.0],
            "joints": {"hinge": joint | {"spring": {"stiffness": STIFFNESS}}},
            "tendons": {"cord": {"curvature_offset": TURN, "crossings": {"hinge": {"radius": RADIUS, "bends": True}}}},
            "tendon_friction": {"coulomb": MU, "stiction_ratio": 1.0, "viscous": 0.0},
            "joint_friction": {"coulomb": STATIC, "stiction": STATIC, "viscous": 2e-3},
        },
        "controller": {"kind": "tensions", "tensions": {"cord": {"kind": "points", "times": times, "values": values}}},
        "simulation": {"duration": times[-1], "initial": {"position": {"hinge": 0.0}}},
    }
    return read_scenario(table, more)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_band_of_one_joint_is_its_closed_form(way):
    """f^a = exp(+-mu phi) (k theta +- d) / (r -+ M), phi = TURN + theta: the pin bears the cord's tension.

    A drag of 2 mN m in the mean is 2.6 to greater angles, 1.4 to smaller ones.
    """
    turned = {"finger.joints.hinge.range": [0.0, 1.5] if way > 0.0 else [-1.5, 0.0]}
    turned |= {"finger.tendons.cord.crossings.hinge.radius": RADIUS * way, "finger.joint_friction.drag_asymmetry": 0.3}
    for drag in (0.0, 0.002):
        scenario = one_joint([0.0, 1.0], [0.0, 1.0], **turned, **{"finger.joint_friction.drag": drag})
        found = fp.analysis.spring_return(scenario.finger)
        angle, inward, back = way * found.positions, drag * (1.0 + 0.3 * way), drag * (1.0 - 0.3 * way)
        grown, torque = np.exp(MU * (TURN + angle)), STIFFNESS * angle
        np.testing.assert_allclose(found.winding_in, grown * (torque + inward) / (RADIUS - STATIC), rtol=1e-12)
        np.testing.assert_allclose(found.letting_out, (torque - back) / grown / (RADIUS + STATIC), rtol=1e-12)
        assert found.returns
        assert found.margin == (pytest.approx(STIFFNESS * angle.min() / back, rel=1e-12) if drag else np.inf)
        assert found.worst[0] == "hinge"
        assert found.ratio == pytest.approx(np.min(found.letting_out / found.winding_in), rel=1e-12)


def test_a_run_moves_in_and_back_where_the_band_says():
    """Wound in to 10 N and slowly let out, the joint turns back at the tension of its posture."""
    scenario = one_joint([0.0, 4.0, 12.0], [0.0, 10.0, 0.0])
    result, found = fp.simulate(scenario), fp.analysis.spring_return(scenario.finger)
    angle, pull, speed = (
        np.asarray(result[name]).ravel() for name in ("joint_position", "tendon_command", "joint_velocity")
    )
    at = int(np.argmin(np.abs(result.time.values - 2.5)))
    assert pull[at] == pytest.approx(np.interp(angle[at], found.positions[:, 0], found.winding_in[:, 0]), rel=0.03)
    back = int(np.argmin(np.abs(result.time.values - 9.0)))
    assert speed[back] < 0.0
    assert pull[back] == pytest.approx(np.interp(angle[back], found.positions[:, 0], found.letting_out[:, 0]), rel=0.03)


def test_a_joint_stays_where_its_drag_holds_the_spring_and_the_metric_is_zero():
    """Let go, it comes back to theta = d / k and no further."""
    drag = 0.03
    scenario = one_joint([0.0, 2.0, 4.0, 5.0], [0.0, 30.0, 0.0, 0.0], **{"finger.joint_friction.drag": drag})
    found = fp.analysis.spring_return(scenario.finger)
    assert not found.returns and found.margin < 1.0
    stays = found.letting_out[:, 0] <= 0.0
    np.testing.assert_array_equal(stays, found.positions[:, 0] <= drag / STIFFNESS)
    assert float(fp.simulate(scenario).joint_position[-1, 0]) == pytest.approx(drag / STIFFNESS, abs=0.02)
    assert METRICS["return_ratio"].measure(Run(scenario)) == 0.0


def test_a_joint_whose_friction_grows_with_the_cord_locks_at_its_radius():
    """With M >= r no tension moves it in, however large."""
    stuck = {f"finger.joint_friction.{key}": 1.1 * RADIUS for key in ("coulomb", "stiction")}
    found = fp.analysis.spring_return(one_joint([0.0, 1.0], [0.0, 1.0], **stuck).finger)
    assert np.isinf(found.winding_in).all() and found.ratio == 0.0 and found.returns


def test_a_cord_among_several_and_a_passive_tendon_that_couples_joints_are_named():
    with pytest.raises(fp.InputError, match="must be one of"):
        fp.analysis.spring_return("planar")
    with pytest.raises(fp.InputError, match=r"tendons\..*: must pull all of its joints back, against T1"):
        fp.analysis.spring_return("ub_stand_in", "T1")


def test_a_joint_without_a_spring_and_a_wrong_cord_are_named():
    finger = one_joint([0.0, 1.0], [0.0, 1.0]).finger
    with pytest.raises(fp.InputError, match="cord"):
        fp.analysis.spring_return(finger, "crod")
    with pytest.raises(fp.InputError, match="need a spring"):
        fp.analysis.spring_return("planar", fp.Finger("planar").routing.tendons[0])
