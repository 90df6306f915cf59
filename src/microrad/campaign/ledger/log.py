"""The write-ahead log that a killed writer leaves beside its ledger: damage in it, and what of it is whole.

SQLite ends a log at the first frame whose checksum is wrong, as if nothing came behind it, and deletes the file once it
is read (SQLite, Database File Format, 4). So the log is looked at before SQLite opens the ledger: a transaction whose
last frame is missing was never finished, and one that is behind the end although it was finished is lost by damage.
"""

import os
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

PAGE = 4096
LEAF = 13  # the first byte of a page that is a leaf of a table (1.6)
_HEADER = struct.Struct(">8I")  # magic number, version, size of a page, number of checkpoints, two salts, two sums
_FRAME = 24  # bytes before the page: its number, pages of the file at the end of a transaction, two salts, two sums
_MAGIC, _VERSION = 0x377F0682, 3007000  # the magic number's last bit: the sums are over big-endian words


class Log(NamedTuple):
    """The frames of a log, each with one page.

    ``number`` (frames,) is that of the page, ``ends`` whether a transaction ends with the frame. ``ours``: it is of
    this log, not left over from one before; ``sound``: its checksum, which goes on from the frame before, is right.
    SQLite takes the first ``taken`` frames.
    """

    number: NDArray[Any]
    image: NDArray[np.uint8]
    ends: NDArray[np.bool_]
    ours: NDArray[np.bool_]
    sound: NDArray[np.bool_]
    taken: int

    @property
    def lost(self) -> int:
        """Transactions that were finished and that SQLite does not take."""
        return int(np.count_nonzero((self.ours & self.ends)[self.taken :]))


def read(path: Path) -> Log | None:
    """The log in a file that nobody writes to; None where it has no frame."""
    data = path.read_bytes() if path.is_file() else b""
    count = (len(data) - _HEADER.size) // (_FRAME + PAGE)
    if count < 1:
        return None
    magic, version, size, _, *salts, first, second = _HEADER.unpack_from(data)
    order = ">u4" if magic & 1 else "<u4"
    raw = np.frombuffer(data, np.uint8, count * (_FRAME + PAGE), _HEADER.size).reshape(count, -1)
    number, pages, salt_1, salt_2, *sums = np.ascontiguousarray(raw[:, :_FRAME]).view(">u4").T.astype(np.uint32)
    begun = _sums(np.frombuffer(data, order, 6)[None], np.zeros(1, np.uint32), np.zeros(1, np.uint32))
    known = (magic & ~1, version, size, *(int(each[0]) for each in begun)) == (_MAGIC, _VERSION, PAGE, first, second)
    if not known:
        salts = [int(salt_1[0]), int(salt_2[0])]
    words = np.hstack([raw[:, :8], raw[:, _FRAME:]]).view(order)
    before = (np.append(np.uint32(start), each[:-1]) for start, each in zip((first, second), sums, strict=True))
    right = np.all([a == b for a, b in zip(_sums(words, *before), sums, strict=True)], axis=0)
    same = [salt_1 == salts[0], salt_2 == salts[1]]
    sound = np.all(same, axis=0) & right & (number > 0)
    taken = int(np.argmin(np.append(sound, False))) if known else 0
    return Log(number, raw[:, _FRAME:], pages > 0, np.any(same, axis=0), sound, taken)


def _sums(words: NDArray[Any], one: NDArray[np.uint32], two: NDArray[np.uint32]) -> list[NDArray[np.uint32]]:
    """The two sums of SQLite over each row of words, which go on from those before."""
    columns = words.astype(np.uint32).T
    for first, second in zip(columns[::2], columns[1::2], strict=True):
        one = one + first + two
        two = two + second + one
    return [one, two]


def damage(path: Path) -> str:
    """What is wrong with the log in a file that nobody writes to, in words; "" where nothing is."""
    log = read(path)
    if log is None or not log.lost:
        return ""
    at = _HEADER.size + log.taken * (_FRAME + PAGE) if log.taken else 0
    return (
        f"its log {path.name} is damaged from byte {at} on, and SQLite would leave out {log.lost} of the "
        f"{int(np.count_nonzero(log.ours & log.ends))} finished transactions in it without a word"
    )


def replay(path: Path, ledger: Path) -> None:
    """Write each page of which the log in a file has a sound frame into a ledger, the last such frame of each.

    Behind damage, leaves that were written over later come to the end of the file: they may have what is lost since.
    """
    log = read(path)
    if log is None or not np.any(log.ours & log.ends):
        return
    most = ledger.stat().st_size // PAGE + log.number.size  # pages that there can be
    finished = np.flatnonzero(log.ours & log.ends)
    with ledger.open("r+b") as file:
        for frame in np.flatnonzero(log.sound & (log.number <= most)):
            if frame <= finished[-1]:
                file.seek((int(log.number[frame]) - 1) * PAGE)
                file.write(log.image[frame].tobytes())
        if log.lost:
            file.seek(0, os.SEEK_END)
            file.write(log.image[log.sound & (log.image[:, 0] == LEAF)].tobytes())
