"""What libraries import for what a command does not do, and a command does not wait for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# What matplotlib calls for every class of artists; a version without it is imported as it is.
_DOCUMENTS = "_update_set_signature_and_docstring"


@contextmanager
def without(name: str, seeker: str) -> Iterator[None]:
    """Let a package seem not to be installed to one that would import it only because it is.

    What the seeker has not found it does not look for again: this is for a process that has imported neither yet, and
    does nothing in another.
    """
    if {name, seeker} & sys.modules.keys():
        yield
        return
    sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[name]


@contextmanager
def undocumented() -> Iterator[None]:
    """Let matplotlib, which is imported meanwhile, not document the properties of all that it draws.

    That is a third of the time of its import, and nobody reads it in a process that only draws.
    """
    from matplotlib import artist

    module: Any = artist
    kept = module.kwdoc, vars(module.Artist).get(_DOCUMENTS)
    if kept[1] is not None:
        module.kwdoc = lambda _: ""
        setattr(module.Artist, _DOCUMENTS, classmethod(lambda _: None))
    try:
        yield
    finally:
        if kept[1] is not None:
            module.kwdoc = kept[0]
            setattr(module.Artist, _DOCUMENTS, kept[1])
