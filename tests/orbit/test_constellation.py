"""Many satellites and a few relays: the pattern they fly in, who sees whom, who is served, and the plan of it."""

import csv
import io
import itertools
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from day_files import BY_FILE, KEPLERIAN, day_file, element_set
from link_files import received_with
from microrad import orbit
from microrad.link import study as link_study
from microrad.orbit import constellation, files, from_mission, operations
from microrad.orbit import day as day_study
from microrad.orbit.constellation import opportunities
from microrad.orbit.propagation import mean_elements
from microrad.report import registry
from microrad.report.day.constellation import (
    partners_table,
    plan_data,
    plan_sentences,
    plan_text,
    satellites_table,
)
from optical_files import SITES, shared_stations

SIX_HOURS = {"orbit.duration": "6 h"}
TWO_TERMINALS = {"constellation.terminals": 2}
FILED = {"constellation": BY_FILE, "orbit.leo": {"kind": "elements", "file": "a.tle", "object": "70001"}}


@pytest.fixture(scope="module", autouse=True)
def _links_alone():
    """Nothing here looks at the links' tornados, nor at how their partners find each other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(link_study, "tornados", lambda *args: ())
        patch.setattr(link_study, "find_partner", lambda *args: None)
        yield


def made(folder, *changes):
    """The terminals of a mission's constellation and what they share."""
    file = day_file(folder, *changes)
    m = file.mission
    pair = orbit.pair(m.orbit, m.terminals, folder)
    c = m.constellation
    return pair, tuple(orbit.satellites(c, m.orbit, pair.epoch, folder)), orbit.relays(c, m.orbit, pair.epoch)


def planned(folder, *changes):
    links = link_study.run_link_study(day_file(folder, *changes))
    return constellation.run_constellation(links.file, day_study.given_loss(links)), links


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """The plan of the shipped mission over six hours."""
    return planned(tmp_path_factory.mktemp("plan"), SIX_HOURS)[0]


@pytest.fixture(scope="module")
def two_terminals(tmp_path_factory):
    return planned(tmp_path_factory.mktemp("plan"), SIX_HOURS, TWO_TERMINALS)[0]


# ------------------------------------------------------------------------------------------------------------- pattern
def turned(angle_rad):
    """An angle within half a turn of 0."""
    return math.remainder(angle_rad, 2.0 * math.pi)


@pytest.mark.promise("day-31")
@pytest.mark.parametrize(("pattern", "round_deg"), [("delta", 360.0), ("star", 180.0)])
@pytest.mark.parametrize(("satellites", "planes", "phasing"), [(12, 3, 1), (15, 5, 3), (4, 1, 0), (6, 6, 5)])
def test_walkers_pattern(tmp_path, pattern, round_deg, satellites, planes, phasing):
    given = {"pattern": pattern, "satellites": satellites, "planes": planes, "phasing": phasing}
    pair, own, _ = made(tmp_path, {f"constellation.{key}": value for key, value in given.items()})
    base, each = pair.leo.orbit, satellites // planes
    assert [s.name for s in own] == [f"{p}-{k}" for p in range(1, planes + 1) for k in range(1, each + 1)]
    assert {s.limits for s in own} == {pair.leo.limits}
    for s in own:
        plane, place = (int(part) - 1 for part in s.name.split("-"))
        one = s.orbit
        assert (one.semi_major_axis_m, one.inclination_rad) == (base.semi_major_axis_m, base.inclination_rad)
        node = math.radians(round_deg / planes) * plane
        phase = math.radians(360.0 / each) * place + math.radians(360.0 / satellites) * phasing * plane
        assert turned(one.node_rad - base.node_rad - node) == pytest.approx(0.0, abs=1e-12)
        assert turned(one.mean_anomaly_rad - base.mean_anomaly_rad - phase) == pytest.approx(0.0, abs=1e-12)
    first = own[0].orbit.states(np.array([0.0, 1000.0])).position_m
    np.testing.assert_allclose(first, base.states(np.array([0.0, 1000.0])).position_m, atol=1e-6)


def test_the_phase_of_a_delta_goes_round_to_itself(tmp_path):
    """One plane further than the last is the first again, p nodes on: what phasing in units of 360 deg / t is for."""
    _, own, _ = made(tmp_path, {"constellation.phasing": 2})
    angles = {
        (round(math.degrees(turned(s.orbit.node_rad - own[0].orbit.node_rad)), 6) % 360.0,
         round(math.degrees(turned(s.orbit.mean_anomaly_rad - own[0].orbit.mean_anomaly_rad)), 6) % 90.0)
        for s in own
    }  # fmt: skip
    assert angles == {(0.0, 0.0), (120.0, 60.0), (240.0, 30.0)}


@pytest.mark.promise("day-31")
def test_relays_stand_at_their_longitudes_with_the_limits_of_the_partner(tmp_path):
    pair, _, relays = made(tmp_path)
    assert [r.name for r in relays] == ["east", "west"]
    assert [math.degrees(r.orbit.longitude_rad) for r in relays] == pytest.approx([143.0, -37.0])
    assert {r.limits for r in relays} == {pair.geo.limits}


# ------------------------------------------------------------------------------------------------------- opportunities
def as_rows(found):
    return list(
        zip(found.satellite.tolist(), found.relay.tolist(), found.start_s.tolist(), found.end_s.tolist(), strict=True)
    )


def test_every_opportunity_is_a_contact_of_its_pair(tmp_path):
    pair, own, relays = made(tmp_path, SIX_HOURS)
    rows = as_rows(opportunities(own, relays, pair.earth, pair.epoch, pair.span_s))
    assert [row[2] for row in rows] == sorted(row[2] for row in rows)
    for (k, satellite), (j, relay) in itertools.product(enumerate(own), enumerate(relays)):
        alone = orbit.contacts(satellite, relay, pair.earth, pair.epoch, pair.span_s)
        mine = [(start, end) for s, r, start, end in rows if (s, r) == (k, j)]
        np.testing.assert_allclose(np.array(mine), np.array([(c.start_s, c.end_s) for c in alone]), rtol=0, atol=1e-5)


@pytest.mark.promise("day-33")
def test_opportunities_of_a_plan_are_the_seconds_in_which_the_link_closes(tmp_path, plan):
    pair, own, relays = made(tmp_path, SIX_HOURS)
    rows, time_s = as_rows(plan.opportunities), np.arange(0.0, 21600.0) + 0.5
    for (k, satellite), (j, relay) in itertools.product(enumerate(own[:4]), enumerate(relays)):
        first, second = (t.orbit.states(time_s).position_m for t in (satellite, relay))
        within = np.linalg.norm(second - first, axis=0) < 42_002e3
        seen = np.zeros(time_s.size, dtype=bool)
        for c in orbit.contacts(satellite, relay, pair.earth, pair.epoch, pair.span_s):
            seen |= (c.start_s < time_s) & (time_s < c.end_s)
        edge = np.flatnonzero(np.diff(np.concatenate(([0], (within & seen).astype(int), [0]))))
        mine = sorted(row[2:] for row in rows if row[:2] == (k, j))
        np.testing.assert_allclose(np.ravel(mine), edge, rtol=0, atol=1.5)


def test_a_link_that_closes_nowhere_has_no_opportunity(tmp_path):
    found, _ = planned(tmp_path, SIX_HOURS, {"operations.margin": "60 dB"})
    assert (as_rows(found.opportunities), found.planned, found.volume_bit) == ([], (), 0)


def test_twice_the_satellites_have_the_opportunities_of_both_halves(tmp_path):
    big = {"constellation.satellites": 16, "constellation.planes": 4, **SIX_HOURS}
    pair, own, relays = made(tmp_path, big)
    given = pair.earth, pair.epoch, pair.span_s
    whole = as_rows(opportunities(own, relays, *given))
    halves = []
    for first in (0, 8):
        halves += [(s + first, *row) for s, *row in as_rows(opportunities(own[first : first + 8], relays, *given))]
    assert whole == sorted(halves, key=lambda row: (row[2], row[0], row[1]))
    assert {row[0] for row in whole} == set(range(16))


def test_progress_counts_satellites_to_the_last(tmp_path):
    pair, own, relays = made(tmp_path, {"orbit.duration": "1 h"}, {"constellation.satellites": 18})
    told = []
    opportunities(own, relays, pair.earth, pair.epoch, pair.span_s, on_progress=told.append)
    assert told == list(range(1, 19))


def test_no_satellite_has_no_opportunity(tmp_path):
    pair, own, relays = made(tmp_path)
    for sets in (((), relays), (own[:1], ())):
        assert opportunities(*sets, pair.earth, pair.epoch, pair.span_s).start_s.shape == (0,)


# ------------------------------------------------------------------------------------------------------------ sessions
@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-32")
@pytest.mark.parametrize("terminals", [1, 2])
def test_a_terminal_serves_one_satellite_at_a_time_and_a_satellite_has_one(plan, two_terminals, terminals):
    p = plan if terminals == 1 else two_terminals
    s = p.sessions
    assert p.terminals == terminals
    assert s.start_s.size == len(p.planned) > 20
    assert set(s.terminal.tolist()) == set(range(terminals))
    for key in (list(zip(s.relay, s.terminal, strict=True)), list(s.satellite)):
        for one in set(key):
            mine = sorted((s.start_s[k], s.end_s[k]) for k, other in enumerate(key) if other == one)
            assert all(second[0] >= first[1] for first, second in itertools.pairwise(mine))
    for k in range(s.start_s.size):
        within = [
            (start, end)
            for satellite, relay, start, end in as_rows(p.opportunities)
            if (satellite, relay) == (s.satellite[k], s.relay[k]) and start <= s.start_s[k] and s.end_s[k] <= end
        ]
        assert len(within) == 1
        assert s.end_s[k] - s.start_s[k] >= 180.0 - 1e-6
        assert s.locked_s[k] == s.start_s[k] + 60.0


@pytest.mark.promise("gallery-22")
def test_more_terminals_serve_more(plan, two_terminals):
    assert two_terminals.volume_bit > 1.1 * plan.volume_bit
    assert np.all((plan.use > 0.3) & (plan.use <= 1.0))
    for p in (plan, two_terminals):
        busy = [
            sum(e - b for r, b, e in zip(p.sessions.relay, p.sessions.start_s, p.sessions.end_s, strict=True) if r == k)
            for k in range(2)
        ]
        assert p.use == pytest.approx(np.array(busy) / (p.terminals * 21600.0))


@pytest.mark.promise("day-32", "day-33")
def test_a_planned_session_has_the_rate_that_its_largest_range_leaves(tmp_path, plan):
    pair, own, relays = made(tmp_path, SIX_HOURS)
    by_name = {t.name: t for t in (*own, *relays)}
    for one in plan.planned:
        time_s = np.linspace(one.locked_s, one.end_s, 400)
        first, second = (by_name[n].orbit.states(time_s).position_m for n in (one.satellite, one.relay))
        range_m = np.linalg.norm(second - first, axis=0)
        assert one.range_min_m == pytest.approx(np.min(range_m), abs=40e3)
        assert one.range_max_m == pytest.approx(np.max(range_m), abs=40e3)
        assert one.range_max_m < 42_003e3
        assert one.rate_bit_s == 300e6
        assert one.volume_bit == pytest.approx(one.rate_bit_s * (one.end_s - one.locked_s))
    assert max(one.range_max_m for one in plan.planned) > 42_000e3
    assert plan.volume_bit == pytest.approx(float(np.sum(plan.by_satellite.volume_bit)))
    assert plan.volume_bit == pytest.approx(float(np.sum(plan.by_relay.volume_bit)))
    assert pair.span_s == plan.span_s


@pytest.mark.promise("day-33")
def test_a_session_over_several_rates_has_the_one_that_closes_throughout(tmp_path):
    rates = {"operations.rates": ["200 Mbit/s", "300 Mbit/s", "350 Mbit/s"]}
    plan, _ = planned(tmp_path, SIX_HOURS, rates)
    reach = {rate: 42_002e3 * math.sqrt(300e6 / rate) for rate in (350e6, 300e6, 200e6)}
    for one in plan.planned:
        closing = [rate for rate, furthest in reach.items() if one.range_max_m < furthest - 1e3]
        assert one.rate_bit_s == max(closing, default=200e6) or abs(one.range_max_m - reach[one.rate_bit_s]) < 2e3
    assert {one.rate_bit_s for one in plan.planned} == set(reach)


def test_an_outage_takes_its_share_of_the_volume(tmp_path, plan):
    links = link_study.run_link_study(day_file(tmp_path, SIX_HOURS))
    loss = day_study.given_loss(links)
    worse = constellation.run_constellation(links.file, day_study.PointingLoss(loss.loss_db, 0.2, "test"))
    assert worse.volume_bit == pytest.approx(0.8 * plan.volume_bit)


# --------------------------------------------------------------------------------------------------- a file of elements
def with_elements(folder, text):
    (folder / "a.tle").write_text(text, encoding="utf-8")
    return planned(folder, SIX_HOURS, FILED)[0]


@pytest.mark.promise("day-31")
def test_a_file_of_elements_is_a_constellation(tmp_path):
    text = "".join(element_set(name=f"EXAMPLE {k}", number=f"7000{k}", inclination=40.0 + 10 * k) for k in (1, 2, 3))
    plan = with_elements(tmp_path, text)
    assert plan.satellites == ("EXAMPLE 1", "EXAMPLE 2", "EXAMPLE 3")
    assert {one.satellite for one in plan.planned} == set(plan.satellites)
    sets = files.read_elements(tmp_path / "a.tle")
    pair, own, relays = made(tmp_path, SIX_HOURS, FILED)
    for elements, satellite in zip(sets, own, strict=True):
        alone = mean_elements.Sgp4Orbit(elements, pair.epoch)
        time_s = np.array([0.0, 7000.0])
        np.testing.assert_array_equal(satellite.orbit.states(time_s).position_m, alone.states(time_s).position_m)
        assert satellite.limits == pair.leo.limits
    assert [r.name for r in relays] == ["east"]


def test_satellites_of_one_name_are_told_apart_by_their_number(tmp_path):
    text = element_set(name="DEBRIS") + element_set(name="DEBRIS", number="70002", inclination=60.0)
    text += element_set(name="OTHER", number="70003", inclination=70.0)
    assert with_elements(tmp_path, text).satellites == ("DEBRIS (70001)", "DEBRIS (70002)", "OTHER")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (element_set() + element_set(day=78.0), r"a\.tle: several element sets are of EXAMPLE 1 \(70001\); leave one"),
        (element_set() + element_set(name="OLD", number="70002", day=20.0), r"\(OLD\): the elements are expired"),
        (element_set() + element_set(name="east", number="70002"), 'two terminals are called "east"'),
    ],
)
def test_a_file_of_elements_that_is_none_is_refused(tmp_path, text, words):
    with pytest.raises(orbit.OrbitError, match=words):
        with_elements(tmp_path, text)


# ------------------------------------------------------------------------------------------------------------ in words
@pytest.mark.promise("day-34")
def test_the_csv_has_every_session(plan):
    rows = list(csv.DictReader(io.StringIO(operations.csv_text(plan.planned, plan.epoch.utc))))
    assert len(rows) == len(plan.planned)
    for row, one in zip(rows, plan.planned, strict=True):
        assert (row["satellite"], row["relay"]) == (one.satellite, one.relay)
        assert float(row["start (s)"]) == one.start_s
        assert float(row["volume (bit)"]) == one.volume_bit
        assert row["end (UTC)"] == plan.epoch.utc(one.end_s)


@pytest.mark.promise("day-35")
def test_the_contact_plan_has_every_session_with_data_in_whole_seconds(plan):
    lines = plan.contact_plan().splitlines()
    contacts = [line.split() for line in lines if line.startswith("a contact")]
    ranges = [line.split() for line in lines if line.startswith("a range")]
    assert len(contacts) == len(ranges) == len(plan.planned)
    assert {int(words[-1]) for words in contacts} == {300_000_000 // 8}
    spans = sorted((int(words[2].removeprefix("+")), int(words[3].removeprefix("+"))) for words in contacts)
    assert spans == sorted((math.ceil(one.locked_s), math.floor(one.end_s)) for one in plan.planned)
    assert {int(words[-1]) for words in ranges} == {1}  # 0.14 s of light, in whole seconds


def test_the_words_add_up(plan):
    first, second, third = plan_sentences(plan)
    seen = float(np.sum(plan.opportunities.end_s - plan.opportunities.start_s)) / 3600.0
    assert f"12 satellites share 2 relays of one terminal each: in 6 h {len(plan.opportunities.start_s)} conta" in first
    assert f"{seen:.0f} h in all" in first
    assert f"{len(plan.planned)} sessions" in first
    assert all(f"{name} {100 * use:.0f} %" in second for name, use in zip(plan.relays, plan.use, strict=True))
    assert third.endswith(f" a pointing loss of {plan.loss.loss_db:.2f} dB ({plan.loss.source}).")
    data = plan_data(plan)
    assert sum(s["sessions"] for s in data["satellites"]) == data["sessions"] == len(plan.planned)
    assert sum(s["volume_bit"] for s in data["satellites"]) == pytest.approx(data["volume_bit"])
    assert len(satellites_table(plan).rows) == 12


def test_a_long_table_is_cut_and_says_so(tmp_path):
    plan, _ = planned(tmp_path, {"orbit.duration": "20 min", "constellation.satellites": 45})
    text = plan_text(plan, 120)
    assert "The first 40 of 45 satellites; --csv has every session." in text
    assert " 3-10 " in text.replace("\n", " ")
    assert "3-11" not in text


def test_the_tables_that_a_plan_needs(tmp_path):
    loss = day_study.PointingLoss(1.0, 0.0, "test")
    links = link_study.run_link_study(day_file(tmp_path, {"constellation": None}))
    with pytest.raises(operations.OperationsError, match=r"no table \[constellation\]"):
        constellation.run_constellation(links.file, loss)


# ------------------------------------------------------------------------------------------------------ ground stations
THREE_SITES = ("kiruna", "tromso", "tenerife")
STATIONS = shared_stations(*THREE_SITES)


@pytest.fixture(scope="module")
def with_stations(tmp_path_factory):
    return planned(tmp_path_factory.mktemp("plan"), SIX_HOURS, STATIONS)[0]


def grounds_of(folder, *changes):
    file = day_file(folder, SIX_HOURS, STATIONS, *changes)
    pair, own, relays = made(folder, SIX_HOURS, STATIONS, *changes)
    return pair, own, relays, constellation.grounds(file.mission.constellation)


def test_contacts_with_stations_are_their_passes_one_by_one(tmp_path):
    pair, own, relays, ground = grounds_of(tmp_path)
    whole = (0.0, 43200.0)
    rows = as_rows(opportunities(own, relays, pair.earth, pair.epoch, whole, stations=ground))
    count = 0
    for (k, satellite), (j, each) in itertools.product(enumerate(own), enumerate(ground, len(relays))):
        alone = [(p.start_s, p.end_s) for p in orbit.passes(satellite.orbit, each.station, pair.epoch, whole)]
        mine = [(start, end) for s, r, start, end in rows if (s, r) == (k, j)]
        np.testing.assert_allclose(np.reshape(mine, (-1, 2)), np.reshape(alone, (-1, 2)), rtol=0, atol=1e-6)
        count += len(mine)
    assert count > 100
    relays_alone = as_rows(opportunities(own, relays, pair.earth, pair.epoch, whole))
    assert relays_alone == [row for row in rows if row[1] < len(relays)]


def test_stations_alone_and_none_at_all(tmp_path):
    pair, own, _, ground = grounds_of(tmp_path)
    alone = as_rows(opportunities(own[:2], (), pair.earth, pair.epoch, pair.span_s, stations=ground))
    assert {row[1] for row in alone} <= {0, 1, 2} and alone
    assert as_rows(opportunities(own[:2], (), pair.earth, pair.epoch, pair.span_s)) == []


def test_a_station_is_in_reach_up_to_the_range_of_its_lowest_rate(tmp_path):
    pair, own, relays, ground = grounds_of(tmp_path)
    rates = operations.RateTable((operations.Step(1e9, 800e3), operations.Step(1e8, 1200e3)))
    near = [replace(ground[0], rates=rates), *ground[1:]]
    rows = as_rows(opportunities(own, relays, pair.earth, pair.epoch, pair.span_s, stations=near))
    time_s, station = np.arange(0.0, 21600.0) + 0.5, ground[0].station
    place, up = station.position(pair.epoch, time_s).position_m, station.vertical(pair.epoch, time_s)
    total = 0
    for k, satellite in enumerate(own):
        line = satellite.orbit.states(time_s).position_m - place
        range_m = np.linalg.norm(line, axis=0)
        high = np.sum(line * up, axis=0) > range_m * math.sin(station.mask_rad)
        seen = np.zeros(time_s.size, dtype=bool)
        mine = [(start, end) for s, r, start, end in rows if (s, r) == (k, len(relays))]
        for start, end in mine:
            seen |= (start <= time_s) & (time_s <= end)
        assert np.sum(seen != (high & (range_m <= 1200e3))) <= 2 * len(mine)
        total += int(np.sum(high) - np.sum(seen))
    assert total > 500  # seconds above the mask and too far


def test_each_partner_has_terminals_of_its_own():
    zeros = np.zeros(6, dtype=np.int64)
    views = operations.Opportunities(np.arange(6), zeros.copy(), np.zeros(6), np.full(6, 100.0))
    views.relay[3:] = 1
    rules = operations.Rules(1.0, 50.0, 100.0)
    found = operations.schedule(views, 6, 2, [1, 2], rules, 0.0)
    assert sorted(zip(found.relay.tolist(), found.terminal.tolist(), strict=True)) == [(0, 0), (1, 0), (1, 1)]
    one, each = (operations.schedule(views, 6, 2, count, rules, 0.0) for count in (2, [2, 2]))
    for name in ("satellite", "relay", "terminal", "start_s", "end_s"):
        assert np.array_equal(getattr(one, name), getattr(each, name)), name
    assert one.relay.size == 4


def test_relays_and_stations_share_the_satellites(with_stations, plan):
    p = with_stations
    assert (p.relays, p.stations, p.station_terminals) == (("east", "west"), THREE_SITES, (1, 1, 1))
    assert p.by_relay.sessions.size == 2 and p.by_station.sessions.size == 3
    assert np.sum(p.by_relay.sessions) + np.sum(p.by_station.sessions) == len(p.planned)
    assert np.sum(p.by_relay.volume_bit) + np.sum(p.by_station.volume_bit) == pytest.approx(p.volume_bit, rel=1e-12)
    assert np.all(p.by_station.sessions > 3) and p.volume_bit > plan.volume_bit
    assert (plan.stations, plan.station_use.size) == ((), 0)
    for index, count in ((p.sessions.satellite, len(p.satellites)), (p.sessions.relay * 10 + p.sessions.terminal, 60)):
        for one in range(count):
            mine = np.flatnonzero(index == one)
            begins, ends = p.sessions.start_s[mine], p.sessions.end_s[mine]
            assert np.all(begins[1:] >= ends[:-1] - 1e-9)
    seconds = sum(s.end_s - s.start_s for s in p.planned if s.relay == "tenerife")
    assert p.station_use[2] == pytest.approx(seconds / 21600.0, rel=1e-12)


def test_a_station_has_its_rate_and_its_volume_is_the_expected_one(tmp_path, with_stations):
    at = [s for s in with_stations.planned if s.relay == "tenerife"]
    for one in at:
        assert one.volume_bit == pytest.approx(1e9 * (one.end_s - one.locked_s), rel=1e-12)
        assert 500e3 < one.range_min_m <= one.range_max_m < 2000e3
    cloudy = planned(tmp_path, SIX_HOURS, shared_stations(*THREE_SITES, availability=[0.0] * 2 + [0.4] + [0.0] * 9))[0]
    assert [s.start_s for s in cloudy.planned] == [s.start_s for s in with_stations.planned]
    np.testing.assert_allclose(cloudy.by_station.volume_bit, 0.4 * with_stations.by_station.volume_bit, rtol=1e-12)
    np.testing.assert_array_equal(cloudy.by_relay.volume_bit, with_stations.by_relay.volume_bit)
    assert np.all(cloudy.by_station.volume_bit > 0.0)


def test_plan_table_data_and_contact_plan_name_the_stations(with_stations, plan):
    said = " ".join(plan_sentences(with_stations))
    count = sum(s.relay in THREE_SITES for s in with_stations.planned)
    assert "12 satellites share 2 relays of one terminal each and 3 ground stations of 3 terminals in all: in" in said
    assert f"{count} of the sessions are with ground stations" in said
    assert "ground station" not in " ".join(plan_sentences(plan))
    rows = partners_table(with_stations).rows
    assert [row[0] for row in rows] == ["east", "west", *THREE_SITES] and partners_table(plan) is None
    assert [row[2] for row in rows[2:]] == [str(n) for n in with_stations.by_station.sessions]
    data = plan_data(with_stations)
    assert [each["name"] for each in data["stations"]] == list(THREE_SITES) and "stations" not in plan_data(plan)
    assert sum(each["volume_bit"] for each in data["stations"]) == pytest.approx(
        float(np.sum(with_stations.by_station.volume_bit))
    )
    names = [name for name, _ in registry.flattened({"constellation": data})]
    assert registry.unregistered(names) == []
    text = with_stations.contact_plan().splitlines()
    assert [line for line in text if line.startswith("# node 1") and "kiruna" in line] == ['# node 15 is "kiruna"']
    assert any(re.fullmatch(r"a contact \+\d+ \+\d+ \d+ 17 125000000", line) for line in text)


def test_a_satellite_and_a_station_of_one_name_are_refused(tmp_path):
    clash = {"constellation.stations": {"1-1": STATIONS["constellation.stations"]["kiruna"]}}
    with pytest.raises(orbit.OrbitError, match='a satellite and a station are called "1-1"; give each its own name'):
        planned(tmp_path, SIX_HOURS, clash)


@pytest.mark.parametrize(
    ("satellites", "relays", "terminals", "sites", "at_sites", "said"),
    [
        (1, 1, 1, 0, (), "1 satellite shares 1 relay of one terminal: in"),
        (2, 1, 3, 0, (), "2 satellites share 1 relay of 3 terminals: in"),
        (1, 2, 2, 1, (1,), "1 satellite shares 2 relays of 2 terminals each and 1 ground station of one terminal: in"),
        (1, 1, 1, 1, (2,), "1 satellite shares 1 relay of one terminal and 1 ground station of 2 terminals: in"),
        (1, 1, 1, 2, (1, 1), "one terminal and 2 ground stations of 2 terminals in all: in"),
        (1, 1, 1, 2, (1, 0), "one terminal and 2 ground stations of one terminal in all: in"),
    ],
)
def test_the_words_count_one_and_several(plan, satellites, relays, terminals, sites, at_sites, said):
    names = [f"n{k}" for k in range(9)]
    few = with_other(
        plan,
        satellites=names[:satellites],
        relays=names[:relays],
        use=np.full(relays, 0.5),
        terminals=terminals,
        stations=names[:sites],
        station_terminals=at_sites,
        station_use=np.full(sites, 0.25),
        by_station=SimpleNamespace(sessions=np.zeros(sites), volume_bit=np.zeros(sites)),
    )
    assert said in plan_sentences(few)[0]
    assert ("n0 25 %" in " ".join(plan_sentences(few))) is (sites > 0)


@pytest.mark.parametrize(("count", "cut"), [(40, False), (41, True)])
def test_as_many_satellites_as_a_table_has_are_not_cut(plan, count, cut):
    one = {name: np.repeat(getattr(plan.by_satellite, name)[:1], count) for name in OF_A_SATELLITE}
    many = with_other(plan, satellites=[f"s{k}" for k in range(count)], by_satellite=SimpleNamespace(**one))
    assert ("satellites; --csv has every session." in plan_text(many, 120)) is cut


OF_A_SATELLITE = ("sessions", "served_s", "longest_gap_s", "volume_bit", "busy_s")
SAID_OF_A_PLAN = (
    "satellites", "relays", "use", "terminals", "stations", "opportunities", "by_satellite", "span_s", "planned",
    "volume_bit", "loss"
)  # fmt: skip


def with_other(plan, **changes):
    """What the words say of a plan, some of it changed."""
    return SimpleNamespace(**{name: getattr(plan, name) for name in SAID_OF_A_PLAN} | changes)


def test_a_receiver_that_takes_no_rate_of_the_link_leaves_the_stations(tmp_path):
    """The relays are never in reach then; what a ground station takes is its own."""
    fast = {"operations.rates": ["3.3 Gbit/s"], **received_with("homodyne bpsk"), "orbit.duration": "3 h"}
    file = day_file(tmp_path, fast, shared_stations("kiruna"))
    found = constellation.run_constellation(file, day_study.PointingLoss(1.0, 0.01, "stated"))
    assert found.planned and {one.relay for one in found.planned} == {"kiruna"}
    assert {one.rate_bit_s for one in found.planned} == {1e9}


@pytest.mark.parametrize(
    ("changes", "has"),
    [({}, True), (FILED, True), ({"constellation": BY_FILE}, True), ({"orbit.leo": KEPLERIAN}, True)],
)
def test_a_constellation_repeats_elements_or_has_a_file(tmp_path, changes, has):
    m = day_file(tmp_path, changes).mission
    assert from_mission.repeats(m.constellation, m.orbit) == has
    slot = m.orbit.model_copy(update={"leo": m.orbit.geo})
    assert from_mission.repeats(m.constellation, slot) == (m.constellation.pattern == "file")


# ------------------------------------------------------------------------------- all numbers unlike each other
UNLIKE_PLAN = {
    "orbit.duration": "3 h",
    "orbit.leo.altitude": "710 km",
    "orbit.leo.phase": "25 deg",
    "orbit.grazing_height": "60 km",
    "operations.margin": "1.3 dB",
    "operations.rates": ["77.76 Mbit/s", "311.04 Mbit/s"],
    "constellation.satellites": 6,
    "constellation.planes": 2,
    "constellation.phasing": 1,
    "constellation.terminals": 2,
    "constellation.overhead": "45 s",
    "constellation.session": "7 min",
    "constellation.shortest": "130 s",
    "constellation.relays": {"east": {"longitude": "131 deg"}, "west": {"longitude": "-52 deg"}},
    "constellation.stations": {
        "kiruna": {**SITES["kiruna"], "data_rate": "1.3 Gbit/s", "terminals": 1, "availability": 0.4},
        "tenerife": {**SITES["tenerife"], "data_rate": "0.7 Gbit/s", "terminals": 2, "availability": 0.85},
    },
}


@pytest.fixture(scope="module")
def unlike_plan(tmp_path_factory):
    """Seven hours of six satellites, two relays and two stations whose numbers are all unlike each other."""
    return planned(tmp_path_factory.mktemp("unlike"), UNLIKE_PLAN)[0]


def totals_of(name):
    def of(found):
        t = getattr(found, name)
        return [*t.sessions, *t.busy_s, *t.served_s, *t.volume_bit, *t.longest_gap_s]

    return of


def first_sessions(found):
    names = ("start_s", "locked_s", "end_s", "rate_bit_s", "volume_bit", "range_min_m", "range_max_m")
    return [getattr(one, name) for one in found.planned[:9] for name in names]


def use_of(found):
    return [found.volume_bit, *found.use, *found.station_use, len(found.planned), found.opportunities.start_s.size]


@pytest.mark.parametrize(("of", "expected"), [
    (totals_of("by_satellite"), [
        15.0, 13.0, 12.0, 14.0, 15.0, 13.0, 7279.82385, 7999.11566, 7995.10863, 8089.04858, 7574.37402,
        8020.88784, 6604.82385, 7414.11566, 7455.10863, 7459.04858, 6899.37402, 7435.88784, 2054364410000.0,
        2306086530000.0, 2318836990000.0, 2614468600000.0, 2355913950000.0, 2584442040000.0, 465.0, 465.0,
        465.0, 465.0, 465.0, 465.0,
    ]),
    (totals_of("by_relay"), [
        37.0, 37.0, 21600.0, 21600.0, 19935.0, 19935.0, 6200582400000.0, 6200582400000.0, 45.0, 45.0,
    ]),
    (totals_of("by_station"), [
        6.0, 2.0, 2791.00843, 967.35015, 2521.00843, 877.35015, 1310924390000.0, 522023339000.0, 1643.57656,
        7569.18624,
    ]),
    (first_sessions, [
        0.0, 45.0, 420.0, 311040000.0, 116640000000.0, 36038123.9, 37353656.0, 0.0, 45.0, 420.0, 311040000.0,
        116640000000.0, 42058206.6, 44541664.7, 0.0, 45.0, 420.0, 311040000.0, 116640000000.0, 36704375.2,
        38214762.8, 0.0, 45.0, 420.0, 311040000.0, 116640000000.0, 40996990.3, 43481073.0, 420.0, 465.0, 1260.0,
        311040000.0, 247276800000.0, 35777237.4, 37269057.2, 420.0, 465.0, 1260.0, 311040000.0, 247276800000.0,
        35777237.4, 37269057.2, 420.0, 465.0, 840.0, 311040000.0, 116640000000.0, 38452741.7, 40748247.3, 420.0,
        465.0, 840.0, 311040000.0, 116640000000.0, 38452741.7, 40748247.3, 420.0, 465.0, 668.647756,
        1300000000.0, 105896833000.0, 1459446.29, 2618394.85,
    ]),
    (use_of, [
        14234112500000.0, 1.0, 1.0, 0.258426707, 0.0447847292, 82.0, 40.0,
    ]),
])  # fmt: skip
def test_a_plan_of_numbers_unlike_each_other(unlike_plan, of, expected):
    assert of(unlike_plan) == pytest.approx(expected, rel=1e-6, abs=0.0)


def test_a_plan_serves_each_by_its_name(unlike_plan):
    served = [(one.satellite, one.relay) for one in unlike_plan.planned[:24]]
    assert served == [
        ("1-2", "east"),
        ("1-3", "east"),
        ("1-1", "west"),
        ("2-1", "west"),
        ("2-3", "east"),
        ("1-2", "east"),
        ("2-2", "west"),
        ("1-1", "west"),
        ("2-1", "kiruna"),
        ("2-1", "tenerife"),
        ("1-3", "west"),
        ("2-2", "west"),
        ("1-1", "east"),
        ("2-3", "east"),
        ("2-1", "west"),
        ("1-2", "east"),
        ("2-2", "east"),
        ("2-3", "west"),
        ("1-1", "east"),
        ("1-2", "east"),
        ("2-1", "west"),
        ("1-3", "west"),
        ("2-3", "kiruna"),
        ("2-2", "east"),
    ]
    assert (unlike_plan.satellites, unlike_plan.relays, unlike_plan.stations, unlike_plan.station_terminals) == (
        ("1-1", "1-2", "1-3", "2-1", "2-2", "2-3"),
        ("east", "west"),
        ("kiruna", "tenerife"),
        (1, 2),
    )
    assert unlike_plan.contact_plan().split("\n")[1:16] == [
        '# node 1 is "1-1"',
        '# node 2 is "1-2"',
        '# node 3 is "1-3"',
        '# node 4 is "2-1"',
        '# node 5 is "2-2"',
        '# node 6 is "2-3"',
        '# node 7 is "east"',
        '# node 8 is "west"',
        '# node 9 is "kiruna"',
        '# node 10 is "tenerife"',
        "@ 2026/03/20-12:00:00",
        "a contact +45 +420 1 8 38880000",
        "a range +45 +420 1 8 1",
        "a contact +45 +420 2 7 38880000",
        "a range +45 +420 2 7 1",
    ]


def test_satellites_that_are_sampled_in_steps_of_their_own_are_each_seen_and_stand_in_order(tmp_path):
    """One in a low orbit, one half way up and one low again: of contacts that begin at once the first comes first."""
    epoch, earth, span_s = orbit.Epoch("2026-03-20T12:00:00Z"), orbit.Earth("oblate", 100e3), (0.0, 21600.0)
    own = [
        orbit.Terminal(orbit.circular(name, epoch, height_m, 0.9, node, phase, True), orbit.UNLIMITED, name)
        for name, height_m, node, phase in (("b", 5e5, 0.3, 1.0), ("a", 2.02e7, 1.0, 2.0), ("c", 9e5, 2.0, 4.0))
    ]
    relays = [
        orbit.Terminal(orbit.GeostationarySlot(name, epoch, longitude), orbit.UNLIMITED, name)
        for name, longitude in (("west", -1.5), ("east", 0.5))
    ]
    site = orbit.Station("site", 0.6, 0.2, 300.0, 0.1)
    ground = constellation.Ground(
        site,
        constellation.Site("site", 0.6, 0.2, (1.0,)),
        operations.RateTable((operations.Step(1e9, 3e7), operations.Step(1e8, math.inf))),
        1,
    )
    done = []
    rows = as_rows(opportunities(own, relays, earth, epoch, span_s, math.inf, done.append, [ground]))
    expected = [
        (place, which, c.start_s, c.end_s)
        for place, each in enumerate(own)
        for which, other in enumerate((*relays, site))
        for c in (
            orbit.passes(each.orbit, site, epoch, span_s)
            if other is site
            else orbit.contacts(each, other, earth, epoch, span_s)
        )
    ]
    expected.sort(key=lambda row: (round(row[2], 4), row[0], row[1]))
    assert [row[:2] for row in rows] == [row[:2] for row in expected]
    # both searches leave a microsecond
    np.testing.assert_allclose([row[2:] for row in rows], [row[2:] for row in expected], rtol=0, atol=1e-4)
    assert sum(row[2] == 0.0 for row in rows) > 3 and {row[1] for row in rows} == {0, 1, 2}
    assert {row[0] for row in rows} == {0, 1, 2} and done == [1, 2, 3]
    assert len({constellation.coarse_step_s(each.orbit, 0.0) for each in own}) == 2


def test_the_use_of_terminals_counts_by_the_span_wherever_it_begins():
    """Of 400 s the two relays of three terminals are busy for 300 s and 600 s, the stations of 1 and 5 for 100 s."""
    plan = SimpleNamespace(
        span_s=(1600.0, 2000.0), terminals=3, station_terminals=(1, 5),
        by_relay=SimpleNamespace(busy_s=np.array([300.0, 600.0])),
        by_station=SimpleNamespace(busy_s=np.array([100.0, 100.0])),
    )  # fmt: skip
    assert constellation.ConstellationPlan.use.fget(plan).tolist() == [0.25, 0.5]
    assert constellation.ConstellationPlan.station_use.fget(plan).tolist() == [0.25, 0.05]
