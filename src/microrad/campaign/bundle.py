"""A campaign in one piece that any worker can open: its files, and the controllers that were tuned for it."""

import base64
import hashlib
import json
import os
import platform
import shutil
import tomllib
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.definition.keys import MIRROR
from microrad.campaign.definition.reader import read_definition
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CampaignError
from microrad.core import lti
from microrad.core.folder import naming, read_bytes, scratch_folder
from microrad.core.machine import source_sha256
from microrad.loop.control import AxisController
from microrad.mission.file import named_files

_MOST_BYTES = 1_000_000_000  # of a file: more than any of those who read it take
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "sgp4", "skyfield")
"""Libraries whose version may move the last digits of a row."""
SCRATCH = "campaign"
"""What the folders among the temporary files are called that hold the files of opened bundles."""


@cache
def code_sha256() -> str:
    """SHA-256 over microrad's own source files and the versions of Python and the libraries that rows depend on."""
    digest = hashlib.sha256(source_sha256().encode())
    digest.update(repr([platform.python_version(), *((name, version(name)) for name in LIBRARIES)]).encode())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class Opened:
    """A bundle that a worker has opened; the folder with its files goes when this does."""

    campaign: CampaignFile
    controllers: tuple[AxisController, ...]


def mission_sha256(campaign: CampaignFile) -> str:
    """SHA-256 over every file of a campaign but the campaign file itself: the mission and what it and the grid name."""
    digest = hashlib.sha256()
    for name, path in sorted(_named(campaign.files).items()):
        if path != campaign.path:
            digest.update(f"{name}\0".encode())
            digest.update(hashlib.sha256(read_bytes(path, _MOST_BYTES)).digest())
    return digest.hexdigest()


def hashes(campaign: CampaignFile) -> dict[str, str]:
    """What the rows of a campaign follow from: the campaign file, the mission with its files, and the code."""
    return {"campaign": campaign.sha256, "mission": mission_sha256(campaign), "code": code_sha256()}


def packed(campaign: CampaignFile, controllers: Sequence[AxisController]) -> bytes:
    """The files of a campaign and its controllers as bytes. Raises `CampaignError` for files named by absolute paths.

    Args:
        campaign: the campaign, whose files are read.
        controllers: the tuned one of each cell; none without a loop.
    """
    _refuse_absolute(campaign)
    named = _named(campaign.files)
    files = {name: base64.b64encode(read_bytes(path, _MOST_BYTES)).decode() for name, path in named.items()}
    name = next(name for name, path in named.items() if path == campaign.path)
    data = {
        "campaign": name,
        "code": code_sha256(),
        "chunk_rows": campaign.chunk_rows,
        "files": files,
        "controllers": [_written_controller(controller) for controller in controllers],
    }
    return json.dumps(data, sort_keys=True).encode()


def opened(spec: bytes, any_code: bool = False) -> Opened:
    """What `packed` put together. Raises `CampaignError` for a stranger's bundle, and for other code's.

    Args:
        spec: the bytes that it made.
        any_code: whether a bundle of other code than this is opened, too.
    """
    content = _unpacked(spec)
    if content.code != code_sha256() and not any_code:
        raise CampaignError(
            f"this worker runs other code than the campaign: {code_sha256()} here, {content.code} there; install the "
            "same microrad, Python and libraries on every worker"
        )
    folder = scratch_folder(SCRATCH)
    try:
        with naming(folder, folder):
            for name, data in content.files.items():
                path = _inside(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)
        campaign, _ = read_definition(_inside(folder, content.campaign))  # whoever packed it has tried its rows
        found = Opened(replace(campaign, chunk_rows=content.chunk_rows), content.controllers)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(found, shutil.rmtree, folder, ignore_errors=True)
    return found


class _Content(NamedTuple):
    """What a bundle holds: the name of the campaign file, the code that packed it, and files by name."""

    campaign: str
    code: str
    files: dict[str, bytes]
    chunk_rows: int | None
    controllers: tuple[AxisController, ...]


def _unpacked(spec: bytes) -> _Content:
    """The content of a bundle. Raises `CampaignError` for one that is none of ours: anyone may make a ledger."""
    try:
        data = json.loads(spec)
        files = {name: base64.b64decode(content) for name, content in data["files"].items()}
        controllers = tuple(_read_controller(each) for each in data["controllers"])
        found = _Content(str(data["campaign"]), str(data["code"]), files, data.get("chunk_rows"), controllers)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise CampaignError("the ledger holds a campaign as microrad never writes it: leave it alone") from error
    rows = found.chunk_rows
    if rows is None or (type(rows) is int and rows > 0 and not rows & (rows - 1)):
        return found
    raise CampaignError(f"the ledger has chunks of {rows!r} rows, which microrad never makes: leave it alone")


def _inside(folder: Path, name: str) -> Path:
    """The path of a file of a bundle. Raises `CampaignError` if it leaves the folder: anyone may make a ledger."""
    path = Path(os.path.abspath(folder.joinpath(*PurePosixPath(name).parts)))  # noqa: PTH100  nothing is there yet
    if not path.is_relative_to(folder) or path == folder or "\0" in name:
        raise CampaignError(f"the ledger holds a file {name!r}, which microrad never puts there: leave it alone")
    return path


def _refuse_absolute(campaign: CampaignFile) -> None:
    """Every worker reads the bundle's own copies, which are found by relative names alone."""
    own = tomllib.loads(campaign.mission.text).get(MIRROR)
    named = [campaign.table.mission, own.get("file") if isinstance(own, dict) else None]
    named += [each.get(MIRROR) for each in (campaign.fixed, *(cell.values for cell in campaign.cells))]
    named += [name for cell in campaign.cells for name in named_files(cell.file.mission)]
    named += [name for draw in campaign.draws for name in draw.files]
    for name in named:
        if name is not None and Path(name).is_absolute():
            raise CampaignError(
                f"{campaign.path} depends on {name}, an absolute path that another machine would not find: name the "
                "file relative to the one that names it"
            )


def _named(files: Sequence[Path]) -> dict[str, Path]:
    """Files by their path from the nearest folder that holds them all."""
    there = [Path(os.path.abspath(path)) for path in files]  # noqa: PTH100  links stay: the files name each other by them
    above = Path(os.path.commonpath([path.parent for path in there]))
    return {path.relative_to(above).as_posix(): given for path, given in zip(there, files, strict=True)}


def _written_controller(controller: AxisController) -> dict[str, Any]:
    s = controller.system
    arrays = {"A": s.A, "B": s.B, "C": s.C, "D": s.D, "L": controller.anti_windup}
    return {"name": controller.name, **{key: [list(m.shape), m.ravel().tolist()] for key, m in arrays.items()}}


def _read_controller(data: dict[str, Any]) -> AxisController:
    def array(key: str) -> NDArray[np.float64]:
        shape, values = data[key]
        return np.array(values, dtype=float).reshape(shape)

    system = lti.StateSpace(array("A"), array("B"), array("C"), array("D"))
    return AxisController(data["name"], system, array("L"))
