"""Numbers as attributes of XML."""


def numbers(*values: float) -> str:
    """Return numbers so that reading them gives the same floats; no zero has a sign."""
    return " ".join(repr(float(value) + 0.0) for value in values)
