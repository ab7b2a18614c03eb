"""References: what is wanted over time, as signals, and the motion of the joints that they make with (20)."""
