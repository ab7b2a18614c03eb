"""Experiments of the paper: its figures, its conclusions, controllers compared, the error of its (17)."""
