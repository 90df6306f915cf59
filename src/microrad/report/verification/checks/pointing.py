"""Checks of pointing budgets, jitter and acquisition: by rules written anew, by quadrature and by draws."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_ROUNDING = "rounding"
_DRAWS = 4_000_000
_SIGMAS = 5.0  # of the draws' own error: one comparison in two million is missed by chance


def _terms(workspace: Workspace) -> dict[str, tuple[float, float, float]]:
    """Mean and standard deviation about each axis, and the stated error, of the four lines of the shipped budget."""
    given = workspace.given
    body = given("pointing.lines.body_pointing.error")
    orbit = given("pointing.lines.orbit_knowledge.error")
    bias = given("pointing.lines.misalignment.error")
    ahead = given("point_ahead.error")
    return {
        "Body pointing": (0.0, body / 3.0, body),
        "Orbit knowledge": (orbit / 2.0, orbit / math.sqrt(12.0), orbit),
        "Misalignment": (bias, 0.0, bias),
        "Point-ahead": (ahead / math.sqrt(2.0), 0.0, ahead),
    }


def _radii(workspace: Workspace) -> NDArray[np.float64]:
    terms = _terms(workspace).values()
    mean, deviation = sum(t[0] for t in terms), math.hypot(*(t[1] for t in terms))
    draw = np.random.default_rng(20_260_101)
    x, y = (mean + deviation * draw.standard_normal(_DRAWS) for _ in "xy")
    return np.sort(np.hypot(x, y))


def _totals(workspace: Workspace) -> Iterator[Comparison]:
    terms, confidence = _terms(workspace), workspace.given("pointing.confidence")
    mean, deviation = sum(t[0] for t in terms.values()), math.hypot(*(t[1] for t in terms.values()))
    sigmas = stats.norm.isf((1.0 - confidence) / 2.0)
    axis = mean + sigmas * deviation
    expected = {
        "rss": math.hypot(*(t[2] for t in terms.values())),
        "ecss-axis": axis,
        "ecss-radial": math.sqrt(2.0) * axis,
        "rayleigh": deviation * math.sqrt(-2.0 * math.log1p(-confidence)),
    }
    for rule, value in expected.items():
        yield workspace.compared("budget", f"pointing.totals.{rule}.total_rad", value, 1e-9 * value, _ROUNDING)
    radii = _radii(workspace)
    place = confidence * _DRAWS
    spread = _SIGMAS * math.sqrt(_DRAWS * confidence * (1.0 - confidence))
    low, exact, high = (float(radii[int(k)]) for k in (place - spread, place, place + spread))
    how = f"five standard errors of {_DRAWS:.0e} draws"
    yield workspace.compared("budget", "pointing.totals.exact.total_rad", exact, (high - low) / 2.0, how)
    half_angle_rad = workspace.given("beacon.divergence") / 2.0
    share = float(np.searchsorted(radii, half_angle_rad)) / _DRAWS
    error = _SIGMAS * math.sqrt(max(share * (1.0 - share), 1.0 / _DRAWS) / _DRAWS)
    yield workspace.compared("budget", "pointing.beacon_coverage", share, error, how)
    for name, term in terms.items():
        others = math.sqrt(expected["rss"] ** 2 - term[2] ** 2)
        largest = math.sqrt(max(0.0, half_angle_rad**2 - others**2))
        key = f"pointing.left_for_each.{name}"
        yield workspace.compared("budget", f"{key}.largest_rad", largest, 1e-6 * largest, "end of a search")
        yield workspace.compared("budget", f"{key}.missing_rad", max(0.0, others - half_angle_rad), 1e-12, _ROUNDING)


def _scan(workspace: Workspace) -> Iterator[Comparison]:
    """The spiral: its radius from the distribution's tail, its time from its area."""
    given = workspace.given
    beam_rad, overlap = given("acquisition.scan.beam_radius"), given("acquisition.scan.overlap")
    terms = _terms(workspace).values()
    sigma_rad = math.hypot(sum(t[0] for t in terms), *(t[1] for t in terms))
    radius_rad = sigma_rad * math.sqrt(-2.0 * math.log1p(-given("acquisition.scan.coverage")))
    pairs = {"uncertainty_per_axis_rad": sigma_rad, "scan_radius_rad": radius_rad}
    for key, expected in pairs.items():
        yield workspace.compared("budget", f"acquisition.{key}", expected, 1e-9 * expected, _ROUNDING)
    pitch_rad = 2.0 * beam_rad * (1.0 - overlap)
    chord_rad = 2.0 * math.sqrt(beam_rad**2 - (pitch_rad / 2.0) ** 2)  # of what lies between two tracks
    lasts = math.pi * radius_rad**2 / pitch_rad / chord_rad * given("acquisition.scan.detection")
    yield workspace.compared("budget", "acquisition.scan_s", lasts, 0.01 * lasts, "1 %: the first turn is no ring")


def _acquired(workspace: Workspace) -> Iterator[Comparison]:
    """The closed form of both ways of acquisition against runs that are drawn stage by stage."""
    for way in workspace.links.finding.ways:
        locked, runs = way.outcome.locked, int(workspace.given("acquisition.runs"))
        share = locked.probability
        name = f"acquisition.ways.{way.name}"
        error = _SIGMAS * math.sqrt(max(share * (1.0 - share), 1.0 / runs) / runs)
        how = f"five standard errors of {runs} runs"
        yield workspace.compared("budget", f"{name}.simulated_success_probability", share, error, how)
        error = _SIGMAS * locked.std_s / math.sqrt(runs)
        yield workspace.compared("budget", f"{name}.simulated_mean_time_s", locked.mean_s, error, how)
        drawn = workspace.numbers("budget")[f"{name}.simulated_mean_time_s"]
        yield workspace.compared("budget", f"{name}.mean_time_s", drawn, error, how)


def _jitter(workspace: Workspace) -> Iterator[Comparison]:
    """A crosslink under jitter: mean and outage by draws, the best divergence by a search over them."""
    half_angle_rad = 2.0 * 1550e-9 / (math.pi * 0.08)
    draw = np.random.default_rng(20_260_102)
    x, y = 6e-6 * draw.standard_normal((2, _DRAWS))
    loss_db = np.sort(20.0 * math.log10(math.e) * (np.hypot(x + 4e-6, y) / half_angle_rad) ** 2)
    kept = 10.0 ** (-loss_db / 10.0)
    how = f"five standard errors of {_DRAWS:.0e} draws"
    mean = float(np.mean(kept))
    error_db = _SIGMAS * 4.343 * float(np.std(kept)) / mean / math.sqrt(_DRAWS)
    yield workspace.compared("jitter", "under_jitter.mean_loss_db", -10.0 * math.log10(mean), error_db, how)
    spread = _SIGMAS * math.sqrt(_DRAWS * 1e-3 * (1.0 - 1e-3))
    low, outage, high = (float(loss_db[int(0.999 * _DRAWS + k * spread)]) for k in (-1.0, 0.0, 1.0))
    yield workspace.compared("jitter", "under_jitter.outage_loss_db", outage, (high - low) / 2.0, how)
    static_db = workspace.numbers("jitter")["under_jitter.margin_db"] + outage
    for key, least_db in (("outage", 0.0), ("below_required_margin", 3.0)):
        share = float(np.mean(static_db - loss_db < least_db))
        error = _SIGMAS * math.sqrt(max(share, 1.0 / _DRAWS) / _DRAWS) + 0.05 * share
        why = f"{how}, and what those of the outage loss move it"
        yield workspace.compared("jitter", f"under_jitter.{key}", share, error, why)
    radius_rad = half_angle_rad * math.sqrt(outage / (20.0 * math.log10(math.e)))
    best = optimize.minimize_scalar(
        lambda theta: 20.0 * math.log10(theta) + 20.0 * math.log10(math.e) * (radius_rad / theta) ** 2,
        bounds=(1e-6, 1e-3),
        method="bounded",
        options={"xatol": 1e-12},
    )
    wanted, half = float(best.x), (high - low) / outage / 4.0
    yield workspace.compared("jitter", "under_jitter.best_half_angle_rad", wanted, half * wanted, how)
    lost = 20.0 * math.log10(wanted / half_angle_rad) + 20.0 * math.log10(math.e) * radius_rad**2 * (
        1.0 / wanted**2 - 1.0 / half_angle_rad**2
    )
    yield workspace.compared("jitter", "under_jitter.lost_against_best_db", -lost, 2.0 * half * outage + 1e-3, how)
    for axis, (bias, rms) in enumerate(((4e-6, 6e-6), (0.0, 6e-6))):
        yield workspace.compared("jitter", f"under_jitter.bias_rad.{axis}", bias, 1e-15, _ROUNDING)
        yield workspace.compared("jitter", f"under_jitter.rms_rad.{axis}", rms, 1e-15, _ROUNDING)


def _fades(workspace: Workspace) -> Iterator[Comparison]:
    """Fades of the same link counted in a drawn motion of its bandwidth."""
    numbers = workspace.numbers("jitter")
    runs, step_s, bandwidth_hz = 400, 2e-4, 30.0
    draw = np.random.default_rng(20_260_103)
    count = 1 << 16
    freq_hz = np.fft.rfftfreq(count, step_s)
    # a spectrum of this rms and of this rms of its rate: narrow about the one frequency, so that all of it moves alike
    weight = np.exp(-(((freq_hz - bandwidth_hz) / 1.0) ** 2))
    half_angle_rad = 2.0 * 1550e-9 / (math.pi * 0.08)
    outage, required = numbers["under_jitter.outage_loss_db"], 3.0
    at_db = numbers["under_jitter.margin_db"] + outage - required
    radius_rad = half_angle_rad * math.sqrt(at_db / (20.0 * math.log10(math.e)))
    counts = []
    for _ in range(runs):
        pair = []
        for _axis in "xy":
            noise = draw.standard_normal((2, freq_hz.size))
            path = np.fft.irfft((noise[0] + 1j * noise[1]) * np.sqrt(weight), count)
            pair.append(6e-6 * path / math.sqrt(weight.sum() * 4.0 / count**2))
        outside = np.hypot(pair[0] + 4e-6, pair[1]) > radius_rad
        counts.append(np.count_nonzero(outside[1:] & ~outside[:-1]) / (count * step_s))
    rate = float(np.mean(counts))
    error = _SIGMAS * float(np.std(counts)) / math.sqrt(runs) + 0.02 * rate
    how = f"five standard errors of {runs} drawn motions, and 2 % for the width of their band"
    yield workspace.compared("jitter", "under_jitter.fades_per_s", rate, error, how)
    share = numbers["under_jitter.below_required_margin"]
    yield workspace.compared("jitter", "under_jitter.mean_fade_s", share / rate, error * share / rate**2, how)


CHECKS = (
    Check(
        "pointing-totals",
        "Totals of the shipped pointing budget by the rules and by draws",
        Referent.INDEPENDENT,
        "Rules of summation written anew; radial figures by sorting draws of both axes.",
        "ECSS-E-ST-60-10C (2008), 4.2; SPIE 11852, 118523B, section 2.1",
        _totals,
    ),
    Check(
        "acquisition",
        "Both ways of acquisition: closed form against drawn runs",
        Referent.INDEPENDENT,
        "The closed form sums all orders of failures; the runs are drawn stage by stage and share only the stages.",
        "SPIE 11852, 118523B, section 2.1",
        _acquired,
    ),
    Check(
        "scan",
        "Uncertainty and radius of the spiral scan",
        Referent.INDEPENDENT,
        "The radius beyond which a Rayleigh distribution has what is not covered.",
        "closed form",
        _scan,
    ),
    Check(
        "jitter",
        "A link under jitter: mean, outage, best divergence",
        Referent.INDEPENDENT,
        "Draws of both axes through the Gaussian beam, sorted; a search over the divergence.",
        "Toyoshima et al., J. Opt. Soc. Am. A 19, 567 (2002), for the definitions",
        _jitter,
    ),
    Check(
        "fades",
        "Rate and length of fades below the required margin",
        Referent.INDEPENDENT,
        "Crossings counted in drawn motions.",
        "Rice's formula is what is checked",
        _fades,
    ),
)
