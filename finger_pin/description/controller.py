"""The controller as data: the paper's (19)-(22), compensations of its errors, and its sampling."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_serializer, field_validator

from finger_pin.description.commands import BY_NAME
from finger_pin.description.fields import flatten, unflatten
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.signals import ForceSignal, InputSignal, SpoolAngle, VoltageSignal, WoundLength, check_axes
from finger_pin.description.tables import dump_set_fields
from finger_pin.description.validation import (
    Description,
    FullName,
    Name,
    Numbers,
    check_size,
    choice,
    expand,
    problem,
    quantity,
    real,
    reals,
    suggestion,
)
from finger_pin.description.winding import check_supplies, check_winding

# Entries of the controller and of its tables that may be lists, and what these are of.
_LISTS = (
    ("", "joint", ("gain", "damping")),
    ("", "tendon", ("minimum_tension",)),
    ("", "passive tendon", ("passive_tension",)),
    ("tendon_friction_feedforward", "tendon", ("coulomb", "stiction_ratio")),
    ("joint_friction_compensation", "joint", ("coulomb", "stiction", "viscous")),
    ("distribution", "tendon", ("maximum_tension",)),
)
Share = Annotated[float, real(0.0, 2.0)]


class TendonFeedforwardSettings(Description):
    """Tendon friction by (9) and (16), added to the commands; entries left out are those of the finger."""

    share: Share = quantity(1.0, unit="1", source="chosen", doc="Part of the expected friction that is compensated.")
    reversal_speed: Annotated[float, real(0.0, 10.0, above=True)] = quantity(
        1e-3, unit="m/s", source="chosen", doc="Desired tendon velocity below which a reversal is smoothed."
    )
    coulomb: Annotated[Numbers, reals(0.0, 10.0)] | None = quantity(
        None, unit="1", source="finger.tendon_friction", doc="mu_e as the controller estimates it."
    )
    stiction_ratio: Annotated[Numbers, reals(1.0, 100.0)] | None = quantity(
        None, unit="1", source="finger.tendon_friction", doc="rho as the controller estimates it."
    )


class JointCompensationSettings(Description):
    """Joint friction by (9) and (17), added to the torque; entries left out are those of the finger."""

    share: Share = quantity(1.0, unit="1", source="chosen", doc="Part of the expected friction that is compensated.")
    reversal_speed: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        0.1, unit="rad/s", source="chosen", doc="Desired joint velocity below which a reversal is smoothed."
    )
    coulomb: Annotated[Numbers, reals(0.0, 0.1)] | None = quantity(
        None, unit="m", source="finger.joint_friction", doc="M^d as the controller estimates it."
    )
    stiction: Annotated[Numbers, reals(0.0, 0.1)] | None = quantity(
        None, unit="m", source="finger.joint_friction", doc="M^c as the controller estimates it."
    )
    viscous: Annotated[Numbers, reals(0.0, 1e6)] | None = quantity(
        None, unit="N m s/rad", source="finger.joint_friction", doc="b as the controller estimates it."
    )


class PassiveTensionSettings(Description):
    """A loop from the measured passive tension to the internal tension; its set point is controller.passive_tension."""

    proportional: Annotated[float, real(0.0, 10.0)] = quantity(
        0.0, unit="1", source="chosen", doc="k_P, change of the planned tension over the error of the measured one."
    )
    integral: Annotated[float, real(0.0, 1e4)] = quantity(
        10.0, unit="1/s", source="chosen", doc="k_I, gain of the integral of that error."
    )
    limit: Annotated[float, real(0.0, 1e5)] = quantity(
        5.0, unit="N", source="chosen", doc="Largest correction of the planned tension by the integral."
    )


class DistributionSettings(Description):
    """Tensions from a quadratic programme with limits, in place of the pseudo-inverse (21), (22)."""

    maximum_tension: Annotated[Numbers, reals(0.0, 1e5, above=True)] = quantity(
        ..., unit="N", source="design", doc="Most planned tension, one number or one per tendon."
    )


class SamplingSettings(Description):
    """Execution on a computer: sampled and held, late, from sensors that are not perfect."""

    period: Annotated[float, real(1e-7, 10.0)] = quantity(1e-3, unit="s", source="chosen", doc="From sample to sample.")
    delay: Annotated[float, real(0.0, 10.0)] = quantity(
        0.0, unit="s", source="chosen", doc="From a sample to the instant at which its tensions act."
    )
    encoder_resolution: Annotated[float, real(0.0, 10.0)] = quantity(
        0.0, unit="rad", source="chosen", doc="Step of the measured angles; 0: exact angles and velocities."
    )
    tension_noise: Annotated[float, real(0.0, 1e5)] = quantity(
        0.0, unit="N", source="chosen", doc="Standard deviation of the tension sensors."
    )
    seed: int = Field(0, ge=0, le=2**63 - 1, strict=True, description="Of the noise.")


class ControllerSettings(Description):
    """The paper's controller (19)-(22), with the compensations and limits that a table or entry asks for.

    With ``kind = "tensions"`` the tensions are given over time instead. That is also the default where nothing is said
    of a closed loop (no gain or other entry of it, and no reference) and there is no other way: tensions or windings
    are given, a tree has actuators, or tensions cannot hold the finger at every posture, but its joints have springs.
    In a file, ``file`` then names a CSV file: its columns are ``time``, actuated tendons, N, and actuators of a tree,
    and become samples of ``tensions`` and ``inputs``; those called ``spool_angle.NAME``, ``tendon_winding.NAME`` and
    ``motor_voltage.NAME`` are samples of these, as is ``supply_voltage.NAME``. Entries of these tables stand on top.

    In a hand it is the controller of every finger, with what the finger's table in ``fingers`` has on top; only
    ``sampling`` is the same for all.
    """

    file_keys = ("file",)

    kind: Annotated[Literal["proportional", "tensions"], choice("proportional", "tensions")] = quantity(
        "proportional",
        unit="1",
        source="(19)",
        doc="Which controller; tensions: open loop, chosen by itself where springs alone return the joints.",
    )
    tensions: dict[FullName, ForceSignal] | None = Field(
        None, description="By actuated tendon; one without a signal is held at its minimum tension."
    )
    spool_angle: dict[FullName, SpoolAngle] | None = Field(
        None, description="By motor in position drive: the goal of its loop in place of the reference's."
    )
    tendon_winding: dict[FullName, WoundLength] | None = Field(
        None, description="By tendon: what its motor in position drive winds in, or, without a motor, an ideal winch."
    )
    motor_voltage: dict[FullName, VoltageSignal] | None = Field(
        None, description="By motor in position drive: what its loop would ask for, held from sample to sample."
    )
    supply_voltage: dict[FullName, VoltageSignal] | None = Field(
        None, description="By motor in position drive: what its loop takes a part of, in place of the motor's voltage."
    )
    inputs: dict[FullName, InputSignal] | None = Field(
        None, description="By actuator of a tree; one without a signal has zero input."
    )
    gain: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        1.0, unit="N m/rad", source="chosen", doc="K_P, one number or one per joint."
    )
    minimum_tension: Annotated[Numbers, reals(0.0, 1e5)] = quantity(
        1.0, unit="N", source="chosen", doc="f0, one number or one per tendon."
    )
    passive_tension: Annotated[Numbers, reals(0.0, 1e5)] = quantity(
        1.0, unit="N", source="chosen", doc="f5^d, one number or one per passive tendon."
    )
    damping: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        0.0, unit="N m s/rad", source="the paper has none", doc="K_D, one number or one per joint."
    )
    gravity_compensation: bool = Field(False, strict=True, description="Whether G(theta) of (18) is added to tau^d.")
    fingertip_force: Annotated[dict[Name, ForceSignal] | None, AfterValidator(check_axes)] = Field(
        None, description="Force that the fingertip is to exert besides, J^T F added to tau^d, by axis of the base."
    )
    spring_compensation: bool = Field(
        False, strict=True, description="Whether the torque of springs is added to tau^d; always without force closure."
    )
    tendon_friction_feedforward: TendonFeedforwardSettings | None = Field(
        None, description="Tendon friction by (9) and (16), added to commands."
    )
    joint_friction_compensation: JointCompensationSettings | None = Field(
        None, description="Joint friction by (9) and (17), added to tau^d."
    )
    passive_tension_loop: PassiveTensionSettings | None = Field(None, description="Closed loop on f5; sampled.")
    distribution: DistributionSettings | None = Field(None, description="Quadratic programme with tension limits.")
    sampling: SamplingSettings | None = Field(None, description="Sampled execution; continuous without it.")

    fingers: dict[Name, ControllerSettings] | None = Field(None, description="By finger, entries that differ there.")

    _flat = field_validator(*BY_NAME, mode="before")(flatten)
    _nested = field_serializer(*BY_NAME, mode="wrap")(unflatten)
    _sparse = field_serializer("fingers")(dump_set_fields)

    @property
    def is_paper(self) -> bool:
        """Whether it is the paper's controller, perhaps damped, and nothing else, sampled or not."""
        added = (
            self.tendon_friction_feedforward,
            self.joint_friction_compensation,
            self.passive_tension_loop,
            self.distribution,
        )
        plain = self.kind == "proportional" and not (self.gravity_compensation or self.spring_compensation)
        pushing = any(each.fingertip_force for each in (self, *(self.fingers or {}).values()))
        return plain and not pushing and all(each is None for each in added)


def check_controller(settings: ControllerSettings, finger: FingerDescription) -> None:
    """Raise the error of an entry that does not fit the finger, or another entry."""
    if settings.passive_tension_loop is not None and settings.sampling is None:
        entry = "controller.passive_tension_loop"
        raise problem(entry, "works from sample to sample: set controller.sampling.period too")
    _check_tensions(settings, finger)
    check_winding(
        finger, settings.spool_angle or (), settings.tendon_winding or (), settings.motor_voltage or {}, settings.kind
    )
    check_supplies(finger, settings.supply_voltage or {}, settings.motor_voltage or ())
    tendons = tuple(finger.tendons)
    items = {"joint": tuple(finger.joints), "tendon": tendons, "passive tendon": finger.passive_names}
    for table, kind, entries in _LISTS:
        owner = getattr(settings, table) if table else settings
        for entry in entries if owner else ():
            check_size(getattr(owner, entry), items[kind], ".".join(filter(None, ("controller", table, entry))), kind)
    limits = settings.distribution
    if limits is not None:
        least, most = (expand(each, len(tendons)) for each in (settings.minimum_tension, limits.maximum_tension))
        for name, low, high in zip(tendons, least, most, strict=True):
            if high < low:
                allowed = f"must be at least the minimum tension, {low:g} N for {name}"
                raise problem("controller.distribution.maximum_tension", allowed, limits.maximum_tension)


def _check_tensions(settings: ControllerSettings, finger: FingerDescription) -> None:
    actuators = tuple(finger.tree.actuators)
    for name in settings.inputs or {}:
        if name not in actuators:
            hint = f"; give controller.spool_angle.{name}" if name in finger.actuators else suggestion(name, actuators)
            allowed = f"no such actuator; there are {', '.join(actuators) or 'none'}{hint}"
            raise problem(f"controller.inputs.{name}", allowed)
    if settings.kind == "proportional":
        if actuators or not finger.tendons:
            raise problem("controller.kind", 'must be "tensions": actuators are driven in open loop', settings.kind)
        return
    names = finger.actuated_names
    for name, signal in (settings.tensions or {}).items():
        entry = f"controller.tensions.{name}"
        if name in finger.passive_names:
            raise problem(entry, f"is a passive tendon, which has no actuator; actuated are {', '.join(names)}")
        if name not in names:
            hint = f"; give controller.spool_angle.{name}" if name in finger.actuators else suggestion(name, names)
            driven = f"; actuators are {', '.join(actuators)}" if actuators else ""
            raise problem(entry, f"no such tendon; actuated are {', '.join(names) or 'none'}{driven}{hint}")
        if signal.lowest < 0.0:
            raise problem(entry, f"a tendon only pulls: the tension must stay at or above 0 N, not {signal.lowest:g} N")
