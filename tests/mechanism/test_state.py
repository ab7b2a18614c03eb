"""The packed state: its order, sizes and names."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.mechanism.state import Layout, State

LAYOUTS = {
    "paper": Layout(("a", "b", "c", "d"), ("T1", "T2", "T3", "T4", "T5"), 1),
    "no passive tendon": Layout(("a", "b"), ("T1", "T2", "T3"), 0),
    "three passive tendons": Layout(("a",), ("T1", "T2", "P1", "P2", "P3"), 3),
    "two motors": Layout(("a", "b"), ("T1", "T2", "P1"), 1, motors=("M1", "M2")),
    "objects": Layout(("a", "b"), ("T1", "P1"), 1, objects=("ball", "box"), contacts=("a-ball", "b-ball", "ball-box")),
    "a tree": Layout(("a", "b"), ("T1",), 0, actuators=("servo",), canals=("T2", "T2.1")),
    "a world": Layout(("a",), ("T1", "T2"), 0, world=("roll", "pitch", "yaw", "x", "y", "z"), contacts=("a-table",)),
}


@pytest.fixture(params=LAYOUTS.values(), ids=LAYOUTS.keys())
def layout(request):
    return request.param


def test_the_paper_s_finger_has_nineteen_numbers_in_the_order_of_the_model():
    layout = LAYOUTS["paper"]
    assert layout.size == 19
    state = State(*(np.full(size, float(index)) for index, size in enumerate((4, 1, 4, 1, 5, 4))))
    np.testing.assert_array_equal(layout.pack(state), [0.0] * 4 + [1.0] + [2.0] * 4 + [3.0] + [4.0] * 5 + [5.0] * 4)


@pytest.mark.parametrize("lead", [(), (7,), (2, 3)])
def test_unpacking_inverts_packing_and_keeps_leading_dimensions(layout, lead):
    x = np.random.default_rng(1).normal(size=(*lead, layout.size))
    state = layout.unpack(x)
    np.testing.assert_array_equal(layout.pack(state), x)
    n, t, p, m = len(layout.joints), len(layout.tendons), layout.passive, len(layout.motors)
    f, w, c = len(layout.objects), len(layout.world), len(layout.contacts)
    sizes = (n, p, n, p, t, n, 0, m, m, m, 7 * f, 6 * f, w, w, 2 * c, len(layout.held), 0)
    sizes += (len(layout.actuators), len(layout.canals))
    for name, size in zip(State.__annotations__, sizes, strict=True):
        assert getattr(state, name).shape == (*lead, size), name


def test_sizes_add_up_to_three_per_joint_and_motor_one_per_tendon_two_per_passive_tendon_and_contact(layout):
    alone = 3 * (len(layout.joints) + len(layout.motors)) + len(layout.tendons) + 2 * layout.passive
    alone += len(layout.actuators) + len(layout.canals)
    assert layout.size == alone + 13 * len(layout.objects) + 2 * len(layout.world) + 2 * len(layout.contacts)
    assert sum(layout.sizes) == layout.size


def test_every_number_has_its_own_name_at_its_place(layout):
    assert len(layout.names) == layout.size == len(set(layout.names))
    numbered = layout.unpack(np.arange(layout.size))
    passive = layout.tendons[len(layout.tendons) - layout.passive :]
    for field, items in (
        ("position", [f"joint_position[{name}]" for name in layout.joints]),
        ("velocity", [f"joint_velocity[{name}]" for name in layout.joints]),
        ("passive_position", [f"passive_position[{name}]" for name in passive]),
        ("passive_velocity", [f"passive_velocity[{name}]" for name in passive]),
        ("tendon_stiction", [f"tendon_stiction[{name}]" for name in layout.tendons]),
        ("joint_stiction", [f"joint_stiction[{name}]" for name in layout.joints]),
        ("motor_position", [f"motor_position[{name}]" for name in layout.motors]),
        ("motor_velocity", [f"motor_velocity[{name}]" for name in layout.motors]),
        ("gearbox_stiction", [f"gearbox_stiction[{name}]" for name in layout.motors]),
    ):
        assert [layout.names[index] for index in getattr(numbered, field)] == items


def test_absolute_tolerances_have_one_positive_scale_per_number_by_kind(layout):
    scales = layout.unpack(layout.scales())
    assert np.all(layout.scales() > 0.0)
    for kind, values in vars(scales).items():
        # A pose has metres and a quaternion, or angles.
        assert len(set(values)) <= (2 if kind.startswith(("object", "world")) else 1)
    assert scales.velocity[0] > scales.position[0]
    if layout.passive:
        assert scales.passive_position[0] < scales.position[0]


@pytest.mark.parametrize("size", [18, 20, 0])
def test_a_state_of_the_wrong_size_is_refused_with_both_sizes(size):
    with pytest.raises(ValueError, match=f"19 numbers, not {size}"):
        LAYOUTS["paper"].unpack(np.zeros(size))


@pytest.mark.parametrize(("name", "size"), [("ub", 19), ("dexmart_index", 19), ("planar", 9)])
def test_shipped_fingers_have_the_layout_of_their_description(name, size):
    description = fp.load_finger(name)
    layout = fp.Finger(description).layout
    assert layout.size == size
    assert layout.joints == tuple(description.joints)
    assert layout.tendons == tuple(description.tendons)
