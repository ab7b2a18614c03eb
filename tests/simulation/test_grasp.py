"""The shipped grasp: a hand that lifts a cylinder by friction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import finger_pin as fp

WEIGHT = 0.15 * 9.81


def run(**overrides):
    """Return the result of the scenario, changed."""
    return fp.simulate(
        fp.load_scenario(
            "grasp",
            {
                "simulation.rtol": 1e-5,
                "simulation.atol_scale": 1e-5,
                "simulation.sample_rate": 200.0,
                **overrides,
            },
        )
    )


@pytest.fixture(scope="module")
def grasp():
    return run()


def test_the_cylinder_rises_with_the_palm_and_does_not_move_in_the_closed_hand(grasp):
    place = grasp.object_position.sel(object="cylinder").values
    turned = Rotation.from_quat(grasp.palm_orientation.values).apply(place)
    height = grasp.palm_position.sel(axis="z").values + turned[:, 2]
    # Its centre turns about the palm's x axis by a right angle, and the palm rises by 10 cm.
    assert height[-1] - height[0] == pytest.approx(0.1 - place[-1, 1] - place[0, 2], abs=1e-6)
    assert height[-1] - height[0] > 0.04
    closed = place[grasp.time >= 0.4]
    assert np.linalg.norm(closed - closed[0], axis=1).max() < 5e-4


def test_friction_alone_carries_the_cylinder_once_it_stands_upright(grasp):
    """What the hand exerts balances its weight; along its axis, which is upright, no normal force has a part."""
    end = grasp.isel(time=-1)
    force, normal = end.contact_force.values, end.contact_normal.values
    assert force.sum(axis=0) == pytest.approx([0.0, -WEIGHT, 0.0], abs=2e-3 * WEIGHT)
    axis = Rotation.from_quat(end.object_orientation.values[0]).apply([0.0, 0.0, 1.0])
    assert abs(axis[1]) > 0.99
    assert np.abs(normal @ axis).max() < 1e-9
    assert np.all(end.contact_friction.values <= 0.7 * end.contact_normal_force.values + 1e-12)
    holding = {str(name).split(".")[0] for name in end.contact.values[end.contact_normal_force > 0.1]}
    assert holding == {"thumb", "index", "middle", "ring", "little"}


def test_without_friction_the_hand_loses_the_cylinder(grasp):
    slippery = run(**{"environment.objects.cylinder.surface.friction": 0.0, "simulation.duration": 0.4})
    gone = slippery.object_position.sel(object="cylinder").values[-1]
    assert np.linalg.norm(gone - grasp.object_position.sel(object="cylinder").values[80]) > 0.02


def test_the_account_of_the_grasp_closes(grasp):
    moved = sum(float(np.abs(grasp[name]).max()) for name in grasp if name.startswith("energy_exchanged_"))
    assert float(np.abs(grasp.energy_residual).max()) < 1e-4 * moved
