"""A series of received power that a mission names: its table, its numbers in the budget, what is refused."""

import json
import math
import os
import re
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from link_files import data_with, received_with, written
from link_files import link_file as whole_link
from microrad import link, report
from microrad.link.fade_series import CodedLink, FadeSeriesError, code, coded_fading, of_mission, read_fade_series
from microrad.link.requirement import UNDER_FADES, Requirement, of_links
from microrad.link.study import run_link_study
from microrad.mission.file import MissionError, named_files, with_contents
from microrad.mission.model import Source
from microrad.report.links.figures import link_figures
from microrad.report.links.views import cost_text, links_views
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.sheet import Line, Rule
from microrad.report.view import View
from microrad.studio.views import link as link_view
from places import ROOT

PERIOD_S, TARGET = 1e-4, 1e-6
ALONE = dict.fromkeys(("beacon", "answer", "acquisition"))
TABLE = {
    "series": "fades.csv",
    "unit": "linear",
    "normalised": "mean",
    "code": "ccsds-k7-1-2",
    "interleaving": "block",
    "interleaver": "5 ms",
    "bit_error_ratio": TARGET,
}


def link_file(folder, *changes):
    """The paper's communication link, without the beams and the search for the partner."""
    return whole_link(folder, ALONE, *changes)


def said(call, code, *args):
    """What a budget prints."""
    found = call("budget", *args)
    assert found.code == code
    return found.out


def fading(**others):
    table = {key: value for key, value in {**TABLE, **others}.items() if value is not None}
    return {"communication.fading": table}


def fades(folder, deep=0.5, count=2000):
    """A file with fades of some milliseconds."""
    time_s = PERIOD_S * np.arange(count)
    power = 1.0 + deep * np.sin(2.0 * math.pi * 30.0 * time_s) * np.cos(2.0 * math.pi * 6.0 * time_s)
    rows = "".join(f"{t:.4f},{p:.9g}\n" for t, p in zip(time_s, power, strict=True))
    (folder / "fades.csv").write_text("time (s),power\n" + rows)


def test_of_a_file_with_several_channels_the_one_that_is_named_is_read(tmp_path):
    fades(tmp_path)
    head, *rows = (tmp_path / "fades.csv").read_text().splitlines()
    (tmp_path / "both.csv").write_text("\n".join([f"{head},other", *(f"{row},1" for row in rows)]) + "\n")
    one, both = (link_file(tmp_path, fading(**more)) for more in ({}, {"series": "both.csv", "channel": "power"}))
    assert run_link_study(both).fading.penalty_db == run_link_study(one).fading.penalty_db


@pytest.mark.promise("readme-7", "link-85", "link-86")
def test_the_study_has_what_the_series_makes_of_its_static_margin(tmp_path):
    fades(tmp_path)
    file = link_file(tmp_path, fading())
    study = run_link_study(file)
    static = link.communication_budget(study.data, file.sources).margin_db
    series = read_fade_series(tmp_path / "fades.csv", unit="linear", normalised="mean", name="fades.csv")
    assert series.period_s == pytest.approx(PERIOD_S, rel=1e-6, abs=0.0)
    own = coded_fading(CodedLink(code("ccsds-k7-1-2"), series, 300e6, "block", 5e-3), static, TARGET)
    found = study.fading
    assert (found.penalty_db, found.ratio, found.lost) == (own.penalty_db, own.ratio, own.lost)
    assert (found.margin_db, found.target, found.span_s, found.words) == (static, TARGET, 5e-3, 40)
    assert 0.5 < found.penalty_db < 3.0
    (judged,) = (each for each in of_links(study) if each.name == UNDER_FADES)
    assert judged.actual == static - found.penalty_db
    assert not judged.met
    assert named_files(file.mission) == ("fades.csv",)
    assert with_contents(file).contents[0].content == (tmp_path / "fades.csv").read_bytes()
    jittered = link_file(
        tmp_path,
        fading(),
        {"jitter": {"bias": ["0 rad", "0 rad"], "rms": ["2 urad", "2 urad"], "bandwidth": "100 Hz"}},
        {"requirement.outage": 0.003},
    )
    assert run_link_study(jittered).fading.margin_left_db == found.margin_left_db


@pytest.mark.promise("link-86", "link-100")
def test_terminal_csv_json_and_page_have_the_same_numbers(tmp_path, call):
    fades(tmp_path)
    path = written(tmp_path, data_with(ALONE | fading()))
    found = json.loads(said(call, 1, str(path), "--json"))["fading"]
    assert 0.0 <= found["bit_error_ratio_interval"][0] < found["bit_error_ratio"]
    assert found["bit_error_ratio"] < found["bit_error_ratio_interval"][1] < 1e-2
    assert found["lost_interval"][0] <= found["lost"] <= found["lost_interval"][1]
    assert found["margin_db"] == pytest.approx(found["static_margin_db"] - found["penalty_db"], rel=1e-12, abs=1e-12)
    assert found["curve"]["span_s"][0] == 0.0
    assert found["curve"]["penalty_db"][0] > found["penalty_db"] > found["curve"]["penalty_db"][-1]
    assert found["fades"]["mean_s"] <= found["fades"]["ninetieth_s"] <= found["fades"]["longest_s"]
    text = " ".join(said(call, 1, str(path)).split())
    assert "Under the fades of fades.csv, ccsds-k7-1-2 with a block interleaver over 5 ms" in text
    assert f"the fades cost {found['penalty_db']:.2f} dB" in text
    assert f"Penalty of the fades,{-found['penalty_db']!r},dB" in said(call, 1, str(path), "--csv")
    page = said(call, 1, str(path), "--html")
    assert "What an interleaver brings" in page
    assert "Extra power that brings the mean bit error ratio back to 10\u207b\u2076 under fades.csv" in page
    assert cost_text(found["curve"]["penalty_db"][0]) in page
    without = json.loads(said(call, 0, str(written(tmp_path, data_with(ALONE))), "--json"))
    assert "fading" not in without


@pytest.mark.promise("link-100")
def test_the_figure_has_the_curve_the_missions_own_span_and_what_the_margin_spares(tmp_path):
    fades(tmp_path)
    study = run_link_study(link_file(tmp_path, fading()))
    figure = link_figures(study)[-1]
    assert figure.name == "interleaver"
    assert [*figure.columns["span (s)"]] == [*study.fading.curve.span_s]
    assert [*figure.columns["power that the fades cost (dB)"]] == [*study.fading.curve.penalty_db]
    (panel,) = figure.sheet.panels
    curve, own = panel.all_of(Line)
    assert [*curve.x] == [1e3 * each for each in study.fading.curve.span_s[1:]]
    assert (own.x[0], own.y[0]) == (5.0, study.fading.penalty_db)
    without, spare = panel.all_of(Rule)
    required = study.file.mission.requirement.margin_db
    assert (without.at, spare.at) == (study.fading.curve.penalty_db[0], study.fading.margin_db - required)
    unspread = run_link_study(link_file(tmp_path, fading(interleaving="none", interleaver=None)))
    assert len(link_figures(unspread)[-1].sheet.panels[0].all_of(Line)) == 1
    assert "interleaver" not in [each.name for each in link_figures(run_link_study(link_file(tmp_path)))]


@pytest.mark.promise("link-100")
@pytest.mark.parametrize("faded", [True, False])
def test_report_and_studio_draw_the_same_curve(tmp_path, monkeypatch, faded):
    fades(tmp_path)
    study = run_link_study(link_file(tmp_path, fading() if faded else {}))
    for module, name in (
        ("paper.bench", "bench_figures"),
        ("paper.figures", "paper_figures"),
        ("fine_pointing.figures", "fine_pointing_figures"),
        ("fine_pointing.tails", "tail_figures"),
    ):
        monkeypatch.setattr(f"microrad.report.{module}.{name}", lambda *args: ())
    of_report = report.study_figures(SimpleNamespace(links=study, error_budget=None, day=None)).links

    def drawn(blocks):
        for each in blocks:
            yield from drawn(each.blocks) if isinstance(each, View) else [each]

    for views in (links_views(study, of_report), link_view.blocks(study)):
        shown = [each for each in drawn(views) if isinstance(each, Figure) and each.name == "interleaver"]
        assert len(shown) == faded
        for figure in shown:
            assert [*figure.columns["span (s)"]] == [*study.fading.curve.span_s]
            assert figure.svg == link_figures(study)[-1].svg


def test_fades_that_no_power_makes_up_for_are_said(tmp_path, call):
    fades(tmp_path)
    text = (tmp_path / "fades.csv").read_text().splitlines()
    dark = [f"{line.split(',')[0]},0" if 700 < k < 760 else line for k, line in enumerate(text)]
    (tmp_path / "fades.csv").write_text("\n".join(dark) + "\n")
    study = run_link_study(link_file(tmp_path, fading(interleaving="none", interleaver=None)))
    assert study.fading.penalty_db == math.inf
    assert cost_text(study.fading.penalty_db) == "beyond any power"
    (view,) = (each for each in links_views(study) if each.title == "Coded link under fades")
    assert "without an interleaver" in view.blocks[0]
    assert "the fades cost more than any power makes up for" in view.blocks[0]
    answered = call("budget", str(tmp_path / "link.toml"), "--json")
    assert json.loads(answered.out)["fading"]["penalty_db"] is None
    assert answered.code == 1, "a margin that is infinitely short is missed"
    advised = "no power meets it: change communication.fading.interleaver or communication.fading.code."
    assert advised in " ".join(said(call, 1, str(tmp_path / "link.toml")).split())
    assert [r.met for r in of_links(study) if r.name == UNDER_FADES] == [False]


@pytest.mark.parametrize(
    ("margin", "met"), [(-math.inf, False), (-1e-8, False), (-1e-10, True), (0.0, True), (math.inf, True)]
)
def test_rounding_makes_up_for_nothing_that_is_infinitely_short(margin, met):
    assert Requirement("communication", UNDER_FADES, "dB", 3.0, 3.0 + margin, margin, "fades of the series").met is met


@pytest.mark.promise("link-85", "link-87")
@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        (fading(interleaving="none"), "interleaver", 'does not belong to interleaving = "none"'),
        (fading(interleaver=None), "interleaver", 'is missing, and interleaving = "block" needs it'),
        (fading(bit_error_ratio=None), "bit_error_ratio", "is missing, and so is the table receiver"),
        (fading(sampling="-1 us"), "sampling", "is not above 0 s"),
        (fading(unit="W"), "unit", "is none of the choices"),
        (fading(code="turbo"), "code", "is none of the choices"),
        (fading() | received_with("homodyne bpsk"), "bit_error_ratio", "stands beside that of the table receiver"),
        (
            fading(bit_error_ratio=None) | received_with("counting ppm"),
            "code",
            'is of BPSK, and the receiver has modulation = "ppm"',
        ),
    ],
)
def test_a_table_that_does_not_fit_is_refused_with_its_line(tmp_path, changes, key, words):
    with pytest.raises(MissionError) as refused:
        link_file(tmp_path, changes)
    (fault,) = refused.value.faults
    assert fault.key == f"communication.fading.{key}"
    assert words in fault.reason
    assert fault.expected


@pytest.mark.promise("link-85")
def test_the_table_of_the_page_is_one_that_a_mission_takes(tmp_path):
    page = (ROOT / "docs" / "link.md").read_text(encoding="utf-8")
    (table,) = (each for each in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "communication.fading" in each)
    power = 1.0 + 0.5 * np.sin(2.0 * math.pi * 30.0 * PERIOD_S * np.arange(2000))
    (tmp_path / "fades.csv").write_text("power\n" + "".join(f"{p:.9g}\n" for p in power))
    given = tomllib.loads(table)["communication"]["fading"]
    file = link_file(tmp_path, {"communication.fading": given})
    found = run_link_study(file).fading
    assert (found.span_s, found.target, found.words) == (5e-3, 1e-6, 40)
    sliding = run_link_study(link_file(tmp_path, {"communication.fading": {**given, "interleaving": "convolutional"}}))
    assert sliding.fading.words == 2000 - 50 + 1
    unsaid = {key: value for key, value in given.items() if key != "sampling"}
    with pytest.raises(FadeSeriesError, match="does not say how fast it was sampled"):
        run_link_study(link_file(tmp_path, {"communication.fading": unsaid}))


@pytest.mark.promise("link-99")
def test_no_series_is_made_where_none_is_given(tmp_path):
    fades(tmp_path)
    assert run_link_study(link_file(tmp_path, fading())).fading.words > 0
    bare = {"series": None, "unit": None, "normalised": None}
    assert run_link_study(link_file(tmp_path, fading(**bare))).fading is None
    for key, value in (("unit", "linear"), ("normalised", "mean"), ("sampling", "1 ms")):
        with pytest.raises(MissionError) as refused:
            link_file(tmp_path, fading(**{**bare, key: value}))
        (fault,) = refused.value.faults
        assert (fault.key, fault.reason) == (f"communication.fading.{key}", "stands without a series")


@pytest.mark.parametrize(("key", "example"), [("unit", 'unit = "linear"'), ("normalised", 'normalised = "mean"')])
def test_a_series_needs_its_unit_and_what_it_is_relative_to(tmp_path, key, example):
    with pytest.raises(MissionError) as refused:
        link_file(tmp_path, fading(**{key: None}))
    (fault,) = refused.value.faults
    assert (fault.key, fault.reason) == (f"communication.fading.{key}", "is missing, and series needs it")
    assert fault.expected == f"{example} would do"


@pytest.mark.promise("link-85")
def test_a_receiver_has_the_target_of_the_series(tmp_path):
    fades(tmp_path)
    file = link_file(tmp_path, fading(bit_error_ratio=None), received_with("homodyne bpsk", bit_error_ratio=1e-5))
    assert run_link_study(file).fading.target == 1e-5


@pytest.mark.promise("link-88")
@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"series": "absent.csv"}, "absent.csv: there is no such file"),
        ({"interleaver": "2 s"}, "fades.csv: the series lasts 800 ms and the interleaver spans 2 s; give a series"),
        ({"sampling": "1 ms"}, "two sample rates"),
        ({"unit": "dB", "series": "negative.csv"}, "the powers are in W, and the unit given is 'dB'"),
    ],
)
def test_a_series_that_cannot_be_used_is_refused_with_the_line_that_names_it(tmp_path, call, others, words):
    fades(tmp_path, count=8000)
    (tmp_path / "negative.csv").write_text("power (W)\n" + "1\n" * 300)
    file = link_file(tmp_path, fading(**others))
    line = file.sources["communication.fading.series"].line
    assert file.text.splitlines()[line - 1].startswith("series = ")
    with pytest.raises(FadeSeriesError) as refused:
        run_link_study(file)
    assert f"communication.fading, mission file, line {line}: " in str(refused.value)
    assert words in str(refused.value)
    told = call("budget", str(tmp_path / "link.toml"))
    assert told.code == 2
    assert words.partition(":")[0] in " ".join(told.err.split())


@pytest.mark.parametrize("changed", ["size", "time", "nothing"])
def test_a_series_is_read_again_where_its_file_has_changed_in_size_or_time(tmp_path, changed):
    table = link_file(tmp_path, fading()).mission.communication.fading
    place = tmp_path / "fades.csv"

    def write(last, moment_s):
        rows = [f"{PERIOD_S * k:.4f},{1 + k % 2}" for k in range(256)]
        place.write_text("\n".join(["time (s),power", *rows[:-1], f"{PERIOD_S * 255:.4f},{last}", ""]))
        os.utime(place, ns=(moment_s * 10**9, moment_s * 10**9))
        return of_mission.series_of(table, tmp_path)

    first = write("2", 1000)
    again = write("2.5" if changed == "size" else "3", 1001 if changed == "time" else 1000)
    assert (again is first) is (changed == "nothing")  # then nobody can tell
    assert of_mission.series_of(table, tmp_path) is again
    place.unlink()
    with pytest.raises(FadeSeriesError):
        of_mission.series_of(table, tmp_path)


@pytest.mark.parametrize(("source", "where"), [
    (None, "communication.fading: "),
    (Source(7, "paper: Fig. 3", '"absent.csv"'), "communication.fading, mission file, line 7: "),
    (Source(12, "", '"absent.csv"', "station.toml"), "communication.fading, station.toml, line 12: "),
])  # fmt: skip
def test_a_series_that_is_not_there_is_told_by_the_file_and_the_line_that_name_it(tmp_path, source, where):
    data = link.of(link_file(tmp_path, fading(series="absent.csv")).mission)
    sources = {"communication.fading.unit": Source(3, "", '"linear"')}
    sources |= {} if source is None else {"communication.fading.series": source}
    with pytest.raises(FadeSeriesError) as refused:
        of_mission.fading_of(data, tmp_path, sources)
    assert str(refused.value).startswith(f"{where}{tmp_path / 'absent.csv'}: there is no such file")


@pytest.mark.parametrize(("others", "kind", "span_s"), [
    ({"interleaving": "none", "interleaver": None}, "none", 0.0),
    ({"interleaving": "convolutional", "interleaver": "3 ms"}, "convolutional", 3e-3),
])  # fmt: skip
def test_the_code_of_a_mission_is_spread_as_its_table_says(tmp_path, monkeypatch, others, kind, span_s):
    fades(tmp_path)
    file = link_file(tmp_path, fading(**others))
    data, asked = link.of(file.mission), []
    monkeypatch.setattr(of_mission, "coded_fading", lambda *given: asked.append(given) or "found")
    assert of_mission.fading_of(data, tmp_path, file.sources) == "found"
    ((coded, margin_db, target),) = asked
    assert (coded.interleaving, coded.span_s, coded.code.name) == (kind, span_s, "ccsds-k7-1-2")
    assert (coded.series.source, coded.series.normalised, coded.data_rate_bit_s) == ("fades.csv", "mean", 300e6)
    assert margin_db == link.communication_budget(data, {}).margin_db and target == TARGET
