"""References: signals over time, and the desired motion of the joints that they make with (20)."""
