"""Keys of a mission as a campaign names them, "communication.transmit_power": what each may hold and where it is."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, get_args, get_origin

from pydantic.fields import FieldInfo

from microrad.mission.fields import Monthly, OrWord, Quantity, Several, Share, Table, Whole
from microrad.mission.file import kind_of
from microrad.mission.model import LinkMission, Mission

MIRROR = "mirror"
"""What a campaign calls the mirror as a whole: the key of mirror files, and of the covariance of an identification.

Its covariance is that of the mirror that the loop has: of several axes where the mission names one (`MIRROR_FILE`)."""

OPTICAL = "operations.optical"
"""Key of the optical downlink, which an output of the day needs."""

MIRROR_FILE = "fine_pointing.mirror_file"
"""Key of the file of a mirror of several axes."""

_NOT_OF_THE_LOOP = frozenset(
    (
        *("acquisition", "beacon", "channel", "communication", "constellation", "jitter", "name"),
        *("operations", "orbit", "point_ahead", "pointing", "requirement", "scenario"),
    )
)
_OF_THE_QUAD_CELL = frozenset({"answer", "terminals"})
_OF_THE_PATH = frozenset({"channel", "orbit"})
_OF_THE_AIR = ("answer.wavelength", "channel.", "orbit.leo.", "orbit.geo.longitude", "terminals.leo_aperture")


class UnknownKeyError(Exception):
    """A key that the mission does not have: why, what would do, and the key that it resembles."""

    def __init__(self, reason: str, expected: str, nearest: str = "") -> None:
        """Keep the texts.

        Args:
            reason: what is wrong with the key.
            expected: what would do.
            nearest: the key that it resembles, "" without one.
        """
        super().__init__(reason)
        self.reason, self.expected, self.nearest = reason, expected, nearest


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a mission: the table that it stands in, its name there, and its rule where it holds quantities.

    ``numeric`` says that single values of it can be drawn: a quantity, or a plain number, that is not a list. Of a list
    each ``item`` has a key of its own, its place from 1 behind that of the list, and the rule of one item. A list as
    one number (`as_one`) has the ``shares`` that its items are of the largest.
    """

    text: str
    table: type[Table]
    rule: Quantity | Several | None
    item: int | None = None
    shares: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """The last part of it."""
        return self.text.rpartition(".")[2]

    @property
    def numeric(self) -> Quantity | None:
        """The rule of a single number that may take any value within its bounds, or None."""
        rule = self.rule
        if isinstance(rule, OrWord):
            return Quantity(rule.unit, rule.typical, rule.above, rule.least, rule.most)
        return rule if isinstance(rule, Quantity) and type(rule) in (Quantity, Share) else None

    @property
    def unit(self) -> str:
        """SI unit of its numbers, "" for plain ones and for words."""
        return "" if self.rule is None or isinstance(self.rule, Several) else self.rule.unit

    def written(self, value: float) -> object:
        """A value in SI units as a mission file has it; it is read back to the same bits."""
        if isinstance(self.rule, Whole):
            return int(value)
        if self.shares:
            return [replace(self, shares=()).written(value * share) for share in self.shares]
        return f"{value!r} {self.unit}" if self.unit else value


def find(key: str, data: Mapping[str, Any]) -> Key:
    """The key of a mission. Raises `UnknownKeyError`.

    Args:
        key: the dotted key.
        data: raw data of the mission: they say which names there are in [pointing.lines] and its like.
    """
    parts = tuple(key.split("."))
    return _find(kind_of(data), parts, 0, data)


def _find(table: type[Table], parts: tuple[str, ...], at: int, data: object) -> Key:
    """The key inside a table, whose own keys begin with the part at a place."""
    fields = {info.alias or name: info for name, info in table.model_fields.items()}
    if parts[at] not in fields:
        raise _unknown(parts, at, list(fields))
    kind, is_named = _table_in(fields[parts[at]])
    inside = _at(data, parts[at])
    if kind is not None and is_named:
        at += 1
        names = list(inside) if isinstance(inside, Mapping) else []
        if at == len(parts) or parts[at] not in names:
            raise _unknown(parts, at, names)
        inside = _at(inside, parts[at])
    is_last = at == len(parts) - 1
    rule = None if kind is not None else rule_in(fields[parts[at]])
    if isinstance(rule, Several) and at == len(parts) - 2:
        return Key(".".join(parts), table, rule.each, _item(parts, inside))
    if kind is None and not is_last:
        raise UnknownKeyError(f"goes on behind {'.'.join(parts[: at + 1])}, which holds a value", "the key without it")
    if isinstance(rule, Monthly) and not isinstance(inside, list):
        rule = rule.each
    if kind is None:
        return Key(".".join(parts), table, rule)
    if is_last:
        keys = [info.alias or name for name, info in kind.model_fields.items()]
        raise UnknownKeyError("is a table and no value", f"one of its keys {', '.join(keys)}")
    return _find(kind, parts, at + 1, inside)


def as_one(key: Key, items: object) -> Key:
    """The key of a list as one number, its largest item, which the others follow in proportion, as in `--solve`.

    Any other key, and a list with a negative item or nothing but 0, stays as it is.

    Args:
        key: the key.
        items: what the mission has there.
    """
    if not isinstance(key.rule, Several) or type(key.rule.each) is not Quantity or not isinstance(items, list):
        return key
    try:
        values = [key.rule.each.read(item) for item in items]
    except ValueError:
        return key
    largest = max(values, default=0.0)
    if largest <= 0.0 or min(values) < 0.0:
        return key
    return replace(key, rule=key.rule.each, shares=tuple(value / largest for value in values))


def within(data: object, key: str) -> object:
    """What raw data have at a key, or None.

    Args:
        data: raw data of a mission.
        key: the dotted key.
    """
    for name in key.split("."):
        data = _at(data, name)
    return data


def _item(parts: tuple[str, ...], items: object) -> int:
    """The place of an item, the last part of its key, in the list that the mission has there."""
    last, count = parts[-1], len(items) if isinstance(items, list) else 0
    if last.isdecimal() and last.isascii() and last[0] != "0" and len(last) <= len(str(count)) and int(last) <= count:
        return int(last)
    key = ".".join(parts[:-1])
    expected = " or ".join(item_keys(key, count)) if count else "a list that the mission has"
    raise UnknownKeyError(f"is no item of {key}, a list of {count}", expected)


def item_keys(key: str, count: int) -> list[str]:
    """The keys of the items of a list, of a long one the first and the last.

    Args:
        key: the key of the list.
        count: how many items it has.
    """
    places = range(1, count + 1) if count <= 3 else (1, count)
    return [f"{key}.{place}" for place in places]


def nearest(word: object, words: Iterable[str]) -> str:
    """The one of some words that a word resembles, or "".

    Args:
        word: what was written.
        words: what could have been meant.
    """
    return next(iter(difflib.get_close_matches(str(word)[:60], list(words), n=1)), "")


def _at(data: object, name: str) -> object:
    return data.get(name) if isinstance(data, Mapping) else None


def _unknown(parts: tuple[str, ...], at: int, names: list[str]) -> UnknownKeyError:
    """What to say of a part that is none of the names that can stand there."""
    above = ".".join(parts[:at])
    where = f"[{above}]" if above else "the mission"
    expected = f"one of {', '.join(names)}" if names else "a table that the mission has"
    if at == len(parts):
        return UnknownKeyError("is a group of named tables and no value", expected)
    near = nearest(parts[at], names)
    return UnknownKeyError(f"is no key of {where}", expected, near and ".".join((*parts[:at], near, *parts[at + 1 :])))


def _table_in(info: FieldInfo) -> tuple[type[Table] | None, bool]:
    """The table that a field holds, and whether it holds several by name."""
    kinds = (info.annotation, *get_args(info.annotation))
    kind = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Table)), None)
    return kind, get_origin(info.annotation) is dict


def rule_in(info: FieldInfo) -> Quantity | Several | None:
    """The rule of a field; of a key that may be left out it stands inside the annotation."""
    inner = [m for kind in get_args(info.annotation) for m in getattr(kind, "__metadata__", ())]
    return next((rule for rule in (*info.metadata, *inner) if isinstance(rule, Quantity | Several)), None)


# --------------------------------------------------------------------------------------------------------------- data
def put(data: Mapping[str, Any], key: str, value: object) -> dict[str, Any]:
    """The raw data with another value at a key; what is not on its way is shared.

    Args:
        data: raw data of a mission.
        key: the dotted key.
        value: what is to stand there, as a file has it.
    """
    name, _, rest = key.partition(".")
    inner = data.get(name)
    if rest and isinstance(inner, list):
        return {**data, name: [value if str(place) == rest else item for place, item in enumerate(inner, 1)]}
    return {**data, name: put(inner if isinstance(inner, Mapping) else {}, rest, value) if rest else value}


def flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values by dotted key, whether a file has written them in one key or in tables inside each other.

    Args:
        data: tables inside each other.
        prefix: what stands before each key, with its dot.
    """
    found: dict[str, Any] = {}
    for name, value in data.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{name}.")
        else:
            found[f"{prefix}{name}"] = value
    return found


def flat_tables(data: Mapping[str, Any], inner: tuple[str, ...], prefix: str = "") -> dict[str, Any]:
    """Tables by dotted key.

    Args:
        data: tables inside each other.
        inner: names of those that belong to the table that they stand in.
        prefix: what stands before each key, with its dot.
    """
    found: dict[str, Any] = {}
    for name, value in data.items():
        key = f"{prefix}{name}"
        if not isinstance(value, dict):
            found[key] = value
            continue
        own = {k: v for k, v in value.items() if not isinstance(v, dict) or k in inner}
        deeper = {k: v for k, v in value.items() if k not in own}
        if own or not deeper:
            found[key] = own
        found |= flat_tables(deeper, inner, f"{key}.")
    return found


# --------------------------------------------------------------------------------------------------------------- loop
def touches_loop(key: str, m: LinkMission) -> bool:
    """Whether the fine-pointing loop depends on a key: on all but those of the tables that it never looks into.

    Aperture and wavelength matter to it where its optical sensor is a quad cell, and so do air and orbits between a
    station and a satellite. Where the light that it tracks comes down through turbulent air, what moves its angle
    matters. Links alone have no loop.

    Args:
        key: a key of the mission.
        m: the mission.
    """
    if not isinstance(m, Mission):
        return False
    table = key.partition(".")[0]
    if m.loop_in_turbulence and key.startswith(_OF_THE_AIR):
        return True
    if table in _OF_THE_QUAD_CELL or (m.path is not None and table in _OF_THE_PATH):
        return m.fine_pointing is not None and m.fine_pointing.optical_sensor.quad_cell is not None
    return table not in _NOT_OF_THE_LOOP
