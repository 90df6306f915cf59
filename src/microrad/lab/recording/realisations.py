"""Arrays of more axes than two as recordings: one for each realisation, its periods one behind the other in time.

Which axis is what is said by whoever reads them, and never guessed from its length.
"""

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.lab.recording.checks.sample_rate import agreed_rate, check_rate
from microrad.lab.recording.checks.signals import check_signals
from microrad.lab.recording.checks.together import check_together
from microrad.lab.recording.files import check_file
from microrad.lab.recording.formats.arrays import ArraySource
from microrad.lab.recording.formats.source import StatedRate
from microrad.lab.recording.reader import (
    WHOLE,
    Part,
    carried,
    check_accept,
    checked_period,
    named_part,
    open_source,
    recording_from_arrays,
    samples_of,
)
from microrad.lab.recording.records import MIN_SAMPLES, Recording, RecordingError, digest_of, frozen

AXES = ("samples", "channels", "realisations", "periods")
"""What an axis of an array may be."""

_OTHER_PERIOD = 0.5  # of the rms of a drive: two realisations of one power differ by 1.4, a period from itself by noise


class _Array(NamedTuple):
    """An array with its axes in the order of `AXES`, one that it does not have of length one."""

    values: Floats
    path: Path
    name: str
    unit: str
    rates: tuple[StatedRate, ...]


def read_arrays(  # noqa: PLR0913  all but the first three are named options
    path: str | Path,
    inputs: str | None = None,
    outputs: str | None = None,
    rate_hz: float | None = None,
    *,
    axes: Sequence[str],
    output_path: str | Path | None = None,
    period_samples: int | None = None,
    part_s: Part = WHOLE,
    accept: Sequence[str] = (),
    alone: bool = True,
) -> tuple[Recording, ...]:
    """Read drives and outputs that stand in whole arrays (NPY, NPZ, MAT, HDF5): one recording for each realisation.

    Args:
        path: The file of the drives, and of the outputs where they have none of their own.
        inputs: Name of the array of drives; it may be left out where the file holds no other one of as many axes.
        outputs: Name of the array of outputs; the same.
        rate_hz: Sample rate where the file states none; where both are known they must agree to 0.1 %.
        axes: What each axis of both arrays is, out of `AXES`, in the arrays' order; "samples" among them.
        output_path: The file of the outputs, where it is another one.
        period_samples: Length of a period, where no axis counts the periods.
        part_s: First and last time, in s from the first sample of each realisation, of the part that is read.
        accept: Findings of degree to take on, see `read_recording`.
        alone: Whether the realisations have to do by themselves; False where more recordings are judged with them by
            `check_together`.

    Returns:
        One recording a realisation, all periods in it one behind the other and `period_samples` set where an axis
        counts them.

    Raises:
        RecordingError: For axes that are not those of the arrays, and for anything that cannot be relied upon.
    """
    path, second = Path(path), Path(output_path or path)
    where = str(path)
    rate_hz = None if rate_hz is None else check_rate(where, rate_hz)
    check_accept(where, accept)
    _check_axes(where, axes)
    if "periods" in axes and period_samples is not None:
        raise RecordingError(f"{where}: --axes (axes) says where the periods are; leave out --period (period_samples).")
    sources = {each: _opened(each) for each in dict.fromkeys((path, second))}
    drive = _array(sources[path], inputs, axes, "input")
    output = _array(sources[second], outputs, axes, "output")
    if path == second and drive.name == output.name:
        raise RecordingError(
            f"{where}: input and output are both '{drive.name}'; name two arrays (--input, --output), or the file of "
            "the outputs (--output-file, output_path)."
        )
    rate = agreed_rate(where, rate_hz, [*drive.rates, *output.rates])
    _check_shapes(drive, output)
    if "periods" in axes:
        _check_periods(where, drive)
        period_samples = drive.values.shape[0]
    if drive.name == output.name:  # as "data" of two NPY files
        drive, output = drive._replace(name="drive"), output._replace(name="output")
    found = tuple(
        _realisation(place, drive, output, number, rate, period_samples, part_s, accept)
        for number, place in enumerate(_places(path, drive.values.shape[2], "realisations" in axes))
    )
    if alone:
        check_together(found)
    return found


def multisine_recordings(
    drive: ArrayLike, output: ArrayLike, rate_hz: float, name: str = "multisine", *, accept: Sequence[str] = ()
) -> tuple[Recording, ...]:
    """One recording per realisation of a periodic multisine experiment, its periods joined in time.

    Args:
        drive: Shape (samples of one period, inputs, realisations, periods).
        output: Shape (samples of one period, outputs, realisations, periods).
        rate_hz: Samples per second.
        name: Stands where the path of a file would, before the number of the realisation.
        accept: Findings of degree to take on, see `read_recording`.

    Raises:
        RecordingError: If the shapes do not agree, or for anything that cannot be relied upon.
    """
    u, y = (np.asarray(a) for a in (drive, output))
    if u.ndim != 4 or y.ndim != 4 or (u.shape[0], *u.shape[2:]) != (y.shape[0], *y.shape[2:]) or not u.shape[2]:
        raise RecordingError(
            f"{name}: drive has shape {u.shape} and output {y.shape}; give (samples, channels, realisations, periods) "
            "with the same samples, realisations and periods, at least one of each."
        )
    found = tuple(
        recording_from_arrays(
            _joined(u, r), _joined(y, r), rate_hz, f"{name} realisation {r}", len(u), accept=accept, alone=False
        )
        for r in range(u.shape[2])
    )
    check_together(found)
    return found


def _joined(values: Floats, realisation: int) -> Floats:
    """One realisation, one period behind the other: (samples, channels)."""
    return np.moveaxis(values[:, :, realisation], 2, 0).reshape(-1, values.shape[1])


def _check_axes(where: str, axes: Sequence[str]) -> None:
    said = f"{where}: --axes (axes) is '{axes if isinstance(axes, str) else ','.join(axes)}'"
    advice = f"name each axis of the array in its order, out of {', '.join(AXES)}"
    if isinstance(axes, str):
        raise RecordingError(f"{said}; give a sequence of words: {advice}.")
    for axis in axes:
        if axis not in AXES:
            near = difflib.get_close_matches(axis, AXES, n=1)
            raise RecordingError(f"{said}: '{axis}' is no axis{f', {near[0]} is' if near else ''}; {advice}.")
        if list(axes).count(axis) > 1:
            raise RecordingError(f"{said}: {axis} stands twice; {advice}.")
    if "samples" not in axes:
        raise RecordingError(f"{said}, without samples; {advice}.")


def _opened(path: Path) -> ArraySource:
    check_file(path)
    source = open_source(path)
    if not isinstance(source, ArraySource):
        raise RecordingError(
            f"{path}: --axes (axes) is for arrays (NPY, NPZ, MAT, HDF5) and this file holds columns; leave it out and "
            "name them (--input, --output)."
        )
    return source


def _array(source: ArraySource, wanted: str | None, axes: Sequence[str], role: str) -> _Array:
    found = source.whole(wanted, len(axes), role)
    values = source.load_whole(found)
    absent = [axis for axis in AXES if axis not in axes]
    if (samples := values.shape[list(axes).index("samples")]) < MIN_SAMPLES:
        raise RecordingError(
            f"{source.path}: the axis of '{found.name}' that --axes (axes) calls samples has {samples}, and at least "
            f"{MIN_SAMPLES} are needed; correct the order of the axes, or record longer."
        )
    order = [*axes, *absent]
    values = np.transpose(values[(..., *[None] * len(absent))], [order.index(axis) for axis in AXES])
    return _Array(values, source.path, found.name, found.unit, source.rates_of(found.name))


def _check_shapes(drive: _Array, output: _Array) -> None:
    """Raises RecordingError if drives and outputs differ in an axis other than the channels'."""
    for place, axis in enumerate(AXES):
        counts = drive.values.shape[place], output.values.shape[place]
        if axis != "channels" and counts[0] != counts[1]:
            raise RecordingError(
                f"{output.path}: '{output.name}' has {counts[1]} {axis}, where the drives, '{drive.name}' in "
                f"{drive.path}, have {counts[0]}; give arrays that were recorded together, and their axes in order "
                "(--axes)."
            )


@np.errstate(invalid="ignore", over="ignore")  # samples that are no numbers, or too large, are refused later
def _check_periods(where: str, drive: _Array) -> None:
    """Raises RecordingError if a drive is not the same in each period: then another axis was called periods."""
    values = drive.values - drive.values.mean(axis=0)
    change = np.sqrt(np.mean((values - values[..., :1]) ** 2, axis=(0, 2)))  # (channels, periods)
    size = np.sqrt(np.mean(values**2, axis=(0, 2, 3)))
    channel, period = np.unravel_index(np.argmax(change - _OTHER_PERIOD * size[:, None]), change.shape)
    if change[channel, period] > _OTHER_PERIOD * size[channel]:
        raise RecordingError(
            f"{where}: channel {channel} of '{drive.name}' differs from period 0 to {period} by "
            f"{100 * change[channel, period] / size[channel]:.0f} % of its rms, and a drive is the same in each "
            "period: correct the order in --axes (axes)."
        )


def _places(path: Path, realisations: int, counted: bool) -> list[str]:
    return [f"{path} realisation {r}" for r in range(realisations)] if counted else [str(path)]


def _realisation(
    place: str,
    drive: _Array,
    output: _Array,
    number: int,
    rate_hz: float,
    period_samples: int | None,
    part_s: Part,
    accept: Sequence[str],
) -> Recording:
    u, y = (_joined(each.values, number) for each in (drive, output))
    kept, where = samples_of(place, part_s, rate_hz, len(u)), named_part(place, part_s)
    u, y = frozen(u[kept]), frozen(y[kept])
    names = [_channel_names(each) for each in (drive, output)]
    inputs, outputs = (
        {f"the {role}, {name}": np.ascontiguousarray(column) for name, column in zip(each, values.T, strict=True)}
        for role, each, values in (("input", names[0], u), ("output", names[1], y))
    )
    if drive.path != output.path:
        outputs = {f"{label} of {output.path}": column for label, column in outputs.items()}
    length = drive.values.shape[0]

    def at(row: int) -> str:
        period, sample = divmod(row + kept.start, length)
        return f"sample {sample}" if drive.values.shape[3] == 1 else f"sample {sample} of period {period}"

    findings = check_signals(where, inputs, outputs, rate_hz, at, alone=False)
    return Recording(
        where,
        digest_of(u, y),
        u,
        y,
        rate_hz,
        names[0],
        names[1],
        checked_period(where, period_samples, len(u)),
        (drive.unit,) * u.shape[1],
        (output.unit,) * y.shape[1],
        carried(where, findings, accept),
    )


def _channel_names(array: _Array) -> tuple[str, ...]:
    count = array.values.shape[1]
    return (array.name,) if count == 1 else tuple(f"{array.name}[{k}]" for k in range(count))
