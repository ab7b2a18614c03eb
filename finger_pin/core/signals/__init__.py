"""Signals of many states, for results."""
