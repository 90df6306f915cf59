"""The models of an identification as they are fitted, read from a job's folder by the page that looks on."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from microrad.lab.live_fit import LIVE_FITS, LiveFit
from microrad.studio.guard import plain_files

_MOST_BYTES = 20_000_000


def read_fits(folder: Path) -> tuple[LiveFit, ...]:
    """The models of a job so far, in the order in which they were fitted; a line that is being written is left out."""
    from pydantic import TypeAdapter

    try:
        with plain_files.opened(folder / LIVE_FITS) as file:
            lines = file.read(_MOST_BYTES).splitlines()
    except OSError:
        return ()
    found, kind = [], TypeAdapter(LiveFit)
    for line in lines:
        with suppress(ValueError):
            found.append(kind.validate_json(line))
    return tuple(found)


def leader(fits: tuple[LiveFit, ...], chosen: str = "") -> LiveFit | None:
    """The model that was chosen in the end, as it was fitted last; until then the best so far. None without one.

    Of models that differ by chance alone the end prefers what never moves the wrong way: it need not choose the best.
    """
    ended = [fit for fit in fits if fit.model == chosen]
    return ended[-1] if ended else best(fits)


def best(fits: tuple[LiveFit, ...]) -> LiveFit | None:
    """The model with the least residual on the held-out samples, of two that are alike the later; None without one."""
    return min(reversed(fits), key=lambda fit: fit.held_out_rms_percent, default=None)
