"""A study with parts kept from another one: whatever key of the mission changes, its numbers are those without them."""

import re

import pytest

from microrad.core.kept import NOTHING, Kept
from microrad.loop.control import PI
from microrad.loop.fine_pointing import designs
from microrad.mission.file import MissionError, load_mission
from microrad.report import words
from microrad.study import story as study
from shipped import SHIPPED

SHORTER = {"runs": "4", "duration": '"0.5 s"', "settle": '"0.1 s"'}  # of the fine-pointing loop
NUMBER = re.compile(r"(?m)^(\w+ = )(\"?)(-?\d+(?:\.\d+)?)(?=[ \"\n])")
NAMED = ("leo_aperture",)
"""Keys that are changed here; every other one in `make endurance`."""


def shorter():
    whole = SHIPPED.read_text(encoding="utf-8")
    start = whole.index("[fine_pointing]")
    loop = whole[start:]
    for key, value in SHORTER.items():
        loop = re.sub(rf"(?m)^{key} = \S+( s\")?", f"{key} = {value}", loop, count=1)
    return re.sub(r"(?m)^runs = 4000", "runs = 100", whole[:start] + loop)


TEXT = shorter()


def changed():
    """Key and text with one number changed, by a hundredth or, where it is whole, by one; numbers in lists stay."""
    for found in NUMBER.finditer(TEXT):
        number = found[3]
        other = f"{float(number) * 1.01:.6g}" if "." in number or found[2] else str(int(number) + 1)
        yield found[1].split()[0], TEXT[: found.start(3)] + (other if float(number) else "1") + TEXT[found.end(3) :]


EVERY = list(changed())
FIRST = [next(each for each in EVERY if each[0] == key) for key in NAMED]
OTHERS = [each for each in EVERY if each not in FIRST]


@pytest.fixture(scope="module", autouse=True)
def one_controller():
    """The baseline and one more controller: what takes the time is tuning."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(designs, "families", lambda m: (PI,))
        patch.setattr(designs, "names", lambda m: (designs.BASELINE, PI.name))
        patch.setattr(study.paper, "PROPORTIONAL_V_MRAD", (1.0,))
        patch.setattr(study.paper, "INTEGRAL_V_MRAD_S", (8e3, 16e3))
        yield


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the parts of the unchanged mission."""
    folder = tmp_path_factory.mktemp("kept")
    numbers(TEXT, folder, Kept(folder / "parts"))
    assert len(list((folder / "parts").rglob("*.part"))) == 6
    return folder


def numbers(text, folder, parts):
    """Every number and word of a study's summary, or why there is none."""
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    try:
        return repr(words.summary(study.run(load_mission(path), parts=parts)))
    except (MissionError, ValueError) as error:
        return str(error)


@pytest.mark.parametrize(
    "text",
    [
        *(pytest.param(text, id=key) for key, text in FIRST),
        *(pytest.param(text, id=key, marks=pytest.mark.endurance) for key, text in OTHERS),
    ],
)
def test_a_changed_key_gives_the_numbers_of_a_study_without_kept_parts(text, place):
    with_parts, without = (numbers(text, place, parts) for parts in (Kept(place / "parts"), NOTHING))
    assert with_parts == without


def test_what_is_not_read_is_not_computed_again(place, monkeypatch):
    def computed(*args, **beside):
        pytest.fail("computed again")

    monkeypatch.setattr(designs, "tune", computed)
    monkeypatch.setattr(study.paper, "_point", computed)
    assert "requirements" in numbers(dict(EVERY)["leo_aperture"], place, Kept(place / "parts"))
