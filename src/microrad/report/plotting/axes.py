"""A sheet on matplotlib's axes: new ones, or those of the caller. Matplotlib is loaded when something is drawn."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from microrad.core.installing import advice
from microrad.report.plotting import scales
from microrad.report.plotting.layout import INCH, LEAST_MARKER, SWATCH, SWATCH_GAP, Key, Layout, Placed, layout
from microrad.report.plotting.palette import BLACK, CIVIDIS, WHITE
from microrad.report.plotting.sheet import Area, Axis, Bars, Dash, Ends, Field, Line, Rule, Sheet, Span, Words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GRID: dict[str, Any] = {"color": "#dddddd", "linewidth": 0.6}
_PLAIN: dict[str, Any] = {"parse_math": False}  # names may have dollar signs in them
_ACROSS = {"start": "left", "middle": "center", "end": "right"}
_UP = {"top": "top", "middle": "center", "bottom": "bottom"}
_TITLE = 10.0  # points, of titles of axes in matplotlib's own style
_LEAST = 12  # characters of a line
_DARK = CIVIDIS[3]  # behind white words
_HIGHEST = 1e30  # in place of infinity, which contours leave out


def axes_of(sheet: Sheet, axes: Any = None) -> Any:
    """Draw a sheet on matplotlib's axes, a pair for each of its panels.

    Given axes keep their scales where a panel has a linear one, and their limits are only widened where they have data.

    Args:
        sheet: what is drawn.
        axes: one, or a sequence or an array of them; None makes a new figure of the sheet's size.

    Returns:
        The axes: one where the sheet has one panel, else an array (panels,) of them.

    Raises:
        ImportError: Where matplotlib is not installed.
        TypeError: For axes that are none of matplotlib's.
        ValueError: For more or fewer axes than the sheet has panels, and for a sheet without any.
    """
    if not sheet.panels:
        raise ValueError(f"there is nothing to plot: {sheet.heading}")
    drawn = _made(sheet) if axes is None else _given(sheet, axes)
    found = layout(sheet)
    for ax, of in zip(drawn, found.placed, strict=True):
        _panel(ax, of)
        _ticks_and_titles(ax, of, drawn)
    _legends(drawn, found, new=axes is None)
    return drawn[0] if len(drawn) == 1 else np.array(drawn, dtype=object)


# ---------------------------------------------------------------------------------------------------------------- axes
def _made(sheet: Sheet) -> list[Axes]:
    """The axes of a new figure."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(
            f"matplotlib is not installed, and plots are drawn with it: install it {advice('plot')}"
        ) from error
    figure = pyplot.figure(figsize=(sheet.width, sheet.height), layout="constrained")
    places = figure.add_gridspec(
        len(sheet.heights), len(sheet.widths), height_ratios=sheet.heights, width_ratios=sheet.widths
    )
    made: list[Axes] = []
    for panel in sheet.panels:
        place = places[panel.row, panel.column : panel.column + panel.columns]
        first = made[0] if made else None
        shared = {"sharex": first if sheet.share_x else None, "sharey": first if sheet.share_y else None}
        made.append(figure.add_subplot(place, **shared))
    if sheet.heading:
        figure.suptitle(sheet.heading, color=sheet.heading_colour, fontsize="small", **_PLAIN)
    return made


def _given(sheet: Sheet, axes: Any) -> list[Axes]:
    """The caller's axes, as many as there are panels."""
    from matplotlib.axes import Axes

    several = np.ravel(np.array(axes, dtype=object)).tolist()
    for each in several:
        if not isinstance(each, Axes):
            raise TypeError(
                f"axes: a {type(each).__name__} was given; give one matplotlib.axes.Axes for each panel, such as those "
                "of matplotlib.pyplot.subplots"
            )
    if len(several) != len(sheet.panels):
        named = ", ".join(" over ".join(filter(None, (p.y.title, p.x.title))) or p.title for p in sheet.panels)
        raise ValueError(
            f"axes: {len(several)} given, and there are {len(sheet.panels)} panels to draw ({named}); give as many, or "
            "none for a new figure"
        )
    return several


# --------------------------------------------------------------------------------------------------------------- panels
def _panel(ax: Axes, of: Placed) -> None:
    """Scales, marks and limits of a panel."""
    panel = of.panel
    x_before = ax.get_xlim() if ax.has_data() and not ax.get_autoscalex_on() else None
    y_before = ax.get_ylim() if ax.has_data() and not ax.get_autoscaley_on() else None
    if panel.x.log:
        ax.set_xscale("log")
    if panel.y.log:
        ax.set_yscale("log")
    if panel.face:
        ax.set_facecolor(panel.face)
    if panel.equal:
        ax.set_aspect("equal")
    for mark in panel.marks:
        _MAKERS[type(mark)](ax, of, mark)
    ax.set_autoscalex_on(x_before is not None or ax.get_autoscalex_on())
    ax.set_autoscaley_on(y_before is not None or ax.get_autoscaley_on())
    ax.autoscale_view()
    if (ends := _ends(panel.x, ax.get_xlim(), x_before)) is not None:
        ax.set_xlim(*ends)
    if (ends := _ends(panel.y, ax.get_ylim(), y_before)) is not None:
        ax.set_ylim(*ends)


def _ends(axis: Axis, now: Ends, before: Ends | None) -> Ends | None:
    """The limits that an axis sets, widened to those that were fixed for other data before; None where it sets none.

    Args:
        axis: of the sheet; the end that it does not set is that of the data.
        now: limits of the data.
        before: those that were fixed before, if any.
    """
    given = [None if end is None or (axis.log and end <= 0.0) else end for end in (axis.low, axis.high)]
    if given == [None, None] and before is None:
        return None
    low, high = (found if end is None else end for end, found in zip(given, now, strict=True))
    if before is None or low > high or before[0] > before[1]:
        return low, high
    return min(low, before[0]), max(high, before[1])


def _ticks_and_titles(ax: Axes, of: Placed, drawn: Sequence[Axes]) -> None:
    """Grid, ticks and titles, but for those that other axes have which share a scale with these."""
    from matplotlib.ticker import FixedLocator

    panel = of.panel
    x_away = not of.x_shown and ax.get_shared_x_axes().joined(ax, drawn[-1])
    y_away = not of.y_shown and ax.get_shared_y_axes().joined(ax, drawn[0])
    ax.set_axisbelow(True)
    sides: Any = (("x", panel.x, x_away, of.x_title), ("y", panel.y, y_away, of.y_title))
    for (name, axis, away, title), room in zip(sides, _room(ax), strict=True):
        which = ax.xaxis if name == "x" else ax.yaxis
        which.grid(axis.grid, **(_GRID if axis.grid else {}))
        if axis.words:
            which.set_ticks([*axis.words], [*axis.words.values()], **_PLAIN)
        elif axis.ticks is not None and axis.log:
            which.set_ticks([*axis.ticks], [f"{at:g}" for at in axis.ticks])
        elif axis.ticks is not None:
            which.set_major_locator(FixedLocator([*axis.ticks], nbins=max(2, int(room / scales.EACH[name]))))
        if axis.log and axis.ticks is not None:
            which.set_ticks([], minor=True)
        if away:
            ax.tick_params(name, **{"labelbottom" if name == "x" else "labelleft": False})
        else:
            which.set_label_text(_broken(title, room, _TITLE), **_PLAIN)
    if panel.title:
        ax.set_title(_broken(panel.title, _room(ax)[0], _TITLE), fontsize="medium", **_PLAIN)


def _room(ax: Axes) -> tuple[float, float]:
    """Width and height of axes in points, about: their place is settled when they are drawn."""
    box, dots = ax.get_window_extent(), ax.figure.dpi / INCH
    return box.width / dots, box.height / dots


def _broken(text: str, room: float, size: float) -> str:
    """A text in as many lines as it needs to be no longer than a room.

    Args:
        text: in one line or several.
        room: points.
        size: of its letters, points.
    """
    wide = scales.width_of(text, size)
    if wide <= room:
        return text
    most = max(int(len(text) * room / wide), _LEAST)
    return "\n".join(textwrap.fill(line, most, break_long_words=False) for line in text.split("\n"))


# ---------------------------------------------------------------------------------------------------------------- marks
def _line(ax: Axes, of: Placed, line: Line) -> None:
    ax.plot(
        line.x,
        line.y,
        color=line.colour,
        linestyle=_style(line.dash),
        linewidth=line.width,
        drawstyle="steps-post" if line.steps else "default",
        marker=line.marker or "None",
        markersize=line.size,
        markerfacecolor=line.inside or "none",
        markeredgecolor=line.around,
        markeredgewidth=0.0 if line.marker == "." else line.edge_width,
        markevery=None if line.every is None else [*line.every],
        label=line.label or None,
        clip_on=line.clip,
    )
    if line.x_arms is not None or line.y_arms is not None:
        bars: dict[str, Any] = {"ecolor": line.colour, "elinewidth": 1.0, "capsize": 3.0}
        ax.errorbar(line.x, line.y, xerr=line.x_arms, yerr=line.y_arms, fmt="none", label=None, **bars)


def _style(dash: Dash) -> Any:
    return (dash or "None") if isinstance(dash, str) else (0.0, dash)


def _rule(ax: Axes, of: Placed, rule: Rule) -> None:
    draw = ax.axvline if rule.upright else ax.axhline
    draw(rule.at, color=rule.colour, linestyle=_style(rule.dash), linewidth=rule.width, label=rule.label or None)


def _span(ax: Axes, of: Placed, span: Span) -> None:
    draw = ax.axvspan if span.upright else ax.axhspan
    draw(*of.within(span), facecolor=span.colour, alpha=span.opacity, edgecolor="none", label=span.label or None)


def _area(ax: Axes, of: Placed, area: Area) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    rings = [Path(np.vstack([ring, ring[:1]]), closed=True) for ring in area.rings if len(ring) > 2]
    if rings:
        look: dict[str, Any] = {"facecolor": area.colour, "alpha": area.opacity, "edgecolor": area.edge or "none"}
        if area.hatched:
            look = {"facecolor": "none", "edgecolor": area.colour, "hatch": "////"}
        width = 0.0 if area.hatched else area.edge_width
        ax.add_patch(PathPatch(Path.make_compound_path(*rings), linewidth=width, label=area.label or None, **look))


def _bars(ax: Axes, of: Placed, bars: Bars) -> None:
    look: dict[str, Any] = {"facecolor": bars.colour, "edgecolor": bars.edge or "none", "linewidth": 0.5}
    look["alpha"] = bars.opacity
    long, label = bars.end - bars.start, bars.label or None
    if bars.upright:
        ax.bar(bars.at, long, bars.breadth, bottom=bars.start, label=label, **look)
    else:
        ax.barh(bars.at, long, bars.breadth, left=bars.start, label=label, **look)


def _field(ax: Axes, of: Placed, field: Field) -> None:
    look: dict[str, Any] = {"cmap": "cividis", "vmin": field.low, "vmax": field.high}
    if field.levels is None:
        drawn: Any = ax.pcolormesh(field.x, field.y, field.z, shading="nearest", **look)
    else:
        drawn = ax.contourf(
            field.x, field.y, np.clip(field.z, -_HIGHEST, _HIGHEST), field.levels, extend="both", **look
        )
    if field.title:
        bar = ax.figure.colorbar(drawn, ax=ax, ticks=[*of.bar_ticks] or scales.rounds(field.low, field.high, 8))
        bar.ax.yaxis.set_label_text(field.title, **_PLAIN)


def _words(ax: Axes, of: Placed, words: Words) -> None:
    coordinates: Any = tuple("axes fraction" if which in words.of_panel else "data" for which in "xy")
    ax.annotate(
        words.text,
        (words.x, words.y),
        words.shift,
        xycoords=coordinates,
        textcoords="offset points",
        color=words.colour,
        fontsize="small",
        ha=_ACROSS[words.anchor],
        va=_UP[words.base],
        bbox={"facecolor": WHITE, "alpha": 0.75, "edgecolor": "none", "pad": 0.0} if words.box else None,
        **_PLAIN,
    )


_MAKERS: dict[type, Callable[[Any, Placed, Any], None]] = {
    Line: _line,
    Rule: _rule,
    Span: _span,
    Area: _area,
    Bars: _bars,
    Field: _field,
    Words: _words,
}


# -------------------------------------------------------------------------------------------------------------- legends
def _legends(drawn: Sequence[Axes], found: Layout, *, new: bool) -> None:
    """Legends of panels; that of a sheet stands above or below a new figure, and in the first of given axes."""
    for key in found.keys:
        if key.panel is not None:
            _legend_of_panel(drawn[key.panel], key, found.placed[key.panel])
        elif new:
            side = "lower" if key.of.place == "below" else "upper"
            _legend(drawn[0].figure, drawn, key, found.width, {"loc": f"outside {side} center"})
        else:
            _legend(drawn[0], drawn, key, 0.0, {"loc": "best"})


def _legend_of_panel(ax: Axes, key: Key, of: Placed) -> None:
    """In its place, or above the panel where it is wider than that."""
    wide, place = _room(ax)[0], key.of.place
    if place == "above" or (key.width > wide and not of.panel.title):
        _legend(ax, [ax], key, wide, {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)})
    else:
        _legend(ax, [ax], key, wide, {"loc": "best" if place in ("below", "right") else place})


def _legend(on: Any, drawn: Sequence[Axes], key: Key, room: float, place: Mapping[str, Any]) -> None:
    """A legend of axes on one of them or on their figure.

    Args:
        on: where it stands.
        drawn: the axes.
        key: what the layout knows of it.
        room: points across; where it needs more it has one column, 0 for any.
        place: as matplotlib takes it.
    """
    named: dict[str, Any] = {}
    for ax in drawn:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if not named:
        return
    plain, columns = key.of.colour == BLACK, key.of.columns if key.width < room else 1
    labels = [_broken(label, room - SWATCH - 3.0 * SWATCH_GAP, key.of.size) if room else label for label in named]
    look: dict[str, Any] = {"fontsize": "small", "title_fontsize": "small", "facecolor": "inherit" if plain else _DARK}
    look["framealpha"] = None if plain else 1.0
    legend = on.legend([*named.values()], labels, title=key.of.title or None, ncols=columns, **place, **look)
    for text in (*legend.get_texts(), legend.get_title()):
        text.set_parse_math(False)
        if not plain:
            text.set_color(key.of.colour)
    for handle in legend.legend_handles:
        if getattr(handle, "get_marker", str)() == ".":  # too small to be seen
            handle.set_markersize(2.0 * LEAST_MARKER)
