"""The door of the studio: who may ask, from which page, and how much may be sent; in front of any ASGI application.

A page of another site, opened in the same browser, can send requests to a server on this machine, connect to its
WebSockets and, under a name of its own that it lets point here (DNS rebinding), even read the answers. So the guard
takes only the exact names, only pages of those names, and only a browser that has shown the token which the command
printed. Other programs of this machine are kept out by the token alone. A browser sends a cookie to every port of a
name: whoever runs another server on this machine, and gets the same browser to visit it, learns the token.
"""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, quote, urlencode

from microrad.studio.guard import policy
from microrad.studio.guard.address import MESSAGE_BYTES, cookie_name
from microrad.studio.guard.answers import (
    CLOSE,
    Answer,
    locked,
    refusal,
    send_answer,
    short,
    too_large,
)

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

UPLOAD_BYTES = 200_000_000
"""Largest recording that is taken."""

_ENVELOPE_BYTES = 65_536  # of the form around a file
_UPLOAD_PATH = r"/_nicegui/client/[0-9a-f-]{1,64}/upload/[0-9]{1,9}"
_SAFE_METHODS = ("GET", "HEAD")
_OF_A_PROXY = (b"x-forwarded", b"forwarded")


@dataclass(frozen=True, slots=True)
class Limits:
    """How many bytes a request may bring: `upload_bytes` on the paths of uploads (a pattern), else `message_bytes`."""

    message_bytes: int = MESSAGE_BYTES
    upload_bytes: int = UPLOAD_BYTES
    upload_path: str = _UPLOAD_PATH

    def of(self, path: str) -> int:
        """Bytes that the body of a request to this path may have, with the envelope of a form around a file."""
        return self.upload_bytes + _ENVELOPE_BYTES if re.fullmatch(self.upload_path, path) else self.message_bytes


class Guard:
    """ASGI middleware that lets only the studio's own pages through, and no more than `limits` from them.

    `hosts` are the exact values of the Host header, `origins` those of Origin, one for each host: a page of one name
    asks under that name alone. `token` is the secret that opens the door; see `address`. Answers under `documents`
    (beginnings of paths) run in a sandbox.

    A request under a wrong name is answered 421; without a name or with two, or for a path that does not print, 400;
    from another page, with a wrong token or without one, 403; one that is too large, 413. Nothing is held back: bodies
    are counted as they pass.
    """

    def __init__(
        self,
        app: ASGIApp,
        hosts: tuple[str, ...],
        origins: tuple[str, ...],
        token: str,
        limits: Limits | None = None,
        documents: tuple[str, ...] = (),
    ) -> None:
        """Stand in front of `app`; raises ValueError without hosts and their origins, or for a token that is short.

        Args:
            app: the ASGI application behind the guard.
            hosts: exact values of the Host header.
            origins: exact values of the Origin header, one for each host.
            token: the secret that opens the door, of at least 32 characters.
            limits: of the bodies of requests.
            documents: beginnings of the paths that run in a sandbox.
        """
        if len(token) < 32 or not hosts or len(hosts) != len(origins):
            raise ValueError(
                "the guard needs hosts, their origins and a token of at least 32 characters; see new_token"
            )
        self.app = app
        self.hosts, self.origins, self.documents = hosts, origins, documents
        self.limits = limits or Limits()
        self.cookie = cookie_name(hosts[0])
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request or WebSocket; start and stop of the server are passed on."""
        if scope["type"] == "http":
            await self._http(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
        elif scope["type"] == "lifespan":
            await self.app(scope, receive, send)

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        limit = self.limits.of(scope["path"])
        answer = self._stranger(scope) or self._shown_token(scope) or self._without_cookie(scope)
        answer = answer or _unprintable(scope) or _announced(scope, limit)
        if answer is not None:
            await send_answer(answer, scope, send)
            return
        inside = _inside(scope)
        exchange = _Exchange(inside, receive, send, limit, self._policy(inside))
        try:
            await self.app(inside, exchange.receive, exchange.send)
        except Exception:
            if not exchange.over:  # else it is what the application says to a body that ends early
                raise

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        answer = self._stranger(scope) or self._without_cookie(scope)
        if answer is None:
            await self.app(_inside(scope), receive, send)  # uvicorn bounds the messages
        elif "websocket.http.response" in (scope.get("extensions") or {}):
            await send_answer(answer, scope, send, "websocket.http.response")
        else:
            await send({"type": "websocket.close", "code": 1008})

    def _policy(self, scope: Scope) -> str:
        if scope["path"].startswith(self.documents):
            return policy.document_policy()
        return policy.page_policy(_values(scope, b"host")[0].lower(), scope[policy.NONCE])

    # --------------------------------------------------------------------------------------------------------- checks
    def _stranger(self, scope: Scope) -> Answer | None:
        """The refusal of a name or a page that is not the studio's own."""
        names, pages = _values(scope, b"host"), _values(scope, b"origin")
        if len(names) != 1 or len(pages) > 1:
            return refusal(400, "A request names exactly one host and at most one page that it comes from.")
        name = names[0].lower()
        if name not in self.hosts:
            here = f"Open http://{self.hosts[0]} instead; a tunnel has this port at both ends."
            return refusal(421, f"'{short(names[0])}' is not this server. {here}")
        if pages and pages[0] != self.origins[self.hosts.index(name)]:
            return refusal(403, f"A page of '{short(pages[0])}' may not use the studio.")
        if not pages and (scope["type"] == "websocket" or scope["method"] not in _SAFE_METHODS):
            return refusal(403, "A request that acts says by its Origin which page it comes from; this one does not.")
        if _of_another_site(scope):
            return refusal(403, "A page of another site may not use the studio.")
        return None

    def _shown_token(self, scope: Scope) -> Answer | None:
        """The answer to a token in the address: it moves into a cookie, and the address is opened without it."""
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        tokens = [value for key, value in query if key == "token"]
        if not tokens or scope["method"] not in _SAFE_METHODS:
            return None
        if len(tokens) > 1 or not self._matches(tokens[0]):
            return locked("The token in the address is not that of this session.")
        rest = urlencode([(key, value) for key, value in query if key != "token"])
        # Behind two slashes a browser would read the name of another host.
        target = quote("/" + scope["path"].lstrip("/\\")) + (f"?{rest}" if rest else "")
        return self._entered(
            target, from_elsewhere=_values(scope, b"sec-fetch-site") in (["cross-site"], ["same-site"])
        )

    def _entered(self, target: str, from_elsewhere: bool) -> Answer:
        """Hand out the cookie; a redirect of a link on another site's page would be followed without it."""
        cookie = f"{self.cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict".encode("latin-1")
        place = target.encode("latin-1")
        how = (200, (b"refresh", b"0;url=" + place)) if from_elsewhere else (303, (b"location", place))
        return Answer(how[0], "Opening the studio", "One moment.", ((b"set-cookie", cookie), how[1]))

    def _without_cookie(self, scope: Scope) -> Answer | None:
        pairs = (part.strip().partition("=") for value in _values(scope, b"cookie") for part in value.split(";"))
        shown = [value for name, _, value in pairs if name == self.cookie]
        if any(self._matches(value) for value in shown):
            return None
        return locked("This browser has not shown the token of this session.")

    def _matches(self, token: str) -> bool:
        """Whether this is the token, in a time that does not tell how much of it is right."""
        return secrets.compare_digest(token.encode("utf-8", "replace"), self._token.encode("utf-8"))


def _values(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key.lower() == name]


def _inside(scope: Scope) -> Scope:
    """The scope for the application: with a nonce, without headers that only a proxy may set."""
    headers = [(name, value) for name, value in scope["headers"] if not name.lower().startswith(_OF_A_PROXY)]
    return {**scope, "headers": headers, policy.NONCE: policy.new_nonce()}


def _of_another_site(scope: Scope) -> bool:
    """Whether the browser says that another site asks, and not the user, by following a link.

    Another port of this machine is a site of its own here, though the same to a cookie ("same-site").
    """
    if _values(scope, b"sec-fetch-site") in ([], ["same-origin"], ["none"]):
        return False
    followed = _values(scope, b"sec-fetch-mode") == ["navigate"] and _values(scope, b"sec-fetch-dest") == ["document"]
    return not (followed and scope["type"] == "http" and scope["method"] == "GET")


def _unprintable(scope: Scope) -> Answer | None:
    """The refusal of a path with control characters, which would reach the user's terminal in a message."""
    return None if scope["path"].isprintable() else refusal(400, "The address holds characters that do not print.")


def _announced(scope: Scope, limit: int) -> Answer | None:
    """The refusal of a body whose announced length is over the limit, or no number."""
    lengths = _values(scope, b"content-length")
    if not lengths:
        return None
    if len(lengths) > 1 or not re.fullmatch(r"[0-9]{1,18}", lengths[0]):
        return refusal(400, "The length of the request is not one number.")
    return too_large(limit) if int(lengths[0]) > limit else None


# ----------------------------------------------------------------------------------------------------------- messages
class _Exchange:
    """Request and answer on their way through: the body is counted, the answer gets its headers."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, limit: int, rules: str) -> None:
        self.over = False
        self._scope, self._receive, self._send, self._limit, self._rules = scope, receive, send, limit, rules
        self._taken = 0
        length = _values(scope, b"content-length")
        self._whole = not _values(scope, b"transfer-encoding") and length in ([], ["0"])
        self._started = False

    async def receive(self) -> Message:
        """The next part of the body; beyond the limit the sender is refused, and to the application it is gone."""
        message: Message = {"type": "http.disconnect"} if self.over else await self._receive()
        if message["type"] != "http.request":
            return message
        self._taken += len(message.get("body", b""))
        self._whole = self._whole or not message.get("more_body", False)
        if self._taken <= self._limit:
            return message
        self.over = True
        if not self._started:
            await send_answer(too_large(self._limit), self._scope, self._send)
        return {"type": "http.disconnect"}

    async def send(self, message: Message) -> None:
        """Pass on the answer; one given before the body was read ends the connection, or the rest would be read."""
        if self.over:
            return
        if message["type"] == "http.response.start":
            self._started = True
            headers = policy.secured(list(message.get("headers", [])), self._rules)
            message = {**message, "headers": headers if self._whole else [*headers, CLOSE]}
        await self._send(message)
