"""The layout of the package, read from its own imports."""

import ast
import re
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "finger_pin"
MODULES = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}


def imported(path):
    """Return the modules of the package that a file imports anywhere, for types and within functions as well."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names += [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
        elif isinstance(node, ast.Import):
            names += [each.name for each in node.names]
    return {name for name in names if name in MODULES}


def test_no_file_imports_itself_through_others():
    # A cycle is an error of the sorter, which names it.
    order = tuple(TopologicalSorter({name: imported(path) for name, path in MODULES.items()}).static_order())
    assert set(order) == set(MODULES)


def test_the_version_is_the_newest_of_the_changes_and_the_one_to_cite():
    root = PACKAGE.parent
    version = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    changes = (PACKAGE / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", changes, re.MULTILINE)[0] == version
    assert f"version: {version}\n" in (root / ".github" / "CITATION.cff").read_text(encoding="utf-8")
