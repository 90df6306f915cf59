"""How far two values of one quantity may lie apart on two machines: each kind of quantity, and where it stands.

On one machine with the same versions nothing may: every quantity is the same to the last bit. Elsewhere sums are made
in another order, and products are rounded once or twice. What that does depends on how a quantity comes about.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

from microrad.mirror.hysteresis import slow_gain
from microrad.orbit.visibility.events import TOLERANCE_S
from microrad.study.study import Study

APART = 2.0
"""Steps by which a statistic of one run may move: 3.5 standard deviations of what two roundings differ by.

Two roundings to steps of q, independent of each other, differ by q / sqrt(6) rms about an axis and by 0.58 q over both.
"""


@dataclass(frozen=True, slots=True)
class ConverterSteps:
    """What one step of a converter does to the results of a mission.

    A conversion that falls to the other side moves the loop by a step, and from there on others fall otherwise.
    ``step_rad`` is the largest step of all converters as an angle, 0 where all are ideal; ``runs`` counts those of the
    fine-pointing loop, and ``rms_rad`` and ``full_rad`` are its least and largest radial rms. ``run_db`` and
    ``runs_db`` are what the communication link loses where the error that is allowed moves by `run_rad` and `runs_rad`.
    ``acquisitions`` and ``days`` count the simulated ones.
    """

    step_rad: float
    runs: int
    allowed_rad: float
    rms_rad: float
    full_rad: float
    run_db: float
    runs_db: float
    rate_bit_s: float
    acquisitions: int
    days: int

    @property
    def run_rad(self) -> float:
        """Distance by which rms and quantile of one run may move."""
        return APART * self.step_rad

    @property
    def runs_rad(self) -> float:
        """The same of all runs together, whose roundings are independent of each other."""
        return self.run_rad / math.sqrt(self.runs)


def converter_steps(study: Study) -> ConverterSteps:
    """The steps of the converters of a study's mission, and what they do to its results."""
    m, fine = study.file.mission, study.fine_pointing
    step, runs = _step_rad(study), 1 if m.fine_pointing is None else m.fine_pointing.runs
    allowed = m.requirement.pointing_error_rad
    return ConverterSteps(
        step_rad=step,
        runs=runs,
        allowed_rad=allowed,
        rms_rad=allowed if fine is None else fine.optimum_rad,
        full_rad=allowed if fine is None else fine.budget.full_rad,
        run_db=_lost_db(study, APART * step),
        runs_db=_lost_db(study, APART * step / math.sqrt(runs)),
        rate_bit_s=m.communication.data_rate_bit_s,
        acquisitions=1 if m.acquisition is None else m.acquisition.runs,
        days=1 if m.operations is None else m.operations.runs,
    )


def _step_rad(study: Study) -> float:
    m, gain = study.file.mission, abs(slow_gain(study.summary.model))
    steps = [gain * m.control.drive_resolution_v, m.control.sensor_resolution_rad]
    if (fine := m.fine_pointing) is not None:
        gauge = 0.0 if fine.strain_gauge is None else fine.strain_gauge.resolution_rad
        steps += [gain * fine.drive_resolution_v, fine.optical_sensor.resolution_rad, gauge]
    return max(steps)


def _lost_db(study: Study, more_rad: float) -> float:
    m = study.file.mission
    at, loss = m.requirement.pointing_error_rad, study.links.data.beam.fall.loss_db
    return float(loss(at + more_rad)) - float(loss(at))


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Two values are the same up to a share of the larger, and up to a distance in their unit ("" has none)."""

    relative: float = 0.0
    distance: Mapping[str, float] = field(default_factory=dict)

    def allowed(self, was: float, now: float, unit: str) -> float:
        """The distance up to which two values are the same.

        Args:
            was: one value.
            now: the other one.
            unit: their unit, "" for none.
        """
        return self.relative * max(abs(was), abs(now)) + self.distance.get(unit, 0.0)


END_S = 10.0 * TOLERANCE_S
"""Distance of two times: each end of a contact is found to `TOLERANCE_S`, and sums have several."""
SMOOTH = 1e-6
"""Share by which a simulation without a converter's steps may move: each of some million steps loses up to 1e-16."""


def tolerances(s: ConverterSteps) -> dict[str, Tolerance]:
    """The tolerance of each kind of quantity, for a mission with converters of these steps."""
    return {
        # Counts, and numbers of the mission. Gains are tuned to four digits, and agree in them.
        "exact": Tolerance(),
        # Some hundred operations in double precision lose 1e-13 of the largest term, 300 dB; searches end at 1e-9.
        "formula": Tolerance(1e-8, {"dB": 1e-8, "dBm": 1e-8, "rad": 1e-12, "": 1e-12}),
        # Riccati equations and eigenvalues lose up to nine digits (seen: 2e-7 between processors).
        "linear theory": Tolerance(1e-5, {"rad": 1e-12, "": 1e-5}),
        # A total's growth is a difference at 1e-3 of it, of numbers known to 1e-9; searches for a size end at 1e-5 of a
        # range that reaches as far as 10 times the total.
        "searched": Tolerance(1e-4, {"rad": 1e-12, "": 1e-5}),
        "orbit": _orbit(),
        # One run: a conversion that falls to the other side moves it by steps of its converters.
        "run": Tolerance(SMOOTH, {"rad": s.run_rad}),
        # All runs together: their roundings are independent of each other.
        "runs": Tolerance(SMOOTH, {"rad": s.runs_rad}),
        # The worst of all samples: 7 standard deviations of what two roundings differ by, where a statistic has 3.5.
        "largest": Tolerance(SMOOTH, {"rad": 2.0 * s.run_rad}),
        # The spread of n runs is itself known to 1 / sqrt(2 n): a tenth of that.
        "interval": Tolerance(SMOOTH + 0.1 / math.sqrt(2.0 * s.runs)),
        # A ratio of two rms, each of all runs.
        "gain": Tolerance(SMOOTH, {"": 2.0 * s.runs_rad / s.rms_rad}),
        # The root of a difference of two squares, each of all runs: sqrt(2 x rms x 2 distances).
        "added": Tolerance(SMOOTH, {"rad": 2.0 * math.sqrt(s.full_rad * s.runs_rad)}),
        "link": _link(s),
        # A Gaussian tail far out falls by a factor e within a sixteenth of the error that is allowed.
        "fades": Tolerance(0.25),
        # Four of the acquisitions drawn fall to the other side of their probability.
        "drawn": Tolerance(4.0 / s.acquisitions, {"": 4.0 / s.acquisitions}),
        # A mean count of the days drawn: in one of them it is one more or less.
        "failed": Tolerance(0.0, {"": 1.0 / s.days}),
        # The simulated loss says at which range a rate closes. Over a contact the range changes by 2 dB, so a dB takes
        # half of all, and five times as much of what is left where most is lost.
        "volume": Tolerance(SMOOTH + 5.0 * s.runs_db, {"s": END_S, "bit": FASTEST_BIT_S * END_S}),
        # Where the residual is small the converters' noise is all of it: as its estimate from all runs.
        "spectrum": Tolerance(4.0 / math.sqrt(s.runs)),
    }


FASTEST_BIT_S = 1e9
"""Data rate beyond which no link of these missions goes."""


def _orbit() -> Tolerance:
    """What lies within `END_S`: a satellite goes 8 km/s, turns by up to 1 mrad/s, its Doppler shift by 10 MHz/s."""
    distance = {"m": 8e3, "rad": 1e-3, "deg": 0.1, "Hz": 1e7, "bit": FASTEST_BIT_S, "s": 1.0}
    return Tolerance(1e-8, {unit: END_S * rate for unit, rate in distance.items()})


def _link(s: ConverterSteps) -> Tolerance:
    """What steps of converters cost the link: in dB at the error that is allowed, and 1 % where the error is larger.

    A share of the time moves as that of a sine that just passes the limit A: within x of its peaks, sqrt(2 x / A) / pi.
    """
    share = math.sqrt(2.0 * s.run_rad / s.allowed_rad) / math.pi
    rate = s.rate_bit_s * (10.0 ** (2.0 * s.run_db / 10.0) - 1.0)
    return Tolerance(0.01, {"rad": s.run_rad, "dB": 2.0 * s.run_db, "bit/s": rate, "": share})


# ------------------------------------------------------------------------------------------------------ where they hold
SUMMARY: Mapping[str, tuple[str, ...]] = {
    "drawn": ("links.acquisition.ways[].{simulated_success_probability,simulated_mean_time_s}",),
    "fades": ("performance[].{fades_per_s,mean_fade_s}",),
    "failed": ("day.{relay,direct,optical}.contacts_without_acquisition",),
    "largest": ("fine_pointing.controllers[].simulated.*.largest_rad", "contact.windows[].largest_rad"),
    "interval": ("fine_pointing.controllers[].simulated.*.rms_interval_rad",),
    "gain": ("fine_pointing.{rms_gained_over_baseline,rms_left_to_gain.baseline_with_hysteresis}",),
    "added": ("fine_pointing.error_budget.differences[].added_rms_rad",),
    "searched": ("error_budget[].sources[].{weight,contribution_rad,total_without_it_rad,may_be_times}",),
    "exact": (
        "error_budget[].{window_s,spacing_s,observation_s,confidence,limit_rad}",
        "{residual,runs[],fine_pointing.sines[]}.frequency_hz",
        "runs[].{rate_clamped,saturated,slew_limited,alternating}",
        "links.acquisition.ways[].runs",
        "day.{duration_s,outage,rates[].rate_bit_s,relay.contacts,direct.contacts,optical.contacts}",
        "contact.{losses,windows[].seconds}",
        "constellation.{contacts,sessions,satellites[].sessions,stations[].sessions,duration_s}",
        "fine_pointing.{quantile,required_rad,controllers[].parameters[].value}",
    ),
    "linear theory": (
        "fine_pointing.{linear_bound_rms_rad,rms_left_to_gain.linear_at_baseline,rms_left_to_gain.linear_at_nearest}",
        "fine_pointing.controllers[].{theory_rms_rad,theory_rms_by_source_rad.*,margins.*}",
        "fine_pointing.error_budget.parts[].theory_rms_rad",
        "error_budget[].{mean_rad,sigma_rad}[]",
        "error_budget[].{by_rules_rad,by_distribution_rad}",
        "error_budget[].sources[].{mean_rad,sigma_rad}[]",
    ),
    "run": (
        "{residual,runs[]}.{peak_rad,rms_rad,used_rad}",
        "contact.windows[].{rms_rad,quantile_rad}",
        "other_readings[].residual_rad",
    ),
    "runs": (
        "fine_pointing.{controllers[].simulated.*,sines[]}.{rms_rad,quantile_rad,axis_rms_rad[]}",
        "fine_pointing.error_budget.{*_rms_rad,parts[].rms_rad}",
    ),
    "link": (
        "margin_db.{judged,communication_at_residual}",
        "{requirements,papers_loop}[].{required,actual,margin}",
        "{other_readings[].margin_db,performance[].*,hysteresis_costs[].*}",
        "day.{pointing_loss_db,rates[].margin_db,rates[].largest_range_m}",
        "contact.windows[].{lowest_margin_db,share_below_0_db}",
        "fine_pointing.controllers[].simulated.*.shares.*",
    ),
    "volume": (
        "day.contacts[].could_carry_bit",
        "day.{relay,direct,optical}.{could_carry_bit,could_carry_least_bit,could_carry_most_bit,arrived_bit,lost_bit}",
        "day.{relay,direct,optical}.{on_board_at_end_bit,latency_median_s,latency_99_percent_s}",
        "day.{assumptions[].*,sky.sites[].drawn,sky.any_clear_drawn}",
        "contact.{seconds_in_state.*,log[].time_s}",
        "constellation.{volume_bit,relays[].use,satellites[].with_data_s,satellites[].volume_bit}",
        "constellation.stations[].{use,volume_bit}",
    ),
    "orbit": (
        "day.{contacts[].*,direct.passes[].*,optical.passes[].*,visible_share,median_contact_s,closed_form_contact_s}",
        "day.{relay,direct,optical}.{contact_s,longest_gap_s,generated_bit}",
        "contact.{start_s,end_s,windows[].start_s,windows[].range_m,windows[].point_ahead_rad,windows[].rate_rad_s}",
        "constellation.satellites[].longest_gap_s",
    ),
    "formula": (
        "margin_db.{beacon,answer,communication_as_budgeted,communication_static}",
        "{largest_data_rate_bit_s,largest_pointing_error_rad,implied_sensitivity_photon_bit[],links.*}",
        "fine_pointing.stroke.*",
        "day.sky.{any_clear,any_clear_independent,sites[].availability,correlation[][]}",
    ),
}
"""Where each kind of number stands in a summary, the first that fits: [] is any place of a list, * any name or names,
{a,b} either."""

FIGURES: Mapping[str, tuple[str, ...]] = {
    "exact": ("claims-scan",),
    "formula": ("fig2-margin-map", "{tornado,tornado-answer,tornado-beacon}", "wide-beam-or-scan", "interleaver"),
    "linear theory": ("fine-pointing-sensitivity", "pointing-errors-{distribution,spectrum}"),
    "searched": ("pointing-errors-contributions",),
    "orbit": ("along-contact", "day-timeline", "world-map"),
    "run": ("comparison", "fig5-hysteresis-loops", "fig6-pid", "fig8-inverse", "fig4-chirp", "fig5-bench-loops"),
    "added": ("fine-pointing-budget", "fine-pointing-errors"),
    "link": ("contact-run",),
    "volume": ("assumptions", "optical-assumptions", "data-volume"),
    "spectrum": ("fine-pointing-spectrum",),
    "curve": ("monte-carlo-tail", "latency"),
}
"""The kind of each figure's data, that of its column which may move most.

A curve has its points where the data are, so that its rows are others elsewhere: its quantiles stand in the summary.
"""


@cache
def stated(place: str) -> str | None:
    """The kind of a number of the summary by its place there, or None where no tolerance is stated for it."""
    return _kind_at(SUMMARY, re.sub(r"\[\d+\]", "[]", place))


@cache
def stated_for_figure(name: str) -> str | None:
    """The kind of a figure's data by its name, or None."""
    return _kind_at(FIGURES, name)


def _kind_at(table: Mapping[str, tuple[str, ...]], place: str) -> str | None:
    fits = (kind for kind, places in table.items() for each in places if _pattern(each).fullmatch(place))
    return next(fits, None)


@cache
def _pattern(text: str) -> re.Pattern[str]:
    either = re.sub(r"\{(.*?)\}", lambda found: f"(?:{found[1].replace(',', '|')})", text.replace(".", r"\."))
    return re.compile(either.replace("[]", r"\[\]").replace("*", ".+"))


# ---------------------------------------------------------------------------------------------------------------- units
_ENDING = re.compile(r"_(photon_bit|rad_s2|rad_s|m_s|bit_s|rad|db|hz|bit|m|s)$")


def unit_of(place: str) -> str:
    """The unit that the last key with one has at its end, or ""."""
    for key in reversed(re.sub(r"\[\d+\]", "", place).split(".")):
        if found := _ENDING.search(key):
            unit = found[1]
            return {"db": "dB", "hz": "Hz", "rad_s2": "rad/s^2"}.get(unit, "/".join(unit.rsplit("_", 1)))
    return ""
