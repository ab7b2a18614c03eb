"""A tendon that goes slack while it slides, its bristles stretched against the motion."""

from __future__ import annotations

import numpy as np
import pytest

import finger_pin as fp


def let_go(floor: float) -> tuple[fp.Scenario, np.ndarray]:
    """Return a finger that nothing pulls, all of whose tendons have just turned round."""
    entries = {f"controller.tensions.T{i}.offset": 0.0 for i in range(1, 5)}
    entries |= {"controller.kind": "tensions", "finger.tendon_friction.floor": floor, "simulation.duration": 0.01}
    scenario = fp.load_scenario("fig6", entries)
    finger = fp.Finger(scenario.finger)
    x = finger.rest_state(np.array([0.0, 0.4, 0.5, 0.35]))
    state = finger.layout.unpack(x)
    state.velocity[:] = [0.0, 5.0, 5.0, 5.0]
    state.tendon_stiction[:] = -0.3 * np.sign(finger.coupling @ state.velocity)
    return scenario, x


def test_a_floor_too_small_to_smooth_slack_is_named_and_a_larger_one_cures_it() -> None:
    scenario, x = let_go(1e-9)
    with pytest.raises(fp.IntegrationError, match=r"tendon_stiction.*finger\.tendon_friction\.floor"):
        fp.simulate(scenario, initial=x)
    simulator = fp.Simulator(fp.Finger(scenario.finger))
    simulator.x = x
    with pytest.raises(fp.IntegrationError, match=r"finger\.tendon_friction\.floor"):
        simulator.step(np.zeros(4), 1e-3)
    # As the advice says.
    result = fp.simulate(let_go(1e-6)[0], initial=x)
    assert result.time[-1] == 0.01
    assert float(result.tendon_tension.sel(tendon=["T1", "T2", "T3", "T4"])[1:].min()) == 0.0
    exchanged = float(sum(abs(result[f"energy_exchanged_{name}"]).max() for name in ("slack", "tendon_coulomb")))
    assert float(abs(result.energy_residual).max()) < 1e-4 * exchanged


def test_another_failure_is_not_blamed_on_the_floor() -> None:
    simulator = fp.Simulator(fp.Finger("ub"))
    broken = simulator.x
    broken[5] = 1e200
    simulator.x = broken
    with pytest.raises(fp.IntegrationError) as caught:
        simulator.step(np.ones(4), 1e-3)
    assert "floor" not in str(caught.value)
