"""Figures of experiments that span many runs: the conclusions of the paper, and controllers side by side."""
