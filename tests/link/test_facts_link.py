"""Every number that is known of the link and of pointing, to its printed digits, by the public functions.

Each case says where its number comes from. "Checked" is arithmetic that was done by two independent methods.

Not here, because they are published facts about flown or planned terminals and follow from no formula: mass, power and
range of the TESAT terminal (45 000 km, 1.8 Gbit/s, 160 W, 50 to 56 kg), the jitter and the 4.8 TB of TBIRD, the data
rate of CLICK-B/C (17.7 Mbit/s at 520 km), what the Micius terminal leaves after tracking (0.16, 0.26, 0.25 and
0.28 urad in the four bands), and the acquisition in about 100 s of LLCD and of the SDA standard. The line-of-sight rate
of 255 urad/s needs an orbit, which is an input of a mission.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import budgets
from microrad import link
from microrad.link import beams, gains, pointing
from microrad.link import study as link_study
from microrad.link.acquisition import scan
from microrad.link.pointing import statistics
from microrad.link.receivers import PpmCounting
from microrad.loop import disturbance, sensor
from microrad.mirror.geometry import Geometry, line_of_sight_matrix
from microrad.mission.file import load_mission
from shipped import SHIPPED

FILE = load_mission(SHIPPED)
MISSION, SOURCES = FILE.mission, FILE.sources
WAVE_M, LEO_M, GEO_M, URAD = 1.55e-6, 0.05, 0.15, 1e-6
BEAM_HALF_RAD = link.of(MISSION).beam.fall.half_angle_rad


def printed(value, text):
    """Whether a value, rounded to the digits of a printed number, is that number."""
    digits = len(text.partition(".")[2])
    return f"{value:.{digits}f}" == text


def changed(**tables):
    """The shipped mission with some values of some tables changed."""
    return MISSION.model_copy(
        update={name: getattr(MISSION, name).model_copy(update=values) for name, values in tables.items()}
    )


def show(cases):
    """Cases whose third entry is their source, which becomes their name."""
    return pytest.mark.parametrize(
        ("value", "text"), [pytest.param(value, text, id=source) for value, text, source in cases]
    )


# ------------------------------------------------------------------------------------------------ gains and losses
def lossless_dbm():
    """5 W from 5 cm to 15 cm over 42 000 km, nothing lost but in space."""
    mission = changed(communication={"strehl": 0.0, "pointing_error_rad": 0.0})
    return next(line.value for line in budgets.communication(mission, SOURCES).totals if line.name == "Received power")


@show(
    [
        (gains.aperture_gain_db(LEO_M, WAVE_M), "100.12", "checked: 5 cm at 1.55 um"),
        (gains.aperture_gain_db(GEO_M, WAVE_M), "109.66", "checked: 15 cm at 1.55 um"),
        (gains.free_space_loss_db(42e6, WAVE_M), "290.64", "checked: 42 000 km"),
        (gains.free_space_loss_db(44e6, WAVE_M), "291.05", "checked: 44 000 km"),
        (lossless_dbm(), "-43.88", "checked: 5 W without losses"),
        (float(gains.pointing_loss_db(10 * URAD, LEO_M, WAVE_M, "gaussian")), "2.23", "checked: Gaussian, w = D/2"),
        (float(gains.pointing_loss_db(10 * URAD, LEO_M, WAVE_M, "gain")), "4.46", "checked: exp(-G theta^2)"),
        (gains.strehl_loss_db(0.4, "ratio"), "3.98", "checked: Strehl 0.4 as a ratio"),
        (gains.strehl_loss_db(0.4, "decibel"), "0.4", "paper, Table 2: Strehl 0.4 dB"),
        (float(gains.gaussian_pointing_loss_db(BEAM_HALF_RAD, BEAM_HALF_RAD)), "8.686", "checked: loss at 1/e2"),
        (budgets.communication(MISSION, SOURCES).margin_db, "3.0", "paper, section 2.2: 300 Mbit/s, 10 urad"),
    ]
)
def test_gains_and_losses_are_those_of_the_papers_link(value, text):
    assert printed(value, text)


IMPLIED = sorted(reading.photons_per_bit for reading in link.implied_sensitivity(link.of(MISSION)))
IDEAL = {each.name: each.photons_per_bit for each in link.ideal_receivers(link.of(MISSION), SOURCES)}


@show(
    [
        (IMPLIED[0], "76", "checked: implied by 3 dB, least of four readings"),
        (IMPLIED[3], "291", "checked: implied by 3 dB, most of four readings"),
        (IDEAL["Homodyne BPSK"], "8.99", "Agrawal, at 1e-9: homodyne BPSK"),
        (IDEAL["Preamplified DPSK"], "20.03", "Agrawal, at 1e-9: preamplified DPSK"),
        (IDEAL["On-off keying, photon counting"], "10.0", "Agrawal, at 1e-9: on-off keying, average"),
    ]
)
def test_photons_per_bit_are_those_implied_and_those_of_ideal_receivers(value, text):
    assert len(IMPLIED) == 4
    assert printed(value, text)


def test_the_margin_of_the_paper_is_a_band_over_the_four_readings():
    # checked: Fig. 2 stands for any of them, as far apart as the sensitivities that they imply
    at = [float(each[0, 0]) for each in link.convention_maps(link.of(MISSION), 300e6, 10 * URAD).values()]
    assert len(at) == 4
    assert max(at) - min(at) == pytest.approx(10 * math.log10(IMPLIED[3] / IMPLIED[0]), abs=1e-9)
    assert max(at) == pytest.approx(budgets.communication(MISSION, SOURCES).margin_db, abs=1e-9)


@pytest.mark.parametrize("order", [2, 16, 256])
@pytest.mark.parametrize("counts", [0.5, 3.0, 20.0])
def test_words_of_pulse_position_are_erased_as_no_photon_comes(order, counts):
    # literature: Ps = (M - 1) / M exp(-n), and BER = M / (2 (M - 1)) Ps
    receiver = PpmCounting(
        wavelength_m=WAVE_M,
        bit_error_ratio=1e-9,
        bandwidth_hz=1e12,
        detection_efficiency=1.0,
        dark_count_rate_hz=0.0,
        background_power_w=0.0,
        order=order,
    )
    rate = 1e8
    power = counts / math.log2(order) * gains.photon_energy_j(WAVE_M) * rate
    words = float(receiver.bit_error_ratio_at(power, rate)) * 2 * (order - 1) / order
    assert words == pytest.approx((order - 1) / order * math.exp(-counts), rel=1e-10)


def beacon(divergence):
    """Irradiance of the beacon at GEO in nW/m2, 300 urad off its axis and on it."""
    budget = budgets.beacon(changed(conventions={"divergence": divergence}), SOURCES)
    return 1e9 * budget.irradiance_w_m2, 1e9 * budget.irradiance_on_axis_w_m2


@show(
    [
        (beacon("full-1/e2")[0], "2.42", "checked: 780 urad as a full angle, 300 urad off axis"),
        (beacon("full-1/e2")[1], "8.65", "checked: 780 urad as a full angle, on axis"),
        (beacon("half-1/e2")[0], "1.47", "checked: 780 urad as a half angle, 300 urad off axis"),
    ]
)
def test_the_beacons_irradiance_is_that_of_its_reading(value, text):
    assert printed(value, text)


# --------------------------------------------------------------------------------------------------------- beams
def truncated(truncation):
    """Gain of an aperture lit by a Gaussian beam, over that of an even light."""
    return beams.LitAperture(LEO_M, WAVE_M, truncation, 0.0).efficiency


LUCE_W, LUCE_HALF_RAD, LUCE_MEASURED_W_SR = 0.09, 9.4e-6 / 2, 560e6  # OICETS engineering model, full angle at 1/e2


@show(
    [
        (beams.BEST_TRUNCATION, "1.1209", "Klein and Degnan 1974: best truncation"),
        (truncated(beams.BEST_TRUNCATION), "0.81453", "Klein and Degnan 1974: its efficiency"),
        (1e-9 * gains.peak_radiant_intensity_w_sr(LUCE_W, LUCE_HALF_RAD), "2.594", "checked: LUCE, ideal GW/sr"),
        (gains.implied_transmission_db(LUCE_MEASURED_W_SR, LUCE_W, LUCE_HALF_RAD), "-6.66", "checked: LUCE, 560 MW/sr"),
        (1e6 * BEAM_HALF_RAD, "19.7", "checked: lambda / (pi w0), w0 = 2.5 cm, in urad"),
    ]
)
def test_beams_have_their_published_gain(value, text):
    assert printed(value, text)


def test_no_other_truncation_has_more_gain():
    assert all(truncated(beams.BEST_TRUNCATION) > truncated(beams.BEST_TRUNCATION + step) for step in (-1e-3, 1e-3))


@pytest.mark.parametrize("share", [0.0, 1 / 50, 1 / 14])
def test_the_strehl_ratio_is_that_of_marechal(share):
    # literature: S = exp(-(2 pi sigma / lambda)^2); "diffraction-limited" at a fourteenth of a wavelength, S about 0.8
    assert gains.strehl_ratio(share * WAVE_M, WAVE_M) == pytest.approx(
        math.exp(-((2 * math.pi * share) ** 2)), rel=1e-14
    )


def test_the_pointing_loss_grows_with_the_square_of_the_error():
    # checked: 8.686 (theta / theta_d)^2 dB, theta_d = lambda / (pi w0)
    half = WAVE_M / (math.pi * LEO_M / 2)
    assert half == pytest.approx(BEAM_HALF_RAD, rel=1e-12)
    error = np.array([0.1, 1.0, 2.0]) * half
    assert_allclose(gains.gaussian_pointing_loss_db(error, half), 20 / math.log(10) * (error / half) ** 2, rtol=1e-12)


# -------------------------------------------------------------------------------------------------------- jitter
def even(rms_rad):
    """The same jitter about both axes."""
    return pointing.Jitter((0.0, 0.0), (rms_rad, rms_rad))


def in_best_beam(outage, rms_rad=3 * URAD):
    """Divergence with the most power at the outage."""
    return pointing.best_divergence_for_outage(even(rms_rad), outage)


@show(
    [
        (float(statistics.mean_transmission(even(0.7206 * URAD), 10 * URAD)), "0.97965", "checked: 0.7206 on 10 urad"),
        (in_best_beam(1e-3).loss_db, "4.343", "checked: loss in the best divergence, outage 1e-3"),
        (in_best_beam(0.3).loss_db, "4.343", "checked: loss in the best divergence, outage 0.3"),
        (
            pointing.best_divergence_for_static_error(5 * URAD).loss_db,
            "4.343",
            "checked: loss in the best divergence for a static error",
        ),
    ]
)
def test_jitter_costs_what_was_checked(value, text):
    assert printed(value, text)


@pytest.mark.parametrize("beta", [0.5, 1.0, 4.0, 30.0])
def test_jitter_follows_the_power_law_of_toyoshima(beta):
    # Toyoshima 2002: beta = theta_d^2 / (4 sigma^2), p(h) = beta h^(beta - 1), P(h < x) = x^beta
    half = 10 * URAD
    jitter = even(half / (2 * math.sqrt(beta)))
    assert float(statistics.mean_transmission(jitter, half)) == pytest.approx(beta / (beta + 1), rel=1e-12)
    assert beta / (beta + 1) == pytest.approx(1 / (1 + 4 * jitter.rms_rad[0] ** 2 / half**2), rel=1e-12)
    h, step = np.array([0.3, 0.6, 0.9]), 1e-5

    def below(x):
        return statistics.outage_probability(jitter, half, -10 * np.log10(x))

    assert_allclose(below(h), h**beta, rtol=1e-9)
    assert_allclose((below(h + step) - below(h - step)) / (2 * step), beta * h ** (beta - 1), rtol=1e-5)


@pytest.mark.parametrize("outage", [1e-9, 1e-3, 0.3])
def test_the_best_divergence_is_two_rms_times_a_root(outage):
    # checked: theta_d = 2 sigma sqrt(ln(1/p)); for a static error sqrt(2) times it
    wanted = 2 * 3 * URAD * math.sqrt(math.log(1 / outage))
    assert in_best_beam(outage).half_angle_rad == pytest.approx(wanted, rel=1e-9)
    static = pointing.best_divergence_for_static_error(5 * URAD).half_angle_rad
    assert static == pytest.approx(math.sqrt(2) * 5 * URAD, rel=1e-12)


# --------------------------------------------------------------------------------------------------- disturbances
def behind_first_order_loop(before, bandwidth_hz):
    """What a loop with the error rejection f^2 / (f^2 + fb^2) leaves: the motion less its own low pass."""
    rate, size = 2 * math.pi * bandwidth_hz, before.A.shape[0]
    return disturbance.Disturbance(
        name="residual",
        A=np.block([[before.A, np.zeros((size, 1))], [rate * before.C, np.array([[-rate]])]]),
        B=np.vstack([before.B, np.zeros((1, before.B.shape[1]))]),
        C=np.hstack([before.C, [[-1.0]]]),
        lines=(),
        basis="",
        source="",
    )


def radial_urad(axis):
    """Both axes together, in urad: they are alike."""
    return math.sqrt(2) * axis.rms_rad / URAD


@show(
    [
        (radial_urad(disturbance.olympus()), "15.853", "ESA OLYMPUS, checked: radial"),
        *(
            (radial_urad(behind_first_order_loop(disturbance.olympus(), bandwidth)), text, f"checked: {bandwidth} Hz")
            for bandwidth, text in ((10, "4.780"), (100, "1.577"), (500, "0.708"))
        ),
    ]
)
def test_olympus_leaves_what_was_checked(value, text):
    assert printed(value, text)


@pytest.mark.parametrize("bandwidth_hz", [10, 100, 500])
def test_olympus_leaves_80_pi_over_one_more_than_the_bandwidth_and_half_of_it_about_an_axis(bandwidth_hz):
    # checked: sigma^2 = 80 pi / (1 + fb) urad^2 radial, from S(f) = 160 / (1 + f^2) urad^2/Hz
    radial = 80 * math.pi / (1 + bandwidth_hz)
    axis = behind_first_order_loop(disturbance.olympus(), bandwidth_hz)
    assert (axis.rms_rad / URAD) ** 2 == pytest.approx(radial / 2, rel=1e-9)
    whole = behind_first_order_loop(disturbance.olympus(convention="per-axis"), bandwidth_hz)
    assert (whole.rms_rad / URAD) ** 2 == pytest.approx(radial, rel=1e-9)
    freq = np.array([0.0, 0.5, 1.0, 30.0])
    assert_allclose(2 * disturbance.psd(disturbance.olympus(), freq) / URAD**2, 160 / (1 + freq**2), rtol=1e-12)


MICIUS = disturbance.fit_bands(
    disturbance.MICIUS_EDGES_HZ, disturbance.MICIUS_RMS_RAD, convention="per-axis", name="Micius", source="literature"
).disturbance


@show(
    [
        (rms / URAD, text, f"Micius before tracking: {band}")
        for rms, text, band in zip(
            disturbance.band_rms(MICIUS, np.array([0.0, 1.0, 10.0, 50.0, 100.0])),
            ("8.6", "2.8", "1.9", "0.6"),
            ("0 to 1 Hz", "1 to 10 Hz", "10 to 50 Hz", "50 to 100 Hz"),
            strict=True,
        )
    ]
)
def test_the_fitted_motion_of_micius_has_its_bands(value, text):
    assert printed(value, text)


def test_wheels_shake_with_the_square_of_their_speed():
    # literature: Fi = Ci Omega^2 sin(2 pi hi Omega t)
    for speed in (20.0, 50.0):
        lines = disturbance.wheels(speed, (1.0, 2.5), (1e-10, 4e-11), convention="per-axis").lines
        assert [line.freq_hz for line in lines] == [speed, 2.5 * speed]
        assert [line.amplitude_rad for line in lines] == pytest.approx([1e-10 * speed**2, 4e-11 * speed**2])


# -------------------------------------------------------------------------------------------- open-loop pointing
def test_the_papers_sum_stands_next_to_those_of_the_standard_and_is_not_authorised():
    # paper, section 2.1: root sum square, which 780 urad cover; ECSS-E-ST-60-10C: means linearly, deviations in squares
    budget = budgets.open_loop(MISSION, SOURCES)
    named = {each.rule: each for each in budget.summations}
    assert printed(2 * budget.rss_rad / URAD, "780")
    assert named["rss"].total_rad == budget.rss_rad
    assert "the paper" in named["rss"].authority
    assert named["rss"].caveat.startswith("not authorised")
    assert all("ECSS-E-ST-60-10C" in named[rule].authority for rule in ("ecss-axis", "ecss-radial", "rayleigh"))
    assert {term.kind for term in budget.terms} == {"bias", "random", "drift"}
    assert named["ecss-radial"].total_rad > named["exact"].total_rad > named["rss"].total_rad


# --------------------------------------------------------------------------------------------------- acquisition
SEARCH = scan.Search(sigma_rad=300 * URAD, beam_radius_rad=20 * URAD, overlap=0.25, coverage=0.995)
HALF_RADIUS_STEPS = int(math.pi * SEARCH.radius_rad**2 / (SEARCH.pitch_rad * SEARCH.beam_radius_rad / 2))


@show(
    [
        (SEARCH.radius_rad / URAD, "976.6", "checked: R = sigma sqrt(-2 ln(1 - P))"),
        (HALF_RADIUS_STEPS, "9987", "checked: half-radius steps"),
    ]
)
def test_the_spiral_is_that_of_the_worked_example(value, text):
    assert printed(value, text)


def test_a_spiral_takes_its_area_over_pitch_and_speed():
    # checked: T = pi R^2 / (pitch speed)
    spiral = scan.Spiral(SEARCH, scan.Detector(1e-3), 0.01)
    wanted = math.pi * SEARCH.radius_rad**2 / (30 * URAD * 0.01)
    assert spiral.duration_s == pytest.approx(wanted, rel=1e-12)


def test_the_papers_beacon_and_the_papers_distances_stand_in_the_shipped_mission():
    # paper, Table 2 and section 2.1
    m = MISSION
    assert (m.beacon.transmit_power_w, m.communication.transmit_power_w) == (4.0, 5.0)
    assert (m.terminals.leo_aperture_m, m.terminals.geo_aperture_m) == (LEO_M, GEO_M)
    assert (m.beacon.distance_m, m.communication.distance_m) == (44e6, 42e6)
    assert (m.beacon.pointing_error_rad, m.communication.pointing_error_rad) == pytest.approx((300 * URAD, 10 * URAD))


# ------------------------------------------------------------------------------------- sensor, point-ahead, mirror
@show(
    [
        (sensor.AirySpot(1.0, 1.0).per_noise_rad / math.pi, "0.1875", "Tyler and Fried 1982: 3/16, a point"),
        (sensor.AirySpot(1.0, 1.0, 2.0).per_noise_rad / math.pi, "0.3125", "Tyler and Fried 1982: 5/16 at n = 2"),
        (1.0 / sensor.GaussianSpot(1.0, 1.0).per_noise_rad, "1.596", "checked: Gaussian spot, f SNR NEA / W"),
        (pointing.point_ahead_rad(10_650.0) / URAD, "71", "checked: 500 km sun-synchronous to GEO, urad"),
        (
            link_study.point_ahead(link.of(MISSION)).beam_half_angles,
            "3.6",
            "checked: the same in half angles of the beam",
        ),
    ]
)
def test_sensor_and_point_ahead_have_their_published_numbers(value, text):
    assert printed(value, text)


@pytest.mark.parametrize("source_rad", [0.0, 20 * URAD, 200 * URAD])
def test_the_noise_equivalent_angles_scale_as_their_formulas(source_rad):
    # Tyler and Fried 1982: pi sqrt((3/16)^2 + (n/8)^2) (lambda/D) / SNRv; Gaussian spot: W / (1.596 f SNR)
    n = source_rad / (WAVE_M / LEO_M)
    wanted = math.pi * math.sqrt((3 / 16) ** 2 + (n / 8) ** 2) * WAVE_M / LEO_M / 50
    assert sensor.noise_equivalent_angle_rad(sensor.AirySpot(WAVE_M, LEO_M, source_rad), 50.0) == pytest.approx(wanted)
    gaussian = sensor.noise_equivalent_angle_rad(sensor.GaussianSpot(40e-6, 0.5), 50.0)
    assert gaussian == pytest.approx(40e-6 / (1.596 * 0.5 * 50), rel=2e-4)


def test_point_ahead_is_twice_the_velocity_over_that_of_light():
    assert pointing.point_ahead_rad(7_600.0) == pytest.approx(2 * 7_600.0 / 299_792_458.0, rel=1e-14)


@pytest.mark.parametrize("magnification", [1.0, 4.0, 20.0])
def test_the_line_of_sight_turns_by_twice_the_tilt_over_the_magnification(magnification):
    # checked: per axis, at normal incidence
    tilt = line_of_sight_matrix(Geometry("mechanical", magnification=magnification))
    beam = line_of_sight_matrix(Geometry("optical", magnification=magnification))
    assert_allclose(tilt, 2 / magnification * np.eye(2), atol=1e-15)
    assert_allclose(beam, np.eye(2) / magnification, atol=1e-15)
