"""The command line: parse, call one function below, render; `frame` has what all commands share, `lab` the bench's."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from microrad.cli.frame import (
    MET,
    UNMET,
    ExitOn,
    Json,
    Judged,
    Outcome,
    Overwrite,
    Refusal,
    Verbose,
    app,
    check_target,
    command,
    examples,
    json_text,
    main,
    option,
    progress_bar,
    refusal_of,
    say,
    width,
)
from microrad.core.folder import path_argument, write_whole

__all__ = ["app", "main"]


@app.command(
    epilog=examples("microrad init", "microrad init my-mission.toml", "microrad init --preset click click.toml")
)
@command
def init(
    file: Annotated[Path | None, typer.Argument(help="File to write [default: leo-geo.toml, or NAME.toml].")] = None,
    preset: Annotated[
        str | None, option("--preset", "NAME", "A link from the literature; see microrad presets.")
    ] = None,
) -> Outcome:
    """Write a LEO-to-GEO mission after the paper, ready to run.

    Each value carries its unit and a comment that says where it comes from. No file is ever overwritten.
    """
    from importlib import resources

    if preset is not None:
        return _init_preset(file or Path(f"{preset}.toml"), preset)
    file = file or Path("leo-geo.toml")
    run_it = f"microrad run {shlex.quote(path_argument(file))}"
    check_target(file, f"name another one (microrad init other.toml) or go on with `{run_it}`")
    write_whole(file, resources.files("microrad.mission").joinpath("missions", "leo-geo.toml").read_text("utf-8"))
    return Outcome(f"{file} written. Next: {run_it}")


def _init_preset(file: Path, name: str) -> Outcome:
    from microrad.mission import presets

    try:
        text = presets.preset_text(name)
    except ValueError as error:
        raise Refusal(str(error)) from error
    chosen = next(each for each in presets.presets() if each.name == name)
    run_it = f"microrad {'run' if chosen.whole else 'budget'} {shlex.quote(path_argument(file))}"
    check_target(file, f"name another one: microrad init --preset {name} other.toml")
    write_whole(file, text)
    first = f"{file} written. " + (f"To be given first: {', '.join(chosen.unknown)}. " if chosen.unknown else "")
    return Outcome(f"{first}Next: {run_it}")


_FOLDER = "Folder to write [default: <name of the mission file>-study in the current folder]."


@app.command(
    epilog=examples(
        "microrad run leo-geo.toml",
        "microrad run leo-geo.toml --output results/first --overwrite",
        "microrad run leo-geo.toml --mirror lab-mirror.toml --output with-lab-mirror",
        "microrad run leo-geo.toml --json > verdict.json",
    )
)
@command
def run(
    file: Annotated[Path, typer.Argument(help="Mission file; microrad init writes one.", metavar="FILE")],
    output: Annotated[Path | None, option("--output", "FOLDER", _FOLDER)] = None,
    mirror: Annotated[Path | None, option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")] = None,
    overwrite: Overwrite = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Compute all of it, also what an earlier run has kept.")
    ] = False,
    verbose: Verbose = False,
    exit_on: ExitOn = Judged.REQUIREMENTS,
    as_json: Json = False,
) -> Outcome:
    """Run the whole study of a mission.

    Prints the verdict, then writes report.html, results.nc, manifest.json and figures/ into a folder. The exit code is
    0 when every requirement is met and 1 when one is not. What an earlier run computed of the same inputs is taken
    from it.
    """
    from microrad import report
    from microrad.core import kept
    from microrad.mission.file import load_mission
    from microrad.study.study import run_study

    mission = load_mission(file, mirror)
    folder = output or Path(f"{file.stem}-study")
    report.check_folder(folder, overwrite)
    parts = kept.NOTHING if fresh else kept.of_user()
    with progress_bar() as progress, refusal_of(mission.path):
        study = run_study(mission, progress, parts)

    def write() -> str:
        with progress_bar() as progress:
            report.write(study, folder, overwrite=overwrite, on_progress=progress, parts=parts)
        if parts.trouble:
            say(parts.trouble)
        return "\n".join(str(folder / name) for name in ("report.html", "results.nc", "manifest.json"))

    code = exit_on.code(met=study.met, closes=study.closes)
    if as_json:
        write()
        return Outcome(json_text({**report.summary(study), "folder": str(folder)}), code)
    return Outcome(f"{report.verdict_text(study, width(), verbose=verbose)}\n", code, afterwards=write)


@app.command(
    epilog=examples(
        "microrad reproduce leo-geo-study/report.html",
        "microrad reproduce leo-geo-study",
        "microrad reproduce report.html --json",
    )
)
@command
def reproduce(
    report_file: Annotated[
        Path, typer.Argument(help="A report.html, a manifest.json, or the folder of both.", metavar="REPORT")
    ],
    as_json: Json = False,
) -> Outcome:
    """Run a report again and say whether its numbers agree.

    The mission and the files that it names are taken from the report itself. On the same machine, with the same
    versions, every number is compared to the last bit, elsewhere to the tolerance of its kind. The exit code is 0 when
    the numbers agree, 1 when one does not or the report was changed after it was written, and 2 for a file that is no
    whole report.
    """
    from microrad.report.results.reproduce import reproduce as run_again
    from microrad.report.results.reproduce import reproduction_data, reproduction_text

    with progress_bar() as progress:
        found = run_again(report_file, progress)
    text = json_text(reproduction_data(found)) if as_json else reproduction_text(found)
    return Outcome(text, MET if found.same else UNMET)


# ------------------------------------------------------------------------------------------------------- installation
@app.command(epilog=examples("microrad doctor", "microrad doctor --json"))
@command
def doctor(as_json: Json = False) -> Outcome:
    """Check the installation.

    Versions, those of the libraries against the tested ones, the compiled kernels against a known number, their cache,
    the packaged mission. The exit code is 1 when something is wrong.
    """
    from microrad.cli import installation as checks

    found = checks.run()
    ok = all(check.ok for check in found)
    if as_json:
        return Outcome(json_text({"ok": ok, "checks": [asdict(c) for c in found]}), int(not ok))
    return Outcome(checks.text(found, width()), int(not ok))


@app.command(epilog=examples("microrad schema > mission.schema.json"))
@command
def schema() -> Outcome:
    """Print the JSON schema of a mission file.

    Editors check and complete a mission file by it as you type.
    """
    from microrad.mission.model import mission_schema

    return Outcome(json_text(mission_schema()))


@app.command(
    epilog=examples("microrad explain modulus_margin", "microrad explain fine_pointing", "microrad explain --json d1")
)
@command
def explain(
    key: Annotated[str, typer.Argument(help="Name of a key or table, or the end of it.", metavar="KEY")],
    as_json: Json = False,
) -> Outcome:
    """Print what a key of a mission or mirror file means.

    Its unit and bounds, what counts where it is left out, the value of the shipped mission with its source, and the
    modules that read it.
    """
    from microrad.mission.explain import explained, text

    try:
        found = explained(key)
    except ValueError as error:
        raise Refusal(str(error)) from error
    if as_json:
        return Outcome(json_text([asdict(each) for each in found]))
    return Outcome(f"{text(found, width())}\n")


from microrad.cli import campaign, day, export, jitter, lab, link, pointing, studio, verify, worst_case  # noqa: E402, F401  their commands stand behind these in the help
