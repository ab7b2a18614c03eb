"""Sensitivities of a run against differences of whole runs at tight tolerances."""

import numpy as np
import pytest

import finger_pin as fp

KEYS = ["finger.tendon_friction.coulomb", "finger.joint_friction.viscous", "simulation.initial.position.medial"]


@pytest.mark.parametrize("name", ["fig6", "servo"])
def test_sensitivities_are_the_differences_of_tight_runs(name):
    given = {"simulation.duration": 0.3, "simulation.initial.position.medial": 0.2}
    tight = {"simulation.rtol": 1e-11, "simulation.atol_scale": 1e-11}
    prepared = fp.prepare(fp.load_scenario(name, given), KEYS)
    exact = fp.prepare(fp.load_scenario(name, given | tight), KEYS)
    values = np.array(prepared.values, dtype=float)
    run = prepared.run(values, sensitivities=True)
    assert run.attrs["sensitivities_lost"] == np.inf
    for k, value in enumerate(values):
        change = np.zeros(3)
        change[k] = 1e-4 * value
        ends = [exact.run(values + way * change) for way in (1.0, -1.0)]
        for variable in ("joint_position", "tendon_tension"):
            expected = (ends[0][variable] - ends[1][variable]) / (2e-4 * value)
            error = np.sqrt(np.mean((run.slopes[variable][k] - expected) ** 2))
            assert error < 5e-3 * np.sqrt(np.mean(expected**2)), (variable, KEYS[k])


def test_what_has_no_slope_is_refused():
    prepared = fp.prepare(fp.load_scenario("fig6", {"simulation.duration": 0.01}), ["simulation.method"])
    with pytest.raises(fp.InputError, match="single numbers"):
        prepared.run(["Rodas4"], sensitivities=True)
