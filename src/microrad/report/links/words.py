"""What follows from the budgets of the links, in sentences."""

import math
from collections.abc import Sequence

from microrad import link
from microrad.core.units import format_input
from microrad.link import Swing
from microrad.link.acquisition.partner_search import Found, Tracking
from microrad.link.fade_series.coded import CodedFading
from microrad.link.pointing.outage import Performance, error_rad, required_error_rad
from microrad.link.requirement import of_links, time_kept
from microrad.link.study import BeamRadius, LinkStudy, PointAheadEffect, Solution
from microrad.report.links import ground
from microrad.report.marks import with_sign
from microrad.report.quantities import power_text, quantity, signed
from microrad.report.requirements import advice_for_links, derived_words, first_warning, met_words, nearest

INTERLEAVER = "interleaver"
"""Name of the figure on what the span of an interleaver changes."""

_WORTH_DB = 0.5  # of a margin: what another radius of the beam would have to bring


def verdict(study: LinkStudy) -> str:
    """Whether the links close and have what is required of them. "The links close" stands above no FAIL."""
    margins = ", ".join(
        with_sign(f"{b.name.lower()} {signed(b.margin_db, 'dB')}", study.file.sources, f"budgets.{b.name}.margin_db")
        for b in study.budgets
    )
    failed = [r for r in of_links(study) if not r.met]
    if not study.closes:
        return f"The links do not close: {margins}."
    if failed:
        return f"Not every requirement is met: {' and '.join(r.name for r in failed)}; {margins}."
    return f"The links close, and {met_words(of_links(study))}: {margins}."


def short(study: LinkStudy) -> list[str]:
    """What limits the links and what to do about it, in six sentences at most."""
    m, found = study.file.mission, of_links(study)
    at = f"at {quantity(m.communication.pointing_error_rad, 'rad')} of pointing error"
    if m.jitter is not None:
        error = quantity(error_rad(study.data), "rad")
        at = f"for {time_kept(m.requirement)} under the jitter, an error of {error}"
    if study.data.turbulent is not None:
        at += ", with the fades of the air"
    said = [
        f"The margin is the power received over the power needed, for communication {at}.",
        *consequences(study)[:2],
    ]
    if study.fading is not None:
        said.append(under_fades(study.fading))
    if study.ground is not None:
        said += ground.sentences(study, study.ground)[:2]
    r = nearest(found)
    which = "Nearest to its limit is" if r.met else "What limits it is"
    said.append(f"{which} the {r.name}, by {r.because}{advice_for_links(study, r)}.")
    said.append(derived_words(found))
    said.append(first_warning(study.warnings))
    return list(filter(None, said))


def consequences(study: LinkStudy) -> list[str]:
    """What follows from the budgets that stands in no table: rates, swings, intensities, light, point-ahead."""
    m, found = study.file.mission, []
    error = quantity(required_error_rad(study.data), "rad")
    at = f"the required {error}" if m.jitter is None else f"{error} under the jitter"
    wanted = f"the required {m.requirement.margin_db:g} dB at {at}"
    if math.isnan(study.largest_rate_bit_s):
        found.append(f"No data rate has {wanted}.")
    else:
        rate = quantity(study.largest_rate_bit_s, "bit/s")
        found.append(f"Largest data rate with {wanted}: {rate}{_rate_limit(study)}.")
    if study.beam_radius is not None and study.beam_radius.gained_db >= _WORTH_DB:
        found.append(_radius(study, study.beam_radius))
    by = "each input by ±10 % (±0.5 dB; a bit error ratio or an outage ten times more or less)"
    own, *others = study.tornados
    if own.swings:
        found.append(f"What moves the margin most, {by}: {_top(own.swings)}.")
    found += [f"What moves the margin of the {t.of.lower()} most: {_top(t.swings)}." for t in others if t.swings]
    intensities = ", ".join(f"{b.name.lower()} {quantity(b.radiant_intensity_w_sr, 'W/sr')}" for b in study.budgets)
    found.append(f"Radiant intensity on the axis, optics and Strehl counted: {intensities}.")
    if study.beacon is not None:
        found.append(
            f"Beacon at its partner: {quantity(study.beacon.irradiance_w_m2, 'W/m^2')} at the pointing error, "
            f"{quantity(study.beacon.irradiance_on_axis_w_m2, 'W/m^2')} on axis; its sensor needs "
            f"{quantity(study.beacon.required_irradiance_w_m2, 'W/m^2')}."
        )
    if study.tracking is not None:
        found.append(_light(study.tracking))
    if study.point_ahead is not None:
        found.append(point_ahead(study.point_ahead))
    return found


def _radius(study: LinkStudy, other: BeamRadius) -> str:
    m = study.file.mission
    assert m.communication.beam is not None and m.communication.beam.radius_m is not None
    own, aperture = (format_input(each, "m") for each in (m.communication.beam.radius_m, m.terminals.leo_aperture_m))
    return (
        f"The beam's radius of {own} leaves {quantity(other.gained_db, 'dB')} to gain in the aperture of {aperture}: "
        f"some {quantity(other.best_m, 'm', 2)} would be best."
    )


def _rate_limit(study: LinkStudy) -> str:
    """In words, that the receiver and not the link ends the data rate, or nothing."""
    receiver = study.data.receiver
    limited = receiver is not None and study.largest_rate_bit_s >= receiver.highest_data_rate_bit_s * (1.0 - 1e-9)
    return ", the most that the receiver takes" if limited else ""


def _top(swings: Sequence[Swing]) -> str:
    """The three inputs that move a margin most, with their swings."""
    return "; ".join(f"{s.key} {_swing(s)}" for s in swings[:3])


def _swing(s: Swing) -> str:
    return quantity(s.swing_db, "dB") if math.isfinite(s.swing_db) else "takes the link beyond its receiver"


def _light(t: Tracking) -> str:
    brings = f"The answer brings {quantity(t.power_w, 'W')} to the tracking sensor: "
    if t.signal_to_noise < 1.0 or t.noise_equivalent_angle is None:
        return brings + f"less than its noise in a reading (signal to noise {t.signal_to_noise:.2g})."
    angle = quantity(t.noise_equivalent_angle.value, "rad")
    return f"{brings}noise-equivalent angle {angle} rms per axis and reading."


def point_ahead(p: PointAheadEffect) -> str:
    """Point-ahead as an angle of the beam, a range of the mirror and a loss."""
    state = "corrected here" if p.corrected else "NOT corrected here"
    lost = f"{p.loss_db:.1f} dB" if p.loss_db <= link.DEEPEST_DB else f"more than {link.DEEPEST_DB:g} dB"
    return (
        f"Point-ahead: up to {quantity(p.angle_rad, 'rad')}, {p.beam_half_angles:.1f} half angles of the communication "
        f"beam; left out, it {'would cost' if p.corrected else 'costs'} {lost}; a mirror that makes it needs "
        f"{quantity(p.mirror_range_rad, 'rad')} of range at the line of sight; {state}."
    )


def under_fades(f: CodedFading) -> str:
    """The coded link under a series of received power, in a sentence."""
    spread = "without an interleaver"
    if f.interleaving != "none":
        spread = f"with a {f.interleaving} interleaver over {quantity(f.span_s, 's')}"
    cost = f"cost {quantity(f.penalty_db, 'dB')}, which leaves a margin of {signed(f.margin_left_db, 'dB')}"
    if math.isinf(f.penalty_db):
        cost = "cost more than any power makes up for"
    return (
        f"Under the fades of {f.source}, {f.code} {spread}: mean bit error ratio {power_text(f.ratio.value)} at the "
        f"power that is there; the fades {cost}."
    )


def fading_note(f: CodedFading) -> str:
    """How the table of fades is to be read."""
    return (
        "Power 1 of the series is the received power of the budget at its static pointing error; jitter of the mission "
        "is not added to it. Symbols are BPSK with soft decisions and the channel's state is known; those of an error "
        "event, a few tens, are spread at random over the span, and power stands still over a sample. Cost: the power "
        f"over constant power that brings the mean bit error ratio back to {power_text(f.target)}."
    )


def under_jitter_sentence(p: Performance, study: LinkStudy) -> str:
    """The link under its jitter, in two sentences.

    Args:
        p: the link under its jitter.
        study: the links that it is of.
    """
    narrowest = ", the narrowest of the aperture" if p.best.at_limit else ""
    receiving = study.data.receiving
    both = " of both ends" if receiving is not None and receiving.is_random else ""
    return (
        f"Under the jitter: mean pointing loss{both} {p.mean_loss_db:.2f} dB; {p.outage_loss_db:.2f} dB at most for "
        f"{time_kept(study.data.requirement)}, which leaves a margin of {signed(p.margin_db, 'dB')}; below 0 dB "
        f"for a share of {quantity(p.outage, '')} of the time; best half angle "
        f"{quantity(p.best.half_angle_rad, 'rad')}{narrowest}. "
        f"Power that it costs: with a code {p.mean_loss_db:.2f} dB where its interleaver spans many fades, "
        f"{p.outage_loss_db:.2f} dB where it spans none; without a code {uncoded(p)}."
    )


def without_code(p: Performance) -> str:
    """The penalty without a code in decibels, as it stands in a cell."""
    if math.isnan(p.uncoded_penalty_db):
        return "unknown"
    return "beyond any power" if math.isinf(p.uncoded_penalty_db) else f"{p.uncoded_penalty_db:.2f}"


def uncoded(p: Performance) -> str:
    """The penalty without a code in decibels, or why there is none."""
    if math.isnan(p.uncoded_penalty_db):
        return "unknown, as the receiver is given by its sensitivity alone"
    return without_code(p) + (" dB" if math.isfinite(p.uncoded_penalty_db) else "")


def simulated_mean(w: Found) -> str:
    """Mean time of the simulated acquisitions that end in lock; there may be none."""
    return "none locks" if math.isnan(w.simulated_mean_s) else quantity(w.simulated_mean_s, "s")


def solution_text(s: Solution) -> str:
    """The values of a key that leave the required margin, and how far they were looked for, in sentences."""
    wanted = f"the required {s.required_db:g} dB of {s.of}"
    low, high = (quantity(each, s.unit, 4) for each in s.solved.searched)
    if not s.solved.intervals:
        most = f"the most is {signed(s.solved.best_db, 'dB')} at {quantity(s.solved.best, s.unit, 4)}"
        return f"No value of {s.key} from {low} to {high} leaves {wanted}: {most}. No other was looked at."
    spans = " and ".join(_span(each, s.unit) for each in s.solved.intervals)
    several = len(s.solved.intervals) > 1 or not (s.solved.intervals[0].low_open or s.solved.intervals[0].high_open)
    best = f", most ({signed(s.solved.best_db, 'dB')}) near {quantity(s.solved.best, s.unit)}" if several else ""
    here = f"The budgets below have {quantity(s.value, s.unit, 4)}."
    return f"{s.key} leaves {wanted} {spans}{best}. Looked at: {low} to {high}. {here}"


def _span(i: link.Interval, unit: str) -> str:
    low, high = quantity(i.low, unit, 4), quantity(i.high, unit, 4)
    if i.low_open:
        return "wherever it was looked at" if i.high_open else f"up to {high}"
    return f"from {low} on" if i.high_open else f"from {low} to {high}"
