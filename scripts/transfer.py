"""Transfer of policies over friction, slack and servos: trained without, at one value, or with them drawn anew."""

from __future__ import annotations

import csv
import sys
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from train import TRAININGS, Policy, Training

from finger_pin.commands.application import run_function
from finger_pin.commands.console import print_text
from finger_pin.commands.options import Output, Restart, invalid

# No friction at all has no bristles to speak of; a thousandth has none that matter.
_LEAST = 1e-3
# mu_e of the canals; M^d and M^c of the joints, m.
_FRICTION = {
    "finger.tendon_friction.coulomb": 0.11,
    "finger.joint_friction.coulomb": 2.5e-4,
    "finger.joint_friction.stiction": 3.5e-4,
}
# Servos are told that their tendons are as short as this tension makes them, N; at 20 N/mm that is 2 mm.
_TOLD, _STIFFNESS = 40.0, 20.0
_PRETENSION = "finger.actuators.*.pretension"
_GAIN, _PROPORTIONAL = "finger.actuators.*.position_loop.proportional", 9.2
_VOLTAGE = "finger.actuators.*.motor.voltage"
# Goals beyond the joints' ranges wind in what is slack, rad.
_BEYOND = (0.15, 0.3, 0.3)
# Period of the servos' own loops, s: shorter ones take longer to simulate, and lead to the same places.
_SAMPLING = 0.002


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


def friction(low: float, high: float) -> dict[str, Any]:
    """Return distributions of all frictions: one factor on the scenario's own, even in its logarithm."""
    together = _Together(max(low, _LEAST), max(high, _LEAST))
    return {key: _Scaled(together, value, index == 0) for index, (key, value) in enumerate(_FRICTION.items())}


def slack(low: float, high: float) -> dict[str, Any]:
    """Return the distribution of the tendons' length beyond the one that servos assume, mm."""
    from finger_pin.learning import Uniform

    return {_PRETENSION: Uniform(_TOLD - _STIFFNESS * high, _TOLD - _STIFFNESS * low)}


def gain(low: float, high: float) -> dict[str, Any]:
    """Return the distribution of the servos' gain: a factor on their own, even in its logarithm."""
    from finger_pin.learning import LogUniform

    return {_GAIN: LogUniform(_PROPORTIONAL * low, _PROPORTIONAL * high)}


class Study(NamedTuple):
    """Policies, and the numbers that they are tried on.

    Attributes:
        task: Fields of Reach, in place of its own.
        training: Of every policy.
        trained: By name, what is drawn at every reset of a training.
        tried: By what is varied, the values, and what makes it one.
    """

    task: dict[str, Any]
    training: Training
    trained: dict[str, dict[str, Any]]
    tried: dict[str, tuple[tuple[float, ...], Any]]


_WITHOUT, _ONE, _ANEW = "without friction", "at one friction", "with all drawn anew"
_FACTORS = "friction over its own", (0.0, 1.0, 2.0, 3.0)


def studies() -> dict[str, Study]:
    """Return the studies by how the finger is driven."""
    from finger_pin.description.loading import load_scenario
    from finger_pin.learning import Sensor, Uniform
    from finger_pin.learning.tasks import COARSE_TOLERANCES, TASKS

    own = TASKS["Reach-v0"]()
    told: dict[str, Any] = {}
    for motor in ("M1", "M2", "M3", "M4"):
        told[f"finger.actuators.{motor}.pretension"] = _TOLD
        told[f"finger.actuators.{motor}.position_loop.period"] = _SAMPLING
    low, high = np.array([-0.175, 0.0, 0.0]), np.array([0.175, 1.571, 1.571])
    servos = {
        "scenario": load_scenario("servo_position", {**COARSE_TOLERANCES, **told}),
        "action": "joint_position",
        "limits": (low - np.array(_BEYOND), high + np.array(_BEYOND)),
        # Servos take 0.3 s to a goal; how far they have wound says what was asked before.
        "period": 0.1,
        "duration": 1.0,
        "observation": {**own["observation"], "motor_position": Sensor()},
    }
    anew = {**friction(0.25, 3.0), **slack(0.0, 1.0), **gain(0.2, 2.0), _VOLTAGE: Uniform(3.5, 6.0)}
    label, factors = _FACTORS
    return {
        "tensions": Study(
            {},
            TRAININGS["Reach"]._replace(steps=150_000),
            {_WITHOUT: friction(0.0, 0.0), _ONE: friction(1.0, 1.0), _ANEW: friction(0.25, 3.0)},
            {label: (factors, friction)},
        ),
        "servos": Study(
            servos,
            Training(40_000, 20, -2.0, 0.8),
            {_WITHOUT: friction(0.0, 0.0), _ONE: friction(1.0, 1.0), _ANEW: anew},
            {
                label: ((0.0, 1.0, 3.0), friction),
                "slack (mm)": ((0.0, 0.5, 1.0), slack),
                "gain over its own": ((0.2, 1.0, 2.0), gain),
            },
        ),
    }


class Trial(NamedTuple):
    """A policy tried at one value of a number, and its score.

    Attributes:
        driven: The study.
        trained: Friction that it was trained on.
        seed: Seed of the training.
        steps: Steps of the training.
        varied: Key of the varied number.
        value: Its value.
        episodes: Number of episodes tried.
        solved: The part of them that ended within 5 mm.
    """

    driven: str
    trained: str
    seed: int
    steps: int
    varied: str
    value: float
    episodes: int
    solved: float


def read_trials(path: Path) -> list[Trial]:
    """Return the trials that a file keeps; none if there is no file."""
    if not path.exists():
        return []
    kinds = (str, str, int, int, str, float, int, float)
    with open(path, newline="", encoding="utf-8") as file:
        _, *rows = csv.reader(file)
    return [Trial(*(kind(text) for kind, text in zip(kinds, row, strict=True))) for row in rows]


def transfer(
    driven: Annotated[str, typer.Option(metavar="HOW", help="By tensions, servos or both.")] = "both",
    steps: Annotated[int | None, typer.Option(metavar="N", help="Control steps of each training.")] = None,
    seeds: Annotated[int, typer.Option(metavar="N", help="Trainings of each kind.")] = 1,
    episodes: Annotated[int, typer.Option(metavar="N", help="Episodes of each trial.")] = 100,
    restart: Restart = False,
    output: Output = Path("results/transfer"),
) -> None:
    """Train Reach without friction, at one friction and with all drawn anew; try each on other numbers.

    The same command goes on where it was interrupted.
    """
    if driven not in ("tensions", "servos", "both"):
        raise invalid("--driven", f"{driven}: must be tensions, servos or both")
    for name, value in (("--steps", steps or 1), ("--seeds", seeds), ("--episodes", episodes)):
        if value < 1:
            raise invalid(name, "must be above 0")
    chosen = {name: study for name, study in studies().items() if driven in (name, "both")}
    output.mkdir(parents=True, exist_ok=True)
    path, trials = output / "transfer.csv", dict[tuple[Any, ...], Trial]()
    for trial in [] if restart else read_trials(path):
        trials[trial[:-1]] = trial
    for seed in range(1, seeds + 1):
        for name, study in chosen.items():
            training = study.training if steps is None else study.training._replace(steps=steps)
            for trained in study.trained:
                place = output / f"{name}_{trained.replace(' ', '_')}_{seed}"
                tried = _Tried(name, study._replace(training=training), trained, seed, episodes, place)
                for trial in tried.missing(trials, restart=restart):
                    trials[trial[:-1]] = trial
                    with open(path, "w", newline="", encoding="utf-8") as file:
                        csv.writer(file).writerows([Trial._fields, *trials.values()])
    lengths = {name: steps or study.training.steps for name, study in chosen.items()}
    wanted = [
        trial
        for trial in trials.values()
        if trial.steps == lengths.get(trial.driven) and trial.seed <= seeds and trial.episodes == episodes
    ]
    draw(chosen, wanted, output / "transfer.png")
    ending = f"Part of {episodes} new episodes that end within 5 mm of the goal, mean of {seeds} trainings"
    print_text("\n".join([*_table(chosen, wanted), f"{ending}. Results are in {output}"]))


class _Tried(NamedTuple):
    """A policy that is tried: of a study, trained in one way, by one seed, kept at a place."""

    driven: str
    study: Study
    trained: str
    seed: int
    episodes: int
    place: Path

    def missing(self, kept: Collection[tuple[Any, ...]], *, restart: bool) -> Iterator[Trial]:
        """Train the policy unless that is done, and yield the trials that are not kept."""
        study, policy = self.study, None
        for varied, (values, make) in study.tried.items():
            for value in values:
                of = self.driven, self.trained, self.seed, study.training.steps, varied, value, self.episodes
                if of in kept:
                    continue
                drawn = {**study.task, "randomise": study.trained[self.trained]}
                policy = policy or Policy.trained(
                    self.place, "Reach", study.training, 32, self.seed, restart=restart, **drawn
                )
                found = policy.evaluate("Reach", self.episodes, **{**study.task, "randomise": make(value, value)})
                yield Trial(*of, found.solved)


def _solved(trials: list[Trial], *which: str) -> tuple[Any, Any]:
    """Return values and the share solved there by each seed, shapes (k,) and (seeds, k)."""
    own = [trial for trial in trials if (trial.driven, trial.varied, trial.trained) == which]
    seeds = dict.fromkeys(trial.seed for trial in own)
    rows = [[trial.solved for trial in own if trial.seed == seed] for seed in seeds]
    return np.array([trial.value for trial in own if trial.seed == own[0].seed]), np.array(rows)


def _table(chosen: Mapping[str, Study], trials: list[Trial]) -> Iterator[str]:
    """Yield the means over seeds as text."""
    width = max(map(len, (_WITHOUT, _ONE, _ANEW))) + len("trained ")
    for name, study in chosen.items():
        for varied, (values, _) in study.tried.items():
            yield f"by {name}: {varied}"
            yield f"{'':{width}} " + " ".join(f"{value:5g}" for value in values)
            for trained in study.trained:
                mean = _solved(trials, name, varied, trained)[1].mean(axis=0)
                yield f"{'trained ' + trained:{width}} " + " ".join(f"{each:5.2f}" for each in mean)


def draw(chosen: Mapping[str, Study], trials: list[Trial], path: Path) -> None:
    """Write the figure: the mean over trainings, and the best and the worst of them."""
    from finger_pin.views.plots import save_figure
    from finger_pin.views.plots.style import new_figure, styled

    panels = [(name, varied) for name, study in chosen.items() for varied in study.tried]

    @styled
    def plot() -> Any:
        figure = new_figure(2.6 * len(panels) + 1.0, 3.4)
        places = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axes, (name, varied) in zip(places, panels, strict=True):
            for trained in chosen[name].trained:
                values, rows = _solved(trials, name, varied, trained)
                (line,) = axes.plot(values, rows.mean(axis=0), marker="o", label=f"trained {trained}")
                axes.fill_between(values, rows.min(axis=0), rows.max(axis=0), color=line.get_color(), alpha=0.2, lw=0)
            axes.set(xlabel=varied, ylim=(0.0, 1.02), title=f"by {name}")
        places[0].set_ylabel("episodes within 5 mm of the goal")
        places[-1].legend()
        return figure

    save_figure(plot(), path)


main = partial(run_function, transfer)

if __name__ == "__main__":
    sys.exit(main())
