"""CVODE of SUNDIALS as a solver like scipy's, if the package scikit-sundae is installed: an independent reference."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy

from finger_pin.exceptions import InputError
from finger_pin.typing import Array


def check_installed() -> None:
    """Refuse the method if its package is missing.

    Raises:
        InputError: If scikit-sundae is not installed.
    """
    if importlib.util.find_spec("sksundae") is None:
        raise InputError("simulation.method", "needs the package scikit-sundae, which is not installed", "CVODE")


class Cvode(scipy.integrate.OdeSolver):  # type: ignore[misc]
    """CVODE's variable-order BDF; between its steps cubic Hermite polynomials."""

    nlu = 0

    def __init__(
        self,
        fun: Callable[[float, Array], Array],
        t0: float,
        y0: Array,
        t_bound: float,
        *,
        rtol: float,
        atol: Array,
        max_step: float,
    ) -> None:
        """Begin at a state; arguments as for scipy's solvers."""
        from sksundae.cvode import CVODE

        super().__init__(fun, t0, y0, t_bound, vectorized=False)

        def fill(instant: float, x: Array, rate: Array) -> None:
            rate[:] = fun(instant, x)

        # Zero is no limit.
        most = max_step if np.isfinite(max_step) else 0.0
        self._solver = CVODE(fill, rtol=rtol, atol=atol, max_step=most, max_num_steps=100_000, linsolver="dense")
        self._solver.init_step(t0, self.y)
        self._ends = [(t0, self.y, fun(t0, self.y))]

    def _step_impl(self) -> tuple[bool, str | None]:
        found = self._solver.step(self.t_bound, method="onestep", tstop=self.t_bound)
        if not found.success:
            return False, " ".join(str(found.message).split())
        self.t, self.y = float(np.ravel(found.t)[-1]), np.array(np.atleast_2d(found.y)[-1])
        self.njev = int(found.njev)
        self._ends = [self._ends[-1], (self.t, self.y, self.fun(self.t, self.y))]
        return True, None

    def _dense_output_impl(self) -> Callable[[Array], Any]:
        between = scipy.interpolate.CubicHermiteSpline(*map(np.array, zip(*self._ends, strict=True)))
        return lambda at: between(at).T
