"""The drawn inputs and the design variables of a campaign file, read by the rules of the mission's own keys."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from microrad.campaign.definition import distributions
from microrad.campaign.definition.distributions import AnyTable, Distribution
from microrad.campaign.definition.keys import MIRROR, Key, as_one, find, item_keys, within
from microrad.campaign.definition.records import Draw, Variable
from microrad.campaign.definition.tables import VariableTable
from microrad.campaign.definition.values import ValueReader, is_number, quoted_near
from microrad.campaign.records import InputText
from microrad.mirror.spread import parameter_units
from microrad.mission.fields import MOST_ITEMS, Quantity, Several, Share
from microrad.mission.file import check_table
from microrad.mission.tables.mirror import Mirror
from microrad.mission.toml import shown


@dataclass(frozen=True, slots=True)
class DrawReader:
    """Reads [inputs] against the raw data of the mission.

    ``mirrors`` are those of the cells, None where a mission has links alone; ``given`` are the keys of other tables.
    """

    reader: ValueReader
    data: Mapping[str, Any]
    mirrors: tuple[Mirror | None, ...]
    given: frozenset[str]

    def draw(self, key: str, raw: object) -> Draw | None:
        """One input, or None with what is wrong noted."""
        at = f"inputs.{key}"
        table = self._distribution_table(at, raw)
        if table is None:
            return None
        if key == MIRROR or isinstance(table, distributions.IdentifiedTable):
            return self._identified(at, key, table)
        found = self.reader.key("inputs", key, None, self.data)
        if found is not None and not isinstance(table, distributions.ListTable):
            found = as_one(found, within(self.data, key))
        distribution = None if found is None else self._mostly_inside(at, found, table)
        if found is None or distribution is None:
            return None
        if table.drawn_as is None:
            return Draw(key, found.unit, distribution, None)
        drawn_as = self._drawn_as(f"{at}.drawn_as", found, table.drawn_as, distribution)
        return Draw(key, found.unit, distribution, drawn_as)

    def _distribution_table(self, at: str, raw: object) -> AnyTable | None:
        kinds = list(distributions.TABLES)
        choices = " or ".join(f'distribution = "{kind}"' for kind in kinds)
        if not isinstance(raw, dict):
            self.reader.fault(at, raw, "is no table", f"[{at}] with {choices}")
            return None
        kind = raw.get("distribution")
        if not isinstance(kind, str) or kind not in kinds:
            reason = "is missing" if kind is None else "is none of the choices"
            self.reader.fault(
                f"{at}.distribution", kind, reason, choices, "" if kind is None else quoted_near(kind, kinds)
            )
            return None
        return check_table(replace(self.reader.document, prefix=at), distributions.TABLES[kind], raw)  # type: ignore[return-value]

    def _identified(self, at: str, key: str, table: AnyTable) -> Draw | None:
        """The mirrors that the identification leaves possible, in every cell."""
        if key != MIRROR or not isinstance(table, distributions.IdentifiedTable):
            expected = f'[inputs.{MIRROR}] with distribution = "identified", or the key of a single value'
            self.reader.fault(at, None, "does not go together with its distribution", expected)
            return None
        for m in self.mirrors:
            if m is None or m.uncertainty is None:
                reason = "is to be identified, but the mission has no mirror, only its links"
                if m is not None:
                    reason = f'is to be identified, but the mirror "{m.name}" has no table uncertainty'
                expected = (
                    f'[set] with {MIRROR} = "FILE", or [grid] with {MIRROR} = ["FILE"]: a mirror file as microrad '
                    "identify writes it, seen from the campaign file"
                )
                self.reader.fault(at, None, reason, expected)
                return None
            twice = next((f"{MIRROR}.{p}" for p in m.uncertainty.parameters if f"{MIRROR}.{p}" in self.given), "")
            if twice:
                self.reader.fault(at, None, f"draws {twice}, which the campaign gives too", "one of the two removed")
                return None
        return Draw(MIRROR, "", None, None)

    def _drawn_as(self, at: str, key: Key, raw: object, wanted: Distribution) -> Distribution | None:
        table = self._distribution_table(at, raw)
        if table is None:
            return None
        if isinstance(table, distributions.IdentifiedTable) or table.drawn_as is not None:
            self.reader.fault(at, None, "is no distribution that an input can be drawn as", "a normal one, for example")
            return None
        found = self._mostly_inside(at, key, table)
        if found is not None and (reason := distributions.uncovered(wanted, found)):
            self.reader.fault(at, None, reason, "a distribution that reaches as far as the input's own")
            return None
        return found

    def _mostly_inside(self, at: str, key: Key, table: AnyTable) -> Distribution | None:
        """The distribution of a table, unless most of its draws are none that the key takes."""
        found = self._distribution(at, key, table)
        if found is None or (outside := outside_of(key, found)).share <= 0.5:
            return found
        self.reader.fault(at, None, f"has {_percent(outside.share)} of its draws {outside.where}", _INSIDE)
        return None

    def _distribution(self, at: str, key: Key, table: AnyTable) -> Distribution | None:
        """The distribution of a table, its quantities read by the rule of the key."""
        if isinstance(table, distributions.ListTable):
            return self._one_of(at, key, table)
        rule = key.numeric
        if isinstance(key.rule, Several):
            own = within(self.data, key.text)
            items = " and ".join(item_keys(key.text, len(own))) if isinstance(own, list) else ""
            advice = f"{items or 'a list that the mission has'}, each with its distribution"
            self.reader.fault(at, None, "is a list, whose items are drawn each by its own key", advice)
            return None
        if rule is None:
            advice = 'distribution = "table" with its values, or a grid of them'
            self.reader.fault(at, None, "is not a quantity that takes any value in a range", advice)
            return None
        if isinstance(table, distributions.NormalTable):
            mean = self.reader.number(f"{at}.mean", rule, table.mean)
            spread = self.reader.number(
                f"{at}.deviation", Quantity(rule.unit, rule.typical, above=0.0), table.deviation
            )
            return None if mean is None or spread is None else distributions.Normal(mean, spread)
        assert not isinstance(table, distributions.IdentifiedTable)
        is_log = isinstance(table, distributions.LogUniformTable)
        bounds = bounds_of(self.reader, at, rule, (table.low, table.high), is_log)
        kind = distributions.LogUniform if is_log else distributions.Uniform
        return None if bounds is None else kind(*bounds)

    def _one_of(self, at: str, key: Key, table: distributions.ListTable) -> Distribution | None:
        values = table.values
        if not isinstance(values, list) or not 0 < len(values) <= MOST_ITEMS:
            self.reader.fault(f"{at}.values", values, "is not a list with something in it", f"1 to {MOST_ITEMS} values")
            return None
        fitting = [value for value in values if self.reader.fits(f"{at}.values", key, value)]
        if len(fitting) < len(values):
            return None
        read: list[Any] = [value if key.rule is None else key.rule.read(value) for value in values]
        if any(isinstance(value, float) and math.isnan(value) for value in read):
            self.reader.fault(
                f"{at}.values", values, "has a word that is solved for", "values, or this word in the mission"
            )
            return None
        if any(read.count(value) > 1 for value in read):
            self.reader.fault(f"{at}.values", values, "has a value twice", "each value once, with its weight")
            return None
        is_words = not all(is_number(value) for value in read)
        numbers = tuple(float(i) for i in range(1, len(read) + 1)) if is_words else tuple(float(v) for v in read)
        weights = self._weights(f"{at}.weights", table.weights, len(read))
        return None if weights is None else distributions.OneOf(numbers, weights, tuple(values), is_words)

    def _weights(self, at: str, raw: object, count: int) -> tuple[float, ...] | None:
        if raw is None:
            return (1.0 / count,) * count
        expected = f"{count} plain numbers above 0, one for each value"
        if not isinstance(raw, list) or len(raw) != count or not all(is_number(v) and v > 0 for v in raw):
            self.reader.fault(at, raw, "does not give each value its weight", expected)
            return None
        total = math.fsum(raw)
        return tuple(float(v) / total for v in raw)


_INSIDE = 'a smaller deviation, or distribution = "uniform" or "log-uniform" between bounds'


class Outside(NamedTuple):
    """Share of the draws that a key does not take, and where they are."""

    share: float
    where: str


def outside_of(key: Key, drawn: Distribution) -> Outside:
    """The draws beyond the bounds of a key by itself; only a normal distribution has any: others end within them."""
    from scipy.special import ndtr

    rule = key.numeric
    if rule is None or not isinstance(drawn, distributions.Normal):
        return Outside(0.0, "")
    above, below = (0.0, rule.below) if isinstance(rule, Share) else (rule.above, None)
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
    """Of inputs that are drawn beyond the bounds of their key: how many rows fail for it, unless it is hardly one."""
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
    reader: ValueReader, at: str, rule: Quantity, raw: tuple[object, object], is_log: bool = False
) -> tuple[float, float] | None:
    """The keys low and high of a table in SI units, or None with what is wrong noted."""
    low, high = (reader.number(f"{at}.{name}", rule, value) for name, value in zip(("low", "high"), raw, strict=True))
    if low is None or high is None:
        return None
    if low >= high:
        reader.fault(f"{at}.high", raw[1], f"is not above low ({shown(raw[0])})", "a range that goes up")
        return None
    if is_log and low <= 0.0:
        advice = 'a value above 0, or distribution = "uniform"'
        reader.fault(f"{at}.low", raw[0], "is not above 0, so that it has no logarithm", advice)
        return None
    return low, high


def variable(reader: ValueReader, key: str, table: VariableTable, data: Mapping[str, Any]) -> Variable | None:
    """One design variable, or None with what is wrong noted."""
    found = reader.key("optimise.variables", key, None, data)
    if found is None:
        return None
    at = f"optimise.variables.{key}"
    if found.numeric is None:
        reader.fault(at, None, "is not a quantity that takes any value in a range", "the key of a quantity")
        return None
    bounds = bounds_of(reader, at, found.numeric, (table.low, table.high))
    return None if bounds is None else Variable(key, found.unit, *bounds)


def input_texts(draws: tuple[Draw, ...], mirrors: Sequence[Mirror | None]) -> tuple[InputText, ...]:
    """The drawn columns in words; an identified mirror has one for each parameter of any cell's mirror."""
    found: list[InputText] = []
    for draw in draws:
        if draw.distribution is None:
            found += _identified_texts(mirrors)
            continue
        words = draw.distribution.words(draw.unit)
        instead = "" if draw.drawn_as is None else f"; drawn as {draw.drawn_as.words(draw.unit)} and weighted"
        found.append(InputText(draw.key, draw.unit, words + instead))
    return tuple(found)


def _identified_texts(mirrors: Sequence[Mirror | None]) -> list[InputText]:
    found: dict[str, InputText] = {}
    for table in mirrors:
        assert table is not None and table.uncertainty is not None
        errors = table.uncertainty.standard_errors
        for (key, unit), error in zip(parameter_units(table).items(), errors, strict=True):
            text = f"identified, standard error {100.0 * error:.3g} %"
            found.setdefault(key, InputText(f"{MIRROR}.{key}", unit, text))
    return list(found.values())
