"""A hysteresis model with its errors from recordings, by itself: no linear part, no choice between models."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.lab.identify.hysteresis.bouc_wen import PARAMETERS, BoucWenFit, fit_bouc_wen
from microrad.lab.identify.hysteresis.joint import FORMS, JointFit, fit_joint
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.lab.identify.records import ANGLES, IdentificationError, Units
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii

STATIC_FORMS = ("bouc_wen", "prandtl_ishlinskii", *(name for name, form in FORMS.items() if not form.needs_linear))
"""What `fit_hysteresis` can fit: Eq. 3, play operators, and the forms of `FORMS` that stand without a linear part."""


@dataclass(frozen=True, eq=False)
class HysteresisFit:
    """A hysteresis model of one axis in volts and radians, with what is known of its numbers.

    `model` and `creep` count the drive from `bias_v`, the mean of the drives that the recordings begin with. `values`
    and `standard_errors` are by the name of the parameter; an error is nan where a bound holds the value. The errors
    come from what is left of the recordings, its colour counted. `not_identified` has the parameters that the
    recordings do not fix, each with the reason. `residual_rms_percent` is of the peak-to-peak output, and
    `rate_limit_v_s` the fastest rate that the recordings have.
    """

    name: str
    model: BoucWen | PrandtlIshlinskii
    creep: Creep
    bias_v: float
    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    not_identified: tuple[tuple[str, str], ...]
    residual_rms_percent: float
    rate_limit_v_s: float
    samples: int

    @property
    def admissible(self) -> bool:
        """Whether the model never moves against its drive behind a reversal."""
        return self.model.admissible

    def response(self, drive_v: ArrayLike, step_s: float) -> Floats:
        """Output (rad), shape (samples,), creep included, from rest at the bias.

        Args:
            drive_v: Drive as in the recordings (V), shape (samples,).
            step_s: Time between samples (s).

        Raises:
            ValueError: For a drive of another shape or with a number that is not finite, and a step not above 0.
        """
        drive = np.asarray(drive_v, dtype=float) - self.bias_v
        return self.model.response(drive, step_s) + self.creep.response(drive, step_s)


def fit_hysteresis(
    recordings: Recording | Sequence[Recording],
    model: str = "bouc_wen",
    *,
    output_unit: str,
    input_unit: str = "V",
    admissible: bool = False,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> HysteresisFit:
    """Fit one hysteresis model to recordings of loops of one axis, slow beside the resonance of the mirror.

    Args:
        recordings: One recording, or several that are fitted together, each of one drive and one output.
        model: "bouc_wen" (Eq. 3 of SPIE 11852, 118523B), "bouc_wen_classical" (with an exponent, rate-independent),
            "bouc_wen_asymmetric", "prandtl_ishlinskii", "prandtl_ishlinskii_rate" (thresholds widen with the rate), and
            with creep "bouc_wen_creep", "prandtl_ishlinskii_creep" and "prandtl_ishlinskii_rate_creep".
        output_unit: Unit of the output: rad, mrad or urad.
        input_unit: Unit of the drive: V or mV.
        admissible: Whether a Bouc-Wen model is kept from moving against its drive behind a reversal.
        seed: Seed of the scattered starts of a Bouc-Wen fit.
        on_progress: Called with the starts done, their number and what is done.

    Raises:
        IdentificationError: For a model that is none of these, and for recordings that cannot be used; says why.

    Example:
        ```python
        import numpy as np
        import microrad

        time_s = np.arange(6000) * 1e-4
        drive_v = 5.0 * np.sin(2 * np.pi * 10 * time_s) * np.linspace(0.2, 1.0, 6000)
        truth = microrad.PrandtlIshlinskii((0.0, 1.0, 2.0), (40e-6, 6e-6, 4e-6))
        output_rad = truth.response(drive_v, 1e-4) + 1e-7 * np.random.default_rng(1).standard_normal(6000)
        recording = microrad.recording_from_arrays(drive_v, output_rad, rate_hz=10e3)
        fit = microrad.fit_hysteresis(recording, "prandtl_ishlinskii", output_unit="rad")
        print(fit.residual_rms_percent, fit.model.inverse([0.0, 1e-4], 1e-4))
        ```
    """
    if model not in STATIC_FORMS:
        raise IdentificationError(f"no hysteresis model is called '{model}'; there are {', '.join(STATIC_FORMS)}.")
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if output_unit not in ANGLES:
        raise IdentificationError(
            f"the output unit is '{output_unit}'; use an angle ({', '.join(ANGLES)}): a displacement over its lever "
            "arm is one."
        )
    units = Units(input_unit, output_unit)
    fit: PrandtlIshlinskiiFit | BoucWenFit | JointFit
    if model == "prandtl_ishlinskii":
        fit = fit_prandtl_ishlinskii(several, units=units)
        names: Sequence[str] = [f"weight at {threshold:.4g} V" for threshold in fit.thresholds_v]
        values, errors = fit.sign * fit.weights_rad_per_v, fit.standard_errors_rad_per_v
    elif model == "bouc_wen":
        fit = fit_bouc_wen(several, seed=seed, admissible=admissible, on_progress=on_progress, units=units)
        names, values, errors = PARAMETERS, fit.values, fit.standard_errors
    else:
        fit = fit_joint(several, model, units, admissible=admissible, seed=seed, on_progress=on_progress)
        names = [p.name for p in fit.structure.parameters]
        values, errors = fit.fit.values, fit.fit.standard_errors
    bias_v = float(np.mean([r.drive[0, 0] for r in several])) * units.volts
    own = fit.model
    return HysteresisFit(
        name=fit.name,
        model=own if isinstance(own, PrandtlIshlinskii) else replace(own, bias_v=bias_v),
        creep=fit.creep if isinstance(fit, JointFit) else NO_CREEP,
        bias_v=bias_v,
        values=dict(zip(names, values.tolist(), strict=True)),
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
        not_identified=tuple((name, reason) for name, reason in fit.not_identified),
        residual_rms_percent=fit.residual_rms_percent,
        rate_limit_v_s=fit.rate_limit_v_per_s,
        samples=fit.samples_used,
    )
