"""Shared fixtures: the paper's finger, networks made on the spot, and the few expensive runs."""

import importlib
import json
import os
import pkgutil
import shutil
import sys
from types import SimpleNamespace

import pytest

import finger_pin as fp
from finger_pin import core
from finger_pin.core.jit import CompiledFunction
from finger_pin.description.simulation_settings import METHODS


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark what needs a browser as slow."""
    for item in items:
        if "browser" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish(session):
    """Compile what the whole suite needs in its processes at once: every second one begins at the end.

    Else one would compile and the others wait, as they need the same.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None or len(session.items) < 1000:
        return
    functions = []
    for found in pkgutil.walk_packages(core.__path__, f"{core.__name__}."):
        values = vars(importlib.import_module(found.name)).values()
        functions += [each for each in values if isinstance(each, CompiledFunction) and each.__module__ == found.name]
    for function in functions[:: -1 if int(worker[2:]) % 2 else 1]:
        if not function.kept:
            function.compile()


@pytest.fixture(scope="session")
def ub():
    return fp.load_finger("ub_stand_in")


@pytest.fixture(scope="session")
def finger(ub):
    return fp.Finger(ub)


@pytest.fixture(scope="session")
def routing(finger):
    return finger.routing


@pytest.fixture(scope="session")
def network():
    """Return a maker of descriptions without links.

    Tendons are given as {name: {joint: radius}} in the order along the tendon, radii in millimetres; `passive` names
    the passive ones and `after` says where their mass is. Further sections are passed on as they are.
    """

    def make(joints, tendons, passive=(), after=None, **sections):
        after = after or {}
        table = {}
        for name, crossings in tendons.items():
            entry = {"crossings": {joint: {"radius": radius * 1e-3} for joint, radius in crossings.items()}}
            if name in passive:
                entry["kind"] = "passive"
            if name in after:
                entry["mass_after"] = after[name]
            table[name] = entry
        described = {"name": "network", "joints": {name: {"range": [-3.0, 3.0]} for name in joints}, "tendons": table}
        return fp.FingerDescription.model_validate(described | sections)

    return make


@pytest.fixture(scope="session")
def fig6_progress():
    """The times that were told on the way of `fig6_runs`, by method."""
    return {method: [] for method in METHODS}


@pytest.fixture(scope="session")
def fig6_runs(fig6_progress):
    """The first 0.015 s of reversals by every method at the default tolerances."""
    scenarios = {each: {"simulation.duration": 0.015, "simulation.method": each} for each in METHODS}
    return {
        method: fp.simulate(fp.load_scenario("reversals", changed), progress=fig6_progress[method].append)
        for method, changed in scenarios.items()
    }


@pytest.fixture(scope="session")
def reversals():
    """The main job, all of it."""
    return fp.simulate(fp.load_scenario("reversals"))


@pytest.fixture(scope="module")
def coarse_sections():
    """Sections of forces in few directions, each of which is a linear programme or more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("finger_pin.views.plots.statics._DIRECTIONS", 12)
        yield


@pytest.fixture
def kernel(monkeypatch):
    """A notebook's kernel that runs the test, as IPython tells of it."""
    shell = SimpleNamespace(kernel=None, config={})
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))


@pytest.fixture
def script(request, monkeypatch):
    """The module of a test's `SCRIPT`, for commands that end before anything runs."""
    path = request.module.SCRIPT
    monkeypatch.syspath_prepend(str(path.parent))
    monkeypatch.setattr(sys, "argv", [str(path)])
    sys.modules.pop(path.stem, None)
    yield importlib.import_module(path.stem)
    sys.modules.pop(path.stem, None)


@pytest.fixture
def refuses(tmp_path, monkeypatch, capsys):
    """Return an assertion that a script refuses arguments in one line with some words, and writes nothing."""

    def refuses(script, arguments, words):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "file").touch()
        try:
            code = script.main(list(arguments))
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        assert code == 2 and printed.out == "" and printed.err.count("\n") == 1
        assert printed.err.startswith(f"{script.__name__}.py: ") and words in printed.err
        assert [each.name for each in tmp_path.iterdir()] == ["file"]

    return refuses


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """A headless browser."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    chromium = next(filter(None, map(shutil.which, names)), None)
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("needs Chromium and chromedriver on the path (Debian: apt install chromium chromium-driver)")
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, which the extra 'test' brings")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (
        "headless=new",
        "no-sandbox",
        "disable-gpu",
        "enable-unsafe-swiftshader",
        "disable-background-networking",
        "disable-component-update",
        "disable-sync",
        "no-first-run",
        "window-size=1200,800",
        # Half of the pixels each way: pictures are painted by the processor.
        "force-device-scale-factor=0.5",
        f"user-data-dir={tmp_path_factory.mktemp('chromium')}",
    ):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    window.set_script_timeout(120)
    yield window
    window.quit()


@pytest.fixture
def loaded(browser):
    """A function that returns what pages have loaded since it was asked last, but for the browser's own pages."""

    def urls():
        events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
        requests = [
            each["params"]["request"]["url"] for each in events if each["method"] == "Network.requestWillBeSent"
        ]
        return [url for url in requests if not url.startswith(("data:", "about:", "blob:", "chrome"))]

    return urls
