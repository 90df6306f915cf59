"""The links as views: pointing, budgets, light, what pointing costs, acquisition."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from microrad.core.budget import Line
from microrad.core.intervals import Interval
from microrad.core.units import format_quantity
from microrad.link import LinkBudget
from microrad.link.acquisition.partner_search import EARLY, LONGEST_LOOK_S, Finding, Found, Scanned
from microrad.link.compliance import Compliance
from microrad.link.fade_series.coded import CodedFading
from microrad.link.pointing import OpenLoopPointing
from microrad.link.pointing.outage import Performance, stated_outage
from microrad.link.requirement import met, of_links
from microrad.link.study import LinkStudy, Solution
from microrad.report.links import words
from microrad.report.links.ground import ground_view
from microrad.report.links.lines import LINES, line_names, lines_table
from microrad.report.links.standard import standard_view
from microrad.report.marks import marked
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import given_angle, minus, percent, plain, power_text, quantity, share_of_time
from microrad.report.requirements import derived_words, requirement_table
from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Points, Soft, Verdict, View, opened, told

if TYPE_CHECKING:
    from microrad.study.pointing_penalty import Cost, LinkPerformance

RAREST_FADE_HZ = 1.0 / (365.25 * 86400.0)
"""Fades rarer than one in a year are not counted."""

_NO_VALUE = "\u2013"


def links_page(study: LinkStudy, solution: Solution | None = None, against: Compliance | None = None) -> str:
    """The budgets as one page that loads nothing, with their figures and no drawing library: their numbers stand below.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        solution: the values of a key that leave the required margin, if one was solved for.
        against: a standard with what the links have of it, if one was asked for.
    """
    from microrad.report.links.figures import link_figures
    from microrad.report.page.templates import inputs_view, mission_page

    judged = of_links(study)
    said = [] if solution is None else [words.solution_text(solution)]
    lead = Verdict(words.verdict(study), told(requirement_table(judged), derived_words(judged), *said), met(study))
    blocks: list[Block] = [lead, *links_views(study, [figure.static for figure in link_figures(study)])]
    blocks += [] if against is None else [standard_view(against)]
    first, *views = marked(blocks, study.file.sources)
    shown = [*(each for each in views if isinstance(each, View)), inputs_view(study.file.sources)]
    return mission_page(study.file, "budget", [first], shown, data="below")


def links_views(
    study: LinkStudy,
    figures: Sequence[Figure] = (),
    *,
    budgets: View | None = None,
    performance: View | None = None,
) -> tuple[View, ...]:
    """All that the links come to.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        figures: those of the links, where they are shown.
        budgets: the budgets in another form.
        performance: what other pointing errors cost the link than those of its jitter.
    """
    under = study.under_jitter
    if performance is None and under is not None:
        outage, said = stated_outage(study.data.requirement), words.under_jitter_sentence(under, study)
        performance = performance_view((under,), (), outage, [said])
    budgets = budgets or budgets_view(study, [budget_table(b) for b in study.budgets], figures)
    fading = fading_view(study.fading, figures)
    acquisition, own = acquisition_view(study.finding, figures), pointing_view(study.open_loop)
    return told(own, budgets, ground_view(study, figures), performance, fading, acquisition)  # type: ignore[return-value]


# ------------------------------------------------------------------------------------------------------------ pointing
def pointing_view(p: OpenLoopPointing | None) -> View | None:
    """The pointing budget with the largest that each error may be, its totals by every rule, what the beacon covers."""
    if p is None:
        return None
    half = None if p.reading is None else p.reading.half_angle_rad
    left = [] if half is None else [p.allocation(half, "rss"), p.allocation(half, "ecss-radial")]
    most = [[_most(each.note, each.largest_rad) for each in by] for by in left]
    largest = ("largest allowed", "largest allowed,\nECSS")[: len(most)]
    rows = [
        [line.name, given_angle(line.value), f"{100 * share:.1f} %", *(by[k] for by in most), line.basis, line.source]
        for k, (line, share) in enumerate(zip(p.lines, p.variance_shares, strict=True))
    ]
    words_from = 3 + len(largest)
    lines = Table(
        "",
        ("error source", "half width", "share of squares", *largest, "how it counts", "source"),
        rows,
        (0, words_from, words_from + 1),
        brief=(0, 1, 2, 3, 5, 6) if largest else (),  # without what ECSS leaves
        names={1: line_names("pointing", p.lines), 3: "pointing.left_for_each.x.largest_rad" if largest else ""},
    )
    sums = "; ".join(f"{each.name} {quantity(each.total_rad, 'rad')}" for each in p.summations)
    beside = [] if half is None else ["beacon's half angle"]
    totals = Table(
        "",
        ("total", "value", *beside, "of", "formula", "where it is authorised", "what speaks against it here"),
        [
            (s.name, given_angle(s.total_rad), *_covered(half, s.total_rad), s.of, s.formula, s.authority, s.caveat)
            for s in p.summations
        ],
        (0, *range(2, 6 + len(beside))),
        folded=f"Totals at {share_of_time(p.confidence)}: {sums}",
        names={1: "pointing.totals.x.total_rad"},
    )
    note = (
        ""
        if half is None
        else (
            "Largest allowed: the half width at which the root sum square, or the total of ECSS for two axes, equals "
            f"the beacon's half angle ({format_quantity(half, 'rad', 3)}), with all other errors as they are."
        )
    )
    return View("Open-loop pointing", told(lines, note and Soft(note), totals, *coverage(p)))


def _most(note: str, largest_rad: float) -> str:
    return "nothing" if note else format_quantity(largest_rad, "rad", 3)  # the others alone may exceed the cone


def _covered(half_angle_rad: float | None, total_rad: float) -> list[str]:
    """Whether the beacon's half angle covers a total, and by how much; nothing without a beacon."""
    if half_angle_rad is None:
        return []
    spare = half_angle_rad - total_rad
    return [f"covers it, {quantity(spare, 'rad')} left" if spare >= 0.0 else f"{quantity(-spare, 'rad')} short"]


def coverage(p: OpenLoopPointing) -> list[str]:
    """What the beacon's cone covers, by each reading of its divergence."""
    if p.reading is None or p.counter_reading is None:
        return []
    own, other = p.reading, p.counter_reading
    needed = format_quantity(own.confident_divergence_rad, "rad", 3)
    return [
        f"Read as {own.convention}, the beacon's half angle is {format_quantity(own.half_angle_rad, 'rad', 3)}, "
        f"{'at least' if own.covers else 'less than'} the root sum square of one axis. It covers the partner with a "
        f"probability of {own.coverage:.4f}; both axes and their biases are counted. {share_of_time(p.confidence)} "
        f"would take a divergence of {needed}. Read as {other.convention}, the half angle is "
        f"{format_quantity(other.half_angle_rad, 'rad', 3)} and the probability {other.coverage:.4f}."
    ]


# ------------------------------------------------------------------------------------------------------------- budgets
def budget_table(budget: LinkBudget) -> Table:
    """A budget line by line."""
    return lines_table(budget.name, budget.lines, budget.totals, _names(budget))


def _names(budget: LinkBudget) -> list[str]:
    return line_names(f"budgets.{budget.name}", budget.lines, budget.totals)


def paired_tables(budget: LinkBudget, other: LinkBudget, headings: tuple[str, str]) -> tuple[Table, ...]:
    """Two budgets of one link as one table, or as two where they do not have the same lines.

    Where basis, source or regime of a line differ, that of the other stands below. A total that one of them does not
    have is an empty cell.

    Args:
        budget: the first of both.
        other: another one of the same link.
        headings: of the two columns of values.
    """
    if [line.name for line in budget.lines] != [line.name for line in other.lines]:
        named = zip((budget, other), headings, strict=True)
        return tuple(lines_table(f"{b.name}, {heading}", b.lines, b.totals, _names(b)) for b, heading in named)
    own, others = ({line.name: line for line in b.totals} for b in (budget, other))
    names = dict.fromkeys((*own, *others))
    sums = [_paired(own.get(name), others.get(name), headings) for name in names]
    rows = [*(_paired(one, two, headings) for one, two in zip(budget.lines, other.lines, strict=True)), *sums]
    margins = ", ".join(
        f"{quantity(b.margin_db, 'dB')} {heading}" for b, heading in zip((budget, other), headings, strict=True)
    )
    columns, folded = ("line", *headings, *LINES[2:]), f"{budget.name}: margin {margins}"
    lines = line_names(f"budgets.{budget.name}", budget.lines)
    lines += [f"budgets.{budget.name}.totals.{name}.value" for name in names]
    of = {1: lines, 2: lines}
    return (Table(budget.name, columns, rows, (0, 3, 4, 5), totals=len(sums), folded=folded, names=of),)


def _paired(one: Line | None, two: Line | None, headings: tuple[str, str]) -> tuple[str | Cell, ...]:
    """A row for a line of two budgets; one of them may not have it."""
    there = [(line, heading) for line, heading in zip((one, two), headings, strict=True) if line is not None]
    values = ["" if line is None else quantity(line.value, line.unit) for line in (one, two)]
    warned = [(line.warning, heading) for line, heading in there if line.warning]
    alike = len({line.warning for line, _ in there}) == 1
    hint = "; ".join(warning if alike else f"{heading}: {warning}" for warning, heading in warned[: 1 if alike else 2])
    name = there[0][0].name
    texts = [_both([(getattr(line, of), heading) for line, heading in there]) for of in ("basis", "source", "regime")]
    return Cell(name, "!", hint) if hint else name, *values, *texts


def _both(texts: Sequence[tuple[str, str]]) -> str:
    """A text, and below it that of the other budget where it is another."""
    (first, _), *more = texts
    return "\n".join([first, *(f"{heading}: {text}" for text, heading in more if text != first)])


def budgets_view(
    study: LinkStudy,
    tables: Sequence[Table],
    figures: Sequence[Figure],
    sentences: Sequence[str] = (),
    *more: View,
    warned: str = "",
) -> View:
    """The budgets, what follows from them, and what moves their margins.

    Args:
        study: the links.
        tables: the budgets of beams.
        figures: those of the links, where they are shown; the first is open.
        sentences: more that follows.
        more: views at the end.
        warned: where else the warnings stand that the tables mark, a sentence; without one they stand below the tables.
    """
    noise, light = study.receiver_noise, study.tracking
    tables = [*tables]
    if noise:
        tables.append(
            lines_table(
                "Noise of the communication receiver, at the received power",
                noise,
                names=line_names("receiver_noise", noise),
            )
        )
    if light is not None and light.noise_equivalent_angle is not None:
        name = "The answer's light on the tracking sensor"
        named = [*line_names("tracking", light.noise_lines), "tracking.noise_equivalent_angle_rad"]
        tables.append(lines_table(name, light.noise_lines, [light.noise_equivalent_angle], named))
    below: tuple[Block, ...] = (warned,) if warned else ("Marked \u201c!\u201d in the tables:", Points(study.warnings))
    moving = [f for f in figures if f.name.startswith("tornado")]
    said = Points([*words.consequences(study), *sentences])
    return View(
        "Link budgets",
        told(*tables, *(below if study.warnings else ()), said, *opened(moving, [f.name for f in moving[:1]]), *more),
    )


# -------------------------------------------------------------------------------------------------------------- fading
def fading_view(f: CodedFading | None, figures: Sequence[Figure] = ()) -> View | None:
    """The coded link under a series of received power, with what the span of an interleaver changes.

    Args:
        f: the coded link under the series, if there is one.
        figures: those of the links.
    """
    if f is None:
        return None
    rows = [
        ("mean bit error ratio", power_text(f.ratio.value), interval_words(f.ratio)),
        ("windows above the target", percent(f.lost.value), interval_words(f.lost, percent)),
        ("power that the fades cost", cost_text(f.penalty_db), f"brings the mean back to {power_text(f.target)}"),
        ("margin under the fades", cost_text(f.margin_left_db), f"of {quantity(f.margin_db, 'dB')} at constant power"),
    ]
    names = ("fading.bit_error_ratio", "fading.lost", "fading.penalty_db", "fading.margin_db")
    found = Table("", ("under the fades", "value", "how it is known"), rows, (0, 2), names={1: names})
    fades = Table(
        f"Fades below {quantity(10.0 * math.log10(f.fades.level), 'dB')}, where the code is at its target",
        ("share of the time", "a second", "mean", "median", "90 %", "longest"),
        [
            (
                percent(f.fades.share),
                quantity(f.fades.per_second, "Hz"),
                *(quantity(each, "s") if math.isfinite(each) else _NO_VALUE for each in _durations(f)),
            )
        ],
        names={k: f"fading.fades.{name}" for k, name in enumerate(_FADES)},
    )
    spans = zip(f.curve.span_s, f.curve.penalty_db, strict=True)
    curve = Table(
        "What an interleaver brings",
        ("span", "power that the fades cost"),
        [(quantity(span, "s") if span else "none", cost_text(cost)) for span, cost in spans],
        names={1: "fading.curve.penalty_db"},
    )
    shown = [each for each in figures if each.name == words.INTERLEAVER]
    said = told(words.under_fades(f), found, fades, curve, *shown, Soft(words.fading_note(f)))
    return View("Coded link under fades", said)


_FADES = ("share", "per_s", "mean_s", "median_s", "ninetieth_s", "longest_s")


def _durations(f: CodedFading) -> tuple[float, ...]:
    return f.fades.mean_s, f.fades.median_s, f.fades.ninetieth_s, f.fades.longest_s


def interval_words(found: Interval, text: Callable[[float], str] = power_text) -> str:
    """The interval of a mean over a series, in words.

    Args:
        found: the mean with its interval.
        text: makes text of a number.
    """
    if not math.isfinite(found.high):
        return "the series is too short for an interval"
    return f"{text(found.low)} to {text(found.high)} with 99 % confidence, between parts of the series"


def cost_text(cost_db: float) -> str:
    """Decibels, or that no power will do."""
    return quantity(cost_db, "dB") if math.isfinite(cost_db) else "beyond any power" if cost_db > 0.0 else "none"


# --------------------------------------------------------------------------------------------------------- performance
def performance_view(
    cases: Sequence[Performance], costs: Sequence[Cost], outage: float, sentences: Sequence[str], best: str = ""
) -> View:
    """The link under each distribution of pointing errors.

    Args:
        cases: the distributions.
        costs: what hysteresis takes from each controller.
        outage: share of the time that the loss is judged at, of 1.
        sentences: what stands above the tables.
        best: controller to mark, or "".
    """
    return View(
        "What pointing costs the link",
        told(
            *sentences,
            performance_table(cases, costs, outage, best),
            Soft(performance_note(costs=bool(costs))),
            *fade_sentences(cases),
        ),
    )


_PERFORMANCE = (
    *("performance.rms_rad", "performance.mean_loss_db", "performance.outage_loss_db"),
    *("performance.uncoded_penalty_db", "performance.margin_db", "performance.outage"),
    *("performance.below_required_margin", "performance.best_half_angle_rad", "performance.lost_against_best_db"),
    *("performance.data_rate_bit_s", "hysteresis_costs.margin_change_db", "hysteresis_costs.data_rate_change_bit_s"),
)
"""Names of the numbers of a row in the JSON."""


def performance_table(cases: Sequence[Performance], costs: Sequence[Cost], outage: float, best: str = "") -> Table:
    """A row for each distribution of pointing errors.

    Args:
        cases: the link under each of them.
        costs: what hysteresis takes from some of them.
        outage: share of the time at which the loss is judged.
        best: name of the controller to mark.
    """
    of = {(c.source, c.controller, c.mirror): cost_cells(c) for c in costs}
    none = ["", ""] if costs else []
    rows = [
        [c.source, c.controller, c.mirror, *cells(c), *of.get((c.source, c.controller, c.mirror), none)] for c in cases
    ]
    marked = _as_given(cases, best) if best else []
    at = f"{100 * outage:g} %"
    headings = (
        "pointing error from",
        "controller",
        "mirror",
        "rms (µrad)",
        "mean loss (dB)",
        f"loss at {at} (dB)",
        "penalty without a code (dB)",
        f"margin at {at} (dB)",
        "outage",
        "below required margin",
        "best half angle (µrad)",
        "lost against it (dB)",
        "data rate (Mbit/s)",
    )
    more = ("hysteresis costs (dB)", "and (Mbit/s)") if costs else ()
    return Table(
        "",
        (*headings, *more),
        rows,
        (0, 1, 2),
        best=marked,
        brief=(0, 1, 2, 3, 5, 7, 8),
        folded=f"The link under each of {len(cases)} pointing errors" if len(cases) > 3 else "",
        names=dict(enumerate(_PERFORMANCE, 3)),
    )


def _as_given(cases: Sequence[Performance], controller: str) -> list[int]:
    """The rows of a controller with the mirror as it is given."""
    from microrad.mirror import Variant

    return [k for k, c in enumerate(cases) if c.controller == controller and c.mirror == Variant.GIVEN]


def cells(c: Performance) -> list[str]:
    """The numbers of one row."""
    return [
        f"{math.hypot(*c.jitter.bias_rad, *c.jitter.rms_rad) * 1e6:.2f}",
        f"{c.mean_loss_db:.2f}",
        f"{c.outage_loss_db:.2f}",
        words.without_code(c),
        minus(f"{c.margin_db:+.2f}"),
        share(c.outage),
        share(c.short),
        f"{c.best.half_angle_rad * 1e6:.1f}{'*' if c.best.at_limit else ''}",
        f"{c.best.current_excess_db:.2f}",
        "none" if math.isnan(c.data_rate_bit_s) else _mbit_s(c.data_rate_bit_s),
    ]


def share(value: float) -> str:
    """A share of the time; nothing was seen of what is none."""
    return "none" if value == 0.0 else f"{value:.1e}" if value < 1e-3 else f"{float(f'{100 * value:.2g}'):g} %"


def performance_note(*, costs: bool) -> str:
    """How the columns are to be read."""
    how = (
        "Rms: radial, about zero. Penalty, the power that the errors cost: with a code the mean loss where its "
        "interleaver spans many fades, the loss at the outage where it spans none; without a code what brings the mean "
        "bit error ratio back to its target, in a Gaussian beam, unknown for a receiver that is given by its "
        "sensitivity alone. Outage: share of the time with a margin below 0 dB. Best half angle: of a Gaussian beam, "
        "at 1/e2, with the most power at the error of that column; a star: the present one, since a narrower one would "
        "take a larger aperture. Data rate: the largest with the required margin at that loss."
    )
    against = " What hysteresis costs: against the same controller and the same errors on a mirror without it."
    return how + against if costs else how


def residuals_sentence(found: LinkPerformance) -> str:
    """How the residuals enter the link."""
    from microrad.study.pointing_penalty import FINE

    half = format_quantity(found.half_angle_rad, "rad", 3)
    fine = any(c.source == FINE for c in found.cases)
    first, then = (" first", ", then the loop under vibration and noise") if fine else ("", "")
    return (
        "The communication link under every simulated residual, by its own distribution and not by one static number: "
        f"the loss that is exceeded for {100 * found.outage:g} % of the time, against a beam of {half} half angle at "
        f"1/e2. Clean sines{first} (one axis, as in the paper){then}."
    )


def cost_cells(c: Cost) -> list[str]:
    """What hysteresis takes from one controller, as text: dB of margin, Mbit/s."""
    rate = "" if math.isnan(c.data_rate_bit_s) else _mbit_s(-c.data_rate_bit_s)
    return [_fixed(-c.margin_db, 2), rate]


def _mbit_s(rate_bit_s: float) -> str:
    """A data rate in Mbit/s, whole from ten of them on and in two digits below."""
    return plain(1e-6 * rate_bit_s, 2) if abs(rate_bit_s) < 1e7 else _fixed(1e-6 * rate_bit_s, 0)


def _fixed(value: float, decimals: int) -> str:
    """A number that has no sign when it is shown as zero, and a minus sign, not a hyphen, when it is negative."""
    return minus(f"{round(value, decimals) + 0.0:.{decimals}f}")


def fade_sentences(cases: Sequence[Performance]) -> list[str]:
    """Fades below the required margin, a sentence for each case whose spectrum is known, and what to doubt."""
    known = [c for c in cases if not math.isnan(c.fades_per_s)]
    if not known:
        return []
    if all(c.fades_per_s < RAREST_FADE_HZ for c in known):
        return ["Fades below the required margin: less than one a year, for Gaussian errors of these spectra."]
    said = "; ".join(
        f"{c.controller or c.source}: "
        + (
            f"{plain(c.fades_per_s)} a second of {format_quantity(c.fade_s, 's', 3)} each"
            if c.fades_per_s >= RAREST_FADE_HZ
            else "less than one a year"
        )
        for c in known
    )
    found = [f"Fades below the required margin, for Gaussian errors of that rms and spectrum: {said}."]
    return found + [f"{c.fade_warning[0].upper()}{c.fade_warning[1:]}." for c in known if c.fade_warning][:1]


# --------------------------------------------------------------------------------------------------------- acquisition
def acquisition_view(found: Finding | None, figures: Sequence[Figure]) -> View | None:
    """Each way to find the partner, exact beside simulated, with its stages and one run.

    Args:
        found: the search for the partner; None gives no view.
        figures: those of the links.
    """
    if found is None:
        return None
    at = f"{100 * EARLY:g} % within"
    headings = ("way", "lock", "simulated", "mean time", "simulated", at)
    ways = Table("", headings, [_way(w) for w in found.ways], (0,), names=dict(enumerate(_WAYS, 1)))
    trade = opened([f for f in figures if not f.name.startswith("tornado") and f.name != words.INTERLEAVER], ())
    stages = [view for w in found.ways for view in (_stages(w),)]
    return View("Acquisition", told(*acquisition_paragraphs(found), ways, *stages, *trade))


_WAYS = tuple(
    f"acquisition.ways.{name}"
    for name in ("x.success_probability", "x.simulated_success_probability", "x.mean_time_s", "x.simulated_mean_time_s")
)


def _way(w: Found) -> list[str]:
    """One way; what never locks has no times."""
    o = w.outcome
    return [
        w.name,
        f"{o.success_probability:.4f}" if w.possible else "never",
        f"{w.simulated_probability:.4f}",
        quantity(o.mean_time_s, "s") if w.possible else _NO_VALUE,
        words.simulated_mean(w),
        quantity(w.early_s, "s") if w.possible else _NO_VALUE,
    ]


def _stages(w: Found) -> View:
    stages = [(s.name, quantity(s.longest_s, "s"), f"{s.success_probability:.4f}", s.on_failure) for s in w.stages]
    run = [(t.stage, t.to, t.cause, f"{t.time_s:.3f} s") for t in w.log]
    names = {1: "acquisition.stages.x.longest_s", 2: "acquisition.stages.x.success_probability"}
    tables = (
        Table("", ("stage", "at most", "succeeds", "else back to"), stages, (0, 3), names=names),
        Table("One simulated run", ("stage", "goes to", "cause", "time"), run, (0, 1, 2)),
    )
    return View(f"Stages of the {w.name}, and one simulated run", tables, folded=True, listed=False)


def acquisition_paragraphs(f: Finding) -> list[str]:
    """What makes up the probability, and how the scan is laid out."""
    c = f.chances
    found = [
        "Exact sums over all orders of failures beside a seeded simulation of the same process. The wide beacon covers "
        f"its partner with a probability of {c.beacon_coverage:.4f} (its power suffices out to "
        f"{format_quantity(f.beacon_radius_rad, 'rad', 3)} off axis), the answer lands with {c.answer_coverage:.4f} "
        f"and is seen with {c.answer_detection:.4f}, the narrow beam back lands with {c.return_coverage:.4f}. The "
        "random part of the pointing error is drawn anew at each attempt; biases stand at their bounds."
    ]
    if f.scanned is not None:
        found.append(scan_words(f.scanned, f.sigma_rad))
    return found


def scan_words(s: Scanned, sigma_rad: float) -> str:
    """How the scan is laid out, and what its light does to it.

    Args:
        s: the scan.
        sigma_rad: uncertainty that it covers, rms per axis, rad.
    """
    covers = (
        f"The scan covers {format_quantity(s.radius_rad, 'rad', 3)} about the predicted direction, for an uncertainty "
        f"of {format_quantity(sigma_rad, 'rad', 3)} rms per axis with biases"
    )
    stated = f"the {quantity(s.stated_detection_s, 's')} that are stated"
    if not s.detects:
        return (
            f"{covers}. It detects nothing: at the edge of its beam the partner's sensor would need more than "
            f"{quantity(LONGEST_LOOK_S, 's')} in place of {stated}."
        )
    covers += f", in {quantity(s.duration_s, 's')} at most."
    if s.needed_detection_s <= s.stated_detection_s:
        return covers
    needed = quantity(s.needed_detection_s, "s")
    return f"{covers} At the edge of its beam the partner's sensor needs {needed} in place of {stated}; the scan waits."
