"""Ephemeris files: CCSDS Orbit Ephemeris Message (OEM), versions 1 to 3, as keywords and values (KVN) or as XML.

State vectors are turned into TEME once, when the file is read, and interpolated between them as the file asks. Frames
are the Earth-fixed ITRF, the inertial EME2000, GCRF and ICRF, and TOD; precession and nutation are those of skyfield,
polar motion is neglected. Source: CCSDS 502.0-B-3, Orbit Data Messages, section 5.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.earth import MU_M3_S2, ROTATION_RAD_S
from microrad.orbit.base import OrbitError, States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.files import messages
from microrad.orbit.propagation.ephemeris import SLACK_S, EphemerisOrbit, Segment

DEFAULT_DEGREE = 7
"""Degree of the Hermite interpolation of a file that names no method: four state vectors around each time."""
DEGREES = (3, 25)
"""Degrees of interpolation that are taken: below, the track between points is not an orbit's; above, rounding grows."""

MOST_STEPS = 10.0
"""Longest step between two state vectors that is interpolated over, in median steps of their segment."""

FRAMES = re.compile(r"TEME|TOD|EME2000|GCRF\d*|ICRF\d*|ITRF-?\d*")
"""Names of the frames that are read, as `frame_name` gives them."""

_KNOT_S = 10800.0  # between two rotations of a frame; nutation changes over days
_KNOTS_AT_ONCE = 2048  # bounds the memory that the series of nutation takes
_ALIASES = {"TEMEOFDATE": "TEME", "J2000": "EME2000", "TOD_EARTH": "TOD"}
_RADII_M = (6_356_000.0, 1.5e9)  # from the surface at the poles to where the Earth's gravity ceases to lead
_LARGEST = 1e300  # number in a file: in m and m/s it is still one
_REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
_COLUMNS = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")


@dataclass(slots=True)
class _Draft:
    """A segment as it is read: its metadata, and a place, a time and six numbers for each state vector."""

    place: str
    metadata: dict[str, messages.Field] = field(default_factory=dict)
    places: list[str] = field(default_factory=list)
    times: list[str] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)

    def add(self, path: Path, place: str, time: str, words: list[str]) -> None:
        """Take a state vector.

        Args:
            path: The file, for messages.
            place: Where in the file it stands, such as "line 12".
            time: Its time code.
            words: Position in km, velocity in km/s and, where there is one, acceleration, three numbers each.

        Raises:
            OrbitError: For too many or too few words, and what is not a number.
        """
        if len(words) not in (6, 9):
            raise OrbitError(
                f"{path}, {place}: {len(words) + 1} columns; a state vector has a time, three of position in km and "
                "three of velocity in km/s, and may have three of acceleration"
            )
        words = words[:6]
        try:
            numbers = [float(word) for word in words if "_" not in word]
        except ValueError:
            numbers = []
        if len(numbers) < len(words):
            numbers = [
                messages.finite(path, messages.Field(key, w, "", place))
                for key, w in zip(_COLUMNS, words, strict=False)
            ]
        self.places.append(place)
        self.times.append(time)
        self.values.append(numbers)


def read_oem(path: Path, epoch: Epoch, name: str | None = None, data: bytes | None = None) -> EphemerisOrbit:
    """The orbit of an object from a CCSDS OEM, KVN or XML.

    Time systems: UTC, TAI, TT, GPS. Frames: TEME, TOD, EME2000 (J2000), GCRF, ICRF, and ITRF without polar motion;
    velocities of ITRF gain the Earth's rotation. Interpolation: LAGRANGE (degree + 1 state vectors) or HERMITE ((degree
    + 1) / 2, rounded up); Hermite of degree 7 when the file names none. Covariances and accelerations are passed over.

    Args:
        path: The file.
        epoch: The epoch of the mission, from which the orbit's times count.
        name: Name or identifier of the object; None where the file has only one.
        data: The bytes of the file, where it was read already; it is then not read again.

    Raises:
        OrbitError: For all else, with file, line and value; for a hole within the usable times of a segment (a step of
            more than `MOST_STEPS` median ones); and for velocities that are not those of the positions.
    """
    text = messages.read_text(path, data)
    drafts = list(_xml_drafts(path, text) if text.lstrip().startswith("<") else _kvn_drafts(path, text))
    if not drafts:
        raise OrbitError(
            f"{path}: no segment of an ephemeris (META_START to META_STOP, or <segment>) is in the file; give a CCSDS "
            "OEM, and element sets (TLE, OMM) by their own key"
        )
    for draft in drafts:
        _check_metadata(path, draft)
    chosen = _of_object(path, drafts, name)
    segments = tuple(_segment(path, draft, epoch) for draft in chosen)
    for (one, two), draft in zip(pairwise(segments), chosen[1:], strict=True):
        if two.start_s < one.stop_s - SLACK_S:
            raise OrbitError(
                f"{path}, {draft.place}: this segment may be used from {epoch.utc(two.start_s)}, but the one before "
                f"it until {epoch.utc(one.stop_s)}, so the orbit is stated twice; sort the segments by time and let "
                "USEABLE_START_TIME and USEABLE_STOP_TIME meet"
            )
    return EphemerisOrbit(chosen[0].metadata["OBJECT_NAME"].value, epoch, segments, str(path))


def _kvn_drafts(path: Path, text: str) -> Iterator[_Draft]:
    """The segments of a text in keywords and values."""
    moves = {
        ("head", "META_START"): "meta", ("data", "META_START"): "meta", ("meta", "META_STOP"): "data",
        ("data", "COVARIANCE_START"): "covariance", ("covariance", "COVARIANCE_STOP"): "data",
    }  # fmt: skip
    block, draft, header = "head", _Draft(""), dict[str, messages.Field]()
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        if not words or words[0] == "COMMENT":
            continue
        if len(words) == 1 and words[0] in {marker for _, marker in moves}:
            if (block, words[0]) not in moves:
                raise OrbitError(f"{path}, line {number}: {words[0]} has no place here; repair the order of the blocks")
            block = moves[block, words[0]]
            if block == "meta":
                if draft.place:
                    yield draft
                draft = _Draft(f"line {number}")
        elif block == "head":
            messages.add_field(header, messages.kvn_field(path, number, line), path)
            first = next(iter(header.values()))
            if first.key != "CCSDS_OEM_VERS" or first.value.partition(".")[0] not in ("1", "2", "3"):
                raise OrbitError(
                    f"{path}, {first.place}: the file begins with {first.key} = {first.shown}, not with CCSDS_OEM_VERS "
                    "= 1, 2 or 3; give a CCSDS Orbit Ephemeris Message"
                )
        elif block == "meta":
            messages.add_field(draft.metadata, messages.kvn_field(path, number, line), path)
        elif block == "data":
            draft.add(path, f"line {number}", words[0], words[1:])
    if block in ("meta", "covariance"):
        raise OrbitError(
            f"{path}: the file ends before {block.upper()}_STOP; it is cut off: download or export it again"
        )
    if draft.place:
        yield draft


def _xml_drafts(path: Path, text: str) -> Iterator[_Draft]:
    """The segments of a text in XML."""
    draft: _Draft | None = None
    row: dict[str, messages.Field] | None = None
    container: list[str] = []
    for given in messages.xml_fields(path, text):
        if given.key.startswith("</"):
            container.pop()
            if given.key == "</stateVector" and draft is not None and row is not None:
                _xml_row(path, draft, row, given.place)
                row = None
            elif given.key == "</segment" and draft is not None:
                yield draft
                draft = None
        elif given.key.startswith("<"):
            container.append(given.key[1:])
            if given.key == "<oem":
                messages.check_version(path, given, "CCSDS_OEM_VERS")
            if given.key == "<segment" and "oem" in container:
                draft = _Draft(given.place)
            elif given.key == "<stateVector" and draft is not None:
                row = {}
        elif row is not None:
            messages.add_field(row, given, path)
        elif draft is not None and container[-1] == "metadata":
            messages.add_field(draft.metadata, given, path)


def _xml_row(path: Path, draft: _Draft, row: dict[str, messages.Field], place: str) -> None:
    for key in ("EPOCH", *_COLUMNS):
        unit = "" if key == "EPOCH" else "km/s" if key.endswith("DOT") else "km"
        if key not in row:
            raise OrbitError(f"{path}, {place}: {key} is missing in this stateVector; add it")
        if row[key].unit not in ("", unit):
            raise OrbitError(
                f"{path}, {row[key].place}: {key} is in {row[key].unit!r}; an OEM has it in {unit!r}: convert the file"
            )
    draft.add(path, place, row["EPOCH"].value, [row[key].value for key in _COLUMNS])


def _check_metadata(path: Path, draft: _Draft) -> None:
    """Raises OrbitError for a segment whose keys are missing, or whose centre, time system or frame is not read."""
    given = draft.metadata
    for key in _REQUIRED:
        if not given.get(key, messages.Field(key, "", "", "")).value:
            raise OrbitError(f"{path}, {draft.place}: {key} is missing in this segment's metadata; add it")
    for key, read, allowed in (
        ("CENTER_NAME", given["CENTER_NAME"].value.upper() == "EARTH", "EARTH"),
        ("TIME_SYSTEM", _system(given) in messages.TIME_SYSTEMS, "UTC, TAI, TT, GPS"),
        ("REF_FRAME", FRAMES.fullmatch(_frame(given)), "TEME, TOD, EME2000, GCRF, ICRF, ITRF"),
    ):
        if not read:
            raise given[key].refused(path, f"; read are {allowed}: export one of these")
    if "REF_FRAME_EPOCH" in given and _frame(given) in ("TEME", "TOD"):
        raise OrbitError(
            f"{path}, {given['REF_FRAME_EPOCH'].place}: REF_FRAME_EPOCH holds {_frame(given)} still at "
            f"{given['REF_FRAME_EPOCH'].value}, and only the frame of date is read; export in EME2000 or GCRF"
        )


def _system(metadata: dict[str, messages.Field]) -> str:
    return metadata["TIME_SYSTEM"].value.upper()


def _frame(metadata: dict[str, messages.Field]) -> str:
    return frame_name(metadata["REF_FRAME"].value)


def _of_object(path: Path, drafts: list[_Draft], name: str | None) -> list[_Draft]:
    """The segments of the object that is meant."""
    objects = {(d.metadata["OBJECT_NAME"].value, d.metadata["OBJECT_ID"].value): d for d in drafts}
    keys = [key for key in objects if name is None or name.casefold() in (key[0].casefold(), key[1].casefold())]
    if len(keys) != 1:
        listed = ", ".join(f"{n} ({i})" for n, i in list(objects)[:8]) + (" and others" if len(objects) > 8 else "")
        wanted = "no object is named" if name is None else f"{name!r} names {len(keys)} of them"
        raise OrbitError(f"{path}: it holds the objects {listed}, and {wanted}; name one of them")
    return [d for d in drafts if (d.metadata["OBJECT_NAME"].value, d.metadata["OBJECT_ID"].value) == keys[0]]


def _segment(path: Path, draft: _Draft, epoch: Epoch) -> Segment:
    """A segment in seconds of the mission and in TEME."""
    system = _system(draft.metadata)
    instants = [
        messages.plain_instant(t) or messages.instant(path, messages.Field("the epoch", t, "", p), system)
        for t, p in zip(draft.times, draft.places, strict=True)
    ]
    method, points = _method(path, draft)
    time = messages.elapsed_s(system, epoch, instants, f"{path}, {draft.place}")
    _check_rows(path, draft, time)
    values = 1000.0 * np.array(draft.values).T
    states = to_teme(_frame(draft.metadata), epoch, time, values)
    start, stop = _usable(path, draft, epoch, time)
    _check_holes(path, draft, time, (start, stop))
    _check_velocities(path, draft, time, states)
    return Segment(time, states.position_m, states.velocity_m_s, method, points, start, stop)


def _check_rows(path: Path, draft: _Draft, time: Floats) -> None:
    """Raises OrbitError for numbers that are not finite, times that do not rise, distances that no satellite has."""
    values = np.array(draft.values)
    bad = np.flatnonzero(~np.all(np.abs(values) < _LARGEST, axis=1))
    if bad.size:
        raise OrbitError(
            f"{path}, {draft.places[bad[0]]}: the state vector at {draft.times[bad[0]]} holds nan, inf or a number "
            f"beyond {_LARGEST:g}; remove or repair it"
        )
    fallen = np.flatnonzero(np.diff(time) <= 0.0)
    if fallen.size:
        k = int(fallen[0]) + 1
        raise OrbitError(
            f"{path}, {draft.places[k]}: the epoch {draft.times[k]} does not come after {draft.times[k - 1]} "
            f"({draft.places[k - 1]}); sort the state vectors by time, each once"
        )
    with np.errstate(over="ignore"):
        radius = 1000.0 * np.linalg.norm(values[:, :3], axis=1)
    bad = np.flatnonzero((radius < _RADII_M[0]) | (radius > _RADII_M[1]))
    if bad.size:
        raise OrbitError(
            f"{path}, {draft.places[bad[0]]}: {radius[bad[0]] / 1000.0:.6g} km from the Earth's centre, where no "
            "satellite of the Earth is; positions are in km and velocities in km/s"
        )


def _check_velocities(path: Path, draft: _Draft, time: Floats, states: States) -> None:
    """Raises OrbitError for velocities that are not those of the positions, and steps that no satellite can make.

    On a circle of which a step covers the angle 2 x, half the sum of the velocities at its ends is the mean velocity
    between them times x / tan x. Three times what that leaves, at the largest rate that a satellite has at this
    distance (a parabola's at its perigee), is allowed for, and 1 % of the mean velocity; at most 90 % of it, so that
    no turned sign and no other unit passes where steps are long. Steps over a hole say nothing.
    """
    step = np.diff(time)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.diff(states.position_m) / step
        speed = np.linalg.norm(mean, axis=0)
        stated = 0.5 * (states.velocity_m_s[:, 1:] + states.velocity_m_s[:, :-1])
        off = np.linalg.norm(stated - mean, axis=0)
        told = np.linalg.norm(stated, axis=0)
    radius = np.linalg.norm(states.position_m, axis=0)
    nearest = np.minimum(radius[1:], radius[:-1])
    fastest = np.sqrt(2.0 * MU_M3_S2 / nearest)
    half = np.minimum(0.5 * step * fastest / nearest, 1.5)
    allowed = np.minimum(0.01 + 3.0 * (1.0 - half / np.tan(half)), 0.9)
    near = step <= MOST_STEPS * float(np.median(step))
    if (bad := np.flatnonzero(near & (speed > 1.5 * fastest))).size:
        k = int(bad[0])
        why = (
            f"the positions are passed at {speed[k] / 1e3:.6g} km/s, and a satellite of the Earth has at most "
            f"{fastest[k] / 1e3:.3g} there; find the position, or the time, that is wrong"
        )
    elif (bad := np.flatnonzero(near & ~(off <= allowed * speed))).size:
        k = int(bad[0])
        why = (
            f"the velocities, {told[k] / 1e3:.6g} km/s in the mean, are not those at which the positions are passed, "
            f"{speed[k] / 1e3:.6g} km/s; velocities are in km/s, in the frame of the positions"
        )
    else:
        return
    raise OrbitError(f"{path}, {draft.places[k + 1]}: from {draft.times[k]} to {draft.times[k + 1]} {why}")


def _check_holes(path: Path, draft: _Draft, time: Floats, usable: tuple[float, float]) -> None:
    """Raises OrbitError for a segment that would be interpolated over a hole between its state vectors."""
    step = np.diff(time)
    median = float(np.median(step))
    used = (time[1:] > usable[0] + SLACK_S) & (time[:-1] < usable[1] - SLACK_S)
    holes = np.flatnonzero(used & (step > MOST_STEPS * median))
    if holes.size:
        k = int(holes[0])
        raise OrbitError(
            f"{path}, {draft.places[k + 1]}: no state vector between {draft.times[k]} ({draft.places[k]}) and "
            f"{draft.times[k + 1]}, {step[k]:.6g} s apart, where the usual step of the segment is {median:.6g} s; over "
            "such a hole the orbit is not known: split the segment into two there, or take a file without the hole"
        )


def _method(path: Path, draft: _Draft) -> tuple[str, int]:
    """The method of interpolation and how many state vectors it takes."""
    given = draft.metadata
    method = given.get("INTERPOLATION", messages.Field("INTERPOLATION", "HERMITE", "", draft.place))
    degree = given.get("INTERPOLATION_DEGREE")
    if "INTERPOLATION" in given and degree is None:
        raise OrbitError(f"{path}, {method.place}: INTERPOLATION stands without INTERPOLATION_DEGREE; add the degree")
    kind = method.value.upper()
    if kind not in ("HERMITE", "LAGRANGE"):
        why = "other curves miss it by kilometres or jump in velocity: export with one of these"
        raise method.refused(path, f"; an orbit is read with HERMITE or LAGRANGE, because {why}")
    number = DEFAULT_DEGREE if degree is None else messages.finite(path, degree)
    if degree is not None and not (number == int(number) and DEGREES[0] <= number <= DEGREES[1]):
        raise degree.refused(path, f"; take a whole number from {DEGREES[0]} to {DEGREES[1]}")
    points = int(number) + 1 if kind == "LAGRANGE" else (int(number) + 2) // 2
    if len(draft.times) < points:
        raise OrbitError(
            f"{path}, {draft.place}: {len(draft.times)} state vectors in this segment, too few for {kind} "
            f"interpolation of degree {int(number)}, which takes {points}; add state vectors or lower "
            "INTERPOLATION_DEGREE"
        )
    return kind, points


def _usable(path: Path, draft: _Draft, epoch: Epoch, time: Floats) -> tuple[float, float]:
    """The usable times, those of the metadata as far as state vectors reach."""
    given, system = draft.metadata, _system(draft.metadata)
    ends = [given.get(f"USEABLE_{key}", given[key]) for key in ("START_TIME", "STOP_TIME")]
    start, stop = (
        float(messages.elapsed_s(system, epoch, [messages.instant(path, end, system)], f"{path}, {end.place}")[0])
        for end in ends
    )
    usable = max(start, float(time[0])), min(stop, float(time[-1]))
    if usable[1] <= usable[0]:
        raise OrbitError(
            f"{path}, {ends[1].place}: the usable span from {ends[0].value} to {ends[1].value} has nothing in common "
            f"with the state vectors, {draft.times[0]} to {draft.times[-1]}; correct {ends[0].key} and {ends[1].key}"
        )
    return usable


# -------------------------------------------------------------------------------------------------------------- frames
def frame_name(text: str) -> str:
    """The name of a frame in capitals without spaces, other names for the same frame replaced."""
    name = text.upper().replace(" ", "")
    return _ALIASES.get(name, name)


def to_teme(frame: str, epoch: Epoch, time: Floats, values: Floats) -> States:
    """States turned into TEME; the velocity is the rate of the coordinates there.

    Args:
        frame: The frame in which they are given, one of `FRAMES`.
        epoch: Instant from which the times count.
        time: Times after the epoch, s, rising, shape (n,).
        values: Position in m, then velocity in m/s, shape (6, n).

    Raises:
        OrbitError: For a time outside the tables of `Epoch`, in a frame that turns with the Earth.
    """
    position, velocity = values[:3], values[3:]
    if frame == "TEME":
        return States(position, velocity)
    if frame.startswith("ITRF"):
        return _from_earth_fixed(epoch.earth_rotation_rad(time), position, velocity)
    matrix, rate = _rotations(frame, epoch, time)
    turn = "nij,jn->in"
    moved = np.einsum(turn, matrix, velocity) + np.einsum(turn, rate, position)
    return States(np.einsum(turn, matrix, position), moved)


def _from_earth_fixed(angle: Floats, position: Floats, velocity: Floats) -> States:
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = position
    vx, vy, vz = velocity[0] - ROTATION_RAD_S * y, velocity[1] + ROTATION_RAD_S * x, velocity[2]
    return States(np.array([c * x - s * y, s * x + c * y, z]), np.array([c * vx - s * vy, s * vx + c * vy, vz]))


def _rotations(frame: str, epoch: Epoch, time: Floats) -> tuple[Floats, Floats]:
    """Matrices from `frame` to TEME and their rates, each of shape (n, 3, 3), by splines between knots."""
    from scipy.interpolate import CubicSpline
    from skyfield.api import load

    first, last = float(time[0]), float(time[-1])
    knots = np.linspace(first, last, max(4, math.ceil((last - first) / _KNOT_S) + 1))
    scale = load.timescale(builtin=True)
    days = 2451545.0 + 36525.0 * epoch.terrestrial_centuries(knots)
    parts = [
        _matrices(frame, scale.tt_jd(part)) for part in np.array_split(days, math.ceil(days.size / _KNOTS_AT_ONCE))
    ]
    spline = CubicSpline(knots, np.concatenate(parts))
    return spline(time), spline(time, 1)


def _matrices(frame: str, instants: object) -> Floats:
    """From `frame` to TEME at instants of skyfield; shape (n, 3, 3)."""
    from skyfield.framelib import ICRS_to_J2000, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME

    from_gcrf = np.moveaxis(TEME.rotation_at(instants), -1, 0)
    if frame == "EME2000":
        turned: Floats = from_gcrf @ ICRS_to_J2000.T
    elif frame == "TOD":
        turned = from_gcrf @ np.moveaxis(true_equator_and_equinox_of_date.rotation_at(instants), -1, 0).swapaxes(1, 2)
    else:
        turned = from_gcrf
    return turned
