"""What has to fit between the tables of a campaign file, and between them and the missions; faults are noted."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from microrad.campaign.definition.keys import OPTICAL, nearest
from microrad.campaign.definition.outputs import OUTPUTS, RADIUS
from microrad.campaign.definition.tables import MOST_RUNS, CampaignTable, LimitTable, LoopTable
from microrad.campaign.definition.values import FILE_WORD, NotedError, ValueReader, quoted_near
from microrad.campaign.records import Limit
from microrad.core.units import counted, format_input, format_quantity
from microrad.link.fade_series import FadeSeriesError
from microrad.link.fade_series import of_mission as fading_series
from microrad.loop import controller_study, coupled_study
from microrad.mirror import Variant
from microrad.mission.fields import Quantity
from microrad.mission.file import LinkFile
from microrad.mission.model import LinkMission, Mission
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.mission.tables.link import LinkRequirement


def check_loop(reader: ValueReader, table: LoopTable, missions: Sequence[LinkMission]) -> None:
    """In every cell a mission with a loop, a controller of it, and time behind the settling.

    Args:
        reader: where faults are noted.
        table: the loop that is simulated.
        missions: those of the cells.
    """
    for m in missions:
        if not isinstance(m, Mission) or m.fine_pointing is None:
            expected = "a mission with [fine_pointing], which microrad init writes, or [loop] removed"
            reader.fault("loop", None, "needs a mission with the table [fine_pointing]", expected)
            return
        if not _has_controller(reader, table.controller, m.fine_pointing):
            return
        if m.fine_pointing.mirror_file is not None and (table.axes == "one" or table.mirror is Variant.COMPARISON):
            key, expected = ("axes", "both") if table.axes == "one" else ("mirror", str(Variant.GIVEN))
            reason = "is for a mirror on each axis, and fine_pointing.mirror_file names one of several axes"
            reader.fault(f"loop.{key}", getattr(table, key), reason, f'{key} = "{expected}"')
            return
        if table.mirror is Variant.COMPARISON and m.mirror.comparison is None:
            reason = f'needs a comparison model, which the mirror "{m.mirror.name}" has not'
            reader.fault("loop.mirror", table.mirror, reason, f'mirror = "{Variant.GIVEN}"')
            return
        duration = table.duration_s or m.fine_pointing.duration_s
        settle = m.fine_pointing.settle_s if table.settle_s is None else table.settle_s
        if not duration > settle:
            reason = f"leaves {format_quantity(duration, 's')}, all of it settling ({format_quantity(settle, 's')})"
            reader.fault("loop.duration", None, reason, f'duration = "{format_quantity(4.0 * settle, "s")}" would do')
            return


def _has_controller(reader: ValueReader, controller: str, of: FinePointing) -> bool:
    names = (controller_study if of.mirror_file is None else coupled_study).names(of)
    if controller in names:
        return True
    expected = " or ".join(f'"{name}"' for name in names)
    near = quoted_near(controller, names)
    reader.fault("loop.controller", controller, "is no controller of the fine-pointing study", expected, near)
    return False


def kept(reader: ValueReader, raw: object, table: CampaignTable | None) -> tuple[str, ...]:
    """The outputs to keep in the order of `OUTPUTS`; by default all that there are but for those of the day.

    Args:
        reader: where faults are noted.
        raw: what the file has at `keep`, None where it leaves that out.
        table: the campaign's tables, None where they cannot be read.
    """
    has_loop = table is None or table.loop is not None
    if raw is None:
        groups = {"residual", "link"} if has_loop else {"link"}
        return tuple(name for name, output in OUTPUTS.items() if output.group in groups)
    if not isinstance(raw, list) or not raw:
        reader.fault("keep", raw, "is not a list with something in it", 'names of outputs: keep = ["margin"]')
        return ()
    for name in raw:
        if reader.is_output("keep", name) and OUTPUTS[name].group == "residual" and not has_loop:
            reader.fault("keep", name, "needs the fine-pointing loop", "a table [loop], or this output left out")
    return tuple(name for name in OUTPUTS if name in raw)


_OF_TABLES = (
    ("beacon_margin", "beacon", "[beacon]"),
    ("answer_margin", "answer", "[answer]"),
    ("margin_under_fades", fading_series.KEY, "[communication.fading] with a series"),
    ("optical_volume", OPTICAL, f"[{OPTICAL}]"),
)
"""Outputs that ask for a table of the mission: the output, the table's key, and the table in words."""


def with_tables(reader: ValueReader, raw: object, keep: tuple[str, ...], absent: Collection[str]) -> tuple[str, ...]:
    """The outputs to keep, by default without those of a table that the mission has not; one is refused if asked for.

    Args:
        reader: where faults are noted.
        raw: what the file has at `keep`.
        keep: the outputs to keep as far as the file says them.
        absent: tables that the mission of a cell has not.
    """
    for output, name, needed in _OF_TABLES:
        if output in keep and name in absent:
            if raw is not None:
                expected = f"a mission with {needed}, or this output left out"
                reader.fault("keep", output, f"needs the mission's table {needed}", expected)
            keep = tuple(each for each in keep if each != output)
    return keep


def check_fades(reader: ValueReader, keep: Sequence[str], files: Sequence[LinkFile]) -> None:
    """A margin under fades only with series that can be read.

    Args:
        reader: where faults are noted.
        keep: the outputs to keep.
        files: the missions of the cells.
    """
    if "margin_under_fades" not in keep:
        return
    try:
        for file in files:
            table = file.mission.communication.fading
            if table is not None and table.series is not None:
                fading_series.series_of(table, file.path.parent)
    except FadeSeriesError as error:
        expected = "a series that can be used, or this output left out"
        reader.fault("keep", "margin_under_fades", f"needs {fading_series.KEY}: {error}", expected)


def check_day(reader: ValueReader, keep: Sequence[str], absent: Collection[str]) -> None:
    """Outputs of the day only from missions that have a day.

    Args:
        reader: where faults are noted.
        keep: the outputs to keep.
        absent: tables that the mission of a cell has not.
    """
    day = [name for name in keep if OUTPUTS[name].group == "day"]
    if day and not {"orbit", "operations"}.isdisjoint(absent):
        expected = "a mission with [orbit] and [operations], which microrad init writes, or these outputs left out"
        reader.fault("keep", day, "needs the mission's tables [orbit] and [operations]", expected)


# -------------------------------------------------------------------------------------------------------------- limits
def default_limits(
    reader: ValueReader, keep: Sequence[str], r: LinkRequirement, varied: Mapping[str, Mapping[str, Any]]
) -> tuple[Limit, ...]:
    """The limits that the mission requires of the kept outputs.

    Args:
        reader: where faults are noted.
        keep: the outputs to keep.
        r: what the mission requires.
        varied: keys that vary from row to row or cell to cell, by the table that they stand in.
    """
    limits = _required(keep, r)
    for limit in limits:
        for name in (name for name, keys in varied.items() if limit.source in keys):
            reason = f"is the limit of {limit.output} as well, which is the same in all rows"
            expected = f"a table [limits.{limit.output}] with a value of its own"
            reader.fault(f"{name}.{limit.source}", None, reason, expected)
    return limits


def _required(keep: Sequence[str], r: LinkRequirement) -> tuple[Limit, ...]:
    wanted = (
        Limit("margin", r.margin_db, None, "requirement.margin"),
        Limit("margin_under_fades", r.margin_db, None, "requirement.margin"),
        Limit("residual_quantile", None, r.pointing_error_rad, "requirement.pointing_error"),
    )
    return tuple(limit for limit in wanted if limit.output in keep)


def unchecked(
    given: Collection[str], keep: Sequence[str], r: LinkRequirement, varied: Collection[str]
) -> Iterator[str]:
    """Of limits that the mission requires and [limits] leaves out: that nothing checks them.

    Args:
        given: outputs that [limits] names.
        keep: the outputs to keep.
        r: what the mission requires.
        varied: keys that vary from row to row or cell to cell.
    """
    for limit in _required(keep, r):
        if limit.output in given or limit.source in varied:
            continue
        word, bound = ("least", limit.least) if limit.most is None else ("most", limit.most)
        assert bound is not None  # each has one of the two
        asked = format_input(bound, OUTPUTS[limit.output].unit)
        yield (
            f"[limits] leaves out {limit.output}, so that {limit.source} = {asked} is not checked: a table "
            f'[limits.{limit.output}] with {word} = "{asked}" checks it'
        )


def limit(reader: ValueReader, name: str, raw: object, keep: Sequence[str]) -> Limit:
    """One limit. Raises `NotedError` with what is wrong noted.

    Args:
        reader: where faults are noted.
        name: the output.
        raw: its table under [limits].
        keep: the outputs to keep.
    """
    at = f"limits.{name}"
    if not reader.is_output(at, name):
        raise NotedError
    if name not in keep:
        reason = "is a limit of an output that is not kept"
        raise reader.fault(at, None, reason, f'"{name}" in keep, or this table removed')
    if not isinstance(raw, dict) or not raw:
        raise reader.fault(at, None, "has neither least nor most", f"[{at}] with least or most")
    table, rule = reader.table(at, LimitTable, raw), Quantity(OUTPUTS[name].unit, OUTPUTS[name].typical)
    given = {side: value for side, value in (("least", table.least), ("most", table.most)) if value is not None}
    bounds = dict(zip(given, reader.numbers(at, {side: (rule, value) for side, value in given.items()}), strict=True))
    if len(bounds) == 2 and bounds["least"] >= bounds["most"]:
        raise reader.fault(f"{at}.most", table.most, "is not above least", "a range that goes up")
    return Limit(name, bounds.get("least"), bounds.get("most"), FILE_WORD)


def half_width(reader: ValueReader, table: CampaignTable, keep: Sequence[str]) -> float:
    """The half width that a precision wants, in its output's SI unit; nan without one.

    Args:
        reader: where faults are noted.
        table: the campaign's tables.
        keep: the outputs to keep.
    """
    wanted, at = table.precision, "precision.output"
    if wanted is None or not reader.is_output(at, wanted.output, RADIUS):
        return math.nan
    if wanted.output == RADIUS and table.loop is None:
        reader.fault(at, RADIUS, "needs the fine-pointing loop", "a table [loop], or another output")
    if wanted.output != RADIUS and wanted.output not in keep:
        reader.fault(at, wanted.output, "is not kept", f'"{wanted.output}" in keep, or another output')
    rule, example = _width_of(wanted.output)
    (found,) = reader.each(reader.number, [("precision.half_width", rule, wanted.half_width, example)]) or (math.nan,)
    return found


def tell_half_width(reader: ValueReader, output: object) -> None:
    """Say of a precision without half_width, if noted, what would do there, in the unit of its output, if it is one.

    Args:
        reader: where faults are noted.
        output: what the file has at `precision.output`.
    """
    if isinstance(output, str) and (output in OUTPUTS or output == RADIUS):
        rule, example = _width_of(output)
        wanted = rule.wanted
    else:
        wanted, example = "a half width in the unit of the output", '"0.05 dB"'
    told = reader.tell_missing("precision.half_width", f"{wanted}; for example half_width = {example}")
    if told and isinstance(output, str) and output:
        reader.is_output("precision.output", output, RADIUS)


def _width_of(output: str) -> tuple[Quantity, str]:
    """The rule of a half width of an output or the radius, and an example as it stands in a file."""
    unit, typical = ("rad", "urad") if output == RADIUS else (OUTPUTS[output].unit, OUTPUTS[output].typical)
    return Quantity(unit, typical, above=0.0), f'"0.05 {typical}"' if unit else "0.001"


# --------------------------------------------------------------------------------------------------------------- whole
def check_tail(reader: ValueReader, table: CampaignTable, varying: Sequence[str], present: Mapping[str, Any]) -> None:
    """Importance sampling of the noise: one loop for all rows of a cell, and no other outputs.

    Args:
        reader: where faults are noted.
        table: the campaign's tables.
        varying: drawn keys that change the loop.
        present: the file's raw data.
    """
    if table.tail is None:
        return
    if table.loop is None:
        reader.fault("tail", None, "needs the fine-pointing loop", "a table [loop]")
    for key in varying:
        reason = "changes the loop, and a table [tail] needs the same loop in all rows"
        reader.fault(f"inputs.{key}", None, reason, "the mission's own value, or a grid of values")
    for name in [name for name in ("keep", "limits", "precision", "realisations") if name in present]:
        reader.fault(name, None, "stands beside [tail], whose rows are single errors", "one of the two removed")


def check_repeats(reader: ValueReader, table: CampaignTable, is_drawn: bool, rows: int, most_rows: int) -> None:
    """More than one row only where something makes rows differ: a drawn input, or the noise of the loop.

    Args:
        reader: where faults are noted.
        table: the campaign's tables.
        is_drawn: whether any input is.
        rows: rows of a cell in the first round.
        most_rows: rows of a cell at most.
    """
    if is_drawn or table.loop is not None or most_rows == 1:
        return
    key = "precision.at_most" if rows == 1 else "sampling" if table.runs == 1 else "runs"
    reason = f"makes {most_rows} rows that are all the same: nothing is drawn, and without [loop] there is no noise"
    alone = 'runs = 1 with sampling = "random"' + (", and no [precision]" if table.precision is not None else "")
    reader.fault(key, None, reason, f"{alone}, one row for each cell; or [inputs.KEY] with a distribution; or [loop]")


def check_minimise(reader: ValueReader, table: CampaignTable) -> None:
    """An optimisation has variables, and minimises one of them or an output.

    Args:
        reader: where faults are noted.
        table: the campaign's tables.
    """
    if table.optimise is None:
        return
    if not table.optimise.variables:
        reader.fault("optimise.variables", None, "holds no variable", "[optimise.variables.KEY] with low and high")
    wanted, names = table.optimise.minimise, [*table.optimise.variables, *OUTPUTS]
    name = wanted.removeprefix("-")
    if name in names:
        return
    near = nearest(name, names)
    sign = "-" if wanted.startswith("-") else ""
    expected = f"one of {', '.join(names)}"
    reason = "is neither a variable of the optimisation nor an output"
    reader.fault("optimise.minimise", wanted, reason, expected, near and f'"{sign}{near}"')


def check_size(reader: ValueReader, table: CampaignTable, rows: int, most_rows: int, realisations: int) -> None:
    """Runs that the noise streams have numbers for; a first round within the most.

    Args:
        reader: where faults are noted.
        table: the campaign's tables.
        rows: rows of a cell in the first round.
        most_rows: rows of a cell at most.
        realisations: runs of each row.
    """
    if table.precision is not None and most_rows < rows:
        reason = f"is below the {rows} rows of the first round"
        reader.fault("precision.at_most", table.precision.at_most, reason, f"at least {rows}")
    if most_rows * realisations > MOST_RUNS:
        reason = f"makes {most_rows} rows of {counted(realisations, 'run')} each in a cell"
        reader.fault("runs", None, reason, f"at most 2^32 = {MOST_RUNS} runs: fewer rows or realisations")
