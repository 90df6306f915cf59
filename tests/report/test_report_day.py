"""The day in the report: what the page says, its figures, its datasets, the contact in time, the plan of sessions."""

import csv
import hashlib
import html
import io
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from drawn import one_text, outline, plain
from microrad import orbit, report
from microrad.loop import control, controller_study
from microrad.loop.controller_study import designs
from microrad.loop.pointing_loop.loop import assemble
from microrad.mission.file import load_mission, with_contents
from microrad.orbit import day as day_study
from microrad.orbit.day.assumptions import Numbers, Swing
from microrad.orbit.operations import OperationsError
from microrad.report.day import contact_run as contact_report
from microrad.report.day import data as day_data_file
from microrad.report.day import page as day_page_module
from microrad.report.day import tables
from microrad.report.day import words as day_words
from microrad.report.day.constellation import partners_table, plan_data, plan_sentences, plan_text, satellites_table
from microrad.report.day.contact_run import contact_sentences, windows_table
from microrad.report.day.figures import day_figures
from microrad.report.paper import bench
from microrad.report.paper import figures as paper_figures
from microrad.report.quantities import duration, volume
from microrad.report.results import arrays
from microrad.report.results.manifest import manifest_of
from microrad.study import contact_run, study
from scenes import scene_of
from shipped import SHIPPED, edited_file, plain_study

FIGURES = ["day-timeline", "along-contact", "data-volume", "latency", "world-map", "assumptions"]


@pytest.fixture(scope="module")
def file():
    return load_mission(SHIPPED)


@pytest.fixture(scope="module")
def fine(file):
    """A fine-pointing study as far as a contact asks for it: the PI of the grid, made in half a second."""
    scene = scene_of(file)
    tuned = designs.grid_baseline(designs.plants(scene, 1)[:1], control.Specification(0.5))
    design = controller_study.Design("PI", tuned, assemble("PI", scene.loop, tuned.controller))
    return SimpleNamespace(scene=scene, best=SimpleNamespace(design=design), quantile=0.997)


@pytest.fixture(scope="module")
def found(file, fine):
    """The study of the shipped mission without its fine-pointing loop, and one contact in time under a PI."""
    whole = plain_study()
    m = file.mission
    run = contact_run.of_mission(m.operations, m.acquisition, whole.links.data, whole.day, whole.links.finding, fine)
    return replace(whole, contact=run)


@pytest.fixture(scope="module")
def written(found, tmp_path_factory):
    """The report without the figures of the paper."""
    target = tmp_path_factory.mktemp("day") / "study"
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((paper_figures, "paper_figures"), (bench, "bench_figures")):
            patch.setattr(module, name, lambda *args: ())
        report.write(found, target)
    return target


def test_the_study_has_a_day_and_a_plan_but_no_contact_in_time_without_a_fine_loop(found):
    assert found.day is not None
    assert found.plan is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.controller_study, "design_and_simulate", lambda *args, **more: None)
        m = found.file.mission
        links = found.links
        assert contact_run.of_mission(m.operations, m.acquisition, links.data, found.day, links.finding, None) is None


@pytest.mark.promise("readme-1", "report-6")
@pytest.mark.promise("day-2")
def test_the_page_answers_with_contacts_volumes_latencies_and_the_assumption(written, found):
    text = (written / "report.html").read_text(encoding="utf-8")
    begin = text.index('<h2 id="delivers">What the link delivers<')
    section = text[begin : text.index("<h2 ", begin + 1)]
    for sentence in day_words.sentences(found.day):
        assert sentence in html.unescape(section)
    for needed in ("15 times", "median", "99 % within", "What matters most", "GB", "Doppler"):
        assert needed in section
    assert section.count("<figure") == len(FIGURES) + 1


@pytest.mark.promise("day-5")
def test_the_table_of_contacts_has_both_ways_in_the_order_of_their_rise(found):
    day = found.day
    utc = day.view.pair.epoch.utc
    wanted = [(e.contact, e, bit) for e, bit in zip(day.encounters, day.relay.carried_bit, strict=True)]
    wanted += [(c, None, bit) for c, bit in zip(day.direct.contacts, day.direct.carried_bit, strict=True)]
    wanted.sort(key=lambda item: item[0].start_s)
    rows = tables.contacts_table(day).rows
    for row, (contact, seen, bit) in zip(rows, wanted, strict=True):
        assert row[1:4] == (
            utc(contact.start_s)[:19].replace("T", " "),
            utc(contact.end_s)[11:19],
            f"{contact.duration_s / 60.0:.2f}",
        )
        assert row[9] == volume(bit)
        causes = dict.fromkeys("mask" if "mask" in each else each for each in (contact.begins, contact.ends))
        assert row[10] == " to ".join(causes)
        if seen is None:
            assert (row[0], *row[4:9]) == ("kiruna", "", "", "", "", f"{math.degrees(contact.highest_rad):.1f}")
        else:
            assert row[4:9] == (
                f"{seen.range_least_m / 1e3:.0f} to {seen.range_most_m / 1e3:.0f}",
                f"{seen.point_ahead_most_rad * 1e6:.1f}",
                f"{seen.rate_most_rad_s * 1e6:.0f}",
                f"{seen.doppler_most_hz / 1e9:.2f}",
                "",
            )
    assert {"Earth", "mask", "Earth to Sun near the line of sight of LEO"} <= {row[10] for row in rows}


@pytest.mark.promise("day-1", "day-5", "day-23")
def test_the_ways_stand_side_by_side(found):
    day = found.day
    table = tables.ways_table(day)
    assert table.headings == ("", "relay", "direct downlink")
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["could carry"] == (volume(day.relay.capacity_bit), volume(day.direct.capacity_bit))
    assert rows["made by the instrument"] == (volume(32.4 * 8e9),) * 2
    assert min(day.relay.capacity_bit, day.direct.capacity_bit) > day.relay.generated_bit
    assert rows["longest time without contact"] == (duration(day.view.gap_s), duration(day.direct.gap_s))
    assert rows["latency of what is kept, 99 %"] == (duration(day.relay.slow_s), duration(day.direct.slow_s))
    never = SimpleNamespace(**{name: getattr(day.relay, name) for name in USED}, slow_s=math.inf)
    assert tables.ways_table(replace(day, relay=never)).rows[-1][1] == "never"


USED = (
    "name",
    "contacts",
    "contact_s",
    "gap_s",
    "capacity_bit",
    "failed_contacts",
    "generated_bit",
    "lost_bit",
    "history",
    "on_board_bit",
    "arrived_bit",
    "median_s",
)


@pytest.mark.promise("day-5")
def test_assumptions_stand_by_how_far_they_move_the_ratio(found):
    day = found.day
    factors = [s.factor for s in day.swings]
    assert factors == sorted(factors, reverse=True) and factors[0] > 1.5
    table = tables.assumptions_table(day)
    assert [heading.replace("\n", " ") for heading in table.headings[-3:]] == ["ratio", "99 % by relay", "99 % direct"]
    assert list(dict.fromkeys(row[0] for row in table.rows)) == [s.name for s in day.swings]
    named = day_words.assumption_words(day)[0]
    assert named.startswith(
        f"What matters most to the ratio of the two volumes, each assumption changed alone: {day.swings[0].name}"
    )


def test_latencies_depend_most_on_what_triples_them_whichever_side_is_as_it_is(found):
    day, (doubled, tripled, *_) = found.day, found.day.swings

    def late(s, here_s, low_s, high_s):
        ends = zip(("here", "at_low", "at_high"), (here_s, low_s, high_s), strict=True)
        return replace(s, **{end: replace(getattr(s, end), relay_slow_s=t, direct_slow_s=100.0) for end, t in ends})

    swings = (late(doubled, 600.0, 600.0, 1200.0), late(tripled, 1800.0, 600.0, 1800.0))
    said = day_words.assumption_words(replace(day, swings=swings))[-1]
    assert said.startswith(f"How late data arrive depends most on {tripled.name}: ")


@pytest.mark.promise("day-5")
def test_the_reach_of_each_rate_is_said(found):
    (closing,) = found.day.closings
    assert closing.largest_range_m < found.day.view.largest("range_most_m")
    said = day_words.rate_words(found.day)
    assert f"has the demanded 3 dB for 300 Mbit/s up to {closing.largest_range_m / 1e3:.0f} km." in said


def test_a_reach_that_follows_from_a_choice_says_so(found):
    said = (
        " How far it reaches, and so the volume, follows from communication.receiver_sensitivity = 291.2 photon/bit ("
    )
    assert said in day_words.rate_words(found.day)
    assert "follows from" not in day_words.rate_words(replace(found.day, derived=()))


def test_each_claim_of_the_paper_about_contacts_is_judged(found):
    claims = {c.claim: c for c in found.claims}
    assert claims["about 45 minutes for each session"].agrees == "yes"
    assert claims["a line of sight in each of about 15 orbits a day"].ours == "the relay rises 14 times a day"
    assert claims["a ground pass takes less than about 10 minutes"].agrees == "yes"
    assert "99 % within" in claims["data reach the ground in almost real time"].ours


@pytest.mark.promise("report-6")
def test_each_figure_of_the_day_stands_with_its_data(written, found):
    names = [f.name for f in day_figures(found.day, found.contact)]
    assert names == [*FIGURES, "contact-run"]
    for name in names:
        assert (written / "figures" / f"{name}.svg").stat().st_size > 1000
        with (written / "figures" / f"{name}.csv").open(encoding="utf-8") as lines:
            assert len(list(csv.reader(lines))) > 1
    assert [f.name for f in day_figures(found.day)] == FIGURES


def test_along_the_contact_time_counts_from_the_rise(written):
    with (written / "figures" / "along-contact.csv").open(encoding="utf-8") as lines:
        rows = list(csv.reader(lines))
    assert float(rows[1][0]) == 0.0
    assert 3000.0 < float(rows[-1][0]) < 3300.0


def test_the_latency_curve_is_the_distribution(found):
    drawn = next(f for f in day_figures(found.day) if f.name == "latency")
    latency, share = drawn.columns["relay, latency (s)"], drawn.columns["relay, share"]
    assert np.all(np.diff(latency) > 0)
    assert np.all(np.diff(share) >= 0)
    delay = found.file.mission.operations.relay_delay_s
    assert share[latency < delay * (1 - 1e-12)].max(initial=0.0) == 0.0
    np.testing.assert_allclose(share, found.day.relay.latency.cdf(latency), rtol=0, atol=1e-12)


@pytest.mark.promise("report-2", "report-13")
@pytest.mark.promise("day-34")
def test_results_hold_the_day(written, found):
    tree = xr.open_datatree(written / "results.nc", engine="h5netcdf")
    day = tree["day"]
    assert set(day.children) == {
        "contacts", "line_of_sight", "passes", "relay", "direct_downlink", "assumptions", "contact_run", "sessions"
    }  # fmt: skip
    contacts = day["contacts"]
    assert contacts.sizes["contact"] == 15
    assert contacts["start"].attrs["units"] == "s"
    assert contacts.attrs["epoch"] == "2026-03-20T12:00:00Z"
    assert float(contacts["point_ahead"].max()) == found.day.view.largest("point_ahead_most_rad")
    line = day["line_of_sight"]
    assert set(np.unique(line["contact"])) == set(range(1, 16))
    assert float(line["acceleration"].max()) == max(e.acceleration_most_rad_s2 for e in found.day.encounters)
    assert float(abs(line["range_rate"]).max()) == max(e.range_rate_most_m_s for e in found.day.encounters)
    np.testing.assert_allclose(line["doppler"], -line["range_rate"] / 1.55e-6)
    assert float(day["relay"]["could_carry"]) == found.day.relay.capacity_bit
    assert day["sessions"].sizes["session"] == len(found.plan.planned)
    for group in day.children.values():
        for name, variable in group.data_vars.items():
            assert {"units", "long_name"} <= set(variable.attrs), name
    tree.close()


@pytest.mark.promise("report-2")
def test_the_sessions_stand_as_csv_and_as_a_contact_plan(written, found):
    rows = list(csv.reader(io.StringIO((written / "sessions.csv").read_text(encoding="utf-8"))))
    assert len(rows) == 1 + len(found.plan.planned)
    plan = (written / "contact-plan.ionrc").read_text(encoding="utf-8")
    assert plan.count("\na contact +") + plan.count("\n# left out") == len(found.plan.planned)
    files = json.loads((written / "manifest.json").read_text(encoding="utf-8"))["files_sha256"]
    assert {"sessions.csv", "contact-plan.ionrc"} <= set(files)


def test_the_summary_is_plain_data(found):
    data = report.summary(found)
    assert data["day"]["relay"]["could_carry_bit"] == found.day.relay.capacity_bit
    assert data["contact"]["losses"] == found.contact.losses
    assert data["constellation"]["sessions"] == len(found.plan.planned)
    json.dumps(data["contact"])


# ----------------------------------------------------------------------------------------------- the contact in time


@pytest.mark.promise("day-2", "day-26")
def test_the_contact_of_the_mission_has_its_geometry(found):
    encounter = found.day.view.encounters[0]
    run = found.contact
    assert (run.contact.start_s, run.contact.end_s) == (encounter.contact.start_s, encounter.contact.end_s)
    assert len(run.windows) == found.file.mission.operations.contact.windows
    ranges = [w.range_m for w in run.windows]
    assert encounter.range_least_m * 0.999 <= min(ranges) <= max(ranges) <= encounter.range_most_m * 1.001
    assert max(w.point_ahead_rad for w in run.windows) <= encounter.point_ahead_most_rad * 1.001
    assert [t.to for t in run.log][:6] == ["slew", "beacon", "detect", "answer", "lock", "data"] or run.log[
        0
    ].to == "slew"


@pytest.mark.promise("day-26")
def test_a_later_contact_is_free_from_the_end_of_the_one_before(found, fine, tmp_path):
    m = edited_file(tmp_path, ("number = 1 ", "number = 3 "), whole=True).mission
    run = contact_run.of_mission(m.operations, m.acquisition, found.links.data, found.day, found.links.finding, fine)
    before = found.day.view.encounters[1].contact
    assert run.contact.free_from_s == before.end_s
    assert run.contact.start_s == found.day.view.encounters[2].contact.start_s


def test_a_contact_beyond_those_of_the_span_is_refused(found, tmp_path):
    file = edited_file(tmp_path, ("number = 1 ", "number = 99 "), whole=True)
    links = replace(found.links, file=replace(found.links.file, mission=file.mission))
    with pytest.raises(OperationsError, match=r"operations\.contact\.number is 99, and the span has 15 contacts"):
        day_study.run_day_study(links)


def test_the_words_say_when_data_begin_and_how_much_flows(found):
    run = found.contact
    (said,) = contact_sentences(run, 1, "PI", 3e8)
    assert "data begin" in said
    assert f"{100 * run.data_share:.1f} % of the contact" in said
    assert "never lost" in said
    table = windows_table(run, 0.997)
    assert len(table.rows) == len(run.windows)
    assert len(table.rows[0]) == len(table.headings)
    assert windows_table(run, 0.95).headings[5] == "95 % (µrad)"


def test_the_words_of_a_contact_without_data_say_why(found):
    log = found.contact.log
    none = replace(found.contact, log=(*log[:2], replace(log[-1], state=log[1].to, cause="given up")), windows=())
    (said,) = contact_sentences(none, 1, "PI", 3e8)
    assert "never comes to data: given up" in said


# ------------------------------------------------------------------------------------------- missions without a table


def test_contacts_of_several_days_are_told_in_all_and_by_the_day():
    day, way = SimpleNamespace(view=SimpleNamespace(days=2.0)), SimpleNamespace(contacts=range(5), contact_s=12_000.0)
    told = day_words._how_much(day, way)
    assert told == "is in view 5 times, 200 min in all (2.5 times, 100 min a day)"


@pytest.mark.promise("report-7")
@pytest.mark.usefixtures("undrawn")
def test_a_mission_without_orbits_has_no_day(tmp_path, monkeypatch):
    monkeypatch.setattr(study.paper, "applies", lambda mission: False)
    monkeypatch.setattr(arrays, "study_netcdf", lambda study: b"")
    text = SHIPPED.read_text(encoding="utf-8")
    begin, end = (
        text.index("# ---", text.index("jitter = ")),
        text.index("# ---", text.index("[constellation.relays.west]")),
    )
    mission = tmp_path / "mission.toml"
    mission.write_text(
        text[:begin] + text[end : text.index("# ---", text.index("loop_amplitude = "))], encoding="utf-8"
    )
    result = study.run_study(load_mission(mission))
    assert (result.day, result.contact, result.plan) == (None, None, None)
    assert not any("orbits a day" in c.claim for c in result.claims)
    page = report.write(result, tmp_path / "out").read_text(encoding="utf-8")
    assert "What the link delivers" not in page


def test_the_manifest_has_the_hash_of_each_file_that_the_mission_names_as_it_was_read(found, tmp_path):
    (tmp_path / "a.tle").write_bytes(b"elements")
    m = found.file.mission
    leo = m.orbit.leo.model_copy(update={"kind": "elements", "file": "a.tle"})
    m = m.model_copy(update={"orbit": m.orbit.model_copy(update={"leo": leo})})
    study = replace(found, file=with_contents(replace(found.file, mission=m, path=tmp_path / "mission.toml")))
    (tmp_path / "a.tle").write_bytes(b"others")
    (tmp_path / "out").mkdir()
    made = manifest_of(study, {}, tmp_path / "out")
    assert made["inputs_sha256"] == {"a.tle": hashlib.sha256(b"elements").hexdigest()}
    assert made["inputs"] == {"a.tle": "elements"}
    assert "seed 1 of [operations], 20 runs" in made["randomness"]
    assert manifest_of(found, {}, tmp_path / "out")["inputs_sha256"] == {}


NUMBERS = Numbers(relay_bit=8e9, direct_bit=4e9, relay_slow_s=60.0, direct_slow_s=30.0)


@pytest.mark.parametrize(
    ("capacity_bit", "said"),
    [(None, "relay's volume"), (0.0, "relay's volume"), (4e9, "ratio of the two volumes")],
)
def test_what_matters_most_is_said_of_the_ratio_only_where_both_ways_carry_something(capacity_bit, said):
    swing = SimpleNamespace(
        name="the store",
        low="1 GB",
        high="2 GB",
        of_relay=1.5,
        of_optical=1.0,
        here=NUMBERS,
        at_low=NUMBERS,
        at_high=NUMBERS,
    )
    direct = None if capacity_bit is None else SimpleNamespace(capacity_bit=capacity_bit)
    (found,) = day_words.assumption_words(day_of(swing, direct))
    assert found.startswith(f"What matters most to the {said}, each assumption changed alone: the store (1 GB: ")
    steady = replace_namespace(swing, of_relay=day_words.MATTERS)
    assert day_words.assumption_words(day_of(steady, direct)) == []


def day_of(swing, direct):
    """A day to a relay, without an optical downlink, of which one assumption is changed."""
    return SimpleNamespace(swings=[swing], direct=direct, optical=None, view=SimpleNamespace(partner="relay"))


@pytest.mark.parametrize("direct", [None, object()])
def test_how_late_data_arrive_is_said_of_the_ways_that_there_are(direct):
    late = replace(NUMBERS, relay_slow_s=120.0)
    swing = SimpleNamespace(
        name="a delay", low="0 s", high="60 s", of_relay=1.0, of_optical=1.0, here=NUMBERS, at_low=NUMBERS, at_high=late
    )
    direct = None if direct is None else SimpleNamespace(capacity_bit=0.0)
    (found,) = day_words.assumption_words(day_of(swing, direct))
    ways = f"within {duration(60.0)} or {duration(120.0)} by the relay"
    ways += "" if direct is None else f", within {duration(30.0)} directly"
    assert found.endswith(f"with 0 s or 60 s, 99 % arrive {ways}.")


def replace_namespace(of, **changes):
    """A copy with other values."""
    return SimpleNamespace(**{**vars(of), **changes})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "half arrives within 1.0 min, and 99 % within 2.0 min"),
        ({"arrived_bit": 0.0}, "nothing arrives"),
        ({"median_s": math.inf, "slow_s": math.inf}, "less than half arrives, and less than 99 % by the end"),
        ({"slow_s": math.inf}, "half arrives within 1.0 min, and less than 99 % by the end"),
        ({"on_board_bit": 1.0}, "half arrives within 1.0 min, and 99 % within 2.0 min"),
        (
            {"on_board_bit": 8e9},
            "half arrives within 1.0 min, and 99 % within 2.0 min, 1 GB are still on board at the end",
        ),
        (
            {"lost_bit": 16e9, "on_board_bit": 8e9},
            "4 GB arrive (of what is kept half arrives within 1.0 min, and 99 % within 2.0 min), 2 GB find the store "
            "full, 1 GB are still on board at the end",
        ),
    ],
)
def test_what_becomes_of_the_data_is_said_of_each_part_that_there_is(changes, said):
    way = SimpleNamespace(arrived_bit=32e9, median_s=60.0, slow_s=120.0, on_board_bit=0.0, lost_bit=0.0)
    for name, made in {"1.0 min": 60.0, "2.0 min": 120.0}.items():
        said = said.replace(name, duration(made))
    for name, made in {"4 GB": 32e9, "2 GB": 16e9, "1 GB": 8e9}.items():
        said = said.replace(name, volume(made))
    assert day_words._arrived(replace_namespace(way, **changes)) == said


def test_each_number_of_a_way_stands_under_its_own_name():
    """Five histories and three single numbers, all different."""
    history = SimpleNamespace(
        **{f"{name}_{'s' if name == 'time' else 'bit'}": np.array([k, k + 0.5]) for k, name in enumerate(HISTORY)}
    )
    way = SimpleNamespace(history=history, capacity_bit=7.0, median_s=8.0, slow_s=9.0)
    found = arrays._day_way(way).to_xarray()
    assert [found[name].values.tolist() for name in HISTORY] == [[k, k + 0.5] for k in range(len(HISTORY))]
    assert [float(found[name]) for name in ("could_carry", "latency_median", "latency_99_percent")] == [7.0, 8.0, 9.0]
    assert [found[name].units for name in ("stored", "latency_99_percent")] == ["bit", "s"]


HISTORY = ("time", "generated", "delivered", "stored", "lost")


# ---------------------------------------------------------------------------------------------------- words in detail
def a_way(**changes):
    """A way of three contacts in half an hour each."""
    given = SimpleNamespace(
        contacts=range(3),
        contact_s=5400.0,
        capacity_bit=8e12,
        capacity_spread_bit=(4e12, 8e12),
        generated_bit=8e9,
        arrived_bit=0.0,
    )
    return replace_namespace(given, **changes)


def a_day(**changes):
    """A day to a relay that has everything, and no downlink."""
    view = SimpleNamespace(days=1.0, duration_s=86400.0, partner="relay")
    given = SimpleNamespace(
        view=view,
        relay=a_way(),
        direct=None,
        optical=None,
        ratio=math.nan,
        optical_ratio=math.nan,
        operations=SimpleNamespace(relay_share=1.0, downlink=None, optical=None, runs=20, margin_db=3.0),
    )
    return replace_namespace(given, **changes)


STATIONS = SimpleNamespace(stations={"kiruna": 1, "tromso": 2})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB."),
        ({"operations": None}, "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB."),
        (
            {"operations": SimpleNamespace(relay_share=0.5)},
            "In 24 h the relay grants the link 3 times, 90 min in all, and could carry 1 TB.",
        ),
        (
            {"operations": SimpleNamespace(relay_share=0.5), "relay": a_way(contacts=(), capacity_bit=0.0)},
            "In 24 h the relay never grants the link, and could carry 0 B.",
        ),
        (
            {"relay": a_way(contacts=(), capacity_bit=0.0)},
            "In 24 h the relay is never in view, and could carry 0 B.",
        ),
        (
            {
                "operations": SimpleNamespace(relay_share=0.5, downlink=STATIONS, optical=None),
                "direct": a_way(contacts=range(1), contact_s=600.0, capacity_bit=8e9),
                "ratio": 1000.0,
            },
            "In 24 h the relay grants the link 3 times, 90 min in all, and could carry 1 TB. The ground (kiruna, "
            "tromso) is in view once, 10 min in all, and could carry 1 GB; the relay could carry 1000 times as much.",
        ),
        (
            {"operations": None, "direct": a_way(contacts=(), capacity_bit=0.0), "ratio": math.inf},
            "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB. The ground () is never in "
            "view, and could carry 0 B.",
        ),
        (
            {
                "operations": SimpleNamespace(relay_share=1.0, optical=STATIONS),
                "optical": a_way(),
                "optical_ratio": 2.0,
            },
            "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB. Optical ground stations "
            "(kiruna, tromso) are in use for 90 min, and could carry 1 TB, from 500 GB to 1 TB by the weather drawn; "
            "the relay could carry 2 times as much.",
        ),
        (
            {
                "operations": SimpleNamespace(relay_share=1.0, optical=STATIONS),
                "optical": a_way(capacity_spread_bit=(8e12, 8e12)),
                "optical_ratio": 0.0,
            },
            "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB. Optical ground stations "
            "(kiruna, tromso) are in use for 90 min, and could carry 1 TB.",
        ),
        (
            {"operations": SimpleNamespace(relay_share=1.0, optical=STATIONS), "optical": a_way(contacts=())},
            "In 24 h the relay is in view 3 times, 90 min in all, and could carry 1 TB. Optical ground stations "
            "(kiruna, tromso) are never used.",
        ),
    ],
)
def test_the_headline_says_what_each_way_could_carry_and_how_they_compare(changes, said):
    assert day_words.headline(a_day(**changes)) == [said]


def test_the_headline_of_two_days_has_each_number_by_the_day_too():
    two = SimpleNamespace(days=2.0, duration_s=172800.0, partner="relay")
    operations = SimpleNamespace(relay_share=1.0, optical=STATIONS)
    (said,) = day_words.headline(a_day(view=two, operations=operations, optical=a_way()))
    relay = "In 48 h the relay is in view 3 times, 90 min in all (1.5 times, 45 min a day), and could carry 1 TB (500 "
    assert said.startswith(relay + "GB a day). Optical ground stations")
    assert "in use for 90 min (45 min a day), and could carry 1 TB (500 GB a day), from 500 GB to 1 TB by" in said


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, "never"),
        (1, "once"),
        (0.9996, "once"),
        (1.0004, "once"),
        (2, "2 times"),
        (2.345, "2.35 times"),
        (99.95, "100 times"),
        (100.0, "100 times"),
        (1234, "1234 times"),
    ],
)
def test_a_count_of_a_hundred_and_more_has_all_of_its_digits(count, said):
    assert day_words.times(count) == said


@pytest.mark.parametrize(("time_s", "said"), [(0.0, "0 min"), (59_940.0, "999 min"), (60_000.0, "16.7 h")])
def test_a_time_in_contact_is_in_hours_from_a_thousand_minutes_on(time_s, said):
    assert day_words.contact_time(time_s) == said


@pytest.mark.parametrize(
    ("ratio", "said"), [(0.0, ""), (math.inf, ""), (math.nan, ""), (0.5, "0.5"), (12345.0, "12300")]
)
def test_two_ways_are_compared_where_both_carry_something(ratio, said):
    told = day_words._compared(a_day(), ratio)
    assert told == (f"; the relay could carry {said} times as much" if said else "")


def sky_of(*names):
    return SimpleNamespace(names=names, any_drawn=0.5, any_clear=0.75, any_independent=0.9)


def test_the_sky_of_one_station_is_told_by_its_name_and_that_of_several_beside_independent_clouds():
    assert day_words.sky_words(a_day(sky=None)) == []
    assert day_words.sky_words(a_day(sky=sky_of("kiruna"))) == [
        "The sky over kiruna is clear for 75.0 % of the time (50.0 % in the 20 drawn skies)."
    ]
    assert day_words.sky_words(a_day(sky=sky_of("kiruna", "tromso"))) == [
        "At least one of the 2 optical stations is clear for 75.0 % of the time (50.0 % in the 20 drawn skies); with "
        "clouds that are independent from site to site it would be 90.0 %."
    ]


def contacts_of(partner="relay", rises=1, closed_form=None, median_s=600.0, encounters=2):
    """A view of contacts between 500 km and 2000 km."""
    largest = {
        "doppler_most_hz": 2e9,
        "point_ahead_most_rad": 50e-6,
        "rate_most_rad_s": 1e-3,
        "range_most_m": 2e6,
    }
    return SimpleNamespace(
        encounters=[SimpleNamespace(range_least_m=5e5 * (k + 1)) for k in range(encounters)],
        largest=largest.__getitem__,
        closed_form=closed_form,
        partner=partner,
        rises=rises,
        median_s=median_s,
        visible_share=0.25,
        gap_s=3600.0,
        pair=SimpleNamespace(leo=SimpleNamespace(name="LEO"), geo=SimpleNamespace(name="GEO")),
    )


def test_the_words_of_the_contacts_name_what_else_cuts_them():
    def told(**changes):
        return day_words.contact_words(a_day(view=contacts_of(**changes)))

    whole = (
        "The relay is in view for 25.0 % of the time, 10 min at a time (median), and out of it for 60 min at most. "
        "Range 500 to 2000 km, point-ahead up to 50 µrad, line of sight up to 1 mrad/s, Doppler shift up to 2 GHz "
        "either way."
    )
    assert told(rises=2) == told(rises=3) == whole
    cut = " It rises once only: a limit other than {} cuts some contacts in two."
    assert told() == whole + cut.format("the Earth")
    assert told(partner="station") == whole.replace("The relay", "The station") + cut.format("the mask")
    assert told(rises=2, median_s=math.nan) == whole.replace(" 10 min at a time (median),", "")
    form = SimpleNamespace(duration_s=2700.0)
    assert told(rises=2, closed_form=form) == whole + (
        " Over the equator a contact would take 45.00 min, by the formula for coplanar circular orbits."
    )
    assert told(encounters=0) == (
        "There is no contact: within the span and the limits of the mission, LEO and GEO do not see one another."
    )


@pytest.mark.parametrize(
    ("reach_m", "furthest_m", "derived", "outage", "said"),
    [
        ([2e6], 2e6, (), 0.0, "100 Mbit/s at every range of the contacts."),
        ([2e6], 2e6, ("a choice",), 0.0, "100 Mbit/s at every range of the contacts."),
        ([1.9e6], 2e6, (), 0.0, "100 Mbit/s up to 1900 km. Beyond that no data flow: the contacts reach 2000 km."),
        ([2e6], 0.0, (), 0.0, "100 Mbit/s up to 2000 km."),
        ([2e6], 0.0, (), 1.0, "100 Mbit/s up to 2000 km; 100 % of the time is lost in outage."),
        (
            [0.0],
            2e6,
            ("a choice",),
            0.0,
            "100 Mbit/s up to 0 km. Beyond that no data flow: the contacts reach 2000 km.",
        ),
        ([1e6, 3e6], 2e6, ("this",), 0.0, "100 Mbit/s up to 1000 km; 200 Mbit/s at every range of the contacts."),
        (
            [1e6, 1.5e6],
            2e6,
            ("this", "that"),
            0.01,
            "100 Mbit/s up to 1000 km; 200 Mbit/s up to 1500 km; 1 % of the time is lost in outage. Beyond that no "
            "data flow: the contacts reach 2000 km. How far it reaches, and so the volume, follows from this; that.",
        ),
    ],
)
def test_a_rate_reaches_a_range_or_every_range_of_the_contacts(reach_m, furthest_m, derived, outage, said):
    closings = [SimpleNamespace(rate_bit_s=1e8 * (k + 1), largest_range_m=m) for k, m in enumerate(reach_m)]
    day = a_day(
        view=SimpleNamespace(largest={"range_most_m": furthest_m}.__getitem__),
        closings=closings,
        derived=derived,
        loss=SimpleNamespace(outage=outage, loss_db=1.5, source="a test"),
    )
    begin = "With a pointing loss of 1.50 dB (a test) the laser link has the demanded 3 dB for "
    assert day_words.rate_words(day) == begin + said
    none = replace_namespace(day, closings=[])
    assert day_words.rate_words(none) == "The receiver takes none of the mission's data rates."


def swing_of(**changes):
    """An assumption that changes nothing."""
    given = {
        "name": "a", "low": "l", "high": "h", "of_relay": 1.0, "of_optical": 1.0, "here": NUMBERS, "at_low": NUMBERS,
        "at_high": NUMBERS
    }  # fmt: skip
    return SimpleNamespace(**given | changes)


def test_what_matters_to_the_optical_downlink_is_named_above_the_least_factor():
    wet = replace(NUMBERS, optical_bit=8e9)
    sides = {"low": day_words.NOTHING, "at_low": wet, "at_high": replace(wet, optical_bit=16e9)}
    swings = [swing_of(name=f"a{k}", of_optical=1.2 + 0.1 * k, **sides) for k in range(4)]
    day = replace_namespace(day_of(None, None), swings=swings)
    assert day_words.assumption_words(day) == [
        "What matters most to the optical downlink's volume: a3 (h: 2 GB); a2 (h: 2 GB); a1 (h: 2 GB)."
    ]
    least = replace_namespace(day, swings=[swing_of(of_optical=day_words.MATTERS)])
    assert day_words.assumption_words(least) == []


@pytest.mark.parametrize(
    ("low", "ratio", "said"),
    [
        (NUMBERS, True, "l: 2, h: 2"),
        (NUMBERS, False, "l: 1 GB, h: 1 GB"),
        (replace(NUMBERS, relay_bit=0.0), True, "l: nothing by relay, h: 2"),
        (replace(NUMBERS, direct_bit=0.0), True, "l: nothing direct, h: 2"),
        (replace(NUMBERS, direct_bit=0.0), False, "l: 1 GB, h: 1 GB"),
    ],
)
def test_a_side_of_an_assumption_that_carries_nothing_says_by_which_way(low, ratio, said):
    assert day_words._ends(swing_of(at_low=low), ratio, "relay") == said


@pytest.mark.parametrize(
    ("slow_s", "factor"), [(60.0, 1.0), (120.0, 2.0), (30.0, 2.0), (0.0, 1.0), (math.nan, 1.0), (math.inf, math.inf)]
)
def test_a_wait_counts_where_both_sides_have_one(slow_s, factor):
    assert day_words._wait_factor(swing_of(at_low=replace(NUMBERS, relay_slow_s=slow_s))) == factor


def test_a_wait_of_the_least_factor_is_not_named_and_a_longer_one_by_every_way():
    least = swing_of(at_low=replace(NUMBERS, relay_slow_s=66.0), here=NUMBERS)
    assert day_words._wait_factor(least) == day_words.MATTERS  # 66 s over 60 s
    assert day_words.assumption_words(day_of(least, None)) == []
    assert day_words.assumption_words(replace_namespace(day_of(least, None), swings=[])) == []
    late = swing_of(at_low=replace(NUMBERS, relay_slow_s=120.0, optical_slow_s=60.0))
    day = replace_namespace(day_of(late, None), optical=object())
    (said,) = day_words.assumption_words(day)
    assert said.startswith("How late data arrive depends most on a: with l or h, 99 % arrive within ")
    assert said.count(" or ") >= 2 and said.endswith("by the optical downlink.")


def run_of(**changes):
    """A contact of ten minutes with data in the half of it."""
    given = SimpleNamespace(
        contact=SimpleNamespace(start_s=100.0, end_s=700.0),
        seconds={contact_run.State.LOCK: 2.0, contact_run.State.DATA: 300.0},
        data_s=300.0,
        first_data_s=130.0,
        losses=0,
        losses_per_s=0.0,
        data_share=0.5,
        windows=range(4),
        sampled_s=1.5,
        bits=lambda rate: 300.0 * rate,
        log=[SimpleNamespace(cause="given up")],
    )
    return replace_namespace(given, **changes)


def test_a_contact_has_its_volume_at_a_single_rate_and_its_losses_where_there_are_some():
    begin = (
        "Contact 2 (10 min) under PI: data begin 30 s after the rise, 2 s of it to lock, and flow for 5 min, 50.0 % of "
        "the contact"
    )
    end = (
        ". The fine loop is simulated in 4 windows, 1.5 s in all, with the point-ahead and the rate of the line of "
        "sight of each; "
    )
    kept, at = "lock is never lost in them.", ": 3.75 GB at 100 Mbit/s"
    assert contact_sentences(run_of(), 2, "PI", 1e8) == [f"{begin}{at}{end}{kept}"]
    assert contact_sentences(run_of(), 2, "PI", None) == [f"{begin}{end}{kept}"]
    for count, said in ((1, "once"), (3, "3 times")):
        lost = f"lock is lost {said} in them, once in 50 s, which the rest of the time does not show."
        assert contact_sentences(run_of(losses=count, losses_per_s=0.02), 2, "PI", None) == [f"{begin}{end}{lost}"]
    none = contact_sentences(run_of(data_s=0.0), 2, "PI", 1e8)
    assert none == ["Contact 2 of 10 min never comes to data: given up."]


def test_what_becomes_of_the_data_is_said_by_each_way_that_there_is():
    made = "What becomes of the 1 GB that the instrument makes: by the relay nothing arrives"
    direct, optical = "; by the direct downlink nothing arrives", "; by the optical downlink nothing arrives"
    assert day_words.latency_words(a_day()) == [f"{made}."]
    assert day_words.latency_words(a_day(direct=a_way())) == [f"{made}{direct}."]
    assert day_words.latency_words(a_day(optical=a_way())) == [f"{made}{optical}."]
    assert day_words.latency_words(a_day(direct=a_way(), optical=a_way())) == [f"{made}{direct}{optical}."]


# ------------------------------------------------------------------------------------- tables and data as a whole
def clock(time_s):
    """A made epoch's time of day."""
    return f"2026-03-20T{int(time_s // 3600):02d}:{int(time_s % 3600 // 60):02d}:{time_s % 60:02.0f}.250Z"


def rich_way(name, k, contacts=(), stations=()):
    """A way whose numbers are all unlike each other, and those of other ways."""
    return SimpleNamespace(
        name=name,
        contacts=contacts,
        stations=stations,
        contact_s=6000.0 + 1000.0 * k,
        gap_s=7000.0 + 900.0 * k,
        carried_bit=np.array([8e9, 16e9]) * (k + 1.0),
        capacity_bit=24e9 * (k + 1.0),
        capacity_spread_bit=(12e9 + k * 8e9, 40e9 + k * 8e9),
        generated_bit=2.4e12,
        arrived_bit=2e11 + k * 8e9,
        lost_bit=8e10 + k * 8e9,
        on_board_bit=4e10 + k * 8e9,
        failed_contacts=0.125 * (k + 1.0),
        median_s=30.0 + k,
        slow_s=400.0 + 100.0 * k,
        history=SimpleNamespace(largest_stored_bit=1.6e11 + k * 8e9),
    )


def a_pass(start_s, end_s, highest_deg):
    """A pass over a station that its mask ends."""
    return orbit.Pass(start_s, end_s, "elevation mask of s", "the Earth", math.radians(highest_deg), start_s + 7.0)


def rich_day(**changes):
    """A day of three ways, two contacts each, whose order is not that of the ways."""
    contacts = [SimpleNamespace(start_s=s, end_s=e, duration_s=e - s, begins=b, ends="Earth") for s, e, b in TIMES]
    encounters = [
        SimpleNamespace(
            contact=c,
            range_least_m=1e6 * (k + 2),
            range_most_m=1.5e6 * (k + 2),
            point_ahead_most_rad=3e-5 * (k + 1),
            rate_most_rad_s=7e-4 * (k + 1),
            acceleration_most_rad_s2=9e-6 * (k + 1),
            range_rate_most_m_s=5e3 * (k + 1),
            doppler_most_hz=4e9 * (k + 1),
        )
        for k, c in enumerate(contacts)
    ]
    here = Numbers(4e12, 2e12, 200.0, 900.0, 1e12, 3000.0)
    swings = (
        Swing("rate", "1 Mbit/s", "as it is", Numbers(2e12, 3e12, 250.0, 950.0, 0.5e12, 3600.0), here, here),
        Swing("store", "1 GB", "9 GB", Numbers(8e12, 0.0, 210.0, 910.0, 2e12, 8000.0), here, here),
    )
    given = {
        "view": SimpleNamespace(
            pair=SimpleNamespace(
                epoch=SimpleNamespace(utc=clock, text="an epoch"), geo=SimpleNamespace(name="HUB"), span_s=(0.0, 8e4)
            ),
            partner="relay",
            duration_s=80000.0,
            visible_share=0.375,
            median_s=777.0,
            closed_form=SimpleNamespace(duration_s=888.0),
        ),
        "encounters": encounters,
        "relay": rich_way("relay", 0, contacts),
        "direct": rich_way(
            "direct downlink", 1, (a_pass(500.0, 920.0, 41.0), a_pass(7300.0, 7390.0, 12.3)), ("a", "b")
        ),
        "optical": rich_way(
            "optical downlink", 2, (a_pass(2000.0, 2300.0, 80.0), a_pass(9000.0, 9030.0, 33.0)), ("=c", "a")
        ),
        "sky": SimpleNamespace(
            names=("=c", "a"),
            availability=(0.3, 0.6),
            drawn=(0.25, 0.65),
            any_clear=0.68,
            any_drawn=0.7,
            any_independent=0.72,
            correlation=np.array([[1.0, 0.125], [0.125, 1.0]]),
        ),
        "loss": SimpleNamespace(loss_db=1.25, source="a source", outage=0.003),
        "closings": [SimpleNamespace(rate_bit_s=622.08e6, margin_db=3.5, largest_range_m=4.5e7)],
        "swings": swings,
        "warnings": ("one", "two"),
    }
    found = SimpleNamespace(**given | changes)
    found.ways = [way for way in (found.relay, found.direct, found.optical) if way is not None]
    return found


TIMES = [(600.0, 1350.0, "elevation mask of g"), (7200.0, 8000.0, "Earth")]


def told_table(table):
    """All of a table but its title's place."""
    rows = [[str(cell) for cell in row] for row in table.rows]
    return [table.title, table.folded, list(table.headings), rows, list(table.words), plain(dict(table.names))]


def test_contacts_of_three_ways_stand_in_their_order_with_each_ones_own_numbers():
    table = tables.contacts_table(rich_day())
    assert [*told_table(table), list(table.brief)] == [
        "Contacts",
        "Every contact",
        [
            "by",
            "rise (UTC)",
            "set",
            "min",
            "range\n(km)",
            "point-ahead\n(µrad)",
            "rate\n(µrad/s)",
            "Doppler\n(GHz)",
            "highest\n(deg)",
            "could\ncarry",
            "begins and ends by",
        ],
        [
            ["a", "2026-03-20 00:08:20", "00:15:20", "7.00", "", "", "", "", "41.0", "2 GB", "mask to the Earth"],
            [
                "HUB",
                "2026-03-20 00:10:00",
                "00:22:30",
                "12.50",
                "2000 to 3000",
                "30.0",
                "700",
                "4.00",
                "",
                "1 GB",
                "mask to Earth",
            ],
            [
                "=c, optical",
                "2026-03-20 00:33:20",
                "00:38:20",
                "5.00",
                "",
                "",
                "",
                "",
                "80.0",
                "3 GB",
                "mask to the Earth",
            ],
            [
                "HUB",
                "2026-03-20 02:00:00",
                "02:13:20",
                "13.33",
                "3000 to 4500",
                "60.0",
                "1400",
                "8.00",
                "",
                "2 GB",
                "Earth",
            ],
            ["b", "2026-03-20 02:01:40", "02:03:10", "1.50", "", "", "", "", "12.3", "4 GB", "mask to the Earth"],
            [
                "a, optical",
                "2026-03-20 02:30:00",
                "02:30:30",
                "0.50",
                "",
                "",
                "",
                "",
                "33.0",
                "6 GB",
                "mask to the Earth",
            ],
        ],
        [0, 10],
        {
            1: "day.contacts.start_s",
            2: "day.contacts.end_s",
            3: "day.contacts.duration_s",
            4: "day.contacts.range_most_m",
            5: "day.contacts.point_ahead_most_rad",
            6: "day.contacts.line_of_sight_rate_most_rad_s",
            7: "day.contacts.doppler_most_hz",
            8: "day.contacts.highest_elevation_rad",
            9: "day.contacts.could_carry_bit",
        },
        [0, 1, 2, 3, 9, 10],
    ]


WAY = [
    "contacts",
    "contact_s",
    "longest_gap_s",
    "could_carry_bit",
    "contacts_without_acquisition",
    "generated_bit",
    "lost_bit",
    "",
    "on_board_at_end_bit",
    "arrived_bit",
    "latency_median_s",
    "latency_99_percent_s",
]


def of_way(name):
    """What the rows of a way are called in the JSON."""
    return [each and f"day.{name}.{each}" for each in WAY]


def test_three_ways_side_by_side_have_each_line_of_numbers_under_its_own_name():
    assert told_table(tables.ways_table(rich_day())) == [
        "Relay and downlinks",
        (
            "What the ways could carry: 3 GB by relay and 6 GB by direct downlink and 9 GB by "
            "optical downlink; line by line"
        ),
        ["", "relay", "direct downlink", "optical downlink"],
        [
            ["contacts", "2", "2", "2"],
            ["time in contact", "100 min", "117 min", "133 min"],
            ["longest time without contact", "117 min", "2.19 h", "2.44 h"],
            ["could carry", "3 GB", "6 GB", "9 GB"],
            ["contacts without acquisition", "0.125", "", ""],
            ["made by the instrument", "300 GB", "300 GB", "300 GB"],
            ["lost for want of room", "10 GB", "11 GB", "12 GB"],
            ["on board at most", "20 GB", "21 GB", "22 GB"],
            ["on board at the end of what is followed", "5 GB", "6 GB", "7 GB"],
            ["arrive", "25 GB", "26 GB", "27 GB"],
            ["latency of what is kept, median", "30 s", "31 s", "32 s"],
            ["latency of what is kept, 99 %", "6.67 min", "8.33 min", "10 min"],
        ],
        [0],
        {
            1: of_way("relay"),
            2: of_way("direct"),
            3: of_way("optical"),
        },
    ]


def test_two_ways_of_which_one_is_optical_have_its_names():
    assert told_table(tables.ways_table(rich_day(direct=None)))[-1] == {
        1: of_way("relay"),
        2: of_way("optical"),
    }


def test_the_sky_has_each_station_beside_its_own_share_and_any_of_them_below():
    assert told_table(tables.sky_table(rich_day())) == [
        "Clear sky over the stations",
        "Share of the time without clouds",
        ["optical station", "clear", "in the runs"],
        [
            ["=c", "30.0 %", "25.0 %"],
            ["a", "60.0 %", "65.0 %"],
            ["any of them", "68.0 %", "70.0 %"],
            ["any of them, were clouds independent", "72.0 %", ""],
        ],
        [0],
        {
            1: [
                "day.sky.sites.=c.availability",
                "day.sky.sites.a.availability",
                "day.sky.any_clear",
                "day.sky.any_clear_independent",
            ],
            2: ["day.sky.sites.=c.drawn", "day.sky.sites.a.drawn", "day.sky.any_clear_drawn", ""],
        },
    ]


@pytest.mark.parametrize("missing", ["direct", "optical"])
def test_assumptions_of_two_ways_have_no_numbers_of_the_third(missing):
    _, _, headings, rows, _, names = told_table(tables.assumptions_table(rich_day(**{missing: None})))
    assert [len(row) for row in rows] == [len(headings)] * 3
    assert ("125 GB" in str(rows)) is (missing == "direct") and ("ratio" in headings)
    assert [row[3:5] for row in rows] == (
        [["", ""]] * 3 if missing == "direct" else [["375 GB", "0.667"], ["0 B", ""], ["250 GB", "2"]]
    )
    assert (max(names) == len(headings) - 1) and all(name.count(".") == 1 for name in names.values() if name)


def test_assumptions_of_three_ways_have_a_row_for_each_side_that_is_changed():
    assert told_table(tables.assumptions_table(rich_day())) == [
        "One assumption changed",
        "One assumption changed, all others as they are",
        [
            "assumption",
            "changed to",
            "relay",
            "direct",
            "ratio",
            "99 % by\nrelay",
            "99 %\ndirect",
            "optical",
            "99 %\noptical",
        ],
        [
            ["rate", "1 Mbit/s", "250 GB", "375 GB", "0.667", "4.17 min", "15.8 min", "62.5 GB", "60 min"],
            ["store", "1 GB", "1 TB", "0 B", "", "3.5 min", "15.2 min", "250 GB", "2.22 h"],
            ["store", "9 GB", "500 GB", "250 GB", "2", "3.33 min", "15 min", "125 GB", "50 min"],
        ],
        [0, 1],
        {
            2: "day.relay_could_carry_bit",
            3: "day.direct_could_carry_bit",
            4: "",
            5: "day.relay_latency_99_percent_s",
            6: "day.direct_latency_99_percent_s",
            7: "day.optical_could_carry_bit",
            8: "day.optical_latency_99_percent_s",
        },
    ]


def test_the_data_of_a_day_have_every_number_of_three_ways_under_its_own_name(monkeypatch):
    monkeypatch.setattr(day_data_file.words, "sentences", lambda day: ["said"])
    assert plain(day_data_file.day_data(rich_day())) == {
        "epoch": "an epoch",
        "duration_s": 80000.0,
        "contacts": [
            {
                "start_utc": "2026-03-20T00:10:00.250Z",
                "end_utc": "2026-03-20T00:22:30.250Z",
                "start_s": 600.0,
                "end_s": 1350.0,
                "duration_s": 750.0,
                "begins": "elevation mask of g",
                "ends": "Earth",
                "range_least_m": 2000000.0,
                "range_most_m": 3000000.0,
                "point_ahead_most_rad": 3e-05,
                "line_of_sight_rate_most_rad_s": 0.0007,
                "line_of_sight_acceleration_most_rad_s2": 9e-06,
                "range_rate_most_m_s": 5000.0,
                "doppler_most_hz": 4000000000.0,
                "could_carry_bit": 8000000000.0,
            },
            {
                "start_utc": "2026-03-20T02:00:00.250Z",
                "end_utc": "2026-03-20T02:13:20.250Z",
                "start_s": 7200.0,
                "end_s": 8000.0,
                "duration_s": 800.0,
                "begins": "Earth",
                "ends": "Earth",
                "range_least_m": 3000000.0,
                "range_most_m": 4500000.0,
                "point_ahead_most_rad": 6e-05,
                "line_of_sight_rate_most_rad_s": 0.0014,
                "line_of_sight_acceleration_most_rad_s2": 1.8e-05,
                "range_rate_most_m_s": 10000.0,
                "doppler_most_hz": 8000000000.0,
                "could_carry_bit": 16000000000.0,
            },
        ],
        "visible_share": 0.375,
        "median_contact_s": 777.0,
        "closed_form_contact_s": 888.0,
        "pointing_loss_db": 1.25,
        "pointing_loss_source": "a source",
        "outage": 0.003,
        "rates": [{"rate_bit_s": 622080000.0, "margin_db": 3.5, "largest_range_m": 45000000.0}],
        "relay": {
            "contacts": 2,
            "contact_s": 6000.0,
            "longest_gap_s": 7000.0,
            "could_carry_bit": 24000000000.0,
            "could_carry_least_bit": 12000000000.0,
            "could_carry_most_bit": 40000000000.0,
            "generated_bit": 2400000000000.0,
            "arrived_bit": 200000000000.0,
            "lost_bit": 80000000000.0,
            "on_board_at_end_bit": 40000000000.0,
            "contacts_without_acquisition": 0.125,
            "latency_median_s": 30.0,
            "latency_99_percent_s": 400.0,
        },
        "direct": {
            "contacts": 2,
            "contact_s": 7000.0,
            "longest_gap_s": 7900.0,
            "could_carry_bit": 48000000000.0,
            "could_carry_least_bit": 20000000000.0,
            "could_carry_most_bit": 48000000000.0,
            "generated_bit": 2400000000000.0,
            "arrived_bit": 208000000000.0,
            "lost_bit": 88000000000.0,
            "on_board_at_end_bit": 48000000000.0,
            "contacts_without_acquisition": 0.25,
            "latency_median_s": 31.0,
            "latency_99_percent_s": 500.0,
            "passes": [
                {
                    "start_utc": "2026-03-20T00:08:20.250Z",
                    "end_utc": "2026-03-20T00:15:20.250Z",
                    "start_s": 500.0,
                    "end_s": 920.0,
                    "duration_s": 420.0,
                    "begins": "elevation mask of s",
                    "ends": "the Earth",
                    "station": "a",
                    "highest_elevation_rad": 0.715585,
                    "could_carry_bit": 16000000000.0,
                },
                {
                    "start_utc": "2026-03-20T02:01:40.250Z",
                    "end_utc": "2026-03-20T02:03:10.250Z",
                    "start_s": 7300.0,
                    "end_s": 7390.0,
                    "duration_s": 90.0,
                    "begins": "elevation mask of s",
                    "ends": "the Earth",
                    "station": "b",
                    "highest_elevation_rad": 0.214675,
                    "could_carry_bit": 32000000000.0,
                },
            ],
        },
        "optical": {
            "contacts": 2,
            "contact_s": 8000.0,
            "longest_gap_s": 8800.0,
            "could_carry_bit": 72000000000.0,
            "could_carry_least_bit": 28000000000.0,
            "could_carry_most_bit": 56000000000.0,
            "generated_bit": 2400000000000.0,
            "arrived_bit": 216000000000.0,
            "lost_bit": 96000000000.0,
            "on_board_at_end_bit": 56000000000.0,
            "contacts_without_acquisition": 0.375,
            "latency_median_s": 32.0,
            "latency_99_percent_s": 600.0,
            "passes": [
                {
                    "start_utc": "2026-03-20T00:33:20.250Z",
                    "end_utc": "2026-03-20T00:38:20.250Z",
                    "start_s": 2000.0,
                    "end_s": 2300.0,
                    "duration_s": 300.0,
                    "begins": "elevation mask of s",
                    "ends": "the Earth",
                    "station": "=c",
                    "highest_elevation_rad": 1.39626,
                    "could_carry_bit": 24000000000.0,
                },
                {
                    "start_utc": "2026-03-20T02:30:00.250Z",
                    "end_utc": "2026-03-20T02:30:30.250Z",
                    "start_s": 9000.0,
                    "end_s": 9030.0,
                    "duration_s": 30.0,
                    "begins": "elevation mask of s",
                    "ends": "the Earth",
                    "station": "a",
                    "highest_elevation_rad": 0.575959,
                    "could_carry_bit": 48000000000.0,
                },
            ],
        },
        "sky": {
            "sites": [
                {"name": "=c", "availability": 0.3, "drawn": 0.25},
                {"name": "a", "availability": 0.6, "drawn": 0.65},
            ],
            "any_clear": 0.68,
            "any_clear_drawn": 0.7,
            "any_clear_independent": 0.72,
            "correlation": [[1.0, 0.125], [0.125, 1.0]],
        },
        "assumptions": [
            {
                "name": "rate",
                "factor": 3.0,
                "low": {
                    "value": "1 Mbit/s",
                    "relay_could_carry_bit": 2000000000000.0,
                    "direct_could_carry_bit": 3000000000000.0,
                    "relay_latency_99_percent_s": 250.0,
                    "direct_latency_99_percent_s": 950.0,
                    "optical_could_carry_bit": 500000000000.0,
                    "optical_latency_99_percent_s": 3600.0,
                },
                "high": {
                    "value": "as it is",
                    "relay_could_carry_bit": 4000000000000.0,
                    "direct_could_carry_bit": 2000000000000.0,
                    "relay_latency_99_percent_s": 200.0,
                    "direct_latency_99_percent_s": 900.0,
                    "optical_could_carry_bit": 1000000000000.0,
                    "optical_latency_99_percent_s": 3000.0,
                },
            },
            {
                "name": "store",
                "factor": "inf",
                "low": {
                    "value": "1 GB",
                    "relay_could_carry_bit": 8000000000000.0,
                    "direct_could_carry_bit": 0.0,
                    "relay_latency_99_percent_s": 210.0,
                    "direct_latency_99_percent_s": 910.0,
                    "optical_could_carry_bit": 2000000000000.0,
                    "optical_latency_99_percent_s": 8000.0,
                },
                "high": {
                    "value": "9 GB",
                    "relay_could_carry_bit": 4000000000000.0,
                    "direct_could_carry_bit": 2000000000000.0,
                    "relay_latency_99_percent_s": 200.0,
                    "direct_latency_99_percent_s": 900.0,
                    "optical_could_carry_bit": 1000000000000.0,
                    "optical_latency_99_percent_s": 3000.0,
                },
            },
        ],
        "warnings": ["one", "two"],
        "verdict": ["said"],
    }


def test_the_lines_of_a_days_file_are_of_each_way_in_the_order_of_their_rise(monkeypatch):
    monkeypatch.setattr(day_data_file.words, "sentences", lambda day: [])
    assert day_data_file.day_csv(rich_day()).split("\n") == [
        (
            "by,with,rise (UTC),set (UTC),rise (s),set (s),duration (s),begins by,ends "
            "by,smallest range (m),largest range (m),largest point-ahead (rad),largest rate of "
            "the line of sight (rad/s),largest acceleration of the line of sight "
            "(rad/s^2),largest range rate (m/s),largest Doppler shift (Hz),largest elevation "
            "(rad),could carry (bit)"
        ),
        (
            "direct "
            "downlink,a,2026-03-20T00:08:20.250Z,2026-03-20T00:15:20.250Z,500.0,920.0,420.0,ele"
            "vation mask of s,the Earth,,,,,,,,0.7155849933176751,16000000000.0"
        ),
        (
            "relay,HUB,2026-03-20T00:10:00.250Z,2026-03-20T00:22:30.250Z,600.0,1350.0,750.0,ele"
            "vation mask of "
            "g,Earth,2000000.0,3000000.0,3e-05,0.0007,9e-06,5000.0,4000000000.0,,8000000000.0"
        ),
        (
            "optical "
            "downlink,'=c,2026-03-20T00:33:20.250Z,2026-03-20T00:38:20.250Z,2000.0,2300.0,300.0"
            ",elevation mask of s,the Earth,,,,,,,,1.3962634015954636,24000000000.0"
        ),
        (
            "relay,HUB,2026-03-20T02:00:00.250Z,2026-03-20T02:13:20.250Z,7200.0,8000.0,800.0,Ea"
            "rth,Earth,3000000.0,4500000.0,6e-05,0.0014,1.8e-05,10000.0,8000000000.0,,160000000"
            "00.0"
        ),
        (
            "direct "
            "downlink,b,2026-03-20T02:01:40.250Z,2026-03-20T02:03:10.250Z,7300.0,7390.0,90.0,el"
            "evation mask of s,the Earth,,,,,,,,0.21467549799530256,32000000000.0"
        ),
        (
            "optical "
            "downlink,a,2026-03-20T02:30:00.250Z,2026-03-20T02:30:30.250Z,9000.0,9030.0,30.0,el"
            "evation mask of s,the Earth,,,,,,,,0.5759586531581288,48000000000.0"
        ),
    ]


def test_a_contact_in_time_has_each_number_of_its_second_window_and_transition():
    windows = [
        SimpleNamespace(
            start_s=100.0 + 60.0 * k,
            seconds=0.5 + k,
            range_m=1.2e6 * (k + 1),
            point_ahead_rad=2e-5 * (k + 1),
            rate_rad_s=3e-4 * (k + 1),
            rms_rad=1.25e-6 * (k + 1),
            quantile_rad=3.5e-6 * (k + 1),
            largest_rad=4.75e-6 * (k + 1),
            lowest_margin_db=2.0 - 3.0 * k,
            share_below=0.0025 * k,
        )
        for k in range(2)
    ]
    log = [SimpleNamespace(time_s=40.0 + 30.0 * k, state=f"s{k}", to=f"t{k}", cause=f"c{k}") for k in range(2)]
    run = SimpleNamespace(
        windows=windows, log=log, contact=SimpleNamespace(start_s=70.0, end_s=700.0), seconds={"data": 5.0}, losses=2
    )
    assert told_table(windows_table(run, 0.995)) == [
        "",
        "",
        [
            "since rise (min)",
            "range (km)",
            "point-ahead (µrad)",
            "rate (µrad/s)",
            "rms (µrad)",
            "99.5 % (µrad)",
            "largest (µrad)",
            "lowest margin (dB)",
            "below 0 dB",
        ],
        [
            ["0.50", "1200", "20.0", "300", "1.25", "3.50", "4.75", "+2.00", "0 %"],
            ["1.50", "2400", "40.0", "600", "2.50", "7.00", "9.50", "−1.00", "0.25 %"],
        ],
        [],
        {
            0: "contact.windows.start_s",
            1: "contact.windows.range_m",
            2: "contact.windows.point_ahead_rad",
            3: "contact.windows.rate_rad_s",
            4: "contact.windows.rms_rad",
            5: "contact.windows.quantile_rad",
            6: "contact.windows.largest_rad",
            7: "contact.windows.lowest_margin_db",
            8: "contact.windows.share_below_0_db",
        },
    ]
    assert told_table(contact_report.transitions_table(run)) == [
        "",
        "Every transition of that contact",
        ["state", "to", "cause", "time"],
        [["s0", "t0", "c0", "−30.000 s"], ["s1", "t1", "c1", "0.000 s"]],
        [0, 1, 2],
        {},
    ]
    assert plain(contact_report.contact_run_data(run)) == {
        "start_s": 70.0,
        "end_s": 700.0,
        "seconds_in_state": {"data": 5.0},
        "losses": 2,
        "log": [
            {"time_s": 40.0, "state": "s0", "to": "t0", "cause": "c0"},
            {"time_s": 70.0, "state": "s1", "to": "t1", "cause": "c1"},
        ],
        "windows": [
            {
                "start_s": 100.0,
                "seconds": 0.5,
                "range_m": 1200000.0,
                "point_ahead_rad": 2e-05,
                "rate_rad_s": 0.0003,
                "rms_rad": 1.25e-06,
                "quantile_rad": 3.5e-06,
                "largest_rad": 4.75e-06,
                "lowest_margin_db": 2.0,
                "share_below_0_db": 0.0,
            },
            {
                "start_s": 160.0,
                "seconds": 1.5,
                "range_m": 2400000.0,
                "point_ahead_rad": 4e-05,
                "rate_rad_s": 0.0006,
                "rms_rad": 2.5e-06,
                "quantile_rad": 7e-06,
                "largest_rad": 9.5e-06,
                "lowest_margin_db": -1.0,
                "share_below_0_db": 0.0025,
            },
        ],
    }


def rich_plan(**changes):
    """Two satellites, two relays and two ground stations."""

    def of(k, count):
        scale = np.arange(1.0, count + 1.0)
        names = ("sessions", "served_s", "longest_gap_s", "busy_s", "volume_bit")
        return SimpleNamespace(**{name: scale * (k + 1.0) * (10.0 ** (n + 1)) for n, name in enumerate(names)})

    given = {
        "satellites": ("n0", "n1"),
        "relays": ("east", "west"),
        "stations": ("kiruna", "tromso"),
        "terminals": 3,
        "station_terminals": (1, 4),
        "use": np.array([0.25, 0.5]),
        "station_use": np.array([0.125, 0.75]),
        "span_s": (3600.0, 90000.0),
        "opportunities": SimpleNamespace(start_s=np.array([0.0, 100.0, 900.0]), end_s=np.array([9e3, 9.1e3, 9.9e3])),
        "by_satellite": of(0, 2),
        "by_relay": of(1, 2),
        "by_station": of(2, 2),
        "planned": range(6),
        "volume_bit": 8.8e12,
        "loss": SimpleNamespace(loss_db=0.75, source="a source"),
        "epoch": SimpleNamespace(text="an epoch"),
    }
    return SimpleNamespace(**given | changes)


def test_a_plan_with_two_of_everything_has_each_number_where_it_belongs():
    plan = rich_plan()
    assert plan_sentences(plan) == [
        (
            "2 satellites share 2 relays of 3 terminals each and 2 ground stations of 5 "
            "terminals in all: in 24 h 3 contacts in reach, 8 h in all, of which 6 sessions "
            "take 8 h and carry 1.1 TB."
        ),
        (
            "A satellite has data for 100 s to 3.33 min, and waits 33.3 min at most. Terminals "
            "in use: east 25 %, west 50 %."
        ),
        ("In reach is where the link closes at its lowest rate, with a pointing loss of 0.75 dB (a source)."),
        (
            "90 of the sessions are with ground stations, above their masks, and are expected "
            "to carry 112 kB under their availability. Terminals in use: kiruna 12 %, tromso "
            "75 %."
        ),
    ]
    assert plain(plan_data(plan)) == {
        "epoch": "an epoch",
        "duration_s": 86400.0,
        "contacts": 3,
        "sessions": 6,
        "volume_bit": 8800000000000.0,
        "relays": [{"name": "east", "use": 0.25}, {"name": "west", "use": 0.5}],
        "stations": [
            {"name": "kiruna", "use": 0.125, "sessions": 30, "volume_bit": 300000.0},
            {"name": "tromso", "use": 0.75, "sessions": 60, "volume_bit": 600000.0},
        ],
        "satellites": [
            {"name": "n0", "sessions": 10, "with_data_s": 100.0, "longest_gap_s": 1000.0, "volume_bit": 100000.0},
            {"name": "n1", "sessions": 20, "with_data_s": 200.0, "longest_gap_s": 2000.0, "volume_bit": 200000.0},
        ],
    }
    assert plan_text(plan, 110).split("\n")[7:] == [
        (
            "90 of the sessions are with ground stations, above their masks, and are expected "
            "to carry 112 kB under their"
        ),
        "availability. Terminals in use: kiruna 12 %, tromso 75 %.",
        "",
        "What each satellite gets",
        "",
        " satellite   sessions   with data   longest time without   volume",
        " ─────────────────────────────────────────────────────────────────",
        " n0          10         100 s       16.7 min               12.5 kB",
        " n1          20         3.33 min    33.3 min               25 kB",
        "",
        "What each of them takes",
        "",
        " relay or station   terminals   sessions   in use   volume",
        " ──────────────────────────────────────────────────────────",
        " east               3           20         25 %     25 kB",
        " west               3           40         50 %     50 kB",
        " kiruna             1           30         12 %     37.5 kB",
        " tromso             4           60         75 %     75 kB",
    ]


def test_a_plan_with_one_of_everything_is_told_in_the_singular():
    one = rich_plan(satellites=("n0",), relays=("east",), stations=("kiruna",), terminals=1, station_terminals=(1,))
    one.use, one.station_use = one.use[:1], one.station_use[:1]
    assert plan_sentences(one) == [
        (
            "1 satellite shares 1 relay of one terminal and 1 ground station of one terminal: "
            "in 24 h 3 contacts in reach, 8 h in all, of which 6 sessions take 8 h and carry "
            "1.1 TB."
        ),
        ("A satellite has data for 100 s to 3.33 min, and waits 33.3 min at most. Terminals in use: east 25 %."),
        ("In reach is where the link closes at its lowest rate, with a pointing loss of 0.75 dB (a source)."),
        (
            "90 of the sessions are with ground stations, above their masks, and are expected "
            "to carry 112 kB under their availability. Terminals in use: kiruna 12 %."
        ),
    ]
    assert "first 40 of" not in plan_text(one, 110)


def test_the_words_of_each_way_and_assumption_are_of_their_own_numbers():
    day = rich_day()
    assert day_words.latency_words(day) == [
        (
            "What becomes of the 300 GB that the instrument makes: by the relay 25 GB arrive "
            "(of what is kept half arrives within 30 s, and 99 % within 6.67 min), 10 GB find "
            "the store full, 5 GB are still on board at the end; by the direct downlink 26 GB "
            "arrive (of what is kept half arrives within 31 s, and 99 % within 8.33 min), 11 "
            "GB find the store full, 6 GB are still on board at the end; by the optical "
            "downlink 27 GB arrive (of what is kept half arrives within 32 s, and 99 % within "
            "10 min), 12 GB find the store full, 7 GB are still on board at the end."
        )
    ]
    assert day_words.assumption_words(day) == [
        (
            "What matters most to the ratio of the two volumes, each assumption changed alone: "
            "store (1 GB: nothing direct, 9 GB: 2); rate (1 Mbit/s: 0.667, as it is: 2)."
        ),
        (
            "What matters most to the optical downlink's volume: rate (1 Mbit/s: 62.5 GB); "
            "store (1 GB: 250 GB, 9 GB: 125 GB)."
        ),
        (
            "How late data arrive depends most on store: with 1 GB or 9 GB, 99 % arrive within "
            "3.5 min or 3.33 min by the relay, within 15.2 min or 15 min directly, within 2.22 "
            "h or 50 min by the optical downlink."
        ),
    ]
    assert day_words.assumption_words(rich_day(direct=None, optical=None)) == [
        (
            "What matters most to the relay's volume, each assumption changed alone: store (1 "
            "GB: 1 TB, 9 GB: 500 GB); rate (1 Mbit/s: 250 GB, as it is: 500 GB)."
        ),
        (
            "What matters most to the optical downlink's volume: rate (1 Mbit/s: 62.5 GB); "
            "store (1 GB: 250 GB, 9 GB: 125 GB)."
        ),
        (
            "How late data arrive depends most on store: with 1 GB or 9 GB, 99 % arrive within "
            "3.5 min or 3.33 min by the relay."
        ),
    ]


# ----------------------------------------------------------------------------------------------------- arrays of a day
def arrays_of(group):
    """Each variable of a group with its axes, unit, name and values."""
    found = group.to_xarray().to_dict()
    several = {**found["coords"], **found["data_vars"]}
    return {
        name: [list(each["dims"]), each["attrs"].get("units"), each["attrs"].get("long_name"), plain(each["data"])]
        for name, each in several.items()
    }


def test_arrays_of_contacts_have_each_number_of_the_second_one_too():
    day = rich_day()
    for k, e in enumerate(day.encounters):
        e.contact.ends = f"end {k}"
    assert arrays_of(arrays._contacts(day)) == {
        "start": [["contact"], "s", "begin, since the epoch", [600.0, 7200.0]],
        "end": [["contact"], "s", "end, since the epoch", [1350.0, 8000.0]],
        "begins": [["contact"], "1", "what begins it", ["elevation mask of g", "Earth"]],
        "ends": [["contact"], "1", "what ends it", ["end 0", "end 1"]],
        "range_least": [["contact"], "m", "smallest range", [2000000.0, 3000000.0]],
        "range_most": [["contact"], "m", "largest range", [3000000.0, 4500000.0]],
        "point_ahead": [["contact"], "rad", "largest point-ahead angle", [3e-05, 6e-05]],
        "rate": [["contact"], "rad/s", "largest angular rate of the line of sight", [0.0007, 0.0014]],
        "acceleration": [["contact"], "rad/s^2", "largest change of that rate", [9e-06, 1.8e-05]],
        "doppler": [["contact"], "Hz", "largest Doppler shift in magnitude", [4000000000.0, 8000000000.0]],
        "could_carry": [
            ["contact"],
            "bit",
            "data that it could carry within the span, mean of the runs",
            [8000000000.0, 16000000000.0],
        ],
    }
    assert arrays_of(arrays._passes(day.optical)) == {
        "start": [["contact"], "s", "begin, since the epoch", [2000.0, 9000.0]],
        "end": [["contact"], "s", "end, since the epoch", [2300.0, 9030.0]],
        "begins": [["contact"], "1", "what begins it", ["elevation mask of s", "elevation mask of s"]],
        "ends": [["contact"], "1", "what ends it", ["the Earth", "the Earth"]],
        "station": [["contact"], "1", "ground station", ["=c", "a"]],
        "could_carry": [["contact"], "bit", "data that it could carry within the span", [24000000000.0, 48000000000.0]],
    }


def test_arrays_of_assumptions_have_both_sides_of_three_ways():
    assert arrays_of(arrays._assumptions(rich_day())) == {
        "assumption": [["assumption"], "1", "what is changed", ["rate", "store"]],
        "low": [["assumption"], "1", "low side of the change", ["1 Mbit/s", "1 GB"]],
        "relay_low": [["assumption"], "bit", "relay with the low side", [2000000000000.0, 8000000000000.0]],
        "direct_low": [["assumption"], "bit", "direct with the low side", [3000000000000.0, 0.0]],
        "relay_latency_99_percent_low": [
            ["assumption"],
            "s",
            "relay latency 99 percent with the low side",
            [250.0, 210.0],
        ],
        "direct_latency_99_percent_low": [
            ["assumption"],
            "s",
            "direct latency 99 percent with the low side",
            [950.0, 910.0],
        ],
        "optical_low": [["assumption"], "bit", "optical with the low side", [500000000000.0, 2000000000000.0]],
        "optical_latency_99_percent_low": [
            ["assumption"],
            "s",
            "optical latency 99 percent with the low side",
            [3600.0, 8000.0],
        ],
        "high": [["assumption"], "1", "high side of the change", ["as it is", "9 GB"]],
        "relay_high": [["assumption"], "bit", "relay with the high side", [4000000000000.0, 4000000000000.0]],
        "direct_high": [["assumption"], "bit", "direct with the high side", [2000000000000.0, 2000000000000.0]],
        "relay_latency_99_percent_high": [
            ["assumption"],
            "s",
            "relay latency 99 percent with the high side",
            [200.0, 200.0],
        ],
        "direct_latency_99_percent_high": [
            ["assumption"],
            "s",
            "direct latency 99 percent with the high side",
            [900.0, 900.0],
        ],
        "optical_high": [["assumption"], "bit", "optical with the high side", [1000000000000.0, 1000000000000.0]],
        "optical_latency_99_percent_high": [
            ["assumption"],
            "s",
            "optical latency 99 percent with the high side",
            [3000.0, 3000.0],
        ],
    }
    assert len(arrays_of(arrays._assumptions(rich_day(optical=None)))) == 11


def test_arrays_of_lines_of_sight_stand_one_contact_after_the_other():
    names = ("time_s", "range_m", "range_rate_m_s", "rate_rad_s", "acceleration_rad_s2", "point_ahead_rad")
    encounters = []
    for k, size in enumerate((2, 3)):
        sight = {name: 10.0 * (n + 1) + k + 0.25 * np.arange(size) for n, name in enumerate(names)}
        sight["doppler_hz"] = lambda wavelength, k=k, size=size: (k + 1.0) * np.arange(size) / wavelength
        encounters.append(SimpleNamespace(sight=SimpleNamespace(**sight)))
    day = rich_day(encounters=encounters, data=SimpleNamespace(table=SimpleNamespace(wavelength_m=0.5)))
    assert arrays_of(arrays._line_of_sight(day)) == {
        "contact": [["sample"], "1", "number of the contact in the span, from 1", [1.0, 1.0, 2.0, 2.0, 2.0]],
        "time": [["sample"], "s", "time since the epoch", [10.0, 10.25, 11.0, 11.25, 11.5]],
        "range": [["sample"], "m", "range", [20.0, 20.25, 21.0, 21.25, 21.5]],
        "range_rate": [["sample"], "m/s", "range rate, positive while they recede", [30.0, 30.25, 31.0, 31.25, 31.5]],
        "doppler": [["sample"], "Hz", "frequency received less sent", [0.0, 2.0, 0.0, 4.0, 8.0]],
        "rate": [["sample"], "rad/s", "angular rate of the line of sight", [40.0, 40.25, 41.0, 41.25, 41.5]],
        "acceleration": [["sample"], "rad/s^2", "change of that rate, as a vector", [50.0, 50.25, 51.0, 51.25, 51.5]],
        "point_ahead": [["sample"], "rad", "point-ahead angle", [60.0, 60.25, 61.0, 61.25, 61.5]],
    }


def test_arrays_of_sessions_and_of_a_contact_in_time_have_each_field():
    names = ("start_s", "locked_s", "end_s", "rate_bit_s", "volume_bit")
    planned = [
        SimpleNamespace(satellite=f"n{k}", relay=f"r{k}", **{name: 100.0 * (n + 1) + k for n, name in enumerate(names)})
        for k in range(2)
    ]
    assert arrays_of(arrays._sessions(rich_plan(planned=planned))) == {
        "satellite": [["session"], "1", "satellite", ["n0", "n1"]],
        "relay": [["session"], "1", "relay", ["r0", "r1"]],
        "start": [["session"], "s", "begin, since the epoch", [100.0, 101.0]],
        "locked": [["session"], "s", "from when data flow, since the epoch", [200.0, 201.0]],
        "end": [["session"], "s", "end, since the epoch", [300.0, 301.0]],
        "data_rate": [["session"], "bit/s", "data rate", [400.0, 401.0]],
        "volume": [["session"], "bit", "volume", [500.0, 501.0]],
    }
    log = [SimpleNamespace(time_s=40.0 + k, state=f"s{k}", to=f"t{k}", cause=f"c{k}") for k in range(2)]
    own = ("start_s", "range_m", "point_ahead_rad", "rate_rad_s", "rms_rad", "largest_rad", "lowest_margin_db")
    windows = [SimpleNamespace(**{name: 10.0 * (n + 1) + k for n, name in enumerate(own)}) for k in range(3)]
    assert arrays_of(arrays._contact_run(SimpleNamespace(log=log, windows=windows))) == {
        "state": [["transition"], "1", "state that is left", ["s0", "s1"]],
        "to": [["transition"], "1", "state that follows", ["t0", "t1"]],
        "cause": [["transition"], "1", "why", ["c0", "c1"]],
        "time": [["transition"], "s", "time since the epoch", [40.0, 41.0]],
        "window_start": [["window"], "s", "begin of the window, since the epoch", [10.0, 11.0, 12.0]],
        "range": [["window"], "m", "range", [20.0, 21.0, 22.0]],
        "point_ahead": [["window"], "rad", "point-ahead angle", [30.0, 31.0, 32.0]],
        "rate": [["window"], "rad/s", "angular rate of the line of sight", [40.0, 41.0, 42.0]],
        "rms": [["window"], "rad", "radial rms of the pointing error", [50.0, 51.0, 52.0]],
        "largest": [["window"], "rad", "largest radial pointing error", [60.0, 61.0, 62.0]],
        "lowest_margin": [["window"], "dB", "lowest margin of the communication link", [70.0, 71.0, 72.0]],
    }


def test_the_groups_of_a_day_are_named_by_its_ways(monkeypatch):
    for name in ("_contacts", "_line_of_sight", "_assumptions", "_day_way", "_passes", "_contact_run", "_sessions"):
        monkeypatch.setattr(arrays, name, lambda *of, name=name: arrays.Group({}))
    day = rich_day()
    assert sorted(arrays._day(day, object(), object())) == [
        "day/assumptions",
        "day/contact_run",
        "day/contacts",
        "day/direct_downlink",
        "day/line_of_sight",
        "day/optical_downlink",
        "day/optical_passes",
        "day/passes",
        "day/relay",
        "day/sessions",
    ]
    assert sorted(arrays._day(rich_day(direct=None), None, None)) == [
        "day/assumptions",
        "day/contacts",
        "day/line_of_sight",
        "day/optical_downlink",
        "day/optical_passes",
        "day/relay",
    ]
    assert {each.attributes["epoch"] for each in arrays._day(day, None, None).values()} == {"an epoch"}


@pytest.mark.parametrize("capacity_bit", [0.0, 1e-9])
def test_a_day_without_any_capacity_of_the_relay_leads_its_page_as_bad(monkeypatch, capacity_bit):
    links = SimpleNamespace(file=SimpleNamespace(sources={"a": "b"}))
    day = SimpleNamespace(relay=SimpleNamespace(capacity_bit=capacity_bit))
    monkeypatch.setattr(day_page_module.words, "sentences", lambda of: ["headline", "more"])
    viewed = []
    monkeypatch.setattr(day_page_module, "day_view", lambda *given: viewed.append(given))
    monkeypatch.setattr(day_page_module, "marked", lambda views, sources: [])
    monkeypatch.setattr("microrad.report.day.figures.day_figures", lambda of: ())
    monkeypatch.setattr("microrad.report.page.templates.inputs_view", lambda sources: "inputs")
    monkeypatch.setattr("microrad.report.page.templates.mission_page", lambda *given: given)
    file, kind, (lead,), views = day_page_module.day_page(day, links)
    assert (file, kind, views) == (links.file, "contacts", ["inputs"])
    assert (lead.headline, lead.good) == ("headline", capacity_bit > 0.0)
    assert viewed == [(day, ["more"], ())]  # the headline is not said again


def test_the_view_of_a_rich_day_has_its_tables_and_opens_two_of_its_pictures():
    figures = [SimpleNamespace(name=name, title=name.title()) for name in ("a-map", "data-volume", "day-timeline", "b")]
    view = day_page_module.day_view(rich_day(), ["one said", "another"], figures, None, day_page_module.View("last"))
    assert view.anchor == "delivers"
    assert outline(view) == one_text("""
# What the link delivers
one said
another
Warnings:
- one
- two
| What the ways could carry: 3 GB by relay and 6 GB by direct downlink and 9 GB by optical downlink; line by line:
  / relay / direct downlink / optical downlink [0]
contacts / 2 / 2 / 2
time in contact / 100 min / 117 min / 133 min
longest time without contact / 117 min / 2.19 h / 2.44 h
could carry / 3 GB / 6 GB / 9 GB
contacts without acquisition / 0.125 /  /
made by the instrument / 300 GB / 300 GB / 300 GB
lost for want of room / 10 GB / 11 GB / 12 GB
on board at most / 20 GB / 21 GB / 22 GB
on board at the end of what is followed / 5 GB / 6 GB / 7 GB
arrive / 25 GB / 26 GB / 27 GB
latency of what is kept, median / 30 s / 31 s / 32 s
latency of what is kept, 99 % / 6.67 min / 8.33 min / 10 min
| Every contact: by / rise (UTC) / set / min / range; (km) / point-ahead; (µrad) / rate; (µrad/s) / Doppler; (GHz) /
  highest; (deg) / could; carry / begins and ends by [0, 10] brief [0, 1, 2, 3, 9, 10]
a / 2026-03-20 00:08:20 / 00:15:20 / 7.00 /  /  /  /  / 41.0 / 2 GB / mask to the Earth
HUB / 2026-03-20 00:10:00 / 00:22:30 / 12.50 / 2000 to 3000 / 30.0 / 700 / 4.00 /  / 1 GB / mask to Earth
=c, optical / 2026-03-20 00:33:20 / 00:38:20 / 5.00 /  /  /  /  / 80.0 / 3 GB / mask to the Earth
HUB / 2026-03-20 02:00:00 / 02:13:20 / 13.33 / 3000 to 4500 / 60.0 / 1400 / 8.00 /  / 2 GB / Earth
b / 2026-03-20 02:01:40 / 02:03:10 / 1.50 /  /  /  /  / 12.3 / 4 GB / mask to the Earth
a, optical / 2026-03-20 02:30:00 / 02:30:30 / 0.50 /  /  /  /  / 33.0 / 6 GB / mask to the Earth
| Share of the time without clouds: optical station / clear / in the runs [0]
=c / 30.0 % / 25.0 %
a / 60.0 % / 65.0 %
any of them / 68.0 % / 70.0 %
any of them, were clouds independent / 72.0 % /
| One assumption changed, all others as they are: assumption / changed to / relay / direct / ratio / 99 % by; relay
  / 99 %; direct / optical / 99 %; optical [0, 1]
rate / 1 Mbit/s / 250 GB / 375 GB / 0.667 / 4.17 min / 15.8 min / 62.5 GB / 60 min
store / 1 GB / 1 TB / 0 B /  / 3.5 min / 15.2 min / 250 GB / 2.22 h
store / 9 GB / 500 GB / 250 GB / 2 / 3.33 min / 15 min / 125 GB / 50 min
# A-Map (folded)
[a-map]
[data-volume]
[day-timeline]
# B (folded)
[b]
# last
""")


@pytest.mark.parametrize(("warned", "warnings", "said"), [(True, ("w",), 0), (False, (), 0), (False, ("w",), 1)])
def test_the_warnings_of_a_day_stand_in_its_view_unless_they_stand_elsewhere(warned, warnings, said):
    lines = outline(day_page_module.day_view(rich_day(warnings=warnings), (), (), warned=warned)).split("\n")
    assert lines.count("Warnings:") == lines.count("- w") == said


@pytest.mark.parametrize(
    ("days", "count", "said"),
    [
        (1.0, 3, "is in view 3 times, 90 min in all"),
        (1.0 + 5e-10, 3, "is in view 3 times, 90 min in all"),
        (2.0, 3, "is in view 3 times, 90 min in all (1.5 times, 45 min a day)"),
        (0.5, 3, "is in view 3 times, 90 min in all"),
        (1.5, 3, "is in view 3 times, 90 min in all (2 times, 60 min a day)"),
        (3.0, 3, "is in view 3 times, 90 min in all (once, 30 min a day)"),
        (10.0, 1, "is in view once, 90 min in all (0.1 times, 9 min a day)"),
        (2.0, 0, "is never in view"),
    ],
)
def test_contacts_are_told_by_the_day_from_more_than_one_day_on(days, count, said):
    day = a_day(view=SimpleNamespace(days=days, duration_s=86400.0 * days, partner="relay"))
    way = a_way(contacts=range(count))
    assert day_words._how_much(day, way) == said
    granted = said.replace("is never in view", "never grants the link").replace("is in view", "grants the link")
    assert day_words._how_much(day, way, whole=False) == granted


def test_a_plan_of_forty_satellites_is_whole_and_one_more_is_counted():
    def plan(count):
        every = SimpleNamespace(
            **{
                name: np.arange(1.0, count + 1)
                for name in ("sessions", "served_s", "longest_gap_s", "busy_s", "volume_bit")
            }
        )
        return rich_plan(satellites=tuple(f"n{k}" for k in range(count)), by_satellite=every, stations=())

    whole, more = plan_text(plan(40), 200), plan_text(plan(41), 200)
    assert " n39 " in whole and "--csv" not in whole
    assert " n39 " in more and " n40 " not in more
    assert more.endswith("The first 40 of 41 satellites; --csv has every session.")
    assert "What each of them takes" not in whole and "ground" not in whole
    assert "stations" not in plan_data(plan(2))


@pytest.mark.parametrize(
    ("relays", "terminals", "station_terminals", "begin"),
    [
        (("e",), 3, (), "2 satellites share 1 relay of 3 terminals: in"),
        (("e", "w"), 1, (), "2 satellites share 2 relays of one terminal each: in"),
        (("e",), 1, (2,), "2 satellites share 1 relay of one terminal and 1 ground station of 2 terminals: in"),
        (
            ("e",),
            1,
            (1, 1),
            "2 satellites share 1 relay of one terminal and 2 ground stations of 2 terminals in all: in",
        ),
    ],
)
def test_relays_and_stations_of_a_plan_are_counted_each_in_its_number(relays, terminals, station_terminals, begin):
    use = np.full(len(relays), 0.5)
    stations = tuple(f"s{k}" for k in range(len(station_terminals)))
    more = {"stations": stations, "station_terminals": station_terminals, "station_use": np.full(len(stations), 0.5)}
    said = plan_sentences(rich_plan(relays=relays, terminals=terminals, use=use, **more))
    assert said[0].startswith(begin) and len(said) == 3 + bool(stations)


def test_the_numbers_of_relays_and_stations_are_named_by_what_each_is():
    table = partners_table(rich_plan())
    of = ["relays.east", "relays.west", "stations.kiruna", "stations.tromso"]
    assert dict(table.names) == {
        place: [f"constellation.{each}.{what}" for each in of]
        for place, what in ((2, "sessions"), (3, "use"), (4, "volume_bit"))
    }
    assert dict(satellites_table(rich_plan()).names) == {
        place: f"constellation.satellites.x.{what}"
        for place, what in enumerate(("sessions", "with_data_s", "longest_gap_s", "volume_bit"), 1)
    }
    assert partners_table(rich_plan(stations=())) is None


def test_one_thing_of_a_day_is_told_in_the_singular():
    operations = SimpleNamespace(runs=1)
    assert day_words.sky_words(a_day(sky=sky_of("kiruna"), operations=operations)) == [
        "The sky over kiruna is clear for 75.0 % of the time (50.0 % in the one drawn sky)."
    ]
    for losses, end in ((0, "lock is never lost in it."), (1, "lock is lost once in it, once in 50 s, which the rest")):
        (said,) = contact_sentences(run_of(windows=range(1), losses=losses, losses_per_s=0.02), 2, "PI", None)
        assert "The fine loop is simulated in 1 window, 1.5 s in all" in said and end in said
    one = SimpleNamespace(start_s=np.array([0.0]), end_s=np.array([9e3]))
    station = SimpleNamespace(**{**vars(rich_plan().by_station), "sessions": np.array([1.0, 0.0])})
    said = plan_sentences(rich_plan(opportunities=one, planned=range(1), by_station=station))
    assert "1 contact in reach, 2 h in all, of which 1 session takes 8 h and carries 1.1 TB." in said[0]
    assert said[3].startswith("1 of the sessions is with ground stations, above their masks, and is expected to carry")


def test_shares_and_ratios_of_a_day_have_no_power_of_ten():
    window = SimpleNamespace(
        start_s=0.0,
        range_m=1e6,
        point_ahead_rad=0.0,
        rate_rad_s=0.0,
        rms_rad=0.0,
        quantile_rad=0.0,
        largest_rad=0.0,
        lowest_margin_db=-1.0,
        share_below=1.0,
    )
    run = SimpleNamespace(windows=[window], contact=SimpleNamespace(start_s=0.0))
    assert windows_table(run, 0.997).rows[0][-1] == "100 %"
    assert day_words.ratio_text(SimpleNamespace(ratio=12345.0, direct_bit=1.0)) == "12300"


# ----------------------------------------------------------------------------------------- more than two, out of order
def test_a_contact_that_never_comes_to_data_ends_by_the_last_of_its_causes():
    log = [SimpleNamespace(cause=cause) for cause in ("the rise", "no beacon", "the set")]
    assert contact_sentences(run_of(data_s=0.0, log=log), 3, "PI", None) == [
        "Contact 3 of 10 min never comes to data: the set."
    ]


def test_the_satellites_that_are_served_least_and_most_stand_anywhere_among_the_others():
    of = SimpleNamespace(
        served_s=np.array([120.0, 60.0, 300.0, 240.0]),
        longest_gap_s=np.array([3600.0, 7200.0, 1800.0, 5400.0]),
        busy_s=np.array([3600.0, 7200.0, 3600.0, 0.0]),
    )
    first, second, *_ = plan_sentences(rich_plan(satellites=("a", "b", "c", "d"), by_satellite=of))
    assert second == (
        f"A satellite has data for {duration(60.0)} to {duration(300.0)}, and waits {duration(7200.0)} at most. "
        "Terminals in use: east 25 %, west 50 %."
    )
    assert first.startswith("4 satellites share 2 relays of 3 terminals each and 2 ground stations of 5 terminals in")
    assert "6 sessions take 4 h and carry" in first


def test_at_most_three_of_four_assumptions_that_move_the_relay_are_named_the_weightiest_first():
    swings = [swing_of(name=name, of_relay=of) for name, of in (("a", 1.2), ("b", 3.0), ("c", 1.05), ("d", 2.0))]
    swings.append(swing_of(name="e", of_relay=1.5))
    day = replace_namespace(day_of(None, None), swings=swings)
    assert day_words.assumption_words(day) == [
        "What matters most to the relay's volume, each assumption changed alone: b (l: 1 GB, h: 1 GB); d (l: 1 GB, "
        "h: 1 GB); e (l: 1 GB, h: 1 GB)."
    ]


def test_both_satellites_are_named_where_they_never_meet():
    pair = SimpleNamespace(leo=SimpleNamespace(name="LOW"), geo=SimpleNamespace(name="HUB"))
    day = SimpleNamespace(view=SimpleNamespace(encounters=(), pair=pair))
    assert day_words.contact_words(day) == (
        "There is no contact: within the span and the limits of the mission, LOW and HUB do not see one another."
    )


@pytest.mark.parametrize("direct", [True, False])
def test_a_file_of_contacts_has_the_optical_passes_where_there_is_no_other_downlink(monkeypatch, direct):
    """A station's name that a spreadsheet would compute is made text; rows stand by their rise."""
    monkeypatch.setattr(day_data_file.words, "sentences", lambda day: [])
    day = rich_day() if direct else rich_day(direct=None)
    rows = list(csv.DictReader(io.StringIO(day_data_file.day_csv(day))))
    found = [(row["by"], row["with"], float(row["rise (s)"]), row["largest range (m)"] != "") for row in rows]
    ground = [("direct downlink", "a", 500.0, False), ("direct downlink", "b", 7300.0, False)] if direct else []
    assert found == sorted(
        [
            ("relay", "HUB", 600.0, True),
            ("relay", "HUB", 7200.0, True),
            ("optical downlink", "'=c", 2000.0, False),
            ("optical downlink", "a", 9000.0, False),
            *ground,
        ],
        key=lambda row: row[2],
    )


# ------------------------------------------------------------------ arrays of controllers that do not have all the same
def test_arrays_of_residuals_are_nan_where_a_controller_did_not_run_on_a_mirror_and_0_where_it_met_no_limit():
    """The second of two controllers has a mirror that the first has not, and lacks one of its two."""

    def of(k, shares):
        numbers = {"rms_rad": k, "rms_interval_rad": k / 10.0, "quantile_rad": 3.0 * k, "largest_rad": 5.0 * k}
        return SimpleNamespace(**numbers, axis_rms_rad=[k / 2.0, k / 4.0], shares=shares)

    first, *_, last = limits = [*arrays.COUNTERS]
    verified = [
        SimpleNamespace(design=SimpleNamespace(name="PI"), simulated={"b": of(1.0, {last: 0.5}), "a": of(2.0, {})}),
        SimpleNamespace(design=SimpleNamespace(name="LQG"), simulated={"c": of(4.0, {first: 0.25}), "b": of(8.0, {})}),
    ]
    fine = SimpleNamespace(
        verified=verified,
        quantile=0.99,
        best=verified[1],
        scene=SimpleNamespace(loop=SimpleNamespace(axes=2)),
    )
    group = arrays._residuals(fine)
    found = {name: values for name, (*_, values) in arrays_of(group).items()}
    assert [found[name] for name in ("controller", "mirror", "axis", "limit")] == [
        ["PI", "LQG"],
        ["b", "a", "c"],
        ["x", "y"],
        limits,
    ]
    assert found["rms"] == [[1.0, 2.0, "nan"], [8.0, "nan", 4.0]]
    assert found["rms_interval"] == [[0.1, 0.2, "nan"], [0.8, "nan", 0.4]]
    assert found["quantile"] == [[3.0, 6.0, "nan"], [24.0, "nan", 12.0]]
    assert found["largest"] == [[5.0, 10.0, "nan"], [40.0, "nan", 20.0]]
    assert found["axis_rms"] == [[[0.5, 0.25], [1.0, 0.5], ["nan"] * 2], [[4.0, 2.0], ["nan"] * 2, [2.0, 1.0]]]
    none, zeros = ["nan"] * len(limits), [0.0] * len(limits)
    assert found["share"] == [
        [[*zeros[1:], 0.5], zeros, none],
        [zeros, none, [0.25, *zeros[1:]]],
    ]
    assert group.attributes == {"quantile": 0.99, "best": "LQG"}


def test_arrays_of_the_theory_are_nan_for_a_source_that_a_controller_does_not_have(monkeypatch):
    parts = {"PI": {"noise": 1.0, "OLYMPUS": 2.0}, "LQG": {"OLYMPUS": 4.0, "gauge": 8.0}}
    monkeypatch.setattr(arrays, "sources", lambda verified: ["OLYMPUS", "gauge", "noise"])
    monkeypatch.setattr(arrays, "rms_by_source", lambda each: parts[each.design.name])
    verified = [
        SimpleNamespace(design=SimpleNamespace(name=name), theory=SimpleNamespace(radial_rms_rad=10.0 * (k + 1)))
        for k, name in enumerate(parts)
    ]
    found = arrays_of(arrays._theory(SimpleNamespace(verified=verified, optimum_rad=0.5)))
    assert {name: values for name, (*_, values) in found.items()} == {
        "controller": ["PI", "LQG"],
        "source": ["OLYMPUS", "gauge", "noise"],
        "rms_by_source": [[2.0, "nan", 1.0], [4.0, 8.0, "nan"]],
        "rms": [10.0, 20.0],
        "bound": 0.5,
    }


def test_a_loop_and_a_trace_have_each_curve_about_the_bias_that_is_its_own():
    loop = SimpleNamespace(
        freq_hz=0.5, drive_v=np.array([-1.0, 2.0]), output_rad=np.array([3.0, 4.0]),
        hysteresis_rad=np.array([5.0, 6.0]), width=0.25, clamped=7,
    )  # fmt: skip
    other = SimpleNamespace(**vars(loop) | {"freq_hz": 80.0, "drive_v": np.array([0.0, 1.0]), "clamped": 0})
    file = SimpleNamespace(mission=SimpleNamespace(mirror=SimpleNamespace(bias_v=6.0)))
    found = arrays._loops(SimpleNamespace(file=file, loops=[loop, other]))
    assert list(found) == ["hysteresis_loops/0.5_hz", "hysteresis_loops/80_hz"]
    first, second = ({name: values for name, (*_, values) in arrays_of(each).items()} for each in found.values())
    assert first == {"drive": [5.0, 8.0], "output": [3.0, 4.0], "hysteresis": [5.0, 6.0]}
    assert second["drive"] == [6.0, 7.0]
    assert found["hysteresis_loops/0.5_hz"].attributes == {
        "frequency_hz": 0.5, "width": 0.25, "rate_clamped_samples": 7,
    }  # fmt: skip
    curves = {
        f"{name}": np.array([[k + 0.25, 99.0], [k + 0.5, 99.0], [k + 0.75, 99.0]])
        for k, name in enumerate(("reference_rad", "output_rad", "command_v", "drive_v"))
    }
    kinds = ("clamped", "inverse_clamped", "saturated", "slew_limited", "alternating")
    trace = SimpleNamespace(
        **curves, time_s=np.array([0.0, 0.1, 0.2]), peak_rad=1.5, rms_rad=1.25, steady=slice(2, None),
        counts=SimpleNamespace(**{name: k + 1 for k, name in enumerate(kinds)}),
    )  # fmt: skip
    group = arrays._trace(SimpleNamespace(trace=trace, mirror="given", controller="PID + inverse", freq_hz=25.0))
    assert {name: values for name, (*_, values) in arrays_of(group).items()} == {
        "time": [0.0, 0.1, 0.2],
        "reference": [0.25, 0.5, 0.75],
        "output": [1.25, 1.5, 1.75],
        "command": [2.25, 2.5, 2.75],
        "drive": [3.25, 3.5, 3.75],
    }
    assert group.attributes == {
        "mirror": "given",
        "controller": "PID + inverse",
        "frequency_hz": 25.0,
        "peak_error_rad": 1.5,
        "rms_error_rad": 1.25,
        "steady_from_sample": 2,
        "rate_clamped_steps": 1,
        "rate_clamped_inverse_samples": 2,
        "saturated_samples": 3,
        "slew_limited_steps": 4,
        "alternating_samples": 5,
    }


@pytest.mark.parametrize(
    ("share", "relays", "said"),
    [
        (1.0, 0, "the relay is never in view"),
        (0.75, 0, "the relay never grants the link"),
        (0.75, 3, "the relay grants the link 3 times, 90 min in all"),
        (1.0, 3, "the relay is in view 3 times, 90 min in all"),
        (None, 3, "the relay is in view 3 times, 90 min in all"),
    ],
)
def test_a_relay_of_a_share_of_the_time_grants_its_link_and_others_are_in_view(share, relays, said):
    """The ground, which stands beside it, is in view in either case."""
    down = SimpleNamespace(stations=("b", "a"))
    operations = None if share is None else SimpleNamespace(relay_share=share, downlink=down, optical=None, runs=1)
    direct = a_way(contacts=range(2), contact_s=600.0, capacity_bit=4e12)
    day = a_day(relay=a_way(contacts=range(relays)), direct=direct, operations=operations, ratio=2.0)
    stations = "" if share is None else "b, a"
    (found,) = day_words.headline(day)
    assert found == (
        f"In {duration(86400.0)} {said}, and could carry 1 TB. The ground ({stations}) is in view 2 times, 10 min in "
        "all, and could carry 500 GB; the relay could carry 2 times as much."
    )


@pytest.mark.parametrize(
    ("least_bit", "most_bit", "runs", "spread"),
    [(4e12, 8e12, 5, ", from 500 GB to 1 TB by the weather drawn"), (8e12, 8e12, 1, "")],
)
def test_the_optical_downlink_tells_how_far_the_weather_parts_its_volumes(least_bit, most_bit, runs, spread):
    way = a_way(capacity_bit=7.2e12, capacity_spread_bit=(least_bit, most_bit))
    optical = SimpleNamespace(stations=("y", "x", "z"))
    of = SimpleNamespace(relay_share=1.0, downlink=None, optical=optical, runs=runs)
    day = a_day(operations=of, view=SimpleNamespace(days=3.0, duration_s=259200.0, partner="relay"))
    assert day_words._optical_words(day, way) == (
        "Optical ground stations (y, x, z) are in use for 90 min (30 min a day), and could carry 900 GB (300 GB a day)"
        f"{spread}"
    )
    never = day_words._optical_words(day, a_way(contacts=()))
    assert never == "Optical ground stations (y, x, z) are never used"
