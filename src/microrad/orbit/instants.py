"""Times of CCSDS messages: time codes as text, and the seconds of the mission that they are in each time system.

Sources: CCSDS 301.0-B, Time Code Formats, for the text; CCSDS 502.0-B-3 for the time systems.
"""

import re
from datetime import date
from functools import lru_cache
from pathlib import Path

import numpy as np

from microrad.orbit.base import Floats, OrbitError
from microrad.orbit.epoch import DAY_S, Epoch
from microrad.orbit.messages import Field

_AHEAD_OF_TAI_S = {"TAI": 0.0, "TT": 32.184, "TDT": 32.184, "GPS": -19.0}
_Y2K = Epoch("2000-01-01T00:00:00Z")
_Y2K_TAI_MINUS_UTC_S = 32.0
_CLOCK = re.compile(r"([0-9]{2}):([0-9]{2}):([0-9]{2}(?:\.[0-9]*)?)(Z?)")
TIME_SYSTEMS = ("UTC", *_AHEAD_OF_TAI_S)
"""Time systems that are read."""


@lru_cache(maxsize=1024)
def _ordinal(text: str) -> int:
    """Ordinal of a day written as 2026-03-20 or as 2026-079, the number of the day in its year."""
    if re.fullmatch(r"[0-9]{4}-[0-9]{3}", text):
        first = date(int(text[:4]), 1, 1).toordinal()
        day = first + int(text[5:]) - 1
        if date.fromordinal(day).year != int(text[:4]) or int(text[5:]) < 1:
            raise ValueError("no such day of the year")
        return day
    if not re.fullmatch(r"[0-9]{4}-[0-9]{2}-[0-9]{2}", text):
        raise ValueError("not a date")
    return date.fromisoformat(text).toordinal()


def instant(path: Path, given: Field, system: str) -> tuple[int, float]:
    """Ordinal of the day and seconds in it of a time code of CCSDS 301.0-B, A or B; raises `OrbitError`."""
    day, _, clock = given.value.partition("T")
    match = _CLOCK.fullmatch(clock)
    try:
        ordinal = _ordinal(day)
    except ValueError:
        match = None
    if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61.0:
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown}, not a date and time; write it as "
            "2026-03-20T12:00:00.000 or 2026-079T12:00:00.000"
        )
    if match[4] and system != "UTC":
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown} and ends in Z, which means UTC, but TIME_SYSTEM is "
            f"{system}; remove the Z or correct TIME_SYSTEM"
        )
    if float(match[3]) >= 60.0:
        _check_leap_second(path, given, ordinal, match, system)
    return ordinal, int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3])


def plain_instant(text: str) -> tuple[int, float] | None:
    """As `instant`, quickly, for 2026-03-20T12:00:00 with any decimals; None for all that looks otherwise."""
    second = text[17:]
    if text[10:11] != "T" or text[16:17] != ":" or not second.replace(".", "", 1).isdecimal() or not text.isascii():
        return None
    try:
        day, minute = _ordinal(text[:10]), _minutes(text[11:16])
    except ValueError:
        return None
    return (day, 60 * minute + float(second)) if float(second) < 60.0 else None


@lru_cache(maxsize=1440)
def _minutes(text: str) -> int:
    """Minutes of the day of a clock such as 12:34."""
    if not re.fullmatch("([01][0-9]|2[0-3]):[0-5][0-9]", text):
        raise ValueError("not a time of the day")
    return 60 * int(text[:2]) + int(text[3:])


def _check_leap_second(path: Path, given: Field, day: int, match: re.Match[str], system: str) -> None:
    """Refuse second 60 but in a leap second of UTC."""
    try:
        if system != "UTC":
            raise OrbitError(f"{system} has no leap seconds")
        Epoch.from_text(f"{date.fromordinal(day)}T{match[1]}:{match[2]}:60Z")
    except OrbitError as error:
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown}, a second that does not exist: {error}"
        ) from None


def utc_epoch(path: Path, given: Field) -> Epoch:
    """The instant of a field in UTC; raises `OrbitError` with its place."""
    day, _ = instant(path, given, "UTC")
    clock = given.value.partition("T")[2].rstrip("Z").rstrip(".")
    try:
        return Epoch.from_text(f"{date.fromordinal(day)}T{clock}Z")
    except OrbitError as error:
        raise OrbitError(f"{path}, {given.place}: {given.key}: {error}") from None


def elapsed_s(system: str, epoch: Epoch, instants: list[tuple[int, float]], where: str) -> Floats:
    """Seconds since `epoch` of instants, each the ordinal of a day and seconds in it, in one of `TIME_SYSTEMS`.

    Raises `OrbitError`, beginning with `where`, for a day of UTC outside the years of `Epoch`.
    """
    days = np.array([day for day, _ in instants], dtype=np.int64)
    seconds = np.array([second for _, second in instants])
    try:
        if system == "UTC":  # by days, since a leap second makes one longer
            unique, index = np.unique(days, return_inverse=True)
            zero = [epoch.seconds_to(Epoch.from_text(f"{date.fromordinal(int(d))}T00:00:00Z")) for d in unique]
            of_utc: Floats = np.array(zero)[index] + seconds
            return of_utc
        midnight = Epoch.from_text(f"{epoch.text[:10]}T00:00:00Z")
    except OrbitError as error:
        raise OrbitError(f"{where}: {error}") from None
    day = date.fromisoformat(epoch.text[:10]).toordinal()
    whole_days_s = (day - date(2000, 1, 1).toordinal()) * DAY_S
    tai_minus_utc_s = _Y2K_TAI_MINUS_UTC_S + _Y2K.seconds_to(midnight) - whole_days_s
    after_midnight = (days - day) * DAY_S + (seconds - tai_minus_utc_s - _AHEAD_OF_TAI_S[system])
    elapsed: Floats = after_midnight + epoch.seconds_to(midnight)
    return elapsed
