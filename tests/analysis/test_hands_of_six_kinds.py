"""Statics of hands that servos, muscles, motors or nothing pull: an answer or one line, from every public function."""

import inspect

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import InputError
from finger_pin.exchange.from_mujoco import from_mujoco

BODIES = """<mujoco><compiler angle="radian"/><worldbody><site name="s0" pos="-.02 0 .01"/>
<body name="a"><joint name="j1" axis="0 1 0" range="-1 1"/><geom type="capsule" size=".01" fromto="0 0 0 .05 0 0"/>
<site name="s1" pos=".02 0 .01"/><body name="b" pos=".05 0 0"><joint name="j2" axis="0 1 0" range="-1 1"/>
<geom type="capsule" size=".01" fromto="0 0 0 .04 0 0"/><site name="s2" pos=".02 0 .01"/></body></body></worldbody>
{}</mujoco>"""
CORD = (
    '<tendon><spatial name="c"><site site="s0"/><site site="s1"/><site site="s2"/></spatial></tendon>'
    "<actuator>{}</actuator>"
)
SUM = '<tendon><fixed name="f"><joint joint="j1" coef=".01"/><joint joint="j2" coef=".008"/></fixed></tendon>'
PULL = '<motor name="m" tendon="{}" gear="-1" ctrlrange="0 5"/>'
KINDS = {
    "nothing": "",
    "servos of joints": '<actuator><position joint="j1" kp="1" kv=".01"/><position joint="j2" kp="1"/></actuator>',
    "servo of a cord": CORD.format('<position tendon="c" kp="100" kv="1" forcerange="-20 0"/>'),
    "muscle": CORD.format('<muscle tendon="c" lengthrange=".05 .12" force="10"/>'),
    "motor of a cord": CORD.format(PULL.format("c")),
    "motor about joints": f"{SUM}<actuator>{PULL.format('f')}</actuator>",
}
FUNCTIONS = [name for name, value in inspect.getmembers(fp.analysis, inspect.isfunction)]


@pytest.fixture(scope="module", params=KINDS)
def described(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("hand") / "hand.xml"
    path.write_text(BODIES.format(KINDS[request.param]))
    return from_mujoco(path, "hand")


def arguments(description):
    """Give every argument that a public function of statics requires, by its name."""
    count = len(description.actuated_names)
    return {
        "finger": description,
        "scenario": read_scenario(demo_motion(description, 0.1)),
        "position": [0.1, 0.2],
        "point": [0.08, 0.0, -0.02],
        "direction": [0.0, 0.0, 1.0],
        "force": [0.0, 0.0, 0.0],
        "maximum_tension": 5.0,
        "inputs": np.zeros(fp.Finger(description).mechanism.channels),
        "command": np.ones((3, count)),
        "speed": np.full(3, 0.01),
        "margin": 2.0,
    }


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_answers_or_says_in_one_line_why_not(described, name):
    function, given = getattr(fp.analysis, name), arguments(described)
    required = [key for key, each in inspect.signature(function).parameters.items() if each.default is each.empty]
    try:
        function(*(given[key] for key in required))
    except InputError as error:
        assert "\n" not in str(error)


def test_no_hand_without_pulled_tendons_has_force_closure(described):
    """Two joints need three tendons that pull, and none of these hands has more than one."""
    found = fp.analysis.closure_over_range(described, 8)
    assert not found.holds
    assert str(found).startswith("no force closure")
    with pytest.raises(InputError, match="no force closure"):
        fp.analysis.locking_over_range(described, 8)
