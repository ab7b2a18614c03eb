"""A result, and the page that plays it."""

import pytest
from motion import make_result
from pages import opened

from finger_pin.views.viewer import write_animation


@pytest.fixture(scope="session")
def result():
    return make_result()


@pytest.fixture(scope="module")
def page(browser, result, tmp_path_factory):
    path = write_animation(result, tmp_path_factory.mktemp("page") / "animation.html")
    return opened(browser, path.as_uri())
