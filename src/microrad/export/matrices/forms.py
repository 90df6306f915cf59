"""Linear models with names, units and origin; their zeros and poles and their coefficients, entry by entry.

A float is an integer over a power of two, so the method of Faddeev and LeVerrier gives the coefficients of an entry
exactly, before they are rounded once, whatever decades the poles span.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.export.matrices.structure import entry_of, refuse_hidden, refuse_unstable
from microrad.export.records import ExportError, Origin

_PROBES = 300
MOST_STATES = 100
"""States of an entry beyond which its coefficients leave the range of a float."""
_VANISHING = 1e-13  # of the terms that a leading coefficient is the sum of: what rounding leaves of a zero
_POLISH = 5  # Newton steps; each doubles the digits of a simple root


@dataclass(frozen=True, slots=True)
class Port:
    """An input, output or state: its name and its SI unit ("1" is a plain number, "" is not known)."""

    name: str
    unit: str


@dataclass(frozen=True, slots=True)
class LinearModel:
    """x' = A x + B u, y = C x + D u; with ``period_s`` above 0 the same for x[k+1], sampled at that period.

    ``origin`` is None for a model that came from outside. ``anti_windup`` is L of a controller, (states, actuators):
    x[k+1] = A x + B m + L (clip(v) - v).
    """

    name: str
    meaning: str
    system: lti.StateSpace
    period_s: float
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    states: tuple[Port, ...]
    origin: Origin | None
    anti_windup: Floats | None = None


@dataclass(frozen=True, slots=True)
class ZeroPoleGain:
    """gain x product of (s - zero) over product of (s - pole), z in place of s where sampled; roots in rad/s or plain.

    ``largest_error`` is the largest relative error of the frequency response computed from this form, at ``at_hz``.
    """

    zeros: Complexes
    poles: Complexes
    gain: float
    largest_error: float
    at_hz: float


@dataclass(frozen=True, slots=True)
class TransferFunction:
    """Coefficients of s (rad/s), or of z where sampled, highest power first; the denominator begins with 1.

    ``largest_error`` as in `ZeroPoleGain`. ``condition`` is that of the denominator's companion matrix (poles at 0
    left out): a state space made from the coefficients may lose that factor of a float's 16 digits.
    """

    numerator: Floats
    denominator: Floats
    largest_error: float
    at_hz: float
    condition: float


@dataclass(frozen=True, slots=True)
class Forms:
    """Both forms of every entry, [output][input]; or, in place of one, the reason why the model is refused in it."""

    zero_pole_gain: tuple[tuple[ZeroPoleGain, ...], ...] | str
    transfer_function: tuple[tuple[TransferFunction, ...], ...] | str


def forms(model: LinearModel) -> Forms:
    """Both forms of every entry of a model; nothing is cancelled.

    A model with a mode that no input drives or no output shows is refused in both: the mode would vanish, or stand as a
    pole with its zero upon it. An unstable model is refused in coefficients, which hide where its poles lie.
    """
    try:
        refuse_hidden(model.system, model.period_s, model.name)
        by_roots = _of_entries(model, _zero_pole_gain)
    except ExportError as refusal:
        return Forms(str(refusal), str(refusal))
    try:
        refuse_unstable(model.system, model.period_s, model.name)
        return Forms(by_roots, _of_entries(model, _transfer_function))
    except ExportError as refusal:
        return Forms(by_roots, str(refusal))


def _of_entries(model: LinearModel, make: Callable[..., Any]) -> tuple[tuple[Any, ...], ...]:
    """What ``make`` makes of each entry, [output][input]."""
    rows = []
    for output in range(len(model.outputs)):
        row = [entry_of(model.system, output, number) for number in range(len(model.inputs))]
        rows.append(tuple(make(entry, *polynomials(entry), model.period_s) for entry in row))
    return tuple(rows)


def factors(numerator: list[Fraction], denominator: list[Fraction]) -> tuple[Complexes, Complexes, float]:
    """Zeros, poles and gain of an entry from its `polynomials`.

    Where the numerator is 0 there are no zeros and no poles, and the gain is 0.

    Args:
        numerator: Its coefficients, highest power first, the first one not 0; empty for 0.
        denominator: Those of the denominator, likewise.

    Raises:
        ExportError: For a coefficient beyond the range of a float.
    """
    if not numerator:
        return np.zeros(0, complex), np.zeros(0, complex), 0.0
    return roots(numerator), roots(denominator), float(floats(numerator[:1])[0])


# ----------------------------------------------------------------------------------------------------------- responses
def _zero_pole_gain(
    entry: lti.StateSpace, numerator: list[Fraction], denominator: list[Fraction], period_s: float
) -> ZeroPoleGain:
    zeros, poles, gain = factors(numerator, denominator)
    if not numerator:
        return ZeroPoleGain(zeros, poles, gain, 0.0, 0.0)
    freq, s = _probes(np.concatenate([zeros, poles]), period_s)
    return ZeroPoleGain(zeros, poles, gain, *_error(entry, factored(zeros, poles, gain, s), freq, period_s))


def factored(zeros: Complexes, poles: Complexes, gain: float, s: Complexes) -> Complexes:
    """The frequency response gain x product of (s - zero) / (s - pole).

    The factors are taken in an order that stays within the range of a float.

    Args:
        zeros: Zeros, shape (zeros,): in rad/s, or plain numbers of the z plane where sampled.
        poles: Poles, likewise.
        gain: The factor in front.
        s: Where the response is wanted, of any shape, in the unit of the roots.
    """
    response = np.full(s.shape, gain, dtype=complex)
    with np.errstate(all="ignore"):  # what leaves the range shows in the result
        for i in range(max(zeros.size, poles.size)):
            response = response * ((s - zeros[i]) if i < zeros.size else 1.0)
            response = response / ((s - poles[i]) if i < poles.size else 1.0)
    return response


def _transfer_function(
    entry: lti.StateSpace, numerator: list[Fraction], denominator: list[Fraction], period_s: float
) -> TransferFunction:
    if not numerator:
        return TransferFunction(np.zeros(1), np.ones(1), 0.0, 0.0, 1.0)
    num, den = floats(numerator), floats(denominator)
    freq, s = _probes(np.concatenate([np.roots(num), np.roots(den)]), period_s)
    with np.errstate(all="ignore"):
        response = np.polyval(num, s) / np.polyval(den, s)
    slow = np.trim_zeros(den, "b")  # poles at 0 make it singular, and cost no digits
    companion = np.eye(slow.size - 1, k=-1)
    companion[:1] = -slow[1:]
    condition = float(np.linalg.cond(companion)) if slow.size > 1 else 1.0
    return TransferFunction(num, den, *_error(entry, response, freq, period_s), condition)


def _probes(roots: Complexes, period_s: float) -> tuple[Floats, Complexes]:
    """Frequencies over the band of the roots, or from 1e-5 to half the sample rate; and s or z there."""
    if period_s:
        freq = np.geomspace(1e-5, 0.5, _PROBES) / period_s
        return freq, np.asarray(np.exp(2j * np.pi * freq * period_s), dtype=complex)
    sizes = np.abs(roots[roots != 0.0]) / (2.0 * np.pi)
    low, high = (float(np.min(sizes)), float(np.max(sizes))) if sizes.size else (1.0, 1.0)
    freq = np.geomspace(0.1 * low, 10.0 * high, _PROBES)
    return freq, np.asarray(2j * np.pi * freq, dtype=complex)


def _error(entry: lti.StateSpace, response: Complexes, freq_hz: Floats, period_s: float) -> tuple[float, float]:
    """Largest relative difference from the state space's response, and the frequency of it."""
    exact = lti.frequency_response(entry, freq_hz, period_s or None)[:, 0, 0]
    with np.errstate(all="ignore"):
        error = np.nan_to_num(np.abs(response / exact - 1.0), nan=math.inf, posinf=math.inf)
    worst = int(np.argmax(error))
    return float(error[worst]), float(freq_hz[worst])


# ------------------------------------------------------------------------------------------------------- whole numbers
def _whole(matrix: Floats) -> tuple[NDArray[Any], int]:
    """Integers and the power of two below them. What 2^-200 of the largest entry is too small to matter goes to 0."""
    largest = float(np.max(np.abs(matrix), initial=0.0))
    ratios = [[(x if abs(x) > largest * 2.0**-200 else 0.0).as_integer_ratio() for x in row] for row in matrix.tolist()]
    power = max((below.bit_length() - 1 for row in ratios for _, below in row), default=0)
    whole = [[above << (power - below.bit_length() + 1) for above, below in row] for row in ratios]
    return np.array(whole, dtype=object).reshape(matrix.shape), power


def polynomials(entry: lti.StateSpace) -> tuple[list[Fraction], list[Fraction]]:
    """Numerator and denominator of one input and output, exact, highest power first.

    With M_0 = 1: c_k = -trace(A M_(k-1)) / k, M_k = A M_(k-1) + c_k; the numerator's coefficients are C M_k B + D c.
    Leading ones that are zero but for rounding are left out. Source: Gantmacher, The Theory of Matrices 1 (1959) 87.

    Raises:
        ExportError: There are more states than `MOST_STATES`.
    """
    n = entry.order
    if n > MOST_STATES:
        raise ExportError(f"{n} states between one input and one output; a transfer function takes {MOST_STATES}")
    (A, a), (b, bp), (c, cp) = _whole(entry.A), _whole(entry.B[:, 0][None]), _whole(entry.C)
    b, c, d = b[0], c[0], Fraction(float(entry.D[0, 0]))
    M, eye = np.array(np.eye(n, dtype=int), dtype=object), np.array(np.eye(n, dtype=int), dtype=object)
    numerator, denominator, sizes = [d], [Fraction(1)], [abs(d)]
    for k in range(1, n + 1):
        through = M @ b
        scale = 1 << (bp + cp + a * (k - 1))
        AM = A @ M
        factor = -int(np.trace(AM)) // k
        denominator.append(Fraction(factor, 1 << (a * k)))
        numerator.append(Fraction(int(c @ through), scale) + d * denominator[k])
        sizes.append(Fraction(int(np.abs(c) @ np.abs(through)), scale) + abs(d * denominator[k]))
        M = AM + factor * eye
    first = next((i for i, x in enumerate(numerator) if abs(x) > _VANISHING * sizes[i]), n + 1)
    return numerator[first:], denominator


def floats(coefficients: Sequence[Fraction]) -> Floats:
    """Coefficients, each rounded once.

    Raises:
        ExportError: For one that no float holds.
    """
    try:
        return np.array([float(each) for each in coefficients], dtype=float)
    except OverflowError as error:
        raise ExportError(
            "a coefficient is beyond the range of a float; take a slower unit of time, or fewer states"
        ) from error


def roots(coefficients: Sequence[Fraction]) -> Complexes:
    """Roots to the last digits: those of the rounded polynomial, then Newton's steps on the exact one."""
    coefficients = list(coefficients)
    at_zero = 0
    while len(coefficients) > 1 and coefficients[-1] == 0:
        coefficients, at_zero = coefficients[:-1], at_zero + 1
    degree = len(coefficients) - 1
    if degree < 1:
        return np.zeros(at_zero, dtype=complex)
    size = abs(coefficients[-1] / coefficients[0])  # the roots' product; a scale near them keeps floats within range
    binary = round((size.numerator.bit_length() - size.denominator.bit_length()) / degree)
    scaled = [each / coefficients[0] * Fraction(2) ** (-binary * k) for k, each in enumerate(coefficients)]
    below = math.lcm(*(each.denominator for each in scaled))
    whole = [int(each * below) for each in scaled]
    found = [_polished(whole, complex(r)) for r in np.roots(floats(scaled)) if r.imag >= 0.0]
    both = [r for each in found for r in ((each, each.conjugate()) if each.imag else (each,))]
    return np.asarray(np.array(both + [0j] * at_zero) * 2.0**binary, dtype=complex)


def _polished(coefficients: list[int], root: complex) -> complex:
    degree = len(coefficients) - 1
    slope = [(degree - k) * each for k, each in enumerate(coefficients[:-1])]
    for _ in range(_POLISH):
        (x, bx), (y, by) = root.real.as_integer_ratio(), root.imag.as_integer_ratio()
        power = max(bx.bit_length(), by.bit_length()) - 1
        at = (x << (power - bx.bit_length() + 1), y << (power - by.bit_length() + 1))
        (u, v), (p, q) = _horner(coefficients, at, power), _horner(slope, at, power)
        size = (p * p + q * q) << power
        if not size:
            break
        step = complex(float(Fraction(u * p + v * q, size)), float(Fraction(v * p - u * q, size)))
        if abs(step) > 0.1 * abs(root):  # roots that lie together: the first estimate is as good
            break
        root -= step
        if abs(step) <= 1e-17 * abs(root):
            break
    return root


def _horner(coefficients: list[int], at: tuple[int, int], power: int) -> tuple[int, int]:
    """Polynomial at (re + i im) / 2^power, times 2^(power degree)."""
    re, im = 0, 0
    for k, each in enumerate(coefficients):
        re, im = re * at[0] - im * at[1] + (each << (power * k)), re * at[1] + im * at[0]
    return re, im
