"""A series of received power from a file: text, NumPy, HDF5, and whatever else a laboratory's recording may be."""

from pathlib import Path

from microrad.core.units import format_limit
from microrad.lab.recording import RecordingError, read_signal
from microrad.link.fade_series.records import LEAST_SAMPLES, FadeSeries, FadeSeriesError, Normalisation, Unit, check
from microrad.mission.fields import Quantity

MOST_BYTES = 200_000_000
"""Largest file that is read."""

_LEVELS = ("db", "dbm", "dbw")


def read_fade_series(
    path: str | Path,
    *,
    unit: Unit,
    normalised: Normalisation,
    period_s: float | None = None,
    channel: str | int | None = None,
    name: str = "",
) -> FadeSeries:
    """Read a series of relative received power, one channel of a file.

    The sampling is what the file says: a column of times, or a scalar such as `dt` or `fs` beside the powers. Where it
    says nothing it has to be given; it is never guessed, and where both are known they have to agree to 0.1 %.

    Args:
        path: The file: CSV or other text, NPY, NPZ, HDF5, or another one that `lab.recording` reads.
        unit: "linear" for ratios or W, "dB" for levels of 10 log10.
        normalised: What power 1 is: "mean", "largest", or "as-given".
        period_s: Time between two samples, in s, where the file does not say it.
        channel: Name or number of the powers in the file; by default the only one beside the time.
        name: What the series is called in messages and reports; by default the path.

    Raises:
        FadeSeriesError: For a file that cannot be read, is empty or larger than 200 MB, holds several channels of which
            none was named, states another unit or no sampling, has an uneven time, and whatever `FadeSeries.of`
            refuses.
    """
    path, called = Path(path), name or str(path)
    if period_s is not None:
        check("the sampling period", period_s, Quantity("s", above=0.0), called)
    try:
        if path.is_file() and path.stat().st_size > MOST_BYTES:
            raise FadeSeriesError(
                f"{called}: the file has {format_limit(path.stat().st_size, 'B', least=True)} and at most "
                f"{MOST_BYTES / 1e6:.0f} MB are read; cut out a part, or keep every n-th sample if its fades allow "
                "that."
            )
        found = read_signal(path, channel, None if period_s is None else 1.0 / period_s)
    except RecordingError as error:
        raise FadeSeriesError(str(error)) from None
    if found.unit and (found.unit.casefold() in _LEVELS) != (unit == "dB"):
        raise FadeSeriesError(
            f"{called}: the file says that the powers are in {found.unit}, and the unit given is {unit!r}; give the "
            "one that the file says, or correct it."
        )
    if found.rate_hz is None and found.samples.size >= LEAST_SAMPLES:
        raise FadeSeriesError(
            f"{called}: the file does not say how fast it was sampled; give the time between two samples (sampling, "
            "period_s), or a column of times."
        )
    period = 1.0 / (found.rate_hz or 1.0)
    return FadeSeries.of(found.samples, period, called, unit=unit, normalised=normalised, sha256=found.sha256)
