"""A pulley with mass: a body on a slide, or a wheel on a hinge, which one tendon pulls, and a cord over it."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.validation import validate

MASS, STIFFNESS, PULL = 0.02, 4e3, 0.2
# Friction has a floor, below what these tests see.
SMOOTH = {"coulomb": 0.0, "viscous": 0.0, "floor": 1e-9}
FREE = {"tendon_friction": SMOOTH, "joint_friction": SMOOTH | {"stiction": 0.0}}
EXACT = {"rtol": 1e-9, "atol_scale": 1e-10}


def point(x, y=0.0, body=None):
    return {"kind": "point", "position": [x, y, 0.0]} | ({"body": body} if body else {})


def branches(*ways):
    """Return a path whose parts all begin at a pulley."""
    path = {}
    for k, way in enumerate(ways):
        path |= {f"pulley_{k}": {"kind": "pulley"}} | {f"point_{k}_{n}": each for n, each in enumerate(way)}
    return path


def hand_of(bodies, joints, tendons, settings, **friction):
    inertia = {"inertia": [1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0]}
    table = {
        "name": "differential",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {name: {"range": [-2.0, 2.0]} | settings.get(name, {}) for name in joints},
        "tendons": {"trunk": {"along": "trunk"}},
        "tree": {
            "bodies": {name: inertia | body for name, body in bodies.items()},
            "joints": joints,
            "tendons": tendons,
            "tip": {"body": list(bodies)[-1]},
        },
    }
    return fp.Hand(validate(fp.FingerDescription, table | friction, ("finger",)))


def sliding(masses, springs=(), **cord):
    """Return fingers that slide along the line of the block, where lengths are linear and closed forms exact."""
    bodies = {"block": {"mass": MASS}} | {
        name: {"mass": each, "position": [0.1, 0.0, 0.0]} for name, each in masses.items()
    }
    joints = {name: {"body": name, "kind": "slide", "axis": [-1.0, 0.0, 0.0]} for name in bodies}
    tendons = {
        "trunk": {"joints": {"block": -1.0}},
        "cord": {
            "joints": {"block": float(len(masses))},
            "path": branches(*([point(0.0), point(0.0, body=name)] for name in masses)),
            "stiffness": STIFFNESS,
            "slack": 0.0,
        }
        | cord,
    }
    settings = {name: {"spring": {"stiffness": k}} for name, k in springs}
    return hand_of(bodies, joints, tendons, settings, **FREE)


def wheel(masses):
    """Return a wheel of the same mass I / r^2 over which the trunk goes on to one finger."""
    radius, (name, mass) = 0.01, *masses.items()
    inertia = [1e-6, 1e-6, MASS * radius**2, 0.0, 0.0, 0.0]
    bodies = {"wheel": {"mass": 1e-3, "inertia": inertia}, name: {"mass": mass}}
    joints = {"wheel": {"body": "wheel"}, name: {"body": name, "kind": "slide", "axis": [-1.0, 0.0, 0.0]}}
    cord = {"joints": {"wheel": radius, name: -1.0}, "stiffness": STIFFNESS, "slack": 0.0}
    tendons = {"trunk": {"joints": {"wheel": -radius}}, "cord": cord}
    return hand_of(bodies, joints, tendons, {}, **FREE), radius


def closed_form(t, strands, masses):
    """Return the pulley's way, the masses' ways and the cord's tension under a constant pull from rest.

    The stretch e = d s - sum x obeys e'' = d T / m - w^2 e with w^2 = K (d^2 / m + sum 1 / m_i).
    """
    inverse = 1.0 / np.array(masses)
    square = STIFFNESS * (strands**2 / MASS + inverse.sum())
    tension = STIFFNESS * strands * PULL / (MASS * square)
    swung = 1.0 - np.cos(np.sqrt(square) * t)
    impulse = tension * (0.5 * t**2 - swung / square)
    return np.array([(0.5 * PULL * t**2 - strands * impulse) / MASS, *(impulse * inverse)]), tension * swung


# Heavy ones stand still: the block swings between its cords at sqrt(4 K / m).
@pytest.mark.parametrize("masses", [{"a": 0.03, "b": 0.05}, {"a": 1e4, "b": 1e4}])
def test_a_block_under_a_constant_pull_moves_as_its_closed_form(masses):
    sim = fp.Simulator(sliding(masses), **EXACT)
    for n in range(1, 41):
        found = sim.step([PULL], 1e-3).position
        np.testing.assert_allclose(found, closed_form(n * 1e-3, 2, [*masses.values()])[0], atol=2e-9, rtol=0)
    result = sim.result()
    tension = [closed_form(t, 2, [*masses.values()])[1] for t in result.time.values]
    np.testing.assert_allclose(result.elastic_cords_force.values[:, 0], tension, atol=2e-5)
    assert abs(result.energy_residual).max() < 1e-6 * result.energy_exchanged_actuators[-1]


def test_a_wheel_moves_as_a_block_of_its_inertia_over_its_radius_squared():
    hand, radius = wheel({"a": 0.03})
    sim = fp.Simulator(hand, **EXACT)
    for n in range(1, 41):
        found = sim.step([PULL], 1e-3).position * [radius, 1.0]
        np.testing.assert_allclose(found, closed_form(n * 1e-3, 1, [0.03])[0], atol=2e-9, rtol=0)


def test_at_rest_both_fingers_have_half_of_the_tension():
    hand = sliding({"a": 0.03, "b": 0.05}, springs=[("a", 300.0), ("b", 700.0)])
    half = 0.5 * PULL
    a, b = half / 300.0, half / 700.0
    block = 0.5 * (a + b + half / STIFFNESS)
    np.testing.assert_allclose(fp.analysis.equilibrium(hand, [PULL]).position, [block, a, b], rtol=1e-6)


@pytest.mark.parametrize(("position", "velocity"), [(0.0, 0.5), (0.0, 0.01), (-1e-4, 0.0)])
def test_a_cord_that_loosens_lets_go_and_never_pushes(position, velocity):
    hand = sliding({"a": 0.03, "b": 0.05}, damping=20.0)
    x = hand.rest_state(np.array([position, 0.0, 0.0]), np.array([0.0, velocity, 0.0]))
    np.testing.assert_allclose(hand.evaluate(x, [PULL])["joint_acceleration"], [PULL / MASS, 0.0, 0.0], atol=1e-6)


def test_slack_is_what_the_block_goes_before_the_cord_pulls():
    hand = sliding({"a": 0.03, "b": 0.05}, slack=2e-3)
    for way, tension in ((0.9e-3, 0.0), (1.5e-3, STIFFNESS * 1e-3)):
        found = hand.evaluate(hand.rest_state(np.array([way, 0.0, 0.0])), [PULL])["joint_acceleration"]
        np.testing.assert_allclose(found, [(PULL - 2 * tension) / MASS, tension / 0.03, tension / 0.05], atol=1e-6)


def turning(block):
    """Return two hinged fingers on one tendon, divided by a block of some mass, or by a pulley without any."""
    bodies, joints, settings, ways = {}, {}, {}, []
    for name, y, stiffness in (("a", 0.02, 0.01), ("b", -0.02, 0.02)):
        bodies[name] = {"mass": 0.01, "position": [0.05, y, 0.0], "centre": [0.02, 0.0, 0.0]}
        joints[name] = {"body": name}
        settings[name] = {"spring": {"stiffness": stiffness, "damping": 1e-4}}
        ways.append([point(0.03), point(0.03, y - 0.007), point(0.02, -0.006, name)])
    if block is None:
        parts = branches(*([point(0.0), *way] for way in ways))
        divided = {name: each | ({"divisor": 2.0} if each["kind"] == "pulley" else {}) for name, each in parts.items()}
        tendons = {"trunk": {"path": {"spool": point(-0.2), "block": point(0.0)} | divided}}
    else:
        bodies = {"block": {"mass": block}} | bodies
        joints = {"block": {"body": "block", "kind": "slide", "axis": [-1.0, 0.0, 0.0], "bearing": False}} | joints
        cord = branches(*([point(0.0), *way] for way in ways))
        tendons = {
            "trunk": {"joints": {"block": -1.0}},
            "cord": {"joints": {"block": 2.0}, "path": cord, "stiffness": 100.0 / block, "slack": 0.0},
        }
    return hand_of(bodies, joints, tendons, settings, tendon_friction={"coulomb": 0.2})


def swing(block):
    hand = turning(block)
    sim = fp.Simulator(hand, np.zeros(len(hand.routing.joints)), rtol=1e-7, atol_scale=1e-7)
    angles = np.array([sim.step([1.0 + np.sin(30.0 * 2e-3 * n)], 2e-3).position[-2:] for n in range(100)])
    result = sim.result()
    assert abs(result.energy_residual).max() < 1e-5 * result.energy_exchanged_actuators[-1]
    return angles


@pytest.mark.slow
def test_a_block_without_mass_is_a_pulley_that_divides_the_tension():
    """Friction of canals and pins included: what differs falls with the mass and the cord's compliance."""
    massless = swing(None)
    errors = [abs(swing(mass) - massless).max() for mass in (1e-3, 1e-4)]
    assert np.ptp(massless, axis=0).min() > 0.05
    assert errors[1] < 2e-5
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.2)


def test_a_cord_loads_the_joints_that_its_coefficients_and_each_of_its_strands_cross():
    tree = turning(1e-3).description.tree
    parts = tree.cord("cord").parts
    assert [(part.divisor, part.crossed) for part in parts] == [(1.0, {"block"}), (1.0, {"a"}), (1.0, {"b"})]
    assert tree.rubbing == ("cord",)


def test_behind_a_pulley_a_branch_is_pulled_by_what_its_own_trunk_delivers():
    """A spring and a motor pull cords of one path; both lose tension before the pulley, which halves it."""
    halved = {"divide": {"kind": "pulley", "divisor": 2.0}, "c": point(0.0), "d": point(0.01, body="block")}
    path = {"a": point(-0.02), "b": point(0.03, body="block")} | halved
    block = {"body": "block", "kind": "slide", "axis": [1.0, 0.0, 0.0]}
    trunk = {"path": path, "stiffness": STIFFNESS, "rest": [0.02, 0.02]}
    hand = hand_of({"block": {"mass": MASS}}, {"block": block}, {"trunk": trunk}, {})
    x = hand.rest_state([0.0])
    state = hand.layout.unpack(x)
    state.tendon_stiction[:], state.canal_stiction[:] = 0.25, [0.5, 0.0, 0.0]
    found = hand.evaluate(x, [PULL + 3.0])
    by_spring, of_spring = (found.mechanism.rows[group] for group in ("tendon_canals", "tendon_branches"))
    stretched = STIFFNESS * (0.05 + 0.5 * 0.01 - 0.02)
    assert by_spring.row.command == pytest.approx([stretched])
    np.testing.assert_allclose(of_spring.row.command, [0.5 * (stretched - 0.5), 0.5 * (PULL + 3.0 - 0.25)], rtol=1e-6)
