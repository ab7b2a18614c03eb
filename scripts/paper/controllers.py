"""The command controllers: compare controllers on the paper's Fig. 6."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.commands.console import count_bar, error_note, print_text, shows_progress
from finger_pin.commands.options import Format, Output

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

    from paper.comparison import Comparison

WIDTH = 100
TITLE = "Controllers on reversals, after the first second"
CAPTION = "error: rms; by T5: of it, the passive tendon's stretch; peak, mean: commands; mJ: lost by friction; f5: mean"
DRAWN = ("paper", "all friction", "all friction, f5d 4 N, loop")


def controllers(output: Output = Path("results/controllers"), format: Format = None) -> None:
    """Compare controllers on reversals: tracking, tension and losses, as a table, a CSV file and a figure."""
    shown = shows_progress(quiet=False)
    from rich.console import Console

    from finger_pin.description.loading import load_scenario
    from finger_pin.description.routing import Routing
    from finger_pin.files import write_table
    from finger_pin.views.plots import save_figure
    from paper.comparison import compare, csv_rows
    from paper.plot_controllers import plot_controllers

    rows: list[Comparison] = []
    drawn: dict[str, xr.Dataset] = {}
    output.mkdir(parents=True, exist_ok=True)
    coupling = Routing.from_description(load_scenario("reversals").finger).coupling
    with error_note(f"the rows so far are in {output}"):
        for name, result in runs(shown):
            rows.append(compare(name, result, coupling))
            joints = [str(each) for each in result["joint"].values]
            write_table(output / "controllers.csv", csv_rows(rows, joints, ["T5"]))
            if name in DRAWN:
                drawn[name] = result
        save_figure(plot_controllers(drawn, rows), output / "controllers", format)
    Console(width=max(Console().width, WIDTH)).print(table(rows))
    print_text(f"{note(rows)}\nTable and figure are in {output}")


def runs(shown: bool) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield every case with its result; show the progress if asked."""
    from finger_pin.description.loading import load_scenario
    from finger_pin.simulation.simulate import simulate
    from paper.comparison import CASES

    with count_bar(shown, len(CASES)) as advance:
        for name, overrides in CASES.items():
            yield name, simulate(load_scenario("reversals", overrides))
            advance(1)


def note(rows: list[Comparison]) -> str:
    """Return a sentence on the error that stays once friction is compensated, and its cause."""
    row = next(each for each in rows if each.name == DRAWN[1])
    share, tension = (row.passive_error / row.error) ** 2, " and ".join(f"{each:.1f}" for each in row.passive_tension)
    return (
        f"Of the squared error that {row.name} leaves, {share:.0%} is the stretch of the passive tendon: the minimum\n"
        f"tensions make it carry {tension} N, where its reference (20) assumes 1 N. A controller that keeps both\n"
        "cannot do much better; the rows below change either."
    )


def table(rows: list[Comparison]) -> Table:
    """Return the comparison as a table; ratios are to the first row."""
    from rich import box
    from rich.table import Table

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
