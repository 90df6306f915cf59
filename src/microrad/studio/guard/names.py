"""Names that come from outside: a safe base name for a file, and a path that stays within its folder."""

from __future__ import annotations

import os
import re
import unicodedata
from pathlib import Path

from microrad.core.units import printable

MAX_NAME_BYTES = 160

_DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³])\s*(\..*)?", re.IGNORECASE | re.DOTALL)
_WINDOWS = '<>:"|?*'
_DROP_AGAIN = "rename it and drop it again"
_UNSEEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


class NameRefusedError(ValueError):
    """A name or path that is not taken; the message shows it harmlessly and says what to do."""


def shown(name: str) -> str:
    """The name for a message: what does not print is spelled out, and a long one is cut."""
    text = printable(name[:60])
    return f"'{text}...'" if len(name) > 60 else f"'{text}'"


def typed_words(error: NameRefusedError) -> str:
    """The refusal of a name that was typed, where the words are those for a file that was dropped."""
    return str(error).replace(_DROP_AGAIN, "choose another name")


def safe_name(name: str) -> str:
    """The name of a file as it may be stored in a folder, with composed characters (NFC).

    Raises `NameRefusedError` for a path, for characters that do not print or turn the direction of writing, for a
    leading dot, a trailing dot or blank, a name of a device of Windows, and one of more than 160 bytes. HTML in a name
    is text like any other.
    """
    name = unicodedata.normalize("NFC", name)
    fault = _fault(name)
    if fault is not None:
        raise NameRefusedError(f"the file {shown(name)} is not taken: {fault}; {_DROP_AGAIN}")
    return name


def _fault(name: str) -> str | None:
    """What is wrong with the name, in words."""
    faults = (
        (not name.strip(), "it has no name"),
        (len(name.encode("utf-8", "replace")) > MAX_NAME_BYTES, f"its name has more than {MAX_NAME_BYTES} bytes"),
        ("/" in name or "\\" in name, "its name holds a path"),
        (any(unicodedata.category(c) in _UNSEEN for c in name), "its name holds characters that do not print"),
        (name[:1] in (".", " ") or name[-1:] in (".", " "), "its name begins or ends with a dot or a blank"),
        (_DEVICE.fullmatch(name) is not None, "its name is that of a device on Windows"),
        (os.name == "nt" and any(c in _WINDOWS for c in name), f"its name holds one of {' '.join(_WINDOWS)}"),
    )
    return next((words for wrong, words in faults if wrong), None)


def within(folder: Path, name: str | Path) -> Path:
    """A path in a folder, resolved with its links; raises `NameRefusedError` where it leaves the folder.

    Args:
        folder: what must not be left.
        name: a path, seen from the folder unless it is absolute.
    """
    try:
        root = folder.resolve()
        path = (root / name).resolve()
    except (OSError, ValueError, RuntimeError) as error:  # NUL in the name, a loop of links
        raise NameRefusedError(f"{shown(str(name))} is no path that can be opened: {error}") from None
    if not path.is_relative_to(root):
        raise NameRefusedError(f"{shown(str(name))} is outside of {root}; choose a file in that folder")
    return path
