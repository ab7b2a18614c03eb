"""A slider on a tendon in MuJoCo, and its equations written out."""

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

import finger_pin as fp

XML = """<mujoco><option timestep="0.002" gravity="0 0 0" integrator="{integrator}"/><worldbody><body>
<joint name="x" type="slide" axis="1 0 0" stiffness="{spring}"/><geom size="0.01" mass="{mass}"/></body></worldbody>
<tendon><fixed name="rope"><joint joint="x" coef="-1"/></fixed></tendon>
<actuator><motor name="pull" tendon="rope" gear="-1"/><motor name="push" joint="x"/></actuator></mujoco>"""


def slider(mass=0.1, spring=0.0, integrator="Euler", **law):
    """Return a MuJoCo model whose coordinate grows as its tendon is drawn in, without viscous friction and Stribeck."""
    spec = mujoco.MjSpec.from_string(XML.format(mass=mass, spring=spring, integrator=integrator))
    fp.mujoco.add_friction(spec, tendons={"rope": {"viscous": 0.0, "stiction_ratio": 1.0} | law})
    return spec.compile()


def exact(pull, times, mass, spring, law):
    """Return positions by (9), (12), (14) and (16), written out for one tendon."""
    least = np.tanh(0.5 * law["coulomb"] * law["curvature_offset"])

    def rhs(t, x):
        q, v, stiction = x
        pressing = max(0.0, pull(t) - stiction - law["viscous"] * v)
        sliding = least * (1.0 + (law["stiction_ratio"] - 1.0) * np.exp(-abs(v) / law["stribeck_velocity"]))
        level = max((pull(t) + pressing) * sliding + law["drag"], 1e-4)
        rate = law["stiffness"] * (v - stiction * abs(v) / level)
        loss = stiction + law["viscous"] * v + law["micro_damping"] / law["stiffness"] * rate
        return v, (max(0.0, pull(t) - loss) - spring * q) / mass, rate

    options = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-13, "max_step": 1e-3}
    return solve_ivp(rhs, (0.0, times[-1]), [0.0, 0.0, 0.0], t_eval=times, **options).y[0]


def run(model, pull, duration, every):
    """Return positions of a slider under a tension that depends on time."""
    data, found, step = mujoco.MjData(model), [0.0], model.opt.timestep
    for i in range(1, round(duration / step) + 1):
        data.ctrl[0] = pull((i - 1) * step)
        mujoco.mj_step(model, data)
        if i % round(every / step) == 0:
            found.append(data.qpos[0])
    return np.array(found)
