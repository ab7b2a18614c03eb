"""Residuals: recordings less what models compute at values of the parameters."""
