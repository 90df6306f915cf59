"""The reader of MATLAB files: what SciPy reads of the same files it reads as well, and damage is refused in words."""

import struct
import tracemalloc
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.io import loadmat, savemat
from scipy.sparse import csc_array

from microrad.core.matlab_file import Left, MatlabFile, MatlabFileError, Structure, Unread, reader, streams

MOST_BYTES = 10_000_000
N = 100
RNG = np.random.Generator(np.random.Philox(5))


def structures():
    made = np.zeros((1, 3), dtype=[("Name", object), ("Data", object)])
    for k in range(3):
        made[0, k] = (f"channel {k}", RNG.standard_normal(N))
    return made


def cells():
    made = np.empty((2, 2), dtype=object)
    made[:] = [[np.arange(3.0), "text"], [{"in": 1.0}, np.zeros((0, 0))]]
    return made


VARIABLES = {
    "drive": RNG.standard_normal(N),
    "matrix": RNG.standard_normal((N, 3)),
    "axes": RNG.standard_normal((N, 2, 3)),
    "single": RNG.standard_normal(N).astype(np.float32),
    **{f"i{kind}": RNG.integers(0, 100, N).astype(kind) for kind in ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")},
    "both": RNG.standard_normal(N) + 1j * RNG.standard_normal(N),
    "logical": RNG.random(N) > 0.5,
    "fs": 2000.0,
    "special": np.array([np.nan, np.inf, -np.inf, 1e-320, -0.0]),
    "nothing": np.zeros((0, 3)),
    "note": "µrad, 鏡",
    "run": {"drive": RNG.standard_normal(N), "in": {"t": np.arange(N) / 2e3, "dt": 5e-4}, "unit": "V"},
    "channels": structures(),
    "cells": cells(),
}


def same(ours, theirs):
    """Hold a variable against what SciPy made of it, to the last bit."""
    if isinstance(ours, str):
        assert ours == "".join(theirs.ravel().tolist())
    elif isinstance(ours, Structure):
        assert (ours.size, ours.names) == (theirs.size, theirs.dtype.names)
        for element, other in zip(ours.elements, theirs.ravel(order="F"), strict=True):
            for name in ours.names:
                same(element[name], other[name])
    elif ours.dtype == object:
        assert ours.shape == theirs.shape
        for one, other in zip(ours.ravel(), theirs.ravel(), strict=True):
            same(one, other)
    else:
        assert ours.dtype in (float, complex, bool)
        np.testing.assert_array_equal(ours, theirs.astype(bool) if ours.dtype == bool else theirs, strict=False)
        assert ours.shape == theirs.shape


@pytest.fixture(scope="module", params=[False, True], ids=["stored", "compressed"])
def saved(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("mat") / "all.mat"
    savemat(path, VARIABLES, do_compression=request.param, oned_as="column", long_field_names=True)
    return path, {name: value for name, value in loadmat(path).items() if not name.startswith("__")}


def test_a_whole_file_is_what_scipy_reads(saved):
    path, theirs = saved
    ours = MatlabFile(path, MOST_BYTES, whole=True).variables
    assert list(ours) == list(theirs) == list(VARIABLES)
    for name, value in ours.items():
        same(value, theirs[name])
    np.testing.assert_array_equal(ours["matrix"], VARIABLES["matrix"])
    assert ours["note"] == VARIABLES["note"]
    assert ours["logical"].dtype == bool
    assert ours["run"].fields["in"].fields["dt"].item() == 5e-4


def test_numbers_that_are_left_are_read_one_by_one(saved):
    path, theirs = saved
    file = MatlabFile(path, MOST_BYTES)
    left = {name: value for name, value in file.variables.items() if isinstance(value, Left)}
    assert set(left) == set(VARIABLES) - {"fs", "special", "nothing", "note", "run", "channels", "cells"}
    for name, value in left.items():
        assert value.shape == theirs[name].shape
        np.testing.assert_array_equal(file.numbers(value), theirs[name])
    inner = file.variables["run"].fields
    np.testing.assert_array_equal(file.numbers(inner["in"].fields["t"])[:, 0], VARIABLES["run"]["in"]["t"])
    last = file.variables["channels"].elements[2]["Data"]
    np.testing.assert_array_equal(file.numbers(last), theirs["channels"][0, 2]["Data"])
    assert (left["both"].dtype, left["logical"].dtype, left["ii2"].dtype) == (complex, bool, float)
    assert file.variables["cells"].kind == "cells" and file.variables["note"].kind == "text"


def test_files_that_matlab_wrote_are_what_scipy_reads():
    """The collection that SciPy tests itself with: MATLAB 5.3 to 8 on four systems, two of them big-endian."""
    folder = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
    paths = [path for path in folder.glob("*.mat") if path.read_bytes()[126:128] in (b"IM", b"MI")]
    if not paths:
        pytest.skip("SciPy was installed without its tests")
    read, refused, orders = 0, set(), set()
    for path in paths:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                theirs = loadmat(path)
        except Exception:
            theirs = None
        try:
            ours = MatlabFile(path, MOST_BYTES, whole=True).variables
        except MatlabFileError:
            refused.add(path.name)
            assert theirs is None
            continue
        for name, value in ours.items():
            if theirs and not isinstance(value, Unread) and "duplicate" not in path.name and "empty" not in path.name:
                same(value, theirs[name])
                read += 1
                orders.add(path.read_bytes()[126:128])
    assert {"corrupted_zlib_checksum.mat", "corrupted_zlib_data.mat", "malformed1.mat"} <= refused
    assert read > 40 and orders == {b"IM", b"MI"}


# ------------------------------------------------------------------------------------------------------- made by hand
def element(order, kind, data):
    return struct.pack(f"{order}II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix(order, kind, shape, name, *parts, flags=0):
    head = element(order, 6, struct.pack(f"{order}II", kind | flags << 8, 0))
    head += element(order, 5, struct.pack(f"{order}{len(shape)}i", *shape)) + element(order, 1, name)
    return element(order, 14, head + b"".join(parts))


def write(path, order, *elements, compressed=False):
    mark = b"\x00\x01IM" if order == "<" else b"\x01\x00MI"
    if compressed:
        packed = [zlib.compress(each) for each in elements]
        elements = [struct.pack(f"{order}II", 15, len(each)) + each for each in packed]
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + mark + b"".join(elements))
    return path


def doubles(order, values):
    return element(order, 9, np.asarray(values, f"{order}f8").tobytes())


UTF_16 = {"<": "utf-16-le", ">": "utf-16-be"}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("compressed", [False, True])
def test_both_byte_orders_are_what_scipy_reads(tmp_path, order, compressed):
    values = RNG.standard_normal(60)
    small = struct.pack(f"{order}HHhh", *((3, 4) if order == "<" else (4, 3)), -7, 8)  # stands in its tag
    inner = matrix(order, 6, (3, 20), b"", doubles(order, values))
    names = element(order, 5, struct.pack(f"{order}i", 32)) + element(order, 1, b"y".ljust(32, b"\0"))
    path = write(
        tmp_path / "a.mat",
        order,
        matrix(order, 6, (20, 3), b"x", doubles(order, values)),
        matrix(order, 6, (30, 1), b"z", doubles(order, values[:30]), doubles(order, values[30:]), flags=0x08),
        matrix(order, 6, (1, 2), b"small", small),  # doubles that MATLAB keeps as whole numbers
        matrix(order, 9, (1, 60), b"l", element(order, 2, bytes([0, 1] * 30)), flags=0x02),
        matrix(
            order, 4, (1, 3), b"text", element(order, 17, "µ鏡!".encode(f"utf-16-{'le' if order == '<' else 'be'}"))
        ),
        matrix(order, 2, (1, 1), b"s", names, inner),
        compressed=compressed,
    )
    theirs = loadmat(path)
    for name, value in MatlabFile(path, MOST_BYTES, whole=True).variables.items():
        same(value, theirs[name])
    file = MatlabFile(path, MOST_BYTES)
    np.testing.assert_array_equal(file.numbers(file.variables["x"]), values.reshape(3, 20).T)
    np.testing.assert_array_equal(file.numbers(file.variables["z"])[:, 0], values[:30] + 1j * values[30:])
    np.testing.assert_array_equal(file.numbers(file.variables["s"].fields["y"]), theirs["s"]["y"].item())
    assert file.variables["small"].tolist() == [[-7.0, 8.0]]


def test_what_is_not_read_is_said(tmp_path):
    savemat(tmp_path / "a.mat", {"sparse": csc_array(np.eye(30))})
    assert MatlabFile(tmp_path / "a.mat", MOST_BYTES).variables["sparse"] == Unread(
        "a sparse matrix", "save it as full"
    )
    opaque = element("<", 14, element("<", 6, struct.pack("<II", 17, 0)) + element("<", 1, b"run") + bytes(64))
    odd = matrix("<", 77, (1, 1), b"odd", bytes(16))
    path = write(tmp_path / "b.mat", "<", opaque, odd, matrix("<", 16, (1, 1), b"f", bytes(16)))
    found = MatlabFile(path, MOST_BYTES, whole=True).variables
    assert [found[name].kind for name in ("run", "f")] == ["an object of MATLAB", "a function"]
    assert found["odd"].kind == "data of a kind that is not known"


def test_a_signalling_nan_is_a_nan(tmp_path):
    nan = element("<", 7, struct.pack("<20I", *[0x7FA00000] * 20))
    file = MatlabFile(write(tmp_path / "a.mat", "<", matrix("<", 7, (20, 1), b"x", nan)), MOST_BYTES)
    assert np.isnan(file.numbers(file.variables["x"])).all()


def test_names_that_stand_twice_are_told_apart(tmp_path):
    first, second = (matrix("<", 6, (1, 1), b"y", doubles("<", [value])) for value in (1.0, 2.0))
    names = element("<", 5, struct.pack("<i", 4)) + element("<", 1, b"u\0\0\0u\0\0\0")
    fields = [matrix("<", 6, (1, 1), b"", doubles("<", [value])) for value in (3.0, 4.0)]
    path = write(tmp_path / "a.mat", "<", first, second, matrix("<", 2, (1, 1), b"s", names, *fields))
    found = MatlabFile(path, MOST_BYTES).variables
    assert (found["y"].item(), found["_1_y"].item()) == (1.0, 2.0)
    assert {name: value.item() for name, value in found["s"].fields.items()} == {"u": 3.0, "_1_u": 4.0}


# ------------------------------------------------------------------------------------------------------------- refusals
def refused(path, **how):
    with pytest.raises(MatlabFileError) as caught:
        MatlabFile(path, how.pop("most_bytes", MOST_BYTES), **how)
    return str(caught.value), caught.value.remedy


@pytest.mark.parametrize(
    ("data", "why", "remedy"),
    [
        (struct.pack("<5i", 0, 10, 1, 0, 2) + b"x\0" + bytes(200), "of version 4", "save it with -v7"),
        (b"RIFF" * 50, "no header of version 5", ""),
        (element("<", 5, bytes(8)), "the variable at byte 128: a variable of type 5", ""),
        (matrix("<", 6, (10, 1), b"x", doubles("<", range(10)))[:-9], "an element is cut off, 9 bytes", ""),
        (matrix("<", 6, (10, 1), b"x", doubles("<", range(9))), "72 bytes where 10 numbers of 8 bytes", ""),
        (matrix("<", 6, (1 << 30, 1 << 30), b"x", doubles("<", range(9))), "72 bytes where 115292150460684", ""),
        (matrix("<", 6, (-1, 3), b"x", doubles("<", range(9))), r"an array of shape \(-1, 3\)", ""),
        (matrix("<", 6, (3, 3), b"x", element("<", 8, bytes(72))), "numbers of type 8", ""),
        (matrix("<", 6, (1,) * 33, b"x", doubles("<", [1])), "a header of 132 bytes where at most 128", ""),
        (matrix("<", 6, (1, 1), b"x" * 5000, doubles("<", [1])), "a header of 5000 bytes where at most 4096", ""),
        (matrix("<", 6, (1, 1), b"x", element("<", 8, b"")), "numbers of type 8", ""),
        (element("<", 14, element("<", 6, b"")), "a header of type 6 with 0 bytes", ""),
        (element("<", 14, element("<", 6, bytes(8)) + element("<", 5, bytes(6))), "header of type 5 with 6 bytes", ""),
        (matrix("<", 1, (1 << 30, 1 << 30), b"c"), "an element is cut off", ""),
        (matrix("<", 2, (1, 1), b"s", element("<", 5, bytes(4)), element("<", 1, b"abc")), "have no names", ""),
        (struct.pack("<II", 15, 5) + b"wrong", "incorrect header check", ""),
    ],
)
def test_damage_is_named(tmp_path, data, why, remedy):
    path = write(tmp_path / "a.mat", "<", data) if data[0] not in b"\0R" else tmp_path / "a.mat"
    if not path.exists():
        path.write_bytes(data)
    with pytest.raises(MatlabFileError, match=why) as caught:
        MatlabFile(path, MOST_BYTES, whole=True)
    assert remedy in caught.value.remedy and bool(remedy) == bool(caught.value.remedy)


def test_a_structure_without_fields_is_read(tmp_path):
    nameless = matrix("<", 2, (1, 1), b"s", element("<", 5, bytes(4)), element("<", 1, b""))
    assert MatlabFile(write(tmp_path / "a.mat", "<", nameless), MOST_BYTES).variables["s"] == Structure(1, (), ())


@pytest.mark.parametrize(("count", "left"), [(16, False), (17, True)])
def test_short_arrays_are_read_with_the_list_and_longer_ones_left(tmp_path, count, left):
    path = write(tmp_path / "a.mat", "<", matrix("<", 6, (count, 1), b"x", doubles("<", range(count))))
    file = MatlabFile(path, MOST_BYTES)
    assert isinstance(file.variables["x"], Left) == left
    values = file.numbers(file.variables["x"]) if left else file.variables["x"]
    np.testing.assert_array_equal(values[:, 0], np.arange(float(count)))


def test_text_of_which_nothing_is_there_is_empty(tmp_path):
    data = matrix("<", 4, (0, 0), b"nothing"), matrix("<", 4, (0, 0), b"empty", element("<", 1, b""))
    assert MatlabFile(write(tmp_path / "a.mat", "<", *data), MOST_BYTES, whole=True).variables == {
        "nothing": "",
        "empty": "",
    }


@pytest.mark.parametrize("fields", [3, 4])
def test_a_structure_has_so_many_names_of_fields_and_no_more(tmp_path, monkeypatch, fields):
    monkeypatch.setattr(reader, "MOST_ARRAYS", 3)
    names = b"".join(f"f{k}".encode().ljust(8, b"\0") for k in range(fields))
    data = matrix("<", 2, (0, 0), b"s", element("<", 5, struct.pack("<i", 8)), element("<", 1, names))
    path = write(tmp_path / "a.mat", "<", data)
    if fields == 3:
        assert MatlabFile(path, MOST_BYTES).variables["s"] == Structure(0, ("f0", "f1", "f2"), ())
    else:
        why, remedy = refused(path)
        assert "it holds more than 3 arrays" in why and remedy == "save the arrays that are needed alone"


@pytest.mark.parametrize("beyond", [0, 1])
def test_packed_data_may_fill_what_they_may_unpack_to(tmp_path, beyond):
    data = matrix("<", 6, (200, 1), b"x", doubles("<", np.arange(200.0)))
    path = write(tmp_path / "a.mat", "<", data, compressed=True)
    if beyond:
        assert "unpacks to more than" in refused(path, most_bytes=len(data) - 1, whole=True)[0]
    else:
        assert MatlabFile(path, len(data), whole=True).variables["x"].shape == (200, 1)


def test_a_file_that_gets_shorter_is_refused_when_its_numbers_are_read(tmp_path):
    values = np.arange(200.0)
    path = write(tmp_path / "a.mat", "<", matrix("<", 6, (200, 1), b"x", doubles("<", values)))
    file, whole = MatlabFile(path, MOST_BYTES), path.read_bytes()
    path.write_bytes(whole[:-9])
    with pytest.raises(MatlabFileError, match="an element is cut off, 9 bytes"):
        file.numbers(file.variables["x"])
    path.write_bytes(whole)
    np.testing.assert_array_equal(file.numbers(file.variables["x"])[:, 0], values)


def test_packed_data_that_end_too_early_are_refused(tmp_path, monkeypatch):
    data = matrix("<", 6, (200, 1), b"x", doubles("<", np.arange(200.0)))
    for chunk in (1, 1 << 16):  # the first bytes alone unpack to nothing
        monkeypatch.setattr(streams, "_CHUNK", chunk)
        whole = write(tmp_path / "a.mat", "<", data, compressed=True)
        np.testing.assert_array_equal(MatlabFile(whole, MOST_BYTES, whole=True).variables["x"][:, 0], np.arange(200.0))
        assert "compressed data are cut off" in refused(write(whole, "<", data[:-9], compressed=True), whole=True)[0]


def test_a_checksum_that_fails_is_refused_when_the_numbers_are_read(tmp_path, monkeypatch):
    values = np.arange(20_000.0) % 7
    path = write(tmp_path / "a.mat", "<", matrix("<", 6, (20_000, 1), b"x", doubles("<", values)), compressed=True)
    data = path.read_bytes()
    path.write_bytes(data[:-2] + bytes([data[-2] ^ 1]) + data[-1:])
    for chunk in (1 << 16, len(data) - 138):  # in the latter the checksum is not met on the way
        monkeypatch.setattr(streams, "_CHUNK", chunk)
        file = MatlabFile(path, MOST_BYTES)
        with pytest.raises(MatlabFileError, match=r"the variable at byte 128: .*incorrect data check"):
            file.numbers(file.variables["x"])
    path.write_bytes(data[:128] + struct.pack("<II", 15, len(data) - 146) + data[136:-10])
    with pytest.raises(MatlabFileError, match="its compressed data are cut off"):
        file.numbers(file.variables["x"])


def peak_bytes(call):
    tracemalloc.start()
    try:
        found = call()
        return found, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_bomb_takes_no_memory(tmp_path):
    """Zeros, packed a thousand times: named by what they claim, and not unpacked to be listed."""
    data = matrix("<", 6, (1_000_000, 1), b"x", doubles("<", np.zeros(1_000_000)))
    path = write(tmp_path / "a.mat", "<", data, compressed=True)
    assert path.stat().st_size < 10_000
    file, peak = peak_bytes(lambda: MatlabFile(path, MOST_BYTES))
    assert peak < 1_000_000
    values, peak = peak_bytes(lambda: file.numbers(file.variables["x"]))
    assert (values.size, values.any()) == (1_000_000, False)
    assert 8_000_000 <= peak < 30_000_000
    (why, remedy), peak = peak_bytes(lambda: refused(path, most_bytes=7_000_000))
    assert "unpacks to more than 7000000 bytes" in why and "without compression (-v6)" in remedy
    assert peak < 1_000_000
    twice = data, data.replace(b"x\0", b"z\0")
    MatlabFile(write(path, "<", *twice, compressed=True), 17_000_000, whole=True)
    with pytest.raises(MatlabFileError, match="unpacks to more than"):
        MatlabFile(path, 15_000_000, whole=True)
    behind = matrix("<", 6, (1, 1), b"x", doubles("<", [1.0])) + bytes(11_000_000)
    assert "unpacks to more than 10000000 bytes" in refused(write(path, "<", behind, compressed=True))[0]
    claim = data[:8] + data[8:].replace(struct.pack("<I", 8_000_000), struct.pack("<I", 8_000_008))
    write(path, "<", claim.replace(struct.pack("<ii", 1_000_000, 1), struct.pack("<ii", 1_000_001, 1)), compressed=True)
    assert "an element is cut off, 8 bytes" in refused(path)[0]


def test_the_number_and_the_depth_of_arrays_are_bounded(tmp_path, monkeypatch):
    data = b""
    for depth in range(1, 20):
        data = matrix("<", 1, (1, 1), b"c", data if data else matrix("<", 6, (1, 1), b"", doubles("<", [1])))
        path = write(tmp_path / "a.mat", "<", data)
        if depth < 16:
            assert MatlabFile(path, MOST_BYTES, whole=True).variables["c"].shape == (1, 1)
        else:
            assert "nest deeper than 16" in refused(path, whole=True)[0]
    monkeypatch.setattr(reader, "MOST_ARRAYS", 20)
    empty = struct.pack("<II", 14, 0)
    for count in (19, 20):
        path = write(tmp_path / "a.mat", "<", matrix("<", 1, (count, 1), b"c", empty * count))
        if count == 19:
            assert MatlabFile(path, MOST_BYTES, whole=True).variables["c"].shape == (19, 1)
    assert "it holds more than 20 arrays" in refused(path, whole=True)[0]
    names = element("<", 5, struct.pack("<i", 2)) + element("<", 1, b"u\0" * 21)
    assert "more than 20 arrays" in refused(write(path, "<", matrix("<", 2, (1, 1), b"s", names)))[0]


def damaged(whole, rng):
    """A file with flipped bits, absurd sizes, swapped words or its end cut off."""
    data = bytearray(whole)
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(128, len(data)))
        match rng.integers(4):
            case 0:
                data[place] ^= 1 << rng.integers(8)
            case 1:
                word = rng.choice([0, 1, 5, 14, 15, 17, 0x00040001, 1 << 24, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF])
                data[place // 4 * 4 : place // 4 * 4 + 4] = struct.pack("<I", word)
            case 2:
                other = int(rng.integers(128, len(data)))
                data[place : place + 8] = data[other : other + 8]
            case _ if rng.random() < 0.3:
                del data[place:]
    return bytes(data)


def test_random_damage_is_refused_or_read_and_nothing_else(saved, tmp_path):
    """SciPy's reader ends the process on some of these, or asks for all of the memory."""
    path, rng = tmp_path / "a.mat", np.random.default_rng(7)
    whole = saved[0].read_bytes()
    seen, reasons = {"read": 0, "refused": 0}, set()
    tracemalloc.start()
    for _ in range(50):
        path.write_bytes(damaged(whole, rng))
        try:
            MatlabFile(path, MOST_BYTES, whole=True)
            file = MatlabFile(path, MOST_BYTES)
            for value in file.variables.values():
                if isinstance(value, Left):
                    file.numbers(value)
            seen["read"] += 1
        except MatlabFileError as error:
            seen["refused"] += 1
            reasons.add(str(error).split(": ")[-1].split(" ")[0])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert min(seen.values()) > 0 and len(reasons) > 2
    assert peak < 3_000_000


# ---------------------------------------------------------------------------------------- kinds, places and encodings
KINDS = {
    1: ("cells", "save the numbers of each cell as an array"), 4: ("text", "save numbers"),
    3: ("an object of MATLAB", "only MATLAB reads it: save its numbers as arrays"), 16: ("a function", "save numbers"),
    5: ("a sparse matrix", "save it as full"), 18: ("data of a kind that is not known", "save numbers"),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("order", ["<", ">"])
def test_what_is_not_read_says_its_kind_and_remedy_and_what_stands_behind_it_is_read(tmp_path, kind, order):
    behind = matrix(order, 6, (1, 2), b"x", doubles(order, [3.0, -4.5]))
    path = write(tmp_path / "a.mat", order, matrix(order, kind, (2, 2), b"odd", bytes(64)), behind)
    found = MatlabFile(path, MOST_BYTES).variables
    assert [*found] == ["odd", "x"] and found["x"].tolist() == [[3.0, -4.5]]
    assert (found["odd"].kind, found["odd"].remedy) == KINDS[kind]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("kind", "bits"), [(1, 8), (2, 8), (4, 16), (16, 8), (17, 16), (18, 32)])
def test_text_is_read_in_each_encoding_and_order_and_several_lines_are_not(tmp_path, order, kind, bits):
    text, ends = "µ鏡 b", "-le" if order == "<" else "-be"
    data = text.encode(f"utf-{bits}" + ends * (bits > 8))
    one, several = (
        matrix(order, 4, (rows, 4), name, element(order, kind, data)) for rows, name in ((1, b"t"), (2, b"u"))
    )
    found = MatlabFile(write(tmp_path / "a.mat", order, one, several), MOST_BYTES, whole=True).variables
    assert found["t"] == text
    assert (found["u"].kind, found["u"].remedy) == ("text of several lines", "save it as cells of one line each")


NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("flags", [0, 8, 2, 10], ids=["plain", "complex", "logical", "both"])
def test_numbers_of_each_type_are_floats_in_columns_complex_before_logical(tmp_path, order, flags):
    real, imaginary = np.array([7, 0, 2, 0, 5, 9]), np.array([1, 3, 0, 0, 8, 4])
    parts = {
        k: [element(order, k, x.astype(order + code).tobytes()) for x in (real, imaginary)]
        for k, code in NUMBERS.items()
    }
    made = [
        matrix(order, 8, (2, 3), f"v{k}".encode(), *both[: 1 + flags // 8], flags=flags) for k, both in parts.items()
    ]
    found = MatlabFile(write(tmp_path / "a.mat", order, *made), MOST_BYTES).variables
    values = real + 1j * imaginary if flags & 8 else real != 0 if flags else real
    assert [*found] == [f"v{kind}" for kind in NUMBERS]
    for each in found.values():
        assert each.dtype == (complex if flags & 8 else bool if flags else float)
        np.testing.assert_array_equal(each, values.reshape(3, 2).T)


@pytest.mark.parametrize("packed", [False, True])
def test_damage_of_the_second_variable_says_at_which_byte_it_begins(tmp_path, packed):
    first = matrix("<", 6, (2, 2), b"x", doubles("<", range(4)))
    bad = matrix("<", 6, (3, 1), b"y", doubles("<", range(2)))
    path = write(tmp_path / "a.mat", "<", first, bad, compressed=packed)
    at = 128 + (8 + len(zlib.compress(first)) if packed else len(first))
    assert refused(path) == (f"the variable at byte {at}: 16 bytes where 3 numbers of 8 bytes are said to be", "")


@pytest.mark.parametrize(
    ("data", "words", "remedy"),
    [
        (b"\0abc", "it is of version 4 or none of MATLAB", "load it in MATLAB and save it with -v7"),
        (b"abc\0", "it is of version 4 or none of MATLAB", "load it in MATLAB and save it with -v7"),
        (b"abcd\0", "it has no header of version 5", ""), (b"", "it has no header of version 5", ""),
    ],
)  # fmt: skip
def test_a_file_of_another_version_is_told_by_its_first_four_bytes(tmp_path, data, words, remedy):
    (tmp_path / "a.mat").write_bytes(data + b"x" * (200 if data else 0))
    assert refused(tmp_path / "a.mat") == (words, remedy)


def test_names_that_stand_three_times_count_on_and_a_structure_of_none_or_two_has_its_names_alone(tmp_path):
    def structure(size, name):
        names = element("<", 5, struct.pack("<i", 8)) + element("<", 1, b"first\0\0\0second\0\0")
        fields = [matrix("<", 6, (1, 1), b"", doubles("<", [value])) for value in range(2 * size)]
        return matrix("<", 2, (1, size), name, names, *fields)

    same = [matrix("<", 6, (1, 1), b"y\0junk", doubles("<", [value])) for value in (1.0, 2.0, 3.0)]
    path = write(tmp_path / "a.mat", "<", *same, *(structure(n, f"s{n}".encode()) for n in (0, 1, 2)))
    found = MatlabFile(path, MOST_BYTES).variables
    assert [float(found[name].item()) for name in ("y", "_1_y", "_2_y")] == [1.0, 2.0, 3.0]
    assert found["s0"].fields == found["s2"].fields == {"first": None, "second": None}
    assert {name: each.item() for name, each in found["s1"].fields.items()} == {"first": 0.0, "second": 1.0}
    assert [[each.item() for each in one.values()] for one in found["s2"].elements] == [[0.0, 1.0], [2.0, 3.0]]


def test_numbers_left_of_a_second_variable_are_read_from_their_own_place_and_its_damage_named(tmp_path):
    made = [matrix("<", 6, (20, 2), name, doubles("<", np.arange(40.0) + k)) for k, name in ((100, b"a"), (700, b"b"))]
    file = MatlabFile(write(tmp_path / "a.mat", "<", *made), MOST_BYTES)
    b = file.variables["b"]
    assert (b.shape, b.variable) == ((20, 2), 128 + len(made[0]))
    np.testing.assert_array_equal(file.numbers(b), (np.arange(40.0) + 700).reshape(2, 20).T)
    (tmp_path / "a.mat").write_bytes((tmp_path / "a.mat").read_bytes()[:-11])
    with pytest.raises(MatlabFileError, match=f"^the variable at byte {b.variable}: an element is cut off, 11 b"):
        file.numbers(b)


def test_names_that_are_those_of_others_told_apart_stay_apart():
    assert reader._distinct(["x", "x", "_1_x", "x"]) == ("x", "_1_x", "_1__1_x", "_2_x")


def test_a_file_that_is_not_read_says_why_in_full_and_what_to_save(tmp_path, monkeypatch):
    whole, path = matrix("<", 6, (200, 1), b"x", doubles("<", np.arange(200.0))), tmp_path / "a.mat"
    where = "the variable at byte 128: "
    assert refused(write(path, "<", whole[:-9]), whole=True) == (
        f"{where}an element is cut off, 9 bytes of it are missing",
        "",
    )
    assert refused(write(path, "<", whole[:-9], compressed=True), whole=True) == (
        f"{where}its compressed data are cut off",
        "",
    )
    assert refused(write(path, "<", whole, compressed=True), most_bytes=len(whole) - 1, whole=True) == (
        f"{where}it unpacks to more than {len(whole) - 1} bytes",
        "save it without compression (-v6), or the part that is needed",
    )
    monkeypatch.setattr(reader, "MOST_ARRAYS", 3)
    cells = matrix("<", 1, (3, 1), b"c", struct.pack("<II", 14, 0) * 3)
    assert refused(write(path, "<", cells), whole=True) == (
        f"{where}it holds more than 3 arrays",
        "save the arrays that are needed alone",
    )


def test_a_bound_on_what_is_unpacked_is_none_on_the_file(tmp_path):
    """Two arrays of 800 bytes that are not compressed, read with a bound of 1000."""
    savemat(tmp_path / "a.mat", {"first": np.arange(100.0), "last": np.arange(100.0)})
    assert [*MatlabFile(tmp_path / "a.mat", 1000).variables] == ["first", "last"]
