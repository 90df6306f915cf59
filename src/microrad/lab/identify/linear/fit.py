"""Linear mirror model from recordings: frequency response, order, polish in frequency and in time, and its uncertainty.

`fit_linear` does it all. Several inputs and outputs share their poles. The continuous system it returns gives the
fitted samples exactly behind the hold that was named.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.lti import StateSpace
from microrad.core.progress import Progress
from microrad.core.units import plain
from microrad.lab.identify.linear.modal import Hold, ModalModel, simulate, simulate_periodic
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.polish import Polished, TimeEquations, polish
from microrad.lab.identify.linear.response import FrequencyResponse, response_from_periods, response_from_records
from microrad.lab.identify.linear.uncertainty import Uncertainty, parameter_covariance, uncertainty
from microrad.lab.identify.linear.vector_fitting import check_order
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.statistics import colour_inflation, rounded_to_error
from microrad.lab.recording import Recording

# Spare poles that are fitted to noise have at most 0.2 of the rms of the residual, those fitted to a tone 0.3 and more,
# and both decay in ten times the recording or more. A true resonance, however sharp, was fitted by at most twice.
_RINGS, _CYCLES, _TONE = 5.0, 3.0, 0.25
_STEADY = "most likely a steady tone that the drive has not made (mains, a wheel)"
_SPARE = "most likely noise, which a spare pole was fitted to"


@dataclass(frozen=True)
class OrderScore:
    """One order of the scan.

    `chi_square` is the squared distance of the response to the model over its variance; `freedom` the number of real
    values less that of parameters; `criterion` is chi_square + parameters ln(values), the Bayesian information
    criterion (G. Schwarz, Annals of Statistics 6 (1978) 461). `output_error_rms` is the rms output error that the
    distance stands for, in units of the output, over all outputs.
    """

    order: int
    parameters: int
    chi_square: float
    freedom: int
    criterion: float
    output_error_rms: float


@dataclass(frozen=True, eq=False)
class LinearFit(Uncertainty):
    """A linear model with its evidence, and with its poles, zeros and gains (see `Uncertainty`).

    `system` is continuous, real and block-diagonal; `modes` the same as poles and vectors. `fit_percent` (outputs,) is
    100 (1 - |y - yhat| / |y - mean y|) over the recordings, offsets removed: from rest, or in steady state where the
    recordings are periodic. `residual` (frequencies, outputs, inputs) is measured less modelled response. `scan` is
    empty where the order was given; `reason` says in words why this order. The delay of the recording chain belongs to
    `modes` and not to `system`.
    """

    system: StateSpace
    modes: ModalModel
    order: int
    hold: Hold
    rate_hz: float
    excited_hz: tuple[float, float]
    fit_percent: Floats
    residual_rms: Floats
    scan: tuple[OrderScore, ...]
    reason: str
    warnings: tuple[str, ...]
    response: FrequencyResponse
    residual: Complexes

    @property
    def delay_s(self) -> float:
        """Pure delay of the recording chain; 0 where it was not fitted."""
        return self.modes.delay_s


def fit_linear(
    records: Sequence[Recording],
    orders: int | Sequence[int] | None = None,
    *,
    strictly_proper: bool = False,
    drop: int = 0,
    exchanges: int = 12,
    on_progress: Progress | None = None,
) -> LinearFit:
    """Fit a stable continuous model with common poles to recordings of any number of inputs and outputs.

    Periodic recordings are fitted in frequency, where the error at the excited lines is the output error of the steady
    state; others first in frequency and then as output error in time, from rest.

    Args:
        records: Recordings of one rate, with the same channels.
        orders: A number of states, or several to compare; by default 1 to 8, or 4, 8, ... 28 with several channels.
        strictly_proper: Whether the direct term is left out.
        drop: First samples of each record that do not count in time.
        exchanges: Largest number of weak modes that are exchanged for better ones (several channels only, see `order`).
        on_progress: Called with the steps done, their number and what is done.

    Raises:
        IdentificationError: If no response can be had from the records (`response_from_records`,
            `response_from_periods`), or if an order is below 1 or beyond what the response can fix.
    """
    periodic = bool(records) and all(r.period_samples is not None for r in records)
    response = response_from_periods(records) if periodic else response_from_records(records)
    direct = not strictly_proper
    several = response.response[0].size > 1
    candidates = _candidates(response, orders)
    tried = candidates if several else range(1, candidates[-1] + 1)  # each sets out from the one before, too
    total, report = len(tried) + 2, on_progress or no_progress
    fits: dict[int, Polished] = {}
    for done, order in enumerate(tried, start=1):
        smaller = None if several or order == 1 else fits[order - 1].model
        if len(tried) > 1 or not several:
            fits[order] = fit_order(response, order, direct=direct, exchanges=0, fine=not several, smaller=smaller)
        report(done, total, f"order {order}")
    scan = [_score(response, fits[order], direct) for order in candidates] if len(candidates) > 1 else []
    chosen, reason = choose(scan) if scan else (candidates[0], f"order {candidates[0]} was given")
    polished = fit_order(response, chosen, direct=direct, exchanges=exchanges) if several else fits[chosen]
    report(total - 1, total, "polish in frequency")
    if not periodic:
        polished = polish(TimeEquations(records, response.hold, drop, direct=direct), polished.model, iterations=30)
    report(total, total, "polish in time")
    return _linear_fit(records, response, polished, scan, reason, drop, direct)


# ---------------------------------------------------------------------------------------------------------------- order
def given_orders(freq_hz: Floats, orders: int | Sequence[int]) -> list[int]:
    """The orders that were asked for, rising.

    Args:
        freq_hz: The frequencies to be fitted, shape (frequencies,).
        orders: A number of states, or several.

    Raises:
        IdentificationError: If none is given, or one is below 1 or beyond what so many frequencies can fix.
    """
    several = [orders] if isinstance(orders, int | float | np.number) else list(orders)
    if not several:
        raise IdentificationError("no order was given to choose from; name at least one number of states.")
    for order in (min(several), max(several), *several):
        check_order(freq_hz, order)
    return sorted({int(order) for order in several})


def _candidates(response: FrequencyResponse, orders: int | Sequence[int] | None) -> list[int]:
    if orders is not None:
        return given_orders(response.freq_hz, orders)
    most = response.freq_hz.size - 1
    usual = range(1, 9) if response.response[0].size == 1 else range(4, 29, 4)
    return [order for order in usual if order <= most] or [1]


def _score(response: FrequencyResponse, fit: Polished, direct: bool) -> OrderScore:
    model = fit.model
    error = response.response - model.response(response.freq_hz, response.hold, response.rate_hz)
    outputs, inputs = error.shape[1:]
    # The mean over the records of the output's variance at a line, recovered from the standard error of one element.
    inverse = np.linalg.inv(response.drive_power)[:, 0, 0].real
    variance = np.maximum(response.standard_error[:, :, 0] ** 2 / inverse[:, None], 1e-300)
    distance = np.einsum("foi,fij,foj->fo", error, response.drive_power, error.conj(), optimize=True).real
    # Each squared complex distance over its variance has the mean 1 per input: two real values of variance 1/2 each.
    chi_square = 2 * float(np.sum(distance / variance))
    parameters = model.order * (outputs + inputs) + outputs * inputs * direct
    values = 2 * error.size
    return OrderScore(
        model.order,
        parameters,
        chi_square,
        values - parameters,
        chi_square + parameters * math.log(values),
        math.sqrt(float(np.sum(distance)) / outputs),
    )


def choose(scan: Sequence[OrderScore]) -> tuple[int, str]:
    """The order of least criterion, and the reason in words.

    Args:
        scan: The orders that were compared, rising.
    """
    best = min(scan, key=lambda score: score.criterion)
    per = [f"{s.order}: {plain(s.chi_square / max(s.freedom, 1))}" for s in scan]
    reason = (
        f"order {best.order} has the least criterion, {plain(best.criterion, 4)} (chi-square + parameters x ln "
        f"values); squared distance over its variance, per degree of freedom, by order: {', '.join(per)} "
        "(1 is what a true model leaves)"
    )
    smaller = [s for s in scan if s.order < best.order]
    larger = [s for s in scan if s.order > best.order]
    if smaller:
        reason += f"; order {smaller[-1].order} is worse by {plain(smaller[-1].criterion - best.criterion)}"
    if larger:
        reason += (
            f"; order {larger[0].order} gains {max(best.chi_square - larger[0].chi_square, 0.0):.1f} in chi-square for "
        )
        reason += f"{larger[0].parameters - best.parameters} parameters more, which is worth less than it costs"
    else:
        reason += "; a larger order was not tried"
    return best.order, reason


# --------------------------------------------------------------------------------------------------------------- result
def output_error(
    modes: ModalModel, record: Recording, hold: Hold = "zero-order", *, steady: bool = False, drop: int = 0
) -> Floats:
    """Measured less modelled output (samples, outputs) of a record, without its mean.

    Args:
        modes: The model.
        record: The record, from rest at its first drive value.
        hold: What stands between the samples of the drive.
        steady: Whether each period (`period_samples`) is in the steady state of its own drive instead.
        drop: First samples that are left out.
    """
    modelled = _modelled(modes, record, hold, steady)
    error = (record.output[: len(modelled)] - modelled)[drop:]
    return np.asarray(error - error.mean(axis=0))


def _modelled(modes: ModalModel, record: Recording, hold: Hold, steady: bool) -> Floats:
    """What the model makes of the drive of a record; with `steady`, of its whole periods alone."""
    if not steady:
        return simulate(modes, record.drive - record.drive[:1], record.rate_hz, hold)
    period = record.period_samples or record.samples
    begins = range(0, record.samples - period + 1, period)
    parts = [simulate_periodic(modes, record.drive[k : k + period], record.rate_hz, hold) for k in begins]
    return np.concatenate(parts)


def fit_percent(measured: Floats, error: Floats) -> Floats:
    """100 (1 - |y - yhat| / |y - mean y|) of each output, shape (outputs,).

    Args:
        measured: Y, shape (samples, outputs).
        error: Y - yhat, of the same shape.
    """
    spread = np.linalg.norm(measured - measured.mean(axis=0), axis=0)
    return np.asarray(100.0 * (1.0 - np.linalg.norm(error, axis=0) / spread))


def _linear_fit(
    records: Sequence[Recording],
    response: FrequencyResponse,
    polished: Polished,
    scan: Sequence[OrderScore],
    reason: str,
    drop: int,
    direct: bool,
) -> LinearFit:
    model = polished.model
    steady = all(r.period_samples is not None for r in records)
    errors = [output_error(model, r, response.hold, steady=steady, drop=drop) for r in records]
    inflation = colour_inflation([column for error in errors for column in error.T])
    edge = {"edge_hz": response.excited_hz[0], "below_rad_s": np.pi * response.rate_hz}
    known = uncertainty(model, parameter_covariance(polished) * inflation, direct, **edge)
    residual = response.response - model.response(response.freq_hz, response.hold, response.rate_hz)
    return with_evidence(model, records, errors, response, residual, known, scan, reason)


def with_evidence(
    model: ModalModel,
    records: Sequence[Recording],
    errors: Sequence[Floats],
    response: FrequencyResponse,
    residual: Complexes,
    known: Uncertainty,
    scan: Sequence[OrderScore],
    reason: str,
) -> LinearFit:
    """A linear model with how well it follows its records, and with what speaks against its poles, zeros and gains.

    Args:
        model: The model.
        records: The recordings that it was fitted to.
        errors: Of each of them measured less modelled output, without its mean, shape (samples, outputs).
        response: The response that it was fitted to.
        residual: What it leaves of that, of the same shape.
        known: Its poles, zeros and gains with their errors.
        scan: The orders that were compared.
        reason: Why it is this order.
    """
    error = np.concatenate(errors)
    measured = [r.output[-len(e) :] - r.output[-len(e) :].mean(axis=0) for r, e in zip(records, errors, strict=True)]
    rms = np.sqrt(np.mean(error**2, axis=0))
    return LinearFit(
        system=model.state_space(),
        modes=model,
        order=model.order,
        hold=response.hold,
        rate_hz=response.rate_hz,
        excited_hz=response.excited_hz,
        fit_percent=fit_percent(np.concatenate(measured), error),
        residual_rms=rms,
        scan=tuple(scan),
        reason=reason,
        **vars(known),
        warnings=(*_tones(model, records, rms, response.hold), *range_warnings(known, response.excited_hz)),
        response=response,
        residual=residual,
    )


def _tones(model: ModalModel, records: Sequence[Recording], residual_rms: Floats, hold: Hold) -> list[str]:
    """Modes that ring for much longer than the recording lasts: it holds a steady tone, or a pole was to spare."""
    longest_s, found = max(r.samples / r.rate_hz for r in records), []
    for k, pole in enumerate(model.poles_rad_s):
        hz, decay_s = abs(pole) / (2 * np.pi), -1.0 / pole.real
        if decay_s > _RINGS * longest_s and hz * longest_s > _CYCLES:
            tone = _mode_share(model, k, records, hold, residual_rms) > _TONE
            found.append(
                f"pole at {hz:.4g} Hz rings for {plain(decay_s)} s, the recording lasts {plain(longest_s)} s and "
                f"cannot show that: {_STEADY if tone else _SPARE}; do not design a controller for it."
            )
    return found


def _mode_share(model: ModalModel, k: int, records: Sequence[Recording], hold: Hold, residual_rms: Floats) -> float:
    """Largest rms output of a mode by itself, in that of the residual of the whole model."""
    alone = ModalModel(
        model.poles_rad_s[k : k + 1],
        model.input_vectors[k : k + 1],
        model.output_vectors[:, k : k + 1],
        np.zeros_like(model.direct),
    )
    steady = all(r.period_samples is not None for r in records)
    own = np.concatenate([_modelled(alone, r, hold, steady) for r in records])
    return float(np.max(own.std(axis=0) / residual_rms))


def range_warnings(
    known: Uncertainty, band_hz: tuple[float, float], *, of: str = "recording", what: str = "excited"
) -> tuple[str, ...]:
    """What lies beyond the frequencies that were measured, in words.

    Args:
        known: Poles, zeros and gains.
        band_hz: Lowest and highest frequency, in Hz.
        of: What shows them, in a word.
        what: What they are, in a word.
    """
    low, high = band_hz
    dynamics = "dynamics of the mirror" if of == "recording" else "dynamics"
    found = []
    for name, values in (("pole", known.poles_rad_s), ("zero", known.zeros_rad_s)):
        freq = np.abs(values) / (2 * np.pi)
        outside = sorted({float(f"{f:.3g}") for f in freq[(freq < low) | (freq > high)]})
        if outside:
            many, them = ("s", "them") if len(outside) > 1 else ("", "it")
            found.append(
                f"{name}{many} at {', '.join(f'{f:g}' for f in outside)} Hz outside the {what} band, {low:.3g} to "
                f"{high:.4g} Hz: the {of} shows only the flank, so take {them} as a fit of that flank (drift, "
                f"delay), not as {dynamics}."
            )
    q, i = np.unravel_index(int(np.argmax(np.abs(known.edge_gain))), known.edge_gain.shape)
    dc, dc_error = float(known.dc_gain[q, i]), float(known.dc_gain_error[q, i])
    edge, edge_error = float(known.edge_gain[q, i]), float(known.edge_gain_error[q, i])
    if abs(abs(dc) / edge - 1) > 0.05:
        extrapolated = f"{rounded_to_error(dc, dc_error)} ± {dc_error:.2g}"
        seen = f"{rounded_to_error(edge, edge_error)} ± {edge_error:.2g}"
        found.append(
            f"the gain at zero frequency, {extrapolated}, is extrapolated: at {low:.3g} Hz, the lowest {what} "
            f"frequency, it is {seen}; use the latter."
        )
    return tuple(found)
