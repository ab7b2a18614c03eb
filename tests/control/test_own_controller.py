"""Controllers and references of one's own: what is wrong is found at the first call, what was computed is kept."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from typed_controller import pulled

import finger_pin as fp
from finger_pin.control.interface import ControlSignals
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.references.reference import ReferenceSignals
from finger_pin.simulation.result_folder import ResultFolder
from finger_pin.views.summary import summarize

PULL = np.array([1.0, 1.0, 4.0, 3.0, 3.0])


def scenario(duration=0.02, **entries):
    return fp.load_scenario("reversals", {"simulation.duration": duration} | entries)


@dataclass
class Own:
    """A controller made of a function of one time."""

    answer: Callable

    def command(self, time, reference, position, velocity):
        return self.answer(time, position)


def fixed(tension, torque=(0.0,) * 4):
    return Own(lambda time, position: ControlSignals(np.array(torque), np.array(tension)))


@pytest.mark.slow
@pytest.mark.parametrize("period", [None, 1e-3])
def test_a_controller_that_only_knows_one_time_is_asked_time_by_time(period):
    """`if`, `float` and `max` of one time would all fail on an array of times."""

    def answer(time, position):
        if time > 0.0105:
            return ControlSignals(np.zeros(4), PULL + max(0.0, float(position[1])))
        return ControlSignals(np.zeros(4), PULL)

    result = fp.simulate(scenario(), controller=Own(answer), control_period=period)
    raised = result.tendon_command.values[:, 0] - 1.0
    held = np.maximum(result.joint_position.values[:, 1], 0.0) * (result.time.values > 0.0105)
    np.testing.assert_allclose(raised, held, atol=0.0 if period is None else 2e-3)
    assert held.max() > 0.1


@pytest.mark.slow
def test_the_tensions_alone_are_an_answer_of_all_tendons_or_of_the_actuated_ones():
    """The torque that goes with them is H_c^T f of the actuated tendons: 8, 8, 6.3 and 5.3 mm."""
    for size in (4, 5):
        result = fp.simulate(scenario(0.005), controller=Own(lambda time, position, size=size: PULL[:size]))
        np.testing.assert_array_equal(result.tendon_command[:, :4], np.broadcast_to(PULL[:4], (6, 4)))
        expected = [0.0, 16e-3 - 3 * 5.3e-3, 4 * 6.3e-3 - 3 * 5.3e-3, -3 * 5.3e-3]
        np.testing.assert_allclose(result.joint_torque_command[-1], expected, atol=1e-15)


WRONG = [
    (fixed([1.0, 1.0, 4.0]), "must return 4 or 5 tensions"),
    (fixed([PULL, PULL]), "not shape (2, 5)"),
    (fixed(PULL, torque=[0.0]), "must return 4 torques"),
    (fixed([1.0, 1.0, np.nan, 3.0, 3.0]), "that of T3 is not"),
    (fixed([1.0, -0.5, 4.0, 3.0, 3.0]), "that of T2 is not; clip it at 0"),
    (Own(lambda time, position: None), "must return 4 or 5 tensions"),
    (Own(lambda time, position: "taut"), "must return 4 or 5 tensions"),
]


@pytest.mark.parametrize("period", [None, 1e-3])
@pytest.mark.parametrize(("controller", "said"), WRONG)
def test_a_wrong_first_command_is_refused_in_one_line_before_anything_is_computed(controller, said, period):
    controller.answer, answer, calls = lambda *given: calls.append(given) or answer(*given), controller.answer, []
    with pytest.raises(InputError) as caught:
        fp.simulate(scenario(), controller=controller, control_period=period)
    assert caught.value.entry == "controller" and said in str(caught.value) and "\n" not in str(caught.value)
    assert len(calls) == 1


def test_an_object_without_a_command_method_is_refused_as_a_controller_in_one_line():
    with pytest.raises(InputError, match=r"must have command\(time, reference, position, velocity\)"):
        fp.simulate(scenario(), controller=lambda *given: PULL)


def divides(time, position):
    return PULL if time < 0.005 else 1 / 0


def pushes(time, position):
    return PULL if time < 0.005 else -PULL


def loses(time, position):
    return PULL if time < 0.005 else np.nan * PULL


@cache
def undisturbed(method, period):
    settings = {} if method == "sampled" else {"simulation.method": method}
    return fp.simulate(scenario(0.006, **settings), controller=Own(lambda time, position: PULL), control_period=period)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "answer", "said"),
    [
        *((method, divides, "ZeroDivisionError") for method in ("Rodas5P", "LSODA", "sampled")),
        ("Rodas5P", pushes, "that of T1 is not"),
        ("sampled", loses, "nan: tensions must be finite"),
    ],
)
def test_a_controller_that_fails_later_ends_the_run_there_and_keeps_the_computed_part(method, answer, said):
    settings = {"simulation.method": "Rodas5P" if method == "sampled" else method}
    period = 1e-3 if method == "sampled" else None
    with pytest.raises(IntegrationError) as caught:
        fp.simulate(scenario(0.006, **settings), controller=Own(answer), control_period=period)
    error = caught.value
    assert said in str(error) and "\n" not in str(error)
    assert error.time == pytest.approx(0.005, abs=1e-3)
    whole = undisturbed(method, period)
    kept = error.result.sizes["time"]
    assert kept >= 4
    np.testing.assert_allclose(error.result.joint_position, whole.joint_position[:kept], atol=1e-5)


@dataclass
class Path:
    position: tuple
    velocity: tuple = (0.0,) * 4

    def at(self, time):
        assert np.ndim(time) == 0
        return ReferenceSignals(np.array(self.position), np.array(self.velocity))


@pytest.mark.slow
def test_a_reference_is_asked_one_time_at_a_time():
    result = fp.simulate(scenario(0.005), reference=Path([0.0, 0.5, 0.5, 0.346]))
    np.testing.assert_array_equal(result.joint_reference, np.broadcast_to([0.0, 0.5, 0.5, 0.346], (6, 4)))


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (Path([0.0, 0.5, 0.5]), "position at t = 0 s must be 4 finite numbers"),
        (Path([0.0, 0.5, 0.5, np.inf]), "position at t = 0 s must be 4 finite numbers"),
        (Path([0.0, 0.5, 0.5, 0.3], velocity=[0.0]), "velocity at t = 0 s must be 4 finite numbers"),
        (lambda time: np.zeros(4), r"must have at\(time\)"),
        (([0.0, 1.0], np.full((2, 3), 45.0)), "is it in degrees"),
        ([[0.0, 1.0], np.zeros((2, 2))], "one column for each of abduction, proximal, medial"),
        (type("Bare", (), {"at": lambda self, time: np.zeros(4)})(), "must return ReferenceSignals"),
    ],
)
def test_a_wrong_reference_is_refused_in_one_line(reference, said):
    with pytest.raises(InputError, match=said) as caught:
        fp.simulate(scenario(), reference=reference)
    assert caught.value.entry == "reference"


@pytest.mark.slow
def test_a_result_of_one_s_own_controller_says_so_and_its_folder_promises_no_repetition(tmp_path):
    given = {"controller": fixed(PULL), "reference": Path([0.0, 0.5, 0.5, 0.346])}
    result, plain = fp.simulate(scenario(), **given), fp.simulate(scenario())
    assert result.attrs["custom"] == "controller, reference" and "custom" not in plain.attrs
    assert "Not what the scenario alone gives: controller, reference" in summarize(result)
    assert "alone gives" not in summarize(plain)
    for run, promised in ((plain, True), (result, False), (plain, True)):
        with ResultFolder(tmp_path / "run") as folder:
            folder.write(run)
            folder.publish()
        head = (tmp_path / "run" / "scenario.toml").read_text().splitlines()[0]
        assert ("gives the same trajectory" in head) == promised
        assert ("alone it gives another motion" in head) != promised


@pytest.mark.slow
def test_a_result_of_one_s_own_is_not_checked_against_the_scenario_s_controller():
    result = fp.simulate(scenario(), controller=fixed(PULL))
    with pytest.raises(InputError, match="had controller of its own: give the same here"):
        fp.check_convergence(scenario(), result)


def test_a_controller_may_be_written_with_types_and_return_tensions_alone():
    """At rest on the reference nothing is missing: T3 begins at 4 N."""
    assert pulled(2e-3)[0] == pytest.approx(4.0, abs=1e-9)
