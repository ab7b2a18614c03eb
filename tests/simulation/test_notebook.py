"""Progress in notebooks: a bar that appears by itself where something takes long, and nowhere else."""

import re
import sys

import IPython.display
import pytest

import finger_pin as fp
from finger_pin.simulation import notebook


@pytest.fixture
def shown(monkeypatch):
    """The outputs of a notebook, with a clock that goes on by 0.3 s whenever it is looked at."""
    pictures, clock = [], iter(0.3 * count for count in range(10**6))

    class Handle:
        def update(self, picture):
            pictures.append(picture.data)

    def display(picture, display_id):
        pictures.append(picture.data)
        return Handle()

    monkeypatch.setattr(IPython.display, "display", display)
    monkeypatch.setattr(notebook.time, "monotonic", lambda: next(clock))
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    return pictures


def test_a_notebook_shows_how_far_a_simulation_and_a_study_are(shown):
    fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 1.5}))
    values = [float(each) for text in shown for each in re.findall(r'max="1.5" value="([\d.]+)"', text)]
    assert values == sorted(values) and len(values) == len(shown) and values[-1] == 1.5
    shown.clear()
    bar = notebook.notebook_bar("s", 8.0)
    for second in range(9):
        bar(second)
    # From the first second on.
    assert [re.search(r'value="(\d)"', text)[1] for text in shown] == list("345678")
    shown.clear()
    gains = [1.0, 1.2, 1.4, 1.6, 1.8, 2.0]
    fp.simulate_many([fp.load_scenario("fig6", {"simulation.duration": 0.01, "controller.gain": k}) for k in gains])
    assert shown and all("of 6 runs" in text for text in shown)


def test_what_is_over_soon_shows_none_and_neither_does_a_script(shown, monkeypatch):
    monkeypatch.setattr(notebook.time, "monotonic", lambda: 0.0)
    fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 0.05}))
    monkeypatch.delitem(sys.modules, "ipykernel")
    assert notebook.notebook_bar("s", 1.0) is None and shown == []
