"""The cost of open contacts: nothing of the result, and no part of the linear systems."""

import numpy as np
import pytest
from core_cases import condensed
from test_contact_motion import G, plane, scene

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.description.objects import Object

HARD = {"stiffness": 1e4, "damping": 1.0, "friction": 0.5}


def balls():
    """Three on a table, of which two lean on each other, and one that falls on them from above."""
    places = {"left": (0.0, 0.0, 0.0199), "right": (0.0398, 0.0, 0.0199), "apart": (0.2, 0.1, 0.0199)}
    found = {
        name: Object(shape="sphere", radius=0.02, mass=0.1, position=place, surface=HARD)
        for name, place in places.items()
    }
    thrown = Object(shape="capsule", radius=0.01, length=0.03, mass=0.05, position=(0.01, 0.0, 0.2), surface=HARD)
    return {"table": plane(**HARD), **found, "thrown": thrown}


def stepper(mechanism, start, tolerance=1e-6):
    control = held_control(mechanism.channels, mechanism.coordinates)
    return Stepper(mechanism, control, start, TABLEAUS["Rodas5P"](), tolerance, np.full(mechanism.size, tolerance))


def test_contacts_that_sleep_change_not_one_bit_of_a_motion_in_which_they_wake_up_and_close():
    (one, start), (other, _) = scene((0.0, 0.0, -G), **balls()), scene((0.0, 0.0, -G), **balls())
    asleep, awake = stepper(one, start), stepper(other, start)
    (sleeper,), (waker,) = asleep.parts, awake.parts
    slept, closed, room = 0, np.zeros(len(sleeper.work.paths.culled), dtype=bool), waker.room(1)
    for k in range(1, 41):
        assert asleep.advance(0.01 * k) == 0
        while waker.time < 0.01 * k:
            waker.forget()
            waker.advance(0.01 * k, room)
        assert np.array_equal(asleep.x, awake.x)
        slept = max(slept, int(sleeper.work.paths.culled.sum()))
        closed |= waker.work.rows[ROW.force] != 0.0
    assert slept >= 15
    # The capsule met what it slept beside.
    names = one.rows[0].names
    assert any(closed[3 * index] for index, name in enumerate(names) if "thrown" in name)


def test_each_block_that_contacts_join_is_condensed_to_the_solution_of_the_dense_system():
    mechanism, start = scene((0.0, 0.0, -G), **balls())
    (part,) = stepper(mechanism, start).parts
    part.advance(2e-3)
    # Of what sleeps, states are zero, and are not solved for.
    part.forget()
    size, g = len(part.x), 1e4
    columns, rate = np.zeros((size + 1, size)), np.zeros(size)

    def rates(x):
        condensed(part.model.address, 0.0, x, g, rate, np.zeros(size + 1), columns)
        return rate.copy()

    steps = 1e-7 * np.concatenate([np.full(part.model.model.linear.mass.shape[0] * 2, 1.0), part.x[48:] * 0.0 + 1e-2])
    jacobian = np.array(
        [(rates(part.x + d) - rates(part.x - d)) / (2.0 * steps[i]) for i, d in enumerate(np.diag(steps))]
    ).T
    rates(part.x)
    dense = np.linalg.inv(g * np.eye(size) - jacobian)
    scale = np.abs(dense).max(axis=1, keepdims=True)
    assert np.abs(columns[:-1].T - dense) / scale == pytest.approx(0.0, abs=1e-6)
    # The leaning two, the third, and the one that falls.
    assert part.model.model.linear.blocks.number[0] == 3
