"""Studies: many runs of a scenario, measured and kept; sweeps over its numbers, and searches for better ones."""

from __future__ import annotations

from finger_pin.studies.cluster import ClusterError, DaskCluster
from finger_pin.studies.designs import Grid, LatinHypercube, Listing, Range
from finger_pin.studies.local import LocalProcesses
from finger_pin.studies.metrics import DEFAULT_METRICS, METRICS, Metric, Run
from finger_pin.studies.sweeping import sweep

__all__ = [
    "DEFAULT_METRICS",
    "METRICS",
    "ClusterError",
    "DaskCluster",
    "Grid",
    "LatinHypercube",
    "Listing",
    "LocalProcesses",
    "Metric",
    "Range",
    "Run",
    "sweep",
]
