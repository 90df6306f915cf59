"""Answers of the guard itself: small pages of escaped sentences that say what was wrong and what to do."""

from __future__ import annotations

import html
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING

from microrad.studio.guard.policy import refusal_policy, secured

if TYPE_CHECKING:
    from starlette.types import Scope, Send

CLOSE = (b"connection", b"close")

_SHOWN = 80
_AGAIN = '<p>Did this browser have the studio open already? <a href="/">Then go on here.</a></p>'
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} - microrad studio</title>
<style>
body {{ font: 1rem/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff; margin: 15vh auto 0; max-width: 36rem;
  padding: 0 1.5rem; overflow-wrap: anywhere }}
h1 {{ font-size: 1.4rem }}
</style></head>
<body><main><h1>{title}</h1><p>{words}</p>{again}</main></body></html>
"""


@dataclass(frozen=True, slots=True)
class Answer:
    """Status, title and plain sentences, which are escaped where they are shown, and headers of this answer alone.

    `again` offers to open the studio from this page: a link of another site is followed without the cookie.
    """

    status: int
    title: str
    words: str
    headers: tuple[tuple[bytes, bytes], ...] = ()
    again: bool = False


async def send_answer(answer: Answer, scope: Scope, send: Send, kind: str = "http.response") -> None:
    """Send the page.

    Args:
        answer: the page.
        scope: that of the request.
        send: the way to the server.
        kind: beginning of the messages' types; "websocket.http.response" in place of a WebSocket's handshake.
    """
    title, words = html.escape(answer.title), html.escape(answer.words)
    body = _PAGE.format(title=title, words=words, again=_AGAIN if answer.again else "").encode("utf-8")
    headers = [
        (b"content-type", b"text/html; charset=utf-8"),
        (b"content-length", str(len(body)).encode("ascii")),
        (b"cache-control", b"no-store"),
        *answer.headers,
    ]
    start = {"type": f"{kind}.start", "status": answer.status, "headers": secured(headers, refusal_policy())}
    await send(start)
    await send({"type": f"{kind}.body", "body": b"" if scope.get("method") == "HEAD" else body})


def short(text: str) -> str:
    """At most 80 characters of what was sent, fit for a sentence."""
    shown = "".join(c if c.isprintable() else "?" for c in text[:_SHOWN])
    return shown + ("..." if len(text) > _SHOWN else "")


def locked(reason: str) -> Answer:
    """The refusal of a browser that has not shown the token."""
    return Answer(
        403,
        "The studio is locked",
        f"{reason} Open the address that the command microrad studio printed, whole, with the token at its end. If it "
        "is gone, stop the command with Ctrl-C and start it again.",
        again=True,
    )


def refusal(status: int, words: str) -> Answer:
    """The refusal of a request that does not come from a page of the studio; the connection ends with it.

    Args:
        status: of HTTP.
        words: why, and what to do instead.
    """
    return Answer(status, f"Refused: {HTTPStatus(status).phrase.lower()}", words, (CLOSE,))


def too_large(limit_bytes: int) -> Answer:
    """The refusal of a body beyond the limit, after which nothing more is read."""
    return Answer(
        413,
        "The file is too large",
        f"The studio takes at most {limit_bytes / 1e6:.4g} MB in one request. Cut out the part of the recording that "
        "you need, keep every n-th sample, or run microrad identify on the file, which needs no upload.",
        (CLOSE,),
    )
