"""What speaks against a fitted model: its range, its rate, drift, residuals that are not noise, what it cannot do."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import plain
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, made_rising
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.lab.identify.records import SiRecord, Units, loop_rates, noisiness, one_rate_only
from microrad.lab.identify.selection.predictions import Fit, Prediction, Score
from microrad.lab.identify.selection.roles import Roles, is_broadband, single_period
from microrad.lab.identify.statistics import colour_inflation
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import BoucWen

_LAGS = 50
_FLIPPED = (
    "The sensor's sign was flipped: its reading falls with the drive, and the mirror that is written rises. Turn the "
    "reading as well before a controller that was designed for this mirror gets it, or it drives the mirror away."
)


def range_warnings(drive_range: tuple[float, float], rate: float) -> list[str]:
    """The drives and rates that the fit has seen.

    Args:
        drive_range: Lowest and highest drive fitted, in V.
        rate: Fastest rate of the drives fitted, in V/s.
    """
    low, high = drive_range
    freq_hz = rate / (math.pi * (high - low))
    digits = max(0, 3 - math.floor(math.log10(high - low)))  # to a thousandth of the range
    return [
        f"Valid for drives from {round(low, digits) + 0.0:g} V to {round(high, digits) + 0.0:g} V; outside that range "
        "the model is an extrapolation.",
        f"Not valid above {plain(rate, 4)} V/s, the fastest rate of the recordings: a sine over the whole drive range "
        f"reaches it at {plain(freq_hz, 4)} Hz.",
    ]


def set_aside_warnings(recordings: Sequence[Recording], predictions: Sequence[Prediction]) -> list[str]:
    """Unseen records of which more than a fifth is not judged, because their drives sweep their range so late.

    Args:
        recordings: The recordings.
        predictions: The model's prediction of each of them.
    """
    return [
        f"{recording.path}: the first {p.start} of {recording.samples} samples are not judged, because what the mirror "
        "remembers from before is not known until the drive has swept its range once; begin a record for validation "
        "with its largest sweep."
        for recording, p in zip(recordings, predictions, strict=True)
        if p.start > 0.2 * recording.samples
    ]


def use_warnings(found: Roles, *, linear: bool) -> list[str]:
    """Broadband recordings that serve for less than they could, and why.

    Args:
        found: The recordings by what they serve for.
        linear: Whether there is a linear part.
    """
    told, loops, response = [], {id(r) for r in found.loops}, {id(r) for r in found.response}
    for r in (r for r in found.broadband if id(r) not in loops):
        if not linear:
            told.append(f"{r.path}: broadband, and fitted by nothing: no model with a linear part was asked for.")
        elif id(r) not in response:
            told.append(
                f"{r.path}: broadband, and fitted by nothing: only recordings at the highest sample rate and of one "
                "period are averaged, periodic ones before chirps."
            )
        elif not is_broadband(r):
            told.append(
                f"{r.path}: broadband as its role says, though its drive does not fill a decade of frequencies: poles "
                "and zeros outside what it fills are not known."
            )
    if linear and single_period(found.response):
        told.append(
            f"{found.response[0].path}: one period only, so it is fitted as a drive that does not repeat; record two "
            "periods, or the same lines with other phases, to tell noise from distortion."
        )
    return told


def depends_on_rate(fit: JointFit) -> bool:
    """Whether a joint model tells fast loops from slow ones, by its hysteresis or by a linear part behind it."""
    return bool({"delta", "widening"} & set(fit.form.free)) or fit.linear is not None


def rate_warnings(records: Sequence[SiRecord], fit: Fit) -> list[str]:
    """What the rates of the loops do not show, and a drive too noisy to have a rate.

    Args:
        records: The fitted parts in SI units.
        fit: The model chosen.
    """
    warnings = []
    slowest, fastest = loop_rates(records)
    if one_rate_only(records):
        warnings.append(
            f"One loop rate only (peaks from {plain(slowest, 4)} V/s to {plain(fastest, 4)} V/s): how the hysteresis "
            "changes with frequency is not known from these recordings, and delta and d2 only describe the shape of "
            "this loop; record the same loop at two more frequencies."
        )
    elif isinstance(fit, PrandtlIshlinskiiFit) or (isinstance(fit, JointFit) and not depends_on_rate(fit)):
        warnings.append(
            f"The loops have peak rates from {plain(slowest, 4)} V/s to {plain(fastest, 4)} V/s, and the model does "
            "not depend on rate: one average loop stands for all."
        )
    if noisiness(records) > 0.2:
        warnings.append(
            f"The drive is noisy: its rate from sample to sample scatters by {100 * noisiness(records):.0f} % of the "
            "fastest rate; use the commanded drive, or filter it, before trusting rate-dependent parameters."
        )
    return warnings


def held_out_warnings(
    recordings: Sequence[Recording], units: Units, drive_range: tuple[float, float], predictions: Sequence[Prediction]
) -> list[str]:
    """Held-out samples beyond the drives that were fitted.

    Args:
        recordings: The recordings.
        units: Units of their drives and outputs.
        drive_range: Lowest and highest drive fitted, in V.
        predictions: The model's prediction of each recording.
    """
    low, high = drive_range
    margin = 0.02 * (high - low)
    outside = 0
    for recording, prediction in zip(recordings, predictions, strict=True):
        held_out = recording.drive[prediction.split :, 0] * units.volts
        outside += int(np.sum((held_out < low - margin) | (held_out > high + margin)))
    if not outside:
        return []
    lie, them = ("sample lies", "it") if outside == 1 else ("samples lie", "them")
    return [f"{outside} held-out {lie} outside the fitted drive range; the held-out residual judges {them} too."]


def score_warnings(score: Score, line: Score) -> list[str]:
    """A model no better than a line, or much worse on what it has not seen.

    Args:
        score: Score of the model.
        line: Score of the straight line.
    """
    warnings = []
    if score.held_out_rms_percent >= line.held_out_rms_percent:
        warnings.append("No model is better than a straight line on the held-out samples: do not use the hysteresis.")
    if score.held_out_rms_percent > 1.5 * score.fit_rms_percent:
        warnings.append(
            f"The residual grows from {score.fit_rms_percent:.2f} % on the fitted samples to "
            f"{score.held_out_rms_percent:.2f} % on the held-out ones: drift, another regime, or too short a record."
        )
    return warnings


def fit_warnings(fit: Fit) -> list[str]:
    """Warnings that belong to one fit, whichever model is chosen."""
    found = []
    if isinstance(fit, JointFit) and not fit.fit.converged:
        found.append(
            f"The search for the parameters stopped after {fit.fit.evaluations} evaluations, before it had settled: "
            "the model is what the scores say, but its standard errors are those of a point that is no minimum."
        )
    if not (isinstance(fit, PrandtlIshlinskiiFit) or fit.admissible):
        found.append(_wrong_way(fit))
    return [*found, _FLIPPED] if fit.falling else found


def _wrong_way(fit: BoucWenFit | JointFit) -> str:
    assert isinstance(fit.model, BoucWen)
    turned = made_rising(fit.model)
    if isinstance(fit, JointFit):
        slope, slow, advice = turned.reversal_slope_rad_v(), "slow ", "a Prandtl-Ishlinskii model never does."
    else:
        slope, slow = min(fit.slope_after_reversal_rad_per_v, fit.lowest_slope_rad_per_v), ""
        advice = "the model bouc_wen_admissible excludes it."
    return (
        f"Not admissible: just after a {slow}reversal the modelled mirror first moves the wrong way "
        f"({1e3 * slope:.3g} mrad/V against d1 = {1e3 * turned.d1_rad_v:.3g} mrad/V); {advice}"
    )


def drift(
    predictions: Sequence[Prediction], recordings: Sequence[Recording], span_rad: float
) -> tuple[float, list[str]]:
    """Largest linear trend of a record's residual over its length (rad), and a warning where it stands out.

    It stands out above three standard errors (noise colour counted) and above 0.2 % of the peak-to-peak output.

    Args:
        predictions: The model's prediction of each recording.
        recordings: The recordings, in the same order.
        span_rad: Peak-to-peak output, in rad.
    """
    largest, warnings = 0.0, []
    for prediction, recording in zip(predictions, recordings, strict=True):
        residual = prediction.residual_rad[prediction.start :]
        time = np.linspace(-0.5, 0.5, residual.size)
        trend = float(time @ residual) / float(time @ time)
        rest = residual - residual.mean() - trend * time
        error = math.sqrt(colour_inflation([rest]) * float(rest @ rest) / rest.size / float(time @ time))
        if abs(trend) > abs(largest):
            largest = trend
        if abs(trend) > max(3 * error, 0.2 / 100 * span_rad):
            warnings.append(
                f"{recording.path}: the residual drifts by {1e6 * trend:.3g} ± {1e6 * error:.2g} urad "
                f"({100 * trend / span_rad:.2g} % of the peak-to-peak output) in "
                f"{plain(residual.size * recording.step_s)} s: creep beyond what the model holds, or a warming sensor."
            )
    return largest, warnings


# ---------------------------------------------------------------------------------------------------------- residuals
@dataclass(frozen=True)
class ResidualTest:
    """Whether a residual still holds something that a model could have described.

    `autocorrelation` (lags 1 to 50 of the residual) and `cross_correlation` (lags 0 to 50 of the whitened residual
    behind the equally whitened drive) are correlation coefficients; of a residual that is noise 95 % lie within
    `bound`. `white` and `independent` say whether at most 10 % lie outside it.
    """

    samples: int
    bound: float
    autocorrelation: Floats
    cross_correlation: Floats

    @property
    def outside(self) -> tuple[float, float]:
        """Shares of the two correlations outside the bound."""
        return (
            float(np.mean(np.abs(self.autocorrelation) > self.bound)),
            float(np.mean(np.abs(self.cross_correlation) > self.bound)),
        )

    @property
    def white(self) -> bool:
        """Whether neighbouring samples of the residual have nothing to do with each other."""
        return self.outside[0] <= 0.1

    @property
    def independent(self) -> bool:
        """Whether the residual has nothing to do with the drive."""
        return self.outside[1] <= 0.1


def residual_test(residual: Floats, drive: Floats) -> ResidualTest:
    """Whiteness of a residual and its correlation with the drive (Ljung, System Identification, 1999, sec. 16.6).

    For the cross-correlation both are whitened by an autoregression (order 20) of the residual, so that the bound
    1.96 / sqrt(samples) holds although neither is white.

    Args:
        residual: Measured less predicted output, shape (samples,), in any unit.
        drive: Drive, shape (samples,), in any unit.
    """
    n, order = residual.size, min(20, residual.size // 20)
    centred = residual - residual.mean()
    bound = 1.96 / math.sqrt(n)
    auto = _correlations(centred, centred, _LAGS)[1:]
    whitener = _autoregression(centred, order)
    white, input_ = (np.convolve(x, whitener, mode="valid") for x in (centred, drive - drive.mean()))
    return ResidualTest(n, bound, auto, _correlations(white, input_, _LAGS))


def _correlations(a: Floats, b: Floats, lags: int) -> Floats:
    """Correlation coefficients of a with b, k samples earlier, for k from 0."""
    size = math.sqrt(float(a @ a) * float(b @ b)) + 1e-300
    last = min(lags, a.size - 1)
    return np.array([float(a[k:] @ b[: b.size - k]) / size for k in range(last + 1)])


def _autoregression(x: Floats, order: int) -> Floats:
    """Coefficients (1, a1, ...) that whiten x, by Yule and Walker."""
    from scipy.linalg import solve_toeplitz

    r = np.array([float(x[k:] @ x[: x.size - k]) for k in range(order + 1)])
    if r[0] <= 0.0:
        return np.concatenate([[1.0], np.zeros(order)])
    r[0] *= 1.0 + 1e-9
    return np.concatenate([[1.0], -solve_toeplitz(r[:-1], r[1:])])


def residual_warnings(test: ResidualTest) -> list[str]:
    """What the residual of the chosen model says about it."""
    found = []
    if not test.white:
        found.append(
            f"The residual on the held-out samples is not white: {100 * test.outside[0]:.0f} % of its correlations "
            f"over {test.autocorrelation.size} samples lie outside ± {test.bound:.2g} (5 % would be noise). "
            "Standard errors count that; what is left is dynamics, hysteresis or disturbance outside the model."
        )
    if not test.independent:
        found.append(
            f"The residual follows the drive: {100 * test.outside[1]:.0f} % of the cross-correlations lie outside "
            f"± {test.bound:.2g} (5 % would be noise), so a better model of these recordings exists."
        )
    return found
