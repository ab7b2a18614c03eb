"""Numbers of a muscle, as MuJoCo's; its law is `finger_pin.laws.muscle`."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import model_validator

from finger_pin.description.validation import Description, problem, quantity, real, vector

Pair = tuple[float, float]
_MUJOCO = "MuJoCo's default"


class Muscle(Description):
    """A muscle; lengths without a unit are in optimal lengths L_0, at which its active force is largest.

    L_0 is that with which ``length_range`` (of the tendon or joint, times gear) is ``range``.
    """

    force: Annotated[float, real(0.0, 1e7, above=True)] = quantity(
        ..., unit="N", source="design", doc="F, most active force at rest."
    )
    length_range: Annotated[Pair, vector(2, -1e3, 1e3)] = quantity(
        ..., unit="m", source="design", doc="Lengths of what it drives at which it is as long as range says."
    )
    range: Annotated[Pair, vector(2, 0.0, 100.0)] = quantity(
        (0.75, 1.05), unit="1", source=_MUJOCO, doc="Its own least and largest length."
    )
    lmin: Annotated[float, real(0.0, 1.0)] = quantity(
        0.5, unit="1", source=_MUJOCO, doc="Length below which it exerts no active force."
    )
    lmax: Annotated[float, real(1.0, 100.0, above=True)] = quantity(
        1.6, unit="1", source=_MUJOCO, doc="Length above which it exerts no active force."
    )
    vmax: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        1.5, unit="1/s", source=_MUJOCO, doc="Speed of shortening at which it exerts no active force."
    )
    fpmax: Annotated[float, real(0.0, 1e3)] = quantity(
        1.3, unit="1", source=_MUJOCO, doc="Passive force at lmax over F."
    )
    fvmax: Annotated[float, real(1.0, 1e3)] = quantity(
        1.2, unit="1", source=_MUJOCO, doc="Active force while it is lengthened fast, over that at rest."
    )
    time_constants: Annotated[Pair, vector(2, 1e-6, 1e3)] = quantity(
        (0.01, 0.04), unit="s", source=_MUJOCO, doc="Of activation and of deactivation."
    )
    smoothing: Annotated[float, real(0.0, 1.0)] = quantity(
        0.0, unit="1", source=_MUJOCO, doc="Width, in activation, over which one time constant passes into the other."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for entry in ("length_range", "range"):
            low, high = getattr(self, entry)
            if low >= high:
                raise problem(entry, "the least length must be below the largest", [low, high])
        if self.lmin >= 1.0:
            raise problem("lmin", "must be below 1, the optimal length", self.lmin)
        return self

    @property
    def optimal_length(self) -> float:
        """L_0, m, of what it drives."""
        return (self.length_range[1] - self.length_range[0]) / (self.range[1] - self.range[0])
