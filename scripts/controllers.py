"""Compare controllers on the paper's Fig. 6: tracking, tension and losses, as a table, a CSV file and a figure."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from pathlib import Path

import xarray as xr
from command_line import DONE, FAILED, INTERRUPTED, NOT_WRITTEN, Parser, complain
from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from finger_pin.description.loading import load_scenario
from finger_pin.description.routing import Routing
from finger_pin.exceptions import IntegrationError
from finger_pin.files import replacing
from finger_pin.simulation.simulate import simulate
from finger_pin.studies.comparison import CASES, Comparison, compare, to_csv
from finger_pin.views.plots import save_figure
from finger_pin.views.plots.controllers import plot_controllers

PROGRAM = "controllers.py"
WIDTH = 100
TITLE = "Controllers on fig6, after the first second"
CAPTION = "error: rms; by T5: of it, the passive tendon's stretch; peak, mean: commands; mJ: lost by friction; f5: mean"
DRAWN = ("paper", "all friction", "all friction, f5d 4 N, loop")


def main(arguments: list[str] | None = None) -> int:
    """Simulate every controller, show and write the comparison; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    parser.add_argument(
        "--output", type=Path, default=Path("results/controllers"), metavar="DIR", help="default %(default)s"
    )
    folder = parser.read(arguments).output
    rows: list[Comparison] = []
    drawn: dict[str, xr.Dataset] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        coupling = Routing.from_description(load_scenario("fig6").finger).coupling
        for name, result in runs():
            rows.append(compare(name, result, coupling))
            joints = [str(each) for each in result["joint"].values]
            with replacing(folder / "controllers.csv") as temporary:
                Path(temporary).write_text(to_csv(rows, joints, ["T5"]), encoding="utf-8")
            if name in DRAWN:
                drawn[name] = result
        save_figure(plot_controllers(drawn, rows), folder / "controllers.png")
    except IntegrationError as error:
        complain(PROGRAM, f"{error}; the rows so far are in {folder}")
        return FAILED
    except OSError as error:
        complain(PROGRAM, f"{folder}: cannot be written: {error.strerror or error}")
        return NOT_WRITTEN
    except KeyboardInterrupt:
        complain(PROGRAM, f"interrupted; the rows so far are in {folder}")
        return INTERRUPTED
    Console(width=max(Console().width, WIDTH)).print(table(rows))
    print(f"{note(rows)}\nTable and figure are in {folder}")
    return DONE


def runs():
    """Yield every case with its result; on a terminal, show how far it is."""
    bar = Progress(console=Console(stderr=True), transient=True) if sys.stderr.isatty() else nullcontext()
    with bar as progress:
        for name, overrides in CASES.items():
            scenario = load_scenario("fig6", overrides)
            if progress is None:
                yield name, simulate(scenario)
                continue
            task = progress.add_task(name, total=scenario.simulation.duration)
            yield name, simulate(scenario, progress=lambda time, task=task: progress.update(task, completed=time))


def note(rows: list[Comparison]) -> str:
    """Say in words what stays of the error once friction is compensated, and why."""
    row = next(each for each in rows if each.name == DRAWN[1])
    share, tension = (row.passive_error / row.error) ** 2, " and ".join(f"{each:.1f}" for each in row.passive_tension)
    return (
        f"Of the squared error that {row.name} leaves, {share:.0%} is the stretch of the passive tendon: the minimum\n"
        f"tensions make it carry {tension} N, where its reference (20) reckons with 1 N. A controller that keeps both\n"
        "cannot do much better; the rows below change either."
    )


def table(rows: list[Comparison]) -> Table:
    """Return the comparison as a table; ratios are to the first row."""
    first = rows[0]
    shown = Table(title=TITLE, caption=CAPTION, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), title_justify="left")
    shown.add_column("controller", no_wrap=True)
    headers = (
        "error\ndeg",
        "times\nless",
        "by T5\ndeg",
        "peak\nN",
        "times",
        "mean\nN",
        "tendons\nmJ",
        "joints\nmJ",
        "f5\nN",
    )
    for header in headers:
        shown.add_column(header, justify="right", no_wrap=True)
    for row in rows:
        shown.add_row(
            row.name,
            f"{row.error:.3f}",
            f"{first.error / row.error:.1f}",
            f"{row.passive_error:.3f}",
            f"{row.peak_tension:.2f}",
            f"{row.peak_tension / first.peak_tension:.2f}",
            f"{row.mean_tension:.2f}",
            f"{row.tendon_loss:.1f}",
            f"{row.joint_loss:.1f}",
            " ".join(f"{value:.2f}" for value in row.passive_tension),
        )
    return shown


if __name__ == "__main__":
    sys.exit(main())
