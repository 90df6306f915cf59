"""From a file, or from arrays, to a checked `Recording`."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats, reals
from microrad.core.units import counted, parse_quantity
from microrad.lab.recording.checks.sample_rate import agreed_rate, check_rate, rate_of_time
from microrad.lab.recording.checks.signals import check_signals
from microrad.lab.recording.files import check_file, file_format
from microrad.lab.recording.formats.lvm import LvmSource
from microrad.lab.recording.formats.matlab import MatlabSource
from microrad.lab.recording.formats.numpy_files import NumpySource
from microrad.lab.recording.formats.source import SECONDS, Source, StatedRate, bracketed_unit, is_time_name, time_unit
from microrad.lab.recording.formats.tdms import TdmsSource
from microrad.lab.recording.formats.text import TextSource
from microrad.lab.recording.records import (
    ACCEPTABLE,
    MIN_SAMPLES,
    Finding,
    Motion,
    Recording,
    RecordingError,
    Signal,
    digest_of,
    frozen,
)

Column = int | str
Part = tuple[float, float | None]
"""First and last time, in s from the first sample; None for the end."""

WHOLE: Part = (0.0, None)

_MOST_AXES = 3


def read_recording(  # noqa: PLR0913  all but the first four are named options
    path: str | Path,
    inputs: Column | Sequence[Column],
    outputs: Column | Sequence[Column],
    rate_hz: float | None = None,
    *,
    time: Column | None = None,
    period_samples: int | None = None,
    part_s: Part = WHOLE,
    accept: Sequence[str] = (),
    alone: bool = True,
) -> Recording:
    """Read drives and outputs from a laboratory file and check them.

    Text (CSV, TSV, ...), LabVIEW .lvm and .tdms, MATLAB .mat (v5 to v7.3), NumPy .npy and .npz, and HDF5 are told
    apart by their content. A channel is a name or a number counted from 0; `group/channel` in TDMS and HDF5,
    `structure/field` in MATLAB, `variable[2]` for a column of an array; a sequence gives several channels.

    Args:
        path: The file.
        inputs: The drive channel, or several.
        outputs: The sensor channel, or several.
        rate_hz: Sample rate where the file states none; where both are known they must agree to 0.1 %.
        time: The time column (s); by default one that is plainly called so.
        period_samples: Length of one period of a periodic excitation.
        part_s: First and last time, in s from the first sample, of the part that is read; None for the end.
        accept: Findings of degree (`jitter`, `clipping`, `dead`, `quantisation`, `drift`, `unexcited`, `lead`) that are
            to be carried in `Recording.findings` instead of refused.
        alone: Whether the recording has to do by itself. False where it is one of several that are judged by
            `check_together`: then an input may rest while another one is driven.

    Raises:
        RecordingError: For anything that cannot be relied upon, naming file, channel, row and remedy.

    Example:
        ```python
        import microrad

        recording = microrad.read_recording("loop.csv", inputs="drive", outputs="angle")
        print(recording.rate_hz, recording.samples, recording.findings)
        ```
    """
    path = Path(path)
    if rate_hz is not None:
        rate_hz = check_rate(str(path), rate_hz)
    check_accept(str(path), accept)
    check_file(path)
    source = open_source(path)
    ins, outs = _columns(source, inputs, "input"), _columns(source, outputs, "output")
    _check_distinct(source, ins, outs)
    clock = _clock(source, [*ins, *outs], time)
    optional = time is None and rate_hz is not None
    columns, rates, findings = _load_columns(source, [*ins, *outs], clock, optional)
    rate = agreed_rate(str(path), rate_hz, [*source.rates([*ins, *outs]), *rates])
    _check_lengths(source, [*ins, *outs], columns)
    kept = samples_of(str(path), part_s, rate, columns[0].size)
    columns = [column[kept] for column in columns]
    drives = {f"the input, {source.label(i)}": column for i, column in zip(ins, columns, strict=False)}
    sensors = {f"the output, {source.label(i)}": column for i, column in zip(outs, columns[len(ins) :], strict=True)}
    where = named_part(str(path), part_s)
    found = check_signals(where, drives, sensors, rate, lambda row: source.place(row + kept.start), alone)
    drive, output = _table(columns[: len(ins)]), _table(columns[len(ins) :])
    return Recording(
        where,
        source.sha256 if part_s == WHOLE else digest_of(drive, output),
        drive,
        output,
        rate,
        tuple(source.names[i] for i in ins),
        tuple(source.names[i] for i in outs),
        checked_period(where, period_samples, drive.shape[0]),
        tuple(source.units[i] for i in ins),
        tuple(source.units[i] for i in outs),
        carried(where, [*findings, *found], accept),
    )


def recording_from_arrays(
    drive: ArrayLike,
    output: ArrayLike,
    rate_hz: float,
    name: str = "arrays",
    period_samples: int | None = None,
    *,
    accept: Sequence[str] = (),
    alone: bool = True,
) -> Recording:
    """Make a recording from arrays of shape (samples,) or (samples, channels), under the same checks as a file.

    Args:
        drive: The drives.
        output: The outputs, sampled together with them.
        rate_hz: Samples per second.
        name: Stands where the path of a file would.
        period_samples: Length of one period of a periodic excitation.
        accept: Findings of degree to take on, see `read_recording`.
        alone: Whether the recording has to do by itself; the same.

    Raises:
        RecordingError: For anything that cannot be relied upon.

    Example:
        ```python
        import numpy as np
        import microrad

        drive_v = np.sin(2 * np.pi * 10 * 1e-3 * np.arange(1000))
        recording = microrad.recording_from_arrays(drive_v, 40e-6 * drive_v, rate_hz=1000.0)
        print(recording.samples, recording.step_s)
        ```
    """
    rate_hz = check_rate(name, rate_hz)
    check_accept(name, accept)
    u, y = (
        np.array(reals(a, f"{name}: {what}", RecordingError, most=math.inf))
        for what, a in (("drive", drive), ("output", output))
    )
    if u.ndim not in (1, 2) or y.ndim not in (1, 2) or len(u) != len(y) or 0 in (u.size, y.size):
        raise RecordingError(
            f"{name}: drive has shape {u.shape} and output {y.shape}; give arrays of shape (samples,) or (samples, "
            "channels) with equally many samples."
        )
    u, y = (a.reshape(len(a), -1) for a in (u, y))
    input_names, output_names = (
        (role,) if a.shape[1] == 1 else tuple(f"{role} {k}" for k in range(a.shape[1]))
        for role, a in (("drive", u), ("output", y))
    )
    inputs, outputs = (
        {f"the {channel}": np.ascontiguousarray(column) for channel, column in zip(names, a.T, strict=True)}
        for names, a in ((input_names, u), (output_names, y))
    )
    findings = check_signals(name, inputs, outputs, rate_hz, lambda row: f"sample {row}", alone)
    return Recording(
        name,
        digest_of(u, y),
        frozen(u),
        frozen(y),
        rate_hz,
        input_names,
        output_names,
        checked_period(name, period_samples, len(u)),
        findings=carried(name, findings, accept),
    )


def read_motion(
    path: str | Path,
    axes: Sequence[Column] = (),
    rate_hz: float | None = None,
    *,
    time: Column | None = None,
    unit: str | None = None,
) -> Motion:
    """Read a recorded motion of the line of sight, one axis a channel, from any file that `read_recording` reads.

    Args:
        path: The file.
        axes: The channels, one to three; by default all but the time.
        rate_hz: Sample rate where the file states none; where both are known they must agree to 0.1 %.
        time: The time column (s); by default one that is plainly called so.
        unit: Unit of the channels where the file states none: "urad", "arcsec" or another one of angles.

    Raises:
        RecordingError: For no channel or more than three, another unit than one of angles, gaps, samples that are no
            number, and anything else that cannot be relied upon.
    """
    path = Path(path)
    rate_hz = None if rate_hz is None else check_rate(str(path), rate_hz)
    check_file(path)
    source = open_source(path)
    used = [source.resolve(each, "axis") for each in axes]
    if not used:
        named = None if time is None else source.resolve(time, "time")
        used = [index for index, name in enumerate(source.names) if index != named and not is_time_name(name)]
    if not 1 <= len(used) <= _MOST_AXES or len(set(used)) < len(used):
        listed = ", ".join(f"'{source.names[index]}'" for index in used[:10])
        raise RecordingError(
            f"{path}: {len(used)} channels ({listed}) as axes; name one to three that differ (--axes, axes)."
        )
    scales = [_angle(source, index, unit) for index in used]
    columns, stated = _sampled(source, used, time, rate_hz)
    rate = agreed_rate(str(path), rate_hz, stated)
    for index, column in zip(used, columns, strict=True):
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise RecordingError(
                f"{path}: {source.place(int(bad[0]))} of {source.label(index)} is "
                f"{column[bad[0]]}, {counted(bad.size, 'such sample')} in all; cut out a part without them: what is "
                "filled in was not measured."
            )
    names = tuple(source.names[index] for index in used)
    return Motion(str(path), source.sha256, names, _table(columns) * np.array(scales), rate)


def read_signal(path: str | Path, channel: Column | None = None, rate_hz: float | None = None) -> Signal:
    """Read one channel as it is, of any length, from any file that `read_recording` reads; its values are not judged.

    Args:
        path: The file.
        channel: The channel; by default the only one beside the time.
        rate_hz: Sample rate where the file states none; where both are known they must agree to 0.1 %.

    Raises:
        RecordingError: For several channels of which none is named, a time with gaps or jitter, two rates, and a file
            that cannot be read.
    """
    path = Path(path)
    rate_hz = None if rate_hz is None else check_rate(str(path), rate_hz)
    check_file(path)
    source = open_source(path, alone=True)
    if channel is None:
        found = [index for index, name in enumerate(source.names) if not is_time_name(name)]
        if len(found) != 1:
            listed = ", ".join(f"'{source.names[index]}'" for index in found[:10]) or "none"
            raise RecordingError(
                f"{path}: the file has {len(found)} channels beside its time ({listed}); name the one."
            )
        index = found[0]
    else:
        index = source.resolve(channel, "signal")
    (samples,), stated = _sampled(source, [index], None, rate_hz)
    known = rate_hz is not None or stated
    rate = agreed_rate(str(path), rate_hz, stated) if known else None
    return Signal(str(path), source.sha256, source.names[index], _stated_unit(source, index), frozen(samples), rate)


def _sampled(
    source: Source, used: list[int], time: Column | None, rate_hz: float | None
) -> tuple[list[Floats], list[StatedRate]]:
    """Channels of equal length, and the rates that file and time column state; a time that scatters is refused."""
    clock = _clock(source, used, time)
    columns, rates, findings = _load_columns(source, used, clock, time is None and rate_hz is not None)
    _check_lengths(source, used, columns)
    if refused := [each.message for each in findings if each.refused]:
        raise RecordingError(f"{source.path}: {'. Also: '.join(refused)}.")
    return columns, [*source.rates(used), *rates]


def _stated_unit(source: Source, index: int) -> str:
    """The unit of a channel as the file or the channel's name says it; '' for none."""
    behind = bracketed_unit(source.names[index])
    return source.units[index].strip() or ("" if set(behind) <= set("0123456789, ") else behind)  # no column's number


def _angle(source: Source, index: int, unit: str | None) -> float:
    """The unit of a channel in rad."""
    stated = _stated_unit(source, index)
    where = f"{source.path}: {source.label(index)}"
    if not stated and unit is None:
        raise RecordingError(f"{where}: no unit is stated; give it (--unit, unit), 'urad' for example.")
    try:
        scales = [parse_quantity(f"1 {each}", "rad") for each in (stated, unit) if each]
    except ValueError:
        raise RecordingError(
            f"{where} is in '{stated or unit}', which is no angle; name channels of angles (--axes, axes), in urad or "
            "arcsec for example, or convert it."
        ) from None
    if len(set(scales)) > 1:
        raise RecordingError(f"{where} is in '{stated}' and {unit} is given; leave out the unit, or correct the file.")
    return scales[0]


# ---------------------------------------------------------------------------------------------------------- opening
def open_source(path: Path, *, alone: bool = False) -> Source:
    """The file as named channels.

    Args:
        path: The file.
        alone: Whether a text may have a single column.

    Raises:
        RecordingError: For a file of no known format, or a damaged one.
    """
    found = file_format(path)
    return TextSource(path, alone) if found == "text" else _SOURCES[found](path)


def _open_hdf5(path: Path, matlab: bool) -> Source:
    from microrad.lab.recording.formats.hdf5 import Hdf5Source

    return Hdf5Source(path, matlab)


_SOURCES: dict[str, Callable[[Path], Source]] = {
    "tdms": TdmsSource,
    "lvm": LvmSource,
    "mat": MatlabSource,
    "mat73": partial(_open_hdf5, matlab=True),
    "npy": partial(NumpySource, archive=False),
    "npz": partial(NumpySource, archive=True),
    "hdf5": partial(_open_hdf5, matlab=False),
    "text": TextSource,
}


def _columns(source: Source, wanted: Column | Sequence[Column], role: str) -> list[int]:
    several = [wanted] if isinstance(wanted, (int, str)) else list(wanted)
    if not several:
        raise RecordingError(f"{source.path}: no {role} channel was given; name at least one.")
    return [source.resolve(column, role) for column in several]


def _check_distinct(source: Source, ins: Sequence[int], outs: Sequence[int]) -> None:
    for index in ins:
        if index in outs:
            raise RecordingError(
                f"{source.path}: input and output are both {source.label(index)}, so there is nothing to identify; "
                "give the drive as input and the sensor as output."
            )
    for role, several in (("input", ins), ("output", outs)):
        twice = next((i for i in several if list(several).count(i) > 1), None)
        if twice is not None:
            raise RecordingError(f"{source.path}: {source.label(twice)} is given twice as {role}; name it once.")


def _clock(source: Source, used: Sequence[int], time: Column | None) -> int | None:
    """Number of the time channel: the one named, else one that is plainly called time."""
    if time is None:
        return source.find_time(used)
    index = source.resolve(time, "time")
    if index in used:
        raise RecordingError(f"{source.path}: {source.label(index)} is the time and a signal; name another one.")
    return index


def _load_columns(
    source: Source, used: list[int], clock: int | None, optional: bool
) -> tuple[list[Floats], list[StatedRate], list[Finding]]:
    """Columns of the channels, and what the time column says; `optional` lets one pass that is not made of numbers."""
    if clock is None:
        return source.load(used), [], []
    label = source.label(clock)
    try:
        columns = source.load([*used, clock])
    except RecordingError:
        if not optional:
            raise
        columns = source.load(used)  # raises where the fault is in the signals
        text = f"{label} is called time and is not a column of numbers; the rate given was believed"
        return columns, [], [Finding("time", source.names[clock], None, text, False)]
    _check_lengths(source, [*used, clock], columns)
    time, unit = columns.pop(), time_unit(source.names[clock], source.units[clock])
    if unit not in SECONDS:
        raise RecordingError(
            f"{source.path}: {label}: the time is in '{unit}'; convert it to one of {', '.join(SECONDS)}, or name no "
            "time column and give the rate."
        )
    if time.size < MIN_SAMPLES:
        return columns, [], []  # refused for its length
    with np.errstate(invalid="ignore", over="ignore"):  # a damaged time is refused there
        time_s = time * SECONDS[unit]
    rate, findings = rate_of_time(str(source.path), label, time_s, source.place)
    return columns, [rate], findings


def _check_lengths(source: Source, indices: Sequence[int], columns: Sequence[Floats]) -> None:
    for index, column in zip(indices, columns, strict=True):
        if column.size != columns[0].size:
            raise RecordingError(
                f"{source.path}: {source.label(indices[0])} has {columns[0].size} samples and {source.label(index)} "
                f"{column.size}; name channels that were sampled together, or cut them to their common time."
            )


# ---------------------------------------------------------------------------------------------------------- judging
def check_accept(where: str, accept: Sequence[str]) -> None:
    """Check that the findings to take on are such as can be.

    Args:
        where: The file in the words of a message.
        accept: Names of findings.

    Raises:
        RecordingError: For a name that is none of them.
    """
    names = [accept] if isinstance(accept, str) else list(accept)
    unknown = [name for name in names if name not in ACCEPTABLE]
    if unknown or isinstance(accept, str):
        raise RecordingError(
            f"{where}: accept = {accept!r}; give a sequence of {', '.join(ACCEPTABLE)}. Other faults, such as gaps or "
            "nan, cannot be accepted."
        )


def carried(where: str, findings: Sequence[Finding], accept: Sequence[str]) -> tuple[Finding, ...]:
    """The findings that a recording carries.

    Args:
        where: The file in the words of a message.
        findings: All findings.
        accept: Names of those that are not to refuse it.

    Raises:
        RecordingError: For a finding that refuses it.
    """
    refused = [f for f in findings if f.refused and f.kind not in accept]
    if refused:
        kinds = list(dict.fromkeys(f.kind for f in refused))
        options = " ".join(f"--accept {kind}" for kind in kinds)
        text = ". Also: ".join(f.message for f in refused)
        raise RecordingError(
            f"{where}: {text}. To take it on as it is: {options} (in Python accept={tuple(kinds)!r}).", refused
        )
    return tuple(findings)


def checked_period(where: str, period_samples: int | None, samples: int) -> int | None:
    """Length of a period that fits into the recording, None for none.

    Args:
        where: The file in the words of a message.
        period_samples: Samples of a period, None for none.
        samples: Samples of the recording.

    Raises:
        RecordingError: For a length that is none, or does not fit.
    """
    if period_samples is None:
        return None
    if isinstance(period_samples, bool) or not isinstance(period_samples, (int, np.integer)):
        raise RecordingError(f"{where}: period_samples is {period_samples!r}; give a whole number of samples.")
    if not 2 <= period_samples <= samples:
        raise RecordingError(
            f"{where}: a period of {period_samples} samples does not fit into {samples} samples; give the length of "
            "one period in samples."
        )
    return int(period_samples)


def samples_of(where: str, part_s: Part, rate_hz: float, samples: int) -> slice:
    """The samples from the first to the last time of a part.

    Args:
        where: The file in the words of a message.
        part_s: First and last time, in s from the first sample; None for the end.
        rate_hz: Samples per second.
        samples: Number of samples that there are.

    Raises:
        RecordingError: If the part is empty or reaches beyond the recording.
    """
    first_s, last_s = part_s
    ends = (first_s * rate_hz, samples if last_s is None else last_s * rate_hz)
    first, last = (round(end) if math.isfinite(end) else -1 for end in ends)
    if not 0 <= first < last <= samples:
        raise RecordingError(
            f"{where}: from {first_s:g} s to {'the end' if last_s is None else f'{last_s:g} s'} is no part of a "
            f"recording of {samples / rate_hz:g} s; give two times within it, the earlier one first."
        )
    return slice(first, last)


def named_part(name: str, part_s: Part) -> str:
    """Name of a recording that tells a part of it from other parts.

    Args:
        name: Name of the whole.
        part_s: First and last time, in s; None for the end.
    """
    if part_s == WHOLE:
        return name
    first_s, last_s = part_s
    return f"{name} from {first_s:g} s" + ("" if last_s is None else f" to {last_s:g} s")


def _table(columns: Sequence[Floats]) -> Floats:
    return frozen(columns[0][:, None] if len(columns) == 1 else np.column_stack(columns))
