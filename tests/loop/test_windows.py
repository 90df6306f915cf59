"""Pointing errors in time windows: closed forms, quadrature of the weights, drawn motions, and the exposure's line."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad, simpson

from microrad.core import lti
from microrad.loop import disturbance
from microrad.loop.disturbance import Disturbance, SpectralLine, olympus, psd, recorded_lines
from microrad.loop.disturbance.records import covariance
from microrad.loop.disturbance.windows import (
    ErrorIndex,
    exposure,
    rational_rms,
    recorded_rms,
    tabulated_rms,
    windowed_rms,
)

RADIAL = disturbance.first_order(160e-12, 1.0, convention="per-axis")  # OLYMPUS's radial spectrum, as of one axis
WHOLE_URAD2 = 80.0 * math.pi
LINES = Disturbance(
    "l", np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), (SpectralLine(2e-6, 30.0),), "lines", "test"
)


def resonance(freq_hz=40.0, damping=0.02):
    """A smooth motion of 1 urad rms: a resonance driven by white noise, which has a rate of finite variance."""
    w = 2 * math.pi * freq_hz
    A = np.array([[0.0, 1.0], [-w * w, -2 * damping * w]])
    B = np.array([[0.0], [2e-6 * math.sqrt(damping * w**3)]])
    return Disturbance("resonance", A, B, np.array([[1.0, 0.0]]), (), "test", "test")


def closed_form_mpe(window_s):
    """FACTS: MPE^2 = 160 pi (a T - 1 + e^(-a T)) / (a T)^2 urad^2, a = 2 pi 1/s; by its series for short windows."""
    z = 2 * math.pi * window_s
    part = (z + math.expm1(-z)) / z**2 if z > 0.1 else sum((-z) ** n / math.factorial(n + 2) for n in range(12))
    return math.sqrt(2 * WHOLE_URAD2 * part)


def closed_form_rpe(window_s):
    z = 2 * math.pi * window_s
    if z > 0.1:
        return math.sqrt(WHOLE_URAD2 - closed_form_mpe(window_s) ** 2)
    return math.sqrt(-2 * WHOLE_URAD2 * sum((-z) ** n / math.factorial(n + 2) for n in range(1, 14)))


# ---- closed forms
@pytest.mark.promise("pointing-35")
@pytest.mark.parametrize("window_s", [10.0**e for e in range(-9, 8, 2)] + [1.0])
def test_olympus_at_any_window(window_s):
    mpe = 1e6 * windowed_rms(RADIAL, ErrorIndex("MPE", window_s))
    rpe = 1e6 * windowed_rms(RADIAL, ErrorIndex("RPE", window_s))
    assert_allclose([mpe, rpe], [closed_form_mpe(window_s), closed_form_rpe(window_s)], rtol=1e-9)


@pytest.mark.promise("pointing-36")
def test_olympus_at_one_second_and_what_the_rational_form_makes_of_it():
    mean, left = ErrorIndex("MPE", 1.0), ErrorIndex("RPE", 1.0)
    assert 1e6 * windowed_rms(RADIAL, mean) == pytest.approx(8.203132, abs=5e-7)
    assert 1e6 * windowed_rms(RADIAL, left) == pytest.approx(13.565988, abs=5e-7)
    assert 1e6 * rational_rms(RADIAL, mean) == pytest.approx(9.00223, abs=5e-6)
    assert windowed_rms(RADIAL, ErrorIndex("APE")) == pytest.approx(1e-6 * math.sqrt(WHOLE_URAD2), rel=1e-12, abs=0.0)
    assert rational_rms(RADIAL, ErrorIndex("APE")) == windowed_rms(RADIAL, ErrorIndex("APE"))
    half = windowed_rms(olympus(), mean) * math.sqrt(2.0)  # an axis has half the power
    assert half == pytest.approx(windowed_rms(RADIAL, mean), rel=1e-12, abs=0.0)


@pytest.mark.promise("pointing-35")
@pytest.mark.parametrize("spacing_s", [1e-3, 0.3, 0.9999, 1.0, 3.0, 1e3])
def test_the_drift_of_a_first_order_motion(spacing_s):
    """By the variance of sums of increments of its integral, windows that overlap among them."""
    a = 2 * math.pi

    def integrated(t):  # variance of the integral over t, over twice the whole variance
        return (a * t + math.expm1(-a * t)) / a**2

    beside = integrated(spacing_s + 1.0) + integrated(abs(spacing_s - 1.0)) - 2 * integrated(spacing_s)
    wanted = 4 * WHOLE_URAD2 * integrated(1.0) - 2 * WHOLE_URAD2 * beside
    for kind in ("PDE", "PRE"):
        found = 1e6 * windowed_rms(RADIAL, ErrorIndex(kind, 1.0, spacing_s))
        assert found**2 == pytest.approx(wanted, rel=1e-9, abs=1e-12 * WHOLE_URAD2)


# ---- quadrature
def by_quadrature(motion, index):
    """The integral of density times weight, between and about the resonance's flanks."""
    edges = np.concatenate([[0.0], np.geomspace(1e-2, 1e4, 80)])
    parts = (
        quad(lambda f: psd(motion, [f])[0] * index.weight(f)[0], a, b, epsrel=1e-9, limit=200)[0]
        for a, b in pairwise(edges)
    )
    return math.sqrt(math.fsum(parts))


@pytest.mark.promise("pointing-32", "pointing-35")
@pytest.mark.parametrize("window_s", [1e-3, 0.02, pytest.param(0.4, marks=pytest.mark.endurance)])
def test_the_exact_form_is_the_integral_of_the_weights(window_s):
    motion = resonance()
    for index in (
        ErrorIndex("MPE", window_s),
        ErrorIndex("RPE", window_s),
        ErrorIndex("PDE", window_s, 1.7 * window_s),
        ErrorIndex("PDE", window_s, 0.3 * window_s),
    ):
        assert windowed_rms(motion, index) == pytest.approx(by_quadrature(motion, index), rel=1e-6, abs=0.0)


@pytest.mark.parametrize("window_s", [1e-6, 1e-4, 1e-2, 1.0])
def test_what_is_left_of_a_smooth_motion_in_a_short_window_is_its_rate(window_s):
    w, damping = 2 * math.pi * 40.0, 0.02
    found = windowed_rms(resonance(), ErrorIndex("RPE", window_s))
    turn = w * window_s
    if turn < 0.1:  # the rate times the window over sqrt 12, to first order in the damping
        rate = 1e-6 * turn / math.sqrt(12.0)
        assert found == pytest.approx(rate, rel=0.3 * damping * turn + 0.1 * turn**2 + 1e-9, abs=0.0)
    else:
        assert found < 1.001e-6


@pytest.mark.promise("pointing-35")
def test_the_weights_are_those_of_the_standard():
    for freq_hz in (0.4, 7.0, 33.0):
        x = 2 * math.pi * freq_hz * 0.03
        mean = 2 * (1 - math.cos(x)) / x**2
        apart = 2 * (1 - math.cos(2 * math.pi * freq_hz * 0.7)) * mean
        for index, wanted in (
            (ErrorIndex("MPE", 0.03), mean),
            (ErrorIndex("RPE", 0.03), 1 - mean),
            (ErrorIndex("PDE", 0.03, 0.7), apart),
        ):
            assert index.weight(freq_hz)[0] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.promise("pointing-35")
def test_rational_forms_are_their_weights():
    for kind in ("MPE", "RPE"):
        index = ErrorIndex(kind, 0.03)
        s = 2j * math.pi * 7.0 * 0.03
        filtered = {"MPE": 2 * (s + 6), "RPE": s * (s + math.sqrt(12))}[kind] / (s * s + 6 * s + 12)
        assert index.rational_weight(7.0)[0] == pytest.approx(abs(filtered) ** 2, rel=1e-12)
        edges = np.concatenate([[0.0], np.geomspace(0.1, 1e5, 60)])
        parts = (
            quad(lambda f, of=index: psd(resonance(), [f])[0] * of.rational_weight(f)[0], a, b, epsrel=1e-9)[0]
            for a, b in pairwise(edges)
        )
        assert rational_rms(resonance(), index) == pytest.approx(math.sqrt(math.fsum(parts)), rel=1e-6, abs=0.0)
    with pytest.raises(ValueError, match="PDE has no rational form: a difference of two means has a delay in it"):
        rational_rms(resonance(), ErrorIndex("PDE", 1.0, 2.0))


def test_lines_count_by_their_weight():
    """A line of whole periods has no mean in the window, and of half a period 2/pi of its amplitude."""
    whole, half = ErrorIndex("MPE", 1.0), ErrorIndex("MPE", 1.0 / 60.0)
    assert windowed_rms(LINES, whole) < 1e-15
    assert windowed_rms(LINES, half) == pytest.approx(math.sqrt(2.0) * 1e-6 * 2.0 / math.pi, rel=1e-12, abs=0.0)
    assert windowed_rms(LINES, ErrorIndex("RPE", 1.0)) == pytest.approx(math.sqrt(2.0) * 1e-6, rel=1e-12, abs=0.0)
    assert windowed_rms(LINES, ErrorIndex("PDE", 1.0 / 60.0, 1.0 / 60.0)) == pytest.approx(
        2.0 * windowed_rms(LINES, half), rel=1e-12, abs=0.0
    )
    assert rational_rms(LINES, ErrorIndex("APE")) == pytest.approx(math.sqrt(2.0) * 1e-6, rel=1e-12, abs=0.0)


@pytest.mark.promise("pointing-32", "pointing-53")
def test_knowledge_errors_take_the_same_of_what_is_known():
    for known, pointed in (("AKE", "APE"), ("MKE", "MPE"), ("RKE", "RPE")):
        times = () if known == "AKE" else (0.2,)
        assert windowed_rms(RADIAL, ErrorIndex(known, *times)) == windowed_rms(RADIAL, ErrorIndex(pointed, *times))


# ---- tables and recordings
@pytest.mark.promise("pointing-35")
@pytest.mark.parametrize(
    "window_s", [pytest.param(1e-4, marks=pytest.mark.endurance), 0.05, pytest.param(20.0, marks=pytest.mark.endurance)]
)
def test_a_table_of_a_density_is_its_motion(window_s):
    freq = np.geomspace(1e-7, 1e8, 400)
    table = psd(RADIAL, freq)
    for index in (
        ErrorIndex("APE"),
        ErrorIndex("MPE", window_s),
        ErrorIndex("RPE", window_s),
        ErrorIndex("PDE", window_s, 2.5 * window_s),
    ):
        # Between two points the power of frequency is up to 1e-3 off, about the corner.
        assert tabulated_rms(freq, table, index, "one") == pytest.approx(windowed_rms(RADIAL, index), rel=1e-3, abs=0.0)
        assert tabulated_rms(freq, table / 2.0, index, "two") == pytest.approx(
            tabulated_rms(freq, table, index, "one"), abs=0.0
        )


def test_a_recorded_motion_has_the_indices_of_its_spectrum():
    """A long one: within five standard errors, from its independent pieces."""
    step, count = 1e-3, 400_000
    decay = math.exp(-2 * math.pi * step)
    noise = np.random.default_rng(3).standard_normal(count)
    motion = np.empty(count)
    motion[0] = noise[0]
    for i in range(1, count):
        motion[i] = decay * motion[i - 1] + math.sqrt(1 - decay**2) * noise[i]
    motion *= 1e-6 * math.sqrt(WHOLE_URAD2)
    for index in (
        ErrorIndex("APE"),
        ErrorIndex("MPE", 0.5),
        ErrorIndex("RPE", 0.5),
        ErrorIndex("PDE", 0.5, 1.5),
    ):
        pieces = [recorded_rms(part, step, index) ** 2 for part in motion.reshape(40, -1)]
        error = np.std(pieces, ddof=1) / math.sqrt(40)
        wanted = windowed_rms(RADIAL, index) ** 2
        assert abs(np.mean(pieces) - wanted) < 5 * error + 0.005 * wanted  # the mean of samples is not quite the mean
        assert error < 0.1 * wanted


@pytest.mark.promise("pointing-35")
def test_the_indices_of_a_short_recording_by_hand():
    rad = np.array([1.0, 3.0, 2.0, 6.0]) * 1e-6
    of = [ErrorIndex("MPE", 2.0), ErrorIndex("RPE", 2.0), ErrorIndex("PDE", 2.0, 2.0), ErrorIndex("APE")]
    squares = [(4 + 6.25 + 16) / 3, (1 + 0.25 + 4) / 3, 4.0, 12.5]
    assert_allclose([recorded_rms(rad, 1.0, each) for each in of], 1e-6 * np.sqrt(squares), rtol=1e-9)


# ---- exposures
@pytest.mark.promise("pointing-35")
def test_the_line_through_an_exposure_by_double_integrals():
    """Two outputs of one motion: their covariance function, weighed twice by mean and slope, where t > u."""
    motion, span = resonance(), 0.013
    C = np.array([[1.0, 0.0], [0.4, 2e-3]])
    found = exposure(lti.StateSpace(motion.A, motion.B, C, np.zeros((2, 1))), span)
    P = covariance(motion.A, motion.B)
    values, vectors = np.linalg.eig(motion.A)
    right = np.linalg.solve(vectors, P @ C.T)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    t = 0.5 * span * (1.0 + nodes)
    u = 0.5 * t[:, None] * (1.0 + nodes)
    area = 0.25 * span * weights[:, None] * t[:, None] * weights
    later = np.exp(values * (t[:, None] - u)[..., None])
    function = np.einsum("ik,tuk,kj->tuij", C @ vectors, later, right).real
    function = function + function.swapaxes(2, 3)

    def twice(of_t, of_u):
        return np.einsum("tu,tu,tuij->ij", area, of_t * of_u, function)

    mean = twice(np.ones_like(u), np.ones_like(u)) / span**2
    slope_t, slope_u = (12.0 * (at / span - 0.5) / span for at in (t[:, None], u))
    smear = twice(slope_t, slope_u)
    whole = C @ P @ C.T
    scale = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    assert_allclose(found.displacement_rad2 / scale, mean / scale, rtol=0, atol=1e-10)
    assert_allclose(found.smear_rad2 / scale, smear / scale, rtol=0, atol=1e-9)
    assert_allclose(found.jitter_rad2 / scale, (whole - mean - smear / 12.0) / scale, rtol=0, atol=1e-9)
    assert np.all(np.abs(smear / scale) > 0.1)


@pytest.mark.parametrize("span", [1e-7, 1e-5, 1e-3, 0.1, 10.0])
def test_displacement_smear_and_jitter_add_up_and_are_those_of_short_and_long_exposures(span):
    for motion in (RADIAL, resonance()):
        one = lti.StateSpace(motion.A, motion.B, motion.C, np.zeros((1, 1)))
        found = exposure(one, span)
        displacement, smear, jitter = (
            float(m[0, 0]) for m in (found.displacement_rad2, found.smear_rad2, found.jitter_rad2)
        )
        whole, left = motion.variance_rad2, windowed_rms(motion, ErrorIndex("RPE", span)) ** 2
        assert displacement == pytest.approx(windowed_rms(motion, ErrorIndex("MPE", span)) ** 2, rel=1e-9, abs=0.0)
        assert displacement + smear / 12.0 + jitter == pytest.approx(whole, rel=1e-9, abs=0.0)
        assert smear / 12.0 + jitter == pytest.approx(left, rel=1e-7, abs=0.0)
    # A motion without a rate of its own moves like a sum of white steps: q T / 10 of its q T / 6 is smear.
    if span < 1e-4:
        q = 2 * (2 * math.pi) * RADIAL.variance_rad2
        short = exposure(lti.StateSpace(RADIAL.A, RADIAL.B, RADIAL.C, np.zeros((1, 1))), span)
        assert_allclose([short.smear_rad2[0, 0], short.jitter_rad2[0, 0]], [1.2 * q * span, q * span / 15], rtol=1e-3)


# ---- refusals
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("MPE",), "MPE needs window_s: give the time in s"),
        (("PDE", 1.0), "PDE needs spacing_s"),
        (("APE", 1.0), "APE has no window_s: leave it out"),
        (("RPE", 1.0, 2.0), "RPE has no spacing_s"),
        (("MPE", 0.0), "window_s of MPE is 0 s; give a finite number above zero"),
        (("XPE", 1.0), 'no error index "XPE"; give one of APE, MPE'),
    ],
)
def test_an_index_has_the_times_of_its_definition(words, message):
    with pytest.raises(ValueError, match=message):
        ErrorIndex(*words)


@pytest.mark.promise("pointing-35")
def test_refusals():
    index, rad = ErrorIndex("MPE", 1.0), np.ones(50)
    with pytest.raises(ValueError, match=r"MPE looks at 1 s, and the recording is 0.5 s long: give shorter times or"):
        recorded_rms(rad, 0.01, index)
    with pytest.raises(ValueError, match="its times are shorter than two samples of 1 s"):
        recorded_rms(rad, 1.0, index)
    with pytest.raises(ValueError, match=r"has the shape \(5, 10\): give one row of finite samples"):
        recorded_rms(rad.reshape(5, 10), 0.01, index)
    for none in ([], [0.0, math.nan] * 100):
        with pytest.raises(ValueError, match=r"a recorded motion has the shape .*: give one row of finite samples"):
            recorded_rms(none, 0.01, index)
    with pytest.raises(ValueError, match=r"PDE: its times are shorter than two samples of 0\.01 s"):
        recorded_rms(rad, 0.01, ErrorIndex("PDE", 0.1, 0.004))
    with pytest.raises(ValueError, match=r"of 0\.01 s, or its spacing than one: give longer ones"):
        recorded_rms(rad, 0.01, ErrorIndex("PDE", 0.1, 0.004))
    with pytest.raises(ValueError, match=r"MPE looks at 1e\+20 s, and the recording is 5e-299 s long"):
        recorded_rms(rad, 1e-300, ErrorIndex("MPE", 1e20))
    assert recorded_rms(rad, 0.01, ErrorIndex("PDE", 0.02, 0.01)) == 0.0
    with pytest.raises(ValueError, match='sided is "": say "one" or "two"'):
        tabulated_rms([1.0, 2.0], [1.0, 1.0], index, "")
    with pytest.raises(ValueError, match="a density needs one finite value above 0 for each frequency above 0 Hz"):
        tabulated_rms([0.0, 2.0], [1.0, 1.0], index, "one")
    for density in ([1.0], [1.0, math.nan], [1.0, 0.0]):
        with pytest.raises(ValueError, match="a density needs one finite value above 0 for each frequency above 0 Hz"):
            tabulated_rms([1.0, 2.0], density, index, "one")
    with pytest.raises(ValueError, match=r"pole of 0 rad/s: it is not stationary; give a stable system"):
        exposure(lti.StateSpace(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))), 1.0)
    with pytest.raises(ValueError, match="direct term, so that its variance is infinite"):
        exposure(lti.StateSpace(-np.ones((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.ones((1, 1))), 1.0)
    with pytest.raises(ValueError, match="an exposure is 0 s; give a finite number above zero"):
        exposure(lti.StateSpace(-np.ones((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))), 0.0)


MOVED = disturbance.combine(
    RADIAL, resonance(17.0, 0.05), disturbance.wheels(13.0, (1.0, 2.5), (3e-9, 5e-10), convention="radial")
)
MADE = 1e-6 * np.sin(0.37 * np.arange(400)) + 3e-7 * np.cos(1.9 * np.arange(400)) + 1e-9 * np.arange(400)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [windowed_rms(MOVED, each) * 1e6 for each in (ErrorIndex("APE"), ErrorIndex("MPE", 0.3),
            ErrorIndex("RPE", 0.3), ErrorIndex("PDE", 0.3, 1.7), ErrorIndex("PRE", 0.2, 2.9))],
     [15.8868958, 12.1113102, 10.2815187, 17.1275277, 18.5634066]),
    (lambda: [rational_rms(MOVED, each) * 1e6 for each in (ErrorIndex("APE"), ErrorIndex("MPE", 0.3),
            ErrorIndex("RPE", 0.3))],
     [15.8868958, 12.6219093, 10.2393427]),
    (lambda: [float(x) for each in (ErrorIndex("MKE", 0.3), ErrorIndex("RKE", 0.3), ErrorIndex("PDE",
            0.3, 1.7)) for x in each.weight([0.2, 1.1, 7.0])],
     [
        0.98821244, 0.689316052, 0.00219394832, 0.0117875598, 0.310683948, 0.997806052, 3.03544629, 0.434893487,
        0.000838013689,
    ]),
    (lambda: [float(x) for each in (ErrorIndex("MPE", 0.3), ErrorIndex("RPE",
            0.3)) for x in each.rational_weight([0.2, 1.1, 7.0])],
     [0.992059208, 0.752997397, 0.0258235216, 0.0118418837, 0.32733388, 0.995575214]),
    (lambda: [tabulated_rms([0.1, 0.7, 3.0, 40.0], [3e-12, 2e-12, 5e-13, 1e-15], each,
            "one") * 1e6 for each in (ErrorIndex("APE"), ErrorIndex("MPE", 0.3), ErrorIndex("RPE",
            0.3), ErrorIndex("PDE", 0.3, 1.7))],
     [2.1312687, 1.52579516, 1.48803742, 2.24984953]),
    (lambda: [tabulated_rms([0.1, 0.7, 3.0, 40.0], [3e-12, 2e-12, 5e-13, 1e-15], ErrorIndex("RPE", 0.3),
            "two") * 1e6],
     [2.10440271]),
    (lambda: [recorded_rms(MADE, 2e-3, each) * 1e6 for each in (ErrorIndex("APE"), ErrorIndex("MPE",
            0.02), ErrorIndex("RPE", 0.02), ErrorIndex("PDE", 0.02, 0.07))],
     [0.775804878, 0.435241826, 0.638908592, 0.145337313]),
    (lambda: [x for each in ErrorIndex("PRE", 0.3, 1.7).cosines for x in each],
     [1.12579093, 0.0, -1.12579093, 0.3, -1.12579093, 1.7, 0.562895465, 1.4, 0.562895465, 2.0]),
])  # fmt: skip
def test_windows_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: ErrorIndex("XPE", 1.0),
            ValueError,
            'no error index "XPE"; give one of APE, MPE, RPE, PDE, PRE, AKE, MKE, RKE',
        ),
        (lambda: ErrorIndex("RPE"), ValueError, "RPE needs window_s: give the time in s"),
        (lambda: ErrorIndex("APE", 0.5), ValueError, "APE has no window_s: leave it out"),
        (lambda: ErrorIndex("RPE", 0.5, 2.0), ValueError, "RPE has no spacing_s: leave it out"),
        (lambda: ErrorIndex("PDE", 0.5), ValueError, "PDE needs spacing_s: give the time in s"),
        (lambda: ErrorIndex("RKE", -0.5), ValueError, "window_s of RKE is -0.5 s; give a finite number above zero"),
        (lambda: ErrorIndex("PRE", 0.5, 0.0), ValueError, "spacing_s of PRE is 0 s; give a finite number above zero"),
        (
            lambda: ErrorIndex("PRE", 0.5, 2.5).rational_weight(1.0),
            ValueError,
            "PRE has no rational form: a difference of two means has a delay in it",
        ),
        (
            lambda: recorded_rms(MADE, 2e-3, ErrorIndex("RPE", 4.0)),
            ValueError,
            ("RPE looks at 4 s, and the recording is 0.8 s long: give shorter times or a longer recording"),
        ),
        (
            lambda: recorded_rms(MADE, -2e-3, ErrorIndex("APE")),
            ValueError,
            "the step of a recording is -0.002 s; give a finite number above zero",
        ),
        (
            lambda: tabulated_rms([0.1, 0.7, 3.0], [3e-12, -2e-12, 5e-13], ErrorIndex("APE"), "one"),
            ValueError,
            "a density needs one finite value above 0 for each frequency above 0 Hz",
        ),
        (
            lambda: tabulated_rms([0.1, 0.7, 3.0], [3e-12, 2e-12, 5e-13], ErrorIndex("APE"), "both"),
            ValueError,
            'sided is "both": say "one" or "two", they differ by a factor of 2 in power',
        ),
    ],
)
def test_a_refusal_of_a_window_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


# ---- by definition, on densities and recordings that no other test has
APART = [
    ErrorIndex("APE"), ErrorIndex("MPE", 0.7), ErrorIndex("MKE", 0.7), ErrorIndex("RKE", 0.7), ErrorIndex("RPE", 0.04),
    ErrorIndex("PDE", 0.7, 0.25), ErrorIndex("PRE", 0.3, 1.9), ErrorIndex("PDE", 0.25, 0.25), ErrorIndex("AKE"),
]  # fmt: skip


@pytest.mark.parametrize("index", APART, ids=[f"{each.kind} {each.window_s} {each.spacing_s}" for each in APART])
@pytest.mark.parametrize("sided", ["one", "two"])
def test_a_density_of_several_slopes_counts_as_its_integral_far_beyond_the_turns_of_its_windows(index, sided):
    freq, S = np.array([0.5, 6.0, 8.0, 40.0]), np.array([3e-12, 2e-12, 2e-12, 1e-13])
    total = 0.0
    for f, s in zip(pairwise(freq), pairwise(S), strict=True):
        grid = np.linspace(*f, 20_001)
        level = np.exp(np.interp(np.log(grid), np.log(f), np.log(s)))
        total += simpson(level * index.weight(grid), x=grid)
    assert tabulated_rms(freq, S, index, sided) == pytest.approx(math.sqrt(total * (1 + (sided == "two"))), rel=1e-8)


@pytest.mark.parametrize("index", APART, ids=[f"{each.kind} {each.window_s} {each.spacing_s}" for each in APART])
def test_a_weight_is_that_of_its_cosines_and_of_the_difference_of_means_that_it_is_named_for(index):
    freq = np.array([0.31, 1.7, 4.4, 23.0])
    mean = np.ones(4) if index.window_s is None else (np.sin(np.pi * freq * index.window_s) / (np.pi * freq)) ** 2
    mean = mean / (index.window_s or 1.0) ** 2
    twice = 1.0 if index.spacing_s is None else 2.0 - 2.0 * np.cos(2 * np.pi * freq * index.spacing_s)
    expected = 1.0 - mean if index.takes == "RPE" else twice * mean
    assert_allclose(index.weight(freq), expected, rtol=1e-12, atol=1e-14)
    cosines = sum(factor * np.cos(2 * np.pi * freq * time) / freq**2 for factor, time in index.cosines)
    assert_allclose(cosines if index.cosines else np.ones(4), twice * mean, rtol=1e-9, atol=1e-13)
    assert_allclose(index.weight(0.0), [1.0 if index.window_s is None or index.takes == "MPE" else 0.0], atol=0.0)


@pytest.mark.parametrize("index", APART, ids=[f"{each.kind} {each.window_s} {each.spacing_s}" for each in APART])
def test_a_recording_counts_window_by_window(index):
    """Each window by itself, of a recording whose mean is far above its motion."""
    step, rad = 0.01, MADE + 0.3
    window, apart = (round(each / step) if each else 0 for each in (index.window_s, index.spacing_s))
    cut = [rad[i : i + max(window, 1)] for i in range(rad.size - window + 1 - (not window))]
    means = np.array([np.mean(each) for each in cut]) if window else rad
    squares = {"APE": rad**2, "MPE": means**2, "RPE": np.array([np.var(each) for each in cut])}
    squares |= dict.fromkeys(("PDE", "PRE"), (means[apart:] - means[: means.size - apart]) ** 2)
    assert recorded_rms(rad, step, index) == pytest.approx(math.sqrt(np.mean(squares[index.takes])), rel=1e-6)


@pytest.mark.parametrize("index", APART, ids=[f"{each.kind} {each.window_s} {each.spacing_s}" for each in APART])
def test_motion_whose_modes_coincide_counts_as_its_density(index):
    """Two equal poles have no modes, and three unlike ones of two inputs beside lines have."""
    double = Disturbance(
        "d", np.array([[-9.0, 5.0], [0.0, -9.0]]), np.diag([2e-6, 7e-6]), np.array([[1.0, 0.5]]), LINES.lines, "", ""
    )
    for motion in (double, disturbance.combine(RADIAL, resonance(3.0, 0.2), LINES)):
        freq = np.concatenate([np.linspace(1e-4, 60.0, 30_001), np.geomspace(60.0, 1e6, 3_001)])
        counted = index.weight(freq) * psd(motion, freq)
        lines = sum(0.5 * each.amplitude_rad**2 * index.weight(each.freq_hz)[0] for each in motion.lines)
        expected = simpson(counted[:30_001], x=freq[:30_001]) + simpson(counted[30_001:], x=freq[30_001:]) + lines
        assert windowed_rms(motion, index) == pytest.approx(math.sqrt(expected), rel=3e-4)


@pytest.mark.parametrize(
    ("window", "spacing", "said"),
    [
        (0.014, None, "RPE: its times are shorter than two samples of 0.01 s, or its spacing than one: give "
                      "longer ones"),
        (0.015, None, None), (4.0, None, None), (4.02, None, "RPE looks at 4.02 s, and the recording is 4 s long: "
                                                            "give shorter times or a longer recording"),
        (1.5, 2.5, None), (1.5, 2.52, "PDE looks at 4.02 s, and the recording is 4 s long: give shorter times or a "
                                      "longer recording"),
    ],
)  # fmt: skip
def test_times_are_rounded_to_samples_before_they_are_held_against_the_recording(window, spacing, said):
    index = ErrorIndex("RPE" if spacing is None else "PDE", window, spacing)
    if said is None:
        assert recorded_rms(MADE, 0.01, index) > 0.0
        return
    with pytest.raises(ValueError) as refused:
        recorded_rms(MADE, 0.01, index)
    assert str(refused.value) == said


@pytest.mark.parametrize("kind", ["MPE", "MKE", "RPE", "RKE", "APE", "AKE"])
def test_lines_beside_noise_count_by_the_rational_weight(kind):
    index = ErrorIndex(kind, None if kind in ("APE", "AKE") else 0.02)
    both = disturbance.combine(resonance(), LINES, replace(LINES, lines=(SpectralLine(5e-6, 11.0),)))
    squares = [0.5 * 2e-6**2 * index.rational_weight(30.0)[0], 0.5 * 5e-6**2 * index.rational_weight(11.0)[0]]
    expected = math.sqrt(rational_rms(resonance(), index) ** 2 + sum(squares))
    assert rational_rms(both, index) == pytest.approx(expected, rel=1e-9)
    s = 2j * np.pi * 11.0 * 0.02
    shapes = {"MPE": 2 * (s + 6), "RPE": s * (s + math.sqrt(12.0)), "APE": s * s + 6 * s + 12}
    expected = abs(shapes[index.takes] / (s * s + 6 * s + 12)) ** 2
    assert index.rational_weight(11.0)[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ErrorIndex("MKE"), "MKE needs window_s: give the time in s"),
        (lambda: ErrorIndex("RKE"), "RKE needs window_s: give the time in s"),
        (lambda: ErrorIndex("PRE"), "PRE needs window_s: give the time in s"),
        (lambda: ErrorIndex("AKE", 2.0), "AKE has no window_s: leave it out"),
        (lambda: ErrorIndex("MKE", 2.0, 3.0), "MKE has no spacing_s: leave it out"),
        (lambda: ErrorIndex("MKE", math.inf), "window_s of MKE is inf s; give a finite number above zero"),
        (lambda: recorded_rms(MADE, 0.01, ErrorIndex("RKE", 0.014)), "RKE: its times are shorter than two samples of "
         "0.01 s, or its spacing than one: give longer ones"),
        (lambda: recorded_rms(MADE, 0.01, ErrorIndex("MKE", 5.0)), "MKE looks at 5 s, and the recording is 4 s long: "
         "give shorter times or a longer recording"),
        (lambda: tabulated_rms([0.5, 3.0, 2.0], [1.0, 1.0, 1.0], ErrorIndex("APE"), "two"), "frequencies of the "
         "density are [0.5, 3.0, 2.0] Hz; give two or more that rise from 0 Hz or above"),
        (lambda: tabulated_rms([0.5], [1.0], ErrorIndex("APE"), "two"), "frequencies of the density are [0.5] Hz; give "
         "two or more that rise from 0 Hz or above"),
        *((lambda bad=bad: tabulated_rms([0.5, 2.0, 3.0], bad, ErrorIndex("APE"), "one"), "a density needs one finite "
           "value above 0 for each frequency above 0 Hz")
          for bad in ([1.0, math.inf, 1.0], [1.0, 1.0, math.nan], [1.0, 1.0, 0.0], [1.0, 1.0], [1.0] * 4, [[1.0] * 3])),
    ],
)  # fmt: skip
def test_a_refusal_names_the_index_that_was_asked_for_and_each_value_of_a_density_counts(call, words):
    with pytest.raises(ValueError) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(
    ("freq_hz", "density"),
    [
        ([1.0, 2.0], [1.0, 1.0, 1.0]),
        ([1.0, 2.0, 3.0], [1.0, 1.0]),
        ([1.0, 2.0], [math.inf, 1.0]),
        ([1.0, 2.0], [1.0, -math.inf]),
        ([1.0, 2.0], [-1.0, 1.0]),
        ([1.0, 2.0], [0.0, 1.0]),
    ],
)
def test_a_density_has_one_finite_value_above_nothing_for_each_frequency(freq_hz, density):
    with pytest.raises(ValueError, match="a density needs one finite value above 0 for each frequency above 0 Hz"):
        tabulated_rms(freq_hz, density, ErrorIndex("APE"), "one")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_recorded_motion_is_finite_to_its_last_sample(value):
    with pytest.raises(ValueError, match=r"a recorded motion has the shape \(4,\): give one row of finite samples"):
        recorded_rms([1.0, 2.0, 3.0, value], 0.01, ErrorIndex("APE"))


@pytest.mark.parametrize(("known", "pointed"), [("AKE", "APE"), ("MKE", "MPE"), ("RKE", "RPE")])
def test_what_is_known_counts_as_what_is_pointed_in_every_kind_of_motion(known, pointed):
    """Of modes that coincide, of lines, of a table and of a recording; each kind gives another number."""
    double = Disturbance(
        "d", np.array([[-9.0, 5.0], [0.0, -9.0]]), np.diag([2e-6, 7e-6]), np.array([[1.0, 0.5]]), LINES.lines, "", ""
    )
    freq, times = np.geomspace(0.01, 50.0, 6), () if known == "AKE" else (0.2,)
    found = []
    for index in (ErrorIndex(known, *times), ErrorIndex(pointed, *times)):
        kinds = [windowed_rms(motion, index) for motion in (double, LINES, MOVED)]
        kinds += [tabulated_rms(freq, psd(RADIAL, freq), index, sided) for sided in ("one", "two")]
        kinds += [recorded_rms(MADE, 0.01, index), rational_rms(MOVED, index)]
        found.append([*kinds, *index.weight(freq), *index.rational_weight(freq), *np.ravel(index.cosines)])
    assert found[0] == found[1]
    others = {ErrorIndex(kind, *(() if kind == "APE" else (0.2,))) for kind in ("APE", "MPE", "RPE")}
    assert len({windowed_rms(double, index) for index in others}) == 3


@pytest.mark.parametrize("size", [640, 643, 647])
def test_amplitudes_of_a_line_are_those_of_eight_parts_from_the_begin_on(size):
    step, freq = 1e-2, 7.3
    time = step * (np.arange(size) - 0.5 * (size - 1))
    rest = np.random.default_rng(6).standard_normal(size)
    rest[640:] = 1e6  # what is left over behind the last part
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(80) / 80.0)
    turned = rest * np.exp(-2j * np.pi * freq * time)
    expected = [2.0 * np.sum(turned[80 * i : 80 * (i + 1)] * window) / np.sum(window) for i in range(8)]
    assert_allclose(recorded_lines._amplitudes(rest, time, freq), expected, rtol=1e-9)
