"""The Prandtl-Ishlinskii mirror, a weighted sum of play operators, from recordings, with its uncertainty.

    y = sign * sum_i w_i P_i[u] + offset,   w_i >= 0,   P_i: p <- max(u - r_i, min(u + r_i, p))

Linear in the weights: non-negative least squares, with an unconstrained offset and memory of each record.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.kernels import play_response
from microrad.lab.identify.records import (
    DEFAULT_UNITS,
    IdentificationError,
    SiRecord,
    Units,
    centred,
    fastest_rate,
    si_records,
    span,
    split_by_record,
)
from microrad.lab.identify.statistics import colour_inflation, percent
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import PrandtlIshlinskii


@dataclass(frozen=True, eq=False)
class PrandtlIshlinskiiFit:
    """Thresholds (V) and weights (rad/V) of the play operators, with standard errors of the weights in use.

    `sign` is -1 where the output falls with the drive; the weights describe sign times output. Standard errors are
    estimated from the residuals, inflated by `colour_inflation`, hold for the operators with a positive weight and
    are nan for the others, which the bound w >= 0 holds at zero. The model does not depend on rate;
    `rate_limit_v_per_s` is the fastest rate at which it was seen.
    """

    thresholds_v: Floats
    weights_rad_per_v: Floats
    standard_errors_rad_per_v: Floats
    sign: int
    offsets_rad: tuple[float, ...]
    rate_limit_v_per_s: float
    units: Units
    colour_inflation: float
    condition_number: float
    residual_rms_percent: float
    samples_used: int

    name = "prandtl_ishlinskii"
    admissible = True
    """Play operators with weights of 0 or more never turn against the drive."""
    not_identified: tuple[tuple[str, str], ...] = ()

    @property
    def falling(self) -> bool:
        """Whether the output falls with the drive."""
        return self.sign < 0

    @property
    def model(self) -> PrandtlIshlinskii:
        """The operator, in V and rad, with the sign of the output."""
        weights = (self.sign * self.weights_rad_per_v).tolist()
        limit = self.rate_limit_v_per_s
        return PrandtlIshlinskii(tuple(self.thresholds_v.tolist()), tuple(weights), rate_limit_v_s=limit)

    @property
    def parameter_count(self) -> int:
        """Number of parameters: the weights in use."""
        return int(np.sum(self.weights_rad_per_v > 0))

    def response(self, drive_v: Floats, step_s: float) -> tuple[Floats, int]:
        """Output (rad) without offset, every operator starting at the first drive value; no sample is clamped (0).

        Args:
            drive_v: Drive, in V, shape (samples,).
            step_s: Time between samples, in s, on which this model does not depend.
        """
        active = self.weights_rad_per_v > 0
        states = _states(drive_v, self.thresholds_v[active])
        return np.asarray(self.sign * (states @ self.weights_rad_per_v[active])), 0


def fit_prandtl_ishlinskii(
    recordings: Sequence[Recording],
    thresholds_v: ArrayLike | None = None,
    operators: int = 15,
    *,
    units: Units = DEFAULT_UNITS,
) -> PrandtlIshlinskiiFit:
    """Fit the weights of play operators to all recordings at once, every sample with equal weight.

    States are carried through each record, of which the first twentieth is left out (`records.lead`); what the mirror
    remembers from before it is fitted with the rest (`records.memory`).

    Args:
        recordings: Loops of one drive and one output each.
        thresholds_v: Thresholds (V), strictly increasing from 0.
        operators: Number of thresholds where none are given: spread evenly from 0 to 0.47 of the largest peak-to-peak
            drive. (An operator of half of it would never move both ways.)
        units: Units of the recordings.

    Raises:
        IdentificationError: If a recording or the thresholds cannot be used.
    """
    records = si_records(recordings, units)
    thresholds = _thresholds(records, thresholds_v, operators)
    stacked = np.concatenate([_states(r.drive_v, thresholds)[r.start :] for r in records])
    measured = np.concatenate([r.output_rad[r.start :] for r in records])
    states, output = centred(stacked, records), centred(measured, records)
    sign = 1 if float(states[:, 0] @ output) >= 0 else -1
    weights = non_negative_weights(states, sign * output)
    residual = measured - sign * stacked @ weights
    offsets = tuple(float(part.mean()) for part in split_by_record(residual, records))
    residual = centred(residual, records)
    colour = colour_inflation(split_by_record(residual, records))
    own = sum(record.own_count for record in records)
    variance = colour * float(residual @ residual) / max(1, residual.size - int(np.sum(weights > 0)) - own)
    errors, condition = _errors(states, weights, variance)
    rms, _ = percent(residual, span(records))
    return PrandtlIshlinskiiFit(
        thresholds_v=thresholds,
        weights_rad_per_v=weights,
        standard_errors_rad_per_v=errors,
        sign=sign,
        offsets_rad=offsets,
        rate_limit_v_per_s=fastest_rate(records),
        units=units,
        colour_inflation=colour,
        condition_number=condition,
        residual_rms_percent=rms,
        samples_used=residual.size,
    )


def _states(drive_v: Floats, thresholds_v: Floats) -> Floats:
    return np.asarray(play_response(drive_v, thresholds_v, np.full(thresholds_v.size, drive_v[0])))


def threshold_grid(drive_span: float, operators: int) -> Floats:
    """Thresholds spread evenly from 0 to 0.47 of the peak-to-peak drive.

    Args:
        drive_span: Peak-to-peak drive, in V.
        operators: Number of thresholds.
    """
    return np.linspace(0.0, 0.47 * drive_span, operators)


def _thresholds(records: Sequence[SiRecord], given: ArrayLike | None, operators: int) -> Floats:
    drive_span = max(float(np.ptp(r.drive_v)) for r in records)
    if given is None:
        if operators < 1:
            raise IdentificationError(f"{operators} play operators were asked for; give at least 1, better 10 or more.")
        return threshold_grid(drive_span, operators)
    thresholds = np.array(given, dtype=np.float64, ndmin=1)
    valid = thresholds.ndim == 1 and thresholds.size > 0 and np.isfinite(thresholds).all() and thresholds[0] == 0
    if not valid or np.any(np.diff(thresholds) <= 0) or thresholds[-1] >= drive_span / 2:
        raise IdentificationError(
            f"the thresholds {thresholds.tolist()} V cannot be used; they must start at 0, increase strictly and stay "
            f"below half of the drive's peak-to-peak, {drive_span / 2:g} V, or an operator never moves both ways."
        )
    return thresholds


def non_negative_weights(states: Floats, output: Floats) -> Floats:
    """Weights of 0 or more with the least squared error.

    The triangle of a QR decomposition holds the same problem in a few rows.

    Args:
        states: Outputs of the operators, shape (samples, operators).
        output: Output to be met, shape (samples,).
    """
    from scipy.optimize import nnls

    triangle = np.asarray(np.linalg.qr(np.column_stack((states, output)), mode="r"))
    size = float(np.abs(triangle).max())
    return np.asarray(nnls(triangle[:, :-1] / size, triangle[:, -1] / size)[0])


def _errors(states: Floats, weights: Floats, variance: float) -> tuple[Floats, float]:
    """Standard errors of the positive weights (nan for the others) and the condition number of their columns."""
    active = weights > 0
    errors = np.full(weights.size, np.nan)
    if not active.any():
        return errors, float("nan")
    _, singular, vectors = np.linalg.svd(states[:, active], full_matrices=False)
    root = vectors.T / np.maximum(singular, 1e-14 * singular[0])
    errors[active] = np.sqrt(variance * np.einsum("ij,ij->i", root, root))
    return errors, float(singular[0] / singular[-1])
