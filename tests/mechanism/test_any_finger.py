"""Any finger that validation accepts: a run ends, or stops with the project's own error; never with NaN or a traceback.

Parameters are drawn from all that validation allows: no friction, huge stiffness, tiny masses, slack, hard limits.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import finger_pin as fp
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import validate
from finger_pin.exceptions import IntegrationError
from finger_pin.simulation.simulator import Simulator

# Starts beyond ranges are meant.
pytestmark = pytest.mark.filterwarnings("ignore::finger_pin.exceptions.StartWarning")

# A run of so short a time takes a second or two even where steps are as small as they may be.
LONGEST = 1e-4
# An energy, J, that only rounding makes, in a finger that rests without any.
NOTHING = 1e-30
FEW = settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=25,
    suppress_health_check=[
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
        HealthCheck.large_base_example,
        HealthCheck.filter_too_much,
    ],
)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


def magnitude(low: float, high: float, *special: float) -> st.SearchStrategy[float]:
    """Numbers of any order of magnitude, and special ones."""
    spread = between(math.log10(low), math.log10(high)).map(lambda e: min(max(10.0**e, low), high))
    return st.one_of(st.sampled_from(special), spread) if special else spread


def section(**entries: st.SearchStrategy[float]) -> st.SearchStrategy[dict[str, float]]:
    return st.fixed_dictionaries({}, optional=entries)


@st.composite
def joint_frictions(draw: st.DrawFn) -> dict[str, float]:
    kinetic = draw(magnitude(1e-9, 0.1, 0.0, 2.5e-4))
    further = section(
        stiffness=magnitude(1e-6, 1e9, 1e9),
        viscous=magnitude(1e-9, 1e6, 0.0),
        stribeck_velocity=magnitude(1e-9, 1e4),
        floor=magnitude(1e-12, 1e3),
    )
    return {"coulomb": kinetic, "stiction": min(0.1, kinetic * draw(st.sampled_from([1.0, 100.0]))), **draw(further)}


LINKS = st.fixed_dictionaries(
    {
        "length": magnitude(1e-3, 2.0, 0.03),
        "width": magnitude(1e-4, 1.0, 0.015),
        "mass": magnitude(1e-9, 100.0, 5e-3),
        "twist": st.sampled_from([0.0, math.pi / 2, -math.pi / 2, 1.0]),
        "section": st.sampled_from(["round", "square"]),
    },
    optional={"centre_of_mass": between(-2.0, 2.0)},
)
TENDON_FRICTION = section(
    coulomb=magnitude(1e-6, 10.0, 0.0),
    stiction_ratio=magnitude(1.0, 100.0),
    stiffness=magnitude(1e-6, 1e9, 1e9),
    viscous=magnitude(1e-6, 1e6, 0.0),
    stribeck_velocity=magnitude(1e-9, 1e3),
    floor=magnitude(1e-12, 1e3),
)
PASSIVE_TENDON = section(stiffness=magnitude(1e-3, 1e10), mass=magnitude(1e-12, 1.0))
STROKE_LIMITER = section(stiffness=magnitude(1e-3, 1e7, 0.0, 1e7), damping=magnitude(1e-3, 1e5, 0.0))
GRAVITIES = st.sampled_from([[0.0, 0.0, 0.0], [0.0, 0.0, -9.81], [1e3, -1e3, 1e3]])
FORCES = st.sampled_from([[0.0, 0.0, 0.0], [0.5, -1.0, 2.0], [0.0, 0.0, 1e6]])


@st.composite
def fingers(draw: st.DrawFn, closed: bool) -> dict:
    """A finger as a table; ``closed``: the last tendon balances all others, so that the network has force closure."""
    count = draw(st.integers(1, 7))
    size = draw(magnitude(1e-3, 0.03))
    joints = {}
    for index in range(count):
        low = -draw(between(0.01, 3.0))
        joints[f"j{index}"] = {"range": [low, low + draw(between(0.01, 4.0))], "link": draw(LINKS)}
    radii = st.one_of(st.just(0.0), between(0.3, 1.0), between(-1.0, -0.3)).map(lambda share: share * size)
    rows = []
    for index in range(count + draw(st.integers(0, 2)) if closed else draw(st.integers(1, count + 2))):
        row = np.array([draw(radii) for _ in range(count)])
        own = index % count
        if closed and index < count:
            row[own + 1 :] = 0.0
        if (closed and index < count) or not row.any():
            row[own] = size
        rows.append(row)
    passive = draw(st.sets(st.integers(0, len(rows) - 1), max_size=min(2, len(rows) - 1)))
    if closed:
        balance = -sum(draw(between(0.3, 3.0)) * row for row in rows)
        if not balance.any():
            balance = np.full(count, -size)
        rows.append(balance * min(1.0, 0.45 / abs(balance).max()))
    tendons = {}
    for index, row in enumerate(rows):
        crossings = {
            name: {"radius": float(radius), "bends": draw(st.booleans())}
            for name, radius in zip(joints, row, strict=True)
            if radius != 0.0
        }
        tendons[f"T{index}"] = {"curvature_offset": draw(magnitude(1e-3, 100.0, 0.0, 1.0)), "crossings": crossings}
        if index in passive:
            tendons[f"T{index}"] |= {"kind": "passive", "mass_after": draw(st.integers(0, len(crossings)))}
    return {
        "name": "any",
        "gravity": draw(GRAVITIES),
        "joints": joints,
        "tendons": tendons,
        "tendon_friction": draw(TENDON_FRICTION),
        "joint_friction": draw(joint_frictions()),
        "passive_tendon": draw(PASSIVE_TENDON),
        "stroke_limiter": draw(STROKE_LIMITER),
    }


@st.composite
def scenarios(draw: st.DrawFn) -> dict:
    finger = draw(fingers(closed=True))
    # A joint that a passive tendon drives has no reference of its own.
    driven = {list(each["crossings"])[-1] for each in finger["tendons"].values() if each.get("kind") == "passive"}
    swing = between(-3.0, 3.0)
    motion = section(offset=swing, amplitude=swing, frequency=magnitude(0.1, 1e4, 1.0), phase=swing)
    duration = draw(magnitude(1e-5, LONGEST))
    return {
        "name": "any",
        "finger": finger,
        "controller": {
            "gain": draw(magnitude(1e-4, 1e6, 0.0, 1.0)),
            "minimum_tension": draw(magnitude(1e-6, 1e5, 0.0, 1.0)),
            "passive_tension": draw(magnitude(1e-6, 1e5, 0.0, 1.0)),
        },
        "reference": {"joints": {name: draw(motion) for name in finger["joints"] if name not in driven}},
        "environment": {"fingertip_force": draw(FORCES)},
        "simulation": {
            "duration": duration,
            "sample_rate": 20.0 / duration,
            "method": draw(st.sampled_from(["Rodas5P", "Rodas4"])),
            "rtol": draw(magnitude(1e-9, 1e-3, 1e-6)),
            "atol_scale": draw(magnitude(1e-9, 1e-3, 1e-6)),
        },
    }


def accepted(model, table):
    """Return the description, or None if validation refuses it in one line: a few random networks are degenerate."""
    try:
        return validate(model, table, ())
    except fp.InputError as error:
        assert str(error).isprintable()
        return None


def says_what_to_try(error: IntegrationError) -> None:
    assert str(error).isprintable()
    assert "t = " in str(error) and error.reason and error.advice in str(error)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::finger_pin.exceptions.SelfLockingWarning")
@FEW
@given(scenarios())
def test_a_run_ends_finite_and_accounted_for_or_says_why_it_stopped(table):
    """What is not accounted for is small beside the energy that went to and fro, and beside rounding of the total."""
    scenario = accepted(Scenario, table)
    if scenario is None:
        return
    try:
        result = fp.simulate(scenario)
    except IntegrationError as error:
        says_what_to_try(error)
        result = error.result
    for name, values in result.data_vars.items():
        assert np.isfinite(values).all(), name
    energies = [result[name].values for name in result if name.startswith("energy_") and name != "energy_residual"]
    exchanged = sum(np.abs(each - each[0]).max() for each in energies)
    total = sum(np.abs(each).max() for each in energies)
    assert float(abs(result["energy_residual"]).max()) <= 5e-3 * exchanged + 1e-12 * total + NOTHING


@pytest.mark.slow
@FEW
@given(
    fingers(closed=False),
    magnitude(1e-3, 1e5, 1.0),
    st.lists(between(0.0, 1.0), min_size=9, max_size=9),
    st.lists(magnitude(1e-5, LONGEST), min_size=1, max_size=3),
    st.sampled_from(["Rodas5P", "Rodas4"]),
    FORCES,
)
def test_a_step_ends_finite_or_says_why_it_stopped(table, scale, pulls, steps, method, force):
    """Force closure is not needed to step a finger."""
    description = accepted(fp.FingerDescription, table)
    if description is None:
        return
    simulator = Simulator(fp.Finger(description), method=method)
    tension = scale * np.abs(pulls[: len(description.actuated_names)])
    try:
        for dt in steps:
            simulator.step(tension, dt, force)
    except IntegrationError as error:
        says_what_to_try(error)
    assert np.isfinite(simulator.x).all()


@pytest.mark.slow
def test_a_run_that_cannot_go_on_ends_with_time_state_and_advice():
    """A passive tendon of a femtogram at the largest stiffness, whose waves have 2e13 Hz."""
    frantic = {
        "finger.passive_tendon.mass": 1e-18,
        "finger.passive_tendon.stiffness": 1e10,
        "finger.tendon_friction.viscous": 0.0,
        "finger.tendon_friction.coulomb": 0.0,
        "simulation.rtol": 1e-9,
        "simulation.atol_scale": 1e-15,
    }
    with pytest.raises(IntegrationError) as caught:
        fp.simulate(fp.load_scenario("reversals", frantic))
    error = caught.value
    says_what_to_try(error)
    assert "T5" in error.reason
    assert error.result.attrs["solver_steps"] < 1_000_000
    for name, values in error.result.data_vars.items():
        assert np.isfinite(values).all(), name
