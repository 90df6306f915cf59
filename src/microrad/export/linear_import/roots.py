"""A linear system of one input and one output as zeros, poles and gain, from the forms that tools save; its checks."""

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.core.units import counted
from microrad.export.linear_import.matlab import form_of, numbers
from microrad.export.matrices.files import python_control
from microrad.export.matrices.forms import factored, factors, polynomials, roots
from microrad.export.matrices.structure import entry_of, pole_text, refuse_hidden
from microrad.export.records import ExportError

MOST_ORDER = 60
"""States of a mirror's linear part beyond which it is taken for a mistake."""
CANCELLING = 1e-8
"""Distance of a zero from a pole, over the pole's size, below which they cancel."""
COINCIDING = 1e-9
"""The same between two poles: without this distance there is no modal form."""
_INTEGRATOR = 1e-12  # of the largest pole
_CONJUGATE = 1e-9


@dataclass(frozen=True, slots=True)
class Roots:
    """gain x product of (s - zero) over product of (s - pole); pairs of conjugates to the last bit.

    s is in rad/s, or z of a model that is sampled at ``period_s`` above 0.
    """

    zeros: Complexes
    poles: Complexes
    gain: float
    period_s: float = 0.0


def response(of: Roots, freq_hz: Floats) -> Complexes:
    """The frequency response of zeros, poles and gain, complex, of the frequencies' shape.

    Args:
        of: The system.
        freq_hz: Frequencies in Hz, any shape.
    """
    s = np.asarray(2j * np.pi * freq_hz, dtype=complex)
    return factored(of.zeros, of.poles, of.gain, np.exp(s * of.period_s) if of.period_s else s)


# --------------------------------------------------------------------------------------------------------------- forms
def roots_of_fields(fields: dict[str, Any], source: str) -> Roots:
    """Zeros, poles and gain from a MATLAB file's fields.

    Args:
        fields: The system's fields by name: A B C D, z p k or num den, and Ts where it is given.
        source: What messages call the system.

    Raises:
        ExportError: For what is not one system of one input (in V where its unit is named) and one output.
    """
    stated = fields.get("InputUnit")  # an export of microrad names its input's unit: a mirror takes volts
    unit = stated.item() if isinstance(stated, np.ndarray) and stated.size == 1 else stated
    if isinstance(unit, str) and unit not in ("V", ""):
        raise ExportError(
            f"{source}: its input is in {unit}, and a mirror's drive is in V; choose the one from drive to angle"
        )
    period_s = 0.0
    if "Ts" in fields:
        value = numbers(fields, "Ts", source)
        period_s = _period(float(value.item()) if value.size == 1 else math.nan, source)
    return replace(_of_form(fields, form_of(fields), period_s, source), period_s=period_s)


def _of_form(fields: dict[str, Any], form: tuple[str, ...], period_s: float, source: str) -> Roots:
    if form[0] == "A":
        return roots_of_states(lti.StateSpace(*(numbers(fields, key, source) for key in form)), period_s, source)
    if form[0] == "num":
        num, den = (_row(numbers(fields, key, source), key, source) for key in form)
        return roots_of_coefficients(num, den, source)
    gain = numbers(fields, "k", source)
    if gain.size != 1:
        raise ExportError(f"{source}: k has {gain.size} gains; choose one input and one output")
    zeros, poles = (_row(numbers(fields, key, source, is_complex=True), key, source) for key in "zp")
    return Roots(paired(zeros, "z", source), paired(poles, "p", source), float(gain.item()))


def _period(period_s: float, source: str) -> float:
    if not 0.0 <= period_s < math.inf:
        raise ExportError(
            f"{source}: sampled, Ts = {period_s:g} s, which is no time; give the sample time in s, or Ts = 0 if it is "
            "continuous"
        )
    return period_s


def _row(values: Any, key: str, source: str) -> Any:
    if min(values.shape, default=0) > 1:
        raise ExportError(
            f"{source}: {key} has shape {values.shape}, not a row or a column; choose one input and one output"
        )
    return values.reshape(-1)


def roots_of_states(system: lti.StateSpace, period_s: float, source: str) -> Roots:
    """Zeros, poles and gain of a state space of one input and one output.

    Args:
        system: The state space, time in s; its shapes are checked here.
        period_s: Its sample time in s; 0 where it is continuous.
        source: What messages call it.

    Raises:
        ExportError: For shapes that do not fit, for several inputs or outputs, for too many states, and for hidden
            modes.
    """
    n = system.A.shape[0]
    inputs, outputs = system.B.shape[1], system.C.shape[0]
    shapes = {"A": (n, n), "B": (n, inputs), "C": (outputs, n), "D": (outputs, inputs)}
    for key, wanted in shapes.items():
        if getattr(system, key).shape != wanted:
            raise ExportError(f"{source}: {key} has shape {getattr(system, key).shape}, where {wanted} fits the others")
    if (inputs, outputs) != (1, 1):
        found = f"{counted(inputs, 'input')} and {counted(outputs, 'output')}"
        raise ExportError(f"{source}: {found}; a mirror file has one drive and one angle: choose")
    if n > MOST_ORDER:
        raise ExportError(f"{source}: {n} states, and a mirror has at most {MOST_ORDER}; reduce the model (balred)")
    refuse_hidden(system, period_s, source)
    zeros, poles, gain = factors(*polynomials(entry_of(system, 0, 0)))
    return Roots(paired(zeros, "zeros", source), paired(poles, "poles", source), gain)


def roots_of_coefficients(numerator: Floats, denominator: Floats, source: str) -> Roots:
    """Zeros, poles and gain of a quotient of polynomials in s (rad/s) or z.

    Args:
        numerator: Its coefficients, highest power first, shape (coefficients,).
        denominator: Those of the denominator, likewise.
        source: What messages call the system.

    Raises:
        ExportError: Where one of the two is zero, and for too high an order.
    """
    num, den = (np.trim_zeros(each, "f") for each in (numerator, denominator))
    if not den.size:
        raise ExportError(f"{source}: the denominator is zero; save one with a coefficient other than 0")
    if not num.size:
        raise ExportError(f"{source}: the numerator is zero, so the mirror does not move; check the model")
    if den.size - 1 > MOST_ORDER:
        raise ExportError(
            f"{source}: order {den.size - 1}, and a mirror has at most {MOST_ORDER}; reduce the model (balred)"
        )
    zeros, poles = (roots([Fraction(float(each)) for each in coefficients]) for coefficients in (num, den))
    return Roots(zeros, poles, float(num[0] / den[0]))


def roots_of_control(system: Any, source: str) -> Roots:
    """Zeros, poles and gain of an object of python-control.

    Args:
        system: A `control.StateSpace` or a `control.TransferFunction`.
        source: What messages call it.

    Raises:
        ExportError: For other objects, several inputs or outputs, a sample time that is not known, and where
            python-control is not installed.
    """
    library = python_control()
    if not isinstance(system, library.StateSpace | library.TransferFunction):
        raise ExportError(
            f"{source}: a {type(system).__name__}; give a control.StateSpace or a control.TransferFunction"
        )
    if system.dt is None or system.dt is True:
        raise ExportError(
            f"{system.name} has dt = {system.dt}: continuous, or sampled how fast? Give it dt = 0 or its period in s"
        )
    if (system.ninputs, system.noutputs) != (1, 1):
        found = f"{counted(system.ninputs, 'input')} and {counted(system.noutputs, 'output')}"
        raise ExportError(f"{source}: {found}; a mirror file has one drive and one angle: choose")
    if isinstance(system, library.StateSpace):
        arrays = {key: getattr(system, key) for key in "ABCD"}
    else:
        arrays = {"num": system.num_array[0, 0], "den": system.den_array[0, 0]}
    arrays["Ts"] = float(system.dt)
    return roots_of_fields({key: np.atleast_2d(np.asarray(value)) for key, value in arrays.items()}, source)


# -------------------------------------------------------------------------------------------------------------- checks
def paired(found: Complexes, key: str, source: str) -> Complexes:
    """Real roots as they are, and complex ones in pairs of conjugates that agree to the last bit.

    Args:
        found: The roots, shape (roots,).
        key: What messages call the roots.
        source: What messages call the system.

    Raises:
        ExportError: For a complex root without its conjugate.
    """
    real = np.abs(found.imag) <= 1e-14 * np.abs(found)
    upper, lower = (list(found[~real & (sign * found.imag > 0.0)]) for sign in (1.0, -1.0))
    both = [complex(r.real) for r in found[real]]
    for root in upper:
        nearest = min(lower, key=lambda r: abs(r - root.conjugate()), default=None)
        if nearest is None or abs(nearest - root.conjugate()) > _CONJUGATE * abs(root):
            lower.insert(0, root)
            break
        lower.remove(nearest)
        both += [complex(root), complex(root.conjugate())]
    if lower:
        raise ExportError(
            f"{source}: {key} has the complex root {lower[0]:.6g} without its conjugate; a mirror's response is real: "
            "give both"
        )
    return np.array(both, dtype=complex)


def checked(of: Roots, source: str) -> Roots:
    """The same zeros, poles and gain, where a mirror file can say them.

    Args:
        of: The system.
        source: What messages call it.

    Raises:
        ExportError: For a system that is not strictly proper, unstable, not minimal or without a gain at 0 Hz; for
            integrators and for poles that coincide.
    """
    if of.zeros.size >= of.poles.size:
        raise ExportError(
            f"{source}: {counted(of.zeros.size, 'zero')} over {counted(of.poles.size, 'pole')}, not strictly proper; a "
            "mirror does not follow a jump at once: add the pole that ends its band"
        )
    if not (math.isfinite(of.gain) and of.gain != 0.0):
        raise ExportError(f"{source}: a gain of {of.gain}; the mirror does not move: check the model")
    for pole in of.poles:
        if abs(pole) <= _INTEGRATOR * float(np.max(np.abs(of.poles))):
            raise ExportError(
                f"{source}: an integrator, a pole at {abs(pole) / (2.0 * math.pi):.3g} Hz; a mirror comes to rest: "
                "take drift off the records and identify again"
            )
        if pole.real >= 0.0:
            raise ExportError(
                f"{source}: unstable, a pole at {pole_text(pole, 0.0)}; a mirror is stable: identify it again"
            )
    for number, pole in enumerate(of.poles):
        if np.any(np.abs(np.delete(of.poles, number) - pole) <= COINCIDING * abs(pole)):
            raise ExportError(
                f"{source}: two poles coincide at {pole_text(pole, 0.0)}; a mirror file has no modal form for them: "
                "set them apart, or reduce the model"
            )
        if np.any(np.abs(of.zeros - pole) <= CANCELLING * abs(pole)):
            raise ExportError(
                f"{source}: not minimal, a zero cancels the pole at {pole_text(pole, 0.0)}; remove both (minreal)"
            )
    if np.any(of.zeros == 0.0):
        raise ExportError(
            f"{source}: a zero at 0 Hz: the mirror does not hold an angle; a mirror file has zeros above 0 Hz, so give "
            "the model with its answer to a constant drive"
        )
    return of
