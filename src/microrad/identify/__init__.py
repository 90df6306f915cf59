"""Recordings of a mirror to a mirror model with its uncertainty.

`identify` fits both hysteresis families and judges them on held-out samples; `fit_bouc_wen` and
`fit_prandtl_ishlinskii` do one each; `mirror_file_text` writes the result for a mission. Inside, drives are in volts
and outputs in radians.
"""

from microrad.identify.bouc_wen import PARAMETERS, BoucWenFit, NotIdentified, fit_bouc_wen
from microrad.identify.choice import MODELS, Identification, Prediction, Score, Source, identify, predict
from microrad.identify.mirror_text import mirror_file_text
from microrad.identify.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.identify.records import IdentificationError, Units

__all__ = [
    "MODELS",
    "PARAMETERS",
    "BoucWenFit",
    "Identification",
    "IdentificationError",
    "NotIdentified",
    "PrandtlIshlinskiiFit",
    "Prediction",
    "Score",
    "Source",
    "Units",
    "fit_bouc_wen",
    "fit_prandtl_ishlinskii",
    "identify",
    "mirror_file_text",
    "predict",
]
