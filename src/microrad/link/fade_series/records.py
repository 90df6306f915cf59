"""A series of relative received power in time: what it is, what it is normalised to, how long its fades are."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats, reals
from microrad.core.errors import MicroradError
from microrad.core.units import counted, format_limit, format_quantity
from microrad.mission.fields import Quantity

Unit = Literal["linear", "dB"]
"""How powers are given: as ratios, or as levels of 10 log10."""

Normalisation = Literal["mean", "largest", "as-given"]
"""What power 1 of a series is: its mean, its largest power, or 1 as it is given."""

MOST_SAMPLES = 2_000_000
"""Longest series that is taken; all of it is gone through some hundred times."""

LEAST_SAMPLES = 200
MOST_UNRESOLVED = 0.1
"""Share of the faded time in fades of a single sample from which on a series is refused as sampled too slowly.

A fade of one sample lasts between nothing and two periods. Where the samples know nothing of each other nearly all of
the faded time is such; where a fade has some samples it tends to none.
"""


class FadeSeriesError(MicroradError):
    """A series of powers that cannot be used: the message says what, where, the limit, and what to do."""

    page = "link"


@dataclass(frozen=True, slots=True)
class Fades:
    """The times that a series is below a power, ``level``, those cut off at its ends left out of the durations.

    ``share`` is that of the time, ``per_second`` how often one begins. The durations are whole sampling periods; nan
    where there is no whole fade. ``unresolved`` is the share of the faded time in fades of a single sample.
    """

    level: float
    share: float
    per_second: float
    mean_s: float
    median_s: float
    ninetieth_s: float
    longest_s: float
    unresolved: float


@dataclass(frozen=True, slots=True, eq=False)
class FadeSeries:
    """Relative received power at equal steps of time; the power stands still over a step.

    ``power`` (samples,) is read-only, without unit, 0 or above. ``source`` says where it comes from, ``sha256`` is that
    of its file, empty where it has none. ``normalised`` says what power 1 is.
    """

    power: Floats
    period_s: float
    source: str
    normalised: Normalisation
    sha256: str = ""

    @classmethod
    def of(
        cls,
        power: ArrayLike,
        period_s: float,
        source: str,
        *,
        unit: Unit,
        normalised: Normalisation,
        sha256: str = "",
    ) -> "FadeSeries":
        """A series of powers.

        Args:
            power: The powers, shape (samples,), in the unit.
            period_s: Time between two samples, in s.
            source: Where they come from, for messages and reports.
            unit: "linear" for ratios or W, "dB" for levels of 10 log10.
            normalised: "mean" or "largest" where power 1 is to be that of the series, "as-given" where it is 1.
            sha256: SHA-256 of their file.

        Raises:
            FadeSeriesError: For another shape, less than 200 samples or more than two million, a sample that is not
                finite or below 0, a level above 300 dB or a power above 1e30, no power at all, and a word that is none
                of the unit's or the normalisation's.
        """
        for word, kind, called in ((unit, Unit, "unit"), (normalised, Normalisation, "normalisation")):
            if word not in get_args(kind):
                raise FadeSeriesError(f"{source}: the {called} is {word!r}; give one of {', '.join(get_args(kind))}.")
        check("the sampling period", period_s, Quantity("s", above=0.0), source)
        given = reals(power, f"{source}: power", FadeSeriesError, most=math.inf)
        linear = _linear(given, source, unit)
        if normalised != "as-given":
            largest = float(np.max(linear))
            linear = linear / largest  # so that the sum of the largest numbers is one, too
            linear /= float(np.mean(linear)) if normalised == "mean" else 1.0
        linear.flags.writeable = False
        return cls(linear, float(period_s), source, normalised, sha256)

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        return self.power.size * self.period_s

    def at_least_as_long_as(self, needed_s: float, what: str) -> None:
        """Refuse a series that ends too soon.

        Args:
            needed_s: How long it has to be, in s.
            what: What needs that, in words.

        Raises:
            FadeSeriesError: Where it is shorter, with both times.
        """
        if self.duration_s < needed_s * (1.0 - 1e-9):
            raise FadeSeriesError(
                f"{self.source}: the series lasts {format_limit(self.duration_s, 's')} and {what} "
                f"{format_limit(needed_s, 's', least=True)}; give a series of many times that, or shorten the latter."
            )

    def fades(self, level: float) -> Fades:
        """The times below a power.

        Args:
            level: The power, on the scale of the series.
        """
        below = self.power < level
        edges = np.diff(below.astype(np.int8), prepend=0, append=0)
        begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
        lengths, faded = ends - begins, int(np.count_nonzero(below))
        whole = lengths[(begins > 0) & (ends < below.size)]
        known = whole.size > 0
        median, ninetieth, longest = (
            np.quantile(whole, [0.5, 0.9, 1.0]) if known else np.full(3, math.nan)
        ) * self.period_s
        return Fades(
            level=float(level),
            share=faded / below.size,
            per_second=np.count_nonzero(begins > 0) / self.duration_s,
            mean_s=float(np.mean(whole)) * self.period_s if known else math.nan,
            median_s=float(median),
            ninetieth_s=float(ninetieth),
            longest_s=float(longest),
            unresolved=int(np.count_nonzero(lengths == 1)) / faded if faded else 0.0,
        )

    def resolves(self, level: float) -> Fades:
        """The fades below a power, where the series tells how long they are.

        Args:
            level: The power, on the scale of the series.

        Raises:
            FadeSeriesError: For a series that is sampled slower than its fades: more than `MOST_UNRESOLVED` of the time
                below the power is in fades of a single sample.
        """
        found = self.fades(level)
        if found.unresolved > MOST_UNRESOLVED:
            raise FadeSeriesError(
                f"{self.source}: the series is sampled slower than its fades: "
                f"{format_limit(100 * found.unresolved, '', 3, least=True)} % of the time below "
                f"{10.0 * math.log10(level):.1f} dB is in fades of a single sample, "
                f"{format_quantity(self.period_s, 's')}, and at most {100 * MOST_UNRESOLVED:g} % may be; give a series "
                "that is sampled faster."
            )
        return found


def _linear(given: Floats, source: str, unit: Unit) -> Floats:
    """Powers as ratios, checked."""
    if given.ndim != 1:
        raise FadeSeriesError(
            f"{source}: the powers have the shape {given.shape}; give one series, of shape (samples,)."
        )
    if not LEAST_SAMPLES <= given.size <= MOST_SAMPLES:
        fewer = "cut out a part, or keep every n-th sample if its fades allow that."
        raise FadeSeriesError(
            f"{source}: the series has {given.size} samples; from {LEAST_SAMPLES} to {MOST_SAMPLES} are taken: "
            f"{fewer if given.size > MOST_SAMPLES else 'give a longer one.'}"
        )
    bad = ~np.isfinite(given) | ((given < 0.0) | (given > _MOST) if unit == "linear" else given > _MOST_DB)
    if unit == "dB":
        bad &= ~np.isneginf(given)  # no light
    if np.any(bad):
        row = int(np.argmax(bad))
        wanted = f"finite, 0 or above and at most {_MOST:g}" if unit == "linear" else f"a number up to {_MOST_DB:g} dB"
        hint = ' (unit "dB" if these are levels)' if unit == "linear" and given[row] < 0.0 else ""
        raise FadeSeriesError(
            f"{source}: sample {row} is {given[row]:g}, {counted(int(np.sum(bad)), 'such sample')} in all: a power "
            f"must be {wanted}{hint}; cut out a part without them."
        )
    linear: Floats = given.copy() if unit == "linear" else 10.0 ** (given / 10.0)
    if not np.any(linear > 0.0):
        raise FadeSeriesError(f"{source}: no sample is above 0: there is no light in the series; name another one.")
    return linear


_MOST_DB, _MOST = 300.0, 1e30


def check(name: str, value: float, quantity: Quantity, source: str) -> None:
    """Check a value that comes from no file.

    Args:
        name: What the value is, in the words of the message.
        value: The value, in the unit of the quantity.
        quantity: Its unit and its bounds.
        source: Of which series it is said.

    Raises:
        FadeSeriesError: For a value that is not finite or out of bounds.
    """
    try:
        quantity.check(name, value)
    except ValueError as error:
        raise FadeSeriesError(f"{source}: {error}.") from None


def part(series: FadeSeries, first: int, last: int) -> FadeSeries:
    """Some samples of a series, on its own scale.

    Args:
        series: The series.
        first: Number of the first sample.
        last: Number of the sample behind the last.
    """
    return replace(series, power=series.power[first:last])
