"""Bodies that touch, under way in the compiled core, against closed forms and MuJoCo."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps import integration
from finger_pin.core.tables.inputs import held_control
from finger_pin.description.objects import Object
from finger_pin.mechanism.contact_rows import contact_rows
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.solids import add_free_objects, object_solids

G = 9.81
SCALES = {"pose": 1e-2, "velocity": 1.0, "bend": 1e-5}
#: Upright walls whose solid sides are away from each other, at x below and above zero.
FACING_X, FACING_BACK = (0.0, 1.0, 0.0, 1.0), (0.0, -1.0, 0.0, 1.0)


def scene(gravity, **objects):
    """Return the mechanism of some objects, the state at the start, and the first index of each free one's numbers."""
    model = pin.Model()
    model.gravity.linear[:] = gravity
    body = add_free_objects(RigidBody(model, []), objects)
    mechanism = Mechanism(body, [contact_rows(object_solids(objects, body), body.model.nv)])
    start = np.zeros(mechanism.size)
    for name, each in objects.items():
        if each.mass is not None:
            joint = body.model.joints[body.model.getJointId(name)]
            start[joint.idx_q : joint.idx_q + 7] = [*each.position, *each.quaternion]
            at = body.model.nq + joint.idx_v
            start[at : at + 6] = [*each.velocity, *each.angular_velocity]
    return mechanism, start


def trajectory_of(mechanism, start, duration, method="Rodas5P", tolerance=1e-8):
    """Return a trajectory that has not failed."""
    q, v, z = mechanism.split(np.zeros(mechanism.size))
    atol = tolerance * np.concatenate([0.0 * q + 1e-2, 0.0 * v + 1.0, 0.0 * z + 1e-5])
    control = held_control(mechanism.channels, mechanism.coordinates)
    stepper = Stepper(mechanism, control, start, TABLEAUS[method](), tolerance, atol)
    trajectory = integrate_compiled(stepper, duration, tuple(map(str, range(mechanism.size))))
    assert not trajectory.failure
    return trajectory


def motion(mechanism, start, times, method="Rodas5P", tolerance=1e-8):
    """Return states at times, shape (m, size)."""
    return trajectory_of(mechanism, start, float(times[-1]), method, tolerance).interpolate(np.asarray(times))


def plane(**surface):
    return Object(shape="half_space", surface={"damping": 0.0, "stiffness": 1e5, **surface})


def test_a_sphere_set_down_sliding_rolls_after_two_sevenths_of_v_over_mu_g():
    """About the contact point, which lies half of the penetration under the surface: l = r - d / 2."""
    radius, mass, mu = 0.02, 0.1, 0.5
    sunk = mass * G / 1e5
    at = (0.0, 0.0, radius - sunk)
    ball = Object(shape="sphere", radius=radius, mass=mass, position=at, velocity=(0.8, 0.6, 0.0))
    table = plane(friction=mu, tangential_stiffness=1e6, lag=1e-4)
    mechanism, start = scene((0.0, 0.0, -G), table=table, ball=ball)
    ratio = 2.5 * ((radius - sunk / 2.0) / radius) ** 2
    rolls = 1.0 / (mu * G * (1.0 + ratio))
    assert rolls == pytest.approx(2.0 / (7.0 * mu * G), rel=0.01)
    times = np.array([0.0, 0.5, 0.9, 1.5, 3.0]) * rolls
    velocity = motion(mechanism, start, times)[:, 7:9] @ [0.8, 0.6]
    final = ratio / (1.0 + ratio)
    expected = [1.0, 1.0 - 0.5 * mu * G * rolls, 1.0 - 0.9 * mu * G * rolls, final, final]
    assert velocity == pytest.approx(expected, abs=2e-4)
    assert velocity[-1] == pytest.approx(final, abs=1e-7)


@pytest.mark.parametrize("factor", [0.998, 1.01])
def test_a_box_on_an_incline_stays_up_to_the_angle_of_friction_and_slides_beyond(factor):
    """Gravity turned instead of the plane: four corners carry it, the lower ones more."""
    mu, mass = 0.6, 0.2
    slope = np.arctan(factor * mu)
    gravity = G * np.array([np.sin(slope) * 0.6, np.sin(slope) * 0.8, -np.cos(slope)])
    box = Object(shape="box", sides=(0.04, 0.04, 0.01), mass=mass, position=(0.0, 0.0, 0.005 - mass * G / 4e5))
    mechanism, start = scene(gravity, table=plane(friction=mu, damping=5.0, lag=2e-3), box=box)
    x = motion(mechanism, start, [0.0, 1.0, 2.0])
    gone, slid = np.hypot(*(x[2, :2] - x[1, :2])), np.hypot(*(x[2, 7:9] - x[1, 7:9]))
    if factor < 1.0:
        assert gone < 1e-9
    else:
        assert slid == pytest.approx(G * (np.sin(slope) - mu * np.cos(slope)), rel=0.01)


@pytest.mark.parametrize("normal", [12.0, 60.0])
def test_a_pinched_capsule_neither_creeps_nor_falls_until_its_weight_is_twice_mu_times_the_pinch(normal):
    """45 g, 4 mm radius, mu 0.7; engines with regularised friction creep here at 50 to 155 um/s."""
    mass, radius, length, mu, stiffness = 0.045, 0.004, 0.03, 0.7, 2e4
    # Both ends of the capsule touch each wall, with half of the pinch.
    apart = radius - normal / 2.0 / stiffness
    surface = {"stiffness": stiffness, "friction": mu}
    walls = {
        "left": Object(shape="half_space", position=(-apart, 0.0, 0.0), orientation=FACING_X, surface=surface),
        "right": Object(shape="half_space", position=(apart, 0.0, 0.0), orientation=FACING_BACK, surface=surface),
    }
    capsule = Object(shape="capsule", radius=radius, length=length, mass=mass, surface=surface)

    def height(weight, times):
        mechanism, start = scene((0.0, 0.0, -weight / mass), **walls, capsule=capsule)
        return motion(mechanism, start, times)[:, 2]

    resting = height(mass * G, [10.0, 70.0])
    assert abs(resting[1] - resting[0]) / 60.0 < 1e-12
    breaks = 2.0 * mu * normal
    held = height(0.99 * breaks, [5.0, 10.0])
    assert abs(held[1] - held[0]) < 1e-9
    # A millimetre: it has left the bristles' reach, and falls.
    assert height(1.01 * breaks, [0.0, 2.0])[1] < -1e-3


def test_two_spheres_that_meet_without_friction_and_damping_keep_momentum_and_energy():
    smooth = {"damping": 0.0, "friction": 0.0, "stiffness": 1e4}
    one = Object(shape="sphere", radius=0.02, mass=0.1, velocity=(0.5, 0.1, 0.0), surface=smooth)
    other = Object(shape="sphere", radius=0.03, mass=0.3, position=(0.06, 0.01, 0.005), surface=smooth)
    mechanism, start = scene((0.0, 0.0, 0.0), one=one, other=other)
    x = motion(mechanism, start, [0.0, 0.3])
    first, second = x[:, 14:17], x[:, 20:23]
    assert np.linalg.norm(second[1]) > 0.1
    assert 0.1 * first[1] + 0.3 * second[1] == pytest.approx(0.1 * first[0], abs=1e-12)
    energy = 0.05 * np.sum(first**2, axis=1) + 0.15 * np.sum(second**2, axis=1)
    assert energy[1] == pytest.approx(energy[0], rel=1e-6)


def test_a_bounce_is_that_of_mujoco_where_contact_is_stiff_and_nothing_rubs():
    """A ball thrown on a floor. MuJoCo's contact as a spring without damping; what is left is gravity meanwhile."""
    radius, mass, stiffness = 0.02, 0.05, 5e4
    ball = Object(shape="sphere", radius=radius, mass=mass, position=(0.0, 0.0, 0.12), velocity=(0.3, 0.0, 0.0))
    mechanism, start = scene((0.0, 0.0, -G), table=plane(stiffness=stiffness, friction=0.0), ball=ball)
    times = np.linspace(0.0, 0.3, 13)
    x = motion(mechanism, start, times)
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><option timestep="1e-5" gravity="0 0 -{G}" integrator="RK4"/>
        <default><geom condim="1" solref="{-stiffness / mass} 0" solimp="0.9999 0.9999 0.001"/></default>
        <worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 0.12"><freejoint/>
        <geom type="sphere" size="{radius}" mass="{mass}"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = 0.3
    expected = []
    for time in times:
        while data.time < time - 5e-6:
            mujoco.mj_step(model, data)
        expected.append(data.qpos[:3].copy())
    assert x[:, :3] == pytest.approx(np.array(expected), abs=3e-4)
    fall = np.sqrt(2.0 * 0.1 / G)
    assert times[0] < fall < times[-1] - 0.1


@pytest.mark.parametrize(("method", "order"), [("Rodas5P", 5), ("Rodas4", 4)])
def test_the_methods_keep_their_order_while_a_contact_stays_closed_and_slides(method, order):
    """A ball that slides, spins and bobs on a soft floor, in equal steps, against itself at tight tolerances."""
    soft = {"stiffness": 1e3, "damping": 5.0, "tangential_stiffness": 1e3, "lag": 0.01, "stiction_ratio": 1.3}
    turning = {"velocity": (0.8, 0.6, 0.02), "angular_velocity": (3.0, -2.0, 5.0)}
    ball = Object(shape="sphere", radius=0.02, mass=0.1, position=(0.0, 0.0, 0.019), **turning)
    mechanism, start = scene((0.0, 0.0, -G), table=Object(shape="half_space", surface=soft), ball=ball)
    end, errors = 0.02, []
    exact = motion(mechanism, start, [end], tolerance=1e-12)[0]
    assert np.hypot(*exact[7:9]) > 0.85 and exact[2] < 0.0199
    for count in (5, 20):
        control = held_control(mechanism.channels, mechanism.coordinates)
        stepper = Stepper(mechanism, control, start, TABLEAUS[method](), 1e6, np.full(mechanism.size, 1e6))
        stepper.parts[0].memory.step_size[0] = end
        for k in range(count):
            assert stepper.advance(end * (k + 1) / count) == integration.DONE
        assert stepper.parts[0].memory.accepted_steps[0] == count
        errors.append(np.abs(stepper.x - exact)[:7].max())
    assert np.log(errors[0] / errors[1]) / np.log(4.0) == pytest.approx(order, abs=0.6)


#: Cans that sink into an edge of what they fall on by more than all roundings, or pierce it: floor, can and duration.
DEEP = {
    "upright": ((0.2, 0.2, 0.02), (0.009, 0.04), (-0.16, 0.64, 2.34, 2.15), (0.0, 0.0, -2.2), (0.0, 0.0, 0.0), 0.3),
    "slanting": ((0.2, 0.2, 0.02), (0.018, 0.04), (0.35, 0.82, 0.33, -1.3), (0.0, 0.0, -2.6), (0.0, 0.0, 0.0), 0.3),
    "off the edge": ((0.03, 0.03, 0.04), (0.009, 0.04), (0.9, 0.3, 0.2, 1.0), (0.0, 0.0, -2.5), (0.0, 0.0, 0.0), 0.3),
    "thin": (
        (0.15, 0.15, 0.0016),
        (0.0098, 0.0102),
        (1.0, 0.2, 0.1, 1.0),
        (2.0, 1.5, -5.5),
        (100.0, 200.0, 80.0),
        0.03,
    ),
}


def falling(case, on_box, **surface):
    """Return a scene with a can that falls onto a box, or onto a half-space, the can, and how long it is followed."""
    sides, (radius, length), turn, velocity, spin, duration = DEEP[case]
    floor = Object(shape="half_space", surface=surface)
    if on_box:
        floor = Object(shape="box", sides=sides, position=(0.0, 0.0, -0.5 * sides[2]), surface=surface)
    can = Object(
        shape="cylinder",
        radius=radius,
        length=length,
        mass=0.05,
        position=(0.012, 0.004, np.hypot(radius, 0.5 * length) + 1e-3),
        orientation=turn,
        velocity=velocity,
        angular_velocity=spin,
        surface=surface,
    )
    return scene((0.0, 0.0, -G), floor=floor, can=can), can, duration


@pytest.mark.parametrize("case", DEEP)
def test_a_can_that_sinks_into_an_edge_takes_no_more_than_thrice_the_steps_of_one_on_a_half_space(case):
    steps = []
    for on_box in (True, False):
        (mechanism, start), _, duration = falling(case, on_box, damping=0.3)
        steps.append(trajectory_of(mechanism, start, duration, tolerance=1e-6).statistics.steps)
    assert 50 < steps[0] < 3 * steps[1]


@pytest.mark.parametrize("case", DEEP)
def test_a_can_without_friction_and_damping_leaves_an_edge_with_the_energy_it_came_with(case):
    (mechanism, start), can, _ = falling(case, True, damping=0.0, friction=0.0)
    times = np.linspace(0.0, 0.03, 301)
    x = motion(mechanism, start, times)
    velocity, spin = x[:, 7:10], x[:, 10:13]
    energy = 0.5 * 0.05 * np.sum(velocity**2, axis=1) + 0.5 * spin**2 @ np.array(can.even_moments) + 0.05 * G * x[:, 2]
    # It gives some to the springs and has all of it back.
    assert energy.min() < 0.98 * energy[0] and energy[-1] == pytest.approx(energy[0], rel=1e-5)


#: What an ellipsoid may lie on, 0.03 m high and curved about y by a radius: an ellipsoid of semi-axes 0.05 and 0.03.
GROUNDS = {
    "half_space": ({}, np.inf),
    "box": ({"sides": (0.2, 0.2, 0.06)}, np.inf),
    "sphere": ({"radius": 0.03}, 0.03),
    "cylinder": ({"radius": 0.03, "length": 0.1, "orientation": (1.0, 0.0, 0.0, 1.0)}, 0.03),
    "capsule": ({"radius": 0.03, "length": 0.1, "orientation": (1.0, 0.0, 0.0, 1.0)}, 0.03),
    "ellipsoid": ({"semi_axes": (0.05, 0.02, 0.03)}, 0.05**2 / 0.03),
}


@pytest.mark.slow
@pytest.mark.parametrize("ground", GROUNDS)
def test_an_ellipsoid_rocks_as_a_rocking_stone_does_on_every_shape(ground):
    """omega^2 = g (R S / (R + S) - c) / ((a^2 + c^2) / 5 + c^2), R = a^2 / c on a ground of radius S, at rest at c."""
    sizes, curved = GROUNDS[ground]
    a, c, tilt = 0.03, 0.012, 1e-3
    bent = a * a / c
    both = bent if np.isinf(curved) else bent * curved / (bent + curved)
    omega = np.sqrt(G * (both - c) / ((a * a + c * c) / 5.0 + c * c))
    surface = {"damping": 0.0, "stiffness": 1e7, "friction": 2.0, "tangential_stiffness": 1e7, "lag": 1e-3}
    place = {} if ground == "half_space" else {"position": (0.0, 0.0, -0.03)}
    lies = Object(shape=ground, surface=surface, **sizes, **place)
    # Rolled by the tilt, without sliding: a ground that is round touches it where its normal has turned by so much.
    turned = 0.0 if np.isinf(curved) else tilt * bent / (bent + curved)
    aside = c * tilt if np.isinf(curved) else (curved + bent) * turned - (bent - c) * tilt
    stone = Object(
        shape="ellipsoid",
        semi_axes=(a, 0.02, c),
        mass=0.05,
        position=(aside, 0.0, c),
        orientation=(0.0, np.sin(0.5 * tilt), 0.0, np.cos(0.5 * tilt)),
    )
    mechanism, start = scene((0.0, 0.0, -G), ground=lies, stone=stone)
    times = np.linspace(0.0, 2.0 * np.pi / omega, 9)
    attitude = 2.0 * motion(mechanism, start, times)[:, 4]
    assert attitude == pytest.approx(tilt * np.cos(omega * times), abs=0.02 * tilt)
