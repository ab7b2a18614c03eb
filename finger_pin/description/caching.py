"""A cache of values made of descriptions, which are frozen: the same object makes the same value."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

from pydantic import BaseModel

_Made = TypeVar("_Made")
_MOST = 128


class _Described(dict[type, bool]):
    """Whether objects of a type are descriptions; to ask an object itself takes longer."""

    def __missing__(self, kind: type) -> bool:
        self[kind] = issubclass(kind, BaseModel)
        return self[kind]


_DESCRIBED = _Described()


class Remembered(Generic[_Made]):
    """The latest things made, by the parts they were made of: descriptions as objects, all else by value."""

    def __init__(self, most: int = _MOST) -> None:
        """Remember nothing yet, and never more than so many."""
        self._most = most
        self._known: dict[tuple[Hashable, ...], tuple[tuple[object, ...], _Made]] = {}
        self._lock = Lock()

    def of(self, parts: tuple[object, ...], make: Callable[[], _Made]) -> _Made:
        """Return the thing made of parts; anew only if it was not made of the same before, or long ago."""
        key = tuple([id(part) if _DESCRIBED[type(part)] else part for part in parts])
        found = self._known.get(key)
        if found is None:
            # The parts are kept: of those that have gone, others may have the identity.
            found = parts, make()
            with self._lock:
                self._known[key] = found
                if len(self._known) > self._most:
                    del self._known[next(iter(self._known))]
        return found[1]
