"""Actuated cords that are coupled, so that one motor pulls both: two joints of a finger, or two fingers."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import read_scenario

RADIUS, PULL, SPRINGS = 0.008, 2.0, {"left": 0.02, "right": 0.04}
BAR = {"stiffness": 1e5, "damping": 10.0, "ratio": 1.0}


def part(springs, tendons, **more):
    """Return a finger without friction, each of whose cords is about one joint, with a bend of 1 rad."""
    link = {"length": 0.03, "width": 0.01, "mass": 0.01}
    joints = {
        name: {"range": [-1.5, 1.5], "spring": {"stiffness": stiffness, "damping": 2e-3}, "link": link}
        for name, stiffness in springs.items()
    }
    crossings = {name: {"curvature_offset": 1.0, "crossings": {of: {"radius": RADIUS}}} for name, of in tendons.items()}
    friction = {"joint_friction": {"coulomb": 0.0, "stiction": 0.0}, "tendon_friction": {"coulomb": 0.0}}
    friction["tendon_friction"]["viscous"] = 0.0
    return {"name": "part", "gravity": [0.0] * 3, "joints": joints, "tendons": crossings, **friction, **more}


def finger_run(bar=BAR, settings=None, duration=1.0, **winding):
    finger = part(SPRINGS, {"A": "left", "B": "right"}, couplings={"bar": {"tendon": "A", "other": "B", **bar}})
    controller = {"kind": "tensions", "tensions": {"A": {"offset": PULL}, "B": {"offset": 0.0}}, **winding}
    table = {"name": "run", "finger": finger, "controller": controller, "simulation": {"duration": duration}}
    return read_scenario(table, settings or {})


def hand_run(bar=BAR):
    fingers = {
        name: {"finger": part({"j": k}, {"F": "j"}), "position": [0.0, 0.05 * (name == "left"), 0.0]}
        for name, k in SPRINGS.items()
    }
    couplings = {"bar": {"tendon": "left.F", "other": "right.F", **bar}}
    hand = {"name": "pair", "gravity": [0.0] * 3, "fingers": fingers, "couplings": couplings}
    pulls = {"left": PULL, "right": 0.0}
    controllers = {name: {"kind": "tensions", "tensions": {"F": {"offset": pull}}} for name, pull in pulls.items()}
    table = {"name": "run", "hand": hand, "controller": {"fingers": controllers}, "simulation": {"duration": 1.0}}
    return read_scenario(table, {})


def at_rest(ratio, offset):
    """Return F and both angles from k_1 q_1 = r (P - F), k_2 q_2 = r ratio F, F = K (r q_1 - ratio r q_2 + offset)."""
    give = RADIUS**2 / np.array([*SPRINGS.values()])
    force = (give[0] * PULL + offset) / (1.0 / BAR["stiffness"] + give @ [1.0, ratio**2])
    return force, give * [PULL - force, ratio * force] / RADIUS


@pytest.mark.parametrize("run", [finger_run, hand_run])
@pytest.mark.parametrize("ratio, offset", [(1.0, 0.0), (0.5, -1e-3), (-1.0, 5e-4)])
def test_one_source_moves_both_joints_as_the_balance_of_moments_says(run, ratio, offset):
    force, angles = at_rest(ratio, offset)
    scenario = run(BAR | {"ratio": ratio, "offset": offset})
    result = fp.simulate(scenario)
    # Bristles hold a floor of 0.1 mN, also without friction.
    np.testing.assert_allclose(result.joint_position.values[-1], angles, atol=1e-4)
    bar = result.tendon_coupling_force.values[:, 0]
    np.testing.assert_allclose(bar[-1], force, atol=2e-4)
    np.testing.assert_allclose(result.tendon_tension.values, np.transpose([PULL - bar, ratio * bar]), atol=1.01e-4)
    assert np.abs(result.energy_residual).max() < 1e-6
    if scenario.hand is None:
        rest = fp.analysis.equilibrium(scenario.finger, [PULL, 0.0])
        np.testing.assert_allclose(rest.position, angles, atol=1e-8)


def test_a_coupled_cord_rubs_by_the_sum_of_what_pulls_it():
    """Drawn in, each cord delivers exp(-mu phi) of what arrives at its canal, by the capstan law, once it slides."""
    mu, floor = 0.4, 1e-4
    settings = {"finger.tendon_friction.coulomb": mu, "finger.tendon_friction.stiction_ratio": 1.0}
    result = fp.simulate(finger_run(settings=settings, duration=0.06))
    bar = result.tendon_coupling_force.values[-1, 0]
    assert (result.joint_velocity.values[-1] > 0.1).all() and bar > 0.1
    expected = np.exp(-mu) * np.array([PULL - bar, bar])
    np.testing.assert_allclose(result.tendon_tension.values[-1], expected, atol=20.0 * floor)


def test_a_winch_on_one_cord_winds_in_both():
    """It pulls with K_w (w - x), of which the bar takes K (x - x_other) for the other: linear in the angles."""
    wound, winch = 4e-3, 2e4
    settings = {"finger.tendons.A.winch.stiffness": winch, "controller.tensions": {"B": {"offset": 0.0}}}
    finger = finger_run(settings=settings, tendon_winding={"A": {"offset": wound}}).finger
    stiffness = np.diag([*SPRINGS.values()]) + RADIUS**2 * np.diag([winch, 0.0])
    stiffness += RADIUS**2 * BAR["stiffness"] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    angles = np.linalg.solve(stiffness, [winch * RADIUS * wound, 0.0])
    rest = fp.analysis.equilibrium(finger, [wound, 0.0])
    np.testing.assert_allclose(rest.position, angles, rtol=1e-6)


def test_mujoco_moves_coupled_fingers_alike():
    scenario = finger_run(BAR | {"ratio": 0.5, "offset": -1e-3}, duration=0.05)
    model = mujoco.MjModel.from_xml_string(fp.to_mjcf(scenario, timestep=1e-5))
    data = mujoco.MjData(model)
    data.ctrl[:] = PULL, 0.0
    mujoco.mj_step(model, data, 5000)
    np.testing.assert_allclose(data.qpos, fp.simulate(scenario).joint_position.values[-1], atol=1e-4)
    with pytest.raises(fp.InputError, match="is not written beside friction=True"):
        fp.to_mjcf(scenario, friction=True)


@pytest.mark.parametrize(
    "bar, message",
    [
        ({"other": "C"}, 'couplings.bar.other = "C": no such actuated tendon; there are A, B'),
        ({"other": "A"}, 'couplings.bar.other = "A": must be another tendon'),
        ({"tendon": None, "joint": "left"}, 'couplings.bar.joint = "left": is for finger.tree.couplings'),
        ({"stiffness": -1.0}, "couplings.bar.stiffness = -1.0: must be at least 0"),
    ],
)
def test_a_coupling_without_sense_is_refused(bar, message):
    with pytest.raises(fp.InputError, match=message.replace(".", r"\.")):
        finger_run(BAR | bar)
