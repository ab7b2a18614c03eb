"""Targets, and the measurements that reach or miss them."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from benchmarks.runs import TEXTBOOK
from benchmarks.work_precision import OURS

_MIB = 2**20


class Target(NamedTuple):
    """A measured figure beside its target.

    Attributes:
        name: Its name.
        value: Measured.
        relation: ``=``, or how the value bounds what was to be measured.
        sense: ``>=`` or ``<=``.
        target: Aimed at.
        unit: Of both.
        passed: Whether the target is reached; None where the value does not decide it.
    """

    name: str
    value: float
    relation: str
    sense: str
    target: float
    unit: str
    passed: bool | None


def target(name: str, value: float, sense: str, aim: float, unit: str, relation: str = "=") -> Target:
    """Compare a value, or a bound, with a target."""
    reached = {">=": operator.ge, "<=": operator.le}[sense](value, aim)
    # A lower bound above a lower target decides it, and so does an upper bound below; otherwise only "=" does.
    decided = relation == "=" or (relation == sense if reached else relation in (">=", "<=") and relation != sense)
    return Target(name, value, relation, sense, aim, unit, bool(reached) if decided else None)


def targets(stages: Mapping[str, Any]) -> list[Target]:
    """Return all targets whose stages were measured."""
    found: list[Target] = []
    studies = stages.get("work-precision") or {}
    for name, real_time, ratio in (("reversals", 150.0, 50.0), ("stick_slip", 10.0, 80.0)):
        if name in studies:
            found += _speed(name, studies[name], real_time, ratio)
    for name in (stages.get("contact") or {}).get("crowded", {}):
        crowd = stages["contact"]["crowded"][name]
        found.append(target(f"{name}, whole simulate()", crowd["duration"] / crowd["whole"], ">=", 1.0, "x"))
    if stages.get("mujoco"):
        found += _mujoco(stages["mujoco"])
    if stages.get("step-interface"):
        step = stages["step-interface"]
        found.append(target("step interface at 1 kHz, steps", step["real_time_factor_stepping"], ">=", 20.0, "x"))
        found.append(target("step interface at 1 kHz, with controller", step["real_time_factor"], ">=", 20.0, "x"))
    if stages.get("hand"):
        found += _hand(stages["hand"])
    if stages.get("prepared"):
        found += _prepared(stages["prepared"])
    if stages.get("identification"):
        found += _identification(stages["identification"])
    if stages.get("learning"):
        found += _learning(stages["learning"])
    if stages.get("many-runs"):
        many = stages["many-runs"]
        found.append(target("two threads, many runs", many["speed_up"], ">=", 1.9, "x"))
        if many["speed_up_without_start"]:
            found.append(target("two threads, per further run", many["speed_up_without_start"], ">=", 1.9, "x"))
    if stages.get("main-job"):
        job = stages["main-job"]
        found.append(target("main job, first run", job["first"], "<=", 30.0, "s"))
        found.append(target("main job, later runs", job["later"], "<=", 4.0, "s"))
        found.append(
            target("main job, peak memory", max(job["first_memory"], job["later_memory"]) / _MIB, "<=", 600.0, "MiB")
        )
    return found


def _speed(name: str, study: Mapping[str, Any], real_time: float, ratio: float) -> Iterator[Target]:
    costs, error = study["at_target"], study["target"]
    theirs = [costs[method]["integration"] for method in TEXTBOOK if costs.get(method, {}).get("integration")]
    for kind, words in (("integration", "integration"), ("whole", "whole simulate()")):
        # A bound from below says nothing about what a method would need.
        ours = [costs[m][kind] for m in OURS if costs.get(m, {}).get(kind) and costs[m][kind][1] != ">="]
        if not ours:
            continue
        mine, relation = min(ours)
        flipped = {"=": "=", "<=": ">="}[relation]
        label = f"{name} at {error:g} rad, {words}"
        yield target(f"{label}: real-time factor", study["duration"] / mine, ">=", real_time, "x", flipped)
        if theirs:
            best, bound = min(theirs)
            known = bound if flipped == "=" else flipped if bound in ("=", flipped) else "?"
            yield target(f"{label}: over the textbook", best / mine, ">=", ratio, "x", known)


def _hand(study: Mapping[str, Any]) -> Iterator[Target]:
    cores, fingers = study["cores"], study["fingers"]
    for kind in ("integration", "whole"):
        times = cores["1"][kind]
        yield target(f"hand over one finger, {kind}", fingers * times["hand"] / times["fingers"], "<=", 5.5, "x")
    if "2" in cores:
        speed_up = cores["1"]["integration"]["hand"] / cores["2"]["integration"]["hand"]
        yield target("hand, two threads, integration", speed_up, ">=", 1.6, "x")


def _mujoco(study: Mapping[str, Any]) -> Iterator[Target]:
    for measure in study["ours"]:
        rows = [row for row in study["rows"] if row["measure"] == measure]
        for massless, words in ((False, "lumped mass"), (True, "one spring")):
            mine = [row for row in rows if row["massless"] == massless]
            if not mine:
                continue
            label = f"MuJoCo, {words}, {measure} error {study['limit']:g} rad"
            yield target(f"{label}: Python loop", min(row["loop_over_ours"] for row in mine), ">=", 4.0, "x")
            yield target(f"{label}: rollout", min(row["rollout_over_ours"] for row in mine), ">=", 1.0, "x")


def _identification(study: Mapping[str, Any]) -> Iterator[Target]:
    yield target("six numbers of reversals identified from three starts", study["fit"]["wall"], "<=", 15.0, "s")
    slopes = study["slopes"]
    for count, aim in (("1", 1.3), ("3", 1.9), ("6", 2.8)):
        yield target(f"slopes by {count} numbers, in runs", slopes[count] / slopes["run"], "<=", aim, "x")


def _prepared(study: Mapping[str, Any]) -> Iterator[Target]:
    fig6, simulator = study["runs"]["reversals"], study["simulator"]
    beside = max(times["short changed"] - times["short steps"] for times in study["runs"].values())
    yield target("prepared run of 10 ms with another number, beside its steps, at most", 1e3 * beside, "<=", 2.0, "ms")
    yield target("simulate of 10 ms", 1e3 * fig6["short simulate"], "<=", 6.0, "ms")
    slowest = max(times["load"] for times in study["runs"].values())
    yield target("a scenario that was read before", 1e3 * slowest, "<=", 3.0, "ms")
    share = fig6["simulate"] / fig6["integration"] - 1.0
    yield target("fig6, signals and account over integration", share, "<=", 1.0 / 3.0, "")
    times, errors = simulator["times"], simulator["errors"]
    yield target("a simulator's step of 20 ms, tensions varied slowly", 1e6 * times["varied slowly"], "<=", 60.0, "us")
    yield target("its error, at most", 1e3 * errors["varied slowly"], "<=", 1.0, "mrad")


def _learning(study: Mapping[str, Any]) -> Iterator[Target]:
    times, errors = (study["kinds"]["smooth"][name] for name in ("times", "errors"))
    yield target("a control step of Reach", 1e6 * times["alone"], "<=", 100.0, "us")
    yield target("its error over episodes", 1e3 * errors["one"], "<=", 1.0, "mrad")
    yield target(f"{study['worlds']} worlds over one", times["one"] / times["many"], ">=", 1.8, "x")
    for name, took in study["reset"].items():
        yield target(f"a reset of {name} with numbers drawn anew", 1e3 * took, "<=", 2.0, "ms")
