"""Boxes and cylinders that lie, lean, stand and roll on each other, against statics and closed forms."""

import numpy as np
import pytest
from test_contact_motion import G, motion, plane, scene

from finger_pin.description.objects import Object
from finger_pin.laws.contact_law import CONTACT

SURFACE = {"stiffness": 1e4, "damping": 2.0, "friction": 0.6}
#: About y by a quarter turn: z along x.
ALONG_X = (0.0, 1.0, 0.0, 1.0)


def lying(shape, z, x=0.0, y=0.0, mass=0.2, turn=0.0, along=None, **sizes):
    turned = along or (0.0, 0.0, np.sin(turn / 2.0), np.cos(turn / 2.0))
    return Object(shape=shape, mass=mass, position=(x, y, z), orientation=turned, surface=SURFACE, **sizes)


def fixed(sides, z):
    return Object(shape="box", sides=sides, position=(0.0, 0.0, z), surface=SURFACE)


@pytest.mark.parametrize("length", [0.01, 0.2])
def test_a_cylinder_rolls_down_an_incline_as_a_rigid_one_does(length):
    """X = g sin(a) t^2 / (2 (1 + I / (m l^2))), l from the axis to half the depth: 0.16 m in 0.75 s, by 1e-4 of it."""
    radius, mass, slope, stiffness = 0.03, 0.2, np.deg2rad(5.0), 1e6
    depth = mass * G * np.cos(slope) / 2.0 / stiffness
    cylinder = Object(
        shape="cylinder",
        radius=radius,
        length=length,
        mass=mass,
        position=(0.0, 0.0, radius - depth),
        orientation=(1.0, 0.0, 0.0, 1.0),
    )
    table = plane(stiffness=stiffness, tangential_stiffness=1e6, lag=1e-4, friction=0.6)
    gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    mechanism, start = scene(gravity, table=table, cylinder=cylinder)
    times = np.array([0.0, 0.4, 0.75])
    x = motion(mechanism, start, times)
    arm = radius - depth / 2.0
    rolled = G * np.sin(slope) * times**2 / 2.0 / (1.0 + 0.5 * radius**2 / arm**2)
    assert x[:, 0] == pytest.approx(rolled, rel=1e-4)
    assert x[:, 2] == pytest.approx(radius - depth, abs=1e-9)


def test_a_coin_rolls_on_its_rim_in_the_circle_of_steady_precession():
    """A thin disc that leans by a to the table, its rim on a circle of radius b, has the balance of its spin.

    W^2 (6 b - 5 r cos(a)) = 4 g cot(a),     omega = W e_z - W b / r along its axis: it rolls.
    """
    radius, lean, circle, mass, stiffness = 0.02, np.deg2rad(60.0), 0.05, 0.01, 1e6
    rate = np.sqrt(4.0 * G / np.tan(lean) / (6.0 * circle - 5.0 * radius * np.cos(lean)))
    axis, up = np.array([np.sin(lean), 0.0, np.cos(lean)]), np.array([-np.cos(lean), 0.0, np.sin(lean)])
    omega = np.array([0.0, 0.0, rate]) - rate * circle / radius * axis
    rotation = np.column_stack([-up, [0.0, 1.0, 0.0], axis])
    middle, depth = circle - radius * np.cos(lean), mass * G / stiffness
    coin = Object(
        shape="cylinder",
        radius=radius,
        length=1e-6,
        mass=mass,
        position=(middle, 0.0, radius * np.sin(lean) - depth),
        orientation=(0.0, np.sin(lean / 2.0), 0.0, np.cos(lean / 2.0)),
        velocity=tuple(np.cross(omega, radius * up)),
        angular_velocity=tuple(rotation.T @ omega),
    )
    table = plane(stiffness=stiffness, tangential_stiffness=1e6, lag=1e-4, friction=0.8, damping=1.0)
    mechanism, start = scene((0.0, 0.0, -G), table=table, coin=coin)
    x = motion(mechanism, start, np.linspace(0.0, 2.0 * np.pi / rate, 9))
    assert np.hypot(x[:, 0], x[:, 1]) == pytest.approx(middle, rel=1e-3)
    assert x[:, 2] == pytest.approx(x[0, 2], abs=1e-5)
    assert x[-1, :2] == pytest.approx(x[0, :2], abs=5e-4)


def test_a_plate_on_a_smaller_box_lies_still_and_presses_on_it_as_statics_says():
    """The forces have the weight, and its moments about the middle of the box; nothing moves by 1e-10 m in 5 s."""
    mass, off = 0.3, np.array([0.008, 0.005])
    plate = lying("box", 0.045, *off, mass, turn=0.2, sides=(0.15, 0.12, 0.01))
    mechanism, start = scene((0.0, 0.0, -G), base=fixed((0.05, 0.05, 0.04), 0.02), plate=plate)
    x = motion(mechanism, start, [0.0, 5.0, 10.0])
    assert np.abs(x[2, :7] - x[1, :7]).max() < 1e-10
    found = mechanism.evaluate(x[2], np.zeros(0)).rows["contacts"]
    force = found.force[:: CONTACT.arms]
    points, out, q = [], np.zeros(16), x[2]
    placements, _ = mechanism.body.placements(q[:7])
    for legs, pushed in zip(found.rows.paths[:: CONTACT.arms], force, strict=True):
        piece = legs[0].piece
        frame = placements[piece.joint] * piece.frame
        ends = [frame.actInv(placements[end.joint].act(end.point)) for end in piece.ends]
        piece.shape.value(np.concatenate(ends), piece.parameters, out)
        points.append(frame.act(out[4:7]))
        assert pushed >= 0.0
    assert np.count_nonzero(force) >= 4
    assert force.sum() == pytest.approx(mass * G, rel=1e-6)
    assert force @ np.array(points)[:, :2] / force.sum() == pytest.approx(q[:2], abs=2e-6)


BOX, RAIL = fixed((0.05, 0.05, 0.04), 0.02), fixed((0.02, 0.2, 0.02), 0.01)
LAID = {
    "crossed bars": (RAIL, lying("box", 0.03, 0.002, 0.03, sides=(0.2, 0.02, 0.02))),
    "a peg across a rail": (RAIL, lying("cylinder", 0.03, 0.003, mass=0.1, along=ALONG_X, radius=0.01, length=0.1)),
    "a disc on a box": (BOX, lying("cylinder", 0.045, 0.003, 0.01, radius=0.06, length=0.01)),
    "a capsule on a box": (BOX, lying("capsule", 0.05, 0.002, mass=0.1, along=ALONG_X, radius=0.01, length=0.03)),
    "a cylinder on a lying one, crosswise": (
        lying("cylinder", 0.02, mass=None, along=ALONG_X, radius=0.02, length=0.1),
        lying("box", 0.045, sides=(0.02, 0.1, 0.01)),
    ),
}


@pytest.mark.parametrize("case", LAID)
def test_a_body_laid_on_a_smaller_one_stays_there(case):
    below, above = LAID[case]
    mechanism, start = scene((0.0, 0.0, -G), below=below, above=above)
    x = motion(mechanism, start, [0.0, 1.0, 2.0], tolerance=1e-6)
    assert np.abs(x[2, :3] - start[:3]).max() < 3e-4
    assert np.abs(x[2, 3:7] - start[3:7]).max() < 3e-3
    assert np.abs(x[2, :7] - x[1, :7]).max() < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["box", "cylinder"])
@pytest.mark.parametrize("aligned", [True, False])
def test_a_stack_of_three_stands_for_a_hundred_seconds(shape, aligned):
    """Boxes whose edges lie on each other, or turned ones; cans on each other, or shifted."""
    sizes = {"sides": (0.06, 0.06, 0.04)} if shape == "box" else {"radius": 0.03, "length": 0.04}
    places = [(0.0, 0.0, 0.0), (0.004, -0.003, 0.3), (-0.002, 0.005, 0.7)]
    stack = {
        f"number_{k}": lying(
            shape, 0.02 + 0.04 * k, *((0.0, 0.0) if aligned else (x, y)), turn=turn * (not aligned), **sizes
        )
        for k, (x, y, turn) in enumerate(places)
    }
    mechanism, start = scene((0.0, 0.0, -G), table=plane(**SURFACE), **stack)
    x = motion(mechanism, start, [0.0, 20.0, 100.0], tolerance=1e-6)
    assert np.abs(x[2] - x[1])[:21].max() < 1e-9
    assert np.abs(x[2] - start)[:21].max() < 1e-3
