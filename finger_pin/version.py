"""The version of the package, from its metadata; it changes whenever results do."""

from importlib import metadata

__version__ = metadata.version("finger-pin")
