"""For tests of flight code."""

import os

import pytest

from microrad.export.flight import fixed


@pytest.fixture(autouse=True)
def short_rests(monkeypatch):
    """An eighth of the rest that limit cycles are looked for in: it is most of what a form in fixed point takes."""
    if not os.environ.get("MICRORAD_ENDURANCE"):
        monkeypatch.setattr(fixed, "_REST_SAMPLES", 512)
