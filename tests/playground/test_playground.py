"""The playground: what is played is what the simulator computes, without a page and on one."""

import json
import time

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.playground.session import Pacer, Session, save_pieces
from finger_pin.playground.sliders import JOINTS, SCENARIO, TENDONS

STIFFNESS, DAMPING, RADIUS = 0.05, 2e-3, 0.008

# One joint with a spring, one tendon, nothing that rubs or weighs: at rest theta = r f / k.
HINGE = f"""
name = "hinge"
[finger]
name = "hinge"
gravity = [0.0, 0.0, 0.0]
joints.knuckle.range = [-0.5, 1.5]
joints.knuckle.spring = {{ stiffness = {STIFFNESS}, damping = {DAMPING} }}
joints.knuckle.link = {{ length = 0.04, width = 0.012, mass = 0.01 }}
tendons.flexor.crossings.knuckle = {{ radius = {RADIUS}, bends = true }}
tendon_friction.coulomb = 0.0
joint_friction = {{ coulomb = 0.0, stiction = 0.0 }}
[controller]
kind = "tensions"
[simulation]
duration = 1.0
"""


@pytest.fixture
def hinge(tmp_path):
    path = tmp_path / "hinge.toml"
    path.write_text(HINGE)
    return path


def run(session, duration):
    for _ in range(round(duration / session.inputs.period)):
        session.step()


def test_a_tension_turns_a_joint_until_its_spring_balances_it(hinge):
    session = Session(hinge, rtol=1e-6)
    session.move(TENDONS, 0, 3.0)
    run(session, 3.0)
    assert session.simulator.state.position[0] == pytest.approx(3.0 * RADIUS / STIFFNESS, rel=1e-3)


@pytest.mark.slow
def test_a_spring_at_the_tip_pulls_with_its_stiffness(hinge):
    session = Session(hinge, rtol=1e-6)
    tip = session.tips[0]
    session.handles[0], session.stiffness = tip + np.array([0.0, 0.01, 0.0]), 30.0
    np.testing.assert_allclose(session.force(), [[0.0, 0.3, 0.0]], atol=1e-12)
    session.move(TENDONS, 0, 0.5)
    run(session, 3.0)
    # At rest the joint's spring balances the tendon and the spring at the tip.
    angle, force = session.simulator.state.position[0], session.force()[0]
    arm = session.finger.rigid_body.jacobian(session.simulator.state.position)[:, 0]
    assert abs(angle) > 0.05
    assert arm @ force + 0.5 * RADIUS == pytest.approx(STIFFNESS * angle, rel=1e-3)
    assert arm @ force > 1e-4
    session.reset()
    assert not session.force().any()


def test_joint_references_are_reached_and_followers_follow():
    session = Session("reversals", rtol=1e-4)
    goal = np.array([0.05, 0.5, 0.7])
    for index, angle in enumerate(goal):
        session.move(JOINTS, index, angle)
    run(session, 1.0)
    desired = session.scenario.coupling(session.finger.routing)
    base = np.append(goal, 0.0)
    # What friction and gravity leave of an error under a proportional controller of 1 N m/rad.
    np.testing.assert_allclose(session.simulator.state.position, desired.matrix @ base + desired.offset, atol=0.05)


def test_friction_that_is_changed_acts_as_if_it_had_been_there():
    session = Session("reversals", rtol=1e-6)
    run(session, 0.3)
    x, time_, before = session.simulator.x, session.simulator.time, session.finger
    session.change(0, 0.4)
    other = fp.Simulator(
        fp.load_finger("ub_stand_in", {"finger.tendon_friction.coulomb": 0.4}),
        method="Rodas4",
        rtol=1e-6,
        atol_scale=1e-6,
    )
    other.reset(x)
    loop = ClosedLoop.from_scenario(fp.load_scenario("reversals"))
    for step in range(100):
        state, now = other.state, time_ + 1e-3 * step
        plan = loop.controller.command(now, loop.reference.at(now), state.position, state.velocity)
        other.step(plan.tension[:4], 1e-3)
    run(session, 0.1)
    np.testing.assert_allclose(session.simulator.x, other.x, rtol=1e-6, atol=1e-9)
    unchanged = fp.Simulator(before, method="Rodas4", rtol=1e-6, atol_scale=1e-6)
    unchanged.reset(x)
    unchanged.step(plan.tension[:4], 0.1)
    assert np.abs(unchanged.x - other.x).max() > 1e-3


def test_what_is_not_allowed_leaves_the_finger_as_it_was():
    session = Session("reversals", keys=["finger.joint_friction.stiction"])
    x = session.simulator.x
    with pytest.raises(fp.InputError, match="stiction"):
        session.change(len(session.parameters) - 1, 0.0)
    assert (session.simulator.x == x).all()
    assert session.finger.description.joint_friction.stiction == fp.load_finger("ub_stand_in").joint_friction.stiction
    with pytest.raises(fp.InputError, match="T1 = 30"):
        session.move(TENDONS, 0, 30.0)


def test_a_record_is_the_run_of_a_simulator_under_the_same_inputs_bit_by_bit(tmp_path):
    session = Session("reversals")
    start, given, step = session.simulator.x, [], session.simulator.step
    session.simulator.step = lambda *arguments: given.append([np.copy(each) for each in arguments]) or step(*arguments)
    session.record()
    run(session, 0.05)
    session.move(TENDONS, 2, 8.0)
    session.handles[0] = session.tips[0] + 0.01
    run(session, 0.05)
    (piece,) = session.stop()
    (path,) = save_pieces([piece], tmp_path / "play", "reversals")
    plain = fp.Simulator(fp.Finger("ub_stand_in"), method="Rodas4", rtol=1e-3, atol_scale=1e-3)
    plain.reset(start)
    plain.x = start
    for command, period, force in given:
        plain.step(command, float(period), force)
    assert (plain.x == session.simulator.x).all()
    assert plain.result().equals(fp.load(path))
    assert path.name == "reversals-1.nc"
    assert float(np.abs(fp.load(path).fingertip_force).max()) > 0.1


def test_a_record_has_a_piece_for_every_change_of_the_finger(tmp_path):
    session = Session("reversals")
    session.record()
    run(session, 0.01)
    session.change(0, 0.3)
    run(session, 0.02)
    pieces = session.stop()
    paths = save_pieces(pieces, tmp_path, "reversals")
    lasts = [float(fp.load(path).time[-1]) for path in paths]
    assert lasts == pytest.approx([0.01, 0.03])
    frictions = [json.loads(fp.load(path).attrs["finger"])["tendon_friction"]["coulomb"] for path in paths]
    assert frictions == [0.11, 0.3]
    with pytest.raises(fp.InputError, match="record"):
        session.stop()


@pytest.mark.slow
def test_servos_in_position_drive_wind_as_in_a_simulation():
    session = Session("wound", rtol=1e-6)
    whole = fp.simulate(fp.load_scenario("wound", {"simulation.duration": 1.0}))
    run(session, 1.0)
    assert session.inputs.kind == SCENARIO
    found, expected = session.simulator.state, whole.isel(time=-1)
    np.testing.assert_allclose(found.motor_position, expected.motor_position, atol=2e-3)
    np.testing.assert_allclose(found.position, expected.joint_position, atol=2e-3)
    assert abs(float(expected.joint_position[0])) > 0.1


def test_damping_of_light_links_is_that_of_a_simulation():
    scenario = fp.load_scenario("reversals", {"controller.damping": 0.01, "simulation.duration": 0.3})
    session = Session(scenario, rtol=1e-5)
    run(session, 0.3)
    expected = fp.simulate(scenario).isel(time=-1)
    np.testing.assert_allclose(session.simulator.state.position, expected.joint_position, atol=3e-3)
    assert session.reading().tension.max() < 1.5 * float(expected.tendon_tension.max())


def test_friction_in_use_is_bristle_force_over_its_level():
    session = Session("reversals")
    run(session, 0.2)
    found, reading = session.signals(), session.reading()
    np.testing.assert_allclose(reading.tendon_use, np.abs(found.state.tendon_stiction) / found.at_all_places("level"))
    np.testing.assert_allclose(
        reading.joint_use, np.abs(found.state.joint_stiction) / found.rows["joint_friction"]["level"]
    )
    assert 0.9 < reading.tendon_use.max() < 1.3


class Clock:
    now = 5.0

    def __call__(self):
        return self.now


@pytest.mark.parametrize(("cost", "rate"), [(0.1, 1.0), (4.0, 0.25)])
def test_time_runs_as_fast_as_asked_or_slower_and_says_so(cost, rate):
    clock = Clock()
    pacer = Pacer(clock)
    for _ in range(300):
        clock.now += pacer.idle_time()
        due, done = pacer.start_frame(), 0.0
        while done + 1e-3 <= due and not pacer.is_late:
            clock.now += cost * 1e-3
            done += 1e-3
        pacer.finish_frame(done)
    assert pacer.rate == pytest.approx(rate, rel=0.05)
    assert pacer.is_slow == (rate < 1.0)


def test_a_scenario_that_cannot_be_played_is_refused_in_one_line():
    with pytest.raises(fp.InputError, match=r"controller\.sampling: cannot be played"):
        Session(fp.load_scenario("reversals", {"controller.sampling.period": 1e-3}))
    with pytest.raises(fp.InputError, match=r"simulation\.start_time = 1\.0: must be 0"):
        Session(fp.load_scenario("reversals", {"simulation.start_time": 1.0}))
    with pytest.raises(fp.InputError, match="cannot change while it is played"):
        Session("press", keys=["environment.objects.plate.surface.friction"])


@pytest.mark.parametrize("name", ["servo", "stick_slip", "press", "underactuated", "hand"])
def test_shipped_scenarios_are_played(name):
    session = Session(name)
    run(session, 0.02)
    for kind in session.inputs.kinds:
        session.choose(kind)
        run(session, 0.01)
    reading = session.reading()
    assert np.isfinite(reading.position).all() and np.isfinite(reading.tension).all()
    assert reading.time == pytest.approx(0.02 + 0.01 * len(session.inputs.kinds))


def until(condition, patience=120.0):
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, "the page did not react"
        time.sleep(0.05)


def test_a_slider_on_the_page_moves_a_joint(browser, loaded, tmp_path):
    pytest.importorskip("viser", reason="needs viser, which the extra 'play' brings")
    with fp.play("reversals", block=False, open_browser=False, folder=tmp_path) as playground:
        assert playground.url.startswith("http://127.0.0.1:")
        assert playground.url in playground._repr_html_()
        session = playground.session
        browser.get_log("browser"), loaded()
        browser.get(playground.url)
        until(lambda: session.simulator.time > 0.2)
        thumb = "//label[text()='proximal, °']/ancestor::div[.//input][1]//*[@role='slider']"
        until(lambda: browser.find_elements("xpath", thumb))
        # The key End, for 90 degrees.
        browser.find_element("xpath", thumb).send_keys("\ue010")
        until(lambda: session.inputs.kind == JOINTS)
        until(lambda: abs(session.simulator.state.position[1] - np.pi / 2.0) < 0.1)
        for name in ("Record", "Stop and save"):
            button = f"//button[.//*[text()='{name}']]"
            until(lambda button=button: browser.find_elements("xpath", button))
            browser.find_element("xpath", button).click()
        until(lambda: playground.message.startswith("saved: "))
        assert fp.load(tmp_path / "reversals-1.nc").joint_position[-1, 1] == pytest.approx(np.pi / 2.0, abs=0.2)
        errors = [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]
        assert not errors
        assert {*loaded()} == {playground.url}
        browser.get("about:blank")
    playground.close()
