"""What a key of a mission or mirror file means: from the tables themselves, the shipped mission, and who reads it."""

import ast
import difflib
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from microrad.mission.fields import Quantity, Several, Table, rule_of_field
from microrad.mission.model import Mission
from microrad.mission.tables.coupled_mirror import CoupledMirror
from microrad.mission.tables.mirror import Mirror
from microrad.mission.toml import scan

FILES: Mapping[str, type[Table]] = {
    "mission file": Mission,
    "mirror file": Mirror,
    "mirror file of several axes": CoupledMirror,
}
"""Whose keys are explained, by what the file is called."""

ANY = "NAME"
"""Stands in a dotted key for a name that the file's author chooses, as of an actuator."""

_TABLES = "microrad.mission.tables"
_NEAR, _MOST = 3, 40


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a file.

    ``name`` is dotted, with `ANY` for what may have any name. ``holds`` says what may stand there, with unit and
    bounds, ``default`` what counts where it is left out ("" where it must be there). ``shipped`` are value and comment
    in the mission that `microrad init` writes, "" where it has none. ``read_by`` are the modules that read it.
    ``inside`` are the keys of a table.
    """

    file: str
    name: str
    meaning: str
    holds: str
    default: str
    shipped: str
    read_by: tuple[str, ...]
    inside: tuple[str, ...] = ()


def explained(key: str) -> tuple[Key, ...]:
    """All keys that are called so, by their whole dotted name or by its end.

    Args:
        key: Such as "fine_pointing.modulus_margin", "modulus_margin" or "fine_pointing"; the name of an actuator, an
            output or a disturbance in it may be any.

    Raises:
        ValueError: For a name that no key has; says which are near.
    """
    wanted = tuple(part.strip() for part in key.split("."))
    found = [each for each in _keys() if _ends_with(each.name.split("."), wanted)]
    whole = [each for each in found if each.name.count(".") + 1 == len(wanted)]
    if found := whole or found:
        return tuple(found)
    names = list(dict.fromkeys([*(each.name for each in _keys()), *(each.name.split(".")[-1] for each in _keys())]))
    near = difflib.get_close_matches(key[:_MOST], names, n=_NEAR)
    hint = f"near it are {', '.join(near)}" if near else "microrad schema prints all keys of a mission"
    raise ValueError(f"no key of a mission or mirror file is called {key[:_MOST]!r}; {hint}")


def text(keys: Sequence[Key], columns: int) -> str:
    """What keys mean, for a terminal.

    Args:
        keys: The keys.
        columns: Width of a line.
    """
    return "\n\n".join(_said(key, columns) for key in keys)


def _said(key: Key, columns: int) -> str:
    facts = {
        "means": key.meaning,
        "holds": key.holds,
        "left out": key.default or "it must be there",
        "shipped": key.shipped,
        "keys": ", ".join(key.inside),
        "read by": ", ".join(key.read_by),
    }
    lines = [
        textwrap.fill(fact, columns, initial_indent=f"  {name:10}", subsequent_indent=" " * 12, break_on_hyphens=False)
        for name, fact in facts.items()
        if fact
    ]
    return "\n".join([f"{key.name} ({key.file})", *lines])


def _ends_with(parts: list[str], wanted: tuple[str, ...]) -> bool:
    """Whether a key is called so; a name of the author's own at its end counts only in a whole dotted name."""
    if len(wanted) > len(parts) or (parts[-1] == ANY and len(wanted) < len(parts)):
        return False
    return all(part in (ANY, each) for part, each in zip(parts[-len(wanted) :], wanted, strict=True))


@cache
def _keys() -> tuple[Key, ...]:
    return tuple(key for file, table in FILES.items() for key in _of_table(file, table, ""))


def _of_table(file: str, table: type[Table], prefix: str) -> Iterator[Key]:
    for attribute, info in table.model_fields.items():
        name = f"{prefix}{info.alias or attribute}"
        inner, by_name = _table_in(info.annotation)
        below = f"{name}.{ANY}." if by_name else f"{name}."
        inside = () if inner is None else tuple(i.alias or n for n, i in inner.model_fields.items())
        yield Key(
            file,
            name,
            info.description or _first_line(inner),
            _holds(info, inner, by_name),
            "" if info.is_required() else _default(info.default),
            _shipped().get(name, "") if file == "mission file" else "",
            _readers(table.__name__, prefix.rstrip(".").split(".")[-1], attribute),
            () if by_name else inside,
        )
        if by_name:
            yield Key(file, f"{name}.{ANY}", _first_line(inner), "a table", "nothing", "", (), inside)
        if inner is not None:
            yield from _of_table(file, inner, below)


def _first_line(table: type[Table] | None) -> str:
    return "" if table is None else (table.__doc__ or "").strip().splitlines()[0]


def _table_in(kind: Any) -> tuple[type[Table] | None, bool]:
    """The table that a key holds, and whether it holds several by name."""
    if isinstance(kind, type) and issubclass(kind, Table):
        return kind, False
    for each in get_args(kind):
        found, by_name = _table_in(each)
        if found is not None:
            return found, by_name or get_origin(kind) in (dict, Mapping)
    return None, False


def _holds(info: FieldInfo, inner: type[Table] | None, by_name: bool) -> str:
    rule = rule_of_field(info)
    if isinstance(rule, Quantity | Several):
        example = f'"{rule.example}"' if getattr(rule, "unit", "") else rule.example
        return f"{rule.wanted}; as {example}"
    if inner is not None:
        return "a table for each, under a name of your own" if by_name else "a table"
    words = _words(info.annotation)
    return " or ".join(f'"{word}"' for word in words) if words else "a text"


def _words(kind: Any) -> tuple[str, ...]:
    if get_origin(kind) is Literal:
        return tuple(map(str, get_args(kind)))
    return tuple(word for each in get_args(kind) if each is not NoneType for word in _words(each))


def _default(value: Any) -> str:
    if value is None or not (value or isinstance(value, bool | int | float)):
        return "nothing"
    return str(value).lower() if isinstance(value, bool) else str(value)


@cache
def _shipped() -> Mapping[str, str]:
    text = (resources.files("microrad.mission") / "missions" / "leo-geo.toml").read_text(encoding="utf-8")
    keys = [each for each in scan(text) if each.kind == "key"]
    return {k.key: " ".join(f"{k.value} {k.comment and f'# {k.comment}'}".split()) for k in keys}


def _readers(table: str, key_of_table: str, attribute: str) -> tuple[str, ...]:
    """Modules that use an attribute, of those that speak of its table (its class, or its key) where there are any.

    The modules that define the tables count where no other one does.
    """
    reading = [module for module, names in _used().items() if attribute in names]
    outside = [module for module in reading if not module.startswith(_TABLES)]
    of_table = [module for module in outside if {table, key_of_table} & _used()[module]]
    return tuple(of_table or outside or reading)


@cache
def _used() -> Mapping[str, frozenset[str]]:
    """The attributes that each module of the package uses, and the names, but for those of modules of tables."""
    root, found = Path(str(resources.files("microrad"))), {}
    for path in sorted(root.rglob("*.py")):
        module = ".".join(("microrad", *path.relative_to(root).with_suffix("").parts)).removesuffix(".__init__")
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        names = [each.attr for each in nodes if isinstance(each, ast.Attribute)]
        if not module.startswith(_TABLES):
            names += [each.id for each in nodes if isinstance(each, ast.Name)]
        found[module] = frozenset(names)
    return found
