"""What follows from a link budget: margin over rate and pointing, the largest of either, receivers that it implies."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link import gains
from microrad.link.budget.assembly import (
    SLOWEST_BIT_S,
    DataLink,
    LinkError,
    assembled,
    at_elevation,
    check_grid,
    rate_at_power,
    required_dbm,
    strehl_db,
)
from microrad.link.budget.lines import CHOSEN, given_or_own
from microrad.link.receivers import BpskHomodyne, DpskPreamplified, OokCounting
from microrad.mission.model import Source, source_text
from microrad.mission.tables.link import Communication

BIT_ERROR_RATIO = 1e-9
"""Bit error ratio at which ideal receivers are compared."""

_ELEVATIONS = 17  # at which the air is looked at, from the zenith to that of the budget

QUANTUM_LIMIT_DB = 10.0 * math.log10(2.0)
"""Noise figure of an ideal phase-insensitive amplifier at high gain."""


def received_on_axis_dbm(data: DataLink, strehl_loss_db: float | None = None) -> float:
    """Received power (dBm) of the communication link pointed without error, all other losses included.

    Args:
        data: The communication link.
        strehl_loss_db: Loss by wavefront error in dB, positive; by default that of the mission.
    """
    beam, terminals = data.table, data.shared.terminals
    losses = (
        beam.transmit_optics_loss_db
        + beam.receive_optics_loss_db
        + beam.tracking_split_loss_db
        + beam.implementation_loss_db
        + (0.0 if beam.receiver is None else beam.receiver.inter_symbol_loss_db or 0.0)
        + (strehl_db(beam, data.shared.conventions.strehl) if strehl_loss_db is None else strehl_loss_db)
        + gains.free_space_loss_db(data.range_m, beam.wavelength_m)
        + data.air_db
        + gains.obscuration_loss_db(terminals.geo_obscuration or 0.0)
        + data.coupling_db
    )
    receiving = gains.aperture_gain_db(terminals.geo_aperture_m, beam.wavelength_m)
    return gains.dbm(beam.transmit_power_w) + data.beam.gain_db + receiving - losses


def farther_db(data: DataLink, range_m: ArrayLike) -> Floats:
    """What the communication link loses more than budgeted where its terminals are further apart, in dB.

    In vacuum that is 20 lg of the ratio of the ranges. Down to a station the elevation goes with the range, and so do
    absorption, scattering and turbulence: they are found at some elevations, and interpolated between them over the
    inverse of its sine. Below the elevation of the budget the air stays as it is there.

    Args:
        data: The communication link.
        range_m: Ranges (m), any shape.
    """
    distance, path = np.asarray(range_m, dtype=np.float64), data.shared.path
    farther: Floats = 20.0 * np.log10(distance / data.range_m)
    if path is None or path.satellite_radius_m is None or path.elevation_rad >= math.pi / 2.0:
        return farther
    longer, added = _air_over_elevation(data)
    nearest = path.range_at(math.pi / 2.0)
    elevation = np.array([path.elevation_at(max(each, nearest)) for each in distance.ravel()])
    at = np.interp(1.0 / np.sin(np.maximum(elevation, path.elevation_rad)), longer, added)
    return np.asarray(farther + at.reshape(distance.shape))


@lru_cache(maxsize=64)  # a contact asks for it window by window
def _air_over_elevation(data: DataLink) -> tuple[Floats, Floats]:
    """Inverse sines of some elevations, and what the air takes there more than at that of the budget (dB)."""
    assert data.shared.path is not None
    longer = np.linspace(1.0, 1.0 / math.sin(data.shared.path.elevation_rad), _ELEVATIONS)
    own = data.air_db + data.fade_db
    there = [at_elevation(data, math.asin(min(1.0 / each, 1.0))) for each in longer[:-1]]
    return longer, np.array([*(each.air_db + each.fade_db - own for each in there), 0.0])


def pointing_loss_db(data: DataLink, pointing_error_rad: ArrayLike) -> Floats:
    """Loss (positive, dB) of the communication link at each pointing error, with an uncorrected point-ahead added.

    What the receiver's own pointing costs is in it, and what fades add, the same at each error.

    Args:
        data: The communication link.
        pointing_error_rad: Radial pointing errors, in rad, any shape.
    """
    error = np.asarray(pointing_error_rad, dtype=np.float64)
    return data.beam.fall.loss_db(error + data.shared.point_ahead_rad) + data.added_db


def margin_map(data: DataLink, data_rate_bit_s: ArrayLike, pointing_error_rad: ArrayLike) -> Floats:
    """Margin of the communication link in dB, shape (rates, errors); paper, Fig. 2.

    Args:
        data: The communication link.
        data_rate_bit_s: Information rates, bit/s, shape (rates,).
        pointing_error_rad: Static radial errors, rad, shape (errors,).

    Raises:
        ValueError: If an error is negative, a rate not above zero, or the receiver does not take it.
    """
    rate = np.atleast_1d(np.asarray(data_rate_bit_s, dtype=np.float64))
    error = np.atleast_1d(np.asarray(pointing_error_rad, dtype=np.float64))
    check_grid(rate, error)
    on_axis = received_on_axis_dbm(data) - required_dbm(data, rate)
    margin: Floats = on_axis[:, None] - pointing_loss_db(data, error)[None, :]
    return margin


def margin_of_error(data: DataLink, pointing_error_rad: ArrayLike) -> Floats:
    """Margin of the communication link in dB at the mission's data rate, at each pointing error.

    Args:
        data: The communication link.
        pointing_error_rad: Radial pointing errors, in rad, any shape, which the margins have too.

    Raises:
        ValueError: As `margin_map`.
    """
    error = np.asarray(pointing_error_rad, dtype=np.float64)
    row: Floats = margin_map(data, data.table.data_rate_bit_s, error.ravel())[0]
    return row.reshape(error.shape)


def largest_data_rate(data: DataLink, margin_db: float, pointing_error_rad: float) -> float:
    """Largest data rate (bit/s) with a margin at a pointing error, or the highest that the receiver takes.

    Args:
        data: The communication link.
        margin_db: The margin that is left, dB.
        pointing_error_rad: Static radial error, rad, at least 0.

    Raises:
        LinkError: If not even the slowest rate leaves the margin.
    """
    check_grid(np.ones(1), np.asarray(pointing_error_rad))
    lost = float(pointing_loss_db(data, pointing_error_rad))
    return rate_at_loss(data, margin_db, lost)


def rate_at_loss(data: DataLink, margin_db: float, loss_db: float) -> float:
    """Largest data rate (bit/s) with a margin at a pointing loss, or the highest that the receiver takes.

    Args:
        data: The communication link.
        margin_db: The margin that is left, dB.
        loss_db: The pointing loss, dB, positive.

    Raises:
        LinkError: If not even the slowest rate leaves the margin.
    """
    available = received_on_axis_dbm(data) - loss_db - margin_db
    built = data.receiver
    if built is None:
        spare_db = available - float(required_dbm(data, SLOWEST_BIT_S))
        if spare_db < 0.0:
            raise LinkError(
                f"not even {format_quantity(SLOWEST_BIT_S, 'bit/s')} leaves a margin of {margin_db:g} dB: "
                f"{-spare_db:.2f} dB are missing"
            )
        return SLOWEST_BIT_S * float(10.0 ** (spare_db / 10.0))
    highest = built.highest_data_rate_bit_s
    rate = rate_at_power(built, available)
    if rate is None:
        slowest = min(SLOWEST_BIT_S, highest)
        missing = float(required_dbm(data, slowest)) - available
        raise LinkError(
            f"not even {format_quantity(slowest, 'bit/s')} leaves a margin of {margin_db:g} dB: "
            f"{missing:.2f} dB are missing, mostly against noise that does not fall with the rate"
        )
    return rate


def largest_pointing_error(data: DataLink, margin_db: float, data_rate_bit_s: float) -> float:
    """Largest radial pointing error (rad) with a margin at a data rate: the loss grows with the error.

    Args:
        data: The communication link.
        margin_db: The margin that is left, dB.
        data_rate_bit_s: Information rate, bit/s.

    Raises:
        LinkError: If the margin is not there even on axis, or an uncorrected point-ahead lies beyond the main lobe of
            the beam, where the loss does not grow with the error.
    """
    excess_db = float(margin_map(data, data_rate_bit_s, 0.0)[0, 0]) - margin_db
    if excess_db < 0.0:
        raise LinkError(
            f"at {format_quantity(data_rate_bit_s, 'bit/s')} a margin of {margin_db:g} dB is missed by "
            f"{-excess_db:.2f} dB even without pointing error; {_instead(data, margin_db)}"
            "with that much more power or gain"
        )
    ahead = data.shared.point_ahead_rad
    fall = data.beam.fall
    reached = fall.error_rad(excess_db + float(fall.loss_db(ahead)))
    if reached < ahead * (1.0 - 1e-6):
        raise LinkError(
            f"the uncorrected point-ahead of {format_quantity(ahead, 'rad')} lies beyond the main lobe of the beam, "
            f"which has fallen as far at {format_quantity(reached, 'rad')}; correct it, or take a wider beam"
        )
    return max(reached - ahead, 0.0)


def _instead(data: DataLink, margin_db: float) -> str:
    """The data rate that would have the margin on axis, where there is one."""
    try:
        possible = largest_data_rate(data, margin_db, 0.0)
    except LinkError:
        return "it would be there "
    return f"up to {format_quantity(possible, 'bit/s')} it would be there, or "


@dataclass(frozen=True, slots=True)
class SensitivityReading:
    """Photons per bit that the receiver may need, under one reading of pointing loss and Strehl."""

    pointing_loss: str
    strehl: str
    photons_per_bit: float


def implied_sensitivity(data: DataLink) -> tuple[SensitivityReading, ...]:
    """Sensitivity implied by the required margin at the mission's data rate and required pointing error.

    One record for each reading of pointing loss and Strehl. A `strehl` that is no ratio (0, or above 1) leaves out the
    readings that take it for one; a wavefront error has one reading.
    """
    beam, requirement = data.table, data.requirement
    rate_dbm = gains.dbm(gains.photon_energy_j(beam.wavelength_m) * beam.data_rate_bit_s)
    aperture, wavelength = data.shared.terminals.leo_aperture_m, beam.wavelength_m
    uniform = gains.aperture_gain_db(aperture, wavelength)
    readings = []
    for strehl, loss_db in _strehl_readings(beam).items():
        on_axis = received_on_axis_dbm(data, loss_db) - data.beam.gain_db + uniform
        for loss in ("gaussian", "gain"):
            error = requirement.pointing_error_rad + data.shared.point_ahead_rad
            lost = float(gains.pointing_loss_db(error, aperture, wavelength, loss))
            level = on_axis - lost - data.added_db - requirement.margin_db - rate_dbm
            readings.append(SensitivityReading(loss, strehl, float(10.0 ** (level / 10.0))))
    return tuple(readings)


def _strehl_readings(beam: Communication) -> dict[str, float]:
    if beam.strehl is None:
        return {"wavefront error": strehl_db(beam, "ratio")}
    names = ("decibel", "ratio") if 0.0 < beam.strehl <= 1.0 else ("decibel",)
    return {name: gains.strehl_loss_db(beam.strehl, name) for name in names}


def convention_maps(
    data: DataLink, data_rate_bit_s: ArrayLike, pointing_error_rad: ArrayLike
) -> dict[tuple[str, str], Floats]:
    """Margin maps under each reading of pointing loss and Strehl, as `margin_map` gives them.

    The paper leaves both open: what the readings differ by is the width of the band that its Fig. 2 stands for.

    Args:
        data: The communication link.
        data_rate_bit_s: Data rates, in bit/s, as `margin_map` takes them.
        pointing_error_rad: Radial pointing errors, in rad, as `margin_map` takes them.

    Raises:
        ValueError: As `margin_map`.
    """
    maps = {}
    update = {} if data.shared.conventions.pointing_loss != "pattern" else {"beam": None}
    for strehl, loss_db in _strehl_readings(data.table).items():
        for loss in ("gaussian", "gain"):
            beam = data.table.model_copy(update={**update, "strehl": loss_db, "wavefront_error_m": None})
            conventions = data.shared.conventions.model_copy(update={"pointing_loss": loss, "strehl": "decibel"})
            read = assembled(replace(data.shared, conventions=conventions), beam, data.requirement, data.jitter)
            maps[loss, strehl] = margin_map(read, data_rate_bit_s, pointing_error_rad)
    return maps


@dataclass(frozen=True, slots=True)
class IdealReceiver:
    """A receiver limited by quantum noise: photons per bit at `BIT_ERROR_RATIO`, and the link's margin with it."""

    name: str
    photons_per_bit: float
    margin_db: float
    formula: str
    source: str


def ideal_receivers(
    data: DataLink, sources: Mapping[str, Source], pointing_error_rad: float | None = None
) -> tuple[IdealReceiver, ...]:
    """The link's margin with three ideal receivers, at the mission's data rate and with its losses.

    The formulas are the textbook ones (Agrawal, Fiber-Optic Communication Systems): n photons per bit, for on-off
    keying averaged over marks and spaces.

    Args:
        data: The communication link.
        sources: Where each value of the mission comes from, by its dotted key.
        pointing_error_rad: Radial pointing error, in rad; by default that of the mission.
    """
    beam = data.table
    own_source = source_text(sources, "communication.pointing_error")
    error, error_source = given_or_own(beam.pointing_error_rad, pointing_error_rad, own_source, CHOSEN)
    received = received_on_axis_dbm(data) - float(pointing_loss_db(data, error))
    source = f"{source_text(sources, 'communication.data_rate')}; {error_source}"
    rate = beam.data_rate_bit_s
    common: dict[str, Any] = {
        "wavelength_m": beam.wavelength_m,
        "bit_error_ratio": BIT_ERROR_RATIO,
        "bandwidth_hz": 2.0 * rate,
    }
    ideal = (
        ("Homodyne BPSK", BpskHomodyne(**common, quantum_efficiency=1.0), "BER = erfc(sqrt(2 n)) / 2"),
        ("Preamplified DPSK", DpskPreamplified(**common, noise_figure_db=QUANTUM_LIMIT_DB), "BER = exp(-n) / 2"),
        (
            "On-off keying, photon counting",
            OokCounting(**common, detection_efficiency=1.0),
            "BER = exp(-2 n) / 2, n averaged over marks and spaces",
        ),
    )
    return tuple(
        IdealReceiver(
            name,
            float(built.photons_per_bit(rate)),
            received - gains.dbm(float(built.required_power_w(rate))),
            formula,
            source,
        )
        for name, built, formula in ideal
    )
