"""Budgets of the beacon, its answer and the communication link, line by line.

Gains and losses are in dB; a line carries the sign. Angles are radial, measured from the line of sight.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.budget import Line, total_db
from microrad.core.units import format_input, format_quantity
from microrad.link import coupling, gains
from microrad.link.budget.air import UPLINK, Turbulent, source_of_air
from microrad.link.budget.assembly import DataLink, Shared, check_grid, strehl_db
from microrad.link.budget.receiver_lines import (
    GIVEN,
    LEFT_AT_ZERO,
    NOT_GIVEN,
    ROUNDING_DB,
    inter_symbol_lines,
    required_lines,
)
from microrad.mission.file import MissionFile
from microrad.mission.model import Source, source_text
from microrad.mission.tables.coupling import Coupling
from microrad.mission.tables.link import Beacon, Communication, half_angle_rad

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
    "pattern": ("far field of the lit aperture, by its diffraction integral", "main lobe of a perfect wavefront"),
}
_RECEIVING = "area pi D^2 / 4, all of its light on the detector"
_COUPLED = "area pi D^2 / 4; what takes its light stands below"
CHOSEN = "chosen for this evaluation"
STREHL_LOSS, POINTING_LOSS, POINT_AHEAD_LOSS = "Strehl loss", "Pointing loss", "Point-ahead loss"
COUPLING_LOSS, RECEIVE_POINTING_LOSS = "Coupling loss", "Receive pointing loss"
FREE_SPACE_LOSS, CLEAR_SKY_LOSS, SPREAD_LOSS = "Free-space loss", "Clear-sky loss", "Turbulence spread loss"
WAVEFRONT_LOSS, FADE_LOSS = "Turbulence coupling loss", "Turbulence fade"
DEEPEST_DB = 20.0  # pointing loss beyond which side lobes and scatter decide, not the main lobe
WIDEST_RAD = 0.1  # half angle or error beyond which a small angle is none
_CUT_DB = 0.1  # gain beyond which it counts that the aperture cuts a beam that is taken as whole
_MANY_MODES = 20.0  # of the normalised frequency V: about a hundred modes in each polarisation
_WORST_STREHL_DB = 5.0  # beyond it the core of the beam no longer has the shape of the perfect one


@dataclass(frozen=True, slots=True)
class LinkBudget:
    """One link: `lines` add up to the received power in dBm, `totals` are received power, required power and margin.

    What extinction and phase error add to the required power stands before it among the totals, as a part of it.

    `irradiance_w_m2` stands at the receiving aperture with every loss up to there, at the pointing error;
    `irradiance_on_axis_w_m2` is that of the same beam pointed without error and before Strehl.
    `required_irradiance_w_m2` is the irradiance there, pointing error and all, that leaves no margin.
    `radiant_intensity_w_sr` leaves the terminal along the beam's axis, optics and Strehl counted: what a far-field test
    of the terminal measures. `received_photons_per_bit` is None for a beam without a data rate.
    """

    name: str
    lines: tuple[Line, ...]
    totals: tuple[Line, ...]
    received_power_w: float
    required_power_w: float
    margin_db: float
    irradiance_w_m2: float
    irradiance_on_axis_w_m2: float
    required_irradiance_w_m2: float
    radiant_intensity_w_sr: float
    received_photons_per_bit: float | None

    @property
    def possible(self) -> bool:
        """Whether no more light arrives than was sent: a far field taken far into the near field has more."""
        return self.received_power_w <= gains.watt(self.lines[0].value)

    @property
    def closes(self) -> bool:
        """Whether there is a margin of at least 0 dB, and the budget is physically possible."""
        return self.margin_db >= -ROUNDING_DB and self.possible

    def loss_db(self, *names: str) -> float:
        """The loss of these lines together, positive; 0 for a name that is not among the lines."""
        return 0.0 - math.fsum(line.value for line in self.lines if line.name in names)

    @property
    def at_zero(self) -> tuple[str, ...]:
        """Names of the losses that are stated as 0 dB, or not given at all."""
        return tuple(line.name for line in (*self.lines, *self.totals) if line.warning == LEFT_AT_ZERO)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must not overlook: terms left at zero, and lines beyond where they hold."""
        lines = [line for line in (*self.lines, *self.totals) if line.warning not in ("", LEFT_AT_ZERO)]
        found = [f"{line.name}: {line.warning}" for line in lines]
        if self.at_zero:
            found.append(f"{LEFT_AT_ZERO}: {', '.join(self.at_zero)}; what the hardware has comes off the margin")
        return tuple(f"{self.name} budget: {each}" for each in found)


def communication_budget(
    data: DataLink,
    sources: Mapping[str, Source],
    pointing_error_rad: float | None = None,
    data_rate_bit_s: float | None = None,
    given_source: str = CHOSEN,
) -> LinkBudget:
    """Budget of the data link from LEO to GEO, at its own pointing error and data rate or at those given.

    Args:
        data: The communication link.
        sources: Where each value of the mission comes from, by key.
        pointing_error_rad: Static radial error, rad; by default the mission's.
        data_rate_bit_s: Information rate, bit/s; by default the mission's.
        given_source: Where a given value comes from: the source of its line.

    Raises:
        ValueError: If the pointing error is negative, the data rate not above zero, or the receiver does not take it.
    """
    beam = data.table
    write = Writer("communication", beam, data.shared, sources, "leo")
    error, error_source = given_or_own(
        beam.pointing_error_rad, pointing_error_rad, write.source("pointing_error"), given_source
    )
    rate, rate_source = given_or_own(beam.data_rate_bit_s, data_rate_bit_s, write.source("data_rate"), given_source)
    check_grid(np.asarray(rate), np.asarray(error))
    with_ahead = float(data.beam.fall.loss_db(error + data.shared.point_ahead_rad))
    pointing, turbulent = _pointing_line(data, error, error_source), data.turbulent
    transmit = write.transmit(_lit_gain(write, data), pointing, with_ahead, turbulent)
    receive = (
        *write.receive("geo"),
        *_coupling_lines(write, data),
        *write.wavefront(turbulent, "" if beam.coupling is None else beam.coupling.into),
        *write.fade(turbulent, data.fade_db, data.jitter is None),
        write.loss("Tracking split loss", "tracking_split_loss"),
        write.loss("Implementation loss", "implementation_loss"),
        *inter_symbol_lines(beam, write.source),
    )
    required = required_lines(data, rate, rate_source, write.source, total_db(transmit + receive))
    return _budget("Communication", transmit, receive, required, beam, rate)


def beam_budget(name: str, shared: Shared, beam: Beacon | None, sources: Mapping[str, Source]) -> LinkBudget:
    """Budget of the wide "beacon" from LEO to GEO, or of the narrow beam with which GEO gives its "answer".

    It is a Gaussian beam, its divergence read by the mission's convention.

    Args:
        name: "beacon" or "answer", the name of its table.
        shared: Terminals, conventions, air and point-ahead of the mission.
        beam: The table itself; None where the mission has none.
        sources: Where each value of the mission comes from, by key.

    Raises:
        ValueError: If the mission has no such beam.
    """
    if beam is None:
        raise ValueError(f"the mission has no table [{name}]")
    ends = ("leo", "geo") if name == "beacon" else ("geo", "leo")
    return _gaussian_budget(Writer(name, beam, shared, sources, ends[0]), beam, ends[1])


def _gaussian_budget(write: "Writer", beam: Beacon, receiver: str) -> LinkBudget:
    half, error = half_angle_rad(beam.divergence_rad, write.shared.conventions.divergence), beam.pointing_error_rad
    theta = f"theta = {format_quantity(half, 'rad')} half angle at 1/e2"
    far = "Gaussian beam, far field, not cut by its aperture"
    shape = source_text(write.sources, f"{write.table}.divergence", "conventions.divergence")
    doubts = _both(
        _wide("the half angle", half),
        _cut_by_aperture(half, write.aperture_m(write.end), beam.wavelength_m),
        _blocked(getattr(write.shared.terminals, f"{write.end}_obscuration") or 0.0),
    )
    gain = Line("Beam gain", gains.gaussian_beam_gain_db(half), "dB", f"8 / theta^2, {theta}", shape, far, doubts)
    basis = f"exp(-2 (error / theta)^2), error = {format_input(error, 'rad')}, {theta}"
    loss = 0.0 - float(gains.gaussian_pointing_loss_db(error, half))
    doubts = _both(_wide("the error", error), _deep(loss))
    source, regime = write.source("pointing_error"), f"{far}; static error"
    pointing = Line(POINTING_LOSS, loss, "dB", basis, source, regime, doubts)
    with_ahead = float(gains.gaussian_pointing_loss_db(error + write.shared.point_ahead_rad, half))
    level = gains.dbm(beam.required_power_w)
    required = Line("Required power", level, "dBm", "as given", write.source("required_power"), GIVEN)
    turbulent = write.shared.turbulent(beam, write.end, half, None)
    transmit = write.transmit((gain,), pointing, with_ahead, turbulent)
    lost = 0.0 if turbulent is None else turbulent.fades.loss_db(write.shared.outage or 0.5)
    receive = (*write.receive(receiver), *write.fade(turbulent, lost, alone=True))
    return _budget(write.table.capitalize(), transmit, receive, (required,), beam)


def _cut_by_aperture(half_angle_rad: float, aperture_m: float, wavelength_m: float) -> str:
    """The warning that a Gaussian beam of this half angle has less gain, as the aperture that it leaves cuts it."""
    radius = wavelength_m / (math.pi * half_angle_rad)
    truncation = aperture_m / 2.0 / radius
    lost = -20.0 * math.log10(-math.expm1(-(truncation**2)))  # (1 - exp(-a^2))^2, Klein and Degnan 1974
    if lost <= _CUT_DB:
        return ""
    return (
        f"a Gaussian beam this narrow is {format_quantity(2.0 * radius, 'm')} wide at 1/e2, and the aperture of "
        f"{format_input(aperture_m, 'm')} cuts it: {lost:.2f} dB less gain than this, and a wider core"
    )


def _blocked(obscuration: float) -> str:
    """The warning that an obscuration of the terminal that sends a Gaussian beam is not in its gain."""
    if not obscuration:
        return ""
    return (
        f"the obscuration of {obscuration:g} is not in it: what it stops of the beam belongs into transmit_optics_loss"
    )


def _wide(what: str, angle_rad: float) -> str:
    """The warning that an angle is not small."""
    if angle_rad <= WIDEST_RAD:
        return ""
    return f"{what} of {format_quantity(angle_rad, 'rad', 3)} is above {WIDEST_RAD:g} rad, where small angles end"


def _both(*warnings: str) -> str:
    """The warnings that there are, as one."""
    return "; ".join(each for each in warnings if each)


def _deep(loss_db: float) -> str:
    if abs(loss_db) <= DEEPEST_DB:
        return ""
    return f"beyond {DEEPEST_DB:g} dB the wings and the scatter of a real beam decide, not this formula"


def given_or_own(own: float, given: float | None, source: str, given_source: str) -> tuple[float, str]:
    """The value in force and its source: the one given, else the mission's own.

    Args:
        own: The mission's own value.
        given: A value in place of it, None to keep the mission's own.
        source: Where the mission's own value comes from.
        given_source: Where the given value comes from.
    """
    return (own, source) if given is None else (float(given), given_source)


@dataclass(frozen=True, slots=True)
class Writer:
    """Writes the lines of one link, the table `table` of the mission, which leaves the terminal `end`."""

    table: str
    beam: Beacon | Communication
    shared: Shared
    sources: Mapping[str, Source]
    end: str

    def source(self, key: str) -> str:
        """Where a key of the link's table comes from."""
        return source_text(self.sources, f"{self.table}.{key}")

    def aperture_m(self, end: str) -> float:
        """Diameter of the terminal "leo" or "geo"."""
        return float(getattr(self.shared.terminals, f"{end}_aperture_m"))

    def loss(self, name: str, key: str) -> Line:
        """A loss that the mission gives in dB; 0 dB is a line like any other.

        Args:
            name: Name of the line.
            key: Field of the table without its `_db`; the loss is positive there and negative in the line.
        """
        value = getattr(self.beam, f"{key}_db")
        return Line(name, 0.0 - value, "dB", "as given", self.source(key), GIVEN, "" if value else LEFT_AT_ZERO)

    def gain(self, end: str, regime: str) -> Line:
        """Gain of a whole, evenly lit aperture.

        Args:
            end: Terminal whose aperture it is, "leo" or "geo".
            regime: Where the formula holds, in words for the line.
        """
        diameter, wavelength = self.aperture_m(end), self.beam.wavelength_m
        shown = f"D = {format_input(diameter, 'm')}, lambda = {format_input(wavelength, 'm')}"
        source = source_text(self.sources, f"terminals.{end}_aperture", f"{self.table}.wavelength")
        name = f"{self.shared.terminals.called(end)} aperture gain"
        return Line(
            name, gains.aperture_gain_db(diameter, wavelength), "dB", f"(pi D / lambda)^2, {shown}", source, regime
        )

    def receive(self, end: str) -> tuple[Line, ...]:
        """Lines from the receiving aperture on: its gain, its obscuration if the mission gives one, its optics."""
        hole = getattr(self.shared.terminals, f"{end}_obscuration")
        coupled = isinstance(self.beam, Communication) and self.beam.coupling is not None
        regime = _COUPLED if coupled else _RECEIVING
        lines = [self.gain(end, regime)]
        if hole is not None:
            name = f"{self.shared.terminals.called(end)} obscuration loss"
            source = source_text(self.sources, f"terminals.{end}_obscuration")
            value, basis = 0.0 - gains.obscuration_loss_db(hole), f"1 - e^2, e = {hole:g}"
            lines.append(Line(name, value, "dB", basis, source, regime))
        return (*lines, self.loss("Receive optics loss", "receive_optics_loss"))

    def transmit(
        self, gain: tuple[Line, ...], pointing: Line, with_ahead_db: float, turbulent: Turbulent | None
    ) -> tuple[Line, ...]:
        """Lines of everything up to the receiving aperture.

        Args:
            gain: Lines of the transmitting aperture's gain.
            pointing: Line of the pointing loss, negative in dB.
            with_ahead_db: Pointing loss in dB, positive, once an uncorrected point-ahead is added to the error.
            turbulent: What turbulence does, None in still air.
        """
        beam = self.beam
        power = f"P = {format_input(beam.transmit_power_w, 'W')}"
        channel = [] if self.shared.channel is None else [self._channel()]
        return (
            Line(
                "Transmit power", gains.dbm(beam.transmit_power_w), "dBm", power, self.source("transmit_power"), GIVEN
            ),
            *gain,
            self.loss("Transmit optics loss", "transmit_optics_loss"),
            self._strehl(),
            pointing,
            self._ahead(with_ahead_db, pointing.value),
            self._space(),
            *channel,
            *self.spread(turbulent),
        )

    def _space(self) -> Line:
        beam, shared = self.beam, self.shared
        range_m = shared.range_m(beam)
        basis, path = f"(lambda / (4 pi R))^2, R = {format_input(range_m, 'm')}", shared.path
        source = self.source("distance")
        if path is not None and beam.distance_m is None:
            basis += f" at {math.degrees(path.elevation_rad):.4g} deg of elevation"
            source = source_text(self.sources, *path.sources)
        elif path is not None:
            basis += f": {format_quantity(path.altitude_of(range_m), 'm')} up, at the elevation of the channel"
        value = -gains.free_space_loss_db(range_m, beam.wavelength_m)
        largest = max(shared.terminals.leo_aperture_m, shared.terminals.geo_aperture_m)
        far = gains.far_field_m(largest, beam.wavelength_m)
        near = "" if range_m >= far else f"nearer than the far field, which begins at {format_quantity(far, 'm')}"
        doubts = _both(near, "" if path is None else path.doubt)
        return Line(FREE_SPACE_LOSS, value, "dB", basis, source, "vacuum, far field", doubts)

    def _channel(self) -> Line:
        shared, channel, path = self.shared, self.shared.channel, self.shared.path
        assert channel is not None and path is not None
        mass = gains.air_mass(path.elevation_rad)
        if channel.zenith_transmission is not None:
            basis, keys = f"T^m, T = {channel.zenith_transmission:g} to the zenith", ["channel.zenith_transmission"]
        else:
            basis = "Rayleigh scattering (Hansen and Travis 1974), haze and absorption, times m"
            keys = [f"channel.{key}" for key in ("aerosol_depth", "angstrom_exponent", "absorption")]
        basis += f", air mass m = {mass:.3f} (Kasten and Young 1989)"
        source = source_text(self.sources, *keys, path.sources[0])
        still = channel.turbulence is None
        regime = f"clear sky, from 10 degrees of elevation; {'no turbulence, ' if still else ''}no clouds"
        doubt = "turbulence is not in this budget: scintillation and beam wander come on top" if still else ""
        value = 0.0 - shared.clear_sky_db(self.beam.wavelength_m)
        return Line(CLEAR_SKY_LOSS, value, "dB", basis, source, regime, doubt)

    def spread(self, turbulent: Turbulent | None) -> tuple[Line, ...]:
        """Line of what a turbulent path takes of an uplink by a wider beam; none for a downlink."""
        if turbulent is None or turbulent.direction != UPLINK:
            return ()
        r0 = format_quantity(turbulent.path.fried_m, "m", 3)
        modes, source = self._corrected()
        basis = f"12 lg(1 + (D0 / r0)^(5/3)), D0 = sqrt(8) W0, r0 = {r0}"
        regime = "mean power on the axis, wander in it (Andrews and Phillips 2005)"
        if modes:
            basis += f", or what {modes} corrected modes and the point-ahead angle leave, if that is less"
        value = 0.0 - turbulent.spread_db
        return (Line(SPREAD_LOSS, value, "dB", basis, source, regime, _both(*turbulent.doubts)),)

    def wavefront(self, turbulent: Turbulent | None, into: str) -> tuple[Line, ...]:
        """Line of what a fibre or detector takes less of a turbulent wavefront.

        Args:
            turbulent: What turbulence does, None in still air.
            into: What takes the light, "" where it takes all.
        """
        if turbulent is None or not into or turbulent.direction == UPLINK:
            return ()
        r0 = format_quantity(turbulent.path.fried_m, "m", 3)
        modes, source = self._corrected()
        basis, regime = f"mean power into the {into}, r0 = {r0}", "Kolmogorov's turbulence, long exposure"
        if modes:
            basis, regime = f"{basis}, {modes} modes corrected", "Kolmogorov's turbulence, what correction leaves of it"
        value = 0.0 - turbulent.wavefront_db
        return (Line(WAVEFRONT_LOSS, value, "dB", basis, source, regime),)

    def _corrected(self) -> tuple[int, str]:
        """How many modes of the wavefront are corrected, and where the air and that come from."""
        table = self.shared.channel
        modes = 0 if table is None or table.turbulence is None else table.turbulence.corrected_modes
        return modes, source_of_air(self.sources, *(["corrected_modes"] if modes else []))

    def fade(self, turbulent: Turbulent | None, loss_db: float, alone: bool) -> tuple[Line, ...]:
        """Line of the fades of the air.

        Args:
            turbulent: What turbulence does, None in still air.
            loss_db: The loss, positive.
            alone: Whether nothing else is random.
        """
        if turbulent is None:
            return ()
        outage = self.shared.outage or 0.0
        basis = f"scintillation index {turbulent.index:.3g}"
        if turbulent.direction == UPLINK:
            basis += f", wander of {format_quantity(turbulent.wander_rad, 'rad', 3)} rms"
        said = "exceeded" if alone else "what it adds to the pointing loss, all together exceeded"
        basis += f"; {said} for {100.0 * outage:g} % of the time"
        source = f"{source_of_air(self.sources, 'fades')}; {source_text(self.sources, 'requirement.outage')}"
        doubts = _both(*turbulent.doubts) if turbulent.direction != UPLINK else ""
        return (Line(FADE_LOSS, 0.0 - loss_db, "dB", basis, source, "any strength, by its index", doubts),)

    def _ahead(self, with_ahead_db: float, pointing_db: float) -> Line:
        ahead = self.shared.point_ahead
        regime = "added to the pointing error in its worst direction"
        if ahead is None:
            return Line(POINT_AHEAD_LOSS, 0.0, "dB", "taken as corrected", NOT_GIVEN, regime, LEFT_AT_ZERO)
        source = source_text(self.sources, "point_ahead.transverse_velocity", "point_ahead.corrected")
        if ahead.corrected:
            return Line(
                POINT_AHEAD_LOSS,
                0.0,
                "dB",
                "corrected; what that leaves is for the pointing error to hold",
                source,
                regime,
            )
        basis = f"not corrected: 2 v / c = {format_quantity(self.shared.point_ahead_rad, 'rad')}"
        return Line(POINT_AHEAD_LOSS, -with_ahead_db - pointing_db, "dB", basis, source, regime, _deep(with_ahead_db))

    def _strehl(self) -> Line:
        beam, convention = self.beam, self.shared.conventions.strehl
        loss = strehl_db(beam, convention)
        regime = "on axis, small wavefront error (Marechal)"
        doubt = "" if loss <= _WORST_STREHL_DB else f"beyond {_WORST_STREHL_DB:g} dB a beam has no core to speak of"
        if beam.wavefront_error_m is not None:
            basis = f"exp(-(2 pi s / lambda)^2), s = {format_input(beam.wavefront_error_m, 'm')} rms"
            source = source_text(self.sources, f"{self.table}.wavefront_error")
        else:
            basis = "as given in dB" if convention == "decibel" else f"Strehl ratio {beam.strehl:g}"
            source = source_text(self.sources, f"{self.table}.strehl", "conventions.strehl")
        return Line(STREHL_LOSS, 0.0 - loss, "dB", basis, source, regime, doubt if loss else LEFT_AT_ZERO)


def _lit_gain(write: Writer, data: DataLink) -> tuple[Line, ...]:
    """Gain of the transmitting aperture and, where the mission says how it is lit, what that changes."""
    beam, lit = data.table, data.beam
    wide = _wide("the half angle", lit.fall.half_angle_rad)
    if beam.beam is None:
        hole = data.shared.terminals.leo_obscuration or 0.0
        left_out = f'the obscuration of {hole:g} is not in it: only pointing_loss = "pattern" takes it into account'
        doubts = _both(wide, left_out if hole else "")
        return (replace(write.gain("leo", _TRANSMITTING), warning=doubts),)
    whole = replace(write.gain("leo", "evenly lit and unobscured; how it is lit stands below"), warning=wide)
    shape, hole = beam.beam, data.shared.terminals.leo_obscuration or 0.0
    keys = ["communication.beam.profile"]
    if shape.radius_m is None:
        basis, regime = "1 - e^2, lit evenly over the open area", "power counted behind the aperture"
    else:
        truncation = write.aperture_m("leo") / 2.0 / shape.radius_m
        basis = f"2/a^2 (exp(-a^2) - exp(-a^2 e^2))^2, a = {truncation:.4g}, M^2 = {shape.m_squared:g}"
        regime = "Gaussian beam, light cut off included (Klein and Degnan 1974); M^2 widens the far field"
        keys += ["communication.beam.radius", "communication.beam.m_squared"]
    basis += f", e = {hole:g}"
    source = source_text(write.sources, *keys)
    return (whole, Line("Illumination", lit.gain_db - whole.value, "dB", basis, source, regime))


def _coupling_lines(write: Writer, data: DataLink) -> tuple[Line, ...]:
    """What the fibre or the detector does not take, pointed without error, and what the receiver's pointing costs."""
    receiving, table = data.receiving, data.table.coupling
    if receiving is None or table is None:
        return ()
    end, name = receiving.end, f"{write.table}.coupling"
    keys = [f"{name}.{key}" for key in table.keys_of_light]
    share = float(end.share(0.0))
    basis = f"{table.into}: {share:.4g} of the light in the aperture"
    regime = "plane wave, scalar optics, no stray light"
    if isinstance(end, coupling.SingleModeFibre):
        basis += f", a = {end.pupil.truncation:.4g}"
        regime = f"overlap with a Gaussian mode, {regime}"
    doubts = _few_modes(table, data.table.wavelength_m)
    lines = [
        Line(COUPLING_LOSS, 0.0 - data.coupling_db, "dB", basis, source_text(write.sources, *keys), regime, doubts)
    ]
    value, warning = 0.0 - data.receive_pointing_db, _deep(data.receive_pointing_db)
    if receiving.is_random:
        outage = data.requirement.outage or 0.0
        basis = f"what it adds to the pointing loss, both together exceeded for {100.0 * outage:g} % of the time"
        own = "twin" if receiving.twin else "jitter.rms"
        regime = "errors of the two ends independent"
    elif table.pointing_error_rad is None:
        basis, own, regime, warning = "taken as none", "", "static error in its worst direction", LEFT_AT_ZERO
    else:
        basis = f"error = {format_input(table.pointing_error_rad, 'rad')}"
        own, regime = "pointing_error", "static error in its worst direction"
        warning = warning if table.pointing_error_rad else LEFT_AT_ZERO
    source = source_text(write.sources, f"{name}.{own}") if own else NOT_GIVEN
    return (*lines, Line(RECEIVE_POINTING_LOSS, value, "dB", basis, source, regime, warning))


def _few_modes(table: Coupling, wavelength_m: float) -> str:
    """The warning that a fibre has too few modes to take all light that falls on its core."""
    if table.core_radius_m is None or table.numerical_aperture is None:
        return ""
    parameter = 2.0 * math.pi * table.core_radius_m * table.numerical_aperture / wavelength_m
    if parameter > _MANY_MODES:
        return ""
    return f"the fibre has V = {parameter:.3g}, too few modes (below {_MANY_MODES:g}) to take all light on its core"


def _pointing_line(data: DataLink, error_rad: float, source: str) -> Line:
    loss = 0.0 - float(data.beam.fall.loss_db(error_rad))
    formula, regime = _POINTING_BASIS[data.shared.conventions.pointing_loss]
    basis = f"{formula}, error = {format_input(error_rad, 'rad')}"
    doubts = _both(_wide("the error", error_rad), _deep(loss))
    return Line(POINTING_LOSS, loss, "dB", basis, source, f"{regime}; static error", doubts)


def _budget(
    name: str,
    transmit: tuple[Line, ...],
    receive: tuple[Line, ...],
    needed: tuple[Line, ...],
    beam: Beacon | Communication,
    rate_bit_s: float | None = None,
) -> LinkBudget:
    *parts, required = needed
    received_dbm = total_db(transmit + receive)
    photons, light = None, "sum of the lines above"
    if rate_bit_s is not None:
        photons = gains.watt(received_dbm) / gains.photon_energy_j(beam.wavelength_m) / rate_bit_s
        light += f": {photons:.4g} photon/bit"
    margin = received_dbm - required.value
    mispointing = (STREHL_LOSS, POINTING_LOSS, POINT_AHEAD_LOSS)
    on_axis = [line for line in transmit if line.name not in mispointing]
    path = (POINTING_LOSS, POINT_AHEAD_LOSS, FREE_SPACE_LOSS, CLEAR_SKY_LOSS, SPREAD_LOSS)
    leaving = [line for line in transmit if line.name not in path]
    return LinkBudget(
        name=name,
        lines=transmit + receive,
        totals=(
            Line("Received power", received_dbm, "dBm", light, "computed", _AS_LINES),
            *parts,
            required,
            Line("Margin", margin, "dB", "received power less required power", "computed", _AS_LINES),
        ),
        received_power_w=gains.watt(received_dbm),
        required_power_w=gains.watt(required.value),
        margin_db=margin,
        irradiance_w_m2=_irradiance(total_db(transmit), beam.wavelength_m),
        irradiance_on_axis_w_m2=_irradiance(total_db(on_axis), beam.wavelength_m),
        required_irradiance_w_m2=_irradiance(total_db(transmit) - margin, beam.wavelength_m),
        radiant_intensity_w_sr=gains.watt(total_db(leaving)) / (4.0 * math.pi),
        received_photons_per_bit=photons,
    )


def _irradiance(isotropic_dbm: float, wavelength_m: float) -> float:
    """Irradiance from the power that an isotropic antenna, of effective area lambda^2 / (4 pi), would receive."""
    return gains.watt(isotropic_dbm) * 4.0 * math.pi / wavelength_m**2


def tracking_light_w(file: MissionFile) -> float | None:
    """Power (W) on the tracking sensor of `[fine_pointing]`, of which its noise follows.

    As its quad cell states it, else that of the answer's budget. None where the noise is given or there is no loop.
    """
    f = file.mission.fine_pointing
    cell = None if f is None else f.optical_sensor.quad_cell
    if cell is None:
        return None
    if cell.received_power_w is not None:
        return cell.received_power_w
    return beam_budget("answer", Shared.of(file.mission), file.mission.answer, file.sources).received_power_w
