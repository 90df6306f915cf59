"""Link budgets of the beacon, its answer and the communication link, and what follows from them.

Gains and losses are in dB; a function called `..._loss_db` returns a positive number, a line of a budget carries the
sign. Angles are radial, measured from the line of sight.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.budget import Line, total_db
from microrad.mission import Beacon, Communication, Mission, Source, half_angle_rad, source_text
from microrad.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S, format_quantity

Floats = NDArray[np.float64]

BIT_ERROR_RATIO = 1e-9
"""Bit error ratio at which ideal receivers are compared."""

_DB_PER_NEPER = 10.0 / math.log(10.0)
_GIVEN = "whatever the pointing error and the data rate"
_TRANSMITTING = (
    "uniformly lit, unobscured, diffraction-limited: an upper bound, of which a Gaussian beam cut by the aperture "
    "reaches 0.81 at best (Klein and Degnan 1974)"
)
_AS_LINES = "where every line holds"
_POINTING_BASIS = {
    "gaussian": (
        "exp(-2 (error / theta)^2), theta = 2 lambda / (pi D)",
        "Gaussian beam of 1/e2 radius D/2 at the aperture",
    ),
    "gain": ("exp(-G error^2), G = (pi D / lambda)^2", "beam that falls off as a Gaussian set by its own gain"),
}
_RECEIVING = "unobscured area pi D^2 / 4, all of its light on the detector"
_CHOSEN = "chosen for this evaluation"


class LinkError(ValueError):
    """A question to which this link has no answer; the message says by how many decibels."""


# ------------------------------------------------------------------------------------------------------------ formulas
def aperture_gain_db(diameter_m: float, wavelength_m: float) -> float:
    """On-axis gain of a uniformly lit circular aperture, (pi D / lambda)^2."""
    return 20.0 * math.log10(math.pi * diameter_m / wavelength_m)


def gaussian_beam_gain_db(half_angle_rad: float) -> float:
    """On-axis gain of an untruncated Gaussian beam, 8 / theta^2, with theta the half angle at 1/e2 of intensity."""
    return 10.0 * math.log10(8.0 / half_angle_rad**2)


def free_space_loss_db(distance_m: float, wavelength_m: float) -> float:
    """Loss between isotropic antennas, (4 pi R / lambda)^2 (Friis 1946)."""
    return 20.0 * math.log10(4.0 * math.pi * distance_m / wavelength_m)


def gaussian_pointing_loss_db(error_rad: ArrayLike, half_angle_rad: float) -> Floats:
    """Loss of a Gaussian beam off its axis, exp(-2 (error / theta)^2): 8.686 (error / theta)^2 dB."""
    return 2.0 * _DB_PER_NEPER * (np.asarray(error_rad, dtype=np.float64) / half_angle_rad) ** 2


def pointing_loss_db(error_rad: ArrayLike, aperture_m: float, wavelength_m: float, convention: str) -> Floats:
    """Loss of a diffraction-limited beam off its axis.

    "gaussian": a Gaussian beam of 1/e2 radius D/2 at the aperture, theta = 2 lambda / (pi D). "gain": exp(-G error^2)
    with G = (pi D / lambda)^2, twice as many decibels.
    """
    error = np.asarray(error_rad, dtype=np.float64)
    return _pointing_db_per_rad2(aperture_m, wavelength_m, convention) * error**2


def _pointing_db_per_rad2(aperture_m: float, wavelength_m: float, convention: str) -> float:
    """Both conventions are a number of decibels times the square of the error."""
    gain = (math.pi * aperture_m / wavelength_m) ** 2
    if convention == "gain":
        return _DB_PER_NEPER * gain
    if convention == "gaussian":
        return _DB_PER_NEPER * gain / 2.0
    raise ValueError(f'pointing-loss convention "{convention}" is neither "gaussian" nor "gain"')


def strehl_loss_db(strehl: float, convention: str) -> float:
    """Loss by wavefront error: "decibel" takes `strehl` as it is, "ratio" as -10 lg of it."""
    if convention == "decibel":
        return strehl
    if convention == "ratio":
        return -10.0 * math.log10(strehl)
    raise ValueError(f'Strehl convention "{convention}" is neither "decibel" nor "ratio"')


def photon_energy_j(wavelength_m: float) -> float:
    """Energy of one photon, h c / lambda."""
    return PLANCK_J_S * SPEED_OF_LIGHT_M_S / wavelength_m


def _dbm(power_w: float) -> float:
    return 10.0 * math.log10(power_w) + 30.0


def _watt(level_dbm: float) -> float:
    return float(10.0 ** ((level_dbm - 30.0) / 10.0))


# ------------------------------------------------------------------------------------------------------------- budgets
@dataclass(frozen=True, slots=True)
class LinkBudget:
    """One link: `lines` add up to the received power in dBm, `totals` are received power, required power and margin.

    `irradiance_w_m2` stands at the receiving aperture with every loss up to there, at the pointing error;
    `irradiance_on_axis_w_m2` is that of the same beam pointed without error and before Strehl.
    """

    name: str
    lines: tuple[Line, ...]
    totals: tuple[Line, ...]
    received_power_w: float
    required_power_w: float
    margin_db: float
    irradiance_w_m2: float
    irradiance_on_axis_w_m2: float


def communication_budget(
    mission: Mission,
    sources: Mapping[str, Source],
    pointing_error_rad: float | None = None,
    data_rate_bit_s: float | None = None,
    given_source: str = _CHOSEN,
) -> LinkBudget:
    """Budget of the data link from LEO to GEO, at the mission's pointing error and data rate or at those given.

    ``given_source`` says where a given value comes from, and stands as the source of its line.

    Raises `ValueError` for a negative pointing error or a data rate that is not above zero.
    """
    beam = mission.communication
    write = _Writer("communication", beam, mission, sources)
    error, error_source = _given(
        beam.pointing_error_rad, pointing_error_rad, write.source("pointing_error"), given_source
    )
    rate, rate_source = _given(beam.data_rate_bit_s, data_rate_bit_s, write.source("data_rate"), given_source)
    _check_grid(np.asarray(rate), np.asarray(error))
    transmit = write.transmit(
        write.gain("LEO aperture gain", "leo_aperture", _TRANSMITTING), _pointing_line(mission, error, error_source)
    )
    receive = (
        write.gain("GEO aperture gain", "geo_aperture", _RECEIVING),
        write.loss("Receive optics loss", "receive_optics_loss"),
        write.loss("Tracking split loss", "tracking_split_loss"),
        write.loss("Implementation loss", "implementation_loss"),
    )
    return _budget("Communication", transmit, receive, _required_line(beam, rate, write, rate_source), beam)


def beacon_budget(mission: Mission, sources: Mapping[str, Source]) -> LinkBudget:
    """Budget of the wide beacon from LEO to GEO: a Gaussian beam with the mission's divergence convention."""
    return _gaussian_budget(_Writer("beacon", mission.beacon, mission, sources), mission.beacon, "geo_aperture")


def answer_budget(mission: Mission, sources: Mapping[str, Source]) -> LinkBudget:
    """Budget of the narrow beam with which GEO answers the beacon: a Gaussian beam, received by the LEO aperture."""
    return _gaussian_budget(_Writer("answer", mission.answer, mission, sources), mission.answer, "leo_aperture")


def _gaussian_budget(write: "_Writer", beam: Beacon, receiver: str) -> LinkBudget:
    half, error = half_angle_rad(beam.divergence_rad, write.mission.conventions.divergence), beam.pointing_error_rad
    theta = f"theta = {format_quantity(half, 'rad')} half angle at 1/e2"
    far = "Gaussian beam, far field, not cut by its aperture"
    shape = source_text(write.sources, f"{write.table}.divergence", "conventions.divergence")
    gain = Line("Beam gain", gaussian_beam_gain_db(half), "dB", f"8 / theta^2, {theta}", shape, far)
    basis = f"exp(-2 (error / theta)^2), error = {format_quantity(error, 'rad')}, {theta}"
    loss = 0.0 - float(gaussian_pointing_loss_db(error, half))
    pointing = Line("Pointing loss", loss, "dB", basis, write.source("pointing_error"), f"{far}; static error")
    receive = (
        write.gain(f"{receiver[:3].upper()} aperture gain", receiver, _RECEIVING),
        write.loss("Receive optics loss", "receive_optics_loss"),
    )
    level = _dbm(beam.required_power_w)
    required = Line("Required power", level, "dBm", "as given", write.source("required_power"), _GIVEN)
    return _budget(write.table.capitalize(), write.transmit(gain, pointing), receive, required, beam)


def _given(own: float, given: float | None, source: str, given_source: str) -> tuple[float, str]:
    """The value in force and its source: the one given, else the mission's own."""
    return (own, source) if given is None else (float(given), given_source)


@dataclass(frozen=True, slots=True)
class _Writer:
    """Writes the lines of one link, the table `table` of the mission."""

    table: str
    beam: Beacon | Communication
    mission: Mission
    sources: Mapping[str, Source]

    def source(self, key: str) -> str:
        return source_text(self.sources, f"{self.table}.{key}")

    def loss(self, name: str, key: str) -> Line:
        """A loss that the mission gives in dB; 0 dB is a line like any other."""
        return Line(name, 0.0 - getattr(self.beam, f"{key}_db"), "dB", "as given", self.source(key), _GIVEN)

    def gain(self, name: str, aperture: str, regime: str) -> Line:
        diameter, wavelength = getattr(self.mission.terminals, f"{aperture}_m"), self.beam.wavelength_m
        shown = f"D = {format_quantity(diameter, 'm')}, lambda = {format_quantity(wavelength, 'm')}"
        source = source_text(self.sources, f"terminals.{aperture}", f"{self.table}.wavelength")
        return Line(name, aperture_gain_db(diameter, wavelength), "dB", f"(pi D / lambda)^2, {shown}", source, regime)

    def transmit(self, gain: Line, pointing: Line) -> tuple[Line, ...]:
        """Everything up to the receiving aperture."""
        beam = self.beam
        power = f"P = {format_quantity(beam.transmit_power_w, 'W')}"
        distance = f"(lambda / (4 pi R))^2, R = {format_quantity(beam.distance_m, 'm')}"
        space = -free_space_loss_db(beam.distance_m, beam.wavelength_m)
        return (
            Line("Transmit power", _dbm(beam.transmit_power_w), "dBm", power, self.source("transmit_power"), _GIVEN),
            gain,
            self.loss("Transmit optics loss", "transmit_optics_loss"),
            self._strehl(),
            pointing,
            Line("Free-space loss", space, "dB", distance, self.source("distance"), "vacuum, far field"),
        )

    def _strehl(self) -> Line:
        strehl, convention = self.beam.strehl, self.mission.conventions.strehl
        basis = "as given in dB" if convention == "decibel" else f"Strehl ratio {strehl:g}"
        source = source_text(self.sources, f"{self.table}.strehl", "conventions.strehl")
        value = 0.0 - strehl_loss_db(strehl, convention)
        return Line("Strehl loss", value, "dB", basis, source, "on axis, small wavefront error (Marechal)")


def _pointing_line(mission: Mission, error_rad: float, source: str) -> Line:
    convention, diameter = mission.conventions.pointing_loss, mission.terminals.leo_aperture_m
    loss = 0.0 - float(pointing_loss_db(error_rad, diameter, mission.communication.wavelength_m, convention))
    formula, regime = _POINTING_BASIS[convention]
    basis = f"{formula}, error = {format_quantity(error_rad, 'rad')}"
    return Line("Pointing loss", loss, "dB", basis, source, f"{regime}; static error")


def _required_line(beam: Communication, rate_bit_s: float, write: _Writer, rate_source: str) -> Line:
    sensitivity = format_quantity(beam.receiver_sensitivity_photon_bit, "photon/bit")
    basis = f"n (h c / lambda) R, n = {sensitivity}, R = {format_quantity(rate_bit_s, 'bit/s')}"
    source = f"{write.source('receiver_sensitivity')}; {rate_source}"
    return Line(
        "Required power",
        _required_dbm(beam, rate_bit_s),
        "dBm",
        basis,
        source,
        "sensitivity the same at every data rate",
    )


def _budget(
    name: str,
    transmit: tuple[Line, ...],
    receive: tuple[Line, ...],
    required: Line,
    beam: Beacon | Communication,
) -> LinkBudget:
    received_dbm = total_db(transmit + receive)
    margin = received_dbm - required.value
    on_axis = [line for line in transmit if line.name not in ("Strehl loss", "Pointing loss")]
    return LinkBudget(
        name=name,
        lines=transmit + receive,
        totals=(
            Line("Received power", received_dbm, "dBm", "sum of the lines above", "computed", _AS_LINES),
            required,
            Line("Margin", margin, "dB", "received power less required power", "computed", _AS_LINES),
        ),
        received_power_w=_watt(received_dbm),
        required_power_w=_watt(required.value),
        margin_db=margin,
        irradiance_w_m2=_irradiance(total_db(transmit), beam.wavelength_m),
        irradiance_on_axis_w_m2=_irradiance(total_db(on_axis), beam.wavelength_m),
    )


def _irradiance(isotropic_dbm: float, wavelength_m: float) -> float:
    """Irradiance from the power that an isotropic antenna, of effective area lambda^2 / (4 pi), would receive."""
    return _watt(isotropic_dbm) * 4.0 * math.pi / wavelength_m**2


# ------------------------------------------------------------------------------------------------------ what follows
def _received_on_axis_dbm(mission: Mission, strehl_db: float | None = None) -> float:
    """Received power of the communication link pointed without error; the budget's lines say the same one by one."""
    beam, terminals = mission.communication, mission.terminals
    losses = (
        beam.transmit_optics_loss_db
        + beam.receive_optics_loss_db
        + beam.tracking_split_loss_db
        + beam.implementation_loss_db
        + (strehl_loss_db(beam.strehl, mission.conventions.strehl) if strehl_db is None else strehl_db)
        + free_space_loss_db(beam.distance_m, beam.wavelength_m)
    )
    gains = aperture_gain_db(terminals.leo_aperture_m, beam.wavelength_m)
    gains += aperture_gain_db(terminals.geo_aperture_m, beam.wavelength_m)
    return _dbm(beam.transmit_power_w) + gains - losses


def _required_dbm(beam: Communication, data_rate_bit_s: float) -> float:
    return _dbm(beam.receiver_sensitivity_photon_bit * photon_energy_j(beam.wavelength_m) * data_rate_bit_s)


def _pointing_slope(mission: Mission) -> float:
    """Pointing loss of the communication link in dB per rad^2."""
    aperture, wavelength = mission.terminals.leo_aperture_m, mission.communication.wavelength_m
    return _pointing_db_per_rad2(aperture, wavelength, mission.conventions.pointing_loss)


def _check_grid(data_rate_bit_s: Floats, pointing_error_rad: Floats) -> None:
    if not np.all(data_rate_bit_s > 0.0):
        raise ValueError("data rates must be above 0 bit/s")
    if not np.all(pointing_error_rad >= 0.0):
        raise ValueError("pointing errors must be at least 0 rad: they are radial")


def margin_map(mission: Mission, data_rate_bit_s: ArrayLike, pointing_error_rad: ArrayLike) -> Floats:
    """Margin of the communication link in dB over data rate (rows) and pointing error (columns); paper, Fig. 2.

    Raises `ValueError` for a negative pointing error or a data rate that is not above zero.
    """
    rate = np.atleast_1d(np.asarray(data_rate_bit_s, dtype=np.float64))
    error = np.atleast_1d(np.asarray(pointing_error_rad, dtype=np.float64))
    _check_grid(rate, error)
    one_bit_dbm = _required_dbm(mission.communication, 1.0)
    on_axis = _received_on_axis_dbm(mission) - one_bit_dbm - 10.0 * np.log10(rate)
    margin: Floats = on_axis[:, None] - _pointing_slope(mission) * error[None, :] ** 2
    return margin


def margin_of_error(mission: Mission, pointing_error_rad: ArrayLike) -> Floats:
    """Margin of the communication link in dB at the mission's data rate, for each of the pointing errors."""
    error = np.asarray(pointing_error_rad, dtype=np.float64)
    row: Floats = margin_map(mission, mission.communication.data_rate_bit_s, error.ravel())[0]
    return row.reshape(error.shape)


def largest_data_rate(mission: Mission, margin_db: float, pointing_error_rad: float) -> float:
    """Data rate in bit/s that leaves `margin_db` at a pointing error: required power is proportional to the rate."""
    excess_db = float(margin_map(mission, 1.0, pointing_error_rad)[0, 0]) - margin_db
    return float(10.0 ** (excess_db / 10.0))


def largest_pointing_error(mission: Mission, margin_db: float, data_rate_bit_s: float) -> float:
    """Radial pointing error in rad that leaves `margin_db` at a data rate: the loss grows with its square.

    Raises `LinkError` when the margin is not there even on axis.
    """
    excess_db = float(margin_map(mission, data_rate_bit_s, 0.0)[0, 0]) - margin_db
    if excess_db < 0.0:
        possible = format_quantity(largest_data_rate(mission, margin_db, 0.0), "bit/s")
        raise LinkError(
            f"at {format_quantity(data_rate_bit_s, 'bit/s')} a margin of {margin_db:g} dB is missed by "
            f"{-excess_db:.2f} dB even without pointing error; up to {possible} it would be there, "
            "or with that much more power or gain"
        )
    return math.sqrt(excess_db / _pointing_slope(mission))


@dataclass(frozen=True, slots=True)
class SensitivityReading:
    """Photons per bit that the receiver may need, under one reading of pointing loss and Strehl."""

    pointing_loss: str
    strehl: str
    photons_per_bit: float


def implied_sensitivity(mission: Mission) -> tuple[SensitivityReading, ...]:
    """Sensitivity implied by the required margin at the mission's data rate and required pointing error.

    One record for each reading of pointing loss and Strehl. A `strehl` that is no ratio (0, or above 1) leaves out the
    readings that take it for one.
    """
    beam, requirement = mission.communication, mission.requirement
    photon_rate_dbm = _dbm(photon_energy_j(beam.wavelength_m) * beam.data_rate_bit_s)
    readings = []
    for strehl in ("decibel", "ratio") if 0.0 < beam.strehl <= 1.0 else ("decibel",):
        on_axis = _received_on_axis_dbm(mission, strehl_loss_db(beam.strehl, strehl))
        for loss in ("gaussian", "gain"):
            aperture = mission.terminals.leo_aperture_m
            lost = float(pointing_loss_db(requirement.pointing_error_rad, aperture, beam.wavelength_m, loss))
            level = on_axis - lost - requirement.margin_db - photon_rate_dbm
            readings.append(SensitivityReading(loss, strehl, float(10.0 ** (level / 10.0))))
    return tuple(readings)


@dataclass(frozen=True, slots=True)
class IdealReceiver:
    """A receiver limited by quantum noise: photons per bit at `BIT_ERROR_RATIO`, and the link's margin with it."""

    name: str
    photons_per_bit: float
    margin_db: float
    formula: str
    source: str


def ideal_receivers(
    mission: Mission, sources: Mapping[str, Source], pointing_error_rad: float | None = None
) -> tuple[IdealReceiver, ...]:
    """The link's margin with three ideal receivers, at the mission's data rate; losses stay as in the mission.

    The formulas are the textbook ones (Agrawal, Fiber-Optic Communication Systems): n photons per bit, for on-off
    keying averaged over marks and spaces.
    """
    beam = mission.communication
    error, error_source = _given(
        beam.pointing_error_rad, pointing_error_rad, source_text(sources, "communication.pointing_error"), _CHOSEN
    )
    margin = float(margin_of_error(mission, error))
    source = f"{source_text(sources, 'communication.data_rate')}; {error_source}"
    natural = math.log(1.0 / (2.0 * BIT_ERROR_RATIO))
    # erfc(sqrt(2 n)) / 2 is the normal tail beyond 2 sqrt(n)
    tail = -NormalDist().inv_cdf(BIT_ERROR_RATIO)
    receivers = (
        ("Homodyne BPSK", tail**2 / 4.0, "BER = erfc(sqrt(2 n)) / 2"),
        ("Preamplified DPSK", natural, "BER = exp(-n) / 2"),
        ("On-off keying, photon counting", natural / 2.0, "BER = exp(-2 n) / 2, n averaged over marks and spaces"),
    )
    return tuple(
        IdealReceiver(name, n, margin + 10.0 * math.log10(beam.receiver_sensitivity_photon_bit / n), formula, source)
        for name, n, formula in receivers
    )
