"""Wall time against error: for all methods on the two standing scenarios, for ours on those with contact."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import finger_pin as fp
from benchmarks.runs import SUNDIALS, Point, compiled, has_sundials, point, settled, sundials, textbook, truth
from benchmarks.store import Store, say
from benchmarks.timing import clocked, cost_at
from finger_pin.description.scenario import Scenario

#: Error, rad, at which costs are compared, by scenario.
TARGET = {"reversals": 1e-5, "stick_slip": 1e-4, "press": 1e-5, "pinch": 1e-5}
OURS = ("Rodas5P", "Rodas4")

_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
# Few, since each takes from ten seconds to a minute; the best of them bracket the targets.
_TEXTBOOK = {
    "reversals": {"BDF": (1e-5, 1e-6), "LSODA": (1e-4, 1e-5), "Radau": (1e-3, 1e-4)},
    "stick_slip": {"BDF": (1e-5, 1e-6), "LSODA": (1e-5,), "Radau": (1e-4, 1e-5)},
}
_QUICK_TEXTBOOK = {"BDF": (1e-4, 1e-6), "LSODA": (1e-5,)}
_QUICK_DURATION = {"reversals": 0.3, "stick_slip": 0.1, "press": 0.3, "pinch": 0.1}


def measure(store: Store) -> dict[str, Any]:
    """Return the points of both scenarios."""
    return {name: study(store, name) for name in _TEXTBOOK}


def study(store: Store, name: str) -> dict[str, Any]:
    """Return the points of a scenario."""
    return store.part(f"work-precision-{name}", lambda: _study(name, store.quick))


def _study(name: str, quick: bool) -> dict[str, Any]:
    scenario = fp.load_scenario(name)
    if quick:
        scenario = settled(scenario, duration=_QUICK_DURATION[name])
    exact, agreement = truth(scenario)
    say(f"  {name}: truth; two methods differ by {agreement['rms']:.1e} rad")
    wanted = _TEXTBOOK.get(name, {})
    # With contact, what is coarser is far from the target.
    tolerances = _TOLERANCES if wanted else _TOLERANCES[2:]
    if quick:
        tolerances, wanted = tolerances[1::2], _QUICK_TEXTBOOK if wanted else {}
    jobs = {(method, rtol): compiled(scenario, method, rtol) for method in OURS for rtol in tolerances}
    if has_sundials() and wanted:
        jobs |= {(SUNDIALS, rtol): sundials(scenario, rtol) for rtol in tolerances[1:]}
    fast: dict[tuple[str, float], Point] = {}
    slow: list[Point] = []
    for method in wanted:
        # The compiled methods take their turn before each of the slow ones, and five times more at the end.
        _sweep(scenario, jobs, exact, fast)
        for rtol in wanted[method]:
            slow.append(point(method, rtol, textbook(scenario, method, rtol), exact))
            say(f"  {name}: {method} at rtol {rtol:g}: {slow[-1].integration:.1f} s")
    for _ in range(5):
        _sweep(scenario, jobs, exact, fast)
    points = [*fast.values(), *slow]
    return {
        "duration": scenario.simulation.duration,
        "target": TARGET[name],
        "agreement": agreement,
        "points": [asdict(each) for each in points],
        "at_target": {
            method: costs(points, method, TARGET[name]) for method in dict.fromkeys(p.method for p in points)
        },
    }


def _sweep(
    scenario: Scenario, jobs: dict[tuple[str, float], Any], exact: Any, fast: dict[tuple[str, float], Point]
) -> None:
    """Run all quick jobs once and keep the least times."""
    for (method, rtol), job in jobs.items():
        found = point(method, rtol, job, exact)
        if method in OURS:
            asked = settled(scenario, method=method, rtol=rtol, atol_scale=rtol)
            found = replace(found, whole=clocked(lambda asked=asked: fp.simulate(asked))[0])
        earlier = fast.get((method, rtol))
        if earlier:
            whole = None if found.whole is None else min(found.whole, earlier.whole or found.whole)
            found = replace(found, integration=min(found.integration, earlier.integration), whole=whole)
        fast[method, rtol] = found


def costs(points: list[Point], method: str, error: float) -> dict[str, Any]:
    """Return the costs of a method at an error: integration and, where measured, the whole call."""
    mine = [each for each in points if each.method == method and each.error is not None]
    found: dict[str, Any] = {"integration": cost_at([(each.error or 0.0, each.integration) for each in mine], error)}
    whole = [(each.error or 0.0, each.whole) for each in mine if each.whole is not None]
    if whole:
        found["whole"] = cost_at(whole, error)
    return found
