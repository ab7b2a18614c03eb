"""The critical joint friction: against the loop iterated, the kernel of the balance, hand results and simulations."""

import warnings
from itertools import product

import numpy as np
import pytest
from locking_cases import steps

import finger_pin as fp
from finger_pin.analysis import critical_friction, quick_margin, self_locking_map, self_locking_margin

STUCK = {f"finger.joint_friction.{name}": 7.6e-4 for name in ("coulomb", "stiction")}
SIGNS = np.array(list(product((-1.0, 1.0), repeat=4)))


def loop_converges(routing, coefficient, sign):
    """Iterate friction -> torque -> tensions (21), (22) -> reaction -> friction; do its steps become shorter?"""
    inverse, internal = np.linalg.pinv(routing.coupling.T), routing.force_closure().tension
    loads = np.hstack([routing.loads[:, :4], routing.loads[:, 4:].sum(axis=1, keepdims=True)])
    torque, change = np.zeros(4), np.zeros(4)
    for _ in range(150):
        minimal = inverse @ torque
        tension = minimal + np.max((1.0 - minimal) / internal) * internal
        before, change = change, coefficient * sign * (loads @ tension) - torque
        torque = torque + change
        if tension.max() > 1e50:
            return False
    # Steps at the level of rounding are as good as none.
    return np.linalg.norm(change) < max(np.linalg.norm(before), 1e-9 * np.linalg.norm(torque))


def bisect(routing, sign):
    low, high = 1e-5, 0.02
    while high - low > 1e-5 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if loop_converges(routing, middle, sign) else (low, middle)
    return 0.5 * (low + high)


def chain(joints, passive, draw):
    """A scenario with that many joints, as many flexors as actuated joints, one extensor, and passive tendons last."""
    size, names = 0.006, [f"j{index}" for index in range(joints)]
    tendons = {}
    for index in range(joints - passive):
        crossings = {name: {"radius": 0.0, "bends": True} for name in names[:index]}
        tendons[f"F{index}"] = {"crossings": {**crossings, names[index]: {"radius": size * draw.uniform(0.8, 1.2)}}}
    tendons["E"] = {"crossings": {name: {"radius": -0.8 * size, "bends": True} for name in names}}
    for index in range(passive):
        proximal, distal = names[joints - 2 - index : joints - index]
        crossings = {proximal: {"radius": -0.6 * size}, distal: {"radius": size * draw.uniform(1.0, 1.2)}}
        tendons[f"P{index}"] = {"kind": "passive", "crossings": crossings}
    reference = {
        name: {"offset": 0.5, "amplitude": 0.4, "frequency": draw.uniform(0.3, 2.0), "phase": draw.uniform(0.0, 6.0)}
        for name in names[: joints - passive]
    }
    link = {"length": 0.03, "width": 0.015, "mass": 0.006}
    finger = {
        "name": "chain",
        "joints": {name: {"range": [-1.0, 1.5], "link": link} for name in names},
        "tendons": {name: {"curvature_offset": 0.5, **tendon} for name, tendon in tendons.items()},
    }
    return fp.Scenario.model_validate({"name": "chain", "finger": finger, "reference": {"joints": reference}})


def test_paper_finger_locks_near_three_quarters_of_a_millimetre(ub):
    found = critical_friction(ub)
    assert found.coefficient == pytest.approx(0.7537e-3, rel=1e-3)
    assert abs(found.directions @ [1, 1, -1, -1]) == 4
    assert found.tension.min() == pytest.approx(0.0, abs=1e-9 * found.tension.max())


def test_single_joints_lock_between_two_and_eight_millimetres_as_by_hand(ub):
    single = {name: critical_friction(ub, joints=[name]).coefficient for name in ub.joints}
    assert single["proximal"] == pytest.approx(2.181e-3, rel=1e-3)
    assert single["distal"] == pytest.approx(5.0e-3)  # T5 alone, on its radius
    assert single["medial"] == pytest.approx(4.374e-3, rel=1e-3)
    assert single["abduction"] == pytest.approx(1.714e-3, rel=1e-3)
    assert critical_friction(ub, joints=["proximal"], velocity=[0, 1, 0, 0]).coefficient == pytest.approx(
        8.0e-3
    )  # T1 and T2


@pytest.mark.parametrize("sign", [SIGNS[0], SIGNS[1], SIGNS[3], SIGNS[10], [1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, -1]])
def test_the_loop_iterated_diverges_where_the_eigenvalue_says(ub, routing, sign):
    sign = np.array(sign, dtype=float)
    exact = critical_friction(ub, velocity=sign).coefficient
    assert bisect(routing, sign) == pytest.approx(exact, rel=1e-4)


def test_friction_undoes_force_closure_exactly_there(ub, routing):
    halves = np.hstack([np.eye(5), np.eye(5)[:, 4:]]).T
    for sign in SIGNS:
        critical = critical_friction(ub, velocity=sign).coefficient

        def kernel(share, critical=critical, sign=sign):
            matrix = routing.coupling.T - share * critical * sign[:, None] * (routing.loads @ halves)
            vector = np.linalg.svd(matrix)[2][-1]
            return vector * np.sign(vector.sum())

        assert all(kernel(share).min() > 0.0 for share in np.linspace(0.0, 0.999, 100))
        assert kernel(1.001).min() < 0.0


def test_runaway_satisfies_the_equations_of_the_finger(ub, finger):
    for position in ([0.1, 0.4, 0.8, 0.56], [-0.1, 1.5, 0.2, 0.14]):
        found = critical_friction(ub, position)
        tendons, routing = finger.tendons, finger.routing
        curvature = np.abs(position) @ routing.curvature_matrix.T + routing.curvature_offset
        loss = np.exp(-tendons.surface * curvature)
        # Tendons slide one way or the other: one combination satisfies the balance.
        residuals = []
        for slide in product((-1.0, 1.0), repeat=5):
            delivered = found.tension[:4] * loss[:4] ** np.array(slide[:4])
            mean, part = found.tension[4], slide[4] * np.tanh(0.5 * tendons.surface[4] * curvature[4])
            strands = np.append(delivered, [mean * (1.0 + part), mean * (1.0 - part)])
            friction = found.coefficient * found.directions * (routing.loads @ strands)
            residuals.append(np.abs(strands @ routing.strand_coupling - friction).max())
        assert min(residuals) < 1e-9 * np.abs(friction).max()


def test_gains_and_curvature_of_actuated_tendons_do_not_matter_to_the_paper_finger(ub):
    # The delivered tensions balance, and whichever is zero stays so when scaled by its capstan factor. Only the passive
    # tendon's friction shifts the value, and no joint bends its canal.
    draw = np.random.default_rng(4)
    found = [
        critical_friction(ub, draw.uniform([-0.17, 0, 0, 0], [0.17, 1.5, 1.5, 1.5]), gain=gain).coefficient
        for gain in (None, 0.1, 1.0, 10.0)
    ]
    assert found == pytest.approx([0.7418e-3] * 4, rel=1e-4)


def test_map_varies_where_joints_bend_the_canal_of_a_passive_tendon(ub, finger):
    paper = self_locking_map(finger, samples=5)
    assert np.ptp(paper.coefficient) < 1e-9
    assert paper.joints == ("proximal", "medial")
    assert np.ptp(paper.tension) > 1.0
    crossings = {"medial": {"radius": -0.0035, "bends": True}, "distal": {"radius": 0.005, "bends": True}}
    overrides = {f"finger.tendons.T5.crossings.{joint}": entry for joint, entry in crossings.items()}
    bent = self_locking_map(fp.Finger(fp.load_finger("ub_stand_in", overrides)), samples=5)
    assert np.all(np.diff(bent.coefficient, axis=1) < 0.0)
    assert np.ptp(bent.coefficient, axis=0).max() < 1e-9


def test_the_map_of_a_redundant_finger_has_what_each_posture_has_alone():
    """Of more tendons than joints and one the friction of actuated ones matters."""
    radii = [[0.006, 0.0], [-0.004, 0.005], [0.003, -0.006], [-0.005, -0.004], [0.002, 0.007]]
    tendons = {
        f"T{k}": {
            "curvature_offset": 0.5,
            "crossings": {f"j{j}": {"radius": r, "bends": True} for j, r in enumerate(row)},
        }
        for k, row in enumerate(radii)
    }
    link = {"length": 0.03, "width": 0.01, "mass": 0.01, "centre_of_mass": 0.015, "transverse_inertia": 1e-6}
    joints = {f"j{j}": {"range": [-0.5, 1.0], "link": link} for j in range(2)}
    finger = fp.Finger(fp.FingerDescription.model_validate({"name": "x", "joints": joints, "tendons": tendons}))
    found = self_locking_map(finger, samples=3)
    grid = [critical_friction(finger, [a, b]).coefficient for a, b in product(*found.angles)]
    np.testing.assert_allclose(found.coefficient.ravel(), grid, rtol=1e-9)
    assert np.ptp(grid) > 0.01 * min(grid)


def test_a_finger_beyond_the_critical_coefficient_can_nowhere_be_moved():
    stuck = self_locking_map(fp.Finger(fp.load_finger("ub_stand_in", STUCK)), samples=3)
    assert stuck.coefficient.max() < stuck.actual
    assert np.isinf(stuck.tension).all()


def test_margin_is_the_ratio_of_critical_to_actual_stiction_in_the_worst_directions_of_the_reference():
    margin = self_locking_margin(fp.load_scenario("reversals"))
    assert margin.margin == pytest.approx(0.7418 / 0.35, rel=1e-3)
    assert self_locking_margin(steps(0.7418e-3)).margin == pytest.approx(1.0, rel=1e-3)
    # Joints that never swing together in these directions are safer.
    apart = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal")}
    assert self_locking_margin(fp.load_scenario("reversals", apart)).margin > 5.0


def test_margin_misses_no_short_combination_of_directions(ub):
    scenario = fp.load_scenario("reversals")
    dense = min(self_locking_margin(scenario, samples).margin for samples in (7001, 20011))
    assert self_locking_margin(scenario).margin == pytest.approx(dense, rel=1e-9)


def test_a_reference_at_rest_does_not_lock(ub):
    still = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal", "medial")}
    assert self_locking_margin(fp.load_scenario("reversals", still)).margin == np.inf


def test_simulated_finger_moves_just_below_the_critical_coefficient_and_locks_just_above_it():
    """Below, the lag settles: the last third of the reference's way needs no more tension. Above, it needs more.

    The positively homogeneous loop leaves no other behaviour above: lag and tension grow with the reference.
    """
    third, way = 125, np.deg2rad(35.0)
    growth, moved = {}, {}
    for share in (0.9, 1.1):
        with pytest.warns(fp.exceptions.SelfLockingWarning, match="run away" if share > 1.0 else "multiply"):
            result = fp.simulate(steps(share * 0.7418e-3))
        tension = result["tendon_command"].max("tendon").values
        growth[share] = tension[-1] / tension[third]
        moved[share] = float(np.ptp(result["joint_position"].sel(joint="distal").values)) / way
    assert growth[0.9] < 1.0 < 1.25 < growth[1.1]
    assert moved[0.9] > 0.6 > 0.2 > moved[1.1]


@pytest.mark.parametrize("passive", [1, 2])
def test_the_quick_margin_of_seven_joints_is_the_least_of_all_combinations(passive):
    for seed in range(3):
        scenario = chain(7, passive, np.random.default_rng(seed))
        quick = quick_margin(scenario)
        assert quick == pytest.approx(self_locking_margin(scenario).margin, rel=1e-6)


def test_the_quick_margin_looks_at_no_more_cases_than_it_may(monkeypatch):
    """So its cost is bounded, whatever the number of joints: eigenvalue problems are counted, not seconds."""
    counted = []
    real = np.linalg.eig

    def counting(matrices):
        counted.append(int(np.prod(matrices.shape[:-2])))
        return real(matrices)

    monkeypatch.setattr(np.linalg, "eig", counting)
    for passive in (1, 2):
        counted.clear()
        quick_margin(chain(7, passive, np.random.default_rng(0)))
        # A cell for every one of the eight tendons.
        assert 0 < sum(counted) <= 48 * 8


def test_parameters_at_the_edge_have_a_margin_or_none_but_no_error():
    for edge in (
        {"controller.gain": 0.0},
        {"controller.gain": 1e-4, "finger.passive_tendon.stiffness": 1e10},
        {"finger.tendon_friction.coulomb": 10.0, "finger.tendons.T5.curvature_offset": 100.0},
        {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0},
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", fp.exceptions.SelfLockingWarning)
            assert quick_margin(fp.load_scenario("reversals", edge)) > 0.0


def test_slow_motion_needs_the_tension_that_the_map_says():
    # In the middle of the swing, where weight and inertia matter little.
    result = fp.simulate(steps(5e-4))
    overrides = {f"finger.joint_friction.{name}": 5e-4 for name in ("coulomb", "stiction")}
    finger = fp.Finger(fp.load_finger("ub_stand_in", overrides))
    expected = self_locking_map(finger, samples=5).tension
    simulated = float(result["tendon_command"].sel(time=1.0).max())
    assert expected.min() * 0.7 < simulated < expected.max() * 1.1


def test_wrong_arguments_are_named(ub, network):
    with pytest.raises(fp.InputError, match="joints"):
        critical_friction(ub, joints=["thumb"])
    with pytest.raises(fp.InputError, match="velocity"):
        critical_friction(ub, velocity=[1.0])
    open_chain = network(["a", "b"], {"T1": {"a": 5.0}, "T2": {"a": -5.0, "b": 5.0}})
    with pytest.raises(fp.InputError, match="force closure"):
        critical_friction(open_chain)
