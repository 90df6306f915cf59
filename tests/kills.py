"""Commands that are killed at random moments: whatever is left is whole, and going on ends as if nothing had been.

    PYTHONPATH=src:tests:scripts python tests/kills.py --kills 200 [NAME...] each command by default, and what it found

A kill is SIGKILL of one of the processes that the command has then: itself, a worker, or what runs a job of the studio.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from command_line import listing
from microrad.campaign.export import export_rows
from microrad.campaign.ledger import mending
from microrad.campaign.ledger.ledger import Ledger
from microrad.mirror.hysteresis import PrandtlIshlinskii
from shipped import SHIPPED, without_day, without_fine_pointing
from small_campaign import campaign_file
from waiting import any_moment, until

MARK = "MICRORAD_TEST_KILLS"
"""The variable of the environment by which the processes of a command are known, those that outlive it, too."""

_PACKAGE = Path(mending.__file__).parents[2]
_CODES = (0, 1)  # of a command that has ended by itself and said what it found
LEDGER, FOLDERS = "campaign.ledger", ("cache", "state", "tmp")


@dataclass(frozen=True)
class Victim:
    """A command: how its folder is made, what is called in it, and what has to be there when it has ended.

    ``check`` holds what a killed one left in a folder against the whole.
    """

    prepare: Callable[[Path], None]
    command: Callable[[Path], tuple[str, ...]]
    found: Callable[[Path], dict[str, bytes]]
    check: Callable[[Path, dict[str, bytes]], None]


def microrad(*words: str) -> tuple[str, ...]:
    """A command of the command line."""
    return (sys.executable, "-m", "microrad", *words)


# ------------------------------------------------------------------------------------------------------------ campaigns
def _campaign(folder: Path) -> None:
    campaign_file(
        folder, runs=260, duration="0.3 s", more='[grid]\n"communication.data_rate" = ["90 Mbit/s", "1 Gbit/s"]\n'
    )


def _going_on(folder: Path) -> tuple[str, ...]:
    """Words of the command that begins a campaign, or goes on with it."""
    return ("campaign", "resume", LEDGER) if (folder / LEDGER).exists() else ("campaign", "run", "campaign.toml")


def _processes(folder: Path) -> tuple[str, ...]:
    return microrad(*_going_on(folder), "--threads", "2")


_ON_DASK = """
import sys, traceback
from distributed import LocalCluster
from microrad.cli import main
try:
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        sys.argv = ["microrad", *sys.argv[1:], "--scheduler", cluster.scheduler_address]
        main()
except Exception:  # of a cluster whose worker was killed while it began or ended: not the code 1 of the command
    traceback.print_exc()
    sys.exit(3)
"""


def _dask(folder: Path) -> tuple[str, ...]:
    return (sys.executable, "-c", _ON_DASK, *_going_on(folder))


_AS_JOB = """
import sys, time
from pathlib import Path
from microrad.studio.jobs.queue import Jobs, Order
jobs = Jobs(Path("studio"))
number = jobs.submit(Order("campaign", "t", tuple(sys.argv[1:]), Path(), ("campaign.ledger",))).number
while not jobs.get(number).finished:
    time.sleep(0.05)
sys.exit(0 if jobs.get(number).state == "done" else 3)
"""


def _job(folder: Path) -> tuple[str, ...]:
    return (sys.executable, "-c", _AS_JOB, *_going_on(folder), "--threads", "1")


def _rows(folder: Path) -> dict[str, bytes]:
    """The table of the rows."""
    with Ledger.open(folder / LEDGER, write=False) as opened:
        export_rows(opened, folder / "rows.csv")
    return {"rows": (folder / "rows.csv").read_bytes()}


def _undamaged(folder: Path, _: dict[str, bytes]) -> None:
    """That a ledger is whole, whatever rows are in."""
    if (folder / LEDGER).exists():
        verified = mending.verify(folder / LEDGER)
        assert (verified.damaged, verified.faults) == ((), ()), verified


# ------------------------------------------------------------------------------------------------- studies and mirrors
def _mission(folder: Path) -> None:
    """A short one: the shorter the study, the more kills meet what is written."""
    text = without_fine_pointing(without_day(SHIPPED.read_text(encoding="utf-8")))
    (folder / "mission.toml").write_text(text, encoding="utf-8")


def _recording(folder: Path) -> None:
    time_s = np.arange(4000) * 5e-4
    drive_v = 30.0 + 8.0 * np.sin(2 * np.pi * 3 * time_s)
    angle = 1e6 * PrandtlIshlinskii((0.0, 1.0, 2.0), (40e-6, 6e-6, 4e-6)).response(drive_v - 30.0, 5e-4)
    rows = np.column_stack([time_s, drive_v, angle + 0.2 * np.random.default_rng(1).standard_normal(4000)])
    np.savetxt(folder / "loop.csv", rows, delimiter=",", header="time,drive,angle", comments="", fmt="%.9g")


def _files(folder: Path) -> dict[str, bytes]:
    """All that a command leaves, but for what it keeps for its next run."""
    return {name: data for name, data in listing(folder).items() if name.split("/")[0] not in FOLDERS}


def _each_whole(folder: Path, wanted: dict[str, bytes]) -> None:
    """That what stands where a user looks for it is whole: drafts and folders of a killed run have names with a dot."""
    for name, data in _files(folder).items():
        assert any(part.startswith(".") for part in Path(name).parts) or wanted[name] == data, name


_RUN = microrad("run", "mission.toml", "--output", "out", "--overwrite")
_IDENTIFY = microrad(
    *(
        "identify",
        "loop.csv",
        "--input",
        "drive",
        "--output",
        "angle",
        "--output-unit",
        "urad",
        "--static",
        "--overwrite",
    )
)
VICTIMS = {
    "campaign, processes": Victim(_campaign, _processes, _rows, _undamaged),
    "campaign, Dask": Victim(_campaign, _dask, _rows, _undamaged),
    "studio's job": Victim(_campaign, _job, _rows, _undamaged),
    "run": Victim(_mission, lambda _: _RUN, _files, _each_whole),
    "identify": Victim(_recording, lambda _: _IDENTIFY, _files, _each_whole),
}


# ---------------------------------------------------------------------------------------------------------------- kills
def members(mark: str) -> list[psutil.Process]:
    """The processes that carry a mark."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.environ().get(MARK) == mark and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
    return found


def _started(victim: Victim, folder: Path, mark: str) -> subprocess.Popen[str]:
    for name in FOLDERS:
        (folder / name).mkdir(exist_ok=True)
    own = {
        MARK: mark,
        "XDG_STATE_HOME": str(folder / "state"),
        "TMPDIR": str(folder / "tmp"),
        "MICRORAD_KEEP": "no",
        "PYTHONPATH": os.pathsep.join([str(_PACKAGE.parent), str(Path(__file__).parent)]),  # this tree
    }
    with (folder.parent / f"{folder.name}.said").open("a", encoding="utf-8") as said:
        return subprocess.Popen(
            victim.command(folder),
            cwd=folder,
            env={**os.environ, **own},
            stdout=subprocess.DEVNULL,
            stderr=said,
            text=True,
            start_new_session=True,
        )


def killed(name: str, kills: int, seed: int, place: Path) -> Counter[str]:
    """Kill a command so often, go on each time, and hold what it leaves against an undisturbed one.

    Args:
        name: One of `VICTIMS`.
        kills: How many kills have to hit a process.
        seed: Of the moments and of the processes that are hit.
        place: An empty folder.

    Returns:
        How many kills hit the command itself, and how many another of its processes.
    """
    victim, dice, hits = VICTIMS[name], random.Random(seed), Counter[str]()
    whole = place / "undisturbed"
    whole.mkdir()
    victim.prepare(whole)
    began = time.monotonic()
    assert _started(victim, whole, f"{os.getpid()}-whole").wait() in _CODES
    most_s = time.monotonic() - began
    wanted, left = victim.found(whole), _names(whole)
    attempt, folder = 0, None
    while sum(hits.values()) < kills or folder is not None:
        attempt += 1
        if folder is None:
            folder = place / f"killed-{attempt}"
            folder.mkdir()
            victim.prepare(folder)
        mark = f"{os.getpid()}-{attempt}"
        process, before = _started(victim, folder, mark), sum(hits.values())
        while process.poll() is None and sum(hits.values()) < kills:
            any_moment(dice, most_s, process)
            living = members(mark)
            if living and process.poll() is None:
                hit = dice.choice(living)
                with suppress(psutil.NoSuchProcess):
                    hit.kill()
                    hits["itself" if hit.pid == process.pid else "another process"] += 1
        done = process.wait() in _CODES
        until(lambda mark=mark: not members(mark), f"the end of what {name} had started")
        said = (place / f"{folder.name}.said").read_text(encoding="utf-8")
        assert f'File "{_PACKAGE}' not in said, said  # libraries may say how their own processes were killed
        assert done or sum(hits.values()) > before, said  # whoever was not killed ends well
        if done:
            assert victim.found(folder) == wanted
            now = _names(folder)
            assert now == left, (set(now) ^ set(left), said)
            shutil.rmtree(folder)
            folder = None
        else:
            victim.check(folder, wanted)
    return hits


def _names(folder: Path) -> list[str]:
    """What stands in a folder when all has ended, but for the studio's own of each job and Dask's of its workers."""
    return [name for name in sorted(listing(folder)) if not name.startswith(("studio/", "tmp/dask-scratch-space"))]


def main() -> None:
    """Kill the commands that are named, and print how often and what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(VICTIMS))
    parser.add_argument("--kills", type=int, default=200, help="that hit, of each command")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for name in given.names or VICTIMS:
        with tempfile.TemporaryDirectory() as place:
            began = time.monotonic()
            hits = killed(name, given.kills, given.seed, Path(place))
            took = time.monotonic() - began
        print(f"{name}: {dict(hits)}, in {took:.0f} s: as undisturbed, nothing left behind", flush=True)


if __name__ == "__main__":
    main()
