"""Each format: how its bad inputs are made, and what takes them."""

import hashlib
import io
import json
import math
import sqlite3
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from scipy.io import savemat

from fuzzing import mutate, properties, seeds
from fuzzing.library import CALLS
from fuzzing.run import Format
from fuzzing.studio import MESSAGES
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger, verify
from microrad.campaign.ledger.file import HEADS, digest, files
from microrad.cli.frame import refusal_of
from microrad.export.linear_import import Given, import_mat
from microrad.lab.bench import load_plan
from microrad.lab.recording import read_motion, read_recording
from microrad.lab.recording.files import check_file
from microrad.lab.recording.formats.source import is_time_name
from microrad.lab.recording.list_file import read_list
from microrad.lab.recording.reader import open_source
from microrad.link.fade_series import read_fade_series
from microrad.link.fade_series.records import Normalisation, Unit
from microrad.mirror import coupled, from_table, read_mirror
from microrad.mission.file import holds_several_axes, load_coupled_mirror, load_link, load_mirror, load_mission
from microrad.mission.source_list import read_sources
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.files import read_elements, read_oem
from microrad.orbit.files.elements import checksum
from microrad.report.results.manifest_reader import altered_parts, read_manifest, unpack_mission

Mutate = Callable[[Random, Sequence[bytes]], bytes]
_GIVEN = Given("a mirror", 2e-3, 1e4, 50.0, 0.0, 100.0, 1.0, 1e3, 10.0, "rad")
_UNITS: tuple[Unit, ...] = ("linear", "dB")
_NORMALISED: tuple[Normalisation, ...] = ("mean", "largest", "as-given")
_SHORT = 20_000  # samples of a plan that is designed twice
_EPOCH = Epoch("2026-03-20T12:00:00Z")


@dataclass(frozen=True, slots=True)
class FileFormat:
    """A format of files: its good ones, how they are changed, and what reads a path and checks what it finds there.

    `beside` are files that those may name. A plan may make fifty million samples, and has the time and memory for it.
    """

    name: str
    suffix: str
    seeds: Callable[[], Sequence[bytes]]
    change: Mutate
    read: Callable[[Path], None]
    beside: Callable[[], Mapping[str, bytes]] = dict
    most_s: float = 1.0
    most_bytes: int = 1_000_000_000

    def made(self, draw: Random) -> bytes:
        """A bad file's content."""
        return self.change(draw, self.seeds())

    def take(self, made: bytes, folder: Path) -> None:
        """Write it, read it, and check what was read.

        Args:
            made: The content.
            folder: For the file.
        """
        for name, content in self.beside().items():
            if not (folder / name).exists():
                (folder / name).write_bytes(content)
        path = folder / f"case{self.suffix}"
        path.write_bytes(made)
        self.read(path)


def _links(path: Path) -> None:
    file = load_link(path)
    with refusal_of(path):  # as `microrad budget` has it
        properties.links(file)


def _mission(path: Path) -> None:
    file = load_mission(path)
    with refusal_of(path):
        properties.links(file)
        if file.mission.error_budget is not None:
            properties.mission_budget(file.mission.error_budget)
        properties.plant(from_table(file.mission.mirror))


def _mirror(path: Path) -> None:
    properties.plant(read_mirror(path))
    if holds_several_axes(path):
        properties.several_axes(coupled.of(load_coupled_mirror(path)))


def _campaign(path: Path) -> None:
    properties.campaign(load_campaign(path))


def _plan(path: Path) -> None:
    found = load_plan(path)
    properties.plan(found)
    if sum(each.excitation.samples for each in found.records) < _SHORT:
        again = load_plan(path).records
        same = all(
            np.array_equal(one.excitation.drive, two.excitation.drive)
            for one, two in zip(found.records, again, strict=True)
        )
        assert same, "the same seed gives other drives"


def _list(path: Path) -> None:
    for each in (found := read_list(path)).recordings + found.validation:
        properties.recording(each)


def _matrices(path: Path) -> None:
    text = import_mat(path, _GIVEN)
    written = path.with_suffix(".toml")
    written.write_text(text, encoding="utf-8")
    properties.plant(from_table(load_mirror(written).mirror))


def _manifest(path: Path) -> None:
    found = read_manifest(path)
    altered_parts(found)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        unpack_mission(found, Path(folder) / "unpacked")
        assert not any(each.is_symlink() for each in Path(folder).rglob("*")), "a link was unpacked"


def _ledger(path: Path) -> None:
    for name in files(path)[1:]:
        name.unlink(missing_ok=True)
    verify(path)
    with Ledger.open(path, write=False) as ledger:
        for cell in range(max(len(ledger.head.cells), 1)):
            for chunk in ledger.chunks(cell):
                properties.chunk(chunk)
        ledger.traces()
        ledger.notes()
        ledger.done()


def _recording(path: Path) -> None:
    """The first two channels that are no time, at some rate where the file says none."""
    check_file(path)
    source = open_source(path)
    used = [index for index, name in enumerate(source.names) if not is_time_name(name)][:2] or [0]
    is_timed = len(source.names) > used[-1] and (source.find_time(used) is not None or source.rates(used))
    properties.recording(read_recording(path, used[0], used[-1], None if is_timed else seeds.RATE_HZ))


def _fades(path: Path) -> None:
    """Levels or ratios, of which power 1 is the mean or the largest, sampled as the file says or as it is told."""
    number = path.stat().st_size
    unit, normalised = _UNITS[number % 2], _NORMALISED[number % 3]
    period_s = None if number % 5 == 0 else 1.0 / seeds.RATE_HZ
    properties.fades(read_fade_series(path, unit=unit, normalised=normalised, period_s=period_s))


def _motion(path: Path) -> None:
    found = read_motion(path, unit="urad") if path.stat().st_size % 2 else read_motion(path, rate_hz=seeds.RATE_HZ)
    properties.finite("motion", found.samples_rad)


def _sources(path: Path) -> None:
    properties.budget(read_sources(path))


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


def _packed(draw: Random, given: Sequence[bytes]) -> bytes:
    """A file of MATLAB, NumPy or SQLite, or one of MATLAB with whatever numbers."""
    if draw.random() < 0.5:
        return mutate.binary(draw, given)
    names = ("A", "B", "C", "D", "Ts", "z", "p", "k", "num", "den", "s")
    form = draw.choice((("A", "B", "C", "D"), ("z", "p", "k"), ("num", "den"), names[:5], names[5:]))
    made: dict[str, Any] = {name: _numbers(draw, name) for name in form if draw.random() < 0.97}
    if draw.random() < 0.3:
        made |= {"Ts": _numbers(draw, "Ts")}
    content = io.BytesIO()
    savemat(content, {"s": made} if draw.random() < 0.3 else made, do_compression=draw.random() < 0.3)
    return content.getvalue()


def _numbers(draw: Random, name: str) -> Any:
    """An array as a linear system has one, of a shape that may fit and with numbers that may be none."""
    size = draw.choice((1, 2, 2, 3, 6, 40))
    shape = {"A": (size, size), "B": (size, 1), "C": (1, size), "D": (1, 1), "Ts": (1, 1), "k": (1, 1)}.get(
        name, (1, size)
    )
    if draw.random() < 0.1:
        shape = draw.choice(((0, 0), (size,), (size, 2), (2, size), (1, 1)))
    scale = draw.choice((1.0, 1.0, 1.0, 1e3, 1e6, 1e-6, 1e150, 1e-150))
    values = scale * np.array([draw.gauss(0.0, 1.0) for _ in range(math.prod(shape))]).reshape(shape)
    if name == "A":
        values = values - scale * draw.choice((0.0, 3.0)) * np.eye(*shape)[: shape[0]] if len(shape) == 2 else values
    if name in ("p", "z"):
        values = -np.abs(values) if draw.random() < 0.8 else values * (1.0 + 1.0j)
    if values.size and draw.random() < 0.15:
        values.flat[draw.randrange(values.size)] = draw.choice((np.nan, np.inf, 1e308, 1e-320, 0.0, -1.0, 1e20))
    return draw.choice((values, values, values, values, values[:1], "words", {"x": values}))


def _json(draw: Random, given: Sequence[bytes]) -> bytes:
    """A manifest with changes of its values, or of its text."""
    if draw.random() < 0.2:
        return mutate.text(draw, given)
    one, other = (_parsed(each) for each in (draw.choice(given), draw.choice(given)))
    made = mutate.plain(draw, one, other)
    if draw.random() < 0.5 and isinstance(made, dict) and isinstance(made.get("mission"), dict):
        made["mission"]["text"] = mutate.text(draw, seeds.missions()).decode("utf-8", "replace")
    return mutate.as_json(draw, made)


@cache
def _parsed(text: bytes) -> Any:
    return json.loads(text)


def _sqlite(draw: Random, given: Sequence[bytes]) -> bytes:
    """A ledger with changes of its bytes, or of what stands in it, with the checksums that this has then."""
    if draw.random() < 0.5:
        return mutate.binary(draw, given)
    with tempfile.TemporaryDirectory(dir=_memory()) as folder:
        path = Path(folder) / "a.ledger"
        path.write_bytes(draw.choice(given))
        with closing(sqlite3.connect(path, isolation_level=None)) as connection:
            connection.execute("PRAGMA journal_mode = DELETE")
            for table, kind in draw.sample((("head", "head"), ("chunks", "chunk"), ("notes", "note")), 1):
                _replaced(draw, connection, table, kind)
        return path.read_bytes()


def _replaced(draw: Random, connection: sqlite3.Connection, table: str, kind: str) -> None:
    if kind == "note":
        key, value = draw.choice(mutate.WORDS), json.dumps(draw.choice(mutate.VALUES[:12]))
        connection.execute("INSERT OR REPLACE INTO notes VALUES (?, ?, ?)", (key, value, digest(key, value)))
        return
    own = [data for each, data in seeds.records() if each == kind]
    payload = record(draw, kind, own)
    if kind == "head":
        for each in HEADS:
            connection.execute(f"UPDATE {each} SET payload = ?", (payload,))
        return
    cell, number = connection.execute("SELECT cell, number FROM chunks LIMIT 1").fetchone() or (0, 0)
    place = draw.choice(((cell, number), (cell, number), (0, -1), (2**62, 1), ("x", 0)))
    connection.execute(
        f"INSERT OR REPLACE INTO {table} VALUES (?, ?, ?, ?)", (*place, digest(*place, payload), payload)
    )


def record(draw: Random, kind: str, given: Sequence[bytes]) -> bytes:
    """A chunk, trace or head with another header or other bytes, and the checksum that these have.

    Args:
        draw: What is drawn from.
        kind: Which of the three.
        given: Good ones.
    """
    body = draw.choice(given)[:-32]
    length = int.from_bytes(body[12:16], "little")
    header = json.loads(body[16 : 16 + length])
    if draw.random() < 0.7:
        words = mutate.as_json(draw, mutate.plain(draw, header, header))
        body = body[:12] + len(words).to_bytes(4, "little") + words + body[16 + length :]
    else:
        body = mutate.one_change(draw, body, body)
    return body + hashlib.sha256(body).digest()


def _memory() -> Path | None:
    memory = Path("/dev/shm")
    return memory if memory.is_dir() else None


FORMATS: dict[str, Format] = {
    each.name: each
    for each in (
        FileFormat("links", ".toml", seeds.links, mutate.text, _links),
        FileFormat("missions", ".toml", seeds.missions, mutate.text, _mission, most_s=3.0),
        FileFormat("mirrors", ".toml", seeds.mirrors, mutate.text, _mirror),
        FileFormat("plans", ".toml", seeds.plans, mutate.text, _plan, most_s=20.0, most_bytes=2_000_000_000),
        FileFormat("campaigns", ".toml", seeds.campaigns, mutate.text, _campaign, seeds.beside_campaigns),
        FileFormat("lists", ".toml", seeds.lists, mutate.text, _list, seeds.beside_lists),
        FileFormat("sources", ".csv", seeds.sources, mutate.text, _sources, most_s=5.0),
        FileFormat("workbooks", ".xlsx", seeds.workbooks, mutate.binary, _sources, most_s=5.0),
        FileFormat("motions", ".csv", seeds.motions, mutate.text, _motion),
        FileFormat("fades", ".csv", seeds.fades, mutate.text, _fades),
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
        FileFormat("matrices", ".mat", seeds.matrices, _packed, _matrices),
        FileFormat("manifests", ".json", seeds.manifests, _json, _manifest),
        FileFormat("pages", ".html", seeds.pages, mutate.text, _manifest),
        FileFormat("ledgers", ".ledger", seeds.ledgers, _sqlite, _ledger),
        *MESSAGES,
        *CALLS,
    )
}
