"""Checks of what a day makes of its contacts: acquisitions drawn anew, rates by bisection, the run of a contact."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from microrad.report.verification.check import Check
from microrad.report.verification.checks.light import link
from microrad.report.verification.checks.orbit import relay_spans
from microrad.report.verification.checks.search import Floats, acquisitions
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Given, Workspace, with_values

_ROUNDING = "rounding"
_LIGHT_M_S = 299792458.0
_ACQUIRED, _SETS, _SIGMAS = 100_000, 4000, 5.0
_SELDOM = {  # the shipped mission hardly ever misses a contact, and has one rate
    "acquisition.attempts": "2",
    "acquisition.lock_probability": "0.6",
}
_RATES = (600e6, 450e6, 300e6, 100e6)


def _volumes(given: Given, lengths_s: Floats) -> Floats:
    """Least and most (sets, 2) of what the runs of a day could carry, of many days drawn anew."""
    waits = acquisitions(given, _ACQUIRED)
    draw, runs = np.random.default_rng(20_260_110), int(given("operations.runs"))
    chosen = waits[draw.integers(0, waits.size, (_SETS, runs, lengths_s.size))]
    totals = given("communication.data_rate") * np.maximum(lengths_s - chosen, 0.0).sum(axis=2)
    return np.stack([totals.min(axis=1), totals.max(axis=1)], axis=1)


def _seldom(workspace: Workspace) -> tuple[Given, Any]:
    """The mission with a lock that often fails, and its day by the relay."""
    from microrad.link.study import run_link_study
    from microrad.mission.file import load_link
    from microrad.orbit import day

    text = with_values(workspace.text, _SELDOM)
    path = workspace.folder / "seldom.toml"
    path.write_text(text, encoding="utf-8")
    links = run_link_study(load_link(path))
    return Given(text), day.relay(links, day.given_loss(links))


def _spread(workspace: Workspace) -> Iterator[Comparison]:
    """Least and most volume of the runs, and contacts without lock."""
    given, numbers = workspace.given, workspace.numbers("run")
    count = int(numbers["day.relay.contacts"])
    lengths = np.array([numbers[f"day.contacts.{k}.duration_s"] for k in range(count)])
    seldom, way = _seldom(workspace)
    own = np.array([end - begin for begin, end in relay_spans(seldom)])
    shipped = [numbers[f"day.relay.could_carry_{which}_bit"] for which in ("least", "most")]
    for what, of, obtained, slack_s in (
        ("shipped", _volumes(given, lengths), shipped, 0.0),
        ("lock often fails", _volumes(seldom, own), way.capacity_spread_bit, 3.0 * own.size),
    ):
        slack = given("communication.data_rate") * slack_s
        why = f"within the extremes of {_SETS} days drawn anew" + (", 3 s of each contact" if slack_s else "")
        for which, column, value in zip(("least", "most"), of.T, obtained, strict=True):
            low, high = float(column.min()) - slack, float(column.max()) + slack
            yield Comparison(
                f"run.day.relay.could_carry_{which}_bit",
                f"{which} volume of the runs, {what}",
                (low + high) / 2.0,
                float(value),
                (high - low) / 2.0,
                "bit",
                why,
            )
    runs = int(given("operations.runs"))
    for what, mission, size, missed in (
        ("shipped", given, lengths.size, numbers["day.relay.contacts_without_acquisition"]),
        ("lock often fails", seldom, own.size, way.failed_contacts),
    ):
        lost = float(np.mean(np.isinf(acquisitions(mission, _ACQUIRED))))
        # each run of the day draws from so many simulated acquisitions; both have their own binomial spread
        wide = 1.0 / runs / size + 1.0 / mission("acquisition.runs") + 1.0 / _ACQUIRED
        off = size * _SIGMAS * math.sqrt(max(lost * (1.0 - lost), 1.0 / _ACQUIRED) * wide)
        yield Comparison(
            "run.day.relay.contacts_without_acquisition",
            f"contacts without lock, mean of the runs, {what}",
            size * lost,
            float(missed),
            off,
            "",
            "five standard errors of the runs and of the acquisitions that they draw from",
        )


def _closing(given: Given, distance_m: float, loss_db: float) -> float:
    """Rate (bit/s) that just closes at a distance, by bisection of a budget made anew."""
    low, high = 1.0, 1e15
    for _ in range(200):
        middle = math.sqrt(low * high)
        budget = link(given, "Communication", distance=distance_m, data_rate=middle, pointing_error=0.0)
        low, high = (middle, high) if budget["margin_db"] - loss_db >= given("operations.margin") else (low, middle)
    return low


def _rates(workspace: Workspace) -> Iterator[Comparison]:
    """Rates at the ranges out to which they close, of the shipped mission and of one with several rates."""
    from microrad.link.study import run_link_study
    from microrad.mission.file import load_link
    from microrad.orbit.day import flow

    given, numbers, why = workspace.given, workspace.numbers("run"), _ROUNDING
    loss_db = numbers["day.pointing_loss_db"]
    rate = _closing(given, numbers["day.rates.0.largest_range_m"], loss_db)
    yield workspace.compared("run", "day.rates.0.rate_bit_s", rate, 1e-9 * rate, why)
    # radius that the errors leave for the outage: what the loop prints, not what the day was given
    best = workspace.study.fine_pointing.best.design.name
    radius = numbers[f"fine_pointing.controllers.{best}.simulated.given.quantile_rad"]
    half = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    fall = 20.0 * math.log10(math.e) * (radius / half) ** 2
    yield workspace.compared("run", "day.pointing_loss_db", fall, 1e-9 * fall, why)
    links = run_link_study(load_link(workspace.mission_path))
    own: Any = links.file.mission.operations
    several = own.with_value("rates_bit_s", list(_RATES))
    table: Any = flow.rate_table(flow.closings(several, links.data, flow.PointingLoss(loss_db, 0.0, "")))
    for distance_m in np.array([20e6, 30e6, 38e6, 43e6, 46e6, 54e6, 60e6, 90e6, 120e6]):
        most = _closing(given, distance_m, loss_db)
        expected = max((rate for rate in _RATES if rate <= most), default=0.0)
        what = f"rate in service at {distance_m / 1e6:g} Mm"
        obtained = float(table.rate_bit_s(distance_m))
        yield Comparison("run.day.rates.rate_bit_s", what, expected, obtained, 0.0, "bit/s", "a step")


def _run(workspace: Workspace) -> Iterator[Comparison]:
    """The run of a contact: states from the mission's text, margins of its windows by a budget made anew."""
    given, numbers = workspace.given, workspace.numbers("run")
    light_s = given("beacon.distance") / _LIGHT_M_S
    begin, end = relay_spans(given)[int(given("operations.contact.number")) - 1]
    slew_s = given("operations.contact.slew_angle") / given("operations.contact.slew_rate")
    tried = {  # none of this seed's acquisition fails
        "slew": slew_s,
        "beacon": given("acquisition.settle") + light_s,
        "detect": given("acquisition.detection_frames") * given("acquisition.detection"),
        "answer": given("acquisition.response") + light_s + given("acquisition.measurement"),
        "lock": given("acquisition.steering") + 2.0 * light_s + 2.0 * given("acquisition.lock"),
        "loss": 0.0,
        "re-acquire": 0.0,
    }
    why = "rounding of times of a day"
    for state, expected in tried.items():
        yield workspace.compared("run", f"contact.seconds_in_state.{state}", expected, 1e-9, why)
    acquired = sum(tried.values()) - slew_s
    why = "3 s at either end of a contact that is searched anew"
    yield workspace.compared("run", "contact.seconds_in_state.data", end - begin - acquired, 6.0, why)
    times = itertools.accumulate((begin - slew_s, *[tried[s] for s in ("slew", "beacon", "detect", "answer", "lock")]))
    for place, expected in enumerate((*times, end)):
        yield workspace.compared("run", f"contact.log.{place}.time_s", expected, 3.0, "3 s: a contact searched anew")
    half = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    windows, lasts = int(given("operations.contact.windows")), given("operations.contact.window")
    first, spare = numbers["contact.log.5.time_s"], numbers["contact.end_s"] - lasts - numbers["contact.log.5.time_s"]
    lost = 0
    for place in range(windows):
        name = f"contact.windows.{place}"
        expected = first + spare * place / (windows - 1)
        yield workspace.compared(
            "run", f"{name}.start_s", expected, given("fine_pointing.plant_step") * 25.0, "a sample"
        )
        yield workspace.compared("run", f"{name}.seconds", lasts, 1.0 / given("fine_pointing.rate"), "a sample")
        budget = link(given, "Communication", distance=numbers[f"{name}.range_m"], pointing_error=0.0)
        largest = numbers[f"{name}.largest_rad"]
        lowest = budget["margin_db"] - 20.0 * math.log10(math.e) * (largest / half) ** 2
        lost += lowest < 0.0
        why = "20 km of range in a window, 0.005 dB"
        yield workspace.compared("run", f"{name}.lowest_margin_db", lowest, 0.01, why)
        share = 0.0 if lowest > 0.01 else math.nan
        yield workspace.compared("run", f"{name}.share_below_0_db", share, 0.0, "the lowest margin is above 0 dB")
    yield workspace.compared("run", "contact.losses", lost, 0.0, "a count")


class _Relays:
    """Terminals of the relays, each with its session: satellite, begin, end of the view, and when it is looked at."""

    def __init__(self, given: Given, views: Sequence[tuple[int, int, float, float]], relays: int) -> None:
        """Of the mission's values, with the views (satellite, relay, begin, end) of the day."""
        self.views, self.relays, self.terminals = views, relays, int(given("constellation.terminals"))
        self.longest, self.shortest = given("constellation.session"), given("constellation.shortest")
        self.overhead = given("constellation.overhead")
        self.ended: dict[int, float] = {}
        self.had: dict[int, float] = {}
        self.busy: list[tuple[int, int, float, float, float]] = []
        self.sessions: list[tuple[int, int, float, float]] = []

    def first(self, relay: int, now: float) -> tuple[int, float] | None:
        """Who has waited longest for a relay, with the end of its view."""
        served = {satellite for satellite, *_ in self.busy}
        waiting = [
            (self.ended.get(satellite, 0.0), self.had.get(satellite, 0.0), satellite, end)
            for satellite, which, begin, end in self.views
            if which == relay and begin <= now < end and satellite not in served and end - now >= self.shortest
        ]
        return min(waiting)[2:] if waiting else None

    def end(self, session: tuple[int, int, float, float, float], now: float) -> None:
        """A session ends."""
        satellite, relay, begin, _, _ = session
        self.busy.remove(session)
        self.sessions.append((satellite, relay, begin, now))
        self.ended[satellite] = now
        self.had[satellite] = self.had.get(satellite, 0.0) + now - begin - self.overhead

    def take(self, relay: int, now: float) -> None:
        """Whoever has waited longest is served."""
        found = self.first(relay, now)
        if found is not None:
            satellite, until = found
            self.busy.append((satellite, relay, now, until, min(now + self.longest, until)))

    def fill(self, now: float) -> None:
        """No terminal is idle while somebody waits."""
        for relay in range(self.relays):
            while sum(s[1] == relay for s in self.busy) < self.terminals and self.first(relay, now):
                self.take(relay, now)

    def step(self, now: float) -> None:
        """All that happens at one moment."""
        for session in [s for s in self.busy if s[3] <= now]:
            self.end(session, now)
        self.fill(now)
        for session in sorted((s for s in self.busy if s[4] <= now), key=lambda s: s[1]):
            satellite, relay, begin, until, _ = session
            if self.first(relay, now) is None:
                self.busy[self.busy.index(session)] = (satellite, relay, begin, until, min(now + self.longest, until))
            else:
                self.take(relay, now)
                self.end(session, now)
        self.fill(now)


def _shared(workspace: Workspace) -> Iterator[Comparison]:
    """Sessions of the constellation from its views, moment by moment with all who wait sorted anew."""
    given, plan = workspace.given, workspace.study.plan
    of = plan.opportunities
    views = list(zip(of.satellite.tolist(), of.relay.tolist(), of.start_s.tolist(), of.end_s.tolist(), strict=True))
    shared = _Relays(given, views, len(plan.relays))
    turns = sorted({time for view in views for time in view[2:]})
    while turns or shared.busy:
        now = min([*turns[:1], *(session[4] for session in shared.busy)])
        turns = [time for time in turns if time > now]
        shared.step(now)
    rate, span = given("communication.data_rate"), given("orbit.duration")
    lasts = [(satellite, end - begin - shared.overhead) for satellite, _, begin, end in shared.sessions]
    yield workspace.compared("run", "constellation.sessions", len(lasts), 0.0, "a count")
    total = rate * sum(each for _, each in lasts)
    yield workspace.compared("run", "constellation.volume_bit", total, 1e-9 * total, _ROUNDING)
    for place, name in enumerate(plan.satellites):
        own = [each for satellite, each in lasts if satellite == place]
        key = f"constellation.satellites.{name}"
        yield workspace.compared("run", f"{key}.sessions", len(own), 0.0, "a count")
        yield workspace.compared("run", f"{key}.with_data_s", sum(own), 1e-6, "rounding of times of a day")
        yield workspace.compared("run", f"{key}.volume_bit", rate * sum(own), 1e-9 * total, _ROUNDING)
    for place, name in enumerate(plan.relays):
        busy = sum(end - begin for _, relay, begin, end in shared.sessions if relay == place)
        yield workspace.compared("run", f"constellation.relays.{name}.use", busy / span, 1e-9, _ROUNDING)


CHECKS = (
    Check(
        "acquisitions-of-a-day",
        "Volume of the runs of a day and contacts without lock, by acquisitions drawn anew",
        Referent.INDEPENDENT,
        "Stages from the mission's text, another generator; the shipped mission and one whose lock often fails.",
        "binomial distribution",
        _spread,
    ),
    Check(
        "rates",
        "Rates that close at a range, and what pointing costs the day",
        Referent.INDEPENDENT,
        "The rate of a budget made anew is bisected; the fall of a Gaussian beam at the radius that the loop leaves.",
        "range equation",
        _rates,
    ),
    Check(
        "contact-run",
        "The run of a contact in time",
        Referent.INDEPENDENT,
        "Sums of the mission's times from a contact that is searched anew; margins by the budget made anew.",
        "SPIE 11852, 118523B, section 2.1",
        _run,
    ),
    Check(
        "sessions",
        "Sessions of the constellation from the views of its satellites",
        Referent.INDEPENDENT,
        "At each moment all who wait are sorted anew; the product keeps queues.",
        "the rule in docs/day.md",
        _shared,
    ),
)
