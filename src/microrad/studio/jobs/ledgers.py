"""The figures of campaigns that go on, shared by all tabs: read from their ledgers alone, a little at a time."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from microrad.campaign.records import CampaignSummary
    from microrad.campaign.statistics.interim import Interim

_MOST = 8  # ledgers that are kept in mind
_READ_S = 0.3  # for what is new, at a time: the pages stay quick, and a long ledger shows figures at once
_PAUSE_S = 2.0  # between two readings, at least
_REST = 5.0  # and so many times what the last one took: the cores are the campaign's


@dataclass(frozen=True, slots=True)
class Live:
    """What a ledger has said so far, None before that, and why it says nothing more, "" as long as it does."""

    summary: CampaignSummary | None = None
    fault: str = ""

    @property
    def rows(self) -> int:
        """Rows that the figures are of, those that have failed included."""
        return 0 if self.summary is None else sum(cell.rows for cell in self.summary.cells)

    @property
    def failed(self) -> int:
        """Rows among them without a result."""
        return 0 if self.summary is None else sum(cell.failed for cell in self.summary.cells)

    @property
    def behind(self) -> bool:
        """Whether there are rows in the ledger that were not read yet."""
        return self.summary is not None and self.summary.progress.rows_done > self.rows


@dataclass(slots=True)
class _Reader:
    """What reads one ledger, one thread at a time."""

    path: Path
    busy: threading.Lock = field(default_factory=threading.Lock)
    last: Live = field(default_factory=Live)
    due_s: float = 0.0
    interim: Interim | None = None

    def look(self) -> Live:
        if self.busy.acquire(blocking=False):  # else another tab's thread is reading
            try:
                began_s = time.monotonic()
                if began_s >= self.due_s:
                    self.last = self._read()
                    took_s = time.monotonic() - began_s
                    self.due_s = time.monotonic() + (0.0 if self.last.behind else max(_PAUSE_S, _REST * took_s))
            finally:
                self.busy.release()
        return self.last

    def _read(self) -> Live:
        from microrad.campaign.statistics.interim import Interim

        if not self.path.exists():  # not begun yet, or removed
            self.interim = None
            return Live()
        self.interim = self.interim or Interim(self.path)
        try:
            found = self.interim.look(_READ_S)
        except (ValueError, OSError) as error:
            return replace(self.last, fault=str(error) or type(error).__name__)
        except Exception as error:  # a made-up ledger may hold anything
            what = f"{self.path.name} is no ledger that microrad wrote: its contents cannot be read"
            return replace(self.last, fault=f"{what} ({type(error).__name__}: {error})")
        return self.last if found is self.last.summary and not self.last.fault else Live(found)


class LiveCampaigns:
    """What the ledgers of a working folder say so far; safe to use from several threads."""

    def __init__(self) -> None:
        """Nothing is read yet."""
        self._readers: OrderedDict[Path, _Reader] = OrderedDict()
        self._lock = threading.Lock()

    def look(self, path: Path) -> Live:
        """What a ledger says by now; the same object again where nothing is new. Takes up to half a second."""
        with self._lock:
            reader = self._readers.setdefault(path, _Reader(path))
            self._readers.move_to_end(path)
            while len(self._readers) > _MOST:
                self._readers.popitem(last=False)
        return reader.look()
