"""The budget of pointing errors as tables, figures, arrays and plain data: the same numbers in each."""

import io
import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray

from budget_files import kept_study, looped_study
from microrad import report
from microrad.link.error_budget import ErrorSource, Requirement, Spread, assembly
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.report.error_budget import figures, page
from microrad.report.error_budget import words as budget_words
from microrad.report.error_budget.data import budget_data
from microrad.report.error_budget.page import budget_view
from microrad.report.plotting.sheet import Bars, Line, Rule
from microrad.report.quantities import micro, percent
from microrad.report.results import tolerances
from microrad.report.results.arrays import study_netcdf
from microrad.report.results.comparison import is_number, leaves
from microrad.report.study.data import summary
from microrad.report.study.page import StudyFigures, study_page, study_views
from microrad.report.tables import Table
from microrad.report.view import Points, View, views_text
from report_pages import assert_sound

P = 0.9973


def tables(view):
    return [block for block in view.blocks if isinstance(block, Table)]


@pytest.fixture(scope="module")
def looped():
    return looped_study()


@pytest.mark.promise("pointing-49")
def test_contributions_add_up_to_the_total_by_the_distribution(looped):
    for each in looped.error_budget.judged:
        parts = math.fsum(share.part_rad for share in each.shares)
        assert parts == pytest.approx(each.total.quantile_rad, rel=1e-3)


@pytest.mark.promise("report-6")
@pytest.mark.promise("pointing-47", "pointing-56")
def test_the_page_has_every_source_with_its_class_statistic_origin_and_contribution(looped):
    (view,) = (each for each in study_views(looped, StudyFigures()) if each.title == "Pointing error budget")
    requirements, sources = tables(view)
    judged = {each.name: each for each in looped.error_budget.judged}
    word = judged["code_word"]
    row = next(row for row in requirements.rows if row[0] == "code word")
    assert [str(cell) for cell in row[2:]] == [
        f"{micro(word.total.by_rules_rad)} {'PASS' if word.total.by_rules_rad <= 4e-6 else 'FAIL'}",
        f"{micro(word.total.quantile_rad)} {'PASS' if word.total.holds else 'FAIL'}",
        "4.00",
    ]
    share = next(share for share in judged["drift"].shares if share.name == "thermo_elastic")
    row = next(row for row in sources.rows if row[0] == "thermo elastic")
    assert row[1:3] == ("periodic", "fixed")
    assert row[5:7] == (micro(share.part_rad), percent(share.growth))
    origins = {row[0]: row[-1] for row in sources.rows}
    assert origins["alignment"] == "assumption: calibrated on the ground"
    assert origins["vibration (OLYMPUS)"].endswith(f"under {looped.fine_pointing.best.design.name}")
    (remarks,) = (block for block in view.blocks if isinstance(block, Points))
    assert any("simulated with hysteresis" in line for line in remarks.lines)
    inner = [block for block in view.blocks if isinstance(block, View)]
    assert [each.title for each in inner] == ["code word: each source", "drift: each source"]


@pytest.mark.promise("pointing-49", "pointing-63")
def test_a_terminal_of_80_columns_has_all_of_it(looped):
    text = views_text(budget_view(looped.error_budget).blocks, 80)
    assert max(map(len, text.splitlines())) <= 80
    for words in ("Contributions, µrad", "code word: each source", "nothing is left", "By the rules"):
        assert words in text


@pytest.mark.promise("pointing-49")
def test_the_row_of_a_source_has_its_moments_about_both_axes_and_what_may_become_of_it(looped):
    """2 µrad at 3 sigma with gains of 1 and 0.5: in a mean over a window about both axes, and in nothing without it."""
    of = next(each for each in looped.error_budget.judged if each.name == "code_word")
    (view,) = (each for each in budget_view(looped.error_budget).views if each.title == "code word: each source")
    (table,) = tables(view)
    assert table.headings == ("source", "mean", "deviation", "weight", "total without it", "may be")
    for row, share in zip(table.rows, of.shares, strict=False):
        both = [micro(math.hypot(*share.mean_rad)), micro(math.hypot(*share.sigma_rad))]
        assert len(share.mean_rad) == len(share.sigma_rad) == 2
        assert [str(cell) for cell in row[1:5]] == [*both, percent(share.growth), micro(share.without_rad)]


@pytest.mark.promise("plots-2")
@pytest.mark.promise("report-6")
@pytest.mark.promise("pointing-47")
def test_figures_have_the_numbers_of_the_budget(looped):
    judged = looped.error_budget.judged
    bars, curves, spectra = figures.budget_figures(looped.error_budget)
    for each, panel in zip(judged, bars.sheet.panels, strict=True):
        drawn = math.fsum(float(np.sum(mark.end)) for mark in panel.all_of(Bars))
        assert drawn == pytest.approx(1e6 * each.total.quantile_rad, rel=1e-3)
        assert panel.x.title.endswith("(µrad)")
    for each, panel in zip(judged, curves.sheet.panels, strict=True):
        limit, rules, allowed = (mark.at for mark in panel.all_of(Rule))
        required = each.total.required
        assert (limit, rules) == (1e6 * required.limit_rad, 1e6 * each.total.by_rules_rad)
        curve, dot = panel.all_of(Line)
        at = np.interp(float(dot.x[0]), curve.x, np.log(curve.y))
        assert at == pytest.approx(math.log(allowed), rel=0.02)
        assert allowed == pytest.approx(100.0 * (1.0 - required.confidence))
    above, below = spectra.sheet.panels
    left = above.all_of(Line)[-1]
    assert left.label == f"left by the loop under {looped.fine_pointing.best.design.name}"
    held = np.isfinite(left.y)
    power = float(np.sum(np.diff(left.x[held]) * 0.5 * (left.y[held][1:] + left.y[held][:-1])))
    theory = float(np.sum(looped.fine_pointing.best.theory.error))
    assert power == pytest.approx(1e12 * theory, rel=0.05)  # of the control samples, and theory is of all plant steps
    assert [line.label for line in below.all_of(Line)] == ["weight of RPE 10 ms: code word"]
    assert len(above.all_of(Rule)) == 1  # of the periodic source


def test_a_weight_is_that_of_the_index_where_it_does_not_ripple():
    freq = np.geomspace(1e-3, 1e3, 400)
    for kind in ("MPE", "RPE"):
        index = ErrorIndex(kind, 1.0)
        found, exact = figures.mean_weight(index, freq), index.weight(freq)
        slow = freq < 0.3
        assert np.allclose(found[slow], exact[slow], atol=2e-3)
    apart = figures.mean_weight(ErrorIndex("PDE", 1e-3, 600.0), freq)
    assert np.mean(apart[(freq > 1.0) & (freq < 30.0)]) == pytest.approx(2.0, rel=0.02)  # twice that of a mean


def test_stacked_requirements_stand_below_each_other(looped):
    for figure in figures.budget_figures(looped.error_budget, stacked=True):
        assert {panel.column for panel in figure.sheet.panels} == {0}


def test_many_sources_are_drawn_up_to_a_number_and_the_others_together():
    sources = [ErrorSource(f"noise {n}", "random", Spread("fixed", n * 1e-7), np.ones(1)) for n in range(1, 21)]
    required = Requirement(ErrorIndex("APE"), axes=(0,), limit_rad=1e-5)
    (each,) = assembly.judge(assembly.stated(sources, {"all": required}), None).judged
    (panel,) = figures.contributions([each]).sheet.panels
    assert len(panel.y.words) == 16
    assert panel.y.words[15.0] == "5 others"
    assert panel.y.words[0.0] == "noise 20"
    drawn = math.fsum(float(np.sum(mark.end)) for mark in panel.all_of(Bars))
    assert drawn == pytest.approx(1e6 * each.total.quantile_rad, rel=1e-3)


@pytest.mark.promise("report-13")
@pytest.mark.promise("pointing-56")
def test_what_a_command_prints_says_where_the_rules_are_too_small():
    """A transient that is rare and large: three deviations are less than it is for a quarter of a percent of times."""
    rare = ErrorSource("unloading", "transient", Spread("fixed", 2e-5), np.ones(1), period_s=5700.0, decay_s=100.0)
    sources = [rare, ErrorSource("noise", "random", Spread("fixed", 1e-6), np.ones(1))]
    asked = {name: Requirement(ErrorIndex("APE"), share, axes=(0,)) for name, share in (("strict", P), ("loose", 0.9))}
    found = assembly.judge(assembly.stated(sources, asked), None)
    strict, loose = (each.total.by_rules_rad / each.total.quantile_rad for each in found.judged)
    assert strict < 0.9 and loose > 1.0
    said = " ".join(views_text(budget_view(found).blocks, 80).split()).partition("The rules are too small for ")[2]
    assert said.startswith(f"strict ({percent(1.0 - strict)}).")


def test_results_and_summary_hold_what_the_page_shows(looped):
    tree = xarray.open_datatree(io.BytesIO(study_netcdf(looped)), engine="h5netcdf")
    required, sources = tree["error_budget/requirements"], tree["error_budget/sources"]
    data = {each["requirement"]: each for each in summary(looped)["error_budget"]}
    assert [*data] == list(required["requirement"].values)
    for name, each in data.items():
        row = required.sel(requirement=name)
        assert float(row["by_distribution"]) == each["by_distribution_rad"]
        own = sources["contribution"].values[sources["requirement"].values == name]
        assert own.tolist() == [source["contribution_rad"] for source in each["sources"]]
        assert np.interp(each["by_distribution_rad"], row["error"], row["beyond"]) == pytest.approx(
            1.0 - each["confidence"], rel=0.05
        )
    assert tree["error_budget/spectra"]["density"].attrs["units"] == "rad^2/Hz"


def test_every_number_of_the_budget_has_a_stated_tolerance(looped):
    data = {"error_budget": budget_data(looped.error_budget)}
    places = [place for place, _, was, _ in leaves(data, data, "") if is_number(was) and not isinstance(was, bool)]
    assert len(places) > 90
    assert [place for place in places if tolerances.stated(place) is None] == []
    names = [figure.name for figure in figures.budget_figures(looped.error_budget)]
    assert [name for name in names if tolerances.stated_for_figure(name) is None] == []


def test_the_page_of_a_study_with_a_budget_is_sound():
    found = kept_study()
    drawn = report.study_figures(found)
    assert [figure.name for figure in drawn.errors] == ["pointing-errors-contributions", "pointing-errors-distribution"]
    manifest = {key: {} for key in ("inputs_sha256", "machine", "files_sha256")}
    manifest |= {"mission": {"file": "m.toml", "sha256": ""}, "mirror": None, "randomness": ""}
    page = study_page(found, drawn, manifest)
    assert_sound(page)
    assert page.count('id="pointing-error-budget"') == 1
    assert page.count('id="figure-pointing-errors-') == 2


def test_a_list_without_limits_has_no_marks_and_says_nothing_of_what_may_be(tmp_path):
    asked = assembly.stated(
        assembly.sources_of(kept_study().file.mission.error_budget, {}),
        {"APE": Requirement(ErrorIndex("APE"))},
    )
    view = budget_view(assembly.judge(asked, None))
    requirements, _ = tables(view)
    assert [str(cell) for cell in requirements.rows[0][2:]][2] == ""
    (inner,) = (block for block in view.blocks if isinstance(block, View))
    assert "may be" not in inner.blocks[1].headings


# ------------------------------------------------------------------------------------------------- limits and nothing
def share_of(key, part_rad, kind="random"):
    of = SimpleNamespace(name=key, kind=kind)
    return SimpleNamespace(key=(key, kind), part_rad=part_rad, contribution=of, growth=0.5)


def judged_of(*parts, total_rad=1e-6, rules_rad=1e-6, name="total", limit_rad=None):
    required = Requirement(ErrorIndex("APE"), P, limit_rad=limit_rad)
    total = SimpleNamespace(quantile_rad=total_rad, by_rules_rad=rules_rad, required=required)
    curves = {"size_rad": np.linspace(0.0, total_rad, 3), "beyond": np.array([1.0, 0.5, 0.0])}
    return SimpleNamespace(name=name, total=total, shares=[share_of(*part) for part in parts], **curves)


def test_a_budget_of_nothing_is_drawn():
    none = judged_of(("a", 0.0), total_rad=0.0, rules_rad=0.0)
    (panel,) = figures.contributions([none]).sheet.panels
    assert (panel.x.low, panel.x.high) == (0.0, 1.0)
    assert figures._weight(none, {("a", "random"): 1.0}, ("a", "random")) == 0.0
    (panel,) = figures.distributions([none]).sheet.panels
    assert panel.x.high == 1.0
    assert budget_words._too_small([none]) == []
    freq = np.geomspace(1.0, 10.0, 3)
    budget = SimpleNamespace(freq_hz=freq, spectra={"a": np.zeros(3)}, lines_hz={}, judged=[])
    above, _ = figures.spectra(budget).sheet.panels
    assert (above.y.low, above.y.high) == (1e-6, 3.0)
    budget.spectra = {"a": np.full(3, 1e-12), "b": np.array([2e-12, np.nan, 0.0])}
    above, _ = figures.spectra(budget).sheet.panels
    assert (above.y.low, above.y.high) == (pytest.approx(2e-6), pytest.approx(6.0))


def test_bars_to_both_sides_have_room_for_their_numbers():
    (panel,) = figures.contributions([judged_of(("a", 2e-6), ("b", -1e-6))]).sheet.panels
    assert (panel.x.low, panel.x.high) == (pytest.approx(-1.1), pytest.approx(1.35 * 2.0))


@pytest.mark.parametrize(
    ("count", "rows", "others"), [(15, 15, ""), (16, 16, ""), (17, 16, "2 others"), (18, 16, "3 others")]
)
def test_sixteen_sources_are_drawn_by_themselves(count, rows, others):
    parts = [(f"s{k:02d}", (count - k) * 1e-6) for k in range(count)]
    (panel,) = figures.contributions([judged_of(*parts)]).sheet.panels
    names = list(panel.y.words.values())
    assert len(names) == rows
    assert names[0] == "s00"
    assert (names[-1] == others) is bool(others)


@pytest.mark.parametrize(
    ("count", "across"), [(1, [(0, 0)]), (3, [(0, 0), (0, 1), (0, 2)]), (4, [(0, 0), (0, 1), (1, 0), (1, 1)])]
)
def test_four_requirements_stand_two_by_two(count, across):
    every = [judged_of(("a", 1e-6), name=f"r{k}") for k in range(count)]
    assert [(p.row, p.column) for p in figures.contributions(every).sheet.panels] == across
    five = [judged_of(("a", 1e-6), name=f"r{k}") for k in range(5)]
    assert [p.column for p in figures.contributions(five).sheet.panels] == [0, 1, 2, 0, 1]


@pytest.mark.parametrize(("limit_rad", "rules"), [(None, 0), (2e-6, 1)])
def test_a_limit_is_drawn_where_there_is_one(limit_rad, rules):
    (panel,) = figures.distributions([judged_of(("a", 1e-6), limit_rad=limit_rad)]).sheet.panels
    drawn = [rule.at for rule in panel.all_of(Rule) if rule.label == "limit"]
    assert drawn == ([] if limit_rad is None else [pytest.approx(2.0)])
    assert (panel.x.low, panel.x.high) == (0.0, pytest.approx(1.1))


@pytest.mark.parametrize(
    ("total_rad", "limit_rad", "mark"), [(1e-6, 1e-6, "PASS"), (1.001e-6, 1e-6, "FAIL"), (1e-6, None, "")]
)
def test_a_total_at_its_limit_passes(total_rad, limit_rad, mark):
    assert page._marked(total_rad, limit_rad).mark == mark
    assert budget_words.limit_text(limit_rad) == ("" if limit_rad is None else "1.00")


def test_a_source_that_a_requirement_does_not_count_has_empty_cells():
    assert page._contribution(None) == ("", "")
    assert page._contribution(share_of("a", 1e-6)) == ("1.00", "50 %")


@pytest.mark.parametrize(
    ("rules_rad", "said"),
    [(1e-6, []), (0.9991e-6, []), (0.99e-6, ["The rules are too small for total (1 %)."]), (1.1e-6, [])],
)
def test_rules_are_too_small_by_more_than_a_thousandth(rules_rad, said):
    assert budget_words._too_small([judged_of(rules_rad=rules_rad)]) == said
