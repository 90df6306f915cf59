"""What the functions inside of microrad return while a case runs, each as one number.

A command's output hides much: a start value that a search forgets, a branch that is taken twice in a thousand. So each
function's first returned values, and some later ones, are held as well. Of a function that has another name now, or is
called less often, nothing is compared: the inside may be put in order freely.
"""

import ast
import builtins
import dataclasses
import json
import math
import os
import re
import sys
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from datetime import date, timedelta
from functools import lru_cache, partial
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path, PurePath
from types import CodeType, FrameType, MappingProxyType, ModuleType
from typing import Any

import numpy as np

PACKAGE = f"{os.sep}microrad{os.sep}"
COMPILED = "microrad.core.kernels"
SENDER = "__microrad_returning__"
"""Name under which a module that is loaded by ``Telling`` finds what it tells."""

ENTERED = "__microrad_entered__"
"""The same for a function that begins."""

RAISES = "!"
"""Behind the name of a function, for what it raises."""

CALLS = (1, 2, 3, 5, 10)
"""Those of a function in a process whose values are taken."""

FIRST_CALLS = 3
"""Those alone in a campaign."""

PARTS = 1500
"""Of a value, at most."""

DEEPEST = 8
"""Records within records that are looked into."""

SPREAD = 64
"""Elements of an array that are taken, evenly."""

LONGEST = 65536
"""Bytes of a file that are taken."""

SMALLEST = 1e-12
"""A number below it counts as a rounding of 0."""

NEAR = 2e-3
"""By how much a value may be another one: two thousandths of a number that stands by itself."""

MOST = 12
"""Values of a function in a case that are held."""

STEADY = 5e-5
"""By how much it may differ between the machines that are played when it is written; else it is not held."""

BY_CHANCE = (
    *("core.folder:read_bytes.<locals>.at_once", "campaign.run:_minutes", "core.machine:", "export.fmi.fmu:_platform"),
    *("campaign.engines.", "loop.pointing_loop.ensemble:_Advancing", "export.flight.build:"),
)
"""What they return hangs on the time, on threads, on the machine and its compiler, or is the number of an open file."""

LEFT_OUT = (
    *BY_CHANCE,
    *("cli.", "core.units:printable", "core.folder:write_whole", "core.folder:_left_behind"),
    *("report.page.", "report.identification.page:identification_page", "mission.explain:_used"),
    *("export.flight.write:", "loop.pointing_loop.ensemble:_Drawing"),
)
"""Those, and what hangs on which of two processes is first or on how the code is written, or is a whole page."""

_FOLDERS = rf"{re.escape(str(Path(__file__).parents[2]))}|/\S*?/pytest-\d+/(?:popen-gw\d+/)?[^/\s]*?\d+\b"
_CHANGING = re.compile(rf"{_FOLDERS}|[0-9a-f]{{12,64}}|\b\d+\.\d+\.\d+(?:\.dev\d+)?(?:\+\w+)?")
"""Where the project is, hashes, versions and folders of tests: words that change with an edit, a release or a run."""

Values = dict[str, dict[str, float]]
"""By function, and by process and call of a case: `2.30` is the thirtieth call in its second command."""


def value(of: object) -> float:
    """A number that changes with each part of a value, by its relative change.

    Args:
        of: A number, words, an array, a record or what holds such.
    """
    parts: list[float] = []
    _take_apart(of, 0, parts)
    return sum(weight * part for weight, part in zip(_WEIGHTS, parts, strict=False))


_WEIGHTS = tuple(1.0 + k * 0.6180339887498949 % 1.0 for k in range(PARTS))


def _take_apart(of: Any, depth: int, parts: list[float]) -> None:
    """Put the parts of a value behind those that there are; of what is large the first ones."""
    if len(parts) >= PARTS:
        return
    if of is None or depth > DEEPEST:
        parts.append(0.5)
    elif isinstance(of, str):
        parts.append(_word(of))
    elif isinstance(of, bool | int | float | np.number | np.bool_) and not isinstance(of, complex):
        parts.append(_magnitude(_float(of)))
    elif isinstance(of, complex):
        parts.extend(_array(np.atleast_1d(of)))
    elif isinstance(of, np.ndarray) and of.dtype.kind in "OUS":
        _take_apart([*of.shape, *of.ravel()[:SPREAD].tolist()], depth + 1, parts)
    elif isinstance(of, np.ndarray):
        parts.extend(_array(of))
    elif isinstance(of, set | frozenset):
        parts.append(0.1 * len(of) + sum(value(each) for each in of))
    elif (words := _worded(of)) is not None:
        parts.append(_word(words))
    else:
        inner = _inner(of)
        parts.append(0.1 * len(inner))
        for each in inner:
            _take_apart(each, depth + 1, parts)


@lru_cache(maxsize=10_000)
def _word(words: str) -> float:
    return zlib.crc32(_CHANGING.sub("", words).encode(errors="surrogatepass")) % 9973 / 997.3


def _worded(of: Any) -> str | None:
    """A value that can be taken for words; nothing where it cannot."""
    if isinstance(of, bytes | bytearray):
        return f"{len(of)} {bytes(of[:LONGEST]).decode('latin-1')}"
    if isinstance(of, date | timedelta):
        return str(of)
    if isinstance(of, PurePath):
        return of.name
    return of.__qualname__ if isinstance(of, type) else None


def _inner(of: Any) -> list[object]:
    """What a value holds."""
    own = partial(object.__getattribute__, of)  # a campaign notes what is read the usual way
    if isinstance(of, dict | MappingProxyType):
        return [part for item in of.items() for part in item]
    if isinstance(of, list | tuple):
        return list(of)
    if dataclasses.is_dataclass(of) and not isinstance(of, type):
        return [own(field.name) for field in dataclasses.fields(of)]
    if type(of).__module__.startswith("microrad"):
        return list(own("__dict__").values())
    return next((inner for has, inner in _FOREIGN if has(of)), _nothing)(of)


def _dataset(of: Any) -> list[object]:
    places = [part for name, each in of.coords.items() for part in (name, each.values)]
    of_array = hasattr(of, "values") and not callable(of.values)
    return [of.attrs, *places, *([of.values] if of_array else [*of.data_vars, *of.data_vars.values()])]


def _element(of: Any) -> list[object]:
    shown = [each for each in of._props.items() if isinstance(each[1], str | bool | int | float)]
    children = [child for slot in of.slots.values() for child in slot.children]
    return [of.tag, list(of._classes), dict(of._style), shown, getattr(of, "text", None), *children]


def _axes(of: Any) -> list[object]:
    said = [of.get_title(), of.get_xlabel(), of.get_ylabel(), *(each.get_text() for each in of.texts)]
    return [said, of.get_xscale(), of.get_yscale(), *(each.get_xydata() for each in of.get_lines())]


def _nothing(_: object) -> list[object]:
    return []


_FOREIGN: tuple[tuple[Callable[[Any], bool], Callable[[Any], list[object]]], ...] = (
    (lambda of: isinstance(of, partial), lambda of: [of.func, of.args, of.keywords]),
    (lambda of: type(of).__module__.startswith("xarray.core.data"), _dataset),
    (lambda of: hasattr(of, "_props") and hasattr(of, "_classes"), _element),
    (lambda of: hasattr(of, "get_xlim") and hasattr(of, "get_lines"), _axes),
)
"""What there is in values of libraries: calls that wait, data sets, elements of a page, axes of a figure."""


def _array(of: np.ndarray[Any, Any]) -> Iterator[float]:
    yield 0.1 * of.ndim
    yield math.log1p(of.size)
    if of.dtype.kind == "c":
        yield from _array(of.real)
        yield from _array(of.imag)
    elif of.dtype.kind in "biuf" and of.size:
        flat = of.ravel()[np.unique(np.linspace(0, of.size - 1, SPREAD).astype(int))].astype(float)
        flat = np.nan_to_num(flat, nan=-7.0, posinf=1e30, neginf=-1e30)
        weights = 1.0 + np.arange(flat.size) * 0.6180339887498949 % 1.0
        yield _magnitude(float(np.sum(np.abs(flat) * (weights + 0.4 * (flat < 0)))))


def _float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:  # an integer beyond all floats
        return math.inf if number > 0 else -math.inf


def _magnitude(number: float) -> float:
    if not math.isfinite(number):
        return 77.0 if math.isnan(number) else math.copysign(99.0, number)
    return math.asinh(number / SMALLEST) if number >= 0.0 else 1.4 * math.asinh(-number / SMALLEST) + 0.3


class Watch:
    """Takes down what functions return, from ``begin`` to ``end``."""

    current: "Watch | None" = None
    """The one that is told what functions return."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.values: Values = defaultdict(dict)
        self.done: set[str] = set()  # functions of which nothing more is taken
        self._calls: dict[str, int] = defaultdict(int)
        self._is_busy = False

    def begin(self) -> None:
        """Watch, as on a machine of one core: work is cut into parts by their number, and threads take turns."""
        os.cpu_count = lambda: 1
        Watch.current = self

    def end(self, file: Path) -> None:
        """Watch no longer, and write what was seen."""
        Watch.current = None
        file.write_text(json.dumps(self.values), encoding="utf-8")

    def takes(self, name: str) -> int:
        """Which call of a function this is, and 0 where its value is not taken."""
        call = self._calls[name] = self._calls[name] + 1
        if call == CALLS[-1]:
            self.done.add(name)
        return call if call in CALLS else 0

    def enters(self, name: str, frame: FrameType) -> None:
        """A function is called: nothing is taken of that here."""

    def saw(self, name: str, returned: object) -> None:
        """A function returns something: its module and name, and what it is."""
        if self._is_busy or not (call := self.takes(name)):
            return
        self._is_busy = True
        try:
            found = returned
            if isinstance(found, BaseException):
                found = [type(found).__name__, str(found)]
            elif found is None:  # what it has changed
                frame = sys._getframe(2)
                code = frame.f_code
                found = [frame.f_locals.get(each) for each in code.co_varnames[: code.co_argcount]]
            self.values[name][str(call)] = round(value(found), 6)
        except Exception:  # a value that is not whole yet is none
            return
        finally:
            self._is_busy = False


def _returning(name: str, returned: object) -> object:
    watch = Watch.current
    if watch is not None and name not in watch.done:
        watch.saw(name, returned)
    return returned


def _entering(name: str) -> None:
    if Watch.current is not None:
        Watch.current.enters(name, sys._getframe(1))


setattr(builtins, SENDER, _returning)
setattr(builtins, ENTERED, _entering)


class Telling(SourceFileLoader):
    """Loads a module of the package so that each function tells what it returns.

    A profiler would be told of each call of the libraries as well: that takes as long as the cases themselves.
    """

    def exec_module(self, module: ModuleType) -> None:
        """Load the module; what it calls meanwhile hangs on who is the first to load it, and is not told."""
        watch, Watch.current = Watch.current, None
        try:
            super().exec_module(module)
        finally:
            Watch.current = watch

    def get_code(self, fullname: str) -> CodeType:
        """The module's code, never that of its bytecode file."""
        path = self.get_filename(fullname)
        tree = _Returns(path.rpartition(PACKAGE)[2]).visit(ast.parse(self.get_data(path), path))
        return compile(ast.fix_missing_locations(tree), path, "exec", dont_inherit=True)


class _Finder:
    """Finds the package's modules for ``Telling``, but for those that are compiled to machine code."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None, target: object = None) -> ModuleSpec | None:
        if name.partition(".")[0] != PACKAGE.strip(os.sep) or name.startswith(COMPILED):
            return None
        spec = PathFinder.find_spec(name, path)
        if spec and spec.origin and isinstance(spec.loader, SourceFileLoader):
            spec.loader = Telling(name, spec.origin)
        return spec


def tell(left_out: tuple[str, ...] = LEFT_OUT, not_entered: tuple[str, ...] = ("",)) -> None:
    """From now on modules of the package are loaded so that their functions tell what they return.

    Args:
        left_out: Begins of the names of functions that do not.
        not_entered: Begins of the names of those that do not tell that they begin; without it none does.
    """
    _Returns.left_out, _Returns.not_entered = left_out, not_entered
    sys.meta_path.insert(0, _Finder)


class _Returns(ast.NodeTransformer):
    """Sends what functions return, yield and raise through ``_returning``; a lambda has no name."""

    left_out: tuple[str, ...] = LEFT_OUT
    not_entered: tuple[str, ...] = ("",)

    def __init__(self, file: str) -> None:
        self.module = file.removesuffix(".py").replace(os.sep, ".")
        self.inside: list[str] = []
        self.name = ""

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        self.inside.append(node.name)
        self.generic_visit(node)
        self.inside.pop()
        return node

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        outer = self.name
        own = f"{self.module}:{'.'.join([*self.inside, node.name])}"
        self.name = "" if own.startswith(self.left_out) else own
        self.inside += [node.name, "<locals>"]
        node.body = [self.visit(each) for each in node.body]
        del self.inside[-2:]
        if self.name and not isinstance(node.body[-1], ast.Return | ast.Raise):
            node.body.append(self._told(ast.Constant(None), node.body[-1]))
        if self.name and not self.name.startswith(self.not_entered):
            entered = ast.Expr(ast.Call(ast.Name(ENTERED, ast.Load()), [ast.Constant(self.name)], []))
            node.body.insert(1 if ast.get_docstring(node) is not None else 0, ast.copy_location(entered, node.body[0]))
        self.name = outer
        return node

    def visit_Return(self, node: ast.Return) -> ast.AST:
        self.generic_visit(node)
        return self._told(node.value or ast.Constant(None), node) if self.name else node

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        self.generic_visit(node)
        if self.name and isinstance(node.exc, ast.Call):
            told: list[ast.expr] = [ast.Constant(f"{self.name}{RAISES}"), node.exc]
            node.exc = ast.Call(ast.Name(SENDER, ast.Load()), told, [])
        return node

    def visit_Yield(self, node: ast.Yield) -> ast.AST:
        self.generic_visit(node)
        return ast.copy_location(ast.Yield(self._sent(node.value or ast.Constant(None))), node) if self.name else node

    def _told(self, returned: ast.expr, at: ast.stmt) -> ast.Return:
        return ast.copy_location(ast.Return(self._sent(returned)), at)

    def _sent(self, value: ast.expr) -> ast.expr:
        return ast.Call(ast.Name(SENDER, ast.Load()), [ast.Constant(self.name), value], [])


def gathered(folder: Path) -> Values:
    """What the processes of a case have written."""
    found: Values = defaultdict(dict)
    for file in folder.glob("*.json"):
        for name, values in json.loads(file.read_text(encoding="utf-8")).items():
            found[name] |= {f"{file.stem}.{call}": each for call, each in values.items()}
    return dict(found)


def steady(runs: Sequence[Values]) -> Values:
    """What all runs of a case agree on, each value once.

    Args:
        runs: Of the same case, on machines that round differently.
    """
    first, *others = runs
    found: Values = {}
    for name, values in first.items():
        kept: dict[float, str] = {}  # the first call that returned it
        for call, x in sorted(values.items(), key=lambda each: [int(n) for n in each[0].split(".")]):
            if all(abs(x - each.get(name, {}).get(call, math.inf)) <= STEADY for each in others):
                kept.setdefault(round(x, 2), call)
        if kept:
            found[name] = {call: values[call] for call in [*kept.values()][:MOST]}
    return found


def of_first_calls(values: Values) -> Values:
    """The values of a campaign that are held: how many rows go together later hangs on the time that they take."""
    found = {}
    for name, calls in values.items():
        if first := {call: x for call, x in calls.items() if int(call.split(".")[1]) <= FIRST_CALLS}:
            found[name] = first
    return found


def save(path: Path, values: Values) -> None:
    """Write a file of the reference: a function and its values in a line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"{name} {' '.join(f'{call}={x:.4f}' for call, x in values[name].items())}" for name in sorted(values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def load(path: Path) -> Values:
    """A file of the reference; nothing where there is none."""
    found: Values = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        name, *values = line.split(" ")
        found[name] = {call: float(x) for call, _, x in (each.partition("=") for each in values)}
    return found


def moved(case: str, was: Values, now: Values) -> list[str]:
    """Functions that return something else than they did; those that are not called any more are left out.

    Args:
        case: Its name, in front of each.
        was: The reference.
        now: What they return now.
    """
    found = []
    for name in sorted(was.keys() & now.keys()):
        for call in was[name].keys() & now[name].keys():
            old, new = was[name][call], now[name][call]
            if abs(old - new) > NEAR:
                found.append(
                    f"{case}: inside of it {name} returns something else ({old:.4f} -> {new:.4f}, call {call})"
                )
                break
    return found
