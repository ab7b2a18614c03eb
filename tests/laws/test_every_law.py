"""The promises of every law that there is: exact slopes, and an account of every power."""

import numpy as np
import pytest
from law_cases import every_law, for_complex, random_parameters, random_rows

from finger_pin.core.addresses import law_code
from finger_pin.core.jit import address_of
from finger_pin.core.jit.digests import cache_root
from finger_pin.core.jit.functions import _named as kept_function
from finger_pin.laws.law import Law, Row

LAWS, COUNT, STEP = every_law(), 3000, 1e-30
ALLOCATING = Law(
    "allocating",
    ("stiffness",),
    lambda row, p: (np.where(row.length > 0.0, p[0], 0.0) * 1.0, 0.0),
    lambda row, p, signals: ((0.0,) * 7, (0.0,) * 6),
    lambda row, p, force, rate, signals: (0.0,),
)
SEEN = [name for name in Row._fields if name not in ("side", "reading")]


@pytest.fixture(params=LAWS.values(), ids=LAWS.keys())
def drawn(request):
    """A law with random rows and parameters."""
    rng = np.random.default_rng(21)
    return request.param, random_rows(rng, COUNT), random_parameters(request.param, rng, COUNT)


def along(function, row, name):
    """The derivative of a function of a row by one number of the row, by a step into the complex."""
    stepped = function(row._replace(**{name: getattr(row, name) + STEP * 1j}))
    return [np.imag(np.broadcast_to(each, COUNT)) / STEP for each in stepped]


@pytest.mark.slow
@pytest.mark.parametrize("law", [*LAWS.values(), ALLOCATING], ids=[*LAWS, "one that allocates"])
def test_compiled_laws_allocate_no_memory(law, monkeypatch):
    """Numba makes arrays of numbers where `np.where` chooses between them, half as much again of a servo's cost."""
    functions = []

    def seen(signature, function, announced):
        functions.append(function)
        return address_of(signature, function, announced)

    monkeypatch.setattr(law_code, "address_of", seen)
    law_code.addresses.__wrapped__(law)
    # What is kept on disk names what it calls.
    names = [kept_function(function).__name__ for function in functions]
    code = [path.read_bytes() for name in names for path in cache_root().rglob(f"*{name}*.nbc")]
    assert len(code) == 3 and any(b"NRT_" in each for each in code) == (law is ALLOCATING)


def test_the_laws_of_the_paper_are_found():
    assert {"PIN_FRICTION", "DRIVEN_TENDON", "PASSIVE_FRICTION", "TENDON_HALF", "STROKE_LIMITER"} <= set(LAWS)


def test_slopes_are_the_derivatives_of_the_value(drawn):
    """That of the force by the rate of its own state counts through the rate; rows follow or are held on a side."""
    law, row, p = drawn
    row = row._replace(side=np.resize([0.0, 1.0, -1.0], COUNT))
    signals = law.value(row, p)[2:]
    of_force, of_rate = law.slopes(row, p, signals)
    of_force, by_rate = [*of_force[:3], *of_force[4:]], of_force[3]
    value = for_complex(law.value)
    for name, direct, rate in zip([*SEEN, *["reading"] * law.reads_states], of_force, of_rate, strict=True):
        force_slope, rate_slope, *_ = along(lambda moved: value(moved, p), row, name)
        size = np.abs(direct) + np.abs(by_rate * rate) + 1e-3
        assert np.all(np.abs(direct + by_rate * rate - force_slope) < 1e-12 * size), name
        assert np.all(np.abs(rate - rate_slope) <= 1e-11 * np.abs(rate_slope)), name


def test_a_law_that_is_held_on_a_side_of_its_kink_is_finite_far_beyond_it_and_without_load(drawn):
    """Unloaded, as a cord is that lets go where its shortest way changes sides: 0 times what overflows is no number."""
    law, row, p = drawn
    nothing = np.zeros(COUNT)
    row = row._replace(side=np.resize([1.0, -1.0], COUNT), speed=3e3 * row.speed, load=nothing, command=nothing)
    with np.errstate(over="raise", invalid="raise"):
        value = law.value(row, p)
        slopes = law.slopes(row, p, value[2:])
    assert all(np.all(np.isfinite(each)) for each in (*value, *slopes[0], *slopes[1]))


def test_value_slopes_and_account_return_what_the_law_declares(drawn):
    law, row, p = drawn
    force, rate, *signals = law.value(row, p)
    of_force, of_rate = law.slopes(row, p, signals)
    stored = law.account(row, p, force, rate, signals)
    assert len(signals) == len(law.signals)
    assert (len(of_force), len(of_rate)) == (7 + law.reads_states, 6 + law.reads_states)
    assert len(stored) == 1 + len(law.supplies) + len(law.losses)
    if law.scale is None:
        assert not np.any(rate) and not any(np.any(slope) for slope in of_rate)


@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if law.work])
def test_work_of_a_law_grows_with_the_length_by_the_force_that_it_supplies_at_rest(name):
    """The force is the slope of the supplied power by the speed; a third of the rows have the same at all lengths."""
    law, rng = LAWS[name], np.random.default_rng(22)
    row, p = random_rows(rng, COUNT)._replace(speed=np.zeros(COUNT)), random_parameters(law, rng, COUNT)
    if "by_length" in law.parameters:
        p[law.parameters.index("by_length"), ::3] = 0.0
    value, account, work = map(for_complex, (law.value, law.account, law.work))

    def supplied(moved):
        force, rate, *signals = value(moved, p)
        return account(moved, p, force, rate, signals)[1:2]

    (slope,) = along(lambda moved: [work(moved, p, value(moved, p)[2:])], row, "length")
    (expected,) = along(supplied, row, "speed")
    assert np.ptp(expected) > 0.1
    np.testing.assert_allclose(slope, expected, rtol=1e-12, atol=1e-12)


def test_the_account_explains_the_power_of_every_row(drawn):
    """Force times speed is what is supplied, less what is lost, less the change of what is stored."""
    law, row, p = drawn
    force, rate, *signals = law.value(row, p)
    _, *powers = law.account(row, p, force, rate, signals)
    signs = [1.0] * len(law.supplies) + [-1.0] * len(law.losses)
    value, account = for_complex(law.value), for_complex(law.account)

    def stored(moved):
        force, rate, *signals = value(moved, p)
        return account(moved, p, force, rate, signals)[:1]

    ((by_length,), (by_state,)) = along(stored, row, "length"), along(stored, row, "state")
    change = by_length * row.speed + by_state * rate
    explained = sum((s * each for s, each in zip(signs, powers, strict=True)), -change)
    if law is LAWS["SHEATH_PLACE"]:
        # What moves at it stretches its neighbours, which store that unless a winch supplies it.
        wound = p[law.parameters.index("wound")]
        explained = explained + (1.0 - wound) * (row.load - row.command) * (row.state - row.speed)
    size = np.abs(force * row.speed) + np.abs(change) + sum(np.abs(each) for each in powers)
    assert np.all(np.abs(force * row.speed - explained) <= 1e-12 * size)
    for name in ("speed", "load", "command", "curvature"):
        assert not np.any(along(stored, row, name)), name


def test_a_wrong_slope_or_a_power_that_is_not_booked_is_found(drawn):
    """The two tests above fail for a law that is a little wrong."""
    law, row, p = drawn

    def wrong_slopes(row, p, signals):
        of_force, of_rate = law.slopes(row, p, signals)
        return (of_force[0], of_force[1] + 1e-6, *of_force[2:]), of_rate

    def wrong_account(row, p, force, rate, signals):
        stored, *powers = law.account(row, p, force, rate, signals)
        return stored + 1e-6 * row.length**2, *powers

    other = Law(**{**vars(law), "slopes": wrong_slopes, "account": wrong_account})
    for test in (test_slopes_are_the_derivatives_of_the_value, test_the_account_explains_the_power_of_every_row):
        with pytest.raises(AssertionError):
            test((other, row, p))
