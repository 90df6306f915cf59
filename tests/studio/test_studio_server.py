"""The studio's session, its server and its command: what is kept, what is refused, how it begins and ends."""

import errno
import json
import logging
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import urllib.error
import urllib.request
from contextlib import closing, contextmanager, nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from command_line import listing
from microrad.mission.file import load_mission
from microrad.mission.toml import MissionError
from microrad.studio import server
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.guard import signing
from microrad.studio.guard.address import ExposureError
from microrad.studio.guard.middleware import Limits
from microrad.studio.guard.names import NameRefusedError
from microrad.studio.jobs.queue import Job, Order
from microrad.studio.session import STUDIO, Session
from shipped import DEFAULT, SHIPPED, links_alone
from studio_jobs import written
from waiting import HANG_S, lines_of, until

APERTURE = "terminals.leo_aperture"


@pytest.fixture
def file(tmp_path):
    """A working folder with the paper's mission in it."""
    path = tmp_path / "leo-geo.toml"
    path.write_bytes(SHIPPED.read_bytes())
    return path


# ----------------------------------------------------------------------------------------------------------- session
@pytest.mark.promise("studio-6", "studio-7")
def test_a_session_opens_the_file_that_it_is_given(file):
    other = file.with_name("other.toml")
    other.write_text(file.read_text("utf-8").replace('leo_aperture = "5 cm"', 'leo_aperture = "7 cm"'), "utf-8")
    assert Session(file.parent, other).draft.values[APERTURE].typed == "7 cm"
    assert Session(file.parent).draft.path == file
    assert Session(file.parent).draft.values[APERTURE].typed == "5 cm"


def test_a_page_is_headed_by_its_title(monkeypatch):
    built = []

    class Framed:
        def __init__(self, *given):
            built.append(given)

        def __enter__(self):
            built.append("within")

        def __exit__(self, *error):
            built.append("left")

    monkeypatch.setattr("microrad.studio.pages.layout.frame", Framed)
    page = SimpleNamespace(TITLE="Runs", PATH="/runs", page=built.append)
    server._framed("session", page, (("Runs", "/runs"),))()
    assert built == [("session", "Runs", (("Runs", "/runs"),)), "within", "session", "left"]


@pytest.mark.promise("studio-7")
def test_an_empty_folder_gets_the_shipped_mission_unsaved(tmp_path):
    session = Session(tmp_path)
    assert session.draft.text == DEFAULT.read_text("utf-8")
    assert session.draft.changed
    assert not (tmp_path / "leo-geo.toml").exists()


@pytest.mark.promise("studio-7", "studio-9")
def test_unsaved_changes_survive_a_restart(file):
    before = file.read_bytes()
    Session(file.parent, file).set(APERTURE, "6 cm")
    again = Session(file.parent)
    assert again.draft.values[APERTURE].typed == "6 cm"
    assert again.draft.changed
    assert file.read_bytes() == before


def test_unsaved_changes_of_one_file_are_not_put_into_another(file):
    other = file.with_name("other.toml")
    other.write_bytes(file.read_bytes())
    Session(file.parent, file).set(APERTURE, "6 cm")
    assert Session(file.parent, other).draft.values[APERTURE].typed == "5 cm"
    assert Session(file.parent, file).draft.values[APERTURE].typed == "6 cm"


def test_what_was_saved_is_read_from_the_file_after_a_restart(file):
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    session.change(session.draft.save())
    file.write_text(file.read_text("utf-8").replace('"6 cm"', '"8 cm"'), "utf-8")
    again = Session(file.parent)
    assert again.draft.values[APERTURE].typed == "8 cm"
    assert not again.draft.changed


@pytest.mark.promise("studio-11")
def test_a_file_changed_behind_unsaved_changes_is_not_overwritten_after_a_restart(file):
    Session(file.parent, file).set(APERTURE, "6 cm")
    file.write_text(file.read_text("utf-8").replace('"15 cm"', '"16 cm"'), "utf-8")
    kept = file.read_bytes()
    with pytest.raises(DraftError, match="was changed since it was opened here"):
        Session(file.parent).draft.save()
    assert file.read_bytes() == kept


@pytest.mark.parametrize("kept", ["", "{", "[]", "{}", '{"path": 3, "disk_sha256": "", "text": ""}', "\x00"])
def test_a_damaged_note_of_unsaved_changes_is_passed_over(file, kept):
    Session(file.parent, file).set(APERTURE, "6 cm")
    (file.parent / STUDIO / "draft.json").write_text(kept, "utf-8")
    assert Session(file.parent).draft.values[APERTURE].typed == "5 cm"


def test_a_note_of_unsaved_changes_opens_nothing_outside_of_the_folder(file, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "secret.toml"
    outside.write_text('name = "secret"', "utf-8")
    Session(file.parent)
    note = {"path": os.path.relpath(outside, file.parent), "disk_sha256": "", "text": "changed"}
    (file.parent / STUDIO / "draft.json").write_text(json.dumps(note), "utf-8")
    assert Session(file.parent).draft.path == file


@pytest.mark.promise("studio-6", "studio-22")
def test_nothing_outside_of_the_folder_is_opened(file, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    with pytest.raises(NameRefusedError, match="is outside of"):
        Session(elsewhere, file)
    with pytest.raises(NameRefusedError, match="is outside of"):
        Session(file.parent).inside("../x.toml")
    assert not (elsewhere / STUDIO).exists()


def test_each_change_is_a_new_revision_and_none_is_none(file):
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    assert session.revision == 1
    session.set(APERTURE, "6 cm")
    assert session.revision == 1
    session.other = Draft.shipped("paper.toml")
    assert session.revision == 2


def test_a_change_is_kept_where_the_studios_folder_was_removed(file):
    session = Session(file.parent, file)
    shutil.rmtree(session.studio)
    session.set(APERTURE, "6 cm")
    assert Session(file.parent).draft.values[APERTURE].typed == "6 cm"


@pytest.mark.promise("studio-9")
def test_changes_of_two_tabs_are_both_kept(file):
    session = Session(file.parent, file)
    keys = ("communication.transmit_power", "beacon.transmit_power")

    def turn(key):
        for number in range(20):
            session.set(key, f"{number + 1} W")

    threads = [threading.Thread(target=turn, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [session.draft.values[key].typed for key in keys] == ["20 W", "20 W"]
    assert session.revision == 40


def test_a_mission_with_faults_is_none_and_says_the_words_of_the_command_line(file):
    session = Session(file.parent, file)
    assert session.mission().mission == load_mission(file).mission
    assert session.faults() == ""
    session.set(APERTURE, "5 parsec")
    assert session.mission() is None
    assert session.link() is None
    session.draft.save()
    with pytest.raises(MissionError) as refused:
        load_mission(file)
    assert session.faults() == str(refused.value)
    assert 'no unit is called "parsec"' in session.faults()


def test_a_link_alone_has_a_budget_and_no_mission(file):
    session = Session(file.parent, file)
    session.change(session.draft.with_text(links_alone(SHIPPED.read_text("utf-8"))))
    assert session.link().mission.terminals.leo_aperture_m == 0.05
    assert session.mission() is None
    assert "mirror" in session.faults()


def test_only_the_missions_of_the_folder_itself_are_listed(file):
    for name in ("b.toml", ".hidden.toml", "x.txt", "inner/c.toml"):
        path = file.parent / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("", "utf-8")
    (file.parent / "folder.toml").mkdir()
    assert [path.name for path in Session(file.parent).missions()] == ["b.toml", "leo-geo.toml"]


@pytest.mark.promise("studio-8")
def test_the_studios_own_folder_is_private_and_overlooked_by_git(file):
    Session(file.parent)
    folder = file.parent / STUDIO
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / ".gitignore").read_text("utf-8") == "*\n"


# ------------------------------------------------------------------------------------------------------------- server
@contextmanager
def taken_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-2", "studio-3", "studio-22")
@pytest.mark.promise("readme-26")
def test_a_free_port_is_taken_on_this_machine_alone():
    entrance = server.listen()
    with closing(entrance.listener):
        host, port = entrance.listener.getsockname()
        assert host == "127.0.0.1"
        assert entrance.names == (f"127.0.0.1:{port}",)  # another program may have that port of [::1], and localhost
        assert entrance.url == f"http://127.0.0.1:{port}/?token={entrance.token}"
        assert len(entrance.token) >= 32
        again = server.listen()
        with closing(again.listener):
            assert again.token != entrance.token


@pytest.mark.promise("studio-24")
def test_an_address_for_others_is_the_only_name(monkeypatch):
    monkeypatch.setattr(server, "_bound", lambda host, port: socket.create_server(("127.0.0.1", port)))
    entrance = server.listen(exposed="192.0.2.7")
    with closing(entrance.listener):
        port = entrance.listener.getsockname()[1]
        assert entrance.names == (f"192.0.2.7:{port}",)


@pytest.mark.parametrize(
    "address", ["0.0.0.0", "::", "*", "", "0", "0x0", "00.0", "::0", "0:0:0:0:0:0:0:0", "::ffff:0:0"]
)
def test_every_address_at_once_is_refused(address):
    with pytest.raises(server.StudioError, match="no address that a browser could open; give this machine's own"):
        server.listen(exposed=address)


@pytest.mark.parametrize(
    ("typed", "name"), [("127.1", "127.0.0.1"), ("127.0.0.1", "127.0.0.1"), ("LocalHost", "localhost")]
)
def test_an_address_is_named_as_browsers_write_it(typed, name):
    entrance = server.listen(exposed=typed)
    with closing(entrance.listener):
        host, port = entrance.listener.getsockname()
        assert (host, entrance.names) == ("127.0.0.1", (f"{name}:{port}",))
        assert entrance.url == f"http://{name}:{port}/?token={entrance.token}"


@pytest.mark.parametrize(
    ("exposed", "bound", "name"),
    [
        (None, "127.0.0.1", "127.0.0.1"),
        ("localhost", "127.0.0.1", "localhost"),  # whatever the name stands for here
        ("127.1", "127.0.0.1", "127.0.0.1"),
        ("::1", "::1", "[::1]"),
        ("lab.example", "lab.example", "lab.example"),
    ],
)
def test_a_name_is_bound_and_told_as_browsers_write_it(monkeypatch, exposed, bound, name):
    asked = []
    listener = SimpleNamespace(getsockname=lambda: ("", 8123))
    monkeypatch.setattr(server, "_bound", lambda *place: asked.append(place) or listener)
    assert server.listen(7, exposed).names == (f"{name}:8123",)
    assert asked == [(bound, 7)]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (
            errno.EADDRINUSE,
            "port 80 is in use, perhaps by another studio; give another one with --port, or leave",
        ),
        (errno.EACCES, "port 80 is not open to this user; give one from 1024 on with --port"),
        (errno.EADDRNOTAVAIL, "'h' port 80 cannot be listened on: the reason; give an address of this machine"),
    ],
)
def test_a_port_that_cannot_be_taken_says_what_to_do(number, words):
    assert server._unbound("h", 80, OSError(number, "the reason")).startswith(words)


def test_a_websocket_that_was_refused_is_no_news_for_the_terminal():
    def record(words, *args):
        return logging.LogRecord("x", logging.ERROR, "", 0, words, args, None)

    assert not server._is_news(record("opening handshake failed: %s", "connection closed without completing handshake"))
    assert server._is_news(record("the disk is full"))


@pytest.mark.skipif(os.name != "posix", reason="no terminals that hang up")
def test_a_closed_terminal_ends_the_server_unless_it_is_to_outlive_it(monkeypatch):
    heard, before = [], [signal.SIG_DFL]
    monkeypatch.setattr(server.signal, "getsignal", lambda number: before[0])
    monkeypatch.setattr(server.signal, "signal", lambda *how: heard.append(how))
    server._end_with_terminal(print)
    assert heard == [(signal.SIGHUP, print)]
    before[0] = signal.SIG_IGN
    server._end_with_terminal(print)
    before[0] = signal.SIG_DFL
    monkeypatch.delattr(server.signal, "SIGHUP")
    server._end_with_terminal(print)
    assert len(heard) == 1


def test_what_is_no_name_of_a_host_is_refused(monkeypatch):
    listener = socket.create_server(("127.0.0.1", 0))
    monkeypatch.setattr(server, "_bound", lambda host, port: listener)
    with closing(listener), pytest.raises(ExposureError, match="is no name of a host"):
        server.listen(exposed="a/b")


def test_an_address_of_another_machine_is_refused():
    with pytest.raises(server.StudioError, match=r"'192\.0\.2\.1' port 0 cannot be listened on: .*; give an address"):
        server.listen(exposed="192.0.2.1")


@pytest.mark.parametrize("address", ["a" * 300, "a..b"])
def test_a_name_that_none_can_be_is_refused(address):
    with pytest.raises(server.StudioError, match=r"'a[a.b]*' is no address of this machine; give one such as"):
        server.listen(exposed=address)


def test_the_page_that_a_browser_is_started_with_is_its_owners_alone(file, tmp_path_factory):
    studio = Session(file.parent).studio
    outside = tmp_path_factory.mktemp("outside") / "kept"
    outside.write_text("kept", "utf-8")
    (studio / "open.html").symlink_to(outside)  # came with the folder
    url = "http://127.0.0.1:8123/?token=secret"
    page = server.way_in(studio, url)
    path = studio / "open.html"
    assert (page, path.is_symlink(), outside.read_text("utf-8")) == (path.as_uri(), False, "kept")
    assert path.stat().st_mode & 0o777 == 0o600
    assert f'content="0;url={url}"' in path.read_text("utf-8")
    assert server.way_in(studio, url) == page  # a second time


def test_a_page_that_cannot_be_written_is_named_and_not_there(file, monkeypatch):
    def full(path):
        raise OSError(28, "No space left on device")

    studio = Session(file.parent).studio
    with pytest.raises(OSError, match="No space left") as caught, monkeypatch.context() as patch:
        patch.setattr(server.plain_files, "new", full)
        server.way_in(studio, "http://127.0.0.1:8123/?token=secret")
    assert caught.value.filename == str(studio / "open.html")
    assert not (studio / "open.html").exists()


@pytest.mark.promise("studio-22")
def test_only_results_of_a_job_within_the_folder_are_shown(file, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "secret.html"
    outside.write_text("secret", "utf-8")
    session = Session(file.parent)
    (file.parent / "page.html").write_text("page", "utf-8")
    (file.parent / "link.html").symlink_to(outside)
    names = (
        "page.html",
        "missing.html",
        str(outside),
        os.path.relpath(outside, file.parent),
        "link.html",
        ".",
        "page.html",
    )
    written(session.jobs.folder, cwd=str(file.parent), results=names)
    found = [server.result(session, 1, place) for place in range(-1, 8)]
    page = file.parent / "page.html"
    assert found == [None, page, *[None] * 5, page, None]  # none is counted from the end
    assert server.result(session, 2, 0) is None


def test_a_page_is_shown_and_any_other_result_is_saved(file):
    pytest.importorskip("starlette")
    session = Session(file.parent)
    for name in ("page.html", "data.nc"):
        (file.parent / name).write_text("x", "utf-8")
    written(session.jobs.folder, cwd=str(file.parent), results=("page.html", "data.nc", "gone.html"))
    show = server._documents(session)
    page, data, gone = (show(1, place) for place in range(3))
    assert (gone.status_code, gone.body) == (404, b"This result is not there any more.")
    assert page.headers["content-disposition"] == 'inline; filename="page.html"'
    assert data.headers["content-disposition"] == 'attachment; filename="data.nc"'


def test_a_number_that_no_job_can_have_shows_nothing(file):
    assert server.result(Session(file.parent), 10**400, 0) is None


# ------------------------------------------------------------------------------------------------------------ command
@pytest.mark.promise("studio-5", "studio-8")
def test_a_second_studio_in_a_folder_is_refused(refused, folder, monkeypatch):
    monkeypatch.setattr(server, "serve", lambda *_: pytest.fail("there are two of them"))
    with server.alone(Session(folder).studio):
        said = refused("studio", "--no-browser")
    assert said == (
        f"microrad: {folder} is open in another studio, process {os.getpid()}; go on in that one, or end it with "
        "Ctrl-C first: two would not see, and overwrite, each other's unsaved changes\n"
    )
    (folder / STUDIO / "open.json").write_text("{", "utf-8")
    with server.alone(Session(folder).studio):  # the first is gone
        (folder / STUDIO / "open.json").write_text("[]", "utf-8")
        assert f"microrad: {folder} is open in another studio; go on" in refused("studio", "--no-browser")


@pytest.mark.promise("studio-2")
def test_a_port_in_use_is_refused(refused):
    with taken_port() as port:
        said = refused("studio", "--no-browser", "--port", port)
    assert said == (
        f"microrad: port {port} is in use, perhaps by another studio; give another one with --port, "
        "or leave --port out for a free one\n"
    )


def test_a_file_that_is_not_there_is_refused(refused, monkeypatch):
    monkeypatch.setattr(server, "serve", lambda *_: pytest.fail("it would wait without end"))
    assert "missing.toml" in refused("studio", "missing.toml", "--no-browser")


def test_a_file_that_is_no_text_is_refused(refused, folder):
    (folder / "picture.toml").write_bytes(b"\x89PNG\x00\xff")
    assert "picture.toml" in refused("studio", "picture.toml", "--no-browser")


@pytest.mark.promise("studio-2")
def test_an_installation_without_the_studio_says_what_to_install(refused, monkeypatch):
    monkeypatch.setattr(server.util, "find_spec", lambda name: None)
    said = refused("studio")
    assert said == (
        "microrad: the studio needs nicegui and uvicorn, which this installation does not have; install it "
        "in the project's folder: pip install --constraint constraints.txt '.[studio]'\n"
    )


@pytest.mark.promise("studio-24")
def test_to_be_open_to_others_needs_the_flag_typed_out_with_an_address(refused):
    for short in ("--expose", "--expose-to-net", "--host"):
        assert "No such option" in refused("studio", short, "192.0.2.1", "--no-browser")
    said = refused("studio", "--expose-to-network", "192.0.2.1", "--no-browser")
    assert "microrad: '192.0.2.1' port 0 cannot be listened on" in said
    assert "0.0.0.0" in refused("studio", "--expose-to-network", "0.0.0.0", "--no-browser")


# What was started by nohup ignores this signal, and so do its children.
HEARD = """
import signal
from microrad.cli import main
signal.signal(getattr(signal, "SIGHUP", signal.SIGTERM), signal.SIG_DFL)
main()
"""


@contextmanager
def running(folder, *args, browser=None, code=HEARD):
    pytest.importorskip("nicegui")
    process = subprocess.Popen(
        [sys.executable, "-c", code, "studio", *(["--no-browser"] if browser is None else []), *args],
        cwd=folder,
        env=os.environ | ({} if browser is None else {"BROWSER": str(browser)}),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


INTERRUPT = pytest.param(signal.SIGINT, marks=pytest.mark.endurance)  # as tests in a browser end theirs
HANGUP = pytest.param(getattr(signal, "SIGHUP", 1), marks=pytest.mark.endurance)


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-2", "studio-4", "studio-6")
@pytest.mark.parametrize("number", [INTERRUPT, signal.SIGTERM, HANGUP])
@pytest.mark.promise("readme-26")
def test_the_address_opens_the_studio_and_a_signal_ends_it(file, number):
    before = listing(file.parent)
    with running(file.parent, "leo-geo.toml") as (process, url):
        base, _, token = url.partition("?token=")
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(base)
        request = urllib.request.Request(base, headers={"Cookie": f"microrad_studio_{base.split(':')[2][:-1]}={token}"})
        with urllib.request.urlopen(request) as answer:
            assert answer.status == 200
            assert "leo-geo.toml" in answer.read().decode("utf-8")
        process.send_signal(number)
        out, err = process.communicate(timeout=HANG_S)
    assert (process.returncode, out, err) == (0, "the studio is closed\n", "")
    kept = {name: data for name, data in listing(file.parent).items() if not name.startswith(STUDIO)}
    assert kept == before


# A studio that starts a job, keeps a change, and notes what it opens to be written and whom it asks.
WATCHED = """
import os, sys
from pathlib import Path
from microrad.cli import main
from microrad.studio.jobs.queue import Order
from microrad.studio.session import Session

notes = open(os.environ["NOTES"], "a", 1)
ASKING = "socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto", "socket.sendmsg"

def hear(event, told):
    if event in ASKING:
        asked = told[0] if event.startswith("socket.get") else told[1]
        notes.write(f"asks {asked!r}\\n")
    elif event == "open" and isinstance(told[0], str) and told[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        notes.write(f"writes {os.path.abspath(told[0])}\\n")

sys.addaudithook(hear)
session = Session(Path.cwd())
session.set("terminals.leo_aperture", "6 cm")
session.jobs.submit(Order("study", "t", ("presets",), Path.cwd()))
main()
"""


def in_memory(pid, word):
    """How often a word stands in what a process may write."""
    found = 0
    of = Path("/proc") / str(pid)
    with (of / "mem").open("rb") as memory:
        for line in (of / "maps").read_text().splitlines():
            place, mode, *_ = line.split()
            start, end = (int(each, 16) for each in place.split("-"))
            with suppress(OSError, ValueError):  # it was given back meanwhile
                if mode.startswith("rw"):
                    memory.seek(start)
                    found += memory.read(end - start).count(word)
    return found


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """What a studio did, by its own notes and by what lies in its user's folders behind it."""
    places = {name: tmp_path_factory.mktemp(name) for name in ("home", "temporary", "work", "notes")}
    work, notes = places["work"], places["notes"] / "notes"
    (work / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())
    with pytest.MonkeyPatch.context() as patch:
        for name in [each for each in os.environ if each.startswith("XDG_")]:
            patch.delenv(name)
        patch.setenv("HOME", str(places["home"]))
        patch.setenv("TMPDIR", str(places["temporary"]))
        patch.setenv("NOTES", str(notes))
        key = signing.key_file()
        with running(work, code=WATCHED) as (process, url):
            status, _ = asked(url, "")
            ended = work / STUDIO / "jobs" / "1" / "exit.json"
            until(ended.exists, "the end of the job")
            draft = (work / STUDIO / "draft.json").read_text("utf-8")
            tokens = in_memory(process.pid, url.rpartition("=")[2].encode()) if sys.platform == "linux" else None
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=HANG_S)
    assert (status, process.returncode, json.loads(ended.read_text("utf-8"))["code"]) == (200, 0, 0)
    heard = [line.split(" ", 1) for line in notes.read_text("utf-8").splitlines()]
    return SimpleNamespace(**places, key=key, draft=draft, tokens=tokens, heard=heard)


@pytest.mark.promise("studio-6")
def test_nothing_is_left_outside_of_the_folder_but_the_key_and_what_libraries_keep(watched):
    left = {path for place in (watched.home, watched.temporary) for path in place.rglob("*") if path.is_file()}
    assert {path for path in left if watched.home / ".cache" not in path.parents} == {watched.key}
    opened = {Path(told) for what, told in watched.heard if what == "writes"}
    assert any(watched.work / STUDIO in path.parents for path in opened)
    own = watched.work, watched.home, watched.temporary, Path("/dev")
    others = {path for path in opened if not any(place in path.parents for place in own)}
    assert {path for path in others if "__pycache__" not in path.parts} == set()


@pytest.mark.promise("studio-30")
def test_a_studio_asks_nobody_but_for_its_own_address(watched):
    assert {told for what, told in watched.heard if what == "asks"} == {"'127.0.0.1'"}


@pytest.mark.promise("studio-34")
@pytest.mark.skipif(sys.platform != "linux", reason="a process is a file on Linux alone")
def test_another_program_of_the_user_reads_the_token_and_the_drafts(watched):
    assert watched.tokens > 0
    assert '"6 cm"' in json.loads(watched.draft)["text"]


@pytest.mark.promise("studio-4")
def test_a_second_signal_breaks_nothing_off_and_a_third_does():
    uvicorn = pytest.importorskip("uvicorn")
    own = server._server(uvicorn.Config(None), lambda: None)
    found = []
    for _ in range(3):
        own.handle_exit(signal.SIGINT, None)
        found.append((own.should_exit, own.force_exit))
    assert found == [(True, False), (True, False), (True, True)]


def asked(url, path):
    """What a browser that has the cookie gets: status, headers."""
    base, _, token = url.partition("?token=")
    cookie = f"microrad_studio_{base.split(':')[2][:-1]}={token}"
    try:
        with urllib.request.urlopen(
            urllib.request.Request(base + path, headers={"Cookie": cookie}), timeout=HANG_S
        ) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as error:
        return error.code, error.headers


def test_a_browser_may_be_silent_for_long_before_its_page_is_taken_for_closed(file):
    """It is, where it draws on a busy machine; what the page says to a browser that comes in are its terms in ms."""
    with running(file.parent, "leo-geo.toml") as (_, url):
        base, _, token = url.partition("?token=")
        cookie = f"microrad_studio_{base.split(':')[2][:-1]}={token}"
        terms = urllib.request.Request(
            f"{base}_nicegui_ws/socket.io/?EIO=4&transport=polling", headers={"Cookie": cookie}
        )
        with urllib.request.urlopen(terms, timeout=HANG_S) as answer:
            told = json.loads(answer.read().decode("utf-8").removeprefix("0"))
    assert told["pingTimeout"] >= 20_000
    assert told["pingInterval"] + told["pingTimeout"] >= 60_000


_BROWSER = """#!/bin/sh
exec >/dev/null 2>&1
echo "$@" > {folder}/new
mv {folder}/new {folder}/said
while [ -e {folder}/open ]; do sleep 0.1; done
"""


@pytest.mark.promise("studio-2", "studio-22")
@pytest.mark.skipif(os.name != "posix", reason="the browser of the test is a shell script")
@pytest.mark.promise("readme-26")
def test_a_browser_is_started_without_the_token_on_its_command_line(file, tmp_path_factory):
    """Every user of the machine may read command lines. This browser ends as late as one that is closed by hand."""
    told = tmp_path_factory.mktemp("browser")
    script, still_open, page = told / "browser", told / "open", file.parent / STUDIO / "open.html"
    script.write_text(_BROWSER.format(folder=told), "utf-8")
    script.chmod(0o700)
    still_open.touch()
    for name in ("page.html", "picture.svg"):
        (file.parent / name).write_text("<script>1</script>", "utf-8")
    job = written(Session(file.parent).jobs.folder, cwd=str(file.parent), results=("page.html", "picture.svg"))
    for name in ("started.json", "exit.json"):  # over, so that nobody starts it
        (job / name).write_text('{"at": "", "code": 0}', "utf-8")
    with running(file.parent, "leo-geo.toml", browser=script) as (process, url):
        assert lines_of(told / "said") == [page.as_uri()]
        assert page.stat().st_mode & 0o777 == 0o600
        assert url in page.read_text("utf-8")
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(url.partition("?")[0], timeout=HANG_S)  # it answers while the browser is open
        status, page_of_its_own = asked(url, "results/1/0")
        assert (status, "sandbox allow-scripts" in page_of_its_own["Content-Security-Policy"]) == (200, True)
        assert page_of_its_own["Content-Disposition"].startswith("inline")
        status, picture = asked(url, "results/1/1")
        assert (status, "sandbox allow-scripts" in picture["Content-Security-Policy"]) == (200, True)
        assert picture["Content-Disposition"].startswith("attachment")
        status, studio = asked(url, "runs")
        assert (status, "sandbox" in studio["Content-Security-Policy"]) == (200, False)
        assert [asked(url, name)[0] for name in ("docs", "redoc", "openapi.json")] == [404] * 3
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=HANG_S) == 0
        still_open.unlink()
    assert not page.exists()


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-4", "studio-16")
def test_a_job_goes_on_when_the_studio_ends(file):
    session = Session(file.parent)
    with running(file.parent) as (process, _):
        job = session.jobs.submit(Order("study", "long", ("run", "leo-geo.toml", "--output", "x"), file.parent))
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=HANG_S)
    assert out == "the studio is closed; 1 of its jobs goes on, and can be seen by starting it again\n"
    assert session.jobs.get(job.number).state == "running"
    session.jobs.cancel(job.number)
    until(lambda: session.jobs.get(job.number).finished, "the end of the job")
    assert session.jobs.get(job.number).state == "cancelled"


@pytest.mark.promise("readme-15")
def test_every_page_is_there():
    pages = Path(server.__file__).parent / "pages"
    assert [name for name in server.PAGES if not (pages / f"{name}.py").is_file()] == []


@pytest.mark.parametrize(
    "loads",
    [
        pytest.param((), id="budgets"),
        pytest.param(("microrad.study.pointing_penalty",), id="with the study", marks=pytest.mark.endurance),
    ],
)
def test_a_budget_as_text_loads_no_compiled_loops(loads):
    names = ", ".join(("sys", "microrad.report.links.budgets", *loads))
    code = f"import {names}; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(bool(loads))


# ---------------------------------------------------------------------------------------------- files beside each other
def test_a_draft_and_the_other_mission_are_kept_apart_and_both_come_back(file):
    other = file.with_name("b.toml")
    other.write_text(file.read_text("utf-8").replace('"5 cm"', '"7 cm"'), "utf-8")
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    session.other = Draft.open(other).set(APERTURE, "8 cm")
    again = Session(file.parent)
    assert (again.draft.path, again.draft.values[APERTURE].typed) == (file, "6 cm")
    assert (again.other.path, again.other.values[APERTURE].typed) == (other, "8 cm")
    assert (again.draft.disk_sha256, again.other.disk_sha256) == (Draft.open(file).sha256, Draft.open(other).sha256)
    again.other = None
    assert Session(file.parent).other is None
    assert Session(file.parent).draft.values[APERTURE].typed == "6 cm"


def test_a_draft_that_replaces_another_is_opened_and_one_that_is_changed_is_not(file):
    session = Session(file.parent, file)
    counts = [(session.revision, session.opened)]
    for change in (
        lambda: session.set(APERTURE, "6 cm"),
        lambda: session.replace(session.draft),
        lambda: session.replace(Draft.shipped(session.inside("n.toml"))),
        lambda: session.save("n.toml"),
        session.reopen,
        lambda: setattr(session, "other", None),
    ):
        change()
        counts.append((session.revision, session.opened))
    assert counts == [(0, 0), (1, 0), (2, 1), (4, 2), (5, 2), (6, 3), (7, 3)]


def test_a_name_is_that_within_the_folder_and_whole_elsewhere(file, tmp_path_factory):
    session, outside = Session(file.parent), tmp_path_factory.mktemp("outside") / "x.toml"
    assert session.name_of(file.parent / "inner" / "x.toml") == "inner/x.toml"
    assert session.name_of(outside) == str(outside)
    assert session.inside("inner/../x.toml") == file.parent / "x.toml"


def test_a_draft_behind_a_link_that_has_come_in_its_place_is_not_saved(file):
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    kept = file.with_name("kept.toml")
    file.rename(kept)
    file.symlink_to(kept)
    with pytest.raises(DraftError) as refusal:
        session.save()
    assert str(refusal.value) == (
        f"{file} is or lies behind a link to {kept} now, which it was not when it was opened; remove the link, or save "
        "under another name"
    )
    assert '"6 cm"' not in kept.read_text("utf-8")
    session.save("new.toml")
    assert '"6 cm"' in (file.parent / "new.toml").read_text("utf-8")
    assert (session.draft.path.name, session.draft.changed, session.disk) == ("new.toml", False, "")


@pytest.mark.parametrize(
    ("change", "seen"),
    [
        (lambda path: path.write_text("name = 'x'", "utf-8"), "changed"),
        (lambda path: path.unlink(), "gone"),
        (lambda path: path.chmod(0o600), ""),
        (lambda path: os.utime(path, (1.0, 2.0)), ""),
    ],
)
def test_what_becomes_of_a_file_is_a_revision_once(file, change, seen):
    session = Session(file.parent, file)
    assert (session.disk, session.revision) == ("", 0)
    change(file)
    assert [session.disk, session.disk] == [seen, seen]
    assert session.revision == bool(seen)


@pytest.mark.parametrize(
    ("note", "words"),
    [
        ('{"pid": 4711, "at": ""}', ", process 4711"),
        ('{"pid": "12"}', ", process 12"),
        ('{"pid": null}', ""),
        ('{"pid": 1e999}', ""),
        ('{"at": 1}', ""),
        ("[1]", ""),
        ("{", ""),
        (None, ""),
    ],
)
def test_the_process_of_another_studio_is_named_where_its_note_can_be_read(tmp_path, note, words):
    if note is not None:
        (tmp_path / "open.json").write_text(note, "utf-8")
    assert server._process(tmp_path / "open.json") == words


def test_results_of_two_jobs_are_those_of_their_own_places(file):
    session = Session(file.parent)
    for name in ("a.html", "b.html", "c.nc"):
        (file.parent / name).write_text(name, "utf-8")
    written(session.jobs.folder, 1, cwd=str(file.parent), results=("a.html", "c.nc"))
    written(session.jobs.folder, 2, cwd=str(file.parent), results=("c.nc", "b.html"))
    found = {(n, place): server.result(session, n, place) for n in (1, 2) for place in (0, 1, 2)}
    assert {key: None if path is None else path.name for key, path in found.items()} == {
        (1, 0): "a.html",
        (1, 1): "c.nc",
        (1, 2): None,
        (2, 0): "c.nc",
        (2, 1): "b.html",
        (2, 2): None,
    }


def test_a_studio_that_is_exposed_answers_under_that_name_alone(monkeypatch):
    listener = SimpleNamespace(getsockname=lambda: ("", 80))
    monkeypatch.setattr(server, "_bound", lambda *place: listener)
    for exposed, names in (("Lab.Example", ("lab.example",)), ("::1", ("[::1]",)), (None, ("127.0.0.1",))):
        entrance = server.listen(80, exposed)
        assert (entrance.names, entrance.listener) == (names, listener)
        assert entrance.url == f"http://{names[0]}/?token={entrance.token}"


@pytest.mark.parametrize(
    ("states", "words"),
    [
        ((), "the studio is closed"),
        (("done", "lost"), "the studio is closed"),
        (("running", "done"), "the studio is closed; 1 of its jobs goes on, and can be seen by starting it again"),
        (
            ("running", "done", "queued"),
            "the studio is closed; 2 of its jobs go on, and can be seen by starting it again",
        ),
    ],
)
def test_a_studio_that_ends_says_how_many_jobs_go_on(call, folder, monkeypatch, states, words):
    asked = []
    listener = SimpleNamespace(close=lambda: asked.append("closed"))

    def serve(session, entrance, on_ready):
        monkeypatch.setattr(session.jobs, "listed", lambda: [Job(1, folder, state) for state in states])
        asked.append((session.folder, session.draft.path.name, entrance))
        raise KeyboardInterrupt

    entrance = SimpleNamespace(listener=listener)
    monkeypatch.setattr(server, "check_installed", lambda: None)
    monkeypatch.setattr(server, "listen", lambda *where: asked.append(where) or entrance)
    monkeypatch.setattr(server, "serve", serve)
    (folder / "sub").mkdir()
    (folder / "sub" / "m.toml").write_bytes(SHIPPED.read_bytes())
    result = call("studio", "sub/m.toml", "--port", "8420", "--expose-to-network", "lab", "--no-browser")
    assert (result.code, result.out) == (0, f"{words}\n")
    assert asked == [(8420, "lab"), (folder / "sub", "m.toml", entrance), "closed"]


def test_an_installation_that_lacks_libraries_names_each(monkeypatch):
    for lacking, words in (({"nicegui", "uvicorn"}, "nicegui and uvicorn"), ({"uvicorn"}, "uvicorn")):
        monkeypatch.setattr(server.util, "find_spec", lambda name, lacking=lacking: None if name in lacking else 1)
        monkeypatch.setattr(server, "advice", lambda extra: f"with the extra {extra}")
        with pytest.raises(server.StudioError) as refusal:
            server.check_installed()
        assert str(refusal.value) == (
            f"the studio needs {words}, which this installation does not have; install it with the extra studio"
        )
    monkeypatch.setattr(server.util, "find_spec", lambda name: 1)
    assert server.check_installed() is None


# ------------------------------------------------------------------------------------------------- with what it is run
def test_the_pages_are_run_behind_the_guard_with_all_their_settings(file, monkeypatch):
    nicegui = pytest.importorskip("nicegui")
    ran, signed, added = [], [], []
    monkeypatch.setenv("NICEGUI_STORAGE_PATH", "before")
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(nicegui.ui, "run_with", lambda app, **settings: ran.append((app, settings)))
    monkeypatch.setattr(server.policy, "sign_template", signed.append)
    monkeypatch.setattr(server, "_add_pages", added.append)
    session, entrance = Session(file.parent), server.Entrance(None, ("a:81", "b:81"), "t" * 32)
    guard = server.application(session, entrance)
    ((app, settings),) = ran
    assert settings == {
        "title": "microrad studio",
        "language": "en-US",
        "show_welcome_message": False,
        "gzip_middleware_factory": None,
        "reconnect_timeout": 60.0,
    }
    assert (guard.app, guard.hosts, guard.origins) == (app, ("a:81", "b:81"), ("http://a:81", "http://b:81"))
    assert (guard.documents, guard.limits, guard.cookie) == (("/results/",), Limits(), "microrad_studio_81")
    assert [(route.path, route.methods) for route in app.routes] == [("/results/{number}/{place}", {"GET"})]
    assert (len(signed), added) == (1, [session])
    spool = session.studio / "uploads" / "spool"
    assert tempfile.tempdir == str(spool)
    storage = Path(os.environ["NICEGUI_STORAGE_PATH"])
    assert storage.name.startswith("microrad-") and len(storage.name) == 41 and not storage.exists()


def test_each_page_has_its_path_and_a_title_of_the_studio(monkeypatch):
    nicegui = pytest.importorskip("nicegui")
    pages, framed = [], []
    monkeypatch.setattr(nicegui.ui, "page", lambda path, title: lambda build: pages.append((path, title, build)))
    monkeypatch.setattr(server, "_framed", lambda *given: framed.append(given) or given[1].TITLE)
    server._add_pages("session")
    names = ["Mission", "Links", "Pointing", "Day", "Mirror", "Control", "Runs", "Compare"]
    paths = ["/", "/link", "/pointing", "/day", "/mirror", "/control", "/runs", "/compare"]
    assert pages == [(path, f"{name} - microrad studio", name) for path, name in zip(paths, names, strict=True)]
    assert {given[2] for given in framed} == {tuple(zip(names, paths, strict=True))}
    assert [given[1].TITLE for given in framed] == names


@pytest.mark.parametrize("fails", [False, True])
def test_a_server_is_quiet_waits_for_open_pages_and_takes_its_way_in_away(file, monkeypatch, fails):
    uvicorn = pytest.importorskip("uvicorn")
    ran, session = [], Session(file.parent)

    def run(sockets):
        ran.append(sockets)
        assert (session.studio / "open.html").exists()
        if fails:
            raise OSError("it cannot listen")

    monkeypatch.setattr(server, "application", lambda *given: ("guarded", *given))
    monkeypatch.setattr(uvicorn, "Config", lambda app, **settings: (app, settings))
    monkeypatch.setattr(server, "_server", lambda *given: ran.append(given) or SimpleNamespace(run=run))
    entrance = SimpleNamespace(listener="listener")
    server.way_in(session.studio, "http://127.0.0.1:81/?token=t")
    with pytest.raises(OSError, match="it cannot listen") if fails else nullcontext():
        server.serve(session, entrance, print)
    settings = {"log_level": "warning", "timeout_graceful_shutdown": 10} | server.address.server_settings()
    assert ran == [((("guarded", session, entrance), settings), print), ["listener"]]
    assert not (session.studio / "open.html").exists()
    logger = logging.getLogger("uvicorn.error")
    assert server._is_news in logger.filters
    logger.removeFilter(server._is_news)


def test_the_page_that_leads_in_refreshes_at_once_and_tells_nobody(tmp_path):
    url = "http://127.0.0.1:81/?token=t"
    assert server.way_in(tmp_path, url) == (tmp_path / "open.html").as_uri()
    assert (tmp_path / "open.html").read_text("ascii") == (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="referrer" content="no-referrer">\n'
        f'<meta http-equiv="refresh" content="0;url={url}"><title>microrad studio</title></head>\n'
        f'<body><p><a href="{url}">Open the studio</a></p></body></html>\n'
    )


ANOTHER = "give another one with --port, or leave --port out for a free one"


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.EADDRINUSE, f"port 81 is in use, perhaps by another studio; {ANOTHER}"),
        (errno.EACCES, "port 81 is not open to this user; give one from 1024 on with --port"),
        (errno.EADDRNOTAVAIL, "'lab' port 81 cannot be listened on: why; give an address of this machine"),
    ],
)
def test_a_port_that_is_not_taken_has_its_whole_words(number, words):
    assert server._unbound("lab", 81, OSError(number, "why")) == words


def test_a_host_that_has_no_address_is_refused_with_the_reason(monkeypatch):
    def unknown(*place, **how):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(server.StudioError, match=r"'no\.such\.host' is no address of this machine: Name or"):
        server._bound("no.such.host", 8080)


# ----------------------------------------------------------------------------------------- a folder that is carried on
def test_unsaved_changes_and_the_other_mission_move_with_their_folder(tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    (before / "sub").mkdir(parents=True)
    for name in ("a.toml", "sub/b.toml"):
        (before / name).write_bytes(DEFAULT.read_bytes())
    session = Session(before, before / "a.toml")
    session.set(APERTURE, "6 cm")
    session.other = Draft.open(before / "sub" / "b.toml").set(APERTURE, "7 cm")
    before.rename(after)
    again = Session(after)
    assert (again.draft.path, again.draft.values[APERTURE].typed) == (after / "a.toml", "6 cm")
    assert (again.other.path, again.other.values[APERTURE].typed) == (after / "sub" / "b.toml", "7 cm")
    again.save()
    assert '"6 cm"' in (after / "a.toml").read_text("utf-8") and not again.draft.changed


def test_unsaved_changes_keep_their_line_ends_although_those_of_the_file_are_others_now(file):
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    text = session.draft.text
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    again = Session(file.parent)
    assert again.draft.text == text and "\r" not in text
    assert (again.draft.changed, again.disk) == (True, "changed")


@pytest.mark.parametrize("own", ["# mine\n", ""])
def test_what_git_is_to_overlook_is_left_as_somebody_has_written_it(file, own):
    Session(file.parent)
    path = file.parent / STUDIO / ".gitignore"
    assert path.read_text("utf-8") == "*\n"
    path.write_text(own, "utf-8")
    Session(file.parent)
    assert path.read_text("utf-8") == own


def test_a_mission_in_an_inner_folder_is_the_one_that_is_gone_on_with(file):
    inner = file.parent / "sub" / "leo-geo.toml"
    inner.parent.mkdir()
    inner.write_text(file.read_text("utf-8").replace('"5 cm"', '"9 cm"'), "utf-8")
    session = Session(file.parent, inner)
    session.set(APERTURE, "6 cm")
    again = Session(file.parent)
    assert (again.draft.path, again.name_of(again.draft.path)) == (inner, "sub/leo-geo.toml")
    inner.unlink()
    again.save()
    assert '"6 cm"' in inner.read_text("utf-8") and '"6 cm"' not in file.read_text("utf-8")


@pytest.mark.skipif(os.name != "posix", reason="elsewhere an address is not used again")
@pytest.mark.parametrize("refused", [None, "bind", "listen"])
def test_a_port_is_bound_and_listened_on_or_its_socket_is_closed(monkeypatch, refused):
    done = []

    class Socket:
        def __init__(self, *kind):
            done.append(kind)

        def __getattr__(self, name):
            def act(*given):
                done.append((name, *given))
                if name == refused:
                    raise OSError(errno.EACCES, "Permission denied")

            return act

    places = [(10, 1, 6, "", ("::1", 81, 0, 0)), (2, 1, 6, "", ("127.0.0.1", 81))]
    monkeypatch.setattr(server.socket, "getaddrinfo", lambda *asked, **more: done.append((asked, more)) or places)
    monkeypatch.setattr(server.socket, "socket", Socket)
    whole = [
        (("lab", 81), {"type": socket.SOCK_STREAM}),
        (10, 1, 6),
        ("setsockopt", socket.SOL_SOCKET, socket.SO_REUSEADDR, 1),
        ("bind", ("::1", 81, 0, 0)),
        ("listen",),
    ]
    if refused is None:
        assert isinstance(server._bound("lab", 81), Socket)
        assert done == whole
        return
    with pytest.raises(server.StudioError) as refusal:
        server._bound("lab", 81)
    assert str(refusal.value) == "port 81 is not open to this user; give one from 1024 on with --port"
    assert done == [*whole[: 5 if refused == "listen" else 4], ("close",)]


@pytest.mark.parametrize("letters", [100, 300])
def test_a_name_that_no_host_can_have_is_told_by_its_first_letters(letters):
    with pytest.raises(server.StudioError) as refusal:
        server._bound("a" * letters, 81)
    shown = "a" * min(letters, 120)
    assert str(refusal.value) == f"'{shown}' is no address of this machine; give one such as 192.168.1.7"


def test_a_result_in_an_inner_folder_is_saved_by_its_own_name(file):
    pytest.importorskip("starlette")
    session = Session(file.parent)
    (file.parent / "out").mkdir()
    for name in ("results.nc", "report.html", "odd.HTML", "html"):
        (file.parent / "out" / name).write_text(name, "utf-8")
    results = ("out/results.nc", "out/report.html", "out/odd.HTML", "out/html")
    written(session.jobs.folder, 3, cwd=str(file.parent), results=results)
    show = server._documents(session)
    found = [(str(each.path), each.headers["content-disposition"]) for each in (show(3, place) for place in range(4))]
    ways = ("attachment", "inline", "attachment", "attachment")
    assert found == [
        (str(file.parent / name), f'{way}; filename="{Path(name).name}"')
        for name, way in zip(results, ways, strict=True)
    ]


def test_a_file_that_cannot_be_looked_at_has_no_sign_and_any_other_one_its_own(file):
    from microrad.studio.session import _sign

    assert [_sign(path) for path in (Path("a\0b.csv"), file / "x", file.with_name("none"))] == [None] * 3
    one, other = file.with_name("one.csv"), file.with_name("other.csv")
    for path in (one, other):
        path.write_text("1\n", "utf-8")
        os.utime(path, (1e9, 1e9))
    assert _sign(one) == _sign(one) != _sign(other)
    os.link(one, file.with_name("again.csv"))
    assert _sign(file.with_name("again.csv")) == _sign(one)


def test_the_studios_folder_that_was_removed_is_private_again_for_either_note(file):
    session = Session(file.parent, file)
    for keep in (lambda: session.set(APERTURE, "6 cm"), lambda: setattr(session, "other", session.draft)):
        shutil.rmtree(session.studio)
        keep()
        assert session.studio.stat().st_mode & 0o777 == 0o700


def test_a_link_to_nowhere_in_the_place_of_what_git_is_to_overlook_is_left(file):
    (file.parent / STUDIO).mkdir()
    link = file.parent / STUDIO / ".gitignore"
    link.symlink_to("nowhere")
    Session(file.parent)
    assert link.is_symlink() and link.readlink() == Path("nowhere")


def test_a_file_that_others_change_behind_what_was_saved_is_read_anew_after_a_restart(file):
    session = Session(file.parent, file)
    session.set(APERTURE, "6 cm")
    session.save()
    file.write_text(file.read_text("utf-8").replace('leo_aperture = "6 cm"', 'leo_aperture = "8 cm"'), "utf-8")
    again = Session(file.parent)
    assert again.draft.values[APERTURE].typed == "8 cm"
    assert (again.draft.changed, again.disk) == (False, "")


def test_the_folder_of_a_session_is_where_it_began_behind_a_change_of_directory(tmp_path, monkeypatch):
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path)
    session = Session(Path("work"))
    monkeypatch.chdir(tmp_path / "work")
    assert (session.folder, session.studio) == (tmp_path / "work", tmp_path / "work" / STUDIO)
    assert session.jobs.folder.is_relative_to(tmp_path / "work" / STUDIO)
