"""A day of the link against what one sees second by second: contacts, volumes, latencies, and what moves them."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from day_files import ALONE, EPOCH, HELD, KEPLERIAN, LIMITS, day_file, element_set, ephemeris
from link_files import received_with
from microrad import link, orbit
from microrad.link import study as link_study
from microrad.orbit import EARTH_RADIUS_M, operations
from microrad.orbit import day as day_study
from microrad.orbit.day import NOTHING, Numbers, PointingLoss, Swing, assumptions, flow, geometry, given_loss
from microrad.orbit.earth import figure
from microrad.orbit.from_mission import TAIL_S
from microrad.orbit.propagation.analytic import node_of_local_time
from microrad.orbit.propagation.ephemeris import EphemerisOrbit
from microrad.orbit.visibility.limits import UNLIMITED
from optical_files import optical

C_M_S = 299_792_458.0
EARTH_POLAR_M = EARTH_RADIUS_M * (1.0 - 1.0 / 298.257223563)
SIX_HOURS = {"orbit.duration": "6 h", **ALONE}
NO_SEARCH = {"acquisition": None}
BLIND = {LIMITS: {**HELD, "boresight": [0.0, 0.0, 1.0], "field_of_regard": "5 deg"}}  # at the Earth
DEAF = {"operations.downlink.stations.kiruna.mask": "88 deg"}
TROMSO = {"latitude": "69.66 deg", "longitude": "18.94 deg", "height": "100 m", "mask": "5 deg"}
RATES = {"operations.rates": ["50 Mbit/s", "280 Mbit/s", "320 Mbit/s", "400 Mbit/s"], "operations.margin": "3 dB"}


@pytest.fixture(scope="module", autouse=True)
def _without_tornados():
    """Nothing here looks at those of the links."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(link_study, "tornados", lambda *args: ())
        yield


@pytest.fixture(scope="module")
def links(tmp_path_factory):
    """The links of the shipped mission, its acquisition simulated a hundred times."""
    return link_study.run_link_study(day_file(tmp_path_factory.mktemp("shipped"), ALONE))


@pytest.fixture(scope="module")
def day(links):
    """The day of the shipped mission, without its assumptions changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(day_study, "swings", lambda *given: ())
        return day_study.run_day_study(links)


@pytest.fixture
def quick(tmp_path, monkeypatch):
    """A day without its assumptions changed, by changes of the mission."""
    monkeypatch.setattr(day_study, "swings", lambda *given: ())

    def run(*changes, loss=None):
        return day_study.run_day_study(link_study.run_link_study(day_file(tmp_path, ALONE, *changes)), loss)

    return run


# ------------------------------------------------------------------------------------------- second by second, by hand
class Seconds:
    """Each second of a day and its tail, looked at in its middle; nothing here knows of contacts."""

    def __init__(self, day):
        pair = day.view.pair
        self.span_s = pair.span_s[1]
        self.time_s = np.arange(0.0, pair.whole_s[1]) + 0.5
        self.own, self.far = (t.orbit.states(self.time_s).position_m for t in (pair.leo, pair.geo))
        self.range_m = np.sqrt(np.sum((self.far - self.own) ** 2, axis=0))
        self.epoch, self.operations, self.day = pair.epoch, day.operations, day
        self.inside = self.time_s < self.span_s
        grazing = pair.earth.grazing_height_m
        self.seen = self.clear(grazing) & self.off_sun(5.0) & self.below_geo(10.5)

    def clear(self, height_m):
        """Whether the line passes the ellipsoid: the nearest point of the line in coordinates that make it round."""
        scale = np.array([[1.0], [1.0], [(EARTH_RADIUS_M + height_m) / (EARTH_POLAR_M + height_m)]])
        first, second = self.own * scale, self.far * scale
        along = second - first
        nearest = np.clip(-np.sum(first * along, axis=0) / np.sum(along**2, axis=0), 0.0, 1.0)
        return np.linalg.norm(first + nearest * along, axis=0) > EARTH_RADIUS_M + height_m

    def off_sun(self, least_deg):
        """Whether either end sees the Sun further away than that, or not at all: behind a round Earth."""
        sun = orbit.sun_direction(self.epoch, self.time_s)
        look = (self.far - self.own) / self.range_m
        fine = np.ones(self.time_s.size, dtype=bool)
        for place, direction in ((self.own, look), (self.far, -look)):
            angle = np.degrees(np.arccos(np.clip(np.sum(direction * sun, axis=0), -1.0, 1.0)))
            towards = np.sum(place * sun, axis=0)
            dark = (towards < 0.0) & (np.linalg.norm(place - towards * sun, axis=0) < EARTH_RADIUS_M)
            fine &= (angle >= least_deg) | dark
        return fine

    def below_geo(self, most_deg):
        down = -self.far / np.linalg.norm(self.far, axis=0)
        look = (self.own - self.far) / self.range_m
        return np.degrees(np.arccos(np.sum(down * look, axis=0))) <= most_deg

    def contacts(self):
        """First and last second of each contact."""
        edge = np.diff(np.concatenate(([0], self.seen.astype(int), [0])))
        return np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)

    def rate_bit_s(self, links, rates_bit_s, margin_db):
        """The highest rate whose margin at the range of the second is enough, by the budget at its own distance."""
        c = links.file.mission.communication
        best = np.zeros(self.time_s.size)
        for rate in sorted(rates_bit_s):
            margin = links.communication.margin_db + 10.0 * np.log10(c.data_rate_bit_s / rate)
            margin = margin - 20.0 * np.log10(self.range_m / c.distance_m)
            best[margin >= margin_db] = rate
        return np.where(self.seen, best, 0.0)


def packets(sent_bit, made_bit, room_bit, delay_s):
    """Latency and size of what each second made and sent, first in, first out; what found no room; what is left."""
    queue, held, lost, found = [], 0.0, 0.0, []
    for second, (sent, new) in enumerate(zip(sent_bit, made_bit, strict=True)):
        room, kept = sent, min(new, room_bit - held + sent)
        lost += new - kept
        if kept > 0.0:
            queue.append([second + 0.5, kept])
            held += kept
        while room > 0.0 and queue:
            made_s, size = queue[0]
            part = min(size, room)
            found.append((max(second + 0.5 - made_s, 0.0) + delay_s, part))
            room, held, queue[0][1] = room - part, held - part, size - part
            if queue[0][1] <= 0.0:
                queue.pop(0)
    return np.array(found).reshape(-1, 2), lost, held


def share_within(found, left, latency_s):
    return float(np.sum(found[found[:, 0] <= latency_s, 1])) / (float(np.sum(found[:, 1])) + left)


def same_latencies(way, found, left, tolerance_s):
    """Both distributions, one inside the other moved by a tolerance to either side."""
    for latency_s in np.concatenate((np.linspace(0.0, 3.0, 7), np.geomspace(5.0, 5e4, 60))):
        low, high = (share_within(found, left, latency_s + off) for off in (-tolerance_s, tolerance_s))
        assert low - 1e-3 <= float(way.latency.cdf(latency_s)) <= high + 1e-3, latency_s


# ------------------------------------------------------------------------------------------------- the shipped mission
def test_the_shipped_day_has_the_contacts_of_its_facts(day):
    v = day.view
    assert len(v.encounters) == 15
    assert v.visible_share == pytest.approx(0.634, abs=0.001)
    assert 50.0 < v.median_s / 60.0 < 60.0
    assert v.closed_form.duration_s / 60.0 == pytest.approx(56.72, abs=0.005)
    assert min(e.range_least_m for e in v.encounters) == pytest.approx(35_290e3, abs=20e3)
    assert v.largest("range_most_m") == pytest.approx(44_036e3, abs=5e3)
    assert v.largest("point_ahead_most_rad") == pytest.approx(71e-6, abs=0.5e-6)
    assert v.largest("rate_most_rad_s") == pytest.approx(255e-6, abs=1e-6)
    assert v.largest("doppler_most_hz") == pytest.approx(4.95e9, abs=0.02e9)
    assert day.relay.gap_s == v.gap_s


@pytest.fixture(scope="module")
def seconds(day):
    return Seconds(day)


def test_the_contacts_are_those_of_every_second(day, seconds):
    first, last = seconds.contacts()
    found = day.view.contacts
    assert len(found) == first.size
    np.testing.assert_allclose([c.start_s for c in found], first, atol=1.001)
    np.testing.assert_allclose([c.end_s for c in found], last, atol=1.001)
    assert day.view.visible_share == pytest.approx(float(np.mean(seconds.seen[seconds.inside])), abs=3e-4)
    edges = np.concatenate(([0.0], *zip(first, last, strict=True)))
    gaps = [b - a for a, b in zip(edges[::2], edges[1::2], strict=False) if a < 86400.0]
    assert day.view.gap_s == pytest.approx(max(gaps), abs=2.0)


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-5")
def test_what_a_contact_reaches_is_what_its_seconds_reach(day, seconds):
    speed = np.diff(seconds.far - seconds.own, axis=1)
    middle = ((seconds.far - seconds.own)[:, 1:] + (seconds.far - seconds.own)[:, :-1]) / 2.0
    reach = np.linalg.norm(middle, axis=0)
    radial = np.sum(speed * middle, axis=0) / reach
    across = np.sqrt(np.sum(speed**2, axis=0) - radial**2)
    for e in day.view.encounters:
        at = slice(math.ceil(e.contact.start_s), math.floor(e.contact.end_s) - 1)
        assert e.range_least_m == pytest.approx(np.min(reach[at]), abs=16e3)
        assert e.range_most_m == pytest.approx(np.max(reach[at]), abs=16e3)
        assert e.point_ahead_most_rad == pytest.approx(2.0 * np.max(across[at]) / C_M_S, rel=3e-3)
        assert e.rate_most_rad_s == pytest.approx(np.max(across[at] / reach[at]), rel=3e-3)
        assert e.doppler_most_hz == pytest.approx(np.max(np.abs(radial[at])) / 1.55e-6, rel=3e-3)
        turn = np.cross(middle[:, at], speed[:, at], axis=0) / reach[at] ** 2
        change = np.linalg.norm(np.diff(turn, axis=1), axis=0)
        assert e.acceleration_most_rad_s2 == pytest.approx(np.max(change), rel=0.02)


def test_the_range_between_samples_is_the_orbits(day, seconds):
    for contact, range_m in zip(day.view.contacts, day.view.range_m, strict=True):
        chosen = (contact.start_s < seconds.time_s) & (seconds.time_s < contact.end_s)
        assert np.max(np.abs(range_m(seconds.time_s[chosen]) - seconds.range_m[chosen])) < 1.0


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-5", "day-19", "day-22", "day-23")
def test_without_acquisition_volume_and_latency_are_those_of_packets(quick, seconds, links):
    found = quick(NO_SEARCH)
    o, way = found.operations, found.relay
    rate = seconds.rate_bit_s(links, [300e6], 3.0)
    inside = rate[seconds.inside]
    assert way.capacity_bit == pytest.approx(np.sum(inside), rel=1e-3)
    assert way.capacity_spread_bit == pytest.approx((way.capacity_bit, way.capacity_bit), rel=1e-12)
    for c, bit in zip(way.contacts, way.carried_bit, strict=True):
        part = rate[int(c.start_s) : min(math.ceil(c.end_s), 86400)]
        assert bit == pytest.approx(np.sum(part), abs=4 * 300e6)
    made = np.where(seconds.inside, o.instrument_rate_bit_s, 0.0)
    sent, lost, left = packets(rate, made, o.store_bit, o.relay_delay_s)
    assert (lost, left, way.lost_bit) == (0.0, 0.0, 0.0)
    assert way.generated_bit == pytest.approx(3e6 * 86400)
    assert way.on_board_bit == pytest.approx(0.0, abs=1.0)
    same_latencies(way, sent, left, 2.0)
    order = np.argsort(sent[:, 0])
    shares = np.cumsum(sent[order, 1]) / np.sum(sent[:, 1])
    for wanted, got in ((0.5, way.median_s), (0.99, way.slow_s)):
        assert got == pytest.approx(sent[order, 0][np.searchsorted(shares, wanted)], abs=3.0)


@pytest.mark.promise("day-5")
def test_a_contact_at_the_end_of_the_span_counts_up_to_it(quick, seconds, links):
    found = quick(NO_SEARCH, {"orbit.duration": "6.8 h"})  # in the long contact about half past seven
    cut, last = found.view.encounters[-1].contact, found.view.contacts[len(found.view.encounters) - 1]
    assert last.start_s < 6.8 * 3600.0 < last.end_s
    assert (cut.start_s, cut.end_s, cut.ends) == (last.start_s, 6.8 * 3600.0, "end of the span")
    assert found.relay.contacts[-1] == cut
    until = seconds.time_s < 6.8 * 3600.0
    rate = seconds.rate_bit_s(links, [300e6], 3.0)
    assert found.relay.capacity_bit == pytest.approx(np.sum(rate[until]), rel=2e-3)
    assert np.sum(rate[seconds.time_s < last.end_s]) > 1.05 * found.relay.capacity_bit
    assert found.view.contact_s == found.relay.contact_s == pytest.approx(np.sum(seconds.seen[until]), abs=10.0)


@pytest.mark.promise("day-19", "day-23")
def test_delays_add_to_every_latency(quick):
    delayed = {"operations.relay_delay": "101 s", "operations.downlink.delay": "51 s"}
    short, long = quick(SIX_HOURS, NO_SEARCH), quick(SIX_HOURS, NO_SEARCH, delayed)
    assert long.relay.median_s - short.relay.median_s == pytest.approx(100.0)
    assert long.relay.slow_s - short.relay.slow_s == pytest.approx(100.0)
    assert long.direct.slow_s - short.direct.slow_s == pytest.approx(50.0)


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-5", "day-19", "day-20")
def test_the_time_to_lock_is_drawn_from_the_acquisitions(day, links, seconds):
    rate = seconds.rate_bit_s(links, [300e6], 3.0)
    o, simulated = day.operations, links.finding.wide.simulated
    volumes = []
    for run in range(o.runs):
        draw = np.random.Generator(np.random.Philox(key=[o.seed, run]))
        chosen = draw.integers(0, simulated.time_s.size, len(day.view.contacts))
        total = 0.0
        for c, k in zip(day.view.encounters, chosen, strict=False):
            lock = c.contact.start_s + (simulated.time_s[k] if simulated.locked[k] else math.inf)
            on = (seconds.time_s > max(lock, c.contact.start_s)) & (seconds.time_s < min(c.contact.end_s, 86400.0))
            total += float(np.sum(rate[on]))
        volumes.append(total)
    assert day.relay.capacity_bit == pytest.approx(np.mean(volumes), rel=1e-3)
    assert day.relay.capacity_spread_bit == pytest.approx((min(volumes), max(volumes)), rel=1e-3)
    assert day.relay.capacity_spread_bit[0] <= day.relay.capacity_bit <= day.relay.capacity_spread_bit[1]


@pytest.mark.promise("day-20")
def test_acquisitions_that_fail_are_counted_and_carry_nothing(quick, tmp_path):
    hard = {"acquisition.lock_probability": 0.5, "acquisition.attempts": 1, "operations.runs": 200}
    found, easy = quick(SIX_HOURS, hard), quick(SIX_HOURS, NO_SEARCH)
    found_share = link_study.run_link_study(day_file(tmp_path, SIX_HOURS, hard)).finding.wide.simulated_probability
    share = found.relay.failed_contacts / len(found.relay.contacts)
    assert 0.3 < share < 0.9
    assert share == pytest.approx(1.0 - found_share, abs=0.06)
    assert found.relay.capacity_bit / easy.relay.capacity_bit == pytest.approx(1.0 - share, abs=0.06)
    assert found.relay.capacity_spread_bit[0] < 0.6 * found.relay.capacity_spread_bit[1]


@pytest.mark.promise("day-19", "day-21")
def test_rates_stepped_with_range(quick, seconds, links):
    found = quick(NO_SEARCH, RATES)
    rates = found.operations.rates_bit_s
    rate = seconds.rate_bit_s(links, rates, 3.0)
    assert set(np.unique(rate)) == {0.0, 50e6, 280e6, 320e6, 400e6}
    assert found.relay.capacity_bit == pytest.approx(np.sum(rate[seconds.inside]), rel=1e-3)
    assert [c.rate_bit_s for c in found.closings] == [400e6, 320e6, 280e6, 50e6]
    for c in found.closings:
        margin = links.communication.margin_db + 10.0 * math.log10(300e6 / c.rate_bit_s)
        assert c.margin_db == pytest.approx(margin, abs=1e-9)
        assert c.largest_range_m == pytest.approx(42_000e3 * 10.0 ** ((margin - 3.0) / 20.0), rel=1e-9)


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-21")
def test_a_loss_and_an_outage_of_the_simulated_loop_take_their_share(quick, links):
    plain = quick(SIX_HOURS, NO_SEARCH)
    stated = given_loss(links)
    assert plain.loss == stated
    worse = quick(SIX_HOURS, NO_SEARCH, loss=PointingLoss(stated.loss_db, 0.25, "test"))
    assert worse.relay.capacity_bit == pytest.approx(0.75 * plain.relay.capacity_bit)
    assert worse.direct.capacity_bit == plain.direct.capacity_bit
    deaf = quick(SIX_HOURS, NO_SEARCH, loss=PointingLoss(stated.loss_db + 3.0, 0.0, "test"))
    assert deaf.relay.capacity_bit == 0.0
    assert deaf.closings[0].largest_range_m == pytest.approx(plain.closings[0].largest_range_m * 10.0**-0.15)


@pytest.mark.promise("day-19")
def test_the_relays_share_is_granted_from_the_beginning(quick, seconds, links):
    found = quick(NO_SEARCH, {"operations.relay_share": 0.4})
    rate = seconds.rate_bit_s(links, [300e6], 3.0)
    total = 0.0
    for granted, c in zip(found.relay.contacts, found.view.encounters, strict=True):
        whole = c.contact
        assert (granted.start_s, granted.begins) == (whole.start_s, whole.begins)
        assert granted.end_s == pytest.approx(whole.start_s + 0.4 * whole.duration_s)
        assert granted.ends == "end of the relay's share"
        on = (seconds.time_s > granted.start_s) & (seconds.time_s < min(granted.end_s, 86400.0))
        total += float(np.sum(rate[on]))
    assert found.relay.capacity_bit == pytest.approx(total, rel=1e-3)
    assert found.relay.gap_s > found.view.gap_s
    assert found.relay.contact_s == pytest.approx(0.4 * sum(c.contact.duration_s for c in found.view.encounters))


def test_a_contact_that_goes_on_behind_the_span_is_granted_a_share_of_what_it_has_in_the_span(quick):
    second = quick(NO_SEARCH).view.encounters[1].contact
    end_s = round(second.start_s + 0.6 * second.duration_s)
    cut = quick(NO_SEARCH, {"orbit.duration": f"{end_s} s", "operations.relay_share": 0.5}).relay.contacts[1]
    assert cut.start_s == pytest.approx(second.start_s)
    assert cut.duration_s == pytest.approx(0.5 * (end_s - second.start_s))


@pytest.mark.promise("day-19", "day-23")
def test_a_full_store_loses_the_newest(quick, seconds, links):
    found = quick(NO_SEARCH, {"operations.store": "0.6 GB"})
    o, rate = found.operations, seconds.rate_bit_s(links, [300e6], 3.0)
    made = np.where(seconds.inside, o.instrument_rate_bit_s, 0.0)
    sent, lost, left = packets(rate, made, o.store_bit, o.relay_delay_s)
    assert lost > 1e9
    assert found.relay.lost_bit == pytest.approx(lost, rel=2e-3)
    assert found.relay.on_board_bit == pytest.approx(left, abs=1.0)
    same_latencies(found.relay, sent, left, 3.0)
    assert found.relay.history.largest_stored_bit == pytest.approx(0.6 * 8e9)


# ------------------------------------------------------------------------------------------------------ direct downlink
def stations_by_second(day, setup_s):
    """Rate of the radio in each second: the station that rose first is kept until the satellite sets there."""
    down, pair = day.operations.downlink, day.view.pair
    time_s = np.arange(0.0, pair.whole_s[1]) + 0.5
    own = pair.leo.orbit.states(time_s).position_m
    seen = {s.name: figure.elevation_rad(s, pair.epoch, time_s, own) > s.mask_rad for s in orbit.stations(down)}
    rose: dict[str, int] = {}
    serving, since, rate, log = "", 0, np.zeros(time_s.size), []
    for second in range(time_s.size):
        for name, up in seen.items():
            if up[second]:
                rose.setdefault(name, second)
            else:
                rose.pop(name, None)
        if serving not in rose:
            serving = min(rose, key=lambda name: rose[name], default="")
            since = second
            if serving:
                log.append((serving, second))
        if serving and second + 0.5 - since >= setup_s:
            rate[second] = down.data_rate_bit_s
    return rate, log


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-24")
@pytest.mark.parametrize(
    "stations",
    [pytest.param({}, marks=pytest.mark.endurance), {"operations.downlink.stations.tromso": TROMSO}],
)
def test_the_direct_downlink_has_one_station_at_a_time(quick, seconds, stations):
    found = quick(NO_SEARCH, stations)
    way, o = found.direct, found.operations
    rate, log = stations_by_second(found, 20.0)
    log = [(name, at) for name, at in log if at < 86400]
    assert list(way.stations) == [name for name, _ in log]
    np.testing.assert_allclose([c.start_s for c in way.contacts], [at for _, at in log], atol=1.0)
    assert way.capacity_bit == pytest.approx(np.sum(rate[seconds.inside]), abs=2 * 100e6 * len(log))
    for first, second in zip(way.contacts[:-1], way.contacts[1:], strict=True):
        assert second.start_s >= first.end_s
    handed = [c for c in way.contacts if c.begins == "station free"]
    assert bool(handed) == bool(stations)
    made = np.where(seconds.inside, o.instrument_rate_bit_s, 0.0)
    sent, lost, left = packets(rate, made, o.store_bit, o.downlink.delay_s)
    assert (lost, way.lost_bit) == (0.0, 0.0)
    assert way.on_board_bit == pytest.approx(left, abs=2 * 100e6)
    same_latencies(way, sent, left, 120.0)


@pytest.mark.promise("day-24")
def test_a_pass_shorter_than_the_setup_carries_nothing(quick):
    found = quick(NO_SEARCH, {"operations.downlink.setup": "600 s", "orbit.duration": "12 h"})
    assert found.direct.contacts
    assert found.direct.capacity_bit == 0.0
    assert found.ratio == math.inf


# ---------------------------------------------------------------------------------------- missions that lack something
def test_a_mission_without_downlink(quick):
    found = quick(SIX_HOURS, {"operations.downlink": None})
    assert found.direct is None
    assert math.isnan(found.ratio)
    assert found.relay.capacity_bit > 0.0


@pytest.mark.parametrize(
    "changes", [BLIND, {"orbit.duration": "60 s"}, {"orbit.leo": {"kind": "geostationary", "longitude": "-37 deg"}}]
)
def test_a_day_without_any_contact_is_a_day_all_the_same(quick, changes):
    found = quick(SIX_HOURS, changes)
    v, way = found.view, found.relay
    assert (v.encounters, v.contact_s, v.visible_share, v.largest("range_most_m")) == ((), 0.0, 0.0, 0.0)
    assert math.isnan(v.median_s)
    assert (way.contacts, way.capacity_bit, way.capacity_spread_bit, way.failed_contacts) == ((), 0.0, (0.0, 0.0), 0.0)
    assert way.carried_bit.shape == (0,)
    first = v.contacts[0].start_s if v.contacts else v.duration_s  # behind the minute there are some
    assert v.gap_s == way.gap_s == first >= v.duration_s
    assert found.warnings == ()
    assert (found.ratio == 0.0) == (found.relay.capacity_bit == 0.0)
    if not v.contacts:
        assert way.slow_s == math.inf
        assert way.on_board_bit == pytest.approx(way.generated_bit)


def test_a_contact_that_never_ends_has_no_median(quick):
    found = quick(SIX_HOURS, {"orbit.leo": {"kind": "geostationary", "longitude": "100 deg"}, "orbit.geo.limits": None})
    (encounter,) = found.view.encounters
    assert (encounter.contact.begins, encounter.contact.ends) == ("start of the span", "end of the span")
    assert math.isnan(found.view.median_s)
    assert (found.view.visible_share, found.view.gap_s) == (1.0, 0.0)
    # a chord of a circle, 43 deg
    assert encounter.range_most_m == pytest.approx(2 * 42_164_170 * math.sin(math.radians(21.5)), rel=1e-5)


def test_two_satellites_in_one_slot_are_refused(quick):
    with pytest.raises(orbit.OrbitError, match="are at the same place"):
        quick(SIX_HOURS, {"orbit.leo": {"kind": "geostationary", "longitude": "143 deg"}, "orbit.geo.limits": None})


@pytest.mark.promise("day-19")
def test_the_seed_makes_the_day(quick):
    hard = {"acquisition.lock_probability": 0.6, "operations.runs": 5}
    one, same, other = (quick(SIX_HOURS, hard, {"operations.seed": seed}) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.relay.carried_bit, same.relay.carried_bit)
    assert (one.relay.capacity_spread_bit, one.relay.slow_s) == (same.relay.capacity_spread_bit, same.relay.slow_s)
    assert not np.array_equal(one.relay.carried_bit, other.relay.carried_bit)
    np.testing.assert_array_equal(one.direct.carried_bit, other.direct.carried_bit)


@pytest.mark.promise("day-8")
def test_an_ephemeris_of_the_same_orbit_has_the_same_contacts(quick, day, tmp_path):
    own = day.view.pair.leo.orbit
    (tmp_path / "a.oem").write_text(ephemeris(own, np.arange(0.0, 172801.0, 60.0)), encoding="utf-8")
    limits = {"attitude": "free", "slew_limit": "0.5 deg/s", "sun_exclusion": "5 deg", "in_eclipse": True}
    found = quick({"orbit.leo": {"kind": "ephemeris", "file": "a.oem", "limits": limits}})
    assert isinstance(found.view.pair.leo.orbit, EphemerisOrbit)
    assert len(found.view.contacts) == len(day.view.contacts)
    for one, other in zip(found.view.contacts, day.view.contacts, strict=True):
        assert (one.begins, one.ends) == (other.begins, other.ends)
        assert one.start_s == pytest.approx(other.start_s, abs=0.1)
        assert one.end_s == pytest.approx(other.end_s, abs=0.1)
    assert found.view.closed_form is None
    assert found.relay.capacity_bit == pytest.approx(day.relay.capacity_bit, rel=1e-4)
    assert len(found.direct.contacts) == len(day.direct.contacts)


# -------------------------------------------------------------------------------------------- constants of the mission
@pytest.mark.promise("day-5")
def test_constants_that_the_contacts_exceed_are_said(quick):
    beyond = {
        "communication.distance": "40000 km",
        "beacon.distance": "41000 km",
        "answer.distance": "43999 km",
        "point_ahead.transverse_velocity": "10 km/s",
    }
    said = quick({"orbit.duration": "8 h"}, beyond).warnings
    assert [text.split(" is ")[0] for text in said] == [
        "communication.distance",
        "beacon.distance",
        "point_ahead.transverse_velocity",
    ]
    assert said[0].startswith("communication.distance is 40000 km, and the contacts reach a range of 440")
    assert said[0].endswith(f" km, which costs {20.0 * math.log10(44036.0 / 40000.0):.2f} dB more than budgeted")
    assert "velocity across the line of sight of 10.6" in said[2] and "dB" not in said[2]
    assert "dB more than budgeted" in said[1]
    enough = {"communication.distance": "44100 km", "point_ahead.transverse_velocity": "10.7 km/s"}
    assert quick({"orbit.duration": "8 h"}, enough).warnings == ()


@pytest.mark.promise("day-5")
@pytest.mark.parametrize(("given_rad_s", "said"), [(200e-6, True), (253.5e-6, False)])
def test_a_rate_of_the_line_of_sight_beyond_that_of_the_loop_is_said(day, given_rad_s, said):
    """The contacts reach 255 urad/s: 253.5 is within a hundredth of that."""
    reference = SimpleNamespace(line_of_sight_rate_rad_s=given_rad_s)
    beam = SimpleNamespace(distance_m=44_100e3)
    m = SimpleNamespace(
        communication=beam,
        range_m=lambda table: table.distance_m,
        beacon=None,
        answer=None,
        point_ahead=None,
        fine_pointing=SimpleNamespace(reference=reference),
    )
    warnings = geometry.beyond_the_mission(m, day.view)
    assert [text.partition(" is ")[0] for text in warnings] == ["fine_pointing.reference.line_of_sight_rate"] * said


# --------------------------------------------------------------------------------------------------------- assumptions
def flat(table, start=""):
    """Each value of a table by its dotted name."""
    found = {}
    for name, value in table.items():
        found |= flat(value, f"{start}{name}.") if isinstance(value, dict) else {f"{start}{name}": value}
    return found


CHANGED = {
    "laser data rate": "communication.data_rate_bit_s",
    "margin demanded of the laser link": "operations.margin_db",
    "time of acquisition": "",
    "pointing loss": "",
    "eclipse": "orbit.leo.limits.in_eclipse",
    "share of each contact that the relay grants": "operations.relay_share",
    "grazing height": "orbit.grazing_height_m",
    "attitude of the satellite": "orbit.leo.limits",
    "orbit altitude": "orbit.leo.altitude_m",
    "local time of the node": "orbit.leo.local_time_s",
    "instrument data rate": "operations.instrument_rate_bit_s",
    "radio data rate": "operations.downlink.data_rate_bit_s",
    "ground stations": "operations.downlink.stations",
    "elevation mask": "operations.downlink.stations",
}


def tables_of(case):
    return {
        "operations": case.operations.model_dump(),
        "orbit": case.orbits.model_dump(),
        "communication": case.data.table.model_dump(),
    }


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-5")
def test_each_side_changes_just_its_own_key(links, day, monkeypatch):
    cases = {}

    def noted(case, known):
        mark = Numbers(float(len(cases) + 1), 1.0, 1.0, 1.0)
        cases[mark.relay_bit] = case
        return mark

    monkeypatch.setattr(assumptions, "numbers", noted)
    m = links.file.mission
    own = assumptions.Case(m.operations, m.orbit, links.data, day.loss)
    known = assumptions.Known(own, lambda other: day.view.pair, day.view, (), links.finding.wide)
    found = assumptions.swings(known, lambda *said: None)
    assert {s.name for s in found} == CHANGED.keys()
    before = flat(tables_of(own)) | {"operations.runs": 4}
    for s in found:
        for text, mark in ((s.low, s.at_low), (s.high, s.at_high)):
            case = cases[mark.relay_bit]
            after = flat(tables_of(case))
            differs = {k for k in before.keys() | after.keys() if before.get(k, "") != after.get(k, "")}
            if text == NOTHING:
                assert (differs, case.slower) == (set(), 1.0)
                continue
            key = CHANGED[s.name]
            assert all(k.startswith(key) for k in differs) and bool(differs) == bool(key), (s.name, differs)
            assert (case.slower == 1.0) == (s.name != "time of acquisition")
            assert (case.loss == day.loss) == (s.name != "pointing loss")
            if s.name == "attitude of the satellite":  # slew, Sun and eclipse stay
                assert {k.rpartition(".")[2] for k in differs} == {"attitude", "boresight", "field_of_regard_rad"}

    sides = {s.name: [cases[mark.relay_bit] for mark in (s.at_low, s.at_high)] for s in found}
    assert [c.loss.loss_db for c in sides["pointing loss"]] == [0.0, day.loss.loss_db + 3.0]
    assert [c.slower for c in sides["time of acquisition"]] == [0.5, 2.0]
    for name, of in (
        ("laser data rate", lambda case: case.data.table.data_rate_bit_s),
        ("instrument data rate", lambda case: case.operations.instrument_rate_bit_s),
        ("radio data rate", lambda case: case.operations.downlink.data_rate_bit_s),
    ):
        assert [of(case) / of(own) for case in sides[name]] == [0.5, 2.0], name


SIDES = {
    ("laser data rate", 0): {"communication.data_rate": "150 Mbit/s"},
    ("margin demanded of the laser link", 0): {"operations.margin": "0 dB"},
    ("margin demanded of the laser link", 1): {"operations.margin": "6 dB"},
    ("share of each contact that the relay grants", 0): {"operations.relay_share": 0.5},
    ("grazing height", 0): {"orbit.grazing_height": "0 km"},
    ("grazing height", 1): {"orbit.grazing_height": "200 km"},
    ("orbit altitude", 0): {"orbit.leo.altitude": "400 km"},
    ("orbit altitude", 1): {"orbit.leo.altitude": "600 km"},
    ("local time of the node", 0): {"orbit.leo.local_time": "16.5 h"},
    ("instrument data rate", 1): {"operations.instrument_rate": "6 Mbit/s"},
    ("radio data rate", 1): {"operations.downlink.data_rate": "200 Mbit/s"},
    ("elevation mask", 0): {"operations.downlink.stations.kiruna.mask": "0 deg"},
    ("elevation mask", 1): {"operations.downlink.stations.kiruna.mask": "10 deg"},
    ("ground stations", 1): {
        "operations.downlink.stations.south": {
            "latitude": "-67.85713 deg",
            "longitude": "-159.03567 deg",
            "height": "402.2 m",
            "mask": "5 deg",
        }
    },
}


IN_THE_GATE = (
    ("margin demanded of the laser link", 1),
    ("share of each contact that the relay grants", 0),
    ("grazing height", 0),
    ("orbit altitude", 1),
    ("elevation mask", 1),
    ("ground stations", 1),
)
"""Sides of the links, of the relay, of the Earth, of the orbit, and of the ground."""


def each_side_is_a_day(quick, monkeypatch, sides):
    every, names = assumptions._changes, {name for name, _ in sides}
    with monkeypatch.context() as whole:
        whole.setattr(day_study, "swings", assumptions.swings)
        whole.setattr(assumptions, "_changes", lambda *args: [each for each in every(*args) if each[0] in names])
        given = quick(SIX_HOURS, NO_SEARCH)
    by_name = {s.name: s for s in given.swings}
    for (name, side), changes in sides.items():
        numbers = (by_name[name].at_low, by_name[name].at_high)[side]
        # the pointing loss stays as it is: that of the mission as given
        edited = quick(SIX_HOURS, NO_SEARCH, changes, loss=given.loss)
        relay, direct = edited.relay, edited.direct
        expected = (relay.capacity_bit, direct.capacity_bit, relay.slow_s, direct.slow_s)
        got = (numbers.relay_bit, numbers.direct_bit, numbers.relay_slow_s, numbers.direct_slow_s)
        assert got == pytest.approx(expected, rel=1e-9), (name, side)
    factors = [s.factor for s in given.swings]
    assert factors == sorted(factors, reverse=True)


@pytest.mark.promise("day-5")
def test_each_side_is_the_day_of_a_mission_edited_so(quick, monkeypatch):
    each_side_is_a_day(quick, monkeypatch, {side: SIDES[side] for side in IN_THE_GATE})


@pytest.mark.endurance
def test_each_other_side_is_the_day_of_a_mission_edited_so(quick, monkeypatch):
    each_side_is_a_day(quick, monkeypatch, SIDES)


@pytest.mark.parametrize(
    ("changes", "name", "sides"),
    [
        ({"orbit.grazing_height": "300 km"}, "grazing height", ("0 m", NOTHING)),  # 600 km is above the satellite
        ({"orbit.leo.altitude": "145 km", "orbit.grazing_height": "0 km"}, "orbit altitude", (NOTHING, "174 km")),
        ({"orbit.leo.altitude": "5500 km"}, "orbit altitude", ("4400 km", NOTHING)),  # 6600 km: not sun-synchronous
    ],
)
def test_an_assumption_that_leaves_no_orbit_is_left_as_it_is(tmp_path, monkeypatch, changes, name, sides):
    every = assumptions._changes
    monkeypatch.setattr(assumptions, "_changes", lambda *args: [each for each in every(*args) if each[0] == name])
    found = day_study.run_day_study(link_study.run_link_study(day_file(tmp_path, SIX_HOURS, NO_SEARCH, changes)))
    (swing,) = [s for s in found.swings if s.name == name]
    assert (swing.low, swing.high) == sides
    unchanged = swing.at_low if sides[0] == NOTHING else swing.at_high
    assert unchanged.relay_bit == pytest.approx(found.relay.capacity_bit)


@pytest.mark.parametrize(
    ("relay", "direct", "ratio"), [(6.0, 2.0, 3.0), (6.0, 0.0, math.inf), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0)]
)
def test_the_ratio_with_nothing_on_either_side(relay, direct, ratio):
    assert Numbers(relay, direct, 1.0, 1.0).ratio == ratio
    assert flow.ratio(relay, direct) == ratio


@pytest.mark.parametrize(
    ("low", "high", "factor"),
    [
        ((6.0, 2.0), (12.0, 2.0), 2.0),
        ((12.0, 2.0), (6.0, 2.0), 2.0),
        ((6.0, 2.0), (6.0, 2.0), 1.0),
        ((0.0, 2.0), (6.0, 2.0), math.inf),
        ((6.0, 0.0), (6.0, 2.0), math.inf),
        ((6.0, 0.0), (12.0, 0.0), 2.0),  # nothing direct: the relay's volume
        ((0.0, 0.0), (12.0, 0.0), math.inf),
        ((0.0, 0.0), (0.0, 0.0), 1.0),
        ((0.0, 0.0), (0.0, 2.0), 1.0),  # nothing by relay either way
        ((6.0, math.nan), (18.0, math.nan), 3.0),  # no direct downlink
        ((0.0, math.nan), (18.0, math.nan), math.inf),
    ],
)
def test_the_factor_between_two_sides(low, high, factor):
    ends = [Numbers(relay, direct, 1.0, 1.0) for relay, direct in (low, high)]
    assert Swing("an assumption", "low", "high", *ends, ends[0]).factor == pytest.approx(factor)


def test_what_lowers_the_ratio_on_both_sides_counts_from_where_it_is():
    low, high, here = (Numbers(relay, 2.0, 1.0, 1.0) for relay in (6.0, 2.0, 12.0))
    assert Swing("an assumption", "low", "high", low, high, here).factor == pytest.approx(6.0)
    assert Swing("an assumption", "low", "high", low, high, low).factor == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("contacts", "gap_s"),
    [
        ([], 100.0),
        ([(10.0, 20.0)], 130.0),  # to the end of what is known
        ([(10.0, 20.0), (120.0, 130.0)], 100.0),
        ([(60.0, 95.0), (98.0, 105.0)], 60.0),  # what begins behind the span does not count
    ],
)
def test_the_longest_gap_by_hand(contacts, gap_s):
    pair = SimpleNamespace(span_s=(0.0, 100.0), whole_s=(0.0, 150.0))
    given = [SimpleNamespace(start_s=start, end_s=end) for start, end in contacts]
    assert geometry.longest_gap_s(given, pair) == gap_s


def test_the_longest_time_without_contact_is_followed_beyond_the_span(day):
    """Nothing is heard from the last pass of the day on until the first one of the next day."""
    passes, span, whole = day.direct.contacts, day.view.pair.span_s, day.view.pair.whole_s
    later = min(
        each.start_s
        for station in orbit.stations(day.operations.downlink)
        for each in orbit.passes(day.view.pair.leo.orbit, station, day.view.pair.epoch, whole)
        if each.start_s > passes[-1].end_s
    )
    inside = max(b.start_s - a.end_s for a, b in itertools.pairwise(passes))
    assert later > span[1]
    assert day.direct.gap_s == pytest.approx(max(passes[0].start_s - span[0], inside, later - passes[-1].end_s))
    assert day.direct.gap_s > max(inside, span[1] - passes[-1].end_s)


# ------------------------------------------------------------------------------------------------------------- the map
def test_the_track_is_open_where_the_contacts_are(day, seconds):
    from microrad.orbit.day.ground_track import ground_track

    track = ground_track(day.view, (day.relay, day.direct), day.operations.downlink)
    at = track.time_s.astype(int)
    near_edge = np.array([np.any(np.diff(seconds.seen[max(k - 3, 0) : k + 3].astype(int))) for k in at])
    np.testing.assert_array_equal(track.open["relay"][~near_edge], seconds.seen[at][~near_edge])
    assert float(np.mean(track.open["direct downlink"])) == pytest.approx(day.direct.contact_s / 86400.0, abs=2e-3)
    assert np.max(np.abs(track.latitude_rad)) < math.radians(83.0)
    assert track.relay.longitude_rad == pytest.approx(math.radians(143.0), abs=1e-9)
    assert track.relay.latitude_rad == pytest.approx(0.0, abs=1e-9)
    (kiruna,) = track.stations
    # the outline is where a satellite at the mean height stands at the mask
    station = orbit.stations(day.operations.downlink)[0]
    assert (kiruna.latitude_rad, kiruna.longitude_rad) == (station.latitude_rad, station.longitude_rad)


@pytest.mark.promise("report-7")
def test_nothing_about_a_day_is_asked_of_a_mission_without_its_tables(tmp_path):
    links = link_study.run_link_study(day_file(tmp_path, ALONE, {"operations": None}))
    with pytest.raises(ValueError, match=r"no table \[operations\]: microrad init writes one"):
        day_study.run_day_study(links)
    assert geometry.view(
        orbit.pair(links.file.mission.orbit, links.file.mission.terminals, tmp_path), 1.55e-6
    ).encounters


def test_an_uncorrected_point_ahead_is_in_the_loss_and_so_in_the_reach(tmp_path):
    links = link_study.run_link_study(day_file(tmp_path, SIX_HOURS, {"point_ahead.corrected": False}))
    loss = day_study.given_loss(links)
    assert loss.loss_db > 100.0
    (closing,) = flow.closings(links.file.mission.operations, link.of(links.file.mission), loss)
    assert closing.margin_db == pytest.approx(links.communication.margin_db, abs=1e-9)
    again = day_study.loss_at(link.of(links.file.mission), links.communication.margin_db, "")
    assert again.loss_db == loss.loss_db


@pytest.mark.promise("day-5")
def test_orbits_that_end_with_the_span_are_said_to(quick, tmp_path):
    assert not any("behind the span" in w for w in quick(SIX_HOURS).warnings)
    found = quick({"orbit.epoch": "2050-12-31T12:00:00Z", "orbit.duration": "6 h"})
    assert found.view.pair.tail_s == 0.0
    assert any(w.startswith("the orbits hold for 0 s behind the span") for w in found.warnings)


@pytest.mark.promise("day-16")
def test_a_contact_cut_by_the_sun_counts_as_one_rise(quick):
    found = quick({})
    assert (len(found.view.encounters), found.view.rises) == (15, 14)
    free = quick({"orbit.leo.limits.sun_exclusion": "0 deg", "orbit.geo.limits.sun_exclusion": "0 deg"})
    assert (len(free.view.encounters), free.view.rises) == (14, 14)


@pytest.mark.parametrize(("tail_s", "said"), [(TAIL_S, 0), (TAIL_S - 1.0, 1), (0.0, 1)])
def test_a_tail_as_long_as_it_may_be_is_not_spoken_of(tail_s, said):
    assert len(geometry.short_tail(SimpleNamespace(tail_s=tail_s))) == said


@pytest.mark.parametrize(("factor", "said"), [(1.0, 0), (0.9902, 0), (0.9899, 1)])
def test_constants_are_exceeded_from_a_hundredth_on_each_by_its_own_measure(factor, said):
    seen = {"point_ahead_most_rad": 50e-6, "rate_most_rad_s": 200e-6, "range_most_m": 44e6}
    view = SimpleNamespace(encounters=[0], largest=seen.__getitem__)
    beam = SimpleNamespace(distance_m=44e6 * factor)
    m = SimpleNamespace(
        communication=beam,
        beacon=beam,
        answer=beam,
        range_m=lambda table: table.distance_m,
        point_ahead=SimpleNamespace(transverse_velocity_m_s=25e-6 * 299_792_458.0 * factor),
        fine_pointing=SimpleNamespace(reference=SimpleNamespace(line_of_sight_rate_rad_s=200e-6 * factor)),
    )
    texts = geometry.beyond_the_mission(m, view)
    keys = ["communication", "beacon", "answer", "point_ahead", "fine_pointing"]
    assert [text.partition(".")[0] for text in texts] == keys * said
    assert [("dB more than budgeted" in text) for text in texts] == [True, True, True, False, False] * said
    assert geometry.beyond_the_mission(m, SimpleNamespace(encounters=[], largest=seen.__getitem__)) == ()


@pytest.mark.parametrize(
    ("changes", "gone", "one_sided"),
    [
        ({"operations.margin_db": 0.0}, (), "margin demanded of the laser link"),
        ({"operations.relay_share": 0.5}, ("share of each contact that the relay grants",), ""),
        ({"orbit.grazing_height_m": 0.0}, ("grazing height",), ""),
        ({"orbit.leo.limits.in_eclipse": False}, ("eclipse",), ""),
        ({"orbit.leo.limits.attitude": "nadir"}, ("attitude of the satellite",), ""),
        ({"orbit.leo.limits": None}, ("eclipse",), ""),
        ({"orbit.leo.local_time_s": None}, ("local time of the node",), ""),
        ({"orbit.leo.altitude_m": None}, ("orbit altitude", "local time of the node"), ""),
        ({"operations.downlink": None}, ("radio data rate", "ground stations", "elevation mask"), ""),
    ],
)
def test_an_assumption_that_the_mission_does_not_make_is_not_changed(links, day, changes, gone, one_sided):
    m = links.file.mission
    tables = {"operations": m.operations, "orbit": m.orbit}
    for key, value in changes.items():
        table, _, name = key.partition(".")
        tables[table] = tables[table].with_value(name, value)
    own = assumptions.Case(tables["operations"], tables["orbit"], links.data, day.loss)
    found = {name: sides for name, *sides in assumptions._changes(own, links.finding.wide)}
    assert CHANGED.keys() - found.keys() == set(gone)
    alone = {"share of each contact that the relay grants", "attitude of the satellite", "eclipse", one_sided}
    alone |= {"local time of the node", "ground stations"}  # it has one station
    assert {name for name, sides in found.items() if None in sides} == alone & found.keys()
    assert "time of acquisition" not in {name for name, *_ in assumptions._changes(own, None)}


@pytest.mark.parametrize(("factor", "doubled"), [(2.0, True), (1.999, False), (1.0, False)])
def test_a_rate_is_doubled_where_the_receiver_takes_twice_as_much(links, day, factor, doubled):
    m = links.file.mission
    rate = m.communication.data_rate_bit_s
    data = replace(links.data, receiver=SimpleNamespace(highest_data_rate_bit_s=factor * rate))
    own = assumptions.Case(m.operations, m.orbit, data, day.loss)
    slow, fast = next(sides for name, *sides in assumptions._changes(own, None) if name == "laser data rate")
    assert slow[1].data.table.data_rate_bit_s == 0.5 * rate
    assert (fast is not None) == doubled
    steps = m.operations.with_value("rates_bit_s", (rate,))
    assert "laser data rate" not in dict(named(assumptions._changes(replace(own, operations=steps), None)))


def named(changes):
    """The assumptions by name with their sides in words."""
    return [(name, [None if side is None else side[0] for side in sides]) for name, *sides in changes]


def test_one_of_several_stations_is_left_out(links, day):
    m = links.file.mission
    (name,) = m.operations.downlink.stations
    both = {name: m.operations.downlink.stations[name], "other": m.operations.downlink.stations[name]}
    own = assumptions.Case(m.operations.with_value("downlink.stations", both), m.orbit, links.data, day.loss)
    made = {each: sides for each, *sides in assumptions._changes(own, None)}
    (fewer, left), (more, grown) = made["ground stations"]
    assert (fewer, more) == (f"without {name}", f"one more, opposite {name}")
    assert list(left.operations.downlink.stations) == ["other"]
    assert list(grown.operations.downlink.stations) == [name, "other", f"opposite {name}"]


def test_masks_are_doubled_up_to_the_highest_that_a_mission_takes(links, day):
    m = links.file.mission
    (name,) = m.operations.downlink.stations
    given = m.operations.downlink.stations[name].with_value("mask_rad", math.radians(60.0))
    steep = m.operations.with_value("downlink.stations", {name: given})
    own = assumptions.Case(steep, m.orbit, links.data, day.loss)
    (_, flat_), (_, high) = next(s for each, *s in assumptions._changes(own, None) if each == "elevation mask")
    assert flat_.operations.downlink.stations[name].mask_rad == 0.0
    assert math.degrees(high.operations.downlink.stations[name].mask_rad) == pytest.approx(89.0)


def test_a_margin_of_nothing_is_raised_to_3_db_and_one_that_is_asked_for_is_doubled(links, day):
    m = links.file.mission
    for given, low, high in ((0.0, None, "3 dB"), (2.0, "0 dB", "4 dB")):
        own = assumptions.Case(m.operations.with_value("margin_db", given), m.orbit, links.data, day.loss)
        assert dict(named(assumptions._changes(own, None)))["margin demanded of the laser link"] == [low, high]


def test_a_lower_rate_that_reaches_no_further_never_serves():
    of = [flow.Closing(4.0, 0.0, 4e7), flow.Closing(3.0, 0.0, 4e7), flow.Closing(2.0, 0.0, 3e7)]
    assert flow.rate_table((*of, flow.Closing(1.0, 0.0, 5e7))).steps == ((4.0, 4e7), (1.0, 5e7))
    assert flow.rate_table(()) is None


def test_a_rate_above_the_receivers_is_left_out_and_its_highest_is_not(tmp_path):
    rates = {"operations.rates": ["1 Gbit/s", "3.2 Gbit/s", "3.3 Gbit/s"]}
    m = day_file(tmp_path, received_with("homodyne bpsk"), rates).mission
    data = link.of(m)
    found = flow.closings(m.operations, data, PointingLoss(1.0, 0.0, "stated"))
    assert data.receiver.highest_data_rate_bit_s == pytest.approx(3.2e9)
    assert [each.rate_bit_s for each in found] == [3.2e9, 1e9]
    assert flow.closings(m.operations.with_value("rates_bit_s", (3.3e9,)), data, PointingLoss(1.0, 0.0, "")) == ()


@pytest.mark.parametrize(
    ("contact", "share", "parts"),
    [
        ((10.0, 20.0), 1.0, [(10.0, 20.0)]),
        ((10.0, 20.0), 0.5, [(10.0, 15.0)]),
        ((90.0, 100.0), 0.5, [(90.0, 95.0)]),
        ((90.0, 110.0), 0.5, [(90.0, 95.0), (100.0, 105.0)]),
        ((100.0, 110.0), 0.5, [(100.0, 105.0)]),
        ((110.0, 120.0), 0.5, [(110.0, 115.0)]),
    ],
)
def test_a_share_is_granted_of_each_part_of_a_contact_within_and_behind_the_span(contact, share, parts):
    whole = orbit.Contact(*contact, "Earth", "range")
    seen = SimpleNamespace(contacts=(whole,), range_m=(np.cos,), duration_s=100.0, partner="relay")
    found = flow._granted(seen, share)
    assert [(c.start_s, c.end_s) for c, _ in found] == parts
    assert all(range_m is np.cos and c.begins == "Earth" for c, range_m in found)
    assert {c.ends for c, _ in found} == {"range" if share == 1.0 else "end of the relay's share"}
    assert flow._of_span(tuple(c for c, _ in found), seen) == sum(start < 100.0 for start, _ in parts)


SLOT = orbit.GeostationarySlot("GEO", orbit.Epoch("2026-03-20T12:00:00Z"), 0.3)
LOW = orbit.KeplerOrbit("LEO", SLOT.epoch, EARTH_RADIUS_M + 500e3, 0.0, 1.7, 0.0, 0.0, 0.0, True)
OFF_NADIR_RAD = math.asin(LOW.semi_major_axis_m / orbit.GEOSTATIONARY_RADIUS_M)


@pytest.mark.parametrize(
    ("low", "own", "far", "holds"),
    [
        ({}, {}, {}, True),
        ({"eccentricity": 1e-6}, {}, {}, True),
        ({"eccentricity": 2e-6}, {}, {}, False),
        ({"semi_major_axis_m": orbit.GEOSTATIONARY_RADIUS_M}, {}, {}, False),
        ({"semi_major_axis_m": 5e7}, {}, {}, False),
        ({}, {"field_of_regard_rad": 3.14}, {}, False),
        ({}, {}, {"field_of_regard_rad": OFF_NADIR_RAD}, True),
        ({}, {}, {"field_of_regard_rad": OFF_NADIR_RAD - 1e-6}, False),
    ],
)
def test_the_contact_by_hand_is_of_a_circle_below_the_slot_that_no_field_of_regard_cuts(low, own, far, holds):
    pair = SimpleNamespace(
        leo=SimpleNamespace(orbit=replace(LOW, **low), limits=replace(UNLIMITED, attitude="nadir", **own)),
        geo=SimpleNamespace(orbit=SLOT, limits=replace(UNLIMITED, attitude="nadir", **far)),
        earth=figure.Earth("sphere", 100e3),
    )
    found = geometry._closed_form(pair)
    assert found == (orbit.coplanar_contact(LOW.semi_major_axis_m, 100e3) if holds else None)
    pair.geo.orbit = LOW
    assert geometry._closed_form(pair) is None
    pair.leo.orbit, pair.geo.orbit = SLOT, SLOT
    assert geometry._closed_form(pair) is None


@pytest.mark.parametrize("node", [{"node": "30 deg"}, {"local_time": "10.5 h"}])
def test_the_elements_of_a_mission_are_those_of_its_orbit(tmp_path, node):
    table = {**{k: v for k, v in KEPLERIAN.items() if k != "node"}, **node, "mean_anomaly": "40 deg"}
    m = day_file(tmp_path, ALONE, {"orbit.leo": table}).mission
    own = orbit.pair(m.orbit, m.terminals, tmp_path).leo.orbit
    degrees = [math.degrees(x) for x in (own.inclination_rad, own.argument_of_perigee_rad, own.mean_anomaly_rad)]
    assert degrees == pytest.approx([97.4, 90.0, 40.0])
    assert (own.semi_major_axis_m, own.eccentricity, own.j2) == (7e6, 0.001, True)
    wanted = math.radians(30.0) if "node" in node else node_of_local_time(own.epoch, 10.5)
    assert own.node_rad == pytest.approx(wanted)


def test_a_circle_of_a_mission_begins_at_its_phase(tmp_path):
    m = day_file(tmp_path, ALONE, {"orbit.leo.phase": "70 deg", "orbit.leo.gravity": "j2"}).mission
    own = orbit.pair(m.orbit, m.terminals, tmp_path).leo.orbit
    assert math.degrees(own.mean_anomaly_rad) == pytest.approx(70.0)
    assert (own.eccentricity, own.argument_of_perigee_rad) == (0.0, 0.0)


def test_limits_of_a_body_that_turns_to_its_partner_have_no_boresight_and_cut_nothing(tmp_path):
    table = {"attitude": "free", "slew_limit": "2 deg/s", "sun_exclusion": "6 deg", "in_eclipse": False}
    m = day_file(tmp_path, ALONE, {LIMITS: table}).mission
    found = orbit.pair(m.orbit, m.terminals, tmp_path).leo.limits
    assert (found.attitude, found.boresight, found.field_of_regard_rad) == ("free", UNLIMITED.boresight, math.pi)
    assert math.degrees(found.slew_limit_rad_s) == pytest.approx(2.0)
    assert (math.degrees(found.sun_exclusion_rad), found.in_eclipse) == (pytest.approx(6.0), False)


@pytest.mark.parametrize("degrees", [0.0, 9.0, -15.0])
def test_a_partner_in_a_slot_stands_above_its_longitude_also_above_greenwich(tmp_path, degrees):
    m = day_file(tmp_path, ALONE, {"orbit.geo.longitude": f"{degrees:g} deg"}).mission
    partner = orbit.pair(m.orbit, m.terminals, tmp_path).geo.orbit
    x, y, z = partner.states(np.zeros(1)).position_m[:, 0]
    east = math.atan2(y, x) - partner.epoch.earth_rotation_rad(0.0)
    assert math.degrees(math.remainder(east, 2.0 * math.pi)) == pytest.approx(degrees, abs=1e-6)
    assert z == pytest.approx(0.0, abs=1.0)


def exceeded(**seen):
    """What is said of a mission whose numbers are all unlike each other."""
    at = {"point_ahead_most_rad": 61e-6, "rate_most_rad_s": 345e-6, "range_most_m": 45.6789e6} | seen
    m = SimpleNamespace(
        communication=SimpleNamespace(distance_m=41e6),
        beacon=SimpleNamespace(distance_m=42.5e6),
        answer=SimpleNamespace(distance_m=39.75e6),
        range_m=lambda table: table.distance_m,
        point_ahead=SimpleNamespace(transverse_velocity_m_s=8765.0),
        fine_pointing=SimpleNamespace(reference=SimpleNamespace(line_of_sight_rate_rad_s=210e-6)),
    )
    return list(geometry.beyond_the_mission(m, SimpleNamespace(encounters=[0], largest=at.__getitem__)))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: exceeded(range_most_m=45.6789e6),
            [
                (
                    "communication.distance is 41000 km, and the contacts reach a range of 45679 km, which "
                    "costs 0.94 dB more than budgeted"
                ),
                (
                    "beacon.distance is 42500 km, and the contacts reach a range of 45679 km, which costs 0.63 "
                    "dB more than budgeted"
                ),
                (
                    "answer.distance is 39750 km, and the contacts reach a range of 45679 km, which costs 1.21 "
                    "dB more than budgeted"
                ),
                (
                    "point_ahead.transverse_velocity is 8.765 km/s, and the contacts reach a velocity across "
                    "the line of sight of 9.1437 km/s"
                ),
                (
                    "fine_pointing.reference.line_of_sight_rate is 210 µrad/s, and the contacts reach a rate "
                    "of the line of sight of 345 µrad/s"
                ),
            ],
        ),
        (
            lambda: exceeded(range_most_m=42.0e6, rate_most_rad_s=1e-4),
            [
                (
                    "communication.distance is 41000 km, and the contacts reach a range of 42000 km, which "
                    "costs 0.21 dB more than budgeted"
                ),
                (
                    "answer.distance is 39750 km, and the contacts reach a range of 42000 km, which costs 0.48 "
                    "dB more than budgeted"
                ),
                (
                    "point_ahead.transverse_velocity is 8.765 km/s, and the contacts reach a velocity across "
                    "the line of sight of 9.1437 km/s"
                ),
            ],
        ),
        (
            lambda: list(geometry.short_tail(SimpleNamespace(tail_s=5432.1))),
            [("the orbits hold for 5432 s behind the span: data still on board then count as never arrived")],
        ),
    ],
)
def test_what_the_contacts_exceed_is_said_with_each_number(found, expected):
    assert found() == expected


def numbers(relay_bit, direct_bit, optical_bit=math.nan):
    return Numbers(relay_bit, direct_bit, 1.0, 2.0, optical_bit, 3.0)


MOVED = Swing("rate", "low", "high", numbers(6.0, 4.0, 5.0), numbers(9.0, 2.0, 1.25), numbers(8.0, 2.5, 3.0))
BETWEEN = SimpleNamespace(span_s=(-20.0, 100.0), whole_s=(-20.0, 175.0))
UNLIKE = [SimpleNamespace(start_s=start, end_s=end) for start, end in ((5.0, 12.0), (50.0, 61.0), (140.0, 150.0))]
PARTIAL = operations.Service(np.array([10.0, 20.0, 45.0, 60.0]), np.array([3.0, 0.5, 7.0]), 0.75)


def of_seen(*contacts):
    whole = [orbit.Contact(*each, "Earth", "range") for each in contacts]
    return SimpleNamespace(contacts=whole, range_m=(np.sin, np.cos), duration_s=100.0, partner="station")


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [MOVED.of_relay, MOVED.of_optical, MOVED.factor, MOVED.here.ratio, numbers(3.0, 0.0).ratio],
            [3.0, 4.0, 4.0, 3.2, math.inf],
        ),
        (
            lambda: [
                replace(MOVED, here=numbers(8.0, 0.0)).of_relay,
                replace(MOVED, here=numbers(8.0, 2.5)).of_optical,
            ],
            [math.inf, 1.0],
        ),
        (
            lambda: [
                geometry.longest_gap_s(UNLIKE, BETWEEN),
                geometry.longest_gap_s(UNLIKE[:1], BETWEEN),
                geometry.longest_gap_s([], BETWEEN),
            ],
            [79.0, 163.0, 120.0],
        ),
        (
            lambda: [flow.carried_bit(PARTIAL, end_s) for end_s in (5.0, 15.0, 33.0, 50.0, 99.0)],
            [0.0, 11.25, 27.375, 58.125, 110.625],
        ),
        (
            lambda: [
                x
                for each in flow.one_at_a_time(
                    [(4.0, 9.0, 2), (1.0, 6.0, 1), (2.0, 5.5, 0), (8.0, 12.0, 3), (12.0, 13.0, 1)]
                )
                for x in each
            ],
            [1.0, 6.0, 1, 6.0, 9.0, 2, 9.0, 12.0, 3, 12.0, 13.0, 1],
        ),
        (
            lambda: [
                x for c, _ in flow._granted(of_seen((-5.0, 35.0), (92.0, 132.0)), 0.375) for x in (c.start_s, c.end_s)
            ],
            [-5.0, 10.0, 92.0, 95.0, 100.0, 112.0],
        ),
        (
            lambda: [
                x
                for step in flow.rate_table(
                    (flow.Closing(9.0, 1.0, 2e7), flow.Closing(5.0, 2.0, 3.5e7), flow.Closing(2.0, 3.0, 3e7))
                ).steps
                for x in step
            ],
            [9.0, 20000000.0, 5.0, 35000000.0],
        ),
        (
            lambda: [
                *geometry.times(orbit.Contact(3.0, 9.0, "", ""))[[0, 1, -1]],
                geometry.times(orbit.Contact(3.0, 9.0, "", "")).size,
                geometry.times(orbit.Contact(3.0, 1234.0, "", "")).size,
            ],
            [3.0, 3.3, 9.0, 21, 125],
        ),
    ],
)
def test_parts_of_a_day_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


# ------------------------------------------------------------------------------- all numbers unlike each other
UNLIKE_DAY = {
    "orbit.duration": "9 h",
    "orbit.grazing_height": "70 km",
    "orbit.leo.altitude": "630 km",
    "orbit.leo.local_time": "8.25 h",
    "orbit.leo.phase": "40 deg",
    "orbit.leo.limits.slew_limit": "0.4 deg/s",
    "orbit.leo.limits.sun_exclusion": "7 deg",
    "orbit.geo.longitude": "127 deg",
    "orbit.geo.limits.field_of_regard": "9.7 deg",
    "orbit.geo.limits.sun_exclusion": "4 deg",
    "operations.instrument_rate": "4.5 Mbit/s",
    "operations.store": "5 GB",
    "operations.margin": "2.2 dB",
    "operations.relay_share": 0.8,
    "operations.rates": ["51.84 Mbit/s", "155.52 Mbit/s", "622.08 Mbit/s"],
    "operations.runs": 3,
    "operations.seed": 7,
    "operations.relay_delay": "0.7 s",
    "operations.downlink.data_rate": "260 Mbit/s",
    "operations.downlink.setup": "25 s",
    "operations.downlink.delay": "3 s",
    "operations.downlink.stations.kiruna.mask": "7 deg",
    "operations.downlink.stations.perth": {
        "latitude": "-31.8 deg",
        "longitude": "115.9 deg",
        "height": "22 m",
        "mask": "11 deg",
    },
}
CLEAR = {"kiruna": 0.4, "tromso": 0.55, "tenerife": 0.85}
LASERS = {
    "data_rate": "1.3 Gbit/s",
    "setup": "45 s",
    "delay": "2 s",
    "weather": "90 min",
    "correlation_length": "700 km",
}


@pytest.fixture(scope="module")
def unlike_day(tmp_path_factory):
    """Nine hours of a mission whose numbers are all unlike each other, by relay, radio and laser."""
    folder = tmp_path_factory.mktemp("unlike")
    return day_study.run_day_study(
        link_study.run_link_study(day_file(folder, ALONE, UNLIKE_DAY, optical(CLEAR, **LASERS)))
    )


def way_named(name):
    def of(day):
        (way,) = [each for each in day.ways if each.name == name]
        found = [way.contact_s, way.gap_s, way.capacity_bit, *way.capacity_spread_bit, way.generated_bit, way.lost_bit]
        found += [way.on_board_bit, way.arrived_bit, way.failed_contacts, way.median_s, way.slow_s]
        return [*found, *way.carried_bit, *(x for c in way.contacts for x in (c.start_s, c.end_s))]

    return of


def view_of(day):
    v = day.view
    names = ("range_least_m", "range_most_m", "point_ahead_most_rad", "rate_most_rad_s", "acceleration_most_rad_s2")
    most = [v.largest(name) for name in (*names, "range_rate_most_m_s", "doppler_most_hz")]
    return [v.contact_s, v.gap_s, v.days, v.visible_share, v.rises, v.median_s, *most, *v.umbra_s.ravel()]


def swings_of(day):
    ends = [(s.at_low, s.at_high) for s in sorted(day.swings, key=lambda s: s.name)]
    numbers = [n for both in ends for n in both]
    return [x for n in numbers for x in (n.relay_bit, n.direct_bit, n.optical_bit)]


def sky_of(day):
    s = day.sky
    return [*s.availability, *s.drawn, s.any_clear, s.any_drawn, s.any_independent, *s.correlation.ravel()]


def closings_of(day):
    ratios = [day.ratio, day.optical_ratio, day.loss.loss_db, day.loss.outage]
    return [*(x for c in day.closings for x in (c.rate_bit_s, c.margin_db, c.largest_range_m)), *ratios]


@pytest.mark.parametrize(("of", "expected"), [
    (way_named("relay"), [
        18166.6029, 3167.63939, 2812301620000.0, 2810995070000.0, 2813064040000.0, 145800000000.0, 0.0, 0.0,
        145800000000.0, 0.0, 0.7, 2967.99402, 418553461000.0, 430489610000.0, 475791967000.0, 1025201610000.0,
        462264974000.0, 559.381843, 3266.3949, 6311.26442, 9095.02741, 11940.8989, 15015.9579, 17039.0389,
        23646.8245, 26814.4639, 29807.4461,
    ]),
    (way_named("direct downlink"), [
        1905.20578, 15550.2346, 469353502000.0, 469353502000.0, 469353502000.0, 145800000000.0, 30088555900.0,
        0.0, 115711444000.0, 0.0, 4014.52153, 15325.5485, 111434480000.0, 69531306500.0, 138756576000.0,
        149631139000.0, 2546.20856, 2999.80271, 18550.0374, 18842.4655, 24282.7346, 24841.4137, 30069.2007,
        30669.7051,
    ]),
    (way_named("optical downlink"), [
        1447.76594, 20399.6131, 1662075410000.0, 801064815000.0, 2316279700000.0, 145800000000.0, 56771103800.0,
        0.0, 89028896200.0, 0.0, 9071.90451, 23686.3419, 149132656000.0, 149938517000.0, 484333110000.0,
        527421866000.0, 351249265000.0, 18467.5501, 18856.7024, 18500.476, 18891.4879, 24230.8134, 24834.6593,
        30021.3146, 30674.8783, 30915.6066, 31230.7983,
    ]),
    (view_of, [
        22708.2536, 2368.11627, 0.375, 0.700872025, 5.0, 3741.2278, 41116813.8, 44464923.1, 7.00901002e-05,
        0.000252565581, 2.24204467e-07, 7533.47237, 4860304750.0, 1444.38032, 2704.36443, 7291.19513,
        8551.05795, 13138.0093, 14397.7522, 18984.8228, 20244.4472, 24831.6357, 26091.143, 30678.448,
        31937.8394,
    ]),
    (swings_of, [
        355581961000.0, 469353502000.0, 1662075410000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 469353502000.0, 889176321000.0, 2812301620000.0, 469353502000.0, 2316279700000.0,
        2812301620000.0, 469353502000.0, 1924566660000.0, 2812301620000.0, 469353502000.0, 1397558620000.0,
        2114627440000.0, 469353502000.0, 1662075410000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 777249569000.0, 1662075410000.0, 2812301620000.0, 266196904000.0, 1662075410000.0,
        2879125280000.0, 469353502000.0, 1662075410000.0, 2745902180000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 111434480000.0, 1662075410000.0, 2812301620000.0, 734038667000.0, 1662075410000.0,
        2812301620000.0, 469353502000.0, 1662075410000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2628988140000.0, 437088513000.0, 1700902720000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        7012646190000.0, 469353502000.0, 1662075410000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 469353502000.0, 831037707000.0, 2812301620000.0, 469353502000.0, 3324150830000.0,
        2812301620000.0, 469353502000.0, 1512136900000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2697938500000.0, 329792426000.0, 982602012000.0, 2287151290000.0, 572776901000.0, 2177949130000.0,
        7164793500000.0, 469353502000.0, 1662075410000.0, 2812301620000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 234676751000.0, 1662075410000.0, 2812301620000.0, 938707004000.0, 1662075410000.0,
        2818785850000.0, 469353502000.0, 1662075410000.0, 2799333160000.0, 469353502000.0, 1662075410000.0,
        2812301620000.0, 469353502000.0, 1773945680000.0, 2812301620000.0, 469353502000.0, 1661269550000.0,
    ]),
    (sky_of, [
        0.4, 0.55, 0.85, 0.5, 0.611111111, 1.0, 0.941090301, 1.0, 0.9595, 1.0, 0.734208041, 0.000735424906,
        0.734208041, 1.0, 0.000658682757, 0.000735424906, 0.000658682757, 1.0,
    ]),
    (closings_of, [
        622080000.0, -0.166855804, 31982064.9, 155520000.0, 5.85374411, 63964129.8, 51840000.0, 10.6249567,
        110789123.0, 5.99186244, 1.69204213, 2.23013253, 0.0,
    ]),
])  # fmt: skip
def test_a_day_of_numbers_unlike_each_other(unlike_day, of, expected):
    assert of(unlike_day) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


def test_the_sides_of_each_assumption_of_a_day_are_written_with_their_units(unlike_day):
    assert {s.name: (s.low, s.high) for s in unlike_day.swings} == {
        "attitude of the satellite": ("nadir, 60 deg about zenith", "as it is"),
        "availability of the optical stations": ("half", "no clouds"),
        "correlation length of clouds": ("none", "1400 km"),
        "eclipse": ("terminal off in it", "as it is"),
        "elevation mask": ("0 deg", "twice"),
        "grazing height": ("0 m", "140 km"),
        "ground stations": ("without kiruna", "one more, opposite kiruna"),
        "instrument data rate": ("2.25 Mbit/s", "9 Mbit/s"),
        "local time of the node": ("6 h later", "as it is"),
        "margin demanded of the laser link": ("0 dB", "4.4 dB"),
        "optical data rate to ground": ("650 Mbit/s", "2.6 Gbit/s"),
        "optical ground stations": ("without kiruna", "as it is"),
        "orbit altitude": ("504 km", "756 km"),
        "pointing loss": ("0 dB", "3 dB more"),
        "radio data rate": ("130 Mbit/s", "520 Mbit/s"),
        "time of acquisition": ("half", "twice"),
        "time that weather holds": ("0.75 h", "3 h"),
    }


def test_each_contact_of_a_day_says_its_ends_and_its_station(unlike_day):
    assert [(c.begins, c.ends) for c in unlike_day.relay.contacts] == [
        ("Earth", "end of the relay's share"),
        ("Earth", "end of the relay's share"),
        ("Earth", "end of the relay's share"),
        ("Earth", "end of the relay's share"),
        ("Earth", "end of the relay's share"),
    ]
    assert [(c.begins, c.ends) for c in unlike_day.direct.contacts] == [
        ("elevation mask of perth", "elevation mask of perth"),
        ("elevation mask of kiruna", "elevation mask of kiruna"),
        ("elevation mask of kiruna", "elevation mask of kiruna"),
        ("elevation mask of kiruna", "elevation mask of kiruna"),
    ]
    assert [way.stations for way in unlike_day.ways] == [
        (),
        ("perth", "kiruna", "kiruna", "kiruna"),
        ("tromso", "kiruna", "tromso", "tromso", "tenerife"),
    ]


# ---------------------------------------------------------------------------------------- orbits as a mission has them
UNLIKE_ORBITS = {
    "orbit.epoch": "2026-03-21T06:30:00.5Z", "orbit.duration": "5 h", "orbit.earth": "sphere",
    "orbit.grazing_height": "37 km", "orbit.geo.longitude": "-37.5 deg",
    "orbit.leo": {
        "kind": "keplerian", "semi_major_axis": "7654.3 km", "eccentricity": 0.0123, "inclination": "65.4 deg",
        "node": "210 deg", "argument_of_perigee": "33 deg", "mean_anomaly": "127 deg", "gravity": "two-body",
        "limits": {
            "attitude": "sun", "boresight": [0.0, 0.6, -0.8], "field_of_regard": "71 deg", "slew_limit": "0.7 deg/s",
            "sun_exclusion": "13 deg", "in_eclipse": False,
        },
    },
    "orbit.geo.limits": {
        "attitude": "nadir", "boresight": [0.8, 0.0, 0.6], "field_of_regard": "9.5 deg", "slew_limit": "0.3 deg/s",
        "sun_exclusion": "4 deg", "in_eclipse": True,
    },
}  # fmt: skip
DEG = math.pi / 180.0


def pair_of(folder, *changes):
    m = day_file(folder, ALONE, *changes).mission
    return orbit.pair(m.orbit, m.terminals, folder)


def test_both_terminals_of_a_mission_are_as_their_own_tables_say(tmp_path):
    pair = pair_of(tmp_path, UNLIKE_ORBITS, {"terminals.leo_name": "Own", "terminals.geo_name": "Relay"})
    assert (pair.epoch.text, pair.span_s, pair.tail_s, pair.whole_s) == (
        "2026-03-21T06:30:00.5Z", (0.0, 18000.0), 86400.0, (0.0, 104400.0)
    )  # fmt: skip
    assert (pair.earth, pair.leo.name, pair.geo.name) == (orbit.Earth("sphere", 37e3), "Own", "Relay")
    own, limits = pair.leo.orbit, pair.leo.limits
    assert (own.name, own.epoch, own.j2, own.semi_major_axis_m, own.eccentricity) == (
        "Own", pair.epoch, False, 7654.3e3, 0.0123
    )  # fmt: skip
    angles = (own.inclination_rad, own.node_rad, own.argument_of_perigee_rad, own.mean_anomaly_rad)
    assert [each / DEG for each in angles] == pytest.approx([65.4, 210.0, 33.0, 127.0], rel=1e-12)
    for found, kind, boresight, in_eclipse, numbers in (
        (limits, "sun", (0.0, 0.6, -0.8), False, [71.0, 0.7, 13.0]),
        (pair.geo.limits, "nadir", (0.8, 0.0, 0.6), True, [9.5, 0.3, 4.0]),
    ):
        assert (found.attitude, tuple(found.boresight), found.in_eclipse) == (kind, boresight, in_eclipse)
        angles = (found.field_of_regard_rad, found.slew_limit_rad_s, found.sun_exclusion_rad)
        assert [each / DEG for each in angles] == pytest.approx(numbers, rel=1e-12)
    assert (pair.geo.orbit.name, pair.geo.orbit.longitude_rad / DEG) == ("Relay", pytest.approx(-37.5))


@pytest.mark.parametrize(("changes", "expected"), [
    ({"altitude": "700 km", "inclination": "51.6 deg", "node": "300 deg", "phase": "40 deg"},
     [7078.137, 0.0, 51.6, 300.0, 0.0, 40.0]),
    ({"altitude": "700 km", "inclination": "sun-synchronous", "node": "10 deg", "phase": "0 deg"},
     [7078.137, 0.0, 98.18798, 10.0, 0.0, 0.0]),
    ({"altitude": "500 km", "inclination": "97 deg", "local_time": "22.25 h", "phase": "7 deg"},
     [6878.137, 0.0, 97.0, 151.78439, 0.0, 7.0]),
])  # fmt: skip
def test_a_circular_orbit_has_its_phase_and_its_local_time(tmp_path, changes, expected):
    own = pair_of(tmp_path, {"orbit.leo": {"kind": "circular", "gravity": "j2", **changes}}).leo
    found, e = own.orbit, own.orbit.eccentricity
    angles = (found.inclination_rad, found.node_rad, found.argument_of_perigee_rad, found.mean_anomaly_rad)
    assert [found.semi_major_axis_m / 1e3, e, *(each / DEG for each in angles)] == pytest.approx(expected, rel=1e-5)
    assert found.j2 and own.limits == orbit.UNLIMITED


@pytest.mark.parametrize(("names", "expected"), [
    ({}, ("LEO", "GEO")),
    ({"terminals.leo_name": "T7", "terminals.geo_name": "T7"}, ("T7 (own)", "T7 (partner)")),
    ({"terminals.leo_name": "GEO"}, ("GEO (own)", "GEO (partner)")),
])  # fmt: skip
def test_terminals_of_one_name_are_told_apart(tmp_path, names, expected):
    pair = pair_of(tmp_path, names)
    assert (pair.leo.name, pair.geo.name) == (pair.leo.orbit.name, pair.geo.orbit.name) == expected


SETS = {"kind": "elements", "file": "a.tle"}
FAR = orbit.GeostationarySlot("far", orbit.Epoch(EPOCH), 1.0)


@pytest.mark.parametrize(("leo", "duration", "epoch", "tail_s"), [
    ({"day": 79.5 - 13.0}, "6 h", EPOCH, 64800.0),  # a quarter of the day before 14 days are over, from 13.25 on
    ({"day": 79.5 - 13.5}, "12 h", EPOCH, 0.0),
    ({"day": 79.5 + 13.0}, "6 h", EPOCH, 86400.0),
    ({"day": 79.5 - 12.0}, "30 h", EPOCH, 64800.0),
    ({"day": 79.5, "revolutions": 16.5, "eccentricity": 1}, "1 h", EPOCH, 86400.0),
    (None, "1 h", "2050-12-30T20:00:00Z", 86400.0),
    (None, "30 h", "2050-12-30T20:00:00Z", 0.0),  # the rotation of the Earth is known to the end of 2050
])  # fmt: skip
def test_orbits_hold_for_a_day_behind_the_span_or_as_long_as_they_do(tmp_path, leo, duration, epoch, tail_s):
    given = {"orbit.duration": duration, "orbit.epoch": epoch}
    if leo is not None:
        (tmp_path / "a.tle").write_text(element_set(**leo), encoding="utf-8")
        given["orbit.leo"] = SETS
    assert pair_of(tmp_path, given).tail_s == pytest.approx(tail_s, abs=0.01)


@pytest.mark.parametrize(
    ("end", "duration", "tail_s"), [(21600.0, "5 h", 3600.0), (21600.0, "6 h", 0.0), (2e5, "6 h", 86400.0)]
)
@pytest.mark.parametrize("which", ["leo", "geo"])
def test_an_ephemeris_holds_as_far_as_it_reaches_whichever_end_it_is(tmp_path, which, end, duration, tail_s):
    own = pair_of(tmp_path).leo.orbit if which == "leo" else FAR
    (tmp_path / "a.oem").write_text(ephemeris(own, np.arange(0.0, end + 1.0, 400.0)), encoding="utf-8")
    given = {f"orbit.{which}": {"kind": "ephemeris", "file": "a.oem"}, "orbit.duration": duration}
    assert pair_of(tmp_path, given).tail_s == tail_s
    with pytest.raises(orbit.OrbitError) as refused:
        pair_of(tmp_path, given | {"orbit.duration": "56 h"})
    words = f"orbit.{which}: {tmp_path / 'a.oem'}: the ephemeris of EXAMPLE 1 may be used from 2026-03-20T12:00"
    assert str(refused.value).startswith(words)


def test_an_ephemeris_that_begins_before_the_day_holds_no_longer_for_that(tmp_path):
    """It ends an hour behind the span, wherever it begins."""
    own = pair_of(tmp_path).leo.orbit
    (tmp_path / "a.oem").write_text(ephemeris(own, np.arange(-7200.0, 21601.0, 400.0)), encoding="utf-8")
    given = {"orbit.leo": {"kind": "ephemeris", "file": "a.oem"}, "orbit.duration": "5 h"}
    assert pair_of(tmp_path, given).tail_s == 3600.0


@pytest.mark.parametrize(("changes", "words"), [
    ({"orbit.epoch": "2060-02-28T00:00:00Z"}, "orbit.epoch: '2060-02-28T00:00:00Z' is outside 1973-01-02 to 2050"),
    ({"orbit.leo": SETS}, "orbit.leo: FOLDER/a.tle: there is no such file; check the path: a name in a mission is "
     "seen"),
    ({"orbit.geo": {"kind": "ephemeris", "file": "b.oem"}}, "orbit.geo: FOLDER/b.oem: there is no such file"),
    ({"orbit.leo": {**KEPLERIAN, "semi_major_axis": "6400 km"}}, "orbit.leo: "),
    ({"orbit.leo": {**SETS, "file": "two.tle"}}, "orbit.leo: FOLDER/two.tle, line 2: 2 element sets of different "
     "satellites, ONE (70001), TWO (70002); name one of them, by its number where names repeat"),
    ({"orbit.leo": {**SETS, "file": "two.tle", "object": "THREE"}}, "orbit.leo: FOLDER/two.tle: none of its 2 element "
     "sets is of 'THREE'; nearest are TWO, ONE: name one of them, or a catalogue number"),
])  # fmt: skip
def test_an_orbit_that_is_none_is_told_with_its_table(tmp_path, changes, words):
    two = element_set(name="ONE") + element_set(name="TWO", number="70002")
    (tmp_path / "two.tle").write_text(two, encoding="utf-8")
    with pytest.raises(orbit.OrbitError) as refused:
        pair_of(tmp_path, changes)
    assert str(refused.value).replace(str(tmp_path), "FOLDER").startswith(words)


@pytest.mark.parametrize(
    ("number", "object_name", "revolutions"), [("70002", "70002", 15.3), ("70002", "two", 15.3), ("70001", "ONE", 15.2)]
)
def test_of_a_file_of_two_satellites_the_named_one_flies(tmp_path, number, object_name, revolutions):
    two = element_set(name="ONE") + element_set(name="TWO", number="70002", revolutions=15.3)
    (tmp_path / "a.tle").write_text(two, encoding="utf-8")
    pair = pair_of(tmp_path, {"orbit.leo": {**SETS, "object": object_name}})
    found = pair.leo.orbit.elements
    assert (found.catalogue_number, found.mean_motion_rad_s * 43200.0 / math.pi) == (number, pytest.approx(revolutions))


# ---------------------------------------------------------------------------------------------- an ellipse that drifts
DRIFTING = orbit.KeplerOrbit("drifting", orbit.Epoch(EPOCH), 9.2e6, 0.26, 1.1, 0.7, 2.3, 4.1, True)


def test_the_flattening_turns_an_ellipse_as_the_perturbing_function_says():
    """Kaula's secular rates, with J2 = 1.0826e-3, R = 6378.137 km and mu = 398600.4418 km^3/s^2."""
    mean = math.sqrt(3.986004418e14 / 9.2e6**3)
    shape, cosine = 1.0 - 0.26**2, math.cos(1.1)
    part = 0.75 * 1.08262668e-3 * mean * (6378137.0 / 9.2e6) ** 2 / shape**2
    motion = mean + part * math.sqrt(shape) * (3.0 * cosine**2 - 1.0)
    expected = (-2.0 * part * cosine, part * (5.0 * cosine**2 - 1.0), motion)
    assert DRIFTING.secular_rates_rad_s() == pytest.approx(expected, rel=1e-5)
    assert replace(DRIFTING, j2=False).secular_rates_rad_s() == (0.0, 0.0, pytest.approx(mean, rel=1e-9))


@pytest.mark.parametrize("j2", [True, False])
def test_the_velocity_on_an_ellipse_is_the_rate_of_its_position(j2):
    own, time_s = replace(DRIFTING, j2=j2), np.array([-9e4, 0.0, 1234.5, 5e5])
    slope = (own.states(time_s + 0.5).position_m - own.states(time_s - 0.5).position_m) / 1.0
    np.testing.assert_allclose(own.states(time_s).velocity_m_s, slope, atol=2e-3)
    node, perigee, motion = (rate * 5e5 for rate in own.secular_rates_rad_s())
    moved = replace(own, node_rad=0.7 + node, argument_of_perigee_rad=2.3 + perigee, mean_anomaly_rad=4.1 + motion)
    for of, other in zip(moved.states(np.array([0.0])), own.states(np.array([5e5])), strict=True):
        np.testing.assert_allclose(of, other, rtol=1e-9)
    radius = np.linalg.norm(own.states(np.array([0.0])).position_m)
    anomaly = 4.1
    for _ in range(100):
        anomaly = 4.1 + 0.26 * math.sin(anomaly)
    assert radius == pytest.approx(9.2e6 * (1.0 - 0.26 * math.cos(anomaly)), rel=1e-9)


@pytest.mark.parametrize(("contacts", "gap_s"), [
    ([(0.0, 40.0), (70.0, 100.0)], 30.0),  # the one that ends with the span leaves no gap in it
    ([(0.0, 40.0), (70.0, 99.5)], 50.5),
    ([(45.0, 50.0), (80.0, 160.0)], 45.0),
    ([(120.0, 130.0)], 120.0),
])  # fmt: skip
def test_a_gap_that_begins_with_the_end_of_the_span_is_none_of_it(contacts, gap_s):
    pair = SimpleNamespace(span_s=(0.0, 100.0), whole_s=(0.0, 150.0))
    given = [SimpleNamespace(start_s=start, end_s=end) for start, end in contacts]
    assert geometry.longest_gap_s(given, pair) == gap_s


@pytest.mark.parametrize(("end_s", "ends"), [(99.0, "Earth"), (100.0, "Earth"), (100.5, "end of the span")])
def test_a_contact_up_to_the_last_moment_of_a_span_keeps_what_ends_it(end_s, ends):
    highest = {"highest_rad": 0.5, "highest_s": 70.0}
    for whole in (orbit.Contact(60.0, end_s, "range", "Earth"), orbit.Pass(60.0, end_s, "range", "Earth", **highest)):
        cut = geometry.cut_at(whole, 100.0)
        assert cut == replace(whole, end_s=min(end_s, 100.0), ends=ends)
        assert (cut is whole) == (end_s <= 100.0)


def test_a_pass_that_rises_while_another_station_is_served_begins_when_that_is_free(tmp_path):
    """Of four passes the second goes on behind the first, the third ends before it, the fourth begins at its end."""
    m = day_file(
        tmp_path, ALONE, {"operations.downlink.setup": "20 s", "operations.downlink.data_rate": "8 Mbit/s"}
    ).mission
    pair = SimpleNamespace(span_s=(0.0, 1000.0), whole_s=(0.0, 1500.0))
    seen = SimpleNamespace(pair=pair, duration_s=1000.0)
    spans = {"b": (250.0, 500.0), "a": (100.0, 400.0), "c": (300.0, 390.0), "d": (500.0, 515.0), "e": (990.0, 1100.0)}
    passes = tuple((orbit.Pass(*span, "mask", f"mask of {n}", 0.5, span[0]), n) for n, span in spans.items())
    way = flow.direct(m.operations, seen, passes)
    assert [(c.start_s, c.end_s, c.begins, c.ends) for c in way.contacts] == [
        (100.0, 400.0, "mask", "mask of a"),
        (400.0, 500.0, "station free", "mask of b"),
        (500.0, 515.0, "mask", "mask of d"),
        (990.0, 1000.0, "mask", "end of the span"),
    ]
    assert way.stations == ("a", "b", "d", "e")
    assert way.carried_bit.tolist() == pytest.approx([8e6 * 280.0, 8e6 * 80.0, 0.0, 0.0])
    assert (way.contact_s, way.gap_s) == (425.0, 475.0)
    assert way.capacity_spread_bit == (way.capacity_bit, way.capacity_bit) == pytest.approx((8e6 * 360.0,) * 2)


def test_a_way_of_two_runs_has_the_mean_of_both_and_the_store_of_the_first():
    def run(lost, stored, latency_s, volume):
        latency = operations.Latency(np.array([latency_s]), np.array([latency_s]), np.array([volume]), stored)
        return SimpleNamespace(
            generated_bit=np.array([0.0, 50.0, 100.0]), lost_bit=np.array([0.0, 1.0, lost]),
            stored_bit=np.array([0.0, 40.0, stored]), latency=latency,
        )  # fmt: skip

    runs = [run(10.0, 30.0, 5.0, 60.0), run(4.0, 6.0, 8.0, 90.0)]
    carried = np.array([[1.0, 5.0, 0.0], [3.0, 0.0, 7.0]])
    contacts = tuple(orbit.Contact(10.0 * k, 10.0 * k + 5.0, "a", "b") for k in range(3))
    way = flow.way_of("x", contacts, ("p", "q", "r"), 15.0, 7.5, carried, runs, 0.5)
    assert way.carried_bit.tolist() == [2.0, 2.5, 3.5]
    assert (way.capacity_bit, way.capacity_spread_bit) == (8.0, (6.0, 10.0))
    assert (way.generated_bit, way.lost_bit, way.on_board_bit, way.arrived_bit) == (100.0, 7.0, 18.0, 75.0)
    assert (way.contacts, way.stations, way.contact_s, way.gap_s) == (contacts, ("p", "q", "r"), 15.0, 7.5)
    assert way.history is runs[0] and way.failed_contacts == 0.5
    # of 186 bit kept 60 came within 5 s, 90 more within 8 s, and 36 never: 99 % did not
    assert (way.latency.quantile(60.0 / 186.0), way.median_s, way.slow_s) == (5.0, 8.0, math.inf)
    assert way.latency.cdf([4.9, 5.0, 7.9, 8.0]).tolist() == pytest.approx([0.0, 60 / 186, 60 / 186, 150 / 186])
    none = flow.way_of("x", (), (), 0.0, 100.0, np.zeros((2, 0)), runs)
    assert (none.carried_bit.tolist(), none.capacity_bit, none.capacity_spread_bit) == ([], 0.0, (0.0, 0.0))
    assert none.failed_contacts == 0.0


def spanned(*contacts, slot=None, low=None):
    """The view of a span from 0 to 1000 s, with contacts of start, end, and what begins and ends them."""
    sides = {"leo": low or SimpleNamespace(), "geo": slot or SimpleNamespace()}
    ends = {side: SimpleNamespace(orbit=own, name=side) for side, own in sides.items()}
    pair = SimpleNamespace(**ends, span_s=(0.0, 1000.0), whole_s=(0.0, 1500.0))
    found = tuple(orbit.Contact(*each) for each in contacts)
    seen = tuple(
        geometry.Encounter(each, None, 1.0 + k, *(10.0 * m + (7.0, 3.0, 9.0, 1.0, 5.0)[k] for m in range(1, 7)))
        for k, each in enumerate(found)
    )
    return geometry.View(pair, seen, found, (), np.zeros((0, 2)), None)


def test_the_median_contact_is_that_of_those_that_no_end_of_the_span_cuts():
    cut = [(0.0, 200.0, "start of the span", "Earth"), (810.0, 1000.0, "Earth", "end of the span")]
    whole = [(210.0, 280.0, "Earth", "range"), (300.0, 330.0, "range and Earth", "Earth"), (400.0, 455.0, "Sun", "Sun")]
    v = spanned(cut[0], *whole, cut[1])
    assert (v.median_s, v.contact_s, v.visible_share, v.duration_s) == (55.0, 545.0, 0.545, 1000.0)
    assert (v.days, v.gap_s) == (1000.0 / 86400.0, 355.0)
    assert v.rises == 4  # the one that the Sun begins is no rise
    assert spanned(cut[0], *whole).median_s == spanned(*whole, cut[1]).median_s == 55.0
    assert spanned(*whole[:2]).median_s == 50.0
    for given in ([], cut, cut[:1], cut[1:], [(0.0, 1000.0, "start of the span", "end of the span")]):
        assert math.isnan(spanned(*given).median_s)
    largest = [
        v.largest(name)
        for name in (
            "range_least_m", "range_most_m", "point_ahead_most_rad", "rate_most_rad_s", "acceleration_most_rad_s2",
            "range_rate_most_m_s", "doppler_most_hz",
        )
    ]  # fmt: skip
    assert largest == [5.0, 19.0, 29.0, 39.0, 49.0, 59.0, 69.0]


def test_the_other_end_of_a_link_is_called_by_which_of_the_two_stands_on_the_ground():
    site = orbit.GroundSite(orbit.Station("north", 1.1, 0.3, 100.0, 0.1), orbit.Epoch(EPOCH))
    assert spanned().partner == "relay"
    assert spanned(slot=site).partner == "station"
    assert spanned(low=site).partner == "satellite"
    risen = [(5.0, 9.0, "elevation mask of north", "Earth"), (20.0, 30.0, "Earth", "elevation mask of north")]
    assert spanned(*risen, slot=site).rises == spanned(*risen, low=site).rises == 1


def test_each_run_draws_the_locks_of_its_own_and_gives_up_are_counted_within_the_span(tmp_path):
    """Of the four parts that are granted two begin within the span; acquisition takes twice what was simulated."""
    o = day_file(tmp_path, ALONE).mission.operations.with_value("runs", 5).with_value("relay_share", 0.5)
    contacts = tuple(
        orbit.Contact(*span, "Earth", "Sun") for span in ((100.0, 300.0), (900.0, 1100.0), (1200.0, 1400.0))
    )
    seen = SimpleNamespace(
        pair=SimpleNamespace(span_s=(0.0, 1000.0), whole_s=(0.0, 1500.0)), duration_s=1000.0, partner="station",
        contacts=contacts, range_m=(np.ones_like,) * 3,
    )  # fmt: skip
    time_s, locked = np.array([10.0, 20.0, 30.0]), np.array([True, False, True])
    found = SimpleNamespace(simulated=SimpleNamespace(time_s=time_s, locked=locked))
    rates = operations.RateTable((operations.Step(8e6, math.inf),))
    way = flow.relay(o, seen, rates, 0.25, found, 2.0)
    drawn = [np.random.Generator(np.random.Philox(key=[o.seed, run])).integers(0, 3, 4) for run in range(5)]
    volumes = [
        [
            8e6 * 0.75 * max(whole - 2.0 * time_s[k], 0.0) * locked[k]
            for whole, k in zip((100.0, 50.0), row, strict=False)
        ]
        for row in drawn
    ]
    assert len({tuple(row) for row in volumes}) > 1
    assert way.carried_bit.tolist() == pytest.approx(np.mean(volumes, axis=0).tolist())
    totals = np.sum(volumes, axis=1)
    assert way.capacity_spread_bit == pytest.approx((totals.min(), totals.max()))
    assert way.failed_contacts == pytest.approx(np.mean([np.sum(~locked[row[:2]]) for row in drawn]))
    assert [(c.start_s, c.end_s, c.begins, c.ends) for c in way.contacts] == [
        (100.0, 200.0, "Earth", "end of the station's share"),
        (900.0, 950.0, "Earth", "end of the station's share"),
    ]
    assert (way.name, way.contact_s, way.gap_s, way.stations) == ("station", 150.0, 700.0, ())
    dark = flow.relay(o, seen, None, 0.25, found, 2.0)
    assert (dark.carried_bit.tolist(), dark.capacity_spread_bit) == ([0.0, 0.0], (0.0, 0.0))
    assert (dark.contacts, dark.failed_contacts) == (way.contacts, way.failed_contacts)
    assert dark.on_board_bit + dark.lost_bit == dark.generated_bit == o.instrument_rate_bit_s * 1000.0
    at_once = flow.relay(o, seen, rates, 1.0, None, 2.0)  # out all the time, and locked at once
    assert (at_once.carried_bit.tolist(), at_once.failed_contacts) == ([0.0, 0.0], 0.0)
