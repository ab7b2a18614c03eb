"""Steps: Rosenbrock methods, ends of steps, islands, errors of a run, and other integrators."""
