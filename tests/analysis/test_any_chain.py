"""Random fingers of one to seven joints through every public function of analysis, figures and viewer."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from paper.joint_reactions import joint_reactions
from paper.plot_workspace import plot_workspace
from paper.transmission import transmission_efficiency, transmission_in_motion

import finger_pin as fp
from finger_pin.analysis import (
    Friction,
    critical_friction,
    force_polytope,
    largest_force,
    self_locking_map,
    self_locking_margin,
    tension_for_force,
)
from finger_pin.simulation.frames import scene_metadata
from finger_pin.views import plots
from finger_pin.views.viewer.animation import animation_page, posture_page

FEW = settings(derandomize=True, database=None, deadline=None, max_examples=12, phases=(Phase.generate,))
LIMIT = 50.0
AT_JOINTS = ("joint_velocity", "joint_acceleration", "tracking_error", "joint_torque", "joint_torque_command",
             "joint_friction")  # fmt: skip
AT_TENDONS = ("tendon_command", "tendon_tension", "tendon_velocity", "tendon_normal_force", "tendon_curvature")


@st.composite
def fingers(draw, joints=None):
    """A chain in which tendon i pulls joints 1 to i and one more pulls back at all of them: force closure."""
    count = draw(st.integers(1, 7)) if joints is None else joints
    number = np.random.default_rng(draw(st.integers(0, 10**6)))
    names = [f"joint_{index}" for index in range(count)]
    chain = {}
    for name in names:
        twist = float(number.choice([0.0, 0.0, np.pi / 2]))
        link = {"length": number.uniform(0.02, 0.05), "width": 0.015, "mass": 5e-3, "twist": twist}
        chain[name] = {"range": [-0.2, 1.4], "link": link}
    tendons = {
        f"T{index}": {"crossings": {name: {"radius": number.uniform(4e-3, 9e-3)} for name in names[: index + 1]}}
        for index in range(count)
    }
    # Minus a positive combination of the others balances them; it may have to pass on the wrong side of no joint.
    weights = number.uniform(0.5, 1.0, count)
    rows = np.array([[t["crossings"].get(name, {"radius": 0.0})["radius"] for name in names] for t in tendons.values()])
    tendons["back"] = {"crossings": dict(zip(names, ({"radius": -r} for r in weights @ rows / count), strict=True))}
    return fp.FingerDescription.model_validate({"name": "chain", "joints": chain, "tendons": tendons})


def some_forces(polytope, number):
    """Directions in which joints can move the fingertip."""
    return number.normal(size=(5, polytope.basis.shape[1])) @ polytope.basis.T


@pytest.mark.slow
@FEW
@given(fingers(), st.integers(0, 10**6))
def test_forces_of_any_finger_agree_with_each_other(description, seed):
    """A set, the way to its boundary, and the tension that a force on the boundary needs: three programmes."""
    finger, number = fp.Finger(description), np.random.default_rng(seed)
    position = number.uniform(0.1, 1.0, len(description.joints))
    jacobian = finger.rigid_body.jacobian(position)
    assert jacobian.shape == (3, len(position))
    for friction in (Friction.NONE, Friction.HELPING):
        polytope = force_polytope(finger, position, LIMIT, friction=friction)
        rank = np.linalg.matrix_rank(jacobian, tol=1e-6 * np.linalg.norm(jacobian))
        assert polytope.basis.shape == (3, rank) and polytope.faces.shape[1] == rank
        assert len(polytope.triangles()) == 0 or rank > 1
        for direction in some_forces(polytope, number):
            reach = largest_force(finger, position, direction, LIMIT, friction=friction)
            end = reach * direction / np.linalg.norm(direction)
            assert polytope.contains(end, 1e-4) and not polytope.contains(1.01 * end, 0.0)
            assert tension_for_force(finger, position, end, friction=friction).largest == pytest.approx(LIMIT, rel=1e-4)
    for direction in some_forces(polytope, number):
        pushed = largest_force(finger, position, direction, LIMIT, friction=Friction.HINDERING)
        # A long chain under its weight may be unable to push at all.
        if pushed > 0.0:
            end = pushed * direction / np.linalg.norm(direction)
            needed = tension_for_force(finger, position, end, friction=Friction.HINDERING)
            assert needed.largest <= LIMIT * (1.0 + 1e-4)


def bending(description):
    """A scenario in which all joints swing alike."""
    swing = {name: {"offset": 0.5, "amplitude": 0.3, "frequency": 0.5} for name in description.joints}
    entries = {"name": "any", "finger": description, "reference": {"joints": swing}}
    return fp.Scenario.model_validate(entries | {"simulation": {"duration": 1.0}})


def still(finger, samples=3):
    """A result's Dataset of a finger that bends slowly, with made-up forces."""
    count, tendons = len(finger.routing.joints), len(finger.routing.tendons)
    position = np.linspace(0.1, 0.5, samples)[:, None] * np.ones(count)
    at_joints = dict.fromkeys(AT_JOINTS, (("time", "joint"), 0.0 * position))
    at_tendons = dict.fromkeys(AT_TENDONS, (("time", "tendon"), np.ones((samples, tendons))))
    angles = dict.fromkeys(("joint_position", "joint_reference"), (("time", "joint"), position))
    places = {"time": 0.1 * np.arange(samples), "joint": list(finger.routing.joints)}
    return xr.Dataset(
        {**at_joints, **at_tendons, **angles, "fingertip_force": (("time", "axis"), np.zeros((samples, 3)))},
        {**places, "tendon": list(finger.routing.tendons)},
        scene_metadata(bending(finger.description)),
    )


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_sections")
@pytest.mark.parametrize("joints", [1, 4])
@settings(FEW, max_examples=1)
@given(data=st.data())
def test_every_figure_and_page_of_any_finger_can_be_drawn(joints, data):
    description = data.draw(fingers(joints))
    finger = fp.Finger(description)
    position = np.full(joints, 0.4)
    polytope = force_polytope(finger, position, LIMIT)
    force = 0.01 * polytope.vertices[0]
    result = still(finger)
    figures = [
        plot_workspace(finger),
        plots.plot_force_polytope(finger, position, LIMIT),
        plots.plot_radius_sensitivity(finger, position, force),
        plots.plot_critical_friction(description),
        plots.plot_self_locking_map(self_locking_map(finger, samples=3)),
        plots.plot_fig6(result),
        plots.plot_losses(result),
        plots.plot_runaway({"still": result}),
    ]
    for figure in figures:
        figure.canvas.draw()
        assert figure.axes
    assert "finger_pin" in animation_page(result, polytope)
    assert "finger_pin" in posture_page(description, polytope, tension_for_force(finger, position, force).strands)


@pytest.mark.slow
@FEW
@given(fingers())
def test_statics_of_any_finger_are_finite_and_of_the_documented_shapes(description):
    finger, count = fp.Finger(description), len(description.joints)
    result = still(finger)
    if count < 5:
        # Directions of motion are as many as three to the power of the joints.
        found = self_locking_map(finger, samples=2)
        assert found.tension.shape == (2,) * min(count, 2) and found.tip.shape == (*found.tension.shape, 3)
        margin = self_locking_margin(bending(description), samples=20)
        assert margin.position.shape == (count,) and margin.margin > 0.0
        assert critical_friction(finger).coefficient >= critical_friction(finger, np.full(count, 0.4)).coefficient > 0.0
    load, position = np.array([0.1, -0.2, 0.3]), np.full(count, 0.4)
    pushed = finger.evaluate(finger.rest_state(position), np.ones(count + 1), load)
    # J^T F, (6), by differences of the fingertip's place.
    tip = finger.rigid_body.tip_position
    turned = [load @ (tip(position + each) - tip(position - each)) / 2e-6 for each in 1e-6 * np.eye(count)]
    np.testing.assert_allclose(pushed["external_torque"], turned, atol=1e-9)
    assert pushed.rate.shape == (finger.layout.size,)
    reactions = joint_reactions(result)
    assert reactions.full.shape == (3, count) and np.isfinite(reactions.full).all()
    assert np.isfinite(transmission_efficiency(finger, np.full(count, 0.4)).pulling).all()
    assert transmission_in_motion(finger, result).ratio.shape == (3, count + 1)


def test_findings_print_large_arrays_by_shape_and_range(finger):
    text = repr(self_locking_map(finger, samples=3))
    assert "joints: ('proximal', 'medial')" in text and "tip: shape (3, 3, 3), " in text
    assert len(text.splitlines()) == 7 and max(map(len, text.splitlines())) < 120
    assert "abduction, proximal, medial, distal" in repr(finger)
