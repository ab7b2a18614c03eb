"""Steps: Rosenbrock methods, where steps end, islands, errors and slopes of a run, and other integrators."""
