"""Second-order sections for controllers, discrete at the control period: notch, low-pass with lead, and peak."""

import math

import numpy as np

from microrad.core import lti


def second_order(
    numerator: tuple[float, float, float], denominator: tuple[float, float, float], freq_hz: float, period_s: float
) -> lti.StateSpace:
    """Discrete section of a ratio of polynomials in q = s / (2 pi ``freq_hz``).

    Tustin's rule prewarped to be exact at ``freq_hz``: q = (z - 1) / (t (z + 1)), t = tan(pi f T) (Franklin, Powell and
    Workman, Digital Control of Dynamic Systems, 3rd ed., section 6.1). A stable filter stays stable.

    Args:
        numerator: Coefficients of q^2, q and 1.
        denominator: The same of the denominator.
        freq_hz: Frequency at which q = i, and at which the section is exact.
        period_s: Control period.

    Raises:
        ValueError: For a frequency that is not between 0 and half the control rate.
    """
    refuse_beyond_rate(freq_hz, period_s, "a second-order section")
    t = math.tan(math.pi * freq_hz * period_s)
    powers = np.array([[1.0, t, t * t], [-2.0, 0.0, 2.0 * t * t], [1.0, -t, t * t]])
    b, a = powers @ numerator, powers @ denominator
    b, a = b / a[0], a / a[0]
    return lti.StateSpace(
        A=np.array([[-a[1], 1.0], [-a[2], 0.0]]),
        B=(b[1:] - a[1:] * b[0])[:, None],
        C=np.array([[1.0, 0.0]]),
        D=np.array([[b[0]]]),
    )


def notch(centre_hz: float, depth: float, width: float, period_s: float) -> lti.StateSpace:
    """Notch (q^2 + depth width q + 1) / (q^2 + width q + 1): its gain is 1 at 0 and at half the rate.

    Args:
        centre_hz: Centre frequency.
        depth: Gain at the centre; above 1 it raises the band instead.
        width: Range of frequency, over the centre, that a deep notch attenuates by 3 dB or more.
        period_s: Control period.

    Raises:
        ValueError: For a centre that is not between 0 and half the control rate.
    """
    return second_order((1.0, depth * width, 1.0), (1.0, width, 1.0), centre_hz, period_s)


def low_pass(freq_hz: float, damping: float, period_s: float, lead_hz: float = math.inf) -> lti.StateSpace:
    """Low-pass of second order, (1 + s/lead) / (q^2 + 2 damping q + 1): its gain is 1 at 0.

    Args:
        freq_hz: Natural frequency.
        damping: Damping ratio.
        period_s: Control period.
        lead_hz: Frequency of its zero; infinite, as by default, for none.

    Raises:
        ValueError: For a natural frequency that is not between 0 and half the control rate.
    """
    return second_order((0.0, freq_hz / lead_hz, 1.0), (1.0, 2.0 * damping, 1.0), freq_hz, period_s)


def peak(freq_hz: float, damping: float, at_centre: complex, period_s: float) -> lti.StateSpace:
    """Resonator c/(z - p) + c*/(z - p*) with p = exp((i - damping) w T), w = 2 pi ``freq_hz``.

    Its response around w is ``at_centre`` / (1 + i (w' - w) / (damping w)): the complex residue carries the phase.

    Args:
        freq_hz: Centre frequency.
        damping: Damping ratio, half the relative width.
        at_centre: Complex response at the centre.
        period_s: Control period.

    Raises:
        ValueError: For a frequency that is not between 0 and half the control rate.
    """
    refuse_beyond_rate(freq_hz, period_s, "a peak filter")
    turn = 2.0 * math.pi * freq_hz * period_s
    centre, pole = np.exp(1j * turn), np.exp((1j - damping) * turn)
    near, far = 1.0 / (centre - pole), 1.0 / (centre - np.conj(pole))
    residue = (at_centre * np.conj(near) - np.conj(at_centre) * far) / (abs(near) ** 2 - abs(far) ** 2)
    return lti.StateSpace(
        A=np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        B=np.array([[1.0], [0.0]]),
        C=2.0 * np.array([[residue.real, -residue.imag]]),
        D=np.zeros((1, 1)),
    )


def refuse_beyond_rate(freq_hz: float, period_s: float, what: str) -> None:
    """Raise ValueError for a frequency that is not between 0 and half the control rate.

    Args:
        freq_hz: The frequency.
        period_s: Control period.
        what: What has this frequency, as the message begins.

    Raises:
        ValueError: The frequency lies outside.
    """
    if not 0.0 < freq_hz < 0.5 / period_s:
        raise ValueError(
            f"{what} at {freq_hz:g} Hz: a controller with a period of {period_s:g} s has no such frequency; "
            f"give one above 0 and below {0.5 / period_s:g} Hz, or raise the control rate"
        )


def parallel(*systems: lti.StateSpace) -> lti.StateSpace:
    """Sum of the outputs of systems that share their input."""
    from scipy.linalg import block_diag

    return lti.StateSpace(
        A=block_diag(*(s.A for s in systems)),
        B=np.vstack([s.B for s in systems]),
        C=np.hstack([s.C for s in systems]),
        D=np.sum([s.D for s in systems], axis=0),
    )
