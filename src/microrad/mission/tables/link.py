"""The tables of a mission about its links: terminals, conventions, beams, receivers, channel, what is required."""

import math
from collections.abc import Callable, Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.core import phase_error
from microrad.core.capacity import Code, excess_noise_factor
from microrad.core.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S, format_limit, format_quantity
from microrad.mission.codes import NamedCode, codes, nearest
from microrad.mission.fields import OrWord, Problem, Quantity, Share, Table, Whole
from microrad.mission.tables.coupling import Coupling
from microrad.mission.tables.mirror import ANGLE_MOST, Angle, Name

# the upper bounds are no limits of technology: they catch a wrong prefix, "5 km" for an aperture of 5 cm
AngleOrZero = Annotated[float, Quantity("rad", "urad", least=0.0, most=ANGLE_MOST)]
Power = Annotated[float, Quantity("W", above=0.0, most=1e6)]
PowerOrZero = Annotated[float, Quantity("W", "pW", least=0.0, most=1e6)]
Threshold = Annotated[float, Quantity("W", "pW", above=0.0, most=1e6)]
Aperture = Annotated[float, Quantity("m", "cm", above=0.0, most=100.0)]
Wavelength = Annotated[float, Quantity("m", "um", least=1e-8, most=1e-2)]
Distance = Annotated[float, Quantity("m", "km", above=0.0, most=1e13)]
Loss = Annotated[float, Quantity("dB", least=0.0)]
Strehl = Annotated[float, Quantity("", least=0.0, most=1e3)]
Obscuration = Annotated[float, Quantity("", least=0.0, most=0.95)]
Efficiency = Annotated[float, Quantity("", above=0.0, most=1.0)]
Bandwidth = Annotated[float, Quantity("Hz", "GHz", above=0.0, most=1e15)]
Current = Annotated[float, Quantity("A", "nA", least=0.0, most=1.0)]
NoiseDensity = Annotated[float, Quantity("A/sqrt(Hz)", "pA/sqrt(Hz)", least=0.0, most=1e-3)]

LARGEST = "largest"
"""What a mission writes for the data rate that is to be solved for."""


class Terminals(Table):
    """The two optical terminals: the satellite's own in low orbit ("leo") and its partner ("geo")."""

    leo_aperture_m: Aperture = Field(description="diameter of the telescope of the low satellite")
    geo_aperture_m: Aperture = Field(description="diameter of the telescope of its partner")
    leo_obscuration: Obscuration | None = Field(
        default=None, description="diameter of the central obscuration over that of the aperture"
    )
    geo_obscuration: Obscuration | None = Field(
        default=None, description="diameter of the central obscuration over that of the aperture"
    )
    leo_name: Name | None = Field(default=None, description='what budgets call it in place of "LEO"')
    geo_name: Name | None = Field(default=None, description='what budgets call it in place of "GEO"')

    def called(self, end: str) -> str:
        """What budgets call the terminal "leo" or "geo"."""
        return (self.leo_name if end == "leo" else self.geo_name) or end.upper()


UNUSED: Literal["unused"] = "unused"
"""A convention of what no beam states."""


class LinkConventions(Table):
    """How numbers of a link are read that a source leaves ambiguous."""

    pointing_loss: Literal["gaussian", "gain", "pattern"] = Field(
        description="gaussian: beam with 1/e2 radius D/2 at the aperture; gain: exp(-G theta^2); "
        "pattern: the far field of communication.beam"
    )
    strehl: Literal["decibel", "ratio", "unused"] = Field(
        default=UNUSED, description="decibel: a loss in dB; ratio: a number up to 1; unused: no beam states one"
    )
    divergence: Literal["full-1/e2", "half-1/e2", "unused"] = Field(
        default=UNUSED, description="which angle a beam's divergence is; unused: no beam states one"
    )


class BeamShape(Table):
    """How a beam lights the aperture that it leaves."""

    profile: Literal["uniform", "gaussian"] = Field(description="gaussian: cut by the aperture and its obscuration")
    radius_m: Aperture | None = Field(default=None, description="gaussian: at 1/e2 of intensity, in the aperture")
    m_squared: Annotated[float, Quantity("", least=1.0, most=1e3)] | None = Field(
        default=None, description="beam quality, divergence over that of an ideal beam"
    )

    def problems(self) -> Iterator[Problem]:
        """A radius and a beam quality exactly for a Gaussian."""
        needed = {"radius": '"2 cm"', "m_squared": "1.1"} if self.profile == "gaussian" else {}
        yield from self.choice_problems(
            f'profile = "{self.profile}"', needed, instead=lambda key: 'profile = "gaussian"'
        )


class Beam(Table):
    """What a link has whatever its beam: power, wavelength, quality, distance and losses (all losses positive)."""

    transmit_power_w: Power = Field(description="optical power before the optics")
    wavelength_m: Wavelength = Field(description="of the light, in vacuum")
    strehl: Strehl | None = Field(default=None, description="decibel or ratio as conventions.strehl says")
    wavefront_error_m: Annotated[float, Quantity("m", "nm", least=0.0, most=1e-3)] | None = Field(
        default=None, description="rms, in place of strehl"
    )
    pointing_error_rad: AngleOrZero = Field(description="off the line of sight, radial")
    distance_m: Distance | None = Field(
        default=None, description="between the terminals; absent where it follows from a station and an altitude"
    )
    transmit_optics_loss_db: Loss = Field(description="from the laser to the transmitting telescope's exit")
    receive_optics_loss_db: Loss = Field(description="from the receiving telescope's entrance to the detector")

    def problems(self) -> Iterator[Problem]:
        """Quality said once, and within the wavefront errors for which it means something."""
        if self.strehl is None and self.wavefront_error_m is None:
            yield Problem("strehl", "is missing, and so is wavefront_error", "strehl = 0.4 would do")
        if self.strehl is not None and self.wavefront_error_m is not None:
            yield Problem("strehl", "stands beside wavefront_error", "one of the two removed")
        if self.wavefront_error_m is not None and self.wavefront_error_m > self.wavelength_m / 4:
            limit = format_limit(self.wavelength_m / 4, "m")
            reason = f"is above a quarter of the wavelength ({limit}): such a beam has no core to point"
            yield Problem("wavefront_error", reason, f"at most {limit}")


class Beacon(Beam):
    """A wide Gaussian beam to be found by: the beacon, and the answer to it."""

    divergence_rad: Angle = Field(description="full or half angle as conventions.divergence says")
    required_power_w: Threshold = Field(description="power that the sensor needs")


_ALIKE_DB = 1e-3
_DETECTORS: dict[str, tuple[str, ...]] = {
    "ook": ("photon-counting", "pin", "apd", "preamplified"),
    "dpsk": ("preamplified",),
    "bpsk": ("homodyne", "heterodyne"),
    "qpsk": ("homodyne", "heterodyne"),
    "ppm": ("photon-counting",),
}
"""The detectors that each modulation is received with."""

_NEEDS: dict[str, dict[str, str]] = {
    "photon-counting": {"efficiency": "0.5", "dark_count_rate": '"1000 1/s"'},
    "pin": {"efficiency": "0.8", "dark_current": '"1 nA"', "thermal_noise": '"2 pA/sqrt(Hz)"'},
    "apd": {
        "efficiency": "0.8",
        "dark_current": '"1 nA"',
        "thermal_noise": '"2 pA/sqrt(Hz)"',
        "avalanche_gain": "20.0",
        "ionisation_ratio": "0.2",
    },
    "preamplified": {"noise_figure": '"4 dB"'},
    "homodyne": {"efficiency": "0.8"},
    "heterodyne": {"efficiency": "0.8"},
}
"""The keys that each detector needs, with a value that could stand there."""


QUADRATURES = {"bpsk": 1, "qpsk": 2}
"""How many quadratures of the field carry a bit of their own, of modulations that are received with an oscillator."""


class Background(Table):
    """Light of a sky or a bright body that fills the receiver's field of view."""

    spectral_radiance_w_m3_sr: Annotated[float, Quantity("W/(m^3 sr)", "W/(m^2 sr um)", least=0.0)] = Field(
        description="both polarisations"
    )
    field_of_view_rad: Angle = Field(description="full angle of the field stop, on the sky")
    filter_bandwidth_m: Annotated[float, Quantity("m", "nm", above=0.0, most=1e-5)] = Field(
        description="full width of the optical filter"
    )


class Receiver(Table):
    """A receiver by what it is made of, in place of a measured sensitivity."""

    modulation: Literal["ook", "dpsk", "bpsk", "qpsk", "ppm"] = Field(description="how bits are put on the light")
    detector: Literal["photon-counting", "pin", "apd", "preamplified", "homodyne", "heterodyne"] = Field(
        description="how the light is turned into a signal"
    )
    bit_error_ratio: Annotated[float, Share("", least=1e-18, below=0.5)] = Field(
        description="at which the link is judged"
    )
    code: Name | None = Field(default=None, description="by its name, in place of code_gain and code_rate")
    code_gain_db: Loss | None = Field(default=None, description="net, in power per information bit")
    code_rate: Efficiency | None = Field(default=None, description="information bits per bit sent")
    bandwidth_hz: Bandwidth = Field(description="highest symbol rate, slot rate for ppm")
    background_power_w: PowerOrZero | None = Field(default=None, description="behind the filter, on the detector")
    background: Background | None = Field(default=None, description="in place of background_power")
    order: Annotated[int, Whole("", least=2, most=2**20)] | None = Field(
        default=None, description="ppm: slots in a symbol, a power of two"
    )
    extinction_ratio_db: Annotated[float, Quantity("dB", above=0.0)] | None = Field(
        default=None, description="ook: power of a mark over that of a space"
    )
    efficiency: Efficiency | None = Field(default=None, description="electrons per photon, all detectors but amplified")
    dark_count_rate_1_s: Annotated[float, Quantity("1/s", least=0.0, most=1e12)] | None = Field(
        default=None, description="counts a second without light"
    )
    dark_current_a: Current | None = Field(default=None, description="before avalanche gain")
    thermal_noise_a_sqrt_hz: NoiseDensity | None = Field(
        default=None, description="one-sided, referred to the amplifier's input"
    )
    avalanche_gain: Annotated[float, Quantity("", least=1.0, most=1e6)] | None = Field(
        default=None, description="electrons for each one that light sets free"
    )
    ionisation_ratio: Annotated[float, Quantity("", least=0.0, most=1.0)] | None = Field(
        default=None, description="of holes to electrons: 0 multiplies with the least noise"
    )
    noise_figure_db: Annotated[float, Quantity("dB", least=3.0)] | None = Field(
        default=None, description="of the optical amplifier; 3 dB is the quantum limit"
    )
    amplifier_gain_db: Annotated[float, Quantity("dB", least=10.0)] | None = Field(
        default=None, description="of the optical amplifier"
    )
    optical_bandwidth_hz: Bandwidth | None = Field(default=None, description="of the filter behind the amplifier")
    polarisations: Annotated[int, Whole("", least=1, most=2)] | None = Field(
        default=None, description="bpsk, qpsk: how many carry bits of their own; absent: 1"
    )
    phase_error_rad: Annotated[float, Quantity("rad", "deg", least=0.0, most=phase_error.LARGEST_RAD)] | None = Field(
        default=None, description="bpsk, qpsk: rms, what the phase lock leaves in a symbol; absent: 0"
    )
    inter_symbol_loss_db: Loss | None = Field(
        default=None, description="power that interference between symbols costs; absent: 0"
    )

    def problems(self) -> Iterator[Problem]:
        """A detector that receives the modulation, and the keys of both and no others."""
        fitting = _DETECTORS[self.modulation]
        if self.detector not in fitting:
            choices = " or ".join(f'detector = "{each}"' for each in fitting)
            yield Problem("detector", f'does not receive modulation = "{self.modulation}"', choices)
            return
        wanted, what = dict(_NEEDS[self.detector]), f'modulation = "{self.modulation}", detector = "{self.detector}"'
        if self.modulation == "ppm":
            wanted["order"] = "16"
        if self.modulation == "ook":
            wanted["extinction_ratio"] = '"20 dB"'
            if self.detector == "preamplified":
                wanted |= {"optical_bandwidth": '"20 GHz"', "amplifier_gain": '"35 dB"'}
        if self.background is None and self.detector not in ("homodyne", "heterodyne", "preamplified"):
            wanted["background_power"] = '"0 pW"'
        instead = () if self.background is None else ("background_power",)
        coherent = ("polarisations", "phase_error") if self.modulation in QUADRATURES else ()
        free = ("background", *instead, *coherent, "inter_symbol_loss", "code", "code_gain", "code_rate")
        yield from self.choice_problems(what, wanted, free)
        yield from self._code_problems()
        yield from self._phase_problems()
        if self.background is not None and self.background_power_w is not None:
            yield Problem("background_power", "stands beside the table background", "one of the two removed")
        if self.extinction_ratio_db is not None and self.extinction_ratio_db < _ALIKE_DB:
            reason = f"is below {_ALIKE_DB:g} dB, where marks and spaces are alike"
            yield Problem("extinction_ratio", reason, 'extinction_ratio = "20 dB" would do')
        if self.order is not None and self.order & (self.order - 1):
            yield Problem("order", "is no power of two", "order = 16 would do")

    @property
    def named_code(self) -> NamedCode | None:
        """The code that is given by its name."""
        return None if self.code is None else codes().get(self.code)

    @property
    def rate_of_code(self) -> float:
        """Information bits per bit sent, of a code by its name or as given."""
        code = self.named_code
        return self.code_rate or 1.0 if code is None else code.rate

    @property
    def net_gain_db(self) -> float:
        """Net gain of the code in dB; 0 of one whose threshold is a distance from capacity (`gap_db`)."""
        code = self.named_code
        if code is None:
            return self.code_gain_db or 0.0
        return 0.0 if code.gap_db is not None else code.net_gain_db(self.bit_error_ratio)

    @property
    def reaches_ratio(self) -> bool:
        """Whether some power reaches the bit error ratio, whatever phase error is left."""
        error, quadratures = self.phase_error_rad or 0.0, QUADRATURES.get(self.modulation)
        return quadratures is None or phase_error.floor(error, quadratures) < self.bit_error_ratio

    def _code_problems(self) -> Iterator[Problem]:
        """A code said one way; by its name only where its source says what it needs here."""
        if self.code is None:
            for key, value, example in (
                ("code_gain", self.code_gain_db, '"0 dB"'),
                ("code_rate", self.code_rate, "1.0"),
            ):
                if value is None:
                    yield Problem(key, "is missing, and so is code", f"{key} = {example} would do without a code")
            return
        for key, value in (("code_gain", self.code_gain_db), ("code_rate", self.code_rate)):
            if value is not None:
                yield Problem(key, "stands beside code, which has its own", "one of the two removed")
        code = self.named_code
        if code is None:
            yield Problem("code", f'is "{self.code}", which is no code that is known here', nearest(self.code))
        elif self.modulation not in code.modulations:
            reason = f"is a code for {' and '.join(code.modulations)} ({code.source}), not for {self.modulation}"
            yield Problem("code", reason, "another code, or code_gain and code_rate in its place")
        elif not code.known:
            reason = f"has no threshold that a source prints ({code.source})"
            yield Problem("code", reason, f"code_gain as measured, with code_rate = {code.rate:.4g}, in its place")
        elif not code.holds_at(self.bit_error_ratio):
            least, most = code.ratios
            reason = f'is {self.bit_error_ratio:g}, and code = "{code.name}" has its threshold printed for another'
            at = f"{most:g}" if least else f"at most {most:g}"
            yield Problem("bit_error_ratio", reason, f"bit_error_ratio {'= ' if least else ''}{at} ({code.source})")

    def _phase_problems(self) -> Iterator[Problem]:
        """A phase error with which some power reaches the bit error ratio."""
        quadratures = QUADRATURES.get(self.modulation)
        if quadratures is None or self.reaches_ratio:
            return
        most = phase_error.largest_rms_rad(self.bit_error_ratio, quadratures)
        limit = format_quantity(most * (1.0 - 1e-3), "rad")
        ratio = format_quantity(self.bit_error_ratio, "")
        reason = f'leaves no power that reaches bit_error_ratio = {ratio} with modulation = "{self.modulation}"'
        yield Problem("phase_error", reason, f'at most "{limit}" rms, or another bit_error_ratio')

    def most_code_gain(self, data_rate_bit_s: float, wavelength_m: float) -> float:
        """Largest net gain that a code can have on this receiver, as a ratio of power (see `capacity`).

        A counter's background counts as it is where its power and the data rate are given, else it may be any.

        Args:
            data_rate_bit_s: Data rate, in bit/s; what is not above 0 counts as not given.
            wavelength_m: Wavelength of the light, in m.
        """
        code, signalless = Code(self.rate_of_code, self.bit_error_ratio), self._counts(data_rate_bit_s, wavelength_m)
        if self.modulation == "ppm":
            return code.ppm_counting(self.order or 2, signalless)
        if self.modulation in QUADRATURES:
            return code.phases()
        if self.detector == "preamplified":
            return code.dpsk_preamplified() if self.modulation == "dpsk" else code.ook_preamplified()
        space = 2.0 / (10.0 ** (min(self.extinction_ratio_db or 0.0, 300.0) / 10.0) + 1.0)
        if self.detector != "photon-counting":
            excess = excess_noise_factor(self.avalanche_gain or 1.0, self.ionisation_ratio or 0.0)
            return code.ook_current(2.0 - space, space, excess)
        return code.ook_counting(2.0 - space, space, signalless)

    def _counts(self, data_rate_bit_s: float, wavelength_m: float) -> float | None:
        """Counts without signal for each bit of information; None where they are not known."""
        light = self.background_power_w
        if light is None or not data_rate_bit_s > 0.0:
            return None
        counts = (self.efficiency or 0.0) * light * wavelength_m / (PLANCK_J_S * SPEED_OF_LIGHT_M_S)
        return (counts + (self.dark_count_rate_1_s or 0.0)) / data_rate_bit_s


class Fading(Table):
    """The code that goes through fades, and a series of received power in time; without one, simulated residuals."""

    series: Name | None = Field(
        default=None, description="file of the received power in time, seen from the mission file"
    )
    unit: Literal["linear", "dB"] | None = Field(default=None, description="linear: ratios or W; dB: 10 log10")
    normalised: Literal["mean", "largest", "as-given"] | None = Field(
        default=None, description="power of the series that the budget's received power is: its mean, its largest, or 1"
    )
    sampling_s: Annotated[float, Quantity("s", "us", above=0.0, most=1e4)] | None = Field(
        default=None, description="time between two samples, where the file does not say it"
    )
    channel: Name | None = Field(default=None, description="of the power, where the file has several")
    code: Literal["ccsds-k7-1-2"] = Field(description="ccsds-k7-1-2: convolutional, soft decisions, BPSK")
    interleaving: Literal["none", "block", "convolutional"] = Field(
        description="block: over blocks behind each other; convolutional: over a window that slides along"
    )
    interleaver_s: Annotated[float, Quantity("s", "ms", above=0.0, most=1e4)] | None = Field(
        default=None, description="time over which neighbouring symbols are spread"
    )
    bit_error_ratio: Annotated[float, Share("", least=1e-18, below=0.5)] | None = Field(
        default=None, description="behind the decoder; that of the table receiver where there is one"
    )

    def problems(self) -> Iterator[Problem]:
        """A span exactly for an interleaver, and what a series needs exactly with one."""
        if self.series is None:
            for key, value in (("unit", self.unit), ("normalised", self.normalised), ("channel", self.channel)):
                if value is not None:
                    yield Problem(key, "stands without a series", "this line removed, or series with a file")
            if self.sampling_s is not None:
                yield Problem("sampling", "stands without a series", "this line removed, or series with a file")
        for key, value, example in (("unit", self.unit, "linear"), ("normalised", self.normalised, "mean")):
            if self.series is not None and value is None:
                yield Problem(key, "is missing, and series needs it", f'{key} = "{example}" would do')
        if self.interleaving == "none" and self.interleaver_s is not None:
            advice = 'this line removed, or interleaving = "block"'
            yield Problem("interleaver", 'does not belong to interleaving = "none"', advice)
        if self.interleaving != "none" and self.interleaver_s is None:
            reason = f'is missing, and interleaving = "{self.interleaving}" needs it'
            yield Problem("interleaver", reason, 'interleaver = "10 ms" would do')


class Communication(Beam):
    """The data link, diffraction-limited by its aperture."""

    data_rate_bit_s: Annotated[
        float, OrWord("bit/s", above=0.0, word=LARGEST, meaning=" for what the required margin leaves")
    ] = Field(description=f'"{LARGEST}" solves for it')
    tracking_split_loss_db: Loss = Field(description="light for the tracking sensor")
    implementation_loss_db: Loss = Field(description="receiver against its sensitivity")
    receiver_sensitivity_photon_bit: Annotated[float, Quantity("photon/bit", above=0.0)] | None = Field(
        default=None, description="as measured, at its bit error ratio"
    )
    receiver: Receiver | None = Field(default=None, description="in place of receiver_sensitivity")
    code_word_s: Annotated[float, Quantity("s", "s", above=0.0, most=1e4)] | None = Field(
        default=None, description="how long a code word, or what is interleaved with it, lasts"
    )
    beam: BeamShape | None = Field(default=None, description="absent: uniform, unobscured")
    coupling: Coupling | None = Field(default=None, description="absent: all of the light on the detector")
    fading: Fading | None = Field(default=None, description="received power in time, and a code that goes through it")

    def problems(self) -> Iterator[Problem]:
        """One receiver."""
        yield from Beam.problems(self)
        if self.receiver_sensitivity_photon_bit is None and self.receiver is None:
            advice = 'receiver_sensitivity = "100 photon/bit" would do, or a table receiver'
            yield Problem("receiver_sensitivity", "is missing, and so is the table receiver", advice)
        if self.receiver_sensitivity_photon_bit is not None and self.receiver is not None:
            yield Problem("receiver_sensitivity", "stands beside the table receiver", "one of the two removed")
        if self.receiver is not None:
            yield from self._gain_problems(self.receiver)
        if self.coupling is not None:
            yield from self.coupling.wavefront_problems(self.wavelength_m)
        if self.fading is not None:
            yield from self._fading_problems(self.fading)

    def _fading_problems(self, fading: Fading) -> Iterator[Problem]:
        """One target, and light whose power is the decoder's signal over noise."""
        receiver = self.receiver
        if receiver is None and fading.bit_error_ratio is None:
            reason = "is missing, and so is the table receiver, which has one"
            yield Problem("fading.bit_error_ratio", reason, "bit_error_ratio = 1e-6 would do")
        if receiver is not None and fading.bit_error_ratio is not None:
            yield Problem("fading.bit_error_ratio", "stands beside that of the table receiver", "this line removed")
        if receiver is not None and receiver.modulation != "bpsk":
            reason = f'is of BPSK, and the receiver has modulation = "{receiver.modulation}"'
            yield Problem("fading.code", reason, 'modulation = "bpsk", or a measured receiver_sensitivity')

    def _gain_problems(self, receiver: Receiver) -> Iterator[Problem]:
        """A code that needs no less power than the channel's capacity asks for."""
        if receiver.modulation == "ook" and (receiver.extinction_ratio_db or 0.0) < _ALIKE_DB:
            return  # the receiver says so
        if receiver.code_gain_db is None:
            return  # a named code is held against capacity by a test
        limit_db = 10.0 * math.log10(receiver.most_code_gain(self.data_rate_bit_s, self.wavelength_m))
        if receiver.code_gain_db > limit_db:
            at = f"code_rate = {receiver.rate_of_code:g}"
            ratio = format_quantity(receiver.bit_error_ratio, "")
            reason = (
                f"is more than any code can gain: {limit_db:.3g} dB at {at} and bit_error_ratio = {ratio}, where "
                f"{receiver.modulation} with {receiver.detector} is at its capacity"
            )
            advice = f'at most "{math.floor(limit_db * 100.0) / 100.0:.2f} dB" at {at}: the net gain, power per bit'
            yield Problem("receiver.code_gain", reason, advice)


class LinkRequirement(Table):
    """What a link has to meet."""

    margin_db: Loss = Field(description="margin of the communication link")
    pointing_error_rad: Angle = Field(description="residual that the fine pointing may leave")
    outage: Annotated[float, Share("")] | None = Field(
        default=None, description="share of the time that the required margin may be missed; asked for under a jitter"
    )


def half_angle_rad(divergence_rad: float, convention: str) -> float:
    """Half angle (rad) at 1/e2 of intensity of a beam whose divergence is given by some convention.

    Args:
        divergence_rad: The divergence as it is given, in rad.
        convention: "full-1/e2" where that is the full angle, "half-1/e2" where it is the half angle.
    """
    return divergence_rad / 2 if convention == "full-1/e2" else divergence_rad


def narrowest_half_angle_rad(aperture_m: float, wavelength_m: float) -> float:
    """Half angle (rad) at 1/e2 of the Gaussian beam with the gain of the whole aperture, sqrt(8) lambda / (pi D).

    A Gaussian beam of half angle theta has the gain 8 / theta^2. Light that fills the aperture evenly has
    (pi D / lambda)^2, and by the Schwarz inequality no light that leaves it has more. So no Gaussian beam is narrower
    than 0.900 lambda / D; the full angle is twice that, 1.801 lambda / D.

    It is a limit of the gain and not of the width: the light that fills the aperture evenly is itself at 1/e2 at
    0.822 lambda / D, and 1.03 lambda / D wide at half maximum. Taken for Gaussian beams such widths would put more
    light on the axis than there is (by 0.8 dB for 0.822), as would lambda / (pi w) = 0.637 lambda / D for w = D / 2,
    the Gaussian beam that no aperture cuts (by 3 dB).

    Args:
        aperture_m: Diameter D of the aperture, in m.
        wavelength_m: Wavelength lambda, in m.
    """
    return math.sqrt(8.0) * wavelength_m / (math.pi * aperture_m)


def narrowest_radius(obscuration: float) -> float:
    """1/e2 radius, over that of the aperture, of the Gaussian beam of which a central obscuration stops 99 %."""
    return obscuration * math.sqrt(2.0 / math.log(100.0))


def strehl_fits(name: str) -> Callable[..., Iterator[Problem]]:
    """Check that the Strehl of a beam is a ratio when it is read as one."""

    def check(conventions: LinkConventions, beam: Beam | None) -> Iterator[Problem]:
        if beam and beam.strehl is not None and conventions.strehl == UNUSED:
            reason = f"is missing, and {name}.strehl is read by it"
            yield Problem("conventions.strehl", reason, 'strehl = "ratio" for a number up to 1, or "decibel"')
        if beam and beam.strehl is not None and conventions.strehl == "ratio" and not 0.0 < beam.strehl <= 1.0:
            reason = f'is no ratio, but conventions.strehl = "ratio" ({beam.strehl:g})'
            yield Problem(f"{name}.strehl", reason, 'above 0 and at most 1, or conventions.strehl = "decibel"')

    return check


def divergence_fits(name: str, end: str) -> Callable[..., Iterator[Problem]]:
    """A check that a beam is not narrower than diffraction at the aperture that it leaves.

    Args:
        name: Name of the beam's table.
        end: Terminal that the beam leaves, "leo" or "geo".
    """

    def check(conventions: LinkConventions, terminals: Terminals, beam: Beacon | None) -> Iterator[Problem]:
        if beam is None:
            return
        if conventions.divergence == UNUSED:
            reason = f"is missing, and {name}.divergence is read by it"
            advice = 'divergence = "full-1/e2" for the full angle at 1/e2, or "half-1/e2"'
            yield Problem("conventions.divergence", reason, advice)
            return
        aperture = terminals.leo_aperture_m if end == "leo" else terminals.geo_aperture_m
        least = narrowest_half_angle_rad(aperture, beam.wavelength_m)
        half = half_angle_rad(beam.divergence_rad, conventions.divergence)
        if half < least * (1.0 - 1e-9):
            limit = format_quantity(beam.divergence_rad / half * least * (1.0 + 1e-3), "rad")
            size = format_quantity(aperture, "m")
            words = f"{conventions.divergence.partition('-')[0]} angle"
            reason = (
                f"is below diffraction at {end}_aperture = {size}, which leaves no less than {limit} ({words} at 1/e2)"
            )
            yield Problem(f"{name}.divergence", reason, f'at least "{limit}", or a larger aperture')

    return check


def pattern_fits(conventions: LinkConventions, communication: Communication) -> Iterator[Problem]:
    """Check that a far-field pattern knows how the aperture is lit, and that no other convention is told so.

    Args:
        conventions: The mission's conventions.
        communication: The table on the communication link.
    """
    if conventions.pointing_loss == "pattern" and communication.beam is None:
        advice = 'pointing_loss = "gaussian", or a table [communication.beam]'
        yield Problem("conventions.pointing_loss", "needs the table communication.beam, which is missing", advice)
    if conventions.pointing_loss != "pattern" and communication.beam is not None:
        reason = f'does not take communication.beam into account ("{conventions.pointing_loss}")'
        yield Problem("conventions.pointing_loss", reason, 'pointing_loss = "pattern"')


def obscuration_fits(terminals: Terminals, communication: Communication) -> Iterator[Problem]:
    """Check that the obscuration of its own terminal does not stop the beam.

    Args:
        terminals: The terminals.
        communication: The table on the communication link.
    """
    beam, hole = communication.beam, terminals.leo_obscuration or 0.0
    if beam is None or beam.radius_m is None:
        return
    least = narrowest_radius(hole) * terminals.leo_aperture_m / 2.0
    if beam.radius_m < least:
        limit = format_quantity(least * (1.0 + 1e-3), "m")
        reason = f"leaves less than 1 % of the beam beside leo_obscuration = {hole:g}"
        yield Problem("communication.beam.radius", reason, f'at least "{limit}", or a smaller obscuration')
