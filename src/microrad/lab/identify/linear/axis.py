"""The linear part of one axis from its broadband recordings: no pole more than they need, the delay apart from them."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import plain
from microrad.lab.identify.linear.fit import (
    LinearFit,
    OrderScore,
    output_error,
    with_evidence,
)
from microrad.lab.identify.linear.modal import HOLD, Hold, ModalModel, simulate, simulate_periodic
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.pole_zero import (
    UNSEEN,
    Fitted,
    PoleZeroProblem,
    merged,
    modes_of,
    pruned,
    root_values,
)
from microrad.lab.identify.linear.response import (
    BANDS,
    FrequencyResponse,
    response_from_periods,
    response_from_records,
)
from microrad.lab.identify.linear.uncertainty import Uncertainty, transmission_zeros
from microrad.lab.identify.records import no_progress
from microrad.lab.identify.statistics import central_differences
from microrad.lab.recording import Recording

_ORDERS = 8
_PATIENCE = 3  # orders in a row that gain nothing, behind which the scan ends: a pair takes two
_BANDS = 500  # a resonance narrower than a band is smeared
_FIRST_LAG_S, _LAGS_PER_DECADE = 1e-2, 2
_STARTS = (1, 2, 3)


def fit_axis(records: Sequence[Recording], *, hold: Hold = HOLD, on_progress: Progress | None = None) -> LinearFit:
    """Fit poles, zeros and the delay of the recording chain to recordings of one drive and one output.

    The number of poles is that of the least criterion among models of order 1 to 8, from which everything was taken
    away that costs more than it explains, see `pole_zero`. Creep and the loss of hysteresis are fitted along and belong
    to no pole.

    Args:
        records: Broadband recordings of one rate, all periodic or none.
        hold: What the drive does between samples: "zero-order" where the record is what a converter was told,
            "first-order" where the drive itself was measured.
        on_progress: Called with the steps done, their number and what is done.

    Raises:
        IdentificationError: If no response can be had from the records.
    """
    periodic = bool(records) and all(r.period_samples is not None for r in records)
    response = response_from_periods(records) if periodic else response_from_records(records)
    fine = response if periodic else response_from_records(records, bands=_BANDS)
    response, fine = replace(response, hold=hold), replace(fine, hold=hold)
    report = on_progress or no_progress
    length_s = (records[0].period_samples or records[0].samples) * records[0].step_s
    problem = PoleZeroProblem(fine, _lags(fine), length_s)
    fits = _scan(problem, response, report)
    best = min(fits, key=lambda fit: fit.criterion)
    if not periodic:
        problem = PoleZeroProblem(_unbiased(records, fine, best), problem.lags_s, length_s)
        fits = [problem.fitted(fit.at) for fit in fits]
    problem = problem.worth_less(min(fits, key=lambda fit: fit.chi_square).at)
    fits = [problem.fitted(fit.at) for fit in fits]
    final = pruned(min(fits, key=lambda fit: fit.criterion))
    report(_ORDERS + 1, _ORDERS + 2, "poles that are not needed")
    found = _linear_fit(records, response, final, fits)
    report(_ORDERS + 2, _ORDERS + 2, "errors of poles and zeros")
    return found


def _lags(response: FrequencyResponse) -> tuple[float, ...]:
    """Time constants of creep that the band shows: from 10 ms, two a decade, to ten radians of its lowest frequency.

    Slower ones all look alike there.
    """
    slowest = 10.0 / (2 * math.pi * response.excited_hz[0])
    count = 1 + math.floor(_LAGS_PER_DECADE * math.log10(slowest / _FIRST_LAG_S)) if slowest >= _FIRST_LAG_S else 0
    return tuple(_FIRST_LAG_S * 10.0 ** (k / _LAGS_PER_DECADE) for k in range(count))


def _scan(problem: PoleZeroProblem, response: FrequencyResponse, report: Progress) -> list[Fitted]:
    """Fits of order 1, 2, ... to the response, freed of the delay, creep and loss that a small model shows."""
    response = _thin(response)
    most = min(_ORDERS, response.freq_hz.size - 1)

    def fitted(model: ModalModel, delay_s: float) -> Fitted:
        zeros = transmission_zeros(model, 2 * np.pi * response.rate_hz)
        return problem.fitted(problem.started(model.all_poles_rad_s.tolist(), zeros.tolist(), delay_s))

    small = [fitted(fit_order(response, n, direct=False, exchanges=0).model, 0.0) for n in _STARTS if n <= most]
    first = min(small, key=lambda fit: fit.criterion)
    freed = replace(response, response=_freed(first, response))
    fits: list[Fitted] = []
    smaller: ModalModel | None = None
    for order in range(1, most + 1):
        smaller = fit_order(freed, order, direct=False, exchanges=0, smaller=smaller).model
        fits.append(fitted(smaller, first.at.delay_s))
        report(order, _ORDERS + 2, f"order {order}")
        scatter = max(1.0, min(fit.chi_square / fit.freedom for fit in fits))
        prices = [fit.chi_square / scatter + fit.criterion - fit.chi_square for fit in fits]
        if order - int(np.argmin(prices)) > _PATIENCE:
            break
    return fits


def _unbiased(records: Sequence[Recording], response: FrequencyResponse, fit: Fitted) -> FrequencyResponse:
    """The response without what its estimate adds of itself: a band smears a resonance, and a record ends in motion.

    That is the difference between the response of a model and its estimate from the model's own output.

    Args:
        records: The records.
        response: Their response.
        fit: The model.
    """
    model = fit.modes(creep=True)
    outputs = [simulate(model, r.drive - r.drive[:1], r.rate_hz, response.hold) for r in records]
    modelled = [replace(r, output=output) for r, output in zip(records, outputs, strict=True)]
    estimate = response_from_records(modelled, bands=_BANDS)  # in the same bands: the drive says which
    true = model.response(response.freq_hz, response.hold, response.rate_hz)
    return replace(response, response=response.response - (estimate.response - true))


def _thin(response: FrequencyResponse) -> FrequencyResponse:
    """The response in fewer lines: enough to begin with."""
    if response.freq_hz.size <= BANDS:
        return response
    freq, values, error, power = merged(response, BANDS)
    return replace(
        response,
        freq_hz=freq,
        response=values[:, None, None],
        standard_error=error[:, None, None],
        drive_power=power[:, None, None].astype(complex),
    )


def _freed(fit: Fitted, response: FrequencyResponse) -> np.ndarray:
    """The response without the delay, creep and loss of a fit."""
    turn = np.exp(2j * np.pi * response.freq_hz * fit.at.delay_s)[:, None, None]
    lags = modes_of(fit.at, 0.0, fit.gains[2:], fit.problem.lags_s)
    creep = lags.response(response.freq_hz, response.hold, response.rate_hz)
    return np.asarray((response.response - creep) * turn / (1 + 1j * fit.gains[1] / fit.gains[0]))


def _linear_fit(
    records: Sequence[Recording], response: FrequencyResponse, fit: Fitted, fits: Sequence[Fitted]
) -> LinearFit:
    own, known = _known(fit, response.excited_hz[0], response.rate_hz)
    whole = fit.modes(creep=True)
    errors = [axis_error(own, record, response.hold) for record in records]
    loss = own.response(response.freq_hz, response.hold, response.rate_hz) * (1j * fit.gains[1] / fit.gains[0])
    residual = response.response - whole.response(response.freq_hz, response.hold, response.rate_hz) - loss
    scores = {one.order: one for one in map(_score, fits)}
    score = _score(fit)
    before = scores.get(score.order, score)
    scores[score.order] = min(score, before, key=lambda one: one.criterion)
    scan = tuple(scores[order] for order in sorted(scores))
    return with_evidence(own, records, errors, response, residual, known, scan, _reason(score, scan))


def axis_error(modes: ModalModel, record: Recording, hold: Hold) -> Floats:
    """Measured less modelled output (samples, 1) of a record, without creep and a drift: they belong to no pole.

    Args:
        modes: The linear part.
        record: The record; one with a period is taken for settled, another begins at rest at its first drive value.
        hold: What the drive does between samples.
    """
    period = record.period_samples
    error = output_error(modes, record, hold, steady=period is not None)
    last = math.floor(math.log10(3 * record.samples * record.step_s / _FIRST_LAG_S))
    times = np.array([_FIRST_LAG_S * 10.0**k for k in range(max(last, 0) + 1)])
    drive = np.ascontiguousarray(record.drive[:, 0] - record.drive[0, 0])
    if period is None:
        lags = kernels.lag_response(drive, record.step_s, times, np.zeros(times.size))
        lags = np.column_stack([lags, np.arange(len(error)) / len(error)])
    else:
        poles, ones = np.array([complex(-1.0 / tau) for tau in times]), np.ones((times.size, 1), dtype=complex)
        bank = ModalModel(poles, ones, np.diag(-poles), np.zeros(ones.shape))
        begins = range(0, len(error), period)
        lags = np.vstack([simulate_periodic(bank, drive[k : k + period, None], record.rate_hz, hold) for k in begins])
    columns = np.column_stack([np.ones(len(error)), lags])
    return np.asarray(error - columns @ np.linalg.lstsq(columns, error)[0])


def _score(fit: Fitted) -> OrderScore:
    order = sum(pole.states for pole in fit.at.poles)
    return OrderScore(order, fit.parameters, fit.chi_square, fit.freedom, fit.criterion, fit.output_error_rms)


NOT_SHOWN = "has a pole that no recording shows"
"""What is told of an order in place of a criterion that is `UNSEEN` or more."""


def _reason(chosen: OrderScore, scan: Sequence[OrderScore]) -> str:
    per = ", ".join(f"{s.order}: {plain(s.chi_square / s.freedom)}" for s in scan)
    reason = (
        f"order {chosen.order} has the least criterion, {plain(chosen.criterion, 4)} (chi-square + parameters x ln "
        f"values); squared distance over its variance, per degree of freedom, by order: {per} (1 is what a true model "
        "leaves; what no order explains counts as noise)"
    )
    others = [s for s in scan if s.order != chosen.order]
    if others:
        next_best = min(others, key=lambda s: s.criterion)
        worse = f"is worse by {plain(next_best.criterion - chosen.criterion)}"
        reason += f"; order {next_best.order} {worse if next_best.criterion < UNSEEN else NOT_SHOWN}"
    return reason


# -------------------------------------------------------------------------------------------------------------- errors
def _known(fit: Fitted, edge_hz: float, rate_hz: float) -> tuple[ModalModel, Uncertainty]:
    """The modes, and poles, zeros, gains and the delay with their standard errors."""
    problem, gain = fit.problem, float(fit.gains[0])
    numbers = problem.pack(fit.at)
    count = numbers.size
    covariance = fit.covariance()[: count + 1, : count + 1] * max(1.0, fit.chi_square / fit.freedom)
    modes = fit.modes()
    poles = modes.all_poles_rad_s
    zeros = np.sort_complex(root_values(fit.at.zeros))
    zeros = zeros[np.abs(zeros) <= np.pi * rate_hz]

    def quantities(v: Floats) -> np.ndarray:
        at = problem.unpack(v[:count], fit.at)
        moved = modes_of(at, gain * (1.0 + float(v[count])), (), ())
        others = root_values(at.zeros)
        nearest = [others[int(np.argmin(np.abs(others - zero)))] for zero in zeros]
        edge = moved.combined(1.0 / (np.array([0.0, 2j * np.pi * edge_hz])[:, None] - moved.all_poles_rad_s))
        ends = [edge[0, 0, 0], abs(edge[1, 0, 0])]
        return np.concatenate([moved.all_poles_rad_s, nearest, ends, [at.delay_s]])

    at = np.append(numbers, 0.0)
    jacobian = central_differences(quantities, at, np.full(count + 1, 1e-6))
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian.conj()).real
    errors = np.sqrt(np.maximum(variance, 0.0))
    values = quantities(at)
    n, m = poles.size, zeros.size
    known = Uncertainty(
        poles,
        errors[:n],
        zeros,
        errors[n : n + m],
        values[n + m : n + m + 1].real[:, None],
        errors[n + m : n + m + 1, None],
        values[n + m + 1 : n + m + 2].real[:, None],
        errors[n + m + 1 : n + m + 2, None],
        float(errors[-1]),
    )
    return modes, known
