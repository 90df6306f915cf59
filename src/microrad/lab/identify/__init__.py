"""Recordings of a mirror to a mirror model with its uncertainty.

`identify` fits all models and chooses one of them (`selection`), by samples that no fit has seen; `mirror_file_text`
writes it for a mission. Drives are in volts there and outputs in radians. The steps stand alone too: `linear` for the
linear part and `stiffness` for hysteretic stiffness, both for any number of inputs and outputs and in any units, and
`hysteresis` for the hysteresis of one axis. `fit_frequency_response` takes the table of a response in place of
recordings.
"""

from microrad.lab.identify.hysteresis.alone import HysteresisFit, fit_hysteresis
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, fit_bouc_wen
from microrad.lab.identify.hysteresis.joint import FORMS, JointFit, fit_joint
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.lab.identify.linear.fit import fit_linear, output_error
from microrad.lab.identify.linear.frequency_fit import FrequencyResponseFit, fit_frequency_response
from microrad.lab.identify.linear.response import (
    FrequencyResponse,
    measure_frequency_response,
    response_from_records,
)
from microrad.lab.identify.linear.vector_fitting import vector_fit
from microrad.lab.identify.mirror_file import mirror_file_text
from microrad.lab.identify.records import IdentificationError, Units
from microrad.lab.identify.selection.candidates import MODELS, STATIC, Refused
from microrad.lab.identify.selection.choice import Identification, identify
from microrad.lab.identify.selection.predictions import Score, predict
from microrad.lab.identify.stiffness.fit import fit_hysteretic_stiffness, predicted_error

__all__ = [
    "FORMS",
    "MODELS",
    "STATIC",
    "BoucWenFit",
    "FrequencyResponse",
    "FrequencyResponseFit",
    "HysteresisFit",
    "Identification",
    "IdentificationError",
    "JointFit",
    "PrandtlIshlinskiiFit",
    "Refused",
    "Score",
    "Units",
    "fit_bouc_wen",
    "fit_frequency_response",
    "fit_hysteresis",
    "fit_hysteretic_stiffness",
    "fit_joint",
    "fit_linear",
    "fit_prandtl_ishlinskii",
    "identify",
    "measure_frequency_response",
    "mirror_file_text",
    "output_error",
    "predict",
    "predicted_error",
    "response_from_records",
    "vector_fit",
]
