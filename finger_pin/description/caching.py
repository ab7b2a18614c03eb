"""Cache of values that follow from frozen descriptions.

All that is remembered has one bound in bytes; what was made first is forgotten first.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Hashable, Sequence
from functools import wraps
from threading import Lock
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, Generic, NamedTuple, ParamSpec, Self, TypeVar, overload

import numpy as np
from pydantic import BaseModel

_Made = TypeVar("_Made")
_Key = tuple[Hashable, ...]
_P = ParamSpec("_P")
#: Bytes of all that is remembered.
LIMIT = 64 * 2**20

# One entry of so many is measured, which takes a tenth of a run's time: the next ones count as much.
_EVERY = 8
# Numbers and their like, and the bytes that each takes.
_LEAVES, _LEAF = frozenset({float, int, bool, complex, type(None), np.dtype}), 32

_PLAIN, _DESCRIPTION, _VIEW, _SHARED = range(4)


class _Kinds(dict[type, int]):
    """The kind of objects of a type: a description, an array, what is there anyway; to ask an object takes longer."""

    def __missing__(self, kind: type) -> int:
        shared: Any = type, ModuleType, FunctionType, BuiltinFunctionType
        kinds: dict[int, Any] = {_DESCRIPTION: BaseModel, _VIEW: np.ndarray, _SHARED: shared}
        self[kind] = next((number for number, bases in kinds.items() if issubclass(kind, bases)), _PLAIN)
        return self[kind]


_KINDS = _Kinds()


class _Held(NamedTuple):
    """Shared object in the account: number of holders, bytes, and the objects it holds."""

    thing: object
    holders: int
    size: int
    holds: list[object]


class _Account:
    """The bytes of all that is remembered, in the order in which it was made.

    Attributes:
        lock: Held while entries change.
        total: Bytes, as estimated; of what libraries hold, which Python does not see, there are none among them.
    """

    def __init__(self) -> None:
        self.lock, self.total = Lock(), 0
        self._entries: dict[tuple[_Memory[Any], _Key], tuple[int, list[object]]] = {}
        self._held: dict[int, _Held] = {}

    def add(self, owner: _Memory[Any], key: _Key, parts: tuple[object, ...], made: object) -> None:
        """Count an entry, and forget the oldest ones until all fit, or it is the only one."""
        before, holds, size = self.total, list[object](), owner.latest
        if owner.asked % _EVERY == 0:
            size, holds = self._extent([parts])
            holds += [] if type(made) in _LEAVES else [made]
        self._entries[owner, key] = size, holds
        self.total += size
        for each in holds:
            self._hold(each)
        owner.asked, owner.latest = owner.asked + 1, self.total - before
        while self.total > LIMIT and len(self._entries) > 1:
            oldest, first = next(iter(self._entries))
            oldest.forget(first)

    def drop(self, owner: _Memory[Any], key: _Key) -> None:
        """Count an entry no more."""
        size, holds = self._entries.pop((owner, key))
        self.total -= size
        for each in holds:
            self._release(each)

    def _hold(self, thing: object) -> None:
        held = self._held.get(id(thing))
        if held is None:
            held = _Held(thing, 0, *self._extent([thing], first=True))
            self.total += held.size
            self._held[id(thing)] = held._replace(holders=1)
            for each in held.holds:
                self._hold(each)
        else:
            self._held[id(thing)] = held._replace(holders=held.holders + 1)

    def _release(self, thing: object) -> None:
        held = self._held.pop(id(thing))
        if held.holders > 1:
            self._held[id(thing)] = held._replace(holders=held.holders - 1)
            return
        self.total -= held.size
        for each in held.holds:
            self._release(each)

    def _extent(self, things: Sequence[Any], first: bool = False) -> tuple[int, list[object]]:
        """Return the bytes reachable from objects, and the shared objects among them.

        Args:
            things: The things.
            first: Whether these are looked into, whatever they are.
        """
        seen, apart, size, left = set[int](), list[object](), 0, things
        while left:
            # Layer by layer, as most of it is then done without Python.
            many = [thing for thing in left if type(thing) not in _LEAVES]
            size += _LEAF * (len(left) - len(many))
            fresh = {at: thing for thing in many if (at := id(thing)) not in seen}
            seen |= fresh.keys()
            looked, views = list[Any](), list[Any]()
            for at, thing in fresh.items():
                kind = _KINDS[type(thing)]
                if not first and (kind == _DESCRIPTION or at in self._held):
                    apart.append(thing)
                elif kind != _SHARED:
                    looked.append(thing)
                    views += [thing.base] if kind == _VIEW else []
            size += sum(map(sys.getsizeof, looked))
            left, first = gc.get_referents(*looked) + views, False
        return size, apart


_ACCOUNT = _Account()
if hasattr(os, "register_at_fork"):
    # A thread that holds the lock is not in the process that is forked, where nobody would release it.
    os.register_at_fork(
        before=_ACCOUNT.lock.acquire, after_in_parent=_ACCOUNT.lock.release, after_in_child=_ACCOUNT.lock.release
    )


class _Memory(Generic[_Made]):
    """The latest things made, by the parts they were made of: descriptions as objects, all else by value.

    Attributes:
        asked: How many were made.
        latest: Bytes of the latest one.
    """

    asked, latest = 0, 0

    def __init__(self, most: int) -> None:
        """Create an empty memory with a maximum number of entries."""
        self._most = most
        self._known: dict[_Key, tuple[tuple[object, ...], _Made]] = {}

    def of(self, parts: tuple[object, ...], make: Callable[[], _Made]) -> _Made:
        """Return the value for these parts, computed if it is not remembered."""
        key = tuple([id(part) if _KINDS[type(part)] == _DESCRIPTION else part for part in parts])
        found = self._known.get(key)
        if found is None:
            # The parts are kept: of those that have gone, others may have the identity.
            found = parts, make()
            with _ACCOUNT.lock:
                if key in self._known:
                    self.forget(key)
                self._known[key] = found
                _ACCOUNT.add(self, key, *found)
                if len(self._known) > self._most:
                    self.forget(next(iter(self._known)))
        return found[1]

    def forget(self, key: _Key) -> None:
        """Forget an entry; the account's lock is held."""
        del self._known[key]
        _ACCOUNT.drop(self, key)


def memoised(
    parts: Callable[..., tuple[object, ...]], most: int = 128
) -> Callable[[Callable[_P, _Made]], Callable[_P, _Made]]:
    """Return a decorator by which a function remembers its latest values.

    Args:
        parts: From the function's arguments to all that its value depends on: descriptions, which are frozen, count as
            objects, all else by value.
        most: The number of values that are remembered, at most.
    """

    def decorate(function: Callable[_P, _Made]) -> Callable[_P, _Made]:
        memory: _Memory[_Made] = _Memory(most)

        @wraps(function)
        def remembering(*arguments: _P.args, **options: _P.kwargs) -> _Made:
            return memory.of(parts(*arguments, **options), lambda: function(*arguments, **options))

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
        """Return the value; the object's own entry of this name, once it is there, comes before."""
        if instance is None:
            return self
        value: _Made = vars(instance).setdefault(self._name, self._function(instance))
        return value
