"""Whole periods of sampled signals, band-limited: at a higher rate, and later by any delay."""

import numpy as np

from microrad.core.arrays import Floats


def upsampled(signals: Floats, factor: int) -> Floats:
    """Signals at a multiple of their rate, without content above half of the rate that they had.

    Args:
        signals: Whole periods of the signals, shape (samples, signals).
        factor: The multiple; row factor * k of the result belongs to sample k.
    """
    if factor == 1:
        return signals
    spectrum = np.fft.rfft(signals, axis=0)
    if signals.shape[0] % 2 == 0:
        spectrum[-1] *= 0.5  # at the higher rate this line, at half of the lower one, has its conjugate beside it
    return np.asarray(np.fft.irfft(spectrum, factor * signals.shape[0], axis=0) * factor)


def delayed(signals: Floats, rate_hz: float, delay_s: float, factor: int) -> Floats:
    """Signals later by a delay and at a multiple of their rate.

    Args:
        signals: Whole periods of the signals, shape (samples, signals).
        rate_hz: Their sample rate, in Hz.
        delay_s: Delay, in s, positive for later.
        factor: Samples of the result for each of theirs.
    """
    fine = upsampled(signals, factor)  # before it is turned: a line at half of their rate has no phase at that rate
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(fine.shape[0], 1 / (factor * rate_hz)) * delay_s)
    late = np.fft.irfft(np.fft.rfft(fine, axis=0) * turn[:, None], fine.shape[0], axis=0)
    return np.ascontiguousarray(late)
