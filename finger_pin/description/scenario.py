"""A scenario: a finger, its controller and reference, forces and objects around it, and the simulation's settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Self, TypeVar

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic_core import PydanticCustomError

from finger_pin.description.caching import cached_property
from finger_pin.description.commands import BY_NAME, BY_SOURCE
from finger_pin.description.controller import ControllerSettings, check_controller
from finger_pin.description.coupling import PassiveCoupling, slack_lengths
from finger_pin.description.effects import CLOSED_LOOP, OF_SCENARIO, idle, shown
from finger_pin.description.finger_description import FingerDescription, HandSettings
from finger_pin.description.objects import EnvironmentSettings, Object
from finger_pin.description.routing import Routing
from finger_pin.description.signals import ReferenceSettings
from finger_pin.description.simulation_settings import InitialSettings, SimulationSettings
from finger_pin.description.tables import error_of_hand, settings_of_finger
from finger_pin.description.tautness import Tautness, check_currents
from finger_pin.description.tree_parts import Keyframe
from finger_pin.description.validation import Description, Name, expand, problem, suggestion
from finger_pin.description.winding import check_sources, hand_with_winches, with_winches
from finger_pin.exceptions import InputError
from finger_pin.typing import Array

_Item = TypeVar("_Item")
_OPEN_LOOP_SETTING = 'controller.kind = "tensions"'


class Scenario(Description):
    """The whole input of a simulation.

    With a ``hand`` in place of a finger, ``finger`` is all its fingers together, and every other table is for all of
    them alike: joints and tendons have dotted names, and lists of numbers are those of each finger.
    """

    file_keys = ("extends",)

    name: Name = Field(description="Names the folder of results.")
    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    # Filled in below where there is a hand.
    finger: FingerDescription = Field(None)  # type: ignore[assignment]
    hand: HandSettings | None = Field(None, description="Several fingers on a palm, in place of a finger.")
    controller: ControllerSettings = ControllerSettings()
    reference: ReferenceSettings = ReferenceSettings()
    environment: EnvironmentSettings = EnvironmentSettings()
    simulation: SimulationSettings = SimulationSettings()

    def __repr__(self) -> str:
        """Return its name, duration and finger in a line; `to_toml` writes all of it."""
        moved = self.finger if self.hand is None else self.hand
        return f"<{type(self).__name__} {self.name}: {self.simulation.duration:g} s of {moved!r}>"

    __str__ = __repr__

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.hand is not None:
            if self.finger is not None:
                raise problem("finger", "leave it out: the hand has fingers of its own")
            settings, wound = self.controller.fingers or {}, self.controller.tendon_winding or {}
            by_finger = {
                name: [*wound, *((settings[name].tendon_winding if name in settings else None) or ())]
                for name in self.hand.fingers
            }
            object.__setattr__(self, "hand", hand_with_winches(self.hand, by_finger))
            object.__setattr__(self, "finger", self.hand.joined())
        if self.finger is None:
            raise problem("finger", "is missing: a finger, or a hand")
        if self.hand is None and self.controller.tendon_winding:
            object.__setattr__(self, "finger", with_winches(self.finger, tuple(self.controller.tendon_winding)))
        self._check_names()
        if around := self.finger.tree.objects_at(self.keyframe):
            environment = self.environment.updated(objects={**around, **(self.environment.objects or {})})
            object.__setattr__(self, "environment", environment)
        self._choose_kind()
        parts = self.parts()
        self._check_effects(parts)
        for name, part in parts.items():
            try:
                part._check()
            except PydanticCustomError as error:
                raise error_of_hand(name, error) from None
        return self

    def _choose_kind(self) -> None:
        """Choose the open loop for fingers without closed-loop settings that can run in open loop alone."""
        fingers, chosen = tuple(self.hand.fingers) if self.hand else ("",), {}
        for name in fingers:
            settings, prefix = settings_of_finger(self.controller, name), f"{name}." if name else ""
            chosen_loop = settings.model_fields_set & {"kind", *CLOSED_LOOP}
            if chosen_loop or any(key.startswith(prefix) for key in self.reference.joints):
                continue
            if (self._part(name) if name else self)._is_open():
                entries = {key: getattr(settings, key) for key in settings.model_fields_set - {"sampling", "fingers"}}
                chosen[name] = ControllerSettings().updated(**entries, kind="tensions")
        if len(chosen) == len(fingers):
            object.__setattr__(self, "controller", self.controller.updated(kind="tensions"))
        elif chosen:
            own = {**(self.controller.fingers or {}), **chosen}
            object.__setattr__(self, "controller", self.controller.updated(fingers=own))

    def _is_open(self) -> bool:
        """Return whether a finger is given tensions, or can be driven by them in open loop alone."""
        finger = self.finger
        commanded = any(getattr(self.controller, table) for table in BY_SOURCE)
        wound = commanded or any(tendon.winch for tendon in finger.tendons.values())
        if wound or finger.tree.actuators or not finger.tendons:
            return True
        routing, springs = Routing.from_description(finger), any(joint.spring for joint in finger.joints.values())
        if not springs or finger.through_space:
            return False
        return not routing.force_closure().holds and not self._tautness(routing).holds

    def _check_effects(self, parts: Mapping[str, Scenario]) -> None:
        """Refuse entries without effect on any finger of a hand, or, in a finger's own table, on that one."""
        ineffective = {name: {entry: rest for entry, *rest in idle(part, OF_SCENARIO)} for name, part in parts.items()}
        for name, entries in ineffective.items():
            settings = (self.controller.fingers or {}).get(name)
            for entry, (value, message) in entries.items():
                table, key = entry.split(".", 1)
                if settings is not None and key in settings.model_fields_set:
                    raise problem(f"{table}.fingers.{name}.{key}", message, shown(value))
                if all(entry in each for each in ineffective.values()):
                    raise problem(entry, message, shown(value))

    @model_serializer(mode="wrap")
    def _without_fingers_of_hand(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        around = table.get("environment", {}).get("objects") or {}
        for name in [name for name in around if name not in self._objects_beside_tree()]:
            del around[name]
        if not around and self.environment.objects:
            table.get("environment", {}).pop("objects", None)
        if self.hand is not None:
            table.pop("finger", None)
        return table

    def _objects_beside_tree(self) -> dict[str, Object]:
        """Return the objects of the environment without those of the tree."""
        of_tree = self.finger.tree.objects_at(self.keyframe)
        return {name: body for name, body in (self.environment.objects or {}).items() if body != of_tree.get(name)}

    def set_entries(self) -> dict[str, Any]:
        """Return the entries that were set, without the objects of the tree."""
        entries = super().set_entries()
        if "environment" in entries and self.finger.tree.objects:
            entries["environment"] = self.environment.updated(objects=self._objects_beside_tree() or None)
        return entries

    def parts(self) -> dict[str, Scenario]:
        """Return the scenarios of the fingers of a hand, each alone on the palm, by name.

        Of a finger it is the scenario itself, under no name.
        """
        if self.hand is None:
            return {"": self}
        if len(self.hand.fingers) == 1 and not (self.controller.fingers or self.environment.fingers):
            return dict.fromkeys(self.hand.fingers, self)
        return self._parts

    # Who runs it asks again for what checked it.
    @cached_property
    def _parts(self) -> dict[str, Scenario]:
        return {name: self._part(name) for name in self.hand.fingers} if self.hand else {}

    def environments(self) -> dict[str, EnvironmentSettings]:
        """Return the environments of a hand's fingers, or all tips of trees, by name; of a single one under no name."""
        shared, names = self.environment, self.finger.tree.tip_names or (self.hand.fingers if self.hand else ())
        return {name: settings_of_finger(shared, name.partition(".")[0]) for name in names} or {"": shared}

    def _part(self, name: str) -> Scenario:
        assert self.hand is not None
        alone = self.hand.updated(fingers={name: self.hand.fingers[name]}, name=name)

        def entries_of_finger(table: Mapping[str, _Item]) -> dict[str, _Item]:
            return {key: each for key, each in table.items() if key.startswith(f"{name}.")}

        controller, settings = settings_of_finger(self.controller, name), (self.controller.fingers or {}).get(name)
        for table in BY_NAME:
            if getattr(controller, table) is not None:
                # In a finger's own table its name may be left out.
                signals = (getattr(settings, table) if settings else None) or {}
                named = {f"{name}.{key.removeprefix(f'{name}.')}": each for key, each in signals.items()}
                controller = controller.updated(
                    **{table: entries_of_finger(getattr(self.controller, table) or {}) | named}
                )
        simulation, initial = self.simulation, self.simulation.initial
        if initial is not None:
            start = {entry: entries_of_finger(getattr(initial, entry)) for entry in ("position", "velocity")}
            keyframe = next(iter(entries_of_finger({initial.keyframe or "": None})), None)
            simulation = simulation.updated(initial={**start, "keyframe": keyframe})
        return self.updated(
            finger=alone.joined(),
            hand=alone,
            controller=controller,
            reference={"joints": entries_of_finger(self.reference.joints)},
            environment=settings_of_finger(self.environment, name),
            simulation=simulation,
        )

    @property
    def keyframe(self) -> Keyframe | None:
        """The posture of a tree that the run starts from, and the inputs that go with it; None without any."""
        keyframes, initial = self.finger.tree.keyframes, self.simulation.initial
        name = initial.keyframe if initial else None
        return keyframes[name] if name else next(iter(keyframes.values()), None)

    def _check_names(self) -> None:
        """Refuse a table for a joint or a finger that is not there."""
        initial = self.simulation.initial or InitialSettings()
        keyframes, joints = tuple(self.finger.tree.keyframes), tuple(self.finger.joints)
        fingers = tuple(self.hand.fingers) if self.hand else self.finger.tree.tip_names
        commanded = {
            table: [key.partition(".")[0] for key in getattr(self.controller, table) or () if self.hand]
            for table in BY_NAME
        }
        tables: dict[str, tuple[Iterable[str], str, tuple[str, ...]]] = {
            "reference.joints": (self.reference.joints, "joint", joints),
            "simulation.initial.position": (initial.position, "joint", joints),
            "simulation.initial.velocity": (initial.velocity, "joint", joints),
            "simulation.initial.keyframe": ([initial.keyframe] if initial.keyframe else (), "keyframe", keyframes),
            "controller.fingers": (self.controller.fingers or (), "finger", fingers),
            **{f"controller.{table}": (names, "finger", fingers) for table, names in commanded.items()},
            "environment.fingers": (self.environment.fingers or (), "finger", fingers),
        }
        for name, settings in (self.controller.fingers or {}).items():
            for entry in settings.model_fields_set - {"fingertip_force"} if not self.hand else ():
                raise problem(f"controller.fingers.{name}.{entry}", "is of a hand's finger; a tip has fingertip_force")
            if "sampling" in settings.model_fields_set:
                raise problem(f"controller.fingers.{name}.sampling", "is the same for all: set controller.sampling")
        for table, (names, kind, allowed) in tables.items():
            for name in names:
                if name not in allowed:
                    hint = suggestion(name, allowed)
                    missing = "there is none" if kind == "keyframe" else "there is no hand"
                    listed = f"the {kind}s are {', '.join(allowed)}" if allowed else missing
                    raise problem(f"{table}.{name}", f"no such {kind}; {listed}{hint}")

    def _check(self) -> None:
        """Refuse tables of a finger that do not fit each other."""
        check_controller(self.controller, self.finger)
        routing = Routing.from_description(self.finger)
        # Tensions in open loop are what they are; (22) needs some that can be raised without turning a joint.
        closure = routing.force_closure()
        try:
            followers = self.coupling(routing).followers
        except InputError as error:
            raise problem(error.entry, error.allowed) from None
        if self.controller.kind == "proportional" and not closure.holds and not self.finger.through_space:
            self._check_taut(routing, str(closure))
        check_sources(self.finger, self.controller.tensions or {})
        rest = self.numbers["minimum_tension"]
        if self.controller.kind == "proportional" and closure.holds:
            rest = closure.tension * np.max(rest / closure.tension)
        check_currents(self.finger.actuators, dict(zip(routing.tendons, rest, strict=True)))
        for name in self.reference.joints:
            if routing.joints.index(name) in followers:
                raise problem(f"reference.joints.{name}", "follows from the passive tendon (20); leave it out")

    def _check_taut(self, routing: Routing, missing: str) -> None:
        """Raise unless springs keep the tendons taut that (22) cannot without force closure."""
        if not any(joint.spring for joint in self.finger.joints.values()):
            allowed = f"{missing}; the controller needs force closure, {_OPEN_LOOP_SETTING} does not"
            raise problem("finger.tendons", allowed)
        tautness = self._tautness(routing)
        if not tautness.holds:
            raise problem("finger.tendons", f"{missing}, and {tautness}; {_OPEN_LOOP_SETTING} can do without")

    def _tautness(self, routing: Routing) -> Tautness:
        return Tautness.from_finger(self.finger, routing, self.coupling(routing), self.numbers["minimum_tension"])

    @property
    def numbers(self) -> dict[str, Array]:
        """Numbers of the controller as arrays of one per joint, tendon or passive tendon, by entry."""
        joints, tendons, passive = len(self.finger.joints), len(self.finger.tendons), len(self.finger.passive_names)
        sizes = {"gain": joints, "damping": joints, "minimum_tension": tendons, "passive_tension": passive}
        return {entry: expand(getattr(self.controller, entry), size) for entry, size in sizes.items()}

    def coupling(self, routing: Routing) -> PassiveCoupling:
        """Return the constraint of the passive tendons on the references (20)."""
        fingers = {"": self.finger}
        if self.hand is not None:
            fingers = {name: placed.finger for name, placed in self.hand.fingers.items()}
        wishes = [
            expand(settings_of_finger(self.controller, name).passive_tension, len(finger.passive_names))
            for name, finger in fingers.items()
        ]
        # In open loop nothing follows a reference.
        needed = self.controller.kind != "tensions"
        stretch = np.concatenate(wishes) / self.finger.numbers["passive_tendon"]["stiffness"]
        return PassiveCoupling.from_routing(routing, slack_lengths(self.finger) + stretch, needed=needed)

    def sample_times(self) -> Array:
        """Return the times of the saved signals, s: multiples of the sampling period, and the end."""
        return self.simulation.sample_times()
