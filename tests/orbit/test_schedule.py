"""Terminals shared by a constellation: a schedule by hand, invariants, fairness, totals."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from microrad.orbit.operations import (
    Opportunities,
    Rules,
    Sessions,
    schedule,
    totals,
)

RULES = Rules(overhead_s=2.0, shortest_s=3.0, longest_s=10.0)
DAY = 86_400.0
properties = settings(deadline=None, derandomize=True, database=None, max_examples=60)
rounding = 1e-9  # s


def opportunities(*rows):
    """Rows of (satellite, relay, start, end), sorted here."""
    columns = zip(*sorted(rows, key=lambda r: (r[2], r[0], r[1])), strict=True) if rows else ((), (), (), ())
    return Opportunities(*(np.array(c) for c in columns))


def volumes(sessions, rate_bit_s=1e9):
    """The data of each session at one rate."""
    return rate_bit_s * (sessions.end_s - sessions.locked_s)


def listed(sessions):
    """(satellite, relay, terminal, start, end) of each session."""
    fields = (sessions.satellite, sessions.relay, sessions.terminal, sessions.start_s, sessions.end_s)
    return list(zip(*(f.tolist() for f in fields), strict=True))


# ---- the same rule, written to be read: at every moment everything is looked at
def by_hand(rows, satellites, relays, terminals, rules, start_s):
    last, had = [start_s] * satellites, [0.0] * satellites
    serving = {}  # (relay, terminal): [satellite, start, looked at next, end of the view]
    done = []

    def in_service(satellite):
        return any(session[0] == satellite for session in serving.values())

    def waiting(relay, now):
        """Satellites that wait for the relay, the longest first, each with the end of its view."""
        found = []
        for satellite, its_relay, begin, end in rows:
            if its_relay == relay and begin <= now and end - now >= rules.shortest_s and not in_service(satellite):
                found.append((last[satellite], had[satellite], satellite, end))
        return sorted(found)

    def begin(relay, terminal, now, who):
        *_, satellite, end = who
        serving[relay, terminal] = [satellite, now, min(now + rules.longest_s, end), end]

    def close(place, now):
        satellite, begun, _, _ = serving.pop(place)
        last[satellite] = now
        had[satellite] += now - begun - rules.overhead_s
        done.append((satellite, *place, begun, now))

    def fill(now):
        for relay in range(relays):
            for terminal in range(terminals):
                if (relay, terminal) not in serving and waiting(relay, now):
                    begin(relay, terminal, now, waiting(relay, now)[0])

    moments = {row[2] for row in rows}
    while moments:
        now = min(moments)
        due = sorted(place for place, session in serving.items() if session[2] == now)
        for place in due:
            if serving[place][3] == now:
                close(place, now)
        due = [place for place in due if place in serving]
        fill(now)
        for place in due:
            others = waiting(place[0], now)
            if others:
                close(place, now)
                begin(*place, now, others[0])
            else:
                serving[place][2] = min(now + rules.longest_s, serving[place][3])
        fill(now)
        moments = {row[2] for row in rows if row[2] > now} | {session[2] for session in serving.values()}
    return sorted(done, key=lambda s: (s[3], s[1], s[2]))


@st.composite
def cases(draw):
    """A few satellites and relays with views on a coarse grid of time, so that much happens at the same moment."""
    satellites, relays = draw(st.integers(1, 5)), draw(st.integers(1, 3))
    rows = []
    for satellite in range(satellites):
        for relay in range(relays):
            edges = sorted(draw(st.sets(st.integers(0, 40), max_size=6)))
            rows += [(satellite, relay, float(a), float(b)) for a, b in zip(edges[::2], edges[1::2], strict=False)]
    overhead = draw(st.sampled_from([0.0, 1.0, 2.0]))
    shortest = overhead + draw(st.sampled_from([1.0, 2.0]))
    longest = shortest + draw(st.sampled_from([0.0, 1.0, 4.0, math.inf]))
    return rows, satellites, relays, draw(st.integers(1, 2)), Rules(overhead, shortest, longest)


@properties
@given(cases())
def test_the_schedule_is_the_one_written_out_moment_by_moment(case):
    rows, satellites, relays, terminals, rules = case
    got = schedule(opportunities(*rows), satellites, relays, terminals, rules, 0.0)
    wanted = by_hand(rows, satellites, relays, terminals, rules, 0.0)
    assert sorted(listed(got), key=lambda s: (s[3], s[1], s[2])) == wanted


# ---- invariants
@properties
@given(cases())
def test_no_satellite_and_no_terminal_has_two_sessions_at_once(case):
    rows, satellites, relays, terminals, rules = case
    got = listed(schedule(opportunities(*rows), satellites, relays, terminals, rules, 0.0))
    for a, b in combinations(got, 2):
        if a[0] == b[0] or a[1:3] == b[1:3]:
            assert a[4] <= b[3] or b[4] <= a[3], (a, b)


@pytest.mark.promise("day-32")
@properties
@given(cases())
def test_each_session_lies_in_one_view_and_is_long_enough(case):
    rows, satellites, relays, terminals, rules = case
    got = schedule(opportunities(*rows), satellites, relays, terminals, rules, 0.0)
    np.testing.assert_array_equal(got.locked_s, got.start_s + rules.overhead_s)
    assert np.all(np.diff(got.start_s) >= 0.0)
    for satellite, relay, terminal, start, end in listed(got):
        assert 0 <= terminal < terminals
        assert end - start >= min(rules.shortest_s, rules.longest_s)
        views = [row for row in rows if row[:2] == (satellite, relay) and row[2] <= start and end <= row[3]]
        assert len(views) == 1


@properties
@given(cases())
def test_no_terminal_idles_while_someone_could_use_it(case):
    rows, satellites, relays, terminals, rules = case
    got = listed(schedule(opportunities(*rows), satellites, relays, terminals, rules, 0.0))
    for now in np.arange(0.25, 40.0, 0.5):  # between the moments at which anything changes
        under_way = [s for s in got if s[3] <= now < s[4]]
        served = {s[0] for s in under_way}
        for satellite, relay, begin, end in rows:
            # worthwhile at the last whole second: the sessions of this grid begin there
            eligible = begin <= now and end - math.floor(now) >= rules.shortest_s and satellite not in served
            if eligible:
                assert sum(s[1] == relay for s in under_way) == terminals, (now, satellite, relay)


@properties
@given(cases())
def test_the_time_served_is_bounded_by_the_terminals_and_by_what_is_in_view(case):
    rows, satellites, relays, terminals, rules = case
    got = schedule(opportunities(*rows), satellites, relays, terminals, rules, 0.0)
    each = totals(got, got.satellite, satellites, volumes(got), (0.0, 40.0))
    for satellite in range(satellites):
        seconds = {s for row in rows if row[0] == satellite for s in range(int(row[2]), int(row[3]))}
        assert each.busy_s[satellite] <= len(seconds)
    both = totals(got, got.relay, relays, volumes(got), (0.0, 40.0))
    assert np.all(both.busy_s <= 40.0 * terminals)
    assert both.busy_s.sum() == pytest.approx(each.busy_s.sum(), abs=rounding)
    assert both.sessions.sum() == each.sessions.sum() == got.start_s.size
    np.testing.assert_allclose(each.busy_s - each.served_s, rules.overhead_s * each.sessions, atol=rounding)


# ---- cases to follow by eye
def test_one_satellite_alone_is_served_to_the_end_of_its_view():
    got = schedule(opportunities((0, 0, 5.0, 100.0)), 1, 1, 1, RULES, 0.0)
    assert listed(got) == [(0, 0, 0, 5.0, 100.0)]
    assert got.locked_s.tolist() == [7.0]


@pytest.mark.promise("day-32")
def test_two_satellites_take_turns_and_the_first_goes_on_while_nobody_waits():
    got = schedule(opportunities((0, 0, 0.0, 60.0), (1, 0, 25.0, 60.0)), 2, 1, 1, RULES, 0.0)
    # looked at after 10, 20 and 30 s: at 30 s the other waits
    turns = [(0, 0, 0, 0.0, 30.0), (1, 0, 0, 30.0, 40.0), (0, 0, 0, 40.0, 50.0), (1, 0, 0, 50.0, 60.0)]
    assert listed(got) == turns


@pytest.mark.promise("day-32")
def test_a_remainder_too_short_to_be_worthwhile_is_left():
    views = ((0, 0, 0.0, 8.0), (1, 0, 0.0, 10.9))
    assert [s[0] for s in listed(schedule(opportunities(*views), 2, 1, 1, RULES, 0.0))] == [0]
    longer = ((0, 0, 0.0, 8.0), (1, 0, 0.0, 11.0))
    assert [s[0] for s in listed(schedule(opportunities(*longer), 2, 1, 1, RULES, 0.0))] == [0, 1]


@pytest.mark.promise("day-32")
def test_the_longest_waiting_goes_first_not_the_lowest_index():
    views = ((0, 0, 0.0, 20.0), (0, 0, 30.0, 60.0), (2, 0, 20.0, 29.0), (1, 0, 20.0, 24.0), (1, 0, 30.0, 60.0))
    got = listed(schedule(opportunities(*views), 3, 1, 1, RULES, 0.0))
    assert [s[0] for s in got if s[3] < 40.0] == [0, 1, 2, 0]
    assert (0, 0, 0, 30.0, 40.0) in got  # satellite 0 since 20 s, satellite 1 since 24 s


def test_of_equally_long_waits_the_least_data_goes_first_and_overhead_is_none():
    """Satellite 1 was served for longer, 10 s against 9.5 s, but in two sessions, with 6 s of data against 7.5 s."""
    rows = [(0, 0, 1.5, 11.0), (1, 1, 0.0, 5.0), (1, 1, 6.0, 11.0), (0, 2, 20.0, 30.0), (1, 2, 20.0, 30.0)]
    found = listed(schedule(opportunities(*rows), 2, 3, 1, RULES, 0.0))
    assert next(each[0] for each in found if each[1] == 2) == 1


def test_who_must_leave_may_take_a_free_terminal_elsewhere():
    views = ((0, 0, 0.0, 40.0), (1, 0, 5.0, 40.0), (0, 1, 8.0, 40.0))
    got = listed(schedule(opportunities(*views), 2, 2, 1, RULES, 0.0))
    assert got == [(0, 0, 0, 0.0, 10.0), (1, 0, 0, 10.0, 40.0), (0, 1, 0, 10.0, 40.0)]


@pytest.mark.parametrize("count", [2, 3, 7, 20])
@pytest.mark.parametrize("terminals", [1, 3])
def test_satellites_that_see_the_same_get_the_same_within_one_session(count, terminals):
    rules = Rules(overhead_s=60.0, shortest_s=120.0, longest_s=600.0)
    rows = [(satellite, 0, 0.0, DAY) for satellite in range(count)]
    got = schedule(opportunities(*rows), count, 1, terminals, rules, 0.0)
    each = totals(got, got.satellite, count, volumes(got), (0.0, DAY))
    assert np.ptp(each.served_s) <= rules.longest_s - rules.overhead_s + rounding
    if terminals < count:  # every terminal is busy all day, in sessions of the longest
        assert each.busy_s.sum() == pytest.approx(terminals * DAY)
        turns = math.ceil(count / terminals)
        assert each.longest_gap_s.max() <= turns * rules.longest_s + rounding


def constellation(satellites, relays, passes, seed):
    random = np.random.Generator(np.random.Philox(key=seed))
    phase = random.uniform(0.0, 5760.0, (satellites, relays, 1))
    start = np.broadcast_to(np.arange(passes) * 5760.0 + phase, (satellites, relays, passes)).ravel()
    satellite = np.repeat(np.arange(satellites), relays * passes)
    relay = np.tile(np.repeat(np.arange(relays), passes), satellites)
    order = np.argsort(start, kind="stable")
    return Opportunities(satellite[order], relay[order], start[order], start[order] + 3400.0)


@pytest.mark.endurance
def test_a_thousand_satellites_on_four_relays_keep_every_terminal_busy_and_every_satellite_served():
    rules = Rules(overhead_s=60.0, shortest_s=120.0, longest_s=600.0)
    seen = constellation(1000, 4, 15, seed=1)
    got = schedule(seen, 1000, 4, 16, rules, 0.0)
    for key in (got.satellite, got.relay * 16 + got.terminal):
        order = np.lexsort((got.start_s, key))
        same = np.diff(key[order]) == 0
        assert np.all(got.start_s[order][1:][same] >= got.end_s[order][:-1][same])
    span = (0.0, float(got.end_s.max()))
    each, relays = (
        totals(got, got.satellite, 1000, volumes(got), span),
        totals(got, got.relay, 4, volumes(got), span),
    )
    assert np.all(each.sessions >= 1)
    # from 2 h to 22 h there is always someone in view: no terminal is without a session
    assert np.all(relays.busy_s >= 16 * (20 * 3600.0))
    assert relays.served_s.sum() == pytest.approx(each.served_s.sum(), rel=1e-12)
    np.testing.assert_allclose(each.volume_bit, 1e9 * each.served_s)
    again = schedule(seen, 1000, 4, 16, rules, 0.0)
    assert listed(again) == listed(got)


# ---- totals
def sessions(*rows):
    """Rows of (satellite, relay, terminal, start, locked, end)."""
    satellite, relay, terminal, *times = zip(*rows, strict=True)
    return Sessions(*(np.array(x) for x in (satellite, relay, terminal)), *(np.array(t, dtype=float) for t in times))


@pytest.mark.promise("day-32")
def test_totals_count_data_from_lock_to_end_and_gaps_from_data_to_data():
    got = sessions((0, 0, 0, 10, 12, 20), (1, 0, 1, 11, 15, 40), (2, 0, 2, 16, 17, 18), (0, 1, 0, 50, 55, 60))
    each = totals(got, got.satellite, 4, volumes(got, 2.0), (0.0, 100.0))
    assert each.sessions.tolist() == [2, 1, 1, 0]
    assert each.busy_s.tolist() == [20.0, 29.0, 2.0, 0.0]
    assert each.served_s.tolist() == [13.0, 25.0, 1.0, 0.0]
    assert each.volume_bit.tolist() == [26.0, 50.0, 2.0, 0.0]
    assert each.longest_gap_s.tolist() == [40.0, 60.0, 82.0, 100.0]
    relays = totals(got, got.relay, 2, volumes(got, 2.0), (0.0, 100.0))
    assert relays.longest_gap_s.tolist() == [60.0, 55.0]  # relay 0 has data from 12 to 40 on its three terminals
    assert relays.served_s.tolist() == [34.0, 5.0]


def test_a_schedule_without_an_opportunity_is_empty():
    got = schedule(opportunities(), 2, 1, 1, RULES, 0.0)
    assert listed(got) == []
    assert totals(got, got.satellite, 2, volumes(got, 1.0), (0.0, 9.0)).longest_gap_s.tolist() == [9.0, 9.0]


def test_views_that_touch_or_are_of_different_relays_are_taken():
    assert opportunities((0, 0, 1.0, 4.0), (0, 0, 4.0, 9.0), (0, 1, 2.0, 9.0)).start_s.size == 3


BUSY = opportunities(
    (0, 0, 0.0, 40.0), (1, 0, 1.0, 33.0), (2, 1, 2.0, 25.0), (2, 0, 3.0, 38.0), (3, 1, 4.5, 30.0), (0, 1, 6.0, 50.0)
)
SHARED = schedule(BUSY, 4, 2, (2, 1), Rules(overhead_s=1.5, shortest_s=4.0, longest_s=9.0), -3.0)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (lambda: SHARED.satellite, [0, 1, 2, 3, 2, 0, 1, 2, 0]),
        (lambda: SHARED.relay, [0, 0, 1, 1, 0, 0, 0, 0, 1]),
        (lambda: SHARED.terminal, [0, 1, 0, 0, 0, 1, 0, 1, 0]),
        (lambda: SHARED.start_s, [0.0, 1.0, 2.0, 11.0, 18.0, 19.0, 27.0, 28.0, 29.0]),
        (lambda: SHARED.locked_s, [1.5, 2.5, 3.5, 12.5, 19.5, 20.5, 28.5, 29.5, 30.5]),
        (lambda: SHARED.end_s, [18.0, 19.0, 11.0, 29.0, 27.0, 28.0, 33.0, 38.0, 50.0]),
        (
            lambda: [
                x
                for each in (SHARED.satellite, SHARED.relay)
                for x in totals(SHARED, each, 5, volumes(SHARED, 2.5), (-3.0, 55.0)).busy_s
            ],
            [48.0, 24.0, 28.0, 18.0, 0.0, 70.0, 48.0, 0.0, 0.0, 0.0],
        ),
        (
            lambda: [
                x
                for each in (SHARED.satellite, SHARED.relay)
                for x in totals(SHARED, each, 5, volumes(SHARED, 2.5), (-3.0, 55.0)).served_s
            ],
            [43.5, 21.0, 23.5, 16.5, 0.0, 61.0, 43.5, 0.0, 0.0, 0.0],
        ),
        (
            lambda: [
                x
                for each in (SHARED.satellite, SHARED.relay)
                for x in totals(SHARED, each, 5, volumes(SHARED, 2.5), (-3.0, 55.0)).volume_bit
            ],
            [108.75, 52.5, 58.75, 41.25, 0.0, 152.5, 108.75, 0.0, 0.0, 0.0],
        ),
        (
            lambda: [
                x
                for each in (SHARED.satellite, SHARED.relay)
                for x in totals(SHARED, each, 5, volumes(SHARED, 2.5), (-3.0, 55.0)).longest_gap_s
            ],
            [5.0, 22.0, 17.0, 26.0, 58.0, 17.0, 6.5, 58.0, 58.0, 58.0],
        ),
        (
            lambda: [
                x
                for each in (SHARED.satellite, SHARED.relay)
                for x in totals(SHARED, each, 5, volumes(SHARED, 2.5), (-3.0, 55.0)).sessions
            ],
            [3, 2, 3, 1, 0, 6, 3, 0, 0, 0],
        ),
    ],
)
def test_sessions_and_totals_of_relays_with_unlike_terminals(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)
