"""The door of the studio: forged names, foreign pages, wrong tokens and floods are refused; its own pages are not."""

import asyncio
import contextlib
import http.client
import re
import socket
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from html import unescape
from pathlib import Path

import pytest

from browser import new_context, watched
from microrad.studio.guard import address, answers, policy
from microrad.studio.guard.middleware import Guard, Limits
from waiting import HANG_S, until

PORT = 8123
HOST, PAGE = f"127.0.0.1:{PORT}", f"http://127.0.0.1:{PORT}"
TOKEN = "t0ken-" + 40 * "x"
COOKIE = f"microrad_studio_{PORT}={TOKEN}"
EVIL = "<script>alert(1)</script>"
LIMITS = Limits(message_bytes=1000, upload_bytes=100_000)
UPLOAD = "/_nicegui/client/0a1b-2c/upload/7"


# ------------------------------------------------------------------------------------------- an application, unguarded
class Inner:
    """An application that reads the whole body and says what it was given."""

    def __init__(self, read=True, headers=()):
        self.scopes, self.bodies, self.ends, self.messages = [], [], [], []
        self.read, self.headers = read, list(headers)

    async def __call__(self, scope, receive, send):
        self.scopes.append(scope)
        if scope["type"] == "http":
            await self.http(receive, send)
        elif scope["type"] == "websocket":
            await self.websocket(receive, send)

    async def http(self, receive, send):
        body, more = b"", self.read
        while more:
            message = await receive()
            body, more = body + message.get("body", b""), message.get("more_body", False)
            if message["type"] == "http.disconnect":
                self.ends.append(len(body))
                raise ConnectionError("the body ended early")
        self.bodies.append(body)
        await send({"type": "http.response.start", "status": 200, "headers": self.headers})
        await send({"type": "http.response.body", "body": b"inside"})

    async def websocket(self, receive, send):
        assert (await receive())["type"] == "websocket.connect"
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            self.messages.append(message)
        self.ends.append(message.get("code"))


class Reply:
    """What an exchange came to."""

    def __init__(self, sent, pulled):
        self.kinds, self.pulled = [m["type"] for m in sent], pulled
        starts = [m for m in sent if m["type"].endswith("response.start")]
        assert len(starts) <= 1
        self.status = starts[0]["status"] if starts else None
        self.headers = dict(starts[0]["headers"]) if starts else {}
        self.body = b"".join(m.get("body", b"") for m in sent).decode()
        self.sent = sent


def guard(app, **kwargs):
    names = address.hosts(PORT, ("127.0.0.1", "localhost", "[::1]"))
    return Guard(app, names, address.origins(names), TOKEN, kwargs.pop("limits", LIMITS), **kwargs)


def exchange(app, scope, parts):
    """Run one exchange; `parts` are the messages that come in, counted as they are pulled."""
    sent, pulled = [], 0

    async def receive():
        nonlocal pulled
        await asyncio.sleep(0)
        if pulled >= len(parts):
            return {"type": "http.disconnect" if scope["type"] == "http" else "websocket.disconnect"}
        pulled += 1
        return parts[pulled - 1]

    async def send(message):
        sent.append(message)

    with ThreadPoolExecutor(1) as thread:  # beside the loop that a browser leaves in this one
        thread.submit(asyncio.run, app(scope, receive, send)).result()
    return Reply(sent, pulled)


def headers_of(changes, origin):
    found = {"host": HOST, "cookie": COOKIE, **({"origin": PAGE} if origin else {}), **changes}
    lines = [
        (k, v)
        for k, values in found.items()
        if values is not None
        for v in ([values] if isinstance(values, str) else values)
    ]
    return [(k.encode(), v.encode("latin-1")) for k, v in lines]


def ask(app, method="GET", path="/", query="", body=(), **headers):
    """A request as a page of the studio would send it, with the changes given; None leaves a header out."""
    headers = {k.replace("_", "-"): v for k, v in headers.items()}
    scope = {"type": "http", "method": method, "path": path, "query_string": query.encode(), "extensions": {}}
    scope["headers"] = headers_of(headers, method not in ("GET", "HEAD"))
    parts = [{"type": "http.request", "body": b, "more_body": k < len(body) - 1} for k, b in enumerate(body or [b""])]
    return exchange(app, scope, parts)


def connect(app, messages=(), extensions=(), **headers):
    scope = {
        "type": "websocket",
        "path": "/_nicegui_ws/",
        "query_string": b"",
        "extensions": {name: {} for name in extensions},
    }
    scope["headers"] = headers_of({k.replace("_", "-"): v for k, v in headers.items()}, True)
    return exchange(app, scope, [{"type": "websocket.connect"}, *messages])


def text_message(text):
    return {"type": "websocket.receive", "text": text}


# -------------------------------------------------------------------------------------------------------- who may ask
@pytest.mark.parametrize("host", [HOST, f"localhost:{PORT}", f"LOCALHOST:{PORT}", f"[::1]:{PORT}"])
def test_own_names_pass(host):
    inner = Inner()
    assert ask(guard(inner), host=host).body == "inside"
    assert len(inner.scopes) == 1


@pytest.mark.promise("studio-22", "studio-25")
@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("evil.example", 421),
        (f"evil.example:{PORT}", 421),
        ("127.0.0.1", 421),
        (f"127.0.0.1:{PORT + 1}", 421),
        (f"127.0.0.1.evil.example:{PORT}", 421),
        (f"evil.example@127.0.0.1:{PORT}", 421),
        (f"{HOST} ", 421),
        (EVIL, 421),
        ("", 421),
        (None, 400),
        ([HOST, HOST], 400),
        ([HOST, "evil.example"], 400),
    ],
)
def test_a_forged_host_is_refused(host, status):
    inner = Inner()
    for reply in (
        ask(guard(inner), host=host),
        connect(guard(inner), extensions=["websocket.http.response"], host=host),
    ):
        assert reply.status == status
        assert reply.headers[b"connection"] == b"close"
        assert "<script" not in reply.body
    assert inner.scopes == []


@pytest.mark.promise("studio-22")
@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "null",
        f"https://{HOST}",
        f"http://127.0.0.1:{PORT + 1}",
        f"{PAGE}/",
        PAGE.upper(),
        EVIL,
        [PAGE, PAGE],
    ],
)
def test_a_foreign_page_is_refused(origin):
    inner = Inner()
    for reply in (
        ask(guard(inner), origin=origin),
        ask(guard(inner), "POST", origin=origin),
        connect(guard(inner), extensions=["websocket.http.response"], origin=origin),
    ):
        assert reply.status == (400 if isinstance(origin, list) else 403)
        assert "<script" not in reply.body
    assert inner.scopes == []
    assert ask(guard(inner), "POST", origin=PAGE).body == "inside"


@pytest.mark.promise("studio-22")
def test_a_page_asks_under_its_own_name_alone():
    """Another program may listen on [::1] with the same port: its pages are not those of 127.0.0.1."""
    inner = Inner()
    for name in (f"localhost:{PORT}", f"[::1]:{PORT}"):
        page = f"http://{name}"
        assert ask(guard(inner), origin=page).status == 403
        assert ask(guard(inner), "POST", origin=page).status == 403
        assert connect(guard(inner), origin=page).kinds == ["websocket.close"]
        assert inner.scopes == []
        assert ask(guard(inner), "POST", host=name, origin=page).status == 200
        assert connect(guard(inner), host=name, origin=page).kinds == ["websocket.accept"]
        inner.scopes.clear()


@pytest.mark.promise("studio-22")
def test_what_acts_must_say_where_it_comes_from():
    inner = Inner()
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
        assert ask(guard(inner), method, origin=None).status == 403
        assert ask(guard(inner), method).status == 200
    assert connect(guard(inner), origin=None).kinds == ["websocket.close"]
    assert len(inner.scopes) == 5
    assert ask(guard(inner), "GET").status == 200  # a page that is opened says nothing


@pytest.mark.parametrize("site", ["cross-site", "same-site", "anything"])
def test_another_site_may_lead_here_but_not_embed_or_fetch(site):
    inner = Inner()
    link = {"sec_fetch_site": site, "sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    assert ask(guard(inner), **link).body == "inside"
    for change in ({"sec_fetch_mode": "no-cors"}, {"sec_fetch_dest": "iframe"}, {"sec_fetch_mode": None}):
        assert ask(guard(inner), **{**link, **change}).status == 403
    assert ask(guard(inner), "POST", **link).status == 403
    assert connect(guard(inner), **link).kinds == ["websocket.close"]
    assert len(inner.scopes) == 1


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-22")
@pytest.mark.parametrize(
    "cookie",
    [
        None,
        "",
        f"microrad_studio_{PORT}=",
        f"microrad_studio_{PORT}={TOKEN[:-1]}",
        f"microrad_studio_{PORT}={TOKEN}x",
        f"microrad_studio_{PORT}=é",
        f"microrad_studio_{PORT + 1}={TOKEN}",
        f"x={TOKEN}",
        TOKEN,
    ],
)
def test_without_the_token_nothing_is_answered(cookie):
    inner = Inner()
    page = ask(guard(inner), cookie=cookie)
    assert page.status == 403
    assert "the address that the command microrad studio printed" in page.body
    assert TOKEN not in page.body
    assert ask(guard(inner), "POST", path=UPLOAD, cookie=cookie).status == 403
    assert connect(guard(inner), cookie=cookie).kinds == ["websocket.close"]
    assert connect(guard(inner), extensions=["websocket.http.response"], cookie=cookie).status == 403
    assert inner.scopes == []


@pytest.mark.promise("studio-32")
@pytest.mark.parametrize("cookie", [COOKIE, f"a=b; {COOKIE}", ["a=b", COOKIE], f"microrad_studio_{PORT}=old; {COOKIE}"])
def test_with_the_token_in_the_cookie_pages_and_websockets_pass(cookie):
    inner = Inner()
    assert ask(guard(inner), cookie=cookie).body == "inside"
    reply = connect(guard(inner), [text_message("hello")], cookie=cookie)
    assert (reply.kinds, inner.messages) == (["websocket.accept"], [text_message("hello")])


def test_start_and_stop_of_the_server_pass():
    inner = Inner()
    exchange(guard(inner), {"type": "lifespan"}, [])
    assert [scope["type"] for scope in inner.scopes] == ["lifespan"]


def test_what_is_neither_a_request_nor_the_server_s_own_is_not_passed_on():
    inner = Inner()
    exchange(guard(inner), {"type": "other"}, [])
    assert inner.scopes == []


@pytest.mark.parametrize("extensions", [None, {}, {"other": {}}])
def test_a_handshake_that_cannot_be_answered_in_words_is_closed(extensions):
    scope = {"type": "websocket", "path": "/", "query_string": b"", "headers": headers_of({"cookie": None}, True)}
    if extensions is not None:
        scope["extensions"] = extensions
    for told in ({}, {"extensions": None}):
        sent = exchange(guard(Inner()), told | scope, []).sent
        assert sent == [{"type": "websocket.close", "code": 1008}]


@pytest.mark.parametrize("path", ["/\x1b[2J", "/a\r\nb", "/\0", "/\u202e"])
def test_a_path_that_does_not_print_is_refused(path):
    inner = Inner()
    reply = ask(guard(inner), path=path)
    assert (reply.status, inner.scopes) == (400, [])
    assert reply.headers[b"connection"] == b"close"
    assert ask(guard(inner), path="/é/ü").body == "inside"


def test_headers_of_a_proxy_do_not_reach_the_application():
    inner = Inner()
    ask(
        guard(inner),
        x_forwarded_prefix="//evil.example",
        x_forwarded_for="1.2.3.4",
        forwarded="for=1.2.3.4",
        accept="*/*",
    )
    assert {name for name, _ in inner.scopes[0]["headers"]} == {b"host", b"cookie", b"accept"}


# --------------------------------------------------------------------------------------------------- the token's way in
@pytest.mark.promise("studio-3", "studio-22")
def test_the_token_moves_from_the_address_into_a_cookie():
    inner = Inner()
    reply = ask(guard(inner), query=f"token={TOKEN}", cookie=None)
    assert (reply.status, reply.headers[b"location"], inner.scopes) == (303, b"/", [])
    assert reply.headers[b"set-cookie"].decode() == f"{COOKIE}; Path=/; HttpOnly; SameSite=Strict"
    assert reply.headers[b"cache-control"] == b"no-store"
    assert ask(guard(inner), cookie=reply.headers[b"set-cookie"].decode().split(";")[0]).body == "inside"


def test_a_link_from_elsewhere_enters_by_a_page_of_the_studio():
    link = {"sec_fetch_site": "cross-site", "sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    reply = ask(guard(Inner()), query=f"token={TOKEN}", cookie=None, **link)
    assert (reply.status, reply.headers[b"refresh"]) == (200, b"0;url=/")
    assert b"location" not in reply.headers
    assert reply.headers[b"set-cookie"].startswith(COOKIE.encode())


@pytest.mark.parametrize(
    ("path", "query", "target"),
    [
        ("/jobs", f"a=1&token={TOKEN}&b=%26", b"/jobs?a=1&b=%26"),
        ("//evil.example", f"token={TOKEN}", b"/evil.example"),
        ("/\\evil.example/x", f"token={TOKEN}", b"/evil.example/x"),
        ("/a\r\nx: y", f"token={TOKEN}", b"/a%0D%0Ax%3A%20y"),
    ],
)
def test_the_address_is_opened_without_the_token_and_stays_here(path, query, target):
    assert ask(guard(Inner()), path=path, query=query).headers[b"location"] == target


@pytest.mark.parametrize(
    "query", ["token=", f"token={TOKEN}x", f"token={TOKEN}&token={TOKEN}", "token=%C3%A9", f"token={EVIL}"]
)
def test_a_wrong_token_in_the_address_is_refused_even_with_the_cookie(query):
    inner = Inner()
    reply = ask(guard(inner), query=query)
    assert (reply.status, inner.scopes) == (403, [])
    assert b"set-cookie" not in reply.headers
    assert "<script" not in reply.body


def test_a_token_in_the_address_opens_no_post_and_no_websocket():
    inner = Inner()
    assert ask(guard(inner), "POST", query=f"token={TOKEN}", cookie=None).status == 403
    assert ask(guard(inner), query=f"token={TOKEN}", host="evil.example").status == 421
    assert inner.scopes == []


# ------------------------------------------------------------------------------------------------ how much may be sent
def test_a_body_within_the_limit_passes_as_it_comes():
    inner = Inner()
    assert ask(guard(inner), "POST", body=[b"a" * 400, b"b" * 600], content_length="1000").body == "inside"
    assert inner.bodies == [b"a" * 400 + b"b" * 600]
    assert ask(guard(inner), "POST", path=UPLOAD, body=[b"a" * 50_000] * 3).status == 200  # with a form's envelope


@pytest.mark.parametrize("path", ["/", UPLOAD])
def test_an_announced_body_over_the_limit_is_not_read_at_all(path):
    inner = Inner()
    reply = ask(guard(inner), "POST", path=path, body=[b"a" * 10], content_length="1000000000")
    assert (reply.status, reply.pulled, inner.scopes) == (413, 0, [])
    assert reply.headers[b"connection"] == b"close"
    assert "cut" in reply.body.lower()


@pytest.mark.parametrize("length", ["-1", "1e3", "", "0x10", "9" * 30, ["5", "6"], ["5", "5"]])
def test_a_length_that_is_no_number_is_refused(length):
    inner = Inner()
    assert ask(guard(inner), "POST", body=[b"aaaaa"], content_length=length).status == 400
    assert inner.scopes == []


@pytest.mark.promise("studio-20")
@pytest.mark.parametrize(
    ("path", "limit"), [("/", 1000), (UPLOAD, 100_000 + 65_536), (UPLOAD + "/x", 1000), ("/upload", 1000)]
)
def test_a_body_that_grows_over_the_limit_is_cut_off(path, limit):
    inner = Inner()
    block = b"a" * (limit // 4)
    reply = ask(guard(inner), "POST", path=path, body=[block] * 1000, transfer_encoding="chunked")
    assert (reply.status, reply.pulled) == (413, 5)
    assert reply.headers[b"connection"] == b"close"
    assert (inner.bodies, inner.ends) == ([], [4 * len(block)])


def test_a_length_that_is_a_lie_is_cut_off_as_well():
    inner = Inner()
    reply = ask(guard(inner), "POST", body=[b"a" * 600] * 3, content_length="10")
    assert (reply.status, reply.pulled, inner.bodies) == (413, 2, [])


def test_a_fault_of_the_application_is_not_taken_for_a_flood():
    async def broken(scope, receive, send):
        raise ConnectionError("of its own")

    with pytest.raises(ConnectionError, match="of its own"):
        ask(guard(broken))


def test_an_application_that_answers_a_body_cut_off_is_not_heard():
    async def calm(scope, receive, send):
        while (await receive())["type"] != "http.disconnect":
            pass
        assert (await receive())["type"] == "http.disconnect"
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"fine"})

    reply = ask(guard(calm), "POST", body=[b"a" * 600] * 3, transfer_encoding="chunked")
    assert (reply.status, reply.kinds) == (413, ["http.response.start", "http.response.body"])
    assert "fine" not in reply.body


def test_a_flood_into_an_answer_that_has_begun_ends_it_without_a_second_one():
    seen = []

    async def eager(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while (message := await receive())["type"] != "http.disconnect":
            seen.append(len(message["body"]))
        await send({"type": "http.response.body", "body": b"all of it"})

    reply = ask(guard(eager), "POST", body=[b"a" * 600] * 3, transfer_encoding="chunked")
    assert (reply.status, reply.kinds, seen) == (200, ["http.response.start"], [600])
    assert reply.headers[b"connection"] == b"close"


def test_an_answer_before_the_body_was_read_ends_the_connection():
    early = ask(guard(Inner(read=False)), "POST", body=[b"a"] * 9, transfer_encoding="chunked")
    assert (early.status, early.headers.get(b"connection")) == (200, b"close")
    whole = ask(guard(Inner()), "POST", body=[b"a"] * 9, transfer_encoding="chunked")
    assert (whole.status, whole.headers.get(b"connection")) == (200, None)
    assert ask(guard(Inner(read=False))).headers.get(b"connection") is None


# ----------------------------------------------------------------------------------------------- what browsers are told
def directives(reply):
    return dict(part.split(" ", 1) for part in reply.headers[b"content-security-policy"].decode().split("; "))


@pytest.mark.promise("studio-22", "studio-30")
def test_answers_carry_the_policy_in_place_of_their_own():
    theirs = [(b"Referrer-Policy", b"unsafe-url"), (b"content-security-policy", b"default-src *"), (b"x-own", b"1")]
    reply = ask(guard(Inner(headers=theirs)), host=f"localhost:{PORT}")
    assert [name.lower() for name, _ in reply.sent[0]["headers"]].count(b"content-security-policy") == 1
    assert reply.headers[b"x-own"] == b"1"
    assert reply.headers[b"x-content-type-options"] == b"nosniff"
    assert reply.headers[b"referrer-policy"] == b"no-referrer"
    assert (
        reply.headers[b"cross-origin-opener-policy"] == reply.headers[b"cross-origin-resource-policy"] == b"same-origin"
    )
    rules = directives(reply)
    assert rules["default-src"] == rules["frame-ancestors"] == rules["base-uri"] == rules["form-action"] == "'none'"
    assert rules["connect-src"] == f"'self' ws://localhost:{PORT}"
    assert "unsafe-inline" not in rules["script-src"]
    assert not re.search(r"https?:|\*", reply.headers[b"content-security-policy"].decode())


@pytest.mark.promise("studio-22")
def test_each_answer_has_a_nonce_of_its_own_that_the_page_is_given():
    inner = Inner()
    app = guard(inner)
    seen = [re.search(r"'nonce-([^']+)'", directives(ask(app))["script-src"])[1] for _ in range(2)]
    assert seen == [scope[policy.NONCE] for scope in inner.scopes]
    assert len(set(seen)) == 2
    assert all(len(nonce) >= 22 for nonce in seen)


def test_refusals_carry_the_policy_and_no_script_at_all():
    reply = ask(guard(Inner()), cookie=None)
    assert reply.headers[b"x-content-type-options"] == b"nosniff"
    assert directives(reply)["default-src"] == "'none'"
    assert "script-src" not in directives(reply)


@pytest.mark.promise("studio-22")
def test_documents_run_in_a_sandbox():
    app = guard(Inner(), documents=("/results/",))
    rules = directives(ask(app, path="/results/7/report.html"))
    assert "allow-scripts" in rules["sandbox"]
    assert "allow-same-origin" not in rules["sandbox"]
    assert rules["default-src"] == "'none'"
    assert "sandbox" not in directives(ask(app, path="/resultsx"))


def test_a_head_request_has_no_body():
    assert ask(guard(Inner()), "HEAD", cookie=None).body == ""
    assert int(ask(guard(Inner()), "HEAD", cookie=None).headers[b"content-length"]) > 100


@pytest.mark.promise("studio-25")
def test_html_is_escaped_in_refusals():
    body = ask(guard(Inner()), host="<b>&\"'x").body
    assert "&lt;b&gt;&amp;&quot;&#x27;x" in body
    assert f"is not this server. Open http://{HOST} instead; a tunnel has this port at both ends." in body
    assert "<b>" not in body
    assert "'a?[2J'" in unescape(ask(guard(Inner()), host="a\x1b[2J").body)
    long = ask(guard(Inner()), host="h" * 5000).body
    assert "h" * 80 + "..." in long
    assert "h" * 81 not in long


@pytest.mark.parametrize(
    ("text", "shown"),
    [(80 * "h", 80 * "h"), (81 * "h", 80 * "h" + "..."), ("a\tb\u202e", "a?b?"), ("", "")],
)
def test_what_was_sent_is_shown_in_at_most_eighty_characters(text, shown):
    assert answers.short(text) == shown


def test_a_template_of_an_environment_that_keeps_none_is_signed():
    from jinja2 import DictLoader, Environment

    environment = Environment(loader=DictLoader({"page": "<script>"}), cache_size=0)
    policy.sign_template(environment, "page")
    assert "nonce=" in environment.loader.get_source(environment, "page")[0]


def test_only_the_templates_own_scripts_are_signed():
    from jinja2 import DictLoader, Environment

    text = "<script>a()</script>{{ slipped | safe }}<SCRIPT src='x'></SCRIPT><style>s</style>"
    environment = Environment(loader=DictLoader({"index.html": text, "other": "o"}))
    environment.get_template("index.html")
    policy.sign_template(environment)

    class Request:
        scope = {policy.NONCE: "n0nce"}  # noqa: RUF012

    page = environment.get_template("index.html").render(request=Request(), slipped="<script>evil()</script>")
    assert page.count('nonce="n0nce"') == 2
    assert "<script>evil()</script>" in page
    assert environment.get_template("other").render() == "o"
    with pytest.raises(ValueError, match="has no loader"):
        policy.sign_template(Environment())


# ----------------------------------------------------------------------------------------------------------- addresses
def test_the_server_believes_no_proxy_and_writes_down_no_address():
    uvicorn = pytest.importorskip("uvicorn")
    inner = Inner()
    config = uvicorn.Config(inner, log_config=None, **address.server_settings())
    config.load()
    assert config.loaded_app is inner  # and nothing around it that would believe X-Forwarded-For
    assert (config.access_log, config.server_header, config.ws_per_message_deflate) == (False, False, False)
    assert (config.ws_max_size, config.http_protocol_class.__name__) == (address.MESSAGE_BYTES, "H11Protocol")
    assert config.h11_max_incomplete_event_size == 65_536


def test_names_and_origins():
    assert address.hosts(80, ("Lab.example",)) == ("lab.example",)
    assert address.hosts(81, ("Lab.example", "[::1]")) == ("lab.example:81", "[::1]:81")
    assert address.origins(address.hosts(81, ("localhost",))) == ("http://localhost:81",)
    assert address.entrance("localhost:81", "t") == "http://localhost:81/?token=t"
    assert (address.cookie_name("a:81"), address.cookie_name("a")) == ("microrad_studio_81", "microrad_studio_80")
    for wrong in ("http://a", "a:80", "*", "a b", EVIL, ""):
        with pytest.raises(address.ExposureError, match="no name of a host"):
            address.hosts(80, (wrong,))
    with pytest.raises(address.ExposureError, match="no name of a host"):
        address.hosts(80, ())


@pytest.mark.promise("studio-22")
def test_tokens_cannot_be_guessed_and_short_ones_are_refused():
    assert len({address.new_token() for _ in range(100)}) == 100
    assert len(address.new_token()) >= 43
    with pytest.raises(ValueError, match="32 characters"):
        Guard(Inner(), (HOST,), (PAGE,), "short")
    with pytest.raises(ValueError, match="32 characters"):
        Guard(Inner(), (HOST,), (PAGE,), 31 * "x")
    made = Guard(Inner(), (HOST,), (PAGE,), 32 * "x")
    assert (made.limits, made.documents, made.cookie) == (Limits(), (), f"microrad_studio_{PORT}")
    assert (made.limits.of("/"), made.limits.of(UPLOAD)) == (address.MESSAGE_BYTES, 200_065_536)
    for hosts, pages in (((), (PAGE,)), ((HOST,), ()), ((), ()), ((HOST,), (PAGE, PAGE))):
        with pytest.raises(ValueError, match="needs hosts, their origins"):
            Guard(Inner(), hosts, pages, TOKEN)


# ------------------------------------------------------------------------------------------------------- a real server
SERVER = """
import sys
import uvicorn
from microrad.studio.guard import address
from microrad.studio.guard.middleware import Guard

async def app(scope, receive, send):
    if scope["type"] == "lifespan":
        while True:
            event = (await receive())["type"]
            await send({"type": event + ".complete"})
            if event.endswith("shutdown"):
                return
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            await send({"type": "websocket.send", "text": str(len(message.get("text") or ""))})
        return
    size, more = 0, scope["path"] != "/unread"
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        size, more = size + len(message["body"]), message["more_body"]
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(size).encode()})

port, token = int(sys.argv[1]), sys.argv[2]
names = address.hosts(port)
app = Guard(app, names, address.origins(names), token)
uvicorn.run(app, host="127.0.0.1", port=port, log_level="warning", **address.server_settings())
"""


@contextlib.contextmanager
def serving(script):
    """The script with a free port and the token, once it listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script), str(port), TOKEN], stderr=subprocess.PIPE
    )
    try:

        def listens():
            assert process.poll() is None, process.stderr.read().decode()
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=HANG_S):
                return True

        until(listens, f"a server at port {port}")
        yield port, process
    finally:
        process.terminate()
        process.wait()
        process.stderr.close()


@pytest.fixture(scope="module")
def server():
    pytest.importorskip("uvicorn")
    pytest.importorskip("websockets")
    with serving(SERVER) as found:
        yield found


def own_headers(port, **changes):
    found = {
        "Host": f"127.0.0.1:{port}",
        "Origin": f"http://127.0.0.1:{port}",
        "Cookie": f"microrad_studio_{port}={TOKEN}",
        **{k.replace("_", "-"): v for k, v in changes.items()},
    }
    return "".join(f"{name}: {value}\r\n" for name, value in found.items() if value is not None)


def received(link, wanted=None):
    """What the server sends until it ends, or until this is among it."""
    found = b""
    with contextlib.suppress(ConnectionError):
        while not (wanted and wanted in found) and (part := link.recv(65536)):
            found += part
    return found


def raw(port, head, body=(), most=1 << 30):
    """Send a head and blocks until the server answers or ends it; its status and how many bytes of body it let pass."""
    passed = 0
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_S) as link:
        link.sendall(head.encode("latin-1") + b"\r\n")
        with contextlib.suppress(ConnectionError):
            for block in body:
                link.sendall(block)
                passed += len(block)
                assert passed <= most
        answer = received(link, b"\r\n")
    return (int(answer.split()[1]) if answer else None), passed


def to_head(port, size, end=b"\r\n\r\n"):
    """The status for a head of so many bytes, of which the last four may be left out."""
    head = "GET / HTTP/1.1\r\n" + own_headers(port)
    padding = f"X-Own: {'a' * (size - len(head) - 11)}"
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_S) as link:
        answer = b""
        with contextlib.suppress(ConnectionError):
            link.sendall((head + padding).encode() + end)
            answer = link.recv(65536)
    return int(answer.split()[1]) if answer else None


def zeros(total, chunked):
    block = bytes(65536)
    head, tail = (b"10000\r\n", b"\r\n") if chunked else (b"", b"")
    for _ in range(total // len(block)):
        yield head + block + tail


def largest_memory_kb(process):
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1])


def test_a_real_server_answers_its_own_page(server):
    port, _ = server
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=HANG_S)
    link.request("GET", f"/?token={TOKEN}")
    reply = link.getresponse()
    reply.read()
    cookie = reply.headers["Set-Cookie"].split(";")[0]
    assert (reply.status, reply.headers["Location"], reply.headers["Server"]) == (303, "/", None)
    link.request("GET", "/", headers={"Cookie": cookie})
    reply = link.getresponse()
    assert (reply.status, reply.read()) == (200, b"0")
    link.request("GET", "/", headers={"Cookie": cookie, "Host": "evil.example"})
    reply = link.getresponse()
    assert reply.status == 421
    assert "evil.example" in reply.read().decode()
    link.close()


def buffered():
    """How many bytes the system's buffers of a connection may hold at most: of the sender and of the receiver."""
    limits = [Path(f"/proc/sys/net/ipv4/tcp_{way}mem") for way in "rw"]
    return sum(int(each.read_text().split()[2]) for each in limits) if all(map(Path.exists, limits)) else 16_000_000


@pytest.mark.parametrize("path", ["/", "/unread", "/_nicegui/client/0a1b/upload/1"])
@pytest.mark.parametrize("chunked", [False, True])
def test_a_gigabyte_is_cut_off_and_takes_no_memory(server, path, chunked):
    port, process = server
    limit = 200_065_536 if "upload" in path else 1_000_000
    taken = limit if chunked else 0  # what is announced is not read
    before = largest_memory_kb(process) if sys.platform == "linux" else 0
    length = {"Transfer_Encoding": "chunked"} if chunked else {"Content_Length": "1000000000"}
    head = f"POST {path} HTTP/1.1\r\n" + own_headers(port, **length)
    status, passed = raw(port, head, zeros(1_000_000_000, chunked))
    # 413 for all but the path that answers without reading, whose connection ends; what lies in the system's buffers
    # between both ends was sent without being taken.
    assert status in ((413, None) if path != "/unread" or not chunked else (200, None))
    assert passed <= taken * 1.01 + buffered()
    assert passed >= taken * 0.99 or path == "/unread"
    if sys.platform == "linux":
        assert largest_memory_kb(process) - before < 20_000
    assert raw(port, "GET / HTTP/1.1\r\n" + own_headers(port))[0] == 200


def test_the_head_of_a_request_is_bounded(server):
    port, _ = server
    assert to_head(port, 60_000) == 200
    assert to_head(port, 70_000, end=b"") in (400, 431, None)  # nobody waits for its end


def test_a_large_upload_within_the_limit_passes(server):
    port, _ = server
    size = 305 * 65536
    head = "POST /_nicegui/client/0a1b/upload/1 HTTP/1.1\r\n" + own_headers(port, Content_Length=str(size))
    assert raw(port, head, zeros(size, False)) == (200, size)


def test_whoever_waits_for_leave_to_send_is_refused_before_it(server):
    port, _ = server
    head = "POST /_nicegui/client/0a1b/upload/1 HTTP/1.1\r\n"
    assert raw(port, head + own_headers(port, Content_Length="1000000000", Expect="100-continue"))[0] == 413


def upgrade(port, **changes):
    """The head that asks for a websocket, but for the empty line at its end."""
    asked = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec_WebSocket_Version": "13",
    }
    return "GET /_nicegui_ws/ HTTP/1.1\r\n" + own_headers(port, **asked, **changes)


def handshake(port, **changes):
    return raw(port, upgrade(port, **changes))[0]


def test_handshakes_of_websockets(server):
    port, _ = server
    assert handshake(port) == 101
    assert handshake(port, Host="evil.example") == 421
    for changes in ({"Origin": "http://evil.example"}, {"Origin": None}, {"Cookie": None}, {"Cookie": "x=y"}):
        assert handshake(port, **changes) == 403


HALF = address.MESSAGE_BYTES // 2


def frame(first, size, content=b""):
    """The head of a frame of so many bytes (RFC 6455, 5.2), masked with zeros, and what of its content is sent."""
    length = bytes([0x80 | size]) if size < 126 else b"\xff" + size.to_bytes(8, "big")
    return bytes([first]) + length + bytes(4) + content


def whole(first, text):
    return frame(first, len(text.encode()), text.encode())


# A client of a library may lose the reason of a refusal while it is still sending: a socket alone does not.
@pytest.mark.promise("studio-20")
@pytest.mark.parametrize(
    "large",
    [
        whole(0x81, "a" * (address.MESSAGE_BYTES + 1)),
        whole(0x81, "é" * (HALF + 1)),
        whole(0x01, "a" * HALF) + whole(0x00, "a" * HALF) + whole(0x80, "a"),
        frame(0x81, 1 << 40),
    ],
    ids=["in one frame", "of two bytes a character", "in parts", "announced and not sent"],
)
def test_messages_of_a_websocket_are_bounded_by_the_server(server, large):
    port, process = server
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_S) as link:
        link.sendall(f"{upgrade(port)}\r\n".encode())
        assert b"101 Switching Protocols" in received(link, b"\r\n\r\n")
        size = str(address.MESSAGE_BYTES).encode()
        for most in (whole(0x81, "a" * address.MESSAGE_BYTES), whole(0x01, "a" * HALF) + whole(0x80, "a" * HALF)):
            link.sendall(most)
            assert received(link, size) == bytes([0x81, len(size)]) + size
        with contextlib.suppress(ConnectionError):
            link.sendall(large)
        answer = received(link)
    assert answer[0] == 0x88 and answer[2:4] == (1009).to_bytes(2, "big"), answer
    assert process.poll() is None


# --------------------------------------------------------------------------------------- a real page in a real browser
STUDIO = """
import sys
import uvicorn
from fastapi import FastAPI
from nicegui import ui
from nicegui.client import templates
from microrad.studio.guard import address
from microrad.studio.guard import policy
from microrad.studio.guard.middleware import Guard

MISSION = "<img src=x onerror='window.slipped = 1'>"

@ui.page("/")
def page():
    ui.label(MISSION)
    slider = ui.slider(min=0, max=10, value=3)
    ui.label().bind_text_from(slider, "value", lambda v: f"slider at {v}")
    columns = [{"name": "a", "label": "A", "field": "a", "sortable": True}]
    table = ui.table(rows=[{"a": MISSION}], columns=columns)
    table.add_slot("body-cell-a", '<q-td :props="props"><q-badge>{{ props.value }}</q-badge></q-td>')
    heat = {"type": "heatmap", "z": [[1, 2], [3, 4]]}
    ui.plotly({"data": [{"type": "scatter", "x": [1, 2], "y": [1, 4]}], "layout": {"title": {"text": MISSION}}})
    ui.plotly({"data": [heat], "layout": {}})
    axes = {"xAxis": {"type": "value"}, "yAxis": {"type": "value"}, "tooltip": {"trigger": "axis"}}
    ui.echart({**axes, "series": [{"type": "line", "data": [[1, 2], [2, 3]]}]})
    ui.codemirror("a = 1", language="TOML")
    ui.upload(on_upload=lambda e: ui.notify(f"took {e.file.name}"), auto_upload=True)
    ui.button("script", on_click=lambda: ui.run_javascript("document.title = 'ran'"))
    ui.number("gain", value=3, validation={"too large": lambda v: v < 100}).tooltip("a tip")

@ui.page("/plain")
def plain():
    ui.label(MISSION)

@ui.page("/slipped")
def slipped():
    ui.label("still here")
    ui.add_head_html("<script>window.slipped = 1</script>")
    ui.add_body_html("<img src=/favicon.ico onload='window.slipped = 1'>")

policy.sign_template(templates.env)
inner = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
ui.run_with(inner, show_welcome_message=False)
port, token = int(sys.argv[1]), sys.argv[2]
names = address.hosts(port)
app = Guard(inner, names, address.origins(names), token)
uvicorn.run(app, host="127.0.0.1", port=port, log_level="warning", **address.server_settings())
"""


@pytest.fixture(scope="module")
def studio():
    pytest.importorskip("nicegui")
    with serving(STUDIO) as (port, _):
        yield port


@pytest.fixture
def tab(browser):
    """A tab of a fresh browser, with what it complained of and where it sent requests."""
    context = new_context(browser)
    yield watched(context.new_page())
    context.close()


@pytest.mark.promise("studio-30")
def test_a_page_of_the_studio_works_in_a_browser_under_the_policy(studio, tab):
    here = f"http://127.0.0.1:{studio}/"
    tab.goto(f"{here}?token={TOKEN}")
    assert tab.url == here
    tab.get_by_text("slider at 3").wait_for()
    tab.locator(".js-plotly-plot .heatmaplayer image").wait_for(state="attached")
    tab.locator("canvas").first.wait_for()
    tab.locator(".cm-content").wait_for()
    tab.locator(".q-slider").first.click(position={"x": 2, "y": 10})  # which nothing moves any more
    tab.get_by_text("slider at 0").wait_for()
    tab.locator("input[type=file]").set_input_files([{"name": "<b>x.csv", "mimeType": "text/csv", "buffer": b"1,2"}])
    tab.get_by_text("took <b>x.csv").wait_for()
    tab.get_by_role("button", name="script").click()
    tab.wait_for_function("document.title == 'ran'")
    assert tab.get_by_text("<img src=x", exact=False).count() >= 2
    assert tab.evaluate("window.slipped") is None
    assert tab.evaluate("document.cookie") == ""
    tab.reload()
    tab.get_by_text("slider at 3").wait_for()
    assert tab.complaints == []
    own = re.compile(rf"(http|ws)://127\.0\.0\.1:{studio}/|data:|blob:http://127\.0\.0\.1:{studio}/")
    assert [url for url in tab.asked if not own.match(url)] == []


def test_scripts_that_slip_into_a_page_do_not_run(studio, tab):
    tab.goto(f"http://127.0.0.1:{studio}/slipped?token={TOKEN}")
    tab.get_by_text("still here").wait_for()
    assert tab.evaluate("window.slipped") is None
    assert any("Content Security Policy" in text for text in tab.complaints)


def test_a_browser_without_the_token_is_told_what_to_do(studio, tab):
    assert tab.goto(f"http://127.0.0.1:{studio}/").status == 403
    assert "printed" in tab.locator("main").inner_text()
    assert tab.get_by_role("heading").inner_text() == "The studio is locked"


def test_whoever_is_in_already_gets_in_by_a_link_from_elsewhere(studio, tab):
    here = f"http://127.0.0.1:{studio}/plain"
    tab.goto(f"{here}?token={TOKEN}")
    with serving(FOREIGN) as (other, _):
        tab.goto(f"http://localhost:{other}/{here}")
        tab.locator("#in").click()
        tab.get_by_text("The studio is locked").wait_for()
        tab.get_by_role("link").click()
        tab.get_by_text("slider at 3").wait_for()


FOREIGN = """
import http.server, sys
class Page(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<title>foreign</title><a id=in href='" + self.path[1:].encode() + b"'>in</a>")
    def log_message(self, *_): pass
http.server.HTTPServer(("127.0.0.1", int(sys.argv[1])), Page).serve_forever()
"""

ATTACK = """async ([here, host]) => {
  const tried = async (f) => { try { return await f(); } catch (e) { return "refused"; } };
  const socket = () => new Promise((done) => {
    const s = new WebSocket(`ws://${host}/_nicegui_ws/socket.io/?EIO=4&transport=websocket`);
    s.onopen = () => done("opened"); s.onerror = () => done("refused");
  });
  const image = () => new Promise((done) => {
    const i = new Image(); i.src = here + "favicon.ico";
    i.onload = () => done("shown"); i.onerror = () => done("refused");
  });
  const script = () => new Promise((done) => {
    const s = document.createElement("script"); s.src = here + "_nicegui/3.18.0/static/socket.io.min.js";
    s.onload = () => done("ran"); s.onerror = () => done("refused"); document.head.append(s);
  });
  const form = {method: "POST", body: "x", credentials: "include"};
  return [
    await tried(async () => (await fetch(here, {credentials: "include"})).status),
    await tried(async () => (await fetch(here, form)).status),
    await socket(), await image(), await script(),
  ];
}"""


def test_a_page_on_another_port_reaches_nothing_even_with_the_cookie(studio, tab):
    host = f"127.0.0.1:{studio}"
    tab.goto(f"http://{host}/plain?token={TOKEN}")
    with serving(FOREIGN) as (other, _):
        tab.goto(f"http://127.0.0.1:{other}/x")
        assert tab.evaluate(ATTACK, [f"http://{host}/", host]) == ["refused"] * 5
        reached = tab.context.request.get(f"http://{host}/")
        assert reached.status == 200  # the cookie was there all the time


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_a_link_on_another_page_opens_the_studio(studio, tab, name):
    with serving(FOREIGN) as (other, _):
        tab.goto(f"http://{name}:{other}/http://127.0.0.1:{studio}/plain?token={TOKEN}")
        tab.locator("#in").click()
        tab.get_by_text("<img src=x").wait_for()
        assert tab.url == f"http://127.0.0.1:{studio}/plain"


# ------------------------------------------------------------------------------------------- several headers and limits
def page_of(reply):
    """Title and words of a page of the guard itself."""
    words = unescape(re.search(r"<p>(.*?)</p>", reply.body)[1])
    return unescape(re.search(r"<h1>(.*?)</h1>", reply.body)[1]), words


@pytest.mark.parametrize(
    ("how", "status", "title", "words"),
    [
        ({"host": ["a", "b"]}, 400, "bad request", "A request names exactly one host and at most one page that it"),
        ({"origin": [PAGE, PAGE]}, 400, "bad request", "A request names exactly one host and at most one page that"),
        (
            {"host": "a:1"},
            421,
            "misdirected request",
            f"'a:1' is not this server. Open {PAGE} instead; a tunnel has this",
        ),
        ({"origin": "http://b"}, 403, "forbidden", "A page of 'http://b' may not use the studio."),
        ({"method": "PUT", "origin": None}, 403, "forbidden", "A request that acts says by its Origin which page it"),
        ({"sec_fetch_site": "cross-site"}, 403, "forbidden", "A page of another site may not use the studio."),
        ({"path": "/a\tb"}, 400, "bad request", "The address holds characters that do not print."),
        ({"content_length": "7 "}, 400, "bad request", "The length of the request is not one number."),
    ],
)
def test_each_refusal_has_its_own_title_and_words_and_ends_the_connection(how, status, title, words):
    inner = Inner()
    reply = ask(guard(inner), **how)
    assert (reply.status, inner.scopes, reply.headers[b"connection"]) == (status, [], b"close")
    assert page_of(reply)[0].startswith(f"Refused: {title}")
    assert page_of(reply)[1].startswith(words)
    assert "<a href" not in reply.body


@pytest.mark.parametrize(
    ("query", "cookie", "words"),
    [
        ("token=x", COOKIE, "The token in the address is not that of this session. Open the address that the command"),
        ("", None, "This browser has not shown the token of this session. Open the address that the command microrad"),
    ],
)
def test_a_locked_studio_says_why_and_offers_the_way_back(query, cookie, words):
    reply = ask(guard(Inner()), query=query, cookie=cookie)
    title, said = page_of(reply)
    assert (reply.status, title) == (403, "The studio is locked")
    assert said.startswith(words) and said.endswith("stop the command with Ctrl-C and start it again.")
    assert '<a href="/">Then go on here.</a>' in reply.body
    assert b"connection" not in reply.headers


@pytest.mark.parametrize(
    ("upload_bytes", "path", "words"),
    [
        (200_000_000, UPLOAD, "at most 200.1 MB in one request"),
        (2_500_000, UPLOAD, "at most 2.566 MB in one request"),
        (2_500_000, "/", "at most 1 MB in one request"),
    ],
)
def test_what_is_too_large_is_told_with_the_limit_of_its_path(upload_bytes, path, words):
    limits = Limits(upload_bytes=upload_bytes)
    most = limits.of(path)
    over, just = (
        ask(guard(Inner(), limits=limits), "POST", path=path, content_length=str(n)) for n in (most + 1, most)
    )
    assert (over.status, just.status) == (413, 200)
    title, said = page_of(over)
    assert title == "The file is too large"
    assert said.startswith(f"The studio takes {words}. Cut out the part of the recording that you need, keep every")


def test_a_cookie_of_this_port_is_found_among_those_of_others_and_behind_an_old_one():
    other = f"microrad_studio_{PORT + 1}={TOKEN}"
    old = f"microrad_studio_{PORT}=old"
    for cookie, status in (
        (f"a=b; {other}; {COOKIE}", 200),
        (f"{old};{COOKIE}", 200),
        ([old, f"  {COOKIE} ; c"], 200),
        ([other, old], 403),
        (f"x{COOKIE}", 403),
        (f"{COOKIE}=", 403),
    ):
        assert ask(guard(Inner()), cookie=cookie).status == status, cookie


def test_an_answer_has_the_headers_of_the_application_but_for_those_of_the_policy():
    given = [(b"Content-Security-Policy", b"x"), (b"X-Own", b"1"), (b"REFERRER-policy", b"all"), (b"X-Own", b"2")]
    found = policy.secured(given, "rules")
    assert found == [
        (b"X-Own", b"1"),
        (b"X-Own", b"2"),
        (b"content-security-policy", b"rules"),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
    ]


def test_a_page_of_a_second_name_may_connect_to_that_name_alone():
    reply = ask(guard(Inner()), host=f"LOCALHOST:{PORT}", origin=f"http://localhost:{PORT}")
    rules = directives(reply)
    assert rules["connect-src"] == f"'self' ws://localhost:{PORT}"
    assert rules["img-src"] == "'self' data: blob:"
    assert (rules["frame-ancestors"], rules["base-uri"], rules["form-action"]) == ("'none'",) * 3
    assert rules["frame-src"] == rules["font-src"] == "'self'"


def test_documents_are_framed_by_the_studio_and_load_nothing():
    rules = directives(ask(guard(Inner(), documents=("/a/", "/results/")), path="/results/7/1"))
    assert rules == {
        "sandbox": "allow-scripts allow-downloads allow-modals",
        "default-src": "'none'",
        "script-src": "'unsafe-inline'",
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
        "font-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'self'",
    }


@pytest.mark.parametrize(
    ("headers", "body", "closes"),
    [
        ({}, [b""], False),
        ({"content_length": "0"}, [b""], False),
        ({"content_length": "3"}, [b"abc"], True),
        ({"transfer_encoding": "chunked"}, [b"abc"], True),
        ({"transfer_encoding": "chunked", "content_length": "0"}, [b"abc"], True),
    ],
)
def test_an_answer_before_a_body_closes_the_connection_where_there_is_one(headers, body, closes):
    reply = ask(guard(Inner(read=False)), "POST", body=body, **headers)
    assert (reply.status, reply.headers.get(b"connection") == b"close") == (200, closes)
    assert ask(guard(Inner()), "POST", body=body, **headers).headers.get(b"connection") is None


@pytest.mark.parametrize("site", ["same-site", "cross-site"])
def test_a_link_with_more_in_its_query_enters_by_a_page(site):
    link = {"sec_fetch_site": site, "sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    reply = ask(guard(Inner()), path="/a b", query=f"x=1&token={TOKEN}&y=", cookie=None, **link)
    assert (reply.status, reply.headers[b"refresh"]) == (200, b"0;url=/a%20b?x=1&y=")
    assert page_of(reply) == ("Opening the studio", "One moment.")
    assert int(reply.headers[b"content-length"]) == len(reply.body.encode())
    assert reply.headers[b"content-type"] == b"text/html; charset=utf-8"


def test_several_names_that_are_none_are_all_told():
    with pytest.raises(address.ExposureError) as refusal:
        address.hosts(81, ("good", "a/b", "[::1]", "c d"))
    assert str(refusal.value) == (
        "'a/b, c d' is no name of a host; give names such as 127.0.0.1, without http:// or port"
    )
    with pytest.raises(address.ExposureError) as refusal:
        address.hosts(81, ("a/" * 90,))
    assert str(refusal.value).startswith(f"'{'a/' * 60}' is no name")
    assert address.hosts(8080, ("h" * 253,)) == (f"{'h' * 253}:8080",)
    assert address.cookie_name("[::1]:8123") == "microrad_studio_8123"
    assert address.cookie_name("[::1]") == address.cookie_name("80.example") == "microrad_studio_80"


# ------------------------------------------------------------------------------------------------------- whole answers
def test_the_settings_of_the_server_are_those_of_the_guard():
    assert address.server_settings() == {
        **{"http": "h11", "h11_max_incomplete_event_size": 65_536, "ws": "websockets-sansio", "ws_max_size": 1_000_000},
        **{"ws_per_message_deflate": False, "proxy_headers": False, "server_header": False, "access_log": False},
    }


def test_each_policy_is_whole():
    assert policy.page_policy("lab:81", "N0nce") == (
        "default-src 'none'; script-src 'self' 'nonce-N0nce' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self'; connect-src 'self' ws://lab:81; frame-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    assert policy.refusal_policy() == (
        "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


WAY_BACK = '<p>Did this browser have the studio open already? <a href="/">Then go on here.</a></p>'


@pytest.mark.parametrize("again", [False, True])
def test_a_page_of_the_guard_is_whole_with_its_headers(again):
    sent, kind = [], "websocket.http.response"

    async def send(message):
        sent.append(message)

    answer = answers.Answer(418, "A <pot>", 'Tea & "more".', ((b"x-own", b"1"),), again)
    with ThreadPoolExecutor(1) as thread:  # a browser's loop may run in this one
        thread.submit(asyncio.run, answers.send_answer(answer, {"method": "GET"}, send, kind)).result()
    start, body = sent
    text = body["body"].decode("utf-8")
    head, _, main = text.partition("<body>")
    assert main == (
        "<main><h1>A &lt;pot&gt;</h1><p>Tea &amp; &quot;more&quot;.</p>" + WAY_BACK * again + "</main></body></html>\n"
    )
    assert head.startswith('<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" ')
    assert "<title>A &lt;pot&gt; - microrad studio</title>" in head and "body { font: 1rem/1.5 system-ui" in head
    assert (start["type"], body["type"]) == ("websocket.http.response.start", "websocket.http.response.body")
    assert (start["status"], start["headers"][:4]) == (
        418,
        [
            *((b"content-type", b"text/html; charset=utf-8"), (b"content-length", str(len(body["body"])).encode())),
            *((b"cache-control", b"no-store"), (b"x-own", b"1")),
        ],
    )


@pytest.mark.parametrize(
    ("host", "name"),
    [("127.0.0.1:8080", "8080"), ("[::1]:81", "81"), ("lab", "80"), ("[::1]", "80"), ("lab:0", "0")],
)
def test_a_cookie_and_an_entrance_are_those_of_their_port(host, name):
    assert address.cookie_name(host) == f"microrad_studio_{name}"
    assert address.entrance(host, "t0ken") == f"http://{host}/?token=t0ken"


@pytest.mark.parametrize(
    ("path", "large"),
    [
        ("/_nicegui/client/0a-f/upload/7", True),
        ("/_nicegui/client/0a-f/upload/", False),
        ("/_nicegui/client/0a-f/upload/1234567890", False),
        ("/_nicegui/client/0A/upload/7", False),
        ("/_nicegui/client//upload/7", False),
        ("/_nicegui/client/0a/upload/7/", False),
        ("/x/_nicegui/client/0a/upload/7", False),
        ("/_nicegui/client/0a/download/7", False),
    ],
)
def test_only_the_address_of_an_upload_takes_a_large_body(path, large):
    assert Limits().of(path) == (200_065_536 if large else 1_000_000)
    assert Limits(7, 11, "/x").of("/x") == 65_547
    assert Limits(7, 11, "/x").of("/xy") == 7


def test_a_link_of_another_site_is_followed_by_get_alone_and_says_once_where_it_comes_from():
    inner = Inner()
    link = {"sec_fetch_site": "cross-site", "sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    assert ask(guard(inner), "HEAD", **link).status == 403
    for sites in (["same-origin", "cross-site"], ["none", "none"]):
        assert ask(guard(inner), sec_fetch_site=sites).status == 403
    assert ask(guard(inner), **{**link, "sec_fetch_mode": ["navigate", "navigate"]}).status == 403
    assert inner.scopes == []
    for site in ("same-origin", "none"):
        assert ask(guard(inner), "HEAD", sec_fetch_site=site).status == 200


def test_a_token_in_the_address_is_taken_from_a_request_for_the_head_too():
    reply = ask(guard(Inner()), "HEAD", path="/runs", query=f"token={TOKEN}", cookie=None)
    assert (reply.status, reply.headers[b"location"], reply.body) == (303, b"/runs", "")
    assert reply.headers[b"set-cookie"].startswith(f"microrad_studio_{PORT}={TOKEN};".encode())


def test_documents_of_a_second_beginning_run_in_a_sandbox_and_pages_connect_to_the_name_in_small_letters():
    app = guard(Inner(), documents=("/results/", "/shown/"))
    for path in ("/results/a", "/shown/b.html"):
        assert "sandbox" in directives(ask(app, path=path))
    page = directives(ask(app, path="/x/results/", host=f"LocalHost:{PORT}"))
    assert "sandbox" not in page and page["connect-src"] == f"'self' ws://localhost:{PORT}"


def test_what_cannot_be_guarded_or_signed_and_who_does_not_say_a_page_are_told_in_whole_sentences():
    from jinja2 import Environment

    with pytest.raises(ValueError, match="guard") as refusal:
        Guard(Inner(), (HOST,), (PAGE,), "short")
    assert str(refusal.value) == (
        "the guard needs hosts, their origins and a token of at least 32 characters; see new_token"
    )
    with pytest.raises(ValueError, match="loader") as refusal:
        policy.sign_template(Environment(), "own.html")
    assert str(refusal.value) == "the environment has no loader, so its template 'own.html' cannot be signed"
    reply = ask(guard(Inner()), "POST", origin=None)
    assert page_of(reply) == (
        "Refused: forbidden",
        "A request that acts says by its Origin which page it comes from; this one does not.",
    )


def test_who_is_locked_out_or_sends_too_much_is_told_in_whole_sentences_what_to_do():
    assert answers.locked("Why.") == answers.Answer(
        403,
        "The studio is locked",
        "Why. Open the address that the command microrad studio printed, whole, with the token at its end. If it is "
        "gone, stop the command with Ctrl-C and start it again.",
        again=True,
    )
    for limit, said in ((200_065_536, "200.1"), (1_000_000, "1"), (1_234_500, "1.234")):
        assert answers.too_large(limit) == answers.Answer(
            413,
            "The file is too large",
            f"The studio takes at most {said} MB in one request. Cut out the part of the recording that you need, keep "
            "every n-th sample, or run microrad identify on the file, which needs no upload.",
            ((b"connection", b"close"),),
        )


@pytest.mark.parametrize(
    ("hosts", "pages"), [((HOST, HOST), (PAGE,)), ((HOST, HOST, HOST), (PAGE, PAGE)), ((HOST,), (PAGE, PAGE, PAGE))]
)
def test_a_guard_has_an_origin_for_each_host_and_none_to_spare(hosts, pages):
    with pytest.raises(ValueError, match="the guard needs hosts, their origins and a token"):
        Guard(Inner(), hosts, pages, TOKEN)
    assert Guard(Inner(), (HOST, HOST), (PAGE, PAGE), TOKEN).limits == Limits()


def test_headers_of_a_proxy_are_left_out_however_they_are_written():
    inner = Inner()
    ask(guard(inner), **{"X_Forwarded_Prefix": "//evil.example", "FORWARDED": "for=1.2.3.4", "X_Forward": "no proxy"})
    found = {name.lower() for name, _ in inner.scopes[0]["headers"]}
    assert found == {b"host", b"cookie", b"x-forward"}
