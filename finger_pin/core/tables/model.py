"""Compiled model of a mechanism: structure, parameters, inputs and memory at one address."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import StructType, Vector
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.inputs import InputTable
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure


class Model(NamedTuple):
    """The structure, parameters, inputs and memory of an evaluation and its linearisation.

    Attributes:
        structure, parameters: The mechanism.
        control: Its inputs.
        work: Memory of an evaluation.
        linear: Memory of a linearisation.
        state: State of the evaluation, shape (size,).
        rate: Its rate, shape (size,).
        evaluate: Address of the function that fills ``rate``, at a time.
        exert: Address of what it calls for the rows.
        linearise: Address of the function that fills all partial derivatives after it, at a time.
        condense: Address of the function that fills the solution of (g - J) u = r for a g; 0 where it is singular.
        measure: Address of what `exert` calls for paths through space and contacts; 0 without, as for the next four.
        linearise_paths: Address of what `linearise` calls for them.
        fill_contact_gains: Address of what `condense` calls for contacts.
        add_pushes: Address of what it calls for the pin of a row that their forces may pass.
        look: Address of what places the bodies and measures a piece; 0 if it is out of reach.
        move_base: Address of what `evaluate` calls for a base that moves; 0 at rest, as for the next two.
        bias_rate: Address of what `linearise` calls for it.
        base_power: Address of what fills the power that it supplies.
    """

    structure: Structure
    parameters: Parameters
    control: InputTable
    work: Work
    linear: Linear
    state: Vector
    rate: Vector
    evaluate: int
    exert: int
    linearise: int
    condense: int
    measure: int
    linearise_paths: int
    fill_contact_gains: int
    add_pushes: int
    look: int
    move_base: int
    bias_rate: int
    base_power: int


MODEL = StructType(Model)
