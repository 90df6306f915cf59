"""What a mission's links have, in the terms of each requirement of a standard, and whether that meets it."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from microrad.core.units import SPEED_OF_LIGHT_M_S, format_quantity, parse_quantity
from microrad.link.acquisition.partner_search import EARLY
from microrad.link.beams import LitAperture
from microrad.link.budget.lines import POINT_AHEAD_LOSS, POINTING_LOSS, LinkBudget
from microrad.link.compliance.standards import Asked, Standard
from microrad.link.requirement import ROUNDING
from microrad.link.study import LinkStudy
from microrad.mission.tables.link import half_angle_rad

Judgement = Literal["meets", "does not meet", "not said", "outside microrad"]
"""What is said of a requirement: it is met, missed, left open by the mission, or about what microrad has not."""

HALF_DB = 10.0 * math.log10(2.0)
"""Loss at which a beam has half of its light, in dB."""
_SAME_RATE = 5e-4 + 1e-12  # a code rate is the same to three decimals
_MOST_OF_SPACING = 0.25  # of the channels: a wavelength that is known no better says nothing of them
_MEASURED = "the mission gives its receiver by receiver_sensitivity, not by communication.receiver"
_DIGITS = re.compile(r"[0-9]+(?:\.(?P<decimals>[0-9]*))?(?:[eE](?P<power>[+-]?[0-9]+))?")


@dataclass(frozen=True, slots=True)
class Held:
    """A requirement with what the mission has.

    ``value`` is in the unit of the requirement, None where there is no number; ``text`` says it in words where a number
    says little.
    ``why`` says how the value comes about, or what the mission would have to say.
    """

    asked: Asked
    judgement: Judgement
    value: float | None = None
    text: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Compliance:
    """A standard with what a mission has of each of its requirements, in the standard's order."""

    standard: Standard
    held: tuple[Held, ...]

    def count(self, judgement: Judgement) -> int:
        """How many requirements have this judgement."""
        return sum(each.judgement == judgement for each in self.held)


@dataclass(frozen=True, slots=True)
class _Has:
    """What a mission has of one requirement: a number or a word with how it comes about, or neither.

    ``certain`` is False where the number leaves the requirement open all the same.
    """

    value: float | None
    why: str
    text: str = ""
    certain: bool = True


def compliance(study: LinkStudy, against: Standard) -> Compliance:
    """Hold the links of a mission against a standard.

    What the terminal sends is that of "leo", the receiver is that of its partner "geo".

    Args:
        study: The links, at their budgeted errors or under their jitter.
        against: The standard.
    """
    return Compliance(against, tuple(_held(study, asked) for asked in against.requirements))


def _held(study: LinkStudy, asked: Asked) -> Held:
    if asked.outside:
        return Held(asked, "outside microrad", why=asked.outside)
    has = _CHECKS[asked.key](study, asked)
    known = (has.value is not None or has.text) and has.certain
    judgement: Judgement = "not said" if not known else "meets" if _met(asked, has) else "does not meet"
    return Held(asked, judgement, has.value, has.text, has.why)


def _met(asked: Asked, has: _Has) -> bool:
    """Whether what the mission has is what is asked for, but for rounding."""
    if has.value is None:
        return has.text in asked.texts
    value, first, last = has.value, asked.values[0], asked.values[-1]
    match asked.comparison:
        case "at least":
            return value >= first * (1.0 - ROUNDING)
        case "at most":
            return value <= first * (1.0 + ROUNDING)
        case "between":
            return first * (1.0 - ROUNDING) <= value <= last * (1.0 + ROUNDING)
        case "on the grid":
            return value == 0.0
        case _:
            return any(abs(value - each) <= _SAME_RATE for each in asked.values)


# ---------------------------------------------------------------------------------------------------------- what it has
def full_width_at_half_maximum_rad(study: LinkStudy) -> float:
    """Full width at half maximum of the communication beam, in rad.

    Twice the angle at which the beam has lost 10 lg 2 dB: of the diffraction integral where the mission says how its
    aperture is lit, else of a Gaussian beam, sqrt(2 ln 2) = 1.1774 times its half angle at 1/e2.
    """
    return 2.0 * study.data.beam.fall.error_rad(HALF_DB)


def power_at_aperture_w(study: LinkStudy) -> float:
    """Power that leaves the transmitting telescope, in W: behind its optics, and behind what its aperture cuts off."""
    table, fall = study.data.table, study.data.beam.fall
    passed = fall.passed if isinstance(fall, LitAperture) else 1.0
    return table.transmit_power_w * float(10.0 ** (-table.transmit_optics_loss_db / 10.0)) * passed


def mean_irradiance_w_m2(study: LinkStudy, distance_m: float) -> float:
    """Mean irradiance of the communication beam at a partner at another distance, in W/m^2.

    Under the mission's jitter that of the mean pointing loss, else that at its static pointing error; it falls with the
    square of the distance.

    Args:
        study: The links.
        distance_m: Distance of the partner, in m.
    """
    budget, under = study.communication, study.under_jitter
    mean_db = _pointing_db(budget) if under is None else under.mean_loss_db
    return _on_axis(budget) * float(10.0 ** (-mean_db / 10.0)) * (study.data.range_m / distance_m) ** 2


def acquisition_irradiance_w_m2(study: LinkStudy, distance_m: float) -> float | None:
    """Irradiance at a partner at another distance while it is looked for, in W/m^2; None without a beacon.

    That of the beacon at its pointing error, or at the edge of the scan's beam where the mission finds its partner by
    the scan (`operations.acquisition`).

    Args:
        study: The links.
        distance_m: Distance of the partner, in m.
    """
    m = study.file.mission
    if study.beacon is None or m.beacon is None:
        return None
    light = study.beacon.irradiance_w_m2
    if _scans(study):
        assert study.finding is not None and study.finding.scanned is not None and m.acquisition is not None
        assert m.acquisition.scan is not None
        wide, narrow = half_angle_rad(m.beacon.divergence_rad, m.conventions.divergence), study.finding.scanned
        edge = m.acquisition.scan.beam_radius_rad / narrow.half_angle_rad
        light = _on_axis(study.beacon) * (wide / narrow.half_angle_rad) ** 2 * math.exp(-2.0 * edge**2)
    return light * (m.range_m(m.beacon) / distance_m) ** 2


def _scans(study: LinkStudy) -> bool:
    """Whether the mission finds its partner by the scan."""
    o, found = study.file.mission.operations, study.finding
    return o is not None and o.acquisition == "scan" and found is not None and found.scanned is not None


def _pointing_db(budget: LinkBudget) -> float:
    return budget.loss_db(POINTING_LOSS, POINT_AHEAD_LOSS)


def _on_axis(budget: LinkBudget) -> float:
    """Irradiance at the partner on the beam's axis, every other loss counted."""
    return budget.irradiance_w_m2 * float(10.0 ** (_pointing_db(budget) / 10.0))


# -------------------------------------------------------------------------------------------------------------- checks
def _acquisition_time(study: LinkStudy, _: Asked) -> _Has:
    if study.finding is None:
        return _Has(None, "a search for the partner needs the tables beacon, answer and acquisition")
    way = study.finding.scan if _scans(study) else study.finding.wide
    assert way is not None
    locks = f"{100.0 * way.outcome.success_probability:.3g} % of all searches by {way.name} end in lock"
    if not way.possible:
        return _Has(math.inf, f"{way.name} never ends in lock")
    return _Has(way.early_s, f"{100.0 * EARLY:g} % of those that end in lock take no longer; {locks}")


def _acquisition_irradiance(study: LinkStudy, asked: Asked) -> _Has:
    assert asked.distance_m is not None
    value = acquisition_irradiance_w_m2(study, asked.distance_m)
    if value is None:
        return _Has(None, "the mission has no table beacon")
    assert study.file.mission.beacon is not None
    what = "edge of the scan's beam" if _scans(study) else "beacon at beacon.pointing_error"
    return _Has(value, _moved(what, study.file.mission.range_m(study.file.mission.beacon), asked.distance_m))


def _mean_irradiance(study: LinkStudy, asked: Asked) -> _Has:
    assert asked.distance_m is not None
    what = "at communication.pointing_error, which is static" if study.under_jitter is None else "mean under the jitter"
    own = study.data.range_m
    return _Has(mean_irradiance_w_m2(study, asked.distance_m), _moved(what, own, asked.distance_m))


def _moved(what: str, own_m: float, asked_m: float) -> str:
    return (
        f"{what}, from {format_quantity(own_m, 'm')} to {format_quantity(asked_m, 'm')} by the square of the distance"
    )


def _largest_irradiance(study: LinkStudy, asked: Asked) -> _Has:
    value, own = _on_axis(study.communication), study.data.range_m
    nearest = own * math.sqrt(value / asked.values[0])
    reached = f"nearer than {format_quantity(nearest, 'm')} there is more than is allowed"
    return _Has(value, f"on the axis at {format_quantity(own, 'm')}; {reached}")


def _transmit_power(study: LinkStudy, _: Asked) -> _Has:
    cut = " and the cut of the aperture" if isinstance(study.data.beam.fall, LitAperture) else ""
    return _Has(power_at_aperture_w(study), f"communication.transmit_power behind transmit_optics_loss{cut}")


def _divergence(study: LinkStudy, _: Asked) -> _Has:
    fall = study.data.beam.fall
    if isinstance(fall, LitAperture):
        how = "of the far field of the lit aperture"
    else:
        half = format_quantity(fall.half_angle_rad, "rad")
        how = f"sqrt(2 ln 2) times the half angle of {half} at 1/e2 by conventions.pointing_loss"
    return _Has(full_width_at_half_maximum_rad(study), how)


def _wavelength_band(study: LinkStudy, _: Asked) -> _Has:
    return _Has(study.data.table.wavelength_m, "communication.wavelength")


def _wavelength_grid(study: LinkStudy, asked: Asked) -> _Has:
    """How far the carrier is off its channel; 0 where the digits of its wavelength have the channel in them."""
    wave = study.data.table.wavelength_m
    freq, (first, step) = SPEED_OF_LIGHT_M_S / wave, asked.values
    number = round((freq - first) / step)
    channel = first + number * step
    at = f"channel n = {number} is at {format_quantity(SPEED_OF_LIGHT_M_S / channel, 'm', 7)}"
    known = _half_digit_m(study, wave)
    if known >= _MOST_OF_SPACING * wave * step / freq:
        shown = format_quantity(wave * step / freq, "m", 2)
        return _Has(None, f"{at}; the wavelength has too few digits for channels {shown} apart")
    off = abs(wave - SPEED_OF_LIGHT_M_S / channel) > known * (1.0 + ROUNDING)
    return _Has(freq - channel, at) if off else _Has(0.0, at, f"n = {number}")


def _half_digit_m(study: LinkStudy, wavelength_m: float) -> float:
    """Half a unit of the last digit that the file gives of the wavelength, in m; 0 where it is no text with one."""
    source = study.file.sources.get("communication.wavelength")
    given = "" if source is None else source.value.strip('"')
    digits = _DIGITS.match(given)
    if digits is None or parse_quantity(given, "m") != wavelength_m:
        return 0.0
    last = 10.0 ** (int(digits["power"] or 0) - len(digits["decimals"] or ""))
    return 0.5 * last * wavelength_m / float(digits[0])


def _of_receiver(name: str) -> Callable[[LinkStudy, Asked], _Has]:
    """The check of a number that the receiver is made of."""

    def check(study: LinkStudy, _: Asked) -> _Has:
        if study.data.receiver is None:
            return _Has(None, _MEASURED)
        return _Has(getattr(study.data.receiver, name), f"communication.receiver.{name.removesuffix('_hz')}")

    return check


def _modulation(study: LinkStudy, _: Asked) -> _Has:
    table = study.data.table.receiver
    return _Has(None, _MEASURED) if table is None else _Has(None, "communication.receiver.modulation", table.modulation)


def _required_irradiance(study: LinkStudy, asked: Asked) -> _Has:
    needed, receiver = study.communication.required_irradiance_w_m2, study.data.receiver
    if receiver is None:
        return _Has(needed, "by a sensitivity as measured, whose bit error ratio is not stated", certain=False)
    assert asked.bit_error_ratio is not None
    rate = study.data.table.data_rate_bit_s
    other = replace(receiver, bit_error_ratio=asked.bit_error_ratio)
    more = float(other.required_power_w(rate) / receiver.required_power_w(rate))
    at = f"a bit error ratio of {asked.bit_error_ratio:g} with communication.receiver.code_gain"
    return _Has(needed * more, f"for {at}, at {format_quantity(rate, 'bit/s')}")


def _data_rate(study: LinkStudy, _: Asked) -> _Has:
    return _Has(study.data.table.data_rate_bit_s, "communication.data_rate, one way")


_CHECKS: Mapping[str, Callable[[LinkStudy, Asked], _Has]] = {
    "acquisition_time": _acquisition_time,
    "acquisition_irradiance": _acquisition_irradiance,
    "mean_irradiance": _mean_irradiance,
    "burst_irradiance": _mean_irradiance,
    "largest_irradiance": _largest_irradiance,
    "transmit_power": _transmit_power,
    "divergence": _divergence,
    "wavelength_band": _wavelength_band,
    "wavelength_grid": _wavelength_grid,
    "modulation": _modulation,
    "symbol_rate": _of_receiver("bandwidth_hz"),
    "code_rate": _of_receiver("code_rate"),
    "required_irradiance": _required_irradiance,
    "data_rate": _data_rate,
}
"""What answers each requirement, by its key."""
