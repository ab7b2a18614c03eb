"""Touches that no step misses: bounds of motion, contacts that are asleep, and looks within a step."""
