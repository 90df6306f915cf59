"""Excitation design: chirps, multisines, sines of growing amplitude and staircases, within the limits of the bench.

A design is refused when it leaves a limit, with the number and with what would fit.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import numpy as np

from microrad.core.arrays import Floats, Integers
from microrad.core.units import format_beyond, format_input, format_limit, format_quantity, plain
from microrad.lab.recording.records import frozen
from microrad.mission.fields import Problem, ProblemsError

MOST_SAMPLES = 20_000_000
"""Samples of one record, all drives together, beyond which a duration is taken for a mistake."""

_WHOLE = 1e-6  # how far, in samples, a whole number of them may be off
_ROUNDING = 1e-9  # how far, relatively, a limit may be passed by rounding
_LEAST_TURN = 1e-3  # of the first period of a chirp
_NOTHING = 1e-12  # a room of less is none
_DETECTION_GROUP = 4  # odd lines of which one is left out


class DesignError(ProblemsError):
    """An excitation that leaves the limits of the bench or contradicts itself; each fault is one of `problems`."""

    def __init__(self, name: str, *problems: Problem) -> None:
        """Write the message: the excitation, then each parameter with what is wrong and what would fit."""
        super().__init__(*problems)
        self.args = (f"{name}: " + "; ".join(f"{p.key} {p.reason}; would fit: {p.expected}" for p in problems),)


@dataclass(frozen=True, slots=True)
class Limits:
    """What the function generator and the mirror allow, for each of `inputs` drives, in volts before the amplifier.

    The slew is that between samples. The highest frequency of a design has at least `samples_per_period` samples a
    period, above 2.
    """

    rate_hz: float
    drive_min_v: float
    drive_max_v: float
    slew_v_s: float
    samples_per_period: float
    inputs: int = 1


@dataclass(frozen=True, eq=False)
class Excitation:
    """A designed drive, read-only, shape (samples, inputs), in volts.

    The mirror rests at `rest_v` on every input before the first sample. `period_samples` is set where the drive is
    periodic. `lines` are the excited harmonics of a multisine, in cycles a period; `step_samples` the first samples at
    each new level of a staircase, from which creep is counted.
    """

    name: str
    drive: Floats
    rate_hz: float
    rest_v: float
    period_samples: int | None = None
    lines: tuple[int, ...] = ()
    step_samples: tuple[int, ...] = ()

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.drive.shape[0])


@dataclass(frozen=True, slots=True)
class Lines:
    """The harmonics of a multisine: those of 1 / `period_s` from `start_hz` to `stop_hz`, and which of them.

    "all"; "odd": odd harmonics, so that even distortion shows at the even ones; "odd-random": of each four neighbouring
    odd harmonics one at random is left out too, where odd distortion shows (random odd multisine: R. Pintelon and
    J. Schoukens, System Identification: A Frequency Domain Approach, 2012, chapter 4).
    """

    period_s: float
    start_hz: float
    stop_hz: float
    choice: Literal["all", "odd", "odd-random"] = "all"


# -------------------------------------------------------------------------------------------------------------- designs
def logarithmic_chirp(
    limits: Limits,
    *,
    start_hz: float,
    stop_hz: float,
    duration_s: float,
    amplitude_v: float,
    offset_v: float,
    axis: int = 0,
    name: str = "chirp",
) -> Excitation:
    """u = offset + amplitude sin(phase), its frequency growing exponentially in time.

    Args:
        limits: Those of the bench.
        start_hz: First frequency.
        stop_hz: Last frequency.
        duration_s: Length.
        amplitude_v: Amplitude about the offset.
        offset_v: Where all other inputs rest.
        axis: Number of the input that is driven, from 0.
        name: Name of the record.

    Raises:
        DesignError: If the drive leaves the limits or contradicts itself.
    """
    samples = samples_in(limits, name, "duration", duration_s)
    if not start_hz < stop_hz:
        raise DesignError(
            name, Problem("stop", "is not above start", f"a frequency above {format_input(start_hz, 'Hz')}")
        )
    if start_hz * duration_s < _LEAST_TURN:
        least = format_limit(_LEAST_TURN / start_hz, "s", least=True)
        reason = f"holds less than a thousandth of a period of {format_quantity(start_hz, 'Hz')}"
        raise DesignError(name, Problem("duration", reason, f"at least {least}, or a higher start"))
    growth = math.log(stop_hz / start_hz) / duration_s
    phase = 2 * math.pi * start_hz * np.expm1(growth * np.arange(samples) / limits.rate_hz) / growth
    problems = [*_too_fast(limits, "start", start_hz), *_too_fast(limits, "stop", stop_hz)]
    drive = _fitted(limits, name, ("amplitude", amplitude_v), np.sin(phase)[:, None], offset_v, problems)
    return Excitation(name, _on_axis(limits, name, drive, offset_v, axis), limits.rate_hz, offset_v)


def multisine(
    limits: Limits,
    lines: Lines,
    *,
    rms_v: float,
    offset_v: float,
    periods: int,
    realisations: int,
    seed: int,
    name: str = "multisine",
) -> tuple[Excitation, ...]:
    """Flat multisines with random phases, one record a realisation.

    With n inputs the realisations come in groups of n, orthogonal at every line: input i has the phase
    phi_i(line) + 2 pi e i / n in realisation e of its group, a column of the unitary discrete Fourier matrix
    (T. Dobrowiecki, J. Schoukens and P. Guillaume, IEEE Trans. Instrum. Meas. 55, 2006). Each record begins where its
    inputs are nearest to rest: a common delay changes neither spectrum nor orthogonality.

    Args:
        limits: Those of the bench.
        lines: The harmonics.
        rms_v: Rms of each input about the offset.
        offset_v: The offset.
        periods: Periods of each record.
        realisations: Number of records, a multiple of the inputs.
        seed: Seed of the phases.
        name: Name of the records, before the number of the realisation.

    Raises:
        DesignError: If the drive leaves the limits or contradicts itself.
    """
    length = _whole_period(limits, name, lines.period_s)
    samples_in(limits, name, "periods", periods * lines.period_s)
    samples_in(limits, name, "realisations", realisations * periods * lines.period_s)
    if realisations % limits.inputs:
        counts = f"is {realisations}, no multiple of the {limits.inputs} inputs, so no orthogonal set"
        raise DesignError(name, Problem("realisations", counts, f"a multiple of {limits.inputs}"))
    rng = np.random.Generator(np.random.Philox(seed))
    harmonics = _harmonics(lines, name, rng)
    problems = _too_fast(limits, "stop", harmonics[-1] / lines.period_s)
    if harmonics[-1] >= length / 2:
        raise DesignError(name, *problems)
    shape = np.concatenate(_orthogonal_set(harmonics, length, limits.inputs, realisations, rng), axis=1)
    closed = np.concatenate([shape, shape[:1]])  # the step from period to period has its slew too
    drives = _fitted(limits, name, ("rms", rms_v), closed, offset_v, problems)[:-1]
    names = [name] if realisations == 1 else [f"{name}-{r + 1}" for r in range(realisations)]
    columns = [slice(r * limits.inputs, (r + 1) * limits.inputs) for r in range(realisations)]
    return tuple(
        Excitation(
            each,
            frozen(np.tile(drives[:, part], (periods, 1))),
            limits.rate_hz,
            offset_v,
            length,
            tuple(int(k) for k in harmonics),
        )
        for each, part in zip(names, columns, strict=True)
    )


def growing_sines(
    limits: Limits,
    *,
    freq_hz: float,
    amplitudes_v: Sequence[float],
    periods: int,
    offset_v: float,
    axis: int = 0,
    name: str = "sines",
) -> Excitation:
    """u = offset + amplitude sin(2 pi f t), whole periods at each amplitude, one behind the other.

    Args:
        limits: Those of the bench.
        freq_hz: Frequency.
        amplitudes_v: The amplitudes.
        periods: Periods at each; they must fill a whole number of samples.
        offset_v: Where all other inputs rest.
        axis: Number of the input that is driven, from 0.
        name: Name of the record.

    Raises:
        DesignError: If the drive leaves the limits or contradicts itself.
    """
    block = _whole_block(limits, name, freq_hz, periods)
    samples_in(limits, name, "periods", block * len(amplitudes_v) / limits.rate_hz)
    sine = np.sin(2 * math.pi * freq_hz * np.arange(block) / limits.rate_hz)
    largest = max(amplitudes_v)
    shape = np.concatenate([sine * (amplitude / largest) for amplitude in amplitudes_v])
    problems = _too_fast(limits, "frequencies", freq_hz)
    drive = _fitted(limits, name, ("amplitudes", largest), shape[:, None], offset_v, problems)
    drive = _on_axis(limits, name, drive, offset_v, axis)
    repeat = Fraction(limits.rate_hz / freq_hz).limit_denominator(periods).numerator  # samples until it repeats itself
    period = repeat if len(amplitudes_v) == 1 and 2 * repeat <= block else None
    return Excitation(name, drive, limits.rate_hz, offset_v, period)


def staircase(
    limits: Limits,
    *,
    levels_v: Sequence[float],
    dwell_s: float,
    rise_s: float,
    axis: int = 0,
    name: str = "staircase",
) -> Excitation:
    """Levels joined by straight ramps; the mirror rests at the first one. A single step is two levels.

    Args:
        limits: Those of the bench.
        levels_v: The levels.
        dwell_s: Time at each level.
        rise_s: Time from one level to the next.
        axis: Number of the input that is driven, from 0.
        name: Name of the record.

    Raises:
        DesignError: If the drive leaves the limits or contradicts itself.
    """
    if len(levels_v) < 2:
        raise DesignError(name, Problem("levels", "has one item, which is no step", "at least two levels"))
    for key, seconds in (("rise", rise_s), ("dwell", dwell_s + rise_s)):
        samples_in(limits, name, key, seconds * len(levels_v))
    dwell, rise = round(dwell_s * limits.rate_hz), max(round(rise_s * limits.rate_hz), 1)
    if dwell < 1:
        step = format_quantity(1.0 / limits.rate_hz, "s")
        raise DesignError(name, Problem("dwell", "is shorter than half a sample", f"at least {step}"))
    levels = np.asarray(levels_v, dtype=float)
    problems = [*_outside(limits, "levels", levels), *_too_steep(limits, rise, levels)]
    if problems:
        raise DesignError(name, *problems)
    corners = np.arange(levels.size) * (dwell + rise)
    times = np.stack([corners, corners + dwell], axis=1).ravel()
    drive = np.interp(np.arange(times[-1] + 1), times, np.repeat(levels, 2))[:, None]
    rest = float(levels[0])
    steps = tuple(int(c) for c in corners[1:])
    return Excitation(name, _on_axis(limits, name, drive, rest, axis), limits.rate_hz, rest, step_samples=steps)


# --------------------------------------------------------------------------------------------------------------- limits
def samples_in(limits: Limits, name: str, key: str, seconds: float) -> int:
    """Number of samples in a time.

    Args:
        limits: Those of the bench.
        name: Name of the record.
        key: Key of the plan that makes it so long.
        seconds: The time.

    Raises:
        DesignError: For too many, before they are allocated.
    """
    most = MOST_SAMPLES / limits.inputs / limits.rate_hz
    if seconds > most:
        reason = f"makes a record of {format_beyond(seconds, most, 's')} at {format_input(limits.rate_hz, 'Hz')}"
        expected = f"at most {format_limit(most, 's')} ({MOST_SAMPLES / 1e6:g} million samples), or a lower rate"
        raise DesignError(name, Problem(key, reason, expected))
    return max(round(seconds * limits.rate_hz), 1)


def _too_fast(limits: Limits, key: str, highest_hz: float) -> list[Problem]:
    fewest, highest_hz = limits.samples_per_period, float(highest_hz)
    if highest_hz * fewest <= limits.rate_hz * (1 + _ROUNDING):
        return []
    reason = (
        f"reaches {format_beyond(highest_hz, limits.rate_hz / fewest, 'Hz')}, "
        f"{format_beyond(limits.rate_hz / highest_hz, fewest, '', 3)} samples a period at "
        f"{format_input(limits.rate_hz, 'Hz')} where limits.samples_per_period asks for {plain(fewest, 6)}"
    )
    most, rate = format_limit(limits.rate_hz / fewest, "Hz"), format_limit(highest_hz * fewest, "Hz", least=True)
    return [Problem(key, reason, f"at most {most}, or a rate of at least {rate}")]


def _fitted(
    limits: Limits, name: str, scale: tuple[str, float], shape: Floats, offset_v: float, problems: Sequence[Problem]
) -> Floats:
    """offset + size x shape where that is within voltage and slew; `scale` is the key of the size, and the size (V)."""
    key, size = scale
    high, low = max(float(shape.max()), 0.0), max(float(-shape.min()), 0.0)
    slew = float(np.abs(np.diff(shape, axis=0, prepend=0.0)).max()) * limits.rate_hz
    room = {
        "limits.drive_max": (limits.drive_max_v - offset_v, high, "V", offset_v),
        "limits.drive_min": (offset_v - limits.drive_min_v, low, "V", offset_v),
        "limits.slew": (limits.slew_v_s, slew, "V/s", 0.0),
    }
    found = [*problems, *_outside(limits, "offset", np.array([offset_v]))]
    most = min((space / part for space, part, _, _ in room.values() if part > 0.0), default=math.inf)
    for limit, (space, part, unit, base) in room.items():
        if size * part > space * (1 + _ROUNDING) and space >= 0.0:
            sign = -1.0 if limit.endswith("min") else 1.0
            allowed = base + sign * space
            reached = format_beyond(base + sign * size * part, allowed, unit)
            reason = f"takes the drive to {reached}, {limit} is {format_input(allowed, unit)}"
            found.append(Problem(key, reason, f"at most {format_limit(most if most > _NOTHING else 0.0, 'V')}"))
    if found:
        raise DesignError(name, *found)
    return offset_v + size * shape


def _outside(limits: Limits, key: str, levels: Floats) -> list[Problem]:
    slack = _ROUNDING * (limits.drive_max_v - limits.drive_min_v)
    bad = levels[(levels < limits.drive_min_v - slack) | (levels > limits.drive_max_v + slack)]
    span = f"{format_input(limits.drive_min_v, 'V')} to {format_input(limits.drive_max_v, 'V')}"
    reason = f"has {format_input(float(bad[0]), 'V')}, outside limits.drive_min to limits.drive_max" if bad.size else ""
    return [Problem(key, reason, span)] if bad.size else []


def _too_steep(limits: Limits, rise: int, levels: Floats) -> list[Problem]:
    largest = float(np.abs(np.diff(levels)).max())
    slew = largest / rise * limits.rate_hz
    if slew <= limits.slew_v_s * (1 + _ROUNDING):
        return []
    fewest = min(largest / limits.slew_v_s * limits.rate_hz, 1e15)
    needed = format_limit(math.ceil(fewest - _WHOLE) / limits.rate_hz, "s", least=True)
    shown, most = format_beyond(slew, limits.slew_v_s, "V/s"), format_input(limits.slew_v_s, "V/s")
    return [Problem("rise", f"makes the largest step one of {shown}, limits.slew is {most}", f"at least {needed}")]


def _on_axis(limits: Limits, name: str, column: Floats, rest_v: float, axis: int) -> Floats:
    if not 0 <= axis < limits.inputs:
        reason = f"is {axis + 1}, but the bench has {limits.inputs} input{'s' if limits.inputs > 1 else ''}"
        raise DesignError(name, Problem("axis", reason, f"1 to {limits.inputs}"))
    drive = np.full((column.shape[0], limits.inputs), rest_v)
    drive[:, axis] = column[:, 0]
    return frozen(drive)


# -------------------------------------------------------------------------------------------------------- whole periods
def _whole_block(limits: Limits, name: str, freq_hz: float, periods: int) -> int:
    """Samples in `periods` periods of a sine; raises `DesignError` where that is no whole number."""
    samples_in(limits, name, "periods", periods / freq_hz)
    exact = periods * limits.rate_hz / freq_hz
    block = round(exact)
    if block >= 1 and abs(exact - block) <= _WHOLE:
        return block
    ratio = Fraction(limits.rate_hz / freq_hz).limit_denominator(1000)
    fits = ratio > 0 and abs(ratio.denominator * limits.rate_hz / freq_hz - ratio.numerator) <= _WHOLE
    near = _near(periods * limits.rate_hz / max(block, 1), "Hz", _WHOLE / max(block, 1))
    filled = _near(exact, "samples", abs(exact - block) / exact)
    reason = f"of {format_quantity(freq_hz, 'Hz')}: {periods} of them fill {filled}, no whole number"
    expected = f"a multiple of {ratio.denominator}, or a frequency of {near}" if fits else f"a frequency of {near}"
    raise DesignError(name, Problem("periods", reason, expected))


def _whole_period(limits: Limits, name: str, period_s: float) -> int:
    samples_in(limits, name, "period", period_s)
    exact = period_s * limits.rate_hz
    length = round(exact)
    if length >= 2 and abs(exact - length) <= _WHOLE:
        return length
    near = _near(max(length, 2) / limits.rate_hz, "s", _WHOLE / max(length, 2))
    filled = _near(exact, "sample" + "s" * (exact != 1.0), abs(exact - length) / max(exact, _WHOLE))
    raise DesignError(name, Problem("period", f"is {filled}, no whole number of at least 2", near))


def _near(value: float, unit: str, share: float) -> str:
    """A quantity in six digits, or as many more as leave it well within a share of itself."""
    close = (n for n in range(6, 16) if math.isclose(float(f"{value:.{n}g}"), value, rel_tol=share / 2))
    return format_quantity(value, unit, next(close, 15))


def _harmonics(lines: Lines, name: str, rng: np.random.Generator) -> Integers:
    beyond = 2.0 * MOST_SAMPLES  # the lines of any record
    first = max(math.ceil(min(lines.start_hz * lines.period_s, beyond) - _WHOLE), 1)
    last = math.floor(min(lines.stop_hz * lines.period_s, beyond) + _WHOLE)
    harmonics = np.arange(first, last + 1, dtype=np.int64)
    if lines.choice != "all":
        harmonics = harmonics[harmonics % 2 == 1]
    if lines.choice == "odd-random":
        whole = harmonics.size // _DETECTION_GROUP
        left_out = np.arange(whole) * _DETECTION_GROUP + rng.integers(0, _DETECTION_GROUP, whole)
        harmonics = np.delete(harmonics, left_out)
    if harmonics.size == 0:
        spacing = format_quantity(1.0 / lines.period_s, "Hz")
        reason = f"leaves no {lines.choice} line of a multisine with one every {spacing}"
        raise DesignError(name, Problem("stop", reason, "a wider band, or a longer period"))
    return harmonics


def _orthogonal_set(
    harmonics: Integers, length: int, inputs: int, realisations: int, rng: np.random.Generator
) -> list[Floats]:
    """One period of each realisation, shape (samples, inputs), each input with an rms of 1."""
    turns = np.exp(2j * np.pi * np.outer(np.arange(inputs), np.arange(inputs)) / inputs)  # (realisation, input)
    shapes = []
    for _ in range(realisations // inputs):
        phases = np.exp(2j * np.pi * rng.random((inputs, harmonics.size)))
        for turn in turns:
            spectrum = np.zeros((inputs, length // 2 + 1), dtype=complex)
            spectrum[:, harmonics] = turn[:, None] * phases * (length / 2 * math.sqrt(2.0 / harmonics.size))
            shape = np.fft.irfft(spectrum, length, axis=1).T
            shapes.append(np.roll(shape, -int(np.argmin(np.abs(shape).max(axis=1))), axis=0))
    return shapes
