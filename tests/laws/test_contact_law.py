"""The contact's law: exact slopes, an account of every power, and compiled as it is in NumPy."""

import numba
import numpy as np
import pytest
from law_cases import for_complex

from finger_pin.core.jit import inlined
from finger_pin.laws.contact_law import CONTACT
from finger_pin.laws.law import Touch

COUNT, STEP = 4000, 1e-30
SEEN = Touch._fields[:8]
#: Of order one; the friction falls by half.
RANGES = {"exponent": (1.0, 2.0), "static": (0.5, 1.0), "kinetic": (0.2, 0.5), "floor": (1e-3, 1.0)}


@pytest.fixture(scope="module")
def drawn():
    """Contacts of order one: open and closed, sticking and sliding, some held on a side of their kink."""
    rng = np.random.default_rng(5)
    touch = Touch(*rng.normal(size=(8, COUNT)), np.resize([0.0, 0.0, 1.0, -1.0], COUNT))
    touch = touch._replace(gap=touch.gap * 10.0 ** rng.uniform(-3, 0, COUNT))
    p = np.array([rng.uniform(*RANGES.get(name, (0.1, 2.0)), COUNT) for name in CONTACT.parameters])
    return touch, p


def along(function, touch, name):
    found = function(touch._replace(**{name: getattr(touch, name) + STEP * 1j}))
    return [np.imag(np.broadcast_to(each, COUNT)) / STEP for each in found]


def test_slopes_are_the_derivatives_of_the_value(drawn):
    touch, p = drawn
    found = CONTACT.slopes(touch, p, CONTACT.value(touch, p)[7:])
    assert [len(each) for each in found] == [8] * 7
    # Held in touch where it pulls, its friction is zero while the slopes stay those of touch.
    left = (touch.side > 0.0) & (CONTACT.value(touch, p)[0] <= 0.0)
    value = for_complex(CONTACT.value)
    for column, name in enumerate(SEEN):
        for of, expected in zip(found, along(lambda moved: value(moved, p), touch, name), strict=False):
            right = np.abs(of[column] - expected) <= 1e-12 * (1e-2 + np.abs(expected))
            assert np.all(right | left), name


def test_the_account_explains_the_power_of_all_forces_and_no_loss_is_negative(drawn):
    touch, p = drawn
    values = CONTACT.value(touch, p)
    (f_n, f_1, f_2, f_3), rates, signals = values[:4], values[4:7], values[7:]
    _, *losses = CONTACT.account(touch, p, values[:4], rates, signals)
    assert (len(signals), len(losses)) == (len(CONTACT.signals), len(CONTACT.losses))
    value, account = for_complex(CONTACT.value), for_complex(CONTACT.account)

    def stored(moved):
        values = value(moved, p)
        return account(moved, p, values[:4], values[4:7], values[7:])[:1]

    slope = {name: along(stored, touch, name)[0] for name in SEEN}
    change = slope["gap"] * touch.speed + sum(slope[f"state_{k + 1}"] * rates[k] for k in range(3))
    power = f_n * touch.speed + f_1 * touch.slip_1 + f_2 * touch.slip_2 + f_3 * touch.slip_3
    size = np.abs(power) + np.abs(change) + sum(np.abs(each) for each in losses)
    assert np.all(np.abs(power + change + sum(losses)) <= 1e-12 * size)
    for name in ("speed", "slip_1", "slip_2", "slip_3"):
        assert not slope[name].any()
    free = touch.side == 0.0
    for name, loss in zip(CONTACT.losses, losses, strict=True):
        assert np.all(loss[free] >= 0.0), name


def test_friction_never_leaves_the_cone(drawn):
    touch, p = drawn
    f_n, f_1, f_2, f_3, *_ = CONTACT.value(touch, p)
    static, radius = (p[CONTACT.parameters.index(name)] for name in ("static", "torsion_radius"))
    assert np.all(np.sqrt(f_1**2 + f_2**2 + (f_3 / radius) ** 2) <= static * np.maximum(f_n, 0.0) * (1.0 + 1e-14))
    assert np.count_nonzero(f_n) > COUNT / 4


def test_value_and_slopes_are_finite_without_normal_force_and_at_rest():
    p = np.array([1e4, 2.0, 1.5, 0.8, 0.6, 1e4, 1e-3, 1e-2, 1e-4, 0.01])
    for gap in (1e-3, 0.0, -1e-12, -1e-4):
        for bend in (0.0, 1e-300, 1e-9):
            touch = Touch(gap, 0.0, 0.0, 0.0, 0.0, bend, 0.0, 0.0)
            found = CONTACT.value(touch, p)
            slopes = np.array(CONTACT.slopes(touch, p, found[7:]))
            assert np.isfinite(found).all() and np.isfinite(slopes).all()
            # Forces by slips and states: those of a spring and a damper at most; rates: those of its relaxation.
            assert np.abs(slopes[1:4, 2:]).max() <= 1.001e4 and np.abs(slopes[4:, 2:]).max() <= 1.001e3


def test_compiled_it_is_what_it_is_in_numpy(drawn):
    touch, p = drawn
    value, slopes = inlined(CONTACT.value), inlined(CONTACT.slopes)

    @numba.njit
    def run(seen, p, found, slope):
        touch = Touch(seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], seen[6], seen[7], seen[8])
        numbers = (p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9])
        results = value(touch, numbers)
        for r in range(10):
            found[r] = results[r]
        for r, row in enumerate(slopes(touch, numbers, results[7:])):
            for c in range(8):
                slope[r, c] = row[c]

    found, slope = np.empty(10), np.empty((7, 8))
    for k in range(0, COUNT, 200):
        one = Touch(*(float(each[k]) for each in touch))
        run(np.array(one), p[:, k], found, slope)
        expected = CONTACT.value(one, p[:, k])
        assert found == pytest.approx(expected, rel=1e-13, abs=1e-15)
        assert slope == pytest.approx(np.array(CONTACT.slopes(one, p[:, k], expected[5:])), rel=1e-12, abs=1e-13)
