"""Linear models with names, units and origin; their zero-pole-gain and coefficient forms, entry by entry."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

import numpy as np

from microrad.core import lti
from microrad.core.lti import Complexes
from microrad.export.matrices.polynomials import floats, polynomials, roots
from microrad.export.matrices.structure import entry_of, refuse_hidden, refuse_unstable
from microrad.export.records import ExportError, Floats, Origin

_PROBES = 300


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


_Form = TypeVar("_Form")


def _of_entries(
    model: LinearModel, make: Callable[[lti.StateSpace, list[Fraction], list[Fraction], float], _Form]
) -> tuple[tuple[_Form, ...], ...]:
    rows = []
    for output in range(len(model.outputs)):
        row = [entry_of(model.system, output, number) for number in range(len(model.inputs))]
        rows.append(tuple(make(entry, *polynomials(entry), model.period_s) for entry in row))
    return tuple(rows)


def factors(numerator: list[Fraction], denominator: list[Fraction]) -> tuple[Complexes, Complexes, float]:
    """Zeros, poles and gain of the `polynomials` of an entry; no zeros and no poles where the numerator is 0."""
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
    """gain x product of (s - zero) / (s - pole) at each s, in an order that stays within the range of a float."""
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
