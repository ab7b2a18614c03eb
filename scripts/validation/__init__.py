"""The validation: what is compared with what, one module per family of checks."""
