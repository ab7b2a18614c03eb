"""The loop around the passive tendon's tension: its law by hand, and what it makes of a finger."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import InputError
from finger_pin.references.reference import ReferenceSignals

LOOP = {"controller.passive_tension_loop.integral": 10.0, "controller.sampling.period": 1e-3}


def loop(**settings):
    overrides = {f"controller.passive_tension_loop.{key}": value for key, value in settings.items()}
    return fp.control.build_controller(
        fp.load_scenario(
            "reversals", {"controller.passive_tension": 5.0, "controller.sampling.period": 0.01} | overrides
        )
    )


def measured(tension):
    return {"tendon_tension": np.array([1.0, 1.0, 4.0, 3.0, tension])}


def planned(controller):
    position = np.array([0.0, 0.5, 0.6, 0.4])
    return controller.command(0.0, ReferenceSignals(position, np.zeros(4)), position, np.zeros(4)).tension


def test_the_correction_is_proportional_and_integral_by_hand():
    """E = 2, 1, -1 N at 0.1 s each: I = 0.8, 1.2, 0.8 N with k_I = 4 / s, and k_P e = 1, 0.5, -0.5 N."""
    controller = loop(proportional=0.5, integral=4.0)
    found = []
    for tension in (3.0, 4.0, 6.0):
        controller.sense(measured(tension), 0.1)
        found.append(float(controller.correction[0]))
    np.testing.assert_allclose(found, [1.8, 1.7, 0.3], rtol=1e-12)


def test_the_integral_stops_at_its_limit_and_leaves_it_at_once():
    controller = loop(integral=10.0, limit=0.7)
    for _ in range(50):
        controller.sense(measured(0.0), 0.1)
    assert controller.correction[0] == pytest.approx(0.7)
    controller.sense(measured(5.1), 0.1)
    assert controller.correction[0] == pytest.approx(0.6)


def test_the_integral_does_not_go_below_what_has_an_effect():
    """f0 of T5 is 1 N and the wish 5 N: less than -4 N would change nothing but the time to come back."""
    controller = loop(integral=10.0, limit=100.0)
    for _ in range(50):
        controller.sense(measured(9.0), 0.1)
    assert controller.correction[0] == pytest.approx(-4.0)


def test_the_wish_and_its_correction_are_what_is_planned_for_the_passive_tendon():
    """Without a torque all tensions are internal, in the ratio (1, 1, 4.32, 3.02, 3.20), here for 5 N and for 6 N."""
    controller = loop(proportional=0.5, integral=0.0)
    ratio = np.array([5.3 / 16, 5.3 / 16, (5.3 + 3.5 * 1.06) / 6.3, 1.0, 1.06])
    np.testing.assert_allclose(planned(controller), 5.0 * ratio / 1.06, rtol=1e-12)
    controller.sense(measured(3.0), 0.1)
    np.testing.assert_allclose(planned(controller), 6.0 * ratio / 1.06, rtol=1e-12)


def test_the_minimum_of_the_other_tendons_is_kept_where_the_wish_is_less():
    controller = fp.control.build_controller(fp.load_scenario("reversals", LOOP | {"controller.passive_tension": 0.5}))
    for _ in range(100):
        controller.sense(measured(3.0), 0.1)
    assert planned(controller).min() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_the_passive_loop_brings_the_delivered_tension_to_the_wish_despite_friction_and_other_minima():
    """The finger is held still against gravity: T5 comes to carry 5 N within 1 %; without the loop it does not."""
    motion = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal", "medial")}
    common = motion | {"controller.passive_tension": 5.0, "simulation.duration": 1.5, "simulation.sample_rate": 100.0}
    held = {
        name: fp.simulate(fp.load_scenario("reversals", common | settings)).tendon_tension.sel(tendon="T5")
        for name, settings in (("with", LOOP), ("without", {"controller.sampling.period": 1e-3}))
    }
    assert float(held["with"][-1]) == pytest.approx(5.0, rel=0.01)
    assert abs(float(held["without"][-1]) - 5.0) > 0.25


@pytest.mark.slow
def test_the_passive_loop_serves_a_custom_controller():
    """The example of the README, as it is told there: the simulator's tensions go in, the controller's come out."""
    scenario = fp.load_scenario("reversals", LOOP | {"controller.passive_tension": 4.0})
    finger = fp.Finger(scenario.finger)
    reference = ReferenceSignals(np.array([0.0, 0.5, 0.6, (3.5e-3 * 0.6 - 4.0 / 5e4) / 5e-3]), np.zeros(4))
    controller = fp.control.build_controller(scenario, finger)
    sim = fp.Simulator(finger, reference.position)
    state = sim.state
    for step in range(1000):
        command = controller.command(1e-3 * step, reference, state.position, state.velocity)
        state = sim.step(command.tension[:4], 1e-3)
        delivered = finger.routing.tendon_tension(sim.signals().strands)
        controller.sense({"tendon_tension": delivered}, 1e-3)
    tension = finger.routing.tendon_tension(sim.signals().strands)
    assert tension[4] == pytest.approx(4.0, rel=0.02)


def test_the_passive_loop_needs_a_sampled_controller():
    with pytest.raises(InputError) as caught:
        fp.load_scenario("reversals", {"controller.passive_tension_loop.integral": 1.0})
    assert caught.value.entry == "controller.passive_tension_loop" and "sampling.period" in str(caught.value)
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.01})
    with pytest.raises(InputError) as caught:
        fp.simulate(scenario, controller=loop(integral=1.0))
    assert caught.value.entry == "control_period"
    fp.simulate(scenario, controller=loop(integral=1.0), control_period=1e-3)
