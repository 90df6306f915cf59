"""The drawn inputs and the design variables of a campaign file, read by the rules of the mission's own keys."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from microrad.campaign.definition import distributions
from microrad.campaign.definition.distributions import AnyTable, Distribution
from microrad.campaign.definition.keys import MIRROR, Key, as_one, find, item_keys, within
from microrad.campaign.definition.records import Cell, Draw, Variable
from microrad.campaign.definition.tables import VariableTable
from microrad.campaign.definition.values import NotedError, ValueReader, is_number, quoted_near
from microrad.campaign.records import InputText
from microrad.mirror import coupled
from microrad.mirror.coupled import CoupledMirror
from microrad.mirror.spread import parameter_units
from microrad.mission.fields import MOST_ITEMS, Quantity, Several, Share
from microrad.mission.toml import shown


@dataclass(frozen=True, slots=True)
class DrawReader:
    """Reads [inputs] against the raw data of the mission.

    ``cells`` are those of the grid; ``given`` are the keys of other tables.
    """

    reader: ValueReader
    data: Mapping[str, Any]
    cells: tuple[Cell, ...]
    given: frozenset[str]

    def draw(self, key: str, raw: object) -> Draw:
        """One input. Raises `NotedError` with what is wrong noted.

        Args:
            key: the input's key of the mission.
            raw: its table under [inputs].
        """
        at = f"inputs.{key}"
        table = self._distribution_table(at, raw)
        if key == MIRROR or isinstance(table, distributions.IdentifiedTable):
            return self._identified(at, key, table)
        found = self.reader.key("inputs", key, None, self.data)
        if not isinstance(table, distributions.ListTable):
            found = as_one(found, within(self.data, key))
        wanted = self._mostly_inside(at, found, table)
        drawn_as = None if table.drawn_as is None else self._drawn_as(f"{at}.drawn_as", found, table.drawn_as, wanted)
        return Draw(key, found.unit, wanted, drawn_as)

    def _distribution_table(self, at: str, raw: object) -> AnyTable:
        kinds = list(distributions.TABLES)
        choices = " or ".join(f'distribution = "{kind}"' for kind in kinds)
        if not isinstance(raw, dict):
            raise self.reader.fault(at, raw, "is no table", f"[{at}] with {choices}")
        kind = raw.get("distribution")
        if kind is None:
            raise self.reader.fault(f"{at}.distribution", None, "is missing", choices)
        if not isinstance(kind, str) or kind not in kinds:
            near = quoted_near(kind, kinds)
            raise self.reader.fault(f"{at}.distribution", kind, "is none of the choices", choices, near)
        return self.reader.table(at, distributions.TABLES[kind], raw)  # type: ignore[return-value]

    def _identified(self, at: str, key: str, table: AnyTable) -> Draw:
        """The mirrors that the identification leaves possible, in every cell."""
        if key != MIRROR or not isinstance(table, distributions.IdentifiedTable):
            expected = f'[inputs.{MIRROR}] with distribution = "identified", or the key of a single value'
            raise self.reader.fault(at, None, "does not go together with its distribution", expected)
        for cell in self.cells:
            if cell.several_axes is not None:
                self._is_known(at, cell.several_axes)
                continue
            m = cell.mirror
            if m is None or m.uncertainty is None:
                reason = "is to be identified, but the mission has no mirror, only its links"
                if m is not None:
                    reason = f'is to be identified, but the mirror "{m.name}" has no table uncertainty'
                expected = (
                    f'[set] with {MIRROR} = "FILE", or [grid] with {MIRROR} = ["FILE"]: a mirror file as microrad '
                    "identify writes it, seen from the campaign file"
                )
                raise self.reader.fault(at, None, reason, expected)
            for parameter in m.uncertainty.parameters:
                if f"{MIRROR}.{parameter}" in self.given:
                    reason = f"draws {MIRROR}.{parameter}, which the campaign gives too"
                    raise self.reader.fault(at, None, reason, "one of the two removed")
        return Draw(MIRROR, "", None, None)

    def _is_known(self, at: str, mirror: CoupledMirror) -> None:
        """That a mirror of several axes can be drawn."""
        if mirror.known is None:
            reason = f'is to be identified, but the mirror "{mirror.mirror.name}" has no table uncertainty'
            expected = "a mirror file as microrad identify writes it in fine_pointing.mirror_file"
            raise self.reader.fault(at, None, reason, expected)
        try:
            coupled.draws(mirror, _TRIED, 0)
        except ValueError as error:
            raise self.reader.fault(at, None, str(error), "standard errors that leave a mirror") from None

    def _drawn_as(self, at: str, key: Key, raw: object, wanted: Distribution) -> Distribution:
        table = self._distribution_table(at, raw)
        if isinstance(table, distributions.IdentifiedTable) or table.drawn_as is not None:
            reason = "is no distribution that an input can be drawn as"
            raise self.reader.fault(at, None, reason, "a normal one, for example")
        found = self._mostly_inside(at, key, table)
        if reason := distributions.uncovered(wanted, found):
            raise self.reader.fault(at, None, reason, "a distribution that reaches as far as the input's own")
        return found

    def _mostly_inside(self, at: str, key: Key, table: AnyTable) -> Distribution:
        """The distribution of a table, unless most of its draws are none that the key takes."""
        found = self._distribution(at, key, table)
        share, where = outside_of(key, found)
        if share > 0.5:
            raise self.reader.fault(at, None, f"has {_percent(share)} of its draws {where}", _INSIDE)
        return found

    def _distribution(self, at: str, key: Key, table: AnyTable) -> Distribution:
        """The distribution of a table, its quantities read by the rule of the key."""
        if isinstance(table, distributions.ListTable):
            return self._one_of(at, key, table)
        rule = key.numeric
        if isinstance(key.rule, Several):
            own = within(self.data, key.text)
            items = " and ".join(item_keys(key.text, len(own))) if isinstance(own, list) else ""
            expected = f"{items or 'a list that the mission has'}, each with its distribution"
            raise self.reader.fault(at, None, "is a list, whose items are drawn each by its own key", expected)
        if rule is None:
            expected = 'distribution = "table" with its values, or a grid of them'
            raise self.reader.fault(at, None, "is not a quantity that takes any value in a range", expected)
        if isinstance(table, distributions.NormalTable):
            positive = Quantity(rule.unit, rule.typical, above=0.0)
            values = {"mean": (rule, table.mean), "deviation": (positive, table.deviation)}
            return distributions.Normal(*self.reader.numbers(at, values))
        assert not isinstance(table, distributions.IdentifiedTable)
        is_log = table.distribution == "log-uniform"
        kind = distributions.LogUniform if is_log else distributions.Uniform
        return kind(*bounds_of(self.reader, at, rule, table.low, table.high, is_log))

    def _one_of(self, at: str, key: Key, table: distributions.ListTable) -> Distribution:
        at, values, weights = f"{at}.values", table.values, f"{at}.weights"
        if not isinstance(values, list) or not 0 < len(values) <= MOST_ITEMS:
            raise self.reader.fault(at, values, "is not a list with something in it", f"1 to {MOST_ITEMS} values")
        fitting = [value for value in values if self.reader.fits(at, key, value)]
        if len(fitting) < len(values):
            raise NotedError
        read: list[Any] = [value if key.rule is None else key.rule.read(value) for value in values]
        if any(isinstance(value, float) and math.isnan(value) for value in read):
            expected = "values, or this word in the mission"
            raise self.reader.fault(at, values, "has a word that is solved for", expected)
        if any(read.count(value) > 1 for value in read):
            raise self.reader.fault(at, values, "has a value twice", "each value once, with its weight")
        is_words = not all(is_number(value) for value in read)
        numbers = tuple(float(i) for i in range(1, len(read) + 1)) if is_words else tuple(float(v) for v in read)
        shares = self._shares(weights, table.weights, len(read))
        return distributions.OneOf(numbers, shares, tuple(values), is_words)

    def _shares(self, at: str, weights: object, count: int) -> tuple[float, ...]:
        if weights is None:
            return (1.0 / count,) * count
        if not isinstance(weights, list) or len(weights) != count or not all(is_number(v) and v > 0 for v in weights):
            expected = f"{count} plain numbers above 0, one for each value"
            raise self.reader.fault(at, weights, "does not give each value its weight", expected)
        total = math.fsum(weights)
        return tuple(float(v) / total for v in weights)


_TRIED = 8
"""Mirrors of several axes that are drawn before any row is, to see that there are such mirrors."""

_INSIDE = 'a smaller deviation, or distribution = "uniform" or "log-uniform" between bounds'


class Outside(NamedTuple):
    """Share of the draws that a key does not take, and where they are."""

    share: float
    where: str


def outside_of(key: Key, drawn: Distribution) -> Outside:
    """The draws beyond the bounds of a key by itself; only a normal distribution has any: others end within them.

    Args:
        key: the key, with its bounds.
        drawn: what its values are drawn from.
    """
    from scipy.special import ndtr

    rule = key.numeric
    if rule is None or not isinstance(drawn, distributions.Normal):
        return Outside(0.0, "")
    above, below = (0.0 if rule.least is None else None, rule.below) if isinstance(rule, Share) else (rule.above, None)
    ends = (
        (-1.0, above, "not above"),
        (-1.0, rule.least, "below"),
        (1.0, rule.most, "above"),
        (1.0, below, "not below"),
    )
    parts = [
        (float(ndtr(sign * (drawn.mean - end) / drawn.deviation)), f"{word} {distributions.quantity(end, key.unit)}")
        for sign, end, word in ends
        if end is not None
    ]
    total = math.fsum(share for share, _ in parts)
    return Outside(total, " or ".join(where for share, where in parts if share > 0.01 * total))


def failing(draws: tuple[Draw, ...], data: Mapping[str, Any], rows: int) -> Iterator[str]:
    """Of inputs that are drawn beyond the bounds of their key: how many rows fail for it, unless it is hardly one.

    Args:
        draws: the inputs.
        data: the mission's raw data.
        rows: rows of a cell at most.
    """
    for draw in draws:
        drawn = draw.drawn_as or draw.distribution
        if drawn is None:
            continue  # an identification draws again what is no mirror
        share, where = outside_of(as_one(find(draw.key, data), within(data, draw.key)), drawn)
        if share * rows >= _HARDLY:
            yield (
                f"{_percent(share)} of the draws of {draw.key} are {where}: those rows will fail, and the results will "
                f"be those of the others; {_INSIDE} avoids it"
            )


_HARDLY = 0.01
"""Expected number of failing rows below which nothing is said."""


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %" if share >= 0.1 else f"{100.0 * share:.2g} %"


def bounds_of(
    reader: ValueReader, at: str, rule: Quantity, raw_low: object, raw_high: object, is_log: bool = False
) -> tuple[float, float]:
    """The keys low and high of a table in SI units. Raises `NotedError` with what is wrong noted.

    Args:
        reader: where faults are noted.
        at: the key of the table.
        rule: what the values may be.
        raw_low: the lower bound as written.
        raw_high: the upper one.
        is_log: whether the scale between them is logarithmic.
    """
    low, high = reader.numbers(at, {"low": (rule, raw_low), "high": (rule, raw_high)})
    if low >= high:
        raise reader.fault(f"{at}.high", raw_high, f"is not above low ({shown(raw_low)})", "a range that goes up")
    if is_log and low <= 0.0:
        expected = 'a value above 0, or distribution = "uniform"'
        raise reader.fault(f"{at}.low", raw_low, "is not above 0, so that it has no logarithm", expected)
    return low, high


def variable(reader: ValueReader, key: str, table: VariableTable, data: Mapping[str, Any]) -> Variable:
    """One design variable. Raises `NotedError` with what is wrong noted.

    Args:
        reader: where faults are noted.
        key: the variable's key of the mission.
        table: its bounds as written.
        data: the mission's raw data.
    """
    at, found = f"optimise.variables.{key}", reader.key("optimise.variables", key, None, data)
    if found.numeric is None:
        reason = "is not a quantity that takes any value in a range"
        raise reader.fault(at, None, reason, "the key of a quantity")
    return Variable(key, found.unit, *bounds_of(reader, at, found.numeric, table.low, table.high))


def input_texts(draws: tuple[Draw, ...], cells: Sequence[Cell]) -> tuple[InputText, ...]:
    """The drawn columns in words; an identified mirror has one for each parameter of any cell's mirror.

    Of several axes it has one for each direction that its parameters move in: those are hundreds, and move together.

    Args:
        draws: the inputs.
        cells: those of the grid.
    """
    found: list[InputText] = []
    for draw in draws:
        if draw.distribution is None:
            found += _identified_texts(cells)
            continue
        words = draw.distribution.words(draw.unit)
        instead = "" if draw.drawn_as is None else f"; drawn as {draw.drawn_as.words(draw.unit)} and weighted"
        found.append(InputText(draw.key, draw.unit, words + instead))
    return tuple(found)


def _identified_texts(cells: Sequence[Cell]) -> list[InputText]:
    found: dict[str, InputText] = {}
    for cell in cells:
        table, several = cell.mirror, cell.several_axes
        if several is not None and several.known is not None:
            words = f"of {len(cell.directions)} standard normal numbers for {len(several.known.parameters)} parameters"
            for number, name in enumerate(cell.directions, 1):
                found.setdefault(name, InputText(name, "", f"identified, {number} {words}"))
            continue
        assert table is not None and table.uncertainty is not None
        errors = table.uncertainty.standard_errors
        for (key, unit), error in zip(parameter_units(table).items(), errors, strict=True):
            text = f"identified, standard error {100.0 * error:.3g} %"
            found.setdefault(key, InputText(f"{MIRROR}.{key}", unit, text))
    return list(found.values())
