"""The folder of an experiment: a file for each record, the plan, and a manifest; whole or not at all."""

import hashlib
import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from microrad.core.folder import MANIFEST, read_bytes, whole_folder
from microrad.core.folder import check_folder as check
from microrad.lab.bench.formats import write_file
from microrad.lab.bench.plan import Plan, Record
from microrad.lab.bench.play import BenchError, Progress, played
from microrad.lab.recording import Recording, read_recording

_MOST_MANIFEST = 16_000_000

PLAN = "plan.toml"


def write(
    plan: Plan, folder: str | Path, seed: int, overwrite: bool = False, on_progress: Progress | None = None
) -> tuple[Path, ...]:
    """Play a plan into a folder: the files of its records in the plan's formats, plan.toml and manifest.json.

    Returns the files of the records, in the order of the plan. The manifest has seed, versions, and of each record its
    use (identification or validation), rate, period and files. The folder appears whole or not at all. Raises
    `FolderError` for a folder that is there already, unless `overwrite` is true and a bench wrote it.
    """
    folder = Path(folder)
    entries: list[dict[str, Any]] = []
    with whole_folder(folder, overwrite, "plan", "recordings") as draft:
        for record, recording in played(plan, seed, on_progress):
            files = [write_file(recording, form, draft).name for form in plan.formats]
            entries.append(_entry(record, recording, files))
        (draft / PLAN).write_text(plan.text, encoding="utf-8", newline="\n")
        text = json.dumps(_manifest(plan, seed, entries, draft), indent=2, ensure_ascii=False)
        (draft / MANIFEST).write_text(text + "\n", encoding="utf-8")
    return tuple(folder / name for entry in entries for name in entry["files"])


def _entry(record: Record, recording: Recording, files: list[str]) -> dict[str, Any]:
    excitation = record.excitation
    return {
        "name": excitation.name,
        "kind": record.kind,
        "use": record.use,
        "truth": record.truth,
        "files": files,
        "inputs": list(recording.input_names),
        "outputs": list(recording.output_names),
        "rate_hz": recording.rate_hz,
        "samples": recording.samples,
        "period_samples": recording.period_samples,
        "rest_v": excitation.rest_v,
        "lines": list(excitation.lines),
        "step_samples": list(excitation.step_samples),
    }


def _manifest(plan: Plan, seed: int, entries: list[dict[str, Any]], draft: Path) -> dict[str, Any]:
    files = sorted(path for path in draft.iterdir() if path.is_file())
    libraries = ("microrad", "numpy", "scipy", "numba")
    return {
        "plan": {"name": plan.name, "file": PLAN, "source": plan.path.name, "sha256": plan.sha256},
        "seed": seed,
        "drive_unit": "V",
        "output_unit": "mrad",
        "records": entries,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in libraries}},
        "files_sha256": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files},
    }


def check_folder(folder: Path, overwrite: bool) -> None:
    """Raise `FolderError` when `folder` holds something that must not be replaced."""
    check(folder, overwrite, "plan", "recordings")


def read_folder(folder: Path, accept: tuple[str, ...] = ()) -> tuple[tuple[Recording, str], ...]:
    """Recordings of a folder that `write` made, each with its use ("identification" or "validation").

    Of several formats the first is read. Raises `BenchError` for a folder without the manifest of a bench, and
    `RecordingError` for a file that cannot be read.
    """
    manifest = folder / MANIFEST
    try:
        entries = json.loads(read_bytes(manifest, _MOST_MANIFEST))["records"]
        wanted = [(folder / e["files"][0], e["inputs"], e["outputs"], e["period_samples"], e["use"]) for e in entries]
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        raise BenchError(
            f"{folder}: no {MANIFEST} of microrad bench in it; name the recordings themselves (--input, --output)"
        ) from None
    return tuple(
        (read_recording(path, inputs, outputs, period_samples=period, accept=accept), use)
        for path, inputs, outputs, period, use in wanted
    )
