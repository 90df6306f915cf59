"""Pages of the site that are made from the code: its names, commands and keys, and tables that are computed."""

from site_pages import commands, keys, names


def all_pages() -> dict[str, str]:
    """All of them: their text in Markdown by their names in the folder of the sources."""
    return {**names.pages(), **commands.pages(), **keys.pages()}
