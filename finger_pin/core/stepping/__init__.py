"""Steps: Rosenbrock methods, islands, touches that no step misses, and other integrators."""
