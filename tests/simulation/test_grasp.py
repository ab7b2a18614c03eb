"""The shipped grasp: a hand that lifts a cylinder by friction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import finger_pin as fp

WEIGHT = 0.15 * 9.81
# The sample at which the cylinder is lifted, and the palm begins to turn.
LIFTED = 240


def run(**overrides):
    """Return the result of the scenario, changed."""
    return fp.simulate(
        fp.load_scenario(
            "grasp",
            {"simulation.rtol": 1e-5, "simulation.atol_scale": 1e-5, "simulation.sample_rate": 200.0, **overrides},
        )
    )


@pytest.fixture(scope="module")
def grasp():
    return run()


def in_the_world(result, name):
    """Return places and rotations of an object, seen from the world."""
    turned = Rotation.from_quat(result.palm_orientation.values)
    place = turned.apply(result.object_position.sel(object=name).values) + result.palm_position.values
    return place, turned * Rotation.from_quat(result.object_orientation.sel(object=name).values)


@pytest.mark.slow
def test_the_table_stays_behind_and_the_cylinder_is_lifted_off_it_by_ten_centimetres(grasp):
    height = in_the_world(grasp, "cylinder")[0][:, 2]
    assert height[LIFTED] - height[0] == pytest.approx(0.1, abs=1e-3)
    on_table = [name for name in grasp.contact.values if "table" in str(name) and str(name).startswith("cylinder")]
    pressed = grasp.contact_normal_force.sel(contact=on_table).sum("contact")
    assert float(pressed[4]) == pytest.approx(WEIGHT, rel=0.2) and float(pressed[-1]) == 0.0
    seen = grasp.object_position.sel(object="cylinder").values
    closed = seen[grasp.time >= 0.45]
    assert np.linalg.norm(closed - closed[0], axis=1).max() < 1e-3


def test_the_palm_turns_up_and_the_cylinder_with_it(grasp):
    _, turned = in_the_world(grasp, "cylinder")
    axis = turned.apply([0.0, 0.0, 1.0])
    assert abs(axis[0, 2]) == pytest.approx(1.0) and abs(axis[-1, 1]) == pytest.approx(1.0, abs=1e-3)
    facing = Rotation.from_quat(grasp.palm_orientation.values[-1]).apply([0.0, 0.0, 1.0])
    assert facing == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_variables_name_their_frames_of_which_the_base_s_is_the_default(grasp):
    frames = {name: grasp[name].attrs.get("frame", "") for name in grasp}
    with_components = {name for name in grasp if {"axis", "quaternion"} & set(grasp[name].dims)}
    assert {name for name, frame in frames.items() if frame} == with_components
    others = {name: frame for name, frame in frames.items() if frame not in ("", "base")}
    assert others == {f"palm_{name}": "world" for name in ("position", "orientation", "velocity", "angular_velocity")}
    assert grasp.attrs["frame"] == "base"
    assert {each.attrs.get("frame", "world") for each in fp.in_world(grasp).values()} == {"world"}


def test_friction_alone_carries_the_cylinder_once_it_is_lifted(grasp):
    """What the hand exerts balances its weight; along its axis, which is upright, no normal force has a part."""
    names = [name for name in grasp.contact.values if str(name).endswith("cylinder") or "-cylinder." in str(name)]
    end = grasp.isel(time=LIFTED).sel(contact=names)
    force, normal = end.contact_force.values, end.contact_normal.values
    assert force.sum(axis=0) == pytest.approx([0.0, -WEIGHT, 0.0], abs=2e-3 * WEIGHT)
    axis = Rotation.from_quat(end.object_orientation.sel(object="cylinder").values).apply([0.0, 0.0, 1.0])
    assert abs(axis[1]) > 0.99
    assert np.abs(normal @ axis).max() < 1e-9
    assert np.all(end.contact_friction.values <= 0.7 * end.contact_normal_force.values + 1e-12)
    holding = {str(name).split(".")[0] for name in end.contact.values[end.contact_normal_force > 0.1]}
    assert holding == {"thumb", "index", "middle", "ring", "little"}


@pytest.mark.slow
def test_without_friction_the_cylinder_stays_on_the_table():
    slippery = run(**{"environment.objects.cylinder.surface.friction": 0.0})
    height = in_the_world(slippery, "cylinder")[0][:, 2]
    assert slippery.palm_position.values[-1, 2] == pytest.approx(0.1)
    assert np.abs(height - height[0]).max() < 0.01


def test_the_account_of_the_grasp_closes(grasp):
    moved = sum(float(np.abs(grasp[name]).max()) for name in grasp if name.startswith("energy_exchanged_"))
    assert float(np.abs(grasp.energy_residual).max()) < 1e-4 * moved
