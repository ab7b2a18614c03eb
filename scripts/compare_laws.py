"""Laws of friction side by side on benches: fitted to the same recordings, they predict the same held-out ones.

The laws are those that people have: none, a constant level, a constant and a viscous one, LuGre's bristles at a level
that load does not change, the capstan's without bristles, and that which the bench has. BIC is comparable: samples
count under all laws as under the last one.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import finger_pin as fp
from finger_pin.description.loading import load_bench
from finger_pin.description.scenario import Scenario
from finger_pin.identification.comparison import SCENARIO_LAW, bic
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.recordings import read_recording
from finger_pin.identification.search.gauss_newton import fit
from finger_pin.identification.search.objective import Objective
from finger_pin.views.plots import save_figure
from finger_pin.views.plots.panels import grid, plain_ticks, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, colour, styled, thin
from finger_pin.views.shown_units import shown_unit

_TENDON, _JOINT, _GEARS = "finger.tendon_friction.", "finger.joint_friction.", "finger.actuators.servo.motor.friction."
# Marker, edge and face of the variables of a bench: they differ in grey, too.
_MARKS = (("o", BLUE, BLUE), ("s", BLACK, "none"))


class Law(NamedTuple):
    """A law as changes of a bench.

    Attributes:
        values: Numbers that it sets, by key; they are not searched for unless they have bounds.
        searched: Bounds of further keys.
    """

    values: Mapping[str, float]
    searched: Mapping[str, tuple[float, float]] = {}


class Signal(NamedTuple):
    """Errors of a law in the signals of one variable.

    Attributes:
        fitted: rms of fitted samples, in the unit of the signal.
        held_out: rms of held-out samples.
        within: Share of held-out samples in the 95 % band.
        unit: Unit of the signal.
    """

    fitted: float
    held_out: float
    within: float
    unit: str


class Row(NamedTuple):
    """A law on a bench: its number of parameters, its BIC, and its signals by variable."""

    parameters: int
    bic: float
    signals: Mapping[str, Signal]


_NO_LOAD = {f"{_TENDON}coulomb": 0.0, f"{_JOINT}{{coulomb,stiction}}": 0.0}
_STIFF = {f"{_TENDON}stiffness": 1e5}
_NO_SERVO = {f"{_GEARS}{name}": 0.0 for name in ("by_load", "stribeck_by_load", "viscous")}
#: The laws of every bench beside that which it has; a name says which other law is the same on this bench.
LAWS: dict[str, dict[str, Law | str]] = {
    "instrument": {
        "none": Law({**_NO_LOAD, **_STIFF, f"{_JOINT}drag": 0.0}),
        "constant": Law({**_NO_LOAD, **_STIFF}),
        "constant, viscous": Law({**_NO_LOAD, **_STIFF}, {f"{_JOINT}viscous": (1e-5, 0.1)}),
        "LuGre without load": Law(
            {**_NO_LOAD, **_STIFF, f"{_JOINT}stiffness": 10.0},
            {f"{_JOINT}stiffness": (0.3, 1000.0), f"{_JOINT}viscous": (1e-5, 0.1)},
        ),
        "capstan without bristle": Law({f"{_JOINT}{{coulomb,stiction}}": 0.0, **_STIFF}),
    },
    "servo_pendulum": {
        "none": Law({**_NO_SERVO, f"{_GEARS}coulomb": 0.0}),
        "constant": Law(_NO_SERVO),
        "constant, viscous": Law({f"{_GEARS}by_load": 0.0, f"{_GEARS}stribeck_by_load": 0.0}),
        "LuGre without load": Law(
            {f"{_GEARS}by_load": 0.0, f"{_GEARS}stribeck_by_load": 0.0},
            {f"{_GEARS}stribeck": (0.0, 0.1), f"{_GEARS}stiffness": (1.0, 500.0)},
        ),
        # Of gears: a share of what they carry.
        "capstan without bristle": Law({f"{_GEARS}stribeck_by_load": 0.0, f"{_GEARS}viscous": 0.0}),
    },
    # Readings at one speed that have settled: neither a viscous part nor bristles show.
    "transmission": {
        # A fit needs a number: a millinewton is none.
        "none": Law({f"{_TENDON}coulomb": 0.0}, {f"{_TENDON}drag": (0.0, 1e-3)}),
        "constant": Law({f"{_TENDON}coulomb": 0.0, f"{_TENDON}drag": 0.0}, {f"{_TENDON}drag": (0.0, 10.0)}),
        "constant, viscous": "constant",
        "LuGre without load": "constant",
        "capstan without bristle": Law({f"{_TENDON}drag": 0.0}),
    },
}
#: Entries of recordings, by bench and name. `transmission` as it ships holds nothing out; of `servo_pendulum` two goals
#: at two gains are fitted, which takes half as long as all nine, and two more goals and gains are predicted.
RECORDINGS: dict[str, dict[str, dict[str, Any]]] = {
    "transmission": {"pull": {"held_out": {"force_in_N": [15, 18]}}},
    "servo_pendulum": {
        name: {"held_out": True} for name in ("st_kp100", "ss_kp200", "st_kp200", "ud_kp200", "st_kp400")
    },
}


def law_problem(bench: str, law: Law) -> tuple[Scenario, dict[str, tuple[float, float]], dict[str, Any]]:
    """Return the scenario of a bench under a law, the bounds of its parameters, and the entries of its recordings."""
    scenario, settings = load_bench(bench)
    values = {}
    for key, value in law.values.items():
        owner, brace, names = key.partition("{")
        # Two numbers that move together are changed together.
        values |= {owner + name: value for name in names.strip("}").split(",")} if brace else {key: value}
    bounds = {key: each for key, each in settings.parameters.items() if key not in law.values}
    changes = RECORDINGS.get(bench, {})
    recordings = {
        name: each.model_dump(exclude_unset=True) | changes.get(name, {}) for name, each in settings.recordings.items()
    }
    return fp.load_scenario(scenario, values), bounds | dict(law.searched), recordings


def fit_law(bench: str, law: Law, starts: int, output: Path | None = None) -> xr.Dataset:
    """Return the identification of a bench under a law, with its predictions."""
    scenario, parameters, recordings = law_problem(bench, law)
    return fp.identify(
        scenario, parameters=parameters, recordings=recordings, starts=starts, profiles=False, output=output
    )


def comparable_bic(bench: str, law: Law, result: xr.Dataset, reference: xr.Dataset) -> float:
    """Return the BIC of a law, fitted anew from a result under the weights of a reference of the same recordings."""
    scenario, parameters, recordings = law_problem(bench, law)
    scenario, settings = load_bench(scenario, None, {"parameters": parameters, "recordings": recordings})
    recorded = [read_recording(name, each, None) for name, each in settings.recordings.items()]
    residuals = fitted_residuals(scenario, settings, recorded)
    shares = reference["independent_share"].values[residuals.likelihood.outputs]
    start = residuals.parameters.at_values(result["estimate"].values)
    best = fit(Objective(residuals), start, weights=shares)
    return bic(residuals.likelihood, best.residuals, shares, len(residuals.parameters.bounds))


def by_variable(result: xr.Dataset, along: str, values: str, samples: str, power: float = 1.0) -> dict[str, float]:
    """Return the power mean of values along signals, over all samples, by variable."""
    names = np.array([name.partition(".")[2] for name in result[along].values.tolist()])
    return {
        name: float(
            np.average(result[values].values[names == name] ** power, weights=result[samples].values[names == name])
            ** (1.0 / power)
        )
        for name in dict.fromkeys(names.tolist())
    }


def summary(bench: str, law: Law, result: xr.Dataset, reference: xr.Dataset) -> Row:
    """Return the row of a law on a bench; in its BIC samples count as under the reference."""
    fitted = by_variable(result, "signal", "noise", "signal_samples", 2.0)
    held_out = by_variable(result, "prediction", "prediction_rms", "prediction_samples", 2.0)
    within = by_variable(result, "prediction", "prediction_within", "prediction_samples")
    labels = zip(result["prediction"].values.tolist(), result["prediction_units"].values.tolist(), strict=True)
    units = {name.partition(".")[2]: unit for name, unit in labels}
    signals = {name: Signal(fitted[name], held_out[name], within[name], units[name]) for name in held_out}
    return Row(result.sizes["parameter"], comparable_bic(bench, law, result, reference), signals)


def compare(bench: str, starts: int, output: Path | None = None) -> Iterator[tuple[str, Row | str]]:
    """Yield the laws of a bench, that which it has first, each with its row or the name of the same one."""
    reference: xr.Dataset | None = None
    for name, law in {SCENARIO_LAW: Law({}), **LAWS[bench]}.items():
        if isinstance(law, str):
            yield name, law
            continue
        folder = None if output is None else output / bench / name.replace(",", "").replace(" ", "_")
        result = fit_law(bench, law, starts, folder)
        reference = result if reference is None else reference
        yield name, summary(bench, law, result, reference)


@styled
def plot_laws(table: Mapping[str, Mapping[str, Row | str]]) -> Figure:
    """Draw the held-out rms of every law over that of the bench's law, a panel for each bench."""
    figure, panels = grid(len(table), 3, (4.2, 3.6), sharex=True)
    for axes, (bench, rows) in zip(panels, table.items(), strict=True):
        described, laws = rows[SCENARIO_LAW], [*LAWS[bench], SCENARIO_LAW]
        assert isinstance(described, Row)
        for (marker, edge, face), (variable, signal) in zip(_MARKS, described.signals.items(), strict=False):
            points = [
                (row.signals[variable].held_out / signal.held_out, place)
                for place, law in enumerate(laws)
                if isinstance(row := rows[law], Row)
            ]
            factor, unit = shown_unit(signal.unit)
            label = f"{variable}\n1 = {factor * signal.held_out:.2g} {unit}"
            colours = {"color": colour(edge), "markerfacecolor": face if face == "none" else colour(face)}
            axes.plot(*zip(*points, strict=True), marker, label=label, clip_on=False, **colours)
        for place, law in enumerate(laws):
            if isinstance(rows[law], str):
                axes.text(1.0, place, f"  as {rows[law]}", va="center", color=colour(GREY))
        axes.axvline(1.0, color=colour(GREY), linewidth=thin(), zorder=0)
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
        first = axes.get_subplotspec().is_first_col()
        axes.set_yticks(range(len(laws)), laws if first else [""] * len(laws))
        axes.set(xlabel="held-out rms over that as described", ylim=(len(laws) - 0.5, -0.5))
        title(axes, bench)
        # Below the panel: a marker beside its name would look like a point.
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2))
    return figure


def main(arguments: list[str] | None = None) -> int:
    """Fit benches under every law; print what each leaves over, and how well it predicts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bench", nargs="*", help=f"of {', '.join(LAWS)}; all if none is named")
    parser.add_argument("--starts", type=int, default=1, metavar="N", help="from how many points to search")
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="keeps finished fits: the same command goes on")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="held-out rms by law, a panel for each bench")
    options = parser.parse_args(arguments)
    for bench in options.bench:
        if bench not in LAWS:
            parser.error(f"no such bench: {bench}; there are {', '.join(LAWS)}")
    table: dict[str, dict[str, Row | str]] = {}
    for bench in options.bench or LAWS:
        print(f"{bench}: parameters; BIC less that as described; rms fitted and held out; share in the 95 % band")
        rows = table[bench] = {}
        for law, row in compare(bench, options.starts, options.output):
            rows[law] = row
            if isinstance(row, str):
                print(f"  {law:24} as {row}", flush=True)
                continue
            described = rows[SCENARIO_LAW]
            assert isinstance(described, Row)
            print(f"  {law:24} {row.parameters:2} {row.bic - described.bic:8.1f}", flush=True)
            for variable, each in row.signals.items():
                numbers = f"{each.fitted:9.3g} {each.held_out:9.3g} {each.unit:4} {each.within:5.0%}"
                print(f"    {variable:34} {numbers}", flush=True)
    if options.figure is not None:
        print(save_figure(plot_laws(table), options.figure))
    return 0


if __name__ == "__main__":
    sys.exit(main())
