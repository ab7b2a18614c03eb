"""What is said of every kind of primitive, against points drawn at random from the solid itself."""

import numpy as np
import pytest

from finger_pin.description.primitives import KINDS
from finger_pin.description.tree_parts import TreeSolid
from finger_pin.description.validation import validate
from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_sizes import described_sizes, mujoco_sizes

#: Sizes, m, and whether points are inside, written out.
SOLIDS = {
    "sphere": ((0.02,), lambda x: (x**2).sum(axis=1) <= 0.02**2),
    "box": ((0.02, 0.05, 0.03), lambda x: (np.abs(x) <= [0.01, 0.025, 0.015]).all(axis=1)),
    "cylinder": ((0.02, 0.05), lambda x: (np.hypot(x[:, 0], x[:, 1]) <= 0.02) & (np.abs(x[:, 2]) <= 0.025)),
    "capsule": (
        (0.02, 0.05),
        lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]), np.maximum(np.abs(x[:, 2]) - 0.025, 0.0)) <= 0.02,
    ),
    "ellipsoid": ((0.02, 0.05, 0.03), lambda x: ((x / [0.02, 0.05, 0.03]) ** 2).sum(axis=1) <= 1.0),
}


def points(kind):
    """Return sizes and points of the solid, drawn evenly."""
    sizes, inside = SOLIDS[kind]
    drawn = np.random.default_rng(0).uniform(-0.06, 0.06, (1_000_000, 3))
    return sizes, drawn[inside(drawn)]


@pytest.mark.parametrize("kind", SOLIDS)
def test_moments_reach_and_outline_are_those_of_the_points_of_the_solid(kind):
    sizes, x = points(kind)
    about = (x**2).mean(axis=0)
    np.testing.assert_allclose(KINDS[kind].moments(sizes), about.sum() - about, rtol=0.01)
    np.testing.assert_allclose(KINDS[kind].half_sides(sizes), np.abs(x).max(axis=0), rtol=0.05)
    # A corner of a box is seldom drawn.
    assert 0.93 * KINDS[kind].reach(sizes) < np.linalg.norm(x, axis=1).max() <= KINDS[kind].reach(sizes)


@pytest.mark.parametrize("kind", SOLIDS)
def test_parts_that_are_drawn_cover_the_solid_and_no_more(kind):
    sizes, inside = SOLIDS[kind]
    x = np.random.default_rng(1).uniform(-0.06, 0.06, (100_000, 3))
    covered = np.zeros(len(x), dtype=bool)
    for geometry, height in KINDS[kind].parts(sizes):
        y = (x - [0.0, 0.0, height]) / geometry.scale
        covered |= {
            "ball": np.linalg.norm(y, axis=1) <= 1.0,
            "box": (np.abs(y) <= 0.5).all(axis=1),
            "cylinder": (np.hypot(y[:, 0], y[:, 1]) <= 1.0) & (np.abs(y[:, 2]) <= 0.5),
        }[geometry.kind]
    assert (covered == inside(x)).all()


@pytest.mark.parametrize("kind", SOLIDS)
def test_sizes_go_to_mujoco_and_back(kind):
    """MuJoCo has half of what is a length or a side, and radii and semi-axes whole (XML reference, geom size)."""
    sizes, _ = SOLIDS[kind]
    half = {"sphere": [0.02], "cylinder": [0.02, 0.025], "capsule": [0.02, 0.025], "ellipsoid": [0.02, 0.05, 0.03]}
    theirs = mujoco_sizes(kind, sizes)
    assert theirs == pytest.approx(half.get(kind, [0.01, 0.025, 0.015]))
    read = described_sizes(kind, [*theirs, 0.0, 0.0][:3])
    values = next(iter(read.values())) if kind in ("box", "ellipsoid") else [*read.values()]
    assert values == pytest.approx(sizes) and tuple(read) == KINDS[kind].entries


def test_a_solid_refuses_a_size_that_its_kind_does_not_have():
    with pytest.raises(InputError, match=r"solid\.sides.*is for box, not for kind = \"sphere\""):
        validate(TreeSolid, {"kind": "sphere", "radius": 0.01, "sides": [0.01, 0.01, 0.01]}, ("solid",))


def test_solids_of_results_of_earlier_versions_are_read_whose_other_sizes_are_zero():
    entries = {"kind": "capsule", "radius": 0.01, "length": 0.02, "sides": [0.0] * 3, "semi_axes": [0.0] * 3}
    assert TreeSolid.model_validate(entries).sizes == (0.01, 0.02)
