#!/usr/bin/env python3
"""List where the code converts units, angles and decibels, in a drawn order: the places of faults/units.toml.

.venv/bin/python scripts/unit_places.py          each kind behind its number of places

A place is a term of a function, as the parser reads it: a product or quotient with a power of 1000, one with pi, a call
of degrees or radians (or 180 or 360 as a factor), a power of ten or 10 or 20 times a logarithm (or a call of dbm or
watt), a product or quotient with 2 or 1/2 beside the name of an angle, a width or a spread. The order is that of a
seed, anew for each kind.
"""

import ast
import functools
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).resolve().parent.parent / "src"
SEED = 20261127
KINDS = ("factor of 1000", "two pi", "degrees for radians", "decibel for ratio", "half for full")
_THOUSANDS = {10.0**power for power in (-12, -9, -6, -3, 3, 6, 9, 12)}
_WIDTH = re.compile(
    r"angle|_rad\b|half|width|divergence|amplitude|peak|field|waist|rms|swing|travel|span|sigma|radius|diameter"
)


class Place(NamedTuple):
    """A term that converts: what kind, where, in which line."""

    kind: str
    function: str
    line: int
    text: str


def main() -> int:
    """Print the places. Returns 0."""
    for kind in KINDS:
        places = drawn(kind)
        print(f"{kind}: {len(places)}")
        for place in places:
            print(f"  {place.function} {place.line}: {place.text}")
    return 0


def drawn(kind: str) -> list[Place]:
    """The places of a kind in the order of the seed, one of a function and line.

    Args:
        kind: one of `KINDS`.
    """
    places = sorted(place for place in every() if place.kind == kind)
    random.Random(f"{SEED} {kind}").shuffle(places)
    return places


@functools.cache
def every() -> frozenset[Place]:
    """All places of the package."""
    return frozenset(_places())


def _places() -> Iterator[Place]:
    for file in sorted((SOURCE / "microrad").rglob("*.py")):
        source = file.read_text(encoding="utf-8")
        module = ".".join(file.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")
        yield from _inside(ast.parse(source), f"{module}:", source.splitlines())


def _inside(node: ast.AST, name: str, lines: list[str]) -> Iterator[Place]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _inside(child, f"{name}{'' if name.endswith(':') else '.'}{child.name}", lines)
            continue
        if isinstance(child, ast.expr) and not name.endswith(":"):
            for kind in _kinds(child):
                yield Place(kind, name, child.lineno, lines[child.lineno - 1].strip())
        yield from _inside(child, name, lines)


def _kinds(term: ast.expr) -> Iterator[str]:
    if isinstance(term, ast.Call):
        called = getattr(term.func, "attr", getattr(term.func, "id", ""))
        if called in ("radians", "degrees"):
            yield "degrees for radians"
        if called in ("dbm", "watt"):
            yield "decibel for ratio"
    if not isinstance(term, ast.BinOp):
        return
    numbers = {_number(term.left), _number(term.right)}
    if isinstance(term.op, ast.Pow) and _number(term.left) == 10.0:
        yield "decibel for ratio"
    if not isinstance(term.op, ast.Mult | ast.Div):
        return
    if numbers & _THOUSANDS:
        yield "factor of 1000"
    if any(isinstance(part, ast.Attribute) and part.attr == "pi" for part in ast.walk(term)):
        yield "two pi"
    if numbers & {180.0, 360.0}:
        yield "degrees for radians"
    if numbers & {10.0, 20.0} and "log10" in ast.unparse(term):
        yield "decibel for ratio"
    if numbers & {2.0, 0.5} and _WIDTH.search(ast.unparse(term)):
        yield "half for full"


def _number(term: ast.expr) -> float | None:
    plain = isinstance(term, ast.Constant) and type(term.value) in (int, float)
    return float(term.value) if plain else None  # type: ignore[attr-defined]


if __name__ == "__main__":
    sys.exit(main())
