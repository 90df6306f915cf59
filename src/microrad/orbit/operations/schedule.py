"""A constellation shares the terminals of its relays: who is served when, and how evenly."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats, Integers


@dataclass(frozen=True, slots=True, eq=False)
class Opportunities:
    """Spans in which a satellite could use a relay, all of shape (n,), in order of `start_s`; indices count from 0.

    Two spans of one satellite and relay do not overlap.
    """

    satellite: Integers
    relay: Integers
    start_s: Floats
    end_s: Floats


@dataclass(frozen=True, slots=True)
class Rules:
    """How a terminal is shared; each duration counts from the start of a session, its overhead in it.

    `overhead_s` is slew and acquisition: the terminal is busy and no data flows. After `longest_s` a session ends if
    another satellite waits for that relay then, else it goes on for as long again. A session that the geometry would
    end before `shortest_s` is not begun. `overhead_s` < `shortest_s` <= `longest_s`, which may be inf.
    """

    overhead_s: float
    shortest_s: float
    longest_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Sessions:
    """Sessions in order of their start, all of shape (n,): data flows from `locked_s` to `end_s`.

    `terminal` counts from 0 on each relay.
    """

    satellite: Integers
    relay: Integers
    terminal: Integers
    start_s: Floats
    locked_s: Floats
    end_s: Floats


_Waiting = tuple[float, float, int, int]  # end of the last data, data so far in s, satellite, opportunity


class _Plan:
    """The state while the schedule is built; every list is indexed by satellite, relay or session.

    A satellite's places in the queues are not taken out when it is served: a place is good only while its satellite is
    unserved and has had no data since. So each place is pushed and popped once.
    """

    def __init__(
        self, opportunities: Opportunities, satellites: int, terminals: Sequence[int], rules: Rules, start_s: float
    ) -> None:
        self.rules = rules
        self.satellite: list[int] = opportunities.satellite.tolist()
        self.relay: list[int] = opportunities.relay.tolist()
        self.end: list[float] = opportunities.end_s.tolist()
        self.last_data = [start_s] * satellites
        self.data_s = [0.0] * satellites  # had so far
        self.served = [False] * satellites
        self.visible: list[list[int]] = [[] for _ in range(satellites)]  # opportunities under way
        self.queue: list[list[_Waiting]] = [[] for _ in terminals]
        self.free = [list(range(count)) for count in terminals]
        self.events: list[tuple[float, int, int, int]] = []  # time, relay, terminal, session
        self.rows: list[list[float]] = []  # satellite, relay, terminal, start, end
        self.until: list[float] = []  # end of each session's opportunity

    def see(self, opportunity: int) -> int:
        """An opportunity begins; its relay."""
        satellite, relay = self.satellite[opportunity], self.relay[opportunity]
        self.visible[satellite].append(opportunity)
        if not self.served[satellite]:
            self.wait(satellite, opportunity)
        return relay

    def wait(self, satellite: int, opportunity: int) -> None:
        """A satellite takes a place in the queue of its opportunity's relay.

        Args:
            satellite: Its number.
            opportunity: Number of the opportunity under way.
        """
        place = (self.last_data[satellite], self.data_s[satellite], satellite, opportunity)
        heapq.heappush(self.queue[self.relay[opportunity]], place)

    def next_waiting(self, relay: int, now: float) -> _Waiting | None:
        """The place of the satellite that has waited longest and has time enough left, or None.

        Places that are no longer good are taken out of the queue.

        Args:
            relay: Number of the relay.
            now: The moment, s.
        """
        queue = self.queue[relay]
        while queue:
            last, _, satellite, opportunity = queue[0]
            current = not self.served[satellite] and self.last_data[satellite] == last
            if current and self.end[opportunity] - now >= self.rules.shortest_s:
                return queue[0]
            heapq.heappop(queue)
        return None

    def begin(self, relay: int, terminal: int, now: float) -> None:
        """The satellite at the head of the queue takes a terminal.

        Args:
            relay: Number of the relay.
            terminal: Number of its terminal.
            now: The moment, s.
        """
        _, _, satellite, opportunity = heapq.heappop(self.queue[relay])
        self.served[satellite] = True
        self.rows.append([satellite, relay, terminal, now, now])
        self.until.append(self.end[opportunity])
        self.watch(len(self.rows) - 1, now)

    def watch(self, session: int, now: float) -> None:
        """Note when a session is to be looked at next: at its longest, or where the geometry ends it.

        Args:
            session: Number of the session.
            now: The moment from which its longest counts, s.
        """
        _, relay, terminal, _, _ = self.rows[session]
        heapq.heappush(
            self.events, (min(now + self.rules.longest_s, self.until[session]), int(relay), int(terminal), session)
        )

    def finish(self, session: int, now: float) -> set[int]:
        """End a session; its satellite waits wherever it is visible. The relays where it does are returned.

        Args:
            session: Number of the session.
            now: The moment, s.
        """
        satellite = int(self.rows[session][0])
        self.rows[session][4] = now
        self.data_s[satellite] += now - self.rows[session][3] - self.rules.overhead_s
        self.served[satellite], self.last_data[satellite] = False, now
        self.visible[satellite] = [o for o in self.visible[satellite] if self.end[o] > now]
        for opportunity in self.visible[satellite]:
            self.wait(satellite, opportunity)
        return {self.relay[o] for o in self.visible[satellite]}

    def release(self, session: int) -> int:
        """The terminal of a session is free; its relay."""
        _, relay, terminal, _, _ = self.rows[session]
        heapq.heappush(self.free[int(relay)], int(terminal))
        return int(relay)

    def fill(self, relays: set[int], now: float) -> None:
        """Free terminals take who has waited longest, the lowest relay and terminal first.

        Args:
            relays: Numbers of the relays to look at.
            now: The moment, s.
        """
        for relay in sorted(relays):
            while self.free[relay] and self.next_waiting(relay, now) is not None:
                self.begin(relay, heapq.heappop(self.free[relay]), now)

    def reconsider(self, session: int, now: float) -> set[int]:
        """A session has had its longest: another takes its terminal, or it goes on. The relays concerned are returned.

        Args:
            session: Number of the session.
            now: The moment, s.
        """
        _, relay, terminal, _, _ = self.rows[session]
        if self.next_waiting(int(relay), now) is None:
            self.watch(session, now)
            return set()
        self.begin(int(relay), int(terminal), now)
        return self.finish(session, now)

    def at(self, now: float, begins: list[int]) -> None:
        """Everything that happens at one moment: ends, begins, free terminals, then sessions at their longest.

        Args:
            now: The moment, s.
            begins: Numbers of the opportunities that begin then.
        """
        due = []
        while self.events and self.events[0][0] == now:
            due.append(heapq.heappop(self.events)[3])
        over = [s for s in due if self.until[s] <= now]
        concerned = {relay for s in over for relay in (self.finish(s, now) | {self.release(s)})}
        concerned |= {self.see(opportunity) for opportunity in begins}
        self.fill(concerned, now)
        cut: set[int] = set()
        for session in due:
            if self.until[session] > now:
                cut |= self.reconsider(session, now)
        self.fill(cut, now)


def schedule(
    opportunities: Opportunities,
    satellites: int,
    relays: int,
    terminals: int | Sequence[int],
    rules: Rules,
    start_s: float,
) -> Sessions:
    """Share the terminals of the relays among satellites of one terminal each, by a fixed rule.

    A free terminal takes, of the satellites in view that are unserved and have `rules.shortest_s` left there, the one
    whose last data ended longest ago; one never served has waited since the start. Ties go to the one that has had the
    least data so far, then to the lowest index of the satellite, the relay and the terminal: by index alone, those cut
    at the same moment would come round unevenly. A terminal never idles while such a satellite is in view. A session
    that has had its longest ends if another satellite waits for its relay at that moment, else it goes on for as long
    again; the satellite that leaves may take a terminal that is free elsewhere. The same input gives the same schedule;
    the effort grows as the number of opportunities and sessions.

    This is a rule that is fair and simple to announce, not the schedule of the most data.

    Args:
        opportunities: When each satellite could use each relay, in order of their start.
        satellites: Number of satellites.
        relays: Number of relays, ground stations among them.
        terminals: Number of terminals on each relay, one for all or one for each.
        rules: How a terminal is shared.
        start_s: Start of the span, s.
    """
    each = [terminals] * relays if isinstance(terminals, int) else terminals
    plan = _Plan(opportunities, satellites, each, rules, start_s)
    starts, place = opportunities.start_s.tolist(), 0
    while place < len(starts) or plan.events:
        first, now = place, min([*starts[place : place + 1], *(event[0] for event in plan.events[:1])])
        while place < len(starts) and starts[place] == now:
            place += 1
        plan.at(now, list(range(first, place)))
    rows = np.array(plan.rows, dtype=np.float64).reshape(-1, 5)
    satellite, relay, terminal = (rows[:, column].astype(np.int64) for column in range(3))
    return Sessions(satellite, relay, terminal, rows[:, 3].copy(), rows[:, 3] + rules.overhead_s, rows[:, 4].copy())


# -------------------------------------------------------------------------------------------------------------- totals
@dataclass(frozen=True, slots=True, eq=False)
class Totals:
    """Per satellite or per relay, all of shape (count,): sessions, busy time with overhead, time with data, its volume.

    `longest_gap_s` is the longest time within the span without data, its start and end counted as data: the whole span
    where there was none. A relay has data while one of its terminals has.
    """

    sessions: Integers
    busy_s: Floats
    served_s: Floats
    volume_bit: Floats
    longest_gap_s: Floats


def totals(
    sessions: Sessions, index: Integers, count: int, volume_bit: Sequence[float] | Floats, span: tuple[float, float]
) -> Totals:
    """What each satellite got over the span, or each relay carried over all its terminals.

    Args:
        sessions: The sessions.
        index: `sessions.satellite` or `sessions.relay`.
        count: Number of satellites, or of relays.
        volume_bit: Data of each session, bit, shape (sessions,).
        span: Start and end of the span, s.
    """

    def add(each: Sequence[float] | Floats) -> Floats:
        return np.bincount(index, each, minlength=count).astype(np.float64)

    return Totals(
        sessions=np.bincount(index, minlength=count).astype(np.int64),
        busy_s=add(sessions.end_s - sessions.start_s),
        served_s=add(sessions.end_s - sessions.locked_s),
        volume_bit=add(volume_bit),
        longest_gap_s=_longest_gaps(sessions, index, count, span),
    )


def _longest_gaps(sessions: Sessions, index: Integers, count: int, span: tuple[float, float]) -> Floats:
    order = np.lexsort((sessions.locked_s, index))
    edges = np.searchsorted(index[order], np.arange(count + 1))
    gaps = np.empty(count)
    for one in range(count):
        mine = order[edges[one] : edges[one + 1]]
        data_until = np.maximum.accumulate(np.concatenate(([span[0]], sessions.end_s[mine])))
        gaps[one] = np.max(np.concatenate((sessions.locked_s[mine], [span[1]])) - data_until)
    return gaps
