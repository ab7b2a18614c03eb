"""Numbers as attributes of XML."""


def numbers(*values: float) -> str:
    """Return numbers so that reading them gives the same floats."""
    return " ".join(repr(float(value)) for value in values)
