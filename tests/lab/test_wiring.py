"""Channels that are not wired as it is said of them, on a real mirror of three actuators and three sensors."""

from dataclasses import replace

import numpy as np
import pytest

from microrad.lab.identify import IdentificationError
from microrad.lab.identify.coupled.wiring import check_wiring
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.recording import AXES, read_arrays
from microrad.mirror.coupled import Output
from places import DATA

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"real recordings are not at {DATA}")

SIGNS = ((-1, 1, -1), (1, -1, -1), (-1, -1, 1))
OUTPUTS = tuple(Output(f"y{k}", "displacement") for k in range(3))


@pytest.fixture(scope="module")
def response():
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
