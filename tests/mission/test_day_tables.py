"""The tables of a mission about its orbits and operations: each refusal as a user meets it, and what is taken."""

import math
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from day_files import (
    ALONE,
    BY_FILE,
    EPOCH,
    HELD,
    KEPLERIAN,
    KIRUNA,
    LIMITS,
    day_data,
    day_file,
    day_path,
    element_set,
    ephemeris,
)
from made_tables import made, one_line, told
from microrad import orbit
from microrad.mission.file import MissionError, load_link, load_mission
from microrad.mission.model import _both_fly, _needs_operations, _scan_there
from microrad.mission.tables.acquisition import Scan
from microrad.mission.tables.operations import Constellation, ContactTable, Downlink, OpticalDownlink
from microrad.mission.tables.orbit import Orbits, OrbitTable, VisibilityLimits
from microrad.orbit import operations
from microrad.orbit.base import required
from optical_files import KIRUNA_SITE, optical, shared_stations
from shipped import SHIPPED, edited_file, without_fine_pointing


def faults(path):
    with pytest.raises(MissionError) as refused:
        load_link(path)
    text = str(refused.value)
    for fault in refused.value.faults:
        assert fault.reason in text
        assert fault.expected in text
    return refused.value.faults


def without(table, key):
    return {k: v for k, v in table.items() if k != key}


NETWORK = "operations.optical"
AT_KIRUNA = {**KIRUNA_SITE, "availability": 0.5}
SHARED_KIRUNA = {**AT_KIRUNA, "terminals": 1, "data_rate": "1 Gbit/s"}
WITH_STATIONS = optical({"kiruna": 0.5}) | {"constellation.stations": {"kiruna": SHARED_KIRUNA}}


# -------------------------------------------------------------------------------------------------- one key at a time
ANGLE = "an angle with its unit"
REFUSED = [
    # key, value, reason, advice; a value of None takes the key out
    (f"{NETWORK}.weather", "0 h", "is not above 0 s", 'weather = "5 h"'),
    (f"{NETWORK}.correlation_length", "-1 km", "is below 0 m", 'correlation_length = "5 km"'),
    (f"{NETWORK}.correlation_length", "500", "is a number without a unit", 'correlation_length = "500 km"'),
    (f"{NETWORK}.data_rate", None, "is missing", "a data rate with its unit"),
    (f"{NETWORK}.stations", {}, "holds no station", "a table such as [operations.optical.stations.tenerife]"),
    (f"{NETWORK}.stations", {f"s{k}": AT_KIRUNA for k in range(101)}, "holds 101 stations", "at most 100"),
    (f"{NETWORK}.stations.kiruna.availability", 1.01, "is above 1", "at most 1, or a list of 12 such, January to"),
    (f"{NETWORK}.stations.kiruna.availability", -0.01, "is below 0", "at least 0"),
    (f"{NETWORK}.stations.kiruna.availability", "70 %", "is not a plain number", "a number without quotes"),
    (f"{NETWORK}.stations.kiruna.availability", [0.5] * 11, "is a list of 11, and a year has 12 months", "December"),
    (f"{NETWORK}.stations.kiruna.availability", [0.5] * 11 + [1.5], "item 12: 1.5 is above 1", "a list of 12"),
    (f"{NETWORK}.stations.kiruna.availability", None, "is missing", "a list of 12 such, January to December"),
    (f"{NETWORK}.stations.kiruna.mask", "95 deg", "is above", "an angle with its unit"),
    ("constellation.stations.kiruna.terminals", 0, "is below 1", "a whole number without quotes, from 1 to 100"),
    ("constellation.stations.kiruna.terminals", None, "is missing", "a whole number without quotes"),
    ("constellation.stations.kiruna.data_rate", "0 bit/s", "is not above 0 bit/s", "a data rate with its unit"),
    ("constellation.stations.kiruna.availability", 2, "is above 1", "a list of 12 such"),
    ("constellation.stations.east", SHARED_KIRUNA, "is the name of a relay, too", "a name of its own"),
    ("orbit.epoch", "2026-03-20T12:00:00", "is not a date and time with a Z for UTC", f"epoch = {EPOCH}"),
    ("orbit.epoch", "2026-03-20T12:00:00+00:00", "is not a date and time with a Z for UTC", f"epoch = {EPOCH}"),
    ("orbit.epoch", "2026-02-30T12:00:00Z", "is no date: day is out of range for month", f"epoch = {EPOCH}"),
    ("orbit.epoch", "2026-03-20T25:00:00Z", "is no date: hour must be in 0..23", f"epoch = {EPOCH}"),
    ("orbit.epoch", "tomorrow", "is not a date and time with a Z for UTC", "a date and time in UTC"),
    ("orbit.epoch", 20260320, "is not a date and time with a Z for UTC", "a date and time in UTC"),
    ("orbit.epoch", None, "is missing", f"a date and time in UTC; for example epoch = {EPOCH}"),
    ("orbit.duration", "10 s", "is below 60 s", "a time with its unit"),
    ("orbit.duration", "10000 h", "is above 34560000 s", "a time with its unit"),
    ("orbit.earth", "flat", "is none of the choices", 'earth = "oblate" or earth = "sphere"'),
    ("orbit.grazing_height", "-1 km", "is below 0 m", "a length with its unit"),
    ("orbit.grazing_height", "1001 km", "is above 1000 km", "a length with its unit"),
    ("orbit.leo", None, "is missing", "a table with the keys kind, altitude,"),
    ("orbit.geo.longitude", None, 'is missing, and kind = "geostationary" needs it', 'longitude = "143 deg" would do'),
    ("orbit.geo.longitude", "143", "is a number without a unit", 'longitude = "143 deg"'),
    ("orbit.geo.longitude", "400 deg", "is above", ANGLE),
    ("orbit.geo.altitude", "35786 km", 'does not belong to kind = "geostationary"', "this line removed"),
    ("orbit.geo.node", "0 deg", 'does not belong to kind = "geostationary"', "this line removed"),
    ("orbit.leo.kind", "polar", "is none of the choices", 'kind = "ephemeris"'),
    ("orbit.leo.altitude", None, 'is missing, and kind = "circular" needs it', 'altitude = "500 km" would do'),
    ("orbit.leo.altitude", "99 km", "is below 100 km", "a length with its unit"),
    ("orbit.leo.phase", None, 'is missing, and kind = "circular" needs it', 'phase = "0 deg" would do'),
    ("orbit.leo.gravity", None, 'is missing, and kind = "circular" needs it', 'gravity = "j2" would do'),
    ("orbit.leo.semi_major_axis", "7000 km", 'does not belong to kind = "circular"', "this line removed"),
    ("orbit.leo.mean_anomaly", "0 deg", 'does not belong to kind = "circular"', "this line removed"),
    ("orbit.leo.longitude", "0 deg", 'does not belong to kind = "circular"', "this line removed"),
    ("orbit.leo.file", "a.tle", 'does not belong to kind = "circular"', "this line removed"),
    ("orbit.leo.object", "ISS", 'does not belong to kind = "circular"', "this line removed"),
    ("orbit.leo.gravity", "two-body", 'is "two-body", in which no node follows the Sun', 'gravity = "j2"'),
    ("orbit.leo.inclination", "sunsynchronous", "does not begin with a plain number", 'or "sun-synchronous"'),
    ("orbit.leo.inclination", "190 deg", "is above", 'or "sun-synchronous"'),
    ("orbit.leo.inclination", None, 'is missing, and kind = "circular" needs it', 'inclination = "97.4 deg" would do'),
    ("orbit.leo.node", "0 deg", "stands beside local_time", "one of the two removed"),
    ("orbit.leo.local_time", "25 h", "is above", "a time with its unit"),
    (f"{LIMITS}.attitude", "spinning", "is none of the choices", 'attitude = "sun"'),
    (f"{LIMITS}.attitude", None, "is missing", 'attitude = "nadir"'),
    (f"{LIMITS}.field_of_regard", "60 deg", 'does not belong to attitude = "free": the body turns', "line removed"),
    (f"{LIMITS}.boresight", [0.0, 0.0, 1.0], 'does not belong to attitude = "free": the body turns', "line removed"),
    (f"{LIMITS}.slew_limit", "0 deg/s", "is not above 0 deg/s", "an angular rate with its unit"),
    (f"{LIMITS}.slew_limit", None, "is missing", "an angular rate with its unit"),
    (f"{LIMITS}.sun_exclusion", "91 deg", "is above", ANGLE),
    (f"{LIMITS}.sun_exclusion", None, "is missing", ANGLE),
    (f"{LIMITS}.in_eclipse", None, "is missing", "true or false, without quotes"),
    (f"{LIMITS}.in_eclipse", "no", "is neither true nor false", "true or false, without quotes"),
    ("operations.instrument_rate", "0 bit/s", "is not above 0 bit/s", "a data rate with its unit"),
    ("operations.store", "0 GB", "is not above 0 bit", "a volume of data with its unit"),
    ("operations.store", "1 km", "", "a volume of data with its unit"),
    ("operations.relay_share", 0, "is below 0.01", "at least 0.01, at most 1"),
    ("operations.relay_share", 1.5, "is above 1", "at least 0.01, at most 1"),
    ("operations.relay_share", "50 %", "is not a plain number", "a number without quotes"),
    ("operations.relay_delay", "-1 s", "is below 0 s", "a time with its unit"),
    ("operations.margin", "-1 dB", "is below 0 dB", "a ratio in decibels"),
    ("operations.runs", 0, "is below 1", "from 1 to 10000"),
    ("operations.seed", -1, "is below 0", "a whole number without quotes"),
    ("operations.rates", ["300 Mbit/s", "100 Mbit/s"], "does not rise from item to item", "a list, rising"),
    ("operations.rates", ["300 Mbit/s", "300 Mbit/s"], "does not rise from item to item", "a list, rising"),
    ("operations.rates", [], "is not a list with something in it", "a list, rising"),
    ("operations.rates", ["300"], 'item 1: "300" is a number without a unit', "each item a data rate"),
    ("operations.downlink.data_rate", "0 bit/s", "is not above 0 bit/s", "a data rate with its unit"),
    ("operations.downlink.stations", {}, "holds no station", "[operations.downlink.stations.kiruna]"),
    (f"{KIRUNA}.mask", "95 deg", "is above", "at least 0 deg, at most 89 deg"),
    (f"{KIRUNA}.mask", "-1 deg", "is below 0 deg", ANGLE),
    (f"{KIRUNA}.latitude", "91 deg", "is above", ANGLE),
    (f"{KIRUNA}.longitude", None, "is missing", 'longitude = "5 deg"'),
    (f"{KIRUNA}.height", "10 km", "is above 9 km", "a length with its unit"),
    ("operations.contact.number", 0, "is below 1", "from 1 to 100000"),
    ("operations.contact.window", "0 s", "is not above 0 s", "a time with its unit"),
    ("operations.contact.hold", "2 s", "is not below window (2 s): a window would never show a loss", "below 2 s"),
    ("constellation.planes", 5, "does not divide satellites = 12", "a divisor of it"),
    ("constellation.phasing", 3, "is not below planes = 3", "0 to 2"),
    ("constellation.satellites", None, 'is missing, and pattern = "delta" needs it', "satellites = 1 would do"),
    ("constellation.file", "a.tle", 'does not belong to pattern = "delta"', "this line removed"),
    ("constellation.shortest", "60 s", "is not above overhead: such a session would carry no data", "more than 60 s"),
    ("constellation.session", "179.9 s", "is below shortest", "at least 180 s"),
    ("constellation.session", "60 s", "is below shortest", "at least 180 s"),
    ("constellation.terminals", 0, "is below 1", "from 1 to 100"),
    ("constellation.relays", {}, "holds no relay", "[constellation.relays.east]"),
    ("constellation.relays.east.longitude", None, "is missing", ANGLE),
]


@pytest.mark.promise("day-7", "day-8", "day-16")
@pytest.mark.parametrize(("key", "value", "reason", "advice"), REFUSED)
def test_a_key_is_refused_with_its_value_the_reason_and_what_to_do(tmp_path, key, value, reason, advice):
    path = day_path(
        tmp_path, WITH_STATIONS if key.startswith((NETWORK, "constellation.stations")) else {}, {key: value}
    )
    (fault,) = faults(path)
    assert fault.key == key
    assert fault.reason.startswith(reason)
    assert advice in fault.expected
    line = path.read_text(encoding="utf-8").splitlines()[fault.line - 1]
    if value is None or isinstance(value, dict):
        assert fault.value == ""
        assert line.startswith("[")  # the header of the table that lacks it
    else:
        assert line == f"{key.rpartition('.')[2]} = {fault.value}"


OTHERWISE = {
    "eccentricity of no ellipse": (
        {"orbit.leo": {**KEPLERIAN, "eccentricity": 1.0}, **ALONE},
        ("orbit.leo.eccentricity", "1.0", "is above 0.999", "at least 0, at most 0.999"),
    ),
    "phase of an ellipse": (
        {"orbit.leo": {**KEPLERIAN, "phase": "0 deg"}, **ALONE},
        ("orbit.leo.phase", '"0 deg"', 'does not belong to kind = "keplerian"', "this line removed"),
    ),
    "elements without file": (
        {"orbit.leo": {"kind": "elements"}, **ALONE},
        ("orbit.leo.file", "", 'is missing, and kind = "elements" needs it', 'file = "satellite.tle" would do'),
    ),
    "ephemeris without file": (
        {"orbit.leo": {"kind": "ephemeris"}, **ALONE},
        ("orbit.leo.file", "", 'is missing, and kind = "ephemeris" needs it', 'file = "satellite.oem" would do'),
    ),
    "altitude of an ephemeris": (
        {"orbit.leo": {"kind": "ephemeris", "file": "a.oem", "altitude": "500 km"}, **ALONE},
        ("orbit.leo.altitude", '"500 km"', 'does not belong to kind = "ephemeris"', "this line removed"),
    ),
    "neither node nor local time": (
        {"orbit.leo.local_time": None},
        ("orbit.leo.node", "", "is missing, and so is local_time", 'node = "0 deg" or local_time = "10.5 h" would do'),
    ),
    "nadir without boresight": (
        {LIMITS: without(HELD, "boresight")},
        (f"{LIMITS}.boresight", "", 'is missing, and attitude = "nadir" needs it', "[0.0, 0.0, -1.0] would do"),
    ),
    "sun without field of regard": (
        {LIMITS: {**without(HELD, "field_of_regard"), "attitude": "sun"}},
        (f"{LIMITS}.field_of_regard", "", 'is missing, and attitude = "sun" needs it', '"70 deg" would do'),
    ),
    "boresight of zeros": (
        {LIMITS: {**HELD, "boresight": [0.0, 0.0, 0.0]}},
        (f"{LIMITS}.boresight", "[0.0, 0.0, 0.0]", "has no direction", "boresight = [0.0, 0.0, -1.0]"),
    ),
    "boresight of next to nothing": (
        {LIMITS: {**HELD, "boresight": [0.06, 0.0, -0.0799]}},
        (f"{LIMITS}.boresight", "[0.06, 0.0, -0.0799]", "has no direction", "boresight = [0.0, 0.0, -1.0]"),
    ),
    "boresight of two": (
        {LIMITS: {**HELD, "boresight": [0.0, 1.0]}},
        (f"{LIMITS}.boresight", "[0.0, 1.0]", "has 2 items", "three: boresight = [0.0, 0.0, -1.0]"),
    ),
    "boresight too long": (
        {LIMITS: {**HELD, "boresight": [0.0, 0.0, -2.0]}},
        (f"{LIMITS}.boresight", "[0.0, 0.0, -2.0]", "item 3: -2 is below -1", "at least -1, at most 1"),
    ),
    "field of regard of nothing": (
        {LIMITS: {**HELD, "field_of_regard": "0 deg"}},
        (f"{LIMITS}.field_of_regard", '"0 deg"', "is not above 0 deg", ANGLE),
    ),
    "planes of a file": (
        {"constellation": {**BY_FILE, "planes": 3}},
        ("constellation.planes", "3", 'does not belong to pattern = "file"', "this line removed"),
    ),
    "pattern of no file": (
        {"constellation": without(BY_FILE, "file")},
        ("constellation.file", "", 'is missing, and pattern = "file" needs it', 'file = "satellites.tle" would do'),
    ),
    "misspelled": (
        {"orbit.leo.phases": "0 deg"},
        ("orbit.leo.phases", "", "is no key of [orbit.leo]", "one of kind, altitude"),
    ),
}


@pytest.mark.parametrize("name", OTHERWISE)
def test_keys_that_do_not_fit_together(tmp_path, name):
    changes, (key, value, reason, advice) = OTHERWISE[name]
    (fault,) = faults(day_path(tmp_path, changes))
    assert (fault.key, fault.value) == (key, value)
    assert fault.reason.startswith(reason)
    assert advice in fault.expected


@pytest.mark.parametrize(
    ("key", "value"),
    [
        (LIMITS, {**HELD, "boresight": [0.1, 0.0, 0.0]}),
        (LIMITS, {**HELD, "boresight": [0.0, -0.1, 0.0]}),
        (LIMITS, {**HELD, "boresight": [0.06, 0.0, -0.0801]}),
        ("constellation.session", "180 s"),
        ("constellation.shortest", "60.1 s"),
        ("constellation.phasing", 2),
        ("constellation.phasing", 0),
        ("constellation.planes", 12),
        ("operations.contact.hold", "1.99 s"),
        ("operations.downlink.stations.kiruna.mask", "89 deg"),
    ],
)
def test_what_meets_a_limit_of_a_day_is_taken(tmp_path, key, value):
    assert load_link(day_path(tmp_path, {key: value})).mission.orbit is not None


def test_a_hundred_stations_are_taken(tmp_path):
    many = {f"s{k}": AT_KIRUNA for k in range(100)}
    file = load_link(day_path(tmp_path, WITH_STATIONS, {f"{NETWORK}.stations": many}))
    assert len(file.mission.operations.optical.stations) == 100


def test_another_kind_of_orbit_says_every_key_that_is_missing_and_every_one_too_many(tmp_path):
    found = {
        f.key.removeprefix("orbit.leo."): f.reason
        for f in faults(day_path(tmp_path, {"orbit.leo.kind": "keplerian"}, ALONE))
    }
    missing = {"semi_major_axis", "eccentricity", "argument_of_perigee", "mean_anomaly"}
    assert found.keys() == missing | {"altitude", "phase"}
    for key, reason in found.items():
        assert reason.startswith("is missing, and kind" if key in missing else "does not belong to kind")


@pytest.mark.parametrize("name", ["operations", "constellation"])
def test_a_table_that_needs_the_orbits_says_so(tmp_path, name):
    other = {"operations": "constellation", "constellation": "operations"}[name]
    found = faults(day_path(tmp_path, {"orbit": None, other: None}))
    assert {fault.key for fault in found} == {name}
    (fault,) = [fault for fault in found if fault.reason == "stands without the table orbit"]
    assert "microrad init" in fault.expected


def test_a_constellation_needs_the_operations(tmp_path):
    (fault,) = faults(day_path(tmp_path, {"operations": None}))
    assert (fault.key, fault.reason) == ("constellation", "stands without the table operations")


def test_gravity_of_no_choice_names_the_choices(tmp_path):
    (fault,) = faults(day_path(tmp_path, {"orbit.leo.gravity": "j4"}))
    assert fault.reason == "is none of the choices"
    assert 'gravity = "two-body" or gravity = "j2"' in fault.expected


# ------------------------------------------------------------------------------------------------- dates as TOML's own
def with_epoch(folder, text):
    path = day_path(folder)
    whole = path.read_text(encoding="utf-8")
    assert whole.count(f'epoch = "{EPOCH}"') == 1
    path.write_text(whole.replace(f'epoch = "{EPOCH}"', f"epoch = {text}"), encoding="utf-8")
    return path


@pytest.mark.promise("day-7")
@pytest.mark.parametrize(
    ("text", "epoch"),
    [
        ("2026-03-20T12:00:00Z", EPOCH),
        ("2026-03-20 12:00:00Z", EPOCH),
        ("2026-03-20T13:30:00+01:30", EPOCH),
        ("2026-03-19T23:00:00-13:00", EPOCH),
        ("2026-03-20T12:00:00.25Z", "2026-03-20T12:00:00.250000Z"),
        ('"2026-03-20T12:00Z"', "2026-03-20T12:00Z"),
    ],
)
def test_a_date_with_its_zone_is_taken_quoted_or_not(tmp_path, text, epoch):
    file = load_link(with_epoch(tmp_path, text))
    assert file.mission.orbit.epoch == epoch
    assert orbit.Epoch(epoch).utc(0.0) == f"2026-03-20T12:00:00.{'250' if '.25' in text else '000'}Z"


@pytest.mark.parametrize(
    ("text", "shown", "reason"),
    [
        ("2026-03-20", "2026-03-20", "is not a date and time with a Z for UTC"),
        ("2026-03-20T12:00:00", "2026-03-20 12:00:00", "is not a date and time with a Z for UTC"),
        ("12:00:00", "12:00:00", "is not a date and time with a Z for UTC"),
        ("0001-01-01T00:00:00+05:00", "0001-01-01 00:00:00+05:00", "is no date in UTC"),
        ("9999-12-31T23:59:59-05:00", "9999-12-31 23:59:59-05:00", "is no date in UTC"),
    ],
)
def test_a_date_without_its_zone_is_refused_quoted_or_not(tmp_path, text, shown, reason):
    (fault,) = faults(with_epoch(tmp_path, text))
    assert (fault.key, fault.value, fault.reason) == ("orbit.epoch", shown, reason)
    assert f"epoch = {EPOCH}" in fault.expected


# --------------------------------------------------------------------------------- orbits that do not hold, by the file
def refused_orbit(folder, *changes):
    file = day_file(folder, *changes)
    with pytest.raises(orbit.OrbitError) as refused:
        orbit.pair(file.mission.orbit, file.mission.terminals, folder)
    return str(refused.value)


def has(text, *words):
    for word in words:
        assert word in text, (word, text)


def test_an_epoch_beyond_the_tables_of_the_earths_rotation(tmp_path):
    for year in (1950, 2100):
        text = refused_orbit(tmp_path, {"orbit.epoch": f"{year}-01-01T00:00:00Z"})
        has(text, "orbit.epoch: ", f"'{year}-01-01T00:00:00Z'", "1973-01-02 to 2050-12-31", "take an instant")


@pytest.mark.parametrize(
    "changes",
    [
        {"orbit.leo.altitude": "110 km"},
        {"orbit.leo": {**KEPLERIAN, "eccentricity": 0.073123}, **ALONE},  # 7000 km (1 - e) = 6378 + 110 km
    ],
)
def test_a_decayed_orbit_is_refused_with_its_perigee(tmp_path, changes):
    text = refused_orbit(tmp_path, changes)
    has(text, "orbit.leo: ", "its perigee is 110", " km over the equator, below 120 km: it has decayed", "raise the")


def test_no_orbit_so_high_is_sun_synchronous(tmp_path):
    has(refused_orbit(tmp_path, {"orbit.leo.altitude": "6000 km"}), "orbit.leo: ", "6000 km", "at most 5974 km")


BY_ELEMENTS = {"orbit.leo": {"kind": "elements", "file": "a.tle"}, **ALONE}


@pytest.mark.promise("day-12")
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (element_set(day=50.0), ["expired", "2026-02-19T00:00:00Z", EPOCH, "30.50 days", "14 days", "take newer"]),
        (element_set(day=110.0), ["not valid yet", "30.50 days", "take older"]),
        (element_set(revolutions=16.45, eccentricity=100000), ["perigee is", "decays", "an epoch before its decay"]),
        (element_set().replace(" 100.0000", " 100.0001"), ["line 3: the checksum of line 2 is", "download"]),
        (element_set()[:-20], ["line 3", "69 characters", "copy it whole"]),
        (element_set() + element_set(name="EXAMPLE 2", number="70002"), ["EXAMPLE 1 (70001), EXAMPLE 2 (70002)"]),
        ("", ["a.tle"]),
        ("hello\n", ["a.tle"]),
    ],
)
def test_elements_that_do_not_hold_are_refused_with_the_reason(tmp_path, text, words):
    (tmp_path / "a.tle").write_text(text, encoding="utf-8")
    has(refused_orbit(tmp_path, BY_ELEMENTS), "orbit.leo: ", str(tmp_path / "a.tle"), *words)


def test_a_file_or_a_satellite_that_is_not_there(tmp_path):
    has(refused_orbit(tmp_path, BY_ELEMENTS), f"orbit.leo: {tmp_path / 'a.tle'}: there is no such file")
    (tmp_path / "a.tle").write_text(element_set(), encoding="utf-8")
    text = refused_orbit(tmp_path, BY_ELEMENTS, {"orbit.leo.object": "EXEMPLAR"})
    has(text, "orbit.leo: ", "is of 'EXEMPLAR'", "nearest are EXAMPLE 1")


LOW = orbit.circular("low", orbit.Epoch(EPOCH), 500e3, math.radians(97.4), 0.0, 0.0, True)
BY_EPHEMERIS = {"orbit.leo": {"kind": "ephemeris", "file": "a.oem"}, **ALONE}


@pytest.mark.parametrize(("first", "last"), [(0.0, 80000.0), (600.0, 90000.0), (90000.0, 180000.0)])
def test_an_epoch_outside_an_ephemeris_is_refused_with_both_spans(tmp_path, first, last):
    text = ephemeris(LOW, np.arange(first, last, 100.0))
    (tmp_path / "a.oem").write_text(text, encoding="utf-8")
    said = refused_orbit(tmp_path, BY_EPHEMERIS)
    has(said, "orbit.leo: ", "EXAMPLE 1", "2026-03-2")
    assert LOW.epoch.utc(first)[:16] in said


@pytest.mark.promise("day-22")
def test_an_ephemeris_that_just_covers_the_span_leaves_no_tail(tmp_path):
    for last, tail in ((86400.0, 0.0), (90000.0, 3600.0), (260000.0, 86400.0)):
        (tmp_path / "a.oem").write_text(ephemeris(LOW, np.arange(0.0, last + 1.0, 100.0)), encoding="utf-8")
        file = day_file(tmp_path, BY_EPHEMERIS)
        assert orbit.pair(file.mission.orbit, file.mission.terminals, tmp_path).tail_s == pytest.approx(tail, abs=1e-3)


@pytest.mark.promise("day-8", "day-12", "day-22")
def test_the_tail_of_elements_ends_with_their_life(tmp_path):
    for day, tail in ((79.5 - 13.5, 43200.0), (79.5, 86400.0)):
        (tmp_path / "a.tle").write_text(element_set(day=day - 0.0), encoding="utf-8")
        file = day_file(tmp_path, BY_ELEMENTS, {"orbit.duration": "1 h"})
        age_s = (79.5 - day) * 86400.0
        left = 14 * 86400.0 - age_s - 3600.0
        assert orbit.pair(file.mission.orbit, file.mission.terminals, tmp_path).tail_s == pytest.approx(
            min(tail, left), abs=1e-3
        )


# -------------------------------------------------------------------------------------------------------- what is taken
def test_the_shipped_file_is_read_whole_and_edited(tmp_path):
    assert load_mission(SHIPPED).mission.orbit.leo.kind == "circular"
    changed = edited_file(tmp_path, ('altitude = "500 km" ', 'altitude = "600 km" '))
    assert changed.mission.orbit.leo.altitude_m == 600e3
    assert changed.sources["orbit.leo.altitude"].value == '"600 km"'
    text = without_fine_pointing(SHIPPED.read_text(encoding="utf-8"))
    (tmp_path / "bad.toml").write_text(text.replace('mask = "5 deg"', 'mask = "95 deg"'), encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mission(tmp_path / "bad.toml")
    (fault,) = refused.value.faults
    assert (fault.key, fault.value) == (f"{KIRUNA}.mask", '"95 deg"')


@pytest.mark.promise("day-7", "day-8", "day-16", "day-43")
def test_tables_become_orbits_with_their_numbers(tmp_path):
    own = day_file(tmp_path, {"orbit.leo": {**KEPLERIAN, LIMITS.rpartition(".")[2]: HELD}}, ALONE)
    pair = orbit.pair(own.mission.orbit, own.mission.terminals, tmp_path)
    ellipse = pair.leo.orbit
    assert (ellipse.semi_major_axis_m, ellipse.eccentricity, ellipse.j2) == (7e6, 0.001, True)
    assert ellipse.argument_of_perigee_rad == pytest.approx(math.pi / 2)
    limits = pair.leo.limits
    assert (limits.attitude, limits.boresight, limits.sun_exclusion_rad) == ("nadir", (0.0, 0.0, -1.0), 0.0)
    assert limits.slew_limit_rad_s == pytest.approx(math.radians(1.0))
    assert limits.field_of_regard_rad == pytest.approx(math.pi / 3)
    assert (pair.span_s, pair.tail_s, pair.whole_s) == ((0.0, 86400.0), 86400.0, (0.0, 172800.0))
    assert pair.earth == orbit.Earth("oblate", 100e3)
    assert pair.geo.orbit.longitude_rad == pytest.approx(math.radians(143.0))


@pytest.mark.promise("day-8")
def test_a_circle_has_its_height_over_the_equator_its_node_and_its_phase(tmp_path):
    angles = {"orbit.leo.inclination": "51.6 deg", "orbit.leo.node": "30 deg", "orbit.leo.phase": "40 deg"}
    other = {"orbit.leo.local_time": None, "orbit.leo.gravity": "two-body"}
    own = day_file(tmp_path, angles, other)
    circle = orbit.pair(own.mission.orbit, own.mission.terminals, tmp_path).leo.orbit
    assert (circle.semi_major_axis_m, circle.eccentricity, circle.j2) == (6_878_137.0, 0.0, False)
    found = circle.inclination_rad, circle.node_rad, circle.argument_of_perigee_rad + circle.mean_anomaly_rad
    assert np.degrees(found) == pytest.approx([51.6, 30.0, 40.0])


@pytest.mark.promise("day-15")
@pytest.mark.parametrize("end", ["leo", "geo"])
@pytest.mark.parametrize("limited", [True, False])
def test_without_limits_only_the_earth_stands_in_the_way(tmp_path, end, limited):
    own = day_file(tmp_path, {} if limited else {f"orbit.{end}.limits": None})
    found = orbit.pair(own.mission.orbit, own.mission.terminals, tmp_path)
    assert (getattr(found, end).limits == orbit.UNLIMITED) is not limited


@pytest.mark.promise("day-8")
@pytest.mark.parametrize("wanted", ["EXAMPLE 2", "70002"])
def test_a_satellite_of_a_file_goes_by_its_name_or_its_number(tmp_path, wanted):
    second = element_set(name="EXAMPLE 2", number="70002", inclination=60.0)
    (tmp_path / "a.tle").write_text(element_set() + second, encoding="utf-8")
    own = day_file(tmp_path, BY_ELEMENTS, {"orbit.leo.object": wanted})
    found = orbit.pair(own.mission.orbit, own.mission.terminals, tmp_path).leo.orbit.elements
    assert (found.name, found.catalogue_number) == ("EXAMPLE 2", "70002")


@pytest.mark.promise("day-7")
@pytest.mark.parametrize("kind", ["circular", "keplerian", "geostationary", "elements", "ephemeris"])
def test_either_end_is_of_any_kind(tmp_path, kind):
    (tmp_path / "a.tle").write_text(element_set(), encoding="utf-8")
    (tmp_path / "a.oem").write_text(ephemeris(LOW, np.arange(0.0, 90000.0, 100.0)), encoding="utf-8")
    table = {
        "circular": day_data()["orbit"]["leo"],
        "keplerian": KEPLERIAN,
        "geostationary": {"kind": "geostationary", "longitude": "9 deg"},
        "elements": {"kind": "elements", "file": "a.tle"},
        "ephemeris": {"kind": "ephemeris", "file": "a.oem"},
    }[kind]
    tables = day_file(tmp_path, {"orbit.leo": table, "orbit.geo": table}, ALONE).mission
    pair = orbit.pair(tables.orbit, tables.terminals, tmp_path)
    assert type(pair.leo.orbit) is type(pair.geo.orbit)
    places = [end.orbit.states(np.array([600.0])).position_m for end in (pair.leo, pair.geo)]
    np.testing.assert_array_equal(*places)
    assert 6.5e6 < np.linalg.norm(places[0]) < 4.3e7


@pytest.mark.promise("day-42")
def test_no_key_is_there_for_what_a_day_leaves_out(tmp_path):
    """Air, weather, thrust, the Moon, the body's own shadow, the budget of the radio link."""
    m = day_file(tmp_path).mission
    keys = " ".join([*flat(m.orbit.model_dump()), *flat(m.operations.model_dump())])
    assert "orbit.leo" not in keys and "leo.altitude_m" in keys and "downlink.data_rate_bit_s" in keys
    for left_out in (
        "drag",
        "thrust",
        "station_keeping",
        "refraction",
        "weather",
        "cloud",
        "moon",
        "shadow",
        "antenna",
    ):
        assert left_out not in keys.lower()


def flat(table, start=""):
    """Dotted names of the values of a table."""
    found = []
    for name, value in table.items():
        found += flat(value, f"{start}{name}.") if isinstance(value, dict) else [f"{start}{name}"]
    return found


@pytest.mark.promise("day-8")
def test_sun_synchronous_is_the_inclination_whose_node_follows_the_sun(tmp_path):
    own = orbit.pair(day_file(tmp_path).mission.orbit, day_file(tmp_path).mission.terminals, tmp_path).leo.orbit
    assert math.degrees(own.inclination_rad) == pytest.approx(97.4, abs=0.05)
    a_year = 2.0 * math.pi / (365.2422 * 86400.0)
    assert own.secular_rates_rad_s()[0] == pytest.approx(a_year, rel=1e-6)
    # 10.5 h: the node is 22.5 deg west of the mean Sun, that of an equinox near 0 deg
    assert math.remainder(own.node_rad - math.radians(-22.5), 2.0 * math.pi) == pytest.approx(
        0.0, abs=math.radians(2.5)
    )


def test_a_mission_read_twice_is_the_same(tmp_path):
    one, same = (day_file(tmp_path).mission for _ in range(2))
    assert one == same
    assert pickle.loads(pickle.dumps(one)) == one


def test_two_terminals_of_one_make_are_told_apart(tmp_path):
    file = day_file(tmp_path, {"terminals.leo_name": "T", "terminals.geo_name": "T"})
    pair = orbit.pair(file.mission.orbit, file.mission.terminals, tmp_path)
    assert (pair.leo.name, pair.geo.name) == ("T (own)", "T (partner)")


def test_without_tables_the_refusal_names_the_table(tmp_path):
    file = day_file(tmp_path, {"orbit": None, "operations": None, "constellation": None})
    with pytest.raises(orbit.OrbitError, match=r"no table \[orbit\]: microrad init writes one"):
        orbit.pair(file.mission.orbit, file.mission.terminals, tmp_path)
    with pytest.raises(ValueError, match=r"no table \[constellation\]: microrad init writes one"):
        required(file.mission.constellation, "constellation", operations.OperationsError)


def test_tables_with_stations_and_relays_are_hashed_by_what_is_in_them(tmp_path):
    one, same = (day_file(tmp_path).mission for _ in range(2))
    assert hash(one.operations.downlink) == hash(same.operations.downlink)
    assert hash(one.constellation) == hash(same.constellation)
    other = day_file(tmp_path, {f"{KIRUNA}.mask": "6 deg", "constellation.relays.east.longitude": "1 deg"}).mission
    assert hash(one.operations.downlink) != hash(other.operations.downlink)
    assert hash(one.constellation) != hash(other.constellation)
    assert isinstance(one.constellation, Constellation)
    assert isinstance(one.operations.downlink, Downlink)


# ------------------------------------------------------------------------------------------- stations under the weather
def test_availability_is_one_number_or_twelve(tmp_path):
    by_month = [0.05 * month for month in range(1, 13)]
    for given, taken in ((0.7, (0.7,)), (1, (1.0,)), (by_month, tuple(by_month))):
        o = day_file(tmp_path, optical({"kiruna": given})).mission.operations
        assert o.optical.stations["kiruna"].availability == taken


def test_the_tables_of_stations_are_equal_and_hashed_by_what_is_in_them(tmp_path):
    made = [day_file(tmp_path, WITH_STATIONS).mission for _ in range(2)]
    other = day_file(tmp_path, optical({"kiruna": 0.6}) | shared_stations("kiruna")).mission
    for table in (lambda m: m.operations.optical, lambda m: m.constellation):
        assert table(made[0]) == table(made[1]) and hash(table(made[0])) == hash(table(made[1]))
        assert table(made[0]) != table(other) and hash(table(made[0])) != hash(table(other))


def test_a_constellation_needs_no_station_and_a_day_no_network(tmp_path):
    m = day_file(tmp_path).mission
    assert m.operations.optical is None and m.constellation.stations == {}


ALL_OF_A_DAY = {
    "a constellation of much that does not fit": (
        lambda: made(
            Constellation,
            pattern="star",
            satellites=13,
            planes=4,
            phasing=7,
            file="a.tle",
            overhead_s=61.5,
            shortest_s=61.5,
            session_s=45.0,
            relays={},
            stations={},
        ).problems(),
        """
        file does not belong to pattern = "star": expected this line removed; planes does not divide satellites =
        13: expected a divisor of it; phasing is not below planes = 4: expected 0 to 3; shortest is not above
        overhead: such a session would carry no data: expected more than 61.5 s; session is below shortest: expected
        at least 61.5 s; relays holds no relay: expected a table such as [constellation.relays.east]
        """,
    ),
    "sessions with times of five digits": (
        lambda: made(
            Constellation,
            pattern="star",
            satellites=12,
            planes=4,
            phasing=0,
            file="a.tle",
            overhead_s=100.04,
            shortest_s=100.04,
            session_s=100.0,
            relays={},
            stations={},
        ).problems(),
        """
        file does not belong to pattern = "star": expected this line removed; shortest is not above overhead: such a
        session would carry no data: expected more than 100.04 s; session is below shortest: expected at least 100.04
        s; relays holds no relay: expected a table such as [constellation.relays.east]
        """,
    ),
    "a constellation whose second station is a relay": (
        lambda: made(
            Constellation,
            pattern="delta",
            satellites=12,
            overhead_s=60.0,
            shortest_s=90.0,
            session_s=80.0,
            relays={"west": 0, "east": 0},
            stations={"kiruna": 0, "east": 0},
        ).problems(),
        """
        planes is missing, and pattern = "delta" needs it: expected planes = 1 would do; phasing is missing, and
        pattern = "delta" needs it: expected phasing = 0 would do; session is below shortest: expected at least 90
        s; stations.east is the name of a relay, too: expected a name of its own
        """,
    ),
    "a constellation of a file with three keys too many": (
        lambda: made(
            Constellation,
            pattern="file",
            satellites=14,
            planes=5,
            phasing=5,
            overhead_s=1.5,
            shortest_s=2.5,
            session_s=3.5,
            relays={"east": 0},
            stations={},
        ).problems(),
        """
        satellites does not belong to pattern = "file": expected this line removed; planes does not belong to
        pattern = "file": expected this line removed; phasing does not belong to pattern = "file": expected this
        line removed; file is missing, and pattern = "file" needs it: expected file = "satellites.tle" would do;
        planes does not divide satellites = 14: expected a divisor of it; phasing is not below planes = 5: expected
        0 to 4
        """,
    ),
    "a contact that holds as long as it looks": (
        lambda: made(ContactTable, window_s=0.25, hold_s=0.25).problems(),
        """hold is not below window (250 ms): a window would never show a loss: expected below 250 ms""",
    ),
    "a downlink to nowhere": (
        lambda: made(Downlink, stations={}).problems(),
        """stations holds no station: expected a table such as [operations.downlink.stations.kiruna]""",
    ),
    "an optical downlink to nowhere": (
        lambda: made(OpticalDownlink, stations={}).problems(),
        """stations holds no station: expected a table such as [operations.optical.stations.tenerife]""",
    ),
    "an optical downlink to everywhere": (
        lambda: made(OpticalDownlink, stations=dict.fromkeys(range(117))).problems(),
        """stations holds 117 stations: expected at most 100""",
    ),
    "a free body with what a held one has": (
        lambda: made(VisibilityLimits, attitude="free", boresight=(0.06, 0.07), field_of_regard_rad=1.2).problems(),
        """
        boresight does not belong to attitude = "free": the body turns: expected this line removed; field_of_regard
        does not belong to attitude = "free": the body turns: expected this line removed; boresight has 2 items:
        expected three: boresight = [0.0, 0.0, -1.0]
        """,
    ),
    "a body held to the sun without both": (
        lambda: made(VisibilityLimits, attitude="sun").problems(),
        """
        boresight is missing, and attitude = "sun" needs it: expected boresight = [0.0, 0.0, -1.0] would do;
        field_of_regard is missing, and attitude = "sun" needs it: expected field_of_regard = "70 deg" would do
        """,
    ),
    "a body held to the earth that looks nowhere": (
        lambda: made(
            VisibilityLimits, attitude="nadir", boresight=(0.0, 0.06, 0.07), field_of_regard_rad=1.2
        ).problems(),
        """boresight has no direction: expected one such as boresight = [0.0, 0.0, -1.0]""",
    ),
    "a circle with everything of others": (
        lambda: made(
            OrbitTable,
            kind="circular",
            altitude_m=5e5,
            semi_major_axis_m=7e6,
            eccentricity=0.0,
            inclination_rad="sun-synchronous",
            node_rad=0.0,
            local_time_s=0.0,
            argument_of_perigee_rad=0.0,
            mean_anomaly_rad=0.0,
            phase_rad=0.0,
            gravity="two-body",
            longitude_rad=0.0,
            latitude_rad=0.0,
            height_m=0.0,
            mask_rad=0.3,
            file="a.tle",
            object="A",
        ).problems(),
        """
        semi_major_axis does not belong to kind = "circular": expected this line removed; eccentricity does not
        belong to kind = "circular": expected this line removed; argument_of_perigee does not belong to kind =
        "circular": expected this line removed; mean_anomaly does not belong to kind = "circular": expected this
        line removed; longitude does not belong to kind = "circular": expected this line removed; latitude does not
        belong to kind = "circular": expected this line removed; height does not belong to kind = "circular":
        expected this line removed; mask does not belong to kind = "circular": expected this line removed; file does
        not belong to kind = "circular": expected this line removed; object does not belong to kind = "circular":
        expected this line removed; gravity is "two-body", in which no node follows the Sun, and inclination is
        "sun-synchronous": expected gravity = "j2", or an inclination in degrees; node stands beside local_time:
        expected one of the two removed
        """,
    ),
    "an ellipse with nothing": (
        lambda: made(OrbitTable, kind="keplerian").problems(),
        """
        semi_major_axis is missing, and kind = "keplerian" needs it: expected semi_major_axis = "7000 km" would do;
        eccentricity is missing, and kind = "keplerian" needs it: expected eccentricity = 0.001 would do;
        inclination is missing, and kind = "keplerian" needs it: expected inclination = "97.4 deg" would do;
        argument_of_perigee is missing, and kind = "keplerian" needs it: expected argument_of_perigee = "90 deg"
        would do; mean_anomaly is missing, and kind = "keplerian" needs it: expected mean_anomaly = "0 deg" would
        do; gravity is missing, and kind = "keplerian" needs it: expected gravity = "j2" would do; node is missing,
        and so is local_time: expected node = "0 deg" or local_time = "10.5 h" would do
        """,
    ),
    "a circle with nothing": (
        lambda: made(OrbitTable, kind="circular", local_time_s=0.0).problems(),
        """
        altitude is missing, and kind = "circular" needs it: expected altitude = "500 km" would do; inclination is
        missing, and kind = "circular" needs it: expected inclination = "97.4 deg" would do; phase is missing, and
        kind = "circular" needs it: expected phase = "0 deg" would do; gravity is missing, and kind = "circular"
        needs it: expected gravity = "j2" would do
        """,
    ),
    "a station that is held": (
        lambda: made(
            OrbitTable, kind="station", node_rad=0.0, mask_rad=0.3, limits=SimpleNamespace(attitude="sun")
        ).problems(),
        """
        node does not belong to kind = "station": expected this line removed; longitude is missing, and kind =
        "station" needs it: expected longitude = "-16.5 deg" would do; latitude is missing, and kind = "station"
        needs it: expected latitude = "28.3 deg" would do; height is missing, and kind = "station" needs it:
        expected height = "2400 m" would do; limits.attitude is "sun", and a station has none: expected "free"
        """,
    ),
    "a slot with a satellite of a file": (
        lambda: made(
            OrbitTable, kind="geostationary", inclination_rad="sun-synchronous", gravity="two-body", object="A"
        ).problems(),
        """
        inclination does not belong to kind = "geostationary": expected this line removed; gravity does not belong
        to kind = "geostationary": expected this line removed; longitude is missing, and kind = "geostationary"
        needs it: expected longitude = "143 deg" would do; object does not belong to kind = "geostationary":
        expected this line removed
        """,
    ),
    "elements with the wrong keys": (
        lambda: made(OrbitTable, kind="elements", object="A", longitude_rad=1.0).problems(),
        """
        longitude does not belong to kind = "elements": expected this line removed; file is missing, and kind =
        "elements" needs it: expected file = "satellite.tle" would do
        """,
    ),
    "two stations": (
        lambda: made(Orbits, leo=SimpleNamespace(kind="station"), geo=SimpleNamespace(kind="station")).problems(),
        """
        geo.kind is "station", as is leo.kind: one of the two has to fly: expected another kind of orbit
        """,
    ),
    "a raster whose rows do not overlap": (
        lambda: made(Scan, pattern="raster", overlap=0.00075).problems(),
        """
        overlap is 0.00075: between two tracks of pattern = "raster" a target is seen for no time: expected at least
        0.001; overlap = 0.25 or pattern = "step-stare" would do
        """,
    ),
    "a scan that is not there": (
        lambda: _scan_there(SimpleNamespace(acquisition="scan"), SimpleNamespace(scan=None)),
        """
        operations.acquisition is "scan", and the mission has no table acquisition.scan: expected the table
        [acquisition.scan], or "wide beacon"
        """,
    ),
    "a constellation without operations": (
        lambda: _needs_operations(None, SimpleNamespace()),
        """
        constellation stands without the table operations: expected the table [operations], which microrad init
        writes
        """,
    ),
    "a day of a station below a relay": (
        lambda: _both_fly(SimpleNamespace(station="leo"), SimpleNamespace(downlink=0, optical=0), SimpleNamespace()),
        """
        operations.downlink stands beside orbit.leo of kind "station", and means a satellite there: expected the
        table removed, or the station as orbit.geo and the satellite as orbit.leo; operations.optical stands beside
        orbit.leo of kind "station", and means a satellite there: expected the table removed, or the station as
        orbit.geo and the satellite as orbit.leo; constellation stands beside orbit.leo of kind "station", and means
        a satellite there: expected the table removed, or the station as orbit.geo and the satellite as orbit.leo
        """,
    ),
    "a day of a station above a satellite": (
        lambda: _both_fly(SimpleNamespace(station="geo"), SimpleNamespace(downlink=0, optical=0), SimpleNamespace()),
        """
        constellation stands beside orbit.geo of kind "station", and means a satellite there: expected the table
        removed, or a relay as orbit.geo
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_DAY)
def test_all_that_does_not_fit_in_a_table_of_a_day_is_told_in_full(what):
    problems, words = ALL_OF_A_DAY[what]
    assert told(problems()) == one_line(words)


WHOLE_ORBITS = {
    "circular": {"altitude_m": 5e5, "inclination_rad": 0.0, "phase_rad": 0.0, "gravity": "two-body"},
    "keplerian": {
        "semi_major_axis_m": 7e6, "eccentricity": 0.0, "inclination_rad": 0.0, "argument_of_perigee_rad": 0.0,
        "mean_anomaly_rad": 0.0, "gravity": "j2",
    },
    "elements": {"file": "a.tle"},
    "ephemeris": {"file": "a.oem"},
    "geostationary": {"longitude_rad": 0.0},
    "station": {"latitude_rad": 0.0, "longitude_rad": 0.0, "height_m": 0.0, "mask_rad": 0.0},
}  # fmt: skip


@pytest.mark.parametrize("kind", WHOLE_ORBITS)
def test_an_orbit_has_the_keys_of_its_kind_though_they_be_nought_and_limits_beside_them(kind):
    given = WHOLE_ORBITS[kind]
    planes = [{"node_rad": 0.0}, {"local_time_s": 0.0}] if kind in ("circular", "keplerian") else [{}]
    for more in (*planes, {**planes[0], "limits": SimpleNamespace(attitude="free")}):
        assert told(made(OrbitTable, kind=kind, **given, **more).problems()) == ""
    held = told(made(OrbitTable, kind=kind, **given, **planes[0], limits=SimpleNamespace(attitude="nadir")).problems())
    assert ("limits.attitude" in held) is (kind == "station")
    named = told(made(OrbitTable, kind=kind, **given, **planes[0], object="a").problems())
    assert (named == "") is (kind in ("elements", "ephemeris"))
    for key in given:
        lacking = made(OrbitTable, kind=kind, **{k: v for k, v in given.items() if k != key}, **planes[0])
        assert len(list(lacking.problems())) == 1
    if len(planes) == 2:
        both = told(made(OrbitTable, kind=kind, **given, **planes[0], **planes[1]).problems())
        assert both == "node stands beside local_time: expected one of the two removed"
        following = given | planes[0] | {"inclination_rad": "sun-synchronous"}
        sun = told(made(OrbitTable, kind=kind, **following).problems())
        assert sun.partition(",")[0] == ('gravity is "two-body"' if kind == "circular" else "")


def test_a_station_of_our_own_stands_beside_no_way_from_a_satellite_that_the_mission_has():
    for operations_, constellation, keys in (
        (None, None, []),
        (None, 0, ["constellation"]),
        (SimpleNamespace(downlink=None, optical=None), None, []),
        (SimpleNamespace(downlink=None, optical=0), None, ["operations.optical"]),
        (SimpleNamespace(downlink=0, optical=None), 0, ["operations.downlink", "constellation"]),
    ):
        found = _both_fly(SimpleNamespace(station="leo"), operations_, constellation)
        assert [each.key for each in found] == keys
        assert not list(_both_fly(SimpleNamespace(station=""), operations_, constellation))
        assert not list(_both_fly(None, operations_, constellation))
