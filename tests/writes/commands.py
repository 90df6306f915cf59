"""The commands that write, each on the smallest files that take it through all its writes.

What they compute is computed once and kept in this process: what is tried here is how it is written.
"""

import asyncio
import functools
import json
import os
import pickle
import re
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from scipy.io import savemat

import small_campaign
from cli import test_cli_coupled
from cli.test_cli import write_recording
from microrad import cli, report
from microrad.campaign import bundle, run
from microrad.campaign.records import Job, Outcome
from microrad.cli.frame import PROGRESS_FILE, progress_bar
from microrad.core import kept
from microrad.export import choice
from microrad.export.flight import write as flight
from microrad.export.fmi import fmu
from microrad.lab import identify
from microrad.lab.bench import folder as bench
from microrad.lab.identify import coupled
from microrad.report.campaign import page as campaign_pages
from microrad.report.campaign import text as campaign_texts
from microrad.report.identification import coupled as coupled_page
from microrad.report.identification import page as identification
from microrad.report.results import arrays
from microrad.report.study import page as study_pages
from microrad.studio import server
from microrad.studio.jobs import process, queue
from microrad.studio.jobs.queue import Jobs, Order
from microrad.studio.recordings.uploads import Uploads
from microrad.studio.session import Session
from microrad.studio.views import mirror_form, runs
from microrad.study import study
from shipped import SHIPPED, without_day, without_fine_pointing
from small_campaign import campaign_file, without_worker
from writes.layer import Command

PATCH = pytest.MonkeyPatch()
COMPUTED: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
    (run, "load_campaign", Path.read_bytes),
    (bundle, "read_definition", Path.read_bytes),
    (run, "controllers", lambda campaign, *_: campaign.text),
    (campaign_pages, "campaign_page", lambda *_: 0),
    (campaign_texts, "campaign_text", lambda *_: 0),
    (choice, "choose", lambda *args: args[1]),
    (choice, "vectors", lambda chosen, samples: samples),
    (identify, "identify", lambda *_: 0),
    (identification, "identification_page", lambda *_: 0),
    (coupled, "identify_coupled", lambda *_: 0),
    (coupled_page, "coupled_identification_page", lambda *_: 0),
    (bench, "play_records", lambda plan, seed, _: seed),
    (study_pages, "study_page", lambda *_: 0),
    (study, "run_study", lambda file, on_progress, *parts: None if parts else 0),
    (report, "pictures", len),
    (arrays, "study_netcdf", lambda *_: 0),
    (kept, "watched_call", lambda function, *args: (function.__qualname__, pickle.dumps(args))),
)


def here_alone() -> None:
    """Have all be computed in the process of the command, and nothing beside it: its writes have one order."""
    without_worker(PATCH)
    PATCH.setattr(small_campaign.Here, "outcomes", _known_rows())
    PATCH.setattr(os, "cpu_count", lambda: 1)
    PATCH.setattr(queue, "start_waiting", lambda jobs: None)
    for module, name, known in COMPUTED:
        PATCH.setattr(module, name, _once(getattr(module, name), known))
    PATCH.setattr(flight, "compile_and_run", _compiled(flight.compile_and_run))
    PATCH.setattr(flight, "stack_use", _once(flight.stack_use, lambda *_: 0))
    PATCH.setattr(fmu, "subprocess", SimpleNamespace(run=_library(), TimeoutExpired=subprocess.TimeoutExpired))


def _once(function: Callable[..., Any], known: Callable[..., Any]) -> Callable[..., Any]:
    """A function that computes once in all runs for what is ``known`` of its arguments, or each time for None."""
    results = dict[Any, Any]()

    @functools.wraps(function)
    def found(*args: Any, **more: Any) -> Any:
        key = known(*args)
        if key is None:
            return function(*args, **more)
        if key not in results:
            made = function(*args, **more)
            results[key] = list(made) if hasattr(made, "__next__") else made
        return results[key]

    return found


def _known_rows() -> Callable[..., Iterator[Outcome]]:
    """The outcomes of an engine that computes each job once in all runs, and opens its work in each."""
    outcomes, known = small_campaign.Here.outcomes, dict[Job, Outcome]()

    def found(self: Any, jobs: Iterable[Job]) -> Iterator[Outcome]:
        for job in jobs:
            assert self.work
            if job not in known:
                (known[job],) = outcomes(self, [job])
            yield known[job]

    return found


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compiles once; later it leaves what the compiler has left."""
    results = dict[str, Any]()

    def found(folder: Path, name: str) -> Any:
        if name in results:
            (folder / f"{name}_bench").write_bytes(b"program")
        else:
            results[name] = function(folder, name)
        return results[name]

    return found


def _library() -> Callable[..., Any]:
    """Compiles a library once; later its bytes are written, as by the compiler unseen."""
    made = dict[str, bytes]()

    def run_once(command: list[str], cwd: Path, **how: Any) -> Any:
        target = Path(cwd) / command[command.index("-o") + 1]
        if target.name in made:
            subprocess.run(["tee", str(target)], input=made[target.name], stdout=subprocess.DEVNULL, check=True)
            return subprocess.CompletedProcess(command, 0, "", "")
        done = subprocess.run(command, cwd=cwd, check=False, **{name: how[name] for name in how if name != "check"})
        made[target.name] = target.read_bytes()
        return done

    return run_once


def typed(*words: str) -> Callable[[], int]:
    """A command as it is typed, run in this process; its exit code."""

    def does() -> int:
        sys.argv = ["microrad", *words]
        try:
            cli.main()
        except SystemExit as ended:
            return int(ended.code or 0)
        return 0

    return does


def called(function: Callable[[], Any]) -> Callable[[], int]:
    """What the studio does, its refusals said as its pages say them."""

    def does() -> int:
        try:
            function()
        except (ValueError, OSError) as error:
            if isinstance(error, OSError) or type(error).__module__.startswith("microrad."):
                print(f"microrad: {error}")
                return 2
            raise
        return 0

    return does


# -------------------------------------------------------------------------------------------------------------- readers
def rows_of(path: Path) -> dict[str, Any]:
    """What of a ledger is the same in each run."""
    with closing(sqlite3.connect(path)) as ledger:
        assert ledger.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        notes = dict(ledger.execute("SELECT key, value FROM notes"))
        found = {name: ledger.execute(f"SELECT * FROM {name} ORDER BY 1, 2, 3").fetchall() for name in _TABLES}
        return found | {"notes": sorted(notes), "state": notes.get("state")}


_TABLES = ("chunks", "traces")


def timeless(path: Path) -> dict[str, Any]:
    """A note without the time at which it was made."""
    return {key: value for key, value in json.loads(path.read_bytes()).items() if key not in ("at", "pid", "queued")}


def undated(path: Path) -> Any:
    """A MATLAB file, whose head has a date, and a manifest of recordings without their hashes."""
    if path.suffix == ".mat":
        return path.read_bytes()[128:]
    return {key: value for key, value in json.loads(path.read_bytes()).items() if key != "files_sha256"}


def text(path: Path) -> Any:
    """The text of an unsaved mission."""
    return json.loads(path.read_bytes())["text"]


def len_of(path: Path) -> int:
    """Of what is another in each run, its length."""
    return path.stat().st_size


def part(path: Path) -> bool:
    """A kept part is checked by whoever reads it, and so is a line of progress."""
    return path.is_file()


# ------------------------------------------------------------------------------------------------------------- missions
SMALL = without_fine_pointing(without_day(SHIPPED.read_text("utf-8")))


def mission(here: Path) -> None:
    (here / "mission.toml").write_text(SMALL, encoding="utf-8")


CACHE = {"home/cache/*": part}
RUN = ("run", "mission.toml", "--output", "results")


def older(here: Path) -> None:
    """Results of another microrad, to be replaced."""
    mission(here)
    (here / "results").mkdir()
    (here / "results" / "manifest.json").write_text('{"versions": {"microrad": "0.1.0"}, "mission": 1}', "utf-8")
    (here / "results" / "report.html").write_text("an older page", "utf-8")


def shipped(here: Path) -> None:
    shutil.copyfile(SHIPPED, here / "mission.toml")


# ------------------------------------------------------------------------------------------------------------ campaigns
GRID = """
[grid]
"terminals.leo_aperture" = ["6 cm", "7 cm"]

[limits.margin]
least = "1 dB"
"""
LEDGER: dict[str, Any] = {
    "content": {"*.ledger": rows_of, "*.ledger-*": lambda path: None},
    "partly": {"*.ledger": rows_of, "*.ledger-*": lambda path: None},
}


def campaign(here: Path) -> None:
    campaign_file(here, runs=4, worst=1, more=GRID)
    text = re.sub(r"(?m)^ *#.*\n|  +#.*$|^\n", "", (here / "mission.toml").read_text("utf-8"))
    (here / "mission.toml").write_text(text, encoding="utf-8")  # without comments: a ledger holds it twice


def ledger(here: Path) -> None:
    """A campaign that was run."""
    campaign(here)
    assert _quietly(here, typed("campaign", "run", "campaign.toml")) in (0, 1)


def half(here: Path) -> None:
    """A ledger without the half of its rows."""
    ledger(here)
    with closing(sqlite3.connect(here / "campaign.ledger")) as book, book:
        book.execute("DELETE FROM chunks WHERE cell = 1")
        book.execute("DELETE FROM notes WHERE key = 'state'")


def damaged(here: Path) -> None:
    """A ledger with a chunk whose checksum is wrong."""
    ledger(here)
    with closing(sqlite3.connect(here / "campaign.ledger")) as book, book:
        book.execute("UPDATE chunks SET sha256 = zeroblob(32) WHERE cell = 1")


def exported(here: Path) -> None:
    """A campaign with an older table."""
    ledger(here)
    (here / "rows.csv").write_text("cell,older\n", encoding="utf-8")


def _quietly(here: Path, does: Callable[[], int]) -> int:
    """Run a command to prepare another one."""
    back = Path.cwd()
    os.chdir(here)
    try:
        return does()
    finally:
        os.chdir(back)


def export(name: str, *more: str) -> Callable[[], int]:
    return typed("campaign", "export", "campaign.ledger", name, *more)


# ---------------------------------------------------------------------------------------------------------------- bench
PLAN = """
name = "Small"
formats = ["csv", "lvm", "tdms", "mat", "mat73", "npz", "hdf5"]

[limits]
rate = "5 kHz"
drive_min = "0 V"
drive_max = "12 V"
slew = "20 V/ms"
samples_per_period = 10

[bench]
truth = "bench"

[bench.amplifier]
gain = 15
output_min = "0 V"
output_max = "180 V"
bandwidth = "5 kHz"
slew = "1 V/us"

[bench.converters]
bits = 16
drive_min = "-4 V"
drive_max = "16 V"
output_min = "-1 mrad"
output_max = "2 mrad"

[bench.sensor]
noise = "1 urad"
mains = "0 urad"
mains_frequency = "50 Hz"
drift = "0 nrad/s"

[excitation.loop]
kind = "sines"
frequencies = ["50 Hz"]
amplitudes = ["2 V"]
periods = 2
offset = "6 V"
"""


def plan(here: Path) -> None:
    (here / "plan.toml").write_text(PLAN, encoding="utf-8")


def recording(here: Path) -> None:
    write_recording(here / "loop.csv")


def two_axes(here: Path) -> None:
    test_cli_coupled.arrays(here)


def model(here: Path) -> None:
    savemat(here / "model.mat", {"num": [[2.0e4]], "den": [[1.0, 80.0, 2.5e7]]})


UNDATED = {"*.mat": undated, "*/manifest.json": undated}
IDENTIFY = ("identify", "loop.csv", "--input", "drive", "--output", "angle", "--rate", "1000", "--static")
COUPLED = (
    *("identify", "u_100mV.npy", "--output-file", "y_100mV.npy", *test_cli_coupled.AXES),
    *("--output-unit", "um", "--name", "axes"),
)
IMPORT = (
    *("import", "model.mat", "--travel", "2.5 mrad", "--drive", "0 V", "12 V", "--bias", "6 V"),
    *("--rate-limit", "3770 V/s", "--band", "1 Hz", "5 kHz", "--normalise-at", "2 Hz", "--output-unit", "rad"),
)


def after(prepare: Callable[[Path], None], *words: str) -> Callable[[Path], None]:
    """Files behind a command that was run on those of another preparation."""

    def prepared(here: Path) -> None:
        prepare(here)
        assert _quietly(here, typed(*words)) in (0, 1)

    return prepared


# --------------------------------------------------------------------------------------------------------------- studio
def _session() -> Session:
    return Session(Path.cwd())


def _autosave() -> None:
    _session().set("communication.transmit_power", "4 W")


def _save() -> None:
    session = _session()
    session.set("communication.transmit_power", "3 W")  # whatever is kept already, it is kept anew
    session.set("communication.transmit_power", "4 W")
    session.save()


def _save_as() -> None:
    session = _session()
    session.save("other.toml")


def _beside() -> None:
    session = _session()
    session.other = session.draft
    session.other = None


def _write_campaign() -> None:
    if not runs.campaign_files(_session()):
        runs.write_campaign(_session())


def _form() -> None:
    mirror_form.keep_form(_session().studio / "form.json", mirror_form.Form())


def _submit() -> None:
    jobs = Jobs(Path.cwd() / ".microrad-studio")
    if not jobs.listed():
        jobs.submit(Order("study", "a study", ("init",), Path.cwd(), ("leo-geo.toml",)))


def _run_job() -> None:
    """Run a job; one that was lost is removed and started anew."""
    jobs = Jobs(Path.cwd() / ".microrad-studio")
    (job,) = jobs.listed()
    if job.state in ("lost", "unreadable"):
        jobs.remove(job.number)
        _submit()
        (job,) = jobs.listed()
    if job.state == "queued":
        process.run_job(job.folder, ("true",))


def _end_job() -> None:
    jobs = Jobs(Path.cwd() / ".microrad-studio")
    for job in jobs.listed():
        if not job.finished:
            jobs.cancel(job.number)
        jobs.remove(job.number)


def _progress() -> None:
    """What a job notes while it runs: how far it is."""
    os.environ[PROGRESS_FILE] = "progress"
    with progress_bar() as move:
        move(0, 2, "rows")
        move(2, 2, "rows")


def _way_in() -> None:
    server.way_in(_session().studio, "http://127.0.0.1:1/?token=a")


async def _blocks() -> AsyncIterator[bytes]:
    for block in (b"drive,angle\n", b"1,2\n"):
        yield block


def _upload() -> None:
    uploads = Uploads(Path.cwd() / "uploads")
    uploads.hold_temporary_files()
    if not uploads.listed():
        asyncio.run(uploads.save("loop.csv", _blocks()))


def edited(here: Path) -> None:
    studio(here)
    assert _quietly(here, called(_autosave)) == 0


def studio(here: Path) -> None:
    (here / "leo-geo.toml").write_text(SMALL, encoding="utf-8")
    assert _quietly(here, called(_session)) == 0


def queued(here: Path) -> None:
    assert _quietly(here, called(_submit)) == 0


JOB = {"*job.json": timeless, "*.json": timeless, "*job.code": len_of, "*studio-key": len_of, "*/last": len_of}
PROGRESS = {"*/progress": part}
NUMBERED = (r"jobs/\d+\b", "jobs/N")
KEYED = (r"uploads/[0-9a-f]{16}", "uploads/KEY")
COMMANDS = (
    Command("init", typed("init")),
    Command("init --preset", typed("init", "--preset", "click", "click.toml")),
    Command("campaign init", typed("campaign", "init")),
    Command(
        "campaign run",
        typed("campaign", "run", "campaign.toml"),
        campaign,
        typed("campaign", "resume", "campaign.ledger"),
        **LEDGER,
    ),
    Command("campaign resume", typed("campaign", "resume", "campaign.ledger"), half, **LEDGER),
    Command("campaign resume, damaged", typed("campaign", "resume", "campaign.ledger"), damaged, **LEDGER),
    Command("campaign export csv", export("rows.csv"), ledger, export("rows.csv", "--overwrite"), **LEDGER),
    Command(
        "campaign export parquet",
        export("rows.parquet"),
        ledger,
        export("rows.parquet", "--overwrite"),
        threads=True,
        **LEDGER,
    ),
    Command("campaign export nc", export("rows.nc"), ledger, export("rows.nc", "--overwrite"), **LEDGER),
    Command("campaign export --overwrite", export("rows.csv", "--overwrite"), exported, **LEDGER),
    Command(
        "campaign report",
        typed("campaign", "report", "campaign.ledger"),
        ledger,
        typed("campaign", "report", "campaign.ledger", "--overwrite"),
        **LEDGER,
    ),
    Command(
        "bench",
        typed("bench", "plan.toml", "--output", "bench"),
        plan,
        typed("bench", "plan.toml", "--output", "bench", "--overwrite"),
        content=UNDATED,
    ),
    Command(
        "bench --overwrite",
        typed("bench", "plan.toml", "--output", "bench", "--seed", "1", "--overwrite"),
        after(plan, "bench", "plan.toml", "--output", "bench"),
        content=UNDATED,
    ),
    Command("identify", typed(*IDENTIFY), recording, typed(*IDENTIFY, "--overwrite")),
    Command(
        "identify --overwrite",
        typed(*IDENTIFY, "--name", "another", "--mirror-file", "loop-mirror.toml", "--overwrite"),
        after(recording, *IDENTIFY),
    ),
    Command("identify, two axes", typed(*COUPLED), two_axes, typed(*COUPLED, "--overwrite")),
    Command("import", typed(*IMPORT), model, typed(*IMPORT, "--overwrite")),
    Command(
        "export c",
        typed("export", "c", "mission.toml", "--controller", "PI", "--output", "flight"),
        shipped,
        typed("export", "c", "mission.toml", "--controller", "PI", "--output", "flight", "--overwrite"),
    ),
    Command(
        "export fmu",
        typed("export", "fmu", "mission.toml"),
        shipped,
        typed("export", "fmu", "mission.toml", "--overwrite"),
    ),
    Command(
        "export matrices",
        typed("export", "matrices", "mission.toml"),
        shipped,
        typed("export", "matrices", "mission.toml", "--overwrite"),
    ),
    Command(
        "run",
        typed(*RUN),
        mission,
        typed(*RUN, "--overwrite"),
        partly=CACHE,
    ),
    Command(
        "run --overwrite",
        typed("run", "mission.toml", "--output", "results", "--overwrite"),
        older,
        partly=CACHE,
    ),
    Command("reproduce", typed("reproduce", "results"), after(mission, *RUN), partly=CACHE),
    Command("campaign status", typed("campaign", "status", "campaign.ledger"), ledger, **LEDGER),
    Command("campaign verify", typed("campaign", "verify", "campaign.ledger"), ledger, **LEDGER),
    Command("studio: begin", called(_session), mission),
    Command("studio: way in", called(_way_in), studio),
    Command("studio: edit", called(_autosave), studio),
    Command("studio: save", called(_save), edited, content={"*/draft.json": text}, partly={"*/draft.json": text}),
    Command("studio: save as", called(_save_as), studio),
    Command("studio: second mission", called(_beside), studio, partly={"*/other.json": timeless}),
    Command("studio: campaign", called(_write_campaign), studio),
    Command("studio: form", called(_form), studio),
    # a kill in the one moment in which the studio's key has two names leaves the second one
    Command("studio: job", called(_submit), content=JOB, named=NUMBERED, stays="home/state/microrad/*.draft"),
    Command("studio: run of a job", called(_run_job), queued, content=JOB, named=NUMBERED),
    Command("studio: progress of a job", called(_progress), content=PROGRESS, partly=PROGRESS),
    Command("studio: end of a job", called(_end_job), queued, partly={"*/cancel": part}, named=NUMBERED),
    Command("studio: recording", called(_upload), named=KEYED),
)

WRITERS = {
    "campaign/bundle.py": "campaign run",
    "campaign/engines/local.py": "a folder among the temporary files for each worker, as campaign/bundle.py has one",
    "campaign/export.py": "campaign export nc",
    "campaign/ledger/file.py": "campaign run",
    "campaign/ledger/mending.py": "campaign resume, damaged",
    "cli/__init__.py": "init",
    "cli/campaign.py": "campaign init",
    "cli/coupled.py": "identify, two axes",
    "cli/export.py": "import",
    "cli/frame.py": "studio: progress of a job",
    "cli/installation.py": "tries whether the cache of the compiled loops can be written, by a file without a name",
    "cli/lab.py": "identify",
    "core/folder.py": "bench --overwrite",
    "core/kept.py": "run",
    "cli/verify.py": "each file as `init` writes its own, behind half a minute of evidence",
    "export/flight/stack.py": "a folder among the temporary files, as export/fmi/fmu.py has one",
    "export/flight/write.py": "export c",
    "export/fmi/fmu.py": "export fmu",
    "export/matrices/files.py": "export matrices",
    "lab/bench/folder.py": "bench",
    "lab/live_fit.py": "adds a line for the page that looks on, which leaves out one that is cut",
    "report/__init__.py": "run",
    "report/identification/coupled.py": "identify, two axes",
    "report/identification/page.py": "identify",
    "report/verification/checks/draws.py": "missions and campaigns in a folder among the temporary files",
    "report/verification/checks/fades.py": "missions in a folder among the temporary files",
    "report/verification/checks/ground.py": "missions in a folder among the temporary files",
    "report/verification/checks/operation.py": "missions in a folder among the temporary files",
    "report/verification/checks/search.py": "missions in a folder among the temporary files",
    "report/verification/workspace.py": "the shipped mission in a folder among the temporary files",
    "report/results/manifest.py": "run",
    "report/results/manifest_reader.py": "reproduce",
    "report/results/reproduce.py": "reproduce",
    "studio/draft/draft.py": "studio: save",
    "studio/guard/plain_files.py": "studio: begin",
    "studio/guard/signing.py": "studio: job",
    "studio/jobs/files.py": "studio: run of a job",
    "studio/jobs/process.py": "studio: run of a job",
    "studio/jobs/queue.py": "studio: job",
    "studio/recordings/uploads.py": "studio: recording",
    "studio/server.py": "studio: way in",
    "studio/session.py": "studio: edit",
    "studio/views/mirror_form.py": "studio: form",
    "studio/views/runs.py": "studio: campaign",
}
"""The files of the package that write, each with a command that takes it through that, or why there is none."""
