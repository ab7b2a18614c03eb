"""Hands that servos, muscles, motors or nothing pull, one or two: an answer or one line, from every public function."""

import inspect
import re
import warnings
from types import SimpleNamespace

import matplotlib.figure
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.commands import application
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.finger_description import HandSettings
from finger_pin.description.loading import read_scenario
from finger_pin.description.validation import validate
from finger_pin.exceptions import FingerPinError, InputError, ScenarioWarning
from finger_pin.exchange.from_mujoco import from_mujoco

BODIES = """<mujoco><compiler angle="radian"/><worldbody><site name="s0" pos="-.02 0 .01"/>
<body name="a"><joint name="j1" axis="0 1 0" range="-1 1"/><geom type="capsule" size=".01" fromto="0 0 0 .05 0 0"/>
<site name="s1" pos=".02 0 .01"/><body name="b" pos=".05 0 0"><joint name="j2" axis="0 1 0" range="-1 1"/>
<geom type="capsule" size=".01" fromto="0 0 0 .04 0 0"/><site name="s2" pos=".02 0 .01"/></body></body></worldbody>
{}</mujoco>"""
CORD = (
    '<tendon><spatial name="c"><site site="s0"/><site site="s1"/><site site="s2"/></spatial></tendon>'
    "<actuator>{}</actuator>"
)
SUM = '<tendon><fixed name="f"><joint joint="j1" coef=".01"/><joint joint="j2" coef=".008"/></fixed></tendon>'
PULL = '<motor name="m" tendon="{}" gear="-1" ctrlrange="0 5"/>'
ON_PALM = "two on a palm"
KINDS = {
    "nothing": "",
    "servos of joints": '<actuator><position joint="j1" kp="1" kv=".01"/><position joint="j2" kp="1"/></actuator>',
    "servo of a cord": CORD.format('<position tendon="c" kp="100" kv="1" forcerange="-20 0"/>'),
    "muscle": CORD.format('<muscle tendon="c" lengthrange=".05 .12" force="10"/>'),
    "motor of a cord": CORD.format(PULL.format("c")),
    ON_PALM: CORD.format('<position tendon="c" kp="100" forcerange="-20 0"/><motor joint="j1" ctrlrange="-1 1"/>'),
    "motor about joints": f"{SUM}<actuator>{PULL.format('f')}</actuator>",
}
ROOMS = (fp, fp.analysis, fp.control, fp.learning, fp.studies, fp.views, fp.views.viewer, fp.views.plots)
#: Functions that are given no hand, no motion and no result of one.
WITHOUT_HAND = {
    "from_mujoco",
    "identify",
    "installing",
    "load",
    "load_finger",
    "load_hand",
    "load_scenario",
    "locking_advice",
    "per_world",
    "predict",
    "save_figure",
    # Parts of a loop for other rooms, which are given a loop's controller and tables.
    "spool_goals",
    "spool_windings",
    "voltage_signals",
}
#: Classes that are given one; others are answers, descriptions or parts.
CLASSES = {"Environment", "Finger", "Hand", "Run", "Simulator", "VectorEnvironment"}
#: What is done with some answers.
USES = {
    "Environment": lambda it: (it.reset(seed=0), it.step(it.action_space.sample())),
    "Run": lambda it: it.result,
    "Simulator": lambda it: it.step(np.zeros(it.finger.mechanism.channels), 1e-3),
    "VectorEnvironment": lambda it: (it.reset(seed=0), it.step(it.action_space.sample())),
    "play": lambda it: it.press("Step"),
    "prepare": lambda it: it.run(),
}
#: Arguments that functions may be called without.
MORE = {
    "Environment": {"reward": lambda signals: np.zeros(len(signals["action"]))},
    "VectorEnvironment": {"reward": lambda signals: np.zeros(len(signals["action"]))},
    "draw": {"speed": np.inf},
    "optimise": {"minimise": ["losses"], "constraints": [], "effort": fp.studies.Effort(4, 1)},
    "play": {"open_browser": False, "block": False},
    "view": {"open_browser": False, "block": False},
    "view_forces": {"open_browser": False, "block": False},
}
#: Command lines of every command; `play` lasts until somebody ends it, and `identify` is given no hand.
LINES = {
    "simulate": (["s.toml", "--check", "--no-figures"], ["--mujoco", "hand.xml", "--duration", "0.05", "--no-figures"]),
    "play": (),
    "sweep": (["s.toml", "--over", "simulation.duration=0.02,0.05"],),
    "optimise": (["s.toml", "--population", "4", "--generations", "1"],),
    "identify": (),
    "observe": (["s.toml", "log.csv", "--no-figures"],),
    "self_locking": (["s.toml"],),
    "force_capability": (["f.toml"], ["f.toml", "--limit", "servos", "--force", "0,0,-1"]),
    "export": (["f.toml", "x.urdf"], ["s.toml", "x.xml"], ["s.toml", "x.toml"], ["r.nc", "x.csv"]),
}
#: A message that is an exception of Python's in disguise, or has no number where one belongs.
RAW = re.compile(r"\b(?!Input|Integration|Study)\w+Error\b|\bnan\b|-1-fold")


def required(function):
    """Return the names of the arguments that are needed, and of a scenario that may be left out."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return []
    needed = [each for each in parameters if each.kind is not each.VAR_KEYWORD and each.kind is not each.VAR_POSITIONAL]
    return [each.name for each in needed if each.default is each.empty or each.name == "scenario"]


def doors():
    """Return the public functions of all rooms, and the classes that are given a hand, by name."""
    public = {name: getattr(room, name) for room in ROOMS for name in dir(room) if name[0] != "_"}
    ours = {name: each for name, each in public.items() if getattr(each, "__module__", "").startswith("finger_pin")}
    return {
        name: each
        for name, each in ours.items()
        if (name in CLASSES or inspect.isfunction(each)) and name not in WITHOUT_HAND and required(each)
    }


DOORS = doors()


@pytest.fixture(scope="module", params=KINDS)
def hand(request, tmp_path_factory):
    """A hand, the files of it and of its motion in a folder, and that motion's result."""
    folder = tmp_path_factory.mktemp("hand")
    (folder / "hand.xml").write_text(BODIES.format(KINDS[request.param]))
    description = from_mujoco(folder / "hand.xml", "hand")
    if request.param == ON_PALM:
        placed = {
            name: {"finger": description, "position": [0.0, y, 0.0]} for name, y in (("left", 0.05), ("right", 0.0))
        }
        description = validate(HandSettings, {"fingers": placed}, ("hand",)).joined()
    scenario = read_scenario(demo_motion(description, 0.05))
    (folder / "f.toml").write_text(fp.to_toml(description))
    (folder / "s.toml").write_text(fp.to_toml(scenario))
    result = fp.simulate(scenario)
    fp.save(result, folder / "r.nc")
    (folder / "log.csv").write_text("time,inputs.m\n0,0\n0.001,0\n")
    built, run = fp.Finger(description), fp.studies.Run(scenario)
    return SimpleNamespace(
        folder=folder, description=description, scenario=scenario, result=result, built=built, run=run
    )


def argument(name, door, hand):
    """Return what a door is given for an argument."""
    description, scenario, result, built = hand.description, hand.scenario, hand.result, hand.built
    channels, posture = built.mechanism.channels, np.resize([0.1, 0.2], len(description.joints))
    paths = {"save": "saved.nc", "write_animation": "page.html", "write_video": "film.mp4"}
    makers = {
        "candidates": lambda: {"as it is": {}},
        "command": lambda: np.ones((3, len(description.actuated_names))),
        "dataset": lambda: result,
        "coupling": lambda: scenario.coupling(built.routing),
        "description": lambda: description,
        "direction": lambda: [0.0, 0.0, 1.0],
        "dt": lambda: 1e-3,
        "finger": lambda: description,
        "finger_or_scenario": lambda: scenario,
        "first": lambda: result,
        "folder": lambda: hand.folder / "figures",
        "force": lambda: [0.0, 0.0, 0.0],
        "forces": lambda: fp.analysis.force_polytope(description, posture, 5.0),
        "inputs": lambda: np.zeros(channels),
        "limit": lambda: 5.0,
        "locking_map": lambda: fp.analysis.self_locking_map(description),
        "maximum_tension": lambda: 5.0,
        "motor_position": lambda: dict.fromkeys(built.actuators.names, 0.1),
        "near": lambda: posture,
        "num_envs": lambda: 2,
        "outputs": lambda: {"joint_position.j1": 0.01},
        "over": lambda: {"simulation.duration": [0.02, 0.05]},
        "parameters": lambda: {"finger.gravity[2]": (-10.0, -9.0)},
        "path": lambda: hand.folder / paths[door],
        "point": lambda: [0.08, 0.0, -0.02],
        "position": lambda: posture,
        "result": lambda: result,
        "results": lambda: {"one": result, "other": result},
        "scenario": lambda: scenario,
        "scenarios": lambda: [scenario],
        "second": lambda: result,
        "simulators": lambda: [fp.Simulator(description, posture)],
        "speed": lambda: np.full(3, 0.01),
        "state": lambda: built.rest_state(posture),
        "tensions": lambda: np.zeros((1, channels)),
        "visualizer": lambda: pytest.importorskip("meshcat").Visualizer(window=SimpleNamespace(send=lambda sent: None)),
    }
    return makers[name]()


def seen(answer):
    """Return the text of an answer: of a figure all words on it, once every panel has something on it."""
    if not isinstance(answer, matplotlib.figure.Figure):
        return answer if isinstance(answer, str) else ""
    answer.set_layout_engine("none")  # `draw_all` has its layout made, which takes the most time
    answer.draw_without_rendering()
    assert answer.axes
    assert all(axes.has_data() or axes.texts for axes in answer.axes)
    return " ".join(text.get_text() for text in answer.findobj(matplotlib.text.Text))


@pytest.mark.slow
@pytest.mark.parametrize("name", DOORS)
def test_every_public_function_answers_or_says_in_one_line_why_not(hand, name):
    needed = required(DOORS[name])
    if name == "play":
        pytest.importorskip("viser", reason="needs viser, which the extra 'play' brings")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScenarioWarning)
        try:
            answer = DOORS[name](*(argument(each, name, hand) for each in needed), **MORE.get(name, {}))
            USES.get(name, seen)(answer)
            text = seen(answer)
        except FingerPinError as error:
            text = str(error)
            assert "\n" not in text
        else:
            getattr(answer, "close", lambda: None)()
    assert not RAW.search(text)


@pytest.mark.slow
@pytest.mark.parametrize("name", fp.studies.METRICS)
def test_every_metric_is_a_number_or_says_in_one_line_why_not(hand, name):
    try:
        value = fp.studies.METRICS[name].measure(hand.run)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert not np.isnan(value)


@pytest.mark.slow
@pytest.mark.parametrize("command", application.COMMANDS, ids=lambda each: each.__name__)
def test_every_command_answers_or_says_in_one_line_why_not(hand, command, monkeypatch, tmp_path, capsys):
    for path in hand.folder.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    for line in LINES[command.__name__]:
        code = application.run(command.__name__, line)
        printed = capsys.readouterr()
        assert code in (application.DONE, application.WRONG_INPUT, application.FAILED), printed.err
        assert code == application.DONE or len(printed.err.splitlines()) == 1
        assert not RAW.search(printed.out + printed.err)


@pytest.mark.parametrize("draw", [fp.views.plots.plot_fig6, lambda result: fp.views.plots.compare(result, result)])
def test_figures_show_hinges_in_degrees_and_slides_in_metres(draw, tmp_path):
    """A joint that stands at 0.5 stands there as 28.6 degrees or as 0.5 m."""
    text = BODIES.format("").replace('name="j2" axis', 'name="j2" type="slide" axis')
    (tmp_path / "slide.xml").write_text(text)
    scenario = demo_motion(from_mujoco(tmp_path / "slide.xml", "slide"), 0.01)
    scenario["simulation"]["initial"] = {"position": {"j1": 0.5, "j2": 0.5}}
    figure = draw(fp.simulate(read_scenario(scenario)))
    starts = [float(line.get_ydata()[0]) for axes in figure.axes for line in axes.get_lines()]
    assert {round(each, 1) for each in starts} >= {28.6, 0.5}
    units = set(re.findall(r"[°\w]+", " ".join(axes.get_ylabel() for axes in figure.axes)))
    assert units >= {"°", "m"}


def test_a_motion_that_is_integrated_well_is_not_said_to_be_passed_too_coarsely(hand):
    """What falls exchanges next to no energy: what its account leaves open is judged by the energy that it stores."""
    assert "account" not in hand.result.attrs


def test_no_hand_without_pulled_tendons_has_force_closure(hand):
    """Two joints need three tendons that pull, and none of these hands has more than one."""
    closure = fp.analysis.closure_over_range(hand.description, 8)
    assert not closure.holds
    assert str(closure).startswith("no force closure")
    with pytest.raises(InputError, match="no force closure"):
        fp.analysis.locking_over_range(hand.description, 8)
