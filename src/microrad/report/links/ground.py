"""The links to a station, as tables, sentences, a figure and plain data."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from microrad.link.ground import AtElevation, GroundLink, OtherConvention
from microrad.link.study import LinkStudy
from microrad.report.data import fields
from microrad.report.links.lines import lines_table
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLUE, ORANGE, VERMILION
from microrad.report.plotting.sheet import Axis, Legend, Line, Rule, grid
from microrad.report.quantities import quantity, signed
from microrad.report.tables import Column, Table
from microrad.report.view import Points, Soft, View, told

OVER_ELEVATION = "margin-over-elevation"
"""Name of the figure on the margin over elevation."""

_NAMES = ("range_m", "air_db", "fade_db", "fried_m", "isoplanatic_rad", "index", "margin_db")


def ground_view(study: LinkStudy, figures: Sequence[Figure] = ()) -> View | None:
    """The links to a station: over elevation, through the air, and by other conventions.

    Args:
        study: the links.
        figures: those of the links.
    """
    g = study.ground
    if g is None:
        return None
    tables = [
        lines_table(f"Turbulence on the path: {name}", lines, names=_named(name, lines)) for name, lines in g.beams
    ]
    shown = [each for each in figures if each.name == OVER_ELEVATION]
    note = _TURBULENT if g.beams else _STILL
    title = "Down to the station" if g.end == "geo" else "Up from the station"
    return View(title, told(Points(sentences(study, g)), _elevations(g), *shown, *tables, _conventions(g), note))


_TURBULENT = Soft(
    "Closed forms over flat air; a scintillation index is that of any strength, spread and wander those of weak "
    "turbulence; clouds are outside. Lost in the air is the mean power, by absorption, scattering, a wider beam and a "
    "wavefront that a fibre takes less of; to fades is lost what they add for the mission's outage."
)
_STILL = Soft("Flat and still air without clouds. Lost in it is what absorption and scattering take.")


def sentences(study: LinkStudy, g: GroundLink) -> list[str]:
    """What a reader has to know of the links to a station.

    Args:
        study: the links.
        g: what there is to say of them.
    """
    first, last = g.elevations[0], g.elevations[-1]
    at, required = degrees(first.elevation_rad), study.file.mission.requirement.margin_db
    said = [f"The links are budgeted at {at} of elevation, {quantity(first.range_m, 'm')} from {g.station}."]
    if last is not first:
        gained = quantity(last.margin_db - first.margin_db, "dB")
        said.append(f"The communication link has {gained} more at {degrees(last.elevation_rad)}.")
        closing = [each for each in g.elevations if each.margin_db >= required]
        if not closing:
            said.append(f"At no elevation has it the required {required:g} dB.")
        elif closing[0] is not first:
            from_there = degrees(closing[0].elevation_rad)
            said.append(f"Of the elevations below it has the required {required:g} dB from {from_there} on.")
    worst = max(((abs(db), of, c) for c in g.conventions for of, db in c.gained_db.items()), default=None, key=_size)
    if worst is not None and worst[0] > 0.0:
        cost, of, convention = worst
        said.append(
            f"Of the conventions that the literature leaves open, {convention.key} matters most: "
            f'"{convention.other}" in place of "{convention.given}" moves the margin of {of.lower()} by '
            f"{quantity(cost, 'dB')}."
        )
    return said


def _size(each: tuple[float, str, OtherConvention]) -> float:
    return each[0]


def degrees(angle_rad: float) -> str:
    """An elevation as text."""
    return f"{math.degrees(angle_rad):.3g} deg"


def _elevations(g: GroundLink) -> Table:
    still = math.isnan(g.elevations[0].index)
    heads = ["elevation", "range", "air", "fades", "r0", "isoplanatic", "index", "margin"]
    rows: list[tuple[str, ...]] = []
    for e in g.elevations:
        air = ("", "", "") if still else (_m(e.fried_m), quantity(e.isoplanatic_rad, "rad"), quantity(e.index, ""))
        lost = quantity(e.air_db, "dB"), quantity(e.fade_db, "dB")
        rows.append((degrees(e.elevation_rad), quantity(e.range_m, "m"), *lost, *air, signed(e.margin_db, "dB")))
    names = {k: f"ground.elevations.{name}" for k, name in enumerate(_NAMES, 1)}
    if still:
        kept = (0, 1, 2, 7)
        heads, rows = [heads[k] for k in kept], [tuple(row[k] for k in kept) for row in rows]
        names = {place: names[k] for place, k in enumerate(kept) if k}
    brief = () if still else (0, 1, 2, 3, 6, 7)
    return Table("Communication over elevation", tuple(heads), rows, (0,), brief=brief, names=names)


def _m(value: float) -> str:
    return quantity(value, "m")


def _named(name: str, lines: Sequence[Any]) -> list[str]:
    return [f"ground.beams.{name}.{line.name}.value" for line in lines]


def _conventions(g: GroundLink) -> Table | None:
    if not g.conventions:
        return None
    beams = list(g.conventions[0].gained_db)
    rows = [
        (c.key.rpartition(".")[2], c.given, c.other, *(signed(c.gained_db[of], "dB") for of in beams))
        for c in g.conventions
    ]
    heads = ("convention", "as given", "read as", *(of.lower() for of in beams))
    names = dict.fromkeys(range(3, 3 + len(beams)), "ground.conventions.gained_db")
    return Table("What other conventions would change", heads, rows, (0, 1, 2), names=names)


def over_elevation(study: LinkStudy, g: GroundLink) -> Figure:
    """Margin of the communication link over elevation, with fades and without.

    Args:
        study: the links.
        g: what there is to say of those to a station.
    """
    sheet, (panel,) = grid(6.4, 3.2)
    elevation = np.array([math.degrees(e.elevation_rad) for e in g.elevations])
    margin, fade = (np.array([getattr(e, name) for e in g.elevations]) for name in ("margin_db", "fade_db"))
    required = study.file.mission.requirement.margin_db
    panel.add(Line(elevation, margin, BLUE, marker="o", size=4.0, label="margin"))
    if np.any(fade > 0.0):
        panel.add(Line(elevation, margin + fade, ORANGE, "--", label="without fades of the air"))
    panel.add(Rule(required, False, VERMILION, ":", label="required"))
    panel.x, panel.y = Axis("elevation (deg)"), Axis("margin (dB)")
    sheet.legend = Legend("above", 3)
    caption = (
        "Margin of the communication link where the satellite stands higher or lower above the station: range, air and "
        "turbulence go with the elevation, all else is as budgeted."
    )
    columns: dict[str, Column] = {"elevation (deg)": elevation, "margin (dB)": margin, "lost to fades (dB)": fade}
    return Figure(OVER_ELEVATION, "Margin over elevation", caption, sheet, columns)


def ground_data(g: GroundLink) -> dict[str, Any]:
    """The links to a station; what still air does not have is none."""
    return {
        "end": g.end,
        "station": g.station,
        "elevations": [_elevation(e) for e in g.elevations],
        "beams": [
            {"name": name, "lines": [{**fields(line, "name", "value", "unit", "basis", "source")} for line in lines]}
            for name, lines in g.beams
        ],
        "conventions": [{**fields(c, "key", "given", "other"), "gained_db": dict(c.gained_db)} for c in g.conventions],
    }


def _elevation(e: AtElevation) -> dict[str, Any]:
    values = fields(e, "elevation_rad", *_NAMES, "rytov")
    return {name: None if math.isnan(value) else value for name, value in values.items()}
