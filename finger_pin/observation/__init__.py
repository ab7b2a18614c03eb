"""Observation: from readings of motors to angles, tensions and contact forces of a hand, with bands."""
