"""A campaign whose rows take milliseconds: one axis of the shipped mission under PI, and how to run it as users do."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import psutil

from microrad.campaign import run
from reference.programs.campaign import Here
from shipped import SHIPPED
from waiting import HANG_S, any_moment, beside, until

LOOP = """
mission = "mission.toml"
seed = 7
runs = {runs}
sampling = "{sampling}"
row_limit = "{row_limit}"
worst = {worst}

[loop]
controller = "PI"
axes = "one"
duration = "{duration}"
settle = "0.1 s"

[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.2 W"
"""


def campaign_file(
    folder, runs=64, *, sampling="random", duration="0.2 s", row_limit="5 min", worst=0, more="", mission=()
):
    """A campaign file in a folder, beside its mission with pieces of the text replaced."""
    text = SHIPPED.read_text(encoding="utf-8")
    for old, new in mission:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "mission.toml").write_text(text, encoding="utf-8")
    path = folder / "campaign.toml"
    path.write_text(
        LOOP.format(runs=runs, sampling=sampling, duration=duration, row_limit=row_limit, worst=worst) + more,
        encoding="utf-8",
    )
    return path


def without_worker(patch):
    """Campaigns of this process that ask for no cluster are computed in it: a worker takes a second to start."""
    engine = run.Means.engine

    def chosen(means, spec, late_s):
        local = means.workers is None and means.scheduler is None
        return Here(spec) if local else engine(means, spec, late_s)

    patch.setattr(run.Means, "engine", chosen)


def import_path(folder="."):
    """A folder in that of the tests, before what a program that is started here imports from anyway."""
    return os.pathsep.join([str(Path(__file__).parent / folder), *filter(None, [os.environ.get("PYTHONPATH")])])


def halting(flag):
    """The environment in which a campaign's command halts behind its first chunk while the file ``flag`` is there."""
    return {"PYTHONPATH": import_path("held"), "MICRORAD_TEST_HALT": str(flag)}


def halted(process, pause=time.sleep):
    """Wait until a command has halted; it has no end before it is continued or killed."""
    stopped = psutil.STATUS_STOPPED, psutil.STATUS_ZOMBIE
    until(lambda: psutil.Process(process).status() in stopped, "the campaign's halt", pause=pause)
    assert psutil.Process(process).status() == psutil.STATUS_STOPPED


def hears_ctrl_c():
    """Take Ctrl-C as a terminal's commands do: tests that run in the background of a shell were told to ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def started(*args, cwd, **environment):
    """A command of the command line, running in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "microrad", "campaign", *map(str, args)],
        cwd=cwd,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a Ctrl-C of the tests is not theirs
        preexec_fn=hears_ctrl_c,  # noqa: PLW1509
    )


def finished(*args, cwd, **environment):
    """The same, waited for: exit code, stdout, stderr."""
    process = started(*args, cwd=cwd, **environment)
    out, err = process.communicate(timeout=HANG_S)
    return process.returncode, out, err


def children(pid):
    """Processes that a process started and that live."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:  # it ended meanwhile
                continue
            if int(fields[1]) == pid and fields[0] != "Z":
                found.append(int(entry.name))
    return found


@contextmanager
def killing(kill, most_s):
    """Call `kill` at random moments, `most_s` (s) at most behind every tenth job that is done: what is left goes on.

    Gives what is to hear each outcome, and passes it on.
    """
    draw, due, over, done = random.Random(2), threading.Semaphore(0), threading.Event(), 0

    def go_on():
        while due.acquire() and not over.is_set():
            any_moment(draw, most_s)
            kill()

    def heard(outcome):
        nonlocal done
        done += outcome.kind == "done"
        if outcome.kind == "done" and done % 10 == 0:
            due.release()
        return outcome

    killer = beside(go_on)
    try:
        yield heard
    finally:
        over.set()
        due.release()
        killer.join(HANG_S)


def kill(pid):
    """Kill -9, of a process that may just have ended."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True
