"""Units at the door: text such as "300 urad" becomes an SI float, and an SI float becomes text to read.

Angle, bit, photon and cycle are base dimensions here, so that rad/s is never taken for Hz, nor a photon for a bit.
Decibels are kinds of their own: a ratio stays in dB, a level (dBm, dBW) becomes a power in W.
"""

import math
import re
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from microrad.core.errors import MicroradError

SPEED_OF_LIGHT_M_S = 299_792_458.0
"""Speed of light in vacuum, exact by the definition of the metre."""
PLANCK_J_S = 6.626_070_15e-34
"""Planck constant, exact by the definition of the kilogram (SI brochure, 9th edition)."""

ELEMENTARY_CHARGE_C = 1.602_176_634e-19
"""Charge of one electron, exact by the definition of the ampere (SI brochure, 9th edition)."""

LEAST, MOST = 1e-30, 1e30
"""Sizes that a quantity may have in SI units where it is not 0: its powers are floats, too."""

BLANKS = "\t\n\u00a0\u202f"
"""Blanks that do no harm where a text has several lines."""

_MAX_CHARACTERS = 60
_MOST_GIVEN = 10  # digits of a number that somebody wrote
_MAX_DECIBEL = 1000.0  # beyond it the linear value leaves the range of a float

_BASE = ("kg", "m", "s", "A", "K", "rad", "bit", "photon", "cycle")
_Dimension = tuple[int | Fraction, ...]  # powers of the base dimensions


class _Scale(NamedTuple):
    factor: Decimal  # decimal, so that "780 urad" is the float 780e-6 to the last bit
    dimension: _Dimension


def _dimension(**powers: int) -> _Dimension:
    return tuple(powers.get(base, 0) for base in _BASE)


_PREFIXES = {
    "p": Decimal("1e-12"),
    "n": Decimal("1e-9"),
    "u": Decimal("1e-6"),
    "µ": Decimal("1e-6"),  # U+00B5, the micro sign of keyboards
    "μ": Decimal("1e-6"),  # U+03BC, the Greek letter
    "m": Decimal("1e-3"),
    "c": Decimal("1e-2"),
    "k": Decimal("1e3"),
    "M": Decimal("1e6"),
    "G": Decimal("1e9"),
    "T": Decimal("1e12"),
}
_DEGREE = Decimal(math.pi) / 180
_SMALL, _WIDE = "pnuµμm", "pnuµμmkMG"
# symbol: factor to SI, dimension, the prefixes it may carry
_UNITS: dict[str, tuple[Decimal, _Dimension, str]] = {
    "m": (Decimal(1), _dimension(m=1), _SMALL + "ck"),
    "g": (Decimal("1e-3"), _dimension(kg=1), _SMALL + "k"),
    "s": (Decimal(1), _dimension(s=1), _SMALL),
    "min": (Decimal(60), _dimension(s=1), ""),
    "h": (Decimal(3600), _dimension(s=1), ""),
    "day": (Decimal(86400), _dimension(s=1), ""),
    "A": (Decimal(1), _dimension(A=1), _SMALL + "k"),
    "K": (Decimal(1), _dimension(K=1), "m"),
    "V": (Decimal(1), _dimension(kg=1, m=2, s=-3, A=-1), _SMALL + "kM"),
    "W": (Decimal(1), _dimension(kg=1, m=2, s=-3), _WIDE),
    "J": (Decimal(1), _dimension(kg=1, m=2, s=-2), _WIDE),
    "N": (Decimal(1), _dimension(kg=1, m=1, s=-2), _SMALL + "kM"),
    "Hz": (Decimal(1), _dimension(cycle=1, s=-1), "mkMGT"),
    "rad": (Decimal(1), _dimension(rad=1), _SMALL),
    "deg": (_DEGREE, _dimension(rad=1), "m"),
    "sr": (Decimal(1), _dimension(rad=2), ""),
    "arcsec": (_DEGREE / 3600, _dimension(rad=1), "uµμm"),
    "bit": (Decimal(1), _dimension(bit=1), "kMGT"),
    "B": (Decimal(8), _dimension(bit=1), "kMGT"),
    "byte": (Decimal(8), _dimension(bit=1), "kMGT"),
    "photon": (Decimal(1), _dimension(photon=1), ""),
}
_SYMBOLS: dict[str, _Scale] = {
    prefix + symbol: _Scale(_PREFIXES.get(prefix, Decimal(1)) * factor, dimension)
    for symbol, (factor, dimension, prefixes) in _UNITS.items()
    for prefix in ("", *prefixes)
}
_LEVELS_W = {"dBm": 1e-3, "dBW": 1.0}
_DECIBELS = ("dB", *_LEVELS_W)

# what a key in this SI unit is called, and the unit an example is written in
_KINDS = {
    "m": ("a length", "m"),
    "kg": ("a mass", "kg"),
    "s": ("a time", "s"),
    "V": ("a voltage", "V"),
    "W": ("a power", "W"),
    "Hz": ("a frequency", "Hz"),
    "rad": ("an angle", "urad"),
    "dB": ("a ratio in decibels", "dB"),
    "bit": ("a volume of data", "GB"),
    "bit/s": ("a data rate", "Mbit/s"),
    "photon/bit": ("a receiver sensitivity", "photon/bit"),
    "W/m^2": ("an irradiance", "W/m^2"),
    "W/sr": ("a radiant intensity", "MW/sr"),
    "W/(m^3 sr)": ("a spectral radiance", "W/(m^2 sr um)"),
    "1/s": ("a rate per second", "1/s"),
    "m/s": ("a velocity", "km/s"),
    "V/s": ("a voltage rate", "V/s"),
    "rad/V": ("an angle per voltage", "mrad/V"),
    "V/rad": ("a voltage per angle", "V/mrad"),
    "V/(rad s)": ("a voltage per angle and time", "V/(mrad s)"),
    "V s/rad": ("a voltage per angular rate", "V s/mrad"),
    "rad/s": ("an angular rate", "urad/s"),
    "rad^2/Hz": ("a spectral density of an angle", "urad^2/Hz"),
    "rad/Hz^2": ("an angle per squared frequency", "nrad/Hz^2"),
    "A": ("a current", "nA"),
    "A/W": ("a responsivity", "A/W"),
    "A/sqrt(Hz)": ("a noise density of a current", "pA/sqrt(Hz)"),
}

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_COMMA_NUMBER = re.compile(r"[+-]?[0-9]+(?:,[0-9]+)+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,3})?")
_FACTOR = re.compile(r"([A-Za-zµμ]+)(?:\^?([1-9]))?")
_ROOT = re.compile(r"sqrt\(([A-Za-zµμ]+)\)|√([A-Za-zµμ]+)")


_SPELLINGS = {
    **{
        f"{prefix.lower()}{rate}": f"{prefix}bit/s"
        for prefix in ("", "k", "M", "G", "T")
        for rate in ("bps", "b/s", "bit/s", "bits/s", "bit/sec", "bits/sec")
    },
    **dict.fromkeys(("watt", "watts"), "W"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"), "um"),
    **dict.fromkeys(("degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("microradian", "microradians"), "urad"),
    **dict.fromkeys(("volt", "volts"), "V"),
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("hertz", "cps"), "Hz"),
}
"""Units as they are often written, in small letters, and as they are read here."""


class UnitError(MicroradError):
    """A quantity that cannot be read.

    `reason` says what is wrong with the value, `expected` what is wanted and `example` what to write.
    """

    def __init__(self, value: object, reason: str, expected: str, example: str) -> None:
        """Write the message "`value` `reason`; expected `expected`, for example `example`"."""
        shown = _quoted(value) if isinstance(value, str) else _bare(value)
        super().__init__(f'{shown} {reason}; expected {expected}, for example "{example}"')
        self.reason = reason
        self.expected = expected
        self.example = example


class _RefusedError(ValueError):
    """Why a text is no quantity, and the number that a corrected one begins with, with its unit where that is known."""

    def __init__(self, reason: str, number: str = "5", unit: str = "") -> None:
        super().__init__(reason)
        self.number, self.unit = number, unit


def parse_quantity(text: object, unit: str, typical: str = "") -> float:
    """Read a quantity with its unit from a text, as a number in an SI unit.

    The text is one plain number, at most one space and a unit: "5 cm", "300 Mbit/s", "16000 V/(mrad s)", "-3 dBm".
    Units are multiplied by a space; more than one unit below the stroke needs brackets; powers are "m^2" or "m2", a
    square root is "pA/sqrt(Hz)" or "pA/√Hz". A key in W also takes dBm and dBW, a key in dB takes dB alone.

    Args:
        text: The text, or whatever stands in its place.
        unit: The SI unit of the result.
        typical: Unit in which an error message writes its example; by default a usual one of this kind.

    Raises:
        UnitError: For anything else: a bare number, another dimension, a comma, nan, an expression.

    Example:
        ```python
        import microrad

        print(microrad.parse_quantity("5 cm", "m"), microrad.parse_quantity("-3 dBm", "W"))
        ```
    """
    try:
        return _read(text, unit)
    except _RefusedError as refused:
        noun, usual = kind_of(unit)
        usual = typical or usual
        tried = (f"{number} {own or usual}" for number in (refused.number, "5") for own in (refused.unit, ""))
        example = next((each for each in tried if _is_read(each, unit)), f"5 {usual}")
        raise UnitError(text, str(refused), f"{noun} with its unit", example) from None


def kind_of(unit: str) -> tuple[str, str]:
    """What a quantity in the SI unit `unit` is called ("a power") and the unit in which an example is written."""
    return _KINDS.get(unit, (f"a quantity in {unit}", unit))


def _is_read(text: str, unit: str) -> bool:
    try:
        _read(text, unit)
    except _RefusedError:
        return False
    return True


def _read(text: object, unit: str) -> float:
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise _RefusedError("is not a quantity in quotes")
    if not isinstance(text, str):
        raise _RefusedError("is a number without a unit", _bare(text) if abs(text) < 1e15 else "5")
    if len(text) > _MAX_CHARACTERS:
        raise _RefusedError(f"has {len(text)} characters, too many for a quantity")
    number, symbol = _split(text)
    if symbol in _DECIBELS:
        return _from_decibel(float(number), symbol, unit)
    scale = _scale_of_text(symbol, number, unit)
    if unit in _DECIBELS or scale.dimension != _scale(unit).dimension:
        raise _RefusedError(f"is in {_quoted(symbol)}, another kind of quantity")
    value = Decimal(number) * scale.factor / _scale(unit).factor
    if value and not Decimal(repr(LEAST)) <= abs(value) <= Decimal(repr(MOST)):
        raise _RefusedError(f"is {'too large' if abs(value) > 1 else 'too small, and not 0,'} for a quantity")
    return float(value)


def _split(text: str) -> tuple[str, str]:
    """Number and unit of `text`, both still text."""
    if match := _COMMA_NUMBER.match(text):
        is_decimal = match[0].count(",") == 1 and "." not in match[0]
        number, symbol = match[0].replace(",", "." if is_decimal else ""), text[match.end() :].removeprefix(" ")
        raise _RefusedError("has a comma: decimals take a point, thousands nothing", number, symbol)
    match = _NUMBER.match(text)
    if match is None:
        raise _RefusedError("does not begin with a plain number")
    symbol = text[match.end() :].removeprefix(" ")
    if not symbol:
        raise _RefusedError("is a number without a unit", match[0])
    return match[0], symbol


def _from_decibel(value: float, symbol: str, unit: str) -> float:
    if unit != symbol and not (unit == "W" and symbol in _LEVELS_W):
        raise _RefusedError(f"is in {symbol}, another kind of quantity")
    if abs(value) > _MAX_DECIBEL:
        raise _RefusedError(f"is beyond {_MAX_DECIBEL:.0f} {symbol}")
    return value if unit == symbol else float(_LEVELS_W[symbol] * 10.0 ** (value / 10.0))


def _scale_of_text(symbol: str, number: str, unit: str) -> _Scale:
    try:
        return _scale(symbol)
    except ValueError as error:
        meant = "" if "B" in symbol else _SPELLINGS.get(symbol.lower(), "")  # bytes are not bits
        if meant and unit not in _DECIBELS and _scale(meant).dimension == _scale(unit).dimension:
            raise _RefusedError(f"has {_quoted(symbol)}, which is written {meant} here", number, meant) from None
        raise _RefusedError(f"has {_quoted(symbol)} where a unit should stand: {error}") from None


def printable(text: str, kept: str = "") -> str:
    """The text with every character spelled out that would steer a terminal or cannot be seen.

    Args:
        text: What is to be printed, from a file or a user.
        kept: Characters that stay as they are all the same.
    """
    return "".join(c if c.isprintable() or c in kept else f"\\u{ord(c):04x}" for c in text)


def _quoted(text: str) -> str:
    return f'"{printable(text if len(text) <= _MAX_CHARACTERS else text[:_MAX_CHARACTERS] + "…")}"'


def _bare(value: object) -> str:
    """A number as it was typed; the kind of anything else, which may be too long to print."""
    if isinstance(value, float) or (type(value) is int and abs(value) < 1e15):
        return f"{value:.15g}"
    return f"a value of type {type(value).__name__}"


@lru_cache(maxsize=256)
def _scale(expression: str) -> _Scale:
    """Factor to SI and dimension of a unit expression; raises `ValueError` when it is none."""
    above, stroke, below = re.sub(" ?/ ?", "/", expression).partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    elif " " in below:
        raise ValueError("put what stands below the stroke in brackets, as in V/(mrad s)")
    numerator = [] if stroke and above == "1" else re.split("[ ·]", above)
    terms = [(symbol, 1) for symbol in numerator] + [(symbol, -1) for symbol in re.split("[ ·]", below) if stroke]
    factor, dimension = Decimal(1), _dimension()
    for symbol, sign in terms:
        scale, power = _factor(symbol)
        factor *= scale.factor ** (sign * power)
        dimension = tuple(a + sign * power * b for a, b in zip(dimension, scale.dimension, strict=True))
    return _Scale(factor, dimension)


def _factor(symbol: str) -> tuple[_Scale, int]:
    """Scale and power of one factor of a unit expression, "m^2"."""
    if not symbol:
        raise ValueError("a unit is missing beside a space or a stroke")
    if root := _ROOT.fullmatch(symbol):
        scale, _ = _factor(root[1] or root[2])
        return _Scale(scale.factor.sqrt(), tuple(Fraction(power) / 2 for power in scale.dimension)), 1
    match = _FACTOR.fullmatch(symbol)
    if match is None or match[1] not in _SYMBOLS:
        raise ValueError(f"no unit is called {_quoted(symbol)}")
    return _SYMBOLS[match[1]], int(match[2] or 1)


def format_quantity(value: float, unit: str, digits: int = 4) -> str:
    """A quantity in words with a readable prefix: "9.99 µrad".

    The prefix goes to the first unit above the stroke, where that unit takes one; decibels take none. What is returned
    can be read back with `parse_quantity`, unless the value is not finite.

    Args:
        value: The value in the SI unit.
        unit: The SI unit; "" for a share.
        digits: Significant digits.
    """
    rounded = float(f"{value:.{digits}g}")
    prefix = _prefix(abs(rounded), re.split("[ /]", unit, maxsplit=1)[0])
    scaled = value / float(_PREFIXES[prefix]) if prefix else value
    return f"{plain(scaled, digits)} {prefix}{unit}".rstrip()


def plain(value: float, digits: int = 3) -> str:
    """A number in words, without a power of ten where it is large: "1230".

    Args:
        value: The number.
        digits: Significant digits.
    """
    return f"{float(f'{value:.{digits}g}') + 0.0:.15g}"  # 0, not -0


def counted(number: int, noun: str) -> str:
    """A number with its noun: "1 parameter", "2 parameters".

    Args:
        number: How many.
        noun: In the singular.
    """
    return f"{number} {noun}{'s' * (number != 1)}"


def format_input(value: float, unit: str) -> str:
    """A quantity in words with every digit that it was given with; one that was computed gets four digits.

    Args:
        value: The value in the SI unit.
        unit: The SI unit.
    """
    given = next(
        (n for n in range(4, _MOST_GIVEN + 1) if math.isclose(float(f"{value:.{n}g}"), value, rel_tol=1e-14)), 4
    )
    return format_quantity(value, unit, given)


def format_limit(limit: float, unit: str, digits: int = 4, *, least: bool = False) -> str:
    """A limit in words, rounded to the side on which it is kept: what is told to be allowed is allowed.

    Args:
        limit: The limit in the SI unit.
        unit: The SI unit.
        digits: Significant digits.
        least: Whether it is the least that is allowed, which is rounded up; the most is rounded down.
    """
    rounded = float(f"{limit:.{digits}g}")
    side = 1.0 if least else -1.0
    if side * (limit - rounded) > 1e-12 * abs(limit):
        rounded += side * 10.0 ** (math.floor(math.log10(abs(limit))) + 1 - digits)
    return format_quantity(rounded, unit, digits)


def format_beyond(value: float, limit: float, unit: str, digits: int = 4) -> str:
    """A quantity that breaks a limit, or keeps it just so, in as many more digits as tell it from the limit.

    Args:
        value: The value in the SI unit.
        limit: The limit in the SI unit.
        unit: The SI unit.
        digits: Significant digits where these tell the two apart; ten at most.
    """
    more = (n for n in range(digits, 10) if f"{value:.{n}g}" != f"{limit:.{n}g}")
    return format_quantity(value, unit, next(more, 10))


def _prefix(magnitude: float, symbol: str) -> str:
    """The prefix that leaves one to three digits before the point, as far as `symbol` takes one ("m^2" takes none)."""
    if symbol not in _UNITS or not 0.0 < magnitude < math.inf:
        return ""
    allowed = ["", *(p for p in "pnµmkMGT" if p in _UNITS[symbol][2])]
    sizes = sorted((float(_PREFIXES.get(p, Decimal(1))), p) for p in allowed)
    return max((s for s in sizes if s[0] <= magnitude * (1 + 1e-12)), default=sizes[0])[1]
