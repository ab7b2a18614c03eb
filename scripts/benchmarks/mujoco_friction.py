"""The cost of our friction in a step of MuJoCo, on a hand with fixed tendons and on one with spatial tendons.

The first is the Shadow hand of gymnasium-robotics, whose servos drive its joints, and so the tendons that run over one
of these. The second is Tetheria's Aero hand of MuJoCo Playground, where that is installed (``pip install --no-deps
playground``): 7 servos, 6 of them on tendons. Its meshes, which are only looked at, are points here. Beside each stands
what MuJoCo's own constant friction costs in the same rows of the solver. Controls jump ten times a second.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.store import Store

LAW = {"coulomb": 0.12}
PLAIN, _CONSTANT = "plain", "constant losses"


def measure(store: Store) -> dict[str, Any] | None:
    """Return processor times of a step, s, by hand; None where MuJoCo or the Shadow hand is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("mujoco", "gymnasium_robotics")):
        return None
    rounds, time = (1, 0.4) if store.quick else (30, 4.0)
    return store.part("mujoco-friction", lambda: study(rounds, time))


def study(rounds: int, duration: float) -> dict[str, Any]:
    """Return the least time of a step of each variant, which take turns, and its counts of frictions and rows."""
    import mujoco

    hands = {"Shadow hand": shadow}
    if importlib.util.find_spec("mujoco_playground") is not None:
        hands["Aero hand"] = _aero
    return {
        "version": mujoco.__version__,
        "hands": {name: _hand(made, rounds, duration) for name, made in hands.items()},
    }


def _hand(made: Callable[[], Any], rounds: int, duration: float) -> dict[str, Any]:
    import mujoco

    plain = made().compile()
    named = {"tendons": {name: LAW for name in driven(plain)}}
    every: dict[str, Any] = {"tendons": {"*": LAW}}
    variants = {"driven tendons": named, "all tendons": every, "and all joints": every | {"joints": {"*": {}}}}
    models, counts = {PLAIN: plain}, {PLAIN: {"frictions": 0, "rows": _rows(plain)}}
    for name, friction in variants.items():
        spec = made()
        fp.mujoco.add_friction(spec, **friction)
        model = spec.compile()
        models |= {name: model, f"  {_CONSTANT}, {name}": _constant(made().compile(), model)}
        frictions = len(fp.mujoco.friction(model, mujoco.MjData(model)).names)
        counts |= {name: {"frictions": frictions, "rows": _rows(model)}}
    least = dict.fromkeys(models, np.inf)
    for _ in range(rounds):
        for name, model in models.items():
            least[name] = min(least[name], _step(model, duration))
    return {"time": {name: float(each) for name, each in least.items()}, "counts": counts}


def _constant(found: Any, model: Any) -> Any:
    """Give a model constant losses of the size that ours have come to in a model with friction, and return it."""
    import mujoco

    kinds, data = mujoco.mjtConstraint, mujoco.MjData(model)
    data.ctrl[:] = model.actuator_ctrlrange.mean(axis=1)
    mujoco.mj_step(model, data, 100)
    for kind, losses in (
        (kinds.mjCNSTR_FRICTION_DOF, found.dof_frictionloss),
        (kinds.mjCNSTR_FRICTION_TENDON, found.tendon_frictionloss),
    ):
        rows = data.efc_type[: data.nefc] == kind
        losses[data.efc_id[: data.nefc][rows]] = data.efc_frictionloss[: data.nefc][rows]
    return found


def _step(model: Any, duration: float) -> float:
    """Return the processor time of a step, s, while controls jump ten times a second."""
    import mujoco

    data, random, (low, high) = mujoco.MjData(model), np.random.default_rng(1), model.actuator_ctrlrange.T
    every, jumps = round(0.1 / model.opt.timestep), round(duration / 0.1)
    controls = low + random.uniform(0.2, 0.6, (jumps, len(low))) * (high - low)
    began = time.process_time()
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data, every)
    return (time.process_time() - began) / (jumps * every)


def driven(model: Any) -> list[str]:
    """Return the tendons that actuators pull, or drive the only joint of."""
    import mujoco

    on_tendon = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    pulled = set(model.actuator_trnid[on_tendon, 0].tolist())
    joints = set(model.actuator_trnid[~on_tendon, 0].tolist())
    for i in range(model.ntendon):
        first = model.tendon_adr[i]
        if model.wrap_type[first] == mujoco.mjtWrap.mjWRAP_JOINT and model.tendon_num[i] == 1:
            pulled |= {i} if int(model.wrap_objid[first]) in joints else set()
    return [model.tendon(i).name for i in sorted(pulled)]


def _rows(model: Any) -> int:
    return int(np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.tendon_frictionloss))


def _path(package: str, *parts: str) -> str:
    spec = importlib.util.find_spec(package)
    assert spec is not None and spec.submodule_search_locations is not None
    return str(Path(spec.submodule_search_locations[0], *parts))


def shadow() -> Any:
    """Return the spec of the Shadow hand."""
    import mujoco

    return mujoco.MjSpec.from_file(_path("gymnasium_robotics", "envs", "assets", "hand", "reach.xml"))


def _aero() -> Any:
    import mujoco

    folder = ("_src", "manipulation", "aero_hand", "xmls", "right_hand.xml")
    spec = mujoco.MjSpec.from_file(_path("mujoco_playground", *folder))
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            geom.type, geom.meshname, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, "", [1e-3, 0.0, 0.0]
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report."""
    for hand, study in found["hands"].items():
        yield f"our friction in a step of MuJoCo {found['version']}, {hand}: processor time"
        plain = study["time"][PLAIN]
        for name, each in study["time"].items():
            count = study["counts"].get(name)
            more = f"{100.0 * (each / plain - 1.0):+.0f} %" if name != PLAIN else ""
            if count is not None:
                more = f"{count['rows']} rows  {more}" + (f", {count['frictions']} frictions" if more else "")
            yield f"  {name:44} {1e6 * each:6.1f} us  {more}".rstrip()
