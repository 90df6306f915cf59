"""The budget of pointing errors as tables, figures, arrays and plain data: the same numbers in each."""

import io
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray

from budget_files import kept_study, looped_study
from drawn import figure_of, one_text, outline, plain
from microrad import report
from microrad.link.error_budget import ErrorSource, Requirement, Share, Spread, assembly
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.report.error_budget import figures, page
from microrad.report.error_budget import words as budget_words
from microrad.report.error_budget.data import budget_data
from microrad.report.error_budget.page import budget_view
from microrad.report.fine_pointing.windows import index_text
from microrad.report.plotting.sheet import Bars, Line, Rule
from microrad.report.quantities import micro, percent
from microrad.report.results import arrays, tolerances
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
    short = replace(looped, runs=looped.runs[:1])  # each trace of the paper's loop takes a while to write
    tree = xarray.open_datatree(io.BytesIO(study_netcdf(short)), engine="h5netcdf")
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


@pytest.mark.usefixtures("undrawn")
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


# ----------------------------------------------------------------------- two unlike requirements, held as a whole
def a_share(name, kind, k, total_rad, allowed):
    """What one source means; all of its numbers follow from ``k``."""
    made = SimpleNamespace(name=name, kind=kind, statistic=f"statistic {k}", origin=f"origin {k}")
    moments = np.array([3e-7, 4e-7]) * k, np.array([5e-7, 12e-7]) * k
    return Share(made, total_rad, *moments, 1e-6 * (k + 1), 0.0625 * k, allowed)


def two_requirements():
    """One with a limit that is missed by the rules alone, about two axes; one about one axis without a limit."""
    first = Requirement(ErrorIndex("APE"), 0.9973, "mixed", (0, 1), 5e-6)
    second = Requirement(ErrorIndex("PDE", 0.5, 3.0), 0.95, "ensemble", (1,), None, 60.0)
    found = []
    given = (first, "code_word", 6e-6, 4e-6), (second, "slow_drift", 2e-6, 3e-6)
    for required, name, rules_rad, quantile_rad in given:
        total = SimpleNamespace(
            required=required,
            by_rules_rad=rules_rad,
            quantile_rad=quantile_rad,
            mean_rad=np.array([6e-7, 8e-7]),
            sigma_rad=np.array([9e-7, 12e-7]),
            holds=None if required.limit_rad is None else True,
        )
        names = [("tip_tilt", "random"), ("heat", "drift"), ("wheel", "loop"), ("bias", "constant")]
        allowed = [1.5, math.inf, 0.0, None]
        shares = [a_share(*of, k + 1, quantile_rad, allowed[k]) for k, of in enumerate(names)]
        shares = shares[::-1] if name == "code_word" else shares[:2]
        curves = {"size_rad": np.array([0.0, 2e-6, 6.25e-6]), "beyond": np.array([1.0, 0.25, 0.0])}
        found.append(SimpleNamespace(name=name, total=total, shares=shares, **curves))
    return found


def two_spectra():
    freq = np.array([1.0, 10.0, 100.0])
    spectra = {"left_over": np.array([4e-12, 2e-12, 1e-12]), "other": np.array([1e-12, 8e-12, np.nan])}
    lines = {"fan_one": 20.0, "pump": 50.0}
    return SimpleNamespace(judged=two_requirements(), freq_hz=freq, spectra=spectra, lines_hz=lines)


@pytest.mark.parametrize("stacked", [False, True])
def test_each_contribution_stands_in_the_panel_of_its_requirement(stacked):
    figure = figures.contributions(two_requirements(), stacked)
    assert [(p.row, p.column) for p in figure.sheet.panels] == ([(0, 0), (1, 0)] if stacked else [(0, 0), (0, 1)])
    assert (figure.sheet.heights, figure.sheet.widths) == (((1, 1), (1,)) if stacked else ((1,), (1, 1)))


def test_contributions_to_two_unlike_requirements_as_a_whole():
    assert figure_of(figures.contributions(two_requirements())) == [
        "pointing-errors-contributions",
        "What each source contributes",
        (
            "What each source contributes to the total by the distribution, in the share by "
            "which the total grows with it: the bars of a requirement add up to its total. "
            "Colours are the classes."
        ),
        {
            "source": ["bias", "wheel", "heat", "tip_tilt"],
            "contribution to code_word (rad)": [1e-06, 7.5e-07, 5e-07, 2.5e-07],
            "contribution to slow_drift (rad)": ["nan", "nan", 3.75e-07, 1.875e-07],
        },
        "Sheet width=7.6 height=2.34 widths=[1 1] share_y=True legend=<place=above columns=8>",
        ("Panel 0 0 x=<title=contribution (µrad) low=0 high=1.35 most=4> y=<low=3.6 high=-0.6 ticks={0:"),
        "  bias, 1: wheel, 2: heat, 3: tip tilt} grid=False size=8> title=code word",
        "Bars at=[0] start=[0] end=[1] breadth=[0.68] colour=#0072B2 label=constant",
        "Bars at=[1] start=[0] end=[0.75] breadth=[0.68] colour=#777777 label=loop",
        "Bars at=[2] start=[0] end=[0.5] breadth=[0.68] colour=#D55E00 label=drift",
        "Bars at=[3] start=[0] end=[0.25] breadth=[0.68] colour=#E69F00 label=random",
        "Words text=1.00 x=1 y=0 size=7.5 shift=[3 0]",
        "Words text=0.750 x=0.75 y=1 size=7.5 shift=[3 0]",
        "Words text=0.500 x=0.5 y=2 size=7.5 shift=[3 0]",
        "Words text=0.250 x=0.25 y=3 size=7.5 shift=[3 0]",
        ("Panel 0 1 x=<title=contribution (µrad) low=0 high=0.50625 most=4> y=<low=3.6 high=-0.6 ticks={0:"),
        "  bias, 1: wheel, 2: heat, 3: tip tilt} grid=False size=8> title=slow drift",
        "Bars at=[0] start=[0] end=[0] breadth=[0.68] colour=#0072B2 label=constant",
        "Bars at=[1] start=[0] end=[0] breadth=[0.68] colour=#777777 label=loop",
        "Bars at=[2] start=[0] end=[0.375] breadth=[0.68] colour=#D55E00 label=drift",
        "Bars at=[3] start=[0] end=[0.1875] breadth=[0.68] colour=#E69F00 label=random",
        "Words text=0 x=0 y=0 size=7.5 shift=[3 0]",
        "Words text=0 x=0 y=1 size=7.5 shift=[3 0]",
        "Words text=0.375 x=0.375 y=2 size=7.5 shift=[3 0]",
        "Words text=0.188 x=0.1875 y=3 size=7.5 shift=[3 0]",
    ]


def test_distributions_under_two_unlike_requirements_as_a_whole():
    assert figure_of(figures.distributions(two_requirements())) == [
        "pointing-errors-distribution",
        "Distribution of each pointing error",
        (
            "Share of the times, satellites or both, as the requirement counts them, with a "
            "larger error, by the full distribution. The dot is the total, where no more than "
            "the share that is allowed lies beyond: left of the limit the requirement is met."
        ),
        {
            "size, code_word (rad)": [0.0, 2e-06, 6.25e-06],
            "share beyond it, code_word": [1.0, 0.25, 0.0],
            "size, slow_drift (rad)": [0.0, 2e-06, 6.25e-06],
            "share beyond it, slow_drift": [1.0, 0.25, 0.0],
        },
        "Sheet width=7.6 height=3.25 widths=[1 1] legend=<place=above columns=5>",
        "Panel 0 0 x=<title=radial error (µrad) low=0 high=6.6 most=6> y=<title=larger errors (%)",
        "  log=True low=0.009 high=200> title=code word: APE, 99.73 %",
        "Line x=[0 2 6.25] y=[100 25 0.0009] colour=#0072B2 width=1.6 label=larger errors",
        "Rule at=5 upright=True colour=#D55E00 dash=-- width=1.4 label=limit",
        "Rule at=6 upright=True colour=#777777 dash=-. width=1.2 label=total by the rules",
        "Rule at=0.27 upright=False dash=: width=0.9 label=share allowed",
        "Line x=[4] y=[0.27] dash= label=total by the distribution marker=o",
        "Panel 0 1 x=<title=error about y (µrad) low=0 high=6.25 most=6> y=<title=larger errors (%)",
        "  log=True low=0.166667 high=200> title=slow drift: PDE 500 ms 3 s apart, 95 %",
        "Line x=[0 2 6.25] y=[100 25 0.0166667] colour=#0072B2 width=1.6 label=larger errors",
        "Rule at=2 upright=True colour=#777777 dash=-. width=1.2 label=total by the rules",
        "Rule at=5 upright=False dash=: width=0.9 label=share allowed",
        "Line x=[3] y=[5] dash= label=total by the distribution marker=o",
    ]


def test_spectra_beside_the_window_of_the_one_requirement_that_has_one_as_a_whole():
    assert figure_of(figures.spectra(two_spectra())) == [
        "pointing-errors-spectrum",
        "Spectra of pointing errors and the windows",
        (
            "Above: one-sided spectra of the sources that have one, about all axes together. "
            "Below: the share of them that each window counts, where it ripples its mean about "
            "a frequency. Of an APE all counts, and of the difference of two means up to four "
            "times as much."
        ),
        {
            "frequency (Hz)": [1.0, 10.0, 100.0],
            "left_over (rad^2/Hz)": [4e-12, 2e-12, 1e-12],
            "other (rad^2/Hz)": [1e-12, 8e-12, "nan"],
            "weight of PDE 500 ms 3 s apart": [0.939987, 0.247931, 0.00473181],
        },
        "Sheet width=7.6 height=5.2 heights=[1.25 1] share_x=True legend=<place=above columns=2>",
        ("Panel 0 0 x=<log=True low=1 high=100> y=<title=spectrum, all axes (µrad²/Hz) log=True low=8e-06"),
        "  high=24>",
        "Line x=[1 10 100] y=[4 2 1] colour=#0072B2 label=left over",
        "Line x=[1 10 100] y=[1 8 nan] colour=#D55E00 dash=-- label=other",
        "Rule at=20 upright=True colour=#777777 dash=: width=1.2 label=periodic: fan one, pump",
        "Rule at=50 upright=True colour=#777777 dash=: width=1.2 label=periodic: fan one, pump",
        ("Panel 1 0 x=<title=frequency (Hz) log=True low=1 high=100> y=<title=weight of the window (1)"),
        "  low=0>",
        ("Line x=[1 10 100] y=[0.939987 0.247931 0.00473181] colour=#009E73 dash=-. label=weight of PDE"),
        "  500 ms 3 s apart: slow drift",
    ]


def test_tables_of_two_unlike_requirements_as_a_whole():
    view = budget_view(two_spectra(), (), ["A further remark."])
    assert views_text([view], 130).split("\n") == [
        "Pointing error budget",
        "",
        "Requirements, µrad",
        "",
        (
            " requirement   what is kept, how often                                            "
            "     by the rules   by the distribution   limit"
        ),
        (
            " "
            "──────────────────────────────────────────────────────────────────────────────────"
            "──────────────────────────────────────────────"
        ),
        (
            " code word     APE, radial, 99.73 % of the satellites and times                   "
            "     6.00 FAIL      4.00 PASS             5.00"
        ),
        (" slow drift    PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at   2.00           3.00"),
        "               their worst time",
        "",
        "Contributions, µrad",
        "",
        " source     class      statistic     code word   share   slow drift   share   from",
        " ─────────────────────────────────────────────────────────────────────────────────────",
        " bias       constant   statistic 4   1.00        25 %                         origin 4",
        " wheel      loop       statistic 3   0.750       19 %                         origin 3",
        " heat       drift      statistic 2   0.500       12 %    0.375        12 %    origin 2",
        " tip tilt   random     statistic 1   0.250       6.2 %   0.188        6.2 %   origin 1",
        " all                                 4.00                3.00",
        "",
        "code word: each source",
        "",
        "APE, radial, 99.73 % of the satellites and times, µrad.",
        "",
        " source     mean    deviation   weight   total without it   may be",
        " ──────────────────────────────────────────────────────────────────────────",
        " bias       2.00    5.20        25 %     5.00",
        " wheel      1.50    3.90        19 %     4.00               nothing is left",
        " heat       1.00    2.60        12 %     3.00               any",
        " tip tilt   0.500   1.30        6.2 %    2.00               1.5 times",
        " all        1.00    1.50        100 %    4.00",
        "",
        "slow drift: each source",
        "",
        ("PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at their worst time, µrad."),
        "",
        " source     mean    deviation   weight   total without it",
        " ────────────────────────────────────────────────────────",
        " tip tilt   0.500   1.30        6.2 %    2.00",
        " heat       1.00    2.60        12 %     3.00",
        " all        1.00    1.50        100 %    3.00",
        "",
        (
            "- By the rules: abs(mean) + n_p deviations, about two axes of their lengths "
            "(ECSS-E-ST-60-10C 4.2.4). By the distribution: the"
        ),
        "  sources convolved, without the central limit; by it a requirement is judged.",
        (
            "- Weight: growth of the total for a source that grows by 1 %, in percent. "
            "Contribution: that share of the total, so that"
        ),
        (
            "  contributions add up to it. May be: how many times as large a source may be "
            "until the limit is met, the others as they are."
        ),
        (
            "- What the loop leaves is that of linear theory: each hysteresis element counts "
            "by its slow gain, in a mirror of several axes by"
        ),
        "  that about rest.",
        "- The rules are too small for slow drift (33 %).",
        "- A further remark.",
    ]
    assert [[each.words, each.totals, each.cards, each.brief] for each in tables(view)] == [
        [
            (
                0,
                1,
            ),
            0,
            True,
            (),
        ],
        [
            (
                0,
                1,
                2,
                7,
            ),
            1,
            True,
            (
                0,
                3,
                5,
            ),
        ],
    ]


def test_data_of_two_unlike_requirements_as_a_whole():
    assert plain(budget_data(two_spectra())) == [
        {
            "requirement": "code_word",
            "index": "APE",
            "window_s": None,
            "spacing_s": None,
            "observation_s": None,
            "confidence": 0.9973,
            "interpretation": "mixed",
            "axes": "radial",
            "limit_rad": 5e-06,
            "mean_rad": [6e-07, 8e-07],
            "sigma_rad": [9e-07, 1.2e-06],
            "by_rules_rad": 6e-06,
            "by_distribution_rad": 4e-06,
            "holds": True,
            "sources": [
                {
                    "name": "bias",
                    "class": "constant",
                    "statistic": "statistic 4",
                    "mean_rad": [1.2e-06, 1.6e-06],
                    "sigma_rad": [2e-06, 4.8e-06],
                    "weight": 0.25,
                    "contribution_rad": 1e-06,
                    "total_without_it_rad": 5e-06,
                    "may_be_times": None,
                    "origin": "origin 4",
                },
                {
                    "name": "wheel",
                    "class": "loop",
                    "statistic": "statistic 3",
                    "mean_rad": [9e-07, 1.2e-06],
                    "sigma_rad": [1.5e-06, 3.6e-06],
                    "weight": 0.1875,
                    "contribution_rad": 7.5e-07,
                    "total_without_it_rad": 4e-06,
                    "may_be_times": 0.0,
                    "origin": "origin 3",
                },
                {
                    "name": "heat",
                    "class": "drift",
                    "statistic": "statistic 2",
                    "mean_rad": [6e-07, 8e-07],
                    "sigma_rad": [1e-06, 2.4e-06],
                    "weight": 0.125,
                    "contribution_rad": 5e-07,
                    "total_without_it_rad": 3e-06,
                    "may_be_times": None,
                    "origin": "origin 2",
                },
                {
                    "name": "tip_tilt",
                    "class": "random",
                    "statistic": "statistic 1",
                    "mean_rad": [3e-07, 4e-07],
                    "sigma_rad": [5e-07, 1.2e-06],
                    "weight": 0.0625,
                    "contribution_rad": 2.5e-07,
                    "total_without_it_rad": 2e-06,
                    "may_be_times": 1.5,
                    "origin": "origin 1",
                },
            ],
        },
        {
            "requirement": "slow_drift",
            "index": "PDE",
            "window_s": 0.5,
            "spacing_s": 3.0,
            "observation_s": 60.0,
            "confidence": 0.95,
            "interpretation": "ensemble",
            "axes": "about y",
            "limit_rad": None,
            "mean_rad": [6e-07, 8e-07],
            "sigma_rad": [9e-07, 1.2e-06],
            "by_rules_rad": 2e-06,
            "by_distribution_rad": 3e-06,
            "holds": None,
            "sources": [
                {
                    "name": "tip_tilt",
                    "class": "random",
                    "statistic": "statistic 1",
                    "mean_rad": [3e-07, 4e-07],
                    "sigma_rad": [5e-07, 1.2e-06],
                    "weight": 0.0625,
                    "contribution_rad": 1.875e-07,
                    "total_without_it_rad": 2e-06,
                    "may_be_times": 1.5,
                    "origin": "origin 1",
                },
                {
                    "name": "heat",
                    "class": "drift",
                    "statistic": "statistic 2",
                    "mean_rad": [6e-07, 8e-07],
                    "sigma_rad": [1e-06, 2.4e-06],
                    "weight": 0.125,
                    "contribution_rad": 3.75e-07,
                    "total_without_it_rad": 3e-06,
                    "may_be_times": None,
                    "origin": "origin 2",
                },
            ],
        },
    ]
    assert budget_words.most(two_requirements()[1]) == "tip tilt: 0.188 µrad of 3.00 µrad, 6.2 % of the total"


@pytest.mark.parametrize(
    ("index", "text"),
    [
        (ErrorIndex("APE"), "APE"),
        (ErrorIndex("RPE", 0.25), "RPE 250 ms"),
        (ErrorIndex("PRE", 0.5, 90.0), "PRE 500 ms 90 s apart"),
    ],
)
def test_an_index_is_named_with_its_times(index, text):
    assert index_text(index) == text


def arrays_of(group):
    """Each variable of a group with its axes, unit and values."""
    found = group.to_xarray().to_dict()
    several = {**found["coords"], **found["data_vars"]}
    return {name: [list(v["dims"]), v["attrs"].get("units"), plain(v["data"])] for name, v in several.items()}


def test_arrays_of_two_unlike_requirements_as_a_whole():
    found = {name: arrays_of(group) for name, group in arrays._pointing_errors(two_spectra()).items()}
    assert found["error_budget/requirements"].pop("limit")[2][0] == 5e-6
    assert found["error_budget/sources"].pop("may_be")[2][1:4] == [0.0, "inf", 1.5]
    assert found == {
        "error_budget/requirements": {
            "requirement": [["requirement"], "1", ["code_word", "slow_drift"]],
            "index": [["requirement"], "1", ["APE", "PDE"]],
            "confidence": [["requirement"], "1", [0.9973, 0.95]],
            "by_rules": [["requirement"], "rad", [6e-06, 2e-06]],
            "by_distribution": [["requirement"], "rad", [4e-06, 3e-06]],
            "error": [["requirement", "size"], "rad", [[0.0, 2e-06, 6.25e-06], [0.0, 2e-06, 6.25e-06]]],
            "beyond": [["requirement", "size"], "1", [[1.0, 0.25, 0.0], [1.0, 0.25, 0.0]]],
        },
        "error_budget/sources": {
            "source": [["entry"], "1", ["bias", "wheel", "heat", "tip_tilt", "tip_tilt", "heat"]],
            "kind": [["entry"], "1", ["constant", "loop", "drift", "random", "random", "drift"]],
            "mean": [["entry"], "rad", [2e-06, 1.5e-06, 1e-06, 5e-07, 5e-07, 1e-06]],
            "deviation": [["entry"], "rad", [5.2e-06, 3.9e-06, 2.6e-06, 1.3e-06, 1.3e-06, 2.6e-06]],
            "contribution": [["entry"], "rad", [1e-06, 7.5e-07, 5e-07, 2.5e-07, 1.875e-07, 3.75e-07]],
            "weight": [["entry"], "1", [0.25, 0.1875, 0.125, 0.0625, 0.0625, 0.125]],
            "without": [["entry"], "rad", [5e-06, 4e-06, 3e-06, 2e-06, 2e-06, 3e-06]],
            "requirement": [
                ["entry"],
                "1",
                ["code_word", "code_word", "code_word", "code_word", "slow_drift", "slow_drift"],
            ],
        },
        "error_budget/spectra": {
            "source": [["source"], "1", ["left_over", "other"]],
            "frequency": [["frequency"], "Hz", [1.0, 10.0, 100.0]],
            "density": [["source", "frequency"], "rad^2/Hz", [[4e-12, 2e-12, 1e-12], [1e-12, 8e-12, "nan"]]],
        },
    }


def test_a_budget_of_two_requirements_has_each_number_in_its_own_column():
    budget = SimpleNamespace(judged=two_requirements())
    assert outline(
        budget_view(budget, [SimpleNamespace(name="one"), SimpleNamespace(name="two")], ["more"])
    ) == one_text("""
# Pointing error budget
| Requirements, µrad: requirement / what is kept, how often / by the rules / by the distribution / limit [0, 1]
  cards
code word / APE, radial, 99.73 % of the satellites and times / 6.00 FAIL / 4.00 PASS / 5.00
slow drift / PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at their worst time / 2.00 / 3.00 /
| Contributions, µrad: source / class / statistic / code word / share / slow drift / share / from [0, 1, 2, 7] brief
  [0, 3, 5] totals 1 cards
bias / constant / statistic 4 / 1.00 / 25 % /  /  / origin 4
wheel / loop / statistic 3 / 0.750 / 19 % /  /  / origin 3
heat / drift / statistic 2 / 0.500 / 12 % / 0.375 / 12 % / origin 2
tip tilt / random / statistic 1 / 0.250 / 6.2 % / 0.188 / 6.2 % / origin 1
all /  /  / 4.00 /  / 3.00 /  /
[one]
[two]
# code word: each source (folded)
APE, radial, 99.73 % of the satellites and times, µrad.
| -: source / mean / deviation / weight / total without it / may be [0] totals 1
bias / 2.00 / 5.20 / 25 % / 5.00 /
wheel / 1.50 / 3.90 / 19 % / 4.00 / nothing is left
heat / 1.00 / 2.60 / 12 % / 3.00 / any
tip tilt / 0.500 / 1.30 / 6.2 % / 2.00 / 1.5 times
all / 1.00 / 1.50 / 100 % / 4.00 /
# slow drift: each source (folded)
PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at their worst time, µrad.
| -: source / mean / deviation / weight / total without it [0] totals 1
tip tilt / 0.500 / 1.30 / 6.2 % / 2.00
heat / 1.00 / 2.60 / 12 % / 3.00
all / 1.00 / 1.50 / 100 % / 3.00
- By the rules: abs(mean) + n_p deviations, about two axes of their lengths (ECSS-E-ST-60-10C 4.2.4). By the
  distribution: the sources convolved, without the central limit; by it a requirement is judged.
- Weight: growth of the total for a source that grows by 1 %, in percent. Contribution: that share of the total, so
  that contributions add up to it. May be: how many times as large a source may be until the limit is met, the
  others as they are.
- What the loop leaves is that of linear theory: each hysteresis element counts by its slow gain, in a mirror of
  several axes by that about rest.
- The rules are too small for slow drift (33 %).
- more
""")


def test_a_requirement_without_a_limit_has_no_column_of_what_may_be_and_alone_no_source_of_the_other():
    view = budget_view(SimpleNamespace(judged=two_requirements()[1:]))
    assert outline(view) == one_text("""
# Pointing error budget
| Requirements, µrad: requirement / what is kept, how often / by the rules / by the distribution / limit [0, 1]
  cards
slow drift / PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at their worst time / 2.00 / 3.00 /
| Contributions, µrad: source / class / statistic / slow drift / share / from [0, 1, 2, 5] brief [0, 3] totals 1
  cards
tip tilt / random / statistic 1 / 0.188 / 6.2 % / origin 1
heat / drift / statistic 2 / 0.375 / 12 % / origin 2
all /  /  / 3.00 /  /
# slow drift: each source (folded)
PDE 500 ms 3 s apart within 60 s, about y, 95 % of the satellites, at their worst time, µrad.
| -: source / mean / deviation / weight / total without it [0] totals 1
tip tilt / 0.500 / 1.30 / 6.2 % / 2.00
heat / 1.00 / 2.60 / 12 % / 3.00
all / 1.00 / 1.50 / 100 % / 3.00
- By the rules: abs(mean) + n_p deviations, about two axes of their lengths (ECSS-E-ST-60-10C 4.2.4). By the
  distribution: the sources convolved, without the central limit; by it a requirement is judged.
- Weight: growth of the total for a source that grows by 1 %, in percent. Contribution: that share of the total, so
  that contributions add up to it. May be: how many times as large a source may be until the limit is met, the
  others as they are.
- The rules are too small for slow drift (33 %).
""")


@pytest.mark.parametrize(
    ("totals", "said"),
    [
        ([("a_b", 2.0, 4.0)], "The rules are too small for a b (50 %)."),
        ([("a", 3.9961, 4.0), ("b", 3.9999, 4.0)], ""),
        ([("a", 3.99, 4.0), ("b", 9.0, 4.0), ("c d", 3.0, 4.0)], "The rules are too small for a (0.25 %), c d (25 %)."),
        ([("a", 1.0, 0.0)], ""),
        ([("a", 4.0, 4.0)], ""),
    ],
)
def test_the_rules_are_too_small_where_they_miss_the_total_by_more_than_a_thousandth(totals, said):
    judged = [
        SimpleNamespace(name=name, total=SimpleNamespace(by_rules_rad=rules, quantile_rad=whole), shares=())
        for name, rules, whole in totals
    ]
    found = budget_words.remarks(judged)
    assert found[2:] == ([said] if said else [])
    looped = budget_words.remarks([*judged, SimpleNamespace(name="z", total=judged[0].total, shares=[LOOP])])
    assert looped[2].startswith("What the loop leaves is that of linear theory: each hysteresis element")


LOOP = SimpleNamespace(contribution=SimpleNamespace(kind="loop"))


@pytest.mark.parametrize(
    ("interpretation", "confidence", "axes", "said"),
    [
        ("temporal", 0.9973, (0, 1), "radial, 99.73 % of the time, on the worst satellite"),
        ("temporal", 0.99999, (2,), "about z, 99.999 % of the time, on the worst satellite"),
        ("ensemble", 0.5, (0,), "about x, 50 % of the satellites, at their worst time"),
        ("mixed", 0.9995, (1,), "about y, 99.95 % of the satellites and times"),
        ("temporal", 0.68, (2,), "about z, 68 % of the time, on the worst satellite"),
    ],
)
def test_a_requirement_says_of_what_its_share_is(interpretation, confidence, axes, said):
    required = Requirement(ErrorIndex("RPE", 0.25), confidence, interpretation, axes, None)
    assert budget_words.requirement_text(required) == f"RPE 250 ms, {said}"


def test_how_much_larger_a_source_may_be_has_no_power_of_ten():
    assert budget_words.allowed(SimpleNamespace(allowed=1234.0)) == "1230 times"


def test_requirements_of_one_window_share_it_and_those_without_a_window_have_none():
    def one(name, *index):
        return SimpleNamespace(name=name, total=SimpleNamespace(required=SimpleNamespace(index=ErrorIndex(*index))))

    judged = [
        one("code_word", "RPE", 0.01),
        one("whole", "APE"),
        one("slow_drift", "PDE", 0.01, 60.0),
        one("frame_of_it", "RPE", 0.01),
        one("image", "RPE", 0.02),
    ]
    assert list(figures._windows(judged).items()) == [
        (ErrorIndex("RPE", 0.01), "code word, frame of it"),
        (ErrorIndex("PDE", 0.01, 60.0), "slow drift"),
        (ErrorIndex("RPE", 0.02), "image"),
    ]


@pytest.mark.parametrize(
    ("allowed", "said"), [(None, ""), (0.0, "nothing is left"), (math.inf, "any"), (0.5, "0.5 times"), (1.0, "1 times")]
)
def test_how_much_larger_a_source_may_be_has_words_for_nothing_and_for_any(allowed, said):
    assert budget_words.allowed(SimpleNamespace(allowed=allowed)) == said


def test_a_source_and_a_requirement_have_26_letters_beside_and_above_their_bars():
    names = ["twenty-six------letters---", "twenty-seven----letters----", "z" * 34]
    assert [len(name) for name in names] == [26, 27, 34]
    each = judged_of(*((name, (3 - k) * 1e-6) for k, name in enumerate(names)), name="r" * 27)
    (panel,) = figures.contributions([each]).sheet.panels
    assert list(panel.y.words.values()) == [name if len(name) <= 26 else f"{name[:25]}…" for name in names]
    assert panel.title == f"{'r' * 25}…"
