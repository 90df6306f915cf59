"""Laser links from the literature as link files, with the keys that no source prints and that have to be given."""

import difflib
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from microrad.mission.fields import UNKNOWN

PAPER = "paper"
"""Name of the preset that holds the source paper's whole mission."""


@dataclass(frozen=True, slots=True)
class Preset:
    """A published link as the text of its link file.

    `title` is the first comment line of the text, `unknown` holds the dotted keys ("communication.distance") that have
    to be given before the file can be loaded, and `known` counts the keys that hold a value. `whole` is one that has a
    mirror and a loop, too: a mission.
    """

    name: str
    title: str
    text: str
    unknown: tuple[str, ...]
    known: int
    whole: bool


@cache
def presets() -> tuple[Preset, ...]:
    """All presets, by name."""
    return tuple(_preset(name, file) for name, file in sorted(_files().items()))


def preset_text(name: str) -> str:
    """Text of the link file of a preset, to be written out, completed and read by `mission.file.load_link`.

    Raises `ValueError` for a name that no preset has, with the names nearest to it.
    """
    files = _files()
    if name not in files:
        near = difflib.get_close_matches(name[:60].lower(), files, n=3, cutoff=0.4)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(sorted(files))}"
        raise ValueError(f'there is no preset "{name[:60]}"; {hint}')
    return files[name].read_text(encoding="utf-8")


def _files() -> dict[str, Traversable]:
    folder = resources.files("microrad.mission") / "missions" / "presets"
    return {each.name.removesuffix(".toml"): each for each in folder.iterdir() if each.name.endswith(".toml")}


def _preset(name: str, file: Traversable) -> Preset:
    text = file.read_text(encoding="utf-8")
    data = tomllib.loads(text)
    values = dict(_leaves(data))
    unknown = tuple(key for key, value in values.items() if value == UNKNOWN)
    title = text.partition("\n")[0].lstrip("#").strip()
    return Preset(name, title, text, unknown, len(values) - len(unknown), "mirror" in data)


def _leaves(data: Mapping[str, Any], table: str = "") -> Iterator[tuple[str, object]]:
    """Dotted key and value of everything that is no table."""
    for name, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{table}{name}.")
        else:
            yield f"{table}{name}", value
