"""Recordings of a mirror to a mirror model with its uncertainty.

`identify` runs the whole ladder: frequency response, linear part, hysteresis and creep, alone and together, judged on
samples that no fit has seen; `mirror_file_text` writes the result for a mission. Inside, drives are in volts and
outputs in radians. Its steps stand alone too, for any number of inputs and outputs and in any units:
`response_from_records` and `response_from_periods`, `vector_fit`, `fit_linear`, and `fit_plant` for a `Structure` of
your own.
"""

from microrad.lab.identify.amplitude import AmplitudeDependence, amplitude_dependence
from microrad.lab.identify.bouc_wen import PARAMETERS, BoucWenFit, NotIdentified, fit_bouc_wen
from microrad.lab.identify.choice import MODELS, STATIC, Identification, Refused, Source, identify
from microrad.lab.identify.joint import FORMS, JointFit, fit_joint
from microrad.lab.identify.linear import LinearFit, OrderScore, fit_linear, output_error
from microrad.lab.identify.mirror_text import mirror_file_text
from microrad.lab.identify.plant_fit import Parameter, PlantFit, Structure, fit_plant, runs
from microrad.lab.identify.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.lab.identify.predictions import Prediction, Score, predict
from microrad.lab.identify.records import IdentificationError, Units
from microrad.lab.identify.response import FrequencyResponse, response_from_periods, response_from_records
from microrad.lab.identify.stiffness import (
    HystereticStiffnessFit,
    StiffnessOptions,
    fit_hysteretic_stiffness,
    predicted_error,
    simulate_hysteretic_stiffness,
)
from microrad.lab.identify.vector_fitting import VectorFit, vector_fit

__all__ = [
    "FORMS",
    "MODELS",
    "PARAMETERS",
    "STATIC",
    "AmplitudeDependence",
    "BoucWenFit",
    "FrequencyResponse",
    "HystereticStiffnessFit",
    "Identification",
    "IdentificationError",
    "JointFit",
    "LinearFit",
    "NotIdentified",
    "OrderScore",
    "Parameter",
    "PlantFit",
    "PrandtlIshlinskiiFit",
    "Prediction",
    "Refused",
    "Score",
    "Source",
    "StiffnessOptions",
    "Structure",
    "Units",
    "VectorFit",
    "amplitude_dependence",
    "fit_bouc_wen",
    "fit_hysteretic_stiffness",
    "fit_joint",
    "fit_linear",
    "fit_plant",
    "fit_prandtl_ishlinskii",
    "identify",
    "mirror_file_text",
    "output_error",
    "predict",
    "predicted_error",
    "response_from_periods",
    "response_from_records",
    "runs",
    "simulate_hysteretic_stiffness",
    "vector_fit",
]
