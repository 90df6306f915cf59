"""The outputs of one row: from its runs to the residual, the links under it, and the day."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from microrad import link
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.core import kernels
from microrad.core.arrays import Floats, Integers
from microrad.link.fade_series.of_mission import fading_of
from microrad.link.pointing.outage import Exposure, stated_outage
from microrad.link.requirement import IMPOSSIBLE
from microrad.loop import controller_study
from microrad.loop.pointing_loop import ensemble
from microrad.mission.file import LinkFile
from microrad.mission.model import Mission, Source
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.mission.tables.link import Beacon, LinkRequirement
from microrad.study.pointing_penalty import Binned

if TYPE_CHECKING:
    from microrad.orbit import day as day_study


def outputs(file: LinkFile, runs: ensemble.Ensemble | None, keep: Collection[str]) -> dict[str, float]:
    """The kept outputs of a row, by name in the order of `OUTPUTS`; nothing is computed, or read, for any other.

    A link that no rate closes has a data rate of 0. Raises `LinkError` for a link by whose budget more light arrives
    than was sent.

    Args:
        file: the row's mission.
        runs: its runs of the loop, None in a campaign without one.
        keep: names of the outputs.
    """
    m = file.mission
    known: dict[str, Callable[[], float]] = {}
    if runs is not None:
        assert isinstance(m, Mission)  # it has the loop
        known = _residual(m.requirement, m.fine_pointing, runs)
    data = cache(lambda: link.of(m))
    under = cache(lambda: _exposure(data(), runs))
    day = cache(lambda: _day(file, under()))
    known |= {
        "margin": lambda: under().margin_db,
        "margin_under_fades": lambda: _margin_under_fades(file, data()),
        "outage": lambda: under().short_of(0.0),
        "short": lambda: under().short_of(m.requirement.margin_db),
        "data_rate": lambda: _rate(data(), under().outage_loss_db),
        "beacon_margin": lambda: _beam_margin(_Beam.of("beacon", link.Shared.of(m), m.beacon, file.sources)),
        "answer_margin": lambda: _beam_margin(_Beam.of("answer", link.Shared.of(m), m.answer, file.sources)),
        "volume": lambda: day().capacity_bit,
        "contact_time": lambda: day().contact_s,
        "optical_volume": lambda: _optical_bit(file),
    }
    return {name: known[name]() for name in OUTPUTS if name in keep}


def exceeded(runs: ensemble.Ensemble) -> Floats:
    """Share of the time with a radial error of at least the lower edge of each bin, (bins,)."""
    counts = _counts(runs)
    return np.asarray(1.0 - (np.cumsum(counts) - counts) / np.sum(counts))


def _counts(runs: ensemble.Ensemble) -> Integers:
    return np.asarray(np.sum(runs.histogram, axis=0, dtype=np.int64))


# ------------------------------------------------------------------------------------------------------------ residual
def _residual(
    required: LinkRequirement, table: FinePointing | None, runs: ensemble.Ensemble
) -> dict[str, Callable[[], float]]:
    return {
        "residual_rms": lambda: runs.radial_rms_rad,
        "residual_quantile": lambda: runs.quantile_rad(controller_study.table(table).quantile),
        "residual_largest": lambda: float(np.max(runs.largest_rad)),
        "beyond_share": lambda: runs.beyond(required.pointing_error_rad),
        "lost_share": lambda: runs.share(kernels.COUNT_LOST),
        "saturated_share": lambda: runs.share(kernels.COUNT_SATURATED),
        "beyond_rate_share": lambda: runs.share(kernels.COUNT_CLAMPED),
        "outside_share": lambda: runs.share(kernels.COUNT_OUTSIDE),
    }


# --------------------------------------------------------------------------------------------------------------- links
def _exposure(data: link.DataLink, runs: ensemble.Ensemble | None) -> Exposure:
    """The link under its own errors, or under those of runs, from the histogram of the radial error alone."""
    if runs is None:
        under = Exposure.stated(data)
    else:
        quantile_rad = runs.quantile_rad(1.0 - stated_outage(data.requirement))
        under = Exposure.of(data, quantile_rad, runs.beyond, lambda: Binned.of(_counts(runs)))
    if not under.possible:
        raise link.LinkError(IMPOSSIBLE)
    return under


@dataclass(frozen=True, slots=True)
class _Beam:
    """A beacon or answer with what its budget reads, equal to another with the same tables: most rows draw others."""

    name: str
    tables: tuple[object, ...]
    shared: link.Shared = field(compare=False)
    beam: Beacon | None = field(compare=False)
    sources: Mapping[str, Source] = field(compare=False)

    @classmethod
    def of(cls, name: str, shared: link.Shared, beam: Beacon | None, sources: Mapping[str, Source]) -> "_Beam":
        """The beam; of point-ahead it is told by the angle that is left alone."""
        air = None if shared.sky is None else (shared.sky, shared.outage)
        tables = beam, shared.point_ahead_rad, shared.terminals, shared.conventions, air
        return cls(name, tables, shared, beam, sources)


@lru_cache(maxsize=256)
def _beam_margin(of: _Beam) -> float:
    found = link.beam_budget(of.name, of.shared, of.beam, of.sources)
    if not found.possible:
        raise link.LinkError(f"{of.name}: {IMPOSSIBLE}")
    return found.margin_db


def _margin_under_fades(file: LinkFile, data: link.DataLink) -> float:
    found = fading_of(data, file.path.parent, file.sources)
    assert found is not None  # the campaign file's own check
    return found.margin_left_db


def _rate(data: link.DataLink, loss_db: float) -> float:
    try:
        return link.rate_at_loss(data, data.requirement.margin_db, loss_db)
    except link.LinkError:
        return 0.0


# ----------------------------------------------------------------------------------------------------------------- day
def _optical_bit(file: LinkFile) -> float:
    """What the optical downlink could carry."""
    from microrad.orbit import day as day_study

    way = day_study.optical_alone(file)
    assert way is not None  # the campaign file's own check
    return way.capacity_bit


def _day(file: LinkFile, under: Exposure) -> "day_study.Way":
    """What the relay takes under this pointing; nothing where the link has no contact."""
    from microrad.link import study as link_study
    from microrad.orbit import day as day_study

    links = link_study.run_link_study(file)
    loss = day_study.PointingLoss(under.outage_loss_db, under.short_of(0.0), "campaign")
    return day_study.relay(links, loss)
