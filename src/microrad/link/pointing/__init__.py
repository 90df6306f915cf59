"""Pointing: the budget of the open-loop errors, by every rule that a reviewer asks for; what jitter does to a link.

`outage` has the margin and the outage of a communication link under any distribution of errors, `statistics` the closed
forms for a Gaussian beam, `fading` how long and how often a link fades.
"""

from microrad.link.pointing.fading import (
    MovingEnd,
    NoPowerError,
    SpectralMotion,
    fades,
    fades_of_both,
    motion_of_spectrum,
    penalty_db,
    uncoded_penalty_db,
)
from microrad.link.pointing.open_loop import OpenLoopPointing, open_loop_budget
from microrad.link.pointing.statistics import (
    BestDivergence,
    best_divergence_for_outage,
    best_divergence_for_static_error,
    mean_loss_db,
    outage_loss_db,
)
from microrad.link.pointing.summation import Allocation
from microrad.link.radial_error import Jitter, radial_cdf, radial_quantile, radial_survival
from microrad.mission.tables.pointing import point_ahead_rad

__all__ = [
    "Allocation",
    "BestDivergence",
    "Jitter",
    "MovingEnd",
    "NoPowerError",
    "OpenLoopPointing",
    "SpectralMotion",
    "best_divergence_for_outage",
    "best_divergence_for_static_error",
    "fades",
    "fades_of_both",
    "mean_loss_db",
    "motion_of_spectrum",
    "open_loop_budget",
    "outage_loss_db",
    "penalty_db",
    "point_ahead_rad",
    "radial_cdf",
    "radial_quantile",
    "radial_survival",
    "uncoded_penalty_db",
]
