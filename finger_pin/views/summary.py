"""A result in words and numbers: tracking, tensions, energies, speed."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.mechanism.groups import ACTUATORS, WRAPS, is_canal
from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.simulation.energy import account_entries
from finger_pin.simulation.frames import read_scene
from finger_pin.simulation.netcdf import require_samples
from finger_pin.simulation.recording import is_tracking, recorded_custom_parts
from finger_pin.typing import Array
from finger_pin.views.shown_units import actuators_by_unit, joints_by_unit

_SETTLING_TIME = 1.0
_LONG_RUN = 2.0
_WARNINGS = (
    *("interrupted", "self_locking", "micro_damping", "closure", "path_jump", "weight", "accuracy", "account"),
    "ringing",
)
# The least speed of sliding, m/s.
_LEAST_SLIDING_SPEED = 1e-6


def summarize(result: xr.Dataset) -> str:
    """Return a summary of a result as plain text, at most 80 columns wide if its names allow.

    Args:
        result: Dataset of `simulate`, or the partial one that its exception carries.
    """
    require_samples(result)
    is_tracking_run = read_scene(result.attrs).finger.links and is_tracking(result)
    motion = [_tracking(result)] if is_tracking_run else [*_joints(result), *_actuators(result)]
    blocks = [
        _heading(result),
        *motion,
        *([_tension(result)] if result.sizes["tendon"] else []),
        *_motors(result),
        *_contacts(result),
        _energy(result),
        *_convergence(result),
        _cost(result),
    ]
    return "\n\n".join("\n".join(block) for block in blocks)


def _heading(result: xr.Dataset) -> list[str]:
    attributes = result.attrs
    title = " ".join(str(attributes["title"]).split())
    tolerances = f"rtol {attributes['rtol']:g}, atol_scale {attributes['atol_scale']:g}"
    run = f"{attributes['end_time']:.6g} s simulated with {attributes['method']}, {tolerances}"
    custom = recorded_custom_parts(result)
    parts = [f"Not what the scenario alone gives: {custom} of one's own"] if custom else []
    warnings = [textwrap.wrap(f"Warning: {attributes[name]}", 80) for name in _WARNINGS if name in attributes]
    return [title, run, *parts, *(line for lines in warnings for line in lines)]


def _tracking(result: xr.Dataset) -> list[str]:
    error, span = result["tracking_error"], "whole run"
    if result.attrs["end_time"] > _LONG_RUN:
        error, span = error.sel(time=slice(_SETTLING_TIME, None)), f"after the first {_SETTLING_TIME:g} s"
    degrees = np.rad2deg(np.asarray(error.transpose("time", "joint")))
    rows = [
        (str(joint), f"{np.sqrt(np.mean(column**2)):.4f}", f"{np.max(np.abs(column)):.4f}")
        for joint, column in zip(result["joint"].values, degrees.T, strict=True)
    ]
    return [f"Tracking error, deg ({span})", *table(("", "rms", "max"), rows)]


def _contacts(result: xr.Dataset) -> list[list[str]]:
    if "contact_force" not in result:
        return []
    rows = []
    for name, contact in ((str(name), result.sel(contact=name)) for name in result["contact"].values):
        is_closed = np.asarray(contact["contact_normal_force"]) > 0.0
        if is_closed.any():
            is_sliding = is_closed & (np.asarray(contact["contact_slip"]) > _LEAST_SLIDING_SPEED)
            shares = (f"{100.0 * np.mean(mask):.1f} %" for mask in (is_closed, is_sliding))
            greatest = [float(contact[f"contact_{force}"].max()) for force in ("normal_force", "friction")]
            rows.append((*number_row(name, greatest), *shares))
    if not rows:
        return [["Contacts: nothing touched"]]
    return [["Contacts, N, and parts of the time", *table(("", "normal", "friction", "touching", "sliding"), rows)]]


def _joints(result: xr.Dataset) -> list[list[str]]:
    position = result["joint_position"]
    return [
        _range_table(
            f"Positions of the joints, {unit}",
            {name: np.asarray(position.sel(joint=name)) for name in names},
            digits=3 if unit == "rad" else 6,
        )
        for unit, names in joints_by_unit(result).items()
    ]


def _actuators(result: xr.Dataset) -> list[list[str]]:
    forces: dict[str, dict[str, Array]] = {}
    for group in ACTUATORS:
        if f"{group}_force" in result:
            for unit, names in actuators_by_unit(result, group).items():
                forces.setdefault(unit, {}).update(
                    {name: np.asarray(result[f"{group}_force"].sel({group: name})) for name in names}
                )
    blocks = [
        _range_table(f"{'Torques' if unit == 'N m' else 'Forces'} of the actuators, {unit}", values)
        for unit, values in forces.items()
    ]
    canals = [name for name in map(str, result.dims) if is_canal(name) and not name.startswith(WRAPS)]
    frictions = {
        str(name): np.asarray(result[f"{each}_friction"].sel({each: name}))
        for each in canals
        if f"{each}_friction" in result
        for name in result[each].values
    }
    if frictions:
        blocks.append(_range_table("Friction of tendons that they and springs pull, N", frictions))
    return blocks


def _tension(result: xr.Dataset) -> list[str]:
    tension = result["tendon_tension"]
    rows = [_range_row(str(name), np.asarray(tension.sel(tendon=name))) for name in result["tendon"].values]
    passive = 0
    if "passive_tension_proximal" in result:
        proximal = result["passive_tension_proximal"]
        halves = np.asarray(proximal.transpose("time", ...)).reshape(proximal.sizes["time"], -1)
        passive = halves.shape[1]
        pairs = zip(rows[-passive:], halves.T, strict=True)
        rows[-passive:] = [
            row
            for distal, half in pairs
            for row in (_range_row(f"{distal[0]}, proximal half", half), (f"{distal[0]}, distal half", *distal[1:]))
        ]
    # What pulls a tendon is before the bends at which it rubs.
    entering = result.get("spool_tension", result.get("tendon_command"))
    if entering is None:
        return ["Tension behind the bends, N", *table(("", "least", "greatest"), rows)]
    pulls = np.asarray(entering.transpose("time", "tendon")).max(axis=0).tolist()
    actuated = result.sizes["tendon"] - passive
    pulled = [f"{pull + 0.0:.3f}" for pull in pulls[:actuated]] + [""] * (len(rows) - actuated)
    pulled_rows = [(*row, pull) for row, pull in zip(rows, pulled, strict=True)]
    return ["Tension behind the bends, N", *table(("", "least", "greatest", "greatest where pulled"), pulled_rows)]


def _motors(result: xr.Dataset) -> list[list[str]]:
    """Return a block about motors if there are any: currents, energy, and the time of slack of their tendons."""
    if "motor_current" not in result:
        return []
    current = np.asarray(result["motor_current"].transpose("time", "motor"))
    power = current * np.asarray(result["motor_voltage"].transpose("time", "motor"))
    columns = (abs(current).max(axis=0), np.sqrt(np.mean(current**2, axis=0)), power.max(axis=0), power.mean(axis=0))
    rows = [number_row(str(name), row) for name, *row in zip(result["motor"].values, *columns, strict=True)]
    slack = slack_time(result)
    slack_tendons = ", ".join(f"{name} {time:.3g} s" for name, time in slack.items() if time > 0.0) or "none"
    heading = ("", "peak A", "rms A", "peak W", "mean W")
    return [["Motors, at their terminals", *table(heading, rows), f"  slack at the spools: {slack_tendons}"]]


def slack_time(result: xr.Dataset) -> dict[str, float]:
    """Return the time for which every tendon on a spool has hung slack, s; by tendon, from the samples."""
    tension = result["spool_tension"]
    time = np.asarray(result["time"])
    pulled = read_scene(result.attrs).finger.actuators.values()
    steps = np.gradient(time) if len(time) > 1 else np.zeros(len(time))
    return {
        name: float(np.sum(steps * (np.asarray(tension.sel(tendon=name)) <= 0.0)))
        for actuator in pulled
        for name in actuator.tendons
    }


def _energy(result: xr.Dataset) -> list[str]:
    stored = sum(_final(each) - float(each[0]) for each in account_entries(result, STORED).values())
    supplied = sum(max(value, 0.0) for value in (*map(_final, account_entries(result, SUPPLIED).values()), -stored))
    named = [
        (f"{kind}: {each.attrs['label']}", _final(each))
        for kind in (SUPPLIED, LOST)
        for each in account_entries(result, kind).values()
    ]
    named += [("stored, end less start", stored), ("residual, not accounted for", _final(result["energy_residual"]))]
    rows = [(label, f"{1e3 * value:.4g}", _share(value, supplied)) for label, value in named]
    return ["Energy, and its share of what was supplied or drawn from store", *table(("", "mJ", "share"), rows)]


def _convergence(result: xr.Dataset) -> list[list[str]]:
    """Return a block about a convergence check if there was one."""
    if "convergence_difference" not in result:
        return []
    difference = np.abs(np.asarray(result["convergence_difference"].transpose("time", "joint")))
    rows = [
        (str(joint), f"{column:.1e}")
        for joint, column in zip(result["joint"].values, np.nanmax(difference, axis=0), strict=True)
    ]
    verdict = textwrap.wrap(str(result.attrs["convergence"]), 80)
    return [["Difference from the run at a tighter tolerance, rad", *table(("", "largest"), rows), *verdict]]


def _cost(result: xr.Dataset) -> list[str]:
    attributes = result.attrs
    wall = float(attributes["solver_wall_time"])
    factor = f"{attributes['end_time'] / wall:.3g}" if wall > 0.0 else "-"
    return [
        f"Solver: {attributes['solver_steps']} steps, {attributes['solver_evaluations']} evaluations, "
        f"{attributes['solver_jacobians']} Jacobians",
        f"Wall time {wall:.3g} s, real-time factor {factor} (simulated over wall time)",
    ]


def _final(values: xr.DataArray | xr.Variable) -> float:
    return float(values[-1])


def _range_table(head: str, signals: Mapping[str, Array], digits: int = 3) -> list[str]:
    """Return a head and a table of the least and the greatest value of signals by name."""
    return [head, *table(("", "least", "greatest"), [_range_row(*each, digits) for each in signals.items()])]


def _range_row(name: str, values: Array, digits: int = 3) -> tuple[str, ...]:
    return number_row(name, (values.min(), values.max()), digits)


def number_row(name: str, values: Iterable[Any], digits: int = 3) -> tuple[str, ...]:
    """Return a row of a table: a name, and numbers with so many digits."""
    # Adding zero turns what rounds to -0.0 into 0.0.
    return name, *(f"{round(float(each), digits) + 0.0:.{digits}f}" for each in values)


def _share(value: float, total: float) -> str:
    """Return a share in percent, or a dash for a share of nothing."""
    if not total > 0.0:
        return "-"
    percent = 100.0 * value / total
    return f"{percent:.2f} %" if percent == 0.0 or abs(percent) >= 0.01 else f"{percent:.1e} %"


def table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return lines of aligned columns: the first to the left, numbers to the right."""
    first, *widths = (max(map(len, column)) for column in zip(header, *rows, strict=True))
    return [
        f"  {name.ljust(first)}" + "".join(c.rjust(max(w, 9) + 3) for c, w in zip(numbers, widths, strict=True))
        for name, *numbers in (header, *rows)
    ]
