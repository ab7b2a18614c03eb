"""Whatever is combined, a run is computed, summed up, drawn, shown on a page, saved, loaded, and continued."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import finger_pin as fp
from finger_pin.control.reference import ReferenceSignals
from finger_pin.simulation.results import ResultFolder
from finger_pin.views.plots.saving import figures_of
from finger_pin.views.summary import summarize
from finger_pin.views.viewer.animation import write_animation

SERVO = {"motor": "XL330-M288", "spool_radius": 0.005}
FAR, NEAR, BESIDE = ({"shape": "sphere", "radius": 0.008, "position": [0.3, 0.3, z]} for z in (-0.4, -0.3, 0.0))
SWING = {"amplitude": 0.003, "frequency": 5.0}
COMPENSATED = {"sampling": {"period": 2e-3}, "tendon_friction_feedforward": {}, "passive_tension_loop": {}}
#: Entries of a scenario by what they add; those of a finger stand under `finger`, wherever it is.
FEATURES: dict[str, dict[str, Any]] = {
    "finger": {},
    "hand": {"hand": {"name": "two", "fingers": {"thumb": {"position": [0.0, -0.1, 0.0]}, "index": {}}}},
    "servo": {"finger": {"actuators": {"M3": {**SERVO, "tendons": ["T3"], "drive": "tension"}}}},
    "position drive": {"finger": {"actuators": {"M1": {**SERVO, "tendons": ["T1"], "drive": "position"}}}},
    "contact": {"environment": {"objects": {"marble": {**FAR, "mass": 0.005}, "ball": NEAR}}},
    "moved object": {"environment": {"objects": {"rod": {**BESIDE, "path": {"z": SWING}}}}},
    "moving palm": {"hand": {"palm": {"path": {"z": SWING}}}},
    "springs": {"finger": {"joints": {"medial": {"spring": {"stiffness": 0.01, "damping": 1e-4}}}}},
    "open loop": {"controller": {"kind": "tensions", "minimum_tension": 2.0}},
    "sampled": {"controller": {"sampling": {"period": 2e-3}}},
    "compensated": {"controller": COMPENSATED},
    "force": {"environment": {"fingertip_force": [0.0, 0.0, -0.1]}},
    "own": {},
}
APART = [
    {"finger", "hand"},
    {"finger", "moving palm"},
    {"moved object", "moving palm"},
    *({one, other} for one, other in combinations(("own", "open loop", "compensated"), 2)),
]


def whole(features: set[str]) -> set[str]:
    return features | {"hand"} if "moving palm" in features else features


def fits(features: set[str]) -> bool:
    return not any(apart <= features for apart in APART)


def rows() -> list[set[str]]:
    """Few sets of features in which all pairs that fit each other occur."""
    pairs = [whole(set(pair)) for pair in combinations(FEATURES, 2) if fits(whole(set(pair)))]
    found: list[set[str]] = []
    while missing := [pair for pair in pairs if not any(pair <= row for row in found)]:
        row: set[str] = set()
        for pair in (*missing, *pairs):
            row = row | pair if fits(row | pair) else row
        found.append(row)
    return found


def scenario_with(features: set[str], folder: Path) -> fp.Scenario:
    table: dict[str, Any] = {"name": "combined", "controller": {}, "simulation": {"duration": 0.01}}

    def add(entries: dict[str, Any], to: dict[str, Any]) -> None:
        for key, value in entries.items():
            if isinstance(value, dict):
                add(value, to.setdefault(key, {}))
            else:
                to[key] = value

    for name in sorted(features):
        add(FEATURES[name], table)
    finger = {"base": "ub", **table.pop("finger", {})}
    if "hand" in table:
        for placed in table["hand"]["fingers"].values():
            placed["finger"] = finger
    else:
        table["finger"] = finger
    path = folder / "combined.toml"
    path.write_text(tomli_w.dumps(table))
    return fp.load_scenario(path)


class Held:
    """A controller and a reference of one's own."""

    def __init__(self, finger: fp.FingerDescription) -> None:
        """Hold all joints at an angle, under equal tensions."""
        self.joints = len(finger.joints)
        self.pulled = sum(tendon.kind == "actuated" for tendon in finger.tendons.values())

    def at(self, time: float) -> ReferenceSignals:
        return ReferenceSignals(np.full(self.joints, 0.3), np.zeros(self.joints))

    def command(self, time: float, reference: object, position: object, velocity: object) -> np.ndarray:
        return np.full(self.pulled, 2.0)


@pytest.mark.parametrize("features", rows(), ids=lambda row: "+".join(sorted(row)).replace(" ", "-"))
def test_every_pair_of_features_runs_to_the_end_of_what_is_done_with_a_result(
    features: set[str], tmp_path: Path
) -> None:
    scenario, own = scenario_with(features, tmp_path), {}
    if "own" in features:
        held = Held(scenario.finger)
        own = {"controller": held, "reference": held, "control_period": 2e-3}
    result = fp.simulate(scenario, **own)
    assert ("motor" in result.dims) == bool(features & {"servo", "position drive"})
    assert "Energy" in summarize(result)
    with ResultFolder(tmp_path / "run") as folder:
        folder.write(result)
        write_animation(result, folder.stage / "animation.html")
        folder.publish()
    assert fp.load_result(tmp_path / "run").identical(result)
    assert fp.load_scenario(tmp_path / "run" / "scenario.toml") == scenario
    for draw in figures_of(result).values():
        assert draw(result).axes
    again = fp.simulate(scenario, initial=result, **own)
    np.testing.assert_array_equal(again.joint_position[0], result.joint_position[-1])
