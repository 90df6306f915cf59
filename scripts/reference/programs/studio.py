"""What the studio's pages show and answer, without a browser."""

import asyncio
import json
import re
from collections.abc import AsyncIterator, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from microrad.studio import commands
from microrad.studio.draft.draft import Draft
from microrad.studio.draft.tables import offered, with_mirror_file, with_table
from microrad.studio.guard import address, answers, names, policy, signing
from microrad.studio.guard.middleware import Guard, Limits
from microrad.studio.jobs.queue import Progress
from microrad.studio.recordings import reading
from microrad.studio.recordings.uploads import UploadLimits, Uploads
from microrad.studio.session import Session
from microrad.studio.views import compare, control, controllers, day, link, mirror_form, pointing, runs
from reference.programs.calls import call, itself

HERE = Path().resolve()
NOW = datetime(2026, 3, 20, 12, 31, 7, tzinfo=UTC)
TYPED = {
    "terminals.leo_aperture": ("6.1 cm", "6.1", "-6 cm", "6 W", "", "1e9 km"),
    "communication.data_rate": ("largest", "0.31 Gbit/s", "fast"),
    "pointing.confidence": ("0.93", "93 %"),
    "orbit.epoch": ("2026-04-01T00:00:00Z", "tomorrow"),
    "orbit.leo.limits.in_eclipse": ("false", "no"),
    "scenario.pid_frequencies": ("2.1 Hz, 17 Hz", "17 Hz, 2.1 Hz"),
    "conventions.pointing_loss": ("gain", "none"),
    "communication.code_word": ("0.3 ms",),
    "no.such_key": ("3",),
    "name": ('a "name" of two\nlines',),
}
"""By key, what is typed for it."""


def drafts() -> None:
    """Missions as they are edited, finished and not."""
    for name in ("links.toml", "unfinished.toml", "broken.toml"):
        draft = Draft.open(name)
        call(f"{name} values", lambda of=draft: {key: _told(value) for key, value in of.values.items()})
        call(f"{name} problems", itself, draft.problems)
        call(f"{name} report", itself, draft.report)
        call(f"{name} absent", itself, [key.key for key in draft.absent])
        call(f"{name} offered", offered, draft)
    draft = Draft.open("mission.toml")
    for key, several in TYPED.items():
        for typed in several:
            call(f"{key} as {typed!r}", lambda k=key, t=typed: _edited(draft, k, t))
    for table in (*offered(draft), "beacon", "no_table"):
        call(f"with {table}", lambda t=table: _added(draft, with_table(draft, t)))
    call("with a mirror", lambda: _added(draft, with_mirror_file(draft, Path("mirrors/own.toml"))))


def _told(value: Any) -> list[str]:
    about = value.about
    kind = [] if about is None else [about.kind, about.unit, about.wanted, str(about.required), *about.choices]
    return [value.typed, value.source, *kind, *(fault.reason for fault in value.problems)]


def _edited(draft: Draft, key: str, typed: str) -> list[str]:
    return _added(draft, draft.set(key, typed))


def _added(draft: Draft, changed: Draft) -> list[str]:
    known = set(draft.text.splitlines())
    return [*(line for line in changed.text.splitlines() if line not in known), *map(str, changed.report.splitlines())]


def views() -> None:
    """Links, pointing, the day, controllers and sliders of missions."""
    for name in ("mission.toml", "links.toml"):
        draft = Draft.open(name)
        file = draft.link()
        seen = link.view(file)
        call(f"{name} margins", itself, seen.margins)
        call(f"{name} map", itself, {"frame": seen.frame, "margin": seen.margin_db, "contours": seen.contours})
        call(f"{name} map_words", link.map_words, seen)
        call(f"{name} map_plot", link.map_plot, seen)
        errors = pointing.view(file)
        call(f"{name} lines_plot", pointing.lines_plot, errors)
        call(f"{name} coverage_plot", pointing.coverage_plot, errors)
        call(f"{name} pointing blocks", pointing.blocks, errors)
        for group, several in (link.sliders(draft) | pointing.sliders(draft)).items():
            for slider in several:
                call(f"{name} {group}", _slid, slider)
        call(f"{name} missing", day.missing, file)
    file = Draft.open("mission.toml").file()
    made = {name: controllers.controller(file, name) for name in ("PI", controllers.PID, controllers.PID_INVERSE)}
    call("controllers", controllers.names, file.mission.fine_pointing)
    call("blocks", controllers.blocks, made | {"LQG": "is being tuned"})
    for name, own in made.items():
        call(f"{name} notes", control.notes, own)
        call(f"{name} sensitivity_plot", control.sensitivity_plot, own)
        call(f"{name} gain_plot", control.gain_plot, own)
        wanted = control.ask_of("31 urad", "17 urad", "23 Hz", own.rate_hz)
        answer = own.ask(wanted, (control.WITH, control.WITHOUT))
        call(f"{name} step", control.answer_words, answer.step, "Step", 1e-6)
        call(f"{name} sine", control.answer_words, answer.sine, "Sine")
        call(f"{name} jitter", control.answer_words, answer.jitter, "Jitter")
        for plot in (control.step_plot, control.sine_plot, control.jitter_plot, control.motion_plot):
            call(f"{name} {plot.__name__}", plot, answer)
        call(f"{name} drive_plot", control.drive_plot, own, answer.step)
    for typed in (("1 W", "1 urad", "3 Hz"), ("2 urad", "1 rad", "3 Hz"), ("2 urad", "1 urad", "2600 Hz")):
        call(f"ask {typed}", control.ask_of, *typed, 5e3)


def _slid(slider: Any) -> list[Any]:
    places = (0, slider.steps // 3, slider.position, slider.steps) if slider.scale != "none" else ()
    return [slider.key, slider.label, slider.typed, slider.unit, slider.scale, *map(slider.at, places)]


def jobs() -> None:
    """The folder, what runs in it, and what a page offers to copy."""
    session = Session(HERE, HERE / "mission.toml")
    call("missions", lambda: [path.name for path in session.missions()])
    call("campaign_files", runs.campaign_files, session)
    call("ledgers", runs.ledgers, session)
    call("write_campaign", lambda: runs.write_campaign(session).read_text().splitlines()[:9])
    call("free_name", runs.free_name, session, "campaign", ".toml")
    for number, (told, began, ended) in enumerate(JOBS, 1):
        _job(session, number, told, began, ended)
    listed = session.jobs.listed()
    for job in listed:
        call(f"job {job.number}", lambda own=job: [own.state, own.kind, own.title, own.code, own.words, own.finished])
        call("words", lambda own=job: [runs.state_words(own), runs.time_words(own, lambda: NOW)])
        call("progress", runs.progress_words, job.progress)
        call("ledger", runs.ledger_of, job)
        call("others", lambda own=job: [getattr(runs.others(listed, own), name) for name in ("newest", "latest")])
    for number in (0, 2, 99):
        call(f"cancel {number}", session.jobs.cancel, number)
    call("remove", session.jobs.remove, 99)
    for progress in (Progress(3, 70, "rows", 1.7), Progress(1, 2000, "tune LQG", None), Progress(5, 0, "links", None)):
        call("progress", runs.progress_words, progress)
    file = Path("my mission.toml")
    for action in (
        commands.budget(file),
        commands.contacts(file),
        commands.design(file),
        commands.study(file, Path("a study")),
        commands.campaign(file, Path("-x.ledger")),
        commands.resume(Path("x.ledger")),
        commands.campaign_report(Path("x.ledger"), Path("x.html")),
    ):
        call("action", itself, action)
    there = Draft.open("links.toml")
    call("compare", compare.blocks, session, session.draft, there, ("this one", "the other"))
    call("compare itself", compare.blocks, session, there, there, ("one", "same"))
    call("compare broken", compare.blocks, session, Draft.open("broken.toml"), there, ("one", "other"))
    session.set("terminals.leo_aperture", "7.3 cm")
    call("revision", lambda: [session.revision, session.opened, session.draft.changed, session.disk, session.faults()])
    call("differences", compare.differences, session.draft, Draft.open("mission.toml"))
    (HERE / "mission.toml").write_text("name = 3\n")
    call("changed on disk", session.disk_words)
    (HERE / "mission.toml").unlink()
    call("gone from disk", session.disk_words)
    call("save", session.save, "../x.toml")
    call("inside", session.inside, "/etc/passwd")


JOBS = (
    ({"kind": "study", "title": "Study", "results": ["study"]}, {"at": "2026-03-20T12:00:00+00:00"}, {"code": 0}),
    ({"kind": "study", "title": "Study", "results": ["study"]}, {"at": "2026-03-20T12:01:00+00:00"}, {"code": 1}),
    ({"kind": "campaign", "results": ["x.ledger"]}, {"at": "2026-03-20T12:02:00+00:00"}, {"code": 1}),
    ({"kind": "campaign", "results": ["x.ledger"]}, {"at": "2026-03-20T12:03:00+00:00"}, {"code": 2}),
    ({"kind": "identification", "results": ["m.toml"]}, {"at": "2026-03-20T12:04:00+00:00"}, {"code": -9}),
    ({"kind": "export", "results": ["x.html"]}, {"at": "2026-03-20T12:05:00+00:00"}, {"code": 70}),
    ({"kind": "strange"}, {"at": "2026-03-20T12:06:00+00:00"}, {"code": 0}),
)
"""Of jobs that are over: what is told of them beside the rest, what began and what ended."""


def _job(session: Session, number: int, told: dict[str, Any], began: dict[str, Any], ended: dict[str, Any]) -> None:
    folder = session.jobs.folder / str(number)
    folder.mkdir()
    plain = {"kind": "study", "title": "T", "arguments": ["run", "x.toml"], "cwd": str(HERE), "results": []}
    text = json.dumps(plain | {"queued": "2026-03-20T11:59:00+00:00", "folder": str(session.jobs.folder)} | told)
    (folder / "job.json").write_text(text)
    (folder / "job.code").write_text(signing.code(text.encode()))
    (folder / "started.json").write_text(json.dumps(began | {"pid": 1}))
    (folder / "exit.json").write_text(json.dumps({"at": "2026-03-20T12:09:11+00:00"} | ended))
    notes = [{"at": 7.0 * i, "done": 11 * i, "total": 90, "what": "rows"} for i in range(1, 4)]
    (folder / "progress").write_text("".join(json.dumps(note) + "\n" for note in notes))
    (folder / "stderr").write_text("microrad: it did not work\n")


def recordings() -> None:
    """Files that are dropped, what is read of them, and what the form makes of that."""
    uploads = Uploads(HERE / "uploads", UploadLimits(file_bytes=400_000, files=3, total_bytes=500_000))
    kept = []
    for name, content in (
        ("run 7.csv", (HERE / "loop.csv").read_bytes()),
        ("bare.csv", (HERE / "bare.csv").read_bytes()),
        ("../x.csv", b"1"),
        ("large.csv", b"x" * 400_001),
        ("much.csv", b"x" * 390_000),
        ("one.csv", b"1,2\n"),
        ("another.csv", b"1,2\n"),
    ):
        found = call(f"upload {name}", lambda n=name, c=content: _stored(uploads, n, c))
        kept += [found] if found else []
    call("listed", lambda: [(each.name, each.size) for each in uploads.listed()])
    call("get", uploads.get, "0" * 16)
    form, dropped = mirror_form.Form(), []
    for upload in uploads.listed():
        listing = call(f"{upload.name} channels", reading.list_channels, upload.path)
        if listing is None:
            continue
        setting = call(f"{upload.name} first_setting", mirror_form.first_setting, listing, upload.name)
        call(f"{upload.name} labels", mirror_form.labels, listing)
        form = mirror_form.shown(form, listing, upload.name, upload.name)
        dropped.append(mirror_form.Dropped(upload.key, upload.name, upload.path, listing=listing))
        call(f"{upload.name} view", reading.view, upload.path, mirror_form.columns(setting))
    call("form", lambda: [form.setting, form.chosen])
    columns = mirror_form.Setting(drive=1, output=2, rate="9.7 kHz", name="stage x")
    for change in ({}, {"output": 1}, {"drive": None}, {"rate": "fast"}, {"output_unit": "um"}, {"name": "../x"}):
        setting = mirror_form.Setting(**{**{name: getattr(columns, name) for name in SETTING}, **change})
        call(f"columns {change}", mirror_form.columns, setting)
        call(f"lever_arm_m {change}", mirror_form.lever_arm_m, setting)
        call(f"identification {change}", lambda s=setting: mirror_form.identification(HERE, dropped[1:], s).title)


SETTING = "drive", "output", "rate", "drive_unit", "output_unit", "name"


def _stored(uploads: Uploads, name: str, content: bytes) -> tuple[str, int]:
    async def blocks() -> AsyncIterator[bytes]:
        yield content[: len(content) // 2]
        yield content[len(content) // 2 :]

    found = asyncio.run(uploads.save(name, blocks()))
    return found.name, found.size


def guard() -> None:
    """Who is let in, and what is answered to others."""
    port, token = 8123, "t0ken-" + 40 * "x"
    host, page = f"127.0.0.1:{port}", f"http://127.0.0.1:{port}"
    own = address.hosts(port, ("127.0.0.1", "localhost"))
    call("hosts", itself, own)
    call("origins", address.origins, own)
    call("entrance", address.entrance, host, "TOKEN")
    call("cookie_name", address.cookie_name, host)
    call("page_policy", policy.page_policy, host, "NONCE")
    call("document_policy", policy.document_policy)
    call("refusal_policy", policy.refusal_policy)
    call("locked", answers.locked, "No token.")
    call("too_large", answers.too_large, 3_100_000)
    for name in (
        "run 7.csv",
        "..",
        "a/b.csv",
        "",
        "x\n.csv",
        ".bashrc",
        "x.csv ",
        "CON",
        "nul.csv",
        "x" * 300,
        "u\u0308",
    ):
        call(f"safe_name {name[:20]!r}", names.safe_name, name)
    door = Guard(_inner, own, address.origins(own), token, Limits(message_bytes=1000, upload_bytes=5000))
    cookie = f"{address.cookie_name(host)}={token}"
    for method, path, headers in (
        ("GET", "/", {"host": host, "cookie": cookie}),
        ("GET", "/", {"host": host}),
        ("GET", "/", {"host": host, "cookie": cookie[:-1]}),
        ("GET", f"/?token={token}", {"host": host}),
        ("GET", "/?token=wrong", {"host": host}),
        ("GET", "/", {"host": "evil.example", "cookie": cookie}),
        ("GET", "/", {"cookie": cookie}),
        ("POST", "/", {"host": host, "cookie": cookie, "origin": page}),
        ("POST", "/", {"host": host, "cookie": cookie, "origin": "http://evil.example"}),
        ("POST", "/", {"host": host, "cookie": cookie}),
        ("POST", "/", {"host": host, "cookie": cookie, "origin": page, "content-length": "5001"}),
        ("GET", "/x\x00", {"host": host, "cookie": cookie}),
        ("TRACE", "/", {"host": host, "cookie": cookie}),
    ):
        shown = {key: value.replace(token, "TOKEN") for key, value in headers.items()}
        print(f"{method} {path.replace(token, 'TOKEN')!r} {shown}")
        for line in _exchange(door, method, path, headers):
            print(line.replace(token, "TOKEN"))


async def _inner(scope: Any, receive: Any, send: Any) -> None:
    await receive()
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"inside"})


def _exchange(door: Guard, method: str, path: str, headers: dict[str, str]) -> Iterator[str]:
    sent: list[dict[str, Any]] = []
    path, _, query = path.partition("?")
    scope = {"type": "http", "method": method, "path": path, "query_string": query.encode(), "extensions": {}}
    scope["headers"] = [(key.encode(), value.encode()) for key, value in headers.items()]

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    asyncio.run(door(scope, receive, send))
    for message in sent:
        body = re.sub(r"(?s).*<main>|</main>.*", "", message.get("body", b"").decode())
        yield f"  {message.get('status', '')} {body}"
        for key, value in message.get("headers", ()):
            yield f"  {key.decode()}: {re.sub('nonce-[^ ]*', 'NONCE', value.decode())}"


if __name__ == "__main__":
    drafts()
    views()
    recordings()
    guard()
    jobs()
