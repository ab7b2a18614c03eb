"""Springs that give as MuJoCo's soft constraints do: `solref` and `solimp` at a model's own inertia."""

from __future__ import annotations

import math

from scipy.optimize import brentq

from finger_pin.exchange.mujoco_names import Table
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# Range to which MuJoCo clips the impedance.
_IMPEDANCE_RANGE = 1e-4, 0.9999
#: Speed of the impact at which restitution is matched, m/s, and the least restitution.
IMPACT_SPEED, LEAST_RESTITUTION = 0.1, 0.05
# Acceleration of the load under which depths are compared, m/s2 or rad/s2, and the difference that is listed, m or rad.
_LOAD, _GREATEST_DIFFERENCE = 9.81, 1e-3
# Greatest stiffness of descriptions, N/m or N m/rad.
_MAX_STIFFNESS = 1e7


def soft_spring(
    reader: ElementReader, element: str, solref: Array, solimp: Array, mobility: float, stop: bool = False
) -> tuple[float, float]:
    """Return stiffness and damping of a constraint that gives by more than the width in `solimp`, SI.

    MuJoCo's force is (a_ref - a) / R with a_ref = -b v - k d r and R = (1 - d) / d times the mobility (manual,
    "Computation: Constraint model"): under a load a spring of k d / R beside a damper of b / R. Within the width the
    impedance d is smaller, and the constraint gives more: by how much is listed if it is more than 1 mm or 1 mrad under
    the weight of the inertia that meets it. The inertia of 1 / R that MuJoCo adds is left out:
    beside the same spring, a stop throws back as much of an impact's speed with the same damping ratio, b / (2 sqrt k),
    of the inertia that meets it. What is stiffer than descriptions have is listed, by the name of its element.

    Args:
        reader: The model.
        element: Name of the element, for the list.
        solref: Time constant and damping ratio, or stiffness and damping per mass, both negative.
        solimp: Impedance; the second number is that of large deflections.
        mobility: Acceleration per force along the constraint, as MuJoCo approximates it, 1/kg or 1/(kg m2).
        stop: Whether it bounces.
    """
    spring, damper, stiffness, damping = _springs(reader, solref, solimp, mobility)
    if spring > _MAX_STIFFNESS:
        line = f"{element}: stiffness {spring:.2g} by its solref and solimp, {_MAX_STIFFNESS:.2g} here"
        reader.left_out.add(line, moves=False)
        spring = _MAX_STIFFNESS
    if depths := depths_at_rest(reader, solref, solimp):
        theirs, ours = depths
        line = f"by its solimp it gives {theirs:.3g} under the weight of what it holds, {ours:.3g} here, m or rad"
        reader.left_out.add(f"{element}: {line}", moves=False)
    if stop and mobility > 0.0:
        damper = damping * math.sqrt(spring / (stiffness * mobility))
    return spring, min(damper, _MAX_STIFFNESS)


def contact_numbers(reader: ElementReader, solref: Array, solimp: Array, mobility: float) -> tuple[float, float]:
    """Return the stiffness of a contact without friction, N/m, as that of `soft_spring`, and its damping, s/m.

    Damping grows with the depth here, and does not in MuJoCo: an impact at 0.1 m/s is thrown back at the same speed.
    """
    spring, _, stiffness, damping = _springs(reader, solref, solimp, mobility)
    share = restitution(0.5 * damping / math.sqrt(stiffness))
    return spring, impact_damping(max(share, LEAST_RESTITUTION)) / IMPACT_SPEED


def depths_at_rest(reader: ElementReader, solref: Array, solimp: Array) -> tuple[float, float] | None:
    """Return how deep a constraint is at rest in MuJoCo and here, m or rad; None where they differ by less than 1e-3.

    The load is 9.81 m/s2 or rad/s2 of the inertia 1/A that meets it, so that A drops out of MuJoCo's force at rest,
    F = k d(r)^2 r / ((1 - d(r)) A), with d(r) of its manual ("Solver parameters"): over the width it goes from the
    first number of ``solimp`` to the second. Here d is the second.
    """
    stiffness = _springs(reader, solref, solimp, 1.0)[2]
    low, high = (min(max(float(each), _IMPEDANCE_RANGE[0]), _IMPEDANCE_RANGE[1]) for each in solimp[:2])
    width, middle, power = (float(each) for each in solimp[2:5])

    def impedance(depth: float) -> float:
        x = depth / width if width > 0.0 else 1.0
        if x >= 1.0:
            return high
        rising = x <= middle
        near, room = (x, middle) if rising else (1.0 - x, 1.0 - middle)
        part = near if power == 1.0 or room <= 0.0 else near**power / room ** (power - 1.0)
        return low + (part if rising else 1.0 - part) * (high - low)

    def excess(depth: float) -> float:
        d = impedance(depth)
        return stiffness * d * d * depth - _LOAD * (1.0 - d)

    if stiffness <= 0.0:
        return None
    ours, least = _LOAD * (1.0 - high) / (stiffness * high**2), min(low, high)
    theirs = float(brentq(excess, 0.0, 2.0 * _LOAD / (stiffness * least**2), xtol=1e-12, rtol=1e-9))
    return (theirs, ours) if abs(theirs - ours) > _GREATEST_DIFFERENCE else None


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

    def residual(speed: float) -> float:
        return speed * (1.0 + share) - math.log((1.0 + speed) / (1.0 - share * speed))

    return float(brentq(residual, 1e-6, (1.0 - 1e-15) / share))


def _springs(reader: ElementReader, solref: Array, solimp: Array, mobility: float) -> tuple[float, float, float, float]:
    """Return stiffness and damping at any mobility, and MuJoCo's k and b."""
    impedance = min(max(float(solimp[1]), _IMPEDANCE_RANGE[0]), _IMPEDANCE_RANGE[1])
    first, second = float(solref[0]), float(solref[1])
    if first > 0.0:
        if not reader.model.opt.disableflags & int(reader.mujoco.mjtDisableBit.mjDSBL_REFSAFE):
            # MuJoCo takes no shorter time constant.
            first = max(first, 2.0 * float(reader.model.opt.timestep))
        stiffness, damping = 1.0 / (impedance * first * second) ** 2, 2.0 / (impedance * first)
    else:
        stiffness, damping = -first / impedance**2, abs(second) / impedance
    inertia = impedance / ((1.0 - impedance) * mobility) if mobility > 0.0 else math.inf
    return stiffness * impedance * inertia, damping * inertia, stiffness, damping


def read_stops(reader: ElementReader, joints: Table) -> Table:
    """Return the stroke limiters of joints by their names; free bodies have none."""
    model, numbers = reader.model, []
    for name in joints:
        i = reader.names.joints.index(name) if joints[name]["limited"] else None
        softness = None if i is None else (model.jnt_solref[i], model.jnt_solimp[i])
        mobility = 0.0 if i is None else float(model.dof_invweight0[model.jnt_dofadr[i]])
        stop = f"stops of joint {name}"
        numbers.append(soft_spring(reader, stop, *softness, mobility, stop=True) if softness else (0.0, 0.0))
    stiffness, viscous = zip(*numbers, strict=True)
    return {"stiffness": [*stiffness], "damping": 0.0, "viscous": [*viscous]} if any(stiffness) else {}
