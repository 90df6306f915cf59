"""The contact that a mission names, run with its own orbits, acquisition and fine-pointing loop."""

from functools import partial

import numpy as np

from microrad import link, orbit
from microrad.core.arrays import Floats
from microrad.link.acquisition.partner_search import Finding
from microrad.loop.fine_pointing import FinePointingStudy
from microrad.mission.tables.acquisition import Acquisition
from microrad.mission.tables.operations import Operations
from microrad.orbit.day import DayStudy
from microrad.study.contact_run.records import Contact, ContactRun, Settings, Sight
from microrad.study.contact_run.sequence import run


def of_mission(
    o: Operations,
    a: Acquisition | None,
    data: link.DataLink,
    day: DayStudy,
    finding: Finding | None,
    fine: FinePointingStudy | None,
) -> ContactRun | None:
    """The run of `operations.contact` under the best controller; None without that table or what it needs."""
    asked = o.contact
    if asked is None or a is None or finding is None or fine is None or not day.relay.contacts:
        return None
    settings = Settings(
        slew_angle_rad=asked.slew_angle_rad,
        slew_rate_rad_s=asked.slew_rate_rad_s,
        windows=asked.windows,
        window_s=asked.window_s,
        settle_s=fine.scene.table.settle_s,
        hold_s=asked.hold_s,
        seed=o.seed,
        attempts=a.attempts,
        way=o.acquisition,
    )
    return run(data, finding, fine.scene, fine.best.design, _contact(day, asked.number - 1), settings)


def _contact(day: DayStudy, place: int) -> Contact:
    """One contact that the relay grants, with its geometry; the body is free from the end of the one before."""
    pair, chosen = day.view.pair, day.relay.contacts[place]
    free = day.relay.contacts[place - 1].end_s if place else pair.span_s[0]

    return Contact(chosen.start_s, chosen.end_s, chosen.begins, chosen.ends, free, partial(_geometry, pair))


def _geometry(pair: orbit.Pair, time_s: Floats) -> Sight:
    found = orbit.sight(pair.leo.orbit, pair.geo.orbit, np.ravel(time_s))
    shape = np.shape(time_s)
    return Sight(*(each.reshape(shape) for each in (found.range_m, found.rate_rad_s, found.point_ahead_rad)))
