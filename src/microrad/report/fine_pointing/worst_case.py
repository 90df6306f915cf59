"""The worst case of a loop over its identified mirror: tables for people, and the same as data."""

import math
from dataclasses import asdict
from typing import Any

from microrad.core.units import format_quantity
from microrad.loop.worst_case import InTime, WorstCase
from microrad.report.fine_pointing.windows import index_name, index_text
from microrad.report.quantities import angle, counted, minus, percent, quantity
from microrad.report.tables import Table, tables_text


def worst_case_text(found: WorstCase, width: int) -> str:
    """The figures, where they are worst, what they depend on and how the worst loop does in time, for a terminal.

    Args:
        found: The worst case.
        width: Columns of the terminal.
    """
    extent, heads = found.extent, [index_name(index) for index in found.indices]
    about = (
        f"The loop under {found.controller} on {counted(extent.draws, 'mirror')} drawn from what is known of its "
        f"mirror, and on {counted(found.corners, 'corner')} of its "
        f"{counted(len(found.most_sensitive), 'most sensitive parameter')} at {extent.sigmas:g} "
        "standard errors. In theory (linear); errors are radial rms."
    )
    rows: list[tuple[str, ...]] = [
        (index_text(index), *map(_error, (own, drawn.median, drawn.worse, worst.value)))
        for index, own, drawn, worst in zip(
            found.indices, found.nominal_rad, found.drawn_rad, found.largest_rad, strict=True
        )
    ]
    drawn = found.drawn_modulus
    margins = (found.nominal_modulus, drawn.median, drawn.worse, found.smallest_modulus.value)
    rows.append(("modulus margin", *(f"{value:.4f}" for value in margins)))
    figures = Table("", ("figure", "as identified", "median", "95 % of draws", "worst"), rows)
    columns, worst = ("parameter", *heads, "modulus\nmargin"), (*found.largest_rad, found.smallest_modulus)
    changes = [(each.parameter, *map(_change, (*each.rms, each.modulus))) for each in found.most_sensitive]
    places = [
        (each.parameter, *(minus(f"{at.sigmas[each.parameter]:+.1f}") for at in worst)) for each in found.most_sensitive
    ]
    tables = [
        figures,
        Table("Most sensitive parameters: change by one standard error", columns, changes),
        Table("Where each figure is worst, in standard errors", columns, places),
    ]
    said = [*_unstable(found), in_time(found.verified_in_time)]
    return f"{tables_text([], [about], width).strip()}\n\n{tables_text(tables, said, width).rstrip()}"


def _error(value_rad: float) -> str:
    return quantity(value_rad, "rad", 5) if math.isfinite(value_rad) else "unstable"


def _change(share: float) -> str:
    return percent(share) if math.isfinite(share) else "unstable"


def _unstable(found: WorstCase) -> list[str]:
    said = []
    if found.corners_left_out:
        are = "is no mirror and is" if found.corners_left_out == 1 else "are no mirrors and are"
        said.append(f"{counted(found.corners_left_out, 'corner')} {are} left out.")
    if found.unstable_draws or found.unstable_corners:
        draws, corners = f"{found.unstable_draws} of the draws", f"{found.unstable_corners} of the corners"
        said.append(f"The loop is unstable on {draws} and on {corners}: no margin, and an error without bound.")
    return said


def in_time(seen: InTime) -> str:
    """How the loop with the smallest margin does in time, in a sentence."""
    courses = {"settles": "settles", "grows": "does not settle"}
    linear, full = courses[seen.linear], courses[seen.with_hysteresis]
    does = linear if linear == full else f"{linear} without hysteresis and limits, and {full} with them"
    agrees = "as its largest pole says" if seen.agrees else "against what its largest pole says"
    return (
        f"Simulated at the smallest margin for {format_quantity(seen.seconds, 's', 3)}, from an offset of "
        f"{angle(seen.offset_rad)}, without disturbances: the loop {does}, {agrees} (|z| = {seen.pole:.6f})."
    )


def worst_case_data(found: WorstCase) -> dict[str, Any]:
    """The same as data: rms in rad, parameters in standard errors.

    Args:
        found: The worst case.
    """
    data = asdict(found)
    seen = found.verified_in_time
    verified = {**data.pop("verified_in_time"), "theory": seen.theory, "agrees": seen.agrees}
    by_index = [data.pop(name) for name in ("indices", "nominal_rad", "drawn_rad", "largest_rad")]
    errors = [
        {
            "index": index["kind"],
            "window_s": index["window_s"],
            "spacing_s": index["spacing_s"],
            "nominal_rad": own,
            "drawn_rad": drawn,
            "largest_rad": worst,
        }
        for index, own, drawn, worst in zip(*by_index, strict=True)
    ]
    return {**data, "errors": errors, "verified_in_time": verified}
