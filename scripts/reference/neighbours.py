"""What functions return for arguments that are near those of a test.

A test calls a function with numbers that are round or alike, lists of one element, words that are right. When the test
has passed, what was called is called again with copies of its arguments in which something is another thing: each
number a little, one number turned round or 0, a word, a flag, an element that is left out or there twice. Of these
calls those are worth holding that return something else where there is a mistake (`mistakes`) that no other call shows.
"""

import copy
import dataclasses
import enum
import gc
import inspect
import math
import random
import time
import types
import warnings
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import date, timedelta
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from fuzzing.limits import TooLongError, timer
from reference import inside, mistakes

NEIGHBOURS = "~"
"""Behind the name of a function, for what it returns for arguments that are near."""

NUMBERS, WORDS, ELEMENTS = (0, 1, 2, 3), (4, 5), (6, 7)
"""Variations of the arguments of a call: what becomes another thing in them."""

KINDS = len(NUMBERS + WORDS + ELEMENTS)
"""Of variations; a variation of a higher number is another one of the same kind, with other things drawn."""

SAME = 99
"""The number of the call as it was."""

ALL = NUMBERS[:2]
"""Those in which each number is another one; in the others it is one thing."""

LARGEST = 20_000
"""Elements of all arrays of a call together, at most: with more, each variation takes too long."""

MOST_PARTS = 3_000
"""Parts of the arguments of a call, at most."""

LIMIT_S, HANG_S = 0.1, 60.0
"""Processor time of a variation that is seen for the first time, and of one that is held: beyond it has no value."""

APART = 1e-2
"""By how much what is returned with a mistake is another thing."""

YIELDED = 50
"""First values of a generator that are looked at."""

LEFT_OUT = (
    *("cli.", "studio.", "campaign.run:", "campaign.engines.", "campaign.ledger.", "campaign.export:", "core.folder:"),
    *("core.threads:", "core.integrity:", "core.kept:", "core.installing:", "core.machine:", "core.compiling:"),
    *("core.progress:", "core.reads:", "export.flight.build:", "export.flight.write:", "export.fmi.", "report.page."),
    "campaign.work:",
)
"""Begins of the names of functions that write, wait, start others or hang on the machine."""

Arguments = tuple[list[Any], dict[str, Any]]
Call = tuple[types.FunctionType, Arguments, bool]
"""A function, its arguments and whether there are arrays among them."""


class _UncopiedError(Exception):
    """An argument cannot be copied, or hangs on something outside."""


def called(frame: types.FrameType) -> Call | None:
    """The function that has just been entered and copies of its arguments; nothing where they are one of a kind.

    Args:
        frame: Of the function, before its first statement.
    """
    code = frame.f_code
    own, count = frame.f_locals, code.co_argcount + code.co_kwonlyargcount
    names = code.co_varnames[: count + bool(code.co_flags & inspect.CO_VARARGS)]
    if set(code.co_freevars) - {"__class__"} or code.co_flags & inspect.CO_VARKEYWORDS:
        return None
    given = [own[name] for name in names]
    try:
        has_arrays = _looked_through(given) > 0
        given = copy.deepcopy(given)
    except Exception:
        return None
    cells = tuple(types.CellType(own[name]) for name in code.co_freevars)
    function = types.FunctionType(code, frame.f_globals, code.co_name, None, cells)
    more = given[count] if len(given) > count else ()
    keywords = dict(zip(names[code.co_argcount : count], given[code.co_argcount : count], strict=True))
    return function, ([*given[: code.co_argcount], *more], keywords), has_arrays


def values(call: Call, seed: str, numbers: Iterable[int], limit_s: float = LIMIT_S) -> Iterator[tuple[int, float]]:
    """The number of each variation of a call, and one for what it returns, changes or raises.

    Args:
        call: A function and its arguments.
        seed: Which decides what is another thing in them.
        numbers: Of the variations, below ``SAME``, or that.
        limit_s: Time for one of them.
    """
    for number in numbers:
        try:
            if (changed := varied(call, seed, number)) is not None:
                yield number, returned(call[0], changed, limit_s)
        except TooLongError:
            return
        except Exception:  # arguments that refuse to be such
            continue


def varied(call: Call, seed: str, number: int) -> Arguments | None:
    """Arguments of a call in which something is another thing; nothing where there is no such thing in them."""
    _, arguments, has_arrays = call
    copied = copy.deepcopy(arguments)
    if number == SAME:
        return copied
    rng = random.Random(zlib.crc32(f"{seed} {number}".encode()))
    return _Changed(number % KINDS, has_arrays, rng).of(copied)


def returned(function: Callable[..., Any], arguments: Arguments, limit_s: float) -> float:
    """A number for what a function returns, changes or raises; raises TooLongError."""
    with _quietly(), timer(limit_s):
        found = _returned(function, *arguments)
    return round(inside.value(found), 6)


class Shown:
    """Mistakes in a function that calls of it show, one after the other."""

    def __init__(self, function: types.FunctionType) -> None:
        """None yet."""
        self._function = function
        self._wrong = dict(enumerate(mistakes.of(function.__code__)))
        self.left = set(self._wrong)

    def by(self, arguments: Arguments, limit_s: float = LIMIT_S, all_s: float = math.inf) -> tuple[float, list[int]]:
        """What a call returns, and the mistakes with which it returns something else.

        Args:
            arguments: Of the call.
            limit_s: Processor time for one call; raises TooLongError without a mistake.
            all_s: Time after which no further mistake is tried.
        """
        end = time.monotonic() + all_s
        function = self._function
        x = returned(function, copy.deepcopy(arguments), limit_s)
        shown = []
        for number in sorted(self.left):
            if time.monotonic() > end:
                break
            cells = function.__closure__ if self._wrong[number].co_freevars else None
            wrong = types.FunctionType(self._wrong[number], function.__globals__, function.__name__, None, cells)
            try:
                other = returned(wrong, copy.deepcopy(arguments), limit_s)
            except TooLongError:
                continue
            if abs(other - x) > APART:
                shown.append(number)
        self.left.difference_update(shown)
        return x, shown


def _returned(function: Callable[..., Any], args: list[Any], keywords: dict[str, Any]) -> Any:
    try:
        found = function(*args, **keywords)
        if isinstance(found, types.GeneratorType):
            found = list(islice(found, YIELDED))
    except Exception as error:
        return [type(error).__name__, str(error)]
    return [args, keywords] if found is None else found


@contextmanager
def _quietly() -> Iterator[None]:
    collects = gc.isenabled()
    gc.disable()  # what is raised while it collects is lost
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        if collects:
            gc.enable()


_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, date, timedelta, enum.Enum, range)
_CALLED = (types.FunctionType, types.BuiltinFunctionType, type)


def _looked_through(of: object) -> int:
    """Elements of its arrays; raises where a value has what cannot be copied, is used elsewhere too or is too much."""
    waiting, parts, elements, known = deque([of]), 0, 0, set()
    while waiting:
        each = waiting.popleft()
        parts += 1
        if parts > MOST_PARTS:
            raise _UncopiedError
        if isinstance(each, np.ndarray):
            elements += each.size
            if elements > LARGEST or each.dtype.kind == "O":
                raise _UncopiedError
        elif _tells(each):
            raise _UncopiedError
        elif isinstance(each, (*_PLAIN, *_CALLED)) or id(each) in known:
            continue
        else:
            known.add(id(each))
            waiting.extend(_held(each))
    return elements


def _tells(of: object) -> bool:
    """Whether it may be a function by which a test is told something, and would be told it again, or one around it."""
    waiting, known = [of], set[int]()
    while waiting:
        each = waiting.pop()
        if isinstance(each, types.BuiltinFunctionType) and not isinstance(each.__self__, types.ModuleType | None):
            return True
        if not isinstance(each, types.FunctionType) or not each.__closure__ or id(each) in known:
            continue
        if not each.__module__.startswith("microrad"):
            return True
        known.add(id(each))
        waiting.extend(cell.cell_contents for cell in each.__closure__ if cell != types.CellType())
    return False


def _held(of: Any) -> list[Any]:
    if type(of) is dict:
        return [*of.keys(), *of.values()]
    if type(of) in (list, tuple, set, frozenset) or (isinstance(of, tuple) and hasattr(of, "_fields")):
        return list(of)
    if dataclasses.is_dataclass(of):
        return [object.__getattribute__(of, field.name) for field in dataclasses.fields(of)]
    if isinstance(of, partial):
        return [of.args, of.keywords]
    if type(of).__module__.startswith("microrad") and not isinstance(of, BaseException):
        return list(object.__getattribute__(of, "__dict__").values())
    raise _UncopiedError


class _Changed:
    """Arguments in which something is another thing."""

    def __init__(self, number: int, has_arrays: bool, rng: random.Random) -> None:
        """The number of the variation says what: all numbers, twice; one of them; a flag or a word; an element.

        A whole number stays what it is beside arrays: compiled code would look behind their end.
        """
        self._number = number
        self._words = (bool | str | bytes) if has_arrays else (bool | int | str | bytes)
        self._rng = rng
        self._places = 0
        self._chosen = -1

    def of(self, arguments: Arguments) -> Arguments | None:
        """Arguments that are other ones; nothing where there is nothing to change."""
        changed = self._all(arguments)
        if not self._places or self._number in ALL:
            return changed if self._places else None
        self._chosen, self._places = self._rng.randrange(self._places), 0
        return self._all(arguments)

    def _all(self, arguments: Arguments) -> Arguments:
        args, keywords = arguments
        return [self._walk(each) for each in args], {key: self._walk(each) for key, each in keywords.items()}

    def _is_it(self) -> bool:
        """Whether this is what becomes another thing; until one of the places is chosen they are counted."""
        self._places += 1
        return self._number in ALL or self._places - 1 == self._chosen

    def _walk(self, of: Any) -> Any:
        if type(of) in (list, tuple, dict):
            return self._collection(of)
        if dataclasses.is_dataclass(of) and not isinstance(of, type):
            return self._record(of)
        if isinstance(of, float | complex | np.floating | np.complexfloating):
            return self._another_number(of) if self._number in NUMBERS and self._is_it() else of
        if isinstance(of, np.ndarray):
            changes = self._number in NUMBERS and of.dtype.kind in "fc" and of.size and self._is_it()
            return self._another_array(of) if changes else of
        is_word = isinstance(of, self._words) and not isinstance(of, enum.Enum)
        return self._another_word(of) if is_word and self._number in WORDS and self._is_it() else of

    def _collection(self, of: Any) -> Any:
        kind = type(of)
        if of and self._number in ELEMENTS and self._is_it():
            return self._another_dictionary(of) if kind is dict else self._another_sequence(of)
        before = list(of.values() if kind is dict else of)
        inner = [self._walk(each) for each in before]
        if all(new is old for new, old in zip(inner, before, strict=True)):
            return of
        return dict(zip(of, inner, strict=True)) if kind is dict else kind(inner)

    def _record(self, of: Any) -> Any:
        fields = {field.name: object.__getattribute__(of, field.name) for field in dataclasses.fields(of) if field.init}
        inner = {name: self._walk(each) for name, each in fields.items()}
        return of if all(inner[name] is fields[name] for name in fields) else dataclasses.replace(of, **inner)

    def _another_number(self, of: Any) -> Any:
        if self._number in ALL:
            return type(of)(of * self._rng.uniform(0.8, 1.25))
        turned = -of if of else 1.0
        return type(of)(turned if self._number == NUMBERS[2] else 0.0)

    def _another_array(self, of: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        if self._number in ALL:
            drawn = np.array([self._rng.uniform(0.8, 1.25) for _ in range(min(of.size, 61))])
            return (of * np.resize(drawn, of.shape)).astype(of.dtype)
        return -of if self._number == NUMBERS[2] else of[::-1].copy()

    def _another_word(self, of: Any) -> Any:
        if isinstance(of, bool):
            return not of
        if isinstance(of, int):
            return of + self._rng.choice((1, -1))
        lines = of.splitlines(keepends=True)
        if len(lines) > 2:
            k = self._rng.randrange(len(lines))
            instead = [] if self._number == WORDS[0] else [lines[k], lines[k]]
            return of[:0].join([*lines[:k], *instead, *lines[k + 1 :]])
        return of[:-1] if isinstance(of, bytes) else self._rng.choice((of[:-1], of.upper(), of + "x", "", of + " 2"))

    def _another_sequence(self, of: Any) -> Any:
        k = self._rng.randrange(len(of))
        return type(of)([*of[:k], *(() if self._number == ELEMENTS[0] else (of[k], of[-1])), *of[k + 1 :]])

    def _another_dictionary(self, of: dict[Any, Any]) -> dict[Any, Any]:
        key = self._rng.choice(list(of))
        if self._number == ELEMENTS[0] or not isinstance(key, str):
            return {each: x for each, x in of.items() if each != key}
        return {**of, f"{key}_2": of[key]}
