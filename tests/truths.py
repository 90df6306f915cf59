"""Mirrors to be identified, made by NumPy and SciPy alone: play operators, Bouc-Wen, creep, a resonance behind them."""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from microrad.lab.recording import recording_from_arrays

RESONANCE = (150.0, 0.35)  # Hz, damping ratio


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def two_sines(samples=3000, rate_hz=1000.0, freq_hz=2.0, seed=None):
    """A drive (V) of a large and a small sine about 5 V, so that there are loops within loops; it begins at 5 V."""
    phase = 2 * np.pi * freq_hz * np.arange(samples) / rate_hz
    return 5.0 + 3.5 * np.sin(phase) + 1.2 * np.sin(3.3 * phase)


def plays(drive, thresholds, weights, widening=0.0, rate_hz=1000.0):
    """Weighted play operators from rest at the first drive value, which counts as zero."""
    p = np.full(len(thresholds), drive[0])
    found, last = [], drive[0]
    r, w = np.array(thresholds), np.array(weights)
    for q in drive:
        wide = np.where(r > 0, r + widening * abs(q - last) * rate_hz, 0.0)
        p = np.maximum(q - wide, np.minimum(q + wide, p))
        found.append(w @ (p - drive[0]))
        last = q
    return np.array(found)


def bouc_wen(drive, rate_hz, parameters, *, gamma=0.0, eta=0.0, exponent=1.0, pieces=10):
    """Bouc-Wen, generalised, by the classical Runge-Kutta method over straight pieces of the drive.

    `parameters` are d1, d2, epsilon, delta, alpha and beta.
    """
    d1, d2, epsilon, delta, alpha, beta = parameters
    h, found, last = 0.0, [0.0], float(drive[0])
    for q in drive[1:].tolist():
        rate = (q - last) * rate_hz
        r = 1.0 if rate > 0 else -1.0
        e, step = epsilon * np.exp(delta * abs(rate)), (q - last) / pieces

        def slope(h, r=r, e=e):
            s = 1.0 if h > 0 else -1.0
            size = (abs(h) * alpha / abs(epsilon)) ** (exponent - 1.0) * abs(h) if h else 0.0
            return e - r * size * (alpha * s + beta * r + gamma + eta * r * s)

        for _ in range(pieces):
            a = slope(h)
            b = slope(h + step / 2 * a)
            c = slope(h + step / 2 * b)
            h += step / 6 * (a + 2 * b + 2 * c + slope(h + step * c))
        found.append(d1 * (np.exp(-d2 * rate) * q - drive[0]) + h)
        last = q
    return np.array(found)


def behind(system, signal, rate_hz, *, held=False):
    """A signal, straight between its samples or held, behind numerator and denominator; it and they begin at rest.

    What scipy's lsim gives, without its loop over the samples.
    """
    numerator, denominator, _ = cont2discrete(system, 1 / rate_hz, "zoh" if held else "foh")
    return lfilter(numerator[0], denominator, signal)


def behind_resonance(signal, rate_hz, resonance=RESONANCE, *, held=False):
    """A signal, straight between its samples or held, behind a second-order low-pass of unit gain."""
    natural, damping = 2 * np.pi * resonance[0], resonance[1]
    system = ([natural**2], [1.0, 2 * damping * natural, natural**2])
    return behind(system, signal - signal[0], rate_hz, held=held)


def creep(drive, rate_hz, times, weight, before=None):
    """Creep of equal weights, with the drive at `before` for ever until the first sample (default: its first value)."""
    time = np.arange(drive.size) / rate_hz
    total = np.zeros(drive.size)
    for tau in times:
        total += behind(([1.0], [tau, 1.0]), drive - drive[0], rate_hz)
        total += ((drive[0] if before is None else before) - drive[0]) * np.exp(-time / tau)
    return weight * total


def recorded(drive, output_rad, rate_hz=1000.0, noise=1e-3, seed=0, name="record", period=None):
    """A recording in V and mrad; the noise is a share of the output's peak-to-peak, and the sensor has an offset."""
    scattered = output_rad + noise * np.ptp(output_rad) * philox(seed).standard_normal(output_rad.size)
    return recording_from_arrays(drive, 1e3 * scattered + 0.2, rate_hz, name, period)


def small_multisine(rate_hz=1000.0, period=1000, periods=3, rms=0.05, highest=0.4, seed=5):
    """A small random-phase multisine about 5 V, a line every hertz from 1 Hz to a share of the sample rate."""
    f = np.fft.rfftfreq(period, 1 / rate_hz)
    lines = np.where((f >= 1) & (f <= highest * rate_hz), np.exp(2j * np.pi * philox(seed).random(f.size)), 0.0)
    one = np.fft.irfft(lines)
    return 5.0 + rms * np.tile(one, periods) / one.std()
