"""The fine-pointing loop in sampled windows of a contact: its error, and the margin that this leaves the link."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import link
from microrad.core.arrays import Floats
from microrad.core.units import SPEED_OF_LIGHT_M_S, format_quantity, plain
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.study.contact_run.records import Contact, Loss, Settings, Sight, Window

MOST_SAMPLES = 5_000_000
"""Control samples in the windows of a contact beyond which they would not fit into memory."""


@dataclass(frozen=True, slots=True)
class MovingReference(Reference):
    """Point-ahead that changes evenly, and the settled lag of a body that follows a rate that does; one axis.

    ``line_of_sight_rate_rad_s`` is what command leaves of the rate at time 0. A sine is not in it.
    """

    point_ahead_rate_rad_s: float = 0.0
    acceleration_rad_s2: float = 0.0

    def at(self, time_s: Floats) -> Floats:
        """Reference (rad) at these times (s).

        point-ahead + its rate t + (rate + acceleration t) / w - acceleration / w^2 with w = 2 pi f_b: what a loop of
        first order leaves of a parabola once it has settled.
        """
        time = np.asarray(time_s, dtype=float)
        body = 2.0 * math.pi * self.body_bandwidth_hz
        rate = self.line_of_sight_rate_rad_s + self.acceleration_rad_s2 * time
        lag = (rate - self.acceleration_rad_s2 / body) / body
        return np.asarray(self.point_ahead_rad + self.point_ahead_rate_rad_s * time + lag)


def plan(start_s: float, end_s: float, settings: Settings) -> tuple[tuple[float, float], ...]:
    """Begin and length (s) of each window, from the begin of data to the end of the contact.

    There are as many as the settings want, or fewer so that none overlap; where the data is shorter than a window, one
    as long as the data.

    Args:
        start_s: Begin of the data, in s.
        end_s: End of the contact, in s.
        settings: Number and length of the windows wanted.
    """
    length = min(settings.window_s, end_s - start_s)
    count = min(settings.windows, max(int((end_s - start_s) / settings.window_s + 1e-9), 1))
    return tuple((float(begin), length) for begin in np.linspace(start_s, end_s - length, count))


@dataclass(frozen=True, slots=True)
class Sampler:
    """Runs the windows of one contact under one controller on the mission's loop.

    Raises ValueError where the data rate of the link is still to be solved for.
    """

    data: link.DataLink
    table: FinePointing
    loop: PointingLoop
    controller: LoopController
    contact: Contact
    settings: Settings

    def __post_init__(self) -> None:
        """Raises ValueError if a window holds no control sample, or all together more than memory holds."""
        period = self.loop.timing.period_s
        if round(self.settings.window_s / period) < 1:
            raise ValueError(
                f"window_s of a contact run is {format_quantity(self.settings.window_s, 's')}, less than a control "
                f"period ({format_quantity(period, 's')}): give a longer window"
            )
        samples = self.settings.windows * self.settings.window_s / period
        if samples > MOST_SAMPLES:
            raise ValueError(
                f"{self.settings.windows} windows of {format_quantity(self.settings.window_s, 's')} hold "
                f"{plain(samples)} control samples of a contact run, which may have at most {MOST_SAMPLES}: give "
                "fewer windows, or shorter ones"
            )

    def windows(self, planned: Sequence[tuple[float, float]], first: int = 0) -> list[Window | None]:
        """Run the planned windows; None for one without a control sample.

        Their random streams are those of the ensemble's runs of their numbers with the settings' seed.

        Args:
            planned: Begin and length of each window, in s, all of one length.
            first: Number of the first window, on which its random stream depends.
        """
        period, length_s = self.loop.timing.period_s, planned[0][1]
        samples, settling = round(length_s / period), round(self.settings.settle_s / period)
        if samples < 1:
            return [None for _ in planned]
        span = ensemble.Span((settling + samples) * period, settling * period, self.settings.seed)
        # no later than the contact, not even by rounding: an ephemeris may end with it
        last_s = self.contact.end_s
        ends = [self.contact.sight(np.array([begin, min(begin + length_s, last_s)])) for begin, _ in planned]
        moving = [self._moving(each, length_s, settling * period) for each in ends]
        errors, turned = traces.side_by_side(self.loop, self.controller, span, moving, first)
        each = zip(planned, ends, errors, turned, strict=True)
        return [self._of(begin, at, length_s, error, angle, settling) for (begin, _), at, error, angle in each]

    def window(self, number: int, start_s: float, length_s: float) -> Window | None:
        """Run one window by itself; None without a control sample in it.

        Args:
            number: Number of the window, on which its random stream depends.
            start_s: Begin of the window, in s.
            length_s: Its length, in s.
        """
        return self.windows([(start_s, length_s)], number)[0]

    def _of(
        self, start_s: float, ends: Sight, length_s: float, error_rad: Floats, mirror_rad: Floats, settling: int
    ) -> Window:
        """The window of a run, whose settling time is left out."""
        radial = np.hypot.reduce(error_rad[settling:], axis=1)
        time = start_s + self.loop.timing.period_s * np.arange(radial.size, dtype=np.float64)
        margin = self.margin_db(radial, _between(ends, (time - start_s) / length_s))
        loss, kept = self._loss(time, radial, margin, ends, settling)
        turned = mirror_rad[settling : settling + kept] @ self.loop.optics.T
        return self._window(ends, np.mean(turned, axis=0), loss, (time[:kept], radial[:kept], margin[:kept]))

    def _window(
        self, ends: Sight, mirror_rad: Floats, loss: Loss | None, traced: tuple[Floats, Floats, Floats]
    ) -> Window:
        time, radial, margin = traced
        return Window(
            start_s=float(time[0]),
            seconds=time.size * self.loop.timing.period_s,
            range_m=float(ends.range_m[0]),
            point_ahead_rad=float(ends.point_ahead_rad[0]),
            rate_rad_s=float(ends.rate_rad_s[0]),
            rms_rad=float(np.sqrt(np.mean(radial**2))),
            quantile_rad=float(np.quantile(radial, self.table.quantile)),
            largest_rad=float(np.max(radial)),
            lowest_margin_db=float(np.min(margin)),
            share_below=float(np.mean(margin < 0.0)),
            mirror_rad=tuple(float(v) for v in mirror_rad),
            loss=loss,
            time_s=time,
            radial_rad=radial,
            margin_db=margin,
        )

    def _moving(self, ends: Sight, length_s: float, settling_s: float) -> tuple[Reference, ...]:
        """The loop's references with those of the moment on axis x, time 0 at the begin of the settling."""
        r = self.table.reference
        left, carried = 1.0 - r.rate_feedforward, 1.0 if r.point_ahead_on_mirror else 0.0
        turning = float(np.diff(ends.rate_rad_s)[0]) / length_s * left
        ahead_rate = float(np.diff(ends.point_ahead_rad)[0]) / length_s * carried
        moving = MovingReference(
            point_ahead_rad=carried * float(ends.point_ahead_rad[0]) - ahead_rate * settling_s,
            line_of_sight_rate_rad_s=left * float(ends.rate_rad_s[0]) - turning * settling_s,
            body_bandwidth_hz=self.table.body.bandwidth_hz,
            point_ahead_rate_rad_s=ahead_rate,
            acceleration_rad_s2=turning,
        )
        return (moving, *self.loop.references[1:])

    def margin_db(self, radial_rad: Floats, sight: Sight) -> Floats:
        """Margin of the communication link at the mission's data rate, for radial errors and where they occur.

        What is lost more than budgeted goes with the range (`link.farther_db`). A point-ahead that the mission does not
        correct adds to the length of every error, as it does in the mission's budget, and is that of the geometry here.

        Args:
            radial_rad: Radial pointing errors, in rad, of a shape that broadcasts against the sight.
            sight: Range and point-ahead at the time of each error.
        """
        fall, ahead = self.data.beam.fall, self.data.shared.point_ahead
        on_axis = float(link.margin_of_error(self.data, 0.0)) + float(fall.loss_db(self.data.shared.point_ahead_rad))
        missed = sight.point_ahead_rad if ahead is not None and not ahead.corrected else 0.0
        farther = link.farther_db(self.data, sight.range_m)
        return np.asarray(on_axis - farther - fall.loss_db(radial_rad + missed))

    def _loss(
        self, time: Floats, radial: Floats, margin: Floats, ends: Sight, settling: int
    ) -> tuple[Loss | None, int]:
        """The first loss of lock, and how many samples there are up to it."""
        period, seen = self.loop.timing.period_s, self.loop.optical.field_of_view_rad
        hold = int(self.settings.hold_s / period + 1e-9) + 1  # samples that last longer than hold_s
        exposed = (settling + np.arange(time.size)) % self.loop.optical.every == 0
        off = np.flatnonzero(exposed & (radial > seen))
        dark = first_run(margin < 0.0, hold)
        if off.size and (dark is None or off[0] < dark + hold):
            at = int(off[0])
            since = float(time[at])
            where = f"{format_quantity(float(radial[at]), 'rad', 2)} off, it sees {format_quantity(seen, 'rad')}"
            cause = f"spot beyond the optical sensor's field of view at {since:.3f} s: {where}"
            return Loss(since, since + period, since + period, cause), at + 1
        if dark is None:
            return None, time.size
        since, lasted = float(time[dark]), hold * period
        range_m = float(_between(ends, np.array([(since - time[0]) / (period * time.size)])).range_m[0])
        far, worst = format_quantity(range_m, "m", 3), float(np.max(radial[dark : dark + hold]))
        cause = (
            f"margin below 0 dB for {format_quantity(lasted, 's', 3)} at {since:.3f} s: "
            f"{format_quantity(worst, 'rad', 2)} off, range {far}"
        )
        back = 2.0 * range_m / SPEED_OF_LIGHT_M_S
        return Loss(since, since + lasted, since + lasted + back, cause), dark + hold


def first_run(holds: NDArray[np.bool_], length: int) -> int | None:
    """Index at which the first long enough run of true values begins, or None.

    Args:
        holds: The values, shape (samples,).
        length: How many true values in a row are long enough.
    """
    edges = np.flatnonzero(np.diff(holds, prepend=False, append=False))
    begins, ends = edges[::2], edges[1::2]
    long = np.flatnonzero(ends - begins >= length)
    return int(begins[long[0]]) if long.size else None


def _between(ends: Sight, share: Floats) -> Sight:
    """The line of sight between two moments, straight in each number."""
    return Sight(*(pair[0] + (pair[1] - pair[0]) * share for pair in ends))
