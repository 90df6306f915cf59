"""A state-space model with error bars from a table of a measured frequency response: arrays in, a record out.

`fit_frequency_response` needs neither recordings nor a mission. A quick vector fit (`sketched`) gives the start,
weighted least squares the model (`elements`, `polish`), and the normal equations its standard errors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Complexes, Floats
from microrad.core.installing import advice
from microrad.core.labelled import Dataset, Group, variables
from microrad.core.lti import StateSpace
from microrad.core.progress import Progress
from microrad.core.units import plain
from microrad.lab.identify.linear.elements import ElementEquations
from microrad.lab.identify.linear.fit import OrderScore, choose, given_orders, range_warnings
from microrad.lab.identify.linear.modal import Hold, ModalModel, order_modes
from microrad.lab.identify.linear.order import exchanged, reduced
from microrad.lab.identify.linear.polish import Polished, fit_outputs, normal_equations, pack, polish, unpack
from microrad.lab.identify.linear.response import PER_DRIVE
from microrad.lab.identify.linear.response_table import ResponseTable, band_hz, check_numbers, checked
from microrad.lab.identify.linear.uncertainty import Natural, Uncertainty, inverse_normal, natural, uncertainty
from microrad.lab.identify.linear.vector_fitting import VectorFit, sketched, vector_fit
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.statistics import correlation

_LARGEST = 24  # orders of a scan
_NO_BETTER = 6  # orders in a row that gain nothing and end a scan
_LACKING = 1.5  # times the squared error of a vector fit of as many poles: other starts are tried
_MISFIT = 3.0  # standard deviations of chi-square
_ZEROS_TO = 10.0  # times the highest frequency, where there is no sample rate
_EXCHANGES = 12
_ROUNDING = 1e-10
_MOVED = 1e-3  # of a standard error, by which parameters are moved
_OPEN = 0.05  # periods of the highest frequency
_UNEVEN = 3.0  # times as much left above the median of the response as below


@dataclass(frozen=True, eq=False)
class FrequencyResponseFit:
    """A stable model of a table, with its evidence.

    `system` is continuous, real and block-diagonal, in rad/s; `modes` the same as poles and vectors, with the delay,
    which the system has not. `freq_hz` (frequencies,) and `table` (frequencies, outputs, inputs) are what was fitted.
    `scan` is empty where the order was given, and `output_error_rms` in it the plain root mean square of the residual;
    `reason` says in words why this order. `normal` is the normal matrix at the end in the parameters of `pack`, the
    delay behind them where it was fitted, `variance` that of one row, and `errors_from` says in words what it rests on;
    `chi_square` is what is left per degree of freedom by the standard errors given, None without them. `residual`,
    `known`, with poles, transmission zeros and gains and their standard errors, and `warnings` are made when they are
    first asked for.
    """

    system: StateSpace
    modes: ModalModel
    order: int
    hold: Hold
    rate_hz: float | None
    freq_hz: Floats
    table: Complexes
    scan: tuple[OrderScore, ...]
    reason: str
    normal: Floats
    variance: float
    errors_from: str
    chi_square: float | None
    strictly_proper: bool

    def __repr__(self) -> str:
        """What it is, without its arrays."""
        outputs, inputs = self.table.shape[1:]
        return (
            f"<FrequencyResponseFit of order {self.order}: {outputs} x {inputs} elements at {self.freq_hz.size} "
            f"frequencies, {self.relative_rms_error:.3g} of the table left>"
        )

    def to_xarray(self) -> Dataset:
        """The model, standard errors of its gain and phase, and what it leaves of the table, by frequency in Hz."""
        gain_error, phase_error = self.response_errors(self.freq_hz)
        data = variables(
            "frequency output input",
            response=(PER_DRIVE, "complex frequency response of the model", self.response(self.freq_hz)),
            gain_error=(PER_DRIVE, "standard error of its gain", gain_error),
            phase_error=("rad", "standard error of its phase", phase_error),
            residual=(PER_DRIVE, "table less model", self.residual),
        )
        names = variables("frequency", frequency=("Hz", "frequency", self.freq_hz))
        said = {"order": self.order, "delay_s": self.delay_s, "relative_rms_error": self.relative_rms_error}
        return Group(data, names, said).to_xarray()

    @property
    def natural(self) -> tuple[Natural, ...]:
        """Poles as natural frequencies and damping ratios with standard errors, by frequency, one of each pair."""
        m, n = self.modes.real_poles, self.modes.poles_rad_s.size
        error = np.sqrt(np.maximum(np.diag(self.covariance)[: 2 * n - m], 0.0))
        parts = error[:n] + 1j * np.concatenate([np.zeros(m), error[n:]])
        found = [natural(complex(p), complex(e)) for p, e in zip(self.modes.poles_rad_s, parts, strict=True)]
        return tuple(sorted(found, key=lambda each: each.freq_hz))

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest frequency of the table above zero, and its highest one."""
        return band_hz(self.freq_hz)

    @cached_property
    def residual(self) -> Complexes:
        """Table less model, shape (frequencies, outputs, inputs)."""
        return np.asarray(self.table - self.response(self.freq_hz))

    @property
    def relative_rms_error(self) -> float:
        """Root mean square of the residual over that of the table."""
        size = float(np.linalg.norm(self.table))
        return float(np.linalg.norm(self.residual)) / size if size else 0.0

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the parameters of `pack`, the delay behind them where it was fitted."""
        return inverse_normal(self.normal, self.order) * self.variance

    @cached_property
    def known(self) -> Uncertainty:
        """Poles, transmission zeros and gains with their standard errors; `edge_gain` is that at the lowest frequency.

        Without a sample rate, zeros beyond ten times the highest frequency are left out: they are those of the noise.
        """
        low, high = self.band_hz
        below = 2 * np.pi * _ZEROS_TO * high if self.rate_hz is None else np.pi * self.rate_hz
        outputs, inputs = self.modes.direct.shape
        direct = not self.strictly_proper
        own = self.order * (1 + inputs + outputs) + outputs * inputs * direct
        found = uncertainty(self.modes, self.covariance[:own, :own], direct, edge_hz=low, below_rad_s=below)
        delay = np.diag(self.covariance)[own:]
        return replace(found, delay_error_s=float(np.sqrt(np.maximum(delay, 0.0)).sum()))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the model, in words."""
        if self.chi_square is None:
            noise = _uneven(self.table, self.residual)
        else:
            noise = _misfit(self.chi_square) if self.variance > 1.0 else ()
        return (
            *noise,
            *_open_delay(self.known.delay_error_s, self.band_hz[1]),
            *range_warnings(self.known, self.band_hz, of="table", what="measured"),
        )

    @property
    def poles_rad_s(self) -> Complexes:
        """All poles, in rad/s, conjugates included, shape (order,)."""
        return self.modes.all_poles_rad_s

    @property
    def zeros_rad_s(self) -> Complexes:
        """Transmission zeros of a square system, in rad/s, shape (zeros,)."""
        return self.known.zeros_rad_s

    @property
    def delay_s(self) -> float:
        """Pure delay; 0 where it was not fitted."""
        return self.modes.delay_s

    def response(self, freq_hz: ArrayLike) -> Complexes:
        """Response of the model behind its hold and delay, shape (frequencies, outputs, inputs).

        Args:
            freq_hz: Frequencies, in Hz, shape (frequencies,).
        """
        return self.modes.response(np.atleast_1d(np.asarray(freq_hz, dtype=float)), self.hold, self.rate_hz)

    def response_errors(self, freq_hz: ArrayLike) -> tuple[Floats, Floats]:
        """Standard errors of the model's gain, in its unit, and of its phase (rad), to first order.

        Each direction of the covariance moves all parameters by a small part of its standard deviation. Both have the
        shape (frequencies, outputs, inputs).

        Args:
            freq_hz: Frequencies, in Hz, shape (frequencies,).
        """
        centre, numbers = self.response(freq_hz), pack(self.modes, not self.strictly_proper)
        size = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        values, vectors = np.linalg.eigh(correlation(self.covariance))
        turn = centre.conj() / np.maximum(np.abs(centre), 1e-300)
        along, across = np.zeros(centre.shape), np.zeros(centre.shape)

        def response(step: Floats) -> Complexes:
            model = unpack(numbers + step[: numbers.size], self.modes)
            moved = replace(self, modes=replace(model, delay_s=self.delay_s + float(step[numbers.size :].sum())))
            return moved.response(freq_hz)

        for step in (size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T:
            slope = turn * (response(_MOVED * step) - response(-_MOVED * step)) / (2.0 * _MOVED)
            along, across = along + slope.real**2, across + slope.imag**2
        return np.sqrt(along), np.sqrt(across) / np.maximum(np.abs(centre), 1e-300)

    def to_control(self) -> Any:
        """The system as a continuous `control.StateSpace`; a delay is left out.

        Raises:
            IdentificationError: Where python-control is not installed.
        """
        try:
            library = import_module("control")
        except ImportError as error:
            raise IdentificationError(
                f"python-control is not installed, so the model cannot become one of its objects: install it "
                f"{advice('control')}"
            ) from error
        return library.ss(*(getattr(self.system, key).copy() for key in "ABCD"))


class _Found(NamedTuple):
    """A polished model behind a delay, and the equations that it was polished for."""

    equations: ElementEquations
    polished: Polished
    delay_s: float


def fit_frequency_response(  # noqa: PLR0913  all but the first three are named options
    freq_hz: ArrayLike,
    response: ArrayLike,
    orders: int | Sequence[int] | None = None,
    *,
    standard_error: ArrayLike | None = None,
    strictly_proper: bool = False,
    delay: bool = False,
    hold: Hold = "band-limited",
    rate_hz: float | None = None,
    on_progress: Progress | None = None,
) -> FrequencyResponseFit:
    """Fit a stable continuous state-space model to a measured frequency response, with standard errors.

    The weighted squared distance to the table is least among the models of the order: one common set of poles, one
    column and one row of gains to each (see `ModalModel`). For noise that is normal, independent from frequency to
    frequency and of the given standard errors that is the maximum-likelihood estimate (R. Pintelon and J. Schoukens,
    System Identification, 2nd ed., Wiley 2012, ch. 9).

    Args:
        freq_hz: Frequencies, in Hz, rising, at least 0, shape (frequencies,).
        response: Complex response in units of output per unit of input, shape (frequencies,) or (frequencies, outputs,
            inputs). From magnitude and phase it is magnitude * exp(1j * phase in radians).
        orders: A number of states, or several to compare by the Bayesian information criterion; by default 1, 2, ...
            until six in a row gain nothing, 24 at most.
        standard_error: One sigma of the complex value (the root of its mean squared distance from the true one), in the
            unit of the response, of its shape, (frequencies,) or one number. Each entry weighs by one over it. By
            default all weigh alike, and the noise is taken from what the model leaves.
        strictly_proper: Whether the direct term D is left out.
        delay: Whether a pure delay, common to all elements and at least 0, is fitted as well.
        hold: What stands between the samples of the input where the table is that of sampled data: "zero-order",
            "first-order", or "band-limited" for the continuous response itself.
        rate_hz: Sample rate, in Hz; the first two holds need it.
        on_progress: Called with the orders done, their number and what is done.

    Raises:
        IdentificationError: If the table has another shape than these, numbers that are not finite, frequencies that do
            not rise or are below 0, or one at or above half of the rate, or standard errors that are not above 0; if an
            order is below 1 or more than so many frequencies can fix; for a hold without a rate.

    Example:
        ```python
        import numpy as np
        import microrad

        freq_hz, gain, phase_deg = np.loadtxt("bode.csv", delimiter=",", skiprows=1, unpack=True)
        response = gain * np.exp(1j * np.radians(phase_deg))
        fit = microrad.fit_frequency_response(freq_hz, response, standard_error=2e-7)  # one sigma of the analyser
        print(fit.order, fit.reason, *fit.warnings)
        print(*fit.natural, sep=", ")
        A, B, C, D = fit.system.A, fit.system.B, fit.system.C, fit.system.D
        ```
    """
    table = checked(freq_hz, response, standard_error, (hold, rate_hz, strictly_proper))
    report = on_progress or no_progress
    fits: dict[int, _Found] = {}
    candidates = given_orders(table.freq_hz, range(1, min(_LARGEST, table.most) + 1) if orders is None else orders)
    if orders is not None:
        check_numbers(table, candidates[-1], delay)
    for done, order in enumerate(candidates, start=1):
        fits[order] = _fitted(table, order, delay)
        report(done, len(candidates), f"order {order}")
        if orders is None and _gains_nothing(table, fits, delay):
            break
    scan = _scores(table, fits, delay) if len(fits) > 1 else []
    chosen, reason = choose(scan) if scan else (candidates[0], f"order {candidates[0]} was given")
    if scan and standard_error is None:
        reason += "; no standard errors were given, so the variance is the least that any of these orders leaves"
    return _result(table, _improved(table, fits[chosen]), delay, scan, reason)


# ------------------------------------------------------------------------------------------------------------ one order
def _fitted(table: ResponseTable, order: int, delay: bool) -> _Found:
    """The best model of an order, and the best delay of it."""
    if not delay:
        equations = table.equations()
        return _Found(equations, _polished(table, equations, order), 0.0)
    return _best_delay(table, lambda equations: _polished(table, equations, order))


def _polished(table: ResponseTable, equations: ElementEquations, order: int) -> Polished:
    """The model of least cost from a vector fit of as many poles and, where that lacks something, from others."""
    turned = equations.response
    found = _sketch(table, turned, equations, order)
    best = _from(equations, _start(equations, found, order))
    least = min(turned.shape[1:])
    if best.cost > _LACKING * found.rms_error**2 * equations.rows / 2 and least > 1 and order >= least:
        other = _sketch(table, turned, equations, -(-order // least))
        again = _from(equations, _fitted_outputs(equations, reduced(other.modes(), order))[0])
        best = min(best, again, key=lambda p: p.cost)
    return best


def _sketch(table: ResponseTable, response: Complexes, equations: ElementEquations, order: int) -> VectorFit:
    """A vector fit by sums, or by QR factorisations where the sums are singular."""
    freq, hold, rate_hz = table.freq_hz, table.hold, table.rate_hz
    half = equations.squared[:, : freq.size]
    proper = not table.direct
    try:
        return sketched(freq, response, half, equations.scale, order, (hold, rate_hz, proper))
    except np.linalg.LinAlgError:
        pass
    weight = np.sqrt(half * equations.scale).T.reshape(response.shape)
    return vector_fit(freq, response, order, weight=weight, hold=hold, rate_hz=rate_hz, strictly_proper=proper)


def _start(equations: ElementEquations, found: VectorFit, order: int) -> ModalModel:
    """One mode for each pole, or all modes reduced to the order where that is nearer to the table."""
    if min(found.direct.shape) == 1:
        return _one_each(found)
    first, cost = _fitted_outputs(equations, _one_each(found))
    if cost <= _LACKING * found.rms_error**2 * equations.rows / 2:
        return first
    return min((first, cost), _fitted_outputs(equations, reduced(found.modes(), order)), key=lambda found: found[1])[0]


def _fitted_outputs(equations: ElementEquations, model: ModalModel) -> tuple[ModalModel, float]:
    return fit_outputs(equations, model.poles_rad_s, model.input_vectors)


def _one_each(found: VectorFit) -> ModalModel:
    """One mode for each pole: the largest singular vectors of its residue."""
    upper, real = found.poles_rad_s.imag >= 0, found.poles_rad_s.imag == 0
    poles, residues = found.poles_rad_s[upper], found.residues[upper]
    if residues.shape[2] == 1:
        return order_modes(poles, np.ones((poles.size, 1), dtype=complex), residues[:, :, 0].T, found.direct)
    if residues.shape[1] == 1:
        return order_modes(poles, residues[:, 0], np.ones((1, poles.size), dtype=complex), found.direct)
    count = int(np.count_nonzero(real))  # the residues of real poles, which stand first, have real vectors
    parts = [np.linalg.svd(part) for part in (residues[:count].real, residues[count:]) if len(part)]
    outputs = np.concatenate([left[:, :, 0] * size[:, :1] for left, size, _ in parts])
    inputs = np.concatenate([right[:, 0] for _, _, right in parts])
    return order_modes(poles, inputs.astype(complex), outputs.T.astype(complex), found.direct)


def _from(equations: ElementEquations, start: ModalModel) -> Polished:
    """The start, its output vectors fitted, polished: until two steps gain less than a hundredth in chi-square."""
    return polish(equations, start, iterations=60, tolerance=1e-2 / equations.rows, settled=2.0, fitted=True)


def _improved(table: ResponseTable, found: _Found) -> _Found:
    """Weak modes exchanged for better ones for as long as more is left than the noise, where that is known."""
    best = found.polished
    freedom = best.rows - table.parameters(best.model.order, False)
    if table.standard_error is None or best.cost < freedom + _MISFIT * np.sqrt(2.0 * freedom):
        return found
    for _ in range(_EXCHANGES):
        better = exchanged(found.equations, best, table.band_hz)
        if better is None:
            break
        best = better
    return found._replace(polished=best)


# ---------------------------------------------------------------------------------------------------------------- delay
def _best_delay(table: ResponseTable, fitted: Callable[[ElementEquations], Polished]) -> _Found:
    """The delay of least cost: a grid up to two periods of the highest frequency, then a bounded search by Brent."""
    from scipy.optimize import minimize_scalar

    period = 1.0 / table.band_hz[1]
    known: dict[float, _Found] = {}

    def cost(delay_s: float) -> float:
        equations = table.equations(float(delay_s))
        known[float(delay_s)] = _Found(equations, fitted(equations), float(delay_s))
        return float(known[float(delay_s)].polished.cost)

    step = 0.125 * period
    grid = step * np.arange(17)
    nearest = grid[int(np.argmin([cost(d) for d in grid]))]
    bounds = (max(nearest - step, 0.0), nearest + step)
    minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-7 * period, "maxiter": 60})
    return min(known.values(), key=lambda found: found.polished.cost)


def _with_delay(found: _Found) -> Floats:
    """The normal matrix with one column more: by e^{j w delay} the delay turns the table against the model."""
    equations, model = found.equations, found.polished.model
    s = 2j * np.pi * equations.freq_hz[:, None, None]
    column, square = equations.against(model, -s * model.response(equations.freq_hz, equations.hold, equations.rate_hz))
    normal = normal_equations(equations, model)[0]
    return np.block([[normal, column[:, None]], [column, np.array([square])]])


# --------------------------------------------------------------------------------------------------------------- result
def _variance(table: ResponseTable, fits: dict[int, _Found], delay: bool) -> float:
    """Variance of a row: 1 by the standard errors given, else the least that an order leaves per degree of freedom."""
    if table.standard_error is not None:
        return 1.0
    left = [p.cost / max(p.rows - table.parameters(n, delay), 1) for n, (_, p, _) in fits.items()]
    power = next(iter(fits.values())).polished
    return max(*left, 1e-300) if len(left) == 1 else max(min(left), 1e-26 * power.power / power.rows, 1e-300)


def _scores(table: ResponseTable, fits: dict[int, _Found], delay: bool) -> list[OrderScore]:
    variance = _variance(table, fits, delay)
    return [_score(table, order, fit, variance, delay) for order, fit in sorted(fits.items())]


def _score(table: ResponseTable, order: int, found: _Found, variance: float, delay: bool) -> OrderScore:
    polished, parameters = found.polished, table.parameters(order, delay)
    chi_square = polished.cost / variance
    left = float(np.sqrt(np.mean(np.abs(_residual(table, found)) ** 2)))
    criterion = chi_square + parameters * float(np.log(polished.rows))
    return OrderScore(order, parameters, chi_square, polished.rows - parameters, criterion, left)


def _gains_nothing(table: ResponseTable, fits: dict[int, _Found], delay: bool) -> bool:
    """Whether the last orders are all no better than one before them."""
    scores = _scores(table, fits, delay)
    return len(scores) - 1 - int(np.argmin([score.criterion for score in scores])) >= _NO_BETTER


def _behind_delay(found: _Found) -> ModalModel:
    m = found.polished.model
    return ModalModel(m.poles_rad_s, m.input_vectors, m.output_vectors, m.direct, found.delay_s)


def _residual(table: ResponseTable, found: _Found) -> Complexes:
    return np.asarray(table.response - _behind_delay(found).response(table.freq_hz, table.hold, table.rate_hz))


def _result(
    table: ResponseTable, found: _Found, delay: bool, scan: Sequence[OrderScore], reason: str
) -> FrequencyResponseFit:
    polished = found.polished
    model = _behind_delay(found)
    freedom = max(polished.rows - table.parameters(model.order, delay), 1)
    per = polished.cost / freedom
    given, beyond = table.standard_error is not None, 1.0 + _MISFIT * np.sqrt(2.0 / freedom)
    variance = max(1.0, per) if given and per > beyond else 1.0 if given else max(per, 1e-300)
    return FrequencyResponseFit(
        system=model.state_space(),
        modes=model,
        order=model.order,
        hold=table.hold,
        rate_hz=table.rate_hz,
        freq_hz=table.freq_hz,
        table=table.response,
        scan=tuple(scan),
        reason=reason,
        normal=_with_delay(found) if delay else polished.normal,
        variance=variance,
        errors_from=_errors_from(given, variance, per),
        chi_square=per if given else None,
        strictly_proper=not table.direct,
    )


def _errors_from(given: bool, variance: float, per: float) -> str:
    if not given:
        return "the residual: no standard errors were given, so the noise is taken to be what the model leaves"
    if variance == 1.0:
        return f"the standard errors given; chi-square per degree of freedom is {plain(per)}"
    return f"the standard errors given, times {plain(variance**0.5)} for what the model leaves beyond them"


def _misfit(per: float) -> tuple[str, ...]:
    """What the model leaves beyond the standard errors given, in words."""
    return (
        f"the model leaves {plain(per**0.5)} times the standard errors given: the order is too low, the response is "
        "not that of a linear system, or the errors are too small; those of the model are larger by as much.",
    )


def _uneven(response: Complexes, residual: Complexes) -> tuple[str, ...]:
    """Whether more is left where the response is large, in words: then the noise is not alike."""
    large = np.abs(response) > np.median(np.abs(response))
    if not large.any():
        return ()
    above, below = (float(np.sqrt(np.mean(np.abs(residual[part]) ** 2))) for part in (large, ~large))
    if above <= _UNEVEN * below or above <= _ROUNDING * float(np.abs(response).max()):
        return ()
    return (
        f"the model leaves {plain(above / max(below, 1e-300))} times as much where the response is large: the noise is "
        "not alike, and an order chosen from it is too high; give standard_error, such as 0.01 * abs(response).",
    )


def _open_delay(delay_error_s: float, highest_hz: float) -> tuple[str, ...]:
    """Whether the table leaves the delay open, in words: without a direct term a short one is like other gains."""
    if delay_error_s * highest_hz < _OPEN:
        return ()
    return (
        f"the table does not fix the delay: its standard error is {delay_error_s:.2g} s, as poles and gains can take "
        "its part; fit without a delay, or measure to higher frequencies.",
    )
