"""From one input and output of a state space to its polynomials and their roots, in whole numbers.

A float is an integer over a power of two, so the method of Faddeev and LeVerrier gives the coefficients exactly, before
they are rounded once, whatever decades the poles span.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.lti import Complexes
from microrad.export.records import ExportError, Floats

MOST_STATES = 100
"""States of an entry beyond which its coefficients leave the range of a float."""
_VANISHING = 1e-13  # of the terms that a leading coefficient is the sum of: what rounding leaves of a zero
_POLISH = 5  # Newton steps; each doubles the digits of a simple root


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
    """Coefficients, each rounded once. Raises ExportError for one that no float holds."""
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
    found = [_polished(_integers(scaled), complex(r)) for r in np.roots(floats(scaled)) if r.imag >= 0.0]
    both = [r for each in found for r in ((each, each.conjugate()) if each.imag else (each,))]
    return np.asarray(np.array(both + [0j] * at_zero) * 2.0**binary, dtype=complex)


def _integers(coefficients: Sequence[Fraction]) -> list[int]:
    below = math.lcm(*(each.denominator for each in coefficients))
    return [int(each * below) for each in coefficients]


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
