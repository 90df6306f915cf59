"""The command that verifies this installation."""

from pathlib import Path
from typing import Annotated

import typer

from microrad.cli.frame import MET, UNMET, Json, Outcome, app, command, examples, json_text, option, progress_bar, width
from microrad.core.folder import write_whole

_FOLDER = "Folder for verification.html and verification.json [default: the current one]."


@app.command(epilog=examples("microrad verify", "microrad verify --full --output evidence", "microrad verify --json"))
@command
def verify(
    output: Annotated[Path | None, option("--output", "FOLDER", _FOLDER)] = None,
    full: Annotated[bool, typer.Option("--full", help="Sweep the domains, too; domains.json has them.")] = False,
    as_json: Json = False,
) -> Outcome:
    """Verify and validate this installation.

    Runs the evidence here and now: each printed quantity against measurements, published output and independent
    methods. Writes a report that says of each quantity how well it is founded, with the credibility factors of
    NASA-STD-7009B. Recordings are taken from the folder that MICRORAD_DATA names. The exit code is 1 when a comparison
    fails or a file of the package is not the recorded one.
    """
    from microrad.report.verification.findings import verify as run
    from microrad.report.verification.page import (
        domains_text,
        verification_data,
        verification_page,
        verification_text,
    )

    folder = output or Path()
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar() as progress:
        found = run(full=full, on_progress=progress)
    data = json_text(verification_data(found))
    files = {"verification.html": verification_page(found), "verification.json": f"{data}\n"}
    if full:
        files["domains.json"] = domains_text(found)
    for name, text in files.items():
        write_whole(folder / name, text)
    written = "\n".join(str(folder / name) for name in files)
    told = data if as_json else f"{verification_text(found, width())}\n\n{written}\n"
    return Outcome(told, MET if found.ok else UNMET)
