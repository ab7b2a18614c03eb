"""Self-locking in words."""

import re

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.views.locking_text import summarize_locking

WORDS = {False: "it does not lock", True: "it locks"}


@pytest.mark.parametrize("friction", [3.5e-4, 1e-3])
def test_every_number_says_its_tendon_friction_and_posture_and_a_finger_that_locks_is_said_to(friction):
    overrides = {f"finger.joint_friction.{name}": friction for name in ("coulomb", "stiction")}
    scenario = fp.load_scenario("reversals", overrides)
    found = fp.analysis.self_locking_map(fp.Finger(scenario.finger))
    without, somewhere, moving = summarize_locking(scenario, found).split("\n\n")
    assert "without tendon friction" in without
    for name in scenario.finger.joints:
        locks, has = map(float, re.search(rf"{name} +([0-9.]+) +([0-9.]+)", without).groups())
        critical = fp.analysis.critical_friction(scenario.finger, joints=[name]).coefficient
        assert locks == pytest.approx(1e3 * critical, abs=1e-3)
        assert has == pytest.approx(1e3 * friction)
    margin = fp.analysis.self_locking_margin(scenario)
    for block in (somewhere, moving):
        assert "With the friction of the tendons" in block and WORDS[friction > 7.5e-4] in block
    assert f"{1.0 / margin.margin:.3g} times what locks it, at {margin.time:.3g} s" in moving
    assert ", ".join(f"{each:.3g}" for each in np.rad2deg(margin.position)) in moving


def test_the_posture_at_which_it_locks_first_is_named_where_postures_differ():
    bent = fp.load_scenario("reversals", {"finger.tendons.T5.crossings.distal.bends": True})
    found = fp.analysis.self_locking_map(fp.Finger(bent.finger))
    medial = found.angles[1][np.argmin(found.coefficient.min(axis=0))]
    assert f"locks at {1e3 * found.coefficient.min():.3f}, at proximal " in summarize_locking(bent, found)
    assert f"medial {np.rad2deg(medial):.3g} deg" in summarize_locking(bent, found)
