"""What any input that is taken must keep; each check raises AssertionError with what is broken."""

import math
import traceback
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from microrad import link
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.ledger import chunk_format
from microrad.campaign.records import Chunk
from microrad.core.budget import total_db
from microrad.lab.bench.plan import Plan
from microrad.lab.recording import Recording
from microrad.link import study
from microrad.link.error_budget import Requirement, shares
from microrad.link.error_budget import budget as error_budget
from microrad.link.error_budget.assembly import correlations_of, requirement_of, source_of, sources_of
from microrad.link.fade_series import CodedLink, FadeSeries, code, coded_fading
from microrad.link.pointing import outage
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.mirror import Mirror, coupled
from microrad.mission.file import LinkFile, load_coupled_mirror
from microrad.mission.source_list import ListedSource
from microrad.mission.tables.error_budget import ErrorBudget
from microrad.orbit.base import Orbit
from microrad.orbit.propagation.mean_elements import ElementSet, Sgp4Orbit

_TIMES_S = np.array([-3600.0, -60.0, 0.0, 60.0, 3600.0])
_FREQUENCIES_HZ = np.array([0.0, 0.1, 10.0, 1e3, 1e5])
_ROUNDING_DB = 1e-6


def finite(what: str, values: Any) -> None:
    """Numbers are finite.

    Args:
        what: What they are, for the message.
        values: The numbers, of any shape.
    """
    assert np.all(np.isfinite(values)), f"{what}: not finite"


def probability(what: str, value: float) -> None:
    """A probability is one, or nan where there is none.

    Args:
        what: What it is, for the message.
        value: The probability.
    """
    assert math.isnan(value) or 0.0 <= value <= 1.0, f"{what}: {value!r} is no probability"


class DocumentedError(ValueError):
    """A plain ValueError that a function of microrad raises itself: its docstring says so."""


def documented(error: ValueError) -> ValueError:
    """The error as a refusal where microrad raised it itself; else as it is, as one that slipped through from below."""
    frames = traceback.extract_tb(error.__traceback__)
    return DocumentedError(str(error)) if "/microrad/" in frames[-1].filename else error


# --------------------------------------------------------------------------------------------------------------- links
def links(file: LinkFile) -> None:
    """Budgets add up, and the margin falls with distance, with the pointing error and with jitter."""
    solved = study.solve_rate(file)
    data, shared = link.of(solved.mission), link.Shared.of(solved.mission)
    budgets = [study.communication_budget(data, solved.sources)]
    for name in ("beacon", "answer"):
        table = getattr(solved.mission, name)
        if table is not None:
            budgets.append(link.beam_budget(name, shared, table, solved.sources))
    for budget in budgets:
        _adds_up(budget)
    margin = outage.margin_db(data)
    assert math.isclose(margin, budgets[0].margin_db, rel_tol=1e-9, abs_tol=_ROUNDING_DB), "margin: not its budget's"
    own = data.table
    if own.distance_m is not None:  # else it follows from an altitude and an elevation
        _falls("distance", margin, data, own.with_value("distance_m", 1.1 * own.distance_m))
    if data.jitter is None:
        error = 1.1 * own.pointing_error_rad + 1e-9
        if data.beam.fall.loss_db(error) < link.DEEPEST_DB:  # further out there are side lobes
            _falls("pointing error", margin, data, own.with_value("pointing_error_rad", error))
        return
    probability("outage", outage.Exposure.stated(data).short_of(0.0))
    wider = data.jitter.model_copy(update={"rms_rad": tuple(1.1 * each for each in data.jitter.rms_rad)})
    moved = link.assembled(shared, own, data.requirement, wider)
    assert outage.margin_db(moved) <= margin + _ROUNDING_DB, "margin: rises with jitter"


def _adds_up(budget: link.LinkBudget) -> None:
    finite(f"{budget.name} budget", [line.value for line in (*budget.lines, *budget.totals)])
    received = total_db(budget.lines)
    required = 10.0 * math.log10(budget.required_power_w) + 30.0
    assert _near(received - required, budget.margin_db), f"{budget.name}: the margin is not the difference"
    power = 10.0 ** (received / 10.0 - 3.0)
    assert math.isclose(power, budget.received_power_w, rel_tol=1e-9), f"{budget.name}: lines are not the power"


def _near(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-9, abs_tol=_ROUNDING_DB)


def _falls(what: str, margin: float, data: link.DataLink, table: Any) -> None:
    moved = link.assembled(data.shared, table, data.requirement, data.jitter)
    assert outage.margin_db(moved) <= margin + _ROUNDING_DB, f"margin: rises with {what}"


# ------------------------------------------------------------------------------------------------------------- mirrors
def plant(found: Mirror) -> None:
    """A mirror has finite matrices, and a finite response that a step does not set off.

    Its linear part does not run away: no pole is right of the imaginary axis.
    """
    for name in ("A", "B", "E", "F", "G", "C", "D", "K"):
        finite(f"matrix {name}", getattr(found, name))
    finite("response", found.frequency_response(_FREQUENCIES_HZ))


def several_axes(found: coupled.CoupledMirror) -> None:
    """A mirror of several axes that is written is the same when it is read again."""
    text = coupled.text(found)
    again = coupled.of(load_coupled_mirror("mirror.toml", text=text))
    assert coupled.text(again) == text, "a mirror file that is written and read is another one"


# ------------------------------------------------------------------------------------------------ plans and campaigns
def plan(found: Plan) -> None:
    """Each drive of a plan is finite and within its limits, and its time runs forward."""
    low, high = found.limits.drive_min_v, found.limits.drive_max_v
    slack = 1e-9 * (1.0 + abs(low) + abs(high))
    for each in found.records:
        drive = each.excitation.drive
        finite(f"drive {each.excitation.name}", drive)
        assert drive.ndim == 2 and drive.shape[0] > 0, "a drive without samples"
        assert low - slack <= drive.min() and drive.max() <= high + slack, "a drive beyond its limits"
        assert math.isfinite(each.excitation.rate_hz) and each.excitation.rate_hz > 0.0, "a rate that is none"


def campaign(found: CampaignFile) -> None:
    """Each distribution of a campaign gives finite values that rise with the share of draws below them."""
    share = np.array([1e-6, 0.1, 0.5, 0.9, 1.0 - 1e-6])
    for each in found.draws:
        if each.distribution is not None:
            values = each.distribution.at(share)
            finite(f"draws of {each.key}", values)
            assert np.all(np.diff(values) >= 0.0), f"draws of {each.key} fall"


def chunk(found: Chunk) -> None:
    """A chunk that is read and packed again has the same bits."""
    data = chunk_format.pack_chunk(found)
    assert chunk_format.pack_chunk(chunk_format.unpack_chunk(data)) == data, "a chunk that is packed is another one"


# ---------------------------------------------------------------------------------------------------------- recordings
def recording(found: Recording) -> None:
    """A recording has finite samples, as many outputs as drives, and a rate of which time runs forward."""
    finite("drive", found.drive)
    finite("output", found.output)
    assert found.drive.ndim == found.output.ndim == 2, "a recording is no table"
    assert len(found.drive) == len(found.output) == found.samples, "drive and output have other lengths"
    assert found.drive.shape[1] == len(found.input_names), "a drive without a name"
    assert found.output.shape[1] == len(found.output_names), "an output without a name"
    assert math.isfinite(found.rate_hz) and found.rate_hz > 0.0, "a rate that is none"
    assert math.isfinite(found.step_s) and found.step_s > 0.0, "time stands still"
    assert len(found.sha256) == 64, "no hash"


def fades(found: FadeSeries) -> None:
    """A series has powers that are 0 or above, its own scale, and fades; a code over it has an error ratio."""
    finite("power", found.power)
    assert np.all(found.power >= 0.0) and np.any(found.power > 0.0), "no power"
    assert math.isfinite(found.duration_s) and found.duration_s > 0.0, "time stands still"
    whole = {"mean": np.mean, "largest": np.max}.get(found.normalised)
    assert whole is None or math.isclose(whole(found.power), 1.0, rel_tol=1e-9), "another scale"
    coded = CodedLink(code("ccsds-k7-1-2"), found, 1e9, "block", 8.0 * found.period_s)
    probability("mean error ratio", coded.mean_ratio(1.0))
    own = coded_fading(coded, 3.0, 1e-6)
    for each in (own.ratio.value, own.lost.value, own.fades.share):
        probability("a share", each)
    assert own.penalty_db == math.inf or math.isfinite(own.penalty_db), "a cost that is none"


# -------------------------------------------------------------------------------------------------------------- orbits
def mission_budget(table: ErrorBudget) -> None:
    """A mission's budget is finite under each requirement.

    Args:
        table: The mission's table.
    """
    try:
        sources = sources_of(table, {})
        asked = [requirement_of(each) for each in table.requirements.values()]
        found = error_budget(sources, asked, correlations_of(table)) if sources else ()
    except ValueError as error:
        raise documented(error) from error
    for each in found:
        finite("budget", [each.by_rules_rad, each.quantile_rad, *each.mean_rad, *each.sigma_rad])
        for share in shares(each) if each.quantile_rad else ():
            finite("share", [share.without_rad, share.growth])


def budget(listed: Sequence[ListedSource]) -> None:
    """A budget of a list is finite, grows as its sources do, and is a multiple of them where all grow alike.

    Args:
        listed: The list.
    """
    try:
        sources = [source_of(each.name, each.source, each.origin) for each in listed]
        index = ErrorIndex("RPE", 0.01) if len(listed) % 2 else ErrorIndex("APE")
        required = Requirement(index, axes=tuple(range(min(sources[0].axes, 2))))
        (found,) = error_budget([replace(each) for each in sources], [required])
        (twice,) = error_budget([replace(each, size=each.size.times(2.0)) for each in sources], [required])
    except ValueError as error:
        raise documented(error) from error
    finite("budget", [found.by_rules_rad, found.quantile_rad, *found.mean_rad, *found.sigma_rad])
    assert twice.quantile_rad >= found.quantile_rad >= 0.0, "a budget falls with its sources"
    same = math.isclose(twice.quantile_rad, 2.0 * found.quantile_rad, rel_tol=1e-6)
    assert same, "twice the sources are not twice the budget"


def elements(sets: Iterable[ElementSet]) -> None:
    """Each element set is an orbit about its own epoch, or is refused there."""
    for each in sets:
        orbit(Sgp4Orbit(each, each.epoch), _TIMES_S)


def orbit(found: Orbit, times_s: Any) -> None:
    """States of an orbit are finite, above the ground and below the Moon, and slower than what escapes.

    Args:
        found: The orbit.
        times_s: Times at which it has states, in s.
    """
    states = found.states(times_s)
    finite("position", states.position_m)
    finite("velocity", states.velocity_m_s)
    radius, speed = np.linalg.norm(states.position_m, axis=0), np.linalg.norm(states.velocity_m_s, axis=0)
    assert np.all(radius > 6.3e6) and np.all(radius < 1e10), "an orbit below the ground, or that leaves"
    assert np.all(speed < 12e3), "an orbit faster than what escapes"
