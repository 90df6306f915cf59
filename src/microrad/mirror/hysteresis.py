"""Hysteresis models as records: Bouc-Wen, Prandtl-Ishlinskii, and the creep that goes with either.

Drive in volts, output in radians; the names hold for any pair of units (a hysteretic spring: metres and newtons).
Drives count from the bias. Each response begins at rest at a drive of 0, is exact for a drive that is linear between
samples, and comes from the kernels that a simulated mirror runs.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from microrad.core import kernels
from microrad.core.arrays import Floats, reals
from microrad.core.labelled import Dataset, Group, variables
from microrad.core.units import LEAST, MOST


@dataclass(frozen=True, slots=True, eq=False)
class HysteresisLoop:
    """One settled period of a hysteresis model under a sine drive: drive and output about the bias, and its size.

    ``width`` is max h - min h over max y - min y. For a Prandtl-Ishlinskii model h is the output less gain x drive.
    ``clamped`` counts the samples of the period beyond the rate limit.
    """

    freq_hz: float
    drive_v: Floats
    output_rad: Floats
    hysteresis_rad: Floats
    clamped: int

    def __repr__(self) -> str:
        """What it is, without its samples."""
        return f"<HysteresisLoop at {self.freq_hz:g} Hz: {self.drive_v.size} samples, {self.width:.2%} wide>"

    @property
    def width(self) -> float:
        """Share of the output's peak-to-peak that is hysteresis; 0 where the output stands still."""
        moves = float(np.ptp(self.output_rad))
        return float(np.ptp(self.hysteresis_rad)) / moves if moves else 0.0

    def to_xarray(self) -> Dataset:
        """Drive, output and hysteresis by the sample of the period; frequency, width and ``clamped`` as attributes."""
        data = variables(
            "sample",
            drive=("V", "drive about the bias", self.drive_v),
            output=("rad", "output about the bias", self.output_rad),
            hysteresis=("rad", "hysteresis h", self.hysteresis_rad),
        )
        said = {"frequency_hz": self.freq_hz, "width": self.width, "clamped": self.clamped}
        return Group(data, attributes=said).to_xarray()


_LIMITS = ("rate_limit_v_s", "reach_v")
_REPEATS, _PERIODS = 1e-6, 1024
_INVERSIONS = 300


def _from_rest(samples: ArrayLike, step_s: float, what: str) -> Floats:
    """The samples of one signal with the rest before it in front."""
    signal = reals(samples, what)
    if signal.ndim != 1 or not signal.size or not np.isfinite(signal).all():
        raise ValueError(f"{what} has shape {signal.shape}: give one row of finite samples, shape (samples,)")
    if not LEAST <= step_s <= MOST:
        raise ValueError(f"step_s is {step_s} s: give the time between two samples, above 0")
    return np.concatenate([[0.0], signal])


class _Numbers:
    """A record of a model's numbers; `KIND` is what messages call it."""

    __slots__ = ()
    KIND: ClassVar[str]

    def check(self) -> None:
        """Raises ValueError for a parameter that is no finite number, or row of them; a limit may be infinite."""
        for each in fields(self):  # type: ignore[arg-type]
            values = reals(getattr(self, each.name), f"{each.name} of the {self.KIND} model")
            if values.ndim != (each.type is not float):
                wanted = "one number" if each.type is float else "a row of numbers"
                raise ValueError(f"{each.name} of the {self.KIND} model has shape {values.shape}: give {wanted}")
            if not np.all(np.isfinite(values) | (each.name in _LIMITS and values == math.inf)):
                raise ValueError(f"{each.name} of the {self.KIND} model is {values}: give finite numbers")


def _sound(output_rad: Floats) -> Floats:
    """The output, where it is numbers: the exponentials of a model may grow beyond all."""
    if not np.isfinite(output_rad).all():
        at = int(np.argmin(np.isfinite(output_rad)))
        raise ValueError(
            f"the model gives no number at sample {at}: look for a parameter or a rate that it was not fitted to"
        )
    return output_rad


class _FromRest(_Numbers, ABC):
    """What a hysteresis model does by itself, from rest at a drive of 0."""

    __slots__ = ()

    def response(self, drive_v: ArrayLike, step_s: float) -> Floats:
        """Output (rad), shape (samples,), from rest.

        Args:
            drive_v: Drive about the bias (V), shape (samples,).
            step_s: Time between samples (s); only a model that depends on the rate depends on it.

        Raises:
            ValueError: For a drive of another shape or with a number that is not finite, a step not above 0, and
                parameters that make no finite output.
        """
        drive = _from_rest(drive_v, step_s, "drive_v")
        self.check()
        return _sound(self._run(drive, step_s)[0])

    def loop(self, amplitude_v: float, freq_hz: float, samples: int = 500) -> HysteresisLoop:
        """The loop under a sine about the bias, once it repeats itself to 1e-6, or after 1024 periods.

        Args:
            amplitude_v: Amplitude of the sine (V), above 0.
            freq_hz: Its frequency (Hz), above 0.
            samples: Samples of a period, 8 or more.

        Raises:
            ValueError: For numbers outside of these.
        """
        for name, value, unit in (("amplitude_v", amplitude_v, "V"), ("freq_hz", freq_hz, "Hz")):
            if not LEAST <= value <= MOST:
                raise ValueError(f"{name} of a loop is {value} {unit}: give a finite number above 0")
        self.check()
        if samples < 8:
            raise ValueError(f"a loop of {samples} samples a period has no shape: give 8 or more, better 500")
        one = amplitude_v * np.sin(2.0 * np.pi * np.arange(1, samples + 1) / samples)
        step_s, periods = 1.0 / freq_hz / samples, 4
        while True:
            output, hysteresis = self._run(np.append(0.0, np.tile(one, periods)), step_s)
            before, last = output[-2 * samples : -samples], output[-samples:]
            if np.max(np.abs(last - before)) <= _REPEATS * np.ptp(last) or periods >= _PERIODS:
                break
            periods *= 4
        clamped = np.count_nonzero(np.abs(np.diff(one, prepend=one[-1])) / step_s > self.rate_limit_v_s)
        return HysteresisLoop(freq_hz, one, _sound(last), hysteresis[-samples:], int(clamped))

    rate_limit_v_s: float

    @abstractmethod
    def _run(self, drive_v: Floats, step_s: float) -> tuple[Floats, Floats]:
        """Output and hysteresis behind the first sample, which is rest."""


@dataclass(frozen=True, slots=True)
class BoucWen(_FromRest):
    """Parameters of Eq. 3 of SPIE 11852, 118523B, in radians, volts and seconds, and what generalises it.

    y = d1 exp(-d2 q') q + h,  h' = epsilon exp(delta |q'|) q' - |q'| |h| (alpha s + beta r + gamma + eta r s) w,
    with s the sign of h, r that of q', and w = (|h| alpha / |epsilon|)^(exponent - 1), which is 1 for Eq. 3 and leaves
    alpha and beta their unit (1/V). gamma tells the two signs of h apart and eta rising from falling drive (generalised
    model of Song and Der Kiureghian, J. Eng. Mech. 132 (2006) 610); epsilon, alpha and beta alone with delta = 0 are
    the classical model (Wen, J. Eng. Mech. Div. 102 (1976) 249).
    Beyond ``rate_limit_v_s`` the exponentials are held and each such sample is counted; ``bias_v`` is the resting
    drive.

    Example:
        ```python
        import numpy as np
        from microrad import BoucWen

        model = BoucWen(d1_rad_v=50e-6, d2_s_v=0.0, epsilon_rad_v=-8e-6, delta_s_v=0.0, alpha_1_v=0.3, beta_1_v=0.1)
        print(model.admissible, model.response(np.linspace(0.0, 10.0, 100), step_s=1e-4)[-1])
        ```
    """

    KIND = "Bouc-Wen"

    d1_rad_v: float
    d2_s_v: float
    epsilon_rad_v: float
    delta_s_v: float
    alpha_1_v: float
    beta_1_v: float
    rate_limit_v_s: float = math.inf
    bias_v: float = 0.0
    gamma_1_v: float = 0.0
    eta_1_v: float = 0.0
    exponent: float = 1.0

    def inverse(self, output_rad: ArrayLike, step_s: float) -> Floats:
        """Drive about the bias (V), shape (samples,), that makes the output.

        Eq. 4 of SPIE 11852, 118523B, repeated until h is that of the drive itself, which the sampled loop has no time
        for: exact where d2 is 0. The rate in exp(-d2 q') stays that of output / d1, as there.

        Args:
            output_rad: Wanted output (rad), shape (samples,).
            step_s: Time between samples (s).

        Raises:
            ValueError: For an output of another shape, a step not above 0, a model without a gain d1, and one that
                moves against its drive behind a reversal of this output: no drive makes it.
        """
        if self.d1_rad_v == 0.0:
            raise ValueError("a Bouc-Wen model with d1 = 0 has no inverse: its output does not follow the drive")
        wanted = _from_rest(output_rad, step_s, "output_rad")
        self.check()
        drive = wanted / self.d1_rad_v
        rate = np.clip(np.diff(drive, prepend=0.0) / step_s, -self.rate_limit_v_s, self.rate_limit_v_s)
        gain, offset = self.d1_rad_v * np.exp(-self.d2_s_v * rate), self.d1_rad_v * self.bias_v
        for _ in range(_INVERSIONS):
            before, h = drive, self._run(np.append(0.0, drive), step_s)[1]
            drive = (wanted - h + offset) / gain - self.bias_v
            if np.max(np.abs(drive - before)) <= 1e-13 * np.max(np.abs(drive)):
                return drive[1:]
        raise ValueError(
            f"no drive was found in {_INVERSIONS} steps that makes this output: behind a reversal the slope of the "
            f"model is {self.reversal_slope_rad_v(float(np.max(np.abs(rate)))):.3g} rad/V at its fastest rate, and its "
            "inverse needs one above 0; fit it with admissible=True, or take a Prandtl-Ishlinskii model"
        )

    def _run(self, drive_v: Floats, step_s: float) -> tuple[Floats, Floats]:
        """Output and h behind the first sample, which is rest."""
        output, h, _ = kernels.bouc_wen_response(drive_v, step_s, np.array(self.row, dtype=float), 0.0)
        return output[1:], h[1:]

    @property
    def admissible(self) -> bool:
        """Whether the output never moves against a slow drive behind a reversal."""
        return self._rising().reversal_slope_rad_v() >= 0.0

    def _rising(self) -> "BoucWen":
        """The model, turned over where its output falls with the drive."""
        return self if self.d1_rad_v >= 0.0 else sign_reversed(self)

    @property
    def row(self) -> tuple[float, ...]:
        """The parameters in the order of the kernel's columns, which is that of the fields."""
        per_size = self.alpha_1_v / abs(self.epsilon_rad_v) if self.exponent != 1.0 and self.epsilon_rad_v else 0.0
        return (*(getattr(self, name) for name in self.__slots__[:-1]), self.exponent - 1.0, per_size)

    def decay_1_v(self, rising: float, sign: float) -> float:
        """Decay of |h| per volt of travel, at exponent 1.

        Args:
            rising: Sign of the drive's rate: 1 where it rises, -1 where it falls.
            sign: Sign of h, 1 or -1.
        """
        return self.alpha_1_v + self.beta_1_v * rising * sign + self.gamma_1_v * sign + self.eta_1_v * rising

    def settled_branch_rad(self, rising: float) -> float:
        """Where h settles on a slow, long ramp of the drive in one direction (1 up, -1 down); inf without a decay."""
        sign = rising * math.copysign(1.0, self.epsilon_rad_v)
        decay = self.decay_1_v(rising, sign)
        if self.epsilon_rad_v == 0.0:
            return 0.0
        if decay == 0.0 or (self.alpha_1_v == 0.0 and self.exponent != 1.0):  # nothing holds h back
            return sign * math.inf
        if self.exponent == 1.0:
            return sign * abs(self.epsilon_rad_v) / decay
        share = math.pow(self.alpha_1_v / decay, 1.0 / self.exponent)
        return sign * abs(self.epsilon_rad_v) / self.alpha_1_v * share

    @property
    def settled_rad(self) -> float:
        """Magnitude at which |h| settles on a slow, long ramp: |epsilon| / (alpha + beta sign(epsilon)) in Eq. 3.

        The larger one of the two directions where they differ.
        """
        return max(abs(self.settled_branch_rad(rising)) for rising in (1.0, -1.0))

    def reversal_slope_rad_v(self, rate_v_s: float = 0.0) -> float:
        """Local slope dy/du just after a reversal from a settled branch at ``rate_v_s``; not physical below 0.

        A settled branch has epsilon e = k h; behind the reversal the drive term keeps its slope and the decay changes
        side: for Eq. 3 dh/du = 2 alpha epsilon e / (alpha + beta sign(epsilon)), with e = exp(delta |rate|). The lower
        one of the two directions where they differ.
        """
        if self.epsilon_rad_v == 0.0:
            return self.d1_rad_v
        growth = math.exp(self.delta_s_v * min(abs(rate_v_s), self.rate_limit_v_s))
        return self.d1_rad_v + self.epsilon_rad_v * growth * self._swing(min if self.epsilon_rad_v > 0.0 else max)

    @property
    def reversal_swing(self) -> float:
        """Slope dh/du just after a reversal from a settled branch over epsilon, the larger of the two directions."""
        return self._swing(max)

    def _swing(self, choose: Callable[..., float]) -> float:
        sign = math.copysign(1.0, self.epsilon_rad_v)
        decays = [[self.decay_1_v(way * rising, rising * sign) for way in (-1.0, 1.0)] for rising in (1.0, -1.0)]
        return choose(1.0 + (k / own if own else math.copysign(math.inf, k) if k else 0.0) for k, own in decays)

    @property
    def admissible_rate_v_s(self) -> float:
        """Fastest rate at which the slope after a reversal is not negative; 0 if there is none, inf if it never is."""
        d1 = abs(self.d1_rad_v)
        swing = d1 - self._rising().reversal_slope_rad_v()
        if swing <= 0.0:
            return math.inf
        if swing > d1:
            return 0.0
        return math.inf if self.delta_s_v <= 0.0 else math.log(d1 / swing) / self.delta_s_v

    @property
    def wrong_way_rad(self) -> float:
        """How far the slow model moves the wrong way after a reversal (0 when admissible); the worse direction's.

        With s the travel behind the reversal, h starts at its settled size against it: dh/ds = -e - k |h| w down to 0,
        with e = |epsilon|, then -e + k' |h| w; k and k' are the decays on the two sides of zero (alpha + beta and
        alpha - beta in Eq. 3). The output turns where dh/ds = -d1, and went d1 ds less far than h.
        """
        model = self._rising()
        if model.reversal_slope_rad_v() >= 0.0:
            return 0.0
        return max(model._wrong_way(rising) for rising in (1.0, -1.0))

    def _wrong_way(self, rising: float) -> float:
        """The distance behind a branch that ran in the direction ``rising``; epsilon < 0, so h lies against it."""
        e, d1, h0, n = -self.epsilon_rad_v, self.d1_rad_v, abs(self.settled_branch_rad(rising)), self.exponent
        if math.isinf(h0):
            return math.inf
        size = e / (self.alpha_1_v or 1.0)  # which cancels at exponent 1
        k, beyond = (self.decay_1_v(-rising, -rising), self.decay_1_v(-rising, rising))
        if e + k * size * (h0 / size) ** n <= d1:
            return 0.0
        turned = 0.0 if e >= d1 else size * ((d1 - e) / (k * size)) ** (1.0 / n)
        before = _moved(lambda h: e + k * size * (h / size) ** n, d1, turned, h0)
        if e <= d1:
            return before
        return before + _moved(
            lambda h: e - beyond * size * (h / size) ** n, d1, 0.0, size * ((e - d1) / (beyond * size)) ** (1.0 / n)
        )


def _moved(slope: Callable[[float], float], d1: float, low: float, high: float) -> float:
    """Integral of 1 - d1 / slope over h: how far the output goes while h goes from one size to another."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    half = (high - low) / 2.0
    return half * sum(
        float(w) * (1.0 - d1 / slope(low + half * (1.0 + float(x)))) for x, w in zip(nodes, weights, strict=True)
    )


@dataclass(frozen=True, slots=True)
class PrandtlIshlinskii(_FromRest):
    """A Prandtl-Ishlinskii operator: z = sum of weight x play(threshold), p <- max(q - r, min(q + r, p)).

    With ``widening_s`` each threshold above 0 grows with the drive's rate, r + widening |q'|, up to ``rate_limit_v_s``
    (rate-dependent operator of Al Janaideh and Krejci, IEEE/ASME Trans. Mechatronics 18 (2013) 1498).

    With a finite ``reach_v`` a polynomial stands beside the plays, a spring that hardens or softens: z has in addition
    c1 s^2 + c2 |s| s + c3 s^3, with (c1, c2, c3) = ``polynomial_rad`` and s = q / reach, held at -1 and 1 beyond them.

    Example:
        ```python
        from microrad import PrandtlIshlinskii

        model = PrandtlIshlinskii(thresholds_v=(0.0, 1.0, 3.0), weights_rad_v=(40e-6, 6e-6, 4e-6))
        loop = model.loop(amplitude_v=10.0, freq_hz=1.0)
        print(f"{loop.width:.1%} of the travel is hysteresis")
        print(model.response(model.inverse(loop.output_rad, step_s=2e-3), step_s=2e-3) - loop.output_rad)
        ```
    """

    KIND = "Prandtl-Ishlinskii"

    thresholds_v: tuple[float, ...]
    weights_rad_v: tuple[float, ...]
    widening_s: float = 0.0
    rate_limit_v_s: float = math.inf
    polynomial_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach_v: float = math.inf

    def __post_init__(self) -> None:
        """Raises ValueError for thresholds that do not rise from 0 or above, and for weights that do not fit them."""
        rising = all(a <= b for a, b in pairwise(self.thresholds_v))
        if len(self.thresholds_v) != len(self.weights_rad_v) or not rising or min(self.thresholds_v, default=0.0) < 0.0:
            raise ValueError(
                f"thresholds {self.thresholds_v} V with {len(self.weights_rad_v)} weights make no Prandtl-Ishlinskii "
                "operator: give thresholds that rise from 0 V or above, and a weight for each"
            )
        if not self.widening_s >= 0.0:
            raise ValueError(f"thresholds cannot widen by {self.widening_s} s: give 0 s, or more for a rate")

    def inverse(self, output_rad: ArrayLike, step_s: float) -> Floats:
        """Drive about the bias (V), shape (samples,), that makes the output; exact for an operator that does not widen.

        Args:
            output_rad: Wanted output (rad), shape (samples,).
            step_s: Time between samples (s).

        Raises:
            ValueError: For an output of another shape, a step not above 0, and what `inverted` refuses.
        """
        wanted = _from_rest(output_rad, step_s, "output_rad")
        self.check()
        return _sound(self.inverted()._run(wanted, step_s)[0])

    def inverted(self) -> "PrandtlIshlinskii":
        """The inverse as an operator of the same kind: thresholds in rad, weights in V/rad.

        Source: Kuhnen, European Journal of Control 9 (2003) 407: r'_j = sum_{i<j} w_i (r_j - r_i), and w' from the
        differences of the reciprocals of the cumulated weights. Thresholds above 0 that widen by s widen the inverse's
        by w_0 s at the rate of the drive (Al Janaideh and Krejci 2013), which is taken as that of the output over the
        slow gain.

        Raises:
            ValueError: For a model without weight at threshold 0: it stands still after a reversal; with a polynomial;
                and where the sum of the weights up to a threshold is 0 or has another sign than the first one.
        """
        if math.isfinite(self.reach_v):
            raise ValueError(
                "the Prandtl-Ishlinskii model has a polynomial beside its plays, and the inverse knows plays alone; "
                "identify the axis without one"
            )
        r, w = np.array(self.thresholds_v), np.array(self.weights_rad_v)
        slope = np.cumsum(w)
        if not r.size or r[0] != 0.0 or abs(slope[0]) < LEAST:
            raise ValueError(
                "the Prandtl-Ishlinskii model has no weight at threshold 0: it stands still after each reversal and "
                "has no inverse; identify it again with more samples near the reversals"
            )
        if np.min(slope * np.sign(slope[0])) < LEAST:
            turns = int(np.argmax(slope * np.sign(slope[0]) < LEAST))
            raise ValueError(
                f"the slope of the Prandtl-Ishlinskii model turns, or is 0, at its threshold of {r[turns]:g} V, where "
                f"the weights add up to {slope[turns]:g} rad/V: it has no inverse; give weights whose sums keep the "
                "sign of the first one"
            )
        thresholds = [abs(float(np.sum(w[:j] * (r[j] - r[:j])))) for j in range(1, r.size)]
        slow = slow_gain(self)
        return PrandtlIshlinskii(
            (0.0, *thresholds),
            (float(1.0 / slope[0]), *map(float, np.diff(1.0 / slope))),
            self.weights_rad_v[0] * self.widening_s / slow,
            self.rate_limit_v_s * abs(slow),
        )

    def _run(self, drive_v: Floats, step_s: float) -> tuple[Floats, Floats]:
        """Output, and what of it is not slow gain x drive, behind the first sample, which is rest."""
        thresholds = np.array(self.thresholds_v, dtype=float)
        widening, rest = np.array([self.widening_s, self.rate_limit_v_s]), np.zeros(thresholds.size)
        states, _ = kernels.widening_play_response(drive_v, step_s, thresholds, widening, rest)
        quadratic, signed, cubic = self.polynomial_rad
        s = np.clip(drive_v, -self.reach_v, self.reach_v) / self.reach_v
        output = states @ np.array(self.weights_rad_v) + s * (quadratic * s + signed * np.abs(s) + cubic * s**2)
        return output[1:], (output - slow_gain(self) * drive_v)[1:]

    @property
    def admissible(self) -> bool:
        """Whether the output never moves against the drive: all sums of the first few weights have one sign, or are 0.

        A polynomial is not looked at.
        """
        slopes = np.cumsum(self.weights_rad_v)
        return bool(np.all(slopes * math.copysign(1.0, slow_gain(self)) >= 0.0))


@dataclass(frozen=True, slots=True)
class Creep(_Numbers):
    """Linear creep beside a hysteresis model: weight x drive behind a first-order lag, summed over the lags.

    Equal weights at time constants in geometric steps creep with the logarithm of time (Kuhnen, European Journal of
    Control 9 (2003) 407).
    """

    KIND = "creep"

    weights_rad_v: tuple[float, ...] = ()
    time_constants_s: tuple[float, ...] = ()

    def check(self) -> None:
        """Raises ValueError for numbers that are not finite, and for weights that do not fit the time constants."""
        _Numbers.check(self)  # super() does not find the class that the slots made
        constants, weights = np.array(self.time_constants_s, dtype=float), np.array(self.weights_rad_v, dtype=float)
        if constants.shape != weights.shape or not np.all(constants > 0.0):
            raise ValueError(
                f"creep of {weights.size} weights and the time constants {self.time_constants_s} s: give as many "
                "weights, and time constants above 0"
            )

    def response(self, drive_v: ArrayLike, step_s: float) -> Floats:
        """What creep adds to the output (rad), shape (samples,), from rest.

        Args:
            drive_v: Drive about the bias (V), shape (samples,).
            step_s: Time between samples (s).

        Raises:
            ValueError: For a drive of another shape or with a number that is not finite, a step or a time constant not
                above 0, and other weights than time constants.

        Example:
            ```python
            import numpy as np
            from microrad import Creep

            creep = Creep(weights_rad_v=(1e-6, 1e-6), time_constants_s=(0.1, 1.0))
            print(creep.response(np.full(300, 10.0), step_s=0.01)[[9, 99, 299]])
            ```
        """
        drive = _from_rest(drive_v, step_s, "drive_v")
        self.check()
        constants, weights = (np.array(each, dtype=float) for each in (self.time_constants_s, self.weights_rad_v))
        states = kernels.lag_response(drive, step_s, constants, np.zeros(constants.size))
        return _sound(np.asarray(states[1:] @ weights))


NO_CREEP = Creep()

LINE_OF_SIGHT = {"line-of-sight": 1.0, "optical": 1.0, "mechanical": 2.0}
"""Angle of the line of sight by the convention of a mirror's output: reflection doubles a tilt, per axis."""


def scaled(model: BoucWen | PrandtlIshlinskii, times: float) -> BoucWen | PrandtlIshlinskii:
    """The same model with its output multiplied by a factor.

    Args:
        model: Hysteresis model.
        times: Factor on its output; 2 turns a mechanical angle into that of the line of sight.
    """
    if isinstance(model, PrandtlIshlinskii):
        c1, c2, c3 = model.polynomial_rad
        weights = tuple(times * w for w in model.weights_rad_v)
        return replace(model, weights_rad_v=weights, polynomial_rad=(times * c1, times * c2, times * c3))
    return replace(model, d1_rad_v=times * model.d1_rad_v, epsilon_rad_v=times * model.epsilon_rad_v)


def sign_reversed(model: BoucWen) -> BoucWen:
    """The model of a sensor turned over: -h has the terms of h with the signs of epsilon, beta and gamma changed."""
    return replace(
        model,
        d1_rad_v=-model.d1_rad_v,
        epsilon_rad_v=-model.epsilon_rad_v,
        beta_1_v=-model.beta_1_v,
        gamma_1_v=-model.gamma_1_v,
    )


def slow_gain(model: BoucWen | PrandtlIshlinskii) -> float:
    """Gain for slow, large drives (rad/V): d1, or the sum of the weights; a polynomial ends at its reach."""
    return model.d1_rad_v if isinstance(model, BoucWen) else math.fsum(model.weights_rad_v)


def rest_gain(model: BoucWen | PrandtlIshlinskii) -> float:
    """Gain for motions about rest that are too small to move a play with a threshold (rad/V): d1 + epsilon for Eq. 3.

    Behind larger motions the gain lies between this one and the slow one, `slow_gain`.
    """
    if isinstance(model, BoucWen):
        return model.d1_rad_v + model.epsilon_rad_v
    pairs = zip(model.thresholds_v, model.weights_rad_v, strict=True)
    return math.fsum(weight for threshold, weight in pairs if threshold == 0.0)


def output_amplitude(model: BoucWen | PrandtlIshlinskii, drive_v: float) -> float:
    """Amplitude of the settled output (rad) under a slow sine of the drive, Bouc-Wen's h and a polynomial left out.

    Args:
        model: Hysteresis model.
        drive_v: Amplitude of the drive, 0 or above.
    """
    if isinstance(model, BoucWen):
        return model.d1_rad_v * drive_v
    pairs = zip(model.thresholds_v, model.weights_rad_v, strict=True)
    return math.fsum(w * max(0.0, drive_v - r) for r, w in pairs)


def secant_gain(model: BoucWen | PrandtlIshlinskii, output_rad: float) -> float:
    """Amplitude of the output over that of the drive (rad/V), for slow sines.

    A Prandtl-Ishlinskii model is softer for small drives; a Bouc-Wen model has its slow gain at any amplitude. A
    polynomial is left out.

    Args:
        model: Hysteresis model.
        output_rad: Amplitude of the output; infinite gives the slow gain, and 0 that at rest.

    Raises:
        ValueError: For an amplitude that is no number or below 0.
    """
    if not output_rad >= 0.0:
        raise ValueError(f"output_rad is {output_rad} rad: give an amplitude of the output, 0 or above")
    if isinstance(model, BoucWen) or math.isinf(output_rad) or not model.thresholds_v:
        return slow_gain(model)
    if output_rad == 0.0:
        return rest_gain(model)
    knots = [output_amplitude(model, r) for r in model.thresholds_v]
    slopes = np.cumsum(model.weights_rad_v)
    last = max(i for i, y in enumerate(knots) if y <= output_rad)
    if slopes[last] <= 0.0:
        return slow_gain(model)
    return output_rad / (model.thresholds_v[last] + (output_rad - knots[last]) / float(slopes[last]))


def gain_only(model: BoucWen | PrandtlIshlinskii, output_rad: float = math.inf) -> BoucWen:
    """Replace a hysteresis model by its gain, and nothing else.

    Args:
        model: Hysteresis model.
        output_rad: Amplitude of the output at which the secant gain is taken; infinite, as by default, gives the slow
            gain.

    Raises:
        ValueError: For an amplitude that is no number or below 0.
    """
    return BoucWen(secant_gain(model, output_rad), 0.0, 0.0, 0.0, 0.0, 0.0)


def steepest_slope(model: BoucWen | PrandtlIshlinskii) -> float:
    """Bound on |dz/dq| of a model, anywhere in its loops.

    A Bouc-Wen element whose |h| grows along a branch (a decay below 0: a hardening spring) has no bound; it is taken
    within the travel over which that branch steepens by a factor e.

    Raises:
        ValueError: For a Bouc-Wen model that depends on the rate without a limit, and for plays that depend on it:
            there is no bound.
    """
    if isinstance(model, PrandtlIshlinskii):
        if model.widening_s:
            raise ValueError(
                "a play operator that is fed back cannot depend on the rate: within a step it has no slope"
            )
        quadratic, signed, cubic = (abs(c) for c in model.polynomial_rad)
        bend = (2.0 * (quadratic + signed) + 3.0 * cubic) / model.reach_v
        return math.fsum(abs(w) for w in model.weights_rad_v) + bend
    depends = bool(model.delta_s_v or model.d2_s_v)
    if math.isinf(model.rate_limit_v_s) and depends:
        raise ValueError("a Bouc-Wen element that is fed back and depends on rate needs a finite rate limit")
    rate = model.rate_limit_v_s if depends else 0.0
    decays = [model.decay_1_v(rising, sign) for rising in (1.0, -1.0) for sign in (1.0, -1.0)]
    slope = abs(model.epsilon_rad_v) * math.exp(max(model.delta_s_v, 0.0) * rate)
    if min(decays) > 0.0:
        slope *= 1.0 + max(decays) / min(decays)
    else:
        steepened = (math.e - 1.0) * max(decays) / max(-min(decays), 1e-300)
        slope *= max(math.e, 1.0 + steepened) if min(decays) < 0.0 else 1.0 + max(decays)
    return abs(model.d1_rad_v) * math.exp(abs(model.d2_s_v) * rate) + slope
