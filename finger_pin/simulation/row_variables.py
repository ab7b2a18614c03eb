"""Variables of the mechanism's rows: signals of tables, and the energy account."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import LOST, Rows
from finger_pin.simulation.energy import flow_terms, stored_terms
from finger_pin.simulation.sampled_trajectory import Quantity, SampledTrajectory
from finger_pin.typing import Array

_DIMS = ("time",)
RESIDUAL = "energy_residual"


def extra_row_variables(tables: tuple[Rows, ...]) -> dict[str, Quantity]:
    """Return the signals of the rows of some tables, by name."""

    def row_signal(run: SampledTrajectory, group: str, name: str) -> Array:
        rows = run.finger.mechanism.rows[group]
        return np.asarray(getattr(rows.row, name))

    def force(run: SampledTrajectory, group: str) -> Array:
        return run.finger.mechanism.rows[group].force

    def law_signal(run: SampledTrajectory, group: str, index: int) -> Array:
        return run.finger.mechanism.rows[group].signals[index]

    quantities: dict[str, Quantity] = {}
    for table in tables:
        group = table.group
        units = {"length": table.unit, "speed": f"{table.unit}/s", "force": "N m" if table.unit == "rad" else "N"}
        values: dict[str, Callable[[SampledTrajectory], Array]] = {"force": partial(force, group=group)}
        values |= {name: partial(row_signal, group=group, name=name) for name in ("length", "speed")}
        values |= {name: partial(law_signal, group=group, index=i) for i, name in enumerate(table.law.signals)}
        if np.any(table.channels >= 0):
            values["input"] = partial(row_signal, group=group, name="command")
        if table.law.scale is not None:
            values["state"] = partial(row_signal, group=group, name="state")
        for name, value in values.items():
            unit = units.get(name, "SI") if table.unit else "SI"
            quantities[f"{group}_{name}"] = Quantity(("time", group), value, unit, f"{name} of {table.law.name}")
    return quantities


def cord_variables(finger: Finger) -> dict[str, Quantity]:
    """Return the tension of the cords that no motor of the finger pulls, by the name of the variable; empty if none."""
    if not finger.cord_names:
        return {}
    text = "delivered tension of a cord that servos, muscles or springs pull; negative where a servo pushes it"
    return {"cord_tension": Quantity(("time", "cord"), lambda run: run.finger.cord_tension, "N", text, "12")}


def account_variables(finger: Finger) -> dict[str, Quantity]:
    """Return the stored energies, the powers, their integrals and the residual of the account, by name."""

    def stored(run: SampledTrajectory, name: str) -> Array:
        return run.stored[name]

    def power(run: SampledTrajectory, name: str) -> Array:
        return run.powers[name]

    def work(run: SampledTrajectory, name: str) -> Array:
        return run.account.works[name]

    table = {}
    for term in stored_terms(finger):
        table[f"energy_{term.name}"] = Quantity(
            _DIMS, partial(stored, name=term.name), "J", f"energy stored: {term.label}", energy_term=term
        )
    # Supplied powers come before losses.
    for term in sorted(flow_terms(finger.mechanism.energies), key=lambda term: term.kind == LOST):
        name, text = term.name, f"{term.kind}: {term.label}"
        table[f"power_{name}"] = Quantity(_DIMS, partial(power, name=name), "W", f"power {text}", energy_term=term)
        table[f"energy_exchanged_{name}"] = Quantity(
            _DIMS, partial(work, name=name), "J", f"energy {text}", energy_term=term
        )
    text = "stored energy less its start, less supplied, plus lost: zero for an exact integration"
    table[RESIDUAL] = Quantity(_DIMS, lambda run: run.account.residual, "J", text)
    return table
