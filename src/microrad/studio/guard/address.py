"""Where the studio listens, under which names it answers, and the secret in the address that the command prints."""

from __future__ import annotations

import re
import secrets
from typing import Any

MESSAGE_BYTES = 1_000_000
"""Largest message to the server, by WebSocket or in a plain request; NiceGUI's pages send no larger one."""

_LOOPBACK = ("127.0.0.1",)  # not localhost: a browser may find another program there, on [::1]
_NAME = re.compile(r"[A-Za-z0-9.-]{1,253}|\[[0-9A-Fa-f:.]{2,45}\]")
_SHOWN = 120


class ExposureError(ValueError):
    """The studio was to be opened under a name that is none; the message says what to do."""


def new_token() -> str:
    """The secret of one session: 256 random bits as text for an address."""
    return secrets.token_urlsafe(32)


def hosts(port: int, names: tuple[str, ...] = _LOOPBACK) -> tuple[str, ...]:
    """The names under which the studio answers, as a browser sends them: `name:port`, without the port where it is 80.

    Raises `ExposureError` for a text that is no name of a host.

    Args:
        port: the port that the studio listens on.
        names: names or addresses of this machine, without port.
    """
    wrong = [name for name in names if not _NAME.fullmatch(name)]
    if wrong or not names:
        raise ExposureError(
            f"'{', '.join(wrong)[:_SHOWN]}' is no name of a host; give names such as 127.0.0.1, without http:// or port"
        )
    return tuple(name.lower() if port == 80 else f"{name.lower()}:{port}" for name in names)


def origins(names: tuple[str, ...]) -> tuple[str, ...]:
    """The origins of the studio's own pages, from its `hosts`."""
    return tuple(f"http://{name}" for name in names)


def entrance(host: str, token: str) -> str:
    """The address that the command prints.

    Args:
        host: name and port, one of `hosts`.
        token: the secret of the session.
    """
    return f"http://{host}/?token={token}"


def cookie_name(host: str) -> str:
    """Name of the cookie of the studio at `host`: browsers share cookies between ports, so the port is in the name."""
    port = re.search(r":([0-9]+)$", host)
    return f"microrad_studio_{port.group(1) if port else '80'}"


def server_settings() -> dict[str, Any]:
    """Settings of uvicorn that belong to the guard: bounded headers and messages, no log that shows tokens.

    A browser sends the cookies of every other server on this machine, too: 64 KiB of head have room for them.
    Compression would cost time on a loopback, and unpack what was sent.
    """
    return {
        "http": "h11",
        "h11_max_incomplete_event_size": 65_536,
        "ws": "websockets-sansio",
        "ws_max_size": MESSAGE_BYTES,
        "ws_per_message_deflate": False,
        "proxy_headers": False,
        "server_header": False,
        "access_log": False,
    }
