"""How the partner is found: the light on the tracking sensor, the sequence of the paper, and a scan instead."""

import math
from dataclasses import dataclass

import numpy as np

from microrad import acquisition, link, pointing, sensor
from microrad.acquisition_table import Acquisition
from microrad.acquisition_table import Scan as ScanTable
from microrad.budget import Line
from microrad.link_table import Beacon, half_angle_rad
from microrad.mission import LinkMission, source_text
from microrad.missionfile import LinkFile

THRESHOLD = 5.0
"""Threshold of the quad cell over its rms noise: a false alarm in 3.5 million readings."""
DEEPEST_DB = 20.0
"""Pointing loss up to which a Gaussian beam is counted on; beyond it wings and scatter decide."""
TRADE_RAD = np.geomspace(30e-6, 1e-3, 25)
"""Uncertainties per axis over which a wide beacon is set against a scan."""


@dataclass(frozen=True, slots=True)
class Tracking:
    """The answer's light on the quad cell of the satellite's own terminal, and what it is worth as an angle."""

    power_w: float
    signal_to_noise: float
    noise_lines: tuple[Line, ...]
    noise_equivalent_angle: Line


@dataclass(frozen=True, slots=True)
class Found:
    """One way to find the partner: its stages, the exact outcome, and the seeded simulation of the same process."""

    name: str
    stages: tuple[acquisition.Stage, ...]
    outcome: acquisition.Outcome
    simulated: acquisition.SequenceRuns
    log: tuple[acquisition.Transition, ...]

    @property
    def simulated_probability(self) -> float:
        """Share of the simulated acquisitions that end in lock."""
        return float(np.mean(self.simulated.locked))

    @property
    def simulated_mean_s(self) -> float:
        """Mean time of those."""
        locked = self.simulated.time_s[self.simulated.locked]
        return float(np.mean(locked)) if locked.size else math.nan


@dataclass(frozen=True, slots=True)
class Finding:
    """Acquisition by the wide beacon and, where the mission has a scan, by that; `trade` sets them side by side.

    `sigma_rad` is the uncertainty per axis about the predicted direction, biases and all; the radii say how far off
    its axis each beam still suffices.
    """

    chances: acquisition.Chances
    sigma_rad: float
    beacon_radius_rad: float
    answer_radius_rad: float
    return_radius_rad: float
    wide: Found
    scan: Found | None
    scan_s: float
    scan_radius_rad: float
    scan_speed_rad_s: float
    trade: acquisition.Trade | None


def tracking(file: LinkFile, answer: link.LinkBudget | None) -> Tracking | None:
    """The answer on the quad cell of `[acquisition.sensor]`, or None without either."""
    m = file.mission
    if answer is None or m.answer is None or m.acquisition is None or m.acquisition.sensor is None:
        return None
    s = m.acquisition.sensor
    cell = sensor.QuadCell(s.responsivity_a_w, s.background_power_w, s.dark_current_a, s.thermal_noise_a_sqrt_hz)
    spot = sensor.AirySpot(m.answer.wavelength_m, m.terminals.leo_aperture_m)
    source = f"answer budget; {source_text(file.sources, 'acquisition.sensor.rate')}"
    bandwidth = sensor.noise_bandwidth_hz(s.rate_hz)
    return Tracking(
        answer.received_power_w,
        cell.signal_to_noise(answer.received_power_w, bandwidth),
        cell.noise_lines(answer.received_power_w, bandwidth, source),
        sensor.noise_equivalent_angle_line(cell, spot, answer.received_power_w, s.rate_hz, source),
    )


def finding(
    m: LinkMission,
    open_loop: pointing.OpenLoopPointing,
    beacon: link.LinkBudget | None,
    answer: link.LinkBudget | None,
    light: Tracking | None,
) -> Finding | None:
    """Acquisition as the mission's table times it, or None without that table or without both beams."""
    a = m.acquisition
    if a is None or m.beacon is None or m.answer is None or beacon is None or answer is None:
        return None
    wide, narrow = _reach(m, m.beacon, beacon), _reach(m, m.answer, answer)
    back = link.communication_beam(m).fall.half_angle_rad
    nea = 0.0 if light is None else light.noise_equivalent_angle.value
    own = m.point_ahead.error_rad if m.point_ahead is not None and m.point_ahead.corrected else 0.0
    ahead = link.point_ahead_rad(m)
    chances = acquisition.Chances(
        beacon_coverage=_coverage(open_loop.error, wide),
        frame_detection=a.detection_probability,
        answer_coverage=_coverage(_aside(ahead, m.answer.pointing_error_rad / a.pointing_sigmas), narrow),
        answer_detection=_possible(_answer_detection(a, light)),
        return_coverage=_coverage(_aside(own + ahead, nea), back),
        lock=a.lock_probability,
    )
    timing = acquisition.Timing(
        range_m=m.beacon.distance_m,
        body_settling_s=a.settle_s,
        frame_time_s=a.detection_s,
        frames=a.detection_frames,
        geo_response_s=a.response_s,
        leo_detection_s=a.measurement_s,
        mirror_settling_s=a.steering_s,
        lock_time_s=a.lock_s,
    )
    error = open_loop.error
    sigma = max(math.hypot(b, s) for b, s in zip(error.bias_rad, error.rms_rad, strict=True))
    found = _found("wide beacon", acquisition.paper_sequence(timing, chances), a)
    if a.scan is None:
        return Finding(chances, sigma, wide, narrow, back, found, None, math.nan, math.nan, math.nan, None)
    pattern = _pattern(a.scan, sigma)
    times = acquisition.detection_times(pattern, a.scan.jitter_rms_rad)
    stages = (*acquisition.scan_stages(timing, times, pattern.duration_s), *acquisition.answer_stages(timing, chances))
    return Finding(
        chances=chances,
        sigma_rad=sigma,
        beacon_radius_rad=wide,
        answer_radius_rad=narrow,
        return_radius_rad=back,
        wide=found,
        scan=_found(f"{a.scan.pattern} scan", stages, a),
        scan_s=pattern.duration_s,
        scan_radius_rad=pattern.search.radius_rad,
        scan_speed_rad_s=getattr(pattern, "speed_rad_s", math.nan),
        trade=_trade(m, beacon, a.scan),
    )


def _reach(m: LinkMission, beam: Beacon, budget: link.LinkBudget) -> float:
    """How far off its axis a Gaussian beam still brings the power that is needed, and is counted on."""
    fall = link.GaussianFall(half_angle_rad(beam.divergence_rad, m.conventions.divergence))
    return fall.error_rad(min(budget.margin_db + _off_axis_db(m, beam, fall), DEEPEST_DB))


def _off_axis_db(m: LinkMission, beam: Beacon, fall: link.GaussianFall) -> float:
    """What the budget of a beam has lost off its axis, an uncorrected point-ahead included."""
    return float(fall.loss_db(beam.pointing_error_rad + link.point_ahead_rad(m)))


def _aside(bias_rad: float, rms_rad: float) -> pointing.Jitter:
    """A direction with the same spread about both axes, and a bias about one of them."""
    return pointing.Jitter((bias_rad, 0.0), (rms_rad, rms_rad))


def _coverage(error: pointing.Jitter, radius_rad: float) -> float:
    """Probability that the direction is within the radius."""
    return _possible(float(pointing.radial_cdf(error, radius_rad)))


def _possible(probability: float) -> float:
    """A probability that a process can be built with: what never happens does so once in 10^12 times."""
    return min(max(probability, 1e-12), 1.0)


def _answer_detection(a: Acquisition, light: Tracking | None) -> float:
    """Probability that the quad cell sees the answer within one measurement."""
    if light is None or a.sensor is None:
        return a.detection_probability
    # the noise of a measurement falls with the root of the readings in it
    readings = max(a.measurement_s * a.sensor.rate_hz, 1.0)
    return acquisition.frame_detection_probability(light.signal_to_noise * math.sqrt(readings), THRESHOLD)


def _pattern(s: ScanTable, sigma_rad: float) -> acquisition.Scan:
    """The mission's scan, as fast as its detector allows."""
    search = acquisition.Search(sigma_rad, s.beam_radius_rad, s.overlap, s.coverage)
    detector = acquisition.Detector(s.detection_s)
    if s.pattern == "step-stare":
        return acquisition.StepStare(search, detector, s.detection_s, s.turn_s)
    speed = acquisition.highest_speed(search, s.detection_s)
    if s.pattern == "raster":
        return acquisition.Raster(search, detector, speed, s.turn_s)
    return acquisition.Spiral(search, detector, speed)


def _found(name: str, stages: tuple[acquisition.Stage, ...], a: Acquisition) -> Found:
    return Found(
        name,
        stages,
        acquisition.solve(stages, a.attempts),
        acquisition.simulate(stages, a.attempts, a.runs, a.seed),
        acquisition.simulate_log(stages, a.attempts, a.seed),
    )


def _trade(m: LinkMission, beacon: link.LinkBudget, s: ScanTable) -> acquisition.Trade:
    """The beacon's power spread over the uncertainty, or led over it in the scan's narrow beam.

    The partner's sensor is that of the beacon budget: it needs its required power for one frame, and four times as
    long at half the power, as noise that does not depend on the light has it.
    """
    a = m.acquisition
    assert a is not None
    assert m.beacon is not None
    needed = 10.0
    receiver = acquisition.Receiver(
        aperture_area_m2=beacon.received_power_w / beacon.irradiance_w_m2,  # losses behind the aperture and all
        needed_snr=needed,
        thermal_w_root_s=m.beacon.required_power_w * math.sqrt(a.detection_s) / needed,
        shot_j=0.0,
        shortest_s=min(a.detection_s, s.detection_s),
    )
    half = half_angle_rad(m.beacon.divergence_rad, m.conventions.divergence)
    on_axis = beacon.irradiance_w_m2 * 10.0 ** (_off_axis_db(m, m.beacon, link.GaussianFall(half)) / 10.0)
    power = on_axis * math.pi * (half * m.beacon.distance_m) ** 2 / 2.0
    beams = acquisition.Beams(
        power_w=power,
        range_m=m.beacon.distance_m,
        narrow_half_angle_rad=s.beam_radius_rad,
        beam_radius_rad=s.beam_radius_rad,
        overlap=max(s.overlap, 0.01),
    )
    return acquisition.wide_against_scan(TRADE_RAD, s.coverage, beams, receiver, jitter_rms_rad=s.jitter_rms_rad)
