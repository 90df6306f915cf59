"""Pointing: the budget of the open-loop errors, by every rule that a reviewer asks for; what jitter does to a link."""

from microrad.link.pointing.allocation import Allocation, allocate
from microrad.link.pointing.error_classes import ErrorTerm, StatedError, basis, error_term
from microrad.link.pointing.fading import (
    NoPowerError,
    SpectralMotion,
    fades,
    level_crossing_rate_hz,
    motion_of_spectrum,
    uncoded_penalty_db,
)
from microrad.link.pointing.open_loop import INTERPRETATIONS, OpenLoopPointing, open_loop_budget
from microrad.link.pointing.point_ahead import point_ahead
from microrad.link.pointing.radial_error import Jitter, radial_cdf, radial_quantile, radial_survival
from microrad.link.pointing.statistics import (
    BestDivergence,
    best_divergence_for_outage,
    best_divergence_for_static_error,
    mean_loss_db,
    mean_transmission,
    outage_loss_db,
    outage_probability,
)
from microrad.link.pointing.summation import (
    TOTALS,
    axis_totals_rad,
    esa_1993_rad,
    exact_total_rad,
    mean_and_sigma,
    radial_total_rad,
    rayleigh_caveat,
    rayleigh_total_rad,
    rss_caveat,
    rss_rad,
    shape_caveat,
    sigma_multiple,
    summations,
)
from microrad.mission.tables.pointing import point_ahead_rad

__all__ = [
    "INTERPRETATIONS",
    "TOTALS",
    "Allocation",
    "BestDivergence",
    "ErrorTerm",
    "Jitter",
    "NoPowerError",
    "OpenLoopPointing",
    "SpectralMotion",
    "StatedError",
    "allocate",
    "axis_totals_rad",
    "basis",
    "best_divergence_for_outage",
    "best_divergence_for_static_error",
    "error_term",
    "esa_1993_rad",
    "exact_total_rad",
    "fades",
    "level_crossing_rate_hz",
    "mean_and_sigma",
    "mean_loss_db",
    "mean_transmission",
    "motion_of_spectrum",
    "open_loop_budget",
    "outage_loss_db",
    "outage_probability",
    "point_ahead",
    "point_ahead_rad",
    "radial_cdf",
    "radial_quantile",
    "radial_survival",
    "radial_total_rad",
    "rayleigh_caveat",
    "rayleigh_total_rad",
    "rss_caveat",
    "rss_rad",
    "shape_caveat",
    "sigma_multiple",
    "summations",
    "uncoded_penalty_db",
]
