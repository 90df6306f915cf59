"""Recordings: what is read, and each refusal with its message."""

import hashlib
import os
import re
from dataclasses import replace

import numpy as np
import pytest

from microrad.lab.recording import MIN_SAMPLES, RecordingError, files, read_recording, recording_from_arrays
from microrad.lab.recording.formats.text import Layout, TextSource, _are_units, _guess_delimiter, _is_regular, split
from microrad.lab.recording.reader import named_part
from microrad.lab.recording.records import Finding, check_stated, digest_of, frozen, read_in, stated_units

N = 400
TIME = np.arange(N) / 100.0
DRIVE = 6 + 6 * np.sin(TIME)
OUTPUT = 0.089 * DRIVE + 0.01 * np.cos(TIME)
ROWS = [f"{t:.2f},{u!r},{y!r}" for t, u, y in zip(TIME.tolist(), DRIVE.tolist(), OUTPUT.tolist(), strict=True)]


def write(path, rows, header="time,drive,output"):
    text = "\n".join(([header] if header else []) + rows) + "\n"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(path, input_column=1, output_column=2, rate_hz=100.0):
    with pytest.raises(RecordingError) as caught:
        read_recording(path, input_column, output_column, rate_hz)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


@pytest.mark.promise("recordings-2", "recordings-4")
@pytest.mark.promise("readme-9")
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "   ", ", "])
@pytest.mark.parametrize(
    "header", [None, "time,drive,output", "# time,drive,output", "% remark\n\ntime,drive,output\ns,V,mrad"]
)
def test_reads_delimiters_and_headers(tmp_path, delimiter, header):
    head = header.replace(",", delimiter) if header else None
    path = write(tmp_path / "a.txt", [row.replace(",", delimiter) for row in ROWS], head)
    read = read_recording(path, "drive" if header else 1, 2, 100.0)
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE)
    np.testing.assert_array_equal(read.output[:, 0], OUTPUT)
    assert (read.input_names, read.output_names) == ((("drive",), ("output",)) if header else (("1",), ("2",)))
    assert (read.samples, read.rate_hz, read.step_s) == (N, 100.0, 0.01)
    assert read.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert read.path == str(path)


@pytest.mark.promise("recordings-4")
@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: "\ufeff" + text,
        lambda text: text + "\n  \n",
        lambda text: text.replace(ROWS[7], ROWS[7] + "\n# remark in between"),
        lambda text: text.replace(ROWS[7], '"' + '","'.join(ROWS[7].split(",")) + '"'),
        lambda text: text.replace("time", "Zeit µs"),
        lambda text: text[:-1],
    ],
    ids=["crlf", "cr", "bom", "blank-end", "remark", "quotes", "latin", "no-newline"],
)
def test_reads_variants_of_text(tmp_path, change):
    path = tmp_path / "a.csv"
    text = change("time,drive,output\n" + "\n".join(ROWS) + "\n")
    path.write_bytes(text.encode("latin-1" if "µ" in text else "utf-8"))
    read = read_recording(path, "drive", "output", 100.0)
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE)
    np.testing.assert_array_equal(read.output[:, 0], OUTPUT)


def test_faults_in_unused_columns_do_not_matter(tmp_path):
    rows = ["ok," + row.partition(",")[2] for row in ROWS]
    read = read_recording(write(tmp_path / "a.csv", rows), 1, "output", 100.0)
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE)


def test_recording_is_frozen(tmp_path):
    read = read_recording(write(tmp_path / "a.csv", ROWS), 1, 2, 100.0)
    with pytest.raises(AttributeError):
        read.rate_hz = 1.0
    with pytest.raises(ValueError, match="read-only"):
        read.drive[0] = 1.0


def test_missing_file_offers_nearest_name(tmp_path):
    write(tmp_path / "record.csv", ROWS)
    message = refusal(tmp_path / "recrod.csv")
    assert "no such file" in message
    assert "'record.csv'" in message


def test_directory(tmp_path):
    assert "directory" in refusal(tmp_path)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    assert "is not a regular file; copy the data into a file first" in refusal(tmp_path / "pipe.csv")
    message = refusal(tmp_path / f"{'a' * 300}.csv")
    assert re.search(r"cannot be examined \(.*File name too long|there is no such file", message)


def test_empty_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"")
    assert "empty" in refusal(path)


@pytest.mark.parametrize("content", [b"\n\n \n", b"# only\n# remarks\n"])
def test_no_content(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    assert "rows of numbers" in refusal(path)


@pytest.mark.parametrize("content", [b"1,2\n\x00\x00\n", bytes(range(256)) * 20, b"\x89PNG\r\n\x1a\n\x00"])
def test_binary_file(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    assert "binary" in refusal(path)


def test_utf16_is_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(ROWS), encoding="utf-16")
    assert "UTF-16" in refusal(path)


def test_nul_far_behind_the_head(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(("\n".join(ROWS * 100) + "\n").encode() + b"1,2,\x00\n")
    assert path.stat().st_size > 1_000_000
    assert "binary" in refusal(path)


def test_no_line_break(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"1," * 600_000)
    assert "no line break" in refusal(path)


def test_words_only(tmp_path):
    message = refusal(write(tmp_path / "a.csv", ["dear diary, today"] * 300, None))
    assert "no row of numbers" in message
    assert "dear diary" in message


def test_one_column(tmp_path):
    message = refusal(write(tmp_path / "a.csv", [repr(u) for u in DRIVE.tolist()], "drive"), 0, 1)
    assert "only one column" in message
    assert "line 2" in message


def test_unknown_name_offers_nearest(tmp_path):
    message = refusal(write(tmp_path / "a.csv", ROWS), "Driev", 2)
    assert "no input column is named 'Driev'" in message
    assert "nearest is 'drive'" in message


def test_name_without_header(tmp_path):
    message = refusal(write(tmp_path / "a.csv", ROWS, None), "drive", 2)
    assert "no header line" in message
    assert "0 to 2" in message


def test_name_given_twice(tmp_path):
    message = refusal(write(tmp_path / "a.csv", ROWS, "t,x,x"), "t", "x")
    assert "columns 1, 2 are all named 'x'" in message


@pytest.mark.promise("recordings-5")
@pytest.mark.parametrize("column", [3, -1, "7", True])
def test_number_out_of_range(tmp_path, column):
    message = refusal(write(tmp_path / "a.csv", ROWS), 1, column)
    assert f"no output column {column}" in message
    assert "numbered from 0 to 2" in message


@pytest.mark.promise("recordings-5")
def test_digits_name_a_column_by_number(tmp_path):
    read = read_recording(write(tmp_path / "a.csv", ROWS), "1", "2", 100.0)
    np.testing.assert_array_equal(read.output[:, 0], OUTPUT)


def test_same_column_twice(tmp_path):
    assert "input and output are both column 1 ('drive')" in refusal(write(tmp_path / "a.csv", ROWS), "drive", 1)


@pytest.mark.promise("recordings-2", "recordings-26")
@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("nan", "'nan' is not a finite number"),
        ("-inf", "'-inf' is not a finite number"),
        ("1e999", "'1e999' is not a finite number"),
        ("", "the cell is empty"),
        ("abc", "'abc' is not a number"),
        ("1_000", "'1_000' is not a number"),
        ("1.2.3", "'1.2.3' is not a number"),
    ],
)
@pytest.mark.parametrize("row", [0, 250, N - 1])
def test_bad_cell_is_found(tmp_path, cell, words, row):
    rows = list(ROWS)
    rows[row] = ",".join([*rows[row].split(",")[:2], cell])
    message = refusal(write(tmp_path / "a.csv", rows))
    assert f"line {row + 2}, column 2 ('output')" in message
    assert words in message


def test_bad_cell_without_header_has_number_only(tmp_path):
    rows = list(ROWS)
    rows[10] = rows[10].replace(",", ",x", 1)
    message = refusal(write(tmp_path / "a.csv", rows, None))
    assert "line 11, column 1: " in message


@pytest.mark.parametrize("delimiter", [";", "\t", " "])
def test_decimal_commas_are_named(tmp_path, delimiter):
    rows = [row.replace(",", delimiter).replace(".", ",") for row in ROWS]
    message = refusal(write(tmp_path / "a.csv", rows, None))
    assert "decimal comma" in message
    assert "line 1, column 1" in message
    assert f"reads '{DRIVE[0]!r}'".replace("np.float64(", "").replace(")", "") in message


def test_decimal_commas_beside_separating_commas(tmp_path):
    rows = [f"{u:.3f},{y:.3f}".replace(".", ",") for u, y in zip(DRIVE, OUTPUT, strict=True)]
    assert "decimal commas" in refusal(write(tmp_path / "a.csv", rows, "drive,output"), 0, 1)


def test_columns_beyond_the_header_are_no_decimal_commas(tmp_path):
    rows = [f"{k},{u},{k},{y},{k},0.5" for k, (u, y) in enumerate(zip(DRIVE, OUTPUT, strict=True))]
    assert read_recording(write(tmp_path / "a.csv", rows, "a,b,c"), 1, 3, 100.0).samples == N


def test_time_that_stands_still(tmp_path):
    rows = [f"2.5,{u!r},{y!r}" for u, y in zip(DRIVE.tolist(), OUTPUT.tolist(), strict=True)]
    message = refusal(write(tmp_path / "a.csv", rows))
    assert "column 0 ('time'): the time of all 400 samples is 2.5 s; write their true times" in message


@pytest.mark.parametrize(("bad", "cells"), [("1.0,2.0", "2 cells"), ("1,2,3,4", "4 cells"), ("1.0", "1 cell")])
@pytest.mark.parametrize("row", [0, 250, N - 1])
def test_ragged_rows(tmp_path, bad, cells, row):
    rows = list(ROWS)
    rows[row] = bad
    message = refusal(write(tmp_path / "a.csv", rows))
    assert f"line {row + 2} has {cells} where 3 are expected" in message


def test_ragged_rows_of_white_space(tmp_path):
    rows = [row.replace(",", "  ") for row in ROWS]
    rows[99] += " 5"
    assert "line 100 has 4 cells" in refusal(write(tmp_path / "a.txt", rows, None))


@pytest.mark.promise("recordings-26")
@pytest.mark.parametrize(("column", "role"), [(1, "input"), (2, "output")])
def test_constant_column(tmp_path, column, role):
    rows = [",".join(["3.5" if i == column else cell for i, cell in enumerate(row.split(","))]) for row in ROWS]
    message = refusal(write(tmp_path / "a.csv", rows))
    assert f"the {role}, column {column}" in message
    assert "constant at 3.5" in message


@pytest.mark.promise("recordings-26")
def test_too_few_samples(tmp_path):
    message = refusal(write(tmp_path / "a.csv", ROWS[: MIN_SAMPLES - 1]))
    assert f"{MIN_SAMPLES - 1} samples; at least {MIN_SAMPLES}" in message
    assert read_recording(write(tmp_path / "b.csv", ROWS[:MIN_SAMPLES]), 1, 2, 100.0).samples == MIN_SAMPLES


@pytest.mark.parametrize("rate_hz", [0, -1.0, float("nan"), float("inf"), True, "50"])
def test_bad_rate(tmp_path, rate_hz):
    message = refusal(write(tmp_path / "a.csv", ROWS), rate_hz=rate_hz)
    assert f"the sample rate is {rate_hz!r}" in message


def test_file_too_large(tmp_path, monkeypatch):
    path = write(tmp_path / "a.csv", ROWS)
    size = path.stat().st_size
    monkeypatch.setattr(files, "MAX_BYTES", size - 1)
    assert "held in memory" in refusal(path)
    monkeypatch.setattr(files, "MAX_BYTES", size)
    assert read_recording(path, 1, 2, 100.0).samples == N


def test_a_big_file_is_read_whole(tmp_path):
    path = tmp_path / "big.csv"
    path.write_text("a,b\n" + "\n".join(f"{k % 977}.25,{k % 983}.125" for k in range(300_000)) + "\n")
    read = read_recording(path, "a", "b", 1e4)
    assert read.samples == 300_000
    np.testing.assert_array_equal(read.drive[:, 0], np.arange(300_000) % 977 + 0.25)


def test_arrays_under_the_same_checks():
    made = recording_from_arrays(DRIVE, OUTPUT, 100.0, "bench")
    assert (made.path, made.samples, len(made.sha256)) == ("bench", N, 64)
    faults = {
        "shape": (DRIVE[:-1], OUTPUT, 100.0),
        r"drive has shape \(0,\) and output \(0,\)": (DRIVE[:0], OUTPUT[:0], 100.0),
        r"drive has shape \(400, 0\)": (np.zeros((N, 0)), OUTPUT, 100.0),
        r"output \(400, 0\)": (DRIVE, np.zeros((N, 0)), 100.0),
        "sample 3 of the output is nan": (DRIVE, np.where(np.arange(N) == 3, np.nan, OUTPUT), 100.0),
        "constant": (np.ones(N), OUTPUT, 100.0),
        "sample rate": (DRIVE, OUTPUT, 0.0),
        "at least 200": (DRIVE[:50], OUTPUT[:50], 100.0),
    }
    for words, (drive, output, rate_hz) in faults.items():
        with pytest.raises(RecordingError, match=words):
            recording_from_arrays(drive, output, rate_hz)


@pytest.mark.parametrize("drive", [DRIVE + 0j, ["a"] * N, [[1.0], [1.0, 2.0]]])
def test_arrays_that_are_no_real_numbers_are_refused(drive):
    """The imaginary part was cut off, with a warning; the rest were errors of NumPy."""
    with pytest.raises(RecordingError, match="arrays: drive: no array of real numbers; give numbers"):
        recording_from_arrays(drive, OUTPUT, 100.0)


@pytest.mark.parametrize("rate_hz", [5e-324, 1e300])
def test_rates_that_no_converter_has_are_refused(rate_hz):
    with pytest.raises(RecordingError, match="give the samples per second"):
        recording_from_arrays(DRIVE, OUTPUT, rate_hz)


# ---- small texts: what their layout is, what is read of them, and what is said of what cannot be read
@pytest.mark.parametrize(
    ("text", "delimiter", "headers", "first", "units", "last"),
    [
        (
            "a;b;c\n(V);[mm];s\n1.5;2;-3\n4;5e-1;6\n",
            ";",
            (("a", "b", "c"), ("(V)", "[mm]", "s")),
            3,
            ("V", "mm", "s"),
            [4, 0.5, 6],
        ),
        (
            "% by hand\n# x;y;z\n#V;mV;s\n\n1;2;3\n",
            ";",
            (("x", "y", "z"), ("V", "mV", "s")),
            5,
            ("V", "mV", "s"),
            [1, 2, 3],
        ),
        ("x\ty\nfoo\tbar\n1\t2\n3\t4", "\t", (("x", "y"), ("foo", "bar")), 3, ("", ""), [3, 4]),
        ('"a;1";b [mm];"c (V)"\n"1";2;3\n', ";", (("a;1", "b [mm]", "c (V)"),), 2, ("", "mm", "V"), [1, 2, 3]),
        ("s;m\nu;y\n1;2\n", ";", (("u", "y"), ("s", "m")), 3, ("s", "m"), [1, 2]),
        ("u,y\n-,%\n1,-.5\n", ",", (("u", "y"), ("-", "%")), 3, ("-", "%"), [1, -0.5]),
        ("u,y\n,V\n\n1,+2\n", ",", (("u", "y"), ("", "V")), 4, ("", "V"), [1, 2]),
        ("  1   2 3 \n 4 5  6\n", None, (), 1, ("", "", ""), [4, 5, 6]),
        ("note\nu y\n1 2\n# a remark\n  3 4\n", None, (("u", "y"),), 3, ("", ""), [3, 4]),
        ("run 7\nu,y,z\n7,x,1\n2,3,4\n", ",", (("u", "y", "z"),), 3, ("", "", ""), None),
    ],
)
def test_the_layout_of_a_text_is_judged_by_its_lines(tmp_path, text, delimiter, headers, first, units, last):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    source = TextSource(path)
    layout = source.layout
    assert (layout.delimiter, layout.headers, layout.first_line, layout.encoding) == (
        *(delimiter, headers, first),
        "utf-8-sig",
    )
    assert source.units == units and layout.columns == len(units)
    assert source.names == (headers[0] if headers else tuple(str(k) for k in range(len(units))))
    if last is not None:
        order = list(range(len(last)))[::-1]
        assert [column[-1] for column in source.load(order)] == last[::-1]
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        (
            "1,5 2,5\n3,5 4,5\n",
            0,
            "line 1, column 0: '1,5' has a decimal comma; export with decimal points, so that it reads '1.5'.",
        ),
        (
            "u;y\n1;2\n3;-4,5E-3\n",
            1,
            "line 3, column 1 ('y'): '-4,5E-3' has a decimal comma; export with decimal points, so that it reads "
            "'-4.5E-3'.",
        ),
        (
            "u\ty\n1\t2\n\n# x\n3\n5\t6\n",
            1,
            "line 5 has 1 cell where 2 are expected, separated by tab ('3'); repair or remove the line.",
        ),
        (
            "u;y\n1;2\n3;4;5\n6;7\n",
            0,
            "line 3 has 3 cells where 2 are expected, separated by semicolon ('3;4;5'); repair or remove the line.",
        ),
        (
            "u y\n1 2\n3 4 5\n5 6\n",
            1,
            "line 3 has 3 cells where 2 are expected, separated by white space ('3 4 5'); repair or remove the line.",
        ),
        (
            "u,y\n1,2\n3,1_0\n",
            1,
            "line 3, column 1 ('y'): '1_0' is not a number; repair the cell, or start the line with # if it is a "
            "remark.",
        ),
        (
            "u,y\n1,2\n3," + "q" * 60 + "\n",
            1,
            f"line 3, column 1 ('y'): '{'q' * 39}…' is not a number; repair the cell, or start the line with # if it "
            "is a remark.",
        ),
        (
            "u,y\n1,2\n,4\n",
            0,
            "line 3, column 0 ('u'): the cell is empty; fill the gap or cut the recording there.",
        ),
        (
            "u,y\n1,2\n3,-inf\n",
            1,
            "line 3, column 1 ('y'): '-inf' is not a finite number; a gap or an overflow of the sensor must be cut out "
            "or repaired, because hysteresis remembers what happened in it.",
        ),
        (
            "u,y\n1,5,2,5\n3,5,4,5\n",
            1,
            "the header names 2 columns and the rows have 4: decimal commas, which cannot be told from separating "
            "commas here; export with decimal points.",
        ),
        (
            "power\n1\n2\n",
            0,
            "only one column was found (line 2: '1'); drive and output must stand side by side, separated by comma, "
            "semicolon, tab or white space.",
        ),
        (
            "a\nb\nc\n",
            0,
            "no row of numbers was found; the first line reads 'a'. Export the recording as text with one row of "
            "numbers per sample.",
        ),
        (
            "# a\n\n% b\n",
            0,
            "the file holds only blank lines and comments; export the recording as rows of numbers, one per sample.",
        ),
    ],
)
def test_a_line_of_a_text_that_is_wrong_is_told_in_all_words(tmp_path, text, column, words):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError) as caught:
        TextSource(path).load([column])
    assert str(caught.value) == f"{path}: {words}"


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ("a", 0),
        ("c", 3),
        ("2", 2),
        ("V", 1),
        ("b", "columns 1, 2 are all named 'b'; give the sensor column by its number, counted from 0."),
        (
            "C",
            "no sensor column is named 'C'; the nearest is 'c'. The columns are 'a', 'b', 'b', 'c'; a number counted "
            "from 0 does as well.",
        ),
        (
            True,
            "there is no sensor column True: the file has 4 columns, numbered from 0 to 3 (semicolon between them).",
        ),
        ("4", "there is no sensor column 4: the file has 4 columns, numbered from 0 to 3 (semicolon between them)."),
        (-1, "there is no sensor column -1: the file has 4 columns, numbered from 0 to 3 (semicolon between them)."),
    ],
)
def test_a_column_is_found_by_a_name_in_any_head_or_by_its_number(tmp_path, wanted, found):
    path = tmp_path / "a.csv"
    path.write_text("a;b;b;c\ns;V;mm;um\n1;2;3;4\n", encoding="utf-8")
    if isinstance(found, int):
        assert TextSource(path).resolve(wanted, "sensor") == found
        return
    with pytest.raises(RecordingError) as caught:
        TextSource(path).resolve(wanted, "sensor")
    assert str(caught.value) == f"{path}: {found}"


def test_a_single_column_may_have_several_words_as_its_name(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("power of it\n1\n2.5\n", encoding="utf-8")
    source = TextSource(path, alone=True)
    assert (source.names, source.layout.delimiter, source.load([0])[0].tolist()) == (("power of it",), ",", [1, 2.5])


def test_a_text_in_latin_1_and_of_old_ends_of_lines_is_read_with_its_units(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("drive,angle\rV,µrad\r1,2\r3,4\r".encode("latin-1"))
    source = TextSource(path)
    assert (source.layout.encoding, source.units, source.layout.first_line) == ("latin-1", ("V", "µrad"), 3)
    assert [column.tolist() for column in source.load([1, 0])] == [[2, 4], [1, 3]]
    assert [source.place(row) for row in (0, 1, 2)] == ["line 3", "line 4", "the end"]


def test_a_file_of_too_many_bytes_is_told_with_both_sizes(tmp_path, monkeypatch):
    path = write(tmp_path / "a.csv", ROWS)
    monkeypatch.setattr(files, "MAX_BYTES", 3000)
    assert refusal(path) == (
        f"{path}: the file has {path.stat().st_size / 1e9:.1f} GB and at most 0 GB are read, because the columns are "
        "held in memory; cut out the part you need or keep every n-th sample."
    )


def test_arrays_of_several_channels_have_names_and_numbers_of_their_own():
    drive = np.column_stack((DRIVE, np.cos(1.7 * TIME)))
    output = np.column_stack((OUTPUT, drive @ [0.3, 1], TIME + drive[:, 1]))
    made = recording_from_arrays(drive, output, 622.08, "b", 50, accept=["drift"])
    assert (made.input_names, made.output_names) == (("drive 0", "drive 1"), ("output 0", "output 1", "output 2"))
    assert (made.path, made.rate_hz, made.period_samples, made.input_units, made.output_units, made.role) == (
        *("b", 622.08, 50, (), ()),
        "",
    )
    assert made.sha256 == hashlib.sha256(made.drive.tobytes() + made.output.tobytes()).hexdigest()
    assert not (made.drive.flags.writeable or made.output.flags.writeable)
    drive[:] = 0.0
    np.testing.assert_array_equal(made.drive[:, 0], DRIVE)
    first = made.first(30)
    assert (first.samples, first.output.shape, first.step_s) == (30, (30, 3), 1 / 622.08)
    for shapes in (((N, 2), (N - 1, 3)), ((N, 2, 1), (N,)), ((), (N,))):
        with pytest.raises(RecordingError) as caught:
            recording_from_arrays(np.ones(shapes[0]), np.ones(shapes[1]), 100.0, "b")
        assert str(caught.value) == (
            f"b: drive has shape {shapes[0]} and output {shapes[1]}; give arrays of shape (samples,) or (samples, "
            "channels) with equally many samples."
        )


@pytest.mark.parametrize(
    ("units", "names", "said"),
    [
        (("µrad", " microrad ", ""), ("x", "y", "z [V]"), {"urad"}),
        (("", ""), ("x (μm)", "u [ volts ]"), {"um", "V"}),
        (("", " "), ("x (2)", "y [mm], raw"), set()),
        (("furlong",), ("x (mm)",), {"furlong"}),
        ((), ("x(mV)", "y"), {"mV"}),
        (("",), ("x (left) (rad)",), {"rad"}),
        (("Volt", "volt"), ("x", "y"), {"Volt", "V"}),
    ],
)
def test_units_are_those_stated_else_those_known_in_brackets_at_the_end(units, names, said):
    assert stated_units(units, names) == said


@pytest.mark.parametrize(
    ("which", "unit", "words"),
    [
        ("input", "V", "the drive is to be read in V and the file says V, mV"),
        ("output", "mm", "the output is to be read in mm and the file says um"),
        ("output", "um", ""),
    ],
)
def test_a_unit_is_held_against_those_of_all_channels_of_its_side(which, unit, words):
    made = recording_from_arrays(np.column_stack((DRIVE, np.cos(1.7 * TIME))), OUTPUT, 100.0, "b")
    made = replace(made, input_units=("V", "mV"), output_units=("µm",))
    if not words:
        assert check_stated(made, which, unit) is None
        assert read_in(replace(made, input_units=("volts", "V")), "V", "um").input_units == ("volts", "V")
        return
    with pytest.raises(RecordingError) as caught:
        check_stated(made, which, unit)
    assert str(caught.value) == f"b: {words}; give the unit that the file says, or convert its values."
    with pytest.raises(RecordingError, match="to be read in"):
        read_in(made, *(("V", "um") if which == "input" else ("mV", "mm")))


def test_a_digest_is_that_of_all_bytes_in_their_order_whatever_their_layout():
    one, two = np.arange(6.0).reshape(2, 3), np.arange(4.0)
    expected = hashlib.sha256(one.tobytes() + two.tobytes()).hexdigest()
    assert digest_of(one, two) == digest_of(np.asfortranarray(one), two) == expected != digest_of(two, one)
    kept = frozen(np.asfortranarray(one))
    assert kept.flags.c_contiguous and not kept.flags.writeable


def test_the_error_of_a_recording_is_one_line_with_its_evidence():
    finding = Finding("lead", "y", 7, "y leads", True, 2)
    error = RecordingError("a\nb.csv: y leads", [finding])
    assert (str(error), error.findings, error.page) == ("a\\u000ab.csv: y leads", (finding,), "recordings")
    assert RecordingError("x").findings == ()
    assert str(RecordingError("5\u00a0\u202fkHz\u2028")) == "5\u00a0\u202fkHz\\u2028"


LAYOUT = Layout(",", 4, (("t", "u", "", "y (um)"), ("s", "V", "V", "")), 3, "utf-8")


@pytest.mark.parametrize(
    ("column", "label"),
    [(0, "column 0 ('t')"), (1, "column 1 ('u')"), (2, "column 2"), (3, "column 3 ('y (um)')"), (4, "column 4")],
)
def test_a_column_is_labelled_by_the_first_row_of_its_head(column, label):
    assert LAYOUT.label(column) == label
    assert LAYOUT.names == ("t", "u", "", "y (um)") and LAYOUT.units == ("s", "V", "V", "")
    bare = replace(LAYOUT, headers=LAYOUT.headers[:1])
    assert bare.units == ("", "", "", "um") and bare.label(column) == label
    assert replace(LAYOUT, headers=()).names == ("0", "1", "2", "3")


@pytest.mark.parametrize(
    ("text", "delimiter", "columns", "regular"),
    [
        (b"1,2,3\n4,5,6\n", ",", 3, True),
        (b"1,2,3\n4,5,6", ",", 3, True),
        (b"1,2,3\n\n4,5,6\n", ",", 3, True),
        (b"1,2,3\n4,5\n", ",", 3, False),
        (b"1,2,3\n4,5", ",", 3, False),
        (b"1,2,3,\n4,5,6\n", ",", 3, False),
        (b"1,2\n4,5,6,7\n", ",", 3, False),
        (b"1,2\r4,5\n", ",", 2, False),
        (b'"1",2\n', ",", 2, False),
        (b"1;2\n3;4\n", ";", 2, True),
        (b"1\t2\n3\t4\n", "\t", 2, True),
        (b"1 2  3\n  4\t5 6 \n", None, 3, True),
        (b" 1 2 3\n4 5\n", None, 3, False),
        (b"1 2 3\n \n", None, 3, False),
        (b"", ",", 3, True),
    ],
)
def test_lines_are_regular_where_each_that_is_filled_has_all_its_cells(text, delimiter, columns, regular):
    assert _is_regular(text, replace(LAYOUT, delimiter=delimiter, columns=columns)) is regular


@pytest.mark.parametrize(
    ("line", "delimiter", "cells"),
    [
        ('a ,"b, c" ,d', ",", ["a", "b, c", "d"]),
        ("a;b;", ";", ["a", "b", ""]),
        ("  a  b\tc ", None, ["a", "b", "c"]),
        ('"a b" c', None, ['"a', 'b"', "c"]),
        ('"a\tb"\tc', "\t", ["a\tb", "c"]),
        ("", ",", [""]),
        ("", None, []),
    ],
)
def test_a_line_is_split_at_what_stands_outside_of_quotes(line, delimiter, cells):
    assert split(line, delimiter) == cells


@pytest.mark.parametrize(
    ("line", "delimiter"),
    [
        ("1,5;2,5", ";"),
        ("1\t2 3", "\t"),
        ("\t1 2\t", None),
        ("1,5 2,5", None),
        ("1,5e-3 -2,5 +0,1", None),
        ("1,5 2.5", ","),
        ("1,2,3 4", ","),
        ("1,5", ","),
        ("1 2", None),
    ],
)
def test_what_stands_between_two_cells_is_guessed_from_a_line(line, delimiter):
    assert _guess_delimiter(line) == delimiter


@pytest.mark.parametrize(
    ("units", "are"),
    [
        (("s", "V", "mrad"), True),
        (("(s)", "[V]", ""), True),
        (("s", "x"), False),
        (("", ""), False),
        (("µs", "°C", "-"), True),
    ],
)
def test_a_row_is_of_units_where_each_filled_cell_is_one(units, are):
    assert _are_units(units) is are


@pytest.mark.parametrize(
    ("size", "limit", "unpacked"),
    [(1, 2_000, 1_000), (49, 2_000, 1_000), (51, 2_000, 1_020), (99, 2_000, 1_980), (101, 2_000, 2_000), (7, 500, 500)],
)
def test_a_file_may_unpack_to_twenty_times_its_size_between_two_bounds(tmp_path, monkeypatch, size, limit, unpacked):
    monkeypatch.setattr(files, "_UNPACKED_BYTES", 1_000)
    monkeypatch.setattr(files, "MAX_BYTES", limit)
    (tmp_path / "a").write_bytes(b"0" * size)
    assert files.most_unpacked(tmp_path / "a") == unpacked
    assert (
        files.too_large(tmp_path / "a", (unpacked // 4,), 4) == "" != files.too_large(tmp_path / "a", (unpacked, 2), 1)
    )


def test_the_first_samples_of_a_recording_keep_all_else():
    made = recording_from_arrays(DRIVE, OUTPUT, 125.0, "r", 63)
    part = made.first(250)
    assert (part.samples, part.output.shape, part.period_samples, part.path, part.rate_hz) == (
        250,
        (250, 1),
        63,
        "r",
        125.0,
    )
    assert part.sha256 == made.sha256 and part.findings == made.findings and made.step_s == 0.008
    assert made.first(900).samples == N and part.drive[-1, 0] == DRIVE[249] and part.output[-1, 0] == OUTPUT[249]


def test_a_part_that_ends_where_it_begins_at_nought_is_none(tmp_path):
    np.savez(tmp_path / "a.npz", u=DRIVE, y=OUTPUT, fs=125.0)
    with pytest.raises(RecordingError, match=r"from 0 s to 0 s is no part of a recording of 3.2 s; give two times"):
        read_recording(tmp_path / "a.npz", "u", "y", part_s=(0.0, 0.0))
    assert named_part("a", (0.0, 0.0)) == "a from 0 s to 0 s"
    assert named_part("a", (0.0, 2.5)) == "a from 0 s to 2.5 s" and named_part("a", (0.0, None)) == "a"


def test_cells_in_quotes_may_have_a_blank_before_them():
    assert split('a, "b, c",  "d"', ",") == ["a", "b, c", "d"]


@pytest.mark.parametrize("end", ["", "\n", "\n\n", "\r\n"])
def test_the_digest_is_that_of_the_whole_file_however_it_ends(tmp_path, end):
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{u!r},{y!r}" for u, y in zip(DRIVE.tolist(), OUTPUT.tolist(), strict=True))
    path.write_bytes(f"u,y\n{rows}{end}".encode())
    read = read_recording(path, "u", "y", 125.0)
    assert read.sha256 == hashlib.sha256(path.read_bytes()).hexdigest() and read.samples == N


def test_remarks_may_be_indented_where_cells_stand_in_quotes(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f'"{u!r}", {y!r}' for u, y in zip(DRIVE.tolist(), OUTPUT.tolist(), strict=True)]
    rows[100] += '\n  # the "lamp" was changed\n\t% and so on'
    path.write_text("u,y\n" + "\n".join(rows) + "\n")
    read = read_recording(path, "u", "y", 125.0)
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE)
    np.testing.assert_array_equal(read.output[:, 0], OUTPUT)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_text_of_two_bytes_a_letter_is_named_in_either_order_of_bytes(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes(("\ufeffu,y\n" + "1,2\n" * 300).encode(encoding))
    with pytest.raises(RecordingError) as refused:
        read_recording(path, "u", "y", 125.0)
    assert str(refused.value) == f"{path}: this is UTF-16 text; export the recording as plain text (CSV, UTF-8)."
