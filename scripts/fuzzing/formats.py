"""Each format: how its bad inputs are made, and what takes them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np

from fuzzing import mutate, properties, seeds
from microrad.lab.recording import read_recording
from microrad.lab.recording.files import check_file
from microrad.lab.recording.formats.source import is_time_name
from microrad.lab.recording.reader import open_source
from microrad.mission.file import load_link
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.files import read_elements, read_oem
from microrad.orbit.files.elements import checksum

Mutate = Callable[[Random, Sequence[bytes]], bytes]
_EPOCH = Epoch("2026-03-20T12:00:00Z")


@dataclass(frozen=True, slots=True)
class FileFormat:
    """A format of files: its good ones, how they are changed, and what reads a path and checks what it finds there."""

    name: str
    suffix: str
    seeds: Callable[[], Sequence[bytes]]
    change: Mutate
    read: Callable[[Path], None]

    def made(self, draw: Random) -> bytes:
        """A bad file's content."""
        return self.change(draw, self.seeds())

    def take(self, made: bytes, folder: Path) -> None:
        """Write it, read it, and check what was read.

        Args:
            made: The content.
            folder: For the file.
        """
        path = folder / f"case{self.suffix}"
        path.write_bytes(made)
        self.read(path)


def _links(path: Path) -> None:
    properties.links(load_link(path))


def _recording(path: Path) -> None:
    """The first two channels that are no time, at some rate where the file says none."""
    check_file(path)
    source = open_source(path)
    used = [index for index, name in enumerate(source.names) if not is_time_name(name)][:2] or [0]
    is_timed = len(source.names) > used[-1] and (source.find_time(used) is not None or source.rates(used))
    properties.recording(read_recording(path, used[0], used[-1], None if is_timed else seeds.RATE_HZ))


def _elements(path: Path) -> None:
    properties.elements(read_elements(path))


def _ephemeris(path: Path) -> None:
    found = read_oem(path, _EPOCH)
    begin, end = found.span_s
    properties.orbit(found, np.linspace(begin, end, 9))


# ------------------------------------------------------------------------------------------------------------- changes
def _tle(draw: Random, given: Sequence[bytes]) -> bytes:
    """Two-line elements, mostly with checksums that fit what was changed."""
    made = mutate.text(draw, given)
    if draw.random() < 0.3:
        return made
    lines = made.decode("latin-1").split("\n")
    fits = [f"{line[:68]}{checksum(line)}{line[69:]}" if line[:2] in ("1 ", "2 ") else line for line in lines]
    return "\n".join(fits).encode("latin-1")


FORMATS = {
    each.name: each
    for each in (
        FileFormat("links", ".toml", seeds.links, mutate.text, _links),
        FileFormat("csv", ".csv", seeds.csv, mutate.text, _recording),
        FileFormat("tdms", ".tdms", seeds.tdms, mutate.binary, _recording),
        FileFormat("lvm", ".lvm", seeds.lvm, mutate.text, _recording),
        FileFormat("mat", ".mat", seeds.mat, mutate.binary, _recording),
        FileFormat("mat73", ".mat", seeds.mat73, mutate.binary, _recording),
        FileFormat("hdf5", ".h5", seeds.hdf5, mutate.binary, _recording),
        FileFormat("npy", ".npy", seeds.npy, mutate.binary, _recording),
        FileFormat("npz", ".npz", seeds.npz, mutate.binary, _recording),
        FileFormat("tle", ".tle", seeds.tle, _tle, _elements),
        FileFormat("omm", ".omm", seeds.omm, mutate.text, _elements),
        FileFormat("oem", ".oem", seeds.oem, mutate.text, _ephemeris),
    )
}
