"""The outputs of one row: from its runs to the residual, the links under it, and the day."""

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from microrad import fine_pointing, kernels, link, link_performance
from microrad.campaign.outputs import OUTPUTS
from microrad.fine_loop import ensemble
from microrad.mission import Mission
from microrad.missionfile import LinkFile, MissionFile

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pointing:
    """What pointing costs the communication link: the loss not exceeded but for the outage, and shares of the time."""

    outage_loss_db: float
    margin_db: float
    outage: float
    short: float


def outputs(file: MissionFile, runs: ensemble.Ensemble | None, keep: Collection[str]) -> dict[str, float]:
    """The kept outputs of a row, by name in the order of `OUTPUTS`.

    ``runs`` is None in a campaign without a loop. A link that no rate closes has a data rate of 0.
    """
    m = file.mission
    found = {} if runs is None else _residual(m, runs)
    groups = {OUTPUTS[name].group for name in keep}
    if groups & {"link", "day"}:
        pointing = _budgeted(m) if runs is None else _simulated(m, runs)
        found |= _links(file, pointing)
    if "day" in groups:
        found |= _day(file, pointing)
    return {name: found[name] for name in OUTPUTS if name in keep}


def exceeded(runs: ensemble.Ensemble) -> Floats:
    """Share of the time with a radial error of at least the lower edge of each bin, (bins,)."""
    counts = runs.histogram.sum(axis=0, dtype=np.int64)
    return np.asarray(1.0 - (np.cumsum(counts) - counts) / np.sum(counts))


# ------------------------------------------------------------------------------------------------------------ residual
def _residual(m: Mission, runs: ensemble.Ensemble) -> dict[str, float]:
    return {
        "residual_rms": runs.radial_rms_rad,
        "residual_quantile": runs.quantile_rad(fine_pointing.table(m).quantile),
        "residual_largest": float(np.max(runs.largest_rad)),
        "beyond_share": runs.beyond(m.requirement.pointing_error_rad),
        "lost_share": runs.share(kernels.COUNT_LOST),
        "saturated_share": runs.share(kernels.COUNT_SATURATED),
        "beyond_rate_share": runs.share(kernels.COUNT_CLAMPED),
        "outside_share": runs.share(kernels.COUNT_OUTSIDE),
    }


# --------------------------------------------------------------------------------------------------------------- links
def _on_axis_db(m: Mission) -> float:
    """Margin of the communication link pointed without error."""
    return link.received_on_axis_dbm(m) - float(link.required_dbm(m, m.communication.data_rate_bit_s))


def _simulated(m: Mission, runs: ensemble.Ensemble) -> Pointing:
    """As `link_performance.performance`, from the histogram of the radial error alone."""
    fall, ahead, on_axis = link.communication_beam(m).fall, link.point_ahead_rad(m), _on_axis_db(m)
    loss = float(fall.loss_db(runs.quantile_rad(1.0 - m.requirement.outage) + ahead))

    def short_of(margin_db: float) -> float:
        spare = on_axis - margin_db
        return 1.0 if spare < 0.0 else runs.beyond(fall.error_rad(spare) - ahead)

    return Pointing(loss, on_axis - loss, short_of(0.0), short_of(m.requirement.margin_db))


def _budgeted(m: Mission) -> Pointing:
    """Under the mission's own jitter, or at its pointing error where it gives none: there all or nothing is short."""
    under = link_performance.of_jitter(m)
    if under is not None:
        return Pointing(under.outage_loss_db, under.margin_db, under.outage, under.short)
    margin = float(link.margin_of_error(m, np.array([m.communication.pointing_error_rad]))[0])
    short = float(margin < m.requirement.margin_db)
    return Pointing(_on_axis_db(m) - margin, margin, float(margin < 0.0), short)


def _links(file: MissionFile, pointing: Pointing) -> dict[str, float]:
    m = file.mission
    return {
        "margin": pointing.margin_db,
        "outage": pointing.outage,
        "short": pointing.short,
        "data_rate": _rate(m, pointing.outage_loss_db),
        **_beams(_Beams((m.beacon, m.answer, m.terminals, m.conventions, m.channel, m.point_ahead), file)),
    }


@dataclass(frozen=True, slots=True)
class _Beams:
    """A mission for its beacon and answer, equal to another with the same tables: most rows draw something else."""

    tables: tuple[object, ...]
    file: MissionFile = field(compare=False)


@lru_cache(maxsize=256)
def _beams(of: _Beams) -> dict[str, float]:
    m, sources = of.file.mission, of.file.sources
    return {
        "beacon_margin": link.beacon_budget(m, sources).margin_db,
        "answer_margin": link.answer_budget(m, sources).margin_db,
    }


def _rate(m: Mission, loss_db: float) -> float:
    try:
        return link.rate_at_loss(m, m.requirement.margin_db, loss_db)
    except link.LinkError:
        return 0.0


# ----------------------------------------------------------------------------------------------------------------- day
def _day(file: MissionFile, pointing: Pointing) -> dict[str, float]:
    """What the relay takes under this pointing; nothing where the link has no contact."""
    from microrad import day_study, link_study  # orbits: slow to load, and few campaigns ask for them

    links = link_study.run(LinkFile(file.mission, file.path, file.text, file.sha256, file.sources))
    loss = day_study.PointingLoss(pointing.outage_loss_db, pointing.outage, "campaign")
    way = day_study.relay(links, loss)
    return {"volume": way.capacity_bit, "contact_time": way.contact_s}
