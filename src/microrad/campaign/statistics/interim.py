"""What the rows of a campaign say while it goes on: its ledger read again and again, each chunk once."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from microrad.campaign import bundle
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.ledger import Head, Ledger
from microrad.campaign.records import CampaignSummary, CellSummary
from microrad.campaign.rows.plan import planned
from microrad.campaign.statistics import summary
from microrad.campaign.statistics.cell import CellRows


class Interim:
    """The campaign in a ledger, which another process may be writing to; in one thread at a time.

    Nothing is added to it, and no lock is held that the writer would wait for.
    """

    def __init__(self, path: Path) -> None:
        """Nothing is read yet; the file need not be there."""
        self.path = path
        self.found: CampaignSummary | None = None
        self._head: Head | None = None
        self._campaign: CampaignFile | None = None
        self._cells: list[CellRows] = []
        self._mark, self._chunks = 0, 0
        self._state: object = None

    def look(self, patience_s: float = math.inf) -> CampaignSummary:
        """The campaign as far as it was read, after reading what is new for ``patience_s`` at most.

        Without sensitivities, sample and traces; outputs and tail are those of the cell that misses its limits least
        alone. ``progress.rows_done`` are the rows in the ledger: more than those of the cells while some are to be
        read. The same object again where nothing is new. Raises `CampaignError` if there is no ledger, and for a
        damaged one.
        """
        end = time.monotonic() + patience_s
        with Ledger.open(self.path, write=False) as book:
            count, notes, head = book.count(), book.notes(), book.head
            if head != self._head or count < self._chunks:  # another campaign's by now, or chunks were taken out
                self._begin(head)
            assert self._campaign is not None
            fresh = self._take(book, end)
            if self.found is None or fresh or notes.get("state") != self._state:
                self._state = notes.get("state")
                self.found = self._summary(head, self._campaign, max(count - self._chunks, 0), notes)
        return self.found

    def _begin(self, head: Head) -> None:
        """Begin anew."""
        campaign = bundle.opened(head.bundle, any_code=True).campaign  # its files go at once: nothing reads them again
        self._head, self._campaign = head, campaign
        self._cells = [CellRows(campaign, number) for number in range(len(campaign.cells))]
        self._mark, self._chunks, self.found = 0, 0, None

    def _take(self, book: Ledger, end: float) -> bool:
        """Read what is new; whether anything was."""
        before = self._chunks
        for mark, chunk in book.added(self._mark):
            self._cells[chunk.cell].take(chunk)
            self._mark, self._chunks = mark, self._chunks + 1
            if time.monotonic() > end:
                break
        return self._chunks > before

    def _summary(self, head: Head, campaign: CampaignFile, unread: int, notes: Mapping[str, Any]) -> CampaignSummary:
        """What was read, and how far it is with the chunks that were not."""
        found = [cell.summary(()) for cell in self._cells]
        shown = min(range(len(found)), key=lambda number: _order(found[number]))
        found[shown] = self._cells[shown].summary()
        plan = planned(campaign)
        done = sum(cell.rows for cell in self._cells) + unread * plan.chunk_rows
        pace = summary.progress(done, plan.rounds[0] * len(found), notes, written=True)
        return summary.assembled(head, campaign, self._cells, found, pace)


def _order(cell: CellSummary) -> tuple[bool, float]:
    """The cell that misses its limits least comes first, one without results last."""
    missed = cell.missed.value
    return cell.rows == cell.failed, math.inf if math.isnan(missed) else missed
