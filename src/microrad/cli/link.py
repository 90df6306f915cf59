"""Commands of the links: their budgets as tables, and presets from the literature to start from."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from microrad.cli.frame import (
    ExitOn,
    Json,
    Judged,
    Outcome,
    Refusal,
    Verbose,
    app,
    command,
    examples,
    json_text,
    option,
    refusal_of,
    width,
)

if TYPE_CHECKING:
    from microrad.mission.file import LinkFile


@app.command(
    epilog=examples(
        "microrad budget leo-geo.toml",
        'microrad budget leo-geo.toml --data-rate "1 Gbit/s" --pointing-error "5 urad"',
        "microrad budget leo-geo.toml --solve communication.transmit_power",
        "microrad budget leo-geo.toml --csv > budget.csv",
        "microrad budget leo-geo.toml --html > budget.html",
        "microrad budget leo-geo.toml --standard sda",
    )
)
@command
def budget(  # noqa: PLR0913, PLR0917  each is an option
    file: Annotated[Path, typer.Argument(help="Mission file, or one with the tables of its links.", metavar="FILE")],
    data_rate: Annotated[str | None, option("--data-rate", "RATE", "In place of the mission's.")] = None,
    pointing_error: Annotated[str | None, option("--pointing-error", "ANGLE", "In place of the mission's.")] = None,
    solve: Annotated[
        str | None, option("--solve", "KEY", "Its values with the required margin, one in its place.")
    ] = None,
    standard: Annotated[
        str | None, option("--standard", "NAME", "What a published standard asks, and what the links have: sda.")
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print one line a row, for a spreadsheet.")] = False,
    as_html: Annotated[bool, typer.Option("--html", help="Print one page that loads nothing.")] = False,
    verbose: Verbose = False,
    exit_on: ExitOn = Judged.REQUIREMENTS,
    as_json: Json = False,
) -> Outcome:
    """Print the link budgets of a mission.

    The verdict, what limits the links, and communication, beacon and answer line by line; --verbose has the source of
    each line and where it holds, the pointing budget, the light on the tracking sensor and acquisition, too. No loop is
    simulated. The exit code is 0 when every requirement is met and 1 when one is not; those of a standard do not count.
    """
    if sum((as_csv, as_html, as_json)) > 1:
        raise Refusal("--csv, --html and --json exclude each other; give one of them.")
    from microrad.link import compliance
    from microrad.link import study as link_study
    from microrad.link.requirement import met
    from microrad.mission.file import load_link
    from microrad.report.links.budgets import links_csv, links_text
    from microrad.report.links.data import links_data

    try:
        asked = None if standard is None else compliance.standard(standard)
    except ValueError as error:
        raise Refusal(f"--standard: {error}") from error
    loaded = load_link(file)
    if pointing_error is not None and loaded.mission.jitter is not None:
        raise Refusal(
            "--pointing-error changes no margin: under the table [jitter] of the mission the margin is the one at "
            "requirement.outage. Change jitter.bias and jitter.rms, or take the table out."
        )
    given = _changed(loaded, data_rate, pointing_error)
    with refusal_of(file):
        solution = None if solve is None else link_study.solve_key(given, solve)
        study = link_study.run_link_study(given if solution is None else solution.file)
        against = None if asked is None else compliance.compliance(study, asked)
    code = exit_on.code(met=met(study), closes=study.closes)
    if as_json:
        return Outcome(json_text(links_data(study, solution, against)), code)
    if as_csv:
        return Outcome(links_csv(study, solution, against), code)
    if as_html:
        from microrad.report.links.views import links_page

        return Outcome(links_page(study, solution, against), code)
    return Outcome(links_text(study, width(), verbose=verbose, solution=solution, against=against), code)


def _changed(file: "LinkFile", data_rate: str | None, pointing_error: str | None) -> "LinkFile":
    """The file with what the command line says in place of two of its values."""
    from microrad.mission.model import Source
    from microrad.mission.tables.link import Communication

    raw = {"data_rate": data_rate, "pointing_error": pointing_error}
    values, sources = {}, dict(file.sources)
    for key, text in raw.items():
        if text is None:
            continue
        name, rule = Communication.rule_of(key)
        try:
            values[name] = rule.read(text)
        except ValueError as error:
            raise Refusal(f"--{key.replace('_', '-')}: {error}") from error
        sources[f"communication.{key}"] = Source(0, "command line", text)
    m = file.mission
    changed = m.model_copy(update={"communication": m.communication.model_copy(update=values)})
    return replace(file, mission=changed, sources=sources)


@app.command(epilog=examples("microrad presets", "microrad init --preset click click.toml"))
@command
def presets(as_json: Json = False) -> Outcome:
    """List links and missions to start from.

    Each is a file in which every value names its source; what no source prints is "unknown" and has to
    be given before a budget is made of it.
    """
    from microrad.mission.presets import presets as all_presets
    from microrad.report.tables import Table, table_text

    found = all_presets()
    if as_json:
        return Outcome(json_text([{"name": p.name, "title": p.title, "unknown": list(p.unknown)} for p in found]))
    rows = [(p.name, p.title, str(len(p.unknown) or "nothing")) for p in found]
    table = Table("", ("preset", "what it is", "to be given"), rows, (1,))
    return Outcome(f"{table_text(table, width())}\n\nmicrorad init --preset NAME writes one.")
