"""From the drawn values of a row to its mission: put into the raw data of the cell's mission file, and validated."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from microrad.campaign.definition.distributions import OneOf
from microrad.campaign.definition.keys import (
    MIRROR,
    Key,
    UnknownKeyError,
    as_one,
    find,
    put,
    rule_in,
    touches_loop,
    within,
)
from microrad.campaign.definition.records import CampaignFile, Cell
from microrad.campaign.definition.values import FILE_WORD, text_of
from microrad.campaign.records import CampaignError
from microrad.mirror import coupled
from microrad.mirror.coupled import CoupledMirror
from microrad.mission.fields import Several
from microrad.mission.file import LinkFile, check_table
from microrad.mission.model import LinkMission, Source
from microrad.mission.tables.mirror import Mirror, place
from microrad.mission.toml import Document


class MissionBuilder:
    """Makes the mission of each row; may be called from several threads."""

    def __init__(self, campaign: CampaignFile) -> None:
        """Look up what every row needs."""
        self._cells = campaign.cells
        self._listed = {d.key: d.distribution for d in campaign.draws if isinstance(d.distribution, OneOf)}
        self._singles: dict[tuple[int, str], Key | None] = {}
        self._several_axes = frozenset(key for cell in campaign.cells for key in cell.directions)
        self._identified = any(d.distribution is None for d in campaign.draws) and not self._several_axes

    def mission(self, cell: int, values: Mapping[str, float]) -> LinkFile:
        """The mission of a row of a cell; without any values the cell's own.

        Raises `CampaignError` with key, value and reason where that is no mission.

        Args:
            cell: the cell.
            values: drawn values by key, in SI units.
        """
        base = self._cells[cell]
        if not values:
            return base.file
        data = dict(base.data)
        texts: dict[str, str] = {}
        for key, value in values.items():
            # nan: a parameter that the mirror of this cell has not
            if not math.isnan(value) and key not in self._several_axes:
                data, texts[key] = self._put(cell, data, key, value)
        told = {key: Source(0, f"campaign: drawn, {text}", text, FILE_WORD) for key, text in texts.items()}
        return replace(base.file, mission=_validated(base, data, texts), sources={**base.file.sources, **told})

    def several_axes(self, cell: int, values: Mapping[str, float]) -> CoupledMirror | None:
        """The mirror of several axes that a row draws; None for that of its mission.

        Args:
            cell: the cell.
            values: drawn values by key, in SI units.
        """
        own = self._cells[cell]
        numbers = [values[key] for key in own.directions if key in values]
        if own.several_axes is None or not numbers:
            return None
        return coupled.moved(own.several_axes, np.array(numbers))

    def loop_key(self, cell: int, values: Mapping[str, float]) -> Hashable:
        """Equal for rows with the same fine-pointing loop: the values, of the grid and drawn, that the loop has.

        Args:
            cell: the cell.
            values: drawn values by key, in SI units.
        """
        base = self._cells[cell]
        given = ((key, value) for each in (base.values, values) for key, value in each.items())
        return tuple((key, value) for key, value in given if touches_loop(key, base.file.mission))

    def _put(self, cell: int, data: dict[str, Any], key: str, value: float) -> tuple[dict[str, Any], str]:
        """The data with a value put in, and the value as text."""
        if key in self._listed:
            listed = self._listed[key]
            raw: object = listed.written[listed.values.index(value)]
            return put(data, key, raw), text_of(raw)
        found = self._single(cell, key)
        if found is None:
            nominal = self._cells[cell].mirror
            assert nominal is not None  # an identified one, as the campaign file's own check has seen
            return _with_parameter(data, nominal, key.partition(".")[2], value), f"{value!r}"
        raw = found.written(value)
        if self._identified and key.startswith(f"{MIRROR}."):
            data = _without_uncertainty(data)
        return put(data, key, raw), text_of(raw)

    def _single(self, cell: int, key: str) -> Key | None:
        """The key of a single value, or of a list as one; None for a whole list of an identified mirror."""
        if (cell, key) not in self._singles:
            data = self._cells[cell].data
            try:
                found: Key | None = find(key, data)
            except UnknownKeyError:
                found = None
            if found is not None and not (self._identified and key.startswith(f"{MIRROR}.")):
                found = as_one(found, within(data, key))
            is_list = found is not None and isinstance(found.rule, Several)
            self._singles[cell, key] = None if is_list else found
        return self._singles[cell, key]


def _validated(cell: Cell, data: dict[str, Any], texts: Mapping[str, str]) -> LinkMission:
    """The mission of the data: tables that are those of the cell are taken as they are."""
    own = cell.file.mission
    try:
        return type(own).model_validate({k: getattr(own, k) if v is cell.data.get(k) else v for k, v in data.items()})
    except ValidationError:
        pass
    blank = Document(cell.file.path, "mission file", "")
    check_table(blank, type(own), data)
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
