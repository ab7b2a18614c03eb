"""Muscles against MuJoCo's: their force and activation everywhere, and a motion under the same excitations."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import equilibrium
from finger_pin.description.loading import read_scenario, to_toml
from finger_pin.description.tree_actuators import Muscle
from finger_pin.laws.law import Row
from finger_pin.laws.muscle import MUSCLE

#: A hinge between two muscles, one of which smooths its activation, and a slide with one of a gear.
MODEL = """<mujoco><compiler angle="radian"/><option timestep="1e-4" integrator="RK4"><flag contact="disable"/></option>
<worldbody><site name="above" pos="-0.03 0 0.01"/><site name="below" pos="-0.03 0 -0.01"/>
<body><joint name="pip" axis="0 1 0" damping="0.002" armature="1e-4"/>
<geom type="capsule" size="0.005" fromto="0 0 0 0.05 0 0"/><site name="up" pos="0.02 0 0.01"/>
<site name="down" pos="0.02 0 -0.01"/>
<body pos="0.05 0 0"><joint name="slide" type="slide" axis="1 0 0" damping="1" stiffness="100"/>
<geom size="0.01"/></body></body></worldbody>
<tendon><spatial name="flexing"><site site="below"/><site site="down"/></spatial>
<spatial name="extending"><site site="above"/><site site="up"/></spatial>
<fixed name="pulling"><joint joint="slide" coef="1"/></fixed></tendon>
<actuator><muscle name="flexor" tendon="flexing" lengthrange="0.035 0.06" force="20"/>
<muscle name="extensor" tendon="extending" lengthrange="0.035 0.06" range="0.6 1.2" scale="50" tausmooth="0.3"
 timeconst="0.02 0.05" lmin="0.4" lmax="1.8" vmax="3" fpmax="0.7" fvmax="1.5"/>
<muscle name="puller" tendon="pulling" lengthrange="-0.03 0.03" gear="2" force="10" ctrllimited="true"
 ctrlrange="0 0.8"/>
</actuator></mujoco>"""
FREE = {
    f"finger.{table}.{entry}": 0.0
    for table in ("tendon_friction", "joint_friction")
    for entry in ("coulomb", *(("viscous",) if table == "tendon_friction" else ("stiction",)))
}


def of_model(text=MODEL, more=()):
    table = {"name": "muscles", "finger": fp.from_mujoco(mujoco.MjModel.from_xml_string(text)).model_dump()}
    return read_scenario(table | {"simulation": {"duration": 0.1}}, FREE | dict(more))


@pytest.mark.slow
def test_force_and_activation_are_mujoco_s_whatever_length_speed_state_and_numbers():
    rng, count = np.random.default_rng(4), 3000
    length, speed, act, command = rng.uniform([[-0.1], [-2.0], [0.0], [-0.3]], [[0.4], [2.0], [1.0], [1.3]], (4, count))
    for k in range(count):
        low, high = np.sort(rng.uniform(0.3, 1.6, 2)) + np.array([0.0, 0.05])
        ends = np.sort(rng.uniform(0.0, 0.3, 2)) + np.array([0.0, 0.01])
        shape = rng.uniform([0.1, 1.1, 0.5, 0.0, 1.0], [0.9, 2.5, 10.0, 2.0, 1.8])
        given = np.array([low, high, 30.0, 200.0, *shape])
        times = [*rng.uniform(0.005, 0.1, 2), rng.choice([0.0, rng.uniform(0.01, 1.0)])]
        optimal = (ends[1] - ends[0]) / (high - low)
        p = (30.0, optimal, ends[0] - low * optimal, *shape, *times, 0.0, 1.0)
        row = Row(length[k], speed[k], act[k], 0.0, command[k], 0.0)
        force, rate, _ = MUSCLE.value(row, p)
        gain = mujoco.mju_muscleGain(length[k], speed[k], ends, 1.0, given)
        expected = gain * act[k] + mujoco.mju_muscleBias(length[k], ends, 1.0, given)
        assert force == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert rate == pytest.approx(
            mujoco.mju_muscleDynamics(command[k], act[k], np.array(times)), rel=1e-9, abs=1e-12
        )


def test_a_motion_under_random_excitations_is_mujoco_s():
    """Excitations held for 20 ms each, some beyond their ranges; MuJoCo takes steps of 0.1 ms."""
    scenario, model = of_model(), mujoco.MjModel.from_xml_string(MODEL)
    data, rng = mujoco.MjData(model), np.random.default_rng(8)
    sim = fp.Simulator(scenario, position=[0.0, 0.0])
    ours, theirs = [], []
    for _ in range(40):
        excitation = rng.uniform(-0.2, 1.2, 3)
        data.ctrl[:] = excitation
        mujoco.mj_step(model, data, 200)
        state = sim.step(excitation, 0.02)
        ours.append([*state.position, *state.actuator_state])
        theirs.append([*data.qpos, *data.act])
    np.testing.assert_allclose(ours, theirs, atol=1e-3)
    assert np.all(np.ptp(np.array(theirs)[:, :2], axis=0) > [1.0, 0.01])
    result = sim.result()
    np.testing.assert_allclose(result.muscle_state[-1], data.act, atol=1e-3)
    assert abs(result.energy_residual).max() < 1e-5


def test_numbers_are_read_written_and_bound_actions(tmp_path):
    scenario, model = of_model(), mujoco.MjModel.from_xml_string(MODEL)
    muscles = {name: each.muscle for name, each in scenario.finger.tree.actuators.items()}
    assert muscles["flexor"] == Muscle(force=20.0, length_range=(0.035, 0.06))
    assert muscles["extensor"].force == pytest.approx(50.0 / model.actuator_acc0[1])
    assert [each.reach(scenario.finger.joints) for each in scenario.finger.tree.actuators.values()] == [
        (0.0, 1.0),
        (0.0, 1.0),
        (0.0, 0.8),
    ]
    assert [each.only_pulls for each in scenario.finger.tree.actuators.values()] == [True] * 3
    path = tmp_path / "muscles.toml"
    path.write_text(to_toml(scenario))
    assert fp.load_scenario(path).finger == scenario.finger and scenario.controller.kind == "tensions"


def test_a_muscle_rests_where_its_force_meets_a_spring():
    """Of the slide alone: 2 f(2 x) = 100 x, with half the activation; f by MuJoCo's functions."""
    scenario = of_model(more={"finger.gravity": [0.0, 0.0, 0.0]})
    found = equilibrium(scenario.finger, inputs=[0.1, 0.1, 0.5])
    at, given = float(found.position[1]), np.array([0.75, 1.05, 10.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2])
    ends = np.array([-0.03, 0.03])
    gain, bias = (
        mujoco.mju_muscleGain(2.0 * at, 0.0, ends, 1.0, given),
        mujoco.mju_muscleBias(2.0 * at, ends, 1.0, given),
    )
    pull = 0.5 * gain + bias
    assert 2.0 * pull == pytest.approx(100.0 * at, rel=1e-6) and at < -0.01


@pytest.mark.parametrize(
    ("entry", "value", "says"),
    [
        ("gain", 2.0, "has no effect beside muscle"),
        ("input_range", [0.0, 2.0], "within 0 and 1"),
        ("muscle.lmin", 1.0, "below 1"),
        ("muscle.length_range", [0.1, 0.0], "the least length must be below"),
    ],
)
def test_numbers_that_no_muscle_has_are_refused_in_one_line(entry, value, says):
    with pytest.raises(fp.InputError, match=says) as caught:
        of_model(more={f"finger.tree.actuators.flexor.{entry}": value})
    assert "\n" not in str(caught.value) and "actuators.flexor" in caught.value.entry


def test_muscles_of_other_kinds_are_listed_by_name():
    for change, says in (("bias", "flexor: its bias is not affine"), ("gain", "flexor: only a part of it is a muscle")):
        given = f'{change}type="muscle" {change}prm="0.75 1.05 20 200 0.5 1.6 1.5 1.3 1.2" lengthrange="0.035 0.06"'
        text = MODEL.replace('<muscle name="flexor" tendon="flexing" lengthrange="0.035 0.06" force="20"/>', "")
        text = text.replace("<actuator>", f'<actuator><general name="flexor" tendon="flexing" {given}/>')
        with pytest.warns(fp.exceptions.LeftOutWarning):
            assert any(says in line for line in fp.from_mujoco(mujoco.MjModel.from_xml_string(text)).tree.left_out)
