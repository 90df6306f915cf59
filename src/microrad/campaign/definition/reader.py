"""Reads a campaign file against the mission that it draws from, and reports every fault at once."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from microrad.campaign.definition import checks
from microrad.campaign.definition import draws as drawing
from microrad.campaign.definition.cells import CellReader
from microrad.campaign.definition.draws import DrawReader
from microrad.campaign.definition.keys import MIRROR, MIRROR_FILE, OPTICAL, flat, flat_tables, touches_loop
from microrad.campaign.definition.records import CampaignFile, Cell, Draw, Variable
from microrad.campaign.definition.tables import CampaignTable, VariableTable
from microrad.campaign.definition.values import FILE_WORD, ValueReader, text_of
from microrad.campaign.ledger import argument, is_ledger
from microrad.campaign.records import CampaignError, Limit
from microrad.link.fade_series import of_mission as fading_series
from microrad.mirror import coupled
from microrad.mission.file import LinkFile, MissionFile, check_table, mirror_of_loop, named_files, open_mission
from microrad.mission.model import Mission
from microrad.mission.tables.link import LinkRequirement
from microrad.mission.toml import Document, Fault, MissionError, UnreadableError, clipped

LANES = 64
"""Runs that the compiled loop advances side by side: as many realisations cost no more than one."""


def read_definition(path: Path) -> tuple[CampaignFile, Document]:
    """The campaign that a file defines, and the file as it stands, to note further faults in.

    Raises `MissionError` with every fault of the campaign file, of the mission under its [set] and in the cells of its
    grid.
    """
    if _is_ledger(path):
        name = argument(path)
        expected = f"`microrad campaign resume {name}` goes on with it, `microrad campaign status {name}` looks at it"
        fault = Fault("", "", 0, f"is a ledger, not a {FILE_WORD}", expected, file=clipped(str(path)))
        raise MissionError(path, [fault])
    try:
        document = Document.read(path, FILE_WORD)
    except UnreadableError as error:
        expected = error.expected.replace("`microrad init`", "`microrad campaign init`")
        fault = Fault("", "", 0, f"the {FILE_WORD} {error.reason}", expected, file=clipped(str(path)))
        raise MissionError(path, [fault]) from None
    campaign = _DefinitionReader(document).read()
    if campaign is None:
        raise MissionError(path, document.faults)
    return campaign, document


def _is_ledger(path: Path) -> bool:
    """Whether this is a ledger; of a file that cannot be read, what is wrong is said where it is read as a text."""
    with suppress(CampaignError):
        return is_ledger(path)
    return False


def block_rows(runs: int) -> int:
    """Rows of one Latin hypercube or Sobol set: a power of two, about eight sets in the runs, within 16 to 4096."""
    return min(max(1 << max((runs // 8).bit_length() - 1, 0), 16), 4096)


class _DefinitionReader:
    """Reads a campaign file step by step; what is wrong is noted in its document, and the next step goes on."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.reader = ValueReader(document)
        self.fixed = flat(self._table("set"))
        self.grid = flat(self._table("grid"))
        self.inputs = flat_tables(self._table("inputs"), ("drawn_as",))
        self.limits = self._table("limits")
        self.table = check_table(document, CampaignTable, _flat_variables(document.data))
        precision = document.data.get("precision")
        checks.tell_half_width(self.reader, precision.get("output") if isinstance(precision, dict) else None)

    def _table(self, name: str) -> dict[str, Any]:
        found = self.document.data.get(name, {})
        if isinstance(found, dict):
            return found
        self.reader.fault(name, found, "is no table", f"[{name}] with a key on each line below it")
        return {}

    @property
    def _variables(self) -> dict[str, VariableTable]:
        optimise = None if self.table is None else self.table.optimise
        return {} if optimise is None else optimise.variables

    def read(self) -> CampaignFile | None:
        """The campaign, or None where something is wrong."""
        self._check_doubles()
        keep = checks.kept(self.reader, self.document.data.get("keep"), self.table)
        mission = self._mission()
        if mission is None:
            return None
        cell_reader = CellReader(self.reader, mission, self.fixed, self.grid)
        data = cell_reader.under_set()
        axes = cell_reader.axes(data)
        cells = () if self.document.faults else cell_reader.cells(data, axes)
        cells = self._with_several_axes(cells)
        draws = self._draws(data, cells)
        items = ((self.reader, key, table, data) for key, table in self._variables.items())
        variables = self.reader.each(drawing.variable, items)
        if self.table is None or not cells:
            return None
        nominal = cells[0]
        if axes:
            with suppress(MissionError):  # no mission without the values of the grid
                nominal = cell_reader.cell(data, {})
        return self._campaign(self.table, mission, nominal, cells, draws, keep, variables)

    def _check_doubles(self) -> None:
        """No key in two tables; a grid of mirrors may be drawn from, each by its own covariance."""
        tables = {"set": self.fixed, "grid": self.grid, "inputs": self.inputs, "optimise.variables": self._variables}
        taken: dict[str, str] = {}
        for name, keys in tables.items():
            for key in keys:
                if key in taken and not (key == MIRROR and name == "inputs"):
                    reason = f"stands in [{taken[key]}] too"
                    self.reader.fault(f"{name}.{key}", None, reason, "the key in one of the two tables")
                taken.setdefault(key, name)
        order = list(tables)
        for key, name in taken.items():
            whole = key.rpartition(".")[0]
            above = taken.get(whole)
            if whole != MIRROR and above and (above not in ("set", "grid") or order.index(above) >= order.index(name)):
                reason = f"is an item of {whole}, which stands in [{above}] as a whole"
                self.reader.fault(f"{name}.{key}", None, reason, "the list, or its items, in one of the two tables")

    def _mission(self) -> Document | None:
        name = self.document.data.get("mission")
        if not isinstance(name, str) or not name:
            return None  # has been said
        try:
            return open_mission(self.document.path.parent / name)
        except MissionError as error:
            self.document.faults.extend(error.faults)
            return None

    def _with_several_axes(self, cells: tuple[Cell, ...]) -> tuple[Cell, ...]:
        """The cells with the mirrors of several axes that are drawn; none where one of the files holds none."""
        files = {_several_axes_file(cell.file): cell.file for cell in cells} if MIRROR in self.inputs else {}
        if files.keys() <= {None}:
            return cells
        if MIRROR_FILE in self.inputs:
            reason = f"is drawn, and [inputs.{MIRROR}] draws the mirror that it names"
            self.reader.fault(f"inputs.{MIRROR_FILE}", None, reason, "a grid of files, or one of the two removed")
        try:
            mirrors = {name: _several_axes(file) for name, file in files.items()}
        except MissionError as error:
            self.document.faults.extend(error.faults)
            return ()
        return tuple(replace(cell, several_axes=mirrors[_several_axes_file(cell.file)]) for cell in cells)

    def _draws(self, data: Mapping[str, Any], cells: tuple[Cell, ...]) -> tuple[Draw, ...]:
        given = frozenset((*self.fixed, *self.grid, *self.inputs, *self._variables))
        draw_reader = DrawReader(self.reader, data, cells, given)
        return self.reader.each(draw_reader.draw, self.inputs.items())

    def _limits(self, keep: tuple[str, ...], required: LinkRequirement) -> tuple[Limit, ...]:
        if "limits" not in self.document.data:
            varied = {"grid": self.grid, "inputs": self.inputs}
            return checks.default_limits(self.reader, keep, required, varied)
        return self.reader.each(checks.limit, ((self.reader, name, raw, keep) for name, raw in self.limits.items()))

    def _campaign(
        self,
        table: CampaignTable,
        mission: Document,
        nominal: Cell,
        cells: tuple[Cell, ...],
        draws: tuple[Draw, ...],
        keep: tuple[str, ...],
        variables: tuple[Variable, ...],
    ) -> CampaignFile | None:
        """The record, where everything in it fits together."""
        missions, required = [cell.file.mission for cell in cells], nominal.file.mission.requirement
        optional = ("beacon", "answer", "orbit", "operations")
        absent = [name for name in optional if any(getattr(m, name) is None for m in missions)]
        absent += [OPTICAL] * any(m.operations is None or m.operations.optical is None for m in missions)
        fadings = [m.communication.fading for m in missions]
        absent += [fading_series.KEY] * any(each is None or each.series is None for each in fadings)
        keep = checks.with_tables(self.reader, self.document.data.get("keep"), keep, absent)
        varying = [draw.key for draw in draws if any(touches_loop(draw.key, m) for m in missions)]
        if table.loop is not None:
            checks.check_loop(self.reader, table.loop, missions)
        checks.check_day(self.reader, keep, absent)
        checks.check_tail(self.reader, table, varying, self.document.data)
        checks.check_minimise(self.reader, table)
        limits = () if table.tail is not None else self._limits(keep, required)
        width = checks.half_width(self.reader, table, keep)
        block = block_rows(table.runs)
        rows = _whole_blocks(table.runs, block, table.sampling)
        most = rows if table.precision is None else _whole_blocks(table.precision.at_most, block, table.sampling)
        loop_varies = table.loop is not None and bool(varying)
        realisations = table.realisations or (LANES if loop_varies else 1)
        checks.check_size(self.reader, table, rows, most, realisations)
        checks.check_repeats(self.reader, table, bool(self.inputs), rows, most)
        files = self._files(mission, cells, draws)
        if not self.document.faults:  # each named file is there
            checks.check_fades(self.reader, keep, [cell.file for cell in cells])
        if self.document.faults:
            return None
        warnings = [*_warnings(table, rows, loop_varies), *drawing.failing(draws, cells[0].data, most)]
        if table.tail is None and "limits" in self.document.data:
            warnings += checks.unchecked(self.limits, keep, required, {*self.grid, *self.inputs})
        return CampaignFile(
            path=self.document.path,
            text=self.document.text,
            sha256=self.document.sha256,
            table=table,
            mission=nominal.file,
            cells=cells,
            draws=draws,
            inputs=drawing.input_texts(draws, cells),
            fixed={key: text_of(value) for key, value in self.fixed.items()},
            keep=keep,
            limits=limits,
            variables=variables,
            rows=rows,
            most_rows=most,
            realisations=realisations,
            block=block,
            half_width=width,
            loop_varies=loop_varies,
            files=files,
            warnings=tuple(warnings),
        )

    def _files(self, mission: Document, cells: tuple[Cell, ...], draws: tuple[Draw, ...]) -> tuple[Path, ...]:
        """Every file that the campaign depends on; those that do not exist are noted."""
        folder = mission.path.parent
        named = [folder / name for cell in cells for name in named_files(cell.file.mission)]
        named += [folder / name for draw in draws for name in draw.files]
        for path in dict.fromkeys(named):
            if not path.is_file():
                self.reader.fault(
                    "mission", str(path), "is named by the mission and does not exist", "an existing file"
                )
        inner = [cell.file.mirror_file for cell in cells if isinstance(cell.file, MissionFile)]
        mirrors = [each.path for each in inner if each is not None]
        own = [each.path for each in mission.inner.values()]
        return tuple(dict.fromkeys([self.document.path, mission.path, *own, *mirrors, *named]))


def _several_axes_file(file: LinkFile) -> str | None:
    """Name of the mirror file of several axes that a mission's loop has, None without one."""
    m = file.mission
    return m.fine_pointing.mirror_file if isinstance(m, Mission) and m.fine_pointing is not None else None


def _several_axes(file: LinkFile) -> coupled.CoupledMirror | None:
    table = mirror_of_loop(file) if isinstance(file, MissionFile) else None
    return None if table is None else coupled.of(table)


def _flat_variables(data: Mapping[str, Any]) -> dict[str, Any]:
    """The data of a campaign file with the tables [optimise.variables.KEY] by dotted key."""
    optimise = data.get("optimise")
    if not isinstance(optimise, dict) or not isinstance(optimise.get("variables"), dict):
        return dict(data)
    return {**data, "optimise": {**optimise, "variables": flat_tables(optimise["variables"], ())}}


def _whole_blocks(rows: int, block: int, sampling: str) -> int:
    return rows if sampling == "random" else -(-rows // block) * block


def _warnings(table: CampaignTable, rows: int, loop_varies: bool) -> Iterator[str]:
    if rows != table.runs:
        yield f"runs = {table.runs} is rounded up to {rows} rows, whole sets of {table.sampling} sampling"
    if loop_varies and table.realisations is not None and table.realisations % LANES:
        full = -(-table.realisations // LANES) * LANES
        yield f"realisations = {table.realisations} takes as long as {full}: runs are advanced {LANES} side by side"
