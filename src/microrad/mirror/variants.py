"""A mission's mirror with each of its variants assembled once: what everything that goes on with the mirror takes."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from microrad.mirror.hysteresis import LINE_OF_SIGHT, BoucWen, PrandtlIshlinskii, gain_only, scaled
from microrad.mirror.model import Mirror, from_mission, hysteresis_model
from microrad.mission.model import Mission
from microrad.mission.tables import mirror as mirror_table


class Variant(StrEnum):
    """The mission's mirror, its comparison model, and the mirror with a gain in place of its hysteresis."""

    GIVEN = "given"
    COMPARISON = "comparison"
    STRAIGHT = "no hysteresis"

    __repr__ = str.__repr__


@dataclass(frozen=True, slots=True)
class MirrorAxis:
    """One axis of a variant: its hysteresis model, and the plant with it."""

    model: BoucWen | PrandtlIshlinskii
    plant: Mirror


@dataclass(frozen=True, slots=True)
class MirrorParts:
    """A mission's mirror by variant, one axis each, and the table that it came from.

    ``own`` has the mirror's own angle as output, ``line_of_sight`` that of the line of sight, which is
    ``line_of_sight_per_own`` times as large. Without hysteresis, ``own`` has the slow gain, and ``line_of_sight`` the
    gain for slow sines of the amplitude that the scenario tracks.
    """

    table: mirror_table.Mirror
    own: Mapping[Variant, MirrorAxis]
    line_of_sight: Mapping[Variant, MirrorAxis]
    line_of_sight_per_own: float

    @property
    def drive_range_v(self) -> tuple[float, float]:
        """Lowest and highest drive of the identification, about the bias (V)."""
        return self.table.drive_min_v - self.table.bias_v, self.table.drive_max_v - self.table.bias_v


def of(m: Mission) -> MirrorParts:
    """Assemble the mission's mirror in each variant that it has."""
    table, doubled = m.mirror, LINE_OF_SIGHT[m.conventions.mirror_angle]
    models = {
        variant: hysteresis_model(source, table.rate_limit_v_s, table.bias_v)
        for variant, source in ((Variant.GIVEN, table), (Variant.COMPARISON, table.comparison))
        if source is not None
    }

    @cache
    def axis(model: BoucWen | PrandtlIshlinskii, times: float) -> MirrorAxis:
        return MirrorAxis(model, from_mission(table, model, times=times))

    turned = {variant: scaled(model, doubled) for variant, model in models.items()}
    models[Variant.STRAIGHT] = gain_only(models[Variant.GIVEN])
    turned[Variant.STRAIGHT] = gain_only(turned[Variant.GIVEN], m.scenario.amplitude_rad)
    return MirrorParts(
        table,
        {variant: axis(model, 1.0) for variant, model in models.items()},
        {variant: axis(model, doubled) for variant, model in turned.items()},
        doubled,
    )
