"""Small one-axis design plants whose every number is known: for tests of controllers and of their analysis."""

import math

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.loop.control.problem import DesignPlant

Floats = NDArray[np.float64]

LINE_DAMPING = 1e-3
"""Damping ratio of the oscillators that stand for wheel lines."""


def axis_plant(
    *,
    gain: float = 0.089e-3,
    delay: int = 1,
    amplifier_hz: float = 1e3,
    resonance: tuple[float, float] | None = None,
    gauge: bool = True,
    noise_rad: float = 1e-6,
    gauge_noise_rad: float = 0.1e-6,
    disturbance_rad: float = 11.2e-6,
    corner_hz: float = 1.0,
    lines: tuple[tuple[float, float], ...] = (),
    period_s: float = 2e-4,
) -> DesignPlant:
    """Zero-order hold of ``gain`` / (1 + s/wa) times the resonance, behind ``delay`` samples of computation.

    From command to y: the command of sample k acts on the hardware from sample k + delay on, so that y moves first at
    sample k + delay + 1. ``resonance`` is (frequency in Hz, damping ratio), of unit slow gain. An infinite
    ``amplifier_hz`` leaves the amplifier out. The sensors add noise (``noise_rad``, ``gauge_noise_rad``: rms a sample)
    and no delay of their own; ``gauge=False`` zeroes the gauge's row.

    The disturbance's first component is an Ornstein-Uhlenbeck process, rms ``disturbance_rad``, exactly sampled, with a
    spectrum 1/(1 + (f/corner)^2); each of ``lines`` (frequency in Hz, rms in rad) adds an oscillator, one white
    sequence each. States: hardware, commands on their way (newest first), disturbance.
    """
    A, B, C = _hardware(amplifier_hz, resonance, period_s)
    A, B, C = _delayed(A, B, gain * C, delay)
    Ad, Bd, Cd = _disturbance(disturbance_rad, corner_hz, lines, period_s)
    n, nd, w = A.shape[0], Ad.shape[0], Bd.shape[1]
    whole = np.zeros((n + nd, n + nd))
    whole[:n, :n], whole[n:, n:] = A, Ad
    inputs = np.zeros((n + nd, 3 + w))
    inputs[:n, :1], inputs[n:, 1 : 1 + w] = B, Bd
    residual = np.hstack([-C, Cd])
    reading = np.hstack([C, np.zeros((1, nd))]) if gauge else np.zeros((1, n + nd))
    direct = np.zeros((3, 3 + w))
    direct[1, 1 + w] = noise_rad
    direct[2, 2 + w] = gauge_noise_rad if gauge else 0.0
    system = lti.StateSpace(whole, inputs, np.vstack([residual, residual, reading]), direct)
    return DesignPlant(period_s, system, w, gain, has_gauge=gauge)


def _hardware(amplifier_hz: float, resonance: tuple[float, float] | None, period_s: float) -> tuple[Floats, ...]:
    """Amplifier and resonance of unit slow gain, discrete under a zero-order hold."""
    parts = []
    if math.isfinite(amplifier_hz):
        w = 2 * np.pi * amplifier_hz
        parts.append(lti.StateSpace(np.array([[-w]]), np.array([[w]]), np.ones((1, 1)), np.zeros((1, 1))))
    if resonance is not None:
        w, zeta = 2 * np.pi * resonance[0], resonance[1]
        A = w * np.array([[0.0, 1.0], [-1.0, -2 * zeta]])  # states: y and y'/w
        parts.append(lti.StateSpace(A, np.array([[0.0], [w]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))))
    if not parts:
        return np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))
    s = parts[0] if len(parts) == 1 else lti.series(parts[0], parts[1])
    A, B = lti.zero_order_hold(s.A, s.B, period_s)
    return A, B, s.C


def _delayed(A: Floats, B: Floats, C: Floats, delay: int) -> tuple[Floats, Floats, Floats]:
    """The system behind a chain of ``delay`` samples."""
    n = A.shape[0]
    if delay == 0:
        return A, B, C
    whole, inputs = np.zeros((n + delay, n + delay)), np.zeros((n + delay, 1))
    whole[:n, :n], whole[:n, n + delay - 1 :] = A, B
    whole[n + 1 :, n:-1] = np.eye(delay - 1)
    inputs[n, 0] = 1.0
    return whole, inputs, np.hstack([C, np.zeros((1, delay))])


def _disturbance(
    rms_rad: float, corner_hz: float, lines: tuple[tuple[float, float], ...], period_s: float
) -> tuple[Floats, Floats, Floats]:
    """Ornstein-Uhlenbeck process and oscillators, side by side; one white sequence of unit variance each."""
    count = 1 + len(lines)
    keep = math.exp(-2 * np.pi * corner_hz * period_s)
    A, B, C = np.zeros((2 * count - 1, 2 * count - 1)), np.zeros((2 * count - 1, count)), np.zeros((1, 2 * count - 1))
    A[0, 0], B[0, 0], C[0, 0] = keep, math.sqrt(1.0 - keep**2), rms_rad
    for j, (freq_hz, rms) in enumerate(lines, start=1):
        w = 2 * np.pi * freq_hz * period_s
        a, b = math.exp(-LINE_DAMPING * w), w * math.sqrt(1.0 - LINE_DAMPING**2)
        i = 2 * j - 1
        A[i : i + 2, i : i + 2] = a * np.array([[math.cos(b), math.sin(b)], [-math.sin(b), math.cos(b)]])
        B[i, j], C[0, i] = 1.0, rms / math.sqrt(_rotation_variance(a, b))
    return A, B, C


def _rotation_variance(a: float, b: float) -> float:
    """Sum of (a^k cos(b k))^2: the variance of a damped rotation's first component under unit white noise."""
    return 0.5 / (1.0 - a**2) + 0.5 * float(np.real(1.0 / (1.0 - (a * np.exp(1j * b)) ** 2)))
