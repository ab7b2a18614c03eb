"""The validation against independent sources, one module per family of checks."""
