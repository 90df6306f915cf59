"""Receivers of a laser link, each one modulation with one detector."""

from microrad.link.receivers.base import (
    RateError,
    Receiver,
    apd_excess_noise_factor,
    background_photons_per_mode,
    background_power_w,
)
from microrad.link.receivers.coherent import (
    BpskHeterodyne,
    BpskHomodyne,
    DpskPreamplified,
    QpskHeterodyne,
    QpskHomodyne,
)
from microrad.link.receivers.counting import OokCounting, PpmCounting
from microrad.link.receivers.photocurrent import OokApd, OokPin, OokPreamplified

__all__ = [
    "BpskHeterodyne",
    "BpskHomodyne",
    "DpskPreamplified",
    "OokApd",
    "OokCounting",
    "OokPin",
    "OokPreamplified",
    "PpmCounting",
    "QpskHeterodyne",
    "QpskHomodyne",
    "RateError",
    "Receiver",
    "apd_excess_noise_factor",
    "background_photons_per_mode",
    "background_power_w",
]
