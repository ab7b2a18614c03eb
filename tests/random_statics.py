"""What random models with friction have to satisfy where they come to rest, and over a step."""

from __future__ import annotations

import copy

import numpy as np
import xarray as xr
from random_doors import inputs
from random_fingers import Table, decades
from random_models import RandomModel
from random_trees import pulled_cord

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.description.loading import read_scenario
from finger_pin.typing import Array

#: Time of a slow pull, s, and the tensions between which it goes, N.
SLOW, LEAST, MOST = 40.0, 0.5, 4.0
#: Time over which steps are differentiated, s, and the tolerance of runs.
_STEP, _EXACT = 2e-4, 1e-12


def single_cord(model: RandomModel, drawn_in: bool) -> Table:
    """Return a model whose joints have springs and whose single cord rubs, pulled slowly.

    Joints do not rub. Bristles are stiff, so that they keep up with a level that changes on the way.
    """
    rng, table = model.rng(50), copy.deepcopy(model.table)
    finger = table["finger"]
    if not finger["tendons"]:
        pulled_cord(rng, table)
    # Of a chain the one that pulls at all joints.
    cord = [*finger["tendons"]][-2:][0]
    finger["tendons"] = {cord: finger["tendons"][cord]}
    for joint in finger["joints"].values():
        spring = {"stiffness": decades(rng, 0.2, 1.0), "rest": float(rng.uniform(-0.3, 0.3)), "damping": 0.02}
        joint |= {"spring": spring, "limited": False}
    finger.pop("stroke_limiter", None)
    finger["joint_friction"] = {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0}
    friction = {"coulomb": decades(rng, 0.05, 0.3), "stiction_ratio": float(rng.uniform(1.0, 1.5)), "stiffness": 1e8}
    friction |= {
        "viscous": decades(rng, 1e-2, 1.0),
        "stribeck_velocity": 0.1,
        "place": str(rng.choice(["canal", "bends"])),
    }
    finger["tendon_friction"] = friction
    swing = {"offset": 0.5 * (LEAST + MOST), "amplitude": 0.5 * (MOST - LEAST), "frequency": 0.5 / SLOW}
    pull = swing | {"phase": -0.5 * np.pi if drawn_in else 0.5 * np.pi}
    table["controller"] = {"kind": "tensions", "tensions": {cord: pull}}
    table["simulation"] |= {"duration": SLOW, "sample_rate": 2.0 / SLOW}
    return table


def slow_pulls_end_where_friction_lets_a_finger_settle(model: RandomModel) -> None:
    """The end of a slow pull is the posture, and the tensions are those, of a cord that came to rest as it slid so."""
    drawn_in = bool(model.rng(51).random() < 0.5)
    scenario = read_scenario(single_cord(model, drawn_in))
    loop, way = ClosedLoop.from_scenario(scenario), 1e-6 if drawn_in else -1e-6
    load = np.array([MOST if drawn_in else LEAST])
    run = fp.simulate(scenario)
    fastest, end = run.isel(time=1), run.joint_position.values[-1]
    travel = np.abs(end - fastest.joint_position.values).max()
    passing = way * fastest.wrap_velocity.values if "wrap" in run.dims else np.ones(1)
    # A cord that moves nothing, or hardly passes a bend, or the other way, does not say what friction holds there.
    if travel < 3e-3 or np.any(passing < 1e-2 * np.abs(passing).max()):
        return
    settled = fp.analysis.settled_posture(loop.finger, load, way, end, loop.fingertip_force)
    assert np.abs(settled - end).max() < 5e-3 * travel, f"{np.abs(settled - end).max() / travel:.3g}"
    steady = fp.analysis.steady_state(loop.finger, load[None], np.array([way]), end[None], at_rest=True)
    error = np.abs(steady.tension[0] - run.tendon_tension.values[-1]).max()
    assert error < 2e-3 * MOST, f"tension: {error:.3g}"


def step_map_is_that_of_differences(model: RandomModel) -> None:
    """Some columns of A and B of `linearise` over a step are differences of a simulator's steps at tight tolerances."""
    rng, loop = model.rng(52), ClosedLoop.from_scenario(model.scenario)
    finger, u = loop.finger, inputs(loop, rng)
    # Bristles that are stretched a little: where they begin at rest there is a kink.
    x = loop.initial_state() + 1e-3 * rng.normal(size=finger.layout.size) * finger.layout.scales()
    linear = fp.linearise(finger, x, u, dt=_STEP)
    simulator = fp.Simulator(finger, rtol=_EXACT, atol_scale=_EXACT)
    point, found = np.append(x, u), np.hstack([linear.A, linear.B])
    scales, rows = np.append(finger.layout.scales(), np.ones(len(u))), finger.layout.scales()[:, None]

    def end(near: Array) -> Array:
        simulator.reset(near[: len(x)])
        simulator.step(near[len(x) :], _STEP)
        return np.array(simulator.x)

    # A row of a bristle that has long gone is rounding alone.
    size = np.abs(found * scales / rows).max(axis=1) + 1e-12
    for k in rng.permutation(len(point))[:4]:
        shifts = [step * scales * (np.arange(len(point)) == k) for step in (1e-5, 3e-6)]
        coarse, fine = ((end(point + h) - end(point - h)) / (2.0 * h[k]) * scales[k] / rows[:, 0] for h in shifts)
        if np.all(np.abs(coarse - fine) < 5e-5 * size):
            error = np.abs(found[:, k] * scales[k] / rows[:, 0] - fine) / size
            assert error.max() < 5e-4, f"{error.max():.3g} by {k}"


def order_of_a_fit_does_not_matter(model: RandomModel) -> None:
    """Recordings and parameters listed the other way round give the same estimates, misfit and noise."""
    scenario = model.scenario
    made, rng = fp.simulate(scenario), model.rng(7)
    data = {"t": made.time.values}
    commands, angles = scenario.finger.actuated_names, list(scenario.finger.joints)
    data |= {f"pull {name}": made.tendon_command.sel(tendon=name).values for name in commands}
    noise = 1e-6 * rng.normal(size=(len(angles), len(made.time)))
    data |= {f"angle {name}": made.joint_position.sel(joint=name).values + noise[k] for k, name in enumerate(angles)}
    columns = {
        "time": "t",
        "inputs": {f"tendon_command.{name}": f"pull {name}" for name in commands},
        "outputs": {f"joint_position.{name}": f"angle {name}" for name in angles},
    }
    recordings = {"whole": data, "half": {name: values[: len(values) // 2] for name, values in data.items()}}
    bounds = {"finger.tendon_friction.coulomb": (0.01, 1.0), "finger.joint_friction.viscous": (1e-6, 1.0)}

    def found(step: int) -> xr.Dataset:
        names = list(recordings)[::step]
        quick = {"starts": 1, "profiles": False, "refits": False}
        return fp.identify(
            scenario,
            parameters=dict(list(bounds.items())[::step]),
            recordings=dict.fromkeys(names, columns),
            data={name: recordings[name] for name in names},
            **quick,
        )

    one, other = found(1), found(-1)
    for name in ("estimate", "noise"):
        expected = one[name].sel({each: other[each] for each in one[name].dims})
        assert np.array_equal(other[name], expected), name
