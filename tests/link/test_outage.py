"""What pointing errors cost the link: against closed forms, quadrature and budgets of errors that stand still."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.special import ive

from link_files import PATTERN, RECEIVERS, link_file, received_with
from microrad import link
from microrad.link import beams, pointing
from microrad.link.pointing import fading, statistics
from microrad.link.pointing import outage as link_performance
from microrad.link.pointing.outage import ErrorDistribution
from microrad.loop import paper_cases as tracking
from microrad.loop import sine_run as simulate
from microrad.loop.controller_study import FinePointingStudy, Residual, Verified
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.study import pointing_penalty as performance
from shipped import edited

URAD = 1e-6
HALF_RAD = 1.55e-6 / (math.pi * 0.025)
DB_PER_SQUARE = 20 / math.log(10)
OUTAGE, REQUIRED_DB = 0.003, 3.0
ON_AXIS_DB = 3.000394037846604 + DB_PER_SQUARE * (10e-6 / HALF_RAD) ** 2  # the budget's margin, its pointing undone
RATE_BIT_S = 300e6


def costs_of(m, runs, fine):
    """What the residuals of the loops cost a mission's link."""
    return performance.performance_of_loops(link.of(m), m.conventions.residual, runs, fine)


def loss_db(radius_rad):
    return DB_PER_SQUARE * (radius_rad / HALF_RAD) ** 2


def jittery(bias_urad, rms_urad, bandwidth_hz=40):
    """The table [jitter]."""
    bias, rms = ([f"{value} urad" for value in pair] for pair in (bias_urad, rms_urad))
    return {"jitter": {"bias": bias, "rms": rms, "bandwidth": f"{bandwidth_hz} Hz"}}


def under(folder, *changes):
    """The link under the jitter that the changes give, and its mission."""
    mission = link_file(folder, {"acquisition": None}, *changes).mission
    return link_performance.performance_under_jitter(link.of(mission)), mission


def record(bias_urad, rms_urad):
    return pointing.Jitter(*(tuple(URAD * value for value in pair) for pair in (bias_urad, rms_urad)))


# ------------------------------------------------------------------------------------------------------ a spread
def test_a_quantile_is_the_least_error_that_the_share_of_the_time_stays_within():
    spread = ErrorDistribution(np.array([3.0, 1.0, 2.0]), np.array([0.25, 0.5, 0.25]))
    wanted = {0.0: 1.0, 0.5: 1.0, 0.501: 2.0, 0.75: 2.0, 0.751: 3.0, 1.0: 3.0}
    assert {p: spread.quantile_rad(p) for p in wanted} == wanted


def test_quantiles_are_those_of_weighted_draws():
    draw = np.random.Generator(np.random.Philox(key=3))
    radius, weight = draw.rayleigh(size=501), draw.random(501)
    spread = ErrorDistribution(radius, weight / np.sum(weight))
    for p in (0.01, 0.3, 0.9, 0.997):
        assert spread.quantile_rad(p) == np.quantile(radius, p, weights=weight, method="inverted_cdf")


# ------------------------------------------------------------------------------------------------ a known jitter
KNOWN = {
    "equal axes": ((0, 0), (3, 3)),
    "unequal axes with bias": ((2, -1), (1, 4)),
    "one axis": ((3, 1), (0, 4)),
    "a bias of many deviations": ((8, 0), (0.2, 0.2)),
}


def test_a_mission_without_jitter_has_no_such_performance(tmp_path):
    assert under(tmp_path)[0] is None


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-39")
@pytest.mark.promise("sampled-loop-18")
@pytest.mark.parametrize("values", KNOWN.values(), ids=KNOWN)
def test_a_known_jitter_costs_what_its_closed_forms_say(tmp_path, values):
    found, _ = under(tmp_path, jittery(*values))
    jitter = record(*values)
    assert (found.source, found.controller, found.mirror) == ("jitter as given", "", "")
    assert_allclose([found.jitter.bias_rad, found.jitter.rms_rad], [jitter.bias_rad, jitter.rms_rad], rtol=1e-12)
    # the mean is over 4000 steps of 12 deviations in all, each at its middle; the density of one axis has an edge
    assert found.mean_loss_db == pytest.approx(float(pointing.mean_loss_db(jitter, HALF_RAD)), rel=1e-4)
    assert found.outage_loss_db == pytest.approx(float(pointing.outage_loss_db(jitter, HALF_RAD, OUTAGE)), rel=1e-9)
    assert found.margin_db == pytest.approx(ON_AXIS_DB - found.outage_loss_db, abs=1e-6)
    assert found.data_rate_bit_s == pytest.approx(RATE_BIT_S * 10 ** ((found.margin_db - REQUIRED_DB) / 10), rel=1e-6)
    for share, margin in ((found.outage, ON_AXIS_DB), (found.short, ON_AXIS_DB - REQUIRED_DB)):
        exact = float(statistics.outage_probability(jitter, HALF_RAD, margin))
        assert share == pytest.approx(exact, rel=1e-6, abs=1e-15)
    best = pointing.best_divergence_for_outage(
        jitter, OUTAGE, smallest_half_angle_rad=HALF_RAD, current_half_angle_rad=HALF_RAD
    )
    assert found.best.wanted_half_angle_rad == pytest.approx(best.wanted_half_angle_rad, rel=5e-3)
    assert found.best.half_angle_rad == pytest.approx(best.half_angle_rad, rel=5e-3)
    assert found.best.current_excess_db == pytest.approx(best.current_excess_db, abs=0.05)


def test_the_best_divergence_for_equal_axes_is_two_rms_times_a_root_and_no_narrower_than_the_aperture(tmp_path):
    for rms in (0, 1, 3, 4.05, 4.15, 6):  # 2 rms sqrt(ln(1 / outage)) is the present half angle at 4.09 urad
        found, _ = under(tmp_path, jittery((0, 0), (rms, rms)))
        wanted = 2 * rms * URAD * math.sqrt(math.log(1 / OUTAGE))
        assert found.best.wanted_half_angle_rad == pytest.approx(wanted, rel=2e-3, abs=0.0)
        assert found.best.at_limit is (rms < 4.1)
        if rms < 4.1:
            assert (found.best.half_angle_rad, found.best.current_excess_db) == (pytest.approx(HALF_RAD), 0.0)
            assert found.best.loss_db == pytest.approx(found.outage_loss_db, rel=1e-9)
        else:
            assert found.best.half_angle_rad == pytest.approx(wanted, rel=2e-3)
            assert found.best.loss_db == pytest.approx(4.343, abs=5e-4)
            assert found.best.current_excess_db > 0.0


@pytest.mark.parametrize("bias_urad", [0.0, 5.0, 1000.0])
def test_an_error_that_stands_still_costs_what_the_budget_says_at_it(tmp_path, bias_urad):
    found, mission = under(tmp_path, jittery((bias_urad, 0), (0, 0)))
    margin = float(link.margin_of_error(link.of(mission), bias_urad * URAD))
    assert found.mean_loss_db == pytest.approx(loss_db(bias_urad * URAD), rel=1e-9)
    assert found.outage_loss_db == pytest.approx(loss_db(bias_urad * URAD), rel=1e-9)
    assert found.margin_db == pytest.approx(margin, rel=1e-9)
    assert (found.outage, found.short) == (float(margin < 0), float(margin < REQUIRED_DB))
    assert found.fades_per_s == 0.0


def test_a_beam_that_never_meets_its_target_still_has_a_mean_loss(tmp_path):
    found, _ = under(tmp_path, jittery((1000, 0), (5, 5)))
    # what decides it are errors so rare that their share is lost in rounding: no better than the truth
    exact = float(pointing.mean_loss_db(record((1000, 0), (5, 5)), HALF_RAD))
    assert 3080.0 < exact < found.mean_loss_db < loss_db(1e-3)  # its power is below the smallest number there is
    assert (found.outage, found.short) == (pytest.approx(1.0), pytest.approx(1.0))


@pytest.mark.promise("link-4")
def test_the_outage_of_the_mission_decides_the_quantile(tmp_path):
    for outage in (0.3, 1e-4):
        found, _ = under(tmp_path, jittery((0, 0), (3, 3)), {"requirement.outage": outage})
        rayleigh = 3 * URAD * math.sqrt(-2 * math.log(outage))
        assert found.outage_loss_db == pytest.approx(loss_db(rayleigh), rel=0.01)


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-40")
def test_fades_of_equal_axes_are_the_level_crossings_of_rice(tmp_path):
    found, _ = under(tmp_path, jittery((0, 0), (4, 4), 40))
    radius = HALF_RAD * math.sqrt((ON_AXIS_DB - REQUIRED_DB) / DB_PER_SQUARE)
    below = math.exp(-(radius**2) / (2 * (4 * URAD) ** 2))
    per_second = 2 * math.pi * 40 * 4 * URAD / math.sqrt(2 * math.pi) * radius / (4 * URAD) ** 2 * below
    assert found.fades_per_s == pytest.approx(per_second, rel=1e-4)
    assert found.fade_s == pytest.approx(below / per_second, rel=1e-4)
    assert found.fade_warning == ""
    twice, _ = under(tmp_path, jittery((0, 0), (4, 4), 80))
    assert twice.fades_per_s == pytest.approx(2 * found.fades_per_s, rel=1e-9)


@pytest.mark.parametrize(("margin_db", "known"), [(5.2, True), (5.3, False)])
def test_fades_are_known_while_the_required_margin_is_there_on_axis(tmp_path, margin_db, known):
    assert 5.2 < ON_AXIS_DB < 5.3
    found, _ = under(tmp_path, jittery((0, 0), (4, 4)), {"requirement.margin": f"{margin_db} dB"})
    assert math.isfinite(found.fades_per_s) is known
    assert math.isfinite(found.fade_s) is known
    assert (found.short == 1.0) is not known


@pytest.mark.promise("link-38")
def test_an_apertures_pattern_is_taken_as_it_is(tmp_path):
    found, mission = under(tmp_path, jittery((0, 0), (6, 6)), PATTERN, {"communication.transmit_power": "50 W"})
    fall, rms = link.of(mission).beam.fall, 6 * URAD

    def at(radius):
        return radius / rms**2 * math.exp(-(radius**2) / (2 * rms**2)) * 10 ** (-float(fall.loss_db(radius)) / 10)

    mean = quad(at, 0.0, 10 * rms, epsabs=1e-12, limit=200)[0]
    assert found.mean_loss_db == pytest.approx(-10 * math.log10(mean), rel=5e-3)
    quantile = rms * math.sqrt(-2 * math.log(OUTAGE))
    assert found.outage_loss_db == pytest.approx(float(fall.loss_db(quantile)), rel=5e-3)
    margin = found.margin_db + found.outage_loss_db - REQUIRED_DB
    speed = 2 * math.pi * 40 * rms
    rate = fading.level_crossing_rate_hz(record((0, 0), (6, 6)), (speed, speed), fall.error_rad(margin))
    assert found.fades_per_s == pytest.approx(float(rate), rel=1e-9)
    gaussian = beams.GaussianFall(fall.half_angle_rad).error_rad(margin)
    assert fall.error_rad(margin) != pytest.approx(gaussian, rel=1e-3)  # or the line above would not tell them apart


# ------------------------------------------------------------------------------------------------------- penalty
@pytest.mark.promise("link-39")
@pytest.mark.parametrize("name", ["counting ook", "preamplified dpsk"])
def test_the_uncoded_penalty_brings_the_mean_bit_error_ratio_back(tmp_path, name):
    found, mission = under(tmp_path, jittery((0, 0), (2, 2)), received_with(name))
    receiver, rms = link.of(mission).receiver, 2 * URAD
    power = float(receiver.required_power_w(RATE_BIT_S)) * 10 ** (found.uncoded_penalty_db / 10)
    radius = np.linspace(0.0, 8 * rms, 20_001)
    density = radius / rms**2 * np.exp(-(radius**2) / (2 * rms**2))
    ratio = receiver.bit_error_ratio_at(power * np.exp(-2 * (radius / HALF_RAD) ** 2), RATE_BIT_S)
    assert float(np.trapezoid(density * ratio, radius)) == pytest.approx(1e-6, rel=1e-3)
    assert found.uncoded_penalty_db > found.mean_loss_db


@pytest.mark.promise("link-39")
def test_there_is_no_uncoded_penalty_of_a_receiver_that_is_known_by_its_sensitivity_alone(tmp_path):
    assert math.isnan(under(tmp_path, jittery((0, 0), (2, 2)))[0].uncoded_penalty_db)


def test_the_uncoded_penalty_is_infinite_where_no_power_makes_up_for_the_jitter_and_nothing_without_any(tmp_path):
    receiver = received_with("counting ook")
    assert under(tmp_path, jittery((0, 0), (60, 60)), receiver)[0].uncoded_penalty_db == math.inf
    assert under(tmp_path, jittery((0, 0), (0, 0)), receiver)[0].uncoded_penalty_db == 0.0


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.endurance if "heterodyne" in name else ()) for name in RECEIVERS],
)
def test_every_receiver_has_a_penalty_also_against_a_bright_background(tmp_path, name):
    background = {"background_power": "1 mW", "code_gain": "4 dB"}  # more, no code gains in so much light
    bright = background if "background_power" in RECEIVERS[name] else {}
    for rms, finite in ((2, True), (6, True), (60, False)):
        found, _ = under(tmp_path, jittery((0, 0), (rms, rms)), received_with(name, **bright))
        assert math.isfinite(found.uncoded_penalty_db) is finite
        assert found.uncoded_penalty_db > 0.0


def test_a_curve_that_is_none_is_not_called_a_lack_of_power(tmp_path, monkeypatch):
    for ratio in (lambda power: np.nan * power, lambda power: np.minimum(1e7 * power, 0.4)):
        monkeypatch.setattr(
            link.receivers.DpskPreamplified, "bit_error_ratio_at", lambda self, power, rate, ratio=ratio: ratio(power)
        )
        with pytest.raises(ValueError, match="bit error ratio"):
            under(tmp_path, jittery((0, 0), (60, 60)), received_with("preamplified dpsk"))


@pytest.mark.promise("link-38")
def test_the_uncoded_penalty_is_that_of_a_gaussian_beam_of_the_same_half_angle(tmp_path):
    found, mission = under(tmp_path, jittery((0, 0), (4, 4)), PATTERN, received_with("counting ook"))
    receiver, fall = link.of(mission).receiver, link.of(mission).beam.fall
    needed = float(receiver.required_power_w(RATE_BIT_S))
    penalty = pointing.uncoded_penalty_db(
        record((0, 0), (4, 4)),
        fall.half_angle_rad,
        lambda power: receiver.bit_error_ratio_at(needed * power, RATE_BIT_S),
    )
    assert found.uncoded_penalty_db == pytest.approx(penalty, rel=1e-9)
    assert fall.half_angle_rad != pytest.approx(HALF_RAD, rel=0.05)


# --------------------------------------------------------------------------------------------------- point-ahead
SLOW = {"point_ahead.transverse_velocity": "1 km/s", "point_ahead.corrected": False}
AHEAD_RAD = 2 * 1000.0 / 299_792_458.0


def test_an_uncorrected_point_ahead_is_added_to_every_error_and_counted_once(tmp_path):
    found, mission = under(tmp_path, jittery((0, 0), (2, 2)), SLOW)
    corrected, _ = under(tmp_path, jittery((0, 0), (2, 2)))
    quantile = 2 * URAD * math.sqrt(-2 * math.log(OUTAGE))
    assert corrected.outage_loss_db == pytest.approx(loss_db(quantile), rel=0.01)
    assert found.outage_loss_db == pytest.approx(loss_db(quantile + AHEAD_RAD), rel=0.01)
    assert found.margin_db == pytest.approx(ON_AXIS_DB - found.outage_loss_db, abs=1e-6)
    # the rate at which this margin would be the required one, which the budget confirms
    exact = HALF_RAD * math.sqrt(found.outage_loss_db / DB_PER_SQUARE) - AHEAD_RAD
    assert float(link.margin_map(link.of(mission), found.data_rate_bit_s, exact)[0, 0]) == pytest.approx(
        REQUIRED_DB, abs=1e-6
    )
    assert found.best.wanted_half_angle_rad == pytest.approx(math.sqrt(2) * (quantile + AHEAD_RAD), rel=5e-3)
    assert found.jitter == corrected.jitter


def test_a_link_that_stands_still_with_an_uncorrected_point_ahead_is_that_of_the_budget(tmp_path):
    found, mission = under(tmp_path, jittery((3, 4), (0, 0)), SLOW)
    assert found.margin_db == pytest.approx(float(link.margin_of_error(link.of(mission), 5 * URAD)), abs=1e-9)
    assert found.mean_loss_db == pytest.approx(loss_db(5 * URAD + AHEAD_RAD), rel=1e-9)


@pytest.mark.parametrize(
    ("bias_urad", "rms_urad", "along"),
    [
        ((0, 0), (2, 2), (1, 0)),
        ((0, 0), (1, 3), (0, 1)),
        pytest.param((0, 0), (3, 1), (1, 0), marks=pytest.mark.endurance),
        pytest.param((3, -4), (2, 2), (0.6, -0.8), marks=pytest.mark.endurance),
        ((3, -4), (1, 3), (0.6, -0.8)),
    ],
)
def test_fades_and_penalty_have_the_uncorrected_point_ahead_as_bias(tmp_path, bias_urad, rms_urad, along):
    found, mission = under(tmp_path, jittery(bias_urad, rms_urad), SLOW, received_with("counting ook"))
    bias = tuple(b * URAD + share * AHEAD_RAD for b, share in zip(bias_urad, along, strict=True))
    shifted = pointing.Jitter(bias, tuple(rms * URAD for rms in rms_urad))
    speeds = tuple(2 * math.pi * 40 * rms for rms in shifted.rms_rad)
    on_axis = found.margin_db + found.outage_loss_db
    fades = pointing.fades(shifted, speeds, HALF_RAD, on_axis - REQUIRED_DB)
    assert (found.fades_per_s, found.fade_s) == pytest.approx(
        (float(fades.per_second), float(fades.mean_duration_s)), rel=1e-9
    )
    share = statistics.outage_probability(shifted, HALF_RAD, on_axis - REQUIRED_DB)
    assert found.fades_per_s * found.fade_s == pytest.approx(float(share), rel=1e-9, abs=0.0)
    receiver = link.of(mission).receiver
    needed = float(receiver.required_power_w(RATE_BIT_S))
    penalty = pointing.uncoded_penalty_db(
        shifted, HALF_RAD, lambda power: receiver.bit_error_ratio_at(needed * power, RATE_BIT_S)
    )
    assert found.uncoded_penalty_db == pytest.approx(penalty, rel=1e-9)


@pytest.mark.parametrize("rms_urad", [(1, 3), (3, 1), (0, 4), (2, 2)])
def test_without_a_bias_the_point_ahead_lies_where_it_makes_large_errors_most_frequent(rms_urad):
    radius = np.array([9.0, 12.0, 15.0]) * URAD
    taken = pointing.radial_survival(link_performance.with_point_ahead(record((0, 0), rms_urad), 6 * URAD), radius)
    for angle in np.linspace(0.0, math.pi / 2, 7):
        other = record((6 * math.cos(angle), 6 * math.sin(angle)), rms_urad)
        assert np.all(pointing.radial_survival(other, radius) <= taken * (1 + 1e-9))


# ---------------------------------------------------------------------------------------------------------- rate
def test_there_is_no_data_rate_where_nothing_closes(tmp_path):
    dim = received_with("pin ook")
    assert math.isnan(under(tmp_path, jittery((60, 0), (0, 0)), dim)[0].data_rate_bit_s)
    assert under(tmp_path, jittery((1, 0), (0, 0)), dim)[0].data_rate_bit_s > 0.0


def test_no_more_than_the_highest_rate_of_the_receiver_is_promised(tmp_path):
    strong = {**received_with("homodyne bpsk"), "communication.transmit_power": "500 W"}
    assert under(tmp_path, jittery((1, 0), (0, 0)), strong)[0].data_rate_bit_s == pytest.approx(3.2e9, rel=1e-12)


# --------------------------------------------------------------------------------------------------------- sines
@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """The shipped mission, which reads its residual per axis."""
    return edited(tmp_path_factory.mktemp("mission"))


def tracked(error_rad, controller="PID", mirror="given", freq_hz=15.0, before_rad=1e-3):
    """A run that leaves this error once it has settled, and a much larger one before."""
    error = np.concatenate([np.full(100, before_rad), error_rad])[:, None]
    time = np.arange(error.size) * 1e-4
    steady, volts = slice(100, error.size), np.zeros_like(error)
    counts = simulate.Counts(0, 0, 0, 0, 0)
    trace = simulate.Trace("made up", time, error, np.zeros_like(error), volts, volts, steady, counts)
    return tracking.Run(mirror, controller, freq_hz, trace)


def sine(amplitude_rad, samples=4000):
    return amplitude_rad * np.sin(2 * math.pi * (np.arange(samples) + 0.5) / samples)


@pytest.mark.promise("link-42")
@pytest.mark.parametrize("residual", ["per-axis", "radial"])
def test_a_tracked_sine_costs_the_mean_over_its_course(mission, residual):
    conventions = mission.conventions.model_copy(update={"residual": residual})
    read = mission.model_copy(update={"conventions": conventions})
    (case,) = costs_of(read, (tracked(sine(10 * URAD)),), None).cases
    amplitude = 10 * URAD * (math.sqrt(2) if residual == "radial" else 1)
    # the mean of exp(-2 (a sin / theta)^2) over a period is exp(-x) I0(x), x = (a / theta)^2
    assert case.mean_loss_db == pytest.approx(-10 * math.log10(ive(0, (amplitude / HALF_RAD) ** 2)), rel=1e-6)
    assert case.outage_loss_db == pytest.approx(loss_db(amplitude * math.sin(math.pi / 2 * (1 - OUTAGE))), rel=1e-4)
    assert case.margin_db == pytest.approx(ON_AXIS_DB - case.outage_loss_db, abs=1e-6)
    assert (case.source, case.controller, case.mirror) == ("sine of 15 Hz", "PID", "given")
    rms = 10 * URAD / math.sqrt(2)
    assert case.jitter.rms_rad == pytest.approx((rms, rms if residual == "radial" else 0.0), rel=1e-9)
    assert case.jitter.bias_rad == pytest.approx((0.0, 0.0), abs=1e-15)
    assert math.isnan(case.fades_per_s)
    assert math.isnan(case.fade_s)


def test_the_share_of_a_sine_beyond_the_margin_is_an_outage(mission):
    (case,) = costs_of(mission, (tracked(sine(30 * URAD)),), None).cases
    for share, margin in ((case.outage, ON_AXIS_DB), (case.short, ON_AXIS_DB - REQUIRED_DB)):
        radius = HALF_RAD * math.sqrt(margin / DB_PER_SQUARE)
        assert share == pytest.approx(1 - 2 / math.pi * math.asin(radius / (30 * URAD)), abs=1e-3)


def test_a_standing_part_of_a_tracked_error_is_its_bias(mission):
    (case,) = costs_of(mission, (tracked(sine(2 * URAD) - 5 * URAD),), None).cases
    assert case.jitter.bias_rad == pytest.approx((-5 * URAD, 0.0), rel=1e-9)
    assert case.jitter.rms_rad == pytest.approx((math.sqrt(2) * URAD, 0.0), rel=1e-9)
    assert case.outage_loss_db == pytest.approx(loss_db(7 * URAD), rel=1e-3)


# --------------------------------------------------------------------------------------------------------- costs
@pytest.mark.promise("link-42")
def test_hysteresis_costs_the_difference_between_the_same_controller_with_it_and_without(mission):
    left = {("PID", "given"): 12, ("PID", "comparison"): 11, ("PID", "no hysteresis"): 9, ("other", "given"): 5}
    runs = [tracked(sine(size * URAD), *names) for names, size in left.items()]
    runs.append(tracked(sine(20 * URAD), "PID", "given", freq_hz=25.0))  # without its counterpart at 25 Hz
    found = costs_of(mission, tuple(runs), None)
    assert [(c.source, c.controller, c.mirror) for c in found.costs] == [
        ("sine of 15 Hz", "PID", "given"),
        ("sine of 15 Hz", "PID", "comparison"),
    ]
    peak = math.sin(math.pi / 2 * (1 - OUTAGE)) * URAD
    for cost, size in zip(found.costs, (12, 11), strict=True):
        assert cost.margin_db == pytest.approx(loss_db(9 * peak) - loss_db(size * peak), rel=1e-3)
        assert cost.margin_db < 0.0
        with_it = found.case(cost.source, cost.controller, cost.mirror)
        without = found.case(cost.source, cost.controller, "no hysteresis")
        assert cost.margin_db == with_it.margin_db - without.margin_db
        assert cost.data_rate_bit_s == with_it.data_rate_bit_s - without.data_rate_bit_s


def test_a_case_is_looked_up_by_its_three_names(mission):
    runs = (tracked(sine(9 * URAD)), tracked(sine(9 * URAD), freq_hz=25.0), tracked(sine(9 * URAD), "PID + inverse"))
    found = costs_of(mission, runs, None)
    assert len(found.cases) == 3
    assert (found.outage, found.half_angle_rad) == (OUTAGE, pytest.approx(HALF_RAD))
    for case in found.cases:
        assert found.case(case.source, case.controller, case.mirror) is case
    assert found.case("sine of 15 Hz", "PID", "comparison") is None
    assert found.case("sine of 1 Hz", "PID", "given") is None
    assert found.case("sine of 25 Hz", "PID + inverse", "given") is None


def test_nothing_simulated_has_no_cases(mission):
    assert (costs_of(mission, (), None).cases, costs_of(mission, (), None).costs) == ((), ())


# -------------------------------------------------------------------------------------------------- fine pointing
FREQ_HZ = np.linspace(0.0, 2500.0, 2501)


def residual(bias_urad, rms_urad, axes=2):
    """What a loop leaves, with the counts of a Gaussian of these moments."""
    jitter = record(bias_urad, rms_urad)
    share = -np.diff(pointing.radial_survival(jitter, bin_edges_rad()))
    mean, square = jitter.bias_rad[:axes], np.hypot(jitter.bias_rad, jitter.rms_rad)[:axes]
    counts = np.round(1e9 * np.maximum(share, 0.0)).astype(np.int64)
    radial = math.hypot(*square)
    return Residual(radial, 0.0, tuple(square), tuple(mean), counts, math.nan, math.nan, {})


def fine_study(spectrum_rad2_hz, **simulated):
    """A study of one controller, that left these residuals."""
    names = {"given": "given", "comparison": "comparison", "none": "no hysteresis"}
    residuals = {names[name]: each for name, each in simulated.items()}
    verified = Verified(SimpleNamespace(name="PI"), None, residuals, spectrum_rad2_hz, spectrum_rad2_hz)
    return FinePointingStudy(None, (verified,), verified, None, (), FREQ_HZ, np.zeros(FREQ_HZ.size), 0.997, 0.0)


def falling(rms_rad, corner_hz=50.0):
    """A density that falls with the sixth power of the frequency, with this rms."""
    shape = 1.0 / (1.0 + (FREQ_HZ / corner_hz) ** 6)
    return rms_rad**2 * shape / np.trapezoid(shape, FREQ_HZ)


@pytest.mark.promise("link-38")
@pytest.mark.promise("sampled-loop-17", "sampled-loop-18")
def test_the_residual_of_the_loop_costs_what_a_jitter_of_its_moments_does(mission):
    values = ((1, -2), (2, 3))
    spectrum = np.column_stack([falling(2 * URAD), falling(3 * URAD)])
    (case,) = costs_of(mission, (), fine_study(spectrum, given=residual(*values))).cases
    jitter = record(*values)
    assert (case.source, case.controller, case.mirror) == (performance.FINE, "PI", "given")
    assert_allclose([case.jitter.bias_rad, case.jitter.rms_rad], [jitter.bias_rad, jitter.rms_rad], rtol=1e-9)
    assert case.mean_loss_db == pytest.approx(float(pointing.mean_loss_db(jitter, HALF_RAD)), rel=1e-3)
    # bins are 3 % wide in the square, and read between their edges
    assert case.outage_loss_db == pytest.approx(float(pointing.outage_loss_db(jitter, HALF_RAD, OUTAGE)), rel=1e-3)
    short = float(statistics.outage_probability(jitter, HALF_RAD, ON_AXIS_DB - REQUIRED_DB))
    assert case.short == pytest.approx(short, rel=0.02)
    assert case.margin_db == pytest.approx(ON_AXIS_DB - case.outage_loss_db, abs=1e-6)


@pytest.mark.promise("link-40")
def test_fades_are_known_on_the_mirror_whose_spectrum_is_known(mission):
    spectrum = np.column_stack([falling(2 * URAD), falling(3 * URAD)])
    same = residual((0, 0), (2, 3))
    found = costs_of(mission, (), fine_study(spectrum, given=same, comparison=same, none=same))
    known = {case.mirror: math.isfinite(case.fades_per_s) for case in found.cases}
    assert known == {"given": True, "comparison": False, "no hysteresis": False}
    case = found.case(performance.FINE, "PI", "given")
    speed = [math.sqrt(np.trapezoid((2 * np.pi * FREQ_HZ) ** 2 * axis, FREQ_HZ)) for axis in spectrum.T]
    radius = HALF_RAD * math.sqrt((ON_AXIS_DB - REQUIRED_DB) / DB_PER_SQUARE)
    rate = float(fading.level_crossing_rate_hz(record((0, 0), (2, 3)), tuple(speed), radius))
    assert case.fades_per_s == pytest.approx(rate, rel=1e-5)
    assert case.fade_s == pytest.approx(
        float(pointing.radial_survival(record((0, 0), (2, 3)), radius)) / rate, rel=1e-5
    )
    assert case.fade_warning == ""
    assert [cost.margin_db for cost in found.costs] == [0.0, 0.0]
    assert [cost.mirror for cost in found.costs] == ["given", "comparison"]


@pytest.mark.promise("link-40")
def test_a_spectrum_that_ends_too_early_is_doubted(mission):
    flat = np.full((FREQ_HZ.size, 2), (2 * URAD) ** 2 / FREQ_HZ[-1])
    (case,) = costs_of(mission, (), fine_study(flat, given=residual((0, 0), (2, 2)))).cases
    assert "of the velocity variance" in case.fade_warning


def test_a_loop_of_one_axis_stands_still_about_the_other(mission):
    study = fine_study(falling(3 * URAD)[:, None], given=residual((1, 0), (3, 0), axes=1))
    (case,) = costs_of(mission, (), study).cases
    assert case.jitter.bias_rad == pytest.approx((URAD, 0.0))
    assert case.jitter.rms_rad == pytest.approx((3 * URAD, 0.0))
    jitter = record((1, 0), (3, 0))
    assert case.mean_loss_db == pytest.approx(float(pointing.mean_loss_db(jitter, HALF_RAD)), rel=2e-3)
    assert case.fades_per_s > 0.0


@pytest.mark.parametrize("rms_urad", [3, 2.05, 2.03, 2.01])
def test_hysteresis_costs_the_loop_under_vibration_what_it_adds_to_its_quantile(mission, rms_urad):
    spectrum = np.column_stack([falling(rms_urad * URAD)] * 2)
    study = fine_study(spectrum, given=residual((0, 0), (rms_urad, rms_urad)), none=residual((0, 0), (2, 2)))
    (cost,) = costs_of(mission, (tracked(sine(9 * URAD)),), study).costs
    quantiles = [rms * URAD * math.sqrt(-2 * math.log(OUTAGE)) for rms in (2, rms_urad)]
    assert (cost.source, cost.controller, cost.mirror) == (performance.FINE, "PI", "given")
    # bins are 0.03 dB wide here: costs of less are still seen
    wanted = loss_db(quantiles[0]) - loss_db(quantiles[1])
    assert cost.margin_db == pytest.approx(wanted, rel=1e-3, abs=1e-3)
    assert cost.data_rate_bit_s < 0.0


@pytest.mark.promise("sampled-loop-17")
def test_errors_of_a_histogram_are_even_in_the_square_inside_each_bin():
    counts = np.zeros(bin_edges_rad().size - 1, dtype=np.int64)
    counts[300:302] = 1, 3
    low, middle, high = bin_edges_rad()[300:303] ** 2
    spread = performance.Binned.of(counts)
    for share, square in ((0.0, low), (0.125, (low + middle) / 2), (0.25, middle), (0.5, (2 * middle + high) / 3)):
        assert spread.quantile_rad(share) == pytest.approx(math.sqrt(square), rel=1e-12)
    assert spread.quantile_rad(1.0) == pytest.approx(math.sqrt(high), rel=1e-12)
    assert np.sum(spread.share) == pytest.approx(1.0)
    mean = (low + middle) / 8 + 3 * (middle + high) / 8
    assert np.sum(spread.share * spread.radius_rad**2) == pytest.approx(mean, rel=1e-12, abs=0.0)
    inside = spread.radius_rad**2 < middle + 0.3 * (high - middle)
    assert np.sum(spread.share[inside]) == pytest.approx(0.25 + 0.75 * 0.3, abs=0.75 / 32)


def exposure(on_axis_db=3.0, lost_db=0.0, ahead_rad=0.0, error_rad=0.0, received_db=0.0):
    """A link that stands still."""
    fall = beams.GaussianFall(1e-5)
    return link_performance.Exposure(
        fall, on_axis_db, lost_db, ahead_rad, error_rad, lambda reach: float(error_rad > reach), received_db, None, 0.0
    )


def test_a_margin_that_is_kept_exactly_is_not_missed():
    assert exposure().short_of(3.0) == 0.0
    assert exposure().short_of(math.nextafter(3.0, 4.0)) == 1.0
    assert exposure(received_db=1.0).short_of(2.0) == 0.0
    assert exposure(received_db=1.0).short_of(2.1) == 1.0
    assert exposure(ahead_rad=1e-6).short_of(3.0) == 1.0  # the point-ahead alone costs some
    assert exposure(error_rad=1e-6).short_of(3.0) == 1.0


def test_as_much_light_as_was_sent_may_arrive_and_no_more():
    assert exposure().possible
    assert not exposure(lost_db=-1e-9).possible
    assert exposure(lost_db=-1.0, received_db=1.0).possible


def test_fades_are_counted_down_to_a_margin_of_nothing():
    jitter = pointing.Jitter((1e-6, 0.0), (1e-6, 1e-6))
    motion = pointing.SpectralMotion((1e-6, 1e-6), (1e-4, 1e-4), (0.0, 0.0), 100.0)
    data = SimpleNamespace(turbulent=None, receiving=None, beam=SimpleNamespace(fall=beams.GaussianFall(1e-5)))
    assert not any(math.isnan(x) for x in link_performance._fades(jitter, motion, data, 1e-6)[:2])
    assert all(math.isnan(x) for x in link_performance._fades(jitter, motion, data, -1e-6)[:2])
    assert all(math.isnan(x) for x in link_performance._fades(jitter, None, data, 1.0)[:2])
    data.turbulent = object()
    assert "fades are not counted" in link_performance._fades(jitter, motion, data, 1.0)[2]


def test_a_receiver_moves_as_its_jitter_says_and_without_one_as_its_twin_does():
    end = SimpleNamespace(error_rad=lambda margin_db: 2e-5)
    coupling = SimpleNamespace(jitter=None)
    data = SimpleNamespace(receiving=SimpleNamespace(is_random=True, end=end), table=SimpleNamespace(coupling=coupling))
    jitter = pointing.Jitter((0.0, 0.0), (1e-6, 2e-6))
    sent = pointing.MovingEnd(jitter, (1e-4, 2e-4), 1e-5)
    lost_db = 20.0 / math.log(10.0)  # of a Gaussian beam at its half angle
    assert link_performance._moving(data, sent, lost_db).half_angle_rad == pytest.approx(2e-5)
    assert link_performance._moving(data, sent, 4.0 * lost_db).half_angle_rad == pytest.approx(1e-5)
    twin = link_performance._moving(data, sent, lost_db)
    assert (twin.jitter, twin.velocity_rms_rad_s) == (jitter, (1e-4, 2e-4))
    assert link_performance._moving(data, sent, 0.0) is None
    data.receiving.is_random = False
    assert link_performance._moving(data, sent, lost_db) is None
    data.receiving.is_random, end.error_rad = True, lambda margin_db: math.inf
    assert link_performance._moving(data, sent, lost_db) is None
    data.receiving = None
    assert link_performance._moving(data, sent, lost_db) is None


@pytest.mark.parametrize(("bias_urad", "rms_urad", "ahead_urad", "shifted_urad"), [
    ((3.0, -4.0), (1.0, 2.0), 5.0, (6.0, -8.0)),
    ((0.0, -2.0), (3.0, 1.0), 1.5, (0.0, -3.5)),
    ((0.0, 0.0), (1.0, 2.0), 5.0, (0.0, 5.0)),
    ((0.0, 0.0), (2.0, 1.0), 5.0, (5.0, 0.0)),
    ((0.0, 0.0), (2.0, 2.0), 5.0, (5.0, 0.0)),
    ((3.0, -4.0), (2.0, 1.0), 0.0, (3.0, -4.0)),
])  # fmt: skip
def test_a_point_ahead_makes_a_bias_longer_and_lies_along_the_wider_axis_without_one(
    bias_urad, rms_urad, ahead_urad, shifted_urad
):
    found = link_performance.with_point_ahead(record(bias_urad, rms_urad), ahead_urad * URAD)
    assert found.bias_rad == pytest.approx([each * URAD for each in shifted_urad], rel=1e-12, abs=1e-18)
    assert found.rms_rad == tuple(each * URAD for each in rms_urad)


def test_a_receiver_of_its_own_jitter_moves_about_each_axis_by_that_axis():
    end = SimpleNamespace(error_rad=lambda margin_db: 4e-5)
    own = SimpleNamespace(bias_rad=(1e-6, -3e-6), rms_rad=(2e-6, 5e-6), bandwidth_hz=40.0)
    table = SimpleNamespace(coupling=SimpleNamespace(jitter=own))
    data = SimpleNamespace(receiving=SimpleNamespace(is_random=True, end=end), table=table)
    sent = pointing.MovingEnd(pointing.Jitter((7e-6, 0.0), (9e-6, 8e-6)), (1e-4, 3e-4), 1e-5)
    found = link_performance._moving(data, sent, 4.0 * 20.0 / math.log(10.0))
    assert found.jitter == pointing.Jitter((1e-6, -3e-6), (2e-6, 5e-6))
    assert found.velocity_rms_rad_s == pytest.approx((80.0 * math.pi * 2e-6, 80.0 * math.pi * 5e-6), rel=1e-12)
    assert found.half_angle_rad == pytest.approx(2e-5, rel=1e-12)


@pytest.mark.parametrize(("rms", "speed", "rms_moved", "speed_moved"), [
    ((0.0, 5e-6), (0.0, 7e-4), (5e-8, 5e-6), (7e-6, 7e-4)),
    ((4e-6, 0.0), (3e-4, 0.0), (4e-6, 4e-8), (3e-4, 3e-6)),
    ((4e-6, 1e-9), (3e-4, 2e-4), (4e-6, 4e-8), (3e-4, 2e-4)),
    ((4e-6, 5e-6), (3e-4, 7e-4), (4e-6, 5e-6), (3e-4, 7e-4)),
])  # fmt: skip
def test_an_axis_that_stands_still_moves_by_a_hundredth_of_the_other(rms, speed, rms_moved, speed_moved):
    end = pointing.MovingEnd(pointing.Jitter((3e-6, -2e-6), rms), speed, 1.5e-5)
    found = end.moved
    assert (found.jitter.bias_rad, found.half_angle_rad) == ((3e-6, -2e-6), 1.5e-5)
    assert found.jitter.rms_rad == pytest.approx(rms_moved, rel=1e-12)
    assert found.velocity_rms_rad_s == pytest.approx(speed_moved, rel=1e-12)
