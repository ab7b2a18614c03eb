"""Points of a cord that lie at one place: the leg between them has no direction, and the cord turns there once."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.loading import read_scenario


def scenario(path, place):
    """Return two links in the plane of x and z, and a cord through points (body, x, z)."""
    link = {"mass": 0.01, "centre": [0.02, 0.0, 0.0], "inertia": [1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0]}
    table = {
        "name": "coincident",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {f"j{k}": {"range": [-1.5, 1.5], "spring": {"stiffness": 0.05, "damping": 2e-3}} for k in (1, 2)},
        "tendons": {"cord": {"along": "cord"}},
        "tendon_friction": {"coulomb": 0.3, "stiction_ratio": 1.0, "place": place},
        "tree": {
            "bodies": {"one": link, "two": {**link, "parent": "one", "position": [0.04, 0.0, 0.0]}},
            "joints": {
                "j1": {"body": "one", "axis": [0.0, 1.0, 0.0]},
                "j2": {"body": "two", "axis": [0.0, 1.0, 0.0], "anchor": [0.0, 0.0, 0.007]},
            },
            "tendons": {
                "cord": {
                    "path": {
                        f"p{k}": {"kind": "point", "position": [x, 0.0, z], **({"body": body} if body else {})}
                        for k, (body, x, z) in enumerate(path)
                    }
                }
            },
        },
    }
    return read_scenario({"name": "x", "finger": table, "controller": {"kind": "tensions"}})


START, VIA, LAST = (None, -0.04, 0.008), (None, 0.0, 0.008), ("two", 0.03, 0.005)
# The second joint turns about the point at which the cord passes from one link to the other.
SINGLE = [START, VIA, ("one", 0.04, 0.007), LAST]
DOUBLE = [START, VIA, VIA, ("one", 0.04, 0.007), ("two", 0.0, 0.007), LAST]
TRIPLE = [START, VIA, VIA, (None, 1e-12, 0.008), ("one", 0.04, 0.007), ("two", 0.0, 0.007), LAST]


@pytest.mark.parametrize("place", ["canal", "bends"])
@pytest.mark.parametrize("path", [DOUBLE, TRIPLE])
def test_a_cord_turns_once_where_several_of_its_points_lie_at_one_place(path, place):
    rng = np.random.default_rng(2)
    once, several = (fp.Finger(scenario(each, place).finger) for each in (SINGLE, path))
    for _ in range(4):
        q, v, pull = rng.uniform(-1.2, 1.2, 2), rng.normal(size=2), np.array([6.0])
        x = several.rest_state(q, v)
        expected = once.evaluate(once.rest_state(q, v), pull)
        found = several.evaluate(x, pull)
        # By hand: the angles of the legs below the x axis.
        c, s = np.cos(q[0]), np.sin(q[0])
        below = [0.0, np.arctan2(0.04 * s - 0.007 * c + 0.008, 0.04 * c + 0.007 * s), q.sum() + np.arctan2(0.002, 0.03)]
        by_hand = sum(abs(np.angle(np.exp(1j * turn))) for turn in np.diff(below))
        assert found["tendon_curvature"][0] == pytest.approx(by_hand, rel=1e-9)
        np.testing.assert_allclose(found["joint_acceleration"], expected["joint_acceleration"], rtol=1e-9)
        compiled = CompiledFinger(several).evaluate(x, pull).rate
        np.testing.assert_allclose(compiled, found.rate, rtol=1e-9, atol=1e-9 * np.max(np.abs(found.rate)))


@pytest.mark.parametrize("path", [SINGLE, DOUBLE, TRIPLE])
def test_the_linear_model_of_such_a_cord_is_that_of_one_with_single_points(path):
    once, several = (fp.Finger(scenario(each, "canal").finger) for each in (SINGLE, path))
    x = once.rest_state(np.array([0.4, -0.3]))
    expected, found = (fp.linearise(each, x, [4.0]).A.values for each in (once, several))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))
