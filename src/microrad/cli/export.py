"""Commands that take a design out of microrad, and a linear model in: flight code, co-simulation units, matrices."""

import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from microrad.cli.frame import (
    Accept,
    Json,
    OnProgress,
    Outcome,
    Overwrite,
    Refusal,
    app,
    check_target,
    command,
    examples,
    group,
    json_text,
    option,
    progress_bar,
)
from microrad.core.folder import path_argument, write_whole

if TYPE_CHECKING:
    from microrad.export.choice import Choice
    from microrad.mirror.coupled import CoupledMirror
    from microrad.mission.file import MissionFile

exports = group(
    "export",
    "Take a design to the flight computer and to other simulators: C, FMU, matrices.",
    examples(
        "microrad export c leo-geo.toml                C99 of a controller with its inverse, compiled and run",
        "microrad export fmu leo-geo.toml              the mirror as a co-simulation unit",
        "microrad export matrices leo-geo.toml         state-space, zeros and poles for MATLAB and Python",
    ),
)
app.add_typer(exports)

_File = Annotated[Path, typer.Argument(help="Mission file; microrad init writes one.", metavar="FILE")]
_Mirror = Annotated[Path | None, option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")]
_OTHER = "choose another --output"
_CONTROLLER = "A controller of the mission, as microrad design names them, or PID, PID + inverse"


class _Precision(StrEnum):
    DOUBLE = "double"
    SINGLE = "single"
    FIXED = "fixed"


class _Version(StrEnum):
    FMI_2 = "2.0"
    FMI_3 = "3.0"


class _AngleUnit(StrEnum):
    RAD = "rad"
    MRAD = "mrad"
    URAD = "urad"


class _Loop(StrEnum):
    FINE_POINTING = "fine_pointing"
    CONTROL = "control"


DEFAULT_CONTROLLER, DEFAULT_OF_SEVERAL = "PI + inverse", "PI + notch"

_FlightController = Annotated[
    str | None, option("--controller", "NAME", f"{_CONTROLLER} [default: {DEFAULT_CONTROLLER}].")
]
_Begin = Annotated[
    str | None, option("--name", "IDENTIFIER", "What names in the code begin with [default: from the controller].")
]
_Kind = Annotated[
    _Precision, option("--precision", "KIND", "double, single, or fixed (linear part in 32-bit integers).")
]
_Folder = Annotated[Path | None, option("--output", "FOLDER", "Folder to write [default: <mission>-<identifier>].")]


@exports.command(
    epilog=examples(
        "microrad export c leo-geo.toml",
        'microrad export c leo-geo.toml --controller "PID + inverse" --precision single',
        "microrad export c leo-geo.toml --controller LQG --name mirror_loop --output flight",
        "microrad export c leo-geo.toml --mirror two-axes.toml --controller LQG",
    )
)
@command
def c(  # noqa: PLR0913, PLR0917  each is an option
    file: _File,
    controller: _FlightController = None,
    name: _Begin = None,
    precision: _Kind = _Precision.DOUBLE,
    mirror: _Mirror = None,
    output: _Folder = None,
    overwrite: Overwrite = False,
    accept: Accept = False,
    as_json: Json = False,
) -> Outcome:
    """Write a controller as C99 for a flight computer.

    With its inverse, limits and counters, a test bench, a recorded run of the loop and a Makefile; compiled and run
    over that run where there is a C compiler.
    """
    from microrad.export.flight import write
    from microrad.export.identifiers import identifier, suggested

    mission, several = _loaded(file, mirror)
    # Feedback with the inverse of the hysteresis ahead of it: the paper's choice, in the loop that the mission has.
    default = DEFAULT_CONTROLLER if mission.mission.fine_pointing is not None else "PID + inverse"
    default = DEFAULT_OF_SEVERAL if several else default
    wanted = controller if controller is not None else default
    name = identifier(name) if name is not None else suggested(wanted)
    folder = output or Path(f"{file.stem}-{name}")
    write.check_output(folder, overwrite)
    with progress_bar() as progress:
        found = write.export_flight(
            _chosen(mission, several, wanted, progress),
            folder,
            name=name,
            precision=precision.value,
            overwrite=overwrite,
            accept=accept,
            on_progress=progress,
        )
    if as_json:
        return Outcome(json_text({**write.export_data(found), "folder": str(folder)}))
    return Outcome(f"{write.report_text(found)}\n\n{folder}")


@exports.command(
    epilog=examples(
        "microrad export fmu leo-geo.toml",
        'microrad export fmu leo-geo.toml --controller "PID + inverse" --fmi 3.0',
        "microrad export fmu leo-geo.toml --loop control --output mirror.fmu",
        "microrad export fmu leo-geo.toml --mirror two-axes.toml --controller LQG",
    )
)
@command
def fmu(  # noqa: PLR0913, PLR0917  each is an option
    file: _File,
    controller: Annotated[
        str | None, option("--controller", "NAME", f"{_CONTROLLER}: the closed loop with it [default: the mirror].")
    ] = None,
    loop: Annotated[
        _Loop | None, option("--loop", "TABLE", "Whose amplifier and step the mirror has: fine_pointing or control.")
    ] = None,
    fmi: Annotated[_Version, option("--fmi", "VERSION", "2.0 or 3.0.")] = _Version.FMI_2,
    name: Annotated[str | None, option("--name", "IDENTIFIER", "Model identifier [default: what it holds].")] = None,
    mirror: _Mirror = None,
    output: Annotated[Path | None, option("--output", "FILE", "File to write [default: <mission>-<name>.fmu].")] = None,
    overwrite: Overwrite = False,
    accept: Accept = False,
) -> Outcome:
    """Write the mirror with its amplifier, or the closed loop, as a co-simulation unit (FMI).

    C inside, compiled here where there is a C compiler, sources beside it; parameters and units in its description. For
    Simulink, Modelica tools, Basilisk and whatever else imports an FMU.
    """
    from microrad.export import choice
    from microrad.export.fmi.fmu import write_unit
    from microrad.export.identifiers import identifier, suggested

    if controller is not None and loop is not None:
        raise Refusal("--controller and --loop exclude each other: a controller stands in one loop of the mission.")
    mission, several = _loaded(file, mirror)
    name = identifier(name) if name is not None else suggested(f"{controller} loop" if controller else "mirror")
    path = output or Path(f"{file.stem}-{name}.fmu")
    check_target(path, _OTHER, overwrite=overwrite, begins=b"PK")
    with progress_bar() as progress:
        if controller is not None:
            unit: Any = choice.loop_unit(_promised(mission, several, controller, accept, progress))
        else:
            table = loop.value if loop else choice.LOOPS[0 if mission.mission.fine_pointing is not None else 1]
            unit = choice.plant_unit(mission, table, several)
        written = write_unit(unit, path, fmi.value, name)
    return Outcome(written.words)


@exports.command(
    epilog=examples(
        "microrad export matrices leo-geo.toml",
        "microrad export matrices leo-geo.toml --controller LQG --output lqg.mat",
        "microrad export matrices leo-geo.toml --json > models.json",
        "microrad export matrices leo-geo.toml --mirror two-axes.toml --controller LQG",
    )
)
@command
def matrices(
    file: _File,
    controller: Annotated[
        str | None, option("--controller", "NAME", f"{_CONTROLLER}: it and its loop too [default: the mirror].")
    ] = None,
    mirror: _Mirror = None,
    output: Annotated[Path | None, option("--output", "FILE", "File to write [default: <mission>.mat].")] = None,
    overwrite: Overwrite = False,
    accept: Accept = False,
    as_json: Json = False,
) -> Outcome:
    """Write linear models to a MATLAB file: state space, zeros and poles, transfer functions.

    The mirror's linear part, the mirror at the slow gain of its hysteresis and, with a controller, the plant as it is
    sampled, the controller and the loop. --json prints them instead; in Python, microrad.export.matrices.to_control
    makes objects of python-control.
    """
    from microrad.export import choice
    from microrad.export import matrices as linear

    mission, several = _loaded(file, mirror)
    path = output or Path(f"{file.stem}.mat")
    if not as_json:
        check_target(path, _OTHER, overwrite=overwrite, begins=b"MATLAB 5.0")
    with progress_bar() as progress:
        of = (
            choice.source(mission, several)
            if controller is None
            else _promised(mission, several, controller, accept, progress)
        )
        found = linear.models(of)
    if as_json:
        return Outcome(linear.json_text(found))
    linear.write_mat(found, path)
    return Outcome(f"{path} written: {', '.join(each.name for each in found)}")


def _loaded(file: Path, mirror: Path | None) -> "tuple[MissionFile, CoupledMirror | None]":
    """The mission, and the mirror of several axes of its fine-pointing loop, given or named by the mission."""
    from microrad.mirror import coupled
    from microrad.mission.file import load_loop

    mission, several = load_loop(file, mirror)
    return mission, None if several is None else coupled.of(several)


def _chosen(mission: "MissionFile", several: "CoupledMirror | None", name: str, on_progress: OnProgress) -> "Choice":
    from microrad.export import choice
    from microrad.loop.paper_cases import PID, PID_WITH_INVERSE

    table = mission.mission.fine_pointing
    named = table is not None and table.mirror_file is not None  # the paper's loop has the mission's own mirror
    if several is not None and not (named and name in (PID, PID_WITH_INVERSE)):
        return choice.choose_coupled(mission, several, name, on_progress)
    return choice.choose(mission, name, on_progress)


def _promised(
    mission: "MissionFile", several: "CoupledMirror | None", name: str, accept: bool, on_progress: OnProgress
) -> "Choice":
    """A controller of the mission, refused where its linear figure is no promise."""
    from microrad.export import choice

    chosen = _chosen(mission, several, name, on_progress)
    choice.promised(chosen, accept)
    return chosen


@app.command(
    "import",
    epilog=examples(
        "microrad import mirror.mat --travel '2.5 mrad' --drive '0 V' '12 V' --bias '6 V' --rate-limit '3770 V/s' "
        "--band '1 Hz' '5 kHz' --normalise-at '2 Hz' --output-unit mrad"
    ),
)
@command
def import_(  # noqa: PLR0913, PLR0917  what a linear model does not say has to be given, each by itself
    file: Annotated[Path, typer.Argument(help="MATLAB file with A B C D, z p k or num den.", metavar="FILE")],
    travel: Annotated[str, option("--travel", "ANGLE", "From stop to stop.")],
    drive: Annotated[tuple[str, str], option("--drive", "LOW HIGH", "Range of the drive it was identified in.")],
    bias: Annotated[str, option("--bias", "VOLTAGE", "Drive about which it works.")],
    rate_limit: Annotated[str, option("--rate-limit", "RATE", "Fastest drive that it was identified for.")],
    band: Annotated[tuple[str, str], option("--band", "LOW HIGH", "Frequencies that it was identified between.")],
    normalise_at: Annotated[str, option("--normalise-at", "FREQUENCY", "Where its gain is taken, inside the band.")],
    output_unit: Annotated[_AngleUnit, option("--output-unit", "UNIT", "What the model's output counts in.")],
    name: Annotated[str | None, option("--name", "TEXT", "Name of the mirror [default: the file's].")] = None,
    variable: Annotated[
        str | None, option("--variable", "NAME", "The structure to take where the file has several.")
    ] = None,
    output: Annotated[
        Path | None, option("--output", "FILE", "Mirror file to write [default: <file>-mirror.toml].")
    ] = None,
    overwrite: Overwrite = False,
) -> Outcome:
    """Make a mirror file of a linear model from another tool.

    Volts in, an angle out, one input and one output. A sampled model counts as one whose drive is held over each
    sample. Such a mirror has no hysteresis; what a linear model does not say has to be given.
    """
    from microrad.export.linear_import import Given, import_mat

    given = Given(
        name=name if name is not None else file.stem,
        travel_rad=_quantity("--travel", travel, "rad"),
        rate_limit_v_s=_quantity("--rate-limit", rate_limit, "V/s"),
        bias_v=_quantity("--bias", bias, "V"),
        drive_min_v=_quantity("--drive", drive[0], "V"),
        drive_max_v=_quantity("--drive", drive[1], "V"),
        excited_from_hz=_quantity("--band", band[0], "Hz"),
        excited_to_hz=_quantity("--band", band[1], "Hz"),
        normalise_at_hz=_quantity("--normalise-at", normalise_at, "Hz"),
        output_unit=output_unit.value,
    )
    path = output or Path(f"{file.stem}-mirror.toml")
    check_target(path, _OTHER, overwrite=overwrite, begins=b"# Mirror imported")
    write_whole(path, import_mat(file, given, variable))
    return Outcome(f"{path} written. Next: microrad run leo-geo.toml --mirror {shlex.quote(path_argument(path))}")


def _quantity(flag: str, text: str, unit: str) -> float:
    from microrad.core.units import UnitError, parse_quantity

    try:
        return parse_quantity(text, unit)
    except UnitError as error:
        raise Refusal(f"{flag}: {error}") from error
