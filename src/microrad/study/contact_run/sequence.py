"""The order of a contact: slew, acquisition, data, and what follows a loss of lock; each step with its cause."""

from functools import partial

import numpy as np

from microrad import link, orbit
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link.acquisition import sequence as acquisition
from microrad.link.acquisition.partner_search import Finding, Found
from microrad.loop.controller_study import AnyDesign, AnyScene, FinePointingStudy
from microrad.mission.tables.acquisition import Acquisition
from microrad.mission.tables.operations import Operations
from microrad.orbit.day import DayStudy
from microrad.study.contact_run.records import Contact, ContactRun, Loss, Settings, Sight, State, Transition, Window
from microrad.study.contact_run.windows import Sampler, plan

_STATE_OF_STAGE = (*[State.BEACON] * 2, State.DETECT, *[State.ANSWER] * 3, *[State.LOCK] * 5)
"""Of the stages of an acquisition, wide or scanned: three to the detection, eight from the answer on."""


def run_contact(
    data: link.DataLink, finding: Finding, scene: AnyScene, design: AnyDesign, contact: Contact, settings: Settings
) -> ContactRun:
    """Run one contact from the slew to its end, under one controller of the mission's fine-pointing loop.

    The slew ends when the contact begins, or later where the body is not free early enough. Lock is lost where the
    margin stays below 0 dB for longer than the settings hold it, which the terminal learns after the light time there
    and back, or where the spot leaves its own optical sensor, which it knows at once. It then acquires again from the
    beacon on, in the state "re-acquire". The contact is over when an acquisition is given up after as many failures as
    the mission has attempts, or the data after as many losses in windows that follow each other.

    Args:
        data: The communication link.
        finding: The acquisition as the mission times it.
        scene: The fine-pointing loop of the mission.
        design: The controller with its gains.
        contact: Begin, end and geometry of the contact.
        settings: Slew, windows, attempts, way of acquisition and seed.

    Raises:
        ValueError: For a scan that the mission does not have, a data rate that is still to be solved for, and a
            geometry that gives no numbers.
    """
    found = finding.way(settings.way)
    if found is None:
        raise ValueError(
            'the mission has no table [acquisition.scan]: give it one, or run the contact by "wide beacon"'
        )
    sampler = Sampler(data, scene.table, scene.loop, design.controller, contact, settings)
    log = Log(contact)
    acquire = _Acquisitions(log, found, settings.attempts, settings.seed)
    windows: list[Window] = []
    if _turn(log, settings) and acquire():
        windows = _data(log, acquire, sampler)
    log.finish()
    return ContactRun(contact, tuple(log.entries), tuple(windows))


class Log:
    """The transitions of a contact, which ends with its last one."""

    def __init__(self, contact: Contact) -> None:
        """Idle until the first transition."""
        self.contact = contact
        self.entries: list[Transition] = []
        self.state = State.IDLE

    @property
    def since_s(self) -> float:
        """When the present state began."""
        return self.entries[-1].time_s

    def go(self, time_s: float, to: State, cause: str) -> bool:
        """Change the state, unless the contact ends before; whether the contact goes on.

        Args:
            time_s: Time of the change, in s.
            to: The new state.
            cause: Why it changes, in words.
        """
        if self.state == State.END:
            return False
        if time_s >= self.contact.end_s:
            time_s, to, cause = self.contact.end_s, State.END, f"the contact ends: {self.contact.ends}"
        self.entries.append(Transition(float(time_s), self.state, to, cause))
        self.state = to
        return to != State.END

    def finish(self) -> None:
        """Note the end of the contact where nothing else has ended it."""
        self.go(self.contact.end_s, State.END, "")


def _turn(log: Log, settings: Settings) -> bool:
    """The slew, ending with the begin of the contact where the body is free in time; whether the contact goes on."""
    contact, lasts = log.contact, settings.slew_angle_rad / settings.slew_rate_rad_s
    begin = max(contact.start_s - lasts, contact.free_from_s)
    late = max(begin + lasts - contact.start_s, 0.0)
    how = f"{format_quantity(settings.slew_angle_rad, 'rad')} at {format_quantity(settings.slew_rate_rad_s, 'rad/s')}"
    if late <= 1e-9 * max(lasts, 1.0):
        goes_on = log.go(begin, State.SLEW, f"{how}, so that the slew ends when the contact begins")
        return goes_on and log.go(contact.start_s, State.BEACON, f"the contact begins: {contact.begins}")
    goes_on = log.go(begin, State.SLEW, f"{how}, as soon as the body is free")
    after = f"{format_quantity(late, 's')} after the contact began: {contact.begins}"
    return goes_on and log.go(begin + lasts, State.BEACON, f"the slew ends {after}")


class _Acquisitions:
    """The acquisitions of a contact, each with random numbers of its own."""

    def __init__(self, log: Log, found: Found, attempts: int, seed: int) -> None:
        if len(found.stages) != len(_STATE_OF_STAGE):
            raise ValueError(
                f'the acquisition by "{found.name}" has {len(found.stages)} stages, a contact run knows the '
                f"{len(_STATE_OF_STAGE)} of the mission's sequence"
            )
        self.log, self.found, self.attempts, self.seed = log, found, attempts, seed
        self.place = {stage.name: i for i, stage in enumerate(found.stages)}
        self.number = 0

    def __call__(self) -> bool:
        """One acquisition from now on; whether it ends in data before the contact ends."""
        key = self.seed + (self.number << 64)  # Philox takes 128 bits; number 0 is the run of that seed by itself
        begin, again = self.log.since_s, self.number > 0
        self.number += 1
        for entry in acquisition.simulate_log(self.found.stages, self.attempts, key):
            if not self._step(begin + entry.time_s, entry, again):
                return False
        return True

    def _step(self, time_s: float, entry: acquisition.Transition, again: bool) -> bool:
        """Log one stage's end where it fails or changes the state; whether the contact goes on."""
        cause = f"{entry.stage}: {entry.cause}"
        if entry.to == acquisition.LOST:
            return self.log.go(time_s, State.END, f"acquisition given up after {self.attempts} failures; {cause}")
        if entry.to == acquisition.LOCKED:
            return self.log.go(time_s, State.DATA, cause)
        at, to = self.place[entry.stage], self.place[entry.to]
        before, after = _STATE_OF_STAGE[at], _STATE_OF_STAGE[to]
        if to > at and before == after:
            return time_s < self.log.contact.end_s or self.log.go(time_s, after, cause)
        if again:
            return self.log.go(time_s, State.REACQUIRE, f"{before} to {after}; {cause}")
        return self.log.go(time_s, after, cause)


def _data(log: Log, acquire: _Acquisitions, sampler: Sampler) -> list[Window]:
    """The windows of the data phase: those planned, and behind each loss of lock one at the begin of the new data.

    A planned window that would begin before the one behind a loss has ended is left out.
    """
    settings, end_s = sampler.settings, log.contact.end_s
    planned = plan(log.since_s, end_s, settings)
    found: list[Window] = []
    further, free_s = len(planned), log.since_s
    for (start, _), first in zip(planned, sampler.windows(planned), strict=True):
        window, losses = first, 0
        if start < free_s - 0.5 * sampler.loop.timing.period_s:
            continue
        while window is not None:
            found.append(window)
            free_s = window.start_s + settings.window_s
            if window.loss is None:
                break
            losses += 1
            if not _regain(log, acquire, window.loss, losses):
                return found
            window = sampler.window(further, log.since_s, min(settings.window_s, end_s - log.since_s))
            further += 1
    return found


def _regain(log: Log, acquire: _Acquisitions, lost: Loss, losses: int) -> bool:
    """Loss and re-acquisition; whether there is data again. As many losses in a row as attempts end the contact."""
    waited = format_quantity(lost.known_s - lost.time_s, "s", 3)
    known = f"the light has gone there and back, {waited}" if lost.known_s > lost.time_s else "seen by its own sensor"
    if not log.go(lost.time_s, State.LOSS, lost.cause):
        return False
    if losses >= acquire.attempts:
        return log.go(
            lost.known_s, State.END, f"given up after {losses} losses of lock in as many windows in a row; {known}"
        )
    return log.go(lost.known_s, State.REACQUIRE, known) and acquire()


def of_mission(
    o: Operations,
    a: Acquisition | None,
    data: link.DataLink,
    day: DayStudy,
    finding: Finding | None,
    fine: FinePointingStudy | None,
) -> ContactRun | None:
    """The run of `operations.contact` under the best controller.

    It is None where the mission lacks that table or what it needs.

    Args:
        o: The table on operations.
        a: The table on acquisition, None where the mission has none.
        data: The communication link.
        day: The day's geometry with its contacts.
        finding: The acquisition as the mission times it, None without one.
        fine: The study of the fine-pointing loop, None without one.

    Raises:
        ValueError: As `run_contact`.
    """
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
    return run_contact(data, finding, fine.scene, fine.best.design, _contact(day, asked.number - 1), settings)


def _contact(day: DayStudy, place: int) -> Contact:
    """One contact that the relay grants, with its geometry; the body is free from the end of the one before."""
    pair, chosen = day.view.pair, day.relay.contacts[place]
    free = day.relay.contacts[place - 1].end_s if place else pair.span_s[0]

    return Contact(chosen.start_s, chosen.end_s, chosen.begins, chosen.ends, free, partial(_geometry, pair))


def _geometry(pair: orbit.Pair, time_s: Floats) -> Sight:
    found = orbit.sight(pair.leo.orbit, pair.geo.orbit, np.ravel(time_s))
    shape = np.shape(time_s)
    return Sight(*(each.reshape(shape) for each in (found.range_m, found.rate_rad_s, found.point_ahead_rad)))
