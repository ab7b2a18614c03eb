"""Every command and every snippet of all pages does what it is shown for, from top to bottom, and every link leads on.

So that this takes seconds, what is shown is made smaller, here and nowhere else: scenarios that ship last `DURATION`,
`SHORTER` says what of a command line is replaced, figures are made but not painted, pages of runs are left out (they
have tests of their own), browsers and windows are closed at once. What another page has shown is not repeated.
"""

import builtins
import importlib
import re
import shlex
import shutil
import symtable
import tomllib
import webbrowser
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from harness import quick_figures

import finger_pin as fp
import finger_pin.studies as studies
from finger_pin.commands import application
from finger_pin.description import loading, resolution, tables

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "finger_pin" / "QUESTIONS.md", *sorted(ROOT.glob("[fst]*/**/README.md"))]
LINKED = [*PAGES, *sorted(set(ROOT.glob("[fst]*/**/*.md")) - set(PAGES))]
DURATION = 0.02
SHORTER = {
    r"(--method Radau) --duration \S+": r"\1 --duration=0.001",
    r"--duration \S+": f"--duration {DURATION}",
    r":7\b": ":2",
    r":6:log": ":2:log",
    r"--samples \d+": "--samples 2",
    r"(cliffs\.py) \d+": r"\1 1",
    r"(flights\.py --count) \d+": r"\1 1",
    r"(flights\.py --falls) \d+": r"\1 1",
    r"(intervals\.py) \d+": r"\1 1",
    r"(validate\.py)( --only \S+)?$": r"\1 --only kinematics",
    r"force_capability\.py$": "force_capability.py ub --posture 0,30,30,20 --limit 15 --force 0,0,1 --view",
    r"conclusions\.py( reversals)?$": "conclusions.py reversals --only a",
    r"reaction\.py$": "reaction.py reversals --forces 1",
    # What it finds has a test of its own.
    r"(identify\.py) (?!transmission|fig6|bench).*": r"\1 --list any",
    # It fits benches under every law.
    r"(compare_laws\.py).*": r"\1 transmission",
    # It fits for minutes.
    r"(servo_models\.py).*": r"\1 --only M1 --generations 0",
    # What they print has tests of its own.
    r"(validate\.py) --(observer|random).*": r"\1 --help",
    # Its stages have tests of their own, and it measures for minutes.
    r"(benchmark\.py).*": r"\1 --help",
    # They train for minutes, with a library that tests do without.
    r"((train|transfer)\.py).*": r"\1 --help",
}
#: The duration of runs in Python that take seconds.
LONG = '"simulation.duration": 4.0'
#: A fenced block with its kind, or code within a line.
SHOWN = re.compile(r"^```(\w+)\n(.*?)^```$|(?<!`)`([^`\n]+)`(?!`)", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"(python (-m|scripts/)|finger-pin )")
#: Packages that tests do without: what needs them is tried where they are.
OPTIONAL = re.compile(r"^(?:import|from) (newton|mjlab)\b", re.MULTILINE)
EXPRESSION = re.compile(r"fp\.[\w.]+\(.*\)")


def not_painted(figure, path, format=None):
    assert figure.axes
    target = Path(path) if Path(path).suffix else Path(f"{path}.{format or 'png'}")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text("painted")
    return target


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A folder to work in, with short versions of what ships, and the commands that were run there."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "urdf").symlink_to(ROOT / "urdf")
    (folder / "log.csv").write_text("time,motor_position.servo,motor_current.servo\n0,0,0\n0.001,0,0\n0.002,0,0\n")
    shipped = folder / "shipped"
    for kind in ("fingers", "hands", "scenarios", "motors", "benches"):
        shutil.copytree(Path(tables.__file__).parent / kind, shipped / kind)
    for path in (shipped / "scenarios").iterdir():
        path.write_text(re.sub(r"(?m)^duration = .*", f"duration = {DURATION}", path.read_text("utf-8")), "utf-8")
    printed = shipped / "benches" / "fig6.toml"
    # Two of its many parameters are sought.
    printed.write_text(re.sub(r'(?m)^"finger\..*\n', "", printed.read_text("utf-8")), "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for module in (tables, resolution):
            patch.setattr(module, "resources", SimpleNamespace(files=lambda package: shipped))
        forget_what_ships()
        patch.setattr(studies, "Effort", partial(studies.Effort, population=4, generations=1))
        patch.setattr("finger_pin.views.viewer.page_server.PageHandle.wait", lambda viewing: viewing.close())
        patch.setattr("finger_pin.playground.player.Playground.wait", lambda playing: playing.close())
        patch.setattr("finger_pin.views.plots.figure_files.save_figure", not_painted)
        patch.setattr("finger_pin.views.plots.statics._DIRECTIONS", 12)
        # The comparison of controllers leaves out the start.
        patch.setattr("paper.comparison.SETTLED", 0.0)
        meshcat = importlib.import_module("meshcat")
        silent = SimpleNamespace(send=lambda command: None)
        patch.setattr(meshcat, "Visualizer", partial(meshcat.Visualizer, window=silent))
        patch.setattr(webbrowser, "open", lambda url, new: True)
        yield SimpleNamespace(folder=folder, done=set())
    forget_what_ships()


def forget_what_ships():
    for kept in (tables.shipped_texts, tables.shipped_table, loading._shipped_scenario):
        kept.cache_clear()


def not_moved(result, path, finger=None):
    Path(path).write_text("moves")


def run_command(line, shown):
    for pattern, shorter in SHORTER.items():
        line = re.sub(pattern, shorter, line)
    if line in shown.done:
        return
    shown.done.add(line)
    first, second, *rest = shlex.split(line)
    if (first, second) == ("python", "-m") and rest[0] == "pip":
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
        assert rest[1:-1] == ["install", "-e"] and rest[-1] in {".", *(f".[{each}]" for each in extras)}
    elif (first, second) == ("python", "-m") and rest[0] == "pytest":
        # That is what is running.
        assert all((ROOT / each).exists() for each in rest[1:] if "/" in each), line
    elif second.startswith("scripts/examples/") or second == "scripts/continuum.py":
        # They have a test each, the latter because its recordings do not ship.
        assert (ROOT / second).is_file(), line
    elif second.startswith("scripts/"):
        assert importlib.import_module(Path(second).stem).main(rest) == 0, line
    else:
        assert application.run(None, rest[1:] if second == "-m" else [second, *rest]) == 0, line


def run_scenario(text, name):
    path = Path(name)
    path.write_text(text, encoding="utf-8")
    result = fp.simulate(fp.load_scenario(path, {"simulation.duration": 0.005}))
    assert result.sizes["time"] == 6


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop is deprecated:DeprecationWarning")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_and_code_of_a_page_run_from_top_to_bottom(page, shown, monkeypatch, capsys):
    if page.parent.name == "warp":
        pytest.importorskip("mujoco_warp")
    monkeypatch.setattr("finger_pin.views.viewer.write_animation", not_moved)
    # The package keeps what it has found once: its own is put back as well.
    monkeypatch.setattr("finger_pin.views.plots.draw_all", quick_figures)
    monkeypatch.setattr("finger_pin.views.plots.figure_files.draw_all", quick_figures)
    text, names, file = page.read_text("utf-8"), {"__name__": "__main__", "fp": fp}, ""
    for found in SHOWN.finditer(text):
        kind, block, code = found.groups(default="")
        if COMMAND.match(code):
            run_command(code, shown)
        elif EXPRESSION.fullmatch(code):
            eval(code, names)
        elif code.endswith((".toml", ".csv")):
            file = Path(code).name
        elif kind == "bash":
            for line in block.replace("\\\n", " ").splitlines():
                for part in line.split(" && "):
                    run_command(part.strip(), shown)
        elif kind == "python" and (needed := OPTIONAL.search(block)) and find_spec(needed[1]) is None:
            continue
        elif kind == "python":
            # A traceback shows the line of the page.
            before = "\n" * (text.count("\n", 0, found.start()) + 1)
            exec(compile(before + block.replace(LONG, LONG.replace("4.0", str(DURATION))), str(page), "exec"), names)
        elif kind == "toml":
            run_scenario(block, file if file.endswith(".toml") else "shown.toml")
        elif kind == "csv":
            Path(file).write_text(block, encoding="utf-8")
        else:
            assert not kind, f"nothing here knows what {kind} is"


def symbol_tables(table):
    return [table, *(each for child in table.get_children() for each in symbol_tables(child))]


def names(code):
    """Return the names that a snippet defines, and those that it asks for and does not define."""
    top = symtable.symtable(code, "page", "exec")
    defined = {each.get_name() for each in top.get_symbols() if each.is_assigned() or each.is_imported()}
    asked = {
        each.get_name()
        for table in symbol_tables(top)
        for each in table.get_symbols()
        if each.is_referenced() and (table is top or each.is_global())
    }
    return defined, asked - defined - set(dir(builtins)) - {"__file__", "__name__"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_snippet_of_a_page_runs_alone_or_says_that_it_continues_those_above(page):
    above = set()
    for block in re.findall(r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE):
        defined, missing = names(block)
        goes_on = block.startswith("# Continues the snippets above.\n")
        assert bool(missing) == goes_on and missing <= above, (block[:80], missing)
        above |= defined


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file(page):
    for target in re.findall(r"\]\(([^)#:]+)(?:#[\w-]+)?\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target
    for name in re.findall(r"`((?:[\w.-]+/)+[\w-]+\.(?:py|toml))`", page.read_text("utf-8")):
        assert any((base / name).exists() for base in (ROOT, ROOT / "finger_pin", page.parent)), name


def test_the_front_page_is_one_page_and_shows_every_command():
    text = PAGES[0].read_text("utf-8")
    assert len(text.splitlines()) <= 150
    page = (ROOT / "scripts" / "README.md").read_text("utf-8")
    for script in (ROOT / "scripts").glob("*.py"):
        assert f"## {script.stem}\n" in page
        assert f"python scripts/{script.name}" in page
