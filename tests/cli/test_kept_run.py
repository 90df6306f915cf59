"""The command run beside what earlier runs have kept, and beside files that change while it runs."""

import hashlib
import json
import os
import re
from types import SimpleNamespace

import pytest

from microrad import report
from microrad.core.kept import Kept
from microrad.loop.controller_study import scenario
from microrad.mission import file as missionfile
from microrad.mission.file import NamedFile, load_mission, with_contents
from microrad.orbit import day
from microrad.report.study.page import StudyFigures
from microrad.study import study
from shipped import SHIPPED

ELEMENTS = """EXAMPLE 1
1 70001U 26001A   26078.50000000  .00000000  00000-0  00000-0 0  9995
2 70001  97.4000 100.0000 0001000  90.0000   0.0000 15.20000000    10
"""
SPECTRUM = "Hz, urad^2/Hz\n0.1, 100\n10, 1\n1000, 0.0001\n"
REWRITTEN = {
    "mission.toml": ('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"'),
    "leo.tle": ("15.20000000    10", "15.30000000    11"),
    "shake.csv": ("10, 1\n", "10, 4\n"),
    "mirror.toml": ("name = ", "# another mirror\nname = "),
}


def mission_text():
    """The shipped mission with its elements, its vibration and its mirror in files, and quicker."""
    text = SHIPPED.read_text(encoding="utf-8")
    begin, end = text.index("[mirror]\n"), text.index("[amplifier]\n")
    mirror = text[begin:end].removeprefix("[mirror]\n").replace("[mirror.", "[")
    text = text[:begin] + '[mirror]\nfile = "mirror.toml"\n\n' + text[end:]
    begin, end = text.index("[constellation]"), text.index("[mirror]")
    text = text[:begin] + text[end:]
    elements = '[orbit.leo]\nkind = "elements"\nfile = "leo.tle"\n\n'
    text = re.sub(r"(?ms)^\[orbit\.leo\]\n.*?(?=^\[)", elements, text)
    text = text.replace('\nspectrum = "olympus"', '\nspectrum = "table"\nfile = "shake.csv"', 1)
    text = text.replace('duration = "24 h"', 'duration = "3 h"').replace("runs = 4000", "runs = 100")
    return {"mission.toml": text, "leo.tle": ELEMENTS, "shake.csv": SPECTRUM, "mirror.toml": mirror}


TEXTS = mission_text()


SEEN = []


def shaken(scene, on_progress):
    """In place of the fine-pointing loop, which takes most of a study's time: what it has read of the vibration."""
    SEEN.append(scene.loop.disturbances[0][0])


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Without what takes long and reads no file; a page has no figures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.controller_study, "design_and_simulate", shaken)
        patch.setattr(
            scenario.disturbance,
            "fit_table",
            lambda freq_hz, density, **_: SimpleNamespace(disturbance=density.tolist()),
        )
        patch.setattr(study.paper, "applies", lambda mission: False)
        patch.setattr(study.alternatives, "other_readings", lambda *args: ())
        patch.setattr(day, "swings", lambda *args: ())
        patch.setattr(report, "study_figures", lambda *args: StudyFigures())
        yield


@pytest.fixture
def files(folder, monkeypatch):
    """The current folder with the mission and what it names, and a place for parts that are kept."""
    monkeypatch.delenv("MICRORAD_KEEP")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    SEEN.clear()
    for name, text in TEXTS.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def rewrite(folder):
    for name, (old, new) in REWRITTEN.items():
        text = TEXTS[name]
        assert text.count(old) == 1, name
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def delete(folder):
    for name in TEXTS:
        (folder / name).unlink()


def manifest_of(call, output, *more):
    """What a run says of its files, and its numbers."""
    assert call("run", "mission.toml", "--output", output, *more).code in (0, 1)
    return json.loads((output / "manifest.json").read_text("utf-8"))


@pytest.mark.promise("report-4", "report-14")
@pytest.mark.parametrize("change", [pytest.param(rewrite, marks=pytest.mark.endurance), delete])
def test_a_run_is_of_what_was_read(call, files, monkeypatch, change):
    run, meanwhile = study.run_study, []

    def changing(file, on_progress, parts):
        return run(file, lambda *said: meanwhile or meanwhile.append(change(files)), parts)

    with monkeypatch.context() as patch:
        patch.setattr(study, "run_study", changing)
        changed = manifest_of(call, files / "changed")
    assert len(meanwhile) == 1
    said = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in TEXTS.items()}
    assert changed["inputs_sha256"] == {name: said[name] for name in ("leo.tle", "shake.csv")}
    assert changed["inputs"] == {name: TEXTS[name] for name in ("leo.tle", "shake.csv")}
    for key, name in (("mission", "mission.toml"), ("mirror", "mirror.toml")):
        assert (changed[key]["sha256"], changed[key]["text"]) == (said[name], TEXTS[name])
    if change is rewrite:  # and a later run is of the files as they are now, whatever the one before has kept
        later = manifest_of(call, files / "later")
        assert later["inputs"] == {name: (files / name).read_text("utf-8") for name in ("leo.tle", "shake.csv")}
        assert later["summary"]["day"] != changed["summary"]["day"]
        assert [density[1] for density in SEEN] == [1e-12, 4e-12]
    else:
        result = call("reproduce", files / "changed")
        assert (result.code, "nothing differs (" in result.out) == (0, True)
        assert [density[1] for density in SEEN] == [1e-12, 1e-12]


def touched(folder):
    """Each file in a folder with its bytes and when it was used last: taking a part notes that."""
    return {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.promise("report-1", "report-4", "report-5", "report-22")
def test_a_fresh_run_and_reproduce_take_and_keep_nothing(call, files, monkeypatch):
    cache = files / "cache"
    first = manifest_of(call, files / "first")
    made = touched(cache)
    assert len(made) > 2
    manifest_of(call, files / "second")
    assert len(SEEN) == 1
    used = touched(cache)
    assert used.keys() == made.keys()
    assert used != made
    assert manifest_of(call, files / "third", "--fresh") == first
    assert call("reproduce", files / "second").code == 0
    assert len(SEEN) == 3
    assert touched(cache) == used


def test_a_file_that_comes_meanwhile_is_part_of_no_kept_part(files):
    """What was not there to be read when the study began: its content is not known to what is kept."""
    for name in ("leo.tle", "shake.csv"):
        (files / name).rename(files / f"later-{name}")
    file = load_mission("mission.toml")

    def comes(*said):
        for name in ("leo.tle", "shake.csv"):
            if not (files / name).exists():
                (files / f"later-{name}").rename(files / name)

    parts = Kept(files / "parts")
    assert study.run_study(file, comes, parts).day is not None
    assert parts.trouble == ""
    assert list((files / "parts").rglob("*.part")) == []
    study.run_study(file, parts=parts)
    assert list((files / "parts").rglob("*.part")) != []


def test_what_is_no_file_or_too_large_is_not_taken_in(files, monkeypatch):
    """Whoever needs it says so, in the words of its own kind."""
    monkeypatch.setattr(missionfile, "MOST_NAMED_BYTES", 5)
    (files / "leo.tle").write_bytes(b"12345")
    file = load_mission("mission.toml")
    assert with_contents(file).contents == (NamedFile("leo.tle", b"12345"), NamedFile("shake.csv", None))
    (files / "leo.tle").unlink()
    os.mkfifo(files / "leo.tle")
    (files / "shake.csv").unlink()
    (files / "shake.csv").mkdir()
    assert [each.content for each in with_contents(file).contents] == [None, None]
    (files / "shake.csv").rmdir()
    (files / "shake.csv").write_text(SPECTRUM)
    with pytest.raises(ValueError, match=r"leo\.tle: this is a device or a pipe"):
        study.run_study(file)
