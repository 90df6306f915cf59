"""Receivers of a laser link, each one modulation with one detector."""

from microrad.link.receivers.base import Receiver
from microrad.link.receivers.counting import OokCounting, PpmCounting
from microrad.link.receivers.currents import OokApd, OokPin, OokPreamplified
from microrad.link.receivers.fields_of_light import BpskHomodyne, DpskPreamplified
from microrad.link.receivers.light import (
    apd_excess_noise_factor,
    background_photons_per_mode,
    background_power_w,
    optical_bandwidth_hz,
)

__all__ = [
    "BpskHomodyne",
    "DpskPreamplified",
    "OokApd",
    "OokCounting",
    "OokPin",
    "OokPreamplified",
    "PpmCounting",
    "Receiver",
    "apd_excess_noise_factor",
    "background_photons_per_mode",
    "background_power_w",
    "optical_bandwidth_hz",
]
