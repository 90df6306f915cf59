"""A campaign on a page, in a terminal and as plain data, from summaries of a toy model."""

import functools
import json
import math
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from itertools import product
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy import stats

from drawn import figure_of, one_text, outline, plain
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.records import (
    CampaignSummary,
    CellSummary,
    Failed,
    InputText,
    Interval,
    Limit,
    OutputSummary,
    Progress,
    Sensitivity,
    Tail,
    WorstTrace,
)
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.report.campaign import figures as drawing
from microrad.report.campaign import numbers as campaign_numbers
from microrad.report.campaign import optimum as optimum_report
from microrad.report.campaign import page as campaign_module
from microrad.report.campaign import tables as campaign_tables
from microrad.report.campaign import text as campaign_terminal
from microrad.report.campaign import words as campaign_words
from microrad.report.campaign.data import campaign_data
from microrad.report.campaign.numbers import share, value
from microrad.report.campaign.page import campaign_figures, campaign_page
from microrad.report.campaign.tables import failed_table
from microrad.report.campaign.text import campaign_text
from microrad.report.plotting.palette import BLACK, WHITE
from microrad.report.plotting.sheet import Area, Axis, Field, Line, Panel, Rule, Span
from microrad.report.view import Points
from report_pages import assert_sound, without_scripts

NAME = 'LEO <b>"A&B"</b> $x$'
CONFIDENCE = 0.99
QUANTILES = (0.003, 0.01, 0.5, 0.99, 0.997)
INPUTS = {
    "communication.transmit_power": ("W", "normal, mean 5 W, deviation 0.2 W"),
    "communication.pointing_error": ("rad", "normal, mean 5 urad, deviation 1 urad"),
    "terminals.leo_aperture": ("m", "uniform, 4.8 cm to 5.2 cm"),
    "fine_pointing.disturbances.reaction_wheel.imbalance_of_the_first_wheel": ("", "log-uniform, 0.1 to 10"),
    "mirror.alpha": ("1/V", "identified: the covariance of its file"),
    "mirror.mode_1.frequency": ("Hz", "identified: the covariance of its file"),
}
LIMITS = (
    Limit("margin", 3.0, None, "requirement.margin"),
    Limit("residual_quantile", None, 10e-6, "requirement.pointing_error"),
)


# --------------------------------------------------------------------------------------------------------- a toy model
def proportion(count, rows):
    """Clopper and Pearson's interval."""
    beta, half = stats.beta, (1.0 - CONFIDENCE) / 2.0
    low = beta.ppf(half, count, rows - count + 1) if count else 0.0
    high = beta.ppf(1.0 - half, count + 1, rows - count) if count < rows else 1.0
    return Interval(count / rows if rows else math.nan, float(low), float(high), CONFIDENCE)


def drawn(count, rows, seed):
    """Columns of ``count`` inputs, in SI units."""
    rng = np.random.default_rng(seed)
    every = {
        "communication.transmit_power": rng.normal(5.0, 0.2, rows),
        "communication.pointing_error": rng.normal(5e-6, 1e-6, rows),
        "terminals.leo_aperture": rng.uniform(0.048, 0.052, rows),
        "fine_pointing.disturbances.reaction_wheel.imbalance_of_the_first_wheel": 10.0 ** rng.uniform(-1.0, 1.0, rows),
        "mirror.alpha": rng.normal(0.02, 0.001, rows),
        "mirror.mode_1.frequency": rng.normal(750.0, 20.0, rows),
    }
    return dict(list(every.items())[:count])


def outputs_of(inputs, rows, shift_db, loop):
    """Columns of the outputs: a link and the residual that its loop leaves."""
    power = inputs.get("communication.transmit_power", np.full(rows, 5.0))
    error = inputs.get("communication.pointing_error", np.full(rows, 5e-6))
    margin = 4.2 + shift_db + 10.0 * np.log10(power / 5.0) - 0.06 * (error * 1e6 - 2.0) ** 2
    found = {"margin": margin, "beacon_margin": np.full(rows, 6.1)}
    if loop:
        wheel = inputs.get("fine_pointing.disturbances.reaction_wheel.imbalance_of_the_first_wheel", np.ones(rows))
        found["residual_quantile"] = (6.0 + 0.5 * wheel + 0.3 * (error * 1e6 - 5.0)) * 1e-6
        found["beyond_share"] = np.exp(-0.5 * (10e-6 / found["residual_quantile"]) ** 2 * 11.6)
    return found


def output_summary(name, column):
    known = column[~np.isnan(column)]
    o = OUTPUTS[name]
    spread = known.std() / math.sqrt(max(known.size, 1)) if known.size else math.nan
    quantiles = {}
    for p in QUANTILES:
        ends = np.clip(
            [p, p - 2.0 * math.sqrt(p * (1 - p) / known.size), p + 2.0 * math.sqrt(p * (1 - p) / known.size)], 0, 1
        )
        quantiles[p] = Interval(*map(float, np.quantile(known, ends)), CONFIDENCE)
    counts, edges = np.histogram(known, bins=40)
    mean = float(known.mean())
    return OutputSummary(
        name,
        o.unit,
        o.meaning,
        known.size,
        Interval(mean, mean - 2.6 * spread, mean + 2.6 * spread, CONFIDENCE),
        float(known.std()),
        float(known.min()),
        float(known.max()),
        quantiles,
        edges,
        counts.astype(float),
    )


def rayleigh_tail(sigma_rad, wanted=(0.1, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)):
    """A tail that thins out beyond 3e-7, the radius at the last probability without an upper end."""
    edges = bin_edges_rad()
    survival = np.exp(-0.5 * (edges / sigma_rad) ** 2)
    survival[survival < 3e-7] = 0.0
    width = np.exp(0.4 * np.log10(np.maximum(survival, 1e-9)) ** 2 / 8.0)
    radii = {p: sigma_rad * math.sqrt(-2.0 * math.log(p)) for p in wanted}
    return Tail(
        edges,
        survival,
        survival / width,
        np.maximum(survival * width, 5e-7),
        {p: Interval(r, 0.98 * r, 1.03 * r if p > 2e-6 else math.nan, CONFIDENCE) for p, r in radii.items()},
        CONFIDENCE,
        "share of the time of 64 rows, which are independent",
        1.3e5,
    )


def cell_of(values, columns, failed, tail):
    """A cell from the columns of its outputs."""
    known = {name: column for name, column in columns.items() if not np.isnan(column).all()}
    good = max((int((~np.isnan(c)).sum()) for c in known.values()), default=0)
    missed = {}
    for limit in LIMITS:
        if limit.output in known:
            column = known[limit.output]
            missed[limit.output] = (column < (limit.least or -math.inf)) | (column > (limit.most or math.inf))
    any_missed = np.any(list(missed.values()), axis=0) if missed else np.zeros(1)
    nothing = Interval(math.nan, math.nan, math.nan, CONFIDENCE)
    return CellSummary(
        values,
        good + failed,
        failed,
        {name: output_summary(name, column) for name, column in known.items()},
        proportion(int(any_missed.sum()), good) if good and missed else nothing,
        {name: proportion(int(which.sum()), good) for name, which in missed.items()},
        tail if good else None,
    )


def sensitivity_of(name, inputs, column):
    """Squared correlations in place of indices: the toy model is nearly linear."""

    def about(x, half=0.04):
        return Interval(x, x - half, x + half, 0.95)

    known = ~np.isnan(column)
    if known.sum() < 10 or np.ptp(column[known]) == 0.0:
        return Sensitivity(
            name, int(known.sum()), {}, {}, {}, math.nan, "the output is the same in every row, or there are too few"
        )
    rank = {key: float(stats.spearmanr(x[known], column[known])[0]) for key, x in inputs.items()}
    first = {key: about(r**2) for key, r in rank.items()}
    total = {key: about(min(r**2 + 0.03, 1.0)) for key, r in rank.items()} if name != "beyond_share" else {}
    note = "" if total else "no surrogate is good enough for total indices (Q2 = 0.41)"
    return Sensitivity(name, int(known.sum()), first, total, {k: about(r) for k, r in rank.items()}, 0.97, note)


def trace_of(number, cell=0):
    time_s = np.arange(0.0, 2.0, 1e-4)
    rng = np.random.default_rng(number)
    error = np.stack([4e-6 * np.sin(2 * np.pi * (30.0 + 7 * axis) * time_s) for axis in range(2)], axis=1)
    error += rng.normal(0.0, 1e-6, error.shape)
    drive = 40.0 + np.stack([20.0 * np.sin(2 * np.pi * 3 * time_s), 15.0 * np.cos(2 * np.pi * 3 * time_s)], axis=1)
    return WorstTrace(cell, 100 + number, "margin", 1.2 + 0.1 * number, time_s, error, drive)


def summary_of(
    inputs=2, *, rows=512, grid=None, loop=True, shift_db=0.0, failed=0, limits=LIMITS, state="complete", worst=0
):
    """What a campaign of the toy model comes to; ``grid`` are the texts of each key's values."""
    grid = grid or {}
    cells, sample = [], []
    for number, texts in enumerate(product(*grid.values())):
        x = drawn(inputs, rows, 1)
        y = outputs_of(x, rows, shift_db + 0.4 * number, loop)
        for column in y.values():
            column[:failed] = math.nan
        tail = rayleigh_tail((2.0 + 0.1 * number) * 1e-6) if loop else None
        cells.append(cell_of(dict(zip(grid, texts, strict=True)), y, failed, tail))
        sample.append({"cell": np.full(rows, float(number)), "row": np.arange(rows) * 1.0, **x, **y})
    kept = tuple(limit for limit in limits if any(limit.output in cell.outputs for cell in cells))
    if not kept:
        cells = [replace(c, missed=Interval(math.nan, math.nan, math.nan, CONFIDENCE), missed_by={}) for c in cells]
    first_in = {key: sample[0][key] for key in drawn(inputs, rows, 1)}
    done = rows * len(cells)
    return CampaignSummary(
        name="margin <tail>.toml",
        mission_name=NAME,
        hashes={"campaign": "c" * 64, "mission": "d" * 64, "code": "e" * 64},
        seed=2**64 - 1,
        sampling="sobol",
        loop="LQG, both axes, 10 s, 64 runs a row" if loop else "",
        inputs=tuple(InputText(key, *INPUTS[key]) for key in first_in),
        fixed={"fine_pointing.reference.point_ahead": "0 urad"},
        limits=kept,
        cells=tuple(cells),
        sensitivities=tuple(sensitivity_of(n, first_in, sample[0][n]) for n in cells[0].outputs) if inputs else (),
        sample={key: np.concatenate([s[key] for s in sample]) for key in sample[0]},
        worst=tuple(trace_of(k) for k in range(worst if loop else 0)),
        failed=tuple(
            (k, Failed(row, 2**63 + row, 2, "ended with <ValueError>: the loop is not stable; take a smaller gain"))
            for k in range(len(cells))
            for row in range(failed)
        ),
        progress=Progress(done, done if state == "complete" else 20 * done, 125.0, done / 125.0, 2375.0, state),
        warnings=("2000 rows were made 2048: Sobol takes whole blocks",),
    )


def tail_alone():
    """Importance sampling of the noise: its rows are draws for the tail, without outputs or limits."""
    found = summary_of(0, rows=256, worst=0)
    tail = replace(rayleigh_tail(2e-6, (1e-6,)), method="importance sampling of 256 runs")
    cell = replace(found.cells[0], outputs={}, missed=Interval(*[math.nan] * 3, 0.95), missed_by={}, tail=tail)
    return replace(found, limits=(), cells=(cell,), sensitivities=(), sample={})


APERTURES = {"terminals.leo_aperture": ("4 cm", "5 cm", "6 cm", "8 cm")}
TWO_KEYS = {**APERTURES, "mirror": ("lab-a.toml", "lab-b.toml", "lab-c.toml")}
THREE_KEYS = {**APERTURES, "mirror": ("lab-a.toml", "lab-b.toml"), "conventions.strehl": ("decibel", "ratio")}
CASES = {
    "two inputs": lambda: summary_of(2, worst=3, failed=3),
    "one input": lambda: summary_of(1),
    "six inputs": lambda: summary_of(6),
    "no inputs": lambda: summary_of(0, rows=64, worst=1),
    "no loop": lambda: summary_of(2, loop=False),
    "grid of one key": lambda: summary_of(2, grid=APERTURES, rows=256, loop=False),
    "grid of two keys": lambda: summary_of(2, grid=TWO_KEYS, rows=256),
    "grid of three keys": lambda: summary_of(2, grid=THREE_KEYS, rows=256),
    "all kept": lambda: summary_of(2, shift_db=30.0),
    "all missed": lambda: summary_of(2, shift_db=-30.0),
    "all failed": lambda: summary_of(2, rows=16, failed=16),
    "few rows": lambda: summary_of(2, rows=4, state="running"),
    "one row": lambda: summary_of(2, rows=1, state="stopped"),
    "no limits": lambda: summary_of(2, limits=(), loop=False),
    "tail alone": tail_alone,
    "not begun": lambda: replace(summary_of(2, rows=16, failed=16, state="waiting"), cells=(), failed=()),
}


@functools.cache
def made(name):
    """A summary with its figures and its page, drawn once."""
    summary = CASES[name]()
    figures = campaign_figures(summary)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(campaign_module, "campaign_figures", lambda _: figures)
        return SimpleNamespace(summary=summary, figures=figures, html=without_scripts(campaign_page(summary)))


@pytest.fixture(params=CASES)
def case(request):
    return made(request.param)


# -------------------------------------------------------------------------------------------------------- helpers here
class Page(HTMLParser):
    """What a browser sees: headings, tables as rows of texts, and whether every tag is closed."""

    EMPTY = ("meta", "br", "image", "use", "path", "rect", "circle", "stop")

    def __init__(self, text):
        super().__init__()
        self.open, self.headings, self.rows, self.loads, self.figures = [], [], [], [], 0
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.loads += [v for k, v in attrs if k in ("src", "href", "xlink:href") and not v.startswith(("#", "data:"))]
        self.figures += tag == "figure"
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag in ("h1", "h2"):
            self.headings.append("")
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.EMPTY:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings[-1] += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def texts(figure):
    """Every text in the picture, as a reader of the SVG gets it."""
    root = ElementTree.fromstring(figure.svg)
    return ["".join(e.itertext()).strip() for e in root.iter("{http://www.w3.org/2000/svg}text")]


def boxes(figure):
    """Where the lines of text of a picture stand that are not turned: x, y, rough width, size, and the text."""
    found = []
    for e in ElementTree.fromstring(figure.svg).iter("{http://www.w3.org/2000/svg}text"):
        size, shift = float(e.get("font-size")), {"middle": 0.5, "end": 1.0}.get(e.get("text-anchor"), 0.0)
        for line in [] if "transform" in e.attrib else [*e] or [e]:
            long = 0.55 * size * len(line.text)
            found.append((float(line.get("x")) - shift * long, float(line.get("y")), long, size, line.text))
    return found


# --------------------------------------------------------------------------------------------------------- every case
@pytest.mark.promise("report-12")
def test_each_page_is_whole_loads_nothing_and_escapes_its_texts(case):
    text = case.html
    page = Page(text)
    assert page.open == []
    assert page.loads == []
    assert_sound(text)
    assert page.headings[0] == "margin <tail>"
    assert f"; mission: {NAME}</div>" in unescape(text)
    assert "<b>" not in text
    assert "How the rows were made" in page.headings
    assert not re.search(r"\bnan\b|\binf\b|None(?! of)", re.sub(r"<svg.*?</svg>", "", text, flags=re.S))


def test_no_picture_is_empty_or_has_texts_that_overlap(case):
    for figures in case.figures.values():
        for figure in figures:
            assert len(texts(figure)) > 3
            assert not any("nan" in t.split() for t in texts(figure)), figure.name
            found = boxes(figure)
            for k, (x, y, long, size, word) in enumerate(found):
                for other in found[k + 1 :]:
                    apart = abs(y - other[1]) >= 0.8 * min(size, other[3])
                    assert apart or x + long <= other[0] + 1.5 or other[0] + other[2] <= x + 1.5, (
                        figure.name,
                        word,
                        other,
                    )


@pytest.mark.promise("campaigns-31")
def test_the_terminal_has_the_verdict_first_and_the_progress_last_within_its_width(case):
    for width in (80, 140):
        text = campaign_text(case.summary, width)
        lines = text.splitlines()
        assert max(map(len, lines)) <= width
        joined = " ".join(text.split())
        assert joined.startswith(" ".join(campaign_words.headline(case.summary).split()))
        assert joined.endswith(campaign_words.progress_words(case.summary))
        assert not re.search(r"\bnan\b|\binf\b", text)


def test_the_data_is_json_without_arrays_and_says_the_same(case):
    found = campaign_data(case.summary)
    back = json.loads(json.dumps(found))  # an array or a record would raise
    assert back["verdict"] == campaign_words.headline(case.summary)
    assert back["seed"] == 2**64 - 1
    assert len(back["cells"]) == len(case.summary.cells)
    for shown, cell in zip(back["cells"], case.summary.cells, strict=True):
        assert shown["rows"] + shown["failed"] == cell.rows
        assert [o["name"] for o in shown["outputs"]] == list(cell.outputs)


# ------------------------------------------------------------------------------------------------------------- verdict
@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-31")
@pytest.mark.parametrize(
    ("name", "said", "word"),
    [
        (
            "two inputs",
            "3 of 512 rows failed; 91.2 % of the other 509 rows keep both limits "
            "(87.4 % to 94.1 % at 99 % confidence).",
            "open",
        ),
        ("all kept", "All 512 rows keep both limits; at 99 % confidence at least 99.0 % of all draws do.", "pass"),
        (
            "all missed",
            "None of 512 rows keeps both limits; at 99 % confidence at most 1.03 % of all draws do.",
            "fail",
        ),
        ("all failed", "No row has results: all 16 failed.", "fail"),
        (
            "one row",
            "So far: the only row keeps both limits; at 99 % confidence at least 0.5 % of all draws do.",
            "open",
        ),
        (
            "few rows",
            "So far: all 4 rows keep both limits; at 99 % confidence at least 26.6 % of all draws do.",
            "open",
        ),
        ("no limits", "512 rows with results; no limit is set.", "open"),
        ("not begun", "No row has been simulated yet.", "open"),
        (
            "tail alone",
            "The radial error exceeds 10.5 µrad with probability 10⁻⁶ (at least 10.3 µrad at 99 % confidence).",
            "open",
        ),
    ],
)
def test_the_verdict_says_how_likely_a_row_keeps_the_limits(name, said, word):
    summary = made(name).summary
    assert campaign_words.headline(summary) == said
    assert campaign_words.verdict(summary) == word
    assert f'class="{"verdict" if word == "open" else f"verdict {word}"}"' in made(name).html


def test_one_limit_is_named_in_the_verdict():
    said = campaign_words.headline(summary_of(2, limits=LIMITS[:1]))
    assert "of the rows keep margin ≥ 3.00 dB (" in said


def test_a_grid_names_its_best_and_its_worst_combination():
    said = campaign_words.headline(summary_of(2, grid=APERTURES, rows=256))
    assert said.startswith("Of 4 combinations, terminals.leo_aperture = 8 cm keeps both limits most often, in 100 % (")
    assert "; terminals.leo_aperture = 4 cm least often, in 92.6 % (87.3 % to 96.2 %) (intervals at 99 %)." in said
    several = campaign_words.headline(summary_of(2, grid=APERTURES, rows=256, shift_db=1.0))
    assert "3 keep both limits in all of their rows, the first of them terminals.leo_aperture = 5 cm" in several
    summary = summary_of(2, grid=APERTURES, rows=256)
    *_, third, best = sorted(summary.cells, key=lambda cell: -cell.missed.value)
    cells = tuple(replace(cell, missed=third.missed) if cell in (third, best) else cell for cell in summary.cells)
    assert third.missed.value > 0.0
    assert "keep both limits in all of their rows" not in campaign_words.headline(replace(summary, cells=cells))
    same = campaign_words.headline(summary_of(2, grid=APERTURES, rows=256, shift_db=30.0))
    assert same == "In each of 4 combinations 100 % of the rows keep both limits."


def test_a_cell_without_results_is_never_the_best():
    good, bad = summary_of(2, rows=64), summary_of(2, rows=64, failed=64)
    both = replace(good, cells=(bad.cells[0], good.cells[0]))
    assert campaign_words.best(both) is good.cells[0]
    assert campaign_words.best(bad) is None


# ----------------------------------------------------------------------------------------------------- words in detail
@pytest.mark.parametrize(
    ("probability", "said"),
    [
        (0.0, "0 %"),
        (1.0, "100 %"),
        (0.5, "50 %"),
        (0.0123, "1.23 %"),
        (0.99987, "99.987 %"),
        (0.999999, "99.99990 %"),
        (1e-6, "10⁻⁶"),
        (3.14e-4, "3.1×10⁻⁴"),
        (math.nan, "not known"),
    ],
)
def test_a_probability_keeps_the_digits_that_tell_it_from_0_and_1(probability, said):
    assert share(probability) == said


@pytest.mark.parametrize(
    ("number", "unit", "name", "said"),
    [
        (3.456, "dB", "margin", "3.46 dB"),
        (-3.456, "dB", "margin", "−3.46 dB"),
        (9.87e-6, "rad", "residual_rms", "9.87 µrad"),
        (3e8, "bit/s", "data_rate", "300 Mbit/s"),
        (8e12, "bit", "volume", "1.00 TB"),
        (4.1e-6, "rad", "residual_rms", "4.10 µrad"),
        (1e-6, "rad", "residual_rms", "1.00 µrad"),
        (0.1, "dB", "margin", "0.10 dB"),
        (0.0, "rad", "residual_rms", "0 rad"),
        (1800.0, "s", "contact_time", "30.0 min"),
        (0.02, "", "outage", "2 %"),
        (0.02, "", "mirror.alpha", "0.02"),
        (math.nan, "rad", "residual_rms", "not known"),
    ],
)
def test_values_stand_in_the_users_units(number, unit, name, said):
    assert value(number, unit, name) == said


@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-1", "campaigns-31")
def test_what_matters_names_the_inputs_that_matter_and_no_others():
    summary = summary_of(6)
    margin, residual = campaign_words.matters(summary)
    assert margin.startswith("What matters most to margin (total Sobol index): communication.pointing_error 0.8")
    assert "transmit_power" in margin
    assert "mirror.alpha" not in margin
    assert "imbalance_of_the_first_wheel 0.7" in residual
    assert "transmit_power" not in campaign_words.matters(summary_of(2))[1]  # its index is below the least named
    weak = replace(summary, sensitivities=(replace(summary.sensitivities[0], total={}, first={}, note="too few rows"),))
    assert campaign_words.matters(weak) == ["What matters to margin is not known: too few rows."]
    first = replace(summary.sensitivities[0], total={}, note="Q2 = 0.41")
    (said,) = campaign_words.matters(replace(summary, sensitivities=(first,)))
    assert "(first-order Sobol index)" in said
    assert said.endswith("; Q2 = 0.41.")


@pytest.mark.promise("campaigns-31")
def test_the_tail_is_read_off_at_the_limit():
    tail = rayleigh_tail(2e-6)
    found = campaign_words.beyond(tail, 9e-6)
    assert found.value == pytest.approx(math.exp(-0.5 * 4.5**2), rel=0.01)
    assert found.low < found.value < found.high
    unseen = campaign_words.beyond(tail, 14e-6)
    assert unseen.value == 0.0
    assert 0.0 < unseen.high < 1e-5
    assert campaign_words.beyond(replace(tail, radius_rad=tail.radius_rad + 5e-6), 4e-6) is None
    none = replace(tail, survival=np.zeros(tail.survival.size))
    assert campaign_words.beyond(none, 9e-6) is None


def test_the_tail_says_the_least_probability_that_is_known():
    summary = summary_of(2)
    cell = summary.cells[0]
    known = {**cell.tail.wanted, 1e-7: Interval(math.nan, math.nan, math.nan, CONFIDENCE)}
    said = campaign_words.tail_sentences(summary, replace(cell, tail=replace(cell.tail, wanted=known)))
    assert said[0].startswith("The radial error exceeds 10.5 µrad with probability 10⁻⁶ (at least 10.3 µrad")
    assert said[1].startswith("The radial error is beyond 10 µrad with probability 3.7×10⁻⁶ (")
    assert campaign_words.tail_sentences(summary, replace(cell, tail=None)) == []
    far = replace(summary, limits=(replace(LIMITS[1], most=20e-6),))
    unseen = campaign_words.tail_sentences(far, cell)[1]
    assert unseen.startswith("No radial error beyond 20 µrad was seen (0 to ")
    _, rows = campaign_tables.tail_table(replace(cell.tail, wanted=known))
    assert rows[-1] == ("10⁻⁷", "not known", "")
    assert rows[0][:2] == ("10 %", "4.29 µrad")


@pytest.mark.promise("campaigns-31")
@pytest.mark.parametrize(
    ("state", "done", "rate", "left", "said"),
    [
        ("complete", 2048, 4.0, 0.0, "Complete: 2048 rows in 8.33 min, 4 rows a second."),
        ("running", 512, 4.0, 384.0, "Running: 512 of 2048 rows, 4 rows a second, 6.4 min left."),
        ("running", 0, math.nan, math.nan, "Running: 0 of 2048 rows."),
        ("running", 4096, 4.0, math.nan, "Running: 4096 rows, 4 rows a second."),
        ("stopped", 512, 4.0, 384.0, "Stopped after 512 of 2048 rows; microrad campaign resume goes on from there."),
        ("waiting", 0, math.nan, math.nan, "Not begun: 0 of 2048 rows."),
    ],
)
def test_the_progress_has_pace_and_time_left_while_it_runs(state, done, rate, left, said):
    summary = replace(summary_of(0, rows=4), progress=Progress(done, 2048, 500.0, rate, left, state))
    assert campaign_words.progress_words(summary) == said


@pytest.mark.promise("campaigns-31", "campaigns-46")
def test_failed_rows_stand_with_seed_and_reason_and_the_rest_is_counted():
    summary = summary_of(2, rows=60, failed=60)
    text, page = campaign_text(summary, 140), Page(campaign_page(summary))
    assert str(2**63 + 9) in text
    assert str(2**63 + 10) not in text
    assert "50 more failed rows are in the export." in text
    rows = [row for row in page.rows if row[1:2] == [str(2**63 + 39)]]
    assert rows == [["39", str(2**63 + 39), "2", summary.failed[39][1].reason]]
    assert not any(row[1:2] == [str(2**63 + 40)] for row in page.rows)
    assert "20 more failed rows" in campaign_page(summary)
    few = made("two inputs").html
    assert "more failed" not in few


def test_a_failed_row_of_a_grid_names_its_combination():
    summary = summary_of(1, rows=64, failed=1, grid=APERTURES)
    assert failed_table(summary, 9).rows[1][0] == "0 of terminals.leo_aperture = 5 cm"
    assert failed_table(summary_of(1, rows=64, failed=1), 9).rows[0][0] == "0"


def test_a_narrow_terminal_has_fewer_quantiles_the_median_among_them():
    summary = summary_of(2)
    wide, narrow = campaign_text(summary, 140), campaign_text(summary, 72)
    assert "99.7 %" in wide.split("Outputs")[1]
    heading = next(line for line in narrow.splitlines() if line.split()[:2] == ["output", "mean"])
    assert "50 %" in heading
    assert "99.7 %" not in heading


def test_outputs_that_are_the_same_in_every_row_stand_in_a_sentence_not_in_the_table():
    cell = summary_of(2).cells[0]
    names = [row[0] for row in campaign_tables.output_table(cell, 3)[1]]
    assert names == ["margin", "residual_quantile", "beyond_share"]
    assert campaign_words.few_values(cell) == ["The same in every row: beacon_margin 6.10 dB."]
    assert campaign_words.few_values(replace(cell, outputs={"margin": cell.outputs["margin"]})) == []
    assert campaign_tables.output_table(summary_of(0, rows=64).cells[0], 3)[1] == []
    for shown in (made("no inputs").html, campaign_text(made("no inputs").summary, 140)):
        assert "The same in every row: margin 3.66 dB, beacon_margin 6.10 dB, residual_quantile 6.50 µrad" in shown


# ------------------------------------------------------------------------------------------------------------ pictures
@pytest.mark.promise("campaigns-2", "campaigns-31")
def test_sections_are_there_where_they_have_something_to_show_and_only_there():
    def drawn_in(name):
        return {key: len(figures) for key, figures in made(name).figures.items() if figures}

    assert drawn_in("two inputs") == {"outputs": 3, "tail": 1, "sensitivity": 1, "region": 1, "worst": 3}
    assert drawn_in("no inputs") == {"tail": 1, "worst": 1}
    assert drawn_in("no loop") == {"outputs": 1, "sensitivity": 1, "region": 1}
    assert drawn_in("all kept") == {"outputs": 3, "tail": 1, "sensitivity": 1}
    assert drawn_in("all failed") == {}
    assert drawn_in("tail alone") == {"tail": 1}
    assert drawn_in("grid of two keys")["grid"] == 1
    page = Page(made("all failed").html)
    assert page.headings[1:] == ["Rows without results", "How the rows were made"]
    assert page.figures == 0


def test_a_distribution_shows_its_limit_its_quantiles_and_all_of_its_rows():
    summary = summary_of(2)
    output = summary.cells[0].outputs["margin"]
    figure = drawing.distribution(output, LIMITS[0])
    assert {"limit ≥ 3.00 dB", "margin (dB)", "rows (%)"} <= set(texts(figure))
    assert any(t.startswith("50 %: 3.6") for t in texts(figure))
    assert figure.columns["rows (%)"].sum() == pytest.approx(100.0)
    assert not any("limit" in t for t in texts(drawing.distribution(output, None)))
    far = texts(drawing.distribution(output, replace(LIMITS[0], least=-40.0)))
    assert "far from here" in " ".join(far)
    both = texts(drawing.distribution(output, replace(LIMITS[0], most=4.5)))
    assert {"limit ≥ 3.00 dB", "limit ≤ 4.50 dB"} <= set(both)


def test_an_axis_has_a_prefix_that_suits_its_values():
    scale = campaign_numbers.scale_of
    for values, unit, name, factor, label in (
        ([2e-6, 9e-6], "rad", "residual_rms", 1e6, "µrad"),
        ([3e8], "bit/s", "data_rate", 1e-6, "Mbit/s"),
        ([8e12], "bit", "volume", 0.125e-12, "TB"),
        ([7200.0], "s", "contact_time", 1.0 / 3600.0, "h"),
        ([0.3], "", "outage", 100.0, "%"),
        ([1e-5], "", "outage", 1.0, "share"),
        ([0.3], "", "mirror.alpha", 1.0, ""),
        ([math.nan], "rad", "residual_rms", 1.0, "rad"),
        ([2.0], "furlong", "", 1.0, "furlong"),
    ):
        found = scale(np.array(values), unit, name)
        assert found.factor == pytest.approx(factor, rel=1e-12, abs=0.0)
        assert found.label == label


def test_the_tail_marks_what_was_wanted_and_the_limit():
    summary = summary_of(2, grid=APERTURES, rows=64)
    (figure,) = drawing.tail(summary, summary.cells[0])
    seen = texts(figure)
    assert {"10⁻⁴: 8.58 µrad", "10⁻⁶: 10.5 µrad", "limit ≤ 10 µrad", "other combinations"} <= set(seen)
    assert "10⁻⁵" in seen  # a decade of the axis
    single = summary_of(2, limits=LIMITS[:1], rows=64)
    (alone,) = drawing.tail(single, single.cells[0])
    assert "other combinations" not in texts(alone)
    assert not any("limit" in t for t in texts(alone))
    dark = replace(summary.cells[0], tail=replace(summary.cells[0].tail, survival=np.zeros(4), radius_rad=np.ones(4)))
    assert drawing.tail(summary, dark) == ()


def test_the_tail_is_drawn_over_microradians():
    summary = summary_of(2, rows=64)
    (figure,) = drawing.tail(summary, summary.cells[0])
    (curve,) = (line for line in figure.sheet.panels[0].all_of(Line) if line.label == "all rows")
    np.testing.assert_allclose(curve.y, np.exp(-0.5 * (curve.x / 2.0) ** 2), rtol=1e-9)  # Rayleigh's, sigma 2 µrad


def test_many_inputs_are_cut_in_the_picture_but_not_in_its_data():
    summary = summary_of(2)
    index = summary.sensitivities[0].first["communication.transmit_power"]
    many = {f"mirror.parameter_{k}": replace(index, value=0.9 - 0.01 * k) for k in range(40)}
    each = replace(summary.sensitivities[0], first=many, total={}, rank_correlation=many)
    (figure,) = drawing.sensitivity(replace(summary, sensitivities=(each,)))
    shown = [t for t in texts(figure) if t.startswith("mirror.parameter_")]
    assert shown == [f"mirror.parameter_{k}" for k in range(drawing.MOST_INPUTS)]
    assert "26 inputs with smaller indices" in figure.caption
    assert len(figure.columns) == 40


def test_a_key_is_cut_to_what_tells_it_from_the_others():
    keys = ["a.b.left.gain", "a.b.right.gain", "mirror", "x.y.right.gain"]
    cut = [drawing.label_of(key, keys) for key in keys]
    assert cut == ["left.gain", "b.right.gain", "mirror", "y.right.gain"]
    long = drawing.label_of(f"table.{'long_' * 30}", ["x"])
    assert max(map(len, long.splitlines())) <= 30
    assert long.endswith("…")


def test_the_failure_region_is_of_the_limit_most_often_missed_over_what_matters_to_it():
    summary = summary_of(6, rows=400, shift_db=0.3)
    (figure,) = campaign_module.region(summary)
    worst = max(summary.cells[0].missed_by, key=lambda name: summary.cells[0].missed_by[name].value)
    assert figure.title == f"Where {worst} misses its limit"
    assert list(figure.columns)[-1] == worst
    leading = [
        key for key, _ in campaign_tables.ranked(next(s for s in summary.sensitivities if s.output == worst))[:2]
    ]
    assert list(figure.columns)[:2] == leading
    assert {"kept", "missed"} <= set(texts(figure))
    assert "no results" not in texts(figure)
    (failing,) = campaign_module.region(summary_of(2, failed=5))
    assert "no results" in texts(failing)


def test_with_one_input_the_region_has_the_output_beside_it():
    (figure,) = campaign_module.region(summary_of(1, shift_db=-0.6))
    assert {"communication.transmit_power (W)", "margin (dB)", "limit ≥ 3.00 dB"} <= set(texts(figure))
    assert "the input that matters most" in figure.caption


def test_the_region_is_of_the_combination_shown_in_detail_unless_it_misses_nothing():
    summary = summary_of(2, grid=APERTURES, rows=256, shift_db=-1.5)
    best = campaign_words.best(summary)
    (figure,) = campaign_module.region(summary)
    assert 0.0 < best.missed.value < 1.0
    assert f"256 rows of {best.label}" in figure.caption
    assert "on both of its sides" not in figure.caption
    kept = summary_of(2, grid=APERTURES, rows=256)
    best = campaign_words.best(kept)
    (figure,) = campaign_module.region(kept)
    assert best.missed.value == 0.0
    assert f"256 rows of {best.label}" not in figure.caption
    assert figure.caption.endswith(f"No limit has rows of {best.label} on both of its sides.")


def test_a_grid_of_two_keys_is_a_map_with_a_number_in_each_field():
    summary = summary_of(1, grid=TWO_KEYS, rows=128)
    (figure,) = drawing.grid(summary)
    shown = [f"{cell.outputs['margin'].quantiles[0.5].value:.3g}" for cell in summary.cells]
    assert set(shown) <= set(texts(figure))
    gap = replace(summary, cells=(replace(summary.cells[0], rows=0, failed=0, outputs={}), *summary.cells[1:]))
    assert texts(drawing.grid(gap)[0]).count("none") == 2
    assert texts(figure).count("none") == 0


def test_other_grids_have_a_row_for_each_combination():
    for keys in (APERTURES, THREE_KEYS):
        summary = summary_of(1, grid=keys, rows=64)
        (figure,) = drawing.grid(summary)
        for cell in summary.cells:
            assert ", ".join(cell.values.values()) in texts(figure)
    assert drawing.grid(summary_of(1, rows=64)) == ()


def test_a_grid_without_limits_shows_medians():
    summary = summary_of(1, grid=APERTURES, rows=64, limits=())
    (figure,) = drawing.grid(summary)
    assert "rows that miss a limit" not in " ".join(texts(figure))
    assert "median margin" in " ".join(texts(figure))


def test_a_worst_row_of_one_axis_and_one_of_two():
    summary = summary_of(2)
    two = drawing.worst(summary, trace_of(0), 1)
    assert two.columns["radial error (rad)"] == pytest.approx(np.hypot(*trace_of(0).error_rad.T))
    assert {"drive 1", "drive 2"} <= set(texts(two))
    trace = trace_of(0)
    single = replace(trace, error_rad=trace.error_rad[:, :1], drive_v=trace.drive_v[:, 0])
    one = drawing.worst(summary, single, 1)
    assert one.columns["radial error (rad)"] == pytest.approx(np.abs(trace.error_rad[:, 0]))
    assert "drive 1" not in texts(one)
    assert one.caption == "Row 100: of its rows the worst in margin, 1.20 dB. Shown is the first run of the row's."
    assert one.title == "Worst row in time"
    assert drawing.worst(summary, single, 2).title == "Second worst row in time"
    trace.error_rad[0] = 500e-6  # the loop only closes
    begun = drawing.worst(summary, trace, 1)
    assert begun.caption.endswith("Its begin, up to 707 µrad, is cut off.")
    assert begun.sheet.panels[0].y.high < 20.0
    trace.error_rad[[0, -1]] = 0.0, 500e-6  # a real excursion is never cut
    late = drawing.worst(summary, trace, 1)
    assert "cut off" not in late.caption
    assert late.sheet.panels[0].y.high is None
    assert late.sheet.panels[0].marks[0].y.max() == pytest.approx(500.0)


# ------------------------------------------------------------------------------------------------ what a reader misread
def unknown_beyond(summary, least, most):
    """The summary with the ends of the quantiles outside of least to most unknown."""
    cell = summary.cells[0]

    def cut(output):
        found = {
            p: q if least <= p <= most else replace(q, low=math.nan) if p < 0.5 else replace(q, high=math.nan)
            for p, q in output.quantiles.items()
        }
        return replace(output, quantiles=found)

    outputs = {name: cut(output) for name, output in cell.outputs.items()}
    return replace(summary, cells=(replace(cell, outputs=outputs),))


@pytest.mark.promise("campaigns-31")
def test_a_quantile_that_the_rows_cannot_know_is_a_dash_and_is_not_in_the_picture():
    whole, few = summary_of(2), unknown_beyond(summary_of(2), 0.01, 0.99)
    headings, rows = campaign_tables.output_table(few.cells[0], 9)
    assert [rows[0][headings.index(p)] for p in ("0.3 %", "99.7 %")] == ["–", "–"]
    assert "–" not in rows[0][headings.index("1 %")]
    assert not any("–" in row for row in campaign_tables.output_table(whole.cells[0], 9)[1])
    assert "–: not known, there are too few rows" in campaign_text(few, 140)
    assert "there are too few rows" not in campaign_text(whole, 140)
    shown, before = (texts(drawing.distribution(s.cells[0].outputs["margin"], None)) for s in (few, whole))
    assert any(t.startswith("0.3 %: ") for t in before)
    assert not any(t.startswith(("0.3 %: ", "99.7 %: ")) for t in shown)
    assert any(t.startswith("1 %: ") for t in shown)
    span = drawing._span(few.cells[0].outputs["margin"])
    assert span.low == whole.cells[0].outputs["margin"].quantiles[0.01].value
    nothing = unknown_beyond(whole, 0.5, 0.5).cells[0].outputs["margin"]
    assert drawing._span(nothing).low == nothing.least


def test_quantiles_come_in_pairs_and_those_known_first():
    output = summary_of(2).cells[0].outputs["margin"]
    inner = dict.fromkeys((0.05, 0.95), output.quantiles[0.5])
    nine = replace(output, quantiles={**output.quantiles, **inner})
    for most in range(1, 10):
        chosen = campaign_tables.chosen_quantiles([nine], most)
        assert 0.5 in chosen
        assert len(chosen) <= most
        assert {round(1.0 - p, 6) for p in chosen} == set(chosen)
    assert campaign_tables.chosen_quantiles([nine], 3) == [0.01, 0.5, 0.99]
    few = {p: q if p in (0.05, 0.5, 0.95) else replace(q, low=math.nan) for p, q in nine.quantiles.items()}
    assert campaign_tables.chosen_quantiles([replace(nine, quantiles=few)], 3) == [0.05, 0.5, 0.95]


@pytest.mark.promise("readme-12")
def test_the_page_has_the_intervals_of_the_quantiles():
    made_of = made("two inputs")
    median = made_of.summary.cells[0].outputs["margin"].quantiles[0.5]
    assert f"{value(median.low, 'dB')} to {value(median.high, 'dB')}</span>" in made_of.html
    assert f"{value(median.low, 'dB')} to" not in campaign_text(made_of.summary, 140)


def test_failed_rows_stand_before_the_share_of_the_others():
    kept = summary_of(2, rows=16, failed=15, shift_db=30.0)
    assert campaign_words.headline(kept).startswith("15 of 16 rows failed; the only other row keeps both limits;")
    none = campaign_words.headline(summary_of(2, rows=16, failed=3, shift_db=-30.0))
    assert none.startswith("3 of 16 rows failed; none of the other 13 rows keeps both limits; ")
    every = campaign_words.headline(summary_of(2, rows=16, failed=3, shift_db=30.0))
    assert every.startswith("3 of 16 rows failed; all other 13 rows keep both limits; ")
    grid = campaign_words.headline(summary_of(2, grid=APERTURES, rows=64, failed=2))
    assert grid.startswith("8 of 256 rows failed; of 4 combinations, ")
    assert "failed" not in campaign_words.headline(summary_of(2, rows=16))


def test_where_it_is_not_known_what_matters_nothing_matters_most():
    summary = summary_of(2)
    few = tuple(replace(s, first={}, total={}, note="32 good rows are too few") for s in summary.sensitivities)
    blind = replace(summary, sensitivities=few)
    said = campaign_words.matters(blind)
    assert said == ["What matters to margin and residual_quantile is not known: 32 good rows are too few."]
    assert "matter" not in campaign_module.region(blind)[0].caption
    assert "the inputs that matter most" in campaign_module.region(summary_of(6, rows=400, shift_db=0.3))[0].caption


def test_each_output_is_explained_and_the_rate_that_is_possible_is_not_the_grids():
    summary = summary_of(2)
    for shown in (campaign_text(summary, 140), campaign_page(summary)):
        for output in summary.cells[0].outputs.values():
            assert output.meaning in shown
    cell = summary.cells[0]
    rate = replace(cell.outputs["margin"], name="data_rate", unit="bit/s")
    of_rate = replace(cell, outputs={"data_rate": rate})
    assert campaign_tables.output_table(of_rate, 3)[1][0][0] == "data_rate (possible)"
    assert campaign_tables.output_table(cell, 3)[1][0][0] == "margin"
    assert drawing.distribution(rate, None).title == "Distribution of data_rate (possible)"


def test_a_low_end_that_is_as_good_as_nothing_reads_0():
    ends = campaign_numbers.ends
    assert ends(Interval(3.5e-7, 7.5e-39, 2.6e-5, 0.99), "", "outage") == "0 to 2.6×10⁻⁵"
    assert ends(Interval(3.5e-7, 7.5e-11, 2.6e-5, 0.99), "", "outage") == "7.5×10⁻¹¹ to 2.6×10⁻⁵"
    assert ends(Interval(0.01, 0.0, 0.02, 0.99), "", "outage") == "0 % to 2 %"


def test_the_tails_worth_stands_in_plain_english():
    tail = replace(rayleigh_tail(2e-6), effective_runs=2.44e7)
    said = campaign_words.tail_method(tail)
    assert said.startswith("It comes from the share of the time of 64 rows")
    assert said.endswith("It knows 10⁻⁶ as well as 24 million independent samples of the error would.")
    assert "samples" not in campaign_words.tail_method(replace(tail, effective_runs=math.nan))
    for count, words in ((1.3e5, "130000 "), (3.21e9, "3.2 billion ")):
        assert f" {words}independent" in campaign_words.tail_method(replace(tail, effective_runs=count))


def test_worst_rows_are_numbered_in_their_cell():
    summary = summary_of(2, grid=APERTURES, rows=64)
    traces = (trace_of(0), trace_of(1), trace_of(2, cell=1))
    drawn_ = campaign_figures(replace(summary, worst=traces))["worst"]
    assert [figure.title.split(" row")[0] for figure in drawn_] == ["Worst", "Second worst", "Worst"]
    assert len({figure.name for figure in drawn_}) == 3


def test_no_axis_has_a_factor_beside_it():
    summary = summary_of(2)
    output = summary.cells[0].outputs["margin"]
    tiny = replace(output, name="outage", unit="", edges=output.edges * 1e-6, least=1e-6, most=5e-6, quantiles={})
    near = replace(output, edges=output.edges * 1e-5 + 7.0, least=7.0, most=7.00005, quantiles={})
    for each in (tiny, near):
        seen = texts(drawing.distribution(each, None))
        assert not any(t.startswith(("10⁻", "+")) for t in seen)
    assert any(re.fullmatch(r"[2-4](\.\d+)?×10⁻⁶", t) for t in texts(drawing.distribution(tiny, None)))
    assert "7.000020" in texts(drawing.distribution(near, None))


def test_an_output_of_two_values_has_a_sentence_and_no_picture():
    column = np.where(np.arange(64) < 48, 0.0, 0.25)
    two = replace(output_summary("lost_share", column), deviation=float(column.std(ddof=1)))
    three = output_summary("lost_share", np.append(column, 0.125))
    cell = summary_of(2).cells[0]
    for output, pictures in ((two, 0), (three, 1)):
        summary = replace(summary_of(2), cells=(replace(cell, outputs={"lost_share": output}),))
        said = "lost_share has two values: 0 % in 75 % of the rows, 25 % in 25 %."
        assert (said in campaign_text(summary, 140)) == (not pictures)
        assert len(campaign_figures(summary)["outputs"]) == pictures


def test_the_grid_lists_mean_and_misses_of_each_limit_for_every_combination():
    summary = summary_of(2, grid=APERTURES, rows=256, shift_db=-1.5)
    wide, narrow = campaign_text(summary, 200), campaign_text(summary, 90)
    assert "Limits by combination" in narrow
    assert "Limits by combination" not in wide
    for text in (wide, narrow):
        assert all(heading in text for heading in ("mean margin", "miss margin", "keep all"))
        for cell in summary.cells:
            line = f"{value(cell.outputs['margin'].mean.value, 'dB')} +{share(cell.missed_by['margin'].value)}"
            assert re.search(line, text)
    assert any("mean margin" in row for row in Page(campaign_page(summary)).rows)


def test_findings_stand_under_the_verdict_in_text_page_and_data():
    plain = summary_of(2)
    told = replace(plain, findings=("The 1 % quantile of margin is known within 0.05 dB, as asked.",))
    lines = campaign_text(told, 140).splitlines()
    assert lines[2] == told.findings[0]
    assert lines[0] == campaign_words.headline(told)
    assert f"<p>{told.findings[0]}</p>" in campaign_page(told).split("</section>")[0]
    assert campaign_data(told)["findings"] == list(told.findings)
    assert campaign_data(plain)["findings"] == []
    assert "Limits" in campaign_text(plain, 140).splitlines()[2]


def test_the_same_summary_gives_the_same_page_twice():
    again = without_scripts(campaign_page(CASES["few rows"]()))
    assert again == made("few rows").html
    assert again != made("one row").html


# ------------------------------------------------------------------------------------------------- limits and few rows
UNKNOWN = Interval(math.nan, math.nan, math.nan, CONFIDENCE)


def a_tail(**changes):
    """Radii of 1, 2 and 3 µrad, the last one never exceeded."""
    given = Tail(
        np.array([1e-6, 2e-6, 3e-6]),
        np.array([0.5, 0.1, 0.0]),
        np.array([0.4, 0.05, 0.0]),
        np.array([0.6, 0.2, 0.01]),
        {0.1: Interval(2e-6, 1.5e-6, 2.5e-6, CONFIDENCE)},
        CONFIDENCE,
        "a method",
        math.nan,
    )
    return replace(given, **changes)


@pytest.mark.parametrize(
    ("probability", "said"),
    [
        (1e-3, "0.1 %"),
        (9.9e-4, "9.9×10⁻⁴"),
        (0.95, "95.0 %"),
        (0.89, "89 %"),
        (1.0 - 1e-12, "99.99999999 %"),
        (-0.1, "\u221210 %"),
    ],
)
def test_a_probability_has_a_power_below_a_thousandth_and_more_digits_from_nine_tenths_on(probability, said):
    assert share(probability) == said


@pytest.mark.parametrize(
    ("low", "high", "unit", "name", "said"),
    [
        (math.nan, 2.0, "dB", "margin", "at most 2.00 dB"),
        (0.5, math.nan, "dB", "margin", "at least 0.50 dB"),
        (math.nan, math.nan, "dB", "margin", ""),
        (0.5, 2.0, "dB", "margin", "0.50 dB to 2.00 dB"),
        (1e-12, 0.2, "", "outage", "10⁻¹² to 20 %"),
        (9e-13, 0.2, "", "outage", "0 % to 20 %"),
        (0.0, 1e-4, "1", "lost_share", "0 to 10⁻⁴"),
        (9e-13, math.nan, "", "outage", "at least 0 %"),
        (9e-13, 0.2, "", "mirror.alpha", "9e-13 to 0.2"),
    ],
)
def test_an_interval_names_the_ends_that_are_known(low, high, unit, name, said):
    found = Interval(1.0, low, high, CONFIDENCE)
    assert campaign_numbers.ends(found, unit, name) == said
    own = value(1.0, unit, name)
    assert campaign_numbers.with_ends(found, unit, name) == (f"{own} ({said})" if said else own)


@pytest.mark.parametrize(
    ("largest", "unit", "name", "factor", "label"),
    [
        (1e-3, "", "outage", 100.0, "%"),
        (9.9e-4, "", "outage", 1.0, "share"),
        (0.3, "1", "lost_share", 100.0, "%"),
        (0.3, "1", "mirror.alpha", 1.0, ""),
        (0.3, "rad", "outage", 1e3, "mrad"),
        (3.0, "dB", "margin", 1.0, "dB"),
        (7200.0, "s", "wait", 1.0 / 3600.0, "h"),
        (7199.0, "s", "wait", 1.0 / 60.0, "min"),
        (120.0, "s", "wait", 1.0 / 60.0, "min"),
        (119.0, "s", "wait", 1.0, "s"),
        (-119.0, "s", "wait", 1.0, "s"),
    ],
)
def test_an_axis_changes_its_unit_at_a_round_value(largest, unit, name, factor, label):
    found = campaign_numbers.scale_of(np.array([largest, math.inf, 0.0]), unit, name)
    assert found.factor == pytest.approx(factor, rel=1e-12)
    assert found.label == label
    assert found.title("output") == (f"output ({label})" if label else "output")


def test_a_limit_of_two_sides_names_both():
    assert campaign_numbers.limit_text(Limit("margin", 3.0, 5.0, ""), "dB") == "margin ≥ 3.00 dB and ≤ 5.00 dB"
    assert campaign_numbers.limit_text(Limit("margin", 0.0, None, ""), "dB") == "margin ≥ 0.00 dB"
    assert campaign_numbers.limit_text(Limit("data_rate", None, 5e6, ""), "bit/s") == "data_rate (possible) ≤ 5 Mbit/s"


def test_a_cell_whose_misses_are_not_known_is_the_best_only_where_no_other_is():
    summary = summary_of(2, grid=APERTURES, rows=16)
    blind = replace(summary.cells[0], missed=UNKNOWN)
    worse = replace(summary.cells[1], missed=Interval(0.9, 0.8, 1.0, CONFIDENCE))
    assert campaign_words.best(replace(summary, cells=(blind, worse))) is worse
    assert campaign_words.best(replace(summary, cells=(blind, blind))) is blind
    same = replace(worse, values={})
    assert campaign_words.best(replace(summary, cells=(worse, same))) is worse
    said = campaign_words.headline(replace(summary, cells=(blind, worse, replace(worse, missed=proportion(0, 16)))))
    assert f"; {worse.label} least often, in 10 % (" in said


@pytest.mark.parametrize(
    ("radius_rad", "found"),
    [
        (0.9e-6, None),
        (1e-6, (0.5, 0.4, 0.6)),
        (2e-6, (0.1, 0.05, 0.2)),
        (2.5e-6, (0.0, 0.0, 0.105)),
        (3e-6, (0.0, 0.0, 0.01)),
    ],
)
def test_the_tail_is_read_from_its_first_radius_to_the_largest_error_seen(radius_rad, found):
    past = campaign_words.beyond(a_tail(), radius_rad)
    if found is None:
        assert past is None
    else:
        assert (past.value, past.low, past.high) == pytest.approx(found, rel=1e-9)
        assert past.confidence == CONFIDENCE


def test_a_low_end_of_the_tail_that_is_nothing_is_0():
    assert campaign_words.beyond(a_tail(low=np.array([0.4, 0.0, 0.0])), 2e-6).low == 0.0


def test_the_verdict_passes_only_where_all_rows_are_there_and_keep_the_limits():
    kept = summary_of(2, rows=16, shift_db=30.0)
    assert campaign_words.verdict(kept) == "pass"
    cell = replace(kept.cells[0], rows=17, failed=1)
    assert campaign_words.verdict(replace(kept, cells=(cell,))) == "open"
    assert campaign_words.verdict(replace(kept, progress=replace(kept.progress, state="running"))) == "open"
    none = summary_of(2, rows=16, failed=16)
    for state, failed, word in (
        ("waiting", (), "open"),
        ("running", (), "open"),
        ("stopped", (), "fail"),
        ("complete", (), "fail"),
        ("running", none.failed, "fail"),
    ):
        at = replace(none, failed=failed, progress=replace(none.progress, state=state))
        assert campaign_words.verdict(at) == word


def test_the_only_row_that_failed_is_called_so():
    assert campaign_words.headline(summary_of(2, rows=1, failed=1)) == "No row has results: the only one failed."


def test_a_tail_alone_that_does_not_know_its_radius_says_so():
    summary = tail_alone()
    (cell,) = summary.cells
    blind = replace(cell, tail=replace(cell.tail, wanted={1e-6: UNKNOWN}))
    said = campaign_words.headline(replace(summary, cells=(blind,)))
    assert said == "The radius that is wanted is not known from these rows."
    with_outputs = replace(summary_of(2, limits=(), rows=16))
    assert campaign_words.headline(with_outputs) == "16 rows with results; no limit is set."


def test_three_limits_are_counted():
    three = (*LIMITS, Limit("beyond_share", None, 0.5, "campaign"))
    assert "rows keep all 3 limits" in campaign_words.headline(summary_of(2, limits=three, rows=16, shift_db=30.0))


@pytest.mark.parametrize(
    ("missed", "rows", "failed", "said"),
    [
        (0.0, 1, 0, "The only row keeps it; at 99 % confidence at least 50 % of all draws do"),
        (0.0, 4, 0, "All 4 rows keep it; at 99 % confidence at least 50 % of all draws do"),
        (0.0, 5, 1, "All other 4 rows keep it; at 99 % confidence at least 50 % of all draws do"),
        (0.0, 2, 1, "The only other row keeps it; at 99 % confidence at least 50 % of all draws do"),
        (1.0, 1, 0, "The only row misses it; at 99 % confidence at most 80 % of all draws do"),
        (1.0, 4, 0, "None of 4 rows keeps it; at 99 % confidence at most 80 % of all draws do"),
        (1.0, 5, 1, "None of the other 4 rows keeps it; at 99 % confidence at most 80 % of all draws do"),
        (1.0, 2, 1, "The only other row misses it; at 99 % confidence at most 80 % of all draws do"),
        (0.3, 4, 0, "70 % of the rows keep it (50 % to 80 % at 99 % confidence)"),
        (0.3, 5, 1, "70 % of the other 4 rows keep it (50 % to 80 % at 99 % confidence)"),
    ],
)
def test_how_many_rows_keep_a_limit_is_said_for_one_row_and_many_with_failed_ones_or_none(missed, rows, failed, said):
    cell = replace(summary_of(2, rows=4).cells[0], rows=rows, failed=failed)
    found = replace(cell, missed=Interval(missed, 0.2, 0.5, CONFIDENCE))
    assert campaign_words._kept(found, "it") == said
    alone = replace(cell, missed=Interval(missed, math.nan, math.nan, CONFIDENCE))
    assert campaign_words._kept(alone, "it") == said.split(";")[0].split(" (")[0]


def test_an_input_at_the_least_index_is_named_and_one_below_is_not():
    summary = summary_of(2)
    index = Interval(campaign_words.MATTERS, 0.0, 0.1, 0.95)
    each = replace(summary.sensitivities[0], first={}, total={"a": index, "b": replace(index, value=0.0499)}, note="")
    found = replace(summary, sensitivities=(each,))
    assert campaign_words.leading(found, "margin") == ["a"]
    assert campaign_words.leading(found, "other") == []
    said = "What matters most to margin (total Sobol index): a 0.05 (0.00 to 0.10)."
    assert campaign_words.matters(found) == [said]
    weak = replace(each, total={"b": replace(index, value=0.0499)})
    for note, end in (("", "."), ("few rows", "; few rows.")):
        told = campaign_words.matters(replace(summary, sensitivities=(replace(weak, note=note),)))
        assert told == [f"No input by itself decides margin{end}"]
    four = replace(each, total={key: replace(index, value=0.9 - 0.1 * k) for k, key in enumerate("abcd")})
    assert campaign_words.matters(replace(summary, sensitivities=(four,)))[0].count("(0.00 to 0.10)") == 3
    assert [key for key, _ in campaign_tables.ranked(four)] == ["a", "b", "c", "d"]
    unknown = replace(each, total={"a": index, "b": UNKNOWN})
    assert [key for key, _ in campaign_tables.ranked(unknown)] == ["a"]
    assert campaign_tables.index_text(UNKNOWN) == campaign_tables.index_text(None) == ""


def test_without_a_limit_the_first_three_outputs_have_what_matters_to_them():
    summary = summary_of(2, limits=())
    each = replace(summary.sensitivities[0], note="", first={}, total={"a": Interval(0.9, 0.8, 1.0, 0.95)})
    four = replace(summary, sensitivities=tuple(replace(each, output=name) for name in "pqrs"))
    assert [said.split(" (")[0] for said in campaign_words.matters(four)] == [
        f"What matters most to {name}" for name in "pqr"
    ]


def test_the_tail_is_told_at_the_bounds_of_residuals_alone():
    summary = summary_of(2, rows=16)
    cell = replace(summary.cells[0], tail=a_tail())
    radius = "The radial error exceeds 2.00 µrad with probability 10 % (1.50 µrad to 2.50 µrad at 99 % confidence)."

    def told(*limits, tail=cell.tail):
        return campaign_words.tail_sentences(replace(summary, limits=limits), replace(cell, tail=tail))

    at = "The radial error is beyond 2 µrad with probability 10 % (5 % to 20 % at 99 % confidence)."
    assert told(Limit("residual_rms", None, 2e-6, "")) == [radius, at]
    assert told(Limit("point_ahead", None, 2e-6, "")) == [radius]
    assert told(Limit("residual_rms", 1e-6, None, "")) == [radius]
    assert told(Limit("residual_rms", None, 0.5e-6, "")) == [radius]  # below its radii
    assert told(tail=replace(cell.tail, wanted={0.1: UNKNOWN})) == []
    bare = replace(cell.tail, wanted={0.1: Interval(2e-6, math.nan, math.nan, CONFIDENCE)})
    assert told(tail=bare) == ["The radial error exceeds 2.00 µrad with probability 10 %."]
    beyond = {2e-6: Interval(0.1, 0.05, 0.2, CONFIDENCE)}
    assert told(tail=replace(cell.tail, beyond=beyond))[1] == at
    worth = replace(cell.tail, beyond=beyond, variance={2e-6: 0.009})
    assert told(tail=worth)[1] == (
        f"{at} The variance of that estimate is 0.009, that of 10 draws without importance sampling."
    )


def test_what_the_tail_knows_is_of_the_least_probability_whose_radius_is_known():
    known = {1e-2: Interval(1e-6, 1e-6, 1e-6, CONFIDENCE), 1e-6: UNKNOWN}
    said = campaign_words.tail_method(a_tail(wanted=known, effective_runs=128.0))
    assert said == "It comes from a method. It knows 1 % as well as 130 independent samples of the error would."
    none = a_tail(wanted={1e-6: UNKNOWN}, effective_runs=128.0)
    assert campaign_words.tail_method(none) == "It comes from a method."


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (1e9, "1 billion"),
        (1e6, "1 million"),
        (999_600.0, "1 million"),
        (9.96e8, "1 billion"),
        (990_000.0, "990000"),
        (2.5e9, "2.5 billion"),
    ],
)
def test_a_large_number_is_spoken_from_a_million_on(count, said):
    assert campaign_words._many(count) == said


def test_a_campaign_at_its_last_row_still_counts_of_all():
    summary = replace(summary_of(0, rows=4), progress=Progress(4, 4, 1.0, 0.0, 0.0, "running"))
    assert campaign_words.progress_words(summary) == "Running: 4 of 4 rows, 0 s left."
    done = replace(summary, progress=Progress(1, 1, 1.0, 0.0, 0.0, "complete"))
    assert campaign_words.progress_words(done) == "Complete: 1 row in 1 s."


@pytest.mark.parametrize(
    ("inputs", "loop", "fixed", "said"),
    [
        (0, "", {}, ["no drawn inputs", "No loop is simulated: the links are at their budgeted errors."]),
        (1, "LQG", {"a": "1", "b": "2"}, ["1 drawn input", "Loop: LQG.", "Set: a = 1, b = 2."]),
        (2, "LQG", {}, ["2 drawn inputs", "Loop: LQG."]),
    ],
)
def test_how_the_rows_were_made_counts_inputs_and_names_the_loop_and_what_is_set(inputs, loop, fixed, said):
    summary = replace(summary_of(inputs, rows=4), loop=loop, fixed=fixed, seed=7)
    drawn_, *rest = said
    assert campaign_words.setting(summary) == [f"Sampling sobol, {drawn_}, seed 7.", *rest]


def test_an_output_without_rows_is_neither_the_same_in_every_row_nor_explained():
    cell = summary_of(2, rows=16).cells[0]
    same = cell.outputs["beacon_margin"]
    none = replace(same, rows=0)
    empty = replace(cell, outputs={"beacon_margin": none})
    assert campaign_words.few_values(empty) == []
    assert campaign_words.few_values(None) == []
    assert campaign_tables.meanings_table(empty).rows == campaign_tables.meanings_table(None).rows == []
    told = campaign_tables.meanings_table(replace(cell, outputs={"beacon_margin": same})).rows
    assert told == [("beacon_margin", same.meaning)]
    wide = replace(empty, outputs={"margin": replace(cell.outputs["margin"], rows=0)})
    assert campaign_tables.output_table(wide, 3).rows == []


def test_two_rows_may_have_two_values_and_one_row_has_one():
    two = replace(output_summary("lost_share", np.array([0.0, 0.25])), deviation=0.25 / math.sqrt(2.0))
    assert campaign_words.two_values(two) == pytest.approx(0.5)
    assert campaign_words.two_values(replace(two, rows=1)) is None
    assert campaign_words.two_values(replace(two, most=two.least)) is None


# ---------------------------------------------------------------------------------------------------- tables in detail
def test_a_limit_that_no_row_knows_has_no_line_in_the_table():
    summary = summary_of(2, rows=16)
    cell = replace(summary.cells[0], missed_by={"margin": Interval(0.25, 0.1, 0.5, CONFIDENCE)})
    found = campaign_tables.limit_table(summary, cell)
    assert found.headings == ("limit", "missed by", "99 % interval", "from")
    assert found.rows == [("margin ≥ 3.00 dB", "25 %", "10 % to 50 %", "requirement.margin")]


def test_a_quantile_that_an_output_does_not_have_is_left_empty():
    cell = summary_of(2, rows=16).cells[0]
    margin, other = cell.outputs["margin"], cell.outputs["residual_quantile"]
    found = replace(cell, outputs={"margin": margin, "other": replace(other, quantiles={})})
    assert [row[3:] for row in campaign_tables.output_table(found, 1).rows][1] == ("",)
    odd = replace(margin, quantiles={0.2: margin.quantiles[0.5], 0.5: margin.quantiles[0.5]})
    assert campaign_tables.chosen_quantiles([odd], 2) == [0.2, 0.5]
    assert campaign_tables.chosen_quantiles([odd], 1) == [0.5]
    one = replace(margin, quantiles={0.99: margin.quantiles[0.99], 0.5: margin.quantiles[0.5]})
    assert campaign_tables.chosen_quantiles([one], 9) == [0.5]  # half of a pair


def test_combinations_have_columns_of_limits_only_where_there_are_limits_and_rows():
    summary = summary_of(2, grid={"mirror": ("a", "b")}, rows=16, shift_db=30.0)
    (first, second), free = summary.cells, replace(summary, limits=())
    gone = replace(second, rows=3, failed=3)
    said = campaign_tables.cell_table(summary, (first, gone))
    assert said.headings == ("mirror", "keep all", "rows", "failed")
    assert said.rows[0] == ("a", campaign_numbers.share_ends(proportion(16, 16)), "16", "0")
    assert said.rows[1] == ("b", "", "0", "3")
    assert campaign_tables.cell_table(free, (first, gone)).headings == ("mirror", "rows", "failed")
    assert campaign_tables.cell_table(free, (first, gone)).rows == [("a", "16", "0"), ("b", "0", "3")]
    bare = replace(first, missed_by={}, outputs={"margin": first.outputs["margin"]})
    limited = campaign_tables.limited_table(summary, (first, gone, bare))
    mean = value(first.outputs["margin"].mean.value, "dB")
    assert limited.rows[0][:3] == ("a", mean, "0 %")
    assert limited.rows[1] == ("b", "", "", "", "")
    assert limited.rows[2] == ("a", mean, "", "", "")


def test_a_table_of_the_terminal_keeps_the_columns_that_fit_to_the_last_one():
    headings, rows = ("aa", "b", "c"), [("1", "22", "3")]
    assert campaign_terminal._wide(headings, rows) == 14
    assert campaign_terminal._narrowed(headings, rows, 1, 14).headings == headings
    assert campaign_terminal._narrowed(headings, rows, 1, 13) == (("aa", "b"), [("1", "22")])
    assert campaign_terminal._narrowed(headings, rows, 2, 1).headings == ("aa", "b")


def test_combinations_stand_in_one_table_from_the_width_that_it_takes():
    summary = summary_of(2, grid={"mirror": ("a", "b")}, rows=16)
    (whole,) = campaign_terminal._over_the_grid(summary, 1000)
    wide = campaign_terminal._wide(whole.headings, whole.rows)
    assert [t.title for t in campaign_terminal._over_the_grid(summary, wide)] == ["Combinations"]
    assert [t.title for t in campaign_terminal._over_the_grid(summary, wide - 1)] == [
        "Combinations",
        "Limits by combination",
    ]
    free = replace(summary, limits=())
    assert [t.title for t in campaign_terminal._over_the_grid(free, 10)] == ["Combinations"]


# -------------------------------------------------------------------------------------------------- pictures in detail
def marks(figure, panel=0):
    """The marks of a panel of a picture, or of a panel alone."""
    return figure.sheet.panels[panel].marks


def limit_marks(found):
    """Where the lines of a limit stand among marks, and the labels of those that are in the legend alone."""
    labelled = [mark for mark in found if mark.label.startswith("limit")]
    return [m.at for m in labelled if isinstance(m, Rule)], [m.label for m in labelled if isinstance(m, Line)]


def test_a_key_that_is_the_end_of_another_needs_its_whole_length():
    keys = ["a.loop.gain", "loop.gain", "b.loop.rate"]
    assert [drawing.label_of(key, keys) for key in keys] == ["a.loop.gain", "loop.gain", "loop.rate"]


@pytest.mark.parametrize(
    ("least", "most", "at", "far"),
    [
        (-1.0, None, [-1.0], []),
        (-1.01, None, [], ["limit ≥ −1.01 dB,\nfar from here"]),
        (None, 2.0, [2.0], []),
        (None, 2.01, [], ["limit ≤ 2.01 dB,\nfar from here"]),
        (0.5, 3.0, [0.5], ["limit ≤ 3.00 dB,\nfar from here"]),
    ],
)
def test_a_limit_is_drawn_as_far_away_as_the_rows_are_wide_and_told_beyond(least, most, at, far):
    output = output_summary("margin", np.linspace(0.0, 1.0, 41))
    found = marks(drawing.distribution(output, Limit("margin", least, most, "")))
    assert limit_marks(found) == (at, far)
    shaded = [(mark.low, mark.high) for mark in found if isinstance(mark, Span)]
    assert shaded == [(-math.inf, bound) if bound == least else (bound, math.inf) for bound in at]


def tail_of(*limits, **changes):
    """The marks of the picture of `a_tail`."""
    summary = replace(summary_of(2, rows=16), limits=limits)
    (figure,) = drawing.tail(summary, replace(summary.cells[0], tail=a_tail(**changes)))
    return marks(figure)


def test_the_limit_of_a_tail_is_the_least_upper_bound_of_a_residual():
    rms, quantile = Limit("residual_rms", None, 3e-6, ""), Limit("residual_quantile", None, 2e-6, "")
    assert limit_marks(tail_of(rms)) == ([pytest.approx(3.0)], [])
    assert limit_marks(tail_of(rms, quantile)) == ([pytest.approx(2.0)], [])
    assert limit_marks(tail_of(Limit("residual_rms", 1e-6, None, ""))) == ([], [])
    assert limit_marks(tail_of(Limit("point_ahead", None, 2e-6, ""))) == ([], [])
    assert limit_marks(tail_of(replace(rms, most=4e-6))) == ([pytest.approx(4.0)], [])  # twice the largest error seen
    assert limit_marks(tail_of(replace(rms, most=4.1e-6))) == ([], ["limit ≤ 4.1 µrad,\nfar from here"])


def test_a_radius_of_the_tail_is_marked_where_it_is_known_with_the_ends_that_are():
    both, alone = Interval(2e-6, 1.5e-6, 2.6e-6, CONFIDENCE), Interval(1.8e-6, math.nan, math.nan, CONFIDENCE)
    found = [mark for mark in tail_of(wanted={0.1: both, 0.2: alone, 1e-6: UNKNOWN}) if getattr(mark, "marker", "")]
    assert [mark.label for mark in found] == ["10 %: 2.00 µrad", "20 %: 1.80 µrad"]
    assert [(mark.x[0], mark.y[0]) for mark in found] == [pytest.approx((2.0, 0.1)), pytest.approx((1.8, 0.2))]
    np.testing.assert_allclose(found[0].x_arms, [[0.5], [0.6]], rtol=1e-9)
    assert found[1].x_arms is None


def test_an_index_that_is_not_known_has_no_bar():
    index = Interval(0.5, 0.4, 0.7, 0.95)
    each = Sensitivity("margin", 64, {"a": index, "b": UNKNOWN}, {"b": index}, {}, 0.9, "")
    first, arms, total, _ = drawing._index_bars(each, ["a", "b"])
    assert (first.label, total.label) == ("first order", "total")
    assert first.end.tolist() == total.end.tolist() == [0.5]
    assert first.at == pytest.approx([-0.19])
    assert total.at == pytest.approx([1.19])
    assert arms.x_arms.ravel() == pytest.approx([0.1, 0.2])
    (alone, _) = drawing._index_bars(replace(each, total={}), ["a", "b"])
    assert alone.at == pytest.approx([0.0])
    assert alone.breadth == pytest.approx([0.76])


@pytest.mark.parametrize(
    ("column", "wide"),
    [
        ([1.0, 30.0], False),
        ([1.0, 31.0], True),
        ([0.0, 31.0], False),
        ([-1.0, 31.0], False),
        ([math.nan, 1.0, 31.0], True),
        ([math.nan], False),
        ([], False),
    ],
)
def test_an_axis_is_logarithmic_from_a_ratio_of_30_on_where_all_values_are_positive(column, wide):
    assert drawing._wide(np.array(column)) is wide


def test_a_grid_of_one_combination_has_no_picture():
    summary = summary_of(1, grid={"mirror": ("a",)}, rows=16)
    assert drawing.grid(summary) == ()
    assert campaign_figures(summary)["grid"] == ()


@pytest.mark.parametrize(
    ("first", "second", "maps"),
    [(1, 4, False), (2, 2, True), (12, 2, True), (13, 2, False), (12, 8, True), (9, 9, False), (2, 12, True)],
)
def test_a_grid_of_two_keys_is_a_map_as_far_as_its_fields_can_be_read(first, second, maps):
    cell = summary_of(0, rows=4, loop=False).cells[0]
    texts_ = [(f"a{k}", f"b{m}") for k in range(first) for m in range(second)]
    cells = tuple(replace(cell, values=dict(zip(("one.x", "two.y"), pair, strict=True))) for pair in texts_)
    (figure,) = drawing.grid(replace(summary_of(0, rows=4, loop=False), cells=cells))
    panel = figure.sheet.panels[0]
    fields = [mark for mark in panel.marks if isinstance(mark, Field)]
    assert len(fields) == maps
    assert ("a number in each field" in figure.caption) is maps
    if maps:  # the key of more values goes down
        assert fields[0].z.shape == (max(first, second), min(first, second))
        assert (panel.x.title, panel.y.title) == (("one.x", "two.y") if first < second else ("two.y", "one.x"))
        assert list(panel.x.ticks.values())[-1] == (f"a{first - 1}" if first < second else f"b{second - 1}")


def test_the_combinations_that_are_not_drawn_are_counted():
    summary = summary_of(0, rows=4, loop=False)
    for count, said in ((drawing.MOST_CELLS, ""), (drawing.MOST_CELLS + 1, " The first 40 of 41 combinations.")):
        cells = tuple(replace(summary.cells[0], values={"a.b": str(k)}) for k in range(count))
        (figure,) = drawing.grid(replace(summary, cells=cells))
        assert figure.caption.endswith(f"or of all values.{said}")
        assert marks(figure)[0].x.size == drawing.MOST_CELLS


def test_a_limit_that_no_combination_has_leaves_the_medians_of_the_first_outputs():
    summary = summary_of(1, grid=APERTURES, rows=16)
    names = [each.name for each in drawing._shown_cells(summary, summary.cells)]
    assert names == ["rows that miss a limit", "median margin", "median residual_quantile"]
    other = replace(summary, limits=(Limit("volume", 1.0, None, ""),))
    names = [each.name for each in drawing._shown_cells(other, summary.cells)]
    assert names == ["rows that miss a limit", "median margin", "median beacon_margin"]
    names = [each.name for each in drawing._shown_cells(replace(summary, limits=()), summary.cells)]
    assert names == ["median margin", "median beacon_margin", "median residual_quantile"]
    one = replace(summary, limits=(LIMITS[0], Limit("volume", 1.0, None, "")))
    missed, median = drawing._shown_cells(one, (summary.cells[0], replace(summary.cells[1], failed=16, outputs={})))
    assert median.name == "median margin"
    assert missed.of[0] == summary.cells[0].missed
    assert math.isnan(missed.of[1].value) and math.isnan(median.of[1].value)


def test_a_combination_without_a_median_has_its_mean_between_all_values():
    output = output_summary("margin", np.linspace(0.0, 1.0, 41))
    mean = replace(output.mean, value=0.4)
    no_median = replace(output, mean=mean, quantiles={0.01: output.quantiles[0.01]})
    for each in (no_median, replace(output, mean=mean, rows=0)):
        found = drawing._span(each)
        assert (found.value, found.low, found.high) == (0.4, 0.0, 1.0)
    known = {p: Interval(p, p, p, CONFIDENCE) for p in (0.003, 0.05, 0.5, 0.95, 0.999)}
    found = drawing._span(replace(output, mean=mean, quantiles=known))
    assert (found.value, found.low, found.high) == (0.5, 0.003, 0.999)
    blind = {**known, 0.003: UNKNOWN, 0.999: UNKNOWN, 0.95: UNKNOWN}
    found = drawing._span(replace(output, mean=mean, quantiles=blind))
    assert (found.value, found.low, found.high) == (0.5, 0.05, 1.0)


@pytest.mark.parametrize(("at", "drawn_at"), [(-1.0, [-1.0]), (-1.01, []), (2.0, [2.0]), (2.01, []), (0.5, [0.5])])
def test_a_row_for_each_combination_has_the_limits_that_are_near(at, drawn_at):
    panel = Panel(0, 0, x=Axis("x", low=0.0, high=1.0))
    summary = replace(summary_of(0, rows=4), limits=(Limit("margin", at, None, ""),))
    shown = drawing.Shown("median margin", campaign_numbers.Scale(1.0, "dB"), ())
    assert [rule.at for rule in drawing._limit_lines(panel, summary, shown)] == drawn_at
    assert drawing._limit_lines(panel, summary, shown._replace(name="median other")) == []


def test_a_field_of_a_map_is_dark_below_the_middle_and_its_number_is_white_there():
    field, *words = drawing._numbered(np.array([[1.0, 2.0, 3.0, math.nan]]))
    assert (field.low, field.high) == (1.0, 3.0)
    assert [word.text for word in words] == ["1", "2", "3", "none"]
    assert [word.colour for word in words] == [WHITE, BLACK, BLACK, BLACK]
    assert [(word.x, word.y) for word in words] == [(0, 0), (1, 0), (2, 0), (3, 0)]
    same, *words = drawing._numbered(np.array([[4.0]]))
    assert (same.low, same.high) == (4.0, 5.0)
    assert words[0].colour == WHITE
    none, *words = drawing._numbered(np.array([[math.nan]]))
    assert (none.low, none.high) == (0.0, 1.0)
    assert words[0].text == "none"
    _, large = drawing._numbered(np.array([[-1234.0]]))
    assert large.text == "\u22121230"


@pytest.mark.parametrize(("start", "rest", "cut"), [(3.0, 1.0, False), (3.1, 1.0, True), (5.0, 0.0, False)])
def test_the_begin_of_a_worst_row_is_cut_above_three_times_the_rest(start, rest, cut):
    error = np.full((40, 1), rest * 1e-6)
    error[1, 0] = -start * 1e-6
    trace = replace(trace_of(0), time_s=np.arange(40) * 1e-3, error_rad=error, drive_v=np.zeros((40, 1)))
    error[1], error[0] = 0.0, error[1].copy()
    figure = drawing.worst(summary_of(2, rows=4), trace, 1)
    assert ("cut off" in figure.caption) is cut
    assert figure.sheet.panels[0].y.high == (pytest.approx(1.1 * rest) if cut else None)


def test_the_worst_rows_are_counted_in_words_to_the_sixth():
    said = [drawing._rank(number) for number in (1, 2, 6, 7)]
    assert said == ["worst ", "second worst ", "sixth worst ", "7th worst "]


# ---------------------------------------------------------------------------------------------- the page's own choices
def test_the_page_of_a_grid_without_limits_has_one_table_of_combinations():
    summary = summary_of(2, grid={"mirror": ("a", "b")}, rows=16)
    for limits, tables in ((LIMITS, 2), ((), 1)):
        *_, view, detail = campaign_module._grid(replace(summary, limits=limits), summary.cells[0], ())
        assert view.title == "Every combination"
        assert len(view.blocks) == tables
        which = "of those that miss a limit least" if limits else "with results"
        assert detail == f"Below in detail: mirror = a, the first {which}."
    (view,) = campaign_module._grid(summary, None, ())
    assert len(view.blocks) == 2


def test_an_output_is_drawn_from_three_rows_on_that_differ():
    output = output_summary("margin", np.array([0.0, 0.3, 1.0]))
    assert campaign_module._spread(output)
    for other in (
        replace(output, rows=2, deviation=0.6),
        replace(output, most=output.least),
        replace(output, edges=output.edges[:2]),
        replace(output, counts=np.zeros(40)),
    ):
        assert not campaign_module._spread(other)


def test_no_region_is_drawn_where_no_input_differs():
    summary = summary_of(2, rows=64, shift_db=-0.6)
    assert len(campaign_module.region(summary)) == 1
    same = {key: np.full(64, 1.0) if key in INPUTS else column for key, column in summary.sample.items()}
    assert campaign_module.region(replace(summary, sample=same)) == ()
    kept = {key: column for key, column in summary.sample.items() if key != "communication.transmit_power"}
    (figure,) = campaign_module.region(replace(summary, sample=kept))
    assert next(iter(figure.columns)) == "communication.pointing_error"
    assert len(figure.columns) == 2


def test_the_region_is_of_the_limit_most_often_missed_and_of_the_cell_most_evenly_split():
    summary = summary_of(2, grid={"mirror": ("a", "b", "c")}, rows=16)
    shares = ((1.0, 0.2), (0.1, 0.7), (0.4, 0.9))
    names = ("margin", "residual_quantile")

    def split(*shares):
        cells = [
            replace(
                cell,
                missed=Interval(of[0], of[0], of[0], CONFIDENCE),
                missed_by={n: Interval(s, s, s, CONFIDENCE) for n, s in zip(names, of, strict=True)},
            )
            for cell, of in zip(summary.cells, shares, strict=True)
        ]
        limit, number = campaign_module._split(replace(summary, cells=tuple(cells))) or (None, None)
        return limit and limit.output, number

    assert split(*shares) == ("residual_quantile", 1)  # in the cell shown in detail
    assert split((0.0, 0.0), (0.1, 0.2), (0.9, 0.9)) in (("margin", 1), ("margin", 2), ("residual_quantile", 1))
    assert split((0.0, 0.0), (0.1, 0.4), (1.0, 0.8)) == ("residual_quantile", 1)
    assert split((0.0, 1.0), (1.0, 0.0), (0.0, 0.0)) == (None, None)


# ------------------------------------------------------------------------- inputs unlike each other, held as a whole
def between_ends(value, low=0.5, high=1.25):
    return Interval(value, value * low, value * high, 0.9)


def an_output(name="residual_quantile", unit="rad", scale=1e-6, **changes):
    """An output over 20 rows in four bins of unlike widths."""
    found = OutputSummary(
        name,
        unit,
        "what it is",
        20,
        between_ends(4.0 * scale),
        1.5 * scale,
        1.0 * scale,
        9.0 * scale,
        {
            0.01: between_ends(1.5 * scale),
            0.5: between_ends(3.0 * scale),
            0.997: Interval(8.0 * scale, 7.0 * scale, math.nan, 0.9),
            0.99: between_ends(7.5 * scale),
        },
        np.array([1.0, 2.0, 4.0, 8.0, 9.0]) * scale,
        np.array([2.0, 9.0, 6.0, 3.0]),
    )
    return replace(found, **changes)


def short_tail(**changes):
    found = Tail(
        np.array([1e-6, 2e-6, 3e-6, 4e-6]),
        np.array([0.5, 0.05, 0.002, 0.0]),
        np.array([0.4, 0.04, 0.0, 0.0]),
        np.array([0.6, 0.07, 0.01, 0.004]),
        {0.1: Interval(1.75e-6, 1.5e-6, 2e-6, 0.9), 1e-3: Interval(3.2e-6, 3e-6, math.nan, 0.9), 1e-6: NO_INTERVAL},
        0.9,
        "share of the time of 64 rows",
        3.2e7,
        {2.5e-6: Interval(0.01, 0.005, 0.025, 0.9)},
        {2.5e-6: 4e-8},
    )
    return replace(found, **changes)


NO_INTERVAL = Interval(math.nan, math.nan, math.nan, 0.9)


def a_cell(values=None, *, missed=0.25, rows=21, failed=1, tail=None, scale=1.0):
    outputs = {"residual_quantile": an_output(scale=scale * 1e-6), "margin": an_output("margin", "dB", scale)}
    by = {"residual_quantile": between_ends(missed), "margin": between_ends(missed / 5.0)}
    return CellSummary(values or {}, rows, failed, outputs, between_ends(missed), by, tail)


TWO_SIDES = (
    Limit("residual_quantile", None, 6e-6, "requirement.pointing_error"),
    Limit("margin", 0.5, 12.0, "requirement.margin"),
)


def a_campaign(cells, **changes):
    """Two inputs, of which the second is the weightier one for the first output, over two cells of six rows."""
    rows = {"cell": [0, 0, 0, 1, 1, 1], "row": [0, 1, 2, 0, 1, 2]}
    rows |= {"mirror.alpha": [0.01, 0.02, 0.03, 0.04, 0.05, 0.06], "jitter.rms": [1e-6, 2e-6, 4e-5, 5e-5, 6e-6, 7e-6]}
    rows |= {"residual_quantile": [5e-6, 7e-6, math.nan, 1e-6, 6e-6, 8e-6], "margin": [1.0, 0.0, 13.0, 2.0, 3.0, 4.0]}
    first = {"mirror.alpha": between_ends(0.25), "jitter.rms": between_ends(0.5)}
    total = {"mirror.alpha": between_ends(0.3), "jitter.rms": Interval(0.625, 0.6, 0.75, 0.9)}
    rank = {"mirror.alpha": Interval(-0.5, -0.625, -0.375, 0.9), "jitter.rms": between_ends(0.75, 0.5, 1.125)}
    given = {
        "name": "a.toml",
        "mission_name": "m",
        "hashes": {"campaign": "c", "mission": "d", "code": "e"},
        "seed": 77,
        "sampling": "lhs",
        "loop": "PI, 5 s",
        "inputs": (InputText("mirror.alpha", "", "normal"), InputText("jitter.rms", "rad", "uniform")),
        "fixed": {"link.range": "1 km", "b.c": "2"},
        "limits": TWO_SIDES,
        "cells": tuple(cells),
        "sensitivities": (
            Sensitivity("residual_quantile", 40, first, total, rank, 0.95, "a note"),
            Sensitivity("margin", 30, {"mirror.alpha": between_ends(0.7, -0.5, 1.5)}, {}, {}, math.nan, ""),
        ),
        "sample": {key: np.array(column, dtype=np.float64) for key, column in rows.items()},
        "worst": (),
        "failed": ((1, Failed(2, 99, 3, "a reason")), (0, Failed(7, 98, 1, "another"))),
        "progress": Progress(41, 64, 20.0, 2.05, 300.0, "running"),
        "warnings": ("a warning",),
        "findings": ("found",),
    }
    return CampaignSummary(**given | changes)


def two_cells(**changes):
    worse = a_cell({"mirror": "b.toml", "aperture": "6 cm"}, missed=0.75, rows=24, failed=0, scale=2.0)
    better = a_cell({"mirror": "a.toml", "aperture": "5 cm"}, tail=short_tail())
    return a_campaign([worse, better], **changes)


def test_a_distribution_in_unlike_bins_has_its_quantiles_and_both_limits():
    limit = Limit("residual_quantile", 1.5e-6, 6.5e-6, "a")
    assert figure_of(drawing.distribution(an_output(), limit)) == [
        "campaign-residual_quantile",
        "Distribution of residual_quantile",
        "What it is: share of the rows in each bin, and quantiles over them.",
        {
            "residual_quantile, lower edge (rad)": [1e-06, 2e-06, 4e-06, 8e-06],
            "residual_quantile, upper edge (rad)": [2e-06, 4e-06, 8e-06, 9e-06],
            "rows (%)": [10.0, 45.0, 30.0, 15.0],
        },
        "Sheet width=7.6 height=2.3 legend=<place=upper right>",
        "Panel 0 0 x=<title=residual_quantile (µrad)> y=<title=rows (%) low=0>",
        "Bars at=[1.5 3 6 8.5] start=[0 0 0 0] end=[10 45 30 15] breadth=[1 2 4 1] colour=#56B4E9",
        "  upright=True",
        "Line x=[1 1 2 2 4 4 8 8 9 9] y=[0 10 10 45 45 30 30 15 15 0] colour=#0072B2 width=0.8",
        "Rule at=1.5 upright=True colour=#009E73 dash=-- width=1.1 label=1 %: 1.50 µrad",
        "Rule at=3 upright=True width=1.1 label=50 %: 3.00 µrad",
        "Rule at=7.5 upright=True colour=#E69F00 dash=-. width=1.1 label=99 %: 7.50 µrad",
        "Rule at=1.5 upright=True colour=#D55E00 dash=[5 2] width=1.4 label=limit ≥ 1.5 µrad",
        "Span low=-inf high=1.5 upright=True colour=#D55E00 opacity=0.1",
        "Rule at=6.5 upright=True colour=#D55E00 dash=[5 2] width=1.4 label=limit ≤ 6.5 µrad",
        "Span low=6.5 high=inf upright=True colour=#D55E00 opacity=0.1",
    ]


def test_a_tail_beside_another_has_its_band_radii_and_limit():
    summary = two_cells()
    other = replace(summary.cells[0], tail=short_tail(survival=np.array([0.6, 0.0, 0.0, 0.0])))
    (found,) = drawing.tail(replace(summary, cells=(other, summary.cells[1])), summary.cells[1])
    assert figure_of(found) == [
        "campaign-tail",
        "Tail of the radial error",
        (
            "Probability that the radial error of mirror = a.toml, aperture = 5 cm exceeds a "
            "radius. It comes from the share of the time of 64 rows. It knows 0.1 % as well as "
            "32 million independent samples of the error would. Shaded: its interval at 90 %."
        ),
        {
            "radius (rad)": [1e-06, 2e-06, 3e-06, 4e-06],
            "probability": [0.5, 0.05, 0.002, 0.0],
            "lower end": [0.4, 0.04, 0.0, 0.0],
            "upper end": [0.6, 0.07, 0.01, 0.004],
        },
        "Sheet width=7.6 height=3.8 legend=<place=upper right>",
        ("Panel 0 0 x=<title=radial error (µrad) low=0> y=<title=probability of a larger one log=True"),
        "  low=5.01187e-07 high=1>",
        "Line x=[1] y=[0.6] colour=#777777 width=0.7 label=other combinations",
        ("Area rings=[[[1 0.4] [2 0.04] [3 1e-300] [3 0.01] [2 0.07] [1 0.6]]] colour=#56B4E9 opacity=0.5"),
        "Line x=[1 2 3] y=[0.5 0.05 0.002] colour=#0072B2 label=mirror = a.toml, aperture = 5 cm",
        ("Line x=[1.75] y=[0.1] colour=#D55E00 dash= label=10 %: 1.75 µrad marker=o x_arms=[[0.25] [0.25]]"),
        ("Line x=[3.2] y=[0.001] colour=#009E73 dash= label=0.1 %: 3.20 µrad marker=s x_arms=[[0.2] [0]]"),
        "Rule at=6 upright=True colour=#D55E00 dash=[5 2] width=1.4 label=limit ≤ 6 µrad",
    ]


def test_indices_of_two_outputs_stand_in_the_order_of_the_largest_of_either():
    (figure,) = drawing.sensitivity(two_cells())
    assert figure_of(figure) == [
        "campaign-sensitivity-1",
        "What matters to residual_quantile, margin",
        (
            "Sobol indices of mirror = b.toml, aperture = 6 cm from 30 rows: the share of an "
            "output's variance that an input makes by itself (first order), and with all its "
            "interactions (total); with intervals. residual_quantile: a note."
        ),
        {
            "residual_quantile, mirror.alpha, first index": [0.25, 0.125, 0.3125],
            "residual_quantile, jitter.rms, first index": [0.5, 0.25, 0.625],
            "residual_quantile, mirror.alpha, total index": [0.3, 0.15, 0.375],
            "residual_quantile, jitter.rms, total index": [0.625, 0.6, 0.75],
            "margin, mirror.alpha, first index": [0.7, -0.35, 1.05],
        },
        "Sheet width=7.6 height=1.92 widths=[1 1] share_y=True legend=<place=above columns=2>",
        "Panel 0 0 x=<title=index low=0 high=1.05 ticks=[0 0.5 1]> y=<low=1.6 high=-0.6 ticks={0:",
        "  mirror.alpha, 1: jitter.rms} grid=False size=8> title=residual_quantile",
        ("Bars at=[-0.19 0.81] start=[0 0] end=[0.25 0.5] breadth=[0.38 0.38] colour=#0072B2 label=first"),
        "  order",
        ("Line x=[0.25 0.5] y=[-0.19 0.81] dash= label=first order marker=. size=1 x_arms=[[0.125 0.25]"),
        "  [0.0625 0.125]]",
        ("Bars at=[0.19 1.19] start=[0 0] end=[0.3 0.625] breadth=[0.38 0.38] colour=#E69F00 label=total"),
        ("Line x=[0.3 0.625] y=[0.19 1.19] dash= label=total marker=. size=1 x_arms=[[0.15 0.025] [0.075"),
        "  0.125]]",
        "Panel 0 1 x=<title=index low=0 high=1.05 ticks=[0 0.5 1]> y=<low=1.6 high=-0.6 ticks={0:",
        "  mirror.alpha, 1: jitter.rms} grid=False size=8> title=margin",
        "Bars at=[0] start=[0] end=[0.7] breadth=[0.76] colour=#0072B2 label=first order",
        "Line x=[0.7] y=[0] dash= label=first order marker=. size=1 x_arms=[[0.7] [0.35]]",
    ]


@pytest.mark.parametrize("number", [0, 1])
def test_a_region_has_the_rows_of_its_own_combination(number):
    figure = drawing.region(two_cells(), TWO_SIDES[1], number, ["jitter.rms", "mirror.alpha"], " A note.")
    assert plain(figure.columns["margin"]) == ([1.0, 0.0, 13.0], [2.0, 3.0, 4.0])[number]
    assert figure.caption.startswith(f"3 rows of {('mirror = b.toml', 'mirror = a.toml')[number]}")
    assert figure.caption.endswith(("15 % miss it. A note.", "5 % miss it. A note.")[number])


def test_a_region_over_one_input_has_its_output_limits_and_rows_of_three_kinds():
    figure = drawing.region(two_cells(), TWO_SIDES[0], 0, ["jitter.rms"])
    assert figure_of(figure) == [
        "campaign-region",
        "Where residual_quantile misses its limit",
        (
            "3 rows of mirror = b.toml, aperture = 6 cm: those that keep residual_quantile ≤ 6 "
            "µrad and those that miss it, over jitter.rms, the input that matters most to it. "
            "Of all rows 75 % miss it."
        ),
        {"jitter.rms": [1e-06, 2e-06, 4e-05], "residual_quantile": [5e-06, 7e-06, "nan"]},
        "Sheet width=7.6 height=4 legend=<place=upper right>",
        "Panel 0 0 x=<title=jitter.rms (µrad) log=True> y=<title=residual_quantile (µrad)>",
        "Line x=[1] y=[5] colour=#0072B2 dash= label=kept marker=o size=3",
        "Line x=[2] y=[7] colour=#D55E00 dash= label=missed marker=x size=4.7",
        "Rule at=6 upright=False colour=#D55E00 dash=[5 2] width=1.4 label=limit ≤ 6 µrad",
    ]


def test_a_region_over_two_inputs_has_rows_beyond_either_side():
    figure = drawing.region(two_cells(), TWO_SIDES[1], 0, ["jitter.rms", "mirror.alpha"], " A note.")
    assert figure_of(figure) == [
        "campaign-region",
        "Where margin misses its limit",
        (
            "3 rows of mirror = b.toml, aperture = 6 cm: those that keep margin ≥ 0.50 dB and "
            "≤ 12.00 dB and those that miss it, over jitter.rms and mirror.alpha. Of all rows "
            "15 % miss it. A note."
        ),
        {"jitter.rms": [1e-06, 2e-06, 4e-05], "mirror.alpha": [0.01, 0.02, 0.03], "margin": [1.0, 0.0, 13.0]},
        "Sheet width=7.6 height=4 legend=<place=upper right>",
        "Panel 0 0 x=<title=jitter.rms (µrad) log=True> y=<title=mirror.alpha>",
        "Line x=[1] y=[0.01] colour=#0072B2 dash= label=kept marker=o size=3",
        "Line x=[2 40] y=[0.02 0.03] colour=#D55E00 dash= label=missed marker=x size=4.7",
    ]


def test_a_grid_in_rows_has_each_combinations_share_and_medians():
    cells = [replace(cell, values={"mirror": cell.values["mirror"]}) for cell in two_cells().cells]
    (figure,) = drawing.grid(a_campaign(cells))
    assert figure_of(figure) == [
        "campaign-grid",
        "Over the grid",
        (
            "Over mirror: rows that miss a limit, median residual_quantile, median margin; "
            "bars: intervals of a share, else from the known quantiles nearest to 1 % and 99 "
            "%, or of all values."
        ),
        {
            "rows that miss a limit, value": [0.75, 0.25],
            "rows that miss a limit, low": [0.375, 0.125],
            "rows that miss a limit, high": [0.9375, 0.3125],
            "median residual_quantile, value": [6e-06, 3e-06],
            "median residual_quantile, low": [3e-06, 1.5e-06],
            "median residual_quantile, high": [1.5e-05, 7.5e-06],
            "median margin, value": [6.0, 3.0],
            "median margin, low": [3.0, 1.5],
            "median margin, high": [15.0, 7.5],
        },
        ("Sheet width=7.6 height=1.48 widths=[1 1 1] share_y=True heading=mirror heading_at_left=True"),
        ("Panel 0 0 x=<title=rows that miss a limit (%)> y=<low=1.6 high=-0.6 ticks={0: b.toml, 1: a.toml}"),
        "  size=8>",
        ("Line x=[75 25] y=[0 1] colour=#0072B2 dash= marker=o size=4.5 x_arms=[[37.5 12.5] [18.75 6.25]]"),
        ("Panel 0 1 x=<title=median residual_quantile (µrad)> y=<low=1.6 high=-0.6 ticks={0: b.toml, 1:"),
        "  a.toml} size=8>",
        "Line x=[6 3] y=[0 1] colour=#0072B2 dash= marker=o size=4.5 x_arms=[[3 1.5] [9 4.5]]",
        "Rule at=6 upright=True colour=#D55E00 dash=[5 2] width=1.4",
        ("Panel 0 2 x=<title=median margin (dB)> y=<low=1.6 high=-0.6 ticks={0: b.toml, 1: a.toml} size=8>"),
        "Line x=[6 3] y=[0 1] colour=#0072B2 dash= marker=o size=4.5 x_arms=[[3 1.5] [9 4.5]]",
        "Rule at=0.5 upright=True colour=#D55E00 dash=[5 2] width=1.4",
        "Rule at=12 upright=True colour=#D55E00 dash=[5 2] width=1.4",
    ]


def test_a_grid_as_maps_has_each_number_in_its_own_field():
    levels = [("x", "1"), ("x", "2"), ("x", "3"), ("y", "1"), ("y", "2"), ("y", "3")]
    values = [dict(zip(("one.a", "two.b"), at, strict=True)) for at in levels]
    cells = [a_cell(at, missed=0.1 * (k + 1), scale=1.0 + k) for k, at in enumerate(values)]
    cells[4] = replace(cells[4], rows=1)
    (figure,) = drawing.grid(a_campaign(cells))
    assert figure_of(figure) == [
        "campaign-grid",
        "Over the grid",
        ("Over one.a and two.b: rows that miss a limit, median residual_quantile; a number in each field."),
        {
            "rows that miss a limit, value": [0.1, 0.2, 0.3, 0.4, "nan", 0.6],
            "rows that miss a limit, low": [0.05, 0.1, 0.15, 0.2, "nan", 0.3],
            "rows that miss a limit, high": [0.125, 0.25, 0.375, 0.5, "nan", 0.75],
            "median residual_quantile, value": [3e-06, 6e-06, 9e-06, 1.2e-05, 1.5e-05, 1.8e-05],
            "median residual_quantile, low": [1.5e-06, 3e-06, 4.5e-06, 6e-06, 7.5e-06, 9e-06],
            "median residual_quantile, high": [7.5e-06, 1.5e-05, 2.25e-05, 3e-05, 3.75e-05, 4.5e-05],
            "median margin, value": [3.0, 6.0, 9.0, 12.0, 15.0, 18.0],
            "median margin, low": [1.5, 3.0, 4.5, 6.0, 7.5, 9.0],
            "median margin, high": [7.5, 15.0, 22.5, 30.0, 37.5, 45.0],
        },
        "Sheet width=7.6 height=2.16 widths=[1 1] share_y=True",
        ("Panel 0 0 x=<title=one.a ticks={0: x, 1: y} grid=False size=8> y=<title=two.b low=2.5 high=-0.5"),
        ("  ticks={0: 1, 1: 2, 2: 3} grid=False size=8> title=rows that miss a limit (%) face=#dddddd"),
        "Field x=[0 1] y=[0 1 2] z=[[10 40] [20 nan] [30 60]] low=10 high=60",
        "Words text=10 x=0 y=0 colour=#ffffff anchor=middle",
        "Words text=40 x=1 y=0 anchor=middle",
        "Words text=20 x=0 y=1 colour=#ffffff anchor=middle",
        "Words text=none x=1 y=1 anchor=middle",
        "Words text=30 x=0 y=2 colour=#ffffff anchor=middle",
        "Words text=60 x=1 y=2 anchor=middle",
        ("Panel 0 1 x=<title=one.a ticks={0: x, 1: y} grid=False size=8> y=<low=2.5 high=-0.5 ticks={0: 1,"),
        "  1: 2, 2: 3} grid=False size=8> title=median residual_quantile (µrad) face=#dddddd",
        "Field x=[0 1] y=[0 1 2] z=[[3 12] [6 15] [9 18]] low=3 high=18",
        "Words text=3 x=0 y=0 colour=#ffffff anchor=middle",
        "Words text=12 x=1 y=0 anchor=middle",
        "Words text=6 x=0 y=1 colour=#ffffff anchor=middle",
        "Words text=15 x=1 y=1 anchor=middle",
        "Words text=9 x=0 y=2 colour=#ffffff anchor=middle",
        "Words text=18 x=1 y=2 anchor=middle",
    ]


@pytest.mark.parametrize("axes", [1, 2])
def test_a_worst_row_has_its_radial_error_and_each_drive(axes):
    error = np.array([[30e-6, 40e-6], [3e-6, -4e-6], [-6e-6, 8e-6]])
    drive = np.array([[1.0, -2.0], [3.0, 5.0], [7.0, 4.0]])
    trace = WorstTrace(1, 17, "residual_quantile", 9.5e-6, np.array([0.0, 0.5, 1.0]), error[:, :axes], drive[:, :axes])
    figure = drawing.worst(two_cells(), trace, 2)
    assert (figure.name, figure.title) == ("campaign-worst-2-2", "Second worst row in time")
    radial = plain(figure.columns["radial error (rad)"])
    assert radial == ([3e-5, 3e-6, 6e-6], [5e-5, 5e-6, 1e-5])[axes - 1]
    drawn_, *below = [plain(mark.y) for panel in figure.sheet.panels for mark in panel.marks]
    assert drawn_ == [plain(1e6 * each) for each in radial] and below == [[1.0, 3.0, 7.0], [-2.0, 5.0, 4.0]][:axes]
    assert figure.caption == (
        "Row 17 of mirror = a.toml, aperture = 5 cm: of its rows the second worst in residual_quantile, 9.50 µrad. "
        "Shown is the first run of the row's."
    )


def test_the_tables_of_two_combinations_have_each_ones_own_numbers():
    summary = two_cells()
    cell, t = summary.cells[1], campaign_tables
    found = [
        t.limit_table(summary, cell),
        t.output_table(cell, 3, intervals=True),
        t.meanings_table(cell),
        t.cell_table(summary, summary.cells),
        t.limited_table(summary, summary.cells),
        t.tail_table(cell.tail),
        t.index_table(summary.sensitivities),
        t.failed_table(summary, 2),
    ]
    assert plain([[each.headings, each.rows] for each in found]) == [
        [
            ["limit", "missed by", "90 % interval", "from"],
            [
                ["residual_quantile ≤ 6 µrad", "25 %", "12.5 % to 31.2 %", "requirement.pointing_error"],
                ["margin ≥ 0.50 dB and ≤ 12.00 dB", "5 %", "2.5 % to 6.25 %", "requirement.margin"],
            ],
        ],
        [
            ["output", "mean", "deviation", "1 %", "50 %", "99 %"],
            [
                [
                    "residual_quantile",
                    "4.00 µrad",
                    "1.50 µrad",
                    "1.50 µrad\n750 nrad to 1.88 µrad",
                    "3.00 µrad\n1.50 µrad to 3.75 µrad",
                    "7.50 µrad\n3.75 µrad to 9.38 µrad",
                ],
                [
                    "margin",
                    "4.00 dB",
                    "1.50 dB",
                    "1.50 dB\n0.75 dB to 1.88 dB",
                    "3.00 dB\n1.50 dB to 3.75 dB",
                    "7.50 dB\n3.75 dB to 9.38 dB",
                ],
            ],
        ],
        [["output", "meaning"], [["residual_quantile", "what it is"], ["margin", "what it is"]]],
        [
            ["mirror", "aperture", "keep all", "rows", "failed"],
            [
                ["b.toml", "6 cm", "25 % (6.25 % to 62.5 %)", "24", "0"],
                ["a.toml", "5 cm", "75 % (68.8 % to 87.5 %)", "20", "1"],
            ],
        ],
        [
            ["mirror", "aperture", "mean residual_quantile", "miss residual_quantile", "mean margin", "miss margin"],
            [
                ["b.toml", "6 cm", "8.00 µrad", "75 %", "8.00 dB", "15 %"],
                ["a.toml", "5 cm", "4.00 µrad", "25 %", "4.00 dB", "5 %"],
            ],
        ],
        [
            ["probability", "radial error", "90 % interval"],
            [
                ["10 %", "1.75 µrad", "1.50 µrad to 2.00 µrad"],
                ["0.1 %", "3.20 µrad", "at least 3.00 µrad"],
                ["10⁻⁶", "not known", ""],
            ],
        ],
        [
            ["output", "input", "first order", "total", "rank correlation"],
            [
                [
                    "residual_quantile",
                    "jitter.rms",
                    "0.50 (0.25 to 0.62)",
                    "0.62 (0.60 to 0.75)",
                    "0.75 (0.38 to 0.84)",
                ],
                [
                    "residual_quantile",
                    "mirror.alpha",
                    "0.25 (0.12 to 0.31)",
                    "0.30 (0.15 to 0.38)",
                    "−0.50 (−0.62 to −0.38)",
                ],
                ["margin", "mirror.alpha", "0.70 (−0.35 to 1.05)", "", ""],
            ],
        ],
        [
            ["row", "seed", "tries", "reason"],
            [
                ["2 of mirror = a.toml, aperture = 5 cm", "99", "3", "a reason"],
                ["7 of mirror = b.toml, aperture = 6 cm", "98", "1", "another"],
            ],
        ],
    ]


def test_all_sentences_of_two_combinations():
    summary = two_cells()
    w = campaign_words
    assert [
        w.verdict(summary),
        w.headline(summary),
        *w.answers(summary, summary.cells[1]),
        w.tail_method(summary.cells[1].tail),
        w.progress_words(summary),
        *w.setting(summary),
        *w.few_values(summary.cells[1]),
    ] == [
        "open",
        (
            "So far: 1 of 45 rows failed; of 2 combinations, mirror = a.toml, aperture = 5 cm "
            "keeps both limits most often, in 75 % (68.8 % to 87.5 %) of its rows; mirror = "
            "b.toml, aperture = 6 cm least often, in 25 % (6.25 % to 62.5 %) (intervals at 90 "
            "%)."
        ),
        (
            "What matters most to residual_quantile (total Sobol index): jitter.rms 0.62 (0.60 "
            "to 0.75), mirror.alpha 0.30 (0.15 to 0.38); a note."
        ),
        "What matters most to margin (first-order Sobol index): mirror.alpha 0.70 (−0.35 to 1.05).",
        ("The radial error exceeds 3.20 µrad with probability 0.1 % (at least 3.00 µrad at 90 % confidence)."),
        (
            "The radial error is beyond 2.5 µrad with probability 1 % (0.5 % to 2.5 % at 90 % "
            "confidence). The variance of that estimate is 4e-08, that of 250000 draws "
            "without importance sampling."
        ),
        "No radial error beyond 6 µrad was seen (0 % to 0.4 % at 90 % confidence).",
        (
            "It comes from the share of the time of 64 rows. It knows 0.1 % as well as 32 "
            "million independent samples of the error would."
        ),
        "Running: 41 of 64 rows, 2.05 rows a second, 5 min left.",
        "Sampling lhs, 2 drawn inputs, seed 77.",
        "Loop: PI, 5 s.",
        "Set: link.range = 1 km, b.c = 2.",
    ]


def test_the_data_of_two_combinations_have_every_number_under_its_own_name():
    assert plain(campaign_data(two_cells())) == {
        "name": "a.toml",
        "mission": "m",
        "verdict": (
            "So far: 1 of 45 rows failed; of 2 combinations, mirror = a.toml, aperture = 5 cm "
            "keeps both limits most often, in 75 % (68.8 % to 87.5 %) of its rows; mirror = "
            "b.toml, aperture = 6 cm least often, in 25 % (6.25 % to 62.5 %) (intervals at 90 "
            "%)."
        ),
        "findings": ["found"],
        "hashes": {"campaign": "c", "mission": "d", "code": "e"},
        "seed": 77,
        "sampling": "lhs",
        "loop": "PI, 5 s",
        "inputs": [
            {"key": "mirror.alpha", "unit": "", "distribution": "normal"},
            {"key": "jitter.rms", "unit": "rad", "distribution": "uniform"},
        ],
        "set": {"link.range": "1 km", "b.c": "2"},
        "limits": [
            {
                "output": "residual_quantile",
                "least": None,
                "most": 6e-06,
                "source": "requirement.pointing_error",
                "unit": "rad",
            },
            {"output": "margin", "least": 0.5, "most": 12.0, "source": "requirement.margin", "unit": "dB"},
        ],
        "cells": [
            {
                "values": {"mirror": "b.toml", "aperture": "6 cm"},
                "rows": 24,
                "failed": 0,
                "missed": {"value": 0.75, "low": 0.375, "high": 0.9375, "confidence": 0.9},
                "missed_by": {
                    "residual_quantile": {"value": 0.75, "low": 0.375, "high": 0.9375, "confidence": 0.9},
                    "margin": {"value": 0.15, "low": 0.075, "high": 0.1875, "confidence": 0.9},
                },
                "outputs": [
                    {
                        "name": "residual_quantile",
                        "unit": "rad",
                        "meaning": "what it is",
                        "rows": 20,
                        "deviation": 3e-06,
                        "least": 2e-06,
                        "most": 1.8e-05,
                        "mean": {"value": 8e-06, "low": 4e-06, "high": 1e-05, "confidence": 0.9},
                        "quantiles": [
                            {"probability": 0.01, "value": 3e-06, "low": 1.5e-06, "high": 3.75e-06, "confidence": 0.9},
                            {"probability": 0.5, "value": 6e-06, "low": 3e-06, "high": 7.5e-06, "confidence": 0.9},
                            {"probability": 0.997, "value": 1.6e-05, "low": 1.4e-05, "high": "nan", "confidence": 0.9},
                            {
                                "probability": 0.99,
                                "value": 1.5e-05,
                                "low": 7.5e-06,
                                "high": 1.875e-05,
                                "confidence": 0.9,
                            },
                        ],
                        "edges": [2e-06, 4e-06, 8e-06, 1.6e-05, 1.8e-05],
                        "counts": [2.0, 9.0, 6.0, 3.0],
                    },
                    {
                        "name": "margin",
                        "unit": "dB",
                        "meaning": "what it is",
                        "rows": 20,
                        "deviation": 3.0,
                        "least": 2.0,
                        "most": 18.0,
                        "mean": {"value": 8.0, "low": 4.0, "high": 10.0, "confidence": 0.9},
                        "quantiles": [
                            {"probability": 0.01, "value": 3.0, "low": 1.5, "high": 3.75, "confidence": 0.9},
                            {"probability": 0.5, "value": 6.0, "low": 3.0, "high": 7.5, "confidence": 0.9},
                            {"probability": 0.997, "value": 16.0, "low": 14.0, "high": "nan", "confidence": 0.9},
                            {"probability": 0.99, "value": 15.0, "low": 7.5, "high": 18.75, "confidence": 0.9},
                        ],
                        "edges": [2.0, 4.0, 8.0, 16.0, 18.0],
                        "counts": [2.0, 9.0, 6.0, 3.0],
                    },
                ],
                "tail": None,
            },
            {
                "values": {"mirror": "a.toml", "aperture": "5 cm"},
                "rows": 20,
                "failed": 1,
                "missed": {"value": 0.25, "low": 0.125, "high": 0.3125, "confidence": 0.9},
                "missed_by": {
                    "residual_quantile": {"value": 0.25, "low": 0.125, "high": 0.3125, "confidence": 0.9},
                    "margin": {"value": 0.05, "low": 0.025, "high": 0.0625, "confidence": 0.9},
                },
                "outputs": [
                    {
                        "name": "residual_quantile",
                        "unit": "rad",
                        "meaning": "what it is",
                        "rows": 20,
                        "deviation": 1.5e-06,
                        "least": 1e-06,
                        "most": 9e-06,
                        "mean": {"value": 4e-06, "low": 2e-06, "high": 5e-06, "confidence": 0.9},
                        "quantiles": [
                            {
                                "probability": 0.01,
                                "value": 1.5e-06,
                                "low": 7.5e-07,
                                "high": 1.875e-06,
                                "confidence": 0.9,
                            },
                            {"probability": 0.5, "value": 3e-06, "low": 1.5e-06, "high": 3.75e-06, "confidence": 0.9},
                            {"probability": 0.997, "value": 8e-06, "low": 7e-06, "high": "nan", "confidence": 0.9},
                            {
                                "probability": 0.99,
                                "value": 7.5e-06,
                                "low": 3.75e-06,
                                "high": 9.375e-06,
                                "confidence": 0.9,
                            },
                        ],
                        "edges": [1e-06, 2e-06, 4e-06, 8e-06, 9e-06],
                        "counts": [2.0, 9.0, 6.0, 3.0],
                    },
                    {
                        "name": "margin",
                        "unit": "dB",
                        "meaning": "what it is",
                        "rows": 20,
                        "deviation": 1.5,
                        "least": 1.0,
                        "most": 9.0,
                        "mean": {"value": 4.0, "low": 2.0, "high": 5.0, "confidence": 0.9},
                        "quantiles": [
                            {"probability": 0.01, "value": 1.5, "low": 0.75, "high": 1.875, "confidence": 0.9},
                            {"probability": 0.5, "value": 3.0, "low": 1.5, "high": 3.75, "confidence": 0.9},
                            {"probability": 0.997, "value": 8.0, "low": 7.0, "high": "nan", "confidence": 0.9},
                            {"probability": 0.99, "value": 7.5, "low": 3.75, "high": 9.375, "confidence": 0.9},
                        ],
                        "edges": [1.0, 2.0, 4.0, 8.0, 9.0],
                        "counts": [2.0, 9.0, 6.0, 3.0],
                    },
                ],
                "tail": {
                    "radius_rad": [1e-06, 2e-06, 3e-06, 4e-06],
                    "survival": [0.5, 0.05, 0.002, 0.0],
                    "low": [0.4, 0.04, 0.0, 0.0],
                    "high": [0.6, 0.07, 0.01, 0.004],
                    "wanted": [
                        {
                            "probability": 0.1,
                            "unit": "rad",
                            "value": 1.75e-06,
                            "low": 1.5e-06,
                            "high": 2e-06,
                            "confidence": 0.9,
                        },
                        {
                            "probability": 0.001,
                            "unit": "rad",
                            "value": 3.2e-06,
                            "low": 3e-06,
                            "high": "nan",
                            "confidence": 0.9,
                        },
                        {
                            "probability": 1e-06,
                            "unit": "rad",
                            "value": "nan",
                            "low": "nan",
                            "high": "nan",
                            "confidence": 0.9,
                        },
                    ],
                    "beyond": [
                        {
                            "error_rad": 2.5e-06,
                            "value": 0.01,
                            "low": 0.005,
                            "high": 0.025,
                            "confidence": 0.9,
                            "variance": 4e-08,
                        }
                    ],
                    "confidence": 0.9,
                    "method": "share of the time of 64 rows",
                    "effective_runs": 32000000.0,
                },
            },
        ],
        "sensitivities": [
            {
                "output": "residual_quantile",
                "rows": 40,
                "first": {
                    "mirror.alpha": {"value": 0.25, "low": 0.125, "high": 0.3125, "confidence": 0.9},
                    "jitter.rms": {"value": 0.5, "low": 0.25, "high": 0.625, "confidence": 0.9},
                },
                "total": {
                    "mirror.alpha": {"value": 0.3, "low": 0.15, "high": 0.375, "confidence": 0.9},
                    "jitter.rms": {"value": 0.625, "low": 0.6, "high": 0.75, "confidence": 0.9},
                },
                "rank_correlation": {
                    "mirror.alpha": {"value": -0.5, "low": -0.625, "high": -0.375, "confidence": 0.9},
                    "jitter.rms": {"value": 0.75, "low": 0.375, "high": 0.84375, "confidence": 0.9},
                },
                "surrogate_q2": 0.95,
                "note": "a note",
            },
            {
                "output": "margin",
                "rows": 30,
                "first": {"mirror.alpha": {"value": 0.7, "low": -0.35, "high": 1.05, "confidence": 0.9}},
                "total": {},
                "rank_correlation": {},
                "surrogate_q2": "nan",
                "note": "",
            },
        ],
        "worst": [],
        "failed": [
            {"cell": 1, "row": 2, "seed": 99, "attempts": 3, "reason": "a reason"},
            {"cell": 0, "row": 7, "seed": 98, "attempts": 1, "reason": "another"},
        ],
        "progress": {
            "rows_done": 41,
            "rows_total": 64,
            "seconds": 20.0,
            "rows_per_s": 2.05,
            "left_s": 300.0,
            "state": "running",
        },
        "warnings": ["a warning"],
    }


# ------------------------------------------------------------------------------------------------- an optimum, whole
def kept_of(output, wanted, value, share, holds, agrees):
    ends = Interval(share, share - 0.05, min(share + 0.025, 1.0), 0.95)
    return SimpleNamespace(
        limit=SimpleNamespace(output=output),
        wanted=wanted,
        value=value,
        share=ends,
        holds=holds,
        agrees=lambda confidence: agrees,
    )


def an_optimum(**changes):
    """Two variables, an output as cost, two limits; fresh rows miss one of them, within its interval."""
    problem = SimpleNamespace(
        minimise="-margin",
        cost_name="margin",
        cost_unit="dB",
        confidence=0.9,
        limits=(1, 2),
        variables=(
            SimpleNamespace(key="a.power", low=1.0, high=9.0, unit="W"),
            SimpleNamespace(key="b.rate", low=2e3, high=5e5, unit="Hz"),
        ),
    )
    first, second = ("margin", "margin >= 3 dB"), ("residual_quantile", "residual_quantile <= 9 urad")
    best = SimpleNamespace(
        cost=4.25,
        values={"a.power": 2.5, "b.rate": 4e4},
        kept=(kept_of(*first, 3.5, 0.975, True, True), kept_of(*second, 8e-6, 0.925, True, True)),
    )
    fresh = SimpleNamespace(
        cost=4.125,
        refused="",
        kept=(kept_of(*first, 2.875, 0.875, False, True), kept_of(*second, math.nan, 0.95, True, True)),
    )
    given = {
        "problem": problem,
        "best": best,
        "fresh": fresh,
        "feasible": True,
        "confirmed": True,
        "reason": "",
        "bound_by": ("a.power", "the limit of margin"),
        "evaluations": 77,
        "refused": 3,
        "warnings": ("one", "two"),
    }
    return SimpleNamespace(**given | changes)


def test_an_optimum_is_told_with_variables_costs_limits_and_what_binds_it():
    assert optimum_report.optimum_text(an_optimum()).split("\n") == [
        ("largest margin (mean over the rows): 4.25 dB, with each limit kept by at least 90 % of the searched rows"),
        (
            "Fresh rows keep margin ≥ 3 dB in 87.5 % (82.5 to 90 %), below 90 %: this agrees "
            "within its interval; for slack draw more rows (optimise.rows) or ask for a larger "
            "share (optimise.confidence)."
        ),
        "",
        "variable  value   searched range",
        "a.power   2.5 W   1 W to 9 W",
        "b.rate    40 kHz  2 kHz to 500 kHz",
        "",
        "margin (mean over the rows): 4.25 dB of the searched rows, 4.12 dB of fresh rows",
        "",
        ("limit                       rows      value in the deciding row  share that keeps it  95 % interval"),
        ("margin ≥ 3 dB               searched  3.50 dB                    97.5 %               92.5 to 100 %"),
        ("residual_quantile ≤ 9 urad  searched  8 µrad                     92.5 %               87.5 to 95 %"),
        ("margin ≥ 3 dB               fresh     2.88 dB                    87.5 %               82.5 to 90 %"),
        ("residual_quantile ≤ 9 urad  fresh     failed                     95 %                 90 to 97.5 %"),
        "deciding row: no row is worse but the 10 % that may miss the limit.",
        "90 % (optimise.confidence) is the share of the rows that is to keep each limit.",
        "",
        "Bound by: a.power, the limit of margin",
        "",
        "77 candidates, 3 of them no mission",
        "warning: one",
        "warning: two",
    ]


def test_an_optimum_that_is_none_or_not_confirmed_says_so():
    of = an_optimum(feasible=False, reason="no row keeps both", fresh=None, bound_by=(), refused=0, warnings=())
    assert optimum_report.optimum_text(of).split("\n")[:9] == [
        "NO DESIGN KEEPS THE LIMITS: no row keeps both",
        "",
        "The best of the designs tried:",
        "",
        "variable  value   searched range",
        "a.power   2.5 W   1 W to 9 W",
        "b.rate    40 kHz  2 kHz to 500 kHz",
        "",
        "margin (mean over the rows): 4.25 dB of the searched rows",
    ]
    alone = an_optimum(confirmed=False)
    alone.fresh.kept[0].agrees = lambda confidence: False
    alone.problem.minimise = alone.problem.cost_name = "b.rate"
    alone.problem.cost_unit, alone.best.cost = "Hz", 4e4
    assert optimum_report.optimum_text(alone).split("\n")[:6] == [
        ("NOT CONFIRMED: least b.rate: 40 kHz, with each limit kept by at least 90 % of the searched rows"),
        (
            "Fresh rows keep margin ≥ 3 dB in 87.5 % (82.5 to 90 %), which is less often than "
            "the 90 % wanted; for slack draw more rows (optimise.rows) or ask for a larger "
            "share (optimise.confidence)."
        ),
        "",
        "variable  value   searched range",
        "a.power   2.5 W   1 W to 9 W",
        "b.rate    40 kHz  2 kHz to 500 kHz",
    ]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fresh": None}, "It has not been checked with fresh rows."),
        ({"fresh": SimpleNamespace(refused="no such mirror", kept=())}, "Fresh rows refuse it: no such mirror."),
        ({"fresh": SimpleNamespace(refused="", kept=())}, "There is no limit for fresh rows to check."),
    ],
)
def test_what_fresh_rows_say_is_told_where_there_are_some(changes, said):
    assert optimum_report.fresh_rows_sentence(an_optimum(**changes)) == said


def test_fresh_rows_agree_where_each_limit_is_kept_and_its_interval_too():
    of = an_optimum()
    for kept in of.fresh.kept:
        kept.holds = True
    assert optimum_report.fresh_rows_sentence(of) == "Fresh rows agree."
    of.fresh.kept[1].agrees = lambda confidence: False
    assert optimum_report.fresh_rows_sentence(of) == (
        "Fresh rows keep residual_quantile ≤ 9 urad in 95 % (90 to 97.5 %), below 90 %: "
        "this agrees within its interval; for slack draw more rows (optimise.rows) or ask "
        "for a larger share (optimise.confidence)."
    )
    assert optimum_report.fresh_rows_sentence(an_optimum(confirmed=False, fresh=of.fresh)) == (
        "Fresh rows keep residual_quantile ≤ 9 urad in 95 % (90 to 97.5 %), which is less "
        "often than the 90 % wanted; for slack draw more rows (optimise.rows) or ask for a "
        "larger share (optimise.confidence)."
    )


# ------------------------------------------------------------------------------------------ what stands where, whole
def test_a_page_of_two_combinations_has_every_part_with_its_tables_and_pictures_in_their_order():
    summary = two_cells(limits=TWO_SIDES[1:], failed=((1, Failed(2, 99, 3, "a reason")),))
    views = campaign_module.campaign_views(summary, campaign_figures(summary))
    assert outline(*views) == one_text("""
# Over the grid
[campaign-grid]
# Every combination (folded)
| -: mirror / aperture / keep all / rows / failed [0, 1]
b.toml / 6 cm / 25 % (6.25 % to 62.5 %) / 24 / 0
a.toml / 5 cm / 75 % (68.8 % to 87.5 %) / 20 / 1
| -: mirror / aperture / mean margin / miss margin [0, 1]
b.toml / 6 cm / 8.00 dB / 15 %
a.toml / 5 cm / 4.00 dB / 5 %
Below in detail: mirror = a.toml, aperture = 5 cm, the first of those that miss a limit least.
# Limits
| -: limit / missed by / 90 % interval / from [0, 1, 2, 3, 4, 5, 6, 7, 8]
margin ≥ 0.50 dB and ≤ 12.00 dB / 5 % / 2.5 % to 6.25 % / requirement.margin
# Outputs
Over the rows: mean, standard deviation, and the values that a share of the rows stays below, with their intervals.
  “–”: not known, there are too few rows.
| -: output / mean / deviation / 1 % / 50 % / 99 % [0]
residual_quantile / 4.00 µrad / 1.50 µrad / 1.50 µrad; 750 nrad to 1.88 µrad / 3.00 µrad; 1.50 µrad to 3.75 µrad /
  7.50 µrad; 3.75 µrad to 9.38 µrad
margin / 4.00 dB / 1.50 dB / 1.50 dB; 0.75 dB to 1.88 dB / 3.00 dB; 1.50 dB to 3.75 dB / 7.50 dB; 3.75 dB to 9.38 dB
# What they are
| -: output / meaning [0, 1, 2, 3, 4, 5, 6, 7, 8]
residual_quantile / what it is
margin / what it is
[campaign-residual_quantile]
[campaign-margin]
# Tail
[campaign-tail]
| -: probability / radial error / 90 % interval [0, 1, 2, 3, 4, 5, 6, 7, 8]
10 % / 1.75 µrad / 1.50 µrad to 2.00 µrad
0.1 % / 3.20 µrad / at least 3.00 µrad
10⁻⁶ / not known /
# What matters
[campaign-sensitivity-1]
| Every index and rank correlation: output / input / first order / total / rank correlation [0, 1]
residual_quantile / jitter.rms / 0.50 (0.25 to 0.62) / 0.62 (0.60 to 0.75) / 0.75 (0.38 to 0.84)
residual_quantile / mirror.alpha / 0.25 (0.12 to 0.31) / 0.30 (0.15 to 0.38) / −0.50 (−0.62 to −0.38)
margin / mirror.alpha / 0.70 (−0.35 to 1.05) /  /
# Where rows miss a limit
[campaign-region]
# Rows without results
| -: row / seed / tries / reason [0, 1, 2, 3, 4, 5, 6, 7, 8]
2 of mirror = a.toml, aperture = 5 cm / 99 / 3 / a reason
# How the rows were made
Sampling lhs, 2 drawn inputs, seed 77.
Loop: PI, 5 s.
Set: link.range = 1 km, b.c = 2.
| -: input / distribution [0, 1, 2, 3, 4, 5, 6, 7, 8]
mirror.alpha / normal
jitter.rms / uniform
| SHA-256 of what they depend on: of / SHA-256 [0, 1, 2, 3, 4, 5, 6, 7, 8]
campaign / c
mission / d
code / e
""")


def test_outputs_that_are_the_same_in_every_row_stand_on_the_page_without_a_table():
    even = replace(an_output("margin", "dB", 1.0), least=2.0, most=2.0)
    (view,) = (
        each
        for summary in [a_campaign([replace(a_cell(), outputs={"margin": even})], limits=(), failed=())]
        for each in campaign_module.campaign_views(summary, campaign_figures(summary))
        if each.title == "Outputs"
    )
    assert outline(view) == one_text("""
# Outputs
The same in every row: margin 2.00 dB.
# What they are
| -: output / meaning [0, 1, 2, 3, 4, 5, 6, 7, 8]
margin / what it is
""")


def test_the_head_of_a_page_names_campaign_digest_and_mission_and_has_verdict_progress_and_warnings(monkeypatch):
    seen = []
    monkeypatch.setattr(campaign_module, "page_of", lambda *args, **more: seen.append((args, more)) or "page")
    summary = two_cells(hashes={"code": "e" * 64, "campaign": "c1" * 32}, warnings=("one", "two"))
    assert campaign_page(summary) == "page"
    ((title, kind, of, (lead, progress, *warned), views), more) = seen[0]
    assert [title, kind, str(of), more] == [
        "a",
        "campaign",
        f"<code>a.toml</code>, SHA-256 <code>{'c1' * 8}…</code>; mission: m",
        {"sha256": "c1" * 32},
    ]
    assert (lead.headline, lead.good) == (campaign_words.headline(summary), None)
    assert list(lead.blocks) == ["found", *campaign_words.answers(summary, summary.cells[1])]
    assert progress.text == "Running: 41 of 64 rows, 2.05 rows a second, 5 min left."
    assert warned == ["Warnings:", Points(("one", "two"))]
    assert len(views) == 8
    campaign_page(replace(summary, hashes={}, warnings=()))
    (_, _, of, blocks, _), more = seen[1]
    assert [str(of), len(blocks), more] == [
        "<code>a.toml</code>, SHA-256 <code>…</code>; mission: m",
        2,
        {"sha256": ""},
    ]


def test_a_campaign_in_a_terminal_has_each_table_sentence_and_failed_row_in_its_place():
    failed = tuple((0, Failed(k, 50 + k, k % 3 + 1, f"why {k}")) for k in range(12))
    summary = a_campaign(
        [a_cell(rows=32, failed=12, tail=short_tail())],
        limits=TWO_SIDES[:1],
        failed=failed,
        findings=("one", "two"),
        progress=Progress(32, 64, 90.0, 0.5, math.inf, "stopped"),
    )
    lines = [line.strip() for line in campaign_text(summary, 80).splitlines() if line.strip(" ─")]
    assert [re.sub(r" {2,}", " / ", line) for line in lines] == [
        "So far: 12 of 32 rows failed; 75 % of the other 20 rows keep residual_quantile ≤",
        "6 µrad (68.8 % to 87.5 % at 90 % confidence).",
        "one",
        "two",
        "Limits",
        "limit / missed by / 90 % interval / from",
        "residual_quantile ≤ 6 µrad / 25 % / 12.5 % to 31.2 % / requirement.pointi",
        "ng_error",
        "Outputs, and their quantiles over the rows",
        "output / mean / deviation / 1 % / 50 % / 99 %",
        "residual_quantile / 4.00 µrad / 1.50 µrad / 1.50 µrad / 3.00 µrad / 7.50 µrad",
        "margin / 4.00 dB / 1.50 dB / 1.50 dB / 3.00 dB / 7.50 dB",
        "What they are",
        "output / meaning",
        "residual_quantile / what it is",
        "margin / what it is",
        "Radial errors that are exceeded",
        "probability / radial error / 90 % interval",
        "10 % / 1.75 µrad / 1.50 µrad to 2.00 µrad",
        "0.1 % / 3.20 µrad / at least 3.00 µrad",
        "10⁻⁶ / not known",
        "What matters most to residual_quantile (total Sobol index): jitter.rms 0.62",
        "(0.60 to 0.75), mirror.alpha 0.30 (0.15 to 0.38); a note.",
        "The radial error exceeds 3.20 µrad with probability 0.1 % (at least 3.00 µrad at",
        "90 % confidence).",
        "The radial error is beyond 2.5 µrad with probability 1 % (0.5 % to 2.5 % at 90 %",
        "confidence). The variance of that estimate is 4e-08, that of 250000 draws",
        "without importance sampling.",
        "No radial error beyond 6 µrad was seen (0 % to 0.4 % at 90 % confidence).",
        "Failed rows",
        "row / seed / tries / reason",
        *(f"{k} / {50 + k} / {k % 3 + 1} / why {k}" for k in range(10)),
        "2 more failed rows are in the export.",
        "Warning: a warning",
        "Stopped after 32 of 64 rows; microrad campaign resume goes on from there.",
    ]
    grid = [line.strip() for line in campaign_text(two_cells(), 100).splitlines()]
    for title in ("Limits", "Outputs", "Radial errors"):
        assert any(line.startswith(f"{title} of mirror = a.toml, aperture = 5 cm") for line in grid)


def test_a_worst_row_of_one_axis_begins_where_its_trace_does_and_has_four_drives_at_most():
    error, drives = np.array([1e-6, -3e-6, 2e-6]), np.arange(15.0).reshape(3, 5)
    trace = WorstTrace(0, 7, "margin", 1.25, np.array([0.5, 1.0, 1.5]), error, drives)
    assert figure_of(drawing.worst(two_cells(), trace, 7)) == [
        "campaign-worst-1-7",
        "7th worst row in time",
        "Row 7 of mirror = b.toml, aperture = 6 cm: of its rows the 7th worst in margin, 1.25 dB. Shown is the first "
        "run of the row's.",
        {
            "time (s)": [0.5, 1.0, 1.5],
            "radial error (rad)": [1e-6, 3e-6, 2e-6],
            **{f"drive {k + 1} (V)": [k, k + 5.0, k + 10.0] for k in range(4)},
        },
        "Sheet width=7.6 height=3.4 heights=[1.3 1] share_x=True legend=<place=lower right>",
        "Panel 0 0 x=<low=0.5 high=1.5> y=<title=radial error (µrad) low=0>",
        "Line x=[0.5 1 1.5] y=[1 3 2] colour=#0072B2 width=0.8",
        "Panel 1 0 x=<title=time (s) low=0.5 high=1.5> y=<title=drive (V)>",
        "Line x=[0.5 1 1.5] y=[0 5 10] colour=#0072B2 width=0.8 label=drive 1",
        "Line x=[0.5 1 1.5] y=[1 6 11] colour=#E69F00 width=0.8 label=drive 2",
        "Line x=[0.5 1 1.5] y=[2 7 12] colour=#009E73 width=0.8 label=drive 3",
        "Line x=[0.5 1 1.5] y=[3 8 13] colour=#56B4E9 width=0.8 label=drive 4",
    ]


@pytest.mark.parametrize(
    ("number", "unit", "name", "estimate", "given"),
    [
        (math.inf, "rad", "", "inf rad", "inf rad"),
        (math.inf, "s", "", "never", "never"),
        (-0.5, "dB", "", "−0.50 dB", "−0.50 dB"),
        (12.5, "1", "margin", "12.5", "12.5"),
        (1e-4, "1", "outage", "10⁻⁴", "10⁻⁴"),
        (2e-4, "", "short", "2×10⁻⁴", "2×10⁻⁴"),
        (0.5, "rad", "beyond_share", "500 mrad", "500 mrad"),
        (0.25, "1", "beyond_share", "25 %", "25 %"),
        (0.25, "1", "shared", "0.25", "0.25"),
        (2e-5, "V", "", "20.0 µV", "20 µV"),
        (41e9, "bit", "", "5.12 GB", "5.12 GB"),
        (4e9, "bit", "", "500 MB", "500 MB"),
        (180.0, "s", "", "3.00 min", "3 min"),
        (-4e-6, "rad", "", "−4.00 µrad", "−4 µrad"),
        (1234567.0, "1", "", "1235000", "1235000"),
    ],
)
def test_an_estimate_has_three_digits_and_a_bound_those_it_was_given(number, unit, name, estimate, given):
    assert (value(number, unit, name), campaign_numbers.bound(number, unit, name)) == (estimate, given)


@pytest.mark.parametrize(
    ("values", "unit", "name", "scale"),
    [
        ([-3e-5, 2e-6], "rad", "", (1e6, "µrad")),
        ([9e-4], "", "outage", (1.0, "share")),
        ([1e-3], "1", "a_share", (100.0, "%")),
        ([-0.5, 1e-4], "1", "outage", (100.0, "%")),
        ([5.0], "1", "", (1.0, "")),
        ([3e3], "dB", "", (1.0, "dB")),
        ([-8e9], "bit", "", (1.25e-10, "GB")),
        ([math.inf, 3e-3, math.nan], "W", "", (1e3, "mW")),
        ([math.nan], "rad", "", (1.0, "rad")),
        ([], "V", "", (1.0, "V")),
        ([119.0], "s", "", (1.0, "s")),
        ([-120.0, 1.0], "s", "", (1.0 / 60.0, "min")),
        ([7200.0], "s", "", (1.0 / 3600.0, "h")),
        ([5e6], "bit/s", "", (1e-6, "Mbit/s")),
    ],
)
def test_an_axis_takes_the_prefix_of_its_largest_value_of_either_sign(values, unit, name, scale):
    found = campaign_numbers.scale_of(np.array(values, dtype=np.float64), unit, name)
    assert (pytest.approx(found.factor), found.label) == scale
    assert found.title("x") == (f"x ({scale[1]})" if scale[1] else "x")


@pytest.mark.parametrize(
    ("ends", "unit", "name", "said"),
    [
        ((5e-13, 0.9), "", "outage", "50 % (0 % to 90.0 %)"),
        ((1e-12, 0.9), "", "outage", "50 % (10⁻¹² to 90.0 %)"),
        ((5e-13, 5e-4), "", "outage", "50 % (0 to 5×10⁻⁴)"),
        ((math.nan, 0.9), "1", "short", "50 % (at most 90.0 %)"),
        ((0.25, math.nan), "1", "a_share", "50 % (at least 25 %)"),
        ((math.nan, math.nan), "", "outage", "50 %"),
        ((5e-13, 0.9), "rad", "outage", "500 mrad (0.500 prad to 900 mrad)"),
        ((-0.25, 0.75), "dB", "", "0.50 dB (−0.25 dB to 0.75 dB)"),
    ],
)
def test_an_estimate_stands_before_the_ends_that_are_known(ends, unit, name, said):
    assert campaign_numbers.with_ends(Interval(0.5, *ends, 0.9), unit, name) == said


def quantiles_at(*probabilities):
    """An output whose quantiles are known at these probabilities: 1, 2, 3 … µrad."""
    return an_output(quantiles={p: between_ends(1e-6 * k) for k, p in enumerate(probabilities, 1)})


@pytest.mark.parametrize(
    ("probabilities", "ends"),
    [
        ((0.004, 0.011, 0.016, 0.5, 0.984, 0.989, 0.997), (4, 2, 6)),
        ((0.5, 0.2, 0.4, 0.6, 0.8), (1, 2, 5)),
        ((0.2, 0.5), (2, 1, 9)),
        ((0.5, 0.9), (1, 1, 2)),
        ((0.01, 0.99), (4, 1, 9)),
    ],
)
def test_a_combination_spans_its_known_quantiles_nearest_to_one_and_99_per_cent(probabilities, ends):
    found = drawing._span(quantiles_at(*probabilities))
    assert (found.value, found.low, found.high) == pytest.approx([1e-6 * end for end in ends])


def test_a_region_over_one_input_without_a_unit_has_an_output_that_is_a_share_in_per_cent():
    summary = a_campaign(
        [replace(a_cell(), outputs={"outage": an_output("outage", "", 0.1)}, missed_by={"outage": between_ends(0.4)})],
        limits=(Limit("outage", None, 0.2, "r"),),
        inputs=(InputText("a.b", "", "u"),),
        sample={key: np.array(column) for key, column in SHARES.items()},
        sensitivities=(),
        failed=(),
    )
    (found,) = campaign_module.region(summary)
    assert figure_of(found)[2:] == [
        "4 rows: those that keep outage ≤ 20 % and those that miss it, over a.b. Of all rows 40 % miss it.",
        {"a.b": [0.1, 0.2, 0.3, 0.4], "outage": [0.1, 0.3, 0.15, 0.5]},
        "Sheet width=7.6 height=4 legend=<place=upper right>",
        "Panel 0 0 x=<title=a.b> y=<title=outage (%)>",
        "Line x=[0.1 0.3] y=[10 15] colour=#0072B2 dash= label=kept marker=o size=3",
        "Line x=[0.2 0.4] y=[30 50] colour=#D55E00 dash= label=missed marker=x size=4.7",
        "Rule at=20 upright=False colour=#D55E00 dash=[5 2] width=1.4 label=limit ≤ 20 %",
    ]


SHARES = {"cell": [0.0] * 4, "row": [0.0, 1.0, 2.0, 3.0], "a.b": [0.1, 0.2, 0.3, 0.4], "outage": [0.1, 0.3, 0.15, 0.5]}


def test_inputs_stand_by_the_largest_index_that_any_output_has_of_them():
    i = between_ends
    first, total = {"a.x": i(0.2), "b.y": i(0.55), "c.z": i(0.9)}, {"a.x": i(0.3), "c.z": i(0.7)}
    one = Sensitivity("u", 9, {"a.x": i(0.6), "b.y": i(0.5), "c.z": i(0.1)}, {}, {}, 0.9, "")
    other = Sensitivity("v", 8, first, total, {}, 0.9, "n")
    (found,) = drawing.sensitivity(a_campaign([a_cell()], sensitivities=(one, other)))
    assert found.title == "What matters to u, v"
    assert found.caption == (
        "Sobol indices from 8 rows: the share of an output's variance that an input makes by itself (first order), and "
        "with all its interactions (total); with intervals. v: n."
    )
    assert [panel.y.ticks for panel in found.sheet.panels] == [{0: "c.z", 1: "a.x", 2: "b.y"}] * 2
    assert list(found.columns)[5:] == ["v, c.z, first index", "v, a.x, total index", "v, c.z, total index"]


def test_a_map_has_its_longer_key_downwards_and_is_as_high_as_that_has_steps():
    cells = [a_cell({"m": m, "b.aperture": f"{k} cm"}) for m in "xy" for k in range(1, 6)]
    turned = [a_cell({"b.aperture": f"{k} cm", "m": m}) for m in "xyz" for k in range(1, 10)]
    (one,), (other,) = (drawing.grid(a_campaign(each, failed=())) for each in (cells, turned))
    assert (one.sheet.height, other.sheet.height) == pytest.approx((2.8, 4.08))
    assert [(p.x.title, p.y.title) for p in one.sheet.panels] == [("m", "b.aperture"), ("m", "")]
    assert [(p.x.title, p.y.title) for p in other.sheet.panels] == [("m", "b.aperture"), ("m", "")]


@pytest.mark.parametrize(
    ("missed", "failed", "state", "word"),
    [
        ((0.0, 0.5), 0, "complete", "pass"),
        ((0.0, 1.0), 0, "complete", "pass"),
        ((0.5, 0.0), 0, "complete", "pass"),
        ((0.0, 0.5), 0, "running", "open"),
        ((0.0, 0.5), 0, "stopped", "open"),
        ((0.0, 0.5), 1, "complete", "open"),
        ((1.0, 1.0), 0, "complete", "fail"),
        ((1.0, 1.0), 1, "running", "fail"),
        ((1.0, 0.96), 0, "complete", "open"),
        ((0.25, 0.0), 2, "complete", "open"),
    ],
)
def test_one_combination_that_keeps_all_limits_is_enough_where_all_rows_are_there(missed, failed, state, word):
    cells = [a_cell({"m": str(k)}, missed=each, failed=failed) for k, each in enumerate(missed)]
    assert campaign_words.verdict(a_campaign(cells, progress=Progress(9, 9, 1.0, 9.0, 0.0, state))) == word


def test_combinations_that_miss_as_often_are_alike_whatever_their_intervals():
    other = replace(a_cell({"m": "b"}), missed=Interval(0.25, 0.2, 0.3, 0.9))
    said = "So far: 2 of 42 rows failed; in each of 2 combinations 75 % of the rows keep both limits."
    assert campaign_words.headline(a_campaign([a_cell({"m": "a"}), other])) == said


def test_the_evenest_combination_is_of_the_limit_that_is_missed_most_often():
    def split(first, second):
        return {"margin": between_ends(first), "residual_quantile": between_ends(second)}

    shares = [(1.0, 1.0), (0.75, 0.5), (0.6, 0.05), (0.0, 0.5)]
    cells = [replace(a_cell({"m": str(k)}, missed=1.0), missed_by=split(*each)) for k, each in enumerate(shares)]
    limit, number = campaign_module._split(a_campaign(cells, limits=TWO_SIDES[::-1]))
    assert (limit.output, number) == ("margin", 2)
    cells[0] = replace(cells[0], missed_by=split(0.125, 0.25))
    limit, number = campaign_module._split(a_campaign(cells, limits=TWO_SIDES[::-1]))
    assert (limit.output, number) == ("residual_quantile", 0)


@pytest.mark.parametrize(
    ("values", "high"),
    [
        ([0.0, 0.0, 0.0, 1.0], 0.25),
        ([2.0, 5.0], 0.5),
        ([-3.0] * 3 + [-1.0] * 5, 0.625),
        ([0.0, 0.0, 0.5, 1.0], None),
        ([0.0] * 400 + [1.0] * 599 + [0.9], None),
        ([7.0] * 3, None),
        ([1.0], None),
    ],
)
def test_an_output_has_two_values_where_all_rows_lie_at_its_ends(values, high):
    rows = np.array(values)
    of = an_output(
        rows=rows.size,
        mean=between_ends(float(rows.mean())),
        deviation=float(rows.std(ddof=1)) if rows.size > 1 else math.nan,
        least=float(rows.min()),
        most=float(rows.max()),
    )
    assert campaign_words.two_values(of) == (high if high is None else pytest.approx(high))


@pytest.mark.parametrize(
    ("radius", "ends"),
    [
        (3.5e-6, (0.0, 0.0, 0.007)),
        (9e-6, (0.0, 0.0, 0.004)),
        (1e-6, (0.5, 0.4, 0.6)),
        (1.5e-6, (math.sqrt(0.025), math.sqrt(0.016), math.sqrt(0.042))),
        (2.5e-6, (0.01, 0.0, math.sqrt(0.0007))),
        (0.9e-6, None),
    ],
)
def test_the_tail_between_two_radii_is_read_in_its_logarithm_and_beyond_the_last_by_its_upper_end(radius, ends):
    found = campaign_words.beyond(short_tail(), radius)
    assert (None if found is None else [found.value, found.low, found.high, found.confidence]) == (
        None if ends is None else pytest.approx([*ends, 0.9])
    )


@pytest.mark.parametrize(
    ("missed", "said"),
    [
        ((0.0, None, None), "In the only combination with results 100 % of the rows keep both limits."),
        ((0.25, 0.25, None), "In each of 2 combinations with results 75 % of the rows keep both limits."),
        ((0.25, 0.25), "In each of 2 combinations 75 % of the rows keep both limits."),
        (
            (0.0, 0.25, None),
            "Of 2 combinations with results, m = 0 keeps both limits most often, in 100 % (0 % to 100 %) of its rows; "
            "m = 1 least often, in 75 % (68.8 % to 87.5 %) (intervals at 90 %).",
        ),
    ],
)
def test_only_combinations_with_results_are_counted_among_those_that_keep_the_limits(missed, said):
    cells = [
        a_cell({"m": str(k)}, rows=20, failed=0 if each is not None else 20, missed=each or 0.0)
        for k, each in enumerate(missed)
    ]
    cells = [replace(cell, missed=Interval(0.0, 0.0, 1.0, 0.9)) if cell.missed.value == 0.0 else cell for cell in cells]
    summary = a_campaign(cells)
    assert campaign_words._said(summary, campaign_words.best(summary)) == said


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (20, "20 rows with results; whether they keep both limits is not known."),
        (1, "1 row with results; whether it keeps both limits is not known."),
    ],
)
def test_limits_of_outputs_that_no_row_knows_are_not_told_as_none(rows, said):
    cell = replace(a_cell(rows=rows, failed=0), missed=UNKNOWN)
    assert campaign_words._said(a_campaign([cell]), cell) == said


def test_one_thing_of_a_campaign_is_told_in_the_singular():
    failed = a_campaign([a_cell(rows=20, failed=11)])
    assert campaign_tables.more_failed(failed, 10) == "1 more failed row is in the export."
    assert "\n1 candidate, 1 of" in optimum_report.optimum_text(an_optimum(evaluations=1, refused=1))
    first = {f"key_{k}": between_ends(0.5 / (k + 1)) for k in range(drawing.MOST_INPUTS + 1)}
    each = Sensitivity("margin", 40, first, {}, {}, 0.9, "")
    (figure,) = drawing.sensitivity(a_campaign([a_cell()], sensitivities=(each,)))
    assert figure.caption.endswith(" 1 input with smaller indices is in the table only.")


# ------------------------------------------------------------------------------------- several of a kind, out of order
@pytest.mark.parametrize(("count", "step", "drawn_"), [(1500, 1, 1500), (1501, 2, 751), (4501, 4, 1126)])
def test_of_more_rows_than_a_region_has_room_for_every_so_many_th_is_drawn(count, step, drawn_):
    """Rows of another combination stand between them and are not counted."""
    cell = np.zeros(count + 2)
    cell[[1, 3]] = 1.0
    own, numbers = np.flatnonzero(cell == 0.0), np.arange(count + 2.0)
    columns = {"mirror.alpha": 1.0 + numbers, "jitter.rms": 1e-6 * (1.0 + numbers), "margin": 0.001 * numbers}
    summary = two_cells(sample={"cell": cell, "row": numbers, **columns})
    figure = drawing.region(summary, TWO_SIDES[1], 0, ["mirror.alpha", "jitter.rms"])
    assert figure.columns["mirror.alpha"].tolist() == (1.0 + own[::step]).tolist()
    assert figure.columns["margin"].size == drawn_ <= drawing.MOST_POINTS
    assert figure.caption.startswith(f"{drawn_} rows of mirror = b.toml")


def test_of_seven_worst_rows_six_are_drawn_each_counted_in_its_own_combination():
    cells = (1, 0, 1, 1, 0, 1, 0)
    worst = [WorstTrace(c, 10 + k, "margin", 1.0, *[np.arange(1.0, 5.0)] * 3) for k, c in enumerate(cells)]
    drawn_ = campaign_figures(two_cells(worst=worst))["worst"]
    assert [(figure.name, figure.title, figure.caption.split(" of ")[0]) for figure in drawn_] == [
        ("campaign-worst-2-1", "Worst row in time", "Row 10"),
        ("campaign-worst-1-1", "Worst row in time", "Row 11"),
        ("campaign-worst-2-2", "Second worst row in time", "Row 12"),
        ("campaign-worst-2-3", "Third worst row in time", "Row 13"),
        ("campaign-worst-1-2", "Second worst row in time", "Row 14"),
        ("campaign-worst-2-4", "Fourth worst row in time", "Row 15"),
    ]


def test_inputs_are_said_to_matter_most_where_each_of_them_does():
    """A third input has an index, too, but a small one."""
    first = {"mirror.alpha": between_ends(0.5), "jitter.rms": between_ends(0.25), "c.d": between_ends(0.04)}
    summary = a_campaign([a_cell()], sensitivities=(Sensitivity("margin", 30, first, {}, {}, 0.9, ""),))
    said = {
        inputs: drawing._mattering(summary, "margin", inputs)
        for inputs in (("jitter.rms", "mirror.alpha"), ("mirror.alpha", "c.d"), ("jitter.rms",), ("c.d",))
    }
    assert list(said.values()) == [", the inputs that matter most to it", "", ", the input that matters most to it", ""]
    assert drawing._mattering(summary, "residual_quantile", ("jitter.rms",)) == ""


def test_outputs_of_which_nothing_is_known_stand_together_by_their_reason():
    known = Sensitivity("margin", 30, {"mirror.alpha": between_ends(0.5)}, {}, {}, 0.9, "")
    unknown = [
        Sensitivity(name, 30, {}, {}, {}, 0.9, note)
        for name, note in (("a", "too few rows"), ("b", "it does not vary"), ("c", "too few rows"))
    ]
    limits = [Limit(name, 1.0, None, "") for name in ("c", "b", "margin", "a")]
    summary = a_campaign([a_cell()], limits=limits, sensitivities=(unknown[0], known, *unknown[1:]))
    assert campaign_words.matters(summary) == [
        "What matters most to margin (first-order Sobol index): mirror.alpha 0.50 (0.25 to 0.62).",
        "What matters to a and c is not known: too few rows.",
        "What matters to b is not known: it does not vary.",
    ]


def test_at_most_three_of_four_inputs_that_matter_are_named():
    first = {key: between_ends(index) for key, index in (("a", 0.1), ("b", 0.3), ("c", 0.06), ("d", 0.2))}
    (said,) = campaign_words.matters(
        a_campaign([a_cell()], sensitivities=(Sensitivity("margin", 30, first, {}, {}, 0.9, "no total ones"),))
    )
    assert said == (
        "What matters most to margin (first-order Sobol index): b 0.30 (0.15 to 0.38), d 0.20 (0.10 to 0.25), "
        "a 0.10 (0.05 to 0.12); no total ones."
    )


def test_a_radius_that_the_tail_was_asked_for_is_told_by_its_own_interval_once():
    """Read off the curve at 3 µrad it would be 0.2 %."""
    own = Interval(0.003, 0.0025, 0.004, 0.9)
    tail = short_tail(beyond={3e-6: own}, variance={})
    limits = (Limit("residual_quantile", None, 3e-6, ""), Limit("residual_rms", None, 2e-6, ""))
    said = campaign_words.tail_sentences(a_campaign([], limits=limits), a_cell(tail=tail))
    assert [each.partition("beyond ")[2] for each in said if "beyond" in each] == [
        "2 µrad with probability 5 % (4 % to 7 % at 90 % confidence).",
        "3 µrad with probability 0.3 % (0.25 % to 0.4 % at 90 % confidence).",
    ]


def test_of_several_outputs_each_is_told_with_its_one_or_two_values():
    """Of 20 rows, 25 % and 75 % at the larger value; deviation over rows less one."""

    def of_two(name, unit, low, high, at_high):
        spread = (high - low) * math.sqrt(at_high * (1.0 - at_high) * 20.0 / 19.0)
        mean = Interval(low + (high - low) * at_high, 0.0, 0.0, 0.9)
        return an_output(name, unit, mean=mean, deviation=spread, least=low, most=high)

    outputs = [
        of_two("margin", "dB", 1.0, 5.0, 0.25),
        an_output("beacon_margin", "dB", least=6.0, most=6.0),
        of_two("residual_quantile", "rad", 2e-6, 4e-6, 0.75),
        an_output("outage", "", least=0.25, most=0.25),
        an_output("short", "", scale=0.01),
    ]
    cell = replace(a_cell(), outputs={each.name: each for each in outputs})
    assert campaign_words.few_values(cell) == [
        "The same in every row: beacon_margin 6.00 dB, outage 25 %.",
        "margin has two values: 1.00 dB in 75 % of the rows, 5.00 dB in 25 %.",
        "residual_quantile has two values: 2.00 µrad in 25 % of the rows, 4.00 µrad in 75 %.",
    ]
    assert campaign_words.few_values(None) == []


def test_fresh_rows_that_keep_two_limits_less_often_name_both_or_those_that_do_not_agree():
    of = an_optimum()
    of.fresh.kept[1].holds = False
    both = "margin ≥ 3 dB in 87.5 % (82.5 to 90 %) and residual_quantile ≤ 9 urad in 95 % (90 to 97.5 %)"
    assert optimum_report.fresh_rows_sentence(of).startswith(f"Fresh rows keep {both}, below 90 %: this agrees")
    of.confirmed, of.fresh.kept[1].agrees = False, lambda confidence: confidence != 0.9
    assert optimum_report.fresh_rows_sentence(of).startswith(
        "Fresh rows keep residual_quantile ≤ 9 urad in 95 % (90 to 97.5 %), which is less often than the 90 % wanted"
    )
    of.fresh.kept[0].agrees = of.fresh.kept[1].agrees
    assert optimum_report.fresh_rows_sentence(of).startswith(f"Fresh rows keep {both}, which is less often")


def test_fresh_rows_that_are_refused_have_neither_a_cost_nor_limits_in_the_text():
    text = optimum_report.optimum_text(an_optimum(fresh=SimpleNamespace(refused="no rows", kept=(), cost=9.75)))
    lines = text.split("\n")
    assert lines[1] == "Fresh rows refuse it: no rows."
    assert "margin (mean over the rows): 4.25 dB of the searched rows" in lines
    assert not any(" fresh " in line for line in lines)
    free = an_optimum(warnings=())
    free.problem.limits = free.best.kept = free.fresh.kept = ()
    assert optimum_report.optimum_text(free).split("\n")[0] == "largest margin (mean over the rows): 4.25 dB"
    assert "deciding row" not in optimum_report.optimum_text(free)


def test_a_map_of_as_many_steps_either_way_leaves_a_combination_that_is_not_there_grey():
    """The second key goes across; of four combinations the last is missing."""
    of = {("1 m", "a"): 1.0, ("2 m", "a"): 2.0, ("1 m", "b"): 4.0}
    cells = [a_cell({"x.size": size, "y.kind": kind}, scale=scale) for (size, kind), scale in of.items()]
    (figure,) = drawing.grid(a_campaign(cells, limits=(), sensitivities=()))
    (first, _) = figure.sheet.panels
    (field,) = first.all_of(Field)
    assert plain(field.z) == [[3.0, 12.0], [6.0, "nan"]]
    assert list(first.x.ticks.values()) == ["a", "b"] and list(first.y.ticks.values()) == ["1 m", "2 m"]
    words = {(each.x, each.y): each.text for each in first.all_of(drawing.Words)}
    assert words == {(0, 0): "3", (1, 0): "12", (0, 1): "6", (1, 1): "none"}


def test_axes_of_a_region_tell_their_inputs_from_those_that_are_not_drawn():
    """Of "first.axis.gain" the last two parts are those of another input, too."""
    keys = ("first.axis.gain", "second.axis.gain", "mirror.plant.alpha")
    summary = two_cells(
        inputs=[InputText(key, "", "normal") for key in keys],
        sample={"cell": np.zeros(3), **{key: np.array([1.0, 2.0, 4.0]) for key in (*keys, "margin")}},
    )
    (panel,) = drawing.region(summary, TWO_SIDES[1], 0, [keys[0], keys[2]]).sheet.panels
    assert [panel.x.title, panel.y.title] == ["first.axis.gain", "plant.alpha"]


@pytest.mark.parametrize("lacking", ["outputs", "missed_by", "sample"])
def test_a_region_is_of_a_limit_and_a_combination_of_which_all_is_known(lacking):
    """The first combination has no share of the rows that miss the second limit, or not its output, or none has it."""
    summary = two_cells()
    first, second = summary.cells
    if lacking == "sample":
        sample = {key: column for key, column in summary.sample.items() if key != "residual_quantile"}
        assert campaign_module._split(replace(summary, sample=sample)) == (TWO_SIDES[1], 1)
        return
    kept = {key: each for key, each in getattr(first, lacking).items() if key != "margin"}
    cells = (replace(first, **{lacking: kept}), replace(second, missed_by={"margin": between_ends(0.25)}))
    assert campaign_module._split(replace(summary, cells=cells)) == (TWO_SIDES[1], 1)


def test_two_findings_and_two_warnings_stand_in_text_page_and_data_each_in_its_place():
    summary = two_cells(findings=("one finding", "another finding"), warnings=("first doubt", "second doubt"))
    lines = campaign_text(summary, 100).splitlines()
    at = lines.index("one finding")
    assert lines[at - 1 : at + 3] == ["", "one finding", "another finding", ""]
    assert lines[-3:] == [
        "Warning: first doubt",
        "Warning: second doubt",
        "Running: 41 of 64 rows, 2.05 rows a second, 5 min left.",
    ]
    page, data = campaign_page(summary), campaign_data(summary)
    words = ("one finding", "another finding", "first doubt", "second doubt")
    places = [page.index(each) for each in words]
    assert places == sorted(places) and [page.count(each) for each in words] == [1] * 4
    assert (data["findings"], data["warnings"]) == ([*words[:2]], [*words[2:]])


def test_each_of_four_radii_of_a_tail_is_marked_in_a_look_of_its_own():
    radii = {0.1: 1.5e-6, 0.01: 2e-6, 1e-3: 2.5e-6, 1e-4: 2.75e-6}
    wanted = {p: Interval(at, at, at, CONFIDENCE) for p, at in radii.items()}
    found = [mark for mark in tail_of(wanted=wanted) if getattr(mark, "marker", "")]
    assert [(mark.x[0], mark.y[0]) for mark in found] == [pytest.approx((1e6 * at, p)) for p, at in radii.items()]
    assert [mark.label for mark in found] == [
        "10 %: 1.50 µrad",
        "1 %: 2.00 µrad",
        "0.1 %: 2.50 µrad",
        "10⁻⁴: 2.75 µrad",
    ]
    assert [mark.marker for mark in found] == ["o", "s", "D", "o"]
    assert len({mark.colour for mark in found[:3]}) == 3


def test_errors_beyond_two_radii_are_told_by_size_each_with_its_own_variance_or_none():
    """The second comes from importance sampling: 0.01 · 0.99 / 4.95e-6 draws."""
    beyond = {3e-6: between_ends(0.004), 2.5e-6: between_ends(0.01), 2e-6: between_ends(0.25)}
    tail = short_tail(beyond=beyond, variance={2e-6: 0.0125, 2.5e-6: 4.95e-6})
    _, *said = campaign_words.tail_sentences(a_campaign([], limits=()), a_cell(tail=tail))
    worth = "The variance of that estimate is {}, that of {} draws without importance sampling."
    assert said == [
        "The radial error is beyond 2 µrad with probability 25 % (12.5 % to 31.2 % at 90 % confidence). "
        + worth.format("0.013", 15),
        "The radial error is beyond 2.5 µrad with probability 1 % (0.5 % to 1.25 % at 90 % confidence). "
        + worth.format("5e-06", 2000),
        "The radial error is beyond 3 µrad with probability 0.4 % (0.2 % to 0.5 % at 90 % confidence).",
    ]
    (cell,) = campaign_data(a_campaign([a_cell(tail=tail)]))["cells"]
    assert [(each["error_rad"], each["value"], each["variance"]) for each in cell["tail"]["beyond"]] == [
        (3e-6, 0.004, None),
        (2.5e-6, 0.01, 4.95e-6),
        (2e-6, 0.25, 0.0125),
    ]


@pytest.mark.parametrize("count", [40, 41])
def test_a_terminal_lists_the_first_forty_combinations(count):
    cell = summary_of(0, rows=4, loop=False).cells[0]
    cells = tuple(replace(cell, values={"a.b": f"v{k}"}) for k in range(count))
    for limits, tables in (((), 1), (LIMITS[:1], 2)):
        summary = replace(summary_of(0, rows=4, loop=False), cells=cells, limits=limits)
        found = campaign_terminal._over_the_grid(summary, 30)
        assert len(found) == tables
        for table in found:
            assert [row[0] for row in table.rows] == [f"v{k}" for k in range(40)]


def test_an_input_that_ranks_first_alone_is_followed_by_another_input_and_not_by_itself():
    index = {"mirror.alpha": between_ends(0.5), "jitter.rms": NO_INTERVAL}
    each = Sensitivity("margin", 30, index, {}, {}, 0.9, "")
    summary = a_campaign([a_cell()], sensitivities=(each,))
    assert campaign_module._leading(summary, "margin", slice(None)) == ["mirror.alpha", "jitter.rms"]


def test_the_rows_of_indices_tell_an_input_from_those_that_have_no_room_too():
    """The fifteenth input, whose index is the least, ends as the first does."""
    first = {f"input.of_{k}": between_ends(0.9 - 0.01 * k) for k in range(13)}
    first = {"a.gain.rate": between_ends(0.95), **first, "b.gain.rate": between_ends(0.1)}
    each = Sensitivity("margin", 30, first, {}, {}, 0.9, "")
    (figure,) = drawing.sensitivity(a_campaign([a_cell()], sensitivities=(each,)))
    labels = [*figure.sheet.panels[0].y.ticks.values()]
    assert (len(labels), labels[0], labels[1], labels[-1]) == (14, "a.gain.rate", "input.of_0", "input.of_12")
    assert figure.caption.endswith(" 1 input with smaller indices is in the table only.")


def test_outputs_beyond_three_have_their_indices_in_a_further_figure_in_the_order_of_all():
    first = {"a.b": 0.2, "c.d": 0.3}
    found = [
        Sensitivity(name, 30, {key: between_ends(index) for key, index in first.items()}, {}, {}, 0.9, "")
        for name in ("one", "two", "three")
    ]
    found.append(replace(found[0], output="four", rows=20, first={"a.b": between_ends(0.8), "c.d": between_ends(0.1)}))
    figures = drawing.sensitivity(a_campaign([a_cell()], sensitivities=tuple(found)))
    assert [(figure.name, figure.title) for figure in figures] == [
        ("campaign-sensitivity-1", "What matters to one, two, three"),
        ("campaign-sensitivity-2", "What matters to four"),
    ]
    for figure, rows in zip(figures, (30, 20), strict=True):
        assert [*figure.sheet.panels[0].y.ticks.values()] == ["a.b", "c.d"]
        assert f" from {rows} rows: " in figure.caption


def test_an_output_has_the_unit_of_the_first_combination_with_results():
    worse, better = two_cells().cells
    summary = a_campaign([replace(worse, failed=24, outputs={}, missed=NO_INTERVAL, missed_by={}), better])
    assert [campaign_tables.unit_of(summary, name) for name in ("margin", "residual_quantile", "none")] == [
        "dB",
        "rad",
        "",
    ]
    assert [row[0] for row in campaign_tables.limit_table(summary, better).rows] == [
        "residual_quantile ≤ 6 µrad",
        "margin ≥ 0.50 dB and ≤ 12.00 dB",
    ]
    assert [limit["unit"] for limit in campaign_data(summary)["limits"]] == ["rad", "dB"]
    assert [row[2::2] for row in campaign_tables.limited_table(summary, summary.cells).rows] == [
        ("", ""),
        ("4.00 µrad", "4.00 dB"),
    ]
    (figure,) = drawing.grid(summary)
    assert [panel.title for panel in figure.sheet.panels] == [
        "rows that miss a limit (%)",
        "median residual_quantile (µrad)",
    ]


def test_the_tails_of_all_other_combinations_stand_in_grey_behind_that_of_the_one_shown():
    tails = [short_tail(survival=np.array([p, p / 10.0, p / 100.0, 0.0])) for p in (0.5, 0.6, 0.7, 0.8)]
    cells = [a_cell({"mirror": f"{k}.toml"}, tail=tail) for k, tail in enumerate(tails)]
    cells.insert(1, a_cell({"mirror": "none.toml"}))
    (figure,) = drawing.tail(a_campaign(cells), cells[3])
    curves = [(line.label, line.y.tolist()) for line in figure.sheet.panels[0].all_of(Line) if line.dash == "-"]
    assert curves == [
        ("other combinations", pytest.approx([0.5, 0.05, 0.005])),
        ("other combinations", pytest.approx([0.6, 0.06, 0.006])),
        ("other combinations", pytest.approx([0.8, 0.08, 0.008])),
        ("mirror = 2.toml", pytest.approx([0.7, 0.07, 0.007])),
    ]
    assert figure.columns["probability"].tolist() == pytest.approx([0.7, 0.07, 0.007, 0.0])
    assert figure.caption.startswith("Probability that the radial error of mirror = 2.toml exceeds a radius.")


@pytest.mark.parametrize(
    ("survival", "wanted", "low"),
    [
        ([0.5, 0.3, 0.0], (), 10.0**-1.3),  # at least a decade is shown
        ([0.5, 0.02, 0.0], (0.05,), 10.0**-2.3),
        ([0.5, 0.02, 0.0], (0.05, 3e-5, 1e-3), 10.0**-5.3),
        ([0.5, 2e-14, 0.0], (), 10.0**-14.3),
        ([0.5, 1e-14, 3e-40], (1e-3,), 1e-15),
        ([0.5, 1e-3, 0.0], (1e-30,), 1e-15),
    ],
)
def test_the_axis_of_a_tail_ends_a_decade_below_the_least_probability_and_at_1e_15(survival, wanted, low):
    tail = short_tail(survival=np.array(survival), wanted=dict.fromkeys(wanted, NO_INTERVAL))
    assert drawing._floor(tail) == pytest.approx(low, rel=1e-9, abs=0.0)


def test_the_band_of_a_tail_ends_at_1_and_the_name_of_its_combination_has_lines_of_24_letters():
    tail = short_tail(high=np.array([1.25, 0.5, 0.25, 0.125]), low=np.array([0.5, 0.0625, 0.0, 0.0]))
    cell = a_cell({"mirror": "coupled.toml", "aperture": "25 cm"}, tail=tail)
    (figure,) = drawing.tail(a_campaign([cell]), cell)
    (band,) = [mark for mark in marks(figure) if isinstance(mark, Area)]
    assert [point.tolist() for point in band.rings[0]] == [
        pytest.approx(point) for point in ([1, 0.5], [2, 0.0625], [3, 1e-300], [3, 0.25], [2, 0.5], [1, 1.0])
    ]
    assert [mark.label for mark in marks(figure) if getattr(mark, "dash", "") == "-"] == [
        "mirror = coupled.toml,\naperture = 25 cm"
    ]
    for first, label in (("222", "a = 222, b = four, c = x"), ("2222", "a = 2222, b = four, c =\nx")):
        of = replace(cell, values={"a": first, "b": "four", "c": "x"})
        (figure,) = drawing.tail(a_campaign([of]), of)
        assert [mark.label for mark in marks(figure) if getattr(mark, "dash", "") == "-"] == [label]


def test_a_map_has_names_of_12_letters_across_and_of_24_downwards_and_its_titles_on_the_outside():
    across = ["twelve--abcd", "thirteen-abcd"]
    down = ["twenty-four-------abcdef", "twenty-five-------abcdefg", "z"]
    keys = ("fine_pointing.body.of_the_first_satellite_of_all", "communication.divergence_of_the_beam")
    cells = [a_cell({keys[0]: a, keys[1]: b}) for b in down for a in across]
    (figure,) = drawing.grid(a_campaign(cells, failed=()))
    first, *others = figure.sheet.panels
    assert first.x.title == "body.of_the_first_satellite_of_all"
    assert first.y.title == "communication.\ndivergence_of_the_beam"
    assert [panel.y.title for panel in others] == [""] * len(others) and others
    for panel in (first, *others):
        assert list(panel.x.ticks.values()) == ["twelve--abcd", "thirteen-ab…"]
        assert list(panel.y.ticks.values()) == ["twenty-four-------abcdef", "twenty-five-------abcde…", "z"]


def test_the_limit_of_a_share_is_marked_in_per_cent():
    output = an_output("outage", "", 0.0625)
    found = limit_marks(marks(drawing.distribution(output, Limit("outage", 0.125, 0.25, "a"))))
    assert found == ([pytest.approx(12.5), pytest.approx(25.0)], [])
    labels = [mark.label for mark in marks(drawing.distribution(output, Limit("outage", 0.125, 0.25, "a")))]
    assert [label for label in labels if label.startswith("limit")] == ["limit ≥ 12.5 %", "limit ≤ 25 %"]
    far = limit_marks(marks(drawing.distribution(output, Limit("outage", None, 1e-4, "a"))))
    assert far == ([pytest.approx(0.01)], [])


def test_rows_and_reasons_of_failed_rows_are_folded_where_a_terminal_is_narrow():
    """The combination of the first column and the reason in the last one; seeds and tries stay as they are."""
    reason = "the sensor was not calibrated in the night before the run, and its offset is beyond what the loop takes"
    cell = a_cell({"mirror": "coupled.toml", "aperture": "25 cm", "case": "a long name of it"}, failed=1)
    text = campaign_text(
        a_campaign([a_cell({"mirror": "b"}), cell], failed=((1, Failed(7, 987654321, 12, reason)),)), 60
    )
    lines = text[text.index("Failed rows") :].splitlines()
    end = next(k for k, line in enumerate(lines) if line.startswith("Warning"))
    assert max(map(len, lines[:end])) <= 60
    table = " ".join(" ".join(lines[:end]).split())
    assert "987654321" in table and " 12 " in table
    assert all(f" {word} " in f" {table} " for word in (*reason.split(), "coupled.toml,", "25"))


@pytest.mark.parametrize(
    ("least", "most", "drawn_at"),
    [
        (-5.0, 10.0, [-10.0, 20.0]),  # a width of the axis beyond either end
        (-5.05, 10.05, []),
        (-5.05, 4.0, [8.0]),
        (None, 0.0, [0.0]),
        (0.0, None, [0.0]),
        (None, None, []),
    ],
)
def test_a_limit_is_drawn_over_the_grid_up_to_a_width_of_the_axis_away(least, most, drawn_at):
    panel = Panel(0, 0, x=Axis("x", low=0.0, high=10.0))
    other = Limit("other", 1.0, 2.0, "")
    summary = a_campaign([a_cell()], limits=(other, Limit("margin", least, most, "")))
    shown = drawing.Shown("median margin", campaign_numbers.Scale(2.0, "dB"), [])
    assert [(rule.at, rule.upright) for rule in drawing._limit_lines(panel, summary, shown)] == [
        (pytest.approx(at), True) for at in drawn_at
    ]
    assert drawing._limit_lines(panel, summary, shown._replace(name="median point_ahead")) == []
