"""Studies: many runs of a scenario, measured and kept; sweeps over its entries, and searches for better ones.

From the question to the answer: ``keys`` of a scenario; ``designs`` (and how a command line does the ``spelling``)
or the ``problem`` of a ``search``; ``metrics``; ``runs``, and the ``fingerprint`` that they are found by; ``executing``
them in threads or elsewhere; the ``folder`` that keeps them; the ``dataset`` of all. ``sweeping`` and ``optimising``
put these together. ``many`` returns whole runs instead of metrics. ``comparison`` and ``conclusions`` are studies of
their own.
"""

from finger_pin.studies.designs import Grid, LatinHypercube, Listing, Range
from finger_pin.studies.metrics import DEFAULT_METRICS, METRICS, Metric
from finger_pin.studies.optimising import DEFAULT_CONSTRAINTS, DEFAULT_OBJECTIVES, Effort, optimise
from finger_pin.studies.problem import Variable, radii
from finger_pin.studies.response import Run
from finger_pin.studies.runs import ExecutorError
from finger_pin.studies.sweeping import sweep

__all__ = [
    "DEFAULT_CONSTRAINTS",
    "DEFAULT_METRICS",
    "DEFAULT_OBJECTIVES",
    "METRICS",
    "Effort",
    "ExecutorError",
    "Grid",
    "LatinHypercube",
    "Listing",
    "Metric",
    "Range",
    "Run",
    "Variable",
    "optimise",
    "radii",
    "sweep",
]
