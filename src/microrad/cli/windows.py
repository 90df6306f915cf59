"""Options of the commands that look at errors in time windows."""

from typing import TYPE_CHECKING, Any

import typer

from microrad.cli.frame import quantity_of

if TYPE_CHECKING:
    from microrad.loop.disturbance.windows import ErrorIndex


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
