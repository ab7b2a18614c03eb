"""Train a policy on a task that ships, with stable-baselines3, and draw how it learns."""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from finger_pin.commands.application import run_function
from finger_pin.commands.console import print_text
from finger_pin.commands.options import Output, Restart, invalid

# Proximal policy optimisation: small batches learn more of a step than it costs to take another.
SETTINGS = {"batch_size": 160, "n_epochs": 10, "gae_lambda": 0.9}
_HIDDEN, _RATE, _LEAST_RATE = [128, 128], 1e-3, 5e-5
#: Columns of the curve: steps, processor time of training, s, and the mean reward per step of the last episodes.
COLUMNS = ("steps", "seconds", "reward")


class Training(NamedTuple):
    """The settings of a training.

    Attributes:
        steps: Control steps of all worlds together.
        rollout: Steps of each world between improvements of the policy.
        spread: Logarithm of the first standard deviation of actions, over half their range.
        discount: Worth of a reward a step later.
    """

    steps: int
    rollout: int
    spread: float
    discount: float = 0.9


TRAININGS = {"Reach": Training(100_000, 50, -1.0), "Press": Training(400_000, 50, -2.0)}
TRAININGS["Grasp"] = Training(80_000, 50, -2.0)


class Goal(NamedTuple):
    """The criterion of a solved task: a small observed error, averaged over the last part of an episode, `_LAST`.

    Attributes:
        columns: Of the observation, where the error stands.
        within: Largest error of a solved episode, SI.
        scale, unit: To print it.
    """

    columns: slice
    within: float
    scale: float
    unit: str


GOALS = {
    "Reach": Goal(slice(11, 14), 5e-3, 1e3, "mm"),
    "Press": Goal(slice(-2, -1), 0.3, 1.0, "N"),
    "Grasp": Goal(slice(-3, None), 5e-3, 1e3, "mm"),
}
_LAST = 0.25


class Found(NamedTuple):
    """The scores of a policy in new episodes: mean reward per step, share solved, median of the last error."""

    reward: float
    solved: float
    error: float


def train(
    task: Annotated[str, typer.Argument(metavar="TASK", help="Reach, Press or Grasp.")] = "Reach",
    steps: Annotated[
        int | None, typer.Option(metavar="N", help="Control steps of all worlds; by default its own.")
    ] = None,
    worlds: Annotated[int, typer.Option(metavar="N", help="Worlds side by side.")] = 32,
    seed: Annotated[int, typer.Option(metavar="N", help="Of everything that is drawn.")] = 1,
    restart: Restart = False,
    output: Output = Path("results/policies"),
) -> None:
    """Train a policy on a task that ships, and draw how all that were trained so far learn.

    Ctrl-C keeps the policy so far, and the same command goes on with it.
    """
    if task not in GOALS:
        raise invalid("TASK", f"{task}: must be Reach, Press or Grasp")
    training = TRAININGS[task] if steps is None else TRAININGS[task]._replace(steps=steps)
    for name, value in (("--steps", training.steps), ("--worlds", worlds)):
        if value < 1:
            raise invalid(name, "must be above 0")
    folder = output / task.lower()
    policy = Policy.trained(folder, task, training, worlds, seed, restart=restart)
    found, goal = policy.evaluate(task, episodes=100), GOALS[task]
    draw_curves(output, output / "curves.png")
    text = f"{task}: of 100 new episodes {100.0 * found.solved:.0f} end within {goal.scale * goal.within:g} {goal.unit}"
    text += f" (median {goal.scale * found.error:.2g} {goal.unit}); reward {found.reward:.3f} a step, 1 at best"
    print_text(f"{text}. Results are in {folder}")


class Policy:
    """A policy and its training.

    Attributes:
        model: Of stable-baselines3.
        folder: With ``policy.zip``, ``normalisation.pkl`` and ``curve.csv``.
    """

    def __init__(self, model: Any, folder: Path) -> None:
        """Keep them."""
        self.model, self.folder = model, folder

    @classmethod
    def trained(
        cls,
        folder: Path,
        task: str,
        training: Training,
        worlds: int,
        seed: int,
        *,
        restart: bool = False,
        **fields: Any,
    ) -> Policy:
        """Return a policy that has made some steps, of which those that a folder has kept count.

        Args:
            folder: Folder in which it is kept, again and again.
            task: Name.
            training: Settings of the training.
            worlds: Number of worlds.
            seed: Of everything that is drawn.
            restart: Whether to forget what the folder has kept.
            fields: Of the task, in place of its own.
        """
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

        # Two threads step the worlds; more for networks of this size only get in their way.
        torch.set_num_threads(1)
        folder.mkdir(parents=True, exist_ok=True)
        kept = [folder / name for name in ("policy.zip", "normalisation.pkl", "curve.csv")]
        monitored = VecMonitor(build_worlds(task, worlds, **fields))
        if restart or not all(path.exists() for path in kept):
            environment = VecNormalize(monitored, gamma=training.discount)
            network = {"net_arch": _HIDDEN, "log_std_init": training.spread}
            own: dict[str, Any] = {
                "policy_kwargs": network,
                "n_steps": training.rollout,
                "learning_rate": falling_rate,
                "gamma": training.discount,
            }
            model = PPO("MlpPolicy", environment, seed=seed, device="cpu", **SETTINGS, **own)
            curve: list[tuple[float, ...]] = []
        else:
            environment = VecNormalize.load(str(kept[1]), monitored)
            model = PPO.load(kept[0], environment, device="cpu")
            curve = [tuple(row) for row in np.atleast_2d(np.loadtxt(kept[2], delimiter=",", skiprows=1)).tolist()]
        keeper = build_keeper(curve, kept)
        try:
            model.learn(max(training.steps - model.num_timesteps, 0), keeper, reset_num_timesteps=False)
        finally:
            keeper.keep()
            environment.close()
        return cls(model, folder)

    def evaluate(self, task: str, episodes: int, **fields: Any) -> Found:
        """Return the scores of the policy in new episodes, without exploration.

        Args:
            task: Name.
            episodes: Number of episodes, with the same seeds at every call.
            fields: Of the task, in place of its own.
        """
        from stable_baselines3.common.vec_env import VecNormalize

        environment = VecNormalize.load(str(self.folder / "normalisation.pkl"), build_worlds(task, episodes, **fields))
        environment.training = environment.norm_reward = False
        environment.seed(10_000)
        seen, rewards, errors = environment.reset(), [], []
        going, lost = np.ones(episodes, dtype=bool), np.zeros(episodes, dtype=bool)
        while going.any():
            raw = np.asarray(environment.get_original_obs())
            errors.append(np.linalg.norm(raw[:, GOALS[task].columns], axis=1))
            action, _ = self.model.predict(seen, deterministic=True)
            seen, reward, over, info = environment.step(action)
            rewards.append(np.where(going, reward, np.nan))
            # Episodes that end before their time have failed.
            lost |= [going[i] and over[i] and not info[i]["TimeLimit.truncated"] for i in range(episodes)]
            going &= ~over
        environment.close()
        last = np.where(lost, np.inf, np.mean(errors[-max(round(_LAST * len(errors)), 1) :], axis=0))
        return Found(float(np.nanmean(rewards)), float(np.mean(last < GOALS[task].within)), float(np.median(last)))


def falling_rate(left: float) -> float:
    """Return the learning rate where so much of the training is left, from 1 to 0."""
    return max(_RATE * left, _LEAST_RATE)


def build_worlds(task: str, count: int, **fields: Any) -> Any:
    """Return worlds of a task as stable-baselines3 takes them."""
    try:
        from finger_pin.learning.stable_baselines import StableBaselinesEnvironment
    except ModuleNotFoundError as error:
        raise invalid("train", f"needs {error.name}: python -m pip install stable-baselines3") from None
    from finger_pin.learning.tasks import make_vector

    return StableBaselinesEnvironment(make_vector(f"{task}-v0", count, **fields))


def build_keeper(curve: list[tuple[float, ...]], kept: list[Path]) -> Any:
    """Return the callback that keeps policy and curve now and then, and prints progress."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Keeper(BaseCallback):
        def __init__(self) -> None:
            super().__init__()
            self.before, self.began = curve[-1][1] if curve else 0.0, time.process_time()

        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            last = self.model.ep_info_buffer
            if not last:
                return
            reward = float(np.sum([each["r"] for each in last]) / np.sum([each["l"] for each in last]))
            curve.append((self.num_timesteps, self.before + time.process_time() - self.began, reward))
            if sys.stderr.isatty():
                print(
                    f"\r{self.num_timesteps:9d} steps, {curve[-1][1]:5.0f} s, reward {reward:.3f}",
                    end="",
                    file=sys.stderr,
                )
            if len(curve) % 10 == 0:
                self.keep()

        def keep(self) -> None:
            self.model.save(kept[0])
            self.model.get_env().save(str(kept[1]))
            np.savetxt(
                kept[2], np.reshape(curve, (-1, len(COLUMNS))), delimiter=",", header=",".join(COLUMNS), comments=""
            )

    return Keeper()


def draw_curves(output: Path, path: Path) -> None:
    """Write the figure of all curves that a folder keeps."""
    from finger_pin.views.plots import save_figure
    from finger_pin.views.plots.style import new_figure, styled

    @styled
    def plot() -> Any:
        figure = new_figure(6.4, 3.6)
        axes = figure.subplots()
        for task in GOALS:
            kept = output / task.lower() / "curve.csv"
            if kept.exists():
                steps, seconds, reward = np.loadtxt(kept, delimiter=",", skiprows=1, ndmin=2).T
                axes.plot(seconds / 60.0, reward, label=f"{task}: {int(steps[-1]):,} steps")
        axes.set(xlabel="processor time of training (min)", ylabel="reward per step", ylim=(0.0, 1.0), xlim=(0.0, None))
        axes.legend(loc="lower right")
        return figure

    save_figure(plot(), path)


main = partial(run_function, train)

if __name__ == "__main__":
    sys.exit(main())
