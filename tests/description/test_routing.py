"""The routing table and its matrices against (3), (10), (15), (17) written out, and force closure by hand."""

from fractions import Fraction

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError

MM = 1e-3


def test_coupling_of_the_paper_s_finger_is_equation_3(routing):
    expected = [
        [8.0, 8.0, 0.0, 0.0],
        [-8.0, 8.0, 0.0, 0.0],
        [0.0, 0.0, 6.3, 0.0],
        [0.0, -5.3, -5.3, -5.3],
        [0.0, 0.0, -3.5, 5.0],
    ]
    np.testing.assert_allclose(routing.coupling, np.array(expected) * MM, rtol=1e-14)


def test_coupling_by_strand_is_equation_10(routing):
    expected = [
        [8.0, 8.0, 0.0, 0.0],
        [-8.0, 8.0, 0.0, 0.0],
        [0.0, 0.0, 6.3, 0.0],
        [0.0, -5.3, -5.3, -5.3],
        [0.0, 0.0, -3.5, 0.0],
        [0.0, 0.0, 0.0, 5.0],
    ]
    np.testing.assert_allclose(routing.strand_coupling, np.array(expected) * MM, rtol=1e-14)


def test_curvature_of_the_paper_s_finger_is_equation_15(routing):
    np.testing.assert_array_equal(
        routing.curvature_matrix, [[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 1, 0], [0, 0, 0, 0]]
    )
    np.testing.assert_array_equal(routing.curvature_offset, [1.0, 1.0, 0.28, 0.51, 0.58])


def test_joints_are_loaded_by_the_strands_of_equation_17(routing):
    #                    f1 f2 f3 f4 f5_3 f5_4
    np.testing.assert_array_equal(
        routing.loads, [[1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0], [0, 0, 1, 1, 1, 0], [0, 0, 0, 1, 0, 1]]
    )


def test_names_and_numbers_follow_the_description(routing):
    assert routing.joints == ("abduction", "proximal", "medial", "distal")
    assert routing.tendons == ("T1", "T2", "T3", "T4", "T5")
    assert (routing.actuated, routing.passive, routing.passive_names) == (4, 1, ("T5",))
    assert routing.actuated_coupling.shape == (4, 4)
    np.testing.assert_array_equal(routing.proximal_coupling + routing.distal_coupling, routing.coupling[4:])


def test_torque_and_displacement_obey_virtual_work(routing):
    """Power is f . l' = tau . theta' for every tension and motion, l from the table and tau from the strands."""
    table = [{0: 8.0, 1: 8.0}, {0: -8.0, 1: 8.0}, {2: 6.3}, {1: -5.3, 2: -5.3, 3: -5.3}, {2: -3.5, 3: 5.0}]
    draw = np.random.default_rng(4)
    for _ in range(20):
        tension, velocity = draw.uniform(0.0, 10.0, 5), draw.normal(size=4)
        power = sum(
            f * radius * MM * velocity[joint]
            for f, crossings in zip(tension, table, strict=True)
            for joint, radius in crossings.items()
        )
        strands = np.append(tension, tension[4])
        assert (routing.strand_coupling.T @ strands) @ velocity == pytest.approx(power, rel=1e-12)
        assert (routing.coupling.T @ tension) @ velocity == pytest.approx(power, rel=1e-12)


def test_internal_tensions_follow_from_the_radii_joint_by_joint(routing):
    """Solve Hc^T f = 0 by hand, from the tip inwards, in exact fractions of a millimetre."""
    f4 = Fraction(1)
    f5 = Fraction("5.3") * f4 / Fraction("5.0")  # joint 4: -5.3 f4 + 5 f5 = 0
    f3 = (Fraction("5.3") * f4 + Fraction("3.5") * f5) / Fraction("6.3")  # joint 3: 6.3 f3 - 5.3 f4 - 3.5 f5 = 0
    f1 = f2 = Fraction("5.3") * f4 / 16  # joints 2 and 1: 8 f1 + 8 f2 = 5.3 f4 and f1 = f2
    ratio = [float(f / f1) for f in (f1, f2, f3, f4, f5)]
    assert [round(value, 2) for value in ratio] == [1.0, 1.0, 4.32, 3.02, 3.2]
    closure = routing.force_closure()
    np.testing.assert_allclose(closure.tension / closure.tension[0], ratio, rtol=1e-12)
    assert closure.tension.max() == 1.0
    np.testing.assert_allclose(routing.coupling.T @ closure.tension, 0.0, atol=1e-17)
    assert closure.null_space.shape == (5, 1)
    assert closure.holds and str(closure).startswith("force closure:") and "T3 1," in str(closure)


def test_the_planar_finger_balances_at_equal_tensions():
    closure = Routing.from_description(fp.load_finger("planar")).force_closure()
    np.testing.assert_allclose(closure.tension, 1.0, rtol=1e-12)


def test_without_the_antagonist_no_tensions_balance(network):
    description = network(
        "abcd", {"T1": {"a": 8, "b": 8}, "T2": {"a": -8, "b": 8}, "T3": {"c": 6.3}, "T5": {"c": -3.5, "d": 5}}, ["T5"]
    )
    closure = Routing.from_description(description).force_closure()
    assert closure.null_space.shape == (4, 0)
    assert not closure.holds
    np.testing.assert_array_equal(closure.tension, 0.0)
    assert "too few tendons" in str(closure)


def test_a_null_vector_of_mixed_signs_is_no_force_closure_and_names_the_tendons_that_would_push(network):
    """With f4 flexing joint 2, balance there needs 8 f1 + 8 f2 + 5.3 f4 = 0: T1 and T2 would have to push."""
    description = network(
        "abcd",
        {
            "T1": {"a": 8, "b": 8},
            "T2": {"a": -8, "b": 8},
            "T3": {"c": 6.3},
            "T4": {"b": 5.3, "c": -5.3, "d": -5.3},
            "T5": {"c": -3.5, "d": 5},
        },
        ["T5"],
    )
    closure = Routing.from_description(description).force_closure()
    assert not closure.holds
    assert str(closure) == "no force closure: T1, T2 cannot be kept taut at zero joint torque"
    np.testing.assert_allclose(closure.null_space[[0, 3], 0] @ [2 * 8.0, 5.3], 0.0, atol=1e-9)
    np.testing.assert_array_equal(closure.tension, 0.0)


def test_a_single_null_vector_may_leave_a_tendon_slack(network):
    """B balances A; C alone turns joint k, so that it cannot pull at zero torque, while A and B can."""
    description = network("jk", {"A": {"j": 6}, "B": {"j": -3}, "C": {"k": 5}})
    closure = Routing.from_description(description).force_closure()
    assert not closure.holds
    np.testing.assert_allclose(closure.tension, [0.5, 1.0, 0.0], atol=1e-12)
    assert str(closure) == "no force closure: C cannot be kept taut at zero joint torque"


def test_with_two_internal_directions_the_weakest_tendon_is_kept_as_taut_as_possible(network):
    """Two antagonistic pairs: 6 fa = 3 fb fixes fa / fb = 1/2, so no choice keeps the least tension above 1/2."""
    description = network("jk", {"A": {"j": 6}, "B": {"j": -3}, "C": {"k": 5}, "D": {"k": -5}})
    routing = Routing.from_description(description)
    closure = routing.force_closure()
    assert closure.null_space.shape == (4, 2)
    assert closure.holds
    assert closure.tension.max() == pytest.approx(1.0, rel=1e-9)
    assert closure.tension.min() == pytest.approx(0.5, rel=1e-9)
    np.testing.assert_allclose(closure.tension[:2], [0.5, 1.0], rtol=1e-9)
    np.testing.assert_allclose(routing.coupling.T @ closure.tension, 0.0, atol=1e-14)


def test_without_force_closure_only_the_tendons_that_cannot_be_taut_are_named(network):
    """A and B both flex joint j and nothing extends it; C and D hold each other."""
    description = network("jk", {"A": {"j": 6}, "B": {"j": 3}, "C": {"k": 5}, "D": {"k": -4}})
    closure = Routing.from_description(description).force_closure()
    assert closure.null_space.shape == (4, 2)
    assert not closure.holds
    assert str(closure) == "no force closure: A, B cannot be kept taut at zero joint torque"
    np.testing.assert_allclose(closure.tension, [0.0, 0.0, 0.8, 1.0], atol=1e-9)


def test_redundant_tendons_that_all_pull_one_way_are_no_force_closure(network):
    closure = Routing.from_description(network("j", {"A": {"j": 6}, "B": {"j": 3}, "C": {"j": 1}})).force_closure()
    assert closure.null_space.shape == (3, 2)
    assert not closure.holds
    assert str(closure) == "no force closure: A, B, C cannot be kept taut at zero joint torque"


def test_a_scenario_whose_finger_lacks_force_closure_is_refused():
    with pytest.raises(InputError, match="T1, T2 cannot be kept taut") as caught:
        fp.load_scenario("reversals", {"finger.tendons.T4.crossings.proximal.radius": 0.0053})
    assert caught.value.entry == "finger.tendons"


CHAIN = {"F": {"a": 6}, "E": {"a": -5, "b": -5, "c": -5}, "P": {"a": -3, "b": 4}, "Q": {"b": -2, "c": 3}}


def test_several_passive_tendons_each_have_two_strands_after_the_actuated_ones(network):
    routing = Routing.from_description(network("abc", CHAIN, ["P", "Q"]))
    assert (routing.actuated, routing.passive, routing.passive_names) == (2, 2, ("P", "Q"))
    np.testing.assert_allclose(
        routing.strand_coupling / MM,
        [[6, 0, 0], [-5, -5, -5], [-3, 0, 0], [0, 4, 0], [0, -2, 0], [0, 0, 3]],
        rtol=1e-14,
    )
    np.testing.assert_allclose(routing.proximal_coupling / MM, [[-3, 0, 0], [0, -2, 0]], rtol=1e-14)
    np.testing.assert_allclose(routing.distal_coupling / MM, [[0, 4, 0], [0, 0, 3]], rtol=1e-14)
    np.testing.assert_array_equal(routing.loads, [[1, 1, 1, 0, 0, 0], [0, 1, 0, 1, 1, 0], [0, 1, 0, 0, 0, 1]])


def test_actuated_tendons_come_first_wherever_the_passive_ones_are_written(network):
    shuffled = {name: CHAIN[name] for name in ("P", "F", "Q", "E")}
    routing = Routing.from_description(network("abc", shuffled, ["P", "Q"]))
    assert routing.tendons == ("F", "E", "P", "Q")
    np.testing.assert_allclose(routing.coupling / MM, [[6, 0, 0], [-5, -5, -5], [-3, 4, 0], [0, -2, 3]], rtol=1e-14)


def test_a_passive_tendon_with_one_crossing_has_its_mass_before_it(network):
    routing = Routing.from_description(network("a", {"F": {"a": 6}, "P": {"a": -3}}, ["P"]))
    np.testing.assert_allclose(routing.strand_coupling[:, 0] / MM, [6, 0, -3], rtol=1e-14)
    np.testing.assert_array_equal(routing.loads, [[1, 0, 1]])


@pytest.mark.parametrize(
    ("after", "proximal", "distal"),
    [
        (None, [-3, 0, 0], [0, 4, 5]),
        (0, [0, 0, 0], [-3, 4, 5]),
        (1, [-3, 0, 0], [0, 4, 5]),
        (2, [-3, 4, 0], [0, 0, 5]),
        (3, [-3, 4, 5], [0, 0, 0]),
    ],
)
def test_mass_after_says_where_three_crossings_are_split(network, after, proximal, distal):
    tendons = {"F": {"a": 6}, "P": {"a": -3, "b": 4, "c": 5}}
    description = network("abc", tendons, ["P"], {} if after is None else {"P": after})
    routing = Routing.from_description(description)
    np.testing.assert_allclose(routing.proximal_coupling / MM, [proximal], atol=1e-14)
    np.testing.assert_allclose(routing.distal_coupling / MM, [distal], atol=1e-14)
    np.testing.assert_array_equal(routing.loads[:, 1], np.array(proximal) != 0)
    np.testing.assert_array_equal(routing.loads[:, 2], np.array(distal) != 0)


def test_crossings_are_split_in_the_order_along_the_tendon_not_of_the_joints(network):
    routing = Routing.from_description(network("ab", {"F": {"a": 6}, "P": {"b": 4, "a": -3}}, ["P"]))
    np.testing.assert_allclose(routing.proximal_coupling / MM, [[0, 4]], rtol=1e-14)
    np.testing.assert_allclose(routing.distal_coupling / MM, [[-3, 0]], rtol=1e-14)
