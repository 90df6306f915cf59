"""Commands for the laboratory: a mirror from recordings, and recordings from the virtual bench."""

import functools
import os
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    width,
)
from microrad.core.folder import write_whole

if TYPE_CHECKING:
    from microrad.lab.identify import Identification
    from microrad.lab.recording import Recording

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


def _quantity(unit: str) -> Callable[[str], float]:
    """A parser of an option's quantity, whose refusal typer shows with the name of the option."""

    def parse(text: str) -> float:
        from microrad.core.units import UnitError, parse_quantity

        try:
            return parse_quantity(text, unit)
        except UnitError as error:
            raise typer.BadParameter(str(error)) from None

    return parse


def _rate(text: str) -> float:
    """A rate in Hz, the unit of which may be left out."""
    try:
        float(text)
    except ValueError:
        return _quantity("Hz")(text)
    return _quantity("Hz")(f"{text} Hz")


_FILES = "Recordings (CSV, text, LVM, TDMS, MAT, NPY, NPZ, HDF5), or one folder that microrad bench wrote."
_OUTPUT_UNITS = "rad, mrad or urad; with --lever-arm also m, mm or um [default: what the file says, else mrad]."
_INPUT_UNITS = "V or mV [default: what the file says, else V]."
_LEVER_ARM = "From the axis of rotation to the point measured: '50 mm'."
_MIRROR_FILE = "File to write [default: <name of the recording>-mirror.toml in the current folder]."
_REPORT_FILE = "Report to write [default: <name of the mirror file>.html beside it]."
_RATE = "Sample rate: 200, '200 Hz' or '50 kHz' [default: what the file says]."
_HOLD_OUT = "Kept for the check, at each recording's end [default: 0.5; 0 with --validate]."
_VALIDATE = "Recording that no fit sees; may be repeated."
_ACCEPT = "Go on in spite of a finding of the checks; may be repeated. The refusal names it."
_STATIC = "Fit the hysteresis alone, two models, in seconds."


@app.command(
    epilog=examples(
        "microrad identify loop.tdms --input Bench/drive --output Bench/angle",
        "microrad identify 60Hz.csv 80Hz.csv chirp.csv --input 1 --output 2 --rate '50 kHz' --validate 100Hz.csv",
        "microrad identify piezo.dat --input 0 --output 4 --rate '200 Hz' --output-unit um --lever-arm '50 mm'",
        "microrad identify mirror-characterisation-bench",
        "microrad run leo-geo.toml --mirror loop-mirror.toml --output loop-mirror-study",
    )
)
@command
def identify(  # noqa: PLR0913  every argument is a named option
    files: Annotated[list[Path], typer.Argument(help=_FILES, metavar="FILE...")],
    *,
    input_column: Annotated[str | None, option("--input", "COLUMN", "Drive: name, or number from 0.")] = None,
    output_column: Annotated[str | None, option("--output", "COLUMN", "Angle or displacement: the same.")] = None,
    rate: Annotated[float | None, option("--rate", "HZ", _RATE, parser=_rate)] = None,
    time: Annotated[str | None, option("--time", "COLUMN", "Time (s), to read the rate off.")] = None,
    period: Annotated[int | None, option("--period", "SAMPLES", "Length of a period of a periodic drive.")] = None,
    accept: Annotated[list[str] | None, option("--accept", "FINDING", _ACCEPT)] = None,
    validate: Annotated[list[Path] | None, option("--validate", "FILE", _VALIDATE)] = None,
    output_unit: Annotated[str | None, option("--output-unit", "UNIT", _OUTPUT_UNITS)] = None,
    input_unit: Annotated[str | None, option("--input-unit", "UNIT", _INPUT_UNITS)] = None,
    lever_arm: Annotated[float | None, option("--lever-arm", "LENGTH", _LEVER_ARM, parser=_quantity("m"))] = None,
    hold_out: Annotated[float | None, option("--hold-out", "SHARE", _HOLD_OUT)] = None,
    static: Annotated[bool, typer.Option("--static", help=_STATIC)] = False,
    model: Annotated[Model, typer.Option(help="Model that the mirror file holds.")] = Model.BEST,
    admissible: Annotated[bool, typer.Option("--admissible", help="No Bouc-Wen model moving the wrong way.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scattered starts of the Bouc-Wen fits.")] = 0,
    name: Annotated[str | None, option("--name", "TEXT", "Name of the mirror [default: the recording's].")] = None,
    mirror_file: Annotated[Path | None, option("--mirror-file", "FILE", _MIRROR_FILE)] = None,
    report_file: Annotated[Path | None, option("--report", "FILE", _REPORT_FILE)] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> Outcome:
    """Fit a mirror model to recordings.

    Checks the recordings, takes the linear part from broadband ones and the hysteresis from loops, fits a dozen models
    to part of the samples and judges them on the rest. The best one is written as a mirror file, and everything as a
    report. A column is given by its name or by its number, counted from 0.
    """
    from microrad import report
    from microrad.lab import identify as identification
    from microrad.lab.live_fit import live_fit_writer
    from microrad.lab.recording import stated_units

    target = mirror_file or Path(f"{files[0].stem}-mirror.toml")
    page = report_file or target.with_suffix(".html")
    if page.resolve() == target.resolve():
        raise Refusal(f"{page} cannot be both the mirror file and the report; name another one with --report.")
    advice, begins = "name another one with --mirror-file", MIRROR_FILE_BEGINS.encode()
    check = functools.partial(check_target, target, advice, overwrite=overwrite, begins=begins)
    check()
    report.check_identification(page, overwrite)
    columns = _Columns(input_column, output_column, rate, time, period, tuple(accept or ()))
    records, validation, virtual = _recordings(files, validate or [], columns)
    everything = [*records, *validation]
    drive_said = set().union(*(stated_units(r.input_units, r.input_names) for r in everything))
    output_said = set().union(*(stated_units(r.output_units, r.output_names) for r in everything))
    input_unit, drive_by = _unit(input_unit, drive_said, "--input-unit", "V")
    output_unit, output_by = _unit(output_unit, output_said, "--output-unit", "mrad")
    models = identification.STATIC[:2] if static else identification.MODELS
    live = os.environ.get(PROGRESS_FILE)
    with progress_bar() as bar:
        found = identification.identify(
            records,
            hold_out,
            seed,
            _wanted(models, model),
            bar,
            validation=validation,
            admissible=admissible,
            output_unit=output_unit,
            lever_arm_m=lever_arm,
            input_unit=input_unit,
            on_fit=live_fit_writer(live),
            side_by_side=not live,
        )
    if found.unsupported:
        raise Refusal(found.unsupported)
    written = _written(found, model, admissible)
    title = files[0].stem[:200] if name is None else name
    text = identification.mirror_file_text(found, title, model=written)
    data = {"mirror_file": target, "report_file": page}
    outcome = Outcome(
        json_text(report.identification_data(found, written, **data))
        if as_json
        else f"drive in {input_unit} ({drive_by}), output in {output_unit} ({output_by})\n\n"
        + report.identification_text(found, written, width(), **data)
    )
    check()  # the file may have appeared meanwhile
    report.write_identification(
        found,
        page,
        mirror_file=target,
        mirror_text=text,
        title=title,
        written=written,
        recordings=records,
        overwrite=overwrite,
        virtual=virtual,
    )
    write_whole(target, text)
    return outcome


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where in a file the recording is, and what is known of it."""

    input: str | None
    output: str | None
    rate_hz: float | None
    time: str | None
    period: int | None
    accept: tuple[str, ...]


def _recordings(
    files: list[Path], validate: list[Path], columns: _Columns
) -> tuple[list["Recording"], list["Recording"], bool]:
    """Recordings to fit, recordings for validation, and whether they come from the virtual bench."""
    from microrad.lab.recording import read_recording

    if len(files) == 1 and files[0].is_dir():
        from microrad.lab import bench

        found = bench.read_folder(files[0], columns.accept)
        uses = {use: [r for r, of in found if of == use] for use in ("identification", "validation")}
        return uses["identification"], uses["validation"], True
    if columns.input is None or columns.output is None:
        missing = "--input" if columns.input is None else "--output"
        raise Refusal(f"{missing} is missing: name the column of the {'drive' if missing == '--input' else 'sensor'}.")

    def read(path: Path) -> "Recording":
        return read_recording(
            path,
            columns.input or "",
            columns.output or "",
            columns.rate_hz,
            time=columns.time,
            period_samples=columns.period,
            accept=columns.accept,
        )

    return [read(path) for path in files], [read(path) for path in validate], False


def _unit(given: str | None, said: set[str], flag: str, assumed: str) -> tuple[str, str]:
    """The unit of a channel, and where it comes from: the option or the files, which must agree, else an assumption."""
    listed = ", ".join(sorted(said))
    if given is not None:
        if said and said != {given}:
            raise Refusal(f"{flag} is {given} and the files say {listed}: give what the files say, or neither.")
        return given, "given"
    if len(said) > 1:
        raise Refusal(f"the files say different units, {listed}: identify them apart, or convert them.")
    return (said.pop(), "stated in the files") if said else (assumed, f"assumed, {flag} says otherwise")


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
    return Outcome(f"{listed}\n\n{len(files)} files written. Next: {shlex.join(['microrad', 'identify', str(folder)])}")
