"""What a study found, in words and as plain data."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

from microrad.core.units import format_quantity
from microrad.link.budget.lines import DEEPEST_DB, POINT_AHEAD_LOSS, POINTING_LOSS
from microrad.link.requirement import IMPOSSIBLE, Subject, time_kept
from microrad.loop.controller_study import Scene
from microrad.loop.controller_study.results import PROMISE
from microrad.loop.paper_cases import Run
from microrad.mirror import Variant
from microrad.mission.file import changed_from_shipped
from microrad.report.day import words as day_words
from microrad.report.fine_pointing import words as fine_pointing_words
from microrad.report.foundation import placards
from microrad.report.marks import marked, with_sign
from microrad.report.quantities import MINUS, angle, apart, counted, minus, quantity, signed
from microrad.report.requirements import (
    derived_words,
    first_warning,
    margin_text,
    met_words,
    nearest,
    nearness,
)
from microrad.report.study import contributors
from microrad.report.view import Block, Points, Verdict, View, told, views_text
from microrad.study.pointing_penalty import FINE, Cost
from microrad.study.study import Study

TERMS = {
    "Beacon": "wide beam by which the terminal is found.",
    "Answer": "narrow beam that the partner sends back to the beacon.",
    "Margin": "received over required power, in dB. At 3 dB twice the required light arrives.",
    "Outage": "share of the time with a margin below 0 dB.",
    "Rms": "root of the mean square of an error, its constant part counted.",
    "Root sum square": "root of the sum of the squares, as errors add that have nothing to do with each other.",
    "Share of squares": "the part that one error has in the sum of the squares of all.",
    "Half width": "size of an error to either side of the line of sight: its bound, or the stated standard deviations.",
    "Residual": "the pointing error that a loop leaves.",
    "Inverse": "a model of the mirror's hysteresis, run backwards ahead of the mirror to take its hysteresis out.",
    "Half angle at 1/e2": "angle off the axis at which a beam has 13.5 % of the intensity on its axis.",
    "Point-ahead": (
        "angle by which a beam leads the direction in which the partner is seen. Both move while light is under way."
    ),
    "Noise-equivalent angle": "rms error of one reading of the tracking sensor, by noise alone.",
    "Modulus margin": (
        "smallest distance of the open loop's frequency response from the point -1, where the loop becomes unstable. "
        "It is the inverse of the largest amplification of a disturbance."
    ),
}
"""What the page says without a word of explanation elsewhere."""
_FINE_TERMS = {
    "Stroke": "angle to either side by which the mirror can move the line of sight.",
    "OLYMPUS": "a spectrum of vibration, after what was measured on the satellite of that name.",
    "PI": "controller with a proportional and an integral part; PID has a derivative part as well.",
    "LQG": "linear-quadratic-Gaussian controller: a Kalman filter with the best state feedback for it.",
}
_OF_ALL_AXES = {
    "H-infinity": "controller of all axes for the largest error of the mirror's model that a loop of its shape stands.",
}


@dataclass(frozen=True, slots=True)
class Warned:
    """A warning: what it says, the requirement that it speaks of ("" for none), and what it costs in dB (0: unknown).

    One about the "verdict" puts the judged margin itself in doubt.
    """

    text: str
    about: Subject | Literal["", "verdict"] = ""
    cost_db: float = 0.0


def headline(study: Study) -> str:
    """The verdict in one sentence. "The link closes" stands above no requirement that is not met."""
    at = _judged_at(study)
    if not study.closes:
        links = {"beacon": study.beacon.margin_db, "answer": study.answer.margin_db, "communication": study.margin_db}
        failing = [f"{name} {_margin(study, margin, name)}" for name, margin in links.items() if margin < 0.0]
        if not failing:
            return f"Whether the link closes at {at} is not known: {IMPOSSIBLE}."
        return f"The link does not close: {', '.join(failing)}, at {at}."
    margin, failed = _margin(study, study.margin_db, "judged"), [r for r in study.requirements if not r.met]
    if failed:
        names = " and ".join(f"{r.name} ({r.unknown or margin_text(r)})" for r in failed)
        return f"Not every requirement is met: {names}. The margin is {margin} at {at}.{_extrapolated(study)}"
    met = met_words(study.requirements)
    return f"The link closes, with a margin of {margin} at {at}, and {met}.{_extrapolated(study)}"


def _margin(study: Study, margin_db: float, name: str) -> str:
    """A margin with the sign that its number in the JSON has."""
    judged = "judged" if name == "communication" else name
    return with_sign(signed(margin_db, "dB"), study.file.sources, f"margin_db.{judged}")


def _judged_at(study: Study) -> str:
    """The working point at which the verdict has its margin."""
    m, case = study.file.mission, study.fine_case
    rate = format_quantity(m.communication.data_rate_bit_s, "bit/s")
    if case is not None:
        return f"{rate} for {time_kept(m.requirement)}"
    left = format_quantity(study.left_rad(study.residual), "rad", 3)
    return f"{rate} and a simulated residual of {left} ({m.requirement.residual_statistic})"


def _extrapolated(study: Study) -> str:
    return " The mirror model is extrapolated." if _judged_beyond(study) else ""


def _judged_beyond(study: Study) -> str:
    """How far the mirror of the judged loop is driven beyond where it was identified, or nothing."""
    return beyond_identified(study, study.residual) if study.fine_case is None else ""


def mirror_of_loop(study: Study) -> str:
    """That the fine-pointing loop has another mirror than the paper's, where it does; else nothing."""
    fine = study.fine_pointing
    if fine is None or isinstance(fine.scene, Scene):
        return ""
    return (
        f"The mirror of the paper's loop. The fine-pointing loop has one of several axes: "
        f"{fine_pointing_words.several_axes(fine.scene.loop)}."
    )


def terms(study: Study) -> dict[str, str]:
    """What the page of a study explains: each term, and what it means."""
    if study.fine_pointing is None:
        return TERMS
    has = {verified.design.name for verified in study.fine_pointing.verified}
    return TERMS | _FINE_TERMS | {name: said for name, said in _OF_ALL_AXES.items() if name in has}


def short(study: Study) -> list[str]:
    """What limits the terminal and what to do about it, in five sentences at most."""
    found = [
        *limits(study),
        _largest_warning(study),
        "" if study.day is None else day_words.headline(study.day)[0],
        _papers_loop(study),
    ]
    return list(filter(None, found))


def limits(study: Study) -> list[str]:
    """What the margin of the verdict is, and which requirement is nearest to its limit."""
    case = study.fine_case
    under = "" if case is None else f", with what {case.controller} leaves of {case.source}"
    margin = (
        f"The margin is the power that the communication link receives over the power that it needs, at "
        f"{_judged_at(study)}{under}."
    )
    return [margin, _limit(study)]


def _limit(study: Study) -> str:
    r = nearest(study.requirements)
    said = contributors.contributor(study, r)
    if r.unknown:
        return f"Nothing can be said of the {r.name}: {r.unknown}."
    which, todo = "Nearest to its limit is" if r.met else "What limits it is", contributors.advice(study, r)
    return f"{which} the {r.name}. {said[:1].upper()}{said[1:]}{todo}."


def _largest_warning(study: Study) -> str:
    if beyond := _judged_beyond(study):
        return f"Not to be relied on: {beyond}."
    found = warnings(study)
    return first_warning(found)


def _papers_loop(study: Study) -> str:
    """How the paper's loop does, where it is not what the verdict judges, or nothing."""
    failed = [r.name for r in study.papers_loop if not r.met]
    if not study.papers_loop:
        return ""
    m, run = study.file.mission, study.residual
    q, found_rad = m.requirement, study.left_rad(run)
    left, most = (format_quantity(rad, "rad", 3) for rad in (found_rad, q.pointing_error_rad))
    judged = f"would miss {' and '.join(failed)}" if failed else "would meet what is required"
    return (
        f"For comparison alone: the paper's loop ({run.controller}, sine of {run.freq_hz:g} Hz) {judged}. It leaves "
        f"{left} ({q.residual_statistic}) where {most} is allowed, and a margin of "
        f"{signed(study.achieved.margin_db, 'dB')} where {q.margin_db:.2f} dB is required."
    )


def explanation(study: Study) -> list[str]:
    """What the headline rests on, a sentence each."""
    m = study.file.mission
    sentences = []
    failed = [r for r in study.requirements if not r.met]
    if failed:
        causes = dict.fromkeys(r.because.removeprefix("the residual: ") for r in failed)
        sentences.append(f"What limits it: {'; '.join(causes)}.")
    if study.fine_pointing is not None:
        sentences += fine_pointing_words.short(study.fine_pointing, m.requirement.pointing_error_rad)
    sentences += filter(None, (hysteresis_cost(study), found(study)))
    if study.day is not None:
        day = study.day
        sentences += [*day_words.headline(day), *day_words.latency_words(day), *day_words.assumption_words(day)[:1]]
    return sentences


def papers_loop(study: Study) -> list[str]:
    """What the paper's loop leaves in the worst of its sines, a sentence each."""
    m, run = study.file.mission, study.residual
    trace, q, kind = run.trace, m.requirement, "margin" if m.jitter is None else "static margin"
    two_axes = ", times √2 for two equal axes" if m.conventions.residual == "radial" else ""
    sentences = [
        f"As budgeted, at {format_quantity(m.communication.pointing_error_rad, 'rad', 3)}, the {kind} is "
        f"{signed(study.static.margin_db, 'dB')}; {m.requirement.margin_db:g} dB is required.",
        f"The loop ({run.controller}, {run.freq_hz:g} Hz) leaves {format_quantity(trace.peak_rad, 'rad', 3)} at its "
        f"peaks and {format_quantity(trace.rms_rad, 'rad', 3)} rms on its axis{two_axes}; "
        f"{format_quantity(q.pointing_error_rad, 'rad', 3)} ({q.residual_statistic}) is allowed.",
    ]
    if extrapolated := beyond_identified(study, run):
        sentences.append(f"Not to be relied on: {extrapolated}.")
    if study.comparison is not None:
        left = study.left_rad(study.comparison.residual)
        sentences.append(
            f"On the mission's comparison model of the mirror the residual is {format_quantity(left, 'rad', 3)} and "
            f"the margin {signed(study.comparison.margin_db, 'dB')}."
        )
    return [*sentences, *read_otherwise(study)]


def read_otherwise(study: Study) -> list[str]:
    """Which readings of what the paper leaves open, each changed alone, would turn the communication link's verdict."""
    closes = study.achieved.margin_db >= 0.0
    run = [r for r in study.other_readings if not r.failure]
    turned = [f"{r.key} = {r.other} ({quantity(r.margin_db, 'dB')})" for r in run if r.closes != closes]
    if not run:
        return []
    if not turned:
        return [f"None of {len(run)} other readings of the paper, one at a time, changes whether that link closes."]
    would = "would not close" if closes else "would close"
    return [f"With one point of the paper read otherwise that link {would}: {', '.join(turned)}."]


def hysteresis_cost(study: Study) -> str:
    """What hysteresis costs the link with the controllers that the verdict names, or nothing."""
    run = study.residual
    named = [(f"sine of {run.freq_hz:g} Hz", run.controller)]
    if study.fine_pointing is not None:
        named.append((FINE, study.fine_pointing.best.design.name))
    said = [
        f"{quantity(c.margin_db, 'dB').removeprefix(MINUS)}{_rate_lost(c)} with {c.controller} ({c.source})"
        for c in study.performance.costs
        if c.mirror == "given" and (c.source, c.controller) in named and c.margin_db < 0.0
    ]
    outage = f"{100 * study.performance.outage:g} %"
    return (
        f"Hysteresis costs the link {' and '.join(said)}, at the pointing loss that is exceeded {outage} of the time."
        if said
        else ""
    )


def _rate_lost(cost: Cost) -> str:
    """The data rate that goes with a cost, where there is one."""
    lost = -cost.data_rate_bit_s
    if math.isnan(lost):
        return ""
    return f" or {lost * 1e-6:.0f} Mbit/s" if lost >= 1e6 else f" or {quantity(lost, 'bit/s')}"


def loop_in_budget(study: Study) -> list[str]:
    """How the part of the loop in the budget of pointing errors compares with its runs, or nothing."""
    fine, table = study.fine_pointing, study.file.mission.error_budget
    if fine is None or table is None or not table.with_loop:
        return []
    left, linear = fine.best.simulated[Variant.GIVEN].rms_rad, fine.best.theory.radial_rms_rad
    return [
        f"In all, {fine.best.design.name} leaves {angle(linear)} rms by that theory, and {angle(left)} simulated with "
        "hysteresis."
    ]


def found(study: Study) -> str:
    """How the partner is found, or nothing."""
    f, p = study.links.finding, study.open_loop.reading
    if f is None or p is None:
        return ""
    said = "; ".join(
        f"the {w.name} locks with a probability of {w.outcome.success_probability:.4f}, in "
        f"{quantity(w.outcome.mean_time_s, 's')} on average"
        if w.possible
        else f"the {w.name} never locks"
        for w in f.ways
    )
    return (
        f"Acquisition, with its retries: {said}. The beacon's cone at 1/e2 covers its partner with a "
        f"probability of {p.coverage:.2f}, biases at their bounds about both axes."
    )


def verdict_box(study: Study) -> Verdict:
    """The verdict with its requirements."""
    good = study.met and (study.fine_case is not None or not beyond_identified(study, study.residual))
    judged = contributors.judged_table(study, study.requirements)
    return Verdict(headline(study), told(judged, derived_words(study.requirements)), good)


def warnings_view(study: Study) -> View:
    """What a reader must not overlook, by what it puts in doubt."""
    ranked = ranked_warnings(study)
    said = [block for what, several in ranked.items() for block in (f"{what}:", Points(several))]
    count = sum(map(len, ranked.values()))
    return View(f"Warnings ({count}), the weightiest first" if count else "Warnings", said or ["None."], "warnings")


def papers_loop_view(study: Study) -> View:
    """The loop of the paper, judged by itself where the verdict is on another one."""
    own = (
        "The verdict judges the mission's own fine-pointing loop. This is the loop of the paper with its sines, judged "
        "by itself."
    )
    judged = study.papers_loop
    first = (own, contributors.judged_table(study, judged)) if judged else ()
    return View("The paper's loop", [*first, Points(papers_loop(study))])


def verdict_text(study: Study, width: int = 80, verbose: bool = False) -> str:
    """The verdict as plain text: headline, a line for each requirement, and what limits them.

    Args:
        study: a run of a whole mission.
        width: columns of the terminal.
        verbose: adds everything else that the first part of the report says, and its warnings.
    """
    if not verbose:
        return views_text(marked([verdict_box(study), *short(study)], study.file.sources), width)
    said = [*limits(study), *explanation(study)]
    blocks: list[Block] = [verdict_box(study), *said, papers_loop_view(study), warnings_view(study)]
    return views_text(marked(blocks, study.file.sources), width)


def beyond_identified(study: Study, run: Run) -> str:
    """The warning that a run drives the mirror faster or further than its model was identified for, or nothing.

    Args:
        study: a run of a whole mission.
        run: one of its runs of the paper's loop.
    """
    table = study.file.mission.mirror
    low, high = (end + table.bias_v for end in run.drive_span_v)
    beyond = []
    if run.fastest_drive_v_s > table.rate_limit_v_s:
        fastest, most = apart(run.fastest_drive_v_s, table.rate_limit_v_s, "V/s")
        beyond.append(f"{fastest} (identified up to {most})")
    if low < table.drive_min_v or high > table.drive_max_v:
        least, known = (text.removesuffix(" V") for text in apart(low, table.drive_min_v, "V"))
        most, known_most = apart(high, table.drive_max_v, "V")
        beyond.append(f"{least} to {most} (identified from {known} to {known_most})")
    if run.mirror == Variant.STRAIGHT or not beyond:
        return ""
    return f"{run.trace.name}: the mirror model is extrapolated to a drive of {' and of '.join(beyond)}"


def warnings(study: Study) -> list[str]:
    """What a reader must not overlook, the weightiest first."""
    return [each for several in ranked_warnings(study).values() for each in several]


def ranked_warnings(study: Study) -> dict[str, list[str]]:
    """The warnings by what they put in doubt.

    Those of a requirement that is missed stand first. The others follow by what they cost in dB, the largest first;
    where that is not known, by the order of what they put in doubt and of the requirements in `nearest`.
    """
    own: list[str] = []
    others: list[str] = []
    if study.fine_pointing is not None:
        m = study.file.mission
        own, others = fine_pointing_words.warnings(study.fine_pointing, m.control, m.amplifier)
    paper = [*_of_loops(study), *_of_runs(study)]
    judged = paper if study.fine_pointing is None else []
    found = {
        "The verdict": [*_of_verdict(study), *map(Warned, _of_sources(study)), *_of_links(study)],
        "The model of the mirror": [*map(Warned, study.summary.warnings)],
        "The loop that is judged": [*map(_of_fine_loop, own), *_of_budget_loop(study), *map(Warned, judged)],
        "The day": [*_of_day(study), *map(Warned, _not_run(study))],
        "Other controllers": [*map(Warned, others)],
        "The paper's loop and figures": [] if judged else [*map(Warned, paper)],
        "What was checked": [Warned(each.text) for each in placards(study.file.sources)],
    }
    weight = partial(_weight, study)
    ranked = {what: sorted(said, key=weight) for what, said in found.items() if said}

    def of_group(each: tuple[str, list[Warned]]) -> tuple[bool, bool, float]:
        return min((met, sure, cost) for sure, met, cost, _ in map(weight, each[1]))

    groups = sorted(ranked.items(), key=of_group)
    return {what: [minus(warned.text) for warned in said] for what, said in groups}


def _weight(study: Study, warned: Warned) -> tuple[bool, bool, float, tuple[bool, bool, float]]:
    """What a warning is put in order by: doubt of the verdict, a missed requirement, decibels, the requirement."""
    r = next((r for r in study.requirements if r.subject == warned.about), None)
    order = (True, True, math.inf) if r is None else nearness(r)
    return warned.about != "verdict", r is None or r.met, -warned.cost_db, order


def _of_links(study: Study) -> list[Warned]:
    about: Mapping[str, Subject] = {"Communication": "communication", "Beacon": "beacon", "Answer": "answer"}
    return [Warned(text, about[budget.name]) for budget in study.links.budgets for text in budget.warnings]


def _of_budget_loop(study: Study) -> list[Warned]:
    """That the loop leaves far more than the budget of pointing errors has of it, or nothing."""
    said, fine = loop_in_budget(study), study.fine_pointing
    if not said or fine is None:
        return []
    times = fine.best.simulated[Variant.GIVEN].rms_rad / fine.best.theory.radial_rms_rad
    if times <= PROMISE:
        return []
    text = f"the error budget takes the loop by its linear theory; simulated, it leaves {times:.2f} times as much rms"
    return [Warned(text, "error budget")]


def _of_fine_loop(text: str) -> Warned:
    return Warned(text, "stroke" if "the stroke does not cover" in text else "fine pointing")


def _of_day(study: Study) -> list[Warned]:
    """The warnings of the day; a range beyond the mission's costs by its square."""
    m, day = study.file.mission, study.day
    if day is None:
        return []
    furthest = max((e.range_most_m for e in day.encounters), default=math.nan)
    beams = {"communication": m.communication, "beacon": m.beacon, "answer": m.answer}
    costs = {name: 20.0 * math.log10(furthest / m.range_m(b)) for name, b in beams.items() if b is not None}
    return [
        Warned(text, cost_db=next((db for name, db in costs.items() if text.startswith(f"{name}.distance")), 0.0))
        for text in day.warnings
    ]


def _of_sources(study: Study) -> list[str]:
    return [
        f"{key} = {value} names the paper as its source, but the paper's mission has {shipped}"
        for key, value, shipped in changed_from_shipped(study.file.sources)
    ]


def _of_loops(study: Study) -> list[str]:
    """The hysteresis loops of the figures, driven beyond what is known of the mirror or than its amplifier can."""
    m = study.file.mission
    low, high = m.mirror.bias_v - m.scenario.loop_amplitude_v, m.mirror.bias_v + m.scenario.loop_amplitude_v
    drawn, amplifier, found = "the hysteresis loops are drawn for a drive beyond", m.amplifier, []
    if not m.mirror.drive_min_v <= low <= high <= m.mirror.drive_max_v:
        found.append(f"{drawn} the range that the mirror was identified for")
    if not amplifier.output_min_v <= amplifier.gain * low <= amplifier.gain * high <= amplifier.output_max_v:
        found.append(f"{drawn} the amplifier's range")
    return found + [
        f"hysteresis loop at {loop.freq_hz:g} Hz: {counted(loop.clamped, 'sample')} beyond the identified rate"
        for loop in study.loops
        if loop.clamped
    ]


def _of_runs(study: Study) -> list[str]:
    """The paper's sines: extrapolated drives, and limits that were met."""
    found = [*filter(None, (beyond_identified(study, run) for run in study.runs))]
    for run in study.runs:
        c = run.trace.counts
        counts = {
            ("step", " beyond the identified rate"): c.clamped + c.inverse_clamped,
            ("saturated sample", ""): c.saturated,
            ("slew-limited step", ""): c.slew_limited,
            ("reversal", " of the command within 10 samples of the last"): c.alternating,
        }
        found += [
            f"{run.trace.name}: {counted(count, noun)}{where}" for (noun, where), count in counts.items() if count
        ]
    return found


def _of_verdict(study: Study) -> list[Warned]:
    """What the judged margin leaves out, or may not be relied on for."""
    m, case, found = study.file.mission, study.fine_case, []
    if m.jitter is not None:
        under_db = study.communication.margin_db
        text = (
            "[jitter] is not in this verdict, which judges the pointing error that the simulated loop leaves: the two "
            f"are not summed. Under [jitter] alone the margin is {signed(under_db, 'dB')} for "
            f"{time_kept(m.requirement)}, as microrad budget judges it"
        )
        found.append(Warned(text, "verdict", max(study.margin_db - under_db, 0.0)))
    lost = study.achieved.loss_db(POINTING_LOSS, POINT_AHEAD_LOSS) if case is None else case.outage_loss_db
    if lost > DEEPEST_DB:
        text = (
            f"the verdict's pointing loss of {quantity(lost, 'dB')} is beyond {DEEPEST_DB:g} dB, where the wings and "
            "the scatter of a real beam decide, not the formula of its main lobe"
        )
        found.append(Warned(text, "verdict", lost))
    return found


def _not_run(study: Study) -> list[str]:
    """Tables of the day that this study has no use for, and why."""
    m, found = study.file.mission, []
    asked = m.operations is not None and m.operations.contact is not None
    if asked and study.contact is None and study.day is not None and study.day.relay.contacts:
        found.append("operations.contact is not run: it takes the tables acquisition and fine_pointing")
    if m.constellation is not None and study.plan is None:
        found.append("constellation is left out: its pattern cannot repeat an orbit.leo from a file, or a slot")
    return found
