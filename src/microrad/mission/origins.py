"""Whether a comment still stands behind the value that it was written for."""

import math
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib import resources

from microrad.core.units import UnitError, parse_quantity
from microrad.mission.presets import PAPER, preset_text, presets
from microrad.mission.toml import scan, value_of


def written_for(key: str, comment: str, value: str) -> str:
    """The value that a comment was written for, where it stands behind another one now; "" where it does not.

    The value returned is raw TOML. It is known only for a comment that the shipped missions and presets hold, word for
    word, behind the same dotted key and one value. Quantities that are equal in other units ("5 cm", "50 mm") are one
    value.

    Args:
        key: The dotted key.
        comment: The comment behind it.
        value: The value in front of the comment now, raw TOML.
    """
    there = _shipped().get((key, comment), ()) if comment else ()
    if not there or any(_same(value, each) for each in there) or not all(_same(each, there[0]) for each in there):
        return ""
    return " ".join(there[0].split())


def of_paper(key: str, value: str) -> str:
    """The raw value that the paper's mission has for a dotted key, where it is another one; "" where it is not.

    Args:
        key: The dotted key.
        value: The value that it has now, raw TOML.
    """
    there = _paper().get(key, value)
    return "" if _same(value, there) else " ".join(there.split())


def is_shipped(key: str, value: str) -> bool:
    """Whether the paper's mission or a preset has this value for a dotted key, whatever stands behind it.

    Args:
        key: The dotted key.
        value: The value that it has now, raw TOML.
    """
    return any(_same(value, each) for (name, _), values in _shipped().items() if name == key for each in values)


@cache
def _shipped() -> Mapping[tuple[str, str], tuple[str, ...]]:
    """Values by key and comment, of the paper's mission and every preset."""
    found: dict[tuple[str, str], tuple[str, ...]] = {}
    for text in (_shipped_mission(), *(preset.text for preset in presets())):
        for each in scan(text):
            if each.kind == "key":
                where = each.key, each.comment
                found[where] = (*found.get(where, ()), each.value)
    return found


@cache
def _paper() -> Mapping[str, str]:
    return {each.key: each.value for each in scan(preset_text(PAPER)) if each.kind == "key"}


def _shipped_mission() -> str:
    return (resources.files("microrad.mission") / "missions" / "leo-geo.toml").read_text(encoding="utf-8")


def _same(value: str, other: str) -> bool:
    if value == other:
        return True
    ours, theirs = value_of(value), value_of(other)
    return ours is not None and theirs is not None and _equal(ours, theirs)


def _equal(ours: object, theirs: object) -> bool:
    if isinstance(ours, list) and isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(_equal, ours, theirs))
    if isinstance(ours, str) and isinstance(theirs, str):
        unit = theirs.partition(" ")[2]
        with suppress(UnitError, ValueError):
            return math.isclose(parse_quantity(ours, unit), parse_quantity(theirs, unit), rel_tol=1e-12)
    return isinstance(ours, bool) == isinstance(theirs, bool) and ours == theirs
