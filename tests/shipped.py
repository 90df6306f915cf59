"""The mission file that the package ships, as it is and with pieces of its text replaced, and its study."""

from functools import cache
from pathlib import Path

import pytest

from microrad import study
from microrad.missionfile import load_mission

SHIPPED = Path(__file__).parent.parent / "missions" / "leo-geo.toml"


def without_fine_pointing(text):
    """A mission's text without its fine-pointing loop, which takes most of a study's time."""
    return text[: text.index("# ---", text.index("loop_amplitude = "))]


def without_day(text):
    """A mission's text without acquisition, orbits and what they deliver: a study of a second."""
    begin, end = (text.index(f"# {'-' * 97} {name}") for name in ("acquisition", "fast steering mirror"))
    return text[:begin] + text[end:]


@cache
def plain_study():
    """The study of the shipped mission but for its fine-pointing loop, once for all tests of a process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.fine_pointing, "run", lambda *args: None)
        return study.run(load_mission(SHIPPED))


@cache
def plain_drawn():
    """The figures of that study as its page holds them."""
    from microrad.report import day_plots, figures, link_figures, page, paper_bench  # not for those who draw nothing

    found = plain_study()
    return page.Drawn(
        figures.draw(found),
        paper_bench.draw(found),
        links=link_figures.draw(found.links),
        day=day_plots.draw(found.day, found.contact),
    )


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
