"""The tail of the simulated radial error: its distribution over all runs, its quantiles and how well they are known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.controller_study import FinePointingStudy, Residual
from microrad.loop.pointing_loop.ensemble import bin_edges_rad, histogram_beyond, histogram_quantile
from microrad.mirror import Variant
from microrad.report.fine_pointing import words
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, ORANGE
from microrad.report.plotting.sheet import Legend, Line, Rule, Words, grid
from microrad.report.quantities import given_angle, micro, percent, share_of_time
from microrad.report.tables import Table
from microrad.report.view import Soft, View, opened
from microrad.study.study import Study

SIGMAS = 2.576  # 99 %, as of the interval of the rms
SHARES = (0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999)
LEAST_BEYOND = 10.0  # independent samples that have to lie beyond a quantile for its interval to mean anything
_STYLES: dict[str, tuple[str, str]] = {
    Variant.GIVEN: (BLUE, "-"),
    Variant.COMPARISON: (ORANGE, "--"),
    Variant.STRAIGHT: (GREEN, "-."),
}


@dataclass(frozen=True, slots=True)
class Quantile:
    """The radial error that a share of the time stays below, with its 99 % interval (nan where it has none)."""

    share: float
    value_rad: float
    low_rad: float
    high_rad: float


def independent_samples(left: Residual) -> float:
    """How many independent samples the runs are worth; nan where a single run does not tell.

    The mean square of the radial error scatters from run to run as that of so many independent errors with the same
    histogram would. The square decorrelates as slowly as anything in the error does: of a Gaussian error with the
    correlation rho it has rho^2, and that of being beyond a radius is a series in rho^2, rho^4, ...
    """
    counts = left.radial_counts.astype(float)
    squares = _middles() ** 2
    total = float(counts.sum())
    if not (total and math.isfinite(left.rms_interval_rad) and left.rms_interval_rad > 0.0):
        return math.nan
    mean = float(counts @ squares) / total
    variance = float(counts @ (squares - mean) ** 2) / total
    scatter = 2.0 * left.rms_interval_rad / (SIGMAS * left.rms_rad)  # of the mean square, as a share of itself
    return min(variance / mean**2 / scatter**2, total)


def _middles() -> Floats:
    edges = bin_edges_rad() ** 2
    return np.asarray(np.sqrt((edges[:-1] + edges[1:]) / 2.0))


def quantile(left: Residual, share: float) -> Quantile:
    """A quantile with the interval of its order statistics, by the normal approximation of the binomial.

    Args:
        left: what a controller leaves, with the histogram of its radial error.
        share: share of the time that the error stays below the quantile, 0 to 1.
    """
    value, independent = histogram_quantile(left.radial_counts, share), independent_samples(left)
    if not independent * (1.0 - share) >= LEAST_BEYOND:  # nan too
        return Quantile(share, value, math.nan, math.nan)
    half = SIGMAS * math.sqrt(share * (1.0 - share) / independent)
    low, high = (histogram_quantile(left.radial_counts, min(max(s, 0.0), 1.0)) for s in (share - half, share + half))
    return Quantile(share, value, low, high)


def beyond(left: Residual, radius_rad: float) -> tuple[float, float, float]:
    """Share of the time beyond a radius, with the ends of its 99 % interval by Wilson's score; nan where it has none.

    Args:
        left: what a controller leaves, with the histogram of its radial error.
        radius_rad: the radius, in rad.
    """
    share, n = histogram_beyond(left.radial_counts, radius_rad), independent_samples(left)
    if math.isnan(n):
        return share, math.nan, math.nan
    z2 = SIGMAS**2
    middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n)
    half = SIGMAS / (1.0 + z2 / n) * math.sqrt(share * (1.0 - share) / n + z2 / (4.0 * n * n))
    return share, max(middle - half, 0.0), middle + half


# --------------------------------------------------------------------------------------------------------------- page
def tail_view(fine: FinePointingStudy, required_rad: float, figures: Sequence[Figure]) -> View:
    """The best controller's tail on each variant of the mirror, beside the baseline's.

    Args:
        fine: the study.
        required_rad: largest radial error (rad) that is allowed for the mission's share of the time.
        figures: figures of the tail, which stand folded at the end: the table has their quantiles.
    """
    shares = sorted({*SHARES, fine.quantile})
    shown = shown_of(fine)
    rows = [
        [
            name,
            *(cell(quantile(left, share)) for share in shares),
            micro(left.largest_rad),
            _share(beyond(left, required_rad)),
            _count(independent_samples(left)),
        ]
        for name, left in shown
    ]
    first = "radial error (µrad)"
    last = ("largest", f"time beyond {given_angle(required_rad)}", "independent samples")
    table = Table("", (first, *map(share_of_time, shares), *last), rows, (0, len(shares) + 2), best=(0,))
    judged = share_of_time(fine.quantile)
    note = Soft(
        "The radial error stays below each value for that share of the time; below it stands its 99 % interval. The "
        f"requirement is judged at {judged}."
    )
    return View(
        "Monte Carlo tails",
        (*tail_sentences(fine, int(shown[0][1].radial_counts.sum())), table, note, *opened(figures, ())),
        "tails",
    )


def shown_of(fine: FinePointingStudy) -> list[tuple[str, Residual]]:
    """The best controller on each variant of the mirror, and the baseline on the mission's."""
    best, baseline = fine.best, fine.verified[0]
    rows = [(f"{best.design.name}, {words.NAMES[v]}", left) for v, left in best.simulated.items()]
    if baseline.design.name != best.design.name:
        rows.append((f"{baseline.design.name}, {words.NAMES[Variant.GIVEN]}", baseline.simulated[Variant.GIVEN]))
    return rows


def cell(q: Quantile) -> str:
    """A quantile in µrad with its interval below it."""
    known = not math.isnan(q.low_rad)
    return f"{micro(q.value_rad)}\n{f'{micro(q.low_rad)} to {micro(q.high_rad)}' if known else 'too few samples'}"


def _share(found: tuple[float, float, float]) -> str:
    share, low, high = found
    if share == 0.0:
        return "none seen" if math.isnan(high) else f"none seen, at most {percent(high)}"
    return percent(share) if math.isnan(high) else f"{percent(share)} ({percent(low)} to {percent(high)})"


def _count(value: float) -> str:
    return "unknown" if math.isnan(value) else f"{float(f'{value:.2g}'):.0f}"


def tail_sentences(fine: FinePointingStudy, samples: int) -> list[str]:
    """What was drawn, and how the intervals come about.

    Args:
        fine: the study.
        samples: control samples over all runs.
    """
    table = fine.scene.table
    return [
        "Radial error of the line of sight at the control samples of the ensemble: "
        f"{table.runs} runs with the seed {table.seed}, {samples} samples in all.",
        "Samples that follow each other are not independent. How many independent ones they are worth is taken from "
        "the scatter of the mean square from run to run; intervals are of 99 %, and none is given where fewer than "
        f"{LEAST_BEYOND:g} of those would lie beyond.",
    ]


# ------------------------------------------------------------------------------------------------------------- figure
def tail_figures(study: Study) -> tuple[Figure, ...]:
    """The figure of the tail; none for a mission without a fine-pointing loop."""
    if study.fine_pointing is None:
        return ()
    return (tail(study.fine_pointing, study.file.mission.requirement.pointing_error_rad),)


def tail(fine: FinePointingStudy, required_rad: float) -> Figure:
    """Share of the time beyond each radius, on a logarithmic axis, beside a Rayleigh distribution of the same rms.

    Args:
        fine: the study.
        required_rad: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    sheet, (panel,) = grid(7.4, 3.8)
    sheet.legend = Legend("above", 3)
    columns: dict[str, Floats] = {}
    for variant, left in fine.best.simulated.items():
        colour, dash = _STYLES[variant]
        radius, share = survival(left)
        label = words.NAMES[variant]
        panel.add(Line(radius * 1e6, share, colour, dash, label=label))
        columns |= {f"radial error, {label} (rad)": radius, f"share of the time beyond, {label}": share}
    given = fine.best.simulated[Variant.GIVEN]
    radius, share = survival(given)
    rayleigh = np.exp(-((radius / given.rms_rad) ** 2))
    panel.add(Line(radius * 1e6, rayleigh, BLACK, (1.0, 2.0), 0.9, "Rayleigh, same rms"))
    columns["Rayleigh of the same rms, mission's mirror"] = rayleigh
    required, floor = required_rad * 1e6, 0.5 / float(given.radial_counts.sum())
    panel.add(Rule(required, True, BLACK, "--", 1.2, f"required: {required:g} µrad"))
    panel.add(Rule(1.0 - fine.quantile, False, "#777777", width=0.8))
    beyond_words = f"beyond for {percent(1.0 - fine.quantile)} of the time"
    panel.add(Words(beyond_words, 0.02, 1.0 - fine.quantile, "#555555", base="bottom", shift=(4.0, 2.0), of_panel="x"))
    panel.x.title, panel.x.low, panel.y.title = "radial error (µrad)", 0.0, "share of the time beyond it"
    panel.y.log, panel.y.low, panel.y.high = True, floor, 1.5
    caption = (
        f"Share of the time that the radial error of {fine.best.design.name} is larger, over all runs. A Gaussian "
        "error about both axes with equal rms would follow the dotted line; the scale ends at half a sample."
    )
    return Figure("monte-carlo-tail", "Tail of the radial error", caption, sheet, columns)


def survival(left: Residual) -> tuple[Floats, Floats]:
    """Edges of the histogram's bins in use (rad) and the share of the samples beyond each, the last that has any."""
    counts = left.radial_counts.astype(float)
    used = np.flatnonzero(counts)
    share = 1.0 - np.cumsum(counts) / counts.sum()
    inner = slice(used[0], used[-1])
    return bin_edges_rad()[1:][inner], np.asarray(share[inner])
