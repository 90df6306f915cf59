"""The continuous model behind a sampled one: the inverse of the zero-order hold.

A drive that is held over each sample makes of [[A, B], [0, 0]] its exponential over a sample, [[Ad, Bd], [0, 1]]; the
inverse is the logarithm of that. With distinct poles it goes pole by pole: p = exp(s T), and the residue r at p is that
at s times (p - 1) / s.
"""

import math

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.core.units import counted
from microrad.export.linear_import.roots import COINCIDING, Roots, response
from microrad.export.matrices.forms import polynomials, roots
from microrad.export.matrices.structure import pole_text
from microrad.export.records import ExportError

AGREEMENT = 1e-9
"""Largest relative difference of the model's response, held and sampled again, from the given one."""

_ON_THE_AXIS = 1e-6  # imaginary part over size of a pole that rounding may have taken off the negative real axis
_POINTS = 200


def without_hold(of: Roots, source: str) -> Roots:
    """The continuous model that gives a sampled one when its drive is held over each sample.

    Its poles are taken at frequencies below half of the rate. It has the fewest zeros with which it gives the sampled
    model: what rounding leaves of a leading coefficient would be a zero far away.

    Args:
        of: Zeros, poles (plain numbers of the z plane) and gain of the sampled model, with its sample time.
        source: What messages call it.

    Raises:
        ExportError: Where there is no such model, or its numbers do not give it.
    """
    _refuse_without_inverse(of, source)
    poles = np.asarray(np.log1p(of.poles - 1.0) / of.period_s, dtype=complex)
    residues = np.asarray(_residues(of) * poles / (of.poles - 1.0))
    numerator, _ = polynomials(lti.modal_from_residues(poles, residues))
    for first in reversed(range(len(numerator))):
        if numerator[first] != 0:
            found = Roots(roots(numerator[first:]), poles, float(numerator[first]))
            if _difference(found, of) <= AGREEMENT:
                return found
    raise ExportError(
        f"{source}: held and sampled at Ts = {of.period_s:g} s again, no continuous model gives it within "
        f"{AGREEMENT:g}: poles that nearly coincide at this rate; convert it where it was made (d2c in MATLAB), or "
        "sample it more slowly"
    )


def _refuse_without_inverse(of: Roots, source: str) -> None:
    if of.zeros.size >= of.poles.size:
        raise ExportError(
            f"{source}: {counted(of.zeros.size, 'zero')} over {counted(of.poles.size, 'pole')}, its output follows the "
            "drive within a sample, and that of a mirror behind a hold does not (D = 0); read the output ahead of the "
            "drive"
        )
    for number, pole in enumerate(of.poles):
        place = pole_text(pole, of.period_s)
        if pole == 0.0:
            raise ExportError(
                f"{source}: a pole at 0, a delay of a whole sample, which no continuous model of finite order has; "
                "take the delay off the model, and count it in fine_pointing.delay"
            )
        if pole.real < 0.0 and abs(pole.imag) <= _ON_THE_AXIS * abs(pole):
            raise ExportError(
                f"{source}: a pole on the negative real axis, {place}, turns its sign each sample, and no continuous "
                "mode does so alone; reduce the model, or identify it at a higher rate"
            )
        if pole == 1.0 or abs(pole) > 1.0:
            raise ExportError(
                f"{source}: {'an integrator' if pole == 1.0 else 'unstable'}, a pole at {place}; a mirror comes to "
                "rest: identify it again"
            )
        if np.any(np.abs(np.delete(of.poles, number) - pole) <= COINCIDING * abs(pole)):
            raise ExportError(f"{source}: two poles coincide, {place}; set them apart, or reduce the model")


def _residues(of: Roots) -> Complexes:
    """Residue at each pole, in the order of the poles."""
    others = [np.delete(of.poles, number) for number in range(of.poles.size)]
    return np.array([of.gain * np.prod(p - of.zeros) / np.prod(p - q) for p, q in zip(of.poles, others, strict=True)])


def _difference(found: Roots, of: Roots) -> float:
    """Largest relative difference of a continuous model, held and sampled, from the sampled one up to half its rate."""
    with np.errstate(all="ignore"):
        held = np.exp(found.poles * of.period_s)
        residues = _residues(found) * np.expm1(found.poles * of.period_s) / found.poles
        freq: Floats = np.geomspace(1e-5, 0.499, _POINTS) / of.period_s
        z = np.exp(2j * math.pi * freq * of.period_s)
        again = np.sum(residues / (z[:, None] - held), axis=1)
        worst = np.max(np.abs(again / response(of, freq) - 1.0))
    return float(np.nan_to_num(worst, nan=math.inf))
