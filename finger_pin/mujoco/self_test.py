"""The plugin tried in the MuJoCo at hand, on a slider whose answer is known."""

from __future__ import annotations

import math

import mujoco

from finger_pin.exceptions import InputError
from finger_pin.mujoco.friction_signals import friction
from finger_pin.mujoco.specification import add_friction

#: A slider on a tendon, which a motor pulls, and another motor on its joint.
SLIDER = """
<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
<geom size="0.01" mass="0.1"/></body></worldbody><tendon><fixed name="rope"><joint joint="x" coef="1"/></fixed></tendon>
<actuator><motor tendon="rope"/><motor joint="x"/></actuator></mujoco>"""


def try_self_test() -> None:
    """Hold a slider below the limit of its tendon's friction, T (1 - exp(-mu phi)), and release it above."""
    spec = mujoco.MjSpec.from_string(SLIDER)
    law = {"coulomb": 0.2, "curvature_offset": 1.5, "stiction_ratio": 1.0, "viscous": 0.0}
    add_friction(spec, tendons={"rope": law})
    try:
        model = spec.compile()
    except ValueError as error:
        message = " ".join(str(error).split())
        raise InputError(f"mujoco {mujoco.__version__}", f"friction needs MuJoCo 3.12 or later: {message}") from None
    tension, friction_force = 10.0, 10.0 * (1.0 - math.exp(-0.3))
    data, travel = mujoco.MjData(model), []
    for share in (0.8, 1.1):
        data.ctrl[:] = -tension, tension - share * friction_force
        start = data.qpos[0]
        mujoco.mj_step(model, data, 100)
        travel.append(start - data.qpos[0])
    # Bristles give way by less than 10 F / s0; what is left over pulls it for 0.2 s, 0.1 kg.
    free_travel = 0.5 * 0.1 * friction_force / 0.1 * 0.2**2
    level = float(friction(model, data).level[0])
    released = 0.9 * free_travel < travel[1] < 1.1 * free_travel
    if not (model.nu == 2 and travel[0] < 1e-3 and released and abs(level / friction_force - 1.0) < 1e-3):
        raise InputError(f"mujoco {mujoco.__version__}", "friction gives a wrong answer in it: use another version")
