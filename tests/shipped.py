"""The mission file that the package ships, as it is and with pieces of its text replaced."""

from pathlib import Path

from microrad.missionfile import load_mission

SHIPPED = Path(__file__).parent.parent / "missions" / "leo-geo.toml"


def without_fine_pointing(text):
    """A mission's text without its fine-pointing loop, which takes most of a study's time."""
    return text[: text.index("# ---", text.index("loop_amplitude = "))]


def edited_file(folder, *changes, whole=False):
    """The shipped file with pieces of its text replaced, each of which occurs once, read from ``folder``.

    Its fine-pointing loop is cut off unless it is wanted ``whole``.
    """
    text = SHIPPED.read_text(encoding="utf-8")
    text = text if whole else without_fine_pointing(text)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


def edited(folder, *changes):
    """The mission of the edited file."""
    return edited_file(folder, *changes).mission
