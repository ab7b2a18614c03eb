"""Recordings: columns of measured numbers in a file, their units, and their part in a bench."""
