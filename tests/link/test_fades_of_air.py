"""Fades of the air: against drawn powers, double integrals, and the quadrature that their definition is."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammaln, kve, ndtr, ndtri

from microrad.link.budget import air
from microrad.link.turbulence import GammaGamma, LogNormal, Wandering

LAWS = [
    LogNormal(0.03),
    LogNormal(0.9),
    GammaGamma.of_index(0.03),
    GammaGamma.of_index(0.9),
    Wandering(LogNormal(0.1), 3.0),
    Wandering(GammaGamma.of_index(0.4), 1.2),
    Wandering(LogNormal(0.7), 1e4),
    Wandering(LogNormal(1e-12), 40.0),
]


def decibels(power):
    return -10.0 * math.log10(power)


# --------------------------------------------------------------------------------------------------------- gamma-gamma
def density(log_power, a, b):
    """2 (a b)^((a + b) / 2) / (G(a) G(b)) I^((a + b) / 2) K_(a - b)(2 sqrt(a b I)), of ln I (Al-Habash et al. 2001)."""
    at = 2.0 * math.sqrt(a * b) * math.exp(log_power / 2.0)
    log = math.log(2.0) + (a + b) / 2.0 * (math.log(a * b) + log_power) - gammaln(a) - gammaln(b)
    return math.exp(log + math.log(kve(a - b, at)) - at)


def in_parts(function, edges, **settings):
    """An adaptive quadrature over each part between the edges."""
    return sum(quad(function, *part, **settings)[0] for part in itertools.pairwise(edges))


@pytest.mark.parametrize("index", [0.02, 0.3, 0.95, 2.5])
def test_the_law_of_an_index_has_mean_one_and_that_index(index):
    law = GammaGamma.of_index(index)
    assert law.index == pytest.approx(index, rel=1e-12)
    edges, pair = (-30.0, -5.0, -1.0, -0.3, 0.3, 1.0, 5.0, 7.0), (law.large, law.small)
    moments = [in_parts(lambda t, n=n: math.exp(n * t) * density(t, *pair), edges, epsrel=1e-9) for n in (0, 1, 2)]
    assert moments[:2] == pytest.approx([1.0, 1.0], rel=1e-6)
    assert moments[2] - 1.0 == pytest.approx(index, rel=1e-5)
    assert math.log1p(1.0 / law.large) / math.log1p(index) == pytest.approx(0.49, rel=1e-9)  # of the large scale
    assert law.large > law.small


def below_by_quadrature(power, a, b):
    """The share by the density's own integral, from far below, in the logarithm of the power."""
    low = math.log(power)
    parts = [low - 60.0 / min(a, b), low - 20.0 / min(a, b), low - 3.0 / min(a, b), low]
    return in_parts(lambda t: density(t, a, b), parts, epsrel=1e-11, epsabs=0.0, limit=200)


@pytest.mark.parametrize(("large", "small"), [(0.8, 0.5), (4.2, 1.4), (1.4, 4.2), (7.3, 7.0), (25.0, 20.0)])
def test_the_share_below_a_power_is_the_integral_of_the_density_far_into_the_tail(large, small):
    law, seen = GammaGamma(large, small), []
    for power in (2.0, 0.5, 0.1, 1e-2, 1e-3, 1e-5, 1e-8):
        wanted = below_by_quadrature(power, large, small)
        if wanted < 1e-24:
            continue
        seen.append(wanted)
        # what the 1200 points of the spline leave is below 1e-6; behind 1e-18 the power law is a limit
        assert float(law.below(power)) == pytest.approx(wanted, rel=1e-5 if wanted > 1e-17 else 0.3)
    assert seen[0] > 0.5 and seen[-1] < 1e-3 and len(seen) >= 3
    assert float(law.below(0.0)) == 0.0
    assert float(law.below(1e6)) == pytest.approx(1.0, abs=1e-12)


def test_behind_the_spline_the_law_falls_with_the_power_of_its_narrower_tail():
    """Far down only the scale with the smaller parameter counts: the share goes as the power to that."""
    law = GammaGamma(8.0, 1.4)
    ratio = math.log(float(law.below(1e-16)) / float(law.below(1e-18))) / math.log(100.0)
    assert ratio == pytest.approx(1.4, rel=1e-3)
    shares = law.below(np.geomspace(1e-30, 1e3, 400))
    assert np.all(np.diff(shares) >= 0.0) and shares[0] < 1e-40


# ---------------------------------------------------------------------------------------------------------- log-normal
def test_log_normal_fades_are_closed():
    for index in (0.01, 0.2, 0.9):
        law, variance = LogNormal(index), math.log(1.0 + index)
        for outage in (0.3, 1e-2, 1e-9):
            power = math.exp(math.sqrt(variance) * ndtri(outage) - variance / 2.0)
            assert law.loss_db(outage) == pytest.approx(decibels(power), rel=1e-12)
            assert float(law.below(power)) == pytest.approx(outage, rel=1e-9)


# ------------------------------------------------------------------------------------------------------------ wandering
def test_a_wandering_beam_fades_as_drawn_powers_do():
    """A beam is thrown about both axes, and scintillates on its own; the power is over the mean of what is drawn."""
    rng, count = np.random.default_rng(7), 400_000
    half, radial, variance = 10e-6, 5e-6, math.log(1.2)
    off = rng.standard_normal((2, count)) * radial / math.sqrt(2.0)
    power = np.exp(-2.0 * (off[0] ** 2 + off[1] ** 2) / half**2)
    power = power * np.exp(math.sqrt(variance) * rng.standard_normal(count) - variance / 2.0)
    power = power / np.mean(power)
    law = Wandering(LogNormal(0.2), half**2 / (2.0 * radial**2))
    for at in (0.05, 0.3, 0.8, 1.5, 2.5):
        share = np.mean(power < at)
        assert float(law.below(at)) == pytest.approx(share, abs=5.0 * math.sqrt(share * (1.0 - share) / count) + 1e-6)
    for outage in (0.3, 1e-2, 1e-3):
        assert law.loss_db(outage) == pytest.approx(decibels(np.quantile(power, outage)), abs=0.15)


@pytest.mark.parametrize(("index", "beam"), [(0.15, 0.6), (0.15, 2.0), (0.15, 9.0), (0.005, 1.05), (0.03, 60.0)])
def test_a_wandering_beam_fades_as_the_integral_over_both_its_axes_says(index, beam):
    """The radial error r over its rms has the density 2 r exp(-r^2); the power is exp(-r^2 / beam) over its mean.

    A beam that hardly scintillates and wanders far has the sharpest integrand.
    """
    law, variance = Wandering(LogNormal(index), beam), math.log(1.0 + index)
    mean = quad(lambda r: 2.0 * r * math.exp(-r * r * (1.0 + 1.0 / beam)), 0.0, 9.0, epsrel=1e-12)[0]

    def below(power):
        def still(r):
            log = math.log(power * mean) + r * r / beam
            return 2.0 * r * math.exp(-r * r) * ndtr((log + variance / 2.0) / math.sqrt(variance))

        return in_parts(still, (0.0, 1.0, 2.0, 3.5, 5.0, 7.0, 9.5), epsrel=1e-10, epsabs=0.0)

    for outage in (0.5, 0.1, 1e-2, 1e-3, 1e-6, 1e-9):
        power = 10.0 ** (-0.1 * law.loss_db(outage))
        assert float(law.below(power)) == pytest.approx(outage, rel=1e-6)
        assert below(power) == pytest.approx(outage, rel=1e-6 if index > 0.005 else 1e-3)


def test_a_beam_that_is_wide_against_its_wander_only_scintillates():
    still = LogNormal(0.1)
    assert Wandering(still, 1e7).loss_db(1e-3) == pytest.approx(still.loss_db(1e-3), abs=1e-4)
    assert Wandering(still, 2.0).loss_db(1e-3) > still.loss_db(1e-3) + 5.0
    # of a beam that does not scintillate the power is U^(1 / beam) over beam / (beam + 1)
    closed = decibels(1e-2 ** (1.0 / 3.0) / 0.75)
    assert Wandering(LogNormal(1e-12), 3.0).loss_db(1e-2) == pytest.approx(closed, abs=0.05)
    assert float(Wandering(LogNormal(0.1), 0.05).below(1e-3)) > 0.6  # of a beam far narrower than its wander


# ------------------------------------------------------------------------------------------------------- as losses
@pytest.mark.parametrize("law", LAWS)
def test_fades_as_losses_have_all_of_the_time_the_mean_power_and_their_quantiles(law):
    found = air.losses(law)
    assert np.sum(found.share) == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.diff(found.loss_db) > 0.0)
    assert found.mean_db == pytest.approx(0.0, abs=5e-4)
    for outage in (0.2, 1e-2, 1e-3, 1e-6):
        # a step of the losses is a thousandth of their span, which the tail is read within
        step = float(np.max(np.diff(found.loss_db)))
        assert float(found.beyond(law.loss_db(outage))) == pytest.approx(outage, rel=0.05, abs=1e-12)
        assert (
            float(found.beyond(law.loss_db(outage) + step)) < outage < float(found.beyond(law.loss_db(outage) - step))
        )


def test_the_deepest_fades_of_a_strong_law_are_found_on_both_sides():
    """A log-normal law of index 1 has more than 20 dB over its mean for 1e-12 of the time."""
    law = Wandering(LogNormal(1.0), 1e6)
    assert law.loss_db(1.0 - 1e-12) == pytest.approx(LogNormal(1.0).loss_db(1.0 - 1e-12), abs=0.01)
    assert law.loss_db(1.0 - 1e-12) < -20.0
    assert law.loss_db(1e-15) == pytest.approx(LogNormal(1.0).loss_db(1e-15), rel=1e-3)
