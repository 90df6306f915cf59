"""What air takes of a beam's mean power: scattering by wavelength, and a turbulent wavefront in the focus.

The light on a disk is held against transforms of a pupil in two dimensions, that in a fibre against pairs of places in
the aperture, and what adaptive optics leaves against the variances of Zernike's modes.
"""

import math
from functools import lru_cache

import numpy as np
import pytest
from scipy.special import gammaln, j0, j1

from ground_files import FIBRE, PHOTODIODE, ground_file
from microrad import link
from microrad.link import gains
from microrad.link.budget import air
from microrad.link.turbulence import seeing

deg = math.pi / 180.0
DIAMETER_M, WAVE_M, FRIED_M = 0.4, 1.55e-6, 0.09
FAR = 1.0 / math.log(10.0)


# ------------------------------------------------------------------------------------------------ scattering by the air
@pytest.mark.parametrize(
    ("wavelength_um", "published"), [(0.4, 0.3620), (0.5, 0.1444), (0.55, 0.0977), (0.8, 0.0213), (1.55, 0.00150)]
)
def test_the_scattering_of_molecules_has_published_depths_at_the_sea(wavelength_um, published):
    """Bucholtz 1995 (Appl. Opt. 34, 2765) at 1013.25 mbar, read at these wavelengths: within 2 %."""
    assert gains.rayleigh_depth(wavelength_um * 1e-6, 0.0) == pytest.approx(published, rel=0.02)


def test_scattering_goes_with_the_air_above():
    at_sea, high = (gains.rayleigh_depth(1.55e-6, height) for height in (0.0, 2393.0))
    # 758 hPa of 1013 in the standard atmosphere of 2393 m: (1 - 2.25577e-5 h)^5.25588
    assert high / at_sea == pytest.approx((1.0 - 2.25577e-5 * 2393.0) ** 5.25588, rel=0.01)
    assert high / at_sea == pytest.approx(math.exp(-2393.0 / 8434.5), rel=1e-12)


def test_haze_goes_with_the_wavelength_to_minus_the_exponent():
    assert gains.aerosol_depth(1e-6, 0.05, 1.3) == pytest.approx(0.05, rel=1e-12)
    assert gains.aerosol_depth(0.5e-6, 0.05, 1.3) == pytest.approx(0.05 * 2.0**1.3, rel=1e-12)
    assert gains.aerosol_depth(2e-6, 0.05, -1.0) == pytest.approx(0.1, rel=1e-12)
    ratio = gains.aerosol_depth(0.44e-6, 0.1, 1.7) / gains.aerosol_depth(0.87e-6, 0.1, 1.7)
    assert -math.log(ratio) / math.log(0.44 / 0.87) == pytest.approx(
        1.7, rel=1e-12
    )  # as Angstrom's exponent is defined


@pytest.mark.parametrize(("elevation", "mass"), [(10.0, 5.586), (20.0, 2.904), (30.0, 1.994), (90.0, 1.000)])
def test_the_loss_in_a_clear_sky_is_that_of_all_depths_over_the_air_mass(tmp_path, elevation, mass):
    """The air masses are those of Kasten and Young's table."""
    m = ground_file(tmp_path, {"orbit.geo.mask": f"{min(elevation, 89.0):g} deg"}).mission
    shared = link.Shared.of(m)
    sky = air.Sky(m.channel, m.path.at(elevation * deg), 0.0)
    for wave, rayleigh in ((1.55e-6, 0.00149), (1.06e-6, 0.00686)):
        depth = rayleigh * math.exp(-2393.0 / 8434.5) + 0.05 * (wave / 1e-6) ** -1.3
        wanted = mass * (10.0 * FAR * depth + 0.05)
        assert sky.clear_db(wave) == pytest.approx(wanted, rel=1e-3)
        if elevation < 89.0:
            assert shared.clear_sky_db(wave) == sky.clear_db(wave)
    assert sky.clear_db(0.55e-6) > 2.0 * sky.clear_db(1.55e-6)


# ------------------------------------------------------------------------------------------------------ light on a disk
@lru_cache(maxsize=1)
def pupil_pairs():
    """Autocorrelation of a round aperture 48 pixels wide over the shift, of one in all; its edge is smoothed."""
    parts = 8
    x = (np.arange(PIXELS * parts) + 0.5) / parts - PIXELS / 2.0
    lit = (np.hypot.outer(x, x) <= PIXELS / 2.0).reshape(PIXELS, parts, PIXELS, parts).mean(axis=(1, 3))
    whole = np.zeros((WIDE, WIDE))
    whole[:PIXELS, :PIXELS] = lit
    # a pixel on the edge, lit by half, has a quarter of the power: what it lacks is scattered out of the image
    return np.fft.ifft2(np.abs(np.fft.fft2(whole)) ** 2).real / np.sum(lit)


PIXELS, WIDE = 48, 512


def share_by_transforms(radius, fried, tilt_taken_out=False):
    """Share on a disk: the image is the transform of the pupil's autocorrelation times the transfer of the air."""
    shift = np.hypot.outer(*(2 * [np.fft.fftfreq(WIDE, 1.0 / WIDE)]))
    apart = shift * DIAMETER_M / PIXELS
    exponent = 3.44 * (apart / fried) ** (5.0 / 3.0)
    if tilt_taken_out:
        exponent = exponent * np.maximum(1.0 - (apart / DIAMETER_M) ** (1.0 / 3.0), 0.0)
    image = np.fft.fft2(pupil_pairs() * np.exp(-exponent)).real / WIDE**2
    step = WAVE_M / (DIAMETER_M / PIXELS * WIDE)
    inside = np.clip(radius / step - shift + 0.5, 0.0, 1.0)  # pixels on the edge count in part
    return float(np.sum(image * inside))


def test_without_turbulence_the_disk_has_what_rayleigh_wrote():
    for radius in (1e-6, 4.7e-6, 20e-6, 200e-6):
        x = math.pi * radius * DIAMETER_M / WAVE_M
        wanted = 1.0 - float(j0(x)) ** 2 - float(j1(x)) ** 2
        assert seeing.encircled(radius, DIAMETER_M, WAVE_M, math.inf) == pytest.approx(wanted, abs=2e-6)
    edge = 1.21967 * WAVE_M / DIAMETER_M  # the first dark ring, with 83.8 % in it
    assert seeing.encircled(edge, DIAMETER_M, WAVE_M, math.inf) == pytest.approx(0.8378, abs=1e-4)


@pytest.mark.parametrize("tilt_taken_out", [False, True])
@pytest.mark.parametrize("fried", [0.05, FRIED_M, 0.4])
def test_the_light_on_a_disk_is_that_of_transforms_in_two_dimensions(fried, tilt_taken_out):
    for radius in (5e-6, 15e-6, 30e-6):
        found = seeing.encircled(radius, DIAMETER_M, WAVE_M, fried, tilt_taken_out=tilt_taken_out)
        assert found == pytest.approx(share_by_transforms(radius, fried, tilt_taken_out), rel=0.01)


def test_an_image_that_is_kept_in_the_middle_lies_between_long_exposure_and_still_air():
    for radius in (3e-6, 10e-6, 25e-6):
        still = seeing.encircled(radius, DIAMETER_M, WAVE_M, math.inf)
        long, short = (
            seeing.encircled(radius, DIAMETER_M, WAVE_M, FRIED_M, tilt_taken_out=each) for each in (False, True)
        )
        assert long < 0.99 * short < 0.98 * still
    # of a small aperture only the tilt is there: taken out, nearly all is won back
    still, long, short = (
        seeing.encircled(10e-6, 0.05, WAVE_M, fried, tilt_taken_out=each)
        for fried, each in ((math.inf, False), (FRIED_M, False), (FRIED_M, True))
    )
    assert 0.0 < still - short < 0.4 * (still - long)


# ---------------------------------------------------------------------------------------------------- adaptive optics
def test_what_is_left_behind_zernikes_modes_is_what_they_do_not_have():
    """A mode of the radial order n has (n + 1) G(n - 5/6) / G(n + 23/6) of the variance (Noll 1976), 1.0299 in all."""
    n = np.arange(1, 4000)
    each = (n + 1) * np.exp(gammaln(n - 5.0 / 6.0) - gammaln(n + 23.0 / 6.0))
    each = each * 1.0299 / np.sum((n + 1) * each)  # an order n has n + 1 modes
    modes = np.repeat(each[:50], n[:50] + 1)
    for count in (0, 1, 2, 3, 4, 6, 10, 12):
        left = 1.0299 - float(np.sum(modes[: max(count - 1, 0)]))
        assert seeing.residual(count) == pytest.approx(left, abs=1.5e-3)
    for count in (21, 100, 1000):
        assert seeing.residual(count) == pytest.approx(1.0299 - float(np.sum(modes[: count - 1])), rel=0.1)
    assert np.all(np.diff([seeing.residual(count) for count in range(1, 60)]) < 0.0)


def wavefront_db(folder, *changes):
    data = link.of(ground_file(folder, *changes).mission)
    return data.turbulent.wavefront_db, data


@pytest.mark.promise("link-111")
def test_a_fibre_takes_of_turbulent_light_what_pairs_of_places_have_in_common(tmp_path):
    """The mean power is the mean of the field's coherence over pairs of places, each with the mode's amplitude there.

    The coherence of Kolmogorov's spectrum, exp(-3.44 (rho / r0)^(5/3)), and the Gaussian one with the same radius at
    1/e, which the closed form has.
    """
    lost, data = wavefront_db(tmp_path, {"communication.coupling": FIBRE})
    r0, diameter, truncation = data.turbulent.path.fried_m, 0.4, data.receiving.end.pupil.truncation
    at = (np.arange(18) + 0.5) / 9.0 - 1.0
    x, y = (each.ravel() for each in np.meshgrid(at, at))
    inside = np.hypot(x, y) < 1.0
    x, y = x[inside], y[inside]
    mode = np.exp(-((truncation * np.hypot(x, y)) ** 2))
    apart = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y)) * diameter / 2.0

    def db(coherence):
        return -10.0 * math.log10(mode @ coherence @ mode / np.sum(mode) ** 2)

    assert lost == pytest.approx(db(np.exp(-((2.1 * apart / r0) ** 2))), abs=0.06)
    assert lost == pytest.approx(db(np.exp(-3.44 * (apart / r0) ** (5.0 / 3.0))), abs=0.5)
    assert lost > 5.0


@pytest.mark.parametrize("taken", [FIBRE, PHOTODIODE, {**PHOTODIODE, "detector_radius": "100 um"}])
def test_more_corrected_modes_never_take_more_light(tmp_path, taken):
    found = [
        wavefront_db(tmp_path, {"communication.coupling": taken, "channel.turbulence.corrected_modes": modes})[0]
        for modes in (0, 3, 4, 6, 10, 30, 100, 1000)
    ]
    assert np.all(np.diff(found) <= 1e-4)
    assert found[0] > found[-1] >= 0.0


@pytest.mark.promise("link-111")
def test_what_adaptive_optics_leaves_of_a_fibre_is_marechals(tmp_path):
    changes = {"communication.coupling": FIBRE, "channel.turbulence.corrected_modes": 100}
    lost, data = wavefront_db(tmp_path, changes)
    over = 0.4 / data.turbulent.path.fried_m
    assert lost == pytest.approx(10.0 * FAR * 0.2944 * 100 ** (-math.sqrt(3.0) / 2.0) * over ** (5.0 / 3.0), rel=1e-12)
    assert not any("Marechal" in doubt for doubt in data.turbulent.doubts)
    few = {"communication.coupling": FIBRE, "channel.turbulence.corrected_modes": 3}
    assert "1.1 rad rms, above 1: Marechal's ends" in wavefront_db(tmp_path, few)[1].turbulent.doubts[-1]


def test_a_detector_loses_what_falls_beside_it(tmp_path):
    """The radius over the focal length is 20 urad; long exposure without correction, the tilt out with three modes."""
    for modes, tilt_taken_out in ((0, False), (3, True)):
        changes = {"communication.coupling": PHOTODIODE, "channel.turbulence.corrected_modes": modes}
        lost, data = wavefront_db(tmp_path, changes)
        r0 = data.turbulent.path.fried_m
        shares = share_by_transforms(20e-6, r0, tilt_taken_out), share_by_transforms(20e-6, math.inf)
        assert lost == pytest.approx(10.0 * math.log10(shares[1] / shares[0]), abs=0.05)
        assert lost > 0.05
    assert wavefront_db(tmp_path)[0] == 0.0  # what takes the light is not said
