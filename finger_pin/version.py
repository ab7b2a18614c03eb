"""The version of the package, from its metadata; it changes whenever results do. How extras of it are installed."""

from importlib import metadata

__version__ = metadata.version("finger-pin")


def installing(extra: str) -> str:
    """Return the command that installs an extra of `pyproject.toml`, in the folder of the repository."""
    return f"python -m pip install -e '.[{extra}]', in the folder of this package"
