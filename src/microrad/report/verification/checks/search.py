"""Checks of the search for the partner: its stages, coverages and detection, by draws and by recursion backwards."""

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.report.registry import flattened
from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Given, Workspace, with_values

Floats = NDArray[np.float64]

_ROUNDING = "rounding"
_LIGHT_M_S, _CHARGE_C = 299792458.0, 1.602176634e-19
_THRESHOLD = 5.0  # of the quad cell, in rms of its noise: docs/acquisition.md
_DRAWS, _SIGMAS = 2_000_000, 5.0
_HOW = f"five standard errors of {_DRAWS:.0e} draws"
_DIM = {  # the shipped mission's answer is seen for certain: with these values chances are far from 1
    "acquisition.sensor.thermal_noise": '"0.12 pA/sqrt(Hz)"',
    "answer.pointing_error": '"30 urad"',
    "acquisition.detection_probability": "0.02",
    "acquisition.scan.detection": '"5 ns"',
}


def _gain(given: Given, sends: str, to: str) -> tuple[float, float]:
    """Power (W) that a beam brings on its axis, and the radius (rad) at which what is needed is left of it."""
    half_rad = given(f"{sends}.divergence") / 2.0
    ring_m2 = math.pi * (half_rad * given(f"{sends}.distance")) ** 2 / 2.0
    lost_db = sum(given(f"{sends}.{key}") for key in ("transmit_optics_loss", "strehl", "receive_optics_loss"))
    caught = math.pi / 4.0 * given(f"terminals.{to}_aperture") ** 2 / ring_m2
    power_w = given(f"{sends}.transmit_power") * caught * 10.0 ** (-lost_db / 10.0)
    return power_w, half_rad * math.sqrt(math.log(power_w / given(f"{sends}.required_power")) / 2.0)


def _back(given: Given) -> float:
    """Radius (rad) at which the narrow beam back still brings what the data need, and out to 1/e2 at most."""
    wavelength_m, near_m = given("communication.wavelength"), given("terminals.leo_aperture")
    half_rad = 2.0 * wavelength_m / (math.pi * near_m)
    areas_m2 = [math.pi / 4.0 * given(f"terminals.{end}_aperture") ** 2 for end in ("leo", "geo")]
    lost_db = sum(
        given(f"communication.{key}")
        for key in (
            "transmit_optics_loss",
            "strehl",
            "receive_optics_loss",
            "tracking_split_loss",
            "implementation_loss",
        )
    )
    caught = math.prod(areas_m2) / (wavelength_m * given("communication.distance")) ** 2
    photons = given("communication.receiver_sensitivity") * given("communication.data_rate")
    needed_w = photons * 6.62607015e-34 * _LIGHT_M_S / wavelength_m
    times = given("communication.transmit_power") * caught * 10.0 ** (-lost_db / 10.0) / needed_w
    return float(float(half_rad) * min(1.0, math.sqrt(math.log(max(times, 1.0)) / 2.0)))


@cache
def _normals() -> Floats:
    return np.random.default_rng(20_260_106).standard_normal((2, _DRAWS))


def _share(found: Any) -> tuple[float, float]:
    """Share of the draws, and how far it may be from the probability."""
    share = float(np.mean(found))
    return share, _SIGMAS * math.sqrt(max(share * (1.0 - share), 1.0 / _DRAWS) / _DRAWS)


def _chances(given: Given) -> dict[str, tuple[float, float]]:
    """Probabilities of the sequence by draws, each with its tolerance."""
    x, y = _normals()
    body, orbit = given("pointing.lines.body_pointing.error"), given("pointing.lines.orbit_knowledge.error")
    # a drift grows from nothing to its end: half of it on the average, and evenly spread
    mean = orbit / 2.0 + given("pointing.lines.misalignment.error") + given("point_ahead.error") / math.sqrt(2.0)
    sigma = math.hypot(body / 3.0, orbit / math.sqrt(12.0))
    found = {"beacon_coverage": _share(np.hypot(mean + sigma * x, mean + sigma * y) < _gain(given, "beacon", "geo")[1])}
    power_w, reach = _gain(given, "answer", "leo")
    sigma = given("answer.pointing_error") / given("acquisition.pointing_sigmas")
    found["answer_coverage"] = _share(sigma * np.hypot(x, y) < reach)
    power_w *= math.exp(-2.0 * (given("answer.pointing_error") / (given("answer.divergence") / 2.0)) ** 2)
    band_hz, current = given("acquisition.sensor.rate") / 2.0, power_w * given("acquisition.sensor.responsivity")
    noise_a = math.sqrt(
        band_hz
        * (
            2.0 * _CHARGE_C * (current + 4.0 * given("acquisition.sensor.dark_current"))
            + 4.0 * given("acquisition.sensor.thermal_noise") ** 2
        )
    )
    # readings of one measurement are summed, and each has its noise
    readings = given("acquisition.measurement") * given("acquisition.sensor.rate")
    summed = readings * current + math.sqrt(readings) * noise_a * x
    found["answer_detection"] = _share(summed > _THRESHOLD * math.sqrt(readings) * noise_a)
    slope = 3.0 * math.pi / 16.0 * given("answer.wavelength") / given("terminals.leo_aperture")
    sigma = slope * noise_a / current
    found["return_coverage"] = _share(np.hypot(given("point_ahead.error") + sigma * x, sigma * y) < _back(given))
    return found


def _dim(workspace: Workspace) -> tuple[Given, dict[str, float]]:
    """The mission with a dim answer, and what `microrad budget` prints of it."""
    from microrad.link.study import run_link_study
    from microrad.mission.file import load_link
    from microrad.report.links.data import links_data

    text = with_values(workspace.text, _DIM)
    path = workspace.folder / "dim.toml"
    path.write_text(text, encoding="utf-8")
    return Given(text), dict(flattened(links_data(run_link_study(load_link(path)))))


def _seen(workspace: Workspace) -> Iterator[Comparison]:
    """Coverage and detection, of the shipped mission and of one with a dim answer."""
    shipped = workspace.given, workspace.numbers("budget")
    for which, (given, numbers) in (("shipped", shipped), ("dim answer", _dim(workspace))):
        for key, (share, error) in _chances(given).items():
            name = f"acquisition.{key}"
            yield Comparison(f"budget.{name}", f"{key}, {which}", share, numbers[name], error, "", _HOW)


def _light(workspace: Workspace) -> Iterator[Comparison]:
    """The scan's beam, and the time that its light needs."""
    for which, (given, numbers) in (
        ("shipped", (workspace.given, workspace.numbers("budget"))),
        ("dim answer", _dim(workspace)),
    ):
        wavelength_m = given("beacon.wavelength")
        used = given("acquisition.scan.beam_radius")
        narrow = max(used, 2.0 * math.sqrt(2.0) * wavelength_m / (math.pi * given("terminals.leo_aperture")))
        name = "acquisition.scan_half_angle_rad"
        yield Comparison(
            f"budget.{name}", f"half angle of the scan, {which}", narrow, numbers[name], 1e-9 * narrow, "rad", _ROUNDING
        )
        power_w, _ = _gain(given, "beacon", "geo")
        power_w *= (given("beacon.divergence") / 2.0 / narrow) ** 2 * math.exp(-2.0 * (used / narrow) ** 2)
        lasts = given("acquisition.detection") * (given("beacon.required_power") / power_w) ** 2
        name = "acquisition.scan_needed_detection_s"
        yield Comparison(
            f"budget.{name}", f"shortest look of the scan, {which}", lasts, numbers[name], 1e-9 * lasts, "s", _ROUNDING
        )


def _stages(workspace: Workspace) -> Iterator[Comparison]:
    """Stages as the text has them, and the probability of lock by the failures that are left."""
    shipped = workspace.given, workspace.numbers("budget")
    for which, (given, numbers) in (("shipped", shipped), ("dim answer", _dim(workspace))):
        chances, light_s = _chances(given), given("beacon.distance") / _LIGHT_M_S
        frames, once = given("acquisition.detection_frames"), given("acquisition.detection_probability")
        misses = math.exp(frames * math.log1p(-once))
        lock = given("acquisition.lock_probability")
        covered, scanned = (
            "beacon_coverage",
            numbers["acquisition.ways.spiral scan.stages.GEO detects.success_probability"],
        )
        answered = chances["answer_coverage"][0] * chances["answer_detection"][0]
        wide = chances[covered][0] * (1.0 - misses), chances[covered][1]
        for way, first, looks, sought in (
            ("wide beacon", "beacon", frames * given("acquisition.detection"), wide),
            ("spiral scan", "beam", None, (scanned, 0.0)),
        ):
            rows = (  # name, longest, probability, its tolerance, stage behind a failure
                (f"LEO points the {'beacon' if looks else 'scan'}", given("acquisition.settle"), 1.0, 0.0, 0),
                (f"{first} travels", light_s, 1.0, 0.0, 0),
                ("GEO detects", looks, *sought, 0),
                ("GEO turns and answers", given("acquisition.response"), 1.0, 0.0, 0),
                ("answer travels", light_s, 1.0, 0.0, 0),
                (
                    "LEO detects the answer",
                    given("acquisition.measurement"),
                    answered,
                    chances["answer_coverage"][1] + chances["answer_detection"][1],
                    3,
                ),
                ("LEO's mirror turns", given("acquisition.steering"), 1.0, 0.0, 0),
                ("narrow beam travels", light_s, 1.0, 0.0, 0),
                (
                    "GEO locks",
                    given("acquisition.lock"),
                    lock * chances["return_coverage"][0],
                    chances["return_coverage"][1],
                    5,
                ),
                ("GEO's beam travels", light_s, 1.0, 0.0, 0),
                ("LEO locks", given("acquisition.lock"), lock, 0.0, 5),
            )
            name = f"acquisition.ways.{way}"
            for stage, longest, probability, error, _ in rows:
                key = f"{name}.stages.{stage}"
                if longest is not None:
                    what = f"{stage}, longest, {way}, {which}"
                    obtained = numbers[f"{key}.longest_s"]
                    yield Comparison(f"budget.{key}.longest_s", what, longest, obtained, 1e-9 * longest, "s", _ROUNDING)
                if sought[1] or stage != "GEO detects":
                    what = f"{stage}, probability, {way}, {which}"
                    obtained = numbers[f"{key}.success_probability"]
                    yield Comparison(
                        f"budget.{key}.success_probability", what, probability, obtained, error + 1e-12, "", _HOW
                    )
            # each chance as far as its draws allow, up and down: lock grows with all of them
            least, most = (
                _locked([(min(1.0, row[2] + side * row[3]), row[4]) for row in rows], given("acquisition.attempts"))
                for side in (-1.0, 1.0)
            )
            yield Comparison(
                f"budget.{name}.success_probability",
                f"probability of lock, {way}, {which}",
                (least + most) / 2.0,
                numbers[f"{name}.success_probability"],
                (most - least) / 2.0 + 1e-9,
                "",
                f"what its chances may be off: {_HOW}",
            )


def acquisitions(given: Given, count: int) -> Floats:
    """Times (s) until lock by the wide beacon, drawn stage by stage; infinite where it is given up.

    Args:
        given: The mission's values.
        count: How many acquisitions.
    """
    chances, light_s = (
        {key: chance for key, (chance, _) in _chances(given).items()},
        given("beacon.distance") / _LIGHT_M_S,
    )
    looks_s = given("acquisition.detection_frames") * given("acquisition.detection")
    misses = (1.0 - given("acquisition.detection_probability")) ** given("acquisition.detection_frames")
    response_s, measured_s = given("acquisition.response"), given("acquisition.measurement")
    lock_s, lock = given("acquisition.lock"), given("acquisition.lock_probability")
    found, answered = (
        chances["beacon_coverage"] * (1.0 - misses),
        chances["answer_coverage"] * chances["answer_detection"],
    )
    # how long, with what chance, what a failure costs, and the stage behind it; certain stages are part of the next
    table = np.array(
        [
            (given("acquisition.settle") + light_s, 1.0, 0.0, 0),
            (looks_s, found, looks_s + response_s + light_s + measured_s, 0),
            (response_s + light_s, 1.0, 0.0, 2),
            (measured_s, answered, measured_s + light_s, 2),
            (given("acquisition.steering") + light_s, 1.0, 0.0, 4),
            (lock_s, lock * chances["return_coverage"], lock_s + light_s, 3),
            (light_s, 1.0, 0.0, 6),
            (lock_s, lock, lock_s, 3),
        ]
    )
    draw = np.random.default_rng(20_260_109)
    place, time_s = np.zeros(count, dtype=int), np.zeros(count)
    left = np.full(count, int(given("acquisition.attempts")))
    while (under_way := np.flatnonzero((place < len(table)) & (left > 0))).size:
        lasts, chance, costs, back = table[place[under_way]].T
        held = draw.random(under_way.size) < chance
        time_s[under_way] += np.where(held, lasts, costs)
        place[under_way] = np.where(held, place[under_way] + 1, back)
        left[under_way] -= ~held
    return np.where(left > 0, time_s, math.inf)


def _locked(rows: list[tuple[float, int]], attempts: int) -> float:
    """Probability of lock from the first stage with so many attempts: from the last failure backwards."""
    behind = [0.0] * len(rows)  # with no attempt left
    for _ in range(attempts):
        ahead, here = 1.0, [0.0] * len(rows)
        for place in reversed(range(len(rows))):
            chance, back = rows[place]
            ahead = here[place] = chance * ahead + (1.0 - chance) * behind[back]
        behind = here
    return behind[0]


CHECKS = (
    Check(
        "seen",
        "Coverage of each beam and detection of the answer by draws",
        Referent.INDEPENDENT,
        "Directions and readings are drawn and counted, of the shipped mission and of one with a dim answer.",
        "Gaussian beams, a threshold of five times the noise",
        _seen,
    ),
    Check(
        "scan-light",
        "Beam of the scan and the look that its light needs",
        Referent.INDEPENDENT,
        "Diffraction of the aperture, and the inverse square of the power.",
        "range equation",
        _light,
    ),
    Check(
        "stages",
        "Stages of an acquisition from the mission's text, and the probability of lock",
        Referent.INDEPENDENT,
        "The chance of lock with so many failures left, from the last one backwards; the product sums orders of"
        " failures forward, with their times.",
        "SPIE 11852, 118523B, section 2.1",
        _stages,
    ),
)
