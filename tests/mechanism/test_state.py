"""The packed state: its order, sizes and names."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.mechanism.assembly import check_layout
from finger_pin.mechanism.state import BLOCKS, Layout, State


def layout_of(joints, tendons, passive, motors=(), objects=(), contacts=(), world=(), **more):
    """Return a layout by the names of its parts."""
    poses, rates = ([f"{name}.{k}" for name in objects for k in range(size)] for size in (7, 6))
    slack = tendons[len(tendons) - passive :]
    of_motors = dict.fromkeys(("motor_position", "motor_velocity", "gearbox_stiction"), motors)
    of_joints = dict.fromkeys(("position", "velocity", "joint_stiction"), joints)
    free = {"object_pose": poses, "object_velocity": rates, "world_position": world, "world_velocity": world}
    bends = [f"{name}.{k}" for name in contacts for k in range(2)]
    masses = dict.fromkeys(("passive_position", "passive_velocity"), slack)
    return Layout.from_labels(
        {**of_joints, **of_motors, **free, **masses, "tendon_stiction": tendons, "contact_bend": bends, **more}
    )


LAYOUTS = {
    "paper": layout_of("abcd", ("T1", "T2", "T3", "T4", "T5"), 1),
    "no passive tendon": layout_of("ab", ("T1", "T2", "T3"), 0),
    "three passive tendons": layout_of("a", ("T1", "T2", "P1", "P2", "P3"), 3),
    "two motors": layout_of("ab", ("T1", "T2", "P1"), 1, motors=("M1", "M2")),
    "objects": layout_of("ab", ("T1", "P1"), 1, objects=("ball", "box"), contacts=("a-ball", "b-ball", "ball-box")),
    "a tree": layout_of("ab", ("T1",), 0, actuator_state=["servo"], canal_stiction=["T2", "T2.1"]),
    "a world": layout_of("a", ("T1", "T2"), 0, world=("roll", "pitch", "yaw", "x", "y", "z"), contacts=("a-table",)),
}


@pytest.fixture(params=LAYOUTS.values(), ids=LAYOUTS.keys())
def layout(request):
    return request.param


def test_the_paper_s_finger_has_nineteen_numbers_in_the_order_of_the_model():
    layout = LAYOUTS["paper"]
    assert layout.size == 19
    kinds = ("position", "passive_position", "velocity", "passive_velocity", "tendon_stiction", "joint_stiction")
    sizes = dict(zip(kinds, (4, 1, 4, 1, 5, 4), strict=True))
    state = State(**{kind: np.full(size, float(index)) for index, (kind, size) in enumerate(sizes.items())})
    np.testing.assert_array_equal(layout.pack(state), [0.0] * 4 + [1.0] + [2.0] * 4 + [3.0] + [4.0] * 5 + [5.0] * 4)


@pytest.mark.parametrize("lead", [(), (7,), (2, 3)])
def test_unpacking_inverts_packing_and_keeps_leading_dimensions(layout, lead):
    x = np.random.default_rng(1).normal(size=(*lead, layout.size))
    state = layout.unpack(x)
    np.testing.assert_array_equal(layout.pack(state), x)
    for name in BLOCKS:
        assert getattr(state, name).shape == (*lead, len(layout.names_of(name))), name


def test_sizes_add_up(layout):
    assert layout.size == sum(layout.sizes) == sum(len(layout.names_of(name)) for name in BLOCKS)


def test_every_number_has_its_own_name_at_its_place(layout):
    assert len(layout.names) == layout.size == len(set(layout.names))
    numbered = layout.unpack(np.arange(layout.size))
    for field, prefix in (
        ("position", "joint_position"),
        ("velocity", "joint_velocity"),
        ("passive_position", "passive_position"),
        ("passive_velocity", "passive_velocity"),
        ("tendon_stiction", "tendon_stiction"),
        ("joint_stiction", "joint_stiction"),
        ("motor_position", "motor_position"),
        ("motor_velocity", "motor_velocity"),
        ("gearbox_stiction", "gearbox_stiction"),
    ):
        items = [f"{prefix}[{name}]" for name in layout.names_of(field)]
        assert [layout.names[index] for index in getattr(numbered, field)] == items


def test_absolute_tolerances_have_one_positive_scale_per_number_by_kind(layout):
    scales = layout.unpack(layout.scales())
    assert np.all(layout.scales() > 0.0)
    for kind, values in vars(scales).items():
        # A pose has metres and a quaternion, or angles.
        assert len(set(values)) <= (2 if kind.startswith(("object", "world")) else 1)
    assert scales.velocity[0] > scales.position[0]
    if layout.names_of("passive_position"):
        assert scales.passive_position[0] < scales.position[0]


def test_tolerances_of_joints_that_slide_are_those_of_moved_objects_and_of_others_unchanged():
    layout = fp.Finger(fp.load_scenario("underactuated").finger).layout
    scales, turning = layout.unpack(layout.scales()), LAYOUTS["paper"].unpack(LAYOUTS["paper"].scales())
    assert layout.names_of("position")[0] == "block"
    np.testing.assert_array_equal(scales.position, [BLOCKS["object_pose"].scale[0], *turning.position])
    np.testing.assert_array_equal(scales.velocity, [BLOCKS["object_velocity"].scale[0], *turning.velocity])
    assert {"position", "velocity"}.isdisjoint(dict(fp.Finger("ub_stand_in").layout.scaled))


@pytest.mark.parametrize("size", [18, 20, 0])
def test_a_state_of_the_wrong_size_is_refused_with_both_sizes(size):
    with pytest.raises(ValueError, match=f"19 numbers, not {size}"):
        LAYOUTS["paper"].unpack(np.zeros(size))


@pytest.mark.parametrize(("name", "size"), [("ub_stand_in", 19), ("dexmart_index", 19), ("planar", 9)])
def test_shipped_fingers_have_the_layout_of_their_description(name, size):
    description = fp.load_finger(name)
    layout = fp.Finger(description).layout
    assert layout.size == size
    assert layout.names_of("position") == tuple(description.joints)
    assert layout.names_of("tendon_stiction") == tuple(description.tendons)


@pytest.mark.parametrize("name", ["ub_stand_in", "dexmart_index"])
def test_a_layout_that_lacks_a_number_of_any_block_is_refused_before_anything_is_computed(name):
    finger = fp.Finger(name)
    labels = dict(zip(BLOCKS, finger.layout.labels, strict=True))
    for block in filter(labels.get, BLOCKS):
        less = Layout.from_labels(labels | {block: labels[block][1:]})
        with pytest.raises(RuntimeError, match=r"^state\.\w+ ends at"):
            check_layout(less, finger.mechanism)
