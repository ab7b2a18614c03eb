"""A drive that stands in this file alone: a source of tension that follows its command late, f^a' = (u - f^a) / T."""

from dataclasses import replace

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger

LAG, PULLED, TENSION = 0.02, ("T3", "T4"), np.array([1.0, 1.0, 4.4, 3.1])  # s, N


def value(row, p):
    return row.state, (row.command - row.state) / p[0]


def slopes(row, p, signals):
    return (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0 / p[0], 0.0, 1.0 / p[0], 0.0)


def account(row, p, force, rate, signals):
    return 0.0 * force, force * row.speed


MUSCLE = fp.Law("muscle", ("lag",), value, slopes, account, supplies=("pressure",), scale=1.0)


def with_muscles(finger):
    """The same finger with muscles in place of two ideal sources."""
    places = [finger.routing.tendons.index(name) for name in PULLED]
    arm = np.zeros((2, finger.mechanism.coordinates))
    arm[:, : len(finger.routing.joints)] = finger.coupling[places]
    rows = fp.Rows("muscles", MUSCLE, PULLED, np.full((1, 2), LAG), arm, channels=np.array(places), pulls=PULLED)
    return fp.Finger(finger.description, rows=[rows])


@pytest.fixture(scope="module")
def driven(finger):
    return with_muscles(finger)


@pytest.mark.slow
def test_a_tendon_under_a_drive_does_what_it_does_under_an_ideal_source_of_that_tension(driven, finger):
    """At any state: friction in canals and joints, torque and acceleration, by both evaluators."""
    rng, parts = np.random.default_rng(4), finger.layout.unpack
    x = np.array([finger.rest_state(q) for q in rng.uniform(0.1, 0.8, (20, 4)) * [0.1, 1.0, 1.0, 1.0]])
    x += 0.05 * rng.normal(size=x.shape) * finger.layout.scales()
    acting = np.column_stack([np.tile(TENSION[:2], (20, 1)), rng.uniform(1.0, 5.0, (20, 2))])
    expected = finger.evaluate(x, acting)
    state = driven.layout.unpack(np.zeros((20, driven.layout.size)))
    for name in vars(parts(x)):
        getattr(state, name)[...] = acting[:, 2:] if name == "drives" else getattr(parts(x), name)
    packed = driven.layout.pack(state)
    for found in (driven.evaluate(packed, TENSION), CompiledFinger(driven).evaluate(packed, TENSION)):
        np.testing.assert_allclose(found.strands, expected.strands, rtol=1e-12)
        entering = (each.rows["driven_tendons"].row.command for each in (found, expected))
        np.testing.assert_allclose(*entering, rtol=1e-12)
        np.testing.assert_allclose(found["joint_reaction"], expected["joint_reaction"], rtol=1e-12)
        np.testing.assert_allclose(found["joint_torque"], expected["joint_torque"], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(found["joint_acceleration"], expected["joint_acceleration"], rtol=1e-9)


def test_a_run_records_it_and_its_energy_and_it_answers_a_step_as_its_equation_does(driven):
    """f^a = u (1 - exp(-t / T)), whatever the finger does meanwhile; its power is f^a times the tendon's velocity."""
    times = np.array([0.0, 0.1])
    overrides = {"simulation.duration": 0.1, "simulation.rtol": 1e-7, "simulation.atol_scale": 1e-7}
    scenario = fp.load_scenario("reversals", overrides)
    result = fp.simulate(scenario, finger=driven, controller=(times, np.tile(TENSION, (2, 1))))
    expected = TENSION[2:] * (1.0 - np.exp(-result.time.values[:, None] / LAG))
    np.testing.assert_allclose(result.muscles_force, expected, atol=1e-5)
    assert list(result.muscles.values) == list(PULLED)
    power = np.sum(expected * result.tendon_velocity.sel(tendon=list(PULLED)).values, axis=1)
    np.testing.assert_allclose(result.power_muscles_pressure, power, atol=1e-4 * np.abs(power).max())
    assert result.power_muscles_pressure.account == "supplied" and abs(result.energy_residual).max() < 1e-6
    delivered, friction = (result[f"tendon_{name}"].sel(tendon=list(PULLED)) for name in ("tension", "friction"))
    np.testing.assert_allclose(delivered, np.maximum(0.0, expected - friction.values), atol=1e-5)


def test_a_drive_of_a_tendon_that_is_not_there_is_refused(finger):
    rows = fp.Rows("muscles", MUSCLE, ("T9",), np.full((1, 1), LAG), np.zeros((1, 5)), pulls=("T9",))
    with pytest.raises(fp.InputError, match=r"rows.muscles.pulls = .T9.: no such tendon.*T1, T2, T3, T4"):
        fp.Finger(finger.description, rows=[rows])


def test_a_run_of_it_goes_on_from_its_state(driven):
    """The tension after two times 10 ms is that of a first-order lag after 20 ms."""
    short = fp.load_scenario("reversals", {"simulation.duration": 0.01, "simulation.rtol": 1e-8})
    held = np.array([0.0, 0.01]), np.tile(TENSION, (2, 1))
    first = fp.simulate(short, finger=driven, controller=held)
    second = fp.simulate(short, finger=driven, controller=held, initial=first)
    np.testing.assert_allclose(second.muscles_force[-1], TENSION[2:] * (1.0 - np.exp(-0.02 / LAG)), atol=1e-6)


@pytest.mark.parametrize("listed", [slice(None), slice(None, None, -1)], ids=["reader first", "reader last"])
def test_a_drive_may_read_a_row_wherever_that_is_listed(finger, listed):
    """Two lags after each other: f^a = u (1 - (1 + t / T) exp(-t / T))."""
    arm, one = np.zeros((1, finger.mechanism.coordinates)), np.ones((1, 1))
    numbers = np.full((1, 1), LAG)
    filtered = fp.Rows("filter", MUSCLE, ("T3",), numbers, arm, channels=np.array([2]))
    rows = [fp.Rows("muscles", MUSCLE, ("T3",), numbers, arm, inputs={"filter": one}, pulls=("T3",)), filtered]
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.05, "simulation.rtol": 1e-8})
    held = np.array([0.0, 0.05]), np.tile(TENSION, (2, 1))
    result = fp.simulate(scenario, finger=fp.Finger(finger.description, rows=rows[listed]), controller=held)
    late = result.time.values / LAG
    np.testing.assert_allclose(
        result.muscles_force.squeeze(), TENSION[2] * (1.0 - (1.0 + late) * np.exp(-late)), atol=1e-5
    )


def test_rows_in_place_of_the_fingers_own_act_and_others_are_refused(finger):
    """Half the Coulomb coefficient by a replaced table is half of it by its key."""
    halved = lambda own: replace(own, parameters=own.parameters * [[0.5], *[[1.0]] * (len(own.parameters) - 1)])  # noqa: E731
    half = {"tendon_friction": {"coulomb": 0.5 * finger.description.tendon_friction.coulomb}}
    x = finger.rest_state([0.1, 0.5, 0.6, 0.7], [0.1, 1.0, 1.0, 1.0]) + 0.1 * finger.layout.scales()
    by_table = fp.Finger(finger.description, tables={"driven_tendons": halved, "passive_tendons": halved})
    by_key = fp.Finger(finger.description.updated(**half))
    found, expected, whole = (each.evaluate(x, TENSION).mechanism.rate for each in (by_table, by_key, finger))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.abs(found - whole).max() > 1e-3
    for tables, says in (
        ({"springs": halved}, r"^tables = .springs.: no such table of rows; there are .*driven_tendons"),
        ({"driven_tendons": lambda own: replace(own, names=("A", "B", "C", "D"))}, "^tables.driven_tendons: must have"),
        ({"driven_tendons": lambda own: replace(own, law=replace(own.law, signals=()))}, "signals: must begin"),
    ):
        with pytest.raises(fp.InputError, match=says):
            fp.Finger(finger.description, tables=tables)
