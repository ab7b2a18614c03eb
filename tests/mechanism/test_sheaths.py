"""Cords that stretch within their sheaths, against closed forms of a continuous one, K = 2000 N/m, mu phi = 1.

With T(s) = T_0 exp(-mu k s) as it is drawn in by x, T_0 = K x a / (1 - exp(-a)). Let out again from T_1 its first part
slides back, as far as T_1 exp(-sigma) = T_0 exp(sigma), so that x_1 - x = (sqrt(T_1) - sqrt(T_0))^2 / (K a); from
T_0 = T_1 exp(-2 a) on all of it slides, T_0 = K a x / (exp(a) - 1).
"""

import numpy as np
import pytest
from servo_cases import SMOOTH

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import InputError

K, A, X1 = 2000.0, 1.0, 0.006
T1 = K * X1 * A / (1.0 - np.exp(-A))
TIMES, WOUND = [0.0, 0.6, 1.4, 1.5], [0.0, X1, 0.0, 0.0]
FRICTION = {"coulomb": 1.0, "viscous": 0.0, "stiction_ratio": 1.0}
FREE = {"coulomb": 0.0, "stiction": 0.0}


def scenario(duration, joint, **tendon):
    drum = {"range": [-1.0, 4.0], "link": {"length": 0.04, "width": 0.02, "mass": 0.02}} | joint
    tendon = {"curvature_offset": A, "crossings": {"drum": {"radius": 0.02}}} | tendon
    finger = {"name": "sheath", "gravity": [0.0, 0.0, 0.0], "joints": {"drum": drum}, "tendons": {"T1": tendon}}
    settings = {"duration": duration, "initial": {"position": {"drum": 0.0}}}
    finger |= {"tendon_friction": FRICTION, "joint_friction": FREE}
    return read_scenario({"name": "sheath", "finger": finger, "simulation": settings})


def drawn(pieces):
    """Draw a cord in whose far end a stiff drum holds, and let it out; return the run and what is wound in."""
    hold = {"spring": {"stiffness": 4000.0, "damping": 0.5}}
    held = scenario(TIMES[-1], hold, winch={"stiffness": K, "damping": 0.0, "pieces": pieces})
    times = np.linspace(0.0, TIMES[-1], 3001)
    result = fp.simulate(held, controller=(times, {"tendon_winding.T1": np.interp(times, TIMES, WOUND)}))
    return result, np.interp(result.time.values, TIMES, WOUND)


@pytest.fixture(scope="module")
def ten():
    return drawn(10)


def loop_area(result, wound):
    return np.trapezoid(result.spool_tension.values[:, 0], wound)


def test_tensions_at_both_ends_are_those_of_a_continuous_sheath_drawn_in_and_let_out(ten):
    """To 2 % of the greatest, but in the thousandth after the turn, where the slope of the closed form is infinite."""
    result, wound = ten
    time, near, far = result.time.values, result.spool_tension.values[:, 0], result.tendon_tension.values[:, 0]
    drawing, letting = (time > 0.01) & (time <= 0.6), (time > 0.6) & (wound < 0.999 * X1)
    np.testing.assert_allclose(near[drawing], T1 * wound[drawing] / X1, rtol=4e-3, atol=2e-3 * T1)
    np.testing.assert_allclose(far[drawing], np.exp(-A) * T1 * wound[drawing] / X1, rtol=4e-3, atol=2e-3 * T1)
    tension = np.linspace(0.0, T1, 20001)
    partly = tension > T1 * np.exp(-2.0 * A)
    length = np.where(
        partly, X1 - (np.sqrt(T1) - np.sqrt(tension)) ** 2 / (K * A), tension * (np.exp(A) - 1.0) / (K * A)
    )
    behind = np.where(partly, T1 * np.exp(-A), tension * np.exp(A))
    np.testing.assert_allclose(near[letting], np.interp(wound[letting], length, tension), atol=0.02 * T1)
    np.testing.assert_allclose(far[letting], np.interp(wound[letting], length, behind), atol=0.004 * T1)


def test_a_slow_cycle_loses_the_closed_form_and_twice_the_pieces_miss_a_quarter_of_it(ten):
    """The area is x_1 T_1 / 2 less what comes back."""
    back = 2.0 / 3.0 * (1.0 - np.exp(-3.0 * A)) - 0.5 * (1.0 - np.exp(-4.0 * A))
    back += 0.5 * np.exp(-4.0 * A) * (np.exp(A) - 1.0)
    expected = T1**2 / (K * A) * (0.5 * (1.0 - np.exp(-A)) - back)
    fine, coarse = (loop_area(*run) / expected - 1.0 for run in (ten, drawn(5)))
    assert abs(fine) < 0.02 and 3.0 < coarse / fine < 5.0


def test_what_a_winch_supplies_in_a_cycle_is_lost_in_its_sheath(ten):
    result, wound = ten
    lost = result.energy_exchanged_tendon_coulomb + result.energy_exchanged_tendon_viscous
    assert float(lost[-1]) == pytest.approx(loop_area(result, wound), rel=1e-3)
    assert float(abs(result.energy_residual).max()) < 1e-4 * float(lost[-1])


def test_a_cord_that_is_drawn_out_at_its_far_end_has_the_same_stiffness_there():
    """A spring turns the drum, which takes the time of a damper, while the winch stands still."""
    spring = {"stiffness": 4.0, "rest": -0.2, "damping": 0.4}
    standing = scenario(1.0, {"spring": spring}, winch={"stiffness": K, "damping": 0.0, "pieces": 10})
    result = fp.simulate(standing, controller=([0.0, 1.0], {"tendon_winding.T1": np.zeros(2)}))
    stretch, far = -0.02 * float(result.joint_position[-1, 0]), float(result.tendon_tension[-1, 0])
    assert stretch > 1e-3
    assert far == pytest.approx(K * A / (1.0 - np.exp(-A)) * stretch, rel=4e-3)
    assert float(result.spool_tension[-1, 0]) == pytest.approx(np.exp(-A) * far, rel=4e-3)


def servo_finger():
    drum = {"range": [-1.0, 4.0], "link": {"length": 0.04, "width": 0.02, "mass": 0.02}}
    cords = {"T1": 0.02, "T2": -0.02, "T3": 0.01}
    tendons = {
        name: {"curvature_offset": A, "crossings": {"drum": {"radius": r, "bends": 1}}} for name, r in cords.items()
    }
    tendons["T3"]["winch"] = {"pieces": 2}
    servo = {"motor": SMOOTH, "tendons": ["T1", "T2"], "spool_radius": 0.01, "drive": "position", "pretension": 5.0}
    table = {"name": "sheaths", "joints": {"drum": drum}, "tendons": tendons, "joint_friction": FREE}
    friction = FRICTION | {"place": "bends", "drag": 0.3}
    table |= {"tendon_friction": friction, "actuators": {"servo": servo | {"tendon_pieces": [3, 0]}}}
    return table


def test_sheaths_of_spools_close_the_account_and_compiled_rows_are_the_readable_ones():
    """Of two cords on a spool one has a sheath, beside a winch's; pretension is the same everywhere at first."""
    controller = {"kind": "tensions", "spool_angle": {"servo": {"amplitude": 0.5, "frequency": 8.0}}}
    controller |= {"tendon_winding": {"T3": {"offset": 0.0, "amplitude": 1e-4, "frequency": 7.0}}}
    run = read_scenario(
        {"name": "s", "finger": servo_finger(), "controller": controller, "simulation": {"duration": 0.15}}
    )
    result = fp.simulate(run)
    assert float(result.spool_tension[0, 0]) == pytest.approx(5.0)
    assert result.sheath_pieces_force[0, :3].values == pytest.approx(5.0)
    exchanged = float(result.energy_exchanged_tendon_coulomb[-1])
    assert exchanged > 0.01 and float(abs(result.energy_residual).max()) < 1e-4 * exchanged
    finger = fp.Finger(run.finger)
    rng, x = np.random.default_rng(3), finger.rest_state([0.3])
    x = x + rng.normal(size=x.size) * 1e-2
    inputs = rng.uniform(0.0, 1e-3, finger.mechanism.channels)
    compiled = CompiledFinger(finger).evaluate(x[None], inputs[None]).rate[0]
    np.testing.assert_allclose(compiled, finger.rhs(0.0, x, inputs), rtol=1e-9)


def test_a_written_model_lists_that_it_has_no_sheath():
    assert "winches, their spools and what stretches on the way or in a sheath" in fp.to_mjcf(
        scenario(1.0, {}, winch={"pieces": 4}).finger
    )


def test_pieces_are_refused_where_they_would_have_no_one_answer():
    winch = scenario(1.0, {}, winch={"pieces": 4}).finger
    with pytest.raises(InputError, match=r"stiction_ratio.*must be 1 .*T1"):
        fp.Finger(winch.updated(tendon_friction=winch.tendon_friction.updated(stiction_ratio=1.5)))
    with pytest.raises(InputError, match=r"tendons\.T1\.winch\.pieces.*must be 0"):
        fp.analysis.equilibrium(winch, [1e-3])
    table = servo_finger()
    table["actuators"]["servo"]["tendon_hysteresis"] = 0.1
    with pytest.raises(InputError, match=r"servo\.tendon_hysteresis.*must be 0"):
        fp.load_finger("ub_stand_in", {"finger": table})
