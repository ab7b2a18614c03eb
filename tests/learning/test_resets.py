"""Resets of an episode: what they cost, and where they start."""

import numpy as np

import finger_pin as fp
from finger_pin.control import build
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.exceptions import InputError
from finger_pin.learning import Environment, LogUniform

PENDULUM = """<mujoco><worldbody><site name="base" pos="-.02 0 .01"/><body>
<joint name="hinge" axis="0 1 0" range="-.5 .5" limited="true"/>
<geom type="capsule" size=".005" fromto="0 0 0 .05 0 0"/>
<site name="end" pos=".02 0 .01"/></body></worldbody>
<tendon><spatial name="cord"><site site="base"/><site site="end"/></spatial></tendon>
<actuator><motor name="pull" tendon="cord" gear="-1" ctrlrange="0 10" ctrllimited="true"/></actuator></mujoco>"""
COARSE = {"method": "Rodas4", "rtol": 1e-3, "atol_scale": 1e-3}


def nothing(signals):
    return np.zeros(len(signals["action"]))


def test_drawn_friction_of_an_imported_hand_asks_for_no_closure_and_keeps_the_structure(tmp_path, monkeypatch):
    (tmp_path / "pendulum.xml").write_text(PENDULUM)
    monkeypatch.setattr(build, "closure_over_range", None)
    scenario = fp.Scenario.model_validate(
        {"name": "pendulum", "finger": fp.from_mujoco(tmp_path / "pendulum.xml"), "simulation": COARSE}
    )
    drawn = {"finger.tendon_friction.coulomb": LogUniform(0.05, 0.3)}
    environment = Environment(scenario, reward=nothing, randomise=drawn)
    world, structures, frictions = environment._worlds.worlds[0], set(), set()
    for seed in range(3):
        _, info = environment.reset(seed=seed)
        frictions.add(info["drawn"]["finger.tendon_friction.coulomb"])
        structures.add(id(compile_mechanism(world.simulator.finger.mechanism)[0]))
    assert (len(frictions), len(structures)) == (3, 1)


def is_free(world, position):
    scene = world.simulator.finger.scene
    try:
        scene.check(world.simulator.finger.layout.unpack(world.simulator.finger.rest_state(position)))
    except InputError:
        return False
    return True


def test_an_episode_starts_at_the_nearest_free_posture_towards_the_reference_where_draws_overlap(monkeypatch):
    """Both fingers are bent through the ball between them."""
    steps = 8
    monkeypatch.setattr("finger_pin.learning.world._WAY_STEPS", steps)
    scenario = fp.load_scenario("grasp", {f"simulation.{name}": value for name, value in COARSE.items()})
    reference = Environment(scenario, reward=nothing)._worlds.worlds[0].simulator.loop.reference.at(0.0).position
    bent = reference + 1.0
    environment = Environment(scenario, reward=nothing, start=lambda random: bent)
    environment.reset(seed=1)
    world = environment._worlds.worlds[0]
    start = world.simulator.state.position
    free = [share for share in np.arange(steps + 1) / steps if is_free(world, bent + share * (reference - bent))]
    assert free[0] > 0.0
    np.testing.assert_allclose(start, bent + free[0] * (reference - bent), atol=1e-12)
