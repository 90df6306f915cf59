"""Rates over a contact, the store against packets second by second, latencies, and what is written for others."""

import csv
import io
import math
import re
from collections import deque
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from microrad.orbit import operations
from microrad.orbit.operations import (
    COLUMNS,
    Latency,
    OperationsError,
    PlannedSession,
    RateTable,
    Service,
    Step,
    contact_plan,
    csv_text,
    deliver,
    pool,
    service,
    spreadsheet_text,
    store,
)

KM = 1e3
GBIT = 1e9
INF = math.inf
properties = settings(deadline=None, derandomize=True, database=None, max_examples=60)
one_millisecond = 1e-3
rounding = 1e-9  # relative
TABLE = RateTable((Step(2 * GBIT, 38_000 * KM), Step(1 * GBIT, 42_000 * KM)))


def test_every_public_name_is_there():
    assert all(hasattr(operations, name) for name in operations.__all__)


# ---------------------------------------------------------------------------------------------------------------- rates
def swing(time_s):
    """40 000 km, 4 000 km up and down in 2 h, nearest at half time."""
    return 40_000 * KM + 4_000 * KM * np.cos(2.0 * np.pi * time_s / 7200.0)


def test_the_rate_table_takes_the_highest_rate_that_closes():
    ranges = np.array([[30_000.0, 38_000.0], [38_000.001, 42_000.0], [42_000.001, 9e9]]) * KM
    wanted = np.array([[2.0, 2.0], [1.0, 1.0], [0.0, 0.0]]) * GBIT
    np.testing.assert_array_equal(TABLE.rate_bit_s(ranges), wanted)


def test_the_rate_follows_the_range_with_its_crossings_to_a_millisecond():
    got = service(TABLE, (0.0, 7200.0), swing, 1.0)
    third = 7200.0 / 6.0  # cos is 1/2 there
    inner = [third, 2.0 * third, 4.0 * third, 5.0 * third]
    np.testing.assert_allclose(got.edges_s, [0.0, *inner, 7200.0], atol=one_millisecond)
    assert got.rate_bit_s.tolist() == [0.0, 1 * GBIT, 2 * GBIT, 1 * GBIT, 0.0]
    assert got.capacity_bit == pytest.approx((2.0 * third * 2 + 2.0 * third) * GBIT, rel=1e-6)


def test_before_lock_the_rate_is_zero_and_lock_cuts_a_step():
    got = service(TABLE, (0.0, 7200.0), swing, 0.5).locked_at(3000.0)
    np.testing.assert_allclose(got.edges_s, [0.0, 3000.0, 4800.0, 6000.0, 7200.0], atol=one_millisecond)
    assert got.rate_bit_s.tolist() == [0.0, 2 * GBIT, 1 * GBIT, 0.0]
    assert got.mean_rate_bit_s.tolist() == [0.0, 1 * GBIT, 0.5 * GBIT, 0.0]
    assert got.capacity_bit == pytest.approx(0.5 * (1800.0 * 2 + 1200.0) * GBIT, rel=1e-6)


@pytest.mark.parametrize("lock_s", [7200.0, 8000.0, INF])
def test_a_contact_that_never_locks_carries_nothing(lock_s):
    got = service(TABLE, (0.0, 7200.0), swing, 1.0).locked_at(lock_s)
    assert (got.edges_s.tolist(), got.rate_bit_s.tolist(), got.capacity_bit) == ([0.0, 7200.0], [0.0], 0.0)


def test_one_rate_is_one_step():
    everywhere = service(RateTable((Step(3 * GBIT, INF),)), (10.0, 20.0), swing, 1.0)
    assert (everywhere.edges_s.tolist(), everywhere.rate_bit_s.tolist()) == ([10.0, 20.0], [3 * GBIT])
    near = service(RateTable((Step(3 * GBIT, 40_000 * KM),)), (0.0, 7200.0), swing, 1.0)
    np.testing.assert_allclose(near.edges_s, [0.0, 1800.0, 5400.0, 7200.0], atol=one_millisecond)
    never = service(RateTable((Step(3 * GBIT, 0.0),)), (0.0, 7200.0), swing, 1.0)
    assert never.capacity_bit == 0.0


@pytest.mark.parametrize("bottom_s", [3.0, 411.0, 3600.5, 7171.0, 7198.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_turn_across_a_limit_between_two_samples_is_found(bottom_s, sign):
    def turning(time_s):
        return 40_000 * KM - sign * 4_000 * KM * np.cos(2.0 * np.pi * (time_s - bottom_s) / 20_000.0)

    table = RateTable((Step(2 * GBIT, float(turning(bottom_s + 1.0))), Step(1 * GBIT, INF)))
    got = service(table, (0.0, 7200.0), turning, 1.0)
    np.testing.assert_allclose(got.edges_s, [0.0, bottom_s - 1.0, bottom_s + 1.0, 7200.0], atol=one_millisecond)
    inside, outside = (2 * GBIT, 1 * GBIT) if sign > 0.0 else (1 * GBIT, 2 * GBIT)
    assert got.rate_bit_s.tolist() == [outside, inside, outside]


@properties
@given(
    st.lists(st.floats(36_100.0, 43_900.0), min_size=1, max_size=4, unique_by=round),
    st.floats(0.0, 6000.0),
    st.floats(1.0, 7000.0),
)
def test_the_service_agrees_with_the_table_second_by_second(limits_km, start_s, duration_s):
    steps = tuple(Step((9 - k) * GBIT, x * KM) for k, x in enumerate(sorted(limits_km)))
    table = RateTable(steps)
    got = service(table, (start_s, start_s + duration_s), swing, 1.0)
    time = np.arange(start_s, start_s + duration_s, 1.0) + 0.5
    time = time[time < start_s + duration_s]
    away = np.all(np.abs(time[:, None] - got.edges_s) > 2 * one_millisecond, axis=1)
    piece = np.searchsorted(got.edges_s, time) - 1
    np.testing.assert_array_equal(got.rate_bit_s[piece][away], table.rate_bit_s(swing(time))[away])
    assert np.all(np.diff(got.rate_bit_s) != 0.0)


def test_a_contact_of_no_more_than_the_rounding_of_its_times_has_one_rate():
    start_s, end_s = 1e9, 1e9 + 4e-7
    got = service(RateTable((Step(2 * GBIT, 40_000 * KM), Step(1 * GBIT, INF))), (start_s, end_s), swing, 1.0)
    assert (got.edges_s.tolist(), got.rate_bit_s.size) == ([start_s, end_s], 1)


@pytest.mark.parametrize("largest", [-5.0, math.nan])
def test_a_rate_without_a_range_is_refused(largest):
    words = f"the largest range of step 1 is {largest:g} m; give at least 0 m, inf allowed"
    with pytest.raises(OperationsError, match=words):
        RateTable((Step(2.0, 4.0), Step(1.0, largest)))


@pytest.mark.parametrize("availability", [-0.1, 1.1, math.nan])
def test_an_availability_that_is_no_share_is_refused(availability):
    with pytest.raises(
        OperationsError, match=rf"availability is {availability:g}: .* at least 0, at most 1; it is a share"
    ):
        Service(np.array([0.0, 1.0]), np.array([1.0]), availability)


@pytest.mark.parametrize(("lock_s", "edges", "rates"), [
    (5.0, [10.0, 20.0, 40.0], [3.0, 2.0]),
    (10.0, [10.0, 20.0, 40.0], [3.0, 2.0]),
    (15.0, [10.0, 15.0, 20.0, 40.0], [0.0, 3.0, 2.0]),
    (20.0, [10.0, 20.0, 40.0], [0.0, 2.0]),
    (39.0, [10.0, 39.0, 40.0], [0.0, 2.0]),
    (40.0, [10.0, 40.0], [0.0]),
])  # fmt: skip
def test_lock_at_an_edge_leaves_no_piece_of_no_length(lock_s, edges, rates):
    got = Service(np.array([10.0, 20.0, 40.0]), np.array([3.0, 2.0]), 0.5).locked_at(lock_s)
    assert (got.edges_s.tolist(), got.rate_bit_s.tolist(), got.availability) == (edges, rates, 0.5)


@pytest.mark.parametrize("availability", [0.0, 1.0])
def test_an_availability_of_all_or_nothing_is_one(availability):
    got = Service(np.array([0.0, 2.0]), np.array([3.0]), availability)
    assert got.capacity_bit == 6.0 * availability


# ---------------------------------------------------------------------------------------------------------------- store
def served(*pieces):
    """Contacts, each a list of (duration, rate) from a start."""
    found = []
    for start, *steps in pieces:
        edges = np.cumsum([start, *(d for d, _ in steps)], dtype=float)
        found.append(Service(edges, np.array([r for _, r in steps], dtype=float), 1.0))
    return found


@pytest.mark.promise("day-22")
def test_a_store_by_hand():
    # 10 bit/s for 100 s; the link takes 30 bit/s from 50 s to 100 s
    got = deliver(10.0, (0.0, 100.0), INF, served((50.0, (50.0, 30.0))), (0.0, 100.0), 0.25)
    assert got.time_s.tolist() == [0.0, 50.0, 75.0, 100.0]
    assert got.stored_bit.tolist() == [0.0, 500.0, 0.0, 0.0]
    assert got.delivered_bit.tolist() == [0.0, 0.0, 750.0, 1000.0]
    assert got.generated_bit.tolist() == [0.0, 500.0, 750.0, 1000.0]
    assert (got.largest_stored_bit, got.stored_bit[-1]) == (500.0, 0.0)
    assert got.latency.delivered_share == 1.0
    # the first bit waits 50 s, the bit of 75 s none, linear between; a quarter does not wait at all
    latency = got.latency
    assert mean_s(latency) == pytest.approx(0.75 * 25.0 + 0.25, rel=rounding)
    np.testing.assert_allclose(latency.cdf([0.2, 0.25, 25.25, 50.25]), [0.0, 0.25, 0.625, 1.0], rtol=rounding)
    wanted = [(0.1, 0.25), (0.25, 0.25), (0.625, 25.25), (1.0, 50.25)]
    assert all(latency.quantile(p) == pytest.approx(x, rel=rounding) for p, x in wanted)


@pytest.mark.promise("day-22")
def test_a_full_store_loses_the_newest_and_takes_in_what_the_link_takes_out():
    # full at 20 s; the link takes 4 bit/s from 40 s to 60 s, then 40 bit/s to 70 s
    got = deliver(10.0, (0.0, 60.0), 200.0, served((40.0, (20.0, 4.0), (10.0, 40.0))), (0.0, 70.0), 0.0)
    assert got.time_s.tolist() == [0.0, 20.0, 40.0, 60.0, 65.0, 70.0]
    assert got.stored_bit.tolist() == [0.0, 200.0, 200.0, 200.0, 0.0, 0.0]
    assert got.lost_bit.tolist() == [0.0, 0.0, 200.0, 320.0, 320.0, 320.0]
    assert got.delivered_bit[-1] == 280.0
    # bit 0 of 0 s leaves at 40 s; bit 80, of 8 s, at 60 s; bit 200, of 20 s, at 63 s; then data of 40 s to 60 s
    latency = got.latency
    assert latency.quantile(1.0) == pytest.approx(52.0)
    assert latency.cdf(23.0 - 1e-6) == pytest.approx(80.0 / 280.0, abs=1e-6)
    # 200 bit of 20 s leaves at 63 s, the next of 40 s at 63 s: 23 s, falling to 5 s
    assert latency.quantile(1e-9) == pytest.approx(5.0, abs=1e-6)


def test_a_store_that_fills_within_the_rounding_of_a_moment_fills_at_that_moment():
    room = math.nextafter(1e9, INF)
    time, stored, kept, lost = store._march(
        np.array([0.0, 1e9, 1e9 + 1.0]), np.array([1.0, 10.0]), np.array([0.0, 0.0]), room
    )
    assert time.tolist() == [0.0, 1e9, 1e9 + 1.0]
    assert stored.tolist() == [0.0, room, room]
    assert kept.tolist() == [0.0, 1e9, 1e9]
    assert lost.tolist() == [0.0, 0.0, 10.0]


@pytest.mark.promise("day-23")
def test_data_left_on_board_is_later_than_any_latency():
    got = deliver(10.0, (0.0, 100.0), INF, served((100.0, (10.0, 60.0))), (0.0, 200.0), 1.0)
    assert (got.delivered_bit[-1], got.stored_bit[-1], got.latency.delivered_share) == (600.0, 400.0, 0.6)
    latency = got.latency
    assert latency.missing_bit == 400.0
    assert latency.delivered_share == 0.6
    assert math.isfinite(latency.quantile(0.6))
    assert latency.quantile(0.6001) == latency.quantile(0.99) == INF
    assert latency.cdf(1e9) == 0.6


@pytest.mark.promise("day-22")
def test_a_longer_span_than_the_observed_one_delivers_the_rest():
    more = served((100.0, (10.0, 60.0)), (150.0, (10.0, 60.0)))
    got = deliver(10.0, (0.0, 100.0), INF, more, (-50.0, 200.0), 0.0)
    assert np.interp([110.0, 150.0, 160.0], got.time_s, got.delivered_bit).tolist() == [600.0, 600.0, 1000.0]
    assert got.stored_bit[-1] == 0.0
    assert got.latency.quantile(1.0) == pytest.approx(100.0)


def test_without_production_or_without_a_contact_there_is_nothing_to_be_late():
    nothing = deliver(0.0, (0.0, 100.0), 5.0, served((10.0, (10.0, 60.0))), (0.0, 100.0), 0.0)
    assert (nothing.generated_bit[-1], nothing.delivered_bit[-1]) == (0.0, 0.0)
    numbers = (
        nothing.latency.delivered_share,
        nothing.latency.quantile(0.5),
        mean_s(nothing.latency),
        nothing.latency.cdf(9.0),
    )
    assert all(math.isnan(x) for x in numbers)
    dark = deliver(1.0, (0.0, 100.0), INF, [], (0.0, 100.0), 0.0)
    assert (dark.stored_bit[-1], dark.latency.quantile(0.01)) == (100.0, INF)
    assert math.isnan(mean_s(dark.latency))


@pytest.mark.promise("day-21")
def test_outages_take_their_share_of_the_volume():
    half = Service(np.array([0.0, 100.0]), np.array([20.0]), 0.25)
    got = deliver(10.0, (0.0, 100.0), INF, [half], (0.0, 100.0), 0.0)
    assert got.delivered_bit[-1] == pytest.approx(500.0)
    assert half.capacity_bit == 500.0


# ---- packets of one second of data, second by second
def packets(production, capacity, services, span):
    """Delivered and lost bits, and (latency, bits) of what was delivered, in steps of 1 s."""
    rate_bit_s, observed_s = production
    queue, stored, delivered, lost, waits = deque(), 0.0, 0.0, 0.0, []
    for second in range(int(span[0]), int(span[1])):
        middle = second + 0.5
        new = rate_bit_s if observed_s[0] < middle < observed_s[1] else 0.0
        room = sum(
            s.mean_rate_bit_s[np.searchsorted(s.edges_s, middle) - 1] for s in services if s.start_s < middle < s.end_s
        )
        queue.append([second, new])
        stored += new
        while room > 0.0 and queue:
            sent = min(room, queue[0][1])
            waits.append((second - queue[0][0], sent))
            queue[0][1] -= sent
            room, stored, delivered = room - sent, stored - sent, delivered + sent
            if queue[0][1] <= 0.0:
                queue.popleft()
        over = max(stored - capacity, 0.0)
        stored, lost = stored - over, lost + over
        while over > 0.0:
            gone = min(over, queue[-1][1])
            queue[-1][1] -= gone
            over -= gone
            if queue[-1][1] <= 0.0:
                queue.pop()
    return delivered, lost, waits


@st.composite
def days(draw):
    """Production and contacts with whole seconds and whole rates; some stores overflow, some end with data on board."""
    span = (0.0, 600.0)
    first = draw(st.integers(0, 200))
    production = float(draw(st.integers(0, 9))), (float(first), float(draw(st.integers(first + 1, 600))))
    edges = sorted(draw(st.sets(st.integers(0, 600), max_size=8)))
    services = []
    for start, end in zip(edges[::2], edges[1::2], strict=False):
        inner = sorted(draw(st.sets(st.integers(start, end), max_size=2)) - {start, end})
        rates = [float(draw(st.integers(0, 30))) for _ in range(len(inner) + 1)]
        services.append(Service(np.array([start, *inner, end], dtype=float), np.array(rates), 1.0))
    capacity = draw(st.sampled_from([INF, 3000.0, 700.0, 100.0, 1.0]))
    return production, capacity, services, span


@pytest.mark.promise("day-22")
@properties
@given(days())
def test_the_store_agrees_with_packets_second_by_second(day):
    production, capacity, services, span = day
    got = deliver(*production, capacity, services, span, 0.0)
    delivered, lost, waits = packets(production, capacity, services, span)
    # the packets know no part of a second: each change of rate may shift a second of data
    changes = 2 + 2 * sum(s.rate_bit_s.size + 1 for s in services)
    second = production[0] * changes + 1e-6
    assert got.delivered_bit[-1] == pytest.approx(delivered, abs=second)
    assert got.lost_bit[-1] == pytest.approx(lost, abs=second)
    for latency in (0.0, 5.0, 60.0, 300.0):
        within, share = 2.0, sum(bits for wait, bits in waits if wait <= latency)
        total = got.delivered_bit[-1] + got.stored_bit[-1]
        if total > 0.0:
            low, high = got.latency.cdf([latency - within, latency + within]) * total
            assert low - second <= share <= high + second


@properties
@given(days(), st.floats(0.0, 3.0))
def test_data_is_conserved_and_the_latencies_hold_together(day, delay_s):
    production, capacity, services, span = day
    got = deliver(*production, capacity, services, span, delay_s)
    rate_bit_s, (start_s, end_s) = production
    produced = rate_bit_s * (end_s - start_s)
    assert got.generated_bit[-1] == pytest.approx(produced, rel=rounding)
    balance = got.delivered_bit + got.lost_bit + got.stored_bit
    np.testing.assert_allclose(got.generated_bit, balance, rtol=rounding, atol=1e-6)
    for curve in (got.generated_bit, got.lost_bit, got.delivered_bit):
        assert np.all(np.diff(curve) >= -1e-9)
    assert np.all(np.diff(got.time_s) > 0.0)
    assert np.all((got.stored_bit >= 0.0) & (got.stored_bit <= capacity))
    sent = [float(np.diff(np.interp((s.start_s, s.end_s), got.time_s, got.delivered_bit))[0]) for s in services]
    assert all(bit <= s.capacity_bit * (1.0 + rounding) + 1e-6 for bit, s in zip(sent, services, strict=True))
    assert sum(sent) == pytest.approx(got.delivered_bit[-1], rel=rounding, abs=1e-6)
    latency = got.latency
    assert latency.delivered_bit == pytest.approx(got.delivered_bit[-1], rel=rounding, abs=1e-6)
    assert np.all(latency.first_s >= delay_s)
    for share in (0.01, 0.5, 0.9, 0.99, 1.0):
        time = latency.quantile(share)
        if math.isfinite(time):
            assert float(latency.cdf(time + 1e-6)) >= share - 1e-9
            assert float(latency.cdf(time - 1e-6)) <= share + 1e-6 or time - delay_s < 1e-6
        elif time == INF:
            assert latency.delivered_share < share


@properties
@given(days())
def test_the_mean_latency_is_what_was_stored_over_what_was_made(day):
    """Little's law: with all data delivered, the mean latency is the integral of the store over the data."""
    production, _, services, span = day
    rest = Service(np.array([span[1], span[1] + 1e4]), np.array([50.0]), 1.0)
    got = deliver(*production, INF, [*services, rest], (span[0], span[1] + 1e4), 0.0)
    if production[0] > 0.0:
        area = np.trapezoid(got.stored_bit, got.time_s)
        assert got.stored_bit[-1] == 0.0
        assert mean_s(got.latency) == pytest.approx(area / got.generated_bit[-1], rel=1e-6, abs=1e-6)


# -------------------------------------------------------------------------------------------------------------- latency
def mean_s(latency):
    """Mean latency of what arrived; nan where nothing did."""
    weight = float(np.sum(latency.volume_bit))
    return float(np.dot(latency.volume_bit, 0.5 * (latency.first_s + latency.last_s))) / weight if weight else math.nan


def slabs(*rows, missing=0.0):
    first, last, volume = (np.array(c, dtype=float) for c in zip(*rows, strict=True))
    return Latency(first, last, volume, missing)


def test_quantiles_of_a_jump_a_gap_and_a_slope():
    latency = slabs((1.0, 1.0, 50.0), (6.0, 4.0, 30.0), missing=20.0)
    wanted = {0.01: 1.0, 0.5: 1.0, 0.65: 5.0, 0.8: 6.0, 0.81: INF, 1.0: INF}
    for share, time in wanted.items():
        assert latency.quantile(share) == pytest.approx(time, rel=rounding)
    np.testing.assert_allclose(latency.cdf([0.9, 1.0, 3.0, 4.5, 6.0, 99.0]), [0.0, 0.5, 0.5, 0.575, 0.8, 0.8])
    assert latency.cdf(1.0).shape == ()
    assert mean_s(latency) == pytest.approx((50.0 * 1.0 + 30.0 * 5.0) / 80.0)


def test_pooled_runs_are_the_mixture_by_data():
    random = np.random.Generator(np.random.Philox(key=5))
    runs = [slabs(*random.uniform(0.0, 9.0, (40, 3)), missing=m) for m in (0.0, 3.0, 8.0)]
    both = pool(runs)
    weights = np.array([r.delivered_bit + r.missing_bit for r in runs])
    times = np.linspace(0.0, 10.0, 41)
    mixture = np.average([r.cdf(times) for r in runs], axis=0, weights=weights)
    np.testing.assert_allclose(both.cdf(times), mixture, rtol=rounding)
    draws = np.concatenate(
        [
            random.uniform(np.minimum(f, t), np.maximum(f, t), 2000) if (f != t) else np.full(2000, f)
            for r in runs
            for f, t in zip(r.first_s, r.last_s, strict=True)
        ]
    )
    weight = np.repeat(np.concatenate([r.volume_bit for r in runs]) / 2000.0, 2000)
    order = np.argsort(draws)
    reached = np.cumsum(weight[order]) / weights.sum()
    for share in (0.1, 0.5, 0.9):
        drawn = draws[order][np.searchsorted(reached, share)]
        assert both.quantile(share) == pytest.approx(drawn, abs=0.05)


# ----------------------------------------------------------------------------------------------------------------- plan
NOON = datetime(2026, 3, 20, 12, tzinfo=UTC)
NAMES = ("LEO 1", 'a "quoted", name', "=1+1", "+x", "-x", "@x", "'=x", "line\nbreak", "\ttab", "Größe", "x" * 400)


def utc(time_s):
    return (NOON + timedelta(seconds=time_s)).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def plan_of(sessions, at=utc):
    """The contact plan of sessions whose satellites and relays count in the order in which they appear."""
    satellites, relays = (tuple(dict.fromkeys(getattr(s, who) for s in sessions)) for who in ("satellite", "relay"))
    return contact_plan(sessions, at, satellites, relays)


def planned(satellite="LEO 1", relay="GEO 1", start_s=10.0, locked_s=12.25, end_s=99.75, rate_bit_s=1.8e9, **more):
    values = {"volume_bit": 1.5e11, "range_min_m": 36e6, "range_max_m": 42e6} | more
    return PlannedSession(satellite, relay, start_s, locked_s, end_s, rate_bit_s, **values)


def test_the_csv_has_a_header_with_units_and_every_digit():
    text = csv_text([planned(rate_bit_s=1e9 / 3.0), planned(start_s=100.0, locked_s=101.0, end_s=200.0)], utc)
    header, first, second = csv.reader(io.StringIO(text))
    assert tuple(header) == COLUMNS
    assert first[:5] == ["LEO 1", "GEO 1", "2026-03-20T12:00:10.000Z", "2026-03-20T12:00:12.250Z", utc(99.75)]
    assert [float(x) for x in first[5:]] == [10.0, 12.25, 99.75, 36e6, 42e6, 1e9 / 3.0, 1.5e11]
    assert second[5:8] == ["100.0", "101.0", "200.0"]
    assert not text.endswith("\n")


@pytest.mark.parametrize("name", NAMES)
def test_names_come_back_from_the_csv_and_none_is_a_formula(name):
    text = csv_text([planned(satellite=name, relay=name + "!")], utc)
    row = list(csv.reader(io.StringIO(text, newline="")))[1]
    assert [x.removeprefix("'") for x in row[:2]] == [name, name + "!"]
    assert row[0][0] not in "=+-@\t\r\n"


def test_names_in_the_csv_steer_no_terminal():
    row = list(csv.reader(io.StringIO(csv_text([planned(satellite="a\x1b[31m", relay="b\u202e")], utc))))[1]
    assert row[:2] == ["a\\u001b[31m", "b\\u202e"]


def read_plan(text):
    """Reference, contacts and ranges as ionadmin reads them: words between blanks, comments skipped, whole numbers."""
    reference, contacts, ranges = None, [], []
    for line in text.split("\n"):
        assert len(line.encode()) < 255, "ionadmin reads lines of at most 255 bytes"
        words = line.split()
        if line.startswith("#"):
            continue
        if words[0] == "@":
            reference = datetime.strptime(words[1], "%Y/%m/%d-%H:%M:%S").replace(tzinfo=UTC)
            continue
        command, what, start, end, *numbers = words
        assert (command, start[0], end[0]) == ("a", "+", "+")
        row = tuple(int(x) for x in (start[1:], end[1:], *numbers))
        assert len(row) == 5
        {"contact": contacts, "range": ranges}[what].append(row)
    return reference, contacts, ranges


@pytest.mark.promise("gallery-24")
@pytest.mark.promise("day-35")
def test_the_contact_plan_is_read_back():
    sessions = [
        planned("B", "GEO", 100.0, 101.0, 200.0, 8e8),
        planned("A", "GEO", 10.0, 12.25, 99.75, 1.8e9 + 7.0),
        planned("B", "MOON RELAY", 300.0, 300.0, 400.0, 8e3, range_min_m=1e6, range_max_m=4.1e8),
    ]
    text = plan_of(sessions)
    reference, contacts, ranges = read_plan(text)
    assert reference == NOON
    assert contacts == [(13, 99, 2, 3, 225_000_000), (101, 200, 1, 3, 100_000_000), (300, 400, 1, 4, 1000)]
    assert ranges == [(13, 99, 2, 3, 1), (101, 200, 1, 3, 1), (300, 400, 1, 4, 2)]
    assert '# node 1 is "B"\n# node 2 is "A"\n# node 3 is "GEO"\n# node 4 is "MOON RELAY"\n' in text


def test_the_numbers_of_nodes_do_not_depend_on_who_is_served():
    own, partners = ("C", "A", "B"), ("GEO 2", "GEO 1")
    everyone = [
        planned(a, r, 100.0 * k + 10, 100.0 * k + 10, 100.0 * k + 90)
        for k, (a, r) in enumerate([("A", "GEO 1"), ("B", "GEO 2"), ("C", "GEO 1")])
    ]
    numbers = {"C": 1, "A": 2, "B": 3, "GEO 2": 4, "GEO 1": 5}
    for sessions in (everyone[:2], everyone[1:2], everyone[2:], everyone[::-1][:1] + everyone[:1], []):
        text = contact_plan(sessions, utc, satellites=own, relays=partners)
        named = re.findall(r'# node (\d+) is "(.+)"', text)
        assert named == [(str(number), name) for name, number in numbers.items()]
        found = [(one[2], one[3]) for one in read_plan(text)[1]]
        ordered = sorted(sessions, key=lambda s: s.start_s)
        assert found == [(numbers[s.satellite], numbers[s.relay]) for s in ordered]


def test_an_epoch_within_a_second_is_kept():
    _, contacts, _ = read_plan(plan_of([planned(locked_s=12.25, end_s=99.25)], lambda t: utc(t + 0.8)))
    assert contacts[0][:2] == (14, 100)  # 12.25 + 0.8 s up, 99.25 + 0.8 s down
    assert read_plan(plan_of([planned()], lambda t: utc(t + 0.8)))[0] == NOON


@pytest.mark.promise("day-35")
def test_what_is_left_out_of_the_contact_plan_is_said():
    sessions = [planned(locked_s=12.2, end_s=12.9), planned(start_s=20.0, locked_s=20.0, end_s=40.0, rate_bit_s=7.0)]
    text = plan_of(sessions)
    assert read_plan(text)[1:] == ([], [])
    assert "left out, no whole second with data: 1 2 from 12.200 s to 12.900 s" in text
    assert "left out, no whole byte a second: 1 2 from 20.000 s" in text
    assert read_plan(plan_of([]))[1:] == ([], [])


@pytest.mark.parametrize("name", NAMES)
def test_no_name_breaks_a_line_of_the_contact_plan(name):
    text = plan_of([planned(satellite=name, relay=name + "!")])
    assert text.isascii()
    assert len(read_plan(text)[1]) == 1


def test_a_rate_that_ion_cannot_keep_is_refused():
    words = r"the session of 'LEO 1' with 'GEO 1' has 40000000000 bit/s; ION takes at most 34359738360 bit/s"
    with pytest.raises(OperationsError, match=words):
        plan_of([planned(rate_bit_s=4e10)])


def test_the_reference_of_the_contact_plan_is_the_epoch_to_its_second():
    text = plan_of([planned(locked_s=12.25, end_s=99.75)], lambda t: utc(t + 34.8))
    assert text.splitlines()[3] == "@ 2026/03/20-12:00:34"
    assert read_plan(text)[1][0][:2] == (14, 100)


@pytest.mark.parametrize(
    ("locked_s", "end_s", "rate_bit_s", "left"),
    [
        (12.5, 13.9, 8.0, "no whole second with data"),  # from 13 s to 13 s
        (12.5, 14.0, 8.0, ""),
        (12.0, 13.0, 8.0, ""),
        (12.0, 13.0, 7.9, "no whole byte a second"),
        (12.5, 13.9, 7.9, "no whole byte a second"),
    ],
)
def test_a_contact_of_one_second_with_one_byte_is_the_least(locked_s, end_s, rate_bit_s, left):
    text = plan_of([planned(locked_s=locked_s, end_s=end_s, rate_bit_s=rate_bit_s)])
    assert len(read_plan(text)[1]) == (not left)
    assert (f"left out, {left}:" in text) is bool(left)


def test_the_largest_rate_that_ion_keeps_is_taken():
    most = 8 * (2**32 - 1)
    assert read_plan(plan_of([planned(rate_bit_s=float(most) + 7.0)]))[1][0][4] == 2**32 - 1
    with pytest.raises(OperationsError, match="ION takes at most"):
        plan_of([planned(rate_bit_s=float(most) + 8.0)])


def test_the_light_time_of_a_whole_light_second_is_that_second():
    for range_m, light_s in ((299_792_458.0, 1), (299_792_459.0, 2), (1.0, 1)):
        assert read_plan(plan_of([planned(range_max_m=range_m)]))[2][0][4] == light_s


UNLIKE = Service(np.array([3.0, 8.0, 15.0, 31.0]), np.array([7.0, 2.0, 12.0]), 0.625)
LATER = Service(np.array([36.0, 41.0, 47.0]), np.array([0.5, 4.0]), 0.75)
KEPT = deliver(3.5, (2.0, 40.0), 25.0, [UNLIKE, LATER], (-1.0, 52.0), 0.125)
WAITED = Latency(np.array([9.0, 2.0, 5.0]), np.array([4.0, 2.0, 12.0]), np.array([3.0, 1.0, 8.0]), 4.0)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [
                *UNLIKE.within(5.0, 20.0).edges_s,
                *UNLIKE.within(5.0, 20.0).rate_bit_s,
                UNLIKE.within(5.0, 20.0).capacity_bit,
            ],
            [5.0, 8.0, 15.0, 20.0, 7.0, 2.0, 12.0, 59.375],
        ),
        (
            lambda: [
                *UNLIKE.within(-2.0, 8.0).edges_s,
                *UNLIKE.within(-2.0, 8.0).rate_bit_s,
                UNLIKE.within(15.0, 99.0).capacity_bit,
            ],
            [3.0, 8.0, 7.0, 120.0],
        ),
        (
            lambda: [
                *UNLIKE.within(9.0, 14.0).edges_s,
                *UNLIKE.within(9.0, 14.0).rate_bit_s,
                UNLIKE.within(9.0, 14.0).availability,
            ],
            [9.0, 14.0, 2.0, 0.625],
        ),
        (
            lambda: [
                *UNLIKE.locked_at(9.5).edges_s,
                *UNLIKE.locked_at(9.5).mean_rate_bit_s,
                UNLIKE.locked_at(9.5).capacity_bit,
            ],
            [3.0, 9.5, 15.0, 31.0, 0.0, 1.25, 7.5, 126.875],
        ),
        (lambda: KEPT.time_s, [-1.0, 2.0, 3.0, 7.0, 8.0, 15.0, 18.9375, 31.0, 36.0, 38.4, 40.0, 41.0, 47.0, 52.0]),
        (
            lambda: KEPT.generated_bit,
            [0.0, 0.0, 3.5, 17.5, 21.0, 45.5, 59.28125, 101.5, 119.0, 127.4, 133.0, 133.0, 133.0, 133.0],
        ),
        (lambda: KEPT.lost_bit, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0]),
        (
            lambda: KEPT.delivered_bit,
            [0.0, 0.0, 0.0, 17.5, 21.0, 29.75, 59.28125, 101.5, 101.5, 102.4, 103.0, 103.375, 121.375, 121.375],
        ),
        (
            lambda: [*KEPT.stored_bit, KEPT.largest_stored_bit],
            [0.0, 0.0, 3.5, 0.0, 0.0, 15.75, 0.0, 0.0, 17.5, 25.0, 25.0, 24.625, 6.625, 6.625, 25.0],
        ),
        (
            lambda: [*KEPT.latency.first_s, *KEPT.latency.last_s],
            [
                1.125,
                0.925,
                0.125,
                0.125,
                4.625,
                2.225,
                0.125,
                5.125,
                7.26785714,
                8.69642857,
                9.58928571,
                10.3333333,
                0.925,
                0.125,
                0.125,
                4.625,
                2.225,
                0.125,
                0.125,
                7.26785714,
                8.69642857,
                9.58928571,
                10.3333333,
                10.4464286,
            ],
        ),
        (
            lambda: [
                *KEPT.latency.volume_bit,
                KEPT.latency.missing_bit,
                KEPT.latency.delivered_share,
                KEPT.latency.delivered_bit,
            ],
            [
                3.5,
                14.0,
                3.5,
                8.75,
                15.75,
                13.78125,
                42.21875,
                0.9,
                0.6,
                0.375,
                15.625,
                2.375,
                6.625,
                0.948242188,
                121.375,
            ],
        ),
        (
            lambda: [KEPT.latency.quantile(share) for share in (0.05, 0.35, 0.75, 0.97)],
            [0.125, 0.125, 3.97846939, math.inf],
        ),
        (
            lambda: KEPT.latency.cdf([0.5, 3.0, 6.0, 9.5, 20.0]),
            [0.433369954, 0.684970432, 0.795839844, 0.807324219, 0.948242188],
        ),
        (
            lambda: [
                *WAITED.cdf([1.0, 2.0, 4.5, 8.0, 11.0, 30.0]),
                *(WAITED.quantile(share) for share in (0.01, 0.1, 0.4, 0.6, 0.75, 0.8)),
            ],
            [0.0, 0.0625, 0.08125, 0.426785714, 0.678571429, 0.75, 2.0, 5.0, 7.75409836, 9.9, 12.0, math.inf],
        ),
        (
            lambda: [
                (both := pool([WAITED, KEPT.latency])).missing_bit,
                both.delivered_share,
                both.quantile(0.5),
                both.quantile(0.9),
            ],
            [10.625, 0.926215278, 1.1572449, 10.356129],
        ),
        (
            lambda: RateTable((Step(9.0, 4.0), Step(5.0, 7.5), Step(2.0, 20.0))).rate_bit_s(
                [3.0, 4.0, 4.5, 7.5, 19.0, 20.5]
            ),
            [9.0, 9.0, 5.0, 5.0, 2.0, 0.0],
        ),
        (
            lambda: [
                *(got := service(TABLE, (500.0, 3100.0), swing, 0.875)).edges_s,
                *got.rate_bit_s,
                got.capacity_bit,
            ],
            [500.0, 1200.0, 2400.0, 3100.0, 0.0, 1000000000.0, 2000000000.0, 2275000000000.0],
        ),
    ],
)
def test_rates_stores_and_latencies_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


FIRST = PlannedSession("LEO 2", "GEO 1", 61.5, 64.125, 99.875, 622.08e6, 2.25e10, 35.5e6, 41.25e6)
SECOND = PlannedSession("LEO 1", "=GEO 3", 61.5, 70.25, 81.5, 1.75e9, 1.5e10, 36.5e6, 299.8e6)
THIRD = PlannedSession("LEO 1", "GEO 1", 12.5, 14.25, 15.0, 3e9, 1e9, 36e6, 37e6)


def later(time_s):
    return utc(time_s + 0.75)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: csv_text([FIRST, SECOND], later).replace("\n", ",").split(",")[12:],
            [
                "LEO 2",
                "GEO 1",
                "2026-03-20T12:01:02.250Z",
                "2026-03-20T12:01:04.875Z",
                "2026-03-20T12:01:40.625Z",
                "61.5",
                "64.125",
                "99.875",
                "35500000.0",
                "41250000.0",
                "622080000.0",
                "22500000000.0",
                "LEO 1",
                "'=GEO 3",
                "2026-03-20T12:01:02.250Z",
                "2026-03-20T12:01:11.000Z",
                "2026-03-20T12:01:22.250Z",
                "61.5",
                "70.25",
                "81.5",
                "36500000.0",
                "299800000.0",
                "1750000000.0",
                "15000000000.0",
            ],
        ),
        (
            lambda: contact_plan(
                [FIRST, SECOND, THIRD], later, ("LEO 1", "LEO 2", "LEO 3"), ("GEO 1", "GEO 2", "=GEO 3")
            ).split("\n")[1:],
            [
                '# node 1 is "LEO 1"',
                '# node 2 is "LEO 2"',
                '# node 3 is "LEO 3"',
                '# node 4 is "GEO 1"',
                '# node 5 is "GEO 2"',
                '# node 6 is "=GEO 3"',
                "@ 2026/03/20-12:00:00",
                "# left out, no whole second with data: 1 4 from 14.250 s to 15.000 s",
                "a contact +71 +82 1 6 218750000",
                "a range +71 +82 1 6 2",
                "a contact +65 +100 2 4 77760000",
                "a range +65 +100 2 4 1",
            ],
        ),
        (
            lambda: contact_plan(
                [planned(rate_bit_s=7.5), planned(start_s=2.0, locked_s=5.0625, end_s=6.5)], utc, ("LEO 1",), ("GEO 1",)
            ).split("\n")[3:],
            [
                "@ 2026/03/20-12:00:00",
                "# left out, no whole second with data: 1 2 from 5.062 s to 6.500 s",
                "# left out, no whole byte a second: 1 2 from 12.250 s to 99.750 s",
            ],
        ),
    ],
)
def test_plans_for_others_of_sessions_unlike_each_other(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: contact_plan([planned(rate_bit_s=4e10)], utc, ("LEO 1",), ("GEO 1",)),
            OperationsError,
            "the session of 'LEO 1' with 'GEO 1' has 40000000000 bit/s; ION takes at most 34359738360 bit/s",
        ),
        (
            lambda: RateTable((Step(9.0, 4.0), Step(5.0, 7.5), Step(2.0, -20.5))),
            OperationsError,
            "the largest range of step 2 is -20.5 m; give at least 0 m, inf allowed",
        ),
        (
            lambda: Service(np.array([0.0, 1.0]), np.array([1.0]), 1.25),
            OperationsError,
            ("Service.availability is 1.25: it must be finite, at least 0, at most 1; it is a share of time"),
        ),
    ],
)
def test_a_refusal_of_a_plan_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


EARLY = Service(np.array([2.0, 5.0, 11.0, 12.5]), np.array([3.0, 0.5, 7.0]), 0.75)
LATE = Service(np.array([20.0, 23.0]), np.array([4.0]), 0.5)
SLABS = Latency(np.array([4.0, 9.0]), np.array([2.0, 9.0]), np.array([6.0, 1.5]), 2.5)


def rows(found):
    """Times, then what was made, lost, delivered and is stored, then all of the latency."""
    late = found.latency
    store = [found.time_s, found.generated_bit, found.lost_bit, found.delivered_bit, found.stored_bit]
    return [*store, late.first_s, late.last_s, late.volume_bit, late.missing_bit]


def two(names):
    return contact_plan([PlannedSession(*each, 3.0, 4.0, 9.0, 80.0, 1.0, 1.0, 2.0) for each in names], utc, "BA", "zy")


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (lambda: [(s := EARLY.within(3.0, 99.0)).edges_s, s.rate_bit_s, s.availability], "3 5 11 12.5 3 0.5 7 0.75"),
        (lambda: [(s := EARLY.within(-1.0, 11.0)).edges_s, s.rate_bit_s, s.capacity_bit], "2 5 11 3 0.5 9"),
        (lambda: [(s := EARLY.within(5.0, 6.0)).edges_s, s.rate_bit_s, s.capacity_bit], "5 6 0.5 0.375"),
        (lambda: [(s := EARLY.within(11.5, 12.0)).edges_s, s.rate_bit_s, s.start_s, s.end_s], "11.5 12 7 11.5 12"),
        (
            lambda: [
                EARLY.within(2.0, 12.5) is EARLY,
                EARLY.within(2.0, 12.4) is EARLY,
                EARLY.within(2.1, 12.5) is EARLY,
            ],
            "1 0 0",
        ),
        (lambda: [(s := EARLY.locked_at(5.0)).edges_s, s.rate_bit_s, s.capacity_bit], "2 5 11 12.5 0 0.5 7 10.125"),
        (
            lambda: [(s := EARLY.locked_at(11.75)).edges_s, s.rate_bit_s, s.capacity_bit, s.mean_rate_bit_s],
            "2 11.75 12.5 0 7 3.9375 0 5.25",
        ),
        (lambda: [(s := EARLY.locked_at(12.5)).edges_s, s.rate_bit_s, s.availability], "2 12.5 0 0.75"),
        (lambda: [(s := EARLY.locked_at(math.inf)).edges_s, s.rate_bit_s, s.capacity_bit], "2 12.5 0 0"),
        (
            lambda: [
                EARLY.locked_at(2.0) is EARLY,
                EARLY.locked_at(-math.inf) is EARLY,
                EARLY.locked_at(2.001) is EARLY,
            ],
            "1 1 0",
        ),
        (
            lambda: rows(deliver(1.5, (0.0, 30.0), INF, [EARLY, LATE], (0.0, 30.0), 0.25)),
            (
                "0 2 5 11 12.5 20 23 30 0 3 7.5 16.5 18.75 30 34.5 45 0 0 0 0 0 0 0 0 0 0 6.75 9 16.875 "
                "16.875 22.875 22.875 0 3 0.75 7.5 1.875 13.125 11.625 22.125 2.25 1.5833333 0.75 2.25 5.25"
                " 1.6785714 9 8.6875 1.5833333 0.75 2.25 5.25 1.6785714 1.5 8.6875 8 3 3.75 0.75 1.5 7.5 "
                "0.375 1.875 4.125 22.125"
            ),
        ),
        (
            lambda: rows(deliver(1.5, (4.0, 21.0), 6.0, [LATE], (-2.0, 30.0), 3.0)),
            (
                "-2 4 8 20 21 23 30 0 0 6 24 25.5 25.5 25.5 0 0 0 18 18 18 18 0 0 0 0 2 6 6 0 0 6 6 5.5 1.5"
                " 1.5 19 18.666667 18.666667 18 2 4 1.5"
            ),
        ),
        (
            lambda: rows(deliver(0.0, (0.0, 30.0), 6.0, [EARLY], (0.0, 30.0), 3.0)),
            "0 2 5 11 12.5 30 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0",
        ),
        (
            lambda: rows(deliver(2.0, (0.0, 5.0), 4.0, [], (0.0, 8.0), 1.0)),
            "0 2 5 8 0 4 10 10 0 0 6 6 0 0 0 0 0 4 4 4 4",
        ),
        (
            lambda: rows(deliver(2.0, (3.0, 3.5), 4.0, [LATE], (0.0, 23.0), 1.0)),
            "0 3 3.5 20 20.5 23 0 0 1 1 1 1 0 0 0 0 0 0 0 0 0 0 1 1 0 0 1 1 0 0 18 18 1 0",
        ),
        (
            lambda: rows(deliver(2.0, (0.0, 23.0), 1.0, [LATE], (0.0, 23.0), 0.0)),
            "0 0.5 20 23 0 1 40 46 0 0 39 39 0 0 0 6 0 1 1 1 20 0.5 20 0.5 1 5 1",
        ),
        (lambda: [deliver(1.5, (0.0, 30.0), INF, [EARLY, LATE], (0.0, 30.0), 0.0).largest_stored_bit], "22.125"),
        (lambda: SLABS.cdf([[0.0, 2.0, 2.5], [4.0, 8.999, 9.0]]), "0 0 0.15 0.6 0.6 0.75"),
        (lambda: [SLABS.cdf(3.0), SLABS.delivered_bit, SLABS.delivered_share], "0.3 7.5 0.75"),
        (lambda: [SLABS.quantile(share) for share in (0.0, 0.3, 0.6, 0.601, 0.75, 0.7501, 1.0)], "2 3 4 9 9 inf inf"),
        (lambda: pool([SLABS]).cdf([3.5, 99.0]), "0.45 0.75"),
        (
            lambda: [
                (none := Latency(np.empty(0), np.empty(0), np.empty(0), 0.0)).delivered_share,
                none.quantile(0.5),
                *none.cdf([1.0]),
            ],
            "nan nan nan",
        ),
        (
            lambda: [TABLE.rate_bit_s(38e6), TABLE.rate_bit_s(0.0), TABLE.rate_bit_s(42e6 * (1.0 + 1e-12))],
            "2e+09 2e+09 0",
        ),
        (lambda: RateTable((Step(5.0, 0.0), Step(2.0, INF))).rate_bit_s([[0.0, 1.0], [1e12, INF]]), "5 2 2 2"),
        (
            lambda: [
                (s := service(RateTable((Step(5.0, 0.0), Step(2.0, INF))), (3.0, 7.5), lambda t: 1e6 + t, 0.5)).edges_s,
                s.rate_bit_s,
            ],
            "3 7.5 2",
        ),
        (
            lambda: [(s := service(TABLE, (10.0, 10.0 + 5e-7), lambda t: 4e7 + t, 0.5)).edges_s - 10.0, s.rate_bit_s],
            "0 5e-07 1e+09",
        ),
        (
            lambda: [
                (s := service(TABLE, (0.0, 900.0), lambda t: 43e6 - 1e4 * t, 1.0)).edges_s,
                s.rate_bit_s,
                s.capacity_bit,
            ],
            "0 100 500 900 0 1e+09 2e+09 1.2e+12",
        ),
    ],
)
def test_parts_of_a_contact_stores_at_their_limits_and_slabs_of_latency_have_each_number(found, expected):
    told = np.hstack([np.ravel(np.asarray(each, dtype=np.float64)) for each in found()])
    assert told == pytest.approx([*map(float, expected.split())], rel=1e-6, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: contact_plan([], utc, ("A",), ()),
            (
                "# Contact plan: seconds after the reference time, rates in byte/s, one-way light times in "
                's.\n# node 1 is "A"\n@ 2026/03/20-12:00:00'
            ),
        ),
        (
            lambda: csv_text([], utc).replace("\n", "|"),
            (
                "satellite,relay,start (UTC),lock (UTC),end (UTC),start (s),lock (s),end (s),smallest range"
                " (m),largest range (m),rate (bit/s),volume (bit)"
            ),
        ),
        (
            lambda: "|".join(two([("A", "z"), ("B", "y"), ("A", "y"), ("B", "z")]).split("\n")[6::2]),
            "a contact +4 +9 1 3 10|a contact +4 +9 1 4 10|a contact +4 +9 2 3 10|a contact +4 +9 2 4 10",
        ),
        (
            lambda: "|".join(
                contact_plan([PlannedSession("A", "z", 1.0, 2.0, 3.0, 8.0, 1.0, 1.0, 0.0)], utc, "A", "z").split("\n")[
                    4:
                ]
            ),
            "a contact +2 +3 1 2 1|a range +2 +3 1 2 0",
        ),
        (
            lambda: "|".join(
                contact_plan([PlannedSession("A", "z", 1.0, 2.0, 3.0, 7.999, 1.0, 1.0, 9.0)], utc, "A", "z").split(
                    "\n"
                )[4:]
            ),
            "# left out, no whole byte a second: 1 2 from 2.000 s to 3.000 s",
        ),
        (
            lambda: "|".join(
                contact_plan([PlannedSession("A", "z", 1.0, 2.001, 3.999, 8.0, 1.0, 1.0, 9.0)], utc, "A", "z").split(
                    "\n"
                )[4:]
            ),
            "# left out, no whole second with data: 1 2 from 2.001 s to 3.999 s",
        ),
        (lambda: contact_plan([], utc, ("é\n" * 60,), ()).split("\n")[1][-12:], "n\\u00e9\\n\\u0"),
        (
            lambda: (
                csv_text([PlannedSession("a,b", 'say "x"', 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)], utc)
                .split("\n")[1]
                .partition(",2026")[0]
            ),
            '"a,b","say ""x"""',
        ),
        (lambda: spreadsheet_text("=1+1"), "'=1+1"),
        (lambda: spreadsheet_text("+1"), "'+1"),
        (lambda: spreadsheet_text("-1"), "'-1"),
        (lambda: spreadsheet_text("@a"), "'@a"),
        (lambda: spreadsheet_text("'a"), "''a"),
        (lambda: spreadsheet_text("a=b"), "a=b"),
        (lambda: spreadsheet_text(""), ""),
        (lambda: spreadsheet_text("\ta"), "'\ta"),
        (lambda: spreadsheet_text("\ra"), "'\ra"),
        (lambda: spreadsheet_text("\na"), "'\na"),
        (lambda: spreadsheet_text("\x1b[31m"), "\\u001b[31m"),
        (lambda: spreadsheet_text(" =1"), " =1"),
        (lambda: spreadsheet_text("a\x07"), "a\\u0007"),
    ],
)
def test_plans_of_nothing_of_equal_starts_and_of_names_that_steer_are_written_whole(found, expected):
    assert found() == expected


def test_where_nothing_arrived_no_share_has_a_latency():
    none = operations.Latency(np.zeros(0), np.zeros(0), np.zeros(0), 5.0)
    assert [none.quantile(share) for share in (0.0, 0.5)] == [math.inf, math.inf]


@pytest.mark.parametrize(("range_m", "taken"), [
    (0.0, True), (-0.0, True), (1e-9, True), (math.inf, True), (-1e-9, False), (-0.5, False), (math.nan, False),
])  # fmt: skip
def test_a_step_reaches_at_least_nothing_and_its_place_is_told(range_m, taken):
    steps = (Step(9.0, 4.0), Step(5.0, range_m))
    if taken:
        assert RateTable(steps).steps == steps
        return
    with pytest.raises(OperationsError) as refused:
        RateTable(steps)
    assert str(refused.value) == (f"the largest range of step 1 is {range_m:g} m; give at least 0 m, inf allowed")
