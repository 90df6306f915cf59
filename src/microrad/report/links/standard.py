"""The links against a standard: a view, plain data and rows of a spreadsheet."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, get_args

from microrad.link.compliance import Asked, Compliance, Held, Judgement
from microrad.report.quantities import apart, are, quantity
from microrad.report.tables import Cell, Table
from microrad.report.view import Soft, View

NO_NUMBER = "unknown here"
"""What stands in place of the number of a requirement that no source here prints."""
_NOTHING = "\u2013"
_MARKS = {"meets": "PASS", "does not meet": "FAIL"}


def standard_view(found: Compliance) -> View:
    """Each requirement of the standard with what the mission has."""
    rows = [_row(each) for each in found.held]
    headings = ("requirement", "number", "asked", "mission has", "", "what it is", "why", "source")
    names = {3: [f"standard.clauses.{each.asked.key}.value" for each in found.held]}
    words = (0, 1, 2, 4, 5, 6, 7)
    table = Table("", headings, rows, words, cards=True, names=names)
    return View(found.standard.title, (summary(found), table, Soft(found.standard.note)))


def short_view(found: Compliance) -> View:
    """The same for a terminal that shows no sources: the rows with what is asked, and how many are met."""
    whole = standard_view(found)
    said, table, _ = whole.blocks
    assert isinstance(table, Table)
    return View(whole.title, (said, table.columns(range(5))))


def summary(found: Compliance) -> str:
    """How many requirements are met, missed, and left open, in a sentence."""
    met, missed = found.count("meets"), found.count("does not meet")
    left, outside = found.count("not said"), found.count("outside microrad")
    return (
        f"Of {len(found.held)} requirements that public sources print of it, up to version {found.standard.version}, "
        f"{met} {are(met)} met and {missed} {are(missed)} not; the mission does not say {left}, and {outside} "
        f"{are(outside)} outside microrad."
    )


def _row(held: Held) -> tuple[str | Cell, ...]:
    asked, has = _texts(held)
    mark = _MARKS.get(held.judgement)
    judged: str | Cell = held.judgement if mark is None else Cell("", mark)
    return held.asked.subject, number_text(held.asked), asked, has, judged, held.asked.asks, held.why, held.asked.source


def number_text(asked: Asked) -> str:
    """The standard's own number of a requirement, with the version that it is of."""
    return f"{asked.number} ({asked.numbered_in})" if asked.number else NO_NUMBER


def _texts(held: Held) -> tuple[str, str]:
    """What is asked, and what the mission has of it; beside a bound it has the digits that tell the two apart."""
    asked = held.asked
    has = held.text or (_NOTHING if held.value is None else quantity(held.value, asked.unit))
    limits = [quantity(each, asked.unit, 4) for each in asked.values] if asked.unit else [*asked.texts]
    match asked.comparison:
        case None:
            return _NOTHING, has
        case "between":
            text = " to ".join(limits)
            if (value := held.value) is not None:
                _, has = apart(min(asked.values, key=lambda limit: abs(limit - value)), value, asked.unit)
        case "on the grid":
            text = " + n \u00d7 ".join(limits)
        case "one of":
            text = ", ".join(limits)
        case bound:
            if held.value is not None:
                limits[0], has = apart(asked.values[0], held.value, asked.unit)
            text = f"{bound} {limits[0]}"
    where = "" if asked.distance_m is None else f" at {quantity(asked.distance_m, 'm', 4)}"
    ratio = "" if asked.bit_error_ratio is None else f" at a bit error ratio of {asked.bit_error_ratio:g}"
    return text + where + ratio, has


def standard_data(found: Compliance) -> dict[str, Any]:
    """The standard with each requirement, in SI units."""
    s = found.standard
    judgements: tuple[Judgement, ...] = get_args(Judgement)
    return {
        **{"name": s.name, "title": s.title, "version": s.version, "note": s.note},
        "counts": {word.replace(" ", "_"): found.count(word) for word in judgements},
        "clauses": [_data(each) for each in found.held],
    }


def _data(held: Held) -> dict[str, Any]:
    asked = asdict(held.asked)
    kept = {"name": asked.pop("key"), "limits": list(asked.pop("values")), "texts": list(asked.pop("texts"))}
    del asked["outside"]
    return {
        **kept,
        **asked,
        "value": held.value,
        "text": held.text,
        "judgement": held.judgement,
        "why": held.why,
    }


def standard_rows(found: Compliance) -> Iterator[tuple[str, ...]]:
    """Rows for the columns of the budgets in CSV: the judgement under "holds for", the reason under "warning"."""
    for held in found.held:
        asked, _ = _texts(held)
        value = held.text if held.value is None else repr(float(held.value))
        basis = held.asked.asks if held.asked.outside else f"{asked}: {held.asked.asks}"
        source = f"{number_text(held.asked)}; {held.asked.source}"
        yield found.standard.title, held.asked.subject, value, held.asked.unit, basis, source, held.judgement, held.why
