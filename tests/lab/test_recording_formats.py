"""Recordings from binary and LabVIEW files: what is read, and each refusal of a damaged or contradictory file."""

import hashlib
import io
import itertools
import logging
import math
import pickle
import random
import re
import struct
import sys
import zipfile
import zlib
from pathlib import Path

import h5py
import lvm_read
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from nptdms.log import log_manager
from scipy.io import savemat
from scipy.sparse import csc_array

from microrad.core.units import printable
from microrad.lab.recording import RecordingError, files, multisine_recordings, read_in, read_recording
from microrad.lab.recording.formats import text as text_format
from microrad.lab.recording.formats.arrays import Variable, _with_axes, channels_of, indexed, rates_of, stated_rate
from microrad.lab.recording.formats.hdf5 import _lzf_bytes, _unpacked_bytes, check_heaps, unusable_dataset
from microrad.lab.recording.formats.lvm import LvmSource, _Blanks, _count_lines
from microrad.lab.recording.formats.source import Channel, Container, StatedRate, damaged, is_time_name, time_unit
from microrad.lab.recording.formats.tdms import TdmsSource, _check_scales, _Listener, check_structure
from microrad.lab.recording.reader import open_source
from microrad.lab.recording.records import digest_of
from places import ROOT

N, RATE_HZ = 1000, 2000.0
TIME_S = np.arange(N) / RATE_HZ
DRIVE = 6 + 6 * np.sin(2 * np.pi * 7.3 * TIME_S)
OUTPUT = 0.08 * np.sin(2 * np.pi * 7.3 * TIME_S - 0.1)


def refusal(path, *args, **kwargs):
    with pytest.raises(RecordingError) as caught:
        read_recording(path, *args, **kwargs)
    message = str(caught.value)
    assert str(path) in message
    return message


def check(read, names=("drive", "output"), rate_hz=RATE_HZ):
    np.testing.assert_allclose(read.drive[:, 0], DRIVE, atol=1e-12)
    np.testing.assert_allclose(read.output[:, 0], OUTPUT, atol=1e-12)
    assert read.rate_hz == pytest.approx(rate_hz, rel=1e-9)
    assert (*read.input_names, *read.output_names) == names
    assert len(read.sha256) == 64


# ---------------------------------------------------------------------------------------------------------------- TDMS
def tdms(path, *, step=1 / RATE_HZ, drive=DRIVE, output=OUTPUT, more=None):
    with TdmsWriter(path) as file:
        for name, values in (("drive", drive), ("output", output)):
            properties = {"wf_increment": step, "unit_string": "V", **(more or {}).get(name, {})}
            file.write_segment([ChannelObject("bench", name, values, properties)])
    return path


@pytest.mark.promise("recordings-2", "recordings-4", "recordings-5")
@pytest.mark.promise("readme-9")
def test_tdms(tmp_path):
    path = tdms(tmp_path / "a.tdms")
    read = read_recording(path, "bench/drive", "output")
    check(read, ("bench/drive", "bench/output"))
    assert read.input_units == ("V",)
    check(read_recording(path, 0, 1, RATE_HZ), ("bench/drive", "bench/output"))


@pytest.mark.promise("recordings-32")
def test_the_example_of_the_page_reads_a_file_of_a_bench(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    every = {"wf_increment": 1 / RATE_HZ}
    with TdmsWriter("loop.tdms") as file:
        file.write_segment([ChannelObject("bench", *each, every) for each in (("drive", DRIVE), ("angle", OUTPUT))])
    page = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    (code,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "loop.tdms" in each)
    known = {}
    exec(code, known)
    check(known["loop"], ("bench/drive", "bench/angle"))
    rate, *findings = capsys.readouterr().out.splitlines()
    assert float(rate) == pytest.approx(RATE_HZ)
    assert findings and findings == [finding.message for finding in known["loop"].findings]


@pytest.mark.parametrize("more", [{"NI_Number_Of_Scales": 2**31 - 1}, {"NI_Scale[999999999]_Scale_Type": "Linear"}])
def test_tdms_of_more_scales_than_memory_is_refused(tmp_path, more):
    """The library made one after the other."""
    path = tdms(tmp_path / "a.tdms", more={"drive": more})
    assert "'bench/drive' states" in refusal(path, "drive", "output")


@pytest.fixture
def library_says(monkeypatch):
    """What npTDMS writes to stderr, which it keeps from when it is imported."""
    monkeypatch.setattr(log_manager.console_handler, "stream", io.StringIO())
    return log_manager.console_handler.stream


def test_tdms_of_a_scale_that_is_not_known_is_refused(tmp_path, library_says):
    """The library warns of it and gives the numbers of the converter in place of volts."""
    scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Magic", "NI_Scaling_Status": "unscaled"}
    message = refusal(tdms(tmp_path / "a.tdms", more={"drive": scale}), "drive", "output")
    assert "not as they were recorded (Unsupported scale type: Magic)" in message
    assert library_says.getvalue() == ""


def test_tdms_with_a_name_that_is_no_text_is_read_in_silence(tmp_path, library_says):
    """The library wrote to stderr for each such name, with bytes of the file."""
    path = tdms(tmp_path / "a.tdms")
    path.write_bytes(path.read_bytes().replace(b"unit_string", b"unit_\xfftring"))
    check(read_recording(path, "drive", "output"), ("bench/drive", "bench/output"))
    assert library_says.getvalue() == ""


@pytest.mark.promise("recordings-10")
def test_tdms_ignores_a_stale_index(tmp_path):
    path = tdms(tmp_path / "a.tdms")
    tdms(tmp_path / "b.tdms", drive=DRIVE[:300], output=OUTPUT[:300])
    (tmp_path / "a.tdms_index").write_bytes(b"TDSh" + (tmp_path / "b.tdms").read_bytes()[4:])
    assert read_recording(path, "drive", "output").samples == N
    assert "index" in refusal(tmp_path / "a.tdms_index", 0, 1)


@pytest.mark.promise("recordings-9")
def test_tdms_rate_disagrees(tmp_path):
    message = refusal(tdms(tmp_path / "a.tdms"), "drive", "output", 2003.0)
    assert "2003 Hz (given) and 2000 Hz (wf_increment = 0.0005 s of 'bench/drive')" in message
    assert read_recording(tmp_path / "a.tdms", "drive", "output", 2001.0).rate_hz == 2001.0


def test_tdms_two_increments(tmp_path):
    path = tdms(tmp_path / "a.tdms", more={"output": {"wf_increment": 0.001}})
    assert "2000 Hz" in refusal(path, "drive", "output")
    assert "1000 Hz" in refusal(path, "drive", "output")


@pytest.mark.promise("recordings-26")
def test_tdms_lengths_differ(tmp_path):
    message = refusal(tdms(tmp_path / "a.tdms", output=OUTPUT[:-5]), "drive", "output")
    assert "has 1000 samples and channel 1 ('bench/output') 995" in message


@pytest.mark.promise("recordings-26")
@pytest.mark.parametrize(
    ("late_us", "offset_s", "together"),
    [(10_000, 0.0, False), (-10_000, 0.0, False), (240, 0.0, True), (260, 0.0, False), (260, -260e-6, True)],
)
def test_tdms_starts_differ(tmp_path, late_us, offset_s, together):
    """By half a step of 500 us they may; where no step is known, nobody can tell."""
    start = np.datetime64("2026-01-01T00:00:00.000000")
    path = tmp_path / "a.tdms"
    begins = {"drive": {"wf_start_time": start}}
    begins["output"] = {"wf_start_time": start + np.timedelta64(late_us, "us"), "wf_start_offset": offset_s}
    tdms(path, more=begins)
    if together:
        check(read_recording(path, "drive", "output"), ("bench/drive", "bench/output"))
    else:
        message = refusal(path, "drive", "output")
        first, last = sorted(begins, reverse=late_us < 0)
        assert f"'bench/{last}' starts {abs(late_us) * 1e-6:g} s apart from 'bench/{first}'" in message
        assert "one step is 0.0005 s); record both in one task, or cut them" in message
    tdms(path, step=0.0, more=begins)
    check(read_recording(path, "drive", "output", RATE_HZ), ("bench/drive", "bench/output"))


@pytest.mark.parametrize(("last", "stated"), [(999, None), (1000, 1001)])
def test_a_tdms_channel_has_at_most_a_thousand_scales(last, stated):
    properties = {f"NI_Scale[{last}]_Scale_Type": "Linear", "NI_Scale[3]_Scale_Type": "Linear"}
    if stated is None:
        _check_scales("bench/drive", properties)
        _check_scales("bench/drive", {"NI_Number_Of_Scales": 1000})
        return
    for each in (properties, {"NI_Number_Of_Scales": stated}):
        with pytest.raises(ValueError, match=rf"^'bench/drive' states {stated} scales$"):
            _check_scales("bench/drive", each)


@pytest.mark.parametrize("step", ["fast", -1.0])
def test_tdms_of_an_increment_that_is_no_step_needs_a_rate(tmp_path, step):
    path = tdms(tmp_path / "a.tdms", step=step)
    assert "give the rate (--rate, rate_hz) in Hz" in refusal(path, "drive", "output")
    check(read_recording(path, "drive", "output", RATE_HZ), ("bench/drive", "bench/output"))


def test_tdms_whose_increment_is_a_whole_number_has_its_rate(tmp_path):
    assert read_recording(tdms(tmp_path / "a.tdms", step=1), "drive", "output").rate_hz == 1.0


@pytest.mark.parametrize(("mask", "order"), [(0, "<"), (1 << 6, ">"), (1 << 6 | 1 << 1, ">")])
def test_a_tdms_segment_says_in_which_order_its_bytes_stand(tmp_path, mask, order):
    path = tmp_path / "a.tdms"
    path.write_bytes(b"TDSm" + struct.pack("<l", mask) + struct.pack(f"{order}lQQ", 4713, 0, 0))
    check_structure(path)
    path.write_bytes(b"TDSm" + struct.pack("<l", mask) + struct.pack(f"{order}lQQ", 4713, 7, 0))
    with pytest.raises(RecordingError, match=r"at byte 0, is truncated: 7 of its 7 bytes are missing"):
        check_structure(path)


@pytest.mark.promise("recordings-9")
def test_tdms_without_increment_needs_a_rate(tmp_path):
    path = tdms(tmp_path / "a.tdms", step=0.0)
    assert "give the rate (--rate, rate_hz) in Hz" in refusal(path, "drive", "output")
    check(read_recording(path, "drive", "output", RATE_HZ), ("bench/drive", "bench/output"))


@pytest.mark.promise("recordings-10", "recordings-26")
@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda b: b[:-100], "is truncated: 100 of its"),
        (lambda b: b[:20], "has 20 of the 28 bytes of its lead-in"),
        (lambda b: b + b"TDSm12", "has 6 of the 28 bytes"),
        (lambda b: b + b"TDS", "has 3 of the 28 bytes"),
        (lambda b: b + b"TDSn", "should begin with 'TDSm' and begins with b'TDSn'"),
        (lambda b: b + b"garbage" * 5, "should begin with 'TDSm' and begins with b'garb'"),
        (lambda b: b[:12] + b"\xff" * 8 + b[20:], "was never completed"),
        (lambda b: b[:8] + struct.pack("<l", 17) + b[12:], "states version 17"),
        (lambda b: b[:20] + struct.pack("<Q", 1 << 40) + b[28:], "places its data at byte"),
        (lambda b: b[:28] + b"\xff" * 40 + b[68:], "cannot be read as a TDMS file"),
    ],
)
def test_damaged_tdms(tmp_path, damage, words):
    path = tdms(tmp_path / "a.tdms")
    path.write_bytes(damage(path.read_bytes()))
    message = refusal(path, "drive", "output")
    assert words in message
    assert "again" in message


def test_empty_tdms(tmp_path):
    path = tmp_path / "a.tdms"
    path.write_bytes(b"")
    assert "the file is empty" in refusal(path, 0, 1)
    path.write_bytes(b"TDSm" + struct.pack("<llQQlL", 2, 4713, 4, 4, 0, 0)[:28])
    assert "holds no channel of numbers" in refusal(path, 0, 1)
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("g", "words", ["a", "b"]), ChannelObject("g", "none", np.array([]))])
    message = refusal(path, "words", 1)
    assert "'g/words' holds" in message
    assert "'g/none' holds no samples; record again" in message


@pytest.mark.promise("recordings-3", "recordings-11")
def test_renamed_files(tmp_path):
    path = tmp_path / "a.tdms"
    path.write_text("drive,output\n" + "1,2\n" * 300)
    message = refusal(path, 0, 1)
    assert "the name says a LabVIEW TDMS file" in message
    assert "the first bytes are 'drive,output'; if it is text, rename it to 'a.csv'" in message
    binary = tdms(tmp_path / "b.csv")
    assert "the content is a LabVIEW TDMS file; rename the file to 'b.tdms'" in refusal(binary, 0, 1)
    for suffix in ("mat", "npy", "npz", "h5"):
        path = tmp_path / f"c.{suffix}"
        path.write_text("drive,output\n" + "1,2\n" * 300)
        assert "rename it to 'c.csv'" in refusal(path, 0, 1)
    packed = tmp_path / "d.csv"
    packed.write_bytes(b"\x1f\x8b\x08" + bytes(100))
    assert "unpack it first" in refusal(packed, 0, 1)
    archive = tmp_path / "f.npy"
    with archive.open("wb") as file:
        np.savez(file, drive=DRIVE)
    message = refusal(archive, 0, 1)
    assert "the name says a NumPy array, which begins with 'NUMPY', and the first bytes are 'PK" in message
    assert message.endswith("; rename it to 'f.npz'.")
    old = tmp_path / "e.mat"
    old.write_bytes(struct.pack("<5i", 0, N, 1, 0, 6) + b"drive\x00" + DRIVE.tobytes())
    assert "save it with -v7" in refusal(old, 0, 1)


def test_a_name_of_several_lines_makes_no_message_of_several(tmp_path):
    np.savez(tmp_path / "a.npz", **{"no\nnumbers": np.array("words")})
    assert "('no\\u000anumbers' holds" in refusal(tmp_path / "a.npz", 0, 1)


@pytest.mark.promise("recordings-10")
@pytest.mark.promise("licences-1")
def test_missing_library(tmp_path, monkeypatch):
    path = tmp_path / "a.tdms"
    tdms(path)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    assert "pip install --constraint constraints.txt '.[lab]'" in refusal(path, 0, 1)


# ----------------------------------------------------------------------------------------------------------------- LVM
def lvm(path, *, x_columns="No", comma=False, segments=1, gap_s=0.0, comment="", rows=None):
    separator = "\t"
    head = ["LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    head += [f"Decimal_Separator\t{',' if comma else '.'}", "Multi_Headings\tYes", f"X_Columns\t{x_columns}"]
    text = "\n".join([*head, "Time_Pref\tAbsolute", "***End_of_Header***", ""]) + "\n"
    cut = np.array_split(np.arange(N), segments)
    for k, part in enumerate(cut):
        clock = f"12:00:{TIME_S[part[0]] + k * gap_s:010.7f}"
        names = {"No": "X_Value\tdrive\toutput", "One": "X_Value\tdrive\toutput"}.get(
            x_columns, "X_Value\tdrive\tX_Value\toutput"
        )
        tags = ["Channels\t2", f"Samples\t{part.size}\t{part.size}", "Date\t2026/01/01\t2026/01/01"]
        tags += [f"Time\t{clock}\t{clock}", "Y_Unit_Label\tVolts\tum", "X0\t0.0\t0.0", "Delta_X\t5.0E-4\t5.0E-4"]
        body = []
        for i in part:
            u, y, t = (
                f"{DRIVE[i]:.15g}",
                f"{OUTPUT[i]:.15g}",
                f"{(i - part[0]) / RATE_HZ:.6f}",
            )
            row = {"No": ["", u, y], "One": [t, u, y], "Multi": [t, u, t, y]}[x_columns]
            body.append(separator.join(row))
        if rows is not None:
            rows(body)
        if comment:
            body[0] += separator + comment
            names += separator + "Comment"
        block = "\n".join([*tags, "***End_of_Header***", names, *body]) + "\n\n"
        text += block.replace(".", ",") if comma else block
    path.write_bytes(text.replace("\n", "\r\n").encode("latin-1"))
    return path


@pytest.mark.promise("recordings-4", "recordings-14")
@pytest.mark.promise("readme-9")
@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("comment", ["", "started"])
def test_lvm(tmp_path, x_columns, comma, comment):
    path = lvm(tmp_path / "a.lvm", x_columns=x_columns, comma=comma, comment=comment)
    read = read_recording(path, "drive", "output")
    check(read)
    assert (read.input_units, read.output_units) == (("Volts",), ("um",))
    if not comment and x_columns != "Multi":
        other = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)[0]["data"]
        np.testing.assert_array_equal(other[:, -2:], np.column_stack((read.drive, read.output)))


def test_lvm_without_a_channel(tmp_path):
    path = lvm(tmp_path / "a.lvm")
    path.write_bytes(path.read_bytes().replace(b"X_Value\tdrive\toutput", b"X_Value\tComment"))
    assert "the LVM file has headers and no channel; record again" in refusal(path, 0, 1)


@pytest.mark.parametrize("segments", [1, 3])
def test_lvm_with_commas_between_its_cells(tmp_path, segments):
    path = lvm(tmp_path / "a.lvm", x_columns="One", segments=segments)
    path.write_bytes(path.read_bytes().replace(b"Separator\tTab", b"Separator\tComma").replace(b"\t", b","))
    read = read_recording(path, "drive", "output")
    check(read)
    assert (read.input_units, read.output_units) == (("Volts",), ("um",))


@pytest.mark.parametrize("segments", [1, 3])
@pytest.mark.parametrize("end", [b"\r\n\r\n", b"\r\n", b""])
def test_lvm_may_end_without_a_blank_line_or_the_end_of_its_last_line(tmp_path, segments, end):
    path = lvm(tmp_path / "a.lvm", segments=segments)
    path.write_bytes(path.read_bytes().removesuffix(b"\r\n\r\n") + end)
    check(read_recording(path, "drive", "output"))
    assert LvmSource(path).samples() == (N, N)


def test_lvm_names_may_end_with_separators(tmp_path):
    path = lvm(tmp_path / "a.lvm")
    text = path.read_bytes()
    path.write_bytes(text.replace(b"X_Value\tdrive\toutput", b"X_Value\tdrive\toutput\t\t"))
    check(read_recording(path, "drive", "output"))
    assert LvmSource(path).names == ("drive", "output")
    path.write_bytes(text.replace(b"X_Value\tdrive\toutput", b"\t\t"))
    assert "should name the columns, beginning with 'X_Value', and reads ''" in refusal(path, 0, 1)
    path.write_bytes(text[: text.rindex(b"***End_of_Header***")] + b"***End_of_Header***")
    assert "should name the columns, beginning with 'X_Value', and reads ''" in refusal(path, 0, 1)


@pytest.mark.parametrize(
    ("tag", "units"),
    [("Y_Unit_Label\tVolts\tum", ("Volts", "um")), ("Y_Unit_Label\tVolts", ("Volts", "")), ("Other\t1", ("", ""))],
)
def test_lvm_has_the_units_that_its_header_states(tmp_path, tag, units):
    path = lvm(tmp_path / "a.lvm", x_columns="One")
    path.write_bytes(path.read_bytes().replace(b"Y_Unit_Label\tVolts\tum", tag.encode()))
    assert LvmSource(path).units == ("", *units)


@pytest.mark.parametrize("tag", [b"Other\t5.0E-4\t5.0E-4", b"Delta_X\t0\t0", b"Delta_X\tfast\tslow", b"Delta_X"])
def test_lvm_whose_header_states_no_step_needs_a_rate_or_a_time(tmp_path, tag):
    path = lvm(tmp_path / "a.lvm")
    path.write_bytes(path.read_bytes().replace(b"Delta_X\t5.0E-4\t5.0E-4", tag))
    assert "give the rate (--rate, rate_hz) in Hz" in refusal(path, "drive", "output")
    check(read_recording(path, "drive", "output", RATE_HZ))
    path = lvm(tmp_path / "b.lvm", x_columns="One")
    path.write_bytes(path.read_bytes().replace(b"Delta_X\t5.0E-4\t5.0E-4", tag))
    check(read_recording(path, "drive", "output"))
    path = lvm(tmp_path / "c.lvm", segments=2)  # without a step nobody can tell that they go on
    path.write_bytes(path.read_bytes().replace(b"Delta_X\t5.0E-4\t5.0E-4", tag))
    assert LvmSource(path).names == ("0/drive", "0/output", "1/drive", "1/output")


@pytest.mark.parametrize("tag", ["Date", "Time"])
def test_lvm_segments_without_a_clock_or_of_another_step_are_not_joined(tmp_path, tag):
    path = lvm(tmp_path / "a.lvm", segments=2)
    whole = path.read_bytes()
    before, _, behind = whole.rpartition(b"5.0E-4\t5.0E-4")
    for text in (whole.replace(f"{tag}\t".encode(), b"Other\t"), before + b"2.0E-4\t2.0E-4" + behind):
        path.write_bytes(text)
        assert LvmSource(path).names == ("0/drive", "0/output", "1/drive", "1/output")


@pytest.mark.parametrize(("gap_s", "joined"), [(0.00024, True), (0.00026, False), (-0.00024, True), (-0.00026, False)])
def test_lvm_segments_go_on_where_half_a_step_at_most_is_between_them(tmp_path, gap_s, joined):
    source = LvmSource(lvm(tmp_path / "a.lvm", segments=2, gap_s=gap_s))
    assert source.names == (("drive", "output") if joined else ("0/drive", "0/output", "1/drive", "1/output"))
    assert source.samples() == ((N, N) if joined else (N // 2,) * 4)


def test_the_time_column_of_an_lvm_file_has_none_before_itself(tmp_path):
    for x_columns in ("One", "Multi"):
        source = LvmSource(lvm(tmp_path / "a.lvm", x_columns=x_columns))
        assert source.find_time([0]) is None
        assert [rate.rate_hz for rate in source.rates([0])] == ([] if x_columns == "One" else [RATE_HZ])


@pytest.mark.promise("recordings-4")
def test_lvm_segments(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    check(read_recording(path, "drive", "output"))
    path = lvm(tmp_path / "b.lvm", segments=3, gap_s=0.1)
    assert "The channels are '0/drive', '0/output', '1/drive'" in refusal(path, "drove", "output")
    assert "'drive' may be '0/drive', '1/drive', '2/drive'" in refusal(path, "drive", "output")
    read = read_recording(path, "1/drive", "1/output")
    np.testing.assert_allclose(read.drive[:, 0], DRIVE[334:667], atol=1e-12)


def test_an_lvm_segment_without_rows_ends_at_its_names(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    parts = path.read_bytes().split(b"\r\n\r\n")
    parts[2] = parts[2][: parts[2].index(b"\r\n", parts[2].rfind(b"X_Value"))]
    path.write_bytes(b"\r\n\r\n".join(parts))
    assert "'0/drive', '0/output', '1/drive', '1/output', '2/drive'" in refusal(path, "drove", "output")
    np.testing.assert_allclose(read_recording(path, "2/drive", "2/output").drive[:, 0], DRIVE[667:], atol=1e-12)


def test_the_header_of_an_lvm_file_may_have_letters_beyond_ascii(tmp_path):
    path = lvm(tmp_path / "a.lvm")
    path.write_bytes(path.read_bytes().replace(b"Writer_Version", b"Operator\tJ\xf6rg, 20 \xb0C\r\nWriter_Version"))
    check(read_recording(path, "drive", "output"))


def test_lvm_segments_of_one_clock_go_on_where_x0_says(tmp_path):
    path, begins = lvm(tmp_path / "a.lvm", segments=3), TIME_S[[0, 334, 667]]
    text = path.read_bytes()
    for begin in begins[1:]:
        text = text.replace(f"Time\t12:00:{begin:010.7f}".encode(), b"Time\t12:00:00.0000000")
    head, *parts = text.split(b"X0\t0.0\t")
    path.write_bytes(head + b"".join(f"X0\t{t}\t".encode() + each for t, each in zip(begins, parts, strict=True)))
    check(read_recording(path, "drive", "output"))
    path.write_bytes(text)
    assert "The channels are '0/drive', '0/output', '1/drive'" in refusal(path, "drove", "output")


def test_a_cell_of_a_later_lvm_segment_is_named_by_its_line(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    lines = path.read_bytes().split(b"\r\n")
    last = max(k for k, line in enumerate(lines) if line.count(b"\t") == 2 and line.startswith(b"\t"))
    lines[last] = b"\tnan\t1.0"
    path.write_bytes(b"\r\n".join(lines))
    assert f"line {last + 1}" in refusal(path, "drive", "output")


def test_each_row_of_joined_lvm_segments_has_its_own_line(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    lines = [k for k, line in enumerate(path.read_bytes().split(b"\r\n"), 1) if line.startswith(b"\t")]
    source = LvmSource(path)
    assert len(lines) == N and [source.place(row) for row in range(N)] == [f"line {k}" for k in lines]
    assert source.place(N) == "the end"


def test_lvm_segments_of_other_channels_are_not_joined(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    last = path.read_bytes().rpartition(b"drive\toutput")
    path.write_bytes(last[0] + b"drive\ttemperature" + last[2])
    for names, part in ((("0/drive", "0/output"), slice(334)), (("2/drive", "2/temperature"), slice(667, None))):
        read = read_recording(path, *names)
        np.testing.assert_allclose(read.drive[:, 0], DRIVE[part], atol=1e-12)
        np.testing.assert_allclose(read.output[:, 0], OUTPUT[part], atol=1e-12)


class Searched(bytes):
    """Bytes that count how many were searched through."""

    searched = 0

    def find(self, wanted, start=0):
        at = super().find(wanted, start)
        self.searched += (len(self) if at < 0 else at) - start
        return at


def test_segments_of_lvm_are_found_in_one_pass():
    """Each segment looked through the whole rest of the file for kinds of blank lines that are not in it."""
    rows = b"1\t2\r\n" * 5 + b"\r\n"
    head = b"***End_of_Header***\r\n"
    data = Searched(head + rows * 300)
    blanks = _Blanks(data, "\t")
    starts = range(len(head), len(data), len(rows))
    assert [blanks.behind(start) for start in starts] == [start + len(rows) - 2 for start in starts]
    assert data.searched <= 4 * len(data)


def test_lvm_of_many_segments(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=N // 2)
    check(read_recording(path, "drive", "output"))
    path = lvm(tmp_path / "b.lvm", segments=4, comma=True)
    check(read_recording(path, "drive", "output"))


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ("x", "'x' is not a finite number"),
        ("", "the cell is empty"),
        ("nan", "'nan' is not a finite number"),
        ("-inf", "'-inf' is not a finite number"),
    ],
)
def test_lvm_bad_cell(tmp_path, bad, words):
    def spoil(body):
        body[400] = f"\t1.0\t{bad}"

    path = lvm(tmp_path / "a.lvm", rows=spoil)
    line = path.read_bytes().decode("latin-1").split("\r\n").index(f"\t1.0\t{bad}") + 1
    message = refusal(path, "drive", "output")
    assert f"line {line}, channel 1 ('output'): {words}" in message


def test_damaged_lvm(tmp_path):
    path = lvm(tmp_path / "a.lvm")
    text = path.read_bytes()
    path.write_bytes(text[:60])
    assert "no '***End_of_Header***'" in refusal(path, 0, 1)
    path.write_bytes(text[: text.index(b"Channels")])
    assert "no segment with a header" in refusal(path, 0, 1)
    path.write_bytes(text.replace(b"Separator\tTab", b"Separator\tPipe", 1))
    assert "names the separator 'Pipe'; LVM files have Tab or Comma: correct that word" in refusal(path, 0, 1)
    path.write_bytes(text.replace(b"X_Value\t", b"1.0\t", 1))
    assert "should name the columns, beginning with 'X_Value'" in refusal(path, 0, 1)


# -------------------------------------------------------------------------------------------------------------- MATLAB
def matlab73(path, **variables):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in variables.items():
            file[name] = np.atleast_2d(values).T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


@pytest.mark.promise("recordings-4", "recordings-6", "recordings-9")
@pytest.mark.promise("readme-9")
def test_matlab_v5(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"drive": DRIVE, "x": np.column_stack((DRIVE, OUTPUT)), "fs": RATE_HZ, "note": "hello"})
    check(read_recording(path, "drive", "x[1]"), ("drive", "x[1]"))
    check(read_recording(path, 0, 2), ("drive", "x[1]"))
    assert "'note' holds text" in refusal(path, "note", "x[1]")
    assert "2500 Hz (given) and 2000 Hz (fs = 2000 Hz)" in refusal(path, "drive", "x[1]", 2500.0)


@pytest.mark.promise("recordings-4", "recordings-11")
def test_matlab_structure(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"run": {"drive": DRIVE, "output": OUTPUT, "dt": 1 / RATE_HZ, "in": {"t": TIME_S}}})
    check(read_recording(path, "run/drive", "output"), ("run/drive", "run/output"))
    check(read_recording(path, "run/drive", "output", time="t"), ("run/drive", "run/output"))


@pytest.mark.promise("recordings-4")
@pytest.mark.promise("readme-9")
def test_matlab_v73(tmp_path):
    both = np.column_stack((DRIVE, OUTPUT))
    path = matlab73(tmp_path / "a.mat", both=both, dt=1 / RATE_HZ)
    check(read_recording(path, "both[0]", "both[1]"), ("both[0]", "both[1]"))
    assert "nearest is 'both[1]'" in refusal(path, "both[0]", "both[2]")


@pytest.mark.promise("recordings-4", "recordings-11")
def test_matlab_array_of_structures(tmp_path):
    """As a real-time system writes its channels."""
    made = np.zeros((1, 2), dtype=[("Name", object), ("Data", object), ("dt", object)])
    made[0, 0], made[0, 1] = ("drive", DRIVE, 1 / RATE_HZ), ("output", OUTPUT, 1 / RATE_HZ)
    savemat(tmp_path / "a.mat", {"run": {"Y": made}}, do_compression=True)
    names = ("run/Y[0]/Data", "run/Y[1]/Data")
    check(read_recording(tmp_path / "a.mat", *names), names)
    assert "'Data' may be 'run/Y[0]/Data', 'run/Y[1]/Data'" in refusal(tmp_path / "a.mat", "Data", 1)
    assert "'run/Y[0]/Name' holds text; save numbers" in refusal(tmp_path / "a.mat", "run/Y[0]/Name", 1)


def test_matlab_v73_is_known_by_hdf5s_signature_behind_any_words_of_matlab(tmp_path):
    path = matlab73(tmp_path / "a.mat", drive=DRIVE, output=OUTPUT)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"MATLAB 7.3 MAT-file", b"MATLAB 9.9 XYZ-file", 1))
    check(read_recording(path, "drive", "output", RATE_HZ))


@pytest.mark.promise("recordings-26")
@pytest.mark.parametrize(("kept", "missing"), [(200, 7992), (1000, 7192), (9000, 7256)])
def test_truncated_matlab(tmp_path, kept, missing):
    path = tmp_path / "a.mat"
    savemat(path, {"drive": DRIVE, "output": OUTPUT})
    path.write_bytes(path.read_bytes()[:kept])
    message = refusal(path, "drive", "output", RATE_HZ)
    assert f"an element is cut off, {missing} bytes of it are missing" in message
    assert "the file is damaged or truncated: copy it again" in message


def test_a_structure_of_matlab_without_fields_is_no_channel(tmp_path):
    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    path = tmp_path / "a.mat"
    savemat(path, {"drive": DRIVE})
    head = element(6, struct.pack("<II", 2, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"bare")
    bare = element(14, head + element(5, struct.pack("<i", 1)) + element(1, b""))
    path.write_bytes(path.read_bytes() + bare)
    assert "'bare' is a structure without fields; name another variable" in refusal(path, "drive", "bare", RATE_HZ)


def test_damaged_matlab_names_the_variable(tmp_path):
    """Damage to packed numbers shows in their checksum, when they are read."""
    path = tmp_path / "a.mat"
    noise = np.random.default_rng(1).standard_normal(20_000)
    savemat(path, {"drive": noise, "output": noise[::-1]}, do_compression=True)
    data = bytearray(path.read_bytes())
    data[-2] ^= 1
    path.write_bytes(data)
    message = refusal(path, "drive", "output", RATE_HZ)
    assert "channel 1 ('output') cannot be read (the variable at byte" in message
    assert "incorrect data check" in message


@pytest.mark.promise("recordings-11")
@pytest.mark.parametrize(
    ("value", "words"),
    [
        (DRIVE + 1j, "'x' holds complex numbers, not real numbers; save the real signal"),
        (DRIVE > 6, "'x' holds booleans, not real numbers; save numbers"),
        ("hello", "'x' holds text; save numbers"),
        (np.array([[DRIVE, OUTPUT]], dtype=object), "'x' holds cells; save the numbers of each cell as an array"),
        (csc_array(np.eye(30)), "'x' holds a sparse matrix; save it as full"),
        (np.zeros((0, 1)), "'x' holds no samples; record again"),
        (np.zeros((200, 11_000), np.uint8), "at most 10000 channels are listed; save the columns that you need"),
    ],
)
def test_matlab_variables_that_are_no_channel(tmp_path, monkeypatch, value, words):
    monkeypatch.setattr("microrad.lab.recording.formats.arrays._MOST_COLUMNS", 100)
    path = tmp_path / "a.mat"
    savemat(path, {"x": value, "output": OUTPUT}, do_compression=True)
    assert words.replace("10000", "100") in refusal(path, "x", "output", RATE_HZ)


@pytest.mark.promise("recordings-13")
def test_a_matlab_file_that_unpacks_to_too_much(tmp_path, monkeypatch):
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_BYTES", 100_000)
    path = tmp_path / "a.mat"
    savemat(path, {"drive": DRIVE, "output": np.zeros(100_000)}, do_compression=True)
    message = refusal(path, "drive", "output", RATE_HZ)
    assert "unpacks to more than" in message
    assert "save it without compression (-v6)" in message
    savemat(path, {"drive": DRIVE, "output": np.zeros(N)}, do_compression=True)
    assert "is constant" in refusal(path, "drive", "output", RATE_HZ)


def test_too_little_memory_is_no_damage(tmp_path, monkeypatch):
    def full(self, left):
        raise MemoryError

    path = tmp_path / "a.mat"
    savemat(path, {"drive": DRIVE, "output": OUTPUT})
    monkeypatch.setattr("microrad.core.matlab_file.MatlabFile.numbers", full)
    message = refusal(path, "drive", "output", RATE_HZ)
    assert "channel 0 ('drive') takes more memory than there is to read; cut out the part that you need" in message
    assert "damaged" not in message


# --------------------------------------------------------------------------------------------------------------- NumPy
@pytest.mark.promise("recordings-4")
@pytest.mark.promise("readme-9")
def test_numpy_archive(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, drive=DRIVE, output=OUTPUT[:, None], sample_rate=RATE_HZ)
    check(read_recording(path, "drive", "output"))
    np.savez_compressed(path, drive=DRIVE.astype(np.float32), output=OUTPUT, time=TIME_S)
    read = read_recording(path, "drive", "output")
    np.testing.assert_allclose(read.drive[:, 0], DRIVE, rtol=1e-6)
    assert read.rate_hz == RATE_HZ


@pytest.mark.promise("recordings-4", "recordings-6")
def test_numpy_array(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.column_stack((DRIVE, OUTPUT)))
    check(read_recording(path, 0, 1, RATE_HZ), ("data[0]", "data[1]"))
    np.save(path, np.vstack((DRIVE, OUTPUT)))
    check(read_recording(path, "data[0]", "data[1]", RATE_HZ), ("data[0]", "data[1]"))
    assert "give the rate" in refusal(path, 0, 1)


@pytest.mark.parametrize(("first", "second"), [("data[0, 2, 1]", "data[0,2,1]"), ("data[0,2 , 1]", "data[0,  2,1]")])
def test_one_channel_by_two_spellings_of_its_index_is_one_channel(tmp_path, first, second):
    np.save(tmp_path / "a.npy", np.stack((DRIVE, OUTPUT), axis=1)[:, :, None, None] * np.ones((1, 1, 3, 2)))
    assert "input and output are both channel 0 ('data[0, 2, 1]')" in refusal(tmp_path / "a.npy", first, second)


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ("b[0, 2]", None),
        ("b[1, 2]", None),
        ("b[2, 2]", "'b[2, 2]' is no channel: 'b' is an array of shape (2, 1000, 3): name one channel of it"),
        ("b[1, 3]", "'b[1, 3]' is no channel"),
        ("b[1]", "'b[1]' is no channel"),
        ("b[1, 2, 0]", "'b[1, 2, 0]' is no channel"),
        ("c[0, 0]", "'c[0, 0]' is no channel: 'c' holds complex numbers, not real numbers"),
        ("d[0, 0]", "no output channel is named 'd[0, 0]'"),
        ("flat[2]", "no output channel is named 'flat[2]'; the nearest is 'flat[1]'"),
    ],
)
def test_an_index_counts_along_each_axis_but_the_samples(tmp_path, wanted, words):
    many = np.stack((DRIVE, OUTPUT))[:, :, None] * np.ones((1, 1, 3))
    flat = np.column_stack((DRIVE, OUTPUT))
    np.savez(tmp_path / "a.npz", a=many, b=many + 1.0, c=many + 1j, flat=flat, fs=RATE_HZ)
    if words is None:
        expected = (DRIVE if wanted == "b[0, 2]" else OUTPUT) + 1.0
        other = "flat[1]" if wanted == "b[0, 2]" else "flat[0]"
        read = read_recording(tmp_path / "a.npz", *((wanted, other) if other == "flat[1]" else (other, wanted)))
        np.testing.assert_array_equal((read.drive if other == "flat[1]" else read.output)[:, 0], expected)
    else:
        assert words in refusal(tmp_path / "a.npz", "flat[0]", wanted)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"fs": 1.0}, "holds no channel of numbers ('fs' is a single number; name an array); record again"),
        ({"c": np.ones((2, 300, 3)) + 1j}, "holds no channel of numbers ('c' holds complex numbers, not real numbers"),
        (
            {"w": np.ones((4, 300))},
            "holds no channel of numbers ('w' is an array of shape (4, 300): at most 3 channels",
        ),
        ({"m": np.ones((2, 300, 3))}, "no input channel is named 'u'; The channels are 'm' is an array of shape (2, 3"),
    ],
)
def test_a_file_without_a_channel_says_what_it_holds(tmp_path, monkeypatch, arrays, words):
    monkeypatch.setattr("microrad.lab.recording.formats.arrays._MOST_COLUMNS", 3)
    np.savez(tmp_path / "a.npz", **arrays)
    assert words in refusal(tmp_path / "a.npz", "u", "y")


def test_as_many_columns_are_listed_as_may_be(tmp_path, monkeypatch):
    monkeypatch.setattr("microrad.lab.recording.formats.arrays._MOST_COLUMNS", 2)
    np.save(tmp_path / "a.npy", np.column_stack((DRIVE, OUTPUT)))
    check(read_recording(tmp_path / "a.npy", 0, 1, RATE_HZ), ("data[0]", "data[1]"))


@pytest.mark.parametrize(("count", "more"), [(20, ""), (21, " and 1 more")])
def test_twenty_channels_are_listed_and_the_others_counted(tmp_path, count, more):
    np.savez(tmp_path / "a.npz", **{f"x{k}": DRIVE + k for k in range(count)})
    for wanted in (count, -1):
        message = refusal(tmp_path / "a.npz", wanted, 1, RATE_HZ)
        assert f"there is no input channel {wanted}: the NumPy file has {count} channels, numbered from 0" in message
        assert f"'x19'{more})" in message
    assert read_recording(tmp_path / "a.npz", count - 1, 0, RATE_HZ).input_names == (f"x{count - 1}",)


@pytest.mark.parametrize(
    ("name", "scale"),
    [("time", 1.0), ("t", 1.0), ("time (ms)", 1e3), ("Time [us]", 1e6), ("t_ms", 1e3), ("Zeit_ns", 1e9), ("sec", 1.0)],
)
def test_the_name_of_a_time_says_its_unit(tmp_path, name, scale):
    np.savez(tmp_path / "a.npz", **{"drive": DRIVE, "output": OUTPUT, name: scale * TIME_S})
    check(read_recording(tmp_path / "a.npz", "drive", "output"))
    np.savez(tmp_path / "a.npz", **{"drive": DRIVE, "output": OUTPUT, name: scale * TIME_S[:-1]})
    assert "give the rate" in refusal(tmp_path / "a.npz", "drive", "output")  # of another length, it is not theirs


def test_a_rate_of_a_dataset_counts_for_it_and_its_columns(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["both"], file["y[1]"], file["plain"] = np.column_stack((DRIVE, OUTPUT)), OUTPUT, OUTPUT
        file["both"].attrs["fs"], file["y[1]"].attrs["dt"] = RATE_HZ, 1 / RATE_HZ
        file["both"].attrs["unit"] = np.bytes_("mV")
    source = open_source(path)
    assert [source.rates([k])[0].words for k in (0, 1, 3)] == ["both/fs = 2000 Hz"] * 2 + ["y[1]/dt = 0.0005 s"]
    assert source.rates([2]) == []
    assert source.units == ("mV", "mV", "", "")
    read = read_recording(path, "both[0]", "y[1]")
    check(read, ("both[0]", "y[1]"))
    with h5py.File(path, "a") as file:
        file.attrs["fs"] = 2 * RATE_HZ  # of the file: for what has none of its own
    assert open_source(path).rates([2])[0].words == "fs = 4000 Hz"
    check(read_recording(path, "both[0]", "both[1]"), ("both[0]", "both[1]"))
    assert "two sample rates" in refusal(path, "both[0]", "plain")


@pytest.mark.parametrize("value", [0.0, -5.0, np.inf, np.nan, 5e-324, [2000.0, 2000.0]])
def test_a_scalar_that_is_no_rate_states_none(value):
    assert stated_rate("fs", value) is None
    assert stated_rate("dt", value) is None


def test_a_scalar_states_a_rate_by_its_name():
    assert stated_rate("run/FS", np.array([[2000.0]])) == StatedRate(2000.0, "run/FS = 2000 Hz")
    assert stated_rate("dt", 0.0005) == StatedRate(2000.0, "dt = 0.0005 s")
    assert stated_rate("gain", 2000.0) is None
    assert stated_rate("fs", "fast") is None


def test_a_fault_without_words_is_told_by_its_kind(tmp_path):
    np.savez(tmp_path / "a.npz", drive=DRIVE)

    def load():
        raise KeyError

    with pytest.raises(RecordingError, match=r"a\.npz: it cannot be read \(KeyError\); the file is damaged"):
        open_source(tmp_path / "a.npz").loaded("it", load)


def test_an_array_may_unpack_to_so_much_and_no_more(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "a.npz", drive=DRIVE, output=OUTPUT)
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_TIMES", 0)
    for most, fits in ((8 * N, True), (8 * N - 1, False)):
        monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_BYTES", most)
        assert (files.too_large(tmp_path / "a.npz", (N,), 8) == "") == fits


@pytest.mark.promise("recordings-6")
def test_many_axes(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.stack((DRIVE, OUTPUT), axis=1)[:, :, None, None] * np.ones((1, 1, 3, 2)))
    check(read_recording(path, "data[0, 2, 1]", "data[1,2,1]", RATE_HZ), ("data[0, 2, 1]", "data[1, 2, 1]"))
    message = refusal(path, 0, 1, RATE_HZ)
    assert "shape (1000, 2, 3, 2)" in message
    assert "read it whole by saying what each axis is: --axes (axes), such as samples,channels" in message
    assert "'data[2, 0, 0]' is no channel" in refusal(path, "data[2, 0, 0]", "data[0, 0, 0]", RATE_HZ)


class Trap:
    def __reduce__(self):
        return (pytest.fail, ("unpickled",))


@pytest.mark.promise("recordings-10")
def test_pickles_are_never_loaded(tmp_path):
    path = tmp_path / "a.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "|O", "fortran_order": False, "shape": (1,)})
    evil = header.getvalue() + pickle.dumps(Trap())
    np.savez(path, drive=DRIVE)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("output.npy", evil)
    assert "'output' holds Python objects" in refusal(path, "drive", "output", RATE_HZ)
    (tmp_path / "a.npy").write_bytes(evil)
    assert "holds Python objects" in refusal(tmp_path / "a.npy", 0, 1, RATE_HZ)


def test_arrays_of_objects_are_not_called_truncated(tmp_path):
    """Their pickle is shorter than an array of as many pointers."""
    path = tmp_path / "a.npz"
    np.savez(path, drive=DRIVE, output=np.full(N, None, dtype=object))
    message = refusal(path, "drive", "output", RATE_HZ)
    assert "'output' holds Python objects, which are pickled and not read" in message
    assert "save them as plain numbers, array.astype(float)" in message
    assert "truncated" not in message
    np.save(tmp_path / "a.npy", np.full(N, None, dtype=object))
    assert "'data' holds Python objects, which are pickled and not read" in refusal(tmp_path / "a.npy", 0, 1, RATE_HZ)


@pytest.mark.promise("recordings-13")
def test_numpy_arrays_that_are_no_channel(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    np.savez_compressed(
        path, drive=DRIVE, output=OUTPUT, big=np.zeros(40_000), table=np.zeros(9, [("t", "f8"), ("y", "f8")])
    )
    check(read_recording(path, "drive", "output", RATE_HZ))
    assert "'table' holds records of t, y; save each of these" in refusal(path, "drive", "table", RATE_HZ)
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_BYTES", 100_000)
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_TIMES", 1)
    message = refusal(path, "drive", "big", RATE_HZ)
    assert "'big' states 40000 samples, 0.32 MB in a file of 0.0" in message
    assert "at most 0.1 MB are unpacked from that; cut out the part that you need" in message
    check(read_recording(path, "drive", "output", RATE_HZ))


@pytest.mark.promise("recordings-26")
def test_truncated_numpy(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.column_stack((DRIVE, OUTPUT)))
    path.write_bytes(path.read_bytes()[:-8])
    assert "needs 16000 bytes and 15992 are there" in refusal(path, 0, 1, RATE_HZ)
    path = tmp_path / "a.npz"
    np.savez(path, drive=DRIVE, output=OUTPUT)
    path.write_bytes(path.read_bytes()[:-50])
    assert "damaged or truncated" in refusal(path, "drive", "output", RATE_HZ)


def npy_header(text, version=(2, 0), length=None):
    packed = struct.pack("<I" if version != (1, 0) else "<H", len(text) if length is None else length)
    return b"\x93NUMPY" + bytes(version) + packed + text


WHOLE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000,), }"


@pytest.mark.parametrize("archive", [False, True])
@pytest.mark.parametrize(
    ("header", "words"),
    [
        (npy_header(WHOLE, length=4_000_000_000), "a header of 4000000000 bytes, where 10000 are enough"),
        (npy_header(WHOLE, version=(0, 0)), "version 0.0 of the format is not known"),
        (npy_header(WHOLE.replace(b"(1000,)", b"(True,)")), "the shape (True,) is none"),
        (npy_header(WHOLE.replace(b"(1000,)", b"(-1000,)")), "the shape (-1000,) is none"),
    ],
    ids=itertools.count(),
)
def test_headers_of_numpy_that_are_none(tmp_path, archive, header, words):
    """1239 bytes of an archive made 4.4 GB: the length of a header was read, and all of it, before it was judged."""
    path = tmp_path / ("a.npz" if archive else "a.npy")
    content = header + DRIVE.tobytes()
    if archive:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("drive.npy", content)
    else:
        path.write_bytes(content)
    assert words in refusal(path, 0, 0)


@pytest.mark.parametrize(("length", "read"), [(10_000, True), (10_001, False)])
def test_a_header_of_numpy_has_so_many_bytes_and_no_more(tmp_path, length, read):
    (tmp_path / "a.npy").write_bytes(npy_header(WHOLE.ljust(length - 1) + b"\n") + DRIVE.tobytes())
    if read:
        assert open_source(tmp_path / "a.npy").samples() == (N,)
    else:
        assert "a header of 10001 bytes, where 10000 are enough for any array" in refusal(tmp_path / "a.npy", 0, 0)


def test_an_array_of_an_archive_that_is_cut_off_is_named(tmp_path):
    np.savez(tmp_path / "a.npz", drive=DRIVE, none=np.zeros(0), fs=RATE_HZ)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("output.npy", npy_header(WHOLE) + OUTPUT.tobytes()[: 8 * N - 800])
        archive.writestr("notes.txt", "by hand")
    for name, words in (
        ("output", "is truncated, an array of shape (1000,) does not fit into "),
        ("none", "holds no samples; record again, or name another"),
        ("notes.txt", "is no NumPy array; name another, or add it with numpy.savez"),
    ):
        assert f"the output '{name}' is no channel: '{name}' {words}" in refusal(tmp_path / "a.npz", "drive", name)


@pytest.mark.promise("recordings-26")
def test_nan_in_an_array(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, drive=DRIVE, output=np.where(np.arange(N) == 77, np.nan, OUTPUT))
    message = refusal(path, "drive", "output", RATE_HZ)
    assert "sample 77 of the output, channel 1 ('output') is nan, 1 such sample" in message


# ---------------------------------------------------------------------------------------------------------------- HDF5
def hdf5(path):
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        group["drive"], group["output"], group["words"] = DRIVE, OUTPUT[:, None], "hello"
        group["drive"].attrs["units"] = "V"
        group.attrs["fs"] = RATE_HZ
        file["other/output"] = OUTPUT
    return path


@pytest.mark.promise("recordings-4", "recordings-5", "recordings-14")
@pytest.mark.promise("readme-9")
def test_hdf5(tmp_path):
    path = hdf5(tmp_path / "a.h5")
    read = read_recording(path, "drive", "run/output")
    check(read, ("run/drive", "run/output"))
    assert (read.input_units, read.output_units) == (("V",), ("",))
    assert "'output' may be 'other/output', 'run/output'" in refusal(path, "drive", "output")
    assert "'run/words' holds text" in refusal(path, "words", "run/output")
    assert "there is no input channel 9: the HDF5 file has 3 channels" in refusal(path, 9, 0)


@pytest.mark.promise("recordings-26")
def test_truncated_hdf5(tmp_path):
    path = hdf5(tmp_path / "a.h5")
    path.write_bytes(path.read_bytes()[:3000])
    assert "damaged or truncated" in refusal(path, 0, 1)


@pytest.fixture(scope="module")
def odd_hdf5(tmp_path_factory):
    """A recording among datasets that are none, some of whose values stand in other files."""
    folder = tmp_path_factory.mktemp("hdf5")
    with h5py.File(folder / "other.h5", "w") as other:
        other["x"] = np.arange(400.0)
    (folder / "values.bin").write_bytes(np.arange(400.0).tobytes())
    layout = h5py.VirtualLayout(shape=(400,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "x", shape=(400,))
    with h5py.File(hdf5(folder / "a.h5"), "a") as file:
        group = file.create_group("odd")
        group.create_dataset("external", (400,), "f8", external=[(str(folder / "values.bin"), 0, 3200)])
        group.create_virtual_dataset("virtual", layout)
        group["link"] = h5py.ExternalLink(str(folder / "other.h5"), "x")
        group["references"] = np.array([file["run/drive"].ref] * 9, dtype=h5py.ref_dtype)
        group.create_dataset("rows", (9,), h5py.vlen_dtype("f8"))
        group["records"] = np.zeros(9, dtype=[("t", "f8"), ("y", "f8")])
        group["complex"], group["flags"], group["none"] = DRIVE + 1j, DRIVE > 6, h5py.Empty("f8")
        group["empty"] = np.zeros((0, 3))
        h5py.h5d.create(group.id, b"times", h5py.h5t.UNIX_D32LE, h5py.h5s.create_simple((9,)))
        group.create_dataset("foreign", (9,), "f8", chunks=(9,), compression=32015, allow_unknown_filter=True)
        twice = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        twice.set_chunk((9,))
        twice.set_deflate(1)
        twice.set_deflate(1)
        h5py.h5d.create(group.id, b"twice", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((9,)), twice)
        group.create_dataset("huge", (10**12,), "f8", chunks=(1024,))
        group.create_dataset("pieces", (9,), "f8", maxshape=(None,), chunks=(10**8,), compression="gzip")
        group["drive"] = DRIVE
        h5py.h5a.create(group["drive"].id, b"units", h5py.h5t.UNIX_D32LE, h5py.h5s.create(h5py.h5s.SCALAR))
    return folder / "a.h5"


@pytest.mark.promise("recordings-12")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("external", "takes its values from other files, and no other file is opened; copy the values into this one"),
        ("virtual", "takes its values from other files, and no other file is opened; copy the values into this one"),
        ("link", "is a link into another file, and no other file is opened; copy the values into this one"),
        ("references", "holds references to other data (cells, or an array of structures, in MATLAB); save these as"),
        ("rows", "holds rows of different lengths; save each as an array"),
        ("records", "holds records of t, y; save each of these as an array"),
        ("complex", "holds complex numbers, not real numbers; save the real signal"),
        ("flags", "holds booleans, not real numbers; save numbers"),
        ("none", "holds no samples; record again"),
        ("empty", "holds no samples; record again"),
        ("times", "has a type that is not read (No NumPy equivalent for TypeTimeID exists); save it as floating-point"),
        (
            "foreign",
            "is packed by the filter 32015, which is none of HDF5's own; pack it with gzip or not at all (h5re",
        ),
        ("twice", "is packed twice over; pack it with gzip"),
        ("huge", "states 1000000000000 samples, 8000000 MB in a file of 0.0"),
        ("pieces", "is stored in pieces, each of which states 100000000 samples, 800 MB in a file of"),
    ],
)
def test_datasets_that_are_no_channel(odd_hdf5, name, words):
    assert f"the output 'odd/{name}' is no channel: 'odd/{name}' {words}" in refusal(odd_hdf5, 0, f"odd/{name}")


def test_the_other_datasets_are_read(odd_hdf5):
    """The rest of the file is as good as without them."""
    check(read_recording(odd_hdf5, "run/drive", "run/output"), ("run/drive", "run/output"))
    check(read_recording(odd_hdf5, "odd/drive", "run/output", RATE_HZ), ("odd/drive", "run/output"))


PIECE = bytes(range(250)) * 16  # 4000 bytes, a half of a channel


def masked(file, data, mask):
    """A channel's second half written as it is, with filters left out."""
    file["drive"].id.write_direct_chunk((N // 2,), data, filter_mask=mask)


@pytest.mark.parametrize(
    ("packing", "mask", "data", "amount"),
    [
        ({"compression": "gzip", "shuffle": True}, 0, zlib.compress(bytes(2_000_000)), "more"),
        ({"compression": "gzip"}, 0, zlib.compress(PIECE[:10]), "less"),
        ({"compression": "gzip"}, 0, zlib.compress(PIECE)[:-9], "less"),  # cut off
        ({"compression": "gzip"}, 0, zlib.compress(PIECE)[:-1], "less"),  # within its checksum
        ({"compression": "lzf"}, 0, b"\x00a\xe0", "less"),  # cut off within a copy
        ({"compression": "lzf"}, 0, b"\x00a\x20", "less"),
        ({"compression": "lzf"}, 0, b"\x00a" + b"\xe0\xff\x00" * 15 + b"\xe0\x1e", "less"),  # behind its last length
        ({"compression": "gzip"}, 0, b"no stream", "less"),
        ({"compression": "gzip", "shuffle": True}, 0b10, PIECE[:10], "less"),  # not packed, by the mask
        ({"compression": "gzip", "fletcher32": True}, 0b11, PIECE[:3999], "less"),
        ({"fletcher32": True}, 0, PIECE[:100], "less"),
        ({"compression": "lzf"}, 0, b"\x04abcde", "less"),
        ({"compression": "lzf"}, 0, b"\x00a" + b"\xe0\xff\x00" * 100, "more"),
        ({"compression": "lzf"}, 0, b"\x00a\x20\x05" + b"\xe0\xff\x00" * 15, "less"),  # copies from before its begin
        ({"compression": "lzf"}, 1, PIECE[:100], "less"),
    ],
    ids=itertools.count(),
)
@pytest.mark.parametrize("kind", ["hdf5", "matlab73"])
def test_a_piece_that_does_not_unpack_to_what_it_states(tmp_path, kind, packing, mask, data, amount):
    """The library itself would make room for what is more, and read on in the memory where it is less."""
    path = tmp_path / ("a.h5" if kind == "hdf5" else "a.mat")
    if kind == "matlab73":
        matlab73(path, other=DRIVE)
    with h5py.File(path, "a") as file:
        for name, values in (("drive", DRIVE), ("output", OUTPUT)):
            made = file.create_dataset(name, data=values, chunks=(N // 2,), **packing)
            if kind == "matlab73":
                made.attrs["MATLAB_class"] = np.bytes_("double")
        masked(file, data, mask)
    message = refusal(path, "drive", "output", RATE_HZ)
    assert (
        f"'drive' has a piece, from sample (500,) on, that unpacks to {amount} than the 4000 bytes that it" in message
    )
    with h5py.File(path, "a") as file:
        file["drive"][:] = DRIVE
    check(read_recording(path, "drive", "output", RATE_HZ))


def with_texts(path, length_bytes=8):
    """A file with units as texts of various lengths, in a heap; returns its bytes, and where its entries begin."""
    made = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    made.set_sizes(8, length_bytes)
    with h5py.File(h5py.h5f.create(str(path).encode(), fcpl=made)) as file:
        for name, values, unit in (("drive", DRIVE, "V"), ("output", OUTPUT, "mrad")):
            file.create_dataset(name, data=values).attrs["unit"] = unit
    content = path.read_bytes()
    return content, content.index(b"GCOL\x01") + 16


@pytest.mark.parametrize(
    ("entry", "size", "refused"),
    [
        (2, lambda file: 0, True),  # the free space, in which the library would stay for ever
        (0, lambda file: 2**64 - 16, True),  # with its header no byte
        (0, lambda file: 2**64 - 1, True),
        (1, lambda file: file - 15, True),  # with its header a byte more than there is
        (1, lambda file: file - 16, False),
    ],
)
def test_a_heap_without_an_end_is_refused_and_not_looked_through_for_ever(tmp_path, entry, size, refused):
    path = tmp_path / "a.h5"
    content, begin = with_texts(path)
    assert read_recording(path, "drive", "output", RATE_HZ).input_units == ("V",)
    place = begin + 24 * entry + 8  # each of the two texts takes a header of 16 bytes and 8
    path.write_bytes(content[:place] + struct.pack("<Q", size(len(content))) + content[place + 8 :])
    if not refused:
        check_heaps(path, 8)
        return
    message = refusal(path, "drive", "output", RATE_HZ)
    assert message.endswith(
        f"a store of texts in it, at byte {begin - 16}, has no end; the file is damaged, or made to do harm: copy it "
        "again from its source."
    )


def test_each_heap_that_the_library_leaves_has_an_end(tmp_path):
    """Texts of all lengths come and go, in several sessions: heaps are full, half empty, grown and given up."""
    path, draw, heaps = tmp_path / "a.h5", random.Random(5), 0
    for _ in range(40):
        with h5py.File(path, "a") as file:
            for _ in range(20):
                name, text = f"d{draw.randrange(9)}", "µV" * draw.choice((0, 1, 3, 50, 1000, 5000))
                if name not in file:
                    file.create_dataset(name, data=[text] * draw.randrange(1, 9), dtype=h5py.string_dtype())
                elif draw.random() < 0.5:
                    file[name].attrs[f"a{draw.randrange(4)}"] = text
                else:
                    del file[name]
        check_heaps(path, 8)
        heaps += path.read_bytes().count(b"GCOL\x01")
    assert heaps > 300


@pytest.mark.parametrize("length_bytes", [4, 8])
def test_each_heap_of_a_file_is_looked_at_with_the_lengths_that_its_head_states(tmp_path, length_bytes):
    path = tmp_path / "a.h5"
    content, begin = with_texts(path, length_bytes)
    assert read_recording(path, "drive", "output", RATE_HZ).output_units == ("mrad",)
    heap = content[begin - 16 : begin + 48]
    path.write_bytes(content + heap + bytes(16))  # a second one, whose free space is empty
    at = len(content) + 8
    changed = path.read_bytes()
    path.write_bytes(changed[:at] + (80).to_bytes(length_bytes, "little") + changed[at + length_bytes :])
    with pytest.raises(RecordingError, match=f"at byte {len(content)}, has no end"):
        check_heaps(path, length_bytes)


@pytest.mark.parametrize(
    "packing",
    [
        {"compression": "gzip", "shuffle": True, "fletcher32": True},
        {"compression": "lzf", "shuffle": True},
        {"compression": "lzf", "fletcher32": True},
        {"fletcher32": True},
        {},
    ],
)
def test_whole_pieces_are_read_however_they_are_packed(tmp_path, packing):
    path = tmp_path / "a.h5"
    still = np.round(OUTPUT, 3)
    with h5py.File(path, "w") as file:
        for name, values in (("drive", DRIVE), ("output", OUTPUT), ("still", np.zeros(N)), ("steps", still)):
            file.create_dataset(name, data=values, chunks=(300,), **packing)  # the last piece is filled up
    check(read_recording(path, "drive", "output", RATE_HZ))
    np.testing.assert_array_equal(read_recording(path, "drive", "steps", RATE_HZ).output[:, 0], still)


def test_groups_nested_too_deep(tmp_path):
    """1200 of them took the library two minutes."""
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file["d/" * 49 + "d"] = DRIVE
    check(read_recording(path, "run/drive", "run/output"), ("run/drive", "run/output"))
    with h5py.File(path, "a") as file:
        file.create_group("e/" * 59 + "e")
    assert "groups are nested more than 50 deep" in refusal(path, "run/drive", "run/output")


def test_a_step_that_is_no_rate(tmp_path):
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        del file["run"].attrs["fs"]
        file["run"].attrs["dt"] = 5e-324
    assert "give the rate" in refusal(path, "run/drive", "run/output")


def test_a_filter_whose_pieces_cannot_be_checked(tmp_path):
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file.create_dataset("packed", data=np.arange(N), chunks=(N // 2,), scaleoffset=0)
    assert "is packed by the filter 6 (scaleoffset), whose pieces cannot be checked; pack it with gzip" in refusal(
        path, 0, "packed"
    )


@pytest.mark.promise("recordings-11")
def test_matlab_v73_variables_that_are_no_channel(tmp_path):
    path = matlab73(tmp_path / "a.mat", drive=DRIVE, output=OUTPUT, table=DRIVE, cell=DRIVE, word=DRIVE, flag=DRIVE)
    with h5py.File(path, "a") as file:
        for name, kind in (("drive", "double"), ("table", "timetable"), ("cell", "cell"), ("word", "char")):
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file["flag"].attrs["MATLAB_empty"] = 1
        file["complex"] = np.zeros((1, N), dtype=[("real", "f8"), ("imag", "f8")])
        file["sparse/data"] = np.arange(9.0)
        file["sparse"].attrs["MATLAB_sparse"] = 9
        file["#refs#/a"] = DRIVE
        for name, attributes in (
            ("said", {"MATLAB_class": "cell"}),  # text of another kind of string
            ("logical", {"MATLAB_class": np.bytes_("logical")}),
            ("decoded", {"MATLAB_int_decode": 1}),
            ("number", {"MATLAB_class": np.bytes_("uint8"), "MATLAB_int_decode": 1}),
        ):
            file[name] = (DRIVE > 6).astype(np.uint8)[None]
            file[name].attrs.update(attributes)
        file["wide"] = DRIVE[None]
        file["wide"].attrs["MATLAB_class"] = np.bytes_("logical")
    check(read_recording(path, "drive", "output", RATE_HZ))
    assert open_source(path).names == ("drive", "number", "output", "wide")
    for name, words in (
        ("table", "is an object of MATLAB, which only MATLAB reads; save its numbers as arrays"),
        ("cell", "holds cells; save the numbers of each cell as an array"),
        ("word", "holds text, not real numbers; save numbers"),
        ("flag", "holds no samples"),
        ("complex", "holds complex numbers, not real numbers; save the real signal"),
        ("sparse/data", "is part of a sparse matrix; save it as full"),
        ("said", "holds cells; save the numbers of each cell as an array"),
        ("logical", "holds booleans, not real numbers; save numbers"),
        ("decoded", "holds booleans, not real numbers; save numbers"),
    ):
        assert f"the output '{name}' is no channel: '{name}' {words}" in refusal(path, "drive", name, RATE_HZ)


@pytest.mark.promise("recordings-4")
@pytest.mark.parametrize("suffix", ["h5", "hdf5", "hdf"])
def test_suffixes_of_hdf5_and_a_rate_in_a_dataset(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    with h5py.File(path, "w") as file:
        file["run/drive"], file["run/output"], file["run/dt"] = DRIVE, OUTPUT, 1 / RATE_HZ
    check(read_recording(path, "drive", "output"), ("run/drive", "run/output"))


RATE_NAMES = ("fs", "sample_rate", "sampling_rate", "rate_hz", "dt", "ts", "sample_time", "sampling_period")


@pytest.mark.promise("recordings-7")
@pytest.mark.parametrize("name", RATE_NAMES)
def test_names_that_state_a_rate_count_for_their_group(tmp_path, name):
    value = RATE_HZ if name in RATE_NAMES[:4] else 1 / RATE_HZ
    np.savez(tmp_path / "a.npz", drive=DRIVE, output=OUTPUT, **{name: value})
    check(read_recording(tmp_path / "a.npz", "drive", "output"))
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        del file["run"].attrs["fs"]
        file["run"].attrs[name], file["other/drive"] = value, DRIVE
    check(read_recording(path, "run/drive", "run/output"), ("run/drive", "run/output"))
    assert "give the rate" in refusal(path, "other/drive", "other/output")


@pytest.mark.promise("recordings-30")
def test_a_part_of_a_file_is_checked_alone_and_named(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, drive=DRIVE, output=np.where(np.arange(N) < 600, OUTPUT, np.nan), fs=RATE_HZ)
    assert "is nan, 400 such samples" in refusal(path, "drive", "output")
    read = read_recording(path, "drive", "output", part_s=(0.05, 0.3))
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE[100:600])
    assert read.path == f"{path} from 0.05 s to 0.3 s"
    assert read.sha256 == digest_of(read.drive, read.output)
    assert "is nan" in refusal(path, "drive", "output", part_s=(0.05, None))


@pytest.mark.promise("recordings-13")
def test_a_small_file_may_unpack_to_so_much(tmp_path):
    path = tmp_path / "a.npz"
    for size, most in ((1_000, 256e6), (12_000_000, 256e6), (20_000_000, 400e6), (150_000_000, 2e9)):
        with path.open("wb") as file:
            file.truncate(size)
        assert files.most_unpacked(path) == most


@pytest.mark.promise("recordings-8", "recordings-14")
def test_a_row_of_units_says_what_the_time_is_in(tmp_path):
    rows = "".join(f"{1e3 * t:.3f},{u:.9f},{y:.9f}\n" for t, u, y in zip(TIME_S, DRIVE, OUTPUT, strict=True))
    (tmp_path / "a.csv").write_text(f"time,drive,output\nms,V,mrad\n{rows}")
    read = read_recording(tmp_path / "a.csv", "drive", "output")
    assert read.rate_hz == pytest.approx(RATE_HZ)
    assert (read.input_units, read.output_units) == (("V",), ("mrad",))
    assert read_in(read, "V", "mrad") is read
    with pytest.raises(RecordingError, match="the output is to be read in urad and the file says mrad"):
        read_in(read, "V", "urad")
    np.testing.assert_allclose(read.drive[:, 0], DRIVE, atol=1e-8)


# ----------------------------------------------------------------------------------------------------- several channels
@pytest.mark.promise("recordings-5")
def test_several_channels(tmp_path):
    rng = np.random.Generator(np.random.Philox(3))
    u = rng.standard_normal((N, 2))
    y = u @ np.array([[1.0, 0.2, 0.1], [0.1, 0.8, 0.3]]) + 0.01 * rng.standard_normal((N, 3))
    path = tmp_path / "a.npz"
    np.savez(path, u=u, y=y, fs=RATE_HZ)
    read = read_recording(path, ["u[0]", "u[1]"], (2, 3, 4), period_samples=500)
    np.testing.assert_array_equal(read.drive, u)
    np.testing.assert_array_equal(read.output, y)
    assert (read.output_names, read.period_samples) == (("y[0]", "y[1]", "y[2]"), 500)
    assert "is given twice as input" in refusal(path, [0, 0], 2)
    assert "no output channel was given" in refusal(path, 0, [])
    assert "there is no input channel True" in refusal(path, True, 2)
    for period in (1, N + 1, 2.5, True):
        assert "period" in refusal(path, 0, 2, period_samples=period)


@pytest.mark.promise("recordings-26")
def test_copies_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, a=DRIVE, b=3 - 2 * DRIVE, y=OUTPUT, fs=RATE_HZ)
    message = refusal(path, ["a", "b"], "y")
    assert "the input, channel 1 ('b') is a copy of the input, channel 0 ('a')" in message
    assert "drive the inputs independently" in message


@pytest.mark.promise("recordings-17")
def test_multisine_recordings():
    rng = np.random.Generator(np.random.Philox(4))
    u = np.repeat(rng.standard_normal((512, 2, 3, 1)), 2, axis=3)
    y = u[:, ::-1] + 0.3 * u
    read = multisine_recordings(u, y, RATE_HZ, "bench")
    assert [r.path for r in read] == ["bench realisation 0", "bench realisation 1", "bench realisation 2"]
    assert all((r.drive.shape, r.period_samples) == ((1024, 2), 512) for r in read)
    np.testing.assert_array_equal(read[1].output[512:], y[:, :, 1, 1])
    with pytest.raises(RecordingError, match="the same samples, realisations and periods"):
        multisine_recordings(u, y[:, :, :2], RATE_HZ)
    for drive, output in ((u[..., 0], y), (u, y[..., 0]), (u[..., 0], y[..., 0])):
        with pytest.raises(RecordingError, match=r"\(512, 2, 3\).*give \(samples, channels, realisations, periods\)"):
            multisine_recordings(drive, output, RATE_HZ)


def test_the_last_comment_of_as_many_words_names_the_columns(tmp_path):
    rows = "".join(f"{k / 1000} {k % 7} {0.1 * (k % 7)}\n" for k in range(40))
    path = tmp_path / "named.txt"
    path.write_text(f"# made by hand today\n# first second third\n# time drive angle\n{rows}", "utf-8")
    assert tuple(name.strip() for name in open_source(path).names) == ("time", "drive", "angle")


def test_an_lvm_channel_has_the_time_column_before_itself(tmp_path):
    path = lvm(tmp_path / "a.lvm", x_columns="Multi")
    head, heading, body = path.read_bytes().decode("latin-1").rpartition("output\r\n")
    head = head.replace("Delta_X\t5.0E-4\t5.0E-4", "Delta_X\t5.0E-4\t1.0E-3")
    rows = [line.split("\t") for line in body.split("\r\n") if line]
    slower = [f"{t}\t{u}\t{2.0 * float(t):.6f}\t{y}\r\n" for t, u, _, y in rows]
    path.write_bytes("".join([head, heading, *slower]).encode("latin-1"))
    source = LvmSource(path)
    assert source.names[1::2] == ("drive", "output")
    assert [source.find_time([channel]) for channel in (1, 3)] == [0, 2]


def test_a_sample_of_a_part_is_counted_in_the_file(tmp_path):
    np.savez(tmp_path / "a.npz", drive=DRIVE, output=np.where(np.arange(N) != 600, OUTPUT, np.nan), fs=RATE_HZ)
    whole, later, last = (
        refusal(tmp_path / "a.npz", "drive", "output", part_s=part_s).partition(": ")[2]
        for part_s in ((0.0, None), (0.05, None), (0.299, 0.49))
    )
    assert whole == later == last
    assert "600" in whole or "601" in whole


@pytest.mark.parametrize(
    ("x_columns", "segments", "gap_s", "used", "own"),
    [
        ("One", 1, 0.0, "drive", "X_Value"),
        ("One", 3, 0.0, "drive", None),  # joined: the segments' own times begin anew
        ("One", 3, 0.1, "2/drive", "2/X_Value"),
        ("No", 1, 0.0, "drive", None),
    ],
)
def test_an_lvm_channel_has_the_time_of_its_own_segment(tmp_path, x_columns, segments, gap_s, used, own):
    source = LvmSource(lvm(tmp_path / "a.lvm", x_columns=x_columns, segments=segments, gap_s=gap_s))
    assert source.find_time([]) is None
    found = source.find_time([source.names.index(used)])
    assert (None if found is None else source.names[found]) == own


def test_a_text_whose_head_ends_within_a_character_is_utf_8():
    path, most = Path("a.csv"), text_format._HEAD_BYTES
    whole = b"drive,angle\n" + b"1," * (most // 2)
    for cut in (1, 2, 3):  # bytes of a character of four
        head = whole[: most - cut] + "\U0001f642".encode()[:cut]
        assert (len(head), text_format._encoding(path, head)) == (most, "utf-8-sig")
    assert text_format._encoding(path, "µrad".encode("latin-1") + whole[: most - 4]) == "latin-1"
    assert text_format._encoding(path, "µrad".encode()) == "utf-8-sig"
    assert text_format._encoding(path, "1 µ".encode()[:-1]) == "latin-1"  # a whole file that ends so is none


def test_a_sample_of_a_text_stands_on_its_line_behind_blank_lines_and_remarks(tmp_path):
    rows = [f"{k},{k + 1}" for k in range(6)]
    lines = ["# made today", "", "drive,angle", rows[0], "", "# a remark", "  % another", rows[1], "   ", *rows[2:]]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n\n# the end\n", "utf-8")
    source = open_source(tmp_path / "a.csv")
    assert [source.place(row) for row in range(7)] == [f"line {k}" for k in (4, 8, 10, 11, 12, 13)] + ["the end"]


def test_a_text_of_a_message_is_cut_behind_so_many_characters():
    assert text_format.short(f"  {'a' * 40} ") == "a" * 40
    assert text_format.short("a" * 41) == "a" * 39 + "…"
    assert text_format.short("abc", 3) == "abc" and text_format.short("abcd", 3) == "ab…"


@pytest.mark.parametrize(
    ("size", "reason"),
    [(9, "holds only blank lines and comments"), (10, "holds only blank"), (11, "has no line break in its first")],
)
def test_a_text_that_is_as_long_as_its_head_is_whole(tmp_path, monkeypatch, size, reason):
    monkeypatch.setattr(text_format, "_HEAD_BYTES", 10)
    (tmp_path / "a.csv").write_bytes(b"#".ljust(size, b"a"))
    assert reason in refusal(tmp_path / "a.csv", 0, 1)


# -------------------------------------------------------------------------------- five channels, each unlike the others
FIVE = {
    "u a": 5 * np.sin(2 * np.pi * 31 * TIME_S),
    "u b": 2 + 3 * np.cos(2 * np.pi * 47 * TIME_S),
    "x": 0.4 * np.sin(2 * np.pi * 31 * TIME_S - 0.1),
    "y": 7 + 0.6 * np.cos(2 * np.pi * 47 * TIME_S - 0.2),
    "z": 0.1 * np.sin(2 * np.pi * 31 * TIME_S - 0.3) + 0.2 * np.cos(2 * np.pi * 47 * TIME_S - 0.1),
}
FIVE_UNITS = ("V", "mV", "um", "urad", "nm")


def five_csv(path):
    lines = ["% taken by hand", "time," + ",".join(FIVE), "ms," + ",".join(FIVE_UNITS), "", "# remark"]
    lines += [",".join(map(repr, row)) for row in np.column_stack([1e3 * TIME_S, *FIVE.values()]).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def five_tdms(path):
    with TdmsWriter(path) as file:
        for (name, values), unit in zip(FIVE.items(), FIVE_UNITS, strict=True):
            known = {"wf_increment": 1 / RATE_HZ, "unit_string": unit}
            file.write_segment([ChannelObject("g", name, values, known)])


def five_lvm(path):
    head = ["LabVIEW Measurement", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tOne", "***End_of_Header***"]
    head += ["", "Channels\t5", "Y_Unit_Label\t" + "\t".join(FIVE_UNITS), "Delta_X" + "\t5.0E-4" * 5]
    head += ["***End_of_Header***", "X_Value\t" + "\t".join(FIVE)]
    rows = ["\t".join(map(repr, row)) for row in np.column_stack([TIME_S, *FIVE.values()]).tolist()]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="latin-1")


def five_hdf5(path):
    with h5py.File(path, "w") as file:
        for (name, values), unit in zip(FIVE.items(), FIVE_UNITS, strict=True):
            file[f"g/{name}"] = values
            file[f"g/{name}"].attrs["unit"] = np.bytes_(unit)
        file["g"].attrs["dt"] = 1 / RATE_HZ


def five_npz(path):
    np.savez(path, **FIVE, sampling_time=1 / RATE_HZ)


def five_mat(path):
    savemat(path, {"g": {**{name.replace(" ", ""): values for name, values in FIVE.items()}, "Fs": RATE_HZ}})


@pytest.mark.parametrize(
    ("name", "write", "group", "units"),
    [
        ("a.csv", five_csv, "", FIVE_UNITS),
        ("a.tdms", five_tdms, "g/", FIVE_UNITS),
        ("a.lvm", five_lvm, "", FIVE_UNITS),
        ("a.h5", five_hdf5, "g/", FIVE_UNITS),
        ("a.npz", five_npz, "", ("",) * 5),
        ("a.mat", five_mat, "g/", ("",) * 5),
    ],
)
def test_a_part_with_periods_of_channels_in_another_order_has_all_that_is_its_own(tmp_path, name, write, group, units):
    path = tmp_path / name
    write(path)
    names = [group + (each.replace(" ", "") if name.endswith(".mat") else each) for each in FIVE]
    read = read_recording(
        path,
        (names[1], names[0]),
        (names[4], names[2].rsplit("/", 1)[-1], names[3]),
        RATE_HZ * 1.0004,
        period_samples=80,
        part_s=(0.0503, 0.31),
        accept=("drift",),
    )
    values = list(FIVE.values())
    np.testing.assert_allclose(read.drive, np.column_stack([values[1], values[0]])[101:620], atol=1e-12)
    np.testing.assert_allclose(read.output, np.column_stack([values[4], values[2], values[3]])[101:620], atol=1e-12)
    assert read.path == f"{path} from 0.0503 s to 0.31 s"
    assert read.sha256 == digest_of(read.drive, read.output)
    assert (read.rate_hz, read.period_samples) == (RATE_HZ * 1.0004, 80)
    assert (read.input_names, read.output_names) == ((names[1], names[0]), (names[4], names[2], names[3]))
    assert (read.input_units, read.output_units) == ((units[1], units[0]), (units[4], units[2], units[3]))
    assert (read.samples, read.step_s, read.role) == (519, 1 / (RATE_HZ * 1.0004), "")
    assert {f.channel.split(", ")[0] for f in read.findings if f.kind == "unexcited"} == {"the input"}
    assert not (read.drive.flags.writeable or read.output.flags.writeable)


@pytest.mark.parametrize(
    ("name", "write", "numbers", "words"),
    [
        (
            "a.csv",
            five_csv,
            (1, 2, 8),
            "there is no output column 8: the file has 6 columns, numbered from 0 to 5 (comma between them).",
        ),
        (
            "a.csv",
            five_csv,
            ("u a", "u b", "zz"),
            "no output column is named 'zz'; the nearest is 'z'. The columns are 'time', 'u a', 'u b', 'x', 'y', 'z'; "
            "a number counted from 0 does as well.",
        ),
        (
            "a.tdms",
            five_tdms,
            (0, 1, -1),
            "there is no output channel -1: the TDMS file has 5 channels, numbered from 0 ('g/u a', 'g/u b', 'g/x', "
            "'g/y', 'g/z').",
        ),
        (
            "a.h5",
            five_hdf5,
            ("u a", "u b", "g/X"),
            "no output channel is named 'g/X'; the nearest is 'g/x'. The channels are 'g/u a', 'g/u b', 'g/x', 'g/y', "
            "'g/z'; a number counted from 0 does as well.",
        ),
        (
            "a.npz",
            five_npz,
            ("u a", "u b", "sampling_time"),
            "the output 'sampling_time' is no channel: 'sampling_time' is a single number; name an array.",
        ),
        (
            "a.csv",
            five_csv,
            ("u a", "u b", "u b"),
            "input and output are both column 2 ('u b'), so there is nothing to identify; give the drive as input and "
            "the sensor as output.",
        ),
        ("a.lvm", five_lvm, (1, "u a", "x"), "channel 1 ('u a') is given twice as input; name it once."),
    ],
)
def test_a_channel_that_is_none_is_told_with_those_that_are(tmp_path, name, write, numbers, words):
    path = tmp_path / name
    write(path)
    assert refusal(path, numbers[:2], numbers[2]) == f"{path}: {words}"


def test_a_sample_of_a_part_stands_where_it_stands_in_the_whole_file(tmp_path):
    for name, write, place in (
        ("a.npz", five_npz, "sample 311"),
        ("a.csv", five_csv, None),
        ("a.lvm", five_lvm, None),
    ):
        path = tmp_path / name
        kept = FIVE["y"].copy()
        FIVE["y"][311] = 1e40
        try:
            write(path)
        finally:
            FIVE["y"][:] = kept
        lines = path.read_bytes().split(b"\n")
        row = place or f"line {next(k for k, line in enumerate(lines, 1) if b'e+40' in line)}"
        message = refusal(path, "u a", ("x", "y"), RATE_HZ, part_s=(0.1, None))
        index = {"a.npz": "channel 3", "a.csv": "column 4", "a.lvm": "channel 4"}[name]
        assert message.startswith(
            f"{path} from 0.1 s: {row} of the output, {index} ('y') is 1e+40, its largest sample, and no converter"
        )
        assert read_recording(path, "u a", "x", part_s=(0.2, 0.4)).samples == 400


@pytest.mark.parametrize(
    ("part_s", "words"),
    [
        ((0.3, 0.2), "from 0.3 s to 0.2 s is no part of a recording of 0.5 s"),
        ((0.3, 0.3), "from 0.3 s to 0.3 s is no part of a recording of 0.5 s"),
        ((-0.1, 0.3), "from -0.1 s to 0.3 s is no part of a recording of 0.5 s"),
        ((0.1, 0.6), "from 0.1 s to 0.6 s is no part of a recording of 0.5 s"),
        ((0.7, None), "from 0.7 s to the end is no part of a recording of 0.5 s"),
    ],
)
def test_times_that_are_no_part_are_told_in_all_words(tmp_path, part_s, words):
    five_npz(tmp_path / "a.npz")
    message = refusal(tmp_path / "a.npz", "u a", "x", part_s=part_s)
    assert message == f"{tmp_path / 'a.npz'}: {words}; give two times within it, the earlier one first."


def test_a_time_in_an_unknown_unit_or_that_is_a_signal_is_refused_in_all_words(tmp_path):
    path = tmp_path / "a.csv"
    five_csv(path)
    assert refusal(path, "u a", "x", time="x") == (
        f"{path}: column 3 ('x') is the time and a signal; name another one."
    )
    assert refusal(path, "u a", "x", time="y") == (
        f"{path}: column 4 ('y'): the time is in 'urad'; convert it to one of s, sec, seconds, ms, us, µs, μs, ns, or "
        "name no time column and give the rate."
    )


@pytest.mark.parametrize(
    ("name", "unit", "found"),
    [
        ("t_ms", "", "ms"),
        ("t_start_us", "", "us"),
        ("t_ms", "ns", "ns"),
        ("time (us)", "", "us"),
        ("time_ms [s]", "", "s"),
        ("time_stamp", "", "s"),
        ("T_MS", "", "ms"),
        ("run_ms/t", "", "s"),
        ("t [min]", "", "min"),
    ],
)
def test_the_unit_of_a_time_is_that_stated_else_in_brackets_else_behind_a_line(name, unit, found):
    assert time_unit(name, unit) == found


@pytest.mark.parametrize(
    ("name", "is_time"),
    [
        ("t", True),
        ("T", False),
        ("Time", True),
        ("ZEIT_ms", True),
        ("time stamp", False),
        ("TimeStamp_ns", True),
        ("sec [s]", True),
        ("a/b/temps", True),
        ("time/u", False),
        (" x_value ", True),
        ("timesteps", False),
        ("t_us (us)", True),
        ("runtime", False),
    ],
)
def test_a_name_that_means_time_is_told_from_one_that_holds_it(name, is_time):
    assert is_time_name(name) is is_time


@pytest.mark.parametrize(
    ("name", "value", "rate_hz", "words"),
    [
        ("a/b/FS", 622.08, 622.08, "a/b/FS = 622.08 Hz"),
        ("fs/dt", np.array([[0.004]]), 250.0, "fs/dt = 0.004 s"),
        ("Sample_Time", 3e-5, 1 / 3e-5, "Sample_Time = 3e-05 s"),
        ("rate", "250", 250.0, "rate = 250 Hz"),
        ("wf_increment", np.float32(0.25), 4.0, "wf_increment = 0.25 s"),
    ],
)
def test_a_scalar_states_a_rate_in_its_own_words(name, value, rate_hz, words):
    found = stated_rate(name, value)
    assert found.rate_hz == pytest.approx(rate_hz, rel=1e-12) and found.words == words


@pytest.mark.parametrize(
    ("data", "size"),
    [
        (b"\x02abc", 3),
        (b"\x02abc\x00d", 4),
        (b"\x02abc\x20\x00", 6),  # three bytes of one back
        (b"\x02abc\x40\x02", 7),  # four of three back, which is the first
        (b"\x02abc\x40\x03", 0),  # of four back: before the beginning
        (b"\x02abc\xe0\x05\x01\x01de", 19),  # 7 + 5 + 2 of two back, then two as they are
        (b"\x1f" + b"x" * 32 + b"\x20\x1f", 35),
        (b"\x1f" + b"x" * 32 + b"\x20\x20", 0),
        (b"\x1f" + b"x" * 32 + b"\xc0\x07\x00e", 41),
        (b"\x02ab", 0),
        (b"\x02abc\x20", 0),
        (b"\x02abc\xe0\x05", 0),
        (b"", 0),
    ],
)
def test_bytes_that_a_packed_piece_holds_are_counted_without_unpacking_it(data, size):
    assert _lzf_bytes(data) == size


def test_a_copy_from_far_back_counts_its_distance_from_both_of_its_bytes():
    runs = (b"\x1f" + b"x" * 32) * 17  # 544 bytes
    assert _lzf_bytes(runs + b"\x22\x1f") == 547  # 2 x 256 + 31 + 1 back: the first
    assert _lzf_bytes(runs + b"\x22\x20") == 0
    assert _lzf_bytes(runs + b"\x21\xff") == 547


@pytest.mark.parametrize(
    ("begin", "words"),
    [
        (
            b"TDSh" + bytes(24),
            "this is the index that LabVIEW writes beside a TDMS file, without the data; name the .tdms file.",
        ),
        (b"BZh91AY", "the file is compressed; unpack it first."),
        (b"\xfd7zXZ\x00", "the file is compressed; unpack it first."),
        (b"7z\xbc\xaf\x27", "the file is compressed; unpack it first."),
        (
            b"\x93NUMPY\x01\x00",
            "the name says a LabVIEW TDMS file, which begins with 'TDSm', and the first bytes are "
            "'\\x93NUMPY\\u0001\\u0000'; rename it to 'a.npy'.",
        ),
        (
            b"\x89HDF\r\n\x1a\n",
            "the name says a LabVIEW TDMS file, which begins with 'TDSm', and the first bytes are '\\x89HDF'; rename "
            "it to 'a.h5'.",
        ),
        (
            b'"LabVIEW Measurement"\n',
            "the name says a LabVIEW TDMS file, which begins with 'TDSm', and the first bytes are '\"LabVIEW "
            "Measurement\"'; if it is text, rename it to 'a.lvm', else record again.",
        ),
    ],
)
def test_a_file_of_another_content_than_its_name_says_is_told_in_all_words(tmp_path, begin, words):
    path = tmp_path / "a.tdms"
    path.write_bytes(begin)
    assert refusal(path, 0, 1) == f"{path}: {words}"


@pytest.mark.parametrize(("fault", "words"), [(PermissionError(13, "no"), "[Errno 13] no"), (OSError("gone"), "gone")])
def test_a_file_that_can_be_seen_and_not_read_says_why(tmp_path, monkeypatch, fault, words):
    path = tmp_path / "a.csv"
    five_csv(path)

    def refuse(*_):
        raise fault

    monkeypatch.setattr(files, "read_bytes", refuse)
    assert refusal(path, 1, 2) == f"{path}: the file cannot be read ({words}); check its permissions."


def test_an_array_that_unpacks_to_too_much_is_told_with_all_its_sizes(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(bytes(20_000_000))
    assert files.most_unpacked(path) == 400_000_000
    assert files.too_large(path, (5_000_000, 10), 8) == ""
    assert files.too_large(path, (3, 40_000_000), 4) == (
        "states 40000000 samples, 480 MB in a file of 20 MB, and at most 400 MB are unpacked from that; cut out the "
        "part that you need, or save it without compression"
    )


def test_a_third_channel_that_starts_later_is_named_with_the_first_of_those_that_are_read(tmp_path):
    path = tmp_path / "a.tdms"
    begin = np.datetime64("2026-01-01T12:00:00.000000")
    with TdmsWriter(path) as file:
        for name, late_us, offset, step in (("a", 0, 0.25, 1e-3), ("b", 0, 0.25, 5e-4), ("c", 100, 0.2503, 1e-3)):
            known = {"wf_increment": step, "wf_start_time": begin + np.timedelta64(late_us, "us")}
            file.write_segment([ChannelObject("g", name, DRIVE, {**known, "wf_start_offset": offset})])
    assert refusal(path, "b", ("a", "c")) == (
        f"{path}: 'g/c' starts 0.0004 s apart from 'g/b' (wf_start_time, wf_start_offset; one step is 0.0005 s); "
        "record both in one task, or cut them to their common time."
    )
    assert refusal(path, "a", "b") == (
        f"{path}: two sample rates: 1000 Hz (wf_increment = 0.001 s of 'g/a') and 2000 Hz (wf_increment = 0.0005 s of "
        "'g/b'), 2 times as much; correct the wrong one."
    )


def test_channels_of_other_lengths_are_told_by_their_lengths(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=DRIVE, v=OUTPUT, w=OUTPUT[:777], fs=RATE_HZ)
    assert refusal(path, "u", ("v", "w")) == (
        f"{path}: channel 0 ('u') has 1000 samples and channel 2 ('w') 777; name channels that were sampled together, "
        "or cut them to their common time."
    )


def test_a_rate_of_an_inner_group_goes_before_that_of_an_outer_one(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["run/left/u"], file["run/left/y"], file["run/y"] = DRIVE, OUTPUT, OUTPUT
        file["run/fs"], file["run/left/dt"] = 400.0, 0.002
        file.attrs["rate"] = 90.0
        file["y"] = OUTPUT
    assert read_recording(path, "run/left/u", "run/left/y").rate_hz == 500.0
    assert "500 Hz (run/left/dt = 0.002 s) and 400 Hz (run/fs = 400 Hz), 0.8 times" in refusal(path, "u", "run/y")
    assert "500 Hz (run/left/dt = 0.002 s) and 90 Hz (rate = 90 Hz), 0.18 times" in refusal(path, "u", 3)


# ------------------------------------------------------------------------------------- damaged files in all their words
LVM_HEAD = "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\n"


def lvm_segment(names="X_Value\tu\ty", steps="0.5\t0.5", rows=250, **cells):
    """A segment whose rows begin on the sixth line of it; `cells` are others in the place of those of a row."""
    head = ["", "Channels\t2", f"Delta_X\t{steps}", "***End_of_Header***", names]
    usual = [f"{0.5 * k!r}\t{math.sin(k)!r}\t{math.cos(1.1 * k)!r}" for k in range(rows)]
    return "\n".join([*head, *(cells.get(f"row_{k}", row) for k, row in enumerate(usual))]) + "\n"


@pytest.mark.parametrize(
    ("text", "channels", "words"),
    [
        (
            LVM_HEAD + lvm_segment(steps="0.5\t0.25"),
            ("u", "y"),
            "two sample rates: 2 Hz (Delta_X = 0.5 s of 'u') and 4 Hz (Delta_X = 0.25 s of 'y'), 2 times as much; "
            "correct the wrong one.",
        ),
        (
            LVM_HEAD + lvm_segment(row_77="38.5\t0.1\tx7"),
            ("u", "y"),
            "line 88, channel 2 ('y'): 'x7' is not a finite number; repair the cell or cut the recording there, "
            "because hysteresis remembers what happened in a gap.",
        ),
        (
            LVM_HEAD + lvm_segment(row_3="1.5\tinf\t0.2", row_9="x\tx\tx"),
            ("u", "y"),
            "line 14, channel 1 ('u'): 'inf' is not a finite number; repair the cell or cut the recording there, "
            "because hysteresis remembers what happened in a gap.",
        ),
        (
            LVM_HEAD + lvm_segment(rows=210) + lvm_segment(rows=240, row_5="2.5\t0.3", steps="0.25\t0.25"),
            ("1/u", "1/y"),
            "line 231, channel 5 ('1/y'): the cell is empty; repair the cell or cut the recording there, because "
            "hysteresis remembers what happened in a gap.",
        ),
        (
            LVM_HEAD + lvm_segment(rows=210) + lvm_segment(steps="0.25\t0.25", rows=240),
            ("0/u", "1/y"),
            "channel 1 ('0/u') has 210 samples and channel 5 ('1/y') 240; name channels that were sampled together, or "
            "cut them to their common time.",
        ),
        (
            LVM_HEAD + lvm_segment(rows=210) + lvm_segment(steps="0.25\t0.25", rows=240),
            ("1/u", "1/y"),
            "two sample rates: 4 Hz (Delta_X = 0.25 s of '1/u') and 2 Hz (channel 3 ('1/X_Value'): 240 samples in "
            "119.5 s), 0.5 times as much; correct the wrong one.",
        ),
        (
            LVM_HEAD + lvm_segment(names="Time\tu\ty"),
            (0, 1),
            "line 10 should name the columns, beginning with 'X_Value', and reads 'Time\\u0009u\\u0009y'; export the "
            "recording again from LabVIEW.",
        ),
        (
            LVM_HEAD.replace("Separator\tTab", "Separator\tSemicolon", 1) + lvm_segment(),
            (0, 1),
            "the header names the separator 'Semicolon'; LVM files have Tab or Comma: correct that word, or export the "
            "recording again from LabVIEW.",
        ),
        (
            LVM_HEAD.replace("\tOne", "\tNo") + lvm_segment(names="X_Value"),
            (0, 1),
            "the LVM file has headers and no channel; record again.",
        ),
        (
            LVM_HEAD + "\n1\t2\t3\n",
            (0, 1),
            "the LVM file has no segment with a header, so its channels have no names and no time; write it with 'one "
            "header per segment', or cut the file header off and name the rest .csv.",
        ),
        (
            "LabVIEW Measurement\nSeparator\tTab\n",
            (0, 1),
            "the LVM file has no '***End_of_Header***': it is truncated; copy it again.",
        ),
    ],
)
def test_an_lvm_file_with_a_fault_is_told_in_all_words(tmp_path, text, channels, words):
    path = tmp_path / "a.lvm"
    path.write_bytes(text.encode("latin-1"))
    assert refusal(path, *channels) == f"{path}: {words}"


def test_lvm_channels_of_one_name_are_counted(tmp_path):
    path = tmp_path / "a.lvm"
    text = LVM_HEAD + lvm_segment(names="X_Value\tu\tu").replace("Channels\t2", "Channels\t2\nY_Unit_Label\tV\tmm")
    path.write_text(text, encoding="latin-1")
    source = open_source(path)
    assert (source.names, source.units) == (("X_Value", "u", "u_1"), ("", "V", "mm"))
    assert source.samples() == (250, 250, 250) and source.find_time([2]) == 0
    assert [column[3] for column in source.load([2, 0])] == [math.cos(1.1 * 3), 1.5]
    assert source.rates([2]) == [StatedRate(2.0, "Delta_X = 0.5 s of 'u_1'")]
    assert [source.place(row) for row in (0, 249, 250)] == ["line 12", "line 261", "the end"]


def tdms_lead(following=4, raw=4, version=4713, mask=2, tag=b"TDSm"):
    return tag + struct.pack("<l", mask) + struct.pack(f"{'>' if mask & 64 else '<'}lQQ", version, following, raw)


@pytest.mark.parametrize(
    ("content", "segment", "words"),
    [
        (
            tdms_lead() + bytes(4) + b"TDSx" + bytes(30),
            "segment 1 of the TDMS file, at byte 32,",
            "should begin with 'TDSm' and begins with b'TDSx'; {again}.",
        ),
        (
            tdms_lead() + bytes(4) + b"TDSm" + bytes(7),
            "segment 1 of the TDMS file, at byte 32,",
            "has 11 of the 28 bytes of its lead-in; {again}.",
        ),
        (
            tdms_lead(version=4711) + bytes(4),
            "segment 0 of the TDMS file, at byte 0,",
            "states version 4711; versions (4712, 4713) are known; {again}.",
        ),
        (
            tdms_lead(following=2**64 - 1) + bytes(4),
            "segment 0 of the TDMS file, at byte 0,",
            "was never completed: the program that wrote it stopped while recording; {again}, or record again.",
        ),
        (
            tdms_lead(6) + bytes(6) + tdms_lead(following=77, raw=3, mask=64) + bytes(70),
            "segment 1 of the TDMS file, at byte 34,",
            "is truncated: 7 of its 77 bytes are missing; {again}.",
        ),
        (
            tdms_lead(raw=9) + bytes(4),
            "segment 0 of the TDMS file, at byte 0,",
            "places its data at byte 9 of 4; {again}.",
        ),
    ],
)
def test_a_tdms_file_with_a_fault_is_told_with_segment_and_byte(tmp_path, content, segment, words):
    path = tmp_path / "a.tdms"
    path.write_bytes(content)
    again = "copy the file again from its source, or open and save it in LabVIEW"
    assert refusal(path, 0, 1) == f"{path}: {segment} {words.format(again=again)}"


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ("u", "'u' holds complex numbers, not real numbers; save the real signal."),
        ("y", "'y' holds text, not real numbers; save numbers, or name another."),
        (
            "z",
            "'z' holds Python objects, which are pickled and not read, because loading them could run code; save them "
            "as plain numbers, array.astype(float).",
        ),
        ("b", "'b' holds booleans, not real numbers; save numbers, or name another."),
        ("r", "'r' holds records of p, q; save each of these as an array of its own."),
        ("e", "'e' holds no samples; record again, or name another."),
        ("one", "'one' is a single number; name an array."),
        ("d", "'d' holds the type datetime64[s], not real numbers; save it as floating-point numbers."),
        *(
            (
                wanted,
                "'w' is an array of shape (3, 4, 250): name one channel of it with an index for each axis but the "
                "samples', 'w[0, 0]', or read it whole by saying what each axis is: --axes (axes), such as "
                "samples,channels,realisations,periods.",
            )
            for wanted in ("w", "w[1]", "w[3, 0]", "w[2, 4]", "w[0, 0, 0]")
        ),
    ],
)
def test_an_array_that_is_no_channel_says_why_in_all_words(tmp_path, wanted, words):
    path = tmp_path / "a.npz"
    records = np.zeros(2, dtype=[("p", "f4"), ("q", "f8")])
    np.savez(path, u=np.ones(3) + 0j, y=np.array(["a"]), z=np.array([None, 1]), b=np.ones(300) > 0, r=records,
             e=np.zeros((0, 4)), w=np.zeros((3, 4, 250)), one=np.array(7.0),
             d=np.zeros(300, dtype="datetime64[s]"))  # fmt: skip
    assert refusal(path, wanted, "w[0, 0]") == f"{path}: the input '{wanted}' is no channel: {words}"


def test_an_index_of_three_axes_takes_the_channel_that_it_counts(tmp_path):
    rng = np.random.Generator(np.random.Philox(3))
    values = rng.standard_normal((3, 250, 4))
    np.savez(tmp_path / "a.npz", w=values, fs=40.0)
    read = read_recording(tmp_path / "a.npz", ("w[2,1]", "w[0, 3]"), "w[ 1 , 2]", accept=["dead"])
    np.testing.assert_array_equal(read.drive, np.column_stack([values[2, :, 1], values[0, :, 3]]))
    np.testing.assert_array_equal(read.output[:, 0], values[1, :, 2])
    assert read.input_names == ("w[2, 1]", "w[0, 3]")


@pytest.mark.parametrize(
    ("headers", "wanted", "column"),
    [
        ((("time", "drive", "out"), ("s", "drive", "drive")), "drive", 1),
        ((("time", "a", "a"), ("out", "drive", "b")), "drive", 1),
        ((("time", "2", "0"), ("2", "b", "c")), "2", 1),
        ((("time", "a", "b"),), "2", 2),
    ],
)
def test_a_name_is_that_of_the_first_row_of_headers_that_has_it(tmp_path, headers, wanted, column):
    assert text_format.column_of(tmp_path, text_format.Layout(",", 3, headers, 3, "utf-8"), wanted, "input") == column
    twice = text_format.Layout(",", 3, (("t", "u", "u"), ("t", "u", "y")), 3, "utf-8")
    with pytest.raises(RecordingError, match="columns 1, 2 are all named 'u'; give the input column by its number"):
        text_format.column_of(tmp_path, twice, "u", "input")


# ------------------------------------------------------------------------------------------------- word by word again
NO_SAMPLES = "holds no samples; record again, or name another"
NO_TEXT = "holds text, not real numbers; save numbers, or name another"
REPACK = "pack it with gzip or not at all (h5repack -f GZIP=1 old.h5 new.h5)"


def matlab_like(path):
    """Datasets as MATLAB's version 7.3 leaves them, each of its own kind."""
    with h5py.File(path, "w") as file:
        file["group/sparse/data"] = np.arange(5.0)
        file["group/sparse"].attrs["MATLAB_sparse"] = 3
        for name, kind in {"c": b"char", "k": b"cell", "o": b"struct", "n": b"int16", "s": "single"}.items():
            file[name] = np.arange(4.0)
            file[name].attrs["MATLAB_class"] = kind
        file["e"] = np.arange(2.0)
        file["e"].attrs["MATLAB_empty"] = 1
        file["text"] = np.array([b"a", b"b"], dtype=h5py.string_dtype("ascii", 3))
        file["void"] = np.zeros((0, 3))
        file["null"] = h5py.Empty("f8")
        file.create_dataset("ragged", (2,), dtype=h5py.vlen_dtype(np.float64))
        file.create_dataset("refs", (2,), dtype=h5py.ref_dtype)
        file.create_dataset("lone", data=np.arange(300.0), chunks=(100,), shuffle=True, compression="gzip")
        file.create_dataset("scaled", data=np.arange(300), chunks=(100,), scaleoffset=0)
    return path


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("group/sparse/data", "is part of a sparse matrix; save it as full"),
        ("c", NO_TEXT),
        ("k", "holds cells; save the numbers of each cell as an array"),
        ("o", "is an object of MATLAB, which only MATLAB reads; save its numbers as arrays"),
        *((name, "") for name in ("n", "s", "lone")),
        *((name, NO_SAMPLES) for name in ("e", "void", "null")),
        ("text", NO_TEXT),
        ("ragged", "holds rows of different lengths; save each as an array"),
        (
            "refs",
            "holds references to other data (cells, or an array of structures, in MATLAB); save these as arrays",
        ),
        ("scaled", f"is packed by the filter 6 (scaleoffset), whose pieces cannot be checked; {REPACK}"),
    ],
)
def test_a_dataset_says_in_its_own_words_why_it_is_no_channel(tmp_path, name, words):
    path = matlab_like(tmp_path / "a.h5")
    with h5py.File(path, "r") as file:
        assert unusable_dataset(path, file[name]) == words


@pytest.mark.parametrize(
    ("name", "head", "found"),
    [
        ("a.mat", b"MATLAB 7.3 MAT-file, cut off before the signature", "mat73"),
        ("a.mat", b"MATLAB of its own".ljust(512) + b"\x89HDF\r\n\x1a\n", "mat73"),
        ("a.mat", b"MATLAB 5.0 MAT-file", "mat"),
        ("a.x", b"TDSm", "tdms"),
        ("a.x", b"\x93NUMPY\x01", "npy"),
        ("a.x", b"PK\x03\x04", "npz"),
        ("a.x", b"\x89HDF\r\n\x1a\n", "hdf5"),
        ("a.x", b'\xef\xbb\xbf"LabVIEW Measurement"', "lvm"),
        ("a.x", b"LabVIEW Measurement\t", "lvm"),
        ("a.x", b" LabVIEW Measurement\t", "text"),
        ("a.x", b"MATLAB 4", "text"),
        ("a.mat", b"0.1 0.2\n" * 3 + b"\x00", "text"),
        ("a.x", b"\x00\x00\x00\x00", "text"),
    ],
)
def test_a_format_is_told_by_how_its_content_begins(name, head, found):
    assert files._content(Path(name), head) == found


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        (
            "a.x",
            b"TDSh",
            "this is the index that LabVIEW writes beside a TDMS file, without the data; name the .tdms file.",
        ),
        *(
            ("a.csv", head, "the file is compressed; unpack it first.")
            for head in (b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"7z\xbc\xaf")
        ),
        (
            "a.MAT",
            b"\x00" * 20,
            "this is not a MATLAB file of version 5 or later; load it in MATLAB and save it with -v7.",
        ),
        (
            "a.mat",
            b"0" * 19 + b"\x00",
            "this is not a MATLAB file of version 5 or later; load it in MATLAB and save it with -v7.",
        ),
    ],
)
def test_a_content_that_is_of_no_use_says_what_to_do(name, head, words):
    with pytest.raises(RecordingError) as refused:
        files._content(Path(name), head)
    assert str(refused.value) == f"{name}: {words}"


def test_a_file_that_is_not_there_or_none_says_so_in_all_words(tmp_path):
    (tmp_path / "drive-1.csv").write_text("1 2\n", encoding="utf-8")
    (tmp_path / "empty.csv").touch()
    near = "(nearest name in that directory: 'drive-1.csv')"
    for name, words in (
        ("", "this is a directory; name one file in it."),
        ("drive-2.csv", f"there is no such file; check the path {near}."),
        ("xyz.tdms", "there is no such file; check the path."),
        ("none/xyz.tdms", "there is no such file; check the path."),
        ("empty.csv", "the file is empty; record again or name another file."),
    ):
        with pytest.raises(RecordingError) as refused:
            files.check_file(tmp_path / name)
        assert str(refused.value) == f"{printable(str(tmp_path / name))}: {words}"


def test_of_a_file_without_channels_five_reasons_are_told(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **{f"v{k}": np.array(float(k)) for k in range(7)})
    told = "; ".join(f"'v{k}' is a single number; name an array" for k in range(5))
    assert refusal(path, 0, 1) == (
        f"{path}: the NumPy file holds no channel of numbers ({told}); record again or name another file."
    )
    none = Container.__new__(Container)
    none.path, none.kind, none.names, none.unusable = path, "X", (), {"a": "is none", "b": "is none, too"}
    with pytest.raises(RecordingError) as refused:
        none.resolve(3, "input")
    assert str(refused.value) == (
        f"{path}: there is no input channel 3: the X file has 0 channels, numbered from 0 ('a' is none; 'b' is none, "
        "too)."
    )
    with pytest.raises(RecordingError) as refused:
        none.resolve("z", "output")
    assert str(refused.value) == (
        f"{path}: no output channel is named 'z'; The channels are 'a' is none; 'b' is none, too; a number counted "
        "from 0 does as well."
    )


def test_lvm_columns_that_are_not_named_are_shown_to_their_fortieth_letter(tmp_path):
    path = lvm(tmp_path / "a.lvm")
    names = b"Y_Value\t" + b"drive" * 9 + b"\toutput"
    path.write_bytes(path.read_bytes().replace(b"X_Value\tdrive\toutput", names))
    assert refusal(path, 0, 1) == (
        f"{path}: line 19 should name the columns, beginning with 'X_Value', and reads "
        f"'{printable(names.decode()[:40], chr(0xA0))}'; export the recording again from LabVIEW."
    )


@pytest.mark.parametrize(
    ("shape", "axis", "channels"),
    [
        ((5,), 0, ["v"]),
        ((1, 5), 1, ["v"]),
        ((5, 1, 1), 0, ["v"]),
        ((2, 5), 1, ["v[0]", "v[1]"]),
        ((5, 3), 0, ["v[0]", "v[1]", "v[2]"]),
        ((2, 2), 0, ["v[0]", "v[1]"]),
        ((1, 2, 4), 2, ["v[0]", "v[1]"]),
    ],
)
def test_samples_run_along_the_longest_axis_and_each_other_index_is_a_channel(shape, axis, channels):
    values = np.arange(float(np.prod(shape))).reshape(shape)
    found = channels_of([Variable("v", shape, values.dtype, values.__getitem__, "V")], {})
    assert [each.name for each in found] == channels
    columns = np.moveaxis(values, axis, -1).reshape(-1, shape[axis])
    for each, column in zip(found, columns, strict=True):
        assert (each.samples, each.unit, each.load().tolist()) == (shape[axis], "V", column.tolist())


@pytest.mark.parametrize(
    ("dtype", "shape", "words"),
    [
        ("c16", (5,), "holds complex numbers, not real numbers; save the real signal"),
        ("?", (5,), "holds booleans, not real numbers; save numbers, or name another"),
        ("S3", (5,), NO_TEXT),
        ("U3", (5,), NO_TEXT),
        ("M8[s]", (5,), "holds the type datetime64[s], not real numbers; save it as floating-point numbers"),
        ([("real", "f8"), ("imag", "f8")], (5,), "holds complex numbers, not real numbers; save the real signal"),
        (
            [(name, "f4") for name in "abcdefg"],
            (5,),
            "holds records of a, b, c, d, e; save each of these as an array of its own",
        ),
        ("f8", (), "is a single number; name an array"),
        ("i2", (1, 1), "is a single number; name an array"),
        ("f8", (3, 0), NO_SAMPLES),
        (
            "f8",
            (4, 7, 2, 3),
            "is an array of shape (4, 7, 2, 3): name one channel of it with an index for each axis but the samples', "
            "'v[0, 0, 0]', or read it whole by saying what each axis is: --axes (axes), such as "
            "samples,channels,realisations,periods",
        ),
        (
            "u1",
            (10_001, 10_002),
            "is an array of shape (10001, 10002): at most 10000 channels are listed; save the columns that you need",
        ),
    ],
)
def test_a_variable_that_is_no_channel_says_why(dtype, shape, words):
    unusable = {}
    assert channels_of([Variable("v", shape, np.dtype(dtype), None)], unusable) == ()
    assert unusable == {"v": words}


@pytest.mark.parametrize(
    ("wanted", "index"),
    [
        ("g/v[1, 2]", (slice(None), 1, 2)),
        ("v[0,3]", (slice(None), 0, 3)),
        ("v[ 1 ,0]", (slice(None), 1, 0)),
        *(
            (wanted, None)
            for wanted in (
                "v[2, 0]",
                "v[0, 4]",
                "v[1]",
                "v[0, 0, 0]",
                "w[0, 0]",
                "v",
                "v[]",
                "v[0 0]",
                "v[0,]",
                0,
                "v[-1, 0]",
            )
        ),
    ],
)
def test_an_index_picks_a_channel_out_of_an_array_where_each_part_is_within_its_axis(wanted, index):
    values = np.arange(72.0).reshape(9, 2, 4)
    others = Variable("x", (9, 2), values.dtype, None), Variable("t", (9, 2, 4), np.dtype("S1"), None)
    made = indexed(None, [*others, Variable("g/v", (9, 2, 4), values.dtype, values.__getitem__, "mV")], wanted)
    if index is None:
        assert made is None
    else:
        assert (made.name, made.samples, made.unit) == (f"g/v[{index[1]}, {index[2]}]", 9, "mV")
        assert made.load().tolist() == values[index].tolist()


@pytest.mark.parametrize(
    ("shape", "axes", "found"),
    [
        ((5, 1, 2), 3, (5, 1, 2)),
        ((5, 1, 2), 2, (5, 2)),
        ((5, 1, 2), 1, None),
        ((1, 1), 2, (1, 1)),
        ((1, 1), 0, ()),
        ((4,), 2, None),
    ],
)
def test_a_shape_may_leave_out_axes_of_length_one_where_all_of_them_are(shape, axes, found):
    assert _with_axes(shape, axes) == found


@pytest.mark.parametrize("blank", ["", " ", "  "])
def test_a_quoted_name_behind_a_blank_is_one_cell(blank):
    line = f'time,{blank}"u, x",{blank}y'
    assert text_format.split(line, ",") == ["time", "u, x", "y"]


def test_a_time_that_is_named_is_as_long_as_the_channels(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=DRIVE, y=OUTPUT, clock=TIME_S[:-1])
    assert "channel 0 ('u') has 1000 samples and channel 2 ('clock') 999; name channels that were sampled" in refusal(
        path, "u", "y", time="clock"
    )


@pytest.mark.parametrize("wanted", [True, False])
def test_neither_yes_nor_no_is_the_number_of_a_channel(tmp_path, wanted):
    np.savez(tmp_path / "a.npz", u=DRIVE, v=DRIVE**2, y=OUTPUT, fs=RATE_HZ)
    assert f"there is no input channel {wanted}: the NumPy file has 3 channels, numbered from 0" in refusal(
        tmp_path / "a.npz", wanted, "y"
    )


def test_of_many_channels_with_one_last_name_ten_are_listed(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(12):
            file[f"g{k:02}/u"] = DRIVE
    listed = ", ".join(f"'g{k:02}/u'" for k in range(10))
    assert f": 'u' may be {listed}; give the input by its full name." in refusal(tmp_path / "a.h5", "u", "y")


def test_a_name_of_time_may_have_blanks_about_it_in_its_group():
    assert is_time_name(" t ") and is_time_name("run/one/ time (s) ")
    assert not is_time_name("time/u") and not is_time_name("T")


def test_a_drive_that_is_called_t_is_no_time_where_it_is_the_input(tmp_path):
    path = tmp_path / "a.csv"
    rows = zip((40 + DRIVE).tolist(), OUTPUT.tolist(), strict=True)
    path.write_text("t,y\n" + "".join(f"{u!r},{y!r}\n" for u, y in rows))
    read = read_recording(path, "t", "y", RATE_HZ)
    np.testing.assert_allclose(read.drive[:, 0], 40 + DRIVE)
    assert (read.rate_hz, read.input_names) == (RATE_HZ, ("t",))
    assert "does not say how fast it was sampled" in refusal(path, "t", "y")


def test_the_clock_of_an_lvm_segment_may_have_a_comma_where_its_numbers_have_none(tmp_path):
    path = lvm(tmp_path / "a.lvm", segments=3)
    path.write_bytes(re.sub(rb"12:00:(\d\d)\.", rb"12:00:\1,", path.read_bytes()))
    check(read_recording(path, "drive", "output"))


def test_a_decimal_comma_in_an_lvm_file_of_points_is_named_by_its_cell(tmp_path):
    path = tmp_path / "a.lvm"
    path.write_text(LVM_HEAD + lvm_segment(row_7="3.5\t0.25\t0,75"))
    assert "line 18, channel 2 ('y'): '0,75' is not a finite number; repair the cell" in refusal(path, "u", "y")


def test_decimal_commas_are_told_from_the_names_just_above_the_rows(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Stage 4\nu,y\n" + "1,25,3,5\n" * 300)
    assert "the header names 2 columns and the rows have 4: decimal commas, which cannot be told" in refusal(path, 0, 1)
    path.write_text("u;y\n" + "".join(f"{k % 17};{k};{k % 23};5\n" for k in range(300)))
    source = open_source(path)
    assert source.names == ("0", "1", "2", "3")
    assert source.load([2])[0].tolist() == [k % 23 for k in range(300)]


@pytest.mark.parametrize("wanted", ["cube[1,0]", "cube[1, 0]", "cube[1 ,  0]", "run/cube[1,0]"])
def test_a_channel_of_an_array_of_three_axes_has_one_name_however_it_is_spaced(tmp_path, wanted):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["run/cube"] = np.stack([np.stack([OUTPUT, DRIVE]), np.stack([DRIVE, OUTPUT])])[:, :, :, None]
        file["run/cube"].attrs["unit"] = "mV"
        file.attrs["Fs"] = RATE_HZ
    (named,) = read_recording(path, wanted.replace("]", ", 0]"), "cube[1,1,0]").input_names
    assert named == "run/cube[1, 0, 0]"
    read = read_recording(path, wanted.replace("]", ",0]"), "cube[1, 1, 0]")
    np.testing.assert_array_equal(read.drive[:, 0], DRIVE)
    np.testing.assert_array_equal(read.output[:, 0], OUTPUT)
    assert (read.input_units, read.output_units) == (("mV",), ("mV",))


def test_attributes_that_state_a_rate_are_known_in_any_case_of_letters_and_held_against_each_other(tmp_path):
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "w") as file:
        file["u"], file["y"] = DRIVE, OUTPUT
        file.attrs["Sample_Rate"] = 500.0
    assert read_recording(path, "u", "y").rate_hz == 500.0
    with h5py.File(path, "a") as file:
        file["FS"] = 400.0
    told = refusal(path, "u", "y")
    assert "two sample rates: 500 Hz (Sample_Rate = 500 Hz) and 400 Hz (FS = 400 Hz), 0.8 times as much" in told


@pytest.mark.parametrize(("groups", "deep"), [(50, False), (51, True)])
def test_a_dataset_may_stand_in_fifty_groups_one_in_the_other(tmp_path, groups, deep):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["y"], file["d/" * groups + "u"] = OUTPUT, DRIVE
    if deep:
        assert "groups are nested more than 50 deep" in refusal(tmp_path / "a.h5", "u", "y", RATE_HZ)
    else:
        assert read_recording(tmp_path / "a.h5", "u", "y", RATE_HZ).input_names == ("d/" * groups + "u",)


def test_segments_that_are_not_joined_have_their_own_numbers_of_rows(tmp_path):
    source = LvmSource(lvm(tmp_path / "a.lvm", segments=3, gap_s=0.1))
    assert source.samples() == (334, 334, 333, 333, 333, 333)


def test_of_the_librarys_warnings_those_of_this_thread_about_numbers_are_heard():
    listener = _Listener()
    told = logging.LogRecord("nptdms", logging.WARNING, "", 0, "Cropping data from %s", ("4",), None)
    for change in ({}, {"thread": told.thread + 1}, {"msg": "Unsupported version %s"}):
        record = logging.makeLogRecord({**vars(told), **change})
        listener.emit(record)
    assert listener.heard == ["Cropping data from 4"]


def test_the_longest_axis_counts_the_samples_of_what_is_too_large(tmp_path):
    (tmp_path / "a").write_bytes(b"0" * 500_000)
    assert files.too_large(tmp_path / "a", (3, 40_000_000, 2), 8).startswith(
        "states 40000000 samples, 1920 MB in a file of 0.5 MB, and at most 256 MB are unpacked from that;"
    )


def test_the_unit_that_is_stated_of_a_time_goes_before_that_in_brackets():
    assert (time_unit("time (ms)", "us"), time_unit("time (ms)", "")) == ("us", "ms")


def saved(file, name, arrays):
    """Arrays into a file in the format that a name ends with."""
    if name.lower().endswith(".npz"):
        np.savez(file, **arrays)
    elif name.lower().endswith(".mat"):
        savemat(file, arrays)
    else:
        with h5py.File(file, "w") as made:
            for key, values in arrays.items():
                made[key] = values


@pytest.mark.parametrize("name", ["a.npz", "a.mat", "a.h5"])
def test_an_array_that_is_called_t_is_no_time_where_it_is_the_input(tmp_path, name):
    path, arrays = tmp_path / name, {"t": 40 + DRIVE, "y": OUTPUT}
    saved(path, name, arrays)
    read = read_recording(path, "t", "y", RATE_HZ)
    np.testing.assert_array_equal(read.drive[:, 0], 40 + DRIVE)
    assert (read.rate_hz, read.input_names, read.findings[0].kind) == (RATE_HZ, ("t",), "unexcited")


def test_both_numbers_of_a_version_of_numpys_format_that_is_not_known_are_told(tmp_path):
    (tmp_path / "a.npy").write_bytes(npy_header(WHOLE, version=(4, 1)) + DRIVE.tobytes())
    assert "version 4.1 of the format is not known" in refusal(tmp_path / "a.npy", 0, 1)


def test_the_time_of_a_channel_is_the_one_of_its_length_whatever_stands_first(tmp_path):
    np.savez(tmp_path / "a.npz", other=DRIVE[:300], t=TIME_S[:300] * 3, time=TIME_S, u=DRIVE, y=OUTPUT)
    assert read_recording(tmp_path / "a.npz", "u", "y").rate_hz == pytest.approx(RATE_HZ)


@pytest.mark.parametrize("write", [np.savez, savemat])
def test_a_rate_and_a_step_of_one_file_that_contradict_each_other_are_refused(tmp_path, write):
    path = tmp_path / ("a.npz" if write is np.savez else "a.mat")
    arrays = {"u": DRIVE, "y": OUTPUT, "Fs": 400.0, "dt": 0.005}
    saved(path, path.name, arrays)
    told = refusal(path, "u", "y")
    assert "two sample rates: 400 Hz (Fs = 400 Hz) and 200 Hz (dt = 0.005 s), 0.5 times as much" in told
    assert read_recording(write_agreeing(path, arrays), "u", "y").rate_hz == 400.0


def write_agreeing(path, arrays):
    """The same arrays with a step that is that of the rate."""
    arrays = {**arrays, "dt": 0.0025}
    saved(path, path.name, arrays)
    return path


def test_an_index_into_an_array_of_words_names_what_it_holds(tmp_path):
    np.savez(tmp_path / "a.npz", words=np.full((2, 3, N), "a"), y=OUTPUT)
    assert "the input 'words[0, 1]' is no channel: 'words' holds text, not real numbers; save numbers" in refusal(
        tmp_path / "a.npz", "words[0,1]", "y", RATE_HZ
    )


@pytest.mark.parametrize(("columns", "listed"), [(100, True), (101, False)])
def test_an_array_has_as_many_channels_as_are_listed_and_no_more(monkeypatch, columns, listed):
    monkeypatch.setattr("microrad.lab.recording.formats.arrays._MOST_COLUMNS", 100)
    unusable = {}
    found = channels_of([Variable("a", (columns, 250), np.dtype(float), lambda key: None)], unusable)
    assert [each.name for each in found] == [f"a[{k}]" for k in range(columns)] * listed
    assert list(unusable) == ["a"] * (not listed)


def test_a_sparse_matrix_without_rows_is_one_as_well(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["s/data"], file["u"] = DRIVE, DRIVE
        file["s"].attrs["MATLAB_sparse"] = np.uint64(0)
        assert unusable_dataset(tmp_path / "a.h5", file["s/data"]) == "is part of a sparse matrix; save it as full"
        assert unusable_dataset(tmp_path / "a.h5", file["u"]) == ""


def test_a_unit_in_bytes_is_read_as_utf_8(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["u"], file["y"] = DRIVE, OUTPUT
        file["u"].attrs["unit"], file["y"].attrs["unit_string"] = np.bytes_(b"V"), np.bytes_("µrad".encode())
    read = read_recording(tmp_path / "a.h5", "u", "y", RATE_HZ)
    assert (read.input_units, read.output_units) == (("V",), ("µrad",))


@pytest.mark.parametrize("name", ["A.NPZ", "A.Mat", "A.H5"])
def test_the_end_of_a_name_may_have_letters_of_either_case(tmp_path, name):
    content = io.BytesIO()
    arrays = {"drive": DRIVE, "output": OUTPUT, "fs": RATE_HZ}
    saved(content, name, arrays)
    (tmp_path / name).write_bytes(content.getvalue())
    check(read_recording(tmp_path / name, "drive", "output"))


@pytest.mark.parametrize(
    ("group", "rates"), [("run/cube", (500.0, 500.0)), ("run", (500.0, 500.0)), ("", (500.0, 500.0))]
)
def test_a_channel_by_the_short_name_of_its_array_has_the_rate_of_the_array(tmp_path, group, rates):
    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        file["run/cube"] = np.stack([np.stack([OUTPUT, DRIVE]), np.stack([DRIVE, OUTPUT])])
        (file[group] if group else file).attrs["Fs"] = 500.0
    found = [read_recording(path, f"{name}[0, 0]", f"{name}[1, 0]", alone=False) for name in ("cube", "run/cube")]
    assert tuple(each.rate_hz for each in found) == rates
    source = open_source(path)
    assert len({source.resolve(name, "drive") for name in ("cube[0,1]", "run/cube[0, 1]", "cube[ 0 , 1]")}) == 1


@pytest.mark.parametrize("name", ["time (h)", "time [h]"])
def test_a_time_in_an_unknown_unit_of_its_name_is_refused_with_that_unit(tmp_path, name):
    path = tmp_path / "r.npz"
    np.savez(path, **{"drive": DRIVE, "output": OUTPUT, name: np.arange(DRIVE.size) / RATE_HZ})
    with pytest.raises(RecordingError, match=r"the time is in 'h'; convert it to one of s, "):
        read_recording(path, "drive", "output", time=name)


@pytest.mark.parametrize(
    ("data", "filters", "stated", "size"),
    [
        (b"abc", [], 3, 3),
        (b"x" * 44, [3], 40, 40),
        (zlib.compress(b"x" * 40) + bytes(4), [2, 1, 3], 40, 40),
        (zlib.compress(b"x" * 40), [2, 1, 3], 40, 0),  # its own last four bytes are taken for the checksum
        (zlib.compress(b"x" * 40), [1], 39, 40),
        (b"\x00a" + bytes(4), [32000, 3], 1, 1),
        (b"\x00a\x01", [32000, 3], 1, 0),  # shorter than a checksum
        (b"", [1, 3], 8, 0),
    ],
)
def test_a_checksum_behind_a_packed_piece_is_none_of_its_bytes(data, filters, stated, size):
    assert _unpacked_bytes(data, filters, stated) == size


def test_names_with_an_underscore_between_digits_are_no_numbers(tmp_path):
    (tmp_path / "a.csv").write_text("1_000,2_5,time\n" + "1.5,2.5,0.001\n" * 300)
    source = text_format.TextSource(tmp_path / "a.csv")
    assert source.names == ("1_000", "2_5", "time") and source.layout.first_line == 2


@pytest.mark.parametrize(
    ("header", "names", "units"),
    [
        ("V,mrad\n", ("V", "mrad"), ("", "")),  # there are no other names
        ("V,mrad\ndrive,angle\n", ("drive", "angle"), ("V", "mrad")),
        ("drive,angle\n[V],(mrad)\n", ("drive", "angle"), ("V", "mrad")),
        ("drive [mV],angle\na,b\n", ("drive [mV]", "angle"), ("mV", "")),
    ],
)
def test_a_row_of_units_is_one_beside_the_names(tmp_path, header, names, units):
    (tmp_path / "a.csv").write_text(header + "1.5,2.5\n" * 300)
    source = text_format.TextSource(tmp_path / "a.csv")
    assert (source.names, source.units) == (names, units)


def test_scalars_state_the_rates_of_their_own_group_in_their_order():
    def variable(name, values):
        values = np.asarray(values)
        return Variable(name, values.shape, values.dtype, values.__getitem__)

    found = rates_of(
        [
            variable("b/fs", [[500.0]]),
            variable("dt", 0.004),
            variable("b/gain", 3.0),
            variable("a/in/Rate_Hz", np.array([2000], dtype=np.uint16)),
            variable("b/DT", np.array([[[0.002]]], dtype=np.float32)),
            variable("b/ts", [1.0, 2.0]),
            variable("a/fs", 4.0 + 0.0j),
            variable("a/rate", True),
            variable("a/sample_rate", np.zeros((1, 0))),
            variable("a/step_s", 0),
        ]
    )
    step_s = float(np.float32(0.002))
    assert found == {
        "b": (StatedRate(500.0, "b/fs = 500 Hz"), StatedRate(1 / step_s, "b/DT = 0.002 s")),
        "": (StatedRate(250.0, "dt = 0.004 s"),),
        "a/in": (StatedRate(2000.0, "a/in/Rate_Hz = 2000 Hz"),),
    }


@pytest.mark.parametrize("place", ["channel", "group", "file"])
def test_too_many_scales_are_refused_wherever_a_tdms_file_states_them_of_the_second_channel(tmp_path, place):
    """What stands at a group or at the file holds for its channels."""
    stated = {"NI_Number_Of_Scales": 1001}
    objects = [
        RootObject(stated if place == "file" else {}),
        GroupObject("calm"),
        ChannelObject("calm", "y", np.arange(3.0)),
        GroupObject("bench", stated if place == "group" else {}),
        ChannelObject("bench", "u", np.arange(3.0), stated if place == "channel" else {}),
    ]
    path = tmp_path / "a.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment(objects)
    named = "calm/y" if place == "file" else "bench/u"
    with pytest.raises(RecordingError) as refused:
        TdmsSource(path)
    assert str(refused.value) == (
        f"{path}: this cannot be read as a TDMS file ('{named}' states 1001 scales); the file is damaged or truncated: "
        "copy it again from its source."
    )


@pytest.mark.parametrize(
    ("preamble", "header"), [("setting {}; on", "u,y"), ("# {},{},{}", "u,y"), ("a word {}", "u v,y")]
)
def test_a_text_is_laid_out_as_its_last_lines_are_however_many_others_stand_before(tmp_path, preamble, header):
    """250 lines before the names, more than are judged."""
    before = [preamble.format(k, k + 1, k + 2) for k in range(250)]
    (tmp_path / "a.csv").write_text("\n".join([*before, header, *(f"{k}.5,{-k}" for k in range(210))]) + "\n")
    found = text_format.layout_of(tmp_path / "a.csv")
    assert (found.delimiter, found.columns, found.first_line) == (",", 2, 252)
    assert found.names == tuple(header.split(","))
    source = text_format.TextSource(tmp_path / "a.csv")
    assert [values[-1] for values in source.load([0, 1])] == [209.5, -209.0] and source.place(2) == "line 254"


@pytest.mark.parametrize("offsets_s", [(0.0, 0.0004, -0.0004), (-0.0004, 0.0, 0.0004), (0.0004, 0.0, -0.0004)])
def test_channels_that_start_apart_from_each_other_are_refused_in_any_order(tmp_path, offsets_s):
    """By 0.8 of a step of 1 ms, although each starts within half a step of the one that starts between them."""
    path = tmp_path / "a.tdms"
    known = {"wf_increment": 1e-3, "wf_start_time": np.datetime64("2026-01-01T12:00:00.000000")}
    with TdmsWriter(path) as file:
        for name, offset in zip("abc", offsets_s, strict=True):
            file.write_segment([ChannelObject("g", name, DRIVE, {**known, "wf_start_offset": offset})])
    last, first = (f"g/{'abc'[choose(range(3), key=offsets_s.__getitem__)]}" for choose in (max, min))
    assert f"'{last}' starts 0.0008 s apart from '{first}'" in refusal(path, "a", ("b", "c"))


@pytest.mark.parametrize(("quoted", "regular"), [((), True), ((0,), False), ((1,), False), ((2,), False)])
def test_a_text_is_regular_where_all_of_its_blocks_are(tmp_path, monkeypatch, quoted, regular):
    path = tmp_path / "a.csv"
    path.write_text("".join(f'{k},"{-k}"\n' if k in quoted else f"{k},{-k}\n" for k in range(3)))
    monkeypatch.setattr(text_format, "_blocks", lambda of: of.read_bytes().splitlines(keepends=True))
    layout = text_format.Layout(",", 2, (), 1, "utf-8")
    assert text_format._scan(path, layout) == (hashlib.sha256(path.read_bytes()).hexdigest(), regular)


@pytest.mark.parametrize(
    ("written", "becomes"), [(rb"(Date\t)[^\t\r]*", rb"\g<1>01.01.2026"), (rb"(Time\t12:00:0\d)\.[^\t\r]*", rb"\1")]
)
def test_lvm_segments_with_a_clock_of_another_form_have_no_start(tmp_path, written, becomes):
    path = lvm(tmp_path / "a.lvm", segments=2)
    path.write_bytes(re.sub(written, becomes, path.read_bytes()))
    source = LvmSource(path)
    assert source.names == ("0/drive", "0/output", "1/drive", "1/output")
    assert source._start_s(source._segments[0]) is None


@pytest.mark.parametrize("ending", ["", "\n"])
def test_lines_of_an_lvm_file_are_counted_beyond_what_is_looked_through_at_once(ending):
    """By 16 MB at a time: the second part has the fewer lines, and the last line may have no end."""
    data = b"head\n" + b"1\t2\n" * (4 << 20) + b"33333333\n" * 1000 + b"5\t6" + ending.encode()
    assert len(data) > 1 << 24
    assert _count_lines(data, 5, len(data)) == (4 << 20) + 1001
    assert _count_lines(data, 5, 13) == 2 and _count_lines(data, 5, 12) == 2 and _count_lines(data, 5, 5) == 0


@pytest.mark.parametrize("blank", ["", "\t", "\t\t\t"])
def test_names_of_lvm_columns_end_where_only_blank_cells_follow(tmp_path, blank):
    path = tmp_path / "a.lvm"
    path.write_text(LVM_HEAD + lvm_segment(names=f"X_Value\tu\ty{blank}"), encoding="latin-1")
    source = open_source(path)
    assert source.names == ("X_Value", "u", "y")
    assert [column[2] for column in source.load([1, 2])] == [math.sin(2), math.cos(2.2)]


def test_of_twelve_channels_of_one_last_name_ten_are_told(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(12):
            file[f"g{k:02d}/u"] = DRIVE + k
    listed = ", ".join(f"'g{k:02d}/u'" for k in range(10))
    message = refusal(tmp_path / "a.h5", 0, "u", RATE_HZ)
    assert message == f"{tmp_path / 'a.h5'}: 'u' may be {listed}; give the output by its full name."
    read = read_recording(tmp_path / "a.h5", "g11/u", "g03/u", RATE_HZ, accept=("unexcited", "lead", "dead"))
    assert read.drive[0, 0] - read.output[0, 0] == pytest.approx(8.0)


def test_of_records_five_of_seven_names_are_told():
    made = np.zeros(9, dtype=[(f"part_{k}", float) for k in range(7)])
    unusable = {}
    assert channels_of([Variable("r", made.shape, made.dtype, made.__getitem__, "")], unusable) == ()
    assert unusable == {
        "r": "holds records of part_0, part_1, part_2, part_3, part_4; save each of these as an array of its own"
    }


def test_of_a_file_of_whole_arrays_alone_five_reasons_are_told_of_what_is_no_channel(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, cube=np.zeros((300, 2, 3)), **{f"n{k}": np.array(f"text {k}") for k in range(7)})
    whole = (
        "'cube' is an array of shape (300, 2, 3): name one channel of it with an index for each axis but the samples', "
        "'cube[0, 0]', or read it whole by saying what each axis is: --axes (axes), such as "
        "samples,channels,realisations,periods"
    )
    texts = "; ".join(f"'n{k}' holds text, not real numbers; save numbers, or name another" for k in range(4))
    assert refusal(path, 3, 1, RATE_HZ) == (
        f"{path}: there is no input channel 3: the NumPy file has 0 channels, numbered from 0 ({whole}; {texts})."
    )


@pytest.mark.parametrize(("wanted", "nearest"), [("gama", "GAMMA"), ("BETTA", "beta"), ("ALPH", "Alpha"), ("Q", "")])
def test_the_nearest_name_is_found_in_small_and_large_letters(tmp_path, wanted, nearest):
    path = tmp_path / "a.npz"
    np.savez(path, Alpha=DRIVE, beta=OUTPUT, GAMMA=OUTPUT)
    listed = "The channels are 'Alpha', 'beta', 'GAMMA'; a number counted from 0 does as well."
    message = refusal(path, 0, wanted, RATE_HZ)
    assert message.startswith(f"{path}: no output channel is named '{wanted}'; ") and message.endswith(listed)
    assert not nearest or f"'; the nearest is '{nearest}'. The" in message


@pytest.mark.parametrize(
    ("wanted", "named"), [("y[0]", "run/y[0]"), ("run/y[0]", "run/y[0]"), ("y[1]", "run/y"), ("z[3, 1]", "run/z")]
)
def test_what_is_no_channel_is_told_by_its_whole_name_before_that_of_its_array(tmp_path, wanted, named):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["u"], file["run/y[0]"], file["run/y"], file["run/z"] = DRIVE, DRIVE + 1j, DRIVE > 6, np.array([b"a", b"b"])
    reason = {"run/y[0]": "holds complex numbers", "run/y": "holds booleans", "run/z": "holds text"}[named]
    message = refusal(path, "u", wanted, RATE_HZ)
    assert message.startswith(f"{path}: the output '{wanted}' is no channel: '{named}' {reason}, not real numbers; ")


def test_the_time_of_channels_is_the_first_of_their_length_that_is_not_used_itself():
    lengths = {"time": 7, "y": 5, "t": 5, "g/time_ms": 5, "z": 7}
    channels = tuple(Channel(name, samples, lambda: np.zeros(1)) for name, samples in lengths.items())
    source = Container(Path("a"), "HDF5", channels, "")
    assert [source.find_time(used) for used in ([1], [4], [1, 2], [2], [3, 1], [0], [4, 1], [1, 4], [1, 2, 3])] == [
        *(2, 0, 3, 3, 2, None, 0, 2, None)
    ]
    assert source.samples() == (7, 5, 5, 5, 7)


def test_a_rate_of_several_channels_is_stated_once_and_each_other_one_in_their_order():
    rates = {"": StatedRate(1.0, "all"), "b": StatedRate(2.0, "b"), "b/x": StatedRate(3.0, "x")}
    own = StatedRate(4.0, "own")
    names = {"b/y": None, "b/z": None, "b/x[2]": None, "c/d": None, "b/w": own, "e": own}
    channels = tuple(Channel(name, 5, lambda: np.zeros(1), "", rate) for name, rate in names.items())
    source = Container(Path("a"), "HDF5", channels, "", {}, {name: (rate,) for name, rate in rates.items()})
    assert [rate.words for rate in source.rates(range(6))] == ["b", "x", "all", "own"]
    assert [rate.words for rate in source.rates([5, 3, 0, 1])] == ["own", "all", "b"]


@pytest.mark.parametrize(
    ("error", "said"),
    [(OSError("first\nsecond"), "first"), (KeyError(), "KeyError"), (ValueError(""), "ValueError"), (OSError(5), "5")],
)
def test_of_what_a_library_says_of_a_file_the_first_line_is_told(error, said):
    assert str(damaged(Path("a.h5"), "an HDF5 file", error)) == (
        f"a.h5: this cannot be read as an HDF5 file ({said}); the file is damaged or truncated: copy it again from its "
        "source."
    )


def test_samples_of_a_square_array_run_along_its_first_axis():
    values = np.arange(36.0).reshape(6, 6)
    made = [Variable("a", values.shape, values.dtype, values.__getitem__, "V")]
    found = channels_of(made, {})
    assert [(each.name, each.samples, each.unit) for each in found] == [(f"a[{k}]", 6, "V") for k in range(6)]
    assert [each.load().tolist() for each in found] == values.T.tolist()
    cube = np.arange(75.0).reshape(3, 5, 5)
    source = Container(Path("a"), "NumPy", found, "")
    one = indexed(source, [Variable("c", cube.shape, cube.dtype, cube.__getitem__, "")], "c[2, 4]")
    assert one.load().tolist() == cube[2, :, 4].tolist() and one.samples == 5
