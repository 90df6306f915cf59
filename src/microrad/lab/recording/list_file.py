"""A list of recordings: a TOML file with one table for each, which says where its channels are and what it is for.

What stands above the tables holds for all recordings that do not say otherwise. Every fault is reported at once.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator

from microrad.core.units import UnitError, counted
from microrad.lab.recording.checks.together import check_together
from microrad.lab.recording.reader import Column, read_recording
from microrad.lab.recording.realisations import AXES, read_arrays
from microrad.lab.recording.records import ACCEPTABLE, Recording, RecordingError, check_stated
from microrad.mission.fields import MOST_ITEMS, Problem, Quantity, Table, Whole
from microrad.mission.file import check_table
from microrad.mission.model import Duration
from microrad.mission.tables.mirror import DurationOrZero, Frequency, Name
from microrad.mission.toml import Document, Fault, MissionError, UnreadableError, clipped, shown


@dataclass(frozen=True, slots=True)
class RecordingsList:
    """What a list of recordings gives: those to fit, those for validation, and what it says of the mirror.

    `positions_m` is where each output is measured on the mirror, (x, y) in m, and `signs` (outputs, inputs) the way
    that each output moves with each drive at low frequency, 1, -1, or 0 where that is not said; None where nothing is.
    """

    recordings: tuple[Recording, ...]
    validation: tuple[Recording, ...]
    name: str | None
    lever_arm_m: float | None
    positions_m: tuple[tuple[float, float], ...] | None
    signs: tuple[tuple[int, ...], ...] | None


class RecordingsError(MissionError):
    """A list of recordings that cannot be used: `path`, and every fault found in `faults`, by line."""


# ---------------------------------------------------------------------------------------------------- kinds of values
def _items(value: object, expected: str, example: str, most: int = MOST_ITEMS) -> list[Any]:
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise UnitError("it", "is no list of that kind", expected, example)
    return value


def _columns(value: object) -> tuple[Column, ...]:
    expected, example = "the name of a channel, its number from 0, or a list of them", '["u1", "u2"]'
    items = [value] if isinstance(value, int | str) else _items(value, expected, example)
    for each in items:
        if isinstance(each, bool) or not isinstance(each, int | str) or each == "":
            raise UnitError("it", f"holds {shown(each)}, which is no channel", expected, example)
    return tuple(items)


def _words(choices: tuple[str, ...], example: str) -> Callable[[object], tuple[str, ...]]:
    expected = f"a list of different words out of {', '.join(choices)}"

    def read(value: object) -> tuple[str, ...]:
        items = _items(value, expected, example)
        wrong = [each for each in items if each not in choices or items.count(each) > 1]
        if wrong:
            why = "stands twice" if wrong[0] in choices else "is none of them"
            raise UnitError("it", f"holds {shown(wrong[0])}, which {why}", expected, example)
        return tuple(items)

    return read


def _axes(value: object) -> tuple[str, ...]:
    example = '["samples", "channels", "realisations", "periods"]'
    words = _words(AXES, example)(value)
    if "samples" not in words:
        raise UnitError("it", "does not say which axis is samples", "the axes of the array in their order", example)
    return words


def _positions(value: object) -> tuple[tuple[float, float], ...]:
    expected, example = "a list of x and y for each output, as lengths", '[["0 mm", "12 mm"], ["10 mm", "-6 mm"]]'
    pairs = [_items(pair, expected, example, 2) for pair in _items(value, expected, example)]
    if any(len(pair) != 2 for pair in pairs):
        raise UnitError("it", "has a place that is no pair", expected, example)
    return tuple((_LENGTH.read(x), _LENGTH.read(y)) for x, y in pairs)


def _signs(value: object) -> tuple[tuple[int, ...], ...]:
    expected, example = "a list for each output, with 1, -1 or 0 for each input", "[[1, -1], [1, 1]]"
    rows = [_items(row, expected, example) for row in _items(value, expected, example)]
    if any(isinstance(sign, bool) or sign not in (1, 0, -1) for row in rows for sign in row):
        raise UnitError("it", "has an item that is none of 1, -1 and 0", expected, example)
    return tuple(tuple(int(sign) for sign in row) for row in rows)


_LENGTH = Quantity("m", "mm")
Columns = Annotated[tuple[Column, ...] | None, PlainValidator(_columns)]
Axes = Annotated[tuple[str, ...] | None, PlainValidator(_axes)]
Accepted = Annotated[tuple[str, ...] | None, PlainValidator(_words(ACCEPTABLE, '["drift"]'))]
Positions = Annotated[tuple[tuple[float, float], ...] | None, PlainValidator(_positions)]
Signs = Annotated[tuple[tuple[int, ...], ...] | None, PlainValidator(_signs)]
Samples = Annotated[int, Whole("", least=2, most=1_000_000_000)]


# ------------------------------------------------------------------------------------------------------------- tables
class ChannelsTable(Table):
    """Where the channels of a recording are, in which units, and how fast they were sampled."""

    input: Columns = Field(None, description="the drives: name, number from 0, or a list")
    output: Columns = Field(None, description="the sensors: the same")
    rate_hz: Frequency | None = Field(None, description="sample rate where the file states none")
    time: Columns = Field(None, description="the time column, to read the rate off")
    period: Samples | None = Field(None, description="samples in a period of a periodic drive")
    axes: Axes = Field(None, description="what each axis of an array is, in its order")
    input_unit: Literal["V", "mV"] | None = None
    output_unit: Literal["rad", "mrad", "urad", "m", "mm", "um"] | None = None
    accept: Accepted = Field(None, description="findings of the checks that are taken on")


class RecordingTable(ChannelsTable):
    """One recording, or the realisations in one array."""

    file: Annotated[str, Field(min_length=1)]
    output_file: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="outputs in an array of their own"
    )
    from_s: DurationOrZero = Field(0.0, description="where the part that is read begins")
    to_s: Duration | None = Field(None, description="where it ends; left out, with the recording")
    role: Literal["loops", "broadband", "validation"] | None = Field(None, description="left out, the drive tells")

    def problems(self) -> Iterator[Problem]:
        """A part that begins before it ends."""
        if self.to_s is not None and not self.from_s < self.to_s:
            yield Problem("to", "is not above from", "a later time")


class ListTable(ChannelsTable):
    """The root of a list: what holds for all recordings, what is known of the mirror, and the tables of recordings."""

    name: Name | None = Field(None, description="of the mirror")
    lever_arm_m: Annotated[float, Quantity("m", "mm", above=0.0)] | None = Field(
        None, description="from the axis of rotation to the point measured, of one output"
    )
    positions: Positions = Field(None, description="where each output is measured on the mirror")
    signs: Signs = Field(None, description="the way each output moves with each drive at low frequency")
    recording: dict[str, Any] = Field(description="tables [recording.NAME]")


# ------------------------------------------------------------------------------------------------------------ reading
def read_list(path: str | Path) -> RecordingsList:
    """Read a list of recordings, and the recordings that it names.

    Args:
        path: The list, a TOML file. Names of files in it are seen from its folder.

    Raises:
        RecordingsError: With every fault of the list.
        RecordingError: For a recording that cannot be used.
    """
    path = Path(path)
    try:
        document = Document.read(path, "list of recordings")
    except UnreadableError as error:
        expected = "a list of recordings, with a table [recording.NAME] for each"
        fault = Fault("", "", 0, f"the list of recordings {error.reason}", expected, file=clipped(str(path)))
        raise RecordingsError(path, [fault]) from None
    except MissionError as error:
        raise RecordingsError(path, error.faults) from None
    tables = _tables(document)
    root = check_table(document, ListTable, document.data)
    entries = {name: _entry(document, name, table, root) for name, table in tables.items()}
    _note_overlaps(document, {name: entry for name, entry in entries.items() if entry is not None})
    if root is None or document.faults:
        raise RecordingsError(path, document.faults)
    recordings: list[Recording] = []
    validation: list[Recording] = []
    for name, entry in entries.items():
        assert entry is not None
        found = _read(path, name, entry)
        (validation if entry.role == "validation" else recordings).extend(found)
    if not recordings:
        raise RecordingError(f"{path}: every recording is for validation; leave one without a role, to be fitted.")
    _check_channels(path, root, recordings, validation)
    return RecordingsList(tuple(recordings), tuple(validation), root.name, root.lever_arm_m, root.positions, root.signs)


def _tables(document: Document) -> dict[str, object]:
    """The tables [recording.NAME]; anything else under that name is noted, and what is left can be checked."""
    found = document.data.get("recording")
    if isinstance(found, dict) and 0 < len(found) <= MOST_ITEMS:
        return dict(found)
    if not any(key.partition(".")[0] == "recording" for key in document.damaged):
        reason = "is missing" if found is None else "is no group of named tables"
        document.fault("recording", "", reason, "a table [recording.NAME] for each recording, with its file")
    document.data["recording"] = {}
    return {}


def _entry(document: Document, name: str, table: object, root: ListTable | None) -> RecordingTable | None:
    """One recording with what the list says for all, or None with every fault in it noted."""
    key = f"recording.{name}"
    if not isinstance(table, dict):
        document.fault(key, shown(table), "is no table", f"[{key}] with its file below it")
        return None
    entry = check_table(replace(document, prefix=key), RecordingTable, table)
    if entry is None or root is None:
        return None
    common = {each: getattr(root, each) for each in ChannelsTable.model_fields if getattr(entry, each) is None}
    entry = entry.model_copy(update=common)
    for each in ("input", "output"):
        if entry.axes is None and getattr(entry, each) is None:
            document.fault(f"{key}.{each}", "", "is missing", f'{each} = "name of the channel", here or for all')
        if entry.axes is not None and len(getattr(entry, each) or ()) > 1:
            document.fault(f"{key}.{each}", "", "names several arrays, beside axes", "one array with all channels")
    if entry.time is not None and (entry.axes is not None or len(entry.time) > 1):
        document.fault(f"{key}.time", "", "is no column of this recording", "one column, of a file without axes")
    if entry.output_file is not None and entry.axes is None:
        document.fault(f"{key}.output_file", "", "stands without axes", "axes, which say what the arrays hold")
    return entry


def _note_overlaps(document: Document, entries: Mapping[str, RecordingTable]) -> None:
    """Note samples that are fitted and for validation, too."""
    fitted = {name: entry for name, entry in entries.items() if entry.role != "validation"}
    for name in [name for name in entries if name not in fitted]:
        mine = entries[name]
        for other, theirs in fitted.items():
            files = [_files(document.path.parent, each) for each in (mine, theirs)]
            if files[0] == files[1] and _begins_before_end(mine, theirs) and _begins_before_end(theirs, mine):
                reason = f"takes samples for validation that [recording.{other}] fits"
                document.fault(
                    f"recording.{name}", "", reason, "two parts of the file (from, to) without common samples"
                )


def _files(folder: Path, entry: RecordingTable) -> tuple[str, str]:
    """The files of drives and outputs, however they are spelled."""
    return os.path.realpath(folder / entry.file), os.path.realpath(folder / (entry.output_file or entry.file))


def _begins_before_end(one: RecordingTable, other: RecordingTable) -> bool:
    return other.to_s is None or one.from_s < other.to_s


def _read(path: Path, name: str, entry: RecordingTable) -> tuple[Recording, ...]:
    """The recordings of an entry, in the units and with the role that it says."""
    folder, axes = path.parent, entry.axes
    with _named(f"{path}, [recording.{name}]"):
        found = _read_columns(folder, entry) if axes is None else _read_arrays(folder, entry, axes)
        return tuple(replace(_in_units(each, entry), role=entry.role or "") for each in found)


@contextmanager
def _named(place: str) -> Iterator[None]:
    """Name the place in the list in front of what is wrong with a recording."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"{place}: {error}", error.findings) from None


def _read_columns(folder: Path, entry: RecordingTable) -> tuple[Recording, ...]:
    found = read_recording(
        folder / entry.file,
        entry.input or (),
        entry.output or (),
        entry.rate_hz,
        time=None if entry.time is None else entry.time[0],
        period_samples=entry.period,
        part_s=(entry.from_s, entry.to_s),
        accept=entry.accept or (),
        alone=False,
    )
    return (found,)


def _read_arrays(folder: Path, entry: RecordingTable, axes: tuple[str, ...]) -> tuple[Recording, ...]:
    return read_arrays(
        folder / entry.file,
        None if entry.input is None else str(entry.input[0]),
        None if entry.output is None else str(entry.output[0]),
        entry.rate_hz,
        axes=axes,
        output_path=None if entry.output_file is None else folder / entry.output_file,
        period_samples=entry.period,
        part_s=(entry.from_s, entry.to_s),
        accept=entry.accept or (),
        alone=False,
    )


def _in_units(recording: Recording, entry: RecordingTable) -> Recording:
    """The recording with the units that its entry says, which must be those of its file where that says some."""
    if entry.input_unit is not None:
        check_stated(recording, "input", entry.input_unit)
        recording = replace(recording, input_units=(entry.input_unit,) * recording.drive.shape[1])
    if entry.output_unit is not None:
        check_stated(recording, "output", entry.output_unit)
        recording = replace(recording, output_units=(entry.output_unit,) * recording.output.shape[1])
    return recording


def _check_channels(
    path: Path, root: ListTable, recordings: Sequence[Recording], validation: Sequence[Recording]
) -> None:
    """Raises RecordingError if positions or signs are not those of the channels."""
    inputs, outputs = recordings[0].drive.shape[1], recordings[0].output.shape[1]
    if any(r.drive.shape[1] > 1 or r.output.shape[1] > 1 for r in (*recordings, *validation)):
        with _named(str(path)):
            check_together(recordings, validation)
    if root.positions is not None and len(root.positions) != outputs:
        raise RecordingError(
            f"{path}: positions has {len(root.positions)} places and there are {counted(outputs, 'output')}, "
            f"{', '.join(recordings[0].output_names)}; give one place for each, in their order."
        )
    if root.signs is not None and [len(row) for row in root.signs] != [inputs] * outputs:
        raise RecordingError(
            f"{path}: signs has rows of {', '.join(str(len(row)) for row in root.signs)} items and there are "
            f"{counted(outputs, 'output')} and {counted(inputs, 'input')}; give a row for "
            "each output, with an item for each input."
        )
