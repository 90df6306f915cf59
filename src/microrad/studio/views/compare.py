"""Two missions beside each other: the keys that differ, what their links come to, and what their studies found."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from microrad.core.folder import MANIFEST, read_bytes
from microrad.core.units import UnitError, parse_quantity
from microrad.link import study as link_study
from microrad.mission.toml import value_of
from microrad.report.quantities import quantity
from microrad.studio.draft.draft import Draft, Value
from microrad.studio.session import Session
from microrad.studio.views.link import ROUNDING_DB

_MOST_FOLDERS = 500
_MOST_BYTES = 5_000_000


@dataclass(frozen=True, slots=True)
class Difference:
    """A key that two missions do not agree on: its value in each, "" where it has none, and where each comes from."""

    key: str
    here: str
    there: str
    here_source: str
    there_source: str


@dataclass(frozen=True, slots=True)
class Number:
    """A number of one mission: its name, value and unit (SI), and what is required of it, if anything is."""

    name: str
    value: float
    unit: str
    required: str = ""
    met: bool | None = None

    @property
    def text(self) -> str:
        """The value with its unit."""
        return quantity(self.value, self.unit) if self.unit else f"{self.value:.4g}"


@dataclass(frozen=True, slots=True)
class Beside:
    """A number in both missions, None where one of them has it not."""

    name: str
    here: Number | None
    there: Number | None

    @property
    def change(self) -> str:
        """The second less the first, with its sign; "same" where both are shown alike."""
        if self.here is None or self.there is None:
            return ""
        change = self.there.value - self.here.value
        if self.here.text == self.there.text:
            return "same"
        sign = "" if change < 0.0 else "+"
        return f"{sign}{Number(self.name, change, self.here.unit).text}"


def differences(here: Draft, there: Draft) -> tuple[Difference, ...]:
    """The keys whose values differ, in the order of the first mission, then of the second.

    Quantities that are equal in other units ("5 cm", "50 mm") do not differ, nor do other words for the same number. A
    table that only one of them has is one difference, "[orbit]", with the number of its keys.
    """
    ours, theirs = here.values, there.values
    found: dict[str, Difference] = {}
    for key in dict.fromkeys((*ours, *theirs)):
        a, b = ours.get(key), theirs.get(key)
        table = key.partition(".")[0]
        alone = "." in key and not (_keys_of(table, ours) and _keys_of(table, theirs))
        if alone:
            here_keys, there_keys = (_count(_keys_of(table, values)) for values in (ours, theirs))
            found[table] = Difference(f"[{table}]", here_keys, there_keys, "", "")
        elif a is None or b is None or _meant(a) != _meant(b):
            typed = ("" if each is None else each.typed for each in (a, b))
            found[key] = Difference(key, *typed, *("" if each is None else each.source for each in (a, b)))
    return tuple(found.values())


def _keys_of(table: str, values: dict[str, Value]) -> int:
    return sum(key.startswith(f"{table}.") for key in values)


def _count(keys: int) -> str:
    return f"{keys} key{'' if keys == 1 else 's'}" if keys else ""


def _meant(value: Value) -> object:
    """What a value means: a quantity in its SI unit, else what TOML makes of it."""
    unit = "" if value.about is None else value.about.unit
    data = value_of(value.raw, Decimal)
    if not unit:
        return (isinstance(data, bool), data) if data is not None else value.raw
    items = data if isinstance(data, list) else [data]
    with suppress(UnitError):
        return tuple(f"{parse_quantity(item, unit):.12g}" for item in items)
    return value.raw


# ------------------------------------------------------------------------------------------------------------- numbers
def link_numbers(draft: Draft) -> tuple[Number, ...]:
    """What follows from the tables of the links; raises ValueError with the reason where nothing does."""
    study = link_study.run_link_study(draft.link())
    required = study.file.mission.requirement.margin_db
    found = []
    for budget in study.budgets:
        least = required if budget is study.communication else 0.0
        met = budget.margin_db >= least - ROUNDING_DB
        found.append(Number(f"{budget.name}: margin", budget.margin_db, "dB", quantity(least, "dB"), met))
        found.append(Number(f"{budget.name}: received power", budget.received_power_w, "W"))
    rate = study.file.mission.communication.data_rate_bit_s
    found.append(Number("Data rate", float(rate), "bit/s"))
    found.append(Number("Largest data rate with the required margin", study.largest_rate_bit_s, "bit/s"))
    if study.open_loop is not None:
        found.append(Number("Open-loop pointing error, root sum square", study.open_loop.rss_rad, "rad"))
    if study.finding is not None:
        outcome = study.finding.wide.outcome
        found.append(Number("Acquisition by the wide beacon: probability", outcome.success_probability, ""))
        if study.finding.wide.possible:
            found.append(Number("Acquisition by the wide beacon: mean time", outcome.mean_time_s, "s"))
    return tuple(found)


def beside(here: tuple[Number, ...], there: tuple[Number, ...]) -> tuple[Beside, ...]:
    """The numbers of both, by name, in the order of the first, then of the second."""
    ours, theirs = {n.name: n for n in here}, {n.name: n for n in there}
    return tuple(Beside(name, ours.get(name), theirs.get(name)) for name in dict.fromkeys((*ours, *theirs)))


# ------------------------------------------------------------------------------------------------------------- studies
@dataclass(frozen=True, slots=True)
class Found:
    """A finished study of exactly this text: the folder of its results, its verdict, its requirements."""

    folder: str
    verdict: str
    met: bool
    numbers: tuple[Number, ...]


def finished_study(session: Session, draft: Draft) -> Found | None:
    """The latest study of the draft's text among the folders of the working folder; None where there is none."""
    found = []
    for path in sorted(session.folder.glob(f"*/{MANIFEST}"))[:_MOST_FOLDERS]:
        with suppress(OSError, ValueError, KeyError, TypeError):
            if path.stat().st_size > _MOST_BYTES:
                continue
            data = json.loads(read_bytes(path, _MOST_BYTES))
            if data["mission"]["sha256"] == draft.sha256:
                found.append((path.stat().st_mtime_ns, _found(path, data["summary"])))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def _found(path: Path, summary: dict[str, Any]) -> Found:
    numbers = tuple(
        Number(
            str(each["name"]),
            float(each["actual"]),
            str(each["unit"]),
            quantity(float(each["required"]), str(each["unit"])),
            bool(each["met"]),
        )
        for each in summary["requirements"]
        if each["actual"] is not None and each["required"] is not None
    )
    return Found(path.parent.name, str(summary["verdict"]), all(r["met"] for r in summary["requirements"]), numbers)
