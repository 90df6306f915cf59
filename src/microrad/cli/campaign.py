"""Commands of campaigns: run, look, go on, verify, export, draw, optimise."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from microrad.cli.frame import (
    MET,
    UNMET,
    Json,
    Outcome,
    Overwrite,
    Refusal,
    app,
    check_target,
    command,
    examples,
    group,
    interrupted,
    json_text,
    option,
    progress_bar,
    width,
)
from microrad.core.folder import write_whole

if TYPE_CHECKING:
    from microrad.campaign.run import Means

campaigns = group(
    "campaign",
    "Many runs of a mission with drawn inputs: tails, sweeps, sensitivity, optimisation.",
    examples(
        "microrad campaign init            write a campaign file to start from",
        "microrad campaign run campaign.toml",
        "microrad campaign status campaign.ledger",
    ),
)
app.add_typer(campaigns)

_LINE_S = 30.0  # between two lines of progress in a log

_File = Annotated[Path, typer.Argument(help="Campaign file; microrad campaign init writes one.", metavar="FILE")]
_Ledger = Annotated[Path, typer.Argument(help="Ledger that microrad campaign run wrote.", metavar="LEDGER")]
_Threads = Annotated[int | None, option("--threads", "N", "Processes of this machine [default: one a core].", min=1)]
_OwnThreads = Annotated[int | None, option("--threads", "N", "Threads of this process [default: one a core].", min=1)]
_Workers = Annotated[int | None, option("--workers", "N", "The same as --threads.", min=1)]
_Scheduler = Annotated[
    str | None, option("--scheduler", "ADDRESS", "A running Dask scheduler, such as tcp://head:8786.")
]


_BEGINS = {".csv": b"cell,", ".parquet": b"PAR1", ".nc": b"\x89HDF"}  # as what microrad exports does
_ADDRESS = re.compile(r"((tcp|tls|ucx|ws|wss)://)?[^/\s]+:(?P<port>\d{1,5})")  # those that Dask knows
_MOST_PORT = 65_535


def _means(threads: int | None, workers: int | None, scheduler: str | None) -> "Means":
    if sum(each is not None for each in (threads, workers, scheduler)) > 1:
        raise Refusal("--threads, --workers and --scheduler exclude each other; give one of them.")
    if scheduler is not None and not ((found := _ADDRESS.fullmatch(scheduler)) and int(found["port"]) <= _MOST_PORT):
        raise Refusal(f"--scheduler {scheduler!r} is no address; `dask scheduler` prints its own, tcp://head:8786 say.")
    from microrad.campaign.run import Means

    return Means(threads, workers, scheduler)


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """Within it, an interrupt that says nothing itself says what is in the ledger and how to go on."""
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        said = isinstance(error, KeyboardInterrupt) and str(error)
        if not interrupted(error) or said or not path.is_file():
            raise
        from microrad.campaign.ledger import argument

        words = f"stopped; finished rows are in {path}. Go on with: microrad campaign resume {argument(path)}"
        raise KeyboardInterrupt(words) from None


def _shown(path: Path, as_json: bool) -> Outcome:
    """The state of a ledger, as text or JSON; the exit code says whether the rows keep the limits."""
    from microrad.campaign.statistics.summary import summarise_campaign
    from microrad.report.campaign.data import campaign_data
    from microrad.report.campaign.text import campaign_text
    from microrad.report.campaign.words import verdict

    found = summarise_campaign(path)
    code = MET if verdict(found) == "pass" else UNMET
    if as_json:
        return Outcome(json_text({**campaign_data(found), "ledger": str(path)}), code)
    return Outcome(f"{campaign_text(found, width())}\n\n{path}", code)


@campaigns.command(epilog=examples("microrad campaign init", "microrad campaign init tails.toml"))
@command
def init(
    file: Annotated[Path | None, typer.Argument(help="File to write [default: campaign.toml].")] = None,
) -> Outcome:
    """Write a campaign file with a mission, ready to run.

    The mission is written beside it as leo-geo.toml where there is none. No file is ever overwritten.
    """
    from importlib import resources

    from microrad.campaign.ledger import argument

    file = file or Path("campaign.toml")
    check_target(file, "name another one: microrad campaign init other.toml")
    shipped, mission = resources.files("microrad.mission").joinpath("missions"), file.with_name("leo-geo.toml")
    if not mission.exists():
        write_whole(mission, shipped.joinpath("leo-geo.toml").read_text("utf-8"))
    write_whole(file, shipped.joinpath("campaign.toml").read_text("utf-8"))
    return Outcome(f"{file} written, for {mission}. Next: microrad campaign run {argument(file)}")


@campaigns.command(
    epilog=examples(
        "microrad campaign run campaign.toml",
        "microrad campaign run campaign.toml --ledger tails.ledger --workers 4",
        "microrad campaign run campaign.toml --scheduler tcp://head:8786",
    )
)
@command
def run(
    file: _File,
    ledger: Annotated[
        Path | None, option("--ledger", "LEDGER", "File to write [default: the campaign file's name, with .ledger].")
    ] = None,
    threads: _Threads = None,
    workers: _Workers = None,
    scheduler: _Scheduler = None,
    as_json: Json = False,
) -> Outcome:
    """Run a campaign into a new ledger, and print what the rows say.

    Whatever stops it (Ctrl-C, a kill, a full disk), finished rows are in the ledger, and microrad campaign resume goes
    on to the same results. The exit code is 0 when all rows keep all limits (with a grid: in one of its cells at
    least), and 1 when they do not.
    """
    from microrad.campaign.run import run_campaign

    means = _means(threads, workers, scheduler)
    path = ledger or file.parent / f"{file.stem}.ledger"
    with _kept(path):
        with progress_bar(_LINE_S) as progress:
            run_campaign(file, path, means, progress)
        return _shown(path, as_json)


@campaigns.command(epilog=examples("microrad campaign resume campaign.ledger"))
@command
def resume(
    ledger: _Ledger,
    threads: _Threads = None,
    workers: _Workers = None,
    scheduler: _Scheduler = None,
    as_json: Json = False,
) -> Outcome:
    """Go on with a campaign that stopped, to the results it would have had.

    Refused where microrad, the campaign file or the mission is no longer what it was.
    """
    from microrad.campaign.run import resume_campaign

    means = _means(threads, workers, scheduler)
    with _kept(ledger):
        with progress_bar(_LINE_S) as progress:
            resume_campaign(ledger, means, progress)
        return _shown(ledger, as_json)


@campaigns.command(epilog=examples("microrad campaign status campaign.ledger"))
@command
def status(ledger: _Ledger, as_json: Json = False) -> Outcome:
    """Print how far a campaign is and what its rows say so far; it may be running meanwhile.

    The exit code is 0 when it is complete and its rows keep all limits, and 1 otherwise.
    """
    return _shown(ledger, as_json)


@campaigns.command(epilog=examples("microrad campaign verify campaign.ledger"))
@command
def verify(ledger: _Ledger, as_json: Json = False) -> Outcome:
    """Check every byte of a ledger against its checksums.

    The exit code is 1 when something is damaged; microrad campaign resume does just that again.
    """
    from microrad.campaign import ledger as ledgers
    from microrad.campaign.ledger import argument
    from microrad.report.quantities import counted

    found = ledgers.verify(ledger)
    if as_json:
        return Outcome(json_text({**asdict(found), "sound": found.sound}), int(not found.sound))
    lines = [f"{counted(found.checked, 'chunk')} with a right checksum"]
    lines += [f"damaged: chunk {number} of cell {cell}" for cell, number in found.damaged]
    lines += [f"damaged: {fault}" for fault in found.faults]
    if not found.sound:
        lines.append(f"Next: microrad campaign resume {argument(ledger)} does again what is damaged, and nothing else")
    return Outcome("\n".join(lines), int(not found.sound))


@campaigns.command(
    epilog=examples(
        "microrad campaign export campaign.ledger rows.csv",
        "microrad campaign export campaign.ledger rows.parquet",
        "microrad campaign export campaign.ledger rows.nc",
    )
)
@command
def export(
    ledger: _Ledger,
    file: Annotated[Path, typer.Argument(help="File to write: .nc, .parquet or .csv.", metavar="FILE")],
    overwrite: Overwrite = False,
) -> Outcome:
    """Write the table of rows: drawn inputs, weights, outputs, and why a row failed."""
    from microrad.campaign.export import export_rows
    from microrad.campaign.ledger import Ledger

    begins = _BEGINS.get(file.suffix.lower(), b"")
    check_target(file, "choose another name", overwrite=overwrite, begins=begins)
    with Ledger.open(ledger, write=False) as book:
        export_rows(book, file)
    return Outcome(str(file))


@campaigns.command(
    epilog=examples("microrad campaign report campaign.ledger", "microrad campaign report x.ledger x.html")
)
@command
def report(
    ledger: _Ledger,
    file: Annotated[Path | None, typer.Argument(help="Page to write [default: the ledger's name, .html].")] = None,
    overwrite: Overwrite = False,
) -> Outcome:
    """Write one page with the pictures: distributions, tail, sensitivity, failure region, worst rows."""
    from microrad.campaign.statistics.summary import summarise_campaign
    from microrad.report.campaign.page import campaign_page

    file = file or ledger.parent / f"{ledger.stem}.html"
    check_target(file, "choose another name", overwrite=overwrite, begins=b"<!DOCTYPE html>")
    write_whole(file, campaign_page(summarise_campaign(ledger)))
    return Outcome(str(file))


@campaigns.command(epilog=examples("microrad campaign optimise campaign.toml"))
@command
def optimise(file: _File, threads: _OwnThreads = None, as_json: Json = False) -> Outcome:
    """Find the design of least cost whose rows keep the limits often enough.

    The table optimise of the campaign file says what may change. The optimum is checked with rows that the search has
    not seen. The exit code is 0 when these agree (the 95 % interval of the share of them that keeps each limit reaches
    optimise.confidence, the share that is wanted), and 1 when they do not or no design keeps the limits.
    """
    from microrad.campaign.optimisation.campaign import optimise_campaign
    from microrad.report.campaign.optimum import optimum_data, optimum_text

    with progress_bar(_LINE_S) as progress:
        found = optimise_campaign(file, threads, progress)
    code = MET if found.confirmed else UNMET
    if as_json:
        return Outcome(json_text(optimum_data(found)), code)
    return Outcome(optimum_text(found), code)
