"""Named codes: rate, threshold and the source that prints both, from `codes.toml`."""

import difflib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from importlib import resources
from statistics import NormalDist
from types import MappingProxyType
from typing import Any

from microrad.core.units import parse_quantity
from microrad.mission.fields import UNKNOWN

_BISECTIONS = 60


@dataclass(frozen=True, slots=True)
class NamedCode:
    """A code with what its source prints of it.

    `rate` is information bits per bit sent, headers counted. One of four says what it needs: `threshold_db`, the Eb/N0
    (dB) of a bit of information with two or four phases in Gaussian noise; `weights`, information weights of the paths
    of a convolutional code by their distance, of which the threshold follows; `gap_db`, power over that of capacity
    (dB); or none of them, where no source prints it. `ratios` are the least and the most bit error ratio behind the
    decoder for which that holds. `modulations` are those that the source states it for, and those alike in it.
    """

    name: str
    title: str
    modulations: tuple[str, ...]
    rate: float
    ratios: tuple[float, float]
    threshold_db: float | None
    weights: tuple[tuple[int, int], ...]
    gap_db: float | None
    source: str

    @property
    def known(self) -> bool:
        """Whether a source prints what it needs."""
        return self.threshold_db is not None or bool(self.weights) or self.gap_db is not None

    @property
    def regime(self) -> str:
        """What its threshold holds for, in words."""
        if self.gap_db is not None:
            return f"{self.title}: {self.gap_db:g} dB from capacity, in one link, is taken for any order and background"
        if self.weights:
            return f"{self.title}: union bound over its paths, Gaussian noise, no quantisation"
        return f"{self.title}: Gaussian noise, no loss in synchronisation"

    def holds_at(self, bit_error_ratio: float) -> bool:
        """Whether what the source prints holds at a bit error ratio behind the decoder."""
        least, most = self.ratios
        return least * (1.0 - 1e-9) <= bit_error_ratio <= most * (1.0 + 1e-9)

    def net_gain_db(self, bit_error_ratio: float) -> float:
        """What it saves of the power for a bit of information against none, at the same ratio and data rate.

        Without a code two or four phases need Eb/N0 = Q^2 / 2 for erfc(Q / sqrt 2) / 2. A code with `gap_db` has none.

        Args:
            bit_error_ratio: Behind the decoder; one that it `holds_at`.
        """
        threshold_db = self.threshold_db
        if threshold_db is None:
            threshold_db = 10.0 * math.log10(self._union_eb_n0(bit_error_ratio))
        deviate = -NormalDist().inv_cdf(bit_error_ratio)
        return 10.0 * math.log10(deviate**2 / 2.0) - threshold_db

    def _union_eb_n0(self, bit_error_ratio: float) -> float:
        """Eb/N0 at which the union over its paths, sum of w Q(sqrt(2 d R Eb/N0)), is the ratio: enough, if anything."""

        def errors(eb_n0: float) -> float:
            return sum(w * math.erfc(math.sqrt(d * self.rate * eb_n0)) / 2.0 for d, w in self.weights)

        low, high = 0.1, 100.0
        for _ in range(_BISECTIONS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if errors(middle) > bit_error_ratio else (low, middle)
        return high


@cache
def codes() -> Mapping[str, NamedCode]:
    """All named codes by their names."""
    text = (resources.files("microrad.mission") / "codes.toml").read_text(encoding="utf-8")
    return MappingProxyType({name: _code(name, table) for name, table in tomllib.loads(text).items()})


def nearest(name: str) -> str:
    """What to write in place of a name that no code has: the names nearest to it, or all that can be chosen.

    Args:
        name: The name that no code has.
    """
    known = [each.name for each in codes().values() if each.known]
    near = difflib.get_close_matches(name[:60].lower(), known, n=3, cutoff=0.5)
    return " or ".join(f'code = "{each}"' for each in near or known)


def _code(name: str, table: Mapping[str, Any]) -> NamedCode:
    rate = float(Fraction(table["rate"]))
    threshold = table.get("threshold", UNKNOWN)
    threshold_db = None if threshold == UNKNOWN else parse_quantity(threshold, "dB")
    if "threshold_symbol" in table:  # Es/N0 of a symbol of two bits
        threshold_db = parse_quantity(table["threshold_symbol"], "dB") - 10.0 * math.log10(2.0 * rate)
    most = table.get("bit_error_ratio_up_to", table.get("bit_error_ratio", math.nan))
    return NamedCode(
        name=name,
        title=table["title"],
        modulations=tuple(table["modulations"]),
        rate=rate,
        ratios=(table.get("bit_error_ratio", 0.0), most),
        threshold_db=threshold_db,
        weights=tuple((int(distance), weight) for distance, weight in table.get("weights", {}).items()),
        gap_db=parse_quantity(table["gap"], "dB") if "gap" in table else None,
        source=table["source"],
    )
