"""Shaping filters fitted to numbers: rms by band, or a measured density."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats, reals
from microrad.core.units import LEAST, format_quantity, plain
from microrad.loop.disturbance.records import Convention, Disturbance, above_zero, band_rms, one_input, rising, share
from microrad.loop.disturbance.sources import from_terms
from microrad.loop.disturbance.tables import checked
from microrad.loop.disturbance.terms import Samples, Term, band_samples, fit_terms, table_samples

_BAND = 0.05  # allowed error of the rms in a band
_TABLE_DB = 3.0  # allowed error of a density
_LEAST_DENSITY = 1e-60  # rad^2/Hz
_TOTAL = 0.10  # allowed error of the rms over a whole table


@dataclass(frozen=True, slots=True)
class Fit:
    """A disturbance fitted to a spectrum, and how well; all per axis.

    Requested and achieved rms are in the bands between ``edges_hz``; ``outside_rms_rad`` is what the filter has where
    nothing was requested. ``worst_db`` is the largest ratio of achieved to requested, in decibels of power: of a band's
    variance, or of a density of the table averaged over 3 % in frequency. It lies near ``worst_at_hz``.
    """

    disturbance: Disturbance
    edges_hz: Floats
    requested_rms_rad: Floats
    achieved_rms_rad: Floats
    outside_rms_rad: float
    worst_db: float
    worst_at_hz: float


def fit_bands(
    edges_hz: ArrayLike, rms_rad: ArrayLike, *, convention: Convention, name: str = "bands", source: str = "given"
) -> Fit:
    """Fit a filter whose rms in each band between the edges is the given one within 5 %.

    Bands leave open the shape within them and what lies outside. The broadest terms that fit are taken, with little
    power outside: about a tenth of the last band's above it.

    Args:
        edges_hz: Edges of the bands, rising, shape (bands + 1,); the first may be 0 Hz.
        rms_rad: Rms in each band, above 0, shape (bands,).
        convention: What the rms values are: "radial", of both axes together, or "per-axis".
        name: What the disturbance is called.
        source: Who gave the numbers.

    Raises:
        ValueError: For edges that do not rise, an rms that is not above zero, and where no sum of a few terms comes
            within 5 %.
    """
    edges, wanted = rising(np.asarray(edges_hz), f'"{name}": edges of the bands'), np.asarray(rms_rad, dtype=float)
    if wanted.shape != (edges.size - 1,) or not np.all(np.isfinite(edges)):
        raise ValueError(
            f'"{name}": {edges.size} edges and {wanted.size} rms values; give finite edges, one more than rms values'
        )
    for low, high, value in zip(edges[:-1], edges[1:], wanted, strict=True):
        above_zero(float(value), f'"{name}": rms between {low:g} and {high:g} Hz', "rad")
    wanted = wanted * math.sqrt(share(convention))
    samples = band_samples(edges, wanted**2)
    limits = (float(edges[0] or 0.1 * edges[1]), float(edges[-1]))
    for least_damping in (0.5, 0.3, 0.1, 0.05):
        terms = fit_terms(samples, limits, least_damping, tolerance=0.01)
        fit = _fit(terms, name, source, edges, wanted, samples)
        if np.max(np.abs(fit.achieved_rms_rad / wanted - 1.0)) <= 0.2 * _BAND:
            break
    _refuse_poor_bands(fit, name)
    return fit


def _refuse_poor_bands(fit: Fit, name: str) -> None:
    ratio = fit.achieved_rms_rad / fit.requested_rms_rad
    worst = int(np.argmax(np.abs(ratio - 1.0)))
    if abs(ratio[worst] - 1.0) > _BAND:
        raise ValueError(
            f'"{name}": no filter of a few terms has these rms values; the nearest has {plain(ratio[worst])} times the '
            f"given rms between {fit.edges_hz[worst]:g} and {fit.edges_hz[worst + 1]:g} Hz, and {100 * _BAND:g} % is "
            "allowed: a density cannot fall faster than 1/f^4 from one band to the next; merge bands or give a table"
        )


def fit_spectrum(
    freq_hz: ArrayLike, psd_rad2_hz: ArrayLike, *, convention: Convention, name: str = "vibration"
) -> Disturbance:
    """The disturbance of one axis that has a measured one-sided density: a shaping filter fitted to it.

    Args:
        freq_hz: Frequencies (Hz), rising, shape (rows,).
        psd_rad2_hz: One-sided density at each of them (rad^2/Hz), above 0, shape (rows,).
        convention: What the densities are: "radial", of both axes together, or "per-axis".
        name: What the disturbance is called; its random numbers go by it.

    Raises:
        ValueError: As `fit_table`, which also says how well the filter fits.

    Example:
        ```python
        import numpy as np
        import microrad

        freq_hz = np.geomspace(0.1, 1000, 200)
        vibration = microrad.fit_spectrum(freq_hz, 160e-12 / (1 + freq_hz**2), convention="radial")
        print(vibration.rms_rad)
        ```
    """
    return fit_table(freq_hz, psd_rad2_hz, convention=convention, name=name).disturbance


def fit_table(
    freq_hz: ArrayLike, psd_rad2_hz: ArrayLike, *, convention: Convention, name: str = "table", source: str = "given"
) -> Fit:
    """Fit a filter to a measured one-sided density; the bands of the fit are the decades of the table.

    Args:
        freq_hz: Frequencies, rising, shape (rows,); a row at 0 Hz is left out, as no average has settled there.
        psd_rad2_hz: One-sided density at each of them, above 0, shape (rows,).
        convention: What the densities are: "radial", of both axes together, or "per-axis".
        name: What the disturbance is called.
        source: Who gave the numbers.

    Raises:
        ValueError: For columns that are no spectrum (see `read_table`), for a density of zero, and for a poor fit: 3 dB
            off somewhere, or 10 % in the rms over the table.
    """
    freq, density = reals(freq_hz, f'"{name}": freq_hz'), reals(psd_rad2_hz, f'"{name}": psd_rad2_hz')
    freq, density = checked(freq, density, f'"{name}"')
    freq, density = freq[freq > 0.0], density[freq > 0.0] * share(convention)
    if np.any(density == 0.0):
        raise ValueError(
            f'"{name}": the density at {freq[np.argmin(density)]:g} Hz is zero, which no filter has; give the noise '
            "floor of the measurement there, or end the table before"
        )
    if np.any(density < _LEAST_DENSITY) or freq[0] < LEAST or freq.size < 3:
        raise ValueError(
            f'"{name}": {freq.size} rows from {freq.min(initial=math.inf):g} Hz, with a density of '
            f"{density.min(initial=math.inf):g} rad^2/Hz; give three rows or more of a spectrum, in these units"
        )
    samples = table_samples(freq, density)
    resolved = 0.25 * float(np.min(np.diff(np.log(freq))))  # a resonance narrower than the rows are apart is no data
    least_damping = min(max(resolved, 0.002), 0.5)
    terms = fit_terms(samples, (float(freq[0]) / 3.0, 2.0 * float(freq[-1])), least_damping, tolerance=0.1)
    decades = 10.0 ** np.arange(math.ceil(math.log10(freq[0])), math.log10(freq[-1]))
    rows = np.unique([0, *np.searchsorted(freq, decades), freq.size - 1])
    wanted = np.sqrt(np.add.reduceat(_power_law_integrals(freq, density), rows[:-1]))
    fit = _fit(terms, name, source, freq[rows], wanted, samples)
    _refuse_poor_table(fit, name)
    return fit


def _refuse_poor_table(fit: Fit, name: str) -> None:
    if abs(fit.worst_db) > _TABLE_DB:
        side = "below" if fit.worst_db < 0.0 else "above"
        raise ValueError(
            f'"{name}": the best filter of a few terms is {abs(fit.worst_db):.1f} dB {side} the table near '
            f"{fit.worst_at_hz:.4g} Hz, and {_TABLE_DB:g} dB is allowed; give narrow lines as spectral lines instead, "
            "average a rough spectrum over more segments, and end the table where it falls faster than 1/f^4"
        )
    ratio = float(np.linalg.norm(fit.achieved_rms_rad) / np.linalg.norm(fit.requested_rms_rad))
    if abs(ratio - 1.0) > _TOTAL:
        raise ValueError(
            f'"{name}": the best filter of a few terms has {plain(ratio)} times the rms of the table, and '
            f"{100 * _TOTAL:g} % is allowed; give the table more finely where it is high"
        )


def _fit(terms: list[Term], name: str, source: str, edges: Floats, wanted: Floats, samples: Samples) -> Fit:
    """Fit of these terms, realised with one white input where that is accurate."""
    disturbance = one_input(from_terms(terms, name, "", source))
    achieved = band_rms(disturbance, edges)
    outside = math.sqrt(max(disturbance.variance_rad2 - float(np.sum(achieved**2)), 0.0))
    error = np.where(samples.ceiling | (samples.trust < 1.0), 0.0, samples.misfit(terms))
    worst = int(np.argmax(np.abs(error)))
    worst_db, at_hz = 10.0 * float(error[worst]) / math.log(10.0), float(samples.centre_hz[worst])
    by_band = ", ".join(
        f"{low:.4g} to {high:.4g} Hz {format_quantity(a, 'rad')} for {format_quantity(w, 'rad')}"
        for low, high, a, w in zip(edges[:-1], edges[1:], achieved, wanted, strict=True)
    )
    basis = (
        f"fit of {len(terms)} term{'s' * (len(terms) > 1)}, rms per axis: {by_band}; "
        f"elsewhere {format_quantity(outside, 'rad')}; worst {worst_db:+.2f} dB near {at_hz:.4g} Hz"
    )
    return Fit(replace(disturbance, basis=basis), edges, wanted, achieved, outside, worst_db, at_hz)


def _power_law_integrals(freq_hz: Floats, density: Floats) -> Floats:
    """Integral over each interval of a table, the density a power of frequency from row to row."""
    ratio = np.log(freq_hz[1:] / freq_hz[:-1])
    growth = np.log(density[1:] / density[:-1]) + ratio
    mean = np.where(np.abs(growth) < 1e-9, 1.0, np.expm1(growth) / np.where(growth == 0.0, 1.0, growth))
    return np.asarray(density[:-1] * freq_hz[:-1] * ratio * mean)
