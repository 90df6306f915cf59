"""What a source adds to an error index: the distribution of its part of the error, about each axis.

Over time each source is taken as its class says, over the ensemble as the interpretation says (ECSS-E-ST-60-10C A.1.2):
"temporal" is the worst-case satellite at a random time, "ensemble" a random satellite at its worst time, "mixed" a
random satellite at a random time. A noise has no worst time; it stands with as many standard deviations there as hold
the confidence. The sign that an error has at its worst time, or on the worst satellite where it is spread about zero,
is open: sizes add up there.

| class | APE | MPE | RPE | PDE |
|---|---|---|---|---|
| constant | b | b | 0 | 0 |
| per-observation | b | b | 0 | 0 |
| random | s | 0 | s | 0 |
| process | its density times the weight of the index | | | |
| periodic | a | a w | a sqrt(1 - 2 w c + w^2), c = cos 2 pi f t | 2 a w sin pi f s |
| drift | 0 to r P | r T/2 to r (P - T/2) | -r T/2 to r T/2 | r s |
| transient | a exp(-t/d) | a m exp(-t/d), t up to P - T | what is left | MPE (exp(-s/d) - 1) |

w = sinc f T, m = d/T (1 - exp(-T/d)), P the period, s the spacing, t evenly drawn. PRE takes the windows of two
periods: the same as PDE of what is stationary, and for a drift or a transient, which begin anew, the difference over
what the spacing leaves beside whole periods, of windows that no new begin cuts. Behind a transfer a transient is that
of an exponential through it. An error that is another one in each observation is in a PRE by the difference of two
that are drawn by themselves (Table B-2): of the worst satellite, from one end of its spread to the other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Literal, get_args

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.link.error_budget.distributions import Part, case, mixture
from microrad.link.error_budget.sources import ErrorSource, SourceKind, Spread
from microrad.link.pointing.summation import sigma_multiple
from microrad.loop.disturbance.windows import ErrorIndex

Interpretation = Literal["temporal", "ensemble", "mixed"]

_GAUSS = np.polynomial.hermite_e.hermegauss(16)  # over a Gaussian ensemble
_EVEN = np.polynomial.legendre.leggauss(16)  # over an even one
_TURN = np.exp(2j * np.pi * (np.arange(32) + 0.5) / 32)  # phases of a sinusoid
_HARDLY = 0.5  # width beside the mean, up to which a size is hardly spread
_WITHIN, _WITHIN_MANY = (np.polynomial.legendre.leggauss(count) for count in (12, 64))  # positions in a window
_SOUND = 1e9  # condition of the modes of a transient, above which they coincide
_STRIPS = 6  # of a window, in which a transient is taken as straight
_TURNING = 200  # times at most by the turns of a transient
_EVENLY = np.linspace(0.0, 1.0, 5)
_LOGARITHMS = np.log(np.concatenate([np.linspace(1.0, 0.0, 13)[1:-1], np.geomspace(1.0 / 12.0, 1e-6, 12)[1:]]))
"""Of what is left of a transient between pieces in which it is nearly straight."""
_MANY_TURNS = 16.0  # of a sinusoid in a window
_FOLDED = 64  # pieces of a Gaussian without its sign
_ROUNDING = 1e-9  # of a spacing that is whole periods


@dataclass(frozen=True, slots=True)
class Requirement:
    """What has to be kept: an index, over what its confidence counts, and about which axes.

    Args:
        index: What of the error counts, with window and spacing.
        confidence: Share of times, satellites, or both in which the error has to be within the limit.
        interpretation: "temporal", "ensemble" or "mixed", as above.
        axes: One axis, or two for the radial error, by their places from 0.
        limit_rad: The limit (rad); None where what is left is asked for alone.
        observation_s: Time in which both windows of a PDE lie, and behind which the second one of a PRE does (s).

    Raises:
        ValueError: For what is no confidence, another interpretation, more than two axes, a limit not above 0, and an
            observation period that is missing, not in the definition of the index, or does not fit its times.
    """

    index: ErrorIndex
    confidence: float = 0.9973
    interpretation: Interpretation = "temporal"
    axes: tuple[int, ...] = (0, 1)
    limit_rad: float | None = None
    observation_s: float | None = None

    def __post_init__(self) -> None:
        """Check each field against the others."""
        if not 0.0 < self.confidence < 1.0:
            raise ValueError(f"a confidence of {self.confidence:g}: give a share above 0 and below 1")
        if self.interpretation not in get_args(Interpretation):
            raise ValueError(
                f'no interpretation "{self.interpretation}"; give one of {", ".join(get_args(Interpretation))}'
            )
        if len(set(self.axes)) != len(self.axes) or len(self.axes) not in (1, 2) or min(self.axes) < 0:
            raise ValueError(f"axes {self.axes}: give one, or two for the radial error, by their places from 0")
        if self.limit_rad is not None and not 0.0 < self.limit_rad < math.inf:
            raise ValueError(f"a limit of {self.limit_rad:g} rad; give a finite one above zero")
        takes, observed = self.index.takes, self.observation_s
        if (observed is None) == (takes in ("PDE", "PRE")):
            said = (
                "needs observation_s: give the time in s" if observed is None else "has no observation_s: leave it out"
            )
            raise ValueError(f"{self.index.kind} {said}")
        if observed is not None and self.index.window_s is not None and self.index.spacing_s is not None:
            if takes == "PDE" and self.index.window_s + self.index.spacing_s > observed:
                raise ValueError(
                    f"PDE: both windows have to lie in the observation period of {observed:g} s; give it longer"
                )
            if takes == "PRE" and self.index.spacing_s < observed:
                raise ValueError(f"PRE: its windows lie in two observation periods of {observed:g} s; space them wider")


@dataclass(frozen=True, slots=True)
class Contribution:
    """What a source adds to an index: its name, its class, and the independent parts that its error is the sum of.

    ``origin`` says where its numbers come from, ``statistic`` how its size was stated.
    """

    name: str
    kind: SourceKind | Literal["loop"]
    parts: tuple[Part, ...]
    origin: str
    statistic: str = ""


def contribution(source: ErrorSource, required: Requirement) -> Contribution:
    """What a source adds to an index under a requirement.

    Args:
        source: The source.
        required: The index and over what it is taken.

    Raises:
        ValueError: For an index of more or longer windows than the period of a drift or of a transient holds.
    """
    if source.kind == "per-observation" and required.index.takes == "PRE":
        parts = tuple(part for one in source.by_axis for part in _other_observation(one, required))
    else:
        parts = tuple(_part(each, required) for one in source.by_axis for each in (one, *_lines(one)))
    return Contribution(source.name, source.kind, parts, source.origin, source.statistic)


def _part(source: ErrorSource, required: Requirement) -> Part:
    if required.interpretation == "ensemble":
        return _folded(_at_its_worst(source, required), source.size)
    in_time, size = _IN_TIME[source.kind](source, required.index), source.size
    if required.interpretation == "mixed":
        return _scaled(in_time, size)
    worst = in_time.times(size.worst)
    return _outwards(worst) if size.width and not size.mean else worst


def _outwards(part: Part) -> Part:
    """The part with the sign about each axis that makes its mean positive: that of the worst satellite is open."""
    sign = np.where(part.whole_mean < 0.0, -1.0, 1.0)
    if sign.min() > 0.0:
        return part
    return Part(
        part.weight, part.mean * sign, part.covariance * np.outer(sign, sign), part.half_width * sign,
        part.amplitude * sign,
    )  # fmt: skip


def contributions(sources: Sequence[ErrorSource], required: Requirement) -> tuple[Contribution, ...]:
    """What each source adds, in their order; see `contribution`.

    Args:
        sources: The sources, of the same axes.
        required: The index and over what it is taken.

    Raises:
        ValueError: As `contribution`, for sources of unlike numbers of axes, and for an axis that they have not.
    """
    for each in sources:
        if each.axes != sources[0].axes:
            raise ValueError(
                f"{each.name} has gains for {each.axes} axes, and {sources[0].name} for {sources[0].axes}; "
                "give all as many"
            )
    if len({each.name for each in sources}) < len(sources):
        raise ValueError("two sources have one name; give each its own")
    if sources and max(required.axes) >= sources[0].axes:
        raise ValueError(f"axis {max(required.axes)} is asked for, and the sources have {sources[0].axes} from 0 on")
    return tuple(contribution(source, required) for source in sources)


def _lines(source: ErrorSource) -> list[ErrorSource]:
    """The lines of a process, each as a periodic error of its name."""
    lines = source.process.lines if source.process else ()
    size = source.size.mean
    return [
        replace(
            source, kind="periodic", process=None, freq_hz=line.freq_hz, size=Spread("fixed", size * line.amplitude_rad)
        )
        for line in lines
    ]


def _other_observation(source: ErrorSource, required: Requirement) -> tuple[Part, ...]:
    """The difference of an error in two observations, which its spread over the ensemble is drawn for anew."""
    unit, about_zero = case(source.axes, mean=source.at_rest()), replace(source.size, mean=0.0)
    if required.interpretation == "mixed":
        return (_scaled(unit, about_zero),) * 2
    if required.interpretation == "temporal":
        return (_outwards(unit.times(2.0 * about_zero.worst)),)
    outwards = _outwards(unit)
    if about_zero.shape == "gaussian":
        return (_folded(outwards, replace(about_zero, width=math.sqrt(2.0) * about_zero.width)),)
    edges = np.linspace(0.0, 1.0, _FOLDED + 1)  # of two evenly spread ones: a triangle
    level, half = about_zero.width * (edges[1:] + edges[:-1]), about_zero.width * np.diff(edges)
    share = np.diff(1.0 - (1.0 - edges) ** 2)
    mean = outwards.mean[0]
    return (case(source.axes, mean=np.outer(level, mean), half_width=np.outer(half, mean), weight=share),)


def _scaled(unit: Part, size: Spread) -> Part:
    """The part of a size that is spread over the ensemble, from that of a size of 1.

    A size times a value in time is as spread as the size is, so that the cases are those of the value; of a noise, and
    of a size that is hardly spread, they are those of the size.
    """
    if size.shape == "fixed" or not size.width:
        return unit.times(size.mean)
    moving = unit.half_width.any() or unit.amplitude.any()
    if unit.covariance.any() or (moving and size.width < _HARDLY * abs(size.mean)):
        at, weight = _GAUSS if size.shape == "gaussian" else _EVEN
        return mixture([unit.times(float(size.mean + size.width * each)) for each in at], weight / np.sum(weight))
    value, weight = _values(unit)
    spread = size.width * value
    if size.shape == "uniform":
        return case(unit.axes, mean=size.mean * value, half_width=spread, weight=weight)
    return case(unit.axes, mean=size.mean * value, covariance=spread[:, :, None] * spread[:, None], weight=weight)


def _values(unit: Part) -> tuple[Floats, Floats]:
    """What an error without a Gaussian is in time: values, shape (values, axes), and the weight of each."""
    value, weight = unit.mean[:, None], unit.weight[:, None]
    if unit.half_width.any():
        at, share = _EVEN
        value, weight = value + at[:, None] * unit.half_width[:, None], weight * (0.5 * share)
    if unit.amplitude.any():
        turned = (unit.amplitude[:, None] * _TURN[:, None]).real
        value, weight = value + turned, weight * np.full(len(_TURN), 1.0 / len(_TURN))
    return value.reshape(-1, unit.axes), weight.ravel()


# -------------------------------------------------------------------------------------- at a random time, of size 1
def _constant(source: ErrorSource, index: ErrorIndex) -> Part:
    gain = source.at_rest()
    return case(source.axes, mean=gain if index.takes in ("APE", "MPE") else None)


def _random(source: ErrorSource, index: ErrorIndex) -> Part:
    if index.takes not in ("APE", "RPE"):
        return case(source.axes)
    if isinstance(source.transfer, lti.StateSpace):
        raise ValueError(
            f"{source.name}: an error that is anew from moment to moment has no spectrum, so that nothing is known of "
            'it behind a transfer; give gains, or the class "process"'
        )
    gain = np.asarray(source.transfer)
    return (
        case(source.axes, half_width=gain)
        if source.even_in_time
        else case(source.axes, covariance=np.outer(gain, gain))
    )


def _process(source: ErrorSource, index: ErrorIndex) -> Part:
    return case(source.axes, covariance=source.motion.windowed(index))


def _periodic(source: ErrorSource, index: ErrorIndex) -> Part:
    assert source.freq_hz is not None
    return _sinusoid(source, index, source.freq_hz, 1.0)


def _sinusoid(source: ErrorSource, index: ErrorIndex, freq_hz: float, amplitude: float) -> Part:
    whole = amplitude * source.response(freq_hz)
    if index.window_s is None:
        return case(source.axes, amplitude=whole)
    share = float(np.sinc(freq_hz * index.window_s))
    if index.takes == "MPE":
        return case(source.axes, amplitude=whole * share)
    if index.spacing_s is not None:
        return case(source.axes, amplitude=whole * share * 2.0 * math.sin(math.pi * freq_hz * index.spacing_s))
    turns = freq_hz * index.window_s
    if turns > _MANY_TURNS:  # its mean is so small that it hardly matters where in the window the error is
        return case(source.axes, amplitude=whole * math.sqrt(1.0 - share**2))
    at, weight = _WITHIN if turns <= 1.0 else _WITHIN_MANY
    left = np.exp(1j * math.pi * turns * at) - share
    return case(source.axes, amplitude=np.outer(left, whole), weight=0.5 * weight)


def _drift(source: ErrorSource, index: ErrorIndex) -> Part:
    assert source.period_s is not None
    if isinstance(source.transfer, lti.StateSpace):
        raise ValueError(
            f"{source.name}: behind a transfer each new begin of a drift is a step, of which its rate says nothing; "
            "give gains, or what is left as a process"
        )
    gain, period = np.asarray(source.transfer, dtype=float), source.period_s
    window = _window(source, index, period)
    if index.takes == "RPE":
        return case(source.axes, half_width=gain * window / 2.0)
    if index.takes in ("APE", "MPE"):
        return case(source.axes, mean=gain * period / 2.0, half_width=gain * (period - window) / 2.0)
    assert index.spacing_s is not None
    if index.takes == "PDE":
        return case(source.axes, mean=gain * index.spacing_s)
    beside = _beside(index.spacing_s, period)
    again = beside / period
    return case(source.axes, mean=np.outer([beside, beside - period], gain), weight=np.array([1.0 - again, again]))


def _beside(spacing_s: float, period_s: float) -> float:
    """What a spacing leaves beside whole periods (s); 0 where that is rounding."""
    left = math.fmod(spacing_s, period_s)
    return 0.0 if min(left, period_s - left) < _ROUNDING * spacing_s else left


def _transient(source: ErrorSource, index: ErrorIndex) -> Part:
    assert source.period_s is not None
    period, window = source.period_s, _window(source, index, source.period_s)
    path, last = _Path(source), period - window
    if index.takes == "PRE" and index.spacing_s is not None:
        beside = _beside(index.spacing_s, period)
        if not beside:
            return case(source.axes)
        # the second window lies in the same period as the first one would, or in the next one
        both = [(0.0, last - beside, beside), (period - beside, last, beside - period)]
        spans = [(begin, end, apart) for begin, end, apart in both if end > begin]
        whole = math.fsum(end - begin for begin, end, _ in spans)
        if not whole:
            raise ValueError(
                f"{source.name}: no two windows of {window:g} s so far apart lie within periods; give shorter ones"
            )
        parts = [_between(path, begin, end, window, apart) for begin, end, apart in spans]
        return mixture(parts, np.array([(end - begin) / whole for begin, end, _ in spans]))
    if index.spacing_s is not None:
        return _between(path, 0.0, last - index.spacing_s, window, index.spacing_s)
    if index.takes == "RPE":
        edges = path.edges(0.0, last)
        middle, weight = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges) / last
        mean = path.mean(middle, window)
        along = np.array([path.value(middle + window * each) for each in np.linspace(0.0, 1.0, _STRIPS + 1)]) - mean
        level, half = 0.5 * (along[1:] + along[:-1]), 0.5 * (along[1:] - along[:-1])
        return case(source.axes, mean=level, half_width=half, weight=np.tile(weight / _STRIPS, _STRIPS))
    return _between(path, 0.0, last, window, None)


def _between(path: "_Path", begin_s: float, end_s: float, window_s: float, apart_s: float | None) -> Part:
    """Means of windows that begin in a span, evenly; or differences to those that begin so much later."""
    edges = path.edges(begin_s, end_s)
    middle, weight = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges) / (end_s - begin_s)
    ends, between = path.mean(edges, window_s), path.mean(middle, window_s)
    if apart_s is not None:
        ends, between = path.mean(edges + apart_s, window_s) - ends, path.mean(middle + apart_s, window_s) - between
    mean = (ends[1:] + 4.0 * between + ends[:-1]) / 6.0
    return case(ends.shape[1], mean=mean, half_width=0.5 * (ends[1:] - ends[:-1]), weight=weight)


class _Path:
    """An exponential of size 1 behind a transfer: its value at some times, and its mean in windows that begin there."""

    def __init__(self, source: ErrorSource) -> None:
        assert source.decay_s is not None
        rate, through = -1.0 / source.decay_s, source.transfer
        if not isinstance(through, lti.StateSpace):
            self._rates, self._each = np.array([complex(rate)]), np.asarray(through, dtype=float)[:, None]
            return
        n = through.order
        A = np.block([[through.A, through.B], [np.zeros((1, n)), np.full((1, 1), rate)]])
        C, start = np.hstack([through.C, through.D]), np.append(np.zeros(n), 1.0)
        self._rates, modes = np.linalg.eig(A)
        if np.linalg.cond(modes) > _SOUND:
            raise ValueError(
                f"{source.name}: its time constant of {source.decay_s:g} s is a pole of its transfer; move one by 0.1 %"
            )
        self._each = (C @ modes) * np.linalg.solve(modes, start.astype(complex))

    def edges(self, begin_s: float, end_s: float) -> Floats:
        """Times between which it is nearly straight: evenly by what each of its modes has left, and evenly in time."""
        found = [begin_s + (end_s - begin_s) * _EVENLY]
        for rate in self._rates:
            if abs(rate.imag) > abs(rate.real):  # a few turns, as long as they are there
                found.append(np.arange(0.0, 7.0 / -rate.real, 0.25 / abs(rate.imag))[:_TURNING])
            found.append(_LOGARITHMS / rate.real)
        every = np.sort(np.concatenate(found))
        return np.asarray(every[(every >= begin_s) & (every <= end_s)])

    def value(self, times_s: Floats) -> Floats:
        """Shape (times, axes)."""
        return np.asarray((np.exp(np.outer(times_s, self._rates)) @ self._each.T).real)

    def mean(self, times_s: Floats, window_s: float) -> Floats:
        """Of windows that begin at some times, shape (times, axes); the value where the window has no length."""
        if not window_s:
            return self.value(times_s)
        turn = self._rates * window_s
        return np.asarray(((np.exp(np.outer(times_s, self._rates)) * np.expm1(turn) / turn) @ self._each.T).real)


def _window(source: ErrorSource, index: ErrorIndex, period_s: float) -> float:
    """Window of an index (s), 0 for none, once it is seen to fit into the period of a source."""
    needs = (index.window_s or 0.0) + (index.spacing_s or 0.0) * (index.takes == "PDE")
    if needs >= period_s:
        raise ValueError(
            f"{source.name}: {index.kind} looks at {needs:g} s, and it begins anew every {period_s:g} s; give shorter "
            "times, or the class that it has over many periods"
        )
    return index.window_s or 0.0


_IN_TIME = {
    "constant": _constant,
    "per-observation": _constant,
    "random": _random,
    "process": _process,
    "periodic": _periodic,
    "drift": _drift,
    "transient": _transient,
}


# ------------------------------------------------------------------------------------- at its worst time, of size 1
def _at_its_worst(source: ErrorSource, required: Requirement) -> Part:
    """The largest size of the error about each axis, of one case: which sign it has there is open."""
    part = _IN_TIME[source.kind](source, required.index)
    sizes = np.abs(part.mean) + np.abs(part.half_width) + np.abs(part.amplitude)
    worst = np.max(sizes, axis=0)
    if source.kind == "periodic" and required.index.takes == "RPE":
        assert source.freq_hz is not None and required.index.window_s is not None
        turns = source.freq_hz * required.index.window_s
        left = np.exp(1j * math.pi * turns * np.linspace(-1.0, 1.0, 257)) - np.sinc(turns)
        worst = np.max(np.abs(left)) * np.abs(source.response(source.freq_hz))
    noise = sigma_multiple(required.confidence) * np.sqrt(
        np.max(np.diagonal(part.covariance, axis1=1, axis2=2), axis=0)
    )
    return case(source.axes, mean=np.asarray(worst + noise))


def _folded(worst: Part, size: Spread) -> Part:
    """The size of an error over the ensemble, from the largest one of a size of 1: without its sign."""
    level, half, weight = _sizes(size)
    return case(
        worst.axes, mean=np.outer(level, worst.mean[0]), half_width=np.outer(half, worst.mean[0]), weight=weight
    )


def _sizes(size: Spread) -> tuple[Floats, Floats, Floats]:
    """What a spread is without its sign, as even pieces: middles, half widths, and the share in each."""
    mean, width = abs(size.mean), size.width
    if size.shape == "fixed" or not width:
        return np.array([mean]), np.zeros(1), np.ones(1)
    if size.shape == "uniform":
        if mean >= width:
            return np.array([mean]), np.array([width]), np.ones(1)
        inner, outer = width - mean, mean / width  # both signs up to there, and one beyond
        found = np.array([0.5 * inner, width]), np.array([0.5 * inner, mean]), np.array([1.0 - outer, outer])
        return found if mean else (found[0][:1], found[1][:1], np.ones(1))
    edges = np.linspace(0.0, mean + 5.0 * width, _FOLDED + 1)
    below = np.array([NormalDist(mean, width).cdf(each) - NormalDist(mean, width).cdf(-each) for each in edges])
    share = np.diff(below)
    return 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges), share / share.sum()
