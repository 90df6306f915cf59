"""Commands of the day: contacts and what they deliver, and the plan of a constellation."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from microrad.cli.frame import (
    MET,
    UNMET,
    Json,
    Outcome,
    Refusal,
    app,
    command,
    examples,
    json_text,
    progress_bar,
    refusal_of,
    width,
)

if TYPE_CHECKING:
    from microrad.link.study import LinkStudy

_File = Annotated[
    Path, typer.Argument(help="Mission file with the tables orbit and operations.", metavar="FILE", show_default=False)
]


def _links(file: Path) -> "LinkStudy":
    """The links of a mission, whose losses and acquisition the day needs."""
    from microrad.link import study as link_study
    from microrad.mission.file import load_link

    given = load_link(file)
    with refusal_of(file):
        return link_study.run_link_study(given)


@app.command(
    epilog=examples(
        "microrad contacts leo-geo.toml",
        "microrad contacts leo-geo.toml --csv > contacts.csv",
        "microrad contacts leo-geo.toml --html > contacts.html",
    )
)
@command
def contacts(
    file: _File,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print one line a contact, for a spreadsheet.")] = False,
    as_html: Annotated[bool, typer.Option("--html", help="Print one page that loads nothing.")] = False,
    as_json: Json = False,
) -> Outcome:
    """Print when the link has contact, and what it delivers.

    Contacts with the relay and passes over the ground stations, each with its cause to begin and to end; volumes, the
    on-board store, latency of the data by both ways, and which assumption matters most. The pointing loss is that of
    the mission's jitter or pointing error; microrad run takes that of the simulated loop. The exit code is 0 when the
    relay carries something and 1 when it does not.
    """
    if sum((as_csv, as_html, as_json)) > 1:
        raise Refusal("--csv, --html and --json exclude each other; give one of them.")
    from microrad.orbit import day as day_study
    from microrad.report.day.data import day_csv, day_data
    from microrad.report.day.page import day_page, day_text
    from microrad.report.marks import with_marks

    links = _links(file)
    with refusal_of(file), progress_bar() as progress:
        day = day_study.run_day_study(links, on_progress=progress)
    code = MET if day.relay.capacity_bit > 0.0 else UNMET
    if as_json:
        return Outcome(
            json_text(with_marks({"mission": links.file.mission.name, **day_data(day)}, links.file.sources)), code
        )
    if as_csv:
        return Outcome(day_csv(day), code)
    if as_html:
        return Outcome(day_page(day, links), code)
    return Outcome(day_text(day, width(), links.file.sources), code)


@app.command(
    epilog=examples(
        "microrad constellation leo-geo.toml",
        "microrad constellation leo-geo.toml --csv > sessions.csv",
        "microrad constellation leo-geo.toml --contact-plan > contact-plan.ionrc",
    )
)
@command
def constellation(
    file: _File,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print one line a session, for a spreadsheet.")] = False,
    as_plan: Annotated[
        bool, typer.Option("--contact-plan", help="Print a contact plan as CCSDS 734.3-B has it, in ION's text.")
    ] = False,
    as_json: Json = False,
) -> Outcome:
    """Plan who is served when, where many satellites share some relays.

    Each terminal of a relay serves one satellite at a time, the one that has waited longest first. The exit code is 0
    when data flow and 1 when none do.
    """
    if sum((as_csv, as_plan, as_json)) > 1:
        raise Refusal("--csv, --contact-plan and --json exclude each other; give one of them.")
    from microrad.orbit import constellation as plans
    from microrad.orbit import day as day_study
    from microrad.orbit import operations
    from microrad.report.day.constellation import plan_data, plan_text

    links = _links(file)
    with refusal_of(file):
        with progress_bar() as progress:
            plan = plans.run_constellation(links.file, day_study.given_loss(links), progress)
        code = MET if plan.volume_bit > 0.0 else UNMET
        if as_csv:
            return Outcome(operations.csv_text(plan.planned, plan.epoch.utc), code)
        if as_plan:
            return Outcome(plan.contact_plan(), code)
    if as_json:
        return Outcome(json_text({"mission": links.file.mission.name, **plan_data(plan)}), code)
    return Outcome(plan_text(plan, width()), code)
