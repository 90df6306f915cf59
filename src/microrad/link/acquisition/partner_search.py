"""The acquisition of a mission's partner: light on the tracking sensor, the paper's sequence, and a scan instead."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from microrad import link
from microrad.core.budget import Line, total_db
from microrad.link import pointing
from microrad.link.acquisition import detection, scan, sequence
from microrad.link.acquisition.trade import Beams, Receiver, Trade, wide_against_scan
from microrad.link.beams import GaussianFall
from microrad.link.budget.lines import POINT_AHEAD_LOSS, POINTING_LOSS
from microrad.loop import sensor
from microrad.mission.model import Source, source_text
from microrad.mission.tables.acquisition import LEAST_OVERLAP, Acquisition
from microrad.mission.tables.acquisition import Scan as ScanTable
from microrad.mission.tables.link import Beacon, Terminals, half_angle_rad, narrowest_half_angle_rad

THRESHOLD = 5.0
"""Threshold of the quad cell over its rms noise: a false alarm in 3.5 million readings."""
TRADE_RAD = np.geomspace(30e-6, 1e-3, 25)
"""Uncertainties per axis over which a wide beacon is set against a scan."""
EARLY = 0.9
"""Share of the acquisitions that end in lock by the time that is told of them."""
RAREST = 1e-9
"""Probability of lock below which a way to find the partner never does."""
DARK = 1e-6
"""Signal to noise in a reading below which the tracking sensor has no angle."""
LONGEST_LOOK_S = 1e6
"""Time on the partner beyond which a scan does not detect: the longest that a mission may state."""
_NEVER = 1e-12  # what a process is built with that cannot happen
_DEEPEST_MARGIN_DB = 200.0  # either way; beyond it a sensor detects at once, or not at all


@dataclass(frozen=True, slots=True)
class Sent:
    """The beacon or its answer: the table that describes it, and its budget."""

    table: Beacon
    budget: link.LinkBudget


@dataclass(frozen=True, slots=True)
class Tracking:
    """The answer's light on the quad cell of the satellite's own terminal, and what it is worth as an angle.

    `noise_equivalent_angle` is None where the light is lost in the noise, at a signal to noise below `DARK`.
    """

    power_w: float
    signal_to_noise: float
    noise_lines: tuple[Line, ...]
    noise_equivalent_angle: Line | None


@dataclass(frozen=True, slots=True)
class Found:
    """One way to find the partner: its stages, the exact outcome, and the seeded simulation of the same process."""

    name: str
    stages: tuple[sequence.Stage, ...]
    outcome: sequence.Outcome
    simulated: sequence.SequenceRuns
    log: tuple[sequence.Transition, ...]

    @property
    def possible(self) -> bool:
        """Whether it ever ends in lock; where it does not, its times mean nothing."""
        return self.outcome.success_probability >= RAREST

    @property
    def early_s(self) -> float:
        """Time by which `EARLY` of those that end in lock do; nan where none does."""
        return self.outcome.locked.given_success().quantile(EARLY) if self.possible else math.nan

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
class Scanned:
    """Acquisition by the mission's scan; `trade` sets a spiral with its beam and overlap against the wide beacon.

    The scan's beam has the half angle `half_angle_rad` at 1/e2 and is used out to `acquisition.scan.beam_radius`, where
    the partner's sensor needs `needed_detection_s` by its power alone; the scan gives it that or `stated_detection_s`,
    the longer. A scan by dwells has no speed. There is no trade for a spiral without overlap, nor where no scan
    detects.
    """

    found: Found
    duration_s: float
    radius_rad: float
    half_angle_rad: float
    speed_rad_s: float | None
    stated_detection_s: float
    needed_detection_s: float
    trade: Trade | None

    @property
    def detects(self) -> bool:
        """Whether the scan's beam brings enough light."""
        return self.needed_detection_s <= LONGEST_LOOK_S


@dataclass(frozen=True, slots=True)
class Finding:
    """Acquisition by the wide beacon and, where the mission has a scan, by that.

    `sigma_rad` is the uncertainty per axis about the predicted direction, biases and all; the radii say how far off
    its axis each beam still suffices.
    """

    chances: sequence.Chances
    sigma_rad: float
    beacon_radius_rad: float
    answer_radius_rad: float
    return_radius_rad: float
    wide: Found
    scanned: Scanned | None

    @property
    def scan(self) -> Found | None:
        """The way by the scan."""
        return None if self.scanned is None else self.scanned.found

    @property
    def trade(self) -> Trade | None:
        """The wide beacon against a scan."""
        return None if self.scanned is None else self.scanned.trade

    def way(self, name: str) -> Found | None:
        """The way of this name, "wide beacon" or "scan"; None for a scan in a mission without one."""
        return self.wide if name == "wide beacon" else self.scan

    @property
    def ways(self) -> tuple[Found, ...]:
        """Each way to find the partner."""
        return (self.wide,) if self.scanned is None else (self.wide, self.scanned.found)


def answer_on_sensor(
    a: Acquisition | None, aperture_m: float, answer: Sent | None, sources: Mapping[str, Source]
) -> Tracking | None:
    """The answer on the quad cell of `[acquisition.sensor]` behind an aperture; None without an answer or a sensor.

    Args:
        a: The mission's table on acquisition, None where it has none.
        aperture_m: Diameter of the aperture in front of the quad cell, in m.
        answer: The answer with its budget, None where the mission has none.
        sources: Where each value of the mission comes from, by its dotted key.
    """
    if answer is None or a is None or a.sensor is None:
        return None
    s = a.sensor
    cell = sensor.QuadCell(s.responsivity_a_w, s.background_power_w, s.dark_current_a, s.thermal_noise_a_sqrt_hz)
    spot = sensor.AirySpot(answer.table.wavelength_m, aperture_m)
    source = f"answer budget; {source_text(sources, 'acquisition.sensor.rate')}"
    bandwidth, power = sensor.noise_bandwidth_hz(s.rate_hz), answer.budget.received_power_w
    ratio = cell.signal_to_noise(power, bandwidth)
    angle = None if ratio < DARK else sensor.noise_equivalent_angle_line(cell, spot, power, s.rate_hz, source)
    return Tracking(power, ratio, cell.noise_lines(power, bandwidth, source), angle)


def find_partner(
    a: Acquisition, data: link.DataLink, error: pointing.Jitter, beacon: Sent, answer: Sent, light: Tracking | None
) -> Finding:
    """Acquisition as the mission's table times it, by the wide beacon and, where the table has one, by a scan.

    Args:
        a: The mission's table on acquisition.
        data: The communication link, whose narrow beam is sent back.
        error: Error of the predicted direction: bias and rms of each axis, in rad.
        beacon: The beacon with its budget.
        answer: The answer with its budget.
        light: The answer on the tracking sensor, None without a sensor.

    Raises:
        ValueError: For a scan of a direction that is known without error.
    """
    shared = data.shared
    radii = (_reach(beacon, shared), _reach(answer, shared), _return_reach(data))
    chances = sequence.Chances(
        beacon_coverage=_coverage(error, radii[0]),
        frame_detection=a.detection_probability,
        answer_coverage=_coverage(
            _equal_axes(shared.point_ahead_rad, answer.table.pointing_error_rad / a.pointing_sigmas), radii[1]
        ),
        answer_detection=_possible(_answer_detection(a, light)),
        return_coverage=_possible(_return_coverage(shared, light, radii[2])),
        lock=a.lock_probability,
    )
    timing = _timing(shared.terminals, a, shared.range_m(beacon.table))
    sigma = max(math.hypot(b, s) for b, s in zip(error.bias_rad, error.rms_rad, strict=True))
    wide = _solved("wide beacon", sequence.paper_sequence(timing, chances), a)
    scanned = None
    if a.scan is not None:
        answering = sequence.answer_stages(timing, chances)
        scanned = _scanned(a, a.scan, _sender(shared, beacon, a, a.scan), sigma, timing, answering)
    return Finding(chances, sigma, *radii, wide, scanned)


def _timing(terminals: Terminals, a: Acquisition, range_m: float) -> sequence.Timing:
    own, partner = terminals.called("leo"), terminals.called("geo")
    if own == partner:  # two terminals of one make
        own, partner = f"{own} (own)", f"{partner} (partner)"
    return sequence.Timing(
        range_m=range_m,
        body_settling_s=a.settle_s,
        frame_time_s=a.detection_s,
        frames=a.detection_frames,
        geo_response_s=a.response_s,
        leo_detection_s=a.measurement_s,
        mirror_settling_s=a.steering_s,
        lock_time_s=a.lock_s,
        own_name=own,
        partner_name=partner,
    )


def _reach(sent: Sent, shared: link.Shared) -> float:
    """How far off its axis a Gaussian beam still brings the power that is needed, and is counted on."""
    fall = GaussianFall(half_angle_rad(sent.table.divergence_rad, shared.conventions.divergence))
    return fall.error_rad(min(_on_axis_margin_db(sent.budget), link.DEEPEST_DB))


def _on_axis_margin_db(budget: link.LinkBudget) -> float:
    """Margin of a beam that points at its partner."""
    aimed = (line for line in budget.lines if line.name not in (POINTING_LOSS, POINT_AHEAD_LOSS))
    return total_db(aimed) - (10.0 * math.log10(budget.required_power_w) + 30.0)


def _return_reach(data: link.DataLink) -> float:
    """How far off its axis the narrow beam back suffices: out to 1/e2 at most, and as far as its margin goes."""
    fall = data.beam.fall
    received_dbm = link.received_on_axis_dbm(data) - data.added_db
    margin_db = received_dbm - float(link.required_dbm(data, data.table.data_rate_bit_s))
    return 0.0 if margin_db <= 0.0 else min(fall.half_angle_rad, fall.error_rad(margin_db))


def _return_coverage(shared: link.Shared, light: Tracking | None, radius_rad: float) -> float:
    """Probability that the narrow beam back lands; it goes where the tracking sensor says, if that has an angle."""
    if light is None:
        noise_rad = 0.0
    elif light.noise_equivalent_angle is None:
        return 0.0
    else:
        noise_rad = light.noise_equivalent_angle.value
    return float(pointing.radial_cdf(_equal_axes(shared.point_ahead_left_rad, noise_rad), radius_rad))


def _equal_axes(bias_rad: float, rms_rad: float) -> pointing.Jitter:
    """A direction with the same rms about both axes, and a bias about one of them."""
    return pointing.Jitter((bias_rad, 0.0), (rms_rad, rms_rad))


def _coverage(error: pointing.Jitter, radius_rad: float) -> float:
    """Probability that the direction is within the radius."""
    return _possible(float(pointing.radial_cdf(error, radius_rad)))


def _possible(probability: float) -> float:
    """A probability that a process can be built with: what never happens does so once in 10^12 times."""
    return min(max(probability, _NEVER), 1.0)


def _answer_detection(a: Acquisition, light: Tracking | None) -> float:
    """Probability that the quad cell sees the answer within one measurement."""
    if light is None or a.sensor is None:
        return a.detection_probability
    # the noise of a measurement falls with the root of the readings in it
    readings = max(a.measurement_s * a.sensor.rate_hz, 1.0)
    return sequence.frame_detection_probability(light.signal_to_noise * math.sqrt(readings), THRESHOLD)


def _pattern(s: ScanTable, sigma_rad: float, look_s: float) -> scan.Scan:
    """The mission's scan, as fast as a detector that looks that long allows."""
    if sigma_rad == 0.0:
        raise ValueError(
            "pointing.lines: every error is 0 rad, and a scan has nothing to cover; give an error above 0 rad, or take "
            "out acquisition.scan"
        )
    search = scan.Search(sigma_rad, s.beam_radius_rad, s.overlap, s.coverage)
    detector = scan.Detector(look_s)
    if s.pattern == "step-stare":
        return scan.StepStare(search, detector, look_s, s.turn_s)
    speed = scan.highest_speed(search, look_s)
    if s.pattern == "raster":
        return scan.Raster(search, detector, speed, s.turn_s)
    return scan.Spiral(search, detector, speed)


def _scanned(
    a: Acquisition,
    s: ScanTable,
    sender: tuple[Beams, Receiver],
    sigma_rad: float,
    timing: sequence.Timing,
    answering: tuple[sequence.Stage, ...],
) -> Scanned:
    """The scan at the pace that its light allows, before the stages from the answer on."""
    beams, receiver = sender
    needed = float(receiver.detection_time_s(receiver.aperture_area_m2 * beams.edge_irradiance_w_m2))
    pattern = _pattern(s, sigma_rad, max(needed, s.detection_s))
    times = detection.detection_times(pattern, s.jitter_rms_rad)
    detects, overlapping = needed <= LONGEST_LOOK_S, s.overlap >= LEAST_OVERLAP
    times = times if detects else times.scaled(_NEVER)
    stages = (*sequence.scan_stages(timing, times, pattern.duration_s), *answering)
    # nor is a look of the trade shorter than any that the mission states
    least = replace(receiver, shortest_s=min(a.detection_s, s.detection_s))
    return Scanned(
        found=_solved(f"{s.pattern} scan", stages, a),
        duration_s=pattern.duration_s,
        radius_rad=pattern.search.radius_rad,
        half_angle_rad=beams.narrow_half_angle_rad,
        speed_rad_s=None if isinstance(pattern, scan.StepStare) else pattern.speed_rad_s,
        stated_detection_s=s.detection_s,
        needed_detection_s=needed,
        trade=wide_against_scan(TRADE_RAD, s.coverage, beams, least, s.jitter_rms_rad)
        if detects and overlapping
        else None,
    )


def _solved(name: str, stages: tuple[sequence.Stage, ...], a: Acquisition) -> Found:
    return Found(
        name,
        stages,
        sequence.solve_sequence(stages, a.attempts),
        sequence.simulate(stages, a.attempts, a.runs, a.seed),
        sequence.simulate_log(stages, a.attempts, a.seed),
    )


def _sender(shared: link.Shared, beacon: Sent, a: Acquisition, s: ScanTable) -> tuple[Beams, Receiver]:
    """The beacon's power in the scan's narrow beam, and the partner's sensor.

    The sensor is that of the beacon budget: it needs its required power for one frame, and four times as long at half
    the power, as noise that does not depend on the light has it. Every loss but those off the axis is in the power.
    The beam is as narrow as the radius out to which it is used, but no narrower than diffraction at its aperture.
    """
    beam, range_m = beacon.table, shared.range_m(beacon.table)
    half = half_angle_rad(beam.divergence_rad, shared.conventions.divergence)
    least = narrowest_half_angle_rad(shared.terminals.leo_aperture_m, beam.wavelength_m)
    area = math.pi / 4.0 * shared.terminals.geo_aperture_m**2
    margin_db = min(max(_on_axis_margin_db(beacon.budget), -_DEEPEST_MARGIN_DB), _DEEPEST_MARGIN_DB)
    on_axis = beam.required_power_w * 10.0 ** (margin_db / 10.0) / area
    beams = Beams(
        power_w=on_axis * math.pi * (half * range_m) ** 2 / 2.0,
        range_m=range_m,
        narrow_half_angle_rad=max(s.beam_radius_rad, least),
        beam_radius_rad=s.beam_radius_rad,
        overlap=s.overlap,
    )
    return beams, Receiver(area, beam.required_power_w, a.detection_s)
