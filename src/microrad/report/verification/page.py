"""A verification as views, as a page, as plain data and as text for a terminal."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from markupsafe import Markup

from microrad.core.machine import machine, versions
from microrad.core.units import format_quantity
from microrad.report.data import finite
from microrad.report.foundation import error_text
from microrad.report.page.templates import page_of
from microrad.report.quantities import counted, minus, percent
from microrad.report.registry import Status
from microrad.report.tables import Cell, Table
from microrad.report.verification.check import Outcome
from microrad.report.verification.checks.measured import SHA256
from microrad.report.verification.credibility import CAPABILITY, RESULTS, SCALE_FROM, STANDARD
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.findings import Verification
from microrad.report.verification.standard import STANDS, TEXTS, assumptions, requirements, uncertainties
from microrad.report.verification.warned import OCCURRENCES, warnings
from microrad.report.view import Block, Points, Soft, Verdict, View, views_text

PURPOSE = (
    "microrad designs, identifies and simulates the pointing chain of a small-satellite laser terminal: from the"
    " hysteresis of a fast steering mirror to the data that arrives in a day."
)
USES = (
    "Design and trade of links, beams, sensors, mirrors and controllers.",
    "Planning of tests, and identification of a mirror from its recordings.",
    "Estimates of contacts, volumes and latencies before a mission flies.",
)
LIMITS = (
    "It is no means of acceptance: no verdict of it replaces a measurement of the terminal.",
    "It is not meant for decisions during operations, nor for eye safety or the safety of people.",
    "Links are closed forms between two terminals in space. Turbulence, clouds and multipath are not in it.",
    "Mirrors are a linear part with hysteresis operators around it. Temperature and ageing are not in it.",
    "Orbits are two-body with the mean effects of the Earth's flattening, SGP4 or a given ephemeris.",
)
DECIDES = (
    "Nobody has accepted this installation for a use, and this report does not.",
    "How critical a decision is, which criteria its results have to meet, and whether their risks are accepted, is for"
    " the owner of the decision, with the technical authority of the programme.",
)
MEANINGS = {
    Status.VALIDATED: "compared with a measurement, within its tolerance",
    Status.VERIFIED: "compared with an independent method or another's published output, within its tolerance",
    Status.TRACED: "defined by a named source; not compared here",
    Status.NONE: "neither compared nor sourced",
    Status.FAILED: "a comparison is beyond its tolerance",
}
_EXTENTS = {
    "drive": "amplitude of the drive",
    "frequency": "excited frequencies",
    "rate": "sample rate",
    "position": "span of the position",
}
RISKS = (
    "A quantity that is only verified is computed as it was meant to be. Whether nature agrees is open, and a design"
    " may miss its margin in flight. Nothing here bounds by how much.",
    "Comparisons hold within the swept domains, of parts that have one, and at the shipped mission's values of all"
    " others. Figures beyond are extrapolated.",
    "Those who wrote the models chose the checks, too. An error that both share is not found.",
)


def headline(v: Verification) -> str:
    """The outcome in a sentence."""
    compared = sum(len(o.comparisons) for o in v.outcomes)
    missed = sum(not c.holds for o in v.outcomes for c in o.comparisons)
    broken = [o.check.name for o in v.outcomes if o.trouble]
    if missed or broken:
        found = f"{missed} of {compared} comparisons are beyond their tolerance" if missed else ""
        ran = f"{counted(len(broken), 'check')} did not run ({', '.join(broken)})" if broken else ""
        return f"This installation does not hold: {' and '.join(filter(None, (found, ran)))}."
    where = " in this installation" if v.integrity.whole else ", but this is not the recorded installation"
    absent = sum(bool(o.absent) for o in v.outcomes)
    made = " that were made" if absent else ""
    left = f"; {absent} check{'s were' if absent > 1 else ' was'} not run" if absent else ""
    return f"All {compared} comparisons{made} hold{where}{left}."


def summary(v: Verification) -> list[str]:
    """What the headline leaves out, in sentences."""
    counts = v.counts
    absent = [o for o in v.outcomes if o.absent]
    said = [
        f"{len(v.standings)} printed quantities are registered: "
        + ", ".join(f"{counts[s]} {s.value}" for s in Status if counts[s] or s is not Status.FAILED)
        + f". {percent(v.founded)} are verified or better.",
        f"{len(v.named)} named comparisons are with measurements or with what others have published.",
        v.integrity.text,
    ]
    return said + [f"Not run: {o.check.name}. {o.absent[:1].upper()}{o.absent[1:]}." for o in absent]


def views(v: Verification) -> list[View]:
    """All parts of the report."""
    return [
        View(SECTIONS["purpose"], _purpose(), "purpose"),
        View(SECTIONS["warnings"], _warnings(v), "warnings"),
        View(SECTIONS["standard"], _standard(), "standard"),
        View(SECTIONS["assumptions"], [_assumptions()], "assumptions"),
        View(SECTIONS["quantities"], [_statuses(v), *_by_subject(v)], "quantities"),
        View(SECTIONS["measurements"], [_evidence(v, measured=True)], "measurements"),
        View(SECTIONS["methods"], [_evidence(v, measured=False)], "methods"),
        View(SECTIONS["evidence"], [_comparisons(o) for o in v.outcomes], "evidence"),
        View(SECTIONS["domains"], _domains(v), "domains"),
        View(SECTIONS["uncertainty"], [_uncertainty()], "uncertainty"),
        View(SECTIONS["credibility"], _credibility(v), "credibility"),
        View(SECTIONS["risks"], [Points(_known(v)), Points(RISKS)], "risks"),
        View(SECTIONS["installation"], [v.integrity.text, *_installation(v)], "installation"),
    ]


def _purpose() -> list[Block]:
    return [
        PURPOSE,
        View("Permissible uses", [Points(USES)], listed=False),
        View("Limits", [Points(LIMITS)], listed=False),
        View("Who decides", [Points(DECIDES)], listed=False),
    ]


def _warnings(v: Verification) -> list[Block]:
    """The occurrences that the standard wants said, in its order; those that are not there, too."""
    rows = [(w.letter, OCCURRENCES[w.letter], w.found, w.impact) for w in warnings(v)]
    about = Soft("By NASA-STD-7009B, M&S 32. Those of a mission stand in its own report.")
    return [Table("", ("", "occurrence", "found", "impact"), rows, (0, 1, 2, 3), cards=True), about]


SECTIONS = {
    "purpose": "Intended use and limits",
    "warnings": "Warnings",
    "standard": "What the standard asks, and where it stands",
    "assumptions": "Assumptions",
    "quantities": "Quantities",
    "measurements": "Measurements and published output",
    "methods": "Independent methods",
    "evidence": "Evidence, figure by figure",
    "domains": "Domains",
    "uncertainty": "Uncertainty of the results",
    "credibility": "Credibility",
    "risks": "Known defects and risks",
    "installation": "This installation",
}


def _standard() -> list[Block]:
    rows = []
    for r in requirements():
        places = [SECTIONS[name] for name in r.sections] + [f"docs/{page}.md" for page in r.pages]
        places += [f"mission's report: {r.part}"] if r.part else []
        where = "; ".join(places)
        mark = "!" if r.stands == "open" else ""
        said = ". ".join(filter(None, (where, r.said)))
        rows.append((r.number, r.title, Cell(STANDS[r.stands], mark), said, TEXTS[r.text]))
    counts = Counter(r.stands for r in requirements() for _ in r.numbers)
    own = sum(counts[s] for s in STANDS if s != "gone")
    stand = ", ".join(f"{counts[s]} {said}" for s, said in STANDS.items() if s != "gone")
    about = Soft(
        "Requirements of NASA-STD-7009B by number, titles in own words. The standard itself was not at hand: the last"
        " column says what a title is founded on. This is no statement of compliance."
    )
    headings = ("M&S", "what is asked", "stands", "where", "title by")
    return [f"Of {own} requirements: {stand}.", Table("", headings, rows, (0, 1, 2, 3, 4), cards=True), about]


def _assumptions() -> Table:
    rows = [(a.part, a.assumed, a.because, a.otherwise) for a in assumptions()]
    return Table("", ("part", "assumed", "because", "where it does not hold"), rows, (0, 1, 2, 3), cards=True)


def _uncertainty() -> Table:
    rows = [(u.subject, u.kind, u.estimate, u.how) for u in uncertainties()]
    return Table("", ("quantities", "kind", "estimate", "how it is obtained"), rows, (0, 1, 2, 3), cards=True)


def _statuses(v: Verification) -> Table:
    rows = [(s.value, str(v.counts[s]), MEANINGS[s]) for s in Status]
    return Table("", ("status", "quantities", "what it means"), rows, (0, 2))


def _by_subject(v: Verification) -> list[View]:
    found: dict[str, list[tuple[str | Cell, ...]]] = {}
    for each in v.standings:
        mark = "FAIL" if each.status is Status.FAILED else ""
        row = (each.quantity.title, Cell(each.status.value, mark), ", ".join(each.checks), each.quantity.source)
        found.setdefault(each.quantity.subject, []).append(row)
    headings = ("quantity", "status", "evidence", "defined by")
    return [
        View(name, [Table("", headings, rows, (0, 1, 2, 3), cards=True)], listed=False) for name, rows in found.items()
    ]


def _evidence(v: Verification, *, measured: bool) -> Table:
    rows = []
    for o in v.outcomes:
        if (o.check.referent is not Referent.INDEPENDENT) is measured:
            count = len(o.comparisons)
            held = Cell(f"{sum(c.holds for c in o.comparisons)} of {count}", "PASS" if o.holds else "FAIL")
            shown = Cell("not run") if o.absent else held
            rows.append((o.check.name, o.check.title, o.check.referent.value, shown, o.check.method, o.check.source))
    headings = ("name", "what is compared", "with", "hold", "how", "source")
    return Table("", headings, rows, (0, 1, 2, 3, 4, 5), cards=True)


def _comparisons(o: Outcome) -> View:
    """One check: what was expected and what was obtained."""
    rows = [
        (c.what, _number(c.expected), Cell(_number(c.obtained), "PASS" if c.holds else "FAIL"), *_tolerance(c))
        for c in o.comparisons
    ]
    headings = ("figure", "expected", "obtained", "within", "since", "unit")
    said = o.trouble or o.absent
    blocks: list[Block] = [f"{o.check.title}. {said}" if said else f"{o.check.title}."]
    if rows:
        blocks.append(Table("", headings, rows, (0, 4, 5)))
    return View(f"Evidence: {o.check.name}", blocks, folded=True, listed=False)


def _number(value: float) -> str:
    return minus(f"{value:.6g}")


def _tolerance(c: Comparison) -> tuple[str, str, str]:
    return _number(float(f"{c.tolerance:.2g}")), c.basis, c.unit


def _domains(v: Verification) -> list[Block]:
    """Between which values of its inputs each part of the chain was held against the independent methods."""
    about = (
        "Missions were drawn around the shipped one, all inputs of a part changed at once. A domain ends before the"
        " first draw for which a check of the part does not hold. The draws are a sample: not every combination between"
        " the limits was tried. A mission's report names each input that is outside."
    )
    of = "in this run" if v.full else "at the release; microrad verify --full sweeps them here"
    found: list[Block] = [f"{about} Swept {of}."]
    for part, domain in v.domains.items():
        rows = [
            (Cell(key, code=True), format_quantity(e["least"], e["unit"], 3), format_quantity(e["most"], e["unit"], 3))
            for key, e in domain["extents"].items()
        ]
        said = f"{domain['inside']} of {domain['draws']} missions; all of {', '.join(domain['checks'])} held."
        found.append(View(part, [said, Table("", ("input", "from", "to"), rows, (0,), cards=True)], listed=False))
    unvalidated = "Links, loops and days have no domain of validation: none was compared with one that flew."
    return [*found, *map(_measured, v.recordings.values()), unvalidated]


def _measured(record: Mapping[str, Any]) -> View:
    """Between which values the recordings lie on which the error of a mirror model was measured."""
    rows = [
        (_EXTENTS[name], format_quantity(e["least"], e["unit"], 3), format_quantity(e["most"], e["unit"], 3))
        for name, e in record["extents"].items()
    ]
    errors = [f"{e['what']}: {error_text(e)}." for e in record["errors"]]
    of = f"{record['inputs']} drive{'s' if record['inputs'] > 1 else ''}, {record['outputs']} outputs"
    said = (
        f"Validated, on records that were held out of {', '.join(record['records'])}: {of.removesuffix('s')}"
        f"{'s' if record['outputs'] > 1 else ''}. A frequency is excited where the spectrum of the drive has at least"
        " a tenth of its largest line."
    )
    blocks: list[Block] = [said, Table("", ("measured", "from", "to"), rows, (0,), cards=True), Points(errors)]
    return View(f"Measured: {record['part']}", blocks, listed=False)


def _credibility(v: Verification) -> list[Block]:
    about = Soft(
        f"By {STANDARD}. Each factor has a level from 0, no sufficient evidence, to 4, and none in part. The standard"
        " asks that they are never combined into one. All levels are judged by the developers themselves, and nobody"
        " has required any. Those of results are of the shipped mission and its report; another use has to be judged"
        f" anew. {SCALE_FROM}"
    )
    tables = []
    for name in (CAPABILITY, RESULTS):
        rows = [
            (f.name, f"{f.level}: {f.means}", f.reason, f"{f.next_needs} By the scale: {f.next_means}.")
            for f in v.factors
            if f.assessment == name
        ]
        headings = ("factor", "level, and what it means", "why", "what the next level needs")
        tables.append(Table(name, headings, rows, (0, 1, 2, 3), cards=True))
    return [about, *tables]


def _known(v: Verification) -> list[str]:
    """What is known not to hold, and what is not founded at all."""
    missed = [f"{o.check.name}: {o.trouble}" for o in v.outcomes if o.trouble]
    missed += [
        f"{o.check.name}: {c.what} is {_number(c.obtained)} where {_number(c.expected)} is expected."
        for o in v.outcomes
        for c in o.comparisons
        if not c.holds
    ]
    if v.bare:
        missed.append(f"Not founded: {', '.join(v.bare)}.")
    return missed or ["No comparison fails, and every quantity has at least a source."]


def _installation(v: Verification) -> list[Block]:
    rows = [(name, value) for name, value in {**versions(), **machine()}.items()]
    found: list[Block] = [Table("", ("part", "version or kind"), rows, (0, 1))]
    held = [(Cell(name, code=True), stands, Cell(SHA256[name][:12], code=True)) for name, stands in v.files.items()]
    if held:
        table = Table("", ("recording", "by its SHA-256", "of the release"), held, (0, 1, 2))
        found.append(View("Recordings", [table], listed=False))
    return found


def verification_page(v: Verification) -> str:
    """The report as one page that loads nothing."""
    of = Markup("this installation, microrad {}").format(versions()["microrad"])
    lead = [Verdict(headline(v), [Points(summary(v))], v.ok)]
    return page_of("Verification and validation", "verify", of, lead, views(v), sha256="", made_by="verify")


def verification_data(v: Verification) -> dict[str, Any]:
    """The report as plain data."""
    plain: dict[str, Any] = finite(
        {
            "ok": v.ok,
            "headline": headline(v),
            "summary": summary(v),
            "purpose": PURPOSE,
            "uses": list(USES),
            "limits": list(LIMITS),
            "decides": list(DECIDES),
            "warnings": [
                {"letter": w.letter, "occurrence": OCCURRENCES[w.letter], "found": w.found, "impact": w.impact}
                for w in warnings(v)
            ],
            "requirements": [{**asdict(r), "stands": STANDS[r.stands], "text": TEXTS[r.text]} for r in requirements()],
            "assumptions": [asdict(a) for a in assumptions()],
            "uncertainty": [asdict(u) for u in uncertainties()],
            "counts": {s.value: n for s, n in v.counts.items()},
            "verified_or_better": v.founded,
            "quantities": [
                {
                    "name": s.quantity.title,
                    "subject": s.quantity.subject,
                    "status": s.status.value,
                    "evidence": list(s.checks),
                    "source": s.quantity.source,
                }
                for s in v.standings
            ],
            "evidence": [_outcome_data(o) for o in v.outcomes],
            "credibility": [
                {
                    "assessment": f.assessment,
                    "name": f.name,
                    "level": f.level,
                    "means": f.means,
                    "why": f.reason,
                    "next": f.next_needs,
                    "next_means": f.next_means,
                }
                for f in v.factors
            ],
            "defects": _known(v),
            "risks": list(RISKS),
            "domains": v.domains,
            "recordings": v.recordings,
            "recording_files": {name: {"sha256": SHA256[name], "here": stands} for name, stands in v.files.items()},
            "files": {
                "against": v.integrity.against,
                "changed": list(v.integrity.changed),
                "missing": list(v.integrity.missing),
                "added": list(v.integrity.added),
                "versions": list(v.integrity.versions),
            },
            "versions": versions(),
            "machine": machine(),
            "full": v.full,
        }
    )
    return plain


def _outcome_data(o: Outcome) -> Mapping[str, Any]:
    return {
        "name": o.check.name,
        "title": o.check.title,
        "with": o.check.referent.value,
        "method": o.check.method,
        "source": o.check.source,
        "holds": o.holds,
        "trouble": o.trouble,
        "absent": o.absent,
        "comparisons": [
            {
                "quantity": c.quantity,
                "what": c.what,
                "expected": c.expected,
                "obtained": c.obtained,
                "tolerance": c.tolerance,
                "unit": c.unit,
                "since": c.basis,
                "holds": c.holds,
            }
            for c in o.comparisons
        ],
    }


def verification_text(v: Verification, width: int) -> str:
    """Outcome, statuses and whatever does not hold, for a terminal."""
    failed: Sequence[View] = [_comparisons(o) for o in v.outcomes if not (o.holds or o.absent)]
    return views_text([headline(v), Points(summary(v)), _statuses(v), *failed], width)


def domains_text(v: Verification) -> str:
    """Domains and statuses as the package carries them from a full run at the release."""
    held = {
        "domains": v.domains,
        "statuses": v.by_subject,
        "bare": v.bare,
        "recordings": v.recordings,
        "depends": v.depends,
    }
    return f"{json.dumps(held, indent=1)}\n"
