"""What drive and output say together: the excited band, whether the output follows, and whether it leads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.units import plain
from microrad.lab.recording.checks.channel import block_means
from microrad.lab.recording.records import Finding

_BAND_BLOCK = 1 << 20
_MAX_SEGMENT, _SHORT_SEGMENT = 1 << 16, 1 << 12
# 99.9 % of the power: the rest is converter noise in a good record, and too little to identify from in any.
_OUTSIDE = 5e-4
# A drive whose motion is 1e-5 of its offset is the flicker of a constant; one with 1e-6 of the strongest input's power
# (60 dB less) moves the mirror less than that input's noise does.
_STILL, FAINT = 1e-5, 1e-6
_SHORT_RECORD, _ORDER = 20_000, 8
# A multiplexed converter reads its channels up to one step apart in time, typically half of one.
_LEAD_SAMPLES = 0.75
# Hysteresis turns a sine by at most 15 degrees or so; swapped channels show that as a lead.
_NARROW_RAD = math.radians(25)


def excitation(
    inputs: Sequence[Floats], labels: Sequence[str], rate_hz: float, alone: bool
) -> tuple[tuple[float, float], list[int], list[Finding]]:
    """The band in Hz with 99.9 % of the power of the inputs that move, their numbers, and a finding for each input.

    Args:
        inputs: Samples of each input, each of shape (samples,).
        labels: The inputs in the words of a message, in the same order.
        rate_hz: Sample rate, in Hz.
        alone: Whether all of them have to move; else one that rests beside one that moves is no fault.
    """
    bands, powers = zip(*(_band(values, rate_hz) for values in inputs), strict=True)
    still = [_stillness(values, power, max(powers)) for values, power in zip(inputs, powers, strict=True)]
    may_rest = not alone and not all(still)
    moving = [k for k, text in enumerate(still) if not (text and may_rest)]
    findings = []
    for label, text, (low, high) in zip(labels, still, bands, strict=True):
        said = (
            f"{label} is excited from {plain(low, 4)} to {plain(high, 4)} Hz (99.9 % of its power); nothing outside "
            "that band can be learnt from this record"
        )
        if text:
            remedy = "it rests, and other recordings have to tell what it does" if may_rest else text[1]
            said = f"{label} {text[0]}: that is no excitation; {remedy}"
        findings.append(Finding("unexcited", label, None, said, bool(text) and not may_rest))
    return (min(bands[k][0] for k in moving), max(bands[k][1] for k in moving)), moving, findings


def _stillness(values: Floats, power: float, strongest: float) -> tuple[str, str] | None:
    """Why an input does not move the mirror, in words that follow its name, and what to do; None where it does."""
    offset = float(values.mean())
    if power == 0.0 or math.sqrt(power) < _STILL * abs(offset):
        return f"moves by {math.sqrt(power):.2g} rms about {offset:.6g}", "drive the mirror up and down"
    if power < FAINT * strongest:
        return f"has {power / strongest:.1g} of the power of the strongest input", "drive it, or leave it out"
    return None


def _band(values: Floats, rate_hz: float) -> tuple[tuple[float, float], float]:
    """Band with 99.9 % of the power about the mean, and that power."""
    size = min(values.size, _BAND_BLOCK)
    mean = float(values.mean())
    window = np.hanning(size + 2)[1:-1]
    density = np.zeros(size // 2 + 1)
    blocks = values.size // size
    for k in range(blocks):
        block = values[k * size : (k + 1) * size] - mean
        density += np.abs(np.fft.rfft(block * window)) ** 2
    total = np.cumsum(density)
    low, high = np.searchsorted(total, [_OUTSIDE * total[-1], (1 - _OUTSIDE) * total[-1]])
    power = 2 * float(total[-1]) / (blocks * size * float(window @ window))
    return (float(low) * rate_hz / size, float(max(high, 1)) * rate_hz / size), power


@dataclass(frozen=True, eq=False)
class _Response:
    """Averaged response of one output: frequencies, response per input, multiple coherence, share and
    cross-power of each input, number of independent averages."""

    freq_hz: Floats
    response: Complexes
    coherence: Floats
    share: Floats
    cross: Floats
    averages: float


def follows(
    label: str,
    output: Floats,
    inputs: Sequence[Floats],
    labels: Sequence[str],
    rate_hz: float,
    band: tuple[float, float],
) -> list[Finding]:
    """Findings on an output that does not follow the inputs, or that comes before them.

    Args:
        label: The output in the words of a message.
        output: Its samples, shape (samples,).
        inputs: Samples of each input, each of shape (samples,).
        labels: The inputs in the words of a message, in the same order.
        rate_hz: Sample rate, in Hz.
        band: Lowest and highest excited frequency, in Hz, as `excitation` finds them.
    """
    factor = max(1, int(rate_hz / (16 * band[1])))
    factor = min(factor, max(1, output.size // 4096))
    slow = [block_means(column, factor) for column in (*inputs, output)]
    slow = [column - column.mean() for column in slow]
    samples, slow_hz = slow[-1].size, rate_hz / factor
    # Many short segments decide whether there is a response at all, few long ones with four periods of the slowest
    # line each resolve its phase.
    short = _response(slow[:-1], slow[-1], slow_hz, min(samples / 32, _SHORT_SEGMENT))
    long = _response(slow[:-1], slow[-1], slow_hz, min(4 * slow_hz / max(band[0], slow_hz / samples), samples / 4))
    if short is not None and long is not None and (text := _unrelated(label, slow, short, long)):
        return [Finding("dead", label, None, text, True)]
    if long is None or not (found := _lead(label, labels, long, band, rate_hz)):
        return []
    if not found[0].refused:
        return found if len(inputs) == 1 else []  # coupled axes have zeros, which look the same
    # A second witness: the correlation in time must peak at a lead too, within half a period.
    dominant = float(long.freq_hz[np.argmax(long.cross.sum(axis=1))])
    column = int(np.argmax(long.share.sum(axis=0)))
    lag, _ = _correlation([slow[column]], slow[-1], int(0.5 * slow_hz / dominant))
    return found if lag * factor < -0.25 else []


def _unrelated(label: str, slow: Sequence[Floats], found: _Response, long: _Response) -> str:
    """The evidence that an output has nothing to do with the inputs, or nothing.

    Four looks must all fail: the best bin of many short segments, the mean over the bins of few long ones (a lightly
    damped mirror rings longer than a short segment), the correlation in time (slow or stepping drives), which chance
    keeps below 6 / sqrt(samples), and the prediction of the output (short records of lightly damped mirrors).
    """
    best = float(found.coherence.max())
    # Unrelated noise: P(coherence > x) = (1 - x)^(averages - inputs) in each bin (Carter 1987).
    chance = 1 - (1e-6 / found.coherence.size) ** (1 / max(found.averages - len(slow) + 1, 1.0))
    if best >= chance:
        return ""
    usual = (len(slow) - 1) / long.averages  # mean coherence of unrelated noise, and about its scatter
    if float(long.coherence.mean()) > usual + 6 * usual / math.sqrt(long.coherence.size / 1.5) + 0.1:
        return ""
    samples = slow[-1].size
    _, alike = _correlation(slow[:-1], slow[-1], samples // 4)
    if alike >= 6 / math.sqrt(samples) or _predicts(slow[:-1], slow[-1]):
        return ""
    return (
        f"{label} does not follow the drive: the coherence is at most {best:.2g}, where unrelated noise reaches "
        f"{chance:.2g}, and the correlation at any lag at most {alike:.2g}; a dead or unplugged sensor, or the wrong "
        "column: check the wiring or name another channel"
    )


def _correlation(inputs: Sequence[Floats], output: Floats, reach: int) -> tuple[float, float]:
    """Lag in samples, and size, of the largest correlation of the output with an input; a negative lag is a lead."""
    output, *inputs = (column[:_BAND_BLOCK] for column in (output, *inputs))
    reach = max(2, min(reach, output.size // 4))
    size = 1 << math.ceil(math.log2(output.size + reach + 1))
    spectrum = np.fft.rfft(output, size)
    lag, best = 0.0, 0.0
    for column in inputs:
        lagged = np.fft.irfft(spectrum * np.fft.rfft(column, size).conj(), size)
        window = np.abs(np.concatenate((lagged[-reach:], lagged[: reach + 1])))
        k = int(np.argmax(window))
        value = float(window[k]) / math.sqrt(float(column @ column) * float(output @ output))
        if value > best:
            best, lag = value, float(k - reach)
            if 0 < k < window.size - 1:
                left, top, right = window[k - 1 : k + 2]
                lag += 0.5 * float(left - right) / float(left - 2 * top + right)
    return lag, best


def _predicts(inputs: Sequence[Floats], output: Floats) -> bool:
    """Whether inputs improve the prediction of the output from its own past (Granger 1969), beyond any chance."""
    size = min(output.size, _SHORT_RECORD)
    rows = size - _ORDER

    def lags(column: Floats, first: int) -> list[Floats]:
        return [column[_ORDER - k : size - k] for k in range(first, _ORDER + 1)]

    past = np.column_stack([np.ones(rows), *lags(output, 1)])
    both = np.column_stack([past, *(lag for column in inputs for lag in lags(column, 0))])
    target = output[_ORDER:size]
    alone, joint = (
        float(np.sum((target - table @ np.linalg.lstsq(table, target, rcond=None)[0]) ** 2)) for table in (past, both)
    )
    added = both.shape[1] - past.shape[1]
    # Chi-squared with `added` degrees of freedom for unrelated inputs (likelihood ratio).
    return joint <= 0 or rows * math.log(alone / joint) > added + 6 * math.sqrt(2 * added)


def _response(inputs: Sequence[Floats], output: Floats, rate_hz: float, wanted: float) -> _Response | None:
    """Welch's averages over half-overlapping segments of about the wanted length."""
    samples = output.size
    size = 1 << max(4, math.floor(math.log2(max(min(wanted, _MAX_SEGMENT), 16))))
    starts = range(0, samples - size + 1, size // 2)
    window = np.hanning(size + 1)[:-1]
    m, bins = len(inputs), size // 2 + 1
    suu = np.zeros((bins, m, m), dtype=complex)
    syu, syy = np.zeros((bins, m), dtype=complex), np.zeros(bins)
    for start in starts:
        part = slice(start, start + size)
        u = np.stack([np.fft.rfft(window * column[part]) for column in inputs], axis=1)
        y = np.fft.rfft(window * output[part])
        suu += u[:, :, None] * u[:, None, :].conj()
        syu += y[:, None] * u.conj()
        syy += np.abs(y) ** 2
    freq = np.arange(bins) * rate_hz / size
    power = np.einsum("fii->f", suu).real
    use = (power > 1e-5 * power.max()) & (syy > 0) & (freq > 0)
    if not use.any():
        return None
    suu, syu, syy, freq = suu[use], syu[use], syy[use], freq[use]
    ridge = 1e-9 * np.einsum("fii->f", suu).real[:, None, None] * np.eye(m) / m
    response = np.linalg.solve((suu + ridge).transpose(0, 2, 1), syu[:, :, None])[:, :, 0]
    coherence = np.clip(np.einsum("fi,fi->f", response, syu.conj()).real / syy, 0, 1)
    share = np.abs(response) ** 2 * np.einsum("fii->fi", suu).real
    # Half-overlapping Hann segments hold about 0.53 independent ones each (Welch 1967).
    averages = max(1.0, 0.53 * len(starts) + 0.47)
    return _Response(freq, response, coherence, share, np.abs(syu), averages)


def _lead(
    label: str, labels: Sequence[str], found: _Response, band: tuple[float, float], rate_hz: float
) -> list[Finding]:
    """Compare the phase at the lower and the upper end of the band.

    A sensor behind a high-pass also leads, and less and less towards higher frequencies: that is noted. A lead that
    holds or grows with frequency belongs to an output that is ahead in time, or to swapped channels. One frequency
    alone cannot tell a lead from a longer lag, nor from an inverted output: only small leads are judged there.
    """
    column = int(np.argmax(found.share.sum(axis=0)))
    good = (found.coherence > 0.8) & (found.freq_hz >= 0.9 * band[0]) & (found.freq_hz <= 1.1 * band[1])
    if not good.any():
        return []
    freq, phase = found.freq_hz[good], np.angle(found.response[good, column])
    weight = found.share[good, column]
    error = np.sqrt((1 - found.coherence[good]) / (2 * found.coherence[good] * found.averages)) + 1e-9
    jumps = np.flatnonzero(np.abs(np.angle(np.exp(1j * np.diff(phase)))) > math.pi / 2)
    last = int(jumps[0]) + 1 if jumps.size else freq.size  # behind a resonance the phase is ambiguous
    freq, phase, weight, error = freq[:last], np.unwrap(phase[:last]), weight[:last], error[:last]
    broad = band[1] > 3 * band[0] and freq[-1] > 2 * freq[0] and freq.size > 6
    if broad:
        phase = phase - math.pi * np.round(phase[0] / math.pi)  # wired the other way round
        if abs(phase[0]) > math.pi / 4:
            return []
    split = math.sqrt(freq[0] * freq[-1])
    upper = freq >= split if broad else np.ones(freq.size, dtype=bool)
    lower = freq < split if broad else upper
    at_hz, top, top_error = _mean(freq[upper], phase[upper], weight[upper], error[upper])
    low_hz, bottom, low_error = _mean(freq[lower], phase[lower], weight[lower], error[lower])
    falls = broad and top < 0.5 * bottom
    at_hz, lead, lead_error = (low_hz, bottom, low_error) if falls else (at_hz, top, top_error)
    samples = lead / (2 * math.pi * at_hz) * rate_hz
    certain = lead > 5.0 * lead_error
    if not certain or samples < _LEAD_SAMPLES or (not broad and lead > _NARROW_RAD):
        return []
    text = (
        f"{label} leads {labels[column]} by {plain(math.degrees(lead))} ± {plain(math.degrees(lead_error), 1)} degrees "
        f"at {plain(at_hz, 4)} Hz, {plain(samples)} samples"
    )
    if falls:
        text += f", and by {plain(math.degrees(top))} degrees higher in the band, as behind a high-pass"
        return [Finding("lead", label, None, text, False)]
    text += "; an output cannot come before its drive: swap input and output if they are the wrong way round, else "
    return [Finding("lead", label, None, text + "align the channels in time", True)]


def _mean(freq: Floats, phase: Floats, weight: Floats, error: Floats) -> tuple[float, float, float]:
    """Power-weighted frequency and phase, and the standard error of the phase."""
    weight = weight / weight.sum()
    return float(weight @ freq), float(weight @ phase), float(np.sqrt(weight**2 @ error**2))
