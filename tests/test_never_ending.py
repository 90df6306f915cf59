"""Files whose content never comes, as /proc/kmsg: whoever names one, nothing waits for it."""

import os
from pathlib import Path

import pytest

from microrad.campaign import bundle
from microrad.cli import frame
from microrad.core.folder import FolderError, check_folder
from microrad.export.linear_import import matlab
from microrad.export.records import ExportError
from microrad.lab.bench import folder
from microrad.lab.bench.play import BenchError
from microrad.loop import disturbance
from microrad.mission import file as mission_file
from microrad.mission.file import MissionError
from microrad.report.results import manifest_reader
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.session import Session
from microrad.studio.views import compare as compare_view
from microrad.studio.views import runs as runs_view
from shipped import DEFAULT

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")

MISSING = "it is no file on disk: its content is not there yet"


@pytest.fixture
def never(tmp_path, monkeypatch):
    """Makes files that say they are regular ones, and of which nothing can be read yet."""
    held, asked = [], Path.is_file

    def make(name):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        os.mkfifo(path)
        held.append(os.open(path, os.O_RDWR))  # a writer, so that a reader waits
        return path

    monkeypatch.setattr(Path, "is_file", lambda path: path.is_fifo() or asked(path))
    yield make
    for each in held:
        os.close(each)


def of_campaign(path):
    return type("Campaign", (), {"files": (path,), "path": path.parent / "campaign.toml"})()


@pytest.mark.parametrize(
    ("name", "read", "refusal", "words"),
    [
        ("table.csv", disturbance.read_table, ValueError, f"cannot be read as text \\({MISSING}\\); save it as CSV"),
        (
            "report.html",
            manifest_reader.read_manifest,
            manifest_reader.ReproduceError,
            f"cannot be read: {MISSING}; name a report.html",
        ),
        (
            "manifest.json",
            manifest_reader.read_manifest,
            manifest_reader.ReproduceError,
            f"cannot be read: {MISSING}; name a report.html",
        ),
        ("model.mat", matlab.load, ExportError, f"cannot be read \\({MISSING}\\); check the path"),
        ("m.toml", Draft.open, MissionError, f"cannot be read: {MISSING}"),
        ("m.toml", lambda path: Draft.shipped(path).save(), DraftError, "cannot be written: it is no file on disk"),
        ("old/manifest.json", lambda p: check_folder(p.parent, True), FolderError, "are not results of microrad"),
        ("old/manifest.json", lambda p: folder.read_folder(p.parent), BenchError, "no manifest.json of microrad"),
        ("m.mat", lambda p: frame.check_target(p, "", overwrite=True, begins=b"MAT"), BlockingIOError, MISSING),
        (
            "a.csv",
            lambda p: manifest_reader.content_beside(manifest_reader.ReadManifest(p, {}, ""), p.name),
            BlockingIOError,
            MISSING,
        ),
        ("m.toml", lambda p: bundle.mission_sha256(of_campaign(p)), BlockingIOError, MISSING),
    ],
)
def test_a_file_that_never_comes_is_refused(never, name, read, refusal, words):
    with pytest.raises(refusal, match=words):
        read(never(name))


def test_what_never_comes_is_none_of_what_is_looked_for(never, tmp_path):
    (tmp_path / "leo-geo.toml").write_bytes(DEFAULT.read_bytes())
    never("old/manifest.json")
    session = Session(tmp_path)
    assert compare_view.finished_study(session, session.draft) is None
    assert not runs_view._of_campaign(never("c.toml"), 0, 0)
    assert mission_file._content(never("named.csv")) is None


def test_a_mission_that_names_a_spectrum_which_never_comes_is_refused(never, tmp_path, call):
    never("kmsg")
    text = DEFAULT.read_text("utf-8").replace('spectrum = "olympus"', 'spectrum = "table"\nfile = "kmsg"', 1)
    (tmp_path / "m.toml").write_text(text, "utf-8")
    result = call("design", tmp_path / "m.toml")
    assert (result.code, result.out) == (2, "")
    assert f"kmsg: the table cannot be read as text ({MISSING}); save it as CSV" in result.err
    assert {path.name for path in tmp_path.iterdir()} == {"kmsg", "m.toml"}
