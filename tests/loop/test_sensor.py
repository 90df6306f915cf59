"""Sensors: noise from received power against published formulas, diffraction integrals and counted electrons."""

import math
import re

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j1

from microrad.core.budget import root_sum_square
from microrad.core.units import parse_quantity
from microrad.loop import sensor
from microrad.loop.sensor import AirySpot, GaussianSpot, OpticalSensor, QuadCell, StrainGauge, optical_sensor

electron_c = 1.602176634e-19
CELL = QuadCell(
    responsivity_a_w=1.0, background_power_w=2e-10, dark_current_a=1e-9, thermal_noise_a_sqrt_hz=1e-13
)  # InGaAs, 1.55 µm
PAPER_SPOT = AirySpot(wavelength_m=1.55e-6, aperture_m=0.05)


def built(**changes):
    usual = {
        "noise_rad": 1e-6,
        "field_of_view_rad": 1e-3,
        "rate_hz": 5e3,
        "delay_s": 200e-6,
        "control_rate_hz": 5e3,
        "plant_step_s": 20e-6,
    }
    return optical_sensor(**(usual | changes))


# ------------------------------------------------------------------------------------------------------ timing
def test_a_sensor_at_the_control_rate_with_one_sample_of_delay():
    assert built() == OpticalSensor(1e-6, 1e-3, 0.0, every=1, delay_steps=10)


def test_a_slower_sensor_is_counted_in_control_samples_and_its_delay_in_plant_steps():
    slow = built(rate_hz=1e3, delay_s=0.5e-3, resolution_rad=0.1e-6)
    assert (slow.every, slow.delay_steps, slow.resolution_rad) == (5, 25, 0.1e-6)
    assert built(delay_s=0.0).delay_steps == 0
    assert built(rate_hz=5e3 / 3).every == 3  # 1666.666... Hz, to the last bit or nearly


@pytest.mark.parametrize(
    ("rate_hz", "nearest_hz"), [(3e3, 2.5e3), (4.9e3, 5e3), (1.6e3, 5e3 / 3), (3.45e3, 2.5e3), (1.0e3 + 0.1, 1e3)]
)
def test_a_rate_between_the_control_samples_is_refused_with_the_nearest_that_would_do(rate_hz, nearest_hz):
    with pytest.raises(
        ValueError, match=r"^optical sensor: its sample rate of .* does not divide the control rate of 5 kHz"
    ) as refusal:
        built(rate_hz=rate_hz)
    shown = re.search(r"the nearest rate that would do is (.*)$", str(refusal.value))[1]
    offered = parse_quantity(shown, "Hz")
    assert offered == pytest.approx(nearest_hz, rel=1e-9)
    assert built(rate_hz=offered).every == round(5e3 / nearest_hz)  # what is offered is taken


def test_a_sensor_faster_than_the_controller_is_refused():
    with pytest.raises(
        ValueError, match=r"sample rate of 10 kHz is above the control rate of 5 kHz.* would do is 5 kHz, or raise"
    ):
        built(rate_hz=10e3)


@pytest.mark.parametrize(("delay_s", "nearest_s"), [(205e-6, 200e-6), (211e-6, 220e-6), (1e-6, 0.0)])
def test_a_delay_inside_a_plant_step_is_refused_with_the_nearest_that_would_do(delay_s, nearest_s):
    with pytest.raises(
        ValueError, match=r"^optical sensor: its delay of .* is no whole number of plant steps of 20 µs"
    ) as refusal:
        built(delay_s=delay_s)
    shown = re.search(r"the nearest delay that would do is (.*?), or choose", str(refusal.value))[1]
    offered = parse_quantity(shown, "s")
    assert offered == pytest.approx(nearest_s, rel=1e-9)
    assert built(delay_s=offered).delay_steps == round(nearest_s / 20e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise_rad": math.nan}, "noise_rad is nan; give a finite number of at least 0"),
        ({"noise_rad": -1e-6}, r"noise_rad is -1 µrad; give .*0 rad switches the noise off"),
        ({"noise_rad": math.inf}, "noise_rad is inf"),
        (
            {"field_of_view_rad": 0.0},
            "field_of_view_rad is 0 rad, so it never sees the spot; give the radial half angle",
        ),
        ({"field_of_view_rad": math.nan}, "field_of_view_rad is nan"),
        ({"field_of_view_rad": -1e-3}, "field_of_view_rad is -1 mrad"),
        ({"resolution_rad": -1e-9}, "resolution_rad is -1 nrad"),
        ({"rate_hz": 0.0}, "sample rate is 0 Hz; give a finite number above 0 Hz"),
        ({"rate_hz": math.nan}, "sample rate is nan"),
        ({"rate_hz": 1e-320}, r"sample rate is .*Hz; give a finite number above 0 Hz, from 1e-30 to 1e\+30"),
        ({"delay_s": 1e308}, r"delay is .*; give a finite number of at least 0 and at most 1e\+30 \("),
        ({"delay_s": -1e-4}, "delay is -100 µs; give a finite number of at least 0"),
        ({"delay_s": math.nan}, "delay is nan"),
        ({"control_rate_hz": math.inf}, "control rate is inf"),
        ({"plant_step_s": 0.0}, "plant step is 0 s"),
    ],
)
def test_what_is_no_optical_sensor_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        built(**changes)


def test_a_sensor_that_never_loses_the_spot_and_one_without_noise_are_allowed():
    ideal = built(noise_rad=0.0, field_of_view_rad=math.inf)
    assert (ideal.noise_rad, ideal.field_of_view_rad) == (0.0, math.inf)


@pytest.mark.parametrize(
    ("every", "delay", "message"),
    [
        (0, 1, "every is 0; give a whole number of at least 1: control samples"),
        (2.0, 1, "every is 2.0; give a whole number"),
        (True, 1, "every is True"),
        (1, -1, "delay_steps is -1; give a whole number of at least 0: plant steps"),
    ],
)
def test_a_sensor_is_timed_in_whole_numbers(every, delay, message):
    with pytest.raises(ValueError, match=message):
        OpticalSensor(1e-6, 1e-3, 0.0, every, delay)


def test_a_strain_gauge_refuses_noise_and_counts_without_meaning():
    assert StrainGauge(0.0, 0.0).noise_rad == 0.0
    with pytest.raises(ValueError, match="strain gauge: noise_rad is nan; give a finite number of at least 0"):
        StrainGauge(math.nan, 0.0)
    with pytest.raises(ValueError, match="strain gauge: resolution_rad is -27 nrad"):
        StrainGauge(0.0, -27e-9)


# ------------------------------------------------------------------------------------- signal-to-noise ratio
def test_the_signal_to_noise_ratio_by_hand():
    # 1 nW on 1 A/W is 1 nA; in 2.5 kHz, in units of 1e-27 A2: 2 x 1.602176634e-19 C x 2500 Hz = 8.01088317e-16 A per A
    shot = 8.01088317e-16 * (1e-9 + 0.2e-9 + 4 * 1e-9)  # signal, background, four cells' dark current
    thermal = 4 * (1e-13) ** 2 * 2500.0
    assert shot == pytest.approx(4.16566e-24, rel=1e-5, abs=0.0)
    assert thermal == pytest.approx(1e-22, rel=1e-12, abs=0.0)
    assert CELL.signal_to_noise(1e-9, 2500.0) == pytest.approx(1e-9 / math.sqrt(shot + thermal), rel=1e-12)
    assert CELL.signal_to_noise(1e-9, 2500.0) == pytest.approx(97.98, abs=0.005)


def test_the_noise_lines_add_in_squares_and_say_what_they_are():
    lines = {line.name: line for line in CELL.noise_lines(1e-9, 2500.0, source="data sheet")}
    assert list(lines) == ["Signal shot noise", "Background shot noise", "Dark-current shot noise", "Thermal noise"]
    assert lines["Signal shot noise"].value == pytest.approx(math.sqrt(8.01088317e-25), rel=1e-9, abs=0.0)
    assert lines["Background shot noise"].value == pytest.approx(math.sqrt(0.2 * 8.01088317e-25), rel=1e-9, abs=0.0)
    assert lines["Dark-current shot noise"].value == pytest.approx(2 * math.sqrt(8.01088317e-25), rel=1e-9, abs=0.0)
    assert lines["Thermal noise"].value == pytest.approx(1e-11, rel=1e-12, abs=0.0)
    assert root_sum_square(lines.values()) == pytest.approx(
        1e-9 / CELL.signal_to_noise(1e-9, 2500.0), rel=1e-12, abs=0.0
    )
    assert all(line.unit == "A" and line.source == "data sheet" and "2.5 kHz" in line.basis for line in lines.values())


def test_strong_light_follows_the_root_of_the_power_and_weak_light_the_power():
    ratio = CELL.signal_to_noise
    assert ratio(4e-3, 2500.0) / ratio(1e-3, 2500.0) == pytest.approx(2.0, rel=1e-4)
    assert ratio(4e-14, 2500.0) / ratio(1e-14, 2500.0) == pytest.approx(4.0, rel=1e-4)
    assert ratio(0.0, 2500.0) == 0.0
    assert QuadCell(1.0, 0.0, 0.0, 0.0).signal_to_noise(0.0, 1.0) == 0.0


def test_half_the_sample_rate_is_the_bandwidth_of_an_integrating_detector():
    period = 1.0 / 5e3
    lobes = [quad(lambda f: np.sinc(f * period) ** 2, k / period, (k + 1) / period)[0] for k in range(2000)]
    assert sensor.noise_bandwidth_hz(5e3) == pytest.approx(math.fsum(lobes), rel=1e-4)
    # of N counted electrons the ratio is sqrt(N): 1 nA for 200 µs
    counted = 1e-9 * period / electron_c
    shot_only = QuadCell(1.0, 0.0, 0.0, 0.0)
    assert shot_only.signal_to_noise(1e-9, sensor.noise_bandwidth_hz(5e3)) == pytest.approx(
        math.sqrt(counted), rel=1e-9
    )
    with pytest.raises(ValueError, match="sample rate is 0 Hz"):
        sensor.noise_bandwidth_hz(0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"responsivity_a_w": 0.0}, "quad cell: responsivity_a_w is 0 A/W; give a finite number above 0"),
        ({"background_power_w": -1e-9}, "background_power_w is -1 nW"),
        ({"dark_current_a": math.nan}, "dark_current_a is nan"),
        ({"thermal_noise_a_sqrt_hz": -1.0}, "thermal_noise_a_sqrt_hz is -1"),
    ],
)
def test_what_is_no_quad_cell_is_refused(changes, message):
    usual = {
        "responsivity_a_w": 1.0,
        "background_power_w": 0.0,
        "dark_current_a": 0.0,
        "thermal_noise_a_sqrt_hz": 1e-13,
    }
    with pytest.raises(ValueError, match=message):
        QuadCell(**(usual | changes))


def test_negative_power_and_no_bandwidth_are_refused():
    with pytest.raises(ValueError, match="received power is -1 nW; give a finite number of at least 0"):
        CELL.signal_to_noise(-1e-9, 2500.0)
    with pytest.raises(ValueError, match="noise bandwidth is nan; give a finite number above 0 Hz"):
        CELL.signal_to_noise(1e-9, math.nan)


# ------------------------------------------------------------------------------------ noise-equivalent angle
def diffraction_slope(n):
    """Change of (right - left)/sum per (lambda/D): four times the integral of the transfer function of lens and source.

    Independent of the closed form: the line spread at the centre is the integral of the transfer function, and the
    difference of the halves moves by twice that.
    """

    def transfer(u):
        lens = 2 / math.pi * (math.acos(u) - u * math.sqrt(1 - u * u))
        return lens * (2 * j1(math.pi * n * u) / (math.pi * n * u) if n * u > 0 else 1.0)

    return 4.0 * quad(transfer, 0.0, 1.0, limit=400)[0]


def test_a_point_source_on_the_papers_aperture_by_hand_and_by_diffraction():
    # 3 pi / 16 x 1.55 µm / 5 cm = 0.589049 x 31 µrad, at a ratio of 10
    angle = sensor.noise_equivalent_angle_rad(PAPER_SPOT, 10.0)
    assert angle == pytest.approx(1.826051e-6, rel=1e-6)
    assert angle == pytest.approx(31e-6 / 10.0 / diffraction_slope(0.0), rel=1e-9)


def test_a_source_of_n_diffraction_angles_by_hand_and_within_the_stated_share_of_the_integral():
    # n = 2: pi sqrt(0.1875^2 + 0.25^2) = 0.981748 times 31 µrad
    two = AirySpot(1.55e-6, 0.05, source_angle_rad=62e-6)
    assert sensor.noise_equivalent_angle_rad(two, 1.0) == pytest.approx(30.43418e-6, rel=1e-6)
    errors = [
        AirySpot(1.0, 1.0, n).per_noise_rad * diffraction_slope(n) - 1.0 for n in (0.25, 0.5, 1, 1.5, 2, 3, 4.8, 6, 9)
    ]
    assert max(np.abs(errors)) < 0.042
    assert max(np.abs(errors)) > 0.041  # the formula is no closer than it says


def test_a_large_source_is_its_own_disc():
    # a uniform disc of diameter theta has a line spread of 4/(pi theta) at its centre: NEA = pi theta / 8
    assert AirySpot(1.55e-6, 0.05, 0.01).per_noise_rad == pytest.approx(math.pi * 0.01 / 8, rel=1e-4)


def test_a_gaussian_spot_by_the_published_number_and_by_counted_electrons():
    spot = GaussianSpot(radius_m=50e-6, focal_length_m=0.5)
    published = 50e-6 / (1.596 * 0.5 * 100.0)
    assert sensor.noise_equivalent_angle_rad(spot, 100.0) == pytest.approx(published, rel=2e-4)
    assert published == pytest.approx(0.6266e-6, rel=1e-4)

    # shot noise alone: 10 000 electrons on average, each landing on the side where the error function says
    rng = np.random.Generator(np.random.Philox(4))
    offset_m, sigma_m = 1e-6, 50e-6 / 2.0  # of a 1/e2 radius W the standard deviation is W/2
    share = 0.5 * (1 + math.erf(offset_m / sigma_m / math.sqrt(2.0)))
    right, left = rng.poisson(1e4 * share, 100_000), rng.poisson(1e4 * (1 - share), 100_000)
    angle = (right - left) / (right + left) * spot.per_noise_rad
    assert np.std(angle) == pytest.approx(sensor.noise_equivalent_angle_rad(spot, 100.0), rel=0.01)
    assert np.mean(angle) == pytest.approx(offset_m / 0.5, rel=5e-3)  # the slope is that of the cell's answer


def test_the_angle_scales_with_the_root_of_the_sample_rate():
    slow, fast = (
        sensor.noise_equivalent_angle_line(CELL, PAPER_SPOT, 1e-9, rate, "assumption: cell") for rate in (5e3, 20e3)
    )
    assert fast.value / slow.value == pytest.approx(2.0, rel=1e-12)
    # 0.589049 x 31 µrad over the ratio by hand above
    assert slow.value == pytest.approx(18.26051e-6 / 97.98, rel=1e-4)
    assert (slow.unit, slow.source) == ("rad", "assumption: cell")
    assert "SNRv = 97.98 at 1 nW, B = 2.5 kHz (half the sample rate)" in slow.basis
    assert "D = 50 mm" in slow.basis
    assert "no gaps" in slow.regime
    gaussian = sensor.noise_equivalent_angle_line(CELL, GaussianSpot(50e-6, 0.5), 1e-9, 5e3)
    assert "W / (1.596 f SNRv), W = 50 µm at 1/e2, f = 500 mm" in gaussian.basis


@pytest.mark.parametrize("ratio", [0.0, -1.0, math.nan])
def test_there_is_no_angle_without_light(ratio):
    with pytest.raises(ValueError, match="without light has no angle; give a received power above 0 W"):
        sensor.noise_equivalent_angle_rad(PAPER_SPOT, ratio)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (AirySpot, (0.0, 0.05), "spot: wavelength_m is 0 m; give a finite number above 0 m"),
        (AirySpot, (1.55e-6, math.nan), "spot: aperture_m is nan"),
        (AirySpot, (1.55e-6, 0.05, -1e-6), "spot: source_angle_rad is -1 µrad"),
        (GaussianSpot, (0.0, 1.0), "spot: radius_m is 0 m"),
        (GaussianSpot, (50e-6, -1.0), "spot: focal_length_m is -1 m"),
    ],
)
def test_what_is_no_spot_is_refused(kind, values, message):
    with pytest.raises(ValueError, match=message):
        kind(*values)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: OpticalSensor(-0.25e-6, 1e-3, 0.0, 1, 2),
            ValueError,
            (
                "optical sensor: noise_rad is -250 nrad; give a finite number of at least 0 (0 rad "
                "switches the noise off)"
            ),
        ),
        (
            lambda: OpticalSensor(0.25e-6, 0.0, 0.0, 1, 2),
            ValueError,
            (
                "optical sensor: field_of_view_rad is 0 rad, so it never sees the spot; give the radial "
                "half angle beyond which the spot is lost, above 0 rad (inf: never lost)"
            ),
        ),
        (
            lambda: OpticalSensor(0.25e-6, 1e-3, math.inf, 1, 2),
            ValueError,
            ("optical sensor: resolution_rad is inf; give a finite number of at least 0 (0 rad is an ideal converter)"),
        ),
        (
            lambda: OpticalSensor(0.25e-6, 1e-3, 0.0, 0, 2),
            ValueError,
            (
                "optical sensor: every is 0; give a whole number of at least 1: control samples from one "
                "sensor sample to the next"
            ),
        ),
        (
            lambda: OpticalSensor(0.25e-6, 1e-3, 0.0, 1, True),
            ValueError,
            (
                "optical sensor: delay_steps is True; give a whole number of at least 0: plant steps from "
                "exposure to delivery"
            ),
        ),
        (
            lambda: StrainGauge(0.5e-6, -1.25e-9),
            ValueError,
            (
                "strain gauge: resolution_rad is -1.25 nrad; give a finite number of at least 0 (0 rad is "
                "an ideal converter)"
            ),
        ),
        (
            lambda: built(rate_hz=7.5e3),
            ValueError,
            (
                "optical sensor: its sample rate of 7.5 kHz is above the control rate of 5 kHz: the "
                "controller would never read some of its samples; the nearest rate that would do is 5 kHz, "
                "or raise the control rate (an average of n samples has 1/sqrt(n) of the noise)"
            ),
        ),
        (
            lambda: built(rate_hz=1.7e3, control_rate_hz=6e3),
            ValueError,
            (
                "optical sensor: its sample rate of 1.7 kHz does not divide the control rate of 6 kHz "
                "(into 3.52941 parts): its samples would fall between those of the controller; the nearest "
                "rate that would do is 1.5 kHz"
            ),
        ),
        (
            lambda: built(delay_s=213e-6),
            ValueError,
            (
                "optical sensor: its delay of 213 µs is no whole number of plant steps of 20 µs: it would "
                "end inside a step; the nearest delay that would do is 220 µs, or choose a plant step that "
                "divides it"
            ),
        ),
        (lambda: built(plant_step_s=-2e-6), ValueError, "plant step is -2 µs; give a finite number above 0 s"),
        (
            lambda: QuadCell(0.9, -2e-10, 1e-9, 1e-13),
            ValueError,
            ("quad cell: background_power_w is -200 pW; give a finite number of at least 0 (0 W is a dark sky)"),
        ),
        (
            lambda: QuadCell(0.0, 2e-10, 1e-9, 1e-13),
            ValueError,
            "quad cell: responsivity_a_w is 0 A/W; give a finite number above 0 A/W",
        ),
        (
            lambda: QuadCell(0.9, 2e-10, 1e-9, math.nan),
            ValueError,
            (
                "quad cell: thermal_noise_a_sqrt_hz is nan; give a finite number of at least 0 (0 leaves "
                "shot noise alone)"
            ),
        ),
        (
            lambda: CELL.noise_lines(-3e-9, 2e3),
            ValueError,
            ("quad cell: received power is -3 nW; give a finite number of at least 0 (0 W is no light at all)"),
        ),
        (
            lambda: AirySpot(1.55e-6, 0.05, -3e-6),
            ValueError,
            ("spot: source_angle_rad is -3 µrad; give a finite number of at least 0 (0 rad is a point source)"),
        ),
        (lambda: GaussianSpot(3e-3, 0.0), ValueError, "spot: focal_length_m is 0 m; give a finite number above 0 m"),
        (
            lambda: sensor.noise_equivalent_angle_rad(PAPER_SPOT, -2.5),
            ValueError,
            (
                "noise-equivalent angle: the signal-to-noise ratio is -2.5, and a quad cell without light "
                "has no angle; give a received power above 0 W"
            ),
        ),
    ],
)
def test_a_refusal_of_a_sensor_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


UNLIKE = QuadCell(
    responsivity_a_w=0.87, background_power_w=3.1e-10, dark_current_a=1.7e-9, thermal_noise_a_sqrt_hz=0.6e-13
)
WIDE = AirySpot(wavelength_m=1.48e-6, aperture_m=0.061, source_angle_rad=9e-6)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [line.value for line in UNLIKE.noise_lines(2.3e-9, 1700.0)],
     [1.04404255e-12, 3.83296743e-13, 1.92463825e-12, 4.94772675e-12]),
    (lambda: [UNLIKE.signal_to_noise(2.3e-9, 1700.0), UNLIKE.signal_to_noise(0.0, 1700.0),
            WIDE.per_noise_rad, GaussianSpot(2.1e-5, 0.37).per_noise_rad],
     [368.907167, 0.0, 1.47221973e-05, 3.55670228e-05]),
    (lambda: [sensor.noise_equivalent_angle_line(UNLIKE, WIDE, 2.3e-9, 3100.0).value,
            sensor.noise_equivalent_angle_rad(WIDE, 7.5), sensor.noise_bandwidth_hz(3100.0)],
     [3.81063129e-08, 1.96295964e-06, 1550.0]),
])  # fmt: skip
def test_light_on_a_cell_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [line.basis for line in UNLIKE.noise_lines(2.3e-9, 1700.0)],
            [
                "sqrt(2 q I B), I = responsivity x received power = 2.001 nA, B = 1.7 kHz",
                "sqrt(2 q I B), I = responsivity x background = 269.7 pA, B = 1.7 kHz",
                "sqrt(2 q I B), I = dark current of four cells = 6.8 nA, B = 1.7 kHz",
                "sqrt(4 B) x density of one amplifier, B = 1.7 kHz",
            ],
        ),
        (
            lambda: [line.name for line in UNLIKE.noise_lines(2.3e-9, 1700.0)],
            ["Signal shot noise", "Background shot noise", "Dark-current shot noise", "Thermal noise"],
        ),
        (
            lambda: sensor.noise_equivalent_angle_line(UNLIKE, WIDE, 2.3e-9, 3100.0).basis,
            (
                "pi sqrt((3/16)^2 + (n/8)^2) (lambda/D) / SNRv, n = source angle / (lambda/D), lambda = "
                "1.48 µm, D = 61 mm, source angle = 9 µrad (Tyler and Fried 1982); SNRv = 386.3 at 2.3 nW, "
                "B = 1.55 kHz (half the sample rate)"
            ),
        ),
        (
            lambda: (
                sensor.noise_equivalent_angle_line(
                    UNLIKE, GaussianSpot(2.1e-5, 0.37), 2.3e-9, 3100.0, "a data sheet"
                ).basis
            ),
            (
                "W / (1.596 f SNRv), W = 21 µm at 1/e2, f = 370 mm; SNRv = 386.3 at 2.3 nW, B = 1.55 kHz "
                "(half the sample rate)"
            ),
        ),
    ],
)
def test_the_words_of_light_on_a_cell_say_each_of_its_numbers(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sensor.noise_bandwidth_hz(1e-31), "optical sensor: sample rate is 1e-28 mHz; give a finite "),
        (lambda: built(rate_hz=math.inf), "optical sensor: sample rate is inf; give a finite number above 0 Hz"),
        (lambda: built(rate_hz=math.nan), "optical sensor: sample rate is nan; give a finite number above 0 Hz"),
        (lambda: built(control_rate_hz=-math.inf), "control rate is -inf; give a finite number above 0 Hz"),
        (lambda: built(plant_step_s=0.0), "plant step is 0 s; give a finite number above 0 s"),
        (lambda: StrainGauge(math.inf, 0.0), "strain gauge: noise_rad is inf; give a finite number of at least 0 (0 "
         "rad switches the noise off)"),
        (lambda: built(delay_s=-20e-6), "optical sensor: delay is -20 µs; give a finite number of at least 0 (it runs "
         "from the middle of the exposure to the delivery)"),
        (lambda: built(delay_s=9e-6), "optical sensor: its delay of 9 µs is no whole number of plant steps of 20 µs: "
         "it would end inside a step; the nearest delay that would do is 0 s, or choose a plant step that divides it"),
        (lambda: built(rate_hz=622.08), "optical sensor: its sample rate of 622.08 Hz does not divide the control "
         "rate of 5 kHz (into 8.03755 parts): its samples would fall between those of the controller; the nearest rate "
         "that would do is 625 Hz"),
        (lambda: built(rate_hz=4.9e3), "optical sensor: its sample rate of 4.9 kHz does not divide the control rate of "
         "5 kHz (into 1.02041 parts): its samples would fall between those of the controller; the nearest rate that "
         "would do is 5 kHz"),
        (lambda: QuadCell(0.9, 0.0, math.inf, 0.0), "quad cell: dark_current_a is inf; give a finite number of at "
         "least 0 (0 A is an ideal cell)"),
        (lambda: CELL.noise_lines(1e-9, 0.0), "quad cell: noise bandwidth is 0 Hz; give a finite number above 0 Hz"),
        (lambda: AirySpot(0.0, 0.05), "spot: wavelength_m is 0 m; give a finite number above 0 m"),
        (lambda: AirySpot(1e-6, -0.05), "spot: aperture_m is -50 mm; give a finite number above 0 m"),
        (lambda: GaussianSpot(-1e-5, 0.1), "spot: radius_m is -10 µm; give a finite number above 0 m"),
        (lambda: OpticalSensor(0.0, -math.inf, 0.0, 1, 0), "optical sensor: field_of_view_rad is -inf, so it never "),
        (lambda: OpticalSensor(0.0, 1.0, 0.0, 2.0, 0), "optical sensor: every is 2.0; give a whole number of at "),
        (lambda: OpticalSensor(0.0, 1.0, 0.0, 1, -1), "optical sensor: delay_steps is -1; give a whole number of at "),
        (lambda: OpticalSensor(0.0, 1.0, 2e30, 1, 0), "optical sensor: resolution_rad is "),
    ],
)  # fmt: skip
def test_what_a_sensor_refuses_is_shown_as_it_was_given_with_what_would_do(call, words):
    with pytest.raises(ValueError) as refused:
        call()
    said = str(refused.value)
    assert said.startswith(words)
    within = said.endswith((", from 1e-30 to 1e+30", "at least 0 and at most 1e+30 (0 rad is an ideal converter)"))
    assert within == ("1e-28 mHz" in words or words.endswith("resolution_rad is "))


@pytest.mark.parametrize(
    ("rate_hz", "delay_s", "every", "steps"),
    [(5e3 * (1 + 9e-10), 200e-6, 1, 10), (5e3 / 7 * (1 - 9e-10), 0.0, 7, 0), (625.0, 20e-6 * (1 + 9e-10), 8, 1),
     (5e-3, 1.0, 1_000_000, 50_000)],
)  # fmt: skip
def test_rates_and_delays_within_rounding_of_whole_numbers_are_those(rate_hz, delay_s, every, steps):
    found = built(rate_hz=rate_hz, delay_s=delay_s, resolution_rad=3e-9)
    assert found == OpticalSensor(1e-6, 1e-3, 3e-9, every, steps)
    assert built().resolution_rad == 0.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: built(rate_hz=5000.00005), "optical sensor: its sample rate of 5.00000005 kHz is above the control "
         "rate of 5 kHz: the controller would never read some of its samples; the nearest rate that would do is 5 "
         "kHz, or raise the control rate (an average of n samples has 1/sqrt(n) of the noise)"),
        (lambda: built(rate_hz=2500.0005), "optical sensor: its sample rate of 2.5000005 kHz does not divide the "
         "control rate of 5 kHz (into 2 parts): its samples would fall between those of the controller; the nearest "
         "rate that would do is 2.5 kHz"),
        (lambda: built(delay_s=200.00002e-6), "optical sensor: its delay of 200.00002 µs is no whole number of plant "
         "steps of 20 µs: it would end inside a step; the nearest delay that would do is 200 µs, or choose a plant "
         "step that divides it"),
        (lambda: QuadCell(0.9, 0.0, -2.5e-9, 0.0), "quad cell: dark_current_a is -2.5 nA; give a finite number of at "
         "least 0 (0 A is an ideal cell)"),
        (lambda: QuadCell(0.9, 0.0, 0.0, -1e-13), "quad cell: thermal_noise_a_sqrt_hz is -0.1 pA/sqrt(Hz); give a "
         "finite number of at least 0 (0 leaves shot noise alone)"),
    ],
)  # fmt: skip
def test_a_rate_or_a_delay_that_is_hardly_off_is_refused_with_its_digits_and_a_current_with_its_unit(call, words):
    with pytest.raises(ValueError) as refused:
        call()
    assert str(refused.value) == words
