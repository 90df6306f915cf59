"""Tables of the pages, as Markdown."""

from collections.abc import Iterable, Sequence


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, wide: bool = False) -> str:
    """A table in Markdown; a bar in a cell stays one, and a cell is one line.

    Args:
        headings: Those of the columns.
        rows: The cells, as many as there are headings in each row.
        wide: Whether it rather scrolls sideways than have narrow columns.
    """
    lines = [headings, ["---"] * len(headings), *rows]
    head = "```{rst-class} wide\n```\n\n" if wide else ""
    return head + "\n".join(
        "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def code(text: str) -> str:
    """A text as code, or nothing where it is empty."""
    return f"`{text}`" if text else ""


def plain(text: str) -> str:
    """A text whose signs Markdown is not to read as markup; what stands between backticks is code."""
    parts = text.split("`")
    for k in range(0, len(parts), 2):
        for sign in "\\*_<$[":
            parts[k] = parts[k].replace(sign, "\\" + sign)
    return "`".join(parts)
