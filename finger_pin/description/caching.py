"""Cache of values that follow from frozen descriptions: of every function the latest ones used, up to a number."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, Generic, ParamSpec, Self, TypeVar, overload

from pydantic import BaseModel, ConfigDict

_Made = TypeVar("_Made")
_P = ParamSpec("_P")


class _Call(Generic[_Made]):
    """Key of a call: descriptions are compared by identity, all else by value."""

    def __init__(self, parts: tuple[object, ...], make: Callable[[], _Made]) -> None:
        """Keep the parts alive, so that their identities are not reused."""
        self._parts, self._make = parts, make
        self._key = tuple([id(part) if isinstance(part, BaseModel) else part for part in parts])

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Call) and self._key == other._key

    def made(self) -> _Made:
        """Return the value, and release the arguments it was computed from."""
        make = self._make
        del self._make
        return make()


def memoised(
    parts: Callable[..., tuple[object, ...]], most: int = 32
) -> Callable[[Callable[_P, _Made]], Callable[_P, _Made]]:
    """Return a decorator by which a function remembers the values that were used last.

    Args:
        parts: From the function's arguments to all that its value depends on: descriptions, which are frozen, count as
            objects, all else by value.
        most: The number of values that are remembered, at most.
    """

    def decorate(function: Callable[_P, _Made]) -> Callable[_P, _Made]:
        remembered = lru_cache(most)(_Call[_Made].made)

        @wraps(function)
        def remembering(*arguments: _P.args, **options: _P.kwargs) -> _Made:
            return remembered(_Call(parts(*arguments, **options), lambda: function(*arguments, **options)))

        return remembering

    return decorate


class cached_property(Generic[_Made]):
    """Property that is computed once per object, without a lock: of two threads that compute it the first one counts.

    That of `functools` has one lock for all objects before Python 3.12. A thread that computes one on several cores
    would wait for others that wait for the lock.
    """

    def __init__(self, function: Callable[[Any], _Made]) -> None:
        """Wrap a method without arguments."""
        self._function, self._name, self.__doc__ = function, function.__name__, function.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> _Made: ...

    def __get__(self, instance: object | None, owner: type | None = None) -> Self | _Made:
        """Compute the value; later reads find it in the object's dictionary."""
        if instance is None:
            return self
        value: _Made = vars(instance).setdefault(self._name, self._function(instance))
        return value


class Frozen(BaseModel):
    """Model whose entries stay. What cached properties have computed is neither copied nor pickled."""

    model_config = ConfigDict(frozen=True, ignored_types=(cached_property,))

    def __copy__(self) -> Self:
        """Return a copy of the entries."""
        copy = super().__copy__()
        for name in vars(copy).keys() - type(self).model_fields.keys():
            del vars(copy)[name]
        return copy

    def __getstate__(self) -> dict[Any, Any]:
        """Return the entries."""
        state, entries = super().__getstate__(), type(self).model_fields
        return state | {"__dict__": {name: value for name, value in vars(self).items() if name in entries}}
