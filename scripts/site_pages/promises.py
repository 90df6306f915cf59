"""What the pages of docs/ promise, and the tests that show it.

A promise is a paragraph, an item of a list or a table whose every sentence about what microrad does is shown by tests.
It ends in a comment, `<!-- promise: day-12 -->`, with the name of its page and a number that is never used twice.
Each of its tests says `@pytest.mark.promise("day-12")`.
"""

import re
from collections import defaultdict
from pathlib import Path

from site_pages.tables import table

ROOT = Path(__file__).resolve().parents[2]

_SHOWN = re.compile(r"(?m)^ *(?:@pytest\.mark\.promise\(([^)]*)\)|(?:async )?def (\w+)\()")
_MARK = re.compile(r"[ \n]?<!-- promise: ([a-z]+(?:-[a-z]+)*-\d+) -->")
_INTRODUCTION = """# What is promised, and what shows it

A paragraph, a list item or a table of these pages that ends in a number says what microrad does. The tests beside the
number show it. `make test` fails where a promise has no test.
"""


def documents() -> dict[str, str]:
    """The texts of the pages by their names, README among them."""
    files = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    return {path.stem.lower(): path.read_text(encoding="utf-8") for path in files}


def promised(text: str) -> list[str]:
    """The promises of a page, in their order."""
    return _MARK.findall(text)


def shown() -> dict[str, list[str]]:
    """The tests that name each promise, as `file::test`."""
    found = defaultdict(list)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        names: list[str] = []
        for promises, test in _SHOWN.findall(path.read_text(encoding="utf-8")):
            if not test:
                names += re.findall('"(.*?)"', promises)
                continue
            for name in names:
                found[name].append(f"{path.relative_to(ROOT / 'tests')}::{test}")
            names = []
    return dict(found)


def linked(text: str) -> str:
    """A page with its promises as links to what shows them."""
    return _MARK.sub(r' <a class="promise" id="\1" href="promises.html#\1">\1</a>', text)


def pages() -> dict[str, str]:
    """The page that lists all promises with their tests."""
    tests = shown()
    parts = [_INTRODUCTION]
    for name, text in documents().items():
        rows = [
            (
                f'<a id="{each}" href="{name}.html#{each}">{each}</a>',
                ", ".join(f"`{test}`" for test in tests.get(each, ())),
            )
            for each in promised(text)
        ]
        if rows and name != "readme":
            parts.append(f"## {text.partition('# ')[2].partition(chr(10))[0]}\n\n{table(('promise', 'tests'), rows)}\n")
    return {"promises.md": "\n".join(parts)}
