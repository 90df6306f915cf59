"""An output that moves farther than a mirror can is refused before anything is fitted, with its file and its unit."""

import math

import numpy as np
import pytest

from microrad.lab.identify import IdentificationError, identify
from microrad.lab.identify.travel import check_travel
from microrad.lab.recording import Recording, recording_from_arrays

WAVE = 5 + 5 * np.sin(np.arange(4000) * 0.02)


def recorded(size, name="loop.csv"):
    return recording_from_arrays(WAVE, np.column_stack((0.1 * WAVE, size / 10.0 * WAVE)), 1000.0, name)


@pytest.mark.promise("recordings-25")
@pytest.mark.parametrize(
    ("per_rad", "unit", "options", "words"),
    [
        (1.0, "rad", {}, "moves by 2 rad, a tilt of 2 rad, and no mirror turns by more than 1.571 rad (a quarter"),
        (1000.0, "mrad", {}, "moves by 2000 mrad, a tilt of 2 rad"),
        (100.0, "mm", {"lever_arm_m": 0.1}, "moves by 200 mm over 100 mm, a tilt of 2 rad"),
        (10.0, "mm", {"positions_m": [(0.0, 0.0), (0.006, 0.008)]}, "moves by 20 mm over 10 mm, a tilt of 2 rad"),
    ],
)
def test_an_absurd_unit_is_told(per_rad, unit, options, words):
    most = math.pi / 2 * per_rad
    check_travel([recorded(0.999 * most)], unit, **options)
    with pytest.raises(IdentificationError):
        check_travel([recorded(1.001 * most)], unit, **options)
    with pytest.raises(IdentificationError) as caught:
        check_travel([recorded(0.01), recorded(2.0 * per_rad, "far.csv")], unit, **options)
    message = str(caught.value)
    assert message.startswith("far.csv: the output 'output 1' moves by ")
    assert words in message
    assert "--output-unit" in message
    assert ("--lever-arm" in message) == bool(options)


def test_a_quarter_turn_itself_is_taken_and_the_largest_distance_counts():
    def moved(most):
        output = np.column_stack((1e-3 * WAVE, np.where(WAVE > 5, most, 0.0)))
        return Recording("edge.csv", "", WAVE[:, None], output, 1000.0, ("u",), ("output 0", "output 1"))

    check_travel([moved(math.pi / 2)], "rad")
    with pytest.raises(IdentificationError, match=r"^edge\.csv: the output 'output 1' moves by 1\.571 rad, a tilt of "):
        check_travel([moved(math.nextafter(math.pi / 2, 2.0))], "rad")
    places = [(0.0, 0.0), (0.003, 0.004), (0.006, 0.008), (0.0, 0.001)]
    check_travel([moved(15.0)], "mm", positions_m=places)
    with pytest.raises(IdentificationError, match=r"moves by 16 mm over 10 mm, .*\(--lever-arm, --position\)\.$"):
        check_travel([moved(16.0)], "mm", positions_m=places)
    check_travel([moved(1e6)], "mm", positions_m=places[:1])
    check_travel([moved(150.0)], "mm", 0.1, places)  # the lever arm goes before
    with pytest.raises(IdentificationError, match=r"a tilt of 1\.6 rad, .*\(--output-unit, output_unit\)\.$"):
        check_travel([moved(1.6e6)], "urad")


def test_a_length_without_an_arm_and_an_unknown_unit_are_not_judged():
    check_travel([recorded(1e6)], "m")
    check_travel([recorded(1e6)], "km", 0.1)


def test_identify_refuses_an_absurd_unit_at_once():
    one = recording_from_arrays(WAVE, 0.3 * WAVE, 1000.0, "loop.csv")
    with pytest.raises(IdentificationError, match=r"loop\.csv: the output 'output' moves by 3 rad, a tilt of 3 rad"):
        identify([one], output_unit="rad")


@pytest.mark.parametrize(
    ("unit", "size", "options", "words"),
    [
        ("rad", 3.0, {}, "3 rad, a tilt of 3 rad"),
        ("urad", 2.5e6, {}, "2.5e+06 urad, a tilt of 2.5 rad"),
        ("m", 7.5, {"lever_arm_m": 3.2}, "7.5 m over 3.2 m, a tilt of 2.344 rad"),
        ("um", 123456.0, {"positions_m": [(0.0, 0.03), (0.04, 0.0)]}, "1.235e+05 um over 50 mm, a tilt of 2.469 rad"),
    ],
)
def test_a_travel_beyond_a_quarter_turn_is_told_in_full(unit, size, options, words):
    over = " or what it stands over (--lever-arm, --position)" if options else ""
    with pytest.raises(IdentificationError) as caught:
        check_travel([recorded(size)], unit, **options)
    assert str(caught.value) == (
        f"loop.csv: the output 'output 1' moves by {words}, and no mirror turns by more than 1.571 rad (a quarter "
        f"turn); correct the unit of the output (--output-unit, output_unit){over}."
    )


@pytest.mark.parametrize(
    ("unit", "size", "options", "fits"),
    [
        ("rad", 1.57, {}, True),
        ("rad", 1.58, {}, False),
        ("mrad", 1570.0, {}, True),
        ("urad", 1.58e6, {}, False),
        ("um", 31_400.0, {"lever_arm_m": 0.02}, True),
        ("um", 31_600.0, {"lever_arm_m": 0.02}, False),
        ("mm", 47.0, {"positions_m": [(0.0, 0.0), (0.018, 0.024), (0.01, 0.0)]}, True),
        ("mm", 47.4, {"positions_m": [(0.0, 0.0), (0.018, 0.024), (0.01, 0.0)]}, False),
        ("mm", 47.4, {"positions_m": [(0.0, 0.0), (0.018, 0.024)], "lever_arm_m": 0.031}, True),
        ("m", 1e6, {"positions_m": [(0.0, 0.0)]}, True),
        ("furlong", 1e6, {"lever_arm_m": 0.1}, True),
    ],
)
def test_an_output_turns_by_a_quarter_at_most_in_each_unit(unit, size, options, fits):
    moved = Recording("a", "a", WAVE[:, None], size * (WAVE[:, None] / np.ptp(WAVE)), 1.0, ("u",), ("y",))
    if fits:
        check_travel([moved], unit, **options)
    else:
        with pytest.raises(IdentificationError, match=r"^a: the output 'y' moves by "):
            check_travel([moved], unit, **options)


@pytest.mark.parametrize("fitted", [True, False])
def test_recordings_that_are_not_fitted_may_turn_no_farther_either(fitted):
    loop = recording_from_arrays(WAVE, 0.1 * WAVE, 1000.0, "loop.csv")
    far = recording_from_arrays(WAVE[1:], 0.3 * WAVE[1:], 1000.0, "far.csv")
    given = ([loop, far], [recording_from_arrays(WAVE[2:], 0.1 * WAVE[2:], 1000.0)]) if fitted else ([loop], [far])
    with pytest.raises(IdentificationError, match=r"^far\.csv: the output 'output' moves by 3 rad, a tilt of 3 rad"):
        identify(given[0], validation=given[1], output_unit="rad")


def test_an_angle_stands_over_nothing_though_a_lever_arm_is_given():
    with pytest.raises(IdentificationError) as caught:
        check_travel([recorded(0.01), recorded(2000.0, "far.csv")], "mrad", 0.05, [(0.0, 0.0), (0.1, 0.0)])
    assert str(caught.value) == (
        "far.csv: the output 'output 1' moves by 2000 mrad, a tilt of 2 rad, and no mirror turns by more than 1.571 "
        "rad (a quarter turn); correct the unit of the output (--output-unit, output_unit)."
    )
