"""Missions with the tables of a day: the shipped ones with keys changed, element sets and ephemerides."""

import tomllib
from datetime import datetime, timedelta

from link_files import with_keys, written
from microrad.mission.file import load_link
from shipped import SHIPPED

TABLES = ("mirror", "amplifier", "control", "scenario", "fine_pointing")


KEPLERIAN = {
    "kind": "keplerian",
    "semi_major_axis": "7000 km",
    "eccentricity": 0.001,
    "inclination": "97.4 deg",
    "node": "0 deg",
    "argument_of_perigee": "90 deg",
    "mean_anomaly": "0 deg",
    "gravity": "j2",
}


HELD = {
    "attitude": "nadir",
    "boresight": [0.0, 0.0, -1.0],
    "field_of_regard": "60 deg",
    "slew_limit": "1 deg/s",
    "sun_exclusion": "0 deg",
    "in_eclipse": True,
}


BY_FILE = {
    "pattern": "file",
    "file": "a.tle",
    "terminals": 1,
    "overhead": "60 s",
    "session": "600 s",
    "shortest": "180 s",
    "relays": {"east": {"longitude": "143 deg"}},
}


ALONE = {"constellation": None}  # a pattern needs a circular orbit to repeat


LIMITS, KIRUNA = "orbit.leo.limits", "operations.downlink.stations.kiruna"


EPOCH = "2026-03-20T12:00:00Z"


def day_data(*changes):
    """The shipped mission's tables of its links and its day with dotted keys given; None takes a key out."""
    data = tomllib.loads(SHIPPED.read_text(encoding="utf-8"))
    for table in TABLES:
        del data[table]
    del data["conventions"]["residual"], data["conventions"]["mirror_angle"], data["requirement"]["residual_statistic"]
    del data["acquisition"]["scan"]
    data["acquisition"]["runs"] = 100
    return with_keys(data, *changes)


def day_path(folder, *changes):
    """Path of a file with those tables."""
    return written(folder, day_data(*changes), "day.toml")


def day_file(folder, *changes):
    """The mission of such a file."""
    return load_link(day_path(folder, *changes))


def element_set(
    day=78.5, revolutions=15.2, eccentricity=1000, name="EXAMPLE 1", number="70001", inclination=97.4, year=26
):
    """Three lines of a TLE with right checksums; ``eccentricity`` in ten-millionths."""
    lines = [
        f"1 {number}U 26001A   {year:02d}{day:012.8f}  .00000000  00000-0  00000-0 0  999",
        f"2 {number} {inclination:8.4f} 100.0000 {eccentricity:07d}  90.0000   0.0000 {revolutions:11.8f}    1",
    ]
    digits = [sum(int(c) if c.isdigit() else c == "-" for c in line) % 10 for line in lines]
    return "\n".join([name, *(f"{line}{digit}" for line, digit in zip(lines, digits, strict=True))]) + "\n"


def ephemeris(orbits, time_s, name="EXAMPLE 1"):
    """A CCSDS OEM with the states of an orbit of the epoch `EPOCH`."""
    start = datetime.fromisoformat(EPOCH.removesuffix("Z"))

    def stamp(t):
        return (start + timedelta(seconds=float(t))).isoformat(timespec="microseconds")

    states = orbits.states(time_s)
    meta = {
        "OBJECT_NAME": name,
        "OBJECT_ID": "2026-001A",
        "CENTER_NAME": "EARTH",
        "REF_FRAME": "TEME",
        "TIME_SYSTEM": "UTC",
        "START_TIME": stamp(time_s[0]),
        "STOP_TIME": stamp(time_s[-1]),
        "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": "7",
    }
    lines = [
        "CCSDS_OEM_VERS = 2.0",
        "CREATION_DATE = 2026-03-20T00:00:00",
        "ORIGINATOR = TEST",
        "META_START",
        *(f"{key} = {value}" for key, value in meta.items()),
        "META_STOP",
    ]
    for t, p, v in zip(time_s, states.position_m.T, states.velocity_m_s.T, strict=True):
        lines.append(f"{stamp(t)} " + " ".join(f"{x / 1e3:.9f}" for x in (*p, *v)))
    return "\n".join(lines) + "\n"
