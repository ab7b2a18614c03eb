"""Controllers side by side on the same motion: tracking, tensions, and losses by friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.simulation.frames import read_scene
from finger_pin.typing import Array

SETTLED = 1.0

_SAMPLED = {"controller.sampling.period": 1e-3}
# Damping where a joint has some inertia; the distal two are so light that a sampled derivative would shake them.
_PD = {"controller.damping": [3e-3, 3e-3, 0.0, 0.0], "controller.gravity_compensation": True, **_SAMPLED}
_TENDONS = {"controller.tendon_friction_feedforward.share": 1.0}
_JOINTS = {"controller.joint_friction_compensation.share": 1.0}
_BOTH = {**_PD, **_TENDONS, **_JOINTS}
_TAUT = {"controller.passive_tension": 4.0}
_LOOP = {"controller.passive_tension_loop.integral": 10.0}
_REAL = {
    "controller.sampling.delay": 5e-4,
    "controller.sampling.encoder_resolution": 1e-4,
    "controller.sampling.tension_noise": 0.05,
    "controller.sampling.seed": 1,
}
_LOW = {"controller.minimum_tension": 0.5}

#: Overrides of `fig6` by what they make of its controller. All are sampled at 1 kHz, so that nothing else differs.
CASES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": _SAMPLED,
        "PD + gravity": _PD,
        "PD + gravity + tendons": {**_PD, **_TENDONS},
        "PD + gravity + joints": {**_PD, **_JOINTS},
        "all friction": _BOTH,
        "paper, f5d 4 N": {**_SAMPLED, **_TAUT},
        "all friction, f5d 4 N": {**_BOTH, **_TAUT},
        "all friction, f5d 4 N, loop": {**_BOTH, **_TAUT, **_LOOP},
        "the same, late, real sensors": {**_BOTH, **_TAUT, **_LOOP, **_REAL},
        "paper, f0 0.5 N": {**_SAMPLED, **_LOW},
        "all friction, f0 0.5 N": {**_BOTH, **_LOW},
    }
)


@dataclass(frozen=True, eq=False)
class Comparison:
    """One controller's figures, over the samples after the first second.

    Attributes:
        name: Which controller.
        joint_error: Rms of theta^d - theta, shape (n,), deg.
        error: Rms over all joints, deg.
        passive_error: The part of ``error`` that the passive tendons' stretch enforces, deg: the least error at which
            they carry what they do, where their reference (20) would have them carry f5^d.
        peak_tension: Largest command, N.
        mean_tension: Mean command over the actuated tendons, N.
        tendon_loss: Energy lost in the tendons' friction, mJ.
        joint_loss: Energy lost in the joints' friction, mJ.
        passive_tension: Mean delivered tension of the passive tendons, shape (p,), N.
    """

    name: str
    joint_error: Array
    error: float
    passive_error: float
    peak_tension: float
    mean_tension: float
    tendon_loss: float
    joint_loss: float
    passive_tension: Array


def compare(name: str, result: xr.Dataset, coupling: Array) -> Comparison:
    """Return the figures of a result.

    Args:
        name: Which controller.
        result: Dataset of `simulate`, longer than a second.
        coupling: H_c of its finger, shape (t, n), m.
    """
    part = result.sel(time=slice(SETTLED, None))
    tendons = read_scene(result.attrs).finger.tendons
    passive = np.array([tendons[str(name)].kind == "passive" for name in result["tendon"].values])
    error = np.rad2deg(part["tracking_error"].transpose("time", "joint").values)
    rows = coupling[passive]
    enforced = error @ (np.linalg.pinv(rows) @ rows).T
    command = part["tendon_command"].transpose("time", "tendon").values[:, ~passive]
    tension = part["tendon_tension"].transpose("time", "tendon").values[:, passive]
    lost = {
        kind: sum(
            float(np.ptp(part[f"energy_exchanged_{kind}_{law}"].values[[0, -1]]))
            for law in ("coulomb", "viscous", "micro_damping")
        )
        for kind in ("tendon", "joint")
    }
    return Comparison(
        name=name,
        joint_error=np.sqrt(np.mean(error**2, axis=0)),
        error=float(np.sqrt(np.mean(error**2))),
        passive_error=float(np.sqrt(np.mean(enforced**2))),
        peak_tension=float(command.max()),
        mean_tension=float(command.mean()),
        tendon_loss=1e3 * lost["tendon"],
        joint_loss=1e3 * lost["joint"],
        passive_tension=tension.mean(axis=0),
    )


_COLUMNS = {
    "rms error (deg)": "error",
    "rms error by passive tendons (deg)": "passive_error",
    "peak command (N)": "peak_tension",
    "mean command (N)": "mean_tension",
    "tendon loss (mJ)": "tendon_loss",
    "joint loss (mJ)": "joint_loss",
}


def csv_rows(rows: list[Comparison], joints: list[str], passive: list[str]) -> Iterator[list[str]]:
    """Yield a header that has the units, and rows as text."""
    tensions = (f"mean tension {name} (N)" for name in passive)
    yield ["controller", *(f"rms error {joint} (deg)" for joint in joints), *_COLUMNS, *tensions]
    for row in rows:
        numbers = [*row.joint_error, *(getattr(row, name) for name in _COLUMNS.values()), *row.passive_tension]
        yield [row.name, *(f"{number:.6g}" for number in numbers)]
