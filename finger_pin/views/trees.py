"""Results of hands that are given as a tree: what of the views is for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr


def is_tree(result: xr.Dataset) -> bool:
    """Return whether a result is of a tree, whose joints carry no links that could be drawn."""
    return "\n[finger.tree]\n" in result.attrs.get("scenario", "")
