"""Laws of joint friction chosen by name: Dahl's, Coulomb's and a user's, against what they are by definition."""

import contextlib
import importlib
import sys

import numpy as np
import pytest
from core_cases import relative
from random_mechanisms import kinds_of

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.description.loading import read_scenario
from finger_pin.views.summary import summarize
from finger_pin.views.viewer import write_animation

SHORT = {"simulation.duration": 0.3}
LAW = "finger.joint_friction.law"

OWN = """
import numpy as np
import finger_pin as fp


def value(row, p):
    (kinetic,) = p
    level = kinetic * row.load
    loss = level * row.speed / np.sqrt(1.0 + row.speed * row.speed)
    return -loss, 0.0 * row.speed, loss, row.load, kinetic + 0.0 * row.load, level


def slopes(row, p, signals):
    share = 1.0 / np.sqrt(1.0 + row.speed * row.speed)
    return (0.0, -signals[3] * share**3, 0.0, 0.0, -p[0] * row.speed * share, 0.0, 0.0), (0.0,) * 6


def account(row, p, force, rate, signals):
    return 0.0 * force, -force * row.speed


SOFT = fp.Law("soft", ("kinetic",), value, slopes, account, ("friction", "normal_force", "coefficient", "level"),
              losses=("rubbing",))
NOTHING = fp.Law("lacks signals", ("kinetic",), value, slopes, account)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A module with laws, which can be imported."""
    (tmp_path / "laws_of_mine.py").write_text(OWN, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("FINGER_PIN_LAWS", "no_such_module, laws_of_mine")
    yield
    sys.modules.pop("laws_of_mine", None)


def keys(numbers):
    return {f"finger.joint_friction.{name}": value for name, value in numbers.items()}


def scenario(law, **more):
    return fp.load_scenario(
        "reversals", {**SHORT, LAW: law} | {f"finger.joint_friction.{key}": v for key, v in more.items()}
    )


@pytest.mark.slow
def test_dahl_is_the_paper_s_law_without_stribeck_s_curve():
    dahl, flat = fp.simulate(scenario("dahl")), fp.simulate(scenario("lugre", stiction=2.5e-4))
    np.testing.assert_array_equal(dahl.joint_position, flat.joint_position)
    np.testing.assert_array_equal(dahl.joint_stiction, flat.joint_stiction)


@pytest.mark.slow
def test_coulomb_friction_is_a_function_of_speed_and_reaction_and_has_no_state():
    result = fp.simulate(scenario("coulomb", coulomb=4e-4, viscous=2e-3, reversal_speed=0.05))
    speed = result.joint_velocity.values
    expected = 4e-4 * result.joint_reaction.values * np.tanh(speed / 0.05) + 2e-3 * speed
    np.testing.assert_allclose(result.joint_friction, expected, rtol=1e-12, atol=1e-15)
    assert "joint_stiction" not in result and abs(speed).max() > 0.1
    dry = (expected - 2e-3 * speed) * speed
    np.testing.assert_allclose(result.power_joint_coulomb, dry.sum(axis=1), rtol=1e-9, atol=1e-15)


def test_below_its_level_coulomb_friction_creeps_where_bristles_hold():
    """With a torque of the share s of the level a joint goes at v_r artanh(s), where viscous friction is none."""
    share, speed, more = 0.6, 0.02, {"coulomb": 2e-3, "viscous": 0.0, "reversal_speed": 0.02}
    description = fp.load_finger(
        "planar", {f"finger.joint_friction.{key}": v for key, v in more.items()} | {LAW: "coulomb"}
    )
    finger = fp.Finger(description)
    x = finger.rest_state(np.array([0.3, 0.3]), np.full(2, speed * np.arctanh(share)))
    found = finger.evaluate(x, np.full(finger.routing.actuated, 5.0))
    np.testing.assert_allclose(found["joint_friction"], share * 2e-3 * found["joint_reaction"], rtol=1e-12)


@pytest.mark.slow
def test_the_compiled_and_the_readable_path_agree_on_every_law(own):
    drag = {"drag": 2e-3, "drag_asymmetry": 0.4}
    rng, command = np.random.default_rng(1), np.full(4, 5.0)
    for law, more in (("lugre", drag), ("dahl", drag), ("coulomb", drag), ("laws_of_mine:SOFT", {})):
        finger = fp.Finger(scenario(law, **more).finger)
        spread = 0.3 * rng.normal(size=(20, finger.layout.size)) * finger.layout.scales()
        x = finger.rest_state(np.full(4, 0.4)) + spread
        readable = finger.mechanism.evaluate(x, command).rate
        compiled = CompiledMechanism(finger.mechanism).evaluate(x, command).rate
        for kind in kinds_of(finger.mechanism):
            assert relative(compiled[:, kind], readable[:, kind]) < 1e-11


def test_a_user_s_law_acts_and_has_its_own_entry_in_the_account(own):
    result = fp.simulate(scenario("laws_of_mine:SOFT", coulomb=3e-4))
    speed = result.joint_velocity.values
    loss = 3e-4 * result.joint_reaction.values * speed / np.sqrt(1.0 + speed**2)
    np.testing.assert_allclose(result.joint_friction, loss, rtol=1e-12, atol=1e-16)
    np.testing.assert_allclose(result.power_joint_rubbing, (loss * speed).sum(axis=1), rtol=1e-9, atol=1e-16)


def test_the_coefficient_of_dahl_and_coulomb_is_what_analyses_call_stiction(tmp_path):
    for law in ("dahl", "coulomb"):
        assert scenario(law, coulomb=3e-4).finger.joint_friction.break_away == 3e-4
        written = tmp_path / f"{law}.toml"
        written.write_text(fp.to_toml(scenario(law, coulomb=3e-4)), encoding="utf-8")
        assert fp.load_scenario(written).finger.joint_friction == scenario(law, coulomb=3e-4).finger.joint_friction
        run = fp.prepare(scenario(law), ["finger.joint_friction.coulomb"])
        both = run.simulate([3e-4]), fp.simulate(scenario(law, coulomb=3e-4))
        np.testing.assert_array_equal(*(each.joint_position.values for each in both))
        assert both[0].self_locking_margin == both[1].self_locking_margin


@pytest.mark.parametrize(
    ("law", "more", "says"),
    [
        ("dall", {}, "did you mean dahl"),
        ("dahl", {"stiction": 5e-4}, "has no effect"),
        ("dahl", {"micro_damping": 1e-3}, "has no effect"),
        ("coulomb", {"stiffness": 7.0}, "has no effect"),
        ("lugre", {"reversal_speed": 0.1}, "coulomb"),
        ("dahl", {"drag_asymmetry": 0.2}, "no effect without drag"),
        ("lugre", {"drag": 1e-3, "drag_asymmetry": -1.2}, "must be at least -1"),
        ("numpy:sin", {}, "must be a Law"),
        ("no_such_module:X", {}, "cannot be imported"),
        ("laws_of_mine:MISSING", {}, "cannot be imported"),
        ("laws_of_mine:NOTHING", {}, "signals"),
        ("laws_of_mine:SOFT", {"drag": 1e-3}, "drag.*lacks it"),
        ("finger_pin.laws.capstan:DRIVEN_TENDON", {}, "parameters"),
    ],
)
def test_a_law_that_there_is_not_and_keys_that_it_does_not_have_are_refused_in_one_line(own, law, more, says):
    with pytest.raises(fp.InputError, match=says) as caught:
        fp.simulate(scenario(law, **more))
    assert "\n" not in str(caught.value) and caught.value.entry.startswith("finger.joint_friction")


def test_a_scenario_imports_no_module_unless_the_user_has_or_allows_it(own, monkeypatch, tmp_path):
    """However the scenario is read: from a table, a file, or the netCDF of a result."""
    law, mark = "laws_of_mine:SOFT", tmp_path / "ran"
    with (tmp_path / "laws_of_mine.py").open("a") as module:
        module.write(f"open({str(mark)!r}, 'w').close()\n")
    result = fp.simulate(scenario("lugre"))
    result.attrs["finger"] = result.attrs["finger"].replace('"lugre"', f'"{law}"', 1)
    assert law in result.attrs["finger"]
    doors = {
        "simulate": lambda: fp.simulate(scenario(law)),
        "finger": lambda: fp.Finger(scenario(law)),
        "view": lambda: write_animation(result, tmp_path / "page.html"),
        "summary": lambda: summarize(result),
    }
    for allowed in ("", "laws", "laws_of_mine.more"):
        monkeypatch.setenv("FINGER_PIN_LAWS", allowed)
        for name, door in doors.items():
            with contextlib.suppress(fp.InputError):
                door()
            assert not mark.exists(), name
    with pytest.raises(fp.InputError, match="import laws_of_mine first or set FINGER_PIN_LAWS=laws_of_mine") as caught:
        fp.Finger(scenario(law))
    assert "\n" not in str(caught.value)
    importlib.import_module("laws_of_mine")
    assert mark.exists() and fp.Finger(scenario(law))


SPRING, DRAG, RADII = 0.05, 0.01, {"cord": 0.01, "back": -0.01}


def dry(law, start=0.0, speed=0.0, duration=1.0, spring=SPRING, controller=None, **more):
    """Return the result of a joint with dry friction and a spring that is relaxed at 0, and its inertia."""
    numbers = {"law": law, "coulomb": 0.0, "viscous": 0.0, "drag": DRAG} | more
    numbers |= {"stiction": numbers["coulomb"]} if law == "lugre" and "stiction" not in more else {}
    joint = {"range": [-2.0, 2.0], "link": {"length": 0.1, "width": 0.01, "mass": 0.1}}
    controller = controller or {"kind": "tensions", "minimum_tension": 0.0}
    pulled = controller.get("tensions", ("cord",))
    finger = {
        "name": "dry",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {"hinge": joint | ({"spring": {"stiffness": spring}} if spring else {})},
        "tendons": {name: {"crossings": {"hinge": {"radius": RADII[name]}}} for name in pulled},
        "joint_friction": numbers,
        "tendon_friction": {"coulomb": 0.0, "viscous": 0.0},
    }
    initial = {"position": {"hinge": start}, "velocity": {"hinge": speed}}
    table = {"name": "dry", "finger": finger, "controller": controller}
    given = read_scenario(table | {"simulation": {"duration": duration, "initial": initial}})
    return fp.simulate(given), fp.Finger(given).rigid_body.mass_matrix(np.zeros(1))[0, 0]


@pytest.mark.parametrize("law", ["lugre", "dahl"])
def test_a_joint_with_a_spring_rests_anywhere_within_its_drag_over_the_stiffness(law):
    """Beyond, every half swing loses 2 d / k: from 3.5 d / k it goes to -1.5, and to -0.5, where it stays."""
    band = DRAG / SPRING
    for share in (-0.95, 0.3, 0.95):
        angle = dry(law, share * band, stiffness=50.0)[0].joint_position.values[:, 0]
        assert abs(angle - share * band).max() < 0.03 * band
    angle = dry(law, 3.5 * band, stiffness=50.0)[0].joint_position.values[:, 0]
    assert angle.min() == pytest.approx(-1.5 * band, abs=2e-3 * band)
    assert angle[-1] == pytest.approx(-0.5 * band, abs=1e-2 * band)


@pytest.mark.parametrize("law", ["lugre", "dahl", "coulomb"])
def test_drag_alone_takes_speed_at_a_constant_rate_and_what_it_takes_is_in_the_account(law):
    """I w' = -d; the kinetic energy goes to sliding, but for what bristles hold, d^2 / (2 sigma_0)."""
    more = {"reversal_speed": 1e-3} if law == "coulomb" else {"stiffness": 50.0}
    result, inertia = dry(law, speed=5.0, duration=0.1, spring=None, **more)
    speed, time = result.joint_velocity.values[:, 0], result.time.values
    np.testing.assert_allclose(speed, 5.0 - DRAG / inertia * time, atol=2e-3)
    lost = 0.5 * inertia * (25.0 - speed[-1] ** 2)
    held = 0.0 if law == "coulomb" else DRAG**2 / 100.0
    assert float(result.energy_exchanged_joint_coulomb[-1]) == pytest.approx(lost - held, rel=1e-4)


@pytest.mark.parametrize(("cord", "share"), [("cord", 1.0), ("cord", 1.3), ("back", 0.7)])
def test_drag_lets_go_at_the_ratio_of_stiction_to_coulomb_friction(cord, share):
    """A cord that pulls ever more presses the pin as well: r f = M^c f + (1 + a) d M^c / M^d, (1 - a) backwards."""
    pull = {"kind": "ramp", "height": 2.5, "time": 0.0, "duration": 2.5}
    controller = {"kind": "tensions", "tensions": {cord: pull}}
    law = {"coulomb": 2e-4, "stiction": 2.8e-4, "stiffness": 50.0, "drag_asymmetry": 0.0 if share == 1.0 else 0.3}
    result, _ = dry("lugre", duration=2.5, spring=None, controller=controller, **law)
    moves = np.flatnonzero(abs(result.joint_position.values[:, 0]) > 2e-3)[0]
    tension = float(result.tendon_command.sel(tendon=cord)[moves])
    assert tension == pytest.approx(1.4 * share * DRAG / (0.01 - 2.8e-4), rel=2e-2)


@pytest.mark.parametrize("law", ["lugre", "dahl", "coulomb"])
def test_drag_that_differs_by_direction_takes_its_part_of_a_torque_that_swings(law):
    """Of a torque that swings from 3 d to -3 d what is above d (1 + a), or below -d (1 - a), moves a damper."""
    pulls = {"cord": [3.0, 6.0, 0.0, 3.0], "back": [3.0] * 4}
    points = {"kind": "points", "times": [0.0, 1.0, 3.0, 4.0]}
    controller = {"kind": "tensions", "tensions": {name: points | {"values": pull} for name, pull in pulls.items()}}
    more = {"viscous": 0.1, "drag_asymmetry": 0.4}
    more |= {"reversal_speed": 1e-4} if law == "coulomb" else {"stiffness": 5e4}
    result, _ = dry(law, duration=4.0, spring=None, controller=controller, **more)
    torque, up, down = 0.01 * (result.tendon_command.values @ [1.0, -1.0]), 1.4 * DRAG, 0.6 * DRAG
    speed = (np.maximum(torque - up, 0.0) + np.minimum(torque + down, 0.0)) / 0.1
    # It lags by the time in which the damper stops the joint, 3 ms, and bristles spring back.
    np.testing.assert_allclose(result.joint_velocity.values[:, 0], speed, atol=0.05 * DRAG / 0.1)
    assert speed.max() > 1.5 * DRAG / 0.1 and speed.min() < -2.3 * DRAG / 0.1
    taken = np.trapezoid(np.maximum(speed, 0.0) * up - np.minimum(speed, 0.0) * down, result.time.values)
    assert float(result.energy_exchanged_joint_coulomb[-1]) == pytest.approx(taken, rel=0.02)
    assert result.power_joint_coulomb.values.min() >= 0.0


def test_the_fingers_of_a_hand_have_one_law():
    with pytest.raises(fp.InputError, match=r"one joint_friction\.law"):
        fp.load_scenario("hand", {"hand.fingers.thumb.finger.joint_friction.law": "dahl"})
