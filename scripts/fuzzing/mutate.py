"""Bad inputs out of good ones: some changes to a text, to bytes or to plain data, each drawn from a `random.Random`."""

import copy
import json
import re
import struct
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

NUMBERS = (
    *("0", "-0", "0.0", "1", "-1", "2", "0.5", "1e-3", "1e3", "1e6", "-1e6", "1e9", "1e12", "1e15", "1e18", "1e-9"),
    *("1e30", "-1e30", "1e-30", "1e100", "1e-100", "1e153", "1e154", "1e155", "1e300", "1e308", "-1e308", "1e309"),
    *("1e-300", "1e-308", "1e-320", "5e-324", "1e-400", "nan", "-nan", "inf", "-inf", "NaN", "Infinity", "1e999999999"),
    *("2147483648", "-2147483649", "4294967296", "9223372036854775807", "9223372036854775808", "1" + 30 * "0"),
    *(400 * "9", 5000 * "1", "0." + 500 * "3", "0x10", "0b1", "1_000", "1__0", "٣", "１２", "1,5", "1e", ".", "--1"),
    *("+1", "001", "true", "−1", "1²", "1j", "1e5e5", "1.2.3", "99999", "360", "90", "180", "-90", "1e-15"),
)
"""How a number may be written wrongly, or rightly and out of all bounds."""
UNITS = (
    *("", " ", " m", " km", " mm", " um", " µm", " μm", " nm", " pm", " rad", " mrad", " urad", " nrad", " deg"),
    *(" V", " kV", " W", " mW", " dBm", " dB", " dBW", " Hz", " kHz", " GHz", " THz", " s", " ms", " us", " min"),
    *(" h", " d", " bit/s", " Gbit/s", " %", " m/s", " V/s", " rad/s", " K", " A/W", " parsec", " ℃", " m m", " 1"),
    *(" bit", " kg", " 1/s", " ", " M", " e5", " A", " nA", " W/Hz", " rad^2/Hz", " °", " ppm", " years", " AU"),
)
WORDS = (
    *("", " ", "unknown", "not published", "x", "nan", "1e400 m", "true", "a b", "ä", "日本", "🛰", "́", "\u202e"),
    *("../../x", "/dev/zero", "/", "..", ".", "NUL", "x" * 300, "x" * 5000, "\x1b[31m", "\x7f", "\ufeff", "\u2028"),
    *("a\\u0000b", "\\", '"', "'", "#", "=", "[", "{}", "[]", "%s", "{0}", "<b>", "&amp;", "None", "__class__", "\r"),
    *("2026-01-01", "12:00", "0 m", "-1 m", "1 m, 2 m", "1 to 2 m", "1e308 m", "1e-320 rad", "nan rad", "inf Hz"),
)
DATES = (
    *("0000-01-01T00:00:00Z", "0001-01-01T00:00:00Z", "1957-10-04T00:00:00Z", "9999-12-31T23:59:59Z", "2026-02-30"),
    *("2026-06-30T23:59:60Z", "2016-12-31T23:59:60Z", "2026-13-01T00:00:00Z", "2026-01-01T25:00:00Z", "2026-001"),
    *("2026-01-01", "2026-366T00:00:00Z", "2024-366T00:00:00", "2026-01-01T00:00:00+14:00", "10000-01-01T00:00:00Z"),
    *("2026-01-01T00:00:00." + 40 * "9", "-2026-01-01T00:00:00Z", "２０２６-01-01T00:00:00Z", "2100-01-01T00:00:00Z"),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, -(2**63) - 1, 10**30, 10**400, 0.5, -0.0, 1e308, 1e-320, float("nan")),
    *(float("inf"), float("-inf"), "", "x", "nan", "x" * 5000, "\x00", "\x1b[31m", "\ud800", [], {}, [[]], [None], [1]),
    *({"x": 1}, {"": {}}, [1e308, "x"], "../../x", "/dev/zero"),
)
"""What may stand in plain data in place of what should."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_QUOTED = re.compile(r'"[^"\n]*"')
_DATE = re.compile(r"\d{4}-\d{2,3}(?:-\d\d)?(?:T[\d:.]+Z?)?")
_UNIT = re.compile(r"(?<=\d) ?[A-Za-zµ%/^]+[A-Za-z0-9µ%/^]*")
_LOOKALIKE = str.maketrans("01-aeoµ. ", "٠１−аеоμ․\xa0")
_SIGNS = ("\0", "\n", "\n\n", "\r", "\t", ",", ";", "<", ">", "&", "<!--", "]]>", "[x]\n", 5000 * "[")
_DEEP = (30, 200, 3000, 100_000)
_SOME = (1, 1, 1, 2, 2, 3, 5)
"""How many changes an input gets."""

TextChange = Callable[[Random, str, str], str]
ByteChange = Callable[[Random, bytes, bytes], bytes]


# ---------------------------------------------------------------------------------------------------------------- text
def text(draw: Random, seeds: Sequence[bytes]) -> bytes:
    """A text with some changes, as bytes.

    Args:
        draw: What is drawn from.
        seeds: Good texts in UTF-8, one of which is changed, with pieces of another.
    """
    made, other = (draw.choice(seeds).decode("utf-8", "surrogateescape") for _ in range(2))
    for _ in range(draw.choice(_SOME)):
        made = draw.choice(_TEXT_CHANGES)(draw, made, other)
    if draw.random() < 0.06:
        return draw.choice(_ENCODINGS)(made)
    data = made.encode("utf-8", "surrogateescape" if made.isprintable() else "surrogatepass")
    return one_change(draw, data, data) if draw.random() < 0.04 else data


def replaced(draw: Random, made: str, found: re.Pattern[str], new: Callable[[str], str]) -> str:
    """The text with one match replaced.

    Args:
        draw: What is drawn from.
        made: The text.
        found: What is looked for.
        new: What stands there then, of what stood there.
    """
    places = [each.span() for each in found.finditer(made)]
    if not places:
        return made
    begin, end = draw.choice(places)
    return made[:begin] + new(made[begin:end]) + made[end:]


def _number(draw: Random, made: str, _: str) -> str:
    def new(old: str) -> str:
        how = draw.randrange(5)
        if how == 0:
            return f"{old}e{draw.choice((-320, -40, -9, -3, -1, 1, 3, 9, 40, 300))}"
        if how == 1:
            return old[1:] if old.startswith("-") else f"-{old}"
        if how == 2:
            place = draw.randrange(len(old))
            return old[:place] + draw.choice("0123456789.-+e ") + old[place + 1 :]
        return draw.choice(NUMBERS)

    return replaced(draw, made, _NUMBER, new)


def _unit(draw: Random, made: str, _: str) -> str:
    return replaced(draw, made, _UNIT, lambda _: draw.choice(UNITS))


def _word(draw: Random, made: str, other: str) -> str:
    others = _QUOTED.findall(other)
    if others and draw.random() < 0.5:
        return replaced(draw, made, _QUOTED, lambda _: draw.choice(others))
    return replaced(draw, made, _QUOTED, lambda _: f'"{draw.choice(WORDS)}"')


def _date(draw: Random, made: str, _: str) -> str:
    return replaced(draw, made, _DATE, lambda _: draw.choice(DATES))


def _value(draw: Random, made: str, _: str) -> str:
    """Another kind of value behind the equals sign of a line."""
    deep = draw.choice(_DEEP)
    kinds = (
        "",
        "[]",
        "{}",
        "true",
        "1",
        "-1.5",
        '"x"',
        "[1, 2]",
        "[[1], [2]]",
        "{x = 1}",
        "1979-05-27",
        "07:32",
        "nan",
    )
    deep_kinds = ("[" * deep + "]" * deep, "{a=" * deep + "1" + "}" * deep, "a." * min(deep, 3000) + "b", "[" * deep)
    new = draw.choice(kinds) if draw.random() < 0.9 else draw.choice(deep_kinds)
    return replaced(draw, made, re.compile(r"(?m)(?<== ).*$"), lambda _: new)


def _lines(draw: Random, made: str, other: str) -> str:
    """A line deleted, doubled, exchanged, moved, or taken from another text."""
    lines, others = made.split("\n"), other.split("\n")
    here, there = draw.randrange(len(lines)), draw.randrange(len(lines))
    how = draw.randrange(6)
    if how == 0:
        del lines[here : here + draw.choice((1, 1, 2, 10))]
    elif how == 1:
        lines[there:there] = [lines[here]] * draw.choice((1, 1, 2, 30))
    elif how == 2:
        lines[here], lines[there] = lines[there], lines[here]
    elif how == 3:
        lines.insert(there, lines.pop(here))
    elif how == 4:
        lines[here] = draw.choice(others)
    else:
        begin = draw.randrange(len(others))
        lines[here:here] = others[begin : begin + draw.choice((1, 5, 20))]
    return "\n".join(lines)


def _spliced(draw: Random, made: str, other: str) -> str:
    return made[: draw.randrange(len(made) + 1)] + other[draw.randrange(len(other) + 1) :]


def _cut(draw: Random, made: str, _: str) -> str:
    begin = draw.randrange(len(made) + 1)
    return made[:begin] if draw.random() < 0.3 else made[:begin] + made[begin + draw.choice((1, 1, 2, 8, 100)) :]


def _inserted(draw: Random, made: str, _: str) -> str:
    begin = draw.randrange(len(made) + 1)
    piece = draw.choice((*WORDS, *NUMBERS, *_SIGNS))
    return made[:begin] + piece + made[begin:]


def _alike(draw: Random, made: str, _: str) -> str:
    """Letters and digits that look like others."""
    begin = draw.randrange(len(made) + 1)
    end = begin + draw.choice((1, 3, 10, 60))
    return made[:begin] + made[begin:end].translate(_LOOKALIKE) + made[end:]


def _case(draw: Random, made: str, _: str) -> str:
    begin = draw.randrange(len(made) + 1)
    end = begin + draw.choice((1, 10, 60))
    return made[:begin] + made[begin:end].swapcase() + made[end:]


def _repeated(draw: Random, made: str, _: str) -> str:
    begin = draw.randrange(len(made) + 1)
    end = begin + draw.choice((1, 5, 50))
    return made[:begin] + made[begin:end] * draw.choice((2, 10, 300)) + made[end:]


_TEXT_CHANGES: tuple[TextChange, ...] = (
    *(_number, _number, _number, _number, _unit, _word, _word, _date, _value, _value, _lines, _lines, _lines),
    *(_spliced, _cut, _inserted, _alike, _case, _repeated),
)
_ENCODINGS: tuple[Callable[[str], bytes], ...] = (
    lambda made: made.encode("utf-8-sig", "replace"),
    lambda made: made.encode("utf-16", "replace"),
    lambda made: made.encode("utf-32-be", "replace"),
    lambda made: made.encode("latin-1", "replace"),
    lambda made: made.replace("\n", "\r\n").encode("utf-8", "replace"),
    lambda made: made.replace("\n", "\r").encode("utf-8", "replace"),
    lambda made: b"\xff\xfe" + made.encode("utf-8", "replace"),
)


# --------------------------------------------------------------------------------------------------------------- bytes
def binary(draw: Random, seeds: Sequence[bytes]) -> bytes:
    """Bytes with some changes.

    Args:
        draw: What is drawn from.
        seeds: Good files, one of which is changed, with pieces of another.
    """
    made, other = draw.choice(seeds), draw.choice(seeds)
    for _ in range(draw.choice(_SOME)):
        made = one_change(draw, made, other)
    return made


def one_change(draw: Random, made: bytes, other: bytes) -> bytes:
    """Bytes with one change.

    Args:
        draw: What is drawn from.
        made: The bytes.
        other: Bytes that pieces are taken from.
    """
    return draw.choice(_BYTE_CHANGES)(draw, made, other)


def _place(draw: Random, made: bytes) -> int:
    """A place in the bytes, near their begin as often as anywhere: headers stand there."""
    if draw.random() < 0.5:
        return draw.randrange(min(len(made), 600) + 1)
    return draw.randrange(len(made) + 1)


def _flipped(draw: Random, made: bytes, _: bytes) -> bytes:
    if not made:
        return made
    here = min(_place(draw, made), len(made) - 1)
    return made[:here] + bytes([made[here] ^ (1 << draw.randrange(8))]) + made[here + 1 :]


def _byte(draw: Random, made: bytes, _: bytes) -> bytes:
    here = _place(draw, made)
    return made[:here] + bytes([draw.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, draw.randrange(256)))]) + made[here + 1 :]


def _field(draw: Random, made: bytes, _: bytes) -> bytes:
    """A whole number of 2, 4 or 8 bytes at its ends, or near what it was."""
    code = draw.choice(("<H", "<I", "<Q", ">I", ">Q"))
    size = struct.calcsize(code)
    here = _place(draw, made) // 4 * 4
    if here + size > len(made):
        return made
    most = 1 << 8 * size
    (old,) = struct.unpack_from(code, made, here)
    near = (old + 1, old - 1, old * 2, old // 2, old + 8, old - 8, old * 256)
    new = draw.choice((0, 1, 2, most - 1, most // 2, most // 2 - 1, 1 << 20, 1 << 28, *near))
    return made[:here] + struct.pack(code, new % most) + made[here + size :]


def _float(draw: Random, made: bytes, _: bytes) -> bytes:
    here = _place(draw, made) // 8 * 8
    new = draw.choice((float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 0.0, -0.0, 1e-300, 1e20))
    return made[:here] + struct.pack("<d", new) + made[here + 8 :]


def _shortened(draw: Random, made: bytes, _: bytes) -> bytes:
    return made[: draw.randrange(len(made) + 1)]


def _taken_out(draw: Random, made: bytes, _: bytes) -> bytes:
    here = _place(draw, made)
    return made[:here] + made[here + draw.choice((1, 2, 4, 8, 64, 512)) :]


def _put_in(draw: Random, made: bytes, other: bytes) -> bytes:
    here, there = _place(draw, made), _place(draw, other)
    size = draw.choice((1, 4, 8, 64, 512))
    piece = other[there : there + size] if draw.random() < 0.5 else bytes(size)
    return made[:here] + piece + made[here:]


def _put_over(draw: Random, made: bytes, other: bytes) -> bytes:
    here, there = _place(draw, made), _place(draw, other)
    piece = other[there : there + draw.choice((4, 8, 64, 512))]
    return made[:here] + piece + made[here + len(piece) :]


def _joined(draw: Random, made: bytes, other: bytes) -> bytes:
    return made[: _place(draw, made)] + other[_place(draw, other) :]


def _doubled(_: Random, made: bytes, other: bytes) -> bytes:
    return made + other


_BYTE_CHANGES: tuple[ByteChange, ...] = (
    *(_flipped, _flipped, _byte, _byte, _field, _field, _field, _field, _float, _float, _shortened),
    *(_taken_out, _put_in, _put_over, _put_over, _joined, _doubled),
)


# ---------------------------------------------------------------------------------------------------------- plain data
def plain(draw: Random, data: Any, other: Any) -> Any:
    """Plain data (what JSON holds) with some changes; what was given stays as it is.

    Args:
        draw: What is drawn from.
        data: The data.
        other: Data that pieces are taken from.
    """
    made = [copy.deepcopy(data)]
    for _ in range(draw.choice(_SOME)):
        _change(draw, made, other)
    return made[0]


def _inner(data: Any) -> list[tuple[Any, Any]]:
    """Each place in the data: what holds it, and its key or number there."""
    found: list[tuple[Any, Any]] = []
    left = [data]
    while left and len(found) < 20_000:
        holder = left.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder)) if isinstance(holder, list) else ()
        for key in keys:
            found.append((holder, key))
            left.append(holder[key])
    return found


def _change(draw: Random, made: list[Any], other: Any) -> None:
    holder, key = draw.choice(_inner(made))
    how = draw.randrange(9)
    if how == 0 and holder is not made:
        del holder[key]
    elif how == 1 and isinstance(holder, dict):
        holder[draw.choice(WORDS)] = holder.pop(key)
    elif how == 2:
        holder[key] = copy.deepcopy(draw.choice([inner[at] for inner, at in _inner([other])]))
    elif how == 3:
        deep: Any = copy.deepcopy(draw.choice(VALUES))
        for _ in range(draw.choice((5, 40, 150))):
            deep = [deep] if draw.random() < 0.5 else {"x": deep}
        holder[key] = deep
    elif how == 4 and isinstance(holder[key], str):
        holder[key] = text(draw, [holder[key].encode("utf-8", "surrogatepass")]).decode("utf-8", "replace")
    elif how == 5 and isinstance(holder[key], int | float):
        holder[key] = holder[key] * draw.choice((-1, 0, 2, 1e6, 1e-6, 1e300)) if abs(holder[key]) < 1e300 else 0
    else:
        holder[key] = copy.deepcopy(draw.choice(VALUES))


def as_json(draw: Random, data: Any) -> bytes:
    """Plain data as JSON, now and then with changes of its text.

    Args:
        draw: What is drawn from.
        data: The data.
    """
    written = json.dumps(data).encode("utf-8", "surrogatepass")
    return text(draw, [written]) if draw.random() < 0.2 else written
