"""A force that the fingertip is to exert, held against what pushes back."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop

PUSH = np.array([0.3, -0.1, -0.8])
SMOOTH = {
    "finger.tendon_friction.coulomb": 0.0,
    "finger.joint_friction.coulomb": 0.0,
    "finger.joint_friction.stiction": 0.0,
    "controller.gravity_compensation": True,
}
EXERTED = {f"controller.fingertip_force.{axis}.offset": value for axis, value in zip("xyz", PUSH, strict=True)}


def loop(*overrides):
    merged = dict(SMOOTH)
    for each in overrides:
        merged |= each
    return ClosedLoop.from_scenario(fp.load_scenario("reversals", merged))


def test_a_reaction_as_large_as_the_wanted_force_leaves_the_joints_of_a_frictionless_finger_alone(tmp_path):
    """The torques cancel: J^T F is the work of F on the fingertip by the angle. No tendon of this finger is passive."""
    file = tmp_path / "planar.toml"
    file.write_text(
        'finger = "planar"\n[reference.joints.distal]\noffset = 0.5\n[reference.joints.proximal]\noffset = 0.3\n'
    )
    pushing = {**EXERTED, "environment.fingertip_force": (-PUSH).tolist(), **SMOOTH}
    loops = [ClosedLoop.from_scenario(fp.load_scenario(file, each)) for each in (pushing, SMOOTH)]
    x = loops[0].initial_state()
    found, alone = (each.evaluate(0.0, x) for each in loops)
    q, tip = loops[0].reference.at(0.0).position, loops[0].finger.rigid_body.tip_position
    work = [(tip(q + step) - tip(q - step)) @ PUSH / 2e-6 for step in 1e-6 * np.eye(len(q))]
    assert np.abs(work).max() > 0.01
    assert found.control.torque - alone.control.torque == pytest.approx(work, abs=1e-9)
    net = found.finger["joint_torque"] + found.finger["external_torque"]
    assert net == pytest.approx(alone.finger["joint_torque"], abs=1e-12)


def test_the_wanted_force_follows_its_signal_and_the_scenario_s_clock():
    ramp = {"kind": "ramp", "time": 1.0, "duration": 1.0, "height": 2.0}
    late = loop({"controller.fingertip_force.z": ramp, "simulation.start_time": 1.0})
    assert late.controller.fingertip.desired_force.at(np.array([0.0, 1.0, 5.0]))[0][:, 2] == pytest.approx(
        [0.0, 2.0, 2.0]
    )
    assert {0.0, 1.0} <= set(late.knots(1e-6).tolist())


@pytest.mark.slow
def test_friction_keeps_part_of_a_force_that_rises_and_lets_go_of_one_that_falls():
    """It opposes the joints' motion, which a stiff plate hardly allows; compensation knows the desired motion alone."""
    posture = {"proximal": 0.282, "medial": 0.341}
    pushing = {f"reference.joints.{joint}.values": [angle] * 8 for joint, angle in posture.items()}
    pushing |= {"controller.sampling.period": 1e-3}
    rubbing = {"controller.tendon_friction_feedforward": {}, "controller.joint_friction_compensation": {}}

    def exerted(slower=1.0, **overrides):
        pulse = {"kind": "points", "times": [slower * t for t in (0.1, 0.6, 1.1)], "values": [0.0, 2.0, 0.0]}
        timed = {"controller.fingertip_force.z": pulse, "simulation.duration": slower}
        found = fp.simulate(fp.load_scenario("press", pushing | timed | overrides)).contact_force
        force = found.sel(axis="z").sum("contact")
        return np.array([float(force.sel(time=slower * t, method="nearest")) for t in (0.35, 0.85)])

    rising, falling = exerted()
    assert 0.5 < rising < falling - 0.05 < 0.95
    assert exerted(**rubbing) == pytest.approx([rising, falling], abs=1e-3)
    level = {f"finger.{kind}_friction.coulomb": 0.0 for kind in ("tendon", "joint")}
    level |= {"finger.joint_friction.stiction": 0.0}
    # What is left is viscous, and in proportion to the rate of the force; dry friction is not.
    quick, slow = (float(np.diff(exerted(slower, **level))[0]) for slower in (1.0, 2.0))
    assert 0.0 < slow < quick < 0.5 * (falling - rising) and slow == pytest.approx(0.5 * quick, rel=0.05)


def test_tension_limits_are_kept_and_what_they_cost_is_said():
    limit = {"controller.distribution.maximum_tension": 9.0}
    found = loop(limit, {"controller.fingertip_force.z.offset": -20.0})
    x = found.finger.rest_state(found.reference.at(0.0).position)
    control = found.evaluate(0.0, x).control
    assert control.tension.max() <= 9.0 + 1e-9 and np.abs(control.torque_deficit).max() > 1e-2
    coupling = found.finger.routing.coupling
    assert coupling.T @ control.tension == pytest.approx(control.torque - control.torque_deficit, abs=1e-6)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"controller.fingertip_force.w.offset": 1.0}, "the axes are x, y, z"),
        ({"controller.fingertip_force.z.offset": "hard"}, "must be a number"),
        ({"controller.kind": "tensions", "controller.fingertip_force.z.offset": 1.0}, "has no effect"),
    ],
)
def test_a_wrong_wish_is_one_clear_line(overrides, message):
    with pytest.raises(fp.InputError, match=message):
        fp.load_scenario("reversals", overrides)
