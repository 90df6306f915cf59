"""Campaign files: read, checked against the mission that they draw from, and every fault reported at once."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from microrad.campaign import draws as drawing
from microrad.campaign import fits
from microrad.campaign.cells import CellReader
from microrad.campaign.definition import CampaignFile, Dimension
from microrad.campaign.distributions import OneOf
from microrad.campaign.draws import DrawReader, Variable
from microrad.campaign.inputs import Base, Builder, Draw
from microrad.campaign.keys import MIRROR, flat, flat_tables, touches_loop
from microrad.campaign.ledger_file import argument, is_ledger
from microrad.campaign.reading import FILE_WORD, Reading, text_of
from microrad.campaign.records import CampaignError, Limit
from microrad.campaign.sampling import block_rows
from microrad.campaign.tables import CampaignTable, VariableTable
from microrad.mission.file import LinkFile, MissionFile, check_table, named_files, open_mission
from microrad.mission.tables.link import LinkRequirement
from microrad.mission.toml import Document, Fault, MissionError, UnreadableError, clipped

LANES = 64
"""Runs that the compiled loop advances side by side: as many realisations cost no more than one."""


def load_campaign(path: Path) -> CampaignFile:
    """Read a campaign file and the mission that it draws from.

    Raises `MissionError` with every fault of the campaign file, of the mission under its [set] and in the cells of its
    grid.
    """
    if is_ledger(path):
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
    campaign = _Reader(document).read()
    if campaign is None or document.faults:
        raise MissionError(path, document.faults)
    return campaign


class _Reader:
    """Reads a campaign file step by step; what is wrong is noted in its document, and the next step goes on."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.on = Reading(document)
        self.fixed = flat(self._table("set"))
        self.grid = flat(self._table("grid"))
        self.inputs = flat_tables(self._table("inputs"), ("drawn_as",))
        self.limits = self._table("limits")
        self.table = check_table(document, CampaignTable, _flat_variables(document.data))
        precision = document.data.get("precision")
        fits.tell_half_width(self.on, precision.get("output") if isinstance(precision, dict) else None)

    def _table(self, name: str) -> dict[str, Any]:
        found = self.document.data.get(name, {})
        if isinstance(found, dict):
            return found
        self.on.fault(name, found, "is no table", f"[{name}] with a key on each line below it")
        return {}

    @property
    def _variables(self) -> dict[str, VariableTable]:
        optimise = None if self.table is None else self.table.optimise
        return {} if optimise is None else optimise.variables

    def read(self) -> CampaignFile | None:
        """The campaign, or None where something is wrong."""
        self._check_doubles()
        keep = fits.kept(self.on, self.document.data.get("keep"), self.table)
        mission = self._mission()
        if mission is None:
            return None
        cells = CellReader(self.on, mission, self.fixed, self.grid)
        data = cells.under_set()
        axes = cells.axes(data)
        bases = () if self.document.faults else cells.bases(data, axes)
        draws = self._draws(data, bases)
        found = [drawing.variable(self.on, key, table, data) for key, table in self._variables.items()]
        variables = tuple(each for each in found if each is not None)
        if self.table is None or not bases:
            return None
        nominal = _nominal(cells, data, bases)
        return self._campaign(self.table, mission, nominal, bases, draws, keep, variables)

    def _check_doubles(self) -> None:
        """No key in two tables; a grid of mirrors may be drawn from, each by its own covariance."""
        tables = {"set": self.fixed, "grid": self.grid, "inputs": self.inputs, "optimise.variables": self._variables}
        taken: dict[str, str] = {}
        for name, keys in tables.items():
            for key in keys:
                if key in taken and not (key == MIRROR and name == "inputs"):
                    reason = f"stands in [{taken[key]}] too"
                    self.on.fault(f"{name}.{key}", None, reason, "the key in one of the two tables")
                taken.setdefault(key, name)
        order = list(tables)
        for key, name in taken.items():
            whole = key.rpartition(".")[0]
            above = taken.get(whole)
            if whole != MIRROR and above and (above not in ("set", "grid") or order.index(above) >= order.index(name)):
                reason = f"is an item of {whole}, which stands in [{above}] as a whole"
                self.on.fault(f"{name}.{key}", None, reason, "the list, or its items, in one of the two tables")

    def _mission(self) -> Document | None:
        name = self.document.data.get("mission")
        if not isinstance(name, str) or not name:
            return None  # has been said
        try:
            return open_mission(self.document.path.parent / name)
        except MissionError as error:
            self.document.faults.extend(error.faults)
            return None

    def _draws(self, data: Mapping[str, Any], bases: tuple[Base, ...]) -> tuple[Draw, ...]:
        reader = DrawReader(self.on, data, bases, frozenset((*self.fixed, *self.grid, *self.inputs, *self._variables)))
        found = [reader.draw(key, raw) for key, raw in self.inputs.items()]
        return tuple(draw for draw in found if draw is not None)

    def _limits(self, table: CampaignTable, keep: tuple[str, ...], required: LinkRequirement) -> tuple[Limit, ...]:
        if table.tail is not None:
            return ()
        if "limits" not in self.document.data:
            varied = {"grid": self.grid, "inputs": self.inputs}
            return fits.default_limits(self.on, keep, required, varied)
        found = [fits.limit(self.on, name, raw, keep) for name, raw in self.limits.items()]
        return tuple(limit for limit in found if limit is not None)

    def _unchecked(self, table: CampaignTable, keep: tuple[str, ...], required: LinkRequirement) -> Iterator[str]:
        if table.tail is None and "limits" in self.document.data:
            yield from fits.unchecked(self.limits, keep, required, {*self.grid, *self.inputs})

    def _campaign(
        self,
        table: CampaignTable,
        mission: Document,
        nominal: LinkFile,
        bases: tuple[Base, ...],
        draws: tuple[Draw, ...],
        keep: tuple[str, ...],
        variables: tuple[Variable, ...],
    ) -> CampaignFile | None:
        """The record, where everything in it fits together."""
        keep = fits.with_tables(self.on, self.document.data.get("keep"), keep, bases)
        varying = [d.key for d in draws if any(touches_loop(d.key, b.file.mission) for b in bases)]
        if table.loop is not None:
            fits.check_loop(self.on, table.loop, bases)
        fits.check_day(self.on, keep, bases)
        fits.check_tail(self.on, table, varying, self.document.data)
        fits.check_minimise(self.on, table)
        limits, width = self._limits(table, keep, nominal.mission.requirement), fits.half_width(self.on, table, keep)
        block = block_rows(table.runs)
        rows = _whole_blocks(table.runs, block, table.sampling)
        most = rows if table.precision is None else _whole_blocks(table.precision.at_most, block, table.sampling)
        loop_varies = table.loop is not None and bool(varying)
        realisations = table.realisations or (LANES if loop_varies else 1)
        fits.check_size(self.on, rows, most, realisations)
        fits.check_repeats(self.on, table, bool(self.inputs), rows, most)
        files = self._files(mission, bases, draws)
        if not self.document.faults:
            self._check_median(bases, draws)
        if self.document.faults:
            return None
        texts = drawing.input_texts(draws, bases)
        found = CampaignFile(
            path=self.document.path,
            text=self.document.text,
            sha256=self.document.sha256,
            table=table,
            mission=nominal,
            cells=tuple(base.values for base in bases),
            bases=bases,
            draws=draws,
            dimensions=tuple(Dimension(text.key, text.unit) for text in texts),
            inputs=texts,
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
            warnings=(
                *_warnings(table, rows, loop_varies),
                *drawing.failing(draws, bases[0].data, most),
                *self._unchecked(table, keep, nominal.mission.requirement),
            ),
        )
        self._check_read(found)
        return None if self.document.faults else found

    def _check_read(self, campaign: CampaignFile) -> None:
        """What is drawn changes something of what is kept."""
        from microrad.campaign.unread import unread  # with the loop: here, to keep the start quick

        rows = (Builder(campaign).mission(cell, _medians(campaign.draws)) for cell in range(len(campaign.bases)))
        for key in unread(campaign, rows):
            reason = f"is read by nothing that is kept ({', '.join(campaign.keep)}): it would change no number"
            m = campaign.mission.mission
            expected = "a key that they depend on, or another output in `keep`"
            if key == "communication.pointing_error" and campaign.table.loop is None and m.jitter is not None:
                expected = (
                    "jitter.bias or jitter.rms: under the table [jitter] the margin is that of requirement.outage"
                )
            self.on.fault(f"inputs.{key}", None, reason, expected)

    def _files(self, mission: Document, bases: tuple[Base, ...], draws: tuple[Draw, ...]) -> tuple[Path, ...]:
        """Every file that the campaign depends on; those that do not exist are noted."""
        folder = mission.path.parent
        named = [folder / name for base in bases for name in named_files(base.file.mission)]
        for draw in draws:
            if isinstance(draw.distribution, OneOf) and draw.key.endswith(".file"):
                named += [folder / str(word) for word in draw.distribution.written]
        for path in dict.fromkeys(named):
            if not path.is_file():
                self.on.fault("mission", str(path), "is named by the mission and does not exist", "an existing file")
        inner = [base.file.mirror_file for base in bases if isinstance(base.file, MissionFile)]
        mirrors = [each.path for each in inner if each is not None]
        own = [each.path for each in mission.inner.values()]
        return tuple(dict.fromkeys([self.document.path, mission.path, *own, *mirrors, *named]))

    def _check_median(self, bases: tuple[Base, ...], draws: tuple[Draw, ...]) -> None:
        """A row in the middle of all distributions is a mission, in every cell."""
        values, builder = _medians(draws), Builder(_Drawing(bases, draws))
        for cell, base in enumerate(bases):
            try:
                builder.mission(cell, values)
            except CampaignError as error:
                where = f" of the cell {', '.join(f'{k} = {v}' for k, v in base.values.items())}" if base.values else ""
                blamed = next((f".{draw.key}" for draw in draws if draw.key in str(error)), "")
                reason = f"leaves no mission in the middle of all distributions{where}: {error}"
                self.on.fault(f"inputs{blamed}", None, reason, "distributions about a mission that works")
                return


def _medians(draws: tuple[Draw, ...]) -> dict[str, float]:
    """The middle of each distribution by key."""
    import numpy as np  # here, to keep the start quick

    half = np.array([0.5])
    return {d.key: float(d.distribution.at(half)[0]) for d in draws if d.distribution is not None}


class _Drawing(NamedTuple):
    """What a builder needs of a campaign."""

    bases: tuple[Base, ...]
    draws: tuple[Draw, ...]


def _nominal(cells: CellReader, data: Mapping[str, Any], bases: tuple[Base, ...]) -> LinkFile:
    """The mission under [set] alone, or of the first cell where it is none by itself."""
    try:
        return cells.base(data, {}).file
    except MissionError:
        return bases[0].file


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
