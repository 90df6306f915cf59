"""Recordings of a mirror to a mirror model with its uncertainty.

`identify` runs the whole ladder: frequency response, linear part, hysteresis and creep, alone and together, judged on
samples that no fit has seen; `mirror_file_text` writes the result for a mission. Inside, drives are in volts and
outputs in radians. Its steps stand alone too, for any number of inputs and outputs and in any units: see the folders
`linear`, `hysteresis` and `stiffness`.
"""

from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, fit_bouc_wen
from microrad.lab.identify.hysteresis.joint import FORMS, JointFit, fit_joint
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.lab.identify.linear.fit import fit_linear, output_error
from microrad.lab.identify.linear.response import response_from_records
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
    "Identification",
    "IdentificationError",
    "JointFit",
    "PrandtlIshlinskiiFit",
    "Refused",
    "Score",
    "Units",
    "fit_bouc_wen",
    "fit_hysteretic_stiffness",
    "fit_joint",
    "fit_linear",
    "fit_prandtl_ishlinskii",
    "identify",
    "mirror_file_text",
    "output_error",
    "predict",
    "predicted_error",
    "response_from_records",
    "vector_fit",
]
