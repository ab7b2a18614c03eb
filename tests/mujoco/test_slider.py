"""Friction of one tendon in MuJoCo: what sticks, what slides, and at which force."""

import mujoco
import numpy as np
import pytest
from sliders import exact, run, slider

import finger_pin as fp

ROPE = {"coulomb": 0.2, "curvature_offset": 1.0}
TENSION, BORNE = 10.0, 10.0 * (1.0 - np.exp(-0.2))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_at_four_fifths_of_the_level_nothing_creeps_in_a_minute(integrator):
    model = slider(integrator=integrator, stiffness=5e4, **ROPE)
    data = mujoco.MjData(model)
    data.ctrl[:] = TENSION, 0.8 * BORNE - TENSION
    mujoco.mj_step(model, data, 500)
    before = data.qpos[0]
    mujoco.mj_step(model, data, 29_500)
    assert abs(data.qpos[0] - before) < 59.0 * 1e-8
    # It has given way as bristles do: by more than F / s0, by less than 10 times as much.
    assert 1.0 < data.qpos[0] / (0.8 * BORNE / 5e4) < 10.0
    assert fp.mujoco.friction(model, data).friction[0] == pytest.approx(-0.8 * BORNE, rel=1e-6)


@pytest.mark.parametrize("mass", [1e-5, 1.0])
@pytest.mark.parametrize("solver", ["mjSOL_PGS", "mjSOL_CG", "mjSOL_NEWTON"])
def test_a_rope_breaks_away_within_a_hundredth_of_the_capstan_level_in_either_direction(mass, solver):
    model = slider(mass, **ROPE)
    model.opt.solver = getattr(mujoco.mjtSolver, solver)
    for sign, borne in ((1.0, BORNE), (-1.0, 10.0 * (np.exp(0.2) - 1.0))):
        data, shares = mujoco.MjData(model), np.linspace(0.0, 1.1, 4000)
        signals, taken, moved = fp.mujoco.friction(model, data), [], []
        for share in shares:
            data.ctrl[:] = TENSION, sign * share * borne - TENSION
            mujoco.mj_step(model, data)
            taken.append(-sign * signals.friction[0])
            moved.append(sign * data.qpos[0])
        assert max(taken) == pytest.approx(borne, rel=0.01)
        # It has held until then, and runs since.
        assert max(np.array(moved)[shares < 0.99]) < 1e-3 < 2e-3 < moved[-1]


def test_a_slack_tendon_rubs_no_more_than_its_floor():
    model = slider(**ROPE)
    data = mujoco.MjData(model)
    data.ctrl[1] = 0.01
    mujoco.mj_step(model, data, 500)
    # 0.1 kg under 0.01 N less the floor of 1e-4 N for a second.
    assert data.qvel[0] == pytest.approx(0.0099 / 0.1, rel=1e-3)


def test_drag_of_a_joint_holds_without_a_load_and_takes_as_much_of_a_force_that_moves_it():
    """0.4 N of 0.5 N hold, and 2 N leave (2 - 0.5) / m of acceleration."""
    text = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body><joint name="slide" type="slide"/>
      <geom size="0.01" mass="1"/></body></worldbody><actuator><motor joint="slide"/></actuator></mujoco>"""
    law = {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0, "drag": 0.5, "stiffness": 1e4}
    for force, moved in ((0.4, 0.0), (2.0, 0.5 * 1.5 * 0.5**2)):
        spec = mujoco.MjSpec.from_string(text)
        fp.mujoco.add_friction(spec, joints={"slide": law})
        model = spec.compile()
        data = mujoco.MjData(model)
        data.ctrl[0] = force
        mujoco.mj_step(model, data, 500)
        assert data.qpos[0] == pytest.approx(moved, rel=1e-2, abs=5e-4)


def test_drag_adds_to_the_level():
    model = slider(**ROPE, drag=0.5)
    data = mujoco.MjData(model)
    data.ctrl[:] = TENSION, 3.0 - TENSION
    mujoco.mj_step(model, data, 500)
    least = np.tanh(0.1)
    # F = mu (2 T - F) + drag while it is drawn in.
    assert fp.mujoco.friction(model, data).bristle[0] == pytest.approx(-(20.0 * least + 0.5) / (1.0 + least), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("micro_damping", [0.0, 20.0])
def test_motion_converges_to_the_equations_written_out_at_the_first_order_of_mujoco_s_step(micro_damping):
    law = {"coulomb": 0.3, "curvature_offset": 1.2, "stiction_ratio": 1.4, "stiffness": 2e3, "viscous": 5.0}
    law |= {"stribeck_velocity": 0.01, "drag": 0.2, "micro_damping": micro_damping}

    def pull(t):
        return 6.0 + 5.0 * np.sin(9.0 * t)

    truth = exact(pull, np.linspace(0.0, 0.8, 9), 0.3, 400.0, law)
    model, errors = slider(0.3, 400.0, **law), []
    for step in (5e-5, 2.5e-5, 1.25e-5):
        model.opt.timestep = step
        errors.append(abs(run(model, pull, 0.8, 0.1) - truth).max())
    # It has reversed, stuck and slid by centimetres.
    assert np.ptp(truth) > 0.02 and errors[-1] < 1e-5
    ratios = np.divide(errors[:-1], errors[1:])
    assert ratios.min() > 1.8 and ratios[-1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("mass", [1e-4, 2.0])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_friction_gives_back_no_more_than_its_bristles_hold(mass, integrator):
    """The work taken along the way that MuJoCo goes, under random jumps of tension and load."""
    model = slider(mass, integrator=integrator, **ROPE)
    data, random = mujoco.MjData(model), np.random.default_rng(3)
    signals, taken, most, elastic = fp.mujoco.friction(model, data), 0.0, 0.0, 0.0
    for step in range(4_000):
        if step % 40 == 0:
            data.ctrl[:] = random.uniform(0.0, 20.0), -random.uniform(0.0, 20.0)
        before = data.qpos[0]
        mujoco.mj_step(model, data)
        taken += -signals.friction[0] * (data.qpos[0] - before)
        most, elastic = max(most, taken), max(elastic, signals.level[0] ** 2 / 1e5)
        assert taken > most - elastic
    assert most > 1.0 and elastic < 1e-3


@pytest.mark.parametrize("timestep", [2e-3, 2e-4])
def test_with_runge_kutta_steps_no_more_is_given_back_than_the_force_does_in_the_step_that_reverses(timestep):
    """By the balance of energy, where the work of what pulls is exact.

    Within a step the method does not know when a light mass stops: it errs by what the whole force F does to a mass m
    in a step h, (F h)^2 / (2 m), and by bristles.
    """
    mass, most_force = 1e-4, 40.0
    model = slider(mass, integrator="RK4", **ROPE)
    model.opt.timestep = timestep
    data, random = mujoco.MjData(model), np.random.default_rng(3)
    lost, most, regained = 0.0, 0.0, 0.0
    for step in range(4_000):
        if step % 40 == 0:
            data.ctrl[:] = random.uniform(0.0, 20.0), -random.uniform(0.0, 20.0)
        before, speed = data.qpos[0], data.qvel[0]
        mujoco.mj_step(model, data)
        lost += data.ctrl.sum() * (data.qpos[0] - before) - 0.5 * mass * (data.qvel[0] ** 2 - speed**2)
        most = max(most, lost)
        regained = max(regained, most - lost)
    assert most > 1e3 * regained
    assert regained < 1e-3 + 0.5 * (most_force * timestep) ** 2 / mass
