"""Whether the package's files are those that were released: what is held against what, and how it is said."""

import base64
import hashlib
import subprocess
from types import SimpleNamespace

import pytest

from microrad.core import integrity
from microrad.core.integrity import Integrity

MANY = tuple(f"{k}.py" for k in range(7))


@pytest.mark.parametrize(
    ("found", "whole", "text"),
    [
        (Integrity("record of the wheel"), True, "Against the record of the wheel: every file as recorded."),
        (Integrity("commit 1", changed=("a.py",)), False, "Against the commit 1: 1 changed (a.py)."),
        (
            Integrity("commit 1", missing=("b.py", "c.py"), added=("d.py",)),
            False,
            "Against the commit 1: 2 missing (b.py, c.py); 1 added (d.py).",
        ),
        (
            Integrity("commit 1", added=MANY),
            False,
            "Against the commit 1: 7 added (0.py, 1.py, 2.py, 3.py, 4.py and 2 more).",
        ),
        (
            Integrity("commit 1", versions=("numpy 1 (tested: 2)", "scipy 3 (tested: 4)")),
            False,
            "Against the commit 1: every file as recorded. Not the tested version: numpy 1 (tested: 2), "
            "scipy 3 (tested: 4).",
        ),
        (
            Integrity("", versions=("numpy 1 (tested: 2)",)),
            False,
            "The files of the package could not be held against anything: there is no record of them.",
        ),
    ],
)
def test_files_are_whole_where_none_and_no_library_differs(found, whole, text):
    assert (found.whole, found.text) == (whole, text)


def test_files_are_held_against_the_record_of_their_wheel(tmp_path, monkeypatch):
    monkeypatch.setattr(integrity, "_PACKAGE", tmp_path)
    (tmp_path / "core" / "__pycache__").mkdir(parents=True)
    for name in ("same.py", "core/changed.py", "new.py", "core/__pycache__/same.txt", "compiled.pyc"):
        (tmp_path / name).write_text(name, encoding="utf-8")

    def recorded(text):
        return base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).decode().rstrip("=")

    record = {"same.py": recorded("same.py"), "core/changed.py": recorded("other"), "gone.py": recorded("gone.py")}
    found = integrity._against_record(record)
    assert found == Integrity("record of the wheel", ("core/changed.py",), ("gone.py",), ("new.py",))


def test_files_are_held_against_the_last_commit(monkeypatch):
    lines = [" M src/microrad/b.py", "M  src/microrad/a.py", " D src/microrad/gone.py", "D  src/microrad/also.py"]
    lines += ["?? src/microrad/new.py", "A  src/microrad/staged.py"]
    monkeypatch.setattr(integrity, "_git", lambda *words: "abc\n" if words[0] == "rev-parse" else "\n".join(lines))
    assert integrity._against_commit() == Integrity(
        "commit abc", ("a.py", "b.py", "staged.py"), ("also.py", "gone.py"), ("new.py",)
    )


@pytest.mark.parametrize(
    "error", [OSError("no git"), subprocess.CalledProcessError(128, "git"), subprocess.TimeoutExpired("git", 60)]
)
def test_without_a_commit_there_is_nothing_to_hold_them_against(monkeypatch, error):
    def broken(*words):
        raise error

    monkeypatch.setattr(integrity, "_git", broken)
    assert integrity._against_commit() == Integrity("")


@pytest.mark.parametrize(
    ("recorded", "repository", "against"),
    [({"a.py": "x"}, True, "record of the wheel"), ({}, True, "commit 1"), ({}, False, "")],
)
def test_a_wheel_is_held_against_its_record_and_a_source_against_its_commit(
    tmp_path, monkeypatch, recorded, repository, against
):
    if repository:
        (tmp_path / ".git").mkdir()
    monkeypatch.setattr(integrity, "_PROJECT", tmp_path)
    monkeypatch.setattr(integrity, "_recorded", lambda: recorded)
    monkeypatch.setattr(integrity, "_against_record", lambda record: Integrity("record of the wheel"))
    monkeypatch.setattr(integrity, "_against_commit", lambda: Integrity("commit 1"))
    monkeypatch.setattr(integrity, "other_versions", lambda: {"numpy": "numpy 1 (tested: 2)", "other": "other 1"})
    assert integrity.integrity() == Integrity(against, versions=("numpy 1 (tested: 2)",))
    monkeypatch.setattr(integrity, "other_versions", lambda: None)
    assert integrity.integrity() == Integrity(against)


def test_versions_are_those_that_differ_from_the_tested_ones(tmp_path, monkeypatch):
    first, second = tmp_path / "in_the_wheel.txt", tmp_path / "of_the_source.txt"
    monkeypatch.setattr(integrity, "_CONSTRAINTS", (first, second))
    assert integrity.other_versions() is None and not integrity.from_source()
    installed = {"numpy": "2.0", "scipy": "1.1"}

    def version(name):
        if name not in installed:
            raise integrity.metadata.PackageNotFoundError(name)
        return installed[name]

    monkeypatch.setattr(integrity.metadata, "version", version)
    second.write_text("numpy==2.0\nscipy==1.2\nabsent==3\n", encoding="utf-8")
    assert integrity.other_versions() == {"scipy": "scipy 1.1 (tested: 1.2)"} and integrity.from_source()
    first.write_text("numpy==2.1\n", encoding="utf-8")
    assert integrity.other_versions() == {"numpy": "numpy 2.0 (tested: 2.1)"}


class Recorded:
    """A line of a wheel's record, as the library for metadata gives it."""

    def __init__(self, path, digest, mode, root):
        self.parts, self.place = tuple(path.split("/")), root / path
        self.hash = digest and SimpleNamespace(mode=mode, value=digest)

    def locate(self):
        return self.place


def test_of_a_record_the_digests_of_the_packages_own_files_count(tmp_path, monkeypatch):
    lines = [
        ("microrad/a.py", "1", "sha256", tmp_path),
        ("microrad/core/b.py", "2", "sha256", tmp_path),
        ("microrad/old.py", "3", "md5", tmp_path),
        ("microrad/none.py", None, "", tmp_path),
        ("microrad-1.dist-info/METADATA", "4", "sha256", tmp_path),
        ("microrad/elsewhere.py", "5", "sha256", tmp_path / "another"),  # of another copy than the one that runs
    ]
    monkeypatch.setattr(integrity, "_PACKAGE", tmp_path / "microrad")
    monkeypatch.setattr(integrity.metadata, "files", lambda name: [Recorded(*line) for line in lines])
    assert integrity._recorded() == {"a.py": "1", "core/b.py": "2"}
    monkeypatch.setattr(integrity.metadata, "files", lambda name: None)
    assert integrity._recorded() == {}

    def absent(name):
        raise integrity.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(integrity.metadata, "files", absent)
    assert integrity._recorded() == {}


@pytest.mark.parametrize(
    ("count", "said"),
    [(5, "0.py, 1.py, 2.py, 3.py, 4.py"), (6, "0.py, 1.py, 2.py, 3.py, 4.py and 1 more")],
)
def test_five_files_are_named_and_the_others_counted(count, said):
    found = Integrity("commit 1", missing=MANY[:count], added=("new.py",))
    assert found.text == f"Against the commit 1: {count} missing ({said}); 1 added (new.py)."


def test_libraries_of_other_versions_stand_in_the_order_of_the_libraries(monkeypatch):
    others = {"sgp4": "sgp4 9", "other": "other 1", "scipy": "scipy 3", "numpy": "numpy 1"}
    monkeypatch.setattr(integrity, "_recorded", lambda: {"a.py": "x"})
    monkeypatch.setattr(integrity, "_against_record", lambda record: Integrity("record of the wheel", tuple(record)))
    monkeypatch.setattr(integrity, "other_versions", lambda: others)
    found = integrity.integrity()
    assert found == Integrity("record of the wheel", ("a.py",), versions=("numpy 1", "scipy 3", "sgp4 9"))


def test_version_control_is_asked_for_each_new_file_of_the_package_alone(tmp_path, monkeypatch):
    """A file of a new folder by its own name, one that is ignored and one beside the package not at all."""

    def git(*words):
        person = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
        subprocess.run(["git", *person, *words], cwd=tmp_path, check=True, capture_output=True)

    package = tmp_path / "src" / "microrad"
    (package / "new").mkdir(parents=True)
    for name in ("same.py", "changed.py", "gone.py"):
        (package / name).write_text(name, encoding="utf-8")
    (tmp_path / ".gitignore").write_text("*.pyc\n", encoding="utf-8")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "all")
    (package / "changed.py").write_text("other", encoding="utf-8")
    (package / "gone.py").unlink()
    for name in ("new/one.py", "new/two.py", "new/one.pyc", "../beside.py"):
        (package / name).write_text("new", encoding="utf-8")
    monkeypatch.setattr(integrity, "_PROJECT", tmp_path)
    found = integrity._against_commit()
    assert (found.changed, found.missing, found.added) == (("changed.py",), ("gone.py",), ("new/one.py", "new/two.py"))
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert found.against == f"commit {head[:12]}"
