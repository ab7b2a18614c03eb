"""Studies: many runs of a scenario, measured and kept; sweeps over its entries, and searches for better ones.

From the question to the answer: ``keys`` of a scenario; ``designs`` or a ``search``; ``metrics``; ``records`` of runs,
found by their ``fingerprint``; the ``executor`` in threads or elsewhere. ``sweeps`` and ``optimisation`` put these
together in a Dataset. ``batch`` returns whole runs instead of metrics.
"""

from finger_pin.studies.designs import Grid, LatinHypercube, PointList, Range
from finger_pin.studies.metrics import DEFAULT_METRICS, METRICS, Metric
from finger_pin.studies.optimisation import DEFAULT_CONSTRAINTS, DEFAULT_OBJECTIVES, Effort, optimise
from finger_pin.studies.records import ExecutorError
from finger_pin.studies.response import Run
from finger_pin.studies.search import Variable, radii
from finger_pin.studies.sweeps import sweep

__all__ = [
    "DEFAULT_CONSTRAINTS",
    "DEFAULT_METRICS",
    "DEFAULT_OBJECTIVES",
    "METRICS",
    "Effort",
    "ExecutorError",
    "Grid",
    "LatinHypercube",
    "Metric",
    "PointList",
    "Range",
    "Run",
    "Variable",
    "optimise",
    "radii",
    "sweep",
]
