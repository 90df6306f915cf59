"""Options of the commands that look at errors in time windows."""

from typing import TYPE_CHECKING, Any

import typer

from microrad.cli.frame import quantity_of

if TYPE_CHECKING:
    from microrad.loop.disturbance.windows import ErrorIndex
    from microrad.mission.tables.error_budget import ErrorBudget

_DEFAULT_S = [0.01, 1.0]


def time_option(name: str, text: str) -> Any:
    """An option of times, as many as are wanted.

    Args:
        name: The option.
        text: Its help, up to how often it may stand.
    """
    help_text = f"{text} may be repeated."
    return typer.Option(name, metavar="TIME", help=help_text, parser=quantity_of("s"), show_default=False)


def indices_of(windows: list[float], spacings: list[float]) -> "list[ErrorIndex]":
    """All of the error, and for each window its mean, what is left, and the differences over each spacing.

    Args:
        windows: Lengths of windows (s).
        spacings: From the begin of a window to that of another (s).

    Raises:
        ValueError: For a time that is not above 0.
    """
    from microrad.loop.disturbance.windows import ErrorIndex

    found = [ErrorIndex("APE")]
    for each in windows:
        found += [ErrorIndex("MPE", each), ErrorIndex("RPE", each)]
        found += [ErrorIndex("PDE", each, apart) for apart in spacings]
    return found


def indices_of_mission(table: "ErrorBudget | None", windows: list[float], spacings: list[float]) -> "list[ErrorIndex]":
    """The indices of the windows that are given; without any, those that requirements on the loop name.

    Args:
        table: The mission's table of errors.
        windows: As `indices_of`; 10 ms and 1 s where neither they nor the requirements say another.
        spacings: As there.

    Raises:
        ValueError: As `indices_of`, and for a requirement that cannot be.
    """
    from microrad.link.error_budget.assembly import requirement_of

    own = table is not None and table.with_loop and not windows and not spacings
    stated = [requirement_of(each).index for each in table.requirements.values()] if table is not None and own else []
    named = [each for each in dict.fromkeys(stated) if each.window_s is not None and each.kind == each.takes]
    return [*indices_of([], []), *named] if named else indices_of(windows or _DEFAULT_S, spacings)
