"""The layout of the package, read from its own imports."""

import ast
import re
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from finger_pin.version import installing

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


@pytest.mark.slow
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


# Names who changes the process: other libraries do, too, and are not ours to judge.
IMPORTING = """
import atexit, gc, importlib, os, pkgutil, sys

def watched(change):
    def recorded(*arguments, **options):
        frame = sys._getframe(1)
        while frame.f_globals["__name__"] in ("os", "_collections_abc"):
            frame = frame.f_back
        if frame.f_globals["__name__"].startswith("finger_pin"):
            print(frame.f_globals["__name__"], change.__name__, arguments)
        return change(*arguments, **options)
    return recorded

for place, names in (
    (gc, ("set_threshold", "freeze", "unfreeze", "enable", "disable", "set_debug")),
    (atexit, ("register", "unregister")),
    (type(os.environ), ("__setitem__", "__delitem__")),
    (os, ("putenv", "unsetenv")),
):
    for name in names:
        setattr(place, name, watched(getattr(place, name)))
before, count = gc.get_threshold(), 0
import finger_pin
for module in pkgutil.walk_packages(finger_pin.__path__, "finger_pin.", onerror=lambda name: None):
    if module.name.endswith("__main__"):
        continue
    try:
        importlib.import_module(module.name)
    except (ImportError, finger_pin.InputError):
        continue  # an extra is not installed
    count += 1
assert gc.get_threshold() == before and gc.get_freeze_count() == 0 and count > 300, (gc.get_threshold(), count)
"""


@pytest.mark.slow
def test_no_import_changes_the_process():
    done = subprocess.run([sys.executable, "-c", IMPORTING], capture_output=True, text=True, timeout=200)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_upper_rooms_import_public_modules_alone_and_these_stand_on_the_page():
    page = (PACKAGE / "README.md").read_text(encoding="utf-8")
    section = page.partition("## What others may build on\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| .* \| (`.*`) \|$", section, re.MULTILINE)
    public = {f"finger_pin.{name}" for row in rows for name in re.findall(r"`([\w.]+)`", row)}
    assert public <= set(MODULES) | {name.removesuffix(".__init__") for name in MODULES}
    linter = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (contract,) = (each for each in linter["contracts"] if each["name"] == "Upper rooms build on public modules")
    imports = [each.split(" -> ") for each in contract["ignore_imports"]]
    assert {importer for importer, _ in imports} == {"finger_pin.**"}
    ignored = {module for _, module in imports}
    assert {name for name in ignored if not name.startswith("finger_pin.analysis.")} <= public
    # What the package itself exports of its lower rooms is public.
    upper = {name.split(".")[1] for name in contract["source_modules"]}
    stub = (PACKAGE / "__init__.pyi").read_text(encoding="utf-8")
    exported = {name for name in re.findall(r"^from \.(\w+\.[\w.]+) import", stub, re.MULTILINE)}
    lower = {f"finger_pin.{name}" for name in exported if name.split(".")[0] not in upper}
    assert {name for name in lower if not name.startswith("finger_pin.analysis.")} <= public


def length_of(function):
    """Return the number of lines of a function without its docstring."""
    first, lines = function.body[0], function.end_lineno - function.lineno + 1
    return lines - (first.end_lineno - first.lineno + 1 if ast.get_docstring(function) else 0)


def test_files_have_at_most_300_lines_and_functions_of_the_package_60_beside_their_docstrings():
    long_files, long_functions = [], []
    for path in (each for room in ("finger_pin", "scripts", "tests") for each in (PACKAGE.parent / room).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        long_files += [path] if len(text.splitlines()) > 300 else []
        if PACKAGE not in path.parents:
            continue
        functions = (each for each in ast.walk(ast.parse(text)) if isinstance(each, ast.FunctionDef))
        long_functions += [(path.name, each.name) for each in functions if length_of(each) > 60]
    # One sum over rows, which compiled code makes in one function.
    assert (long_files, long_functions) == ([], [("condensation.py", "_gains")])


def names_of(path):
    """Return the names that a file defines, those of classes with their class."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        scope = getattr(node, "name", "")
        found |= {scope} if scope else set(assigned(node))
        if isinstance(node, ast.ClassDef):
            inner = [name for each in node.body for name in (getattr(each, "name", None), *assigned(each)) if name]
            found |= {f"{scope}.{name}" for name in inner}
    return found


def assigned(node):
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [each.id for each in targets if isinstance(each, ast.Name)]


def test_every_equation_of_the_paper_has_its_place_in_the_code():
    page = (PACKAGE / "EQUATIONS.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \((\w+)\) \| `(\S+)` \| (.*) \|$", page, re.MULTILINE)
    numbers = {number for number, *_ in rows}
    # Of those that have parts, the page has the parts.
    parts = {"9": "abc", "14": "abc", "21": "ab"}
    expected = {f"{n}{part}" for n in range(1, 23) for part in parts.get(str(n), [""])}
    assert numbers == expected == set(re.findall(r"\\text\{\((\w+)\*?\)\}", page))
    for number, file, names in rows:
        path = PACKAGE / file
        whole = number.rstrip("abc")
        assert re.search(rf"\({whole}[abc]?\)", path.read_text(encoding="utf-8")), f"{file} does not cite ({whole})"
        assert set(re.findall(r"`([\w.]+)`", names)) <= names_of(path), (number, file, names)


# Columns of arrays and names of outcomes: no thresholds.
INDICES = {
    f"continuous.{name}" for name in ("NOTHING_MISSED", "MISSED_BY_CULLING", "_SHARE", "_GAP", "_NORMAL", "_FAR")
}


def test_every_threshold_of_events_and_collision_has_a_name_and_stands_in_the_notes_with_its_value():
    notes = (PACKAGE / "core" / "stepping" / "NOTES.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+\.\w+)` \| (\S+) \| (.+?) \| (?:derived|chosen).* \|$", notes, re.MULTILINE)
    constants = {}
    for path in (each for room in ("events", "collision") for each in (PACKAGE / "core" / room).glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in (each for each in tree.body if isinstance(each, ast.Assign)):
            (target,), value = node.targets, node.value
            pairs = zip(target.elts, value.elts, strict=True) if isinstance(target, ast.Tuple) else [(target, value)]
            constants |= {f"{path.stem}.{n.id}": v.value for n, v in pairs if isinstance(v, ast.Constant)}
        for function in (each for each in tree.body if isinstance(each, ast.FunctionDef | ast.ClassDef)):
            numbers = [each.value for each in ast.walk(function) if isinstance(each, ast.Constant)]
            # Coefficients of formulas are quarters.
            assert all(4.0 * each == int(4.0 * each) for each in numbers if isinstance(each, float)), path
    assert {name: float(value) for name, value, _ in rows} == {
        name: value for name, value in constants.items() if name not in INDICES
    }


def test_extras_are_installed_as_one_place_says():
    root = PACKAGE.parent
    extras = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    page = (root / "scripts" / "README.md").read_text(encoding="utf-8")
    section = page.partition("## Extras\n")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == set(extras)
    assert f"`{installing('mujoco').partition(',')[0]}`" in section
    for path in (each for room in ("finger_pin", "scripts", ".site", ".github") for each in (root / room).rglob("*")):
        if path.suffix not in (".py", ".md", ".ipynb", ".yml"):
            continue
        text = path.read_text(encoding="utf-8")
        # Nothing is on a registry before a release; of one, only `installing` and the section say it.
        assert not re.search(r"pip install \S*finger[-_]pin", text), path
        named = re.findall(r"\[?[Ee]xtra\]?(?:\([^)]*\))?[ \n]`(\w+)`|installing\('(\w+)'\)|'\.\[([\w,]+)\]'", text)
        for extra in ",".join("".join(each) for each in named).split(","):
            assert not extra or extra in extras, (path, extra)
