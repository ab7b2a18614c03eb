"""The table of doors: every check of random models, with the kinds of models that it is for and what it leaves out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import random_doors as doors
import random_mujoco as in_mujoco
import random_runs as runs
import random_statics as statics
from random_models import RandomModel, random_model

from finger_pin.exceptions import FingerPinError


class Door(NamedTuple):
    """A check of random models.

    Attributes:
        check: Raises where a model fails.
        kinds: Of the models that it is for; all if empty.
        without: Features that its models have not.
    """

    check: Callable[[RandomModel], None]
    kinds: tuple[str, ...] = ()
    without: tuple[str, ...] = ()

    def model(self, seed: int) -> RandomModel:
        """Return the model of a seed, of one of the kinds."""
        return random_model(seed, self.without, self.kinds[seed % len(self.kinds)] if self.kinds else None)

    def fails(self, model: RandomModel) -> str:
        """Return why a model fails, in one line, or nothing."""
        try:
            self.check(model)
        except Exception as error:
            # A cord that is pulled against a jump of its length swings there without end, which the run says.
            # Solids may be drawn into each other, there or where a `Simulator` starts, which is refused.
            said = ("the length of a cord jumps", "deep in each other, at most")
            if isinstance(error, FingerPinError) and any(each in str(error) for each in said):
                return ""
            return f"{type(error).__name__}: {error}".splitlines()[0]
        return ""

    def smallest(self, model: RandomModel) -> RandomModel:
        """Return the model with as few of its features as fail by the same kind of error."""
        kind, _, _ = self.fails(model).partition(":")
        for feature in model.features:
            fewer = model.without(feature)
            if self.fails(fewer).partition(":")[0] == kind:
                return self.smallest(fewer)
        return model


# Objects among the coordinates, and what moves along paths, are not in MuJoCo's file, or as soft constraints; servos
# and winches are not, either, and delays are of steps.
_NOT_IN_MUJOCO = (
    *("servo", "play", "position drive", "winch", "maximum tension", "delay", "slew", "moved object", "free object"),
    *("fixed object", "joint path", "coupling", "tendon coupling", "loop", "tendon range"),
)
# Its file lacks hysteresis, and damps cords with slack at any length, as it says; inputs are held there. An integral
# may push a cord, which has no tension then.
_NOT_RUBBING_IN_MUJOCO = (
    *_NOT_IN_MUJOCO,
    *("spring hysteresis", "cord", "integral", "integrator", "swinging inputs", "start time", "tip force", "palm path"),
)
# What is not given by held inputs of a step: swings, goals of position loops, and paths from a time on.
_NOT_HELD = ("swinging inputs", "position drive", "moved object", "joint path", "palm path", "start time")
# What friction at rest, and a cord that slides one way, leave open; what moves by itself.
_NOT_SETTLED = (
    *("passive tendon", "servo", "play", "position drive", "winch", "maximum tension", "spring hysteresis", "slides"),
    *("joint friction", "joint drag", "one per joint", "swinging inputs", "start time", "cord", "wraps", "pulleys"),
    *("sum of joints", "tendon range", "joint path", "coupling", "loop", "motor", "joint servo", "lag", "integrator"),
    *("integral", "slew", "delay", "muscle", "fixed object", "free object", "moved object", "keyframe"),
    *("tendon coupling", "coupled tendons", "wrench"),
)
# What is more than tensions that are held: recordings give those alone.
_NOT_RECORDED = ("servo", "play", "position drive", "winch", "passive tendon", *_NOT_HELD)
DOORS: dict[str, Door] = {
    "readable = compiled": Door(doors.readable_is_compiled),
    "Jacobian = differences": Door(doors.jacobian_is_that_of_differences),
    "rigid body = energies": Door(doors.rigid_body_is_that_of_energies),
    "linearise = differences": Door(doors.linearisation_is_that_of_differences),
    # What turns with a body has no energy.
    "equilibrium rests": Door(doors.equilibrium_is_at_rest, without=("wrench",)),
    "URDF read = body": Door(doors.urdf_is_read_as_the_same_body),
    "account": Door(runs.account_closes),
    "prepared = fresh": Door(runs.prepared_is_fresh),
    "resumed = whole": Door(runs.resumed_is_whole),
    "Simulator = simulate": Door(runs.simulator_is_simulate, without=_NOT_HELD),
    "simulate_many = simulate": Door(runs.simulate_many_is_simulate),
    # A winch and a servo in position drive have actions of other kinds.
    "environment = Simulator": Door(runs.environment_is_simulator, without=("winch", *_NOT_HELD)),
    "renamed": Door(runs.names_do_not_matter),
    "numbers one by one": Door(runs.numbers_may_be_written_one_by_one),
    # A clock that begins at zero knows of no command before, one that is ahead does.
    "clock ahead": Door(runs.clock_does_not_matter, without=("delay",)),
    "other order": Door(runs.order_does_not_matter, ("tree",), ("any order",)),
    "mirror image": Door(runs.mirror_image_moves_alike, ("tree",)),
    # The load of a pin on the base counts the base's own x axis as the link before it.
    "turned as a whole": Door(runs.place_in_the_world_does_not_matter, ("tree",), ("tip force",)),
    "welded halves": Door(runs.welded_halves_are_one_body, ("tree",)),
    "palm askew = weight askew": Door(runs.palm_askew_is_weight_askew, ("hand",), ("palm path",)),
    "MuJoCo": Door(runs.mujoco_accelerates_alike, ("tree",), _NOT_IN_MUJOCO),
    # Even seeds are of both kinds as well.
    "slow pull = settled": Door(
        statics.slow_pulls_end_where_friction_lets_a_finger_settle, ("finger", "tree", "tree", "finger"), _NOT_SETTLED
    ),
    "linearise over a step = differences": Door(statics.step_map_is_that_of_differences, ("finger",), _NOT_HELD),
    "friction in MuJoCo's step": Door(in_mujoco.mujoco_rubs_alike, ("tree",), _NOT_RUBBING_IN_MUJOCO),
    "fit in any order": Door(statics.order_of_a_fit_does_not_matter, ("finger",), _NOT_RECORDED),
    "on a palm = alone": Door(runs.palm_does_not_matter, ("tree",), ("fixed object", "free object", "moved object")),
}
