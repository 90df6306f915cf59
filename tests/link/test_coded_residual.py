"""Coded error ratio under simulated residuals: against whole runs in memory, and what is refused."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from link_files import link_file, received_with
from microrad import link
from microrad.core.intervals import student
from microrad.link.coupling import Pupil, SingleModeFibre
from microrad.link.fade_series import CodedLink, FadeSeries, code
from microrad.link.pointing import coded_residual
from microrad.link.pointing.coded_residual import CodedBeam, coded_asked
from microrad.link.pointing.light import Light
from microrad.link.pointing.outage import Exposure
from microrad.loop.disturbance import first_order
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.kernel_arrays import LANES
from microrad.loop.pointing_loop.simulated_windows import ask
from microrad.loop.pointing_loop.traces import trace
from microrad.loop.workbench import Controller, Loop
from microrad.mirror.model import Mirror
from microrad.report.fine_pointing.simulated_windows import simulated_data, simulated_view
from microrad.report.view import views_text

LOOP = Loop(
    mirror=Mirror.of(50e-6, [1.0], [1 / 3000**2, 2 * 0.1 / 3000, 1.0]),
    rate_hz=1000.0,
    vibration=first_order(160e-12, 5.0, convention="per-axis", name="vibration"),
    sensor_noise_rad=0.5e-6,
    steps_per_sample=2,
)
CONTROLLER = LOOP.assembled(Controller.pid(0.0, 5e5, rate_hz=1000.0))
SPAN, RUNS = Span(1.3, 0.3, 1), 3
CODE = code("ccsds-k7-1-2")


@cache
def coded(span_s=0.0, on_axis_db=3.0, ahead_rad=5e-6, runs=RUNS, end=None):
    kind = "block" if span_s else "none"
    beam = CodedBeam(Light(100e-6, ahead_rad, end), on_axis_db, CODE, 1e-5, kind, span_s)
    (found,) = ask([coded_asked(beam, LOOP.parts, SPAN)], LOOP.parts, CONTROLLER, SPAN, runs)
    return found


@pytest.mark.promise("pointing-110")
@pytest.mark.parametrize("span_s", [0.0, 0.02, pytest.param(0.5, marks=pytest.mark.endurance)])
def test_the_ratio_is_that_of_whole_runs_in_memory(span_s):
    ratios, costs = [], []
    for run in range(RUNS):
        error = trace(LOOP.parts, CONTROLLER, SPAN, run).error_rad[300:, 0]
        power = np.exp(-2.0 * ((np.abs(error) + 5e-6) / 100e-6) ** 2)
        series = FadeSeries.of(power, 1e-3, "run", unit="linear", normalised="as-given")
        one = CodedLink(CODE, series, 1e6, "block" if span_s else "none", span_s)
        needed = CODE.snr_for(1e-5)
        ratios.append(one.mean_ratio(needed * 10.0**0.3))
        costs.append([one.mean_ratio(needed * 10.0 ** (0.1 * db)) for db in (0.0, 20.0)])
    found = coded(span_s)
    assert found.ratio.value == pytest.approx(np.mean(ratios), rel=1e-9, abs=0.0)
    assert found.ratio.low < found.ratio.value < found.ratio.high
    assert np.mean(costs, axis=0)[1] < 1e-5 < np.mean(costs, axis=0)[0]
    back = coded(span_s, on_axis_db=found.penalty_db)
    assert back.ratio.value == pytest.approx(1e-5, rel=0.03, abs=0.0)
    assert back.penalty_db == found.penalty_db


@pytest.mark.promise("link-75")
def test_the_ratio_of_a_link_between_two_alike_is_that_of_pairs_of_runs_in_memory():
    fibre, ratios = SingleModeFibre(Pupil(0.15, 1.55e-6, truncation=1.1)), []
    for run in range(RUNS):
        ours, theirs = (trace(LOOP.parts, CONTROLLER, SPAN, each).error_rad[300:, 0] for each in (run, LANES + run))
        power = np.exp(-2.0 * ((np.abs(ours) + 5e-6) / 100e-6) ** 2) * fibre.share(theirs) / fibre.share(0.0)
        series = FadeSeries.of(power, 1e-3, "run", unit="linear", normalised="as-given")
        ratios.append(CodedLink(CODE, series, 1e6, "block", 0.02).mean_ratio(CODE.snr_for(1e-5) * 10.0**0.3))
    assert coded(0.02, end=fibre).ratio.value == pytest.approx(np.mean(ratios), rel=1e-9, abs=0.0)
    assert coded(0.02, end=fibre).penalty_db > coded(0.02).penalty_db + 1.0


def test_a_longer_interleaver_costs_less_and_one_beyond_the_run_is_refused():
    assert coded(0.5).penalty_db < coded(0.0).penalty_db - 0.1
    with pytest.raises(ValueError, match="the interleaver spans 4 s, longer than a run, of which 1 s are left"):
        coded(4.0)
    assert coded(0.5, ahead_rad=400e-6).penalty_db == math.inf
    assert coded(0.5, runs=1).ratio.high == math.inf


def test_the_beam_is_that_of_the_link(tmp_path):
    table = {"code": "ccsds-k7-1-2", "interleaving": "block", "interleaver": "5 ms", "bit_error_ratio": 1e-6}
    data = link.of(link_file(tmp_path, {"communication.fading": table}).mission)
    beam, under = CodedBeam.of(data), Exposure.stated(data)
    assert (beam.light.half_angle_rad, beam.on_axis_db) == (under.fall.half_angle_rad, under.on_axis_db)
    assert (beam.target, beam.interleaving, beam.span_s) == (1e-6, "block", 5e-3)
    with pytest.raises(ValueError, match=r"give it the table \[communication.fading\]"):
        CodedBeam.of(link.of(link_file(tmp_path).mission))


@pytest.mark.promise("pointing-110")
def test_terminal_and_data_have_the_same():
    found = coded(0.02)
    data = simulated_data([], None, RUNS, (), found)["coded"]
    assert data["ratio"] == {"value": found.ratio.value, "low": found.ratio.low, "high": found.ratio.high}
    assert data["penalty_db"] == found.penalty_db
    said = " ".join(views_text(simulated_view([], None, RUNS, (), found).blocks, 100).split())
    assert "with a block interleaver over 20 ms, at 3.00 dB more on the axis" in said
    assert f"power that pointing costs {found.penalty_db:.2f} dB" in said
    assert "coded" not in simulated_data([], None, RUNS)


# -------------------------------------------------------------------------------------------- counted slice by slice
EXTRA_DB = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0)


@pytest.mark.parametrize(("length", "cuts"), [(6, (11, 12, 40)), (1, (50,)), (90, (3, 44))])
def test_errors_on_two_axes_are_decoded_in_any_slices(length, cuts):
    error = np.random.default_rng(9).normal(5e-6, 24e-6, (95, 2, 3))
    beam = CodedBeam(Light(70e-6, 3e-6), 1.25, CODE, 2e-5, "block", length * 1e-3)
    tally = coded_residual._Coded(beam, length)
    for first, last in pairwise((0, *cuts, 95)):
        tally.add(first, error[first:last])
    power = np.exp(-2.0 * ((np.hypot(error[:, 0], error[:, 1]) + 3e-6) / 70e-6) ** 2)
    whole, needed = 95 // length, CODE.snr_for(2e-5)
    expected = []
    for db in (1.25, *EXTRA_DB):
        parts = CODE.parts(needed * 10.0 ** (0.1 * db) * power[: whole * length])
        ratios = CODE.ratio([each.reshape(whole, length, 3).mean(axis=1) for each in parts])
        expected.append(ratios.mean(axis=0))
    assert tally.mean == pytest.approx(np.array(expected), rel=1e-9)


def falls(slope, at=1e-4):
    return [
        at * 10.0 ** (-slope * db) for db in (*np.arange(0.0, 3.25, 0.5), 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0)
    ]


@pytest.mark.parametrize(
    ("slope", "cost_db"), [(0.1, 10.0), (0.25, 4.0), (0.4, 2.5), (0.05, 20.0), (0.049, math.inf), (3.0, 1.0 / 3.0)]
)
def test_the_answer_is_the_mean_with_its_half_width_and_where_the_others_meet_the_target(slope, cost_db):
    beam = CodedBeam(Light(100e-6, 0.0), 2.75, CODE, 1e-5, "convolutional", 0.02)
    asked = coded_asked(beam, LOOP.parts, SPAN)
    own = np.array([2e-6, 5e-6, 3e-6])
    by_run = np.outer([0.5, 1.0, 1.5], falls(slope))
    found = asked.answer([np.column_stack([own, by_run]), np.zeros((3, 16))])
    half = student(0.99, 2) * np.std(own, ddof=1) / math.sqrt(3.0)
    assert (found.ratio.value, found.ratio.low) == (pytest.approx(own.mean()), 0.0)
    assert found.ratio.high == pytest.approx(own.mean() + half, rel=1e-9)
    assert found.penalty_db == pytest.approx(cost_db, rel=1e-6)
    said = (found.code, found.target, found.interleaving, found.span_s, found.on_axis_db)
    assert said == ("ccsds-k7-1-2", 1e-5, "convolutional", 0.02, 2.75)


@pytest.mark.parametrize(("at", "cost_db"), [(1e-5, 0.0), (1.0000005e-5, 0.0), (0.9e-5, 0.0), (1.1e-5, 0.4139269)])
def test_errors_that_meet_the_target_cost_nothing(at, cost_db):
    assert coded_residual._cost_db(np.array(falls(0.1, at)), 1e-5) == pytest.approx(cost_db, rel=1e-5)


@pytest.mark.parametrize(
    ("span_s", "length"), [(0.0, 1), (0.02, 20), (0.0196, 20), (0.0204, 20), (0.029, 29), (0.0003, 1)]
)
def test_a_window_is_as_many_samples_as_are_nearest_to_the_span(span_s, length):
    beam = CodedBeam(Light(100e-6, 0.0), 2.75, CODE, 1e-5, "convolutional", span_s)
    (counted,) = coded_asked(beam, LOOP.parts, SPAN).tallies()
    assert {each.length for each in counted._windows} == {length}


@pytest.mark.parametrize(("given", "receiver", "target"), [
    ({"bit_error_ratio": 3e-7}, {}, 3e-7),
    ({}, received_with("homodyne bpsk", bit_error_ratio=2e-5, code_gain="0 dB", code_rate=0.5), 2e-5),
])  # fmt: skip
def test_the_target_of_a_coded_beam_is_that_of_its_receiver_or_without_one_that_of_its_fading(
    tmp_path, given, receiver, target
):
    table = {"code": "ccsds-k7-1-2", "interleaving": "block", "interleaver": "5 ms", **given}
    alone = dict.fromkeys(("beacon", "answer", "acquisition"))
    file = link_file(tmp_path, alone, receiver, {"communication.fading": table})
    found = CodedBeam.of(link.of(file.mission))
    assert (found.target, found.interleaving, found.span_s) == (target, "block", pytest.approx(5e-3))


def test_an_interleaver_that_spans_just_a_run_is_taken():
    def asked(span_s):
        return coded_asked(CodedBeam(Light(100e-6, 5e-6), 3.0, CODE, 1e-5, "block", span_s), LOOP.parts, SPAN)

    assert asked(1.0) is not None
    with pytest.raises(ValueError, match=r"the interleaver spans 1\.001 s, longer than a run, of which 1 s are left"):
        asked(1.001)
