"""Pages of the site that are made from the code: its names, commands and keys, and tables that are computed."""

from pathlib import Path

from site_pages import choose, commands, conventions, formulas, keys, names, promises, validation

_NOTEBOOKS = """# Notebooks

Each is run when the site is built, so that what stands there is what the code printed.
"""


def all_pages(sources: Path) -> dict[str, str]:
    """All of them: their text in Markdown by their names in the folder of the sources.

    Args:
        sources: The folder, whose notebooks get a page that lists them.
    """
    made: dict[str, str] = {}
    for each in (names, commands, keys, choose, conventions, formulas, promises, validation):
        made |= each.pages()
    notebooks = [f"notebooks/{each.stem}" for each in sorted((sources / "notebooks").glob("*.ipynb"))]
    tree = "\n".join(("```{toctree}", ":maxdepth: 1", "", *notebooks, "```"))
    return {**made, "notebooks.md": f"{_NOTEBOOKS}\n{tree}\n" if notebooks else _NOTEBOOKS}
