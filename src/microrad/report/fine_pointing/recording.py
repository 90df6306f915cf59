"""A recording as a disturbance of the loop: what it is, what was fitted, and what the loop leaves of both."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from microrad.core.units import format_quantity
from microrad.loop.disturbance.recorded_fit import FITTED, RecordedFit
from microrad.loop.pointing_loop.loop import PointingLoop
from microrad.loop.pointing_loop.played import AGREEMENT, RecordedResidual
from microrad.report.data import fields
from microrad.report.fine_pointing.words import arrival, listed
from microrad.report.quantities import angle, micro, minus, percent
from microrad.report.tables import Table, tables_text

_RADIAL = "played_rms_rad", "fitted_rms_rad", "sensors_rms_rad", "simulated_rms_rad"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedAxis:
    """One axis of a recording: what was fitted to it, and what the loop leaves."""

    fit: RecordedFit
    left: RecordedResidual


def recording_text(path: str, axes: Sequence[RecordedAxis], loop: PointingLoop, controller: str, width: int) -> str:
    """Tables and sentences for a terminal.

    Args:
        path: The file of the recording.
        axes: Its axes.
        loop: The loop of one axis.
        controller: Name of the loop's controller.
        width: Columns of the terminal.
    """
    first = axes[0].fit.motion
    duration, rate = format_quantity(first.duration_s, "s"), format_quantity(2.0 * first.half_rate_hz, "Hz")
    own = ["vibration", "wheels", *(["angle of arrival"] if arrival(loop) else []), "body"]
    about = (
        f"Recording {path}: {duration} at {rate}, each channel one axis, in place of the mission's {listed(own)}. "
        "Angles in µrad rms, drift in µrad/s."
    )
    tables = [_motions(axes), _fits(axes), _left(axes, controller)]
    return f"{tables_text([], [about], width).strip()}\n\n{tables_text(tables, sentences(axes, loop), width).strip()}"


def _motions(axes: Sequence[RecordedAxis]) -> Table:
    rows = []
    for each in axes:
        m, d = each.fit.motion, each.fit.disturbance
        lines = "\n".join(f"{format_quantity(x.freq_hz, 'Hz', 5)}: {micro(x.amplitude_rad)}" for x in d.lines)
        moving = math.sqrt(float(m.rest_rad @ m.rest_rad) / m.rest_rad.size)
        rows.append((m.name, micro(m.mean_rad), micro(m.slope_rad_s), micro(moving), lines or "none"))
    return Table("Recorded", ("axis", "mean", "drift", "rest", "lines, amplitude"), rows, (0, 4))


def _fits(axes: Sequence[RecordedAxis]) -> Table:
    rows = []
    for each in axes:
        fit = each.fit
        white = f"{'yes' if fit.whiteness.white else 'no'}, p = {fit.whiteness.p_value:.2g}"
        steady = "yes" if fit.stationarity.stationary else "no"
        rows.append((fit.motion.name, f"{fit.order}", minus(f"{fit.worst_db:+.2f} dB"), white, steady))
    return Table("Fitted", ("axis", "states", "worst", "white residual", "stationary"), rows, (0, 3, 4))


def _left(axes: Sequence[RecordedAxis], controller: str) -> Table:
    rows = []
    for each in axes:
        left, p = each.left, each.left.played
        figures = (micro(p.rms_rad), micro(left.fitted_rms_rad), percent(left.difference))
        more = (left.simulated_rms_rad, p.mean_rad, left.noise_rms_rad)
        rows.append((each.fit.motion.name, *figures, *map(micro, more)))
    if len(axes) == 2:
        played, fitted, noise, simulated = _radial(axes)
        off = percent(played / fitted - 1.0)
        rows.append(("radial", micro(played), micro(fitted), off, micro(simulated), "", micro(noise)))
    headings = ("axis", "played", "fitted", "off by", "simulated", "mean", "sensors")
    return Table(f"Left by the loop under {controller}", headings, rows, totals=len(axes) == 2)


def _radial(axes: Sequence[RecordedAxis]) -> tuple[float, float, float, float]:
    """Rms of two axes together: played, fitted, of the sensors' noise, and simulated."""
    left = [each.left for each in axes]
    return (
        math.hypot(*(each.played.rms_rad for each in left)),
        math.hypot(*(each.fitted_rms_rad for each in left)),
        math.hypot(*(each.noise_rms_rad for each in left)),
        math.hypot(*(each.simulated_rms_rad for each in left)),
    )


def sentences(axes: Sequence[RecordedAxis], loop: PointingLoop) -> list[str]:
    """What is left out, what cannot be believed, and whether both residuals agree.

    Args:
        axes: The axes of a recording.
        loop: The loop of one axis.
    """
    motion, played, step = axes[0].fit.motion, axes[0].left.played, loop.timing.step_s
    said = [
        f"Played from {format_quantity(played.begin_s, 's')} to {format_quantity(played.end_s, 's')} of the recording, "
        "mean and drift with it, through the linear loop from rest; fitted by covariance, exactly; simulated on the "
        "mission's mirror with its hysteresis, limits and quantisation. All about their mean; what the sensors add "
        "stands beside them."
    ]
    if motion.half_rate_hz < 0.5 / loop.timing.period_s:
        said.append(
            f"Warning: the recording ends at {format_quantity(motion.half_rate_hz, 'Hz')}, and the loop reads up to "
            f"{format_quantity(0.5 / loop.timing.period_s, 'Hz')}: faster motion is not played, and the fit only "
            "goes on as it ended. Record faster."
        )
    for each in axes:
        said += _of_axis(each, step)
    return said


def _of_axis(each: RecordedAxis, step_s: float) -> list[str]:
    fit, left, name = each.fit, each.left, each.fit.motion.name
    said = []
    if left.beyond_loop_rad > 0.0:
        half = format_quantity(0.5 / step_s, "Hz")
        said.append(f"{name}: {angle(left.beyond_loop_rad)} above {half}, half of the plant's rate, are cut off.")
    if not fit.whiteness.white:
        said.append(
            f"{name}: the one-step-ahead residual of the fit is not white below "
            f"{format_quantity(FITTED * fit.motion.half_rate_hz, 'Hz')} (largest autocorrelation "
            f"{fit.whiteness.largest:.2g}): the spectrum has more in it than the fit."
        )
    if not fit.stationarity.stationary:
        said.append(
            f"{name}: not stationary, {fit.stationarity.reason}. A spectrum is its average; in the loudest eighth the "
            f"loop leaves {angle(left.played.most_rms_rad)}."
        )
    if left.reason:
        said.append(f"{name}: played and fitted differ by {percent(left.difference)}: {left.reason}.")
    else:
        said.append(f"{name}: played and fitted agree within {percent(AGREEMENT)}.")
    return said


def recording_data(path: str, sha256: str, axes: Sequence[RecordedAxis], loop: PointingLoop) -> dict[str, Any]:
    """The same as data, in SI units.

    Args:
        path: The file of the recording.
        sha256: Digest of its bytes.
        axes: Its axes.
        loop: The loop of one axis.
    """
    motion = axes[0].fit.motion
    found: dict[str, Any] = {
        "file": path,
        "sha256": sha256,
        "rate_hz": 2.0 * motion.half_rate_hz,
        "duration_s": motion.duration_s,
        "axes": [_axis_data(each) for each in axes],
        "sentences": sentences(axes, loop),
    }
    if len(axes) == 2:
        found["radial"] = dict(zip(_RADIAL, _radial(axes), strict=True))
    return found


def _axis_data(each: RecordedAxis) -> dict[str, Any]:
    fit, left, motion = each.fit, each.left, each.fit.motion
    tests = fit.stationarity
    block = ("ratio", "usual", "ratio_p", "growth", "growth_p")
    return {
        **fields(motion, "name", "mean_rad", "slope_rad_s"),
        "rms_rad": math.sqrt(float(motion.rest_rad @ motion.rest_rad) / motion.rest_rad.size),
        "lines": [{"frequency_hz": x.freq_hz, "amplitude_rad": x.amplitude_rad} for x in fit.disturbance.lines],
        **fields(fit, "order", "band_limited", "worst_db", "worst_at_hz", "correlation_s"),
        "whiteness": {"white": fit.whiteness.white, **fields(fit.whiteness, "lags", "statistic", "p_value", "largest")},
        "stationarity": {
            **fields(tests, "stationary", "reason"),
            "motion": fields(tests.motion, *block),
            "fast_part": fields(tests.fast, *block),
        },
        "left": {
            **fields(left.played, "begin_s", "end_s", "mean_rad"),
            "played_rms_rad": left.played.rms_rad,
            "quietest_eighth_rms_rad": left.played.least_rms_rad,
            "loudest_eighth_rms_rad": left.played.most_rms_rad,
            "fitted_rms_rad": left.fitted_rms_rad,
            "simulated_rms_rad": left.simulated_rms_rad,
            "sensors_rms_rad": left.noise_rms_rad,
            "cut_off_rms_rad": left.beyond_loop_rad,
            **fields(left, "difference", "reason"),
        },
    }
