"""Conclusion (b): joint friction grows with the sum of the tensions, and is it more crucial than tendon friction?

"More crucial" can mean several things, and each has its measure here.

- Which friction is felt more when it changes a little: the elasticity d ln(error) / d ln(friction).
- Which one would be worth removing: the error without either.
- Which one costs more accuracy for the same energy lost: each alone, scaled to the same work.
- Which one can stop the finger: joint friction at a critical multiple, where it grows as fast as the tensions that
  are to overcome it. Tensions grow like 1 / (1 - share of critical) before: the simulated finger grips itself where
  1 / tension would reach zero, which is found by extrapolation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.analysis import self_locking_margin
from finger_pin.description.routing import ForceClosure
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.tendons import Tendons
from finger_pin.references.reference import SignalReference
from finger_pin.typing import Array
from paper.runs import (
    Measures,
    Progress,
    lasting,
    measured,
    simulated,
    swinging_to_lock,
    with_joint_friction,
    with_minimum_tension,
    with_tendon_friction,
)
from paper.transmission import coupling_in_motion

_SETTLING = 1.0
_DURATION, _SAMPLES = 5.0, 2500
_STEP = 1.1
_FACTORS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
_TENSIONS = (0.1, 0.3, 1.0, 2.0, 4.0)
_SHARES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1)
_EXTRAPOLATED = slice(3, 5)
#: Largest factor of tendon friction that is looked at for locking.
MOST_TENDON_FRICTION = 10.0
#: Number of runs of the experiment.
INFLUENCE_RUNS = 4 * len(_FACTORS) + 7 * len(_TENSIONS) + len(_SHARES)


@dataclass(frozen=True, eq=False)
class Sweep:
    """Runs over one parameter.

    Attributes:
        values: The parameter, shape (m,).
        runs: The runs' results.
    """

    values: Array
    runs: Measures


@dataclass(frozen=True, eq=False)
class Gripping:
    """A slow swing in the directions closest to locking, over the share of the critical joint friction.

    Attributes:
        shares: Joint friction over the critical one, shape (m,).
        tension: Largest command at the end of the swing, N, shape (m,).
        followed: Travel over that of the reference, of the joint that follows least, shape (m,).
        predicted: Margin of the swing: critical over actual M^c.
        extrapolated: Share of critical at which 1 / tension, extrapolated from below, reaches zero.
        tendons_lock: Factor of tendon friction at which it undoes force closure without joint friction, either way of
            the swing; infinite if it does not up to the largest that was looked at.
    """

    shares: Array
    tension: Array
    followed: Array
    predicted: float
    extrapolated: float
    tendons_lock: float


@dataclass(frozen=True, eq=False)
class FrictionInfluence:
    """The measurements of conclusion (b).

    Attributes:
        scenario: The varied scenario.
        joint: Over factors of joint friction, tendon friction as it is.
        tendon: Over factors of tendon friction, joint friction as it is.
        joint_alone: Over factors of joint friction, without tendon friction.
        tendon_alone: Over factors of tendon friction, without joint friction.
        minimum: Over f0, N.
        minimum_without_joint: The same without joint friction.
        minimum_without_tendon: The same without tendon friction.
        elasticity_joint: d ln(error) / d ln(joint friction) at the values of f0, shape (m,).
        elasticity_tendon: d ln(error) / d ln(tendon friction), likewise.
        gripping: Coefficients at which the finger grips itself.
    """

    scenario: Scenario
    joint: Sweep
    tendon: Sweep
    joint_alone: Sweep
    tendon_alone: Sweep
    minimum: Sweep
    minimum_without_joint: Sweep
    minimum_without_tendon: Sweep
    elasticity_joint: Array
    elasticity_tendon: Array
    gripping: Gripping


def friction_influence(
    scenario: Scenario,
    *,
    factors: tuple[float, ...] = _FACTORS,
    tensions: tuple[float, ...] = _TENSIONS,
    progress: Progress | None = None,
) -> FrictionInfluence:
    """Vary joint friction, tendon friction and least tension of a scenario.

    Args:
        scenario: The scenario to vary; its motion is run for 5 s.
        factors: Of both frictions, increasing, beginning with 0 and holding 1.
        tensions: f0, N.
        progress: Called with the number of further runs that have been finished.

    Raises:
        InputError: If nothing moves, or nothing that moves can lock.
        IntegrationError: If a run could not be finished.
    """
    check_influence(scenario)
    base = lasting(scenario, _DURATION, _SAMPLES)
    smooth_joints, smooth_tendons = with_joint_friction(base, 0.0), with_tendon_friction(base, 0.0)
    up, down = _STEP, 1.0 / _STEP
    groups: list[tuple[tuple[float, ...], Callable[[float], Scenario]]] = [
        (factors, lambda factor: with_joint_friction(base, factor)),
        (factors, lambda factor: with_tendon_friction(base, factor)),
        (factors, lambda factor: with_joint_friction(smooth_tendons, factor)),
        (factors, lambda factor: with_tendon_friction(smooth_joints, factor)),
        (tensions, lambda tension: with_minimum_tension(base, tension)),
        (tensions, lambda tension: with_minimum_tension(smooth_joints, tension)),
        (tensions, lambda tension: with_minimum_tension(smooth_tendons, tension)),
        (tensions, lambda tension: with_minimum_tension(with_joint_friction(base, up), tension)),
        (tensions, lambda tension: with_minimum_tension(with_joint_friction(base, down), tension)),
        (tensions, lambda tension: with_minimum_tension(with_tendon_friction(base, up), tension)),
        (tensions, lambda tension: with_minimum_tension(with_tendon_friction(base, down), tension)),
    ]
    runs = measured(
        [vary(value) for values, vary in groups for value in values],
        len(scenario.finger.actuated_names),
        _SETTLING,
        progress,
    )
    sweeps, first = [], 0
    for values, _ in groups:
        sweeps.append(Sweep(np.array(values), runs.part(slice(first, first + len(values)))))
        first += len(values)
    joint_up, joint_down, tendon_up, tendon_down = (np.log(sweep.runs.error) for sweep in sweeps[7:])
    joint, tendon, joint_alone, tendon_alone, minimum, minimum_without_joint, minimum_without_tendon = sweeps[:7]
    return FrictionInfluence(
        scenario=scenario,
        joint=joint,
        tendon=tendon,
        joint_alone=joint_alone,
        tendon_alone=tendon_alone,
        minimum=minimum,
        minimum_without_joint=minimum_without_joint,
        minimum_without_tendon=minimum_without_tendon,
        elasticity_joint=(joint_up - joint_down) / np.log(up / down),
        elasticity_tendon=(tendon_up - tendon_down) / np.log(up / down),
        gripping=gripping(scenario, progress=progress),
    )


def check_influence(scenario: Scenario) -> None:
    """Raise InputError if a scenario does not lend itself to the experiment."""
    if not np.isfinite(self_locking_margin(scenario).margin):
        raise InputError("reference.joints", "must move joints whose friction could lock the finger")


def gripping(scenario: Scenario, *, progress: Progress | None = None) -> Gripping:
    """Lead a finger to self-locking on a slow swing with joint friction that sliding does not lessen, M^d = M^c.

    Raises:
        IntegrationError: If a run could not be finished.
    """
    swing = swinging_to_lock(scenario)
    swing = swing.updated(finger={"joint_friction": {"coulomb": swing.finger.joint_friction.stiction}})
    margin = self_locking_margin(swing).margin
    shares = np.array(_SHARES)
    runs = simulated(
        [with_joint_friction(swing, float(share * margin)) for share in shares],
        ("tendon_command", "joint_position", "joint_reference"),
        progress,
    )
    tension = runs["tendon_command"].isel(tendon=slice(len(scenario.finger.actuated_names)), time=-1).max("tendon")
    travel, wanted = (runs[name].max("time") - runs[name].min("time") for name in ("joint_position", "joint_reference"))
    followed = (travel / wanted.where(wanted > 0.0)).min("joint")
    below, inverse = shares[_EXTRAPOLATED], 1.0 / tension.values[_EXTRAPOLATED]
    slope = (inverse[1] - inverse[0]) / (below[1] - below[0])
    return Gripping(
        shares=shares,
        tension=tension.values,
        followed=followed.values,
        predicted=margin,
        extrapolated=float(below[1] - inverse[1] / slope),
        tendons_lock=_tendons_lock(swing),
    )


def _tendons_lock(swing: Scenario) -> float:
    for factor in np.arange(1.0, MOST_TENDON_FRICTION + 1.0):
        tendons = Tendons.from_description(with_tendon_friction(swing, float(factor)).finger)
        motion = SignalReference.from_scenario(swing, tendons.routing).at(0.5 * swing.simulation.duration)
        for way in (1.0, -1.0):
            coupling = coupling_in_motion(tendons, motion.position, way * motion.velocity)
            if not ForceClosure.from_coupling(coupling, tendons.routing.tendons).holds:
                return float(factor)
    return float("inf")


def error_at_work(sweep: Sweep, work: Array, lost: float) -> float:
    """Return the tracking error at which a friction has lost some work, J, between the runs of a sweep.

    Args:
        sweep: Over factors of one friction.
        work: Its loss in every run, J, increasing up to the largest.
        lost: The work asked for, J, within what occurs.
    """
    return float(np.interp(lost, work, sweep.runs.error))
