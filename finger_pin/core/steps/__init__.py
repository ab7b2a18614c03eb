"""One step of a Rosenbrock method, its error and its interpolant."""
