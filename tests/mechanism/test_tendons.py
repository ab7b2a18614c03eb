"""The tendon layer against the capstan law, the series spring and energy gradients."""

import math

import numpy as np
import pytest
from exerted import tendon_forces
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.tendons import Tendons

R35, R45, K_T, MASS = 3.5e-3, 5.0e-3, 5e4, 8.8e-6


@pytest.fixture(scope="module")
def layer(ub):
    return Tendons.from_description(ub)


@pytest.fixture(scope="module")
def dry():
    """The paper's tendons without viscous friction, so that steady sliding is pure Coulomb friction."""
    return Tendons.from_description(fp.load_finger("ub_stand_in", {"finger.tendon_friction.viscous": 0.0}))


def at_rest(layer, position, passive=None, stiction=None, command=None):
    position = np.asarray(position, dtype=float)
    passive = layer.rest_position(position) if passive is None else np.array([passive])
    stiction = np.zeros(5) if stiction is None else stiction
    command = np.zeros(4) if command is None else command
    return tendon_forces(layer, position, np.zeros(4), passive, np.zeros(1), stiction, command)


def test_coefficient_is_the_printed_exponential_form_of_equation_16():
    surface, curvature = np.meshgrid([0.0, 0.05, 0.11, 0.4], [0.0, 0.28, 1.0, 4.0])
    decay = np.exp(-surface * curvature)
    np.testing.assert_allclose(
        capstan_coefficient(surface, curvature), (1.0 - decay) / (1.0 + decay), rtol=1e-12, atol=1e-17
    )


@pytest.mark.slow
@pytest.mark.parametrize(("direction", "sign"), [(1.0, -1.0), (-1.0, 1.0)], ids=["pulling", "releasing"])
@pytest.mark.parametrize("posture", [(0.0, 0.0, 0.0, 0.0), (-0.1, 0.6, 0.9, 0.7)])
def test_steady_sliding_delivers_the_tension_of_the_capstan_law(dry, direction, sign, posture):
    """F^n = f + f^a and f^f = +-mu F^n give f / f^a = (1 -+ mu) / (1 +- mu) = exp(-+mu_e phi), mu = tanh(mu_e phi / 2).

    Every tendon is drawn past its canal at fixed posture, fast enough for Coulomb friction, until friction settles.
    """
    position, command = np.array(posture), np.array([2.0, 3.0, 5.0, 7.0])
    # The tendons share joints, so that their velocities cannot all be chosen at once.
    for tendon in range(4):
        row = dry.routing.coupling[tendon]
        velocity = direction * 0.5 * row / (row @ row)

        def rate(_, stiction, velocity=velocity):
            return tendon_forces(dry, position, velocity, np.zeros(1), np.zeros(1), stiction, command).stiction_rate

        settled = solve_ivp(rate, (0.0, 0.01), np.zeros(5), method="LSODA", rtol=1e-7, atol=1e-10).y[:, -1]
        forces = tendon_forces(dry, position, velocity, np.zeros(1), np.zeros(1), settled, command)
        t1, t2, t3 = np.abs(position[:3])
        curvature = (1.0 + t1, 1.0 + t1, 0.28 + t2, 0.51 + t2 + t3)[tendon]
        expected = math.exp(sign * 0.11 * curvature)
        assert forces.velocity[tendon] == pytest.approx(direction * 0.5, rel=1e-12)
        assert forces.strands[tendon] / command[tendon] == pytest.approx(expected, rel=1e-8)


def test_a_sliding_passive_tendon_obeys_the_capstan_law_between_its_halves(dry):
    """Drawn proximally, p5' > 0, f5_3 - f5_4 = mu (f5_3 + f5_4) when steady, so f5_4 = f5_3 exp(-mu_e phi)."""
    ratio = math.exp(-0.11 * 0.58)
    proximal = 4.0
    distal = proximal * ratio
    position = np.array([0.0, 0.0, 0.8, 0.0])
    passive = R35 * position[2] - proximal / (2.0 * K_T)
    position[3] = (passive - distal / (2.0 * K_T)) / R45
    mu = (1.0 - ratio) / (1.0 + ratio)
    stiction = np.array([0.0, 0.0, 0.0, 0.0, mu * (proximal + distal)])
    forces = tendon_forces(dry, position, np.zeros(4), np.array([passive]), np.array([0.5]), stiction, np.zeros(4))
    np.testing.assert_allclose(forces.strands[4:], [proximal, distal], rtol=1e-9)
    assert forces.normal[4] == pytest.approx(proximal + distal, rel=1e-9)
    assert forces.stiction_rate[4] / (5e4 * 0.5) == pytest.approx(0.0, abs=1e-9)
    assert forces.passive_acceleration[0] * MASS == pytest.approx(0.0, abs=1e-9)


def test_stiction_coefficient_is_rho_times_the_capstan_coefficient(layer):
    command = np.array([2.0, 3.0, 5.0, 7.0])
    forces = at_rest(layer, [0.05, 0.4, 0.5, 0.3], command=command)
    curvature = np.array([1.05, 1.05, 0.68, 1.41, 0.58])
    np.testing.assert_allclose(forces.curvature, curvature, rtol=1e-12)
    np.testing.assert_allclose(forces.coefficient, np.tanh(0.055 * curvature), rtol=1e-12)
    normal = np.append(2.0 * command, 2.0 * K_T * (R35 * 0.5 - R45 * 0.3))
    np.testing.assert_allclose(forces.normal, normal, rtol=1e-9)
    np.testing.assert_allclose(forces.level, 1.5 * np.tanh(0.055 * curvature) * normal, rtol=1e-9)


def test_curvature_grows_with_rotation_either_way(layer):
    one, other = (at_rest(layer, [sign * 0.1, 0.2, 0.3, 0.2]).curvature for sign in (1.0, -1.0))
    np.testing.assert_array_equal(one, other)
    assert one[0] == pytest.approx(1.1, rel=1e-12)


def test_two_halves_of_twice_the_stiffness_make_the_rope_of_equation_5(layer):
    draw = np.random.default_rng(5)
    slack = 0
    for _ in range(200):
        position = draw.uniform(0.0, 1.5, 4)
        forces = at_rest(layer, position)
        rope = max(0.0, K_T * (R35 * position[2] - R45 * position[3]))
        slack += rope == 0.0
        np.testing.assert_allclose(forces.strands[4:], [rope, rope], rtol=1e-9, atol=1e-9)
    assert 0 < slack < 200


def test_the_massless_middle_rests_half_way_between_its_ends(layer):
    position = np.array([0.05, 0.3, 0.7, 0.2])
    assert layer.rest_position(position)[0] == pytest.approx(0.5 * (R35 * 0.7 + R45 * 0.2), rel=1e-12)


@pytest.mark.parametrize(
    ("proximal", "distal"), [(2e-5, 3e-5), (2e-5, -3e-5), (-2e-5, 3e-5), (-2e-5, -3e-5), (0.0, 0.0)]
)
def test_each_half_pulls_only(layer, proximal, distal):
    """Stretches of the halves, m, chosen one by one; each gives max(0, K_h stretch)."""
    position = np.array([0.0, 0.3, 0.6, 0.0])
    passive = R35 * 0.6 - proximal
    position[3] = (passive - distal) / R45
    forces = at_rest(layer, position, passive=passive)
    expected = [max(0.0, 1e5 * proximal), max(0.0, 1e5 * distal)]
    np.testing.assert_allclose(forces.strands[4:], expected, atol=1e-10)


def test_no_tension_is_ever_negative(layer):
    draw = np.random.default_rng(6)
    count = 500
    position = draw.uniform(-0.2, 1.7, (count, 4))
    passive = layer.rest_position(position) + draw.normal(0.0, 5e-5, (count, 1))
    forces = tendon_forces(
        layer,
        position,
        draw.normal(0.0, 5.0, (count, 4)),
        passive,
        draw.normal(0.0, 0.1, (count, 1)),
        draw.normal(0.0, 2.0, (count, 5)),
        draw.uniform(0.0, 3.0, (count, 4)),
    )
    assert np.all(forces.strands >= 0.0)
    assert np.all((forces.strands == 0.0).any(axis=0)) and np.all((forces.strands > 0.0).any(axis=0))


def test_delivered_tension_is_the_command_less_friction_until_slack(layer):
    stiction = np.array([0.5, -0.5, 4.0, 0.0, 0.0])
    velocity = np.array([0.1, 0.2, 0.3, 0.4])
    command = np.array([2.0, 2.0, 2.0, 2.0])
    forces = tendon_forces(layer, np.array([0.0, 0.3, 0.3, 0.2]), velocity, np.zeros(1), np.zeros(1), stiction, command)
    sliding = [8e-3 * 0.1 + 8e-3 * 0.2, -8e-3 * 0.1 + 8e-3 * 0.2, 6.3e-3 * 0.3, -5.3e-3 * 0.9]
    np.testing.assert_allclose(forces.velocity[:4], sliding, rtol=1e-12)
    expected = [2.0 - 0.5 - sliding[0], 2.0 + 0.5 - sliding[1], 0.0, 2.0 - sliding[3]]
    np.testing.assert_allclose(forces.strands[:4], expected, rtol=1e-12)
    np.testing.assert_allclose(forces.normal[:4], np.array(expected) + command, rtol=1e-12)


def test_the_middle_of_a_taut_passive_tendon_is_pushed_back_with_twice_the_half_stiffness(layer):
    """m5 p5'' = f5_3 - f5_4 falls with p5 by 2 K_h: stable, unlike the printed signs."""
    position = np.array([0.0, 0.3, 0.6, 0.3])
    middle = layer.rest_position(position)[0]
    for offset in (1e-6, -1e-6, 1e-5):
        acceleration = at_rest(layer, position, passive=middle + offset).passive_acceleration[0]
        assert acceleration == pytest.approx(-4.0 * K_T * offset / MASS, rel=1e-6)


def test_friction_brakes_the_middle_of_the_passive_tendon(layer):
    position = np.array([0.0, 0.3, 0.6, 0.3])
    middle = layer.rest_position(position)
    for velocity in (0.2, -0.2):
        forces = tendon_forces(
            layer, position, np.zeros(4), middle, np.array([velocity]), np.array([0, 0, 0, 0, velocity]), np.zeros(4)
        )
        # f5^f = F^s + b v with b = 1: twice the velocity, as a number.
        assert forces.passive_acceleration[0] * MASS == pytest.approx(-2.0 * velocity, rel=1e-9)


def test_passive_strands_are_the_gradient_of_the_energy_of_two_springs(layer):
    """Torque on the joints is -dV/dtheta and force on the mass -dV/dp5, V = K_h (s3^2 + s4^2) / 2 where stretched."""

    def energy(position, passive):
        stretches = (R35 * position[2] - passive, passive - R45 * position[3])
        return sum(0.5 * 2.0 * K_T * max(0.0, stretch) ** 2 for stretch in stretches)

    draw = np.random.default_rng(7)
    step = 1e-6
    for _ in range(30):
        position = draw.uniform(0.0, 1.5, 4)
        passive = float(layer.rest_position(position)[0] + draw.normal(0.0, 1e-3))
        forces = at_rest(layer, position, passive=passive)
        torque = layer.routing.strand_coupling[4:].T @ forces.strands[4:]
        numeric = [
            -(energy(position + step * unit, passive) - energy(position - step * unit, passive)) / (2 * step)
            for unit in np.eye(4)
        ]
        np.testing.assert_allclose(torque, numeric, rtol=1e-5, atol=1e-6)
        # Between two moves of the mass the energy is quadratic, so a central difference is exact.
        push = -(energy(position, passive + 1e-7) - energy(position, passive - 1e-7)) / 2e-7
        assert forces.passive_acceleration[0] * MASS == pytest.approx(push, rel=1e-5, abs=1e-5)


def test_the_passive_tendon_flexes_the_distal_joint_and_extends_the_medial_one(layer):
    forces = at_rest(layer, [0.0, 0.3, 0.6, 0.3])
    torque = layer.routing.strand_coupling[4:].T @ forces.strands[4:]
    tension = K_T * (R35 * 0.6 - R45 * 0.3)
    np.testing.assert_allclose(torque, [0.0, 0.0, -R35 * tension, R45 * tension], rtol=1e-9)
    assert tension > 0.0


def test_forces_of_a_batch_are_those_of_each_row(layer):
    draw = np.random.default_rng(8)
    rows = [draw.normal(0.0, scale, (6, size)) for scale, size in ((0.5, 4), (2.0, 4), (1e-3, 1), (0.1, 1), (1.0, 5))]
    rows.append(draw.uniform(0.0, 4.0, (6, 4)))
    batch = tendon_forces(layer, *rows)
    for index in range(6):
        single = tendon_forces(layer, *(block[index] for block in rows))
        for name, value in vars(single).items():
            np.testing.assert_allclose(getattr(batch, name)[index], value, rtol=1e-12, atol=1e-15, err_msg=name)


def test_several_passive_tendons_each_follow_their_own_joints_stiffness_and_mass(network):
    description = network(
        "abc",
        {"F": {"a": 6}, "E": {"a": -5, "b": -5, "c": -5}, "P": {"a": -3, "b": 4}, "Q": {"b": -2, "c": 3}},
        ["P", "Q"],
        passive_tendon={"stiffness": [1e4, 3e4], "mass": [1e-5, 2e-5]},
        tendon_friction={"viscous": 0.0},
    )
    layer = Tendons.from_description(description)
    position, passive = np.array([0.9, 0.5, 0.2]), np.array([2.3e-3, 0.85e-3])
    forces = tendon_forces(layer, position, np.zeros(3), passive, np.zeros(2), np.zeros(4), np.ones(2))
    p3, p4 = 2e4 * (2.7e-3 - 2.3e-3), 2e4 * (2.3e-3 - 2.0e-3)
    q3, q4 = 6e4 * (1.0e-3 - 0.85e-3), 6e4 * (0.85e-3 - 0.6e-3)
    np.testing.assert_allclose(forces.strands, [1.0, 1.0, p3, p4, q3, q4], rtol=1e-9)
    np.testing.assert_allclose(forces.passive_acceleration, [(p3 - p4) / 1e-5, (q3 - q4) / 2e-5], rtol=1e-8)
    np.testing.assert_allclose(forces.normal, [2.0, 2.0, p3 + p4, q3 + q4], rtol=1e-9)


def test_a_passive_tendon_fixed_to_the_base_is_a_one_sided_spring_on_its_joint(network):
    """One crossing: anchored at the base, its mass before the joint; at rest both halves carry K_t r theta."""
    description = network("a", {"F": {"a": 6}, "P": {"a": -4}}, ["P"], passive_tendon={"stiffness": 2e3})
    layer = Tendons.from_description(description)
    for angle in (0.5, -0.5):
        position = np.array([angle])
        none, middle = np.zeros(1), layer.rest_position(position)
        forces = tendon_forces(layer, position, none, middle, none, np.zeros(2), none)
        # Negative radius: extending (negative rotation) stores nothing, flexing stretches it by r theta.
        tension = max(0.0, 2e3 * 4e-3 * angle)
        np.testing.assert_allclose(forces.strands[1:], [tension, tension], rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(forces.strands @ layer.routing.strand_coupling, [-4e-3 * tension], atol=1e-15)


def test_a_finger_without_passive_tendons_has_none_of_their_forces():
    layer = Tendons.from_description(fp.load_finger("planar"))
    forces = tendon_forces(layer, *np.zeros((2, 2)), *np.zeros((2, 0)), np.zeros(3), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(forces.strands, [1.0, 2.0, 3.0])
    assert forces.passive_acceleration.shape == (0,)
