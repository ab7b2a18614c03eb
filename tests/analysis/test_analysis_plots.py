"""Figures of the analyses show the numbers that the analyses return."""

from dataclasses import replace

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import critical_friction, force_polytope, self_locking_map, tension_for_force
from finger_pin.views.plots.statics import (
    plot_critical_friction,
    plot_force_polytope,
    plot_radius_sensitivity,
    plot_runaway,
    plot_self_locking_map,
)

pytestmark = pytest.mark.usefixtures("coarse_sections")

POSTURE = (0.1, 0.5, 0.6, 0.42)


def test_bars_are_the_critical_coefficients(ub):
    axes = plot_critical_friction(ub).axes[0]
    widths = [bar.get_width() for bar in axes.patches]
    assert widths[-1] == pytest.approx(1e3 * critical_friction(ub).coefficient)
    assert [label.get_text() for label in axes.get_yticklabels()] == [*ub.joints, "all joints"]


@pytest.mark.parametrize("coefficient, panels", [(3.5e-4, 2), (7.6e-4, 1)])
def test_map_says_in_a_line_what_is_the_same_at_every_posture_and_where_it_is_locked(coefficient, panels):
    overrides = {f"finger.joint_friction.{name}": coefficient for name in ("coulomb", "stiction")}
    found = self_locking_map(fp.Finger(fp.load_finger("ub_stand_in", overrides)), samples=3)
    figure = plot_self_locking_map(found)
    said = f"critical coefficient {1e3 * found.coefficient[0, 0]:.3g} mm at every posture"
    assert figure.get_suptitle() == f"{said}; the finger has {1e3 * coefficient:.3g} mm"
    # The tension has its map and its colour bar, or a word instead of both; there is no panel without content.
    assert len(figure.axes) == panels
    assert (panels == 1) == any("locked everywhere" in text.get_text() for text in figure.axes[0].texts)


def test_a_map_of_a_finger_that_nothing_locks_says_so(finger):
    found = replace(self_locking_map(finger, samples=3), coefficient=np.full((3, 3), np.inf))
    assert plot_self_locking_map(found).get_suptitle().startswith("no joint friction locks it; the finger has 0.35 mm")


@pytest.mark.slow
def test_runs_are_drawn_with_their_largest_tension():
    run = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.05}))
    top, bottom = plot_runaway({"reversals": run}).axes
    np.testing.assert_allclose(top.lines[0].get_ydata(), run["tendon_command"].max("tendon"))
    np.testing.assert_allclose(bottom.lines[0].get_ydata(), np.rad2deg(np.abs(run["tracking_error"]).max("joint")))


@pytest.mark.slow
def test_section_lies_in_the_polytope_and_friction_orders_it(finger):
    figure = plot_force_polytope(finger, POSTURE, 10.0)
    polytope, plane = force_polytope(finger, POSTURE, 10.0), figure.axes[-1]
    helping, none, hindering = (np.array(line.get_xydata()) for line in plane.lines[:3])
    assert all(polytope.contains([x, 0.0, z], 1e-5) for x, z in none)
    assert np.all(np.linalg.norm(helping, axis=1) >= np.linalg.norm(none, axis=1))
    # What hinders jumps where a joint's torque changes sign; it never exceeds what holds.
    assert np.all(np.linalg.norm(hindering, axis=1) <= np.linalg.norm(helping, axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("name, position", [("planar", [0.4, 0.9]), ("ub_stand_in", [0.0, 0.0, 0.0, 0.0])])
def test_sets_that_are_flat_in_space_are_drawn_by_their_section(name, position):
    assert plot_force_polytope(fp.Finger(fp.load_finger(name)), position, 10.0).axes[-1].lines


@pytest.mark.slow
def test_sensitivity_bars_are_the_derivatives_per_millimetre(finger):
    force = [0.3, 0.2, 0.8]
    bars = [bar.get_width() for bar in plot_radius_sensitivity(finger, POSTURE, force).axes[0].patches]
    assert bars[0] == pytest.approx(1e-3 * tension_for_force(finger, POSTURE, force).by_radius[0, 0])
    assert "(0.3, 0.2, 0.8) N" in plot_radius_sensitivity(finger, POSTURE, force).axes[0].get_title("left")


def test_a_map_over_one_joint_is_a_curve_and_a_row_of_the_map_over_two(finger):
    both = self_locking_map(finger, ("proximal", "medial"), samples=3)
    alone = self_locking_map(finger, ("medial",), samples=3)
    np.testing.assert_allclose(alone.tension, both.tension[0])
    axes = plot_self_locking_map(alone).axes[0]
    np.testing.assert_allclose(axes.lines[0].get_ydata(), alone.tension)
    with pytest.raises(fp.InputError, match="two different"):
        self_locking_map(finger, ("medial", "medial"))
