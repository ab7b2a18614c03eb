"""The stages of scripts/benchmark.py, one file each."""
