"""The studio as a server: the pages behind the guard, on a socket of this machine, until it is told to end."""

from __future__ import annotations

import errno
import json
import logging
import os
import secrets
import signal
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module, util
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from microrad.core.folder import whole_file
from microrad.core.installing import advice
from microrad.studio.guard import address, plain_files, policy
from microrad.studio.guard.middleware import Guard
from microrad.studio.guard.names import NameRefusedError, within
from microrad.studio.jobs.files import held, note
from microrad.studio.jobs.queue import JobError
from microrad.studio.recordings.uploads import Uploads
from microrad.studio.session import Session

# NiceGUI and what it stands on take a second to load, and are not there in an installation without the studio.
if TYPE_CHECKING:
    import uvicorn
    from starlette.responses import Response


PAGES = ("mission", "link", "pointing", "day", "mirror", "control", "runs", "compare")
"""Modules of `microrad.studio.pages`, in the order of the navigation."""
DOCUMENTS = "/results/"
"""Where finished documents are served, each in a sandbox: a job's number, then the place among its results."""

_GRACE_S = 10  # for open pages to be closed, as a machine that is busy takes
_RETURN_S = 60.0
"""For a browser to come back to its page; it may be silent for 0.4 of that, as where it draws on a busy machine."""

_SHOWN = 120
_ANY = ("0.0.0.0", "::", "::ffff:0.0.0.0", "[::]", "*", "")

_LOCK, _OPEN = "open.lock", "open.json"
_WAY_IN = "open.html"
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0;url={url}"><title>microrad studio</title></head>
<body><p><a href="{url}">Open the studio</a></p></body></html>
"""


class StudioError(ValueError):
    """The studio cannot be started; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class Entrance:
    """Where the studio listens: `bind` the address of this machine, `names` those that a browser may ask for."""

    listener: socket.socket
    names: tuple[str, ...]
    token: str

    @property
    def url(self) -> str:
        """The address to open, with the token."""
        return address.entrance(self.names[0], self.token)


def check_installed() -> None:
    """Raise `StudioError` where the studio's libraries are missing."""
    missing = [name for name in ("nicegui", "uvicorn") if util.find_spec(name) is None]
    if missing:
        raise StudioError(
            f"the studio needs {' and '.join(missing)}, which this installation does not have; install it "
            f"{advice('studio')}"
        )


def listen(port: int = 0, exposed: str | None = None) -> Entrance:
    """Take the port (0: any free one) on 127.0.0.1, or on the address `exposed` of this machine in the network.

    Raises `StudioError` where the port is taken or the address is not this machine's, `ExposureError` for a bad name.

    Args:
        port: 0 for any free one.
        exposed: address or name of this machine in the network; None for 127.0.0.1 alone.
    """
    host = "127.0.0.1" if exposed is None else _as_browsers_write(exposed)
    if host in _ANY:
        raise StudioError(
            f"'{exposed}' is no address that a browser could open; give this machine's own address or name in the "
            "network, such as 192.168.1.7"
        )
    listener = _bound("127.0.0.1" if host == "localhost" else host, port)
    given = listener.getsockname()[1]
    own = () if exposed is None else (f"[{host}]" if ":" in host else host,)
    names = address.hosts(given, own) if own else address.hosts(given)
    return Entrance(listener, names, address.new_token())


def _as_browsers_write(host: str) -> str:
    """An address in the form that browsers send, 10.0.0.7 for "10.7"; a name stays as it is, and is not looked up."""
    try:
        return str(socket.getaddrinfo(host, None, flags=socket.AI_NUMERICHOST)[0][4][0])
    except (OSError, ValueError):
        return host


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except UnicodeError:  # what no name can be
        raise StudioError(f"'{host[:_SHOWN]}' is no address of this machine; give one such as 192.168.1.7") from None
    except OSError as error:
        raise StudioError(f"'{host}' is no address of this machine: {error.strerror}") from error
    try:
        if os.name == "posix":  # elsewhere it would let another program take the port as well
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(place)
        listener.listen()  # a second one that takes the same port is refused from here on
    except OSError as error:
        listener.close()
        raise StudioError(_unbound(host, port, error)) from error
    return listener


def _unbound(host: str, port: int, error: OSError) -> str:
    """Why a port could not be taken, and what to do."""
    if error.errno == errno.EADDRINUSE:
        why = "is in use, perhaps by another studio; give another one with --port, or leave --port out for a free one"
        return f"port {port} {why}"
    if error.errno == errno.EACCES:
        return f"port {port} is not open to this user; give one from 1024 on with --port"
    return f"'{host}' port {port} cannot be listened on: {error.strerror}; give an address of this machine"


@contextmanager
def alone(studio: Path) -> Iterator[None]:
    """Be the only studio of a working folder, whose own folder is `studio`: a second one would not see what is changed
    in the first, and write over it.

    Raises `StudioError` where there is one, and `JobError` where that cannot be told.
    """
    with held(studio / _LOCK, 0.0) as mine:
        if not mine:
            raise StudioError(
                f"{studio.parent} is open in another studio{_process(studio / _OPEN)}; go on in that one, or end it "
                "with Ctrl-C first: two would not see, and overwrite, each other's unsaved changes"
            )
        note(studio / _OPEN, pid=os.getpid())
        yield


def _process(path: Path) -> str:
    """The process of the studio that has left a note, in words; nothing where the note cannot be read."""
    with suppress(OSError, ValueError, OverflowError, LookupError, TypeError, RecursionError):
        return f", process {int(json.loads(plain_files.content(path))['pid'])}"
    return ""


def serve(session: Session, entrance: Entrance, on_ready: Callable[[], None]) -> None:
    """Serve the pages until Ctrl-C or a request to terminate.

    Jobs go on. One process serves one studio: NiceGUI keeps its state in its modules.

    Args:
        session: the session of all tabs.
        entrance: where the studio listens.
        on_ready: called when a browser may come.
    """
    import uvicorn

    guarded = application(session, entrance)
    settings = address.server_settings()
    config = uvicorn.Config(guarded, log_level="warning", timeout_graceful_shutdown=_GRACE_S, **settings)
    logging.getLogger("uvicorn.error").addFilter(_is_news)
    try:
        _server(config, on_ready).run(sockets=[entrance.listener])
    finally:
        (session.studio / _WAY_IN).unlink(missing_ok=True)


def _is_news(record: logging.LogRecord) -> bool:
    """Whether a message is one for the terminal: a WebSocket that was refused is none, and any site can try one."""
    return "without completing handshake" not in record.getMessage()


def _server(config: uvicorn.Config, on_ready: Callable[[], None]) -> uvicorn.Server:
    """The server, which calls `on_ready` when it listens and which a second Ctrl-C does not hurry, a third one does."""
    import uvicorn

    class Server(uvicorn.Server):
        asked = 0

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            self.asked += 1
            if self.asked != 2:  # of an impatient user, who would get a traceback for two seconds
                super().handle_exit(sig, frame)

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            _end_with_terminal(self.handle_exit)
            on_ready()

    return Server(config)


def _end_with_terminal(end: Callable[[int, FrameType | None], None]) -> None:
    """Have a terminal that is closed end the server as Ctrl-C does: uvicorn hears that and SIGTERM alone."""
    number = getattr(signal, "SIGHUP", None)
    if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as behind nohup
        signal.signal(number, end)


def way_in(studio: Path, url: str) -> str:
    """The address of a page in the studio's own folder that leads to `url`, until `serve` ends. Raises OSError.

    A browser has what it is to open on its command line, where every user of the machine can read it: the token must
    not stand there. The page is its owner's alone.

    Args:
        studio: the studio's own folder.
        url: the address with the token.
    """
    path = studio / _WAY_IN
    with whole_file(path) as draft:
        plain_files.write_new(draft, _PAGE.format(url=url).encode("ascii"))
    return path.as_uri()


def application(session: Session, entrance: Entrance) -> Guard:
    """The pages of a session behind the guard.

    Args:
        session: the session of all tabs.
        entrance: where the studio listens.
    """
    # Read when NiceGUI is loaded: nobody can have put a file there, and the studio keeps nothing in it.
    os.environ["NICEGUI_STORAGE_PATH"] = str(Path(tempfile.gettempdir()) / f"microrad-{secrets.token_hex(16)}")
    from fastapi import FastAPI
    from nicegui import ui
    from nicegui.client import templates

    Uploads(session.studio / "uploads").hold_temporary_files()
    policy.sign_template(templates.env)
    inner = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    inner.add_api_route(DOCUMENTS + "{number}/{place}", _documents(session), methods=["GET"])
    _add_pages(session)
    ui.run_with(
        inner,
        title="microrad studio",
        language="en-US",
        show_welcome_message=False,
        gzip_middleware_factory=None,
        reconnect_timeout=_RETURN_S,
    )
    return Guard(inner, entrance.names, address.origins(entrance.names), entrance.token, documents=(DOCUMENTS,))


def _add_pages(session: Session) -> None:
    """Register every page, each within the common frame."""
    from nicegui import ui

    modules = [import_module(f"microrad.studio.pages.{name}") for name in PAGES]
    entries = tuple((module.TITLE, module.PATH) for module in modules)
    for module in modules:
        ui.page(module.PATH, title=f"{module.TITLE} - microrad studio")(_framed(session, module, entries))


def _framed(session: Session, module: Any, entries: tuple[tuple[str, str], ...]) -> Callable[[], None]:
    from microrad.studio.pages import layout

    def build() -> None:
        with layout.frame(session, module.TITLE, entries):
            module.page(session)

    return build


def _documents(session: Session) -> Callable[[int, int], Response]:
    """A handler that shows what a job has written: a page of its own as such, anything else to be saved."""
    from starlette.responses import FileResponse, PlainTextResponse

    def show(number: int, place: int) -> Any:
        path = result(session, number, place)
        if path is None:
            return PlainTextResponse("This result is not there any more.", 404)
        page = path.suffix == ".html"
        return FileResponse(path, filename=path.name, content_disposition_type="inline" if page else "attachment")

    return show


def result(session: Session, number: int, place: int) -> Path | None:
    """A file that a job has written, where it lies in the working folder; None where there is none.

    Args:
        session: the session of all tabs.
        number: that of the job.
        place: among the job's results, counted from 0.
    """
    try:
        job = session.jobs.get(number)
        path = within(session.folder, job.cwd / job.results[place])
    except (JobError, NameRefusedError, IndexError, OSError):
        return None
    return path if place >= 0 and path.is_file() else None
