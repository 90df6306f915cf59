"""What the studio's answers tell the browser: where code, styles and data come from, who may embed and read them.

Measured with NiceGUI 3.18 in Chromium, which `tests/studio/test_studio_guard.py` repeats. Its pages need eval: Vue
compiles templates in the browser, and inline styles, because Tailwind, charts and editors write style elements. Inline
scripts pass by a nonce that only the page's own template carries: a script that slips in with a name does not run.
"""

from __future__ import annotations

import re
import secrets
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

Headers = list[tuple[bytes, bytes]]

NONCE = "csp_nonce"
"""Key of the request's nonce in the ASGI scope."""

_SCRIPT = re.compile(r"<script\b", re.IGNORECASE)

_ALWAYS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


def new_nonce() -> str:
    """A nonce of 128 random bits, one for each answer."""
    return secrets.token_urlsafe(16)


def page_policy(host: str, nonce: str) -> str:
    """Content-security policy of the studio's own pages.

    The address of the WebSocket is spelled out, since not every browser counts it to 'self'. Images may be data: and
    blob:, as heat maps and exported plots are.

    Args:
        host: name and port of the request, checked.
        nonce: what scripts of the page's own template carry.
    """
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'self' 'nonce-{nonce}' 'unsafe-eval'",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self'",
            f"connect-src 'self' ws://{host}",
            "frame-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )


def document_policy() -> str:
    """Content-security policy of a finished document, such as a report: its scripts run, but apart from the studio.

    The sandbox gives it an origin of its own: it reads neither cookie nor pages of the studio, and loads nothing.
    """
    return (
        "sandbox allow-scripts allow-downloads allow-modals; default-src 'none'; script-src 'unsafe-inline'; "
        "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'self'"
    )


def refusal_policy() -> str:
    """Content-security policy of a refusal: styled text."""
    return "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"


def secured(headers: Headers, policy: str) -> Headers:
    """The headers of an answer with those of the policy in place of its own of the same names.

    Args:
        headers: those of the answer.
        policy: its content-security policy.
    """
    ours = ((b"content-security-policy", policy.encode("latin-1")), *_ALWAYS)
    names = {name for name, _ in ours}
    return [*((name, value) for name, value in headers if name.lower() not in names), *ours]


def signed(template: str) -> str:
    """A page's template whose own scripts carry the nonce of the request; what is filled in later does not."""
    return _SCRIPT.sub(f'<script nonce="{{{{ request.scope.get({NONCE!r}, {""!r}) }}}}"', template)


def sign_template(environment: Environment, name: str = "index.html") -> None:
    """Have a Jinja environment serve a template signed.

    Args:
        environment: of Jinja; NiceGUI's is `nicegui.client.templates.env`.
        name: that of the template.

    Raises:
        ValueError: the environment has no loader.
    """
    from jinja2 import ChoiceLoader, DictLoader

    loader = environment.loader
    if loader is None:
        raise ValueError(f"the environment has no loader, so its template '{name}' cannot be signed")
    source, _, _ = loader.get_source(environment, name)
    environment.loader = ChoiceLoader([DictLoader({name: signed(source)}), loader])
    if environment.cache is not None:
        environment.cache.clear()
