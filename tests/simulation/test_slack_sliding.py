"""A tendon that goes slack while it slides, its bristles stretched against the motion."""

from __future__ import annotations

import numpy as np
import pytest
from validation.wild_fingers import wild_scenario

import finger_pin as fp

# Starts beyond ranges are meant.
pytestmark = pytest.mark.filterwarnings("ignore::finger_pin.exceptions.StartWarning")


def let_go(floor: float) -> tuple[fp.Scenario, np.ndarray]:
    """Return a finger that nothing pulls, all of whose tendons have just turned round."""
    entries = {f"controller.tensions.T{i}.offset": 0.0 for i in range(1, 5)}
    entries |= {"controller.kind": "tensions", "finger.tendon_friction.floor": floor, "simulation.duration": 0.01}
    scenario = fp.load_scenario("reversals", entries)
    finger = fp.Finger(scenario.finger)
    x = finger.rest_state(np.array([0.0, 0.4, 0.5, 0.35]))
    state = finger.layout.unpack(x)
    state.velocity[:] = [0.0, 5.0, 5.0, 5.0]
    state.tendon_stiction[:] = -0.3 * np.sign(finger.coupling @ state.velocity)
    return scenario, x


def test_a_tendon_lets_its_bristles_go_in_the_same_way_however_small_the_floor() -> None:
    positions = []
    for floor in (1e-6, 1e-9, 1e-12):
        scenario, x = let_go(floor)
        result = fp.simulate(scenario, initial=x)
        assert float(result.tendon_tension.sel(tendon=["T1", "T2", "T3", "T4"])[1:].min()) == 0.0
        exchanged = float(sum(abs(result[f"energy_exchanged_{name}"]).max() for name in ("slack", "tendon_coulomb")))
        assert float(abs(result.energy_residual).max()) < 1e-4 * exchanged
        positions.append(result.joint_position)
    assert max(float(abs(each - positions[0]).max()) for each in positions) < 1e-7


def test_a_passive_tendon_goes_slack_at_great_speed_with_a_small_floor() -> None:
    # Its load falls to the floor of 15 nN within less than the resolution of time.
    scenario = wild_scenario(274)
    short = scenario.updated(simulation={"duration": 1.5e-5, "sample_rate": 2e7})
    tension = fp.simulate(short).tendon_tension.sel(tendon="T0")
    assert float(tension[0]) > 0.9 and float(tension.min()) == 0.0 and tension.time[-1] == 1.5e-5
