"""What the simulated residual costs the communication link, by controller and mirror, and what hysteresis costs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import link
from microrad.link import pointing
from microrad.link.pointing.outage import ErrorDistribution, Performance, performance, stated_outage
from microrad.loop import controller_study, paper_cases
from microrad.loop.pointing_loop.ensemble import bin_edges_rad, histogram_quantile
from microrad.mirror import Variant

_PARTS = 32  # of a bin of the histogram, which is 3 % wide in the square of the error


@dataclass(frozen=True, slots=True)
class Binned(ErrorDistribution):
    """Radial errors from a histogram, evenly in the square inside each bin; ``counts`` are the bins'."""

    counts: NDArray[np.int64]

    @classmethod
    def of(cls, counts: NDArray[np.int64]) -> "Binned":
        """The errors that these counts stand for, in the bins of `pointing_loop.ensemble.bin_edges_rad`."""
        squares = bin_edges_rad() ** 2
        middles = (np.arange(_PARTS) + 0.5) / _PARTS
        within = squares[:-1, None] + np.diff(squares)[:, None] * middles
        share = np.repeat(counts / (_PARTS * np.sum(counts)), _PARTS)
        return cls(np.sqrt(within).ravel(), share, counts)

    def quantile_rad(self, probability: float) -> float:
        """Error that a share of the time stays below, interpolated inside its bin."""
        return histogram_quantile(self.counts, probability)


@dataclass(frozen=True, slots=True)
class Cost:
    """What hysteresis costs one controller: the link with it less the link without it, at the same outage."""

    source: str
    controller: str
    mirror: str
    margin_db: float
    data_rate_bit_s: float


@dataclass(frozen=True, slots=True)
class LinkPerformance:
    """The link under every residual that was simulated, and what hysteresis costs it."""

    outage: float
    half_angle_rad: float
    cases: tuple[Performance, ...]
    costs: tuple[Cost, ...]

    def case(self, source: str, controller: str, mirror: str) -> Performance | None:
        """The case of one simulated residual, or None.

        Args:
            source: Which loop the residual comes from.
            controller: Name of the controller.
            mirror: Variant of the mirror.
        """
        return next((c for c in self.cases if (c.source, c.controller, c.mirror) == (source, controller, mirror)), None)


FINE = "vibration and noise"


def performance_of_loops(
    data: link.DataLink,
    residual: str,
    runs: tuple[paper_cases.Run, ...],
    fine: controller_study.FinePointingStudy | None,
) -> LinkPerformance:
    """The communication link under the residuals of the clean sines and of the fine-pointing loop.

    Args:
        data: The communication link.
        residual: How the residual of a sine is read: "radial" for two equal axes, "per-axis" for one.
        runs: The tracked sines, by controller and mirror.
        fine: The fine-pointing loop; None in a mission without one.
    """
    cases = [_sine(data, residual == "radial", run) for run in runs]
    if fine is not None:
        cases += [_fine(data, fine, v, mirror) for v in fine.verified for mirror in v.simulated]
    found = tuple(cases)
    return LinkPerformance(stated_outage(data.requirement), data.beam.fall.half_angle_rad, found, costs(found))


def costs(cases: tuple[Performance, ...]) -> tuple[Cost, ...]:
    """What hysteresis costs: each case with it against the same one without."""
    straight = {(c.source, c.controller): c for c in cases if c.mirror == Variant.STRAIGHT}
    found = []
    for c in cases:
        without = straight.get((c.source, c.controller))
        if without is None or c.mirror == Variant.STRAIGHT:
            continue
        rate = c.data_rate_bit_s - without.data_rate_bit_s
        found.append(Cost(c.source, c.controller, c.mirror, c.margin_db - without.margin_db, rate))
    return tuple(found)


def _sine(data: link.DataLink, radial: bool, run: paper_cases.Run) -> Performance:
    """A tracked sine in its steady state."""
    error = run.trace.error_rad[run.trace.steady, 0]
    radius = np.abs(error) * (math.sqrt(2.0) if radial else 1.0)
    bias, rms = float(np.mean(error)), float(np.std(error))
    jitter = pointing.Jitter((bias, bias if radial else 0.0), (rms, rms if radial else 0.0))
    spread = ErrorDistribution(radius, np.full(radius.size, 1.0 / radius.size))
    source = f"sine of {run.freq_hz:g} Hz"
    return performance(data, source, run.controller, run.mirror, spread, jitter, None)


def _fine(
    data: link.DataLink, fine: controller_study.FinePointingStudy, verified: controller_study.Verified, mirror: str
) -> Performance:
    """One controller of the fine-pointing loop; the spectrum is known on the mission's own mirror."""
    left = verified.simulated[mirror]
    mean = (*left.axis_mean_rad, 0.0)[:2]
    square = (*left.axis_rms_rad, 0.0)[:2]
    rms = tuple(math.sqrt(max(s**2 - b**2, 0.0)) for s, b in zip(square, mean, strict=True))
    jitter = pointing.Jitter((mean[0], mean[1]), (rms[0], rms[1]))
    motion = None
    if mirror == Variant.GIVEN:
        psd = verified.spectrum_rad2_hz.T
        both = psd if psd.shape[0] == 2 else np.vstack([psd, np.zeros_like(psd)])
        motion = pointing.motion_of_spectrum(fine.freq_hz, both)
    return performance(data, FINE, verified.design.name, mirror, Binned.of(left.radial_counts), jitter, motion)
