"""Trees of bodies: what is refused, by the name of its entry."""

import numpy as np
import pytest
from changed_tables import with_entries

import finger_pin as fp
from finger_pin.description.meshes import Mesh
from finger_pin.description.validation import validate

FACES = np.array([[0, 1, 2]], dtype=np.int32)
SHELL = Mesh.packed(np.eye(3), FACES)
FINGER = {
    "name": "seesaw",
    "joints": {"hinge": {"range": [-0.3, 0.3]}},
    "tendons": {"pull": {"along": "upper"}},
    "tree": {
        "bodies": {"link": {"mass": 0.02, "inertia": [1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0]}, "tip": {"parent": "link"}},
        "joints": {"hinge": {"body": "link"}},
        "tendons": {
            "upper": {
                "path": {
                    "a": {"kind": "point", "position": [-0.02, 0.0, 0.005]},
                    "wrap": {"kind": "cylinder", "radius": 0.01},
                    "b": {"kind": "point", "body": "link", "position": [0.03, 0.0, 0.01]},
                }
            },
            "sum": {"joints": {"hinge": 0.01}},
        },
        "couplings": {"held": {"joint": "hinge"}},
        "actuators": {"motor": {"tendon": "sum"}},
    },
}
CORD = {"joints": {"hinge": 0.01}, "stiffness": 1e3, "slack": 0.0}


def changed(**entries):
    """Return the description with entries at keys whose dots are double underscores; None takes one away."""
    return validate(fp.FingerDescription, with_entries(FINGER, entries), ("finger",))


def test_the_tree_itself_is_taken():
    assert [(part.divisor, part.crossed) for part in changed().tree.cord("upper").parts] == [(1.0, {"hinge"})]
    assert fp.Finger(changed()).mechanism.channels == 2


def test_an_actuator_turns_a_hinge_by_rad_and_n_m_and_moves_all_else_by_m_and_n():
    targets = {
        "turn": {"joint": "hinge"},
        "cord": {"tendon": "sum"},
        "jet": {"wrench": {"body": "tip", "force": [1, 0, 0]}},
    }
    for kind, units in (("hinge", ("rad", "N m")), ("slide", ("m", "N"))):
        tree = changed(
            tree__actuators=targets, tree__joints__hinge__kind=kind, tree__tendons__sum__joints__hinge=1.0
        ).tree
        found = {name: (each.drives, each.units(tree.joints)) for name, each in tree.actuators.items()}
        others = {"cord": (("tendon", "sum"), ("m", "N")), "jet": (("wrench", "tip"), ("m", "N"))}
        assert found == {"turn": (("joint", "hinge"), units)} | others


def test_a_cord_has_a_leg_from_point_to_point_of_its_path_with_what_it_may_wrap_between():
    """The hinge moves one end of each; the tip is fixed to the link, and the wrap to the base."""
    places = {"a": None, "b": "link", "over": None, "c": "tip", "pulley": None, "d": None, "e": "link"}
    kinds = {"over": {"kind": "cylinder", "radius": 0.003}, "pulley": {"kind": "pulley", "divisor": 2.0}}
    ends = {name: {"kind": "point", "position": [0.01 * k, 0.02, 0.0]} for k, name in enumerate(places)} | kinds
    path = {name: ends[name] | ({"body": body} if body else {}) for name, body in places.items()}
    tree = changed(tree__tendons__upper__path=path).tree
    points, found = tree.tendons["upper"].path, tree.cord("upper").parts
    expected = [("1", "ab", None, False), ("2", "bc", "over", True)], [("1", "de", None, False)]
    for part, legs in zip(found, expected, strict=True):
        assert all(leg.crossed == {"hinge"} for leg in part.elements)
        assert [(leg.name, leg.points, leg.wrap, leg.follows) for leg in part.elements] == [
            (name, tuple(points[end] for end in pair), wrap and (wrap, points[wrap]), follows)
            for name, pair, wrap, follows in legs
        ]
    assert [part.divisor for part in found] == [1.0, 2.0]


def test_past_a_bend_a_cord_slides_by_its_legs_from_there_on_alone():
    """Coefficients of joints stand before its path, although it crosses the same joint again behind the bend."""
    points = {"a": None, "b": "link", "c": None}
    path = {name: {"kind": "point", "position": [0.0, 0.02, 0.01 * k]} for k, name in enumerate(points)}
    path["b"]["body"] = "link"
    given = {"joints": {"hinge": 0.01}, "path": path}
    finger = fp.Finger(changed(tree__tendons__upper=given, tendon_friction={"place": "bends"}))
    entry, bend = (table for table in finger.mechanism.rows if table.names in (("pull",), ("pull.2",)) and table.routed)
    assert (entry.arm.item(), bend.arm.item()) == (-0.01, 0.0)
    assert [leg.arm for leg in entry.paths[0]] == [-1.0, -1.0] and [leg.arm for leg in bend.paths[0]] == [0.0, -1.0]


def test_directions_that_are_rounded_have_length_1():
    turned = changed(
        tree__bodies__link__orientation=[0.0, 0.7071, 0.0, 0.7071], tree__joints__hinge__axis=[0.6, 0.8001, 0.0]
    )
    np.testing.assert_allclose(turned.tree.bodies["link"].orientation, np.sqrt([0.0, 0.5, 0.0, 0.5]), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(turned.tree.joints["hinge"].axis), 1.0, atol=1e-15)
    rounded_up = (0.0, -2.8e-17, 1.1e-16, 1.0000000000000022)
    assert changed(tree__bodies__link__orientation=rounded_up).tree.bodies["link"].orientation[3] == 1.0


@pytest.mark.parametrize(
    ("entry", "value", "says"),
    [
        ("tree__bodies__tip__solids", {"shell": {"kind": "mesh"}}, "solids.shell.mesh: is missing"),
        ("tree__bodies__tip__solids", {"shell": {"kind": "mesh", "mesh": "shell"}}, "no such mesh; there are none"),
        ("tree__meshes", {"shell": {**SHELL, "points": "AAAA"}}, "shell.points: must be numbers in threes"),
        ("tree__meshes", {"shell": {**SHELL, "faces": SHELL["points"]}}, "must be corners from 0 to 2"),
        ("tree__meshes", {"shell": Mesh.packed(1e3 * np.eye(3), FACES)}, "must be finite and at most 10 m"),
        ("tree__bodies__link__parent", "tip", "finger.tree.bodies.link.parent"),
        ("tree__bodies__tip__parent", "lnk", "did you mean link"),
        ("tree__bodies__link__orientation", [1.0, 1.0, 0.0, 0.0], "quaternion x, y, z, w of length 1"),
        ("tree__bodies__link__mass", -1.0, "finger.tree.bodies.link.mass = -1.0: must be at least 0"),
        ("tree__joints__hinge__axis", [0.0, 0.5, 0.0], "must be a unit vector"),
        ("tree__tendons__upper__path__wrap__orientation", [0.0, 0.0, 0.0, 0.5], "quaternion x, y, z, w of length 1"),
        ("tree__joints__hinge__body", "thumb", "no such body; there are link, tip"),
        ("tree__joints__hinge__kind", "ball", "must be one of hinge, slide"),
        ("joints__more", {"range": [0.0, 1.0]}, "must be those of the finger, in order: hinge, more"),
        ("tree__tendons__upper__path__b__body", "palm", "finger.tree.tendons.upper.path.b.body"),
        ("tree__tendons__upper__path__a", None, "a wrap stands between two points"),
        ("tree__tendons__upper__path__b", None, "must end with a point"),
        ("tree__tendons__upper__path__wrap__radius", 0.0, "must be above 0"),
        ("tree__tendons__upper__path__wrap__radius", 0.5, "path.wrap: the point a lies inside of it"),
        ("tree__tendons__upper__path", None, "needs joints or a path"),
        ("tree__tendons__upper__slack", 0.0, "slack = 0.0: has no effect without stiffness; leave it out"),
        ("tree__tendons__upper", {**CORD, "rest": [0.0, 1.0]}, "upper.slack = 0.0: has no place beside rest"),
        ("tree__tendons__upper", {**CORD, "slack": 2.0}, "upper.slack = 2.0: must be at most 1 m (is it in mill"),
        ("tree__tendons__sum__joints", {"elbow": 1.0}, "no such joint; there are hinge"),
        ("tree__tendons__sum__range", [1.0, 0.0], "the least length must be below the largest"),
        ("tree__tendons__sum__rest", [1.0, 0.0], "the first length must not be above the second"),
        ("tree__actuators__motor__joint", "hinge", "drives one of joint, tendon and wrench"),
        ("tree__actuators__motor__force_range", [1.0, 0.0], "the lower limit must not be above the upper one"),
        ("tree__couplings__held__other", "knee", "no such joint; there are hinge"),
        ("tree__tip", {"body": "nail"}, "no such body"),
        ("tendons__pull__along", "lower", "no such tendon of the tree; there are upper, sum"),
        ("tendons__pull__crossings", {"hinge": {"radius": 0.01}}, "has no place beside crossings"),
        ("tendons__pull__kind", "passive", "is for actuated tendons only"),
        ("tree", None, "no such tendon of the tree; there are none"),
    ],
)
def test_an_entry_that_does_not_fit_is_refused_by_its_name(entry, value, says):
    with pytest.raises(fp.InputError) as refused:
        changed(**{entry: value})
    assert says in str(refused.value) and str(refused.value).startswith("finger.t")


def test_a_joint_that_moves_nothing_is_refused():
    light = changed(tree__bodies__link={"mass": 0.0})
    with pytest.raises(fp.InputError, match=r"finger\.tree\.joints\.hinge: moves nothing that has mass or inertia"):
        fp.Finger(light)


def test_actuators_of_a_tree_are_driven_in_open_loop_alone():
    scenario = {"name": "x", "finger": FINGER, "controller": {"kind": "proportional"}}
    with pytest.raises(fp.InputError, match=r"controller\.kind"):
        validate(fp.Scenario, scenario, ())
    scenario["controller"] = {"kind": "tensions", "inputs": {"moter": {"offset": 1.0}}}
    with pytest.raises(fp.InputError, match="no such actuator; there are motor; did you mean motor"):
        validate(fp.Scenario, scenario, ())
