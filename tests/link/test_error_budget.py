"""The pointing budget engine: distributions against closed forms and draws, classes against their paths in time."""

import math
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate, optimize, signal, stats

from microrad.core import lti
from microrad.link.error_budget import assembly
from microrad.link.error_budget.assembly import judge, requirement_of, source_of, stated
from microrad.link.error_budget.budget import beyond, budget, shares, total
from microrad.link.error_budget.contributions import Requirement, _at_its_worst, contribution, contributions
from microrad.link.error_budget.correlation import Correlation
from microrad.link.error_budget.distributions import Bundle, case
from microrad.link.error_budget.sources import ErrorSource, Spread
from microrad.loop.disturbance import Disturbance, SpectralLine, first_order, olympus
from microrad.loop.disturbance.windows import ErrorIndex, Motion, windowed_rms
from microrad.mission.model import Source
from microrad.mission.source_list import read_sources
from microrad.mission.tables.error_budget import BudgetRequirement, BudgetSource
from places import ROOT

ONE = np.array([1.0])
APE = Requirement(ErrorIndex("APE"), axes=(0,))
P = 0.9973


def source(kind, size=1.0, spread="fixed", width=0.0, gains=ONE, **more):
    return ErrorSource(f"a {kind} error", kind, Spread(spread, size, width), gains, **more)


def two(first=3.0, second=4.0, **more):
    return [replace(source("random", size, **more), name=name) for name, size in (("a", first), ("b", second))]


def alone(part, axes=(0,)):
    return Bundle.of([part]).about(axes)


# -------------------------------------------------------------------------------------------------------- distributions
@pytest.mark.promise("pointing-55", "pointing-58")
@pytest.mark.parametrize(
    ("part", "wanted", "rel"),
    [
        (case(1, covariance=np.array([4.0])), 2.0 * stats.norm.ppf(0.5 * (1.0 + P)), 1e-9),
        (case(1, half_width=np.array([2.0])), 2.0 * P, 1e-6),
        (
            case(1, amplitude=np.array([2.0 + 0j])),
            2.0 * math.sin(0.5 * math.pi * P),
            1e-4,
        ),  # its density has a pole there
        (case(1, mean=np.array([-3.0])), 3.0, 1e-15),
    ],
    ids=["gaussian", "even", "sinusoid", "constant"],
)
def test_the_quantile_of_one_part_is_its_closed_form(part, wanted, rel):
    assert alone(part).quantile(P) == pytest.approx(wanted, rel=rel, abs=0.0)
    assert alone(part.times(1e-6)).quantile(P) == pytest.approx(1e-6 * wanted, rel=rel, abs=0.0)


@pytest.mark.promise("pointing-55")
def test_the_sum_of_two_even_parts_is_a_triangle():
    whole = Bundle.of([case(1, half_width=np.array([1.0]))] * 2).about((0,))
    assert whole.quantile(P) == pytest.approx(2.0 - 2.0 * math.sqrt(1.0 - P), rel=1e-8)
    assert whole.series().within(1.0) == pytest.approx(0.75, abs=1e-8)


@pytest.mark.promise("pointing-55", "pointing-63")
def test_two_like_gaussian_axes_are_rayleigh_and_unlike_ones_rice():
    assert alone(case(2, covariance=np.eye(2)), (0, 1)).quantile(P) == pytest.approx(stats.rayleigh.ppf(P), rel=1e-8)
    off = case(2, mean=np.array([3.0, 4.0]), covariance=np.eye(2))
    assert alone(off, (0, 1)).quantile(P) == pytest.approx(stats.rice.ppf(P, 5.0), rel=1e-8)


def test_correlated_axes_are_those_of_the_turned_ones():
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    straight, turned = np.diag([9.0, 1.0]), turn @ np.diag([9.0, 1.0]) @ turn.T
    quantiles = [alone(case(2, covariance=each), (0, 1)).quantile(P) for each in (straight, turned)]
    assert quantiles[1] == pytest.approx(quantiles[0], rel=1e-8)


@pytest.mark.promise("pointing-52")
def test_errors_that_reach_both_axes_together_lie_on_a_line_and_those_apart_do_not():
    both = Requirement(ErrorIndex("APE"))
    together, apart = (
        total(contributions([source("random", 2.0, gains=np.ones(2), apart=each)], both), both)
        for each in (False, True)
    )
    assert together.quantile_rad == pytest.approx(2.0 * math.sqrt(2.0) * stats.norm.ppf(0.5 * (1.0 + P)), rel=1e-5)
    assert apart.quantile_rad == pytest.approx(2.0 * stats.rayleigh.ppf(P), rel=1e-8)
    assert shares(apart)[0].growth == pytest.approx(1.0, rel=1e-3)  # it is one source


def unlike(draw, count):
    """Draws of what `UNLIKE` adds up to."""
    even, rate = draw.uniform(-2.0, 4.0, count), draw.normal(0.0, 1.0, count)
    turning = 4.0 * np.cos(draw.uniform(0.0, 2.0 * np.pi, count))
    fading = 9.0 * np.exp(-draw.uniform(0.0, 20.0, count) / 2.0)
    return even + 3.0 * rate * draw.uniform(0.0, 1.0, count) + turning + fading


UNLIKE = (
    source("constant", 1.0, "uniform", 3.0),
    source("drift", 0.0, "gaussian", 1.0, period_s=3.0),
    source("periodic", 4.0, freq_hz=1.0),
    source("transient", 9.0, period_s=20.0, decay_s=2.0),
)


@pytest.mark.promise("pointing-52", "pointing-55", "pointing-58", "pointing-60")
@pytest.mark.parametrize("draws", [2_000_000, pytest.param(100_000_000, marks=pytest.mark.endurance)])
def test_four_unlike_classes_are_as_draws_of_them(draws):
    required = replace(APE, interpretation="mixed")
    found = total(contributions(UNLIKE, required), required).quantile_rad
    draw, below, block = np.random.default_rng(30), [0, 0, 0], 2_000_000
    for _ in range(draws // block):
        sizes = np.abs(unlike(draw, block))
        below = [
            n + int(np.sum(sizes <= found * (1.0 + off))) for n, off in zip(below, (-1e-3, 0.0, 1e-3), strict=True)
        ]
    deviation = 5.0 * math.sqrt(P * (1.0 - P) * draws)
    assert abs(below[1] - P * draws) < deviation
    if draws >= 100_000_000:  # within a thousandth: the counts there lie on both sides
        assert below[0] < P * draws < below[2]


# ---------------------------------------------------------------------------------------------------- classes, in time
WINDOW_S, SPACING_S = 0.7, 3.1
TIMED = {
    "constant": {},
    "periodic": {"freq_hz": 0.9},
    "drift": {"period_s": 20.0},
    "transient": {"period_s": 20.0, "decay_s": 1.5},
}


def path(kind, times):
    if kind == "constant":
        return np.ones(times.shape)
    if kind == "periodic":
        return np.cos(2.0 * np.pi * 0.9 * times)
    behind = np.fmod(times, 20.0)
    return behind if kind == "drift" else np.exp(-behind / 1.5)


def drawn_errors(kind, takes):
    """The error of an index by its definition, at many places of windows that lie within one period."""
    count = 4000
    places = (np.arange(count) + 0.5) / count * (20.0 - WINDOW_S - SPACING_S * (takes == "PDE"))
    begin = places + 20.0 * (np.arange(count) % 9)
    inside = (np.arange(400) + 0.5) / 400 * WINDOW_S
    mean = np.mean(path(kind, begin[:, None] + inside), axis=1)
    if takes == "APE":
        return path(kind, 180.0 * (np.arange(400_000) + 0.5) / 400_000)
    if takes == "MPE":
        return mean
    if takes == "RPE":
        return (path(kind, begin[:, None] + inside[2::5]) - mean[:, None]).ravel()
    return np.mean(path(kind, begin[:, None] + SPACING_S + inside), axis=1) - mean


@pytest.mark.promise("pointing-49", "pointing-50", "pointing-58")
@pytest.mark.parametrize("takes", ["APE", "MPE", "RPE", "PDE"])
@pytest.mark.parametrize("kind", TIMED)
def test_a_class_is_its_path_in_time(kind, takes):
    window = {} if takes == "APE" else {"window_s": WINDOW_S}
    apart = {"spacing_s": SPACING_S} if takes == "PDE" else {}
    required = Requirement(
        ErrorIndex(takes, **window, **apart), axes=(0,), observation_s=10.0 if takes == "PDE" else None
    )
    found = alone(contribution(source(kind, **TIMED[kind]), required).parts[0])
    drawn = drawn_errors(kind, takes)
    assert float(found.mean[0]) == pytest.approx(np.mean(drawn), abs=0.02)
    assert float(found.sigma[0]) == pytest.approx(np.std(drawn), rel=0.03, abs=1e-9)
    resolved = 3e-3 * float(np.max(np.abs(drawn)))
    for share in (0.3, 0.7, 0.95):
        assert found.quantile(share) == pytest.approx(np.quantile(np.abs(drawn), share), rel=0.03, abs=resolved)


@pytest.mark.promise("pointing-51")
def test_reproducibility_of_what_begins_anew_is_over_what_is_left_beside_whole_periods():
    drift = source("drift", 2.0, period_s=20.0)
    for spacing, mean, variance in ((40.0, 0.0, 0.0), (45.0, 0.0, 4.0 * 75.0)):
        required = Requirement(ErrorIndex("PRE", 0.7, spacing), axes=(0,), observation_s=20.0)
        found = alone(contribution(drift, required).parts[0])
        assert float(found.mean[0]) == pytest.approx(mean, abs=1e-9)
        assert float(found.covariance[0, 0]) == pytest.approx(variance, rel=1e-12, abs=1e-9)


@pytest.mark.promise("pointing-50", "pointing-51")
@pytest.mark.parametrize(
    ("shape", "wanted"),
    [("gaussian", math.sqrt(2.0) * stats.norm.ppf(0.5 * (1.0 + P))), ("uniform", 2.0 - 2.0 * math.sqrt(1.0 - P))],
)
def test_a_bias_that_is_another_one_in_each_observation_is_in_reproducibility_alone_by_the_difference_of_two(
    shape, wanted
):
    """ECSS-E-ST-60-10C, Table B-2: of even ones a triangle; of the worst satellite one end less the other."""
    bias = source("per-observation", 0.3, spread=shape, width=1.0)
    between = replace(APE, index=ErrorIndex("PRE", window_s=1.0, spacing_s=100.0), observation_s=50.0)
    for name in ("mixed", "ensemble"):
        required = replace(between, interpretation=name)
        assert total(contributions([bias], required), required).quantile_rad == pytest.approx(wanted, rel=1e-3, abs=0.0)
    required = replace(between, interpretation="temporal")
    ends = 6.0 if shape == "gaussian" else 2.0
    assert total(contributions([bias], required), required).quantile_rad == pytest.approx(ends, rel=1e-9, abs=0.0)
    like, within = replace(bias, kind="constant"), replace(between, index=ErrorIndex("PDE", 1.0, 10.0))
    assert total(contributions([like], between), between).quantile_rad == 0.0
    assert total(contributions([bias], within), within).quantile_rad == 0.0
    for kind in ("APE", "MPE", "RPE"):
        required = replace(APE, index=ErrorIndex(kind, None if kind == "APE" else 1.0), interpretation="mixed")
        both = (total(contributions([each], required), required).quantile_rad for each in (bias, like))
        assert next(both) == pytest.approx(next(both), rel=1e-12, abs=0.0)


@pytest.mark.promise("pointing-50")
def test_a_random_error_is_in_no_mean_and_even_where_it_is_said():
    for takes, there in (("APE", 1.0), ("MPE", 0.0), ("RPE", 1.0)):
        index = ErrorIndex(takes) if takes == "APE" else ErrorIndex(takes, 1.0)
        part = contribution(source("random", 3.0), Requirement(index, axes=(0,))).parts[0]
        assert alone(part).sigma[0] == pytest.approx(3.0 * there)
    assert alone(contribution(source("random", 3.0, even_in_time=True), APE).parts[0]).quantile(P) == pytest.approx(
        3.0 * P
    )


@pytest.mark.promise("pointing-50")
@pytest.mark.parametrize(
    "index",
    [ErrorIndex("APE"), ErrorIndex("MPE", 0.3), ErrorIndex("RPE", 0.3), ErrorIndex("PDE", 0.3, 1.0)],
    ids=lambda index: index.kind,
)
def test_a_process_is_its_disturbance_and_its_lines_are_sinusoids(index):
    shaken = replace(olympus(), lines=(SpectralLine(3e-6, 7.3),))
    required = Requirement(index, axes=(0,), observation_s=None if index.spacing_s is None else 9.0)
    found = total(contributions([source("process", 2.0, process=shaken)], required), required)
    assert len(found.contributions[0].parts) == 2
    assert found.sigma_rad[0] == pytest.approx(2.0 * windowed_rms(shaken, index), rel=1e-9, abs=0.0)


# ------------------------------------------------------------------------------------------------------------ transfers
FAST = lti.StateSpace(
    np.array([[-3.0, -40.0], [1.0, 0.0]]),
    np.array([[1.0], [0.0]]),
    np.array([[3.0, 0.0], [0.0, 20.0]]),
    np.zeros((2, 1)),
)


def seen(drive, times):
    """What a drive leaves behind the transfer, by quadrature of its own."""
    return signal.lsim((FAST.A, FAST.B, FAST.C, FAST.D), drive, times)[1]


@pytest.mark.promise("pointing-58", "pointing-59")
def test_a_transient_behind_a_transfer_is_the_response_to_it():
    part = contribution(
        source("transient", 1.0, gains=FAST, period_s=12.0, decay_s=0.8), replace(APE, axes=(0, 1))
    ).parts[0]
    times = np.linspace(0.0, 12.0, 24001)
    response = seen(np.exp(-times / 0.8), times)
    assert part.whole_mean == pytest.approx(np.mean(response, axis=0), rel=2e-3, abs=1e-4)
    assert alone(part, (0, 1)).sigma == pytest.approx(np.std(response, axis=0), rel=5e-3)


@pytest.mark.promise("pointing-58", "pointing-59")
def test_a_sinusoid_behind_a_transfer_turns_about_both_axes():
    part = contribution(source("periodic", 1.0, gains=FAST, freq_hz=0.9), replace(APE, axes=(0, 1))).parts[0]
    times = np.linspace(0.0, 20.0 / 0.9, 40001)
    late = seen(np.cos(2.0 * np.pi * 0.9 * times), times)[20000:-1]
    assert alone(part, (0, 1)).covariance == pytest.approx(np.cov(late.T, bias=True), rel=1e-3, abs=1e-4)


@pytest.mark.promise("pointing-59")
def test_a_process_behind_a_transfer_has_its_spectrum_times_the_response():
    shaken = first_order(2e-6, 3.0, convention="per-axis")
    found = Motion.of(
        lti.StateSpace(shaken.A, shaken.B, np.vstack([shaken.C, 2.0 * shaken.C]), np.zeros((2, shaken.B.shape[1])))
    )
    assert found.windowed(ErrorIndex("MPE", 0.2))[1, 1] == pytest.approx(
        4.0 * windowed_rms(shaken, ErrorIndex("MPE", 0.2)) ** 2, rel=1e-12, abs=0.0
    )
    part = contribution(source("process", 1.0, gains=FAST, process=shaken), replace(APE, axes=(0, 1))).parts[0]

    def density(freq, at):
        one = abs(lti.frequency_response(FAST, np.array([freq]))[0, at, 0]) ** 2
        w = 2.0 * np.pi * freq
        return one * 2.0 * abs((shaken.C @ np.linalg.solve(1j * w - shaken.A, shaken.B)).item()) ** 2

    for at in range(2):
        wanted = integrate.quad(density, 0.0, np.inf, args=(at,), epsrel=1e-9, epsabs=0.0, limit=500)[0]
        assert part.covariance[0, at, at] == pytest.approx(wanted, rel=1e-7, abs=0.0)


TWICE = lti.StateSpace(
    np.array([[-2.0, 1.0], [0.0, -2.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
)


@pytest.mark.parametrize(
    "index",
    [
        ErrorIndex("MPE", 0.3),
        ErrorIndex("RPE", 1e-4),
        ErrorIndex("RPE", 0.3),
        ErrorIndex("PDE", 0.3, 0.9),
        ErrorIndex("PDE", 0.9, 0.3),
    ],
    ids=str,
)
def test_poles_that_coincide_are_as_poles_that_nearly_do(index):
    apart = replace(TWICE, A=np.array([[-2.0 * 1.01, 1.0], [0.0, -2.0 / 1.01]]))
    both = [Motion.of(each) for each in (TWICE, apart)]
    assert [each.sound for each in both] == [False, True]
    same, near = (each.windowed(index).item() for each in both)
    assert same == pytest.approx(near, rel=1e-3, abs=0.0)


# --------------------------------------------------------------------------------------------------- over the ensemble
@pytest.mark.promise("pointing-54")
def test_the_interpretations_take_the_worst_satellite_the_worst_time_or_neither():
    sizes = {}
    for name in ("temporal", "ensemble", "mixed"):
        required = replace(APE, interpretation=name)
        sizes[name] = alone(contribution(source("periodic", 0.0, "gaussian", 1.0, freq_hz=1.0), required).parts[0])
    assert sizes["temporal"].sigma[0] == pytest.approx(3.0 / math.sqrt(2.0))  # amplitude of 3 sigma
    assert sizes["ensemble"].quantile(P) == pytest.approx(stats.norm.ppf(0.5 * (1.0 + P)), rel=2e-3)  # its peak
    assert sizes["mixed"].sigma[0] == pytest.approx(math.sqrt(0.5))
    draw = np.random.default_rng(5)
    drawn = np.abs(draw.normal(size=400_000) * np.cos(draw.uniform(0.0, 2.0 * np.pi, 400_000)))
    assert sizes["mixed"].quantile(0.95) == pytest.approx(np.quantile(drawn, 0.95), rel=0.01)


@pytest.mark.promise("pointing-54")
def test_a_constant_over_an_ensemble_is_its_spread():
    mixed = replace(APE, interpretation="mixed")
    even = contribution(source("constant", 1.0, "uniform", 3.0), mixed).parts[0]
    assert alone(even).quantile(0.5) == pytest.approx(1.5)  # of -2 to 4
    assert alone(contribution(source("constant", 1.0, "gaussian", 3.0), mixed).parts[0]).sigma[0] == pytest.approx(3.0)
    assert alone(contribution(source("constant", 1.0, "gaussian", 3.0), APE).parts[0]).quantile(P) == pytest.approx(
        10.0
    )
    assert alone(contribution(source("constant", -1.0, "uniform", 3.0), APE).parts[0]).quantile(P) == pytest.approx(4.0)


@pytest.mark.promise("pointing-54")
def test_noise_at_its_worst_time_has_as_many_sigma_as_hold_the_confidence():
    required = replace(APE, interpretation="ensemble")
    found = total(contributions([source("random", 2.0)], required), required)
    assert found.quantile_rad == pytest.approx(2.0 * stats.norm.ppf(0.5 * (1.0 + P)))


@pytest.mark.parametrize("gains", [[1.0], [1.0, 0.5], [0.25, 0.5, 1.0]])
def test_noise_at_its_worst_time_is_that_of_each_axis(gains):
    required = replace(APE, axes=tuple(range(min(len(gains), 2))), interpretation="ensemble")
    of = source("random", 2.0, gains=np.array(gains))
    sigmas = stats.norm.ppf(0.5 * (1.0 + P))
    np.testing.assert_allclose(_at_its_worst(of, required).mean, sigmas * np.array([gains]))


# -------------------------------------------------------------------------------------------------------------- totals
@pytest.mark.promise("pointing-55")
def test_the_rules_add_means_and_the_squares_of_deviations():
    parts = [source("constant", 2.0), *two()]
    found = total(contributions(parts, APE), APE)
    assert found.by_rules_rad == pytest.approx(2.0 + stats.norm.ppf(0.5 * (1.0 + P)) * 5.0)
    assert found.quantile_rad < found.by_rules_rad


# ECSS-E-ST-60-10C, Annex C: the ensembles of Table C-2 about x, y, z (arcsec; periods are "orbit" and "less than the
# observation period" there), what Tables C-3 and C-4 print of each source, their totals, and twice these
ANNEX_C = {
    "star tracker noise": ("random", "fixed", ((10.0, 0.0), (5.0, 0.0), (5.0, 0.0)), {}),
    "star tracker bias": ("per-observation", "gaussian", ((0.0, 20.0 / 3.0), (0.0, 10.0 / 3.0), (0.0, 10.0 / 3.0)), {}),
    "controller and actuators": ("random", "gaussian", ((1.0, 3.0), (1.0, 3.0), (1.0, 3.0)), {}),
    "thermoelastic": ("periodic", "uniform", ((2.0, 2.0), (2.0, 2.0), (2.0, 2.0)), {"freq_hz": 1.0 / 5400.0}),
    "misalignment": ("constant", "uniform", ((0.0, 5.0), (0.0, 5.0), (0.0, 5.0)), {}),
    "targeting": ("periodic", "gaussian", ((0.0, 5.0), (0.0, 1.0), (0.0, 5.0)), {"freq_hz": 1.0 / 5400.0}),
    "flexible modes": ("periodic", "gaussian", ((0.0, 3.0), (0.0, 5.0), (0.0, 3.0)), {"freq_hz": 1.0}),
}
C_3 = (
    (10.0, 6.67, 3.16, 1.63, 2.89, 3.54, 2.12, 13.51, 27.01),
    (5.0, 3.33, 3.16, 1.63, 2.89, 0.71, 3.54, 8.37, 16.75),
    (5.0, 3.33, 3.16, 1.63, 2.89, 3.54, 2.12, 8.61, 17.21),
)
C_4 = (
    (10.0, 0.0, 3.16, 0.0, 0.0, 0.0, 2.12, 10.70, 21.40),
    (5.0, 0.0, 3.16, 0.0, 0.0, 0.0, 3.54, 6.89, 13.78),
    (5.0, 0.0, 3.16, 0.0, 0.0, 0.0, 2.12, 6.28, 12.57),
)


@pytest.mark.promise("pointing-62")
@pytest.mark.parametrize(
    ("index", "printed", "limits", "within"),
    [
        (ErrorIndex("APE"), C_3, (60.0, 20.0, 20.0), 0.0051),
        (ErrorIndex("RPE", window_s=30.0), C_4, (30.0, 10.0, 10.0), 0.051),  # zeros of one digit
    ],
    ids=["APE", "RPE"],
)
@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_the_standard_s_worked_example_comes_out_to_its_digits(index, printed, limits, within, axis):
    confidence = 2.0 * stats.norm.cdf(2.0) - 1.0  # the example's "95 %" is twice the deviation
    required = Requirement(index, confidence, "mixed", axes=(0,), limit_rad=limits[axis])
    sources = [
        ErrorSource(name, kind, Spread(shape, *sizes[axis]), ONE, **more)
        for name, (kind, shape, sizes, more) in ANNEX_C.items()
    ]
    own = contributions(sources, required)
    found = total(own, required)
    deviations = [alone(*each.parts).sigma[0] for each in own]
    assert deviations == pytest.approx(printed[axis][:-2], abs=within, rel=0.0)
    assert found.sigma_rad[0] == pytest.approx(printed[axis][-2], abs=0.0051, rel=0.0)
    assert found.by_rules_rad == pytest.approx(printed[axis][-1], abs=0.0102, rel=0.0)  # twice what is rounded
    assert found.mean_rad[0] == pytest.approx(0.0, abs=1e-12)  # "all of the errors in the budget have zero mean"
    assert (found.by_rules_rad <= limits[axis]) == (index.kind == "APE" or axis == 0)  # as it says there


def test_totals_of_several_requirements_are_each_as_by_itself():
    parts = [replace(each, transfer=np.array([1.0, 0.5])) for each in UNLIKE]
    asked = [replace(APE, axes=axes, interpretation=name) for axes in ((0,), (1,)) for name in ("temporal", "mixed")]
    together = budget(parts, asked)
    assert [each.quantile_rad for each in together] == pytest.approx(
        [total(contributions(parts, each), each).quantile_rad for each in asked], rel=1e-12
    )
    assert together[0].quantile_rad == pytest.approx(2.0 * together[2].quantile_rad, rel=1e-6)


@pytest.mark.promise("pointing-49")
def test_shares_rank_sources_and_say_how_far_each_may_grow():
    required = replace(APE, limit_rad=14.0)
    parts = [*two(4.0, 1.0), source("constant", 3.0)]
    found = shares(total(contributions(parts, required), required))
    assert [each.name for each in found] == ["a", "a constant error", "b"]
    grown = [two(4.0 * found[0].allowed)[0], *parts[1:]]
    assert total(contributions(grown, required), required).quantile_rad == pytest.approx(
        14.0, rel=1e-5
    )  # as looked for
    assert sum(each.growth for each in found) == pytest.approx(1.0, rel=1e-3)  # all of them by 1 % is all by 1 %
    assert found[1].without_rad == pytest.approx(stats.norm.ppf(0.5 * (1.0 + P)) * math.sqrt(17.0), rel=1e-4)
    tight = shares(total(contributions(parts, required), replace(required, limit_rad=3.0)))
    assert tight[2].allowed == 0.0  # the large one alone is more


def test_a_limit_is_kept_or_not():
    parts = [source("random", 4.0)]
    kept = [total(contributions(parts, APE), replace(APE, limit_rad=limit)).holds for limit in (12.1, 11.9, None)]
    assert kept == [True, False, None]


# ------------------------------------------------------------------------------------------------------------- refusals
HUMMING = replace(olympus(), lines=(SpectralLine(1e-6, 1.0),))
AT_2 = replace(FAST, A=np.diag([-2.0, -3.0]))


@pytest.mark.promise("pointing-51", "pointing-59")
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Spread("bent", 1.0), 'no shape "bent"'),
        (lambda: Spread("fixed", 1.0, 2.0), "a fixed size has no width"),
        (lambda: Spread("gaussian", math.nan), "give finite ones"),
        (lambda: Spread("gaussian", 0.0, -1.0), "a spread of mean 0 and width -1: give finite ones, the width >= 0"),
        (lambda: Spread("gaussian", 0.0, math.inf), "a spread of mean 0 and width inf: give finite ones"),
        (lambda: source("odd"), 'no class "odd"'),
        (lambda: source("periodic"), "needs freq_hz"),
        (lambda: source("constant", freq_hz=1.0), "has no freq_hz"),
        (lambda: source("drift", period_s=-1.0), "above zero"),
        (lambda: source("process"), "a spectrum belongs to a process"),
        (lambda: source("random", -1.0), "give a size of 0 or above"),
        (lambda: source("constant", gains=np.zeros((2, 2))), "give a finite one for each axis"),
        (lambda: source("constant", gains=[]), "gains have the shape (0,); give a finite one for each axis"),
        (lambda: source("constant", gains=[1.0, math.nan]), "gains are [1.0, nan]; give a finite one"),
        (
            lambda: source("constant", gains=replace(FAST, B=np.ones((2, 2)), D=np.zeros((1, 2)))),
            "its transfer has 2 inputs; give a stable system of one input",
        ),
        (lambda: source("constant", gains=FAST, apart=True), "errors apart by axis need gains; give a source for each"),
        (lambda: source("constant", gains=replace(FAST, A=np.eye(2))), "has a pole of 1 rad/s; give a stable system"),
        (lambda: source("process", 1.0, "gaussian", 1.0, process=HUMMING), "the lines of a process have one size"),
        (lambda: contribution(source("drift", gains=FAST, period_s=9.0), APE), "each new begin of a drift is a step"),
        (lambda: contributions([source("random")] * 2, APE), "two sources have one name"),
        (lambda: contribution(source("random", gains=FAST), APE), 'give gains, or the class "process"'),
        (
            lambda: contribution(source("drift", period_s=1.0), Requirement(ErrorIndex("MPE", 2.0))),
            "begins anew every 1 s",
        ),
        (
            lambda: contribution(source("transient", gains=AT_2, period_s=9.0, decay_s=0.5), APE),
            "is a pole of its transfer",
        ),
        (
            lambda: contribution(
                source("transient", period_s=9.0, decay_s=0.5),
                Requirement(ErrorIndex("PRE", 6.0, 13.0), axes=(0,), observation_s=7.0),
            ),
            "no two windows of 6 s so far apart lie within periods; give shorter ones",
        ),
        (lambda: contributions([source("random"), source("constant", gains=np.ones(2))], APE), "give all as many"),
        (lambda: contributions([source("random")], replace(APE, axes=(1,))), "axis 1 is asked for"),
        (lambda: total([], APE), "a budget without a source"),
        (lambda: replace(APE, confidence=1.0), "a confidence of 1: give a share"),
        (lambda: replace(APE, confidence=0.0), "a confidence of 0: give a share"),
        (lambda: replace(APE, limit_rad=math.inf), "a limit of inf rad; give a finite one above zero"),
        (lambda: source("drift", period_s=0.0), "period_s is 0; give a finite number above zero"),
        (lambda: source("periodic", freq_hz=math.inf), "freq_hz is inf; give a finite number above zero"),
        (lambda: source("random", 1.0, "uniform", 1.0, gains=ONE, freq_hz=1.0), "has no freq_hz; leave it out"),
        (lambda: source("constant", gains=replace(FAST, A=np.diag([0.0, -1.0]))), "has a pole of 0 rad/s"),
        (lambda: source("random", -0.0, "gaussian", -1.0), "the width >= 0"),
        (lambda: replace(APE, interpretation="both"), 'no interpretation "both"'),
        (lambda: replace(APE, axes=(0, 1, 2)), "give one, or two"),
        (
            lambda: replace(APE, axes=(0, 0)),
            "axes (0, 0): give one, or two for the radial error",
        ),
        (lambda: replace(APE, axes=(-1,)), "axes (-1,): give one, or two"),
        (lambda: replace(APE, limit_rad=0.0), "above zero"),
        (lambda: replace(APE, observation_s=1.0), "has no observation_s"),
        (lambda: Requirement(ErrorIndex("PDE", 1.0, 2.0)), "PDE needs observation_s"),
        (lambda: Requirement(ErrorIndex("PDE", 1.0, 2.0), observation_s=2.5), "give it longer"),
        (lambda: Requirement(ErrorIndex("PRE", 1.0, 2.0), observation_s=2.5), "space them wider"),
    ],
)
def test_what_is_no_budget_is_refused(make, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        make()


def test_a_spectrum_of_no_variance_is_refused():
    with pytest.raises(ValueError, match="has no variance"):
        Disturbance("drifting", np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), (), "", "")


# --------------------------------------------------------------------------------------------------------- correlation
CONSTANTS = [replace(source("constant", 0.0, "gaussian", size), name=name) for name, size in (("a", 3.0), ("b", 4.0))]
UNLIKE_PAIR = [two()[0], replace(source("constant", 0.0, "gaussian", 1.0), name="b")]


@pytest.mark.promise("pointing-60", "pointing-63")
@pytest.mark.parametrize(("rho", "sigma"), [(1.0, 7.0), (0.0, 5.0), (-1.0, 1.0), (0.5, math.sqrt(37.0))])
def test_correlated_errors_add_as_their_matrix_says(rho, sigma):
    (found,) = budget([*two(), source("constant", 1.0)], [APE], [Correlation("a", "b", rho)])
    assert float(found.sigma_rad[0]) == pytest.approx(sigma, rel=1e-12)
    names = [each.name for each in found.contributions]
    assert names == (["a with b", "a constant error"] if rho else ["a", "b", "a constant error"])


def test_correlations_are_of_their_pairs_in_whatever_order_they_are_named():
    three = [replace(source("random", size), name=name) for name, size in (("a", 1.0), ("b", 2.0), ("c", 4.0))]
    named = [Correlation("c", "b", 0.5), Correlation("c", "a", 0.0), Correlation("b", "a", -0.25)]
    wanted = 1.0 + 4.0 + 16.0 + 2.0 * (0.5 * 4.0 * 2.0 - 0.25 * 2.0 * 1.0)
    for given in (named, named[::-1], [named[2], named[0]]):
        (found,) = budget(three, [APE], given)
        assert float(found.sigma_rad[0]) ** 2 == pytest.approx(wanted, rel=1e-12)


def test_each_requirement_has_the_parts_of_its_own_confidence():
    worst = replace(APE, interpretation="ensemble")
    asked = [replace(worst, confidence=0.9973), replace(worst, confidence=0.95)]
    strict, loose = budget(two(), asked)
    (alone_there,) = budget(two(), asked[1:])
    assert loose.quantile_rad == alone_there.quantile_rad < 0.8 * strict.quantile_rad


def test_correlated_errors_have_the_signs_of_their_gains_and_keep_axes_apart():
    gains = np.array([1.0, -2.0])
    both = Requirement(ErrorIndex("APE"))
    (together,) = budget(two(gains=gains), [both], [Correlation("a", "b", 0.5)])
    (apart,) = budget(two(gains=gains, apart=True), [both], [Correlation("a", "b", 0.5)])
    wanted = 37.0 * np.outer(gains, gains)
    assert together.contributions[0].parts[0].covariance[0] == pytest.approx(wanted)
    assert apart.contributions[0].parts[0].covariance[0] == pytest.approx(np.diag(np.diag(wanted)))


@pytest.mark.promise("pointing-60")
@pytest.mark.parametrize(("rho", "sigma"), [(1.0, 7.0), (-1.0, 1.0)])
def test_correlated_constants_lie_three_common_deviations_out_on_the_worst_satellite(rho, sigma):
    asked = [APE, replace(APE, interpretation="mixed")]
    temporal, mixed = budget(CONSTANTS, asked, [Correlation("a", "b", rho)])
    assert temporal.quantile_rad == pytest.approx(3.0 * sigma)
    assert float(mixed.sigma_rad[0]) == pytest.approx(sigma)
    with pytest.raises(ValueError, match="take the interpretation temporal or mixed"):
        budget(CONSTANTS, [replace(APE, interpretation="ensemble")], [Correlation("a", "b", rho)])


def test_correlated_noises_stand_with_common_deviations_at_their_worst_time():
    worst = replace(APE, interpretation="ensemble")
    (found,) = budget(two(), [worst], [Correlation("a", "b", -1.0)])
    assert found.quantile_rad == pytest.approx(stats.norm.ppf(0.5 * (1.0 + P)))
    mean = Requirement(ErrorIndex("MPE", 1.0), axes=(0,))
    (none,) = budget(two(), [mean], [Correlation("a", "b", 1.0)])
    assert none.quantile_rad == 0.0 and len(none.contributions) == 2


@pytest.mark.promise("pointing-60")
@pytest.mark.parametrize(
    ("sources", "correlations", "said"),
    [
        (two(), [Correlation("a", "c", 0.5)], "name two sources out of a, b"),
        (two(), [Correlation("a", "a", 0.5)], "name two sources"),
        (two(), [Correlation("a", "b", 0.5), Correlation("b", "a", 0.1)], "give each pair once"),
        (two(), [Correlation("a", "b", 1.5)], "give one from -1 to 1"),
        (two(), [Correlation("a", "b", -1.001)], "the coefficient is -1.001; give one from -1 to 1"),
        (two(spread="gaussian", width=1.0), [Correlation("a", "b", 0.5)], "only two Gaussian errors of one class"),
        (
            [replace(source("constant", 1.0, "uniform", 1.0), name=name) for name in "ab"],
            [Correlation("a", "b", 0.5)],
            "only two Gaussian errors of one class",
        ),
        (
            [replace(source("constant", 1.0, "gaussian", 1.0, gains=FAST), name=name) for name in "ab"],
            [Correlation("a", "b", 0.5)],
            "that reach the axes by gains",
        ),
        (two(even_in_time=True), [Correlation("a", "b", 0.5)], "only two Gaussian errors of one class"),
        (UNLIKE_PAIR, [Correlation("a", "b", 0.5)], "only two Gaussian errors of one class"),
        (
            [*two(), replace(source("random", 1.0), name="c")],
            [Correlation("a", "b", 0.87), Correlation("b", "c", 0.93), Correlation("a", "c", -0.71)],
            "their matrix has the eigenvalue -0.677, so that no errors can be correlated so",
        ),
    ],
)
def test_correlations_that_cannot_be_are_refused(sources, correlations, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        budget(sources, [APE], correlations)


@pytest.mark.promise("pointing-48")
def test_the_page_s_list_comes_to_what_the_page_says(tmp_path):
    text = (ROOT / "docs" / "pointing.md").read_text("utf-8")
    (tmp_path / "errors.csv").write_text(re.search(r"```text\n(name,class.*?)```", text, re.DOTALL)[1], "utf-8")
    parts = [source_of(each.name, each.source, each.origin) for each in read_sources(tmp_path / "errors.csv")]
    (found,) = budget(parts, [Requirement(ErrorIndex("RPE", 0.01))])
    exact, rules = (f"{1e6 * each:.2f} µrad" for each in (found.quantile_rad, found.by_rules_rad))
    assert f"come to {exact} by their distribution and to\n{rules} by the rules" in text


# ------------------------------------------------------------------------------------------- signs, restarts, and ends
@pytest.mark.promise("pointing-54")
def test_signs_of_what_is_spread_about_zero_do_not_cancel_on_the_worst_satellite():
    parts = [replace(each, transfer=gains) for each, gains in zip(CONSTANTS, (ONE, -ONE), strict=True)]
    assert total(contributions(parts, APE), APE).quantile_rad == pytest.approx(3.0 * 7.0)
    fixed = [replace(each, size=Spread("fixed", 2.0)) for each in parts]
    assert total(contributions(fixed, APE), APE).quantile_rad == pytest.approx(0.0, abs=1e-12)  # a sign that is known
    asked = Requirement(ErrorIndex("PDE", 1.0, 60.0), axes=(0,), observation_s=100.0)
    fades = source("transient", 3.0, period_s=1000.0, decay_s=300.0)
    both = [[fades, source("drift", 0.0, "gaussian", 0.01, gains=sign * ONE, period_s=999.0)] for sign in (1.0, -1.0)]
    assert total(contributions(both[0], asked), asked).quantile_rad == pytest.approx(
        total(contributions(both[1], asked), asked).quantile_rad, rel=1e-9
    )


@pytest.mark.promise("pointing-54")
def test_sizes_add_up_at_the_worst_time_whatever_their_signs():
    worst = replace(APE, interpretation="ensemble")
    parts = [source("constant", 2.0, gains=-ONE), source("random", 1.0), source("periodic", 1.0, freq_hz=1.0)]
    sigmas = stats.norm.ppf(0.5 * (1.0 + P))
    assert total(contributions(parts, worst), worst).quantile_rad == pytest.approx(2.0 + sigmas + 1.0)
    spread = [CONSTANTS[0], source("random", 1.0)]
    for confidence in (0.6827, 0.95, P):
        one = replace(worst, confidence=confidence)
        n = stats.norm.ppf(0.5 * (1.0 + confidence))
        assert total(contributions(spread, one), one).quantile_rad == pytest.approx(3.0 * n + n, rel=2e-3)
    about = replace(worst, confidence=0.9)
    for mean, width in ((0.0, 2.0), (1.0, 2.0), (3.0, 2.0)):
        drawn = np.abs(mean + width * np.linspace(-1.0, 1.0, 200_001))
        found = total(contributions([source("constant", mean, "uniform", width)], about), about)
        assert found.quantile_rad == pytest.approx(np.quantile(drawn, 0.9), rel=1e-3)


@pytest.mark.promise("pointing-51")
@pytest.mark.parametrize(("spacing", "decay"), [(1999.0, 300.0), (1250.0, 100.0), (1600.0, 900.0)])
def test_the_second_window_of_a_transient_begins_anew_too(spacing, decay):
    fades = source("transient", 1.0, period_s=1000.0, decay_s=decay)
    required = Requirement(ErrorIndex("PRE", 1.0, spacing), axes=(0,), observation_s=1000.0)
    found = alone(contribution(fades, required).parts[0])
    begin = (np.arange(400_000) + 0.5) / 400_000 * 999.0
    second = np.fmod(begin + spacing, 1000.0)
    there = second <= 999.0
    mean = decay * -np.expm1(-1.0 / decay)
    drawn = mean * (np.exp(-second[there] / decay) - np.exp(-begin[there] / decay))
    assert float(found.mean[0]) == pytest.approx(np.mean(drawn), abs=2e-3)
    assert float(found.sigma[0]) == pytest.approx(np.std(drawn), rel=5e-3)


def test_whole_periods_apart_there_is_no_difference_though_they_do_not_divide_in_floats():
    for kind, more in (("transient", {"decay_s": 0.03}), ("drift", {})):
        required = Requirement(ErrorIndex("PRE", 0.01, 0.3), axes=(0,), observation_s=0.1)
        found = contribution(source(kind, 1.0, period_s=0.1, **more), required).parts[0]
        assert alone(found).quantile(P) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.promise("pointing-57")
@pytest.mark.parametrize("decay", [0.3, 1.0, 5.0])
def test_a_transient_that_is_short_beside_its_period_is_resolved(decay):
    part = contribution(source("transient", 1.0, period_s=1000.0, decay_s=decay), APE).parts[0]
    for share in (P, 0.9999):
        exact = math.exp(-(1.0 - share) * 1000.0 / decay)
        assert alone(part).quantile(share) == pytest.approx(exact, rel=0.01, abs=2e-3)
    worst = replace(APE, interpretation="ensemble")
    found = total(contributions([source("transient", 1.0, period_s=1000.0, decay_s=decay)], worst), worst)
    assert found.quantile_rad == pytest.approx(1.0, rel=2e-3)  # straight between its pieces


def test_a_constant_that_is_hardly_spread_is_gaussian_all_the_same():
    mixed = replace(APE, interpretation="mixed", confidence=0.8)
    found = total(contributions([source("constant", 1.0, "gaussian", 0.1)], mixed), mixed)
    assert found.quantile_rad == pytest.approx(1.0 + 0.1 * stats.norm.ppf(0.8), rel=1e-6)


@pytest.mark.parametrize("turns", [3.3, 7.3, 40.2])
def test_a_sinusoid_of_many_turns_in_a_window_keeps_its_variance(turns):
    required = Requirement(ErrorIndex("RPE", 1.0), axes=(0,))
    found = alone(contribution(source("periodic", 1.0, freq_hz=turns), required).parts[0])
    assert float(found.covariance[0, 0]) == pytest.approx(0.5 * (1.0 - np.sinc(turns) ** 2), rel=1e-6)


def test_a_mean_that_dwarfs_its_spread_is_kept_with_the_spread_along_it():
    both = Requirement(ErrorIndex("APE"))
    for sigma in (0.1, 0.5, 1.0, 1.5, 1.6, 1.8, 3.0, 10.0):
        parts = [source("constant", 100.0, gains=np.ones(2)), source("random", sigma, gains=np.ones(2), apart=True)]
        found = total(contributions(parts, both), both).quantile_rad
        exact = sigma * math.sqrt(stats.ncx2.ppf(P, 2, 2.0 * (100.0 / sigma) ** 2))
        assert found - 100.0 * math.sqrt(2.0) == pytest.approx(exact - 100.0 * math.sqrt(2.0), rel=5e-3)


@pytest.mark.promise("pointing-49")
def test_weights_add_up_to_one_where_signs_differ_and_a_source_may_always_be_as_it_is():
    parts = [source("constant", 3.0), replace(source("constant", -1.0), name="b"), source("random", 0.5)]
    required = replace(APE, limit_rad=4.0)
    found = shares(total(contributions(parts, required), required))
    assert sum(each.growth for each in found) == pytest.approx(1.0, rel=1e-3)
    assert min(each.growth for each in found) < 0.0
    assert all(each.allowed >= 1.0 for each in found)
    missed = shares(
        total(contributions([*parts, source("drift", 0.0, period_s=1.0)], required), replace(required, limit_rad=0.1))
    )
    assert {each.name: each.allowed for each in missed}["a drift error"] == math.inf  # it adds nothing


@pytest.mark.promise("pointing-49")
def test_weights_are_what_each_source_grows_the_total_by_however_loose_the_limit():
    both, each = np.array([1.0, 1.0]), {"gains": np.array([1.0, 1.0]), "apart": True}
    parts = [
        source("periodic", 1.1, gains=np.array([0.0, 1.0]), freq_hz=1.0),
        replace(source("random", 0.06, **each), name="a"),
        replace(source("random", 0.08, gains=both), name="b"),
    ]
    required = Requirement(ErrorIndex("APE"), limit_rad=9.0)
    found = {each.name: each.growth for each in shares(total(contributions(parts, required), required))}
    for place, each in enumerate(parts):
        ends = []
        for times in (0.999, 1.001):
            scaled = [*parts[:place], replace(each, size=each.size.times(times)), *parts[place + 1 :]]
            ends.append(math.log(total(contributions(scaled, required), required).quantile_rad))
        assert found[each.name] == pytest.approx((ends[1] - ends[0]) / 0.002, rel=1e-3)


@pytest.mark.parametrize("size", [0.6, 0.9, 0.95])
def test_a_bias_may_grow_until_it_meets_the_limit_and_no_further(size):
    parts = [source("constant", size), source("random", 0.01)]
    required = replace(APE, limit_rad=1.0)
    found = {each.name: each for each in shares(total(contributions(parts, required), required))}
    one_sided = stats.norm.ppf(P) * 0.01  # nothing is left of the other side
    assert found["a constant error"].allowed == pytest.approx((1.0 - one_sided) / size, rel=1e-4)


def test_a_bias_that_another_one_cancels_may_hardly_grow():
    parts = [source("constant", 10.0), replace(source("constant", -10.0), name="b"), source("random", 0.3)]
    required = replace(APE, limit_rad=2.0)
    allowed = {each.name: each.allowed for each in shares(total(contributions(parts, required), required))}
    for name in ("a constant error", "b"):
        assert 10.0 * (allowed[name] - 1.0) == pytest.approx(2.0 - stats.norm.ppf(P) * 0.3, rel=1e-3)


@pytest.mark.parametrize("noise", [0.003, 0.03, 0.05])
def test_shares_of_a_mean_that_dwarfs_its_spread_are_those_of_budgets_made_anew(noise):
    """A long bias and little noise: weights by small changes, and what each may be by a budget of that size."""
    required = replace(APE, axes=(0, 1), limit_rad=1.0 + 3.0 * noise)

    def total_rad(bias=1.0, spread=1.0):
        sources = (
            source("constant", 0.9 * bias, gains=np.array([1.0, 0.0])),
            source("random", noise * spread, gains=np.ones(2), apart=True),
        )
        return total(contributions(sources, required), required)

    whole, small = total_rad().quantile_rad, 1e-4
    found = {each.contribution.kind: each for each in shares(total_rad())}
    for kind, key in (("constant", "bias"), ("random", "spread")):
        up, down = (total_rad(**{key: 1.0 + change}).quantile_rad for change in (small, -small))
        assert found[kind].growth == pytest.approx((up - down) / (2.0 * small * whole), rel=0.01, abs=0.0)
        allowed = total_rad(**{key: found[kind].allowed}).quantile_rad
        assert allowed == pytest.approx(required.limit_rad, rel=4e-3, abs=0.0)  # what lies across the mean is left out
        assert found[kind].without_rad == pytest.approx(total_rad(**{key: 1e-9}).quantile_rad, rel=1e-4, abs=0.0)


def test_without_its_only_source_a_budget_is_nothing():
    both = Requirement(ErrorIndex("APE"))
    one = source("random", 1.0, gains=np.ones(2), apart=True)
    (alone_,) = shares(total(contributions([one], both), both))
    assert alone_.without_rad == 0.0
    parts = [source("constant", 2.0, gains=np.ones(2)), replace(one, size=Spread("fixed", 0.1))]
    found = {each.name: each.without_rad for each in shares(total(contributions(parts, both), both))}
    assert found["a random error"] == pytest.approx(2.0 * math.sqrt(2.0))
    assert found["a constant error"] == pytest.approx(0.1 * stats.rayleigh.ppf(P), rel=1e-4)


@pytest.mark.parametrize(
    ("index", "observation_s"), [(ErrorIndex("PDE", 1.0, 2.0), 3.0), (ErrorIndex("PRE", 1.0, 2.0), 2.0)]
)
def test_windows_may_fill_their_observation_period_to_its_end(index, observation_s):
    assert Requirement(index, observation_s=observation_s).observation_s == observation_s


def test_a_limit_that_is_met_exactly_is_kept():
    found = total(contributions([source("constant", 3.0)], APE), replace(APE, limit_rad=3.0))
    assert (found.quantile_rad, found.holds) == (3.0, True)
    assert not replace(found, required=replace(APE, limit_rad=math.nextafter(3.0, 0.0))).holds
    assert replace(found, required=APE).holds is None


def test_shares_of_nothing_but_constants_are_those_of_their_lengths():
    required = Requirement(ErrorIndex("APE"), limit_rad=10.0)
    sources = [
        replace(source("constant", 6.0, gains=np.array([1.0, 0.0])), name="along"),
        replace(source("constant", 3.0, gains=np.array([0.0, 1.0])), name="across"),
    ]
    first, second = shares(total(contributions(sources, required), required))
    assert (first.name, second.name) == ("along", "across")
    assert [first.total_rad, first.without_rad, second.without_rad] == pytest.approx([math.sqrt(45.0), 3.0, 6.0])
    assert [first.growth, second.growth] == pytest.approx([0.8, 0.2])
    assert first.part_rad + second.part_rad == pytest.approx(math.sqrt(45.0))
    allowed = [math.sqrt(91.0) / 6.0, 8.0 / 3.0]
    assert [first.allowed, second.allowed] == pytest.approx(allowed, rel=1e-4)
    without_limit = shares(total(contributions(sources, required), replace(required, limit_rad=None)))
    assert [each.allowed for each in without_limit] == [None, None]
    missed = shares(total(contributions(sources, required), replace(required, limit_rad=2.0)))
    assert [each.allowed for each in missed] == [0.0, 0.0]


def test_the_share_beyond_a_size_of_a_long_mean_is_that_along_it():
    required = Requirement(ErrorIndex("APE"))
    sources = [
        replace(source("constant", 1.0, gains=np.array([3.0, 4.0])), name="mean"),
        source("random", 0.01, gains=np.ones(2), apart=True),
    ]
    found = total(contributions(sources, required), required)
    sizes = np.array([4.98, 5.0, 5.01, 6.0])
    wanted = stats.norm.sf((sizes - 5.0) / 0.01)
    np.testing.assert_allclose(beyond(found, sizes), wanted, atol=2e-3)
    assert beyond(found, np.array([1e3]))[0] == 0.0


def test_the_share_beyond_a_size_of_a_constant_is_all_or_nothing():
    found = total(contributions([source("constant", -3.0)], APE), APE)
    assert beyond(found, np.array([2.9, 3.0, 3.1])).tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(("spread", "width"), [("gaussian", 1.0), ("uniform", 1.5)])
def test_a_drift_whose_rate_is_hardly_spread_is_the_product_of_rate_and_time(spread, width):
    """A rate of 4, spread by less than half of itself, times a time from 0 to 2."""
    required = replace(APE, interpretation="mixed")
    drifting = source("drift", 4.0, spread, width, period_s=2.0)
    found = total(contributions([drifting], required), required).quantile_rad
    rate = stats.norm(4.0, width) if spread == "gaussian" else stats.uniform(4.0 - width, 2.0 * width)
    times = 2.0 * (np.arange(4000) + 0.5) / 4000
    wanted = optimize.brentq(lambda size: np.mean(rate.sf(size / times)) - (1.0 - P), 1.0, 30.0)
    assert found == pytest.approx(wanted, rel=1e-2)


@pytest.mark.parametrize("turns", [0.25, 0.5, 1.0, 1.7])
def test_a_sinusoid_at_its_worst_is_the_largest_that_it_leaves_of_its_mean_in_a_window(turns):
    required = Requirement(ErrorIndex("RPE", 2.0), axes=(0,), interpretation="ensemble")
    found = total(contributions([source("periodic", 3.0, freq_hz=turns / 2.0)], required), required).quantile_rad
    phase, inside = np.linspace(0.0, 2.0 * np.pi, 721)[:, None], np.linspace(0.0, 1.0, 401)
    mean = (np.sin(phase + 2.0 * np.pi * turns) - np.sin(phase)) / (2.0 * np.pi * turns)
    left = 3.0 * np.abs(np.cos(phase + 2.0 * np.pi * turns * inside) - mean)
    assert found == pytest.approx(left.max(), rel=1e-4)


@pytest.mark.parametrize("rho", [-1.0, 1.0])
def test_a_coefficient_of_one_is_taken(rho):
    (found,) = budget(two(3.0, 4.0), [APE], [Correlation("a", "b", rho)])
    assert found.sigma_rad[0] == pytest.approx(abs(3.0 * rho + 4.0), rel=1e-9)


def test_a_constant_behind_a_transfer_is_what_it_comes_to_at_rest():
    slow = lti.StateSpace(np.array([[-2.0]]), np.array([[1.0]]), np.array([[4.0]]), np.array([[0.5]]))
    direct = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[0.5]]))
    for through, gain in ((slow, 2.5), (direct, 0.5)):
        found = total(contributions([source("constant", 2.0, gains=through)], APE), APE)
        assert found.quantile_rad == pytest.approx(2.0 * gain, rel=1e-12)


def test_the_worst_satellite_lies_three_sigma_or_the_half_width_out_and_away_from_zero():
    for shape, mean, worst in (("gaussian", 2.0, 5.0), ("gaussian", -2.0, -5.0), ("uniform", 2.0, 3.0)):
        assert Spread(shape, mean, 1.0).worst == worst
    assert Spread("fixed", -2.0).worst == -2.0
    turned = Spread("uniform", 2.0, 1.0).times(-2.0)
    assert (turned.shape, turned.mean, turned.width) == ("uniform", -4.0, 2.0)
    assert source("random", 0.0, "gaussian", 0.0).size.worst == 0.0


@pytest.mark.parametrize("sigmas", [10.0, 20.0, 40.0])
def test_what_lies_across_a_mean_of_tens_of_sigma_still_makes_it_longer(sigmas):
    off = case(2, mean=sigmas * np.array([0.6, 0.8]), covariance=np.eye(2))
    along = sigmas + stats.norm.ppf(P)
    wanted = stats.ncx2.ppf(P, 2, sigmas**2) ** 0.5
    assert wanted - along > 0.01
    assert alone(off, (0, 1)).quantile(P) == pytest.approx(wanted, rel=1e-6)


def asked(kind="APE", window_s=None, spacing_s=None, **more):
    return Requirement(ErrorIndex(kind, window_s, spacing_s), **{"axes": (0,)} | more)


PAIR = two()


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: asked(confidence=1.25), ValueError, "a confidence of 1.25: give a share above 0 and below 1"),
        (
            lambda: asked(interpretation="worst"),
            ValueError,
            'no interpretation "worst"; give one of temporal, ensemble, mixed',
        ),
        (
            lambda: asked(axes=(1, 1)),
            ValueError,
            "axes (1, 1): give one, or two for the radial error, by their places from 0",
        ),
        (
            lambda: asked(axes=(0, 1, 2)),
            ValueError,
            "axes (0, 1, 2): give one, or two for the radial error, by their places from 0",
        ),
        (lambda: asked(limit_rad=-2.5e-6), ValueError, "a limit of -2.5e-06 rad; give a finite one above zero"),
        (lambda: asked("PDE", 2.0, 7.0), ValueError, "PDE needs observation_s: give the time in s"),
        (lambda: asked("APE", observation_s=3.0), ValueError, "APE has no observation_s: leave it out"),
        (
            lambda: asked("PDE", 2.0, 7.0, observation_s=8.5),
            ValueError,
            "PDE: both windows have to lie in the observation period of 8.5 s; give it longer",
        ),
        (
            lambda: asked("PRE", 2.0, 7.0, observation_s=8.5),
            ValueError,
            "PRE: its windows lie in two observation periods of 8.5 s; space them wider",
        ),
        (
            lambda: contributions([source("random"), replace(source("random", gains=np.ones(3)), name="b")], asked()),
            ValueError,
            "b has gains for 3 axes, and a random error for 1; give all as many",
        ),
        (
            lambda: contributions([source("random"), source("random", 2.0)], asked()),
            ValueError,
            "two sources have one name; give each its own",
        ),
        (
            lambda: contributions(PAIR, asked(axes=(2,))),
            ValueError,
            "axis 2 is asked for, and the sources have 1 from 0 on",
        ),
        (
            lambda: contribution(source("drift", period_s=3.0), asked("RPE", 3.5)),
            ValueError,
            (
                "a drift error: RPE looks at 3.5 s, and it begins anew every 3 s; give shorter times, or "
                "the class that it has over many periods"
            ),
        ),
        (lambda: budget([], [asked()]), ValueError, "a budget without a source: give one or more"),
        (
            lambda: Spread("normal", 1.0, 2.0),
            ValueError,
            'no shape "normal" of a spread; give one of fixed, gaussian, uniform',
        ),
        (
            lambda: Spread("uniform", 1.0, -2.0),
            ValueError,
            "a spread of mean 1 and width -2: give finite ones, the width >= 0",
        ),
        (
            lambda: Spread("fixed", 1.0, 2.5),
            ValueError,
            'a fixed size has no width, and 2.5 is given: say "gaussian" or "uniform"',
        ),
        (
            lambda: source("ramp"),
            ValueError,
            (
                'a ramp error: no class "ramp"; give one of constant, per-observation, random, process, '
                "periodic, drift, transient"
            ),
        ),
        (lambda: source("drift"), ValueError, "a drift error: a drift error needs period_s; give it"),
        (
            lambda: source("random", period_s=3.0),
            ValueError,
            "a random error: a random error has no period_s; leave it out",
        ),
        (
            lambda: source("periodic", freq_hz=-2.5),
            ValueError,
            "a periodic error: freq_hz is -2.5; give a finite number above zero",
        ),
        (
            lambda: source("process"),
            ValueError,
            "a process error: a spectrum belongs to a process, and to nothing else",
        ),
        (
            lambda: source("random", -2.5),
            ValueError,
            "a random error: a random error of size -2.5; give a size of 0 or above",
        ),
        (
            lambda: source("random", gains=np.ones((2, 3))),
            ValueError,
            "a random error: its gains have the shape (2, 3); give a finite one for each axis",
        ),
        (
            lambda: source(
                "constant", gains=lti.StateSpace(np.array([[0.25]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
            ),
            ValueError,
            "a constant error: its transfer has a pole of 0.25 rad/s; give a stable system of one input",
        ),
        (
            lambda: source(
                "constant",
                gains=lti.StateSpace(np.array([[-0.25]]), np.ones((1, 2)), np.ones((1, 1)), np.zeros((1, 2))),
            ),
            ValueError,
            "a constant error: its transfer has 2 inputs; give a stable system of one input",
        ),
        (
            lambda: budget(PAIR, [asked()], [Correlation("a", "c", 0.5)]),
            ValueError,
            "correlation of a and c: name two sources out of a, b",
        ),
        (
            lambda: budget(PAIR, [asked()], [Correlation("a", "b", -1.5)]),
            ValueError,
            "correlation of a and b: the coefficient is -1.5; give one from -1 to 1",
        ),
        (
            lambda: budget(PAIR, [asked()], [Correlation("a", "b", 0.5), Correlation("b", "a", 0.25)]),
            ValueError,
            "two correlations are of the same sources; give each pair once",
        ),
        (
            lambda: budget(
                [*PAIR, replace(PAIR[0], name="c")],
                [asked()],
                [Correlation("a", "b", 0.87), Correlation("b", "c", 0.93), Correlation("a", "c", -0.71)],
            ),
            ValueError,
            (
                "correlations of a, b, c: their matrix has the eigenvalue -0.677, so that no errors can be "
                "correlated so; give a positive semidefinite one"
            ),
        ),
        (
            lambda: budget(
                [replace(each, kind="constant", size=Spread("gaussian", 0.0, 1.0)) for each in PAIR],
                [asked(interpretation="ensemble")],
                [Correlation("a", "b", 0.5)],
            ),
            ValueError,
            (
                "correlation of a and b: the sizes of correlated constants have no common distribution "
                "here; take the interpretation temporal or mixed"
            ),
        ),
        (
            lambda: budget(
                [PAIR[0], replace(PAIR[1], kind="constant", size=Spread("gaussian", 0.0, 1.0))],
                [asked()],
                [Correlation("a", "b", 0.5)],
            ),
            ValueError,
            (
                "correlation of a and b: only two Gaussian errors of one class, random or constant, that "
                "reach the axes by gains and alike have one; state the common cause as a source of its own"
            ),
        ),
    ],
)
def test_a_refusal_of_a_budget_says_its_names_and_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


ON_THREE = (
    ErrorSource("bias", "constant", Spread("gaussian", 0.7, 0.4), np.array([1.1, -0.6, 0.9])),
    ErrorSource("mount", "per-observation", Spread("uniform", 0.3, 0.5), np.array([0.4, 1.3, -0.8])),
    ErrorSource("noise", "random", Spread("fixed", 0.9), np.array([0.7, 0.5, 1.2]), apart=True),
    ErrorSource("wheel", "periodic", Spread("uniform", 1.2, 0.3), np.array([-0.5, 1.0, 0.6]), freq_hz=0.7),
    ErrorSource("heat", "drift", Spread("gaussian", 0.0, 0.02), np.array([1.5, 0.7, -1.1]), period_s=40.0),
    ErrorSource("step", "transient", Spread("fixed", -2.0), np.array([0.8, -1.4, 0.5]), period_s=60.0, decay_s=4.0),
)


def come_to(*axes, kind="APE", window_s=None, spacing_s=None, **more):
    """Mean, deviation, sum by the rules and quantile of all of them."""
    (found,) = budget(ON_THREE, [Requirement(ErrorIndex(kind, window_s, spacing_s), axes=axes, **more)])
    return [*found.mean_rad, *found.sigma_rad, found.by_rules_rad, found.quantile_rad]


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: come_to(0), [4.10332978, 1.35355348, 8.16395909, 7.44546399]),
    (lambda: come_to(2, interpretation="ensemble", confidence=0.95),
     [5.45235247, 0.666622543, 6.75890865, 6.65424658]),
    (lambda: come_to(1, interpretation="mixed", confidence=0.9),
     [0.156672887, 1.21118128, 2.14888881, 1.95327418]),
    (lambda: come_to(2, 1, confidence=0.95),
     [2.32333111, 0.926672887, 1.4768512, 1.33760735, 6.40665738, 5.38605614]),
    (lambda: come_to(1, kind="MPE", window_s=3.0), [0.878238859, 0.566351076, 2.57727905, 3.02490367]),
    (lambda: come_to(2, kind="MPE", window_s=3.0, interpretation="mixed"),
     [0.340628979, 0.668774294, 2.34693647, 2.43059298]),
    (lambda: come_to(0, kind="RPE", window_s=2.5, interpretation="ensemble"),
     [2.98989418, 0.100323595, 3.29086266, 3.19912315]),
    (lambda: come_to(1, kind="RPE", window_s=2.5), [0.000130100149, 1.14658658, 3.43986346, 2.58115881]),
    (lambda: come_to(2, kind="PDE", window_s=1.5, spacing_s=9.0, observation_s=30.0),
     [0.654284053, 0.145727487, 1.09146316, 1.33604563]),
    (lambda: come_to(1, kind="PRE", window_s=1.5, spacing_s=47.0, observation_s=30.0,
            interpretation="mixed"),
     [0.00293206852, 0.833789906, 2.5042826, 2.91626574]),
    (lambda: come_to(0, kind="PRE", window_s=1.5, spacing_s=47.0, observation_s=30.0,
            interpretation="ensemble"),
     [2.27465604, 0.604481499, 4.08808663, 4.46978679]),
    (lambda: [x for each in shares(budget(ON_THREE, [Requirement(ErrorIndex("APE"), axes=(2,),
            confidence=0.95, limit_rad=9.0)])[0]) for x in (each.without_rad, each.growth,
            each.allowed, *each.mean_rad, *each.sigma_rad)],
     [
        3.08656149, 0.414085425, 2.93000612, 1.32, 0.762102355, 3.11378286, 0.359814127, 3.48398338, 1.71, 0.0,
        4.01602378, 0.273201696, 3.58740531, 0.0, 1.08, 4.51184443, 0.0960738282, 6.69838259, 0.0, 0.636396103,
        4.80490427, -0.00851036174, 23.9085438, -0.0666688883, 0.169969018, 5.3923795, -0.134667236, 14.8915406,
        -0.64, 0.0,
    ]),
    (lambda: [x for each in shares(budget(ON_THREE[:2], [Requirement(ErrorIndex("APE"), axes=(0, 2),
            confidence=0.95, limit_rad=9.0)])[0]) for x in (each.without_rad, each.growth,
            each.allowed)],
     [0.715541753, 0.987573709, 3.38115684, 2.70040738, 0.0124262908, 12.8583092]),
    (lambda: [*(found := budget([ON_THREE[0], replace(ON_THREE[0], name="b", size=Spread("gaussian", 0.2,
            0.9)), ON_THREE[2]], [Requirement(ErrorIndex("APE"), axes=(0,))], [Correlation("bias", "b",
            -0.4)])[0]).mean_rad, *found.sigma_rad, found.quantile_rad],
     [3.71524861, 0.63, 5.4680034]),
    (lambda: beyond(budget(ON_THREE, [Requirement(ErrorIndex("APE"), axes=(1,))])[0], np.array([0.5, 2.0,
            6.0])),
     [0.762984964, 0.232716272, 7.93689069e-05]),
])  # fmt: skip
def test_budgets_of_sources_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


def alone_of(kind, spread, mean, width, takes="APE", times=(None, None, None), how="temporal", axes=(0,), **more):
    """Mean, deviation, sum by the rules and quantile of one source by itself."""
    gains = more.pop("gains", np.array([1.2, -0.7]))
    one = ErrorSource("one", kind, Spread(spread, mean, width), gains, **more)
    window_s, spacing_s, observation_s = times
    asked = Requirement(ErrorIndex(takes, window_s, spacing_s), 0.95, how, axes, observation_s=observation_s)
    (found,) = budget([one], [asked])
    return [*found.mean_rad, *found.sigma_rad, found.by_rules_rad, found.quantile_rad]


RINGS = lti.StateSpace(
    np.array([[0.0, 1.0], [-9.0, -0.8]]), np.array([[0.0], [1.0]]), np.array([[4.0, 0.0], [0.0, 1.5]]), np.zeros((2, 1))
)
PDE, PRE = (1.5, 9.0, 30.0), (1.5, 47.0, 30.0)


def stated_as(kind, statistic, **more):
    """Spread, times and spectrum of a source that a mission states."""
    table = BudgetSource.model_construct(
        kind=kind, statistic=statistic, gains=(1.0, 0.5), axes="each", **{**NO_TIMES, **more}
    )
    one = source_of("one", table, "here")
    spectrum = [] if one.process is None else [*one.process.A.ravel(), (one.process.C @ one.process.B).item() ** 2]
    times = [each for each in (one.freq_hz, one.period_s, one.decay_s) if each is not None]
    return [one.size.mean, one.size.width, one.size.worst, one.even_in_time, one.apart, *times, *spectrum]


NO_TIMES = dict.fromkeys(("size_rad", "rate_rad_s", "corner_hz", "frequency_hz", "period_s", "decay_s"))
ASKED = BudgetRequirement.model_construct(
    index="PDE", window_s=1.5, spacing_s=9.0, observation_s=30.0, confidence=0.93, interpretation="mixed", axes="z",
    limit_rad=7e-6,
)  # fmt: skip


@cache
def spectral():
    return judge(
        stated(
            [
                ErrorSource("hum", "process", Spread("gaussian", 1.5, 0.2), np.array([0.6, -1.1]),
                            process=first_order(0.02, 3.0, convention="per-axis", name="hum")),
                ErrorSource("wheel", "periodic", Spread("fixed", 0.4), np.array([0.3, 0.9]), freq_hz=17.0),
            ],
            {"a": Requirement(ErrorIndex("RPE", 0.2), limit_rad=4.0), "b": replace(APE, confidence=0.9, axes=(1,))},
        ),
        None,
    )  # fmt: skip


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: alone_of("per-observation", "gaussian", 0.3, 0.5, "PRE", PRE, "temporal"), "3.6 0 3.6 3.6"),
    (lambda: alone_of("per-observation", "uniform", 0.3, 0.5, "PRE", PRE, "temporal", (1,)), "0.7 0 0.7 0.7"),
    (lambda: alone_of("constant", "uniform", 0.4, 0.9, how="temporal"), "1.56 0 1.56 1.56"),
    (lambda: alone_of("constant", "gaussian", -0.4, 0.9, how="temporal", axes=(1,)), "2.17 0 2.17 2.17"),
    (lambda: alone_of("drift", "uniform", 0.02, 0.03, "APE", how="temporal", period_s=40.0),
     "1.2 0.692820323 2.55790288 2.28"),
    (lambda: alone_of("periodic", "gaussian", 1.1, 0.8, "MPE", (0.4, None, None), "temporal", freq_hz=0.7),
     "0 2.60139617 5.0986428 3.66758883"),
    (lambda: alone_of("transient", "fixed", 1.3, 0.0, "MPE", (2.0, None, None), "temporal", (1,), period_s=9.0,
            decay_s=3.0, gains=RINGS),
     "-0.0208915461 0.023121252 0.0662083673 0.0781506148"),
    (lambda: alone_of("transient", "uniform", 0.0, 1.3, "PDE", PDE, "temporal", period_s=50.0, decay_s=6.0),
     "0.162659341 0.24672253 0.646226613 0.771863626"),
    (lambda: alone_of("per-observation", "gaussian", 0.3, 0.5, "PRE", PRE, "ensemble"),
     "0.677369753 0.511753773 1.68038872 1.6634988"),
    (lambda: alone_of("per-observation", "uniform", 0.3, 0.5, "PRE", PRE, "ensemble", (1,)),
     "0.233361816 0.165011719 0.556778843 0.543555754"),
    (lambda: alone_of("constant", "uniform", 0.4, 0.9, how="ensemble"),
     "0.646666667 0.448355018 1.52542635 1.45198407"),
    (lambda: alone_of("constant", "gaussian", -0.4, 0.9, how="ensemble", axes=(1,)),
     "0.55178586 0.413893195 1.36300162 1.34791408"),
    (lambda: alone_of("drift", "uniform", 0.02, 0.03, "APE", how="ensemble", period_s=40.0),
     "1.04 0.728834686 2.46848974 2.25597628"),
    (lambda: alone_of("periodic", "gaussian", 1.1, 0.8, "MPE", (0.4, None, None), "ensemble", freq_hz=0.7),
     "1.22159272 0.743546723 2.67891752 2.54094495"),
    (lambda: alone_of("transient", "fixed", 1.3, 0.0, "RPE", (2.0, None, None), "ensemble", period_s=50.0,
            decay_s=3.0, gains=RINGS),
     "0.500775341 0 0.500775341 0.500775341"),
    (lambda: alone_of("transient", "uniform", 0.0, 1.3, "PDE", PDE, "ensemble", period_s=50.0, decay_s=6.0),
     "0.535826245 0.309359427 1.14215958 1.01806987"),
    (lambda: alone_of("per-observation", "gaussian", 0.3, 0.5, "PRE", PRE, "mixed"),
     "0 0.848528137 1.66308459 1.66308459"),
    (lambda: alone_of("per-observation", "uniform", 0.3, 0.5, "PRE", PRE, "mixed", (1,)),
     "0 0.285773803 0.560106362 0.543475242"),
    (lambda: alone_of("constant", "uniform", 0.4, 0.9, how="mixed"), "0.48 0.623538291 1.70211259 1.452"),
    (lambda: alone_of("constant", "gaussian", -0.4, 0.9, how="mixed", axes=(1,)), "0.28 0.63 1.51477731 1.34740167"),
    (lambda: alone_of("drift", "uniform", 0.02, 0.03, "APE", how="mixed", period_s=40.0),
     "0.48 0.554256258 1.5663223 1.62046288"),
    (lambda: alone_of("periodic", "gaussian", 1.1, 0.8, "MPE", (0.4, None, None), "mixed", freq_hz=0.7),
     "0 1.01093752 1.98140113 2.03744794"),
    (lambda: alone_of("transient", "fixed", 1.3, 0.0, "MPE", (2.0, None, None), "mixed", (1,), period_s=9.0,
            decay_s=3.0, gains=RINGS),
     "-0.0208915461 0.023121252 0.0662083673 0.0781506148"),
    (lambda: alone_of("transient", "uniform", 0.0, 1.3, "PDE", PDE, "mixed", period_s=50.0, decay_s=6.0),
     "0 0.170616595 0.334402382 0.419824042"),
    (lambda: alone_of("periodic", "fixed", 1.3, 0.0, "RPE", (2.0, None, None), freq_hz=0.7),
     "0 1.07698874 2.11085914 1.74411996"),
    (lambda: alone_of("periodic", "fixed", 1.3, 0.0, "RPE", (2.0, None, None), freq_hz=9.0),
     "0 1.10308658 2.16200997 1.55519104"),
    (lambda: alone_of("periodic", "fixed", 1.3, 0.0, "RPE", (2.0, None, None), "ensemble", freq_hz=0.3),
     "1.9524331 0 1.9524331 1.9524331"),
    (lambda: alone_of("periodic", "fixed", 1.3, 0.0, "PDE", PDE, freq_hz=0.7, gains=RINGS, axes=(0, 1)),
     "0 0 0.0258219913 0.0425891436 0.0976174301 0.0600753388"),
    (lambda: alone_of("random", "fixed", 1.3, 0.0, even_in_time=True, apart=True, axes=(0, 1)),
     "0 0 0.90066642 0.525388745 2.04366389 1.57743954"),
    (lambda: alone_of("random", "uniform", 1.3, 0.4, "RPE", (2.0, None, None), "mixed"),
     "0 1.58442419 3.10541434 3.15221005"),
    (lambda: alone_of("constant", "uniform", 0.0, 0.9, how="ensemble"), "0.54 0.311769145 1.1510563 1.026"),
    (lambda: alone_of("constant", "uniform", 0.9, 0.4, how="ensemble"), "1.08 0.277128129 1.62316115 1.512"),
    (lambda: alone_of("drift", "fixed", 0.02, 0.0, "PRE", (1.5, 80.0, 30.0), "mixed", period_s=40.0), "0 0 0 0"),
    (lambda: alone_of("drift", "fixed", 0.02, 0.0, "PRE", (1.5, 93.0, 30.0), "mixed", period_s=40.0),
     "0 0.449639856 0.881277924 0.6479922"),
    (lambda: alone_of("transient", "fixed", 2.0, 0.0, "MPE", (7.0, None, None), period_s=50.0, decay_s=0.4),
     "0.0012757991 0.009265774 0.0194363824 0.000623181984"),
    (lambda: [x for each in shares(budget([source("constant", 3.0), replace(source("constant", -1.0), name="b")],
            [Requirement(ErrorIndex("APE"), axes=(0,), limit_rad=5.0)])[0]) for x in (each.growth, each.without_rad,
            each.allowed, each.part_rad)],
     "1.5 1 2 3 -0.5 3 8 -1"),
    (lambda: [x for each in shares(budget([source("constant", 3.0), replace(source("constant", -3.0), name="b")],
            [Requirement(ErrorIndex("APE"), axes=(0,))])[0]) for x in (each.growth, each.without_rad)],
     "0 3 0 3"),
    (lambda: stated_as("drift", "2-sigma", rate_rad_s=3e-7, period_s=40.0), "0 1.5e-07 4.5e-07 0 1 40"),
    (lambda: stated_as("constant", "bound", size_rad=4e-6), "0 4e-06 4e-06 0 1"),
    (lambda: stated_as("constant", "fixed", size_rad=4e-6), "4e-06 0 4e-06 0 1"),
    (lambda: stated_as("random", "3-sigma", size_rad=6e-6), "2e-06 0 2e-06 0 1"),
    (lambda: stated_as("random", "bound", size_rad=6e-6), "6e-06 0 6e-06 1 1"),
    (lambda: stated_as("process", "1-sigma", size_rad=6e-6, corner_hz=2.5), "6e-06 0 6e-06 0 1 -15.7079633 31.4159265"),
    (lambda: stated_as("periodic", "3-sigma", size_rad=6e-6, frequency_hz=0.3), "0 2e-06 6e-06 0 1 0.3"),
    (lambda: stated_as("transient", "1-sigma", size_rad=6e-6, decay_s=3.0, period_s=70.0), "0 6e-06 1.8e-05 0 1 70 3"),
    (lambda: [(r := requirement_of(ASKED)).confidence, *r.axes, r.limit_rad, r.observation_s, r.index.window_s,
            r.index.spacing_s],
     "0.93 2 7e-06 30 1.5 9"),
    (lambda: [x for each in spectral().judged for x in (each.total.quantile_rad, each.total.by_rules_rad,
            each.size_rad[-1], each.size_rad.size, each.beyond[40])],
     "1.97250857 2.05120111 5.2 97 0.000966489818 1.23950487 1.23934626 1.61135633 97 0.373827467"),
    (lambda: [spectral().freq_hz[0], spectral().freq_hz[-1], spectral().freq_hz.size, *spectral().lines_hz.values()],
     "0.1 510 320 17"),
    (lambda: [spectral().spectra["hum"][at] for at in (0, 100, 319)], "0.138320311 0.11216471 4.7913221e-06"),
])  # fmt: skip
def test_sources_by_themselves_under_each_index_and_interpretation_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=1e-15, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: contributions([source("random", gains=np.ones(2))], Requirement(ErrorIndex("APE"), axes=(0, 2))),
     "axis 2 is asked for, and the sources have 2 from 0 on"),
    (lambda: contributions([source("random"), replace(source("random", gains=np.ones(2)), name="b")], APE),
     "b has gains for 2 axes, and a random error for 1; give all as many"),
    (lambda: contributions([source("random"), source("random")], APE), "two sources have one name; give each its own"),
    (lambda: Requirement(ErrorIndex("APE"), 1.0), "a confidence of 1: give a share above 0 and below 1"),
    (lambda: Requirement(ErrorIndex("APE"), interpretation="worst"),
     'no interpretation "worst"; give one of temporal, ensemble, mixed'),
    (lambda: Requirement(ErrorIndex("APE"), axes=()),
     "axes (): give one, or two for the radial error, by their places from 0"),
    (lambda: Requirement(ErrorIndex("APE"), axes=(1, 1)),
     "axes (1, 1): give one, or two for the radial error, by their places from 0"),
    (lambda: Requirement(ErrorIndex("APE"), axes=(-1,)),
     "axes (-1,): give one, or two for the radial error, by their places from 0"),
    (lambda: Requirement(ErrorIndex("APE"), limit_rad=0.0), "a limit of 0 rad; give a finite one above zero"),
    (lambda: Requirement(ErrorIndex("APE"), observation_s=3.0), "APE has no observation_s: leave it out"),
    (lambda: Requirement(ErrorIndex("PDE", 1.0, 2.0)), "PDE needs observation_s: give the time in s"),
    (lambda: Requirement(ErrorIndex("PDE", 1.0, 2.5), observation_s=3.25),
     "PDE: both windows have to lie in the observation period of 3.25 s; give it longer"),
    (lambda: Requirement(ErrorIndex("PRE", 1.0, 2.5), observation_s=3.25),
     "PRE: its windows lie in two observation periods of 3.25 s; space them wider"),
    (lambda: alone_of("drift", "fixed", 1.0, 0.0, "PDE", (1.0, 9.0, 30.0), period_s=10.0),
     "one: PDE looks at 10 s, and it begins anew every 10 s; give shorter times, or the class that it has over "
     "many periods"),
    (lambda: alone_of("transient", "fixed", 1.0, 0.0, "MPE", (12.0, None, None), period_s=10.0, decay_s=1.0),
     "one: MPE looks at 12 s, and it begins anew every 10 s; give shorter times, or the class that it has over "
     "many periods"),
    (lambda: alone_of("transient", "fixed", 1.0, 0.0, "PRE", (5.5, 45.0, 30.0), period_s=10.0, decay_s=1.0),
     "one: no two windows of 5.5 s so far apart lie within periods; give shorter ones"),
    (lambda: alone_of("random", "fixed", 1.0, 0.0, gains=RINGS),
     "one: an error that is anew from moment to moment has no spectrum, so that nothing is known of it behind a "
     'transfer; give gains, or the class "process"'),
    (lambda: alone_of("drift", "fixed", 1.0, 0.0, gains=RINGS, period_s=10.0),
     "one: behind a transfer each new begin of a drift is a step, of which its rate says nothing; give gains, or "
     "what is left as a process"),
    (lambda: Spread("even", 1.0), 'no shape "even" of a spread; give one of fixed, gaussian, uniform'),
    (lambda: Spread("gaussian", 1.0, -1.0), "a spread of mean 1 and width -1: give finite ones, the width >= 0"),
    (lambda: Spread("uniform", math.inf, 1.0), "a spread of mean inf and width 1: give finite ones, the width >= 0"),
    (lambda: Spread("fixed", 1.0, 0.25), 'a fixed size has no width, and 0.25 is given: say "gaussian" or "uniform"'),
    (lambda: source("noise"),
     'a noise error: no class "noise"; give one of constant, per-observation, random, process, periodic, drift, '
     "transient"),
    (lambda: source("periodic"), "a periodic error: a periodic error needs freq_hz; give it"),
    (lambda: source("random", freq_hz=1.0), "a random error: a random error has no freq_hz; leave it out"),
    (lambda: source("drift", period_s=0.0), "a drift error: period_s is 0; give a finite number above zero"),
    (lambda: source("process"), "a process error: a spectrum belongs to a process, and to nothing else"),
    (lambda: source("random", -1.5), "a random error: a random error of size -1.5; give a size of 0 or above"),
    (lambda: source("random", gains=np.ones((2, 1))),
     "a random error: its gains have the shape (2, 1); give a finite one for each axis"),
    (lambda: source("constant", gains=np.array([1.0, math.nan])),
     "a constant error: its gains are [1.0, nan]; give a finite one for each axis"),
    (lambda: budget([], [APE]), "a budget without a source: give one or more"),
    (lambda: budget(two(), [APE], [Correlation("a", "c", 0.5)]),
     "correlation of a and c: name two sources out of a, b"),
    (lambda: budget(two(), [APE], [Correlation("a", "a", 0.5)]),
     "correlation of a and a: name two sources out of a, b"),
    (lambda: budget(two(), [APE], [Correlation("a", "b", 1.25)]),
     "correlation of a and b: the coefficient is 1.25; give one from -1 to 1"),
])  # fmt: skip
def test_a_refusal_of_a_budget_of_two_axes_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


def test_a_line_that_the_loop_leaves_is_a_sine_on_each_axis_that_it_shakes(monkeypatch):
    """Its variance is half the square of its amplitude; an axis at rest gets none, nor does a line that is gone."""
    left = [("wheel", np.array([8e-12, 0.0])), ("both", np.array([2e-12, 4.5e-12])), ("gone", np.zeros(2))]
    monkeypatch.setattr(assembly, "windowed_noise", lambda closed, index: {"noise": np.array([1e-12, 3e-12])})
    monkeypatch.setattr(assembly, "windowed_lines", lambda closed, index: left)
    closed = SimpleNamespace(controller=SimpleNamespace(name="PI"))
    found = {each.name: each for each in assembly.loop_contributions(closed, Requirement(ErrorIndex("APE")))}
    assert {name: len(each.parts) for name, each in found.items()} == {"noise": 1, "wheel": 1, "both": 2}
    assert {each.kind for each in found.values()} == {"loop"}
    amplitudes = {name: [abs(part.amplitude[0]).tolist() for part in found[name].parts] for name in ("wheel", "both")}
    assert amplitudes["wheel"] == [pytest.approx([4e-6, 0.0])]
    assert amplitudes["both"] == [pytest.approx([2e-6, 0.0]), pytest.approx([0.0, 3e-6])]
    assert np.diag(found["noise"].parts[0].covariance[0]) == pytest.approx([1e-12, 3e-12])


def hum(*corners_hz):
    """Sources whose spectra end at some corners."""
    return [
        replace(
            source("process", process=first_order(0.02, corner, convention="per-axis", name="hum")), name=f"{corner}"
        )
        for corner in corners_hz
    ]


@pytest.mark.parametrize(("corners_hz", "lines_hz", "index", "slowest_hz", "fastest_hz"), [
    ((3.0,), (), ErrorIndex("APE"), 3.0, 3.0),
    ((3.0, 40.0), (), ErrorIndex("APE"), 3.0, 40.0),
    ((3.0,), (17.0, 500.0, 0.02), ErrorIndex("APE"), 0.02, 500.0),
    ((3.0,), (17.0,), ErrorIndex("RPE", 1e-3), 3.0, 1e3),
    ((40.0, 3.0), (), ErrorIndex("MPE", 25.0), 0.04, 40.0),
    ((3.0,), (), ErrorIndex("PDE", 0.5, 200.0), 0.005, 3.0),
])  # fmt: skip
def test_spectra_reach_thirty_times_beyond_all_that_is_slow_or_fast(
    corners_hz, lines_hz, index, slowest_hz, fastest_hz
):
    lines = [replace(source("periodic", freq_hz=freq), name=f"line of {freq} Hz") for freq in lines_hz]
    asked = {"own": Requirement(index, axes=(0,), observation_s=1e3 if index.takes == "PDE" else None), "APE": APE}
    found = judge(stated([*hum(*corners_hz), *lines], asked), None)
    assert (found.freq_hz[0], found.freq_hz[-1]) == pytest.approx((slowest_hz / 30.0, 30.0 * fastest_hz), rel=1e-9)
    assert list(found.spectra) == [f"{corner}" for corner in corners_hz]
    assert found.lines_hz == {f"line of {freq} Hz": freq for freq in lines_hz}


@pytest.mark.parametrize(("every", "with_loop"), [(1, True), (3, True), (1, False)])
def test_the_loop_has_a_spectrum_up_to_half_its_rate_where_it_is_a_source_and_reads_every_sample(
    monkeypatch, every, with_loop
):
    def left(closed, freq_hz):
        assert every == 1
        return np.outer(freq_hz, [1.0, 2.0])

    timing, optical = SimpleNamespace(period_s=1e-3), SimpleNamespace(every=every)
    loop = SimpleNamespace(open=SimpleNamespace(loop=SimpleNamespace(timing=timing, optical=optical)))
    loop.controller = SimpleNamespace(name="PI")
    monkeypatch.setattr(assembly, "residual_spectrum", left)
    monkeypatch.setattr(assembly, "windowed_noise", lambda closed, index: {"noise": np.array([9.0])})
    monkeypatch.setattr(assembly, "windowed_lines", lambda closed, index: [])
    found = judge(replace(stated(hum(40.0), {"APE": APE}), with_loop=with_loop), loop)
    names = [each.name for each in found.judged[0].total.contributions]
    assert names == (["40.0", "noise"] if with_loop else ["40.0"])
    low, high = (0.05, 1200.0) if with_loop else (40.0 / 30.0, 1200.0)
    assert (found.freq_hz[0], found.freq_hz[-1]) == pytest.approx((low, high), rel=1e-9)
    drawn = with_loop and every == 1
    assert list(found.spectra) == ["40.0", *(["left by the loop under PI"] if drawn else [])]
    if drawn:
        density = found.spectra["left by the loop under PI"]
        held = found.freq_hz < 500.0
        assert density[held] == pytest.approx(3.0 * found.freq_hz[held]) and np.isnan(density[~held]).all()


def of_table(**others):
    """A source of a mission's table."""
    given = {**NO_TIMES, "statistic": "3-sigma", "gains": (1.0, 1.0), "axes": "together", **others}
    return BudgetSource.model_construct(**given)


def test_each_source_of_a_table_comes_from_the_line_with_its_size_or_rate():
    table = SimpleNamespace(
        sources={
            "ramp": of_table(kind="drift", rate_rad_s=3e-9, period_s=50.0),
            "bench": of_table(kind="constant", size_rad=6e-6),
            "hum": of_table(kind="process", statistic="1-sigma", size_rad=4e-6, corner_hz=3.0),
        }
    )
    lines = {
        "error_budget.sources.ramp.rate": Source(3, "datasheet: Table 1"),
        "error_budget.sources.ramp.size": Source(4, "of another"),
        "error_budget.sources.bench.size": Source(5, "", "6 urad", "bench.toml"),
    }
    found = assembly.sources_of(table, lines)
    assert [(each.name, each.kind, each.origin) for each in found] == [
        ("ramp", "drift", "datasheet: Table 1"),
        ("bench", "constant", "bench.toml, line 5"),
        ("hum", "process", "not stated"),
    ]
    assert [(each.size.mean, each.size.width) for each in found] == [
        pytest.approx(pair) for pair in ((0.0, 1e-9), (0.0, 2e-6), (4e-6, 0.0))
    ]


@pytest.mark.parametrize(("axes", "places"), [("x", (0,)), ("y", (1,)), ("z", (2,)), ("radial", (0, 1))])
def test_a_requirement_is_about_the_axes_that_its_table_names(axes, places):
    asked = ASKED.model_copy(update={"axes": axes})
    assert requirement_of(asked) == replace(requirement_of(ASKED), axes=places)


def test_correlations_of_a_table_stand_in_its_order_and_are_none_without_one():
    given = {
        "late": SimpleNamespace(first="c", second="a", coefficient=-0.25),
        "early": SimpleNamespace(first="a", second="b", coefficient=0.5),
    }
    found = assembly.correlations_of(SimpleNamespace(correlations=given))
    assert found == (Correlation("c", "a", -0.25), Correlation("a", "b", 0.5))
    assert assembly.correlations_of(SimpleNamespace(correlations=None)) == assembly.correlations_of(None) == ()


HUM = first_order(0.02, 3.0, convention="per-axis", name="hum")
THROUGH = lti.StateSpace(np.array([[-4.0]]), np.array([[1.0]]), np.array([[4.0]]), np.array([[0.0]]))


@pytest.mark.parametrize(("made", "said"), [
    (
        lambda: replace(
            source("process", process=HUM),
            size=Spread("gaussian", 1.0, 0.2),
            process=replace(HUM, lines=(SpectralLine(3.0, 1e-6),)),
        ),
        "a process error: the lines of a process have one size; give them as periodic errors instead",
    ),
    (
        lambda: source("constant", gains=THROUGH, apart=True),
        "a constant error: errors apart by axis need gains; give a source for each axis instead",
    ),
    (
        lambda: source("constant", gains=replace(THROUGH, A=np.array([[0.5]]))),
        "a constant error: its transfer has a pole of 0.5 rad/s; give a stable system of one input",
    ),
    (
        lambda: contribution(
            source("transient", gains=THROUGH, period_s=40.0, decay_s=0.25), Requirement(ErrorIndex("APE"), axes=(0,))
        ),
        "a transient error: its time constant of 0.25 s is a pole of its transfer; move one by 0.1 %",
    ),
])  # fmt: skip
def test_a_source_that_nothing_is_known_of_is_refused_in_one_whole_sentence(made, said):
    with pytest.raises(ValueError) as refused:
        made()
    assert str(refused.value) == said


@pytest.mark.parametrize(("call", "said"), [
    (lambda: Requirement(ErrorIndex("PRE", 1.0, 2.5), observation_s=10.0 / 3.0),
     "PRE: its windows lie in two observation periods of 3.33333 s; space them wider"),
    (lambda: Requirement(ErrorIndex("PDE", 1.0, 2.5), observation_s=10.0 / 3.0),
     "PDE: both windows have to lie in the observation period of 3.33333 s; give it longer"),
    (lambda: Requirement(ErrorIndex("APE"), limit_rad=-1e-6 / 3.0),
     "a limit of -3.33333e-07 rad; give a finite one above zero"),
    (lambda: Requirement(ErrorIndex("APE"), confidence=4.0 / 3.0),
     "a confidence of 1.33333: give a share above 0 and below 1"),
])  # fmt: skip
def test_a_refusal_of_a_requirement_has_six_digits_of_a_number_that_has_more(call, said):
    with pytest.raises(ValueError) as refused:
        call()
    assert str(refused.value) == said


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("kind", "name", "rest"),
    [("periodic", "freq_hz", {}), ("drift", "period_s", {}), ("transient", "decay_s", {"period_s": 7.0})],
)
def test_each_time_of_a_source_is_finite_and_above_nothing(kind, name, rest, value):
    with pytest.raises(ValueError, match=f"^a {kind} error: {name} is {value:g}; give a finite number above zero$"):
        source(kind, **rest, **{name: value})


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: Spread("gaussian", -math.inf), "a spread of mean -inf and width 0: give finite ones, the width >= 0"),
        (lambda: Spread("gaussian", 1.0, math.nan), "a spread of mean 1 and width nan: give finite ones"),
        (lambda: source("constant", gains=[math.inf, 1.0]), "its gains are [inf, 1.0]; give a finite one"),
        (lambda: source("constant", gains=[1.0, -math.inf]), "its gains are [1.0, -inf]; give a finite one"),
        (lambda: replace(APE, confidence=math.nan), "a confidence of nan: give a share above 0 and below 1"),
        (lambda: replace(APE, confidence=-0.5), "a confidence of -0.5: give a share above 0 and below 1"),
        (lambda: replace(APE, limit_rad=math.nan), "a limit of nan rad; give a finite one above zero"),
        (lambda: replace(APE, axes=(0, -1)), "axes (0, -1): give one, or two for the radial error"),
        (lambda: budget(two(), [APE], [Correlation("c", "b", 0.5)]), "correlation of c and b: name two sources out of"),
        (lambda: budget(two(), [APE], [Correlation("c", "d", 0.5)]), "correlation of c and d: name two sources out of"),
        (lambda: budget(two(), [APE], [Correlation("a", "b", math.nan)]), "the coefficient is nan; give one from -1"),
        (lambda: budget(two(), [APE], [Correlation("a", "b", 1.001)]), "the coefficient is 1.001; give one from -1"),
    ],
)
def test_a_budget_is_refused_on_the_other_side_of_each_limit_too(build, said):
    with pytest.raises(ValueError) as refused:
        build()
    assert said in str(refused.value)


def test_a_third_source_of_more_or_of_fewer_axes_than_the_first_is_named():
    first, second = (replace(source("random", gains=np.ones(2)), name=name) for name in "ab")
    for axes in (1, 3):
        third = replace(source("random", gains=np.ones(axes)), name="c")
        with pytest.raises(ValueError, match=f"^c has gains for {axes} axes, and a for 2; give all as many$"):
            contributions([first, second, third], APE)


def test_windows_that_just_fill_their_period_of_observation_lie_in_it():
    """The PDE's two windows end with the period, and the PRE's second one begins a whole period behind the first."""
    assert asked("PDE", 2.0, 7.0, observation_s=9.0).observation_s == 9.0
    with pytest.raises(
        ValueError, match=r"PDE: both windows have to lie in the observation period of 8\.999 s; give it"
    ):
        asked("PDE", 2.0, 7.0, observation_s=8.999)
    assert asked("PRE", 2.0, 7.0, observation_s=7.0).observation_s == 7.0
    with pytest.raises(
        ValueError, match=r"PRE: its windows lie in two observation periods of 7\.001 s; space them wider"
    ):
        asked("PRE", 2.0, 7.0, observation_s=7.001)


def test_a_spread_is_at_its_worst_away_from_zero_and_no_narrower_when_it_is_turned_round():
    wide = {shape: Spread(shape, -2.0, 0.5) for shape in ("gaussian", "uniform")}
    assert (wide["gaussian"].worst, wide["uniform"].worst) == (-3.5, -2.5)
    for shape, spread in wide.items():
        turned = spread.times(-3.0)
        assert (turned.shape, turned.mean, turned.width) == (shape, 6.0, 1.5)
        assert turned.worst == -3.0 * spread.worst


@pytest.mark.parametrize("limit", [None, 1e-6, 40.0])
def test_sizes_and_spectra_of_a_budget_are_those_of_all_axes_at_the_worst_satellite(limit):
    """A spectrum stands with the largest size that there is, and sizes reach beyond total and limit."""
    gains = np.array([3.0, -4.0])
    hum_there = replace(hum(3.0)[0], size=Spread("gaussian", 0.5, 0.25), transfer=gains)
    asked_for = {"APE": replace(APE, axes=(1,), limit_rad=limit)}
    found = judge(stated([hum_there], asked_for), None)
    (judged,) = found.judged
    assert judged.size_rad[0] == 0.0
    assert judged.size_rad[-1] == pytest.approx(1.3 * max(judged.total.quantile_rad, limit or 0.0), rel=1e-12)
    (single,) = hum(3.0)
    plain = judge(stated([single], {"APE": APE}), None)
    assert found.freq_hz == pytest.approx(plain.freq_hz, rel=1e-12)
    assert found.spectra["3.0"] == pytest.approx(1.25**2 * 25.0 * plain.spectra["3.0"], rel=1e-9)
