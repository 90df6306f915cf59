"""Element sets and ephemeris files: what is read, against outside numbers, and each refusal."""

import csv
import io
import json
import math
import os
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_omm, export_tle
from skyfield.api import EarthSatellite, load
from skyfield.framelib import ICRS_to_J2000, itrs, true_equator_and_equinox_of_date
from skyfield.sgp4lib import TEME

from microrad.orbit.base import OrbitError, States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.files import messages, oem, read_elements, read_oem
from microrad.orbit.files.elements import _EXPECTED, checksum
from microrad.orbit.propagation import mean_elements
from microrad.orbit.propagation.mean_elements import Sgp4Orbit, closest_elements

EPOCH = Epoch("2026-03-20T12:00:00Z")
SCALE = load.timescale(builtin=True)
ONE_MM = 1e-3


def invented(number=90001, inclination_deg=97.4, mean_motion_rev_day=15.2, drag=1e-5, eccentricity=0.001, day=20.5):
    """A satellite that does not exist, at an epoch in March 2026."""
    satellite = Satrec()
    days = (datetime(2026, 3, 1) - datetime(1949, 12, 31)).days + day - 1
    satellite.sgp4init(
        WGS72, "i", number, days, drag, 0.0, 0.0, eccentricity, 1.0, math.radians(inclination_deg), 2.0,
        mean_motion_rev_day * 2 * math.pi / 1440, 3.0,
    )  # fmt: skip
    satellite.classification, satellite.intldesg, satellite.ephtype, satellite.elnum, satellite.revnum = (
        "U", "26001A", 0, 1, 1,
    )  # fmt: skip
    return satellite


LINE_1, LINE_2 = export_tle(invented())
NAMED = f"EXAMPLE 1\n{LINE_1}\n{LINE_2}\n"


def summed(line):
    """The line with the checksum of its characters, by the words of the format: digits, and 1 for a minus."""
    digits = sum(int(c) for c in line[:68] if c.isdigit()) + line[:68].count("-")
    return line[:68] + str(digits % 10)


def edited(line, column, text):
    """The line with `text` from a column counted from 1, and a checksum that fits."""
    return summed(line[: column - 1] + text + line[column - 1 + len(text) :])


def close(found, expected, atol):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=atol)


def write(tmp_path, text, name="a.txt"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def elements(tmp_path, text, name=None):
    return read_elements(write(tmp_path, text), name)


def refused(tmp_path, text, *words, read=read_elements):
    path = write(tmp_path, text)
    with pytest.raises(OrbitError) as caught:
        read(path)
    message = str(caught.value)
    assert str(path) in message
    for word in words:
        assert word in message, message
    return message


# ----------------------------------------------------------------------------------------------------------------- TLE
@pytest.mark.promise("day-8")
def test_tle_with_and_without_a_name(tmp_path):
    (named,) = elements(tmp_path, NAMED)
    assert named.name == "EXAMPLE 1" and named.catalogue_number == "90001"
    assert named.epoch.text == "2026-03-20T12:00:00Z"
    assert named.mean_motion_rad_s == pytest.approx(15.2 * 2 * math.pi / 86400, rel=1e-9)
    assert named.inclination_rad == pytest.approx(math.radians(97.4), abs=1e-7)
    assert named.drag_per_earth_radius == pytest.approx(1e-5, rel=1e-9)
    assert named.place.endswith("line 2")
    (bare,) = elements(tmp_path, f"{LINE_1}\r\n{LINE_2}\r\n")
    assert bare.name == bare.catalogue_number == "90001"
    (zero,) = elements(tmp_path, "\ufeff0 " + NAMED)
    assert zero.name == "EXAMPLE 1"


def test_checksum_counts_digits_and_minuses():
    # Vallado et al. 2006, the first case of SGP4-VER.TLE
    assert checksum("1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753") == 3
    assert checksum("2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667") == 7


def test_epoch_of_the_century_and_to_the_microsecond(tmp_path):
    line_1 = edited(LINE_1, 19, "99366.00000000")
    assert elements(tmp_path, f"{line_1}\n{LINE_2}")[0].epoch.text == "2000-01-01T00:00:00Z"
    line_1 = edited(LINE_1, 19, "57366.00000000")
    refused(tmp_path, f"{line_1}\n{LINE_2}", "day 366.00000000 of 1957")
    # a day is divided by 1440 without a remainder here, and no minute has 60 s
    for fraction, clock in ((".04375000", "01:03:00"), (".00625000", "00:09:00"), (".99375000", "23:51:00")):
        line_1 = edited(LINE_1, 19, f"26001{fraction}")
        assert elements(tmp_path, f"{line_1}\n{LINE_2}")[0].epoch.text == f"2026-01-01T{clock}Z"
    line_1 = edited(LINE_1, 19, "26001.00000001")
    assert elements(tmp_path, f"{line_1}\n{LINE_2}")[0].epoch.text == "2026-01-01T00:00:00.000864Z"


def verification_cases():
    """The cases of AIAA 2006-6753 that the package sgp4 carries: lines, and a table of minutes, km and km/s."""
    text = files("sgp4").joinpath("SGP4-VER.TLE").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    blocks = {}
    for line in files("sgp4").joinpath("tcppver.out").read_text().splitlines():
        words = line.split()
        if line.endswith("xx"):
            rows = blocks.setdefault(words[0], [])
        elif words:
            rows.append([float(word) for word in words[:7]])
    return [
        (one[:69], two[:69], np.array(blocks[one[2:7].lstrip("0")]))
        for one, two in zip(lines[::2], lines[1::2], strict=True)
    ]


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-42")
def test_sgp4_against_the_published_verification(tmp_path):
    """Positions within 1 mm, for all cases that are in orbit, up to 14 days from the epoch."""
    checked, refusals = set(), {}
    for one, two, every in verification_cases():
        table = every[np.abs(every[:, 0]) <= 14 * 1440.0]
        # an old case ends its line early, without a checksum
        lines = [summed(line.ljust(69)) for line in (one, two)]
        try:
            (found,) = elements(tmp_path, "\n".join(lines))
            states = Sgp4Orbit(found, found.epoch).states(60.0 * table[:, 0])
        except OrbitError as error:
            refusals[one[2:7]] = str(error)
            continue
        close(states.position_m, 1000 * table[:, 1:4].T, atol=ONE_MM)
        close(states.velocity_m_s, 1000 * table[:, 4:7].T, atol=1e-5)
        checked.add(one[2:7])
    assert len(checked) == 27
    # four perigees from 82 km down to below the ground, and a mean motion of 1e-5 revolutions a day
    assert set(refusals) == {"16925", "22312", "28872", "33333", "33334"}
    assert sum("the perigee is" in text for text in refusals.values()) == 4 and "mean motion" in refusals["33334"]


@pytest.mark.promise("day-9")
def test_sgp4_against_skyfield_in_teme_and_gcrs(tmp_path):
    (found,) = elements(tmp_path, NAMED)
    orbit = Sgp4Orbit(found, Epoch("2026-03-22T03:04:05.25Z"))
    time_s = np.linspace(0.0, 2 * 86400.0, 97)
    states = orbit.states(time_s)
    peer = EarthSatellite(LINE_1, LINE_2, ts=SCALE)
    start = datetime(2026, 3, 22, 3, 4, 5, 250000, tzinfo=UTC)
    instants = SCALE.from_datetimes([start + timedelta(seconds=float(t)) for t in time_s])
    position_km, velocity_km_s, _ = peer._position_and_velocity_TEME_km(instants)
    close(states.position_m, 1000 * position_km, atol=ONE_MM)
    close(states.velocity_m_s, 1000 * velocity_km_s, atol=1e-6)
    turned = np.einsum("jin,jn->in", TEME.rotation_at(instants), states.position_m)
    close(turned, peer.at(instants).position.m, atol=ONE_MM)


def test_states_in_any_order_and_for_one_time(tmp_path):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    time_s = np.array([5000.0, -300.0, 0.0])
    states = orbit.states(time_s)
    assert isinstance(states, States) and states.position_m.shape == (3, 3)
    for k, t in enumerate(time_s):
        np.testing.assert_array_equal(orbit.states(t).position_m, states.position_m[:, k])
    assert orbit.name == "EXAMPLE 1" and orbit.states(np.empty(0)).position_m.shape == (3, 0)


def test_leap_second_is_an_elapsed_second(tmp_path):
    """From before to after the leap second of 2016-12-31 one second more passes than UTC shows."""
    line_1 = edited(LINE_1, 19, "16366.50000000")
    (found,) = elements(tmp_path, f"{line_1}\n{LINE_2}")
    assert Sgp4Orbit(found, Epoch("2017-01-01T12:00:00Z")).elements_age_s == 86401.0


def test_copies_give_the_same_states(tmp_path):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    again = pickle.loads(pickle.dumps(orbit))
    assert again == orbit
    np.testing.assert_array_equal(again.states(60.0).position_m, orbit.states(60.0).position_m)


def test_import_is_cheap():
    """Neither sgp4, skyfield nor scipy come in before a file needs them."""
    code = "import sys, microrad.orbit; print({'sgp4', 'skyfield', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def catalogue(count=100):
    text = []
    for k in range(count):
        one, two = export_tle(invented(90000 + k, inclination_deg=50 + 0.1 * k, mean_motion_rev_day=15 + 0.005 * k))
        text += [f"EXAMPLE {k}", one, two]
    return "\n".join(text)


def test_a_hundred_satellites(tmp_path):
    found = elements(tmp_path, catalogue())
    assert len(found) == 100 and len({e.name for e in found}) == 100
    for k in (0, 57, 99):
        assert found[k].name == f"EXAMPLE {k}" and found[k].catalogue_number == str(90000 + k)
        assert found[k].inclination_rad == pytest.approx(math.radians(50 + 0.1 * k), abs=1e-6)
    path = tmp_path / "a.txt"
    assert [e.name for e in read_elements(path, "example 7")] == ["EXAMPLE 7"]
    for number in ("90042", "00090042"):
        assert [e.name for e in read_elements(path, number)] == ["EXAMPLE 42"]
    with pytest.raises(OrbitError, match=r"none of its 100 element sets is of 'EXAMPEL 3'.*EXAMPLE 3"):
        read_elements(path, "EXAMPEL 3")


def test_closest_of_several_epochs(tmp_path):
    sets = [export_tle(invented(day=day)) for day in (10.5, 19.0, 30.0)]
    found = elements(tmp_path, "\n".join(line for pair in sets for line in pair))
    assert closest_elements(found, EPOCH).epoch.text == "2026-03-19T00:00:00Z"
    assert closest_elements(found, Epoch("2026-03-26T00:00:00Z")).epoch.text == "2026-03-30T00:00:00Z"
    with pytest.raises(OrbitError, match=r"different satellites, EXAMPLE 0 \(90000\)"):
        closest_elements(elements(tmp_path, catalogue(3)), EPOCH)


WRONG_DIGIT = str((int(LINE_1[68]) + 1) % 10)
TLE_FAULTS = {
    "short line": (f"{LINE_1[:-1]}\n{LINE_2}", "line 1", "69 characters, this one 68"),
    "long line": (f"{LINE_1}\n{LINE_2}7", "line 2", "69 characters, this one 70"),
    "checksum of line 1": (
        f"X\n{LINE_1[:68]}{WRONG_DIGIT}\n{LINE_2}",
        "line 2", f"checksum of line 1 is {WRONG_DIGIT}", f"sum to {LINE_1[68]}",
    ),
    "checksum of line 2": (
        f"{LINE_1}\n{LINE_2[:9]}8{LINE_2[10:]}", "line 2", f"checksum of line 2 is {LINE_2[68]}", "characters sum to"
    ),
    "no line number 1": (f"X\n  {LINE_1[2:]}\n{LINE_2}", "line 2", "line 1 of an element set must stand here"),
    "no line number 2": (f"{LINE_1}\n  {LINE_2[2:]}", "line 2", "begin with '2 '"),
    "line 2 first": (f"{LINE_2}\n{LINE_1}", "line 1", "begin with '1 '"),
    "two names": ("A\nB\nC", "line 2", "line 1 of an element set"),
    "line 2 missing": (f"A\n{LINE_1}\nB\n{LINE_1}\n{LINE_2}", "line 3", "begin with '2 '"),
    "cut off": (LINE_1, "line 1", "line 2 of an element set must follow"),
    "name alone": ("EXAMPLE", "line 1 of an element set must follow"),
    "catalogue numbers": (f"{LINE_1}\n{edited(LINE_2, 3, '90002')}", "90001", "90002"),
    "letters for digits": (f"{edited(LINE_1, 21, 'O79')}\n{LINE_2}", "day of the epoch", "columns 21 to 32", "'O79."),
    "letters in line 2": (f"{LINE_1}\n{edited(LINE_2, 9, ' 9x.')}", "line 2", "inclination", "digits belong there"),
    "a blank in the day": (f"{edited(LINE_1, 21, '0 9')}\n{LINE_2}", "day of the epoch", "columns 21 to 32", "'0 9"),
    "a digit of another script": (f"{edited(LINE_1, 64, chr(0x663))}\n{LINE_2}", "line 1", "digits belong there"),
    "day 367": (f"{edited(LINE_1, 21, '367')}\n{LINE_2}", "day 367.5", "from 1 to 366"),
    "year 1960": (f"{edited(LINE_1, 19, '60')}\n{LINE_2}", "line 1", "1960", "outside"),
    "SGP4-XP": (f"{edited(LINE_1, 63, '4')}\n{LINE_2}", "another theory than SGP4"),
    "inclination 190": (f"{LINE_1}\n{edited(LINE_2, 9, '190.0000')}", "inclination is 190", "0 to 180 deg"),
    "mean motion 0": (f"{LINE_1}\n{edited(LINE_2, 53, ' 0.00000000')}", "mean motion is 0", "revolutions a day"),
    "comments alone": ("# nothing\n", "no element set is in the file"),
    "empty": ("", "the file is empty"),
    "blank": ("\n \n", "blanks and nothing else"),
    "binary": (b"\x1f\x8b\x08\x00\xff", "byte 2", "binary or a compressed file"),
    "nul": (b"EXAMPLE\0", "byte 8", "binary"),
    "ephemeris": ("CCSDS_OEM_VERS = 2.0\n", "CCSDS_OEM_VERS", "ephemeris (OEM) by its own key"),
}  # fmt: skip


@pytest.mark.parametrize("fault", TLE_FAULTS)
def test_malformed_tle(tmp_path, fault):
    text, *words = TLE_FAULTS[fault]
    refused(tmp_path, text, *words)


def test_file_that_cannot_be_read(tmp_path, monkeypatch):
    inside = write(tmp_path, NAMED, "a.tle") / "b.tle"
    for path in (tmp_path / "absent.tle", inside, tmp_path / "nul\0.tle"):
        with pytest.raises(OrbitError) as caught:
            read_elements(path)
        seen = "a name in a mission is seen from the mission file"
        assert str(caught.value) == f"{path}: there is no such file; check the path: {seen}"
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OrbitError) as caught:
        read_elements(Path("absent.tle"))
    assert f"absent.tle: there is no such file ({tmp_path / 'absent.tle'} was tried); check" in str(caught.value)
    refused(tmp_path, NAMED * 300 + "\n" + catalogue(5)[:-1], "line ")
    monkeypatch.setattr(messages, "MOST_BYTES", 100)
    refused(tmp_path, NAMED, "more than the 0 MB that are read", "keep only")


def test_what_is_no_file_of_text_is_refused_with_its_own_reason(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    empty = write(tmp_path, "", "empty.tle")
    reasons = {
        tmp_path: "this is a folder; name the file in it",
        Path("/dev/null"): "this is a device or a pipe; give a file",
        tmp_path / "pipe": "this is a device or a pipe; give a file",
        empty: "the file is empty; download",
        loop: "cannot be read (Too many levels of symbolic links); check the path",
    }
    for path, reason in reasons.items():
        for read in (read_elements, lambda p: read_oem(p, EPOCH)):
            with pytest.raises(OrbitError) as caught:
                read(path)
            assert str(caught.value).startswith(f"{path}: {reason}")

    def locked(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("microrad.orbit.files.messages.read_bytes", locked)  # permissions do not stop every user
    refused(tmp_path, NAMED, "cannot be read (Permission denied); check the permissions of the file and of its folders")


# --------------------------------------------------------------------------------------------------------------- decay
@pytest.mark.promise("day-12")
def test_expired_elements(tmp_path):
    (found,) = elements(tmp_path, NAMED)
    late = Sgp4Orbit(found, Epoch("2026-04-02T12:00:00Z"))
    assert late.elements_age_s == 13 * 86400.0
    late.require(0.0, 86400.0)
    with pytest.raises(OrbitError) as caught:
        late.require(0.0, 3 * 86400.0)
    message = str(caught.value)
    for word in (
        "expired",
        "2026-03-20T12:00:00Z",
        "2026-04-02T12:00:00Z",
        "16.00 days",
        "newer elements",
        "orbit.epoch",
    ):
        assert word in message
    with pytest.raises(OrbitError, match="expired"):
        late.states(np.array([0.0, 86402.0]))
    early = Sgp4Orbit(found, Epoch("2026-03-01T12:00:00Z"))
    with pytest.raises(OrbitError, match=r"not valid yet.*19\.00 days.*older elements"):
        early.require(0.0, 86400.0)
    with pytest.raises(OrbitError, match="not a finite number"):
        late.states(np.array([0.0, np.nan]))


def test_low_perigee_at_the_epoch_and_later(tmp_path):
    one, two = export_tle(invented(mean_motion_rev_day=16.56))
    with pytest.raises(OrbitError, match=r"the perigee is \d+ km high at 2026-03-20T12:00:00.000Z; below 120 km"):
        Sgp4Orbit(elements(tmp_path, f"{one}\n{two}")[0], EPOCH)
    one, two = export_tle(invented(mean_motion_rev_day=16.2, drag=2e-3))
    orbit = Sgp4Orbit(elements(tmp_path, f"{one}\n{two}")[0], EPOCH)
    orbit.require(0.0, 3600.0)
    with pytest.raises(OrbitError, match=r"perigee is|SGP4 stops"):
        orbit.require(0.0, 10 * 86400.0)
    later = Sgp4Orbit(orbit.elements, Epoch("2026-03-30T12:00:00Z"))
    later.require(-10 * 86400.0, -10 * 86400.0 + 3600.0)
    with pytest.raises(OrbitError, match=r"perigee is|SGP4 stops at 2026-03-30"):
        later.require(0.0, 3600.0)


def test_decay_in_sgp4(tmp_path):
    """Catalogue number 28872 of the published verification decays within an hour of its epoch (error 6)."""
    one, two, _ = next(case for case in verification_cases() if case[0][2:7] == "28350")
    (found,) = elements(tmp_path, f"{one}\n{two}")
    orbit = Sgp4Orbit(found, found.epoch)
    with pytest.raises(OrbitError, match=r"SGP4 stops at 2006-.*it has decayed|perigee is"):
        orbit.require(0.0, 13 * 86400.0)


class Stopped:
    """A satellite for which SGP4 reports an error."""

    def __init__(self, code):
        self.code, self.jdsatepoch, self.jdsatepochF = code, 2461120.0, 0.0

    def sgp4_array(self, whole, fraction):
        error = np.zeros(whole.size, dtype=np.uint8)
        error[-1] = self.code
        return error, np.zeros((whole.size, 3)), np.zeros((whole.size, 3))

    def sgp4(self, whole, fraction):
        return self.code, (0.0,) * 3, (0.0,) * 3


class Silent(Stopped):
    """A satellite without a second state, which says nothing of it."""

    def __init__(self):
        super().__init__(0)

    def sgp4_array(self, whole, fraction):
        error, position, velocity = super().sgp4_array(whole, fraction)
        position[-1] = math.nan
        return error, position, velocity


WORDS = {
    1: "mean eccentricity", 2: "mean motion", 3: "perturbed eccentricity", 4: "semi-latus rectum",
    5: "below the Earth's surface", 6: "below the Earth's surface: it has decayed",
}  # fmt: skip


@pytest.mark.parametrize("code", WORDS)
def test_each_error_of_sgp4_in_words(tmp_path, code):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    object.__setattr__(orbit, "_satellite", Stopped(code))
    for call in (lambda: orbit.states(np.array([0.0, 60.0])), lambda: orbit.require(60.0, 60.0)):
        with pytest.raises(OrbitError) as caught:
            call()
        assert WORDS[code] in str(caught.value) and "2026-03-20T12:01:00.000Z" in str(caught.value)
        assert "EXAMPLE 1" in str(caught.value)


def test_elements_for_which_sgp4_gives_no_number_and_no_error(tmp_path):
    """Its deep-space part divides by the sine of the inclination."""
    flat = replace(elements(tmp_path, NAMED)[0], inclination_rad=1e-320, mean_motion_rad_s=1.0027 * 2 * math.pi / 86400)
    with pytest.raises(OrbitError, match="give no number for these elements"):
        Sgp4Orbit(flat, EPOCH)
    orbit = Sgp4Orbit(replace(flat, inclination_rad=0.0), EPOCH)
    object.__setattr__(orbit, "_satellite", Silent())
    with pytest.raises(OrbitError, match=r"2026-03-20T12:01:00\.000Z.*give no number for these elements"):
        orbit.states(np.array([0.0, 60.0]))


# ----------------------------------------------------------------------------------------------------------------- OMM
FIELDS = {key: str(value) for key, value in export_omm(invented(), "EXAMPLE 1").items()}
DEGREE_KEYS = ("INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY")


def kvn(fields, units=False):
    head = "CCSDS_OMM_VERS = 2.0\nCOMMENT invented\nCREATION_DATE = 2026-03-20T00:00:00\nORIGINATOR = TEST\n"
    unit = dict.fromkeys(DEGREE_KEYS, " [deg]") | {"MEAN_MOTION": " [rev/day]"} if units else {}
    return head + "".join(f"{key} = {value}{unit.get(key, '')}\n" for key, value in fields.items())


def xml(fields):
    def part(keys):
        return "".join(f"<{key}>{fields[key]}</{key}>\n" for key in keys if key in fields)

    keys = list(FIELDS)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<ndm><omm id="CCSDS_OMM_VERS" version="2.0">\n<header/>'
        "<body><segment>"
        f"<metadata>{part(keys[:6])}</metadata>\n<data><meanElements>{part(keys[6:13])}</meanElements>\n"
        f"<tleParameters>{part(keys[13:])}</tleParameters></data></segment></body></omm></ndm>"
    )


def comma(fields):
    """As the public catalogues write it, without the metadata."""
    out = io.StringIO()
    kept = {key: value for key, value in fields.items() if key not in _EXPECTED}
    writer = csv.DictWriter(out, kept)
    writer.writeheader()
    writer.writerow(kept)
    return out.getvalue()


def as_json(fields):
    return json.dumps([{k: float(v) if k in (*DEGREE_KEYS, "BSTAR", "MEAN_MOTION") else v for k, v in fields.items()}])


NOTATIONS = {"kvn": kvn, "units": lambda f: kvn(f, units=True), "xml": xml, "json": as_json, "csv": comma}


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-8")
@pytest.mark.parametrize("notation", NOTATIONS)
def test_omm_gives_the_orbit_of_the_tle(tmp_path, notation):
    (found,) = elements(tmp_path, NOTATIONS[notation](FIELDS))
    assert found.name == "EXAMPLE 1" and found.catalogue_number == "90001"
    time_s = np.linspace(-86400.0, 86400.0, 25)
    of_message = Sgp4Orbit(found, EPOCH).states(time_s)
    satellite = invented()
    _, position, velocity = satellite.sgp4_array(
        np.full(25, satellite.jdsatepoch), satellite.jdsatepochF + time_s / 86400
    )
    close(of_message.position_m, 1000 * position.T, atol=ONE_MM)
    close(of_message.velocity_m_s, 1000 * velocity.T, atol=1e-6)
    of_lines = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH).states(time_s)
    # a TLE keeps angles to 1e-4 deg (12 m) and the mean motion to 1e-8 revolutions a day
    assert 0.1 < np.max(np.abs(of_message.position_m - of_lines.position_m)) < 30.0


@pytest.mark.parametrize("notation", ["kvn", "xml", "json", "csv"])
def test_several_omm_in_a_file(tmp_path, notation):
    two = [FIELDS, {**FIELDS, "OBJECT_NAME": "EXAMPLE 2", "NORAD_CAT_ID": "270001234"}]
    text = {
        "kvn": lambda: "".join(map(kvn, two)),
        "xml": lambda: xml(two[0]).replace("</ndm>", "") + xml(two[1]).partition("<ndm>")[2],
        "json": lambda: json.dumps(two),
        "csv": lambda: comma(two[0]) + comma(two[1]).split("\n")[1],
    }[notation]()
    found = elements(tmp_path, text)
    assert [(e.name, e.catalogue_number) for e in found] == [("EXAMPLE 1", "90001"), ("EXAMPLE 2", "270001234")]


@pytest.mark.parametrize("notation", ["kvn", "xml", "json", "csv"])
@pytest.mark.parametrize("key", ["OBJECT_NAME", "EPOCH", "MEAN_MOTION", "RA_OF_ASC_NODE", "BSTAR", "NORAD_CAT_ID"])
def test_omm_with_a_missing_field(tmp_path, notation, key):
    fields = {k: v for k, v in FIELDS.items() if k != key}
    refused(tmp_path, NOTATIONS[notation](fields), f"{key} is missing")


@pytest.mark.parametrize("key", ["CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "MEAN_ELEMENT_THEORY"])
def test_omm_in_another_convention(tmp_path, key):
    for notation in ("kvn", "xml", "json"):
        refused(tmp_path, NOTATIONS[notation]({**FIELDS, key: "OTHER"}), f"{key} is 'OTHER'", "SGP4 takes")
    for notation in ("kvn", "xml"):
        refused(tmp_path, NOTATIONS[notation]({k: v for k, v in FIELDS.items() if k != key}), f"{key} is missing")
    assert elements(tmp_path, kvn({**FIELDS, "MEAN_ELEMENT_THEORY": "SGP/SGP4"}))


BOMB = (
    '<?xml version="1.0"?>\n<!DOCTYPE omm [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY a{k} "{(f"&a{k - 1};" if k else "&a;") * 10}">' for k in range(12))
    + "]>\n<omm>&a11;</omm>"
)
OMM_FAULTS = {
    "not a number": (kvn({**FIELDS, "ECCENTRICITY": "1,5"}), "ECCENTRICITY is '1,5'", "line 13"),
    "nan": (as_json({**FIELDS, "MEAN_ANOMALY": "nan"}), "entry 1", "MEAN_ANOMALY is 'nan'"),
    "underscore": (comma({**FIELDS, "BSTAR": "1_0"}), "line 2", "BSTAR is '1_0'"),
    "eccentricity": (xml({**FIELDS, "ECCENTRICITY": "1.2"}), "eccentricity is 1.2"),
    "unit": (kvn({**FIELDS, "INCLINATION": "1 [rad]"}), "INCLINATION is in 'rad'", "'deg'"),
    "twice": (kvn(FIELDS) + "BSTAR = 3\n", "BSTAR is '3', but line"),
    "epoch": (kvn({**FIELDS, "EPOCH": "20 March 2026"}), "'20 March 2026', not a date and time"),
    "minute": (kvn({**FIELDS, "EPOCH": "2026-03-20T12:60:00"}), "not a date and time"),
    "second": (kvn({**FIELDS, "EPOCH": "2026-03-20T12:00:61"}), "not a date and time"),
    "day 0 of the year": (kvn({**FIELDS, "EPOCH": "2025-000T12:00:00"}), "not a date and time"),
    "a key without a value": (as_json({**FIELDS, "EPOCH": ""}), "EPOCH is missing in this mean-elements message"),
    "epoch not in the calendar": (kvn({**FIELDS, "EPOCH": "2026-02-30T00:00:00"}), "not a date and time"),
    "leap second": (kvn({**FIELDS, "EPOCH": "2026-03-20T23:59:60"}), "a second that does not exist"),
    "line": (kvn(FIELDS) + "what is this\n", "'what is this' is neither"),
    "endless line": (kvn(FIELDS) + "A = " + " " * 1_000_000 + "[", "is neither 'KEY = value'"),
    "long value": (as_json({**FIELDS, "EPOCH": "9" * 1000}), f"'{'9' * 57}...'"),
    "no version": ("CREATION_DATE = 2026-03-20T00:00:00\n", "not with CCSDS_OMM_VERS"),
    "bomb": (BOMB, "line 2", "DOCTYPE"),
    "cut XML": (xml(FIELDS)[:-30], "not well-formed XML", "cut off"),
    "XML of another kind": ("<html><p>moved</p></html>", "no element set"),
    "cut JSON": (as_json(FIELDS)[:-3], "not JSON", "line 1"),
    "deep JSON": ("[" * 200_000, "nested too deeply"),
    "JSON list": ("[1, 2]", "entry 1", "'1' is not an object"),
    "JSON empty": ("[]", "no element set"),
    "CSV": (comma(FIELDS) + "a,b\n", "line 3", "2 values"),
    "drag": (kvn({**FIELDS, "BSTAR": "1e308"}), "B* is 1e+308", "less than 1 per radius of the Earth"),
    "version": (kvn(FIELDS).replace("VERS = 2.0", "VERS = 9.0"), "line 1", "CCSDS_OMM_VERS is '9.0'; read are"),
    "XML version": (xml(FIELDS).replace('version="2.0"', 'version="4.0"'), "CCSDS_OMM_VERS is '4.0'; read are"),
    "CSV columns": (comma({**FIELDS, "bstar": "7"}), "line 2", "BSTAR is '7', but line 2 has"),
    "JSON keys": (as_json({**FIELDS, "bstar": "7"}), "entry 1", "BSTAR is '7', but entry 1 has"),
    "blanks before CSV": ("  \n" + comma(FIELDS) + "a,b\n", "line 4", "2 values"),
    "SGP4-XP": (as_json({**FIELDS, "EPHEMERIS_TYPE": "4"}), "another theory than SGP4"),
}  # fmt: skip


@pytest.mark.parametrize("fault", OMM_FAULTS)
def test_malformed_omm(tmp_path, fault):
    text, *words = OMM_FAULTS[fault]
    refused(tmp_path, text, *words)


# ----------------------------------------------------------------------------------------------------------------- OEM
RATE_RAD_S, RADIUS_M = 1.1e-3, 6.9e6


def truth(time_s, rate_rad_s=RATE_RAD_S, radius_m=RADIUS_M):
    """An ellipse about the Earth's centre (a force that grows with distance), smooth and known exactly."""
    c, s = np.cos(rate_rad_s * time_s), np.sin(rate_rad_s * time_s)
    axes = radius_m * np.array([[1.0, 0.0], [0.0, 0.6], [0.0, 0.81]])
    return States(axes @ np.array([c, s]), rate_rad_s * axes @ np.array([-s, c]))


def stamp(time_s, start=datetime(2026, 3, 20, 12)):
    return (start + timedelta(seconds=float(time_s))).isoformat(timespec="microseconds")


def rows(time_s, states=None, extra="", start=datetime(2026, 3, 20, 12)):
    position, velocity = states or truth(time_s)
    return "".join(
        f"{stamp(t, start)} {' '.join(f'{x:.9f}' for x in (*p / 1000, *v / 1000))}{extra}\n"
        for t, p, v in zip(time_s, position.T, velocity.T, strict=True)
    )


def metadata(time_s, start=datetime(2026, 3, 20, 12), **changes):
    given = {
        "OBJECT_NAME": "EXAMPLE 1", "OBJECT_ID": "2026-001A", "CENTER_NAME": "EARTH", "REF_FRAME": "TEME",
        "TIME_SYSTEM": "UTC", "START_TIME": stamp(time_s[0], start), "STOP_TIME": stamp(time_s[-1], start),
    } | changes  # fmt: skip
    return {key: value for key, value in given.items() if value is not None}


def segment(time_s, states=None, extra="", start=datetime(2026, 3, 20, 12), **changes):
    meta = "".join(f"{key} = {value}\n" for key, value in metadata(time_s, start, **changes).items())
    return f"META_START\n{meta}META_STOP\nCOMMENT data\n" + rows(time_s, states, extra, start)


HEAD = "CCSDS_OEM_VERS = 2.0\nCOMMENT invented\nCREATION_DATE = 2026-03-20T00:00:00\nORIGINATOR = TEST\n\n"
GRID = np.arange(0.0, 6001.0, 60.0)


def ephemeris(tmp_path, text, epoch=EPOCH, name=None):
    return read_oem(write(tmp_path, text), epoch, name)


def no_ephemeris(tmp_path, text, *words):
    return refused(tmp_path, text, *words, read=lambda path: read_oem(path, EPOCH))


def oem_xml(time_s, version="3.0", **changes):
    position, velocity = truth(time_s)
    keys = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
    units = ("km",) * 3 + ("km/s",) * 3
    vectors = "".join(
        f"<stateVector><EPOCH>{stamp(t)}</EPOCH>"
        + "".join(
            f'<{k} units="{u}">{x:.9f}</{k}>' for k, u, x in zip(keys, units, (*p / 1000, *v / 1000), strict=True)
        )
        + "</stateVector>\n"
        for t, p, v in zip(time_s, position.T, velocity.T, strict=True)
    )
    meta = "".join(f"<{k}>{v}</{k}>" for k, v in metadata(time_s, **changes).items())
    covariance = f"<covarianceMatrix><EPOCH>{stamp(0)}</EPOCH><CX_X units='km**2'>1</CX_X></covarianceMatrix>"
    return (
        f'<?xml version="1.0"?>\n<oem id="CCSDS_OEM_VERS" version="{version}"><header/><body>\n<segment>'
        f"<metadata>{meta}</metadata>\n<data>{vectors}{covariance}</data></segment></body></oem>"
    )


@pytest.mark.promise("readme-8")
@pytest.mark.parametrize(
    ("method", "position_m", "velocity_m_s"),
    [
        ({}, 1e-4, 1e-6),
        ({"INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": "7"}, 1e-4, 1e-6),
        ({"INTERPOLATION": "hermite", "INTERPOLATION_DEGREE": "3"}, 0.5, 0.05),
        ({"INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": "4"}, 2e-3, 2e-4),  # three points, as of degree 5
        ({"INTERPOLATION": "Lagrange", "INTERPOLATION_DEGREE": "7"}, 1e-3, 1e-5),
        ({"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "8"}, 1e-4, 1e-5),
        ({"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "12"}, 1e-4, 1e-4),
    ],
)
def test_interpolation_against_a_known_orbit(tmp_path, method, position_m, velocity_m_s):
    """State vectors each 60 s, written to 1 um; inside, at the nodes and in the windows at both ends."""
    orbit = ephemeris(tmp_path, HEAD + segment(GRID, **method))
    assert orbit.name == "EXAMPLE 1" and orbit.span_s == (0.0, 6000.0)
    time_s = np.random.Generator(np.random.Philox(5)).permutation(np.linspace(0.0, 6000.0, 4801))
    states, known = orbit.states(time_s), truth(time_s)
    worst = np.max(np.abs(states.position_m - known.position_m))
    assert worst < position_m
    assert np.max(np.abs(states.velocity_m_s - known.velocity_m_s)) < velocity_m_s
    if method.get("INTERPOLATION_DEGREE") == "3":  # n^4 r h^4 / 384 of the cubic polynomial
        assert worst == pytest.approx(RATE_RAD_S**4 * RADIUS_M * 60**4 / 384, rel=0.05)
    nodes = orbit.states(GRID)
    close(nodes.position_m, truth(GRID).position_m, atol=2e-6)
    np.testing.assert_array_equal(orbit.states(90.0).position_m, orbit.states(np.array([90.0])).position_m[:, 0])


@pytest.mark.parametrize("method", ["HERMITE", "LAGRANGE"])
def test_velocity_is_the_rate_of_position(tmp_path, method):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID, INTERPOLATION=method, INTERPOLATION_DEGREE="9"))
    time_s, step = np.linspace(10.0, 5990.0, 997), 0.5
    slope = (orbit.states(time_s + step).position_m - orbit.states(time_s - step).position_m) / (2 * step)
    close(orbit.states(time_s).velocity_m_s, slope, atol=2e-3)


def test_hermite_is_the_polynomial_through_its_points(tmp_path):
    """Against Newton's divided differences on doubled nodes, in the window of four points about the time.

    Steps of ten minutes, so that another window gives another value.
    """
    grid = np.arange(0.0, 9001.0, 600.0)
    orbit = ephemeris(tmp_path, HEAD + segment(grid))
    known = orbit.segments[0]
    for t in (1.0, 1300.0, 4790.0, 8999.0):
        first = int(np.clip(t // 600 - 1, 0, grid.size - 4))
        node = np.repeat(grid[first : first + 4], 2)
        table = np.repeat(known.position_m[0, first : first + 4], 2)
        slopes = np.repeat(known.velocity_m_s[0, first : first + 4], 2)
        top = [table[0]]
        for order in range(1, 8):
            gap = node[order:] - node[:-order]
            table = np.where(gap == 0, slopes[: gap.size], np.diff(table) / np.where(gap == 0, 1.0, gap))
            top.append(table[0])
        value = sum(c * np.prod(t - node[:k]) for k, c in enumerate(top))
        assert orbit.states(t).position_m[0] == pytest.approx(value, abs=1e-6)


@pytest.mark.promise("day-8")
def test_xml_equals_kvn(tmp_path):
    time_s = np.linspace(0.0, 6000.0, 61)
    of_kvn = ephemeris(tmp_path, HEAD + segment(GRID)).states(time_s)
    for version in ("1.0", "2.0", "3.0"):
        of_xml = ephemeris(tmp_path, oem_xml(GRID, version)).states(time_s)
        np.testing.assert_array_equal(of_xml.position_m, of_kvn.position_m)
        np.testing.assert_array_equal(of_xml.velocity_m_s, of_kvn.velocity_m_s)


def test_versions_covariance_and_acceleration(tmp_path):
    covariance = "COVARIANCE_START\nEPOCH = 2026-03-20T12:00:00\n1.0\n0.1 1.0\nCOVARIANCE_STOP\n"
    plain = ephemeris(tmp_path, HEAD + segment(GRID)).states(GRID)
    for version in ("1.0", "2.0", "3.0"):
        head = HEAD.replace("2.0", version, 1)
        full = ephemeris(tmp_path, head + segment(GRID, extra=" 0.1 0.2 0.3") + covariance).states(GRID)
        np.testing.assert_array_equal(full.position_m, plain.position_m)


@pytest.mark.parametrize(
    ("system", "ahead_s"), [("UTC", 0.0), ("TAI", 37.0), ("TT", 69.184), ("TDT", 69.184), ("GPS", 18.0)]
)
def test_time_systems(tmp_path, system, ahead_s):
    """In 2026 TAI - UTC is 37 s, TT - TAI 32.184 s and TAI - GPS 19 s (IERS Bulletin C; IS-GPS-200)."""
    start = datetime(2026, 3, 20, 12) + timedelta(seconds=ahead_s)
    orbit = ephemeris(tmp_path, HEAD + segment(GRID, start=start, TIME_SYSTEM=system))
    assert orbit.span_s == pytest.approx((0.0, 6000.0), abs=1e-9)
    close(orbit.states(90.0).position_m, truth(np.array([90.0])).position_m[:, 0], atol=1e-4)


def test_utc_over_a_leap_second(tmp_path):
    """2016-12-31 has 86401 s; stamps are of UTC, by day of the year and with second 60."""
    stamps = [
        "2016-366T23:59:58",
        "2016-12-31T23:59:59Z",
        "2016-12-31T23:59:60",
        "2017-01-01T00:00:00",
        "2017-001T00:00:01",
    ]
    states = truth(np.arange(5.0))
    body = rows(np.arange(5.0), states).split("\n")
    text = HEAD + segment(np.arange(5.0), states, START_TIME=stamps[0], STOP_TIME=stamps[-1])
    for line, given in zip(body, stamps, strict=False):
        text = text.replace(line.split()[0] + " ", given + " ")
    orbit = ephemeris(tmp_path, text, Epoch("2016-12-31T23:59:58Z"))
    np.testing.assert_array_equal(orbit.segments[0].time_s, np.arange(5.0))
    no_ephemeris(tmp_path, text.replace("2016", "2026").replace("366T", "365T"), "23:59:60", "does not exist")


ROTATIONS = {
    "EME2000": lambda t: ICRS_to_J2000[:, :, np.newaxis] + np.zeros(t.shape),
    "J2000": lambda t: ICRS_to_J2000[:, :, np.newaxis] + np.zeros(t.shape),
    "GCRF": lambda t: np.eye(3)[:, :, np.newaxis] + np.zeros(t.shape),
    "ICRF": lambda t: np.eye(3)[:, :, np.newaxis] + np.zeros(t.shape),
    "TOD": true_equator_and_equinox_of_date.rotation_at,
    "ITRF2014": itrs.rotation_at,
    "ITRF-97": itrs.rotation_at,
}


def in_teme(frame, time_s):
    """Positions of `truth`, taken as coordinates in the frame, rotated to TEME by skyfield."""
    start = datetime(2026, 3, 20, 12, tzinfo=UTC)
    instants = SCALE.from_datetimes([start + timedelta(seconds=float(t)) for t in time_s])
    turn = np.einsum("ijn,kjn->ikn", TEME.rotation_at(instants), ROTATIONS[frame](instants))
    return np.einsum("ijn,jn->in", turn, truth(time_s).position_m)


@pytest.mark.promise("day-9")
@pytest.mark.parametrize("frame", ROTATIONS)
def test_frames_against_skyfield(tmp_path, frame):
    """Positions at and between the nodes; velocities by differences, so that the frame's own motion is in them."""
    orbit = ephemeris(tmp_path, HEAD + segment(GRID, REF_FRAME=frame))
    time_s = np.linspace(30.0, 5970.0, 199)
    position = in_teme(frame, time_s)
    # in the frame that turns with the Earth the windows at both ends err by 0.2 mm
    close(orbit.states(time_s).position_m, position, 1e-3 if frame.startswith("ITRF") else 1e-4)
    step = 0.05
    slope = (in_teme(frame, time_s + step) - in_teme(frame, time_s - step)) / (2 * step)
    close(orbit.states(time_s).velocity_m_s, slope, 1e-4 if frame.startswith("ITRF") else 2e-5)
    assert np.max(np.abs(position - truth(time_s).position_m)) > 100.0


def test_rotations_between_hours(tmp_path):
    """The splines between matrices against the matrix itself, over days, in metres at the geostationary radius."""
    time_s = np.linspace(0.0, 5 * 86400.0, 333)
    days = 2451545.0 + 36525.0 * EPOCH.terrestrial_centuries(time_s)
    for frame in ("GCRF", "EME2000", "TOD"):
        fitted, rate = oem._rotations(frame, EPOCH, time_s)
        exact = oem._matrices(frame, SCALE.tt_jd(days))
        assert 4.2e7 * np.max(np.abs(fitted - exact)) < ONE_MM
        assert np.max(np.abs(rate)) < 2e-11


# ----------------------------------------------------------------------------------------------------- spans, segments
@pytest.mark.promise("day-12")
def test_span_by_usable_times(tmp_path):
    text = HEAD + segment(GRID, USEABLE_START_TIME=stamp(600), USEABLE_STOP_TIME=stamp(3000))
    orbit = ephemeris(tmp_path, text)
    assert orbit.span_s == (600.0, 3000.0)
    orbit.require(600.0, 3000.0)
    for start, end in ((599.0, 700.0), (2900.0, 3001.0)):
        with pytest.raises(OrbitError) as caught:
            orbit.require(start, end)
        message = str(caught.value)
        assert "2026-03-20T12:10:00.000Z to 2026-03-20T12:50:00.000Z" in message
        assert EPOCH.utc(start) in message and EPOCH.utc(end) in message
    with pytest.raises(OrbitError, match="not a finite number"):
        orbit.require(700.0, math.nan)
    for outside in (599.0, 3001.0, math.nan):
        with pytest.raises(OrbitError):
            orbit.states(np.array([700.0, outside]))


def test_span_never_reaches_past_the_state_vectors(tmp_path):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID, START_TIME=stamp(-500), STOP_TIME=stamp(9000)))
    assert orbit.span_s == (0.0, 6000.0)
    with pytest.raises(OrbitError, match="nothing is extrapolated"):
        orbit.states(np.array([6000.1]))


def test_two_segments_that_meet(tmp_path):
    """A manoeuvre at 3000 s: before it one orbit, from it on another, each from its own state vectors."""
    before, after = GRID[GRID <= 3300], GRID[GRID >= 2700]
    other = truth(after, 1.05e-3)
    text = HEAD + segment(before, USEABLE_STOP_TIME=stamp(3000)) + segment(after, other, USEABLE_START_TIME=stamp(3000))
    orbit = ephemeris(tmp_path, text)
    orbit.require(0.0, 6000.0)
    for t, known in ((2999.9, truth(np.array([2999.9]))), (3000.0, truth(np.array([3000.0]), 1.05e-3))):
        close(orbit.states(t).position_m, known.position_m[:, 0], atol=1e-3)


def test_gap_between_segments(tmp_path):
    text = HEAD + segment(GRID[GRID <= 2400]) + segment(GRID[GRID >= 3600])
    orbit = ephemeris(tmp_path, text)
    assert orbit.span_s == (0.0, 6000.0)
    orbit.require(0.0, 2400.0)
    orbit.require(3600.0, 6000.0)
    orbit.require(0.0, 2400.0 + 5e-7)  # as far as states are given
    orbit.states(2400.0 + 5e-7)
    for start, end in ((0.0, 6000.0), (2000.0, 2500.0), (2500.0, 3000.0), (3500.0, 4000.0)):
        with pytest.raises(OrbitError, match=r"12:40:00\.000Z, 2026-03-20T13:00:00\.000Z to"):
            orbit.require(start, end)
    with pytest.raises(OrbitError, match=r"the mission needs 2026-03-20T12:50:00\.000Z"):
        orbit.states(np.array([100.0, 3000.0]))


def holed(first_s, last_s, grid=GRID):
    """The grid without what lies between two times."""
    return grid[(grid <= first_s) | (grid >= last_s)]


@pytest.mark.parametrize("text", [lambda t: HEAD + segment(t), oem_xml], ids=["kvn", "xml"])
def test_a_hole_within_a_segment_is_refused(tmp_path, text):
    """An hour that is missing would move what is interpolated by kilometres."""
    path = write(tmp_path, text(holed(1200, 4800)))
    with pytest.raises(OrbitError) as caught:
        read_oem(path, EPOCH)
    at = [n for n, line in enumerate(path.read_text().split("\n"), 1) if stamp(1200) in line or stamp(4800) in line]
    assert str(caught.value).startswith(
        f"{path}, line {at[1]}: no state vector between {stamp(1200)} (line {at[0]}) and {stamp(4800)}, 3600 s apart, "
        "where the usual step of the segment is 60 s;"
    )
    assert "split the segment into two there, or take a file without the hole" in str(caught.value)


def test_a_hole_is_more_than_ten_usual_steps(tmp_path):
    orbit = ephemeris(tmp_path, HEAD + segment(holed(1200, 1800)))
    close(orbit.states(1500.0).position_m, truth(np.array([1500.0])).position_m[:, 0], atol=0.1)
    no_ephemeris(tmp_path, HEAD + segment(holed(1200, 1860)), "660 s apart")


def test_a_hole_outside_the_usable_times_does_no_harm(tmp_path):
    for first, last in ((1800, 3600), (0, 600)):
        usable = {"USEABLE_START_TIME": stamp(first), "USEABLE_STOP_TIME": stamp(last)}
        times = holed(3600, 5400, holed(600, 1800))
        orbit = ephemeris(tmp_path, HEAD + segment(times, **usable))
        close(orbit.states(first + 270.0).position_m, truth(np.array([first + 270.0])).position_m[:, 0], atol=1e-3)
        for key, by in (("USEABLE_START_TIME", first - 1), ("USEABLE_STOP_TIME", last + 1)):
            if by >= 0:
                no_ephemeris(tmp_path, HEAD + segment(times, **usable | {key: stamp(by)}), "no state vector between")


def test_names_with_brackets(tmp_path):
    assert ephemeris(tmp_path, HEAD + segment(GRID, OBJECT_NAME="EXAMPLE [B]")).name == "EXAMPLE [B]"
    assert elements(tmp_path, kvn({**FIELDS, "OBJECT_NAME": "EXAMPLE [B]"}))[0].name == "EXAMPLE [B]"


def test_objects_of_a_file(tmp_path):
    text = HEAD + segment(GRID) + segment(GRID, OBJECT_NAME="EXAMPLE 2", OBJECT_ID="2026-001B")
    assert ephemeris(tmp_path, text, name="example 2").name == "EXAMPLE 2"
    assert ephemeris(tmp_path, text, name="2026-001A").name == "EXAMPLE 1"
    no_ephemeris(tmp_path, text, "EXAMPLE 1 (2026-001A), EXAMPLE 2 (2026-001B)", "name one of them")
    with pytest.raises(OrbitError, match="'EXAMPLE 3' names 0 of them"):
        ephemeris(tmp_path, text, name="EXAMPLE 3")
    several = [segment(GRID, OBJECT_NAME=f"N {k}") for k in range(9)]
    no_ephemeris(tmp_path, HEAD + "".join(several[:8]), "N 7 (2026-001A), and no object is named")
    no_ephemeris(tmp_path, HEAD + "".join(several), "N 7 (2026-001A) and others, and no object is named")


# ------------------------------------------------------------------------------------------------------- malformed OEM
def with_row(index, change):
    lines = segment(GRID).split("\n")
    at = lines.index("COMMENT data") + 1 + index
    lines[at] = change(lines[at])
    return HEAD + "\n".join(lines)


def with_word(index, column, word):
    def change(line):
        words = line.split()
        words[column] = word
        return " ".join(words)

    return with_row(index, change)


def moving(factor, method=(), grid=GRID):
    """An ephemeris whose velocities are so many times those of its positions."""
    position_m, velocity_m_s = truth(grid)
    return HEAD + segment(grid, States(position_m, factor * velocity_m_s), **dict(method))


LAGRANGE = (("INTERPOLATION", "LAGRANGE"), ("INTERPOLATION_DEGREE", "7"))


@pytest.mark.parametrize("step_s", [1.0, 60.0, 600.0, 1100.0])
@pytest.mark.parametrize("method", [(), LAGRANGE], ids=["hermite", "lagrange"])
@pytest.mark.parametrize("factor", [1000.0, 1e-3, 0.01, -1.0, 0.0, 1e290])
def test_velocities_that_are_not_those_of_the_positions(tmp_path, factor, method, step_s):
    """In m/s, with a turned sign, too small or none; they were believed, with contacts and Doppler from them."""
    grid = np.arange(0.0, 15 * step_s, step_s)
    message = no_ephemeris(tmp_path, moving(factor, method, grid), "are not those at which the positions are passed")
    assert f"from {stamp(0)} to {stamp(step_s)}" in message
    ephemeris(tmp_path, moving(1.0, method, grid))


@pytest.mark.parametrize("frame", ["ITRF2014", "GCRF"])
def test_velocities_of_another_frame(tmp_path, frame):
    """A geostationary satellite stands still in ITRF: the Earth's rotation belongs to velocities of GCRF alone."""
    turn = 7.292115e-5
    for rate in (0.0, turn):
        angle = (0.0 if frame.startswith("ITRF") else turn) * GRID
        still = States(
            4.2164e7 * np.array([np.cos(angle), np.sin(angle), 0 * angle]),
            4.2164e7 * rate * np.array([-np.sin(angle), np.cos(angle), 0 * angle]),
        )
        text = HEAD + segment(GRID, still, REF_FRAME=frame)
        if (rate > 0.0) == (frame == "GCRF"):
            ephemeris(tmp_path, text)
        else:
            no_ephemeris(tmp_path, text, "are not those at which the positions are passed")


@pytest.mark.parametrize("centre", ["EARTH", "Earth", "earth"])
def test_the_centre_may_be_written_in_capitals_or_not(tmp_path, centre):
    assert ephemeris(tmp_path, HEAD + segment(GRID, CENTER_NAME=centre)).span_s == (0.0, GRID[-1])


def test_a_frame_that_does_not_turn_may_have_an_epoch(tmp_path):
    ephemeris(tmp_path, HEAD + segment(GRID, REF_FRAME="EME2000", REF_FRAME_EPOCH=stamp(0)))


def test_positions_that_no_satellite_passes(tmp_path):
    position_m, _ = truth(GRID)
    there = position_m.copy()
    there[:, 7:] *= -1.0
    mean = np.gradient(there, GRID, axis=1)
    no_ephemeris(
        tmp_path, HEAD + segment(GRID, States(there, mean)), "positions are passed at 230", "at most 10.7", "line 23"
    )


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.5, 0.73])
@pytest.mark.parametrize("steps", [20, 60, 600])
def test_velocities_of_an_orbit_pass_at_any_usual_step(tmp_path, eccentricity, steps):
    """Of Kepler's ellipse with its perigee at 6.7e6 m, in 20 steps a turn and more."""
    semi_major_m = 6.7e6 / (1.0 - eccentricity)
    rate = math.sqrt(3.986004418e14 / semi_major_m**3)
    time_s = np.linspace(0.0, 2 * math.pi / rate, steps + 1)
    anomaly = rate * time_s
    for _ in range(60):
        anomaly = anomaly - (anomaly - eccentricity * np.sin(anomaly) - rate * time_s) / (
            1 - eccentricity * np.cos(anomaly)
        )
    c, s = np.cos(anomaly), np.sin(anomaly)
    minor = math.sqrt(1 - eccentricity**2)
    turning = rate / (1 - eccentricity * c)
    states = States(
        semi_major_m * np.array([c - eccentricity, minor * s, 0 * c]),
        semi_major_m * turning * np.array([-s, minor * c, 0 * c]),
    )
    ephemeris(tmp_path, HEAD + segment(time_s, states))


SHORT = GRID[:3]
OEM_FAULTS = {
    **{f"no {key}": (HEAD + segment(GRID, **{key: None}), f"{key} is missing", "line 6") for key in oem._REQUIRED},
    **{f"XML no {key}": (oem_xml(GRID, **{key: None}), f"{key} is missing", "line 3") for key in oem._REQUIRED},
    "centre": (HEAD + segment(GRID, CENTER_NAME="MARS"), "CENTER_NAME is 'MARS'", "EARTH"),
    "frame": (HEAD + segment(GRID, REF_FRAME="MOD"), "line 10", "REF_FRAME is 'MOD'", "EME2000"),
    "frame held still": (HEAD + segment(GRID, REF_FRAME_EPOCH=stamp(0)), "REF_FRAME_EPOCH", "frame of date"),
    "frame of the true equator held still": (
        HEAD + segment(GRID, REF_FRAME="TOD", REF_FRAME_EPOCH=stamp(0)), "REF_FRAME_EPOCH holds TOD still"
    ),
    "time system": (HEAD + segment(GRID, TIME_SYSTEM="TDB"), "TIME_SYSTEM is 'TDB'", "UTC, TAI, TT, GPS"),
    "Z in TAI": (HEAD + segment(GRID, TIME_SYSTEM="TAI", START_TIME=stamp(0) + "Z"), "ends in Z", "TAI"),
    "leap second of TAI": (HEAD + segment(GRID, TIME_SYSTEM="TAI", STOP_TIME="2016-12-31T23:59:60"), "no leap seconds"),
    "unsorted": (with_word(5, 0, stamp(60)), "does not come after", stamp(240), "line 20"),
    "twice": (with_word(5, 0, stamp(240)), "does not come after"),
    "nan": (with_word(4, 2, "nan"), "line 20", "holds nan, inf or a number beyond 1e+300"),
    "inf": (with_word(4, 6, "inf"), "line 20", "holds nan, inf or a number beyond 1e+300"),
    "no number in m/s": (with_word(4, 6, "1e308"), "line 20", "holds nan, inf or a number beyond 1e+300"),
    "distance beyond all": (with_word(4, 2, "1e299"), "line 20", "where no satellite of the Earth is"),
    "word": (with_word(4, 1, "abc"), "line 20", "X is 'abc'"),
    "underscore": (with_word(4, 1, "6_900.0"), "line 20", "X is '6_900.0'"),
    "XML version": (oem_xml(GRID, "4.0"), "line 2", "CCSDS_OEM_VERS is '4.0'; read are 1, 2 and 3"),
    "stop beyond the tables": (HEAD + segment(GRID, STOP_TIME="2055-01-01T00:00:00"), "line 13", "outside"),
    "time": (with_word(4, 0, "20/03/2026"), "line 20", "'20/03/2026', not a date and time"),
    "hour": (with_word(4, 0, "2026-03-20T25:00:00"), "not a date and time"),
    "day of the year": (with_word(4, 0, "2026-366T12:00:00"), "not a date and time"),
    "columns": (with_row(4, lambda line: line + " 1"), "line 20", "8 columns"),
    "metres": (with_row(0, lambda line: f"{line.split()[0]} 6900000 0 0 0 7500 0"), "6.9e+06 km", "are in km"),
    "inside the Earth": (with_word(0, 1, "690.0"), "690 km"),
    "too few": (HEAD + segment(SHORT), "3 state vectors", "takes 4"),
    "too few for Lagrange": (
        HEAD + segment(GRID[:8], INTERPOLATION="LAGRANGE", INTERPOLATION_DEGREE="8"), "8 state", "degree 8", "takes 9"
    ),
    "none": (HEAD + segment(GRID).partition("COMMENT data")[0], "0 state vectors"),
    "linear": (HEAD + segment(GRID, INTERPOLATION="LINEAR", INTERPOLATION_DEGREE="1"), "'LINEAR'", "HERMITE or"),
    "degree 1": (HEAD + segment(GRID, INTERPOLATION="LAGRANGE", INTERPOLATION_DEGREE="1"), "from 3 to 25"),
    "degree 7.5": (HEAD + segment(GRID, INTERPOLATION="LAGRANGE", INTERPOLATION_DEGREE="7.5"), "whole number"),
    "no degree": (HEAD + segment(GRID, INTERPOLATION="LAGRANGE"), "without INTERPOLATION_DEGREE"),
    "usable times": (
        HEAD + segment(GRID, USEABLE_START_TIME=stamp(7000), USEABLE_STOP_TIME=stamp(8000)), "nothing in common"
    ),
    "year": (HEAD + segment(GRID, start=datetime(1960, 1, 1)), "1960", "outside"),
    "overlap": (HEAD + segment(GRID[:60]) + segment(GRID[40:]), "stated twice", "USEABLE_START_TIME"),
    "version": (HEAD.replace("2.0", "4.0", 1) + segment(GRID), "line 1", "CCSDS_OEM_VERS = '4.0'"),
    "element set": (kvn(FIELDS), "CCSDS_OMM_VERS = '2.0'", "Orbit Ephemeris Message"),
    "two lines": (NAMED, "line 1", "'EXAMPLE 1' is neither"),
    "no segment": (HEAD, "no segment of an ephemeris"),
    "cut in the metadata": ((HEAD + segment(GRID)).partition('STOP_TIME')[0], "ends before META_STOP", "cut off"),
    "cut in the covariance": (HEAD + segment(GRID) + "COVARIANCE_START\n", "ends before COVARIANCE_STOP"),
    "order": (HEAD + "META_STOP\n", "META_STOP has no place here"),
    "metadata": (HEAD + "META_START\nhello\n", "line 7", "'hello' is neither"),
    "empty": ("", "the file is empty"),
    "binary": (b"\x89HDF\r\n", "binary"),
    "bomb": (BOMB, "DOCTYPE"),
    "cut XML": (oem_xml(GRID)[:3000], "not well-formed XML"),
    "XML of another kind": (xml(FIELDS), "no segment"),
    "XML unit": (oem_xml(GRID).replace('"km"', '"m"', 1), "X is in 'm'", "'km'"),
    "XML missing": (oem_xml(GRID).replace("Y_DOT", "Y_DAT"), "Y_DOT is missing in this stateVector"),
    "XML number": (oem_xml(GRID).replace('<Z units="km">0.', '<Z units="km">O.', 1), "Z is 'O."),
}  # fmt: skip


@pytest.mark.parametrize("fault", OEM_FAULTS)
def test_malformed_oem(tmp_path, fault):
    text, *words = OEM_FAULTS[fault]
    no_ephemeris(tmp_path, text, *words)


def test_ephemeris_of_sgp4_states(tmp_path):
    """The states of an element set, sampled each minute, written and read again."""
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    # SGP4's velocity is not the exact slope of its position (2 cm/s here), so Hermite would err by 0.2 m
    method = {"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "7"}
    again = ephemeris(tmp_path, HEAD + segment(GRID, orbit.states(GRID), **method))
    time_s = np.linspace(0.0, 6000.0, 1237)
    sampled, direct = again.states(time_s), orbit.states(time_s)
    assert np.max(np.linalg.norm(sampled.position_m - direct.position_m, axis=0)) < 1e-3
    assert np.max(np.linalg.norm(sampled.velocity_m_s - direct.velocity_m_s, axis=0)) < 1e-5


# ---------------------------------------------------------------------------------------------------------- the bounds
@pytest.mark.parametrize("kind", ["", "0", "2", "3"])
def test_each_type_of_ephemeris_that_is_sgp4_is_taken(tmp_path, kind):
    (found,) = elements(tmp_path, as_json({**FIELDS, "EPHEMERIS_TYPE": kind}))
    assert found == elements(tmp_path, as_json(FIELDS), found.name)[0]


@pytest.mark.parametrize("kind", ["1", "4", "6", "02"])
def test_each_other_type_of_ephemeris_is_refused(tmp_path, kind):
    refused(tmp_path, as_json({**FIELDS, "EPHEMERIS_TYPE": kind}), f"the type of the ephemeris is {kind}")


REVOLUTION_A_DAY = 2.0 * math.pi / 86400.0


@pytest.mark.parametrize(
    ("changes", "wrong"),
    [
        ({"eccentricity": 0.0}, ""),
        ({"eccentricity": -1e-9}, "eccentricity is -1e-09"),
        ({"eccentricity": 1.0}, "eccentricity is 1,"),
        ({"inclination_rad": 0.0}, ""),
        ({"inclination_rad": math.pi}, ""),
        ({"inclination_rad": math.pi + 1e-6}, "inclination is 180.00006"),
        ({"inclination_rad": -1e-6}, "inclination is -5.7"),
        ({"mean_motion_rad_s": 1.001e-3 * REVOLUTION_A_DAY}, ""),
        ({"mean_motion_rad_s": 0.999e-3 * REVOLUTION_A_DAY}, "mean motion is 0.000999"),
        ({"mean_motion_rad_s": 19.999 * REVOLUTION_A_DAY}, ""),
        ({"mean_motion_rad_s": 20.001 * REVOLUTION_A_DAY}, "mean motion is 20.001"),
        ({"drag_per_earth_radius": -1.0}, ""),
        ({"drag_per_earth_radius": 0.999}, ""),
        ({"drag_per_earth_radius": 1.0}, "B* is 1,"),
        ({"drag_per_earth_radius": -1.001}, "B* is -1.001"),
    ],
)
def test_elements_are_taken_up_to_their_bounds(tmp_path, changes, wrong):
    given = replace(elements(tmp_path, NAMED)[0], **changes)
    if not wrong:
        assert mean_elements.checked(given) is given
        return
    with pytest.raises(OrbitError, match=re.escape(wrong)):
        mean_elements.checked(given)


def test_state_vectors_outside_of_a_segment_and_within_one_another_are_no_states(tmp_path):
    text = oem_xml(GRID)
    plain = ephemeris(tmp_path, text).states(GRID[:5] + 1.0)
    first = text[text.index("<stateVector>") : text.index("</stateVector>") + len("</stateVector>")]
    outside = text.replace("<body>", f"<body><data>{first}</data>")
    nested = text.replace(first, f"<stateVector>{first}</stateVector>")
    for changed in (outside, nested):
        assert changed != text
        np.testing.assert_array_equal(ephemeris(tmp_path, changed).states(GRID[:5] + 1.0).position_m, plain.position_m)


@pytest.mark.parametrize("name", ["1 BIT", "1 OF A NAME OF 30 LETTERS, SO", "N" * 31, "N" * 60, "ONE 1 TWO"])
def test_a_name_before_two_lines_is_any_that_is_no_line_itself(tmp_path, name):
    (found,) = elements(tmp_path, f"{name}\n{LINE_1}\n{LINE_2}")
    assert (found.name, found.catalogue_number) == (name, "90001")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("1 OF A NAME OF 31 LETTERS, OR SO", "69 characters, this one 32"),
        ("N" * 61, "begin with '1 '"),
        ("2 BIT", "'1 '"),
    ],
)
def test_a_name_that_may_be_a_line_is_taken_for_one(tmp_path, name, words):
    refused(tmp_path, f"{name}\n{LINE_1}\n{LINE_2}", "line 1", words)


# -------------------------------------------------------------------------------------- the notations, the other way
def test_a_catalogue_number_of_noughts_is_0_in_each_notation(tmp_path):
    lines = f"{edited(LINE_1, 3, '00000')}\n{edited(LINE_2, 3, '00000')}"
    (found,) = elements(tmp_path, lines)
    assert (found.name, found.catalogue_number) == ("0", "0")
    for number, told in (("000", "0"), ("0025540", "25540"), ("100", "100")):
        (found,) = elements(tmp_path, kvn({**FIELDS, "NORAD_CAT_ID": number}))
        assert found.catalogue_number == told
    for asked in ("0", "000", " 0 "):
        assert elements(tmp_path, lines + "\n" + NAMED, asked)[0].catalogue_number == "0"


def test_a_name_is_asked_for_whatever_its_capitals_and_the_blanks_about_it(tmp_path):
    for asked in (" Example 1 ", "EXAMPLE 1", " 90001"):
        assert [e.name for e in elements(tmp_path, NAMED, asked)] == ["EXAMPLE 1"]


@pytest.mark.parametrize("blank", ["\n\n", "  \n\t\n"])
@pytest.mark.parametrize("notation", ["kvn", "json", "csv"])
def test_empty_lines_before_a_message_are_passed_over(tmp_path, notation, blank):
    plain = elements(tmp_path, NOTATIONS[notation](FIELDS))[0]
    (found,) = elements(tmp_path, blank + NOTATIONS[notation](FIELDS))
    assert replace(found, place="") == replace(plain, place="")


def test_a_message_that_begins_with_a_comment_is_one(tmp_path):
    (found,) = elements(tmp_path, "COMMENT of nothing\n" + kvn(FIELDS))
    assert found.name == "EXAMPLE 1"


def test_a_first_line_of_five_commas_is_a_table_and_one_of_four_a_name(tmp_path):
    name = "ONE, TWO, THREE, FOUR, FIVE"
    assert elements(tmp_path, f"{name}\n{LINE_1}\n{LINE_2}")[0].name == name
    refused(tmp_path, f"{name}, SIX\n{LINE_1}\n{LINE_2}", "line 2: 1 values, but the first line names 6 columns")


@pytest.mark.parametrize("notation", ["kvn", "xml", "json", "csv"])
def test_a_message_without_the_type_of_its_ephemeris_is_of_sgp4(tmp_path, notation):
    write_in = NOTATIONS[notation]
    plain = elements(tmp_path, write_in(FIELDS))[0]
    without = {key: value for key, value in FIELDS.items() if key != "EPHEMERIS_TYPE"}
    assert replace(elements(tmp_path, write_in(without))[0], place="") == replace(plain, place="")


def test_values_of_json_that_are_no_words_or_numbers_are_absent(tmp_path):
    (found,) = elements(tmp_path, json.dumps([{**FIELDS, "RCS_SIZE": None, "TAGS": ["a"], "ACTIVE": True}]))
    assert found.name == "EXAMPLE 1"
    for none in (None, True, ["1"]):
        refused(tmp_path, json.dumps([{**FIELDS, "BSTAR": none}]), "entry 1: BSTAR is missing")


def test_keys_of_the_tables_may_be_in_small_letters(tmp_path):
    small = {key.lower(): value for key, value in FIELDS.items()}
    assert elements(tmp_path, json.dumps(small))[0].name == "EXAMPLE 1"
    head, rest = comma(FIELDS).split("\n", 1)
    assert elements(tmp_path, f" {head.lower()}\n\n{rest}")[0].name == "EXAMPLE 1"


def test_comments_and_keys_of_the_users_own_may_stand_twice(tmp_path):
    own = kvn(FIELDS) + "USER_DEFINED_A = 1\nUSER_DEFINED_A = 2\n"
    commented = xml(FIELDS).replace("<metadata>", "<metadata><COMMENT>one</COMMENT><COMMENT>two</COMMENT>")
    for text in (own, commented):
        assert elements(tmp_path, text)[0].name == "EXAMPLE 1"
    text = oem_xml(GRID).replace("<metadata>", "<metadata><COMMENT>one</COMMENT><COMMENT>two</COMMENT>")
    assert ephemeris(tmp_path, text).name == "EXAMPLE 1"


@pytest.mark.parametrize(("length", "shown"), [(60, "9" * 60), (61, "9" * 57 + "...")])
def test_a_value_of_60_letters_is_shown_whole_and_a_longer_one_cut(tmp_path, length, shown):
    refused(tmp_path, as_json({**FIELDS, "EPOCH": "9" * length}), f"EPOCH is '{shown}', not a date")


@pytest.mark.parametrize("read_already", [False, True])
def test_a_file_of_the_largest_size_is_read_and_a_byte_more_is_not(tmp_path, monkeypatch, read_already):
    path = write(tmp_path, NAMED)
    data = NAMED.encode() if read_already else None
    monkeypatch.setattr(messages, "MOST_BYTES", len(NAMED))
    assert read_elements(path, data=data)[0].name == "EXAMPLE 1"
    monkeypatch.setattr(messages, "MOST_BYTES", len(NAMED) - 1)
    with pytest.raises(OrbitError, match="keep only the satellites"):
        read_elements(path, data=data)


def test_a_line_of_keywords_may_have_a_thousand_letters(tmp_path):
    line = "USER_DEFINED_A = "
    assert elements(tmp_path, kvn(FIELDS) + line.ljust(1000, "x") + "\n")
    refused(tmp_path, kvn(FIELDS) + line.ljust(1001, "x") + "\n", "is neither 'KEY = value'")


def test_a_keyword_without_a_value_is_missing(tmp_path):
    refused(tmp_path, kvn({**FIELDS, "EPOCH": ""}), "line 1: EPOCH is missing in this mean-elements message")


@pytest.mark.parametrize("block", [1, 7, len(xml(FIELDS)), len(xml(FIELDS)) - 1, len(xml(FIELDS)) + 1])
def test_xml_is_the_same_in_any_pieces(tmp_path, monkeypatch, block):
    (plain,) = elements(tmp_path, xml(FIELDS))
    monkeypatch.setattr(messages, "_BLOCK", block)
    assert elements(tmp_path, xml(FIELDS)) == (plain,)
    refused(tmp_path, xml(FIELDS)[:-3], "not well-formed XML")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("2026-03-20T12:34:56.5", (739695, 45296.5)),
        ("2026-079T12:34:56", None),
        ("2026-03-20T23:59:59.999", (739695, 86399.999)),
        ("2026-03-20T12:34:60", None),
        ("2026-03-20T24:00:00", None),
        ("2026-03-20 12:34:56", None),
        ("2026-03-20T12:34x56", None),
        ("2026-03-20T12:34", None),
        ("2026-03-20T12:34:\uff15\uff16", None),
        ("2026-03-20T12:34:5.6.7", None),
        ("2026-03-20T12:34:-5", None),
        ("2026-02-29T12:34:56", None),
    ],
)
def test_the_quick_way_to_read_a_time_takes_the_plain_form_alone(text, found):
    assert messages.plain_instant(text) == found


@pytest.mark.parametrize("time", ["2026-03-20T12:04x00", "2026-03-20T12:04:\uff10\uff10", "2026-03-20T12:04"])
def test_a_time_of_a_state_vector_that_is_almost_plain_is_refused(tmp_path, time):
    no_ephemeris(tmp_path, with_word(4, 0, time), "line 20", f"'{time}', not a date and time")


def test_a_year_has_no_day_0(tmp_path):
    words = "day 000.50000000 of 2026, is refused: the day of the year must be from 1 to 366"
    refused(tmp_path, f"{edited(LINE_1, 21, '000')}\n{LINE_2}", words)


def test_years_of_two_digits_are_of_the_last_century_from_57_on(tmp_path):
    for year, full in (("56", 2056), ("57", 1957)):
        refused(tmp_path, f"{edited(LINE_1, 19, year)}\n{LINE_2}", f"of {full}, is refused")


@pytest.mark.parametrize(
    ("count", "method"),
    [(4, ()), (2, (("INTERPOLATION", "HERMITE"), ("INTERPOLATION_DEGREE", "3"))), (8, LAGRANGE)],
    ids=["default", "hermite", "lagrange"],
)
def test_as_many_state_vectors_as_the_interpolation_takes_are_enough(tmp_path, count, method):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID[:count], **dict(method)))
    assert orbit.span_s == (0.0, GRID[count - 1])
    words = f"{count - 1} state vectors in this segment, too few", f"which takes {count}"
    no_ephemeris(tmp_path, HEAD + segment(GRID[: count - 1], **dict(method)), *words)


@pytest.mark.parametrize("method", ["HERMITE", "LAGRANGE"])
def test_degrees_of_interpolation_go_from_3_to_25(tmp_path, method):
    for degree in ("3", "25"):
        ephemeris(tmp_path, HEAD + segment(GRID, INTERPOLATION=method, INTERPOLATION_DEGREE=degree))
    for degree in ("2", "26"):
        text = HEAD + segment(GRID, INTERPOLATION=method, INTERPOLATION_DEGREE=degree)
        no_ephemeris(tmp_path, text, f"INTERPOLATION_DEGREE is '{degree}'; take a whole number from 3 to 25")


def test_a_degree_without_a_method_is_of_hermite(tmp_path):
    (segment_of,) = ephemeris(tmp_path, HEAD + segment(GRID, INTERPOLATION_DEGREE="5")).segments
    assert (segment_of.method, segment_of.points) == ("HERMITE", 3)


@pytest.mark.parametrize(("first", "last"), [(600, 600), (6000, 6100), (-60, 0)])
def test_a_usable_span_of_one_instant_is_none(tmp_path, first, last):
    text = HEAD + segment(GRID, USEABLE_START_TIME=stamp(first), USEABLE_STOP_TIME=stamp(last))
    no_ephemeris(tmp_path, text, "has nothing in common with the state vectors", "correct USEABLE_START_TIME and")


def test_times_may_miss_the_ends_of_an_ephemeris_by_their_rounding(tmp_path):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID))
    orbit.require(-5e-7, 6000.0 + 5e-7)
    at_ends = orbit.states(np.array([-5e-7, 6000.0 + 5e-7]))
    np.testing.assert_array_equal(at_ends.position_m, orbit.states(np.array([0.0, 6000.0])).position_m)
    for start, end in ((-2e-6, 6000.0), (0.0, 6000.0 + 2e-6)):
        with pytest.raises(OrbitError, match="nothing is extrapolated"):
            orbit.require(start, end)
        with pytest.raises(OrbitError, match="nothing is extrapolated"):
            orbit.states(np.array([start, end]))


@pytest.mark.parametrize(("count", "more"), [(4, ""), (5, " and 1 more"), (6, " and 2 more")])
def test_four_segments_are_listed_and_the_others_counted(tmp_path, count, more):
    text = HEAD + "".join(segment(1200.0 * k + GRID[:6]) for k in range(count))
    with pytest.raises(OrbitError) as caught:
        ephemeris(tmp_path, text).require(0.0, 7200.0)
    last = "2026-03-20T13:00:00.000Z to 2026-03-20T13:05:00.000Z"
    assert f"{last}{more}, and the mission needs 2026-03-20T12:00:00.000Z to 2026-03-20T14" in str(caught.value)


def test_segments_apart_by_less_than_the_rounding_of_times_hold_as_one(tmp_path):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID[:6]) + segment(300.0 + GRID[:6]))
    for apart_s, held in ((5e-7, True), (2e-6, False)):
        moved = replace(orbit, segments=(orbit.segments[0], replace(orbit.segments[1], start_s=300.0 + apart_s)))
        if held:
            moved.require(0.0, 600.0)
        else:
            with pytest.raises(OrbitError, match="nothing is extrapolated"):
                moved.require(0.0, 600.0)


@pytest.mark.parametrize(("count", "others"), [(8, "EXAMPLE 7 (90007); name one"), (9, "(90007) and others; name one")])
def test_eight_satellites_are_listed(tmp_path, count, others):
    with pytest.raises(OrbitError, match=f"{count} element sets of different satellites, EXAMPLE 0") as caught:
        closest_elements(elements(tmp_path, catalogue(count)), EPOCH)
    assert others in str(caught.value)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_elements_hold_for_fourteen_days_to_the_end(tmp_path, sign):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    limit = sign * 14 * 86400.0
    orbit.require(min(0.0, limit), max(0.0, limit))
    assert np.all(np.isfinite(orbit.states(limit).position_m))
    state, which = ("expired", "newer") if sign > 0 else ("not valid yet", "older")
    with pytest.raises(OrbitError, match=rf"the elements are {state}: .* 14\.00 days .* take {which} elements"):
        orbit.states(np.array([0.0, limit + sign * 1e-3]))


def test_an_ephemeris_within_a_combined_message_is_found(tmp_path):
    first, body = oem_xml(GRID).split("\n", 1)
    found = ephemeris(tmp_path, f"{first}\n<ndm><MESSAGE_ID>one of several</MESSAGE_ID>\n{body}\n</ndm>")
    time_s = np.linspace(0.0, 6000.0, 13)
    position_m, velocity_m_s = truth(time_s)
    np.testing.assert_allclose(found.states(time_s).position_m, position_m, rtol=0, atol=1e-3)
    np.testing.assert_allclose(found.states(time_s).velocity_m_s, velocity_m_s, rtol=0, atol=1e-5)


@pytest.mark.parametrize("time_s", [math.inf, -math.inf, math.nan])
def test_a_time_that_is_no_number_is_refused_as_such_by_an_ephemeris(tmp_path, time_s):
    orbit = ephemeris(tmp_path, HEAD + segment(GRID))
    with pytest.raises(OrbitError, match="a time is not a finite number; give seconds since"):
        orbit.states(np.array([700.0, time_s]))
    with pytest.raises(OrbitError, match="a time is not a finite number; give seconds since"):
        orbit.require(700.0, time_s)


# ------------------------------------------------------------------------------------------------ refusals as a whole
WHOLE = """
TLE short line -> FILE, line 1: line 1 of an element set has 69 characters, this one 68; copy it whole, with all its
  spaces
TLE long line -> FILE, line 2: line 2 of an element set has 69 characters, this one 70; copy it whole, with all its
  spaces
TLE checksum of line 1 -> FILE, line 2: the checksum of line 1 is 8, but its characters sum to 7; a character is
  wrong: download the elements again
TLE no line number 1 -> FILE, line 2: line 1 of an element set must stand here and begin with '1 ', but the line
  begins with '  90001U 260'; restore the line, with its number
TLE line 2 missing -> FILE, line 3: line 2 of an element set must stand here and begin with '2 ', but the line begins
  with 'B'; restore the line, with its number
TLE cut off -> FILE, line 1: the file ends where line 2 of an element set must follow; it is cut off, or no element
  set: download it again
TLE name alone -> FILE, line 1: the file ends where line 1 of an element set must follow; it is cut off, or no element
  set: download it again
TLE catalogue numbers -> FILE, line 1: line 1 is of catalogue number 90001, the line below it of 90002; put the two
  lines of one satellite together
TLE letters in line 2 -> FILE, line 2: the inclination in columns 9 to 16 is ' 9x.4000', and digits belong there;
  download the elements again
TLE day 367 -> FILE, line 1: the epoch, day 367.50000000 of 2026, is refused: the day of the year must be from 1 to
  366; download the elements again
TLE SGP4-XP -> FILE, line 1: the type of the ephemeris is 4, elements of another theory than SGP4 (4 is SGP4-XP),
  which SGP4 would misread by kilometres; take elements of type 0
TLE inclination 190 -> FILE, line 1 (90001): the inclination is 190, and an orbit about the Earth has 0 to 180 deg;
  download the elements again
TLE mean motion 0 -> FILE, line 1 (90001): the mean motion is 0, and an orbit about the Earth has 0.001 to 20
  revolutions a day; download the elements again
TLE comments alone -> FILE: no element set is in the file; give a TLE or an OMM
TLE empty -> FILE: the file is empty; download or export it again
TLE blank -> FILE: the file holds blanks and nothing else; download or export it again
TLE nul -> FILE: byte 8 is not text in UTF-8, so this is a binary or a compressed file; unpack it, or export element
  sets (TLE, OMM) or an ephemeris (OEM) as text
TLE ephemeris -> FILE, line 1: the file begins with CCSDS_OEM_VERS, not with CCSDS_OMM_VERS; give a CCSDS Orbit
  Mean-Elements Message, and an ephemeris (OEM) by its own key
OMM twice -> FILE, line 26: BSTAR is '3', but line 23 has '1e-05'; keep one of them
OMM leap second -> FILE, line 11: EPOCH is '2026-03-20T23:59:60', a second that does not exist: '2026-03-20T23:59:60Z'
  names a leap second, but none was inserted on that day; write the instant in UTC, for example "2026-03-20T12:00:00Z"
OMM line -> FILE, line 26: 'what is this' is neither 'KEY = value' nor a keyword that may stand here; repair or remove
  the line
OMM no version -> FILE, line 1: the file begins with CREATION_DATE, not with CCSDS_OMM_VERS; give a CCSDS Orbit
  Mean-Elements Message, and an ephemeris (OEM) by its own key
OMM bomb -> FILE, line 2: a document type (DOCTYPE) is declared, which no CCSDS message has and which can make a
  parser expand text without end; remove it
OMM deep JSON -> FILE: JSON nested too deeply or a number too long for element sets; give OMM records
OMM JSON list -> FILE, entry 1: '1' is not an object with the keys of an OMM; repair it
OMM CSV -> FILE, line 3: 2 values, but the first line names 17 columns; repair it
OMM drag -> FILE, line 1 (EXAMPLE 1): the drag term B* is 1e+308, and an orbit about the Earth has less than 1 per
  radius of the Earth, either sign; download the elements again
OMM a key without a value -> FILE, entry 1: EPOCH is missing in this mean-elements message; add it or export it again
OEM no OBJECT_ID -> FILE, line 6: OBJECT_ID is missing in this segment's metadata; add it
OEM XML no STOP_TIME -> FILE, line 3: STOP_TIME is missing in this segment's metadata; add it
OEM centre -> FILE, line 9: CENTER_NAME is 'MARS'; read are EARTH: export one of these
OEM Z in TAI -> FILE, line 12: START_TIME is '2026-03-20T12:00:00.000000Z' and ends in Z, which means UTC, but
  TIME_SYSTEM is TAI; remove the Z or correct TIME_SYSTEM
OEM leap second of TAI -> FILE, line 13: STOP_TIME is '2016-12-31T23:59:60', a second that does not exist: TAI has no
  leap seconds
OEM nan -> FILE, line 20: the state vector at 2026-03-20T12:04:00.000000 holds nan, inf or a number beyond 1e+300;
  remove or repair it
OEM columns -> FILE, line 20: 8 columns; a state vector has a time, three of position in km and three of velocity in
  km/s, and may have three of acceleration
OEM too few for Lagrange -> FILE, line 6: 8 state vectors in this segment, too few for LAGRANGE interpolation of
  degree 8, which takes 9; add state vectors or lower INTERPOLATION_DEGREE
OEM overlap -> FILE, line 76: this segment may be used from 2026-03-20T12:40:00.000Z, but the one before it until
  2026-03-20T12:59:00.000Z, so the orbit is stated twice; sort the segments by time and let USEABLE_START_TIME and
  USEABLE_STOP_TIME meet
OEM version -> FILE, line 1: the file begins with CCSDS_OEM_VERS = '4.0', not with CCSDS_OEM_VERS = 1, 2 or 3; give a
  CCSDS Orbit Ephemeris Message
OEM no segment -> FILE: no segment of an ephemeris (META_START to META_STOP, or <segment>) is in the file; give a
  CCSDS OEM, and element sets (TLE, OMM) by their own key
OEM cut in the metadata -> FILE: the file ends before META_STOP; it is cut off: download or export it again
OEM order -> FILE, line 6: META_STOP has no place here; repair the order of the blocks
"""
REFUSED_WHOLE = [line.split(" -> ") for line in WHOLE.replace("\n  ", " ").strip().split("\n")]


@pytest.mark.parametrize(("fault", "words"), REFUSED_WHOLE, ids=[fault for fault, _ in REFUSED_WHOLE])
def test_a_refusal_of_a_file_is_one_whole_sentence(tmp_path, fault, words):
    kind, name = fault.split(" ", 1)
    text = {"TLE": TLE_FAULTS, "OMM": OMM_FAULTS, "OEM": OEM_FAULTS}[kind][name][0]
    path = write(tmp_path, text)
    with pytest.raises(OrbitError) as caught:
        read_oem(path, EPOCH) if kind == "OEM" else read_elements(path)
    assert str(caught.value).replace(str(path), "FILE") == words


# ---------------------------------------------------------------------------------- elements all unlike each other
def fields_of(found):
    """The numbers of a set as files state them: revolutions a day, the eccentricity, four angles in degrees, B*."""
    angles = (found.inclination_rad, found.node_rad, found.argument_of_perigee_rad, found.mean_anomaly_rad)
    motion = found.mean_motion_rad_s * 43200.0 / math.pi
    return [motion, found.eccentricity, *map(math.degrees, angles), found.drag_per_earth_radius]


@pytest.mark.parametrize(("drag", "value"), [
    ("-11606-4", -0.11606e-4),
    (" 34567-2", 0.34567e-2),
    ("+ 2345+0", 0.02345),
    (" 00000 0", 0.0),
    ("-98765 0", -0.98765),
])  # fmt: skip
def test_two_lines_of_numbers_unlike_each_other_behind_another_satellite(tmp_path, drag, value):
    one = summed(f"1 A1234C 98067BQ  23271.56789012 -.00012345  67890-6 {drag} 0  4321")
    two = summed("2 A1234  51.6443 211.2001 0007417  17.6667 285.9053 15.49560532 1234")
    text = f"# of today\n{NAMED}\n0 SECOND SAT \n{one}  \n\n# between\n{two}\n"
    _, found = elements(tmp_path, text)
    motion = 15.49560532
    assert fields_of(found) == pytest.approx(
        [motion, 0.0007417, 51.6443, 211.2001, 17.6667, 285.9053, value], rel=1e-12
    )
    assert (found.name, found.catalogue_number, found.place) == ("SECOND SAT", "A1234", f"{tmp_path / 'a.txt'}, line 7")
    assert found.epoch.text == "2023-09-28T13:37:45.706368Z"
    assert [e.name for e in read_elements(tmp_path / "a.txt", "a1234")] == ["SECOND SAT"]


UNLIKE = dict(FIELDS) | {
    "OBJECT_NAME": "SECOND SAT", "NORAD_CAT_ID": "0040123", "EPOCH": "2025-060T07:08:09.25", "EPHEMERIS_TYPE": "3",
    "MEAN_MOTION": "2.00561234", "ECCENTRICITY": "0.0123", "INCLINATION": "55.25", "RA_OF_ASC_NODE": "120.5",
    "ARG_OF_PERICENTER": "33.75", "MEAN_ANOMALY": "327.125", "BSTAR": "-0.00045",
}  # fmt: skip


@pytest.mark.parametrize(("notation", "place"), [("kvn", 26), ("units", 26), ("xml", 27), ("json", 2), ("csv", 3)])
def test_a_second_message_of_numbers_unlike_each_other(tmp_path, notation, place):
    first, second = (NOTATIONS[notation](fields) for fields in (FIELDS, UNLIKE))
    text = first + second
    if notation == "xml":
        text = first.replace("</ndm>", "\n") + second.partition("<ndm>")[2]
    elif notation == "json":
        text = json.dumps([*json.loads(first), *json.loads(second)])
    elif notation == "csv":
        text = first + second.split("\n", 1)[1]
    _, found = elements(tmp_path, text)
    numbers = [2.00561234, 0.0123, 55.25, 120.5, 33.75, 327.125, -0.00045]
    assert fields_of(found) == pytest.approx(numbers, rel=1e-12)
    assert (found.name, found.catalogue_number) == ("SECOND SAT", "40123")
    assert found.epoch.text == "2025-03-01T07:08:09.25Z"
    assert found.place == f"{tmp_path / 'a.txt'}, {'entry' if notation == 'json' else 'line'} {place}"


@pytest.mark.parametrize(("notation", "changes", "words"), [
    ("kvn", {"BSTAR": "x"}, "line 48: BSTAR is 'x', not a finite number"),
    ("kvn", {"MEAN_MOTION": "2 [rad/s]"}, "line 37: MEAN_MOTION is in 'rad/s'; write it in 'rev/day'"),
    ("kvn", {"BSTAR": "1e-5 [1/m]"}, "line 48: BSTAR is in '1/m'; write it in '1/ER'"),
    ("kvn", {"RA_OF_ASC_NODE": "-inf"}, "line 40: RA_OF_ASC_NODE is '-inf', not a finite number"),
    ("kvn", {"ECCENTRICITY": ""}, "line 26: ECCENTRICITY is missing in this mean-elements message; add it or"),
    ("json", {"TIME_SYSTEM": "UT1"}, "entry 2: TIME_SYSTEM is 'UT1'; SGP4 takes UTC: export the elements so"),
    ("json", {"REF_FRAME": "GCRF"}, "entry 2: REF_FRAME is 'GCRF'; SGP4 takes TEME or TEMEOFDATE: export the"),
    ("json", {"MEAN_ELEMENT_THEORY": "DSST"}, "entry 2: MEAN_ELEMENT_THEORY is 'DSST'; SGP4 takes SGP4 or"),
    ("json", {"EPOCH": "2025-366T00:00:00"}, "entry 2: EPOCH is '2025-366T00:00:00', not a date and time; write"),
    ("json", {"EPOCH": "2055-01-01T00:00:00"}, "entry 2: EPOCH: '2055-01-01T00:00:00Z' is outside 1973-01-02 to"),
    ("json", {"EPHEMERIS_TYPE": "6"}, "entry 2: the type of the ephemeris is 6, elements of another theory than"),
    ("json", {"INCLINATION": "180.5"}, "entry 2 (SECOND SAT): the inclination is 180.5, and an orbit about the"),
])  # fmt: skip
def test_a_fault_of_a_second_message_is_told_in_its_place(tmp_path, notation, changes, words):
    fields = UNLIKE | changes
    text = json.dumps([FIELDS, fields]) if notation == "json" else kvn(FIELDS) + kvn(fields)
    message = refused(tmp_path, text)
    assert message.startswith(f"{tmp_path / 'a.txt'}, {words}")


@pytest.mark.parametrize(("line", "field"), [
    ("  mean_motion=15.5", ("MEAN_MOTION", "15.5", "")),
    ("A1_b = -1.5e-3 [ km / s ]  ", ("A1_B", "-1.5e-3", " km / s ")),
    ("NAME = SAT [B]", ("NAME", "SAT [B]", "")),
    ("NAME = .5[deg]", ("NAME", ".5", "deg")),
    ("KEY = a = b", ("KEY", "a = b", "")),
    ("KEY =", ("KEY", "", "")),
    ("KEY = 12 [", ("KEY", "12 [", "")),
    ("KEY = 7 []", ("KEY", "7", "")),
    ("1KEY = 7", None),
    ("KEY 7", None),
    ("= 7", None),
    ("TWO KEYS = 7", None),
])  # fmt: skip
def test_a_line_of_a_keyword_is_its_key_value_and_unit(line, field):
    if field is not None:
        assert messages.kvn_field(Path("f"), 17, line) == (*field, "line 17")
    else:
        words = (
            f"f, line 17: {line.strip()!r} is neither 'KEY = value' nor a keyword that may stand here; repair or remove"
        )
        with pytest.raises(OrbitError, match=re.escape(words)):
            messages.kvn_field(Path("f"), 17, line)


def test_xml_is_told_as_fields_and_containers_in_their_order(monkeypatch):
    text = (
        "<?xml version='1.0'?>\n<n:omm xmlns:n='urn:a' version='2.0'>\n<a units='km'> 1.5\n</a><b/>\n"
        "<n:c version='3'>x<d units='s' version='4'>2&amp;3</d>tail</n:c>\n<e>f<!-- no -->g</e></n:omm>\n"
    )
    found = [tuple(each) for each in messages.xml_fields(Path("f"), text)]
    assert found == [
        ("<omm", "2.0", "", "line 2"), ("a", "1.5", "km", "line 3"), ("b", "", "", "line 4"), ("<c", "3", "", "line 5"),
        ("d", "2&3", "s", "line 5"), ("</c", "", "", "line 5"), ("e", "fg", "", "line 6"), ("</omm", "", "", "line 2"),
    ]  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- instants
NEAR_LEAP = Epoch("2016-12-31T23:59:50.25Z")


@pytest.mark.parametrize(("system", "text", "expected"), [
    ("UTC", "2016-12-31T23:59:60.5", 10.25),
    ("UTC", "2017-001T00:00:02", 12.75),
    ("UTC", "2016-12-30T23:59:50.25", -86400.0),
    ("TAI", "2017-01-01T00:00:37", 10.75),  # midnight of UTC: a second was inserted before it, TAI - UTC is 37 s
    ("TAI", "2017-01-01T00:00:26.25", 0.0),  # 23:59:50.25 and 36 s
    ("TT", "2017-01-01T00:00:58.434", 0.0),  # and 32.184 s more
    ("TDT", "2017-01-02T00:00:58.434", 86400.0),
    ("GPS", "2017-01-01T00:00:07.25", 0.0),  # 19 s less than TAI
    ("GPS", "2016-12-31T00:00:07.25", -86400.0),
])  # fmt: skip
def test_instants_about_a_leap_second_are_elapsed_seconds(system, text, expected):
    given = messages.instant(Path("f"), messages.Field("EPOCH", text, "", "line 3"), system)
    other = messages.instant(Path("f"), messages.Field("EPOCH", "2017-06-01T00:00:00", "", "line 4"), system)
    found = messages.elapsed_s(system, NEAR_LEAP, [other, given], "f, line 3")
    assert found[1] == pytest.approx(expected, abs=1e-9)
    assert found[0] - found[1] > 100 * 86400.0


@pytest.mark.parametrize(("text", "found"), [
    ("2024-366T23:59:59.75", (738886 + 365, 86399.75)),
    ("2024-12-31T01:02:03", (738886 + 365, 3723.0)),
    ("2024-060T00:00:07.", (738886 + 59, 7.0)),
    ("2024-02-29T10:20:30.125Z", (738886 + 59, 37230.125)),
    *(
        (text, None)
        for text in (
            "2023-366T00:00:00", "2023-02-29T00:00:00", "2024-1-01T00:00:00", "2024-01-01", "2024-01-01T1:00:00",
            "2024-01-01T24:00:00", "2024-01-01T00:00:00+00:00", "2024-000T00:00:00", "20240101T00:00:00",
        )
    ),
])  # fmt: skip
def test_a_time_code_is_a_day_and_seconds_in_it(text, found):
    given = messages.Field("START_TIME", text, "", "line 9")
    if found is not None:
        assert messages.instant(Path("f"), given, "UTC") == found
    else:
        words = (
            f"f, line 9: START_TIME is '{text}', not a date and time; write it as 2026-03-20T12:00:00.000 or 2026-079T"
        )
        with pytest.raises(OrbitError, match="^" + re.escape(words)):
            messages.instant(Path("f"), given, "UTC")


# ------------------------------------------------------------------------------------ segments all unlike each other
PARTS = (  # times, motion, and what the metadata say: the parts of an ephemeris, one behind the other
    (GRID[:30], 1.1e-3, {"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "5", "USEABLE_STOP_TIME": stamp(1700)}),
    (GRID[28:60], 1.05e-3, {"REF_FRAME": "GCRF", "USEABLE_START_TIME": stamp(1700), "INTERPOLATION_DEGREE": "3"}),
    (GRID[65:] + 7.0, 0.9e-3, {"REF_FRAME": "ITRF", "INTERPOLATION": "Hermite", "INTERPOLATION_DEGREE": "10"}),
)


def parted(*changes):
    """The ephemeris of the parts, in KVN; ``changes`` of the metadata of each."""
    return HEAD + "".join(
        segment(time_s, truth(time_s, rate), **given | more)
        for (time_s, rate, given), more in zip(PARTS, changes or ({}, {}, {}), strict=True)
    )


def test_parts_of_an_ephemeris_are_each_interpolated_in_their_own_way(tmp_path):
    orbit = ephemeris(tmp_path, parted())
    kinds = [(s.method, s.points, s.start_s, s.stop_s, s.time_s.size) for s in orbit.segments]
    assert kinds == [
        ("LAGRANGE", 6, 0.0, 1700.0, 30), ("HERMITE", 2, 1700.0, 3540.0, 32), ("HERMITE", 6, 3907.0, 6007.0, 36)
    ]  # fmt: skip
    assert (orbit.name, orbit.source, orbit.epoch) == ("EXAMPLE 1", str(tmp_path / "a.txt"), EPOCH)
    time_s = np.array([5000.5, 1699.9, 3540.0, 30.0, 1700.0, 3907.0, 2500.5, 6007.0, 0.0])
    found = orbit.states(time_s)
    for k, which in enumerate((2, 0, 1, 0, 1, 2, 1, 2, 0)):
        nodes, rate, given = PARTS[which]
        alone = ephemeris(tmp_path, HEAD + segment(nodes, truth(nodes, rate), **given))
        own = alone.states(time_s[k])
        np.testing.assert_allclose(found.position_m[:, k], own.position_m, rtol=0, atol=1e-6)
        np.testing.assert_allclose(found.velocity_m_s[:, k], own.velocity_m_s, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("span", "held"), [
    ((0.0, 3540.0), True), ((1000.0, 1700.0), True), ((1700.0, 1700.5), True), ((3907.0, 6007.0), True),
    ((0.0, 3541.0), False), ((3540.0, 3907.0), False), ((3600.0, 3700.0), False), ((3906.0, 6007.0), False),
    ((-1.0, 100.0), False), ((5000.0, 6008.0), False), ((0.0, 6007.0), False), ((3540.0, 3540.0), True),
])  # fmt: skip
def test_a_mission_is_held_by_parts_that_meet_and_not_over_a_gap(tmp_path, span, held):
    orbit = ephemeris(tmp_path, parted())
    if held:
        orbit.require(*span)
        return
    with pytest.raises(OrbitError) as caught:
        orbit.require(*span)
    assert str(caught.value) == (
        f"{tmp_path / 'a.txt'}: the ephemeris of EXAMPLE 1 may be used from 2026-03-20T12:00:00.000Z to "
        "2026-03-20T12:28:20.000Z, 2026-03-20T12:28:20.000Z to 2026-03-20T12:59:00.000Z, 2026-03-20T13:05:07.000Z to "
        f"2026-03-20T13:40:07.000Z, and the mission needs {EPOCH.utc(span[0])} to {EPOCH.utc(span[1])}; nothing is "
        "extrapolated: choose an epoch and a duration inside, or take an ephemeris that covers them"
    )


@pytest.mark.parametrize(
    ("time_s", "needs"),
    [([100.0, 3600.0, 9000.0], "13:00:00.000Z; nothing"), ([-0.5], "11:59:59.500Z; n"), (6007.1, "13:40:07.100Z; n")],
)
def test_the_first_time_that_no_part_has_is_named_alone(tmp_path, time_s, needs):
    with pytest.raises(OrbitError, match=re.escape(f"and the mission needs 2026-03-20T{needs}")):
        ephemeris(tmp_path, parted()).states(np.array(time_s))


@pytest.mark.parametrize(("number", "changes", "words"), [
    (1, {"OBJECT_ID": None}, "line 49: OBJECT_ID is missing in this segment's metadata; add it"),
    (1, {"REF_FRAME": "ITRF97 X"}, "line 53: REF_FRAME is 'ITRF97 X'; read are TEME, TOD"),
    (1, {"TIME_SYSTEM": "UT1"}, "line 54: TIME_SYSTEM is 'UT1'; read are UTC, TAI, TT, GPS: export one of these"),
    (1, {"STOP_TIME": "2026-03-20"}, "line 56: STOP_TIME is '2026-03-20', not a date and time; write it as"),
    (1, {"USEABLE_START_TIME": stamp(1600)}, "line 49: this segment may be used from 2026-03-20T12:28:00.000Z, but "
     "the one before it until 2026-03-20T12:28:20.000Z, so the orbit is stated twice; sort the segments by time"),
    (1, {"USEABLE_START_TIME": stamp(3540)}, f"line 56: the usable span from {stamp(3540)} to {stamp(3540)} has "
     f"nothing in common with the state vectors, {stamp(1680)} to {stamp(3540)}; correct USEABLE_START_TIME and "
     "STOP_TIME"),
    (2, {"INTERPOLATION_DEGREE": "26"}, "line 102: INTERPOLATION_DEGREE is '26'; take a whole number from 3 to 25"),
    (2, {"INTERPOLATION_DEGREE": "7 [1]"}, None),
    (2, {"INTERPOLATION_DEGREE": None}, "line 101: INTERPOLATION stands without INTERPOLATION_DEGREE; add"),
    (2, {"INTERPOLATION": "SPLINE"}, "line 101: INTERPOLATION is 'SPLINE'; an orbit is read with HERM"),
    (2, {"REF_FRAME": "TOD_Earth", "REF_FRAME_EPOCH": "2000-01-01"}, "line 103: REF_FRAME_EPOCH holds TOD still at "
     "2000-01-01, and only the frame of date is read; export in EME2000 or GCRF"),
    (2, {"REF_FRAME": "TEME", "START_TIME": stamp(9e3)}, f"line 100: the usable span from {stamp(9e3)} to "),
    (2, {"OBJECT_NAME": "B"}, ": it holds the objects EXAMPLE 1 (2026-001A), B (2026-001A), and no object is"),
])  # fmt: skip
def test_a_fault_of_a_later_part_is_told_in_its_line(tmp_path, number, changes, words):
    given = [{}, {}, {}]
    given[number] = changes
    if words is None:
        assert ephemeris(tmp_path, parted(*given)).segments[number].points == 4
    else:
        start = f"{tmp_path / 'a.txt'}{'' if words.startswith(':') else ', '}{words}"
        assert no_ephemeris(tmp_path, parted(*given)).startswith(start)


LATE = [0, *range(15, 32)]  # the state vectors of a part without some of its first ones


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p, v, t: (p, np.where(t == t[9], 2.5, 1.0) * v, t), "line 69: from 2026-03-20T12:36:00.000000 to "
         "2026-03-20T12:37:00.000000 the velocities, 12.7201 km/s in the mean, are not those at which the positions "
         "are passed, 7.26961 km/s; velocities are in km/s, in the frame of the positions"),
        (lambda p, v, t: (np.where(t >= t[20], -1.0, 1.0) * p, v, t), "line 80: from 2026-03-20T12:47:00.000000 to "
         "2026-03-20T12:48:00.000000 the positions are passed at 229.927 km/s, and a satellite of the Earth has at "
         "most 10.7 there; find the position, or the time, that is wrong"),
        (lambda p, v, t: (np.where(t == t[3], 0.5, 1.0) * p, v, t), "line 63: 3473.83 km from the Earth's centre, "
         "where no satellite of the Earth is; positions are in km and velocities in km/s"),
        (lambda p, v, t: (np.where(t == t[3], 300.0, 1.0) * p, v, t), "line 63: 2.0843e+06 km from the Earth's "
         "centre, where no satellite of the Earth is; positions are in km and velocities in km/s"),
        (lambda p, v, t: (p, v, np.where(t == t[7], t[6], t)), f"line 67: the epoch {stamp(2040)} does not come after "
         f"{stamp(2040)} (line 66); sort the state vectors by time, each once"),
        (lambda p, v, t: (p[:, LATE], v[:, LATE], t[LATE]), f"line 61: no state vector between {stamp(1680)} (line "
         "60) and "
         f"{stamp(2580)}, 900 s apart, where the usual step of the segment is 60 s; over such a hole the orbit is "
         "not known: "
         "split the segment into two there, or take a file without the hole"),
    ],
    ids=["velocity", "jump", "inside", "outside", "twice", "hole"],
)  # fmt: skip
def test_state_vectors_of_a_later_part_are_looked_at_as_well(tmp_path, change, words):
    (first, rate, given), (second, other, _), _ = PARTS
    position, velocity, time_s = change(*truth(second, other), second)
    text = HEAD + segment(first, truth(first, rate), **given)
    text += segment(time_s, States(position, velocity), USEABLE_START_TIME=stamp(1700), STOP_TIME=stamp(3540))
    assert no_ephemeris(tmp_path, text) == f"{tmp_path / 'a.txt'}, {words}"


@pytest.mark.parametrize(
    ("degree", "t", "first", "count"),
    [(4, 1300.0, 0, 5), (4, 1900.0, 1, 5), (5, 1300.0, 0, 6), (5, 1900.0, 1, 6), (5, 8990.0, 10, 6), (5, 10.0, 0, 6),
     (6, 4790.0, 4, 7)],
)  # fmt: skip
def test_lagrange_is_the_polynomial_through_the_points_about_the_time(tmp_path, degree, t, first, count):
    """Steps of ten minutes, so that another window gives another value; positions and velocities have one each."""
    grid = np.arange(0.0, 9001.0, 600.0)
    text = HEAD + segment(grid, INTERPOLATION="LAGRANGE", INTERPOLATION_DEGREE=str(degree))
    found, known = ephemeris(tmp_path, text).states(t), truth(grid)
    window = slice(first, first + count)
    for of, nodes in zip(found, known, strict=True):
        expected = BarycentricInterpolator(grid[window], nodes[:, window], axis=1)(t)
        np.testing.assert_allclose(of, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "frame"),
    [("itrf 2014", "ITRF2014"), ("Teme Of Date", "TEME"), ("j2000", "EME2000"), ("tod_earth", "TOD"), ("gcrf", "GCRF")],
)
def test_a_frame_is_known_by_its_other_names(given, frame):
    assert oem.frame_name(given) == frame and oem.FRAMES.fullmatch(frame)


@pytest.mark.parametrize(
    "frame", ["ITRF20X", "XTEME", "TEMES", "TOD2000", "EME2000B", "MOD", "ITRF-", "ITRF--97", "GCRF3"]
)
def test_a_frame_of_a_name_that_goes_on_is_another(frame):
    assert bool(oem.FRAMES.fullmatch(frame)) == (frame in ("ITRF-", "GCRF3"))


# ------------------------------------------------------------------------------------------------ SGP4 in its own words
@pytest.mark.parametrize(("day", "span", "words"), [
    ("2026-04-02T12:00:00Z", (0.0, 3 * 86400.0), "the elements are expired: their epoch is 2026-03-20T12:00:00Z, the "
     "mission's 2026-04-02T12:00:00Z, and 2026-04-05T12:00:00.000Z is 16.00 days from the elements; SGP4 is trusted "
     "for 14 days: take newer elements, or set orbit.epoch near theirs"),
    ("2026-03-01T06:00:00Z", (86400.0, 6 * 86400.0), "the elements are not valid yet: their epoch is "
     "2026-03-20T12:00:00Z, the mission's 2026-03-01T06:00:00Z, and 2026-03-02T06:00:00.000Z is 18.25 days from the "
     "elements; SGP4 is trusted for 14 days: take older elements, or set orbit.epoch near theirs"),
    ("2026-03-21T00:00:00Z", (0.0, math.nan), "a time is not a finite number; give seconds since 2026-03-21T00:00:00Z"),
])  # fmt: skip
def test_elements_out_of_their_time_say_how_far(tmp_path, day, span, words):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], Epoch(day))
    for call in (lambda: orbit.require(*span), lambda: orbit.states(np.array(span))):
        with pytest.raises(OrbitError) as caught:
            call()
        assert str(caught.value) == f"{tmp_path / 'a.txt'}, line 2 (EXAMPLE 1): {words}"


def test_a_stop_and_a_low_perigee_say_when_and_what_to_do(tmp_path):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], Epoch("2026-03-21T00:00:00Z"))
    where = f"{tmp_path / 'a.txt'}, line 2 (EXAMPLE 1)"
    object.__setattr__(orbit, "_satellite", Stopped(9))
    with pytest.raises(OrbitError) as caught:
        orbit.states(np.array([0.0, 61.0]))
    assert str(caught.value) == (
        f"{where}: SGP4 stops at 2026-03-21T00:01:01.000Z, 43261 s from the epoch of the elements: error 9; take newer "
        "elements or an earlier epoch"
    )
    with pytest.raises(OrbitError) as caught:
        Sgp4Orbit(replace(orbit.elements, mean_motion_rad_s=16.56 * REVOLUTION_A_DAY), orbit.epoch)
    assert str(caught.value) == (
        f"{where}: the perigee is 114 km high at 2026-03-20T12:00:00.000Z; below 120 km an orbit decays within about a "
        "revolution: choose another satellite, or an epoch before its decay"
    )


@pytest.mark.parametrize(
    ("asked", "names"),
    [("second", ["Second"]), ("0070020", ["Second", "Third"]), ("70020 ", ["Second", "Third"]), ("007", ["007"])],
)
def test_a_satellite_is_asked_for_by_name_or_number_whatever_stands_beside_it(tmp_path, asked, names):
    chosen = [("EXAMPLE 1", 70001), ("Second", 70020), ("Third", 70020), ("007", 70003)]
    text = "".join(f"{name}\n" + "\n".join(export_tle(invented(number))) + "\n" for name, number in chosen)
    assert [e.name for e in elements(tmp_path, text, asked)] == names
    with pytest.raises(OrbitError) as caught:
        elements(tmp_path, text, "secnod")
    assert str(caught.value) == (
        f"{tmp_path / 'a.txt'}: none of its 4 element sets is of 'secnod'; nearest are Second, Third, EXAMPLE 1: "
        "name one "
        "of them, or a catalogue number"
    )


@pytest.mark.parametrize(("epoch", "day"), [("2026-03-14T18:00:00Z", 19.0), ("2026-03-14T17:59:00Z", 10.5)])
def test_of_two_epochs_the_nearer_is_taken(tmp_path, epoch, day):
    sets = tuple(elements(tmp_path, "\n".join(export_tle(invented(day=each))))[0] for each in (30.0, 19.0, 10.5))
    chosen = closest_elements(sets, Epoch(epoch))
    assert chosen is sets[(30.0, 19.0, 10.5).index(day)]


# ------------------------------------------------------------------------------------------- several segments in XML
def xml_of(*parts):
    """An ephemeris in XML of several segments: that of each grid, with what its metadata change."""
    bodies = [oem_xml(time_s, **given) for time_s, given in parts]
    inner = [body[body.index("<segment>") : body.index("</body>")] for body in bodies]
    return bodies[0][: bodies[0].index("<segment>")] + "\n".join(inner) + "</body></oem>"


def test_segments_of_xml_are_each_read_with_their_own_metadata(tmp_path):
    first, second = (
        (GRID[:40], {"STOP_TIME": stamp(2000)}),
        (GRID[30:], {"START_TIME": stamp(2000), "REF_FRAME": "GCRF"}),
    )
    found = ephemeris(tmp_path, xml_of(first, second))
    assert [(s.start_s, s.stop_s, s.time_s.size) for s in found.segments] == [(0.0, 2000.0, 40), (2000.0, 6000.0, 71)]
    plain = ephemeris(tmp_path, HEAD + "".join(segment(time_s, **given) for time_s, given in (first, second)))
    for t in (3.0, 1999.0, 2001.0, 5999.0):
        np.testing.assert_array_equal(found.states(t).position_m, plain.states(t).position_m)
    only = xml_of((GRID, {}), (GRID, {"OBJECT_NAME": "B", "OBJECT_ID": "2026-9B"}))
    for name in ("b", "2026-9b"):
        assert ephemeris(tmp_path, only, name=name).name == "B"


@pytest.mark.parametrize(("old", "new", "words"), [
    ("Y_DOT", "Y_D0T", "line 107: Y_DOT is missing in this stateVector; add it"),
    (
        '<Z_DOT units="km/s">',
        '<Z_DOT units="km">',
        "line 107: Z_DOT is in 'km'; an OEM has it in 'km/s': convert the file",
    ),
    ('<Y units="km">', '<Y units="KM">', "line 107: Y is in 'KM'; an OEM has it in 'km': convert the file"),
    (
        "<EPOCH>2026-03",
        "<EPOCH>2026-13",
        "line 107: the epoch is '2026-13-20T13:41:40.000000', not a date and time; ",
    ),
    ("<X ", "<X>1</X><X ", "line 107: X is '"),
    ("<stateVector>", "<stateVector><COMMENT>a</COMMENT><COMMENT>b</COMMENT>", ""),
    ("<Z_DOT ", "<X_DDOT>1</X_DDOT><Z_DOT ", ""),
])  # fmt: skip
def test_a_fault_of_a_second_segment_of_xml_is_told_in_its_line(tmp_path, old, new, words):
    text = xml_of((GRID, {}), (GRID + 6100.0, {}))
    at = text.index(old, text.index("<stateVector>", text.rindex("<segment>")))
    changed = text[:at] + text[at:].replace(old, new, 1 if old.startswith("<") else 2)
    if not words:
        assert ephemeris(tmp_path, changed).span_s == (0.0, 12100.0)
    else:
        assert no_ephemeris(tmp_path, changed).startswith(f"{tmp_path / 'a.txt'}, {words}")


@pytest.mark.parametrize(("count", "listed"), [(2, 2), (8, 8), (9, 8)])
def test_the_objects_of_an_ephemeris_are_listed_by_name_and_identifier(tmp_path, count, listed):
    text = HEAD + "".join(segment(GRID[:5], OBJECT_NAME=f"SAT {k}", OBJECT_ID=f"ID-{k}") for k in range(count))
    names = ", ".join(f"SAT {k} (ID-{k})" for k in range(listed))
    for name, wanted in ((None, "no object is named"), ("SAT", "'SAT' names 0 of them")):
        with pytest.raises(OrbitError) as refused:
            ephemeris(tmp_path, text, name=name)
        assert str(refused.value).startswith(f"{tmp_path / 'a.txt'}: it holds the objects {names}")
        assert str(refused.value).endswith(f", and {wanted}; name one of them")
    assert ephemeris(tmp_path, text, name="id-1").name == ephemeris(tmp_path, text, name="Sat 1").name == "SAT 1"


def test_a_satellite_of_several_element_sets_is_offered_once(tmp_path):
    with pytest.raises(OrbitError, match="none of its 3 element sets is of 'EXAMPEL'; nearest are EXAMPLE 1: name"):
        elements(tmp_path, NAMED * 3, "EXAMPEL")


def test_velocities_beside_a_hole_that_is_not_used_are_not_held_against_it(tmp_path):
    usable = {"USEABLE_START_TIME": stamp(3600), "USEABLE_STOP_TIME": stamp(5400)}
    times = np.r_[0.0, GRID[GRID >= 3540.0]]
    assert ephemeris(tmp_path, HEAD + segment(times, **usable)).states(4000.0).position_m.shape == (3,)
    no_ephemeris(tmp_path, HEAD + segment(times), "no state vector between")


def test_a_csv_file_with_a_cell_beyond_what_csv_takes_is_refused_with_its_line(tmp_path):
    path = tmp_path / "elements.csv"
    path.write_text("OBJECT_NAME,OBJECT_ID,EPOCH,A,B,C\nA," + csv.field_size_limit() * "1" + "2\n", encoding="utf-8")
    with pytest.raises(OrbitError, match=r"elements\.csv, line 2: not CSV \(field larger than field limit"):
        read_elements(path)


@pytest.mark.parametrize("notation", ["kvn", "units", "xml", "json", "csv"])
def test_words_and_units_of_a_message_mean_the_same_in_letters_of_any_size(tmp_path, notation):
    words = {"CENTER_NAME": "Earth", "REF_FRAME": "TemeOfDate", "TIME_SYSTEM": "utc", "MEAN_ELEMENT_THEORY": "Sgp4"}
    head, *rest = NOTATIONS[notation](UNLIKE | words).splitlines(keepends=True)
    if notation in ("kvn", "units"):  # keys and units; the numbers have no letters
        kept = ("COMMENT", "OBJECT_NAME", "EPOCH", "CREATION")
        rest = [line if line.startswith(kept) else line.lower() for line in rest]
    text = "".join([head, *rest]).replace("<MEAN_MOTION>", '<MEAN_MOTION units="Rev/Day">')
    (found,) = elements(tmp_path, text.replace("<INCLINATION>", '<INCLINATION units="DEG">'))
    numbers = [2.00561234, 0.0123, 55.25, 120.5, 33.75, 327.125, -0.00045]
    assert fields_of(found) == pytest.approx(numbers, rel=1e-12)  # radians and back
    assert (found.name, found.catalogue_number) == ("SECOND SAT", "40123")


def test_a_unit_of_xml_that_is_another_one_is_told_in_the_line_of_its_key(tmp_path):
    text = xml(FIELDS).replace("<ARG_OF_PERICENTER>", '<ARG_OF_PERICENTER units="rad">')
    line = text[: text.index("<ARG_OF_PERICENTER")].count("\n") + 1
    words = f"{tmp_path / 'a.txt'}, line {line}: ARG_OF_PERICENTER is in 'rad'; write it in 'deg'"
    assert line > 3 and refused(tmp_path, text) == words


def test_blanks_about_the_cells_of_a_table_and_rows_of_empty_cells_are_nothing(tmp_path):
    head, first, second = comma(FIELDS).splitlines() + comma(UNLIKE).splitlines()[1:]
    spaced = [" , ".join(line.split(",")) for line in (head, first, second)]
    text = "\n".join([spaced[0], "," * head.count(","), spaced[1], "", spaced[2] + " "])
    found = elements(tmp_path, text)
    plain = elements(tmp_path, "\n".join([head, first, second]))
    assert [replace(each, place="") for each in found] == [replace(each, place="") for each in plain]
    assert [each.place.rpartition(" ")[2] for each in found] == ["3", "5"]


def test_the_words_of_an_ephemeris_may_be_in_small_letters(tmp_path):
    given = {"TIME_SYSTEM": "tai", "REF_FRAME": "eme 2000", "INTERPOLATION": "lagrange", "INTERPOLATION_DEGREE": "8"}
    text = HEAD + segment(GRID, **{key: value.upper() for key, value in given.items()})
    small = HEAD + segment(GRID, **given).replace("TIME_SYSTEM", "time_system").replace(
        "INTERPOLATION_D", "interpolation_d"
    )
    one, other = ephemeris(tmp_path, text), ephemeris(tmp_path, small)
    (part,) = other.segments
    assert (part.method, part.points, other.span_s) == ("LAGRANGE", 9, one.span_s)
    assert other.span_s == (-37.0, 5963.0)  # TAI is 37 s ahead of UTC
    np.testing.assert_array_equal(other.states(GRID[3:-3] - 37.0), one.states(GRID[3:-3] - 37.0))


@pytest.mark.parametrize(("clock", "second"), [
    ("2016-12-31T23:59:60.25", 86400.25),
    ("2016-366T23:59:60", 86400.0),
    ("2016-12-31T23:59:60.999Z", 86400.999),
])  # fmt: skip
def test_a_state_vector_may_stand_within_a_leap_second_that_there_was(tmp_path, clock, second):
    given = messages.Field("EPOCH", clock, "", "line 9")
    day, found = messages.instant(tmp_path, given, "UTC")
    assert (day, found) == (datetime(2016, 12, 31).toordinal(), pytest.approx(second, abs=1e-9))
    for system in ("TAI", "GPS"):
        with pytest.raises(OrbitError, match=r"line 9: EPOCH is '2016-12-31T23:59:60\.25', a second that"):
            messages.instant(tmp_path, given._replace(value="2016-12-31T23:59:60.25"), system)
    with pytest.raises(OrbitError, match=r"a second that does not exist: .*none was inserted on that day"):
        messages.instant(tmp_path, given._replace(value="2015-12-31T23:59:60.25"), "UTC")


@pytest.mark.parametrize(
    ("clock", "end"), [("12:34:56.", ""), ("12:34:56.Z", ""), ("12:34:56Z", ""), ("12:34:56.50", ".5")]
)
def test_the_epoch_of_elements_may_end_in_a_point_or_its_zone(tmp_path, clock, end):
    (found,) = elements(tmp_path, kvn(FIELDS | {"EPOCH": f"2026-079T{clock}"}))
    assert found.epoch.text == f"2026-03-20T12:34:56{end}Z"


def test_covariances_of_an_ephemeris_in_xml_are_no_metadata(tmp_path):
    given = "<covarianceMatrix><EPOCH>{}</EPOCH><REF_FRAME>RTN</REF_FRAME><CX_X>{}</CX_X></covarianceMatrix>"
    both = given.format(stamp(0), 1.0) + given.format(stamp(600), 2.0)
    plain = oem_xml(GRID)
    text = plain.replace("</data>", f"{both}</data>")
    assert text != plain
    one, other = ephemeris(tmp_path, plain), ephemeris(tmp_path, text)
    assert (other.name, other.span_s) == (one.name, one.span_s)
    np.testing.assert_array_equal(other.states(GRID[1:-1]).position_m, one.states(GRID[1:-1]).position_m)


@pytest.mark.parametrize("unit", ["1/ER", "1/er", "1/Er"])
def test_the_drag_of_a_message_may_have_its_unit(tmp_path, unit):
    with_unit = kvn(UNLIKE).replace("BSTAR = -0.00045", f"BSTAR = -0.00045 [{unit}]")
    for text in (with_unit, xml(UNLIKE).replace("<BSTAR>", f'<BSTAR units="{unit}">')):
        assert f"{unit}" in text and elements(tmp_path, text)[0].drag_per_earth_radius == -0.00045


def test_lines_of_a_table_are_counted_with_the_empty_ones_before_it(tmp_path):
    cell = csv.field_size_limit() * "1"
    message = refused(tmp_path, f"\n \n\n{comma(FIELDS)}\n{cell}2\n")
    assert message.startswith(f"{tmp_path / 'a.txt'}, line 7: not CSV (field larger than field limit")


def turned_round(line):
    time, *words = line.split()
    return " ".join([time, *words[:3], *(str(-float(word)) for word in words[3:])])


def moved_away(line):
    time, *words = line.split()
    return " ".join([time, *(str(1.5 * float(word)) for word in words[:3]), *words[3:]])


@pytest.mark.parametrize(("change", "said"), [
    (turned_round, "the velocities, 0.2"),  # of two that nearly cancel
    (moved_away, "the positions are passed at "),
])  # fmt: skip
def test_a_state_vector_that_does_not_fit_the_one_before_it_is_told_in_its_own_line(tmp_path, change, said):
    text = with_row(30, change)
    line = text.split("\n").index(next(each for each in text.split("\n") if each.startswith(stamp(1800)))) + 1
    message = no_ephemeris(tmp_path, text)
    assert message.startswith(f"{tmp_path / 'a.txt'}, line {line}: from {stamp(1740)} to {stamp(1800)} {said}")


@pytest.mark.parametrize(("row", "values"), [("EXTRA,", 18), ("", 17)])
def test_a_row_of_more_values_than_columns_is_refused_and_the_rows_before_it_are_counted(tmp_path, row, values):
    first, second = comma(FIELDS).splitlines()
    text = f"{first}\n{second}\n{second}\n{row}{second}\n"
    if values == 17:
        assert len(elements(tmp_path, text)) == 3
    else:
        refused(tmp_path, text, "line 4: 18 values, but the first line names 17 columns; repair it")


@pytest.mark.parametrize("number", ["90000", "90002", "10001"])
def test_lines_of_two_satellites_are_refused_whichever_number_is_larger(tmp_path, number):
    two = edited(LINE_2, 3, number)
    refused(tmp_path, f"{LINE_1}\n{two}", f"line 1 is of catalogue number 90001, the line below it of {number}; put")


@pytest.mark.parametrize("value", ["inf", "+inf", "-inf", "Infinity", "nan", "1e999"])
@pytest.mark.parametrize("key", ["BSTAR", "MEAN_MOTION"])
def test_a_number_without_an_end_is_none_of_an_element_set(tmp_path, key, value):
    refused(tmp_path, comma({**FIELDS, key: value}), f"line 2: {key} is '{value}', not a finite number; write one such")


@pytest.mark.parametrize("time_s", [math.nan, math.inf, -math.inf])
def test_a_time_that_is_no_number_is_refused_as_such_by_elements(tmp_path, time_s):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    words = f"a time is not a finite number; give seconds since {EPOCH.text}"
    for ask in (
        lambda: orbit.states(np.array([0.0, time_s, 7.0])),
        lambda: orbit.require(0.0, time_s),
        lambda: orbit.require(time_s, 0.0),
    ):
        with pytest.raises(OrbitError, match=words):
            ask()


def test_states_before_and_behind_the_days_of_trust_are_each_refused(tmp_path):
    orbit = Sgp4Orbit(elements(tmp_path, NAMED)[0], EPOCH)
    most_s = mean_elements.MOST_ELEMENTS_AGE_S
    first_s, last_s = -most_s - orbit.elements_age_s, most_s - orbit.elements_age_s
    assert np.isfinite(orbit.states(np.array([first_s, last_s])).position_m).all()
    for time_s, words in ((first_s - 1.0, "not valid yet"), (last_s + 1.0, "expired")):
        with pytest.raises(OrbitError, match=f"the elements are {words}: "):
            orbit.states(np.array([0.0, time_s]))


@pytest.mark.parametrize("key", ["CCSDS_OPM_VERS", "CCSDS_AEM_VERS", "ORIGINATOR"])
@pytest.mark.parametrize("version", ["1.0", "2.0", "3.0"])
def test_a_message_of_another_kind_is_no_ephemeris_whatever_its_version(tmp_path, key, version):
    text = HEAD.replace("CCSDS_OEM_VERS = 2.0", f"{key} = {version}") + segment(GRID)
    no_ephemeris(tmp_path, text, f"line 1: the file begins with {key} = '{version}', not with CCSDS_OEM_VERS = 1, 2 or")
    ephemeris(tmp_path, HEAD.replace("2.0", version) + segment(GRID))


def test_objects_of_one_name_or_whose_name_is_anothers_identifier_are_told_apart_by_what_is_left(tmp_path):
    parts = [
        segment(GRID[:40], OBJECT_NAME="Twin", OBJECT_ID="2026-001A"),
        segment(GRID[10:70], OBJECT_NAME="Twin", OBJECT_ID="2026-001B"),
        segment(GRID[40:90], OBJECT_NAME="Twin", OBJECT_ID="2026-001A"),
        segment(GRID[20:50], OBJECT_NAME="2026-001b", OBJECT_ID="2026-001C"),
    ]
    text = HEAD + "".join(parts)
    first = ephemeris(tmp_path, text, name="2026-001a")
    assert (first.name, len(first.segments), first.span_s) == ("Twin", 2, (0.0, GRID[89]))
    only = ephemeris(tmp_path, text, name="2026-001c")
    assert (only.name, len(only.segments), only.span_s) == ("2026-001b", 1, (GRID[20], GRID[49]))
    for name in ("TWIN", "2026-001B"):
        with pytest.raises(OrbitError) as refused:
            ephemeris(tmp_path, text, name=name)
        assert str(refused.value).endswith(
            "it holds the objects Twin (2026-001A), Twin (2026-001B), 2026-001b (2026-001C), "
            f"and {name!r} names 2 of them; name one of them"
        )


def test_of_a_combined_message_the_ephemeris_and_the_elements_are_each_read_without_the_others(tmp_path):
    prolog, ours = oem_xml(GRID).split("\n", 1)
    vector = "".join(f"<{key}>{7000.0 + k}</{key}>" for k, key in enumerate(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")))
    other = (
        '<opm id="CCSDS_OPM_VERS" version="2.0"><header/><body><segment><metadata><OBJECT_NAME>STRANGER</OBJECT_NAME>'
        "<OBJECT_ID>1998-067A</OBJECT_ID><BSTAR>7</BSTAR></metadata><data><stateVector>"
        f"<EPOCH>{stamp(30)}</EPOCH>{vector}</stateVector></data></segment></body></opm>"
    )
    omm = xml(FIELDS).partition("<ndm>")[2].removesuffix("</ndm>")
    for parts in ((other, omm, ours), (ours, other, omm), (omm, ours, other)):
        text = f"{prolog}\n<ndm>{''.join(parts)}</ndm>"
        found = ephemeris(tmp_path, text)
        assert (found.name, found.span_s) == (ephemeris(tmp_path, oem_xml(GRID)).name, (0.0, 6000.0))
        (one,) = elements(tmp_path, text)
        assert (one.name, one.drag_per_earth_radius) == ("EXAMPLE 1", float(FIELDS["BSTAR"]))
    with pytest.raises(OrbitError, match="no element set is in the file; give a TLE or an OMM"):
        elements(tmp_path, f"{prolog}\n<ndm>{other}{ours}</ndm>")
    with pytest.raises(OrbitError, match="no segment of an ephemeris"):
        ephemeris(tmp_path, f"{prolog}\n<ndm>{omm}{other}</ndm>")
