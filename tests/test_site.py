"""The documentation site builds without a warning, and has every page, picture, equation and public name."""

import re
import subprocess
import sys
from inspect import ismodule
from pathlib import Path

import pytest

import finger_pin as fp

for each in ("mkdocs", "material", "mkdocstrings", "latex2mathml"):
    pytest.importorskip(each)

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(ROOT / ".site" / "mkdocs.yml")]
    done = subprocess.run([*command, "-d", str(folder)], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


def test_every_page_and_every_picture_of_the_repository_is_on_the_site(site):
    for page in [ROOT / "README.md", *ROOT.glob("[fst]*/**/*.md")]:
        name = "index.html" if page.stem == "README" else f"{page.stem}.html"
        assert (site / page.parent.relative_to(ROOT) / name).is_file(), page
    gallery = (site / "gallery.html").read_text("utf-8")
    for picture in (ROOT / ".readme").rglob("*.png"):
        assert f'src="pictures/{picture.relative_to(ROOT / ".readme").as_posix()}"' in gallery, picture


def test_every_public_name_has_its_entry(site):
    pages = {path.stem: path.read_text("utf-8") for path in (site / "api").glob("*.html")}
    for name in fp.__all__:
        found = getattr(fp, name)
        if ismodule(found):
            assert len(re.findall(r'class="doc doc-heading"', pages[name])) >= 5, name
        elif callable(found):
            assert f'id="{found.__module__}.{found.__qualname__}"' in pages["index"], name


def test_equations_are_rendered_without_a_script(site):
    source = (ROOT / "finger_pin" / "EQUATIONS.md").read_text("utf-8")
    page = (site / "finger_pin" / "EQUATIONS.html").read_text("utf-8")
    block = '<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">'
    assert page.count(block) == source.count("```math\n") > 22
    # What the converter does not know it leaves as it is.
    assert "arithmatex" not in page and not re.search(r"<m[io][^>]*>(\\|&amp;|&<)", page)


@pytest.mark.parametrize(("width", "height"), [(1200, 6500), (360, 8500)], ids=["wide", "phone"])
def test_equations_are_neither_cut_off_nor_scrolled(site, browser, width, height):
    def seen():
        before, now = None, browser.get_screenshot_as_png()
        while now != before:
            before, now = now, browser.get_screenshot_as_png()
        return now

    equations = "[...document.querySelectorAll('math[display=block]')]"
    shape = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 800}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", shape)
    browser.get((site / "finger_pin" / "EQUATIONS.html").as_uri())
    browser.execute_async_script("document.fonts.ready.then(arguments[0])")
    shown, bottom = seen(), browser.execute_script("return document.documentElement.scrollHeight")
    wide = f"return {equations}.filter(each => each.scrollWidth > each.clientWidth).map(each => each.textContent)"
    assert bottom <= height and browser.execute_script(wide) == []
    browser.execute_script(f"{equations}.forEach(each => each.style.overflow = 'visible')")
    assert seen() == shown
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_no_page_loads_anything_from_elsewhere(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(r'<(?:script|img|iframe)[^>]* src="([^"]+)"', page.read_text("utf-8"))
        loaded += re.findall(r'<link[^>]* rel="(?:stylesheet|preconnect)"[^>]* href="([^"]+)"', page.read_text("utf-8"))
        assert loaded and not [each for each in loaded if "//" in each], page
