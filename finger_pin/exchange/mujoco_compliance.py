"""Springs that give as MuJoCo's soft constraints do: `solref` and `solimp` at a model's own inertia."""

from __future__ import annotations

from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# Between these MuJoCo keeps the impedance.
_IMPEDANCES = 1e-4, 0.9999
# What descriptions have at most, N/m or N m/rad.
_STIFFEST = 1e7


def soft_spring(read: ElementReader, solref: Array, solimp: Array, mobility: float) -> tuple[float, float]:
    """Return stiffness and damping of a constraint that gives by more than the width in `solimp`, SI.

    MuJoCo's force is (a_ref - a) / R with a_ref = -b v - k d r and R = (1 - d) / d times the mobility (manual,
    "Computation: Constraint model"): under a load a spring of k d / R beside a damper of b / R. Within the width the
    impedance d is smaller, and the constraint gives more. The inertia of 1 / R that MuJoCo adds is left out.

    Args:
        read: The model.
        solref: Time constant and damping ratio, or stiffness and damping per mass, both negative.
        solimp: Impedance; the second number is that of large deflections.
        mobility: Acceleration per force along the constraint, as MuJoCo approximates it, 1/kg or 1/(kg m2).
    """
    impedance = min(max(float(solimp[1]), _IMPEDANCES[0]), _IMPEDANCES[1])
    first, second = float(solref[0]), float(solref[1])
    if first > 0.0:
        if not read.model.opt.disableflags & int(read.mujoco.mjtDisableBit.mjDSBL_REFSAFE):
            # MuJoCo takes no shorter time constant.
            first = max(first, 2.0 * float(read.model.opt.timestep))
        stiffness, damping = 1.0 / (impedance * first * second) ** 2, 2.0 / (impedance * first)
    else:
        stiffness, damping = -first / impedance**2, -second / impedance
    inertia = impedance / ((1.0 - impedance) * mobility) if mobility > 0.0 else _STIFFEST
    return min(stiffness * impedance * inertia, _STIFFEST), min(damping * inertia, _STIFFEST)


def stop_stiffness(read: ElementReader, joint: str) -> float:
    """Return the stiffness of the stops of a joint by its name, N m/rad or N/m; zero for those of free bodies."""
    if joint not in read.names.joints:
        return 0.0
    model, i = read.model, read.names.joints.index(joint)
    mobility = float(model.dof_invweight0[model.jnt_dofadr[i]])
    return soft_spring(read, model.jnt_solref[i], model.jnt_solimp[i], mobility)[0]
