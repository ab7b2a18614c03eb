"""The numbers of law (9) for tendons and for joints."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from finger_pin.description.validation import Description, Numbers, choice, problem, quantity, reals, suggestion
from finger_pin.exceptions import toml_like
from finger_pin.typing import Array, Number

#: Laws of the joints' friction by name.
JOINT_LAWS = ("lugre", "dahl", "coulomb")
#: Those without Stribeck's curve: a joint lets go at M^d.
WITHOUT_STRIBECK = ("dahl", "coulomb")
# Bristles without a stiffness: the least, N/m and N m/rad, and how far they give, m and rad. They harden over a tenth
# of that: up to forces of e^8 times those at which they begin to, they give by no more.
_TENDON_BRISTLES, _JOINT_BRISTLES, _PARTS = (5e4, 2e-5), (5.0, 1e-3), 10.0


class TendonFrictionSettings(Description):
    """Law (9) for tendons: one number for all, or one per tendon."""

    place: Annotated[Literal["canal", "bends"], choice("canal", "bends")] = Field(
        "canal",
        description='Where tendons rub. "canal": at one place before the joints, as in the paper, by all of their '
        'curvature. "bends": at every crossing that bends them and at every bend of a path, each at its own '
        "tension and sliding speed; stiffness, viscous, micro_damping and drag are then shared among the places.",
    )
    coulomb: Annotated[Numbers, reals(0.0, 10.0)] = quantity(
        0.11, unit="1", source="Sec. IV-B", doc="mu_e, Coulomb coefficient between tendon and canal."
    )
    drag: Annotated[Numbers, reals(0.0, 1e5)] = quantity(
        0.0, unit="N", source="the paper has none", doc="Drag without load, of seals and sheaths; adds to F^n M."
    )
    stiction_ratio: Annotated[Numbers, reals(1.0, 100.0)] = quantity(
        1.5, unit="1", source="estimate", doc="rho = mu^c / mu^d, stiction over Coulomb friction."
    )
    stiffness: Annotated[Numbers, reals(0.0, 1e9, above=True)] | None = quantity(
        None,
        unit="N/m",
        source="estimate",
        doc="sigma_0, bristle stiffness. Without it bristles give by about 20 um at any load: 5e4 N/m, or what drag "
        "and floor stretch by 20 um, plus |F^s| / 2 um.",
    )
    viscous: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        1.0, unit="N s/m", source="estimate", doc="b, viscous coefficient."
    )
    stribeck_velocity: Annotated[Numbers, reals(0.0, 1e3, above=True)] = quantity(
        0.01, unit="m/s", source="estimate", doc="omega, Stribeck velocity."
    )
    floor: Annotated[Numbers, reals(0.0, 1e3, above=True)] = quantity(
        1e-4, unit="N", source="guards (9a) at F^n = 0", doc="g_min, least friction level F^n M."
    )
    stribeck_exponent: Annotated[Numbers, reals(1.0, 2.0, whole=True)] = quantity(
        1.0, unit="1", source="(9b)", doc="Exponent of |v| / omega: 1 as in the paper, or 2 as in the LuGre model."
    )
    micro_damping: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        0.0, unit="N s/m", source="(9c)", doc="sigma_1, damping of the bristles: none in the paper."
    )


def _law(value: Any) -> Any:
    """Return the name of a law of joint friction, or that of the user's and its module."""
    if value in JOINT_LAWS or (isinstance(value, str) and re.fullmatch(r"[\w.]+:\w+", value)):
        return value
    raise problem("", f'must be one of {", ".join(JOINT_LAWS)} or "module:NAME"{suggestion(value, JOINT_LAWS)}', value)


class JointFrictionSettings(Description):
    """Friction of the joints, law (9) by default: one number for all, or one per joint."""

    law: Annotated[str, BeforeValidator(_law)] = Field(
        "lugre",
        strict=True,
        description='"lugre": (9). "dahl": no Stribeck curve. "coulomb": M^d R tanh(v / v_r) + b v, cannot stick. '
        '"module:NAME": a `Law` of your own, in a Python module that is imported, or that FINGER_PIN_LAWS names.',
    )
    coulomb: Annotated[Numbers, reals(0.0, 0.1, hint=" m (is it in millimetres?)")] = quantity(
        2.5e-4, unit="m", source="estimate", doc="M^d, Coulomb coefficient times pin radius."
    )
    stiction: Annotated[Numbers, reals(0.0, 0.1, hint=" m (is it in millimetres?)")] = quantity(
        3.5e-4, unit="m", source="estimate", doc="M^c, stiction coefficient times pin radius."
    )
    drag: Annotated[Numbers, reals(0.0, 1e3)] = quantity(
        0.0,
        unit="N m",
        source="the paper has none",
        doc="Dry friction without load, of seals and bushings; adds to R M^d, and lets go at M^c / M^d times as much.",
    )
    drag_asymmetry: Annotated[Numbers, reals(-1.0, 1.0)] = quantity(
        0.0,
        unit="1",
        source="the paper has none",
        doc="a: drag (1 + a) hinders motion to greater angles, drag (1 - a) to smaller ones.",
    )
    stiffness: Annotated[Numbers, reals(0.0, 1e9, above=True)] | None = quantity(
        None,
        unit="N m/rad",
        source="estimate",
        doc="sigma_0, bristle stiffness. Without it bristles give by about 1 mrad at any load: 5 N m/rad, or what drag "
        "and floor stretch by 1 mrad, plus |F^s| / 0.1 mrad.",
    )
    viscous: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        1e-3, unit="N m s/rad", source="estimate", doc="b, viscous coefficient."
    )
    stribeck_velocity: Annotated[Numbers, reals(0.0, 1e4, above=True)] = quantity(
        0.1, unit="rad/s", source="estimate", doc="omega, Stribeck velocity."
    )
    floor: Annotated[Numbers, reals(0.0, 1e3, above=True)] = quantity(
        1e-7, unit="N m", source="guards (9a) at R = 0", doc="g_min, least friction level R M."
    )
    stribeck_exponent: Annotated[Numbers, reals(1.0, 2.0, whole=True)] = quantity(
        1.0, unit="1", source="(9b)", doc="Exponent of |v| / omega: 1 as in the paper, or 2 as in the LuGre model."
    )
    micro_damping: Annotated[Numbers, reals(0.0, 1e6)] = quantity(
        0.0, unit="N m s/rad", source="(9c)", doc="sigma_1, damping of the bristles: none in the paper."
    )

    reversal_speed: Annotated[Numbers, reals(0.0, 1e4, above=True)] = quantity(
        0.01, unit="rad/s", source="chosen", doc='v_r of law = "coulomb", over which friction turns round.'
    )

    @property
    def break_away(self) -> Numbers:
        """The coefficient at which a joint lets go, m: M^c, or M^d of a law without Stribeck's curve."""
        value: Numbers = getattr(self, self.break_away_entry)
        return value

    @property
    def break_away_entry(self) -> str:
        """Name of the entry that is `break_away`."""
        return "coulomb" if self.law in WITHOUT_STRIBECK else "stiction"

    @model_validator(mode="after")
    def _stiction_above_coulomb(self) -> Self:
        if self.law in WITHOUT_STRIBECK:
            return self
        both = isinstance(self.coulomb, tuple) and isinstance(self.stiction, tuple)
        if both and len(self.coulomb) != len(self.stiction):  # type: ignore[arg-type]
            return self
        size = max(len(value) if isinstance(value, tuple) else 1 for value in (self.coulomb, self.stiction))
        low = self.coulomb if isinstance(self.coulomb, tuple) else (self.coulomb,) * size
        high = self.stiction if isinstance(self.stiction, tuple) else (self.stiction,) * size
        if any(kinetic > static for kinetic, static in zip(low, high, strict=True)):
            allowed = f"must be at least the Coulomb coefficient {toml_like(self.coulomb)}"
            raise problem("stiction", allowed, self.stiction)
        return self


def bristles(
    law: JointFrictionSettings | TendonFrictionSettings, numbers: Mapping[str, Array], extra: Number = 0.0
) -> dict[str, Array]:
    """Return the numbers that friction of tendons and of joints share, by the laws' names, one per item.

    Args:
        law: Numbers of friction.
        numbers: Those of ``law``, one per tendon or joint.
        extra: Level without load besides the drag and the floor of ``law``, of the same unit.
    """
    names = ("viscous", "stribeck_velocity", "floor", "stribeck_exponent")
    shared: dict[str, Array] = {name: numbers[name] for name in names}
    softest, give = _TENDON_BRISTLES if isinstance(law, TendonFrictionSettings) else _JOINT_BRISTLES
    level = np.maximum(np.maximum(numbers["drag"], numbers["floor"]), extra)
    # In a hand some fingers may give it.
    stiffness = numbers.get("stiffness", np.full(len(numbers["floor"]), math.nan))
    free = np.isnan(stiffness)
    shared["stiffness"] = np.where(free, np.maximum(softest, level / give), stiffness)
    return shared | {"hardening": _PARTS * free / give, "lag": numbers["micro_damping"] / shared["stiffness"]}
