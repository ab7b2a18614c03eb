"""Write the table of all keys of scenario files, from the models that check them, or check that it is current."""

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
from finger_pin.description.finger import FingerDescription
from finger_pin.description.objects import EnvironmentSettings
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description

PAGE = Path(__file__).resolve().parents[1] / "finger_pin" / "description" / "KEYS.md"
HEAD = """# All keys of a scenario file

Names in angle brackets are yours. A key without a default must be given; `-` is left out. A finger alone (`fingers/`)
has the keys of `finger` without that prefix, a hand those of `hand`; a bench has `identify` besides. What a scenario
says by joint or tendon stands, for a hand, in a table of its finger, such as `reference.joints.index.medial`.
Written by `python scripts/generate_keys.py`.
"""


def generate_keys(
    check: Annotated[bool, typer.Option("--check", help="Write nothing; fail if the page is not current.")] = False,
) -> int:
    """Write finger_pin/description/KEYS.md, or check that it is current."""
    text = page()
    if PAGE.exists() and PAGE.read_text(encoding="utf-8") == text:
        return 0
    if check:
        print(f"{PAGE.name} is not current; run python scripts/generate_keys.py", file=sys.stderr)
        return 1
    PAGE.write_text(text, encoding="utf-8", newline="\n")
    print(f"wrote {PAGE}")
    return 0


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
    return f"{value:g}" if isinstance(value, float) else f"`{value}`" if value else '`""`'


main = partial(run_function, generate_keys)

if __name__ == "__main__":
    sys.exit(main())
