"""The table of rows in each format: the same values, units, order and bytes; damage to it is found on reading."""

import csv
import hashlib
import io
import math
import os
import random
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import h5netcdf
import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray as xr

from microrad.campaign import export
from microrad.campaign.ledger import Ledger, chunk_format
from microrad.campaign.ledger.chunk_format import Column, Head
from microrad.campaign.records import CampaignError, Chunk, Failed

COLUMNS = (
    Column("row", "", "number of the row"),
    Column("weight", "", "weight"),
    Column("link/power", "W", "transmitted power"),
    Column("margin", "dB", "margin of the link"),
)
ROWS, FORMATS = 50, ("nc", "parquet", "csv")
FLIPS = 5 if os.environ.get("MICRORAD_ENDURANCE") else 2  # of each column
REASON = "=1+1 raised\nValueError: µ"


def head(cells=({"mirror": "-a.toml", "aperture": "5 cm"}, {"mirror": "bb µ.toml", "aperture": "8 cm"})):
    hashes = {"campaign": "aa", "code": "cc", "mission": "bb"}
    return Head("c.toml", "text", "a mission", 2**64 - 1, hashes, {"numpy": "2"}, "now", cells, COLUMNS, b"")


def chunk(number, cell, rows=ROWS):
    """Rows whose values follow from cell and number; the sixth row of chunk 1 has failed."""
    draw = np.random.default_rng([cell, number])
    margin, failed = draw.normal(size=rows), ()
    if number == 1:
        margin[5], failed = np.nan, (Failed(rows + 5, 9, 2, REASON + " \udc80"),)
    row = np.arange(rows) + float(rows * number)
    columns = {"row": row, "weight": np.ones(rows), "link/power": draw.random(rows) * 1e-300, "margin": margin}
    return Chunk(cell, number, columns, failed, np.zeros(0), np.zeros(0))


def write(folder, numbers=((0, 2, 1), (1, 0)), cells=None, order=1, rows=ROWS):
    """A ledger with these chunks by cell, put in the order given or backwards."""
    path = folder / f"{len(list(folder.iterdir()))}.ledger"
    with Ledger.create(path, head(cells) if cells else head()) as ledger:
        for cell, each in list(enumerate(numbers))[::order]:
            for number in each[::order]:
                ledger.put(cell, number, chunk_format.pack_chunk(chunk(number, cell, rows)))
    return path


def exported(path, target):
    with Ledger.open(path, write=False) as ledger:
        return export.export_rows(ledger, target)


def expected():
    """The table of `write` as lists by column."""
    places = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]
    table = {"cell": [cell for cell, _ in places for _ in range(ROWS)]}
    cells = head().cells
    table |= {key: [cells[cell][key] for cell in table["cell"]] for key in ("mirror", "aperture")}
    whole = {c.name: np.concatenate([chunk(number, cell).columns[c.name] for cell, number in places]) for c in COLUMNS}
    table |= {name: values.tolist() for name, values in whole.items()} | {"row": list(map(int, whole["row"]))}
    table["failed"] = [REASON + " \\udc80" if row == ROWS + 5 else "" for row in table["row"]]
    return table


def read_nc(path):
    with xr.open_dataset(path, engine="h5netcdf") as table:
        return {str(name).replace("|", "/"): values.values.tolist() for name, values in table.items()}


def read_parquet(path):
    return pq.read_table(path, page_checksum_verification=True).to_pydict()


def read_csv(path):
    with path.open(newline="", encoding="utf-8") as file:
        names, *rows = list(csv.reader(file))
    texts = {"mirror", "aperture", "failed"}
    columns = {name.split(" [")[0]: values for name, values in zip(names, zip(*rows, strict=True), strict=True)}
    return {
        name: [
            value.removeprefix("'") if name in texts else int(value) if name in {"cell", "row"} else float(value)
            for value in values
        ]
        for name, values in columns.items()
    }


READ = {"nc": read_nc, "parquet": read_parquet, "csv": read_csv}


def said(call, *args):
    with pytest.raises(CampaignError) as caught:
        call(*args)
    return str(caught.value)


@pytest.mark.promise("campaigns-48", "campaigns-49")
@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("together", [16384, 64, 50, 7])
def test_every_format_has_the_same_table_to_the_last_bit(tmp_path, kind, together, monkeypatch):
    monkeypatch.setattr(export, "_ROWS", together)
    target = tmp_path / f"rows.{kind}"
    assert exported(write(tmp_path), target) == 5 * ROWS
    found, wanted = READ[kind](target), expected()
    assert list(found) == list(wanted)
    for name in wanted:
        assert list(map(repr, found[name])) == list(map(repr, wanted[name])), name


@pytest.mark.promise("campaigns-48")
@pytest.mark.parametrize("kind", FORMATS)
def test_the_same_chunks_give_the_same_bytes_whatever_the_order_in_which_they_came(tmp_path, kind):
    targets = [tmp_path / f"{name}.{kind}" for name in ("a", "b", "c")]
    exported(write(tmp_path), targets[0])
    exported(write(tmp_path, order=-1), targets[1])
    exported(write(tmp_path, numbers=((0, 2, 1), (1,))), targets[2])
    first, second, other = (hashlib.sha256(each.read_bytes()).hexdigest() for each in targets)
    assert first == second != other


@pytest.mark.promise("campaigns-48", "campaigns-49")
def test_each_column_has_its_unit_and_meaning_and_the_table_its_origin(tmp_path):
    path = write(tmp_path)
    for kind in FORMATS:
        exported(path, tmp_path / f"rows.{kind}")
    origin = {"title": "a mission", "campaign": "c.toml", "seed": str(2**64 - 1), "versions": '{"numpy": "2"}'}
    origin |= {"campaign_sha256": "aa", "code_sha256": "cc", "mission_sha256": "bb"}
    with xr.open_dataset(tmp_path / "rows.nc", engine="h5netcdf") as table:
        assert table.attrs == origin
        assert table["margin"].attrs == {"units": "dB", "long_name": "margin of the link"}
        assert table["weight"].attrs["units"] == table["cell"].attrs["units"] == "1"
    schema = pq.read_schema(tmp_path / "rows.parquet")
    assert schema.metadata == {key.encode(): value.encode() for key, value in origin.items()}
    assert schema.field("link/power").metadata == {b"unit": b"W", b"long_name": b"transmitted power"}
    first = (tmp_path / "rows.csv").read_text("utf-8").splitlines()[0]
    assert first == "cell,mirror,aperture,row,weight,link/power [W],margin [dB],failed"


def test_no_text_in_a_csv_file_is_a_formula(tmp_path):
    exported(write(tmp_path), tmp_path / "rows.csv")
    lines = (tmp_path / "rows.csv").read_text("utf-8").splitlines()
    assert lines[1].startswith("0,'-a.toml,5 cm,0,1.0,")
    assert sum("\"'=1+1 raised" in line for line in lines) == 2
    assert not any(cell.startswith(("=", "+", "@")) for line in lines for cell in line.split(","))


def test_a_campaign_without_a_grid_or_with_different_keys_by_cell_has_no_empty_columns(tmp_path):
    target = tmp_path / "rows.csv"
    assert exported(write(tmp_path, numbers=((0,),), cells=({},)), target) == ROWS
    assert target.read_text().startswith("cell,row,weight,")


# -------------------------------------------------------------------------------------------------------------- damage
def flips(path, spots, read):
    """How many of these flips an attempt to read tells of, and how many change what it gives without a word."""
    whole, wanted = path.read_bytes(), read(path)
    told = silent = 0
    for at, bit in spots:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
        try:
            found = read(path)
        except (OSError, ValueError, RuntimeError, KeyError):
            told += 1
        else:
            silent += any(list(map(repr, found[name])) != list(map(repr, wanted[name])) for name in wanted)
    path.write_bytes(whole)
    return told, silent


def margins(whole, number):
    """Where the margins of a chunk of cell 0 stand in a file, and places among them to flip."""
    draw = random.Random(4)
    at = whole.index(chunk(number, 0).columns["margin"].tobytes())
    return [(at + draw.randrange(8 * ROWS), draw.randrange(8)) for _ in range(20)]


@pytest.mark.promise("campaigns-49")
def test_a_flipped_bit_in_parquet_is_an_error_where_without_checksums_it_is_silent(tmp_path):
    target = tmp_path / "rows.parquet"
    exported(write(tmp_path), target)

    def numbers(path, check):
        table = pq.read_table(path, columns=["margin"], page_checksum_verification=check)
        return {"margin": table["margin"].to_numpy()}

    plain = tmp_path / "plain.parquet"
    pq.write_table(pq.read_table(target), plain, compression="none", use_dictionary=False)
    spots = margins(plain.read_bytes(), 0)
    assert flips(plain, spots, lambda path: numbers(path, True)) == (0, len(spots))
    found = pq.ParquetFile(target).metadata.row_group(0).column(6)
    assert found.path_in_schema == "margin"
    draw = random.Random(5)
    start, end = found.data_page_offset, found.data_page_offset + found.total_compressed_size
    spots = [(draw.randrange((start + end) // 2, end), draw.randrange(8)) for _ in range(20)]
    assert flips(target, spots, lambda path: numbers(path, True)) == (len(spots), 0)
    assert flips(target, spots, lambda path: numbers(path, False))[1] > 0


@pytest.mark.promise("campaigns-49")
def test_a_flipped_bit_in_netcdf_is_an_error_where_without_checksums_it_is_silent(tmp_path):
    target, plain = tmp_path / "rows.nc", tmp_path / "plain.nc"
    exported(write(tmp_path), target)

    def numbers(path):
        with h5netcdf.File(path) as file:
            return {"margin": file["margin"][:]}

    with h5netcdf.File(plain, "w") as file:
        file.dimensions = {"index": 5 * ROWS}
        file.create_variable("margin", ("index",), "f8", data=numbers(target)["margin"])
    spots = margins(plain.read_bytes(), 0)
    assert flips(plain, spots, numbers) == (0, len(spots))
    assert flips(target, margins(target.read_bytes(), 0), numbers) == (len(spots), 0)


@pytest.mark.promise("campaigns-49")
@pytest.mark.parametrize("kind", ["nc", "parquet"])
def test_no_flip_among_the_values_of_any_column_is_silent(tmp_path, kind):
    target = tmp_path / f"rows.{kind}"
    exported(write(tmp_path), target)
    if kind == "nc":
        with h5netcdf.File(target) as file:
            data = [file._h5file[name].id.get_chunk_info(0) for name in file.variables]
        places = [(each.byte_offset, each.byte_offset + each.size) for each in data]
    else:
        group = pq.ParquetFile(target).metadata.row_group(0)
        each = [group.column(k) for k in range(group.num_columns)]
        starts = [c.dictionary_page_offset if c.has_dictionary_page else c.data_page_offset for c in each]
        places = [(at, at + c.total_compressed_size) for at, c in zip(starts, each, strict=True)]
    draw = random.Random(6)
    spots = [(draw.randrange(*place), draw.randrange(8)) for place in places for _ in range(FLIPS)]
    told, silent = flips(target, spots, READ[kind])
    assert silent == 0
    assert told > len(spots) / 2


# ------------------------------------------------------------------------------------------------------------ refusals
def test_what_cannot_be_exported_is_refused_and_writes_nothing(tmp_path):
    path = write(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert "exports to .nc, .parquet, .csv, not to '.xlsx'" in said(exported, path, tmp_path / "rows.xlsx")
    assert "not to 'no suffix'" in said(exported, path, tmp_path / "rows")
    assert "there is no folder" in said(exported, path, tmp_path / "none" / "rows.csv")
    assert sorted(tmp_path.iterdir()) == before
    empty = write(tmp_path, numbers=())
    assert "has no rows yet: run or resume" in said(exported, empty, tmp_path / "rows.csv")
    assert not (tmp_path / "rows.csv").exists()
    exported(path, tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").exists()


@pytest.mark.promise("campaigns-46", "campaigns-48")
@pytest.mark.parametrize("kind", FORMATS)
def test_a_damaged_chunk_stops_the_export_and_leaves_the_old_file(tmp_path, kind):
    path, target = write(tmp_path), tmp_path / f"rows.{kind}"
    target.write_text("last week's")
    data = bytearray(path.read_bytes())
    data[data.index(chunk_format.pack_chunk(chunk(2, 0))[-300:-200])] ^= 1
    path.write_bytes(data)
    assert "chunk 2 of cell 0 is damaged" in said(exported, path, target)
    assert target.read_text() == "last week's"
    assert [each for each in tmp_path.iterdir() if each.name.startswith(".microrad-")] == []


@pytest.mark.promise("campaigns-49")
def test_a_missing_pyarrow_is_told_by_what_to_install(tmp_path, monkeypatch):
    path = write(tmp_path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "pip install --constraint constraints.txt '.[parquet]'" in said(exported, path, tmp_path / "rows.parquet")
    assert exported(path, tmp_path / "rows.nc") == 5 * ROWS
    assert not (tmp_path / "rows.parquet").exists()


FULL = """
    import sys
    from pathlib import Path
    from microrad.campaign.export import export_rows
    from microrad.campaign.ledger import Ledger
    from microrad.campaign.records import CampaignError
    with Ledger.open(Path(sys.argv[1]), write=False) as ledger:
        for target in sys.argv[2:]:
            try:
                export_rows(ledger, Path(target))
            except CampaignError as error:
                print(error)
"""


@pytest.mark.promise("campaigns-48")
def test_a_full_disk_leaves_the_old_file_and_no_part_of_a_new_one(tmp_path):
    path, folder = write(tmp_path, numbers=(range(40), range(40))), tmp_path / "small"
    folder.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], capture_output=True, check=False)
    if made.returncode:
        pytest.skip("this machine does not allow to mount a small disk")
    try:
        targets = [folder / f"rows.{kind}" for kind in FORMATS]
        for target in targets:
            target.write_text("last week's")
        code = [sys.executable, "-W", "error", "-c", textwrap.dedent(FULL), str(path), *map(str, targets)]
        ended = subprocess.run(code, capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr) == (0, "")
        for target, said in zip(targets, ended.stdout.splitlines(), strict=True):
            assert said.startswith(f"{target} could not be written") and "No space left" in said
        assert sorted(folder.iterdir()) == sorted(targets)
        assert {target.read_text() for target in targets} == {"last week's"}
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


UNCUT = """
    import io
    from microrad.campaign import export
    class Full(io.FileIO):
        def truncate(self, size=None):
            raise OSError(28, "No space left on device")
    class Disk(export._Disk, Full):
        pass
    export._Disk = Disk
"""


def test_a_netcdf_whose_length_cannot_be_set_is_refused_and_nothing_crashes(tmp_path):
    path, target = write(tmp_path), tmp_path / "rows.nc"
    code = [sys.executable, "-W", "error", "-c", textwrap.dedent(UNCUT + FULL), str(path), str(target)]
    ended = subprocess.run(code, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith(f"{target} could not be written") and "No space left" in ended.stdout
    assert not target.exists()


PEAK = """
    import resource, sys
    from pathlib import Path
    from microrad.campaign.export import export_rows
    from microrad.campaign.ledger import Ledger
    for path in sys.argv[2:]:
        with Ledger.open(Path(path), write=False) as ledger:
            export_rows(ledger, Path(sys.argv[1]))
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.fixture(scope="module")
def two_sizes(tmp_path_factory):
    """A ledger of 50 000 rows and one of 200 000."""
    folder = tmp_path_factory.mktemp("sizes")
    return [write(folder, (range(count),), ({},), rows=5000) for count in (10, 40)]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is in kB on Linux alone")
@pytest.mark.parametrize("kind", [pytest.param(k, marks=[] if k == "nc" else [pytest.mark.endurance]) for k in FORMATS])
def test_memory_does_not_grow_with_the_number_of_rows(tmp_path, kind, two_sizes):
    """In one process: its peak is that of the larger one in the end."""
    target = str(tmp_path / f"rows.{kind}")
    code = [sys.executable, "-c", textwrap.dedent(PEAK), target, *map(str, two_sizes)]
    less, more = map(int, subprocess.run(code, capture_output=True, check=True).stdout.split())
    assert Path(target).stat().st_size > 4_000_000
    assert more - less < 150_000 * 3 * 8 / 1024 / 2  # half of what the further rows' numbers take


def test_a_csv_file_has_every_digit_every_unit_and_every_text_of_its_rows(tmp_path):
    cells = ({"mirror": "-a.toml", "set, of": "x"}, {"mirror": 'b "c"', "set, of": "1\n2"})
    with Ledger.create(tmp_path / "a.ledger", head(cells)) as book:
        for cell, number, rows, lost in ((1, 0, (0, 1), "=x \0 µ"), (0, 1, (2, 3), ""), (0, 0, (0, 1), "died")):
            columns = {
                "row": np.array(rows, dtype=float),
                "weight": np.array([0.5, 2.0]),
                "link/power": np.array([1e-300, 622.08e6 + 1e-7]),
                "margin": np.array([np.nan, -0.0]),
            }
            failed = (Failed(rows[0], 9, 2, lost),)
            done = Chunk(cell, number, columns, failed, np.zeros(0), np.zeros(0))
            book.put(cell, number, chunk_format.pack_chunk(done))
        assert export.export_rows(book, tmp_path / "A.CSV") == 6
    assert (tmp_path / "A.CSV").read_text(encoding="utf-8").split("\n") == [
        'cell,mirror,"set, of",row,weight,link/power [W],margin [dB],failed',
        "0,'-a.toml,x,0,0.5,1e-300,nan,died",
        "0,'-a.toml,x,1,2.0,622080000.0000001,-0.0,",
        "0,'-a.toml,x,2,0.5,1e-300,nan,without a reason",
        "0,'-a.toml,x,3,2.0,622080000.0000001,-0.0,",
        '1,"b ""c""","1',
        "2\",0,0.5,1e-300,nan,'=x \\0 µ",
        '1,"b ""c""","1',
        '2",1,2.0,622080000.0000001,-0.0,',
        "",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.txt", "microrad exports to .nc, .parquet, .csv, not to '.txt'"),
        ("a", "microrad exports to .nc, .parquet, .csv, not to 'no suffix'"),
        ("no/a.csv", "there is no folder {folder}: make it, or choose another"),
    ],
)
def test_where_no_table_can_be_written_is_told_in_full(tmp_path, name, words):
    path = tmp_path / name
    with Ledger.create(tmp_path / "a.ledger", head()) as book:
        assert said(export.export_rows, book, path) == f"{path}: {words.format(folder=path.parent)}"
        none = said(export.export_rows, book, tmp_path / "a.csv")
    assert none == f"{tmp_path / 'a.ledger'} has no rows yet: run or resume the campaign first"


# ------------------------------------------------------------------------------------------------- one part by itself
def test_numbers_that_are_none_and_texts_with_anything_are_written_as_they_are(tmp_path):
    """Of two cells, the second of which has another key; a reason of the second chunk's alone."""
    texts = {"mirror": "a,b\n=c", "at": "\0x"}, {"mirror": "", "other/key": "@d"}
    columns = {
        "row": np.array([7.0, 8.0, 9.0]), "weight": np.array([0.1, 2.0, 1e300]),
        "link/power": np.array([-0.0, math.inf, 5e-324]), "margin": np.array([math.nan, -math.inf, 622.08e6]),
    }  # fmt: skip
    fields = export._fields(head(texts))
    assert [(f.name, f.unit, f.kind) for f in fields] == [
        ("cell", "", "int"), ("mirror", "", "text"), ("at", "", "text"), ("other/key", "", "text"),
        ("row", "", "int"), ("weight", "", "float"), ("link/power", "W", "float"), ("margin", "dB", "float"),
        ("failed", "", "text"),
    ]  # fmt: skip
    assert [f.meaning for f in fields][:4] == [
        "number of the combination of the grid", "mirror in the grid", "at in the grid", "other/key in the grid"
    ]  # fmt: skip
    lost = Failed(8, 1, 2, ""), Failed(9, 1, 2, "+1\0 \ud800")
    made = export._block(Chunk(4, 2, columns, lost, np.zeros(0), np.zeros(0)), texts[0] | {"other/key": "k"}, fields)
    written = {f.name: export._csv_texts(f, made[f.name]) for f in fields}
    assert written == {
        "cell": ["4"] * 3, "mirror": ["a,b\n=c"] * 3, "at": ["\\0x"] * 3, "other/key": ["k"] * 3,
        "row": ["7", "8", "9"], "weight": ["0.1", "2.0", "1e+300"], "link/power": ["-0.0", "inf", "5e-324"],
        "margin": ["nan", "-inf", "622080000.0"], "failed": ["", "without a reason", "'+1\\0 \\ud800"],
    }  # fmt: skip
    assert (export._name("a/b/c"), export._characters_of("a/b")) == ("a|b|c", "a|b characters")
    letters = export._characters(np.array(["µ", "", "abc"], dtype=object), 3)
    assert letters.tolist() == [[b"\xc2", b"\xb5", b""], [b"", b"", b""], [b"a", b"b", b"c"]]


def test_a_disk_keeps_its_first_error_and_all_that_it_had_room_for(tmp_path, monkeypatch):
    class Small(io.FileIO):
        """Takes five bytes at a time, and fourteen in all."""

        def write(self, data):
            if self.tell() >= 14:
                raise OSError(28, f"full at {self.tell()}")
            return super().write(bytes(data)[: min(5, 14 - self.tell())])

        def truncate(self, size=None):
            raise OSError(28, "no length")

    class Disk(export._Disk, Small):
        pass

    with Disk(tmp_path / "x", "x+") as disk:
        assert (disk.write(b"0123456789"), disk.error, disk.tell()) == (10, None, 10)
        assert (disk.write(np.arange(2, dtype="<f8")), disk.tell()) == (16, 26)
        first = disk.error
        assert "full at 14" in str(first)
        assert (disk.write(b"ab"), disk.tell(), disk.error is first) == (2, 28, True)
        assert (disk.truncate(40), disk.truncate(), disk.error is first) == (40, 28, True)
        data = bytearray(b"x" * 8)
        disk.seek(10)
        assert (disk.readinto(data), bytes(data)) == (8, bytes(8))
        disk.seek(8)
        assert (disk.readinto(memoryview(data)), bytes(data)) == (8, b"89" + bytes(6))
    with export._Disk(tmp_path / "y", "x+") as whole:
        data = bytearray(b"x" * 3)
        assert (whole.write(b"01"), whole.truncate(3), whole.seek(0), whole.readinto(data)) == (2, 3, 0, 3)
        assert (bytes(data), whole.error) == (b"01\0", None)
        assert (whole.seek(1), whole.readinto(data), bytes(data)) == (1, 2, b"1\0\0")  # up to the end of the file


@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), RuntimeError("disk full")])
def test_a_table_that_cannot_be_written_is_told_by_its_path_and_reason(tmp_path, error):
    target = tmp_path / "rows.csv"
    with pytest.raises(CampaignError) as told, export._whole_file(target):
        raise error
    reason = str(told.value.__cause__)
    assert reason.startswith(str(error))
    assert str(told.value) == f"{target} could not be written ({reason}), so nothing is: free space, or choose another"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "unit", "made", "attrs"),
    [
        ("float", "W", (("index",), "f8", (12,), False), {"long_name": "what it is", "units": "W"}),
        ("float", "", (("index",), "f8", (12,), False), {"long_name": "what it is", "units": "1"}),
        ("int", "", (("index",), "i8", (12,), True), {"long_name": "what it is", "units": "1"}),
        (
            "text", "", (("index", "a|b characters"), "S1", (12, 7), True),
            {"long_name": "what it is", "_Encoding": "utf-8"},
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize(("rows", "most"), [(12, 16384), (40, 12)])
def test_a_column_of_netcdf_has_its_checksum_and_is_compressed_where_it_repeats_itself(
    monkeypatch, kind, unit, made, attrs, rows, most
):
    asked, variable = [], type("Variable", (), {"attrs": {}})
    variable.attrs = {}

    class File:
        def create_variable(self, *given, **options):
            asked.append((given, options))
            return variable

    monkeypatch.setattr(export, "_ROWS", most)
    field = export._Field("a/b", unit, "what it is", kind)
    assert export._variable(File(), field, {"c": 3, "a/b": 7}, rows) is variable
    dims, code, chunks, packed = made
    more = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if packed else {}
    assert asked == [(("a|b", dims, code), {"chunks": chunks, "fletcher32": True, **more})]
    assert variable.attrs == attrs


@pytest.mark.parametrize("together", [3, 100])
def test_a_table_is_as_long_as_its_rows_and_a_text_as_wide_as_the_longest_of_all_its_blocks(
    tmp_path, monkeypatch, together
):
    """In bytes; the longest stands in the first cell, in the second, and nowhere."""
    cells = ({"mirror": "µµµ", "set": "a", "at": ""}, {"mirror": "abcd", "set": "bbb", "at": ""})
    with Ledger.create(tmp_path / "a.ledger", head(cells)) as book:
        for cell, number in ((0, 0), (0, 1), (1, 0)):
            columns = {c.name: np.arange(4.0) + 4 * number for c in COLUMNS}
            lost = (Failed(6, 1, 2, "no µ"),) if number else ()
            done = Chunk(cell, number, columns, lost, np.zeros(0), np.zeros(0))
            book.put(cell, number, chunk_format.pack_chunk(done))
        monkeypatch.setattr(export, "_ROWS", together)
        found = export._extent(book, export._fields(book.head))
    assert found == (12, {"mirror": 6, "set": 3, "at": 1, "failed": 5})


def test_a_table_tells_its_origin_the_same_whatever_order_its_versions_were_noted_in():
    versions = {"scipy": "1.2", "numpy": "2 µ", "microrad": "0"}
    hashes = {"mission": "bb", "campaign": "aa"}
    for order in (1, -1):
        told = replace(head(), versions=dict(list(versions.items())[::order]), hashes=hashes, mission_name="µ", seed=7)
        found = export._origin(told)
        assert found == {
            "title": "µ", "campaign": "c.toml", "seed": "7", "mission_sha256": "bb", "campaign_sha256": "aa",
            "versions": '{"microrad": "0", "numpy": "2 \\u00b5", "scipy": "1.2"}',
        }  # fmt: skip
