"""The paper's mission as the package ships it, as it is and with pieces of its text replaced, and its study."""

from functools import cache

import pytest

from microrad import report
from microrad.mission.file import load_mission
from microrad.study import study
from places import ROOT
from shared import once

MISSIONS = ROOT / "missions"
SHIPPED, DEFAULT = MISSIONS / "paper.toml", MISSIONS / "leo-geo.toml"
"""The paper's mission, which most tests are about, and the one that `microrad init` writes."""


RUN_STUDY = study.run_study
"""The study itself, whatever a test has put in its place."""


def without_fine_pointing(text):
    """A mission's text without its fine-pointing loop, which takes most of a study's time."""
    return text[: text.index("# ---", text.index("loop_amplitude = "))]


def links_alone(text):
    """The links of a mission's text, up to its acquisition, as a file of their own."""
    links = text[: text.index(f"# {'-' * 97} orbits")].splitlines(keepends=True)
    return "".join(line for line in links if not line.startswith(("residual", "mirror_angle")))


def without_day(text):
    """A mission's text without acquisition, orbits and what they deliver: a study of a second."""
    begin, end = (text.index(f"# {'-' * 97} {name}") for name in ("acquisition", "fast steering mirror"))
    return text[:begin] + text[end:]


@cache
def whole_study():
    """The whole study of the shipped mission, and what it said of its progress; once for all tests."""
    said = []
    return once(
        "whole study", lambda: (study.run_study(load_mission(SHIPPED), lambda *message: said.append(message)), said)
    )


@cache
def plain_study():
    """The study of the shipped mission but for its fine-pointing loop; once for all tests."""

    def run():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(study.controller_study, "design_and_simulate", lambda *args, **more: None)
            return study.run_study(load_mission(SHIPPED))

    return once("plain study", run)


@cache
def default_study():
    """The whole study of the mission that `microrad init` writes, without the paper's claims; once for all tests."""

    def run():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(study.paper, "applies", lambda mission: False)
            return RUN_STUDY(load_mission(DEFAULT))

    return once("default study", run)


@cache
def whole_drawn():
    """The figures of the whole study as its page holds them; once for all tests."""
    return once("whole drawn", lambda: report.study_figures(whole_study()[0]))


@cache
def plain_drawn():
    """The figures of that study as its page holds them; once for all tests."""
    return once("plain drawn", lambda: report.study_figures(plain_study()))


def edited_file(folder, *changes, whole=False, day=True):
    """The shipped file with pieces of its text replaced, each of which occurs once, read from ``folder``.

    Its fine-pointing loop is cut off unless it is wanted ``whole``, and its ``day`` where that is not wanted.
    """
    text = SHIPPED.read_text(encoding="utf-8")
    text = text if whole else without_fine_pointing(text)
    text = text if day else without_day(text)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


def edited(folder, *changes):
    """The mission of the edited file."""
    return edited_file(folder, *changes).mission
