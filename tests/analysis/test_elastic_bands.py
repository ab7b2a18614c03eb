"""Elastic bands that return a finger over several joints: closed forms, runs, and what is refused."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import read_scenario
from finger_pin.description.placement import scaled

STIFFNESS, PULLEYS, ARMS = 900.0, np.array([5e-3, 4e-3]), np.array([9e-3, 7e-3])
MU, TURN, PIN, LOSS, VISCOUS = 0.2, 1.3, 4e-4, 0.1, 1e-3


def finger(crossed=2, band=None, **tables):
    """A finger of two joints at zero, with a cord over the last ``crossed`` of them, and a band over both."""
    link = {"link": {"length": 0.04, "width": 0.012, "mass": 0.01}, "range": [0.0, 1.4]}
    cord = {name: {"radius": float(arm)} for name, arm in [*zip("ab", ARMS, strict=True)][-crossed:]}
    back = {name: {"radius": -float(pulley)} for name, pulley in zip("ab", PULLEYS, strict=True)}
    return {
        "name": "banded",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {"a": link, "b": link},
        "tendons": {
            "cord": {"crossings": cord},
            "band": {"kind": "passive", "crossings": back, "curvature_offset": TURN},
        },
        "passive_tendon": {"stiffness": STIFFNESS, "mass": 1e-3} | (band or {}),
        "tendon_friction": {"coulomb": [0.0, MU], "stiction_ratio": 1.0, "viscous": 0.05},
        "joint_friction": {"coulomb": PIN, "stiction": PIN, "viscous": VISCOUS},
    } | tables


@pytest.mark.parametrize("band", [{"pretension": 2.0}, {"slack": -2.0 / STIFFNESS}, {"slack": 1e-3}])
def test_a_band_over_two_pulleys_holds_each_joint_by_its_tension_friction_and_hysteresis(band):
    """T = K (r1 a + r2 b + T0 / K), more by (1 + mu) (1 + h) on the way in, less on that out; it presses each pin."""
    found = fp.analysis.spring_return(FingerDescription.model_validate(finger(band=band | {"hysteresis": LOSS})))
    loose = band.get("slack", -2.0 / STIFFNESS)
    mean = STIFFNESS * np.maximum(found.positions @ PULLEYS - loose, 0.0)[:, None]
    rubs = np.tanh(0.5 * MU * TURN)
    tight, easy = (1.0 + rubs) * (1.0 + LOSS) * mean, (1.0 - rubs) * (1.0 - LOSS) * mean
    np.testing.assert_allclose(found.winding_in, tight * (PULLEYS + PIN) / (ARMS - PIN), rtol=1e-12)
    np.testing.assert_allclose(found.letting_out, easy * (PULLEYS - PIN) / (ARMS + PIN), rtol=1e-12)
    assert found.returns


def test_a_cord_against_springs_and_a_band_settles_where_their_linear_balance_is():
    """(diag(k) + K r r^T) theta = f R - T0 r without friction: the equilibrium, and the end of a run."""
    springs, pull, pretension = np.array([0.04, 0.03]), 9.0, 1.5
    smooth = {"coulomb": 0.0, "stiction": 0.0, "viscous": 2e-3}
    described = finger(band={"pretension": pretension}, joint_friction=smooth, tendon_friction={"coulomb": 0.0})
    for joint, stiffness in zip("ab", springs, strict=True):
        described["joints"][joint] = described["joints"][joint] | {"spring": {"stiffness": float(stiffness)}}
    matrix = np.diag(springs) + STIFFNESS * np.outer(PULLEYS, PULLEYS)
    balance = np.linalg.solve(matrix, pull * ARMS - pretension * PULLEYS)
    assert np.all((balance > 0.1) & (balance < 1.3))
    resting = fp.analysis.equilibrium(FingerDescription.model_validate(described), [pull])
    np.testing.assert_allclose(resting.position, balance, atol=1e-9)
    table = {
        "name": "settling",
        "finger": described,
        "controller": {
            "kind": "tensions",
            "tensions": {"cord": {"kind": "points", "times": [0.0, 2.0], "values": [pull, pull]}},
        },
        "simulation": {"duration": 2.0, "initial": {"position": {"a": 0.2, "b": 0.2}}},
    }
    result = fp.simulate(read_scenario(table))
    np.testing.assert_allclose(result.joint_position.values[-1], balance, atol=1e-4)


def test_pretension_has_no_place_beside_slack():
    both = {"finger.passive_tendon.pretension": 1.0, "finger.passive_tendon.slack": 1e-3}
    with pytest.raises(fp.InputError, match=r"passive_tendon\.pretension = 1\.0: has no place beside slack"):
        fp.load_scenario("reversals", both)


def test_a_finger_twice_as_large_stretches_its_band_twice_as_far():
    """All lengths, its slack too, go with the scale, but K stays: so do tensions, in the same postures."""
    small = FingerDescription.model_validate(finger(band={"slack": 2e-3}))
    single, double = (fp.analysis.spring_return(each) for each in (small, scaled(small, 2.0)))
    np.testing.assert_allclose(double.winding_in, 2.0 * single.winding_in, rtol=1e-12)
    np.testing.assert_allclose(double.letting_out, 2.0 * single.letting_out, rtol=1e-12)
    # Near zero the band is slack, and nothing comes back from there.
    assert not single.returns and single.ratio == 0.0


def as_tree(crossed=2, **spring):
    """The finger as a tree of bodies, whose tendon ``band`` has a spring along it in place of a passive tendon."""
    links = finger(crossed)
    tree = FingerDescription.model_validate(links).bodies.model_dump(exclude_none=True)
    back = {name: float(pulley) for name, pulley in zip("ab", PULLEYS, strict=True)}
    tree["tendons"] = {"band": {"joints": back, "stiffness": STIFFNESS, "curvature_offset": TURN} | spring}
    return links | {
        "joints": {name: {"range": [0.0, 1.4]} for name in "ab"},
        "tendons": {"cord": links["tendons"]["cord"]},
        "passive_tendon": {},
        "tree": tree,
    }


def test_a_spring_along_a_tendon_of_a_tree_rubs_by_the_capstan_law():
    """T = K (r1 a + r2 b - l0) at its end arrives as exp(+-mu phi) T, phi its offset and the joints' angles."""
    for spring, slack in (({"slack": -2e-3}, -2e-3), ({"rest": (-0.1, 1e-3)}, 1e-3)):
        found = fp.analysis.spring_return(FingerDescription.model_validate(as_tree(**spring)))
        tension = STIFFNESS * np.maximum(found.positions @ PULLEYS - slack, 0.0)
        grown = np.exp(MU * (TURN + found.positions.sum(axis=1)))
        tight, easy = (tension * grown)[:, None], (tension / grown)[:, None]
        np.testing.assert_allclose(found.winding_in, tight * (PULLEYS + PIN) / (ARMS - PIN), rtol=1e-12)
        np.testing.assert_allclose(found.letting_out, easy * (PULLEYS - PIN) / (ARMS + PIN), rtol=1e-12)


@pytest.mark.parametrize("tree", [False, True])
def test_a_run_winds_a_joint_in_and_lets_it_back_at_the_tensions_of_the_band(tree):
    """The band holds the first joint at its stop; the second turns under a cord wound to 7 N and let out again.

    On the way back the band's mass stays at first: its half on the far side has to ease before that too lets go.
    """
    passive = finger(1, {"pretension": 2.0, "hysteresis": LOSS})
    table = {
        "name": "ramp",
        "finger": as_tree(1, slack=-2.0 / STIFFNESS) if tree else passive,
        "controller": {
            "kind": "tensions",
            "tensions": {"cord": {"kind": "points", "times": [0.0, 2.0, 4.0], "values": [0.0, 7.0, 0.0]}},
        },
        "simulation": {"duration": 4.0, "initial": {"position": {"a": 0.0, "b": 0.0}}},
    }
    scenario = read_scenario(table)
    found, result = fp.analysis.spring_return(scenario.finger), fp.simulate(scenario)
    angle, speed = result.joint_position.values[:, 1], result.joint_velocity.values[:, 1]
    pull = result.tendon_command.values[:, 0]
    back = result.time.values > 2.0
    for goal, side, column in ((0.9, 1.0, found.winding_in), (0.3, -1.0, found.letting_out)):
        at = int(np.argmin(np.abs(angle - goal) + (back == (side > 0.0))))
        assert side * speed[at] > 0.5
        lost = VISCOUS * speed[at] / (ARMS[1] - side * PIN)
        still = np.interp(angle[at], found.positions[:, 1], column[:, 0])
        assert pull[at] - lost == pytest.approx(still, rel=0.005)


@pytest.mark.parametrize("massless", [False, True])
def test_mujoco_pulls_with_the_tension_of_passive_tendons_with_slack(massless):
    """At rest the fixed tendons of `to_mjcf` exert -r K max(0, l - l0), and a read one has the same statics."""
    mujoco = pytest.importorskip("mujoco")
    for band, loose in (({"pretension": 2.0}, -2.0 / STIFFNESS), ({"slack": 2e-3}, 2e-3)):
        model = mujoco.MjModel.from_xml_string(
            fp.to_mjcf(FingerDescription.model_validate(finger(band=band)), massless=massless)
        )
        data = mujoco.MjData(model)
        for angles in np.random.default_rng(2).uniform(0.0, 1.0, (5, 2)):
            data.qpos[:2] = angles
            # In the middle both halves are as taut.
            data.qpos[2:] = 0.5 * (PULLEYS @ (angles * [1.0, -1.0]))
            mujoco.mj_forward(model, data)
            tension = STIFFNESS * max(PULLEYS @ angles - loose, 0.0)
            np.testing.assert_allclose(data.qfrc_passive[:2], -PULLEYS * tension, rtol=1e-9, atol=1e-12)
            if massless:
                read = fp.Finger(fp.from_mujoco(model))
                rates = read.rhs(0.0, read.rest_state(angles), np.zeros(read.mechanism.channels))
                np.testing.assert_allclose(read.layout.unpack(rates).velocity, data.qacc, rtol=1e-6)


def test_a_cord_through_space_with_slack_pulls_in_mujoco_as_here():
    """A spatial tendon of a tree, longer than its way at zero by its slack, in both simulators."""
    mujoco = pytest.importorskip("mujoco")
    table = as_tree()
    bodies = [None, *table["tree"]["bodies"]]
    points = {
        f"p{k}": {"kind": "point", "position": [0.01, -0.008, 0.0]} | ({"body": body} if body else {})
        for k, body in enumerate(bodies)
    }
    table["tree"]["tendons"]["band"] = {"path": points, "stiffness": STIFFNESS, "slack": -3e-3}
    smooth = {"tendon_friction": {"coulomb": 0.0}, "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0}}
    description = FingerDescription.model_validate(table | smooth)
    ours, model = fp.Finger(description), mujoco.MjModel.from_xml_string(fp.to_mjcf(description))
    data = mujoco.MjData(model)
    for angles in ([0.1, 0.2], [0.8, 0.5]):
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        rates = ours.layout.unpack(ours.rhs(0.0, ours.rest_state(np.array(angles)), np.zeros(1)))
        np.testing.assert_allclose(rates.velocity, data.qacc, rtol=1e-6)
        assert np.all(data.qfrc_passive != 0.0)


def test_what_is_no_band_is_named():
    for spring, says in (
        ({"range": (0.0, 0.01)}, "nothing else that pulls"),
        ({"joints": {"a": 4e-3, "b": -4e-3}}, "all"),
    ):
        with pytest.raises(fp.InputError, match=rf"finger\.tree\.tendons\.band.*{says}"):
            fp.analysis.spring_return(FingerDescription.model_validate(as_tree(**spring)))
    described = as_tree()
    described["tree"]["actuators"] = {"motor": {"joint": "a"}, "helper": {"joint": "a", "offset": 0.1}}
    with pytest.raises(fp.InputError, match=r"^finger\.tree\.actuators\.helper: must be left out"):
        fp.analysis.spring_return(FingerDescription.model_validate(described))


def test_inverse_kinematics_bends_a_banded_finger_freely_and_a_coupled_one_by_its_slack():
    """A band couples nothing; of joints that a tendon couples, r1 a - r2 b = l0 where it is just taut."""
    banded = fp.Finger(FingerDescription.model_validate(finger(band={"slack": 1e-3})))
    posture = np.array([0.5, 0.9])
    found = fp.analysis.inverse_kinematics(banded, banded.rigid_body.tip_position(posture), near=posture)
    np.testing.assert_allclose(found.position, posture, atol=1e-6)
    table = finger(band={"slack": 1e-3})
    table["tendons"]["band"]["crossings"]["b"]["radius"] = PULLEYS[1]
    coupled = fp.Finger(FingerDescription.model_validate(table))
    found = fp.analysis.inverse_kinematics(coupled, [0.07, 0.03, 0.0])
    assert PULLEYS[0] * found.position[0] - PULLEYS[1] * found.position[1] == pytest.approx(1e-3, abs=1e-12)
