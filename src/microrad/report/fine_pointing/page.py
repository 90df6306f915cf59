"""The fine-pointing loop as a view: what each controller leaves, its design, the error budget, stroke and sines."""

import math
from collections.abc import Callable, Sequence

from microrad.core.units import format_quantity
from microrad.loop.control import LoopMargins
from microrad.loop.controller_study import FinePointingStudy, Residual, Scene, Sine
from microrad.loop.controller_study.parts import DELAY
from microrad.mirror.geometry import StrokeBudget
from microrad.report.fine_pointing import words
from microrad.report.fine_pointing.data import parameter_units, rms_by_source, sources
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import angle, given_angle, micro, percent, plain, share_of_time
from microrad.report.tables import Cell, Table
from microrad.report.view import Points, Soft, Verdict, View, told

OPEN = ("fine-pointing-budget",)
"""Figures that a page shows at once; the others when it is asked."""


def fine_pointing_view(fine: FinePointingStudy, required: float, figures: Sequence[Figure]) -> View:
    """The study with its figures; its tables have microradians, as they say.

    Args:
        fine: the study.
        required: largest radial error (rad) that is allowed for the mission's share of the time.
        figures: its figures, of which those in `OPEN` are shown at once.
    """
    met = fine.best.meets(required) and not fine.scene.unknown_dynamics
    verdict = Verdict(" ".join(words.result(fine, required)), [" ".join(words.theory(fine))], met)
    drawn = [f if f.name in OPEN else View(f.title, [f], folded=True, listed=False) for f in figures]
    return View(
        "Fine pointing under vibration and noise",
        told(
            verdict,
            Soft(setting(fine)),
            *words.arrival(fine.scene.loop),
            residuals_view(fine, required),
            designs_view(fine),
            sources_view(fine),
            budget_view(fine),
            stroke_view(fine),
            sines_view(fine, required),
            *drawn,
        ),
        "fine-pointing",
    )


def setting(fine: FinePointingStudy) -> str:
    """What was simulated, in a sentence."""
    loop, table = fine.scene.loop, fine.scene.table
    rate = format_quantity(1.0 / loop.timing.period_s, "Hz")
    delay = format_quantity(loop.timing.delay_steps * loop.timing.step_s, "s")
    noise = given_angle(loop.optical.noise_rad)
    disturbances = words.listed([f"{each.name} {angle(each.rms_rad)}" for each in loop.disturbances[0]])
    several = "" if isinstance(fine.scene, Scene) else f"Mirror of several axes: {words.several_axes(loop)}. "
    return (
        f"{several}Control at {rate} with {delay} of delay, sensor noise {noise} rms per axis and reading; "
        f"disturbances, rms per axis before the loop: {disturbances}. Simulated: {table.runs} runs of "
        f"{format_quantity(table.duration_s, 's')} each, the first {format_quantity(table.settle_s, 's')} left out, "
        f"seed {table.seed}. A design has to keep a modulus margin of {table.modulus_margin:g}."
    )


def _best(fine: FinePointingStudy, names: Sequence[str]) -> list[int]:
    """Rows of the best controller."""
    return [place for place, name in enumerate(names) if name == fine.best.design.name]


def with_interval(residual: Residual) -> str:
    """A radial rms (µrad) with the half width of its interval, as many decimals as that has a meaning for."""
    value, half = 1e6 * residual.rms_rad, 1e6 * residual.rms_interval_rad
    if not (half > 0.0 and math.isfinite(half)):
        return micro(residual.rms_rad)
    decimals = min(3, max(0, -math.floor(math.log10(half))))
    return f"{value:.{decimals}f} ± {max(half, 10.0**-decimals):.{decimals}f}"


# ------------------------------------------------------------------------------------------------ controllers
def residuals_view(fine: FinePointingStudy, required_rad: float) -> View:
    """What each controller leaves, in theory and by variant of the mirror.

    Args:
        fine: the study.
        required_rad: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    variants = [v for v in words.NAMES if any(v in each.simulated for each in fine.verified)]
    time = share_of_time(fine.quantile)
    rows = [
        [
            v.design.name,
            micro(v.theory.radial_rms_rad),
            *(cell for variant in variants for cell in _simulated(v.simulated.get(variant), required_rad)),
        ]
        for v in fine.verified
    ]
    table = Table(
        "",
        ("controller", "rms", *("rms", time, "largest") * len(variants)),
        rows,
        groups=(("", 1), ("theory", 1), *((words.NAMES[v], 3) for v in variants)),
        best=_best(fine, [v.design.name for v in fine.verified]),
        names={1: "fine_pointing.theory_rms_rad"} | _simulated_names(variants),
    )
    met = limits(fine)
    shares = "Limits met, as a share of control samples (saturation, lost spot, the inverse's rate) or plant steps:"
    none = "No controller met a limit: none saturates, none is beyond what was identified, and no spot is lost."
    return View(
        "What each controller leaves",
        told(
            "Radial error at the line of sight in µrad: rms in theory (linear: no hysteresis, no limits), then as "
            f"simulated on each variant of the mirror. Required: at most {given_angle(required_rad)} for {time} of the "
            "time.",
            table,
            Soft(
                "± is the 99 % interval of the rms over the runs. Bold and shaded: the best, by its error at "
                f"{time} on the mission's mirror; the first is the baseline."
            ),
            shares if met else none,
            Points(met),
        ),
    )


def _simulated_names(variants: Sequence[str]) -> dict[int, str]:
    """What the columns of each variant of the mirror are in the JSON."""
    of = "rms_rad", "quantile_rad", "largest_rad"
    named = [f"fine_pointing.simulated.{variant}.{name}" for variant in variants for name in of]
    return dict(enumerate(named, 2))


def _simulated(residual: Residual | None, required_rad: float) -> tuple[str | Cell, ...]:
    if residual is None:
        return "", "", ""
    quantile = Cell(micro(residual.quantile_rad), _mark(residual.quantile_rad, required_rad))
    return with_interval(residual), quantile, micro(residual.largest_rad)


def _mark(value_rad: float, required_rad: float) -> str:
    return "PASS" if value_rad <= required_rad else "FAIL"


def limits(fine: FinePointingStudy) -> list[str]:
    """Limits met by controller and variant of the mirror, a line each."""
    return [
        f"{v.design.name}, {words.NAMES[variant]}: {words.limits_met(residual.shares)}"
        for v in fine.verified
        for variant, residual in v.simulated.items()
        if residual.shares
    ]


def designs_view(fine: FinePointingStudy) -> View:
    """What each controller was tuned to, its margins and what it is bound by."""
    units = parameter_units(fine.scene)
    rows = []
    for v in fine.verified:
        inverse = f"; inverse {v.design.inverse}" if v.design.inverse else ""
        said = words.tuned_to(v.design.values, units) + inverse + words.larger_margin(v.design.margin)
        rows.append((v.design.name, *design_cells(said, v.design.loop_margins, v.design.bound_by)))
    best, about = _best(fine, [v.design.name for v in fine.verified]), ONE_AXIS
    if not isinstance(fine.scene, Scene):
        about = (
            "Both axes closed, linear, the smallest over the mirrors that a design has to hold for. Gain and phase are "
            "what the disk margin allows both axes to change by at once."
        )
    return View("What each controller was tuned to, and its margins", designs(rows, about, best=best), folded=True)


ONE_AXIS = "One axis, linear, on the sampled loop with its delay: the worst of the places where the loop can be cut."
"""What the margins of a mirror on each axis are of."""


def designs(
    rows: Sequence[Sequence[str]], about: str, between: Sequence[str] = (), best: Sequence[int] = ()
) -> tuple[str, Table, Soft]:
    """The table of designs between the sentences that explain it.

    Args:
        rows: for each design its name, what stands in the columns ``between``, and its `design_cells`.
        about: what the margins are of, in a sentence.
        between: headings of further columns of numbers, behind the name.
        best: rows that stand out, counted from 0.
    """
    margins = "modulus", "gain (dB)", "phase (°)", "delay (µs)", "disk", "bandwidth (Hz)", "crossover (Hz)"
    headings = ("controller", *between, "tuned to", *margins, "bound by")
    said = "Bandwidth: lowest frequency at which the sensitivity reaches 0 dB."
    filled = [i for i in range(len(headings)) if any(row[i] for row in rows)]
    if headings.index("crossover (Hz)") in filled:  # a loop of several axes has none, and no delay margin
        said += " Crossover: highest frequency at which the loop gain does."
    of = "modulus", "gain_up_db", "phase_rad", "delay_s", "disk", "bandwidth_hz", "crossover_hz"
    names = {place: f"controllers.margins.{name}" for place, name in enumerate(of, 2 + len(between))}
    table = Table("", headings, rows, (0, 1 + len(between), len(headings) - 1), best=best, names=names)
    return about, table.columns(filled), Soft(said)


def design_cells(tuned: str, margins: LoopMargins, bound_by: Sequence[str]) -> tuple[str, ...]:
    """A design in the table of `designs`, behind its name.

    Args:
        tuned: what it was tuned to, in words.
        margins: those of its nominal loop; of several axes delay and crossover are nan: they have none.
        bound_by: what keeps its residual from being smaller.
    """
    gain, several = 20.0 * math.log10(margins.gain_up), math.isnan(margins.delay_s)
    return (
        tuned,
        f"{margins.modulus:.2f}",
        _or(f"{gain:.1f}", gain, "any"),
        _or(f"{math.degrees(margins.phase_rad):.0f}", margins.phase_rad, "any"),
        "" if several else _or(f"{1e6 * margins.delay_s:.0f}", margins.delay_s, "any"),
        f"{margins.disk:.2f}",
        plain(margins.bandwidth_hz),
        "" if several else _or(plain(margins.crossover_hz), margins.crossover_hz, "none"),
        ", ".join(bound_by) or "nothing",
    )


def _or(text: str, value: float, instead: str) -> str:
    return text if math.isfinite(value) else instead


def sources_view(fine: FinePointingStudy) -> View:
    """Radial rms by controller and source in theory, after a row of what the disturbances are before the loop."""
    names = sources(fine.verified)
    open_loop: dict[str, float] = {}
    for each in (d for several in fine.scene.loop.disturbances for d in several):
        open_loop[each.name] = math.hypot(open_loop.get(each.name, 0.0), each.rms_rad)
    before = [micro(open_loop.get(n, math.nan)) for n in names]
    rows = [["before the loop", *before, micro(math.hypot(*open_loop.values()))]]
    for v in fine.verified:
        by_source = rms_by_source(v)
        left = [micro(by_source.get(name, math.nan)) for name in names]
        rows.append([v.design.name, *left, micro(v.theory.radial_rms_rad)])
    best = _best(fine, [row[0] for row in rows])
    of = dict.fromkeys(range(1, len(names) + 1), "fine_pointing.theory_rms_by_source_rad.x")
    of[len(names) + 1] = "fine_pointing.theory_rms_rad"
    table = Table("", ("controller", *map(words.source_name, names), "all"), rows, (0,), best=best, names=of)
    said = "Radial rms in theory (µrad) that each source leaves behind the loop by itself."
    return View("Controllers against disturbances", (said, table), folded=True)


# ------------------------------------------------------------------------------------------------ error budget
def budget_view(fine: FinePointingStudy) -> View:
    """Parts alone, their combinations, and what the rest changes, with the sentences to it."""
    b = fine.budget
    total = math.fsum(part.rms_rad**2 for part in b.parts)
    theory = math.hypot(*(part.theory_rad for part in b.parts if math.isfinite(part.theory_rad)))
    parts = [
        (
            words.source_name(part.name),
            micro(part.rms_rad),
            micro(part.theory_rad),
            _variance_share(part.rms_rad**2, total),
        )
        for part in b.parts
    ]
    totals = [
        ("Root sum square of the parts", micro(b.combined_rad), micro(theory), ""),
        ("All together, without hysteresis", micro(b.together_rad), "", ""),
        ("All together, the mission's mirror", micro(b.full_rad), "", ""),
    ]
    headings = (
        "part, by itself and without hysteresis",
        "simulated, rms (µrad)",
        "theory, rms (µrad)",
        "share of variance",
    )
    simulated = [*["error_budget.parts.x.rms_rad"] * len(parts), "error_budget.combined_rms_rad"]
    simulated += ["error_budget.together_without_hysteresis_rms_rad", "error_budget.full_rms_rad"]
    in_theory = "error_budget.parts.x.theory_rms_rad"
    left_out = [(d.name, micro(d.with_rad), micro(d.without_rad), micro(d.added_rad)) for d in b.differences]
    effects = ("left out of the full loop", "rms with it (µrad)", "without it (µrad)", "it adds (µrad)")
    return View(
        f"Error budget of {b.controller}",
        (
            " ".join(budget_sentences(fine)),
            Table("", headings, [*parts, *totals], totals=len(totals), names={1: simulated, 2: in_theory}),
            Table("", effects, left_out, names=dict.fromkeys((1, 2, 3), "error_budget.parts.x.rms_rad")),
            Soft("Added is the root of the difference of the squares; it is negative where the part helps."),
        ),
        "error-budget-parts",
    )


def _variance_share(variance: float, total: float) -> str:
    share = 100.0 * variance / total if total else 0.0
    return "< 0.1 %" if 0.0 < share < 0.05 else f"{share:.1f} %" if share else "0 %"


def budget_sentences(fine: FinePointingStudy) -> list[str]:
    """Whether the parts make up the whole, and if not, where the loop is not linear."""
    b = fine.budget
    apart = percent(abs(b.together_rad / b.combined_rad - 1.0))
    sentences = [f"Without hysteresis the parts combine to what they leave together, to within {apart}."]
    whole = b.full_rad / b.combined_rad - 1.0
    if b.linear:
        sentences.append(f"With it they still do, to within {percent(abs(whole))}: the loop counts as linear.")
        return sentences
    adding = [d for d in b.differences if d.name != DELAY and d.added_rad > 0.01 * b.full_rad]
    where = words.listed([f"{d.name} adds {angle(d.added_rad)}" for d in adding])
    sentences.append(
        f"The full loop leaves {percent(abs(whole))} {'more' if whole > 0.0 else 'less'} than the parts combine "
        f"to, so it is not linear (10 % is the limit){': ' + where if where else ''}."
    )
    return sentences


# ------------------------------------------------------------------------------------------------ stroke
def stroke_view(fine: FinePointingStudy) -> View:
    """The stroke budgets side by side, a column for each output of the mirror with and without the point-ahead."""
    ours = fine.scene.own_stroke
    groups = (
        ("Point-ahead on the mirror", fine.scene.stroke),
        ("Point-ahead elsewhere", fine.scene.stroke_without_point_ahead),
    )
    axes = [axis for _, several in groups for axis in several]
    rows = [[line.name, *(micro(axis.lines[i].value) for axis in axes)] for i, line in enumerate(axes[0].lines)]
    sums = [[name, *map(show, axes)] for name, show in _stroke_rows(axes[0].travel_angle)]
    named = [(f"{name}{' (this mission)' if several is ours else ''}", len(several)) for name, several in groups]
    heading = "half range (µrad)\npairs: worst case / root sum square"
    of = [*[f"stroke.lines_rad.{line.name}" for line in axes[0].lines], "stroke.total_rad", "stroke.needed_rad"]
    of += ["stroke.available_rad", "stroke.margin_rad", "", "stroke.largest_magnification"]
    table = Table(
        "",
        (heading, *(axis.name for axis in axes)),
        [*rows, *sums],
        groups=(("", 1), *named),
        totals=len(sums),
        names=dict.fromkeys(range(1, len(axes) + 1), of),
    )
    notes = [f"{line.name}: {line.basis.partition(';')[0]}. {line.source}" for line in axes[0].lines]
    square = (
        "The root sum square supposes independent terms of one class; ECSS-E-ST-60-10C does not grant that to bias and "
        "random terms together."
    )
    lines = View("The stroke line by line", (table, Points(notes), square), folded=True, listed=False)
    return View("Stroke", (" ".join(words.stroke(fine)), lines))


def _both(worst: float, rss: float) -> str:
    return f"{micro(worst)} / {micro(rss)}"


def _yes(worst: bool, rss: bool) -> str:
    return f"{'yes' if worst else 'no'} / {'yes' if rss else 'no'}"


def _stroke_rows(angle: str) -> tuple[tuple[str, Callable[[StrokeBudget], str]], ...]:
    """Rows below the lines: name, and what a column shows there, worst case over root sum square."""
    return (
        ("Total at the line of sight", lambda a: _both(a.total_rad, a.total_rss_rad)),
        (f"Needed at the mirror, {angle} angle", lambda a: _both(a.needed_rad, a.needed_rss_rad)),
        ("Available there: half of the usable travel", lambda a: micro(a.available_rad)),
        ("Margin", lambda a: _both(a.margin_rad, a.margin_rss_rad)),
        ("Fits", lambda a: _yes(a.fits, a.fits_rss)),
        ("Largest telescope magnification", _magnification),
    )


def _magnification(axis: StrokeBudget) -> str:
    values = (axis.largest_magnification, axis.largest_magnification_rss)
    return " / ".join("any" if math.isinf(v) else f"{v:.2f}" for v in values)


# ------------------------------------------------------------------------------------------------ sines
def sines_view(fine: FinePointingStudy, required_rad: float) -> View | None:
    """Controllers by sine: rms and quantile, a group of columns for each variant of the mirror; None without sines.

    Args:
        fine: the study.
        required_rad: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    if not fine.sines:
        return None
    found: dict[tuple[str, str, float], Sine] = {(s.controller, s.variant, s.freq_hz): s for s in fine.sines}
    columns = list(dict.fromkeys((s.variant, s.freq_hz) for s in fine.sines))
    variants = dict.fromkeys(variant for variant, _ in columns)
    groups = [(words.NAMES[v], sum(variant == v for variant, _ in columns)) for v in variants]
    names = list(dict.fromkeys(s.controller for s in fine.sines))
    rows = [[name, *(_sine(found.get((name, *column)), required_rad) for column in columns)] for name in names]
    headings = ("controller", *(f"{freq:g} Hz" for _, freq in columns))
    of = dict.fromkeys(range(1, len(headings)), "fine_pointing.sines.rms_rad")
    amplitude, time = given_angle(fine.scene.sine_amplitude_rad), share_of_time(fine.quantile)
    return View(
        "The paper's sines under vibration and noise",
        (
            f"Fig. 6 and 8 again: a {amplitude} sine on axis x with vibration and sensor noise on both axes. Body "
            "pointing and point-ahead are left out: the stroke would not hold them beside it. Radial error in µrad: "
            f"rms / {time}. {words.tracked(fine, required_rad)}",
            Table("", headings, rows, groups=(("", 1), *groups), best=_best(fine, names), names=of),
        ),
        folded=True,
    )


def _sine(sine: Sine | None, required_rad: float) -> str | Cell:
    if sine is None:
        return ""
    return Cell(f"{micro(sine.rms_rad)} / {micro(sine.quantile_rad)}", _mark(sine.quantile_rad, required_rad))
