"""The cells of a campaign: its mission under [set], and under every combination of the values of [grid]."""

import itertools
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from microrad.campaign.definition.keys import MIRROR, put
from microrad.campaign.definition.records import Cell
from microrad.campaign.definition.values import FILE_WORD, NotedError, ValueReader, text_of
from microrad.link import LinkError
from microrad.mission.fields import Quantity, Several
from microrad.mission.file import LinkFile, either_file, with_values
from microrad.mission.model import Source
from microrad.mission.toml import Document, MissionError

MOST_CELLS = 1000
_RATE = "communication.data_rate"


@dataclass(frozen=True, slots=True)
class CellReader:
    """Reads [set] and [grid], each flat by key, against the mission's document."""

    reader: ValueReader
    mission: Document
    fixed: Mapping[str, Any]
    grid: Mapping[str, Any]

    def under_set(self) -> dict[str, Any]:
        """The mission's raw data with the values of [set]; those that do not fit are noted and left out."""
        data: Mapping[str, Any] = self.mission.data
        for key, value in self.fixed.items():
            if key == MIRROR:
                self._is_path(f"set.{MIRROR}", value)
                continue
            with suppress(NotedError):
                if self.reader.fits(f"set.{key}", self.reader.key("set", key, value, data), value):
                    data = put(data, key, value)
        return dict(data)

    def _is_path(self, at: str, value: object) -> bool:
        if isinstance(value, str) and value:
            return True
        self.reader.fault(at, value, "is no path", 'a mirror file, seen from the campaign file: "mirror.toml"')
        return False

    def axes(self, data: Mapping[str, Any]) -> dict[str, list[Any]]:
        """Values of the grid by key; those that do not fit are noted and left out."""
        axes: dict[str, list[Any]] = {key: [] for key in self.grid}
        for key, values in self.grid.items():
            with suppress(NotedError):
                axes[key] = self._axis(key, values, data)
        cells = math.prod(len(values) for values in axes.values())
        if cells > MOST_CELLS:
            self.reader.fault("grid", None, f"has {cells} cells", f"at most {MOST_CELLS}")
        return axes

    def _axis(self, key: str, values: object, data: Mapping[str, Any]) -> list[Any]:
        at = f"grid.{key}"
        found = None if key == MIRROR else self.reader.key("grid", key, values, data)
        if not isinstance(values, list) or not values:
            expected = "the values of the grid: [first, second]"
            raise self.reader.fault(at, values, "is not a list with something in it", expected)
        fitting = [v for v in values if (self.reader.fits(at, found, v) if found else self._is_path(at, v))]
        texts = [text_of(v) for v in fitting]
        read = [_read(found.rule if found else None, v) for v in fitting]
        firsts = [read.index(value) for value in read]
        for text, first in {texts[i]: texts[first] for i, first in enumerate(firsts) if first < i}.items():
            reason = "stands twice" if text == first else f"stands twice, before as {first}"
            self.reader.fault(at, text, reason, "each value once")
        return fitting

    def cells(self, data: Mapping[str, Any], axes: Mapping[str, list[Any]]) -> tuple[Cell, ...]:
        """The cells of the grid, the last key running fastest; none where one of them is no mission.

        Args:
            data: the mission's raw data under [set].
            axes: the values of the grid by key.
        """
        found = []
        for values in itertools.product(*axes.values()):
            cell = dict(zip(axes, values, strict=True))
            try:
                found.append(self.cell(data, cell))
            except MissionError as error:
                self._note(error, cell, self._without_cell(data))
                return ()
        return tuple(found)

    def cell(self, data: Mapping[str, Any], cell: Mapping[str, Any]) -> Cell:
        """A cell with its mission. Raises `MissionError` with the faults as a mission file has them.

        Args:
            data: the mission's raw data under [set].
            cell: the cell's values by key of the grid; none for the mission under [set] alone.
        """
        given = {**self.fixed, **cell}
        path = self.reader.document.path.parent / given[MIRROR] if MIRROR in given else None
        document = with_values(self.mission, data, path)
        for key, value in given.items():
            if key != MIRROR:  # once more for those that stood in [set]: over the mirror of another file
                document.data = put(document.data, key, value)
        file = either_file(document)
        told = {k: self._source(k, "grid" if k in cell else "set", v) for k, v in given.items() if k != MIRROR}
        file = replace(file, sources={**file.sources, **told})
        if math.isnan(file.mission.communication.data_rate_bit_s):
            file = _with_rate(document, file)
        return Cell({key: text_of(value) for key, value in cell.items()}, document.data, file)

    def _source(self, key: str, name: str, value: object) -> Source:
        found = self.reader.document.statement(f"{name}.{key}")
        line, comment = (found.line, found.comment) if found else (0, "")
        return Source(line, f"campaign: {comment or f'[{name}]'}", text_of(value), FILE_WORD)

    def _without_cell(self, data: Mapping[str, Any]) -> set[tuple[str, str]]:
        """Key and reason of what is wrong under [set] alone."""
        try:
            self.cell(data, {})
        except MissionError as error:
            return {(fault.key, fault.reason) for fault in error.faults}
        return set()

    def _note(self, error: MissionError, cell: Mapping[str, Any], without: set[tuple[str, str]]) -> None:
        """Note the faults of a cell, each where its key stands; ``without`` are those that are not the cell's own."""
        label = f" (in the cell {', '.join(f'{key} = {text_of(value)}' for key, value in cell.items())})"
        for fault in error.faults:
            where = "" if (fault.key, fault.reason) in without else label
            name = next((n for n, keys in (("grid", cell), ("set", self.fixed)) if fault.key in keys), "")
            if name:
                value = cell.get(fault.key, self.fixed.get(fault.key))
                self.reader.fault(f"{name}.{fault.key}", value, f"{fault.reason}{where}", fault.expected, fault.nearest)
            else:
                self.reader.document.faults.append(replace(fault, reason=f"{fault.reason}{where}"))


def _read(rule: Quantity | Several | None, value: object) -> object:
    """A value by its rule; as its text without one, and where it is the list that stands for one number."""
    if rule is None or (isinstance(value, list) and not isinstance(rule, Several)):
        return text_of(value)
    return rule.read(value)


def _with_rate(document: Document, file: LinkFile) -> LinkFile:
    """The file, and its document, with a data rate of "largest" solved for: once for the cell, without draws.

    Raises `MissionError` when no rate has the required margin.
    """
    from microrad.link.study import solve_rate

    try:
        solved = solve_rate(file)
    except LinkError as error:
        document.fault(_RATE, file.sources[_RATE].value, str(error), "a data rate, or a link with that much more")
        raise MissionError(document.path, document.faults) from None
    rate = solved.mission.communication.data_rate_bit_s
    document.data = put(document.data, _RATE, f"{rate!r} bit/s")  # read back to the same bits
    return solved
