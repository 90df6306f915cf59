"""Checks of identified mirrors: recordings of mirrors whose truth is known, made by formulas that no fit uses."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_SIGMAS = 5.0
_RATE_HZ, _PERIOD, _PERIODS, _LINES = 4000.0, 2048, 4, 900
_NOISE_RAD = 2e-6
_TRUTH = {  # a slow pole, a resonance and, above it, a pair of zeros; gain in rad/V
    "gain": 1e-4,
    "slow": 80.0,
    "resonance": 300.0,
    "damping": 0.03,
    "zero": 450.0,
    "zero damping": 0.02,
}


def _response(of: Any, freq_hz: Floats) -> Complexes:
    """From a drive held between samples to the angle at the samples, by partial fractions, each held by itself."""
    turn = 2.0 * math.pi
    zero, pair = turn * of["zero"], turn * of["resonance"]
    top = of["gain"] * np.array([1.0, 2.0 * of["zero damping"] * zero, zero**2]) / zero**2
    bottom = np.polymul([1.0, 2.0 * of["damping"] * pair, pair**2], [1.0 / (turn * of["slow"]), 1.0]) / pair**2
    poles = np.roots(bottom).astype(complex)
    residues = np.polyval(top, poles) / np.polyval(np.polyder(bottom), poles)
    z = np.exp(1j * turn * freq_hz / _RATE_HZ)[:, None]
    return np.asarray((residues / poles * np.expm1(poles / _RATE_HZ) / (z - np.exp(poles / _RATE_HZ))).sum(axis=1))


def _multisines(realisations: int) -> tuple[Any, Complexes]:
    """Recordings of the mirror in steady state under white noise, and the spectra of their drives."""
    from microrad.lab.recording import multisine_recordings

    draw = np.random.default_rng(20_260_111)
    spectra = np.zeros((_PERIOD // 2 + 1, realisations), dtype=complex)
    spectra[1:_LINES] = np.exp(2j * math.pi * draw.random((_LINES - 1, realisations)))
    spectra *= _PERIOD / math.sqrt(2.0 * (_LINES - 1))  # a drive of 1 V rms
    through = _response(_TRUTH, np.arange(_PERIOD // 2 + 1) * _RATE_HZ / _PERIOD)
    drive, angle = (np.fft.irfft(each, _PERIOD, axis=0) for each in (spectra, spectra * through[:, None]))
    drive, angle = (np.repeat(each[:, None, :, None], _PERIODS, axis=3) for each in (drive, angle))
    noisy = angle + _NOISE_RAD * draw.standard_normal(angle.shape)
    return multisine_recordings(drive, noisy, _RATE_HZ, "known mirror"), spectra


def _spread(spectra: Complexes) -> dict[str, float]:
    """Least standard error that any unbiased fit can have of each number of the truth (Cramer and Rao)."""
    freq_hz = np.arange(_PERIOD // 2 + 1) * _RATE_HZ / _PERIOD
    slopes = []
    for key, value in _TRUTH.items():
        ends = [_response({**_TRUTH, key: value * (1.0 + side)}, freq_hz) for side in (1e-5, -1e-5)]
        slopes.append(((ends[0] - ends[1]) / (2e-5 * value))[:, None] * spectra)
    moved = np.array(slopes).reshape(len(slopes), -1)
    # Parseval: a sum over the samples of a period is one over the lines of both signs, over the number of samples
    fisher = _PERIODS / _NOISE_RAD**2 * 2.0 / _PERIOD * np.real(moved.conj() @ moved.T)
    return dict(zip(_TRUTH, np.sqrt(np.diag(np.linalg.inv(fisher))).tolist(), strict=True))


def _linear(workspace: Workspace) -> Iterator[Comparison]:
    """Poles, zeros, gains and their errors of a mirror with three poles, and what the model leaves."""
    from microrad.lab.identify.linear.fit import fit_linear, output_error
    from microrad.report.identification import words

    (*fitted, unseen), spectra = _multisines(3)
    fit = fit_linear(fitted, 3, strictly_proper=True)
    spread = _spread(spectra[:, :2])
    slow, pair, zero = words.roots(fit)
    why = "five standard errors, the least that any unbiased fit has of such noise"
    name = "identify.linear.poles_and_zeros"
    for which, root, freq, damping in (
        ("slow pole", slow, "slow", ""),
        ("resonance", pair, "resonance", "damping"),
        ("zeros", zero, "zero", "zero damping"),
    ):
        off = _SIGMAS * spread[freq]
        yield Comparison(f"{name}.freq_hz", which, _TRUTH[freq], root.freq_hz, off, "Hz", why)
        if damping:
            off = _SIGMAS * spread[damping]
            yield Comparison(f"{name}.damping", f"damping, {which}", _TRUTH[damping], root.damping, off, "", why)
        # that of the complex root: across and along
        error = math.hypot(spread[freq], _TRUTH[freq] * spread[damping]) if damping else spread[freq]
        known = "10 %: five standard errors of a noise that is known from 3600 lines, its effect on the slopes"
        yield Comparison(
            f"{name}.freq_error_hz", f"standard error, {which}", error, root.freq_error_hz, 0.1 * error, "Hz", known
        )
        if damping:
            error /= _TRUTH[freq]
            what = f"standard error of the damping, {which}"
            yield Comparison(f"{name}.damping_error", what, error, root.damping_error, 0.1 * error, "", known)
    gain, error = float(fit.dc_gain[0, 0]), float(fit.dc_gain_error[0, 0])
    off = _SIGMAS * spread["gain"]
    yield Comparison("identify.linear.dc_gain_rad_v", "slow gain", _TRUTH["gain"], gain, off, "rad/V", why)
    expected = spread["gain"]
    what = "standard error of the slow gain"
    yield Comparison(
        "identify.linear.dc_gain_standard_error_rad_v", what, expected, error, 0.1 * expected, "rad/V", known
    )
    edge = float(abs(_response(_TRUTH, np.array([_RATE_HZ / _PERIOD]))[0]))
    what = "gain at the lowest line"
    yield Comparison("identify.linear.edge_gain_rad_v", what, edge, float(fit.edge_gain[0, 0]), off, "rad/V", why)
    size = float(np.std(fitted[0].output))
    count = 2 * _PERIOD * _PERIODS
    # no mean of a wave of fixed size varies: the noise alone
    why = f"five standard errors of the rms of {count} samples"
    share, off = _NOISE_RAD / size, _SIGMAS / math.sqrt(2.0 * count)
    yield Comparison(
        "identify.linear.fit_percent",
        "fit, 100 less the share of the noise",
        100.0 * (1.0 - share),
        float(fit.fit_percent[0]),
        100.0 * share * 2.0 * off,
        "%",
        why + ", and of the output's own",
    )
    left = output_error(fit.modes, unseen, drop=_PERIOD)
    rms = float(np.sqrt(np.mean(left**2)))
    off = _NOISE_RAD * _SIGMAS / math.sqrt(2.0 * left.size)
    what = "error on a record that no fit has seen: its noise"
    why = f"five standard errors of the rms of {left.size} samples"
    yield Comparison("identify.linear.held_out", what, _NOISE_RAD, rms, off, "rad", why)


# ---------------------------------------------------------------------------------------------------------- hysteresis
_DRIVE_V, _LOOP_HZ, _LOOP_RATE_HZ, _GAUGE_RAD, _TREND_RAD = 6.0, 2.0, 2000.0, 1e-6, 2e-5
_STEP_V = 0.47 * 2.0 * _DRIVE_V / 14.0  # between thresholds: 15 from 0 to 0.47 of the sweep
_PLAYS = {0: 4e-5, 2: 2e-5, 5: 1.5e-5, 10: 1e-5}


def _play(drive: Floats, threshold: float) -> Floats:
    """What a play of this half width makes of a drive, from turn to turn: it follows behind the largest move back."""
    found, at = np.empty_like(drive), 0.0
    for place, value in enumerate(drive):
        at = max(value - threshold, min(value + threshold, at))
        found[place] = at
    return found


def _loop(seed: int) -> tuple[Any, Floats]:
    """A recording of loops, and its drive (V)."""
    from microrad.lab.recording import recording_from_arrays

    period = round(_LOOP_RATE_HZ / _LOOP_HZ)
    sizes = np.repeat(_DRIVE_V * np.tile([1.0, 0.75, 0.5], 4), period)
    drive = sizes * np.sin(2.0 * math.pi * np.arange(sizes.size) / period)
    still = sum(weight * _play(drive, place * _STEP_V) for place, weight in _PLAYS.items())
    noise = _GAUGE_RAD * np.random.default_rng(seed).standard_normal(drive.size)
    angle = np.asarray(still + noise)
    return recording_from_arrays(drive, 1e3 * angle, _LOOP_RATE_HZ, "known loops"), drive


def _plays(workspace: Workspace) -> Iterator[Comparison]:
    """A mirror of play operators: weights, errors, and what is left on both halves of its record."""
    from microrad.lab.identify import identify
    from microrad.lab.identify.selection.predictions import Prediction
    from microrad.lab.identify.selection.warnings import drift

    record, drive = _loop(20_260_112)
    found = identify([record], hold_out=0.5, models=("prandtl_ishlinskii",))
    fit: Any = found.fits[0]
    (score,) = found.scores
    name = "identify.parameters.prandtl_ishlinskii"
    kept = np.flatnonzero(fit.weights_rad_per_v > 0.0)
    half = drive.size // 2
    columns = np.column_stack([*(_play(drive[:half], place * _STEP_V) for place in kept), np.ones(half)])
    errors = _GAUGE_RAD * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))[:-1]
    for place, threshold in enumerate(fit.thresholds_v.tolist()):
        what = f"threshold {place}"
        yield Comparison(f"{name}.thresholds_v", what, place * _STEP_V, threshold, 1e-9, "V", "rounding")
    for place, error in zip(kept.tolist(), errors.tolist(), strict=True):
        weight, obtained = _PLAYS.get(place, 0.0), float(fit.weights_rad_per_v[place])
        why = "five standard errors of least squares; neighbours that are held at 0 share what they lack"
        yield Comparison(f"{name}.weights_rad_v", f"weight {place}", weight, obtained, _SIGMAS * error, "rad/V", why)
        why = "15 %: the rms of 6000 samples, their colour by chance, and where the fit begins"
        obtained = float(fit.standard_errors_rad_per_v[place])
        yield Comparison(f"{name}.standard_errors_rad_v", f"error {place}", error, obtained, 0.15 * error, "rad/V", why)
    still = sum(weight * _play(drive, place * _STEP_V) for place, weight in _PLAYS.items())
    span, largest = float(np.ptp(still)), _largest(drive.size)
    off = 2.0 * _GAUGE_RAD * largest[1]
    why = "twice the largest noise of so many samples"
    yield Comparison("identify.span_rad", "largest less least angle", span, found.span_rad, off, "rad", why)
    fastest = 2.0 * math.pi * _LOOP_HZ * _DRIVE_V
    yield Comparison(
        "identify.rate_limit_v_s",
        "fastest drive of sines",
        fastest,
        found.rate_limit_v_per_s,
        2e-3 * fastest,
        "V/s",
        "0.2 %: 99.5 % of the rates of a sine that has a third of the time, smoothed",
    )
    noise = 100.0 * _GAUGE_RAD / found.span_rad
    off = noise * (_SIGMAS / math.sqrt(2.0 * half) + len(kept) / half)
    why = f"five standard errors of the rms of {half} samples, and the freedom of the weights"
    for part, rms, peak in (
        ("fit", score.fit_rms_percent, score.fit_peak_percent),
        ("held_out", score.held_out_rms_percent, score.held_out_peak_percent),
    ):
        what = f"error that is left, {part.replace('_', ' ')}: the gauge's noise over the span"
        yield Comparison(f"identify.scores.0.{part}_rms_percent", what, noise, rms, off, "%", why)
        what = f"largest error, {part.replace('_', ' ')}"
        low, high = (noise * each for each in _largest(half))
        why = f"largest of {half} normal numbers, at one in a thousand either way"
        yield Comparison(
            f"identify.scores.0.{part}_peak_percent", what, (low + high) / 2.0, peak, (high - low) / 2.0, "%", why
        )
    first, count = 500, drive.size
    trend = _TREND_RAD * np.linspace(-0.5, 0.5, count)
    noisy = trend + _GAUGE_RAD * np.random.default_rng(20_260_113).standard_normal(count)
    of = Prediction(np.zeros(count), noisy, first, half, 0)
    obtained, _ = drift([of], [record], span)
    expected = _TREND_RAD * (count - first) / count
    off = _SIGMAS * _GAUGE_RAD * math.sqrt(12.0 / (count - first))
    why = "five standard errors of a slope"
    yield Comparison(
        "identify.drift_rad", "drift behind the samples that do not count", expected, obtained, off, "rad", why
    )


def _largest(count: int) -> tuple[float, float]:
    """Ends between which the largest of so many normal numbers, either sign, lies but for one in a thousand each."""
    found = []
    for chance in (1e-3, 1.0 - 1e-3):
        beyond = -math.expm1(math.log(chance) / count)
        low, high = 0.0, 10.0
        for _ in range(60):
            middle = (low + high) / 2.0
            low, high = (middle, high) if math.erfc(middle / math.sqrt(2.0)) > beyond else (low, middle)
        found.append(low)
    return found[0], found[1]


def _colour(workspace: Workspace) -> Iterator[Comparison]:
    """Correlations of noise whose own are known."""
    from microrad.lab.identify.selection.warnings import residual_test

    count, keeps, late, share = 40_000, 0.7, 3, 0.2
    drive, noise = np.random.default_rng(20_260_114).standard_normal((2, count))
    coloured = np.empty(count)
    at = 0.0
    for place, value in enumerate(noise):
        coloured[place] = at = keeps * at + value
    test = residual_test(coloured, drive)
    # Bartlett: the variance of a correlation is no more than the sum of all squares over the samples
    off = _SIGMAS * math.sqrt((1.0 + keeps**2) / (1.0 - keeps**2) / count)
    for lag in (1, 2, 5, 10):
        what = f"autocorrelation of first-order noise at {lag} samples"
        obtained = float(test.autocorrelation[lag - 1])
        yield Comparison(
            "identify.residual.autocorrelation", what, keeps**lag, obtained, off, "", "five standard errors (Bartlett)"
        )
    mixed = noise + share * np.roll(drive, late)
    test = residual_test(mixed, drive)
    expected = share / math.hypot(1.0, share)
    off = _SIGMAS / math.sqrt(count)
    for lag in (0, late, late + 1):
        what = f"correlation with a drive {lag} samples before, which acts {late} samples late"
        wanted = expected if lag == late else 0.0
        obtained = float(test.cross_correlation[lag])
        yield Comparison("identify.residual.cross_correlation", what, wanted, obtained, off, "", "five standard errors")
    test = residual_test(noise, drive)
    bound = 1.959963985 / math.sqrt(count)
    yield Comparison("identify.residual.bound", "bound of 95 %", bound, test.bound, 1e-3 * bound, "", "1.96")
    for which, obtained in zip(("autocorrelations", "cross_correlations"), test.outside, strict=True):
        off = _SIGMAS * math.sqrt(0.05 * 0.95 / 50)
        what = f"share of {which} of white noise beyond the bound of 95 %"
        yield Comparison(
            f"identify.residual.share_of_{which}_outside", what, 0.05, obtained, off, "", "five standard errors of 50"
        )


CHECKS = (
    Check(
        "known-mirror",
        "Poles, zeros, gains and their errors of a linear mirror whose truth is known",
        Referent.INDEPENDENT,
        "Its record comes from partial fractions, line by line; least standard errors from the slopes of the truth.",
        "Cramer 1946 and Rao 1945",
        _linear,
    ),
    Check(
        "known-plays",
        "Loops of play operators whose weights are known",
        Referent.INDEPENDENT,
        "The plays are stepped by their definition; what a fit has to leave is the noise that was added.",
        "Krejci and Kuhnen 2001 for the operator; least squares",
        _plays,
    ),
    Check(
        "known-colour",
        "Correlations of residuals whose own are known",
        Referent.INDEPENDENT,
        "First-order noise, and noise with a part of the drive.",
        "Bartlett, J. R. Stat. Soc. Suppl. 8, 27 (1946)",
        _colour,
    ),
)
