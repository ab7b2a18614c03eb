"""Whatever pulls a tendon in MuJoCo loads its friction: actuators of every kind, springs, and equalities."""

import mujoco
import numpy as np
import pytest
from palm_cases import PLACES, TREE, alone_under_turned_gravity, scenario_of

import finger_pin as fp

TWO = """<mujoco><extension><plugin plugin="mujoco.pid"/></extension><option gravity="0 0 0"/><worldbody>
<body name="a"><joint name="x" type="slide" axis="1 0 0" stiffness="300"/><geom size="0.01" mass="0.1"/></body>
<body name="b" pos="0 1 0"><joint name="y" type="slide" axis="1 0 0" stiffness="50"/><geom size="0.01" mass="0.1"/>
</body></worldbody><tendon><fixed name="rope"><joint joint="x" coef="-1"/><joint joint="y" coef="-1"/></fixed>
<fixed name="other"><joint joint="x" coef="-1"/></fixed></tendon>{equality}<actuator>{actuator}</actuator></mujoco>"""
ACTUATORS = {
    "dcmotor": '<dcmotor name="m" tendon="rope" gear="-30" resistance="2" motorconst="0.1"/>',
    "wound": '<dcmotor name="m" tendon="rope" gear="-30" resistance="2" motorconst="0.1" inductance="0.01"/>',
    "pid": '<pid name="m" tendon="rope" gear="-1" kp="800" ki="100" kv="1"/>',
    "plugin": '<plugin name="m" tendon="rope" plugin="mujoco.pid" gear="-1" actdim="1"><config key="kp" value="800"/>'
    '<config key="ki" value="10"/></plugin>',
    "muscle": '<muscle name="m" tendon="rope" lengthrange="-1 1" force="20"/>',
    "general": '<general name="m" tendon="rope" gear="-2" gainprm="3" biastype="affine" biasprm="1 -40 -1"/>',
}
EQUALITIES = {
    "none": "",
    "connect": '<equality><connect body1="a" body2="b" anchor="0 0 0"/></equality>',
    "weld": '<equality><weld body1="a" body2="b"/></equality>',
    "tendon": '<equality><tendon tendon1="other" tendon2="rope" polycoef="0 0.5 0 0 0"/></equality>',
}


@pytest.mark.parametrize("equality", EQUALITIES)
@pytest.mark.parametrize("kind", ACTUATORS)
def test_an_actuator_pulls_with_what_it_exerts_and_an_equality_of_tendons_besides(kind, equality):
    spec = mujoco.MjSpec.from_string(TWO.format(equality=EQUALITIES[equality], actuator=ACTUATORS[kind]))
    controls = spec.compile().nu
    fp.mujoco.add_friction(spec, tendons={"rope": {"coulomb": 0.2, "curvature_offset": 1.0, "stiction_ratio": 1.0}})
    model = spec.compile()
    data = mujoco.MjData(model)
    signals = fp.mujoco.friction(model, data)
    data.ctrl[:] = 1.0
    mujoco.mj_step(model, data, 300)
    held = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    coupled = abs(data.efc_force[: data.nefc][held]).sum() if equality == "tendon" else 0.0
    mujoco.mj_forward(model, data)
    exerted = abs(model.actuator("m").gear[0] * data.actuator_force[0])
    assert model.nu == controls and exerted > 0.01
    assert signals.tension[0] == pytest.approx(exerted + coupled, rel=1e-9)
    assert (coupled > 0.1) == (equality == "tendon")
    # (16): between what it delivers at least and at most, of such a tension.
    pull = signals.tension[0]
    assert pull * (1.0 - np.exp(-0.2)) * 0.99 < signals.level[0] < pull * np.expm1(0.2) * 1.01


def test_friction_in_mujoco_is_that_of_each_tree():
    def acceleration(description, q):
        spec = mujoco.MjSpec.from_string(fp.to_mjcf(description))
        fp.mujoco.add_friction(spec, of=description)
        model = spec.compile()
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, 0.1, 1.0
        mujoco.mj_step(model, data)
        return data.qacc

    q = [0.2, 0.5, 0.3, 0.005]
    both = scenario_of({"left": TREE, "right": TREE}).finger
    alone = [acceleration(alone_under_turned_gravity(name).finger, q) for name in PLACES]
    np.testing.assert_allclose(acceleration(both, [*q, *q]), np.concatenate(alone), rtol=1e-5)
