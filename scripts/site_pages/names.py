"""The reference of the public names: a page for each, from its docstring."""

import inspect

import microrad
from site_pages.tables import plain, table

_HEAD = """# Public names

`import microrad` brings each of these, and loads it when it is first used. Quantities are SI floats; the unit is in the
name of the argument (`_rad`, `_hz`, `_v`). Commands have [their own reference](../commands.md), keys of a mission
[theirs](../keys.md).
"""


def names() -> tuple[str, ...]:
    """All public names, in the order of the package's table."""
    return tuple(name for name in dir(microrad) if not name.startswith("__"))


def pages() -> dict[str, str]:
    """The pages by their names in the site: one that lists the names, and one for each."""
    found = {f"names/{name}.md": _page(name) for name in names()}
    shown = []
    for title, inside in _groups().items():
        rows = [(f"[{name}]({name}.md)", plain(_first_line(name))) for name in inside]
        shown += [f"## {title.capitalize()}", table(("name", "what it is"), rows)]
    tree = "\n".join(("```{toctree}", ":hidden:", "", *names(), "```"))
    return {"names/index.md": "\n\n".join((_HEAD, *shown, tree)) + "\n", **found}


def _groups() -> dict[str, list[str]]:
    """The names by the comments that stand above them in the package's table."""
    found: dict[str, list[str]] = {}
    title = "names"
    for line in inspect.getsource(microrad).partition("_PUBLIC = {")[2].splitlines():
        text = line.strip()
        if text.startswith("}"):
            break
        if text.startswith("#"):
            title = text.removeprefix("#").strip()
        elif text.startswith('"'):
            found.setdefault(title, []).append(text.split('"')[1])
    return found


def _first_line(name: str) -> str:
    return (inspect.getdoc(getattr(microrad, name)) or "").partition("\n")[0]


def _page(name: str) -> str:
    value = getattr(microrad, name)
    lines = [f".. autofunction:: microrad.{name}"]
    if inspect.isclass(value):
        lines = [f".. autoclass:: microrad.{name}", "   :members:"]
        if issubclass(value, BaseException):
            lines = [f".. autoexception:: microrad.{name}", "   :show-inheritance:"]
    elif not callable(value):
        lines = [f".. autodata:: microrad.{name}"]
    return "\n".join((f"# {name}", "", "```{eval-rst}", *lines, "```", ""))
