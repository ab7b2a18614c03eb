"""Every door takes what the others take: a scenario, its name or the path of its file; a finger likewise."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.mechanism.coerce import as_finger, description_of
from finger_pin.simulation.energy import account_entries

SHORT = {"simulation.duration": 0.005}
COULOMB = "finger.tendon_friction.coulomb"


def swept(given, **more):
    runs = fp.sweep(given, {"simulation.duration": [0.005]}, metrics=["tension_peak"], **more)
    return float(runs.tension_peak.squeeze())


def optimised(given, **more):
    effort = fp.studies.optimisation.Effort(4, 1)
    found = fp.optimise(given, ["controller.gain=1:1.1"], constraints=[], effort=effort, **more)
    return float(found.tension_peak[0])


def proposed(given, **more):
    numbers = {COULOMB: (0.01, 1.0)}
    return float(fp.propose(given, {"as it is": {}}, numbers, {"tendon_tension.T1": 0.05}, **more).deviation.squeeze())


def learned(given, **task):
    """Return the observations of an episode, under numbers that are drawn if there are any."""
    from finger_pin.learning import Environment

    environment = Environment(given, reward=lambda signals: np.zeros(1), **task)
    environment.reset(seed=1)
    return np.array([environment.step(np.array([1.0, 1.0, 4.0, 3.0]))[0] for _ in range(2)])


#: Every door that takes a scenario, with what comes out.
DOORS = {
    "simulate": lambda given: fp.simulate(given).joint_position.values,
    "prepare": lambda given: fp.prepare(given).run()["joint_position"],
    "simulate_many": lambda given: fp.simulate_many([given]).joint_position.values,
    "check_convergence": lambda given: fp.check_convergence(given).difference,
    "sweep": swept,
    "optimise": optimised,
    "propose": proposed,
    "self_locking_margin": lambda given: fp.analysis.self_locking_margin(given, samples=5).margin,
    "linearise": lambda given: (
        fp.linearise(given, fp.Finger("ub_stand_in").rest_state(POSTURE), [1.0, 1.0, 4.0, 3.0]).A.values
    ),
    "build_controller": lambda given: fp.control.build_controller(given).gain,
    "Run": lambda given: fp.studies.METRICS["tension_peak"].measure(fp.studies.Run(given)),
    "Environment": learned,
    "load_scenario": lambda given: fp.simulate(fp.load_scenario(given, {"controller.gain": 0.7})).joint_position.values,
}
#: Every door that takes a scenario and a finger in place of its own, with the largest tension.
WITH_FINGER = {
    "simulate": lambda given, finger: peak(fp.simulate(given, finger=finger)),
    "prepare": lambda given, finger: peak(fp.prepare(given, finger=finger).simulate()),
    "simulate_many": lambda given, finger: peak(fp.simulate_many([given], finger=finger)),
    "sweep": lambda given, finger: swept(given, finger=finger),
    "optimise": lambda given, finger: optimised(given, finger=finger),
}
POSTURE = np.array([0.0, 0.3, 0.4, 0.3])
#: Every door that takes a finger.
FINGERS = {
    "Simulator": lambda given: fp.Simulator(given, position=POSTURE).step([1.0, 1.0, 4.0, 3.0], 1e-3).position,
    "closure_over_range": lambda given: fp.analysis.closure_over_range(given, samples=8).holds,
    "critical_friction": lambda given: fp.analysis.critical_friction(given).coefficient,
    "equilibrium": lambda given: fp.analysis.equilibrium(given, [1.0, 1.0, 4.0, 3.0]).position,
    "force_polytope": lambda given: fp.analysis.force_polytope(given, POSTURE, 20.0).offsets,
    "gear_shares": fp.analysis.gear_shares,
    "inverse_kinematics": lambda given: fp.analysis.inverse_kinematics(given, [0.08, 0.0, 0.04]).position,
    "steady_state": lambda given: fp.analysis.steady_state(given, np.ones((1, 4)), np.array([0.01])).tension,
    "tension_limits": lambda given: np.array(fp.analysis.tension_limits(given)),
    "radii": lambda given: [each.range.low for each in fp.studies.radii(given)],
    "simulate": lambda given: peak(fp.simulate(fp.load_scenario("reversals", SHORT), finger=given)),
    "posture_page": lambda given: page_of(given),
}


def page_of(given):
    from finger_pin.views.viewer.animation import posture_page

    return posture_page(given, fp.analysis.force_polytope("ub_stand_in", POSTURE, 20.0))


def peak(result):
    """Return the largest tension at either end of any tendon."""
    return float(
        max(result.tendon_tension.max(), result.tendon_command[..., :4].max(), result.passive_tension_proximal.max())
    )


def same(one, other):
    if isinstance(one, str):
        assert one == other
    else:
        np.testing.assert_array_equal(one, other)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A scenario and a finger, each in a file."""
    folder = tmp_path_factory.mktemp("doors")
    (folder / "short.toml").write_text('extends = "reversals"\n[simulation]\nduration = 0.005\n')
    (folder / "ub.toml").write_text(fp.to_toml(fp.load_finger("ub_stand_in")))
    return folder / "short.toml", folder / "ub.toml"


@pytest.mark.slow
@pytest.mark.parametrize("door", DOORS.values(), ids=DOORS.keys())
def test_a_scenario_and_the_path_of_its_file_do_the_same(door, files):
    same(door(fp.load_scenario("reversals", SHORT)), door(str(files[0])))


@pytest.mark.slow
@pytest.mark.parametrize("door", FINGERS.values(), ids=FINGERS.keys())
def test_a_finger_its_description_its_name_and_the_path_of_its_file_do_the_same(door, files):
    expected = door(fp.Finger("ub_stand_in"))
    for given in (fp.load_finger("ub_stand_in"), "ub_stand_in", files[1], str(files[1])):
        same(door(given), expected)


@pytest.fixture(scope="module", params=["name", "description", "hand", "file", "file with a base"])
def hand(request, tmp_path_factory):
    """The hand that ships, in every way in which a hand can be given."""
    path = tmp_path_factory.mktemp("hands") / "own.toml"
    path.write_text(fp.to_toml(fp.load_hand("ub_hand")) if request.param == "file" else 'base = "ub_hand"')
    ways = {"name": "ub_hand", "description": fp.load_hand("ub_hand"), "hand": fp.Hand("ub_hand")}
    return ways.get(request.param, path)


@pytest.mark.slow
def test_a_hand_is_taken_where_a_finger_is(hand):
    assert fp.Simulator(hand).finger.routing.joints == tuple(fp.load_scenario("hand").finger.joints)
    assert fp.analysis.closure_over_range(hand, samples=2).holds


def test_of_a_scenario_its_finger_or_hand_is_taken(tmp_path):
    own = tmp_path / "thick.toml"
    own.write_text('extends = "reversals"\n[finger]\nbase = "ub_stand_in"\njoints.distal.link.length = 0.025')
    assert fp.Finger(own).description == fp.load_finger("ub_stand_in", {"finger.joints.distal.link.length": 0.025})
    assert fp.Simulator("hand").finger.description == fp.load_hand("ub_hand")
    own.write_text('[finger]\nbase = "ub_stand_in"\njoints.distal.link.lenght = 0.025')
    with pytest.raises(fp.InputError, match=r"^finger\.joints\.distal\.link\.lenght: unknown key"):
        fp.Finger(own)


def test_a_misspelt_hand_is_told_the_nearest_of_fingers_and_hands():
    with pytest.raises(fp.InputError, match=r"no such finger or hand; .*did you mean ub_hand\?"):
        fp.Hand("ub_hnd")


def test_files_of_other_programs_are_written_of_a_name(files):
    assert fp.to_urdf("ub_stand_in") == fp.to_urdf(files[1]) == fp.to_urdf(fp.load_finger("ub_stand_in"))
    assert fp.to_mjcf("ub_hand") == fp.to_mjcf(fp.load_hand("ub_hand"))


@pytest.fixture(scope="module")
def heavy():
    return fp.Finger(fp.load_finger("ub_stand_in", {"finger.joints.medial.link.mass": 0.2, COULOMB: 0.3}))


@pytest.mark.parametrize("door", WITH_FINGER.values(), ids=WITH_FINGER.keys())
def test_a_finger_of_ones_own_replaces_the_scenarios(door, heavy):
    scenario = fp.load_scenario("reversals", SHORT)
    expected = peak(fp.simulate(scenario, finger=heavy))
    assert expected != peak(fp.simulate(scenario))
    assert door(scenario, heavy) == door(scenario, heavy.description) == expected


def test_what_would_be_learned_is_that_of_a_finger_of_ones_own(heavy):
    scenario = fp.load_scenario("reversals", SHORT)
    described = fp.load_scenario("reversals", SHORT | {"finger.joints.medial.link.mass": 0.2, COULOMB: 0.3})
    assert proposed(scenario, finger=heavy) == pytest.approx(proposed(described), rel=0.05)
    assert proposed(scenario, finger=heavy) != proposed(scenario)


@pytest.mark.parametrize("drawn", [None, 0.1])
def test_an_environment_of_a_finger_of_ones_own_is_that_of_one_described_so(heavy, drawn):
    from finger_pin.learning import Choice

    task = {"randomise": {COULOMB: Choice([drawn])}} if drawn else {}
    scenario = fp.load_scenario("reversals", SHORT)
    described = fp.load_scenario("reversals", SHORT | {"finger.joints.medial.link.mass": 0.2, COULOMB: 0.3})
    expected = learned(described, **task)
    assert (expected != learned(scenario, **task)).any()
    for given in (heavy, heavy.description):
        same(learned(scenario, finger=given, **task), expected)


def test_rows_of_ones_own_stay_where_numbers_of_an_environment_are_drawn():
    """A spring that pulls the medial joint, as the simulator has it."""
    from finger_pin.learning import Choice

    def slopes(row, p, signals):
        return (-p[0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0,) * 6

    law = fp.Law(
        "spring",
        ("stiffness",),
        lambda row, p: (-p[0] * row.length, 0.0 * row.length),
        slopes,
        lambda row, p, force, rate, signals: (p[0] * row.length**2 / 2.0,),
    )
    arm = np.eye(1, fp.Finger("ub_stand_in").mechanism.coordinates, 2)
    rows = [fp.Rows("spring", law, ("medial",), [[0.1]], arm)]
    scenario = fp.load_scenario("reversals")
    found = learned(scenario, finger=fp.Finger("ub_stand_in", rows=rows), randomise={COULOMB: Choice([0.1])})
    settings = scenario.simulation
    changed = fp.Finger(fp.load_finger("ub_stand_in", {COULOMB: 0.1}), rows=rows)
    sim = fp.Simulator(changed, method=settings.method, rtol=settings.rtol, atol_scale=settings.atol_scale)
    sim.reset(fp.prepare(scenario).start)
    for each in found:
        same(each[:4], np.float32(sim.step([1.0, 1.0, 4.0, 3.0], 0.02).position))


def test_convergence_is_that_of_a_finger_of_ones_own(heavy):
    scenario = fp.load_scenario("reversals", SHORT)
    assert fp.check_convergence(scenario, fp.simulate(scenario, finger=heavy), finger=heavy).converged


def test_a_sweep_over_keys_of_a_finger_changes_one_of_ones_own(tmp_path, heavy):
    """It keeps what is not swept; and its folder does not take the runs of another finger for its own."""

    def swept(finger, output):
        points = {COULOMB: [0.1, 0.3]}
        return fp.sweep("reversals", points, metrics=["losses"], overrides=SHORT, finger=finger, output=output).losses

    scenario = fp.load_scenario("reversals", SHORT)
    own, expected = swept(heavy, tmp_path), fp.simulate(scenario, finger=heavy)
    assert float(own[1]) == sum(float(each[-1]) for each in account_entries(expected, "lost").values())
    assert float(own[0]) not in (float(own[1]), float(swept(None, None)[0]))
    np.testing.assert_array_equal(swept(None, tmp_path), swept(None, None))


def test_values_at_keys_of_a_finger_change_one_of_ones_own():
    plain = fp.prepare("reversals", ["finger.tendon_friction.coulomb"])
    own = fp.prepare("reversals", ["finger.tendon_friction.coulomb"], finger=fp.Finger("ub_stand_in"))
    for values in (None, [0.2]):
        np.testing.assert_array_equal(own.run(values)["tendon_tension"], plain.run(values)["tendon_tension"])


def test_what_a_loop_of_ones_own_needs_stands_at_the_front_door():
    assert issubclass(fp.InputError, fp.FingerPinError) and fp.Law.__name__ == "Law" and fp.Rows.__name__ == "Rows"


STIFFNESS = "environment.objects.plate.surface.stiffness"
#: Every door that gives other numbers to a scenario with a finger that is built already.
WITH_NUMBER = {
    "prepare": lambda given, stiffness, finger=None: (
        fp.prepare(given, [STIFFNESS], finger=finger).run([stiffness])["joint_position"].tolist()
    ),
    "sweep": lambda given, stiffness, finger=None: fp.sweep(
        given, {STIFFNESS: [stiffness]}, metrics=["tension_peak"], finger=finger
    ).tension_peak.values.tolist(),
    "propose": lambda given, stiffness, finger=None: fp.propose(
        given, {"": {}}, {STIFFNESS: (stiffness, 2.0 * stiffness)}, {"tendon_tension.T1": 0.05}, finger=finger
    ).deviation.values.tolist(),
    "Environment": lambda given, stiffness, finger=None: touched(given, stiffness, finger),
}


def touched(given, stiffness, finger):
    from finger_pin.learning import Choice

    return learned(given, finger=finger, randomise={STIFFNESS: Choice([stiffness])}).tolist()


@pytest.mark.parametrize("door", WITH_NUMBER.values(), ids=WITH_NUMBER.keys())
def test_numbers_of_objects_change_those_around_a_finger_of_ones_own(door):
    """A plate that the tip presses from the start on; the finger was built with it."""
    plate = {"environment.objects.plate.position": [0.0, 0.0, 0.0295]}
    scenario = fp.load_scenario("press", SHORT | plate)
    finger = fp.Finger(scenario.finger, objects=scenario.environment.objects)
    soft, hard = (door(scenario, stiffness, finger) for stiffness in (1e4, 1e6))
    assert soft != hard and hard == door(scenario, 1e6)


def test_numbers_of_objects_that_a_finger_of_ones_own_has_not_are_refused():
    with pytest.raises(fp.InputError, match=r"environment\.objects"):
        fp.prepare("press", [STIFFNESS], finger=fp.Finger("ub_stand_in")).run([1e5])


def test_numbers_of_a_hand_are_refused_where_another_one_was_given():
    key = "hand.fingers.left.finger.tendon_friction.coulomb"
    other = fp.Hand(fp.load_scenario("pinch", {key: 0.3}).finger)
    with pytest.raises(fp.InputError, match="hand"):
        fp.prepare("pinch", [key], finger=other).run([0.2])


def test_a_scenario_stands_for_its_finger_as_its_name_does():
    scenario = fp.load_scenario("reversals", {"finger.tendon_friction.coulomb": 0.3})
    for finger in (fp.Finger(scenario), fp.Simulator(scenario).finger, as_finger(scenario)):
        assert finger.description == scenario.finger != fp.load_finger("ub_stand_in")
    assert description_of(scenario) == scenario.finger
    assert description_of(fp.load_scenario("hand")) == fp.load_hand("ub_hand")
