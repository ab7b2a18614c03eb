"""Steps: Rosenbrock methods, ends of steps, islands, errors and slopes of a run, and other integrators."""
