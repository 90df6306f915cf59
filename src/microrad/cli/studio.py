"""The command that opens the studio, a local web page."""

from contextlib import closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from microrad.cli.frame import MET, Outcome, app, command, examples, option, say

if TYPE_CHECKING:
    from microrad.studio.server import Entrance
    from microrad.studio.session import Session


@app.command(
    epilog=examples(
        "microrad studio",
        "microrad studio leo-geo.toml",
        "microrad studio --port 8420 --no-browser",
    )
)
@command
def studio(
    file: Annotated[
        Path | None, typer.Argument(help="Mission file [default: the last one, or microrad init's].", metavar="FILE")
    ] = None,
    port: Annotated[
        int, option("--port", "N", "Port [default: a free one].", min=0, max=65535, show_default=False)
    ] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    expose: Annotated[
        str | None,
        option(
            "--expose-to-network", "ADDRESS", "Listen on this address of this machine, open to others, unencrypted."
        ),
    ] = None,
) -> Outcome:
    """Open the studio: a page in the browser, on this machine only, where a mission is designed by moving things.

    Prints the address, which holds a secret: whoever has it can read and write the missions of the folder. Runs until
    Ctrl-C. Studies and campaigns that were started go on.
    """
    from microrad.studio import server
    from microrad.studio.session import Session

    server.check_installed()
    entrance = server.listen(port, expose)
    with closing(entrance.listener):
        session = Session(Path.cwd() if file is None else file.resolve().parent, file)
        with server.alone(session.studio), suppress(KeyboardInterrupt):  # the usual end of a server
            server.serve(session, entrance, lambda: _ready(session, entrance, expose, not no_browser))
    running = sum(not job.finished for job in session.jobs.listed())
    going_on = f"; {running} of its jobs {'goes' if running == 1 else 'go'} on, and can be seen by starting it again"
    return Outcome(f"the studio is closed{going_on if running else ''}", MET)


def _ready(session: "Session", entrance: "Entrance", exposed: str | None, browser: bool) -> None:
    """Say where the studio is, and open it."""
    print(entrance.url, flush=True)
    if exposed is not None:
        say(f"open to the network on {exposed}, and not encrypted: who reads the address on its way can come in.")
    if browser:
        import threading
        import webbrowser

        from microrad.studio import server

        try:
            page = server.way_in(session.studio, entrance.url)
        except OSError as error:
            say(f"the browser was not opened ({error.strerror}); open the address yourself.")
            return
        # Some browsers keep whoever has started them waiting, and the studio is to answer meanwhile.
        threading.Thread(target=webbrowser.open, args=(page,), daemon=True).start()
