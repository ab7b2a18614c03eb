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


def boxes():
    """One that flies to another, without weight, and a third one far away."""
    one = {"shape": "box", "sides": (0.04, 0.04, 0.02), "mass": 0.1, "surface": HARD}
    places = {"flies": (0.0, 0.0, 0.0), "waits": (0.09, 0.01, 0.005), "apart": (0.5, 0.4, 0.0)}
    found = {name: Object(position=place, **one) for name, place in places.items()}
    return found | {"flies": found["flies"].updated(velocity=(0.6, 0.0, 0.0), angular_velocity=(0.0, 3.0, 1.0))}


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


def test_boxes_that_rest_as_pairs_wake_up_part_by_part_and_change_nothing():
    (one, start), (other, _) = scene((0.0, 0.0, 0.0), **boxes()), scene((0.0, 0.0, 0.0), **boxes())
    asleep, awake = stepper(one, start), stepper(other, start)
    (sleeper,), (waker,) = asleep.parts, awake.parts
    pairs = np.array(["-".join(sorted(name.split(".")[0].split("-"))) for name in one.rows[0].names])
    rested, met, room = [], False, waker.room(1)
    for k in range(1, 31):
        assert asleep.advance(0.01 * k) == 0
        while waker.time < 0.01 * k:
            waker.forget()
            waker.advance(0.01 * k, room)
        # What is left of bristles of open contacts, below 1e-14 m, is cleared as they fall asleep.
        np.testing.assert_allclose(asleep.x, awake.x, rtol=1e-9, atol=1e-12)
        rested.append(sleeper.work.paths.resting.copy())
        met |= bool(np.any(waker.work.rows[ROW.force][: 3 * len(pairs) : 3][pairs == "flies-waits"]))
    # The two that met rested once, and the one that is left alone does in the end.
    rests = dict(zip(dict.fromkeys(pairs), np.transpose(rested), strict=True))
    assert met and rests["flies-waits"].any() and not rests["flies-waits"].all() and rests["apart-waits"][-1]


def test_bodies_that_never_come_near_change_not_one_bit():
    """An error that is averaged over states of contacts that are open lets steps be longer, the more there are."""
    far = {
        f"far_{k}": Object(shape="box", sides=(0.1, 0.1, 0.1), position=(5.0 + k, 0.0, 0.0), surface=HARD)
        for k in range(4)
    }
    ends = []
    for objects in (balls(), balls() | far):
        mechanism, start = scene((0.0, 0.0, -G), **objects)
        run = stepper(mechanism, start)
        assert run.advance(0.3) == 0
        width = 2 * mechanism.coordinates
        ends.append((run.x[:width].copy(), sum(int(part.memory.accepted_steps[0]) for part in run.parts)))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert ends[0][1] == ends[1][1]


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
