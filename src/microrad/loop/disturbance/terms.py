"""Non-negative sums of first- and second-order spectra: the densities that a small shaping filter can have.

A term is white noise behind a low pass of first order, a low pass of second order or a band pass of second order. Any
sum of terms with non-negative variances is the spectrum of a stable filter, which no free rational fit promises.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats

Kind = Literal["first-order", "low-pass", "band-pass"]

_MAX_TERMS = 12
_BROADEST = 0.9  # of the second-order terms: poles of damping 1 coincide, and then no modal form exists
_NODES = 64  # per band: enough for a resonance of damping 0.05 in a band of a decade
_FINENESS = 0.03  # rows of a table closer than this fraction of their frequency are averaged
_WIDE = 100.0  # bound of a variance in natural logarithms: numbers stay numbers
_A_STATE = 25.0  # of a cost: more than chance gives to a state
_NEGLIGIBLE = 1e-12  # of the largest density: ends the logarithm of a sum that vanishes at a row


@dataclass(frozen=True, slots=True)
class Term:
    """One term: its variance, its corner or natural frequency and, for the second order, its damping ratio."""

    kind: Kind
    variance_rad2: float
    freq_hz: float
    damping: float = 1.0


def term_density(term: Term, at_hz: Floats) -> Floats:
    """One-sided density (rad^2/Hz) of the term; its integral from 0 to infinity is the term's variance.

    Args:
        term: The term.
        at_hz: Frequencies, an array of any shape, which the density has as well.
    """
    ratio = at_hz / term.freq_hz
    scale = 4.0 * term.variance_rad2 / (2.0 * math.pi * term.freq_hz)
    if term.kind == "first-order":
        return np.asarray(scale / (1.0 + ratio**2))
    numerator = 1.0 if term.kind == "low-pass" else ratio**2
    return np.asarray(
        scale * 2.0 * term.damping * numerator / ((1.0 - ratio**2) ** 2 + (2.0 * term.damping * ratio) ** 2)
    )


def term_filter(term: Term) -> tuple[Floats, Floats, Floats]:
    """The term as x' = A x + B w, d = C x in real modal form, w white with unit two-sided density."""
    rate = 2.0 * math.pi * term.freq_hz
    if term.kind == "first-order":
        return np.array([[-rate]]), np.array([[math.sqrt(2.0 * rate)]]), np.array([[math.sqrt(term.variance_rad2)]])
    decay, turn = term.damping * rate, rate * math.sqrt(1.0 - term.damping**2)
    pole = complex(-decay, turn)
    numerator = math.sqrt(4.0 * term.damping * rate * term.variance_rad2) * (rate if term.kind == "low-pass" else pole)
    residue = numerator / (2j * turn) / math.sqrt(2.0 * decay)
    A = np.array([[-decay, turn], [-turn, -decay]])
    return A, np.array([[math.sqrt(2.0 * decay)], [0.0]]), np.array([[2.0 * residue.real, 2.0 * residue.imag]])


@dataclass(frozen=True, slots=True)
class Samples:
    """What a sum of terms is compared with: row i is the weighted sum of the density at its nodes.

    The nodes of a row run from ``starts[i]`` to the next start. ``wanted`` is the row's value; a row that is
    ``ceiling`` may fall below it. ``trust`` is 1 for what was given and less for what lies between; ``centre_hz`` is
    where the row lies.
    """

    nodes_hz: Floats
    weights: Floats
    starts: NDArray[np.intp]
    wanted: Floats
    ceiling: NDArray[np.bool_]
    trust: Floats
    centre_hz: Floats

    def rows(self, terms: list[Term]) -> Floats:
        """Value of each row for the sum of these terms."""
        density = sum((term_density(t, self.nodes_hz) for t in terms), np.zeros(self.nodes_hz.size))
        return np.asarray(np.add.reduceat(self.weights * density, self.starts))

    def misfit(self, terms: list[Term]) -> Floats:
        """Natural logarithm of achieved over wanted by row, times the trust in it; 0 below a ceiling."""
        least = _NEGLIGIBLE * float(np.max(self.wanted))
        error = self.trust * np.log(np.maximum(self.rows(terms), least) / self.wanted)
        return np.asarray(np.where(self.ceiling, np.maximum(error, 0.0), error))


def _samples(parts: list[tuple[Floats, Floats]], wanted: Floats, ceiling: NDArray[np.bool_], trust: Floats) -> Samples:
    sizes = [nodes.size for nodes, _ in parts]
    nodes, weights = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    centre = np.array([np.average(at, weights=by) for at, by in parts])
    return Samples(nodes, weights, np.cumsum([0, *sizes[:-1]]), wanted, ceiling, trust, centre)


def _logarithmic_nodes(low_hz: float, high_hz: float) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights of an integral over frequency, in the logarithm of frequency."""
    x, w = np.polynomial.legendre.leggauss(_NODES)
    span = math.log(high_hz / low_hz)
    nodes = low_hz * np.exp(0.5 * span * (x + 1.0))
    return nodes, 0.5 * span * w * nodes


def band_samples(edges_hz: Floats, variance_rad2: Floats) -> Samples:
    """Rows that are the variances in bands, and ceilings on what lies outside them.

    Above: a tenth of the last band's variance. Below a first edge that is not 0 Hz: a tenth of the first band's, or
    what its mean density would have there, whichever is more.

    Args:
        edges_hz: Edges of the bands, rising, shape (bands + 1,).
        variance_rad2: Variance in each band, shape (bands,).
    """
    first, last = float(edges_hz[0]), float(edges_hz[-1])
    lowest = 1e-4 * float(edges_hz[1])
    parts = [_logarithmic_nodes(low or lowest, high) for low, high in pairwise([*edges_hz.tolist(), 100.0 * last])]
    wanted = np.append(variance_rad2, 0.1 * variance_rad2[-1])
    if first == 0.0:
        parts[0] = _and_below(parts[0], lowest)
    else:
        parts.append(_and_below(_logarithmic_nodes(1e-3 * first, first), 1e-3 * first))
        wanted = np.append(wanted, variance_rad2[0] * max(0.1, first / (float(edges_hz[1]) - first)))
    return _samples(parts, wanted, np.arange(wanted.size) >= variance_rad2.size, np.ones(wanted.size))


def _and_below(part: tuple[Floats, Floats], lowest_hz: float) -> tuple[Floats, Floats]:
    """The nodes and weights of an integral from 0 Hz, the density flat below the lowest frequency of this one."""
    return np.append(0.5 * lowest_hz, part[0]), np.append(lowest_hz, part[1])


def table_samples(freq_hz: Floats, psd_rad2_hz: Floats) -> Samples:
    """Rows that are the densities of a table, rows within 3 % of each other in frequency averaged.

    A measured density scatters from row to row; the average of neighbours is what a smooth filter can be held to.
    Between rows farther apart the density is taken as a power of frequency, all of a gap with the weight of one row, so
    that no resonance hides there.

    Args:
        freq_hz: Frequencies of the table, rising, above 0, shape (rows,).
        psd_rad2_hz: One-sided density at each of them, above 0, shape (rows,).
    """
    group = np.floor(np.log(freq_hz / freq_hz[0]) / _FINENESS)
    starts = np.flatnonzero(np.diff(group, prepend=-1.0))
    parts = [_evenly(rows) for rows in np.split(freq_hz, starts[1:])]
    wanted = [np.add.reduceat(psd_rad2_hz, starts) / np.diff(starts, append=freq_hz.size)]
    trust = [np.ones(starts.size)]
    for i in np.flatnonzero(np.diff(np.log(freq_hz)) > 2.0 * _FINENESS):
        count = int(math.log(freq_hz[i + 1] / freq_hz[i]) / _FINENESS) - 1
        nodes = np.geomspace(freq_hz[i], freq_hz[i + 1], 4 * count + 2)[1:-1]
        density = np.exp(np.interp(np.log(nodes), np.log(freq_hz[i : i + 2]), np.log(psd_rad2_hz[i : i + 2])))
        parts += [_evenly(rows) for rows in np.split(nodes, count)]
        wanted.append(density.reshape(count, 4).mean(axis=1))
        trust.append(np.full(count, count**-0.5))
    rows = np.concatenate(wanted)
    return _samples(parts, rows, np.zeros(rows.size, dtype=bool), np.concatenate(trust))


def _evenly(rows_hz: Floats) -> tuple[Floats, Floats]:
    """At most eight nodes that stand for a group of neighbouring rows."""
    nodes = rows_hz if rows_hz.size <= 8 else np.linspace(rows_hz[0], rows_hz[-1], 8)
    return nodes, np.full(nodes.size, 1.0 / nodes.size)


def states_of(terms: list[Term]) -> int:
    """States of the filter that has the sum of these terms."""
    return sum(1 if t.kind == "first-order" else 2 for t in terms)


def fit_terms(samples: Samples, range_hz: tuple[float, float], least_damping: float, tolerance: float) -> list[Term]:
    """Find few terms whose rows follow the samples.

    Broad terms on a grid by non-negative least squares (Lawson and Hanson 1974) first; then a term where the density
    lacks most, as long as that helps; then terms are left out again while the fit stays good. The caller judges what is
    left of the misfit.

    Args:
        samples: What the sum of the terms is compared with.
        range_hz: Lowest and highest corner of a term.
        least_damping: Least damping ratio of a term of second order.
        tolerance: Largest misfit of a row (natural logarithm) that is good enough.
    """
    limits = (*range_hz, least_damping)
    fractions = np.linspace(0.0, 1.0, 1 + max(4, round(4 * math.log10(range_hz[1] / range_hz[0]))))
    grid = [range_hz[0] * (range_hz[1] / range_hz[0]) ** u for u in fractions]
    kinds: tuple[Kind, ...] = ("first-order", "low-pass", "band-pass")
    terms = _powers(samples, [Term(kind, 1.0, freq, 0.7) for kind, freq in product(kinds, grid)])
    terms = _fewer(samples, _polished(samples, terms[:_MAX_TERMS], limits), limits, tolerance)
    while _worst(samples, terms) > tolerance and len(terms) < _MAX_TERMS:
        more = _with_one_more(samples, terms, limits)
        if _spread(samples, more) > 0.85 * _spread(samples, terms):
            break
        terms = more
    return _fewer(samples, terms, limits, tolerance)


def with_states(
    samples: Samples, terms: list[Term], range_hz: tuple[float, float], least_damping: float, states: int | None
) -> list[Term]:
    """The terms with another number of states; each step to it is the one of the least `cost`.

    Args:
        samples: What the sum of the terms is compared with.
        terms: The terms of `fit_terms`.
        range_hz: Lowest and highest corner of a term.
        least_damping: Least damping ratio of a term of second order.
        states: How many, 1 or more; None for the least `cost`. There are fewer where a further term is left without
            variance.
    """
    limits = (*range_hz, least_damping)
    while states is None or states_of(terms) > states:
        least = 1 if states is None else states
        trials = [_polished(samples, trial, limits) for trial in _smaller(terms) if states_of(trial) >= least]
        if not trials:
            break
        best = min(trials, key=lambda trial: cost(samples, trial))
        if states is None and cost(samples, best) > cost(samples, terms):
            break
        terms = best
    while states is not None and (more := states - states_of(terms)) > 0:
        fuller = _with_one_more(samples, terms, limits, ("first-order",) if more == 1 else ("low-pass", "band-pass"))
        if states_of(fuller) <= states_of(terms):
            break
        terms = fuller
    return terms


def cost(samples: Samples, terms: list[Term]) -> float:
    """Misfit and states in one number, to compare fits: rows times the logarithm of the mean square, and 25 a state.

    Args:
        samples: What the sum of the terms is compared with.
        terms: The terms.
    """
    return 2.0 * samples.wanted.size * math.log(_spread(samples, terms)) + _A_STATE * states_of(terms)


def _smaller(terms: list[Term]) -> list[list[Term]]:
    """The terms with fewer states in each way: without one of them, or with one of second order made one of first."""
    found = [[*terms[:i], *terms[i + 1 :]] for i in range(len(terms)) if len(terms) > 1]
    for i, t in enumerate(terms):
        if t.kind != "first-order":
            found.append([*terms[:i], replace(t, kind="first-order", damping=_BROADEST), *terms[i + 1 :]])
    return found


def _worst(samples: Samples, terms: list[Term]) -> float:
    return float(np.max(np.abs(samples.misfit(terms))))


def _spread(samples: Samples, terms: list[Term]) -> float:
    """Root mean square of the misfit."""
    return float(np.sqrt(np.mean(samples.misfit(terms) ** 2)))


def _powers(samples: Samples, terms: list[Term]) -> list[Term]:
    """The same terms with the non-negative variances of the least relative error, strongest first, without zeros."""
    from scipy.optimize import nnls

    unit = [Term(t.kind, 1.0, t.freq_hz, t.damping) for t in terms]
    rows = np.column_stack([samples.rows([t]) for t in unit]) / samples.wanted[:, None]
    size = np.linalg.norm(rows, axis=0)
    target = np.where(samples.ceiling, 0.0, 1.0)
    weight = np.where(samples.ceiling, 0.01, samples.trust)  # a ceiling is no aim
    try:
        found = nnls(weight[:, None] * rows / size, weight * target)[0] / size
    except RuntimeError:
        raise ValueError("no sum of a few filters follows this spectrum; look for rows that are far off") from None
    kept = [Term(t.kind, float(v), t.freq_hz, t.damping) for t, v in zip(unit, found, strict=True) if v > 0.0]
    return sorted(kept, key=lambda t: -float(np.max(samples.rows([t]) / samples.wanted)))


def _with_one_more(
    samples: Samples,
    terms: list[Term],
    limits: tuple[float, float, float],
    kinds: tuple[Kind, ...] = ("low-pass", "band-pass"),
) -> list[Term]:
    """The terms and the best of several new ones of these kinds where the sum lacks most."""
    freq = float(np.clip(samples.centre_hz[np.argmin(samples.misfit(terms))], *limits[:2]))
    dampings = [z for z in (0.7, 0.3, 0.1, 0.03, 0.01, 0.003) if z >= limits[2]]
    trials = [_powers(samples, [*terms, Term(k, 1.0, freq, z)]) for k, z in product(kinds, dampings)]
    return _polished(samples, min(trials, key=lambda trial: _spread(samples, trial)), limits)


def _fewer(samples: Samples, terms: list[Term], limits: tuple[float, float, float], tolerance: float) -> list[Term]:
    """The terms without those that the others can replace: within the tolerance, or at nearly the same spread."""
    allowed = 1.15 * _spread(samples, terms)
    while len(terms) > 1:
        trials = [_polished(samples, [*terms[:i], *terms[i + 1 :]], limits) for i in range(len(terms))]
        best = min(trials, key=lambda trial: _spread(samples, trial))
        if _worst(samples, best) > tolerance and _spread(samples, best) > allowed:
            break
        terms = best
    return terms


def _polished(samples: Samples, terms: list[Term], limits: tuple[float, float, float]) -> list[Term]:
    """The terms with variances, frequencies and dampings of the least squared misfit nearby."""
    low_hz, high_hz, least_damping = limits
    scale = float(np.max(samples.wanted))
    low = np.tile([-_WIDE, math.log(low_hz), math.log(least_damping)], len(terms))
    high = np.tile([_WIDE, math.log(high_hz), math.log(_BROADEST)], len(terms))

    def built(x: Floats) -> list[Term]:
        values = np.exp(x.reshape(-1, 3)).tolist()
        return [Term(t.kind, scale * v, f, z) for t, (v, f, z) in zip(terms, values, strict=True)]

    start = np.log([[t.variance_rad2 / scale, t.freq_hz, t.damping] for t in terms]).ravel()
    bounds = np.stack([low, high])
    return built(
        _least_squares(lambda x: samples.misfit(built(x)), lambda x: _slopes(samples, built(x)), start, bounds)
    )


def _least_squares(
    misfit: Callable[[Floats], Floats], slopes: Callable[[Floats], Floats], start: Floats, bounds: Floats
) -> Floats:
    """Minimum of the squared misfit between bounds (2, unknowns), by Levenberg and Marquardt's steps, forty at most.

    On normal equations: for these few columns a singular value decomposition at each step costs thirty times as much.
    """
    x = np.clip(start, *bounds)
    error, caution = misfit(x), 1e-3
    for _ in range(40):
        before, gradient = float(error @ error), slopes(x)
        downhill = -gradient.T @ error
        free = ~(((x <= bounds[0]) & (downhill < 0.0)) | ((x >= bounds[1]) & (downhill > 0.0)))
        curvature = gradient[:, free].T @ gradient[:, free]
        while caution < 1e6:
            trial = x.copy()
            damped = curvature + np.diag(caution * np.diag(curvature) + 1e-12)
            trial[free] += np.linalg.solve(damped, downhill[free])
            trial = np.clip(trial, *bounds)
            found = misfit(trial)
            if found @ found < before:
                x, error, caution = trial, found, 0.2 * caution
                break
            caution *= 4.0
        if float(error @ error) > (1.0 - 1e-4) * before:
            break
    return x


def _slopes(samples: Samples, terms: list[Term]) -> Floats:
    """Derivatives of the misfit with the logarithms of each term's variance, frequency and damping, term by term."""
    step = 1e-6
    columns = []
    for t in terms:
        here = samples.rows([t])
        moved = samples.rows([replace(t, freq_hz=t.freq_hz * (1.0 + step))])
        damped = samples.rows([replace(t, damping=t.damping * (1.0 + step))])
        columns += [here, (moved - here) / step, (damped - here) / step]
    slopes = np.column_stack(columns) * (samples.trust / samples.rows(terms).clip(1e-300))[:, None]
    return np.asarray(np.where((samples.ceiling & (samples.misfit(terms) <= 0.0))[:, None], 0.0, slopes))
