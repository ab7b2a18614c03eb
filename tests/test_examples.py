"""Every example runs as it stands, draws its picture, and what it says agrees with an independent value."""

import re
import runpy
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import mujoco
import numpy as np
import pytest
import test_every_law
from law_cases import random_parameters, random_rows

import finger_pin as fp

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).resolve().parents[1] / "scripts" / "examples"
PICTURES = FOLDER.parents[1] / ".readme" / "examples"


@pytest.fixture
def example(tmp_path, monkeypatch):
    """Return a function that runs an example and returns its names; its picture has to be there at the end."""
    monkeypatch.setenv("MPLBACKEND", "agg")

    def example(name):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", str(tmp_path)])
        with matplotlib.rc_context():
            names = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
        assert plt.imread(tmp_path / f"{name}.png").std() > 0.05
        return names

    yield example
    plt.close("all")


def test_an_own_finger_weighs_what_levers_say(example):
    """Two links, stretched out: the sum of weights times levers."""
    names = example("own_finger")
    lever = 0.015 * 0.025 + 0.008 * (0.05 + 0.015)
    np.testing.assert_allclose(names["weight"], [9.81 * lever, 9.81 * 0.008 * 0.015], rtol=1e-9)
    assert names["error"] < 0.5


def test_a_canal_warms_by_what_friction_takes_and_a_warm_one_delivers_more(example):
    """C dT = K x (exp(mu_e phi (1 - FALL T)) - 1) dx, separated; by the capstan law at the temperature at the end."""
    names = example("warm_cord")
    result, temperature = names["warmed"], names["temperature"]
    np.testing.assert_allclose(temperature, names["expected"], atol=0.1)
    assert float(temperature[-1]) > 30.0
    rng = np.random.default_rng(5)
    for law in (names["WARM"], names["HEAT"]):
        rows, p = random_rows(rng, test_every_law.COUNT), random_parameters(law, rng, test_every_law.COUNT)
        # No canal is so warm that its coefficient is below zero.
        p[-1] *= 0.1
        test_every_law.test_slopes_are_the_derivatives_of_the_value((law, rows, p))
    turned = names["COULOMB"] * (1.0 - names["FALL"] * float(temperature[-1])) * names["turn"]
    assert float(result.tendon_tension[-1, 0] / result.tendon_command[-1, 0]) == pytest.approx(
        np.exp(-turned), rel=1e-3
    )


def test_measured_friction_is_that_of_a_straight_line_through_the_readings(example):
    """The law over a half turn is f = k f^a - d (1 + k) / 2, with k = exp(-mu pi)."""
    names = example("measured_friction")
    slope, start = np.polyfit(names["readings"]["force_in_N"], names["readings"]["force_out_N"], 1)
    expected = [-np.log(slope) / np.pi, -2.0 * start / (1.0 + slope)]
    np.testing.assert_allclose(list(names["measured"].values()), expected, rtol=1e-3)
    assert names["peaks"][1] > 1.3 * names["peaks"][0]


def test_compensating_friction_tracks_the_motion_of_the_paper_better(example):
    """The motion of the independent joints is written out."""
    names = example("compare_controllers")
    time = names["result"].time.values
    wanted = [8.0 * np.sin(np.pi * time), *(35.0 - 25.0 * np.cos(np.pi * time * rate) for rate in (0.5, 1.0))]
    measured = np.rad2deg(names["result"].joint_position.sel(joint=["abduction", "proximal", "medial"]))
    error = np.sqrt(np.mean((np.transpose(wanted) - measured.values) ** 2))
    paper, damped, tendons, joints = names["errors"].values()
    assert error < 1.2 * joints and joints < tendons < damped / 1.5 and joints < paper / 2.0


def test_a_grasped_cylinder_is_carried_with_its_weight(example):
    names = example("grasp")
    np.testing.assert_allclose(names["carried"][-1], [0.0, 0.0, 0.15 * 9.81], atol=2e-3)


def test_a_mujoco_hand_moves_as_in_mujoco_and_friction_holds_it_on_both_ways(example):
    names = example("mujoco_hand")
    assert names["apart"] < 0.05
    closing, opening = (float(names["smooth"].sel(time=time)) for time in (1.0, 3.0))
    assert names["at_3_newton"][0] < closing - 5.0 and names["at_3_newton"][1] > opening + 5.0


def test_friction_in_mj_step_obeys_the_capstan_law(example):
    """At one angle the spring asks for one tension, so that the pulls there and back are exp(2 mu phi) apart."""
    names = example("mj_step_friction")
    expected = np.exp(2.0 * names["COULOMB"] * (names["TURN"] + np.deg2rad(40.0)))
    assert names["there"] / names["back"] == pytest.approx(expected, rel=0.01)


def test_a_linear_model_agrees_with_runs_and_with_its_poles(example):
    pytest.importorskip("control")
    names = example("bode")
    assert names["worst"] < 2.0
    poles = np.linalg.eigvals(names["lin"].A.values)
    fast = poles[abs(poles.imag).argmax()]
    peak = np.sqrt(abs(fast) ** 2 - 2.0 * fast.real**2) / (2.0 * np.pi)  # Hz, of one such oscillator
    assert names["frequencies"][names["gain"].argmax()] == pytest.approx(peak, rel=0.03)


def test_what_bends_of_a_cord_leave_is_the_capstan_law(example):
    names = example("wound_cord")
    bend = float(np.deg2rad(names["angles"].sel(time=1.5).sum()))
    assert names["shares"][1.5] == pytest.approx(np.exp(-0.15 * bend), rel=0.01)
    assert names["shares"][4.0] > 1.0


def test_an_observer_of_a_motor_sees_a_touch_soon_and_its_bands_hold_the_angles_before(example):
    names = example("observed_touch")
    seen, gone = names["touches"]
    assert 1.0 < seen < 1.1 and 1.3 < gone < 1.5
    truth, result = names["truth"].joint_position.values[1:], names["result"]
    inside = (truth >= result.joint_position_low) & (truth <= result.joint_position_high)
    assert inside.sel(time=slice(0.0, 1.0)).all() and inside.sel(time=slice(1.6, 2.5)).mean() > 0.9


def test_a_policy_is_as_good_in_an_environment_of_its_own_and_better_than_none(example):
    gymnasium = pytest.importorskip("gymnasium")
    names = example("train_policy")
    assert np.median(names["after"]) < 0.5 * np.median(names["before"])
    environment = gymnasium.make("finger_pin/Reach-v0", duration=1.0)
    low, high = environment.action_space.low, environment.action_space.high
    for k in (0, 17):
        seen, _ = environment.reset(seed=9000 + k)
        for _ in range(names["STEPS"]):
            known = [1.0, *(20.0 * seen[11:14]), *(0.1 * seen[4:8])]
            seen, *_ = environment.step(low + (high - low) / (1.0 + np.exp(-names["middle"] @ known)))
        assert np.linalg.norm(seen[11:14]) == pytest.approx(names["after"][k], abs=1e-4)


def test_what_is_trained_with_one_friction_fails_with_others_also_in_c_with_the_plugin(example):
    pytest.importorskip("mujoco_warp")
    names = example("warp_randomised_friction")
    one, many = names["found"].values()
    assert one.max() > 3.0 * many.max() and one[abs(names["coulomb"] - names["ALIKE"]).argmin()] < 1.0
    spec = mujoco.MjSpec.from_string(names["MODEL"])
    fp.mujoco.add_friction(spec, tendons={"flexor": names["law"] | {"coulomb": names["MOST"]}})
    model = spec.compile()
    data, random, angles = mujoco.MjData(model), np.random.default_rng(1), []
    up, along, gain, damping = names["weights"]["one friction"] * names["SCALES"]
    for goal, way in zip(names["WANTED"], names["WAYS"], strict=True):
        measured = data.qpos[0] + names["NOISE"] * random.standard_normal(names["WORLDS"])[-1]
        data.ctrl[0] = (up + way * along) * goal + gain * (goal - measured) - damping * data.qvel[0]
        mujoco.mj_step(model, data, names["STEPS"])
        angles.append(data.qpos[0])
    np.testing.assert_allclose(names["angles"]["one friction"][:, -1], angles, atol=1e-3)


def test_a_sweep_on_dask_is_that_of_threads(example):
    pytest.importorskip("distributed")
    names = example("sweep_on_dask")
    corners, metrics = {key: values[::3] for key, values in names["OVER"].items()}, ["tracking_rms", "tension_peak"]
    expected = fp.sweep("reversals", corners, metrics=metrics, overrides={"simulation.duration": 1.0})
    for name in metrics:
        np.testing.assert_array_equal(names["study"].sel(corners)[name], expected[name])


def test_a_killed_sweep_goes_on_and_is_that_of_one_that_was_not(example):
    names = example("kill_and_resume")
    done = len(names["kept"])
    assert 5 <= done < len(names["GAINS"]) and names["told"][0] == done
    assert names["records"]()[:done] == names["kept"]
    some = names["study"].tracking_rms[[done - 1, done]]
    expected = fp.sweep("reversals", {"controller.gain": some["controller.gain"].values}, metrics=["tracking_rms"])
    np.testing.assert_array_equal(some, expected.tracking_rms)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_notebook_sticks_slips_goes_slack_and_locks(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")

    notebook = nbformat.read(FOLDER / "stick_slip_slack_locking.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    streams = [each for cell in notebook.cells for each in cell.get("outputs", []) if each.output_type == "stream"]
    # A slow machine says how far it is, and the first run of all that it compiles.
    assert not any("Warning" in each.text for each in streams)
    lines = "".join(each.text for each in streams if each.name == "stdout").splitlines()
    even, jerky, loose, *locking = [[float(number) for number in re.findall(r"[\d.]+", line)] for line in lines]
    assert even[1] == pytest.approx(even[2], rel=0.01) and jerky[1] > 10.0 * jerky[2]
    # Friction of 20 mN m holds the lever where its spring of 0.05 N m/rad pulls with less, and nothing else does.
    assert loose[0] == 0.0 and np.rad2deg(0.2) < loose[1] < np.rad2deg(0.4)
    for pull, free, half, locked in (numbers[:2] + numbers[3::2] for numbers in locking):
        assert free == pytest.approx(np.rad2deg(0.006 * pull * np.exp(-0.3) / 0.05), rel=0.02)
        assert half == pytest.approx(0.5 * free, rel=0.03) and locked < 0.1 * free
    assert (tmp_path / "results" / "examples" / "stick_slip_slack_locking.png").stat().st_size > 10_000


def test_every_example_is_on_its_page_with_a_small_picture():
    page = (FOLDER / "README.md").read_text("utf-8")
    names = {path.stem for path in FOLDER.iterdir() if path.suffix in (".py", ".ipynb")}
    assert names == {path.stem for path in PICTURES.iterdir()}
    for name in names:
        assert f"../../.readme/examples/{name}.png" in page and (PICTURES / f"{name}.png").stat().st_size < 60_000
