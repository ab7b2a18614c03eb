"""The right-hand side, its Jacobian and its signals, compiled."""
