"""From the drawn values of a row to its mission: put into the raw data of the cell's mission file, and validated."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

from pydantic import ValidationError

from microrad.campaign.distributions import Distribution, OneOf
from microrad.campaign.keys import MIRROR, Key, UnknownKeyError, as_one, find, put, rule_in, touches_loop, within
from microrad.campaign.reading import FILE_WORD
from microrad.campaign.records import CampaignError
from microrad.mission.fields import Several
from microrad.mission.file import LinkFile, check_table
from microrad.mission.model import LinkMission, Mission, Source
from microrad.mission.tables.mirror import Mirror, place
from microrad.mission.toml import Document


@dataclass(frozen=True, slots=True)
class Draw:
    """An input that is drawn: the covariance of an identified mirror where there is no ``distribution``.

    With ``drawn_as`` its values are drawn from that distribution instead, and weighted.
    """

    key: str
    unit: str
    distribution: Distribution | None
    drawn_as: Distribution | None


@dataclass(frozen=True, slots=True)
class Base:
    """A cell of the grid: its values as text, the raw data of its mission, and that mission."""

    values: dict[str, str]
    data: Mapping[str, Any]
    file: LinkFile

    @property
    def mirror(self) -> Mirror | None:
        """The mirror of its mission, None where that has links alone."""
        m = self.file.mission
        return m.mirror if isinstance(m, Mission) else None


class _Campaign(Protocol):
    @property
    def bases(self) -> tuple[Base, ...]: ...
    @property
    def draws(self) -> tuple[Draw, ...]: ...


class Builder:
    """Makes the mission of each row; may be called from several threads."""

    def __init__(self, campaign: _Campaign) -> None:
        """Look up what every row needs."""
        self._bases = campaign.bases
        self._words = {d.key: d.distribution for d in campaign.draws if isinstance(d.distribution, OneOf)}
        self._singles: dict[tuple[int, str], Key | None] = {}
        self._identified = any(d.distribution is None for d in campaign.draws)

    def mission(self, cell: int, values: Mapping[str, float]) -> LinkFile:
        """The mission of a row of a cell from its drawn values by key, in SI units; without any the cell's own.

        Raises `CampaignError` with key, value and reason where that is no mission.
        """
        base = self._bases[cell]
        if not values:
            return base.file
        data = dict(base.data)
        texts: dict[str, str] = {}
        for key, value in values.items():
            if not math.isnan(value):  # nan: a parameter that the mirror of this cell has not
                data, texts[key] = self._put(cell, data, key, value)
        told = {key: Source(0, f"campaign: drawn, {text}", text, FILE_WORD) for key, text in texts.items()}
        return replace(base.file, mission=_validated(base, data, texts), sources={**base.file.sources, **told})

    def loop_key(self, cell: int, values: Mapping[str, float]) -> Hashable:
        """Equal for rows with the same fine-pointing loop: the values, of the grid and drawn, that the loop has."""
        m = self._bases[cell].file.mission
        gridded = tuple((k, v) for k, v in self._bases[cell].values.items() if touches_loop(k, m))
        return gridded, tuple((key, value) for key, value in values.items() if touches_loop(key, m))

    def _put(self, cell: int, data: dict[str, Any], key: str, value: float) -> tuple[dict[str, Any], str]:
        """The data with a value put in, and the value as text."""
        if key in self._words:
            listed = self._words[key]
            raw: object = listed.written[listed.values.index(value)]
            return put(data, key, raw), str(raw)
        found = self._single(cell, key)
        if found is None:
            nominal = self._bases[cell].mirror
            assert nominal is not None  # an identified one, as the campaign file's own check has seen
            return _with_parameter(data, nominal, key.partition(".")[2], value), f"{value!r}"
        raw = found.written(value)
        if self._identified and key.startswith(f"{MIRROR}."):
            data = _without_uncertainty(data)
        return put(data, key, raw), str(raw)

    def _single(self, cell: int, key: str) -> Key | None:
        """The key of a single value, or of a list as one; None for a whole list of an identified mirror."""
        if (cell, key) not in self._singles:
            data = self._bases[cell].data
            try:
                found: Key | None = find(key, data)
            except UnknownKeyError:
                found = None
            if found is not None and not (self._identified and key.startswith(f"{MIRROR}.")):
                found = as_one(found, within(data, key))
            is_list = found is not None and isinstance(found.rule, Several)
            self._singles[cell, key] = None if is_list else found
        return self._singles[cell, key]


def _validated(base: Base, data: dict[str, Any], texts: Mapping[str, str]) -> LinkMission:
    """The mission of the data: tables that are those of the base are taken as they are."""
    kind = type(base.file.mission)
    tables = {k: getattr(base.file.mission, k) if v is base.data.get(k) else v for k, v in data.items()}
    try:
        return kind.model_validate(tables)
    except ValidationError:
        pass
    blank = Document(base.file.path, "mission file", "")
    check_table(blank, kind, data)
    said = "; ".join(f"{f.key} = {f.value or texts.get(f.key, '?')} {f.reason}" for f in blank.faults[:3])
    raise CampaignError(f"the row is no mission: {said}")


def _without_uncertainty(data: dict[str, Any]) -> dict[str, Any]:
    """What is drawn is a mirror and no estimate."""
    return {**data, MIRROR: {k: v for k, v in data[MIRROR].items() if k != "uncertainty"}}


def _with_parameter(data: dict[str, Any], nominal: Mirror, parameter: str, value: float) -> dict[str, Any]:
    """The data with a list of the mirror's uncertain parameters, which scale together, times a factor."""
    at = place(nominal, parameter)
    table = getattr(nominal, at.table)
    info = type(table).model_fields[at.field]
    rule, items = rule_in(info), list(getattr(table, at.field))
    assert isinstance(rule, Several)
    raw = list(data[MIRROR][at.table][info.alias or at.field])
    for i, item in enumerate(items):
        raw[i] = f"{item * value!r} {rule.each.unit}" if rule.each.unit else item * value
    return put(_without_uncertainty(data), f"{MIRROR}.{at.table}.{info.alias or at.field}", raw)
