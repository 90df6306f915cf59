"""Checks of what a study makes of its parts: travel, requirements, error budget, campaigns, exported matrices."""

import math
from collections.abc import Iterator

import numpy as np

from microrad.report.verification.check import Check
from microrad.report.verification.checks.loop import Axis
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_ROUNDING = "rounding"


def _travel(workspace: Workspace) -> Iterator[Comparison]:
    """Travel that the mirror needs about each axis, and has, from the mission's text."""
    given, numbers = workspace.given, workspace.numbers("run")
    travel = given("mirror.bouc_wen.d1") * (given("mirror.drive_max") - given("mirror.drive_min")) / 2.0
    for case, ahead in (
        ("point_ahead_on_mirror", 2.0 * given("point_ahead.transverse_velocity") / 299792458.0),
        ("without_point_ahead", 0.0),
    ):
        for axis in range(2):
            name = f"fine_pointing.stroke.{case}.{axis}"
            parts = {
                "Body pointing": given("pointing.lines.body_pointing.error"),
                "Bias and alignment": given("pointing.lines.misalignment.error"),
                "Point-ahead": ahead if axis == 0 else 0.0,  # along the track alone
            }
            for part, expected in parts.items():
                yield workspace.compared("run", f"{name}.lines_rad.{part}", expected, 1e-3 * expected, "0.1 %: v / c")
            lag = "Line-of-sight rate lag"  # of the loop: it counts in the sums alone
            parts[lag] = numbers[f"{name}.lines_rad.{lag}"]
            total, rss = sum(parts.values()), math.hypot(*parts.values())
            figures = {
                "total_rad": total,
                "needed_rad": total,
                "total_rss_rad": rss,
                "needed_rss_rad": rss,
                "available_rad": travel,
                "margin_rad": travel - total,
                "margin_rss_rad": travel - rss,
                "largest_magnification": travel / total,
                "largest_magnification_rss": travel / rss,
            }
            for key, expected in figures.items():
                why = "0.1 % of the travel: v / c"
                size = 1.0 if "magnification" in key else travel
                yield workspace.compared("run", f"{name}.{key}", expected, 2e-3 * size, why)


def _requirements(workspace: Workspace) -> Iterator[Comparison]:
    """What each requirement is judged by, from where the figure itself is printed."""
    numbers, budget = workspace.numbers("run"), workspace.numbers("budget")
    best = workspace.study.fine_pointing.best.design.name
    actual = {
        "beacon covers its partner": (100.0 * budget["pointing.beacon_coverage"], 1.0),
        "beacon margin": (budget["budgets.Beacon.margin_db"], 1.0),
        "answer margin": (budget["budgets.Answer.margin_db"], 1.0),
        "stroke for the worst case (axis x)": (
            numbers["fine_pointing.stroke.point_ahead_on_mirror.0.available_rad"],
            1.0,
        ),
        f"fine pointing at 99.7 % ({best})": (
            numbers[f"fine_pointing.controllers.{best}.simulated.given.quantile_rad"],
            -1.0,
        ),
        f"link margin for 99.7 % of the time ({best})": (numbers["margin_db.judged"], 1.0),
    }
    for name, (value, sign) in actual.items():
        key = f"requirements.{name}"
        yield workspace.compared("run", f"{key}.actual", value, 1e-9 * max(1.0, abs(value)), _ROUNDING)
        spare = sign * (value - numbers[f"{key}.required"])
        yield workspace.compared("run", f"{key}.margin", spare, 1e-9 * max(1.0, abs(value)), _ROUNDING)


def _parts(workspace: Workspace) -> Iterator[Comparison]:
    """Parts of the error budget: each simulated alone against its variance in theory, and their sums."""
    numbers = workspace.numbers("run")
    name = "fine_pointing.error_budget"
    ends = [n for n in numbers if n.startswith(f"{name}.parts.") and n.endswith(".theory_rms_rad")]
    for end in ends:
        part = end.removesuffix(".theory_rms_rad")
        spread = 0.3 if part.endswith("body pointing") else 0.02
        why = "30 %: one slow swing in a run of 2 s" if spread > 0.1 else "2 %: 64 runs of 2 s"
        yield workspace.compared("run", f"{part}.rms_rad", numbers[end], spread * numbers[end], why)
    squares = sum(
        numbers[n] ** 2
        for n in numbers
        if n.startswith(f"{name}.parts.") and n.endswith(".rms_rad") and "theory" not in n
    )
    combined = math.sqrt(squares)
    yield workspace.compared("run", f"{name}.combined_rms_rad", combined, 1e-9 * combined, _ROUNDING)
    key = f"{name}.together_without_hysteresis_rms_rad"
    yield workspace.compared("run", key, combined, 0.02 * combined, "2 %: 64 runs of 2 s")
    for change in ("hysteresis", "limits", "quantisation", "computation delay"):
        both = [numbers[f"{name}.differences.{change}.{which}_rms_rad"] for which in ("with", "without")]
        gap = both[0] ** 2 - both[1] ** 2
        added = math.copysign(math.sqrt(abs(gap)), gap)
        yield workspace.compared(
            "run", f"{name}.differences.{change}.added_rms_rad", added, 1e-9 * abs(added), _ROUNDING
        )


def _factors(workspace: Workspace) -> Iterator[Comparison]:
    """The factor of each assumption, from the volumes of the day at its two ends."""
    numbers = workspace.numbers("run")
    day = numbers["day.relay.could_carry_bit"] / numbers["day.direct.could_carry_bit"]
    for name in [n for n in numbers if n.startswith("day.assumptions.") and n.endswith(".factor")]:
        ends = [name.replace(".factor", f".{end}") for end in ("low", "high")]
        ratios = [numbers[f"{e}.relay_could_carry_bit"] / numbers[f"{e}.direct_could_carry_bit"] for e in ends]
        ratios.append(day)
        expected = max(ratios) / min(ratios)
        yield workspace.compared("run", name, expected, 0.02 * expected, "2 %: the day as it is draws its acquisitions")


def _matrices(workspace: Workspace) -> Iterator[Comparison]:
    """The sampled plant that is exported, by partial fractions of the printed polynomials."""
    from microrad.core import lti

    axis = Axis(workspace.given)
    plant = workspace.study.fine_pointing.scene.one_axis
    for freq_hz in (1.0, 30.0, 300.0, 1000.0):
        place = int(np.argmin(np.abs(axis.freq_hz - freq_hz)))
        expected = abs(axis.plant()[place])
        response = lti.frequency_response(plant.from_command, axis.freq_hz[[place]], axis.period_s)[0, 0, 0]
        what = f"gain of the sampled plant at {freq_hz:g} Hz"
        yield Comparison(
            "design.models.sampled_plant.A",
            what,
            expected,
            abs(response),
            1e-3 * expected,
            "rad/V",
            "0.1 %: the drive is straight within a plant step",
        )


CHECKS = (
    Check(
        "travel",
        "Travel of the mirror, needed and available",
        Referent.INDEPENDENT,
        "Sums of the mission's own figures.",
        "geometry of a plane mirror",
        _travel,
    ),
    Check(
        "requirements",
        "What each requirement is judged by, and what it has to spare",
        Referent.INDEPENDENT,
        "Taken from the figure that is printed elsewhere.",
        "the mission's table [requirement]",
        _requirements,
    ),
    Check(
        "error-budget",
        "Parts of the fine-pointing error budget: in time against theory, and their sums",
        Referent.INDEPENDENT,
        "Each part is simulated alone; theory is a covariance; the sums are sums of squares.",
        "independence of the sources",
        _parts,
    ),
    Check(
        "assumptions",
        "Factor of each assumption of the day",
        Referent.INDEPENDENT,
        "Largest over least ratio of the two volumes.",
        "definition",
        _factors,
    ),
    Check(
        "matrices",
        "Gain of the exported plant from partial fractions",
        Referent.INDEPENDENT,
        "The printed polynomials, held mode by mode.",
        "SPIE 11852, 118523B, Eq. 2",
        _matrices,
    ),
)
