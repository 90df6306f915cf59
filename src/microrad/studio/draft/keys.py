"""What a key of a mission may hold, for a form: its kind, its rule with unit and bounds, its words; and as TOML."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal, cast, get_args, get_origin

from pydantic.fields import FieldInfo

from microrad.mission.fields import Quantity, Several, Table
from microrad.mission.model import Mission
from microrad.mission.toml import scan, value_of

Kind = Literal["quantity", "number", "whole number", "switch", "choice", "text", "list"]

_KINDS: dict[str, Kind] = {"number": "number", "integer": "whole number", "boolean": "switch", "array": "list"}


@dataclass(frozen=True, slots=True)
class Key:
    """A key of the mission: what kind of value it holds, its description, and whether its table needs it.

    `rule` reads a value and has its unit (SI) and bounds; text and choices have none.
    """

    key: str
    kind: Kind
    description: str
    required: bool
    choices: tuple[str, ...] = ()
    rule: Quantity | Several | None = None

    @property
    def quantity(self) -> Quantity | None:
        """The rule of the value, or of each item of a list."""
        return self.rule.each if isinstance(self.rule, Several) else self.rule

    @property
    def unit(self) -> str:
        """The SI unit of the value or of each item; "" where there is none."""
        return self.quantity.unit if self.quantity is not None else ""

    @property
    def wanted(self) -> str:
        """What the key expects, in the words of the command line."""
        if self.rule is not None:
            return self.rule.wanted
        return " or ".join(f'"{choice}"' for choice in self.choices) or "text"

    @property
    def example(self) -> str:
        """A value within the bounds, as it is typed; "" for text."""
        return self.rule.example if self.rule is not None else next(iter(self.choices), "")

    def toml(self, typed: str) -> str:
        """What is typed as a value of TOML: quoted where the kind asks for text, else as it stands.

        What is no value of the kind goes in quotes, so that the mission's own check says what is wrong with it.
        """
        typed = typed.strip()
        if self.kind == "list":
            return _list(typed, quoted=bool(self.unit) or _schema(self.rule)["items"].get("type") == "string")
        return _item(typed, quoted=self.kind in ("quantity", "text", "choice"))


@lru_cache(maxsize=2048)
def key_of(dotted: str) -> Key | None:
    """The key with this dotted name, or None where the mission has no such key or a table stands there."""
    return _find(Mission, dotted, dotted.split("."))


def keys_in(dotted: str) -> tuple[Key, ...]:
    """The keys of a table (of the root for ""), its inner tables left out; none where there is no such table."""
    table = _table(Mission, dotted.split(".") if dotted else [])
    if table is None:
        return ()
    names = (info.alias or name for name, info in table.model_fields.items())
    found = (key_of(f"{dotted}.{name}" if dotted else name) for name in names)
    return tuple(key for key in found if key is not None)


def typed_from(raw: str) -> str:
    """A raw value of TOML as one types it into a form: without quotes, a list without brackets."""
    value = value_of(raw, str)
    if isinstance(value, list) and all(isinstance(item, str | int) for item in value):
        return ", ".join(str(item).lower() if isinstance(item, bool) else str(item) for item in value)
    return value if isinstance(value, str) else raw


# ------------------------------------------------------------------------------------------------------------ to TOML
def loose_toml(typed: str) -> str:
    """What is typed for a key that no table knows: as it stands where it is a value of TOML, else in quotes."""
    return _item(typed.strip(), quoted=False)


def _item(typed: str, *, quoted: bool) -> str:
    """One value: what is in quotes already stays, and so does what may stand without."""
    value = value_of(typed) if _stands_alone(typed) else None
    if isinstance(value, str) or (not quoted and value is not None):
        return typed
    return json.dumps(typed, ensure_ascii=False).replace("\x7f", "\\u007f")


def _list(typed: str, *, quoted: bool) -> str:
    """A list, with or without its brackets, its items in quotes or not."""
    whole = typed if typed.startswith("[") else f"[{typed}]"
    items = value_of(whole) if _stands_alone(whole) else None
    if isinstance(items, list) and all(isinstance(item, str) for item in items if quoted):
        return whole
    inner = typed.removeprefix("[").removesuffix("]") if typed.startswith("[") else typed
    if '"' in inner or "'" in inner:
        return _item(typed, quoted=True)
    return f"[{', '.join(_item(item.strip(), quoted=quoted) for item in inner.split(',') if item.strip())}]"


def _stands_alone(typed: str) -> bool:
    """Whether this can be a value and nothing else: no comment behind it, no further key."""
    found = scan(f"x = {typed}")
    return len(found) == 1 and found[0].value == typed


# --------------------------------------------------------------------------------------------------------- the models
def _find(table: type[Table], dotted: str, parts: list[str]) -> Key | None:
    holder = _table(table, parts[:-1])
    info = None if holder is None else _info(holder, parts[-1])
    if info is None or _inner(info) is not None:
        return None
    rule = next((rule for rule in _rules(info) if isinstance(rule, Quantity | Several)), None)
    choices = next((get_args(kind) for kind in _kinds(info.annotation) if get_origin(kind) is Literal), ())
    kind: Kind = "choice" if choices else "text" if rule is None else _kind(rule)
    return Key(dotted, kind, info.description or "", info.is_required(), choices, rule)


def _kind(rule: Quantity | Several) -> Kind:
    schema = _schema(rule)
    schema = schema["anyOf"][0] if "anyOf" in schema else schema
    if schema.get("type") == "string":
        return "quantity" if isinstance(rule, Quantity) and rule.unit else "text"
    return _KINDS[schema["type"]]


def _schema(rule: Quantity | Several | None) -> dict[str, Any]:
    """The JSON schema of a rule, which needs nothing of pydantic's."""
    nothing = cast("Any", None)
    return {} if rule is None else rule.__get_pydantic_json_schema__(nothing, nothing)


def _table(table: type[Table], parts: list[str]) -> type[Table] | None:
    """The table of the parts of a dotted name; a name of one's own stands for any of the tables of its kind."""
    while parts:
        info = _info(table, parts[0])
        inner = None if info is None else _inner(info)
        if info is None or inner is None:
            return None
        named = any(get_origin(kind) is dict for kind in _kinds(info.annotation))
        if named and len(parts) == 1:
            return None
        table, parts = inner, parts[2:] if named else parts[1:]
    return table


def _info(table: type[Table], key: str) -> FieldInfo | None:
    return next((info for name, info in table.model_fields.items() if (info.alias or name) == key), None)


def _inner(info: FieldInfo) -> type[Table] | None:
    """The table that a field holds, by itself or by names, or None."""
    kinds = [each for kind in _kinds(info.annotation) for each in (kind, *get_args(kind))]
    return next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Table)), None)


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types that an annotation allows, without their rules."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _kinds(get_args(annotation)[0])
    elif origin is None or origin in (Literal, dict, tuple):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from _kinds(part)


def _rules(info: FieldInfo) -> Iterator[Any]:
    """The rules of a field: its own, and those inside "or nothing"."""
    yield from info.metadata
    for part in get_args(info.annotation):
        yield from getattr(part, "__metadata__", ())
