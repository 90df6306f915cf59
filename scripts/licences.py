"""Write docs/licences.md: what the project and its extras install, and the licence that each states in its metadata.

.venv/bin/python scripts/licences.py      behind `make test`, which installs all of it
"""

from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PAGE = Path(__file__).resolve().parent.parent / "docs" / "licences.md"
PROJECT = "microrad"
EXTRAS = ("lab", "xlsx", "cluster", "parquet", "control", "studio", "plot", "docs")
_LOWEST = {"python_version": "3.11", "python_full_version": "3.11.0"}  # the Python that needs most packages
_LONGEST = 50  # characters of a field that names a licence; a longer one is its text

HEAD = f"""# Licences of the dependencies

microrad itself is under BSD-3-Clause. It holds no source of the packages below; its reports hold plotly.js, with its
licence (MIT). The packages are installed beside it, each under the licence that its metadata states; libraries inside a
wheel have licences of their own, whose texts are in the wheel. `{PROJECT}` in the last column is what every
installation has, the others come with an extra. Of what every installation has no package states the GPL or the LGPL.
`npTDMS`, which reads and writes TDMS files, is under the LGPL and optional: the extra `lab` brings it, and nothing
but these files needs it. What only tests and benchmarks need is not listed. `scripts/licences.py` writes this page.
<!-- promise: licences-1 -->

| package | licence | brought by |
|---|---|---|
"""
TAIL = "\n<!-- promise: licences-2 -->\n"


def brought(extra: str) -> set[str]:
    """Names of what the project, or one of its extras, brings."""
    found: set[tuple[str, str]] = set()
    left = [(PROJECT, extra)]
    while left:
        name, of = left.pop()
        if (name, of) in found:
            continue
        found.add((name, of))
        try:
            wanted = map(Requirement, metadata.requires(name) or ())
        except metadata.PackageNotFoundError:  # of a Python below this one
            continue
        for each in wanted:
            if each.marker is None or each.marker.evaluate({**_LOWEST, "extra": of}):
                left += [(canonicalize_name(each.name), inner) for inner in ("", *each.extras)]
    return {name for name, _ in found} - {PROJECT}


def licence(of: metadata.PackageMetadata) -> str:
    """The licence as a package states it: the expression, the field if it is a name, or the classifiers."""
    field = " ".join((of.get("License-Expression") or of.get("License") or "").split())
    if field and len(field) <= _LONGEST and not field.lower().endswith(".txt"):
        return field
    stated = [text.rpartition(" :: ")[2] for text in of.get_all("Classifier") or () if text.startswith("License ::")]
    return "; ".join(stated) or "not stated"


def rows() -> Iterator[tuple[str, str]]:
    """By name, the row of each package that is installed here."""
    base = brought("")
    by_extra = {extra: brought(extra) - base for extra in EXTRAS}
    for name in sorted(base.union(*by_extra.values())):
        by = [PROJECT] if name in base else [extra for extra, names in by_extra.items() if name in names]
        try:
            found = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            continue
        yield name, f"| {found['Name']} | {licence(found)} | {', '.join(by)} |"


if __name__ == "__main__":
    PAGE.write_text(HEAD + "".join(f"{row}\n" for _, row in rows()) + TAIL, encoding="utf-8")
