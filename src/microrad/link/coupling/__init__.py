"""Light at the receiver: the share that a fibre or a detector takes of it, and what pointing errors cost there."""

from microrad.link.coupling.ends import (
    Disk,
    End,
    SingleModeFibre,
    best_truncation,
    narrowed,
    truncation_of_mode,
    turbulent_share,
)
from microrad.link.coupling.losses import BothEnds, Losses, of_beam, of_jitter, of_radii
from microrad.link.coupling.pupil import Aberrations, Pupil

__all__ = [
    "Aberrations",
    "BothEnds",
    "Disk",
    "End",
    "Losses",
    "Pupil",
    "SingleModeFibre",
    "best_truncation",
    "narrowed",
    "of_beam",
    "of_jitter",
    "of_radii",
    "truncation_of_mode",
    "turbulent_share",
]
