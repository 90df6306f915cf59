"""The optical downlink of a day: the network's rule second by second, the radio's volumes under a clear sky, words."""

import math
import re

import numpy as np
import pytest

from day_files import ALONE, KIRUNA, day_file
from microrad import link, orbit
from microrad.link import study as link_study
from microrad.orbit import day as day_study
from microrad.orbit import operations
from microrad.orbit.day import PointingLoss, assumptions, flow, network
from microrad.orbit.day import weather as skies
from microrad.report import registry
from microrad.report.day.data import day_csv, day_data
from microrad.report.day.figures import day_figures
from microrad.report.day.page import day_text
from microrad.report.day.tables import sky_table
from microrad.report.day.words import sentences
from microrad.report.quantities import duration
from microrad.report.results import arrays, tolerances
from optical_files import SITES, TENERIFE_SITE, optical

SETUP = {"operations.downlink.setup": "30 s", "operations.downlink.delay": "1 s"}
RADIO_OF_THREE = {
    "operations.downlink.stations": SITES,
    "operations.downlink.data_rate": "100 Mbit/s",
    **SETUP,
}
NO_RADIO = {"operations.downlink": None}


def of(folder, *changes):
    """The table of operations and the terminals of a mission."""
    m = day_file(folder, ALONE, *changes).mission
    return m.operations, orbit.pair(m.orbit, m.terminals, folder)


def way_of(folder, *changes, rates=None):
    o, pair = of(folder, *changes)
    return network.optical(o, pair, network.optical_passes(o.optical, pair), rates)


# ------------------------------------------------------------------------------------------------- second by second
def used_seconds(o, pair, run):
    """The seconds in which data flow by each station, and how many uses there are: a machine that looks each second."""
    down, time_s = o.optical, np.arange(0.0, pair.whole_s[1]) + 0.5
    spells = skies.clear_spells(network.weather_of(down, pair.epoch), pair.whole_s, o.seed, run)
    usable = np.zeros((len(down.stations), time_s.size), dtype=int)
    for k, station in enumerate(orbit.stations(down)):
        found = orbit.passes(pair.leo.orbit, station, pair.epoch, pair.whole_s)
        for windows in (spells[k], [(c.start_s, c.end_s) for c in found]):
            inside = np.zeros(time_s.size, dtype=int)
            for begin, end in windows:
                inside[math.ceil(begin - 0.5) : math.ceil(end - 0.5)] = 1
            usable[k] += inside
    usable = usable == 2
    current, since, taken, flows = None, np.zeros(len(usable), dtype=int), 0, np.zeros(usable.shape, dtype=bool)
    uses = 0
    for second in np.flatnonzero(usable.any(axis=0)):
        for k in range(len(usable)):
            if usable[k, second] and not usable[k, second - 1]:
                since[k] = second
        if current is None or not usable[current, second] or not usable[current, second - 1]:
            could = [k for k in range(len(usable)) if usable[k, second]]
            current = min((since[k], np.argmin(usable[k, second:]), k) for k in could)[2]
            taken, uses = second, uses + 1
        flows[current, second] = second - taken >= down.setup_s
    return flows, time_s, uses


@pytest.mark.promise("day-49")
@pytest.mark.parametrize("weather", ["2 h", "90 s"])
def test_the_network_is_used_as_a_machine_that_looks_each_second_uses_it(tmp_path, weather):
    o, pair = of(tmp_path, optical({"kiruna": 0.6, "tromso": 0.6, "tenerife": 0.5}, weather=weather))
    o = o.with_value("runs", 3)
    way = network.optical(o, pair, network.optical_passes(o.optical, pair))
    rate, inside, found, several = o.optical.data_rate_bit_s, pair.span_s[1], [], 0
    for run in range(3):
        flows, time_s, uses = used_seconds(o, pair, run)
        found.append(rate * np.sum(flows[:, time_s < inside]))
        several = max(several, uses)
    assert several > 8
    assert way.capacity_bit == pytest.approx(np.mean(found), abs=several * rate)
    assert way.capacity_spread_bit == pytest.approx((min(found), max(found)), abs=several * rate)
    assert min(found) < 0.95 * max(found)


def test_who_rises_first_is_kept_and_the_next_takes_over():
    spans = [(10.0, 20.0, 0), (12.0, 30.0, 1), (5.0, 8.0, 2), (13.0, 25.0, 3), (29.0, 31.0, 4)]
    kept = [(5.0, 8.0, 2), (10.0, 20.0, 0), (20.0, 30.0, 1), (30.0, 31.0, 4)]
    assert flow.one_at_a_time(spans) == kept == flow.one_at_a_time(reversed(spans))


@pytest.mark.promise("day-49", "day-50")
# ------------------------------------------------------------------------------------------------- beside the radio
def test_under_a_clear_sky_the_network_carries_what_the_radio_of_the_same_stations_does(tmp_path):
    o, pair = of(tmp_path, RADIO_OF_THREE, optical(1.0))
    radio = flow.direct(o, _seen(pair), flow.station_passes(o.downlink, pair))
    light = network.optical(o, pair, network.optical_passes(o.optical, pair))
    assert light.capacity_bit == pytest.approx(radio.capacity_bit, rel=1e-9)
    assert light.capacity_spread_bit == pytest.approx((radio.capacity_bit,) * 2, rel=1e-9)
    assert (light.contact_s, light.gap_s) == pytest.approx((radio.contact_s, radio.gap_s), rel=1e-9)
    for name in ("median_s", "slow_s", "lost_bit", "on_board_bit"):
        assert getattr(light, name) == pytest.approx(getattr(radio, name), rel=1e-9), name
    assert radio.capacity_bit > 1e11 and len(set(light.stations)) == 3
    half = network.optical(o, pair, network.optical_passes(o.optical, pair), _steps((50e6, math.inf)))
    assert half.capacity_bit == pytest.approx(0.5 * radio.capacity_bit, rel=1e-9)


def _seen(pair):
    from microrad.orbit.day.geometry import View

    return View(pair, (), (), (), np.zeros((0, 2)), None)


def _steps(*steps):
    return operations.RateTable(tuple(operations.Step(*step) for step in steps))


def test_under_clouds_for_ever_the_network_carries_nothing(tmp_path):
    way = way_of(tmp_path, optical(0.0))
    assert (way.capacity_bit, way.contact_s, way.contacts, way.arrived_bit) == (0.0, 0.0, (), 0.0)
    assert way.gap_s == 86400.0 and math.isinf(way.median_s)
    assert way_of(tmp_path, optical(0.5)).capacity_bit > 0.0


@pytest.mark.promise("day-47")
def test_a_months_clouds_end_with_it(tmp_path):
    """The shipped day goes on to 12 h UTC of the next one: from midnight on there are no clouds."""
    turn = {"orbit.epoch": "2026-03-31T12:00:00Z", "orbit.leo.local_time": "10.5 h"}
    by_month = [0.0] * 3 + [1.0] + [0.0] * 8
    o, pair = of(tmp_path, turn, optical(by_month))
    way = network.optical(o, pair, network.optical_passes(o.optical, pair))
    clear = way_of(tmp_path, turn, optical(1.0))
    later = [bit for c, bit in zip(clear.contacts, clear.carried_bit, strict=True) if c.start_s > 43200.0]
    assert min(c.end_s for c in way.contacts) > 43200.0
    assert way.capacity_bit == pytest.approx(sum(later), rel=1e-9) and way.capacity_bit < 0.8 * clear.capacity_bit
    assert network.sky(o, pair).availability == pytest.approx((0.5,) * 3, rel=1e-12)


def test_rates_fall_with_the_range_to_the_station(tmp_path):
    o, pair = of(tmp_path, optical({"tenerife": 1.0}))
    passes = network.optical_passes(o.optical, pair)
    table = _steps((1e9, 700e3), (1e8, 1200e3))
    way = network.optical(o, pair, passes, table)
    rate, time_s = o.optical.data_rate_bit_s, np.arange(0.0, 86400.0) + 0.5
    (station,) = orbit.stations(o.optical)
    place = pair.leo.orbit.states(time_s).position_m - station.position(pair.epoch, time_s).position_m
    range_m, flows = np.linalg.norm(place, axis=0), np.zeros(time_s.size, dtype=bool)
    for each, _, _ in passes:
        flows |= (time_s >= each.start_s + o.optical.setup_s) & (time_s < each.end_s)
    expected = np.sum(np.where(range_m <= 700e3, 1e9, np.where(range_m <= 1200e3, 1e8, 0.0))[flows])
    assert way.capacity_bit == pytest.approx(expected, abs=4e9 * len(passes))
    assert expected > 20e9 and rate == 1e8


@pytest.mark.promise("day-48")
# --------------------------------------------------------------------------------------------------------------- draws
def test_weather_changes_no_acquisition_and_a_seed_repeats(tmp_path):
    plain = link_study.run_link_study(day_file(tmp_path, ALONE))
    clouded = link_study.run_link_study(day_file(tmp_path, ALONE, optical(0.5)))
    relays = [day_study.relay(each, day_study.given_loss(each)) for each in (plain, clouded)]
    assert relays[0].capacity_spread_bit == relays[1].capacity_spread_bit
    first, again = (day_study.optical_alone(clouded.file) for _ in range(2))
    assert np.array_equal(first.carried_bit, again.carried_bit)
    other = way_of(tmp_path, optical(0.5), {"operations.seed": 2})
    assert not np.array_equal(first.carried_bit, other.carried_bit)
    assert day_study.optical_alone(plain.file) is None


def test_the_order_of_stations_does_not_matter(tmp_path):
    shares = {"kiruna": 0.5, "tromso": 0.6, "tenerife": 0.4}
    first = way_of(tmp_path, optical(shares))
    turned = way_of(tmp_path, optical(dict(reversed(shares.items()))))
    assert turned.capacity_bit == pytest.approx(first.capacity_bit, rel=1e-12)
    assert turned.stations == first.stations


@pytest.mark.promise("day-46", "day-50")
def test_every_run_has_a_sky_of_its_own(tmp_path):
    o, pair = of(tmp_path, optical(0.5))
    passes = network.optical_passes(o.optical, pair)
    several = network.optical(o, pair, passes)
    alone = [network.optical(o.with_value("runs", n), pair, passes).capacity_bit * n for n in range(1, 5)]
    assert len(set(np.round(np.diff([0.0, *alone])))) > 1
    assert several.capacity_spread_bit[0] < several.capacity_bit < several.capacity_spread_bit[1]


@pytest.mark.promise("day-51")
def test_the_sky_over_the_stations(tmp_path):
    o, pair = of(tmp_path, optical({"kiruna": 0.5, "tromso": 0.6, "tenerife": 0.4}, weather="1 min"))
    sky = network.sky(o, pair)
    assert sky.names == ("kiruna", "tromso", "tenerife") and sky.availability == (0.5, 0.6, 0.4)
    assert sky.drawn == pytest.approx((0.5, 0.6, 0.4), abs=0.02) and sky.drawn != (0.5, 0.6, 0.4)
    assert sky.any_independent == pytest.approx(1.0 - 0.5 * 0.4 * 0.6, rel=1e-12)
    assert sky.any_drawn == pytest.approx(sky.any_clear, abs=0.02)
    assert sky.any_clear < sky.any_independent - 0.05  # kiruna and tromso lie 220 km apart
    apart = skies.distances_m(network.weather_of(o.optical, pair.epoch).sites)[0, 1]
    assert sky.correlation[0, 1] == pytest.approx(math.exp(-apart / 500e3), rel=1e-12)
    assert apart == pytest.approx(217e3, abs=5e3)


# ------------------------------------------------------------------------------------------------------------- service
def test_a_part_of_a_contact_carries_what_it_has_there():
    whole = operations.Service(np.array([0.0, 10.0, 20.0, 30.0]), np.array([1.0, 2.0, 3.0]), 0.5)
    for start, end, expected in ((5.0, 25.0, 0.5 * (5 + 20 + 15)), (10.0, 20.0, 10.0), (12.0, 13.0, 1.0)):
        part = whole.within(start, end)
        assert (part.start_s, part.end_s) == (start, end)
        assert part.capacity_bit == pytest.approx(expected, rel=1e-12)
    assert whole.within(-1.0, 31.0) is whole
    assert whole.within(-1.0, 10.0).edges_s.tolist() == [0.0, 10.0]


# -------------------------------------------------------------------------------------------------- the whole day, told
ASKED = (
    "availability of the optical stations",
    "optical ground stations",
    "optical data rate to ground",
    "correlation length of clouds",
    "time that weather holds",
    "pointing loss",
    "orbit altitude",
)
"""The assumptions that are looked at here."""


def whole_day(folder, *changes, asked=ASKED):
    """A day with some of its assumptions changed, and without the tornados of its links."""
    every = assumptions._changes
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assumptions, "_changes", lambda *args: [each for each in every(*args) if each[0] in asked])
        patch.setattr(link_study, "tornados", lambda *args: ())
        return day_study.run_day_study(link_study.run_link_study(day_file(folder, ALONE, *changes)))


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """A day with relay, radio and an optical network under clouds."""
    clouds = {"kiruna": 0.4, "tenerife": 0.7}
    return whole_day(tmp_path_factory.mktemp("day"), optical(clouds, data_rate="10 Gbit/s"))


@pytest.fixture(scope="module")
def without_radio(tmp_path_factory):
    return whole_day(tmp_path_factory.mktemp("day"), NO_RADIO, optical({"tenerife": 0.7}), asked=ASKED[:3])


def swing_of(day, name):
    return next(s for s in day.swings if s.name == name)


def test_the_day_has_three_ways_under_one_instrument(day, without_radio):
    assert [way.name for way in day.ways] == ["relay", "direct downlink", "optical downlink"]
    assert [way.name for way in without_radio.ways] == ["relay", "optical downlink"]
    made = {way.generated_bit for way in day.ways}
    assert max(made) == pytest.approx(min(made), rel=1e-12)
    assert day.optical_ratio == pytest.approx(day.relay.capacity_bit / day.optical.capacity_bit)
    assert math.isnan(without_radio.ratio) and without_radio.optical_ratio > 1.0


def test_each_assumption_of_the_network_is_a_day_of_its_own(day, tmp_path):
    sky = swing_of(day, "availability of the optical stations")
    clear = way_of(tmp_path, optical({"kiruna": 1.0, "tenerife": 1.0}, data_rate="10 Gbit/s"))
    half = way_of(tmp_path, optical({"kiruna": 0.2, "tenerife": 0.35}, data_rate="10 Gbit/s"))
    assert (sky.at_low.optical_bit, sky.at_high.optical_bit) == pytest.approx((half.capacity_bit, clear.capacity_bit))
    assert sky.here.optical_bit == day.optical.capacity_bit
    fewer = swing_of(day, "optical ground stations")
    alone = way_of(tmp_path, optical({"tenerife": 0.7}, data_rate="10 Gbit/s"))
    assert fewer.low == "without kiruna" and fewer.at_low.optical_bit == pytest.approx(alone.capacity_bit, rel=0.5)
    rate = swing_of(day, "optical data rate to ground")
    assert (rate.of_optical, rate.of_relay) == (pytest.approx(4.0), 1.0)
    length = swing_of(day, "correlation length of clouds")
    assert (length.low, length.high) == ("none", "1000 km")
    assert swing_of(day, "time that weather holds").high == "4 h"
    assert swing_of(day, "pointing loss").of_optical == 1.0 and swing_of(day, "orbit altitude").of_optical > 1.0
    assert swing_of(day, "availability of the optical stations").factor == sky.of_optical > 1.5


def test_the_words_name_the_network_its_sky_and_what_matters(day, without_radio):
    said = " ".join(sentences(day))
    assert "Optical ground stations (kiruna, tenerife) are in use for" in said
    assert "by the weather drawn; the relay could carry" in said
    assert "At least one of the 2 optical stations is clear for 82.0 % of the time" in said
    assert f"by the optical downlink half arrives within {duration(day.optical.median_s)}" in said
    named = said.partition("What matters most to the optical downlink's volume: ")[2].partition(". ")[0]
    assert "availability of the optical stations (half: " in named and named.count(";") == 2
    alone = " ".join(sentences(without_radio))
    assert "The sky over tenerife is clear for 70.0 % of the time" in alone
    assert "The ground (" not in alone and "directly" not in alone


def test_tables_csv_and_data_have_the_third_way(day, without_radio):
    text = day_text(day, 160)
    for words in ("Relay and downlinks", "optical downlink", "tenerife, optical", "Clear sky over the stations"):
        assert words in text
    assert sky_table(day).rows[-2][0] == "any of them"
    data = day_data(day)
    assert data["optical"]["could_carry_bit"] == day.optical.capacity_bit
    assert [each["name"] for each in data["sky"]["sites"]] == ["kiruna", "tenerife"]
    assert data["sky"]["any_clear"] == day.sky.any_clear
    names = [name for name, _ in registry.flattened({"day": data}) if ".optical" in name or ".sky" in name]
    assert len(names) > 30 and registry.unregistered(names) == []
    places = {re.sub(r"\.(\d+)", r"[\1]", path) for _, path, _ in registry.placed({"day": data})}
    assert [place for place in places if tolerances.stated(place) is None] == []
    assert {tolerances.stated_for_figure(figure.name) for figure in day_figures(day)} & {None} == set()
    lines = day_csv(day).splitlines()
    assert sum(line.startswith("optical downlink,") for line in lines) == len(day.optical.contacts) > 0
    assert {figure.name for figure in day_figures(day)} >= {"assumptions", "optical-assumptions", "world-map"}
    assert "direct downlink" not in day_text(without_radio, 160)
    groups = arrays._day(day, None, None)
    assert {"day/optical_downlink", "day/optical_passes", "day/direct_downlink"} <= set(groups)
    assert "optical_low" in repr(groups["day/assumptions"])


def test_a_day_without_a_network_says_nothing_of_one(tmp_path):
    quiet = whole_day(tmp_path, {"orbit.duration": "6 h"})
    assert (quiet.optical, quiet.sky) == (None, None) and math.isnan(quiet.optical_ratio)
    assert "optical" not in repr(day_data(quiet)) and "ptical" not in " ".join(sentences(quiet))
    assert sky_table(quiet) is None and [way.name for way in quiet.ways] == ["relay", "direct downlink"]


def test_the_stations_of_a_network_may_stand_where_the_radios_do(tmp_path):
    assert KIRUNA.startswith("operations.downlink")
    both = day_file(
        tmp_path, ALONE, optical({"tenerife": 0.5}), {"operations.downlink.stations": {"tenerife": TENERIFE_SITE}}
    )
    o = both.mission.operations
    assert orbit.stations(o.optical) == orbit.stations(o.downlink)


def test_clouds_of_a_network_that_know_nothing_of_each_other_are_tied_by_500_km(tmp_path):
    for length, low, high in (("0 km", None, "500 km"), ("300 km", "none", "600 km")):
        m = day_file(tmp_path, optical(0.5, correlation_length=length)).mission
        own = assumptions.Case(m.operations, m.orbit, link.of(m), PointingLoss(1.0, 0.01, "stated"))
        sides = next(s for name, *s in assumptions._changes(own, None) if name == "correlation length of clouds")
        assert [None if side is None else side[0] for side in sides] == [low, high]
        assert sides[1][1].operations.optical.correlation_length_m == pytest.approx(float(high.split()[0]) * 1e3)


# --------------------------------------------------------------------------------------- sites all unlike each other
UNLIKE_SITES = {
    "orbit.epoch": "2026-03-31T12:00:00Z", "orbit.duration": "30 h", "operations.runs": 3, "operations.seed": 7,
    "operations.store": "6 GB", "operations.instrument_rate": "2.5 Mbit/s",
}  # fmt: skip
UNLIKE_SKY = {"kiruna": [0.41, 0.5, 0.62] + [0.3 + 0.04 * k for k in range(9)], "tromso": 0.37, "tenerife": 0.83}
UNLIKE_NETWORK = {"data_rate": "622.08 Mbit/s", "setup": "47 s", "delay": "2.5 s", "weather": "50 min"}


@pytest.fixture(scope="module")
def unlike(tmp_path_factory):
    """Way and sky of a network whose numbers are all unlike each other, over the end of a month."""
    folder = tmp_path_factory.mktemp("unlike")
    o, pair = of(folder, UNLIKE_SITES, optical(UNLIKE_SKY, correlation_length="1300 km", **UNLIKE_NETWORK))
    return network.optical(o, pair, network.optical_passes(o.optical, pair)), network.sky(o, pair)


def history_of(way):
    ends = (getattr(way.history, key)[-1] for key in ("generated_bit", "lost_bit", "delivered_bit", "time_s"))
    return [*ends, way.history.stored_bit.max()]


@pytest.mark.parametrize(("found", "expected"), [
    (lambda way, sky: [c.start_s for c in way.contacts],
     [272.867643, 29946.2773, 29971.1086, 35567.6424, 35590.0418, 41227.4272, 41970.3507, 52435.1209, 69051.0148,
      74696.0038, 85499.8096]),
    (lambda way, sky: [c.end_s - c.start_s for c in way.contacts],
     [302.991055, 441.025903, 452.677159, 553.981634, 558.051409, 526.980624, 437.012704, 393.406764, 550.277575,
      539.201171, 397.748764]),
    (lambda way, sky: way.carried_bit,
     [159246916000.0, 81705211300.0, 84121215700.0, 185035466000.0, 20962696000.0, 99528782100.0, 161746068000.0,
      143661813000.0, 104359638000.0, 194379749000.0, 218193791000.0]),
    (lambda way, sky: [way.contact_s, way.gap_s, way.capacity_bit, *way.capacity_spread_bit],
     [2742.20343, 36824.769, 1452941350000.0, 1045142090000.0, 1932414290000.0]),
    (lambda way, sky: [way.generated_bit, way.lost_bit, way.on_board_bit, way.arrived_bit, way.failed_contacts],
     [270000000000.0, 50966574800.0, 0.0, 219033425000.0, 0.0]),
    (lambda way, sky: [way.median_s, way.slow_s], [15276.3693, 38013.1702]),
    (lambda way, sky: history_of(way),
     [270000000000.0, 46853063200.0, 223146937000.0, 194400.0, 48000000000.0]),
    (lambda way, sky: [*sky.availability, *sky.drawn, sky.any_drawn, sky.any_independent],
     [0.428, 0.37, 0.83, 0.42962963, 0.314814815, 0.851851852, 0.916666667, 0.9387388]),
    (lambda way, sky: sky.correlation.ravel(),
     [1.0, 0.846737445, 0.0205471414, 0.846737445, 1.0, 0.0193633075, 0.0205471414, 0.0193633075, 1.0]),
])  # fmt: skip
def test_a_network_of_sites_unlike_each_other(unlike, found, expected):
    assert list(found(*unlike)) == pytest.approx(expected, rel=1e-6, abs=0.0)


def test_the_contacts_of_a_network_name_their_stations(unlike):
    way, sky = unlike
    assert (way.name, sky.names) == ("optical downlink", ("kiruna", "tromso", "tenerife"))
    assert [c.begins for c in way.contacts] == [f"elevation mask of {name}" for name in way.stations]
    north = "tromso kiruna tromso kiruna kiruna"
    assert " ".join(way.stations) == f"tenerife {north} tenerife tromso kiruna kiruna tenerife"


def test_the_sides_of_stations_unlike_each_other_are_those_of_each(tmp_path):
    places = {"south": (-33.25, -70.5, "50 deg"), "flat": (10.0, 20.0, "0 deg"), "north": (60.0, 30.0, "3 deg")}
    radios = {
        name: {"latitude": f"{lat} deg", "longitude": f"{lon} deg", "height": "300 m", "mask": mask}
        for name, (lat, lon, mask) in places.items()
    }
    months = [0.05 * k for k in range(1, 13)]
    changes = {"operations.downlink.stations": radios, "orbit.leo.local_time": "20.25 h", "orbit.leo.limits": None}
    m = day_file(tmp_path, ALONE, changes, optical({"tenerife": 0.9, "kiruna": months, "tromso": 0.0})).mission
    own = assumptions.Case(m.operations, m.orbit, link.of(m), PointingLoss(1.0, 0.01, "stated"))
    sides = {name: each for name, *each in assumptions._changes(own, None)}

    def stations_of(name, side, table):
        return getattr(sides[name][side][1].operations, table).stations

    assert [text for text, _ in sides["ground stations"]] == ["without south", "one more, opposite south"]
    assert list(stations_of("ground stations", 0, "downlink")) == ["flat", "north"]
    added = stations_of("ground stations", 1, "downlink")
    opposite = added["opposite south"]
    assert list(added) == ["south", "flat", "north", "opposite south"]
    assert [math.degrees(opposite.latitude_rad), math.degrees(opposite.longitude_rad)] == pytest.approx([33.25, 109.5])
    assert (opposite.height_m, opposite.mask_rad) == (added["south"].height_m, added["south"].mask_rad)
    for side, masks in ((0, [0.0, 0.0, 0.0]), (1, [89.0, 0.0, 6.0])):
        found = [math.degrees(each.mask_rad) for each in stations_of("elevation mask", side, "downlink").values()]
        assert found == pytest.approx(masks, abs=1e-9)  # degrees and back
    half, clear = (
        {
            name: each.availability
            for name, each in stations_of("availability of the optical stations", side, "optical").items()
        }
        for side in (0, 1)
    )
    assert half == {"tenerife": (0.45,), "kiruna": pytest.approx([0.5 * each for each in months]), "tromso": (0.0,)}
    assert clear == {"tenerife": (1.0,), "kiruna": (1.0,) * 12, "tromso": (1.0,)}
    assert list(stations_of("optical ground stations", 0, "optical")) == ["kiruna", "tromso"]
    assert sides["optical ground stations"][0][0] == "without tenerife" and sides["optical ground stations"][1] is None
    (text, later), none = sides["local time of the node"]
    assert (text, none, later.orbits.leo.local_time_s) == ("6 h later", None, pytest.approx(2.25 * 3600.0))
    (text, held), none = sides["attitude of the satellite"]
    limits = held.orbits.leo.limits
    assert (text, none, limits.attitude, limits.boresight) == (
        "nadir, 60 deg about zenith",
        None,
        "nadir",
        (0.0, 0.0, -1.0),
    )
    assert math.degrees(limits.field_of_regard_rad) == pytest.approx(60.0)
    assert (math.degrees(limits.slew_limit_rad_s), limits.sun_exclusion_rad, limits.in_eclipse) == (
        pytest.approx(10.0),
        0.0,
        True,
    )


@pytest.mark.parametrize(("at_low", "here", "at_high", "factor"), [
    ((6.0, 2.0), (5.0, 0.0), (4.0, 0.0), math.inf),  # a ratio of 3, and twice of an infinite one
    ((6.0, 0.0), (5.0, 0.0), (4.0, 0.0), 1.5),
    ((6.0, 3.0), (5.0, 2.0), (8.0, 2.0), 2.0),
    ((6.0, math.nan), (3.0, math.nan), (9.0, math.nan), 3.0),
    ((0.0, 2.0), (5.0, 2.0), (4.0, 2.0), math.inf),
])  # fmt: skip
def test_how_far_an_assumption_moves_the_comparison_is_told_by_all_three_of_its_cases(at_low, here, at_high, factor):
    cases = [
        assumptions.Numbers(*volumes, 1.0, 1.0, optical_bit)
        for volumes, optical_bit in zip((at_low, at_high, here), (7.0, 8.0, 2.0), strict=True)
    ]
    swing = assumptions.Swing("x", "low", "high", *cases)
    assert (swing.of_relay, swing.of_optical) == (pytest.approx(factor), 4.0)
    assert swing.factor == pytest.approx(max(factor, 4.0))
    without = assumptions.Swing(
        "x", "low", "high", *[assumptions.Numbers(*each, 1.0, 1.0) for each in (at_low, at_high, here)]
    )
    assert (without.of_optical, without.factor) == (1.0, pytest.approx(factor))
