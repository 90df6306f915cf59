"""The verdict: each requirement with its margin and what limits it, and each claim of the paper beside our value."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from microrad import link
from microrad.core.units import format_beyond
from microrad.link import pointing
from microrad.link.error_budget.assembly import Judged, PointingErrorBudget
from microrad.link.pointing.outage import Performance
from microrad.link.requirement import IMPOSSIBLE, Requirement, Subject, derived_from, time_kept
from microrad.loop.controller_study import FinePointingStudy
from microrad.loop.paper_cases import PID, PID_WITH_INVERSE, PaperCases, Run
from microrad.mirror import MirrorParts, Variant, hysteresis
from microrad.mirror import summary as mirror_summary
from microrad.mirror.hysteresis import HysteresisLoop
from microrad.mission.model import Amplifier, Source
from microrad.mission.tables import mirror as mirror_table
from microrad.mission.tables.link import LinkRequirement
from microrad.orbit import day as day_study
from microrad.study import paper

CLAIMED_TRAVEL_RAD = 2.5e-3  # section 3.2
PAPER_RATE_BIT_S = 300e6  # section 2.2


# ------------------------------------------------------------------------------------------------------- requirements
def of_residual(
    q: LinkRequirement,
    mirrors: MirrorParts,
    sources: Mapping[str, Source],
    achieved: link.LinkBudget,
    left_rad: float,
    cause: str,
) -> tuple[Requirement, Requirement]:
    """The error of the paper's loop in the worst of its sines, with its cause, and the margin that it leaves.

    Args:
        q: What the mission requires of the link, and the largest residual that it allows.
        mirrors: The mission's mirror, which tells whether its dynamics are known.
        sources: Where each value of the mission comes from, by its dotted key.
        achieved: The communication link at the residual.
        left_rad: The residual (rad), in the mission's statistic and convention.
        cause: What it is made of, `residual_cause`.
    """
    spare, derived = achieved.margin_db - q.margin_db, derived_from(sources, "communication.")
    because, name, lacking = "the residual: " + cause, "communication margin", unknown(mirrors.table)
    doubt = lacking if achieved.possible else IMPOSSIBLE
    return (
        _error("residual", "residual pointing error", q, left_rad, cause, lacking),
        Requirement("communication", name, "dB", q.margin_db, achieved.margin_db, spare, because, doubt, derived),
    )


def of_fine_pointing(
    q: LinkRequirement, sources: Mapping[str, Source], fine: FinePointingStudy, case: Performance
) -> tuple[Requirement, ...]:
    """The mirror's stroke; the best controller's error for its share of the time, and the margin but for the outage.

    Args:
        q: What the mission requires of the link, and the largest residual that it allows.
        sources: Where each value of the mission comes from, by its dotted key.
        fine: The study of the fine-pointing loop.
        case: The link under the best controller on the mission's mirror.
    """
    controller, cause, lacking = fine.best.design.name, fine.budget.dominant, _lacking(fine.scene.unknown_dynamics)
    left, title = fine.best.simulated[Variant.GIVEN].quantile_rad, f"fine pointing at {100 * fine.quantile:g} %"
    name, derived = f"link margin for {time_kept(q)} ({controller})", derived_from(sources, "communication.")
    spare, doubt = case.margin_db - q.margin_db, lacking if case.possible else IMPOSSIBLE
    return (
        _stroke(sources, fine),
        _error("fine pointing", f"{title} ({controller})", q, left, cause, lacking),
        Requirement("communication", name, "dB", q.margin_db, case.margin_db, spare, cause, doubt, derived),
    )


def of_error_budget(
    budget: PointingErrorBudget, sources: Mapping[str, Source], fine: FinePointingStudy | None
) -> tuple[Requirement, ...]:
    """The requirements on the pointing errors, each by the full distribution, with the source that weighs most.

    Args:
        budget: The budget.
        sources: Where each value of the mission comes from, by its dotted key.
        fine: The study of the fine-pointing loop where what it leaves is a source.
    """
    lacking = "" if fine is None else _lacking(fine.scene.unknown_dynamics)

    def line(of: Judged) -> Requirement:
        limit, found = of.total.required.limit_rad, of.total.quantile_rad
        assert limit is not None  # a mission states one
        name = f"{of.name.replace('_', ' ')} ({of.total.required.index.kind})"
        derived = derived_from(sources, f"error_budget.requirements.{of.name}.", "error_budget.sources.")
        most = of.shares[0].name.replace("_", " ")
        return Requirement("error budget", name, "rad", limit, found, limit - found, most, lacking, derived)

    return tuple(map(line, budget.judged))


def unknown(mirror: mirror_table.Mirror) -> str:
    """What would have to be known of the mission's mirror before a loop around it may be relied on, or nothing."""
    return _lacking(mirror_summary.unknown_dynamics(mirror))


def _lacking(unknown_dynamics: str) -> str:
    return "dynamics of the mirror, which its model does not have" if unknown_dynamics else ""


def _stroke(sources: Mapping[str, Source], fine: FinePointingStudy) -> Requirement:
    axis = min(fine.scene.own_stroke, key=lambda each: each.margin_rad)
    largest = max(axis.lines, key=lambda line: line.value).name
    name, derived = f"stroke for the worst case ({axis.label})", derived_from(sources, "pointing.")
    needed, given = axis.needed_rad, axis.available_rad
    return Requirement("stroke", name, "rad", needed, given, axis.margin_rad, largest, derived=derived)


def _error(subject: Subject, name: str, q: LinkRequirement, left_rad: float, cause: str, doubt: str) -> Requirement:
    allowed = q.pointing_error_rad
    return Requirement(subject, name, "rad", allowed, left_rad, allowed - left_rad, cause, doubt)


def residual_cause(mirrors: MirrorParts, statistic: str, worst: Run, runs: tuple[Run, ...]) -> str:
    """What the residual is made of: an amplifier at its limits, else the lag of the loop, else hysteresis.

    Args:
        mirrors: The mission's mirror.
        statistic: What the error is measured by, "peak" or "rms".
        worst: The run that leaves the residual, on the mission's mirror.
        runs: All runs, among them the same sine under the same controller on the mirror without hysteresis.
    """
    if worst.at_limits:
        return f"{worst.at_limits} at {worst.freq_hz:g} Hz"
    linear = next(
        r for r in runs if (r.mirror, r.controller, r.freq_hz) == (Variant.STRAIGHT, worst.controller, worst.freq_hz)
    )
    share = 1.0 - linear.trace.left_rad(statistic) / worst.trace.left_rad(statistic)
    if share < 0.5:
        return f"lag of the loop at {worst.freq_hz:g} Hz"
    model = mirrors.own[Variant.GIVEN].model
    wrong_way = isinstance(model, hysteresis.BoucWen) and model.reversal_slope_rad_v() < 0.0
    return f"hysteresis at {worst.freq_hz:g} Hz{', whose model first turns the wrong way' if wrong_way else ''}"


@dataclass(frozen=True, slots=True)
class Claim:
    """A printed claim of the paper, our value for it, whether they agree, and why.

    ``agrees`` is "yes", "no", "partly", "not judged" (its frequencies were not run, or a run met a limit), or
    "inferred" where our input was chosen from the claim itself, so that agreeing proves nothing.
    """

    where: str
    claim: str
    ours: str
    agrees: str
    why: str


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the claims are judged on."""

    amplifier: Amplifier
    cases: PaperCases
    loops: tuple[HysteresisLoop, ...]
    summary: mirror_summary.Summary
    runs: tuple[Run, ...]
    scan: paper.Scan | None
    day: day_study.DayStudy | None


def against_paper(e: Evidence) -> tuple[Claim, ...]:
    """Each printed claim in the order of the paper: those of its links on its own numbers, the others on this run."""
    return (
        *_link_claims(),
        _travel_claim(e),
        *([] if e.cases.mirrors.table.linear is None else [_linear_claim(e.summary)]),
        _loops_claim(e.loops),
        _worse_claim(e),
        *_drop_claims(e),
        *([] if e.scan is None else [_together_claim(e.scan)]),
        *([] if e.day is None else _day_claims(e.day)),
    )


def _day_claims(day: day_study.DayStudy) -> list[Claim]:
    """What the paper says of contacts, judged on the mission's own orbits."""
    relay, direct, days = day.relay, day.direct, day.view.days
    a_day, minutes = day.view.rises / days, day.view.median_s / 60.0
    claims = [
        Claim(
            "abstract",
            "a line of sight in each of about 15 orbits a day",
            f"the relay rises {format_beyond(a_day, 14.0 if a_day < 15.0 else 16.0, '', 3)} times a day",
            _agrees(14.0 <= a_day <= 16.0, days >= 1.0),
            "orbit, slot and grazing height are assumptions: the paper prints none",
        ),
        Claim(
            "section 2.2",
            "about 45 minutes for each session",
            "no contact is seen whole" if np.isnan(minutes) else f"{format_beyond(minutes, 45.0, 'min', 3)} (median)",
            _agrees(minutes >= 45.0, not np.isnan(minutes)),
            "what the geometry allows; the session is shorter by acquisition, and by what the relay does not grant",
        ),
        Claim(
            "abstract",
            "data reach the ground in almost real time",
            f"half within {_minutes(relay.median_s)}, 99 % within {_minutes(relay.slow_s)}",
            "partly" if relay.median_s <= 60.0 < relay.slow_s else _agrees(relay.slow_s <= 60.0, True),
            "judged at one minute, by the median and by 99 %: data made out of sight of the relay wait for a contact",
        ),
    ]
    if direct is not None and direct.contacts:
        longest = max(c.duration_s for c in direct.contacts) / 60.0
        why = "above the mask of the mission's stations; at the horizon itself a pass takes some minutes more"
        ours = f"{longest:.1f} min at most"
        claims.append(
            Claim(
                "abstract", "a ground pass takes less than about 10 minutes", ours, _agrees(longest <= 10.5, True), why
            )
        )
    return claims


def _minutes(time_s: float) -> str:
    if np.isinf(time_s):
        return "never"
    return format_beyond(time_s / 60.0, 1.0, "min", 2) if time_s >= 60.0 else f"{time_s:.2g} s"


def _link_claims() -> tuple[Claim, ...]:
    m, sources = paper.links().mission, paper.links().sources
    data = link.of(m)
    open_loop = pointing.open_loop_budget(m.pointing, data.shared, m.beacon, sources)
    beacon = link.beam_budget("beacon", data.shared, m.beacon, sources).margin_db
    communication = link.communication_budget(data, sources).margin_db
    return _beacon_claim(open_loop), _sign_claim(beacon, communication), _margin_claim(data, sources)


def _beacon_claim(p: pointing.OpenLoopPointing) -> Claim:
    claim = "a 780 µrad beacon covers the root sum square of three errors"
    why = "two of the three errors are not printed; ours are chosen so that 780 µrad follows, read as the full angle"
    other = p.other_reading
    if other.convention == "half-1/e2":
        times = other.half_angle_rad / p.rss_rad
        why += f"; read as the half angle, the beacon would cover {times:.1f} times our errors"
    ours = f"{p.required_divergence_rad * 1e6:.0f} µrad needed for {p.rss_rad * 1e6:.0f} µrad (half width)"
    if p.reading is not None:
        why += (
            f"; a root sum square is that of one axis; counting both axes, with biases at their bounds, the beacon's "
            f"cone covers its partner with a probability of {p.reading.coverage:.2f}"
        )
    return Claim("section 2.1", claim, ours, "inferred" if p.covers else "no", why)


def _sign_claim(beacon: float, communication: float) -> Claim:
    ours = f"beacon {beacon:+.1f} dB, communication {communication:+.1f} dB"
    why = "the sensitivities of both receivers are assumptions: the paper prints neither"
    agrees = "inferred" if min(beacon, communication) > 0.0 else "no"
    return Claim("Table 2", "both margins are positive", ours, agrees, why)


def _margin_claim(data: link.DataLink, sources: Mapping[str, Source]) -> Claim:
    c, q, counts = data.table, data.requirement, [r.photons_per_bit for r in link.implied_sensitivity(data)]
    ideal = ", ".join(f"{r.name} {r.margin_db:.1f} dB" for r in link.ideal_receivers(data, sources))
    why = (
        f"inferred, hence circular: {q.margin_db:g} dB at {c.data_rate_bit_s / 1e6:g} Mbit/s and "
        f"{q.pointing_error_rad * 1e6:g} µrad imply a receiver of {min(counts):.0f} to {max(counts):.0f} photons per "
        f"bit over the {len(counts)} readings of Table 2. With ideal receivers (1e-9) the margin would be: {ideal}"
    )
    margin = float(link.margin_map(data, [PAPER_RATE_BIT_S], [10e-6])[0, 0])
    ours = f"{margin:.2f} dB at 300 Mbit/s and 10 µrad"
    agrees = "inferred" if abs(margin - 3.0) <= 0.05 else "no"
    return Claim("section 2.2, Fig. 2", "3 dB at 300 Mbit/s and 10 µrad", ours, agrees, why)


def _travel_claim(e: Evidence) -> Claim:
    a = e.amplifier
    span = (a.output_max_v - a.output_min_v) / a.gain
    reach = 2.0 * hysteresis.output_amplitude(e.summary.model, span / 2.0)
    why = f"what the hysteresis model gives over a drive range of {span:.4g} V; the rest is drive or gain not printed"
    agrees = "yes" if reach >= CLAIMED_TRAVEL_RAD else "no"
    ours = f"{format_beyond(1e3 * reach, 1e3 * CLAIMED_TRAVEL_RAD, '', 3)} mrad within the amplifier's range"
    return Claim("section 3.2", "travel of 2.5 mrad", ours, agrees, why)


def _linear_claim(s: mirror_summary.Summary) -> Claim:
    outside = [r for r in s.roots if not r.in_band]
    ours = f"gain {s.dc_gain:.4f} at DC, {s.in_band_gain[0]:.4f} to {s.in_band_gain[1]:.4f} in the band"
    why = "Eq. 2 has a gain of its own beside d1 of Eq. 3: cascading both would square it, so Eq. 2 is normalised"
    if outside:
        where = " and ".join(f"a {r.kind} at {r.frequency_hz:.4f} Hz" for r in outside)
        why += f"; {where} lie outside the excited band, drift fitted as dynamics"
    return Claim("Eq. 2", "linear dynamics of the mirror", ours, "partly" if outside else "yes", why)


def _loops_claim(loops: tuple[HysteresisLoop, ...]) -> Claim:
    ours = ", ".join(f"{100 * loop.width:.2f} % at {loop.freq_hz:g} Hz" for loop in loops)
    grows = len(loops) > 1 and all(a.width < 0.99 * b.width for a, b in pairwise(loops))
    why = "width of h over the output's peak-to-peak; some of it at 100 Hz is linear phase lag that Eq. 2 holds too"
    judged = {60.0, 100.0} <= {loop.freq_hz for loop in loops}
    return Claim("Fig. 5", "the loop widens from 60 to 100 Hz", ours, _agrees(grows, judged), why)


def _pairs(e: Evidence, controller: str) -> list[tuple[Run, Run]]:
    """Runs on the printed mirror with the same run without hysteresis."""
    linear = {r.freq_hz: r for r in e.runs if (r.mirror, r.controller) == (Variant.STRAIGHT, controller)}
    printed = (r for r in e.runs if (r.mirror, r.controller) == (Variant.GIVEN, controller))
    return [(r, linear[r.freq_hz]) for r in printed if r.freq_hz in linear]


def _worse_claim(e: Evidence) -> Claim:
    pairs = [p for p in _pairs(e, PID) if p[0].freq_hz in e.cases.scenario.pid_frequencies_hz]
    apart = [a.trace.error_rad[a.trace.steady] - b.trace.error_rad[b.trace.steady] for a, b in pairs]
    added = [float(np.sqrt(np.mean(each**2))) for each in apart]
    ours = "; ".join(
        f"{a.freq_hz:g} Hz: peak {b.trace.peak_rad * 1e6:.1f} → {a.trace.peak_rad * 1e6:.1f} µrad, "
        f"difference {d * 1e6:.1f} µrad rms"
        for (a, b), d in zip(pairs, added, strict=True)
    )
    worse = len(pairs) > 1 and all(a.trace.rms_rad > b.trace.rms_rad for a, b in pairs)
    grows = all(x < y for x, y in pairwise(added))
    judged = len(pairs) > 1 and not any(r.at_limits for pair in pairs for r in pair)
    agrees = _agrees(worse and grows, judged)
    why = "judged by rms, and by the rms of the difference between the two error signals"
    if agrees == "yes" and any(a.trace.peak_rad < 1.05 * b.trace.peak_rad for a, b in pairs):
        why += "; in the total peak the lag of the loop hides it"
    return Claim("Fig. 6", "hysteresis makes the errors worse, more so at higher frequency", ours, agrees, why)


def _agrees(holds: bool, judged: bool) -> str:
    return ("yes" if holds else "no") if judged else "not judged"


def _drop_claims(e: Evidence) -> list[Claim]:
    given = {(r.controller, r.freq_hz): r for r in e.runs if r.mirror == Variant.GIVEN}
    claims = []
    for f, claimed in paper.CLAIMED_DROP_RAD.items():
        if (PID_WITH_INVERSE, f) not in given or (PID, f) not in given:
            continue
        before_run, after_run = given[PID, f], given[PID_WITH_INVERSE, f]
        before, after = before_run.trace, after_run.trace
        drop = before.peak_rad - after.peak_rad
        ours = (
            f"{drop * 1e6:.1f} µrad: peak {before.peak_rad * 1e6:.1f} → {after.peak_rad * 1e6:.1f} µrad, "
            f"rms {before.rms_rad * 1e6:.1f} → {after.rms_rad * 1e6:.1f} µrad"
        )
        judged = not before_run.at_limits and not after_run.at_limits
        agrees = _agrees(abs(drop - claimed) <= paper.DROP_TOLERANCE * claimed, judged)
        why = f"within {100 * paper.DROP_TOLERANCE:.0f} %, at gains of ours: the paper prints none"
        claims.append(
            Claim("Fig. 8", f"the inverse takes about {claimed * 1e6:g} µrad off at {f:g} Hz", ours, agrees, why)
        )
    return claims


def _together_claim(scan: paper.Scan) -> Claim:
    names, points = scan.together()
    missing = [n for n in paper.CLAIMS if n not in names]
    held = f"{len(names)} of {len(paper.CLAIMS)} claims"
    ours = f"{held} hold together at {len(points)} of {len(scan.points)} scanned points"
    regions = "; ".join(filter(None, (_region(c, points) for c in paper.COMPOSITIONS)))
    why = ". ".join(filter(None, (regions, f"Nowhere together with these: {'; '.join(missing)}" if missing else "")))
    return Claim("section 3.1, Fig. 6 and 8", "all closed-loop claims at once", ours, "no" if missing else "yes", why)


def _region(composition: str, points: tuple[paper.Point, ...]) -> str:
    here = [p for p in points if p.composition == composition]
    if not here:
        return ""
    kp = sorted({p.proportional_v_rad * 1e-3 for p in here})
    ki = sorted({p.integral_v_rad_s * 1e-3 for p in here})

    def span(values: list[float]) -> str:
        return f"{values[0]:g}" if len(values) == 1 else f"{values[0]:g} to {values[-1]:g}"

    return f"{composition}: Kp {span(kp)} V/mrad, Ki {span(ki)} V/(mrad s)"
