"""Build the documentation site: the pages of docs/ and those that are made from the code, as HTML without network.

    python scripts/build_site.py [FOLDER [UNRUN...]]        # site/ by default; prints the path of its first page

Notebooks that fit a pattern of UNRUN are shown as they are stored.

A warning of the builder, a notebook that raises, a link or anchor that leads nowhere and anything that a page would
fetch from elsewhere is a fault; the faults are printed and the exit code is 1.
"""

import io
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
PROJECT_PAGES = ("CONTRIBUTING.md", "CHANGELOG.md")
"""Pages of the project's own folder that belong into the site."""
_FETCHING = {"script": "src", "img": "src", "iframe": "src", "link": "href", "source": "src"}


def build(target: Path, unrun: Sequence[str] = ()) -> list[str]:
    """Write the site into a folder, which is emptied first, and return what is wrong with it.

    Args:
        target: The folder; it is made where it is not there.
        unrun: Notebooks that are shown as they are stored, by patterns of their names.
    """
    from site_pages import all_pages, promises

    shutil.rmtree(target, ignore_errors=True)
    with tempfile.TemporaryDirectory() as temporary:
        sources, trees = Path(temporary, "sources"), Path(temporary, "trees")
        shutil.copytree(ROOT / "docs", sources)
        _with_project_pages(sources)
        for name, text in all_pages(sources).items():
            page = sources / name
            page.parent.mkdir(exist_ok=True)
            page.write_text(text, encoding="utf-8")
        for page in sources.glob("*.md"):
            page.write_text(promises.linked(page.read_text(encoding="utf-8")), encoding="utf-8")
        warnings = io.StringIO()
        said = {"status": None, "warning": warnings, "confdir": sources, "srcdir": sources}
        built = Path(temporary, "site")  # what notebooks made is left beside it
        settings = {"nb_execution_excludepatterns": list(unrun)}
        app = Sphinx(outdir=built, doctreedir=trees, buildername="html", freshenv=True, confoverrides=settings, **said)
        app.build()
        shutil.rmtree(built / ".doctrees", ignore_errors=True)
        shutil.move(built, target)
        raised = re.sub(r"\x1b\[[0-9;]*m", "", warnings.getvalue()).replace(str(sources), "docs")
    return [line for line in raised.splitlines() if line.strip()] + faults(target)


def _with_project_pages(sources: Path) -> None:
    """Put the pages of the project's own folder beside those of docs/, and let links between the two lead there."""
    for name in PROJECT_PAGES:
        text = (ROOT / name).read_text(encoding="utf-8")
        (sources / name).write_text(text.replace("](docs/", "]("), encoding="utf-8")
    for page in sources.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        page.write_text(re.sub(rf"\]\(\.\./({'|'.join(PROJECT_PAGES)})", r"](\1", text), encoding="utf-8")


class _Page(HTMLParser):
    """What a page refers to, what it would fetch, and the places in it that can be referred to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.ids: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what a tag refers to."""
        found = {name: value or "" for name, value in attrs}
        self.ids.update(found[key] for key in ("id", "name") if key in found)
        address = found.get(_FETCHING.get(tag, ""), "")
        if address and found.get("rel") not in ("canonical", "next", "prev", "index", "search", "author"):
            self.fetched.append(address)
        if tag == "a" and "href" in found:
            self.links.append(found["href"])


def _pages(site: Path) -> dict[Path, _Page]:
    return {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}


def faults(site: Path) -> list[str]:
    """What is wrong with a built site: links and anchors that lead nowhere, and what would be fetched from elsewhere.

    Addresses elsewhere that are links are not asked for.
    """
    wrong, site = [], site.resolve()
    pages = _pages(site)
    for path, page in pages.items():
        name = path.relative_to(site)
        wrong += [f"{name} would fetch {address}" for address in page.fetched if urlsplit(address).netloc]
        for address in {*page.links, *page.fetched}:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not there.is_file():
                wrong.append(f"{name}: {address} leads nowhere")
            elif parts.fragment and there in pages and unquote(parts.fragment) not in pages[there].ids:
                wrong.append(f"{name}: {address} has no such anchor")
    for style in site.rglob("*.css"):
        found = re.findall(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")\s]+)", style.read_text(encoding="utf-8"))
        wrong += [f"{style.relative_to(site)} would fetch {address}" for address in found]
    return sorted(wrong)


def external_links(site: Path) -> list[str]:
    """Addresses elsewhere that the pages of a built site link to, each once."""
    return sorted({a for page in _pages(site).values() for a in page.links if urlsplit(a).scheme in ("http", "https")})


def main() -> int:
    """Build it, and say where it is or what is wrong."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "site")
    wrong = build(target, sys.argv[2:])
    print("\n".join(wrong) if wrong else target / "index.html")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
