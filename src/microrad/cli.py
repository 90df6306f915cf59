"""The command line: parse, call one function below, render. Data goes to stdout, progress and refusals to stderr.

Exit codes: 0 done, 1 a study that does not close or an installation with a problem, 2 bad usage or a bad file,
70 a fault of microrad, 130 interrupted, 141 nobody read the output.
"""

import contextlib
import functools
import json
import math
import os
import shlex
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, ParamSpec

import typer

# Everything else is imported inside the commands: numpy, numba and pydantic take longer to load than help may take.
if TYPE_CHECKING:
    from microrad.identify import BoucWenFit, Identification, PrandtlIshlinskiiFit, Score
    from microrad.study import Study

CLOSES, DOES_NOT_CLOSE, REFUSED, BUG, INTERRUPTED, UNREAD = 0, 1, 2, 70, 130, 141

_MIRROR_FILE_BEGINS = "# Mirror identified from"
_Arguments = ParamSpec("_Arguments")
_Progress = Callable[[int, int, str], None]


class Refusal(ValueError):  # noqa: N818  a refusal is no error of the program
    """Something that cannot be done as asked; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command found: the text for stdout and the exit code. It is printed when the work is done."""

    text: str
    code: int = 0


# ------------------------------------------------------------------------------------------------------------ the app
def _examples(*lines: str) -> str:
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])


app = typer.Typer(
    name="microrad",
    help="Design, identify and simulate the pointing chain of a small-satellite laser terminal.",
    epilog=_examples(
        "microrad init                    write the paper's mission, ready to run",
        "microrad run leo-geo.toml        the whole study: a verdict and a report",
        "microrad identify --help         a mirror model from your own recordings",
    )
    + "\n\nExit code: 0 done, 1 the study does not close, 2 bad usage or a bad file.",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: quick, and lines that can be searched and copied
)


def main() -> None:
    """Run the command line and exit; a request to terminate is taken as Ctrl-C is."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: its threads would get in the way of ours
    for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without µ is no reason to fail
    app(prog_name="microrad")


def _command(body: Callable[_Arguments, Outcome]) -> Callable[_Arguments, NoReturn]:
    """A command for typer: do the work, print what came out, and turn whatever went wrong into words and a code."""

    @functools.wraps(body)
    def command(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> NoReturn:
        try:
            outcome = body(*args, **kwargs)
        except (Exception, KeyboardInterrupt) as error:
            raise typer.Exit(_failed(error)) from None
        raise typer.Exit(_printed(outcome))

    return command


def _printed(outcome: Outcome) -> int:
    """Print the outcome and return its exit code, or the code for an output that nobody takes."""
    try:
        print(outcome.text, flush=True)
    except BrokenPipeError:
        _close_stdout()
        return UNREAD
    except OSError as error:
        _close_stdout()
        _say(f"the output cannot be written: {error.strerror}")
        return REFUSED
    except KeyboardInterrupt:
        _close_stdout()
        _say("interrupted while printing")
        return INTERRUPTED
    return outcome.code


def _close_stdout() -> None:
    """Let what is still buffered go nowhere, so that the interpreter's own flush at the end stays silent."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# ------------------------------------------------------------------------------------------------------------ failures
def _say(message: str) -> None:
    print(f"microrad: {message}", file=sys.stderr)


def _failed(error: BaseException) -> int:
    """Say what went wrong, on stderr; returns the exit code."""
    if _interrupted(error):
        _say("interrupted, nothing was written")
        return INTERRUPTED
    if isinstance(error, OSError):
        where = f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror or error)
        _say(f"{where}; nothing was written. Check free space and permissions.")
        return REFUSED
    if _meant_for_users(error):
        _say(str(error) or "not enough memory")
        return REFUSED
    traceback.print_exception(error)
    _say("a fault of microrad or of its installation: run microrad doctor; if all is well, report the lines above.")
    return BUG


def _interrupted(error: BaseException | None) -> bool:
    """Whether an interrupt is behind an error: one that falls into an import comes out as another error."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _meant_for_users(error: BaseException) -> bool:
    """Whether the message is an answer: each ValueError that microrad defines is written for its user."""
    ours = isinstance(error, ValueError) and type(error).__module__.startswith("microrad.")
    return ours or isinstance(error, MemoryError)


# ------------------------------------------------------------------------------------------------------------- output
def _json(data: Any) -> str:
    """One JSON document; what is no finite number becomes null, which JSON can say."""
    return json.dumps(_finite(data), indent=2, allow_nan=False)


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


@contextlib.contextmanager
def _progress() -> Iterator[_Progress]:
    """A bar on stderr while something is computed, where stderr is a terminal."""
    if not (sys.stderr and sys.stderr.isatty()):
        yield lambda done, total, what: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)
        yield lambda done, total, what: bar.update(task, completed=done, total=total, description=what)


def _check_target(path: Path, advice: str, replace_if_begins: str = "") -> None:
    """Refuse a file that must not be written: one that exists, unless it begins with a text that may be replaced."""
    if not path.parent.is_dir():
        raise Refusal(f"{path}: there is no folder {path.parent}; create it first.")
    if not os.path.lexists(path):
        return
    if not replace_if_begins:
        raise Refusal(f"{path} exists and is left as it is; {advice}.")
    with path.open("rb") as file:
        if file.read(len(replace_if_begins)) != replace_if_begins.encode():
            raise Refusal(f"{path} was not written by microrad and is left as it is; {advice}.")


def _write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all: beside its place first."""
    part = path.with_name(f".microrad-{os.getpid()}.part")
    try:
        with part.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


# ----------------------------------------------------------------------------------------------------------- commands
_Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
_Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what an earlier run wrote.")]


def _option(flag: str, metavar: str, text: str, **settings: Any) -> Any:
    return typer.Option(flag, metavar=metavar, help=text, **settings)


def _version(wanted: bool) -> None:
    if wanted:
        from microrad import __version__

        print(f"microrad {__version__}")
        raise typer.Exit


_Version = Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")]


@app.callback()
def _options(version: _Version = False) -> None:
    pass


@app.command(epilog=_examples("microrad init", "microrad init my-mission.toml"))
@_command
def init(file: Annotated[Path, typer.Argument(help="File to write.")] = Path("leo-geo.toml")) -> Outcome:
    """Write the paper's mission, ready to run.

    Each value carries its unit and a comment that says where it comes from. No file is ever overwritten.
    """
    from importlib import resources

    run_it = f"microrad run {shlex.quote(str(file))}"
    _check_target(file, f"name another one (microrad init other.toml) or go on with: {run_it}")
    _write_whole(file, resources.files("microrad").joinpath("missions", "leo-geo.toml").read_text("utf-8"))
    return Outcome(f"{file} written. Next: {run_it}")


_FOLDER = "Folder to write [default: <name of the mission file>-study in the current folder]."


@app.command(
    epilog=_examples(
        "microrad run leo-geo.toml",
        "microrad run leo-geo.toml --output results/first --overwrite",
        "microrad run leo-geo.toml --mirror lab-mirror.toml --output with-lab-mirror",
        "microrad run leo-geo.toml --json > verdict.json",
    )
)
@_command
def run(
    file: Annotated[Path, typer.Argument(help="Mission file; microrad init writes one.", metavar="FILE")],
    output: Annotated[Path | None, _option("--output", "FOLDER", _FOLDER)] = None,
    mirror: Annotated[Path | None, _option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")] = None,
    overwrite: _Overwrite = False,
    as_json: _Json = False,
) -> Outcome:
    """Run the whole study of a mission.

    Writes report.html, results.nc, manifest.json and figures/ into a folder, and prints the verdict. The exit code is 0
    when the link closes and 1 when it does not.
    """
    from microrad import report
    from microrad.missionfile import load_mission

    mission = load_mission(file, mirror)
    folder = output or Path(f"{file.stem}-study")
    report.check_folder(folder, overwrite)
    with _progress() as progress:
        study = _study(mission, progress)
        outcome = _study_outcome(study, folder, as_json)
        report.write(study, folder, overwrite=overwrite, on_progress=progress)
    return outcome


def _study(mission: Any, progress: _Progress) -> "Study":
    from microrad import study

    try:
        return study.run(mission, progress)
    except ValueError as error:  # an unstable loop, or a mirror without inverse
        raise Refusal(f"{mission.path}: {error}") from error


def _study_outcome(study: "Study", folder: Path, as_json: bool) -> Outcome:
    from microrad import report

    code = CLOSES if study.closes else DOES_NOT_CLOSE
    if as_json:
        return Outcome(_json({**report.summary(study), "folder": str(folder)}), code)
    files = "\n".join(str(folder / name) for name in ("report.html", "results.nc", "manifest.json"))
    return Outcome(f"{report.verdict_text(study)}\n\n{files}", code)


# ----------------------------------------------------------------------------------------------------------- identify
class Model(StrEnum):
    """Which model the mirror file holds."""

    BEST = "best"
    PRANDTL_ISHLINSKII = "prandtl-ishlinskii"
    BOUC_WEN = "bouc-wen"


def _quantity(unit: str) -> Callable[[str], float]:
    """A parser of an option's quantity, whose refusal typer shows with the name of the option."""

    def parse(text: str) -> float:
        from microrad.units import UnitError, parse_quantity

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


_OUTPUT_UNITS = "rad, mrad or urad; with --lever-arm also m, mm or um."
_LEVER_ARM = "From the axis of rotation to the point measured: '50 mm'."
_MIRROR_FILE = "File to write [default: <name of the recording>-mirror.toml in the current folder]."


@app.command(
    epilog=_examples(
        "microrad identify loop.csv --input drive --output angle --rate 200",
        "microrad identify 60Hz.csv 80Hz.csv 100Hz.csv --input 1 --output 2 --rate '50 kHz'",
        "microrad identify piezo.dat --input 0 --output 4 --rate '200 Hz' --output-unit um --lever-arm '50 mm'",
        "microrad run leo-geo.toml --mirror loop-mirror.toml --output loop-mirror-study",
    )
)
@_command
def identify(  # noqa: PLR0913  every argument is a named option
    files: Annotated[list[Path], typer.Argument(help="Text files of numbers, one row a sample.", metavar="FILE...")],
    *,
    input_column: Annotated[str, _option("--input", "COLUMN", "Drive: name of the column, or number from 0.")],
    output_column: Annotated[str, _option("--output", "COLUMN", "Angle or displacement: name, or number from 0.")],
    rate: Annotated[float, _option("--rate", "HZ", "Sample rate: 200, '200 Hz' or '50 kHz'.", parser=_rate)],
    output_unit: Annotated[str, _option("--output-unit", "UNIT", _OUTPUT_UNITS)] = "mrad",
    input_unit: Annotated[str, _option("--input-unit", "UNIT", "V or mV.")] = "V",
    lever_arm: Annotated[float | None, _option("--lever-arm", "LENGTH", _LEVER_ARM, parser=_quantity("m"))] = None,
    hold_out: Annotated[float, _option("--hold-out", "SHARE", "Kept for the check, at each recording's end.")] = 0.5,
    model: Annotated[Model, typer.Option(help="Model that the mirror file holds.")] = Model.BEST,
    admissible: Annotated[bool, typer.Option("--admissible", help="Bouc-Wen never moving the wrong way.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scattered starts of the Bouc-Wen fit.")] = 0,
    name: Annotated[str | None, _option("--name", "TEXT", "Name of the mirror [default: the recording's].")] = None,
    mirror_file: Annotated[Path | None, _option("--mirror-file", "FILE", _MIRROR_FILE)] = None,
    overwrite: _Overwrite = False,
    as_json: _Json = False,
) -> Outcome:
    """Fit a mirror model to recordings.

    Two models with hysteresis are fitted to the first part of each recording and judged on the rest; one of them is
    written as a mirror file. A column is given by its name in the header or by its number, counted from 0.
    """
    from microrad import identify as identification
    from microrad.recording import read_recording

    target = mirror_file or Path(f"{files[0].stem}-mirror.toml")
    advice = "name another one with --mirror-file" + ("" if overwrite else " or replace it with --overwrite")
    check = functools.partial(_check_target, target, advice, _MIRROR_FILE_BEGINS if overwrite else "")
    check()
    records = [read_recording(file, input_column, output_column, rate) for file in files]
    models = ("prandtl_ishlinskii", "bouc_wen_admissible" if admissible else "bouc_wen")
    with _progress() as bar:
        found = identification.identify(
            records, hold_out, seed, models, bar, output_unit=output_unit, lever_arm_m=lever_arm, input_unit=input_unit
        )
    written = dict(zip(Model, (found.chosen, *models), strict=True))[model]
    text = identification.mirror_file_text(found, files[0].stem[:200] if name is None else name, model=written)
    outcome = Outcome(_json(_fit_data(found, written, target)) if as_json else _fit_text(found, written, target))
    check()  # the file may have appeared meanwhile
    _write_whole(target, text)
    return outcome


def _warnings(found: "Identification", written: str) -> list[str]:
    from microrad.identify.choice import fit_warnings

    return list(dict.fromkeys([*found.warnings, *fit_warnings(found.fit(written))]))


def _fit_text(found: "Identification", written: str, target: Path) -> str:
    """The fit as a table to read."""
    lines = [f"{'residual in % of the peak-to-peak':34}{'fitted samples':>20}{'held-out samples':>20}"]
    lines += [f"{'':34}" + 2 * f"{'rms':>10}{'peak':>10}"]
    lines += [_score_line(score, written) for score in (*found.scores, found.straight_line)]
    lines += ["", found.reason]
    for score, fit in zip(found.scores, found.fits, strict=True):
        lines += ["", score.model, *_parameter_lines(fit)]
    lines += ["", *(f"warning: {text}" for text in _warnings(found, written))]
    run_it = ["microrad", "run", "leo-geo.toml", "--mirror", str(target), "--output", f"{target.stem}-study"]
    return "\n".join([*lines, "", f"{target} written ({written}). Next: {shlex.join(run_it)}"])


def _score_line(score: "Score", written: str) -> str:
    mark = " (written)" if score.model == written else ""
    fitted = f"{score.fit_rms_percent:10.3f}{score.fit_peak_percent:10.2f}"
    return f"{score.model + mark:34}{fitted}{score.held_out_rms_percent:10.3f}{score.held_out_peak_percent:10.2f}"


def _parameter_lines(fit: "BoucWenFit | PrandtlIshlinskiiFit") -> list[str]:
    from microrad.identify.bouc_wen import PARAMETER_UNITS, PARAMETERS, BoucWenFit

    if isinstance(fit, BoucWenFit):
        shown = [(1e3, "mrad/V") if unit == "rad/V" else (1.0, unit) for unit in PARAMETER_UNITS]
        values = zip(PARAMETERS, shown, fit.values, fit.standard_errors, strict=True)
        lines = [f"  {name:9}{k * v:12.5g} ± {float(f'{k * e:.2g}'):g} {unit}" for name, (k, unit), v, e in values]
        lines += [f"  not identified: {item.name}, {item.reason}" for item in fit.not_identified]
        return [*lines, f"  {fit.agreeing_starts} of {len(fit.start_rms_percent)} starts reached the best fit"]
    plays = zip(fit.thresholds_v, fit.weights_rad_per_v, fit.standard_errors_rad_per_v, strict=True)
    return [f"  threshold {r:8.4g} V  weight {1e3 * w:10.4g} ± {1e3 * e:.2g} mrad/V" for r, w, e in plays if w > 0]


def _fit_data(found: "Identification", written: str, target: Path) -> dict[str, Any]:
    """The fit as plain data, in SI units with the unit in each key."""
    names = [score.model for score in found.scores]
    return {
        "model": written,
        "best_model": found.chosen,
        "reason": found.reason,
        "scores": [asdict(score) for score in (*found.scores, found.straight_line)],
        "parameters": {name: _parameter_data(fit) for name, fit in zip(names, found.fits, strict=True)},
        "travel_rad": found.travel_rad,
        "drive_min_v": found.drive_min_v,
        "drive_max_v": found.drive_max_v,
        "rate_limit_v_s": found.rate_limit_v_per_s,
        "drift_rad": found.drift_rad,
        "recordings": [asdict(source) for source in found.sources],
        "warnings": _warnings(found, written),
        "mirror_file": str(target),
    }


def _parameter_data(fit: "BoucWenFit | PrandtlIshlinskiiFit") -> dict[str, Any]:
    from microrad.identify.bouc_wen import PARAMETER_UNITS, PARAMETERS, BoucWenFit

    if isinstance(fit, BoucWenFit):
        values = zip(PARAMETERS, PARAMETER_UNITS, fit.values.tolist(), fit.standard_errors.tolist(), strict=True)
        return {name: {"value": v, "standard_error": e, "unit": unit} for name, unit, v, e in values} | {
            "admissible": fit.admissible,
            "not_identified": {item.name: item.reason for item in fit.not_identified},
            "agreeing_starts": fit.agreeing_starts,
            "starts": len(fit.start_rms_percent),
        }
    return {
        "thresholds_v": fit.thresholds_v.tolist(),
        "weights_rad_v": fit.weights_rad_per_v.tolist(),
        "standard_errors_rad_v": fit.standard_errors_rad_per_v.tolist(),
        "sign": fit.sign,
    }


# ------------------------------------------------------------------------------------------------------- installation
@app.command(epilog=_examples("microrad doctor", "microrad doctor --json"))
@_command
def doctor(as_json: _Json = False) -> Outcome:
    """Check the installation.

    Versions, the compiled kernels against a known number, their cache, the packaged mission. The exit code is 1 when
    something is wrong.
    """
    from microrad import doctor as checks

    found = checks.run()
    ok = all(check.ok for check in found)
    if as_json:
        return Outcome(_json({"ok": ok, "checks": [asdict(c) for c in found]}), int(not ok))
    lines = [
        f"{'ok' if c.ok else 'problem':8} {c.name:17} {'; '.join(filter(None, (c.found, c.advice)))}" for c in found
    ]
    return Outcome("\n".join(lines), int(not ok))


@app.command(epilog=_examples("microrad schema > mission.schema.json"))
@_command
def schema() -> Outcome:
    """Print the JSON schema of a mission file.

    Editors check and complete a mission file by it as you type.
    """
    from microrad.mission import mission_schema

    return Outcome(_json(mission_schema()))
