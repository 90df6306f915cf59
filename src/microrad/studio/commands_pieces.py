"""Pieces of a command line and of lines of Python: paths, options and values that stay what they are when pasted."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

WIDTH = 80
"""Columns of a printed table that goes to a file, as the command line has them."""


def path_argument(path: Path) -> str:
    """A path as an argument: one that begins like an option is led by its folder."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def option(name: str, value: object) -> tuple[str, ...]:
    """An option with its value, in one word where the value begins like an option; nothing without a value."""
    if value is None:
        return ()
    said = path_argument(value) if isinstance(value, Path) else repr(value) if isinstance(value, float) else str(value)
    return (f"{name}={said}",) if said.startswith("-") else (name, said)


def flag(name: str, on: bool) -> tuple[str, ...]:
    """An option without a value, where it is on."""
    return (name,) if on else ()


def path_text(path: Path) -> str:
    """A path as text in Python."""
    return repr(str(path))


def path_texts(paths: Iterable[Path]) -> str:
    """A list of paths as text in Python."""
    return f"[{', '.join(map(path_text, paths))}]"


def as_path(path: Path) -> str:
    """A path in Python."""
    return f"Path({path_text(path)})"


def mission_call(file: Path, mirror: Path | None) -> str:
    """The call that reads a mission, with the mirror of another file where one is given."""
    return f"load_mission({path_text(file)}{'' if mirror is None else f', {path_text(mirror)}'})"


def new_file(path: Path, overwrite: bool) -> tuple[str, ...]:
    """Lines for a file that is written to, and may be there only where it is to be replaced."""
    check = () if overwrite else ("if path.exists():", "    raise FileExistsError(path)")
    return (f"path = {as_path(path)}", *check)


def named(**values: object) -> Iterable[str]:
    """Named arguments of Python for those values that are given."""
    return (f"{name}={value!r}" for name, value in values.items() if value is not None)


def joined(*lines: str) -> str:
    """Lines as a text."""
    return "\n".join(lines) + "\n"
