"""Can a policy learn to move a finger whose tendons rub, in seconds and with NumPy alone?

A linear policy for the task Reach-v0, from the way to the goal and the speeds of the joints to four tensions, found by
the cross-entropy method: of 48 policies, each tried on the same goals, the best ten say where to look next. For larger
ones there is scripts/train.py. Needs the extra gymnasium. Run it:
python scripts/examples/train_policy.py [FOLDER FOR THE PICTURE]
"""

import sys
from pathlib import Path

import gymnasium
import matplotlib.pyplot as plt
import numpy as np

FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "results/examples")
ROUNDS, POLICIES, BEST, GOALS, STEPS = 9, 48, 10, 4, 50  # a step is 20 ms
SPEEDS, WAY = slice(4, 8), slice(11, 14)  # of what is observed: rad/s, and m from fingertip to goal

worlds = gymnasium.make_vec("finger_pin.learning:finger_pin/Reach-v0", num_envs=POLICIES, duration=0.02 * STEPS)
low, high = worlds.action_space.low, worlds.action_space.high  # N


def tried(policies, seeds):
    """Return the mean reward of every policy, a world each, and the distances at the end of one second, m."""
    seen, _ = worlds.reset(seed=seeds)
    rewards = np.zeros(POLICIES)
    for _ in range(STEPS):
        known = np.column_stack([np.ones(POLICIES), 20.0 * seen[:, WAY], 0.1 * seen[:, SPEEDS]])
        share = 1.0 / (1.0 + np.exp(-np.einsum("paf,pf->pa", policies, known)))
        seen, reward, *_ = worlds.step(low + share * (high - low))
        rewards += reward / STEPS
    return rewards, np.linalg.norm(seen[:, WAY], axis=1)


def distances(policy):
    """Return how far from 48 new goals a policy ends, m."""
    return tried(np.tile(policy, (POLICIES, 1, 1)), [9000 + k for k in range(POLICIES)])[1]


random = np.random.default_rng(0)
middle, spread = np.zeros((4, 8)), np.full((4, 8), 2.0)
medians, before = [], distances(middle)
for k in range(ROUNDS):
    policies = middle + spread * random.standard_normal((POLICIES, 4, 8))
    rewards = sum(tried(policies, [100 * k + goal] * POLICIES)[0] for goal in range(GOALS))
    best = policies[np.argsort(rewards)[-BEST:]]
    middle, spread = best.mean(axis=0), best.std(axis=0) + 0.05
    medians.append(float(np.median(distances(middle))))
after = distances(middle)
print(
    f"{ROUNDS * POLICIES * GOALS} episodes of a second: the median distance from 48 new goals went from "
    f"{1e3 * np.median(before):.0f} mm to {1e3 * np.median(after):.0f} mm."
)

plt.style.use("finger_pin.views.plots.finger_pin")
figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.2), layout="constrained")
left.plot(range(ROUNDS + 1), 1e3 * np.array([np.median(before), *medians]), ".-")
left.set(xlabel="round", ylabel="median distance (mm)", ylim=(0.0, None))
right.hist([1e3 * before, 1e3 * after], bins=np.arange(0.0, 80.0, 5.0), label=["before", "after"])
right.set(xlabel="distance from the goal after 1 s (mm)", ylabel="goals, of 48")
right.legend()
FOLDER.mkdir(parents=True, exist_ok=True)
figure.savefig(FOLDER / "train_policy.png")
