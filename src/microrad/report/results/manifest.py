"""The manifest of a study: what made its results, in a file and in the page."""

import contextlib
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from microrad.core.machine import machine, versions
from microrad.report.data import finite
from microrad.report.paper.bench import PLAN, SEED
from microrad.study.study import Study

MOST_INPUT_BYTES = 1_000_000
"""Length up to which a file that the mission names is carried in the manifest."""
OPENING, ENDING = '<script type="application/json" id="manifest">', "</script>"


def manifest_of(study: Study, summary: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """What made the results.

    The mission's text and hash and those of the files that it names, as they were read, and versions. Random numbers
    are drawn for the fine-pointing loop, for acquisition and for the day, from the mission's seeds, and for Fig. 4 and
    5.

    Args:
        study: a run of a whole mission.
        summary: the study as plain data.
        folder: of each file in it the hash is taken.
    """
    mirror, m = study.file.mirror_file, study.file.mission
    seeded = {"fine_pointing": m.fine_pointing, "acquisition": m.acquisition, "operations": m.operations}
    drawn = [f"seed {each.seed} of [{name}], {each.runs} runs" for name, each in seeded.items() if each is not None]
    data = finite(summary)
    named = {each.name: each.content for each in study.file.contents if each.content is not None}
    drawn += [f"seed {SEED} of the virtual bench, {PLAN}"] if study.scan is not None else []
    return {
        "mission": _text_file(study.file.path, study.file.sha256, study.file.text),
        "inputs_sha256": {name: hashlib.sha256(content).hexdigest() for name, content in named.items()},
        "inputs": _input_texts(named),
        "mirror": None if mirror is None else _text_file(mirror.path, mirror.sha256, mirror.text),
        "versions": versions(),
        "machine": machine(),
        "randomness": "; ".join(drawn) or "none",
        "files_sha256": _hashes(folder),
        "summary": data,
        "summary_sha256": hash_of_summary(data),
    }


def _text_file(path: Path, sha256: str, text: str) -> dict[str, str]:
    """Name, text and hashes of a file: its bytes', and its text's, whose line ends and mark at the begin may differ."""
    return {"file": path.name, "sha256": sha256, "text_sha256": hashlib.sha256(text.encode()).hexdigest(), "text": text}


def _input_texts(named: Mapping[str, bytes]) -> dict[str, str]:
    """The text of each file that the mission names, but for those too long to be carried along."""
    found = {}
    for name, content in named.items():
        if len(content) <= MOST_INPUT_BYTES:
            with contextlib.suppress(UnicodeDecodeError):  # no text: left to its hash
                found[name] = content.decode("utf-8")
    return found


def _file_sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _hashes(folder: Path) -> dict[str, str]:
    """The hash of each file by its place in the folder."""
    return {str(p.relative_to(folder)): _file_sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def write_manifest(made: Mapping[str, Any], folder: Path, name: str) -> None:
    """A manifest with the hashes of all files, written last, so that its presence says that the folder is whole.

    Args:
        made: the manifest.
        folder: with the other files.
        name: of the file.
    """
    text = json.dumps({**made, "files_sha256": _hashes(folder)}, indent=2, ensure_ascii=False)
    (folder / name).write_text(text + "\n", encoding="utf-8")


# ------------------------------------------------------------------------------------------------ in a page
def embedded(manifest: Mapping[str, Any]) -> str:
    """The manifest as JSON that cannot end the element it stands in: no "<", ">" or "&" is left in it."""
    text = json.dumps(manifest, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def hash_of_summary(summary: Mapping[str, Any]) -> str:
    """The hash of a summary's names, words and numbers, in their order."""
    return text_sha256(json.dumps(summary, ensure_ascii=False, separators=(",", ":")))


def hash_of_page(page: str) -> str:
    """The hash of what a page shows, whatever its line ends: all of it but the manifest."""
    return text_sha256("\n".join(shown_part(page).splitlines()))


def shown_part(page: str) -> str:
    """A page without its manifest."""
    before, _, behind = page.partition(OPENING)
    return before + behind.partition(ENDING)[2]


def with_manifest(page: str, text: str) -> str:
    """A page with this text in the place of its manifest.

    Args:
        page: with a place for a manifest.
        text: the manifest as JSON.
    """
    before, _, behind = page.partition(OPENING)
    return before + OPENING + text + ENDING + behind.partition(ENDING)[2]


def text_sha256(text: str) -> str:
    """The hash of a text as UTF-8."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
