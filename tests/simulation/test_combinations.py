"""Whatever is combined, a command runs it, sums it up, draws it, shows it on a page; a film and more runs follow."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import combinations
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
import tomli_w
from matplotlib.figure import Figure

import finger_pin as fp
from finger_pin.commands import application
from finger_pin.references.reference import ReferenceSignals
from finger_pin.simulation.result_folder import ResultFolder
from finger_pin.views.plots.figure_files import draw_all, figures_by_name
from finger_pin.views.summary import summarize
from finger_pin.views.viewer import write_animation, write_video

# Some starts lie beyond the joints' ranges.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::finger_pin.exceptions.StartWarning")]

SERVO = {"motor": "XL330-M288", "spool_radius": 0.005}
FAR, NEAR, BESIDE = ({"shape": "sphere", "radius": 0.008, "position": [0.3, 0.3, z]} for z in (-0.4, -0.3, 0.0))
SWING = {"amplitude": 0.003, "frequency": 5.0}
COMPENSATED = {"sampling": {"period": 2e-3}, "tendon_friction_feedforward": {}, "passive_tension_loop": {}}
#: A link between two tendons that run through space.
TREE = {
    "name": "link",
    "joints": {"medial": {"range": [-0.25, 0.25]}},
    "tendons": {"T1": {"along": "upper"}, "T3": {"along": "lower"}},
    "tree": {
        "bodies": {"link": {"mass": 0.02, "inertia": [1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0]}},
        "joints": {"medial": {"body": "link"}},
        "tendons": {
            name: {
                "path": {
                    "base": {"kind": "point", "position": [-0.02, 0.0, z]},
                    "end": {"kind": "point", "body": "link", "position": [0.03, 0.0, z]},
                }
            }
            for name, z in (("upper", 0.01), ("lower", -0.01))
        },
        "tip": {"body": "link", "position": [0.04, 0.0, 0.0]},
    },
}
#: Entries of a scenario by what they add; those of a finger stand under `finger`, wherever it is.
FEATURES: dict[str, dict[str, Any]] = {
    "finger": {"finger": {"base": "ub_stand_in"}},
    "tree": {"finger": TREE},
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
    *({"finger", other} for other in ("tree", "hand", "moving palm")),
    {"tree", "compensated"},
    {"moved object", "moving palm"},
    *({one, other} for one, other in combinations(("own", "open loop", "compensated"), 2)),
]


def whole(features: set[str]) -> set[str]:
    features = features | {"hand"} if "moving palm" in features else features
    return features | {"sampled"} if {"tree", "position drive"} <= features else features


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


def scenario_with(features: set[str], path: Path) -> fp.Scenario:
    table: dict[str, Any] = {"name": "combined", "controller": {}, "simulation": {"duration": 0.01}}

    def add(entries: dict[str, Any], to: dict[str, Any]) -> None:
        for key, value in entries.items():
            if isinstance(value, dict):
                add(value, to.setdefault(key, {}))
            else:
                to[key] = value

    for name in sorted(features):
        add(FEATURES[name], table)
    finger = table.pop("finger", {})
    if "hand" in table:
        finger |= {} if "tree" in finger else {"base": "ub_stand_in"}
        for placed in table["hand"]["fingers"].values():
            placed["finger"] = finger
    else:
        table["finger"] = finger
    path.write_text(tomli_w.dumps(table))
    return fp.load_scenario(path)


class Held:
    """A controller and a reference of one's own."""

    def __init__(self, finger: fp.FingerDescription) -> None:
        """Hold all joints at an angle, under equal tensions."""
        self.joints = len(finger.joints)
        self.pulled = sum(tendon.kind == "actuated" for tendon in finger.tendons.values())

    def at(self, time: float) -> ReferenceSignals:
        return ReferenceSignals(np.full(self.joints, 0.2), np.zeros(self.joints))

    def command(self, time: float, reference: object, position: object, velocity: object) -> np.ndarray:
        return np.full(self.pulled, 2.0)


def made(scenario: fp.Scenario, folder: Path, own: dict[str, Any]) -> None:
    """Do with parts of one's own, which no command line takes, what the command does."""
    result = fp.simulate(scenario, **own)
    print(summarize(result))
    with ResultFolder(folder) as results:
        results.write(result)
        write_animation(result, results.stage / "animation.html")
        draw_all(result, results.stage / "figures")
        results.publish()


def not_painted(figure: Figure, path: Path, format: str | None = None) -> Path:
    assert figure.axes
    target = path.with_suffix(f".{format or 'png'}")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.touch()
    return target


@pytest.mark.parametrize("features", rows(), ids=lambda row: "+".join(sorted(row)).replace(" ", "-"))
def test_every_pair_of_features_runs_to_the_end_of_what_is_done_with_a_result(
    features: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Quickly drawn; pictures have tests of their own.
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 20)
    monkeypatch.setattr("finger_pin.views.plots.figure_files.save_figure", not_painted)
    file, folder, own = tmp_path / "combined.toml", tmp_path / "run", {}
    scenario = scenario_with(features, file)
    if "own" in features:
        held = Held(scenario.finger)
        own = {"controller": held, "reference": held, "control_period": 2e-3}
        made(scenario, folder, own)
    else:
        assert application.run("simulate", [str(file), "--output", str(folder)]) == 0
    printed = capsys.readouterr()
    assert "Energy" in printed.out and not printed.err
    result = fp.load(folder)
    assert ("motor" in result.dims) == bool(features & {"servo", "position drive"})
    assert fp.load_scenario(folder / "scenario.toml") == scenario
    assert {path.stem for path in (folder / "figures").iterdir()} == set(figures_by_name(result))
    assert (folder / "animation.html").stat().st_size > 100_000
    assert write_video(result, tmp_path / "film.gif", speed=0.1).read_bytes().startswith(b"GIF8")
    assert application.run("export", [str(folder), str(tmp_path / "signals.csv")]) == 0
    anew = pytest.warns(fp.exceptions.ScenarioWarning, match="sampled controller starts anew")
    with anew if features & {"sampled", "compensated", "own"} else nullcontext():
        again = fp.simulate(scenario, initial=result, **own)
    np.testing.assert_array_equal(again.joint_position[0], result.joint_position[-1])
