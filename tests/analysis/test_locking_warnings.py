"""Warnings of simulations close to self-locking."""

import pytest
from locking_cases import steps

import finger_pin as fp
from finger_pin.analysis import quick_margin
from finger_pin.control.proportional import ProportionalController
from finger_pin.views.summary import summarize

STUCK = {f"finger.joint_friction.{name}": 7.6e-4 for name in ("coulomb", "stiction")}


@pytest.mark.parametrize("name", ["reversals", "stick_slip"])
def test_the_scenarios_that_ship_keep_their_distance_and_say_so(name, recwarn):
    result = fp.simulate(fp.load_scenario(name, {"simulation.duration": 0.02}))
    assert not [each for each in recwarn if each.category is fp.exceptions.SelfLockingWarning]
    assert result.attrs["self_locking_margin"] > 2.0
    assert quick_margin(fp.load_scenario(name)) > 2.0


@pytest.mark.parametrize(("coefficient", "said"), [(6.5e-4, "88 % of what locks"), (7.6e-4, "1.02 times what locks")])
def test_a_simulation_close_to_locking_warns_whoever_calls_it_and_its_summary_says_so(coefficient, said):
    """The critical coefficient of the reference is 0.7418 mm."""
    with pytest.warns(fp.exceptions.SelfLockingWarning, match=said) as caught:
        result = fp.simulate(steps(coefficient, 0.02))
    assert [each.filename for each in caught] == [__file__]
    assert result.attrs["self_locking_margin"] == pytest.approx(0.7418e-3 / coefficient, rel=1e-3)
    summary = summarize(result).splitlines()
    (line,) = [line for line in summary if "Warning" in line]
    assert said in line


def test_a_controller_of_ones_own_is_not_judged_by_the_papers():
    stuck = fp.load_scenario("reversals", STUCK | {"simulation.duration": 0.01})
    finger = fp.Finger(stuck.finger)
    own = ProportionalController.from_scenario(stuck, finger.routing)
    assert "self_locking_margin" not in fp.simulate(stuck, controller=own, control_period=1e-3).attrs


def test_many_runs_warn_once_and_say_how_many_are_close():
    with pytest.warns(fp.exceptions.SelfLockingWarning, match="2 of 3 runs come close") as caught:
        stacked = fp.simulate_many([steps(coefficient, 0.02) for coefficient in (2e-4, 7.6e-4, 8e-4)], workers=1)
    assert len(caught) == 1
    assert list(stacked["self_locking_margin"] < 1.0) == [False, True, True]
