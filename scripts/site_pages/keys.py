"""The reference of the keys of mission and mirror files, as `microrad explain` knows them."""

from itertools import groupby

from microrad.mission import explain
from site_pages.tables import code, plain, table

_HEAD = """# Keys of a mission and of a mirror file

`microrad explain KEY` prints the same of one key. "Shipped" is what `microrad init` writes, with its source behind the
value. A key without a default must be there where its table is. NAME stands for a name that the file's author chooses.
"""


def pages() -> dict[str, str]:
    """The page with a table for each table of each file."""
    parts = [_HEAD]
    for file, keys in groupby(explain._keys(), key=lambda each: each.file):
        parts.append(f"## Keys of the {file}")
        every = list(keys)
        of_table: dict[str, list[explain.Key]] = {}
        for each in every:
            of_table.setdefault(each.name.rpartition(".")[0], []).append(each)
        for name, inside in of_table.items():
            parts.append(f"### {file}: {plain(f'[{name}]') if name else 'tables'}")
            parts.append(
                table(("key", "meaning", "holds", "left out", "shipped", "read by"), map(_row, inside), wide=True)
            )
    return {"keys.md": "\n\n".join(parts) + "\n"}


def _row(key: explain.Key) -> tuple[str, ...]:
    default = plain(key.default) or "it must be there"
    readers = ", ".join(code(each.removeprefix("microrad.")) for each in key.read_by)
    return (
        code(key.name.rpartition(".")[2]),
        plain(key.meaning),
        plain(key.holds),
        default,
        _value(key.shipped),
        readers,
    )


def _value(shipped: str) -> str:
    value, _, comment = shipped.partition("# ")
    return f"{code(value.strip())} {plain(comment)}".strip()
