"""Servos: rotors with motor and gearbox, spools, and the elastic tendons between spool and canal.

    tendon     e = r theta_m - l(q) + e0,   f^m = max(0, K e + D e')
    rotor      J theta_m'' = tau - tau_g - sum of r f^m
    gearbox    tau_g by (9), loaded by N = |x sum of r f^m + tau|
    play       J_s theta_s'' = T - sum of r f^m, T by (2) outside the gap; then e and theta_m'' have theta_s and T

An elastic tendon is a row that acts on rotor and finger alike; what its canal takes away is the row of the driven
tendon. A tendon that is paid out as the first one of its spool is wound in has a negative radius. A load that the motor
holds presses the teeth from both sides, so that its torque and the motor's add up in N. Gears with play make the spool
a mass of its own, between cords and flanks of teeth; what flanks carry takes the place of the tendons' torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.laws.cogging import COGGING
from finger_pin.laws.gearbox import GEARBOX
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.motor import MOTOR
from finger_pin.laws.spring import ELASTIC_TENDON
from finger_pin.mechanism.joints import OF_TENDONS, hysteresis_rows
from finger_pin.mechanism.rows import Energy, Rows
from finger_pin.typing import Array

_STRETCH_ENERGY = Energy("elastic_tendons", "tendons on spools")
_DAMPING = Energy("elastic_damping", "tendons stretching")
_FLANKS = Energy("backlash", "flanks of gears with play")
_COGGING = Energy("cogging", "cogging of motors")
# Of a motor with play: the spool's part of its inertia, stiffness of flanks over that of bristles, and their c, s/rad.
_SPOOL_INERTIA_SHARE, _FLANK_STIFFNESS_RATIO, _FLANK_DAMPING = 1e-4, 10.0, 1.0


@dataclass(frozen=True, eq=False)
class Actuators:
    """m motors that pull k of a finger's tendons; the others have ideal sources.

    Attributes:
        routing: Of the finger.
        names: Of the motors.
        tendons: Indices of the tendons that are pulled, shape (k,).
        spools: Shape (k, m), m: radius of the spool that pulls each; negative where it pulls as it turns back.
        stiffness: K = E A / L_0, shape (k,), N/m.
        damping: D, shape (k,), N s/m.
        hysteresis: h, shape (k,).
        slack: e0, shape (k,), m.
        inertia: J, shape (m,), kg m2.
        holds: Whether each motor is in position drive, shape (m,).
        motor: Numbers of the law of motors, shape (parameters, m).
        gearbox: Numbers of the law of gearboxes, shape (parameters, m).
        external_weight: x, shape (m,).
        backlash: b, shape (m,), rad.
        cogging: Numbers of the law of cogging, shape (parameters, m); zero of motors without.
    """

    routing: Routing
    names: tuple[str, ...]
    tendons: NDArray[np.int64]
    spools: Array
    stiffness: Array
    damping: Array
    hysteresis: Array
    slack: Array
    inertia: Array
    holds: NDArray[np.bool_]
    motor: Array
    gearbox: Array
    external_weight: Array
    backlash: Array
    cogging: Array

    @classmethod
    def from_description(cls, description: FingerDescription, routing: Routing) -> Actuators:
        """Read motors and the tendons that they pull."""
        actuators, names, held = description.actuators.values(), list(description.actuators), description.drive_cords
        strands = [(name, tendon) for name, each in description.actuators.items() for tendon in each.tendons]
        cords = [held[tendon] for _, tendon in strands]
        spools = np.zeros((len(strands), len(names)))
        for row, (name, tendon) in enumerate(strands):
            actuator = description.actuators[name]
            spools[row, names.index(name)] = actuator.radii[actuator.tendons.index(tendon)]
        motors, gearboxes = [], []
        for actuator in actuators:
            motor, gears = actuator.motor, actuator.motor.friction
            constant, resistance, friction_torque = motor.constants
            by_current = float(actuator.drive == "tension")
            share = by_current * actuator.friction_compensation
            electrical = (constant, resistance, motor.voltage, motor.maximum_current)
            # Of N = |x T + tau| at tau = T + friction, T is known from the command.
            by_torque = share * gears.by_load * (1.0 + gears.external_weight)
            overcome = (
                share * friction_torque,
                by_torque,
                gears.by_load,
                share * gears.viscous,
                actuator.reversal_speed,
            )
            motors.append((*electrical, by_current, actuator.radii[0], *overcome))
            level = (friction_torque, gears.by_load, gears.stribeck, gears.stribeck_by_load)
            shape = (gears.stribeck_velocity, gears.stribeck_exponent, gears.viscous, gears.stiffness)
            gearboxes.append((*level, *shape, gears.driving, gears.driven))
        return cls(
            routing=routing,
            names=tuple(names),
            tendons=np.array([routing.tendons.index(tendon) for _, tendon in strands], dtype=np.int64),
            spools=spools,
            stiffness=np.array([cord.stiffness for cord in cords]),
            damping=np.array([cord.damping for cord in cords]),
            hysteresis=np.array([cord.hysteresis for cord in cords]),
            slack=np.array([cord.slack for cord in cords]),
            inertia=np.array([each.motor.inertia for each in actuators]),
            holds=np.array([each.drive == "position" for each in actuators], dtype=bool),
            motor=np.array(motors).reshape(-1, len(MOTOR.parameters)).T,
            gearbox=np.array(gearboxes).reshape(-1, len(GEARBOX.parameters)).T,
            external_weight=np.array([each.motor.friction.external_weight for each in actuators]),
            backlash=np.array([each.motor.friction.backlash for each in actuators]),
            cogging=np.array(
                [
                    (each.amplitude, each.per_turn, each.phase) if each else (0.0, 0.0, 0.0)
                    for each in (actuator.motor.cogging for actuator in actuators)
                ]
            )
            .reshape(-1, len(COGGING.parameters))
            .T,
        )

    @property
    def channels(self) -> NDArray[np.int64]:
        """The input of every motor, that of its first tendon: a tension, or a voltage in position drive; shape (m,)."""
        return self.tendons[self._first_tendons] if self.names else np.zeros(0, dtype=np.int64)

    @property
    def radius(self) -> Array:
        """Radius of the spool that winds in the first tendon of every motor, shape (m,), m."""
        return self.spools[self._first_tendons, np.arange(len(self.names))] if self.names else np.zeros(0)

    @property
    def _first_tendons(self) -> NDArray[np.intp]:
        first: NDArray[np.intp] = np.argmax(self.spools != 0.0, axis=0)
        return first

    @property
    def voltages(self) -> NDArray[np.int64]:
        """The inputs that are voltages of motors in position drive."""
        return self.channels[self.holds]

    @property
    def positioned(self) -> NDArray[np.int64]:
        """Tendons that motors in position drive pull."""
        return self.tendons[np.any(self.spools[:, self.holds] != 0.0, axis=1)]

    @property
    def loose(self) -> NDArray[np.intp]:
        """Motors whose spool is a mass of its own, as their gears have play, shape (p,)."""
        return np.flatnonzero(self.backlash)

    @property
    def loose_names(self) -> tuple[str, ...]:
        """Names of motors with play, shape (p,)."""
        return tuple(self.names[motor] for motor in self.loose)

    @property
    def inertias(self) -> Array:
        """Inertias of spools with play and of motors, shape (p + m,), kg m2."""
        spools = _SPOOL_INERTIA_SHARE * self.inertia[self.loose]
        rotors = self.inertia.copy()
        rotors[self.loose] -= spools
        return np.concatenate([spools, rotors])

    def angle(self, position: Array, tension: Array | None = None, excursion: Array | None = None) -> Array:
        """Return theta_m, shape (..., m), rad, for given tensions of the tendons, the nearest for several on one motor.

        Args:
            position: theta, shape (..., n), rad.
            tension: f^m, shape (..., a), N; by default tendons are just taut.
            excursion: l at theta, shape (..., a), m, where tendons run along paths; by default H_c theta.
        """
        drawn = position @ self.routing.actuated_coupling.T if excursion is None else excursion
        wanted = drawn[..., self.tendons] - self.slack
        if tension is not None:
            wanted = wanted + tension[..., self.tendons] / self.stiffness
        weights = self.stiffness[:, None] * self.spools
        angle: Array = wanted @ weights / np.sum(weights * self.spools, axis=0)
        return angle

    @property
    def hysteretic_tendons(self) -> NDArray[np.intp]:
        """The tendons with hysteresis, shape (h,)."""
        return np.flatnonzero(self.hysteresis)

    def _torques(self, weight: Array) -> dict[str, Array]:
        """Return the torques of the tendons on motors, times a weight (m,), as weights of earlier rows, by table."""
        # Of gears with play it is what their flanks carry.
        tight = np.where(self.backlash > 0.0, 0.0, weight)[:, None] * self.spools.T
        flanks = {"backlash": np.diag(weight)[:, self.loose]} if self.loose.size else {}
        return {**flanks, **self._tendon_weights(tight)}

    def _tendon_weights(self, weights: Array) -> dict[str, Array]:
        """Return weights of the elastic tendons' tensions in later rows, by table, from weights of shape (..., k)."""
        tendons = self.hysteretic_tendons
        hysteresis = {"tendon_hysteresis": weights[..., tendons]} if tendons.size else {}
        return {"elastic_tendons": weights, **hysteresis}

    def tendon_rows(self, width: int) -> list[Rows]:
        """Return the tables of elastic tendons and their hysteresis, for coordinates (theta, p, theta_s, theta_m)."""
        if not self.names:
            return []
        arm = np.zeros((len(self.tendons), width))
        arm[:, : len(self.routing.joints)] = self.routing.coupling[self.tendons]
        spools = np.arange(width - len(self.names), width)
        spools[self.loose] = width - len(self.inertias) + np.arange(len(self.loose))
        arm[:, spools] = -self.spools
        elastic = Rows(
            group="elastic_tendons",
            law=ELASTIC_TENDON,
            names=tuple(self.routing.tendons[index] for index in self.tendons),
            parameters=np.array([self.stiffness, self.damping]),
            arm=arm,
            offset=-self.slack,
            stored=_STRETCH_ENERGY,
            powers=(_DAMPING,),
            pulls=tuple(self.routing.tendons[index] for index in self.tendons),
        )
        return [elastic, *hysteresis_rows("tendon_hysteresis", elastic, self.hysteresis, OF_TENDONS, _DAMPING)]

    def rotor_rows(self, width: int) -> list[Rows]:
        """Return the tables of motors, of their cogging, of the play of gears, and of gearboxes."""
        if not self.names:
            return []
        count = len(self.names)
        turns = np.eye(count, width, width - count)
        one_way = bool(np.any(self.gearbox[-2:]))
        cogged = np.flatnonzero(self.cogging[COGGING.parameters.index("per_turn")])
        names = tuple(self.names[motor] for motor in cogged)
        cogging = [Rows("cogging", COGGING, names, self.cogging[:, cogged], turns[cogged], stored=_COGGING)]
        on_rotors = {"motors": np.eye(count)} | ({"cogging": np.eye(count)[:, cogged]} if names else {})
        return [
            Rows(
                "motors",
                MOTOR,
                self.names,
                self.motor,
                turns,
                channels=self.channels,
                powers=(Energy("electrical", "motors' electronics"), Energy("motor_heat", "heat in windings")),
            ),
            *(cogging if names else []),
            *self._play(width),
            Rows(
                "gearboxes",
                GEARBOX,
                self.names,
                self.gearbox,
                turns,
                inputs=self._torques(np.ones(count)) if one_way else {},
                loads={**on_rotors, **self._torques(self.external_weight)},
                stored=Energy("gearboxes", "gear bristles"),
                powers=(Energy("gearbox_coulomb", "gears sliding"), Energy("gearbox_viscous", "gears viscous")),
            ),
        ]

    def _play(self, width: int) -> list[Rows]:
        """Return the table of the flanks between motors and spools, if any has play."""
        loose, count = self.loose, len(self.loose)
        if not count:
            return []
        arm = np.eye(count, width, width - len(self.inertias))
        arm[np.arange(count), width - len(self.names) + loose] = -1.0
        # Tendons that are all wound in keep to one flank, where the motor's angle is the spool's; else it is amid.
        gap = self.backlash[loose]
        lower = np.where(np.any(self.spools[:, loose] < 0.0, axis=0), -0.5 * gap, 0.0)
        flank = _FLANK_STIFFNESS_RATIO * self.gearbox[GEARBOX.parameters.index("stiffness"), loose]
        return [
            Rows(
                "backlash",
                STROKE_LIMITER,
                self.loose_names,
                np.array([lower, lower + gap, flank, np.full(count, _FLANK_DAMPING), np.zeros(count)]),
                arm,
                stored=_FLANKS,
                powers=(_FLANKS,),
            )
        ]
