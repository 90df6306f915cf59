"""Write hashes/: each version of constraints.txt that `make` installs, with the SHA-256 of its wheels.

    .venv/bin/python scripts/hashes.py   asks pip, which downloads nothing, for the wheels of each supported Python

hashes/lab.txt is what `make demo` installs beside the project, and builds it with; hashes/test.txt what `make test`
adds. The wheels are those of Linux on x86-64.
"""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "hashes"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
BUILDING = "editables"
"""What the build backend needs for an editable install and does not name before it is asked."""

Reports = dict[str, dict[str, Any]]


def wanted(project: dict[str, Any], *extras: str) -> Iterator[Requirement]:
    """What the project and its extras ask for; an extra that names the project brings other extras."""
    for text in project["dependencies"]:
        yield Requirement(text)
    for extra in extras:
        for text in project["optional-dependencies"][extra]:
            each = Requirement(text)
            if each.name == project["name"]:
                yield from wanted(project, *each.extras)
            else:
                yield each


def report(python: str, asked: list[Requirement]) -> dict[str, Any]:
    """By name, what pip would install for this Python: version, wheel, hash and metadata."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "report.json"
        words = ["install", "--dry-run", "--ignore-installed", "--quiet", "--only-binary", ":all:"]
        words += ["--python-version", python, "--target", folder, "--report", str(answer)]
        words += ["--constraint", str(ROOT / "constraints.txt"), *sorted({str(each) for each in asked})]
        subprocess.run([sys.executable, "-m", "pip", *words], check=True)
        found = json.loads(answer.read_text(encoding="utf-8"))["install"]
    return {canonicalize_name(each["metadata"]["name"]): each for each in found}


def closure(python: str, asked: list[Requirement], found: dict[str, Any]) -> set[str]:
    """Names that these requirements bring on this Python: pip takes the markers for the Python that it runs on."""
    here = {"python_version": python, "python_full_version": f"{python}.0", "implementation_version": f"{python}.0"}
    names: set[tuple[str, str]] = set()
    left = list(asked)
    while left:
        each = left.pop()
        for extra in ("", *each.extras):
            name = canonicalize_name(each.name)
            if (name, extra) in names:
                continue
            if name not in found:
                raise SystemExit(f"{name} is needed on Python {python} and has no pin: add it to constraints.txt")
            names.add((name, extra))
            inner = map(Requirement, found[name]["metadata"].get("requires_dist", ()))
            left += [r for r in inner if r.marker is None or r.marker.evaluate({**here, "extra": extra})]
    return {name for name, _ in names}


def lines(names: dict[str, set[str]], reports: Reports) -> Iterator[str]:
    """One pin a name with the hashes of its wheels, and the Pythons that need it where not all do."""
    for name in sorted(names):
        of = [reports[python][name] for python in PYTHONS if python in names[name]]
        (pin,) = {f"{each['metadata']['name']}=={each['metadata']['version']}" for each in of}
        some = sorted(names[name], key=PYTHONS.index)
        marker = "" if len(some) == len(PYTHONS) else " ; " + " or ".join(f"python_version == '{v}'" for v in some)
        hashes = sorted({each["download_info"]["archive_info"]["hashes"]["sha256"] for each in of})
        yield " \\\n".join([pin + marker, *(f"    --hash=sha256:{digest}" for digest in hashes)])


def main() -> None:
    """Ask pip and write both files."""
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    building = [Requirement(text) for text in (*described["build-system"]["requires"], BUILDING)]
    lab, test = ([*wanted(described["project"], extra), *building] for extra in ("lab", "test"))
    reports = {python: report(python, [*lab, *test]) for python in PYTHONS}
    pins = dict(re.findall(r"(\S+)==(\S+)", (ROOT / "constraints.txt").read_text(encoding="utf-8")))
    pins = {canonicalize_name(name): version for name, version in pins.items()}
    needed: dict[str, dict[str, set[str]]] = {"lab": {}, "test": {}}
    for python, found in reports.items():
        first = closure(python, lab, found)
        for file, names in (("lab", first), ("test", closure(python, test, found) - first)):
            for name in names:
                if pins.get(name) != found[name]["metadata"]["version"]:
                    raise SystemExit(f"{name} has no pin in constraints.txt: {found[name]['metadata']['version']}")
                needed[file].setdefault(name, set()).add(python)
    FOLDER.mkdir(exist_ok=True)
    for file, head in (("lab", ""), ("test", "--requirement lab.txt\n")):
        text = head + "".join(f"{line}\n" for line in lines(needed[file], reports))
        (FOLDER / f"{file}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
