"""Recordings: columns of measured numbers in a file, their units, and what a bench says of them."""
