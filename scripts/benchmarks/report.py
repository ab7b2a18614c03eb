"""The measurements as text and as figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks import growth, identification, learning, mujoco_friction, mujoco_warp_friction, prepared
from benchmarks.targets import Target
from benchmarks.text_tables import table
from benchmarks.work_precision import OURS
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import GREY, new_figure, styled

_MARKERS = "osD^vP"
_MIB = 2**20


def text(stages: Mapping[str, Any], reached: Sequence[Target], quick: bool) -> str:
    """Return everything as lines."""
    parts: list[str] = []
    for name, study in (stages.get("work-precision") or {}).items():
        parts += ["", *_work_precision(name, study)]
    for name, lines in (
        ("step-interface", _stepping),
        ("joints", _joints),
        ("growth", growth.lines),
        ("hand", _hand),
        ("contact", _contact),
        ("mujoco", _mujoco),
        ("mujoco-friction", mujoco_friction.lines),
        ("mujoco-warp-friction", mujoco_warp_friction.lines),
        ("learning", learning.lines),
        ("prepared", _prepared),
        ("identification", identification.lines),
        ("many-runs", _many),
        ("main-job", _main_job),
    ):
        if stages.get(name):
            parts += ["", *lines(stages[name])]
    parts += ["", *_targets(reached, quick)]
    return "\n".join(parts).strip()


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.4g} s"


def _work_precision(name: str, study: Mapping[str, Any]) -> Iterator[str]:
    duration = study["duration"]
    yield f"{name}, {duration:g} s: wall time against the joints' rms error at 1 kHz"
    yield f"(the truth is two methods at rtol 1e-9, which differ by {study['agreement']['rms']:.1e} rad)"
    rows = [
        (
            each["method"],
            f"{each['rtol']:g}",
            "failed" if each["error"] is None else f"{each['error']:.1e} rad",
            _seconds(each["integration"]),
            _seconds(each["whole"]),
            f"{duration / each['integration']:.3g}x" if each["integration"] else "",
            f"{each['steps'] or ''}",
        )
        for each in study["points"]
    ]
    yield from table(("method", "rtol", "rms error", "integration", "simulate()", "real time", "steps"), rows)
    costs = [
        (method, *(f"{c[1]} {c[0]:.4g} s" if (c := kinds.get(kind)) else "" for kind in ("integration", "whole")))
        for method, kinds in study["at_target"].items()
    ]
    yield f"at {study['target']:g} rad:"
    yield from table(("method", "integration", "simulate()"), costs)


def _stepping(study: Mapping[str, Any]) -> Iterator[str]:
    yield f"step interface, fig6, {study['duration']:g} s at {1.0 / study['period']:.0f} Hz, controller in Python"
    yield f"  whole loop {study['whole']:.3f} s, {study['real_time_factor']:.1f}x real time"
    yield f"  its steps  {study['stepping']:.3f} s, {study['real_time_factor_stepping']:.1f}x real time"
    yield f"  error against the sampled truth: {study['error']:.1e} rad rms, {study['worst']:.1e} rad at most"


def _joints(study: Mapping[str, Any]) -> Iterator[str]:
    yield f"generated chains, Rodas5P at rtol {study['rtol']:g}, {study['duration']:g} s"
    rows = [
        (
            f"{row['joints']}",
            f"{row['states']}",
            _seconds(row["wall_time"]),
            f"{row['real_time_factor']:.3g}x",
            f"{row['steps']}",
            f"{1e6 * row['time_per_step']:.1f} us",
            f"{1e6 * row['time_per_textbook_evaluation']:.0f} us",
        )
        for row in study["rows"]
    ]
    yield from table(("joints", "states", "wall time", "real time", "steps", "per step", "NumPy evaluation"), rows)
    yield f"time per step grows as joints^{study['exponent']:.2f} in the upper half"


def _hand(study: Mapping[str, Any]) -> Iterator[str]:
    sizes = f"{study['fingers']} fingers, {study['joints']} joints, {study['tendons']} tendons"
    yield f"hand, {sizes}, {study['duration']:g} s, against its fingers one by one"
    rows = [
        (
            f"{count} core{'s' if int(count) > 1 else ''}, {kind}",
            _seconds(times["hand"]),
            _seconds(times["fingers"] / study["fingers"]),
            f"{study['fingers'] * times['hand'] / times['fingers']:.2f}x",
        )
        for count, kinds in study["cores"].items()
        for kind, times in kinds.items()
    ]
    yield from table(("", "hand", "one finger", "hand / finger"), rows)


def _contact(study: Mapping[str, Any]) -> Iterator[str]:
    for name, each in study["scenarios"].items():
        yield from _work_precision(name, each)
        yield ""
    for each in study["mujoco"]:
        yield from _mujoco(each)
    yield "scenarios with many contacts, at their own tolerances: processor time"
    rows = [
        (
            name,
            f"{each['contacts']}",
            f"{each['duration']:g} s",
            _seconds(each["integration"]),
            _seconds(each["whole"]),
            f"{each['duration'] / each['whole']:.3g}x",
        )
        for name, each in study["crowded"].items()
    ]
    yield from table(("", "contacts", "motion", "integration", "simulate()", "real time"), rows)


def _mujoco(study: Mapping[str, Any]) -> Iterator[str]:
    what = f"{study['scenario']} without friction other than viscous"
    yield f"MuJoCo {study['version']}, {what}, {study['duration']:g} s"
    for measure, best in study["ours"].items():
        yield f"{measure} error within {study['limit']:g} rad; ours: {best['method']} at rtol {best['rtol']:g}"
        rows = [
            (
                f"{row['integrator']}, {'one spring' if row['massless'] else 'lumped mass'}",
                f"{1e6 * row['step']:g} us",
                f"{row['error']:.1e} rad",
                f"{row['rollout_error']:.1e} rad",
                _seconds(row["ours"]),
                _seconds(row["loop"]),
                _seconds(row["rollout"]),
                f"{row['loop_over_ours']:.3g}x",
                f"{row['rollout_over_ours']:.3g}x",
            )
            for row in study["rows"]
            if row["measure"] == measure
        ]
        head = ("MuJoCo's integrator", "step", "error", "rollout's", "ours", "Python loop", "rollout")
        yield from table((*head, "loop / ours", "rollout / ours"), rows)


def _prepared(study: Mapping[str, Any]) -> Iterator[str]:
    yield "a prepared scenario that records angles and tensions: processor time, ms"
    head = ("scenario", "integration", "run", "simulate", "10 ms: steps", "run", "changed", "simulate", "load")
    yield from table(head, list(prepared.lines(study)))
    simulator = study["simulator"]
    times = ", ".join(f"{name} {1e6 * value:.3g}" for name, value in simulator["times"].items())
    errors = ", ".join(f"{name} {error:.1e}" for name, error in simulator["errors"].items())
    yield f"a simulator, in steps of 20 ms under tensions of three kinds, us: {times}"
    yield f"its largest errors of a step, rad: {errors}"


def _many(study: Mapping[str, Any]) -> Iterator[str]:
    yield f"simulate_many, fig6, {study['duration']:g} s each, on {study['cores']} cores"
    for name, elapsed in study["times"].items():
        yield f"  {name}: {elapsed:.2f} s"
    yield f"  two threads are {study['speed_up']:.2f} times as fast as one,"
    if study["speed_up_without_start"]:
        yield f"  {study['speed_up_without_start']:.2f} times for every further run"


def _main_job(study: Mapping[str, Any]) -> Iterator[str]:
    yield " ".join(["scripts/simulate.py", *study["options"]])
    for name in ("first", "later"):
        wall, busy, memory = (study[f"{name}{key}"] for key in ("", "_processor_time", "_memory"))
        yield f"  {name} run: {wall:.2f} s, {busy:.2f} s of processor time, {memory / _MIB:.0f} MiB at most"


def _targets(reached: Sequence[Target], quick: bool) -> Iterator[str]:
    yield "targets" + (" (a quick run is too short to judge them)" if quick else "")
    verdicts = {True: "pass", False: "FAIL", None: "open"}
    rows = [
        (
            each.name,
            f"{'' if each.relation == '=' else each.relation + ' '}{each.value:.3g} {each.unit}",
            f"{each.sense} {each.target:g} {each.unit}",
            "" if quick else verdicts[each.passed],
        )
        for each in reached
    ]
    yield from table(("", "measured", "aim", ""), rows)


@styled
def plot_work_precision(studies: Mapping[str, Any]) -> Figure:
    """Draw wall time against error, a panel per scenario."""
    figure = new_figure(9.5, 4.6, "constrained")
    panels = figure.subplots(1, len(studies), squeeze=False)[0]
    methods = list(dict.fromkeys(each["method"] for study in studies.values() for each in study["points"]))
    for panel, (name, study) in zip(panels, studies.items(), strict=True):
        for index, method in enumerate(methods):
            mine = [p for p in study["points"] if p["method"] == method and p["error"]]
            mine.sort(key=lambda each: each["rtol"])
            if mine:
                style = {**series(index), "marker": _MARKERS[index % len(_MARKERS)], "markersize": 5}
                label = f"{method}, compiled" if method in OURS else method
                panel.loglog([p["error"] for p in mine], [p["integration"] for p in mine], label=label, **style)
        panel.axhline(study["duration"], color=GREY, linestyle=(0, (5, 3)), linewidth=1.0)
        panel.text(0.01, study["duration"], "real time", transform=panel.get_yaxis_transform(), color=GREY, va="bottom")
        panel.axvline(study["target"], color=GREY, linestyle=(0, (1, 2)), linewidth=1.0)
        panel.set_title(f"{name}, {study['duration']:g} s")
        panel.set_xlabel("rms error of the joints (rad)")
        panel.invert_xaxis()
    panels[0].set_ylabel("wall time (s)")
    handles = {
        text: handle for panel in panels for handle, text in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles))
    return figure


@styled
def plot_joints(study: Mapping[str, Any]) -> Figure:
    """Draw the cost of a step against the number of joints."""
    figure = new_figure(6.0, 4.4, "constrained")
    axes = figure.subplots()
    joints = [row["joints"] for row in study["rows"]]
    for index, (key, label) in enumerate(
        (
            ("time_per_step", "compiled step, Jacobian included"),
            ("time_per_textbook_evaluation", "one NumPy evaluation"),
        )
    ):
        values = [1e6 * row[key] for row in study["rows"]]
        axes.loglog(joints, values, label=label, marker=_MARKERS[index], **series(index))
    axes.set_xticks(joints, [str(n) for n in joints])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(LogLocator(subs=[]))
    axes.set_xlabel("joints")
    axes.set_ylabel("time (µs)")
    axes.legend()
    return figure
