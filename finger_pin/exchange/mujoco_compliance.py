"""Springs that give as MuJoCo's soft constraints do: `solref` and `solimp` at a model's own inertia."""

from __future__ import annotations

import math

from scipy.optimize import brentq

from finger_pin.exchange.mujoco_names import Table
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# Between these MuJoCo keeps the impedance.
_IMPEDANCES = 1e-4, 0.9999
#: Speed of an impact that contacts throw back alike, m/s, and the least share of it.
IMPACT, LEAST_SHARE = 0.1, 0.05
# What descriptions have at most, N/m or N m/rad.
_STIFFEST = 1e7


def soft_spring(
    read: ElementReader, what: str, solref: Array, solimp: Array, mobility: float, stop: bool = False
) -> tuple[float, float]:
    """Return stiffness and damping of a constraint that gives by more than the width in `solimp`, SI.

    MuJoCo's force is (a_ref - a) / R with a_ref = -b v - k d r and R = (1 - d) / d times the mobility (manual,
    "Computation: Constraint model"): under a load a spring of k d / R beside a damper of b / R. Within the width the
    impedance d is smaller, and the constraint gives more. The inertia of 1 / R that MuJoCo adds is left out:
    beside the same spring, a stop throws back as much of an impact's speed with the same damping ratio, b / (2 sqrt k),
    of the inertia that meets it. What is stiffer than descriptions have is listed, by the name of its element.

    Args:
        read: The model.
        what: Name of the element, for the list.
        solref: Time constant and damping ratio, or stiffness and damping per mass, both negative.
        solimp: Impedance; the second number is that of large deflections.
        mobility: Acceleration per force along the constraint, as MuJoCo approximates it, 1/kg or 1/(kg m2).
        stop: Whether it bounces.
    """
    spring, damper, stiffness, damping = _unbounded(read, solref, solimp, mobility)
    if spring > _STIFFEST:
        read.rest.add(f"{what}: stiffness {spring:.2g} by its solref and solimp, {_STIFFEST:.2g} here", moves=False)
        spring = _STIFFEST
    if stop and mobility > 0.0:
        damper = damping * math.sqrt(spring / (stiffness * mobility))
    return spring, min(damper, _STIFFEST)


def contact_numbers(read: ElementReader, solref: Array, solimp: Array, mobility: float) -> tuple[float, float]:
    """Return the stiffness of a contact without friction, N/m, as that of `soft_spring`, and its damping, s/m.

    Damping grows with the depth here, and does not in MuJoCo: an impact at 0.1 m/s is thrown back at the same speed.
    """
    spring, _, stiffness, damping = _unbounded(read, solref, solimp, mobility)
    share = restitution(0.5 * damping / math.sqrt(stiffness))
    return spring, impact_damping(max(share, LEAST_SHARE)) / IMPACT


def restitution(ratio: float) -> float:
    """Return the share of its speed that a spring and damper throw back, at a damping ratio, as they never pull.

    The solution of x'' + 2 ratio x' + x = 0 until x'' = 0 (Schwager and Poeschel, Granular Matter 9, 2007).
    """
    if abs(ratio - 1.0) < 1e-6:
        return math.exp(-2.0)
    root = math.sqrt(abs(1.0 - ratio**2))
    if ratio < 1.0:
        phase = math.pi - math.atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio**2)
        return math.exp(-ratio * phase / root) * (ratio / root * math.sin(phase) - math.cos(phase))
    phase = math.atanh(2.0 * ratio * root / (2.0 * ratio**2 - 1.0))
    return math.exp(-ratio * phase / root) * (ratio / root * math.sinh(phase) - math.cosh(phase))


def impact_damping(share: float) -> float:
    """Return c v of a Hunt-Crossley contact that throws back a share e of the speed v of an impact.

    c v (1 + e) = log((1 + c v) / (1 - e c v)), from the integral of m v' = -k d^p (1 + c v).
    """
    if share > 0.999:
        return 1.5 * (1.0 - share)

    def gap(speed: float) -> float:
        return speed * (1.0 + share) - math.log((1.0 + speed) / (1.0 - share * speed))

    return float(brentq(gap, 1e-6, (1.0 - 1e-15) / share))


def _unbounded(read: ElementReader, solref: Array, solimp: Array, mobility: float) -> tuple[float, float, float, float]:
    """Return stiffness and damping at any mobility, and MuJoCo's k and b."""
    impedance = min(max(float(solimp[1]), _IMPEDANCES[0]), _IMPEDANCES[1])
    first, second = float(solref[0]), float(solref[1])
    if first > 0.0:
        if not read.model.opt.disableflags & int(read.mujoco.mjtDisableBit.mjDSBL_REFSAFE):
            # MuJoCo takes no shorter time constant.
            first = max(first, 2.0 * float(read.model.opt.timestep))
        stiffness, damping = 1.0 / (impedance * first * second) ** 2, 2.0 / (impedance * first)
    else:
        stiffness, damping = -first / impedance**2, abs(second) / impedance
    inertia = impedance / ((1.0 - impedance) * mobility) if mobility > 0.0 else math.inf
    return stiffness * impedance * inertia, damping * inertia, stiffness, damping


def read_stops(read: ElementReader, joints: Table) -> Table:
    """Return the stroke limiters of joints by their names; free bodies have none."""
    model, numbers = read.model, []
    for name in joints:
        i = read.names.joints.index(name) if joints[name]["limited"] else None
        soft = None if i is None else (model.jnt_solref[i], model.jnt_solimp[i])
        mobility = 0.0 if i is None else float(model.dof_invweight0[model.jnt_dofadr[i]])
        numbers.append(soft_spring(read, f"stops of joint {name}", *soft, mobility, stop=True) if soft else (0.0, 0.0))
    stiffness, viscous = zip(*numbers, strict=True)
    return {"stiffness": [*stiffness], "damping": 0.0, "viscous": [*viscous]} if any(stiffness) else {}
