"""Every number and flag of a scenario: it acts, is refused, or a reason stands here why it may do nothing."""

import re
import tomllib
from functools import partial

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.position_drive import PositionDrives, loop_period, spool_goals, spool_windings, voltage_signals
from finger_pin.description.loading import read_scenario, to_toml
from finger_pin.description.tables import list_scenarios
from finger_pin.exceptions import InputError

# States at which x' is compared; with many objects the first ones alone, which take long there.
INSTANTS, FEW, MANY = 8, 2, 100
# Imported below from MuJoCo, with what shipped scenarios have not.
HAND = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <site name="s0" pos="-0.02 0 0.01"/>
    <body name="one"><joint name="j1" axis="0 1 0" range="-1 1.5" stiffness="0.02" springref="0.1"/>
      <geom name="g1" type="capsule" size="0.006" fromto="0 0 0 0.04 0 0" mass="0.02"/>
      <site name="s1" pos="0.02 0 0.009"/>
      <body name="two" pos="0.04 0 0"><joint name="j2" axis="0 1 0" range="-1 1.5"/>
        <geom name="g2" type="capsule" size="0.006" fromto="0 0 0 0.03 0 0" mass="0.01"/>
        <site name="s2" pos="0.02 0 0.009"/>
        <body name="three" pos="0.03 0 0"><joint name="j3" axis="0 1 0" range="-1 1.5" armature="1e-5"/>
          <geom name="g3" type="capsule" size="0.006" fromto="0 0 0 0.02 0 0" mass="0.006"/></body></body></body>
    <geom name="table" type="plane" size="1 1 0.1" pos="0 0 -0.0055"/>
  </worldbody>
  <tendon>
    <spatial name="cord" stiffness="50" damping="0.1" springlength="0.02" frictionloss="0.01">
      <site site="s0"/><site site="s1"/><site site="s2"/></spatial>
    <fixed name="sum" stiffness="5" springlength="0.001">
      <joint joint="j1" coef="0.01"/><joint joint="j2" coef="0.005"/></fixed>
  </tendon>
  <equality><joint joint1="j3" joint2="j2" polycoef="0 0.7 0 0 0"/></equality>
  <actuator><position name="servo" tendon="cord" kp="200" kv="1" ctrlrange="0 0.1"/>
    <motor name="turn" joint="j1" gear="0.5" ctrlrange="-1 1"/></actuator>
  <keyframe><key name="bent" qpos="-0.2 -0.3 -0.21" ctrl="0.05 0.1"/></keyframe>
</mujoco>
"""
_SINE = ("amplitude", "frequency", "phase")
_WAVE = {"offset": 0.05, "amplitude": 0.2, "frequency": 20.0, "phase": 0.3}
_LOOP = {f"controller.{name}.servo.{key}": 0.3 for name in ("spool_angle", "supply_voltage") for key in _SINE}
_LOOP |= {"controller.supply_voltage.servo.offset": 4.0, "finger.joint_friction.drag": 1e-3}


def imported():
    finger = fp.from_mujoco(__import__("mujoco").MjModel.from_xml_string(HAND))
    table = {
        "name": "imported",
        "finger": finger.model_dump(mode="python", exclude_none=True),
        "controller": {"kind": "tensions", "inputs": {"servo": _WAVE, "turn": {**_WAVE, "amplitude": 3.0}}},
        "simulation": {"duration": 0.05},
    }
    return read_scenario(table)


# `pour` is `hand` with more of the objects of `grasp`, and takes as long as all others together.
SCENARIOS = {name: partial(fp.load_scenario, name) for name in list_scenarios() if name != "pour"} | {
    "imported": imported,
    "wound": partial(fp.load_scenario, "wound", _LOOP),
}

# The keys that are tried at once begin with these; what acts in one scenario may then do nothing in another.
PARTS = (".tree", ".joints", "hand", "")


def shared(key):
    """Return a key without its place: a finger alone and on a hand have the same keys, and so have all surfaces."""
    return re.sub(r"^(hand\.fingers\.)?finger|.*\.surface(?=\.)", "", key)


def part_of(key):
    """Return the first of the parts to which a key belongs, the same in all scenarios."""
    return next(part for part in PARTS if shared(key).startswith(part))


def leaves(value, path=()):
    """Yield places and values of numbers and flags."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for key, each in items:
        yield from leaves(each, (*path, key))
    if isinstance(value, bool | int | float):
        yield path, value


def others(value):
    """Return other values than one, in the order in which they are tried."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1]
    return [1.1 * value, 0.9 * value] if value else [0.1, -0.1, 1e-3]


def changed(table, path, value):
    """Return a table with another value at one place."""
    if not path:
        return value
    whole = dict(table) if isinstance(table, dict) else list(table)
    whole[path[0]] = changed(whole[path[0]], path[1:], value)
    return whole


def kind(scenario):
    return scenario.hand is None, scenario.finger.tree is None, not scenario.finger.actuators


# NaN stands where a drive is given no voltage.
equal = partial(np.array_equal, equal_nan=True)


class Acts:
    """All that a scenario makes of itself: sizes, start, knots, x' at random states, and voltages' loops."""

    def __init__(self, scenario):
        """Draw the states."""
        self.loop = ClosedLoop.from_scenario(scenario)
        self.layout = self.loop.finger.layout
        rng, duration = np.random.default_rng(1), scenario.simulation.duration
        self.times = duration * (np.arange(INSTANTS) + rng.uniform(size=INSTANTS)) / INSTANTS
        rest = [self.loop.rest_state(at.position, at.velocity) for at in map(self.loop.reference.at, self.times)]
        spread = np.array([0.0, 1e-3, 1e-2, 1e-3, 0.1, 0.3, 1.0, 0.0])[:, None]
        noise = rng.normal(size=(INSTANTS, self.layout.size))
        self.states = np.array(rest) + spread * noise * self.layout.scales()
        # At the reference, bent bristles; beyond either end of the strokes, at rest.
        self.states[0] += rng.normal(size=self.layout.size) * self.layout.scales() * (self.states[0] == 0.0)
        strokes = np.array([joint.range for joint in scenario.finger.joints.values()]).T
        ends = self.layout.unpack(self.states[-2:])
        ends.position[:], ends.velocity[:] = strokes + np.array([[-0.15], [0.15]]), [[-0.3], [0.3]]
        # Contacts that slide.
        self.layout.unpack(self.states[:4]).contact_bend[:] = 1e-2
        self.own = list(self.of(scenario))

    def of(self, scenario):
        """Yield them one by one: most changes show in the first."""
        loop = ClosedLoop.from_scenario(scenario)
        yield np.array([loop.finger.layout == self.layout])
        yield from (loop.initial_state(), loop.knots(1e-6), scenario.sample_times())
        at = self.layout.unpack(self.states[0])
        yield loop.finger.motion(at.position, at.velocity).tip
        most = FEW if len(self.layout.names_of("contact_bend")) > 2 * MANY else INSTANTS
        for part in (slice(1), slice(1, most)):
            yield loop.evaluate(self.times[part], self.states[part]).finger.rate
        if np.any(loop.finger.actuators.holds):
            yield from self.drives(scenario, loop)

    def drives(self, scenario, loop):
        """Yield goals and voltages that are given at the instants, and the loops as they are compiled."""
        start, times = scenario.simulation.start_time, self.times
        wound = spool_windings(scenario, loop.finger)
        given, supplies = (voltage_signals(scenario, loop.finger, f"{name}_voltage") for name in ("motor", "supply"))
        yield spool_goals(loop.finger, loop.controller, times, loop.reference.at(times), wound, start)
        yield from (signal.starting_at(start).at(times)[0] for signal in given.values())
        # The first samples alone, as the paths of a tree take long for thousands of goals.
        short = FEW * loop_period(loop.finger)
        planned = loop.finger, loop.controller, loop.reference, short, start, wound, given, supplies
        made = PositionDrives(*planned).compiled
        names = ("goals", "prescribed_voltages", "gains", "period", "resolution", "supply")
        yield from (np.asarray(getattr(made, name)) for name in names)


# Keys that may do nothing in any scenario here, and why.
NEVER = {
    r"simulation\.(rtol|atol_scale)": "accuracy alone",
    r"hand\.palm\.(size|centre)": "pictures",
    r".*\.solids\..*": "pictures",
    r"hand\.fingers\.finger\.gravity": "hand.gravity takes its place, as its page says",
    r".*\.encoder\.range": "a bound: goals beyond it are refused",
    r".*\.surface\.(floor|stiction_ratio|stribeck_velocity)": "acts just as a contact begins to slide, or to touch",
    r".*\.limit_stiffness": "an imported tendon has it written out, with a range or without",
    r".*joints\.link\.axial_inertia": "of a link that only turns across its axis",
    r".*keyframes\.inputs": "where controller.inputs says otherwise",
    r".*tree\.tendons\.rest": "of a spring without stiffness, or the end that is not reached",
}
# Keys that do nothing in some scenarios, and have to act in others.
SOMETIMES = {
    r".*\.(frequency|phase|amplitude)": "a sinusoid needs an amplitude, and a frequency or a phase",
    r".*\.(gravity|fingertip_force)": "where no joint is moved by it",
    r".*joints\.link\.(width|twist)": "of a link that touches nothing; of the last, after which there is none",
    r".*friction\.(floor|stribeck_velocity|coulomb|stiction_ratio|drag_asymmetry)": "no bend, drag, or stiction",
    r".*motor\.(voltage|maximum_current|encoder\.resolution)": "limits that are not reached",
    r".*actuators\.reversal_speed": "without compensation",
    r".*\.(objects|shapes)\..*": "what touches nothing at these instants, or is turned about its own axis",
    r".*bodies\.(centre|inertia)": "of a body that turns about one axis",
    r".*bodies\.(position|orientation)": "of a body that slides, and that no path passes",
    r".*tree\.joints\.axis": "of a slide whose body nothing touches and no path passes, without gravity",
    r".*bodies\.gravity_compensation": "without gravity",
    r"controller\.gravity_compensation": "without gravity",
    r".*\.(bearing|tendons\.joints)": "that nothing loads",
    r"finger\.tendons\.(crossings\.)?(bends|curvature_offset)": "of a tendon without friction",
    r".*\.input_range": "limits that are not reached",
    r"simulation\.start_time": "where inputs are constant",
    r"hand\.palm\.path\..*": "a place in the world where nothing stands, or a time at which nothing is compared",
    r".*\.joints\.anchor": "moved along the axis",
    r"controller\.minimum_tension": "one of a list, of a tendon that has tensions of its own",
    r".*stroke_limiter.*|.*joints\.(range|limited)": "ends that are not reached at these instants",
}


def names_in(described):
    """Yield the names that a user gives, in tables by name."""
    for field in type(described).model_fields:
        value = getattr(described, field)
        if isinstance(value, dict):
            yield from (part for key in value for part in str(key).split("."))
        for each in value.values() if isinstance(value, dict) else [value]:
            if hasattr(each, "model_fields_set"):
                yield from names_in(each)


def tried(scenario, part, acting):
    """Yield key, what becomes of a change, and place: of one finger, servo, shape and ball of many."""
    alike = list(scenario.finger.actuators)[1:] if scenario.hand is None else []
    table, names, acts = scenario.model_dump(mode="python", exclude_none=True), {*names_in(scenario)}, Acts(scenario)
    crowd = [name for name in scenario.environment.objects or () if re.fullmatch("ball_[1-9]", name)]
    bodies = list(scenario.finger.tree.bodies.values())[1:] if scenario.finger.tree else []
    alike += [shape for body in bodies for shape in body.shapes]
    skipped = {*crowd, *alike, *(list(scenario.hand.fingers)[1:] if scenario.hand else ())}
    crowded = len(acts.layout.names_of("contact_bend")) > 2 * MANY
    for path, value in leaves(table):
        if skipped & {*path} or (crowded and path[:2] == ("hand", "fingers")):
            continue
        key = ".".join(each for each in path if isinstance(each, str) and each not in names)
        kinds = acting.get(shared(key), ())
        idle = NEVER | SOMETIMES if kinds else NEVER
        if part_of(key) != part or kind(scenario) in kinds or any(re.fullmatch(each, key) for each in idle):
            continue
        found = set()
        for other in others(value):
            try:
                read = read_scenario(changed(table, path, other))
                found.add("nothing" if all(map(equal, acts.of(read), acts.own)) else "acts")
            except InputError:
                found.add("refused")
            if "acts" in found:
                break
        yield key, next(each for each in ("acts", "nothing", "refused") if each in found), path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("part", PARTS)
def test_every_number_acts_is_refused_or_has_a_reason_to_do_nothing(part):
    pytest.importorskip("mujoco")
    acting, idle, unexplained = {}, set(), []
    for name, scenario in ((name, load()) for name, load in SCENARIOS.items()):
        for key, outcome, path in [*tried(scenario, part, acting)]:
            if outcome == "acts":
                acting.setdefault(shared(key), set()).add(kind(scenario))
            elif outcome == "nothing":
                idle.add(shared(key))
                if not any(re.fullmatch(each, key) for each in SOMETIMES):
                    unexplained.append(f"{name}: {'.'.join(map(str, path))}")
    assert acting and not unexplained, unexplained
    assert sorted(idle - {*acting}) == []


@pytest.mark.parametrize(
    ("name", "key", "value", "says"),
    [
        ("canal", "finger.passive_tendon.mass", 1e-5, "without passive tendons"),
        ("canal", "finger.touches_itself", True, "no two parts but neighbours"),
        ("canal", "controller.gain", 2.0, 'controller.kind = "tensions"'),
        ("canal", "controller.minimum_tension", 2.0, "controller.tensions has every tendon"),
        ("servo", "finger.actuators.M1.position_loop", {"proportional": 2.0}, 'drive = "tension"'),
        ("servo_position", "finger.actuators.M1.friction_compensation", 0.5, 'drive = "position"'),
        ("hand", "controller.fingers.index.spring_compensation", True, "without springs"),
        ("hand", "controller.spring_compensation", True, "without springs"),
    ],
)
def test_an_entry_without_effect_is_refused_though_its_written_default_is_read(name, key, value, says):
    with pytest.raises(InputError, match=says) as caught:
        fp.load_scenario(name, {key: value})
    assert caught.value.entry == key and str(caught.value).endswith("leave it out")
    assert read_scenario(tomllib.loads(to_toml(fp.load_scenario(name)))) == fp.load_scenario(name)


def test_what_acts_on_one_finger_of_a_hand_may_be_said_for_all():
    planar = {"hand.fingers.index.finger": "planar", "reference": {}, "controller.passive_tension": 2.0}
    assert fp.load_scenario("hand", planar).controller.passive_tension == 2.0


def test_links_of_a_finger_on_a_hand_touch_each_other_without_objects():
    hand = fp.load_scenario("hand", {"hand.fingers.index.finger.touches_itself": True}).finger
    contacts = fp.Finger(hand).scene.contacts.names
    assert any(name.startswith("index.") and name.count("index.") == 2 for name in contacts)


def test_objects_of_a_model_stand_in_the_tree_alone_where_they_can_be_changed():
    table = tomllib.loads(to_toml(imported()))
    assert "objects" not in table["environment"]
    table["finger"]["tree"]["objects"]["table"]["position"] = [0.0, 0.0, -0.5]
    assert read_scenario(table).environment.objects["table"].position[2] == -0.5
