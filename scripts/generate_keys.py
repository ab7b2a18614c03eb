"""Write the tables of all keys of scenario files and of all variables of results, or check that they are current."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import typer
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from finger_pin.commands.application import run_function
from finger_pin.description.controller import ControllerSettings
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import load_scenario
from finger_pin.description.objects import EnvironmentSettings
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import list_scenarios
from finger_pin.description.validation import Description
from finger_pin.mechanism.signal_table import SECTIONS
from finger_pin.mechanism.signals import Quantity
from finger_pin.simulation.setup import Setup
from finger_pin.simulation.variables import RUN_SECTIONS, variables

PACKAGE = Path(__file__).resolve().parents[1] / "finger_pin"
PAGE, VARIABLES = PACKAGE / "description" / "KEYS.md", PACKAGE / "simulation" / "VARIABLES.md"
HEAD = """# All keys of a scenario file

Names in angle brackets are yours. A key without a default must be given; `-` is left out. A finger alone (`fingers/`)
has the keys of `finger` without that prefix, a hand those of `hand`; a bench has `identify` besides. What a scenario
says by joint or tendon stands, for a hand, in a table of its finger, such as `reference.joints.index.medial`.
Written by `python scripts/generate_keys.py`.
"""


def generate_keys(
    check: Annotated[bool, typer.Option("--check", help="Write nothing; fail if the page is not current.")] = False,
) -> int:
    """Write finger_pin/description/KEYS.md and finger_pin/simulation/VARIABLES.md, or check that they are current."""
    stale = 0
    for path, text in ((PAGE, page()), (VARIABLES, variables_page())):
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        stale += 1
        if check:
            print(f"{path.name} is not current; run python scripts/generate_keys.py", file=sys.stderr)
        else:
            path.write_text(text, encoding="utf-8", newline="\n")
            print(f"wrote {path}")
    return 1 if check and stale else 0


def page() -> str:
    """Return the page: a table for each table of a scenario."""
    parts = [HEAD]
    # A bench is a scenario with one table more.
    bench = {"identify": FieldInfo(annotation=IdentifySettings)}
    for name, field in (Scenario.model_fields | bench).items():
        rows = list(_rows(name, field))
        parts.append(f"## {name}\n\n| key | unit | default | meaning |\n|---|---|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def _rows(key: str, field: FieldInfo, above: tuple[type[Description], ...] = ()) -> Iterator[str]:
    """Yield the rows of an entry, and of all below it that no entry above has already."""
    found = list(_models(field.annotation, ""))
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    says = " ".join((field.description or "").replace("|", "\\|").split())
    if not found or extra:
        source = f" ({extra['source']})" if extra.get("source") else ""
        unit = str(extra.get("unit", "")).replace("|", "\\|")
        by_name = ".<name>" if not found and _is_table(field.annotation) else ""
        yield f"| `{key}{by_name}` | {'' if unit == '1' else unit} | {_default(field)} | {says}{source} |"
    elif says:
        yield f"| `{key}` |  | {_default(field)} | {says} |"
    for model, path in found:
        if model in above or (model in _WHOLE and key not in _WHOLE.values()):
            same = f"those of `{_WHOLE[model]}`" if model in _WHOLE else "those of the table above it"
            yield f"| `{key}{path}.<key>` |  | - | as {same} |"
            continue
        for extra_key in model.file_keys:
            yield f"| `{key}{path}.{extra_key}` |  | - | {_FILE_KEYS[extra_key]} |"
        for name, each in model.model_fields.items():
            yield from _rows(f"{key}{path}.{each.alias or name}", each, (*above, model))


#: What is listed once, whatever else takes it.
_WHOLE = {FingerDescription: "finger", ControllerSettings: "controller", EnvironmentSettings: "environment"}
#: What loading resolves, and no model has.
_FILE_KEYS = {
    "base": "what this one differs from: the name of one that ships, or the path of a file",
    "extends": "the scenario that this one differs from",
    "file": "a CSV file beside this one whose columns become samples, or a table with `path`, `time` and `columns`",
    "fingertip_force_file": "a CSV file beside this one: columns `time` and some of `x`, `y`, `z`; or a table likewise",
}


def _models(annotation: Any, path: str) -> Iterator[tuple[type[Description], str]]:
    """Yield the models in a type, each with the keys between an entry and its own."""
    if inspect.isclass(annotation) and issubclass(annotation, Description):
        yield annotation, path
        return
    inside = get_args(annotation)
    if get_origin(annotation) is dict:
        yield from _models(inside[1], f"{path}.<name>")
        return
    if get_origin(annotation) is Annotated:
        inside = inside[:1]
    if get_origin(annotation) in (list, tuple):
        path = f"{path}[]"
    known = set()
    for each in inside:
        for model, deeper in _models(each, path):
            if (model, deeper) not in known:
                known.add((model, deeper))
                yield model, deeper


def _is_table(annotation: Any) -> bool:
    return get_origin(annotation) is dict or any(map(_is_table, get_args(annotation)))


def _default(field: FieldInfo) -> str:
    value = field.default
    if value is PydanticUndefined:
        return ""
    if value is None or isinstance(value, Description) or value in ({}, ()):
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(f"{each:g}" if isinstance(each, float) else str(each) for each in value) + "]"
    return f"{value:g}" if isinstance(value, int | float) else f"`{value}`" if value else '`""`'


VARIABLES_HEAD = """# All variables of a result

Every variable has `time` for its first dimension; the table names the others. Numbers in brackets are the paper's
[equations](../EQUATIONS.md). Units are those of `result[name].attrs["units"]`. `torque_shortfall` is left out of a
whole result where nothing limits tensions. What stands last belongs to tables of rows that paths through space,
`place = "bends"` or your own [`fp.Rows`](../README.md#to-add-a-law) make: each has its table's name for `<table>`, an
input from the controller is `<table>_input`, and "SI" is the unit of what the variable is.
Written by `python scripts/generate_keys.py`.
"""
_SENSORS = "With a sampled controller: what its sensors measure, after `measured_`"
_ACCOUNT, _ROWS = "The energy account, of the parts that there are", "Of tables of rows"
#: What shows each of them, besides the scenarios that ship.
_FURTHER: tuple[tuple[str, dict[str, Any]], ...] = (
    ("fig6", {"finger.joint_friction": {"law": "coulomb"}}),
    ("fig6", {"finger.passive_tendon.hysteresis": 0.1}),
    ("fig6", {"controller.sampling.period": 1e-3}),
    ("canal", {"finger.tendons.T1.winch": {}, "controller": {"tendon_winding": {"T1": {"offset": 0.001}}}}),
    ("servo_bench", {"finger.actuators.*.motor.friction.backlash": 0.01}),
    ("servo_bench", {"finger.actuators.*.motor.cogging": {"amplitude": 1e-3, "per_turn": 24.0}}),
    ("press", {"environment.objects.*.path.x.amplitude": 1e-3}),
    ("pour", {"environment.objects.ball_0.damping": 1e-3}),
)


def variables_page() -> str:
    """Return the page: a table for each section."""
    loops = [
        Setup.from_scenario(load_scenario(*each)).loop for each in (*((name,) for name in list_scenarios()), *_FURTHER)
    ]
    found: dict[str, dict[tuple[int, str], Quantity]] = {}
    for k, loop in enumerate(loops):
        tables = [table.group for table in loop.finger.extra_rows]
        for name, each in variables(loop).items():
            group = next((group for group in tables if each.dims == (group,)), "")
            found.setdefault(name.replace(group, "<table>", 1) if group else name, {})[k, group] = each
    listed = (*SECTIONS, *RUN_SECTIONS)
    parts: dict[str, list[str]] = {title: [] for title in (*(each.title for each in listed), _SENSORS, _ACCOUNT, _ROWS)}
    for section in listed:
        for name, each in section.signals.items():
            parts[section.title].append(_variable_row(name, found.pop(name, {(0, ""): each})))
    for name, shown in found.items():
        title = _ROWS if name.startswith("<table>") else _SENSORS if name.startswith("measured_") else _ACCOUNT
        if not name.startswith("energy_exchanged_"):
            parts[title].append(_variable_row(name, shown))
    head = "| name | unit | dimensions | meaning |\n|---|---|---|---|\n"
    tables = [f"## {title}\n\n{head}" + "\n".join(each) + "\n" for title, each in parts.items()]
    return "\n".join([VARIABLES_HEAD, *tables])


def _variable_row(name: str, shown: dict[tuple[int, str], Quantity]) -> str:
    first = next(iter(shown.values()))
    kinds = dict.fromkeys(", ".join(each.dims) for each in shown.values())
    dims = " or ".join(each or "none" for each in kinds) if len(kinds) > 1 else next(iter(kinds))
    units = " or ".join(dict.fromkeys(each.units for each in shown.values()))
    label, unit = f"`{name}`", "" if units == "1" else units
    if name.startswith("power_"):
        label, unit = f"{label}, `{name.replace('power', 'energy_exchanged', 1)}`", "W, J"
    if name.startswith("<table>"):
        dims, says = "`<table>`", "; ".join(dict.fromkeys(each.long_name for each in shown.values()))
    else:
        says = first.long_name + (f" ({first.equation})" if first.equation else "")
    return f"| {label} | {unit} | {dims} | {says} |"


main = partial(run_function, generate_keys)

if __name__ == "__main__":
    sys.exit(main())
