"""Actuators as data: motors with their gearboxes, spools, elastic tendons, drives. Seen at the gearbox's output."""

from __future__ import annotations

import json
import math
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from finger_pin.description.cogging import Cogging
from finger_pin.description.validation import (
    Description,
    Name,
    Numbers,
    choice,
    expand,
    problem,
    quantity,
    real,
    reals,
    vector,
)


class DataSheet(Description):
    """A maker's data sheet, from which K_t, R and c0 follow so that stall and free speed are exact."""

    stall_torque: Annotated[float, real(0.0, 1e4, above=True, hint=" N m (is it in kg cm?)")] = quantity(
        ..., unit="N m", source="maker's sheet", doc="T_s, torque at rest at the voltage."
    )
    stall_current: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        ..., unit="A", source="maker's sheet", doc="I_s, current at rest at the voltage."
    )
    no_load_speed: Annotated[float, real(0.0, 1e5, above=True, hint=" rad/s (is it in rpm?)")] = quantity(
        ..., unit="rad/s", source="maker's sheet", doc="w_0, speed without load at the voltage."
    )


class GearFriction(Description):
    """Law (9) of a gearbox, its level [c0 + m0 N] + [c1 + m1 N] exp(-(|v| / w)^p), N the torque that gears carry."""

    coulomb: Annotated[float, real(0.0, 1e4)] | None = quantity(
        None, unit="N m", source="data sheet", doc="c0, level without load; a data sheet says it if it is left out."
    )
    by_load: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="1", source="fit", doc="m0, level over N, the torque that the gears carry."
    )
    stribeck: Annotated[float, real(0.0, 1e4)] = quantity(
        0.0, unit="N m", source="fit", doc="c1, level that is added at rest without load."
    )
    stribeck_by_load: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="1", source="fit", doc="m1, level that is added at rest over N."
    )
    stribeck_velocity: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        1.0, unit="rad/s", source="fit", doc="w, Stribeck velocity."
    )
    stribeck_exponent: Annotated[float, real(0.0, 10.0, above=True)] = quantity(
        1.0, unit="1", source="fit", doc="p, exponent of |v| / w."
    )
    viscous: Annotated[float, real(0.0, 1e4)] = quantity(
        0.0, unit="N m s/rad", source="fit", doc="b, viscous torque at the spool per speed."
    )
    stiffness: Annotated[float, real(0.0, 1e9, above=True)] = quantity(
        50.0, unit="N m/rad", source="estimate", doc="sigma_0, bristle stiffness: how far gears give before they slip."
    )
    backlash: Annotated[float, real(0.0, 1.0, hint=" rad (is it in degrees?)")] = quantity(
        0.0, unit="rad", source="fit", doc="b, play at the output, all of the gap between the two flanks of its teeth."
    )
    driving: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="1", source="fit", doc="m_d, level over the tendons' torque while the motor winds in against it."
    )
    driven: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="1", source="fit", doc="m_b, the same while the tendons turn the motor back; from 1 on they cannot."
    )
    external_weight: Annotated[float, real(0.0, 1e3)] = quantity(
        1.0,
        unit="1",
        source="fit",
        doc="x, how much more the tendons' torque counts in N than the motor's: N = |x r f + tau|, twice what is held "
        "at x = 1; from 1 / m0 on no tendon turns the gears.",
    )


class Encoder(Description):
    """The encoder of a position drive, on its spool; where gears have play, before the play."""

    range: Annotated[tuple[float, float], vector(2, -1e6, 1e6)] = quantity(
        ..., unit="rad", source="maker's sheet", doc="Least and largest angle that it can be told to go to."
    )
    resolution: Annotated[float, real(0.0, 1.0)] = quantity(
        0.0, unit="rad", source="maker's sheet", doc="Step of the measured angle; 0 for none."
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.range[0] >= self.range[1]:
            raise problem("range", "the lower limit must be below the upper one", list(self.range))
        return self


class Winding(Description):
    """The thermal model of a winding: C T' = R i^2 - (T - T_a) / R_th, with C = time_constant / R_th."""

    thermal_resistance: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        ..., unit="K/W", source="maker's sheet", doc="R_th, from the winding to the surroundings of the motor."
    )
    time_constant: Annotated[float, real(0.0, 1e6, above=True)] = quantity(
        ..., unit="s", source="maker's sheet", doc="R_th C, in which it comes within 37 % of where it ends."
    )
    ambient: Annotated[float, real(-100.0, 300.0)] = quantity(
        25.0, unit="degC", source="maker's sheet", doc="T_a, temperature of the surroundings, where the winding begins."
    )


class Motor(Description):
    """A motor with its gearbox, either by its constants or by its data sheet."""

    file_keys = ("base",)

    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    voltage: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        ..., unit="V", source="maker's sheet", doc="V, of the supply: |U| <= V."
    )
    torque_constant: Annotated[float, real(0.0, 1e4, above=True)] | None = quantity(
        None, unit="N m/A", source="fit", doc="K_t, torque at the spool per current."
    )
    resistance: Annotated[float, real(0.0, 1e6, above=True)] | None = quantity(
        None, unit="ohm", source="fit", doc="R, of the winding."
    )
    data_sheet: DataSheet | None = Field(None, description="In place of torque_constant and resistance.")
    maximum_current: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        ..., unit="A", source="maker's sheet", doc="I_max, to which the electronics limit the current."
    )
    inertia: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        ..., unit="kg m2", source="fit", doc="J, of the rotor times the square of the gear ratio, and of the gears."
    )
    friction: GearFriction = Field(GearFriction(), description="Of the gearbox.")
    cogging: Cogging | None = Field(None, description="The torque of its magnets over the angle.")
    encoder: Encoder | None = Field(None, description="For a position drive.")
    winding: Winding | None = Field(None, description="For the metric winding_temperature.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        sheet = self.data_sheet
        for name in ("torque_constant", "resistance"):
            if sheet is None and getattr(self, name) is None:
                raise problem(name, "is missing: give it, or a data_sheet")
            if sheet is not None and getattr(self, name) is not None:
                raise problem(name, "follows from data_sheet; leave one of the two out", getattr(self, name))
        if sheet is None and self.friction.coulomb is None:
            raise problem("friction.coulomb", "is missing: give it, or a data_sheet")
        if sheet is not None and self.constants[2] < 0.0:
            stall_torque = self.constants[0] * sheet.stall_current
            allowed = f"must be at most {stall_torque:.4g} N m, by this current and this speed at no load"
            raise problem("data_sheet.stall_torque", allowed, sheet.stall_torque)
        return self

    @property
    def constants(self) -> tuple[float, float, float]:
        """K_t, N m/A, R, ohm, and c0, N m; of a data sheet R = V / I_s, K_t = sqrt(T_s R / w_0), c0 = K_t I_s - T_s."""
        sheet, friction = self.data_sheet, self.friction.coulomb
        if sheet is None:
            assert self.torque_constant is not None and self.resistance is not None and friction is not None
            return self.torque_constant, self.resistance, friction
        resistance = self.voltage / sheet.stall_current
        constant = math.sqrt(sheet.stall_torque * resistance / sheet.no_load_speed)
        friction_torque = constant * sheet.stall_current - sheet.stall_torque
        return constant, resistance, friction_torque if friction is None else friction


class PositionLoop(Description):
    """The loop of a position drive, U = V clip(k_p e + k_d e' + k_i int e, -1, 1), on the angle of the spool."""

    period: Annotated[float, real(1e-6, 1.0)] = quantity(
        1e-3, unit="s", source="common in such servos", doc="From sample to sample."
    )
    proportional: Annotated[float, real(0.0, 1e6)] = quantity(
        1.15,
        unit="1/rad",
        source="XL330 recorded: gain 400 as it ships, of 256, 4096 steps a turn, 885 all",
        doc="k_p, share of the supply's voltage per error of the angle.",
    )
    derivative: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="s/rad", source="as it ships", doc="k_d, the same per rate of the error."
    )
    integral: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="1/(rad s)", source="as it ships", doc="k_i, the same per integral of the error."
    )
    torque_off: Annotated[float, real(0.0, 1e6)] | None = quantity(
        None, unit="s", source="chosen", doc="Time at which the motor is let go: from then on no current flows."
    )


class Actuator(Description):
    """A motor that pulls one tendon or several through a spool; tendons stretch on their way."""

    motor: Motor = Field(description="The name of one that ships, the path of a .toml file, or a table.")
    tendons: tuple[Name, ...] = Field(min_length=1, description="What its spool pulls, one tendon or several.")
    spool_radius: Annotated[Numbers, reals(-1.0, 1.0, hint=" m (is it in millimetres?)")] = quantity(
        ..., unit="m", source="design", doc="r, one number or one per tendon, above 0."
    )
    winds: tuple[Annotated[Literal["in", "out"], choice("in", "out")], ...] | None = Field(
        None,
        description="Of every tendon, whether the spool winds it in or pays it out as the first one is wound in; two "
        "go opposite ways where nothing is said.",
    )
    drive: Annotated[Literal["tension", "position"], choice("tension", "position")] = quantity(
        "tension", unit="1", source="design", doc="Commanded tensions as torque, or planned tendon lengths as angle."
    )
    tendon_rigidity: Annotated[Numbers, reals(0.0, 1e9, above=True)] = quantity(
        6000.0,
        unit="N",
        source="a polyethylene braid that breaks at 200 N and 3.5 %",
        doc="E A; the tendon has K = E A / L_0.",
    )
    tendon_length: Annotated[Numbers, reals(0.0, 100.0, above=True)] = quantity(
        0.3, unit="m", source="design", doc="L_0, from the spool to the finger."
    )
    tendon_damping: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        10.0, unit="N s/m", source="estimate: a tenth of K at 200 rad/s", doc="D, of the tendon as a whole."
    )
    tendon_hysteresis: Annotated[Numbers, reals(0.0, 0.9)] = quantity(
        0.0,
        unit="1",
        source="the paper has none",
        doc="h, part of its tension that a tendon holds against its stretch.",
    )
    tendon_pieces: Annotated[Numbers, reals(0.0, 64.0, whole=True)] = quantity(
        0.0, unit="1", source="chosen", doc="Pieces of a tendon that stretch in its sheath; 0 for none."
    )
    pretension: Annotated[Numbers, reals(0.0, 1e5)] = quantity(
        0.0, unit="N", source="design", doc="K e0, with the spool and all joints at zero; of several all there is."
    )
    friction_compensation: Annotated[float, real(0.0, 2.0)] = quantity(
        0.0,
        unit="1",
        source="chosen",
        doc="Tension drive: part of coulomb, by_load and viscous that current overcomes.",
    )
    reversal_speed: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        0.5, unit="rad/s", source="chosen", doc="Tension drive: speed below which that is smoothed."
    )
    position_loop: PositionLoop = Field(PositionLoop(), description="Position drive: its loop.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        by_tendon = ("spool_radius", "tendon_rigidity", "tendon_length", "tendon_damping", "tendon_hysteresis")
        for name in (*by_tendon, "tendon_pieces", "pretension"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != len(self.tendons):
                raise problem(name, f"must be one number or one per tendon: {', '.join(self.tendons)}", list(value))
        count = len(self.tendons)
        if np.any((expand(self.tendon_pieces, count) > 0.0) & (expand(self.tendon_hysteresis, count) > 0.0)):
            allowed = "must be 0 of a tendon with tendon_pieces, which loses by rubbing in its sheath"
            raise problem("tendon_hysteresis", allowed, self.tendon_hysteresis)
        if len(set(self.tendons)) != len(self.tendons):
            raise problem("tendons", "must be different tendons", list(self.tendons))
        together = f"winds = {json.dumps(['in'] * len(self.tendons))} winds all in together"
        if np.min(self.spool_radius) <= 0.0:
            raise problem("spool_radius", f'must be above 0; {together}, "out" pays one out', self.spool_radius)
        if self.winds is None:
            if len(self.tendons) > 2:
                raise problem("winds", f"is missing: three tendons or more need one word each; {together}")
        elif len(self.winds) != len(self.tendons) or self.winds[0] != "in":
            allowed = f'must be "in" or "out" for each of {", ".join(self.tendons)}, "in" for the first; {together}'
            raise problem("winds", allowed, list(self.winds))
        if self.drive == "position" and self.motor.encoder is None:
            raise problem("motor.encoder.range", "is missing: a position drive needs the range of angles it can go to")
        if self.drive == "tension" and len(self.tendons) > 1:
            allowed = 'one torque cannot set several tensions: a spool of several tendons has drive = "position"'
            raise problem("drive", allowed, self.drive)
        if self.drive == "tension" and self.position_loop.torque_off is not None:
            allowed = 'lets go of a motor with drive = "position"; one in tension drive is let go by commands of 0 N'
            raise problem("position_loop.torque_off", allowed, self.position_loop.torque_off)
        return self

    @property
    def radii(self) -> NDArray[np.float64]:
        """Spool radius of every tendon, shape (k,), m: negative where it is paid out as the first one is wound in."""
        count = len(self.tendons)
        winds = self.winds or ("in", "out")[:count]
        return expand(self.spool_radius, count) * np.where(np.array(winds) == "in", 1.0, -1.0)


def check_actuators(actuators: dict[str, Actuator], actuated: tuple[str, ...], passive: tuple[str, ...]) -> None:
    """Raise the error of an actuator whose tendons are not there, passive, or pulled by another one too."""
    owner: dict[str, str] = {}
    for name, actuator in actuators.items():
        entry = f"actuators.{name}.tendons"
        for tendon in actuator.tendons:
            if tendon in passive:
                raise problem(entry, f"{tendon} is passive, without an actuator; actuated are {', '.join(actuated)}")
            if tendon not in actuated:
                raise problem(entry, f"no such tendon; actuated are {', '.join(actuated)}", tendon)
            if tendon in owner:
                raise problem(entry, f"{tendon} has two sources: {owner[tendon]} pulls it already; leave one out")
            owner[tendon] = name
