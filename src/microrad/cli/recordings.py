"""The recordings that a command line names: by options, by a list, or by the folder of a virtual bench."""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from microrad.cli.frame import Refusal

if TYPE_CHECKING:
    from microrad.lab.recording import Recording

_WITH_BENCH = ("accept", "position", "lever_arm", "input_unit", "output_unit")
_LEAST_NAME = 3  # characters; what several names have in common says nothing where it is shorter


@dataclass(frozen=True, slots=True)
class Options:
    """What the options say of the recordings: each field is called as its option, None or empty where it is not given.

    `position` holds (x, y) in m for each output.
    """

    files: tuple[Path, ...]
    input: tuple[str, ...] = ()
    output: tuple[str, ...] = ()
    output_file: tuple[Path, ...] = ()
    axes: str | None = None
    rate: float | None = None
    time: str | None = None
    period: int | None = None
    accept: tuple[str, ...] = ()
    validate: tuple[Path, ...] = ()
    position: tuple[tuple[float, float], ...] = ()
    lever_arm: float | None = None
    input_unit: str | None = None
    output_unit: str | None = None


@dataclass(frozen=True, slots=True)
class Given:
    """The recordings, those to fit and those for validation, and what is known of the mirror.

    `virtual` says that they come from the virtual bench; `name` is what a list calls the mirror. `positions_m` and
    `signs` are those of `recording.list_file.RecordingsList`.
    """

    recordings: tuple["Recording", ...]
    validation: tuple["Recording", ...]
    virtual: bool = False
    name: str | None = None
    lever_arm_m: float | None = None
    positions_m: tuple[tuple[float, float], ...] | None = None
    signs: tuple[tuple[int, ...], ...] | None = None

    @property
    def every(self) -> tuple["Recording", ...]:
        """All recordings."""
        return (*self.recordings, *self.validation)

    @property
    def channels(self) -> tuple[int, int]:
        """The largest number of inputs, and of outputs."""
        return max(r.drive.shape[1] for r in self.every), max(r.output.shape[1] for r in self.every)

    @property
    def several_channels(self) -> bool:
        """Whether a recording has more than one input or output."""
        return max(self.channels) > 1


def given_recordings(options: Options) -> Given:
    """Read the recordings that the options name.

    Raises:
        Refusal: Where the options do not say what they have to, or what they cannot.
        RecordingError: For a recording that cannot be used.
        MissionError: For a list with faults.
    """
    if len(options.files) == 1 and options.files[0].is_dir():
        return _of_bench(options)
    if len(options.files) == 1 and options.files[0].suffix == ".toml":
        return _of_list(options)
    files = (*options.files, *options.validate)
    if lists := [path for path in files if path.suffix == ".toml"]:
        raise Refusal(f"{lists[0]} is a list of recordings: give it alone, and name the other files in it.")
    read = _reader(options)
    if options.output_file and len(options.output_file) != len(files):
        raise Refusal(
            f"--output-file is given {len(options.output_file)} times and there are {len(files)} files of drives; give "
            "one for each FILE, and then for each --validate, in their order."
        )
    pairs = list(zip(files, options.output_file or [None] * len(files), strict=True))
    found = [read(*pair) for pair in pairs]
    split = len(options.files)
    recordings, validation = (tuple(r for each in part for r in each) for part in (found[:split], found[split:]))
    return _together(Given(recordings, validation, lever_arm_m=options.lever_arm, positions_m=options.position or None))


def _together(given: Given) -> Given:
    """What was read, where the recordings of several channels can be identified from together."""
    from microrad.lab.recording import check_together

    if not given.recordings:
        raise Refusal("every recording is for validation: leave one to be fitted.")
    if given.several_channels:
        check_together(given.recordings, given.validation)
    outputs = given.channels[1]
    if given.positions_m is not None and len(given.positions_m) != outputs:
        raise Refusal(
            f"--position is given {len(given.positions_m)} times and there are {outputs} outputs: give one for each, "
            "in their order."
        )
    return given


def _reader(options: Options) -> Callable[[Path, Path | None], tuple["Recording", ...]]:
    """What reads a file, with the file of its outputs where they have one: whole arrays, or columns."""
    from microrad.lab.recording import read_arrays, read_recording

    if options.axes is not None:
        if options.time is not None or max(len(options.input), len(options.output)) > 1:
            wrong = "--time" if options.time is not None else "a second --input or --output"
            raise Refusal(f"--axes reads whole arrays, one of drives and one of outputs: leave out {wrong}.")
        axes = [word.strip() for word in options.axes.split(",")]
        return lambda path, outputs: read_arrays(
            path,
            next(iter(options.input), None),
            next(iter(options.output), None),
            options.rate,
            axes=axes,
            output_path=outputs,
            period_samples=options.period,
            accept=options.accept,
            alone=False,
        )
    if options.output_file:
        raise Refusal("--output-file is for whole arrays: say with --axes what their axes are.")
    for flag, said, what in (("--input", options.input, "drive"), ("--output", options.output, "sensor")):
        if not said:
            raise Refusal(f"{flag} is missing: name the column of the {what}.")
    return lambda path, outputs: (
        read_recording(
            path,
            options.input,
            options.output,
            options.rate,
            time=options.time,
            period_samples=options.period,
            accept=options.accept,
            alone=False,
        ),
    )


def _refuse_others(options: Options, taken: tuple[str, ...], what: str) -> None:
    """Refuse the options that go with files alone; `what` was given in place of them."""
    for each in fields(options):
        if each.name not in ("files", *taken) and getattr(options, each.name) not in (None, ()):
            flag = f"--{each.name.replace('_', '-')}"
            raise Refusal(f"{options.files[0]} is {what.format(flag=flag)}.")


def _of_bench(options: Options) -> Given:
    from microrad.lab import bench

    _refuse_others(
        options, _WITH_BENCH, "a folder, as of a bench, and {flag} is for files: leave it out, or name the files"
    )
    found = bench.read_folder(options.files[0], options.accept)
    recordings, validation = (tuple(r for r, of in found if of == use) for use in ("identification", "validation"))
    return _together(
        Given(recordings, validation, virtual=True, lever_arm_m=options.lever_arm, positions_m=options.position or None)
    )


def _of_list(options: Options) -> Given:
    from microrad.lab.recording.list_file import read_list

    path = options.files[0]
    _refuse_others(options, (), "a list of recordings and {flag} is for files: write it into the list instead")
    found = read_list(path)
    return Given(
        found.recordings,
        found.validation,
        name=found.name,
        lever_arm_m=found.lever_arm_m,
        positions_m=found.positions_m,
        signs=found.signs,
    )


def unit_of(given: Given, which: str, option: str | None, assumed: str) -> tuple[str, str]:
    """The unit of the drives or the outputs, and where it comes from: option or files, which must agree, or neither.

    Args:
        given: The recordings.
        which: "input" or "output".
        option: The unit that the option says, None where it is not given.
        assumed: The unit where nobody says one.

    Raises:
        Refusal: Where option and files, or two files, say different units.
    """
    from microrad.lab.recording import stated_units

    flag = f"--{which}-unit"
    said: dict[str, str] = {}
    for recording in given.every:
        names, units = getattr(recording, f"{which}_names"), getattr(recording, f"{which}_units")
        for unit in sorted(stated_units(units, names)):
            said.setdefault(unit, recording.path)
    if option is not None:
        if said and set(said) != {option}:
            raise Refusal(
                f"{flag} is {option} and the files say {', '.join(sorted(said))}: give what the files say, or neither."
            )
        return option, "given"
    if len(said) > 1:
        places = ", ".join(f"{unit} ({path})" for unit, path in said.items())
        raise Refusal(f"the files say different units of the {which}, {places}: identify them apart, or convert them.")
    return (next(iter(said)), "stated in the files") if said else (assumed, f"assumed, {flag} says otherwise")


def common_name(files: Sequence[Path]) -> str:
    """What a mirror is called that several files are of: how all their names begin, else their folder, else the first.

    Args:
        files: The files, at least one.
    """
    stems = [(file.resolve() if file.name in ("", "..") else file).stem for file in files]
    if len(set(stems)) == 1:
        return stems[0]
    # Runs of letters, of digits and of other characters, so that no word or number is cut in two.
    words = [re.findall(r"[^\W\d_]+|\d+|[\W_]+", stem) for stem in stems]
    alike = itertools.takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False))
    begin = re.sub(r"[\W_]+$", "", "".join(each[0] for each in alike))
    if len(begin) >= _LEAST_NAME:
        return begin
    folders = {file.resolve().parent for file in files}
    return (folders.pop().name if len(folders) == 1 else "") or stems[0]
