"""Whether sensors and drives are the way round that is said of them, by the response at low frequency.

Without a word on geometry or signs this cannot be seen: swapped channels, or a reversed sensor, are another mirror.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.identify.linear.response import response_from_periods, response_from_records
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording
from microrad.mirror.coupled import Output
from microrad.mirror.coupled.geometry import tilts_and_piston

_LINES = 10
_CERTAIN = 5.0  # standard errors from which a sign is one
_BENT = 0.3  # of the motion, beyond a plane: no mirror bends that far at low frequency
_FLAT = 0.1  # of what was bent, left where the right sensor is turned round


def check_orientation(
    recordings: Sequence[Recording],
    output_unit: str,
    positions_m: Sequence[tuple[float, float]] | None,
    signs: Sequence[Sequence[int]] | None,
) -> None:
    """Check the response at low frequency against the signs that are stated, and against a mirror that stays flat.

    The positions of three sensors agree with any response; from four on they do not.

    Args:
        recordings: Recordings of several channels, all periodic or none.
        output_unit: Unit of the outputs, which says whether they are lengths.
        positions_m: Where each output is measured on the mirror, (x, y) in m; None where that is not known.
        signs: The way that each output moves with each drive, shape (outputs, inputs): 1, -1, or 0 where nothing is
            said; None where nothing is.

    Raises:
        IdentificationError: If they contradict each other, with the channel that may be reversed or swapped, and for
            positions that do not give the tilts.
    """
    if positions_m is not None:
        _check_places(recordings[0], output_unit, positions_m)
    if signs is None and len(positions_m or ()) < 4:
        return
    first = recordings[0]
    gain, error = _low_response(recordings)
    if signs is not None:
        _check_signs(first, gain, error, np.array(signs, dtype=float))
    if positions_m is not None and len(positions_m) >= 4:
        _check_flat(first, gain, np.array(positions_m))


def _check_places(first: Recording, output_unit: str, positions_m: Sequence[tuple[float, float]]) -> None:
    if output_unit.endswith("rad"):
        raise IdentificationError(
            f"{first.path}: positions are those of displacements, and the outputs are angles ({output_unit}), which "
            "are alike everywhere on a mirror; leave them out (--position, positions)."
        )
    named = zip(first.output_names, positions_m, strict=True)
    try:
        tilts_and_piston([Output(name, "displacement", place) for name, place in named])
    except ValueError as error:
        raise IdentificationError(
            f"{first.path}: the positions do not give the tilts: {error}; or leave them out (--position, positions)."
        ) from None


def _low_response(recordings: Sequence[Recording]) -> tuple[Floats, Floats]:
    """Real part of the response, mean over the lowest lines, and its standard error; (outputs, inputs)."""
    estimate = response_from_periods if recordings[0].period_samples else response_from_records
    found = estimate(recordings)
    low = slice(0, _LINES)
    count = found.response[low].shape[0]
    error = np.sqrt(np.sum(found.standard_error[low] ** 2, axis=0)) / count
    return found.response[low].real.mean(axis=0), error


def _check_signs(first: Recording, gain: Floats, error: Floats, signs: Floats) -> None:
    def wrong(turned: Floats) -> bool:
        return bool(np.any(signs * turned < -_CERTAIN * error))

    if not wrong(gain):
        return
    output, drive = np.unravel_index(np.argmin(signs * gain / error), gain.shape)
    moves = "falls" if signs[output, drive] > 0 else "rises"
    ways = [words for turned, words in _turned(first, gain) if not wrong(turned)]
    raise IdentificationError(
        f"{first.path}: at low frequency the output '{first.output_names[output]}' {moves} with the drive "
        f"'{first.input_names[drive]}', and `signs` says that it does not; {_advice(ways)}, or correct signs."
    )


def _check_flat(first: Recording, gain: Floats, places: Floats) -> None:
    x, y = places.T
    plane = np.column_stack([y, -x, np.ones(x.size)])
    beyond = np.eye(x.size) - plane @ np.linalg.pinv(plane)

    def bent(turned: Floats) -> float:
        return float(np.linalg.norm(beyond @ turned) / np.linalg.norm(turned))

    if bent(gain) < _BENT:
        return
    ways = [words for turned, words in _turned(first, gain) if bent(turned) < _FLAT * bent(gain)]
    if ways:
        raise IdentificationError(
            f"{first.path}: at low frequency {100 * bent(gain):.0f} % of what the outputs show is neither tilt nor "
            f"piston of the positions that are stated; {_advice(ways)}, or correct positions."
        )


def _turned(first: Recording, gain: Floats) -> Iterator[tuple[Floats, str]]:
    """The response with one output reversed, or with two channels swapped, and words for it."""
    outputs, inputs = gain.shape
    for k in range(outputs):
        turned = gain.copy()
        turned[k] *= -1
        yield turned, f"the output '{first.output_names[k]}' is reversed"
    for i, k in itertools.combinations(range(outputs), 2):
        turned = gain.copy()
        turned[[i, k]] = turned[[k, i]]
        yield turned, f"the outputs '{first.output_names[i]}' and '{first.output_names[k]}' are swapped"
    for i, k in itertools.combinations(range(inputs), 2):
        turned = gain.copy()
        turned[:, [i, k]] = turned[:, [k, i]]
        yield turned, f"the inputs '{first.input_names[i]}' and '{first.input_names[k]}' are swapped"


def _advice(ways: Sequence[str]) -> str:
    told = " or ".join(ways[:3]) if ways else "no single sensor reversed or pair of channels swapped explains it"
    return f"it would agree where {told}: check the wiring" if ways else f"{told}: check the wiring"
