"""What a fine-pointing study found, in words: the verdict, what theory leaves, the stroke, the warnings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from microrad.core.units import format_quantity
from microrad.loop.control.tuning import MARGIN
from microrad.loop.controller_study import BASELINE, AnyScene, FinePointingStudy, Scene, Verified
from microrad.loop.coupled_study import CoupledScene
from microrad.loop.disturbance import ANGLE_OF_ARRIVAL
from microrad.loop.pointing_loop.loop import PointingLoop
from microrad.mirror import Variant
from microrad.mirror.geometry import StrokeBudget
from microrad.mission.model import Amplifier, Control
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.report.quantities import angle, given_angle, minus, percent, plain, share_of_time

NAMES: dict[str, str] = {
    Variant.GIVEN: "mission's mirror",
    Variant.COMPARISON: "comparison model",
    Variant.STRAIGHT: "no hysteresis",
}
"""Variants of the mirror as they stand in headings, legends and rows."""

VARIANTS: dict[str, str] = {
    Variant.GIVEN: "on the mission's mirror",
    Variant.COMPARISON: "on the comparison model",
    Variant.STRAIGHT: "without hysteresis",
}
"""Variants of the mirror as they stand behind "it leaves"."""

WORTHWHILE = 0.2
"""Gain in rms over the best PI that a better controller is asked for where theory allows it."""

SETTLED = 0.05
"""Distance from the linear bound, as a share of the rms, below which a search for more is over."""

PAPER_TRAVEL_RAD = 2.5e-3
"""Travel that the paper says would "fully cover" the residual body pointing."""


@dataclass(frozen=True, slots=True)
class Room:
    """What the linear bound leaves to gain, as shares of a radial rms.

    ``at_baseline`` and ``at_nearest`` in linear theory: below the baseline, and below the design that comes nearest to
    the bound. ``with_hysteresis`` below what the baseline leaves on the mission's mirror, were its hysteresis undone
    entirely; ``gained`` is what the best controller gains there.
    """

    baseline: Verified
    nearest: Verified
    at_baseline: float
    at_nearest: float
    with_hysteresis: float
    gained: float
    holds: bool


def tuned_to(values: Mapping[str, float], units: Mapping[str, str]) -> str:
    """What a controller was tuned to, in words.

    Args:
        values: its parameters in SI units, by name.
        units: their SI units by name; a parameter without one is a plain number.
    """
    told = {
        name: format_quantity(value, units[name], 3) if units.get(name) else plain(value)
        for name, value in values.items()
    }
    return minus(", ".join(f"{name} {value}" for name, value in told.items()))


def larger_margin(margin: float | None) -> str:
    """What is said behind the values of a controller that hysteresis made be tuned for a larger margin; else nothing.

    Args:
        margin: That modulus margin, None for the mission's.
    """
    return "" if margin is None else f"; for a modulus margin of {margin:.3g}, for the mirror's hysteresis"


def room(fine: FinePointingStudy) -> Room:
    """The distance of baseline and designs from the linear bound."""
    bound, baseline = fine.optimum_rad, fine.verified[0]
    nearest = min(fine.verified, key=lambda v: v.theory.radial_rms_rad)
    lowest, given = nearest.theory.radial_rms_rad, baseline.simulated[Variant.GIVEN].rms_rad
    return Room(
        baseline,
        nearest,
        at_baseline=max(0.0, 1.0 - bound / baseline.theory.radial_rms_rad),
        at_nearest=max(0.0, 1.0 - bound / lowest),
        with_hysteresis=max(0.0, 1.0 - bound / given),
        gained=1.0 - fine.best.simulated[Variant.GIVEN].rms_rad / given,
        holds=bound <= 1.01 * lowest,
    )


def source_name(name: str) -> str:
    """What a source of error is called in a sentence: a spectrum by its satellite's name is a vibration."""
    return f"vibration ({name})" if name == "OLYMPUS" else name


def arrival(loop: PointingLoop) -> list[str]:
    """What the angle of arrival is, how large and whose, in sentences; none where the loop has none."""
    found = next((each for each in loop.disturbances[0] if each.name == ANGLE_OF_ARRIVAL), None)
    if found is None:
        return []
    return [
        f"Angle of arrival, {angle(found.rms_rad)} rms per axis before the loop: the tracked light comes down through "
        f"the air of channel.turbulence, {found.basis.partition('; fit of')[0]}. Source: {found.source}."
    ]


def listed(items: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join(filter(None, (", ".join(items[:-1]), items[-1]))) if items else ""


def limits_met(shares: dict[str, float]) -> str:
    """Limits that a run met, each with how often; empty where it met none."""
    return ", ".join(f"{percent(share)} {name}" for name, share in shares.items())


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


# ------------------------------------------------------------------------------------------------ verdict


def result(fine: FinePointingStudy, required: float) -> list[str]:
    """What the best controller leaves, what makes it up, and how it stands against the baseline.

    Args:
        fine: the study.
        required: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    best, baseline = fine.best, fine.verified[0]
    left = best.simulated[Variant.GIVEN]
    time = share_of_time(fine.quantile)
    met = "met" if best.meets(required) else "missed"
    sentences = [
        *not_reliable(fine.scene),
        f"{best.design.name} is the best of {len(fine.verified)} controllers: on the mission's mirror the radial error "
        f"stays within {angle(left.quantile_rad)} for {time} of the time ({angle(left.rms_rad)} rms, "
        f"{angle(left.largest_rad)} at most). The {given_angle(required)} required are {met}.",
        _dominant(fine),
        *_other_variants(fine, required),
    ]
    failing = [v.design.name for v in fine.verified if not v.meets(required)]
    if failing and failing != [best.design.name]:
        sentences.append(f"The requirement is missed by {listed(failing)}.")
    reference = baseline.simulated[Variant.GIVEN]
    sentences.append(
        f"Against {baseline_name(fine)} ({angle(reference.rms_rad)} rms, {angle(reference.quantile_rad)} at "
        f"{time}) the rms of {best.design.name} is {_lower(room(fine).gained)}."
    )
    return sentences


def several_axes(loop: PointingLoop) -> str:
    """A mirror of several axes in a few words."""
    m = loop.mirror
    channels = f"{m.actuators} actuators, {m.axes} outputs"
    return f"{m.name}, {channels}, {m.A.shape[0]} states, {len(m.bank)} hysteresis elements"


def baseline_name(fine: FinePointingStudy) -> str:
    """The controller that others are held against, as a sentence calls it."""
    name = fine.verified[0].design.name
    return "the best PI of the gain grid" if name == BASELINE else name


def _lower(share: float) -> str:
    return f"{percent(abs(share))} {'lower' if share >= 0.0 else 'higher'}"


def _dominant(fine: FinePointingStudy) -> str:
    budget, name = fine.budget, fine.budget.dominant
    sizes = {part.name: part.rms_rad for part in budget.parts} | {d.name: d.added_rad for d in budget.differences}
    what = _sentence(source_name(name))
    return f"{what} makes up most of it: {angle(sizes[name])} of {angle(budget.full_rad)} rms, which add as squares."


def _other_variants(fine: FinePointingStudy, required_rad: float) -> list[str]:
    others = {v: r for v, r in fine.best.simulated.items() if v != Variant.GIVEN}
    if not others:
        return []
    parts = [
        f"{angle(r.quantile_rad)} {VARIANTS.get(v, v)}" + ("" if r.quantile_rad <= required_rad else " (missed)")
        for v, r in others.items()
    ]
    return [f"The same controller leaves {listed(parts)}."]


def theory(fine: FinePointingStudy) -> list[str]:
    """How far baseline and designs are from the linear bound, and what only a straighter mirror could gain."""
    r, bound = room(fine), angle(fine.optimum_rad)
    lowest, name = angle(r.nearest.theory.radial_rms_rad), r.nearest.design.name
    if not r.holds:
        return [f"No bound can be given: the computed one, {bound} rms, lies above the {lowest} that {name} reaches."]
    sentences = [
        f"With hysteresis left out, no linear controller comes below {bound} rms, whatever its margins. The baseline "
        f"is at {angle(r.baseline.theory.radial_rms_rad)}, so at most {percent(r.at_baseline)} are to be gained "
        f"over it; {name} comes nearest, with {lowest}."
    ]
    settled = f"The question of a better linear controller is settled: at most {percent(r.at_nearest)} are left."
    if r.at_baseline < WORTHWHILE:
        sentences.append(f"So no linear controller can be {percent(WORTHWHILE)} better than the baseline.")
    sentences += [settled] if r.at_nearest < SETTLED else []
    if r.with_hysteresis > r.at_baseline + 0.01:
        simulated, gained = angle(r.baseline.simulated[Variant.GIVEN].rms_rad), percent(max(r.gained, 0.0))
        sentences.append(
            f"On the mission's mirror hysteresis brings the baseline to {simulated}. Without it the rms could be "
            f"at most {percent(r.with_hysteresis)} lower; {fine.best.design.name} is {gained} lower."
        )
    return sentences


def not_reliable(scene: AnyScene) -> list[str]:
    """That no number of the loop may be relied on, and why, where that is so."""
    unknown = scene.unknown_dynamics
    return [f"Not to be relied on: {unknown}."] if unknown else []


def short(fine: FinePointingStudy, required: float) -> list[str]:
    """The verdict in a line each: what is left, on a sine too, what theory leaves to gain, whether the stroke does.

    Args:
        fine: the study.
        required: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    left, r = fine.best.simulated[Variant.GIVEN], room(fine)
    lines = [
        f"Fine pointing under vibration and noise: {fine.best.design.name} leaves {angle(left.quantile_rad)} radial at "
        f"{share_of_time(fine.quantile)} ({angle(left.rms_rad)} rms); {given_angle(required)} is allowed."
    ]
    lines += [*not_reliable(fine.scene), *filter(None, [tracked(fine, required)])]
    if r.holds:
        lines.append(
            f"Without hysteresis no linear controller can be more than {percent(r.at_baseline)} better (rms) than "
            f"{baseline_name(fine)}; on the mission's mirror {fine.best.design.name} is {percent(abs(r.gained))} "
            f"{'better' if r.gained >= 0.0 else 'worse'}."
        )
    short_of = [axis for axis in fine.scene.own_stroke if not axis.fits]
    if short_of:
        worst = min(short_of, key=lambda axis: axis.margin_rad)
        lines.append(
            f"The mirror's stroke does not cover the worst case: {worst.label} needs {angle(worst.needed_rad)} to "
            f"either side and has {angle(worst.available_rad)}."
        )
    return lines


def tracked(fine: FinePointingStudy, required_rad: float) -> str:
    """At which of the paper's sines the requirement is met on the mission's mirror, and by whom; "" without sines.

    Args:
        fine: the study.
        required_rad: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    parts = []
    for freq in dict.fromkeys(s.freq_hz for s in fine.sines):
        here = [s for s in fine.sines if s.variant == Variant.GIVEN and s.freq_hz == freq]
        met = [s.controller for s in here if s.quantile_rad <= required_rad]
        who = "by all controllers" if len(met) == len(here) else f"by {listed(met)}" if met else "by none"
        least = min(here, key=lambda s: s.quantile_rad)
        who += "" if met else f" (least: {angle(least.quantile_rad)}, {least.controller})"
        parts.append(f"{freq:g} Hz {who}")
    met_at = f"the requirement is met at {'; at '.join(parts)}"
    return f"While a sine of the paper is tracked on the mission's mirror, {met_at}." if parts else ""


# ------------------------------------------------------------------------------------------------ stroke


def stroke(fine: FinePointingStudy) -> list[str]:
    """Whether the travel covers what the mirror has to follow, by itself and as far as the drive reaches."""
    pairs = (
        ("with the point-ahead on the mirror", fine.scene.stroke),
        ("with the point-ahead elsewhere", fine.scene.stroke_without_point_ahead),
    )
    one, half = fine.scene.stroke[0], 0.5 * fine.scene.stroke[0].travel_rad
    paper = math.isclose(one.travel_rad, PAPER_TRAVEL_RAD)
    said = (
        'The paper says that a travel of 2.5 mrad would "fully cover" the residual of the body pointing. '
        if paper
        else ""
    )
    needed = listed([f"{angle(max(a.needed_rad for a in several))} {where}" for where, several in pairs])
    covered = [all(half >= axis.needed_rad for axis in several) for _, several in pairs]
    covers = "covers both" if all(covered) else "covers only the second" if any(covered) else "covers neither"
    sentences = [
        f"{said}The travel of {given_angle(one.travel_rad)} from stop to stop ({one.travel_angle} angle) is "
        f"{angle(half)} to either side; the worst case needs {needed}: the travel {covers}."
    ]
    if one.usable_share < 1.0 and isinstance(fine.scene, Scene):
        mirror = fine.scene.mirrors.table
        sentences.append(
            f"The drive of {mirror.drive_min_v:g} to {mirror.drive_max_v:g} V about its bias of "
            f"{mirror.bias_v:g} V reaches {percent(one.usable_share)} of the travel, {angle(one.available_rad)} to "
            "either side."
        )
    sentences += [_fit(where, several) for where, several in pairs]
    if paper and all(covered) and not all(axis.fits for _, several in pairs for axis in several):
        sentences.append(
            "So the claim holds for the travel, and not for the drive that the mirror was identified with."
        )
    return sentences


def _fit(where: str, several: tuple[StrokeBudget, ...]) -> str:
    worst = min(several, key=lambda axis: axis.margin_rad)
    if worst.fits:
        return f"{_sentence(where)} the worst case fits, with {angle(worst.margin_rad)} to spare on {worst.label}."
    rss = "fits" if all(axis.fits_rss for axis in several) else "does not fit either"
    return (
        f"{_sentence(where)} the worst case misses by {angle(-worst.margin_rad)} on {worst.label}; the root sum "
        f"square {rss}."
    )


# ------------------------------------------------------------------------------------------------ warnings


def warnings(fine: FinePointingStudy, paper: Control, amplifier: Amplifier) -> tuple[list[str], list[str]]:
    """What a reader must not overlook: of the loop that is judged, and of the other controllers.

    Args:
        fine: the study.
        paper: table of the loop that tracks the paper's sines.
        amplifier: its amplifier.
    """
    name = fine.best.design.name
    own = _stroke_warnings(fine) + _hardware_warnings(fine.scene.table, paper, amplifier)
    own += left_out(fine.scene) if isinstance(fine.scene, CoupledScene) else []
    others: list[str] = []
    for names, text in (*_limit_warnings(fine), *_bound_warnings(fine), *_theory_warnings(fine)):
        (own if name in names else others).append(text)
    return [f"fine pointing: {text}" for text in own], [f"fine pointing: {text}" for text in others]


def left_out(scene: CoupledScene) -> list[str]:
    """What of the file of a mirror of several axes does not count in its loop, in sentences.

    Args:
        scene: the loop.
    """
    mirror, f = scene.mirror, scene.table
    said = []
    if mirror.delay_s > 0.0:
        said.append(
            f"the recordings' delay of {format_quantity(mirror.delay_s, 's', 3)} is left out; fine_pointing.delay and "
            "fine_pointing.amplifier_bandwidth stand for the flight's own"
        )
    if f.rate_hz / 2 > mirror.excited_hz[1]:
        said.append(
            f"the mirror was recorded up to {format_quantity(mirror.excited_hz[1], 'Hz')}, and half of the control "
            f"rate is {format_quantity(f.rate_hz / 2, 'Hz')}: between them the model is a guess"
        )
    return said


def _limit_warnings(fine: FinePointingStudy) -> list[tuple[list[str], str]]:
    return [
        ([v.design.name], f"{v.design.name} {VARIANTS.get(variant, variant)}: {limits_met(residual.shares)}")
        for v in fine.verified
        for variant, residual in v.simulated.items()
        if residual.shares
    ]


def _stroke_warnings(fine: FinePointingStudy) -> list[str]:
    return [
        f"the stroke does not cover the worst case on {axis.label}: {angle(axis.needed_rad)} needed to either side, "
        f"{angle(axis.available_rad)} available (root sum square {angle(axis.needed_rss_rad)}); the simulated "
        "runs leave out the biases of [pointing], so they may stay within limits that the worst case exceeds"
        for axis in fine.scene.own_stroke
        if not axis.fits
    ]


def _hardware_warnings(f: FinePointing, c: Control, amplifier: Amplifier) -> list[str]:
    """Where the paper's sines are tracked by other hardware than that of the fine-pointing loop."""
    loops = [
        tuple(format_quantity(value, unit, 3) for value, unit in ((rate, "Hz"), (delay, "s"), (bandwidth, "Hz")))
        for rate, delay, bandwidth in (
            (f.rate_hz, f.delay_s, f.amplifier_bandwidth_hz),
            (c.rate_hz, c.delay_s, amplifier.bandwidth_hz),
        )
    ]
    if loops[0] == loops[1]:
        return []
    own, paper = (f"{rate}, {delay} of delay, an amplifier of {bandwidth}" for rate, delay, bandwidth in loops)
    return [f"judged at {own}; the paper's loop runs at {paper}: one does not stand for the other"]


def _bound_warnings(fine: FinePointingStudy) -> list[tuple[list[str], str]]:
    names: dict[str, list[str]] = {}
    for v in fine.verified:
        for bound in v.design.bound_by:
            names.setdefault(bound, []).append(v.design.name)
    return [
        (
            held,
            f"tuned up to a bound, {'the modulus margin asked for' if bound == MARGIN else bound}: {listed(held)}; "
            "beyond it less error may be left",
        )
        for bound, held in names.items()
    ]


def _theory_warnings(fine: FinePointingStudy) -> list[tuple[list[str], str]]:
    budget, r = fine.budget, room(fine)
    found = []
    if not budget.linear:
        found.append(
            (
                [budget.controller],
                f"the error budget of {budget.controller} is not linear: its parts combine to "
                f"{angle(budget.combined_rad)}, the whole is {angle(budget.full_rad)} rms",
            )
        )
    for v in fine.verified:
        straight, linear = v.simulated.get(Variant.STRAIGHT), v.theory.radial_rms_rad
        if straight is not None and abs(straight.rms_rad / linear - 1.0) > 0.1:
            found.append(
                (
                    [v.design.name],
                    f"{v.design.name} leaves {angle(straight.rms_rad)} rms without hysteresis, {angle(linear)} in "
                    "theory: its limits or quantisation act",
                )
            )
    if not r.holds:
        found.append(
            (
                [r.nearest.design.name],
                f"the linear bound of {angle(fine.optimum_rad)} rms lies above the "
                f"{angle(r.nearest.theory.radial_rms_rad)} of {r.nearest.design.name}, so it is none",
            )
        )
    return found
