"""Cords around right angles, and branches behind pulleys, in MuJoCo's step: the capstan law by each path's own bend."""

import itertools
import math

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.laws.bristle import stiction_rate
from finger_pin.laws.bristle_slip import slip_level, slip_steepness
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mujoco.friction_step import bristle_stiffness

SLIDER = """<body name="{name}" pos="{place}"><joint name="{name}" type="slide" axis="{axis}" damping="2"
stiffness="200"/><geom size="0.006" mass="0.05"/><site name="{name}_tip"/></body>"""
# Bristles so stiff that what they lag behind a growing tension by is small.
LAW = {"coulomb": 0.25, "viscous": 0.0, "stiction_ratio": 1.0, "stiffness": 1e6}


def drawn(sites, bodies, tendon, pull=8.0):
    """Return forces of the sliders' springs, N, after a cord was slowly drawn in, and the signals of its friction."""
    spec = mujoco.MjSpec.from_string(f"""<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
    {"".join(f'<site name="s{k}" pos="{place}"/>' for k, place in enumerate(sites))}{"".join(bodies)}</worldbody>
    <tendon><spatial name="cord">{tendon}</spatial></tendon>
    <actuator><motor name="pull" tendon="cord" gear="-1" ctrlrange="0 20"/></actuator></mujoco>""")
    fp.mujoco.add_friction(spec, tendons={"*": LAW})
    model = spec.compile()
    data = mujoco.MjData(model)
    signals = fp.mujoco.friction(model, data)
    for step in range(4000):
        data.ctrl[0] = pull * min(1.0, step / 3000)
        mujoco.mj_step(model, data)
    return [200.0 * abs(each) for each in data.qpos], signals


def along(*points):
    return "".join(f'<site site="{each}"/>' for each in points)


@pytest.mark.parametrize("corners", [1, 2, 3, 4, 5])
def test_any_number_of_right_angles_counts_whole(corners):
    """On a square spiral, each corner is a right angle to the last digit: multiples of half a turn among the sums."""
    x, z, way, places = 0.0, 0.0, (1, 0), ["0 0 0"]
    for k in range(corners):
        x, z = x + 0.03 * (k + 2) * way[0], z + 0.03 * (k + 2) * way[1]
        places.append(f"{x} 0 {z}")
        way = (-way[1], way[0])
    end = f"{x + 0.3 * way[0]} 0 {z + 0.3 * way[1]}"
    slider = SLIDER.format(name="end", place=end, axis=f"{way[0]} 0 {way[1]}")
    (force,), signals = drawn(places, [slider], along(*(f"s{k}" for k in range(len(places))), "end_tip"))
    assert signals.turn[0] == pytest.approx(0.5 * math.pi * corners, abs=1e-9)
    assert force == pytest.approx(8.0 * math.exp(-0.25 * 0.5 * math.pi * corners), rel=0.01)


@pytest.mark.parametrize("signs", list(itertools.product((-1.0, 1.0), repeat=3)))
def test_a_straight_cord_turns_by_nothing_whichever_way_it_points(signs):
    """Products of a leg to negative x, y and z with nothing before it are -0.0, whose angle would be half a turn."""
    way = np.array(signs) / math.sqrt(3.0)
    end, axis = (" ".join(map(str, each)) for each in (0.3 * way, way))
    (force,), signals = drawn(["0 0 0"], [SLIDER.format(name="end", place=end, axis=axis)], along("s0", "end_tip"))
    assert signals.turn[0] == 0.0
    assert force == pytest.approx(8.0, rel=1e-3)


def test_branches_behind_a_pulley_rub_by_their_own_bend_at_their_own_tension():
    """The cord has one right angle before its pulley, then none, one and two, at a half, a third and a quarter."""
    sites = ["0 0 -0.05", "0 0 0", "0.05 0 0"]
    sites += ["0.1 0.02 0", "0.1 0 0.02", "0.15 0 0.02", "0.1 -0.02 0", "0.15 -0.02 0", "0.15 -0.02 -0.05"]
    sliders = [
        SLIDER.format(name="a", place="0.3 0.02 0", axis="1 0 0"),
        SLIDER.format(name="b", place="0.15 0 0.2", axis="0 0 1"),
        SLIDER.format(name="c", place="0.0 -0.02 -0.05", axis="1 0 0"),
    ]
    tendon = along("s0", "s1", "s2") + '<pulley divisor="2"/>' + along("s3", "a_tip")
    tendon += '<pulley divisor="3"/>' + along("s4", "s5", "b_tip")
    tendon += '<pulley divisor="4"/>' + along("s6", "s7", "s8", "c_tip")
    forces, signals = drawn(sites, sliders, tendon)
    left = math.exp(-0.25 * 0.5 * math.pi)
    assert signals.turn == pytest.approx([0.5 * math.pi, 0.0, 0.5 * math.pi, math.pi], abs=1e-6)
    assert forces == pytest.approx([8.0 * left / 2, 8.0 * left**2 / 3, 8.0 * left**3 / 4], rel=0.02)


def test_bristles_in_the_step_move_at_the_rate_of_our_core():
    """At any force, speed and turn: the step's stiffness times (v - F |v| / level) is (9a) with `slip_level`."""
    rng = np.random.default_rng(5)
    for share, speed, turn in zip(
        rng.uniform(-2.5, 2.5, 200), rng.normal(size=200), rng.uniform(0.0, 20.0, 200), strict=True
    ):
        force, steepness = 3.0 * share, slip_steepness(capstan_coefficient(0.4, turn), 5e5)
        expected = stiction_rate(force, speed, slip_level(force, 3.0, steepness), 5e4 + 5e5 * abs(force))
        found = bristle_stiffness(5e4, 5e5, force, 3.0, speed, 0.4, turn) * (speed - force * abs(speed) / 3.0)
        assert found == pytest.approx(expected, rel=1e-9)
    assert bristle_stiffness(5e4, 0.0, 2.0, 3.0, 0.1, 0.4, 9.0) == 5e4
