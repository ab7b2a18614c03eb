"""Cords over many joints: every leg moves with its own joints alone, and its corners with those of its neighbours."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.signals.rate_derivatives import rate_derivatives

JOINTS = 6
FRICTION = {"coulomb": 0.3, "stiction_ratio": 1.0, "viscous": 0.1}


def chain(coincident):
    """Return links that turn about many axes, and two cords that share legs.

    With ``coincident`` points of both links lie on a hinge, and of three where two hinges cross.
    """
    axes = np.random.default_rng(4).normal(size=(JOINTS, 3))
    bodies, path = "", ["start"]
    for k, axis in enumerate(axes):
        short = coincident and k % 3 == 1
        anchor = "0 0 0" if k == 0 or (coincident and k % 3 == 2) else f"0.03 0.00{k} 0.004"
        bodies += f'<body name="b{k}" pos="{anchor}"><joint name="j{k}" axis="{axis[0]} {axis[1]} {axis[2]}"/>'
        bodies += '<inertial pos="0.015 0 0" mass="0.01" diaginertia="1e-6 2e-6 2e-6"/>'
        own = {f"here{k}": "0 0 0"} if coincident and k else {}
        own |= {} if short else {f"p{k}": f"0.015 0.00{k} 0.006"}
        own |= {f"there{k}": f"0.03 0.00{k + 1} 0.004"} if coincident and not short and k + 1 < JOINTS else {}
        bodies += "".join(f'<site name="{name}" pos="{place}"/>' for name, place in own.items())
        path += own
    sites = "".join(f'<site site="{name}"/>' for name in path)
    other = sites.replace("start", "elsewhere")
    return f"""<mujoco><worldbody><site name="start" pos="-0.01 0 0.01"/><site name="elsewhere" pos="-0.01 0.01 0.02"/>
    {bodies}{"</body>" * JOINTS}</worldbody><tendon><spatial name="one">{sites}</spatial>
    <spatial name="two">{other}</spatial></tendon>
    <actuator><motor tendon="one" gear="-1"/><motor tendon="two" gear="-1"/></actuator></mujoco>"""


@pytest.mark.parametrize("coincident", [False, True])
@pytest.mark.parametrize("place", ["canal", "bends"])
def test_the_rate_of_a_chain_of_joints_has_the_derivatives_that_its_differences_show(coincident, place):
    description = fp.from_mujoco(mujoco.MjSpec.from_string(chain(coincident)))
    finger = fp.Finger(description.updated(tendon_friction=FRICTION | {"place": place}))
    rng, pull = np.random.default_rng(8), np.array([3.0, 2.0])
    x = finger.rest_state(rng.uniform(-0.6, 0.6, JOINTS), rng.normal(size=JOINTS))
    x = x + 1e-3 * rng.normal(size=x.size)
    step = 1e-6 * np.eye(x.size)
    differences = (
        np.array([finger.rhs(0.0, x + each, pull) - finger.rhs(0.0, x - each, pull) for each in step]).T / 2e-6
    )
    found, _ = rate_derivatives(finger.mechanism, x, pull)
    # Of bends where nothing slides, differences are rounding.
    scale = np.maximum(np.abs(differences).max(axis=1, keepdims=True), 1.0)
    np.testing.assert_allclose(found / scale, differences / scale, atol=2e-6)


def test_bends_of_a_cord_are_those_of_each_posture_evaluated():
    description = fp.from_mujoco(mujoco.MjSpec.from_string(chain(False)))
    finger = fp.Finger(description.updated(tendon_friction=FRICTION | {"place": "bends"}))
    rng, pull = np.random.default_rng(8), np.array([3.0, 2.0])
    x = np.array([finger.rest_state(rng.uniform(-0.6, 0.6, JOINTS), rng.normal(size=JOINTS)) for _ in range(3)])
    x = x + 1e-3 * rng.normal(size=x.shape)
    found = CompiledFinger(finger).evaluate(x, np.tile(pull, (3, 1))).rate
    np.testing.assert_allclose(found, [finger.rhs(0.0, row, pull) for row in x], rtol=1e-8)
