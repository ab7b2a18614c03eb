"""What a policy knows of friction: trained without, with one friction, and with friction drawn anew; tried on all."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from train import Policy

from finger_pin.commands.application import run_function
from finger_pin.commands.console import print_text
from finger_pin.commands.options import Output, Restart

CANAL, PIN, BREAK = (
    "finger.tendon_friction.coulomb",
    "finger.joint_friction.coulomb",
    "finger.joint_friction.stiction",
)
# The scenario's own friction: mu_e, and M^d and M^c of the joints, m.
OWN = {CANAL: 0.11, PIN: 2.5e-4, BREAK: 3.5e-4}
#: Friction on which policies are tried, over the scenario's own.
LEVELS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0)
# No friction at all has no bristles to speak of; a thousandth has none that matter.
_LEAST = 1e-3


class Together:
    """A factor on all frictions: the first key draws it, the others follow."""

    def __init__(self, low: float, high: float) -> None:
        """Take its bounds."""
        self.low, self.high, self._factor = low, high, 1.0

    def of(self, value: float, *, first: bool) -> Any:
        """Return the distribution of a number that the factor is of."""
        owner = self

        class Follower:
            def draw(self, random: np.random.Generator) -> float:
                if first:
                    owner._factor = float(np.exp(random.uniform(np.log(owner.low), np.log(owner.high))))
                return value * owner._factor

        return Follower()


def friction(low: float, high: float) -> dict[str, Any]:
    """Return distributions of all frictions, which are some factor between two times the scenario's own."""
    factor = Together(max(low, _LEAST), max(high, _LEAST))
    return {key: factor.of(value, first=index == 0) for index, (key, value) in enumerate(OWN.items())}


#: How policies are trained: bounds of the factor.
TRAINED = {"without friction": (0.0, 0.0), "at one friction": (1.0, 1.0), "friction drawn anew": (0.25, 3.0)}


def transfer(
    steps: Annotated[int, typer.Option(metavar="N", help="Control steps of each training.")] = 400_000,
    episodes: Annotated[int, typer.Option(metavar="N", help="Episodes of each trial.")] = 100,
    restart: Restart = False,
    output: Output = Path("results/transfer"),
) -> None:
    """Train Reach without friction, at one friction and with friction drawn anew, and try all three on other frictions.

    The same command goes on where it was interrupted.
    """
    rewards = np.zeros((len(TRAINED), len(LEVELS)))
    for row, (name, bounds) in enumerate(TRAINED.items()):
        folder = output / name.replace(" ", "_")
        policy = Policy.trained(folder, "Reach", steps, 32, 1, restart=restart, randomise=friction(*bounds))
        for column, level in enumerate(LEVELS):
            rewards[row, column] = policy.evaluate("Reach", episodes, randomise=friction(level, level))
    table = np.column_stack([LEVELS, rewards.T])
    np.savetxt(output / "transfer.csv", table, delimiter=",", header=",".join(["friction", *TRAINED]), comments="")
    draw(rewards, output / "transfer.png")
    width = max(map(len, TRAINED))
    lines = [f"{'friction over its own':{width}} " + " ".join(f"{level:6g}" for level in LEVELS)]
    lines += [
        f"{name:{width}} " + " ".join(f"{x:6.3f}" for x in row) for name, row in zip(TRAINED, rewards, strict=True)
    ]
    print_text("\n".join([*lines, f"Reward per step, 1 at best. Results are in {output}"]))


def draw(rewards: Any, path: Path) -> None:
    """Write the figure."""
    from finger_pin.views.plots import save_figure
    from finger_pin.views.plots.style import new_figure, styled

    @styled
    def plot() -> Any:
        figure = new_figure(6.4, 3.8)
        axes = figure.subplots()
        for name, row in zip(TRAINED, rewards, strict=True):
            axes.plot(LEVELS, row, marker="o", label=f"trained {name}" if name[0] in "wa" else f"trained with {name}")
        axes.set(
            xlabel="friction of canals and joints, over the scenario's own", ylabel="reward per step", ylim=(0.0, 1.0)
        )
        axes.legend()
        return figure

    save_figure(plot(), path)


main = partial(run_function, transfer)

if __name__ == "__main__":
    sys.exit(main())
