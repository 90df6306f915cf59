"""Sessions written down for others: CSV for a spreadsheet, and a contact plan for delay-tolerant networks."""

import csv
import io
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from microrad.core.units import BLANKS, SPEED_OF_LIGHT_M_S, printable
from microrad.orbit.operations.base import OperationsError, check_number, check_positive, check_span

Utc = Callable[[float], str]
"""ISO 8601 text in UTC, such as 2026-03-20T12:00:00.000Z, of a time in s since the mission's epoch."""

COLUMNS = (
    "satellite",
    "relay",
    "start (UTC)",
    "lock (UTC)",
    "end (UTC)",
    "start (s)",
    "lock (s)",
    "end (s)",
    "smallest range (m)",
    "largest range (m)",
    "rate (bit/s)",
    "volume (bit)",
)
"""Header of `csv_text`."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'")  # the last so that the mark can be taken off again
_LARGEST_RATE_BYTE_S = 2**32 - 1  # ION keeps the rate in 32 bits
_LONGEST_LINE = 200  # characters; ION reads lines of at most 255
_ISO = re.compile(r"(\d{4})-(\d{2})-(\d{2})T(\d{2}:\d{2}:\d{2})(\.\d+)?Z")


@dataclass(frozen=True, slots=True)
class PlannedSession:
    """A session as it is announced: data flows from `locked_s` to `end_s` at `rate_bit_s`.

    `volume_bit` is the data expected, which may be less than rate times duration (outages, an empty store). The
    smallest and the largest range from lock to end are None where they are not known; give both or neither.

    Raises `OperationsError` for times out of order or not finite, a rate or volume that is negative or not finite, a
    name that is empty, and ranges that are not above 0 m, in order, or a pair.
    """

    satellite: str
    relay: str
    start_s: float
    locked_s: float
    end_s: float
    rate_bit_s: float
    volume_bit: float
    range_min_m: float | None = None
    range_max_m: float | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be announced."""
        if not (self.satellite and self.relay):
            raise OperationsError("the satellite or the relay of a session has no name; give both")
        check_span((self.start_s, self.end_s), self._words())
        if not self.start_s <= self.locked_s <= self.end_s:
            raise OperationsError(
                f"{self._words()} runs from {self.start_s:.9g} s to {self.end_s:.9g} s and locks at "
                f"{self.locked_s:.9g} s; give a moment of lock within it"
            )
        check_number(self.rate_bit_s, f"the data rate of {self._words()}", "bit/s")
        check_number(self.volume_bit, f"the volume of {self._words()}", "bit")
        self._check_range()

    def _words(self) -> str:
        return f"the session of {self.satellite!r} with {self.relay!r}"

    def _check_range(self) -> None:
        if self.range_min_m is None and self.range_max_m is None:
            return
        if self.range_min_m is None or self.range_max_m is None:
            raise OperationsError(f"{self._words()} has one of its two ranges; give both or neither")
        check_positive(self.range_min_m, f"the smallest range of {self._words()}", "m")
        check_positive(self.range_max_m, f"the largest range of {self._words()}", "m")
        if self.range_max_m < self.range_min_m:
            raise OperationsError(
                f"the smallest range of {self._words()}, {self.range_min_m:g} m, is more than the largest, "
                f"{self.range_max_m:g} m; exchange them"
            )


def csv_text(sessions: Sequence[PlannedSession], utc: Utc) -> str:
    """One row a session under the header `COLUMNS`, each number with every digit; ranges not known are empty.

    Names are quoted where a comma, quote or new line asks for it. One that begins with =, +, -, @, a tab or a new line
    would be a formula to a spreadsheet: it gets an apostrophe in front, as does a name that begins with one, so that a
    reader who takes off one leading apostrophe has every name as it was.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in sessions:
        times = (one.start_s, one.locked_s, one.end_s)
        ranges = ["" if r is None else _number(r) for r in (one.range_min_m, one.range_max_m)]
        names = (spreadsheet_text(one.satellite), spreadsheet_text(one.relay))
        numbers = (*map(_number, times), *ranges, _number(one.rate_bit_s), _number(one.volume_bit))
        writer.writerow([*names, *map(utc, times), *numbers])
    return buffer.getvalue().rstrip("\n")


def _number(value: float) -> str:
    return repr(float(value))


def spreadsheet_text(name: str) -> str:
    """A name that no spreadsheet takes for a formula; an apostrophe in front can be taken off again.

    What would steer a terminal is spelled out.
    """
    return printable("'" + name if name.startswith(_FORMULA) else name, BLANKS + "\r")


def contact_plan(
    sessions: Sequence[PlannedSession], utc: Utc, *, satellites: Sequence[str] = (), relays: Sequence[str] = ()
) -> str:
    """The sessions as a contact plan that the ION implementation of delay-tolerant networking reads.

    A contact plan in the sense of CCSDS 734.3-B-1 (Schedule-Aware Bundle Routing) lists contacts, each with start,
    end, sending node, receiving node and data rate, and ranges as one-way light times. The standard fixes the content
    and no file. The text here is that of ION, the commands of ionrc(5), ION Open Source, NASA JPL, which `ionadmin`
    executes line by line:

        @ yyyy/mm/dd-hh:mm:ss                           the moment from which +seconds count, UTC
        a contact +start +end from to rate              rate in byte/s, one direction: satellite to relay
        a range +start +end from to one-way-light-time  in light seconds; the first node number the smaller one, so
                                                        that it holds both ways

    Nodes are numbers: first the `satellites` from 1, then the `relays`, in the order given, so that a number does not
    depend on who is served; then satellites and relays that only sessions name, in the order they appear. A comment
    names each (JSON text, cut where the line would be too long for ION). ION reads whole numbers only. So a contact is
    cut inwards to whole seconds, its rate rounded down to whole bytes, and the light time rounded up to whole seconds:
    1 s up to a range of 299 792 km. A session of which nothing is left, or that has no rate, is named in a comment.

    Raises `OperationsError` for a session without ranges, before the epoch or of more than 2^32 - 1 byte/s, two
    sessions of one satellite and relay that overlap, a relay with the name of a satellite, and a `utc` that does not
    give ISO 8601 text that ends in Z.
    """
    reference, shift = _reference(utc(0.0))
    nodes = _nodes(sessions, satellites, relays)
    ordered = sorted(sessions, key=lambda s: (s.start_s, nodes[s.satellite], nodes[s.relay]))
    _check_overlaps(ordered)
    lines = ["# Contact plan: seconds after the reference time, rates in byte/s, one-way light times in s."]
    lines += [f"# node {number} is {json.dumps(name)}"[:_LONGEST_LINE] for name, number in nodes.items()]
    lines.append(f"@ {reference}")
    for one in ordered:
        lines += _commands(one, nodes, shift)
    return "\n".join(lines)


def _reference(text: str) -> tuple[str, float]:
    """The whole second of the epoch as ION writes it, and how far into it the epoch is."""
    found = _ISO.fullmatch(text)
    if found is None:
        raise OperationsError(f"the epoch reads {text!r}; give UTC as in 2026-03-20T12:00:00.000Z")
    year, month, day, clock, fraction = found.groups()
    return f"{year}/{month}/{day}-{clock}", float(fraction or 0.0)


def _nodes(sessions: Sequence[PlannedSession], satellites: Sequence[str], relays: Sequence[str]) -> dict[str, int]:
    served, serving = [s.satellite for s in sessions], [s.relay for s in sessions]
    below = {*satellites, *served}
    both = [name for name in (*relays, *serving) if name in below]
    if both:
        raise OperationsError(f"{both[0]!r} is named as a satellite and as a relay; give it one role")
    names = dict.fromkeys((*satellites, *relays, *served, *serving))
    return {name: number for number, name in enumerate(names, start=1)}


def _check_overlaps(ordered: Sequence[PlannedSession]) -> None:
    until: dict[tuple[str, str], float] = {}
    for one in ordered:
        pair = (one.satellite, one.relay)
        if one.start_s < until.get(pair, -math.inf):
            raise OperationsError(
                f"two sessions of {one.satellite!r} with {one.relay!r} overlap: one starts at {one.start_s:.9g} s, the "
                f"other ends at {until[pair]:.9g} s; a contact plan has one at a time"
            )
        until[pair] = one.end_s


def _commands(one: PlannedSession, nodes: dict[str, int], shift: float) -> list[str]:
    """The contact of a session and its range, or the comment that there is none."""
    pair = f"{nodes[one.satellite]} {nodes[one.relay]}"
    if one.range_max_m is None:
        raise OperationsError(
            f"the session of {one.satellite!r} with {one.relay!r} at {one.start_s:.9g} s has no range; a contact plan "
            "needs its one-way light time: give the smallest and the largest range"
        )
    if one.start_s < 0.0:
        raise OperationsError(
            f"the session of {one.satellite!r} with {one.relay!r} starts {-one.start_s:.9g} s before the epoch; "
            "a contact plan counts from the epoch: move the epoch before the first session"
        )
    start, end = math.ceil(one.locked_s + shift), math.floor(one.end_s + shift)
    rate = math.floor(one.rate_bit_s / 8.0)
    if rate > _LARGEST_RATE_BYTE_S:
        raise OperationsError(
            f"the session of {one.satellite!r} with {one.relay!r} has {one.rate_bit_s:g} bit/s; ION takes at most "
            f"{8 * _LARGEST_RATE_BYTE_S:g} bit/s"
        )
    if end <= start or rate == 0:
        why = "no whole byte a second" if rate == 0 else "no whole second with data"
        return [f"# left out, {why}: {pair} from {one.locked_s:.3f} s to {one.end_s:.3f} s"]
    light_s = math.ceil(one.range_max_m / SPEED_OF_LIGHT_M_S)
    return [f"a contact +{start} +{end} {pair} {rate}", f"a range +{start} +{end} {pair} {light_s}"]
