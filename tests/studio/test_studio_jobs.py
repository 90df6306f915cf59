"""Jobs of the studio: processes of their own, whose state is read from files alone."""

import errno
import json
import os
import platform
import re
import shutil
import signal
import sqlite3
import stat
import subprocess
import sys
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad.campaign.engines import worker
from microrad.campaign.statistics.interim import Interim
from microrad.core import kept
from microrad.studio.jobs import command
from microrad.studio.jobs import files as jobs_files
from microrad.studio.jobs import process as jobs_process
from microrad.studio.jobs import queue as jobs_module
from microrad.studio.jobs.queue import JobError, Jobs, Order
from small_campaign import campaign_file, children, halted, halting, kill
from studio_jobs import written
from waiting import HANG_S, gone, lines_of, until

ONE_WORKER = ("--threads", "1")
"""Of a campaign: a worker takes a second to start."""


@pytest.fixture
def studio(tmp_path):
    """The jobs of an empty working folder; what is still running at the end of a test is ended."""
    jobs = Jobs(tmp_path / ".microrad-studio")
    yield jobs
    for job in map(jobs_files.read_job, jobs_files.job_folders(jobs.folder)):
        if not job.finished:
            (job.folder / "cancel").touch()
    for folder in jobs_files.job_folders(jobs.folder):
        ended(folder)
    for own in jobs_process._started:
        own.wait(HANG_S)


def ended(folder):
    until(lambda: jobs_files.read_job(folder).finished, f"the end of the job in {folder}")
    return jobs_files.read_job(folder)


def order(tmp_path, *arguments, kind="study", title="a title", results=()):
    return Order(kind, title, arguments, tmp_path, results)


@contextmanager
def running(studio, tmp_path):
    """A job that runs for as long as it is held here: its folder."""
    folder = written(studio.folder, cwd=str(tmp_path), kind="campaign")
    with jobs_files.held(folder / "alive", 0.0):
        jobs_files.note(folder / "started.json")
        yield folder


def python(code):
    return (sys.executable, "-c", code)


# ------------------------------------------------------------------------------------------------------------ one job
@pytest.mark.promise("studio-15", "studio-16")
def test_a_job_runs_by_itself_and_leaves_its_output_and_code(studio, tmp_path):
    job = studio.submit(order(tmp_path, "init", "mine.toml", results=("mine.toml",)))
    assert (job.number, job.title, job.kind, job.results) == (1, "a title", "study", ("mine.toml",))
    job = ended(job.folder)
    assert (job.state, job.code, job.words) == ("done", 0, "")
    assert studio.output(1) == "mine.toml written. Next: microrad run mine.toml\n"
    assert (tmp_path / "mine.toml").is_file()
    assert job.queued <= job.started <= job.ended
    assert job.started.endswith("Z")


@pytest.mark.promise("studio-8")
def test_what_a_job_keeps_is_for_its_owner_alone(studio, tmp_path):
    job = studio.submit(order(tmp_path, "presets"))
    for folder in (studio.folder.parent, studio.folder, job.folder):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    ended(job.folder)


def test_a_failed_job_says_what_the_command_line_said(studio, tmp_path, call, monkeypatch):
    job = ended(studio.submit(order(tmp_path, "run", "none.toml")).folder)
    assert (job.state, job.code) == ("failed", 2)
    monkeypatch.chdir(tmp_path)
    assert f"microrad: {job.words}\n" == call("run", "none.toml").err
    assert "the mission file does not exist" in job.words


@pytest.mark.promise("studio-19")
def test_a_job_takes_what_the_command_line_has_kept_unless_the_environment_says_no(tmp_path, monkeypatch):
    """The part is the number of the process that made it."""
    code = "import os; from microrad.core import kept; print(kept.of_user().part(os.getpid))"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for keep in ("yes", "no"):
        monkeypatch.setenv("MICRORAD_KEEP", keep)
        assert kept.of_user().part(os.getpid) == os.getpid()
        folder = written(tmp_path / keep, cwd=str(tmp_path))
        jobs_process.run_job(folder, python(code))
        made_here = jobs_files.output(folder, "stdout") == f"{os.getpid()}\n"
        assert made_here == (keep == "yes")


@pytest.mark.promise("studio-19")
def test_a_job_keeps_its_parts_for_the_command_line_and_other_jobs_unless_the_environment_says_no(
    tmp_path, monkeypatch
):
    """The part is the number of the process that made it."""
    code = "import os; from microrad.core import kept; print(kept.of_user().part(os.getpid), os.getpid())"
    for keep in ("yes", "no"):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / keep / "cache"))
        monkeypatch.setenv("MICRORAD_KEEP", keep)
        said = []
        for number in (1, 2):
            folder = written(tmp_path / keep / "jobs", number, cwd=str(tmp_path))
            jobs_process.run_job(folder, python(code))
            said.append(jobs_files.output(folder, "stdout").split())
        (first, maker), (second, other) = said
        assert first == maker != other
        assert (second == maker) == (keep == "yes")
        monkeypatch.setenv("MICRORAD_KEEP", "yes")
        assert (str(kept.of_user().part(os.getpid)) == maker) == (keep == "yes")


def test_of_a_long_output_its_end_is_read(tmp_path):
    (tmp_path / "stdout").write_text("".join(f"{k}\n" for k in range(100_000)))
    found = jobs_files.output(tmp_path, "stdout")
    assert found.endswith("99998\n99999\n") and len(found) == 200_000


def test_a_job_that_ends_with_1_is_done(tmp_path):
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    jobs_process.run_job(folder, python("raise SystemExit(1)"))
    assert (jobs_files.read_job(folder).state, jobs_files.read_job(folder).code) == ("done", 1)


@pytest.mark.parametrize(("printed", "state"), [("the verdict", "done"), ("", "cancelled")])
def test_a_job_that_ends_with_1_while_it_is_cancelled_is_done_if_it_says_what_it_found(tmp_path, printed, state):
    """Python ends with 1, too, when it is interrupted as it begins."""
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    code = (
        "import pathlib, signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        f"pathlib.Path({str(folder / 'cancel')!r}).touch(); print({printed!r}, end=''); raise SystemExit(1)\n"
    )
    jobs_process.run_job(folder, python(code))
    assert (jobs_files.read_job(folder).state, jobs_files.read_job(folder).code) == (state, 1)


@pytest.mark.promise("studio-29")
def test_a_job_ended_by_a_signal_says_which(tmp_path):
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    jobs_process.run_job(folder, python("import os; os.kill(os.getpid(), 9)"))
    job = jobs_files.read_job(folder)
    assert (job.state, job.code) == ("failed", -9)
    assert "ended by signal 9; signal 9 is often that of a machine out of memory" in job.words


def test_a_job_is_run_by_its_first_process_alone(tmp_path):
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    jobs_process.run_job(folder, python("print('first')"))
    jobs_process.run_job(folder, python("print('second')"))
    assert jobs_files.output(folder, "stdout") == "first\n"


def test_no_file_of_the_working_folder_is_taken_for_a_module(studio, tmp_path):
    (tmp_path / "microrad.py").write_text("print('mine')")
    (tmp_path / "json.py").write_text("print('mine')")
    job = ended(studio.submit(order(tmp_path, "presets")).folder)
    assert job.state == "done"
    assert "mine" not in studio.output(job.number)


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-4")
def test_a_job_goes_on_when_whoever_started_it_is_gone(tmp_path):
    """The page and its server are there to look on: both may be killed."""
    campaign_file(tmp_path, runs=64)
    code = (
        "from pathlib import Path; from microrad.studio.jobs.queue import Jobs, Order; import os, signal\n"
        "jobs = Jobs(Path('studio'))\n"
        "jobs.submit(Order('study', 't', ('presets',), Path('.')))\n"
        "jobs.submit(Order('study', 't', ('init', 'after.toml'), Path('.')))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    server = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False)
    assert server.returncode == -signal.SIGKILL
    folder = tmp_path / "studio" / "jobs"
    ended(folder / "2")  # nobody looks on
    assert [jobs_files.read_job(folder / name).state for name in "12"] == ["done", "done"]
    assert (tmp_path / "after.toml").is_file()


# ----------------------------------------------------------------------------------------------------------- progress
def progress_of(tmp_path, *notes, more=""):
    lines = [json.dumps(dict(zip(("at", "done", "total", "what"), note, strict=True))) for note in notes]
    (tmp_path / "progress").write_text("\n".join(lines) + more)
    return jobs_files.read_progress(tmp_path)


def test_the_rate_is_that_of_this_phase_over_the_last_minute(tmp_path):
    found = progress_of(tmp_path, (0.0, 50, 90, "x"), (10.0, 0, 100, "x"), (100.0, 10, 100, "x"), (140.0, 30, 100, "x"))
    assert found.rate_1_s == pytest.approx(20 / 40)
    assert found.share == pytest.approx(0.3)


def test_steps_with_names_of_their_own_have_no_rate(tmp_path):
    found = progress_of(tmp_path, (0.0, 1, 4, "budgets"), (2.0, 2, 4, "the day"))
    assert (found.done, found.total, found.what, found.rate_1_s) == (2, 4, "the day", None)


@pytest.mark.parametrize("wrong", [{"total": 10**400}, {"done": -1}, {"at": 1e999}])
def test_progress_that_nothing_counts_to_is_not_believed(tmp_path, wrong):
    good = {"at": 1.0, "done": 1, "total": 2, "what": "x"}
    (tmp_path / jobs_files.PROGRESS).write_text(f"{json.dumps(good)}\n{json.dumps(good | wrong)}\n", "utf-8")
    assert jobs_files.read_progress(tmp_path) == jobs_files.Progress(1, 2, "x", None)


@pytest.mark.parametrize(
    ("notes", "rate"),
    [
        (((0.0, 0, 100, "x"), (60.0, 30, 100, "x")), 0.5),
        (((0.0, 0, 100, "x"), (60.5, 30, 100, "x")), None),  # more than a minute ago
        (((0.0, 50, 100, "x"), (1.0, 10, 100, "x"), (3.0, 20, 100, "x")), 5.0),  # it began anew
        (((0.0, 5, 100, "x"), (10.0, 5, 100, "x")), None),
        (((5.0, 1, 100, "x"), (5.0, 3, 100, "x")), None),
        (((0.0, 1, 4, "x"), (2.0, 2, 4, "x")), 0.5),  # few, but of one kind
        (((0.0, 1, 19, "a"), (2.0, 2, 19, "b")), None),
        (((0.0, 1, 20, "a"), (2.0, 2, 20, "b")), 0.5),
        (((0.0, 1, 40, "a"), (2.0, 2, 41, "a")), None),
    ],
)
def test_the_rate_is_taken_over_what_belongs_to_the_last_note(tmp_path, notes, rate):
    found = progress_of(tmp_path, *notes)
    assert (found.done, found.total, found.what) == notes[-1][1:]
    assert found.rate_1_s == (None if rate is None else pytest.approx(rate))


@pytest.mark.parametrize(
    ("note", "known"),
    [
        ({"done": 10**15 - 1}, True),
        ({"done": 10**15}, False),
        ({"total": 10**15 - 1}, True),
        ({"total": 10**15}, False),
        ({"done": 0, "total": 0}, True),
        ({"done": -1}, False),
        ({"total": -1}, False),
    ],
)
def test_progress_counts_to_what_a_program_counts_to(tmp_path, note, known):
    said = {"at": 1.0, "done": 1, "total": 2, "what": "x"} | note
    (tmp_path / jobs_files.PROGRESS).write_text(json.dumps(said), "utf-8")
    wanted = jobs_files.Progress(said["done"], said["total"], "x", None) if known else None
    assert jobs_files.read_progress(tmp_path) == wanted


@pytest.mark.parametrize(
    ("done", "total", "share"), [(0, 0, 0.0), (3, 0, 0.0), (3, 4, 0.75), (5, 4, 1.0), (-1, 4, 0.0)]
)
def test_the_share_of_the_work_lies_between_nothing_and_all(done, total, share):
    assert jobs_files.Progress(done, total, "x").share == share


def test_a_line_of_progress_that_is_being_written_is_not_read(tmp_path):
    assert progress_of(tmp_path, (1.0, 3, 10, "x"), more='\n{"at": 2.0, "do').done == 3
    assert progress_of(tmp_path, more='{"at": 2.0, "do') is None


# ------------------------------------------------------------------------------------------------------------- cancel
def rows_in(ledger):
    return sum(cell.rows for cell in Interim(ledger).look().cells)


def interrupt_waits(process):
    """Whether a process that has halted will be interrupted when it goes on."""
    (pending,) = re.findall(r"ShdPnd:\s*(\w+)", Path(f"/proc/{process}/status").read_text("utf-8"))
    return bool(int(pending, 16) >> (signal.SIGINT - 1) & 1)


@pytest.mark.promise("studio-16", "studio-17")
def test_a_cancelled_campaign_keeps_its_rows_and_resumes_with_progress_handed_over(studio, tmp_path, monkeypatch):
    campaign_file(tmp_path, runs=384)  # in two chunks
    (tmp_path / "halt").touch()
    for name, value in halting(tmp_path / "halt").items():
        monkeypatch.setenv(name, value)
    job = studio.submit(order(tmp_path, "campaign", "run", "campaign.toml", kind="campaign"))
    began = job.folder / "started.json"
    until(began.is_file, "the job's start")
    (command,) = until(lambda: children(json.loads(began.read_text("utf-8"))["pid"]), "the job's command")
    halted(command)
    progress = jobs_files.read_job(job.folder).progress
    assert (progress.total, "rows" in progress.what) == (384, True)
    done = rows_in(tmp_path / "campaign.ledger")
    assert 0 < done < 384
    assert studio.cancel(job.number).cancelling
    until(lambda: interrupt_waits(command), "the interrupt")
    os.killpg(command, signal.SIGCONT)
    job = ended(job.folder)
    assert (job.state, job.code) == ("cancelled", 130)
    assert "Go on with: microrad campaign resume campaign.ledger" in studio.output(job.number, "stderr")
    kept = rows_in(tmp_path / "campaign.ledger")
    assert done <= kept < 384
    again = ended(studio.submit(order(tmp_path, "campaign", "resume", "campaign.ledger", kind="campaign")).folder)
    assert again.code == 0, again
    assert (again.progress.done, again.progress.total, again.progress.share) == (384, 384, 1.0)
    assert "of 384" not in studio.output(again.number, "stderr")


@pytest.mark.promise("studio-17")
def test_a_command_that_does_not_listen_is_asked_harder_each_time(tmp_path, monkeypatch):
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    deaf = (
        "import pathlib, signal, time\n"
        "for n in (signal.SIGINT, signal.SIGTERM): signal.signal(n, lambda n, _: print(n, flush=True))\n"
        f"pathlib.Path({str(folder / 'cancel')!r}).touch()\n"
        f"time.sleep({2.0 * HANG_S})\n"
    )

    heard = {signal.SIGINT: 0, signal.SIGTERM: 1, signal.SIGKILL: 2}
    ask = jobs_process._signal

    def ask_when_heard(command, number):
        """Ask harder when the command has heard what came before."""
        lines_of(folder / jobs_files.STDOUT, heard[number])
        ask(command, number)

    monkeypatch.setattr(jobs_process, "_signal", ask_when_heard)
    jobs_process.run_job(folder, python(deaf), waits_s=(0.1, 0.1), look_s=0.02)
    job = jobs_files.read_job(folder)
    assert (job.state, job.code) == ("cancelled", -signal.SIGKILL)
    asked = [int(line) for line in jobs_files.output(folder, "stdout").split()]
    assert asked == [signal.SIGINT, signal.SIGTERM]


@pytest.mark.promise("studio-17")
@pytest.mark.parametrize("deaf", [False, True])
def test_a_cancelled_command_leaves_no_results_and_a_killed_one_a_hidden_folder(tmp_path, deaf):
    """The folder that a study writes into, cancelled in its midst."""
    folder, place = written(tmp_path / "jobs", cwd=str(tmp_path)), tmp_path / "results"
    hears = "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # whether the tests themselves hear it or not
    ignored = "for n in (signal.SIGINT, signal.SIGTERM): signal.signal(n, signal.SIG_IGN)\n" if deaf else hears
    code = (
        f"import pathlib, signal, time; from microrad.core.folder import whole_folder\n{ignored}"
        f"with whole_folder(pathlib.Path({str(place / 'found')!r}), False) as draft:\n"
        "    (draft / 'report.html').touch()\n"
        f"    pathlib.Path({str(folder / 'cancel')!r}).touch(); time.sleep({2.0 * HANG_S})\n"
    )
    jobs_process.run_job(folder, python(code), waits_s=(0.1, 0.1) if deaf else (HANG_S, HANG_S), look_s=0.02)
    assert jobs_files.read_job(folder).state == "cancelled"
    left = list(place.iterdir())
    assert [bool(re.fullmatch(r"\.found-.*\.part", path.name)) for path in left] == [True] * deaf


def test_what_a_command_has_started_is_stopped_with_it(tmp_path):
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    code = (
        "import pathlib, subprocess, sys, time\n"
        "endless = 'import time; print(1, flush=True); time.sleep(86400)'\n"
        "inner = subprocess.Popen([sys.executable, '-c', endless], stdout=subprocess.PIPE)\n"
        "inner.stdout.readline()\n"
        f"print(inner.pid, flush=True); pathlib.Path({str(folder / 'cancel')!r}).touch()\n"
        "time.sleep(86400)\n"
    )
    jobs_process.run_job(folder, python(code), waits_s=(5.0, HANG_S), look_s=0.02)
    job = jobs_files.read_job(folder)
    assert job.state == "cancelled"
    assert job.code in (-signal.SIGINT, -signal.SIGTERM)  # the second where the tests themselves ignore Ctrl-C
    assert gone(int(jobs_files.output(folder, "stdout")))


def test_a_job_that_waits_and_is_cancelled_never_starts(studio, tmp_path):
    with running(studio, tmp_path) as first:
        second = studio.submit(order(tmp_path, "init", "never.toml"))
        assert (jobs_files.read_job(first).state, second.state) == ("running", "queued")
        assert studio.cancel(2).state == "cancelled"
        studio.cancel(1)
        jobs_files.note(first / "exit.json", code=130)
    assert [job.state for job in studio.listed()] == ["cancelled", "cancelled"]
    assert not (tmp_path / "never.toml").exists()
    with pytest.raises(JobError, match=r"job 2 is not running any more \(cancelled\); there is nothing to cancel"):
        studio.cancel(2)


# -------------------------------------------------------------------------------------------------------------- queue
@pytest.mark.promise("studio-15")
def test_the_queue_goes_on_in_order_and_nothing_starts_twice(studio, tmp_path):
    """Many programs look at the queue at once; each job's file tells how often and when it ran."""
    for number in range(1, 5):
        studio.submit(order(tmp_path, "init", f"{number}.toml"))
    place = str(studio.folder.parent)
    look = f"import pathlib; from microrad.studio.jobs.queue import Jobs; Jobs(pathlib.Path({place!r})).listed()"
    tabs = [subprocess.Popen([sys.executable, "-c", look]) for _ in range(4)]
    assert [tab.wait(HANG_S) for tab in tabs] == [0] * 4
    found = [ended(studio.folder / str(number)) for number in range(1, 5)]
    assert [job.state for job in found] == ["done"] * 4  # init refuses a file that is there: each ran once
    begun = [(job.folder / "started.json").stat().st_mtime_ns for job in found]
    over = [(job.folder / "exit.json").stat().st_mtime_ns for job in found]
    assert all(a < b for a, b in zip(over[:-1], begun[1:], strict=True))  # one at a time, in order
    assert [job.number for job in studio.listed()] == [4, 3, 2, 1]


def test_who_looks_at_the_list_starts_what_nobody_started(studio, tmp_path):
    written(studio.folder, arguments=["init", "late.toml"], cwd=str(tmp_path))
    assert jobs_files.read_job(studio.folder / "1").state == "queued"
    assert studio.listed()[0].state in ("running", "done")
    assert ended(studio.folder / "1").state == "done"


# -------------------------------------------------------------------------------------------- what a folder alone says
@pytest.mark.parametrize(
    ("asked", "code", "printed", "state"),
    [
        (False, None, "", "lost"),
        (True, None, "", "cancelled"),
        (True, 0, "", "done"),
        (True, 1, "", "cancelled"),
        (True, 1, "the verdict", "done"),
        (False, 1, "", "done"),
        (True, 2, "the verdict", "cancelled"),
        (False, 2, "the verdict", "failed"),
        (False, "0", "", "failed"),
    ],
)
def test_the_state_of_a_job_whose_process_is_gone(tmp_path, asked, code, printed, state):
    folder = written(tmp_path / "jobs")
    jobs_files.note(folder / "started.json")
    (folder / "stdout").write_text(printed, "utf-8")
    if asked:
        (folder / "cancel").touch()
    if code is not None:
        jobs_files.note(folder / "exit.json", code=code)
    job = jobs_files.read_job(folder)
    assert (job.state, job.cancelling) == (state, False)


def test_a_running_job_that_is_asked_to_stop_is_cancelling(tmp_path):
    folder = written(tmp_path / "jobs")
    jobs_files.note(folder / "started.json")
    with jobs_files.held(folder / "alive", 0.0):
        assert not jobs_files.read_job(folder).cancelling
        (folder / "cancel").touch()
        job = jobs_files.read_job(folder)
    assert (job.state, job.cancelling, job.words, job.ended) == ("running", True, "", "")


@pytest.mark.parametrize(
    ("said", "code", "words"),
    [
        ("", 3, "it ended with exit code 3 and said nothing"),
        ("", None, "it ended without an exit code and said nothing"),
        (" \n\n", 0, "it ended with exit code 0 and said nothing"),
        ("", -15, "its process was ended by signal 15; signal 9 is often that of a machine out of memory"),
        ("Traceback\nValueError: odd\n\n", -9, "ValueError: odd"),
        ("microrad: one\nnoise\nmicrorad: two\n\n    more\n", 2, "two\n    more"),
    ],
)
def test_a_failed_job_tells_its_last_words(tmp_path, said, code, words):
    (tmp_path / "stderr").write_text(said, "utf-8")
    assert jobs_files._words(tmp_path, "failed", code) == words
    assert jobs_files._words(tmp_path, "done", code) == jobs_files._words(tmp_path, "cancelled", code) == ""


def test_a_lock_that_cannot_be_taken_for_another_reason_is_told(tmp_path, monkeypatch):
    words = r"alive cannot be locked: unable to open .*; check free space and permissions"
    with pytest.raises(JobError, match=words), jobs_files.held(tmp_path / "none" / "alive", 0.0):
        pass
    monkeypatch.setattr(jobs_files, "_is_busy", lambda error: False)
    words = "alive cannot be locked: database is locked; check"
    path = tmp_path / "alive"
    with jobs_files.held(path, 0.0), pytest.raises(JobError, match=words), jobs_files.held(path, 0.0):
        pass


def test_what_does_not_happen_is_waited_for_no_longer_than_told():
    left = [False, False, True]
    assert jobs_files.wait_for(lambda: left.pop(0), HANG_S, 0.0)
    assert left == []
    assert not jobs_files.wait_for(lambda: False, 0.0, 0.001)
    assert jobs_files.wait_for(lambda: True, -1.0)


def test_a_number_below_one_is_that_of_no_job_and_one_removed_meanwhile_is_not_listed(studio, monkeypatch):
    for number in (0, -1):
        (studio.folder / str(number)).mkdir()
        with pytest.raises(JobError, match=f"there is no job {number} any more; it was removed, or never started"):
            studio.get(number)
    monkeypatch.setattr(jobs_module, "job_folders", lambda folder: [folder / "7"])
    assert studio.listed() == ()


# ------------------------------------------------------------------------------------- the process, without starting it
@pytest.fixture
def waiting_job(tmp_path):
    return written(tmp_path / "jobs", cwd=str(tmp_path), arguments=["presets"])


def noted(folder):
    return sorted(each.name for each in folder.iterdir() if each.name not in ("job.json", "job.code", "alive"))


@pytest.mark.parametrize("how", ["another has it", "another had it"])
def test_a_job_that_another_process_was_quicker_to_take_is_left_to_it(waiting_job, monkeypatch, how):
    @contextmanager
    def held(path, patience_s):
        if how == "another had it":
            jobs_files.note(waiting_job / "started.json")
        yield how == "another had it"

    monkeypatch.setattr(jobs_process, "held", held)
    jobs_process.run_job(waiting_job, python("print(1)"))
    assert noted(waiting_job) == ["started.json"] * (how == "another had it")


def test_a_job_cancelled_before_its_process_came_ends_without_a_command(waiting_job):
    (waiting_job / "cancel").touch()
    jobs_process.run_job(waiting_job, python("print(1)"))
    job = jobs_files.read_job(waiting_job)
    assert (job.state, job.code, noted(waiting_job)) == ("cancelled", 130, ["cancel", "exit.json", "started.json"])


def test_a_queue_that_is_held_starts_nothing(waiting_job, monkeypatch):
    started = []
    monkeypatch.setattr(jobs_process, "QUEUE_S", 0.0)
    monkeypatch.setattr(jobs_process, "_start", lambda folder: started.append(folder) or shutil.rmtree(folder))
    with jobs_files.held(waiting_job.parent / "lock", 0.0):
        jobs_process.start_waiting(waiting_job.parent)
    assert started == []
    jobs_process.start_waiting(waiting_job.parent)
    assert started == [waiting_job]


@pytest.mark.parametrize("begins", [True, False])
def test_a_process_that_cannot_even_begin_ends_its_job(waiting_job, monkeypatch, begins):
    class Process:
        def __init__(self, command, **settings):
            assert command[-1] == str(waiting_job)
            if begins:
                jobs_files.note(waiting_job / "started.json")

        def poll(self):
            return None if begins else 1

    monkeypatch.setattr(jobs_process, "_started", [])
    monkeypatch.setattr(jobs_process.subprocess, "Popen", Process)
    monkeypatch.setattr(jobs_process, "_START_S", HANG_S)
    jobs_process._start(waiting_job)
    assert noted(waiting_job) == ["exit.json"] * (not begins) + ["started.json", "stderr"]
    if not begins:
        assert (jobs_files.read_job(waiting_job).state, jobs_files.read_job(waiting_job).code) == ("failed", 70)


@pytest.mark.parametrize(
    ("given", "found"), [(f"a{os.pathsep}{os.pathsep}/b", ["a", "/b"]), ("", None), (os.pathsep, None), (None, None)]
)
def test_a_job_finds_modules_where_this_process_does(folder, monkeypatch, given, found):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    if given is not None:
        monkeypatch.setenv("PYTHONPATH", given)
    there = jobs_process._environment()
    wanted = given if found is None else os.pathsep.join(str(folder / each) for each in found)
    assert there.get("PYTHONPATH") == wanted
    assert (there["PYTHONIOENCODING"], there["PYTHONUNBUFFERED"]) == ("utf-8:replace", "1")


def test_without_groups_a_signal_goes_to_the_command_alone(monkeypatch):
    sent = []
    command = SimpleNamespace(pid=7, send_signal=lambda number: sent.append(("command", number)))
    monkeypatch.setattr(jobs_process.os, "killpg", lambda group, number: sent.append((group, number)))
    jobs_process._signal(command, 2)
    monkeypatch.delattr(jobs_process.os, "killpg")
    jobs_process._signal(command, 15)
    assert sent == [(7, 2), ("command", 15)]


@pytest.mark.parametrize("nice", [True, False])
def test_the_process_runs_its_job_and_goes_on_with_the_queue_even_on_a_full_disk(monkeypatch, tmp_path, nice):
    done = []

    def full(folder):
        done.append(folder)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(jobs_process.signal, "signal", lambda number, handler: done.append(number))
    monkeypatch.setattr(jobs_process.os, "nice", done.append)
    if not nice:
        monkeypatch.delattr(jobs_process.os, "nice")
    monkeypatch.setattr(jobs_process, "run_job", full)
    monkeypatch.setattr(jobs_process, "start_waiting", done.append)
    monkeypatch.setattr(sys, "argv", ["x", str(tmp_path / "3")])
    jobs_process.main()
    assert done == [signal.SIGINT, signal.SIGTERM, *[5] * nice, tmp_path / "3", tmp_path]


@pytest.mark.parametrize("leads", [True, False])
def test_a_command_whose_watcher_is_gone_ends_its_group_where_it_leads_one(monkeypatch, leads):
    ended, (read, write) = [], os.pipe()
    os.write(write, b"x" * 15_000)
    os.close(write)
    monkeypatch.setattr(command.os, "getpgrp", lambda: os.getpid() if leads else 1)
    monkeypatch.setattr(command.os, "killpg", lambda *sent: ended.append(sent))
    monkeypatch.setattr(command.os, "_exit", ended.append)
    command.end_with(read)
    monkeypatch.delattr(command.os, "killpg")
    command.end_with(read)
    assert os.read(read, 1) == b""
    os.close(read)
    assert ended == [*[(os.getpid(), signal.SIGKILL)] * leads, 1, 1]


@pytest.mark.parametrize("dies", [True, False])
def test_a_command_watches_its_watcher_where_the_system_does_not(monkeypatch, dies):
    ran, watched = [], []

    class Thread:
        def __init__(self, target, args, daemon, name):
            watched.append((target, args, daemon))

        def start(self):
            watched.append("started")

    monkeypatch.setattr(worker, "die_with_parent", lambda number: ran.append(number) or dies)
    monkeypatch.setattr(command, "_taken_stdin", lambda: 9)
    monkeypatch.setattr(command, "threading", SimpleNamespace(Thread=Thread))
    monkeypatch.setattr(command.runpy, "run_module", lambda name, **how: ran.append((name, *sys.argv)))
    monkeypatch.setattr(sys, "argv", ["command", "12", "run", "m.toml"])
    command.main()
    assert ran == [12, ("microrad", "microrad", "run", "m.toml")]
    assert watched == ([] if dies else [(command.end_with, (9,), True), "started"])


# ------------------------------------------------------------------------------------------------------------- crashes
@pytest.mark.promise("studio-18")
def test_a_job_whose_process_is_killed_is_lost_ends_with_it_and_lets_the_next_one_go(studio, tmp_path):
    """The process that watches over it alone: nobody would hear that the command is to stop."""
    campaign_file(tmp_path, runs=4096, duration="1 s")
    first = studio.submit(order(tmp_path, "campaign", "run", "campaign.toml", *ONE_WORKER, kind="campaign"))
    second = studio.submit(order(tmp_path, "init", "next.toml"))
    pid = json.loads((first.folder / "started.json").read_text())["pid"]
    below = []

    def works():
        below[:] = [command for command in children(pid) if children(command)]
        return bool(below)

    until(works, "a worker of the campaign")
    below += children(below[0])
    assert kill(pid)
    assert gone(*below)
    lost = studio.get(1)
    assert (lost.state, lost.code) == ("lost", None)
    assert "gone without an exit code" in lost.words
    assert [job.number for job in studio.listed()] == [2, 1]
    assert ended(second.folder).state == "done"


@pytest.mark.parametrize("text", ['{"kind": "study", "ti', "", "[]", "{}", None])
def test_a_damaged_description_is_told_and_breaks_no_list(studio, tmp_path, text):
    good, bad = (written(studio.folder, number, cwd=str(tmp_path)) for number in (1, 2))
    for folder in (good, bad):
        for name in ("started.json", "exit.json"):
            (folder / name).write_text('{"at": "", "code": 0}', "utf-8")
    assert [job.state for job in studio.listed()] == ["done", "done"]
    (bad / "job.json").unlink()
    if text is not None:
        (bad / "job.json").write_text(text)
    second, first = studio.listed()
    assert (first.number, first.state) == (1, "done")
    assert second.state == "unreadable"
    assert f"{bad / 'job.json'} is not taken: " in second.words
    studio.remove(second.number)
    assert [job.number for job in studio.listed()] == [1]


def test_a_working_folder_that_is_gone_is_told(studio, tmp_path):
    place = tmp_path / "place"
    place.mkdir()
    written(studio.folder, arguments=["presets"], cwd=str(place))
    place.rmdir()
    studio.listed()
    job = ended(studio.folder / "1")
    assert (job.state, job.code) == ("failed", 2)
    assert job.words == f"{place}: No such file or directory; the job cannot be started there."


# ------------------------------------------------------------------------------------------------------------ the list
@pytest.mark.promise("studio-18")
def test_a_finished_job_is_removed_with_its_output_and_its_number_is_not_used_again(studio, tmp_path):
    job = ended(studio.submit(order(tmp_path, "init", "kept.toml")).folder)
    studio.remove(job.number)
    assert studio.listed() == ()
    assert (tmp_path / "kept.toml").is_file()
    assert [each.name for each in studio.folder.iterdir() if each.is_dir()] == []
    with pytest.raises(JobError, match="there is no job 1 any more"):
        studio.get(1)
    assert ended(studio.submit(order(tmp_path, "presets")).folder).number == 2


def test_a_running_job_is_not_removed(studio, tmp_path):
    with running(studio, tmp_path) as folder, pytest.raises(JobError, match="job 1 is running; cancel it first"):
        studio.remove(1)
    assert folder.is_dir()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "shell"}, "'shell' is no kind of job; it is one of study, campaign, identification, export"),
        ({"cwd": Path("/nowhere")}, "/nowhere is no folder to run a job in"),
    ],
)
def test_an_order_that_cannot_be_run_is_refused(studio, tmp_path, change, words):
    said = {"kind": "study", "title": "t", "arguments": ("presets",), "cwd": tmp_path} | change
    with pytest.raises(JobError) as refusal:
        studio.submit(Order(**said))
    assert words in str(refusal.value)
    assert studio.listed() == ()


@pytest.mark.promise("studio-29")
def test_an_order_that_is_refused_is_not_in_the_queue(studio, tmp_path, monkeypatch):
    write = jobs_module.write_whole

    def full(path, content):
        if path.name == "last":
            raise OSError(28, "No space left on device")
        write(path, content)

    monkeypatch.setattr(jobs_module, "write_whole", full)
    with pytest.raises(JobError, match="No space left on device; check free space and permissions"):
        studio.submit(order(tmp_path, "presets"))
    assert (studio.listed(), [each.name for each in studio.folder.iterdir() if each.is_dir()]) == ((), [])


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
def test_what_a_killed_studio_has_left_of_an_order_is_gone_with_the_next_one(studio, tmp_path, monkeypatch):
    monkeypatch.setattr(jobs_module, "start_waiting", lambda folder: None)
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (studio.folder / f".new-{re.sub('[^A-Za-z0-9]', '_', platform.node())}-{gone.pid}-x").mkdir()
    studio.submit(order(tmp_path))
    assert sorted(path.name for path in studio.folder.iterdir()) == ["1", "last", "lock"]


def test_what_cannot_be_cancelled_or_removed_is_told(studio, tmp_path, monkeypatch):
    waits, over = (written(studio.folder, number, cwd=str(tmp_path)) for number in (1, 2))
    for name in ("started.json", "exit.json"):
        (over / name).write_text('{"at": "", "code": 0}', "utf-8")

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "touch", refuse)
        with pytest.raises(JobError, match=r"job 1 cannot be asked to stop: .*: Permission denied; check free space"):
            studio.cancel(1)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", refuse)
        with pytest.raises(JobError, match=r"job 2 cannot be removed: .*: Permission denied; check free space"):
            studio.remove(2)
    assert sorted(each.name for each in studio.folder.iterdir()) == ["1", "2"]
    assert studio.cancel(1).state == "cancelled"
    studio.remove(2)
    assert [each.name for each in studio.folder.iterdir()] == [waits.name]


def test_a_list_is_shown_while_the_queue_cannot_go_on(studio, tmp_path):
    written(studio.folder, arguments=["presets"], cwd=str(tmp_path))
    lock = studio.folder / "lock"
    lock.write_text("another program's", "utf-8")
    assert [job.state for job in studio.listed()] == ["queued"]
    with pytest.raises(JobError, match="is no lock of the studio"):
        studio.submit(order(tmp_path, "presets"))
    lock.unlink()
    assert studio.listed()[0].state in ("running", "done")


def test_a_studio_whose_folder_was_removed_goes_on(studio, tmp_path):
    """As "git clean" does."""
    shutil.rmtree(studio.folder.parent)
    assert studio.listed() == ()
    job = ended(studio.submit(order(tmp_path, "presets")).folder)
    assert (job.number, job.state, stat.S_IMODE(studio.folder.parent.stat().st_mode)) == (1, "done", 0o700)


@pytest.mark.parametrize("name", ["exit.json", "progress", "alive"])
@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"code": [], "at": 1, "done": 1e999, "total": 1, "what": ""}', "SQLite"]
)
def test_a_damaged_note_breaks_no_list(studio, tmp_path, name, text):
    folder = written(studio.folder, cwd=str(tmp_path))
    jobs_files.note(folder / "started.json")
    jobs_files.note(folder / "exit.json", code=3)
    (folder / name).write_text(text, "utf-8")
    (job,) = studio.listed()
    assert (job.state, job.code, job.progress) == ("failed", None if name == "exit.json" else 3, None)


def test_a_link_for_the_folder_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "studio").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(JobError, match="made private: it is a link or belongs to somebody else; remove it"):
        Jobs(tmp_path / "studio")
    assert list((tmp_path / "elsewhere").iterdir()) == []


# -------------------------------------------------------------------------------------------------------------- locks
def test_a_lock_has_one_holder_and_is_seen_by_any_number(tmp_path):
    path = tmp_path / "alive"
    assert not jobs_files.is_held(path)
    with jobs_files.held(path, 0.0) as first:
        assert first
        assert jobs_files.is_held(path)
        with jobs_files.held(path, 0.0) as second:
            assert not second
        assert jobs_files.is_held(path)
    assert not jobs_files.is_held(path)


def test_a_lock_is_gone_with_its_process(tmp_path):
    path = tmp_path / "alive"
    code = (
        "import sys, time; from pathlib import Path; from microrad.studio.jobs.files import held\n"
        "with held(Path(sys.argv[1]), 1.0): print('mine', flush=True); time.sleep(86400)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
    with other:
        assert other.stdout.readline() == b"mine\n"
        assert jobs_files.is_held(path)
        other.kill()
    assert not jobs_files.is_held(path)


def test_the_module_that_runs_a_job_is_named_as_it_is():
    assert jobs_process.__name__ == jobs_process._OWN


# ------------------------------------------------------------------------------------------------ what a job is told by
def test_a_job_is_told_by_all_that_its_folder_says(tmp_path):
    told = {"kind": "campaign", "title": "t", "arguments": ["a", 1], "results": ["x", "y"], "queued": "then"}
    folder = written(tmp_path / "jobs", 12, cwd="/somewhere", **told)
    (folder / "started.json").write_text('{"at": "begun", "pid": 3}', "utf-8")
    (folder / "exit.json").write_text('{"at": "over", "code": 2}', "utf-8")
    (folder / "progress").write_text('{"at": 1, "done": 3, "total": 7, "what": "w"}\n', "utf-8")
    (folder / "stderr").write_text("microrad: odd\n", "utf-8")
    assert jobs_files.read_job(folder) == jobs_files.Job(
        number=12,
        folder=folder,
        state="failed",
        kind="campaign",
        title="t",
        arguments=("a", "1"),
        cwd=Path("/somewhere"),
        results=("x", "y"),
        queued="then",
        started="begun",
        ended="over",
        code=2,
        progress=jobs_files.Progress(3, 7, "w"),
        words="odd",
    )


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda folder: (folder / "job.json").unlink(), "No such file or directory"),
        (
            lambda folder: (folder / "job.code").write_text("0", "utf-8"),
            "it was not queued by you with this installation of microrad, so it is not started",
        ),
        (
            lambda folder: (folder / "job.code").unlink(),
            "it was not queued by you with this installation of microrad, so it is not started",
        ),
        (lambda folder: (folder / "job.json").write_bytes(bytes(16_000_001)), "it is larger than 16000000 bytes"),
    ],
)
def test_a_job_that_cannot_be_read_says_why_and_what_to_do(tmp_path, spoil, words):
    folder = written(tmp_path / "jobs", 31, cwd=str(tmp_path))
    spoil(folder)
    job = jobs_files.read_job(folder)
    assert (job.number, job.state, job.title, job.finished) == (31, "unreadable", "(unreadable)", True)
    assert job.words == (
        f"{folder / 'job.json'} is not taken: {words}; remove this job, its results are where they were"
    )


@pytest.mark.parametrize(
    ("state", "begun", "words"),
    [
        (
            "lost",
            False,
            "its folder was moved or copied before it was started, so it is not started here; start it anew",
        ),
        (
            "lost",
            True,
            "its process is gone without an exit code: the machine went down, it was killed, or the disk is",
        ),
        ("running", True, ""),
        ("queued", False, ""),
        ("unreadable", False, ""),
    ],
)
def test_a_job_without_an_end_says_what_became_of_it(tmp_path, state, begun, words):
    if begun:
        (tmp_path / "started.json").touch()
    (tmp_path / "stderr").write_text("noise", "utf-8")
    found = jobs_files._words(tmp_path, state, None)
    assert found.startswith(words) and bool(found) == bool(words)


@pytest.mark.parametrize(
    ("notes", "done", "rate"),
    [
        (((0.0, 7, 10, "a"), (8.0, 8, 10, "b"), (10.0, 9, 10, "b")), 9, 0.5),
        (((0.0, 3, 50, "a"), (4.0, 5, 50, "b"), (8.0, 15, 50, "c")), 15, 1.5),
        (((0.0, 40, 50, "a"), (4.0, 5, 50, "a"), (12.0, 11, 50, "a")), 11, 0.75),
        (((1.0, 0, 50, "a"), (59.5, 2, 50, "a"), (61.5, 8, 50, "a")), 8, 3.0),
        (((1.0, 0, 50, "a"), (59.5, 2, 50, "a"), (61.0, 8, 50, "a")), 8, 8.0 / 60.0),
    ],
)
def test_the_pace_is_that_of_the_oldest_note_of_this_phase_within_a_minute(tmp_path, notes, done, rate):
    found = progress_of(tmp_path, *notes)
    assert (found.done, found.rate_1_s) == (done, pytest.approx(rate))


def test_jobs_are_listed_by_number_and_not_by_name(studio, monkeypatch, tmp_path):
    monkeypatch.setattr(jobs_module, "start_waiting", lambda folder: None)
    for number in (2, 10, 9):
        written(studio.folder, number, cwd=str(tmp_path), title=f"job {number}")
    for name in ("0", "01", "x7", "7x", "1234567890123"):
        (studio.folder / name).mkdir()
    (studio.folder / "5").touch()
    assert [job.number for job in studio.listed()] == [10, 9, 2]
    assert studio.get(9).title == "job 9"
    (studio.folder / "last").write_text("4", "utf-8")
    assert studio._next_number() == 11
    (studio.folder / "last").write_text("123456789", "utf-8")
    assert studio._next_number() == 123456790
    for damaged in ("1234567890", "x", ""):
        (studio.folder / "last").write_text(damaged, "utf-8")
        assert studio._next_number() == 11
    (studio.folder / "11").touch()
    assert studio._next_number() == 12


def test_the_oldest_job_that_waits_is_started_while_none_runs(studio, tmp_path):
    jobs = studio.folder
    three, two, one = (written(jobs, number, cwd=str(tmp_path)) for number in (3, 2, 1))
    assert jobs_process._waiting(jobs) == one
    jobs_files.note(one / "exit.json", code=0)
    assert jobs_process._waiting(jobs) == two
    (two / "cancel").touch()
    assert jobs_process._waiting(jobs) == three
    jobs_files.note(two / "started.json")
    with jobs_files.held(two / "alive", 0.0):
        assert jobs_process._waiting(jobs) is None
    assert jobs_process._waiting(jobs) == three
    (three / "cancel").touch()
    assert jobs_process._waiting(jobs) is None


def test_what_a_job_prints_to_either_stream_is_kept_apart(studio, tmp_path):
    folder = written(studio.folder, 4, cwd=str(tmp_path))
    (folder / "stdout").write_text("said µ", "utf-8")
    (folder / "stderr").write_bytes(b"told \xff")
    found = [studio.output(4), studio.output(4, "stderr"), studio.output(4, "job.json")]
    assert found == ["said µ", "told \ufffd", "said µ"]
    (folder / "job.code").write_text("0", "utf-8")
    assert studio.output(4) == studio.output(4, "stderr") == ""


@pytest.mark.parametrize(
    ("number", "do", "words"),
    [
        (7, "get", "there is no job 7 any more; it was removed, or never started"),
        (2, "cancel", "job 2 is not running any more (done); there is nothing to cancel"),
        (3, "remove", "job 3 is queued; cancel it first"),
        (5, "output", "there is no job 5 any more; it was removed, or never started"),
    ],
)
def test_what_cannot_be_done_with_a_job_names_it_and_its_state(studio, tmp_path, number, do, words):
    for each in (2, 3):
        written(studio.folder, each, cwd=str(tmp_path))
    for name in ("started", "exit"):
        jobs_files.note(studio.folder / "2" / f"{name}.json", code=0)
    with pytest.raises(JobError) as refusal:
        getattr(studio, do)(number)
    assert str(refusal.value) == words


@pytest.mark.parametrize(("exits", "code"), [((None, None, 5), 5), ((None, -2), -2), ((0,), 0)])
def test_a_command_is_asked_by_one_signal_after_the_other_until_it_ends(tmp_path, monkeypatch, exits, code):
    sent, waited, left = [], [], list(exits)

    def wait(patience_s=None):
        waited.append(patience_s)
        found = left.pop(0)
        if found is None:
            raise subprocess.TimeoutExpired("x", patience_s)
        return found

    monkeypatch.setattr(jobs_process, "_signal", lambda command, number: sent.append(number))
    (tmp_path / "cancel").touch()
    found = jobs_process._ended(SimpleNamespace(wait=wait), tmp_path / "cancel", (1.5, 2.5), 0.25)
    assert found == code
    assert sent == [signal.SIGINT, signal.SIGTERM, signal.SIGKILL][: len(exits)]
    assert waited == [1.5, 2.5, None][: len(exits)]


def test_a_command_sees_its_arguments_its_folder_and_where_its_progress_goes(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(jobs_process.subprocess, "Popen", lambda *given, **more: asked.append((given, more)))
    monkeypatch.setenv("OWN", "kept")
    job = jobs_files.Job(1, tmp_path / "jobs" / "1", "queued", arguments=("run", "m.toml"), cwd=tmp_path / "work")
    jobs_process._command(job, ("python", "-x"), "out", "errors")
    (((command,), how),) = asked
    assert command == ["python", "-x", "run", "m.toml"]
    assert (how["stdin"], how["stdout"], how["stderr"], how["cwd"]) == (
        subprocess.PIPE,
        "out",
        "errors",
        tmp_path / "work",
    )
    assert (how["env"]["MICRORAD_PROGRESS"], how["env"]["OWN"]) == (str(tmp_path / "jobs" / "1" / "progress"), "kept")
    assert how["start_new_session"] is True


# ------------------------------------------------------------------------------------- names and values of any kind
@pytest.mark.parametrize("name", ["a?mode=rw", "b#c", "d%20e", "µ f", "g'h"])
def test_a_lock_in_a_folder_of_any_name_is_seen_by_others(tmp_path, monkeypatch, name):
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.chdir(folder)
    for path in (folder / "alive", Path("alive")):
        assert not jobs_files.is_held(path)
        with jobs_files.held(path, 0.0) as mine, jobs_files.held(folder / "alive", 0.0) as second:
            assert (mine, second, jobs_files.is_held(path), jobs_files.is_held(folder / "alive")) == (
                True,
                False,
                True,
                True,
            )
            assert [each.name for each in folder.iterdir()] == ["alive"]
        assert not jobs_files.is_held(path) and (folder / "alive").stat().st_size == 0
    assert [each.name for each in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("content", [b"no database " * 100, b"SQLite format 3\0" + bytes(84), b""])
def test_what_is_no_lock_is_held_by_nobody_and_only_an_empty_file_becomes_one(tmp_path, content):
    path = tmp_path / "alive"
    path.write_bytes(content)
    assert not jobs_files.is_held(path)
    if not content:
        with jobs_files.held(path, 0.0) as mine:
            assert mine
        return
    with pytest.raises(JobError) as refusal, jobs_files.held(path, 0.0):
        pass
    assert str(refusal.value) == f"{path} is no lock of the studio, but a link or another program's; remove it"
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("code", "extended", "busy"), [(5, 5, True), (5, 261, True), (6, 262, False), (8, 264, False), (14, 14, False)]
)
def test_only_what_another_process_holds_is_busy(code, extended, busy):
    error = sqlite3.OperationalError("x")
    error.sqlite_errorcode = extended
    assert extended & 0xFF == code and jobs_files._is_busy(error) is busy


def test_a_note_has_the_time_of_its_writing_whatever_it_says(tmp_path, monkeypatch):
    now = datetime(2026, 3, 4, 5, 6, 7, 890123, tzinfo=UTC)
    monkeypatch.setattr(jobs_files, "datetime", SimpleNamespace(now=now.astimezone))
    jobs_files.note(tmp_path / "exit.json", code=3, at="never")
    assert json.loads((tmp_path / "exit.json").read_text("utf-8")) == {"code": 3, "at": "2026-03-04T05:06:07Z"}


@pytest.mark.parametrize(
    ("data", "most", "text"),
    [(b"0123456789", 10, "0123456789"), (b"0123456789", 9, "123456789"), (b"", 5, ""), ("aµb".encode(), 2, "\ufffdb")],
)
def test_the_end_of_a_file_is_its_last_bytes(tmp_path, data, most, text):
    (tmp_path / "x").write_bytes(data)
    assert (jobs_files._tail(tmp_path / "x", most), jobs_files._tail(tmp_path / "none", most)) == (text, "")


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ('{"at": 1.5, "done": 2, "total": 7, "what": "w"}', (1.5, 2, 7, "w")),
        ('{"at": "2.5", "done": "3", "total": 8.9, "what": 4}', (2.5, 3, 8, "4")),
        ('{"at": 1.5, "done": NaN, "total": 7, "what": "w"}', None),
        ('{"at": 1.5, "done": 2, "total": Infinity, "what": "w"}', None),
        ('{"at": NaN, "done": 2, "total": 7, "what": "w"}', None),
        ('{"at": 1.5, "done": 2, "total": 7}', None),
        ('{"at": 1.5, "done": null, "total": 7, "what": "w"}', None),
        ("[1.5, 2, 7]", None),
        ("[" * 100_000, None),
        ("", None),
    ],
)
def test_a_line_of_progress_has_four_values_or_is_none(line, note):
    assert jobs_files._progress(line) == note


def test_an_order_is_written_with_its_place_as_it_is_seen_from_everywhere(studio, folder, monkeypatch):
    monkeypatch.setattr(jobs_module, "start_waiting", lambda folder: None)
    (folder / "work").mkdir()
    given = Order("export", "µ title", ("campaign", "report", "x.ledger"), Path("work"), ("x.html", "y"))
    job = studio.submit(given)
    text = (job.folder / "job.json").read_text("utf-8")
    said = json.loads(text)
    queued = said.pop("queued")
    assert said == {
        "kind": "export",
        "title": "µ title",
        "arguments": ["campaign", "report", "x.ledger"],
        "cwd": str(folder / "work"),
        "results": ["x.html", "y"],
        "folder": str(studio.folder),
    }
    assert (job.queued, job.cwd, job.state, job.results) == (queued, folder / "work", "queued", ("x.html", "y"))
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", queued) and text.startswith('{\n  "kind"')
    assert (studio.folder / "last").read_text("utf-8") == "1" and studio.submit(given).number == 2
    assert sorted(each.name for each in job.folder.iterdir()) == ["job.code", "job.json"]


def test_the_process_of_a_job_is_started_beside_it_and_apart_from_this_one(waiting_job, monkeypatch):
    asked = []

    class Process:
        def __init__(self, command, **settings):
            asked.append((command, settings, settings["stderr"].name, settings["stderr"].mode))
            jobs_files.note(waiting_job / "started.json")

        def poll(self):
            return None

    begun = []
    monkeypatch.setattr(jobs_process, "_started", begun)
    monkeypatch.setattr(jobs_process.subprocess, "Popen", Process)
    monkeypatch.setenv("OWN", "kept")
    jobs_process._start(waiting_job)
    ((command, how, errors, mode),) = asked
    assert command == [sys.executable, "-P", "-m", "microrad.studio.jobs.process", str(waiting_job)]
    assert (how["stdin"], how["stdout"], errors, mode) == (-3, -3, str(waiting_job / "stderr"), "ab")
    assert (how["cwd"], how["env"]["OWN"], how["start_new_session"]) == (waiting_job.parent, "kept", True)
    assert len(begun) == 1
    begun[0].poll = lambda: 0
    jobs_process.start_waiting(waiting_job.parent)
    assert begun == [] and len(asked) == 1


def test_the_program_of_a_job_is_told_who_watches_over_it():
    own = (sys.executable, "-P", "-m", "microrad.studio.jobs.command", str(os.getpid()))
    assert jobs_process._program() == own


@pytest.mark.parametrize(
    ("state", "finished"),
    [
        *(("queued", False), ("running", False), ("done", True), ("failed", True)),
        *(("cancelled", True), ("lost", True), ("unreadable", True)),
    ],
)
def test_a_job_is_finished_in_each_state_that_nothing_leads_out_of(tmp_path, state, finished):
    assert jobs_files.Job(1, tmp_path, state).finished is finished


def test_a_command_has_half_a_minute_behind_each_signal_and_a_queue_the_time_of_a_start():
    assert (jobs_process.WAITS_S, jobs_process.QUEUE_S, jobs_process._START_S) == ((30.0, 30.0), 360.0, 300.0)
    assert (jobs_process._LOOK_S, jobs_process._NICENESS) == (0.2, 5)
    assert jobs_files.KINDS == ("study", "campaign", "identification", "export")


def test_a_list_is_shown_while_the_disk_is_full(studio, tmp_path, monkeypatch):
    written(studio.folder, arguments=["presets"], cwd=str(tmp_path))

    def full(folder):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(jobs_module, "start_waiting", full)
    assert [job.state for job in studio.listed()] == ["queued"]


def test_the_process_of_a_job_hears_signals_and_its_command_is_not_deaf_to_them(monkeypatch, tmp_path):
    """A handler that does nothing: what is ignored stays ignored in the processes that are started."""
    handlers, ran = {}, []
    monkeypatch.setattr(jobs_process.signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(jobs_process.os, "nice", ran.append)
    monkeypatch.setattr(jobs_process, "run_job", ran.append)
    monkeypatch.setattr(jobs_process, "start_waiting", ran.append)
    monkeypatch.setattr(sys, "argv", ["x", str(tmp_path / "3"), "more"])
    jobs_process.main()
    assert {*handlers} == {signal.SIGINT, signal.SIGTERM}
    assert not {*handlers.values()} & {signal.SIG_IGN, signal.SIG_DFL}
    assert [handler(number, None) for number, handler in handlers.items()] == [None, None]
    assert ran == [5, tmp_path / "3", tmp_path]


@pytest.mark.parametrize(("given", "threads"), [(None, "1"), ("3", "3")])
def test_a_command_has_one_thread_of_linear_algebra_unless_the_user_has_set_another_number(monkeypatch, given, threads):
    seen = []
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", given or "")
    if given is None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setattr(worker, "die_with_parent", lambda number: True)
    monkeypatch.setattr(command, "_taken_stdin", lambda: 9)
    monkeypatch.setattr(
        command.runpy, "run_module", lambda *of, **how: seen.append((of, how, os.environ["OPENBLAS_NUM_THREADS"]))
    )
    monkeypatch.setattr(sys, "argv", ["command", "12", "presets"])
    command.main()
    assert seen == [(("microrad",), {"run_name": "__main__", "alter_sys": True}, threads)]


@pytest.mark.skipif(os.name != "posix", reason="the numbers of open files are those of POSIX")
def test_the_pipe_at_the_input_of_a_command_is_kept_and_its_input_is_empty():
    own, (read, write) = os.dup(0), os.pipe()
    try:
        os.dup2(read, 0)
        os.write(write, b"watched")
        free = [os.dup(0), os.dup(0)]
        for number in free:
            os.close(number)
        pipe, following = command._taken_stdin(), os.dup(0)
        assert os.read(0, 10) == b""
        assert os.read(pipe, 10) == b"watched"
        for number in (pipe, following):
            os.close(number)
        assert [pipe, following] == free  # nothing else was left open
    finally:
        os.dup2(own, 0)
        for number in (own, read, write):
            os.close(number)


def test_a_job_that_ends_just_as_it_is_looked_at_is_no_lost_one(tmp_path, monkeypatch):
    """Its process drops the lock behind the note of its end."""
    folder = written(tmp_path / "jobs", cwd=str(tmp_path))
    jobs_files.note(folder / "started.json")
    asked = []

    def ends(path):
        asked.append(path)
        jobs_files.note(folder / "exit.json", code=0)
        return False

    monkeypatch.setattr(jobs_files, "is_held", ends)
    job = jobs_files.read_job(folder)
    assert (job.state, job.code, asked) == ("done", 0, [folder / "alive"])


@pytest.mark.parametrize("error", [ProcessLookupError(3, "No such process"), PermissionError(1, "not permitted")])
def test_a_signal_to_a_command_that_is_gone_is_no_fault(monkeypatch, error):
    asked = []

    def gone(*where):
        asked.append(where)
        raise error

    command = SimpleNamespace(pid=7, send_signal=gone)
    monkeypatch.setattr(jobs_process.os, "killpg", gone)
    jobs_process._signal(command, 2)
    monkeypatch.delattr(jobs_process.os, "killpg")
    jobs_process._signal(command, 15)
    assert asked == [(7, 2), (15,)]


def test_windows_has_a_group_of_processes_without_a_window_and_a_signal_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(jobs_process, "os", SimpleNamespace(name="nt"))
    for name, value in (("CREATE_NEW_PROCESS_GROUP", 0x200), ("CREATE_NO_WINDOW", 0x08000000)):
        monkeypatch.setattr(jobs_process.subprocess, name, value, raising=False)
    assert jobs_process.apart() == {"creationflags": 0x08000200}
    sent, waited = [], []

    def wait(patience_s=None):
        waited.append(patience_s)
        if patience_s is not None:
            raise subprocess.TimeoutExpired("x", patience_s)
        return 1

    monkeypatch.setattr(jobs_process, "signal", SimpleNamespace(CTRL_BREAK_EVENT=1, SIGINT=2, SIGTERM=15))
    monkeypatch.setattr(jobs_process, "_signal", lambda command, number: sent.append(number))
    (tmp_path / "cancel").touch()
    assert jobs_process._ended(SimpleNamespace(wait=wait), tmp_path / "cancel", (1.5, 2.5), 0.25) == 1
    assert (sent, waited) == ([1, 15, 15], [1.5, 2.5, None])


def test_a_command_that_nobody_stops_is_waited_for_in_small_steps(tmp_path, monkeypatch):
    waited = []

    def wait(patience_s):
        waited.append(patience_s)
        if len(waited) < 4:
            raise subprocess.TimeoutExpired("x", patience_s)
        return 7

    monkeypatch.setattr(jobs_process, "_signal", lambda command, number: waited.append("a signal"))
    assert jobs_process._ended(SimpleNamespace(wait=wait), tmp_path / "cancel", (1.5, 2.5), 0.25) == 7
    assert waited == [0.25] * 4


@pytest.mark.parametrize(
    ("more", "how"),
    [({}, ((30.0, 30.0), 0.2)), ({"waits_s": (1.0, 2.0), "look_s": 0.5}, ((1.0, 2.0), 0.5))],
)
def test_the_command_of_a_job_is_watched_with_its_streams_and_its_end_is_noted(waiting_job, monkeypatch, more, how):
    class Command:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            seen.append("left")

    seen, made = [], Command()

    def start(job, program, out, errors):
        seen.append((job.number, job.arguments, program, *((each.name, each.mode) for each in (out, errors))))
        return made

    def end(*watched):
        seen.append(watched)
        assert noted(waiting_job) == ["started.json", "stderr", "stdout"] and jobs_files.is_held(waiting_job / "alive")
        return -15

    monkeypatch.setattr(jobs_process, "_command", start)
    monkeypatch.setattr(jobs_process, "_ended", end)
    jobs_process.run_job(waiting_job, **more)
    streams = [(str(waiting_job / name), "ab") for name in ("stdout", "stderr")]
    assert seen == [
        (1, ("presets",), jobs_process._program(), *streams),
        (made, waiting_job / "cancel", *how),
        "left",
    ]
    assert json.loads((waiting_job / "started.json").read_text("utf-8"))["pid"] == os.getpid()
    job = jobs_files.read_job(waiting_job)
    assert (job.state, job.code) == ("failed", -15)


def test_a_lock_is_free_again_behind_an_error(tmp_path):
    path = tmp_path / "lock"
    with pytest.raises(KeyError), jobs_files.held(path, 0.0) as mine:
        assert mine and jobs_files.is_held(path)
        raise KeyError("x")
    assert not jobs_files.is_held(path)
    with jobs_files.held(path, 0.0) as mine:
        assert mine


ROOM = "check free space and permissions"


@pytest.mark.parametrize(
    ("of", "name", "do", "words"),
    [
        (jobs_module, "new_folder", lambda jobs, new: jobs.submit(new), "{jobs}: No space left on device; " + ROOM),
        (Path, "touch", lambda jobs, new: jobs.cancel(1), "job 1 cannot be asked to stop: {jobs}/1: {why}; " + ROOM),
        (shutil, "rmtree", lambda jobs, new: jobs.remove(2), "job 2 cannot be removed: {jobs}: {why}; " + ROOM),
    ],
)
def test_what_the_disk_does_not_take_is_told_with_its_place(studio, tmp_path, monkeypatch, of, name, do, words):
    monkeypatch.setattr(jobs_module, "start_waiting", lambda folder: None)
    for number in (1, 2):
        written(studio.folder, number, cwd=str(tmp_path))
    for note in ("started", "exit"):
        jobs_files.note(studio.folder / "2" / f"{note}.json", code=0)

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(of, name, full)
        with pytest.raises(JobError) as refusal:
            do(studio, order(tmp_path, "presets"))
    assert str(refusal.value) == words.format(jobs=studio.folder, why="No space left on device")
    assert [(job.number, job.state) for job in studio.listed()] == [(2, "done"), (1, "queued")]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), JobError("the lock is none")])
def test_a_job_that_cannot_be_started_yet_waits_in_the_queue(studio, tmp_path, monkeypatch, error):
    def refuse(folder):
        raise error

    monkeypatch.setattr(jobs_module, "start_waiting", refuse)
    found = [studio.submit(order(tmp_path, "presets", title=title)) for title in ("one", "two")]
    assert [(job.number, job.title, job.state) for job in found] == [(1, "one", "queued"), (2, "two", "queued")]
    shutil.rmtree(studio.folder / "1")
    shutil.rmtree(studio.folder / "2")


def test_a_job_prints_as_the_pages_read_it_whatever_the_user_has_set(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "latin-1")
    monkeypatch.setenv("PYTHONUNBUFFERED", "")
    monkeypatch.setenv("OTHER", "of the user")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["src", "", "/there"]))
    found = jobs_process._environment()
    assert (found["PYTHONIOENCODING"], found["PYTHONUNBUFFERED"]) == ("utf-8:replace", "1")
    assert (found["OTHER"], found["PYTHONPATH"]) == (
        "of the user",
        os.pathsep.join([str(Path("src").absolute()), str(Path("/there").absolute())]),
    )


@pytest.mark.parametrize(
    ("notes", "rate"),
    [
        (((0.0, 15, 100, "x"), (1.0, 10, 100, "x"), (3.0, 20, 100, "x")), 5.0),
        (((0.0, 9, 100, "x"), (1.0, 10, 100, "x"), (4.0, 20, 100, "x")), 2.75),
        (((0.0, 19, 100, "x"), (1.0, 12, 100, "x"), (2.0, 11, 100, "x"), (4.0, 20, 100, "x")), 4.5),
    ],
)
def test_the_pace_of_what_began_anew_is_that_since_then_although_it_is_further_now(tmp_path, notes, rate):
    assert progress_of(tmp_path, *notes).rate_1_s == pytest.approx(rate)


def test_a_number_that_only_a_job_of_others_or_a_link_has_is_passed_over(studio, tmp_path):
    written(studio.folder, 3, cwd=str(tmp_path))
    assert studio._next_number() == 4
    (studio.folder / "700").mkdir()  # without a description
    assert studio._next_number() == 4
    (studio.folder / "4").symlink_to("nowhere")
    (studio.folder / "5").mkdir()
    assert studio._next_number() == 6
    (studio.folder / "last").write_text("699", "utf-8")
    assert studio._next_number() == 701


def test_only_a_job_that_runs_is_stopping_and_only_one_that_was_begun_has_progress(tmp_path):
    folder = written(tmp_path / "jobs", 4, cwd=str(tmp_path))
    (folder / "progress").write_text('{"at": 1, "done": 3, "total": 7, "what": "w"}\n', "utf-8")
    queued = jobs_files.read_job(folder)
    assert (queued.state, queued.progress, queued.cancelling) == ("queued", None, False)
    (folder / "cancel").touch()
    (folder / "started.json").write_text('{"at": "begun"}', "utf-8")
    (folder / "exit.json").write_text('{"at": "over", "code": 0}', "utf-8")
    done = jobs_files.read_job(folder)
    assert (done.state, done.progress, done.cancelling) == ("done", jobs_files.Progress(3, 7, "w"), False)
