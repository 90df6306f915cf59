"""Jobs that this user did not queue: found in a working folder of a stranger's, and never started."""

import errno
import hashlib
import hmac
import io
import json
import os
import stat
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad.studio.guard import plain_files, signing
from microrad.studio.jobs import files as jobs_files
from microrad.studio.jobs import process as jobs_process
from microrad.studio.jobs import queue
from microrad.studio.jobs.queue import JobError, Jobs, Order
from microrad.studio.session import Session
from microrad.studio.views import mirror_form
from microrad.studio.views.mirror_form import Form
from studio_jobs import described, written
from waiting import HANG_S, alive, gone


@pytest.fixture
def jobs(tmp_path):
    return Jobs(tmp_path / "studio")


@pytest.fixture
def started(monkeypatch):
    """The folders that would be started."""
    found = []

    def start(folder):
        found.append(folder)
        jobs_files.note(folder / "started.json")
        jobs_files.note(folder / "exit.json", code=0)

    monkeypatch.setattr(jobs_process, "_start", start)
    return found


@pytest.fixture
def own_key(tmp_path, monkeypatch):
    """The key's file, in a folder of the test's own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "microrad" / "studio-key"


# ------------------------------------------------------------------------------------------------------------ planted
PLANTED = {
    "without a code": lambda text: None,
    "with an empty code": lambda text: "",
    "with the code of another text": lambda text: signing.code(b"x" + text.encode()),
    "with a code beyond ASCII": lambda text: "µ" * 64,
}


@pytest.mark.promise("studio-22")
@pytest.mark.parametrize("how", PLANTED)
def test_a_planted_job_is_never_started(jobs, started, tmp_path, how):
    """As the right code and nothing else tells it from one that is."""
    folder = written(jobs.folder, arguments=[str(tmp_path / "touched")])
    code = PLANTED[how]((folder / "job.json").read_text("utf-8"))
    own = (folder / "job.code").read_text("utf-8")
    (folder / "job.code").unlink()
    if code is not None:
        (folder / "job.code").write_text(code, "utf-8")
    (job,) = jobs.listed()
    assert (job.state, job.finished, job.title, job.results) == ("unreadable", True, "(unreadable)", ())
    assert "it was not queued by you with this installation of microrad, so it is not started" in job.words
    jobs_process.run_job(folder, ("touch",))
    assert started == []
    assert sorted(each.name for each in folder.iterdir()) == ["job.code"] * (code is not None) + ["job.json"]
    (folder / "job.code").write_text(own, "utf-8")
    assert jobs.listed()[0].state == "done"
    assert started == [folder]


def test_the_process_of_a_job_runs_what_was_queued_and_nothing_else(jobs, tmp_path):
    touched = [str(tmp_path / f"touched-{n}") for n in (1, 2)]
    ours, theirs = (written(jobs.folder, n, arguments=[touched[n - 1]], cwd=str(tmp_path)) for n in (1, 2))
    (theirs / "job.code").unlink()
    for folder in (ours, theirs):
        jobs_process.run_job(folder, ("touch",))
    assert [path.name for path in tmp_path.glob("touched*")] == ["touched-1"]


def test_a_job_that_was_changed_is_not_started(jobs, started):
    folder = written(jobs.folder, arguments=["presets"])
    text = (folder / "job.json").read_text("utf-8")
    (folder / "job.json").write_text(text.replace("presets", "studio"), "utf-8")
    assert jobs.listed()[0].state == "unreadable"
    assert started == []


def test_a_copy_of_a_waiting_job_is_not_started_elsewhere(jobs, started, tmp_path):
    folder = written(tmp_path / "old", arguments=["presets"])
    folder.rename(jobs.folder / "1")
    (job,) = jobs.listed()
    assert (job.state, started) == ("lost", [])
    assert "its folder was moved or copied before it was started, so it is not started here; start it anew" in job.words
    jobs_process.run_job(job.folder, ("touch",))
    assert not (job.folder / "started.json").exists()


def test_what_a_moved_job_has_done_is_still_told(jobs, tmp_path):
    folder = written(tmp_path / "old", title="mine")
    jobs_files.note(folder / "started.json")
    jobs_files.note(folder / "exit.json", code=0)
    folder.rename(jobs.folder / "1")
    (job,) = jobs.listed()
    assert (job.state, job.title) == ("done", "mine")


@pytest.mark.promise("studio-22")
def test_a_studio_opened_in_a_strangers_folder_starts_and_believes_nothing(tmp_path, started):
    place = tmp_path / ".microrad-studio" / "jobs"
    (place / "7").mkdir(parents=True)
    (place / "7" / "job.json").write_text(described(place, arguments=["init", "planted.toml"]), "utf-8")
    (place / "7" / "stdout").write_text("<b>believe me</b>", "utf-8")
    (place / "last").write_text("9" * 100, "utf-8")
    session = Session(tmp_path)
    (job,) = session.jobs.listed()
    assert (job.state, session.jobs.output(7)) == ("unreadable", "")
    job = session.jobs.submit(Order("study", "mine", ("presets",), tmp_path))
    assert (job.number, [each.name for each in started]) == (1, ["1"])
    session.jobs.remove(7)
    assert [each.number for each in session.jobs.listed()] == [1]


def test_a_number_that_is_taken_by_anything_is_passed_over(jobs, started, tmp_path):
    (jobs.folder / "1").mkdir()
    (jobs.folder / "1" / "job.json").write_text("{}", "utf-8")
    (jobs.folder / "2").symlink_to(tmp_path)
    (jobs.folder / "3").write_text("", "utf-8")
    assert jobs.submit(Order("study", "mine", ("presets",), tmp_path)).number == 4
    assert [each.name for each in started] == ["4"]


# -------------------------------------------------------------------------------------------------------------- links
def test_a_link_among_the_jobs_is_none(jobs, started, tmp_path):
    """Even to a job that was queued here."""
    folder = written(tmp_path / "elsewhere", folder=str(jobs.folder))
    (jobs.folder / "1").symlink_to(folder)
    assert jobs.listed() == ()
    with pytest.raises(JobError, match="there is no job 1 any more"):
        jobs.get(1)
    (jobs.folder / "1").unlink()
    folder.rename(jobs.folder / "1")
    assert [job.state for job in jobs.listed()] == ["done"]


@pytest.mark.parametrize("name", ["stdout", "stderr", "progress", "exit.json", "job.json"])
def test_no_link_in_a_job_is_followed(jobs, tmp_path, name):
    secret = tmp_path / "secret"
    folder = written(jobs.folder)
    jobs_files.note(folder / "started.json")
    jobs_files.note(folder / "exit.json", code=0)
    note = {"at": 1.0, "done": 1, "total": 2, "what": "x"}
    plain = {"exit.json": json.dumps({"at": "", "code": 1}), "job.json": (folder / "job.json").read_text("utf-8")}
    secret.write_text(plain.get(name, json.dumps(note)), "utf-8")

    def seen():
        job = jobs.get(1)
        return job.state, job.code, job.progress, jobs.output(1), jobs.output(1, "stderr")

    (folder / name).unlink(missing_ok=True)
    nothing = seen()
    (folder / name).symlink_to(secret)
    linked = seen()
    (folder / name).unlink()
    secret.rename(folder / name)
    assert seen() not in (nothing, linked)  # as a plain file it is read
    assert linked == nothing or name == "exit.json"
    assert linked[1] is None or name not in ("exit.json", "job.json")


@pytest.mark.parametrize("kind", ["link", "folder", "pipe", "content"])
def test_what_is_no_lock_is_not_opened_as_one(jobs, started, tmp_path, kind):
    lock = jobs.folder / "lock"
    made = {
        "link": lambda: lock.symlink_to(tmp_path / "made"),
        "folder": lock.mkdir,
        "pipe": lambda: os.mkfifo(lock),
        "content": lambda: lock.write_text("SQLite format 3"),
    }
    made[kind]()
    with pytest.raises(JobError, match="lock is no lock of the studio, but a link or another program's; remove it"):
        jobs.submit(Order("study", "t", ("presets",), tmp_path))
    assert not (tmp_path / "made").exists()
    assert started == []
    lock.rmdir() if kind == "folder" else lock.unlink()
    assert jobs.submit(Order("study", "t", ("presets",), tmp_path)).number == 1


@pytest.mark.parametrize("make", ["link", "pipe", "folder", "device", "large"])
def test_only_a_plain_file_is_read(tmp_path, make):
    path = tmp_path / "file"
    if make == "device":
        path = Path("/dev/zero")
    elif make == "large":
        path.write_bytes(b"x" * 11)
    else:
        {"link": lambda: path.symlink_to("/etc/passwd"), "pipe": lambda: os.mkfifo(path), "folder": path.mkdir}[make]()
    with pytest.raises(OSError, match=r"link|plain file|larger than 10 bytes|directory"):
        plain_files.content(path, 10)
    (tmp_path / "plain").write_bytes(b"x" * 10)
    assert plain_files.content(tmp_path / "plain", 10) == b"x" * 10


def test_the_form_of_the_mirror_is_read_from_a_plain_file_alone(tmp_path):
    path, elsewhere = tmp_path / "mirror-form.json", tmp_path / "elsewhere.json"
    mirror_form.keep_form(elsewhere, Form(uses={"0": "check"}))
    path.symlink_to(elsewhere)
    assert mirror_form.kept_form(path) == Form()
    path.unlink()
    elsewhere.rename(path)
    assert mirror_form.kept_form(path).uses == {"0": "check"}


# ------------------------------------------------------------------------------------------------------------ the key
@pytest.mark.promise("studio-6", "studio-23")
def test_the_key_is_made_once_for_this_user_alone_and_outside_of_the_folder(own_key, tmp_path):
    assert not signing.is_ours(b"text", "")
    assert not own_key.exists()  # to look makes none
    code = signing.code(b"text")
    assert signing.is_ours(b"text", code)
    assert not signing.is_ours(b"other", code)
    assert signing.code(b"text") == code
    assert signing.code(b"other") != code
    assert stat.S_IMODE(own_key.stat().st_mode) == 0o600
    assert stat.S_IMODE(own_key.parent.stat().st_mode) == 0o700
    own_key.unlink()
    assert signing.code(b"text") != code  # a new key
    assert not signing.is_ours(b"text", code)


@pytest.mark.promise("studio-23")
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda key: key.chmod(0o640), "is not this user's alone; remove it: the next job makes a new one"),
        (lambda key: key.write_text("short"), "is damaged; remove it"),
        (lambda key: (key.rename(key.with_name("x")), key.symlink_to("x")), "cannot be read: it is a link"),
    ],
)
def test_a_key_that_others_may_know_or_that_is_damaged_is_told(own_key, jobs, tmp_path, monkeypatch, spoil, words):
    monkeypatch.setattr(signing, "_PATIENCE_S", 0.0)
    signing.code(b"text")
    spoil(own_key)
    with pytest.raises(JobError) as refusal:
        jobs.submit(Order("study", "t", ("presets",), tmp_path))
    assert f"the studio's key {own_key} " in str(refusal.value)
    assert words in str(refusal.value)
    assert jobs.listed() == ()
    own_key.unlink()
    signing.code(b"text")
    assert stat.S_IMODE(own_key.stat().st_mode) == 0o600


def test_a_queue_that_another_program_holds_takes_nothing(own_key, jobs, tmp_path, monkeypatch):
    order = Order("study", "t", ("presets",), tmp_path)
    monkeypatch.setattr(queue, "QUEUE_S", 0.0)
    monkeypatch.setattr(queue, "start_waiting", lambda *_: None)
    jobs.submit(order)
    with jobs_files.held(jobs.folder / "lock", 0.0) as mine:
        assert mine
        with pytest.raises(JobError, match="is taken by another program; try again"):
            jobs.submit(order)


@pytest.mark.skipif(os.name != "posix", reason="no such owners")
def test_a_key_and_a_folder_of_another_user_are_refused(own_key, tmp_path, monkeypatch):
    code = signing.code(b"text")
    assert plain_files.private(tmp_path / "own") == tmp_path / "own"
    someone = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: someone)
    with pytest.raises(signing.SigningError, match="is not this user's alone; remove it"):
        signing.is_ours(b"text", code)
    monkeypatch.setattr(os, "getuid", lambda: someone)
    with pytest.raises(OSError, match="it is a link or belongs to somebody else; remove it"):
        plain_files.private(tmp_path / "own")


@pytest.mark.promise("studio-23")
def test_without_the_key_jobs_that_were_queued_before_are_shown_as_unreadable(own_key, jobs, started, tmp_path):
    folder = written(jobs.folder, cwd=str(tmp_path))
    assert jobs_files.read_job(folder).state == "queued"
    own_key.unlink()
    (job,) = jobs.listed()
    assert (job.state, started) == ("unreadable", [])
    jobs.submit(Order("study", "t", ("presets",), tmp_path))  # makes a new key
    later, before = jobs.listed()
    assert (later.state, before.state, started) == ("done", "unreadable", [later.folder])


def test_a_key_that_another_process_is_just_writing_is_waited_for(own_key, monkeypatch):
    code, whole = signing.code(b"text"), own_key.read_bytes()
    own_key.write_bytes(whole[:-1])
    monkeypatch.setattr(signing.time, "sleep", lambda s: own_key.write_bytes(whole))
    assert signing.is_ours(b"text", code)
    monkeypatch.setattr(signing, "_PATIENCE_S", -1.0)
    for wrong in (whole[:-1], whole + b"0"):
        own_key.write_bytes(wrong)
        with pytest.raises(signing.SigningError, match="is damaged; remove it"):
            signing.is_ours(b"text", code)


def test_a_key_that_is_removed_as_it_is_made_is_told(own_key, monkeypatch):
    monkeypatch.setattr(signing, "_key", lambda: None)
    with pytest.raises(signing.SigningError, match=r"studio-key was removed at once; try again$"):
        signing.code(b"text")
    assert not signing.is_ours(b"text", signing._code(b"", b"text"))


def test_a_place_that_cannot_take_the_key_is_told(own_key, tmp_path):
    own_key.parent.parent.write_text("a file", "utf-8")
    with pytest.raises(signing.SigningError, match=r"cannot be made: .*; give XDG_STATE_HOME a folder"):
        signing.code(b"text")


def test_a_key_is_never_there_before_it_is_whole(own_key, monkeypatch):
    synced, sync = [], os.fsync
    monkeypatch.setattr(os, "fsync", lambda file: (sync(file), synced.append(own_key.exists())))
    signing.code(b"text")
    assert (synced, [path.name for path in own_key.parent.iterdir()]) == ([False], [own_key.name])


def test_a_key_that_cannot_be_written_leaves_nothing(own_key, monkeypatch):
    class Full(io.BytesIO):
        def write(self, data):
            raise OSError(28, "No space left on device")

    def full(handle, mode):
        os.close(handle)
        return Full()

    with monkeypatch.context() as patch:
        patch.setattr(signing.os, "fdopen", full)
        with pytest.raises(signing.SigningError, match="cannot be made: No space left on device"):
            signing.code(b"text")
    assert not own_key.exists()
    assert signing.is_ours(b"text", signing.code(b"text"))


def test_a_home_of_somebody_else_is_told(own_key, monkeypatch, jobs, tmp_path):
    def closed(path):
        raise PermissionError(13, "Permission denied", str(path))

    with monkeypatch.context() as patch:
        patch.setattr(signing.plain_files, "opened", closed)
        with pytest.raises(JobError) as refusal:
            jobs.submit(Order("study", "t", ("presets",), tmp_path))
    words = f"the studio's key {own_key} cannot be read: Permission denied; give XDG_STATE_HOME a folder that you may"
    assert str(refusal.value) == f"{words} write to"
    assert jobs.listed() == ()


@pytest.mark.promise("studio-23")
def test_a_relative_state_home_is_ignored(monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "here")
    assert signing.key_file() == Path.home() / ".local" / "state" / "microrad" / "studio-key"
    monkeypatch.setenv("XDG_STATE_HOME", "/there")
    assert signing.key_file() == Path("/there/microrad/studio-key")


@pytest.mark.parametrize("environment", [{}, {"LOCALAPPDATA": ""}])
def test_windows_keeps_the_key_below_the_home_where_no_other_place_is_named(monkeypatch, environment):
    monkeypatch.setattr(signing, "os", SimpleNamespace(name="nt", environ=environment))
    assert signing._state_folder() == Path.home() / "AppData" / "Local"


def test_a_user_without_a_home_is_told(monkeypatch, jobs, tmp_path):
    def nowhere(kind):
        raise RuntimeError

    monkeypatch.setenv("XDG_STATE_HOME", "")
    monkeypatch.setattr(Path, "home", classmethod(nowhere))
    with pytest.raises(JobError, match="this user has no home folder for the studio's key; set HOME or XDG_STATE_HOME"):
        jobs.submit(Order("study", "t", ("presets",), tmp_path))
    assert jobs.listed() == ()


# -------------------------------------------------------------------------------------------------- with its watcher
def test_a_command_without_its_watcher_ends_with_all_that_it_has_started():
    """Where the system does not see to it by itself: the end of the pipe that the watcher holds."""
    code = (
        "import subprocess, sys, threading, time; from microrad.studio.jobs.command import end_with\n"
        "inner = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(86400)'])\n"
        "threading.Thread(target=end_with, args=(0,), daemon=True).start()\n"
        "print(inner.pid, flush=True); time.sleep(86400)\n"
    )
    command = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    with command:
        inner = int(command.stdout.readline())
        assert command.poll() is None
        assert alive(inner)
        command.stdin.close()
        assert command.wait(HANG_S) == -9
    assert gone(inner)


# ------------------------------------------------------------------------------------------------ words for each fault
@pytest.mark.skipif(os.name != "posix", reason="POSIX has links and modes of files")
@pytest.mark.parametrize(
    ("make", "number", "words"),
    [
        (lambda path: path.symlink_to("other"), errno.ELOOP, "it is a link"),
        (lambda path: os.mkfifo(path, 0o600), errno.EINVAL, "it is no plain file"),
        (lambda path: path.write_bytes(b"12345678"), errno.EFBIG, "it is larger than 7 bytes"),
        (lambda path: None, errno.ENOENT, "No such file or directory"),
    ],
)
def test_what_is_not_read_says_which_file_and_why(tmp_path, make, number, words):
    path = tmp_path / "x"
    make(path)
    with pytest.raises(OSError, match=words) as fault:
        plain_files.content(path, 7)
    assert (fault.value.errno, fault.value.strerror, fault.value.filename) == (number, words, str(path))


def test_a_file_of_just_so_many_bytes_is_read_whole(tmp_path):
    (tmp_path / "x").write_bytes(b"1234567")
    assert plain_files.content(tmp_path / "x", 7) == b"1234567"
    plain_files.write_new(tmp_path / "y", b"a\n\xff")
    assert plain_files.content(tmp_path / "y") == b"a\n\xff"
    with pytest.raises(FileExistsError):
        plain_files.write_new(tmp_path / "y", b"b")
    assert plain_files.content(tmp_path / "y") == b"a\n\xff"


@pytest.mark.parametrize(
    ("system", "platform", "environment", "place"),
    [
        ("nt", "win32", {"LOCALAPPDATA": "/local", "XDG_STATE_HOME": "/state"}, "/local"),
        ("posix", "darwin", {"LOCALAPPDATA": "/local", "XDG_STATE_HOME": "/state"}, "home/Library/Application Support"),
        ("posix", "linux", {"LOCALAPPDATA": "/local", "XDG_STATE_HOME": "/state"}, "/state"),
        ("posix", "linux", {"LOCALAPPDATA": "/local"}, "home/.local/state"),
    ],
)
def test_each_system_keeps_the_key_in_its_own_place(monkeypatch, system, platform, environment, place):
    monkeypatch.setattr(signing, "_home", lambda: Path("home"))
    monkeypatch.setattr(signing, "os", SimpleNamespace(name=system, environ=environment))
    monkeypatch.setattr(signing, "sys", SimpleNamespace(platform=platform))
    assert signing.key_file() == Path(place) / "microrad" / "studio-key"


@pytest.mark.parametrize(
    ("error", "remedy"),
    [
        (PermissionError(errno.EACCES, "Permission denied"), "give XDG_STATE_HOME a folder that you may write to"),
        (
            OSError(errno.ELOOP, "it is a link"),
            "remove it: the next job makes a new one, and jobs queued before are not started any more",
        ),
    ],
)
def test_a_key_that_cannot_be_read_says_why_and_what_to_do(own_key, monkeypatch, error, remedy):
    def refuse(path):
        raise error

    monkeypatch.setattr(signing.plain_files, "opened", refuse)
    with pytest.raises(signing.SigningError) as refusal:
        signing.is_ours(b"text", "code")
    assert str(refusal.value) == f"the studio's key {own_key} cannot be read: {error.strerror}; {remedy}"


def test_the_code_of_a_text_is_that_of_the_key_and_of_its_purpose():
    wanted = hmac.new(b"key", b"microrad studio job\0text", hashlib.sha256).hexdigest()
    assert signing._code(b"key", b"text") == wanted
    assert signing._code(b"kex", b"text") != wanted


def test_what_stands_in_the_place_of_a_folder_or_holds_the_queue_is_named(own_key, jobs, tmp_path, monkeypatch):
    monkeypatch.setattr(queue, "QUEUE_S", 0.0)
    monkeypatch.setattr(queue, "start_waiting", lambda *_: None)
    with jobs_files.held(jobs.folder / "lock", 0.0), pytest.raises(JobError) as refusal:
        jobs.submit(Order("study", "t", ("presets",), tmp_path))
    assert str(refusal.value) == f"the queue in {jobs.folder} is taken by another program; try again"
    (tmp_path / "outer").touch()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "jobs").touch()
    for studio, folder in (("outer", tmp_path / "outer"), ("other", tmp_path / "other" / "jobs")):
        with pytest.raises(JobError) as refusal:
            Jobs(tmp_path / studio)
        why = os.strerror(errno.EEXIST)
        assert str(refusal.value) == f"{folder} cannot be made or made private: {why}; choose another folder"


@pytest.mark.parametrize("text", [b'{"kind": "study", "ti', b"[]", b'{"folder": "x"}', b'{"folder": "\xff"}', b"7"])
def test_a_description_of_ones_own_that_is_damaged_says_what_may_have_happened(own_key, jobs, text):
    folder = jobs.folder / "12"
    folder.mkdir()
    (folder / "job.json").write_bytes(text)
    (folder / "job.code").write_text(signing.code(text), "utf-8")
    job = jobs_files.read_job(folder)
    assert (job.number, job.state, job.words) == (
        12,
        "unreadable",
        f"{folder / 'job.json'} is not taken: it is cut off, or was not written by microrad; remove this job, its "
        "results are where they were",
    )


def test_a_job_is_run_in_a_folder_alone(jobs, tmp_path):
    (tmp_path / "file").touch()
    for place in ("file", "none"):
        with pytest.raises(JobError) as refusal:
            jobs.submit(Order("study", "t", ("presets",), tmp_path / place))
        words = "is no folder to run a job in; choose another working folder"
        assert str(refusal.value) == f"{tmp_path / place} {words}"
    assert jobs_files.job_folders(jobs.folder) == []


def test_of_jobs_that_wait_each_is_started_as_soon_as_the_one_before_it_is_over(jobs, started):
    """They end at once: one look at the queue starts all of them, the oldest first."""
    three, one, two = (written(jobs.folder, number) for number in (3, 1, 2))
    (two / "cancel").touch()
    jobs_process.start_waiting(jobs.folder)
    assert started == [one, three]
    assert [job.state for job in jobs.listed()] == ["done", "cancelled", "done"]
    assert started == [one, three]


@pytest.mark.parametrize("note", ["[1]", "7", '"running"', "null", "true"])
def test_a_note_that_holds_anything_but_a_table_says_nothing(jobs, note):
    folder = written(jobs.folder)
    (folder / "started.json").write_text(note, "utf-8")
    job = jobs.get(1)
    assert (job.state, job.started, job.progress) == ("lost", "", None)
    jobs_files.note(folder / "started.json")
    (folder / "exit.json").write_text(note, "utf-8")
    job = jobs.get(1)
    assert (job.state, job.code, job.ended) == ("failed", None, "")
    assert job.words == "it ended without an exit code and said nothing"
