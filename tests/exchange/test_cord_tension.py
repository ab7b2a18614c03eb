"""Tension of cords that servos and muscles pull, against MuJoCo's force of the actuator in the same state."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario

MODEL = """<mujoco><option gravity="0 0 -9.81"/><worldbody><site name="in" pos="-0.02 0 0.012"/>
<body><joint name="flex" axis="0 1 0" damping="0.01" armature="2e-4"/>
<geom type="capsule" size="0.006" fromto="0 0 0 0.05 0 0"/><site name="on" pos="0.02 0 0.01"/></body></worldbody>
<tendon><spatial name="cord"><site site="in"/><site site="on"/></spatial></tendon><actuator>{}</actuator></mujoco>"""
PULLED_BY = {
    "servo": '<position name="drive" tendon="cord" kp="900" kv="5" ctrlrange="0.03 0.045"/>',
    "muscle": '<muscle name="drive" tendon="cord" lengthrange="0.02 0.06" force="9"/>',
}


@pytest.mark.slow
@pytest.mark.parametrize("drive", PULLED_BY)
@pytest.mark.parametrize("coulomb", [0.0, 0.3])
def test_a_cord_delivers_what_pulls_it_less_its_friction(drive, coulomb):
    """A cord that bends by 1 rad delivers exp(-mu) of the pull while it slides in, at most exp(mu) on its way back."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(PULLED_BY[drive]))
    friction = {"coulomb": coulomb, "viscous": 0.0, "stiction_ratio": 1.0}
    smooth = {f"finger.tendon_friction.{key}": value for key, value in friction.items()}
    smooth["finger.tree.tendons.cord.curvature_offset"] = 1.0
    result = fp.simulate(read_scenario(demo_motion(fp.from_mujoco(model), 0.3), smooth))
    assert result.cord_tension.dims == ("time", "cord") and list(result.cord.values) == ["cord"]
    data, pulled = mujoco.MjData(model), []
    group = "muscle" if drive == "muscle" else "actuator"
    for k in range(result.sizes["time"]):
        data.qpos[:], data.qvel[:] = result.joint_position[k], result.joint_velocity[k]
        data.ctrl[:] = result[f"{group}_input"][k]
        if model.na:
            data.act[:] = result[f"{group}_state"][k]
        mujoco.mj_forward(model, data)
        pulled.append(-data.actuator_force[0])
    taut = np.array(pulled) > 0.5
    share = result.cord_tension.values[taut, 0] / np.array(pulled)[taut]
    # Bristles, and the least level of law (9).
    assert share.min() == pytest.approx(np.exp(-coulomb), abs=3e-3)
    assert share.max() <= np.exp(coulomb) + 3e-3
