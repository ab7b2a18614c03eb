"""Islands: what nothing couples is integrated apart, and moves as it does alone."""

from dataclasses import replace

import numpy as np
import pytest
from core_cases import FORCE, Case
from joined_mechanisms import join_mechanisms
from test_any_mechanism import assert_same

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.addresses.time_functions import SignalTable
from finger_pin.core.jit import pack
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps import integration
from finger_pin.core.tables.inputs import held_control, planned_control
from finger_pin.core.tables.islands import find_islands
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.laws.spring import JOINT_SPRING
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows

TIMES, TOLERANCE = np.linspace(0.0, 0.05, 26), 1e-6
NAMES = ("reversals", "stick_slip", "none_passive", "two_passive", "lugre")


class Joined:
    """Closed loops of several fingers on one base, as one mechanism with one set of inputs."""

    def __init__(self, loops):
        """Join loops by their names."""
        self.loops = loops
        parts = {name: loop.finger.mechanism for name, loop in loops.items()}
        self.parts, self.mechanism = tuple(parts.values()), join_mechanisms(parts)

    def pack(self, vectors):
        """Join packed vectors of the fingers, shape (..., size), one for each."""
        split = [part.split(each) for part, each in zip(self.parts, vectors, strict=True)]
        blocks = []
        for block in range(2):
            joints = [each[block][..., : part.body.model.nv] for each, part in zip(split, self.parts, strict=True)]
            lumps = [each[block][..., part.body.model.nv :] for each, part in zip(split, self.parts, strict=True)]
            blocks += [*joints, *lumps]
        return np.concatenate([*blocks, *(each[2] for each in split)], axis=-1)

    def control(self):
        """The paper's controllers of all fingers, each with a lambda of its own."""
        controls = [Case.of(loop).control for loop in self.loops.values()]
        width, whole, found = self.mechanism.coordinates, self.mechanism.body.model.nv, []
        at, lump, channel, base = 0, whole, 0, 0
        total = sum(len(control.reference.harmonics) for control in controls)
        for part, control in zip(self.parts, controls, strict=True):
            joints, functions = part.body.model.nv, len(control.reference.harmonics)
            places = np.append(np.arange(at, at + joints), lump + np.arange(len(part.lumps)))
            spread = {
                name: np.zeros((*getattr(control, name).shape[:-1], width)) for name in ("gain", "inverse", "offset")
            }
            for name, wide in spread.items():
                wide[..., places] = getattr(control, name)
            coupling = np.zeros((width, total))
            coupling[places, base : base + functions] = control.coupling
            channels = np.where(control.channel >= 0, control.channel + channel, -1)
            found.append((spread, coupling, channels))
            at, lump, channel, base = at + joints, lump + len(part.lumps), channel + part.channels, base + functions
        return planned_control(
            self.mechanism.channels,
            gain=sum(spread["gain"] for spread, _, _ in found),
            minimum=np.concatenate([control.minimum for control in controls]),
            inverse=np.concatenate([spread["inverse"] for spread, _, _ in found]),
            internal=np.concatenate([control.internal for control in controls]),
            channel=np.concatenate([channels for _, _, channels in found]),
            reference=SignalTable(
                np.concatenate([control.reference.harmonics for control in controls]),
                np.zeros(0),
                np.zeros((6, 0, total)),
            ),
            coupling=sum(coupling for _, coupling, _ in found),
            offset=sum(spread["offset"] for spread, _, _ in found),
            loop=np.repeat(np.arange(len(controls)), [len(control.minimum) for control in controls]),
        )

    def stepper(self, control, mechanism=None):
        """All fingers at their starts; forces at the tips are those of the loops."""
        start = self.pack([loop.initial_state() for loop in self.loops.values()])
        scales = self.pack([loop.finger.layout.scales() for loop in self.loops.values()])
        force = np.array([loop.fingertip_force for loop in self.loops.values()])
        return Stepper(
            mechanism or self.mechanism, control, start, TABLEAUS["Rodas5P"](), TOLERANCE, TOLERANCE * scales, force
        )


@pytest.fixture(scope="module", params=[2, 3, 5])
def fingers(request, scenarios):
    """Different fingers in motions of their own; the second one is pushed at its tip."""
    loops = {}
    for name in NAMES[: request.param]:
        table = scenarios[name].model_dump()
        table["finger"]["gravity"] = (0.0, 0.0, -9.81)
        loops[name] = ClosedLoop.from_scenario(fp.Scenario.model_validate(table))
    loops["stick_slip"] = replace(loops["stick_slip"], fingertip_force=FORCE)
    return Joined(loops)


def run(stepper, names):
    trajectory = integrate_compiled(stepper, TIMES[-1], names)
    assert not trajectory.failure
    return trajectory


def names_of(mechanism):
    return tuple(f"x{index}" for index in range(mechanism.size))


def test_joined_fingers_evaluate_as_each_alone(fingers):
    """In both evaluators: rates, row by row, and forces at the tips."""
    rng = np.random.default_rng(41)
    states = [Case.of(loop).states(rng, 20) for loop in fingers.loops.values()]
    commands = [rng.uniform(0.0, 5.0, (20, part.channels)) for part in fingers.parts]
    x, command = fingers.pack(states), np.concatenate(commands, axis=1)
    forces = rng.normal(size=(20, len(fingers.parts), 3))
    found = fingers.mechanism.evaluate(x, command, forces)
    given = zip(fingers.parts, states, commands, np.moveaxis(forces, 1, 0), strict=True)
    alone = [part.evaluate(*rest) for part, *rest in given]
    np.testing.assert_allclose(found.rate, fingers.pack([each.rate for each in alone]), rtol=1e-9, atol=1e-9)
    for name, each in zip(fingers.loops, alone, strict=True):
        for group, rows in each.rows.items():
            np.testing.assert_allclose(found.rows[f"{name}.{group}"].force, rows.force, rtol=1e-9, atol=1e-12)
    assert_same(CompiledMechanism(fingers.mechanism).evaluate(x, command, forces), found, fingers.mechanism, 1e-10)


def test_fingers_that_nothing_couples_are_islands_that_move_bit_by_bit_as_alone(fingers):
    """With steps of their own, each under its own controller."""
    stepper = fingers.stepper(fingers.control())
    assert len(stepper.parts) == len(fingers.loops)
    found = run(stepper, names_of(fingers.mechanism)).interpolate(TIMES)
    moved = []
    for (name, loop), part in zip(fingers.loops.items(), stepper.parts, strict=True):
        scales, start = loop.finger.layout.scales(), loop.initial_state()
        alone = Stepper(
            loop.finger.mechanism,
            Case.of(loop).control,
            start,
            TABLEAUS["Rodas5P"](),
            TOLERANCE,
            TOLERANCE * scales,
            loop.fingertip_force,
        )
        moved.append(run(alone, loop.finger.layout.names).interpolate(TIMES))
        for counter in ("accepted_steps", "rejected_steps", "evaluations"):
            assert getattr(part.memory, counter) == getattr(alone.parts[0].memory, counter), name
    np.testing.assert_array_equal(found, fingers.pack(moved))
    steps = [part.memory.accepted_steps[0] for part in stepper.parts]
    assert len(set(steps)) > 1


def tied(fingers):
    """The same with a weak spring between the second joints of the first two fingers."""
    arm = np.zeros((1, fingers.mechanism.coordinates))
    arm[0, [1, fingers.parts[0].body.model.nv + 1]] = 1.0, -1.0
    spring = Rows("tie", JOINT_SPRING, ("tie",), np.array([[0.05], [0.0], [0.0]]), arm)
    mechanism = fingers.mechanism
    return Mechanism(mechanism.body, [*mechanism.rows, spring], mechanism.lumps, mechanism.inertia)


def test_a_row_between_two_fingers_joins_their_islands_and_moves_both(fingers):
    mechanism, free = tied(fingers), fingers.stepper(fingers.control())
    stepper = fingers.stepper(fingers.control(), mechanism)
    assert len(stepper.parts) == len(fingers.loops) - 1
    found, apart = (run(each, names_of(mechanism)).interpolate(TIMES)[-1] for each in (stepper, free))
    first, second = fingers.parts[:2]
    gap = np.abs(found - apart)
    assert gap[: first.body.model.nv].max() > 1e-5
    assert gap[first.body.model.nv :][: second.body.model.nv].max() > 1e-5


def islands(mechanism, control=None):
    structure, _ = compile_mechanism(mechanism)
    return find_islands(structure, control or held_control(mechanism.channels, mechanism.coordinates))


def test_a_load_an_input_or_a_measured_length_from_another_finger_couples_too(fingers):
    """Through rows that act on one finger alone."""
    mechanism, count = fingers.mechanism, len(fingers.loops)
    _, second, *_ = fingers.loops
    own, other = np.zeros((2, 1, mechanism.coordinates))
    own[0, 0], other[0, fingers.parts[0].body.model.nv] = 1.0, 1.0
    source = f"{second}.driven_tendons"
    weights = np.ones((1, next(len(table.names) for table in mechanism.rows if table.group == source)))
    numbers = np.array([[0.05], [0.0], [0.0]])
    for wiring in ({"loads": {source: weights}}, {"inputs": {source: weights}}, {"measure": other}):
        row = Rows("reader", JOINT_SPRING, ("reader",), numbers, own, **wiring)
        joined = Mechanism(mechanism.body, [*mechanism.rows, row], mechanism.lumps, mechanism.inertia)
        assert len(islands(joined)) == count - 1
    assert len(islands(mechanism)) == count


def test_a_failure_of_one_finger_names_its_own_state(fingers):
    stepper = fingers.stepper(fingers.control())
    part = stepper.parts[1]
    part.atol[:] = 1.0
    part.atol[2] = 1e-60
    part._bound = part._bound._replace(rtol=0.0)
    part._block._words[:] = pack(part._bound, integration.INTEGRATION)._words
    trajectory = integrate_compiled(stepper, TIMES[-1], names_of(fingers.mechanism))
    place = fingers.parts[0].body.model.nv + 2
    assert trajectory.failure.endswith(f"the error is largest in x{place}")


STILL = """<mujoco><option gravity="0 0 0"/><worldbody><site name="p" pos="-.03 0 .01"/>
<site name="q" pos="-.05 0 .02"/><body><joint name="j" axis="0 1 0" damping="1e-3" stiffness=".05"/>
<geom type="capsule" size=".005"
 fromto="0 0 0 .04 0 0" mass=".02"/></body></worldbody>
<tendon><spatial name="t" {}><site site="p"/><site site="q"/></spatial></tendon><actuator>{}</actuator></mujoco>"""


@pytest.mark.parametrize(
    ("tendon", "actuator"),
    [
        ("", '<position name="a" tendon="t" kp="100"/>'),
        ("", '<motor name="a" tendon="t" gear="-1" ctrlrange="0 10"/>'),
        ('stiffness="100" damping="1"', '<motor name="a" joint="j"/>'),
    ],
    ids=["servo", "pulled", "spring"],
)
def test_a_tendon_whose_points_all_stand_still_changes_nothing(tendon, actuator):
    """The joint swings as I q'' + c q' + k q = 0 does; friction of the tendon is a state that no joint moves."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(STILL.format(tendon, actuator))
    hand = fp.from_mujoco(model)
    smooth = {f"finger.joint_friction.{name}": 0.0 for name in ("coulomb", "stiction", "viscous")}
    table = demo_motion(hand, 0.2)
    table["simulation"] |= {"initial": {"position": {"j": 0.3}}, "rtol": 1e-8, "atol_scale": 1e-8}
    table["controller"] = {"kind": "tensions"} | ({"tensions": {"a": {"offset": 2.0}}} if hand.tendons else {})
    found = fp.simulate(read_scenario(table, smooth | {"finger.joint_friction.floor": 1e-9}))
    inertia = fp.Finger(hand).rigid_body.mass_matrix(np.zeros(1))[0, 0]
    poles = np.roots([inertia, 1e-3, 0.05])
    amplitude = np.linalg.solve([[1.0, 1.0], poles], [0.3, 0.0])
    expected = np.real(np.exp(np.outer(found.time.values, poles)) @ amplitude)
    np.testing.assert_allclose(found.joint_position.values[:, 0], expected, atol=1e-6)
