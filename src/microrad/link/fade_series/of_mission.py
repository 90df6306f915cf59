"""The fades that a mission states: its series, its code and its interleaver, at the power that its budget leaves."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from microrad.link.budget.assembly import DataLink
from microrad.link.budget.lines import communication_budget
from microrad.link.fade_series.coded import CodedFading, CodedLink, coded_fading
from microrad.link.fade_series.codes import code
from microrad.link.fade_series.reader import read_fade_series
from microrad.link.fade_series.records import FadeSeries, FadeSeriesError
from microrad.mission.model import Source
from microrad.mission.tables.link import Fading

KEY = "communication.fading"


def fading_of(data: DataLink, folder: Path, sources: Mapping[str, Source]) -> CodedFading | None:
    """The communication link under the series that the mission names, or None where it names none.

    The static margin of its budget is that at power 1 of the series.

    Args:
        data: The communication link.
        folder: That of the mission file.
        sources: Where each value of the mission comes from, by its dotted key.

    Raises:
        FadeSeriesError: For a series that cannot be read or used, with the line of the mission that names it.
    """
    table = data.table.fading
    if table is None or table.series is None:
        return None
    receiver = data.receiver
    target = table.bit_error_ratio if receiver is None else receiver.bit_error_ratio
    assert target is not None  # the table's own check
    try:
        link = _coded(series_of(table, folder), table, data.table.data_rate_bit_s)
        return coded_fading(link, communication_budget(data, sources).margin_db, target)
    except FadeSeriesError as error:
        own = sources.get(f"{KEY}.series")
        line = f", {own.file}, line {own.line}" if own is not None else ""
        raise FadeSeriesError(f"{KEY}{line}: {error}") from None


def series_of(table: Fading, folder: Path) -> FadeSeries:
    """The series that a table names.

    Args:
        table: The table, which names one.
        folder: That of the mission file.

    Raises:
        FadeSeriesError: For one that cannot be read or used.
    """
    assert table.series is not None  # asked before
    path = folder / table.series
    try:
        changed = path.stat()
        key = changed.st_mtime_ns, changed.st_size
    except (OSError, ValueError):
        key = 0, 0
    return _read(path, table, key)


@lru_cache(maxsize=4)  # rows of a campaign name the same file
def _read(path: Path, table: Fading, _changed: tuple[int, int]) -> FadeSeries:
    assert table.series is not None and table.unit is not None and table.normalised is not None  # its own check
    return read_fade_series(
        path,
        unit=table.unit,
        normalised=table.normalised,
        period_s=table.sampling_s,
        channel=table.channel,
        name=table.series,
    )


@lru_cache(maxsize=8)  # so that what the fades cost is found once
def _coded(series: FadeSeries, table: Fading, data_rate_bit_s: float) -> CodedLink:
    return CodedLink(code(table.code), series, data_rate_bit_s, table.interleaving, table.interleaver_s or 0.0)
