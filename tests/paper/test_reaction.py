"""The pins' whole reaction: against a pendulum by hand, the moment balance, and momentum by differences; and (17)."""

import csv

import numpy as np
import pinocchio as pin
import pytest
from paper.joint_reactions import fingertip_loads, joint_reactions
from paper.pin_wrench import pin_wrench
from paper.plot_reaction import plot_reaction
from paper.reaction import reaction
from paper.tendon_cuts import Groove, tendon_cuts

import finger_pin as fp
from finger_pin.commands.application import run_function
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.simulation.simulate import simulate

FORCE = np.array([0.4, -0.7, 0.5])
MASS, LENGTH, CENTRE, INERTIA, WEIGHT = 0.02, 0.05, 0.03, 6e-6, 9.81
RADII = np.array([0.006, 0.004, -0.005])


def pendulum():
    """One link on a hinge about z, weight along -y, pulled by three tendons at different radii and lanes."""
    link = {"length": LENGTH, "width": 0.012, "mass": MASS, "centre_of_mass": CENTRE, "transverse_inertia": INERTIA}
    tendons = {f"T{i}": {"crossings": {"hinge": {"radius": radius}}} for i, radius in enumerate(RADII)}
    table = {"name": "pendulum", "gravity": [0, -WEIGHT, 0], "joints": {"hinge": {"range": [-1, 1], "link": link}}}
    return fp.Finger(fp.FingerDescription.model_validate(table | {"tendons": tendons}))


def states(finger, count=20, seed=3):
    """Random postures within the ranges, velocities, accelerations and strand tensions."""
    draw, size = np.random.default_rng(seed), len(finger.routing.joints)
    posture = draw.uniform(finger.stroke_limiter.lower, finger.stroke_limiter.upper, (count, size))
    strands = draw.uniform(0.0, 9.0, (count, len(finger.strand_coupling)))
    return posture, draw.normal(0.0, 4.0, (count, size)), draw.normal(0.0, 60.0, (count, size)), strands


def test_the_pin_of_a_swinging_pendulum_bears_weight_centripetal_force_and_tendons():
    """By hand: m (a - g) + sum f along x - F, with a of the mass centre; and the moment balance of the link."""
    finger = pendulum()
    lanes = np.array([arc.lane for _, arc in TendonGeometry(finger.description).arcs])
    assert np.ptp(lanes) > 1e-3
    position, velocity, acceleration, strands = states(finger)
    found = pin_wrench(finger, position, velocity, acceleration, strands, FORCE)
    rows = zip(position[:, 0], velocity[:, 0], acceleration[:, 0], strands, strict=True)
    for k, (q, w, a, f) in enumerate(rows):
        c, s = np.cos(q), np.sin(q)
        px = MASS * CENTRE * (-w * w * c - a * s) + f.sum() - FORCE[0]
        py = MASS * (CENTRE * (-w * w * s + a * c) + WEIGHT) - FORCE[1]
        np.testing.assert_allclose(found.force[k, 0], [px, py, -FORCE[2]], rtol=1e-11)
        moment = (INERTIA + MASS * CENTRE**2) * a + MASS * WEIGHT * CENTRE * c
        moment -= LENGTH * (c * FORCE[1] - s * FORCE[0]) + RADII @ f
        across = [-LENGTH * s * FORCE[2], LENGTH * c * FORCE[2] + lanes @ f]
        np.testing.assert_allclose(found.moment[k, 0], [*across, moment], rtol=1e-9)


@pytest.mark.parametrize("groove", Groove)
@pytest.mark.parametrize("name", ["ub_stand_in", "planar", "dexmart_index"])
def test_points_and_directions_of_the_cut_tendons_give_the_torque_of_h_c2_at_any_posture(name, groove):
    """Tendons alone: their moment about each axis is -H_c2^T f on either side of the grooves, by virtual work."""
    finger = fp.Finger(fp.load_finger(name, {"finger.gravity": [0.0, 0.0, 0.0]}))
    position, _, _, strands = states(finger)
    still = np.zeros_like(position)
    found = pin_wrench(finger, position, still, still, strands, np.zeros(3), groove)
    about_axis = np.sum(found.moment * found.axis, axis=-1)
    np.testing.assert_allclose(about_axis, -strands @ finger.strand_coupling, atol=1e-15)


@pytest.mark.parametrize("groove", Groove)
def test_the_moment_about_the_axis_along_fig6_is_what_friction_and_limiters_take(reversals, finger, groove):
    """(18): of all forces together only the couples of joint friction and stroke limiters are left for the pin."""
    names = ("joint_position", "joint_velocity", "joint_acceleration")
    part = reversals.isel(time=slice(None, None, 40))
    strands = np.column_stack(
        [part.tendon_tension.values[:, :4], part.passive_tension_proximal.values, part.tendon_tension.values[:, 4]]
    )
    found = pin_wrench(finger, *(part[name].values for name in names), strands, np.zeros(3), groove)
    about_axis = np.sum(found.moment * found.axis, axis=-1)
    np.testing.assert_allclose(about_axis, -(part.joint_friction + part.limiter_torque).values, atol=1e-12)
    assert np.all(np.abs(part.joint_friction.values).max(axis=0) > 1e-3)


def test_without_tendons_the_pin_changes_the_momentum_of_what_it_carries_and_bears_its_weight():
    """The acceleration of the carried mass centres by differences of positions; the weights from the description."""
    finger = fp.Finger(fp.load_finger("ub_stand_in"))
    position, velocity, acceleration, strands = states(finger)
    found = pin_wrench(finger, position, velocity, acceleration, 0.0 * strands, np.zeros(3))
    model, step = finger.rigid_body.model, 1e-4
    data = model.createData()
    masses = [joint.link.mass for joint in finger.description.joints.values()]
    carried = np.cumsum(masses[::-1])[::-1]
    for k, (q, v, a) in enumerate(zip(position, velocity, acceleration, strict=True)):
        places = []
        for t in (-step, 0.0, step):
            pin.centerOfMass(model, data, q + v * t + 0.5 * a * t * t)
            pin.forwardKinematics(model, data, q + v * t + 0.5 * a * t * t)
            places.append([data.oMi[j + 1].act(data.com[j + 1]) for j in range(4)])
        rate = (np.array(places[0]) - 2.0 * np.array(places[1]) + places[2]) / step**2
        np.testing.assert_allclose(found.inertia[k], carried[:, None] * rate, rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(found.carried[k], np.outer(carried, [0.0, 0.0, WEIGHT]), atol=1e-15)


def test_a_tendon_between_pulleys_pulls_along_their_common_tangent():
    """In `planar` the distal flexor runs from a radius of 2.0 to one of 5.5 mm, 45 mm apart, on the same side."""
    geometry = TendonGeometry(fp.load_finger("planar"))
    (cut,) = (each for each in tendon_cuts(geometry) if each.tendon == "flexor_distal" and each.joint == 2)
    tilt = np.arcsin((5.5 - 2.0) / 45.0)
    np.testing.assert_allclose(cut.direction, [np.cos(tilt), np.sin(tilt), 0.0], atol=1e-9)
    # On its pulley, across the direction: r to the left of it, seen along the path.
    np.testing.assert_allclose(cut.point[:2], [0.045 - 5.5e-3 * np.sin(tilt), 5.5e-3 * np.cos(tilt)], atol=1e-9)


def test_tendons_that_a_cut_crosses_are_those_that_load_the_joint_in_17(finger):
    crossed = np.zeros_like(finger.routing.loads)
    for cut in tendon_cuts(TendonGeometry(finger.description)):
        crossed[cut.joint - 1, finger.routing.strand(cut.tendon, distal=cut.distal)] += 1.0
    np.testing.assert_array_equal(crossed, finger.routing.loads)


def test_without_weight_and_inertia_and_with_tendons_parallel_to_the_links_the_full_reaction_is_17():
    """`planar` with every tendon on one radius all along; against R of the dynamics."""
    overrides = {f"finger.tendons.flexor_distal.crossings.{name}.radius": 0.0055 for name in ("proximal", "distal")}
    overrides |= {f"finger.tendons.extensor.crossings.{name}.radius": 0.004 for name in ("proximal", "distal")}
    finger = fp.Finger(fp.load_finger("planar", overrides | {"finger.gravity": [0.0, 0.0, 0.0]}))
    position, _, _, strands = states(finger)
    still = np.zeros_like(position)
    found = pin_wrench(finger, position, still, still, strands, FORCE)
    x = np.array([finger.rest_state(theta) for theta in position])
    expected = finger.evaluate(x, strands, FORCE)["joint_reaction"]
    np.testing.assert_allclose(np.linalg.norm(found.force, axis=-1), expected, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.paper + found.external, axis=-1), expected, rtol=1e-12)


@pytest.fixture(scope="module")
def along_fig6(reversals):
    return joint_reactions(reversals.isel(time=slice(None, None, 10)))


def test_17_is_recomputed_as_the_simulation_had_it(reversals, along_fig6):
    np.testing.assert_allclose(along_fig6.paper, reversals.joint_reaction.values[::10], rtol=1e-12)


def test_parts_are_what_they_say_and_no_two_of_them_are_alike(along_fig6):
    """Without an external force and with all tendons along x of the base, the abduction joint feels no direction."""
    np.testing.assert_allclose(along_fig6.direction[:, 0], along_fig6.paper[:, 0], rtol=1e-12)
    for part in ("direction", "weight", "inertia", "static", "full", "other_groove"):
        assert np.abs(getattr(along_fig6, part) - along_fig6.paper)[:, 1:].max() > 1e-3


def test_on_fig6_17_is_within_four_percent_of_the_full_quasi_static_reaction(along_fig6):
    for each in along_fig6.differences():
        assert abs(each.static.mean) < 0.02 and each.static.largest < 0.04
        assert each.friction[1] < 1e-4


@pytest.mark.parametrize("missing", ["joint_acceleration", "passive_tension_proximal"])
def test_a_result_that_lacks_needed_variables_is_refused(reversals, missing):
    with pytest.raises(fp.InputError, match=missing):
        joint_reactions(reversals.isel(time=slice(0, 2)).drop_vars(missing))


def test_a_result_without_its_finger_is_refused(reversals):
    with pytest.raises(fp.InputError, match="finger"):
        joint_reactions(reversals.isel(time=slice(0, 2)).drop_attrs())


def test_fingertip_loads_are_both_ways_along_every_axis():
    loads = np.array(list(fingertip_loads([0.5, 2.0]).values()))
    np.testing.assert_allclose(np.linalg.norm(loads, axis=1), [0.5, 2.0] * 6)
    np.testing.assert_allclose(loads.sum(axis=0), 0.0)
    assert len(np.unique(loads, axis=0)) == 12


def test_the_figure_draws_the_reactions_and_their_differences(along_fig6):
    for loaded, columns in (({}, 2), ({"+x 1 N": along_fig6}, 3)):
        figure = plot_reaction(along_fig6, loaded)
        assert len(figure.axes) == 4 * columns
        np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), along_fig6.paper[:, 0])
        share = 100.0 * (along_fig6.static - along_fig6.paper)[:, 5 % 4] / along_fig6.paper[:, 1].mean()
        np.testing.assert_allclose(figure.axes[5].lines[1].get_ydata(), share)


@pytest.mark.slow
def test_the_command_writes_a_row_per_joint_and_force_and_a_figure(tmp_path, capsys):
    settings = ["--set", "simulation.duration=0.02", "--forces", "1", "--output", str(tmp_path)]
    assert run_function(reaction, settings) == 0
    assert {each.name for each in tmp_path.iterdir()} == {"reaction.csv", "reaction.png"}
    with open(tmp_path / "reaction.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 7
    run = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.02}))
    given = [row for row in rows if row["fingertip force"] == "as it is"]
    means = [float(row["mean (17), N"]) for row in given]
    np.testing.assert_allclose(means, run.joint_reaction.mean("time"), rtol=1e-5)
    assert "worst of 6" in " ".join(capsys.readouterr().out.split())


def test_the_command_tells_wrong_input_in_one_line_and_writes_nothing(tmp_path, capsys):
    target = tmp_path / "out"
    assert run_function(reaction, ["fig7", "--output", str(target)]) == 2
    assert run_function(reaction, ["--set", "controller.gian=2", "--output", str(target)]) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 2 and "reversals" in error[0] and "controller.gain" in error[1]
    assert not target.exists()


def test_a_folder_that_cannot_be_made_is_told_after_the_first_motion(tmp_path, capsys, monkeypatch):
    (tmp_path / "file").write_text("")
    made = []
    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", lambda given: made.append(given) or simulate(given))
    settings = ["--set", "simulation.duration=0.02", "--output", str(tmp_path / "file" / "out")]
    assert run_function(reaction, settings) == 1
    assert "cannot be written" in capsys.readouterr().err and len(made) == 1
