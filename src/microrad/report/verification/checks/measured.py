"""Comparisons with measurements: recordings where they are at hand, figures of flight and of laboratories."""

import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, NotHereError, Referent
from microrad.report.verification.workspace import Workspace

if TYPE_CHECKING:
    from microrad.lab.recording import Recording


_PIEZO = "piezo_1hz/Model_Vi_Do.dat"
_AMPLITUDES_MV = {100: 0.1142, 300: 0.2277}  # with the published errors, um


SHA256 = {
    _PIEZO: "672714f09302b892721aa44d72f337a7ee1a0eb1d107f4d6797ab47d849428ae",
    "cubespec/u_100mV_train.npy": "a53d6ee47ac1ea784c70e7634ce816467fb61effd8706eaf6b52f68142380a81",
    "cubespec/y_100mV_train.npy": "06892ff7fc943712898d7ca741205e4d6574bec2a20e69a0052f986c27bd10ad",
    "cubespec/u_300mV_train.npy": "0436437998307e8f8c86f824c1fee4e225f212861878bf58d42b2a5e2ecd0cb5",
    "cubespec/y_300mV_train.npy": "38acb224027e728d7a3c44a0ce5538fcb74c836be585a1b318a6728c8a6820fb",
    "boucwen/train.h5": "a4df68f6101a22f9fc5032e98b3e773fc108a291378ef9cf69d1b128c7ac44a4",
}
"""Of each recording that was compared at the release."""
ALIKE, OTHER, ABSENT = "as at the release", "another one than at the release", "not here"


def held_recordings(workspace: Workspace) -> dict[str, str]:
    """How each recording of the folder that is named stands to the one of the release: `ALIKE`, `OTHER` or `ABSENT`.

    Args:
        workspace: Its folder of recordings.
    """
    found = {}
    for name, expected in SHA256.items():
        path = None if workspace.data is None else workspace.data / name
        if path is None or not path.is_file():
            found[name] = ABSENT
        else:
            found[name] = ALIKE if hashlib.sha256(path.read_bytes()).hexdigest() == expected else OTHER
    return found


def _recording(workspace: Workspace, name: str) -> Path:
    if workspace.data is None or not (path := workspace.data / name).exists():
        raise NotHereError(f"the recording {name} is not here: MICRORAD_DATA names the folder that has it")
    return path


@dataclass(frozen=True, slots=True)
class HeldOut:
    """The records on which a check has the error of a mirror model.

    Args:
        part: Of the model.
        files: In the folder of recordings.
        records: Those that were held out.
        metres: Of one unit of their outputs.
        frequencies: Keys of a mission with the frequencies at which it takes that part.
    """

    part: str
    files: tuple[str, ...]
    records: Callable[[Workspace], "Sequence[Recording]"]
    metres: float
    frequencies: tuple[str, ...]


def _piezo_record(workspace: Workspace) -> "Recording":
    from microrad.lab.recording import read_recording

    return read_recording(_recording(workspace, _PIEZO), 0, 4, 200.0)


def _second_half(workspace: Workspace) -> "Sequence[Recording]":
    whole = _piezo_record(workspace)
    begin = whole.samples // 2
    return [replace(whole, drive=whole.drive[begin:], output=whole.output[begin:])]


def _piezo(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.lab.identify import identify

    found = identify([_piezo_record(workspace)], models=("prandtl_ishlinskii",), output_unit="um", lever_arm_m=0.02)
    (score,) = [s for s in found.scores if s.model == "prandtl_ishlinskii"]
    name = "identify.models.prandtl_ishlinskii.held_out_rms_percent"
    what = "model of play operators, fitted on the first half: error on the second, share of the travel"
    why = "2 %: creep of 0.55 um, which the operators lack, and noise of the gauge"
    yield Comparison(name, what, 0.0, score.held_out_rms_percent, 2.0, "%", why)


def _multisines(workspace: Workspace, amplitude_mv: int) -> Sequence[Any]:
    from microrad.lab.recording import multisine_recordings

    files = [_recording(workspace, f"cubespec/{which}_{amplitude_mv}mV_train.npy") for which in "uy"]
    drive, output = map(np.load, files)
    return multisine_recordings(drive, output, 6400.0, f"{amplitude_mv} mV")


def _cubespec(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.lab.identify.linear.amplitude import amplitude_dependence
    from microrad.lab.identify.linear.fit import fit_linear, output_error

    fits = {}
    for amplitude_mv, bar_um in _AMPLITUDES_MV.items():
        *fitted, held_out = _multisines(workspace, amplitude_mv)
        fits[amplitude_mv] = fit_linear(fitted, 28, exchanges=0)
        error_m = output_error(fits[amplitude_mv].modes, held_out, drop=1000)
        rms_um, size_um = (1e6 * math.sqrt(float(np.mean(each**2))) for each in (error_m, held_out.output))
        what = f"mirror of a satellite at {amplitude_mv} mV: measured less modelled over measured, rms, held out"
        why = "the published linear model of the same order, on other records, over the same motion"
        yield Comparison("identify.linear.held_out", what, 0.0, rms_um / size_um, bar_um / size_um, "", why)
    found = amplitude_dependence(list(fits.values()))
    name, why = "identify.linear.poles_and_zeros.freq_hz", "0.5 Hz: 0.64 of a line of the records"
    for place, hertz in enumerate((924.2, 921.1)):
        what = f"main resonance at {(100, 300)[place]} mV"
        yield Comparison(name, what, hertz, float(found.resonance_hz[place]), 0.5, "Hz", why)
    what = "rise of the gain from 100 to 300 mV"
    yield Comparison(
        "", what, 8.0, found.gain_rise_percent, 1.5, "%", "printed without a decimal; over which band is not"
    )


def _oscillator(workspace: Workspace) -> Iterator[Comparison]:
    """The record of a spring with hysteresis, by the published parameters: what is left is its noise."""
    from microrad.lab.identify.hysteresis.structures import hysteretic_oscillator
    from microrad.lab.recording import read_recording

    path = _recording(workspace, "boucwen/train.h5")
    record = read_recording(path, "multisine/u", "multisine/y", 750.0, period_samples=8192)
    finer = 20
    drive = np.asarray(record.drive[:, 0])
    fine = np.fft.irfft(finer * np.fft.rfft(drive[:8192]), 8192 * finer)  # band-limited, and each period the same
    published = (2.0, 10.0, 5e4, 5e4, 800.0, -1100.0)
    spring = hysteretic_oscillator(*published).build(np.array(published))
    output = spring.response(np.tile(fine, 2), 1.0 / 750.0 / finer)
    steady = output[8192 * finer :: finer]
    left = np.asarray(record.output[:, 0]).reshape(-1, 8192)[1:] - steady
    rms = math.sqrt(float(np.mean((left - left.mean()) ** 2)))
    what = "benchmark of a hysteretic spring by its published parameters: rms that is left, its noise"
    yield Comparison("", what, 7.3e-6, rms, 0.1e-6, "m", "the printed noise, to its digits, and a fine step's 0.03 um")


def _orbits(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.orbit.propagation import analytic

    flown = {
        "Sentinel-1A": (693e3, 98.18),
        "SPOT-4": (822e3, 98.72),
        "Landsat 8": (705e3, 98.2),
    }
    for name, (altitude_m, inclination_deg) in flown.items():
        tilt = analytic.sun_synchronous_inclination_rad(altitude_m)
        why = "0.1 deg: 10 km of altitude, which is a mean over the orbit"
        what = f"inclination of {name} at {altitude_m / 1e3:g} km"
        yield Comparison("", what, inclination_deg, math.degrees(tilt), 0.1, "deg", why)


_SINES = tuple(f"scenario.{which}_frequencies" for which in ("pid", "inverse", "loop"))
HELD_OUT = {
    "piezo-loop": HeldOut("the hysteresis of a mirror", (_PIEZO,), _second_half, 1e-6, _SINES),
    "cubespec": HeldOut(
        "the linear part of a mirror",
        tuple(f"cubespec/{which}_{mv}mV_train.npy" for mv in _AMPLITUDES_MV for which in "uy"),
        lambda workspace: [_multisines(workspace, mv)[-1] for mv in _AMPLITUDES_MV],
        1.0,
        ("mirror.linear.excited_from", "mirror.linear.excited_to"),
    ),
}
"""By the name of the check."""

CHECKS = (
    Check(
        "piezo-loop",
        "Slow loops of a piezo actuator, measured by a capacitive sensor",
        Referent.MEASUREMENT,
        "The first half of the record is fitted, the second one predicted.",
        "Aye and Ang, A Discrete Backlash Operator, 2018: its record",
        _piezo,
    ),
    Check(
        "cubespec",
        "Mirror of a small satellite under multisines, measured on a bench",
        Referent.MEASUREMENT,
        "Five realisations are fitted, the sixth is predicted.",
        "Floren et al., ISMA-USD 2024: its records and its published errors",
        _cubespec,
    ),
    Check(
        "hysteretic-spring",
        "Benchmark record of a mass on a spring with hysteresis, made by its official generator",
        Referent.PUBLISHED,
        "Simulated by the published parameters, band-limited between the samples.",
        "Noel and Schoukens, 2016; record of dynoNet",
        _oscillator,
    ),
    Check(
        "flown-orbits",
        "Inclination of sun-synchronous satellites in flight",
        Referent.MEASUREMENT,
        "From the altitude alone, by the Earth's flattening.",
        "ESA and USGS: orbits of Sentinel-1A, SPOT-4 and Landsat 8",
        _orbits,
    ),
)
