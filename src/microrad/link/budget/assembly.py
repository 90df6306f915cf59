"""From the tables of a mission to the physics of its links: beams, receivers, losses by convention."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError
from microrad.link import coupling, gains, receivers
from microrad.link.beams import GaussianFall, LitAperture
from microrad.link.budget import air
from microrad.link.radial_error import Jitter, radial_quantile, radial_steps
from microrad.mission.fields import Quantity
from microrad.mission.ground import GroundPath, range_of
from microrad.mission.model import LinkMission
from microrad.mission.tables import pointing as pointing_table
from microrad.mission.tables.channel import Channel
from microrad.mission.tables.coupling import Coupling
from microrad.mission.tables.link import (
    QUADRATURES,
    Beam,
    Communication,
    LinkConventions,
    LinkRequirement,
    Terminals,
)
from microrad.mission.tables.link import Receiver as ReceiverTable
from microrad.mission.tables.pointing import JitterTable, PointAhead

RAREST = 1e-16
"""Share of the time below which an outage is none that is told from it."""
SLOWEST_BIT_S = 1.0
"""Data rate from which on a link is one."""


class LinkError(MicroradError):
    """A question to which this link has no answer; the message says by how many decibels."""

    page = "link"


@dataclass(frozen=True, slots=True)
class TransmittedBeam:
    """What leaves an aperture: gain on the axis, relative to an isotropic antenna, and how it falls off."""

    gain_db: float
    fall: LitAperture | GaussianFall


@dataclass(frozen=True, slots=True)
class Shared:
    """What a mission's links share: the terminals at their ends, the air between them, point-ahead, conventions.

    ``path`` is that through the air, None in vacuum. ``outage`` is the share of the time that fades may take.
    """

    terminals: Terminals
    conventions: LinkConventions
    channel: Channel | None
    point_ahead: PointAhead | None
    path: GroundPath | None = None
    outage: float | None = None

    @classmethod
    def of(cls, m: LinkMission) -> "Shared":
        """What the links of this mission share."""
        fades = m.channel is not None and m.channel.turbulence is not None
        outage = m.requirement.outage if fades else None
        return cls(m.terminals, m.conventions, m.channel, m.point_ahead, m.path, outage)

    @property
    def sky(self) -> air.Sky | None:
        """The air on the path; None in vacuum."""
        if self.channel is None or self.path is None:
            return None
        ahead = self.point_ahead
        angle = 0.0 if ahead is None else pointing_table.point_ahead_rad(ahead.transverse_velocity_m_s)
        return air.Sky(self.channel, self.path, angle)

    def clear_sky_db(self, wavelength_m: float) -> float:
        """Loss (dB) of a clear atmosphere on the path at a wavelength (m); 0 in vacuum."""
        sky = self.sky
        return 0.0 if sky is None else sky.clear_db(wavelength_m)

    def range_m(self, beam: Beam) -> float:
        """Distance (m) of the terminals for one of the links."""
        return range_of(beam, self.path)

    def turbulent(
        self, beam: Beam, sender: str, half_angle_rad: float, end: coupling.End | None
    ) -> air.Turbulent | None:
        """What turbulence does to one of the links; None in still air.

        Args:
            beam: The table of the link.
            sender: The terminal that it leaves, "leo" or "geo".
            half_angle_rad: Its half angle at 1/e2 of intensity (rad).
            end: What takes the light in the focus; None where it takes all.
        """
        sky = self.sky
        slant = None if sky is None else sky.slant(beam.wavelength_m, self.range_m(beam))
        if sky is None or slant is None:
            return None
        table = sky.channel.turbulence
        assert table is not None  # else the path has no turbulence
        if sky.path.station == sender:
            return air.uplink(table, slant, half_angle_rad, sky.point_ahead_rad)
        aperture = self.terminals.leo_aperture_m if sender == "geo" else self.terminals.geo_aperture_m
        return air.downlink(table, slant, air.Receives(aperture, end))

    @property
    def point_ahead_rad(self) -> float:
        """Point-ahead angle 2 v / c that is left in the pointing error: 0 when it is corrected or not given."""
        ahead = self.point_ahead
        if ahead is None or ahead.corrected:
            return 0.0
        return pointing_table.point_ahead_rad(ahead.transverse_velocity_m_s)

    @property
    def point_ahead_left_rad(self) -> float:
        """What point-ahead adds to a residual without it: the whole angle, or the error that its correction leaves."""
        ahead = self.point_ahead
        return 0.0 if ahead is None else ahead.error_rad if ahead.corrected else self.point_ahead_rad


@dataclass(frozen=True, slots=True)
class Receiving:
    """What takes the light at the receiver, and how the receiving terminal points.

    ``on_axis_db`` is the loss of a receiver that points without error. ``jitter`` is None where its error is static,
    ``error_rad``, or has the distribution of the transmitter's (``twin``).
    """

    end: coupling.End
    on_axis_db: float
    error_rad: float
    jitter: Jitter | None
    twin: bool

    @property
    def is_random(self) -> bool:
        """Whether the receiver's error has a distribution."""
        return self.twin or self.jitter is not None

    @property
    def static_db(self) -> float:
        """Loss by the static error in its worst direction, without that on the axis."""
        return self.end.worst_loss_db(self.error_rad) - self.on_axis_db if self.error_rad else 0.0

    def losses(self, radius_rad: Floats, share: Floats) -> coupling.Losses:
        """Losses by the receiver's error, without that on the axis, where the transmitter has these errors.

        Args:
            radius_rad: Radial pointing errors of the transmitter (rad); a twin has their like.
            share: The share of the time of each.
        """
        if self.twin:
            return coupling.of_radii(self.end, radius_rad, share)
        if self.jitter is not None:
            return coupling.of_jitter(self.end, self.jitter)
        return coupling.Losses.single(self.static_db)


@dataclass(frozen=True, slots=True)
class DataLink:
    """The communication link, assembled from its table: its beam, its receiver, and what is required of it.

    ``receiver`` is None where its sensitivity is given as measured. ``receiving`` is None where all of the light falls
    on the detector. ``receive_pointing_db`` is what the receiver's own pointing costs: by its static error, or what
    its losses add to those by the transmitter's stated error, both together exceeded for the outage. ``turbulent`` is
    what the air does, None where it is still or there is none, and ``fade_db`` what its fades add to those two.
    """

    shared: Shared
    table: Communication
    requirement: LinkRequirement
    jitter: JitterTable | None
    beam: TransmittedBeam
    receiver: receivers.Receiver | None
    receiving: Receiving | None
    receive_pointing_db: float
    turbulent: air.Turbulent | None = None
    fade_db: float = 0.0

    @property
    def added_db(self) -> float:
        """What the receiver's pointing and the fades add to the loss by the transmitter's pointing."""
        return self.receive_pointing_db + self.fade_db

    @property
    def range_m(self) -> float:
        """Distance of the terminals (m)."""
        return self.shared.range_m(self.table)

    @property
    def air_db(self) -> float:
        """Loss of the mean power in the air: by a clear sky, by a wider beam, and by a wavefront that is taken less."""
        clear, turbulent = self.shared.clear_sky_db(self.table.wavelength_m), self.turbulent
        return clear if turbulent is None else clear + turbulent.spread_db + turbulent.wavefront_db

    def both_ends(self, radius_rad: Floats, share: Floats) -> coupling.BothEnds:
        """Losses by pointing at either end, and by fades, where the transmitter has these errors.

        Args:
            radius_rad: Radial pointing errors of the transmitter (rad), without an uncorrected point-ahead.
            share: The share of the time of each.
        """
        sent = coupling.of_beam(self.beam.fall, radius_rad + self.shared.point_ahead_rad, share)
        return _both_ends(sent, self.receiving, self.turbulent, radius_rad, share)

    @property
    def is_random(self) -> bool:
        """Whether more is lost at random than by the transmitter's pointing."""
        return self.turbulent is not None or (self.receiving is not None and self.receiving.is_random)

    @property
    def coupling_db(self) -> float:
        """Loss into the fibre or detector of a receiver that points without error."""
        return 0.0 if self.receiving is None else self.receiving.on_axis_db


def of(m: LinkMission) -> DataLink:
    """Assemble the communication link of a mission.

    Raises ValueError where the mission does not say how its aperture is lit, or its obscuration stops the beam.
    """
    return assembled(Shared.of(m), m.communication, m.requirement, m.jitter)


def assembled(
    shared: Shared, table: Communication, requirement: LinkRequirement, jitter: JitterTable | None
) -> DataLink:
    """Assemble the communication link from its tables.

    Args:
        shared: What all links of the mission have in common.
        table: The table on the communication link.
        requirement: What is required of it.
        jitter: The table on its jitter, None where the mission has none.

    Raises:
        ValueError: As `of`.
    """
    beam = communication_beam(shared.terminals, table, shared.conventions.pointing_loss)
    receiving = None if table.coupling is None else _receiving(shared.terminals, table.coupling, table.wavelength_m)
    turbulent = shared.turbulent(table, "leo", beam.fall.half_angle_rad, None if receiving is None else receiving.end)
    lost, fade, ahead = 0.0, 0.0, shared.point_ahead_rad
    if receiving is not None and not receiving.is_random:
        lost = receiving.static_db
    if turbulent is not None or (receiving is not None and receiving.is_random):
        sent = None if jitter is None else jitter_of(jitter)
        stated = (beam.fall, sent, table.pointing_error_rad, ahead, requirement.outage)
        if receiving is not None and receiving.is_random:
            lost = _added_db(receiving, None, *stated)
        if turbulent is not None:
            fade = _added_db(receiving, turbulent, *stated) - lost
    receiver = _receiver(shared.terminals, table)
    return DataLink(shared, table, requirement, jitter, beam, receiver, receiving, lost, turbulent, fade)


def at_elevation(data: DataLink, elevation_rad: float) -> DataLink:
    """The communication link where its satellite stands higher or lower above the station.

    Args:
        data: The communication link, with a station and an altitude.
        elevation_rad: The elevation (rad).
    """
    assert data.shared.path is not None  # there is a station
    shared = replace(data.shared, path=data.shared.path.at(elevation_rad))
    return assembled(shared, data.table, data.requirement, data.jitter)


def jitter_of(table: JitterTable) -> Jitter:
    """The jitter that a table states."""
    (bias_x, bias_y), (rms_x, rms_y) = table.bias_rad, table.rms_rad
    return Jitter((bias_x, bias_y), (rms_x, rms_y))


@lru_cache(maxsize=256)  # most inputs that are moved leave both ends' errors alone
def _added_db(
    receiving: Receiving | None,
    turbulent: air.Turbulent | None,
    fall: LitAperture | GaussianFall,
    jitter: Jitter | None,
    error_rad: float,
    ahead_rad: float,
    outage: float | None,
) -> float:
    """What the receiver's random error and fades add to the loss that the transmitter's exceeds for the outage."""
    assert outage is not None  # a mission with such a receiver, or with turbulence, has to state it
    if jitter is None:
        radius, share = np.array([error_rad]), np.ones(1)
    else:
        radius, share = radial_steps(jitter)
        error_rad = float(radial_quantile(jitter, max(outage, RAREST)))
    both = _both_ends(coupling.of_beam(fall, radius + ahead_rad, share), receiving, turbulent, radius, share)
    return both.quantile_db(outage) - float(fall.loss_db(error_rad + ahead_rad))


def _both_ends(
    sent: coupling.Losses,
    receiving: Receiving | None,
    turbulent: air.Turbulent | None,
    radius_rad: Floats,
    share: Floats,
) -> coupling.BothEnds:
    received = coupling.Losses.single(0.0) if receiving is None else receiving.losses(radius_rad, share)
    if turbulent is not None:
        fades = air.losses(turbulent.fades)
        alone = received.loss_db.size == 1
        received = fades.moved(float(received.loss_db[0])) if alone else coupling.BothEnds(received, fades).sum
    return coupling.BothEnds(sent, received)


def _receiving(terminals: Terminals, table: Coupling, wavelength_m: float) -> Receiving:
    end = receiving_end(terminals, table, wavelength_m)
    jitter = None if table.jitter is None else jitter_of(table.jitter)
    return Receiving(end, float(end.loss_db(0.0)), table.pointing_error_rad or 0.0, jitter, bool(table.twin))


def receiving_end(terminals: Terminals, table: Coupling, wavelength_m: float) -> coupling.End:
    """What takes the light at the receiver.

    Args:
        terminals: The terminals, of which GEO's aperture receives.
        table: The table on what stands in its focus.
        wavelength_m: Wavelength of the light (m).

    Raises:
        ValueError: For an aberration above half the wavelength, and a fibre's cone within the obscuration.
    """
    diameter, hole, focal = terminals.geo_aperture_m, terminals.geo_obscuration or 0.0, table.focal_length_m or math.inf
    wavefront = coupling.Aberrations(
        *(each or 0.0 for each in (table.defocus_m, table.astigmatism_m, table.coma_m, table.spherical_m))
    )
    pupil, offset = coupling.Pupil(diameter, wavelength_m, hole, wavefront), (table.lateral_error_m or 0.0) / focal
    if table.into == "single-mode fibre":
        mode, tilt = table.mode_radius_m or math.nan, math.tan(table.angular_error_rad or 0.0)
        best = math.isnan(mode)
        truncation = coupling.best_truncation(hole) if best else coupling.truncation_of_mode(pupil, mode, focal)
        shift = 2.0 * focal * tilt / diameter if tilt else 0.0
        return coupling.SingleModeFibre(replace(pupil, truncation=truncation, shift=shift), offset)
    if table.into == "multi-mode fibre":
        assert table.core_radius_m is not None  # the table has it
        assert table.numerical_aperture is not None
        cone = coupling.narrowed(pupil, table.numerical_aperture, focal)
        return coupling.Disk(cone, offset, table.core_radius_m / focal)
    assert table.detector_radius_m is not None  # the table has it
    return coupling.Disk(pupil, offset, table.detector_radius_m / focal)


def communication_beam(terminals: Terminals, beam: Communication, convention: str) -> TransmittedBeam:
    """The beam of the communication link, with its pointing loss by a convention.

    Args:
        terminals: The terminals, of which LEO's aperture sends.
        beam: The table on the communication link.
        convention: "pattern" for the far field of the lit aperture, "gaussian" or "gain" for a Gaussian fall.

    Raises:
        ValueError: As `of`.
    """
    if convention == "pattern":
        lit = _lit_aperture(terminals, beam)
        return TransmittedBeam(lit.gain_db, lit)
    per_rad2 = gains.pointing_db_per_rad2(terminals.leo_aperture_m, beam.wavelength_m, convention)
    half = math.sqrt(2.0 * gains.DB_PER_NEPER / per_rad2)
    return TransmittedBeam(gains.aperture_gain_db(terminals.leo_aperture_m, beam.wavelength_m), GaussianFall(half))


def _lit_aperture(terminals: Terminals, beam: Communication) -> LitAperture:
    if beam.beam is None:
        raise ValueError('pointing loss "pattern" needs the table [communication.beam]: how the aperture is lit')
    radius = beam.beam.radius_m
    truncation = 0.0 if radius is None else terminals.leo_aperture_m / 2.0 / radius
    hole = terminals.leo_obscuration or 0.0
    return LitAperture(terminals.leo_aperture_m, beam.wavelength_m, truncation, hole, beam.beam.m_squared or 1.0)


def strehl_db(beam: Beam, convention: str) -> float:
    """Loss of a link by wavefront error in dB, from its Strehl or from the rms wavefront error.

    Args:
        beam: The table of the link.
        convention: "decibel" where the table's Strehl is a loss in dB, "ratio" where it is a ratio.

    Raises:
        ValueError: As `strehl_loss_db`.
    """
    if beam.strehl is not None:
        return gains.strehl_loss_db(beam.strehl, convention)
    ratio = gains.strehl_ratio(beam.wavefront_error_m or 0.0, beam.wavelength_m)
    return gains.strehl_loss_db(ratio, "ratio")


_COHERENT: dict[tuple[str, str], Callable[..., receivers.Receiver]] = {
    ("bpsk", "homodyne"): receivers.BpskHomodyne,
    ("bpsk", "heterodyne"): receivers.BpskHeterodyne,
    ("qpsk", "homodyne"): receivers.QpskHomodyne,
    ("qpsk", "heterodyne"): receivers.QpskHeterodyne,
}


def _receiver(terminals: Terminals, link: Communication) -> receivers.Receiver | None:
    table = link.receiver
    if table is None:
        return None
    common: dict[str, Any] = {
        "wavelength_m": link.wavelength_m,
        "bit_error_ratio": table.bit_error_ratio,
        "bandwidth_hz": table.bandwidth_hz,
        "code_gain_db": table.net_gain_db,
        "code_rate": table.rate_of_code,
    }
    extinction = math.inf if table.extinction_ratio_db is None else float(10.0 ** (table.extinction_ratio_db / 10.0))
    diode = {
        "quantum_efficiency": table.efficiency,
        "thermal_noise_a_sqrt_hz": table.thermal_noise_a_sqrt_hz,
        "dark_current_a": table.dark_current_a,
        "extinction_ratio": extinction,
    }
    counter = {"detection_efficiency": table.efficiency, "dark_count_rate_hz": table.dark_count_rate_1_s}
    filtered = {"gain_db": table.amplifier_gain_db, "optical_bandwidth_hz": table.optical_bandwidth_hz}
    avalanche = {"gain": table.avalanche_gain or 1.0, "ionisation_ratio": table.ionisation_ratio or 0.0}
    kind: Callable[..., receivers.Receiver]
    own: dict[str, Any]
    match table.detector, table.modulation:
        case "homodyne" | "heterodyne", _:
            kind = _COHERENT[table.modulation, table.detector]
            own = {"quantum_efficiency": table.efficiency or 1.0, "polarisations": table.polarisations or 1}
            own["phase_error_rad"] = table.phase_error_rad or 0.0
        case "preamplified", "dpsk":
            kind, own = receivers.DpskPreamplified, {"noise_figure_db": table.noise_figure_db}
        case "preamplified", _:
            kind, own = receivers.OokPreamplified, {"noise_figure_db": table.noise_figure_db, **filtered}
            own["extinction_ratio"] = extinction
        case "photon-counting", "ppm":
            gap = None if table.named_code is None else table.named_code.gap_db
            kind, own = receivers.PpmCounting, {**counter, "order": table.order or 2, "code_gap_db": gap}
        case "photon-counting", _:
            kind, own = receivers.OokCounting, {**counter, "extinction_ratio": extinction}
        case "pin", _:
            kind, own = receivers.OokPin, diode
        case _:
            kind, own = receivers.OokApd, {**diode, **avalanche}
    if table.detector in ("homodyne", "heterodyne", "preamplified"):
        own["background_photons_per_mode"] = _per_mode(link)
    else:
        own["background_power_w"] = _background_w(terminals, link, table)
    return kind(**common, **own)


def _per_mode(link: Communication) -> float:
    table = link.receiver
    if table is None or table.background is None:
        return 0.0
    radiance = table.background.spectral_radiance_w_m3_sr
    sky = receivers.background_photons_per_mode(radiance, link.wavelength_m)
    return sky * _receiving_transmission(link)


def _receiving_transmission(link: Communication) -> float:
    """What the receiving optics leave, of signal and background alike."""
    lost = link.receive_optics_loss_db + link.tracking_split_loss_db
    return float(10.0 ** (-lost / 10.0))


def _background_w(terminals: Terminals, link: Communication, table: ReceiverTable) -> float:
    """Background on the detector, behind the losses of the receiving optics."""
    if table.background is None:
        return table.background_power_w or 0.0
    b = table.background
    area = math.pi / 4.0 * terminals.geo_aperture_m**2 * (1.0 - (terminals.geo_obscuration or 0.0) ** 2)
    sky = receivers.background_power_w(b.spectral_radiance_w_m3_sr, area, b.field_of_view_rad, b.filter_bandwidth_m)
    return sky * _receiving_transmission(link)


def required_dbm(data: DataLink, data_rate_bit_s: ArrayLike) -> Floats:
    """Power at the receiver that each data rate needs, in dBm.

    Args:
        data: The communication link.
        data_rate_bit_s: Data rates, in bit/s, any shape.

    Raises:
        ValueError: For a rate that the receiver does not take, with the highest that it does.
    """
    rate = np.asarray(data_rate_bit_s, dtype=np.float64)
    if data.receiver is not None:
        level: Floats = 10.0 * np.log10(data.receiver.required_power_w(rate)) + 30.0
        return level
    photons = data.table.receiver_sensitivity_photon_bit
    assert photons is not None
    measured: Floats = 10.0 * np.log10(photons * gains.photon_energy_j(data.table.wavelength_m) * rate) + 30.0
    return measured


def at_capacity(data: DataLink, data_rate_bit_s: float) -> receivers.Receiver:
    """The link's receiver with the best code that there can be at the rate of its own; it must have a receiver.

    Args:
        data: The communication link.
        data_rate_bit_s: Data rate, in bit/s, of which the counts of background in a bit follow.
    """
    table, receiver = data.table.receiver, data.receiver
    assert table is not None and receiver is not None
    if isinstance(receiver, receivers.PpmCounting) and table.rate_of_code < 1.0:
        return replace(receiver, code_gain_db=0.0, code_gap_db=0.0)
    most_db = 10.0 * math.log10(table.most_code_gain(data_rate_bit_s, data.table.wavelength_m))
    right = {"phase_error_rad": 0.0} if table.modulation in QUADRATURES else {}
    return replace(receiver, code_gain_db=max(most_db, 0.0), **right)


def rate_at_power(receiver: receivers.Receiver, power_dbm: float) -> float | None:
    """Largest data rate (bit/s) that a receiver has at a power, or the highest that it takes; None where there is none.

    Args:
        receiver: The receiver, with its code.
        power_dbm: Average power at the receiver, in dBm.
    """
    from scipy.optimize import brentq

    def excess(lg_rate: float) -> float:
        return gains.dbm(float(receiver.required_power_w(10.0**lg_rate))) - power_dbm

    highest = receiver.highest_data_rate_bit_s
    slowest = min(SLOWEST_BIT_S, highest)
    if excess(math.log10(slowest)) > 0.0:
        return None
    if excess(math.log10(highest)) <= 0.0:
        return highest
    return float(10.0 ** brentq(excess, math.log10(slowest), math.log10(highest), xtol=1e-10))


def check_grid(data_rate_bit_s: Floats, pointing_error_rad: Floats) -> None:
    """Check that data rates and pointing errors can be judged.

    Args:
        data_rate_bit_s: Data rates, in bit/s, any shape.
        pointing_error_rad: Radial pointing errors, in rad, any shape.

    Raises:
        ValueError: If a data rate is not above 0, a pointing error below 0, or either not finite.
    """
    largest = '"largest" has to be solved for first'
    gains.checked("the data rate", data_rate_bit_s, Quantity("bit/s", above=0.0), largest)
    gains.checked("the pointing error", pointing_error_rad, Quantity("rad", least=0.0), "it is radial")
