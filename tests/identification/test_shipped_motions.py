"""Identification from the made-up recordings of motions that ship."""

import numpy as np
import pytest

import finger_pin as fp


def test_the_made_up_recording_that_ships_tells_the_numbers_it_was_made_with():
    result = fp.identify("to_and_fro", starts=1)
    truth = [0.12, 0.4, 0.03]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values))
    assert result.signal_correlation.values == pytest.approx([0.6, 0.0], abs=0.15)


def test_weights_on_a_cord_tell_the_springs_of_three_joints():
    """Written out by hand: k theta = r T with 0.08, 0.05 and 0.03 N m/rad, read to 0.7 degrees."""
    result = fp.identify("postures", starts=1)
    truth = [0.08, 0.05, 0.03]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and result.determined.all()
    assert result.noise.values == pytest.approx(np.full(3, np.deg2rad(0.7)), rel=0.3)


def test_the_angle_of_a_spool_tells_friction_at_the_bends_and_how_springs_share_the_cord():
    """Three joints and their bristles were integrated apart from the package: 0.18, 0.05 and 0.03 N m/rad."""
    result = fp.identify("spool_finger", starts=1)
    truth = [0.18, 0.05, 0.03]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and result.determined.all()
    assert result.replicate_noise.values == pytest.approx(np.full(6, 8e-3), rel=0.1)
    assert np.all(result.lack_of_fit > 0.01)


def test_a_fingertip_against_a_load_cell_tells_the_friction_of_its_canals_and_the_wrong_zero():
    """Two links, bristles and pad were integrated apart from the package: 0.14 and 0.05 N; a noise of 4 mN."""
    result = fp.identify("pressing", starts=2)
    assert np.all((result.lower.values <= [0.14, 0.05]) & (result.upper.values >= [0.14, 0.05]))
    assert np.all(result.upper - result.lower < [0.001, 0.002])
    assert result.attrs["searches_alike"] == 2
    assert result.noise.values == pytest.approx([4e-3], rel=0.15)
