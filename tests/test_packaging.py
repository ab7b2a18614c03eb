"""What a wheel, an sdist and a registry say and hold, and what a shell completes."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from finger_pin.commands import application

ROOT = Path(__file__).resolve().parents[1]
CONFIG = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = CONFIG["project"]
#: Packages that are imported under another name, and what xarray imports in our place.
CALLED = {"pin": "pinocchio", "tomli-w": "tomli_w", "lazy_loader": "lazy_loader", "mujoco-warp": "mujoco_warp"}
CALLED |= {
    "netcdf4": "netCDF4",
    "warp-lang": "warp",
    "pydantic-core": "pydantic_core",
    "imageio-ffmpeg": "imageio_ffmpeg",
}
UNSEEN = {"netCDF4"}
#: A tracked file that no test and no user of an sdist reads.
FOR_DEVELOPERS = {".gitignore", ".pre-commit-config.yaml"}


def names(requirements):
    found = [re.split(r"[\[<>=;! ]", each)[0].lower() for each in requirements]
    return {CALLED.get(name, name) for name in found}


@pytest.mark.slow
def test_the_package_imports_all_that_it_depends_on_and_nothing_else():
    imported = set()
    for path in (ROOT / "finger_pin").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {each.name.split(".")[0] for each in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.split(".")[0])
    needed, extras = names(PROJECT["dependencies"]), set()
    for group in PROJECT["optional-dependencies"].values():
        extras |= names(group)
    foreign = imported - set(sys.stdlib_module_names) - {"finger_pin"}
    assert needed - imported == UNSEEN
    # A part of matplotlib, and a library that there is an adapter for.
    assert foreign - needed - extras == {"mpl_toolkits", "stable_baselines3"}


def test_every_licence_in_the_package_stands_in_its_metadata():
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / "finger_pin").rglob("*LICENSE*")}
    assert files and files | {"LICENSE"} == set(PROJECT["license-files"])
    marks = {"Apache License": "Apache-2.0", "MIT License": "MIT", "Open Database License": "ODbL-1.0"}
    texts = [(ROOT / name).read_text("utf-8") for name in PROJECT["license-files"]]
    kinds = {kind for text in texts for mark, kind in marks.items() if mark in text[:400]}
    assert set(PROJECT["license"].split(" AND ")) == kinds and len(kinds) == len(texts)


def test_authors_are_those_to_cite():
    cited = (ROOT / ".github" / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^  - name: (.*)$", cited, re.MULTILINE) == [each["name"] for each in PROJECT["authors"]]


def test_licences_to_cite_are_those_of_the_metadata():
    cited = (ROOT / ".github" / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^ *license: (.*)$", cited, re.MULTILINE) == PROJECT["license"].split(" AND ")


def test_exceptions_for_types_are_of_modules_that_there_are():
    listed = [name for each in CONFIG["tool"]["mypy"]["overrides"] for name in each["module"]]
    for name in [name for name in listed if name.startswith("finger_pin.")]:
        path = ROOT / name.removesuffix(".*").replace(".", "/")
        assert path.is_dir() or path.with_suffix(".py").is_file(), name


def test_an_sdist_has_all_that_is_tracked():
    if not (ROOT / ".git").exists():
        pytest.skip("is of a working tree")
    tracked = subprocess.run(["git", "ls-files"], capture_output=True, text=True, cwd=ROOT, check=True).stdout
    there = {line.split("/")[0].strip('"') for line in tracked.splitlines()}
    assert there - FOR_DEVELOPERS == set(CONFIG["tool"]["hatch"]["build"]["targets"]["sdist"]["include"])


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_release_writes_addresses_that_a_registry_can_follow(tmp_path):
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    said = {"GITHUB_REPOSITORY": "somebody/hands", "GITHUB_REF_NAME": "v1.2"}
    subprocess.run([ROOT / ".ci" / "addresses"], cwd=tmp_path, env=os.environ | said, check=True)
    link = r"\]\(([^)]+)\)"
    before, after = (re.findall(link, (folder / "README.md").read_text("utf-8")) for folder in (ROOT, tmp_path))
    assert len(before) == len(after) > 10
    for old, new in zip(before, after, strict=True):
        if ":" in old:
            assert new == old
        elif old.endswith(".png"):
            assert new == f"https://raw.githubusercontent.com/somebody/hands/v1.2/{old}"
        else:
            assert new == f"https://github.com/somebody/hands/blob/v1.2/{old}"
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["urls"]["Source"] == "https://github.com/somebody/hands"
    assert PROJECT.keys() == project.keys() - {"urls"}


@pytest.mark.parametrize(
    "words, expected", [("finger-pin simu", "simulate"), ("finger-pin simulate --check", "--check")]
)
def test_a_shell_completes_commands_and_options(monkeypatch, capsys, words, expected):
    monkeypatch.setenv("_FINGER_PIN_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    with pytest.raises(SystemExit) as ended:
        application.run(None, [])
    assert not ended.value.code and capsys.readouterr().out.split() == [expected]
