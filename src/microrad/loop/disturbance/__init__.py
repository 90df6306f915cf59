"""Disturbances of the line of sight: one-sided spectra as data, shaping filters that realise them, references."""

from microrad.loop.disturbance.arrival import ANGLE_OF_ARRIVAL, Arrival, angle_of_arrival
from microrad.loop.disturbance.discrete import Discrete, discretise, initial_state
from microrad.loop.disturbance.fits import fit_bands, fit_spectrum, fit_table
from microrad.loop.disturbance.records import (
    Disturbance,
    SpectralLine,
    band_rms,
    combine,
    one_input,
    psd,
)
from microrad.loop.disturbance.reference import NO_REFERENCE, Misalignment, Reference, SampledReference
from microrad.loop.disturbance.sources import (
    MICIUS_EDGES_HZ,
    MICIUS_RMS_RAD,
    body_pointing,
    first_order,
    olympus,
    wheels,
)
from microrad.loop.disturbance.tables import read_table

__all__ = [
    "ANGLE_OF_ARRIVAL",
    "MICIUS_EDGES_HZ",
    "MICIUS_RMS_RAD",
    "NO_REFERENCE",
    "Arrival",
    "Discrete",
    "Disturbance",
    "Misalignment",
    "Reference",
    "SampledReference",
    "SpectralLine",
    "angle_of_arrival",
    "band_rms",
    "body_pointing",
    "combine",
    "discretise",
    "first_order",
    "fit_bands",
    "fit_spectrum",
    "fit_table",
    "initial_state",
    "olympus",
    "one_input",
    "psd",
    "read_table",
    "wheels",
]
