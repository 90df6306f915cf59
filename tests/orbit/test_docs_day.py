"""docs/day.md: its examples print what stands below them, its tables run, and its figures are computed anew."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from microrad import link, orbit
from microrad.core.units import SPEED_OF_LIGHT_M_S
from microrad.link import study as link_study
from microrad.mission import file as missionfile
from microrad.orbit import constellation, files
from microrad.orbit import day as day_study
from microrad.orbit.day import assumptions, flow, geometry
from microrad.orbit.propagation import analytic, mean_elements
from microrad.study import contact_run
from places import ROOT
from shipped import whole_study

PAGE = (ROOT / "docs" / "day.md").read_text(encoding="utf-8")
SAID = " ".join(re.sub(r"\n- | *<!-- promise: day-\d+ -->", " ", PAGE).split())
TABLES = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
ORBITS = TABLES[0].split("\n\n")
LIMITS, OPERATIONS, OPTICAL, SHARED = TABLES[1:]
TEXT = (ROOT / "missions" / "paper.toml").read_text(encoding="utf-8")
ELEMENTS = """DEMO
1 90001U 26001A   26079.50000000  .00000000  00000-0  50000-4 0  9997
2 90001  97.4000  95.0000 0010000  90.0000 270.0000 15.21960000    10
"""
EPHEMERIS = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-03-20T12:00:00
ORIGINATOR = DEMO
META_START
OBJECT_NAME = DEMO
OBJECT_ID = 2026-001A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
START_TIME = 2026-03-20T12:00:00
STOP_TIME = 2026-03-22T12:00:00
META_STOP
"""


def told(*sentences):
    """These words stand on the page, wherever its lines break."""
    for sentence in sentences:
        assert sentence in SAID, sentence


@pytest.mark.promise("readme-34")
def test_each_table_of_orbits_and_of_the_day_stands_on_the_page():
    headings = re.findall(r"(?m)^\[((?:orbit|operations|constellation)[\w.]*)\]", TEXT)
    tables = {re.sub(r"(stations|relays)\.\w+", r"\1.NAME", each) for each in headings}
    assert len(tables) == 11
    assert [each for each in sorted(tables - {"orbit"}) if f"[{each}]" not in PAGE] == []


def shipped(table):
    """The text of one of the shipped mission's tables."""
    return re.search(rf"(?ms)^\[{re.escape(table)}\].*?(?=^\[|^# ---)", TEXT)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the element set, and with an ephemeris of it each minute."""
    path = tmp_path_factory.mktemp("orbits")
    (path / "satellite.tle").write_text(ELEMENTS, encoding="utf-8")
    epoch = orbit.Epoch("2026-03-20T12:00:00Z")
    time_s = np.arange(0.0, 172801.0, 60.0)
    rows = 1e-3 * np.vstack(
        mean_elements.Sgp4Orbit(files.read_elements(path / "satellite.tle")[0], epoch).states(time_s)
    )
    lines = [epoch.utc(t)[:-1] + "".join(f" {x:.9f}" for x in row) for t, row in zip(time_s, rows.T, strict=True)]
    (path / "satellite.oem").write_text(EPHEMERIS + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def replaced(folder):
    """The shipped mission without its constellation, with tables of its own replaced."""

    def made(*tables):
        text = TEXT[: TEXT.index("[constellation]")] + TEXT[TEXT.index("[mirror]") :]
        for table in tables:
            (header,) = re.findall(r"(?m)^\[.*\]", table)
            text, count = re.subn(rf"(?ms)^{re.escape(header)}.*?(?=^\[|^# ---)", "", text)
            assert count == 1, header
            text += "\n" + table + "\n"
        path = folder / "mission.toml"
        path.write_text(text, encoding="utf-8")
        return missionfile.load_link(path)

    return made


@pytest.fixture(scope="module")
def view(replaced, folder):
    def seen(*tables):
        m = replaced(*tables).mission
        return geometry.view(orbit.pair(m.orbit, m.terminals, folder), m.communication.wavelength_m)

    return seen


@pytest.fixture(scope="module", autouse=True)
def _without_tornados():
    """Nothing here looks at those of the links."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(link_study, "tornados", lambda *args: ())
        yield


@pytest.fixture(scope="module")
def links():
    return link_study.run_link_study(missionfile.load_link(ROOT / "missions" / "paper.toml"))


@pytest.fixture(scope="module")
def day(links):
    """The day of the shipped mission, without its assumptions changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(day_study, "swings", lambda *given: ())
        return day_study.run_day_study(links)


def ends(seen):
    return np.array([(e.contact.start_s, e.contact.end_s) for e in seen.encounters])


# -------------------------------------------------------------------------------------------------------- examples
@pytest.mark.promise("day-6", "day-38", "day-39", "day-40")
def test_every_example_prints_what_stands_below_it(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    examples = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(examples) == PAGE.count("```python") == 3
    session: dict[str, object] = {}
    for code, printed in examples:
        exec(code, session)
        assert capsys.readouterr().out == printed


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-7", "day-8")
@pytest.mark.parametrize("table", ORBITS, ids=[re.search('kind = "([a-z]+)"', table)[1] for table in ORBITS])
def test_each_kind_of_orbit_comes_to_what_stands_below_it(view, table):
    seen = view(table)
    said = re.findall(r"(?m)^# (.*)", table)
    assert said == [f"{len(seen.encounters)} contacts, {seen.contact_s / 60.0:.2f} min"]


@pytest.mark.promise("day-3")
def test_the_commands_of_the_page_run(call, monkeypatch):
    monkeypatch.setattr(day_study, "swings", lambda *given: ())
    commands = [line.split() for line in re.findall(r"(?m)^    microrad (.*?)(?: +#.*| > .*)?$", PAGE)]
    assert len(commands) == 4
    for command in commands[1], commands[3]:
        result = call(command[0], ROOT / "missions" / command[1], *command[2:])
        assert result.code == 0
        assert result.out.startswith(("by,with,rise", "# Contact plan"))


# --------------------------------------------------------------------------------------------------------- the words
@pytest.mark.promise("day-10", "day-11", "day-13")
def test_what_moves_the_ends_of_contacts(view, day):
    own = day.view
    inclination = f'inclination = "{math.degrees(analytic.sun_synchronous_inclination_rad(500e3))!r} deg"'
    still = ORBITS[0].replace('gravity = "j2"', 'gravity = "two-body"')
    still = still.replace('inclination = "sun-synchronous"', inclination)
    j2 = np.abs(ends(view(still)) - ends(own)).max()
    told(f'it moves the ends of contacts by up to {j2:.0f} s against `"two-body"`')
    round_earth = np.abs(ends(view(shipped("orbit").replace('"oblate"', '"sphere"'))) - ends(own)).max()
    told(f"that moves ends by up to {round_earth:.0f} s")
    low = view(shipped("orbit").replace('grazing_height = "100 km"', 'grazing_height = "0 km"'))
    told(f"in view for {100 * low.visible_share:.1f} % of the day in place of {100 * own.visible_share:.1f} %")
    furthest = own.largest("range_most_m")
    light_s = furthest / SPEED_OF_LIGHT_M_S
    told(f"{furthest / 1e3:.0f}".replace("44036", "44 036") + f" km take {light_s:.3f} s")


@pytest.mark.promise("day-12")
@pytest.mark.parametrize(
    ("table", "change", "reason"),
    [
        (ORBITS[2], ("26079.5", "26060.5"), "the elements are expired"),
        (ORBITS[2], ("270.0000", "27x.0000"), "the mean anomaly in columns 44 to 51"),
        (ORBITS[1], ("7000 km", "6500 km"), "it has decayed"),
        (ORBITS[4], ('longitude = "9 deg"', ""), "longitude"),
        (shipped("operations.downlink.stations.kiruna"), ('mask = "5 deg"', 'mask = "95 deg"'), "mask"),
    ],
    ids=["too old", "malformed", "decayed", "no longitude", "mask"],
)
def test_what_the_page_says_is_refused_is_refused(replaced, folder, table, change, reason):
    told("A TLE that is too old or malformed, a perigee below 120 km, a slot without longitude, a mask of 95 deg")
    lines = ELEMENTS.replace(*change).splitlines()
    sums = [line[:68] + str(sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10) for line in lines[1:]]
    (folder / "other.tle").write_text("\n".join([lines[0], *sums]), encoding="utf-8")
    with pytest.raises(ValueError) as refused:
        m = replaced(table.replace(*change).replace("satellite.tle", "other.tle")).mission
        orbit.pair(m.orbit, m.terminals, folder)
    assert reason in str(refused.value)


@pytest.mark.promise("day-12")
def test_an_ephemeris_is_used_within_its_span(replaced, folder):
    told("Elements are used up to 14 days from their epoch, an ephemeris within its usable span.")
    m = replaced(ORBITS[3], shipped("orbit").replace('"24 h"', '"72 h"')).mission
    with pytest.raises(orbit.OrbitError, match="2026-03-22T12:00:00"):
        orbit.pair(m.orbit, m.terminals, folder)


@pytest.mark.promise("day-18", "day-43")
def test_limits_and_the_sun(view, day):
    found = [e.contact for e in day.view.encounters]
    (cut,) = [k for k, c in enumerate(found) if c.ends == "Sun near the line of sight of LEO"]
    told(f"one contact becomes two, with {(found[cut + 1].start_s - found[cut].end_s) / 60:.1f} min between")
    dark = view(shipped("orbit.leo.limits").replace("in_eclipse = true ", "in_eclipse = false "))
    told(f"would leave {dark.contact_s / 60:.0f} of {day.view.contact_s / 60:.0f} min")
    held = view(LIMITS)
    told(f"with the table above {held.contact_s / 60:.0f} min are left")
    causes = {cause for e in held.encounters for cause in (e.contact.begins, e.contact.ends)}
    assert "field of regard of LEO" in causes and "Earth" not in causes


@pytest.mark.promise("gallery-20")
@pytest.mark.promise("day-19", "day-20", "day-25")
def test_rates_share_and_store(replaced, links, day):
    def of(*change):
        m = replaced(OPERATIONS.replace(*change) if change else OPERATIONS).mission
        o, seen = m.operations, day.view
        found = flow.closings(m.operations, link.of(m), day.loss)
        way = links.finding.way(day.operations.acquisition)
        relay = flow.relay(o, seen, flow.rate_table(found), day.loss.outage, way, 1.0)
        return SimpleNamespace(
            closings=found, relay=relay, direct=flow.direct(o, seen, flow.station_passes(o.downlink, seen.pair))
        )

    stepped = of()
    reach = [f"{c.largest_range_m / 1e3:.0f}" for c in stepped.closings]
    reach = [f"{text[:2]} {text[2:]} km" for text in reach]
    told(f"at 600 Mbit/s up to {reach[0]}, nearer than the relay ever is, at 300 Mbit/s up to {reach[1]}")
    told(f"at 100 Mbit/s up to {reach[2]}: {stepped.relay.capacity_bit / 8e12:.2f} TB")
    assert stepped.closings[0].largest_range_m < min(e.range_least_m for e in day.view.encounters)
    told(f"in place of {day.relay.capacity_bit / 8e12:.2f} TB at 300 Mbit/s alone")
    told(f"within {stepped.relay.slow_s / 60:.1f} min in place of {day.relay.slow_s / 60:.1f} min")
    told("Without `[acquisition]` lock is there at once")
    at_once = flow.relay(day.operations, day.view, flow.rate_table(day.closings), 0.0, None, 1.0)
    assert np.ptp(at_once.capacity_spread_bit) == 0.0 and at_once.capacity_bit > day.relay.capacity_bit
    half = of("relay_share = 1.0", "relay_share = 0.5")
    told(f"`relay_share = 0.5` {half.relay.capacity_bit / 8e12:.2f} TB are left", f"{half.relay.slow_s / 60:.1f} min")
    small = of('"128 GB"', '"2 GB"')
    assert small.relay.lost_bit == 0.0
    kept = small.direct
    told(f"direct downlink loses {kept.lost_bit / 8e9:.1f} of {kept.generated_bit / 8e9:.1f} GB")
    assert kept.latency.delivered_bit + kept.latency.missing_bit == pytest.approx(kept.generated_bit - kept.lost_bit)


@pytest.fixture(scope="module")
def under_clouds(folder):
    """The day of the shipped mission with the page's optical ground stations, and of its assumptions that of clouds."""
    every, clouds = assumptions._changes, "availability of the optical stations"
    text = TEXT[: TEXT.index("[constellation]")] + TEXT[TEXT.index("[mirror]") :] + "\n" + OPTICAL
    (folder / "clouds.toml").write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assumptions, "_changes", lambda *args: [each for each in every(*args) if each[0] == clouds])
        return day_study.run_day_study(link_study.run_link_study(missionfile.load_link(folder / "clouds.toml")))


@pytest.mark.promise("day-44", "day-45", "day-52")
def test_what_the_optical_ground_stations_carry(under_clouds):
    way, sky = under_clouds.optical, under_clouds.sky
    least, most = (f"{bit / 8e9:.0f}" for bit in way.capacity_spread_bit)
    told(f"has {way.capacity_bit / 8e9:.0f} GB by the optical downlink, from {least} to {most} GB by the weather drawn")
    told(f"in {way.contact_s / 60:.0f} min of use, 99 % of the instrument's data within {way.slow_s / 3600:.1f} h")
    told(f"is clear for {100 * sky.any_clear:.1f} % of the time, {100 * sky.any_independent:.1f} % with independent")
    (clouds,) = (s for s in under_clouds.swings if s.name == "availability of the optical stations")
    bit, slow_s = clouds.at_high.optical_bit, clouds.at_high.optical_slow_s
    told(f"Without clouds it had {bit / 8e9:.0f} GB, 99 % within {slow_s / 3600:.2f} h")
    assert clouds.high == "no clouds" and sky.availability == (0.7, 0.5)


@pytest.mark.promise("day-46", "day-51")
def test_the_sky_of_the_page(under_clouds):
    sky, (tenerife, calern) = under_clouds.sky, orbit.stations(under_clouds.operations.optical)
    across = math.cos(tenerife.latitude_rad) * math.cos(calern.latitude_rad)
    cosine = math.sin(tenerife.latitude_rad) * math.sin(calern.latitude_rad)
    cosine += across * math.cos(tenerife.longitude_rad - calern.longitude_rad)
    apart_m = orbit.EARTH_RADIUS_M * math.acos(cosine)
    assert sky.correlation[0, 1] == pytest.approx(math.exp(-apart_m / 1e6), rel=1e-9)
    joint = multivariate_normal.cdf([0.0, -0.524400512708041], cov=sky.correlation)  # both cloudy: 0.5 and 0.3
    assert sky.any_clear == pytest.approx(1.0 - joint, abs=1e-6) and sky.any_independent == pytest.approx(0.85)


@pytest.mark.promise("day-54", "day-55")
def test_the_stations_of_the_constellation_on_the_page(folder):
    text = TEXT[: TEXT.index("[mirror]")].replace('duration = "24 h"', 'duration = "6 h"')
    (folder / "shared.toml").write_text(text + TEXT[TEXT.index("[mirror]") :] + "\n" + SHARED, encoding="utf-8")
    file = missionfile.load_link(folder / "shared.toml")
    loss = day_study.PointingLoss(2.23, 0.0, "given")
    plan = constellation.run_constellation(file, loss)
    assert (plan.stations, plan.station_terminals) == (("svalbard",), (2,))
    at = [s for s in plan.planned if s.relay == "svalbard"]
    assert len(at) == plan.by_station.sessions[0] > 10
    for one in at:
        assert one.volume_bit == pytest.approx(0.6e9 * (one.end_s - one.locked_s), rel=1e-12)


@pytest.mark.promise("day-19")
@pytest.mark.parametrize("way", ["wide beacon", "scan"])
def test_the_acquisition_of_the_operations_is_the_one_that_is_drawn(replaced, links, day, way):
    m = replaced(OPERATIONS.replace('"wide beacon"', f'"{way}"')).mission
    asked = replace(links, file=replace(links.file, mission=m))
    found = day_study.relay(asked, day.loss).capacity_bit
    rates = flow.rate_table(flow.closings(m.operations, link.of(m), day.loss))
    by = {
        name: flow.relay(m.operations, day.view, rates, day.loss.outage, each, 1.0).capacity_bit
        for name, each in (("wide beacon", links.finding.wide), ("scan", links.finding.scan))
    }
    assert by["wide beacon"] != by["scan"]
    assert found == by[way]


@pytest.mark.promise("day-36", "day-37")
def test_the_papers_claim(links, day):
    relay, direct = day.relay, day.direct
    minutes = [c.duration_s / 60.0 for c in relay.contacts]
    told(f"| the relay rises {day.view.rises} times; {len(minutes)} contacts, since the Sun cuts one in two |")
    told(f"| {day.view.median_s / 60:.1f} min in the median, {min(minutes):.1f} to")
    told(f"to {max(minutes):.1f} min; {relay.contact_s / 60:.0f} min in all |")
    passes = [c.duration_s / 60.0 for c in direct.contacts]
    told(f"| {min(passes):.1f} to {max(passes):.1f} min above 5 deg at Kiruna, {len(passes)} of them,")
    told(f"{direct.contact_s / 60:.0f} min in all |")
    told(f"| 45 min x 15 x 300 Mbit/s, {45 * 60 * 15 * 3e8 / 8e12:.2f} TB |")
    told(f"| {relay.capacity_bit / 8e12:.2f} TB, against {direct.capacity_bit / 8e12:.3f} TB by 100 Mbit/s direct |")
    c, furthest = links.file.mission.communication, day.view.largest("range_most_m")
    assert (c.pointing_error_rad, c.distance_m) == (10e-6, 42e6)
    missing = 20.0 * math.log10(furthest / day.closings[0].largest_range_m)
    told(f"the margin is {day.closings[0].margin_db:.2f} dB", f"where {missing:.2f} dB are missing")
    assert (round(day.closings[0].largest_range_m / 1e3), round(furthest / 1e3)) == (42002, 44036)
    told("reach to 42 002 km, and the contacts to 44 036 km")
    told(f"Data flow for {relay.capacity_bit / c.data_rate_bit_s / 60:.0f} of {relay.contact_s / 60:.0f} min")
    told(f"half of the data take {relay.median_s / 60:.2f} min or longer")


# ------------------------------------------------------------------------------------------------ the simulated loop
@pytest.fixture(scope="module")
def lqg():
    """The shipped mission, and what its whole study finds of its fine-pointing loop, whose best is LQG."""
    found = whole_study()[0]
    assert found.fine_pointing.best.design.name == "LQG"
    return found.file.mission, found.fine_pointing


@pytest.mark.promise("day-38")
def test_what_the_simulated_loop_leaves(lqg, links, day):
    m, fine = lqg
    left = fine.best.simulated["given"].quantile_rad
    loss = float(link.of(links.file.mission).beam.fall.loss_db(left))
    told(f"{left * 1e6:.2f} µrad at 99.7 %, a pointing loss of {loss:.2f} dB in place of {day.loss.loss_db:.2f} dB")
    assert m.fine_pointing.quantile == 0.997 and f"loss_db={loss:.2f}" in PAGE


@pytest.mark.promise("day-27", "day-29")
def test_one_contact_in_time(lqg, links, day):
    m, fine = lqg
    run = contact_run.of_mission(m.operations, m.acquisition, links.data, day, links.finding, fine)
    begins = run.contact.start_s - run.log[0].time_s
    told(f"the slew begins {begins:.0f} s before the rise, data {run.first_data_s - run.contact.start_s:.1f} s after")
    told(f"flow for {run.data_s / 60:.1f} min, {100 * run.data_share:.1f} % of the contact,")
    told(f"{run.bits(m.communication.data_rate_bit_s) / 8e9:.0f} GB")
    told(f"In the {len(run.windows)} windows the margin is never below", f"{len(run.windows)} windows are 16 s here")
    told(f"never below {min(w.lowest_margin_db for w in run.windows):.2f} dB")
    assert run.losses == 0 and run.sampled_s == pytest.approx(16.0)


# ---------------------------------------------------------------------------------------------------- constellation
@pytest.mark.promise("day-33")
def test_the_constellation(links):
    plan = constellation.run_constellation(links.file, day_study.given_loss(links))
    reach = np.sum(plan.opportunities.end_s - plan.opportunities.start_s) / 3600.0
    told(
        f"`microrad constellation leo-geo.toml` has {len(plan.planned)} of them, in {reach:.0f} h of contacts in reach"
    )
    assert all(one.rate_bit_s > 0.0 for one in plan.planned)
    text = plan.contact_plan()
    assert "# left out" not in text
    lights = {line.split()[-1] for line in text.splitlines() if line.startswith("a range")}
    assert lights == {"1"}
    counted = np.sum(plan.by_satellite.served_s)
    assert counted == pytest.approx(sum(one.end_s - one.locked_s for one in plan.planned))


@pytest.mark.promise("day-31")
def test_a_pattern_repeats_elements_and_a_file_goes_with_every_kind(folder):
    told("`[constellation]` repeats a circular or Keplerian `orbit.leo`", "and goes with every kind of `orbit.leo`")
    path = folder / "many.toml"
    path.write_text(TEXT.replace(shipped("orbit.leo"), ORBITS[2] + "\n\n"), encoding="utf-8")
    m = missionfile.load_link(path).mission
    with pytest.raises(orbit.OrbitError, match='of kind "elements" has nothing to repeat: give pattern = "file"'):
        tuple(orbit.satellites(m.constellation, m.orbit, orbit.Epoch(m.orbit.epoch), folder))
    text = re.sub(r"(?m)^(satellites|planes|phasing) = .*\n", "", path.read_text(encoding="utf-8"))
    path.write_text(text.replace('pattern = "delta"', 'pattern = "file"\nfile = "satellite.tle"'), encoding="utf-8")
    m = missionfile.load_link(path).mission
    (only,) = orbit.satellites(m.constellation, m.orbit, orbit.Epoch(m.orbit.epoch), folder)
    assert only.name == "DEMO"


@pytest.mark.promise("day-31")
@pytest.mark.parametrize(("pattern", "round_deg"), [("delta", 360.0), ("star", 180.0)])
def test_walkers_patterns_are_as_told(links, pattern, round_deg):
    told('`"delta"` spreads the nodes over 360 deg, `"star"` over 180 deg', "360 deg F / `satellites` apart in phase")
    m, c = links.file.mission, links.file.mission.constellation.model_copy(update={"pattern": pattern})
    epoch = orbit.Epoch(m.orbit.epoch)
    first, *_, later = list(orbit.satellites(c, m.orbit, epoch, ROOT))[: c.satellites // c.planes + 1]
    assert math.degrees(later.orbit.node_rad - first.orbit.node_rad) == pytest.approx(round_deg / c.planes)
    apart = math.degrees(later.orbit.mean_anomaly_rad - first.orbit.mean_anomaly_rad)
    assert apart == pytest.approx(360.0 * c.phasing / c.satellites)
