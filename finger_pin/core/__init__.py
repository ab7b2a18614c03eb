"""The mechanism compiled: right-hand side, exact Jacobian, Rosenbrock methods and stepper, and scipy's as reference."""
