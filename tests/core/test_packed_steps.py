"""Steps with contacts are kept without the bristles that are never bent."""

import numpy as np
import pytest
from test_contact_motion import G, plane, scene

import finger_pin as fp
from finger_pin.core.stepping.island_stepper import Record
from finger_pin.core.stepping.packed_steps import PackedSteps
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.description.objects import Object
from finger_pin.simulation.setup import Setup


def test_steps_that_are_packed_in_parts_have_every_number_that_is_not_zero():
    """Of six bristles one is bent in the first part alone, one in the second, one within a step, one at the start."""
    ball = Object(shape="sphere", radius=0.02, mass=0.1, position=(0.0, 0.0, 0.03))
    floors = {name: plane() for name in ("one", "two", "three")}
    structure, _ = compile_mechanism(scene((0.0, 0.0, -G), ball=ball, **floors)[0])
    size, first, numbers = 2 * len(structure.prescribed) + 6, 2 * len(structure.prescribed), np.random.default_rng(3)
    assert len(structure.state_row) == 6
    whole = Record.from_sizes(6, size, 1, 2, 4)
    for part in vars(whole).values():
        part[:] = numbers.normal(size=part.shape)
    whole.states[:, first:], whole.dense[:, :, first:], start = 0.0, 0.0, np.zeros(size)
    whole.states[1, first], whole.states[5, first + 2], whole.dense[4, 1, first + 3] = 1e-300, -2.0, 3.0
    start[first + 5] = 1.0
    packed = PackedSteps(structure, start)
    for half in (slice(0, 3), slice(3, 6)):
        packed.add(Record(*(part[half] for part in vars(whole).values())))
    columns, kept = np.flatnonzero(packed.stored), packed.joined()
    assert columns.tolist() == [*range(first), first, first + 2, first + 3, first + 5]
    np.testing.assert_array_equal(kept.states, whole.states[:, columns])
    np.testing.assert_array_equal(kept.dense, whole.dense[..., columns])
    np.testing.assert_array_equal(kept.branches, np.sign(whole.branches))
    for name in ("times", "shares", "attitudes"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(whole, name))


@pytest.mark.slow
def test_a_motion_with_contacts_passes_through_the_states_at_which_its_steps_ended():
    """A pinched ball takes more steps than are packed at once, and only some of its pairs ever touch."""
    setup, seen = Setup.from_scenario(fp.load_scenario("pinch", {"simulation.duration": 0.3})), []
    trajectory = setup.integrate(lambda time, x: seen.append((time, x.copy())), chunk=100)
    times, states = np.array([time for time, _ in seen]), np.array([x for _, x in seen])
    assert trajectory.statistics.steps > 300 and len(times) > 3
    bent = np.array([name.startswith("contact_bend") for name in setup.loop.finger.layout.names])
    assert 0 < np.any(states[:, bent], axis=0).sum() < bent.sum()
    np.testing.assert_allclose(trajectory.interpolate(times), states, rtol=1e-13, atol=1e-16)
