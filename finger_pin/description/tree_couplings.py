"""Couplings: joints or tendons of a tree, or actuated tendons, that follow others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Self

from pydantic import Field, model_validator

from finger_pin.description.validation import (
    Description,
    FullName,
    Name,
    Numbers,
    problem,
    quantity,
    real,
    reals,
    suggestion,
    vector,
)

#: The highest power of a coupling.
MOST_POWER = 7


class Coupling(Description):
    """A joint that follows another: q = offset + ratio q_other + powers[0] q_other^2 + ..., held by a stiff spring.

    Or a tendon that follows another by a ratio and an offset, as with a bar between them. Lengths count from where the
    joints are at their references. The spring takes F from the tension of the one, and gives ratio F to the other; it
    acts both ways, so that a cord that nothing else pulls may come to push.

    Two hinges in a row whose surfaces roll on each other, a rolling joint, have r q = r_other q_other: the arcs on both
    surfaces are equally long. The body between them is then as long as the radii together.
    """

    joint: Name | None = Field(None, description="The joint that follows.")
    tendon: FullName | None = Field(None, description="In place of joint: the tendon that follows.")
    other: FullName | None = Field(None, description="The joint or tendon that it follows; none: it is held.")
    ratio: Annotated[float, real(-1e3, 1e3)] = quantity(
        0.0, unit="1", source="design", doc="Angle of this joint per angle of the other; of tendons their lengths."
    )
    offset: Annotated[float, real(-1e3, 1e3)] = quantity(
        0.0, unit="rad", source="design", doc="Angle of this joint, or length in m, where the other is at zero."
    )
    powers: Annotated[Numbers, reals(-1e6, 1e6)] = quantity(
        0.0, unit="1", source="design", doc="Coefficients of the square of q_other and of higher powers, at most six."
    )
    rolling: Annotated[tuple[float, float], vector(2, 1e-6, 10.0)] | None = quantity(
        None, unit="m", source="design", doc="Radii of surfaces that roll, of this joint and the other."
    )
    stiffness: Annotated[float, real(0.0, 1e9)] = quantity(
        100.0,
        unit="N m/rad",
        source="estimate",
        doc="k, of the spring that holds its course; of tendons N/m, to be given.",
    )
    damping: Annotated[float, real(0.0, 1e9)] = quantity(
        0.1, unit="N m s/rad", source="estimate", doc="c, damping of that spring; of tendons N s/m, to be given."
    )

    @property
    def follower(self) -> str:
        """The joint or tendon that follows."""
        return str(self.joint or self.tendon)

    @property
    def slope(self) -> float:
        """The ratio, also of rolling surfaces."""
        return self.rolling[1] / self.rolling[0] if self.rolling else self.ratio

    @property
    def higher(self) -> tuple[float, ...]:
        """Coefficients of the square and of higher powers."""
        return self.powers if isinstance(self.powers, tuple) else (self.powers,)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.joint is None) == (self.tendon is None):
            raise problem("", "needs a joint or a tendon that follows, and not both")
        if self.tendon is not None and (self.rolling or any(self.higher)):
            raise problem("rolling" if self.rolling else "powers", "is of joints: a tendon follows by a ratio")
        for entry in ("stiffness", "damping"):
            if self.tendon is not None and entry not in self.model_fields_set:
                raise problem(entry, "is missing: that of tendons has no default")
        if self.tendon is not None and self.other == self.tendon:
            raise problem("other", "must be another tendon", self.other)
        if len(self.higher) > MOST_POWER - 1:
            raise problem("powers", f"must be at most {MOST_POWER - 1} numbers", list(self.higher))
        if self.other is None and (self.slope or any(self.higher)):
            raise problem("other", "is missing: ratio, powers and rolling are those of another joint")
        if self.rolling and (self.ratio or any(self.higher)):
            raise problem("rolling", "is the ratio: leave out ratio and powers", list(self.rolling))
        return self


def coupled(couplings: Mapping[str, Coupling], tendon: str | None) -> dict[str, float]:
    """Return the parts of couplings' forces in the tension of a tendon, by coupling."""
    of_tendons = {name: each for name, each in couplings.items() if each.tendon is not None}
    pulling = {name: each for name, each in of_tendons.items() if tendon in (each.tendon, each.other)}
    return {name: -1.0 if each.tendon == tendon else each.ratio for name, each in pulling.items()}


def check_tendon_couplings(couplings: Mapping[str, Coupling], actuated: Sequence[str]) -> None:
    """Refuse couplings of joints, of tendons that nothing could pull, and with the name of a tendon."""
    for name, coupling in couplings.items():
        if coupling.joint is not None:
            raise problem(
                f"couplings.{name}.joint", "is for finger.tree.couplings; here tendons follow", coupling.joint
            )
        if name in actuated:
            raise problem(f"couplings.{name}", "a tendon has this name; choose another")
        for entry in ("tendon", "other"):
            if (end := getattr(coupling, entry)) is not None and end not in actuated:
                allowed = f"no such actuated tendon; there are {', '.join(actuated) or 'none'}"
                raise problem(f"couplings.{name}.{entry}", allowed + suggestion(end, actuated), end)
