"""Whether the package's files are those that were installed, and the libraries those that it was tested with."""

import base64
import contextlib
import hashlib
import re
import subprocess
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]
_PROJECT = _PACKAGE.parents[1]
_CONSTRAINTS = _PACKAGE / "constraints.txt", _PROJECT / "constraints.txt"
"""Where the tested versions stand: in a wheel, and in the project's folder."""
_MOST_LISTED = 5


@dataclass(frozen=True, slots=True)
class Integrity:
    """What the package's files were held against, and those that differ.

    Args:
        against: "record of the wheel", "commit ...", or "" where there is neither.
        changed: Files with other contents, by their path in the package.
        missing: Files that are not there.
        added: Files that nobody has recorded.
        versions: Libraries that have another version than the tested one, as "name 1.2 (tested: 1.1)".
    """

    against: str
    changed: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    added: tuple[str, ...] = ()
    versions: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether there is something to hold the files against, and neither a file nor a library differs."""
        return bool(self.against) and not (self.changed or self.missing or self.added or self.versions)

    @property
    def text(self) -> str:
        """In one sentence."""
        if not self.against:
            return "The files of the package could not be held against anything: there is no record of them."
        parts = {"changed": self.changed, "missing": self.missing, "added": self.added}
        said = [f"{len(files)} {what} ({_listed(files)})" for what, files in parts.items() if files]
        files = f"Against the {self.against}: {'; '.join(said) if said else 'every file as recorded'}."
        return f"{files} Not the tested version: {', '.join(self.versions)}." if self.versions else files


def _listed(files: tuple[str, ...]) -> str:
    more = f" and {len(files) - _MOST_LISTED} more" if len(files) > _MOST_LISTED else ""
    return ", ".join(files[:_MOST_LISTED]) + more


def integrity() -> Integrity:
    """Hold the package's files against the wheel's record, or against the last commit where it runs from its source."""
    from microrad.core.machine import LIBRARIES  # it loads numpy, whose absence `microrad doctor` tells by this file

    other = other_versions() or {}
    recorded, versions = _recorded(), tuple(other[name] for name in LIBRARIES if name in other)
    if recorded:
        return replace(_against_record(recorded), versions=versions)
    if (_PROJECT / ".git").exists():
        return replace(_against_commit(), versions=versions)
    return Integrity("", versions=versions)


def from_source() -> bool:
    """Whether the package runs from the project's folder, with its tested versions beside it."""
    return _CONSTRAINTS[1].is_file()


def other_versions() -> dict[str, str] | None:
    """Installed libraries whose version is not the tested one: what stands beside the name, by name.

    None where the tested versions are not known.
    """
    path = next((each for each in _CONSTRAINTS if each.is_file()), None)
    if path is None:
        return None
    found = {}
    for name, version in re.findall(r"(\S+)==(\S+)", path.read_text(encoding="utf-8")):
        with contextlib.suppress(metadata.PackageNotFoundError):
            if (installed := metadata.version(name)) != version:
                found[name] = f"{name} {installed} (tested: {version})"
    return found


def _recorded() -> dict[str, str]:
    """SHA-256 by path in the package, of the wheel that is installed; none for one that runs from its source."""
    try:
        files = metadata.files("microrad") or []
    except metadata.PackageNotFoundError:
        return {}
    inside = [f for f in files if f.parts[0] == "microrad" and f.hash is not None and f.hash.mode == "sha256"]
    here = [f for f in inside if Path(str(f.locate())).resolve().is_relative_to(_PACKAGE)]
    return {Path(*f.parts[1:]).as_posix(): f.hash.value for f in here if f.hash is not None}


def _against_record(recorded: dict[str, str]) -> Integrity:
    present = {p.relative_to(_PACKAGE).as_posix(): p for p in _PACKAGE.rglob("*") if p.is_file() and _is_ours(p)}
    changed = [name for name, path in present.items() if name in recorded and _sha256(path) != recorded[name]]
    return Integrity(
        "record of the wheel",
        tuple(sorted(changed)),
        tuple(sorted(set(recorded) - set(present))),
        tuple(sorted(set(present) - set(recorded))),
    )


def _is_ours(path: Path) -> bool:
    return "__pycache__" not in path.parts and path.suffix != ".pyc"


def _sha256(path: Path) -> str:
    """As a wheel writes it: in base 64 for addresses, without what fills it up."""
    return base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).decode().rstrip("=")


def _against_commit() -> Integrity:
    """What version control says of the package's folder; ignored files are nobody's."""
    try:
        commit = _git("rev-parse", "--short=12", "HEAD").strip()
        lines = _git("status", "--porcelain", "--untracked-files=all", "--", "src/microrad").splitlines()
    except (OSError, subprocess.CalledProcessError, subprocess.TimeoutExpired):
        return Integrity("")
    found: dict[str, list[str]] = {"changed": [], "missing": [], "added": []}
    for line in lines:
        state, name = line[:2], line[3:].removeprefix("src/microrad/")
        found["added" if state == "??" else "missing" if "D" in state else "changed"].append(name)
    return Integrity(f"commit {commit}", *(tuple(sorted(each)) for each in found.values()))


def _git(*words: str) -> str:
    ran = subprocess.run(["git", *words], cwd=_PROJECT, capture_output=True, text=True, check=True, timeout=60)
    return ran.stdout
