"""Copies of everything public go on as what they are copies of, alone, and in other processes.

This file is a script as well: what is wrong may end the interpreter.
"""

import copy
import gc
import io
import pickle
import subprocess
import sys
from functools import partial

import cloudpickle
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.learning import Environment, Normal, Sensor, Uniform, VectorEnvironment

pytestmark = pytest.mark.slow

FIG6 = {"simulation.rtol": 1e-4, "simulation.atol_scale": 1e-4, "simulation.duration": 0.02}
PULLS = (np.full(4, 2.0), np.array([6.0, 1.0, 3.0, 1.5]))
RUBBING = {"finger.tendon_friction.coulomb": Uniform(0.05, 0.3)}
DRAWN = RUBBING | {"observation.joint_position.offset": Normal(0.0, 0.1)}


def angle(signals):
    return -np.abs(signals["joint_position"]).sum(-1)


def goal(random):
    return {"goal": random.uniform(size=2)}


def finger(name):
    scenario = fp.load_scenario(name)
    return fp.Finger(scenario.finger, objects=scenario.environment.objects)


def rates(finger):
    """Rates and signals at a posture."""
    x = finger.rest_state(0.5 * (finger.stroke_limiter.lower + finger.stroke_limiter.upper))
    inputs = np.full(finger.mechanism.channels, 3.0)
    return [*finger.rhs(0.0, x, inputs), *finger.evaluate(x, inputs)["joint_acceleration"]]


def simulator(name):
    own = finger(name)
    start = own.layout.unpack(fp.prepare(name).start).position
    made = fp.Simulator(own, start, rtol=1e-4, atol_scale=1e-4)
    made.step(np.full(made.finger.mechanism.channels, 2.0), 1e-3)
    made.signals()
    return made


def stepped(simulator):
    inputs = np.full(simulator.finger.mechanism.channels, 3.0)
    simulator.step(inputs, 1e-3)
    found = [
        *simulator.x,
        *simulator.signals()["joint_acceleration"],
        *simulator.result().joint_position.values.ravel(),
    ]
    simulator.reset()
    simulator.set_parameters({"finger.gravity": [0.0, 0.0, -5.0]})
    simulator.step(inputs, 1e-3)
    return [*found, *simulator.x]


def together():
    made = [simulator("reversals") for _ in range(2)]
    fp.step_many(made, [PULLS[0]] * 2, 1e-3)
    return made


def stepped_together(simulators):
    fp.step_many(simulators, [PULLS[1]] * 2, 1e-3)
    return [*simulators[0].x, *simulators[1].x]


def prepared(name, key, value):
    made = fp.prepare(fp.load_scenario(name, FIG6), [key], ["joint_position", "tendon_tension"])
    made.run([value])
    return made


def run_again(prepared):
    low, high = (prepared.run([factor * prepared.values[0]]) for factor in (0.9, 1.1))
    return [*low["joint_position"].ravel(), *high["tendon_tension"].ravel(), *prepared.start]


def environment(scenario="reversals", make=Environment, **task):
    made = make(scenario=fp.load_scenario(scenario, FIG6), reward=angle, draw=goal, duration=0.06, **task)
    made.reset(seed=3)
    made.step(made.action_space.low + 1.0)
    return made


def acted(environment):
    """The rest of an episode, and the begin of another."""
    found = []
    for share in (0.3, 0.6):
        low, high = environment.action_space.low, environment.action_space.high
        observation, reward, *_ = environment.step(low + share * (high - low))
        found += [*np.ravel(observation), *np.ravel(reward)]
    found += [*np.ravel(environment.reset(seed=5)[0]), *np.ravel(environment.step(low + 2.0)[0])]
    alone = isinstance(environment, Environment)
    return found + ([*environment.result().tendon_tension.values.ravel()] if alone else [])


def observer():
    made = fp.observe("wound", sensors={"motor_current.servo": {"noise": 1e-3}})
    observed(made)
    return made


def observed(observer):
    """What is estimated while the servo winds its cord in."""
    readings = [{"motor_position.servo": 0.02 * k, "motor_current.servo": 0.1} for k in range(20)]
    found = [each for reading in readings for each in observer.step(reading).variables().values()]
    return [*np.concatenate([np.ravel(each) for each in found]), *observer.result().consistency.values]


ESTIMATED = ["joint_position", "estimated.joint_position", "estimated.tendon_tension_high"]
ACTION = {"observation": {"joint_position": Sensor(noise=0.01), "tendon_tension": Sensor(delay=0.02)}, "delay": 0.005}
VECTOR = partial(VectorEnvironment, 2)
# Of everything public: what makes one that is under way, and what then asks it for numbers.
OBJECTS = {
    "scenario": (
        partial(fp.load_scenario, "reversals", FIG6),
        lambda it: fp.simulate(it).joint_position.values.ravel(),
    ),
    "finger": (partial(finger, "press"), rates),
    "hand": (lambda: fp.Hand(fp.load_scenario("hand").finger), rates),
    "simulator of motors": (partial(simulator, "servo"), stepped),
    "simulator with objects": (partial(simulator, "press"), stepped),
    "simulators stepped together": (together, stepped_together),
    "prepared": (partial(prepared, "reversals", "finger.tendon_friction.coulomb", 0.1), run_again),
    "prepared servo": (partial(prepared, "servo", "finger.tendon_friction.coulomb", 0.1), run_again),
    "result": (lambda: fp.simulate(fp.load_scenario("reversals", FIG6)), lambda it: it.joint_position.values.ravel()),
    "environment": (partial(environment, **ACTION), acted),
    "environment, numbers drawn": (partial(environment, randomise=DRAWN, **ACTION), acted),
    "environment, motors, numbers drawn": (
        partial(environment, "servo_position", action="motor_position", randomise=RUBBING),
        acted,
    ),
    "observer": (observer, observed),
    "environment with an observer": (
        partial(environment, "wound", action="spool_angle", observation=ESTIMATED, randomise=RUBBING),
        acted,
    ),
    "worlds, numbers drawn": (partial(environment, make=VECTOR, randomise=DRAWN, **ACTION), acted),
}
WAYS = {
    "copy": lambda it: [copy.copy(each) for each in it] if isinstance(it, list) else copy.copy(it),
    "deepcopy": copy.deepcopy,
    "pickle": lambda it: pickle.loads(pickle.dumps(it)),
    "cloudpickle": lambda it: cloudpickle.loads(cloudpickle.dumps(it)),
}


def problems(name):
    """Return what is wrong with copies of an object, in words, with one that is pickled and what it has to answer."""
    make, ask = OBJECTS[name]
    expected, original = np.array(ask(make())), make()
    assert np.isfinite(expected).all()
    assert np.ptp(expected) > 0.0
    first, second = ([(way, copied(original)) for way, copied in WAYS.items()] for _ in range(2))
    written = cloudpickle.dumps(original)
    found = [f"{way} differs" for way, twin in first if not np.array_equal(ask(twin), expected)]
    found += [] if np.array_equal(ask(original), expected) else ["a copy has changed the original"]
    del original, first
    gc.collect()
    # What was freed is written over.
    kept = [np.full(size, 1e300) for size in 2000 * [1, 4, 16, 64, 256]]
    found += [f"{way} differs alone" for way, twin in second if not np.array_equal(ask(twin), expected)]
    del kept
    return found, written, expected


def main(names):
    """Write what is found of objects; of those that are read, whether they are in this process what they were."""
    for name in names:
        pickle.dump((name, *problems(name)), sys.stdout.buffer)
        sys.stdout.buffer.flush()
    while not names:
        name, written, expected = pickle.load(sys.stdin.buffer)
        answered = np.array_equal(OBJECTS[name][1](pickle.loads(written)), expected)
        pickle.dump((name, [] if answered else ["differs in another process"]), sys.stdout.buffer)
        sys.stdout.buffer.flush()


def answers(names, given=b""):
    """Yield what processes write, a new one each time that one ends before its time."""
    call = [sys.executable, __file__, *names]
    output = io.BytesIO(subprocess.run(call, input=given, stdout=subprocess.PIPE, check=False).stdout)
    while True:
        try:
            yield pickle.load(output)
        except EOFError:
            return


def all_problems():
    """What is found of every object; a process that ends before its time is of the object that it was at."""
    told, left = {}, list(OBJECTS)
    while left:
        here = list(answers(left))
        pairs = b"".join(pickle.dumps((name, *rest)) for name, _, *rest in here)
        told |= {name: [*wrong, "ended another process"] for name, wrong, *_ in here}
        for name, wrong in answers([], pairs):
            told[name] = told[name][:-1] + wrong
        left = left[len(here) :]
        if left:
            told[left.pop(0)] = ["ended the process"]
    return told


def test_copies_step_as_new_ones_do_without_the_original_and_in_another_process():
    # One test, as every process of the tests would look at all of them.
    assert all_problems() == {name: [] for name in OBJECTS}


if __name__ == "__main__":
    main(sys.argv[1:])
