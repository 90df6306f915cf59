"""The mission file that the package ships, as it is and with pieces of its text replaced."""

from pathlib import Path

from microrad.missionfile import load_mission

SHIPPED = Path(__file__).parent.parent / "missions" / "leo-geo.toml"


def edited_file(folder, *changes):
    """The shipped file with pieces of its text replaced, each of which occurs once, read from ``folder``."""
    text = SHIPPED.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


def edited(folder, *changes):
    """The mission of the edited file."""
    return edited_file(folder, *changes).mission
