"""What the page of runs shows: what can be started from the files of the folder, and a job in words."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from importlib import resources
from pathlib import Path

from microrad.core.folder import path_argument, read_bytes, write_whole
from microrad.core.units import format_quantity
from microrad.mission.toml import MAX_BYTES, scan
from microrad.report.quantities import duration
from microrad.studio.commands import Action, campaign_report
from microrad.studio.jobs.queue import Job, JobError, Kind, Order, Progress
from microrad.studio.session import Session

_VERDICTS = {
    ("study", 0): "every requirement is met",
    ("study", 1): "not every requirement is met",
    ("campaign", 0): "the rows keep the limits",
    ("campaign", 1): "the rows do not keep the limits",
}


def order(session: Session, kind: Kind, action: Action) -> Order:
    """An action as a job in the working folder.

    Args:
        session: the session of all tabs.
        kind: that of the job.
        action: what is to be run.
    """
    return Order(kind, action.title, action.arguments, session.folder, action.results)


def report_order(session: Session, ledger: Path) -> Order:
    """The report of a ledger as a job, under a name that is free.

    Args:
        session: the session of all tabs.
        ledger: the ledger, seen from the working folder.
    """
    return order(session, "export", campaign_report(ledger, Path(free_name(session, ledger.stem, ".html"))))


# -------------------------------------------------------------------------------------------------- what can be started
def free_name(session: Session, stem: str, ending: str = "") -> str:
    """A name in the working folder that nothing has yet, and no job that is still to run will take.

    Args:
        session: the session of all tabs.
        stem: beginning of the name.
        ending: its end, with the dot.
    """
    taken = {Path(each).parts[0] for job in session.jobs.listed() if not job.finished for each in job.results if each}
    number, name = 1, f"{stem}{ending}"
    while (session.folder / name).exists() or name in taken:
        number += 1
        name = f"{stem}-{number}{ending}"
    return name


def campaign_files(session: Session) -> tuple[str, ...]:
    """The campaign files of the working folder: those that name a mission."""
    return tuple(path.name for path in session.missions() if _names_a_mission(path))


def _names_a_mission(path: Path) -> bool:
    with suppress(OSError):
        about = path.stat()
        return about.st_size <= MAX_BYTES and _of_campaign(path, about.st_mtime_ns, about.st_size)
    return False


@lru_cache(maxsize=256)
def _of_campaign(path: Path, changed_ns: int, size: int) -> bool:
    """Whether a file, as it was changed last, names a mission. It is not parsed: a parser may take minutes for it."""
    with suppress(OSError, ValueError):
        text = read_bytes(path, MAX_BYTES).decode("utf-8").replace("\r\n", "\n")
        return any(s.key == "mission" and s.value[:1] in ("'", '"') for s in scan(text))
    return False


def ledgers(session: Session) -> tuple[str, ...]:
    """The ledgers of the working folder."""
    return tuple(sorted(path.name for path in session.folder.glob("*.ledger") if path.is_file()))


def write_campaign(session: Session) -> Path:
    """Write the shipped campaign for the mission that is being edited; raises `JobError` where it has no file yet."""
    mission = session.draft.path
    if not mission.is_file():
        raise JobError(f"{session.name_of(mission)} is not saved yet, and a campaign reads it from its file; save it")
    text = resources.files("microrad.mission").joinpath("missions", "campaign.toml").read_text("utf-8")
    path = session.inside(free_name(session, "campaign", ".toml"))
    named = json.dumps(session.name_of(mission), ensure_ascii=False)  # with quotes in the name escaped
    write_whole(path, text.replace('mission = "leo-geo.toml"', f"mission = {named}", 1))
    return path


# ------------------------------------------------------------------------------------------------------- a job in words
def state_words(job: Job) -> str:
    """The state of a job, with what was found where it is over."""
    if job.state == "running":
        return "stopping ..." if job.cancelling else "running"
    verdict = _VERDICTS.get((job.kind, job.code if job.code is not None else -1), "")
    if job.state == "queued":
        return "waiting for the job before it"
    return f"done: {verdict}" if job.state == "done" and verdict else job.state


def progress_words(progress: Progress | None) -> str:
    """How far a job is, how fast, and how long it may still take."""
    if progress is None:
        return "starting"
    words = f"{_percent(progress.share)}, {progress.done} of {progress.total}{_what(progress)}"
    if progress.rate_1_s:
        left_s = max(progress.total - progress.done, 0) / progress.rate_1_s
        words += f"; {format_quantity(progress.rate_1_s, 'a second', 3)}, {duration(left_s)} left"
    return words


def _percent(share: float) -> str:
    """A share in per cent; all of it alone is 100 %."""
    if 0.0 < share < 0.0995:
        return f"{100.0 * share:.1f} %"
    return f"{100.0 * share if share >= 1.0 else min(100.0 * share, 99.0):.0f} %"


def _what(progress: Progress) -> str:
    """What is being done; a campaign's own pace, which is that since it began, is left out."""
    return " rows" if progress.what == "rows" or " rows/s" in progress.what else f": {progress.what}"


def time_words(job: Job, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> str:
    """When a job began, and how long it took or takes.

    Args:
        job: the job.
        now: tells the time, in UTC.
    """
    if not job.started:
        return f"put in the queue {_at(job.queued)}" if job.queued else ""
    begun, ended = _read(job.started), _read(job.ended) or now()
    took = "" if begun is None else f", {duration(round(max((ended - begun).total_seconds(), 0.0)))}"
    return f"started {_at(job.started)}{took}"


def _at(time: str) -> str:
    read = _read(time)
    return "" if read is None else f"{read:%Y-%m-%d %H:%M:%S} UTC"


def _read(time: str) -> datetime | None:
    """A noted time in UTC, which one without a zone is taken for; None for what is none."""
    with suppress(ValueError, OverflowError):
        read = datetime.fromisoformat(time)
        return read.replace(tzinfo=UTC) if read.tzinfo is None else read.astimezone(UTC)
    return None


@dataclass(frozen=True, slots=True)
class Others:
    """A campaign's job among the others: whether none goes on with its ledger, whether it is the last campaign.

    `report` is the job that writes or has written a report of the ledger as it is now.
    """

    newest: bool = False
    latest: bool = False
    report: Job | None = None


def others(jobs: Iterable[Job], job: Job) -> Others:
    """A job among all of them.

    Args:
        jobs: all jobs.
        job: one of them.
    """
    ledger = ledger_of(job)
    later = [each for each in jobs if each.number > job.number]
    campaigns = [ledger_of(each) for each in later if each.kind == "campaign"]
    if ledger is None or ledger in campaigns:
        return Others()
    about = ("campaign", "report", path_argument(Path(ledger)))
    reports = (each for each in later if each.arguments[:3] == about and _may_show(each))
    return Others(newest=True, latest=not campaigns, report=next(reports, None))


def _may_show(report: Job) -> bool:
    """Whether the result of a report's job is there, or is to be."""
    return not report.finished or (report.state == "done" and (report.cwd / report.results[0]).is_file())


def ledger_of(job: Job) -> str | None:
    """The ledger that a campaign writes, as its job names it."""
    return next((name for name in job.results if name.endswith(".ledger")), None) if job.kind == "campaign" else None


def ledger_path(session: Session, job: Job) -> Path | None:
    """The ledger of a campaign's job, where it lies in the working folder; it may not be there yet.

    Args:
        session: the session of all tabs.
        job: any job.
    """
    ledger = ledger_of(job)
    path = None if ledger is None else job.cwd / ledger
    return path if path is not None and _is_inside(session, path) else None


def result_files(session: Session, job: Job) -> tuple[tuple[int, str], ...]:
    """The results of a job that are there: their places among them, and their names.

    Where a job has failed or was cancelled, files of these names are another run's; a campaign alone writes as it goes.

    Args:
        session: the session of all tabs.
        job: any job.
    """
    if job.kind != "campaign" and job.state in ("failed", "cancelled"):
        return ()
    found = ((place, name, job.cwd / name) for place, name in enumerate(job.results))
    return tuple((place, name) for place, name, path in found if path.is_file() and _is_inside(session, path))


def _is_inside(session: Session, path: Path) -> bool:
    with suppress(OSError, RuntimeError):
        return path.resolve().is_relative_to(session.folder)
    return False
