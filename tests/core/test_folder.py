"""What a file holds, read without a wait for one that never ends; what killed processes leave behind."""

import errno
import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from microrad.core import folder
from microrad.core.folder import read_bytes, scratch, whole_folder, write_whole

KILLED = """
import os, signal, sys
from pathlib import Path
from microrad.core.folder import scratch, whole_folder
with scratch("test") as one, whole_folder(Path(sys.argv[1]), False) as two:
    (one / "a").write_text("a")
    (two / "b").write_text("b")
    os.kill(os.getpid(), signal.SIGKILL)
"""
KILLED_BEFORE_ITS_FILE_IS_WHOLE = """
import os, signal, sys
from pathlib import Path
from microrad.core.folder import write_whole
os.fsync = lambda file: os.kill(os.getpid(), signal.SIGKILL)
write_whole(Path(sys.argv[1]), "a")
"""
REPLACING = """
import os, shutil, signal, sys
from pathlib import Path
from microrad.core.folder import whole_folder

def killed_at(call, of):
    def called(path, *rest, **how):
        if str(path).endswith(of):
            os.kill(os.getpid(), signal.SIGKILL)
        return call(path, *rest, **how)
    return called

if sys.argv[2] == "rename":
    Path.rename = killed_at(Path.rename, ".part")
else:
    shutil.rmtree = killed_at(shutil.rmtree, ".old")
with whole_folder(Path(sys.argv[1]), True):
    pass
"""


def test_as_many_bytes_as_are_asked_for(tmp_path):
    path = tmp_path / "whole"
    path.write_bytes(b"0123456789")
    assert [read_bytes(path, most) for most in (0, 3, 10, 11)] == [b"", b"012", b"0123456789", b"0123456789"]


@pytest.mark.skipif(os.name != "posix", reason="POSIX has pipes by name")
def test_a_file_whose_content_never_comes_is_refused_at_once(tmp_path):
    """As /proc/kmsg, a regular file by its mode."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with (
        os.fdopen(os.open(path, os.O_RDWR), "wb", buffering=0),
        pytest.raises(BlockingIOError, match="no file on disk"),
    ):
        read_bytes(path, 10)


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
def test_what_a_killed_process_left_is_gone_with_the_next_run(tmp_path, monkeypatch):
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", KILLED, tmp_path / "results"], env=environment, check=False)
    left = {path.name for path in tmp_path.iterdir()}
    assert len(left) == 2
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name in ("microrad-other", "results", "microrad-test-x-1-y"):
        (tmp_path / name).mkdir()
    kept = {"microrad-other", "results", "microrad-test-x-1-y"}
    with scratch("test") as own, scratch("test") as another, whole_folder(tmp_path / "results", False) as draft:
        own_names = {own.name, another.name, draft.name}
        assert {path.name for path in tmp_path.iterdir()} == own_names | kept  # its own are alive
        assert not left & own_names
    assert {path.name for path in tmp_path.iterdir()} == kept


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
@pytest.mark.parametrize("moment", ["rename", "rmtree"])
def test_what_a_replacement_that_was_killed_left_goes_once_there_is_another_in_its_place(tmp_path, moment):
    """Killed before the new one is in its place, or before the old one is removed."""
    results = tmp_path / "results"
    results.mkdir()
    (results / "manifest.json").write_text('{"versions": {"microrad": "0"}, "mission": 1, "a": "old"}', "utf-8")
    subprocess.run([sys.executable, "-c", REPLACING, results, moment], check=False)
    (left,) = tmp_path.glob(".*.old")
    assert '"old"' in (left / "results" / "manifest.json").read_text("utf-8")  # until then it is all that there is
    assert results.exists() == (moment == "rmtree")
    for name in (".results-other.old", ".else-x-1-y.old"):
        (tmp_path / name).mkdir()
    with pytest.raises(KeyError), whole_folder(results, True):
        raise KeyError
    assert left.exists()
    with whole_folder(results, True) as draft:
        (draft / "b").write_text("b")
        assert left.exists()
    assert {path.name for path in tmp_path.iterdir()} == {"results", ".results-other.old", ".else-x-1-y.old"}
    assert [path.name for path in results.iterdir()] == ["b"]


def test_old_results_are_put_back_where_new_ones_cannot_be_moved_into_their_place(tmp_path, monkeypatch):
    results, rename = tmp_path / "results", Path.rename
    results.mkdir()
    (results / "manifest.json").write_text('{"versions": {"microrad": "0"}, "mission": 1}', "utf-8")

    def refused(path, target):
        if path.suffix == ".part":
            raise PermissionError(13, "Permission denied", str(target))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refused)
    with pytest.raises(PermissionError), whole_folder(results, True) as draft:
        (draft / "b").write_text("b")
    assert [path.name for path in tmp_path.rglob("*")] == ["results", "manifest.json"]


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
def test_only_folders_of_the_same_user_are_taken_for_left_behind(tmp_path, monkeypatch):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder")
    assert folder._left_behind(tmp_path / "folder", gone.pid)
    assert not folder._left_behind(tmp_path / "folder", os.getpid())
    assert not folder._left_behind(tmp_path / "link", gone.pid)
    assert not folder._left_behind(tmp_path / "lost", gone.pid)
    monkeypatch.setattr(os, "getuid", lambda: -1)
    assert not folder._left_behind(tmp_path / "folder", gone.pid)


def test_two_threads_write_into_one_folder_at_once(tmp_path, monkeypatch):
    failed, begun = [], []

    def other():
        try:
            write_whole(tmp_path / "b", "of the other")
        except OSError as error:
            failed.append(error)

    def sync(file):
        if not begun:  # half way through the first file
            begun.append(threading.Thread(target=other))
            begun[0].start()
            begun[0].join()

    monkeypatch.setattr(folder.os, "fsync", sync)
    write_whole(tmp_path / "a", "of the first")
    assert failed == []
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "of the first", "b": "of the other"}


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
def test_the_draft_of_a_killed_process_is_gone_with_the_next_file_beside_it(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED_BEFORE_ITS_FILE_IS_WHOLE, tmp_path / "a"], check=False)
    assert [path.suffix for path in tmp_path.iterdir()] == [folder.DRAFT]
    write_whole(tmp_path / "b", "b")
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


FULL = OSError(errno.ENOSPC, "No space left on device")


def failing(*args):
    raise FULL


def test_an_error_names_the_file_that_was_to_be_written_and_leaves_the_old_one(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")
    monkeypatch.setattr(folder.os, "fsync", failing)
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(tmp_path / "a", "new")
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(tmp_path / "a"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "old"}


def test_an_error_in_a_folder_names_the_place_in_the_folder(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, whole_folder(tmp_path / "results", False) as draft:
        (draft / "figures" / "a").write_text("a")
    assert caught.value.filename == str(tmp_path / "results" / "figures" / "a")
    with pytest.raises(OSError, match="No space left") as caught, scratch("test") as place:
        failing()
    assert caught.value.filename == str(place)


def test_a_file_has_its_mode_before_it_has_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(folder.Path, "chmod", failing)
    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "a", "new", mode=0o600)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(folder.os, "fsync", lambda file: synced.append((os.fstat(file).st_ino, results.exists())))
    results = tmp_path / "results"
    with whole_folder(results, False) as draft:
        (draft / "figures").mkdir()
        for name in ("a", "figures/b"):
            (draft / name).write_text(name)
    assert sorted(synced) == sorted(((results / name).stat().st_ino, False) for name in ("a", "figures/b"))


def test_old_results_that_cannot_be_put_back_stay_aside(tmp_path, monkeypatch):
    results = tmp_path / "results"
    results.mkdir()
    (results / "manifest.json").write_text('{"versions": {"microrad": "0"}, "mission": 1}', "utf-8")
    rename = folder.Path.rename

    def once(path, target):
        if path != results:
            failing()
        return rename(path, target)

    monkeypatch.setattr(folder.Path, "rename", once)
    with pytest.raises(OSError, match="No space left"), whole_folder(results, True):
        pass
    (left,) = tmp_path.iterdir()
    assert [path.name for path in (left / "results").iterdir()] == ["manifest.json"]


def test_results_of_another_kind_are_not_replaced(tmp_path):
    (tmp_path / "manifest.json").write_text('{"versions": {"microrad": "0.2.0"}, "bench": {}}', "utf-8")
    folder.check_folder(tmp_path, overwrite=True, kind="bench")
    with pytest.raises(folder.FolderError, match="holds files that are not results of microrad"):
        folder.check_folder(tmp_path, overwrite=True, kind="mission")


def test_scratch_goes_with_the_error_that_ends_its_use():
    with pytest.raises(RuntimeError, match="broken"), scratch("test") as place:
        (place / "part").write_text("x")
        raise RuntimeError("broken")
    assert not place.exists()


def test_others_may_read_and_enter_a_folder_of_results_and_not_change_it(tmp_path):
    with whole_folder(tmp_path / "results", False) as draft:
        assert draft.stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "results").stat().st_mode & 0o777 == 0o755


def test_an_error_without_a_text_of_the_systems_keeps_its_own(tmp_path):
    with pytest.raises(OSError, match="the library says so") as caught, whole_folder(tmp_path / "results", False):
        raise OSError("the library says so")
    assert (caught.value.strerror, caught.value.filename) == ("the library says so", str(tmp_path / "results"))


def test_nothing_is_taken_for_left_behind_where_no_process_can_be_asked_for(tmp_path, monkeypatch):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / "folder").mkdir()
    monkeypatch.setattr(folder.os, "name", "nt")
    assert not folder._left_behind(tmp_path / "folder", gone.pid)


OTHERS = "holds files that are not a day of microrad: choose another --output"
OF_A_DAY = {"manifest.json": '{"versions": {"microrad": "1"}, "day": 1}'}
OF_ANOTHER = {"manifest.json": '{"versions": {"numpy": "1"}, "day": 1}'}
THERE = "already holds a day: choose another --output, or replace them with --overwrite"


@pytest.mark.parametrize(
    ("holds", "overwrite", "said"),
    [
        (None, False, None), ({}, False, None), ({"x": "1"}, True, OTHERS), (OF_A_DAY, True, None),
        (OF_A_DAY, False, THERE), (OF_ANOTHER, True, OTHERS), ({"manifest.json": "[1]"}, True, OTHERS),
        ("a file", True, "is a file, not a folder: choose another --output"),
    ],
)  # fmt: skip
def test_a_folder_is_replaced_where_it_is_none_or_empty_or_holds_what_it_is_to_hold(tmp_path, holds, overwrite, said):
    place = tmp_path / "day"
    if isinstance(holds, str):
        place.write_text(holds, "utf-8")
    elif holds is not None:
        place.mkdir()
        for name, text in holds.items():
            (place / name).write_text(text, "utf-8")
    if said is None:
        folder.check_folder(place, overwrite, "day", "a day")
        return
    with pytest.raises(folder.FolderError) as refused:
        folder.check_folder(place, overwrite, "day", "a day")
    assert str(refused.value) == f"{place} {said}"


def test_an_error_of_a_file_elsewhere_names_that_file_and_one_of_the_draft_its_place(tmp_path):
    draft, place = tmp_path / "draft", tmp_path / "place"
    for at, named in ((tmp_path / "draft2" / "x", tmp_path / "draft2" / "x"), (draft / "a" / "b", place / "a" / "b"),
                      (draft, place), (os.fsencode(draft / "c"), place / "c")):  # fmt: skip
        with pytest.raises(OSError) as caught, folder.naming(draft, place):
            raise OSError(errno.ENOSPC, "full", at if isinstance(at, bytes) else str(at))
        assert (caught.value.errno, caught.value.strerror, caught.value.filename) == (errno.ENOSPC, "full", str(named))


@pytest.mark.parametrize(
    ("path", "argument"),
    [
        ("a b", "a b"),
        ("-a", "./-a"),
        ("--x/y", "./--x/y"),
        ("a/-b", "a/-b"),
        ("./-c", "./-c"),
        ("/-d", "/-d"),
        (".", "."),
    ],
)
def test_a_path_that_begins_like_an_option_is_led_by_its_folder(path, argument):
    assert folder.path_argument(Path(path)) == argument


@pytest.mark.parametrize(
    ("manifest", "kind", "ours"),
    [
        ('{"versions": {"microrad": "1"}, "mission": {}}', "mission", True),
        ('{"versions": {"microrad": "1"}, "mission": null}', "mission", True),
        ('{"versions": {"microrad": "1"}, "mission": {}}', "bench", False),
        ('{"versions": {"numpy": "1"}, "mission": {}}', "mission", False),
        ('{"versions": ["microrad"], "bench": 1}', "bench", True), ('{"mission": {}}', "mission", False),
        ('{"versions": 3, "mission": {}}', "mission", False), ('[{"versions": {}}]', "mission", False),
        ("", "mission", False),
        ('{"versions": {"microrad"', "mission", False), ("\xff", "mission", False), ("null", "mission", False),
        ("[" * 100_000, "mission", False),
    ],
)  # fmt: skip
def test_a_folder_is_ours_by_the_versions_and_the_kind_of_its_manifest(tmp_path, manifest, kind, ours):
    (tmp_path / "manifest.json").write_bytes(manifest.encode("latin-1"))
    said = f"{tmp_path} already holds parts" if ours else f"{tmp_path} holds files that are not parts of microrad"
    end = ", or replace them with --overwrite" if ours else ""
    with pytest.raises(folder.FolderError) as refused:
        folder.check_folder(tmp_path, False, kind, "parts")
    assert str(refused.value) == f"{said}: choose another --output{end}"


@pytest.mark.parametrize(
    ("content", "mode", "held"),
    [
        ("a\r\nµ", None, b"a\r\n\xc2\xb5"),
        (b"\x00\xff", 0o600, b"\x00\xff"),
        ("", 0o640, b""),
        ("x" * 99, 0o444, b"x" * 99),
    ],
)
def test_a_file_is_written_with_its_line_ends_and_its_mode_in_place_of_another(tmp_path, content, mode, held):
    path = tmp_path / "a.txt"
    path.write_text("old")
    for durable in (True, False):
        write_whole(path, content, durable=durable, mode=mode)
        assert (path.read_bytes(), [*tmp_path.iterdir()]) == (held, [path])
        assert mode is None or path.stat().st_mode & 0o777 == mode


def test_a_draft_beside_a_file_goes_whatever_it_has_become(tmp_path):
    for make in (Path.touch, Path.mkdir, lambda draft: None):
        with folder.draft_beside(tmp_path / "a") as draft:
            assert (draft.parent, draft.suffix) == (tmp_path, folder.DRAFT)
            make(draft)
        assert not [*tmp_path.iterdir()]
    with folder.whole_file(tmp_path / "b") as draft:
        draft.write_text("b")
    assert (tmp_path / "b").read_text() == "b"


@pytest.fixture
def processes(monkeypatch):
    """Answers to who asks for a process: none has the number 1 to 99, those from 100 on are another user's or live."""

    def asked(process, signal):
        assert signal == 0
        if process < 100:
            raise ProcessLookupError(errno.ESRCH, "No such process")
        if process < 200:
            raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(folder.os, "kill", asked)


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
@pytest.mark.parametrize(("process", "gone"), [(7, True), (150, False), (250, False)])
def test_a_process_of_another_user_is_there_and_what_is_no_file_or_folder_is_nobodys(
    tmp_path, processes, process, gone
):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("x")
    os.mkfifo(tmp_path / "pipe")
    found = [folder._left_behind(tmp_path / name, process) for name in ("folder", "file", "pipe")]
    assert found == [gone, gone, False]


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
@pytest.mark.parametrize("name", ["results", ".a+b (1)", "x.y"])
def test_all_that_gone_processes_left_of_a_name_goes_and_nothing_of_another_name(tmp_path, processes, name):
    """What cannot be asked for, or lives, ends no search for the others."""
    begin = folder._on_this_machine(name)
    gone = [f"{begin}{process}-a_{process}.old" for process in (1, 7, 99)]
    stay = [f"{begin}{process}-ab.old" for process in (100, 150, 250)]
    stay += [f"{begin}7-abxold", f"{begin}7-ab.old2", f"{begin}7-ab", f"{begin}7-a-b.old", f"{begin}-ab.old"]
    stay += [f"{begin}1234567890-ab.old", f"{begin}x7-ab.old", f"x{begin}7-ab.old", f"{begin.upper()}7-ab.old"]
    stay += ["resultss-7-ab.old", f"{name}-7-ab.old", begin.replace(".", "_").replace("+", "aa") + "_7-ab.old"]
    for number, each in enumerate([*gone, *stay]):
        if number % 2:
            (tmp_path / each).mkdir()
            (tmp_path / each / "inside").write_text("x")
        else:
            (tmp_path / each).write_text("x")
    folder._sweep(tmp_path, name, ".old")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(stay)


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, PermissionError(13, "Permission denied")])
def test_old_results_are_put_back_whatever_ends_the_move_of_the_new_ones(tmp_path, monkeypatch, error):
    results, rename = tmp_path / "results", Path.rename
    results.mkdir()
    (results / "manifest.json").write_text('{"versions": {"microrad": "0"}, "mission": 1}', "utf-8")

    def ended(path, target):
        if path.suffix == ".part":
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", ended)
    with pytest.raises(error if isinstance(error, type) else PermissionError), whole_folder(results, True) as draft:
        (draft / "b").write_text("b")
    assert [path.name for path in tmp_path.rglob("*")] == ["results", "manifest.json"]
