"""Frequency response from recordings without a model, with its uncertainty, for any number of inputs and outputs.

`response_from_records` is for chirps and other non-periodic drives: one transform over each record and cross- and
auto-spectra averaged in logarithmic bands. `response_from_periods` is for periodic multisines: the best linear
approximation with the noise level from period to period and the nonlinear distortion from realisation to realisation
(the robust method; R. Pintelon and J. Schoukens, System Identification, 2nd ed., Wiley 2012, ch. 4 and 7).

The response is that between samples of drive and output: a hold between them is part of it and is taken out when a
model is fitted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats, Integers
from microrad.core.labelled import TEXT, Dataset, Group, variables
from microrad.core.units import LEAST, MOST, counted
from microrad.lab.identify.linear.modal import Hold
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording

BANDS = 300
MIN_LINES = 8
_EXCITED = 1e-3
_CONDITION = 1e5

PER_DRIVE = "output/drive"
"""The unit of a response: what its outputs are in, over what its drives are in."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Sampled frequency response with its confidence.

    `response` has the shape (frequencies, outputs, inputs), in units of output per unit of drive. `standard_error`
    (same shape) is one sigma of the complex value: the root of its mean squared distance from the expected one. Where
    the records allow it, `noise_standard_error` is the part that changes from period to period and
    `distortion_standard_error` the part that changes only from realisation to realisation; else None. `coherence`
    (frequencies, outputs) is the multiple coherence. `drive_power` (frequencies, inputs, inputs) is the one-sided
    power of the drives in each band with cross terms, the mean over the records: trace(E P E^H) is the mean-square
    output of a model error E. `residual_power` (frequencies, outputs) is what the response leaves of the outputs,
    corrected for the numbers fitted. `excited_hz` is the excited band. `hold` is
    what stands between the samples of the drive: a converter's, unless a model says otherwise.
    """

    freq_hz: Floats
    response: Complexes
    standard_error: Floats
    noise_standard_error: Floats | None
    distortion_standard_error: Floats | None
    coherence: Floats
    drive_power: Complexes
    residual_power: Floats
    drive_rms: Floats
    excited_hz: tuple[float, float]
    method: str
    rate_hz: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    hold: Hold = "zero-order"

    def to_xarray(self) -> Dataset:
        """The same by frequency in Hz, name of the output and name of the input; without the powers."""
        elements = variables(
            "frequency output input",
            response=(PER_DRIVE, "complex frequency response, output over drive", self.response),
            standard_error=(PER_DRIVE, "one sigma of its complex value", self.standard_error),
        )
        for of, error in (("noise", self.noise_standard_error), ("distortion", self.distortion_standard_error)):
            if error is not None:
                meaning = f"the part of one sigma that is {of}"
                elements |= variables("frequency output input", **{f"{of}_standard_error": (PER_DRIVE, meaning, error)})
        coherence = variables("frequency output", coherence=("1", "multiple coherence", self.coherence))
        names = variables("frequency", frequency=("Hz", "frequency", self.freq_hz))
        names |= variables("output", output=(TEXT, "output", self.output_names))
        names |= variables("input", input=(TEXT, "drive", self.input_names))
        said = {"method": self.method, "sample_rate_hz": self.rate_hz, "hold": self.hold}
        return Group({**elements, **coherence}, names, said).to_xarray()


class _Spectra(NamedTuple):
    """Transforms of all records, one-sided: |U|^2 is the mean square of the line. Shapes (records, lines, channels)."""

    freq_hz: Floats
    drive: Complexes
    output: Complexes


def measure_frequency_response(
    recordings: Recording | Sequence[Recording], *, band_hz: tuple[float, float] | None = None, bands: int = BANDS
) -> FrequencyResponse:
    """Frequency response with its standard error from recordings with a broadband drive; no model is assumed.

    Recordings that state their period (`period_samples`) are averaged over periods and realisations, which tells noise
    from distortion; others are averaged in logarithmic bands.

    Args:
        recordings: One recording, or several of one rate and with the same channels; as many as inputs, or more, unless
            the drives are broadband and independent.
        band_hz: Lowest and highest frequency (Hz); by default where the drive has power. Periodic recordings have all
            their excited lines.
        bands: Number of logarithmic bands of recordings that are not periodic.

    Raises:
        IdentificationError: For recordings that cannot be averaged together, some periodic and some not among them, and
            where the inputs are not excited independently.

    Example:
        ```python
        import numpy as np
        import microrad

        noise = np.random.default_rng(1)
        drive = noise.standard_normal(20_000)
        output = np.convolve(drive, [0.0, 0.4, 0.3, 0.2, 0.1])[:20_000] + 0.01 * noise.standard_normal(20_000)
        measured = microrad.measure_frequency_response(microrad.recording_from_arrays(drive, output, rate_hz=10e3))
        fit = microrad.fit_frequency_response(
            measured.freq_hz, measured.response, 2, standard_error=measured.standard_error,
            hold=measured.hold, rate_hz=measured.rate_hz,
        )
        print(fit.poles_rad_s, fit.relative_rms_error)
        ```
    """
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    _check(several)
    periodic = [r.period_samples is not None for r in several]
    if any(periodic) and not all(periodic):
        raise IdentificationError(
            "some recordings state their period and others do not; measure each kind by itself, or state it for all."
        )
    if not all(periodic):
        return response_from_records(several, band_hz=band_hz, bands=bands)
    found = response_from_periods(several)
    if band_hz is None:
        return found
    kept = (found.freq_hz >= band_hz[0]) & (found.freq_hz <= band_hz[1])
    if not kept.any():
        raise IdentificationError(f"no excited line lies between {band_hz[0]:g} and {band_hz[1]:g} Hz; widen the band.")
    parts: dict[str, Any] = {
        field.name: value[kept]
        for field in fields(found)
        if isinstance(value := getattr(found, field.name), np.ndarray) and field.name != "drive_rms"
    }
    return replace(found, **parts)


# ------------------------------------------------------------------------------------------------- non-periodic drives
def response_from_records(
    records: Sequence[Recording],
    *,
    band_hz: tuple[float, float] | None = None,
    bands: int = BANDS,
    detrend: bool = True,
) -> FrequencyResponse:
    """Band-averaged cross-spectrum, solved for all inputs at once.

    It needs as many records as inputs, or broadband drives.

    Each band holds at least eight lines of the transform. There is no window: a chirp passes each frequency once, and a
    window would weigh frequencies by the time at which it does. The frequency of a band is the centroid of the drive's
    power in it, which removes the first-order bias of a response that changes within the band (a delay turns its
    phase).

    Args:
        records: Recordings of one rate and length, with the same channels.
        band_hz: Lowest and highest frequency; by default where the drive has power.
        bands: Number of logarithmic bands. A resonance narrower than a band is smeared: raise it.
        detrend: Whether the straight line that no response to the drive explains is removed from each output. (The line
            through the output itself is partly the chirp's own.)

    Raises:
        IdentificationError: If records differ in rate, channels or length, or inputs are not excited independently.
    """
    _check(records)
    if len({r.samples for r in records}) > 1:
        raise IdentificationError(
            f"the records have {sorted({r.samples for r in records})} samples; cut them to one length."
        )
    spectra = _transform(records, [r.output for r in records])
    low, high = band_hz or _excited_band(spectra)
    edges = _band_edges(spectra.freq_hz, low, high, bands, max(MIN_LINES, 4 * records[0].drive.shape[1]))
    if detrend:
        line = np.linspace(-1.0, 1.0, records[0].samples)[:, None]
        slopes = _unexplained_slopes(spectra, edges, records[0].samples)
        outputs = [r.output - line * slope for r, slope in zip(records, slopes, strict=True)]
        spectra = _transform(records, outputs)
    return _banded(records, spectra, edges)


def _check(records: Sequence[Recording]) -> None:
    if not records:
        raise IdentificationError("no recording was given; name at least one.")
    check_alike(records, "used")


def check_alike(records: Sequence[Recording], done: str) -> None:
    """Check that records have the same rate and the same number of channels.

    Args:
        records: The records, at least one.
        done: What is done to them, in words for the message.

    Raises:
        IdentificationError: If records differ in rate or channels.
    """
    first = records[0]
    for other in records[1:]:
        if other.rate_hz != first.rate_hz:
            short, long = ([f"{r.rate_hz:{form}}" for r in (other, first)] for form in ("g", ".17g"))
            own, rate = short if short[0] != short[1] else long
            raise IdentificationError(
                f"{other.path}: the sample rate is {own} Hz and that of {first.path} {rate} Hz; "
                f"records that are {done} together must share one rate."
            )
        if other.drive.shape[1] != first.drive.shape[1] or other.output.shape[1] != first.output.shape[1]:
            raise IdentificationError(
                f"{other.path}: {counted(other.drive.shape[1], 'input')} and "
                f"{counted(other.output.shape[1], 'output')}, where {first.path} has "
                f"{first.drive.shape[1]} and {first.output.shape[1]}; choose the same channels in each record."
            )


def _transform(records: Sequence[Recording], outputs: Sequence[Floats]) -> _Spectra:
    samples = records[0].samples
    scale = np.sqrt(2.0) / samples
    drive = np.stack([np.fft.rfft(r.drive - r.drive.mean(axis=0), axis=0) for r in records]) * scale
    output = np.stack([np.fft.rfft(y - y.mean(axis=0), axis=0) for y in outputs]) * scale
    freq = np.arange(samples // 2 + 1, dtype=np.float64) * (records[0].rate_hz / samples)
    return _Spectra(freq, drive, output)


def _excited_band(spectra: _Spectra) -> tuple[float, float]:
    """First and last frequency where the drive's power stands above a quarter of the power law it follows in
    between.
    """
    power = np.sum(np.abs(spectra.drive) ** 2, axis=(0, 2))[1:-1]
    freq = spectra.freq_hz[1:-1]
    if not power.any():
        raise IdentificationError("no drive changes in any record, so there is no response; excite the mirror.")
    marks = np.unique(np.geomspace(1, power.size, 400).astype(int)) - 1
    level = np.add.reduceat(power, marks) / np.diff(np.append(marks, power.size))
    centre = freq[marks]
    core = level * centre > _EXCITED * np.max(level * centre)
    law = np.polyval(np.polyfit(np.log(centre[core]), np.log(level[core]), 1), np.log(centre))
    strong = np.flatnonzero((np.log(np.maximum(level, 1e-300)) > law + np.log(0.25)) & core)
    return float(centre[strong[0]]), float(freq[np.append(marks, power.size)[strong[-1] + 1] - 1])


def _band_edges(freq: Floats, low: float, high: float, bands: int, lines: int) -> list[tuple[int, int]]:
    """Half-open line ranges: logarithmic, each with at least `lines` lines, up to but without half the rate."""
    if not LEAST <= low < high <= MOST:
        raise IdentificationError(f"the band {low:g} to {high:g} Hz is empty; give a lower and a higher frequency.")
    if not isinstance(bands, int | np.integer) or bands < 1:
        raise IdentificationError(f"the number of bands is {bands}; give a whole number above 0.")
    last = freq.size - 1
    if low >= freq[last]:
        raise IdentificationError(
            f"the band {low:g} to {high:g} Hz begins at or above half the sample rate, up to which a record shows "
            f"something: {freq[last]:g} Hz; give a lower band."
        )
    marks = np.clip(np.round(np.geomspace(float(low), float(high), bands + 1) / freq[1]), 1, last).astype(int)
    edges, start = [], int(marks[0])
    for mark in marks[1:]:
        if mark - start >= lines:
            edges.append((start, int(mark)))
            start = int(mark)
    if not edges:
        raise IdentificationError(
            f"the record is too short for the band {low:g} to {high:g} Hz: it resolves {freq[1]:g} Hz, which leaves "
            f"fewer than {lines} lines; record longer."
        )
    return edges


def _bands(spectra: _Spectra, edges: list[tuple[int, int]]) -> Iterator[tuple[Complexes, Complexes]]:
    """Drive and output lines of each band, all records side by side: (inputs, lines), (outputs, lines)."""
    for begin, end in edges:
        u, y = (part[:, begin:end].reshape(-1, part.shape[2]).T for part in (spectra.drive, spectra.output))
        yield u, y


def _inverses(spectra: _Spectra, edges: list[tuple[int, int]]) -> tuple[Complexes, Complexes]:
    """Summed cross-power of the drives in each band, and its inverse."""
    auto = np.stack([u @ u.conj().T for u, _ in _bands(spectra, edges)])
    return auto, _independent(auto, spectra.freq_hz[[begin for begin, _ in edges]])


def _banded(records: Sequence[Recording], spectra: _Spectra, edges: list[tuple[int, int]]) -> FrequencyResponse:
    inputs, outputs = spectra.drive.shape[2], spectra.output.shape[2]
    auto, inverse = _inverses(spectra, edges)
    response = np.empty((len(edges), outputs, inputs), dtype=complex)
    error, freq = np.empty(response.shape), np.empty(len(edges))
    coherence, left = np.empty((len(edges), outputs)), np.empty((len(edges), outputs))
    for k, (u, y) in enumerate(_bands(spectra, edges)):
        response[k] = (y @ u.conj().T) @ inverse[k]
        rest = np.sum(np.abs(y - response[k] @ u) ** 2, axis=1)
        variance = rest / (u.shape[1] - inputs)
        error[k] = np.sqrt(variance[:, None] * np.diag(inverse[k]).real)
        coherence[k] = 1.0 - rest / np.maximum(np.sum(np.abs(y) ** 2, axis=1), 1e-300)
        left[k] = variance * u.shape[1] / len(records)
        weights = np.sum(np.abs(u) ** 2, axis=0)
        freq[k] = float(weights @ np.tile(spectra.freq_hz[slice(*edges[k])], len(records)) / weights.sum())
    excited = (float(spectra.freq_hz[edges[0][0]]), float(spectra.freq_hz[edges[-1][1] - 1]))
    return FrequencyResponse(
        freq_hz=freq,
        response=response,
        standard_error=error,
        noise_standard_error=None,
        distortion_standard_error=None,
        coherence=coherence,
        drive_power=auto / len(records),
        residual_power=left,
        excited_hz=excited,
        method="band-averaged cross-spectrum",
        **_of_records(records),
    )


def _independent(auto: Complexes, freq_hz: Floats) -> Complexes:
    """Inverse of the drives' cross-power at each frequency.

    Raises IdentificationError if the drives are not independent at most frequencies.

    A single line at which random phases happen to agree is kept: its standard error says what it is worth.
    """
    size = np.sqrt(np.diagonal(auto, axis1=1, axis2=2).real)
    if not (size > 0).all():
        line, channel = np.argwhere(size <= 0)[0]
        raise IdentificationError(
            f"input {channel} is not excited at {freq_hz[line]:g} Hz; narrow the band or excite it there."
        )
    scale = size[:, :, None] * size[:, None, :]
    condition = np.linalg.cond(auto / scale)
    if np.median(condition) > _CONDITION:
        inputs = size.shape[1]
        raise IdentificationError(
            f"the {inputs} inputs are not driven independently at {freq_hz[int(np.argmax(condition))]:g} Hz and most "
            f"other frequencies, so their responses cannot be told apart; give at least {inputs} records with drives "
            "that differ (one input at a time, or orthogonal multisines)."
        )
    return np.asarray(np.linalg.pinv(auto / scale, hermitian=True) / scale)


def _of_records(records: Sequence[Recording]) -> dict[str, Any]:
    """What a response takes from its records as it is."""
    drive_rms = np.sqrt(np.mean([np.var(r.drive, axis=0) for r in records], axis=0))
    return {
        "drive_rms": drive_rms,
        **{name: getattr(records[0], name) for name in ("rate_hz", "input_names", "output_names")},
    }


def _unexplained_slopes(spectra: _Spectra, edges: list[tuple[int, int]], samples: int) -> Floats:
    """Slope of the straight line in each record that no response to the drive explains, shape (records, outputs).

    Least squares over all bands at once, with the response of each band eliminated: the ramp and the output are both
    freed of what the drives explain in the band, and what is left of one is fitted to what is left of the other.
    """
    count, outputs = len(spectra.drive), spectra.output.shape[2]
    ramp = np.fft.rfft(np.linspace(-1.0, 1.0, samples)) * (np.sqrt(2.0) / samples)
    gram, cross = np.zeros((count, count)), np.zeros((count, outputs))
    _, inverse = _inverses(spectra, edges)
    for k, (u, y) in enumerate(_bands(spectra, edges)):
        lines = np.kron(np.eye(count), ramp[None, slice(*edges[k])])
        lines = lines - (lines @ u.conj().T) @ inverse[k] @ u
        gram += (lines @ lines.conj().T).real
        cross += (lines @ y.conj().T).real
    return np.asarray(np.linalg.lstsq(gram, cross, rcond=None)[0])


# ---------------------------------------------------------------------------------------------------- periodic drives
def response_from_periods(records: Sequence[Recording], *, skip_periods: int = 0) -> FrequencyResponse:
    """Best linear approximation from periodic records, one realisation of the same lines each.

    At each excited line the outputs of all realisations are solved for the response by least squares, which for
    orthogonal multisines in groups as large as the number of inputs is the mean over the groups. What is left over
    gives the total standard error; the scatter between the periods of a realisation gives the noise part; their
    difference is nonlinear distortion. With as many realisations as inputs nothing is left over: the total is then the
    noise part, and the distortion None.

    Args:
        records: Recordings of one rate, with the same channels and `period_samples`.
        skip_periods: First periods of each record that are dropped as transient.

    Raises:
        IdentificationError: If a period is missing or differs, if there are fewer records than inputs, or fewer than
            two periods with no record to spare, or if the drives are not independent.
    """
    _check(records)
    period = _period(records)
    drive, output = (_periods(records, name, period, skip_periods) for name in ("drive", "output"))
    m, p, _, inputs = drive.shape
    if m < inputs:
        raise IdentificationError(
            f"{counted(m, 'record')} for {inputs} inputs: at least {inputs} realisations with different drives are "
            "needed."
        )
    if m == inputs and p < 2:
        raise IdentificationError(
            f"{counted(m, 'record')} of one usable period for {counted(inputs, 'input')} leave{'s' * (m == 1)} nothing "
            "to estimate the confidence from; give more realisations or more periods."
        )
    lines = _excited_lines(drive, period)
    u, y = drive[:, :, lines].mean(axis=1), output[:, :, lines].mean(axis=1)
    freq = lines * records[0].rate_hz / period
    auto = np.einsum("mfi,mfj->fij", u, u.conj())
    inverse = _independent(auto, freq)
    response = np.einsum("mfo,mfj,fji->foi", y, u.conj(), inverse, optimize=True)
    rest = np.sum(np.abs(y - np.einsum("foi,mfi->mfo", response, u)) ** 2, axis=0)
    noise_variance = _noise_variance(drive, output, response, lines) if p > 1 else None
    total_variance = rest / (m - inputs) if m > inputs else noise_variance
    assert total_variance is not None
    spread = np.diagonal(inverse, axis1=1, axis2=2).real[:, None, :]
    total, noise, distortion = _standard_errors(total_variance, noise_variance, spread, m > inputs)
    coherence = 1.0 - total_variance * m / np.maximum(np.sum(np.abs(y) ** 2, axis=0), 1e-300)
    return FrequencyResponse(
        freq_hz=freq,
        response=response,
        standard_error=total,
        noise_standard_error=noise,
        distortion_standard_error=distortion,
        coherence=np.clip(coherence, 0.0, 1.0),
        drive_power=auto / m,
        residual_power=total_variance,
        excited_hz=(float(freq[0]), float(freq[-1])),
        method=f"best linear approximation, realisations: {m}, periods of each: {p}",
        **_of_records(records),
    )


def _period(records: Sequence[Recording]) -> int:
    lengths = {r.period_samples or 0 for r in records}
    if 0 in lengths:
        name = next(r.path for r in records if not r.period_samples)
        raise IdentificationError(f"{name}: the record has no period; give period_samples or treat it as not periodic.")
    if len(lengths) > 1:
        raise IdentificationError(f"the records have periods of {sorted(lengths)} samples; they must agree.")
    return lengths.pop()


def _periods(records: Sequence[Recording], name: str, period: int, skip: int) -> Complexes:
    """Transforms of each whole period behind the first `skip`, shape (records, periods, lines, channels)."""
    shortest = min(records, key=lambda r: r.samples)
    count = shortest.samples // period - skip
    if skip < 0 or count < 1:
        raise IdentificationError(
            f"{shortest.path}: {shortest.samples} samples hold {shortest.samples // period} periods of {period}, "
            f"and {skip} are to be dropped as transient; drop none or more and keep at least one, or record more "
            "periods."
        )
    parts = [getattr(r, name)[skip * period : (skip + count) * period].reshape(count, period, -1) for r in records]
    return np.asarray(np.fft.rfft(np.stack(parts), axis=2) * (np.sqrt(2.0) / period))


def _excited_lines(drive: Complexes, period: int) -> Integers:
    """Lines, without zero and half the rate, whose drive power is above a thousandth of the strongest line's."""
    power = np.mean(np.abs(drive) ** 2, axis=(0, 1)).max(axis=1)
    power[0] = 0.0
    if period % 2 == 0:
        power[-1] = 0.0
    if not power.any():
        raise IdentificationError("no drive changes in any record, so there is no response; excite the mirror.")
    return np.flatnonzero(power > _EXCITED * power.max())


def _noise_variance(drive: Complexes, output: Complexes, response: Complexes, lines: Integers) -> Floats:
    """Variance of the mean over periods of what the response leaves, mean over realisations; (lines, outputs)."""
    left = output[:, :, lines] - np.einsum("foi,mpfi->mpfo", response, drive[:, :, lines], optimize=True)
    periods = left.shape[1]
    scatter = np.sum(np.abs(left - left.mean(axis=1, keepdims=True)) ** 2, axis=1) / (periods - 1)
    return np.asarray(scatter.mean(axis=0) / periods)


def _standard_errors(
    total: Floats, noise: Floats | None, spread: Floats, spare: bool
) -> tuple[Floats, Floats | None, Floats | None]:
    """Standard errors of the response: total, noise part, distortion part."""
    errors = np.sqrt(total[:, :, None] * spread)
    if noise is None:
        return errors, None, None
    noisy = np.sqrt(noise[:, :, None] * spread)
    if not spare:
        return errors, noisy, None
    return errors, noisy, np.sqrt(np.maximum(errors**2 - noisy**2, 0.0))
