"""The manifest that a report carries: read, checked, and unpacked into a folder to be run again.

What stands in a report is not trusted: sizes are bounded, nothing of it is evaluated, and the files that it carries are
written under names that cannot leave the folder.
"""

import contextlib
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from microrad.core.errors import MicroradError
from microrad.core.folder import MANIFEST, read_bytes
from microrad.mission import file as missionfile
from microrad.mission.toml import Document, UnreadableError
from microrad.report.results.comparison import clipped
from microrad.report.results.manifest import ENDING, OPENING, hash_of_page, hash_of_summary, text_sha256

MOST_BYTES = 64_000_000
"""Length of a report or manifest beyond which it is none of microrad's."""
MOST_TEXT = 4_000_000
MOST_FILES = 16
_LONGEST_NAME = 100
_NO_PART = re.compile(r'[\x00-\x1f\x7f\\:*?"<>|]|^[. ]|[. ]$|^$')  # of a name that is plain everywhere
_NAME = "name a report.html or a folder of results"
_ELSE = "run the mission itself with microrad run"


class ReproduceError(MicroradError):
    """A file that cannot be run again; the message says why and what to do."""

    page = "report"


@dataclass(frozen=True, slots=True)
class ReadManifest:
    """A manifest as it was read from ``path``: ``data`` of which the keys are checked.

    ``page`` is the page that it stood in, or "" where it is a file of its own.
    """

    path: Path
    data: Mapping[str, Any]
    page: str

    @property
    def named(self) -> dict[str, str]:
        """Texts of the files that the mission names, by the name that it gives them."""
        return dict(self.data.get("inputs") or {})


# ------------------------------------------------------------------------------------------------------------- reading
def read_manifest(path: Path) -> ReadManifest:
    """The manifest of a report, of a manifest.json or of a folder of results.

    Raises ReproduceError for anything else.
    """
    path = path / MANIFEST if path.is_dir() else path
    text, is_page = _text_of(path), path.suffix.lower() != ".json"
    data = _parsed(path, _embedded(path, text) if is_page else text)
    _check(path, data)
    return ReadManifest(path, data, text if is_page else "")


def _text_of(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            most = f"a report of microrad has at most {MOST_BYTES / 1e6:.0f} MB"
            raise ReproduceError(f"{path}: is {size / 1e6:.0f} MB long; {most}")
        return read_bytes(path, MOST_BYTES).decode("utf-8")
    except FileNotFoundError:
        raise ReproduceError(f"{path}: there is no such file; {_NAME}") from None
    except IsADirectoryError:
        raise ReproduceError(f"{path}: is a folder without a {MANIFEST}; {_NAME}") from None
    except OSError as error:
        raise ReproduceError(f"{path}: cannot be read: {error.strerror}; name a report.html") from None
    except UnicodeDecodeError:
        raise ReproduceError(f"{path}: is no text, so no report of microrad; name a report.html") from None


def _embedded(path: Path, page: str) -> str:
    """The text of the manifest in a page."""
    count = page.count(OPENING)
    if not count:
        said = "is no report of microrad; name a report.html that microrad run wrote"
        if "microrad study of" in page:
            said = (
                f"carries no manifest: it was cut short, or an earlier version wrote it; name the {MANIFEST} beside it"
            )
        raise ReproduceError(f"{path}: {said}")
    if count > 1:
        said = f"carries {count} manifests; a report has one, so this one was put together by hand"
        raise ReproduceError(f"{path}: {said}")
    inside, ending, _ = page.partition(OPENING)[2].partition(ENDING)
    if not ending:
        raise ReproduceError(f"{path}: ends within its manifest: it was cut short; name the whole report")
    return inside


def _parsed(path: Path, text: str) -> Any:
    try:
        return json.loads(text, parse_constant=_no_constant, parse_int=_whole)
    except (ValueError, RecursionError) as error:
        reason = "is nested too deeply" if isinstance(error, RecursionError) else f"is no JSON ({error})"
        raise ReproduceError(f"{path}: its manifest {reason}; the report was changed or cut short") from None


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no number of JSON")


def _whole(digits: str) -> float:
    return int(digits) if len(digits) <= 18 else float(digits)  # no number of thousands of digits


def _check(path: Path, data: Any) -> None:
    """Raises ReproduceError for a manifest without what a run takes, or with values of another kind."""
    found = data if isinstance(data, dict) else {}
    faults = [
        *_file_faults("mission", found.get("mission")),
        *(_file_faults("mirror", found["mirror"]) if found.get("mirror") is not None else ()),
        *_texts_faults("inputs", found.get("inputs", {})),
        *_texts_faults("inputs_sha256", found.get("inputs_sha256", {})),
        *_texts_faults("versions", found.get("versions")),
        *_texts_faults("files_sha256", found.get("files_sha256", {})),
    ]
    if not isinstance(found.get("machine", ""), str):  # as version 0.1.0 wrote it
        faults += _texts_faults("machine", found["machine"])
    if not isinstance(found.get("summary"), dict):
        faults.append("no summary, against which a run could be held")
    if faults:
        raise ReproduceError(f"{path}: its manifest has {'; '.join(faults)}: it is none of a study of this version")


def _file_faults(name: str, value: Any) -> Iterator[str]:
    keys = ("file", "sha256", "text", "text_sha256")
    if not isinstance(value, dict) or any(not isinstance(value.get(key), str) for key in keys):
        yield f"no {name} with {', '.join(keys)}"
    elif len(value["text"]) > MOST_TEXT:
        yield f"a {name} text of {len(value['text'])} characters"


def _texts_faults(name: str, value: Any) -> Iterator[str]:
    if not isinstance(value, dict) or any(not isinstance(each, str) for each in value.values()):
        yield f"no {name} as names with texts"
    elif name == "inputs" and (len(value) > MOST_FILES or sum(map(len, value.values())) > MOST_TEXT):
        yield f"more {name} than a mission names"


def altered_parts(manifest: ReadManifest) -> tuple[str, ...]:
    """What of the report, and of the files beside it, no longer has the hash that it was written with."""
    data = manifest.data
    files = [("the mission's text", data["mission"])]
    files += [("the mirror file's text", data["mirror"])] if data.get("mirror") else []
    parts = [(what, each["text_sha256"], text_sha256(each["text"])) for what, each in files]
    hashes = data.get("inputs_sha256") or {}
    named = manifest.named.items()
    parts += [(f"the text of {clipped(name)}", hashes.get(name, ""), text_sha256(text)) for name, text in named]
    if "summary_sha256" in data:
        parts.append(("its summary", str(data["summary_sha256"]), hash_of_summary(data["summary"])))
    if manifest.page and "page_sha256" in data:
        parts.append(("its page", str(data["page_sha256"]), hash_of_page(manifest.page)))
    parts += [(f"{clipped(name)} beside it", *hashes) for name, hashes in _beside(manifest)]
    return tuple(
        f"{what} was changed after the report was written: its SHA-256 is {own[:16]}…, and "
        f"{clipped(stated[:16])}… is stated"
        for what, stated, own in parts
        if own != stated
    )


def _beside(manifest: ReadManifest) -> Iterator[tuple[str, tuple[str, str]]]:
    """Each file beside the report that the manifest states a hash for: its name, the hash stated and its own."""
    for name, stated in (manifest.data.get("files_sha256") or {}).items():
        if (content := content_beside(manifest, name)) is not None:
            yield name, (stated, hashlib.sha256(content).hexdigest())


def content_beside(manifest: ReadManifest, name: str) -> bytes | None:
    """What stands in a file beside the report, as the manifest names it; None without such a file.

    Args:
        manifest: that of a report.
        name: as the manifest has it.
    """
    path = manifest.path.parent / name
    fits = plain(name) and path.is_file() and path.stat().st_size <= MOST_BYTES
    return read_bytes(path, MOST_BYTES) if fits else None


# ----------------------------------------------------------------------------------------------------------- unpacking
def unpack_mission(manifest: ReadManifest, folder: Path) -> tuple[missionfile.MissionFile, dict[str, str]]:
    """Write mission, mirror and the files that the mission names into a folder, and read the mission there.

    A name that could lead out of the folder, or is not plain on every system, is replaced, in the mission's data too;
    which ones comes second.

    Args:
        manifest: that of a report.
        folder: where to; it is made.

    Raises ReproduceError if a file that the mission names is not in the manifest.
    """
    stated, mirror = manifest.data["mission"], manifest.data.get("mirror")
    place = _written(folder, plain(stated["file"]) or "mission.toml", stated["text"])
    mirror_place = None
    if mirror is not None:
        mirror_place = _written(folder / "mirror-file", plain(mirror["file"]) or "mirror.toml", mirror["text"])
    _check_mirror(manifest, place, mirror_place)
    found = missionfile.load_mission(place, mirror_place)
    found = replace(found, sha256=_hash_of_file(stated))
    if found.mirror_file is not None:
        found = replace(found, mirror_file=replace(found.mirror_file, sha256=_hash_of_file(mirror)))
    names = missionfile.named_files(found.mission)
    moved = {name: _place(folder, number, name, manifest) for number, name in enumerate(names)}
    moved = {name: own for name, own in moved.items() if name != own}
    return replace(found, mission=renamed(found.mission, moved)), moved


def _hash_of_file(stated: Any) -> str:
    """The hash of the file as it was, whose line ends may have been others; of a changed text its own hash."""
    own = text_sha256(stated["text"])
    return str(stated["sha256"]) if own == stated["text_sha256"] else own


def _check_mirror(manifest: ReadManifest, place: Path, mirror_place: Path | None) -> None:
    """Raises ReproduceError if the mirror stands in a file that is not in the manifest: no other is read for it."""
    with contextlib.suppress(UnreadableError):  # reading the mission says what is wrong
        mirror = Document.read(place, "mission file").data.get("mirror")
        if mirror_place is None and isinstance(mirror, dict) and "file" in mirror:
            raise ReproduceError(
                f"{manifest.path}: the mission names the mirror file {clipped(str(mirror['file']))}, which the report "
                f"does not carry; {_ELSE}"
            )


def _place(folder: Path, number: int, name: str, manifest: ReadManifest) -> str:
    """Write a file that the mission names; returns its name there."""
    if name not in manifest.named:
        raise ReproduceError(
            f"{manifest.path}: the mission names {clipped(name)}, which the report does not carry (too long, or no "
            f"text); {_ELSE}"
        )
    own = plain(name)
    if not own or (folder / own).exists() or any(each.is_file() for each in (folder / own).parents):
        own = f"named-file-{number}{_ending(name)}"
    _written((folder / own).parent, Path(own).name, manifest.named[name])
    return own


def _ending(name: str) -> str:
    found = re.search(r"\.[A-Za-z0-9]{1,8}$", name)
    return found[0] if found else ""


def plain(name: str) -> str:
    """The name if it is that of a file in or below a folder, on every system, and no other file's; else nothing."""
    parts = name.split("/")
    fits = len(parts) <= 4 and all(len(part.encode("utf-8", "replace")) <= _LONGEST_NAME for part in parts)
    return name if fits and not any(_NO_PART.search(part) for part in parts) and _encodes(name) else ""


def _encodes(name: str) -> bool:
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _written(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    with path.open("x", encoding="utf-8", errors="surrogatepass", newline="") as file:
        file.write(text)
    return path


def renamed(record: Any, names: Mapping[str, str]) -> Any:
    """A record of the mission with its keys `file` renamed, wherever they stand.

    Args:
        record: with its inner ones.
        names: new ones by the old.
    """
    changed: dict[str, Any] = {}
    for key in type(record).model_fields:
        value = getattr(record, key)
        if hasattr(type(value), "model_fields"):
            inner = renamed(value, names)
            changed |= {} if inner is value else {key: inner}
        elif key == "file" and value in names:
            changed[key] = names[value]
    return record.model_copy(update=changed) if changed else record
