"""Channels that are not wired as it is said of them, on a real mirror of three actuators and three sensors."""

from dataclasses import replace

import numpy as np
import pytest

from microrad.lab.identify import IdentificationError
from microrad.lab.identify.coupled import wiring
from microrad.lab.identify.coupled.wiring import check_wiring
from microrad.lab.identify.linear.response import FrequencyResponse, response_from_periods
from microrad.lab.recording import AXES, read_arrays
from microrad.mirror.coupled import Output
from places import DATA

SIGNS = ((-1, 1, -1), (1, -1, -1), (-1, -1, 1))
OUTPUTS = tuple(Output(f"y{k}", "displacement") for k in range(3))


@pytest.fixture(scope="module")
def response():
    if not DATA.is_dir():
        pytest.skip(f"real recordings are not at {DATA}")
    u, y = (DATA / "cubespec" / f"{name}_300mV_train.npy" for name in "uy")
    recordings = read_arrays(u, rate_hz=6400.0, axes=AXES, output_path=y, part_s=(1.28, None))
    return response_from_periods(recordings)


def refusal(response, signs=SIGNS, outputs=OUTPUTS):
    with pytest.raises(IdentificationError) as caught:
        check_wiring("u.npy", response, outputs, signs)
    return str(caught.value)


def changed(response, order=(0, 1, 2), turned=()):
    """The response with its outputs in another order, and some of them reversed."""
    sign = np.array([-1.0 if k in turned else 1.0 for k in range(3)])
    return replace(response, response=(response.response * sign[:, None])[:, list(order)])


def test_signs_of_the_real_mirror(response):
    check_wiring("u.npy", response, OUTPUTS, SIGNS)
    check_wiring("u.npy", response, OUTPUTS, ((0, 0, 0), (0, -1, 0), (0, 0, 1)))
    check_wiring("u.npy", response, OUTPUTS, None)


def test_what_is_wired_another_way(response):
    message = refusal(changed(response, turned=[2]))
    assert message.startswith("u.npy: at low frequency the output 'output[2]' ")
    assert (
        "and `signs` says that it does not; it would agree where the output 'output[2]' is reversed: check" in message
    )
    message = refusal(changed(response, (1, 0, 2)))
    assert (
        "where the outputs 'output[0]' and 'output[1]' are swapped or the inputs 'drive[0]' and 'drive[1]'" in message
    )
    assert "no single sensor reversed or pair of channels swapped" in refusal(changed(response, turned=[0, 1]))


def test_an_actuator_that_moves_nothing(response):
    still = response.response.copy()
    still[:, :, 1] = 0.5 * response.standard_error[:, :, 1]
    assert "u.npy: the drive 'drive[1]' moves nothing" in refusal(replace(response, response=still), None)


def test_a_few_lines_of_great_noise_hide_no_motion(response):
    noisy = response.standard_error.copy()
    noisy[5] = 1e6 * np.abs(response.response).max()
    check_wiring("u.npy", replace(response, standard_error=noisy), OUTPUTS, None)
    still = np.where(np.arange(len(noisy))[:, None, None] == 5, noisy, 0.5 * noisy)
    assert "moves nothing" in refusal(replace(response, response=still, standard_error=noisy), None)


def test_places_of_three_sensors_agree_with_anything_and_two_or_a_line_do_not_do(response):
    def placed(*places):
        return [replace(output, position_m=place) for output, place in zip(OUTPUTS, places, strict=True)]

    check_wiring("u.npy", changed(response, turned=[2]), placed((0.01, 0.0), (0.0, 0.01), (-0.01, -0.01)), None)
    message = refusal(response, outputs=placed((0.01, 0.0), (0.02, 0.0), (0.03, 0.0)))
    assert message.startswith("u.npy: the positions do not give the tilts: all displacements lie on one line")
    angles = [replace(output, quantity="angle") for output in placed((0.01, 0.0), (0.0, 0.01), (-0.01, -0.01))]
    assert "positions are those of displacements, and the outputs are angles" in refusal(response, outputs=angles)


# ------------------------------------------------------------------------------------------------ responses made up
def made(gain, error=0.01, lines=20):
    """The same real gain (outputs, drives) at every line, with one standard error."""
    gain = np.array(gain, dtype=float)
    shape = (lines, *gain.shape)
    return FrequencyResponse(
        np.arange(1.0, lines + 1.0),
        np.tile(gain.astype(complex), (lines, 1, 1)),
        np.full(shape, error),
        None,
        None,
        np.ones(shape[:2]),
        np.tile(np.eye(shape[2], dtype=complex), (lines, 1, 1)),
        np.zeros(shape[:2]),
        np.ones(shape[2]),
        (1.0, float(lines)),
        "made up",
        100.0,
        tuple(f"u{k}" for k in range(shape[2])),
        tuple(f"y{k}" for k in range(shape[1])),
    )


TWO = [Output(f"y{k}", "displacement") for k in range(2)]
GAIN = ((2.0, 1.0), (-3.0, 4.0))


@pytest.mark.parametrize(
    ("signs", "message"),
    [
        (((1, 1), (-1, 1)), ""),
        (((0, 0), (0, 0)), ""),
        (((1, 1), (0, -1)), "the output 'y1' rises with the drive 'u1', and `signs` says that it does not"),
        (((1, 1), (1, 1)), "the output 'y1' falls with the drive 'u0', and `signs` says that it does not"),
        (((-1, 0), (0, 0)), "the output 'y0' rises with the drive 'u0'"),
        (((1, 1), (1, -1)), "where the output 'y1' is reversed or the inputs 'u0' and 'u1' are swapped: check"),
        (((-1, 1), (1, 1)), "it would agree where the outputs 'y0' and 'y1' are swapped: check"),
        (((1, 1), (1, -1)), "the output 'y1' rises with the drive 'u1'"),
        (((-1, 0), (-1, 0)), "where the output 'y0' is reversed: check the wiring, or correct signs."),
        (((-1, -1), (1, -1)), "no single sensor reversed or pair of channels swapped explains it: check the wiring"),
    ],
)
def test_the_drive_and_the_output_that_contradict_a_sign_are_named(signs, message):
    if message:
        assert message in refusal(made(GAIN), signs, TWO)
    else:
        check_wiring("u.npy", made(GAIN), TWO, signs)


@pytest.mark.parametrize(("gain", "certain"), [(-0.49, False), (-0.51, True), (0.49, False)])
def test_a_sign_is_one_from_five_standard_errors_on(gain, certain):
    """Of ten lines, each with an error of sqrt(10) * 0.1."""
    response = made(((gain,),), error=0.1 * np.sqrt(10.0))
    moving = response.response.copy()
    moving[10:] = 5.0  # beyond the lowest lines: it moves, and the other way
    response = replace(response, response=moving)
    if certain:
        assert "the output 'y0' falls with the drive 'u0'" in refusal(response, ((1,),), TWO[:1])
    else:
        check_wiring("u.npy", response, TWO[:1], ((1,),))


@pytest.mark.parametrize(("times", "moves"), [(1.41, False), (1.42, True)])
@pytest.mark.parametrize("drive", [0, 1])
def test_a_drive_moves_something_from_twice_the_power_of_the_noise_on(times, moves, drive):
    """In the sum over the lines or in the middle one, and in any output."""
    gain = np.array(GAIN)
    gain[:, drive] = 0.0
    gain[1, drive] = times * 0.1
    if moves:
        check_wiring("u.npy", made(gain, error=0.1), TWO, None)
    else:
        assert f"the drive 'u{drive}' moves nothing" in refusal(made(gain, error=0.1), None, TWO)


PLACES = ((0.01, 0.0), (0.0, 0.02), (-0.03, 0.01), (0.0, -0.02), (0.02, 0.03), (-0.01, -0.02))


def placed_at(places):
    return [Output(f"y{k}", "displacement", place) for k, place in enumerate(places)]


def tilted(places, tilt=(2.0, -1.0), piston=0.5):
    """What displacements at these places show of a tilt about x, then y, and a piston; one drive."""
    return np.array([[tilt[0] * 100.0 * y - tilt[1] * 100.0 * x + piston] for x, y in places])


@pytest.mark.parametrize(
    ("turn", "message"),
    [
        (lambda g: g, ""),
        (lambda g: g * [[1], [1], [1], [-1], [1], [1]], "the output 'y3' is reversed"),
        (lambda g: g[[0, 1, 4, 3, 2, 5]], "the outputs 'y2' and 'y4' are swapped"),
        (lambda g: g * [[1], [-1], [1], [-1], [1], [1]], ""),  # bent, and no single turn explains it
    ],
)
def test_four_displacements_that_do_not_stay_flat_are_refused_with_what_explains_it(turn, message):
    response = made(turn(tilted(PLACES)))
    if message:
        told = refusal(response, None, placed_at(PLACES))
        assert message in told and "% of what the outputs show is neither tilt nor piston" in told
        assert told.endswith("or correct positions.")
    else:
        check_wiring("u.npy", response, placed_at(PLACES), None)


def test_positions_of_displacements_that_are_known_in_part_or_of_angles_are_refused():
    angle = Output("y1", "angle")
    told = refusal(made(GAIN), None, [placed_at(PLACES)[0], angle])
    assert "positions are those of displacements, and the outputs are angles" in told
    assert "the positions do not give the tilts" in refusal(made(GAIN), None, placed_at(PLACES)[:2])


# -------------------------------------------------------------------------------------- three outputs of four drives
WIDE = ((2.0, -1.0, 0.5, 3.0), (1.5, 4.0, -2.5, 0.25), (-3.5, 0.75, 1.25, 5.0))
ALL_OF_THEM = np.sign(WIDE).astype(int)
THREE = [Output(f"y{k}", "displacement") for k in range(3)]


def swapped(axis, a, b):
    order = list(range(np.shape(WIDE)[axis]))
    order[a], order[b] = b, a
    return np.take(ALL_OF_THEM, order, axis=axis)


@pytest.mark.parametrize(
    ("signs", "contradicts", "advice"),
    [
        (
            swapped(0, 0, 2),
            "the output 'y2' falls with the drive 'u0'",
            "it would agree where the outputs 'y0' and 'y2' are swapped or the inputs 'u0' and 'u1' are swapped",
        ),
        (
            swapped(1, 1, 3),
            "the output 'y0' rises with the drive 'u3'",
            "it would agree where the inputs 'u1' and 'u3' are swapped",
        ),
        (
            np.where(np.arange(3)[:, None] == 1, 0, ALL_OF_THEM) * [[1], [1], [-1]],
            "the output 'y2' rises with the drive 'u3'",
            "it would agree where the output 'y2' is reversed",
        ),
        (
            -ALL_OF_THEM,
            "the output 'y2' rises with the drive 'u3'",
            "no single sensor reversed or pair of channels swapped explains it",
        ),
    ],
)
def test_the_channel_that_is_wired_wrongly_among_four_drives_and_three_outputs(signs, contradicts, advice):
    assert refusal(made(WIDE), signs, THREE) == (
        f"u.npy: at low frequency {contradicts}, and `signs` says that it does not; {advice}: check the wiring, or "
        "correct signs."
    )


def test_of_unlike_errors_the_most_certain_contradiction_is_named():
    """The larger response is known worse."""
    errors = np.full((20, 2, 2), 0.01)
    errors[:, 1, 0] = 0.3
    response = replace(made(GAIN), standard_error=errors)
    assert refusal(response, ((-1, 0), (1, 0)), TWO) == (
        "u.npy: at low frequency the output 'y0' rises with the drive 'u0', and `signs` says that it does not; it "
        "would agree where the outputs 'y0' and 'y1' are swapped: check the wiring, or correct signs."
    )


def test_no_more_than_three_ways_are_told():
    """Of one output each reversed or swapped channel explains it: of four drives there are six pairs, and it."""
    told = refusal(made(((1.0, 2.0, 3.0, -4.0),)), ((1, 1, -1, 1),), TWO[:1])
    assert told == (
        "u.npy: at low frequency the output 'y0' falls with the drive 'u3', and `signs` says that it does not; it "
        "would agree where the inputs 'u2' and 'u3' are swapped: check the wiring, or correct signs."
    )
    told = refusal(made(((1.0, 2.0, 3.0, -4.0),)), ((1, 0, 0, 1),), TWO[:1])
    assert "where the inputs 'u1' and 'u3' are swapped or the inputs 'u2' and 'u3' are swapped: check" in told
    told = refusal(made(((-1.0, 2.0, 3.0, 4.0),)), ((1, 0, 0, 0),), TWO[:1])
    assert (
        "where the output 'y0' is reversed or the inputs 'u0' and 'u1' are swapped or the inputs 'u0' and 'u2'" in told
    )
    assert "'u3'" not in told


def test_the_gain_at_low_frequency_is_of_ten_lines_or_of_all_where_there_are_fewer():
    response = made(GAIN, error=0.3, lines=12)
    turned = response.response * np.where(np.arange(12) < 10, np.exp(0.5j), 9.0)[:, None, None]
    gain, error = wiring._at_low_frequency(replace(response, response=turned))
    np.testing.assert_allclose(gain, np.cos(0.5) * np.array(GAIN))
    np.testing.assert_allclose(error, np.full((2, 2), 0.3 / np.sqrt(10.0)))
    np.testing.assert_allclose(wiring._at_low_frequency(made(GAIN, error=0.3, lines=4))[1], np.full((2, 2), 0.15))


@pytest.mark.parametrize(
    "signs", [((1,),), ((1, 1), (1,)), ((1, 1, 1), (1, 1, 1)), ((1, 1),), ((1, 2), (1, 0)), 1, None]
)
def test_signs_are_a_row_for_each_output(signs):
    response = made(GAIN)
    if signs is None:
        assert wiring.check_wiring("u.npy", response, TWO, signs) is None
    else:
        assert refusal(response, signs, TWO) == (
            f"u.npy: signs are {signs}; give 2 rows of 2 numbers each, one row for each output and in it 1, -1 or 0 "
            "for each drive."
        )


def test_of_records_without_noise_each_contradiction_is_certain():
    told = refusal(made(GAIN, error=0.0), ((-1, 0), (0, 0)), TWO)
    assert told.startswith("u.npy: at low frequency the output 'y0' rises with the drive 'u0', and `signs` says")


@pytest.mark.parametrize("drive", range(4))
def test_each_of_four_drives_has_to_move_something(drive):
    gain = np.array(WIDE, dtype=float)
    gain[:, drive] = 0.0
    assert refusal(made(gain, error=0.1), None, THREE) == (
        f"u.npy: the drive 'u{drive}' moves nothing: the response of every output to it is within its noise; check the "
        "actuator and its amplifier, drive it harder, or leave it out."
    )


@pytest.mark.parametrize("drive", [0, 1])
@pytest.mark.parametrize(("peak", "moves"), [(1.05, True), (0.95, False)])
def test_a_drive_that_moves_one_output_at_one_line_is_judged_by_the_noise_of_that_output_alone(drive, peak, moves):
    """Twenty lines with noise of 0.1, so 0.2 in all, of which 0.4 is twice; the other drive's noise is far larger."""
    gain = np.array(((40.0, 40.0), (-40.0, 40.0)))
    gain[:, drive] = 0.0
    response = made(gain)
    moving, error = response.response.copy(), np.full(response.standard_error.shape, 7.0)
    error[:, :, drive] = 5.0
    error[:, 1, drive] = 0.1
    moving[12, 1, drive] = peak * np.sqrt(2.0 * 20.0) * 0.1
    noisy = replace(response, response=moving, standard_error=error)
    if moves:
        check_wiring("u.npy", noisy, TWO, None)
    else:
        assert f"the drive 'u{drive}' moves nothing" in refusal(noisy, None, TWO)


@pytest.mark.parametrize("known", [1, 3, 4])
def test_positions_of_some_displacements_are_not_enough_however_many_they_are(known):
    """One more displacement has none, wherever it stands."""
    for at in (0, known):
        outputs = placed_at(PLACES[:known])
        outputs.insert(at, Output("w", "displacement"))
        told = refusal(made(tilted(PLACES[: known + 1])), None, outputs)
        assert told == (
            f"u.npy: the positions do not give the tilts: {known} of {known + 1} displacements have a position; two "
            "tilts and a piston take at least three, and the position of each; or leave the positions out (--position, "
            "positions)."
        )


@pytest.mark.parametrize("reversed_one", [0, 1])
def test_four_displacements_are_enough_to_find_the_reversed_one(reversed_one):
    places = ((0.01, 0.0), (0.0, 0.02), (-0.015, 0.001), (0.002, -0.03))
    gain = tilted(places, piston=5.0)
    check_wiring("u.npy", made(gain), placed_at(places), None)
    gain[reversed_one] *= -1
    told = refusal(made(gain), None, placed_at(places))
    assert f"where the output 'y{reversed_one}' is reversed: check the wiring, or correct positions." in told


def test_a_drive_moves_something_where_it_does_at_half_of_the_lines_each_beside_its_own_noise():
    """Of five lines three have thrice the power of their noise, and two a tenth, one of them of great noise."""
    noise = np.array([1.0, 10.0, 100.0, 60.0, 1e6])
    for ratio, moves in (([3.0, 3.0, 3.0, 0.1, 0.1], True), ([3.0, 3.0, 0.1, 0.1, 0.1], False)):
        response = made(((1.0, 1.0),))
        shape = (5, 1, 1)
        power = np.sqrt(noise * ratio).reshape(shape)
        steady = np.full(shape, 1e4)
        response = replace(
            response,
            freq_hz=np.arange(1.0, 6.0),
            response=np.concatenate([steady, power], axis=2) + 0j,
            standard_error=np.repeat(np.sqrt(noise).reshape(shape), 2, axis=2),
        )
        if moves:
            check_wiring("u.npy", response, TWO[:1], None)
        else:
            assert "the drive 'u1' moves nothing" in refusal(response, None, TWO[:1])
