"""Plots on matplotlib's axes: they show what the sheet has, with units, on the axes that are given; and refusals."""

import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from importlib.util import module_from_spec

import matplotlib as mpl

mpl.use("Agg")

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose, assert_array_equal

from budget_files import kept_study
from drawn import lines_of
from microrad.core import lti
from microrad.lab.identify import fit_frequency_response, identify, response_from_records
from microrad.lab.recording import recording_from_arrays
from microrad.link.error_budget import ErrorSource, Requirement, Spread, assembly
from microrad.loop import disturbance
from microrad.loop.control import AxisController, Drive, Timing
from microrad.loop.disturbance import Disturbance, Reference, SpectralLine
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.paper_cases import Run
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.traces import PointingTrace
from microrad.loop.sensor import OpticalSensor
from microrad.loop.sine_run import Trace
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.report import plots
from microrad.report.day.figures import contacts_figure
from microrad.report.error_budget.figures import budget_figures
from microrad.report.identification import figures as identification
from microrad.report.paper.figures import margin_map
from microrad.report.plotting import axes as renderer
from microrad.report.plotting import interactive, scales, svg
from microrad.report.plotting.axes import axes_of
from microrad.report.plotting.layout import layout
from microrad.report.plotting.sheet import Area, Axis, Bars, Field, Legend, Line, Rule, Sheet, Span, Words, empty, grid
from places import ROOT
from response_tables import TABLES
from shared import once
from shipped import plain_study
from truths import behind_resonance, philox, plays

RATE_HZ = 2000.0
URAD = 1e-6
DOLLARS = "$x_^2$ \\frac .csv"
PAGE = (ROOT / "docs" / "plots.md").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def closed():
    pyplot.close("all")
    yield
    pyplot.close("all")


# -------------------------------------------------------------------------------------------------------------- results
def chirp(seconds=2.0):
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    drive = 0.2 * np.sin(2 * np.pi * seconds / math.log(600.0) * (600.0 ** (t / seconds) - 1))
    output = 0.07 * behind_resonance(drive, RATE_HZ, held=True)
    output = output + 0.01 * np.std(output) * philox(9).standard_normal(output.size)
    return recording_from_arrays(drive, output, RATE_HZ, "chirp.csv")


def identified(with_chirp):
    """Two play operators behind the resonance, mrad over V."""
    drive = 6 - 6 * np.cos(2 * np.pi * 10.0 * np.arange(800) / RATE_HZ)
    output = behind_resonance(plays(drive, [0.0, 1.0], [0.06, 0.03], rate_hz=RATE_HZ), RATE_HZ, held=True)
    output = output + 1e-3 * philox(1).standard_normal(output.size)
    loop = recording_from_arrays(drive, output, RATE_HZ, DOLLARS)
    return identify(
        [loop, chirp()] if with_chirp else [loop], models=("prandtl_ishlinskii", "linear")[: 2 if with_chirp else 1]
    )


def loop_of_two_axes():
    """A mirror that is a gain, two axes of it, under a vibration and an integral controller."""
    one = mirror.assemble("gain", "static", None, BoucWen(1e-4, 0.0, 0.0, 0.0, 0.0, 0.0))
    loop = fine.PointingLoop(
        mirror=mirror.combine(one, one),
        optics=np.eye(2),
        drive=Drive(-math.inf, math.inf, math.inf, math.inf, 0.0, 0.0),
        timing=Timing(1e-3, 1, 0),
        disturbances=((disturbance.olympus(),),) * 2,
        optical=OpticalSensor(URAD, math.inf, 0.0, 1, 0),
        gauge=None,
        references=(Reference(0.0, 0.0, 1.0),) * 2,
    )
    gain, none = np.array([[3000.0]]), np.zeros((1, 1))
    axis = AxisController(
        "integral", lti.StateSpace(np.eye(1), np.hstack([gain, none]), np.eye(1), np.hstack([gain, none])), np.eye(1)
    )
    return fine.without_hysteresis(loop), fine.assemble("integral", loop, axis)


def shaken(*lines):
    return disturbance.combine(
        disturbance.olympus(),
        Disturbance("wheel", np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), lines, "assumed", "a test"),
    )


def table(inputs):
    return next(each for each in (make() for make in TABLES) if each.response.shape[1:] == (inputs, inputs))


def fitted(inputs):
    t = table(inputs)
    return fit_frequency_response(t.freq_hz, t.response, t.order, standard_error=t.standard_error)


def runs():
    loop, controller = loop_of_two_axes()
    return ensemble.simulate(loop, controller, ensemble.Span(3.0, 0.5, 1), 4)


def run():
    return traces.trace(*loop_of_two_axes(), ensemble.Span(0.6, 0.1, 1))


def budget():
    """Two requirements on a noise and a process."""
    gains = np.ones(2)
    noise = ErrorSource("noise", "random", Spread("fixed", 1e-6), gains)
    process = disturbance.first_order(1e-13, 20.0, convention="per-axis")
    wheels = ErrorSource("wheels", "process", Spread("fixed", 1.0), gains, process=process)
    required = {
        "mean": Requirement(ErrorIndex("MPE", 1e-3), limit_rad=1e-5),
        "all": Requirement(ErrorIndex("APE"), axes=(1,), limit_rad=1e-5),
    }
    return assembly.judge(assembly.stated((noise, wheels), required), None)


RESULTS = {
    "fit": lambda: fitted(1),
    "fit of several": lambda: fitted(2),
    "response": lambda: response_from_records([chirp()]),
    "identification": lambda: once("identification that is plotted", lambda: identified(True)),
    "runs": runs,
    "run": run,
    "sine": lambda: plain_study().residual,
    "sine's trace": lambda: plain_study().residual.trace,
    "vibration": lambda: shaken(SpectralLine(2e-6, 40.0), SpectralLine(1e-6, 80.0)),
    "loop": lambda: plain_study().loops[0],
    "loops": lambda: plain_study().loops,
    "study": plain_study,
    "links": lambda: plain_study().links,
    "day": lambda: plain_study().day,
    "contacts": lambda: plain_study().day.relay.contacts,
    "study with a budget": kept_study,
    "budget": budget,
}
KNOWN = {}
PLOTS = [
    ("plot_bode", "fit", 2),
    ("plot_bode", "fit of several", 8),
    ("plot_bode", "response", 2),
    ("plot_bode", "identification", 2),
    ("plot_loops", "loop", 2),
    ("plot_loops", "loops", 2),
    ("plot_loops", "identification", 2),
    ("plot_residual", "identification", 1),
    ("plot_residual", "fit", 1),
    ("plot_residual", "fit of several", 4),
    ("plot_residual", "sine", 1),
    ("plot_residual", "sine's trace", 1),
    ("plot_residual", "run", 1),
    ("plot_spectrum", "runs", 2),
    ("plot_spectrum", "vibration", 2),
    ("plot_spectrum", "budget", 2),
    ("plot_pointing_errors", "budget", 2),
    ("plot_pointing_errors", "study with a budget", 2),
    ("plot_contributions", "budget", 2),
    ("plot_contributions", "study with a budget", 2),
    ("plot_margin_map", "study", 1),
    ("plot_margin_map", "links", 1),
    ("plot_contacts", "day", 1),
    ("plot_contacts", "contacts", 1),
]


SEVERAL = ("plot_bode", "fit of several", 8)
"""Eight panels of a fit that takes a second: four of it are in `plot_residual`."""
SHOWN = [pytest.param(*each, marks=pytest.mark.endurance) if each == SEVERAL else each for each in PLOTS]
FIRST = [next(each for each in PLOTS if each[0] == plot) for plot in dict.fromkeys(each[0] for each in PLOTS)]
ON_GIVEN = [each if each in FIRST else pytest.param(*each, marks=pytest.mark.endurance) for each in PLOTS]
"""On given axes each function draws one result: of the others, only the sheet is another."""


def result(name):
    if name not in KNOWN:
        KNOWN[name] = RESULTS[name]()
    return KNOWN[name]


def listed(drawn):
    return [drawn] if isinstance(drawn, Axes) else list(drawn)


def one_line(text):
    return " ".join(text.split())


# ------------------------------------------------------------------------------------------------------ what they show
@pytest.fixture
def sheets(monkeypatch):
    """The sheets that are drawn."""
    seen = []
    monkeypatch.setattr(plots, "axes_of", lambda sheet, axes: seen.append(sheet) or axes_of(sheet, axes))
    return seen


@pytest.mark.promise("plots-1", "plots-2", "plots-5", "plots-10")
@pytest.mark.parametrize(("plot", "name", "panels"), SHOWN)
def test_the_axes_show_what_the_sheet_has_with_its_units(sheets, plot, name, panels):
    drawn = getattr(plots, plot)(result(name))
    (sheet,) = sheets
    assert isinstance(drawn, Axes) if panels == 1 else drawn.shape == (panels,)
    assert len(listed(drawn)) == len(sheet.panels) == panels
    (figure,) = {ax.figure for ax in listed(drawn)}
    assert tuple(figure.get_size_inches()) == (sheet.width, sheet.height)
    assert pyplot.get_fignums() == [figure.number]
    for ax, of in zip(listed(drawn), layout(sheet).placed, strict=True):
        panel = of.panel
        rules = len(panel.all_of(Rule))
        lines = [line for line in ax.lines if line.get_transform() == ax.transData]
        assert len(ax.lines) == len(lines) + rules
        for line, mark in zip(lines, panel.all_of(Line), strict=True):
            assert_array_equal(line.get_xdata(), mark.x)
            assert_array_equal(line.get_ydata(), mark.y)
            assert mpl.colors.same_color(line.get_color(), mark.colour)
        assert sum(len(each.patches) for each in ax.containers) == sum(bars.at.size for bars in panel.all_of(Bars))
        assert sorted(text.get_text() for text in ax.texts) == sorted(words.text for words in panel.all_of(Words))
        assert (ax.get_xscale() == "log", ax.get_yscale() == "log") == (panel.x.log, panel.y.log)
        for title, expected, shown in (
            (ax.get_xlabel(), of.x_title, of.x_shown),
            (ax.get_ylabel(), of.y_title, of.y_shown),
        ):
            assert one_line(title) == (one_line(expected) if shown else "")
            assert not title or title.endswith(")") or title.startswith("hours since"), title
        assert ax.title.get_text().replace("\n", " ") == panel.title
    if (plot, name, panels) in FIRST or os.environ.get("MICRORAD_ENDURANCE"):
        figure.canvas.draw()


@pytest.mark.promise("plots-5", "plots-10")
@pytest.mark.parametrize(("plot", "name", "panels"), ON_GIVEN)
def test_given_axes_are_drawn_on_and_given_back_and_no_figure_is_made(plot, name, panels):
    figure, given = pyplot.subplots(panels, 1, figsize=(3.5, 2.0 * panels), layout="constrained", squeeze=False)
    other = pyplot.figure()
    before = pyplot.get_fignums()
    drawn = listed(getattr(plots, plot)(result(name), given[0, 0] if panels == 1 else given))
    assert pyplot.get_fignums() == before and pyplot.gcf() is other and not other.axes
    assert len(drawn) == panels and all(a is b for a, b in zip(drawn, given.ravel(), strict=True))
    beside = 1 if plot == "plot_margin_map" else 0  # the colour bar
    assert len(figure.axes) == panels + beside
    assert all(ax.has_data() and ax.get_xlabel() for ax in drawn)
    assert all(
        isinstance(each, (mpl.lines.Line2D, mpl.patches.Patch)) for ax in drawn for each in [*ax.lines, *ax.patches]
    )
    assert not figure.legends
    figure.canvas.draw()


def drawn_by_the_report():
    """What the report draws of the same results, by the function that plots them: panels with their lines and bars."""
    found, day, wanted = result("identification"), result("day"), result("budget")
    of = identification.identification_figures(found, ())
    contributed, distributed, spectra = budget_figures(wanted)
    return {
        ("plot_bode", "identification"): of["response"].sheet.panels[:2],
        ("plot_loops", "identification"): of["loops"].sheet.panels,
        ("plot_residual", "identification"): of["residuals"].sheet.panels,
        ("plot_spectrum", "budget"): spectra.sheet.panels,
        ("plot_pointing_errors", "budget"): distributed.sheet.panels,
        ("plot_contributions", "budget"): contributed.sheet.panels,
        ("plot_margin_map", "study"): margin_map(result("study")).sheet.panels,
        ("plot_contacts", "day"): contacts_figure(day).sheet.panels,
    }


@pytest.mark.promise("plots-1")
def test_curves_colours_and_units_are_those_of_the_report():
    for (plot, name), panels in drawn_by_the_report().items():
        for ax, panel in zip(listed(getattr(plots, plot)(result(name))), panels, strict=True):
            lines = [line for line in ax.lines if line.get_transform() == ax.transData]
            for line, mark in zip(lines, panel.all_of(Line), strict=True):
                assert_array_equal(line.get_ydata(), mark.y)
                assert mpl.colors.same_color(line.get_color(), mark.colour)
            bars = [patch.get_facecolor() for each in ax.containers for patch in each.patches]
            for bar, colour in zip(bars, [b.colour for b in panel.all_of(Bars) for _ in b.at], strict=True):
                assert mpl.colors.same_color(bar[:3], colour)
            assert one_line(ax.get_ylabel()) in ("", one_line(panel.y.title)), plot


@pytest.mark.promise("plots-5", "plots-11")
def test_a_bode_plot_shows_the_table_the_model_and_its_confidence():
    fit, t = result("fit"), table(1)
    size, phase = plots.plot_bode(fit)
    dots, model = size.lines
    assert_allclose(dots.get_ydata(), np.abs(t.response[:, 0, 0]), rtol=1e-12)
    assert_allclose(model.get_ydata(), np.abs(fit.response(model.get_xdata())[:, 0, 0]), rtol=1e-12)
    assert set(t.freq_hz) <= set(model.get_xdata())
    turned = np.radians(phase.lines[0].get_ydata())
    assert_allclose(np.exp(1j * turned), t.response[:, 0, 0] / np.abs(t.response[:, 0, 0]), atol=1e-9)
    assert [text.get_text() for text in size.get_legend().get_texts()] == [
        "measured",
        "95 % confidence of the model",
        f"model, order {fit.order}",
    ]


@pytest.mark.promise("plots-11")
def test_the_bands_of_a_fitted_model_are_the_confidence_of_its_gain_and_of_its_phase():
    fit = result("fit")
    for which, ax in enumerate(plots.plot_bode(fit)):
        x, y = ax.lines[-1].get_data()
        corners = ax.patches[0].get_path().vertices
        top = [corners[corners[:, 0] == each, 1].max() for each in x]
        error = fit.response_errors(x)[which][:, 0, 0]
        assert_allclose(top, y + 1.96 * (np.degrees(error) if which else error), rtol=1e-9)


@pytest.mark.promise("plots-11")
def test_the_confidence_of_a_model_is_that_of_its_gain_and_what_draws_of_noise_do():
    fit, t = result("fit"), table(1)
    along, across = fit.response_errors([fit.band_hz[0]])
    assert_allclose(along[0], fit.known.edge_gain_error, rtol=1e-6)
    freq = np.array([20.0, 120.0, 500.0])
    along, across = (each[:, 0, 0] for each in fit.response_errors(freq))
    true = t.true_response
    found = []
    for seed in range(60):
        normal = philox(seed).standard_normal((2, *true.shape))
        noisy = true + t.standard_error * (normal[0] + 1j * normal[1]) / math.sqrt(2.0)
        found.append(
            fit_frequency_response(t.freq_hz, noisy, t.order, standard_error=t.standard_error).response(freq)[:, 0, 0]
        )
    values = np.array(found)
    mean = values.mean(axis=0)
    # Sixty draws give a standard deviation to 1 / sqrt(2 x 60) = 9 %; three times that and a little more.
    assert_allclose(np.std(np.abs(values), axis=0, ddof=1), along, rtol=0.3)
    assert_allclose(np.std(np.angle(values / mean), axis=0, ddof=1), across, rtol=0.3)


@pytest.mark.promise("plots-11")
def test_a_bode_plot_of_a_measured_response_has_its_confidence():
    found = result("response")
    size, _ = plots.plot_bode(found)
    corners = size.patches[0].get_path().vertices
    top = np.abs(found.response[:, 0, 0]) + 1.96 / math.sqrt(2.0) * found.standard_error[:, 0, 0]
    assert np.isin(top, corners[:, 1]).all()
    assert size.get_ylabel() == "gain (output/input)"


@pytest.mark.promise("plots-11")
def test_the_band_of_an_identification_is_that_of_its_measured_response():
    of = result("identification").linear.response
    size, _ = plots.plot_bode(result("identification"))
    corners = size.patches[0].get_path().vertices
    top = 1e6 * (np.abs(of.response[:, 0, 0]) + 1.96 / math.sqrt(2.0) * of.standard_error[:, 0, 0])
    found = [corners[corners[:, 0] == each, 1].max() for each in of.freq_hz]
    assert_allclose(found, top, rtol=1e-9)


def test_a_bode_plot_of_an_identification_has_the_model_where_the_measured_points_less_their_residual_are():
    found = result("identification")
    of = found.linear
    size, _ = plots.plot_bode(found)
    (model,) = [line for line in size.lines if "linear model" in str(line.get_label())]
    drawn = np.interp(of.response.freq_hz, *model.get_data())
    here, beyond = (np.abs(1e6 * (of.response.response + sign * of.residual)[:, 0, 0]) for sign in (-1.0, 1.0))
    assert_allclose(drawn, here, rtol=1e-3)
    assert np.max(np.abs(drawn / beyond - 1.0)) > 0.01


@pytest.mark.promise("plots-2")
def test_loops_show_what_a_line_leaves():
    loop = result("loop")
    left, right = plots.plot_loops(loop)
    assert_allclose(left.lines[0].get_ydata(), 1e3 * loop.output_rad)
    rest = right.lines[0].get_ydata()
    assert abs(rest.mean()) < 1e-9 * np.ptp(rest) and abs(rest @ loop.drive_v) < 1e-6 * np.ptp(rest)
    assert 0.0 < np.ptp(rest) < np.ptp(1e6 * loop.output_rad)
    several = plots.plot_loops([loop, loop])
    assert len(several[0].lines) == 2 and len(left.lines) == 1


@pytest.mark.promise("plots-3")
def test_loops_have_their_drive_in_volts_and_the_loop_of_an_inverse_has_it_in_radians():
    model = PrandtlIshlinskii((0.0, 1.0), (40e-6, 6e-6))
    loop, back = model.loop(5.0, freq_hz=1.0), model.inverted().loop(200e-6, freq_hz=1.0)
    for left, right in (plots.plot_loops(loop), plots.plot_loops(back)):
        assert left.get_xlabel() == right.get_xlabel() == "drive about the bias (V)"
        assert (left.get_ylabel(), right.get_ylabel()) == ("output (mrad)", "output less line (µrad)")
    assert_allclose(back.drive_v.max(), 200e-6)  # radians, where the label says volts
    wanted = np.concatenate([np.linspace(0.0, end, 400) for end in (200e-6,)] + [back.drive_v])
    assert 4.0 < model.inverse(wanted, 1e-3).max() < 6.0


@pytest.mark.promise("plots-2")
def test_a_spectrum_gathers_to_the_rms():
    found = result("runs")
    left, right = plots.plot_spectrum(found)
    assert left.get_ylabel().endswith("(µrad²/Hz)") and len(left.lines) == 2
    for axis, line in enumerate(right.lines):
        assert_allclose(line.get_ydata()[-1], 1e6 * found.axis_rms_rad[axis], rtol=0.2)  # a few segments of them
    shaken_, still = result("vibration"), shaken()
    _, right = plots.plot_spectrum(shaken_)
    line = right.lines[0]
    assert_allclose(line.get_ydata()[-1], 1e6 * shaken_.rms_rad, rtol=1e-3)
    x, y = line.get_data()
    jump = y[x > 40.0][0] ** 2 - y[x < 40.0][-1] ** 2
    assert 2.0 < jump < 2.1  # half of the square of 2 µrad, and what the filter adds
    left, _ = plots.plot_spectrum(still)
    assert len(left.lines) == 1 and len(plots.plot_spectrum(shaken_)[0].lines) == 3


def test_the_error_of_a_sine_has_its_steady_part_shaded():
    found = result("sine")
    ax = plots.plot_residual(found)
    assert_array_equal(ax.lines[0].get_ydata(), 1e6 * found.trace.error_rad[:, 0])
    assert len(ax.patches) == 1 and not plots.plot_residual(result("run")).patches


def test_the_rms_in_the_legend_is_that_of_the_steady_part():
    """An error of 10 µrad that has settled to 3 µrad for the second half of the time."""
    error_rad = np.where(np.arange(100) < 50, 10e-6, 3e-6)[:, None]
    sheet = plots._errors(np.arange(100) / 100.0, error_rad, slice(50, None))
    (line,) = (each for panel in sheet.panels for each in panel.all_of(Line))
    assert line.label == "axis 1: rms 3.00 µrad"


def test_the_residual_of_a_study_is_marked_on_its_map_and_there_is_none_of_links():
    labels = [
        [text.get_text() for text in plots.plot_margin_map(result(name)).get_legend().get_texts()]
        for name in ("study", "links")
    ]
    assert labels[0][:-1] == labels[1]
    assert labels[0][-1].startswith("simulated residual: ")


def test_the_contacts_of_a_day_have_a_row_a_way():
    day = result("day")
    names = [text.get_text() for text in plots.plot_contacts(day).get_yticklabels()]
    assert names[0] == day.relay.name and any(name.startswith("direct: ") for name in names) and len(names) > 2
    ax = plots.plot_contacts(day.relay.contacts[:3])
    assert [text.get_text() for text in ax.get_yticklabels()] == ["contacts"]
    assert_allclose(
        [patch.get_width() for patch in ax.patches], [each.duration_s / 3600 for each in day.relay.contacts[:3]]
    )


# ----------------------------------------------------------------------------------------------------- axes in and out
def test_axes_that_move_together_have_ticks_and_titles_at_the_outer_ones_only():
    fit = result("fit")
    size, phase = plots.plot_bode(fit)
    assert (size.get_xlabel(), phase.get_xlabel()) == ("", "frequency (Hz)")
    assert not any(text.get_visible() and text.get_text() for text in size.get_xticklabels())
    _, apart = pyplot.subplots(2)
    assert [ax.get_xlabel() for ax in plots.plot_bode(fit, axes=apart)] == ["frequency (Hz)"] * 2
    _, together = pyplot.subplots(2, sharex=True)
    assert [ax.get_xlabel() for ax in plots.plot_bode(fit, axes=list(together))] == ["", "frequency (Hz)"]


@pytest.mark.promise("plots-7")
def test_a_second_result_on_the_same_axes_hides_nothing_of_the_first():
    slow, fast = shaken(SpectralLine(URAD, 0.5)), shaken(SpectralLine(URAD, 500.0))
    alone = [ax.get_xlim() for ax in (plots.plot_spectrum(slow)[0], plots.plot_spectrum(fast)[0])]
    both = plots.plot_spectrum(fast, axes=plots.plot_spectrum(slow))
    assert both[0].get_xlim() == (min(low for low, _ in alone), max(high for _, high in alone))
    assert alone[0] != alone[1] and len(both[0].lines) == 4
    again = plots.plot_spectrum(slow, axes=plots.plot_spectrum(fast))
    assert again[0].get_xlim() == both[0].get_xlim()
    t = table(1)
    larger = fit_frequency_response(t.freq_hz, 1e3 * t.response, t.order)
    size, _ = plots.plot_bode(larger, axes=plots.plot_bode(result("fit")))
    low, high = size.get_ylim()
    assert low < np.abs(t.response).min() and high > 1e3 * np.abs(t.response).max()


def test_limits_that_the_sheet_does_not_set_stay_as_matplotlib_has_them():
    sine = result("sine")
    ax = plots.plot_residual(sine)
    ax.plot([0.0, 1.0], [0.0, 1000.0])
    assert ax.get_xlim()[1] > 1.0 and ax.get_ylim()[1] > 1000.0
    _, given = pyplot.subplots()
    given.set_xlim(0.0, 0.1)
    plots.plot_residual(sine, axes=given)
    assert given.get_xlim() == (0.0, 0.1)
    plots.plot_residual(sine, axes=given)
    assert given.get_xlim()[1] > sine.trace.time_s[-1]


@pytest.mark.promise("plots-6")
def test_long_titles_are_broken_where_axes_are_small_and_long_legends_stand_above():
    _, small = pyplot.subplots(2, figsize=(3.5, 3.0), layout="constrained")
    plots.plot_spectrum(result("vibration"), axes=small)
    assert "\n" in small[1].get_ylabel() and "\n" not in plots.plot_bode(result("fit"))[0].get_ylabel()
    figure, ax = pyplot.subplots(figsize=(3.5, 3.0), layout="constrained")
    plots.plot_margin_map(result("study"), axes=ax)
    figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y0 > ax.get_window_extent().y1 - 1.0
    wide = plots.plot_margin_map(result("study"))
    wide.figure.canvas.draw()
    assert wide.get_legend().get_window_extent().y1 < wide.get_window_extent().y1


@pytest.mark.promise("plots-6")
def test_letters_have_the_size_that_is_set():
    for size in (6.0, 13.0):
        with mpl.rc_context({"font.size": size, "axes.labelsize": "medium", "xtick.labelsize": "medium"}):
            ax = plots.plot_contacts(result("day"))
            assert {ax.xaxis.label.get_size(), ax.get_xticklabels()[0].get_size()} == {size}


@pytest.mark.promise("plots-9")
def test_a_colour_bar_takes_its_room_from_the_axes_that_it_belongs_to():
    figure, (one, other) = pyplot.subplots(1, 2)
    before = [ax.get_position().width for ax in (one, other)]
    plots.plot_margin_map(result("study"), axes=one)
    assert one.get_position().width < 0.95 * before[0]
    assert other.get_position().width == before[1]
    assert figure.axes[2].get_position().x1 <= other.get_position().x0


@pytest.mark.promise("plots-8")
def test_a_legend_of_several_panels_stands_above_a_new_figure_and_in_the_first_of_given_axes():
    new = plots.plot_loops(result("identification"))
    figure = new[0].figure
    figure.canvas.draw()
    (legend,) = figure.legends
    assert legend.get_window_extent().y0 > max(ax.get_window_extent().y1 for ax in new)
    _, given = pyplot.subplots(new.size, 1)
    first, *others = plots.plot_loops(result("identification"), axes=given)
    assert [text.get_text() for text in first.get_legend().get_texts()] == [t.get_text() for t in legend.get_texts()]
    assert all(ax.get_legend() is None for ax in others)


def test_a_figure_is_drawn_with_the_words_as_they_are():
    ax = plots.plot_residual(result("identification"))
    assert "$" in ax.get_title()
    ax.figure.canvas.draw()
    assert not ax.title.get_parse_math()


# --------------------------------------------------------------------------------------------------------------- marks
def test_every_kind_of_mark_is_drawn():
    assert renderer._MAKERS.keys() == svg._MAKERS.keys() == interactive._MAKERS.keys()
    sheet, (panel, other) = grid(6.0, 4.0, 1, 2)
    sheet.heading, sheet.legend = "a heading", Legend("below", 2)
    x, arms = np.arange(4.0), np.full((2, 4), 0.1)
    ring = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    panel.add(
        Line(x, x, "#0072B2", (2.0, 1.0), marker="o", every=[1], x_arms=arms, y_arms=arms, label="a line"),
        Line(x, x + 1.0, steps=True),
        Rule(1.0, False, label="a rule"),
        Span(-math.inf, 1.0, True, "#56B4E9", label="a span"),
        Area((ring, ring[::-1] / 2.0), "#000000", label="an area", edge="#000000"),
        Area((ring,), "#000000", hatched=True),
        Bars(x, 0.0 * x, x, np.full(4, 0.5), "#E69F00", upright=True, label="bars"),
        Words("$words", 0.5, 0.5, of_panel="xy", box=True),
    )
    panel.face, panel.equal, panel.title = "#eeeeee", True, "a $title"
    panel.x = Axis("x (m)", low=-1.0, high=5.0, ticks={0.0: "none", 4.0: "four$"})
    other.add(Field(x, x, np.add.outer(x, x), 0.0, 6.0, "a bar (dB)"), Bars(x, x, x + 1.0, x + 0.5, "#E69F00"))
    other.x, other.y = Axis("x (s)", log=True, low=0.0, ticks=(1.0, 2.0)), Axis("y (s)", ticks=())
    drawn = axes_of(sheet)
    first, second = drawn
    first.figure.canvas.draw()
    assert [text.get_text() for text in first.get_xticklabels()] == ["none", "four$"]
    assert first.get_xlim() == (-1.0, 5.0) and first.get_aspect() == 1.0
    span = next(patch for patch in first.patches if patch.get_label() == "a span")
    assert span.get_x() == -1.0
    assert len(first.figure.axes) == 3 and first.figure.axes[2].get_ylabel() == "a bar (dB)"
    (legend,) = first.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a line", "a rule", "a span", "an area", "bars"]
    assert first.figure.get_suptitle() == "a heading"
    assert [text.get_text() for text in second.get_xticklabels()] == ["1", "2"]
    assert not second.get_yticks().size


@pytest.mark.parametrize(("anchor", "part"), [("start", 0.0), ("middle", 0.5), ("end", 1.0)])
def test_the_box_of_a_text_lies_behind_it_whichever_side_stands_at_its_place(anchor, part):
    sheet, (panel,) = grid(6.0, 4.0, 1, 1)
    panel.add(Words("a relay", 0.5, 0.5, of_panel="xy", anchor=anchor, box=True))
    drawn = svg.svg_of(sheet)
    left, wide = map(float, re.search(r'<rect x="(\S+)" y="\S+" width="(\S+)" \S+ \S+ fill-opacity', drawn).groups())
    place, words = re.search(r'<text x="(\S+)" ([^>]*)>a relay<', drawn).groups()
    assert ("text-anchor" in words, wide > 10.0) == (anchor != "start", True)
    assert left + part * wide == pytest.approx(float(place), abs=0.02)


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.promise("plots-4")
@pytest.mark.parametrize(
    "plot",
    ["bode", "loops", "residual", "spectrum", "pointing_errors", "contributions", "margin_map", "contacts"],
)
def test_another_result_is_refused_with_what_can_be_plotted(plot):
    name = f"plot_{plot}"
    taken = {each for other, each, _ in PLOTS if other == name}
    with pytest.raises(TypeError, match=f"{name}: cannot plot what is of type str; give one of these: ") as told:
        getattr(plots, name)("what")
    kinds = {type(result(each)).__name__ for each in taken} - {"tuple"}
    assert kinds <= set(re.findall(r"\w+", str(told.value)))
    assert not pyplot.get_fignums()


def test_of_several_results_none_may_be_another_or_missing():
    with pytest.raises(ValueError, match="plot_contacts: the sequence is empty; give one Contact or more"):
        plots.plot_contacts([])
    with pytest.raises(
        TypeError, match="plot_loops: cannot plot what is of type int; give one of these: HysteresisLoop, Ident"
    ):
        plots.plot_loops([result("loop"), 3])
    assert not pyplot.get_fignums()


def test_axes_that_do_not_fit_are_refused():
    fit, (figure, (one, other, third)) = result("fit"), pyplot.subplots(3)
    with pytest.raises(ValueError, match=r"1 given, and there are 2 panels to draw \(gain \(output/input\), phase"):
        plots.plot_bode(fit, axes=one)
    with pytest.raises(ValueError, match="3 given, and there are 2 panels"):
        plots.plot_bode(fit, axes=[one, other, third])
    with pytest.raises(TypeError, match=r"a Figure was given; give one matplotlib.axes.Axes for each panel"):
        plots.plot_bode(fit, axes=[one, figure])
    assert not one.has_data() and len(pyplot.get_fignums()) == 1


def test_what_has_nothing_to_show_is_refused():
    with pytest.raises(
        ValueError, match=r"no linear part; give identify_mirror a broadband recording .* such as models"
    ):
        plots.plot_bode(identified(False))
    found = result("runs")
    with pytest.raises(ValueError, match="made without a spectrum; simulate them from run 0 on, as a Case with"):
        plots.plot_spectrum(replace(found, psd_rad2_hz=np.full_like(found.psd_rad2_hz, math.nan)))
    nothing = Disturbance("calm", np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), (), "assumed", "a test")
    with pytest.raises(ValueError, match='"calm" has neither a filter nor lines'):
        plots.plot_spectrum(nothing)
    still = replace(result("budget"), spectra={})
    with pytest.raises(ValueError, match="no source of this budget has a spectrum"):
        plots.plot_spectrum(still)
    with pytest.raises(ValueError, match=r"the study has no budget of pointing errors: .* no table \[error_budget\]"):
        plots.plot_contributions(plain_study())
    with pytest.raises(ValueError, match="there is nothing to plot: no contact"):
        axes_of(empty("no contact"))


@pytest.mark.promise("plots-1")
@pytest.mark.promise("readme-22")
def test_without_matplotlib_one_sentence_says_how_to_install_it(monkeypatch):
    fit = result("fit")
    for name in [each for each in sys.modules if each.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError) as told:
        plots.plot_bode(fit)
    assert str(told.value) == (
        "matplotlib is not installed, and plots are drawn with it: install it in the project's folder: pip install "
        "--constraint constraints.txt '.[plot]'"
    )


def test_what_plots_is_read_where_there_is_no_matplotlib(monkeypatch):
    """The one module that may ask for it, as a contract of imports has it, and the one that is imported to plot."""
    for name in [each for each in sys.modules if each.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    for module in (renderer, plots):
        anew = module_from_spec(module.__spec__)
        module.__spec__.loader.exec_module(anew)
        assert anew.__doc__ == module.__doc__


@pytest.mark.endurance
def test_matplotlib_is_loaded_when_something_is_drawn():
    code = "import sys, microrad.report.plots; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
    assert "matplotlib" in sys.modules


# ------------------------------------------------------------------------------------------------------------ the page
def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"(?ms)^```python\n(.*?)^```", PAGE)
    names = {}
    for block in blocks:
        exec(block, names)
    assert len(blocks) >= 2
    assert {path.name for path in tmp_path.iterdir()} == set(re.findall(r'savefig\("([^"]+)"', PAGE))


TITLES = {
    ("plot_bode", "fit"): [("", "gain (output/input)"), ("frequency (Hz)", "phase (°)")],
    ("plot_loops", "loop"): [
        ("drive about the bias (V)", "output (mrad)"),
        ("drive about the bias (V)", "output less line (µrad)"),
    ],
    ("plot_residual", "run"): [("time (s)", "pointing error (µrad)")],
    ("plot_residual", "fit"): [("frequency (Hz)", "size (output/input)")],
    ("plot_spectrum", "vibration"): [
        ("frequency (Hz)", "spectrum of one axis (µrad²/Hz)"),
        ("frequency (Hz)", "rms below that frequency, one axis (µrad)"),
    ],
    ("plot_spectrum", "budget"): [
        ("", "spectrum, all axes (µrad²/Hz)"),
        ("frequency (Hz)", "weight of the window (1)"),
    ],
    ("plot_pointing_errors", "budget"): [
        ("radial error (µrad)", "larger errors (%)"),
        ("error about y (µrad)", "larger errors (%)"),
    ],
    ("plot_contributions", "budget"): [("contribution (µrad)", "")] * 2,
    ("plot_margin_map", "links"): [("data rate (Mbit/s)", "pointing error (µrad)")],
    ("plot_contacts", "contacts"): [("hours since the epoch", "")],
}


@pytest.mark.promise("plots-2")
def test_the_table_of_the_page_has_what_each_function_takes_and_draws():
    rows = re.findall(r"^\| `(plot_\w+)` \| (.+) \| (.+) \|$", PAGE, re.MULTILINE)
    for function, taken, _ in rows:
        kinds = set()
        for plot, name, _ in PLOTS:
            several = result(name) if plot == function else ()
            kinds |= {type(each).__name__ for each in (several if isinstance(several, tuple) else [several])}
        assert kinds == set(re.findall(r"`(\w+)`", taken)), function
    for (plot, name), titles in TITLES.items():
        drawn = listed(getattr(plots, plot)(result(name)))
        assert [(one_line(ax.get_xlabel()), one_line(ax.get_ylabel())) for ax in drawn] == titles, plot


def test_the_page_names_each_function():
    functions = {name for name in vars(plots) if name.startswith("plot_")}
    assert set(re.findall(r"`(plot_\w+)`", PAGE)) == functions == {plot for plot, _, _ in PLOTS}


# --------------------------------------------------------------------------------------------- sheets, line by line
def test_loops_of_two_frequencies_are_drawn_less_each_its_own_line():
    drive = np.array([-2.0, 0.0, 2.0, 1.0])
    loops = [
        SimpleNamespace(drive_v=drive, output_rad=1e-4 * np.array([-3.0, 1.0, 5.0, 2.0]), freq_hz=0.5),
        SimpleNamespace(drive_v=2.0 * drive, output_rad=1e-4 * np.array([-7.0, -1.0, 6.0, 5.0]), freq_hz=25.0),
    ]
    assert lines_of(plots._loops(loops)) == [
        "Sheet width=7.4 height=3.6 widths=[1 1]",
        "Panel 0 0 x=<title=drive about the bias (V)> y=<title=output (mrad)> legend=<>",
        "Line x=[-2 0 2 1] y=[-0.3 0.1 0.5 0.2] label=0.5 Hz",
        "Line x=[-4 0 4 2] y=[-0.7 -0.1 0.6 0.5] colour=#0072B2 dash=-- label=25 Hz",
        "Panel 0 1 x=<title=drive about the bias (V)> y=<title=output less line (µrad)>",
        "Line x=[-2 0 2 1] y=[5.71429 22.8571 40 -68.5714] name=0.5 Hz",
        "Line x=[-4 0 4 2] y=[2.85714 -88.5714 -80 165.714] colour=#0072B2 dash=-- name=25 Hz",
    ]


def test_errors_of_two_axes_have_the_rms_of_their_steady_part():
    error = np.array([[9e-6, 1e-6], [3e-6, -2e-6], [-4e-6, 2e-6], [5e-6, -1e-6]])
    assert lines_of(plots._errors(np.array([0.0, 0.5, 1.0, 1.5]), error, slice(1, 3))) == [
        "Sheet width=6.4 height=3.4",
        ("Panel 0 0 x=<title=time (s)> y=<title=pointing error (µrad)> legend=<place=above columns=3>"),
        "Span low=0.5 high=1 upright=True colour=#56B4E9 opacity=0.25 label=steady part",
        "Line x=[0 0.5 1 1.5] y=[9 3 -4 5] colour=#0072B2 width=0.8 label=axis 1: rms 3.54 µrad",
        ("Line x=[0 0.5 1 1.5] y=[1 -2 2 -1] colour=#D55E00 dash=-- width=0.8 label=axis 2: rms 2.00 µrad"),
    ]


def test_spectra_of_two_axes_are_drawn_without_their_first_and_last_line():
    freq = np.arange(6.0) * 2.0
    density = np.array([[9e9, 9e9], [4e-12, 1e-12], [2e-12, 8e-12], [1e-12, 4e-12], [5e-13, 2e-12], [9e9, 9e9]])
    assert lines_of(plots._left_spectrum(SimpleNamespace(freq_hz=freq, psd_rad2_hz=density))) == [
        "Sheet width=7.6 height=4.3 widths=[1.45 1] legend=<place=above columns=3>",
        "Panel 0 0 x=<title=frequency (Hz) log=True low=2 high=8> y=<title=spectrum of one axis",
        "  (µrad²/Hz) log=True>",
        "Line x=[2 4 6 8] y=[4 2 1 0.5] colour=#0072B2 label=axis 1",
        "Line x=[2 4 6 8] y=[1 8 4 2] colour=#D55E00 dash=-- label=axis 2",
        ("Panel 0 1 x=<title=frequency (Hz) log=True low=2 high=8> y=<title=rms below that frequency, one"),
        "  axis (µrad) low=0>",
        "Line x=[2 4 6 8] y=[2.82843 3.4641 3.74166 3.87298] colour=#0072B2 name=axis 1",
        "Line x=[2 4 6 8] y=[1.41421 4.24264 5.09902 5.47723] colour=#D55E00 dash=-- name=axis 2",
    ]


def test_responses_of_two_outputs_and_one_input_have_titles_and_units_of_their_own():
    value = np.array([1.0, -2.0j, -0.5])[:, None, None] * np.array([[1.0], [4.0]])
    found = SimpleNamespace(
        freq_hz=np.array([1.0, 10.0, 100.0]),
        response=value,
        standard_error=0.1 * np.abs(value),
        output_names=("tip", "tilt"),
        input_names=("piezo",),
    )
    assert lines_of(plots._measured_bode(found)) == [
        "Sheet width=6.4 height=9.2 heights=[1.4 1 1.4 1] share_x=True",
        ("Panel 0 0 x=<log=True> y=<title=gain (output/input) log=True> title=tip from piezo legend=<>"),
        ("Area rings=[[[1 0.861407] [10 1.72281] [100 0.430704] [100 0.569296] [10 2.27719] [1 1.13859]]]"),
        "  colour=#56B4E9 opacity=0.6 label=95 % confidence",
        "Line x=[1 10 100] y=[1 2 0.5] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Panel 1 0 x=<title=frequency (Hz) log=True> y=<title=phase (°) low=-200 high=20>",
        "Area rings=[[[1 -7.96643] [10 -97.9664] [100 -187.966] [100 -172.034] [10 -82.0336] [1",
        "  7.96643]]] colour=#56B4E9 opacity=0.6",
        "Line x=[1 10 100] y=[0 -90 -180] colour=#0072B2 dash= marker=. size=4.5",
        "Panel 2 0 x=<log=True> y=<title=gain (output/input) log=True> title=tilt from piezo",
        ("Area rings=[[[1 3.44563] [10 6.89126] [100 1.72281] [100 2.27719] [10 9.10874] [1 4.55437]]]"),
        "  colour=#56B4E9 opacity=0.6 label=95 % confidence",
        "Line x=[1 10 100] y=[4 8 2] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Panel 3 0 x=<title=frequency (Hz) log=True> y=<title=phase (°) low=-200 high=20>",
        "Area rings=[[[1 -7.96643] [10 -97.9664] [100 -187.966] [100 -172.034] [10 -82.0336] [1",
        "  7.96643]]] colour=#56B4E9 opacity=0.6",
        "Line x=[1 10 100] y=[0 -90 -180] colour=#0072B2 dash= marker=. size=4.5",
    ]


def test_residuals_of_a_table_leave_out_its_value_at_rest():
    model = np.array([1.0, 2.0, 4.0])[:, None, None] * np.array([[1.0, 3.0]])
    fit = SimpleNamespace(freq_hz=np.array([0.0, 2.0, 8.0]), residual=0.125 * model, response=lambda freq: model)
    assert lines_of(plots._fit_residual(fit)) == [
        "Sheet width=6.8 height=3 widths=[1 1] share_x=True",
        ("Panel 0 0 x=<title=frequency (Hz) log=True> y=<title=size (output/input) log=True> title=output"),
        "  1 from input 1 legend=<>",
        "Line x=[2 8] y=[2.25 4.5] colour=#0072B2 dash= label=table marker=. size=4.5",
        "Line x=[2 8] y=[0.25 0.5] colour=#E69F00 dash= label=table less model marker=. size=4.5",
        ("Panel 0 1 x=<title=frequency (Hz) log=True> y=<title=size (output/input) log=True> title=output"),
        "  1 from input 2",
        "Line x=[2 8] y=[6.75 13.5] colour=#0072B2 dash= label=table marker=. size=4.5",
        "Line x=[2 8] y=[0.75 1.5] colour=#E69F00 dash= label=table less model marker=. size=4.5",
    ]


def test_contacts_are_drawn_from_the_first_rise_to_the_last_set():
    contacts = [SimpleNamespace(start_s=s, end_s=e) for s, e in ((7200.0, 9000.0), (3600.0, 12600.0), (100.0, 200.0))]
    assert lines_of(plots._contacts(contacts)) == [
        "Sheet width=7.6 height=1.07",
        ("Panel 0 0 x=<title=hours since the epoch low=0.0277778 high=3.5 ticks=[0.5 1 1.5 2 2.5 3 3.5]>"),
        "  y=<low=0.6 high=-0.6 ticks={0: contacts} grid=False>",
        "Bars at=[0 0 0] start=[2 1 0.0277778] end=[2.5 3.5 0.0555556] breadth=[0.68 0.68 0.68]",
        "  colour=#0072B2 edge=#0072B2",
        "Words text=3 · 3.03 h x=1 y=0 size=9 shift=[5 0] of_panel=x",
    ]


@pytest.mark.parametrize(
    ("given", "now", "before", "found"),
    [
        ((None, None), (1.0, 2.0), None, None),
        ((0.5, None), (1.0, 2.0), None, (0.5, 2.0)),
        ((None, None), (1.0, 2.0), (1.5, 9.0), (1.0, 9.0)),
        ((3.0, 4.0), (1.0, 2.0), (3.5, 3.75), (3.0, 4.0)),
        ((4.0, 3.0), (1.0, 2.0), (0.0, 9.0), (4.0, 3.0)),
        ((3.0, 4.0), (1.0, 2.0), (9.0, 0.0), (3.0, 4.0)),
    ],
)
def test_limits_are_widened_to_those_of_what_was_there_before(given, now, before, found):
    assert renderer._ends(Axis(low=given[0], high=given[1]), now, before) == found


def test_a_logarithmic_axis_takes_no_limit_that_is_not_positive():
    assert renderer._ends(Axis(log=True, low=0.0, high=7.0), (1.0, 2.0), None) == (1.0, 7.0)
    assert renderer._ends(Axis(log=True, low=-1.0), (1.0, 2.0), None) is None


# ----------------------------------------------------------------------------------------------- artists, one by one
def hue(colour):
    return "none" if to_hex(colour, keep_alpha=True)[7:] == "00" else to_hex(colour)


def artists(ax):
    """What stands in axes, artist by artist, each in a line of words."""
    found = [f"{ax.get_xlabel()}; {ax.get_ylabel()}; {ax.get_title()}; {hue(ax.get_facecolor())}"]
    for line in ax.lines:
        marker = (line.get_marker(), f"{line.get_markersize():g}", hue(line.get_markerfacecolor()))
        marker += (hue(line.get_markeredgecolor()), f"{line.get_markeredgewidth():g}", line.get_markevery())
        look = (line.get_linestyle(), f"{line.get_linewidth():g}", line.get_drawstyle(), line.get_clip_on())
        found.append(" ".join(map(str, ("line", line.get_label(), hue(line.get_color()), *look, *marker))))
    for one in ax.patches:
        look = hue(one.get_facecolor()), hue(one.get_edgecolor()), f"{one.get_linewidth():g}", one.get_alpha()
        found.append(" ".join(map(str, (type(one).__name__, one.get_label(), *look, one.get_hatch()))))
    for text in ax.texts:
        box = text.get_bbox_patch()
        look = hue(text.get_color()), text.get_ha(), text.get_va(), box and (hue(box.get_facecolor()), box.get_alpha())
        found.append(" ".join(map(str, (text.get_text(), text.xy, text.get_position(), text.xycoords, *look))))
    return found


def test_each_artist_has_the_look_of_its_mark():
    sheet, (panel, other) = grid(6.0, 4.0, 1, 2)
    x, ring = np.array([1.0, 3.0, 4.0]), np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 3.0]])
    arms, wide = np.array([[0.5, 0.25, 0.0], [1.0, 2.0, 0.75]]), np.array([0.4, 0.8])
    bars = np.array([1.0, 2.0]), np.array([0.5, -1.0]), np.array([2.5, 1.0]), wide
    dashes = (3.0, 1.0)
    panel.add(
        Line(x, x - 2.0, "#d55e00", dashes, 1.7, "a", "", "D", 5.0, "", "#009e73", 0.6, (0, 2)),
        Line(x, x * 2.0, "#56b4e9", "", label="b", marker=".", size=3.0, clip=False, x_arms=arms, y_arms=2.0 * arms),
        Line(x, x, "#0072b2", ":", 0.9, name="c", steps=True, marker="s", face="#e69f00"),
        Rule(2.5, True, "#777777", "-.", 0.7, "d"),
        Rule(-1.5, False, "#cc79a7", "--", 1.4, "e"),
        Span(0.5, 1.5, False, "#009e73", 0.35, "f"),
        Span(2.0, math.inf, True, "#56b4e9", 0.2),
        Area((ring,), "#e69f00", 0.6, "g", "#0072b2", 0.9),
        Area((ring, ring[:2]), "#000000", label="h", hatched=True),
        Area((ring[:2],), "#000000", label="of two points"),
        Bars(*bars, "#777777", False, 0.8, "#000000", "i"),
        Bars(*bars, "#56b4e9", True),
        Words("one", 3.0, 0.25, "#d55e00", 7.0, "end", "top", (3.0, -4.0), "y", True),
        Words("two", 0.5, 2.0, anchor="middle", base="bottom", of_panel="x"),
    )
    panel.x, panel.y = Axis("x (s)", low=0.0), Axis("y (m)", grid=False, ticks=(0.0, 2.0, 4.0))
    panel.face, panel.title, panel.legend = "#eeeeee", "T", Legend("lower left", 2, "Key", "#ffffff")
    other.add(Line(x, x, label="z"))
    other.legend = Legend("right", 3)
    first, second = axes_of(sheet)
    assert artists(first) == [
        "x (s); y (m); T; #eeeeee",
        "line a #d55e00 -- 1.7 default True D 5 none #009e73 0.6 [0, 2]",
        "line b #56b4e9 None 1.3 default False . 3 #56b4e9 #56b4e9 0 None",
        *["line _nolegend_ #1f77b4 None 1.5 default True | 6 #1f77b4 #56b4e9 1 None"] * 2,
        *["line _nolegend_ #1f77b4 None 1.5 default True _ 6 #1f77b4 #56b4e9 1 None"] * 2,
        "line _child8 #0072b2 : 0.9 steps-post True s 6 #e69f00 #0072b2 1 None",
        "line d #777777 -. 0.7 default True None 6 #777777 #777777 1 None",
        "line e #cc79a7 -- 1.4 default True None 6 #cc79a7 #cc79a7 1 None",
        "Rectangle f #009e73 none 1 0.35 None",
        "Rectangle None #56b4e9 none 1 0.2 None",
        "PathPatch g #e69f00 #0072b2 0.9 0.6 None",
        "PathPatch h none #000000 0 None ////",
        *["Rectangle _nolegend_ #777777 #000000 0.5 0.8 None"] * 2,
        *["Rectangle _nolegend_ #56b4e9 none 0.5 1.0 None"] * 2,
        "one (3.0, 0.25) (3.0, -4.0) ('data', 'axes fraction') #d55e00 right top ('#ffffff', 0.75)",
        "two (0.5, 2.0) (0.0, 0.0) ('axes fraction', 'data') #000000 center bottom None",
    ]
    lying, upright = (each.patches for each in first.containers[1:])
    assert_allclose([each.get_bbox().extents for each in lying], [[0.5, 0.8, 2.5, 1.2], [-1.0, 1.6, 1.0, 2.4]])
    assert_allclose([each.get_bbox().extents for each in upright], [[0.8, 0.5, 1.2, 2.5], [1.6, -1.0, 2.4, 1.0]])
    arms_across, arms_up = (each.get_segments() for each in first.collections)
    assert_allclose(arms_across, [[[0.5, 2.0], [2.0, 2.0]], [[2.75, 6.0], [5.0, 6.0]], [[4.0, 8.0], [4.75, 8.0]]])
    assert_allclose(arms_up, [[[1.0, 1.0], [1.0, 4.0]], [[3.0, 5.5], [3.0, 10.0]], [[4.0, 8.0], [4.0, 9.5]]])
    legend = first.get_legend()
    assert "".join(text.get_text() for text in legend.get_texts()) == "abdefghi"
    assert [legend.get_title().get_text(), legend._ncols, legend._loc] == ["Key", 2, 3]
    assert [hue(legend.get_frame().get_facecolor()), legend.get_frame().get_alpha()] == ["#32436d", 1.0]
    assert {hue(text.get_color()) for text in legend.get_texts()} == {"#ffffff"}
    assert [each.get_markersize() for each in legend.legend_handles if hasattr(each, "get_markersize")] == [5, 7, 6, 6]
    assert [first.xaxis.get_gridlines()[0].get_visible(), first.yaxis.get_gridlines()[0].get_visible()] == [True, False]
    assert (first.get_xlim()[0], first.get_yticks().tolist(), first.get_axisbelow()) == (0.0, [0.0, 2.0, 4.0], True)
    plain = second.get_legend()
    assert [plain._loc, plain._ncols, hue(plain.get_frame().get_facecolor())] == [0, 1, "#ffffff"]
    assert artists(second)[1:] == ["line z #000000 - 1.3 default True None 6 #000000 #000000 1 None"]


def grown(freq, scale=1.0):
    """Two outputs and an input, unlike in gain and in phase at each frequency."""
    return scale * (1.0 + np.atleast_1d(freq))[:, None, None] * np.array([[[2.0], [-3.0j]]])


def test_a_fit_of_two_outputs_has_its_table_its_model_and_their_bands_panel_by_panel(monkeypatch):
    monkeypatch.setattr(plots, "_FINE", 2)
    freq = np.array([0.0, 2.0, 8.0])
    fit = SimpleNamespace(
        freq_hz=freq,
        residual=grown(freq, 0.5),
        response=grown,
        response_errors=lambda at: (np.abs(grown(at, 0.1)), np.abs(grown(at, 0.05))),
        order=3,
    )
    assert lines_of(plots._fit_bode(fit)) == [
        "Sheet width=6.4 height=9.2 heights=[1.4 1 1.4 1] share_x=True",
        "Panel 0 0 x=<log=True> y=<title=gain (output/input) log=True low=3> title=output 1 from input 1",
        "  legend=<>",
        "Line x=[2 8] y=[9 27] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Area rings=[[[2 4.824] [8 14.472] [8 21.528] [2 7.176]]] colour=#D55E00 opacity=0.3 label=95 %",
        "  confidence of the model",
        "Line x=[2 8] y=[6 18] colour=#D55E00 dash=-- width=1.4 label=model, order 3",
        "Panel 1 0 x=<title=frequency (Hz) log=True> y=<title=phase (°) low=-20 high=20>",
        "Line x=[2 8] y=[0 0] colour=#0072B2 dash= marker=. size=4.5",
        "Area rings=[[[2 -33.6899] [8 -101.07] [8 101.07] [2 33.6899]]] colour=#D55E00 opacity=0.3",
        "Line x=[2 8] y=[0 0] colour=#D55E00 dash=-- width=1.4",
        "Panel 2 0 x=<log=True> y=<title=gain (output/input) log=True low=4.5> title=output 2 from input",
        "  1",
        "Line x=[2 8] y=[13.5 40.5] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Area rings=[[[2 7.236] [8 21.708] [8 32.292] [2 10.764]]] colour=#D55E00 opacity=0.3 label=95 %",
        "  confidence of the model",
        "Line x=[2 8] y=[9 27] colour=#D55E00 dash=-- width=1.4 label=model, order 3",
        "Panel 3 0 x=<title=frequency (Hz) log=True> y=<title=phase (°) low=-110 high=-70>",
        "Line x=[2 8] y=[-90 -90] colour=#0072B2 dash= marker=. size=4.5",
        "Area rings=[[[2 -140.535] [8 -241.605] [8 61.6046] [2 -39.4651]]] colour=#D55E00 opacity=0.3",
        "Line x=[2 8] y=[-90 -90] colour=#D55E00 dash=-- width=1.4",
    ]


def test_the_linear_part_of_an_identification_is_drawn_in_microradians_a_volt():
    freq = np.array([2.0, 8.0])
    part = {"freq_hz": freq, "response": grown(freq, 1e-6), "standard_error": np.abs(grown(freq, 1e-7))}
    linear = SimpleNamespace(response=SimpleNamespace(**part), residual=grown(freq, 1e-7), order=5)
    assert lines_of(plots._identified_bode(SimpleNamespace(linear=linear))) == [
        "Sheet width=6.4 height=4.6 heights=[1.4 1] share_x=True",
        "Panel 0 0 x=<log=True> y=<title=gain (µrad/V) log=True> legend=<>",
        "Area rings=[[[2 5.16844] [8 15.5053] [8 20.4947] [2 6.83156]]] colour=#56B4E9 opacity=0.6",
        "  label=95 % confidence",
        "Line x=[2 8] y=[6 18] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Line x=[2 8] y=[5.4 16.2] colour=#D55E00 dash=-- width=1.4 label=linear model, order 5",
        "Panel 1 0 x=<title=frequency (Hz) log=True> y=<title=phase (°) low=-20 high=20>",
        "Area rings=[[[2 -7.96643] [8 -7.96643] [8 7.96643] [2 7.96643]]] colour=#56B4E9 opacity=0.6",
        "Line x=[2 8] y=[0 0] colour=#0072B2 dash= marker=. size=4.5",
        "Line x=[2 8] y=[0 0] colour=#D55E00 dash=-- width=1.4",
    ]


def test_a_fifth_axis_looks_like_the_first_and_a_whole_run_has_no_steady_part():
    error = 1e-6 * np.outer([1.0, -2.0, 2.0], [1.0, 10.0, -0.04, 200.0, 3.0])
    (panel,) = plots._errors(np.array([0.0, 1.0, 2.0]), error).panels
    assert [(line.label, line.colour, line.dash) for line in panel.marks] == [
        ("axis 1: rms 1.73 µrad", "#0072B2", "-"),
        ("axis 2: rms 17.3 µrad", "#D55E00", "--"),
        ("axis 3: rms 0.069 µrad", "#009E73", "-."),
        ("axis 4: rms 346 µrad", "#E69F00", ":"),
        ("axis 5: rms 5.20 µrad", "#0072B2", "-"),
    ]


def test_a_spectrum_of_five_axes_goes_on_with_the_look_of_the_first():
    density = 1e-12 * np.outer(np.ones(6), np.arange(1.0, 6.0) ** 2)
    sheet = plots._left_spectrum(SimpleNamespace(freq_hz=np.arange(6.0), psd_rad2_hz=density))
    looks = [("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", "-."), ("#E69F00", ":"), ("#0072B2", "-")]
    assert [[(line.colour, line.dash) for line in panel.marks] for panel in sheet.panels] == [looks] * 2
    assert [line.name for line in sheet.panels[1].marks] == [f"axis {k}" for k in range(1, 6)]
    assert [float(line.y[-1]) for line in sheet.panels[0].marks] == pytest.approx([1.0, 4.0, 9.0, 16.0, 25.0])


def test_loops_beyond_seven_begin_with_the_first_colour_again():
    drive = np.array([-1.0, 0.0, 1.0])
    loops = [SimpleNamespace(drive_v=drive, output_rad=1e-3 * (k + drive), freq_hz=10.0**k) for k in range(9)]
    left, right = plots._loops(loops).panels
    looks = "#000000- #0072B2-- #009E73-. #D55E00: #E69F00- #56B4E9-- #000000-. #0072B2: #009E73-"
    assert " ".join(f"{line.colour}{line.dash}" for line in left.marks) == looks
    assert " ".join(f"{line.colour}{line.dash}" for line in right.marks) == looks
    named = [line.name for line in right.marks]
    assert [line.label for line in left.marks] == named and named[:3] == ["1 Hz", "10 Hz", "100 Hz"]


def test_a_disturbance_is_drawn_about_its_corner_and_its_lines_which_stand_in_its_rms():
    """One pole of 10 rad/s: S = 2 b² / (w² + a²) on one side, b² / (2 a) in all."""
    lines = SpectralLine(2e-6, 40.0), SpectralLine(1e-6, 7.0)
    filtered = np.array([[-10.0]]), np.array([[2e-6]]), np.array([[1.0]])
    sheet = plots._disturbance_spectrum(Disturbance("wheels", *filtered, lines, "assumed", "a test"))
    (density, *rules), (below,) = (panel.marks for panel in sheet.panels)
    assert [(rule.at, rule.upright, rule.colour, rule.dash, rule.label) for rule in rules] == [
        (at, True, "#D55E00", ":", "spectral lines") for at in (40.0, 7.0)
    ]
    assert (density.label, density.name, below.label, below.name) == ("wheels", "", "", "wheels")
    assert {density.colour, below.colour} == {"#0072B2"} and density.dash == below.dash == "-"
    assert density.x[[0, -1]] == pytest.approx([10.0 / (2.0 * np.pi) / 30.0, 1200.0]) and density.x.size == 2000
    assert density.y == pytest.approx(2e12 * 4e-12 / ((2.0 * np.pi * density.x) ** 2 + 100.0))
    assert below.y[-1] == pytest.approx(math.sqrt(4.0 / 20.0 + 4.0 / 2.0 + 1.0 / 2.0), rel=1e-3)


@pytest.mark.parametrize(
    ("text", "room", "lines"),
    [
        ("short", 1000.0, ["short"]),
        ("a long title of axes (µrad)", 60.0, ["a long title", "of axes (µrad)"]),
        ("one line here\nanother longer line there", 50.0, ["one line here", "another longer", "line there"]),
        ("unbreakablelongword here", 10.0, ["unbreakablelongword", "here"]),
    ],
)
def test_a_title_is_broken_between_words_and_at_no_less_than_twelve_letters(text, room, lines):
    assert renderer._broken(text, room, 9.0).split("\n") == lines


def test_a_title_that_just_fits_is_left_as_it_is():
    wide = scales.width_of("two words", 9.0)
    assert renderer._broken("two words", wide, 9.0) == "two words"


@pytest.mark.parametrize(("dash", "style"), [("-", "-"), ("", "None"), ("-.", "-."), ((1.0, 2.0), (0.0, (1.0, 2.0)))])
def test_a_dash_is_one_of_matplotlibs_or_lengths_from_their_begin(dash, style):
    assert renderer._style(dash) == style


@pytest.mark.parametrize(
    ("before", "found"),
    [(None, ((0.5, 8.0), (1.0, 4.0))), ((2.0, 9.0), ((0.5, 9.0), (1.0, 9.0))), ((0.1, 3.0), ((0.1, 8.0), (0.1, 4.0)))],
)
def test_limits_of_the_sheet_are_widened_in_each_direction_where_axes_hold_other_data(before, found):
    sheet, (panel,) = grid(4.0, 3.0)
    panel.add(Line(np.array([1.0, 4.0]), np.array([1.5, 2.5])))
    panel.x, panel.y = Axis("x", low=0.5, high=8.0), Axis("y", low=1.0, high=4.0)
    _, ax = pyplot.subplots()
    if before:
        ax.plot([1.0, 2.0], [1.0, 2.0])
        ax.set(xlim=before, ylim=before)
    assert axes_of(sheet, ax) is ax
    assert (ax.get_xlim(), ax.get_ylim()) == found


def test_a_heading_and_the_legend_of_a_sheet_above_and_below_stand_on_the_figure():
    for place, at in (("below", "lower center"), ("above", "upper center"), ("lower right", "upper center")):
        sheet, panels = grid(5.0, 4.0, 2, 1, share_x=True, share_y=True)
        sheet.heading, sheet.heading_colour, sheet.legend = "A $heading", "#0072b2", Legend(place, 2)
        for k, panel in enumerate(panels):
            panel.add(Line(np.arange(3.0), np.arange(3.0) + k, label=f"l{k}"), Rule(1.0, True, label="both"))
        first, second = axes_of(sheet)
        (legend,) = first.figure.legends
        assert [text.get_text() for text in legend.get_texts()] == ["l0", "both", "l1"]
        assert (legend._loc, legend._ncols, bool(legend._outside_loc)) == (9 if at == "upper center" else 8, 2, True)
        assert first.figure.get_suptitle() == "A $heading" and hue(first.figure._suptitle.get_color()) == "#0072b2"
        assert first.get_shared_x_axes().joined(first, second) and first.get_shared_y_axes().joined(first, second)
        assert tuple(first.figure.get_size_inches()) == (5.0, 4.0)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ([3], "axes: a int was given; give one matplotlib.axes.Axes for each panel"),
        ("one", "axes: 1 given, and there are 3 panels to draw (y over x (m), right (s), named); give as many, or non"),
    ],
)
def test_axes_that_do_not_fit_are_told_with_the_names_of_the_panels(axes, words):
    sheet, (first, second, third) = grid(5.0, 4.0, 1, 3)
    first.x.title, first.y.title, second.y.title, third.title = "x (m)", "y", "right (s)", "named"
    with pytest.raises((TypeError, ValueError), match=re.escape(words)):
        axes_of(sheet, [pyplot.figure().add_subplot()] if axes == "one" else axes)


def test_a_sheet_of_unlike_shares_has_its_panels_over_the_columns_that_they_take():
    sheet = Sheet(6.0, 4.0, (1.0, 3.0), (2.0, 1.0, 1.0))
    sheet.panel(0, 1, 2), sheet.panel(1, 0)
    wide, low = (ax.get_subplotspec() for ax in axes_of(sheet))
    assert [wide.rowspan, wide.colspan, low.rowspan, low.colspan] == [range(1), range(1, 3), range(1, 2), range(1)]
    of = wide.get_gridspec()
    assert (list(of.get_height_ratios()), list(of.get_width_ratios())) == ([1.0, 3.0], [2.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("plot", "given", "words"),
    [
        ("bode", [1], "plot_bode: cannot plot what is of type list; give one of these: FrequencyResponseFit, Freq"),
        ("loops", "ab", "type str; give one of these: HysteresisLoop, Identification, a sequence of HysteresisLoop"),
        ("loops", (), "plot_loops: the sequence is empty; give one HysteresisLoop or more"),
        ("loops", [None, 3], "plot_loops: cannot plot what is of type NoneType; give one of these: Hyst"),
        ("residual", None, "these: Identification, FrequencyResponseFit, Trace, PointingTrace, Run"),
        ("spectrum", 3.0, "plot_spectrum: cannot plot what is of type float; give one of these: Ensemble, Disturbance"),
        ("pointing_errors", {}, "type dict; give one of these: PointingErrorBudget, Study"),
        ("contributions", {}, "plot_contributions: cannot plot what is of type dict; give one of these: PointingError"),
        ("margin_map", 1j, "margin_map: cannot plot what is of type complex; give one of these: Study, LinkStudy"),
        ("contacts", [], "plot_contacts: the sequence is empty; give one Contact or more"),
        ("contacts", {3}, "plot_contacts: cannot plot what is of type set; give one of these: DayStudy, a sequence"),
    ],
)
def test_each_plot_says_what_it_takes(plot, given, words):
    with pytest.raises((TypeError, ValueError), match=re.escape(words)):
        getattr(plots, f"plot_{plot}")(given)


def test_responses_of_two_inputs_stand_beside_each_other_under_their_names():
    value = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]) * np.array([1.0, 10.0])[:, None, None]
    names = {"output_names": ("tip", "tilt", "heave"), "input_names": ("left", "right")}
    response = {"freq_hz": np.array([1.0, 2.0]), "response": value.astype(complex), "standard_error": 0.0 * value}
    sheet = plots._measured_bode(SimpleNamespace(**response, **names))
    assert (sheet.width, sheet.height, sheet.widths) == (6.8, pytest.approx(13.8), (1.0, 1.0))
    size = [panel for panel in sheet.panels if panel.row % 2 == 0]
    assert [(panel.row, panel.column, panel.title, float(panel.all_of(Line)[0].y[1])) for panel in size] == [
        *((0, 0, "tip from left", 10.0), (0, 1, "tip from right", 20.0), (2, 0, "tilt from left", 30.0)),
        *((2, 1, "tilt from right", 40.0), (4, 0, "heave from left", 50.0), (4, 1, "heave from right", 60.0)),
    ]
    assert [panel.legend is not None for panel in sheet.panels] == [True] + [False] * 11


@pytest.mark.parametrize("along", ["x", "y"])
def test_error_bars_along_one_axis_alone_are_drawn(along):
    sheet, (panel,) = grid(3.0, 3.0, 1, 1)
    x, arms = np.array([1.0, 3.0]), np.array([[0.5, 0.25], [0.5, 0.25]])
    panel.add(Line(x, x, "#0072B2", marker="o", **{f"{along}_arms": arms}))
    ax = axes_of(sheet)
    (bars,) = ax.containers
    assert (bars.has_xerr, bars.has_yerr) == (along == "x", along == "y")
    pyplot.close("all")


def test_given_axes_in_rows_and_columns_are_taken_row_by_row():
    sheet, panels = grid(6.0, 6.0, 2, 2)
    for number, panel in enumerate(panels):
        panel.title = f"panel {number}"
    _, given = pyplot.subplots(2, 2)
    axes_of(sheet, given)
    assert [[ax.get_title() for ax in row] for row in given] == [["panel 0", "panel 1"], ["panel 2", "panel 3"]]
    pyplot.close("all")


def unlike(shape):
    """A number for each element, none a multiple of its row or column."""
    return (1.0 + np.arange(np.prod(shape)) ** 2).reshape(shape)


def test_each_pair_of_output_and_input_has_a_confidence_of_its_own():
    outputs, inputs = ("tip", "tilt"), ("left", "right", "rear")
    of = unlike((2, 3))
    found = SimpleNamespace(
        freq_hz=np.array([1.0, 3.0]),
        response=100.0 * np.array([1.0, 2.0j])[:, None, None] * np.ones((2, 3)),
        standard_error=np.array([1.0, 1.5])[:, None, None] * of,
        output_names=outputs,
        input_names=inputs,
    )
    sheet = plots._measured_bode(found)
    sizes = [panel for panel in sheet.panels if panel.row % 2 == 0]
    assert [panel.title for panel in sizes] == [f"{o} from {i}" for o in outputs for i in inputs]
    for panel, error in zip(sizes, of.ravel(), strict=True):
        (ring,) = panel.all_of(Area)[0].rings
        half = 1.96 / math.sqrt(2.0) * error
        assert ring[2:, 1] == pytest.approx([200.0 + 1.5 * half, 100.0 + half])


def test_a_fit_of_two_outputs_and_three_inputs_has_table_model_and_band_of_each_pair(monkeypatch):
    monkeypatch.setattr(plots, "_FINE", 2)
    of, freq = unlike((2, 3)), np.array([1.0, 4.0])

    def grows(at, scale):
        return scale * np.atleast_1d(at)[:, None, None] * of

    fit = SimpleNamespace(
        freq_hz=freq,
        residual=grows(freq, 0.5),
        response=lambda at: grows(at, 1.0),
        response_errors=lambda at: (grows(at, 0.1), grows(at, 0.01) / of**0.5),
        order=2,
    )
    sheet = plots._fit_bode(fit)
    assert (sheet.width, sheet.height) == (pytest.approx(10.2), pytest.approx(9.2))
    for number, value in enumerate(of.ravel()):
        size, phase = sheet.panels[2 * number : 2 * number + 2]
        row, column = divmod(number, 3)
        assert (size.row, size.column, phase.row, phase.column) == (2 * row, column, 2 * row + 1, column)
        assert size.title == f"output {row + 1} from input {column + 1}"
        table, model = size.all_of(Line)
        assert [*table.y, *model.y] == pytest.approx([1.5 * value, 6.0 * value, value, 4.0 * value])
        (ring,) = size.all_of(Area)[0].rings
        assert ring[0, 1] == pytest.approx(value * (1.0 - 0.196))
        (ring,) = phase.all_of(Area)[0].rings
        assert ring[0, 1] == pytest.approx(-np.degrees(1.96 * 0.01 * value**0.5))


def test_the_residuals_of_three_outputs_and_two_inputs_stand_output_by_output():
    of, freq = unlike((3, 2)), np.array([1.0, 4.0])
    residual = -0.25 * freq[:, None, None] * of
    fit = SimpleNamespace(freq_hz=freq, residual=residual, response=lambda at: at[:, None, None] * of)
    sheet = plots._fit_residual(fit)
    assert (sheet.width, sheet.height, sheet.share_x) == (6.8, 9.0, True)
    assert [(panel.row, panel.column, panel.title) for panel in sheet.panels] == [
        (row, column, f"output {row + 1} from input {column + 1}") for row in range(3) for column in range(2)
    ]
    for panel, value in zip(sheet.panels, of.ravel(), strict=True):
        table, left = panel.all_of(Line)
        assert [*table.y, *left.y] == pytest.approx([0.75 * value, 3.0 * value, 0.25 * value, value])
    assert [panel.legend is not None for panel in sheet.panels] == [True] + [False] * 5


def test_lines_alone_are_marked_and_have_no_curve_of_a_spectrum():
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    lines = SpectralLine(2e-6, 40.0), SpectralLine(1e-6, 7.0)
    left, right = plots._disturbance_spectrum(Disturbance("hum", *none, lines, "assumed", "a test")).panels
    assert [(type(mark), mark.at) for mark in left.marks] == [(Rule, 40.0), (Rule, 7.0)]
    (below,) = right.marks
    assert below.x[[0, -1]] == pytest.approx([7.0 / 30.0, 1200.0]) and below.name == "hum"
    at = np.searchsorted(below.x, [6.5, 7.5, 41.0])
    assert below.y[at] == pytest.approx([0.0, math.sqrt(0.5), math.sqrt(2.5)])  # amplitudes over the root of two


def test_each_kind_of_run_has_the_error_of_its_own_steady_part():
    error = 1e-6 * np.array([[40.0], [3.0], [3.0], [3.0]])
    reference = 1e-6 * np.array([[1.0], [2.0], [4.0], [8.0]])
    trace = made(
        Trace, time_s=np.arange(4.0), reference_rad=reference, output_rad=reference - error, steady=slice(1, None)
    )
    run = made(Run, trace=trace)
    moving = made(PointingTrace, time_s=np.arange(4.0), error_rad=error)
    for result, label, shaded in ((trace, "3.00", 1), (run, "3.00", 1), (moving, "20.2", 0)):
        ax = plots.plot_residual(result)
        assert [line.get_label() for line in ax.lines] == [f"axis 1: rms {label} µrad"]
        assert len(ax.patches) == shaded
        assert_allclose(ax.lines[0].get_xydata(), np.c_[np.arange(4.0), 1e6 * error[:, 0]])
    pyplot.close("all")


def made(kind, **values):
    """A record of a kind with these fields alone."""
    found = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(found, name, value)
    return found


@pytest.mark.parametrize(
    ("low", "high", "before"), [(2.0, 4.0, (1.0, -1.0)), (2.0, 4.0, (7.0, 6.0)), (4.0, 2.0, (1.0, 9.0))]
)
def test_limits_of_a_turned_axis_are_those_of_the_sheet(low, high, before):
    assert renderer._ends(Axis(low=low, high=high), (0.0, 1.0), before) == (low, high)


def test_a_label_that_two_panels_have_stands_in_the_legend_once_as_in_the_first():
    sheet, panels = grid(5.0, 4.0, 2)
    sheet.legend = Legend("above")
    for panel, colour in zip(panels, ("#0072b2", "#d55e00"), strict=True):
        panel.add(Line(np.arange(3.0), np.arange(3.0), colour, label="both"))
    (legend,) = axes_of(sheet)[0].figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["both"]
    assert hue(legend.legend_handles[0].get_color()) == "#0072b2"
    pyplot.close("all")


@pytest.mark.parametrize(("title", "loc"), [("", 8), ("A title", 2)])  # lower center, above the panel, or upper left
def test_a_legend_wider_than_its_panel_stands_above_it_unless_a_title_does(title, loc):
    sheet, (panel,) = grid(3.0, 2.5)
    panel.add(Line(np.arange(3.0), np.arange(3.0), label="a label that is much wider than the whole sheet can ever be"))
    panel.title, panel.legend = title, Legend("upper left")
    assert axes_of(sheet).get_legend()._loc == loc
    pyplot.close("all")


@pytest.mark.parametrize(
    ("ticks", "shown"), [((-3.0, 1.0, 8.0), [-3.0, 1.0, 8.0]), ((), [-2.0, 0.0, 2.0, 4.0, 6.0, 8.0])]
)
def test_a_colour_bar_has_the_ticks_that_are_set_and_else_round_ones(ticks, shown):
    sheet, (panel,) = grid(5.0, 4.0)
    x = np.arange(3.0)
    panel.add(Field(x, x, np.arange(9.0).reshape(3, 3), -3.0, 8.0, title="margin (dB)", ticks=ticks))
    _, bar = axes_of(sheet).figure.axes
    assert bar.get_yticks().tolist() == shown and bar.get_ylabel() == "margin (dB)"
    pyplot.close("all")


def test_of_given_axes_those_that_share_a_scale_with_the_first_or_the_last_have_no_title_of_it():
    figure = pyplot.figure()
    first = figure.add_subplot(131)
    given = [first, figure.add_subplot(132, sharey=first), figure.add_subplot(133)]
    sheet, panels = grid(6.0, 2.0, 1, 3, share_y=True)
    for panel in panels:
        panel.x, panel.y = Axis("x (s)"), Axis("y (m)")
    axes_of(sheet, given)
    assert [ax.get_ylabel() for ax in given] == ["y (m)", "", "y (m)"]
    last = figure.add_subplot(236)
    given = [figure.add_subplot(234), figure.add_subplot(235, sharex=last), last]
    sheet, panels = grid(3.0, 6.0, 3, 1, share_x=True)
    for panel in panels:
        panel.x, panel.y = Axis("x (s)"), Axis("y (m)")
    axes_of(sheet, given)
    assert [ax.get_xlabel() for ax in given] == ["x (s)", "", "x (s)"]
    pyplot.close("all")


def test_a_logarithmic_axis_whose_ticks_are_set_has_none_between_and_a_linear_one_keeps_its_own():
    sheet, (panel,) = grid(4.0, 3.0)
    panel.add(Line(np.array([1.0, 90.0]), np.array([2.0, 80.0])))
    panel.x, panel.y = Axis("x", log=True, ticks=(2.0, 30.0)), Axis("y", log=True)
    ax = axes_of(sheet)
    assert ax.get_xticks().tolist() == [2.0, 30.0] and not ax.get_xticks(minor=True).size
    assert ax.get_yticks(minor=True).size
    pyplot.close("all")


@pytest.mark.parametrize(("size", "broken"), [((6.0, 1.6), False), ((1.6, 6.0), True)])
def test_the_title_of_a_panel_is_broken_by_its_width_and_not_by_its_height(size, broken):
    sheet, (panel,) = grid(*size)
    panel.title = "a title of some thirty letters"
    assert ("\n" in axes_of(sheet).get_title()) is broken
    pyplot.close("all")


def test_lines_of_a_title_that_is_broken_stay_apart():
    wide = scales.width_of("a much longer second line", 9.0)
    said = renderer._broken("one\na much longer second line", wide / 2.0, 9.0)
    assert said == "one\na much longer\nsecond line"


def test_the_region_between_levels_goes_on_beyond_the_last_one_to_infinity():
    sheet, (panel,) = grid(4.0, 3.0)
    x, z = np.arange(3.0), np.full((3, 3), np.inf)
    z[0] = 0.5, 1.5, 2.5
    panel.add(Field(x, x, z, 0.0, 3.0, levels=np.array([1.0, 2.0])))
    ax = axes_of(sheet)
    (contours,) = ax.collections
    assert [bool(path.vertices.size) for path in contours.get_paths()] == [True, True, True]
    assert contours.get_paths()[-1].vertices[:, 1].max() == 2.0
    pyplot.close("all")


def test_rings_of_two_points_are_left_out_beside_whole_ones():
    sheet, (panel,) = grid(4.0, 3.0)
    ring = np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 3.0]])
    panel.add(Area((ring[:2] + 7.0, ring), "#e69f00"))
    ax = axes_of(sheet)
    (patch,) = ax.patches
    assert_array_equal(patch.get_path().vertices, [*ring.tolist(), ring[0]])
    pyplot.close("all")


def test_the_legend_of_a_sheet_on_given_axes_has_one_column_and_on_a_new_figure_as_many_as_it_asks_for():
    for given, columns in ((False, 3), (True, 1)):
        sheet, (panel,) = grid(7.0, 3.0)
        panel.add(*(Line(np.arange(2.0), np.arange(2.0), label=label) for label in "abc"))
        sheet.legend = Legend("above", 3)
        ax = axes_of(sheet, pyplot.figure(figsize=(7.0, 3.0)).add_subplot() if given else None)
        legend = ax.get_legend() if given else ax.figure.legends[0]
        assert (legend._ncols, legend._loc == 0) == (columns, given)
    pyplot.close("all")


def test_an_empty_text_is_no_empty_sequence_of_results():
    with pytest.raises(TypeError, match="plot_loops: cannot plot what is of type str; give one of these: HysteresisLo"):
        plots.plot_loops("")
