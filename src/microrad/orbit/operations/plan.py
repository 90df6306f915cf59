"""Sessions written down for others: CSV for a spreadsheet, and a contact plan for delay-tolerant networks."""

import csv
import io
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from microrad.core.units import BLANKS, SPEED_OF_LIGHT_M_S, printable
from microrad.orbit.base import OperationsError

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


@dataclass(frozen=True, slots=True)
class PlannedSession:
    """A session as it is announced: data flows from `locked_s` to `end_s` at `rate_bit_s`.

    `relay` is the name of a relay or of a ground station. `volume_bit` is the data expected, which may be less than
    rate times duration (outages, clouds, an empty store). The ranges are the smallest and the largest from lock to end.
    """

    satellite: str
    relay: str
    start_s: float
    locked_s: float
    end_s: float
    rate_bit_s: float
    volume_bit: float
    range_min_m: float
    range_max_m: float


def csv_text(sessions: Sequence[PlannedSession], utc: Utc) -> str:
    """One row a session under the header `COLUMNS`, each number with every digit.

    Names are quoted where a comma, quote or new line asks for it. One that begins with =, +, -, @, a tab or a new line
    would be a formula to a spreadsheet: it gets an apostrophe in front, as does a name that begins with one, so that a
    reader who takes off one leading apostrophe has every name as it was.

    Args:
        sessions: The sessions, in the order of their rows.
        utc: Gives the UTC text of a time in s since the mission's epoch.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in sessions:
        times = (one.start_s, one.locked_s, one.end_s)
        names = (spreadsheet_text(one.satellite), spreadsheet_text(one.relay))
        numbers = (*times, one.range_min_m, one.range_max_m, one.rate_bit_s, one.volume_bit)
        writer.writerow([*names, *map(utc, times), *(repr(float(each)) for each in numbers)])
    return buffer.getvalue().rstrip("\n")


def spreadsheet_text(name: str) -> str:
    """A name that no spreadsheet takes for a formula; an apostrophe in front can be taken off again.

    What would steer a terminal is spelled out.
    """
    return printable("'" + name if name.startswith(_FORMULA) else name, BLANKS + "\r")


def contact_plan(sessions: Sequence[PlannedSession], utc: Utc, satellites: Sequence[str], relays: Sequence[str]) -> str:
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
    depend on who is served. A comment names each (JSON text, cut where the line would be too long for ION). ION reads
    whole numbers only. So a contact is cut inwards to whole seconds, its rate rounded down to whole bytes, and the
    light time rounded up to whole seconds: 1 s up to a range of 299 792 km. A session of which nothing is left, or that
    has no rate, is named in a comment.

    Args:
        sessions: The sessions, in any order.
        utc: Gives the UTC text of a time in s since the mission's epoch.
        satellites: Names of all satellites, numbered from 1 in this order.
        relays: Names of all relays and ground stations, numbered behind the satellites.

    Raises:
        OperationsError: For a session of more than 2^32 - 1 byte/s.
    """
    day, clock = utc(0.0).removesuffix("Z").split("T")
    nodes = {name: number for number, name in enumerate((*satellites, *relays), start=1)}
    lines = ["# Contact plan: seconds after the reference time, rates in byte/s, one-way light times in s."]
    lines += [f"# node {number} is {json.dumps(name)}"[:_LONGEST_LINE] for name, number in nodes.items()]
    lines.append(f"@ {day.replace('-', '/')}-{clock[:8]}")
    for one in sorted(sessions, key=lambda s: (s.start_s, nodes[s.satellite], nodes[s.relay])):
        lines += _commands(one, nodes, float("0" + clock[8:]))
    return "\n".join(lines)


def _commands(one: PlannedSession, nodes: dict[str, int], shift: float) -> list[str]:
    """The contact of a session and its range, or the comment that there is none."""
    pair = f"{nodes[one.satellite]} {nodes[one.relay]}"
    start, end = math.ceil(one.locked_s + shift), math.floor(one.end_s + shift)
    rate = math.floor(one.rate_bit_s / 8.0)
    if rate > _LARGEST_RATE_BYTE_S:
        raise OperationsError(
            f"the session of {one.satellite!r} with {one.relay!r} has {one.rate_bit_s:.0f} bit/s; ION takes at "
            f"most {8 * _LARGEST_RATE_BYTE_S} bit/s"
        )
    if end <= start or rate == 0:
        why = "no whole byte a second" if rate == 0 else "no whole second with data"
        return [f"# left out, {why}: {pair} from {one.locked_s:.3f} s to {one.end_s:.3f} s"]
    light_s = math.ceil(one.range_max_m / SPEED_OF_LIGHT_M_S)
    return [f"a contact +{start} +{end} {pair} {rate}", f"a range +{start} +{end} {pair} {light_s}"]
