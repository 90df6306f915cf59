"""Probability and time of detection by a scan, with the gaps that vibration opens between its tracks; and simulated.

The closed form takes the vibration as constant within one crossing and independent from track to track (from dwell to
dwell): its correlation time is long against a crossing and short against the return of the beam on the next track.
Tracks are straight and parallel over a few pitches; only the displacement across the track counts. A faster vibration
breaks up the crossings, or gives a long dwell more chances than one: simulate it.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.units import LEAST, format_quantity
from microrad.link.acquisition.scan import Duration, Raster, Scan, Spiral, StepStare
from microrad.link.acquisition.times import TimeDistribution, merged
from microrad.mission.fields import Bounded, Quantity, Whole

_RMS = Quantity("rad", least=0.0)
_REACH = 8.0  # standard deviations of the vibration
_TIMES = 2048
_RADII = 2048
_DISTANCES = 8192
_CELL = 192  # points along each side of a grid cell
_ALONG = 64  # times along a row
_SHARP = 1e-3  # rms of the vibration in pitches below which the swath's edges are sharp
_LOOKS = 1e4  # on one crossing of a target
_MOST_EDGES = 1e3  # of swaths within reach of a target
_NODE, _NODE_WEIGHT = np.polynomial.legendre.leggauss(4)


def gap_probability(scan: Scan, jitter_rms_rad: float = 0.0) -> float:
    """Probability that one scan misses a target inside the searched disc, away from its edge.

    A target at offset u from its nearest track is missed with the product over the tracks of 1 - q(u + k pitch); the
    mean is over u in one pitch (over one cell of a grid of dwells).

    Args:
        scan: The pattern of the beam, with its search and detector.
        jitter_rms_rad: Rms of the vibration about each axis, in rad.

    Raises:
        ValueError: If the rms is negative or not finite.
    """
    _check_rms(jitter_rms_rad)
    if isinstance(scan, StepStare):
        _, _, probability = _cell(scan, jitter_rms_rad)
        return float(np.mean(np.prod(1.0 - probability, axis=-1)))
    offset, weight = _offsets(scan, jitter_rms_rad)
    return float(1.0 - np.sum(weight * _first(scan, offset, jitter_rms_rad)) / scan.search.pitch_rad)


def detection_times(scan: Scan, jitter_rms_rad: float = 0.0) -> TimeDistribution:
    """Time until one scan detects the target, which lies as the uncertainty says.

    The probabilities of the times sum up to that of the scan. Each crossing counts, and the first that detects gives
    the time: that of the middle of the crossing, in a dwell that of the mean look. The ends of a raster's rows count as
    sharp: 1 % too few at a disc of 5 beam radii, less at wider.

    Args:
        scan: The pattern of the beam, with its search and detector.
        jitter_rms_rad: Rms of the vibration about each axis, in rad.

    Raises:
        ValueError: If the rms is negative or not finite.
    """
    _check_rms(jitter_rms_rad)
    if isinstance(scan, Spiral):
        return _spiral_times(scan, jitter_rms_rad)
    if isinstance(scan, Raster):
        return _raster_times(scan, jitter_rms_rad)
    return _dwell_times(scan, jitter_rms_rad)


def _check_rms(jitter_rms_rad: float) -> None:
    _RMS.check("the vibration's rms", jitter_rms_rad)
    if 0.0 < jitter_rms_rad < LEAST:
        raise ValueError(f"the vibration's rms is {jitter_rms_rad} rad; what is below {LEAST:g} is 0: write that")


def _levels(scan: Spiral | Raster) -> tuple[Floats, Floats]:
    """Half width of the swath with at least n looks, n = 1, 2, ..., and the probability that look n detects first."""
    p = scan.detector.probability
    look = scan.speed_rad_s * scan.detector.detection_time_s  # path of the beam in one look
    beam = scan.search.beam_radius_rad
    most = max(int(min(2.0 * beam / look, 1e9) * (1.0 + 1e-9)), 1)
    if 2.0 * beam / look > _LOOKS and p < 1.0 / _LOOKS:
        raise ValueError(
            f"the beam stays on a target for {2.0 * beam / look:.3g} looks, each of which detects it with a "
            f"probability of {p:.3g}: scan faster, or count several looks as one"
        )
    if 1.0 / _LOOKS < p < 1.0:
        most = min(most, math.ceil(math.log(1e-12) / math.log1p(-p)) + 1)
    number = np.arange(1, (1 if p == 1.0 else most) + 1)
    half = np.sqrt(np.maximum(beam**2 - (number * look / 2.0) ** 2, 0.0))
    return half, np.asarray(p * (1.0 - p) ** (number - 1.0), dtype=np.float64)


def _track_probability(scan: Spiral | Raster, offset: Floats, jitter_rms_rad: float) -> Floats:
    """Probability of detection by a track at each offset from the target."""
    from scipy.special import ndtr

    total = np.zeros_like(offset)
    for half, weight in zip(*_levels(scan), strict=True):
        if jitter_rms_rad > 0.0:
            inside = ndtr((half - offset) / jitter_rms_rad) - ndtr((-half - offset) / jitter_rms_rad)
        else:
            inside = np.abs(offset) < half
        total += weight * inside
    return total


def _first(scan: Spiral | Raster, offset: Floats, jitter_rms_rad: float, before: int | None = None) -> Floats:
    """Probability that the track at each offset detects, and none of the tracks `before` it did."""
    pitch = scan.search.pitch_rad
    all_before = math.ceil((float(np.max(offset)) - float(np.min(offset))) / pitch)
    first = _track_probability(scan, offset, jitter_rms_rad)
    for track in range(1, min(all_before, all_before if before is None else before) + 1):
        first = first * (1.0 - _track_probability(scan, offset - track * pitch, jitter_rms_rad))
    return first


def _offsets(scan: Spiral | Raster, jitter_rms_rad: float) -> tuple[Floats, Floats]:
    """Offsets of a track from the target and their weights for a quadrature, split where the swath's edges lie."""
    pitch = scan.search.pitch_rad
    reach = scan.search.beam_radius_rad + _REACH * jitter_rms_rad
    half = _levels(scan)[0]
    overlapping = 2.0 * reach / pitch
    if overlapping * half.size > _MOST_EDGES:
        raise ValueError(
            f"a target is within reach of {overlapping:.3g} tracks, and {half.size} looks on each: the tracks lie "
            f"{format_quantity(pitch, 'rad')} apart, and beam and vibration reach {format_quantity(reach, 'rad')}; let "
            "them overlap less, or scan a steadier beam"
        )
    track = pitch * np.arange(math.ceil(overlapping) + 1)
    edges = np.concatenate([(half + track[:, None]).ravel(), (track[:, None] - half).ravel(), [-reach, reach]])
    edges = np.unique(edges[np.abs(edges) <= reach])
    step = min(pitch / 16.0, jitter_rms_rad / 2.0) if jitter_rms_rad > _SHARP * pitch else pitch / 16.0
    parts = np.ceil(np.diff(edges) / step).astype(int)
    low = np.concatenate([a + (b - a) / n * np.arange(n) for a, b, n in zip(edges[:-1], edges[1:], parts, strict=True)])
    width = np.repeat(np.diff(edges) / parts, parts)
    offset = low[:, None] + width[:, None] * (1.0 + _NODE) / 2.0
    weight = width[:, None] * _NODE_WEIGHT / 2.0
    return np.asarray(offset.ravel(), dtype=np.float64), np.asarray(weight.ravel(), dtype=np.float64)


def _spiral_times(scan: Spiral, jitter_rms_rad: float) -> TimeDistribution:
    search = scan.search
    offset, weight = _offsets(scan, jitter_rms_rad)
    share = weight * _first(scan, offset, jitter_rms_rad) / search.pitch_rad
    used = share > 0.0
    offset, share = offset[used], share[used]
    edge = np.linspace(0.0, scan.duration_s, _TIMES + 1)
    track = scan.track_radius(edge)
    radius = np.linspace(0.0, search.radius_rad + float(np.max(np.abs(offset), initial=0.0)), _RADII)
    within = -np.expm1(-((radius / search.sigma_rad) ** 2) / 2.0)
    # detected by the time the track has radius rho: the target's radius is below rho - offset
    found = np.zeros_like(track)
    for begin in range(0, offset.size, 256):
        part = slice(begin, begin + 256)
        found += np.interp(track[:, None] - offset[part], radius, within, left=0.0) @ share[part]
    middle = (edge[:-1] + edge[1:]) / 2.0
    return merged(np.concatenate(([0.0], middle)), np.concatenate((found[:1], np.diff(found))))


def _raster_times(scan: Raster, jitter_rms_rad: float) -> TimeDistribution:
    from scipy.special import ndtr

    search, row = scan.search, scan.row_rad
    offset, weight = _offsets(scan, jitter_rms_rad)
    sigma = search.sigma_rad
    reached = math.ceil(float(np.ptp(offset)) / search.pitch_rad)
    first = [weight * _first(scan, offset, jitter_rms_rad, before) for before in range(reached + 1)]
    across = np.array([float(first[min(i, reached)] @ _density(place - offset, sigma)) for i, place in enumerate(row)])
    edge = np.linspace(-search.radius_rad, search.radius_rad, _ALONG + 1)
    along = np.diff(ndtr(edge / sigma))
    middle = (edge[:-1] + edge[1:]) / 2.0
    begin = np.arange(scan.rows) * (scan.row_time_s + scan.turn_around_s)
    time = begin[:, None] + (middle + search.radius_rad) / scan.speed_rad_s  # to and fro alike: the axis is symmetric
    return merged(np.asarray(time.ravel(), dtype=np.float64), np.multiply.outer(across, along).ravel())


def _density(place: Floats, sigma_rad: float) -> Floats:
    return np.asarray(np.exp(-((place / sigma_rad) ** 2) / 2.0) / (sigma_rad * math.sqrt(2.0 * math.pi)))


def _cell(scan: StepStare, jitter_rms_rad: float) -> tuple[Floats, NDArray[np.int64], Floats]:
    """The rectangle of one pitch by one row around a dwell, in parts, and the dwells that may see it.

    Edges of the parts along each side, (2, n + 1); grid steps to the dwells, (steps, 2); the probability that each of
    these detects in each part, (n, n, steps).
    """
    search = scan.search
    side = int(np.clip(4.0 * search.pitch_rad / max(jitter_rms_rad, 1e-12), 16, _CELL))
    edge = (np.arange(side + 1) / side - 0.5) * np.diag(scan.basis_rad)[:, None]
    part = (edge[:, :-1] + edge[:, 1:]) / 2.0
    point = np.stack(np.meshgrid(part[0], part[1], indexing="ij"), axis=-1)
    step = scan.near(search.beam_radius_rad + _REACH * jitter_rms_rad)
    away = np.hypot(*np.moveaxis(point[:, :, None, :] - step @ scan.basis_rad, -1, 0))
    inside = _landing(away, search.beam_radius_rad, jitter_rms_rad)
    used = np.max(inside, axis=(0, 1)) > 1e-12
    seen = float(scan.detector.crossing_probability(np.array([scan.dwell_s]))[0])
    return edge, step[used], seen * inside[:, :, used]


def _landing(away_rad: Floats, beam_radius_rad: float, jitter_rms_rad: float) -> Floats:
    """Probability that the beam, shifted by the vibration, reaches a target at each distance."""
    if jitter_rms_rad == 0.0:
        return np.asarray(away_rad < beam_radius_rad, dtype=np.float64)
    from scipy.stats import ncx2

    distance = np.linspace(0.0, float(np.max(away_rad)), _DISTANCES)  # a table: each value is slow
    inside = ncx2.cdf((beam_radius_rad / jitter_rms_rad) ** 2, 2, (distance / jitter_rms_rad) ** 2)
    return np.asarray(np.interp(away_rad, distance, inside), dtype=np.float64)


def _dwell_times(scan: StepStare, jitter_rms_rad: float) -> TimeDistribution:
    from scipy.special import ndtr

    search = scan.search
    sigma = search.sigma_rad
    edge, step, probability = _cell(scan, jitter_rms_rad)
    cell = scan.near(search.radius_rad + search.beam_radius_rad + _REACH * jitter_rms_rad)  # all that some dwell sees
    centre = cell @ scan.basis_rad
    along = np.diff(ndtr((centre[:, :1] + edge[0]) / sigma), axis=1)
    across = np.diff(ndtr((centre[:, 1:] + edge[1]) / sigma), axis=1)
    order = scan.order(cell[:, None, :] + step)
    # all cells whose dwells come in the same order share the chances of each dwell to be the first that detects
    sequence = np.where(order < scan.dwells, np.argsort(np.argsort(order, axis=1), axis=1), -1)
    patterns, label = np.unique(sequence, axis=0, return_inverse=True)
    found = np.zeros(scan.dwells)
    for index, pattern in enumerate(patterns):
        here = np.flatnonzero(label.ravel() == index)
        left = np.ones(probability.shape[:2])
        for dwell in np.argsort(pattern)[np.count_nonzero(pattern < 0) :]:
            first = left * probability[:, :, dwell]
            left = left - first
            share = np.sum((along[here] @ first) * across[here], axis=1)
            found += np.bincount(order[here, dwell], share, scan.dwells)
    begin = np.arange(scan.dwells) * (scan.dwell_s + scan.settle_s)
    time = np.asarray(begin + _mean_look(scan) * scan.detector.detection_time_s, dtype=np.float64)
    return merged(time, found)


def _mean_look(scan: StepStare) -> float:
    """Number of the look that detects, given that one in the dwell does."""
    look = np.arange(1.0, float(scan.detector.looks(np.array([scan.dwell_s]))[0]) + 1.0)
    chance = (1.0 - scan.detector.probability) ** (look - 1.0)
    return float(np.sum(look * chance) / np.sum(chance))


# ------------------------------------------------------------------------------------------------------------ simulated
@dataclass(frozen=True, slots=True)
class Vibration(Bounded):
    """Ornstein-Uhlenbeck jitter of the beam: rms in each axis and correlation time (spectrum 1/(2 pi time) wide)."""

    rms_rad: Annotated[float, _RMS]
    correlation_time_s: Duration


@dataclass(frozen=True, slots=True, eq=False)
class ScanRuns:
    """One simulated scan per run: where the target was, whether it was detected, and the time then or of the end."""

    target_x_rad: Floats
    target_y_rad: Floats
    detected: NDArray[np.bool_]
    time_s: Floats


def simulate_scan(scan: Scan, runs: int, seed: int, vibration: Vibration | None = None, samples: int = 128) -> ScanRuns:
    """Draw targets from the uncertainty and let the beam pass over each; (runs,) arrays.

    The beam follows its real path, sampled near the target in each pass and shifted by one continuous vibration of the
    whole scan. Every whole detection time that the beam stays on the target is one look.

    Args:
        scan: The pattern of the beam, with its search and detector.
        runs: Number of targets drawn.
        seed: Seed of the random numbers; the same one gives the same runs.
        vibration: Vibration of the beam; none by default.
        samples: Points of the path in each pass over the target, at least 2.

    Raises:
        ValueError: For no run and for less than 2 samples.
    """
    Whole("", least=1).check("the number of runs", runs)
    Whole("", least=2).check("the number of samples in a pass", samples)
    draw = np.random.Generator(np.random.Philox(key=seed))
    x, y = (draw.normal(0.0, scan.search.sigma_rad, runs) for _ in range(2))
    shake = vibration or Vibration(0.0, 1.0)
    start, end = scan.windows(x, y, scan.search.beam_radius_rad + 6.0 * shake.rms_rad)
    state = _Pass(scan, x, y, shake, draw)
    for window in range(start.shape[1]):
        begin, span = start[:, window], end[:, window] - start[:, window]
        for sample in range(samples):
            state.move(begin + span * (sample / (samples - 1)), begin + span / 2.0)
    return ScanRuns(x, y, state.detected, np.where(state.detected, state.found_s, scan.duration_s))


class _Pass:
    """The beam relative to the target in every run: time, vibration and how long the target has been lit."""

    def __init__(self, scan: Scan, x_rad: Floats, y_rad: Floats, shake: Vibration, draw: np.random.Generator) -> None:
        self.scan, self.shake, self.draw = scan, shake, draw
        self.target = np.stack([x_rad, y_rad])
        self.jitter = draw.normal(0.0, shake.rms_rad, self.target.shape) if shake.rms_rad else np.zeros((2, x_rad.size))
        self.time_s = np.zeros(x_rad.size)
        self.within_s = np.full(x_rad.size, -1.0)
        self.margin = np.ones(x_rad.size)  # squared distance less squared beam radius: negative when lit
        self.lit_s = np.zeros(x_rad.size)
        self.detected = np.zeros(x_rad.size, dtype=bool)
        self.found_s = np.zeros(x_rad.size)

    def move(self, time_s: Floats, within_s: Floats) -> None:
        """Go on to a time; a gap in the path, or a new pass, ends what was lit.

        Args:
            time_s: The new time of each run, in s, shape (runs,).
            within_s: A time within the pass that is under way in each run, in s, shape (runs,).
        """
        step = np.maximum(time_s - self.time_s, 0.0)
        if self.shake.rms_rad:
            kept = np.exp(-step / self.shake.correlation_time_s)
            noise = self.draw.normal(0.0, self.shake.rms_rad, self.jitter.shape)
            self.jitter = kept * self.jitter + np.sqrt(1.0 - kept**2) * noise
        beam = np.stack(self.scan.beam_at(time_s, within_s))
        margin = np.sum((beam + self.jitter - self.target) ** 2, axis=0) - self.scan.search.beam_radius_rad**2
        gap = (within_s != self.within_s) & (step > 0.0)
        before = np.where(gap, margin, self.margin)
        length = np.where(gap, 0.0, step)
        change = np.where(before == margin, 1.0, before - margin)
        part = np.clip(before / change, 0.0, 1.0)  # share of the step before the edge of the beam passes
        lit = margin < 0.0
        was = before < 0.0
        added = length * np.where(was, np.where(lit, 1.0, part), np.where(lit, 1.0 - part, 0.0))
        self.lit_s = np.where(was & ~gap, self.lit_s, 0.0) + added
        self._look(time_s)
        self.time_s, self.within_s, self.margin = np.maximum(time_s, self.time_s), within_s, margin

    def _look(self, time_s: Floats) -> None:
        needed = self.scan.detector.detection_time_s
        while True:
            ready = self.lit_s >= needed * (1.0 - 1e-6)
            if not np.any(ready):
                return
            self.lit_s = np.where(ready, self.lit_s - needed, self.lit_s)
            seen = ready & ~self.detected & (self.draw.random(ready.size) < self.scan.detector.probability)
            self.found_s[seen] = time_s[seen]
            self.detected |= seen
