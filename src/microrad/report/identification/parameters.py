"""One fit of an identification in words: parameters with their uncertainty, starts, correlations."""

import math
from dataclasses import dataclass

from microrad.lab.identify import BoucWenFit, PrandtlIshlinskiiFit
from microrad.lab.identify.hysteresis.bouc_wen import PARAMETER_UNITS, PARAMETERS
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.selection.predictions import Fit
from microrad.lab.identify.statistics import rounded_to_error
from microrad.report.quantities import counted, minus, plain

HIGH_CORRELATION = 0.95


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One parameter in SI units; `standard_error` is nan where the value was held, and `note` says why."""

    name: str
    value: float
    standard_error: float
    unit: str
    note: str = ""

    @property
    def shown(self) -> tuple[float, float, str]:
        """Value, standard error and unit as they are printed: gains in mrad/V."""
        factor, unit = (1e3, "mrad/V") if self.unit == "rad/V" else (1.0, self.unit)
        return factor * self.value, factor * self.standard_error, unit


def to_error(value: float, error: float) -> str:
    """A value with the digits that its error leaves it, as it is printed.

    Args:
        value: as it was found.
        error: its standard error in the same unit; nan where it was held.
    """
    return minus(rounded_to_error(value, error))


def two_digits(error: float) -> str:
    """An error as it is printed: two significant digits, without an exponent where that is readable; "" for nan."""
    return f"{float(f'{error:.2g}'):g}" if math.isfinite(error) else ""


def parameter_rows(fit: Fit) -> list[ParameterRow]:
    """The parameters of a fit with their standard errors, those that were held behind the fitted ones."""
    if isinstance(fit, BoucWenFit):
        errors = fit.standard_errors.tolist()
        return [
            ParameterRow(*row) for row in zip(PARAMETERS, fit.values.tolist(), errors, PARAMETER_UNITS, strict=True)
        ]
    if isinstance(fit, PrandtlIshlinskiiFit):
        plays = zip(fit.thresholds_v, fit.sign * fit.weights_rad_per_v, fit.standard_errors_rad_per_v, strict=True)
        return [
            ParameterRow(f"weight at {r:.4g} V", float(w), float(e), "rad/V", "" if w else "held at 0 by its bound")
            for r, w, e in plays
        ]
    of = zip(fit.structure.parameters, fit.fit.values.tolist(), fit.fit.standard_errors.tolist(), strict=True)
    return [ParameterRow(p.name, value, error, p.unit) for p, value, error in of] + _held(fit)


def _held(fit: JointFit) -> list[ParameterRow]:
    """Poles and zeros that the joint fit took from the frequency response, and the lags chosen for the creep."""
    fitted = {p.name for p in fit.structure.parameters}
    rows = []
    for kind in ("pole", "zero") if fit.linear is not None else ():
        assert fit.linear is not None
        roots = fit.linear.poles if kind == "pole" else fit.linear.zeros
        note = "held, from the frequency response"
        for number, (f, damping) in enumerate(zip(roots.frequencies_hz, roots.dampings, strict=True), 1):
            if f"{kind} {number}" not in fitted:
                rows.append(ParameterRow(f"{kind} {number}", f, math.nan, "Hz", note))
                if abs(damping) != 1.0:  # or it is real
                    rows.append(ParameterRow(f"{kind} {number} damping", damping, math.nan, "", note))
    for number, lag in enumerate(fit.creep.time_constants_s, 1):
        rows.append(ParameterRow(f"creep lag {number}", lag, math.nan, "s", "chosen"))
    return rows


def not_identified(fit: Fit) -> list[tuple[str, str]]:
    """Parameters that the recordings do not fix, each with the reason."""
    if isinstance(fit, BoucWenFit):
        return [(item.name, item.reason) for item in fit.not_identified]
    return list(fit.not_identified) if isinstance(fit, JointFit) else []


def starts(fit: Fit) -> tuple[int, int] | None:
    """How many starts agreed, and of how many; None where the problem has one minimum."""
    if isinstance(fit, BoucWenFit):
        return fit.agreeing_starts, len(fit.start_rms_percent)
    return (fit.fit.agreeing_starts, len(fit.fit.start_costs)) if isinstance(fit, JointFit) else None


def starts_text(fit: Fit) -> str:
    """The same in words."""
    found = starts(fit)
    if found is None:
        return "the weights are a non-negative least-squares problem, which has one minimum: no starts are needed"
    if isinstance(fit, JointFit) and fit.begun:
        return "one start was made, from an earlier fit of the same model"
    if found[1] == 1:
        return "one start was made, from the least-squares weights of the operators"
    return f"{found[0]} of {found[1]} starts reached the best fit"


def admissible(fit: Fit) -> bool:
    """Whether the modelled mirror never moves against its drive just after a reversal."""
    return isinstance(fit, PrandtlIshlinskiiFit) or fit.admissible


def condition_number(fit: Fit) -> float:
    """Of the least-squares problem, its columns scaled."""
    return fit.fit.condition_number if isinstance(fit, JointFit) else fit.condition_number


def colour(fit: Fit) -> float:
    """By which correlation between the residuals of neighbouring samples inflates the variances."""
    return fit.fit.colour_inflation if isinstance(fit, JointFit) else fit.colour_inflation


def correlations(fit: Fit, least: float = HIGH_CORRELATION) -> list[tuple[str, str, float]]:
    """Pairs of parameters whose estimates are correlated, the strongest first.

    Args:
        fit: one fit of an identification.
        least: magnitude from which a pair is told.
    """
    if isinstance(fit, PrandtlIshlinskiiFit):
        return []
    matrix = fit.correlation if isinstance(fit, BoucWenFit) else fit.fit.correlation
    names = PARAMETERS if isinstance(fit, BoucWenFit) else tuple(p.name for p in fit.structure.parameters)
    pairs = [
        (names[i], names[j], float(matrix[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) >= least
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def notes(fit: Fit) -> list[str]:
    """What belongs under the table of a fit's parameters, a sentence each."""
    text = starts_text(fit)
    found = [f"{text[0].upper()}{text[1:]}."]
    if pairs := correlations(fit):
        shown = ", ".join(f"{a} and {b} {r:+.3f}" for a, b, r in pairs[:6])
        more = f" and {counted(len(pairs) - 6, 'pair')} more" if len(pairs) > 6 else ""
        found.append(minus(f"Correlated above {HIGH_CORRELATION:g}: {shown}{more}."))
    if isinstance(fit, BoucWenFit):
        value, error = fit.settled_hysteresis_rad
        found.append(
            f"Better fixed than its parts: the hysteresis of a slow settled loop, |epsilon| / (alpha + sign(epsilon) "
            f"beta) = {to_error(1e6 * value, 1e6 * error)} ± {plain(1e6 * error, 2)} µrad."
        )
    found.append(
        f"Condition number {condition_number(fit):.3g}; the variances are inflated {colour(fit):.3g} times for the "
        "colour of the residual."
    )
    return found
