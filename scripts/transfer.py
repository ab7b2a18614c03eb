"""What policies know of friction: trained without, at one friction, and with friction drawn anew; tried on others."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from train import Policy

from finger_pin.commands.application import run_function
from finger_pin.commands.console import print_text
from finger_pin.commands.options import Output, Restart, wrong

# No friction at all has no bristles to speak of; a thousandth has none that matter.
_LEAST = 1e-3


class _Together:
    """A factor that several numbers share."""

    def __init__(self, low: float, high: float) -> None:
        self._bounds, self.factor = np.log([low, high]), 1.0

    def draw(self, random: np.random.Generator) -> None:
        self.factor = float(np.exp(random.uniform(*self._bounds)))


@dataclass(frozen=True)
class _Scaled:
    """A number times the factor, which the first of them draws."""

    together: _Together
    value: float
    first: bool

    def draw(self, random: np.random.Generator) -> float:
        """Return one draw."""
        if self.first:
            self.together.draw(random)
        return self.value * self.together.factor


# mu_e of the canals; M^d and M^c of the joints, m.
_FRICTION = {
    "finger.tendon_friction.coulomb": 0.11,
    "finger.joint_friction.coulomb": 2.5e-4,
    "finger.joint_friction.stiction": 3.5e-4,
}


def friction(low: float, high: float) -> dict[str, Any]:
    """Return distributions of all frictions: one factor on the scenario's own, even in its logarithm."""
    together = _Together(max(low, _LEAST), max(high, _LEAST))
    return {key: _Scaled(together, value, index == 0) for index, (key, value) in enumerate(_FRICTION.items())}


#: By name, what is drawn at every reset of a training.
TRAINED = {
    "without friction": friction(0.0, 0.0),
    "at one friction": friction(1.0, 1.0),
    "with friction drawn anew": friction(0.25, 3.0),
}
#: Factors on which all policies are tried.
LEVELS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0)


def transfer(
    steps: Annotated[int, typer.Option(metavar="N", help="Control steps of each training.")] = 150_000,
    seeds: Annotated[int, typer.Option(metavar="N", help="Trainings of each kind.")] = 2,
    episodes: Annotated[int, typer.Option(metavar="N", help="Episodes of each trial.")] = 100,
    restart: Restart = False,
    output: Output = Path("results/transfer"),
) -> None:
    """Train Reach without friction, at one friction and with friction drawn anew, and try all three on other frictions.

    The same command goes on where it was interrupted.
    """
    for name, value in (("--steps", steps), ("--seeds", seeds), ("--episodes", episodes)):
        if value < 1:
            raise wrong(name, "must be above 0")
    solved = np.zeros((seeds, len(TRAINED), len(LEVELS)))
    for seed in range(seeds):
        for row, (name, drawn) in enumerate(TRAINED.items()):
            place = output / f"{name.replace(' ', '_')}_{seed + 1}"
            policy = Policy.trained(place, "Reach", steps, 32, seed + 1, restart=restart, randomise=drawn)
            for column, level in enumerate(LEVELS):
                solved[seed, row, column] = policy.evaluate("Reach", episodes, randomise=friction(level, level)).solved
    table = np.column_stack([LEVELS, *np.concatenate(np.moveaxis(solved, 1, 0))])
    header = ["friction", *(f"{name} {seed + 1}" for name in TRAINED for seed in range(seeds))]
    np.savetxt(output / "transfer.csv", table, delimiter=",", header=",".join(header), comments="")
    draw(solved, output / "transfer.png")
    width = max(map(len, TRAINED))
    lines = [f"{'friction over its own':{width}} " + " ".join(f"{level:5g}" for level in LEVELS)]
    lines += [
        f"{name:{width}} " + " ".join(f"{x:5.2f}" for x in row)
        for name, row in zip(TRAINED, solved.mean(axis=0), strict=True)
    ]
    ending = f"Part of {episodes} new episodes that end within 5 mm of the goal, mean of {seeds} trainings"
    print_text("\n".join([*lines, f"{ending}. Results are in {output}"]))


def draw(solved: Any, path: Path) -> None:
    """Write the figure: the mean over trainings, and the best and the worst of them."""
    from finger_pin.views.plots import save_figure
    from finger_pin.views.plots.style import new_figure, styled

    @styled
    def plot() -> Any:
        figure = new_figure(6.4, 3.8)
        axes = figure.subplots()
        for name, rows in zip(TRAINED, np.moveaxis(solved, 1, 0), strict=True):
            (line,) = axes.plot(LEVELS, rows.mean(axis=0), marker="o", label=f"trained {name}")
            axes.fill_between(LEVELS, rows.min(axis=0), rows.max(axis=0), color=line.get_color(), alpha=0.2, lw=0)
        axes.set(
            xlabel="friction of canals and joints, over the scenario's own",
            ylabel="episodes within 5 mm of the goal",
            ylim=(0.0, 1.02),
        )
        axes.legend()
        return figure

    save_figure(plot(), path)


main = partial(run_function, transfer)

if __name__ == "__main__":
    sys.exit(main())
