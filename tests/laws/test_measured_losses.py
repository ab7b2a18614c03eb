"""Losses that recordings of real hands ask for: a drag, gears that lose more one way, springs with hysteresis."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.analysis import steady_state
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.laws.capstan import DRIVEN_TENDON, capstan_coefficient, sliding_tension
from finger_pin.laws.gearbox import GEARBOX
from finger_pin.laws.law import Row
from finger_pin.laws.spring import HYSTERESIS


def settled(law, p, speed, load=lambda t: 0.0, command=0.0, curvature=0.0, end=1.0, state=0.0):
    """The force of a row that slides evenly until the end, from some state."""

    def rate(t, z):
        return [law.value(Row(speed * t, speed, z[0], load(t), command, curvature), p)[1]]

    found = solve_ivp(rate, (0.0, end), [state], method="Radau", rtol=1e-10, atol=1e-12)
    return law.value(Row(speed * end, speed, found.y[0, -1], load(end), command, curvature), p)[0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_tendon_that_slides_evenly_delivers_the_capstan_law_less_its_drag(way):
    surface, turn, drag, pull = 0.0917, np.pi, 0.639, 12.0
    # No Stribeck excess, no viscous friction.
    p = np.array([surface, 1.0, 5e4, 0.0, 0.01, 1e-4, 1.0, 0.0, 0.0, drag, 0.0, 0.0])
    coefficient = np.tanh(surface * turn / 2.0)
    expected = pull * np.exp(-way * surface * turn) - way * drag / (1.0 + way * coefficient)
    assert settled(DRIVEN_TENDON, p, 0.05 * way, command=pull, curvature=turn) == pytest.approx(expected, rel=1e-7)
    closed = sliding_tension(pull, capstan_coefficient(surface, turn), 0.05 * way, 0.0, drag)
    assert closed == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_gears_lose_what_either_torque_costs_in_two_numbers():
    """A level |c_e T + c_m tau|, steady: tau = T + s level; the same level in closed form from the two numbers."""
    external, own, pull = 0.12, 0.2, 0.3
    numbers = {"driving": (external + own) / (1.0 - own), "driven": (external + own) / (1.0 + own)}
    p = np.array([0.0] * 4 + [1.0, 1.0, 0.0, 50.0, *numbers.values()])
    assert GEARBOX.parameters[-2:] == ("driving", "driven")
    for way in (1.0, -1.0):
        level = -way * settled(GEARBOX, p, way, command=pull)
        torque = pull + way * level
        assert level == pytest.approx(external * pull + own * torque, rel=1e-7)


def test_a_spring_with_hysteresis_gives_back_a_share_less_than_it_took():
    share, stiffness, ratio = 0.2, 3.0, 10.0
    p = np.array([share, ratio * stiffness, 1e-9])
    held = settled(HYSTERESIS, p, 1.0, load=lambda t: stiffness * t)
    assert -held == pytest.approx(share / (1.0 + share / ratio) * stiffness, rel=1e-6)
    # Back from twice the stretch, where it holds the same share the other way.
    back = settled(HYSTERESIS, p, -1.0, load=lambda t: stiffness * (2.0 - t), state=-held * 2.0)
    assert back == pytest.approx(share / (1.0 - share / ratio) * stiffness, rel=1e-2)


@pytest.mark.slow
def test_the_account_of_a_servo_finger_with_all_of_these_losses_closes():
    losses = {
        "finger.tendon_friction.drag": 0.3,
        "finger.actuators.*.tendon_hysteresis": 0.1,
        "finger.actuators.*.motor.friction.driving": 0.2,
        "finger.actuators.*.motor.friction.driven": 0.1,
        "finger.joints.medial.spring": {"stiffness": 0.02, "hysteresis": 0.3},
    }
    plain = fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.6}))
    result = fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.6, **losses}))
    exchanged = sum(abs(result[name]).max() for name in result if str(name).startswith("energy_exchanged_"))
    assert abs(result.energy_residual).max() < 1e-4 * exchanged
    assert abs(result.joint_position - plain.joint_position).max() > 1e-3


def test_the_current_of_a_servo_that_slides_evenly_balances_its_torques():
    """Put back into K_t i = T + s level + b w, with the level of the law at N = |K_t i + x T|."""
    losses = {f"finger.actuators.M1.motor.friction.{way}": share for way, share in (("driving", 0.2), ("driven", 0.1))}
    finger = fp.load_scenario("servo_bench", losses).finger
    pull, speed = np.array([[5.0], [5.0], [9.0]]), np.array([0.02, -0.02, 0.05])
    current = steady_state(finger, pull, speed).current[:, 0]
    motor, gears = finger.actuators["M1"].motor, finger.actuators["M1"].motor.friction
    for each, f, v in zip(current, pull[:, 0], speed, strict=True):
        torque, load, w = motor.constants[0] * each, 0.008 * f, v / 0.008
        carried = abs(torque + gears.external_weight * load)
        share = np.exp(-((abs(w) / gears.stribeck_velocity) ** gears.stribeck_exponent))
        level = gears.coulomb + gears.by_load * carried + (gears.stribeck + gears.stribeck_by_load * carried) * share
        level += (gears.driving if v > 0.0 else gears.driven) * load
        assert torque == pytest.approx(load + np.sign(w) * level + gears.viscous * w, rel=2e-4)


def test_no_current_winds_in_by_gears_that_take_all_that_it_adds():
    """T + c + m (x T + tau) = tau has no solution from m = 1 on; they are let out by tau (1 + m) = T (1 - m x) - c."""
    friction = {"coulomb": 0.01, "by_load": 1.2, "stribeck_by_load": 0.0, "viscous": 0.0}
    told = {f"finger.actuators.M1.motor.friction.{name}": value for name, value in friction.items()}
    finger = fp.load_scenario("servo_bench", told).finger
    found = steady_state(finger, np.array([[5.0], [5.0]]), np.array([0.02, -0.02])).current[:, 0]
    load, constant = 0.008 * 5.0, finger.actuators["M1"].motor.constants[0]
    assert found[0] == np.inf
    assert found[1] == pytest.approx((load * (1.0 - 1.2) - 0.01) / 2.2 / constant, rel=1e-12)


def loop(share, stiffness, ratio, low, high):
    """What a spring with hysteresis takes in a cycle between two stretches, J, in closed form.

    Out, F = c k x + a x^-n, and back, F = -c' k x + b x^n, solve F' = s (1 -+ F / (h k x)) with n = s / (h k),
    c = h / (1 + 1 / n), c' = h / (1 - 1 / n); a and b join them at both ends.
    """
    n = ratio / share
    out, back = share / (1.0 + 1.0 / n), share / (1.0 - 1.0 / n)
    u = low / high
    a, b = np.linalg.solve([[1.0, -1.0], [u**-n, -(u**n)]], [-(out + back), -(out + back) * u])
    area = (out + back) * (1.0 - u**2) / 2.0
    area += a * (1.0 - u ** (1.0 - n)) / (1.0 - n) - b * (1.0 - u ** (1.0 + n)) / (1.0 + n)
    return area * stiffness * high**2


PASSIVE = """
extends = "pull_out"
[finger]
name = "strung"
passive_tendon = { stiffness = 400.0, mass = 1e-3, hysteresis = 0.3 }
[finger.joints.drum]
spring = { stiffness = 0.0 }
[finger.tendons.T2]
kind = "passive"
crossings = { drum = { radius = -0.02 } }
[finger.tendon_friction]
coulomb = 0.0
[simulation]
sample_rate = 1000.0
"""


def test_a_passive_tendon_takes_the_area_of_its_loop_whatever_the_speed(tmp_path):
    """Pulled to and fro against the tendon alone, which stays taut; its halves' stretch tells the loop."""
    (tmp_path / "strung.toml").write_text(PASSIVE)
    result = fp.simulate(tmp_path / "strung.toml")
    last = result.time.values >= 4.0
    stretch = -result.passive_position.values[last]
    cycle = 2.0 * loop(0.3, 800.0, 10.0, stretch.min(), stretch.max())
    lost = result.energy_exchanged_passive_hysteresis.values
    assert lost[-1] - lost[4000] == pytest.approx(cycle, rel=1e-4)
    assert abs(result.energy_residual).max() < 1e-5 * lost[-1]


def test_what_halves_of_a_passive_tendon_hold_pulls_and_loads_as_they_do():
    finger, bare = (
        fp.Finger(fp.load_finger("ub_stand_in", {"finger.passive_tendon.hysteresis": h})) for h in (0.3, 0.0)
    )
    rng, command = np.random.default_rng(4), np.array([2.0, 3.0, 5.0, 4.0])
    x = np.stack([finger.rest_state(each) for each in rng.uniform(0.2, 0.8, (20, 4)) * [0.1, 1.0, 1.0, 1.0]])
    x += rng.normal(size=x.shape) * 0.05 * finger.layout.scales()
    place = finger.layout.names.index("elastic_stiction[T5.proximal]")
    z = x[:, place : place + 2]
    found = finger.evaluate(x, command)
    without = bare.evaluate(np.delete(x, [place, place + 1], axis=1), command)
    halves = without.strands[:, 4:] - z
    np.testing.assert_allclose(found.strands[:, 4:], halves, rtol=1e-12)
    np.testing.assert_allclose(found["passive_tension_proximal"], halves[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found["tendon_normal_force"][:, 4], abs(halves.sum(axis=1)), rtol=1e-12)
    np.testing.assert_allclose(found["joint_reaction"], abs(found.strands @ finger.routing.loads.T), rtol=1e-12)
    # What is held pulls at the mass and at the joints.
    moved = finger.rigid_body.mass_matrix(x[0, :4]) @ (
        found["joint_acceleration"][0] - without["joint_acceleration"][0]
    )
    np.testing.assert_allclose(moved, -z[0] @ finger.strand_coupling[4:], atol=1e-9)
    pushed = found.mechanism.acceleration[..., 4:] - without.mechanism.acceleration[..., 4:]
    np.testing.assert_allclose(finger.tendons.mass * pushed[:, 0], z[:, 1] - z[:, 0], atol=1e-9)
    compiled = CompiledFinger(finger).evaluate(x, command)
    np.testing.assert_allclose(compiled.rate, found.rate, rtol=1e-9, atol=1e-6)


def test_a_model_for_mujoco_says_that_it_has_no_hysteresis():
    held = fp.load_finger("ub_stand_in", {"finger.passive_tendon.hysteresis": 0.1})
    assert "(hysteresis)" in fp.to_mjcf(held) and "(hysteresis)" not in fp.to_mjcf("ub_stand_in")
