"""A communication link under a distribution of pointing errors: margin, outage, fades, best divergence."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.link import beams, coupling, gains, pointing
from microrad.link.budget.assembly import RAREST
from microrad.link.radial_error import radial_steps
from microrad.mission.tables.link import LinkRequirement


@dataclass(frozen=True, slots=True)
class Exposure:
    """The communication link under radial pointing errors.

    ``on_axis_db`` is its margin without any. ``ahead_rad`` is an uncorrected point-ahead, which is added to the length
    of every error. ``quantile_rad`` is the error that is exceeded for the mission's outage, and ``beyond`` gives the
    share of the time with a larger error than one in rad. ``lost_db`` is sent over received power without any error.
    ``received_db`` is what the receiver's own static error costs it. Where that has a distribution, or the light fades
    in the air, ``both`` are the losses at either end, of whose sum everything is; ``share`` is the outage then.
    """

    fall: beams.OffAxis
    on_axis_db: float
    lost_db: float
    ahead_rad: float
    quantile_rad: float
    beyond: Callable[[float], float]
    received_db: float
    both: coupling.BothEnds | None
    share: float

    @classmethod
    def of(
        cls,
        data: link.DataLink,
        quantile_rad: float,
        beyond: Callable[[float], float],
        errors: "Callable[[], ErrorDistribution]",
    ) -> "Exposure":
        """The link under errors of which a quantile and the share beyond any size are known.

        Args:
            data: The communication link.
            quantile_rad: Radial error that is exceeded for the mission's outage, in rad.
            beyond: Share of the time with a larger radial error than the one given, in rad.
            errors: Gives the errors themselves, which a receiver with errors of its own asks for.

        Raises:
            ValueError: For a data rate that the receiver does not take.
        """
        received_dbm = link.received_on_axis_dbm(data)
        on_axis_db = received_dbm - float(link.required_dbm(data, data.table.data_rate_bit_s))
        lost_db = gains.dbm(data.table.transmit_power_w) - received_dbm
        fall, ahead, receiving = data.beam.fall, data.shared.point_ahead_rad, data.receiving
        both, received, outage = None, 0.0, 0.0
        if data.is_random:
            own, outage = errors(), stated_outage(data.requirement)
            both = data.both_ends(own.radius_rad, own.share)
        elif receiving is not None:
            received = receiving.static_db
        return cls(fall, on_axis_db, lost_db, ahead, quantile_rad, beyond, received, both, outage)

    @classmethod
    def stated(cls, data: link.DataLink) -> "Exposure":
        """The exposure of a link whose loop is not simulated: under its jitter, or at its static error all the time."""
        error = error_rad(data)
        if data.jitter is None:
            still = ErrorDistribution(np.array([error]), np.ones(1))
            return cls.of(data, error, lambda reach_rad: float(error > reach_rad), lambda: still)
        jitter = link.jitter_of(data.jitter)
        beyond = partial(_beyond, jitter)
        return cls.of(data, error, beyond, partial(GaussianErrors.of, jitter))

    @property
    def outage_loss_db(self) -> float:
        """Pointing loss at both ends that is not exceeded but for the outage."""
        if self.both is not None:
            return self.both.quantile_db(self.share)
        return float(self.fall.loss_db(self.quantile_rad + self.ahead_rad)) + self.received_db

    @property
    def margin_db(self) -> float:
        """Margin that is kept but for the outage."""
        return self.on_axis_db - self.outage_loss_db

    @property
    def possible(self) -> bool:
        """Whether no more light arrives than was sent, but for the outage: see `LinkBudget.possible`."""
        return self.lost_db + self.outage_loss_db >= 0.0

    @property
    def received_mean_db(self) -> float:
        """Loss of the mean power by the receiver's own pointing."""
        return self.received_db if self.both is None else self.both.received.mean_db

    def short_of(self, margin_db: float) -> float:
        """Share of the time with less than a margin."""
        spare = self.on_axis_db - margin_db - self.received_db
        if self.both is not None:  # an error may bring light back to a receiver that lies off its axis
            return self.both.beyond(spare)
        reach = self.fall.error_rad(spare) - self.ahead_rad
        return 1.0 if spare < 0.0 or reach < 0.0 else self.beyond(reach)


@dataclass(frozen=True, slots=True)
class ErrorDistribution:
    """Radial pointing errors with the share of the time that each stands for; together 1."""

    radius_rad: Floats
    share: Floats

    def quantile_rad(self, probability: float) -> float:
        """Error that a share of the time stays below."""
        order = np.argsort(self.radius_rad, kind="stable")
        total = np.cumsum(self.share[order])
        place = min(int(np.searchsorted(total, probability * total[-1])), total.size - 1)
        return float(self.radius_rad[order][place])

    def beyond(self, error_rad: float) -> float:
        """Share of the time with a larger error."""
        return float(np.sum(self.share[self.radius_rad > error_rad]))


@dataclass(frozen=True, slots=True)
class GaussianErrors(ErrorDistribution):
    """The errors of a known distribution, in radial steps that are small against it; quantiles and shares are exact."""

    jitter: pointing.Jitter

    @classmethod
    def of(cls, jitter: pointing.Jitter) -> "GaussianErrors":
        """The distribution of the radial errors that this jitter makes."""
        return cls(*radial_steps(jitter), jitter)

    def quantile_rad(self, probability: float) -> float:
        """Error that a share of the time stays below."""
        return _exact_quantile_rad(self.jitter, 1.0 - probability)

    def beyond(self, error_rad: float) -> float:
        """Share of the time with a larger error."""
        return _beyond(self.jitter, error_rad)


def _beyond(jitter: pointing.Jitter, error_rad: float) -> float:
    return float(pointing.radial_survival(jitter, error_rad))


@lru_cache(maxsize=256)  # most rows of a campaign draw something else than the jitter
def _exact_quantile_rad(jitter: pointing.Jitter, exceeded: float) -> float:
    """Error that is exceeded for a share of the time, which is told from none down to the last digit of 1."""
    return float(pointing.radial_quantile(jitter, max(exceeded, RAREST)))


@dataclass(frozen=True, slots=True)
class Performance:
    """The communication link under the pointing errors of one source, of one controller on one variant of the mirror.

    Everything comes from the errors' own distribution, but for the fades and the penalty, which take each axis for a
    Gaussian process of their bias, rms and spectrum, the penalty in a Gaussian beam. ``outage_loss_db`` is the pointing
    loss that is not exceeded but for the mission's ``outage``, and ``margin_db`` what it leaves; ``outage`` is the
    share of the time with less than 0 dB, ``short`` that with less than the required margin. ``data_rate_bit_s`` keeps
    the required margin at the outage loss. ``best`` is the Gaussian divergence with the most power at that error, no
    narrower than the present beam, which is what the aperture gives; ``best.wanted_half_angle_rad`` is the one without
    that limit, what a larger aperture would allow. ``fades_per_s`` and ``fade_s`` are of the fades below the required
    margin; nan without a spectrum.

    What the pointing error costs a coded link in power lies between two of these: ``mean_loss_db`` where its
    interleaver spans many fades, ``outage_loss_db`` where it spans none. ``uncoded_penalty_db`` is what it costs
    without a code; nan for a receiver of which only the measured sensitivity is known, infinite where no power makes
    up for it. ``error_rad`` is the radial error that is exceeded for the outage; ``possible`` says that no more light
    arrives than was sent there.

    An uncorrected point-ahead is added to the length of every error, as if it had the direction of each. The fades and
    the penalty have it as a bias, of one direction: see `with_point_ahead`. What a correction leaves is in none.
    """

    source: str
    controller: str
    mirror: str
    jitter: pointing.Jitter
    error_rad: float
    mean_loss_db: float
    outage_loss_db: float
    margin_db: float
    possible: bool
    outage: float
    short: float
    data_rate_bit_s: float
    best: pointing.BestDivergence
    uncoded_penalty_db: float
    fades_per_s: float
    fade_s: float
    fade_warning: str


def performance_under_jitter(data: link.DataLink) -> Performance | None:
    """The link under the jitter that the mission states of either end, or None where it states none."""
    if data.jitter is None and (data.receiving is None or data.receiving.jitter is None):
        return None
    if data.jitter is None:
        jitter, bandwidth_hz = pointing.Jitter((data.table.pointing_error_rad, 0.0), (0.0, 0.0)), 0.0
    else:
        jitter, bandwidth_hz = link.jitter_of(data.jitter), data.jitter.bandwidth_hz
    speed, (rms_x, rms_y) = 2.0 * math.pi * bandwidth_hz, jitter.rms_rad
    motion = pointing.SpectralMotion((rms_x, rms_y), (speed * rms_x, speed * rms_y), (0.0, 0.0), bandwidth_hz)
    return performance(data, "jitter as given", "", "", GaussianErrors.of(jitter), jitter, motion)


def error_rad(data: link.DataLink) -> float:
    """Radial pointing error (rad) at which the communication link is judged where no loop is simulated.

    Under a table `[jitter]` the one that is exceeded for the share `requirement.outage` of the time; the static
    `communication.pointing_error` without.
    """
    if data.jitter is None:
        return data.table.pointing_error_rad
    return _exact_quantile_rad(link.jitter_of(data.jitter), stated_outage(data.requirement))


def stated_outage(requirement: LinkRequirement) -> float:
    """Share of the time that the required margin may be missed, in a mission that has a jitter or a loop."""
    share = requirement.outage
    assert share is not None  # such a mission has to state it
    return share


def required_error_rad(data: link.DataLink) -> float:
    """Radial pointing error (rad) at which the required margin is wanted where a data rate is solved for.

    That of `error_rad` under a table `[jitter]`, `requirement.pointing_error` without.
    """
    return data.requirement.pointing_error_rad if data.jitter is None else error_rad(data)


def margin_db(data: link.DataLink) -> float:
    """Margin (dB) of the communication link at `error_rad`: the one of its budget.

    Raises ValueError for a data rate that the receiver does not take.
    """
    return Exposure.stated(data).margin_db


def performance(
    data: link.DataLink,
    source: str,
    controller: str,
    mirror: str,
    errors: ErrorDistribution,
    jitter: pointing.Jitter,
    motion: pointing.SpectralMotion | None,
) -> Performance:
    """The communication link under a distribution of pointing errors.

    Args:
        data: The communication link.
        source: Where the errors come from, in words.
        controller: The controller that leaves them; "" without one.
        mirror: The variant of the mirror under it; "" without one.
        errors: The radial errors and their shares of the time.
        jitter: Bias and rms of each axis, for the fades and the penalty of an uncoded link.
        motion: What the spectrum says of each axis; None where it is not known, and the fades are then nan.
    """
    q, kept = data.requirement, 1.0 - stated_outage(data.requirement)
    under = Exposure.of(data, errors.quantile_rad(kept), errors.beyond, lambda: errors)
    fall, ahead = under.fall, under.ahead_rad
    half, shifted = fall.half_angle_rad, with_point_ahead(jitter, ahead)
    spare = under.on_axis_db - under.received_db - q.margin_db
    fades_per_s, fade_s, warning = _fades(shifted, motion, data, spare)
    return Performance(
        source=source,
        controller=controller,
        mirror=mirror,
        jitter=jitter,
        error_rad=under.quantile_rad,
        mean_loss_db=_mean_loss_db(errors, fall.loss_db(errors.radius_rad + ahead)) + under.received_mean_db,
        outage_loss_db=under.outage_loss_db,
        margin_db=under.margin_db,
        possible=under.possible,
        outage=under.short_of(0.0),
        short=under.short_of(q.margin_db),
        data_rate_bit_s=_rate(data, under.outage_loss_db),
        best=pointing.best_divergence_for_static_error(
            errors.quantile_rad(kept) + ahead, smallest_half_angle_rad=half, current_half_angle_rad=half
        ),
        uncoded_penalty_db=_uncoded(data, shifted, under),
        fades_per_s=fades_per_s,
        fade_s=fade_s,
        fade_warning=warning,
    )


def with_point_ahead(jitter: pointing.Jitter, ahead_rad: float) -> pointing.Jitter:
    """The jitter with an uncorrected point-ahead in its bias.

    How the point-ahead lies to the axes is not stated. It is taken along the bias, which it makes longer, and without
    a bias along the axis with the larger rms, where it makes errors well beyond itself the most frequent; along x where
    the two are equal.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        ahead_rad: Point-ahead that is not corrected, in rad.
    """
    (x, y), static = jitter.bias_rad, jitter.static_rad
    wider = (1.0, 0.0) if jitter.rms_rad[0] >= jitter.rms_rad[1] else (0.0, 1.0)
    along = (x / static, y / static) if static else wider
    return pointing.Jitter((x + along[0] * ahead_rad, y + along[1] * ahead_rad), jitter.rms_rad)


def _mean_loss_db(errors: ErrorDistribution, loss_db: Floats) -> float:
    """Loss of the mean power, counted from the least loss so that no power is too small for a number."""
    there = errors.share > 0.0
    share, loss = errors.share[there], loss_db[there]
    least = float(np.min(loss))
    return least - 10.0 * math.log10(float(np.sum(share * 10.0 ** ((least - loss) / 10.0))))


def _rate(data: link.DataLink, loss_db: float) -> float:
    try:
        return link.rate_at_loss(data, data.requirement.margin_db, loss_db)
    except link.LinkError:
        return math.nan


def _fades(
    jitter: pointing.Jitter, motion: pointing.SpectralMotion | None, data: link.DataLink, margin_db: float
) -> tuple[float, float, str]:
    """How often the loss exceeds the margin, for how long, and what to doubt of it."""
    if motion is None or margin_db < 0.0:
        return math.nan, math.nan, ""
    if data.turbulent is not None:
        return math.nan, math.nan, "fades are not counted: those of the air have no spectrum here"
    fall, velocity = data.beam.fall, motion.velocity_rms_rad_s
    sent = pointing.MovingEnd(jitter, velocity, fall.half_angle_rad)
    moves, random = max(jitter.rms_rad) > 0.0, data.receiving is not None and data.receiving.is_random
    left = margin_db if moves else margin_db - float(fall.loss_db(jitter.static_rad))  # what the receiver may lose
    if random and left < 0.0:
        return math.nan, math.nan, ""
    received = _moving(data, sent, left) if random else None
    if received is None:
        found = pointing.fades(jitter, velocity, fall.half_angle_rad, like_gaussian_db(fall, margin_db))
    elif moves:
        like = fall.half_angle_rad * math.sqrt(like_gaussian_db(fall, margin_db) / margin_db)
        found = pointing.fades_of_both(replace(sent, half_angle_rad=like), received, margin_db)
    else:
        found = pointing.fades(received.jitter, received.velocity_rms_rad_s, received.half_angle_rad, left)
    return float(found.per_second), float(found.mean_duration_s), motion.warning


def _moving(data: link.DataLink, sent: pointing.MovingEnd, margin_db: float) -> pointing.MovingEnd | None:
    """The receiver as one with a Gaussian beam that has lost the margin at the same error; None where it stands still.

    The motion of a jitter is that of its bandwidth, and of a twin that of the transmitter. An end that no error makes
    lose the margin alone stands still, too.
    """
    receiving, table = data.receiving, data.table.coupling
    if receiving is None or table is None or not receiving.is_random or margin_db == 0.0:
        return None
    lost_rad = receiving.end.error_rad(margin_db)
    if math.isinf(lost_rad):
        return None
    half = lost_rad / math.sqrt(margin_db / float(beams.GaussianFall(1.0).loss_db(1.0)))
    if table.jitter is None:
        return replace(sent, half_angle_rad=half)
    jitter, speed = link.jitter_of(table.jitter), 2.0 * math.pi * table.jitter.bandwidth_hz
    return pointing.MovingEnd(jitter, (speed * jitter.rms_rad[0], speed * jitter.rms_rad[1]), half)


def like_gaussian_db(fall: beams.OffAxis, margin_db: float) -> float:
    """The loss (dB) that a Gaussian beam of the same half angle has where this one has lost a margin.

    Args:
        fall: How the beam falls off.
        margin_db: The margin (dB), 0 or above.
    """
    return float(beams.GaussianFall(fall.half_angle_rad).loss_db(fall.error_rad(margin_db)))


def _uncoded(data: link.DataLink, jitter: pointing.Jitter, under: Exposure) -> float:
    """Extra power that brings the mean bit error ratio back to the target, with the curve of the mission's receiver.

    nan for a receiver of which only the measured sensitivity is known, infinite where no power makes up for it.
    """
    receiver = data.receiver
    if receiver is None:
        return math.nan
    rate = data.table.data_rate_bit_s
    needed = float(receiver.required_power_w(rate))

    def error_ratio(power: Floats) -> Floats:
        return receiver.bit_error_ratio_at(needed * power, rate)

    try:
        if under.both is None:
            alone = pointing.uncoded_penalty_db(jitter, under.fall.half_angle_rad, error_ratio)
            return alone + under.received_db
        sent = coupling.of_beam(beams.GaussianFall(under.fall.half_angle_rad), *radial_steps(jitter))
        losses = coupling.BothEnds(sent, under.both.received).sum
        return pointing.penalty_db(10.0 ** (-losses.loss_db / 10.0), losses.share, error_ratio)
    except pointing.NoPowerError:
        return math.inf
