"""Links and searches by numbers alone: beside power densities by hand and drawn targets."""

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.link import gains
from microrad.link.acquisition.detection import simulate_scan
from microrad.link.acquisition.scan import Detector, Search, Spiral, highest_speed
from microrad.link.by_numbers import LEAST, MOST, received_power, scan_times


def test_received_power_is_power_density_times_area():
    power = received_power(1.0, 8e-6, 45e6, 0.25, 1064e-9, pointing_error_rad=3e-6, losses_db={"optics": 2.0})
    density = 2.0 / (math.pi * (8e-6 * 45e6) ** 2) * math.exp(-2 * (3 / 8) ** 2)
    watt = density * math.pi * 0.25**2 / 4 * 10**-0.2
    assert_allclose(power.received_dbm, 10 * math.log10(watt / 1e-3), rtol=1e-12)
    assert_allclose(power.margin_db(-40.0), power.received_dbm + 40.0)
    assert [line.name for line in power.lines][-1] == "optics" and power.lines[-1].value == -2.0
    assert power.warnings == ()


def test_the_far_field_begins_at_two_squares_of_the_waists_diameter_over_the_wavelength():
    begins_m = 8.0 * 1064e-9 / (math.pi * 8e-6) ** 2
    (near,) = received_power(1.0, 8e-6, 0.99 * begins_m, 0.25, 1064e-9).warnings
    assert near == "Transmit gain: the far field of this beam begins at 13.48 km"
    assert received_power(1.0, 8e-6, 1.01 * begins_m, 0.25, 1064e-9).warnings == ()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"power_w": 0.0}, "the power"),
        ({"half_angle_rad": -1e-6}, "the half angle"),
        ({"distance_m": math.inf}, "the distance"),
        ({"aperture_m": 0.0}, "the receiving aperture"),
        ({"wavelength_m": math.nan}, "the wavelength"),
        ({"pointing_error_rad": -1e-6}, "the pointing error"),
        ({"losses_db": {"optics": -2.0}}, "the loss 'optics'.*a loss is positive"),
    ],
)
def test_numbers_without_meaning_are_refused(changes, said):
    given = {"power_w": 1.0, "half_angle_rad": 8e-6, "distance_m": 45e6, "aperture_m": 0.25, "wavelength_m": 1064e-9}
    with pytest.raises(ValueError, match=said):
        received_power(**given | changes)


def test_times_of_a_scan_are_those_of_drawn_targets():
    times = scan_times(100e-6, 20e-6, 5e-3, detection_probability=0.9, jitter_rms_rad=2e-6)
    search = Search(100e-6, 20e-6, 0.2, 0.99)
    scan = Spiral(search, Detector(5e-3, 0.9), 0.9 * highest_speed(search, 5e-3))
    still = scan_times(100e-6, 20e-6, 5e-3)
    drawn = simulate_scan(Spiral(search, Detector(5e-3), scan.speed_rad_s), 4000, seed=1)
    share = float(np.mean(drawn.detected))
    assert abs(share - still.probability) < 4.5 * math.sqrt(share * (1 - share) / 4000) + 2e-3
    assert_allclose(np.mean(drawn.time_s[drawn.detected]), still.mean_s, rtol=0.08)
    assert times.probability < still.probability
    with pytest.raises(ValueError, match=r"the overlap.*never lit long enough"):
        scan_times(100e-6, 20e-6, 5e-3, overlap=0.0)


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"half_angle_rad": 1e-320}, "the half angle"),
        ({"half_angle_rad": 1e308}, "the half angle"),
        ({"wavelength_m": 1e300}, "the wavelength"),
        ({"pointing_error_rad": 1e154}, "the pointing error"),
        ({"losses_db": {"optics": 1e308}}, "the loss 'optics'"),
    ],
)
def test_sizes_that_no_beam_has_are_refused(changed, name):
    """They divided by zero, or overflowed."""
    beam = {"power_w": 1.0, "half_angle_rad": 8e-6, "distance_m": 45e6, "aperture_m": 0.25, "wavelength_m": 1064e-9}
    with pytest.raises(ValueError, match=f"{name} is .*: nothing is below 1e-30 or above 1e\\+30 in SI units"):
        received_power(**{**beam, **changed})


@pytest.mark.parametrize("changed", [{"jitter_rms_rad": 1000.0}, {"overlap": 1.0 - 1e-9}])
def test_a_scan_that_would_fill_the_memory_is_refused(changed):
    scan = {"sigma_rad": 100e-6, "beam_radius_rad": 20e-6, "detection_time_s": 5e-3}
    with pytest.raises(ValueError, match=r"a target is within reach of .* tracks"):
        scan_times(**{**scan, **changed})


GIVEN = {"power_w": 1.0, "half_angle_rad": 8e-6, "distance_m": 45e6, "aperture_m": 0.25, "wavelength_m": 1064e-9}


def test_the_far_field_holds_from_where_it_begins():
    waist_m = GIVEN["wavelength_m"] / (math.pi * GIVEN["half_angle_rad"])
    begins_m = gains.far_field_m(2.0 * waist_m, GIVEN["wavelength_m"])
    assert received_power(**GIVEN | {"distance_m": begins_m}).warnings == ()
    assert len(received_power(**GIVEN | {"distance_m": math.nextafter(begins_m, 0.0)}).warnings) == 1


@pytest.mark.parametrize("losses", [None, {}])
def test_without_further_losses_there_are_five_lines(losses):
    found = received_power(**GIVEN, losses_db=losses)
    names = ["Power", "Transmit gain", "Pointing loss", "Free space", "Receive gain"]
    assert [line.name for line in found.lines] == names
    assert found.received_dbm == pytest.approx(math.fsum(line.value for line in found.lines))


@pytest.mark.parametrize("size", [LEAST, MOST])
def test_numbers_are_taken_from_the_least_to_the_most_that_a_quantity_has(size):
    assert received_power(**GIVEN | {"power_w": size}).lines[0].value == pytest.approx(10 * math.log10(size * 1e3))
    beyond = size / 2.0 if size == LEAST else size * 2.0
    with pytest.raises(
        ValueError, match=re.escape(f"the power is {beyond:g} W: nothing is below {LEAST:g} or above {MOST:g}")
    ):
        received_power(**GIVEN | {"power_w": beyond})


def lines_of(*given, **more):
    return [
        f"{x.name} {x.value:.4f} {x.unit}: {x.basis} | {x.source} | {x.regime} | {x.warning}"
        for x in received_power(*given, **more).lines
    ]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: lines_of(
                2.3, 17e-6, 3.7e7, 0.23, 1.31e-6, pointing_error_rad=5e-6, losses_db={"optics": 1.25, "Strehl": 0.5}
            ),
            [
                "Power 33.6173 dBm: 10 log10(P / 1 mW) | given |  | ",
                "Transmit gain 104.4219 dB: G = 8 / theta^2 | theta = 17 µrad at 1/e2 | far field | ",
                ("Pointing loss -0.7514 dB: exp(-2 (error / theta)^2) | given | Gaussian beam, static error | "),
                "Free space -291.0028 dB: (lambda / (4 pi d))^2 | given | far field | ",
                "Receive gain 114.8321 dB: (pi D / lambda)^2 | given | on axis, uniformly filled | ",
                "optics -1.2500 dB: given | given |  | ",
                "Strehl -0.5000 dB: given | given |  | ",
            ],
        ),
        (
            lambda: lines_of(2.3, 17e-6, 3.1e3, 0.23, 1.31e-6)[1:3],
            [
                (
                    "Transmit gain 104.4219 dB: G = 8 / theta^2 | theta = 17 µrad at 1/e2 | far field | the "
                    "far field of this beam begins at 3.674 km"
                ),
                ("Pointing loss 0.0000 dB: exp(-2 (error / theta)^2) | given | Gaussian beam, static error | "),
            ],
        ),
    ],
)
def test_a_beam_by_numbers_has_every_line_with_its_words(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: received_power(2.3, 17e-6, -3.7e7, 0.23, 1.31e-6),
            ValueError,
            "the distance is -37000 km: it must be finite, above 0 m",
        ),
        (
            lambda: received_power(2.3, 17e-6, 3.7e7, 0.23, 1.31e-6, pointing_error_rad=-5e-6),
            ValueError,
            "the pointing error is -5 µrad: it must be finite, at least 0 rad",
        ),
        (
            lambda: received_power(2.3, 17e-6, 3.7e7, 0.23, 1.31e-6, losses_db={"optics": 1.25, "Strehl": -0.5}),
            ValueError,
            "the loss 'Strehl' is -0.5 dB: it must be finite, at least 0 dB; a loss is positive",
        ),
        (
            lambda: received_power(2.3e31, 17e-6, 3.7e7, 0.23, 1.31e-6),
            ValueError,
            "the power is 2.3e+31 W: nothing is below 1e-30 or above 1e+30 in SI units",
        ),
        (
            lambda: received_power(2.3, 17e-6, 3.7e7, 0.0, 1.31e-6),
            ValueError,
            "the receiving aperture is 0 m: it must be finite, above 0 m",
        ),
        (
            lambda: received_power(2.3, 17e-6, 3.7e7, 0.23, math.inf),
            ValueError,
            "the wavelength is inf m: it must be finite, above 0 m",
        ),
        (
            lambda: scan_times(1e-4, 2e-5, 5e-3, overlap=0.0),
            ValueError,
            (
                "the overlap is 0: it must be finite, above 0 and below 1; without overlap some targets "
                "are never lit long enough"
            ),
        ),
        (
            lambda: scan_times(1e-4, 2e-5, -5e-3),
            ValueError,
            "the detection time is -5 ms: it must be finite, above 0 s",
        ),
        (
            lambda: scan_times(1e-4, 2e-5, 5e-3, jitter_rms_rad=-1e-6),
            ValueError,
            "the jitter is -1 µrad: it must be finite, at least 0 rad",
        ),
        (
            lambda: scan_times(1e-4, 2e-5, 5e-3, coverage=1.0),
            ValueError,
            "Search.coverage is 1: it must be finite, above 0 and below 1; Gaussian errors have no edge",
        ),
        (
            lambda: scan_times(1e-4, 2e-5, 5e-3, detection_probability=1.25),
            ValueError,
            "Detector.probability is 1.25: it must be finite, above 0, at most 1",
        ),
    ],
)
def test_a_refusal_of_a_number_says_it_and_its_bounds(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [(t := scan_times(9e-5, 2.3e-5, 4e-3, coverage=0.97, overlap=0.31)).probability, t.mean_s,
            t.std_s, t.quantile(0.5)],
     [0.970458911, 0.187486704, 0.166866236, 0.144207954]),
    (lambda: [(t := scan_times(9e-5, 2.3e-5, 4e-3, coverage=0.9, overlap=0.31, detection_probability=0.7,
            jitter_rms_rad=3e-6)).probability, t.mean_s, t.quantile(0.5)],
     [0.641659612, 0.156883098, 0.256167965]),
])  # fmt: skip
def test_searches_by_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [(t := scan_times(9e-5, 2.3e-5, 4e-3)).probability, t.mean_s, t.std_s, t.quantile(0.9)],
     "0.989755716 0.210639529 0.198041576 0.513042287"),
    (lambda: [(t := scan_times(2e-6, 8e-6, 0.5, coverage=0.4)).probability, t.mean_s, t.quantile(0.2),
            t.cumulative(0.05)],
     "0.488145408 0.00625807749 0 0.476784917"),
    (lambda: [(t := scan_times(9e-5, 2.3e-5, 4e-3, overlap=0.8, detection_probability=0.3)).probability, t.mean_s],
     "0.557146485 0.511637508"),
    (lambda: [received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, losses_db={"a": 1.25, "b": 0.5}).margin_db(-50.0)],
     "-8.05088715"),
    (lambda: [x.value for x in received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, pointing_error_rad=3e-5, losses_db={"a":
            1.25}).lines],
     "24.7712125 103.0103 -19.5432517 -295.963597 111.881198 -1.25"),
    (lambda: [received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, pointing_error_rad=0.0).lines[2].value], "0"),
])  # fmt: skip
def test_beams_and_searches_by_numbers_at_their_edges(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: str(received_power(0.3, 2e-7, 4e5, 0.1, 8e-7).warnings),
     "('Transmit gain: the far field of this beam begins at 16210 km',)"),
    (lambda: str(received_power(0.3, 2e-7, 4e7, 0.1, 8e-7).warnings), "()"),
    (lambda: str(received_power(0.3, 2.5e-5, 4e7, 0.1, 8e-7, losses_db={"code": 1.25}).lines[5]),
     "Line(name='code', value=-1.25, unit='dB', basis='given', source='given', regime='', warning='')"),
    (lambda: str(received_power(1e-3, 2.5e-5, 4e7, 0.1, 8e-7).lines[1].source), "theta = 25 µrad at 1/e2"),
])  # fmt: skip
def test_what_a_beam_or_a_search_by_numbers_says_of_its_numbers(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: received_power(0.3, 2e-5, 4e7, 0.1, 0.0), "the wavelength is 0 m: it must be finite, above 0 m"),
    (lambda: received_power(0.3, 2e-5, 4e7, -0.1, 8e-7),
     "the receiving aperture is -100 mm: it must be finite, above 0 m"),
    (lambda: received_power(0.3, -2e-5, 4e7, 0.1, 8e-7), "the half angle is -20 µrad: it must be finite, above 0 rad"),
    (lambda: received_power(0.3, 2e-5, math.inf, 0.1, 8e-7), "the distance is inf m: it must be finite, above 0 m"),
    (lambda: received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, pointing_error_rad=-1e-6),
     "the pointing error is -1 µrad: it must be finite, at least 0 rad"),
    (lambda: received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, losses_db={"fibre": -1.5}),
     "the loss 'fibre' is -1.5 dB: it must be finite, at least 0 dB; a loss is positive"),
    (lambda: received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, losses_db={"fibre": 1e-31}),
     "the loss 'fibre' is 1e-31 dB: nothing is below 1e-30 or above 1e+30 in SI units"),
    (lambda: scan_times(0.0, 2e-5, 5e-3), "sigma_rad is 0 rad: it must be finite, above 0 rad"),
    (lambda: scan_times(1e-31, 2e-5, 5e-3),
     "sigma_rad is 1e-31 rad: nothing is below 1e-30 or above 1e+30 in SI units"),
    (lambda: scan_times(1e-4, 0.0, 5e-3), "the radius of the beam is 0 rad: it must be finite, above 0 rad"),
    (lambda: scan_times(1e-4, 2e-5, math.nan), "the detection time is nan s: it must be finite, above 0 s"),
    (lambda: scan_times(1e-4, 2e-5, 5e-3, overlap=0.0),
     "the overlap is 0: it must be finite, above 0 and below 1; without overlap some targets are never lit long "
     "enough"),
    (lambda: scan_times(1e-4, 2e-5, 5e-3, overlap=1.0),
     "the overlap is 1: it must be finite, above 0 and below 1; without overlap some targets are never lit long "
     "enough"),
    (lambda: scan_times(1e-4, 2e-5, 5e-3, jitter_rms_rad=1e-31),
     "the jitter is 1e-31 rad: nothing is below 1e-30 or above 1e+30 in SI units"),
    (lambda: scan_times(1e-4, 2e-5, 5e-3, detection_probability=0.0),
     "Detector.probability is 0: it must be finite, above 0, at most 1"),
    (lambda: scan_times(1e-4, 2e-5, 5e-3, coverage=-0.1),
     "Search.coverage is -0.1: it must be finite, above 0 and below 1; Gaussian errors have no edge"),
    (lambda: scan_times(1e-4, 2.0, 5e-3),
     "Search.beam_radius_rad is 2 rad: it must be finite, above 0 and below 1.571 rad; an angle from the line of "
     "sight is meant"),
])  # fmt: skip
def test_a_refusal_by_numbers_names_the_one_that_is_wrong(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


def test_no_loss_is_no_negative_zero():
    (line,) = (
        x for x in received_power(0.3, 2e-5, 4e7, 0.1, 8e-7, losses_db={"fibre": 0.0}).lines if x.name == "fibre"
    )
    assert f"{line.value:.2f}" == "0.00"
