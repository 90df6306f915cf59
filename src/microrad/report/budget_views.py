"""The budgets of a mission's links: as a table in a terminal, as CSV, as plain data, and as a page."""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

from microrad import link
from microrad.core.budget import Line
from microrad.core.units import format_input
from microrad.link import Swing
from microrad.link.acquisition.partner_search import Finding, Found, Tracking
from microrad.link.pointing import OpenLoopPointing
from microrad.link.pointing.outage import Performance, error_rad, required_error_rad
from microrad.link.requirement import met, of_links, outage_words
from microrad.link.study import BeamRadius, LinkStudy, Solution
from microrad.mission.model import source_text
from microrad.orbit.operations import spreadsheet_text
from microrad.report import advice, requirements
from microrad.report.quantities import quantity, signed
from microrad.report.tables import Table, table_text, tables_text

UNDER_JITTER = "Communication under jitter"
"""The lines of what the jitter does to the communication link, beside its budget."""
SOLVED = "Solved"
"""The values of a key that leave the required margin, ahead of the budgets."""
_ROOM = 120  # columns for a table of all that a line has
_WORTH_DB = 0.5  # of a margin: what another radius of the beam would have to bring
COLUMNS = ("budget", "line", "value", "unit", "basis", "source", "holds for", "warning")


def lines(study: LinkStudy) -> list[tuple[str, Line]]:
    """Every line of every budget with the name of its budget, totals included, in the order of the page."""
    found = [(b.name, line) for b in study.budgets for line in (*b.lines, *b.totals)]
    found += [("Communication receiver", line) for line in study.receiver_noise]
    if study.open_loop is not None:
        found += [("Open-loop pointing", line) for line in study.open_loop.lines]
    if study.tracking is not None:
        found += [("Tracking sensor", line) for line in study.tracking.noise_lines]
        if study.tracking.noise_equivalent_angle is not None:
            found.append(("Tracking sensor", study.tracking.noise_equivalent_angle))
    return found


def jitter_lines(study: LinkStudy) -> list[Line]:
    """What stands in no budget of the link under its jitter: costs with and without a code, shares of the time."""
    p = study.under_jitter
    if p is None:
        return []
    source = source_text(study.file.sources, "jitter.bias", "jitter.rms", "requirement.outage")
    regime, known = "Gaussian errors about the bias, two axes", math.isfinite(p.uncoded_penalty_db)
    back = "power that brings the mean bit error ratio back to its target"
    rows = [
        ("Mean pointing loss", 0.0 - p.mean_loss_db, "dB", "what a code pays whose interleaver spans many fades"),
        ("Penalty without a code", 0.0 - p.uncoded_penalty_db, "dB", f"{back}, Gaussian beam"),
        ("Outage", p.outage, "", "share of the time with a margin below 0 dB"),
        ("Below required margin", p.short, "", "share of the time"),
    ]
    found = [Line(*row, source, regime) for row in rows if math.isfinite(row[1])]
    doubt = "" if known else f"the penalty without a code is {_uncoded(p)}"
    return [replace(found[0], warning=doubt), *found[1:]]


def csv_text(study: LinkStudy, solution: Solution | None = None) -> str:
    """Every line with its value in full, for a spreadsheet; first the values that were solved for."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for solved in [] if solution is None else _solution_rows(solution):
        writer.writerow([SOLVED, *solved, "", "", ""])
    jitter = [(UNDER_JITTER, line) for line in jitter_lines(study)]
    for name, line in (*lines(study), *jitter):
        value = repr(float(line.value))  # every digit, as JSON has it
        texts = map(spreadsheet_text, (line.basis, line.source, line.regime, line.warning))
        writer.writerow([name, spreadsheet_text(line.name), value, line.unit, *texts])
    return buffer.getvalue().rstrip("\n")


def text(study: LinkStudy, width: int, verbose: bool = False, solution: Solution | None = None) -> str:
    """The verdict with a line for each requirement, what limits it, and the budgets, in at most ``width`` columns.

    ``verbose`` adds to the lines where they come from and hold, the other tables, every sentence and every warning.
    The values that were solved for stand first.
    """
    judged = of_links(study)
    blocks = [] if solution is None else [tables_text([], [solution_text(solution)], width)]
    blocks += [tables_text([], [verdict(study)], width), table_text(requirements.table(judged), width)]
    if not verbose:
        tables = [Table(b.name, ("line", "value", "basis"), _brief(b), (2,)) for b in study.budgets]
        return "\n\n".join((*blocks, tables_text([], short(study), width), tables_text(tables, [], width)))
    said = [*short(study), *sentences(study)[1:]]
    blocks += [_tables(study, width), tables_text([], list(dict.fromkeys(said)), width)]
    if study.warnings:
        blocks.append(tables_text([], ["Warnings (! in the tables)", *(f"- {w}" for w in study.warnings)], width))
    return "\n\n".join(blocks)


def short(study: LinkStudy) -> list[str]:
    """What limits the links and what to do about it, in six sentences at most."""
    m, found = study.file.mission, of_links(study)
    at = f"at {quantity(m.communication.pointing_error_rad, 'rad')} of pointing error"
    if m.jitter is not None:
        error = quantity(error_rad(study.data), "rad")
        at = f"but for {outage_words(m.requirement)} under the jitter, an error of {error}"
    said = [f"The margin is received over required power, for communication {at}.", *consequences(study)[:2]]
    r = requirements.nearest(found)
    which = "Nearest to its limit is" if r.met else "What limits it is"
    said.append(f"{which} the {r.name}, by {r.because}{advice.of_links(study, r)}.")
    said.append(requirements.derived_words(found))
    said.append(requirements.warned(study.warnings))
    return list(filter(None, said))


def _brief(budget: link.LinkBudget) -> list[tuple[str, ...]]:
    found = (*budget.lines, *budget.totals)
    return [(line.name + _mark(line), quantity(line.value, line.unit), line.basis) for line in found]


def _mark(line: Line) -> str:
    return " !" if line.warning else ""


def _tables(study: LinkStudy, width: int) -> str:
    """Every table with basis, source and where each line holds: in columns, or below each other in a narrow one."""
    headings = ("line", "value", "basis", "source", "holds for")
    groups: dict[str, list[tuple[str, ...]]] = {}
    for name, line in lines(study):
        texts = line.name + _mark(line), quantity(line.value, line.unit), line.basis, line.source, line.regime
        groups.setdefault(name, []).append(texts)
    if width >= _ROOM:
        return tables_text([Table(name, headings, rows, (0, 2, 3, 4)) for name, rows in groups.items()], [], width)
    tables = [Table(name, headings[:3], [_stacked(row) for row in rows], (2,)) for name, rows in groups.items()]
    return tables_text(tables, [], width)


def _stacked(row: tuple[str, ...]) -> tuple[str, ...]:
    """Basis, source and where it holds, one below the other."""
    name, value, basis, source, regime = row
    return name, value, f"{basis}\nfrom: {source}\nholds for: {regime}"


def sentences(study: LinkStudy) -> list[str]:
    """What follows from the budgets, a sentence each."""
    found = [verdict(study), *consequences(study)]
    if study.open_loop is not None:
        found += pointing_sentences(study.open_loop)
    if study.under_jitter is not None:
        found.append(performance(study.under_jitter, study))
    if study.finding is not None:
        found += acquisition(study.finding)
    return found


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
    by = "each input by 10 % (0.5 dB; a bit error ratio or an outage by a factor of ten) both ways"
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
        found.append(point_ahead(study))
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


def verdict(study: LinkStudy) -> str:
    """Whether the links close and have what is required of them. "The links close" stands above no FAIL."""
    margins = ", ".join(f"{b.name.lower()} {signed(b.margin_db, 'dB')}" for b in study.budgets)
    failed = [r for r in of_links(study) if not r.met]
    if not study.closes:
        return f"The links do not close: {margins}."
    if failed:
        return f"Not every requirement is met: {' and '.join(r.name for r in failed)}; {margins}."
    return f"The links close, and {requirements.met_words(of_links(study))}: {margins}."


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


def point_ahead(study: LinkStudy) -> str:
    """Point-ahead as an angle of the beam, a range of the mirror and a loss."""
    p = study.point_ahead
    assert p is not None
    state = "corrected here" if p.corrected else "NOT corrected here"
    lost = f"{p.loss_db:.1f} dB" if p.loss_db <= link.DEEPEST_DB else f"more than {link.DEEPEST_DB:g} dB"
    return (
        f"Point-ahead: up to {quantity(p.angle_rad, 'rad')}, {p.beam_half_angles:.1f} half angles of the communication "
        f"beam; left out, it {'would cost' if p.corrected else 'costs'} {lost}; a mirror that makes it needs "
        f"{quantity(p.mirror_range_rad, 'rad')} of range at the line of sight; {state}."
    )


def pointing_sentences(p: OpenLoopPointing) -> list[str]:
    """The totals of the pointing budget side by side, and what the beacon covers."""
    sums = "; ".join(f"{each.name} {quantity(each.total_rad, 'rad')}" for each in p.summations)
    found = [f"Open-loop pointing at {100 * p.confidence:g} %: {sums}."]
    if p.reading is not None:
        found.append(
            f"The beacon's cone of {quantity(p.reading.half_angle_rad, 'rad')} half angle at 1/e2 covers its partner "
            f"with a probability of {p.reading.coverage:.4g}."
        )
    return found


def performance(p: Performance, study: LinkStudy) -> str:
    """The link under its jitter, in two sentences."""
    narrowest = ", the narrowest of the aperture" if p.best.at_limit else ""
    return (
        f"Under the jitter: mean pointing loss {p.mean_loss_db:.2f} dB; {p.outage_loss_db:.2f} dB but for "
        f"{outage_words(study.data.requirement)}, which leaves a margin of {signed(p.margin_db, 'dB')}; below 0 dB "
        f"for a share of {quantity(p.outage, '')} of the time; best half angle "
        f"{quantity(p.best.half_angle_rad, 'rad')}{narrowest}. "
        f"Power that it costs: with a code {p.mean_loss_db:.2f} dB where its interleaver spans many fades, "
        f"{p.outage_loss_db:.2f} dB where it spans none; without a code {_uncoded(p)}."
    )


def without_code(p: Performance) -> str:
    """The penalty without a code in decibels, as it stands in a cell."""
    if math.isnan(p.uncoded_penalty_db):
        return "unknown"
    return "beyond any power" if math.isinf(p.uncoded_penalty_db) else f"{p.uncoded_penalty_db:.2f}"


def _uncoded(p: Performance) -> str:
    if math.isnan(p.uncoded_penalty_db):
        return "unknown, as the receiver is given by its sensitivity alone"
    return without_code(p) + (" dB" if math.isfinite(p.uncoded_penalty_db) else "")


def acquisition(f: Finding) -> list[str]:
    """Time and probability of each way to find the partner."""
    return [_lock(w) for w in f.ways]


def _lock(w: Found) -> str:
    if not w.possible:
        return f"Acquisition by {w.name}: never (simulated {w.simulated_probability:.4f})."
    return (
        f"Acquisition by {w.name}: lock with a probability of {w.outcome.success_probability:.4f} "
        f"(simulated {w.simulated_probability:.4f}), {quantity(w.outcome.mean_time_s, 's')} in the mean "
        f"(simulated {simulated_mean(w)})."
    )


def simulated_mean(w: Found) -> str:
    """Mean time of the simulated acquisitions that end in lock; there may be none."""
    return "none locks" if math.isnan(w.simulated_mean_s) else quantity(w.simulated_mean_s, "s")


def data(study: LinkStudy, solution: Solution | None = None) -> dict[str, Any]:
    """The verdict on the links, their budgets and what follows from them as plain data, SI units in the keys."""
    judged = [requirements.data(r) for r in of_links(study)]
    solved = {} if solution is None else {"solved": _solution_data(solution)}
    return {"closes": study.closes, "met": met(study), "requirements": judged, **solved, **facts(study)}


def _solution_data(s: Solution) -> dict[str, Any]:
    ends = [[None if i.low_open else i.low, None if i.high_open else i.high] for i in s.solved.intervals]
    best = {"value": s.solved.best, "margin_db": s.solved.best_db}
    found = {"key": s.key, "unit": s.unit, "of": s.of, "required_db": s.required_db}
    return {**found, "intervals": ends, "searched": list(s.solved.searched), "value": s.value, "best": best}


def _solution_rows(s: Solution) -> Iterator[tuple[str, str, str, str]]:
    """Name, value in full, unit and basis of what was solved for."""
    leaves = f"leaves the required {s.required_db:g} dB of {s.of}"
    for each in s.solved.intervals:
        for name, value, is_open in (("from", each.low, each.low_open), ("to", each.high, each.high_open)):
            yield f"{s.key} {name}", repr(value), s.unit, leaves + (", as far as was looked" if is_open else "")
    for name, value in zip(("from", "to"), s.solved.searched, strict=True):
        yield f"{s.key} looked at {name}", repr(value), s.unit, ""
    yield f"{s.key} with the largest margin", repr(s.solved.best), s.unit, ""
    yield "Largest margin", repr(float(s.solved.best_db)), "dB", ""
    yield f"{s.key} in the budgets below", repr(s.value), s.unit, ""


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


def facts(study: LinkStudy) -> dict[str, Any]:
    """The budgets and what follows from them as plain data, without a verdict of their own."""
    return {
        "mission": study.file.mission.name,
        "mission_sha256": study.file.sha256,
        "budgets": [
            {
                "name": b.name,
                "margin_db": b.margin_db,
                "received_power_w": b.received_power_w,
                "required_power_w": b.required_power_w,
                "received_photons_per_bit": b.received_photons_per_bit,
                "irradiance_w_m2": b.irradiance_w_m2,
                "irradiance_on_axis_w_m2": b.irradiance_on_axis_w_m2,
                "radiant_intensity_w_sr": b.radiant_intensity_w_sr,
                "required_irradiance_w_m2": b.required_irradiance_w_m2,
                "lines": [line_data(line) for line in b.lines],
                "totals": [line_data(line) for line in b.totals],
                "warnings": list(b.warnings),
            }
            for b in study.budgets
        ],
        "largest_data_rate_bit_s": study.largest_rate_bit_s,
        "tornado": [_swing_data(s) for s in study.tornados[0].swings],
        "other_tornados": [
            {"of": t.of, "margin_db": t.margin_db, "tornado": [_swing_data(s) for s in t.swings]}
            for t in study.tornados[1:]
        ],
        "pointing": None if study.open_loop is None else _open_loop(study.open_loop),
        "point_ahead": None if study.point_ahead is None else asdict(study.point_ahead),
        "receiver_noise": [line_data(line) for line in study.receiver_noise],
        "tracking": None if study.tracking is None else _tracking(study),
        "acquisition": None if study.finding is None else finding_data(study.finding),
        "under_jitter": None if study.under_jitter is None else performance_data(study.under_jitter),
        "warnings": list(study.warnings),
    }


def _open_loop(p: OpenLoopPointing) -> dict[str, Any]:
    return {
        "lines": [line_data(line) for line in p.lines],
        "confidence": p.confidence,
        "totals": [
            {"rule": s.rule, "of": s.of, "total_rad": s.total_rad, "authority": s.authority, "caveat": s.caveat}
            for s in p.summations
        ],
        "beacon_coverage": None if p.reading is None else p.reading.coverage,
        "left_for_each": _left(p),
    }


def _swing_data(s: Swing) -> dict[str, Any]:
    return {
        "input": s.key,
        "unit": s.unit,
        "value": s.value,
        "low": s.low,
        "high": s.high,
        "margin_low_db": s.margin_low_db,
        "margin_high_db": s.margin_high_db,
        "source": s.source,
    }


def _left(p: OpenLoopPointing) -> list[dict[str, Any]]:
    """What the beacon's half angle leaves for each line, by root sum square."""
    if p.reading is None:
        return []
    allocated = p.allocation(p.reading.half_angle_rad, "rss")
    return [{"name": each.name, "largest_rad": each.largest_rad, "missing_rad": each.missing_rad} for each in allocated]


def line_data(line: Line) -> dict[str, Any]:
    """A line as plain data."""
    return {
        "name": line.name,
        "value": line.value,
        "unit": line.unit,
        "basis": line.basis,
        "source": line.source,
        "holds_for": line.regime,
        "warning": line.warning,
    }


def _tracking(study: LinkStudy) -> dict[str, Any]:
    t = study.tracking
    assert t is not None
    return {
        "power_w": t.power_w,
        "signal_to_noise": t.signal_to_noise,
        "noise_equivalent_angle_rad": None if t.noise_equivalent_angle is None else t.noise_equivalent_angle.value,
        "lines": [line_data(line) for line in t.noise_lines],
    }


def performance_data(p: Performance) -> dict[str, Any]:
    """The link under one distribution of pointing errors as plain data."""
    return {
        "source": p.source,
        "controller": p.controller,
        "mirror": p.mirror,
        "bias_rad": list(p.jitter.bias_rad),
        "rms_rad": list(p.jitter.rms_rad),
        "mean_loss_db": p.mean_loss_db,
        "outage_loss_db": p.outage_loss_db,
        "margin_db": p.margin_db,
        "outage": p.outage,
        "below_required_margin": p.short,
        "data_rate_bit_s": p.data_rate_bit_s,
        "best_half_angle_rad": p.best.half_angle_rad,
        "wanted_half_angle_rad": p.best.wanted_half_angle_rad,
        "lost_against_best_db": p.best.current_excess_db,
        "coded_penalty_many_fades_db": p.mean_loss_db,
        "coded_penalty_no_interleaver_db": p.outage_loss_db,
        "uncoded_penalty_db": p.uncoded_penalty_db,
        "fades_per_s": p.fades_per_s,
        "mean_fade_s": p.fade_s,
    }


def finding_data(f: Finding) -> dict[str, Any]:
    """Acquisition as plain data; what never locks has no times."""
    s = f.scanned
    return {
        "uncertainty_per_axis_rad": f.sigma_rad,
        "beacon_coverage": f.chances.beacon_coverage,
        "answer_coverage": f.chances.answer_coverage,
        "answer_detection": f.chances.answer_detection,
        "return_coverage": f.chances.return_coverage,
        "scan_s": None if s is None or not s.detects else s.duration_s,
        "scan_radius_rad": None if s is None else s.radius_rad,
        "scan_half_angle_rad": None if s is None else s.half_angle_rad,
        "scan_stated_detection_s": None if s is None else s.stated_detection_s,
        "scan_needed_detection_s": None if s is None or not s.detects else s.needed_detection_s,
        "ways": [
            {
                "name": w.name,
                "success_probability": w.outcome.success_probability,
                "mean_time_s": w.outcome.mean_time_s if w.possible else None,
                "simulated_success_probability": w.simulated_probability,
                "simulated_mean_time_s": w.simulated_mean_s if w.simulated.locked.any() else None,
                "runs": int(w.simulated.locked.size),
                "stages": [
                    {"name": each.name, "longest_s": each.longest_s, "success_probability": each.success_probability}
                    for each in w.stages
                ],
            }
            for w in f.ways
        ],
    }
