"""Intervals, contacts, passes and the line of sight against closed forms, dense grids, differences and skyfield."""

import itertools
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from microrad.core.earth import EARTH_RADIUS_M, FLATTENING, GEOSTATIONARY_RADIUS_M
from microrad.mission.tables.pointing import point_ahead_rad
from microrad.orbit.base import OrbitError, States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, GroundSite, Station, elevation_rad, gravity
from microrad.orbit.earth.sun import shadow_rad, sun_direction
from microrad.orbit.propagation.analytic import GeostationarySlot, KeplerOrbit, circular
from microrad.orbit.visibility import contacts as visible
from microrad.orbit.visibility import events, limits
from microrad.orbit.visibility.contacts import (
    Sampled,
    coarse_step_s,
    coarse_times,
    contacts,
    contacts_with_each,
    coplanar_contact,
    passes,
    station_range,
)
from microrad.orbit.visibility.limits import UNLIMITED, Limits, Terminal
from microrad.orbit.visibility.line_of_sight import sight
from microrad.orbit.visibility.stations import StationRows, pass_spans

DAY = (0.0, 86400.0)
WEEK = (0.0, 7.0 * 86400.0)
EPOCH = Epoch("2026-03-20T12:00:00Z")
ROUND, FLAT = Earth("sphere", 0.0), Earth("oblate", 100e3)
SLOT = GeostationarySlot("GEO", EPOCH, 0.3)
one_millisecond = 1e-3
one_nanoradian = 1e-9  # what a millisecond is worth at the top of a pass at 400 km: 4e-4 rad/s^2 x (1 ms)^2 / 2
one_second = 1.0
one_microsecond = 1e-6
deg = math.pi / 180.0
any_angle = st.floats(0.0, 2.0 * math.pi)


def leo(name="LEO", altitude_m=500e3, inclination_rad=97.4 * deg, node_rad=1.0, phase_rad=2.0, j2=False):
    return circular(name, EPOCH, altitude_m, inclination_rad, node_rad, phase_rad, j2)


def free(orbit):
    return Terminal(orbit, UNLIMITED, orbit.name)


def limited(orbit, attitude="free", boresight=(0.0, 0.0, 1.0), regard=math.pi, slew=math.inf, sun=0.0, night=True):
    return Terminal(orbit, Limits(attitude, boresight, regard, slew, sun, night), orbit.name)


def ends(found):
    return np.array([(c.start_s, c.end_s) for c in found]).reshape(-1, 2)


def inside(intervals, time_s):
    """Whether each time is in one of the intervals: behind an odd number of ends."""
    return np.searchsorted(intervals.ravel(), time_s) % 2 == 1


def far_from_ends(intervals, time_s, by_s):
    edges = np.concatenate(([-np.inf], intervals.ravel(), [np.inf]))
    after = np.searchsorted(edges, time_s)
    return (edges[after] - time_s > by_s) & (time_s - edges[after - 1] > by_s)


# ---- where a function is positive
waves = st.lists(
    st.tuples(st.floats(-2.0, 2.0), st.floats(0.01, 0.15), st.floats(0.0, 6.3)).map(lambda w: tuple(map(float, w))),
    min_size=1,
    max_size=3,
)


def summed(parts, offset):
    return lambda t: offset + sum(a * np.sin(w * t + p) for a, w, p in parts)


@pytest.mark.promise("day-14")
@settings(max_examples=60, deadline=None)
@given(waves, st.floats(-2.0, 2.0))
@example([(1.0, 0.15, 0.0)], -0.9999)
@example([(1.0, 0.15, 0.0)], 0.9999)
def test_positive_intervals_agree_with_a_dense_grid(parts, offset):
    f = summed(parts, offset)
    found = events.positive(f, np.arange(0.0, 101.0))
    dense = np.linspace(0.0, 100.0, 10007)
    values = f(dense)
    clear = far_from_ends(found, dense, 1e-5) & (np.abs(values) > 1e-7)
    np.testing.assert_array_equal(inside(found, dense)[clear], values[clear] > 0.0)


@pytest.mark.promise("day-14")
@settings(max_examples=60, deadline=None)
@given(waves, st.floats(-2.0, 2.0))
def test_every_end_is_a_change_of_sign_or_an_end_of_the_span(parts, offset):
    f = summed(parts, offset)
    found = events.positive(f, np.arange(0.0, 101.0))
    assert np.all(np.diff(found.ravel()) >= 0.0)
    assert (found.size > 0 and found[0, 0] == 0.0) or f(np.zeros(1))[0] < 1e-5
    steepest = sum(abs(a) * w for a, w, _ in parts)
    inner = found[(found > 0.0) & (found < 100.0)]
    assert np.all(np.abs(f(inner)) <= steepest * 1e-6 + 1e-15)


@pytest.mark.parametrize("centre", [40.0, 40.5, 40.37, 0.3, 99.7])
@pytest.mark.parametrize("width", [0.002, 0.1, 1.0, 1.9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_event_shorter_than_the_step_is_found(centre, width, sign):
    def f(t):
        return sign * ((0.5 * width) ** 2 - (t - centre) ** 2)

    found = events.positive(f, np.arange(0.0, 101.0))
    event = np.clip([[centre - 0.5 * width, centre + 0.5 * width]], 0.0, 100.0)
    wanted = event if sign > 0.0 else events.complement(event, (0.0, 100.0))
    np.testing.assert_allclose(found, wanted, atol=1e-5)


def test_a_touch_of_zero_is_neither_an_event_nor_a_gap():
    times = np.arange(0.0, 11.0)
    assert events.positive(lambda t: -((t - 5.0) ** 2), times).shape == (0, 2)
    np.testing.assert_array_equal(events.positive(lambda t: (t - 5.0) ** 2, times), [[0.0, 10.0]])


def test_a_jump_is_found_where_it_is():
    found = events.positive(lambda t: np.where(t < math.pi, -1.0, 3.0), np.arange(0.0, 11.0))
    np.testing.assert_allclose(found, [[math.pi, 10.0]], atol=1e-5)
    assert found[0, 1] == 10.0


def test_rows_are_solved_each_for_itself():
    shift = np.array([0.0, 1.0, 2.5])
    times = np.arange(0.0, 30.0)

    def f(t, row):
        return np.sin(0.3 * t + shift[row])

    together = events.positive_rows(f, times, f(times[None, :], np.arange(3)[:, None]))
    for row, one in enumerate(together):
        np.testing.assert_allclose(one, events.positive(lambda t, r=row: np.sin(0.3 * t + shift[r]), times), atol=1e-6)


def test_what_cannot_be_searched_is_refused():
    for times in ([0.0, 2.0, 1.0], [0.0, 1.0, 1.0, 2.0]):
        with pytest.raises(OrbitError, match="do not rise; sort them"):
            events.positive(np.sin, np.array(times))
    with pytest.raises(OrbitError, match="not finite at 0 s"):
        events.positive(lambda t: np.where(t == 0.0, np.inf, t), np.arange(3.0))
    with pytest.raises(OrbitError, match="at least 3"):
        events.positive(np.sin, np.array([0.0, 2.0]))
    with pytest.raises(OrbitError, match=r"\(2, 4\) values at 3 times; give as many values as times"):
        events.positive_rows(lambda t, row: t + row, np.arange(3.0), np.zeros((2, 4)))
    with pytest.raises(OrbitError, match="not finite at 2 s"):
        events.positive(lambda t: np.where(t == 2.0, np.nan, t), np.arange(4.0))


@pytest.mark.parametrize("peak", [0.0, 3.21, 7.0])
def test_the_largest_in_a_window_is_found(peak):
    when, value = events.largest(lambda t: -((t - peak) ** 2), np.array([[0.0, 7.0], [2.0, 4.0]]), 1.0)
    np.testing.assert_allclose(when, [peak, np.clip(peak, 2.0, 4.0)], atol=events.SHORTEST_S)
    np.testing.assert_allclose(value, [0.0, -((np.clip(peak, 2.0, 4.0) - peak) ** 2)], atol=1e-2 * events.SHORTEST_S)


def test_the_largest_is_searched_for_in_all_windows_at_once():
    """Against a dense grid in each window; the rounds are those of one window, however many there are."""
    starts = np.cumsum(np.random.Generator(np.random.Philox(7)).uniform(5.0, 90.0, 40))
    lengths = np.concatenate((np.geomspace(1e-4, 10.0, 20), np.linspace(20.0, 60.0, 20)))
    windows = np.stack((starts, starts + lengths), axis=1)
    rounds = []

    def f(t):
        rounds.append(t.size)
        return np.sin(0.05 * t) + 0.1 * np.cos(0.07 * t)

    when, value = events.largest(f, windows, 1.0)
    assert len(rounds) < 8
    assert np.sum((when > windows[:, 0]) & (when < windows[:, 1])) >= 3
    for (start, end), at, found in zip(windows, when, value, strict=True):
        dense = np.linspace(start, end, 20001)
        best = int(np.argmax(f(dense)))
        assert start <= at <= end and at == pytest.approx(dense[best], abs=events.SHORTEST_S + dense[1] - dense[0])
        assert found == f(at) and found == pytest.approx(f(dense[best]), abs=1e-3 * events.SHORTEST_S)
    assert [part.shape for part in events.largest(f, np.empty((0, 2)), 1.0)] == [(0,), (0,)]


# ---- algebra of intervals, on whole numbers against sets of cells
cell_sets = st.sets(st.integers(0, 19))


def as_intervals(cells):
    """Each cell an interval of its own: touching ones are not joined."""
    return np.array([(float(c), c + 1.0) for c in sorted(cells)]).reshape(-1, 2)


def as_cells(intervals):
    return {c for start, end in intervals for c in range(int(start), int(end))}


@given(cell_sets, cell_sets, cell_sets)
def test_the_algebra_is_that_of_sets(a, b, c):
    sets = tuple(events.union(as_intervals(x)) for x in (a, b, c))
    assert as_cells(events.union(*sets)) == a | b | c
    assert as_cells(events.intersection(*sets)) == a & b & c
    assert as_cells(events.complement(sets[0], (0.0, 20.0))) == set(range(20)) - a
    for result in (events.union(*sets), events.intersection(*sets), events.complement(sets[0], (0.0, 20.0))):
        assert np.all(np.diff(result.ravel()) > 0.0)  # sorted, apart, none empty


def test_the_complement_ends_with_the_span():
    np.testing.assert_array_equal(events.complement(np.array([[-5.0, 2.0], [8.0, 20.0]]), (0.0, 10.0)), [[2.0, 8.0]])
    np.testing.assert_array_equal(events.complement(np.array([[20.0, 30.0]]), (0.0, 10.0)), [[0.0, 10.0]])


def test_the_complement_of_the_complement_is_the_set():
    a = np.array([[0.0, 1.5], [2.25, 7.0]])
    span = (0.0, 7.0)
    np.testing.assert_array_equal(events.complement(events.complement(a, span), span), a)


# ---- the numbers checked by hand: a low orbit in the plane of the equator
@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-41")
@pytest.mark.parametrize(("grazing_m", "minutes"), [(0.0, 58.12), (100e3, 56.72)])
def test_a_coplanar_contact_takes_as_long_by_search_as_by_hand(grazing_m, minutes):
    by_hand = coplanar_contact(EARTH_RADIUS_M + 500e3, grazing_m)
    assert round(by_hand.duration_s / 60.0, 2) == minutes
    for shape in ("sphere", "oblate"):
        found = contacts(free(leo(inclination_rad=0.0)), free(SLOT), Earth(shape, grazing_m), EPOCH, DAY)[1:-1]
        assert len(found) >= 12
        np.testing.assert_allclose([c.duration_s for c in found], by_hand.duration_s, rtol=0, atol=one_millisecond)
        repeats = np.diff([c.start_s for c in found])
        np.testing.assert_allclose(repeats, by_hand.repeat_s, rtol=0, atol=one_millisecond)


def test_the_range_in_a_coplanar_contact_goes_from_35286_to_44253_km():
    low, by_hand = leo(inclination_rad=0.0), coplanar_contact(EARTH_RADIUS_M + 500e3, 0.0)
    assert (int(by_hand.shortest_range_m / 1e3), int(by_hand.longest_range_m / 1e3)) == (35286, 44253)
    assert by_hand.shortest_range_m == pytest.approx(GEOSTATIONARY_RADIUS_M - EARTH_RADIUS_M - 500e3, abs=1e-6)
    one = contacts(free(low), free(SLOT), ROUND, EPOCH, DAY)[1]
    seen = sight(low, SLOT, np.linspace(one.start_s, one.end_s, 10001))
    assert seen.range_m.min() == pytest.approx(by_hand.shortest_range_m, abs=1.0)
    np.testing.assert_allclose(seen.range_m[[0, -1]], by_hand.longest_range_m, atol=1.0)
    assert by_hand.visible_share == pytest.approx(by_hand.duration_s / by_hand.repeat_s)


@pytest.mark.parametrize(
    "radius_m",
    [6000e3, EARTH_RADIUS_M + 100e3, GEOSTATIONARY_RADIUS_M, 42200e3, math.nan],
)
def test_a_coplanar_orbit_below_the_air_or_above_the_slot_is_refused(radius_m):
    with pytest.raises(OrbitError, match="not between the surface to clear"):
        coplanar_contact(radius_m, 100e3)


# ---- the numbers checked by hand: a sun-synchronous orbit at 500 km, one day, over node and phase
def all_nodes_and_phases(earth):
    grid = itertools.product(np.arange(0.0, 360.0, 15.0) * deg, np.arange(0.0, 360.0, 60.0) * deg)
    return [contacts(free(leo(node_rad=n, phase_rad=p)), free(SLOT), earth, EPOCH, DAY) for n, p in grid]


@pytest.mark.parametrize(
    ("grazing_m", "shares"), [(0.0, (65, 69)), pytest.param(100e3, (63, 66), marks=pytest.mark.endurance)]
)
def test_a_sun_synchronous_orbit_has_15_contacts_a_day(grazing_m, shares):
    """15 is the usual number. Near 6 h from the slot's plane the satellite is not hidden at all for some turns, and
    contacts join; contacts cut by the day's ends may add one or two."""
    days = all_nodes_and_phases(Earth("sphere", grazing_m))
    counts, many = np.unique([len(day) for day in days], return_counts=True)
    assert counts[np.argmax(many)] == 15
    assert set(counts) <= {12, 13, 14, 15, 16, 17}
    share = [100.0 * sum(c.duration_s for c in day) / 86400.0 for day in days]
    assert (math.floor(min(share)), math.floor(max(share))) in {shares, (shares[0], shares[1] - 1)}
    assert min(share) > shares[0] and max(share) < shares[1] + 0.5
    middle = np.array([np.median([c.duration_s for c in day]) / 60.0 for day in days])
    low, high = {0.0: (54.4, 56.7), 100e3: (53.1, 55.1)}[grazing_m]
    assert low < middle.min() and middle.max() < high
    if grazing_m == 0.0:
        assert round(float(np.median(middle))) == 56


def test_rate_doppler_shift_and_point_ahead_reach_what_was_checked_by_hand():
    time_s = np.arange(0.0, 86400.0, 20.0)
    most = np.zeros(3)
    for node in np.arange(0.0, 360.0, 15.0) * deg:
        low = leo(node_rad=node)
        seen = sight(low, SLOT, time_s)
        free_of_earth = ROUND.clearance_rad(low.states(time_s).position_m, SLOT.states(time_s).position_m) > 0.0
        each = seen.rate_rad_s * 1e6, np.abs(seen.doppler_hz(1.55e-6)) / 1e9, seen.point_ahead_rad * 1e6
        most = np.maximum(most, [value[free_of_earth].max() for value in each])
    assert (round(most[0]), round(most[1], 2), round(most[2])) == (255, 4.95, 71)


# ---- contacts against a dense grid: a segment and an ellipsoid
def segment_is_clear(first_m, second_m, earth):
    """Whether no point of the segment is within the raised ellipsoid, by the closest point in scaled coordinates."""
    polar = EARTH_RADIUS_M * (1.0 - FLATTENING if earth.shape == "oblate" else 1.0)
    axes = np.array([[EARTH_RADIUS_M], [EARTH_RADIUS_M], [polar]]) + earth.grazing_height_m
    p, q = first_m / axes, second_m / axes
    share = np.clip(-np.sum(p * (q - p), axis=0) / np.sum((q - p) ** 2, axis=0), 0.0, 1.0)
    return np.linalg.norm(p + share * (q - p), axis=0) > 1.0


PARTNERS = {
    "geostationary": SLOT,
    "another low orbit": leo("other", 800e3, 55.0 * deg, 0.3, 1.0, True),
    "against it": leo("other", 520e3, 82.6 * deg, 1.0 + math.pi, -2.0),
    "elongated": KeplerOrbit("other", EPOCH, 26560e3, 0.72, 63.4 * deg, 1.0, 4.7, 0.0, True),
}


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-11", "day-13", "day-15", "day-41", "day-42")
@pytest.mark.parametrize("partner", PARTNERS.values(), ids=PARTNERS.keys())
@pytest.mark.parametrize("earth", [ROUND, FLAT], ids=["sphere", "oblate"])
def test_contacts_agree_with_a_dense_grid(partner, earth):
    low = leo()
    found = ends(contacts(free(low), free(partner), earth, EPOCH, DAY))
    dense = np.arange(0.0, 86400.0, 1.0)
    clear = segment_is_clear(low.states(dense).position_m, partner.states(dense).position_m, earth)
    sure = far_from_ends(found, dense, one_millisecond)
    assert len(found) > 2
    np.testing.assert_array_equal(inside(found, dense)[sure], clear[sure])


@pytest.mark.promise("day-41")
@settings(max_examples=10, deadline=None)
@given(any_angle, any_angle, st.floats(0.0, math.pi), st.booleans())
def test_visibility_is_the_same_both_ways_to_the_last_bit(node, phase, inclination, oblate):
    low = limited(leo(node_rad=node, phase_rad=phase, inclination_rad=inclination), "nadir", (1.0, 0.0, -0.5), 1.7)
    high = limited(SLOT, "nadir", regard=0.15, sun=5.0 * deg)
    earth = FLAT if oblate else ROUND
    assert contacts(low, high, earth, EPOCH, DAY) == contacts(high, low, earth, EPOCH, DAY)


def test_contacts_with_each_are_those_with_one_with_and_without_samples():
    satellite = free(leo())
    relays = [limited(GeostationarySlot(f"GEO {k}", EPOCH, 1.5 * k), "nadir", regard=0.14) for k in range(3)]
    kept = [Sampled.over(r.orbit, DAY, coarse_step_s(satellite.orbit, 0.0)) for r in relays]
    alone = [contacts(satellite, relay, FLAT, EPOCH, DAY) for relay in relays]
    coarse = [Sampled.over(r.orbit, DAY) for r in relays]
    for samples in ((), kept, coarse):
        together = contacts_with_each(satellite, relays, FLAT, EPOCH, DAY, samples)
        for one, other in zip(together, alone, strict=True):
            assert [(c.begins, c.ends) for c in one] == [(c.begins, c.ends) for c in other]
            np.testing.assert_allclose(ends(one), ends(other), rtol=0, atol=one_microsecond)
    assert contacts_with_each(satellite, (), FLAT, EPOCH, DAY) == ()


def test_samples_kept_are_used(monkeypatch):
    relay = free(SLOT)
    kept = Sampled.over(SLOT, DAY, 60.0)
    asked = []
    states = GeostationarySlot.states
    monkeypatch.setattr(GeostationarySlot, "states", lambda self, t: asked.append(np.size(t)) or states(self, t))
    contacts_with_each(free(leo()), [relay], ROUND, EPOCH, DAY, [kept])
    assert max(asked) < 1441


@pytest.mark.parametrize("furthest_m", [0.0, -1.0])
def test_a_link_that_closes_nowhere_has_no_contact_with_any_relay(furthest_m):
    relays = [free(SLOT), free(GeostationarySlot("other", EPOCH, 0.3))]
    assert contacts_with_each(free(leo()), relays, ROUND, EPOCH, DAY, furthest_m=furthest_m) == ((), ())
    assert contacts_with_each(free(leo()), [], ROUND, EPOCH, DAY, furthest_m=furthest_m) == ()


def test_the_steps_follow_the_perigee():
    assert coarse_step_s(leo(), 0.0) == coarse_step_s(leo(altitude_m=120e3, j2=True), 0.0) == 60.0
    assert coarse_step_s(SLOT, 0.0) == 960.0
    assert coarse_step_s(KeplerOrbit("GTO", EPOCH, 24400e3, 0.72, 0.1, 0.0, 0.0, 3.0, False), 0.0) == 30.0
    np.testing.assert_array_equal(coarse_times((10.0, 100.0), 60.0), [10.0, 32.5, 55.0, 77.5, 100.0])
    for span_s in ((5.0, 5.0), (-math.inf, 5.0), (5.0, math.inf)):
        with pytest.raises(OrbitError, match="holds no time; give a start and a later end"):
            coarse_times(span_s, 60.0)
    with pytest.raises(OrbitError, match=r"in steps of 1e-06 s, more than 5e\+06 of them"):
        coarse_times(DAY, 1e-6)


def test_a_search_has_as_many_samples_as_it_may_and_not_one_more(monkeypatch):
    monkeypatch.setattr(visible, "_MOST_SAMPLES", 8)
    assert coarse_times((0.0, 480.0), 60.0).size == 9
    with pytest.raises(OrbitError, match="give a shorter span"):
        coarse_times((0.0, 480.1), 60.0)


@pytest.mark.parametrize("velocity", [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1e200, 0.0, 1.0], [math.nan, 0.0, 0.0]])
def test_a_state_without_a_perigee_is_refused(velocity):
    position_m = np.array([[7e6], [0.0], [0.0]])
    orbit = SimpleNamespace(name="X", states=lambda time_s: States(position_m, np.array(velocity)[:, None]))
    with pytest.raises(OrbitError, match="moves straight to or from the Earth's centre, or is no number"):
        coarse_step_s(orbit, 0.0)


def test_the_ends_of_the_span_are_ends_of_contacts():
    whole = contacts(free(leo()), free(SLOT), ROUND, EPOCH, DAY)
    middle = 0.5 * (whole[3].start_s + whole[3].end_s)
    first, *_, last = contacts(free(leo()), free(SLOT), ROUND, EPOCH, (middle, middle + 20000.0))
    assert (first.start_s, first.begins, first.ends) == (middle, "start of the span", "Earth")
    assert first.end_s == pytest.approx(whole[3].end_s, abs=one_microsecond)
    assert last.end_s <= middle + 20000.0
    (short,) = contacts(free(leo()), free(SLOT), ROUND, EPOCH, (middle, middle + 1.0))
    assert (short.begins, short.ends, short.duration_s) == ("start of the span", "end of the span", 1.0)


# ---- limits against a dense grid, by angles
def plain_axes(attitude, states, sun):
    """The axes of a body, (n, 3 axes, 3 components), with numpy's own products."""
    r, v, s = states.position_m.T, states.velocity_m_s.T, sun.T
    down = -r / np.linalg.norm(r, axis=1)[:, None]
    if attitude == "nadir":
        y = np.cross(v, r)
        y /= np.linalg.norm(y, axis=1)[:, None]
        return np.stack((np.cross(y, down), y, down), axis=1)
    z = down - np.sum(down * s, axis=1)[:, None] * s
    z /= np.linalg.norm(z, axis=1)[:, None]
    return np.stack((s, np.cross(z, s), z), axis=1)


def plain_direction(one, other, time_s):
    """Direction to the partner in the body of a terminal, (n, 3)."""
    states, sun = one.orbit.states(time_s), sun_direction(EPOCH, time_s)
    away = (other.orbit.states(time_s).position_m - states.position_m).T
    away /= np.linalg.norm(away, axis=1)[:, None]
    if one.limits.attitude == "free":
        return away
    return np.einsum("nij,nj->ni", plain_axes(one.limits.attitude, states, sun), away)


def angle(a, b):
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def margins(one, other, time_s):
    """By how much the limits of a terminal hold, each by its angle; the rate in units of its limit."""
    limits, sun = one.limits, sun_direction(EPOCH, time_s)
    boresight = np.array(limits.boresight) / np.linalg.norm(limits.boresight)
    before, after = (plain_direction(one, other, time_s + by) for by in (-0.05, 0.05))
    states = one.orbit.states(time_s)
    night = shadow_rad(states.position_m, sun, "oblate")
    away = other.orbit.states(time_s).position_m - states.position_m
    off_sun = angle((away / np.linalg.norm(away, axis=0)).T, sun.T) - limits.sun_exclusion_rad
    return {
        f"field of regard of {one.name}": limits.field_of_regard_rad
        - angle(plain_direction(one, other, time_s), boresight),
        f"slew limit of {one.name}": 1.0 - angle(before, after) / 0.1 / limits.slew_limit_rad_s,
        f"Sun near the line of sight of {one.name}": np.maximum(off_sun, night),
        f"eclipse of {one.name}": np.full(time_s.shape, np.inf) if limits.in_eclipse else -night,
    }


def all_margins(pair, time_s):
    clear = segment_is_clear(*(t.orbit.states(time_s).position_m for t in pair), FLAT)
    return {"Earth": np.where(clear, 1.0, -1.0)} | margins(*pair, time_s) | margins(*pair[::-1], time_s)


NEAR = leo("near", 505e3, 97.0 * deg, 1.0, 2.03)  # 200 km ahead at first
LIMITED = {
    "field of regard, nadir": (limited(leo(), "nadir", (1.0, 0.3, -0.7), 80 * deg), free(SLOT)),
    "field of regard, sun": (limited(leo(), "sun", (0.0, 1.0, -1.0), 60 * deg), free(SLOT)),
    "both fields of regard": (limited(leo(), "nadir", (0, 0, -1), 85 * deg), limited(SLOT, "nadir", regard=6 * deg)),
    "slew, free": (limited(leo(), slew=150e-6), free(SLOT)),
    "slew, nadir": (limited(leo(), "nadir", slew=1100e-6), free(SLOT)),
    "slew, sun": (limited(leo(), "sun", slew=1500e-6), free(SLOT)),
    "sun": (limited(leo(), sun=40 * deg), limited(SLOT, sun=20 * deg)),
    "eclipse": (limited(leo(), night=False), free(SLOT)),
    "two near one another": (limited(leo(), "nadir", (0, 1, 0), 30 * deg, 4e-3), limited(NEAR, slew=5e-3)),
    "all": (
        limited(leo(), "nadir", (1.0, 0.3, -0.7), 80 * deg, 1300e-6, 30 * deg, False),
        limited(SLOT, "sun", (0.0, 0.0, 1.0), 95 * deg, math.inf, 10 * deg, False),
    ),
}


@pytest.mark.promise("readme-8", "day-43")
@pytest.mark.promise("day-5", "day-16", "day-17", "day-41")
@pytest.mark.parametrize("pair", LIMITED.values(), ids=LIMITED.keys())
def test_limits_agree_with_a_dense_grid_and_name_the_cause(pair):
    """Up to half a thousandth of the rate: an orbit without drifts does not turn as gravity with J2 would turn it."""
    found = contacts(*pair, FLAT, EPOCH, DAY)
    dense = np.arange(1.0, 86400.0, 20.0)
    hold = all_margins(pair, dense)
    assert any(np.any(each < 0.0) for cause, each in hold.items() if cause != "Earth"), "the limit is never met"
    least = np.min(list(hold.values()), axis=0)
    sure = far_from_ends(ends(found), dense, 0.1) & (np.abs(least) > 5e-4)
    assert np.mean(sure) > 0.98
    np.testing.assert_array_equal(inside(ends(found), dense)[sure], least[sure] > 0.0)
    edges = [(c.start_s - 0.1, c.begins) for c in found] + [(c.end_s + 0.1, c.ends) for c in found]
    edges = [(when, cause) for when, cause in edges if "span" not in cause]
    beyond = all_margins(pair, np.array([when for when, _ in edges]))
    for index, (_, cause) in enumerate(edges):
        assert {name for name, margin in beyond.items() if margin[index] < 5e-4} >= set(cause.split(" and "))


def test_a_limit_broken_for_seconds_between_two_samples_is_found():
    """Two satellites 20 km apart at 15 km/s: the line of sight turns round in less than the step of 60 s."""
    low, other = leo(), PARTNERS["against it"]
    found = contacts(limited(low, slew=0.2), free(other), ROUND, EPOCH, (0.0, 12000.0))
    edges = [c.end_s for c in found if c.ends == "slew limit of LEO"]
    edges += [c.start_s for c in found if c.begins == "slew limit of LEO"]
    dense = np.arange(0.0, 12000.0, 0.1)
    fast = sight(low, other, dense).rate_rad_s > 0.2
    changes = dense[1:][fast[1:] != fast[:-1]]
    assert len(changes) == 8
    np.testing.assert_allclose(np.sort(edges), changes, rtol=0, atol=0.1)
    np.testing.assert_allclose(sight(low, other, np.sort(edges)).rate_rad_s, 0.2, rtol=1e-5)


@pytest.mark.promise("day-16")
@pytest.mark.parametrize("held", ["nadir", "sun"])
@pytest.mark.parametrize("orbit", [leo(), SLOT, PARTNERS["elongated"]], ids=["low", "slot", "elongated"])
def test_the_rate_of_a_body_is_that_of_its_axes(held, orbit):
    time_s, by = np.arange(100.0, 86400.0, 500.0), 0.5
    states, sun = orbit.states(time_s), sun_direction(EPOCH, time_s)
    rate = limits.body_rate_rad_s(held, states, sun)
    before, after = (limits.body_axes(held, orbit.states(t), sun) for t in (time_s - by, time_s + by))
    now = limits.body_axes(held, states, sun)
    np.testing.assert_allclose(now, np.moveaxis(plain_axes(held, states, sun), 0, -1), atol=1e-14)
    for axis in range(3):
        turned = np.cross(rate, now[axis], axis=0)
        tolerance = 1e-3 * np.linalg.norm(rate, axis=0).max()
        np.testing.assert_allclose(turned, (after[axis] - before[axis]) / (2 * by), rtol=0, atol=tolerance)


class Integrated:
    """Motion under gravity with the flattening, by an integrator of order 8 with its own interpolation."""

    def __init__(self, name, orbit):
        def slope(_, y):
            return np.concatenate((y[3:], gravity(y[:3, None], True)[:, 0]))

        start = np.concatenate([vector[:, 0] for vector in orbit.states(np.zeros(1))])
        self.name = name
        self.solution = solve_ivp(slope, (0.0, 6000.0), start, "DOP853", rtol=1e-12, atol=1e-6, dense_output=True).sol

    def states(self, time_s):
        both = self.solution(time_s)
        return States(both[:3], both[3:])


def test_gravity_turns_the_normal_of_an_orbit_and_with_it_the_body():
    orbit, by = Integrated("LEO", leo()), 5.0
    time_s = np.arange(100.0, 5900.0, 100.0)
    sun = np.tile([[1.0], [0.0], [0.0]], time_s.size)
    states = orbit.states(time_s)
    rate = limits.body_rate_rad_s("nadir", states, sun)
    lift = np.abs(np.sum(rate * states.position_m, axis=0)) / np.linalg.norm(states.position_m, axis=0)
    assert lift.max() > 3e-7
    before, now, after = (limits.body_axes("nadir", orbit.states(time_s + h), sun)[1] for h in (-by, 0.0, by))
    slope = (after - before) / (2.0 * by)  # of the orbit normal, which nothing else turns
    np.testing.assert_allclose(np.cross(rate, now, axis=0), slope, rtol=0, atol=1e-4 * lift.max())


def test_no_times_have_no_clearance():
    none = np.zeros((3, 0))
    assert FLAT.clearance_rad(none, none).shape == (0,)


@pytest.mark.promise("day-17")
def test_the_sun_behind_the_earth_does_not_blind():
    """At an equinox the Sun, the Earth and a slot are in one line once a day."""
    blind = limited(SLOT, sun=60 * deg)
    found = contacts(free(leo()), blind, ROUND, EPOCH, DAY)
    dense = np.arange(0.0, 86400.0, 5.0)
    night = shadow_rad(SLOT.states(dense).position_m, sun_direction(EPOCH, dense), "sphere") > 0.0
    seen = inside(ends(found), dense)
    assert np.any(seen & night) and "Sun near the line of sight of GEO" in {c.ends for c in found}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"attitude": "spin"}, "attitude 'spin' is not known; write nadir, sun or free"),
        ({"boresight": (0.0, 0.0, 0.0)}, "has no direction"),
        ({"boresight": (0.0, math.nan, 1.0)}, "has no direction"),
        ({"boresight": (0.0, 1.0)}, "has no direction; give three numbers"),
        (
            {"field_of_regard_rad": 0.0},
            "Limits.field_of_regard_rad is 0 deg: it must be finite, above 0 deg, at most 180 deg",
        ),
        ({"field_of_regard_rad": 3.2}, "Limits.field_of_regard_rad is 183.3 deg: it must be finite"),
        ({"field_of_regard_rad": 1.0}, 'means nothing with the attitude "free"'),
        ({"slew_limit_rad_s": 0.0}, "slew limit of 0 rad/s is not above 0"),
        (
            {"sun_exclusion_rad": -0.1},
            "Limits.sun_exclusion_rad is -5.73 deg: it must be finite, at least 0 deg and below 180 deg",
        ),
        ({"sun_exclusion_rad": math.nan}, "Limits.sun_exclusion_rad is nan deg: it must be finite"),
        ({"boresight": (0.0, 0.0, 1.0, 0.0)}, "the boresight (0.0, 0.0, 1.0, 0.0) has no direction"),
        ({"boresight": (1.0,)}, "the boresight (1.0,) has no direction"),
        ({"boresight": (math.inf, 0.0, 1.0)}, "the boresight (inf, 0.0, 1.0) has no direction"),
        ({"boresight": (0.0, 0.0, -math.inf)}, "the boresight (0.0, 0.0, -inf) has no direction"),
        ({"slew_limit_rad_s": math.nan}, "a slew limit of nan rad/s is not above 0"),
        ({"field_of_regard_rad": math.nan}, "Limits.field_of_regard_rad is nan deg: it must be finite"),
        ({"sun_exclusion_rad": math.pi}, "Limits.sun_exclusion_rad is 180 deg: it must be finite, at least 0 deg"),
    ],
)
def test_limits_that_mean_nothing_are_refused(changed, message):
    values = {key: getattr(UNLIMITED, key) for key in Limits.__slots__}
    with pytest.raises(OrbitError) as refused:
        Limits(**(values | changed))
    assert message in str(refused.value)


def test_two_terminals_of_one_name_or_in_one_place_are_refused():
    with pytest.raises(OrbitError, match='two terminals are called "LEO"'):
        contacts(free(leo()), free(leo()), ROUND, EPOCH, DAY)
    with pytest.raises(OrbitError, match="LEO and twin are at the same place at 0 s"):
        contacts(limited(leo(), slew=1e-3), Terminal(leo(), UNLIMITED, "twin"), ROUND, EPOCH, DAY)
    with pytest.raises(OrbitError, match="LEO and LEO are at the same place"):
        sight(leo(), leo(), [0.0])


def test_a_terminal_below_the_grazing_height_is_refused_by_name():
    low = Terminal(leo(), UNLIMITED, "own terminal")
    for surface in (Earth("oblate", 600e3), Earth("sphere", 600e3)):
        for pair in ((low, free(SLOT)), (free(SLOT), low)):
            name, height_m, time_s = too_low(*pair, surface, 600)
            assert name == "own terminal"
            at = low.orbit.states(np.array([time_s])).position_m[:, 0]
            assert height_m == pytest.approx(height_over(surface, at), abs=0.6)
            assert height_m == pytest.approx(500e3, abs=50.0)  # the lowest sample: the one nearest to the equator


def too_low(first, second, surface, grazing_km):
    """Name, height and time of the refusal."""
    with pytest.raises(OrbitError) as refused:
        contacts(first, second, surface, EPOCH, DAY)
    end = f" s, not above the {grazing_km} km that lines of sight must clear; lower orbit.grazing_height, or raise the "
    found = re.fullmatch(r"(.+) is (\d+\.\d{3}) km over the Earth at ([\d.]+)" + end + "orbit", str(refused.value))
    assert found, str(refused.value)
    return found[1], float(found[2]) * 1e3, float(found[3])


def height_over(surface, position_m):
    """The distance to the nearest of many points of the meridian's ellipse, or circle."""
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 1_000_001)
    polar = EARTH_RADIUS_M * (1.0 - FLATTENING if surface.shape == "oblate" else 1.0)
    across = math.hypot(position_m[0], position_m[1])
    return np.hypot(across - EARTH_RADIUS_M * np.cos(angle), position_m[2] - polar * np.sin(angle)).min()


@pytest.mark.promise("day-11")
@pytest.mark.parametrize("surface", [ROUND, FLAT], ids=["sphere", "oblate"])
def test_the_height_over_the_earth_is_the_distance_to_its_figure(surface):
    position_m = leo(phase_rad=0.0).states(np.linspace(0.0, 1420.0, 5)).position_m
    wanted = [height_over(surface, position) for position in position_m.T]
    np.testing.assert_allclose(surface.height_m(position_m), wanted, rtol=0, atol=0.01)
    assert np.ptp(wanted) == pytest.approx(0.0 if surface is ROUND else 21.3e3, abs=500.0)


def test_a_terminal_that_is_too_low_between_two_samples_is_named():
    def states(time_s):
        return States(*(np.where(time_s % 60.0 == 0.0, x, 0.1 * x) for x in SLOT.states(time_s)))

    broken = Terminal(SimpleNamespace(name="x", states=states), UNLIMITED, "GEO 2")
    with pytest.raises(OrbitError, match=r"GEO 2 is -2161\.720 km over the Earth at "):
        contacts_with_each(free(leo()), [free(SLOT), broken], ROUND, EPOCH, DAY)


def test_a_position_that_is_no_number_is_refused_by_name():
    def states(time_s):
        return States(*(np.where(time_s == 600.0, np.nan, x) for x in leo().states(time_s)))

    broken = SimpleNamespace(name="LEO", states=states)
    with pytest.raises(OrbitError, match="the position of LEO at 600 s is not a number; check its orbit"):
        contacts(free(SLOT), free(broken), ROUND, EPOCH, DAY)


def test_a_decayed_orbit_is_told_what_to_raise():
    with pytest.raises(OrbitError, match="raise the altitude or the semi-major axis, or lower the eccentricity"):
        leo(altitude_m=110e3)


# ---- the line of sight against differences
MOVING = {"slot": SLOT, "low": PARTNERS["another low orbit"], "elongated": PARTNERS["elongated"]}


@pytest.mark.parametrize("partner", MOVING.values(), ids=MOVING.keys())
def test_the_rates_of_the_line_of_sight_are_those_of_its_differences(partner):
    low, other = Integrated("LEO", leo()), Integrated("other", partner)
    time_s, by = np.arange(100.0, 5900.0, 50.0), 0.5
    before, now, after = (sight(low, other, time_s + h) for h in (-by, 0.0, by))
    assert now.direction.shape == (3, time_s.size)
    np.testing.assert_allclose(np.linalg.norm(now.direction, axis=0), 1.0, rtol=1e-15)
    closing = (after.range_m - before.range_m) / (2.0 * by)
    np.testing.assert_allclose(now.range_rate_m_s, closing, rtol=0, atol=0.01)
    rate = np.linalg.norm(after.direction - before.direction, axis=0) / (2.0 * by)
    np.testing.assert_allclose(now.rate_rad_s, rate, rtol=1e-5)
    np.testing.assert_allclose(now.transverse_velocity_m_s, rate * now.range_m, rtol=1e-5)
    # the change of the rate as a vector: the product of the direction and its second difference
    second = (after.direction - 2.0 * now.direction + before.direction) / by**2
    change = np.linalg.norm(np.cross(now.direction, second, axis=0), axis=0)
    np.testing.assert_allclose(now.acceleration_rad_s2, change, rtol=0, atol=1e-5 * change.max())


def test_the_line_of_sight_is_the_same_from_the_other_end():
    there, back = sight(leo(), SLOT, np.arange(0.0, 6000.0, 100.0)), sight(SLOT, leo(), np.arange(0.0, 6000.0, 100.0))
    np.testing.assert_array_equal(there.direction, -back.direction)
    for name in ("range_m", "range_rate_m_s", "rate_rad_s", "acceleration_rad_s2", "point_ahead_rad"):
        np.testing.assert_array_equal(getattr(there, name), getattr(back, name))


def test_point_ahead_and_doppler_shift_are_those_of_the_velocities():
    seen = sight(leo(), SLOT, np.arange(0.0, 6000.0, 100.0))
    np.testing.assert_array_equal(seen.point_ahead_rad, [point_ahead_rad(v) for v in seen.transverse_velocity_m_s])
    np.testing.assert_array_equal(seen.doppler_hz(1e-6), -seen.range_rate_m_s / 1e-6)
    coming = np.flatnonzero(np.diff(seen.range_m) < 0.0)[0]
    assert seen.doppler_hz(1e-6)[coming] > 0.0
    with pytest.raises(OrbitError, match="give one above 0 m"):
        seen.doppler_hz(0.0)


# ---- skyfield
LEO_ELEMENTS = {"bstar": 5e-5, "ecco": 0.0012, "argpo": 1.2, "inclo": 97.4 * deg, "mo": 0.7, "no": 15.2, "nodeo": 2.0}
GEO_ELEMENTS = {"bstar": 0.0, "ecco": 3e-4, "argpo": 0.4, "inclo": 0.05 * deg, "mo": 2.4, "no": 1.00273, "nodeo": 1.0}


def satellite_record(bstar, ecco, argpo, inclo, mo, no, nodeo):
    from sgp4.api import WGS72, Satrec

    record = Satrec()
    since_1949 = sum(EPOCH.julian_date) - 2433281.5 - 0.4
    record.sgp4init(
        WGS72, "i", 90001, since_1949, bstar, 0.0, 0.0, ecco, argpo, inclo, mo, no * 2 * math.pi / 1440, nodeo
    )
    return record


class FromRecord:
    """An orbit by SGP4, with nothing between."""

    def __init__(self, name, record):
        self.name, self.record = name, record

    def states(self, time_s):
        day, share = EPOCH.julian_date
        error, r, v = self.record.sgp4_array(np.full(time_s.shape, day), share + time_s / 86400.0)
        assert not error.any()
        return States(1e3 * np.ascontiguousarray(r.T), 1e3 * np.ascontiguousarray(v.T))


@pytest.fixture(scope="module")
def sky():
    """A week of skyfield: its time scale, its satellites, its start and end."""
    from skyfield.api import EarthSatellite, load

    scale = load.timescale(builtin=True)
    records = satellite_record(**LEO_ELEMENTS), satellite_record(**GEO_ELEMENTS)
    low, high = (EarthSatellite.from_satrec(record, scale) for record in records)
    start = scale.utc(2026, 3, 20, 12)
    return SimpleNamespace(
        scale=scale,
        low=low,
        high=high,
        orbits=(FromRecord("LEO", records[0]), FromRecord("GEO", records[1])),
        start=start,
        end=scale.tt_jd(start.tt + 7.0),
        seconds=lambda t: (t.tt - start.tt) * 86400.0,
    )


def edges_of_skyfield(sky, high):
    """Changes of visibility over the sphere by skyfield's positions, its test and its search, with what it is after."""
    from skyfield.almanac import find_discrete

    def visible(t):
        return ~(high - sky.low).at(t).is_behind_earth()

    visible.step_days = 200.0 / 86400.0
    times, values = find_discrete(sky.start, sky.end, visible)
    return sky.seconds(times), values


@pytest.mark.promise("day-41")
@pytest.mark.parametrize("kind", ["slot", pytest.param("elements", marks=pytest.mark.endurance)])
def test_a_week_of_contacts_is_that_of_skyfield_within_a_second(sky, kind):
    from skyfield.api import wgs84

    partner, high = {
        "slot": (SLOT, wgs84.latlon(0.0, 0.3 / deg, elevation_m=GEOSTATIONARY_RADIUS_M - EARTH_RADIUS_M)),
        "elements": (sky.orbits[1], sky.high),
    }[kind]
    low = sky.orbits[0]
    found = contacts(free(low), free(partner), ROUND, EPOCH, WEEK)
    assert found == contacts(free(partner), free(low), ROUND, EPOCH, WEEK)
    times, values = edges_of_skyfield(sky, high)
    starts = [c.start_s for c in found if c.begins == "Earth"]
    stops = [c.end_s for c in found if c.ends == "Earth"]
    assert len(starts) > 90
    np.testing.assert_allclose(starts, times[values == 1], rtol=0, atol=one_second)
    np.testing.assert_allclose(stops, times[values == 0], rtol=0, atol=one_second)


@pytest.mark.promise("day-41")
@pytest.mark.parametrize("place", [(78.2, 15.4, 450.0, 5.0), (-33.0, -70.7, 600.0, 10.0), (0.0, 0.0, 0.0, 60.0)])
def test_a_week_of_passes_is_that_of_skyfield_within_a_second(sky, place):
    from skyfield.api import wgs84

    latitude, longitude, height, mask = place
    station = Station("ground", latitude * deg, longitude * deg, height, mask * deg)
    found = passes(sky.orbits[0], station, EPOCH, WEEK)
    topos = wgs84.latlon(latitude, longitude, elevation_m=height)
    times, kinds = sky.low.find_events(topos, sky.start, sky.end, altitude_degrees=mask)
    rises, tops, sets = (sky.seconds(times[kinds == k]) for k in range(3))
    assert all((p.begins, p.ends) == ("elevation mask of ground",) * 2 for p in found) and found
    np.testing.assert_allclose([p.start_s for p in found], rises, rtol=0, atol=one_second)
    np.testing.assert_allclose([p.end_s for p in found], sets, rtol=0, atol=one_second)
    np.testing.assert_allclose([p.highest_s for p in found], tops, rtol=0, atol=one_second)
    highest = (sky.low - topos).at(times[kinds == 1]).altaz()[0].radians
    # skyfield's search stops at half a second; its elevation at our ends does not
    at_ends = sky.scale.tt_jd(sky.start.tt + np.sort(ends(found).ravel()) / 86400.0)
    np.testing.assert_allclose((sky.low - topos).at(at_ends).altaz()[0].radians, mask * deg, rtol=0, atol=2e-5)
    np.testing.assert_allclose([p.highest_rad for p in found], highest, rtol=0, atol=1e-4)


@settings(max_examples=10, deadline=None)
@given(any_angle, any_angle, st.floats(-1.5, 1.5), st.floats(0.0, 1.5))
def test_passes_agree_with_a_dense_grid(node, phase, latitude, mask):
    station, low = Station("ground", latitude, 0.4, 0.0, mask), leo(altitude_m=400e3, node_rad=node, phase_rad=phase)
    found = passes(low, station, EPOCH, DAY)
    dense = np.arange(0.0, 86400.0, 1.0)
    elevation = elevation_rad(station, EPOCH, dense, low.states(dense).position_m)
    sure = far_from_ends(ends(found), dense, one_millisecond)
    np.testing.assert_array_equal(inside(ends(found), dense)[sure], elevation[sure] > mask)
    for one in found:
        in_pass = (dense >= one.start_s) & (dense <= one.end_s)
        assert one.highest_rad >= elevation[in_pass].max(initial=0.0) - one_nanoradian
        assert one.start_s <= one.highest_s <= one.end_s
        at = elevation_rad(station, EPOCH, np.array([one.highest_s]), low.states(np.array([one.highest_s])).position_m)
        assert one.highest_rad == pytest.approx(float(at[0]), abs=1e-12)


def test_a_contact_ends_where_the_partner_is_too_far():
    both = leo(), SLOT
    own, other = (free(each) for each in both)
    far = 42_000e3
    (near,) = contacts_with_each(own, (other,), ROUND, EPOCH, DAY, (), far)
    (whole,) = contacts_with_each(own, (other,), ROUND, EPOCH, DAY)
    assert sum(c.duration_s for c in near) < sum(c.duration_s for c in whole)
    for c in near:
        ends = sight(*both, [c.start_s, c.end_s]).range_m
        for cause, range_m in zip((c.begins, c.ends), ends, strict=True):
            assert (cause == "range") == (abs(range_m - far) < 0.1), (cause, range_m)
        assert np.all(sight(*both, np.linspace(c.start_s, c.end_s, 500)).range_m <= far + 0.1)
    assert any("range" in (c.begins, c.ends) for c in near)


@pytest.mark.parametrize("year", [1975, 2000, 2048])
def test_the_suns_greatest_declination_is_the_obliquity_of_its_date(year):
    """23.43928 deg in 2000, and 0.01300 deg less each century (IAU 2006)."""
    sun = sun_direction(Epoch(f"{year}-06-18T00:00:00Z"), np.arange(0.0, 7 * 86400.0, 600.0))
    highest = math.degrees(math.asin(float(np.max(sun[2]))))
    assert highest == pytest.approx(23.43928 - 0.013004 * (year + 0.47 - 2000) / 100, abs=2e-3)


TILTED = KeplerOrbit("tilted", EPOCH, 8.3e6, 0.11, 1.13, 0.9, -0.7, 2.2, True)
HELD = Terminal(TILTED, Limits("nadir", (0.2, -0.1, 0.9), 1.1, 2.5e-3, 0.35, False), "held")
AIMED = Terminal(
    GeostationarySlot("slot", EPOCH, 0.8), Limits("sun", (0.3, 0.5, 2.0), 1.9, math.inf, 0.2, True), "aimed"
)
SITES = (Station("north", 1.09, 0.35, 420.0, 0.12), Station("south", -0.72, 2.9, 1310.0, 0.06))
WHILE = (1800.0, 30_000.0)


def told(found):
    return [x for each in found for x in (each.start_s, each.end_s)]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: told(contacts(HELD, AIMED, FLAT, EPOCH, WHILE)),
            [
                3595.30899,
                4007.70577,
                8613.9833,
                8787.16293,
                11349.8811,
                11668.4294,
                17429.2947,
                17881.8705,
                19122.8952,
                19313.4143,
            ],
        ),
        (
            lambda: told(contacts(AIMED, HELD, ROUND, EPOCH, WHILE)),
            [
                3569.11716,
                4007.70577,
                8613.9833,
                8818.38561,
                11315.3027,
                11668.4294,
                17429.2947,
                17998.22,
                19009.4484,
                19313.4143,
            ],
        ),
        (
            lambda: told(
                contacts_with_each(free(TILTED), (AIMED, free(SLOT)), FLAT, EPOCH, WHILE, furthest_m=4.1e7)[1]
            ),
            [4151.40672, 7014.26743, 11921.456, 14854.6368, 19838.5773, 22790.6229, 28462.2984, 30000.0],
        ),
        (
            lambda: told(
                contacts_with_each(
                    free(TILTED),
                    (AIMED, free(GroundSite(SITES[1], EPOCH)), free(SLOT)),
                    FLAT,
                    EPOCH,
                    WHILE,
                    furthest_m=5.5e6,
                )[1]
            ),
            [10043.5031, 10804.6173, 17293.8703, 18789.3837, 25089.4202, 26543.4897],
        ),
        (
            lambda: told(passes(TILTED, SITES[0], EPOCH, WHILE)),
            [6315.74338, 7397.08677, 13755.6482, 15259.806, 21432.6856, 23133.1397, 29222.225, 30000.0],
        ),
        (
            lambda: [
                x
                for each in passes(TILTED, SITES[1], EPOCH, WHILE)
                for x in (each.duration_s, each.highest_rad, each.highest_s)
            ],
            [
                819.092571,
                0.145687232,
                10423.7314,
                1581.97225,
                0.895847258,
                18139.1151,
                1484.07332,
                0.865338407,
                25937.4633,
            ],
        ),
        (
            lambda: [*station_range(TILTED, SITES[1], EPOCH)(np.array([0.0, 4321.0])), coarse_step_s(TILTED, 500.0)],
            [12256243.4, 8820711.16, 60.0],
        ),
        (
            lambda: [
                x
                for each in pass_spans(TILTED, StationRows.of(SITES, EPOCH), WHILE, 60.0, (5.1e6, 5.5e6))
                for x in each.ravel()
            ],
            [
                6315.74338,
                7313.30769,
                13755.6482,
                15134.5392,
                21432.6856,
                22964.6491,
                29222.225,
                30000.0,
                10043.5031,
                10804.6173,
                17293.8703,
                18789.3837,
                25089.4202,
                26543.4897,
            ],
        ),
        (
            lambda: [
                x for each in pass_spans(TILTED, StationRows.of(SITES[::-1], EPOCH), WHILE, 60.0) for x in each.ravel()
            ],
            [
                9985.52472,
                10804.6173,
                17207.4114,
                18789.3837,
                25059.4164,
                26543.4897,
                6315.74338,
                7397.08677,
                13755.6482,
                15259.806,
                21432.6856,
                23133.1397,
                29222.225,
                30000.0,
            ],
        ),
        (
            lambda: [
                x
                for each in StationRows.of(SITES, EPOCH).lines(
                    np.array([0.3, 1.9]), np.array([1, 0]), np.array([[7e6, -2e6], [3e6, 5e6], [-1e6, 4e6]])
                )
                for x in each
            ],
            [-11096097.5, -434965.172, 6074377.37, 3127017.92],
        ),
        (
            lambda: [
                *(s := sight(TILTED, SLOT, [100.0, 2500.0])).range_m,
                *s.range_rate_m_s,
                *s.rate_rad_s,
                *s.acceleration_rad_s2,
                *s.transverse_velocity_m_s,
                *s.point_ahead_rad,
                *s.direction.ravel(),
            ],
            [
                46308473.5,
                49620628.3,
                4528.82481,
                -2531.6889,
                0.000158930609,
                0.000148766765,
                8.10829846e-08,
                3.71848881e-08,
                7359.83388,
                7381.90037,
                4.90995266e-05,
                4.92467383e-05,
                0.960201918,
                0.857108172,
                0.219750545,
                0.513541046,
                -0.172400622,
                0.0405114283,
            ],
        ),
        (
            lambda: [
                *sight(TILTED, SLOT, 100.0).doppler_hz(1.55e-6),
                *coplanar_contact(8.3e6, 123e3),
                coplanar_contact(8.3e6, 123e3).visible_share,
            ],
            [-2921822460.0, 5477.29148, 8245.51932, 33864169.6, 46819924.8, 0.664274895],
        ),
        (
            lambda: [
                *(side := limits.Side(HELD, AIMED, FLAT, EPOCH)).field_of_regard(np.array([100.0, 2500.0])),
                *side.slew(np.array([100.0, 2500.0])),
                *side.off_sun(np.array([100.0, 2500.0])),
                *side.shadow(np.array([100.0, 2500.0])),
                *side.in_body(np.array([100.0, 2500.0])).ravel(),
            ],
            [
                -0.248347833,
                0.535684781,
                0.935170994,
                0.942796836,
                0.182999856,
                0.366163657,
                -0.338658578,
                -0.217376845,
                -0.90947229,
                0.194102552,
                -0.107358058,
                0.0366565641,
                0.401664538,
                0.980296127,
            ],
        ),
        (
            lambda: [
                *(side := limits.Side(AIMED, HELD, FLAT, EPOCH)).field_of_regard(np.array([100.0, 2500.0])),
                *side.off_sun(np.array([100.0, 2500.0])),
                *side.in_body(np.array([100.0, 2500.0])).ravel(),
            ],
            [
                0.861403056,
                1.01696971,
                1.73643943,
                1.55327563,
                -0.756372857,
                -0.573209056,
                0.177509122,
                -0.0396335217,
                0.629595595,
                0.818450098,
            ],
        ),
        (
            lambda: [
                x
                for _, spans in limits.conditions(limits.Side(HELD, AIMED, FLAT, EPOCH), np.arange(0.0, 18000.0, 60.0))
                for x in spans.ravel()
            ],
            [
                544.328147,
                4007.70577,
                8613.9833,
                11668.4294,
                17429.2947,
                17940.0,
                0.0,
                17940.0,
                0.0,
                17940.0,
                0.0,
                17940.0,
            ],
        ),
        (
            lambda: [
                *limits.body_rate_rad_s(
                    "nadir", TILTED.states(np.array([77.0])), sun_direction(EPOCH, np.array([77.0]))
                ).ravel(),
                *limits.body_rate_rad_s(
                    "sun", TILTED.states(np.array([77.0])), sun_direction(EPOCH, np.array([77.0]))
                ).ravel(),
            ],
            [0.000507015842, -0.000402331377, 0.000304797202, 0.000618027507, -1.0645023e-06, -4.61427274e-07],
        ),
        (
            lambda: [
                *events.complement(np.array([[-3.0, 2.5], [4.0, 6.25], [8.0, 99.0]]), (1.0, 9.0)).ravel(),
                *events.union(np.array([[1.0, 4.0], [9.0, 11.0]]), np.array([[3.5, 6.0]])).ravel(),
                *events.intersection(np.array([[1.0, 4.0], [9.0, 11.0]]), np.array([[3.5, 9.75]])).ravel(),
            ],
            [2.5, 4.0, 6.25, 8.0, 1.0, 6.0, 9.0, 11.0, 3.5, 4.0, 9.0, 9.75],
        ),
    ],
)
def test_contacts_passes_and_sights_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [(c.begins, c.ends) for c in contacts(HELD, AIMED, FLAT, EPOCH, WHILE)],
            [
                ("Earth", "field of regard of held"),
                ("field of regard of held", "Earth"),
                ("Earth", "field of regard of held"),
                ("field of regard of held", "Earth"),
                ("Earth", "field of regard of held"),
            ],
        ),
        (
            lambda: [(c.begins, c.ends) for c in contacts(AIMED, HELD, ROUND, EPOCH, (3700.0, 9000.0))],
            [("start of the span", "field of regard of held"), ("field of regard of held", "Earth")],
        ),
        (
            lambda: [
                (c.begins, c.ends)
                for c in contacts_with_each(
                    free(TILTED), (AIMED, free(GroundSite(SITES[1], EPOCH))), FLAT, EPOCH, WHILE, furthest_m=5.5e6
                )[1]
            ],
            [
                ("range", "elevation mask of south"),
                ("range", "elevation mask of south"),
                ("range", "elevation mask of south"),
            ],
        ),
        (
            lambda: [
                (c.begins, c.ends)
                for c in contacts_with_each(free(TILTED), (AIMED, free(SLOT)), FLAT, EPOCH, WHILE, furthest_m=4.1e7)[1]
            ],
            [("range", "range"), ("range", "range"), ("range", "range"), ("range", "end of the span")],
        ),
        (
            lambda: [(c.begins, c.ends) for c in passes(TILTED, SITES[0], EPOCH, (7000.0, 30_000.0))],
            [
                ("start of the span", "elevation mask of north"),
                ("elevation mask of north", "elevation mask of north"),
                ("elevation mask of north", "elevation mask of north"),
                ("elevation mask of north", "end of the span"),
            ],
        ),
        (
            lambda: [
                cause
                for each in (HELD, AIMED)
                for cause, _ in limits.conditions(
                    limits.Side(each, free(SLOT), FLAT, EPOCH), np.arange(0.0, 9000.0, 60.0)
                )
            ],
            [
                "field of regard of held",
                "slew limit of held",
                "Sun near the line of sight of held",
                "eclipse of held",
                "field of regard of aimed",
                "Sun near the line of sight of aimed",
            ],
        ),
        (
            lambda: [
                visible.hidden_by(free(TILTED), free(GroundSite(SITES[0], EPOCH))),
                visible.hidden_by(HELD, AIMED),
            ],
            ["elevation mask of north", "Earth"],
        ),
    ],
)
def test_each_end_of_a_contact_names_the_limit_of_its_own_terminal(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: coarse_times((12.5, -3.25), 60.0),
            OrbitError,
            "the span from 12.5 s to -3.25 s holds no time; give a start and a later end",
        ),
        (
            lambda: coarse_times((0.0, 8.64e7), 7.5),
            OrbitError,
            (
                "the span from 0 s to 8.64e+07 s would be searched in steps of 7.5 s, more than 5e+06 of "
                "them; give a shorter span, or check the velocities of the orbits"
            ),
        ),
        (
            lambda: coarse_step_s(
                SimpleNamespace(
                    name="X",
                    states=lambda time_s: States(np.array([[7e6], [0.0], [0.0]]), np.array([[3.0], [0.0], [0.0]])),
                ),
                12.5,
            ),
            OrbitError,
            (
                "X: the state at 12.5 s moves straight to or from the Earth's centre, or is no number; "
                "check its velocity"
            ),
        ),
        (
            lambda: events.positive(np.sin, np.array([3.0, 2.0, 5.0])),
            OrbitError,
            "the times of the samples do not rise; sort them, each once",
        ),
        (
            lambda: events.positive_rows(
                lambda t, row: t, np.array([1.0, 2.5, 4.0]), np.array([[1.0, 2.0, 3.0], [1.0, math.inf, 3.0]])
            ),
            OrbitError,
            "a function whose sign is asked for is not finite at 2.5 s; check the orbits there",
        ),
        (
            lambda: events.positive_rows(lambda t, row: t, np.array([1.0, 2.5]), np.ones((3, 2))),
            OrbitError,
            "(3, 2) values at 2 times; give as many values as times, at least 3",
        ),
        (
            lambda: contacts_with_each(HELD, (AIMED, Terminal(SLOT, UNLIMITED, "held")), FLAT, EPOCH, WHILE),
            OrbitError,
            'two terminals are called "held"; give each a name of its own',
        ),
        (
            lambda: contacts_with_each(
                HELD,
                (AIMED, Terminal(circular("low", EPOCH, 130e3, 0.3, 0.1, 0.2, False), UNLIMITED, "low one")),
                Earth("sphere", 150.5e3),
                EPOCH,
                WHILE,
            ),
            OrbitError,
            (
                "low one is 130.000 km over the Earth at 11640 s, not above the 150.5 km that lines of "
                "sight must clear; lower orbit.grazing_height, or raise the orbit"
            ),
        ),
        (
            lambda: coplanar_contact(6.4e6, 123e3),
            OrbitError,
            (
                "an orbit of radius 6400 km is not between the surface to clear, 6501 km, and the "
                "geostationary 42160 km; give a radius between"
            ),
        ),
        (
            lambda: sight(TILTED, SLOT, 0.0).doppler_hz(-1.55e-6),
            OrbitError,
            "a wavelength of -1.55 µm is none; give one above 0 m",
        ),
        (
            lambda: Limits("inertial", (0.0, 0.0, 1.0), 1.0, 1.0, 0.1, True),
            OrbitError,
            "the attitude 'inertial' is not known; write nadir, sun or free",
        ),
        (
            lambda: Limits("nadir", (0.0, 0.0, 0.0), 1.0, 1.0, 0.1, True),
            OrbitError,
            "the boresight (0.0, 0.0, 0.0) has no direction; give three numbers, such as (0, 0, 1)",
        ),
        (
            lambda: Limits("nadir", (0.0, 1.0), 1.0, 1.0, 0.1, True),
            OrbitError,
            "the boresight (0.0, 1.0) has no direction; give three numbers, such as (0, 0, 1)",
        ),
        (
            lambda: Limits("nadir", (0.0, 0.0, 1.0), 3.5, 1.0, 0.1, True),
            OrbitError,
            (
                "Limits.field_of_regard_rad is 200.5 deg: it must be finite, above 0 deg, at most 180 deg; "
                "it is a half angle"
            ),
        ),
        (
            lambda: Limits("sun", (0.0, 0.0, 1.0), 1.0, -0.0125, 0.1, True),
            OrbitError,
            "a slew limit of -12.5 mrad/s is not above 0",
        ),
        (
            lambda: Limits("free", (0.0, 0.0, 1.0), 1.0, 1.0, 0.1, True),
            OrbitError,
            (
                'a field of regard means nothing with the attitude "free": the body turns its boresight '
                'onto the partner; leave it out, or hold the body "nadir" or "sun"'
            ),
        ),
    ],
)
def test_a_refusal_of_a_search_says_its_names_times_and_remedy(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_gap_between_two_samples_is_found_on_either_side_whichever_side_the_span_begins_on(sign):
    def visible(time_s):
        return sign * (time_s - 10.0) * (90.0 - time_s) * ((time_s - 50.45) ** 2 - 0.04)

    edges = np.array([0.0, 10.0, 50.25, 50.65, 90.0, 100.0])
    expected = edges[1:-1].reshape(-1, 2) if sign > 0.0 else edges.reshape(-1, 2)
    np.testing.assert_allclose(events.positive(visible, np.arange(0.0, 101.0)), expected, atol=1e-3)


@pytest.mark.parametrize("wavelength_m", [0.0, -1.55e-6, math.nan])
def test_no_wavelength_but_one_above_nothing_has_a_doppler_shift(wavelength_m):
    with pytest.raises(OrbitError, match=r"is none; give one above 0 m"):
        sight(leo(), SLOT, 0.0).doppler_hz(wavelength_m)
    assert np.isfinite(sight(leo(), SLOT, 0.0).doppler_hz(1.55e-6)).all()


@pytest.mark.parametrize(
    "span_s",
    [(math.nan, 5.0), (0.0, math.nan), (math.inf, math.inf), (-5.0, -math.inf), (7.0, 5.0), (-5.0, -5.0)],
)
def test_a_span_whose_ends_are_no_numbers_or_turned_holds_no_time(span_s):
    with pytest.raises(OrbitError, match=f"^the span from {span_s[0]:g} s to {span_s[1]:g} s holds no time; give a"):
        coarse_times(span_s, 60.0)


def states_along(name, position_m):
    """An orbit without a sum behind it: its places by a function of time, its velocities by differences."""

    def states(time_s):
        after, before = position_m(time_s + 0.5), position_m(time_s - 0.5)
        return States(position_m(time_s), after - before)

    return SimpleNamespace(name=name, states=states)


@pytest.mark.parametrize("turned", [False, True])
def test_two_terminals_that_meet_later_on_are_told_with_the_time_and_in_the_order_of_the_alphabet(turned):
    """They are in one place at 300 s; at the first of the samples they are far from one another."""
    one = states_along("zulu", lambda t: np.stack((7e6 + 0.0 * t, 7e3 * (t - 300.0), 0.0 * t)))
    two = states_along("alfa", lambda t: np.stack((7e6 + 0.0 * t, 0.0 * t, 5e3 * (t - 300.0))))
    own, other = (Terminal(each, UNLIMITED, each.name) for each in ((two, one) if turned else (one, two)))
    side = limits.Side(own, other, ROUND, EPOCH)
    time_s = np.array([0.0, 150.0, 300.0, 450.0])
    with pytest.raises(OrbitError) as refused:
        side.look(time_s)
    assert str(refused.value) == "alfa and zulu are at the same place at 300 s; give two different orbits"
    look = side.look(time_s[[0, 1, 3]])
    apart = -1.0 if turned else 1.0
    line = np.array([0.0, 7.0, -5.0]) / math.sqrt(74.0)
    np.testing.assert_allclose(look.direction.T, apart * np.outer([1.0, 1.0, -1.0], line), atol=1e-12)


@pytest.mark.parametrize("boresight", [
    (math.inf, 0.0, 0.0), (0.0, -math.inf, 1.0), (0.0, 0.0, math.nan), (0.0, 0.0, 0.0), (1.0, 2.0),
    (1.0, 0.0, 0.0, 0.0),
])  # fmt: skip
def test_a_boresight_needs_three_finite_numbers_that_are_not_all_nothing(boresight):
    with pytest.raises(OrbitError) as refused:
        Limits("nadir", boresight, 1.0, math.inf, 0.0, True)
    assert str(refused.value) == f"the boresight {boresight} has no direction; give three numbers, such as (0, 0, 1)"
    assert Limits("nadir", (-1e-9, 0.0, 1e12), 1.0, math.inf, 0.0, True).boresight == (-1e-9, 0.0, 1e12)


def test_samples_are_put_between_where_a_direction_turns_fast_and_only_there():
    """The first direction turns by 0.1 rad/s up to 10 s; the second by 0.5 rad/s between 20 s and 21 s alone."""

    def directions(time_s):
        angles = np.stack((0.1 * np.minimum(time_s, 10.0), 0.5 * np.clip(time_s - 20.0, 0.0, 1.0)))
        return np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=1)

    coarse = np.array([0.0, 4.0, 10.0, 12.0, 20.0, 21.0, 30.0])
    found = events.refined(directions, coarse, 0.29)
    expected = [0.0, 2.0, 4.0, 5.5, 7.0, 8.5, 10.0, 12.0, 20.0, 20.5, 21.0, 30.0]
    assert found.tolist() == expected  # 0.2 and 0.15 rad a step, then 0.25 rad
    assert events.refined(directions, coarse, 0.61).tolist() == coarse.tolist()
    assert events.refined(directions, found, 0.29).tolist() == expected
    at_once = np.array([0.0, 1e-3, 3e-3])

    def jumps(time_s):
        turned = np.where(time_s > 0.0, 1.0, 0.0)
        return np.stack((np.cos(turned), np.sin(turned), 0.0 * turned))[None]

    assert events.refined(jumps, at_once, 0.1).tolist() == [0.0, 1e-3, 3e-3]  # no step below a millisecond
    assert events.refined(jumps, np.array([0.0, 0.004]), 0.1).tolist() == [0.0, 0.001, 0.002, 0.004]


def test_the_largest_values_of_windows_of_unlike_lengths_are_found_in_each():
    """Peaks at 3, 50 and 120 s of heights 1, 4 and 2; the last window has its largest value at its end."""
    peaks, heights = np.array([3.0, 50.0, 120.0]), np.array([1.0, 4.0, 2.0])

    def bumps(time_s):
        return np.max(heights[:, None] - 0.01 * (time_s - peaks[:, None]) ** 2, axis=0)

    windows = np.array([[0.0, 10.0], [20.0, 80.0], [110.0, 119.0]])
    when, value = events.largest(bumps, windows, 2.0)
    assert when.tolist() == pytest.approx([3.0, 50.0, 119.0], abs=1e-3)
    assert value.tolist() == pytest.approx([1.0, 4.0, 1.99], abs=1e-7)
    when, value = events.largest(bumps, windows[[2, 0]], 0.25)
    assert (when.tolist(), value.tolist()) == (pytest.approx([119.0, 3.0], abs=1e-3), pytest.approx([1.99, 1.0]))


def test_a_peak_that_is_narrow_in_a_long_window_is_found_in_steps_below_a_second():
    def peaks(time_s):
        return np.maximum(5.0 - 25.0 * (time_s - 77.0) ** 2, 4.0 - 0.01 * (time_s - 300.0) ** 2)

    when, value = events.largest(peaks, np.array([[0.0, 400.0], [200.0, 203.0]]), 0.5)
    assert when.tolist() == pytest.approx([77.0, 203.0], abs=1e-3)
    assert value.tolist() == pytest.approx([5.0, 4.0 - 94.09], abs=1e-4)


def test_the_places_of_stations_far_above_the_sea_stand_each_in_their_own_row():
    """Of three unlike stations, with heights that show: the first on the equator, the second at the pole."""
    given = [
        Station("a", 0.0, 0.4, 3000.0, 0.1),
        Station("b", math.pi / 2.0, -1.0, 2000.0, 0.2),
        Station("c", -0.6, 2.5, -400.0, 0.3),
    ]
    rows = StationRows.of(given, EPOCH)
    polar = EARTH_RADIUS_M * (1.0 - FLATTENING)
    assert rows.across_m[:2].tolist() == pytest.approx([EARTH_RADIUS_M + 3000.0, 0.0], abs=1e-6)
    assert rows.along_axis_m[:2].tolist() == pytest.approx([0.0, polar + 2000.0], abs=1e-6)
    square = FLATTENING * (2.0 - FLATTENING)
    normal = EARTH_RADIUS_M / math.sqrt(1.0 - square * math.sin(0.6) ** 2)
    assert rows.across_m[2] == pytest.approx((normal - 400.0) * math.cos(0.6), abs=1e-6)
    assert rows.along_axis_m[2] == pytest.approx(-(normal * (1.0 - square) - 400.0) * math.sin(0.6), abs=1e-6)
    assert (rows.longitude_rad.tolist(), rows.mask_rad.tolist()) == ([0.4, -1.0, 2.5], [0.1, 0.2, 0.3])
    assert rows.level.tolist() == pytest.approx([1.0, 0.0, math.cos(0.6)], abs=1e-12)
    assert rows.rise.tolist() == pytest.approx([0.0, 1.0, -math.sin(0.6)], abs=1e-12)
    none = StationRows.of([], EPOCH)
    assert [part.shape for part in (none.longitude_rad, none.across_m, none.along_axis_m, none.mask_rad)] == [(0,)] * 4


def test_two_satellites_half_a_metre_apart_are_at_two_places_and_where_they_are_at_one_says_the_time():
    """The one stands still; the other passes it at 20 s, and otherwise stays ahead of it."""
    still = states_along("still", lambda t: np.stack((7e6 + 0.0 * t, 0.0 * t, 0.0 * t)))
    passing = states_along("passing", lambda t: np.stack((7e6 + 0.0 * t, 0.025 * (t - 20.0), 0.0 * t)))
    found = sight(still, passing, [0.0, 10.0, 40.0, 60.0])
    assert found.range_m.tolist() == pytest.approx([0.5, 0.25, 0.5, 1.0], rel=1e-9)
    assert found.range_rate_m_s.tolist() == pytest.approx([-0.025, -0.025, 0.025, 0.025], rel=1e-9)
    assert found.direction[1].tolist() == pytest.approx([-1.0, -1.0, 1.0, 1.0])
    for pair, names in (((still, passing), "still and passing"), ((passing, still), "passing and still")):
        with pytest.raises(OrbitError) as refused:
            sight(*pair, [0.0, 40.0, 20.0, 60.0])
        assert str(refused.value) == f"{names} are at the same place at 20 s; give two different orbits"


def test_a_span_is_as_long_as_its_end_is_from_its_start_however_late_it_begins():
    assert coarse_times((5e8, 5e8 + 480.0), 60.0).tolist() == [5e8 + 60.0 * k for k in range(9)]
    assert coarse_times((-5e8, -5e8 + 30.0), 60.0).tolist() == [-5e8 + 7.5 * k for k in range(5)]
    with pytest.raises(OrbitError, match=r"more than 5e[+]06 of them"):
        coarse_times((-2e8, 2e8), 60.0)
