"""Whether each actuator moves the mirror, and channels are the way round that is said of them.

Without a word on geometry or signs the latter cannot be seen: swapped channels, or a reversed sensor, are another
mirror.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import counted
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.records import IdentificationError
from microrad.mirror.coupled import Output
from microrad.mirror.coupled.geometry import tilts_and_piston

_LINES = 10
_NOISE = 2.0  # a response that is noise alone has the power of its standard error
_CERTAIN = 5.0  # standard errors from which a sign is one
_BENT = 0.3  # of the motion, beyond a plane: no mirror bends that far at low frequency
_FLAT = 0.1  # of what was bent, left where the right sensor is turned round


def check_wiring(
    path: str, found: FrequencyResponse, outputs: Sequence[Output], signs: Sequence[Sequence[int]] | None
) -> None:
    """Check that each drive moves an output, by the signs that are stated and as a mirror that stays flat does.

    Signs and flatness are those of the response at low frequency. The positions of three displacements agree with any
    response; from four on they do not.

    Args:
        path: The first recording, for the message.
        found: The response of the recordings, in SI units.
        outputs: The outputs, with their positions where these are known.
        signs: The way that each output moves with each drive, shape (outputs, inputs): 1, -1, or 0 where nothing is
            said; None where nothing is.

    Raises:
        IdentificationError: For a drive that moves nothing, for positions that do not give the tilts, and for signs and
            positions that the response contradicts, with the channel that may be reversed or swapped.
    """
    if any(output.position_m is not None for output in outputs):
        _check_places(path, outputs)
    _check_moves(path, found)
    gain, error = _at_low_frequency(found)
    if signs is not None:
        _check_signs(path, found, gain, np.maximum(error, 1e-300), _stated(path, signs, gain.shape))
    places = [output.position_m for output in outputs if output.position_m is not None]
    if len(places) >= 4:
        _check_flat(path, found, gain, np.array(places))


def _check_places(path: str, outputs: Sequence[Output]) -> None:
    advice = "or leave the positions out (--position, positions)"
    if any(output.quantity == "angle" for output in outputs):
        raise IdentificationError(
            f"{path}: positions are those of displacements, and the outputs are angles, which are alike everywhere on "
            f"a mirror; give the unit of the displacements, {advice}."
        )
    try:
        tilts_and_piston(outputs)
    except ValueError as error:
        raise IdentificationError(f"{path}: the positions do not give the tilts: {error}; {advice}.") from None


def _check_moves(path: str, found: FrequencyResponse) -> None:
    power, noise = np.abs(found.response) ** 2, np.maximum(found.standard_error**2, 1e-300)
    # With few records the drives nearly agree at some lines, whose noise exceeds all others: so the median, too.
    ratio = np.maximum(power.sum(axis=0) / noise.sum(axis=0), np.median(power / noise, axis=0))
    for k, name in enumerate(found.input_names):
        if np.all(ratio[:, k] < _NOISE):
            raise IdentificationError(
                f"{path}: the drive '{name}' moves nothing: the response of every output to it is within its "
                "noise; check the actuator and its amplifier, drive it harder, or leave it out."
            )


def _at_low_frequency(found: FrequencyResponse) -> tuple[Floats, Floats]:
    """Real part of the response, mean over the lowest lines, and its standard error; (outputs, inputs)."""
    low = slice(0, _LINES)
    count = found.response[low].shape[0]
    error = np.sqrt(np.sum(found.standard_error[low] ** 2, axis=0)) / count
    return found.response[low].real.mean(axis=0), error


def _stated(path: str, signs: Sequence[Sequence[int]], shape: tuple[int, ...]) -> Floats:
    """The signs that are stated, of the shape (outputs, inputs)."""
    try:
        stated = np.array(signs, dtype=float)
    except (TypeError, ValueError):
        stated = np.zeros(0)
    if stated.shape != shape or not np.isin(stated, (-1.0, 0.0, 1.0)).all():
        rows, columns = counted(shape[0], "row"), counted(shape[1], "number")
        raise IdentificationError(
            f"{path}: signs are {signs}; give {rows} of {columns} each, one row for each output and in it 1, -1 or 0 "
            "for each drive."
        )
    return stated


def _check_signs(path: str, found: FrequencyResponse, gain: Floats, error: Floats, signs: Floats) -> None:
    def wrong(turned: Floats) -> bool:
        return bool(np.any(signs * turned < -_CERTAIN * error))

    if not wrong(gain):
        return
    output, drive = np.unravel_index(np.argmin(signs * gain / error), gain.shape)
    moves = "falls" if signs[output, drive] > 0 else "rises"
    ways = [words for turned, words in _turned(found, gain) if not wrong(turned)]
    raise IdentificationError(
        f"{path}: at low frequency the output '{found.output_names[output]}' {moves} with the drive "
        f"'{found.input_names[drive]}', and `signs` says that it does not; {_advice(ways)}, or correct signs."
    )


def _check_flat(path: str, found: FrequencyResponse, gain: Floats, places: Floats) -> None:
    x, y = places.T
    plane = np.column_stack([y, -x, np.ones(x.size)])
    beyond = np.eye(x.size) - plane @ np.linalg.pinv(plane)

    def bent(turned: Floats) -> float:
        return float(np.linalg.norm(beyond @ turned) / np.linalg.norm(turned))

    if bent(gain) < _BENT:
        return
    ways = [words for turned, words in _turned(found, gain) if bent(turned) < _FLAT * bent(gain)]
    if ways:
        raise IdentificationError(
            f"{path}: at low frequency {100 * bent(gain):.0f} % of what the outputs show is neither tilt nor "
            f"piston of the positions that are stated; {_advice(ways)}, or correct positions."
        )


def _turned(found: FrequencyResponse, gain: Floats) -> Iterator[tuple[Floats, str]]:
    """The response with one output reversed, or with two channels swapped, and words for it."""
    outputs, inputs = gain.shape
    for k in range(outputs):
        turned = gain.copy()
        turned[k] *= -1
        yield turned, f"the output '{found.output_names[k]}' is reversed"
    for i, k in itertools.combinations(range(outputs), 2):
        turned = gain.copy()
        turned[[i, k]] = turned[[k, i]]
        yield turned, f"the outputs '{found.output_names[i]}' and '{found.output_names[k]}' are swapped"
    for i, k in itertools.combinations(range(inputs), 2):
        turned = gain.copy()
        turned[:, [i, k]] = turned[:, [k, i]]
        yield turned, f"the inputs '{found.input_names[i]}' and '{found.input_names[k]}' are swapped"


def _advice(ways: Sequence[str]) -> str:
    told = " or ".join(ways[:3]) if ways else "no single sensor reversed or pair of channels swapped explains it"
    return f"it would agree where {told}: check the wiring" if ways else f"{told}: check the wiring"
