"""Pointing errors of simulated runs in time windows: a table for people, and the same as data."""

import math
from collections.abc import Sequence
from typing import Any

from microrad.loop.pointing_loop.simulated_windows import SimulatedErrors
from microrad.report.fine_pointing.windows import index_name
from microrad.report.quantities import micro
from microrad.report.tables import Table
from microrad.report.view import Points, View


def simulated_view(errors: Sequence[SimulatedErrors], runs: int) -> View:
    """The indices of runs beside those of linear theory, with their intervals.

    Args:
        errors: One for each index.
        runs: How many runs there were.
    """
    rows = [
        (
            index_name(each.index).replace("\n", " "),
            micro(each.linear_rad),
            micro(each.rms_rad),
            "unknown" if math.isinf(each.interval_rad) else f"± {micro(each.interval_rad)}",
        )
        for each in errors
    ]
    table = Table("Simulated, with hysteresis", ("index", "linear", "simulated", "99 % interval"), rows)
    about = (
        "Radial rms in µrad, both at the control samples: linear in theory, simulated on the mission's mirror. "
        f"Number of runs: {runs}; their spread gives the interval."
    )
    return View(table.title, [table, Points([about])])


def simulated_data(errors: Sequence[SimulatedErrors]) -> list[dict[str, Any]]:
    """The same as data: rms in rad, the interval as its half width, None where it is not known.

    Args:
        errors: One for each index.
    """
    return [
        {
            "index": each.index.kind,
            "window_s": each.index.window_s,
            "spacing_s": each.index.spacing_s,
            "linear_rad": each.linear_rad,
            "simulated_rad": each.rms_rad,
            "interval_rad": None if math.isinf(each.interval_rad) else each.interval_rad,
            "simulated_by_axis_rad": each.axis_rms_rad.tolist(),
        }
        for each in errors
    ]
