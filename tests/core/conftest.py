"""Fixtures of the compiled core's tests, built by `core_cases`."""

from dataclasses import replace

import example_robot_data
import pytest
from core_cases import (
    FORCE,
    Case,
    Unpowered,
    carried,
    lugre,
    none_passive,
    on_model,
    servos,
    tree_model,
    two_passive,
    without_abduction_link,
)

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop


@pytest.fixture(scope="session")
def bodies():
    """Fingers on very different rigid bodies, by name."""
    tree = tree_model()
    hand = example_robot_data.load("allegro_right_hand").model
    hand_joints = [f"joint_{i}.0" for i in range(4)]
    for index, name in enumerate(hand.names):
        if name in hand_joints:
            hand.names[index] = name.replace(".0", "")
    return {
        **{name: fp.Finger(fp.load_finger(name)) for name in ("ub_stand_in", "planar", "dexmart_index")},
        "tree": on_model(tree, list(tree.names)[1:], "tip", (1.0, -2.0, -9.0)),
        "hand": on_model(hand, [name.replace(".0", "") for name in hand_joints], "link_3.0_tip", (0.0, 0.0, -9.81)),
    }


@pytest.fixture(scope="session")
def scenarios():
    return {
        "reversals": fp.load_scenario("reversals"),
        "stick_slip": fp.load_scenario("stick_slip"),
        "two_passive": two_passive(),
        "none_passive": none_passive(),
        "lugre": lugre(),
        "servos": servos(),
    }


@pytest.fixture(scope="session")
def cases(scenarios):
    """All loops by name, each with and without a fingertip force."""
    loops = {name: ClosedLoop.from_scenario(scenario) for name, scenario in scenarios.items()}
    loops["servos"] = replace(loops["servos"], drives=Unpowered())
    loops["carried"] = ClosedLoop.from_scenario(carried())
    loops["meeting_axes"] = without_abduction_link(loops["reversals"])
    pushed = {f"{name}_pushed": replace(loop, fingertip_force=FORCE) for name, loop in loops.items()}
    return {name: Case.of(loop) for name, loop in (loops | pushed).items()}
