"""What a function reads of the frozen records that it is given: each field as it is read, by its path and a digest.

A *watched* record looks like the one it stands for; it notes the fields that are read through it, and hands out the
records in them watched in their turn. What it cannot see into, it notes as read whole.
"""

import functools
import os
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from datetime import date, time, timedelta
from enum import Enum
from hashlib import sha256
from pathlib import PurePath
from types import BuiltinFunctionType, FunctionType, MappingProxyType
from typing import Any, cast

import numpy as np
from pydantic import BaseModel

Path = tuple[Any, ...]
"""Steps from the arguments to a value: a name of a field, a number of an item, (`KEY`, a key), or `WHOLE`."""

KEY, WHOLE = "a key", "*"

_OF_MODELS = frozenset(dir(BaseModel))
_WHOLE_RECORD = frozenset({"__dict__", "__reduce__", "__reduce_ex__", "__getstate__"})
_CONSTANT = frozenset({"__class__", "__module__", "__doc__", "__slots__"})


class UnknownValueError(TypeError):
    """A value of a kind that has no digest here; what holds one cannot be told from what does not."""


# ------------------------------------------------------------------------------------------------ digests
def digest(value: Any) -> bytes:
    """A digest of a value that another process finds, too: of its kind and of everything in it, to the last bit.

    Raises:
        UnknownValueError: For what is not made of numbers, texts, arrays, containers, records and functions.
    """
    known = sha256()
    for part in _parts(value):
        known.update(part)
    return known.digest()[:16]


def _parts(value: Any) -> Iterator[bytes]:
    kind = type(value)
    if value is None or kind in (bool, int, str, complex):
        yield f"{kind.__name__}:{value!r};".encode(errors="surrogatepass")
    elif kind is float:
        yield b"float:" + struct.pack("<d", value)
    elif kind is bytes:
        yield f"bytes {len(value)}:".encode() + value
    elif isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        if array.dtype.hasobject:
            raise UnknownValueError("an array of objects")
        yield f"array {kind.__name__} {array.dtype.str} {array.shape}:".encode()
        yield np.ascontiguousarray(array).tobytes()
    elif names := names_of(value):
        yield f"{_name(kind)} {len(names)}(".encode()
        for name in names:
            yield f"{name}=".encode()
            yield from _parts(getattr(value, name))
    else:
        yield from _others(value, kind)


def _others(value: Any, kind: type) -> Iterator[bytes]:
    if isinstance(value, Enum | PurePath | date | time | timedelta):
        yield f"{_name(kind)}:{value};".encode(errors="surrogatepass")
    elif isinstance(value, FunctionType | BuiltinFunctionType | type):
        yield f"{value.__module__}.{value.__qualname__};".encode()
        if isinstance(value, FunctionType) and value.__closure__:
            raise UnknownValueError(f"the function {value.__qualname__}, which holds values of its own")
    elif isinstance(value, functools.partial):
        yield from _parts((value.func, value.args, value.keywords))
    elif isinstance(value, slice):
        yield b"slice" + b"".join(_parts((value.start, value.stop, value.step)))
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}(".encode()
        for key, item in value.items():
            yield from _parts(key)
            yield from _parts(item)
    elif isinstance(value, AbstractSet):
        yield f"set {len(value)}(".encode() + b"".join(sorted(digest(item) for item in value))
    elif isinstance(value, Sequence):
        yield f"{_name(kind)} {len(value)}(".encode()
        for item in value:
            yield from _parts(item)
    elif is_dataclass(value):  # without fields, or it says itself what it is made of
        yield from (
            _parts(cast("Any", value).__reduce__()) if _says_what_it_is_made_of(kind) else [f"{_name(kind)};".encode()]
        )
    else:
        raise UnknownValueError(f"a value of the type {_name(kind)}")


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def names_of(value: Any) -> tuple[str, ...]:
    """The fields of a record; none for anything else, and for one that says itself what it is made of."""
    kind: Any = type(value)
    return _names(kind)


@functools.cache
def _names(kind: Any) -> tuple[str, ...]:
    if _says_what_it_is_made_of(kind):
        return ()
    if issubclass(kind, BaseModel):
        return tuple(kind.model_fields)
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else ()


def _says_what_it_is_made_of(kind: Any) -> bool:
    """Whether a record has a ``__reduce__`` of its own, as one that holds what cannot be copied."""
    return is_dataclass(kind) and kind.__reduce__ is not object.__reduce__


# ------------------------------------------------------------------------------------------------ watching
class Reads:
    """Digests of what was read, by path; ``known`` is False where something read has no digest."""

    def __init__(self) -> None:
        """Nothing was read yet."""
        self.digests: dict[Path, bytes] = {}
        self.known = True
        self._process = os.getpid()

    def watched(self, value: Any, path: Path = ()) -> Any:
        """The value, noted as read; a record or a container of records in place of it notes what is read through it.

        Args:
            value: The arguments, or what was read of them.
            path: Steps from the arguments to it.
        """
        if isinstance(value, dict | MappingProxyType) and any(_holds_records(item) for item in value.values()):
            return _Entries(value, self, path)
        seen = _seen_at_once(value)
        self._note(path, seen)
        if seen is value:
            return value
        if names_of(value):
            return _standing_for(value, self, path)
        return type(value)(self.watched(item, (*path, number)) for number, item in enumerate(value))

    def whole(self, value: Any, path: Path) -> None:
        """Note a record as read in all its parts.

        Args:
            value: A record, or a mapping of records.
            path: Steps from the arguments to it.
        """
        self._note((*path, WHOLE), value)

    def absent(self, path: Path, key: Any) -> None:
        """Note that a mapping was asked for a key that it does not have.

        Args:
            path: Steps from the arguments to the mapping.
            key: The key.
        """
        self._note((*path, (KEY, key)), None)

    def keys(self, path: Path, keys: Sequence[Any]) -> None:
        """Note the keys of a mapping as read.

        Args:
            path: Steps from the arguments to the mapping.
            keys: All its keys, in their order.
        """
        self._note((*path, KEY), tuple(keys))

    def _note(self, path: Path, value: Any) -> None:
        if path in self.digests:
            return
        if os.getpid() != self._process:
            raise RuntimeError("something is read in a forked process that nobody watches")
        try:
            self.digests[path] = digest(value)
        except UnknownValueError:
            self.known = False

    def agree(self, value: Any) -> bool:
        """Whether all that was read is the same in another value."""
        return all(_digest_at(value, path) == known for path, known in self.digests.items())


def _holds_records(value: Any) -> bool:
    if isinstance(value, tuple | list):
        return any(_holds_records(item) for item in value)
    return bool(names_of(value))


def _digest_at(value: Any, path: Path) -> bytes | None:
    """The digest of what stands at a path, as `Reads` has noted it there; None where there is no such path."""
    try:
        for step in path:
            value = _step(value, step)
    except (AttributeError, LookupError, TypeError):
        return None
    if path[-1:] == (WHOLE,):
        return digest(value)
    return digest(_seen_at_once(value))


def _step(value: Any, step: Any) -> Any:
    if step == WHOLE:
        return value
    if step == KEY:
        return tuple(value)
    if isinstance(step, tuple):
        return value.get(step[1])
    return value[step] if isinstance(step, int) else getattr(value, step)


def _seen_at_once(value: Any) -> Any:
    """What is noted of a value when it is handed out: its kind, and its contents where they are not watched."""
    if names_of(value):
        return type(value)
    if type(value) in (tuple, list) and any(_holds_records(item) for item in value):
        return (type(value), len(value))
    return value


def _itself(value: Any) -> Any:
    return value


def _standing_for(record: Any, reads: Reads, path: Path) -> Any:
    kind: Any = type(record)
    made: Any = object.__new__(_watching(kind))
    object.__setattr__(made, "_watched", (record, reads, path, {}))
    return made


@functools.cache
def _watching(kind: Any) -> type:
    """The class of watched records of a kind."""
    names = frozenset(_names(kind))
    whole = _WHOLE_RECORD | (_OF_MODELS - _CONSTANT if issubclass(kind, BaseModel) else frozenset())

    def read(self: Any, name: str) -> Any:
        if name == "__class__":
            return kind
        if name not in names and name not in whole:
            return object.__getattribute__(self, name)
        record, reads, path, found = object.__getattribute__(self, "_watched")
        if name in names:
            if name not in found:
                found[name] = reads.watched(getattr(record, name), (*path, name))
            return found[name]
        reads.whole(record, path)
        return getattr(record, name)

    def plain(self: Any, *_: Any) -> Any:
        record, reads, path, _ = object.__getattribute__(self, "_watched")
        reads.whole(record, path)
        return record

    space: dict[str, Any] = {
        "__getattribute__": read,
        "__deepcopy__": plain,
        "__copy__": plain,
        "__module__": kind.__module__,
    }
    options = {"defer_build": True} if issubclass(kind, BaseModel) else {}
    made: type = type(kind)(kind.__name__, (kind,), space, **options)
    return made


class _Entries(Mapping[Any, Any]):
    """A mapping of records, watched by key."""

    def __init__(self, of: Mapping[Any, Any], reads: Reads, path: Path) -> None:
        self._of, self._reads, self._path = of, reads, path

    def __getitem__(self, key: Any) -> Any:
        if key not in self._of:
            self._reads.absent(self._path, key)
        return self._reads.watched(self._of[key], (*self._path, (KEY, key)))

    def __contains__(self, key: object) -> bool:
        try:
            self[key]
        except KeyError:
            return False
        return True

    def __iter__(self) -> Iterator[Any]:
        self._reads.keys(self._path, tuple(self._of))
        return iter(self._of)

    def __len__(self) -> int:
        self._reads.keys(self._path, tuple(self._of))
        return len(self._of)

    def __reduce_ex__(self, protocol: Any) -> Any:
        self._reads.whole(self._of, self._path)
        return (_itself, (self._of,))


def watched_call(function: Callable[..., Any], *args: Any, **beside: Any) -> tuple[Any, Reads]:
    """What a function returns, and what it has read of its positional arguments.

    Args:
        function: What to call.
        args: Its positional arguments, which are watched.
        beside: Its other arguments, which are not.
    """
    reads = Reads()
    return function(*reads.watched(args), **beside), reads
