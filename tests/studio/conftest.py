"""What most tests of the studio's pages begin with."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from microrad.mission.file import load_link
from microrad.studio.draft import draft
from microrad.studio.session import Session
from shipped import SHIPPED


@cache
def shipped_link():
    """The paper's mission as it is read for its links, which no test changes."""
    return load_link(SHIPPED)


@pytest.fixture
def session(tmp_path, monkeypatch):
    """The paper's mission, saved; as long as its text is that of the package it is not read anew."""

    def read(path, *, text=None):
        known = shipped_link()
        return replace(known, path=Path(path)) if text == known.text else load_link(path, text=text)

    monkeypatch.setattr(draft, "load_link", read)
    (tmp_path / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())
    return Session(tmp_path)
