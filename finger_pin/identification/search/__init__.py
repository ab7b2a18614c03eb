"""Search for the least residuals, a function of a vector within bounds."""
