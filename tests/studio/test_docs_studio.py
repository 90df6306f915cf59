"""docs/studio.md: the files, limits, pages and places of the page are those of the program."""

import json
import os
import re
import secrets
import signal
import sys
import webbrowser
from email.message import Message
from http.cookiejar import CookieJar
from pathlib import Path
from types import SimpleNamespace
from urllib.request import Request

import pytest

from microrad.campaign import run
from microrad.cli import studio as command
from microrad.mission import toml
from microrad.mission.file import load_mission
from microrad.studio import commands as studio_commands
from microrad.studio import server
from microrad.studio.draft.draft import Draft
from microrad.studio.guard import address, signing
from microrad.studio.guard.middleware import Limits
from microrad.studio.jobs import files as jobs_files
from microrad.studio.jobs import process as jobs_process
from microrad.studio.jobs import queue
from microrad.studio.jobs.queue import JobError
from microrad.studio.recordings import reading
from microrad.studio.recordings.reading import ReadingLimits
from microrad.studio.recordings.uploads import UploadLimits, Uploads
from microrad.studio.session import Session
from microrad.studio.views import mirror_form
from microrad.studio.views.mirror_form import Form
from places import ROOT
from shipped import SHIPPED
from studio.test_studio_guard import COOKIE, PORT, TOKEN, Inner, ask, guard
from studio_jobs import written
from waiting import until

PAGE = (ROOT / "docs" / "studio.md").read_text(encoding="utf-8")
SAID = " ".join(PAGE.split())
PAGES = Path(server.__file__).parent / "pages"


def rows(heading):
    """The rows of a table of the page, without its heading."""
    (table,) = (each for each in PAGE.split("\n\n") if each.startswith(heading))
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[2:]]


@pytest.mark.promise("studio-8")
def test_the_files_of_the_table_are_those_that_the_studio_keeps(session):
    session.set("terminals.leo_aperture", "6 cm")
    session.other = Draft.shipped("other.toml")
    mirror_form.keep_form(session.studio / "mirror-form.json", Form())
    Uploads(session.studio / "uploads")
    server.way_in(session.studio, "http://127.0.0.1:1/?token=x")
    with server.alone(session.studio):
        found = {path.name for path in session.studio.iterdir()}
    named = {name for row in rows("| in `.microrad-studio` |") for name in re.findall(r"`([^`]+)`", row[0])}
    assert {name.removesuffix("/") for name in named} == found - {".gitignore"}
    kept = json.loads((session.studio / "draft.json").read_text("utf-8"))["text"]
    assert '"6 cm"' in kept and '"6 cm"' not in session.draft.path.read_text("utf-8")
    assert json.loads((session.studio / "other.json").read_text("utf-8"))["text"] == session.other.text


@pytest.mark.promise("studio-12")
def test_the_pages_of_the_table_are_there_with_their_commands():
    wanted = {row[0]: set(re.findall(r"`microrad (\w+)`", row[2])) for row in rows("| page |")}
    texts = {name: (PAGES / f"{name}.py").read_text("utf-8") for name in server.PAGES}
    texts["mirror"] += (PAGES.parent / "views" / "mirror_form.py").read_text("utf-8")
    typed = {"study": "run", "resume": "campaign", "order": None, "Action": None}
    found = {}
    for text in texts.values():
        made = {typed.get(each, each) for each in re.findall(r"(?:\bcommands\.|return )(\w+)\(", text)}
        found[re.search(r'TITLE = "(\w+)"', text)[1]] = {each for each in made if each} - {"campaign_report"}
    assert found.keys() == wanted.keys()
    for title, commands in wanted.items():
        assert commands and commands <= found[title], title


@pytest.mark.promise("studio-20", "studio-21")
def test_the_limits_of_the_table_are_those_of_the_program():
    table = dict(rows("| what | at most |"))
    uploads, limits = UploadLimits(), ReadingLimits()
    assert table["a recording"].startswith(f"{uploads.file_bytes / 1e6:.0f} MB: ")
    assert table["recordings in the folder"] == f"{uploads.files}, and {uploads.total_bytes / 1e9:.0f} GB together"
    assert table["any other message to the server"] == f"{address.MESSAGE_BYTES / 1e6:.0f} MB"
    assert (Limits().message_bytes, Limits().upload_bytes) == (address.MESSAGE_BYTES, uploads.file_bytes)
    assert table["reading one: time, computing, memory"] == (
        f"{limits.wall_s:.0f} s, {limits.cpu_s} s, {limits.memory_bytes / 1e9:.0f} GB of address space"
    )
    assert table["reading one: samples of a channel"] == f"{limits.samples / 1e6:.0f} million"
    assert reading._TURNS._initial_value == 2 and "under these limits, two at a time" in SAID


@pytest.mark.promise("studio-20")
def test_the_limits_of_what_is_on_its_way_or_pasted_are_those_of_the_pages():
    pytest.importorskip("nicegui")
    from microrad.studio.pages import drop, mission

    table = dict(rows("| what | at most |"))
    on_the_way = table["recordings on their way at a time, and time for each"]
    assert on_the_way == f"{drop._TURNS._value} (others wait unread), {drop._MOST_S / 60.0:.0f} min"
    assert table["text pasted or dropped into the editor"] == f"{mission._MOST_PASTED:,} characters".replace(",", " ")


@pytest.mark.promise("studio-17")
def test_a_cancelled_command_has_30_seconds_behind_each_signal():
    assert jobs_process.WAITS_S == (30.0, 30.0)
    assert "gets SIGTERM 30 s later, and SIGKILL 30 s behind that" in SAID


@pytest.mark.promise("studio-7")
def test_a_file_of_more_than_a_megabyte_is_no_mission_and_a_folder_has_to_take_files(session, monkeypatch):
    large = session.folder / "large.toml"
    large.write_text(SHIPPED.read_text("utf-8").ljust(1_000_000, "#"), "utf-8")
    content = large.read_bytes()
    large.write_bytes(content[: toml.MAX_BYTES])
    assert toml.MAX_BYTES == 1_000_000 and Session(session.folder, large).draft.path == large
    large.write_bytes(content[: toml.MAX_BYTES].ljust(toml.MAX_BYTES + 1, b"#"))
    with pytest.raises(ValueError, match=r"large\.toml"):
        Session(session.folder, large)

    def refuse(folder):
        raise JobError(f"{folder} cannot be made")

    monkeypatch.setattr(queue, "_make_private", refuse)
    with pytest.raises(JobError, match="cannot be made"):
        Session(session.folder)


@pytest.mark.promise("studio-22")
def test_the_token_is_compared_in_constant_time(monkeypatch):
    compared, real = [], secrets.compare_digest
    monkeypatch.setattr(secrets, "compare_digest", lambda a, b: compared.append((a, b)) or real(a, b))
    assert ask(guard(Inner()), cookie=COOKIE).status == 200
    assert ask(guard(Inner()), cookie=f"{COOKIE}x").status == 403
    assert compared == [(TOKEN.encode(), TOKEN.encode()), (f"{TOKEN}x".encode(), TOKEN.encode())]
    assert len(secrets.token_urlsafe(32)) == len(address.new_token())  # 256 bits


@pytest.mark.promise("studio-23")
@pytest.mark.parametrize(
    ("system", "place"),
    [
        ("linux", "home/.local/state/microrad/studio-key"),
        ("darwin", "home/Library/Application Support/microrad/studio-key"),
        ("win32", "local/microrad/studio-key"),
    ],
)
def test_the_key_lies_where_the_page_says(tmp_path, monkeypatch, system, place):
    monkeypatch.setattr(Path, "home", classmethod(lambda kind: tmp_path / "home"))
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(signing, "Path", type(tmp_path))  # of this system, whatever os.name says
    monkeypatch.setattr(signing.os, "name", "nt" if system == "win32" else "posix")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    monkeypatch.setenv("XDG_STATE_HOME", "")
    found = signing.key_file()
    monkeypatch.undo()
    assert found == tmp_path / place


@pytest.mark.promise("studio-24", "studio-2")
@pytest.mark.parametrize("exposed", [None, "192.168.1.7"])
def test_a_studio_that_is_open_to_the_network_says_so(exposed, capsys):
    name = f"{exposed or '127.0.0.1'}:8123"
    entrance = server.Entrance(None, (name,), "secret")
    command._ready(None, entrance, exposed, False)
    out, err = capsys.readouterr()
    assert out == f"http://{name}/?token=secret\n"
    assert ("open to the network on 192.168.1.7, and not encrypted" in err) == (exposed is not None)


@pytest.mark.promise("studio-26")
def test_a_mission_may_name_a_file_outside_of_the_folder(session, tmp_path_factory):
    text, elsewhere = SHIPPED.read_text("utf-8"), tmp_path_factory.mktemp("elsewhere") / "lab.toml"
    start, end = text.index("[mirror]"), text.index("[amplifier]")
    elsewhere.write_text(text[start:end].replace("[mirror]\n", "").replace("[mirror.", "["), "utf-8")
    named = f"{text[:start]}[mirror]\nfile = {json.dumps(str(elsewhere))}\n\n{text[end:]}"
    session.change(session.draft.with_text(named))
    session.save()
    assert session.faults() == ""
    assert session.mission().mission == load_mission(session.draft.path).mission == load_mission(SHIPPED).mission


@pytest.mark.promise("studio-32")
def test_a_job_of_a_campaign_takes_all_cores(monkeypatch):
    for action in (
        studio_commands.campaign(Path("c.toml"), Path("c.ledger")),
        studio_commands.resume(Path("c.ledger")),
    ):
        assert not {"--threads", "--workers", "--scheduler"} & set(action.arguments)
    taken = []
    monkeypatch.setattr(run, "LocalEngine", lambda spec, target, processes, late_s: taken.append(processes))
    monkeypatch.setattr(run.os, "cpu_count", lambda: 7)
    run.Means().engine("spec", 1.0)
    assert taken == [7]


@pytest.mark.promise("studio-33")
def test_connections_are_neither_counted_nor_ended_for_their_silence():
    uvicorn = pytest.importorskip("uvicorn")
    config = uvicorn.Config(None, **address.server_settings())
    assert config.limit_concurrency is None
    assert not any("header" in name and "timeout" in name for name in vars(config))  # a head may take for ever


@pytest.mark.promise("studio-35")
def test_browsers_show_the_token_to_every_port_of_the_address_and_to_no_other_name():
    """The jar of the standard library keeps cookies as browsers do: by name and path, ports left out."""
    reply = ask(guard(Inner()), query=f"token={TOKEN}", cookie=None)
    answer, jar = Message(), CookieJar()
    answer["Set-Cookie"] = reply.headers[b"set-cookie"].decode()
    jar.extract_cookies(SimpleNamespace(info=lambda: answer), Request(f"http://127.0.0.1:{PORT}/"))

    def shown(url):
        jar.add_cookie_header(asked := Request(url))
        return asked.get_header("Cookie")

    assert shown(f"http://127.0.0.1:{PORT}/") == COOKIE
    assert shown("http://127.0.0.1:9999/of/somebody/else") == COOKIE
    assert shown(f"http://localhost:{PORT}/") is None
    assert b"clear-site-data" not in reply.headers  # a service worker of another server there stays


@pytest.mark.promise("studio-28")
def test_a_job_of_yours_whose_notes_are_taken_away_waits_again(session):
    folder = written(session.jobs.folder, cwd=str(session.folder))
    for name in ("started.json", "exit.json"):
        (folder / name).write_text('{"at": "", "code": 0}', "utf-8")
    assert jobs_files.read_job(folder).state == "done"
    for name in ("started.json", "exit.json"):
        (folder / name).unlink()
    assert jobs_files.read_job(folder).state == "queued"
    program = (sys.executable, "-c", "print('once more')")
    jobs_process.run_job(folder, program)
    assert jobs_files.read_job(folder).state == "done"
    assert jobs_files.output(folder, "stdout") == "once more\n"
    jobs_process.run_job(folder, program)  # with its notes it stays
    assert jobs_files.output(folder, "stdout") == "once more\n"


@pytest.mark.promise("studio-31")
def test_scripts_of_its_own_pages_may_use_eval_and_those_of_a_refusal_may_not():
    policies = [
        ask(guard(Inner()), cookie=cookie).headers[b"content-security-policy"].decode() for cookie in (COOKIE, None)
    ]
    assert ["'unsafe-eval'" in each for each in policies] == [True, False]


@pytest.mark.promise("releasing-9")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process to be killed in the midst")
def test_a_kill_while_the_key_has_two_names_leaves_the_second_one_once(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    real = os.link

    def killed(draft, path):
        real(draft, path)
        os.kill(os.getpid(), signal.SIGKILL)

    if (child := os.fork()) == 0:
        os.link = killed
        signing.code(b"job")
        os._exit(0)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    names = sorted(path.name for path in (tmp_path / "microrad").iterdir())
    assert len(names) == 2 and "studio-key" in names
    assert signing.is_ours(b"job", signing.code(b"job"))
    assert sorted(path.name for path in (tmp_path / "microrad").iterdir()) == names


def test_the_browser_is_opened_where_the_studio_is_open_to_the_network_too(monkeypatch, capsys):
    opened = []
    monkeypatch.setattr(server, "way_in", lambda of, url: f"page of {of} at {url}")
    monkeypatch.setattr(webbrowser, "open", opened.append)
    command._ready(SimpleNamespace(studio="it"), server.Entrance(None, ("192.168.1.7:81",), "s"), "192.168.1.7", True)
    until(lambda: opened, "the browser")
    assert opened == ["page of it at http://192.168.1.7:81/?token=s"]
    assert "open to the network on 192.168.1.7" in capsys.readouterr().err
