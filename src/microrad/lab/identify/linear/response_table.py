"""A table of a frequency response as its reader gave it, checked: each fault with what, where and what to do."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Complexes, Floats, reals
from microrad.core.units import LEAST, MOST
from microrad.lab.identify.linear.elements import ElementEquations
from microrad.lab.identify.linear.modal import Hold
from microrad.lab.identify.records import IdentificationError


class ResponseTable(NamedTuple):
    """A checked table."""

    freq_hz: Floats
    response: Complexes
    standard_error: Floats | None
    hold: Hold
    rate_hz: float | None
    direct: bool

    def equations(self, delay_s: float = 0.0) -> ElementEquations:
        """Equations with a variance of 1 in each row where the standard errors are known, of one weight otherwise."""
        turned = self.response
        if delay_s:
            turned = turned * np.exp(2j * np.pi * self.freq_hz * delay_s)[:, None, None]
        known = self.standard_error
        weight = np.ones(turned.shape) if known is None else np.sqrt(2.0) / known
        return ElementEquations(self.freq_hz, turned, weight, self.hold, self.rate_hz, direct=self.direct)

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest frequency above zero, and the highest one."""
        return band_hz(self.freq_hz)

    def parameters(self, order: int, delay: bool) -> int:
        """Free numbers of a model.

        Args:
            order: Number of states.
            delay: Whether it has a delay.
        """
        outputs, inputs = _shape(self.response)
        return order * (outputs + inputs) + outputs * inputs * self.direct + delay

    @property
    def most(self) -> int:
        """Largest order that so many values can fix with one value to spare; 1 at least."""
        orders = range(1, self.freq_hz.size)
        return max((n for n in orders if self.parameters(n, True) < 2 * self.response.size), default=1)


def band_hz(freq_hz: Floats) -> tuple[float, float]:
    """Lowest frequency above zero, and the highest one.

    Args:
        freq_hz: Frequencies, in Hz, rising, shape (frequencies,).
    """
    return float(freq_hz[freq_hz > 0][0]), float(freq_hz[-1])


def checked(
    freq_hz: ArrayLike, response: ArrayLike, standard_error: ArrayLike | None, form: tuple[Hold, float | None, bool]
) -> ResponseTable:
    """The table as arrays of (frequencies,) and (frequencies, outputs, inputs).

    Args:
        freq_hz: Frequencies, in Hz.
        response: Complex response, shape (frequencies,) or (frequencies, outputs, inputs).
        standard_error: One sigma of it, of that shape or (frequencies,); None where it is not known.
        form: What stands between the samples of the input; the sample rate; whether the direct term is left out.

    Raises:
        IdentificationError: For whatever `fit_frequency_response` refuses of a table.
    """
    freq = reals(freq_hz, "the frequencies", IdentificationError)
    values = _complexes(response)
    if freq.ndim != 1 or freq.size == 0:
        raise IdentificationError(
            f"the frequencies have the shape {freq.shape}; give one list of frequencies, shape (frequencies,)."
        )
    if values.ndim not in (1, 3) or 0 in values.shape:
        raise IdentificationError(
            f"the response has the shape {values.shape}; give (frequencies,) for one element, or (frequencies, "
            "outputs, inputs)."
        )
    _check_length(freq, values, "the response")
    _check_frequencies(freq, form[1])
    _check_finite(freq, values, "the response")
    if not values.any():
        raise IdentificationError("the response is 0 at all frequencies, so there is nothing to fit; see its columns.")
    error = None
    if standard_error is not None:
        error = _checked_error(freq, values, reals(standard_error, "the standard errors", IdentificationError)).reshape(
            freq.size, *_shape(values)
        )
    hold, rate_hz, strictly_proper = form
    if hold not in ("zero-order", "first-order", "band-limited"):
        raise IdentificationError(f"hold '{hold}' is not known; use zero-order, first-order or band-limited.")
    if hold != "band-limited" and rate_hz is None:
        raise IdentificationError(f"a {hold} hold needs the sample rate; give rate_hz.")
    return ResponseTable(freq, values.reshape(freq.size, *_shape(values)), error, hold, rate_hz, not strictly_proper)


def _complexes(response: ArrayLike) -> Complexes:
    try:
        values = np.asarray(response, dtype=complex)
    except (OverflowError, TypeError, ValueError):
        raise IdentificationError("the response is no array of complex numbers; give one for each frequency.") from None
    size = np.abs(values[np.isfinite(values)])
    if np.any((size > MOST) | ((size < LEAST) & (size > 0.0))):
        raise IdentificationError(
            f"the response has a magnitude below {LEAST:g} or above {MOST:g}, and none has that in SI units; check its "
            "unit."
        )
    return values


def _shape(values: Complexes) -> tuple[int, int]:
    return (int(values.shape[1]), int(values.shape[2])) if values.ndim == 3 else (1, 1)


def _check_length(freq: Floats, values: Complexes | Floats, what: str) -> None:
    if len(values) != freq.size:
        raise IdentificationError(
            f"{what} has {len(values)} rows and there are {freq.size} frequencies; give one row for each frequency."
        )


def _check_finite(freq: Floats, values: Complexes | Floats, what: str) -> None:
    bad = ~np.isfinite(values).reshape(freq.size, -1).all(axis=1)
    if bad.any():
        raise IdentificationError(
            f"{what} at {freq[int(np.argmax(bad))]:g} Hz is not finite; leave that frequency out."
        )


def _check_frequencies(freq: Floats, rate_hz: float | None) -> None:
    if not np.isfinite(freq).all():
        at = int(np.argmin(np.isfinite(freq)))
        raise IdentificationError(f"frequency {at + 1} is {freq[at]}, which is not finite; leave it out.")
    if freq.min() < 0:
        at = int(np.argmax(freq < 0))
        raise IdentificationError(
            f"frequency {at + 1} is {freq[at]:g} Hz, below 0; leave it out, positive ones say all."
        )
    if ((freq > 0) & (freq < LEAST)).any():
        at = int(np.argmax((freq > 0) & (freq < LEAST)))
        raise IdentificationError(
            f"frequency {at + 1} is {freq[at]:g} Hz, below {LEAST:g}; check the unit of the column."
        )
    if (np.diff(freq) <= 0).any():
        at = int(np.argmax(np.diff(freq) <= 0))
        raise IdentificationError(
            f"frequency {at + 2}, {freq[at + 1]:g} Hz, does not lie above the one before it, {freq[at]:g} Hz; sort the "
            "table by frequency and leave repeated ones out."
        )
    if freq[-1] <= 0:
        raise IdentificationError("the only frequency is 0 Hz; give frequencies above it.")
    if rate_hz is None:
        return
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise IdentificationError(f"the sample rate is {rate_hz:g} Hz; give a rate above 0.")
    if freq[-1] >= rate_hz / 2:
        raise IdentificationError(
            f"the table reaches {freq[-1]:g} Hz, half the sample rate of {rate_hz:g} Hz or more; leave that out."
        )


def _checked_error(freq: Floats, values: Complexes, error: Floats) -> Floats:
    """The standard errors in the shape of the response."""
    if error.ndim == 0:
        error = np.full(freq.shape, float(error))
    if error.shape not in (values.shape, freq.shape):
        raise IdentificationError(
            f"the standard errors have the shape {error.shape}, the response {values.shape}; give that shape, or one "
            f"for each frequency, {freq.shape}, or one for all."
        )
    _check_finite(freq, error, "the standard error")
    bad = (error < LEAST).reshape(freq.size, -1)
    if bad.any():
        at = int(np.argmax(bad.any(axis=1)))
        raise IdentificationError(
            f"the standard error at {freq[at]:g} Hz is {error[at].min():g}; each must be above 0: leave out what was "
            "not measured, or give a large error."
        )
    return np.asarray(np.broadcast_to(error if error.ndim == values.ndim else error[:, None, None], values.shape))


def check_numbers(table: ResponseTable, order: int, delay: bool) -> None:
    """Check that a model has fewer free numbers than the table has values.

    Args:
        table: The table.
        order: Number of states.
        delay: Whether the model has a delay.

    Raises:
        IdentificationError: If it has as many, or more.
    """
    numbers = table.parameters(order, delay)
    if numbers >= 2 * table.response.size:
        raise IdentificationError(
            f"a model of order {order} has {numbers} numbers, and {table.freq_hz.size} frequencies give "
            f"{2 * table.response.size} real values; give more frequencies or a lower order."
        )
