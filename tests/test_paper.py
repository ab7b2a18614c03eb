"""The claims of the paper and its model, on runs of the finger."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
import scipy.optimize

import finger_pin as fp
from finger_pin.references.reference import ReferenceSignals

#: Reversals of the references of reversals after its start, by joint, s.
REVERSALS = {
    "abduction": (0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5),
    "proximal": (2.0, 4.0, 6.0),
    "medial": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
    "distal": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
}


@dataclass(frozen=True)
class Ramp:
    """From one posture to another within a time, then held."""

    start: tuple[float, ...]
    end: tuple[float, ...]
    duration: float

    def at(self, time):
        rise = np.clip(np.asarray(time) / self.duration, 0.0, 1.0)[..., None]
        move = np.subtract(self.end, self.start)
        return ReferenceSignals(self.start + rise * move, 0.0 * rise * move)


def posture(abduction, tension):
    """A posture in which T5 carries a tension, equation (20)."""
    return abduction, 0.3, 0.5, (3.5e-3 * 0.5 - tension / 5e4) / 5e-3


def run(reference, duration, **settings):
    defaults = {"simulation.duration": duration, "simulation.method": "BDF", "simulation.rtol": 1e-5}
    scenario = fp.load_scenario("reversals", defaults | settings)
    return fp.simulate(scenario, reference=reference)


@pytest.fixture(scope="module")
def settled(reversals):
    """After the first second."""
    return reversals.sel(time=slice(1.0, None))


def test_tendon_friction_depends_on_the_posture(finger):
    """Conclusions, first point: bending the joints that bend T4's path raises its loss by the capstan law."""

    def coefficient(posture):
        return finger.evaluate(finger.rest_state(posture), np.ones(4))["tendon_friction_coefficient"]

    straight, bent = coefficient([0.0, 0.0, 0.0, 0.0]), coefficient([0.0, 1.5, 1.5, 0.0])
    turns = 0.51 + 3.0
    assert straight[3] == pytest.approx((1 - math.exp(-0.11 * 0.51)) / (1 + math.exp(-0.11 * 0.51)), rel=1e-12)
    assert bent[3] == pytest.approx((1 - math.exp(-0.11 * turns)) / (1 + math.exp(-0.11 * turns)), rel=1e-12)
    assert bent[3] > 6.0 * straight[3]
    np.testing.assert_array_equal(bent[[0, 1, 4]], straight[[0, 1, 4]])


def test_joint_friction_grows_with_the_sum_of_the_tensions(finger):
    """Conclusions, second point: (17), so that twice the tensions make twice the break-away torque."""
    x = finger.rest_state(np.array([0.0, 0.4, 0.5, 0.4]))
    tension = np.array([1.0, 2.0, 3.0, 4.0])
    levels = [finger.evaluate(x, factor * tension).rows["joint_friction"]["level"] for factor in (1.0, 2.0, 10.0)]
    np.testing.assert_allclose(levels[0], 3.5e-4 * np.array([10.0, 10.0, 7.0, 4.0]), rtol=1e-9)
    np.testing.assert_allclose(levels[1], 2.0 * levels[0], rtol=1e-9)
    np.testing.assert_allclose(levels[2], 10.0 * levels[0], rtol=1e-9)


@cache
def stepped(**settings):
    """Abduction, asked for a step of 0.05 rad."""
    return run(Ramp(posture(0.0, 1.0), posture(0.05, 1.0), 0.06), 0.12, **settings).sel(joint="abduction")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinetic", "excess"),
    [
        (2.5e-4, {"controller.minimum_tension": 20.0}),
        (2e-2, {"finger.joint_friction.coulomb": 2e-2, "finger.joint_friction.stiction": 2e-2}),
    ],
    ids=["high tensions", "high friction coefficient"],
)
def test_high_tensions_or_friction_grip_a_phalanx(kinetic, excess):
    """Conclusions: a torque that moves the free joint only bends the bristles of the gripped one.

    Without help from the tendons' friction its deflection x solves K_P (step - x) = L (1 - exp(-s0 x / L)), L = M^d R.
    """
    step, gripped = 0.05, stepped(**excess)
    assert float(stepped().joint_position[-1]) > 0.8 * step
    level = kinetic * float(gripped.joint_reaction.min())
    deflection = scipy.optimize.brentq(lambda x: step - x - level * (1.0 - math.exp(-5.0 * x / level)), 0.0, step)
    assert float(abs(gripped.joint_position).max()) < deflection < 0.3 * step
    assert float(abs(gripped.joint_velocity[-1])) < 0.02


def test_n_plus_one_tendons_hold_each_other(routing):
    """Sec. II: four joints, five tendons, one antagonist; any two of the balancing tensions fix the others' ratio."""
    closure = routing.force_closure()
    assert len(routing.tendons) == len(routing.joints) + 1
    assert closure.null_space.shape[1] == 1 and closure.holds
    for missing in range(5):
        kept = [index for index in range(5) if index != missing]
        assert np.linalg.matrix_rank(routing.coupling[kept]) == 4


@pytest.mark.slow
def test_without_friction_the_other_tendons_control_the_passive_one():
    """Conclusions, third point: T5 goes from 1 N to the 3.2 f0 that balance T1 to T4, when friction is switched off.

    The reference asks for the stretch of that tension; else the controller's stiffness would oppose it.
    """
    minimum = 2.5
    settings = {
        "finger.gravity": [0.0, 0.0, 0.0],
        "finger.tendon_friction.coulomb": 0.0,
        "finger.tendon_friction.viscous": 5.0,
        "finger.joint_friction.coulomb": 0.0,
        "finger.joint_friction.stiction": 0.0,
        "finger.joint_friction.viscous": 0.01,
        "controller.minimum_tension": minimum,
    }
    wanted = 16.0 / 5.0 * minimum
    final = run(Ramp(posture(0.0, 1.0), posture(0.0, wanted), 0.05), 0.3, **settings).isel(time=-1)
    assert float(final.tendon_command.sel(tendon="T5")) == pytest.approx(wanted, rel=1e-3)
    assert float(final.tendon_tension.sel(tendon="T5")) == pytest.approx(wanted, rel=1e-3)
    assert float(final.passive_tension_proximal) == pytest.approx(wanted, rel=1e-3)


def test_with_friction_the_passive_tension_still_follows_the_plan(settled):
    """Conclusions, third point, "approximately": within friction and inertia, T5 rises and falls with its plan."""
    tension = settled.tendon_tension.sel(tendon="T5").values
    planned = settled.tendon_command.sel(tendon="T5").values
    assert np.corrcoef(tension, planned)[0, 1] > 0.7


def test_the_passive_tendon_is_never_slack(reversals):
    assert float(reversals.tendon_tension.sel(tendon="T5").min()) > 0.9
    assert float(reversals.passive_tension_proximal.min()) > 0.9


def test_all_tendons_stay_taut(reversals):
    assert float(reversals.tendon_tension.min()) > 0.5
    assert float(abs(reversals.power_slack).max()) == 0.0


def test_tracking_errors_are_those_of_the_model_page(settled):
    """Section 8: near 0.5, 0.8, 1.1, 1.7 degrees."""
    largest = np.degrees(abs(settled.tracking_error).max("time").values)
    np.testing.assert_allclose(largest, [0.5, 0.8, 1.1, 1.7], atol=0.1)


def test_tensions_are_those_of_the_model_page(settled):
    """Section 8: T3 up to about 9 N, T5 between 1 and 7 N."""
    peak = float(settled.tendon_tension.sel(tendon="T3").max())
    assert peak == pytest.approx(9.0, abs=0.6)
    for passive in (settled.tendon_tension.sel(tendon="T5"), settled.passive_tension_proximal):
        assert float(passive.min()) > 0.9
        assert float(passive.max()) < 7.5


def test_no_stroke_limiter_is_touched_after_the_start(settled):
    np.testing.assert_array_equal(settled.limiter_torque, 0.0)


@pytest.mark.parametrize("joint", REVERSALS)
def test_joints_stick_when_their_reference_turns_back(reversals, joint):
    """For 80 ms after each reversal the joint hardly follows, and its friction stays below break-away, M^c R."""
    followed = []
    for turn in REVERSALS[joint]:
        window = reversals.sel(joint=joint, time=slice(turn - 1e-6, turn + 0.08 + 1e-6))
        followed.append(np.ptp(window.joint_position.values) / np.ptp(window.joint_reference.values))
        assert float((abs(window.joint_stiction) / (3.5e-4 * window.joint_reaction)).max()) < 0.96
    assert np.median(followed) < 0.35
    assert max(followed) < 0.75


@pytest.mark.parametrize("joint", REVERSALS)
def test_friction_has_turned_round_within_a_fifth_of_a_second_of_a_reversal(reversals, joint):
    for turn in REVERSALS[joint]:
        before, after = (
            reversals.joint_stiction.sel(joint=joint, time=slice(turn + a, turn + b)).mean()
            for a, b in ((-0.1, 0.0), (0.15, 0.2))
        )
        assert float(before) * float(after) < 0.0


def test_sliding_joints_are_held_back_by_the_coulomb_level(reversals):
    """While joint 3 sweeps back at over 1 rad/s, ten times omega, its stiction is M^d R against the motion."""
    joint = reversals.sel(joint="medial", time=slice(1.25, 1.75))
    np.testing.assert_array_equal(joint.joint_velocity < -0.6, True)
    ratio = joint.joint_stiction / joint.joint_reaction
    np.testing.assert_allclose(ratio, -2.5e-4, rtol=0.02)


def test_drawn_tendons_lose_and_released_tendons_keep_tension(reversals):
    """Friction opposes the sliding: f below f^a where a tendon has been drawn in steadily, above where let out."""
    back, forth = reversals.sel(tendon="T3", time=slice(1.3, 1.7)), reversals.sel(tendon="T3", time=slice(2.4, 2.7))
    assert float(back.tendon_velocity.max()) < 0.0 < float(forth.tendon_velocity.min())
    assert float((back.tendon_tension - back.tendon_command).min()) > 0.0
    assert float((forth.tendon_tension - forth.tendon_command).max()) < 0.0


def test_the_distal_joint_follows_the_medial_one(settled):
    """Equation (4), within the stretch of the tendon: 7 N over 5e4 N/m and a radius of 5 mm."""
    coupled = 3.5 / 5.0 * settled.joint_position.sel(joint="medial")
    lag = abs(settled.joint_position.sel(joint="distal") - coupled)
    assert float(lag.max()) < 7.5 / 5e4 / 5e-3 * 1.05
