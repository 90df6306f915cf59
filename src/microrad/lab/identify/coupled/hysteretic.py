"""Hysteretic stiffness as a candidate: one mirror for all amplitudes, begun from a linear model of the ladder."""

from collections.abc import Sequence

import numpy as np

from microrad.core.progress import Progress
from microrad.lab.identify.coupled.linear import STEPS, Fitted
from microrad.lab.identify.coupled.linear_errors import known
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness.fit import StiffnessOptions, fit_hysteretic_stiffness
from microrad.lab.identify.stiffness.model import LinearStart
from microrad.lab.recording import Recording

FEW, ALL = 15, 10
"""Steps on one record of each amplitude, then on all; benchmarks/cubespec_one_model.py says what more would gain."""


def hysteretic_stiffness(records: Sequence[Recording], start: Fitted | None, on_progress: Progress) -> Fitted:
    """A mirror with hysteretic stiffness, see `fit_hysteretic_stiffness`.

    Args:
        records: Multisines of at least two amplitudes, in SI units.
        start: The coupled linear model to begin with; None where there is none.
        on_progress: Called with the steps done, their largest number, and the error.

    Raises:
        IdentificationError: Where the records cannot tell hysteresis.
    """
    if start is None or start.modes is None:
        raise IdentificationError("there is no coupled linear model of this order to begin with.")
    options = StiffnessOptions(sub_steps=STEPS, few_first=FEW)
    began = LinearStart(start.modes, start.delay_s)
    fit = fit_hysteretic_stiffness(records, options=options, iterations=ALL, start=began, on_progress=on_progress)
    return Fitted(
        name=f"hysteretic stiffness, order {fit.order}",
        kind="hysteretic stiffness",
        order=fit.order,
        parameters=fit.parameters - fit.redundant,
        mirror=fit.mirror,
        delay_s=fit.delay_s,
        poles_rad_s=fit.poles_rad_s,
        poles_error_rad_s=np.asarray(fit.poles_error_rad_s, dtype=np.complex128),
        delay_error_s=fit.delay_error_s,
        known=None if fit.moved is None else known(fit.names, fit.moved),
        note=_note(fit.converged, fit.iterations),
    )


def _note(converged: bool, steps: int) -> str:
    return "" if converged else f"the search was ended before its optimum, after {steps} steps on all records"
