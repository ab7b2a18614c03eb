"""Linearisation against a mechanism written out, its matrix exponential, and differences of runs."""

import numpy as np
import pytest
from hinged_link import HINGED_INERTIA, hinged_link
from scipy.linalg import expm
from validation.mujoco_motion import EXPRESSIBLE

import finger_pin as fp

STIFFNESS, DRAG = "finger.joints.drum.spring.stiffness", "finger.tendon_friction.drag"


@pytest.fixture(scope="module")
def drum():
    """A drum held by a tendon of 4 N against its spring of 0.2 N m/rad, at rest at 0.4 rad."""
    rubbing = {"coulomb": 1e-3, "stiction": 1e-3, "viscous": 2e-3}
    scenario = fp.load_scenario("canal", {"finger.tendon_friction.coulomb": 0.2, "finger.joint_friction": rubbing})
    return scenario, fp.Finger(scenario.finger).rest_state(np.array([0.4]))


def test_the_matrices_are_those_of_the_equations_written_out(drum):
    """J theta'' = r (f^a - F^s) - k theta - (c + r^2 b) theta' - T^s, F^s' = s0 r theta', T^s' = s_j theta'."""
    scenario, x = drum
    finger = fp.Finger(scenario.finger)
    found = fp.linearise(scenario, x, [4.0], parameters=[STIFFNESS, DRAG])
    inertia = finger.rigid_body.mass_matrix(np.array([0.4]))[0, 0]
    a = np.zeros((4, 4))
    a[0, 1] = 1.0
    a[1] = np.array([-0.2, -2e-3, -0.02, -1.0]) / inertia
    a[2:, 1] = 5e4 * 0.02, 5.0
    np.testing.assert_allclose(found.A, a, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(found.B[:, 0], [0.0, 0.02 / inertia, 0.0, 0.0], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.E[:, 0], [0.0, -0.4 / inertia, 0.0, 0.0], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.E[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-9)
    tension = found.sel(output="tendon_tension.T1")
    np.testing.assert_allclose([*tension.C, *tension.D], [0.0, 0.0, -1.0, 0.0, 1.0], atol=1e-7)
    np.testing.assert_allclose(found.C.sel(output="fingertip_position.y")[0], 0.04 * np.cos(0.4), rtol=1e-8)


@pytest.mark.slow
def test_the_map_over_a_step_is_the_matrix_exponential_at_rest(drum):
    scenario, x = drum
    lin = fp.linearise(scenario, x, [4.0], parameters=[STIFFNESS])
    step = fp.linearise(scenario, x, [4.0], dt=2e-3, parameters=[STIFFNESS])
    further = np.concatenate([lin.B.values, lin.E.values], axis=1)
    whole = expm(2e-3 * np.block([[lin.A.values, further], [np.zeros((2, 6))]]))
    scale = np.abs(whole[:4]).max(axis=1, keepdims=True)
    found = np.concatenate([step.A.values, step.B.values, step.E.values], axis=1)
    np.testing.assert_allclose(found / scale, whole[:4] / scale, atol=5e-5)


def test_the_map_over_a_step_is_what_mujoco_s_steps_near_as_they_get_shorter():
    """Between states in motion; MuJoCo's map of a step is Euler's, of first order, and maps of many steps multiply."""
    mujoco = pytest.importorskip("mujoco")
    finger, dt, tensions = fp.Finger(fp.load_finger("planar", EXPRESSIBLE)), 4e-3, [4.0, 3.0, 5.0]
    x, names = finger.rest_state(np.array([0.5, 0.6])), list(finger.layout.names)
    kept = [name for name in names if name.startswith(("joint_position", "joint_velocity"))]
    x[[names.index(name) for name in kept[2:]]] = [1.0, -2.0]
    ours = fp.linearise(finger, x, tensions, dt=dt)
    expected = np.hstack([ours.A.sel(state=kept, by_state=kept), ours.B.sel(state=kept)])
    # In radians, and radians per step.
    units = np.array([1.0, 1.0, dt, dt])
    errors = []
    for count in (16, 32, 64):
        text = fp.to_mjcf(finger.description, timestep=dt / count, integrator="Euler", shapes=False)
        model = mujoco.MjModel.from_xml_string(text)
        data, whole, a, b = mujoco.MjData(model), np.eye(4, 7), np.zeros((4, 4)), np.zeros((4, 3))
        data.qpos, data.qvel, data.ctrl = [0.5, 0.6], [1.0, -2.0], tensions
        for _ in range(count):
            mujoco.mjd_transitionFD(model, data, 1e-6, True, a, b, None, None)
            mujoco.mj_step(model, data)
            whole = a @ whole
            whole[:, 4:] += b
        errors.append(units[:, None] * (whole - expected) / np.concatenate([units, np.ones(3)]))
    largest = [abs(each).max(axis=0) for each in errors]
    assert np.all(largest[-1] < 2e-3) and np.all(abs(expected[:2, 4:]).max(axis=0) > 2e-3)
    np.testing.assert_allclose(largest[0] / largest[1], 2.0, rtol=0.1)
    np.testing.assert_allclose(largest[1] / largest[2], 2.0, rtol=0.05)
    # What is of first order in the step taken out.
    assert np.all(abs(2.0 * errors[2] - errors[1]) < 0.1 * largest[-1])


@pytest.mark.slow
@pytest.mark.parametrize("speed", [(0.8, -0.5), (-0.02, 0.001), (0.0, 0.0)])
def test_the_map_over_reversals_is_that_of_runs_from_changed_states(speed):
    """Central differences of runs at 1e-12 that choose their own steps; the second joint turns round on the way."""
    finger, u, dt, h = fp.Finger("planar"), np.array([4.0, 3.5, 3.2]), 1e-3, 1e-8
    names = list(finger.layout.names)
    x = finger.rest_state(np.array([0.5, 0.6]), np.array(speed))
    x[[k for k, name in enumerate(names) if "stiction" in name]] = 1e-3

    def end(start):
        simulator = fp.Simulator(finger, position=[0.5, 0.6], rtol=1e-12, atol_scale=1e-12)
        simulator.x = start
        simulator.step(u, dt)
        return np.array(simulator.x)

    columns = [(end(x + h * unit) - end(x - h * unit)) / (2.0 * h) for unit in np.eye(len(x))]
    found, expected = fp.linearise(finger, x, u, dt=dt), np.transpose(columns)
    rows = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found.A.values / rows, expected / rows, atol=1e-4)
    np.testing.assert_allclose(found.rate, end(x), rtol=1e-6, atol=1e-9)


def test_what_cannot_be_linearised_is_refused(drum):
    scenario, x = drum
    for arguments, said in (
        ((scenario, x[:-1], [4.0]), "must be 4 finite numbers"),
        ((scenario, x, [4.0], -1.0), "must be above 0"),
        ((fp.Finger("planar"), np.zeros(9), np.ones(3), None, ["finger.gravity"]), "are those of a scenario"),
        ((scenario, x, [4.0], None, ["finger.gravity"]), "must be a single number"),
        ((scenario, {"joint_position[drums]": 0.4}, [4.0]), r"did you mean joint_position\[drum\]"),
        ((scenario, {"joint_position[drum]": np.nan}, [4.0]), "must be 1 finite number"),
        ((scenario, x, {"tendon_comand.T1": 4.0}), "no such input; .*did you mean"),
        ((scenario, x, {"tendon_command.T1": 4.0, "T1": 3.0}), "must name an input once"),
    ):
        with pytest.raises(fp.InputError, match=said):
            fp.linearise(*arguments)


@pytest.mark.slow
def test_a_posture_or_a_state_by_name_stands_for_the_packed_state():
    finger, angles, pulls = fp.Finger("ub_stand_in"), [0.0, 0.3, 0.3, 0.2], [1.0, 1.0, 4.4, 3.1]
    x = finger.rest_state(np.array(angles))
    packed = fp.linearise(finger, x, pulls)
    assert fp.linearise(finger, angles, pulls).equals(packed)
    assert fp.linearise(finger, finger.layout.unpack(x), pulls).equals(packed)
    whole = dict(zip(map(str, packed.by_state.values), x, strict=True))
    inputs = dict(zip(map(str, packed.input.values), pulls, strict=True))
    assert fp.linearise(finger, whole, inputs).equals(packed)
    # What is left out is at rest at the angles.
    part = {name: value for name, value in whole.items() if name.startswith("joint_position")}
    assert fp.linearise(finger, part, dict(zip(finger.input_names, pulls, strict=True))).equals(packed)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e-6, -1e-6, 1e-3, -1e-3, 0.0])
def test_near_a_reversal_derivatives_are_those_of_the_side_of_the_state_and_it_is_named(speed):
    """F' = s0 (r w - F |r w| / L), L = tanh(mu phi / 2) (2 f^a - F): the slope over w bends at 0, by F / L."""
    frictionless = {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0}
    changed = {"tendon_friction.coulomb": 0.2, "tendons.T1.curvature_offset": 2.5, "joint_friction": frictionless}
    scenario = fp.load_scenario("canal", {f"finger.{key}": value for key, value in changed.items()})
    state = {"joint_position[drum]": 0.4, "joint_velocity[drum]": speed, "tendon_stiction[T1]": 0.5}
    found = fp.linearise(scenario, state, {"tendon_command.T1": 4.0})
    level = np.tanh(0.2 * 2.5 / 2.0) * (2.0 * 4.0 - 0.5)
    slope = found.A.sel(state="tendon_stiction[T1]", by_state="joint_velocity[drum]")
    np.testing.assert_allclose(slope, 5e4 * 0.02 * (1.0 - 0.5 / level * np.sign(speed)), rtol=1e-5)
    assert found.side_by_state.sel(by_state="joint_velocity[drum]") == np.sign(speed)
    assert not found.side_by_state.drop_sel(by_state="joint_velocity[drum]").any()


def test_the_map_over_a_stop_with_a_damper_has_what_an_earlier_hit_changes():
    """A joint at w meets a damper at the edge: w exp(-g (dt - t)) from t on, g = b / J; an earlier start hits later."""
    damper, edge, speed, dt = 2e-3, 0.5, 2.0, 2e-3
    finger = hinged_link(
        joints={"hinge": {"range": [-3.0, edge]}},
        joint_friction={"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0},
        stroke_limiter={"stiffness": 1e-9, "damping": 0.0, "viscous": damper},
    )
    start, decay = 0.4983, damper / HINGED_INERTIA
    hit = (edge - start) / speed
    left = np.exp(-decay * (dt - hit))
    found = fp.linearise(finger, finger.rest_state([start], [speed]), [0.0], dt=dt)
    # theta = edge + w (1 - left) / g; by the start t changes by -1 / w, by the speed by -t / w.
    by_start, by_speed = [left, -decay * left], [hit * left + (1.0 - left) / decay, left * (1.0 - decay * hit)]
    np.testing.assert_allclose(found.A.values[:2, :2], np.transpose([by_start, by_speed]), rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(found.rate[:2], [edge + speed * (1.0 - left) / decay, speed * left], rtol=1e-6)
