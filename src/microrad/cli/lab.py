"""Commands for the laboratory: a mirror from recordings, and recordings from the virtual bench."""

import functools
import os
import shlex
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from microrad.cli.coupled import Target, identify_channels, refuse_options
from microrad.cli.frame import (
    PROGRESS_FILE,
    Json,
    Outcome,
    Overwrite,
    Refusal,
    app,
    check_target,
    command,
    examples,
    json_text,
    option,
    progress_bar,
    quantity_of,
    width,
)
from microrad.cli.recordings import Given, Options, common_name, given_recordings, unit_of
from microrad.core.folder import path_argument, write_whole

if TYPE_CHECKING:
    from microrad.lab.identify import Identification

MIRROR_FILE_BEGINS = "# Mirror identified from"


class Model(StrEnum):
    """Which model the mirror file holds: the best one, or one of identify.MODELS."""

    BEST = "best"
    PRANDTL_ISHLINSKII = "prandtl-ishlinskii"
    BOUC_WEN = "bouc-wen"
    BOUC_WEN_ADMISSIBLE = "bouc-wen-admissible"
    LINEAR = "linear"
    BOUC_WEN_CLASSICAL = "bouc-wen-classical"
    BOUC_WEN_JOINT = "bouc-wen-joint"
    BOUC_WEN_ASYMMETRIC = "bouc-wen-asymmetric"
    BOUC_WEN_CREEP = "bouc-wen-creep"
    PRANDTL_ISHLINSKII_JOINT = "prandtl-ishlinskii-joint"
    PRANDTL_ISHLINSKII_RATE = "prandtl-ishlinskii-rate"
    PRANDTL_ISHLINSKII_CREEP = "prandtl-ishlinskii-creep"
    PRANDTL_ISHLINSKII_RATE_CREEP = "prandtl-ishlinskii-rate-creep"


def _rate(text: str) -> float:
    """A rate in Hz, the unit of which may be left out."""
    try:
        float(text)
    except ValueError:
        return quantity_of("Hz")(text)
    return quantity_of("Hz")(f"{text} Hz")


def _place(text: str) -> tuple[float, float]:
    """A place on the mirror, two lengths with a comma between them."""
    parts = text.split(",")
    if len(parts) != 2:
        raise typer.BadParameter(f"'{text}' is no place; give x and y as '12 mm,-6 mm'.")
    x, y = (quantity_of("m")(part.strip()) for part in parts)
    return x, y


_FILES = (
    "Recordings (CSV, text, LVM, TDMS, MAT, NPY, NPZ, HDF5); or one list of recordings (.toml), which says columns, "
    "units, part and role of each; or one folder that microrad bench wrote."
)
_INPUT = "Drive: name, or number from 0; repeat it for several. With --axes the array that holds all drives."
_OUTPUT = "Angle or displacement: the same."
_AXES = (
    "Read whole arrays (NPY, NPZ, MAT, HDF5), whose axes are these, in the array's order: some of samples,channels,"
    "realisations,periods. Each realisation is a recording."
)
_OUTPUT_FILE = (
    "File of the outputs where FILE has the drives alone; repeat it in the order of FILE..., then --validate."
)
_POSITION = "Where an output is measured on the mirror: '12 mm,-6 mm'; repeat it in the order of the outputs."
_OUTPUT_UNITS = (
    "rad, mrad or urad; m, mm or um with --lever-arm, or of several outputs [default: what the file says, else mrad]."
)
_INPUT_UNITS = "V or mV [default: what the file says, else V]."
_LEVER_ARM = "From the axis of rotation to the point measured: '50 mm'."
_NAME = (
    "Name of the mirror [default: the recording's; of several what all their names begin with, else their folder's]."
)
_MIRROR_FILE = "File to write [default: that name, and -mirror.toml, in the current folder]."
_REPORT_FILE = "Report to write [default: <name of the mirror file>.html beside it]."
_RATE = "Sample rate: 200, '200 Hz' or '50 kHz' [default: what the file says]."
_HOLD_OUT = "Kept for the check, at each recording's end [default: 0.5; 0 with --validate]."
_VALIDATE = "Recording that no fit sees; may be repeated."
_ACCEPT = "Go on in spite of a finding of the checks; may be repeated. The refusal names it."
_MEASURED = "The drive was measured, so it is straight between samples; by default it is what a converter was told."
_STATIC = "Fit the hysteresis alone, two models, in seconds."


@app.command(
    epilog=examples(
        "microrad identify loop.tdms --input Bench/drive --output Bench/angle",
        "microrad identify 60Hz.csv 80Hz.csv chirp.csv --input 1 --output 2 --rate '50 kHz' --validate 100Hz.csv",
        "microrad identify piezo.dat --input 0 --output 4 --rate '200 Hz' --output-unit um --lever-arm '50 mm'",
        "microrad identify mirror-characterisation-bench",
        "microrad identify axes.csv --input ux --input uy --output x --output y --output-unit urad",
        "microrad identify u.npy --output-file y.npy --axes samples,channels,realisations,periods --rate '6400 Hz' "
        "--output-unit m",
        "microrad identify recordings.toml",
        "microrad run leo-geo.toml --mirror loop-mirror.toml --output loop-mirror-study",
    )
)
@command
def identify(  # noqa: PLR0913  every argument is a named option
    files: Annotated[list[Path], typer.Argument(help=_FILES, metavar="FILE...")],
    *,
    input_column: Annotated[list[str] | None, option("--input", "COLUMN", _INPUT)] = None,
    output_column: Annotated[list[str] | None, option("--output", "COLUMN", _OUTPUT)] = None,
    output_file: Annotated[list[Path] | None, option("--output-file", "FILE", _OUTPUT_FILE)] = None,
    axes: Annotated[str | None, option("--axes", "WORDS", _AXES)] = None,
    rate: Annotated[float | None, option("--rate", "HZ", _RATE, parser=_rate)] = None,
    time: Annotated[str | None, option("--time", "COLUMN", "Time (s), to read the rate off.")] = None,
    period: Annotated[int | None, option("--period", "SAMPLES", "Length of a period of a periodic drive.")] = None,
    accept: Annotated[list[str] | None, option("--accept", "FINDING", _ACCEPT)] = None,
    validate: Annotated[list[Path] | None, option("--validate", "FILE", _VALIDATE)] = None,
    output_unit: Annotated[str | None, option("--output-unit", "UNIT", _OUTPUT_UNITS)] = None,
    input_unit: Annotated[str | None, option("--input-unit", "UNIT", _INPUT_UNITS)] = None,
    lever_arm: Annotated[float | None, option("--lever-arm", "LENGTH", _LEVER_ARM, parser=quantity_of("m"))] = None,
    position: Annotated[list[Any] | None, option("--position", "X,Y", _POSITION, parser=_place)] = None,
    measured_drive: Annotated[bool, typer.Option("--measured-drive", help=_MEASURED)] = False,
    hold_out: Annotated[float | None, option("--hold-out", "SHARE", _HOLD_OUT)] = None,
    static: Annotated[bool, typer.Option("--static", help=_STATIC)] = False,
    model: Annotated[Model, typer.Option(help="Model that the mirror file holds.")] = Model.BEST,
    admissible: Annotated[bool, typer.Option("--admissible", help="No Bouc-Wen model moving the wrong way.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scattered starts of the Bouc-Wen fits.")] = 0,
    name: Annotated[str | None, option("--name", "TEXT", _NAME)] = None,
    mirror_file: Annotated[Path | None, option("--mirror-file", "FILE", _MIRROR_FILE)] = None,
    report_file: Annotated[Path | None, option("--report", "FILE", _REPORT_FILE)] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> Outcome:
    """Fit a mirror model to recordings.

    Checks the recordings, takes the linear part from broadband ones and the hysteresis from loops, fits a dozen models
    to part of the samples and judges them on the rest. The best one is written as a mirror file, and everything as a
    report. A column is given by its name or by its number, counted from 0.

    Of several drives or outputs, models of all channels are ranked on held-out recordings, and the smallest one within
    noise of the best is written; Ctrl-C ends that with the best one so far.
    """
    from microrad import report

    called = common_name(files)
    target = mirror_file or Path(f"{called}-mirror.toml")
    page = report_file or target.with_suffix(".html")
    if page.resolve() == target.resolve():
        raise Refusal(f"{page} cannot be both the mirror file and the report; name another one with --report.")
    advice, begins = "name another one with --mirror-file", MIRROR_FILE_BEGINS.encode()
    check = functools.partial(check_target, target, advice, overwrite=overwrite, begins=begins)
    check()
    report.check_identification(page, overwrite)
    given = given_recordings(
        Options(
            files=tuple(files),
            input=tuple(input_column or ()),
            output=tuple(output_column or ()),
            output_file=tuple(output_file or ()),
            axes=axes,
            rate=rate,
            time=time,
            period=period,
            accept=tuple(accept or ()),
            validate=tuple(validate or ()),
            position=tuple(position or ()),
            lever_arm=lever_arm,
            input_unit=input_unit,
            output_unit=output_unit,
        )
    )
    title = name if name is not None else given.name or called[:200]
    drive, drive_by = unit_of(given, "input", input_unit, "V")
    output, output_by = unit_of(given, "output", output_unit, "mrad")
    said = f"drive in {drive} ({drive_by}), output in {output} ({output_by})"
    if not title.strip():
        raise Refusal("the mirror has no name; give one with --name, it stands in the mirror file and in the report.")
    written = Target(target, page, title, overwrite, check)
    if given.several_channels:
        one_axis = {
            "--measured-drive": measured_drive,
            "--static": static,
            "--model": model is not Model.BEST,
            "--admissible": admissible,
            "--seed": seed != 0,
            "--hold-out": hold_out is not None,
            "--lever-arm": given.lever_arm_m is not None,
        }
        refuse_options(given, one_axis)
        return identify_channels(given, (drive, output), said, written, as_json)
    if given.positions_m is not None or given.signs is not None:
        raise Refusal("positions and signs are for several outputs or drives: leave out --position, or name them all.")
    how = _Fits(model, static, admissible, measured_drive, hold_out, seed)
    return _identify_axis(given, (drive, output), said, written, how, as_json)


@dataclass(frozen=True, slots=True)
class _Fits:
    """Which models of one axis are fitted, and which of them is written."""

    model: Model
    static: bool
    admissible: bool
    measured_drive: bool
    hold_out: float | None
    seed: int


def _identify_axis(
    given: Given, units: tuple[str, str], said: str, target: Target, how: _Fits, as_json: bool
) -> Outcome:
    """Identify a mirror of one drive and one output, and write its file and report; `said` begins the text."""
    from microrad import report
    from microrad.lab import identify as identification
    from microrad.lab.live_fit import live_fit_writer

    models = identification.STATIC[:2] if how.static else identification.MODELS
    live = os.environ.get(PROGRESS_FILE)
    with progress_bar() as bar:
        found = identification.identify(
            given.recordings,
            how.hold_out,
            how.seed,
            _wanted(models, how.model),
            bar,
            validation=given.validation,
            admissible=how.admissible,
            hold="first-order" if how.measured_drive else "zero-order",
            output_unit=units[1],
            lever_arm_m=given.lever_arm_m,
            input_unit=units[0],
            on_fit=live_fit_writer(live),
            side_by_side=not live,
        )
    if found.unsupported:
        raise Refusal(found.unsupported)
    written = _written(found, how.model, how.admissible)
    text = identification.mirror_file_text(found, target.title, model=written)
    data = {"mirror_file": target.mirror_file, "report_file": target.page}
    outcome = Outcome(
        json_text(report.identification_data(found, written, **data))
        if as_json
        else f"{said}\n\n" + report.identification_text(found, written, width(), **data)
    )
    target.check()  # the file may have appeared meanwhile
    report.write_identification(
        found,
        target.page,
        mirror_file=target.mirror_file,
        mirror_text=text,
        title=target.title,
        written=written,
        recordings=given.recordings,
        overwrite=target.overwrite,
        virtual=given.virtual,
    )
    write_whole(target.mirror_file, text)
    return outcome


def _wanted(models: tuple[str, ...], model: Model) -> tuple[str, ...]:
    """The models to fit: those of the ladder, and the one that the mirror file is to hold."""
    chosen = model.replace("-", "_")
    return models if model is Model.BEST or chosen in models else (*models, chosen)


def _written(found: "Identification", model: Model, admissible: bool) -> str:
    chosen = found.chosen if model is Model.BEST else model.replace("-", "_")
    return "bouc_wen_admissible" if admissible and chosen == "bouc_wen" else chosen


# -------------------------------------------------------------------------------------------------------------- bench
_PLAN = "Plan file, or the name of a packaged plan: paper-experiment, mirror-characterisation."
_BENCH_FOLDER = "Folder to write [default: <name of the plan>-bench in the current folder]."


@app.command(
    epilog=examples(
        "microrad bench paper-experiment",
        "microrad bench mirror-characterisation --output bench --seed 7",
        "microrad bench my-plan.toml --overwrite",
    )
)
@command
def bench(
    plan: Annotated[str, typer.Argument(help=_PLAN)],
    output: Annotated[Path | None, option("--output", "FOLDER", _BENCH_FOLDER)] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> Outcome:
    """Play an excitation plan into the virtual bench.

    Designs the excitations of a plan within the limits that it states, plays them into a mirror that is none of the
    models that microrad fits, and writes the files that a laboratory would have.
    """
    from microrad.lab import bench as virtual

    found = virtual.load_plan(plan)
    folder = output or Path(f"{Path(plan).stem}-bench")
    virtual.check_folder(folder, overwrite)
    with progress_bar() as progress:
        files = virtual.write_folder(found, folder, seed, overwrite, progress)
    if as_json:
        return Outcome(json_text({"plan": found.name, "folder": str(folder), "files": [str(f) for f in files]}))
    listed = "\n".join(map(str, files))
    next_one = shlex.join(["microrad", "identify", path_argument(folder)])
    return Outcome(f"{listed}\n\n{len(files)} files written. Next: {next_one}")
