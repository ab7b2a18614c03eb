"""What random models have to satisfy in runs: other doors to one motion, and other programs."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable

import mujoco
import numpy as np
import random_rewritings as rewritings
import xarray as xr
from random_doors import close
from random_fingers import Table
from random_models import DURATION, RandomModel

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import InputError, PathJumpWarning
from finger_pin.simulation.accuracy import residual_share

#: Tolerances of runs that are compared, and of what may remain between them.
TIGHT = {"rtol": 1e-9, "atol_scale": 1e-9}
SAME = 1e-4


def tight(table: Table) -> fp.Scenario:
    """Return the scenario of a table with tight tolerances."""
    return read_scenario({**table, "simulation": table["simulation"] | TIGHT})


def compare(found: xr.Dataset, expected: xr.Dataset, names: Callable[[str], str] = str) -> None:
    """Assert that joints move alike, by names of the other one."""
    joints = [names(str(name)) for name in expected.joint.values]
    for variable in ("joint_position", "joint_velocity"):
        ours, theirs = found[variable].sel(joint=joints).values, expected[variable].values
        size = np.abs(expected.joint_velocity.values).max() * (DURATION if "position" in variable else 1.0)
        error = np.abs(ours - theirs).max() / (size + 1e-6)
        assert error < SAME, f"{variable}: {error:.3g}"


def account_closes(model: RandomModel) -> None:
    """No energy appears or goes unaccounted for, unless a cord jumps, which is told."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        share = residual_share(fp.simulate(tight(model.table)))
    assert share < 1e-5 or any(issubclass(each.category, PathJumpWarning) for each in told), f"{share:.3g}"


def prepared_is_fresh(model: RandomModel) -> None:
    """A run with other numbers at some keys, in any order, is, to the bit, that of a scenario that has them."""
    rng, keys, values, table = model.rng(30), [], [], copy.deepcopy(model.table)
    found = [path for path in _numbers(table) if path[0] in ("finger", "hand", "environment", "controller")]
    for k in rng.permutation(len(found))[:12]:
        other = copy.deepcopy(table)
        place = other
        for name in found[k][:-1]:
            place = place[name]
        place[found[k][-1]] *= float(rng.uniform(0.95, 1.05))
        try:
            read_scenario(other)
        except InputError:
            continue
        table, keys, values = other, [*keys, ".".join(found[k])], [*values, place[found[k][-1]]]
    prepared = fp.prepare(model.scenario, keys, record=("joint_position", "joint_velocity"))
    prepared.run()
    other = fp.prepare(model.scenario, keys[::-1], record=("joint_position", "joint_velocity"))
    runs, fresh = (prepared.run(values), other.run(values[::-1])), fp.simulate(read_scenario(table))
    for name in ("joint_position", "joint_velocity"):
        assert all(np.array_equal(run[name], fresh[name].values) for run in runs), (name, keys)


def _numbers(table: Table, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Return the places of numbers that are no part of a list."""
    found = []
    for key, value in table.items():
        if isinstance(value, dict):
            found += _numbers(value, (*path, key))
        elif isinstance(value, float) and value:
            found.append((*path, key))
    return found


def resumed_is_whole(model: RandomModel) -> None:
    """A run that goes on from half-way ends as one that was not interrupted."""
    half = 0.5 * DURATION
    whole = tight(model.table)
    first, second = (copy.deepcopy(model.table) for _ in range(2))
    first["simulation"]["duration"] = second["simulation"]["duration"] = half
    second["simulation"]["start_time"] = first["simulation"].get("start_time", 0.0) + half
    begun = fp.simulate(tight(first))
    compare(fp.simulate(tight(second), initial=begun).isel(time=[-1]), fp.simulate(whole).isel(time=[-1]))


def held_inputs(model: RandomModel) -> dict[str, float]:
    """Return the inputs that rest, by name."""
    controller, offsets = model.table["controller"], {}
    parts = {"": controller} | {f"{name}.": each for name, each in controller.get("fingers", {}).items()}
    for prefix, part in parts.items():
        for key in ("tensions", "tendon_winding", "inputs"):
            entry = f"{key}." if key == "tendon_winding" else ""
            offsets |= {entry + prefix + name: signal["offset"] for name, signal in part.get(key, {}).items()}
    return offsets


def _fingertip_force(loop: ClosedLoop) -> np.ndarray:
    """Return the force at every fingertip."""
    tips = len(loop.finger.rigid_body.tips)
    return np.broadcast_to(loop.fingertip_force, (tips, 3) if tips > 1 else (3,))


def simulator_is_simulate(model: RandomModel) -> None:
    """Steps under held inputs end where a run does."""
    scenario = tight(model.table)
    loop = ClosedLoop.from_scenario(scenario)
    simulator = fp.Simulator(loop.finger, rtol=TIGHT["rtol"], atol_scale=TIGHT["atol_scale"])
    simulator.reset(loop.initial_state())
    force = _fingertip_force(loop)
    for _ in range(5):
        state = simulator.step(held_inputs(model), DURATION / 5.0, force)
    end = fp.simulate(scenario).isel(time=-1)
    # What hardly moves is known to the absolute tolerance, 1e-8 rad/s.
    size = np.abs(end.joint_velocity.values).max() + 1e-4
    assert np.abs(state.velocity - end.joint_velocity.values).max() < SAME * size
    assert np.abs(state.position - end.joint_position.values).max() < SAME * size * DURATION + 1e-12


def simulate_many_is_simulate(model: RandomModel) -> None:
    """Many runs at once are, to the bit, the single ones."""
    other = model.scenario.updated(simulation={"duration": 0.5 * DURATION})
    for given in ([model.scenario], [other]):
        many, one = fp.simulate_many(given), fp.simulate(given[0])
        assert np.array_equal(many.joint_position.values[0], one.joint_position.values)


def environment_is_simulator(model: RandomModel) -> None:
    """An episode under held actions is that of a simulator."""
    loop = ClosedLoop.from_scenario(model.scenario)
    settings, period = model.scenario.simulation, 0.2 * DURATION
    environment = fp.learning.Environment(
        model.scenario, reward=lambda signals: np.zeros(len(signals["action"])), observation=("joint_position",),
        period=period, duration=DURATION,
    )  # fmt: skip
    environment.reset(seed=0)
    low, high = environment.action_space.low, environment.action_space.high
    action = low + 0.3 * (high - low)
    simulator = fp.Simulator(loop.finger, rtol=settings.rtol, atol_scale=settings.atol_scale)
    simulator.reset(loop.initial_state())
    inputs = dict(zip(environment.action_names, action.astype(float), strict=True))
    force = _fingertip_force(loop)
    for _ in range(4):
        seen, *_ = environment.step(action)
        state = simulator.step(inputs, period, force)
        assert np.abs(seen - state.position).max() < 1e-5 * (1.0 + np.abs(seen).max())


def _rewriting(
    rewrite: Callable[[RandomModel], tuple[Table, Table]], names: Callable[[str], str] = str
) -> Callable[[RandomModel], None]:
    def door(model: RandomModel) -> None:
        one, other = rewrite(model)
        compare(fp.simulate(tight(other)), fp.simulate(tight(one)), names)

    return door


names_do_not_matter = _rewriting(rewritings.renamed, rewritings.name_before)
order_does_not_matter = _rewriting(rewritings.reordered)
mirror_image_moves_alike = _rewriting(rewritings.mirrored)
place_in_the_world_does_not_matter = _rewriting(rewritings.turned)
welded_halves_are_one_body = _rewriting(rewritings.halved)
numbers_may_be_written_one_by_one = _rewriting(rewritings.one_by_one)
clock_does_not_matter = _rewriting(rewritings.later)
palm_askew_is_weight_askew = _rewriting(rewritings.gravity_turned)
palm_does_not_matter = _rewriting(rewritings.on_palm, "left.{}".format)


_AT_JOINTS = {"joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0}}
_FRICTIONLESS = _AT_JOINTS | {"tendon_friction": {"coulomb": 0.0, "viscous": 0.0}}


def _smooth(model: RandomModel) -> Table:
    """Return a tree without friction and ends of ranges, which MuJoCo has as soft constraints."""
    table = copy.deepcopy(model.table)
    rubs = model.scenario.finger.tendons or model.scenario.finger.tree.rubbing
    table["finger"] |= copy.deepcopy(_FRICTIONLESS if rubs else _AT_JOINTS)
    for joint in table["finger"]["joints"].values():
        joint["limited"] = False
    table["finger"].pop("stroke_limiter", None)
    for tendon in table["finger"]["tree"]["tendons"].values():
        tendon.pop("friction", None)
        # MuJoCo's dampers act on what is slack, as the written file says.
        if "slack" in tendon:
            tendon.pop("damping", None)
    return table


def mujoco_accelerates_alike(model: RandomModel) -> None:
    """A tree written for MuJoCo accelerates there as here, and so does what is read from that again."""
    scenario, rng = read_scenario(_smooth(model)), model.rng(40)
    finger, text = fp.Finger(scenario.finger), fp.to_mjcf(scenario.finger)
    written = mujoco.MjModel.from_xml_string(text)
    read = fp.from_mujoco(written)
    again = fp.Finger(read.updated(**(_FRICTIONLESS if read.tree.rubbing or read.tendons else _AT_JOINTS)))
    names = list(finger.routing.joints)
    for _ in range(3):
        q, v = rng.uniform(-0.8, 0.8, len(names)), rng.normal(size=len(names))
        inputs = rng.uniform(0.0, 0.05, finger.mechanism.channels)
        expected = _acceleration(finger, q, v, inputs)
        data = mujoco.MjData(written)
        where = [written.joint(name) for name in names]
        for joint, angle, speed in zip(where, q, v, strict=True):
            data.qpos[joint.qposadr], data.qvel[joint.dofadr] = angle, speed
        for k, address in enumerate(written.actuator_ctrladr):
            name = mujoco.mj_id2name(written, mujoco.mjtObj.mjOBJ_ACTUATOR, k)
            data.ctrl[address] = _input(finger, inputs, name)
        mujoco.mj_forward(written, data)
        theirs = [float(data.qacc[joint.dofadr][0]) for joint in where]
        close(theirs, expected, 1e-6, "MuJoCo", 1e-6)
        order = [again.routing.joints.index(name) for name in names]
        back = np.empty(len(names)), np.empty(len(names))
        back[0][order], back[1][order] = q, v
        given = [_input(finger, inputs, name) for name in _channels(again)]
        close(_acceleration(again, *back, np.array(given))[order], expected, 1e-6, "read again", 1e-6)


def _channels(finger: fp.Finger) -> list[str]:
    tendons = finger.routing.tendons[: finger.routing.actuated]
    return [*tendons, *finger.description.tree.actuators]


def _input(finger: fp.Finger, inputs: np.ndarray, name: str) -> float:
    return float(inputs[_channels(finger).index(name)])


def _acceleration(finger: fp.Finger, q: np.ndarray, v: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    signals = CompiledFinger(finger).evaluate(finger.rest_state(q, v), inputs)
    return finger.layout.unpack(np.asarray(signals.rate)).velocity
