"""Recordings dropped into the studio: odd names, floods and bombs are refused in words, and the studio goes on."""

import asyncio
import errno
import importlib
import io
import json
import math
import os
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat

from lab import test_recording_formats as formats
from microrad.lab.live_fit import extremes
from microrad.lab.recording import read_recording
from microrad.studio.guard import names
from microrad.studio.guard.names import NameRefusedError, safe_name, typed_words, within
from microrad.studio.recordings import process, reading
from microrad.studio.recordings import uploads as recording_uploads
from microrad.studio.recordings.reading import Columns, ReadingError, ReadingLimits, list_channels, view
from microrad.studio.recordings.uploads import UploadError, UploadLimits, Uploads
from waiting import HANG_S, gone, lines_of

posix = pytest.mark.skipif(os.name != "posix", reason="POSIX keeps modes and limits")
linux = pytest.mark.skipif(sys.platform != "linux", reason="the address space is bounded on Linux")

HTML = "<img src=x onerror=alert(1)>"
LIMITS = UploadLimits(file_bytes=1000, files=3, total_bytes=2500)


# -------------------------------------------------------------------------------------------------------------- names
@pytest.mark.parametrize(
    "name",
    [
        "run 7.csv",
        "Bode (2).tdms",
        "2026-01-02T10:11:12.npz",
        "µrad.csv",
        "名前.mat",
        f"{HTML}.csv",
        "-rf.csv",
        "a.b.c",
        "x",
    ],
)
@posix
def test_names_of_a_laboratory_are_taken_as_they_are(name):
    assert safe_name(name) == name


def test_a_decomposed_name_is_composed():
    assert safe_name("u\u0308.csv") == "\u00fc.csv"


@pytest.mark.promise("studio-22")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("../x.csv", "holds a path"),
        ("..", "holds a path|dot"),
        (".", "dot"),
        ("/etc/passwd", "holds a path"),
        ("..\\x.csv", "holds a path"),
        ("C:\\x.csv", "holds a path"),
        ("a/b.csv", "holds a path"),
        ("", "has no name"),
        ("   ", "has no name"),
        ("x\0.csv", "do not print"),
        ("x\n.csv", "do not print"),
        ("x\x1b[31m.csv", "do not print"),
        ("x\u202evsc.exe", "do not print"),
        ("x\ud800.csv", "do not print"),
        ("x\u2028.csv", "do not print"),
        (".bashrc", "dot"),
        (".part", "dot"),
        ("x.csv.", "dot"),
        ("x.csv ", "dot or a blank"),
        (" x.csv", "dot or a blank"),
        ("CON", "device"),
        ("nul.csv", "device"),
        ("Com7.tar.gz", "device"),
        ("LPT\u00b9.csv", "device"),
        ("aux .csv", "device"),
        ("x" * 161, "160 bytes"),
        ("µ" * 81, "160 bytes"),
    ],
)
def test_odd_names_are_refused_in_words(name, why):
    with pytest.raises(NameRefusedError, match=why) as caught:
        safe_name(name)
    message = str(caught.value)
    assert message.isprintable()
    assert "rename it" in message
    assert len(message) < 300


def test_names_beside_the_refused_ones_are_taken():
    for name in ("..x.csv"[2:], "x..csv", "console.csv", "com.csv", "com10.csv", "x" * 160, "µ" * 80):
        assert safe_name(name) == name


def test_a_long_name_is_shown_by_its_first_sixty_characters():
    assert names.shown(60 * "x") == f"'{60 * 'x'}'"
    assert names.shown(61 * "x") == f"'{60 * 'x'}...'"
    assert names.shown("") == "''"


@pytest.mark.parametrize("name", ["a<b", "a:b", "a?", "a*.csv", 'a"b', "a|b", "a>b"])
def test_windows_takes_some_characters_less(monkeypatch, name):
    assert safe_name(name) == name or os.name == "nt"
    monkeypatch.setattr(names, "os", SimpleNamespace(name="nt"))
    with pytest.raises(NameRefusedError, match=r'its name holds one of < > : " \| \? \*; rename it'):
        safe_name(name)
    assert safe_name("a-b.csv") == "a-b.csv"


@pytest.mark.promise("studio-22")
@posix
def test_paths_stay_within_their_folder(tmp_path):
    root, outside = tmp_path / "root", tmp_path / "outside.toml"
    (root / "sub").mkdir(parents=True)
    outside.touch()
    (root / "link.toml").symlink_to(outside)
    (root / "inner.toml").symlink_to(root / "sub")
    (root / "loop").symlink_to(root / "loop")
    for name in ("a.toml", "sub/a.toml", "sub/../a.toml", root / "a.toml", "inner.toml/a.toml", "."):
        assert within(root, name).is_relative_to(root.resolve())
    assert within(root, "sub/../a.toml") == root.resolve() / "a.toml"
    for name in ("../outside.toml", "sub/../../outside.toml", str(outside), "/etc/passwd", "link.toml", "../root2/a"):
        with pytest.raises(NameRefusedError, match="is outside of"):
            within(root, name)
    with pytest.raises(NameRefusedError, match="no path that can be opened"):
        within(root, "a\0b")


# ------------------------------------------------------------------------------------------------------------ storing
def blocks(*parts):
    async def stream():
        for part in parts:
            if isinstance(part, BaseException):
                raise part
            yield part

    return stream()


def save(uploads, name, *parts):
    return asyncio.run(uploads.save(name, blocks(*parts)))


def everything(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_a_recording_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    there = []
    monkeypatch.setattr(os, "fsync", lambda file: there.append([path.name for path in tmp_path.rglob("*.*")]))
    save(Uploads(tmp_path, LIMITS), "x.csv", b"1")
    assert there == [[".part"]]


@posix
def test_a_file_is_stored_as_it_came_for_its_owner_only(tmp_path):
    uploads = Uploads(tmp_path / "a" / "uploads", LIMITS)
    old = os.umask(0)
    try:
        first = save(uploads, f"{HTML}.csv", b"ab", b"", b"c" * 900)
    finally:
        os.umask(old)
    second = save(uploads, f"{HTML}.csv", b"2")
    assert first.path.read_bytes() == b"ab" + b"c" * 900
    assert (first.name, first.size, second.path.read_bytes()) == (f"{HTML}.csv", 902, b"2")
    assert [mode(p) for p in (uploads.folder, first.path.parent, first.path)] == [0o700, 0o700, 0o600]
    assert first.path.parent.parent == uploads.folder
    assert Uploads(uploads.folder).listed() == (first, second)  # a second tab, or after a new start
    assert uploads.get(second.key) == second
    uploads.remove(first.key)
    assert uploads.listed() == (second,)
    for key in (first.key, "", "..", second.key + "/..", "*"):
        for use in (uploads.get, uploads.remove):
            with pytest.raises(UploadError, match="drop the file again"):
                use(key)
    assert uploads.listed() == (second,)


@pytest.mark.promise("studio-20")
def test_a_file_over_the_limit_stops_the_sender_and_leaves_nothing(tmp_path):
    uploads = Uploads(tmp_path, LIMITS)
    sent = 0

    async def flood():
        nonlocal sent
        while True:
            sent += 300
            yield bytes(300)

    with pytest.raises(UploadError, match=r"'flood.csv' has more than 0.001 MB; cut out"):
        asyncio.run(uploads.save("flood.csv", flood()))
    assert (sent, everything(tmp_path)) == (1200, [])
    assert save(uploads, "just.csv", bytes(1000)).size == 1000


@pytest.mark.promise("studio-20")
def test_number_and_sum_of_the_files_are_bounded(tmp_path):
    uploads = Uploads(tmp_path, LIMITS)
    for k in range(2):
        save(uploads, f"{k}.csv", bytes(1000))
    with pytest.raises(UploadError, match=r"together may have 0.0025 MB; remove one first"):
        save(uploads, "third.csv", bytes(501))
    save(uploads, "third.csv", bytes(500))
    with pytest.raises(UploadError, match="3 recordings are here already; remove one first"):
        save(uploads, "fourth.csv", b"")
    assert [each.name for each in uploads.listed()] == ["0.csv", "1.csv", "third.csv"]
    uploads.remove(uploads.listed()[0].key)
    assert save(uploads, "fourth.csv", b"1").size == 1


def test_files_on_their_way_count(tmp_path):
    uploads = Uploads(tmp_path, replace(LIMITS, files=1))

    async def both():
        begun, gate = asyncio.Event(), asyncio.Event()

        async def slow():
            yield b"1"
            begun.set()
            await gate.wait()
            yield b"2"

        first = asyncio.create_task(uploads.save("slow.csv", slow()))
        await begun.wait()
        assert uploads.listed() == ()
        with pytest.raises(UploadError, match="1 recording is here already; remove one first"):
            await uploads.save("second.csv", blocks(b"1"))
        gate.set()
        return await first

    assert asyncio.run(both()).path.read_bytes() == b"12"


@pytest.mark.parametrize("fault", [ConnectionError("gone"), asyncio.CancelledError()])
def test_what_breaks_off_leaves_nothing(tmp_path, fault):
    uploads = Uploads(tmp_path, LIMITS)
    with pytest.raises((UploadError, asyncio.CancelledError)):
        save(uploads, "x.csv", b"1", fault)
    assert everything(tmp_path) == []


@pytest.mark.promise("studio-29")
def test_a_full_disk_is_said(tmp_path):
    with pytest.raises(UploadError, match=r"'x.csv' could not be stored: No space left on device"):
        save(Uploads(tmp_path, LIMITS), "x.csv", b"1", OSError(28, "No space left on device"))
    assert everything(tmp_path) == []


def test_a_fault_of_the_disk_without_a_number_is_said_in_its_own_words(tmp_path):
    with pytest.raises(UploadError, match=r"'x.csv' could not be stored: odd$"):
        save(Uploads(tmp_path, LIMITS), "x.csv", b"1", OSError("odd"))


def test_blocks_are_written_once_there_are_enough_of_them(tmp_path, monkeypatch):
    written, write = [], Uploads._write

    async def noted(self, file, name, waiting):
        written.append(bytes(waiting))
        await write(self, file, name, waiting)

    monkeypatch.setattr(recording_uploads, "_BLOCK_BYTES", 4)
    monkeypatch.setattr(Uploads, "_write", noted)
    found = save(Uploads(tmp_path, LIMITS), "x.csv", b"abc", b"d", b"efghi", b"j")
    assert written == [b"abcd", b"efghi", b"j"]
    assert (found.path.read_bytes(), found.size) == (b"abcdefghij", 10)
    assert Uploads(tmp_path).limits == UploadLimits() == UploadLimits(200_000_000, 20, 1_000_000_000)


@posix
def test_only_a_folder_with_a_key_for_its_name_is_the_place_of_a_recording(tmp_path):
    uploads = Uploads(tmp_path / "uploads", LIMITS)
    key, (other, linked, short) = save(uploads, "x.csv", b"1").key, ("0" * 16, "1" * 16, "2" * 15)
    (uploads.folder / other).write_bytes(b"a file")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "y.csv").write_bytes(b"2")
    (uploads.folder / linked).symlink_to(tmp_path / "elsewhere")
    (uploads.folder / short).mkdir()
    (uploads.folder / short / "z.csv").write_bytes(b"3")
    assert [each.key for each in uploads.listed()] == [key]
    assert uploads._total() == 1
    (uploads.folder / key / "x.csv").rename(uploads.folder / key / ".part")
    (uploads.folder / key / "folder").mkdir()
    assert uploads.listed() == ()


def test_a_disk_that_is_full_before_a_file_is_there_is_said(tmp_path):
    """The form around it is kept in a temporary file first."""
    pytest.importorskip("nicegui")
    from microrad.studio.pages.drop import Drop

    class Full:
        def form(self, **limits):
            raise OSError(28, "No space left on device")

    said = []
    drop = Drop.__new__(Drop)
    drop._refused = said.append
    asyncio.run(drop._take(Full()))
    assert said == ["the file could not be stored: No space left on device; check free space and permissions"]


def uploaded(tmp_path, monkeypatch, receive, turns=2):
    """What is said of an upload, by a field whose browser sends `receive`."""
    drop = pytest.importorskip("nicegui") and importlib.import_module("microrad.studio.pages.drop")
    said, taken = [], []
    field = drop.Drop.__new__(drop.Drop)
    field._uploads, field._refused = Uploads(tmp_path / "uploads", LIMITS), said.append

    async def take(upload):
        taken.append(upload.name)

    async def send():
        monkeypatch.setattr(drop, "_TURNS", asyncio.Semaphore(turns))  # of this loop
        head = [(b"content-type", b"multipart/form-data; boundary=b")]
        requests = [drop.Request({"type": "http", "headers": head}, each) for each in receive]
        await asyncio.gather(*map(field._take, requests))

    field._taken = take
    asyncio.run(send())
    return said, taken


FORM = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n1,2\r\n--b--\r\n'


def sender(*messages):
    """A browser that sends these, and then nothing for ever."""
    left = iter(messages)

    async def receive():
        for message in left:
            return message
        return await asyncio.Future()

    return receive


def body(data, more=False):
    return {"type": "http.request", "body": data, "more_body": more}


def test_an_upload_that_is_broken_off_is_no_fault_of_the_studio(tmp_path, monkeypatch):
    broken = sender(body(FORM[:40], more=True), {"type": "http.disconnect"})
    assert uploaded(tmp_path, monkeypatch, [broken, sender(body(FORM))], turns=1) == ([], ["a.csv"])
    assert len(everything(tmp_path / "uploads")) == 2  # the file in its folder


@pytest.mark.promise("studio-20")
def test_an_upload_that_hangs_is_ended_and_those_behind_it_are_not_read_before(tmp_path, monkeypatch):
    drop = pytest.importorskip("nicegui") and importlib.import_module("microrad.studio.pages.drop")
    read = []

    async def behind():
        read.append(len(list((tmp_path / "spool").iterdir())))
        return body(FORM)

    class Spooled(drop.Request):
        async def form(self, **limits):
            waiting = tmp_path / "spool" / str(id(self))
            waiting.touch()
            try:
                return await super().form(**limits)
            finally:
                waiting.unlink()

    (tmp_path / "spool").mkdir()
    monkeypatch.setattr(drop, "Request", Spooled)
    monkeypatch.setattr(drop, "_MOST_S", 0.3)
    hanging = [sender(body(FORM[:40], more=True)) for _ in range(2)]
    said, taken = uploaded(tmp_path, monkeypatch, [*hanging, behind])
    assert read in ([1], [2])  # on their way as the third is read, itself among them
    assert taken == ["a.csv"]
    assert [words[:62] for words in said] == ["the file is not taken: it was not here after 0.005 min; cut ou"] * 2


def test_a_bad_name_stores_nothing(tmp_path):
    uploads = Uploads(tmp_path / "in" / "ner", LIMITS)
    for name in ("../../x.csv", str(tmp_path / "x.csv"), ".part"):
        with pytest.raises(NameRefusedError):
            save(uploads, name, b"1")
    assert everything(tmp_path) == ["in", str(Path("in", "ner"))]


@posix
def test_the_folder_is_made_private_and_no_link(tmp_path):
    (tmp_path / "open").mkdir(mode=0o755)
    assert mode(Uploads(tmp_path / "open").folder) == 0o700
    (tmp_path / "link").symlink_to(tmp_path / "open")
    with pytest.raises(UploadError, match="is a link or belongs to somebody else"):
        Uploads(tmp_path / "link")
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "uploads"
    with pytest.raises(UploadError) as refusal:
        Uploads(folder)
    words = f"{folder} cannot be made or made private: Not a directory; choose another working folder"
    assert str(refusal.value) == words


@posix
def test_a_link_among_the_uploads_is_no_recording(tmp_path):
    """It came with the folder, and names a file elsewhere."""
    secret, uploads = tmp_path / "secret.csv", Uploads(tmp_path / "uploads", LIMITS)
    secret.write_text("1,2", "utf-8")
    planted = uploads.folder / ("0" * 16)
    planted.mkdir()
    (planted / "x.csv").symlink_to(secret)
    assert uploads.listed() == ()
    with pytest.raises(UploadError, match="drop the file again"):
        uploads.get(planted.name)
    (planted / "x.csv").unlink()
    secret.rename(planted / "x.csv")
    assert [each.key for each in uploads.listed()] == [planted.name]


def test_a_folder_that_was_removed_meanwhile_is_made_again(tmp_path):
    uploads = Uploads(tmp_path / "uploads", LIMITS)
    uploads.folder.rmdir()
    assert uploads.listed() == ()
    assert save(uploads, "x.csv", b"1").path.read_bytes() == b"1"
    shutil.rmtree(uploads.folder)
    uploads.folder.write_text("a file", "utf-8")
    with pytest.raises(UploadError, match=r"'x.csv' could not be stored: "):
        save(uploads, "x.csv", b"1")


def test_what_no_recording_is_in_is_cleared_away_at_the_start(tmp_path, monkeypatch):
    """Twenty of them, a minute old, and no recording could be dropped any more."""
    monkeypatch.setattr(tempfile, "tempdir", tempfile.gettempdir())
    uploads = Uploads(tmp_path, LIMITS)
    kept = save(uploads, "kept.csv", b"1")
    for key in "012":
        (tmp_path / (key * 16)).mkdir()
        (tmp_path / (key * 16) / ".part").touch()
    with pytest.raises(UploadError, match="4 recordings are here already; remove one first"):
        save(uploads, "x.csv", b"1")
    Uploads(tmp_path, LIMITS).hold_temporary_files()
    assert {p.name for p in tmp_path.iterdir()} == {kept.key, "spool"}
    assert save(uploads, "x.csv", b"1").size == 1


@pytest.mark.promise("studio-8")
def test_temporary_files_lie_in_the_private_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", tempfile.gettempdir())
    uploads = Uploads(tmp_path / "uploads", LIMITS)
    uploads.hold_temporary_files()
    with tempfile.NamedTemporaryFile() as file:
        assert Path(file.name).parent == uploads.folder / "spool"
        os.utime(file.name, (0, 0))
        left = Path(tempfile.mkdtemp())  # with a campaign's files, by a studio that was killed
        (left / "campaign.toml").touch()
        os.utime(left, (0, 0))
        (uploads.folder / "spool" / "new").touch()
        uploads.hold_temporary_files()
        assert [p.name for p in (uploads.folder / "spool").iterdir()] == ["new"]
        Path(file.name).touch()
    assert uploads.listed() == ()
    for _ in range(LIMITS.files):
        save(uploads, "x.csv", b"1")


# ------------------------------------------------------------------------------------------------------------ reading
N = 6000
TIME_S = np.arange(N) / 1000


@pytest.fixture(scope="module")
def loop():
    noise = np.random.Generator(np.random.Philox(1)).standard_normal(N)
    drive = 5 + 5 * np.sin(2 * np.pi * 7.3 * TIME_S)
    return drive, drive - 0.6 * np.cos(2 * np.pi * 7.3 * TIME_S) + 0.01 * noise


def csv(path, loop, names=("time", "drive (V)", "output (urad)")):
    np.savetxt(path, np.column_stack([TIME_S, *loop]), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def refused(path, columns=None, **limits):
    """The words that refuse a file, listed or read."""
    bounds = ReadingLimits(**limits)
    with pytest.raises(ReadingError) as caught:
        list_channels(path, bounds) if columns is None else view(path, columns, bounds)
    assert str(path.parent) not in str(caught.value)
    assert path.name in str(caught.value)
    return str(caught.value)


def test_channels_are_listed(tmp_path, loop):
    path = csv(tmp_path / f"{HTML}.csv", loop, ("time", HTML, "output (urad)"))
    found = list_channels(path)
    assert [c.name for c in found.channels] == ["time", HTML, "output (urad)"]
    assert [c.unit for c in found.channels] == ["", "", "urad"]
    assert (found.time, found.rates_hz) == (0, ())


def test_a_recording_is_read_checked_and_thinned(tmp_path, loop):
    path = csv(tmp_path / "loop.csv", loop)
    whole = read_recording(path, 1, 2)
    seen = view(path, Columns((1,), ("output (urad)",)), ReadingLimits(points=400))
    assert (seen.samples, seen.rate_hz) == (N, whole.rate_hz)
    assert list(seen.findings) == [f.message for f in whole.findings]
    rows = np.array(seen.rows)
    assert 200 <= len(rows) <= 4 * 200 + 2
    assert np.all(np.diff(rows) > 0)
    np.testing.assert_allclose(seen.drive[0], whole.drive[rows, 0], rtol=1e-6)
    np.testing.assert_allclose(seen.output[0], whole.output[rows, 0], rtol=1e-6)
    assert max(seen.output[0]) == pytest.approx(whole.output.max(), rel=1e-6)
    assert len(view(path, Columns((1,), (2,)), ReadingLimits(points=N)).rows) == N


def _matlab5(path):
    savemat(path, {"drive": formats.DRIVE, "output": formats.OUTPUT, "fs": formats.RATE_HZ})


def _npy(path):
    np.save(path, np.column_stack((formats.DRIVE, formats.OUTPUT)))


def _npz(path):
    np.savez(path, drive=formats.DRIVE, output=formats.OUTPUT)


def _text(path):
    np.savetxt(
        path, np.column_stack((formats.DRIVE, formats.OUTPUT)), delimiter=",", header="drive,output", comments=""
    )


@pytest.mark.parametrize(
    ("name", "write", "drive", "output"),
    [
        ("a.csv", _text, 0, 1),
        pytest.param("a.npy", _npy, 0, 1, marks=pytest.mark.endurance),
        ("a.npz", _npz, "drive", "output"),
        pytest.param("a.mat", _matlab5, "drive", "output", marks=pytest.mark.endurance),
        pytest.param(
            "b.mat",
            lambda path: formats.matlab73(path, drive=formats.DRIVE, output=formats.OUTPUT),
            "drive",
            "output",
            marks=pytest.mark.endurance,
        ),
        ("a.h5", formats.hdf5, "run/drive", "run/output"),
        ("a.tdms", formats.tdms, "bench/drive", "bench/output"),
        ("a.lvm", formats.lvm, "drive", "output"),
        pytest.param("b.lvm", partial(formats.lvm, segments=3), "drive", "output", marks=pytest.mark.endurance),
        ("c.lvm", partial(formats.lvm, segments=3, gap_s=0.1), "1/drive", "1/output"),
        ("d.lvm", partial(formats.lvm, x_columns="Multi", comment="started"), "drive", "output"),
    ],
)
def test_each_format_is_read_as_the_command_line_reads_it(tmp_path, name, write, drive, output):
    path = tmp_path / name
    write(path)
    whole = read_recording(path, drive, output, formats.RATE_HZ)
    listed = {c.name: c.samples for c in list_channels(path).channels}
    seen = view(path, Columns((drive,), (output,), rate_hz=formats.RATE_HZ), ReadingLimits(points=formats.N))
    stated = [listed[each] for each in (*whole.input_names, *whole.output_names)]
    assert stated == [None if name == "a.csv" else whole.samples] * 2
    assert (seen.samples, seen.rate_hz) == (whole.samples, whole.rate_hz)
    np.testing.assert_allclose(seen.output[0], whole.output[np.array(seen.rows), 0], rtol=1e-6, atol=0)


def test_refusals_are_those_of_the_reader(tmp_path, loop):
    path = csv(tmp_path / "loop.csv", loop)
    with pytest.raises(ValueError, match="no input column") as caught:
        read_recording(path, "nothing", 2)
    assert refused(path, Columns(("nothing",), (2,))) == str(caught.value).replace(str(path), "loop.csv")
    assert "give a sequence of jitter" in refused(path, Columns((1,), (2,), accept=("everything",)))
    assert "5 Hz" in refused(path, Columns((1,), (2,), rate_hz=5.0))
    empty = tmp_path / "empty.csv"
    empty.touch()
    assert "the file is empty" in refused(empty)


def test_many_channels_and_long_names_are_cut(tmp_path):
    path = tmp_path / "many.npz"
    np.savez(path, **{f"c{k}{'x' * 300}": np.arange(3.0) for k in range(30)})
    found = list_channels(path, ReadingLimits(channels=20))
    assert len(found.channels) == 20
    assert {len(c.name) for c in found.channels} == {200}
    assert [c.samples for c in found.channels] == [3] * 20


class Opened:
    """A pickle that leaves a trace when it is loaded."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return Path.touch, (Path(self.path),)


@pytest.mark.promise("studio-22")
@pytest.mark.parametrize("suffix", ["npy", "npz"])
def test_pickles_are_not_loaded(tmp_path, suffix):
    trace, path = tmp_path / "trace", tmp_path / f"evil.{suffix}"
    evil = np.array([Opened(trace) for _ in range(300)], dtype=object)
    (np.save if suffix == "npy" else np.savez)(path, evil)
    assert "Python objects" in refused(path)
    assert "Python objects" in refused(path, Columns((0,), (1,)))
    assert not trace.exists()
    np.load(path, allow_pickle=True)["arr_0"] if suffix == "npz" else np.load(path, allow_pickle=True)
    assert trace.exists()  # it would have


@pytest.mark.parametrize(
    ("names", "time"),
    [(("time", "u"), 0), (("u", "t [s]"), 1), (("u", "y"), None), (("Time", "time"), 0)],
)
def test_the_first_channel_that_is_plainly_time_is_told(tmp_path, names, time):
    (tmp_path / "a.csv").write_text(",".join(names) + "\n" + "1,2\n2,3\n" * 5, "utf-8")
    request = {"limits": {"samples": 100, "channels": 9}}
    found = process.channels(tmp_path / "a.csv", request)
    assert ([each["name"] for each in found["channels"]], found["time"], found["rates_hz"]) == ([*names], time, [])
    assert found["channels"][0]["samples"] is None
    request["limits"]["channels"] = 1
    assert len(process.channels(tmp_path / "a.csv", request)["channels"]) == 1


def test_rates_that_a_file_states_are_told_once_each_and_only_finite_ones(monkeypatch):
    rates = [100.0, 200.0, 100.0, math.inf, math.nan]
    source = SimpleNamespace(
        names=["a"] * 5,
        units=["V"] * 5,
        samples=lambda: [3] * 5,
        rates=lambda which: [SimpleNamespace(rate_hz=rates[k]) for k in which],
    )
    monkeypatch.setattr(process, "opened", lambda path, request: source)
    assert process.channels(Path("a"), {"limits": {"channels": 9}})["rates_hz"] == [100.0, 200.0]
    assert process.channels(Path("a"), {"limits": {"channels": 1}})["rates_hz"] == [100.0]


@posix
@pytest.mark.parametrize(("allowed", "soft", "hard"), [(-1, 20, 21), (20, 20, 20), (5, 5, 5), (100, 20, 21)])
def test_a_process_never_asks_for_more_than_the_system_lets_it(monkeypatch, allowed, soft, hard):
    resource, asked, alarms = pytest.importorskip("resource"), {}, []
    monkeypatch.setattr(resource, "getrlimit", lambda what: (0, allowed if what == resource.RLIMIT_CPU else -1))
    monkeypatch.setattr(resource, "setrlimit", lambda what, bounds: asked.update({what: bounds}))
    monkeypatch.setattr(signal, "alarm", alarms.append)
    assert resource.RLIM_INFINITY == -1
    process.limit({"cpu_s": 20, "memory_bytes": 1000, "wall_s": 40})
    assert (asked[resource.RLIMIT_CPU], asked[resource.RLIMIT_AS]) == ((soft, hard), (1000, 1000))
    assert asked[resource.RLIMIT_FSIZE] == asked[resource.RLIMIT_CORE] == (0, 0)
    assert alarms == [45]


def test_a_request_is_refused_where_it_is_longer_than_the_reader_takes(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(reading, "_run", lambda text, limits, name: asked.append(text) or (b'{"refused": "no"}', 0))
    for more in (0, -1):
        if asked:
            monkeypatch.setattr(reading, "_MAX_REQUEST_BYTES", len(asked[0]) + more)
        with pytest.raises(ReadingError, match="too long; give their numbers" if more else r"^no$"):
            list_channels(tmp_path / "a.csv")
        if more == 0:
            monkeypatch.setattr(reading, "_MAX_REQUEST_BYTES", len(asked[0]))
            with pytest.raises(ReadingError, match=r"^no$"):
                list_channels(tmp_path / "a.csv")
    said = json.loads(asked[0])
    assert (said["task"], said["name"], said["folder"]) == ("channels", "a.csv", str(tmp_path))
    assert said["limits"] == asdict(ReadingLimits())
    own = ReadingLimits(points=7)
    with pytest.raises(ReadingError, match="give their numbers"):
        view(tmp_path / "a.csv", Columns((0,), (1,)), own)
    monkeypatch.setattr(reading, "_MAX_REQUEST_BYTES", 10_000)
    for limits, points in ((own, 7), (None, ReadingLimits().points)):
        with pytest.raises(ReadingError, match=r"^no$"):
            view(tmp_path / "a.csv", Columns((0,), (1,)), limits)
        assert json.loads(asked[-1])["limits"]["points"] == points
        assert json.loads(asked[-1])["columns"]["inputs"] == [0]


# -------------------------------------------------------------------------------------------------------------- bombs
def npy_header(count, descr="<f8"):
    file = io.BytesIO()
    np.lib.format.write_array_header_2_0(file, {"descr": descr, "fortran_order": False, "shape": (count,)})
    return file.getvalue()


def bomb(path, header, megabytes, arrays="uy"):
    """An archive with arrays of zeros, a thousandth of their size."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                member.write(header)
                for _ in range(megabytes):
                    member.write(bytes(1_000_000))
    assert path.stat().st_size < megabytes * 10_000
    return path


@pytest.mark.promise("studio-20", "studio-22")
def test_a_zip_bomb_is_refused_by_what_it_states(tmp_path):
    path = bomb(tmp_path / "bomb.npz", npy_header(25_000_000, "|i1"), 25)
    for columns in (None, Columns((0,), (1,), rate_hz=1e3)):
        assert "'u' states 25000000 samples, and at most 20000000 are read here; cut out" in refused(path, columns)


def test_a_recording_of_as_many_samples_as_are_read_is_opened(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(300.0))
    (tmp_path / "b.csv").write_text("a,b\n" + "1,2\n" * 300)
    assert process.opened(tmp_path / "a.npy", {"limits": {"samples": 300}}).samples() == (300,)
    assert process.opened(tmp_path / "b.csv", {"limits": {"samples": 1}}).samples() == (None, None)
    with pytest.raises(process.RefusedError, match="'data' states 300 samples, and at most 299 are read here; cut out"):
        process.opened(tmp_path / "a.npy", {"limits": {"samples": 299}})
    np.save(tmp_path / "c.npy", np.zeros(20_001, np.int8))
    with pytest.raises(process.RefusedError, match="states 20001 samples, and at most 20000 are read here"):
        process.opened(tmp_path / "c.npy", {"limits": {"samples": 20_000}})


def test_a_thinned_recording_tells_all_of_its_samples(tmp_path):
    """What is drawn of it has fewer: as many points of each column as are asked for."""
    time = np.arange(3000) / 1e3
    np.save(tmp_path / "a.npy", np.stack([5.0 * np.sin(7.0 * time), np.sin(7.0 * time - 0.1)], axis=1))
    chosen = {"inputs": [0], "outputs": [1], "rate_hz": 1e3, "accept": []}
    found = process.view(tmp_path / "a.npy", {"columns": chosen, "limits": {"samples": 3000, "points": 100}})
    assert (found["samples"], found["rate_hz"]) == (3000, 1e3)
    assert 10 < len(found["rows"]) == len(found["drive"][0]) == len(found["output"][0]) < 1000


@linux
def test_a_zip_bomb_within_the_samples_ends_at_the_memory(tmp_path):
    path = bomb(tmp_path / "bomb.npz", npy_header(20_000_000, "|i1"), 20)
    words = refused(path, Columns((0,), (1,), rate_hz=1e3), memory_bytes=320_000_000)
    assert "allocate" in words or "memory" in words
    assert "constant" in refused(path, Columns((0,), (1,), rate_hz=1e3))  # with more memory it is read, and judged


@linux
def test_the_header_of_an_array_that_is_a_bomb_ends_at_the_memory(tmp_path):
    path = bomb(tmp_path / "head.npz", b"\x93NUMPY\x02\x00" + struct.pack("<I", 300_000_000), 300, arrays="u")
    assert "cannot be read" in refused(path, memory_bytes=300_000_000)


@pytest.mark.parametrize("members", [200_000])
def test_an_archive_of_very_many_members_ends_at_the_computing_time(tmp_path, members):
    path = tmp_path / "members.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("0.npy", npy_header(1) + bytes(8))
    one = path.read_bytes()
    at = one.index(b"PK\x01\x02")
    end = one.index(b"PK\x05\x06")
    record = one[at:end]
    directory = record * members
    tail64 = struct.pack("<4sQHHIIQQQQ", b"PK\x06\x06", 44, 45, 45, 0, 0, members, members, len(directory), at)
    locator = struct.pack("<4sIQI", b"PK\x06\x07", 0, at + len(directory), 1)
    last = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0)
    path.write_bytes(one[:at] + directory + tail64 + locator + last)
    words = refused(path, cpu_s=1, wall_s=HANG_S)
    assert "1 s of computing" in words


def test_a_dataset_of_a_trillion_samples_is_refused_by_what_it_states(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("u", shape=(10**12,), chunks=(1024,), dtype="f8")
        file.create_dataset("y", shape=(10**12,), chunks=(1024,), dtype="f8")
    assert path.stat().st_size < 10_000
    assert "'u' states 1000000000000 samples" in refused(path)
    assert "'u' states 1000000000000 samples" in refused(path, Columns((0,), (1,)))


def test_a_tdms_file_that_states_a_trillion_samples_counts_for_what_it_holds(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "huge.tdms"
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("bench", name, np.arange(300.0)) for name in "uy"])
    data = path.read_bytes()
    assert data.count(struct.pack("<Q", 300)) == 2
    path.write_bytes(data.replace(struct.pack("<Q", 300), struct.pack("<Q", 10**12)))
    assert [c.samples for c in list_channels(path).channels] == [300, 300]
    lead = bytearray(data)
    lead[12:20] = struct.pack("<Q", 10**12)
    path.write_bytes(lead)
    assert "bytes are missing" in refused(path)


@pytest.mark.promise("studio-21")
@posix
@pytest.mark.parametrize("how", ["external", "virtual", "link"])
def test_data_of_other_files_are_not_read(tmp_path, how):
    h5py = pytest.importorskip("h5py")
    secret = tmp_path / "secret.bin"
    secret.write_bytes(np.arange(400.0).tobytes())
    path = tmp_path / "thief.h5"
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.arange(400.0)
    with h5py.File(path, "w") as file:
        file["mine"] = np.arange(400.0)
        group = file.create_group("deep")
        if how == "external":
            group.create_dataset("u", (400,), "f8", external=[(str(secret), 0, 3200)])
        elif how == "link":
            group["u"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "x")
        else:
            layout = h5py.VirtualLayout(shape=(400,), dtype="f8")
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", shape=(400,))
            group.create_virtual_dataset("u", layout)
    with h5py.File(path) as file:
        assert file["deep/u"][7] == 7.0  # the library would
    found = list_channels(path)
    assert [c.name for c in found.channels] == ["mine"]
    told = refused(path, Columns(("mine",), ("deep/u",)))
    assert "and no other file is opened; copy the values into this one" in told


# ------------------------------------------------------------------------------------------------------- the process
def standing_in(monkeypatch, tmp_path, program):
    """Another program in the place of the reader's."""
    (tmp_path / "stand_in.py").write_text(program)
    monkeypatch.setattr(reading, "_PROCESS", "stand_in")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = tmp_path / "x.csv"
    path.touch()
    return path


@pytest.mark.promise("studio-21")
def test_a_reader_that_hangs_is_ended_with_what_it_started(tmp_path, monkeypatch):
    program = """
        import subprocess, sys, time
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(86400)"])
        open("PIDS", "w").write(f"{child.pid}\\n")
        time.sleep(86400)
    """.replace("\n        ", "\n").replace("PIDS", str(tmp_path / "pids"))
    path, children = standing_in(monkeypatch, tmp_path, program), []

    def hand_over(process, request, real=reading._hand_over):
        real(process, request)
        children.extend(lines_of(tmp_path / "pids"))  # its time begins when it has started the child

    monkeypatch.setattr(reading, "_hand_over", hand_over)
    assert "was not read within 0.5 s" in refused(path, wall_s=0.5)
    assert gone(int(children[0]))


@pytest.mark.promise("studio-21")
@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("import os; os.abort()", "broke the program that reads it"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", r"broke the program that reads it \(code -11\)"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "too much memory"),
        ("raise SystemExit(3)", r"\(code 3\)"),
        ("import os, time; os.close(1); time.sleep(0.3); os._exit(3)", r"\(code 3\)"),
        ("print('[]')", "broke the program"),
        ("print('nothing')", "broke the program"),
        ("print('{\"format\": 3}')", "broke the program"),
        ("print('NaN')", "broke the program"),
        ("print('x' * 5_000_000)", "more to say than 4 MB"),
        ("print('[' * 900_000)", "broke the program"),
    ],
)
@posix
def test_a_reader_that_breaks_is_said(tmp_path, monkeypatch, program, words):
    path = standing_in(monkeypatch, tmp_path, program)
    with pytest.raises(ReadingError, match=words):
        list_channels(path)


def test_the_reader_loads_no_plugins_and_starts_no_threads(tmp_path, monkeypatch):
    program = "import json, os; print(json.dumps({'refused': 'x.csv' + os.environ[%r]}))"
    for name, value in (("HDF5_PLUGIN_PRELOAD", "::"), ("OPENBLAS_NUM_THREADS", "1")):
        monkeypatch.setenv(name, "other")
        assert refused(standing_in(monkeypatch, tmp_path, program % name)) == "x.csv" + value


def test_the_current_folder_is_no_place_to_import_from(tmp_path, monkeypatch, loop):
    path = csv(tmp_path / "numpy.py", loop)
    (tmp_path / "h5py.py").write_text("raise SystemExit(9)")
    (tmp_path / "json.py").write_text("raise SystemExit(9)")
    monkeypatch.chdir(tmp_path)
    path = path.rename(tmp_path / "loop.csv")
    (tmp_path / "numpy.py").write_text("raise SystemExit(9)")
    assert len(list_channels(path).channels) == 3


def test_names_too_long_for_a_request_are_refused(tmp_path, loop):
    path = csv(tmp_path / "loop.csv", loop)
    assert "give their numbers instead" in refused(path, Columns(("x" * 40_000,), (2,)))


@pytest.mark.promise("studio-20", "studio-21", "studio-22")
@linux
def test_the_process_bounds_itself_before_it_reads(tmp_path):
    limits = {"memory_bytes": 3_000_000_000, "cpu_s": 20, "wall_s": 40}
    program = (
        "import json, resource, sys; from microrad.studio.recordings.process import limit;"
        "limit(json.loads(sys.argv[1]));"
        "names = ['RLIMIT_' + n for n in ('AS', 'CPU', 'FSIZE', 'CORE')];"
        "print(json.dumps([resource.getrlimit(getattr(resource, n)) for n in names]));"
        "sys.stdout.flush(); import os; os.write(os.open('written', os.O_CREAT | os.O_WRONLY), b'x')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(limits)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert json.loads(done.stdout) == [[3_000_000_000] * 2, [20, 21], [0, 0], [0, 0]]
    assert "File too large" in done.stderr
    assert (tmp_path / "written").read_bytes() == b""


def test_extremes_keep_order_ends_and_peaks():
    wave = np.sin(np.linspace(0, 300, 10_000))
    wave[4321], wave[77] = 9.0, -9.0
    rows = extremes([wave, -wave], 100)
    assert {0, 77, 4321, 9999} <= set(rows.tolist())
    assert np.all(np.diff(rows) > 0)
    assert 100 <= len(rows) <= 102 + 100
    assert extremes([wave[:50]], 100).tolist() == list(range(50))
    assert math.isclose(len(extremes([wave[:101]], 100)), 101, abs_tol=1)


def test_a_recording_whose_finding_is_accepted_is_drawn_and_one_whose_finding_is_not_is_refused(tmp_path):
    wave = np.sin(2 * np.pi * 7.3 * np.arange(1500) / 1e3)
    np.save(tmp_path / "a.npy", np.stack([wave, np.minimum(wave, 0.5)], axis=1))

    def seen(*accept):
        columns = {"inputs": [0], "outputs": [1], "rate_hz": 1e3, "accept": list(accept)}
        return process.view(tmp_path / "a.npy", {"columns": columns, "limits": {"samples": 1500, "points": 100}})

    for accept in ((), ("drift",)):
        with pytest.raises(ValueError, match="To take it on as it is: --accept clipping "):
            seen(*accept)
    found = seen("clipping")
    np.testing.assert_allclose(found["output"][0], np.minimum(wave[found["rows"]], 0.5), atol=1e-6)
    assert max(found["output"][0]) == 0.5
    alike = f"{np.count_nonzero(wave >= 0.5)} samples at exactly that value"
    assert any("is clipped at 0.5" in words and alike in words for words in found["findings"])


def test_a_reader_is_bounded_before_it_reads(monkeypatch, tmp_path):
    """Else a hostile file would have all memory and time."""
    did, answer = [], tmp_path / "answer"
    stub = SimpleNamespace(
        dup=lambda fd: os.open(answer, os.O_WRONLY | os.O_CREAT),
        dup2=lambda *fds: None,
        open=lambda *given: 0,
        fdopen=os.fdopen,
        devnull=os.devnull,
        O_WRONLY=os.O_WRONLY,
    )
    monkeypatch.setattr(process, "os", stub)
    monkeypatch.setattr(process, "limit", lambda limits: did.append(("limit", limits)))
    monkeypatch.setattr(process, "answer_to", lambda request: did.append("read") or {"x": 1})
    request = io.BytesIO(json.dumps({"limits": {"cpu_s": 1}}).encode())
    monkeypatch.setattr(process.sys, "stdin", SimpleNamespace(buffer=request))
    process.main()
    assert did == [("limit", {"cpu_s": 1}), "read"]
    assert json.loads(answer.read_text()) == {"x": 1}


# -------------------------------------------------------------------------------------------- words with their numbers
@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (
            UploadLimits(),
            "has more than 200 MB; cut out the part that you need, keep every n-th sample, or run microrad",
        ),
        (UploadLimits(file_bytes=2_345_678), "has more than 2.346 MB; cut out the part that you need, keep every n-th"),
    ],
)
def test_a_file_over_the_limit_is_told_with_the_limit_of_files(tmp_path, limits, words):
    assert Uploads(tmp_path, limits).too_large("a\nb.csv").startswith(f"the file 'a\\u000ab.csv' {words}")


def test_recordings_are_listed_by_their_age_and_then_by_their_key(tmp_path):
    uploads = Uploads(tmp_path / "uploads", UploadLimits())
    for key, name, at, size in (
        ("b", "x.csv", 30, 3),
        ("a", "y.csv", 20, 4),
        ("d", "z.csv", 10, 5),
        ("c", "w.csv", 20, 6),
    ):
        place = uploads.folder / (key * 16)
        place.mkdir()
        (place / name).write_bytes(bytes(size))
        os.utime(place, (at, at))
    assert [(each.key[0], each.name, each.size) for each in uploads.listed()] == [
        ("d", "z.csv", 5),
        ("a", "y.csv", 4),
        ("c", "w.csv", 6),
        ("b", "x.csv", 3),
    ]
    assert uploads._total() == 18
    assert uploads.get("c" * 16).path == uploads.folder / ("c" * 16) / "w.csv"
    uploads.remove("a" * 16)
    assert [each.key[0] for each in uploads.listed()] == ["d", "c", "b"]


def test_of_what_was_left_in_the_spool_the_old_goes_and_the_new_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", tempfile.gettempdir())
    monkeypatch.setattr(recording_uploads.time, "time_ns", lambda: 10_000 * 10**9)
    uploads = Uploads(tmp_path, LIMITS)
    spool = tmp_path / "spool"
    spool.mkdir()
    for name, at_s in (("old", 6399), ("just", 6400), ("new", 9999)):
        (spool / name).touch()
        (spool / f"{name}.d").mkdir()
        for each in (spool / name, spool / f"{name}.d"):
            os.utime(each, (at_s, at_s))
    uploads.hold_temporary_files()
    assert sorted(path.name for path in spool.iterdir()) == ["just", "just.d", "new", "new.d"]
    assert tempfile.tempdir == str(spool)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (
            -24,
            "'a.csv' took more than 7 s of computing or too much memory to read; cut out the part of the recording",
        ),
        (-9, "'a.csv' took more than 7 s of computing or too much memory to read; cut out the part of the recording"),
        (-11, "'a.csv' broke the program that reads it (code -11): it is damaged, or made to do so; copy it again."),
        (1, "'a.csv' broke the program that reads it (code 1): it is damaged, or made to do so; copy it again."),
    ],
)
@linux
def test_a_reader_that_ended_is_told_by_how_it_ended(code, words):
    assert reading._stopped("a.csv", code, ReadingLimits(cpu_s=7)).startswith(words)


@pytest.mark.parametrize(
    ("raised", "words"),
    [
        (process.RefusedError("no: " + "w" * 5000), "no: " + "w" * 3996),
        (MemoryError(), "a.csv: reading it takes more than 2.5 GB of memory; cut out the part that you need."),
        (KeyError("x"), "a.csv: this cannot be read (KeyError); copy it again from its source."),
    ],
)
@pytest.mark.parametrize("task", ["channels", "view"])
def test_what_a_reader_stumbles_over_is_refused_in_words(tmp_path, monkeypatch, raised, words, task):
    def stumble(path, request):
        assert (str(path), Path.cwd()) == ("a.csv", tmp_path)
        raise raised

    monkeypatch.chdir(Path(__file__).parent)
    (tmp_path / "a.csv").write_text("1,2\n", "utf-8")
    monkeypatch.setattr(process, task, stumble)
    request = {"task": task, "name": "a.csv", "folder": str(tmp_path), "limits": {"memory_bytes": 2_500_000_000}}
    assert process.answer_to(request) == {"refused": words}


def test_a_second_channel_that_claims_too_much_is_refused_by_its_name(monkeypatch):
    source = SimpleNamespace(names=["a", "b" * 300, "c"], samples=lambda: [3_000_000, 4_567_890, None])
    monkeypatch.setattr("microrad.lab.recording.reader.open_source", lambda path: source)
    with pytest.raises(process.RefusedError) as refusal:
        process.opened(Path("x.npz"), {"limits": {"samples": 3_000_000}})
    assert str(refusal.value) == (
        f"x.npz: '{'b' * 200}' states 4567890 samples, and at most 3000000 are read here; cut out the part that you "
        "need, or keep every n-th sample."
    )
    assert process.opened(Path("x.npz"), {"limits": {"samples": 4_567_890}}) is source


def test_a_recording_of_several_channels_is_thinned_with_the_extremes_of_each(monkeypatch):
    drive, output = np.zeros((1000, 2)), np.zeros((1000, 1))
    drive[123, 0], drive[456, 1], output[789, 0] = 1.23456789, -2.5, 1e-9 / 3.0
    found = SimpleNamespace(
        drive=drive,
        output=output,
        samples=1000,
        rate_hz=250.5,
        findings=[SimpleNamespace(message=f"m{n}") for n in range(60)],
    )
    asked = []
    monkeypatch.setattr(process, "opened", lambda path, request: None)
    monkeypatch.setattr(
        "microrad.lab.recording.read_recording", lambda *given, **more: asked.append((given, more)) or found
    )
    columns = {"inputs": [3, 4], "outputs": ["y"], "rate_hz": 250.5, "accept": ["drift"]}
    seen = process.view(Path("a"), {"columns": columns, "limits": {"points": 20}})
    assert asked == [((Path("a"), [3, 4], ["y"], 250.5), {"accept": ["drift"]})]
    assert {123, 456, 789} <= set(seen["rows"]) and len(seen["rows"]) < 200
    place = seen["rows"].index
    assert seen["drive"][0][place(123)] == 1.234568
    assert seen["drive"][1][place(456)] == -2.5
    assert seen["output"][0][place(789)] == 3.333333e-10
    assert (seen["samples"], seen["rate_hz"], len(seen["drive"]), len(seen["output"])) == (1000, 250.5, 2, 1)
    assert seen["findings"] == [f"m{n}" for n in range(50)]


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("a/../.b", "its name holds a path"),
        ("." + "x" * 170, "its name has more than 160 bytes"),
        ("µ" * 81, "its name has more than 160 bytes"),
        ("con.\t", "its name holds characters that do not print"),
        (".con", "its name begins or ends with a dot or a blank"),
        ("LPT¹.tar.gz", "its name is that of a device on Windows"),
        ("  ", "it has no name"),
    ],
)
def test_of_two_faults_of_a_name_the_first_is_told(name, fault):
    with pytest.raises(NameRefusedError) as refusal:
        safe_name(name)
    assert str(refusal.value) == f"the file {names.shown(name)} is not taken: {fault}; rename it and drop it again"
    typed = names.typed_words(refusal.value)
    assert typed == f"the file {names.shown(name)} is not taken: {fault}; choose another name"


# ------------------------------------------------------------------------------------------- what is asked and answered
@pytest.mark.parametrize(
    ("answer", "code", "words"),
    [
        (b'{"refused": 5}', 0, "5"),
        (b'{"refused": "", "channels": []}', 0, ""),
        (b'"refused"', 3, "'b.csv' broke the program that reads it (code 3)"),
        (b'["refused"]', 1, "'b.csv' broke the program that reads it (code 1)"),
        (b"3", 2, "'b.csv' broke the program that reads it (code 2)"),
        (b"null", 2, "'b.csv' broke the program that reads it (code 2)"),
        (b"", -9, "'b.csv' took more than 7 s of computing"),
        (b"\xff{}", 4, "'b.csv' broke the program that reads it (code 4)"),
        (b'{"channels": [{"name": "a", "unit": "V"}], "time": null, "rates_hz": []}', 0, "'b.csv' broke the program"),
        (b'{"channels": [], "time": "a", "rates_hz": []}', 0, "'b.csv' broke the program that reads it (code 0)"),
    ],
)
@linux
def test_an_answer_of_another_form_is_none(monkeypatch, answer, code, words):
    monkeypatch.setattr(reading, "_run", lambda request, limits, name: (answer, code))
    with pytest.raises(ReadingError) as refusal:
        list_channels(Path("a/b.csv"), ReadingLimits(cpu_s=7))
    assert str(refusal.value).startswith(words)
    assert (str(refusal.value) == words) is (b'{"refused"' in answer)


def test_a_reader_is_asked_for_a_file_in_its_folder_with_all_limits(monkeypatch):
    asked = []
    limits = ReadingLimits(1.5, 2, 3, 4, 5, 6, 7)
    listed = {"channels": [{"name": "a", "unit": "V", "samples": None}], "time": 2, "rates_hz": [622.08, 5]}
    shown = {
        "samples": 9,
        "rate_hz": 2.5,
        "findings": ["f"],
        "rows": [0, 8],
        "drive": [[1, 2], [3, 4]],
        "output": [[5, 6]],
    }

    def run(request, limits, name):
        asked.append((json.loads(request), limits, name))
        return json.dumps(listed if len(asked) == 1 else shown).encode(), 0

    monkeypatch.setattr(reading, "_run", run)
    found = list_channels(Path("a b/µ.csv"), limits)
    assert found == reading.Listing((reading.ChannelInfo("a", "V", None),), 2, (622.08, 5.0))
    seen = view(Path("a b/µ.csv"), Columns((0, "u"), ("y",), 622.08, ("drift",)))
    assert seen == reading.View(9, 2.5, ("f",), (0, 8), ((1.0, 2.0), (3.0, 4.0)), ((5.0, 6.0),))
    place = {"folder": "a b", "name": "µ.csv"}
    columns = {"inputs": [0, "u"], "outputs": ["y"], "rate_hz": 622.08, "accept": ["drift"]}
    assert asked == [
        ({"task": "channels", "limits": asdict(limits), **place}, limits, "µ.csv"),
        ({"task": "view", "columns": columns, "limits": asdict(ReadingLimits()), **place}, ReadingLimits(), "µ.csv"),
    ]


def test_channels_are_listed_up_to_the_limit_with_the_rates_of_those(monkeypatch):
    source = SimpleNamespace(
        names=["u" * 201, "t [s]", "time", "late"],
        units=["V", "s" * 300, "", "mrad"],
        samples=lambda: [3, None, 5, 7],
        rates=lambda which: [SimpleNamespace(rate_hz=(50.5, 622.08, 50.5, 9.0)[k]) for k in reversed(which)],
    )
    monkeypatch.setattr(process, "opened", lambda path, request: source)
    found = process.channels(Path("a"), {"limits": {"channels": 3}})
    named = [("u" * 200, "V", 3), ("t [s]", "s" * 200, None), ("time", "", 5)]
    assert found == {
        "channels": [dict(zip(("name", "unit", "samples"), each, strict=True)) for each in named],
        "time": 1,
        "rates_hz": [50.5, 622.08],
    }


def test_a_form_gives_one_file_and_is_closed_whatever_becomes_of_it(tmp_path, monkeypatch):
    drop = pytest.importorskip("nicegui") and importlib.import_module("microrad.studio.pages.drop")
    closed, limits, said, taken = [], [], [], []

    class Form(dict):
        async def close(self):
            closed.append(len(self))

    class Request:
        def __init__(self, **sent):
            self.sent = sent

        async def form(self, **given):
            limits.append(given)
            return Form(self.sent)

    def file(name, data=b"1,2\n"):
        return drop.UploadFile(io.BytesIO(data), filename=name)

    async def take(upload):
        taken.append((upload.name, upload.path.read_bytes()))
        raise asyncio.CancelledError

    async def send():
        monkeypatch.setattr(drop, "_TURNS", asyncio.Semaphore(1))
        forms = (
            {"file": file("a.csv"), "word": "x"},
            {"file": file(None)},
            {"word": "x"},
            {"file": file("b", bytes(1001))},
        )
        answers.extend([await field._take(Request(**sent)) for sent in forms])

    monkeypatch.setattr(drop, "_BLOCK_BYTES", 3)
    field, answers = drop.Drop.__new__(drop.Drop), []
    field._uploads, field._refused, field._taken = Uploads(tmp_path / "uploads", LIMITS), said.append, take
    asyncio.run(send())
    assert (closed, limits) == ([2, 1, 1, 1], [{"max_files": 1, "max_fields": 1}] * 4)
    assert [(answer.status_code, answer.body) for answer in answers] == [(200, b"read")] * 4
    assert taken == [("a.csv", b"1,2\n")]
    assert [words.partition(";")[0] for words in said] == [
        "the file '' is not taken: it has no name",
        "the file 'b' has more than 0.001 MB",
    ]


@pytest.mark.parametrize(
    ("there", "files", "words"),
    [
        (1, 1, "the file 'new.csv' is not taken: 1 recording is here already; remove one first"),
        (2, 2, "the file 'new.csv' is not taken: 2 recordings are here already; remove one first"),
        (3, 1, "the file 'new.csv' is not taken: 3 recordings are here already; remove one first"),
        (3, 4, ""),
        (0, 0, "the file 'new.csv' is not taken: 0 recordings are here already; remove one first"),
    ],
)
def test_a_file_too_many_is_told_with_how_many_there_are(tmp_path, there, files, words):
    for k in range(there):
        save(Uploads(tmp_path), f"{k}.csv", b"x")
    uploads = Uploads(tmp_path, UploadLimits(files=files))
    if not words:
        assert save(uploads, "new.csv", b"x").name == "new.csv"
        return
    with pytest.raises(UploadError) as refusal:
        save(uploads, "new.csv", b"x")
    assert str(refusal.value) == words
    assert len(uploads.listed()) == there


@pytest.mark.parametrize(
    ("sizes", "total", "words"),
    [
        ((700, 800), 1500, ""),
        ((700, 801), 1500, "all recordings together may have 0.0015 MB; remove one first"),
        ((3, 1_234_568), 1_234_567, "all recordings together may have 1.235 MB; remove one first"),
    ],
)
def test_recordings_beyond_what_all_may_have_are_told_with_that_limit(tmp_path, sizes, total, words):
    uploads = Uploads(tmp_path, UploadLimits(total_bytes=total))
    first, second = sizes
    save(uploads, "a.csv", b"x" * first)
    if not words:
        assert save(uploads, "b.csv", b"x" * second).size == second
        return
    with pytest.raises(UploadError) as refusal:
        save(uploads, "b.csv", b"x" * second)
    assert str(refusal.value) == f"the file 'b.csv' is not taken: {words}"
    assert [each.name for each in uploads.listed()] == ["a.csv"]


DEVICES = "con PRN aux nul CONIN$ conout$ com0 Com5 lpt9 LPT1 COM¹ com² lpt³.txt prn.tar.gz conin$.csv"


@pytest.mark.parametrize("name", DEVICES.split())
def test_each_device_of_windows_is_no_name(name):
    with pytest.raises(NameRefusedError) as refusal:
        safe_name(name)
    words = f"the file '{name}' is not taken: its name is that of a device on Windows; rename it and drop it again"
    assert str(refusal.value) == words
    assert typed_words(refusal.value) == words.replace("rename it and drop it again", "choose another name")
    assert safe_name(f"a{name}") == f"a{name}"


# ------------------------------------------------------------------------------------------------- just at the limits
def test_of_many_rates_that_a_file_states_the_first_fifty_are_told(monkeypatch):
    source = SimpleNamespace(
        names=[f"c{k}" for k in range(60)],
        units=["V"] * 60,
        samples=lambda: [3] * 60,
        rates=lambda which: [SimpleNamespace(rate_hz=100.0 - k) for k in which],
    )
    monkeypatch.setattr(process, "opened", lambda path, request: source)
    found = process.channels(Path("a"), {"limits": {"channels": 55}})
    assert found["rates_hz"] == [100.0 - k for k in range(50)]
    assert len(found["channels"]) == 55


@pytest.mark.parametrize("task", ["channels", "view"])
def test_whatever_is_asked_of_a_recording_it_may_not_state_more_samples_than_are_read(tmp_path, task):
    np.save(tmp_path / "a.npy", np.random.default_rng(1).normal(size=(300, 2)))
    columns = {"inputs": [0], "outputs": [1], "rate_hz": 1e3, "accept": []}
    limits = {"samples": 299, "channels": 5, "points": 10, "memory_bytes": 1}
    request = {"task": task, "name": "a.npy", "folder": str(tmp_path), "columns": columns, "limits": limits}
    here = Path.cwd()
    try:
        refusal = process.answer_to(request)["refused"]
    finally:
        os.chdir(here)
    assert refusal.startswith("a.npy: 'data[0]' states 300 samples, and at most 299 are read here; cut out")


def test_what_a_library_prints_is_no_part_of_the_answer():
    program = (
        "import os, sys; from microrad.studio.recordings import process\n"
        "process.limit = lambda limits: print('one', flush=True)\n"
        "process.answer_to = lambda request: {'said': [os.write(1, b'two'), os.write(2, b'three'), request['a']]}\n"
        "process.main()"
    )
    request = json.dumps({"limits": {}, "a": "\u00b5"}).encode()
    done = subprocess.run([sys.executable, "-c", program], input=request, capture_output=True, check=True)
    assert (done.stdout, done.stderr) == (b'{"said": [3, 5, "\\u00b5"]}', b"")


@pytest.mark.parametrize("more", [0, 1])
@posix
def test_an_answer_of_just_as_many_bytes_as_are_taken_is_taken(tmp_path, monkeypatch, more):
    said = "x" * (123_456 + more)
    program = f"import os, sys; sys.stdin.read(); print({said!r}, end='', flush=True); os.close(1); raise SystemExit(3)"
    path = standing_in(monkeypatch, tmp_path, program)
    limits = ReadingLimits(answer_bytes=123_456)
    if not more:
        assert reading._run(b"{}", limits, path.name) == (said.encode(), 3)
        return
    with pytest.raises(ReadingError) as refusal:
        reading._run(b"{}", limits, path.name)
    advice = "cut out the part of the recording that you need, or keep every n-th sample"
    assert str(refusal.value) == f"'x.csv' has more to say than 0.123456 MB; {advice}."


def test_names_too_long_for_a_request_are_refused_with_the_name_of_the_file(tmp_path):
    with pytest.raises(ReadingError) as refusal:
        view(tmp_path / "a b.csv", Columns(("x" * 40_000,), (2,)))
    assert str(refusal.value) == "a b.csv: the names of the channels are too long; give their numbers instead."


def test_a_folder_whose_name_is_longer_than_a_key_is_the_place_of_no_recording(tmp_path):
    uploads = Uploads(tmp_path, replace(LIMITS, files=1, total_bytes=10))
    for name in ("0123456789abcdef-copy", "x0123456789abcdef", "0123456789ABCDEF"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "old.csv").write_bytes(bytes(9))
    assert (uploads.listed(), save(uploads, "new.csv", bytes(10)).size) == ((), 10)


def test_bytes_of_files_on_their_way_count_for_what_all_may_have(tmp_path, monkeypatch):
    monkeypatch.setattr(recording_uploads, "_BLOCK_BYTES", 1)
    uploads = Uploads(tmp_path, LIMITS)

    async def three():
        gate, begun = asyncio.Event(), [asyncio.Event(), asyncio.Event()]

        async def slow(size, event):
            yield bytes(size)
            event.set()
            await gate.wait()

        coming = [asyncio.create_task(uploads.save(f"{k}.csv", slow(900, begun[k]))) for k in range(2)]
        for event in begun:
            await event.wait()
        with pytest.raises(UploadError, match=r"'third.csv' is not taken: all recordings together may have 0.0025 MB"):
            await uploads.save("third.csv", blocks(bytes(701)))
        third = await uploads.save("third.csv", blocks(bytes(700)))
        gate.set()
        return [third.size, *[(await each).size for each in coming]]

    assert asyncio.run(three()) == [700, 900, 900]


@posix
def test_of_old_links_in_the_spool_none_stays_and_what_they_lead_to_does(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", None)
    uploads = Uploads(tmp_path / "uploads", LIMITS)
    spool, kept = uploads.folder / "spool", tmp_path / "kept"
    spool.mkdir()
    kept.mkdir()
    (kept / "a.csv").write_bytes(b"1")
    for name, target in (("folder", kept), ("file", kept / "a.csv"), ("nothing", tmp_path / "none")):
        (spool / name).symlink_to(target)
        os.utime(spool / name, (1.0, 2.0), follow_symlinks=False)
    uploads.hold_temporary_files()
    assert (everything(spool), everything(kept)) == ([], ["a.csv"])


def test_a_recording_that_another_tab_removes_as_it_is_looked_at_has_no_size(tmp_path):
    assert recording_uploads._status(tmp_path / "gone.csv") == (0, 0)
    (tmp_path / "there.csv").write_bytes(b"123")
    os.utime(tmp_path / "there.csv", ns=(1, 2_000_000_500))
    assert recording_uploads._status(tmp_path / "there.csv") == (3, 2_000_000_500)


def test_a_path_outside_of_its_folder_or_none_at_all_is_told_with_the_folder(tmp_path):
    root = tmp_path.resolve() / "own"
    root.mkdir()
    with pytest.raises(NameRefusedError) as refusal:
        within(root, "../other/a.toml")
    assert str(refusal.value) == f"'../other/a.toml' is outside of {root}; choose a file in that folder"
    with pytest.raises(NameRefusedError, match=r"^'a.+b' is no path that can be opened: .*null"):
        within(root, "a\0b")


def test_a_form_that_the_disk_does_not_take_is_told_in_the_words_that_there_are(tmp_path, monkeypatch):
    drop = pytest.importorskip("nicegui") and importlib.import_module("microrad.studio.pages.drop")
    said, taken, faults = (
        [],
        [],
        [OSError("the spool is odd"), OSError(errno.EACCES, "no way"), drop.ClientDisconnect()],
    )

    class Request:
        async def form(self, **given):
            raise faults.pop(0)

    async def take(upload):
        taken.append(upload)

    async def send():
        monkeypatch.setattr(drop, "_TURNS", asyncio.Semaphore(1))
        return [(await field._take(Request())).status_code for _ in range(3)]

    field = drop.Drop.__new__(drop.Drop)
    field._uploads, field._refused, field._taken = Uploads(tmp_path / "uploads", LIMITS), said.append, take
    assert (asyncio.run(send()), taken) == ([200] * 3, [])
    assert said == [
        f"the file could not be stored: {why}; check free space and permissions"
        for why in ("the spool is odd", "no way")
    ]
