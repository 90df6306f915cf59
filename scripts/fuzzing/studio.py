"""What the studio takes: requests at its door, names, uploads, edits of drafts, and what it finds in its folder."""

import asyncio
import contextlib
import json
import shutil
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from fuzzing import mutate, seeds
from fuzzing.run import is_refusal
from microrad.studio.draft.draft import Draft
from microrad.studio.guard import address, names, signing
from microrad.studio.guard.middleware import Guard, Limits
from microrad.studio.jobs.files import CODE, EXIT, JOB, PROGRESS, STARTED, STDERR, read_job
from microrad.studio.recordings.process import answer_to
from microrad.studio.recordings.uploads import Uploads
from microrad.studio.session import Session
from microrad.studio.views import sliders
from microrad.studio.views.mirror_form import columns, keep_form, kept_form, lever_arm_m, rate_hz

_PORT = 8123
_TOKEN = "t0ken-" + 40 * "x"
_HEADERS = ("content-length", "transfer-encoding", "sec-fetch-site", "x-forwarded-for", "Host")
_ANSWERS = (200, 303, 400, 403, 413, 421)
_NAMES = ("..", "../x", "a/../../x", "C:\\x", "con", "con.csv", ".hidden", "a.csv ", "a\0.csv", "//x", "~", "file:///x")


@dataclass(frozen=True, slots=True)
class Message:
    """Something that is no file: how it is made, and what takes it in a folder of its own."""

    name: str
    made: Callable[[Random], Any]
    taker: Callable[[Any, Path], None]
    most_s: float = 1.0
    most_bytes: int = 1_000_000_000

    def take(self, made: Any, folder: Path) -> None:
        """Hand it over.

        Args:
            made: The message.
            folder: For what is written.
        """
        place = folder / "own"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        self.taker(made, place)


def _word(draw: Random) -> str:
    return draw.choice((*mutate.WORDS, *mutate.NUMBERS, *_NAMES))


# ------------------------------------------------------------------------------------------------------------ the door
def _request(draw: Random) -> dict[str, Any]:
    """A request that is the studio's own but for some of its parts."""
    host = f"127.0.0.1:{_PORT}"
    headers = {"host": host, "origin": f"http://{host}", "cookie": f"microrad_studio_{_PORT}={_TOKEN}"}
    for _ in range(draw.choice((0, 1, 1, 2, 4))):
        name = draw.choice(
            (*headers, "content-length", "transfer-encoding", "sec-fetch-site", "x-forwarded-for", "Host")
        )
        headers[name] = draw.choice(
            (_word(draw), host, "cross-site", "12", "9" * 30, "localhost", f"evil.example:{_PORT}")
        )
        if draw.random() < 0.2:
            headers.pop(draw.choice(tuple(headers)))
    query = draw.choice(("", f"token={_TOKEN}", "token=", "token=x&token=y", f"token={_TOKEN}&a=%0d%0a", _word(draw)))
    return {
        "kind": draw.choice(("http", "http", "websocket")),
        "method": draw.choice(("GET", "GET", "POST", "HEAD", "TRACE", "")),
        "path": draw.choice(("/", "//evil.example", "/\\evil", "/results/1/0", f"/{_word(draw)}", _word(draw))),
        "query": query,
        "headers": list(headers.items()) + ([("host", host)] if draw.random() < 0.05 else []),
        "body": draw.choice((0, 10, 900, 5000, 200_000)),
    }


def _knock(made: dict[str, Any], _: Path) -> None:
    """A stranger is answered at the door, and nothing of his reaches the pages."""
    inside: list[dict[str, Any]] = []
    sent: list[dict[str, Any]] = []
    parts = [{"type": "http.request", "body": bytes(made["body"]), "more_body": False}, {"type": "http.disconnect"}]

    async def app(scope: dict[str, Any], receive: Any, send: Any) -> None:
        inside.append(scope)
        if scope["type"] == "http":
            while (await receive()).get("more_body", False):
                pass
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b""})

    async def receive() -> dict[str, Any]:
        return parts.pop(0) if parts else {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        sent.append(message)

    hosts = address.hosts(_PORT, ("127.0.0.1", "localhost"))
    guard = Guard(app, hosts, address.origins(hosts), _TOKEN, Limits(1000, 100_000))
    headers = [(key.encode("utf-8", "replace"), value.encode("utf-8", "replace")) for key, value in made["headers"]]
    scope = {"type": made["kind"], "path": made["path"], "query_string": made["query"].encode("utf-8", "replace")}
    asyncio.run(guard({**scope, "method": made["method"], "headers": headers}, receive, send))
    for status in (each["status"] for each in sent if each["type"].endswith("response.start")):
        assert status in _ANSWERS, f"status {status}"
    if inside:
        keys = [(key.lower(), value) for key, value in headers]
        asked = [value.decode("latin-1").lower() for key, value in keys if key == b"host"]
        assert len(asked) == 1 and asked[0] in hosts, "another host was let in"
        assert any(_TOKEN.encode() in value for key, value in keys if key == b"cookie"), "let in without the token"
    for each in sent:
        for _, value in each.get("headers", ()):
            assert b"\r" not in value and b"\n" not in value, "a header with a line end"


# --------------------------------------------------------------------------------------------------- names and uploads
def _name(made: str, folder: Path) -> None:
    safe = names.safe_name(made)
    path = names.within(folder, safe)
    assert path.is_relative_to(folder.resolve()), "a name leaves its folder"
    assert names.safe_name(safe) == safe, "a name that is taken is another one the next time"


def _upload(draw: Random) -> dict[str, Any]:
    sizes = [draw.choice((0, 1, 1000, 300_000)) for _ in range(draw.randrange(4))]
    name = draw.choice((_word(draw), "a.csv", f"{_word(draw)}.csv"))
    return {"name": name, "sizes": sizes, "breaks": draw.random() < 0.2}


def _save(made: dict[str, Any], folder: Path) -> None:
    uploads = Uploads(folder / "uploads")

    async def blocks() -> AsyncIterator[bytes]:
        for size in made["sizes"]:
            yield bytes(size)
        if made["breaks"]:
            raise names.NameRefusedError("the browser has gone")

    try:
        stored = asyncio.run(uploads.save(made["name"], blocks()))
    except Exception:
        assert uploads.listed() == (), "what was refused has left something"
        raise
    assert stored.size == sum(made["sizes"]) and uploads.get(stored.key) == stored, "an upload is another one"


# -------------------------------------------------------------------------------------------------------------- drafts
@cache
def _draft() -> Draft:
    return Draft.shipped("mission.toml")


@cache
def _keys() -> tuple[str, ...]:
    return tuple(_draft().values)


def _edits(draw: Random) -> list[tuple[str, str, str]]:
    """Steps of an editor: what is done, to which key, with which text."""
    steps = []
    for _ in range(draw.choice((1, 1, 2))):
        key = draw.choice(_keys()) if draw.random() < 0.8 else draw.choice((_word(draw), "mirror.x", "orbit", ""))
        how = draw.choice(("set", "set", "set", "set", "slide", "without", "text"))
        given = mutate.text(draw, seeds.missions()).decode("utf-8", "surrogateescape") if how == "text" else ""
        unit = draw.choice(mutate.UNITS) if draw.random() < 0.7 else ""
        steps.append((how, key, given or f"{_word(draw)}{unit}"))
    return steps


def _edit(made: list[tuple[str, str, str]], folder: Path) -> None:
    """Each step leaves a draft with its faults in words, or is refused; the draft before it stays whole."""
    draft, refusals = _draft(), []
    for how, key, text in made:
        try:
            draft = _step(draft, how, key, text)
        except ValueError as error:
            if not is_refusal(error):
                raise
            refusals.append(error)
    assert bool(draft.problems) == bool(draft.report), "a fault without words"
    assert set(draft.values).isdisjoint(each.key for each in draft.absent), "a key that is there is absent"
    saved = draft.save(folder / "mission.toml")
    assert Draft.open(saved.path).text == draft.text, "a draft that is saved is another one"
    if len(refusals) == len(made):
        raise refusals[0]


def _step(draft: Draft, how: str, key: str, text: str) -> Draft:
    if how == "without":
        return draft.without(key)
    if how == "text":
        return draft.with_text(text)
    if how == "slide":
        value = draft.values.get(key)
        slider = None if value is None else sliders.slider(value)
        if slider is None:
            return draft
        held = slider.holding(text)
        return draft.set(key, held.at(sum(map(ord, text[:9])) - 300))
    changed = draft.set(key, text)
    assert changed.set(key, text).text == changed.text, "the same value again changes a draft"
    return changed


# ------------------------------------------------------------------------------------------- what is found in a folder
_FORM = {
    "setting": {
        "drive": 0, "output": 1, "rate": "1 kHz", "drive_unit": "V", "output_unit": "mrad", "lever_arm": "50 mm",
        "accept": ["drift"], "static": False, "admissible": False, "name": "mirror",
    },
    "uses": {"0123456789abcdef": "check"}, "seen": "0123456789abcdef", "chosen": {"x": "1 kHz"},
}  # fmt: skip
_KEPT = {"path": "mission.toml", "disk_sha256": "0" * 64, "text": 'x = 1\n[mirror]\nfile = "a.toml"\n'}


def _json(data: Any) -> Callable[[Random], bytes]:
    return lambda draw: mutate.as_json(draw, mutate.plain(draw, data, data))


def _form(made: bytes, folder: Path) -> None:
    """A form that was kept is the same when it is kept again, or an empty one."""
    path = folder / "form.json"
    path.write_bytes(made)
    form = kept_form(path)
    keep_form(path, form)
    assert kept_form(path) == form, "a form that is kept is another one"
    rate_hz(form.setting.rate)
    lever_arm_m(form.setting)
    columns(form.setting)


def _session(made: bytes, folder: Path) -> None:
    studio = folder / ".microrad-studio"
    studio.mkdir(mode=0o700)
    for name in ("draft.json", "other.json"):
        (studio / name).write_bytes(made)
    session = Session(folder)
    assert session.draft.path.is_relative_to(folder.resolve()), "a kept draft leaves the folder"
    assert session.draft.report is not None and session.disk in ("", "changed", "gone")


def _job(draw: Random) -> dict[str, bytes]:
    said = {
        "kind": "study", "title": "a study", "arguments": ["run", "mission.toml"], "cwd": ".", "results": ["out"],
        "queued": "2026-01-01T00:00:00Z", "folder": ".",
    }  # fmt: skip
    line = {"at": 1.0, "done": 1, "total": 3, "what": "rows"}
    lines = b"\n".join(mutate.as_json(draw, mutate.plain(draw, line, line)) for _ in range(3))
    notes = {STARTED: {"at": "2026-01-01T00:00:00Z", "pid": 1}, EXIT: {"at": "2026-01-01T00:00:01Z", "code": 1}}
    made = {name: mutate.as_json(draw, mutate.plain(draw, note, note)) for name, note in notes.items()}
    made |= {JOB: mutate.as_json(draw, mutate.plain(draw, said, said)), PROGRESS: lines}
    return made | {STDERR: mutate.binary(draw, (b"microrad: no such file\n", b"Traceback\n\xff\n"))}


def _job_folder(made: dict[str, bytes], folder: Path) -> None:
    place = folder / "1"
    place.mkdir(mode=0o700)
    for name, content in made.items():
        (place / name).write_bytes(content)
    (place / CODE).write_text(signing.code(made[JOB]), encoding="ascii")
    found = read_job(place)
    assert found.progress is None or 0.0 <= found.progress.share <= 1.0, "a share of a job that is none"
    assert found.state != "unreadable" or found.words, "a job that cannot be read, without a word"


def _reading(draw: Random) -> dict[str, Any]:
    chosen = {"inputs": [0], "outputs": [1], "rate_hz": 1000.0, "accept": ["drift"]}
    return {
        "content": draw.choice((*seeds.csv(), mutate.text(draw, seeds.csv()))),
        "task": draw.choice(("channels", "view")),
        "columns": mutate.plain(draw, chosen, chosen),
    }


def _answer(made: dict[str, Any], folder: Path) -> None:
    """Any request is answered by something that JSON can say."""
    (folder / "a.csv").write_bytes(made["content"])
    limits = {"samples": 1_000_000, "channels": 100, "points": 200, "memory_bytes": 1_000_000_000}
    request = {
        "name": "a.csv",
        "folder": str(folder),
        "task": made["task"],
        "columns": made["columns"],
        "limits": limits,
    }
    with contextlib.chdir(folder):
        answer = answer_to(request)
    json.dumps(answer, allow_nan=False)


MESSAGES = (
    Message("door", _request, _knock),
    Message("names", lambda draw: _word(draw) + draw.choice(("", ".csv", _word(draw))), _name),
    Message("uploads", _upload, _save),
    Message("drafts", _edits, _edit),
    Message("forms", _json(_FORM), _form),
    Message("sessions", _json(_KEPT), _session),
    Message("jobs", _job, _job_folder),
    Message("readings", _reading, _answer),
)
"""What the studio takes that is no file of a user."""
