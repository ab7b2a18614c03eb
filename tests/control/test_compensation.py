"""Compensations against the finger that they compensate: what is cancelled is gone, no more and no less."""

import math
from dataclasses import replace

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.proportional import ProportionalController
from finger_pin.exceptions import InputError
from finger_pin.references.reference import ReferenceSignals

WISH = 4.0
#: Only the passive tendon's minimum counts, so that it is planned to carry exactly what (20) makes it carry.
CONSISTENT = {
    "controller.minimum_tension": [0.0, 0.0, 0.0, 0.0, WISH],
    "controller.passive_tension": WISH,
    "controller.gravity_compensation": True,
}
FRICTIONLESS = {
    "finger.tendon_friction.coulomb": 0.0,
    "finger.joint_friction.coulomb": 0.0,
    "finger.joint_friction.stiction": 0.0,
}
FEEDFORWARD = {"controller.tendon_friction_feedforward.share": 1.0}
JOINTS = {"controller.joint_friction_compensation.share": 1.0}
#: So sharp that away from reversals the direction is 1 to rounding.
SHARP = {
    "controller.tendon_friction_feedforward.reversal_speed": 1e-6,
    "controller.joint_friction_compensation.reversal_speed": 1e-4,
}


def reversals(*overrides):
    merged = {}
    for each in overrides:
        merged |= each
    return fp.load_scenario("reversals", merged)


def postures(count, seed):
    """Postures that satisfy (20) for the wish, and velocities that satisfy its derivative."""
    random = np.random.default_rng(seed)
    position, velocity = np.zeros((2, count, 4))
    position[:, :3] = random.uniform([-0.1, 0.3, 0.4], [0.1, 1.0, 1.0], (count, 3))
    # No tendon stands still: joint 1 is slower than joint 2, and 1.7 times joint 3 faster.
    speeds = random.uniform([0.2, 0.8, 1.0], [0.5, 1.5, 1.5], (count, 3))
    velocity[:, :3] = speeds * random.choice([-1.0, 1.0], (count, 3))
    position[:, 3] = (3.5e-3 * position[:, 2] - WISH / 5e4) / 5e-3
    velocity[:, 3] = 0.7 * velocity[:, 2]
    return position, velocity


def still(position):
    return ReferenceSignals(position, np.zeros_like(position))


def test_gravity_compensation_holds_a_frictionless_finger_exactly_at_its_reference():
    """At rest on the reference nothing accelerates; without the compensation it falls with - M^-1 G."""
    for settings in ({}, {"controller.gravity_compensation": False}):
        scenario = reversals(CONSISTENT, FRICTIONLESS, settings)
        finger = fp.Finger(scenario.finger)
        controller = fp.control.build_controller(scenario, finger)
        for position in postures(5, 1)[0]:
            command = controller.command(0.0, still(position), position, np.zeros(4)).tension[:4]
            found = finger.evaluate(finger.rest_state(position), command)["joint_acceleration"]
            body = finger.rigid_body
            falls = np.linalg.solve(body.mass_matrix(position), -body.gravity_torque(position))
            np.testing.assert_allclose(found, falls if settings else 0.0, rtol=1e-8, atol=1e-6)


def test_a_frictionless_finger_settles_on_its_reference_without_a_steady_error():
    """Viscous friction brings it there, from the drop that a weak start makes.

    What law (9) keeps is its floor: 1e-4 N on two tendons at 8 mm, 1.6e-6 N m over K_P = 1 N m/rad.
    """
    viscous = {"finger.joint_friction.viscous": 0.01, "simulation.duration": 1.2, "simulation.sample_rate": 100.0}
    still_reference = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal", "medial")}
    offset = {"reference.joints.medial.offset": 0.7, "controller.sampling.period": 2e-3}
    scenario = reversals(CONSISTENT, FRICTIONLESS, viscous, still_reference, offset)

    class Late:
        controller = fp.control.build_controller(scenario)

        def command(self, time, reference, position, velocity):
            slack = 0.5 if time < 0.1 else 1.0
            signals = self.controller.command(time, reference, position, velocity)
            return replace(signals, tension=slack * signals.tension)

    error = fp.simulate(scenario, controller=Late()).tracking_error
    assert float(abs(error).max()) > 3e-3
    assert float(abs(error[-1]).max()) < 2e-6


def test_damping_is_a_torque_against_the_error_of_velocity():
    scenario = reversals({"controller.damping": [0.1, 0.2, 0.3, 0.4], "controller.gain": 2.0})
    controller = fp.control.build_controller(scenario)
    reference = ReferenceSignals(np.array([0.1, 0.5, 0.5, 0.3]), np.array([1.0, 0.0, -1.0, 0.5]))
    signals = controller.command(0.0, reference, np.array([0.0, 0.5, 0.6, 0.3]), np.array([0.5, 0.5, -1.0, 1.5]))
    np.testing.assert_allclose(signals.torque, [0.2 + 0.05, -0.1, -0.2, -0.4], rtol=1e-12)


def test_a_controller_without_additions_or_with_all_shares_zero_is_the_paper_s():
    scenario = reversals()
    paper = fp.control.build_controller(scenario)
    assert type(paper) is ProportionalController
    shares = {"controller.tendon_friction_feedforward.share": 0.0, "controller.joint_friction_compensation.share": 0.0}
    nothing = fp.control.build_controller(reversals(shares))
    position, velocity = postures(20, 2)
    reference = ReferenceSignals(position + 0.03, velocity)
    given, expected = (each.command(0.0, reference, position, velocity) for each in (nothing, paper))
    np.testing.assert_allclose(given.tension, expected.tension, rtol=1e-12)
    np.testing.assert_allclose(given.torque, expected.torque, rtol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_tendon_feedforward_without_stribeck_and_viscous_parts_is_the_capstan_law_upside_down(sign):
    """f^a = f exp(mu_e phi) when pulling, f exp(-mu_e phi) when releasing; phi of T1 is 1.0 + |theta1|."""
    plain = {"finger.tendon_friction.stiction_ratio": 1.0, "finger.tendon_friction.viscous": 0.0}
    controller = fp.control.build_controller(reversals(FEEDFORWARD, SHARP, plain))
    position = np.array([0.1, 0.5, 0.6, 0.4])
    velocity = sign * np.array([0.0, 1.0, 0.0, 0.0])
    planned = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    command = controller.tendons.command(planned, position, velocity)
    grips = [1.1, 1.1, None, 0.51 + 0.5 + 0.6, None]
    for index, direction_of_tendon in ((0, sign), (1, sign), (3, -sign)):
        expected = planned[index] * math.exp(direction_of_tendon * 0.11 * grips[index])
        assert command[index] == pytest.approx(expected, rel=1e-9)
    # T3 does not move with joint 2, and T5 has no command.
    assert command[2] == planned[2] and command[4] == planned[4]


@pytest.mark.slow
def test_a_steadily_sliding_tendon_delivers_exactly_what_was_planned():
    """The finger's own law (9), integrated at constant velocity until its bristles have settled, is the judge."""
    scenario = reversals(FEEDFORWARD, SHARP)
    finger = fp.Finger(scenario.finger)
    feedforward = fp.control.build_controller(scenario, finger).tendons
    planned = np.array([1.0, 2.5, 3.0, 4.0, 5.0])
    positions, velocities = postures(4, 3)
    command = np.stack([feedforward.command(planned, *each) for each in zip(positions, velocities, strict=True)])
    x = np.stack([finger.rest_state(position) for position in positions])
    state = finger.layout.unpack(x)
    state.velocity[:] = velocities
    for _ in range(2000):
        forces = finger.evaluate(x, command[:, :4])
        state.tendon_stiction[:] += 5e-5 * forces.at_first_place("rate")
    np.testing.assert_allclose(forces.strands[:, :4], np.tile(planned[:4], (4, 1)), rtol=1e-7)


def settled_states(finger, position, velocity, command, halves):
    """The finger in mid-motion with all friction settled, and its passive tendon with given tensions of its halves."""
    state = finger.layout.unpack(np.stack([finger.rest_state(each) for each in position]))
    passive = 3.5e-3 * position[:, 2] - halves[0] / 1e5
    np.testing.assert_allclose(1e5 * (passive - 5e-3 * position[:, 3]), halves[1], rtol=1e-9)
    speed = 0.5 * (3.5e-3 * velocity[:, 2] + 5e-3 * velocity[:, 3])
    state = replace(state, velocity=velocity, passive_position=passive[:, None], passive_velocity=speed[:, None])
    for _ in range(2000):
        rate = finger.layout.unpack(finger.evaluate(finger.layout.pack(state), command).rate)
        state = replace(
            state,
            tendon_stiction=state.tendon_stiction + 5e-5 * rate.tendon_stiction,
            joint_stiction=state.joint_stiction + 1e-4 * rate.joint_stiction,
        )
    return finger.layout.pack(state)


@pytest.mark.slow
def test_with_all_compensations_a_sliding_finger_moves_as_if_it_had_no_friction():
    """On the reference at the desired velocity, with every bristle settled: theta'' = - M^-1 C theta', and p5'' = 0."""
    scenario = reversals(CONSISTENT, FEEDFORWARD, JOINTS, SHARP)
    finger = fp.Finger(scenario.finger)
    controller = fp.control.build_controller(scenario, finger)
    position, velocity = postures(3, 4)
    command = controller.command(0.0, ReferenceSignals(position, velocity), position, velocity).tension
    np.testing.assert_allclose(command[:, 4], WISH, rtol=1e-9)
    speed = 0.5 * (3.5e-3 + 0.7 * 5e-3) * velocity[:, 2]
    level = math.tanh(0.5 * 0.11 * 0.58) * (1.0 + 0.5 * np.exp(-abs(speed) / 0.01)) * np.sign(speed)
    x = settled_states(finger, position, velocity, command[:, :4], (WISH * (1 + level), WISH * (1 - level)))
    signals = finger.evaluate(x, command[:, :4])
    for i, torque in enumerate(signals["joint_torque"]):
        drift = finger.rigid_body.coriolis_matrix(position[i], velocity[i]) @ velocity[i]
        driven = finger.rigid_body.mass_matrix(position[i]) @ signals["joint_acceleration"][i]
        np.testing.assert_allclose(driven, -drift, atol=1e-7 * abs(torque).max())
    # The viscous part of T5's friction is no part of the capstan balance of its halves.
    np.testing.assert_allclose(8.8e-6 * signals.mechanism.acceleration[:, 4], -1.0 * speed, atol=1e-6)


def test_believed_coefficients_are_compensated_instead_of_the_finger_s():
    actual = fp.control.build_controller(reversals(FEEDFORWARD, JOINTS))
    believed = fp.control.build_controller(
        reversals(
            {"controller.tendon_friction_feedforward.coulomb": 0.2},
            {"controller.joint_friction_compensation.coulomb": [1e-4, 2e-4, 3e-4, 4e-4]},
        )
    )
    np.testing.assert_array_equal(believed.tendons.surface, 0.2)
    np.testing.assert_array_equal(actual.tendons.surface, 0.11)
    np.testing.assert_array_equal(believed.joints.kinetic, [1e-4, 2e-4, 3e-4, 4e-4])
    # Nothing slides more easily than it starts: a belief in M^d raises that in M^c where it has to.
    np.testing.assert_array_equal(believed.joints.static, [3.5e-4, 3.5e-4, 3.5e-4, 4e-4])


def test_a_drag_of_the_joints_is_compensated_in_the_direction_of_the_desired_motion():
    """Far above the Stribeck speed, tensions exert it besides: to one part in exp(-v / omega)."""
    position, velocity = postures(8, 3)
    velocity *= 10.0
    drag = {"finger.joint_friction.drag": 4e-3, "finger.joint_friction.drag_asymmetry": 0.25}
    wanted = ReferenceSignals(position, velocity)
    torques = [
        fp.control.build_controller(reversals(FRICTIONLESS, JOINTS, SHARP, more)).command(
            0.0, wanted, position, velocity
        )
        for more in ({}, drag)
    ]
    np.testing.assert_allclose(torques[1].torque - torques[0].torque, 4e-3 * np.sign(velocity) + 1e-3, rtol=1e-6)


def test_the_loop_of_friction_and_tension_closes_up_to_the_critical_coefficient():
    """At 97 % of it, tensions of many times those without friction still satisfy their balance, by (17) by hand."""
    critical = fp.analysis.critical_friction(fp.load_finger("ub_stand_in")).coefficient
    coefficient = 0.97 * critical
    key = "controller.joint_friction_compensation"
    scenario = reversals(
        {f"{key}.coulomb": coefficient, f"{key}.stiction": coefficient, f"{key}.viscous": 0.0},
        {f"{key}.reversal_speed": 1e-4},
    )
    controller = fp.control.build_controller(scenario)
    position = np.array([0.05, 0.5, 0.6, 0.4])
    worst = 0.0
    for signs in np.array(np.meshgrid(*4 * [[-1.0, 1.0]])).reshape(4, -1).T:
        reference = ReferenceSignals(position + 0.01, signs)
        signals = controller.command(0.0, reference, position, signs)
        f1, f2, f3, f4, f5 = signals.tension
        load = np.array([f1 + f2 + f3 + f4, f1 + f2 + f3 + f4, f3 + f4 + f5, f4 + f5])
        torque = controller.routing.coupling.T @ signals.tension
        np.testing.assert_allclose(torque - coefficient * signs * load, 0.01, atol=1e-7)
        worst = max(worst, f1 + f2 + f3 + f4)
    assert worst > 60.0


@pytest.mark.parametrize("entry", ["stiction", "share"])
def test_compensating_more_joint_friction_than_locks_the_finger_is_refused(entry):
    value = {"stiction": 8e-4, "share": 2.0}[entry]
    with pytest.raises(InputError, match="self-locking") as caught:
        fp.control.build_controller(
            reversals(
                {f"controller.joint_friction_compensation.{entry}": value, "finger.joint_friction.stiction": 4e-4}
            )
        )
    assert caught.value.entry == "controller.joint_friction_compensation"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("finger", ["planar", "dexmart_index"])
def test_commands_of_a_batch_are_those_of_each_row_for_other_fingers_too(finger, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(
        f'finger = "{finger}"\n[controller]\ngravity_compensation = true\ndamping = 0.01\n'
        "[controller.tendon_friction_feedforward]\n[controller.joint_friction_compensation]\n"
        "[controller.distribution]\nmaximum_tension = 50.0\n"
    )
    scenario = fp.load_scenario(path)
    controller = fp.control.build_controller(scenario)
    random, size = np.random.default_rng(6), len(scenario.finger.joints)
    position, velocity, error = random.uniform(0.1, 0.4, (3, 7, size))
    batch = controller.command(0.0, ReferenceSignals(position + 0.1 * error, velocity), position, -velocity)
    for index in range(7):
        reference = ReferenceSignals(position[index] + 0.1 * error[index], velocity[index])
        single = controller.command(0.0, reference, position[index], -velocity[index])
        np.testing.assert_allclose(batch.tension[index], single.tension, rtol=1e-6)
        np.testing.assert_allclose(batch.torque[index], single.torque, rtol=1e-6)


@pytest.mark.slow
def test_a_continuous_compensated_controller_is_what_a_finely_sampled_one_converges_to():
    overrides = {"simulation.duration": 0.05, "finger.joint_friction.viscous": 0.02}
    continuous = fp.simulate(reversals(CONSISTENT, FEEDFORWARD, JOINTS, overrides))
    assert continuous.attrs["method"] == "Radau"
    gaps = []
    for period in (1e-3, 2.5e-4):
        sampled = fp.simulate(
            reversals(CONSISTENT, FEEDFORWARD, JOINTS, overrides, {"controller.sampling.period": period})
        )
        assert sampled.attrs["method"] == "Rodas5P"
        gaps.append(float(abs(sampled.joint_position - continuous.joint_position).max()))
    assert gaps[0] < 1e-4
    assert 3.0 < gaps[0] / gaps[1] < 5.5


def test_the_closed_loop_uses_the_scenario_s_whole_controller():
    loop = ClosedLoop.from_scenario(reversals(FEEDFORWARD))
    assert isinstance(loop.controller, fp.control.CompensatedController) and loop.controller.tendons is not None
