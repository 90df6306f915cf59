"""The budgets of the links as text for a terminal and as CSV."""

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import replace

from microrad.core.budget import Line
from microrad.link.compliance import Compliance
from microrad.link.requirement import of_links
from microrad.link.study import LinkStudy, Solution
from microrad.mission.model import source_text
from microrad.orbit.operations import spreadsheet_text
from microrad.report.links import words
from microrad.report.links.standard import short_view, standard_rows, standard_view
from microrad.report.links.views import budget_table, links_views
from microrad.report.marks import marked
from microrad.report.requirements import first_warning, requirement_table
from microrad.report.view import Block, Soft, views_text

UNDER_JITTER = "Communication under jitter"
"""The lines of what the jitter does to the communication link, beside its budget."""
UNDER_FADES = "Communication under fades"
"""The lines of what a series of received power does to the communication link."""
SOLVED = "Solved"
"""The values of a key that leave the required margin, ahead of the budgets."""
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
    table = "communication.coupling.jitter" if study.data.jitter is None else "jitter"
    source = source_text(study.file.sources, f"{table}.bias", f"{table}.rms", "requirement.outage")
    regime, known = "Gaussian errors about the bias, two axes", math.isfinite(p.uncoded_penalty_db)
    back = "power that brings the mean bit error ratio back to its target"
    rows = [
        ("Mean pointing loss", 0.0 - p.mean_loss_db, "dB", "what a code pays whose interleaver spans many fades"),
        ("Penalty without a code", 0.0 - p.uncoded_penalty_db, "dB", f"{back}, Gaussian beam"),
        ("Outage", p.outage, "", "share of the time with a margin below 0 dB"),
        ("Below required margin", p.short, "", "share of the time"),
    ]
    found = [Line(*row, source, regime) for row in rows if math.isfinite(row[1])]
    doubt = "" if known else f"the penalty without a code is {words.uncoded(p)}"
    return [replace(found[0], warning=doubt), *found[1:]]


def fading_lines(study: LinkStudy) -> list[Line]:
    """What a series of received power does to the coded link, beside its budget."""
    f = study.fading
    if f is None:
        return []
    source = source_text(study.file.sources, "communication.fading.series")
    regime = "BPSK, soft decisions, known channel"
    rows = [
        ("Mean bit error ratio", f.ratio.value, "", f"{f.code} over {f.source}"),
        ("Windows above the target", f.lost.value, "", "share of the windows"),
        (
            "Penalty of the fades",
            0.0 - f.penalty_db,
            "dB",
            "power that brings the mean bit error ratio back to its target",
        ),
        ("Margin under the fades", f.margin_left_db, "dB", "static margin less the penalty"),
    ]
    return [Line(*row, source, regime) for row in rows if math.isfinite(row[1])]


def links_csv(study: LinkStudy, solution: Solution | None = None, against: Compliance | None = None) -> str:
    """Every line with its value in full, for a spreadsheet, behind the values of a key that were solved for.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        solution: the values of a key that leave the required margin, if one was solved for.
        against: a standard with what the links have of it, which stands last.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for solved in [] if solution is None else _solution_rows(solution):
        writer.writerow([SOLVED, *solved, "", "", ""])
    jitter = [(UNDER_JITTER, line) for line in jitter_lines(study)]
    fades = [(UNDER_FADES, line) for line in fading_lines(study)]
    for name, line in (*lines(study), *jitter, *fades):
        value = repr(float(line.value))  # every digit, as JSON has it
        texts = map(spreadsheet_text, (line.basis, line.source, line.regime, line.warning))
        writer.writerow([name, spreadsheet_text(line.name), value, line.unit, *texts])
    for name, subject, value, unit, *rest in [] if against is None else standard_rows(against):
        writer.writerow([name, subject, value, unit, *map(spreadsheet_text, rest)])
    return buffer.getvalue().rstrip("\n")


def links_text(
    study: LinkStudy,
    width: int,
    verbose: bool = False,
    solution: Solution | None = None,
    against: Compliance | None = None,
) -> str:
    """The verdict with a line for each requirement, what limits it, and the budgets, for a terminal.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        width: columns of the terminal.
        verbose: adds where each line comes from and holds, the other tables, every sentence and every warning.
        solution: the values of a key that leave the required margin, which stand first.
        against: a standard with what the links have of it, which stands last.
    """
    below = (
        [*words.consequences(study), first_warning(study.warnings)] if verbose else []
    )  # said there, with the others
    limits = [sentence for sentence in words.short(study) if sentence not in below]
    blocks: list[Block] = [] if solution is None else [Soft(words.solution_text(solution))]
    blocks += [words.verdict(study), requirement_table(of_links(study)), *limits]
    if verbose:
        blocks += links_views(study)
    else:
        blocks += [budget_table(b).columns((0, 1, 2)) for b in study.budgets]
    if against is not None:
        blocks.append(standard_view(against) if verbose else short_view(against))
    return views_text(marked(blocks, study.file.sources), width)


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
