"""What the page of runs shows of a campaign's rows, finished or not: the report's views of them, and its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from microrad.campaign.records import CampaignSummary
from microrad.report.campaign import words
from microrad.report.campaign.page import campaign_figures, campaign_views
from microrad.report.view import Block, Points, told
from microrad.studio.jobs.ledgers import Live
from microrad.studio.views.plots import Plot, figure

_FOLDED = ("What matters", "How the rows were made")


@dataclass(frozen=True, slots=True)
class Figures:
    """What the rows of a ledger say: `rows` tells which rows that is; `plots` by the title that they are chosen by."""

    rows: str
    headline: str
    blocks: Sequence[Block]
    plots: dict[str, Plot]


def figures(live: Live) -> Figures | None:
    """The figures of a ledger, None where it has no rows yet. It takes a while the first time."""
    summary = live.summary
    if summary is None or not live.rows:
        return None
    drawn = campaign_figures(summary)
    limited = {f"campaign-{limit.output}" for limit in summary.limits}
    ordered = sorted((each for part in drawn.values() for each in part), key=lambda each: each.name not in limited)
    views = campaign_views(summary, dict.fromkeys(drawn, ()))
    said = Points([*summary.findings, *words.answers(summary, words.best(summary))])
    warned = ("Warnings:", Points(summary.warnings)) if summary.warnings else ()
    return Figures(
        rows=_rows(live, summary),
        headline=words.headline(summary),
        blocks=told(said, *warned, *(replace(each, folded=each.title in _FOLDED) for each in views)),
        plots={each.title: figure(each.sheet) for each in ordered},
    )


def _rows(live: Live, summary: CampaignSummary) -> str:
    count = "1 row" if live.rows == 1 else f"{live.rows} rows"
    if summary.progress.state == "complete" and not live.behind:
        return f"Of all {count}" if live.rows > 1 else "Of the only row"
    wanted = summary.progress.rows_total
    more = f" ({wanted} are wanted)" if wanted > live.rows else ""
    read = "; the others in the ledger are being read" if live.behind else ""
    return f"Of {count} so far{more}{read}"
