"""Columns of blocks that compiled code, laws and MuJoCo share are where their names say."""

import ctypes

import numpy as np
import pytest

from finger_pin.core.addresses.law_code import (
    ROW,
    SLOPE,
    SLOPE_COLUMNS,
    TOUCH_SLOPE,
    RowColumns,
    SlopeColumns,
    TouchSlopeColumns,
    addresses,
)
from finger_pin.core.tables.chains import BODY
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.exchange.mujoco_friction import ELEMENT, PIN, TENDON, Coefficients, ElementPlaces, PluginFriction
from finger_pin.laws.law import Law, Row, Touch
from finger_pin.mechanism.finger import Finger

HEEDED = [name for name in Row._fields if name != "side"]
NUMBER = ctypes.POINTER(ctypes.c_double)


def value(row, p):
    motion = 2.0 * row.length + 3.0 * row.speed + 5.0 * row.state + 7.0 * row.load
    rest = 11.0 * row.command + 13.0 * row.curvature + 17.0 * row.side + 19.0 * row.reading
    return p[0] * (motion + rest), motion - rest, motion * rest


def slopes(row, p, signals):
    a = p[0]
    by_force = (2.0 * a, 3.0 * a, 5.0 * a, 0.25, 7.0 * a, 11.0 * a, 13.0 * a, 19.0 * a)
    return by_force, (2.0, 3.0, 5.0, 7.0, -11.0, -13.0, -19.0)


def account(row, p, force, rate, signals):
    return force + 10.0 * rate, 100.0 * signals[0]


PROBE = Law("probe", ("a",), value, slopes, account, signals=("s",), losses=("lost",), scale=1.0, reads_states=True)


def test_columns_follow_the_arguments_of_laws():
    assert RowColumns._fields[: len(Row._fields)] == Row._fields
    by_force = [f"force_by_{name}" for name in HEEDED]
    by_force.insert(1 + HEEDED.index("state"), "force_by_rate")
    assert list(SlopeColumns._fields) == by_force + [f"rate_by_{name}" for name in HEEDED]
    moved = [name for name in Touch._fields if name != "side"]
    assert list(TouchSlopeColumns._fields) == [f"{what}_by_{name}" for what in ("force", "rate") for name in moved]
    # A block of slopes has room for both kinds of laws.
    assert len(set(TOUCH_SLOPE)) == len(TOUCH_SLOPE) and max(*SLOPE, *TOUCH_SLOPE) < SLOPE_COLUMNS


def test_compiled_laws_read_and_fill_named_columns():
    rng, count, begin = np.random.default_rng(1), 4, 1
    rows, filled = rng.normal(size=(ROW.signals + 1, count)), np.zeros((len(SLOPE), count))
    parameters, powers = rng.normal(size=(1, count)), np.zeros((2, count))
    seen = Row(**{name: rows[getattr(ROW, name), begin:] for name in Row._fields})
    expected = value(seen, parameters[:, begin:])
    before = rows.copy()
    law, stride = addresses(PROBE), [ctypes.c_int64(n) for n in (count, begin, count)]
    kind = [ctypes.CFUNCTYPE(None, *[NUMBER] * tables, *[ctypes.c_int64] * 3) for tables in (2, 3)]
    rows_at, parameters_at, filled_at, powers_at = (
        each.ctypes.data_as(NUMBER) for each in (rows, parameters, filled, powers)
    )
    kind[0](law.value)(rows_at, parameters_at, *stride)
    for column, numbers in zip((ROW.force, ROW.rate, ROW.signals), expected, strict=True):
        assert rows[column, begin:] == pytest.approx(numbers, rel=1e-12)
        before[column, begin:] = rows[column, begin:]
    # What is no result, and the row before the first, stay.
    assert np.array_equal(rows, before)
    kind[1](law.slopes)(rows_at, parameters_at, filled_at, *stride)
    for name in HEEDED:
        # Both are linear in every argument: the difference is the slope.
        more = value(seen._replace(**{name: getattr(seen, name) + 1.0}), parameters[:, begin:])
        for what, one, other in zip(("force", "rate"), more, expected, strict=False):
            assert filled[getattr(SLOPE, f"{what}_by_{name}"), begin:] == pytest.approx(one - other, rel=1e-9)
    assert np.all(filled[SLOPE.force_by_rate, begin:] == 0.25)
    kind[1](law.account)(rows_at, parameters_at, powers_at, *stride)
    assert powers[:, begin:] == pytest.approx(np.array(account(seen, parameters, *expected[:2], expected[2:])))


def test_columns_of_bodies_are_those_of_the_model():
    finger = Finger("reversals")
    bodies, model = compile_mechanism(finger.mechanism)[1].bodies, finger.mechanism.body.model
    inertias = list(model.inertias)[1:]
    assert bodies[:, BODY.mass] == pytest.approx([each.mass for each in inertias])
    assert bodies[:, BODY.armature] == pytest.approx(model.armature)
    # What no turn of a frame changes: lengths, and the trace of the inertia.
    for first, vectors in (
        (BODY.translation, [each.translation for each in model.jointPlacements[1:]]),
        (BODY.centre, [each.lever for each in inertias]),
    ):
        lengths = np.linalg.norm(bodies[:, first : first + 3], axis=1)
        assert lengths == pytest.approx(np.linalg.norm(vectors, axis=1))
    trace = bodies[:, BODY.inertia] + bodies[:, BODY.inertia + 3] + bodies[:, BODY.inertia + 5]
    assert trace == pytest.approx([np.trace(each.inertia) for each in inertias])
    for rotation in bodies[:, BODY.rotation : BODY.rotation + 9].reshape(-1, 3, 3):
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
    assert bodies.shape[1] == BODY.armature + 1


@pytest.mark.parametrize("kind", [TENDON, PIN])
def test_elements_of_a_friction_carry_what_their_names_say(kind):
    law = Coefficients(*(0.5 + k for k in range(len(Coefficients._fields))))
    more = ((True, "crossed", -3.0), (False, "pulley", -4.0))
    friction = PluginFriction(kind, "rubbing", "acting", kind == TENDON, -2.0, law, more, share=-5.0, constrained=True)
    elements = list(friction.elements())
    own, row = ("tendon", "joint") if kind == TENDON else ("joint", "tendon")
    expected = {"length": len(elements), "kind": kind, "share": -5.0, "loads": friction.loads, **law._asdict()}
    for name in ElementPlaces._fields:
        place = getattr(ELEMENT, name)
        assert elements[place] == ((row, "acting", -2.0) if name == "ratio" else (own, "rubbing", expected[name]))
    assert elements[len(ELEMENT) :] == [("joint", "crossed", -3.0), ("tendon", "pulley", -4.0)]
