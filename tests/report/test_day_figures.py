"""Figures of a day in orbit: what stands in them, what their tables hold, and what they say when there is nothing."""

import csv
import math
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from drawn import figure_of
from microrad.report import columns_csv
from microrad.report.day import figures
from microrad.report.day import world_map as world
from microrad.report.day.figures import (
    MOST_BARS,
    Assumed,
    Windows,
    along_contact,
    assumptions,
    contact_run,
    data_volume,
    latency,
    reached_s,
    timeline,
)
from microrad.report.day.world_map import Marked, Places, broken, land, odd, other_side, world_map
from microrad.report.plotting import scales
from microrad.report.plotting.sheet import Area, Bars, Line, Rule, shortened
from microrad.report.plotting.swings import in_lines
from microrad.report.quantities import duration

NAME = 'Kiruna <b>"A&B"</b> $x$ $\\nonsense$'
NOTHING = np.empty(0)
NO_PLACES = Places(NOTHING, NOTHING)
SPAN_S = (0.0, 86400.0)
EPOCH = "2026-03-20T12:00:00Z"
GEO, KIRUNA = (0.0, 20.0, 103.0), (67.9, 21.0, 18.0)
THIRD = {"number": 3, "rise_utc": "2026-03-20 15:28:04"}


def texts(figure):
    """Every text in the picture, as a reader of the SVG gets it."""
    root = ElementTree.fromstring(figure.svg)
    return [line.strip() for e in root.iter("{http://www.w3.org/2000/svg}text") for line in e.itertext()]


def intervals(count, long_s):
    start_s = np.linspace(*SPAN_S, count, endpoint=False)
    return np.stack([start_s, start_s + long_s], axis=1)


def circle(latitude_deg, longitude_deg, radius_deg, points=361):
    """Points at one angle from a place, by rotating vectors."""
    latitude, longitude, radius = np.radians([latitude_deg, longitude_deg, radius_deg])
    at = np.linspace(0.0, 2.0 * np.pi, points)
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    north = np.cross(up, east)
    ring = np.cos(radius) * up + np.sin(radius) * (np.cos(at)[:, None] * north + np.sin(at)[:, None] * east)
    return Places(np.arcsin(ring[:, 2]), np.arctan2(ring[:, 1], ring[:, 0]))


def marked(latitude_deg, longitude_deg, radius_deg):
    at = np.radians([[latitude_deg], [longitude_deg]])
    return Marked(Places(*at), circle(latitude_deg, longitude_deg, radius_deg))


def winding(rings, x, y):
    """How often closed rings of (x, y) run around a point, anticlockwise positive."""
    a, b = (np.concatenate([ring[part] for ring in rings]).T for part in (slice(None, -1), slice(1, None)))
    left = (b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])
    return int(np.sum((a[1] <= y) & (y < b[1]) & (left > 0.0)) - np.sum((b[1] <= y) & (y < a[1]) & (left < 0.0)))


def a_track(inclination_deg=97.4, points=400):
    phase = np.linspace(0.0, 6.0 * np.pi, points)
    tilt = math.radians(inclination_deg)
    longitude = np.arctan2(np.sin(phase) * np.cos(tilt), np.cos(phase)) - phase / 15.2
    return Places(np.arcsin(np.sin(phase) * np.sin(tilt)), longitude)


def a_timeline():
    return timeline([("relay", intervals(15, 2400.0)), (f"direct: {NAME}", intervals(200, 60.0))], SPAN_S, EPOCH)


def a_contact():
    t = np.linspace(0.0, 2400.0, 100)
    return along_contact(t, 4e7 + t, 5e-5 - 1e-9 * t, 1e-4 + 1e-9 * t, 4e9 - 3e6 * t, **THIRD)


def a_volume():
    t = np.linspace(0.0, 86400.0, 50)
    return data_volume({"generated": (t, t * 8e5), NAME: (t, t * 4e5)}, {NAME: (t, t * 4e5)})


def a_latency():
    share = np.linspace(0.001, 1.0, 1000)
    return latency({NAME: (30.0 * share, share), "direct downlink": (40000.0 * share, 0.75 * share)})


def a_map():
    track = a_track()
    flags = {"relay": np.cos(track.longitude_rad) > 0.0, "direct": track.latitude_rad > 1.2}
    return world_map(track, flags, {"GEO": marked(0.0, 20.0, 103.0)}, {NAME: marked(67.9, 21.0, 18.0)})


def some_assumptions():
    return assumptions([Assumed("rate", 12.0, 5.0), Assumed(NAME, 6.0, 9.0), Assumed("cloud", 7.0, 7.0)], 7.0, "ratio")


def a_run():
    states = [("slew", 0.0, 30.0), (NAME, 30.0, 32.0), ("data", 32.0, 1000.0), ("loss", 1000.0, 1002.0)]
    states += [("data", 1010.0, 2000.0)]
    t = np.arange(60.0, 2000.0, 60.0)
    return contact_run(states, Windows(t, np.full(t.size, 1.5e-6), np.full(t.size, 5e-6)), 1e-5)


FIGURES = {
    a_timeline: (f"hours since {EPOCH}", "relay", "15 · 10 h", "200 · 3.33 h", "24"),
    a_contact: (
        "range (km)",
        "point-ahead angle (µrad)",
        "line-of-sight rate (µrad/s)",
        "Doppler shift (GHz)",
        "time since rise (min)",
    ),
    a_volume: ("since the start (GB)", "stored on board (GB)", "time (h)", "generated"),
    a_latency: (
        "time from recording to delivery",
        "share of the data (%)",
        "10 s",
        "10 min",
        "6 h",
        "direct downlink: median 7.41 h, 75 % arrive",
    ),
    a_map: ("60° N", "30° S", "120° W", "60° E", "GEO", "ground track", "relay", "direct", "hidden from a relay"),
    some_assumptions: ("ratio; as assumed: 7", "assumption lower", "assumption higher", "cloud", "no change"),
    a_run: (
        "time since the start of the contact (min)",
        "radial error (µrad)",
        "rms",
        "largest",
        "required: 10 µrad",
        "2 · 32.6 min",
    ),
}


@pytest.mark.parametrize("draw", FIGURES, ids=lambda draw: draw.__name__)
def test_labels_and_units_stand_in_the_picture_and_two_calls_agree(draw):
    figure = draw()
    missing = set(FIGURES[draw]) - set(texts(figure))
    assert not missing, texts(figure)
    assert draw().svg == figure.svg
    assert figure.caption.endswith(".")


@pytest.mark.parametrize("draw", [draw for draw in FIGURES if draw is not a_contact], ids=lambda draw: draw.__name__)
def test_a_name_of_the_mission_stays_text(draw):
    figure = draw()
    assert "<b>" not in figure.svg
    assert any(shortened(NAME, 24)[:-1] in text for text in texts(figure))
    assert any(NAME in heading for heading in figure.columns)


def test_a_name_is_cut_and_kept_on_one_line():
    assert shortened("Kiruna") == "Kiruna"
    assert shortened("a\nb\x00c") == "a b c"
    assert shortened("x" * 35) == "x" * 33 + "…"
    assert [duration(s) for s in (0.0, 119.0, 120.0, 7199.0, 7200.0)] == ["0 s", "119 s", "2 min", "120 min", "2 h"]


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda: timeline([], SPAN_S, EPOCH), "no contacts and no eclipses to show"),
        (lambda: timeline([("relay", np.empty((0, 2)))], SPAN_S, EPOCH), "none"),
        (lambda: along_contact(*[NOTHING] * 5, **THIRD), "no contact in this span"),
        (lambda: data_volume({}, {}), "no data were generated"),
        (lambda: latency({}), "nothing was delivered"),
        (lambda: latency({"relay": (NOTHING, NOTHING)}), "nothing was delivered"),
        (lambda: world_map(NO_PLACES, {"relay": np.empty(0, bool)}, {}, {}), "no ground track"),
        (lambda: assumptions([], 3.0, "ratio"), "no assumption was varied"),
        (lambda: assumptions([Assumed("a", 1.0, 2.0)], math.inf, "ratio"), "ratio: no finite value"),
        (lambda: contact_run([], Windows(*[NOTHING] * 3)), "no contact was run"),
        (lambda: contact_run([("slew", 0.0, 9.0)], Windows(*[NOTHING] * 3)), "no window was simulated in full"),
    ],
)
def test_what_is_missing_is_said_and_still_has_a_table(draw, words, tmp_path):
    figure = draw()
    assert words in texts(figure)
    (tmp_path / "empty.csv").write_bytes(columns_csv(figure.columns))
    assert (tmp_path / "empty.csv").read_text(encoding="utf-8").strip()


def test_relays_and_stations_show_without_a_track_or_an_outline():
    bare = Marked(Places(np.array([0.1]), np.array([3.1])), NO_PLACES)
    figure = world_map(NO_PLACES, {}, {"GEO": bare}, {"Kiruna": marked(67.9, 21.0, 18.0)})
    assert {"GEO", "Kiruna", "no ground track"} <= set(texts(figure))


def test_a_contact_says_which_it_is():
    figure = a_contact()
    assert figure.title == "Along contact 3"
    assert "over contact 3, which rises at 2026-03-20 15:28:04 UTC." in figure.caption


# ------------------------------------------------------------------------------------------------ tables


def test_the_tables_hold_what_was_given(tmp_path):
    first, second = intervals(15, 2400.0), intervals(3, 10.0)
    figure = timeline([("relay", first), ("eclipse", second)], SPAN_S, EPOCH)
    assert list(figure.columns["relay, start (s)"]) == list(first[:, 0])
    assert list(figure.columns["eclipse, end (s)"]) == list(second[:, 1])
    (tmp_path / "t.csv").write_bytes(columns_csv(figure.columns))
    with (tmp_path / "t.csv").open(encoding="utf-8") as file:
        rows = [*csv.DictReader(file)]
    assert [float(row["relay, end (s)"]) for row in rows] == pytest.approx(first[:, 1], rel=1e-8)
    assert [row["eclipse, start (s)"] for row in rows[3:]] == [""] * 12


def test_the_tables_of_curves_are_in_si():
    t, a = np.arange(5.0), np.arange(5.0) + 1.0
    found = along_contact(t, a, 2 * a, 3 * a, 4 * a, **THIRD).columns
    headings = ["time since rise (s)", "range (m)", "point-ahead (rad)", "line-of-sight rate (rad/s)", "Doppler (Hz)"]
    assert [*found] == headings
    for heading, values in zip(headings, (t, a, 2 * a, 3 * a, 4 * a), strict=True):
        assert list(found[heading]) == list(values)
    found = data_volume({"relay": (t, a)}, {"relay": (t, 2 * a)}).columns
    assert list(found["relay, since the start (bit)"]) == list(a)
    assert list(found["relay, stored (bit)"]) == list(2 * a)
    found = latency({"relay": (a, t / 4.0)}).columns
    assert list(found["relay, latency (s)"]) == list(a)
    assert list(found["relay, share"]) == list(t / 4.0)


def test_the_tables_of_states_assumptions_and_the_map():
    found = a_run().columns
    assert list(found["data, start (s)"]) == [32.0, 1010.0]
    assert list(found["data, end (s)"]) == [1000.0, 2000.0]
    assert set(found["largest (rad)"]) == {5e-6}
    found = some_assumptions().columns
    assert [found[key][0] for key in ("as assumed", "rate, lower", "rate, higher", "cloud, lower")] == [7, 12, 5, 7]
    found, track = a_map().columns, a_track()
    assert found["track, latitude (deg)"] == pytest.approx(np.degrees(track.latitude_rad))
    turns = (found["track, longitude (deg)"] - np.degrees(track.longitude_rad)) / 360.0
    assert turns == pytest.approx(np.round(turns), abs=1e-9)
    assert np.all(np.abs(found["track, longitude (deg)"]) <= 180.0)
    assert list(found["in contact: relay"]) == list((np.cos(track.longitude_rad) > 0.0).astype(float))
    assert found["GEO, longitude (deg)"] == pytest.approx([20.0])
    assert found["GEO, outline, latitude (deg)"].size == 361


# ------------------------------------------------------------------------------------------------ what is drawn


def panels(figure):
    return figure.sheet.panels


def lines(panel):
    return {line.label: np.stack([line.x, line.y]) for line in panel.all_of(Line)}


@pytest.mark.parametrize("count", [1, 15, 200])
def test_each_interval_is_a_bar_where_it_belongs(count):
    given = intervals(count, 60.0)
    (bars,) = panels(timeline([("relay", given)], SPAN_S, EPOCH))[0].all_of(Bars)
    assert np.stack([bars.start, bars.end], axis=1) == pytest.approx(given / 3600.0)
    assert set(bars.at) == {0.0}


def test_curves_are_drawn_in_the_unit_of_their_axis():
    along = panels(a_contact())
    assert [panel.all_of(Line)[0].y[-1] for panel in along] == pytest.approx([40002.4, 50.0 - 2.4, 102.4, 4.0 - 7.2])
    assert along[0].all_of(Line)[0].x[-1] == pytest.approx(40.0)
    above, below = panels(a_volume())
    assert lines(above)["generated"][:, -1] == pytest.approx([24.0, 8.64])
    assert lines(below)[shortened(NAME)][:, -1] == pytest.approx([24.0, 4.32])
    assert above.all_of(Line)[1].colour == below.all_of(Line)[0].colour
    errors = lines(panels(a_run())[1])
    assert (set(errors["rms"][1]), set(errors["largest"][1])) == ({1.5}, {5.0})


def test_bars_reach_from_the_value_to_what_it_becomes():
    bars = panels(some_assumptions())[0].all_of(Bars)
    ends = sorted((float(bar.at[0]), float(bar.start[0]), float(bar.end[0])) for bar in bars)
    assert ends == [(0, 7.0, 5.0), (0, 7.0, 12.0), (1, 7.0, 6.0), (1, 7.0, 9.0), (2, 7.0, 7.0), (2, 7.0, 7.0)]


def test_the_track_is_thick_only_in_contact_and_one_region_is_shaded_for_each_relay():
    track = a_track(28.0)
    flags = np.cos(track.longitude_rad) > 0.0
    relays = {n: marked(0.0, at, 103.0) for n, at in (("A", 0.0), ("B", 120.0))}
    (panel,) = panels(world_map(track, {"relay": flags}, relays, {}))
    x = lines(panel)["relay"][0]
    assert np.array_equal(x[np.isfinite(x)], track.degrees[0][flags])
    assert np.sum(np.isfinite(lines(panel)["ground track"][0])) >= flags.size
    assert len(panel.all_of(Area)) == 1 + 2  # the land first


SHADED, CIRCLE = "has no line of sight to the relay", "above the lowest elevation"
LEGEND = {"hidden from a relay", "relay, limit of its view", "relay at the start, its track", "relay"}
LEGEND |= {"station, its horizon", "station"}


def test_a_relay_that_moves_has_its_track_and_no_shade():
    way = a_track(5.0)
    figure = world_map(a_track(), {}, {"MEO": Marked(way, NO_PLACES)}, {})
    (panel,) = panels(figure)
    assert len(panel.all_of(Area)) == 1  # the land
    longitude, _ = way.degrees
    drawn = [line for line in panel.all_of(Line) if {*longitude.tolist()} <= {*line.x.tolist()}]
    assert [(line.width, line.dash) for line in drawn] == [(0.7, "-")]
    assert LEGEND & set(texts(figure)) == {"relay at the start, its track"}
    assert "its own ground track as a thin line" in figure.caption
    assert SHADED not in figure.caption
    assert CIRCLE not in figure.caption
    assert figure.columns["MEO, longitude (deg)"].size == way.latitude_rad.size
    assert figure.columns["MEO, outline, longitude (deg)"].size == 0


@pytest.mark.parametrize("outlined", [True, False])
def test_the_caption_of_the_map_says_only_what_is_drawn(outlined):
    relay, station = (marked(*each) if outlined else Marked(marked(*each).place, NO_PLACES) for each in (GEO, KIRUNA))
    figure = world_map(a_track(), {}, {"GEO": relay}, {"Kiruna": station})
    assert (SHADED in figure.caption) == (CIRCLE in figure.caption) == outlined
    assert "thin line" not in figure.caption
    with_outlines = {"hidden from a relay", "relay, limit of its view", "station, its horizon"}
    assert LEGEND & set(texts(figure)) == (with_outlines if outlined else {"relay", "station"})


def test_the_map_of_a_long_span_says_that_it_shows_its_beginning():
    assert "in the first 24 h of the span, thick" in world_map(a_track(), {}, {}, {}, 86400.0).caption
    assert "first" not in world_map(a_track(), {}, {}, {}).caption


@pytest.mark.parametrize(
    ("bits", "unit"), [(7.9e3, "byte"), (8.1e3, "kB"), (8e9, "GB"), (7.9e12, "GB"), (8.1e12, "TB"), (9e30, "PB")]
)
def test_the_unit_of_the_volume_suits_the_largest(bits, unit):
    t = np.array([0.0, 3600.0])
    assert f"since the start ({unit})" in texts(data_volume({"generated": (t, np.array([0.0, bits]))}, {}))


def test_a_day_without_data_has_an_axis_in_bytes():
    t = np.array([0.0, 3600.0])
    assert "stored on board (byte)" in texts(data_volume({"relay": (t, 0 * t)}, {"relay": (t, 0 * t)}))


def test_median_and_99_percent_are_those_of_the_sample():
    sample = np.sort(np.random.Generator(np.random.Philox(7)).lognormal(3.0, 1.0, 20001))
    share = np.arange(1, sample.size + 1) / sample.size
    for wanted in (0.5, 0.99):
        assert reached_s(sample, share, wanted) == pytest.approx(np.quantile(sample, wanted), rel=1e-3)
    assert reached_s(sample, 0.98 * share, 0.99) == math.inf
    assert reached_s(NOTHING, NOTHING, 0.5) == math.inf
    words = f"relay: median {duration(np.quantile(sample, 0.5))}, 99 % {duration(np.quantile(sample, 0.99))}"
    assert words in texts(latency({"relay": (sample, share)}))


@pytest.mark.parametrize(
    ("least_s", "most_s", "begin_s", "ticks"),
    [
        (1.0, 33600.0, 0.5, ["1 s", "10 s", "1 min", "10 min", "1 h", "6 h"]),
        (0.25, 4.0, 0.1, ["100 ms", "200 ms", "500 ms", "1 s", "2 s"]),
        (30.0, 45.0, 10.0, ["10 s", "20 s", "30 s"]),
        (3000.0, 3500.0, 1000.0, ["20 min", "30 min", "1 h"]),
        (7.0, 900000.0, 2.0, ["10 s", "1 min", "10 min", "1 h", "6 h", "1 d", "7 d"]),
        (1e-9, 86400.0, 5e-3, ["10 ms", "0.1 s", "1 s", "10 s", "1 min", "10 min", "1 h", "6 h", "1 d"]),
    ],
)
def test_the_axis_of_latencies_ends_where_they_do(least_s, most_s, begin_s, ticks):
    (panel,) = panels(latency({"relay": (np.array([least_s, most_s]), np.array([0.1, 1.0]))}))
    assert (panel.x.low, panel.x.high) == pytest.approx((begin_s, 1.2 * most_s))
    shown = scales.ticks(panel.x, "x", (panel.x.low, panel.x.high), 400.0)
    assert [*shown.values()] == ticks
    assert all(begin_s <= tick <= 1.2 * most_s for tick in shown)


def test_a_long_label_is_broken_and_not_cut():
    values = "without kiruna / one more, opposite kiruna"
    given = {
        "attitude of the satellite: nadir, 60 deg about zenith": (
            "attitude of the satellite:\nnadir, 60 deg about zenith"
        ),
        "margin demanded of the laser link: 0 dB / 6 dB": "margin demanded of the laser link:\n0 dB / 6 dB",
        "orbit altitude: 400 km / 600 km": "orbit altitude: 400 km / 600 km",
        f"ground stations: {values}": f"ground stations:\n{values}",
        f"ground stations: {values}, far": f"ground stations:\n{values.replace('/ ', f'/{chr(10)}')}, far",
    }
    assert {label: in_lines(label) for label in given} == given
    figure = assumptions([Assumed(label, 4.0, 6.0) for label in given], 5.0, "ratio")
    assert {line for label in given.values() for line in label.split("\n")} <= set(texts(figure))
    assert set(figure.columns) >= {f"{label}, lower" for label in given}
    assert all(len(line) <= 44 for line in in_lines("word " * 50 + "y" * 99).split("\n"))


def test_the_first_is_on_top_and_the_last_are_left_to_the_table():
    many = [Assumed(f"input {k:02d}", 5.0 - 0.1 * k, 5.0 + 0.05 * k) for k in range(MOST_BARS + 3)]
    figure = assumptions(many, 5.0, "ratio")
    names = [text for text in texts(figure) if text.startswith("input")]
    assert names == [f"input {k:02d}" for k in range(MOST_BARS)]
    assert "3 more, which change less" in figure.caption
    assert figure.columns[f"input {MOST_BARS + 2}, higher"][0] == 5.0 + 0.05 * (MOST_BARS + 2)


def test_an_assumption_without_a_number_says_so():
    figure = assumptions([Assumed("rate", 1.0, 9.0), Assumed("stations", math.inf, math.nan)], 5.0, "ratio")
    assert "lower: without bound, higher: no value" in texts(figure)


def test_a_lone_large_error_does_not_flatten_the_others():
    t = np.arange(1.0, 40.0)
    rms = np.full(t.size, 1.5e-6)
    calm = texts(contact_run([("data", 0.0, 41.0)], Windows(t, rms, 3 * rms)))
    wild = texts(contact_run([("data", 0.0, 41.0)], Windows(t, rms, np.where(t == 7.0, 3e-4, 3 * rms))))
    assert "100" not in calm
    assert {"10", "100"} <= set(wild)


# ------------------------------------------------------------------------------------------------ map


def test_land_is_closed_rings_that_cover_what_land_covers():
    rings = land()
    share = 0.0
    for ring in rings:
        assert ring.shape[0] >= 4
        assert np.array_equal(ring[0], ring[-1])
        assert np.all(np.abs(ring) <= [180.0, 90.0])
        longitude, sine = np.radians(ring[:, 0]), np.sin(np.radians(ring[:, 1]))
        share -= np.sum(np.diff(longitude) * (sine[:-1] + sine[1:]) / 2.0) / (4.0 * np.pi)
    assert share == pytest.approx(0.292, abs=0.005)  # of the sphere; 148.9 of 510.1 million km²


@pytest.mark.parametrize(
    ("longitude", "latitude", "is_land"),
    [
        (10.0, 50.0, True),
        (134.0, -25.0, True),
        (-60.0, -10.0, True),
        (0.0, -85.0, True),
        (-179.0, -89.0, True),
        (178.0, 68.0, True),  # Chukotka on both sides of the date line
        (-175.0, 67.0, True),
        (50.5, 42.0, False),  # the Caspian Sea
        (0.0, 0.0, False),
        (-150.0, 0.0, False),
        (0.0, 85.0, False),
        (179.0, 0.0, False),
    ],
)
def test_land_lies_where_it_does(longitude, latitude, is_land):
    assert (winding(land(), longitude + 0.013, latitude + 0.017) != 0) == is_land


@pytest.mark.parametrize("inclination_deg", [0.0, 28.0, 51.6, 90.0, 97.4, 152.0])
def test_no_line_runs_across_the_map_where_the_track_leaves_it(inclination_deg):
    track = a_track(inclination_deg)
    longitude, latitude = track.degrees
    x, y = broken(longitude, latitude)
    steps = np.abs(np.diff(x))
    assert np.nanmax(steps) <= 60.0
    assert set(np.flatnonzero(np.isnan(x))) == set(np.flatnonzero(np.isnan(y)))
    for gap in np.flatnonzero(np.isnan(x)):
        over_a_pole = abs(y[gap - 1]) == 90.0
        assert y[gap - 1] == pytest.approx(y[gap + 1])
        assert over_a_pole or (abs(x[gap - 1]) == 180.0 and x[gap + 1] == -x[gap - 1])
    kept = [pair in {*zip(x.tolist(), y.tolist(), strict=True)} for pair in zip(longitude, latitude, strict=True)]
    assert all(kept)


def test_a_break_is_where_the_line_crosses_the_edge():
    x, y = broken(np.array([170.0, -175.0, -160.0]), np.array([10.0, 25.0, 30.0]))
    assert x == pytest.approx([170.0, 180.0, np.nan, -180.0, -175.0, -160.0], nan_ok=True)
    assert y == pytest.approx([10.0, 20.0, np.nan, 20.0, 25.0, 30.0], nan_ok=True)
    x, y = broken(np.array([-175.0, 170.0]), np.array([25.0, 10.0]))
    assert x == pytest.approx([-175.0, -180.0, np.nan, 180.0, 170.0], nan_ok=True)
    assert y == pytest.approx([25.0, 20.0, np.nan, 20.0, 10.0], nan_ok=True)
    x, y = broken(np.array([10.0, -170.0]), np.array([-89.0, -89.0]))
    assert y == pytest.approx([-89.0, -90.0, np.nan, -90.0, -89.0], nan_ok=True)
    x, _ = broken(np.array([1.0, np.nan, 3.0]), np.array([1.0, 2.0, 3.0]))
    assert x == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)


@pytest.mark.parametrize(
    ("latitude", "longitude", "radius"),
    [
        (0.0, 20.0, 103.0),  # a geostationary relay seen from above: the hidden region is about the antipode
        (0.0, 175.0, 103.0),
        (0.0, 175.0, 76.0),  # less than half of the Earth: the region seen crosses the date line
        (0.0, -60.0, 81.0),
        (52.0, 160.0, 100.0),  # about a pole, seen from north or south
        (-52.0, -170.0, 70.0),
        (78.2, 15.4, 18.0),
        (90.0, 0.0, 30.0),
    ],
)
def test_the_hidden_region_is_what_lies_beyond_the_outline(latitude, longitude, radius):
    each = marked(latitude, longitude, radius)
    rings = other_side(each)
    here = np.radians([latitude, longitude])
    compared = 0
    for y in np.arange(-88.5, 89.0, 11.0):
        for x in np.arange(-179.2, 180.0, 13.0):
            lat, lon = np.radians([y, x])
            cosine = np.sin(here[0]) * np.sin(lat) + np.cos(here[0]) * np.cos(lat) * np.cos(lon - here[1])
            away = math.degrees(math.acos(min(max(cosine, -1.0), 1.0))) - radius
            if abs(away) > 1.0:
                assert odd(rings, (x, y)) == (winding(rings, x, y) % 2 == 1) == (away > 0.0), (x, y)
                compared += 1
    assert compared > 400


# ------------------------------------------------------------------------------------------ limits of what is drawn
@pytest.mark.parametrize(
    ("largest", "log"), [(50.0, False), (50.1, True), (1.0, False), (math.nan, False), (0.0, False)]
)
def test_errors_are_on_a_logarithmic_axis_beyond_fifty_times_their_median(largest, log):
    one = np.ones(3)
    windows = Windows(np.arange(3.0), one, np.array([1.0, 1.0, largest]))
    panel = panels(contact_run([("data", 0.0, 9.0)], windows))[-1]
    assert panel.y.log is log
    assert panel.y.low == (None if log else 0.0)


def test_errors_that_are_all_nothing_are_on_a_linear_axis():
    none = np.zeros(3)
    panel = panels(contact_run([("data", 0.0, 9.0)], Windows(np.arange(3.0), none, none)))[-1]
    assert panel.y.log is False


@pytest.mark.parametrize(("doppler", "ruled"), [((-1.0, 1.0), 1), ((0.0, 1.0), 0), ((-1.0, 0.0), 0), ((1.0, 2.0), 0)])
def test_a_line_at_zero_is_drawn_where_a_curve_crosses_it(doppler, ruled):
    ones = np.ones(2)
    figure = along_contact(np.array([0.0, 60.0]), ones, ones, ones, np.array(doppler) * 1e9, **THIRD)
    assert [len(panel.all_of(Rule)) for panel in panels(figure)] == [0, 0, 0, ruled]
    assert (panels(figure)[0].x.low, panels(figure)[0].x.high) == (0.0, 1.0)
    at_once = along_contact(np.zeros(1), *[np.ones(1)] * 4, **THIRD)
    assert panels(at_once)[0].x.high == 1e-3


def test_a_volume_without_a_curve_since_the_start_or_with_an_empty_one_is_drawn():
    curve = np.array([3600.0, 7200.0]), np.array([0.0, 8e9])
    for cumulative, stored in (
        ({}, {"relay": curve}),
        ({"relay": curve}, {}),
        ({"none": (NOTHING, NOTHING), "relay": curve}, {}),
    ):
        figure = data_volume(cumulative, stored)
        above = panels(figure)[0]
        assert (above.x.low, above.x.high) == (1.0, 2.0)
        assert "volume (bit)" not in figure.columns
    assert set(data_volume({}, {}).columns) == {"time (s)", "volume (bit)"}


@pytest.mark.parametrize(("wanted", "found"), [(0.5, 2.0), (0.8, 3.0), (0.81, math.inf), (0.2, 1.0), (0.1, 1.0)])
def test_a_share_that_the_last_latency_just_reaches_is_reached(wanted, found):
    assert reached_s(np.array([1.0, 2.0, 3.0]), np.array([0.2, 0.5, 0.8]), wanted) == pytest.approx(found)
    assert reached_s(NOTHING, NOTHING, wanted) == math.inf


@pytest.mark.parametrize(
    ("value", "below"),
    [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.99, 2.0), (5.0, 5.0), (9.99, 5.0), (10.0, 10.0), (0.03, 0.02)],
)
def test_an_axis_begins_at_the_next_of_1_2_and_5(value, below):
    assert figures._round_below(value) == pytest.approx(below, rel=1e-12)


def test_lengths_of_time_at_both_ends_of_an_axis_are_marked():
    every = {"s": (1, 2, 5), "min": (1, 2)}
    assert figures._durations(every, 1.0, 120.0) == {1.0: "1 s", 2.0: "2 s", 5.0: "5 s", 60.0: "1 min", 120.0: "2 min"}
    assert figures._durations(every, 1.1, 119.0) == {2.0: "2 s", 5.0: "5 s", 60.0: "1 min"}


def some_swing(name, low, high, of_relay=1.0, of_optical=1.0):
    numbers = SimpleNamespace(ratio=2.0, relay_bit=8e12, optical_bit=16e12)
    both = {"at_low": numbers, "at_high": SimpleNamespace(ratio=4.0, relay_bit=16e12, optical_bit=32e12)}
    return SimpleNamespace(name=name, low=low, high=high, of_relay=of_relay, of_optical=of_optical, **both)


def test_the_assumptions_move_the_ratio_or_the_relays_volume_where_nothing_else_comes_down():
    swings = [some_swing("a", "1", figures.NOTHING, 1.5), some_swing("b", "1", "2", 2.0)]
    swings += [some_swing("c", figures.NOTHING, figures.NOTHING, 1.1, 3.0)]
    relay = SimpleNamespace(capacity_bit=24e12)
    day = SimpleNamespace(swings=swings, direct=object(), ratio=3.0, relay=relay, view=SimpleNamespace(partner="relay"))
    both = figures._assumptions_figure(day)
    assert [*both.columns][:4] == ["as assumed", "b: 1 / 2, lower", "a: 1, lower", "c, lower"]
    assert [column[0] for column in both.columns.values()] == [3.0, *[2.0] * 3, *[4.0] * 3]
    assert both.caption.startswith("Volume by relay over volume direct: ")
    day.direct = None
    alone = figures._assumptions_figure(day)
    assert [column[0] for column in alone.columns.values()] == [3.0, *[1.0] * 3, *[2.0] * 3]
    assert alone.caption.startswith("Volume by the relay (TB): ")
    optical = figures._optical_figure(day, SimpleNamespace(capacity_bit=8e12))
    assert {key: column[0] for key, column in optical.columns.items()} == {
        "as assumed": 1.0, "c, lower": 2.0, "c, higher": 4.0
    }  # fmt: skip


def test_a_state_that_takes_no_time_has_no_bar():
    log = [SimpleNamespace(to=to, time_s=at) for to, at in (("slew", 10.0), ("beacon", 10.0), ("data", 12.0))]
    log.append(SimpleNamespace(to="idle", time_s=15.0))
    window = SimpleNamespace(start_s=12.0, seconds=1.0, rms_rad=1e-6, largest_rad=3e-6)
    run = SimpleNamespace(contact=SimpleNamespace(start_s=10.0), log=log, windows=[window])
    asked = SimpleNamespace(requirement=SimpleNamespace(pointing_error_rad=10e-6))
    found = figures._contact_run_figure(SimpleNamespace(data=asked), run)
    assert not any("slew" in text for text in texts(found))
    assert "required: 10 µrad" in texts(found)
    assert panels(found)[-1].all_of(Line)[0].x == pytest.approx([2.5 / 60.0])


@pytest.mark.parametrize(
    ("value", "sides", "said"),
    [(0, "WE", "0°"), (180, "WE", "180°"), (-180, "WE", "180°"), (60.5, "WE", "60.5° E"), (-60, "WE", "60° W")],
)
def test_an_angle_on_the_map_names_its_side(value, sides, said):
    assert world._degrees(value, sides) == said


def test_a_line_along_a_meridian_over_the_equator_is_no_line_over_a_pole():
    x, y = broken(np.array([0.0, 120.0]), np.array([10.0, -10.0]))
    assert x.tolist() == [0.0, 120.0] and y.tolist() == [10.0, -10.0]
    x, y = broken(np.array([-90.0, 90.0]), np.array([0.0, 10.0]))
    assert not np.isnan(x).any()
    x, y = broken(np.array([180.0, -180.0]), np.array([5.0, 7.0]))  # one place, named twice
    assert x[1] == 180.0 and np.isnan(x[2]) and x[3] == -180.0
    assert y[1] == y[3] == 5.0


def test_curves_of_several_ways_share_an_axis_and_the_unit_of_the_largest():
    small = np.array([7200.0, 10800.0]), np.array([0.0, 8e9])
    large = np.array([0.0, 3600.0]), np.array([0.0, 80e9])
    for curves in ({"a": small, "b": large}, {"b": large, "a": small}):
        above, below = panels(data_volume(curves, {"a": small}))
        assert above.y.title == "since the start (GB)"
        assert {line.label: line.y[-1] for line in above.all_of(Line)} == {
            "a": pytest.approx(1.0),
            "b": pytest.approx(10.0),
        }
        assert (above.x.low, above.x.high, above.y.low) == (0.0, 3.0, pytest.approx(-0.2))
        assert (below.x.low, below.x.high, below.y.low) == (0.0, 3.0, pytest.approx(-0.02))
    none = data_volume({"a": (small[0], np.zeros(2))}, {})
    assert [panel.y.low for panel in panels(none)] == [-0.02, -0.02]


def test_a_share_that_is_not_reached_has_no_mark():
    curves = {"relay": (np.array([1.0, 2.0]), np.array([0.25, 0.75])), "none": (np.array([0.0]), np.array([1.0]))}
    (panel,) = panels(latency({"relay": curves["relay"]}))
    marked_ = [(line.marker, line.x[0], line.y[0]) for line in panel.all_of(Line) if line.marker]
    assert marked_ == [("o", pytest.approx(1.5), 50.0)]
    assert panel.all_of(Line)[0].label == f"relay: median {duration(1.5)}, 75 % arrive"
    (panel,) = panels(latency({"relay": (np.array([1.0, 2.0]), np.array([0.2, 0.4]))}))
    assert panel.all_of(Line)[0].label == "relay: 40 % arrive"
    assert not [line for line in panel.all_of(Line) if line.marker]
    assert "nothing was delivered" in texts(latency({"none": curves["none"]}))
    assert "nothing was delivered" in texts(latency({"none": (np.array([1.0]), np.array([0.0]))}))
    assert set(latency({}).columns) == {"latency (s)", "share"}


def test_three_wide_ticks_are_too_few_and_four_enough():
    def ticks(least_s, most_s):
        return [*panels(latency({"a": (np.array([least_s, most_s]), np.array([0.1, 1.0]))}))[0].x.ticks.values()]

    assert ticks(2.0, 400.0) == ["1 s", "2 s", "5 s", "10 s", "20 s", "30 s", "1 min", "2 min", "5 min"]
    assert ticks(2.0, 500.0) == ["1 s", "10 s", "1 min", "10 min"]


def test_as_many_assumptions_as_there_is_room_for_leave_none_to_the_data():
    for count, said in ((MOST_BARS, False), (MOST_BARS + 1, True)):
        figure = assumptions([Assumed(f"a{k}", 1.0, 2.0) for k in range(count)], 1.5, "ratio")
        assert ("1 more, which change less, are in the data only." in figure.caption) is said
    assert "ratio: no finite value" in texts(assumptions([Assumed("a", 1.0, 2.0)], math.inf, "ratio"))
    assert "no assumption was varied" in texts(assumptions([], 1.0, "ratio"))


def test_a_row_without_intervals_says_none_and_an_empty_timeline_has_its_columns():
    figure = timeline([("relay", np.empty((0, 2))), ("direct: a", np.array([[0.0, 600.0]]))], SPAN_S, EPOCH)
    words_ = [mark.text for mark in panels(figure)[0].marks if hasattr(mark, "text")]
    assert words_ == ["none", f"1 · {duration(600.0)}"]
    assert set(figure.columns) == {f"{name}, {end} (s)" for name in ("relay", "direct: a") for end in ("start", "end")}
    assert set(timeline([], SPAN_S, EPOCH).columns) == {"start (s)", "end (s)"}


@pytest.mark.parametrize(("end_h", "step_h"), [(12.0, 1.0), (12.1, 2.0), (24.0, 2.0), (24.1, 3.0)])
def test_hours_are_marked_about_a_dozen_times(end_h, step_h):
    assert figures._hours(0.0, 3600.0 * end_h)[1] == step_h


def test_a_state_of_no_known_name_has_a_colour_that_no_state_has():
    states = [("data", 0.0, 10.0), ("other", 10.0, 20.0), ("third", 20.0, 30.0)]
    above = panels(contact_run(states, Windows(NOTHING, NOTHING, NOTHING)))[0]
    known, other, third = (bars.colour for bars in above.all_of(Bars))
    assert known == figures._STATES["data"]
    assert not {other, third} & set(figures._STATES.values()) and other != third
    assert (above.x.low, above.x.high) == (0.0, 0.5)


def a_log_and_view(**changes):
    view = SimpleNamespace(
        encounters=[SimpleNamespace(contact=SimpleNamespace(start_s=float(k))) for k in range(3)],
        pair=SimpleNamespace(
            leo=SimpleNamespace(orbit=0),
            geo=SimpleNamespace(orbit=0),
            epoch=SimpleNamespace(utc=lambda at: f"{at:.0f}T"),
        ),
    )
    data = SimpleNamespace(table=SimpleNamespace(wavelength_m=1.0))
    return SimpleNamespace(**{"view": view, "data": data} | changes)


@pytest.mark.parametrize(
    ("operations", "number"),
    [
        (None, 1),
        (SimpleNamespace(contact=None), 1),
        (SimpleNamespace(contact=SimpleNamespace(number=3)), 3),
    ],
)
def test_the_contact_drawn_is_the_one_the_mission_names_or_the_first(monkeypatch, operations, number):
    seen = SimpleNamespace(
        time_s=np.array([10.0]), range_m=1, point_ahead_rad=2, rate_rad_s=3, doppler_hz=lambda wavelength_m: 4
    )
    monkeypatch.setattr(figures.orbit, "sight", lambda *of: seen)
    monkeypatch.setattr(figures, "times", lambda contact: None)
    monkeypatch.setattr(figures, "along_contact", lambda *of, number, rise_utc: (of, number, rise_utc))
    ((of, drawn, rise),) = figures._along_figure(a_log_and_view(operations=operations))
    assert (drawn, rise, of[1:]) == (number, f"{number - 1} ", (1, 2, 3, 4))
    assert of[0] == [10.0 - (number - 1)]
    none = a_log_and_view(operations=operations)
    none.view.encounters = []
    assert figures._along_figure(none) == []


def array(*values):
    return np.array(values, dtype=np.float64)


# ------------------------------------------------------------------------------------------------ figures as a whole
def test_a_timeline_of_three_kinds_has_every_bar_colour_sum_and_round_hour():
    rows = [("relay", array([0, 600], [7200, 9000])), ("direct: a", array([3600, 3900])), ("eclipse", array([5, 4205]))]
    rows.insert(2, ("direct: b", np.empty((0, 2))))
    assert figure_of(timeline(rows, (1800.0, 12600.0), EPOCH)) == [
        "day-timeline",
        "Contacts over time",
        (
            "From 0.5 h to 3.5 h after 2026-03-20T12:00:00Z. At the right of each row: how "
            "many intervals, and how long they are together."
        ),
        {
            "relay, start (s)": [0.0, 7200.0],
            "relay, end (s)": [600.0, 9000.0],
            "direct: a, start (s)": [3600.0],
            "direct: a, end (s)": [3900.0],
            "direct: b, start (s)": [],
            "direct: b, end (s)": [],
            "eclipse, start (s)": [5.0],
            "eclipse, end (s)": [4205.0],
        },
        "Sheet width=7.6 height=1.88",
        ("Panel 0 0 x=<title=hours since 2026-03-20T12:00:00Z low=0.5 high=3.5 ticks=[0.5 0.75 1 1.25 1.5"),
        "  1.75 2 2.25 2.5 2.75 3 3.25 3.5]> y=<low=3.6 high=-0.6 ticks={0: relay, 1: direct: a, 2:",
        "  direct: b, 3: eclipse} grid=False>",
        ("Bars at=[0 0] start=[0 2] end=[0.166667 2.5] breadth=[0.68 0.68] colour=#0072B2 edge=#0072B2"),
        "Words text=2 · 40 min x=1 y=0 size=9 shift=[5 0] of_panel=x",
        "Bars at=[1] start=[1] end=[1.08333] breadth=[0.68] colour=#E69F00 edge=#E69F00",
        "Words text=1 · 5 min x=1 y=1 size=9 shift=[5 0] of_panel=x",
        "Bars at=[] start=[] end=[] breadth=[] colour=#E69F00 edge=#E69F00",
        "Words text=none x=1 y=2 colour=#777777 size=9 shift=[5 0] of_panel=x",
        "Bars at=[3] start=[0.00138889] end=[1.16806] breadth=[0.68] colour=#009E73 edge=#009E73",
        "Words text=1 · 70 min x=1 y=3 size=9 shift=[5 0] of_panel=x",
    ]


def test_a_contact_in_time_has_a_row_for_each_state_and_both_errors():
    states = [("slew", 0.0, 60.0), ("data", 60.0, 600.0), ("loss", 600.0, 630.0), ("beacon", 630.0, 690.0)]
    states += [("lock", 690.0, 700.0), ("data", 700.0, 900.0)]
    windows = Windows(array(90, 300), array(1.5e-6, 2e-6), array(4e-6, 6e-6))
    assert figure_of(contact_run(states, windows, 2.5e-6)) == [
        "contact-run",
        "A contact, simulated",
        (
            "States of the terminal, one row each; at the right how often and how long in all. "
            "Below: radial pointing error in the windows that were simulated in full."
        ),
        {
            "slew, start (s)": [0.0],
            "data, start (s)": [60.0, 700.0],
            "loss, start (s)": [600.0],
            "beacon, start (s)": [630.0],
            "lock, start (s)": [690.0],
            "slew, end (s)": [60.0],
            "data, end (s)": [600.0, 900.0],
            "loss, end (s)": [630.0],
            "beacon, end (s)": [690.0],
            "lock, end (s)": [700.0],
            "window (s)": [90.0, 300.0],
            "rms (rad)": [1.5e-06, 2e-06],
            "largest (rad)": [4e-06, 6e-06],
        },
        "Sheet width=7.6 height=4.2 heights=[1.2 1.7] share_x=True legend=<place=below columns=3>",
        ("Panel 0 0 x=<low=0 high=15> y=<low=4.6 high=-0.6 ticks={0: slew, 1: data, 2: loss, 3: beacon, 4:"),
        "  lock} grid=False>",
        "Bars at=[0] start=[0] end=[1] breadth=[0.68] colour=#E69F00 edge=#E69F00",
        "Words text=1 · 60 s x=1 y=0 size=9 shift=[5 0] of_panel=x",
        ("Bars at=[1 1] start=[1 11.6667] end=[10 15] breadth=[0.68 0.68] colour=#0072B2 edge=#0072B2"),
        "Words text=2 · 12.3 min x=1 y=1 size=9 shift=[5 0] of_panel=x",
        "Bars at=[2] start=[10] end=[10.5] breadth=[0.68] colour=#D55E00 edge=#D55E00",
        "Words text=1 · 30 s x=1 y=2 size=9 shift=[5 0] of_panel=x",
        "Bars at=[3] start=[10.5] end=[11.5] breadth=[0.68] colour=#009E73 edge=#009E73",
        "Words text=1 · 60 s x=1 y=3 size=9 shift=[5 0] of_panel=x",
        "Bars at=[4] start=[11.5] end=[11.6667] breadth=[0.68] colour=#56B4E9 edge=#56B4E9",
        "Words text=1 · 10 s x=1 y=4 size=9 shift=[5 0] of_panel=x",
        ("Panel 1 0 x=<title=time since the start of the contact (min) low=0 high=15> y=<title=radial"),
        "  error (µrad) low=0>",
        "Line x=[1.5 5] y=[4 6] colour=#D55E00 dash= label=largest marker=^ size=4.5 clip=False",
        "Line x=[1.5 5] y=[1.5 2] colour=#0072B2 dash= label=rms marker=o size=4.5 clip=False",
        "Rule at=2.5 upright=False dash=-- label=required: 2.5 µrad",
    ]


def test_along_a_contact_each_panel_has_its_own_values_and_a_rule_where_they_change_their_sign():
    found = array(0, 60, 180), array(1e6, 2e6, 1.5e6), array(1e-5, 2e-5, 4e-5), array(1e-4, 3e-4, 2e-4)
    assert figure_of(along_contact(*found, array(4e9, 1e9, -2e9), number=4, rise_utc="a time")) == [
        "along-contact",
        "Along contact 4",
        (
            "Range, point-ahead angle, inertial rate of the line of sight and Doppler shift "
            "over contact 4, which rises at a time UTC."
        ),
        {
            "time since rise (s)": [0.0, 60.0, 180.0],
            "range (m)": [1000000.0, 2000000.0, 1500000.0],
            "point-ahead (rad)": [1e-05, 2e-05, 4e-05],
            "line-of-sight rate (rad/s)": [0.0001, 0.0003, 0.0002],
            "Doppler (Hz)": [4000000000.0, 1000000000.0, -2000000000.0],
        },
        "Sheet width=7.6 height=4.4 heights=[1 1] widths=[1 1] share_x=True",
        "Panel 0 0 x=<low=0 high=3> y=<title=range (km)>",
        "Line x=[0 1 3] y=[1000 2000 1500] colour=#0072B2",
        "Panel 0 1 x=<low=0 high=3> y=<title=point-ahead angle (µrad)>",
        "Line x=[0 1 3] y=[10 20 40] colour=#0072B2",
        ("Panel 1 0 x=<title=time since rise (min) low=0 high=3> y=<title=line-of-sight rate (µrad/s)>"),
        "Line x=[0 1 3] y=[100 300 200] colour=#0072B2",
        "Panel 1 1 x=<title=time since rise (min) low=0 high=3> y=<title=Doppler shift (GHz)>",
        "Line x=[0 1 3] y=[4 1 -2] colour=#0072B2",
        "Rule at=0 upright=False colour=#777777 width=0.8",
    ]


def test_volumes_of_other_sizes_and_spans_have_their_units_colours_and_limits():
    cumulative = {"made": (array(3600, 7200), array(8e9, 16e9)), "relay": (array(1800, 9000), array(0, 24e9))}
    stored = {"relay": (array(3600, 9000), array(4e6, 2e6)), "direct": (array(3600, 5400), array(0, 8e6))}
    assert figure_of(data_volume(cumulative, stored)) == [
        "data-volume",
        "Data generated, delivered and stored",
        (
            "Above: data generated and delivered since the start. Below: what waits on board "
            "for its way down. Behind the mission's span nothing more is generated, and what "
            "waits is still delivered."
        ),
        {
            "made, since the start, time (s)": [3600.0, 7200.0],
            "made, since the start (bit)": [8000000000.0, 16000000000.0],
            "relay, since the start, time (s)": [1800.0, 9000.0],
            "relay, since the start (bit)": [0.0, 24000000000.0],
            "relay, stored, time (s)": [3600.0, 9000.0],
            "relay, stored (bit)": [4000000.0, 2000000.0],
            "direct, stored, time (s)": [3600.0, 5400.0],
            "direct, stored (bit)": [0.0, 8000000.0],
        },
        "Sheet width=7.6 height=4.8 heights=[1.4 1] share_x=True legend=<place=above columns=4>",
        ("Panel 0 0 x=<low=0.5 high=2.5 ticks=[0.5 0.75 1 1.25 1.5 1.75 2 2.25 2.5]> y=<title=since the"),
        "  start (GB) low=-0.06>",
        "Line x=[1 2] y=[1 2] width=1.5 label=made",
        "Line x=[0.5 2.5] y=[0 3] colour=#0072B2 dash=-- width=1.5 label=relay",
        "Panel 1 0 x=<title=time (h) low=0.5 high=2.5 ticks=[0.5 0.75 1 1.25 1.5 1.75 2 2.25 2.5]>",
        "  y=<title=stored on board (MB) low=-0.02>",
        "Line x=[1 2.5] y=[0.5 0.25] colour=#0072B2 dash=-- width=1.5 label=relay",
        "Line x=[1 1.5] y=[0 1] colour=#E69F00 dash=-. width=1.5 label=direct",
    ]


def test_latencies_of_three_ways_say_what_each_of_them_reaches():
    curves = {
        "relay": (array(10, 20, 40, 80), array(0.25, 0.5, 0.75, 1.0)),
        "direct": (array(0, 600, 1200), array(0, 0.5, 0.75)),
        "optical": (array(100, 200), array(0.2, 0.4)),
    }
    assert figure_of(latency(curves)) == [
        "latency",
        "From recording to delivery",
        ("Share of the data that has arrived within a time after it was recorded. Circle: median. Diamond: 99 %."),
        {
            "relay, latency (s)": [10.0, 20.0, 40.0, 80.0],
            "relay, share": [0.25, 0.5, 0.75, 1.0],
            "direct, latency (s)": [0.0, 600.0, 1200.0],
            "direct, share": [0.0, 0.5, 0.75],
            "optical, latency (s)": [100.0, 200.0],
            "optical, share": [0.2, 0.4],
        },
        "Sheet width=7.6 height=3.6 legend=<place=above>",
        ("Panel 0 0 x=<title=time from recording to delivery log=True low=5 high=1440 ticks={5: 5 s, 10:"),
        "  10 s, 20: 20 s, 30: 30 s, 60: 1 min, 120: 2 min, 300: 5 min, 600: 10 min, 1200: 20 min}>",
        "  y=<title=share of the data (%) low=0 high=101>",
        "Rule at=50 upright=False colour=#777777 dash=: width=0.7",
        "Rule at=99 upright=False colour=#777777 dash=: width=0.7",
        ("Line x=[10 20 40 80] y=[25 50 75 100] colour=#0072B2 dash=-- width=1.5 label=relay: median 20 s,"),
        "  99 % 78.4 s",
        "Line x=[20] y=[50] colour=#0072B2 dash= marker=o clip=False",
        "Line x=[78.4] y=[99] colour=#0072B2 dash= marker=D clip=False",
        ("Line x=[0 600 1200] y=[0 50 75] colour=#E69F00 dash=-. width=1.5 label=direct: median 10 min, 75"),
        "  % arrive",
        "Line x=[600] y=[50] colour=#E69F00 dash= marker=o clip=False",
        "Line x=[100 200] y=[20 40] colour=#009E73 dash=: width=1.5 label=optical: 40 % arrive",
    ]


def test_assumptions_without_bound_and_without_value_stand_among_others():
    swings = [Assumed("rate: 1 / 2", 12.0, 5.0), Assumed("b", math.inf, 7.0), Assumed("c", math.nan, 6.0)]
    assert figure_of(assumptions(swings, 8.0, "volume (TB)")) == [
        "assumptions",
        "What the assumptions decide",
        "Volume (TB): one assumption at a time at its lower and at its higher value.",
        {
            "as assumed": [8.0],
            "rate: 1 / 2, lower": [12.0],
            "b, lower": ["inf"],
            "c, lower": ["nan"],
            "rate: 1 / 2, higher": [5.0],
            "b, higher": [7.0],
            "c, higher": [6.0],
        },
        "Sheet width=7.6 height=1.81 legend=<place=above columns=2 only=[<rings=[] colour=#E69F00",
        "  label=assumption lower> <rings=[] colour=#0072B2 label=assumption higher>]>",
        ("Panel 0 0 x=<title=volume (TB); as assumed: 8> y=<low=2.6 high=-0.6 ticks={0: rate: 1 / 2, 1: b,"),
        "  2: c} grid=False size=8>",
        "Bars at=[0] start=[8] end=[12] breadth=[0.7] colour=#E69F00",
        "Bars at=[0] start=[8] end=[5] breadth=[0.7] colour=#0072B2",
        "Words text= x=1 y=0 colour=#777777 shift=[5 0] of_panel=x",
        "Bars at=[1] start=[8] end=[13.6] breadth=[0.7] colour=#E69F00 opacity=0.5",
        "Bars at=[1] start=[8] end=[7] breadth=[0.7] colour=#0072B2",
        "Words text=lower: without bound x=1 y=1 colour=#777777 shift=[5 0] of_panel=x",
        "Bars at=[2] start=[8] end=[6] breadth=[0.7] colour=#0072B2",
        "Words text=lower: no value x=1 y=2 colour=#777777 shift=[5 0] of_panel=x",
        "Rule at=8 upright=True width=0.8",
    ]


def test_a_map_with_two_of_each_has_its_lines_names_and_entries():
    def place(*degrees):
        return Places(*np.radians(np.reshape(degrees, (2, -1))))

    track = place(10, 30, 60, 20, 170, 175, -170, -100)
    contact = {"relay": np.array([True, False, True, True]), "direct": np.array([False] * 4)}
    ring = place(10, 20, 20, 10, 10, -20, -20, 0, 0, -20)
    moving, still = Marked(place(1, 2, 3, 4), NO_PLACES), Marked(place(0, 130), NO_PLACES)
    stations = {"s": Marked(place(15, -10), ring), "t": Marked(place(-50, 60), NO_PLACES)}
    figure = world_map(track, contact, {"M": moving, "G": still}, stations, 7200.0)
    del figure.sheet.panels[0].marks[0]  # the coasts
    assert figure_of(figure) == [
        "world-map",
        "Ground track, relays and stations",
        (
            "Ground track of the satellite in the first 2 h of the span, thick where it is in "
            "contact. The relay moves: marked where it is at the start, with its own ground "
            "track as a thin line. Inside a station's circle the satellite is above the lowest "
            "elevation of that station. Land: Natural Earth."
        ),
        {
            "track, latitude (deg)": [10.0, 30.0, 60.0, 20.0],
            "track, longitude (deg)": [170.0, 175.0, -170.0, -100.0],
            "in contact: relay": [1.0, 0.0, 1.0, 1.0],
            "in contact: direct": [0.0, 0.0, 0.0, 0.0],
            "M, latitude (deg)": [1.0, 2.0],
            "M, longitude (deg)": [3.0, 4.0],
            "M, outline, latitude (deg)": [],
            "M, outline, longitude (deg)": [],
            "G, latitude (deg)": [0.0],
            "G, longitude (deg)": [130.0],
            "G, outline, latitude (deg)": [],
            "G, outline, longitude (deg)": [],
            "s, latitude (deg)": [15.0],
            "s, longitude (deg)": [-10.0],
            "s, outline, latitude (deg)": [10.0, 20.0, 20.0, 10.0, 10.0],
            "s, outline, longitude (deg)": [-20.0, -20.0, 0.0, 0.0, -20.0],
            "t, latitude (deg)": [-50.0],
            "t, longitude (deg)": [60.0],
            "t, outline, latitude (deg)": [],
            "t, outline, longitude (deg)": [],
        },
        ("Sheet width=7.6 height=4.6 legend=<place=below columns=3 only=[<x=[170 nan -170 -100] y=[10 30"),
        "  60 20] colour=#56B4E9 width=3.4 label=relay> <x=[nan nan nan nan] y=[10 30 60 20]",
        ("  colour=#E69F00 width=2.4 label=direct: none> <x=[170 175 180 nan -180 -170 -100] y=[10 30 40"),
        ("  nan 40 60 20] width=0.5 label=ground track> <x=[170] y=[10] dash= label=start marker=o size=4>"),
        "  <x=[] y=[] colour=#0072B2 width=0.7 label=relay at the start, its track marker=D size=7",
        "  edge=#ffffff> <x=[] y=[] colour=#0072B2 dash= width=1 label=relay marker=D size=7",
        ("  edge=#ffffff> <x=[] y=[] colour=#D55E00 width=1 label=station, its horizon marker=^ size=7"),
        "  edge=#ffffff> <x=[] y=[] colour=#D55E00 dash= width=1 label=station marker=^ size=7",
        "  edge=#ffffff>]>",
        ("Panel 0 0 x=<low=-180 high=180 ticks={-180: 180°, -120: 120° W, -60: 60° W, 0: 0°, 60: 60° E,"),
        ("  120: 120° E, 180: 180°}> y=<low=-90 high=90 ticks={-90: 90° S, -60: 60° S, -30: 30° S, 0: 0°,"),
        "  30: 30° N, 60: 60° N, 90: 90° N}> framed=True equal=True",
        "Line x=[170 nan -170 -100] y=[10 30 60 20] colour=#56B4E9 width=3.4 label=relay",
        "Line x=[nan nan nan nan] y=[10 30 60 20] colour=#E69F00 width=2.4 label=direct: none",
        ("Line x=[170 175 180 nan -180 -170 -100] y=[10 30 40 nan 40 60 20] width=0.5 label=ground track"),
        "Line x=[170] y=[10] dash= label=start marker=o size=4",
        "Line x=[] y=[] colour=#0072B2 dash=-- width=1",
        "Line x=[3 4] y=[1 2] colour=#0072B2 width=0.7",
        "Line x=[3] y=[1] colour=#0072B2 dash= marker=D size=7 edge=#ffffff clip=False",
        "Words text=M x=3 y=1 shift=[6 0] box=True",
        "Line x=[] y=[] colour=#0072B2 dash=-- width=1",
        "Line x=[130] y=[0] colour=#0072B2 width=0.7",
        "Line x=[130] y=[0] colour=#0072B2 dash= marker=D size=7 edge=#ffffff clip=False",
        "Words text=G x=130 y=0 anchor=end shift=[-6 0] box=True",
        "Line x=[-20 -20 0 0 -20] y=[10 20 20 10 10] colour=#D55E00 width=1",
        "Line x=[-10] y=[15] colour=#D55E00 width=0.7",
        "Line x=[-10] y=[15] colour=#D55E00 dash= marker=^ size=7 edge=#ffffff clip=False",
        "Words text=s x=-10 y=15 shift=[6 0] box=True",
        "Line x=[] y=[] colour=#D55E00 width=1",
        "Line x=[60] y=[-50] colour=#D55E00 width=0.7",
        "Line x=[60] y=[-50] colour=#D55E00 dash= marker=^ size=7 edge=#ffffff clip=False",
        "Words text=t x=60 y=-50 shift=[6 0] box=True",
    ]


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ((170, 0, -170, 10), ([170, 180, math.nan, -180, -170], [0, 5, math.nan, 5, 10])),
        ((-175, -20, 170, 10), ([-175, -180, math.nan, 180, 170], [-20, -10, math.nan, -10, 10])),
        ((10, 80, -170, 85), ([10, 10, math.nan, -170, -170], [80, 90, math.nan, 90, 85])),
        ((100, -85, -70, -80), ([100, 100, math.nan, -70, -70], [-85, -90, math.nan, -90, -80])),
    ],
)
def test_a_track_is_broken_at_either_edge_and_over_either_pole(points, said):
    x, y = broken(array(points[0], points[2]), array(points[1], points[3]))
    np.testing.assert_allclose((x, y), said, rtol=1e-9)


@pytest.mark.parametrize(
    ("value", "below"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.99, 2.0), (5.0, 5.0), (0.07, 0.05), (720.0, 500.0)]
)
def test_an_axis_begins_at_1_2_or_5_times_a_power_of_ten(value, below):
    assert figures._round_below(value) == pytest.approx(below, rel=1e-12)


@pytest.mark.parametrize(
    ("end_s", "hours"),
    [(4320.0, 0.1), (10800.0, 0.25), (43200.0, 1.0), (46800.0, 2.0), (2073600.0, 48.0), (8640000.0, 240.0)],
)
def test_hours_of_a_span_are_a_round_step_apart_from_a_begin_that_is_none(end_s, hours):
    found = figures._hours(180.0, 180.0 + end_s)
    assert np.diff(found) == pytest.approx(hours)
    assert 0.05 <= found[0] <= 0.05 + hours and found[-1] > 0.05 + end_s / 3600.0 - hours


@pytest.mark.parametrize(
    ("point", "inside"),
    [((2, 1), True), ((0.5, 1), False), ((1.5, 2), True), ((3.6, 1), False), ((2.6, 1), True), ((2.1, 2.9), False)],
)
def test_a_point_beside_slanted_edges_is_inside_of_them_or_not(point, inside):
    """At a height y the triangle reaches from 2 y / 3 to 4 - 2 y / 3."""
    ring = np.array([(0.0, 0.0), (4.0, 0.0), (2.0, 3.0), (0.0, 0.0)])
    assert odd([ring], point) is odd([ring[::-1]], point) is inside


def test_a_row_of_the_timeline_has_all_contacts_of_its_station_and_ends_with_the_span(monkeypatch):
    """Passes of two stations follow each other in turn; one name is that of an optical station, too."""
    monkeypatch.setattr(figures, "timeline", lambda rows, span, epoch: (dict(rows), [name for name, _ in rows], epoch))

    def of(name, ends, stations=()):
        contacts = tuple(SimpleNamespace(start_s=end - 50.0, end_s=end) for end in ends)
        return SimpleNamespace(name=name, contacts=contacts, stations=stations)

    pair = SimpleNamespace(
        span_s=(0.0, 1000.0), leo=SimpleNamespace(name="LOW"), epoch=SimpleNamespace(text="an epoch")
    )
    day = SimpleNamespace(
        view=SimpleNamespace(pair=pair, umbra_s="eclipses"),
        relay=of("relay", (100.0, 1020.0)),
        direct=of("direct downlink", (200.0, 300.0, 400.0, 1049.0), ("b", "a", "b", "a")),
        optical=of("optical downlink", (500.0, 600.0), ("a", "a")),
    )
    rows, names, epoch = figures.contacts_figure(day)
    assert (names, epoch) == (["relay", "direct: b", "direct: a", "optical: a", "eclipse of LOW"], "an epoch")
    assert rows["relay"].tolist() == [[50.0, 100.0], [970.0, 1000.0]]
    assert rows["direct: b"].tolist() == [[150.0, 200.0], [350.0, 400.0]]
    assert rows["direct: a"].tolist() == [[250.0, 300.0], [999.0, 1000.0]]
    assert rows["optical: a"].tolist() == [[450.0, 500.0], [550.0, 600.0]]
    assert rows["eclipse of LOW"] == "eclipses"
    day.direct = day.optical = None
    assert figures.contacts_figure(day)[1] == ["relay", "eclipse of LOW"]


def test_a_distribution_of_many_bends_is_drawn_at_some_of_them_from_the_first_to_the_last():
    """Of 1201 bends every third, each from just before it, and as many points evenly between."""
    bends = np.linspace(10.0, 1210.0, 1201)
    given = SimpleNamespace(first_s=bends[::2], last_s=bends[::-2], cdf=lambda at: (at - 10.0) / 1200.0)
    given.first_s = np.concatenate([bends[::2], bends[1::2]])
    latency_s, share = figures._distribution(SimpleNamespace(latency=given))
    assert latency_s.size <= 2 * 401 + figures._SHARES
    assert set(bends[::3]) <= set(latency_s) and bends[1] not in latency_s
    assert latency_s[0] == pytest.approx(10.0, rel=1e-8) and latency_s[-1] == 1210.0
    assert share.tolist() == given.cdf(latency_s).tolist()
    none = SimpleNamespace(first_s=NOTHING, last_s=NOTHING)
    assert [each.size for each in figures._distribution(SimpleNamespace(latency=none))] == [0, 0]


def test_the_volumes_of_all_ways_stand_beside_what_is_made_and_theirs_alone_is_stored(monkeypatch):
    monkeypatch.setattr(figures, "data_volume", lambda cumulative, stored: (cumulative, stored))

    def of(name):
        kinds = ("time_s", "generated_bit", "delivered_bit", "stored_bit")
        return SimpleNamespace(name=name, history=SimpleNamespace(**{kind: f"{name} {kind}" for kind in kinds}))

    ways = [of("relay"), of("optical downlink"), of("direct downlink")]
    cumulative, stored = figures._volume_figure(SimpleNamespace(relay=ways[0], ways=ways))
    assert list(cumulative.items()) == [
        ("made by the instrument", ("relay time_s", "relay generated_bit")),
        *((way.name, (f"{way.name} time_s", f"{way.name} delivered_bit")) for way in ways),
    ]
    assert list(stored.items()) == [(way.name, (f"{way.name} time_s", f"{way.name} stored_bit")) for way in ways]


@pytest.mark.parametrize("days", [1.0, 3.0])
def test_the_map_of_a_day_takes_its_stations_from_both_tables_and_says_where_it_ends(monkeypatch, days):
    seen = []
    here = SimpleNamespace(latitude_rad=np.array([0.5]), longitude_rad=np.array([0.25]))
    around = {"around_latitude_rad": np.array([0.1, 0.2]), "around_longitude_rad": np.array([0.3, 0.4])}
    relay, *stations = (SimpleNamespace(name=name, **vars(here), **around) for name in ("HUB", "b", "a"))
    track = SimpleNamespace(**vars(here), relay=relay, stations=stations, open={"relay": "flags"})
    monkeypatch.setattr(figures, "ground_track", lambda *given: seen.append(given) or track)
    monkeypatch.setattr(figures, "world_map", lambda *given: given)
    view = SimpleNamespace(duration_s=days * figures.LONGEST_S / 2.0)
    day = SimpleNamespace(view=view, ways="ways", operations=SimpleNamespace(downlink="radio", optical="light"))
    places, contact, relays, shown, first_s = figures.ground_map(day)
    assert seen == [(view, "ways", "radio", "light")]
    assert (contact, list(relays), list(shown)) == (track.open, ["HUB"], ["b", "a"])
    assert first_s == (figures.LONGEST_S if days > 2.0 else None)
    assert [places.latitude_rad[0], places.longitude_rad[0]] == [0.5, 0.25]
    assert shown["a"].outline.longitude_rad.tolist() == [0.3, 0.4]
    view.duration_s, track.relay, day.operations = figures.LONGEST_S, None, None
    assert figures.ground_map(day)[2::2] == ({}, None)
    assert seen[-1] == (view, "ways", None, None)


def test_of_many_bends_the_last_is_drawn_although_it_is_not_one_of_every_so_many():
    """900 bends, drawn at every second one; the last has a tenth of the data."""
    bends = np.linspace(10.0, 100.0, 900)
    data = np.append(np.ones(899), 99.0)
    given = SimpleNamespace(
        first_s=bends, last_s=bends, cdf=lambda at: np.array([data[bends <= x].sum() for x in at]) / data.sum()
    )
    latency_s, share = figures._distribution(SimpleNamespace(latency=given))
    assert (latency_s[-1], share[-1]) == (100.0, 1.0)
    assert share[-2] == pytest.approx(899.0 / 998.0, rel=1e-12)


@pytest.mark.parametrize(("largest", "log"), [(40.0, False), (60.0, True)])
def test_windows_without_an_error_or_of_none_do_not_count_in_the_median_that_tells_the_axis(largest, log):
    """The median of what is known and above 0 is 1; with the zeros it would be 0."""
    rms, most = np.array([0.0, 0.0, 1.0, 1.0, np.nan]), np.array([0.0, 0.0, 0.0, np.nan, largest])
    panel = panels(contact_run([("data", 0.0, 9.0)], Windows(np.arange(5.0), rms, most)))[-1]
    assert panel.y.log is log
    assert panel.y.low == (None if log else 0.0)


def test_the_contacts_of_a_day_have_a_row_for_each_station_of_either_downlink_with_its_own_contacts(monkeypatch):
    """Stations stand as they come first; one of the direct downlink is one of the optical one, too."""

    def contact(start_s, end_s):
        return SimpleNamespace(start_s=start_s, end_s=end_s)

    def way(*of, name=""):
        return SimpleNamespace(name=name, contacts=[contact(a, b) for _, a, b in of], stations=[s for s, *_ in of])

    shown = []
    monkeypatch.setattr(figures, "timeline", lambda *given: shown.append(given) or "drawn")
    pair = SimpleNamespace(span_s=(0.0, 900.0), leo=SimpleNamespace(name="LOW"), epoch=SimpleNamespace(text="now"))
    relay = way(("", 50.0, 100.0), ("", 300.0, 350.0), name="HUB")
    direct = way(("b", 10.0, 20.0), ("a", 30.0, 45.0), ("b", 60.0, 80.0))
    optical = way(("c", 400.0, 410.0), ("a", 500.0, 520.0), ("c", 600.0, 950.0))
    view = SimpleNamespace(pair=pair, umbra_s=np.array([[700.0, 800.0]]))
    day = SimpleNamespace(relay=relay, direct=direct, optical=optical, view=view)
    assert figures.contacts_figure(day) == "drawn"
    ((rows, span_s, epoch),) = shown
    assert (span_s, epoch) == ((0.0, 900.0), "now")
    assert [(name, np.asarray(of).tolist()) for name, of in rows] == [
        ("HUB", [[50.0, 100.0], [300.0, 350.0]]),
        ("direct: b", [[10.0, 20.0], [60.0, 80.0]]),
        ("direct: a", [[30.0, 45.0]]),
        ("optical: c", [[400.0, 410.0], [600.0, 900.0]]),  # the span ends there
        ("optical: a", [[500.0, 520.0]]),
        ("eclipse of LOW", [[700.0, 800.0]]),
    ]
    shown.clear()
    figures.contacts_figure(SimpleNamespace(**{**vars(day), "direct": None, "optical": None}))
    assert [name for name, _ in shown[0][0]] == ["HUB", "eclipse of LOW"]


@pytest.mark.parametrize("optical", [None, "a way"])
@pytest.mark.parametrize("run", [None, "a run"])
def test_the_figures_of_a_day_stand_in_their_order_each_of_its_own_part(monkeypatch, optical, run):
    makers = ("contacts_figure", "_volume_figure", "_latency_figure", "ground_map", "_assumptions_figure")
    for name in makers:
        monkeypatch.setattr(figures, name, lambda day, name=name: (name, day))
    monkeypatch.setattr(figures, "_along_figure", lambda day: [("along", day)])
    for name in ("_optical_figure", "_contact_run_figure"):
        monkeypatch.setattr(figures, name, lambda day, of, name=name: (name, day, of))
    day = SimpleNamespace(optical=optical)
    first, *rest = ((name, day) for name in makers)
    ways = [("_optical_figure", day, optical)] if optical else []
    runs = [("_contact_run_figure", day, run)] if run else []
    assert figures.day_figures(day, run) == (first, ("along", day), *rest, *ways, *runs)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_along_a_contact_the_relay_is_seen_from_the_satellite_at_the_times_of_that_contact(monkeypatch, number):
    day, asked = a_log_and_view(operations=SimpleNamespace(contact=SimpleNamespace(number=number))), []
    day.view.pair.leo.orbit, day.view.pair.geo.orbit, day.data.table.wavelength_m = "low", "high", 1.55e-6
    day.view.pair.epoch.utc = lambda at: f"2026-03-20T12:00:0{at:.0f}.123456Z"

    def sight(*of):
        asked.append(of)
        drawn = {"range_m": "range", "point_ahead_rad": "ahead", "rate_rad_s": "rate"}
        return SimpleNamespace(time_s=np.array([5.0, 7.0]), doppler_hz=lambda wavelength_m: wavelength_m, **drawn)

    monkeypatch.setattr(figures.orbit, "sight", sight)
    monkeypatch.setattr(figures, "times", lambda contact: ("times of", contact))
    monkeypatch.setattr(figures, "along_contact", lambda *of, **named: (of, named))
    (((since_s, *of), named),) = figures._along_figure(day)
    assert asked == [("low", "high", ("times of", day.view.encounters[number - 1].contact))]
    assert since_s.tolist() == [6.0 - number, 8.0 - number]
    assert of == ["range", "ahead", "rate", 1.55e-6]
    assert named == {"number": number, "rise_utc": f"2026-03-20 12:00:0{number - 1}"}


def test_a_contact_in_time_is_drawn_from_its_first_state_to_its_last():
    states = [("search", 120.0, 180.0), ("data", 180.0, 540.0), ("search", 540.0, 600.0)]
    nothing = figures.Windows(NOTHING, NOTHING, NOTHING)
    for panel in panels(figures.contact_run(states, nothing)):
        assert (panel.x.low, panel.x.high) == (2.0, 10.0)


def test_an_axis_of_latencies_begins_where_something_has_arrived():
    none_yet = np.array([1.0, 100.0, 200.0]), np.array([0.0, 0.5, 1.0])
    at_once = np.array([0.0, 400.0]), np.array([0.25, 1.0])
    (panel,) = panels(figures.latency({"direct": none_yet, "relay": at_once}))
    assert (panel.x.low, panel.x.high) == (50.0, pytest.approx(480.0, rel=1e-12))


def test_what_moves_the_optical_downlink_stands_by_how_far_it_does_and_in_its_own_volume():
    def swing(name, of_relay, of_optical, low_tb, high_tb):
        at_low, at_high = (SimpleNamespace(optical_bit=8e12 * tb, relay_bit=1.0, ratio=1.0) for tb in (low_tb, high_tb))
        ends = {"low": "-", "high": "+", "at_low": at_low, "at_high": at_high}
        return SimpleNamespace(name=name, of_relay=of_relay, of_optical=of_optical, **ends)

    moved = [swing("a", 9.0, 1.5, 1.0, 2.0), swing("b", 3.0, 1.0, 5.0, 5.0), swing("c", 1.0, 4.0, 0.5, 2.5)]
    found = figures._optical_figure(SimpleNamespace(swings=moved), SimpleNamespace(capacity_bit=8e12))
    assert (found.name, found.title) == (
        "optical-assumptions",
        "What the assumptions decide for the optical downlink",
    )
    assert {name: values.tolist() for name, values in found.columns.items()} == {
        "as assumed": [1.0],
        "c: - / +, lower": [0.5],
        "a: - / +, lower": [1.0],
        "c: - / +, higher": [2.5],
        "a: - / +, higher": [2.0],
    }
    assert list(found.columns)[1:3] == ["c: - / +, lower", "a: - / +, lower"]


def test_a_distribution_that_jumps_is_looked_at_just_before_the_jump():
    at = SimpleNamespace(first_s=np.array([10.0]), last_s=np.array([10.0]), cdf=lambda t: (t >= 10.0).astype(float))
    latency_s, share = figures._distribution(SimpleNamespace(latency=at))
    assert (share[0], share[-1], latency_s[-1]) == (0.0, 1.0, 10.0)
    assert 10.0 - 1e-7 < latency_s[0] < 10.0


def test_a_distribution_of_few_bends_is_a_curve_of_many_points():
    """Its axis is logarithmic: straight lines from bend to bend would leave the true shares."""
    ramp = SimpleNamespace(first_s=np.array([10.0]), last_s=np.array([1000.0]), cdf=lambda t: (t - 10.0) / 990.0)
    latency_s, share = figures._distribution(SimpleNamespace(latency=ramp))
    between = np.geomspace(latency_s[1], latency_s[-1], 500)
    drawn = np.interp(np.log(between), np.log(latency_s), share)
    np.testing.assert_allclose(drawn, ramp.cdf(between), rtol=0, atol=1e-3)
