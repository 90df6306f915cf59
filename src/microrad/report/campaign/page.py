"""A campaign as one page that loads nothing, with its pictures."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from microrad.campaign.records import CampaignSummary, CellSummary, Limit, OutputSummary
from microrad.report.campaign import figures, tables, words
from microrad.report.page.templates import render
from microrad.report.plotting.figure import Figure
from microrad.report.tables import Rows

MOST_FAILED, MOST_TRACES = 40, 6
_MOST_QUANTILES = 5


def campaign_page(summary: CampaignSummary) -> str:
    """The page; every text of the campaign is escaped, and nothing is loaded from anywhere."""
    return render("campaign/campaign.html", campaign_section(summary, campaign_figures(summary)))


def campaign_section(summary: CampaignSummary, drawn: Mapping[str, Any]) -> dict[str, Any]:
    """What the template needs; ``drawn`` are its figures by section."""
    cell = words.best(summary)
    failed, several = tables.failed_table(summary, MOST_FAILED), len(summary.cells) > 1
    return {
        "mission": {"name": summary.name.removesuffix(".toml")},
        "mission_name": summary.mission_name,
        "study": {"file": {"path": {"name": summary.name}, "sha256": summary.hashes.get("campaign", "")}},
        **_of_cell(summary, cell),
        "verdict": words.verdict(summary),
        "headline": words.headline(summary),
        "findings": summary.findings,
        "answers": words.answers(summary, cell),
        "progress": words.progress_words(summary),
        "warnings": summary.warnings,
        "combinations": tables.cell_table(summary, summary.cells) if several else None,
        "limited": tables.limited_table(summary, summary.cells) if several and summary.limits else None,
        "keys": len(summary.cells[0].values) if summary.cells else 0,
        "indices": tables.index_table(summary.sensitivities),
        "figures": drawn,
        "failed": failed,
        "more_failed": tables.more_failed(summary, len(failed.rows)),
        "setting": words.setting(summary),
        "inputs": Rows(("input", "distribution"), [(each.key, each.distribution) for each in summary.inputs]),
        "hashes": Rows(("of", "SHA-256"), list(summary.hashes.items())),
    }


def _of_cell(summary: CampaignSummary, cell: CellSummary | None) -> dict[str, Any]:
    """Limits and outputs of the cell shown in detail; nothing where no row has results."""
    if cell is None:
        return {"detail": "", "limits": None, "outputs": None, "even": [], "meanings": None, "tail": None}
    return {
        "detail": cell.label,
        "limits": tables.limit_table(summary, cell) if summary.limits else None,
        "outputs": tables.output_table(cell, _MOST_QUANTILES, intervals=True),
        "tail": None if cell.tail is None else tables.tail_table(cell.tail),
        "even": words.few_values(cell),
        "meanings": tables.meanings_table(cell),
    }


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
