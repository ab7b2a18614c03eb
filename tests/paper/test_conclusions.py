"""The experiments behind the conclusions: closed forms where they exist, planted laws where a measure is computed."""

import csv

import numpy as np
import pytest
import scipy.optimize
import xarray as xr
from paper.delivery import DELIVERY_RUNS, crossing, delivered_tensions, passive_delivery
from paper.findings import (
    Finding,
    Verdict,
    delivery_findings,
    findings_table,
    influence_findings,
    transmission_findings,
    write_findings,
)
from paper.influence import INFLUENCE_RUNS, friction_influence, gripping
from paper.posture import transmission
from paper.runs import weightless, with_joint_friction, with_tendon_friction

import finger_pin as fp

pytestmark = pytest.mark.slow

STILL = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal", "medial")}


def planted(law):
    """Return a stand-in for `simulated`: every run has the tracking error of a law of M^d, mu_e and f0."""

    def simulated(scenarios, variables=None, progress=None):
        if progress is not None:
            progress(len(scenarios))
        errors = np.array([law(each) for each in scenarios])
        count, time = len(scenarios), np.linspace(0.0, 5.0, 6)
        finger = scenarios[0].finger
        shape = (count, len(time))
        joints, tendons = np.ones((*shape, len(finger.joints))), np.ones((*shape, len(finger.tendons)))
        mu = np.array([each.finger.tendon_friction.coulomb for each in scenarios])
        friction = np.array([each.finger.joint_friction.coulomb for each in scenarios])
        share = friction / 7.418e-4
        tension = 1.0 / np.maximum(1.0 - share, 0.05)
        f0 = np.array([np.mean(each.controller.minimum_tension) for each in scenarios])
        return xr.Dataset(
            {
                "tracking_error": (("run", "time", "joint"), errors[:, None, None] * joints),
                "tendon_command": (("run", "time", "tendon"), tension[:, None, None] * tendons),
                "tendon_tension": (("run", "time", "tendon"), tension[:, None, None] * tendons),
                "tendon_friction": (("run", "time", "tendon"), tendons),
                "joint_friction": (("run", "time", "joint"), f0[:, None, None] * joints),
                "joint_reaction": (("run", "time", "joint"), f0[:, None, None] * joints),
                "joint_position": (("run", "time", "joint"), time[:, None] * (share < 0.99)[:, None, None] * joints),
                "joint_reference": (("run", "time", "joint"), time[:, None] * joints),
                "energy_exchanged_joint_coulomb": (("run", "time"), friction[:, None] * time),
                "energy_exchanged_tendon_coulomb": (("run", "time"), mu[:, None] * time),
            },
            coords={"time": time},
        )

    return simulated


@pytest.fixture
def plant(monkeypatch):
    def plant(law):
        monkeypatch.setattr("paper.runs.simulated", planted(law))
        monkeypatch.setattr("paper.influence.simulated", planted(law))

    return plant


@pytest.mark.parametrize(("joint", "tendon"), [(0.3, 0.7), (0.8, 0.2)])
def test_elasticities_are_the_exponents_of_a_planted_law_and_decide_which_friction_is_felt_more(plant, joint, tendon):
    def law(scenario):
        finger = scenario.finger
        friction = finger.joint_friction.coulomb**joint * finger.tendon_friction.coulomb**tendon
        return friction * (1.0 + np.mean(scenario.controller.minimum_tension))

    plant(law)
    counted = []
    found = friction_influence(fp.load_scenario("reversals"), progress=counted.append)
    assert sum(counted) == INFLUENCE_RUNS
    np.testing.assert_allclose(found.elasticity_joint, joint, rtol=1e-9)
    np.testing.assert_allclose(found.elasticity_tendon, tendon, rtol=1e-9)
    np.testing.assert_allclose(found.joint.runs.error / found.joint.runs.error[3], found.joint.values**joint, rtol=1e-9)
    verdicts = {each.claim: each.verdict for each in influence_findings(found)}
    (felt,) = [verdict for claim, verdict in verdicts.items() if "small change" in claim]
    (high,) = [verdict for claim, verdict in verdicts.items() if "3 times" in claim]
    assert felt is high is (Verdict.HOLDS if joint > tendon else Verdict.FAILS)
    assert verdicts["joint friction grows with the sum of the tensions"] is Verdict.HOLDS


def test_locking_is_extrapolated_from_tensions_that_grow_as_the_loop_has_it(plant):
    """Planted: tension 1 / (1 - M / M_crit), which reaches infinity at the statics' own critical coefficient."""
    plant(lambda scenario: 1.0)
    grip = friction_influence(fp.load_scenario("reversals")).gripping
    assert grip.extrapolated == pytest.approx(1.0, abs=2e-3)
    assert grip.followed[0] == 1.0 and grip.followed[-1] == 0.0


def test_a_simulated_finger_grips_itself_where_the_statics_say():
    grip = gripping(fp.load_scenario("reversals"))
    assert 0.35e-3 * grip.predicted == pytest.approx(0.7418e-3, rel=1e-3)
    assert grip.extrapolated == pytest.approx(1.0, abs=0.03)
    assert grip.followed[0] > 0.9 and grip.followed[-1] < 0.25
    assert grip.tendons_lock == np.inf


def resting_passive_tension(finger, gain, minimum, desired):
    """Solve a weightless finger at rest, in the gap d between plan and delivery of T5.

    With r the row of T5: tau^d = K_P e = r d, since all other tensions are as planned; the stretch of T5 loses
    r . e, so f5 = f5^d + K_t r.r d / K_P; and f_hat = P tau^d + lambda k, with P H_c^T = I - k k^T / k.k.
    """
    row, stiffness = finger.coupling[4], 5e4
    internal = np.linalg.svd(finger.coupling.T)[2][-1]
    internal = internal / internal[np.argmax(np.abs(internal))]

    def planned(gap):
        minimal = gap * (np.eye(5)[4] - internal * internal[4] / (internal @ internal))
        return (minimal + np.max((minimum - minimal) / internal) * internal)[4]

    def balance(gap):
        return planned(gap) - gap - desired - stiffness * row @ row * gap / gain

    gap = scipy.optimize.brentq(balance, -5.0, 5.0, xtol=1e-14)
    return planned(gap), planned(gap) - gap


@pytest.mark.parametrize("desired", [1.0, 3.2, 5.0])
def test_at_rest_without_friction_and_weight_plan_and_delivery_are_those_of_the_statics(finger, desired):
    still = fp.load_scenario("reversals", STILL | {"simulation.duration": 3.0, "controller.passive_tension": desired})
    bare = weightless(with_tendon_friction(with_joint_friction(still, 0.0), 0.0))
    _, _, planned, delivered = delivered_tensions([bare], None)
    expected = resting_passive_tension(finger, 1.0, 1.0, desired)
    assert (planned[0, -1, 0], delivered[0, -1, 0]) == pytest.approx(expected, rel=2e-4)


def test_the_plan_is_met_where_nothing_spoils_it_and_every_cause_is_switched_on_alone():
    counted = []
    found = passive_delivery(
        fp.load_scenario("reversals"), speeds=(0.5, 1.0), factors=(0.0, 1.0), progress=counted.append
    )
    assert sum(counted) == 2 * 2 + 5
    assert DELIVERY_RUNS == 6 * 6 + 5
    assert found.causes["none"] < 0.02
    assert set(found.causes) == {"none", "reference", "weight", "joint friction", "tendon friction", "speed"}
    assert all(value > 1.5 * found.causes["none"] for name, value in found.causes.items() if name != "none")
    assert found.grid.deviation[1, 1] > max(found.causes["joint friction"], found.causes["tendon friction"])
    words = {each.claim: each for each in delivery_findings(found)}
    assert words["force closure sets the passive tension, if nothing else acts"].verdict is Verdict.HOLDS
    assert words["only inertia and friction make it differ"].verdict is Verdict.FAILS


def test_a_level_is_crossed_between_values_by_interpolation_or_never():
    values, deviations = np.array([1.0, 2.0, 4.0]), np.array([0.1, 0.2, 0.4])
    assert crossing(values, deviations, 0.3) == pytest.approx(3.0)
    assert crossing(values, deviations, 0.05) == 1.0
    assert crossing(values, deviations, 0.5) == np.inf


def test_transmission_of_the_papers_finger_depends_on_posture_but_for_the_passive_tendon():
    found = transmission(fp.load_scenario("reversals", {"simulation.duration": 1.0}))
    # phi of T4 runs from 0.51 to 0.51 + pi: half of that is what one coefficient for all postures must err.
    assert found.blind_error[3] == pytest.approx(np.exp(0.11 * np.pi / 2.0) - 1.0, rel=1e-9)
    assert found.blind_error[4] == pytest.approx(0.0, abs=1e-12)
    first, second, third = transmission_findings(found)
    assert (first.verdict, second.verdict, third.verdict) == (Verdict.PARTLY, Verdict.PARTLY, Verdict.HOLDS)
    assert "T4 0.945 to 0.669" in first.measured


def test_a_verdict_holds_for_all_some_or_none():
    assert Verdict.of([True, True]) is Verdict.HOLDS
    assert Verdict.of([True, False]) is Verdict.PARTLY
    assert Verdict.of([False]) is Verdict.FAILS


def test_findings_are_the_same_on_disk_and_on_the_screen(tmp_path):
    findings = [Finding("a", "a claim, with a comma", "1.0 N", Verdict.HOLDS), Finding("b", "b", "2 mm", Verdict.FAILS)]
    with write_findings(findings, tmp_path / "new" / "c.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows == [
        ["part", "claim", "measured", "verdict"],
        ["a", "a claim, with a comma", "1.0 N", "holds"],
        ["b", "b", "2 mm", "does not hold"],
    ]
    shown = findings_table(findings, 100)
    assert all(cell in shown for row in rows[1:] for cell in row)
    assert max(map(len, shown.splitlines())) <= 100


def test_scenarios_that_cannot_be_asked_are_refused():
    with pytest.raises(fp.InputError, match="passive"):
        passive_delivery(
            fp.load_scenario("reversals", {"finger": "planar", "reference.joints": {"proximal": {"offset": 0.1}}})
        )
    with pytest.raises(fp.InputError, match="must move"):
        friction_influence(fp.load_scenario("reversals", STILL))
