"""What our friction costs in a step of MuJoCo, of a hand with fixed tendons and of one with spatial tendons.

The first is the Shadow hand of gymnasium-robotics, whose servos drive its joints. The second is made here, of the size
of Tetheria's Aero hand in MuJoCo Playground: 20 spatial tendons with 42 wraps, 6 of them driven, the others springs and
strings of limited length.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.store import Store

_LAW = {"coulomb": 0.12}
#: What is added to each hand, by name; nothing first.
_VARIANTS: dict[str, dict[str, dict[str, Any] | None]] = {
    "Shadow hand": {
        "plain": None,
        "tendons": {"tendons": {"*": _LAW}},
        "tendons and joints": {"tendons": {"*": _LAW}, "joints": {"*": {}}},
    },
    "20 spatial tendons": {
        "plain": None,
        "driven tendons": {"tendons": {"flexor_*": _LAW, "extensor_4": _LAW}},
        "tendons": {"tendons": {"*": _LAW}},
    },
}
_FINGERS, _JOINTS, _LINK = 5, 4, 0.025
#: Joints that a tendon crosses, on which side, and what else it has: of all, of four fingers, and of the thumb.
_BOTH = {
    "flexor": (range(4), "below", ""),
    "spring": (range(1), "above", 'stiffness="50"'),
    "distal": (range(3, 4), "above", 'stiffness="50"'),
}
_FINGER = _BOTH | {"string": (range(2, 4), "below", 'range="0 0.06"')}
_THUMB = _BOTH | {"extensor": (range(4), "above", "")}


def measure(store: Store) -> dict[str, Any] | None:
    """Return processor times of a step, s, by hand; None where MuJoCo or the Shadow hand is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("mujoco", "gymnasium_robotics")):
        return None
    rounds, steps = (2, 200) if store.quick else (30, 2000)
    return store.part("mujoco-friction", lambda: study(rounds, steps))


def study(rounds: int, steps: int) -> dict[str, Any]:
    """Return the least time of a step of each variant, which take turns, and how many frictions and rows it has."""
    import mujoco

    return {"version": mujoco.__version__, "hands": {name: _hand(name, rounds, steps) for name in _VARIANTS}}


def _hand(hand: str, rounds: int, steps: int) -> dict[str, Any]:
    import mujoco

    models, counts = {}, {}
    for name, friction in _VARIANTS[hand].items():
        made = _shadow() if hand == "Shadow hand" else mujoco.MjSpec.from_string(_spatial())
        if friction is not None:
            fp.mujoco.add_friction(made, **friction)
        models[name] = model = made.compile()
        rows = int(np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.tendon_frictionloss))
        frictions = 0 if friction is None else len(fp.mujoco.friction(model, mujoco.MjData(model)).names)
        counts[name] = {"frictions": frictions, "rows": rows}
    least = dict.fromkeys(models, np.inf)
    for _ in range(rounds):
        for name, model in models.items():
            data = mujoco.MjData(model)
            low, high = model.actuator_ctrlrange.T
            data.ctrl[:] = low + 0.4 * (high - low)
            mujoco.mj_step(model, data, 200)
            began = time.process_time()
            mujoco.mj_step(model, data, steps)
            least[name] = min(least[name], (time.process_time() - began) / steps)
    return {"time": {name: float(each) for name, each in least.items()}, "counts": counts}


def _shadow() -> Any:
    import mujoco

    spec = importlib.util.find_spec("gymnasium_robotics")
    assert spec is not None and spec.submodule_search_locations is not None
    path = Path(spec.submodule_search_locations[0], "envs", "assets", "hand", "reach.xml")
    return mujoco.MjSpec.from_file(str(path))


def _spatial() -> str:
    """Return the hand with spatial tendons, as MJCF."""
    fingers, tendons, motors = "", "", ""
    for finger in range(_FINGERS):
        fingers += f'<body pos="0 {0.025 * finger} 0.2">{_sites(finger, -1)}{_link(finger, 0)}</body>'
        for name, (crossed, side, more) in (_THUMB if finger == _FINGERS - 1 else _FINGER).items():
            path = f'<site site="{side}_{finger}_{crossed[0] - 1}"/>'
            for joint in crossed:
                path += f'<geom geom="pulley_{finger}_{joint}" sidesite="{side}_{finger}_{joint}"/>'
                path += f'<site site="{side}_{finger}_{joint}"/>'
            tendons += f'<spatial name="{name}_{finger}" {more}>{path}</spatial>'
            if not more:
                motors += f'<motor tendon="{name}_{finger}" gear="-1" ctrlrange="0 5"/>'
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{fingers}</worldbody><tendon>{tendons}</tendon>'
        f"<actuator>{motors}</actuator></mujoco>"
    )


def _link(finger: int, joint: int) -> str:
    """Return a link of a finger and those beyond it."""
    if joint == _JOINTS:
        return ""
    return (
        f'<body pos="{_LINK} 0 0"><joint axis="0 1 0" range="-0.1 1.4" stiffness="0.02" damping="0.001" '
        f'armature="1e-5"/><geom type="capsule" size="0.005" fromto="0 0 0 {_LINK} 0 0" mass="0.01"/>'
        f'<geom name="pulley_{finger}_{joint}" type="cylinder" size="0.006 0.008" euler="1.5708 0 0" mass="0.001" '
        f'contype="0" conaffinity="0"/>{_sites(finger, joint)}{_link(finger, joint + 1)}</body>'
    )


def _sites(finger: int, joint: int) -> str:
    """Return where tendons run through the link beyond a joint; beyond joint -1 is the palm."""
    return "".join(
        f'<site name="{side}_{finger}_{joint}" pos="{0.5 * _LINK} 0 {height}"/>'
        for side, height in (("below", -0.004), ("above", 0.004))
    )


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report."""
    for hand, study in found["hands"].items():
        yield f"our friction in a step of MuJoCo {found['version']}, {hand}: processor time"
        plain = study["time"]["plain"]
        for name, each in study["time"].items():
            count = study["counts"][name]
            more = (
                f"{100.0 * (each / plain - 1.0):+.0f} %, {count['frictions']} frictions" if count["frictions"] else ""
            )
            yield f"  {name:20} {1e6 * each:6.1f} us  {count['rows']:3d} rows  {more}".rstrip()
