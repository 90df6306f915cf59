"""Signs beside the numbers of a mission that rest on less than its others, and what the signs say."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from microrad.mission.model import Source
from microrad.report import foundation
from microrad.report.foundation import Placard, placards, shipped
from microrad.report.registry import kind_of, placed
from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Points, Verdict, View

BEYOND = "†"
"""Behind a number that depends on an input beyond what was swept."""
BARE = "‡"
"""Behind a number of a quantity that was compared with nothing and has no source."""
_BARE = "Compared with nothing, and defined by no source: nothing says that it is what it is meant to be."


@dataclass(frozen=True, slots=True)
class Sign:
    """What stands behind a number.

    Args:
        sign: One or both of `BEYOND` and `BARE`; "" for none.
        title: Of the quantity.
        why: Extent and consequence, for a reader who asks.
        inputs: Keys beyond the domain on which the number depends.
    """

    sign: str = ""
    title: str = ""
    why: str = ""
    inputs: tuple[str, ...] = ()


@dataclass(slots=True)
class Marks:
    """The signs of one mission's numbers, by what they are in the JSON.

    Args:
        beyond: Its inputs beyond the domains.
    """

    beyond: Sequence[Placard]
    _bare: dict[str, None] = field(default_factory=dict)
    _extrapolated: dict[str, Placard] = field(default_factory=dict)

    @classmethod
    def of(cls, sources: Mapping[str, Source]) -> "Marks":
        """The signs of a mission.

        Args:
            sources: Of each value of the mission, by its dotted key.
        """
        return cls(placards(sources))

    def sign(self, name: str) -> Sign:
        """The sign of a number.

        Args:
            name: Dotted name in the JSON, records of a list by what tells them apart.
        """
        kind = kind_of(name) if name else ""
        if not kind:
            return Sign()
        depends, title = _inputs_of(kind), kind.partition(" | ")[0]
        found = {each.key: each for each in self.beyond if each.key in depends}
        self._extrapolated |= found
        why = [f"{each.text}." for each in found.values()]
        if bare := title in shipped()["bare"]:
            self._bare[title] = None
            why.append(_BARE)
        return Sign(f"{BEYOND if found else ''}{BARE if bare else ''}", title, " ".join(why), tuple(found))

    # ------------------------------------------------------------------------------------------------------- views
    def blocks(self, blocks: Iterable[Block]) -> list[Block]:
        """The same blocks with a sign behind each number in a table that has one.

        Args:
            blocks: Of a page, a terminal or the studio.
        """
        return [self._block(block) for block in blocks]

    def _block(self, block: Block) -> Block:
        if isinstance(block, View | Verdict):
            return replace(block, blocks=self.blocks(block.blocks))
        return self.table(block) if isinstance(block, Table) else block

    def table(self, table: Table) -> Table:
        """A table with the signs of its numbers; its fold tells its sums with theirs.

        Args:
            table: Its ``names`` say which numbers it has.
        """
        rows, folded, sums = [], table.folded, len(table.rows) - table.totals
        for row, cells in enumerate(table.rows):
            signed = [
                self._cell(cell, self.sign(table.name(row, column))) if any(map(str.isdigit, str(cell))) else cell
                for column, cell in enumerate(cells)
            ]
            if row >= sums:
                for before, after in zip(map(str, cells), map(str, signed), strict=True):
                    if before != after:
                        whole = rf"(?<![\w.+−-]){re.escape(before)}(?!\w|[.,]\d| [{BEYOND}{BARE}])"
                        folded = re.sub(whole, after, folded)
            rows.append(tuple(signed) if isinstance(cells, tuple) else signed)
        return replace(table, rows=rows, folded=folded)

    @staticmethod
    def _cell(cell: str | Cell, sign: Sign) -> str | Cell:
        if not sign.sign or not str(cell):
            return cell
        if isinstance(cell, Cell):
            return cell._replace(text=f"{cell.text} {sign.sign}", hint=" ".join(filter(None, (cell.hint, sign.why))))
        return Cell(cell, sign.sign, sign.why)

    @property
    def legend(self) -> Points | None:
        """What the signs that were given so far mean; None where none was."""
        lines = [f"{BEYOND} {each.text}." for each in self._extrapolated.values()]
        if self._bare:
            lines.append(f"{BARE} {_BARE} So: {', '.join(self._bare)}.")
        return Points(lines) if lines else None

    # --------------------------------------------------------------------------------------------------- plain data
    def data(self, document: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Which numbers of a document have a sign, by the reason for it.

        Args:
            document: As JSON has it.

        Returns:
            Records with the sign, the quantities, the keys of the inputs beyond their domain, the reasons, and the
            paths of the numbers; "*" stands for every place of a list.
        """
        found: dict[tuple[str, tuple[str, ...]], tuple[dict[str, None], list[str]]] = {}
        every: Counter[str] = Counter()
        for name, path, _ in placed(document):
            every[_pattern(path)] += 1
            sign = self.sign(name)
            if sign.sign:
                titles, paths = found.setdefault((sign.sign, sign.inputs), ({}, []))
                titles[sign.title] = None
                paths.append(path)
        texts = {each.key: f"{each.text}." for each in self.beyond}
        return [
            {
                "sign": sign,
                "quantities": list(titles),
                "beyond": list(inputs),
                "because": [*(texts[key] for key in inputs), *([_BARE] if BARE in sign else [])],
                "numbers": _shortened(paths, every),
            }
            for (sign, inputs), (titles, paths) in found.items()
        ]


def with_sign(text: str, sources: Mapping[str, Source], name: str) -> str:
    """A number in a sentence with its sign.

    Args:
        text: The number.
        sources: Of each value of the mission, by its dotted key.
        name: Dotted name of the number in the JSON.
    """
    return f"{text} {Marks.of(sources).sign(name).sign}".rstrip()


def marked(blocks: Iterable[Block], sources: Mapping[str, Source]) -> list[Block]:
    """Blocks with the signs of a mission's numbers, and below them what the signs mean.

    Args:
        blocks: Of a terminal or the studio.
        sources: Of each value of the mission, by its dotted key.
    """
    marks = Marks.of(sources)
    shown = marks.blocks(blocks)
    return shown if marks.legend is None else [*shown, View("Signs behind numbers", [marks.legend])]


def with_marks(document: dict[str, Any], sources: Mapping[str, Source]) -> dict[str, Any]:
    """A document of a mission with what is measured of mirror models, and with "marks": its numbers that have a sign.

    Args:
        document: As JSON has it.
        sources: Of each value of the mission, by its dotted key.
    """
    validated = {"mirror_model": [asdict(each) for each in foundation.measured(sources)]}
    return {**document, **validated, "marks": Marks.of(sources).data(document)}


def _inputs_of(kind: str) -> Sequence[str]:
    """The inputs that move a kind of figure; of one that the shipped mission has not, those of its quantity."""
    depends: Mapping[str, Sequence[str]] = shipped()["depends"]
    if kind in depends:
        return depends[kind]
    title = kind.partition(" | ")[0]
    return [key for other, keys in depends.items() if other.partition(" | ")[0] == title for key in keys]


def _pattern(path: str) -> str:
    return re.sub(r"(?<=\.)\d+(?=\.|$)", "*", path)


def _shortened(paths: Sequence[str], every: Mapping[str, int]) -> list[str]:
    """Paths, those that are all of a list as one."""
    found: dict[str, list[str]] = {}
    for path in paths:
        found.setdefault(_pattern(path), []).append(path)
    return [each for name, own in found.items() for each in ([name] if len(own) == every[name] else own)]
