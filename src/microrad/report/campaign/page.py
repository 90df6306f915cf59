"""A campaign as one page that loads nothing, with its pictures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from microrad.campaign.records import CampaignSummary, CellSummary, Limit, OutputSummary
from microrad.report.campaign import figures, tables, words
from microrad.report.page.templates import page_of
from microrad.report.plotting.figure import Figure
from microrad.report.tables import Rows, Table
from microrad.report.view import Block, Points, Soft, Verdict, View, told

MOST_FAILED, MOST_TRACES = 40, 6
_MOST_QUANTILES = 5


def campaign_page(summary: CampaignSummary) -> str:
    """The page; every text of the campaign is escaped, and nothing is loaded from anywhere."""
    name, sha256 = summary.name, summary.hashes.get("campaign", "")
    of = Markup("<code>{}</code>, SHA-256 <code>{}\u2026</code>; mission: {}").format(
        name, sha256[:16], summary.mission_name
    )
    good = {"pass": True, "fail": False}.get(words.verdict(summary))
    lead = Verdict(words.headline(summary), [*summary.findings, *words.answers(summary, words.best(summary))], good)
    warned: list[Block] = ["Warnings:", Points(summary.warnings)] if summary.warnings else []
    blocks = [lead, Soft(words.progress_words(summary)), *warned]
    views = campaign_views(summary, campaign_figures(summary))
    return page_of(name.removesuffix(".toml"), "campaign", of, blocks, views, sha256=sha256)


def campaign_views(summary: CampaignSummary, drawn: Mapping[str, Sequence[Figure]]) -> tuple[View, ...]:
    """The parts of the page that have something to show.

    Args:
        summary: the campaign.
        drawn: its figures by section of the page, as `campaign_figures` gives them.
    """
    cell = words.best(summary)
    indices, every = tables.index_table(summary.sensitivities), "Every index and rank correlation"
    parts: dict[str, Sequence[Block]] = {
        "Over the grid": _grid(summary, cell, drawn["grid"]) if len(summary.cells) > 1 else (),
        "Limits": (_table(tables.limit_table(summary, cell), 9),) if cell is not None and summary.limits else (),
        "Outputs": () if cell is None else _outputs(cell, drawn["outputs"]),
        "Tail": () if cell is None or cell.tail is None else (*drawn["tail"], _table(tables.tail_table(cell.tail), 9)),
        "What matters": (*drawn["sensitivity"], _table(indices, 2, every)) if indices.rows else (),
        "Where rows miss a limit": drawn["region"],
        "Worst rows in time": drawn["worst"],
        "Rows without results": _failed(summary),
        "How the rows were made": _made(summary),
    }
    return tuple(View(title, blocks) for title, blocks in parts.items() if blocks)


def _table(found: Rows, words: int, folded: str = "") -> Table:
    """A table whose first columns hold words."""
    return Table("", *found, range(words), folded=folded)


def _grid(summary: CampaignSummary, cell: CellSummary | None, drawn: Sequence[Figure]) -> tuple[Block, ...]:
    keys = len(summary.cells[0].values)
    every = [_table(tables.cell_table(summary, summary.cells), keys)]
    every += [_table(tables.limited_table(summary, summary.cells), keys)] if summary.limits else []
    known = cell is not None and summary.limits and not math.isnan(cell.missed.value)
    which = "of those that miss a limit least" if known else "with results"
    detail = "" if cell is None else f"Below in detail: {cell.label}, the first {which}."
    return told(*drawn, View("Every combination", every, folded=True), detail)


def _outputs(cell: CellSummary, drawn: Sequence[Figure]) -> tuple[Block, ...]:
    found, even = tables.output_table(cell, _MOST_QUANTILES, intervals=True), words.few_values(cell)
    said = (
        "Over the rows: mean, standard deviation, and the values that a share of the rows stays below, with their "
        "intervals. \u201c\u2013\u201d: not known, there are too few rows."
    )
    numbers: list[Block] = [said, _table(found, 1)] if found.rows else []
    meanings = View("What they are", [_table(tables.meanings_table(cell), 9)])
    return told(*numbers, *even, meanings, *drawn) if numbers or even else ()


def _failed(summary: CampaignSummary) -> tuple[Block, ...]:
    found = tables.failed_table(summary, MOST_FAILED)
    return told(_table(found, 9), tables.more_failed(summary, len(found.rows))) if found.rows else ()


def _made(summary: CampaignSummary) -> tuple[Block, ...]:
    inputs = Rows(("input", "distribution"), [(each.key, each.distribution) for each in summary.inputs])
    hashes = Rows(("of", "SHA-256"), list(summary.hashes.items()))
    drawn = _table(inputs, 9) if inputs.rows else None
    return told(*words.setting(summary), drawn, _table(hashes, 9, "SHA-256 of what they depend on"))


# ------------------------------------------------------------------------------------------------------------- figures
def campaign_figures(summary: CampaignSummary) -> dict[str, tuple[Figure, ...]]:
    """The figures by the section of the page that they stand in; a section with nothing to show has none."""
    cell = words.best(summary)
    if cell is None:
        return dict.fromkeys(("grid", "outputs", "tail", "sensitivity", "region", "worst"), ())
    spread = [output for output in cell.outputs.values() if _spread(output)]
    return {
        "grid": figures.grid(summary),
        "outputs": tuple(figures.distribution(o, figures.limit_of(summary, o.name)) for o in spread),
        "tail": figures.tail(summary, cell),
        "sensitivity": figures.sensitivity(summary),
        "region": region(summary),
        "worst": tuple(
            figures.worst(summary, trace, _place(summary, k)) for k, trace in enumerate(summary.worst[:MOST_TRACES])
        ),
    }


def _place(summary: CampaignSummary, number: int) -> int:
    """How bad a row is among those of its cell, from 1: they come sorted."""
    return sum(trace.cell == summary.worst[number].cell for trace in summary.worst[: number + 1])


def _spread(output: OutputSummary) -> bool:
    """Whether there are more than two values to draw."""
    some = output.rows > 2 and output.edges.size > 2 and output.most > output.least and float(output.counts.sum()) > 0.0
    return some and words.two_values(output) is None


def region(summary: CampaignSummary) -> tuple[Figure, ...]:
    """Where the limit that is most often missed is missed; nothing where all rows are on one side of each limit.

    In the cell shown in detail, or, where its rows are all on one side, in the one with the most even split.
    """
    found = _split(summary)
    if found is None:
        return ()
    inputs = _leading(summary, found[0].output, summary.sample["cell"] == found[1])
    shown = words.best(summary)
    other = shown is not None and summary.cells[found[1]] is not shown
    note = f" No limit has rows of {shown.label} on both of its sides." if other and shown is not None else ""
    return (figures.region(summary, *found, inputs, note),) if inputs else ()


def _split(summary: CampaignSummary) -> tuple[Limit, int] | None:
    """The limit most often missed in the cell shown in detail, and that cell's number; else see `region`."""
    missed = {
        (limit.output, k): cell.missed_by[limit.output].value
        for limit in summary.limits
        for k, cell in enumerate(summary.cells)
        if limit.output in cell.missed_by and limit.output in cell.outputs and limit.output in summary.sample
    }
    split = {key: share for key, share in missed.items() if 0.0 < share < 1.0}
    if not split:
        return None
    detail = {key: share for key, share in split.items() if summary.cells[key[1]] is words.best(summary)}
    if detail:
        split = detail
    output = max(split, key=lambda key: split[key])[0]
    number = min((k for name, k in split if name == output), key=lambda k: abs(split[output, k] - 0.5))
    return next(limit for limit in summary.limits if limit.output == output), number


def _leading(summary: CampaignSummary, output: str, rows: Any) -> list[str]:
    """At most two inputs that matter most to an output, of those that differ over the rows."""
    found = [s for s in summary.sensitivities if s.output == output]
    ordered = [key for s in found for key, _ in tables.ranked(s)]
    ordered += [each.key for each in summary.inputs if each.key not in ordered]
    return [key for key in ordered if key in summary.sample and np.unique(summary.sample[key][rows]).size > 1][:2]
