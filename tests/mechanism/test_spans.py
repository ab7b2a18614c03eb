"""Length, turn, pull and slopes of spans: against MuJoCo, against closed forms and differences, and compiled."""

import math

import mujoco
import numpy as np
import pytest
from compiled_shapes import fill_rows

from finger_pin.mechanism.spans import CYLINDER, SPHERE, STRAIGHT

RADIUS = 0.1
SIDES = {"free": None, "outside": (0.03, 0.14, 0.02), "inside": (0.02, -0.01, 0.03)}
CASES = [(span, side) for span in (CYLINDER, SPHERE) for side in SIDES]
every_case = pytest.mark.parametrize(("span", "side"), CASES, ids=lambda each: getattr(each, "name", each))


def numbers(side):
    """Return the parameters of a wrap."""
    return np.array([RADIUS, *(SIDES[side] or (0.0, 0.0, 0.0)), side != "free", side == "inside"], dtype=float)


def value(span, y, p):
    out = np.full(8, np.nan)
    span.value(y, p, out)
    return out


def slopes(span, y, p):
    out = np.full(42, np.nan)
    span.slopes(y, p, out)
    return out[:6], out[6:].reshape(6, 6)


def difference(function, y, step=2e-5):
    """Return the derivatives by each of six numbers, as columns, by central differences of order eight."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    columns = [
        sum(weight * (function(y + k * step * e) - function(y - k * step * e)) for k, weight in weights.items())
        for e in np.eye(6)
    ]
    return np.array(columns).T / step


def postures(span, p, count):
    """Return pairs of points around a wrap, none where the wrap comes or goes; every other pair is wrapped."""
    random, found = np.random.default_rng(1), []
    while len(found) < count:
        y = random.uniform(-0.3, 0.3, 6)
        reach = y.reshape(2, 3)[:, : 2 if span is CYLINDER else 3]
        turn = value(span, y, p)[1]
        wanted = turn > 0.1 if len(found) % 2 else turn == 0.0
        if wanted and np.linalg.norm(reach, axis=1).min() > 1.1 * RADIUS:
            found.append(y)
    return found


@pytest.mark.slow
@every_case
def test_lengths_and_arms_are_those_of_mujoco(span, side):
    sliding = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><worldbody>
      <body pos="0.1 0.2 0.3" euler="20 30 40"><geom name="wrap" type="{span.name}" size="{RADIUS} 0.5"/>
        <site name="side" pos="{" ".join(map(str, SIDES[side] or (0, 0, 0)))}"/></body>
      <body>{sliding}<geom size="0.01"/><site name="a"/></body>
      <body>{sliding}<geom size="0.01"/><site name="b"/></body></worldbody>
      <tendon><spatial><site site="a"/><geom geom="wrap" {'sidesite="side"' if SIDES[side] else ""}/>
        <site site="b"/></spatial></tendon></mujoco>""")
    data, p, random = mujoco.MjData(model), numbers(side), np.random.default_rng(3)
    # MuJoCo's inside wrap ends its iteration at 1e-6, which enters the arm, and the length only squared.
    tolerance, wrapped = (1e-6 if side == "inside" else 1e-12), 0
    for _ in range(1000):
        data.qpos = random.uniform(-0.3, 0.3, 6) + np.tile([0.1, 0.2, 0.3], 2)
        mujoco.mj_forward(model, data)
        rotation, origin = data.geom("wrap").xmat.reshape(3, 3), data.geom("wrap").xpos
        found = value(span, ((data.qpos.reshape(2, 3) - origin) @ rotation).ravel(), p)
        assert found[0] == pytest.approx(data.ten_length[0], abs=1e-12)
        assert (found[2:].reshape(2, 3) @ rotation.T).ravel() == pytest.approx(data.ten_J.ravel(), abs=tolerance)
        assert (found[1] > 0.0) == (data.ten_wrapnum[0] == 4)
        wrapped += found[1] > 0.0
    assert 100 < wrapped < 900


@pytest.mark.slow
@every_case
def test_pulls_and_slopes_are_derivatives(span, side):
    p = numbers(side)
    for y in postures(span, p, 60):
        by_turn, by_pull = slopes(span, y, p)
        slope = difference(lambda y: value(span, y, p), y)
        assert value(span, y, p)[2:] == pytest.approx(slope[0], abs=1e-9)
        # Per metre, where points are a few centimetres apart.
        assert by_turn == pytest.approx(slope[1], rel=1e-9, abs=1e-8)
        assert by_pull == pytest.approx(slope[2:], rel=1e-9, abs=1e-8)


def test_a_straight_span_pulls_along_itself():
    y = np.array([0.1, -0.2, 0.3, -0.4, 0.1, 0.2])
    found = value(STRAIGHT, y, ())
    assert found[0] == pytest.approx(np.linalg.norm(y[3:] - y[:3]), rel=1e-15)
    assert found[1] == 0.0
    slope = difference(lambda y: value(STRAIGHT, y, ()), y)
    assert found[2:] == pytest.approx(slope[0], abs=1e-11)
    assert slopes(STRAIGHT, y, ())[1] == pytest.approx(slope[2:], abs=1e-9)


def test_a_helix_turns_by_its_curvature_times_its_length():
    quarter, rise = math.pi / 2.0, 0.3
    y = np.array([0.1, -0.4, 0.0, -0.4, 0.1, rise])
    # Tangents at (R, 0) and (0, R), each 0.4 m long; of a helix r, c the curvature is r / (r^2 + c^2).
    flat = 0.8 + RADIUS * quarter
    pitch = RADIUS * rise / flat
    arc = quarter * math.hypot(RADIUS, pitch)
    p = np.array([RADIUS, 0.1, 0.1, 0.0, 1.0, 0.0])
    length, turn = value(CYLINDER, y, p)[:2]
    assert length == pytest.approx(math.hypot(flat, rise), rel=1e-14)
    assert turn == pytest.approx(RADIUS / (RADIUS**2 + pitch**2) * arc, rel=1e-14)


def test_a_path_inside_turns_by_the_angle_of_its_two_lines():
    y = np.array([0.2, -0.1, 0.0, 0.2, 0.1, 0.15])
    # By symmetry both lines end at (R, 0), half way up.
    there = np.array([RADIUS, 0.0, 0.075])
    one, two = there - y[:3], y[3:] - there
    expected = math.acos(one @ two / (np.linalg.norm(one) * np.linalg.norm(two)))
    p = np.array([RADIUS, 0.05, 0.0, 0.0, 1.0, 1.0])
    length, turn = value(CYLINDER, y, p)[:2]
    assert length == pytest.approx(np.linalg.norm(one) + np.linalg.norm(two), rel=1e-14)
    assert turn == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("span", [SPHERE, CYLINDER], ids=lambda each: each.name)
def test_points_in_line_with_the_centre_have_a_path(span):
    across = value(span, np.array([0.2, 0.0, 0.0, -0.2, 0.0, 0.0]), numbers("free"))
    assert across[0] == pytest.approx(2 * math.sqrt(0.03) + RADIUS * math.pi / 3.0, rel=1e-14)
    y = np.array([0.2, 0.0, 0.0, 0.3, 0.0, 0.0])
    back = value(span, y, numbers("inside"))
    assert back[0] == pytest.approx(0.3, rel=1e-14)
    assert back[2:] == pytest.approx([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert np.isfinite(slopes(span, y, numbers("inside"))[1]).all()


@pytest.mark.slow
@every_case
def test_compiled_spans_agree(span, side):
    p, rows = numbers(side), np.array([*postures(span, numbers(side), 20)])
    many = np.tile(np.array(p, float), (len(rows), 1))
    filled = fill_rows(span.value, 8, rows, many), fill_rows(span.slopes, 42, rows, many)
    for y, out, found in zip(rows, *filled, strict=True):
        assert out == pytest.approx(value(span, y, p), abs=1e-12)
        by_turn, by_pull = slopes(span, y, p)
        assert found == pytest.approx(np.append(by_turn, by_pull), rel=1e-11, abs=1e-10)
