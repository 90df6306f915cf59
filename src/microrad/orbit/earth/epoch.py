"""The instant from which a mission counts its seconds, and how far the Earth has turned since.

Seconds are elapsed (SI) seconds: a leap second is one of them. Leap seconds and UT1 come from the tables inside
skyfield; nothing is downloaded. Its UT1 is measured up to the day of its release, predicted for about a year and then
extrapolated; no leap second is known after that of 2016, and none is assumed. A prediction may be off by 0.2 s at the
end of its year (that of skyfield 1.55 is, for December 2026) and by a few seconds in 2050. One second is 15 arcsec of
the Earth's rotation, 460 m at the equator, some 60 ms of a pass over a station.
"""

import math
import re
from dataclasses import dataclass
from datetime import date
from fractions import Fraction
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.orbit.base import OrbitError

DAY_S = 86400.0
FIRST_DAY = date(1973, 1, 2)
"""First day of the table of UT1."""
LAST_DAY = date(2050, 12, 31)
"""Last day for which the extrapolated UT1 is taken."""

_JULIAN_OF_ORDINAL = 1721424.5  # Julian date at 0h of the day whose ordinal is 0
_J2000_ORDINAL = date(2000, 1, 1).toordinal()
_TT_MINUS_TAI_S = 32.184
_CENTURY_S = 36525.0 * DAY_S
_TEXT = re.compile(
    r"([0-9]{4})-([0-9]{2})-([0-9]{2})[T ]([0-9]{2}):([0-9]{2})(?::([0-9]{2}(?:\.[0-9]{1,12})?))?(Z|[+-]00:?00)?"
)
_EXAMPLE = 'write the instant in UTC, for example "2026-03-20T12:00:00Z"'


class _Instant(NamedTuple):
    """UTC as the ordinal of the day and the seconds in it; 86400 and more in a leap second."""

    day: int
    second: float


class _Tables(NamedTuple):
    leap_day: Floats  # ordinal of the days that begin with a new difference TAI - UTC
    tai_minus_utc_s: Floats  # one more than days: the first holds before them
    first_day: int
    ut1_minus_tai_s: Floats  # at 0h TAI of each day from first_day


@dataclass(frozen=True, slots=True)
class Epoch:
    """An instant in UTC, from 1973-01-02 to 2050-12-31, written in ISO 8601 with its zone.

    `text` is brought to the form "2026-03-20T12:00:00Z", with as many decimals of the second as were given. Raises
    `OrbitError` for a text without the zone Z or +00:00, a day or a time that does not exist (a leap second that was
    not inserted among them) and a year outside the tables.
    """

    text: str

    def __post_init__(self) -> None:
        """Check the text and bring it to its normal form."""
        object.__setattr__(self, "text", _normal(self.text))

    @property
    def julian_date(self) -> tuple[float, float]:
        """Julian date in UTC: that of 0h (it ends in .5), and the fraction of the day (above 1 in a leap second)."""
        day, second = _instant(self.text)
        return day + _JULIAN_OF_ORDINAL, second / DAY_S

    def seconds_to(self, other: "Epoch") -> float:
        """Elapsed seconds from this instant to `other`, leap seconds included; negative when `other` is earlier."""
        here, there = _instant(self.text), _instant(other.text)
        leap = _tai_minus_utc_s(there.day) - _tai_minus_utc_s(here.day)
        return (there.day - here.day) * DAY_S + leap + (there.second - here.second)

    def utc(self, time_s: float) -> str:
        """UTC at `time_s` after this instant, in ISO 8601 to the millisecond with Z; a leap second reads :60.

        Raises:
            OrbitError: For a time outside the tables.
        """
        self._check(np.asarray(time_s, dtype=np.float64))
        day, second = _instant(self.text)
        whole_s = day * 86400 + round(_tai_minus_utc_s(day))
        return _utc_of_tai(whole_s * 1000 + round((second + time_s) * 1000.0))

    def earth_rotation_rad(self, time_s: Floats) -> Floats:
        """Greenwich mean sidereal time (IAU 1982) at UT1, `time_s` after this instant, in rad.

        In [0, 2 pi) at 0h of the first day and continuous from there: it is not wrapped. UT1 - TAI is taken as linear
        over each day. Source: Aoki et al. 1982 (AIAA 2006-6753, appendix C).

        Raises:
            OrbitError: For a time outside the tables.
        """
        time = np.asarray(time_s, dtype=np.float64)
        self._check(time)
        day, second = _instant(self.text)
        tai_s = time + (second + _tai_minus_utc_s(day))
        ut1_s = tai_s + _ut1_minus_tai_s(day, tai_s)
        zero, first, second_order, third = _sidereal_polynomial(day)
        return zero + ut1_s * (first + ut1_s * (second_order + ut1_s * third))

    def terrestrial_centuries(self, time_s: Floats) -> Floats:
        """Julian centuries of Terrestrial Time from J2000, `time_s` after this instant."""
        day, second = _instant(self.text)
        since_noon_s = (day - _J2000_ORDINAL) * DAY_S - 43200.0 + second + _tai_minus_utc_s(day) + _TT_MINUS_TAI_S
        return (np.asarray(time_s, dtype=np.float64) + since_noon_s) / _CENTURY_S

    def _check(self, time: Floats) -> None:
        """Raises OrbitError for times that are not numbers or leave the tables."""
        if not time.size:
            return
        for extreme in (float(time.min()), float(time.max())):
            if not math.isfinite(extreme):
                raise OrbitError(f"a time of {extreme} s after {self.text} is not a number; give finite seconds")
            day, second = _instant(self.text)
            near = day + math.floor((second + extreme) / DAY_S)
            near = min(max(near, FIRST_DAY.toordinal()), LAST_DAY.toordinal())
            leap = _tai_minus_utc_s(near) - _tai_minus_utc_s(day)
            _check_day(day + math.floor((second + extreme - leap) / DAY_S), f"{extreme:.6g} s after {self.text}")


def _check_day(day: int, what: str) -> None:
    """Raises OrbitError for a day that the tables do not cover."""
    if not FIRST_DAY.toordinal() <= day <= LAST_DAY.toordinal():
        raise OrbitError(
            f"{what} is outside {FIRST_DAY} to {LAST_DAY}, the days for which the rotation of the Earth (UT1) is "
            "tabulated or can be extrapolated; take an instant between them"
        )


# --------------------------------------------------------------------------------------------------------------- text
def _normal(text: str) -> str:
    """`text` in its normal form, checked."""
    match = _TEXT.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise OrbitError(f"{text!r} is not a date and time in ISO 8601; {_EXAMPLE}")
    if match[7] in (None, "-00:00", "-0000"):
        raise OrbitError(f"{text!r} has no time zone, so the instant is not known; {_EXAMPLE}, with the Z")
    try:
        day = date(int(match[1]), int(match[2]), int(match[3])).toordinal()
    except ValueError as error:
        raise OrbitError(f"{text!r} names no day of the calendar ({error}); {_EXAMPLE}") from None
    _check_day(day, repr(text))
    second = match[6] or "00"
    if "." in second:
        second = second.rstrip("0").rstrip(".")
    _check_clock(text, day, int(match[4]), int(match[5]), float(second))
    return f"{match[1]}-{match[2]}-{match[3]}T{match[4]}:{match[5]}:{second}Z"


def _check_clock(text: str, day: int, hour: int, minute: int, second: float) -> None:
    """Raises OrbitError for a time of day that does not exist; second 60 does where a leap second was inserted."""
    if hour <= 23 and minute <= 59 and second < 60.0:
        return
    if (hour, minute) == (23, 59) and 60.0 <= second < 61.0:
        if _tai_minus_utc_s(day + 1) > _tai_minus_utc_s(day):
            return
        raise OrbitError(f"{text!r} names a leap second, but none was inserted on that day; {_EXAMPLE}")
    raise OrbitError(f"{text!r} names no time of the day (24 hours, 60 minutes, 60 seconds); {_EXAMPLE}")


@lru_cache(maxsize=256)
def _instant(text: str) -> _Instant:
    """The instant of a text in normal form."""
    seconds = int(text[11:13]) * 3600 + int(text[14:16]) * 60 + Fraction(text[17:-1])
    return _Instant(date.fromisoformat(text[:10]).toordinal(), float(seconds))


def _utc_of_tai(tai_ms: int) -> str:
    """UTC of a number of milliseconds of TAI, counted from the day whose ordinal is 0."""
    tables = _tables()
    new_day_ms = [
        (int(day) * 86400 + int(offset)) * 1000
        for day, offset in zip(tables.leap_day, tables.tai_minus_utc_s[1:], strict=True)
    ]
    index = sum(start <= tai_ms for start in new_day_ms)
    day, ms = divmod(tai_ms - int(tables.tai_minus_utc_s[index]) * 1000, 86_400_000)
    if index < len(new_day_ms) and tai_ms >= new_day_ms[index] - 1000:
        day, ms = day - 1, ms + 86_400_000  # the leap second belongs to the day that it lengthens
    minutes = min(ms // 60_000, 1439)  # second 60 of a leap second
    second = (ms - 60_000 * minutes) / 1000.0
    return f"{date.fromordinal(day).isoformat()}T{minutes // 60:02d}:{minutes % 60:02d}:{second:06.3f}Z"


# ------------------------------------------------------------------------------------------------------------- tables
@cache
def _tables() -> _Tables:
    """Leap seconds, and UT1 - TAI at the start of each day; a tenth of a second on first use."""
    from skyfield.api import load

    scale = load.timescale(builtin=True)
    first, last = FIRST_DAY.toordinal(), LAST_DAY.toordinal() + 2
    days = np.arange(first, last + 1)
    delta_t_s = scale.delta_t_function(days + (_JULIAN_OF_ORDINAL + _TT_MINUS_TAI_S / DAY_S))
    offsets = np.concatenate(([scale.leap_offsets[0] - 1.0], scale.leap_offsets))
    return _Tables(scale.leap_dates - _JULIAN_OF_ORDINAL, offsets, first, _TT_MINUS_TAI_S - delta_t_s)


@lru_cache(maxsize=256)
def _tai_minus_utc_s(day: int) -> float:
    """TAI - UTC during the day with this ordinal, in s."""
    tables = _tables()
    return float(tables.tai_minus_utc_s[np.searchsorted(tables.leap_day, day, side="right")])


def _ut1_minus_tai_s(day: int, tai_s: Floats) -> Floats:
    """UT1 - TAI, `tai_s` after 0h TAI of `day`; only the days needed are handed on, which makes it quick."""
    tables = _tables()
    offset = day - tables.first_day
    low = max(offset + math.floor(float(tai_s.min(initial=0.0)) / DAY_S), 0)
    high = offset + math.ceil(float(tai_s.max(initial=0.0)) / DAY_S) + 2
    values = tables.ut1_minus_tai_s[low:high]
    node_s = (np.arange(low, low + values.size) - offset) * DAY_S
    return np.interp(tai_s, node_s, values)


@lru_cache(maxsize=64)
def _sidereal_polynomial(day: int) -> tuple[float, float, float, float]:
    """Greenwich mean sidereal time in rad as a cubic in seconds of UT1 from 0h UT1 of `day`.

    In seconds of time it is 67310.54841 + (876600 h + 8640184.812866) T + 0.093104 T^2 - 6.2e-6 T^3, with T in Julian
    centuries of UT1 from J2000 noon; the 876600 h are whole turns at noon of any day and half a turn at 0h.
    """
    T = (day - _J2000_ORDINAL - 0.5) / 36525.0
    turn = 2.0 * math.pi / DAY_S
    b, c, d = 8640184.812866, 0.093104, -6.2e-6
    zero_s = (67310.54841 - 43200.0 + T * (b + T * (c + T * d))) % DAY_S
    first = 1.0 + (b + T * (2.0 * c + T * 3.0 * d)) / _CENTURY_S
    return turn * zero_s, turn * first, turn * (c + 3.0 * d * T) / _CENTURY_S**2, turn * d / _CENTURY_S**3
