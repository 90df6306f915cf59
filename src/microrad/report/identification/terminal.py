"""What an identification has in common with others on a terminal: as many warnings as there is room for."""

from collections.abc import Sequence
from textwrap import wrap

from microrad.report.quantities import counted

MOST_LINES = 23
"""Of a terminal of 25: the command has one of its own above them, and an empty one."""


def warnings_text(warnings: Sequence[str], refused: int, width: int, room: int) -> str:
    """As many warnings as there is room for, in their order, and how many there are else.

    Where there is no room for the first one it is cut.

    Args:
        warnings: each a sentence or several.
        refused: number of models that were refused, which the report names.
        width: columns of the terminal.
        room: lines.
    """
    shown: list[str] = []
    left, cut = 0, False
    for number, warning in enumerate(warnings, start=1):
        lines = wrap(warning, width, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False)
        if len(shown) + len(lines) + (number < len(warnings) or refused > 0) > room:
            cut = not shown
            if cut:
                *whole, last = lines[: max(room - 1, 1)]
                shown = [*whole, f"{last[: width - 2]} …"]
            left = len(warnings) - number + (not cut)
            break
        shown += lines
    more = [counted(left, "more warning")] if left else ["the whole of it"] if cut else []
    more += [counted(refused, "refused model")] if refused else []
    return "\n".join([*shown, *([f"- {' and '.join(more)}: see the report, or --json."] if more else [])])
