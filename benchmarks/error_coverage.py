"""How far the errors of an identified mirror can be trusted: random mirrors that are known, each identified.

    OPENBLAS_NUM_THREADS=1 python benchmarks/error_coverage.py [truths] [first]      200 truths from seed 0

(One thread of BLAS, as the command line has it: several get in the way of the fit's own and take ten times as long.)

A truth is a resonance behind play operators or Bouc-Wen hysteresis, with creep beside them or without, a pure delay of
the recording chain or none, and white noise. It is simulated here by NumPy and SciPy, with nothing of what is fitted.
The bench plays a small chirp, growing sines at three frequencies and a staircase, and for validation another sine,
another chirp and another staircase. `identify` is given the family of the truth, with creep and without, and its mirror
file is all that is looked at. For each quantity the table has

- truths: in how many the bound below is at most a third of the value, so that it can be known at all,
- known: of how many truths the table `uncertainty` gives it an error, and one below its own size,
- held: in how many of those the truth lies within 1.96 errors, with the binomial interval of that share (95 %),
- width: median of the error over the Cramer-Rao bound: the smallest that any unbiased estimate from the fitted records
  can have. It is computed from central differences of the truth's own simulation, offsets of the records being free.

"residual of the loop" is a PI controller that is tuned for the identified mirror: the rms that it leaves on mirrors
drawn from the file's covariance against the one on the true mirror.
"""

import math
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import cont2discrete, lfilter
from scipy.stats import binomtest

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.lab.identify import Identification, IdentificationError, JointFit, identify, mirror_file_text
from microrad.lab.recording import Recording, recording_from_arrays
from microrad.loop.control.analysis import close, h2
from microrad.loop.control.classical import PI
from microrad.loop.control.problem import AxisController, DesignPlant, Specification
from microrad.loop.control.tuning import tune
from microrad.mirror import from_table, spread
from microrad.mission.file import load_mirror
from microrad.mission.tables.mirror import Mirror

Values = Mapping[str, float]
Quantity = Callable[[Values], float]

TRUTHS = 200
KNOWN, HELD, WIDTH = 0.80, (0.90, 0.99), 2.0
"""The bars: least share of known parameters, share of held intervals, and largest median width over the bound."""

KNOWABLE = 1 / 3
"""Largest bound, over the true value, of what is judged: nothing could know more of it from such records."""

Z = 1.96
REST_V, SPAN_V = 5.0, 8.0
THRESHOLDS_V = np.linspace(0.0, 0.47 * SPAN_V, 15)
"""Of the play operators: those that the documentation of `identify` says it takes, so that the model can be true."""

LAGS_S = (0.01, 0.1, 1.0, 10.0)
RESIDUAL = "residual of the loop"
DRAWS = 100
PERIOD_S = 2e-4
FAMILIES = {
    "plays": ("prandtl_ishlinskii_joint", "prandtl_ishlinskii_creep"),
    "Bouc-Wen": ("bouc_wen_joint", "bouc_wen_creep"),
}


# ------------------------------------------------------------------------------------------------------------- truths
@dataclass(frozen=True, slots=True)
class Truth:
    """A mirror that is known, in V, rad and s, and the noise of its sensor (rad a sample).

    `values` are resonance (Hz), damping, delay (s), the weights of the creep's lags ("lag 0" and so on, rad/V), and
    those of the hysteresis: "weight 0" and so on for plays, or d1, d2, epsilon, delta, alpha and beta.
    """

    seed: int
    family: str
    values: Values
    noise_rad: float

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the values that a fit has to find: creep and delay only where there are any."""
        return tuple(name for name, v in self.values.items() if v != 0.0 or name == "d2")


def draw_truth(seed: int) -> Truth:
    """A truth by its seed: the family alternates, all else is random."""
    rng = np.random.Generator(np.random.Philox(seed))
    family = tuple(FAMILIES)[seed % 2]
    gain = float(rng.uniform(50e-6, 150e-6))
    creep = float(rng.choice([0.0, rng.uniform(0.005, 0.02)])) * gain * rng.uniform(0.8, 1.2, len(LAGS_S))
    values = {
        "resonance": float(np.exp(rng.uniform(math.log(150.0), math.log(800.0)))),
        "damping": float(np.exp(rng.uniform(math.log(0.01), math.log(0.1)))),
        "delay": float(rng.choice([0.0, rng.uniform(20e-6, 120e-6)])),
    }
    values |= {f"lag {i}": float(weight) for i, weight in enumerate(creep)}
    noise = float(np.exp(rng.uniform(math.log(3e-4), math.log(3e-3)))) * gain * SPAN_V
    values |= _drawn_plays(rng, gain) if family == "plays" else _drawn_bouc_wen(rng, gain)
    return Truth(seed, family, values, noise)


def _drawn_plays(rng: np.random.Generator, gain: float) -> dict[str, float]:
    """A large share of the gain without threshold, the rest with a density like that of the bench's own mirror."""
    r = THRESHOLDS_V[1:] / rng.uniform(0.8, 2.0)
    density = (0.15 + r) * np.exp(-(r**1.3)) * rng.uniform(0.7, 1.3, r.size)
    direct = float(rng.uniform(0.6, 0.85))
    weights = gain * np.append(direct, (1.0 - direct) * density / density.sum())
    return {f"weight {i}": float(w) for i, w in enumerate(weights)}


def _drawn_bouc_wen(rng: np.random.Generator, gain: float) -> dict[str, float]:
    """Eq. 3 with a slope behind a slow reversal that does not turn."""
    alpha, ratio = float(np.exp(rng.uniform(math.log(1.0), math.log(6.0)))), float(rng.uniform(-0.3, 0.6))
    swing = 2.0 / (1.0 - ratio)
    return {
        "d1": gain,
        "d2": 0.0,
        "epsilon": -float(rng.uniform(0.3, 0.8)) * gain / swing,
        "delta": float(rng.uniform(1e-4, 4e-4)),
        "alpha": alpha,
        "beta": ratio * alpha,
    }


# ------------------------------------------------------------------------------------------------------------ records
@dataclass(frozen=True, slots=True)
class Record:
    """What the bench plays: samples a second, length, the drive (V) as a function of time (s), and what it is for."""

    name: str
    rate_hz: float
    duration_s: float
    drive: Callable[[Floats], Floats]
    validation: bool = False

    def samples(self, delay_s: float = 0.0) -> Floats:
        """The drive of `delay_s` ago at each sample, at rest before the first one."""
        at = np.arange(round(self.duration_s * self.rate_hz)) / self.rate_hz - delay_s
        return REST_V + np.where(at > 0.0, self.drive(np.maximum(at, 0.0)), 0.0)


def _chirp(amplitude_v: float, start_hz: float, stop_hz: float, duration_s: float) -> Callable[[Floats], Floats]:
    growth = math.log(stop_hz / start_hz) / duration_s
    return lambda t: amplitude_v * np.sin(2 * np.pi * start_hz * np.expm1(growth * t) / growth)


def _growing(freq_hz: float, amplitudes_v: Sequence[float], periods: int) -> Callable[[Floats], Floats]:
    def drive(t: Floats) -> Floats:
        block = np.minimum((t * freq_hz / periods).astype(int), len(amplitudes_v) - 1)
        return np.asarray(np.array(amplitudes_v)[block] * np.sin(2 * np.pi * freq_hz * t))

    return drive


def _stairs(levels_v: Sequence[float], dwell_s: float, rise_s: float) -> Callable[[Floats], Floats]:
    """Levels about rest, joined by halves of a cosine."""

    def drive(t: Floats) -> Floats:
        total, last = np.zeros(t.size), 0.0
        for k, level in enumerate(levels_v):
            way = np.clip((t - k * dwell_s - 0.1) / rise_s, 0.0, 1.0)
            total += (level - last) * (1.0 - np.cos(np.pi * way)) / 2
            last = level
        return total

    return drive


RECORDS = (
    Record("chirp", 10e3, 0.8, _chirp(0.2, 30.0, 1500.0, 0.8)),
    Record("loops 4 Hz", 2e3, 1.0, _growing(4.0, (1.0, 2.0, 3.0, 4.0), 1)),
    Record("loops 16 Hz", 5e3, 0.25, _growing(16.0, (1.0, 2.0, 3.0, 4.0), 1)),
    Record("loops 64 Hz", 10e3, 0.125, _growing(64.0, (1.0, 2.0, 3.0, 4.0), 2)),
    Record("staircase", 500.0, 12.0, _stairs((3.0, -2.0, 1.0, 0.0), 3.0, 0.2)),
    Record("sine 30 Hz", 5e3, 0.2, _growing(30.0, (3.5,), 6), validation=True),
    Record("chirp again", 10e3, 0.2, _chirp(0.15, 50.0, 1500.0, 0.2), validation=True),
    Record("staircase again", 500.0, 6.0, _stairs((-3.0, 2.0), 3.0, 0.2), validation=True),
)


# ---------------------------------------------------------------------------------------------------------- the truth
def simulated(truth: Truth, record: Record, parts: int = 4) -> Floats:
    """Output (rad) about rest: y(t) = resonance[hysteresis[u(t - delay)]] + creep[u(t - delay)].

    The drive that the mirror feels is a straight line between the samples of the delayed one.

    Args:
        truth: The mirror.
        record: What is played.
        parts: Steps in each sample.
    """
    v, step_s = truth.values, 1.0 / (record.rate_hz * parts)
    fine = _felt(record, v["delay"], parts)
    if truth.family == "plays":
        weights = np.array([v[f"weight {i}"] for i in range(THRESHOLDS_V.size)])
        strain = _play_states(record, v["delay"], parts) @ weights
    else:
        strain = bouc_wen(fine, step_s, v)
    w = 2 * np.pi * v["resonance"]
    output = _straight(([w**2], [1.0, 2 * v["damping"] * w, w**2]), strain, step_s)
    for i, tau in enumerate(LAGS_S):
        if v[f"lag {i}"]:
            output = output + v[f"lag {i}"] * _straight(([1.0], [tau, 1.0]), fine, step_s)
    return np.asarray(output[::parts])


@lru_cache(maxsize=2)
def _felt(record: Record, delay_s: float, parts: int) -> Floats:
    """The delayed drive about rest (V), with steps between its samples."""
    felt = record.samples(delay_s) - REST_V
    return np.interp(np.arange(parts * (felt.size - 1) + 1) / parts, np.arange(felt.size), felt)


@lru_cache(maxsize=2 * len(RECORDS))
def _play_states(record: Record, delay_s: float, parts: int) -> Floats:
    return plays(_felt(record, delay_s, parts), THRESHOLDS_V)


def _straight(system: tuple[list[float], list[float]], signal: Floats, step_s: float) -> Floats:
    """A filter's answer from rest to a signal that is straight between its samples."""
    b, a, _ = cont2discrete(system, step_s, "foh")
    return np.asarray(lfilter(b.ravel(), a, signal))


def plays(drive_v: Floats, thresholds_v: Floats) -> Floats:
    """Play operators from rest, shape (samples, operators): on each way between two reversals a maximum or minimum."""
    rising = np.sign(np.diff(drive_v))
    turns = np.flatnonzero(rising[1:] * rising[:-1] <= 0.0) + 1
    state, found = np.zeros(thresholds_v.size), np.zeros((drive_v.size, thresholds_v.size))
    for begin, end in zip([0, *turns], [*turns, drive_v.size - 1], strict=True):
        way = drive_v[begin + 1 : end + 1, None]
        found[begin + 1 : end + 1] = np.maximum(way - thresholds_v, np.minimum(way + thresholds_v, state))
        state = found[end]
    return found


def bouc_wen(drive_v: Floats, step_s: float, v: Values) -> Floats:
    """Eq. 3 about rest: d1 exp(-d2 u') u + h, exact for a drive that is straight between its samples.

    With s the travel and r its direction, dh/ds = r epsilon exp(delta |u'|) - k h, k = alpha + beta r sign(h): an
    exponential towards r epsilon exp(delta |u'|) / k, in two pieces where h passes zero.
    """
    steps = np.diff(drive_v)
    slope = np.append(0.0, steps) / step_s
    forcing = (np.sign(steps) * v["epsilon"] * np.exp(v["delta"] * np.abs(steps) / step_s)).tolist()
    alpha, beta, h, found = v["alpha"], v["beta"], 0.0, [0.0]
    for e, du in zip(forcing, steps.tolist(), strict=True):
        left, turned = abs(du), math.copysign(1.0, du) * beta
        if left and h * e < 0.0:  # towards zero
            k = alpha + math.copysign(1.0, h) * turned
            until = math.log1p(-k * h / e) / k
            reached = min(until, left)
            h, left = (e / k + (h - e / k) * math.exp(-k * left) if until > left else 0.0), left - reached
        if left:
            k = alpha + math.copysign(1.0, e) * turned
            h = e / k + (h - e / k) * math.exp(-k * left)
        found.append(h)
    straight = v["d1"] * (np.exp(-v["d2"] * slope) * (drive_v + REST_V) - REST_V)
    return np.asarray(straight + np.array(found))


def played(truth: Truth) -> tuple[list[Recording], list[Recording]]:
    """The records of a truth with its noise and an offset each, in V and mrad: those to fit, and for validation."""
    rng = np.random.Generator(np.random.Philox([truth.seed, 1]))
    fitted: list[Recording] = []
    unseen: list[Recording] = []
    for record in RECORDS:
        clean = simulated(truth, record)
        noisy = clean + truth.noise_rad * rng.standard_normal(clean.size) + 1e-4 * rng.standard_normal()
        made = recording_from_arrays(record.samples(), 1e3 * noisy, record.rate_hz, record.name)
        (unseen if record.validation else fitted).append(made)
    return fitted, unseen


# ---------------------------------------------------------------------------------------------------- Cramer-Rao bound
def cramer_rao(sensitivities: Sequence[Floats], noise: float) -> Floats:
    """The least covariance of unbiased estimates from records with white noise, each record's offset being free.

    Args:
        sensitivities: Derivatives of each record's output by the parameters, shape (samples, parameters).
        noise: Standard deviation of the noise of a sample, in the unit of the output.
    """
    centred = np.concatenate([s - s.mean(axis=0) for s in sensitivities]) / noise
    size = np.linalg.norm(centred, axis=0)
    triangle = np.linalg.qr(centred / size, mode="r")
    root = np.linalg.solve(triangle, np.eye(size.size)) / size[:, None]
    return np.asarray(root @ root.T)


def bound(truth: Truth, change: float = 1e-4) -> Floats:
    """Least covariance of what is fitted of a truth, from central differences of its own simulation.

    Args:
        truth: The mirror.
        change: Half of each difference, over the value (d2: over a rate of 1000 V/s).
    """
    steps = {name: change * abs(truth.values[name]) or change * 1e-3 for name in truth.fitted}
    columns = [
        np.column_stack(
            [
                (simulated(moved(truth, name, h), r, 1) - simulated(moved(truth, name, -h), r, 1)) / (2 * h)
                for name, h in steps.items()
            ]
        )
        for r in RECORDS
        if not r.validation
    ]
    return cramer_rao(columns, truth.noise_rad)


def moved(truth: Truth, name: str, by: float) -> Truth:
    """The truth with one value moved."""
    return replace(truth, values={**truth.values, name: truth.values[name] + by})


# ------------------------------------------------------------------------------------------------------ what is judged
def quantities(truth: Truth, normalised_hz: float) -> dict[str, tuple[Quantity, Quantity]]:
    """What is judged of a truth, by name: as a function of its values, and of those of the mirror file.

    A file gives the gains where its linear part has the magnitude 1, which is not at rest.

    Args:
        truth: The mirror.
        normalised_hz: That frequency.
    """

    def there(of: Quantity) -> Quantity:
        return lambda v: of(v) * abs(resonance(v, normalised_hz))

    found: dict[str, tuple[Quantity, Quantity]] = {}
    for name in truth.fitted:
        of: Quantity = itemgetter(name)
        if name.startswith("weight") or name in ("d1", "epsilon"):
            found[name] = there(of), of
        elif name != "d2" and not name.startswith("lag"):
            found[name] = of, of
    if "lag 0" in truth.fitted:
        found["creep a decade"] = creep_decade, creep_decade
    if truth.family == "plays":
        return found | {"gain of large drives": (there(slow_gain), slow_gain)}

    def settled(v: Values) -> float:
        return v["epsilon"] / (v["alpha"] - v["beta"])

    return found | {"settled h": (there(settled), settled)}


def creep_decade(v: Values) -> float:
    """Creep a decade (rad/V): the mean of the lags, of which each decade has one."""
    return sum(v[f"lag {i}"] for i in range(len(LAGS_S))) / len(LAGS_S)


def resonance(v: Values, freq_hz: float) -> complex:
    """Response of the resonance of a truth."""
    x = freq_hz / v["resonance"]
    return 1.0 / complex(1.0 - x**2, 2 * v["damping"] * x)


def error_of(of: Quantity, values: Values, names: Sequence[str], covariance: Floats) -> float:
    """Standard error of a function of values, to first order.

    Args:
        of: The function.
        values: The values.
        names: Those of them that are uncertain.
        covariance: Their covariance.
    """
    gradient = []
    for name in names:
        h = 1e-5 * abs(values[name]) or 1e-12
        up, down = ({**values, name: values[name] + side * h} for side in (1.0, -1.0))
        gradient.append((of(up) - of(down)) / (2 * h))
    g = np.array(gradient)
    return math.sqrt(max(float(g @ covariance @ g), 0.0))


def read(table: Mirror, truth: Truth) -> tuple[dict[str, float], list[str], Floats]:
    """The values of a mirror file by the names of the truth, the names of the uncertain ones and their covariance."""
    keys = _keys(table, truth)
    values = dict.fromkeys(truth.values, 0.0)
    values |= {name: _value(table, key) for name, key in keys.items()}
    if table.uncertainty is None:
        return values, [], np.zeros((0, 0))
    given = list(table.uncertainty.parameters)
    names = [name for name, key in keys.items() if key in given]
    chosen = [given.index(keys[name]) for name in names]
    size = np.array([values[name] for name in names])
    return values, names, size[:, None] * spread.relative_covariance(table)[np.ix_(chosen, chosen)] * size


def with_delay(
    found: Identification, values: dict[str, float], names: list[str], covariance: Floats
) -> tuple[dict[str, float], list[str], Floats]:
    """The same with the delay of the recording chain, which is no part of the mirror and stands in the result alone."""
    fit = found.fit()
    assert isinstance(fit, JointFit)
    errors = {p.name: e for p, e in zip(fit.structure.parameters, fit.fit.standard_errors, strict=True)}
    if "delay" not in errors:
        return values, names, covariance
    return values | {"delay": fit.delay_s}, [*names, "delay"], block_diag(covariance, [[errors["delay"] ** 2]])


def _keys(table: Mirror, truth: Truth) -> dict[str, str]:
    """Keys of a mirror file by the names of the truth: the pole pair and the thresholds that are nearest."""
    found: dict[str, str] = {}
    linear, p = table.linear, table.prandtl_ishlinskii
    if linear is not None and linear.poles_hz and linear.pole_dampings:
        pairs = [i for i, d in enumerate(linear.pole_dampings) if d < 1.0]
        if pairs:
            of = linear.poles_hz
            nearest = min(pairs, key=lambda i: abs(math.log(of[i] / truth.values["resonance"])))
            found["resonance"] = f"linear.poles.{nearest + 1}"
            found["damping"] = f"linear.pole_dampings.{nearest + 1}"
    if p is not None and truth.family == "plays":
        for i, r in enumerate(p.thresholds_v, 1):
            found[f"weight {int(np.argmin(np.abs(THRESHOLDS_V - r)))}"] = f"prandtl_ishlinskii.weights.{i}"
    if table.bouc_wen is not None and truth.family == "Bouc-Wen":
        found |= {name: f"bouc_wen.{name}" for name in ("d1", "d2", "epsilon", "delta", "alpha", "beta")}
    if table.creep is not None:
        for i, tau in enumerate(table.creep.time_constants_s, 1):
            found[f"lag {int(np.argmin(np.abs(np.log(tau / np.array(LAGS_S)))))}"] = f"creep.weights.{i}"
    return found


def _value(table: Mirror, key: str) -> float:
    name, field, *item = key.split(".")
    part = getattr(table, name)
    value = getattr(part, next(f for f in type(part).model_fields if f == field or f.startswith(f"{field}_")))
    return float(value[int(item[0]) - 1 if item else 0]) if isinstance(value, tuple) else float(value)


@dataclass(frozen=True, slots=True)
class Judged:
    """One quantity of one truth: its true value, the estimate with its error (nan where not known), and the bound."""

    truth: int
    name: str
    true: float
    found: float
    error: float
    bound: float

    @property
    def known(self) -> bool:
        """Whether the file has an error for it, and one below its size."""
        return 0.0 < self.error < abs(self.found)

    @property
    def off(self) -> float:
        """How many of its errors the estimate is off."""
        return (self.found - self.true) / self.error


@dataclass(frozen=True, slots=True)
class Result:
    """What came of one truth: the quantities, the model that was chosen, poles and zeros, and how long it took."""

    truth: Truth
    judged: tuple[Judged, ...]
    chosen: str
    poles_hz: tuple[float, ...]
    zeros_hz: tuple[float, ...]
    seconds: float


def judged(truth: Truth) -> Result:
    """Record, identify and judge one truth."""
    began = time.process_time()
    fitted, unseen = played(truth)
    try:
        found = identify(fitted, models=FAMILIES[truth.family], validation=unseen, hold="first-order")
    except IdentificationError as refusal:
        return Result(truth, (), f"refused: {refusal}", (), (), time.process_time() - began)
    seconds, table, least = time.process_time() - began, mirror_table(found), bound(truth)
    values, names, covariance = with_delay(found, *read(table, truth))
    rows = []
    linear = table.linear
    for name, (of, in_file) in quantities(truth, linear.normalise_at_hz if linear is not None else 0.0).items():
        true, smallest = of(truth.values), error_of(of, truth.values, truth.fitted, least)
        if smallest < KNOWABLE * abs(true):
            error = error_of(in_file, values, names, covariance)
            rows.append(Judged(truth.seed, name, true, in_file(values), error, smallest))
    rows.append(judged_residual(truth, table, least))
    roots = (linear.poles_hz or (), linear.zeros_hz or ()) if linear is not None else ((), ())
    return Result(truth, tuple(rows), found.chosen, *roots, seconds)


def mirror_table(found: Identification) -> Mirror:
    """The mirror as a user has it: written to a file and read again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mirror.toml"
        path.write_text(mirror_file_text(found, "mirror"), encoding="utf-8")
        return load_mirror(path).mirror


# ------------------------------------------------------------------------------------------------- the designed loop
def loop_plant(mirror: lti.StateSpace, gain: float) -> DesignPlant:
    """A mirror at 5 kHz with a sample of delay, under 10 urad of slow disturbance, its sensor with 0.3 urad of noise.

    Args:
        mirror: Drive (V) to angle (rad), continuous in time.
        gain: Its slow gain (rad/V).
    """
    A, B = lti.zero_order_hold(mirror.A, mirror.B, PERIOD_S)
    n, keep = A.shape[0], math.exp(-2 * math.pi * 10.0 * PERIOD_S)
    whole = block_diag(np.block([[A, B], [np.zeros((1, n + 1))]]), [[keep]])
    inputs = np.zeros((n + 2, 4))
    inputs[n, 0], inputs[n + 1, 1] = 1.0, 10e-6 * math.sqrt(1.0 - keep**2)
    residual = np.hstack([-mirror.C, [[0.0, 1.0]]])
    direct = np.zeros((3, 4))
    direct[1, 2] = 0.3e-6
    system = lti.StateSpace(whole, inputs, np.vstack([residual, residual, 0.0 * residual]), direct)
    return DesignPlant(PERIOD_S, system, 1, gain, has_gauge=False)


def residual_rad(mirror: lti.StateSpace, controller: AxisController) -> float:
    """Rms that a controller leaves on a mirror; infinite where the loop is unstable."""
    plant = loop_plant(mirror, 1.0)
    try:
        return math.sqrt(float(h2(close(plant, controller))[0].sum()))
    except ValueError:
        return math.inf


def true_mirror(v: Values) -> lti.StateSpace:
    """The linear mirror of a truth's values: its gain for large drives before the resonance, and the creep."""
    w, lags = 2 * math.pi * v["resonance"], np.array(LAGS_S)
    A = block_diag([[0.0, w], [-w, -2 * v["damping"] * w]], np.diag(-1.0 / lags))
    B = np.concatenate([[0.0, w * slow_gain(v)], 1.0 / lags])[:, None]
    C = np.concatenate([[1.0, 0.0], [v[f"lag {i}"] for i in range(lags.size)]])[None, :]
    return lti.StateSpace(A, B, C, np.zeros((1, 1)))


def judged_residual(truth: Truth, table: Mirror, least: Floats) -> Judged:
    """The rms that a PI controller tuned for the identified mirror leaves, predicted and on the true mirror.

    Args:
        truth: The true mirror.
        table: The identified one.
        least: Least covariance of what is fitted of the truth.
    """
    name, gain = RESIDUAL, slow_gain(truth.values)
    found = from_table(table).linear_loop
    try:
        controller = tune(PI, [loop_plant(found, gain)], Specification(0.5), seed=0, survey=64).controller
    except ValueError:  # no loop can be closed on what was identified
        return Judged(truth.seed, name, math.nan, math.nan, math.nan, math.nan)
    true, predicted = residual_rad(true_mirror(truth.values), controller), residual_rad(found, controller)
    smallest = error_of(lambda v: residual_rad(true_mirror(v), controller), truth.values, truth.fitted, least)
    if table.uncertainty is None:
        return Judged(truth.seed, name, true, predicted, math.nan, smallest)
    drawn = [residual_rad(from_table(t).linear_loop, controller) for t in spread.draws(table, DRAWS, 0)]
    error = float(np.std(drawn)) if math.isfinite(sum(drawn)) else math.inf
    return Judged(truth.seed, name, true, predicted, error, smallest)


def slow_gain(v: Values) -> float:
    """Slow gain (rad/V) of a truth."""
    return v["d1"] if "d1" in v else sum(v[n] for n in v if n.startswith("weight"))


# ----------------------------------------------------------------------------------------------------------- the table
def lines_of(results: Sequence[Result]) -> list["Line"]:
    """What came of each quantity, weights of plays above 0 V taken together, and of all parameters."""
    rows = [j for r in results for j in r.judged]
    names = dict.fromkeys(label(j.name) for j in rows)
    lines = [Line(name, tuple(j for j in rows if label(j.name) == name)) for name in names]
    return [*lines, Line("all parameters", tuple(j for j in rows if j.name != RESIDUAL))]


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the table: a quantity of all truths that have it."""

    name: str
    rows: tuple[Judged, ...]

    @property
    def known(self) -> tuple[Judged, ...]:
        """Those that the file has an error for."""
        return tuple(j for j in self.rows if j.known)

    @property
    def held(self) -> tuple[float, float, float]:
        """Share of the known whose interval holds the truth, and the limits (95 %) within which chance leaves it."""
        inside = binomtest(sum(abs(j.off) <= Z for j in self.known), len(self.known))
        low, high = inside.proportion_ci()
        return float(inside.statistic), float(low), float(high)

    @property
    def width(self) -> float:
        """Median of the error over the bound."""
        return float(np.median([j.error / j.bound for j in self.known]))

    @property
    def missed(self) -> tuple[str, ...]:
        """The bars that are missed; that of the held intervals where chance does not explain it."""
        if len(self.known) < KNOWN * len(self.rows):
            return ("too few known",)
        found = ("errors too small",) if self.held[2] < HELD[0] else ("errors too large",) * (self.held[1] > HELD[1])
        return (*found, "too wide") if self.width > WIDTH else found

    def __str__(self) -> str:
        """The line as it is printed."""
        share = 100 * len(self.known) / len(self.rows)
        text = f"{self.name:24}{len(self.rows):7d}{share:6.0f}%"
        if self.known:
            held, low, high = (100 * x for x in self.held)
            text += f"{held:6.0f}%  {low:3.0f} to {high:3.0f} %{self.width:8.2f}"
        return f"{text}  {', '.join(self.missed)}".rstrip()


def label(name: str) -> str:
    """The line of the table that a quantity belongs to."""
    return "weights above 0 V" if name.startswith("weight") and name != "weight 0" else name


def told(result: Result) -> str:
    """One truth in one line: what it is, what was chosen, and what is not known or off by more than three errors."""
    t, v = result.truth, result.truth.values
    odd = [f"{j.name} " + (f"{j.off:+.1f}" if j.known else "?") for j in result.judged if not j.known or abs(j.off) > 3]
    return (
        f"{t.seed:4d} {t.family:8} {v['resonance']:5.1f} Hz {v['damping']:.4f} creep {1e6 * creep_decade(v):.2f} "
        f"delay {1e6 * v['delay']:4.0f} us noise {1e6 * t.noise_rad:.2f} urad: {result.chosen}, "
        f"poles {[round(p, 2) for p in result.poles_hz]} zeros {[round(z, 2) for z in result.zeros_hz]}, "
        f"{result.seconds:.1f} s; {', '.join(odd) or 'all within three errors'}"
    )


def main() -> None:
    """Identify the truths and print the table; exit code 1 where a line misses a bar."""
    count, first = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((1, TRUTHS), (2, 0)))
    results = []
    with ProcessPoolExecutor() as pool:
        for result in pool.map(judged, map(draw_truth, range(first, first + count))):
            results.append(result)
            print(told(result), flush=True)
    lines = lines_of(results)
    print(f"{'':24}{'truths':>7}{'known':>7}{'held':>7}  {'95 %':13}{'width':>7}", *lines, sep="\n")
    raise SystemExit(any(line.missed for line in lines))


if __name__ == "__main__":
    main()
