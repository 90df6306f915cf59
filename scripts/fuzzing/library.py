"""Arrays and numbers for the public functions of `microrad`: nan, infinities, wrong shapes, empty, huge, complex."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import microrad
from fuzzing import mutate, properties

_SCALARS = (
    *(math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1.0, 0.5, 2.0, 1e-3, 1e3, 1e-9, 1e9, 1e30, 1e-30, 1e100, 1e-100),
    *(1e154, 1e160, 1e300, 1e-300, 1e308, -1e308, 5e-324, 1e-320, 10**17, 3),
)
_N = 240
_TIME_S = np.arange(_N) / 1000.0
_WAVE = 5.0 * np.sin(2.0 * np.pi * 23.0 * _TIME_S)
_ROW = np.linspace(1.0, 400.0, 40)


@dataclass(frozen=True, slots=True)
class Call:
    """A public function with good arguments, some of which are made bad; `keep` checks what it returns."""

    name: str
    function: Callable[..., Any]
    good: dict[str, Any]
    keep: Callable[[Any], None]
    most_s: float = 1.0
    most_bytes: int = 1_000_000_000

    def made(self, draw: Random) -> dict[str, Any]:
        """The arguments, one to three of which are bad."""
        made = dict(self.good)
        for key in draw.sample(tuple(made), min(draw.choice((1, 1, 1, 2, 3)), len(made))):
            made[key] = _bad(draw, made[key])
        return made

    def take(self, made: dict[str, Any], folder: Path) -> None:
        """Call the function and check what it returns.

        Args:
            made: The arguments.
            folder: Not used.
        """
        try:
            found = self.function(**made)
        except ValueError as error:
            raise properties.documented(error) from error
        self.keep(found)


def _bad(draw: Random, good: Any) -> Any:
    """A bad argument in place of a good one of the same kind."""
    if isinstance(good, str):
        return draw.choice((*mutate.WORDS, *mutate.NUMBERS)) + draw.choice(mutate.UNITS)
    if isinstance(good, tuple):
        items = [_number(draw) if draw.random() < 0.4 else each for each in good]
        return tuple(items)
    if isinstance(good, dict):
        return {draw.choice(mutate.WORDS): _number(draw) for _ in range(draw.randrange(3))}
    return _array(draw, good) if isinstance(good, np.ndarray) else _number(draw)


def _number(draw: Random) -> float:
    return draw.choice(_SCALARS)


def _array(draw: Random, good: Any) -> Any:
    made = np.array(good)
    how = draw.randrange(11)
    if how < 4:
        made = made.astype(complex if made.dtype.kind == "c" else float)
        for _ in range(draw.choice((1, 1, 3))):
            made.flat[draw.randrange(made.size)] = _number(draw)
    elif how == 4:
        made = made[: draw.randrange(made.size + 1)]
    elif how == 5:
        made = draw.choice((made[None], made[:, None], np.stack((made, made)), made[0], made[None, None]))
    elif how == 6:
        made = made * float(draw.choice((1e-320, 1e-200, 1e-30, 1e30, 1e100, 1e200, -1.0, 0.0)))
    elif how == 7:
        made = draw.choice(
            (made.astype(complex), made * 1j, made.real.astype(np.float32), made.astype(bool), made.tolist())
        )
    elif how == 8:
        made = draw.choice(
            (made[::-1], np.sort(made), np.roll(made, 7), np.zeros_like(made), np.full_like(made, made[0]))
        )
    elif how == 9:
        made = draw.choice(
            (np.array([]), np.zeros((0, 2)), np.array(3.0), [], [[]], np.zeros(made.size, dtype="M8[s]"))
        )
    else:
        made = draw.choice((made.astype(object), [None], ["x"], None, [[1.0], [1.0, 2.0]]))
    return made


# ----------------------------------------------------------------------------------------------------- what is returned
def _finite(found: Any) -> None:
    properties.finite("what is returned", found)


def _power(found: Any) -> None:
    properties.finite("lines", [line.value for line in found.lines])
    assert math.isclose(found.margin_db(0.0), found.received_dbm, abs_tol=1e-9), "a margin that is not the difference"


def _losses(found: Any) -> None:
    assert np.all(np.asarray(found) >= 0.0), "a loss below 0 dB, or none"


def _times(found: Any) -> None:
    properties.probability("found", found.probability)
    if found.probability > 0.5:
        assert 0.0 <= found.quantile(0.25) <= found.quantile(0.5), "time runs backward"


def _divergence(found: Any) -> None:
    properties.finite("half angle", found.half_angle_rad)


def _labelled(found: Any) -> None:
    assert found.to_xarray().sizes, "a data set without a dimension"


def _contacts(found: Any) -> None:
    for each in found:
        assert math.isfinite(each.start_s) and each.duration_s >= 0.0, "a contact that ends before it begins"


def _nothing(found: Any) -> None:
    """What is returned has its own tests."""


# ------------------------------------------------------------------------------------------------------- the functions
def _bouc_wen(drive_v: Any, step_s: Any, parameters: Any) -> Any:
    return microrad.BoucWen(*parameters).response(drive_v, step_s)


def _plays(drive_v: Any, step_s: Any, thresholds_v: Any, weights_rad_v: Any) -> Any:
    return microrad.PrandtlIshlinskii(thresholds_v, weights_rad_v).response(drive_v, step_s)


def _inverse(output_rad: Any, step_s: Any, thresholds_v: Any, weights_rad_v: Any) -> Any:
    return microrad.PrandtlIshlinskii(thresholds_v, weights_rad_v).inverse(output_rad, step_s)


def _loop(amplitude_v: Any, freq_hz: Any, thresholds_v: Any, weights_rad_v: Any) -> Any:
    return microrad.PrandtlIshlinskii(thresholds_v, weights_rad_v).loop(amplitude_v, freq_hz, 64).output_rad


def _creep(drive_v: Any, step_s: Any, weights_rad_v: Any, time_constants_s: Any) -> Any:
    return microrad.Creep(weights_rad_v, time_constants_s).response(drive_v, step_s)


def _mirror(gain: Any, numerator: Any, denominator: Any, drive_v: Any, step_s: Any) -> Any:
    mirror = microrad.Mirror.of(gain, numerator, denominator)
    properties.finite("frequency response", mirror.frequency_response([1.0, 100.0]))
    return mirror.response(drive_v, step_s)


def _frequency_response(freq_hz: Any) -> Any:
    return microrad.Mirror.of(50e-6, [1.0], [1 / 6000**2, 0.8 / 6000, 1.0]).frequency_response(freq_hz)


def _measured(drive: Any, output: Any, rate_hz: Any, low_hz: Any, high_hz: Any) -> Any:
    recording = microrad.recording_from_arrays(drive, output, rate_hz)
    return microrad.measure_frequency_response(recording, band_hz=(low_hz, high_hz))


def _fitted(freq_hz: Any, response: Any, standard_error: Any) -> Any:
    return microrad.fit_frequency_response(freq_hz, response, 1, standard_error=standard_error)


def _margins(proportional: Any, integral: Any, rate_hz: Any, noise: Any, delay_s: Any) -> Any:
    mirror = microrad.Mirror.of(50e-6, [1.0], [1 / 6000**2, 0.8 / 6000, 1.0])
    loop = microrad.Loop(mirror=mirror, rate_hz=rate_hz, sensor_noise_rad=noise, delay_s=delay_s)
    controller = microrad.Controller.pid(proportional, integral, rate_hz=rate_hz)
    return loop.margins(controller).modulus


def _outage(bias_rad: Any, rms_rad: Any, half_angle_rad: Any, probability: Any) -> Any:
    return microrad.outage_loss_db(microrad.Jitter(bias_rad, rms_rad), half_angle_rad, probability)


def _best(bias_rad: Any, rms_rad: Any, probability: Any, smallest_half_angle_rad: Any) -> Any:
    jitter = microrad.Jitter(bias_rad, rms_rad)
    return microrad.best_divergence(jitter, probability, smallest_half_angle_rad=smallest_half_angle_rad)


def _quantity(text: Any, unit: Any) -> Any:
    return microrad.parse_quantity(text, unit)


_FOLLOWS = np.convolve(_WAVE, [0.0, 0.4, 0.3])[:_N]
_PLAYS = {"thresholds_v": (0.0, 1.0, 3.0), "weights_rad_v": (40e-6, 6e-6, 4e-6)}
_LAGS = {"weights_rad_v": (1e-6, 1e-6), "time_constants_s": (0.1, 1.0)}
_TURNS = (5e-5, 0.0, -8e-6, 0.0, 0.3, 0.1)
_JITTER = {"bias_rad": (1e-6, 0.0), "rms_rad": (2e-6, 2e-6)}
_BEAM = {
    "power_w": 1.0, "half_angle_rad": 8e-6, "distance_m": 45e6, "aperture_m": 0.25, "wavelength_m": 1064e-9,
    "pointing_error_rad": 2e-6, "losses_db": {"optics": 1.0},
}  # fmt: skip
_SCAN = {
    "sigma_rad": 100e-6, "beam_radius_rad": 20e-6, "detection_time_s": 5e-3, "coverage": 0.99, "overlap": 0.2,
    "detection_probability": 0.9, "jitter_rms_rad": 1e-6,
}  # fmt: skip

CALLS = (
    Call("bouc_wen", _bouc_wen, {"drive_v": _WAVE, "step_s": 1e-3, "parameters": _TURNS}, _finite),
    Call("plays", _plays, {"drive_v": _WAVE, "step_s": 1e-3, **_PLAYS}, _finite),
    Call("inverse", _inverse, {"output_rad": 4e-5 * _WAVE, "step_s": 1e-3, **_PLAYS}, _finite),
    Call("loop", _loop, {"amplitude_v": 5.0, "freq_hz": 10.0, **_PLAYS}, _finite),
    Call("creep", _creep, {"drive_v": _WAVE, "step_s": 1e-3, **_LAGS}, _finite),
    Call(
        "mirror", _mirror,
        {
            "gain": 50e-6, "numerator": np.array([1.0]), "denominator": np.array([1 / 6000**2, 0.8 / 6000, 1.0]),
            "drive_v": _WAVE, "step_s": 1e-4,
        },
        _finite,
    ),
    Call("bode", _frequency_response, {"freq_hz": _ROW}, _finite),
    Call(
        "recording", microrad.recording_from_arrays,
        {"drive": _WAVE, "output": _FOLLOWS, "rate_hz": 1000.0, "period_samples": 120}, properties.recording,
    ),
    Call(
        "measured", _measured, {"drive": _WAVE, "output": _FOLLOWS, "rate_hz": 1000.0, "low_hz": 5.0, "high_hz": 400.0},
        _labelled,
    ),
    Call(
        "fitted", _fitted,
        {"freq_hz": _ROW, "response": 1.0 / (1.0 + 1j * _ROW / 60.0), "standard_error": 1e-3}, _labelled,
    ),
    Call(
        "spectrum", microrad.fit_spectrum,
        {"freq_hz": _ROW, "psd_rad2_hz": 1e-12 / (1.0 + _ROW**2), "convention": "radial"}, _nothing, most_s=20.0,
    ),
    Call(
        "margins", _margins,
        {"proportional": 0.0, "integral": 2e6, "rate_hz": 10e3, "noise": 2e-7, "delay_s": 0.0}, _finite,
    ),
    Call("received_power", microrad.received_power, _BEAM, _power),
    Call("outage", _outage, {**_JITTER, "half_angle_rad": 1e-5, "probability": np.array([0.1, 0.003])}, _losses),
    Call("divergence", _best, {**_JITTER, "probability": 0.01, "smallest_half_angle_rad": 1e-6}, _divergence),
    Call("scan", microrad.scan_times, _SCAN, _times, most_s=5.0),
    Call("quantity", _quantity, {"text": "5 cm", "unit": "m"}, _finite),
)  # fmt: skip
"""The public functions that take numbers."""
