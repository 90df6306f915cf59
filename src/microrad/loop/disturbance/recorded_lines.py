"""Spectral lines in a recorded motion: sinusoids that keep amplitude and phase from its first eighth to its last."""

import math
from itertools import pairwise

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.loop.disturbance.records import SpectralLine

_MOST_LINES = 32
_MOST_LOOKS = 200  # at peaks, most of which a narrow resonance may have
_PARTS = 8
_LEAST_PERIODS = 16.0  # of a line in a recording: two in each part
_BY_CHANCE = 1e-6  # that noise has a peak so far above its density
_WANDERING = 0.1  # by which a line's amplitude may differ from part to part, beside what noise makes of it
_SCATTER = 3.0  # times the variance that noise has in a part; chi-square of 14 degrees of freedom: once in 8000
_NEAR = 4  # bins of a Hann window's main lobe
_LEAST_FLOOR = 1e-12  # of the largest power: rounding


def find_lines(rest_rad: Floats, step_s: float) -> tuple[tuple[SpectralLine, ...], Floats]:
    """Lines of a motion, strongest above the density around them first, and the motion without them.

    A line is a peak of the periodogram of all of the recording (Hann window) that noise of the smooth density around it
    has in one recording of a million, and whose complex amplitude is the same in each eighth of the recording, within
    what that density makes of it and a tenth. So it is as narrow as the recording is long: the peaks of a narrow
    resonance turn and change from part to part. Frequency, amplitude and phase are those of least squares.

    Args:
        rest_rad: The motion (rad) without mean and drift, shape (samples,).
        step_s: Between two samples (s).
    """
    count = rest_rad.size
    window = _hann(count)
    time: Floats = step_s * (np.arange(count, dtype=float) - 0.5 * (count - 1))
    found: list[tuple[float, complex]] = []
    rest, refused = rest_rad, np.zeros(count // 2 + 1, dtype=bool)
    refused[: math.ceil(_LEAST_PERIODS)] = True
    power, floor = _power_and_floor(rest, window)
    for _ in range(_MOST_LOOKS):
        excess = np.where(refused, 0.0, power / floor)
        at = int(np.argmax(excess))
        if len(found) == _MOST_LINES or excess[at] < math.log(power.size / _BY_CHANCE):
            break
        freq, amplitude = _refined(rest, time, window, at / (count * step_s))
        noise = 2.0 * floor[at] / float(np.sum(window)) ** 2 * 2.0 * _PARTS  # |amplitude|^2 of a part
        if not _steady(rest, time, freq, noise):
            refused[max(at - _NEAR, 0) : at + _NEAR + 1] = True
            continue
        found.append((freq, amplitude))
        rest = rest - _wave(time, freq, amplitude)
        for i, (freq, amplitude) in enumerate(found):  # each anew beside the others
            alone = rest + _wave(time, freq, amplitude)
            found[i] = _refined(alone, time, window, freq)
            rest = alone - _wave(time, *found[i])
        power, floor = _power_and_floor(rest, window)
    return tuple(SpectralLine(abs(amplitude), freq) for freq, amplitude in found), rest


def _hann(count: int) -> Floats:
    from scipy.signal.windows import hann

    return np.asarray(hann(count, sym=False))


def _power_and_floor(rest: Floats, window: Floats) -> tuple[Floats, Floats]:
    """Squared transform under the window by bin, and its mean around each bin, from medians, which no peak moves."""
    power = np.abs(np.fft.rfft(rest * window)) ** 2
    edges = [1]
    while edges[-1] < power.size:
        edges.append(edges[-1] + max(48, edges[-1] // 10))
    edges[-1] = power.size
    if len(edges) > 2 and edges[-1] - edges[-2] < 48:
        del edges[-2]
    medians = [float(np.median(power[a:b])) / math.log(2.0) for a, b in pairwise(edges)]
    centres = [0.5 * (a + b - 1) for a, b in pairwise(edges)]
    least = _LEAST_FLOOR * float(np.max(power)) + np.finfo(float).tiny
    floor = np.interp(np.arange(power.size), centres, np.log(np.maximum(medians, least)))
    return power, np.asarray(np.exp(floor))


def _wave(time: Floats, freq: float, amplitude: complex) -> Floats:
    return np.asarray((amplitude * np.exp(2j * math.pi * freq * time)).real)


def _refined(rest: Floats, time: Floats, window: Floats, freq: float) -> tuple[float, complex]:
    """Frequency and complex amplitude of least squares under the window near a frequency, by Gauss-Newton steps."""
    amplitude = 0j
    for _ in range(6):
        turning = np.exp(2j * math.pi * freq * time)
        columns = np.stack([turning.real, -turning.imag])  # of the amplitude's real and imaginary part
        if amplitude:
            slope = (2j * math.pi * time * amplitude * turning).real
            columns = np.vstack([columns, slope])
        weighed = columns * window
        size = np.sqrt(np.sum(weighed * columns, axis=1))
        solved = np.linalg.solve((weighed @ columns.T) / np.outer(size, size), weighed @ rest / size) / size
        amplitude = complex(solved[0], solved[1])
        if solved.size == 3:
            freq += float(solved[2])
    return freq, amplitude


def _steady(rest: Floats, time: Floats, freq: float, noise: float) -> bool:
    """Whether the complex amplitude is the same in each part, but for what noise of this variance makes of it."""
    parts = _amplitudes(rest, time, freq)
    mean = complex(np.mean(parts))
    scatter = float(np.sum(np.abs(parts - mean) ** 2)) / (parts.size - 1)
    return scatter <= _SCATTER * noise + (_WANDERING * abs(mean)) ** 2


def _amplitudes(rest: Floats, time: Floats, freq: float) -> Complexes:
    length = rest.size // _PARTS
    window = _hann(length)
    turned = (rest * np.exp(-2j * math.pi * freq * time))[: _PARTS * length].reshape(_PARTS, length)
    return np.asarray(2.0 * (turned @ window) / np.sum(window))
