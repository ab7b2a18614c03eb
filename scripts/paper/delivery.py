"""Conclusion (c): does the passive tendon carry the tension that the controller plans by force closure?

(21), (22) plan f_hat for all tendons; the last entries are what the passive ones should carry if the others are as
commanded and nothing else acts. At rest H_c^T f = G while the plan has H_c^T f_hat = tau^d, and f = f_hat but for the
passive tendons: so a plan is met where tau^d = G. Four things make them differ, and each is switched on by itself here:

- *reference*: the proportional controller holds tau^d = 0 only if the references (20) stretch the passive tendons as
  much as their internal tension does, f5^d = lambda f^k_5. Any other f5^d bends finger and tendon against each other.
- *weight*: G differs from zero.
- *speed*: inertial forces, which grow with its square, and viscous friction.
- *friction* of joints and of tendons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from paper.runs import (
    Progress,
    at_speed,
    internal_passive_tension,
    lasting,
    simulated,
    weightless,
    with_joint_friction,
    with_passive_tension,
    with_tendon_friction,
)

_SETTLING, _DURATION, _SAMPLES = 0.2, 5.0, 2500
_SPEEDS, _FACTORS = (0.25, 1.0, 2.0, 4.0, 8.0, 16.0), (0.0, 0.25, 0.5, 1.0, 1.5, 2.0)
#: Number of runs of the experiment: the grid, four causes, and the scenario as it is.
DELIVERY_RUNS = len(_SPEEDS) * len(_FACTORS) + 5
#: Deviation above which a plan is called broken.
BROKEN = 0.25


@dataclass(frozen=True, eq=False)
class Delivery:
    """Planned and delivered tension of the passive tendons, over runs of any shape.

    Attributes:
        deviation: Root mean square of delivered less planned tension over the mean planned one, of the passive tendon
            that is worst.
        least: Least delivered tension of any passive tendon, N.
    """

    deviation: Array
    least: Array


@dataclass(frozen=True, eq=False)
class PassiveDelivery:
    """The measurements of conclusion (c).

    Attributes:
        scenario: The varied scenario.
        causes: Name of each cause, and the deviation with it alone; slowly but for ``speed``.
        given: The scenario as it is.
        speeds: Factors of the speed, increasing, shape (v,).
        factors: Factors of both frictions, increasing from 0, shape (m,).
        grid: Over speed and friction, without weight and with consistent references, shape (v, m).
        time: Of the traces, s, shape (k,).
        planned: f_hat of the passive tendons, shape (k, p), N, of the scenario as it is.
        delivered: Their distal halves, likewise.
        broken: Deviation above which a plan is called broken.
    """

    scenario: Scenario
    causes: dict[str, float]
    given: Delivery
    speeds: Array
    factors: Array
    grid: Delivery
    time: Array
    planned: Array
    delivered: Array
    broken: float = BROKEN


def passive_delivery(
    scenario: Scenario,
    *,
    speeds: tuple[float, ...] = _SPEEDS,
    factors: tuple[float, ...] = _FACTORS,
    progress: Progress | None = None,
) -> PassiveDelivery:
    """Vary speed and friction of a scenario, and switch on one by one the causes of a difference to the plan.

    Args:
        scenario: The scenario to vary.
        speeds: Factors of its frequencies, increasing; the first is slow, and 1 must be among them.
        factors: Of both frictions, increasing, beginning with 0 and holding 1.
        progress: Called with the number of further runs that have been finished.

    Raises:
        InputError: If the finger has no passive tendon.
        IntegrationError: If a run could not be finished.
    """
    check_delivery(scenario)
    base = lasting(scenario, _DURATION, _SAMPLES)
    consistent = with_passive_tension(base, internal_passive_tension(base))
    ideal = weightless(consistent)
    deviations, least = [], []
    for speed in speeds:
        quick = at_speed(ideal, speed)
        found, *_ = delivered_tensions([_with_friction(quick, factor) for factor in factors], progress)
        deviations.append(found.deviation)
        least.append(found.least)
    slow = at_speed(base, speeds[0])
    bare = _with_friction(slow, 0.0)
    calm = weightless(with_passive_tension(slow, internal_passive_tension(slow)))
    single = {
        "reference": weightless(bare),
        "weight": with_passive_tension(bare, internal_passive_tension(bare)),
        "joint friction": with_tendon_friction(calm, 0.0),
        "tendon friction": with_joint_friction(calm, 0.0),
    }
    alone, *_ = delivered_tensions(list(single.values()), progress)
    given, time, planned, delivered = delivered_tensions([base], progress)
    grid = np.array(deviations)
    causes = {"none": float(grid[0, 0]), **dict(zip(single, map(float, alone.deviation), strict=True))}
    causes["speed"] = float(grid[speeds.index(1.0), 0])
    return PassiveDelivery(
        scenario=scenario,
        causes=causes,
        given=Delivery(given.deviation[0], given.least[0]),
        speeds=np.array(speeds),
        factors=np.array(factors),
        grid=Delivery(grid, np.array(least)),
        time=time,
        planned=planned[0],
        delivered=delivered[0],
    )


def check_delivery(scenario: Scenario) -> None:
    """Raise InputError if a scenario does not lend itself to the experiment."""
    if not scenario.finger.passive_names:
        raise InputError("finger.tendons", "has no passive tendon whose tension could be planned, conclusion c")


def crossing(values: Array, deviations: Array, level: float = BROKEN) -> float:
    """Return the first value with a deviation above a level, by interpolation; infinite without one."""
    above = np.flatnonzero(deviations > level)
    if not above.size:
        return float("inf")
    first = int(above[0])
    if first == 0:
        return float(values[0])
    share = (level - deviations[first - 1]) / (deviations[first] - deviations[first - 1])
    return float(values[first - 1] + share * (values[first] - values[first - 1]))


def _with_friction(scenario: Scenario, factor: float) -> Scenario:
    return with_tendon_friction(with_joint_friction(scenario, factor), factor)


def delivered_tensions(scenarios: list[Scenario], progress: Progress | None) -> tuple[Delivery, Array, Array, Array]:
    """Return the planned and delivered tensions of passive tendons in runs of one duration.

    Returns:
        Deviations of the m runs; time, shape (k,), s; planned and delivered tensions, shape (m, k, p), N.

    Raises:
        IntegrationError: If a run could not be finished.
    """
    runs = simulated(scenarios, ("tendon_command", "tendon_tension"), progress)
    actuated = len(scenarios[0].finger.actuated_names)
    planned, delivered = (
        runs[name].isel(tendon=slice(actuated, None)).transpose("run", "time", "tendon").values
        for name in ("tendon_command", "tendon_tension")
    )
    time = runs["time"].values
    after = time >= _SETTLING * time[-1]
    gap = np.sqrt(np.mean((delivered - planned)[:, after] ** 2, axis=1)) / np.mean(planned[:, after], axis=1)
    found = Delivery(np.max(gap, axis=1), np.min(delivered[:, after], axis=(1, 2)))
    return found, time, planned, delivered
