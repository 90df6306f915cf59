"""The ledger against kills, full and read-only disks, flipped bits and a second writer; and chunks as bytes."""

import contextlib
import glob
import hashlib
import json
import math
import os
import platform
import random
import re
import sqlite3
import struct
import subprocess
import sys
import tempfile
import textwrap
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.campaign.ledger import Ledger, check_same, chunk_format, file, mend, mending, verify
from microrad.campaign.ledger.chunk_format import Column, Head
from microrad.campaign.ledger.file import FORMAT, is_written, refuse_existing
from microrad.campaign.records import CampaignError, Chunk, Failed, WorstTrace
from places import TESTS
from waiting import any_moment

MEMORY = "/dev/shm"
COLUMNS = (Column("row", "", "number"), Column("weight", "", "weight"), Column("margin", "dB", "margin"))
HEAD = Head(
    campaign_name="campaign.toml",
    campaign_text='mission = "leo-geo.toml"\n',
    mission_name="paper",
    seed=2**64 - 1,
    hashes={"campaign": "aa", "mission": "bb", "code": "cc"},
    versions={"numpy": "2"},
    created="2026-01-01T00:00:00+00:00",
    cells=({"mirror": "a.toml"}, {"mirror": "b.toml"}),
    columns=COLUMNS,
    bundle=bytes(range(256)),
)


def chunk(number, cell=0, rows=16, reason="raised ValueError: no µ"):
    """A chunk whose values follow from its number and cell, with one failed row."""
    draw = np.random.default_rng([cell, number])
    margin = draw.normal(size=rows)
    margin[3] = np.nan
    columns = {"row": np.arange(rows) + float(rows * number), "weight": np.ones(rows), "margin": margin}
    curve = np.concatenate([np.full(500, float(rows)), np.sort(draw.random(250))[::-1], np.zeros(306)])
    return Chunk(cell, number, columns, (Failed(rows * number + 3, 2**64 - 1, 2, reason),), curve, curve**2)


def packed(number, cell=0):
    return chunk_format.pack_chunk(chunk(number, cell))


def filled(path, count=20):
    """A closed ledger with this many chunks in cell 0 and one in cell 1; the bytes of each."""
    payloads = {(0, number): packed(number) for number in range(count)} | {(1, 0): packed(0, 1)}
    with Ledger.create(path, HEAD) as ledger:
        for (cell, number), payload in payloads.items():
            ledger.put(cell, number, payload)
        ledger.note("rounds", 2)
        ledger.put_trace(TRACE)
    return payloads


TRACE = WorstTrace(
    0, 17, "margin", -1.5, np.arange(50.0), np.random.default_rng(1).normal(size=(50, 2)), np.zeros((50, 2))
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a ledger, 100 % #1?.ledger"  # characters that an address would take otherwise


@pytest.fixture
def path_in_memory(path):
    """A path on no disk, where the machine has such: for hundreds of ledgers, each of which is mended and written."""
    with contextlib.ExitStack() as stack:
        if os.access(MEMORY, os.W_OK):
            yield Path(stack.enter_context(tempfile.TemporaryDirectory(dir=MEMORY))) / path.name
        else:
            yield path


def said(call, *args, **kwargs):
    """The words of the error that a call must raise."""
    with pytest.raises(CampaignError) as caught:
        call(*args, **kwargs)
    return str(caught.value)


# ------------------------------------------------------------------------------------------------------------- bytes
def same_bits(a, b):
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def test_a_chunk_comes_back_bit_by_bit_with_its_columns_in_order():
    odd = np.array([-0.0, np.inf, -np.inf, struct.unpack("<d", b"\1\0\0\0\0\0\xf8\x7f")[0], 5e-324])
    for rows in (0, 1, 5):
        columns = {"z": odd[:rows], "row": np.arange(float(rows)), "a": np.full(rows, np.nan)}
        sent = Chunk(3, 7, columns, (Failed(2, 2**64 - 1, 2, "half \udc80 of a pair"),), np.zeros(1056), np.zeros(0))
        got = chunk_format.unpack_chunk(chunk_format.pack_chunk(sent))
        assert (got.cell, got.number, got.failed, list(got.columns)) == (3, 7, sent.failed, ["z", "row", "a"])
        assert all(same_bits(got.columns[name], columns[name]) for name in columns)
        assert same_bits(got.survival, sent.survival) and same_bits(got.survival_square, sent.survival_square)
        assert not same_bits(got.survival, sent.survival_square)


@pytest.mark.parametrize(
    "values", [[1, 1, 2, 3, 3, 3], [1, 2], [2, 2], [1], [0.0, -0.0], [1, 1, 2], [1, 2, 2]], ids=str
)
def test_runs_at_the_ends_are_left_out_and_put_back(values):
    sent = np.array(values, dtype=float)
    got = chunk_format.unpack("trace", chunk_format.pack("trace", {}, {"x": sent, "next": np.arange(3.0)}))
    assert same_bits(got.arrays["x"], sent) and same_bits(got.arrays["next"], np.arange(3.0))
    long = np.concatenate([np.full(1000, sent[0]), sent, np.full(1000, sent[-1])])
    data = chunk_format.pack("trace", {}, {"x": long})
    assert same_bits(chunk_format.unpack("trace", data).arrays["x"], long)
    assert len(data) < 300


@pytest.mark.promise("campaigns-45")
def test_a_trace_and_a_head_come_back():
    got = chunk_format.unpack_trace(chunk_format.pack_trace(replace(TRACE, value=np.nan)))
    assert (got.cell, got.row, got.output) == (0, 17, "margin") and np.isnan(got.value)
    assert same_bits(got.error_rad, TRACE.error_rad) and same_bits(got.drive_v, TRACE.drive_v)
    keys = {"z": "1", "a": "2"}
    head = chunk_format.unpack_head(chunk_format.pack_head(replace(HEAD, cells=(keys,))))
    assert head == replace(HEAD, cells=(keys,)) != HEAD and list(head.cells[0]) == ["z", "a"]


def test_the_same_chunk_gives_the_same_bytes_on_any_machine():
    columns = {"row": np.arange(4.0), "weight": np.ones(4), "margin": np.array([0.1, np.nan, 3.0, -0.0])}
    data = chunk_format.pack_chunk(
        Chunk(0, 0, columns, (Failed(1, 9, 2, "why"),), np.array([4.0, 2.5, 0.0]), np.zeros(3))
    )
    assert data == chunk_format.pack_chunk(chunk_format.unpack_chunk(data))
    assert hashlib.sha256(data).hexdigest() == "03960011ee16b928ebaa57956de692445ea838dcc57a37c245365dd9b9526bee"


def test_a_name_that_is_no_text_is_damage_in_words(path):
    """SQLite quotes it in its error, which Python then could not read."""
    filled(path, 2)
    content = path.read_bytes()
    assert content.count(b"CREATE TABLE chunks") == 1
    path.write_bytes(content.replace(b"CREATE TABLE chunks", b"CREATE\x82TABLE chunks"))
    assert "the file is damaged (a text in it is none)" in said(verify, path)
    assert "the file is damaged (a text in it is none)" in said(Ledger.open, path, write=False)


def test_a_flipped_bit_anywhere_in_a_chunk_is_refused():
    data = packed(0)
    draw = random.Random(1)
    for at in [*range(80), *range(80, len(data), 37), *range(len(data) - 40, len(data))]:
        bad = bytearray(data)
        bad[at] ^= 1 << draw.randrange(8)
        with pytest.raises(CampaignError, match=r"damaged|is no chunk"):
            chunk_format.unpack_chunk(bytes(bad))
    assert chunk_format.unpack_chunk(data).number == 0


def test_other_bytes_are_refused_by_what_they_are():
    data = packed(0)
    assert "is no chunk of microrad" in said(chunk_format.unpack_chunk, b"")
    assert "is no chunk of microrad" in said(chunk_format.unpack_chunk, b"PK" + data)
    assert "is no chunk of microrad" in said(chunk_format.unpack_chunk, "a text of a damaged ledger" * 9)
    assert "damaged" in said(chunk_format.unpack_chunk, data[:-1])
    assert "these bytes are a trace, not a chunk" in said(chunk_format.unpack_chunk, chunk_format.pack_trace(TRACE))
    newer = data[:8] + (2).to_bytes(2, "little") + data[10:-32]
    assert "format 2, and this microrad reads 1" in said(
        chunk_format.unpack_chunk, newer + hashlib.sha256(newer).digest()
    )


def test_columns_of_unequal_length_are_refused():
    columns = {"row": np.arange(4.0), "margin": np.arange(3.0)}
    message = said(chunk_format.pack_chunk, Chunk(1, 2, columns, (), np.zeros(0), np.zeros(0)))
    assert "chunk 2 of cell 1" in message and "(3,)" in message and "(4,)" in message
    assert "shapes" in said(
        chunk_format.pack_chunk, Chunk(1, 2, {"row": np.zeros((2, 2))}, (), np.zeros(0), np.zeros(0))
    )


@pytest.mark.parametrize("shapes", [((4,), (3,)), ((2, 2), (2, 2)), ((), ())], ids=str)
def test_columns_of_unequal_length_or_more_axes_are_not_read_either(shapes):
    columns = {f"column {name}": np.zeros(shape) for name, shape in zip(("row", "margin"), shapes, strict=True)}
    header = {"cell": 1, "number": 2, "columns": ["row", "margin"], "failed": []}
    data = chunk_format.pack("chunk", header, columns | {"survival": np.zeros(0), "survival_square": np.zeros(0)})
    assert f"chunk 2 of cell 1 has columns of shapes {sorted(set(shapes))}" in said(chunk_format.unpack_chunk, data)


def forged(kind, header, table):
    """Bytes of a record with the right checksum, whatever is in it."""
    words = json.dumps({"arrays": table, "rest": 0, "header": header}).encode()
    body = struct.pack("<8sHHI", b"microrad", 1, {"chunk": 1, "trace": 2, "head": 3}[kind], len(words)) + words
    body += bytes(8)
    return body + hashlib.sha256(body).digest()


@pytest.mark.parametrize(
    "table",
    [
        [["survival", [10**8], 10**8, 0]],
        [["survival", [2**13, 2**13], 2**26, 0]],
        [["survival", [2**25], 2**25, 0], ["survival_square", [1], 1, 0]],
        [["survival", [-1], 0, 0]],
        [["survival", [4], 4, 4]],
        [["survival", [1.0], 1, 0]],
        [["survival", [True], 1, 0]],
        [["survival", "1", 1, 0]],
        [["survival", [1]]],
        [7],
        {},
    ],
)
def test_bytes_of_a_stranger_with_the_right_checksum_ask_for_no_memory_and_are_refused(table):
    header = {"cell": 0, "number": 0, "columns": [], "failed": []}
    assert "is laid out as microrad never does" in said(chunk_format.unpack_chunk, forged("chunk", header, table))


@pytest.mark.parametrize("header", [[], 7, {}, {"cell": 0, "number": 0, "columns": ["x"], "failed": []}])
def test_a_header_of_a_stranger_is_refused(header):
    assert "is laid out as microrad never does" in said(chunk_format.unpack_chunk, forged("chunk", header, []))
    assert "is laid out as microrad never does" in said(chunk_format.unpack_trace, forged("trace", header, []))
    assert "is laid out as microrad never does" in said(chunk_format.unpack_head, forged("head", header, []))


# ----------------------------------------------------------------------------------------------------------- the rows
def test_chunks_come_in_order_however_they_were_put(path):
    with Ledger.create(path, HEAD) as ledger:
        assert ledger.done() == set() and list(ledger.chunks(0)) == []
        for number in (4, 0, 2):
            ledger.put(0, number, packed(number))
        ledger.put(1, 0, packed(0, 1))
        assert [each.number for each in ledger.chunks(0)] == [0, 2, 4]
    with Ledger.open(path, write=False) as ledger:
        assert ledger.head == HEAD
        assert ledger.done() == {(0, 0), (0, 2), (0, 4), (1, 0)}
        assert ledger.get(0, 2) == packed(2) and ledger.get(0, 1) is None
        assert [each.cell for each in ledger.chunks(1)] == [1]
        found = verify(path, [(0, 0), (0, 1), (0, 2)])
        assert (found.checked, found.damaged, found.missing, found.faults, found.sound) == (4, (), ((0, 1),), (), True)


@pytest.mark.promise("campaigns-57")
def test_a_chunk_twice_is_one_chunk_and_with_other_content_is_refused(path):
    other = replace(chunk(0), failed=())
    with Ledger.create(path, HEAD) as ledger:
        ledger.put(0, 0, packed(0))
        ledger.put(0, 0, packed(0))
        message = said(ledger.put, 0, 0, chunk_format.pack_chunk(other))
        assert "chunk 0 of cell 0 came out otherwise" in message and "same microrad" in message
        assert ledger.get(0, 0) == packed(0)


def test_what_is_no_chunk_of_this_campaign_is_refused(path):
    renamed = replace(chunk(0), columns={"row": np.zeros(2), "margin": np.zeros(2)})
    with Ledger.create(path, HEAD) as ledger:
        assert "chunk 1 of cell 0 came for chunk 0 of cell 0" in said(ledger.put, 0, 0, packed(1))
        assert "damaged" in said(ledger.put, 0, 0, packed(0)[:-1])
        message = said(ledger.put, 0, 0, chunk_format.pack_chunk(renamed))
        assert "columns row, margin" in message and "row, weight, margin" in message
        assert ledger.done() == set()
        ledger.put(0, 0, packed(0))
        assert ledger.done() == {(0, 0)}


def test_notes_and_traces_are_kept_and_replaced(path):
    with Ledger.create(path, HEAD) as ledger:
        ledger.note("seconds", 1.5)
        ledger.note("seconds", 2.5)
        ledger.note("state", {"rounds": [1, 2]})
        ledger.put_trace(TRACE)
        ledger.put_trace(replace(TRACE, value=-2.0))
        ledger.put_trace(replace(TRACE, row=3))
    with Ledger.open(path, write=True) as ledger:
        notes = ledger.notes()
        assert (notes["seconds"], notes["state"], notes["writer"]["pid"]) == (2.5, {"rounds": [1, 2]}, os.getpid())
        assert [(trace.row, trace.value) for trace in ledger.traces()] == [(3, -1.5), (17, -2.0)]
        ledger.drop_trace(TRACE)
        assert [trace.row for trace in ledger.traces()] == [3]


def test_a_still_ledger_is_read_as_it_was(path):
    filled(path, 2)
    with Ledger.open(path, write=True) as writer, Ledger.open(path, write=False) as reader:
        with reader.still():
            before = reader.done()
            writer.put(0, 2, packed(2))
            assert reader.done() == before == {(0, 0), (0, 1), (1, 0)}
        assert reader.done() == before | {(0, 2)}


def test_other_hashes_are_refused_with_both(path):
    now = HEAD.hashes | {"code": "dd", "mission": "ee"}
    check_same(HEAD.hashes, dict(HEAD.hashes), path)
    message = said(check_same, HEAD.hashes, now, path)
    assert "another code and mission" in message
    assert "code: cc in the ledger, dd now" in message and "mission: bb in the ledger, ee now" in message
    assert "aa" not in message


# --------------------------------------------------------------------------------------------------------- refusals
def test_a_ledger_is_never_begun_over_a_file_nor_opened_where_none_is(path, tmp_path):
    assert "there is no ledger" in said(Ledger.open, path, write=True)
    assert "there is no ledger" in said(verify, path)
    assert list(tmp_path.iterdir()) == []
    path.write_text("my notes")
    assert "there is already" in said(Ledger.create, path, HEAD)
    assert path.read_text() == "my notes"
    assert "there is no folder" in said(Ledger.create, tmp_path / "none" / "x.ledger", HEAD)
    assert list(tmp_path.iterdir()) == [path]


ANEW = "name the file that `microrad campaign run` wrote, or, if it is this one, begin the campaign anew in another"


@pytest.mark.promise("campaigns-46")
@pytest.mark.parametrize("write", [True, False])
def test_files_that_are_no_ledger_are_refused(path, write):
    path.write_text("my notes, which are long enough for SQLite to look at\n" * 100)
    assert "is no ledger, or its first page is damaged" in said(Ledger.open, path, write=write)
    path.write_bytes(bytes([0xA5]) * 5000)
    message = said(Ledger.open, path, write=write)
    assert "is no ledger, or its first page is damaged" in message and message.endswith(ANEW)
    path.unlink()
    with contextlib.closing(sqlite3.connect(path)) as other, other:
        other.execute("CREATE TABLE birds(name)")
    message = said(Ledger.open, path, write=write)
    assert "no ledger of microrad, or its first page is damaged" in message and message.endswith(ANEW)
    before = path.read_bytes()
    assert "no ledger of microrad" in said(verify, path) and "no ledger of microrad" in said(mend, path)
    assert path.read_bytes() == before


UNREADABLE = r"microrad cannot read whether it is a ledger \(.+\): make file and folder readable, or name a file else"


def test_a_file_that_sqlite_cannot_open_is_refused_in_words(tmp_path):
    folder = tmp_path
    while len(str(folder)) < 600:  # longer than SQLite takes, and not too long for the system
        folder /= "f" * 100
    folder.mkdir(parents=True)
    path = folder / "c.ledger"
    refuse_existing(path)
    path.write_bytes(b"something")
    for call in (refuse_existing, verify, lambda of: Ledger.open(of, write=False), lambda of: Ledger.create(of, HEAD)):
        message = said(call, path)
        assert message.startswith(str(path)) and re.search(UNREADABLE, message)
    assert path.read_bytes() == b"something" and list(folder.iterdir()) == [path]


def test_a_file_that_may_not_be_read_is_refused_in_words(path, tmp_path):
    payloads = filled(path, 1)
    for forbidden in (path, tmp_path):
        mode = forbidden.stat().st_mode
        forbidden.chmod(0)
        try:
            if os.access(path, os.R_OK):
                pytest.skip("the superuser may read all")
            assert re.search(UNREADABLE, said(refuse_existing, path)) and re.search(UNREADABLE, said(verify, path))
        finally:
            forbidden.chmod(mode)
    assert verify(path, payloads).checked == 2


def test_another_format_of_the_ledger_is_refused(path):
    filled(path, 1)
    with contextlib.closing(sqlite3.connect(path)) as ledger:
        ledger.execute("PRAGMA user_version = 7")
    assert "a ledger of format 7, and this microrad knows 1" in said(Ledger.open, path, write=True)


def test_a_ledger_of_a_later_microrad_is_not_mended_into_this_format(path, monkeypatch):
    assert chunk_format.VERSION == FORMAT  # else the head of a later ledger could be read
    with monkeypatch.context() as later:
        later.setattr("microrad.campaign.ledger.chunk_format.VERSION", 2)
        later.setattr("microrad.campaign.ledger.file.FORMAT", 2)
        filled(path, 2)
        assert verify(path).sound
    whole = path.read_bytes()
    for call in (verify, mend):
        assert "a ledger of format 2, and this microrad knows 1: use the microrad that began it" in said(call, path)
    assert path.read_bytes() == whole


def test_nothing_is_written_through_a_ledger_open_for_reading(path):
    filled(path, 1)
    with Ledger.open(path, write=False) as ledger:
        assert "is open for reading" in said(ledger.put, 0, 1, packed(1))
        assert "is open for reading" in said(ledger.note, "state", "running")
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            ledger._connection.execute("DELETE FROM chunks")
        assert ledger.done() == {(0, 0), (1, 0)}


# ----------------------------------------------------------------------------------------------------------- damage
def flip(path, at, bit=0):
    with path.open("r+b") as file:
        file.seek(at)
        byte = file.read(1)[0]
        file.seek(at)
        file.write(bytes([byte ^ 1 << bit]))


def mended(path, payloads):
    """Mend, see that only whole chunks are left, do the others again, and see that all is as it was; what was lost."""
    mend(path)
    assert verify(path).sound
    with Ledger.open(path, write=True) as ledger:
        assert ledger.head == HEAD
        lost = set(payloads) - ledger.done()
        for cell, number in lost:
            ledger.put(cell, number, payloads[cell, number])
        assert {key: ledger.get(*key) for key in ledger.done()} == payloads
        assert verify(path, payloads).checked == len(payloads)
    return lost


def test_a_bit_flipped_in_a_payload_or_its_checksum_costs_one_chunk(path):
    payloads = filled(path)
    whole = path.read_bytes()
    middle = whole.index(payloads[0, 7][-600:-500])
    checksum = whole.index(payloads[0, 7][:400]) - 10
    for at in (middle, checksum):
        path.write_bytes(whole)
        flip(path, at, 5)
        found = verify(path, payloads)
        assert (found.damaged, found.missing, found.faults, found.sound) == (((0, 7),), (), (), False)
        with Ledger.open(path, write=False) as ledger:
            assert "chunk 7 of cell 0 is damaged" in said(ledger.get, 0, 7)
            assert "chunk 7 of cell 0 is damaged" in said(list, ledger.chunks(0))
            assert ledger.get(0, 6) == payloads[0, 6]
        assert mended(path, payloads) == {(0, 7)}


def test_mending_reads_each_chunk_once_where_sqlite_gets_to_the_end(path, monkeypatch):
    payloads, hashed, real = filled(path), [], mending.file.digest
    monkeypatch.setattr(mending.file, "digest", lambda *parts: hashed.append(parts[:-1]) or real(*parts))
    flip(path, path.read_bytes().index(payloads[0, 7][-600:-500]), 5)
    mend(path)
    assert sorted(each for each in hashed if len(each) == 2) == sorted(payloads)


@pytest.mark.promise("campaigns-46")
def test_a_bit_flipped_in_one_copy_of_the_head_costs_nothing_and_in_both_is_told(path):
    payloads = filled(path)
    first = path.read_bytes().index(b'b.toml"]')
    flip(path, first)
    found = verify(path)
    assert len(found.faults) == 1 and "of the head" in found.faults[0] and not found.sound
    assert mended(path, payloads) == set()
    whole = path.read_bytes()
    first = whole.index(b'b.toml"]')
    for at in (first, whole.index(b'b.toml"]', first + 1)):
        flip(path, at)
    damaged = path.read_bytes()
    for call in (verify, mend, lambda of: Ledger.open(of, write=True)):
        assert "both copies of its head are damaged; begin the campaign anew in another file" in said(call, path)
    assert path.read_bytes() == damaged


def test_a_bit_flipped_in_a_note_or_a_trace_costs_that_alone(path):
    payloads = filled(path)
    with Ledger.open(path, write=True) as ledger:
        ledger.note("story", "once upon a time")
    flip(path, path.read_bytes().index(b"upon"))
    flip(path, path.read_bytes().index(TRACE.error_rad.tobytes()))
    found = verify(path)
    assert sorted(found.faults) == [
        "damaged among the notes: ('story',)",
        "damaged among the traces: (0, 17, 'margin')",
    ]
    with Ledger.open(path, write=False) as ledger:
        assert "story" not in ledger.notes() and ledger.notes()["rounds"] == 2
    assert mended(path, payloads) == set()
    with Ledger.open(path, write=False) as ledger:
        assert ledger.traces() == () and ledger.notes()["rounds"] == 2


def opened(path):
    """Whether a damaged ledger can be opened; where it cannot, one error says what to do, and nothing is changed."""
    damaged = path.read_bytes()
    try:
        verify(path)
    except CampaignError as error:
        said_so = str(error)
    else:
        return True
    assert any(words in said_so for words in ("begin the campaign anew", "name the file that", "use the microrad"))
    assert said(mend, path) and path.read_bytes() == damaged
    return False


@pytest.mark.promise("campaigns-2", "campaigns-46")
def test_wherever_a_bit_flips_it_is_found_or_harmless_and_what_can_be_read_is_kept(path_in_memory):
    path = path_in_memory
    payloads = filled(path)
    whole = path.read_bytes()
    draw = random.Random(2)
    lost, found = [], 0
    spots = [*range(0, 100, 3), *(page + draw.randrange(4096) for page in range(0, len(whole), 4096))]
    spots += [page + draw.randrange(12) for page in range(0, len(whole), 4096)]  # where SQLite keeps a page's order
    for at in spots:
        path.write_bytes(whole)
        flip(path, at, draw.randrange(8))
        if not opened(path):
            assert at < 4096
            continue
        sound = verify(path, payloads)
        if sound.sound and not sound.missing:
            with Ledger.open(path, write=False) as ledger:
                assert {key: ledger.get(*key) for key in ledger.done()} == payloads
        else:
            found += 1
            lost.append(len(mended(path, payloads)))
    assert found > len(spots) / 2
    assert sum(each <= 1 for each in lost) > 0.8 * len(lost)


def test_a_page_overwritten_by_another_program_costs_little_but_for_those_that_lead_to_others(path_in_memory):
    path = path_in_memory
    payloads = filled(path)
    whole = path.read_bytes()
    pages, cheap = len(whole) // 4096, 0
    for page in range(pages):
        path.write_bytes(whole[: 4096 * page] + b"\xa5" * 4096 + whole[4096 * (page + 1) :])
        if opened(path):
            assert not verify(path).sound, page
            cheap += len(mended(path, payloads)) <= 8
    assert cheap > 0.9 * pages


@pytest.mark.promise("campaigns-46")
def test_a_file_cut_short_is_told(path):
    filled(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3 + 100])
    for call in (verify, mend, lambda of: Ledger.open(of, write=True)):
        message = said(call, path)
        assert "the file is damaged" in message and "begin the campaign anew in another file" in message
    assert path.read_bytes() == whole[: len(whole) * 2 // 3 + 100]


# ------------------------------------------------------------------------------------------- ledgers from anywhere
ENDLESS = "WITH RECURSIVE c(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM c) SELECT 0 cell, n number, n sha256, n payload"


@pytest.mark.promise("campaigns-46")
@pytest.mark.parametrize(
    "changes, named",
    [
        (["DROP TABLE chunks", f"CREATE VIEW chunks AS {ENDLESS} FROM c"], "the view 'chunks'"),
        (["CREATE TRIGGER t AFTER INSERT ON notes BEGIN DELETE FROM chunks; END"], "the trigger 't'"),
        (["CREATE TABLE birds(name)"], "the table 'birds'"),
        (["DROP TABLE traces"], "not all tables of a ledger"),
        (["ALTER TABLE notes ADD COLUMN more"], "the table 'notes'"),
    ],
)
@pytest.mark.parametrize("logged", [False, True], ids=["in the file", "in the log"])
def test_only_the_tables_of_a_ledger_are_read(path, changes, named, logged):
    filled(path, 3)
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as other:
        for change in changes:
            other.execute(change)
        files = {each: each.read_bytes() for each in path.parent.iterdir()}
    for each, content in files.items() if logged else ():
        each.write_bytes(content)
    for write in (False, True):
        message = said(Ledger.open, path, write=write)
        assert f"{path} defines {named}" in message and "begin the campaign anew in another file" in message
    assert said(verify, path) == said(mend, path) == message


def left_behind(path, count):
    """A ledger as a kill leaves it: its chunks are in the log alone; the bytes of each file and chunk."""
    payloads = {(0, number): packed(number) for number in range(count)}
    with Ledger.create(path, HEAD) as ledger:
        for (cell, number), payload in payloads.items():
            ledger.put(cell, number, payload)
        files = {each: each.read_bytes() for each in path.parent.iterdir()}
    for each, content in files.items():
        each.write_bytes(content)
    return files, payloads


@pytest.mark.promise("campaigns-46")
def test_a_damaged_log_of_a_killed_writer_costs_what_is_behind_the_damage(path):
    """SQLite ends a log at the first frame whose checksum is wrong: those chunks are missing, and are done again."""
    files, payloads = left_behind(path, 8)
    log = path.with_name(path.name + "-wal")
    last = (log.stat().st_size - 32) // 4120 - 1
    spots = [(at, 0) for at in (2, 5, 17, 27)]  # magic number, version, salt, sum
    spots += [(32 + 4120 * frame + at, 3) for frame in (0, 9, last) for at in (3, 9, 17, 1000)]
    counts = set()
    for at, bit in spots:
        for each, content in files.items():
            each.write_bytes(content)
        flip(log, at, bit)
        found = verify(path, payloads)
        assert found.sound and len(found.missing) == len(payloads) - found.checked, at
        counts.add(found.checked)
        with Ledger.open(path, write=True) as ledger:
            assert {key: ledger.get(*key) for key in ledger.done()}.items() <= payloads.items()
            for cell, number in found.missing:
                ledger.put(cell, number, payloads[cell, number])
        assert verify(path, payloads).missing == ()
    assert min(counts) == 0 and max(counts) >= 7


def test_a_log_whose_last_transaction_was_not_finished_is_whole(path):
    files, payloads = left_behind(path, 8)
    log = path.with_name(path.name + "-wal")
    whole = files[log]
    for size in (0, 20, 32, 1000, 32 + 4120, 32 + 4120 * 2 + 24, len(whole) - 4120, len(whole) - 1):
        for each, content in files.items():
            each.write_bytes(content)
        log.write_bytes(whole[:size])
        assert verify(path).sound
        with Ledger.open(path, write=False) as ledger:
            assert ledger.done() < payloads.keys()
    for each, content in files.items():
        each.write_bytes(content)
    with log.open("ab") as file:  # what an earlier, longer log has left behind
        file.write(bytes([0, 0, 0, 2, 0, 0, 0, 9]) + bytes(range(8)) + bytes(4104) + whole[-50:])
    assert verify(path, payloads).missing == ()


# ----------------------------------------------------------------------------------------------- processes and disks
WRITER = """
    import sys
    from pathlib import Path
    from campaign.test_campaign_ledger import HEAD, packed
    from microrad.campaign.ledger import Ledger
    path = Path(sys.argv[1])
    with Ledger.open(path, write=True) if path.exists() else Ledger.create(path, HEAD) as ledger:
        print("open", flush=True)
        for number in range(len(ledger.done()), int(sys.argv[2])):
            ledger.put(0, number, packed(number))
            print(number, flush=True)
        sys.stdin.read()
"""


@contextlib.contextmanager
def process(path, count):
    """A process that writes chunks until it has this many, and then holds the ledger until it is stopped."""
    arguments = [sys.executable, "-W", "error", "-c", textwrap.dedent(WRITER), str(path), str(count)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])}
    pipe = subprocess.PIPE
    with subprocess.Popen(arguments, stdin=pipe, stdout=pipe, text=True, env=environment) as child:
        try:
            yield child
        finally:
            child.kill()
            child.stdout.read()


@pytest.mark.promise("campaigns-46")
def test_a_second_process_may_read_but_not_write_until_the_first_is_gone(path):
    with process(path, 3) as child:
        assert [child.stdout.readline().strip() for _ in range(4)] == ["open", "0", "1", "2"]
        assert is_written(path)
        refusals = [said(Ledger.open, path, write=True), said(mend, path)]
        for message in refusals:
            assert f"process {child.pid} on " in message and "since 20" in message and "already writes to" in message
        with Ledger.open(path, write=False) as ledger:
            assert ledger.done() == {(0, 0), (0, 1), (0, 2)}
        assert "there is already" in said(Ledger.create, path, HEAD)
        child.kill()
        child.wait()
        assert not is_written(path)
        with Ledger.open(path, write=True) as ledger:
            ledger.put(0, 3, packed(3))
            assert ledger.notes()["writer"]["pid"] == os.getpid()
            assert "already writes to" in said(Ledger.open, path, write=True) and is_written(path)
    assert verify(path).checked == 4


@pytest.mark.promise("campaigns-45")
def test_kills_at_any_moment_lose_and_double_nothing(path):
    draw, acknowledged, kills = random.Random(3), 0, 10 if os.environ.get("MICRORAD_ENDURANCE") else 3
    for _ in range(kills):
        with process(path, 10**6) as child:
            assert "open" in (line.strip() for line in iter(child.stdout.readline, ""))
            lines = [child.stdout.readline() for _ in range(draw.randrange(5))]
            any_moment(draw, 0.03)
            child.kill()
            numbers = "".join([*lines, child.stdout.read()]).split()
        acknowledged = int(numbers[-1]) + 1 if numbers else acknowledged
        with Ledger.open(path, write=False) as ledger:
            count = len(ledger.done())
            assert acknowledged <= count <= acknowledged + 1
            assert verify(path, ((0, number) for number in range(count))).sound
            assert ledger.done() == {(0, number) for number in range(count)}
            assert all(ledger.get(0, number) == packed(number) for number in range(count))
        acknowledged = count
    assert acknowledged > kills


def test_a_creation_that_was_killed_leaves_nothing_in_the_way(path):
    draft = path.with_name(f".{path.name}.part")
    draft.write_bytes(b"half a ledger")
    draft.with_name(draft.name + "-wal").write_bytes(b"half a log")
    filled(path, 2)
    assert verify(path).checked == 3
    assert sorted(each.name for each in path.parent.iterdir()) == [path.name, path.name + ".lock"]


def test_a_ledger_has_no_log_before_it_is_in_its_place(path, monkeypatch):
    """What goes through a log is taken in as the file is closed, and SQLite does not tell where that fails."""
    modes, install = [], file.install

    def looking(draft, place):
        with contextlib.closing(sqlite3.connect(draft)) as connection:
            modes.append(connection.execute("PRAGMA journal_mode").fetchone()[0])
        install(draft, place)
        with contextlib.closing(sqlite3.connect(place)) as connection:
            modes.append(connection.execute("PRAGMA journal_mode").fetchone()[0])

    monkeypatch.setattr(file, "install", looking)
    filled(path, 2)
    assert modes == ["delete", "wal"]


def test_notes_from_the_begin_are_in_a_ledger_that_was_only_made(path, monkeypatch):
    monkeypatch.setattr(Ledger, "open", lambda *args, **how: None)
    Ledger.create(path, HEAD, {"file": "campaign.toml"})
    with contextlib.closing(sqlite3.connect(path)) as connection:
        assert file.notes_in(connection) == {"file": "campaign.toml"}


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 1 MB."""
    folder = tmp_path / "small"
    folder.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], capture_output=True, check=False)
    if made.returncode:
        pytest.skip("this machine does not allow to mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def test_a_full_disk_costs_only_the_chunk_being_written(small_disk):
    path, ballast = small_disk / "c.ledger", small_disk / "ballast"
    ballast.write_bytes(bytes(400_000))
    with Ledger.create(path, HEAD) as ledger:
        count, message = 0, ""
        while not message and count < 1000:
            try:
                ledger.put(0, count, packed(count))
                count += 1
            except CampaignError as error:
                message = str(error)
        assert 10 < count < 1000
        assert f"could not keep chunk {count} of cell 0: the disk is full. {count} chunks are in and stay" in message
        assert f"Free space, then go on with `microrad campaign resume {path}`" in message
        assert len(ledger.done()) == count and ledger.get(0, count - 1) == packed(count - 1)
        assert "the disk is full" in said(ledger.note, "story", "x" * 500_000)
    assert verify(path, [(0, number) for number in range(count + 1)]).missing == ((0, count),)
    ballast.unlink()
    with Ledger.open(path, write=True) as ledger:
        ledger.put(0, count, packed(count))
        assert [each.number for each in ledger.chunks(0)] == list(range(count + 1))
        assert verify(path).sound


def test_a_disk_that_is_full_from_the_start_leaves_no_half_ledger(small_disk):
    (small_disk / "ballast").write_bytes(bytes(1_000_000))
    path = small_disk / "c.ledger"
    assert "could not create the ledger: the disk is full" in said(Ledger.create, path, HEAD)
    assert not path.exists()
    (small_disk / "ballast").unlink()
    filled(path, 1)
    assert verify(path).checked == 2


def test_a_read_only_disk_can_be_read_and_verified_but_not_written(small_disk):
    path = small_disk / "c.ledger"
    payloads = filled(path, 3)
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with Ledger.open(path, write=False) as ledger:
        assert {key: ledger.get(*key) for key in ledger.done()} == payloads
        assert verify(path, payloads).checked == 4
    message = said(Ledger.open, path, write=True)
    assert "could not open the ledger" in message and "Make file and folder" in message
    assert "4 chunks are in and stay" in message


def test_a_program_that_holds_the_file_is_told(path, monkeypatch):
    monkeypatch.setattr("microrad.campaign.ledger.file.PATIENCE_S", 0.1)
    filled(path, 1)
    with Ledger.open(path, write=True) as ledger, contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        message = said(ledger.put, 0, 1, packed(1))
        assert "another program held the file for longer than 0.1 s. 2 chunks are in and stay" in message
        other.execute("ROLLBACK")
        ledger.put(0, 1, packed(1))
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("PRAGMA locking_mode = EXCLUSIVE")
        other.execute("BEGIN EXCLUSIVE")
        assert "another program held the file" in said(verify, path)  # which is no damage
    with Ledger.open(path, write=False) as ledger:
        assert len(ledger.done()) == 3


@pytest.mark.promise("campaigns-45")
def test_a_chunk_is_written_through_to_the_disk_with_its_sha256(path):
    """SQLite's `synchronous = FULL` (2): each transaction ends behind a sync of the log."""
    with Ledger.create(path, HEAD) as ledger:
        assert ledger._connection.execute("PRAGMA synchronous").fetchone() == (2,)
        assert not ledger._connection.in_transaction
        ledger.put(0, 0, packed(0))
        assert not ledger._connection.in_transaction
        ((checksum, payload),) = ledger._connection.execute("SELECT sha256, payload FROM chunks").fetchall()
    assert payload == packed(0)
    assert checksum == file.digest(0, 0, payload) and len(checksum) == 32
    assert checksum != file.digest(0, 1, payload)


def test_what_a_ledger_refuses_is_told_in_full(path):
    renamed = replace(chunk(3, 1), columns={"row": np.zeros(2), "margins": np.zeros(2)})
    with Ledger.create(path, HEAD) as book:
        assert said(book.put, 1, 4, packed(3, 0)) == "chunk 3 of cell 0 came for chunk 4 of cell 1"
        assert said(book.put, 1, 3, chunk_format.pack_chunk(renamed)) == (
            "chunk 3 of cell 1 has the columns row, margins, and the ledger is of row, weight, margin: its worker runs "
            "another microrad"
        )
        book.put(1, 3, packed(3, 1))
        assert said(book.put, 1, 3, chunk_format.pack_chunk(replace(chunk(3, 1), failed=()))) == (
            f"{path}: chunk 3 of cell 1 came out otherwise than when it was first done: the workers do not compute the "
            "same; check that all run the same microrad and libraries"
        )
        assert said(book._sound, 1, 3, b"", packed(3, 1)) == (
            f"{path}: chunk 3 of cell 1 is damaged, its checksum differs; `microrad campaign resume "
            f"{file.argument(path)}` does it again"
        )
        assert (book.count(), book.done(), book.get(1, 4), book.get(0, 3)) == (1, {(1, 3)}, None, None)
    with Ledger.open(path, write=False) as book:
        doing = {
            f"{path} is open for reading, so microrad cannot keep chunk 4 of cell 1": (book.put, 1, 4, packed(4, 1)),
            f"{path} is open for reading, so microrad cannot note 'state'": (book.note, "state", 1),
            f"{path} is open for reading, so microrad cannot keep the trace of row 17 of cell 0": (
                book.put_trace,
                TRACE,
            ),
            f"{path} is open for reading, so microrad cannot drop the trace of row 17 of cell 0": (
                book.drop_trace,
                TRACE,
            ),
        }
        assert [said(*call) for call in doing.values()] == list(doing)


def test_hashes_that_differ_or_are_missing_on_a_side_are_told_each_in_its_line():
    message = said(check_same, {"b": "1", "a": "2", "d": "5"}, {"a": "3", "c": "4", "d": "5"}, "x.ledger")
    assert message == (
        "x.ledger was begun with another a and b and c, so its rows would not belong together:\n"
        "  a: 2 in the ledger, 3 now\n"
        "  b: 1 in the ledger, None now\n"
        "  c: None in the ledger, 4 now\n"
        "bring back what it was begun with, or begin the campaign anew in another file"
    )


def test_what_was_added_comes_in_the_order_in_which_it_came_behind_its_mark(path):
    with Ledger.create(path, HEAD) as book:
        for number, cell in ((2, 1), (0, 0), (1, 1)):
            book.put(cell, number, packed(number, cell))
        found = list(book.added(0))
        assert [(each.cell, each.number) for _, each in found] == [(1, 2), (0, 0), (1, 1)]
        assert [(each.cell, each.number) for _, each in book.added(found[0][0])] == [(0, 0), (1, 1)]
        assert [each.number for each in book.chunks(1)] == [1, 2]
        assert list(book.added(found[-1][0])) == []


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (sqlite3.SQLITE_FULL, "the disk is full. {safe}Free space, then {again}"),
        (
            sqlite3.SQLITE_IOERR,
            "the disk does not take or give the data (odd). {safe}Check the disk and its space, then {again}",
        ),
        (sqlite3.SQLITE_READONLY, "odd. {safe}Make file and folder writable, then {again}"),
        (sqlite3.SQLITE_CANTOPEN, "odd. {safe}Make file and folder readable and writable, then {again}"),
        (sqlite3.SQLITE_PERM, "odd. {safe}Make file and folder readable and writable, then {again}"),
        (
            sqlite3.SQLITE_BUSY,
            "another program held the file for longer than 30 s. {safe}Close that program, then {again}",
        ),
        (sqlite3.SQLITE_ERROR, "odd. {safe}See to that, then {again}"),
        (
            sqlite3.SQLITE_CORRUPT,
            "the file is damaged (odd). `microrad campaign resume {path}` goes on with what can be read of it; where "
            "nothing can, begin the campaign anew in another file",
        ),
    ],
)
def test_an_error_of_sqlite_says_what_is_in_and_what_to_do(path, code, words):
    filled(path, 3)
    error = sqlite3.OperationalError("odd")
    error.sqlite_errorcode = code | 5 << 8  # an extended code says more, and means the same
    typed = file.argument(path)
    safe = "4 chunks are in and stay; only what was being written is lost. "
    wanted = words.format(safe=safe, again=f"go on with `microrad campaign resume {typed}`", path=typed)

    def fail():
        with file.errors_in_words(path, "do it"):
            raise error

    assert said(fail) == f"{path}: microrad could not do it: {wanted}"


def test_an_error_of_the_file_system_and_a_damaged_text_are_told_in_words(tmp_path):
    def fail(error):
        with file.errors_in_words(tmp_path / "a b", "do it"):
            raise error

    begin = f"{tmp_path / 'a b'}: microrad could not do it: "
    assert said(fail, OSError(28, "No space")) == f"{begin}No space"
    assert said(fail, OSError("odd")) == f"{begin}odd"
    damaged = said(fail, UnicodeDecodeError("utf-8", b"x", 0, 1, "odd"))
    assert damaged.startswith(f"{begin}the file is damaged (a text in it is none). `microrad campaign resume '")
    assert file._safe(tmp_path / "none") == ""


def test_what_is_there_or_not_is_told_in_full(tmp_path):
    other, there, folder = tmp_path / "a.txt", tmp_path / "b c.ledger", tmp_path / "d"
    other.write_text("mine")
    folder.mkdir()
    Ledger.create(there, HEAD).close()
    assert said(file.refuse_existing, other) == (
        f"there is already {other}, which is no ledger, and it stays: name another with --ledger"
    )
    assert said(file.refuse_existing, there) == (
        f"there is already {there}: go on with `microrad campaign resume '{there}'`, or name another with --ledger"
    )
    assert said(file.refuse_existing, tmp_path / "no" / "x.ledger") == (
        f"there is no folder {tmp_path / 'no'} for x.ledger: make it, or choose another"
    )
    assert said(file.refuse_foreign, folder) == (
        f"{folder} is a folder, not a ledger: name the file that `microrad campaign run` wrote"
    )
    assert said(file.refuse_foreign, tmp_path / "x") == (
        f"there is no ledger {tmp_path / 'x'}: begin the campaign with `microrad campaign run`"
    )
    assert said(file.refuse_foreign, other) == f"{other} is no ledger, or its first page is damaged: {ANEW}"
    campaign = other.rename(tmp_path / "a b.toml")
    assert said(file.refuse_foreign, campaign) == (
        f"{campaign} is no ledger, or its first page is damaged: begin it with `microrad campaign run '{campaign}'`, "
        "or name the file that this wrote"
    )


def test_every_fault_of_the_small_things_in_a_ledger_is_named(path):
    with Ledger.create(path, HEAD, {"seconds": 2.5, "state": "running"}) as book:
        book.put(0, 2, packed(2))
        book.put(1, 0, packed(0, 1))
        book.put_trace(TRACE)
        book.put_trace(replace(TRACE, row=3))
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE notes SET value = '3.5' WHERE key = 'seconds'")
        connection.execute("UPDATE traces SET row = 4 WHERE row = 3")
        connection.execute("UPDATE chunks SET number = 7 WHERE cell = 1")
        connection.execute("DELETE FROM head_again")
    found = verify(path, [(1, 0), (0, 2), (0, 1), (1, 7)])
    assert (found.checked, found.damaged, found.missing, found.sound) == (1, ((1, 7),), ((0, 1), (1, 0)), False)
    head, trace, note = found.faults
    assert head.startswith("copy 2 of the head: ")
    assert trace == f"damaged among the traces: (0, 4, '{TRACE.output}')"
    assert note == "damaged among the notes: ('seconds',)"
    with Ledger.open(path, write=False) as book:
        assert "seconds" not in book.notes() and book.notes()["state"] == "running"
    mend(path)
    with Ledger.open(path, write=False) as book:
        assert book.done() == {(0, 2)} and [each.row for each in book.traces()] == [TRACE.row]
        assert book.head == HEAD


# ------------------------------------------------------------------------------------------ several cells and outputs
def trace_of(cell, row, output, value):
    """A trace whose numbers are all unlike each other."""
    numbers = np.random.default_rng([cell, row])
    return WorstTrace(cell, row, output, value, np.arange(4.0) + row, numbers.random((4, 2)), numbers.random((4, 3)))


def test_traces_are_told_apart_by_cell_row_and_output(path):
    kept = [(1, 2, "margin"), (0, 9, "residual"), (0, 9, "margin"), (0, 2, "margin"), (1, 9, "margin")]
    with Ledger.create(path, HEAD) as ledger:
        for k, each in enumerate(kept):
            ledger.put_trace(trace_of(*each, float(k)))
        assert [(t.cell, t.output, t.row, t.value) for t in ledger.traces()] == [
            (0, "margin", 2, 3.0), (0, "margin", 9, 2.0), (0, "residual", 9, 1.0), (1, "margin", 2, 0.0),
            (1, "margin", 9, 4.0),
        ]  # fmt: skip
        (second,) = [t for t in ledger.traces() if (t.cell, t.row) == (1, 9)]
        wanted = trace_of(1, 9, "margin", 4.0)
        assert all(same_bits(getattr(second, n), getattr(wanted, n)) for n in ("time_s", "error_rad", "drive_v"))
        ledger.drop_trace(trace_of(0, 9, "margin", 7.0))
        assert {(t.cell, t.row, t.output) for t in ledger.traces()} == {*kept} - {(0, 9, "margin")}
        ledger.drop_trace(trace_of(1, 9, "residual", 7.0))  # there is none
        assert len(ledger.traces()) == 4


def test_what_came_in_behind_a_mark_comes_in_its_order_with_its_own_mark(path):
    came = [(1, 3), (0, 5), (1, 0), (0, 2)]
    with Ledger.create(path, HEAD) as ledger:
        for cell, number in came:
            ledger.put(cell, number, packed(number, cell))
        ledger.put(1, 3, packed(3, 1))  # is in already
        whole = list(ledger.added(0))
        assert [(at, each.cell, each.number) for at, each in whole] == [(k + 1, *each) for k, each in enumerate(came)]
        assert [(each.cell, each.number) for _, each in ledger.added(2)] == came[2:]
        assert (list(ledger.added(4)), ledger.count()) == ([], 4)
        assert [each.number for each in ledger.chunks(1)] == [0, 3]
    flip(path, path.read_bytes().index(packed(0, 1)[-600:-500]), 5)
    with Ledger.open(path, write=False) as ledger:
        found = ledger.added(1)
        assert (next(found)[1].cell, "chunk 0 of cell 1 is damaged" in said(next, found)) == (0, True)
    assert verify(path, [(1, 7), (0, 1), (1, 0)]).missing == ((0, 1), (1, 7))
    assert verify(path).damaged == ((1, 0),)
    mend(path)
    with Ledger.open(path, write=False) as ledger:
        kept = [(1, 1, 3), (2, 0, 5), (4, 0, 2)]  # with their marks
        assert [(at, each.cell, each.number) for at, each in ledger.added(0)] == kept


@pytest.mark.parametrize(
    ("code", "text", "what", "remedy"),
    [
        (sqlite3.SQLITE_FULL, "x", "the disk is full", "Free space"),
        (
            sqlite3.SQLITE_IOERR_WRITE,
            "x",
            "the disk does not take or give the data (x)",
            "Check the disk and its space",
        ),
        (sqlite3.SQLITE_READONLY_DIRECTORY, "a", "a", "Make file and folder writable"),
        (sqlite3.SQLITE_CANTOPEN, "b", "b", "Make file and folder readable and writable"),
        (sqlite3.SQLITE_PERM, "c", "c", "Make file and folder readable and writable"),
        (sqlite3.SQLITE_BUSY_SNAPSHOT, "d", "another program held the file for longer than 30 s", "Close that program"),
        (sqlite3.SQLITE_NOMEM, "out of memory", "out of memory", "See to that"),
    ],
)
def test_each_error_of_sqlite_says_what_is_in_and_what_to_do(path, code, text, what, remedy):
    filled(path, 2)
    error = sqlite3.OperationalError(text)
    error.sqlite_errorcode = code

    def told(where):
        with file.errors_in_words(where, "keep chunk 7 of cell 1"):
            raise error

    none, safe = path.with_name("none"), "3 chunks are in and stay; only what was being written is lost. "
    for where, typed, counted in ((path, f"'{path}'", safe), (none, f"{none}", "")):
        assert said(told, where) == (
            f"{where}: microrad could not keep chunk 7 of cell 1: {what}. {counted}{remedy}, then go on with `microrad "
            f"campaign resume {typed}`"
        )


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
        (OSError("odd"), "odd"),
        (
            UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"),
            "the file is damaged (a text in it is none). `microrad campaign resume x.ledger` goes on with what can be "
            "read of it; where nothing can, begin the campaign anew in another file",
        ),
    ],
)
def test_errors_of_the_system_and_of_texts_are_told_in_words(error, words):
    def fail():
        with file.errors_in_words(Path("x.ledger"), "read the notes"):
            raise error

    assert said(fail) == f"x.ledger: microrad could not read the notes: {words}"


@pytest.mark.parametrize("name", ["plain.ledger", "a b.ledger", "it's.ledger"])
def test_what_is_to_be_typed_has_the_path_in_quotes_where_it_needs_them(tmp_path, name):
    path = tmp_path / name
    typed = {"plain.ledger": f"{path}", "a b.ledger": f"'{path}'", "it's.ledger": f"'{tmp_path}/it'\"'\"'s.ledger'"}[
        name
    ]
    filled(path, 1)
    assert said(refuse_existing, path) == (
        f"there is already {path}: go on with `microrad campaign resume {typed}`, or name another with --ledger"
    )
    with Ledger.open(path, write=True) as ledger:
        busy = said(Ledger.open, path, write=True)
        since = ledger.notes()["writer"]["since"]
    assert busy == (
        f"process {os.getpid()} on {platform.node()}, since {since}, already writes to {path}: wait for it or stop it; "
        f"how far it is says `microrad campaign status {typed}`"
    )
    flip(path, path.read_bytes().index(packed(0)[-600:-500]), 5)
    with Ledger.open(path, write=False) as ledger:
        assert said(ledger.get, 0, 0) == (
            f"{path}: chunk 0 of cell 0 is damaged, its checksum differs; `microrad campaign resume {typed}` does it "
            "again"
        )
    file_there, folder = tmp_path / "c d.toml", tmp_path / "folder.ledger"
    file_there.write_text("seed = 1\n")
    folder.mkdir()
    assert said(file.refuse_foreign, file_there) == (
        f"{file_there} is no ledger, or its first page is damaged: begin it with `microrad campaign run "
        f"'{file_there}'`, or name the file that this wrote"
    )
    assert said(file.refuse_foreign, folder) == (
        f"{folder} is a folder, not a ledger: name the file that `microrad campaign run` wrote"
    )
    for taken in (file_there, folder):
        assert said(refuse_existing, taken) == (
            f"there is already {taken}, which is no ledger, and it stays: name another with --ledger"
        )


def test_damage_to_a_trace_and_a_note_of_the_second_cell_is_named_by_its_keys(path):
    with Ledger.create(path, HEAD) as ledger:
        for each in ((0, 3, "margin"), (1, 17, "residual")):
            ledger.put_trace(trace_of(*each, 1.0))
        ledger.note("second", "twice upon a time")
        ledger.note("first", 1)
    with contextlib.closing(sqlite3.connect(path)) as other, other:
        other.execute("UPDATE traces SET output = 'margin' WHERE cell = 1")
        other.execute("UPDATE notes SET value = '\"thrice\"' WHERE key = 'second'")
        other.execute("DELETE FROM head_again")
    found = verify(path)
    assert (found.checked, found.damaged, found.missing, found.sound) == (0, (), (), False)
    assert found.faults == (
        "copy 2 of the head: this is no head of microrad: resume the campaign",
        "damaged among the traces: (1, 17, 'margin')",
        "damaged among the notes: ('second',)",
    )
    with Ledger.open(path, write=False) as ledger:
        assert (ledger.head, {k for k in ledger.notes() if k != "writer"}) == (HEAD, {"first"})
    mend(path)
    with Ledger.open(path, write=False) as ledger:
        assert [(t.cell, t.row, t.output) for t in ledger.traces()] == [(0, 3, "margin")]
    assert verify(path).sound


@pytest.mark.parametrize("change", [lambda c: {**c, "more": c["row"]}, lambda c: dict(reversed(c.items()))])
def test_a_chunk_of_other_columns_or_in_another_order_is_of_another_microrad(path, change):
    whole = chunk(3)
    with Ledger.create(path, HEAD) as ledger:
        told = said(ledger.put, 0, 3, chunk_format.pack_chunk(replace(whole, columns=change(whole.columns))))
        assert ledger.count() == 0
    assert told.endswith(f"and the ledger is of {', '.join(whole.columns)}: its worker runs another microrad")


class Broken:
    """A connection of which some tables cannot be read."""

    def __init__(self, connection, *tables):
        self.connection, self.tables = connection, tables

    def execute(self, wanted, *values):
        if any(f"FROM {each}" in wanted or f"PRAGMA {each}" in wanted for each in self.tables):
            raise sqlite3.DatabaseError("malformed page")
        return self.connection.execute(wanted, *values)


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        (("traces",), ["the table of traces cannot be read: malformed page"]),
        (("notes",), ["the table of notes cannot be read: malformed page"]),
        (("head_again",), ["copy 2 of the head: malformed page"]),
        (("head ", "notes"), ["the table of notes cannot be read: malformed page"]),
        ((), []),
    ],
)
def test_each_small_table_that_cannot_be_read_is_named(path, tables, told):
    with Ledger.create(path, HEAD, {"state": "running"}) as book:
        book.put_trace(TRACE)
    with closing(sqlite3.connect(path)) as connection:
        assert mending._small_faults(Broken(connection, *tables)) == told


@pytest.mark.parametrize(
    ("tables", "told"), [(("integrity_check",), ["SQLite cannot check its file: malformed page"]), ((), [])]
)
def test_a_file_whose_structure_cannot_be_checked_is_told(path, tables, told):
    with Ledger.create(path, HEAD):
        pass
    with closing(sqlite3.connect(path)) as connection:
        assert mending._structure(Broken(connection, *tables)) == told


def test_chunks_that_cannot_be_read_to_the_end_are_a_fault_of_the_file(path, monkeypatch):
    filled(path, 3)
    monkeypatch.setattr(file, "connected", lambda at, write: closing_of(Broken(sqlite3.connect(at), "chunks")))
    found = verify(path, [(0, 1), (1, 0)])
    assert (found.checked, found.damaged, found.missing) == (0, (), ((0, 1), (1, 0)))
    assert found.faults == ("the table of chunks cannot be read: malformed page",) and not found.sound


def closing_of(broken):
    """It is closed with what it reads from."""
    broken.close = broken.connection.close
    return broken


@pytest.mark.parametrize(("cell", "number"), [(1, 4), (0, 7), (2, 0)])
def test_a_chunk_that_came_for_another_names_both(path, cell, number):
    with Ledger.create(path, HEAD) as book, pytest.raises(CampaignError) as told:
        book.put(cell, number, packed(4))
    assert str(told.value) == f"chunk 4 of cell 0 came for chunk {number} of cell {cell}"


def test_what_is_no_ledger_is_not_mended_and_stays(tmp_path):
    other = tmp_path / "notes.txt"
    other.write_bytes(b"no ledger at all, but my notes " * 40)
    with pytest.raises(CampaignError, match="is no ledger, or its first page is damaged"):
        mend(other)
    assert other.read_bytes() == b"no ledger at all, but my notes " * 40
    missing = tmp_path / "none.ledger"
    with pytest.raises(CampaignError, match=rf"^there is no ledger {missing}: begin the campaign with"):
        mend(missing)
    assert not missing.exists() and not file.draft_of(missing).exists()


@pytest.mark.parametrize(
    ("values", "ends"),
    [([1.0], (1, 0)), ([], (0, 0)), ([2.0, 2.0], (2, 0)), ([1.0, 2.0], (1, 1)),
     ([1.0, 1.0, 3.0, 2.0, 2.0, 2.0], (2, 3)),
     ([0.0, -0.0], (1, 1)), ([math.nan, math.nan, 1.0], (2, 1))],
)  # fmt: skip
def test_runs_at_both_ends_are_told_bit_by_bit(values, ends):
    bits = np.array(values).view("<u8") if values else np.zeros(0, dtype="<u8")
    assert chunk_format._ends(bits) == ends
    held = chunk_format._held(len(values), *ends)
    kept = len(values) - max(ends[0] - 1, 0) - max(ends[1] - 1, 0)
    assert (held.start, held.stop - held.start) == (max(ends[0] - 1, 0), kept)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"code": ("aa", "bb")}, "another code, so"),
        ({"code": ("aa", "bb"), "campaign": ("cc", "dd")}, "another campaign and code, so"),
        ({"code": ("aa", None), "mission": (None, "ee")}, "another code and mission, so"),
    ],
)
def test_what_a_ledger_was_begun_with_is_told_in_the_order_of_names(changes, words):
    kept = {name: old for name, (old, _) in changes.items() if old} | {"same": "x"}
    now = {name: new for name, (_, new) in changes.items() if new} | {"same": "x"}
    with pytest.raises(CampaignError) as told:
        check_same(kept, now, Path("b.ledger"))
    lines = [f"  {name}: {changes[name][0]} in the ledger, {changes[name][1]} now" for name in sorted(changes)]
    assert str(told.value).splitlines() == [
        f"b.ledger was begun with {words} its rows would not belong together:",
        *lines,
        "bring back what it was begun with, or begin the campaign anew in another file",
    ]
    check_same(kept, dict(reversed(kept.items())), Path("b.ledger"))


def test_what_is_whole_keeps_its_mark_when_a_ledger_is_mended(path):
    """Whoever reads on behind a mark then misses and doubles nothing; what was damaged comes in behind all others."""
    came = [(1, 3), (0, 5), (1, 0), (0, 2)]
    with Ledger.create(path, HEAD, {"rounds": 3, "file": "a.toml"}) as ledger:
        for cell, number in came:
            ledger.put(cell, number, packed(number, cell))
        ledger.put_trace(TRACE)
        before = [mark for mark, _ in ledger.added(0)]
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE chunks SET sha256 = x'00' WHERE cell = 0 AND number = 5")
        connection.execute("UPDATE notes SET value = '4' WHERE key = 'rounds'")
        connection.execute("UPDATE head SET payload = x'00'")
    assert verify(path).damaged == ((0, 5),)
    mend(path)
    assert verify(path, came) == mending.Verified(3, (), ((0, 5),), ())
    with Ledger.open(path, write=True) as ledger:
        assert ledger.head == HEAD
        assert [(mark, each.cell, each.number) for mark, each in ledger.added(0)] == [
            (before[0], 1, 3), (before[2], 1, 0), (before[3], 0, 2)
        ]  # fmt: skip
        assert {key: value for key, value in ledger.notes().items() if key != "writer"} == {"file": "a.toml"}
        assert [(each.cell, each.row) for each in ledger.traces()] == [(TRACE.cell, TRACE.row)]
        ledger.put(0, 5, packed(5, 0))
        ((mark, again),) = ledger.added(before[3])
        assert mark > before[3] and (again.cell, again.number) == (0, 5)


@pytest.mark.parametrize("change", ["DELETE FROM notes", "UPDATE notes SET value = '{}' WHERE key = 'writer'"])
def test_a_writer_that_is_not_noted_is_another_process(path, monkeypatch, change):
    monkeypatch.setattr(file, "_GLANCE_S", 0.01)
    Ledger.create(path, HEAD).close()
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(change)
    with closing(file.locked(path)):
        assert is_written(path)
        assert said(Ledger.open, path, write=True).startswith(f"another process already writes to {path}: wait for it")
    assert not is_written(path)
    Ledger.open(path, write=True).close()


def test_a_writer_whose_note_has_no_time_is_another_process(path, monkeypatch):
    monkeypatch.setattr(file, "_GLANCE_S", 0.01)
    with Ledger.create(path, HEAD) as ledger:
        ledger.note("writer", {"pid": 7, "host": "here"})
        assert said(Ledger.open, path, write=True).startswith("another process already writes to ")
        ledger.note("writer", {"pid": 7, "host": "here", "since": "noon"})
        assert said(Ledger.open, path, write=True).startswith("process 7 on here, since noon, already writes to ")


@pytest.mark.parametrize("fails", [True, False])
def test_rows_are_read_from_both_ends_where_sqlite_fails_and_once_where_it_does_not(fails):
    """A row with a wrong checksum is left out from either side; nothing is raised."""

    def row(mark, sound=True):
        return mark, f"k{mark}", str(mark), file.digest(f"k{mark}", str(mark) if sound else "other")

    asked = []

    def execute(sql):
        asked.append(sql)
        yield from (row(1), row(2, sound=False), row(4)) if sql.endswith(" ASC") else (row(9), row(7, False), row(6))
        if fails:
            raise sqlite3.DatabaseError("malformed")

    found = [each[0] for each in mending._whole_rows(SimpleNamespace(execute=execute), "notes")]
    assert found == ([1, 4, 9, 6] if fails else [1, 4])
    orders = ("ASC", "DESC")[: 1 + fails]
    assert asked == [f"SELECT rowid, key, value, sha256 FROM notes ORDER BY rowid {order}" for order in orders]


def test_what_a_ledger_that_was_removed_has_left_beside_it_is_not_taken_into_a_new_one(path, tmp_path):
    """The log of a writer that was killed has a chunk in it that would be read."""
    other = tmp_path / "other.ledger"
    with Ledger.create(other, HEAD) as ledger:
        ledger.put(0, 7, packed(7))
        log = other.with_name("other.ledger-wal").read_bytes()
    assert log
    for ending, left in (("-wal", log), ("-shm", b"left"), ("-journal", b"left")):
        path.with_name(path.name + ending).write_bytes(left)
    with Ledger.create(path, HEAD) as ledger:
        assert (ledger.done(), ledger.count()) == (set(), 0)
    assert {each.name for each in tmp_path.glob(f"{glob.escape(path.name)}*")} == {path.name, f"{path.name}.lock"}
    assert verify(path).sound


@pytest.mark.parametrize("fails", ["connected", "note"])
def test_a_ledger_that_cannot_be_opened_to_write_is_left_to_the_next_writer(path, monkeypatch, fails):
    """At once, while the error is still being looked at."""
    Ledger.create(path, HEAD).close()

    def refused(*given, **how):
        raise CampaignError(f"no {fails}")

    with monkeypatch.context() as patch:
        patch.setattr(*((file, "connected") if fails == "connected" else (Ledger, "note")), refused)
        with pytest.raises(CampaignError, match=f"^no {fails}$") as caught:
            Ledger.open(path, write=True)
    assert not is_written(path) and caught.value is not None
    with Ledger.open(path, write=True) as ledger:
        assert is_written(path)
        ledger.note("state", "running")
    assert not is_written(path)


@pytest.mark.parametrize("version", [0, 2, 65535])
def test_bytes_of_an_older_format_are_refused_as_those_of_a_newer_one_are(version):
    data = packed(0)
    other = data[:8] + version.to_bytes(2, "little") + data[10:-32]
    assert f"format {version}, and this microrad reads 1" in said(
        chunk_format.unpack_chunk, other + hashlib.sha256(other).digest()
    )


@pytest.mark.parametrize("version", [0, -1, 2])
def test_a_ledger_of_an_older_format_is_refused_as_that_of_a_newer_one_is(path, version):
    filled(path, 1)
    with contextlib.closing(sqlite3.connect(path)) as ledger:
        ledger.execute(f"PRAGMA user_version = {version}")
    for write in (True, False):
        assert said(Ledger.open, path, write=write) == (
            f"{path} is a ledger of format {version}, and this microrad knows 1: use the microrad that began it"
        )


def test_a_chunk_is_no_trace_and_a_trace_no_chunk():
    for given, wanted, unpacked in (
        ("chunk", "trace", lambda: chunk_format.unpack_trace(packed(0))),
        ("trace", "chunk", lambda: chunk_format.unpack_chunk(chunk_format.pack_trace(TRACE))),
    ):
        assert said(unpacked).startswith(f"these bytes are a {given}, not a {wanted}: the worker runs another microrad")


@pytest.mark.parametrize("write", [True, False])
def test_a_connection_syncs_whatever_it_writes_trusts_no_schema_and_writes_only_where_asked(path, write):
    filled(path, 2)
    with closing(file.connected(path, write=write)) as connection:
        settings = ("trusted_schema", "synchronous", "fullfsync", "query_only")
        found = [connection.execute(f"PRAGMA {each}").fetchone()[0] for each in settings]
        assert found == [0, 2, 1, int(not write)]
        assert connection.isolation_level is None
        if write:
            assert connection.execute("DELETE FROM traces").rowcount == 1
            return
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            connection.execute("DELETE FROM traces")


@pytest.mark.parametrize("check", ["_check_format", "_check_schema"])
def test_a_connection_to_what_is_refused_is_closed(path, monkeypatch, check):
    filled(path, 1)
    made, connect = [], sqlite3.connect

    def connected(*given, **more):
        made.append(connect(*given, **more))
        return made[-1]

    def refused(*given):
        raise CampaignError("another")

    monkeypatch.setattr(file.sqlite3, "connect", connected)
    monkeypatch.setattr(file, check, refused)
    assert said(file._opened, path, "mode=rw", write=False) == "another"
    (connection,) = made
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        connection.execute("SELECT 1")


@pytest.mark.parametrize(
    ("error", "ours"),
    [(ZeroDivisionError, True), (OverflowError, True), (AttributeError, True), (KeyError, True), (IndexError, True),
     (RecursionError, True), (TypeError, True), (ValueError, True), (UnicodeDecodeError, True), (MemoryError, False),
     (OSError, False), (RuntimeError, False), (KeyboardInterrupt, False)],
)  # fmt: skip
def test_whatever_bytes_of_a_stranger_raise_is_told_and_other_errors_are_their_own(error, ours):
    raised = error("utf-8", b"\xff", 0, 1, "odd") if error is UnicodeDecodeError else error("odd")
    with pytest.raises(CampaignError if ours else error) as told, chunk_format._ours("trace"):
        raise raised
    if ours:
        assert str(told.value) == "a trace is laid out as microrad never does: leave its file alone"
        assert told.value.__cause__ is raised
    else:
        assert told.value is raised
