#!/usr/bin/env python3
"""Public functions of microrad on the files of a folder: `library.py WORD` prints what they return, a line each.

The cases of the laboratory run it as a program of their folder, and keep what it prints.
"""

import dataclasses
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import microrad
from microrad import BoucWen, Creep, Mirror, PrandtlIshlinskii
from microrad.lab.identify import fit_hysteretic_stiffness
from microrad.lab.identify.stiffness.fit import StiffnessOptions
from microrad.lab.recording import read_arrays
from microrad.mirror import coupled, spread
from microrad.mission.file import load_coupled_mirror, load_mirror
from reference.told import DISTINCT, curve

ACCEPTABLE = ("jitter", "clipping", "dead", "quantisation", "drift", "unexcited", "lead")

DIGITS = 5
"""Of a number that stands by itself."""


def said(name: str, value: Any, *more: str) -> Iterator[str]:
    """A value as lines: each of its numbers, long rows by a few of their figures.

    Args:
        name: What stands in front.
        value: A number, words, an array, a record or what holds such.
        more: Properties of a record that are said behind its fields.
    """
    if isinstance(value, np.ndarray):
        yield from _array(name, value)
    elif dataclasses.is_dataclass(value):
        for key in [*(field.name for field in dataclasses.fields(value)), *more]:
            yield from said(f"{name}.{key}", getattr(value, key))
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from said(f"{name}.{key}", each)
    elif isinstance(value, list | tuple):
        if value and all(isinstance(each, float | int) for each in value):
            yield from _array(name, np.array(value, dtype=float))
        else:
            for i, each in enumerate(value):
                yield from said(f"{name}.{i}", each)
    elif isinstance(value, complex):
        yield f"{name}: {value.real:.{DIGITS}g} {value.imag:.{DIGITS}g} i"
    elif isinstance(value, float):
        yield f"{name}: {value:.{DIGITS}g}"
    else:
        yield f"{name}: {value}"


def _array(name: str, values: np.ndarray[Any, Any]) -> Iterator[str]:
    """An array: each of its columns along the first axis."""
    if np.iscomplexobj(values):
        least = 1e-12 * np.max(np.abs(values), initial=0.0)  # what is smaller is rounding
        yield from _array(f"{name} re", np.where(np.abs(values.real) > least, values.real, 0.0))
        yield from _array(f"{name} im", np.where(np.abs(values.imag) > least, values.imag, 0.0))
        return
    if values.ndim < 2:
        yield f"{name}: {_curve(np.atleast_1d(values))}"
        return
    for at in np.ndindex(values.shape[1:]):
        yield f"{name}[:, {', '.join(map(str, at))}]: {_curve(values[(slice(None), *at)])}"


def _curve(values: np.ndarray[Any, Any]) -> str:
    return DISTINCT.sub("", curve(values.astype(float).tolist()))


def refused(name: str, call: Callable[[], Any]) -> str:
    """What is said where something cannot be had."""
    try:
        return f"{name}: {call()} in place of a refusal"
    except (ValueError, microrad.MicroradError) as error:
        return f"{name}: {error}"


# ---------------------------------------------------------------------------------------------------------- recordings
def findings() -> Iterator[str]:
    """What the checks say of each file named in `recordings.json`: as it is, and with all findings taken on."""
    for name, options in json.loads(Path("recordings.json").read_text(encoding="utf-8")).items():
        for accept in ((), ACCEPTABLE):
            try:
                found = microrad.read_recording(name, accept=accept, **options)
            except microrad.MicroradError as error:
                yield f"{name}, {len(accept)} accepted: {error}"
                continue
            if not accept or any(each.refused for each in found.findings):
                yield f"{name}, {len(accept)} accepted: {found.rate_hz:.7g} Hz, {found.samples} samples"
                for each in found.findings:
                    refused = "refused" if each.refused else "noted"
                    yield f"  {each.kind}, {each.channel}, {each.row}, {each.output}, {refused}: {each.message}"


def read() -> Iterator[str]:
    """Recordings as they are read by the options in `recordings.json`, by the files' names or in pairs with them."""
    wanted = json.loads(Path("recordings.json").read_text(encoding="utf-8"))
    for name, options in wanted.items() if isinstance(wanted, dict) else wanted:
        try:
            yield from _recording(name, microrad.read_recording(name, **options))
        except microrad.MicroradError as error:
            yield f"{name}: {error}"


def _recording(name: str, found: Any) -> Iterator[str]:
    for key in (
        "path",
        "rate_hz",
        "input_names",
        "output_names",
        "input_units",
        "output_units",
        "period_samples",
        "role",
    ):
        yield f"{name}.{key}: {getattr(found, key)}"
    yield from said(f"{name}.drive", found.drive)
    yield from said(f"{name}.output", found.output)
    yield from (f"{name}: {each.kind}: {each.message}" for each in found.findings)


def arrays() -> Iterator[str]:
    """Recordings from whole arrays of periods, realisations and channels."""
    axes = ("periods", "realisations", "channels", "samples")
    one, other = "drives.npy", "outputs.npy"
    for found in read_arrays(one, rate_hz=1730.0, axes=axes, output_path=other):
        yield from _recording(found.path, found)
    for found in read_arrays(one, rate_hz=1730.0, axes=axes, output_path=other, part_s=(0.07, 0.29)):
        yield from _recording(found.path, found)
    wrong: dict[str, dict[str, Any]] = {
        "no rate": {"axes": axes, "output_path": other},
        "an axis twice": {"axes": ("samples", "samples", "channels", "periods"), "output_path": other},
        "no samples": {"axes": axes[:3], "output_path": other},
        "an axis misspelt": {"axes": ("period", *axes[1:]), "output_path": other},
        "the same array": {"axes": axes, "rate_hz": 1730.0},
        "axes changed": {"axes": (axes[1], axes[0], *axes[2:]), "output_path": other, "rate_hz": 1730.0},
        "periods twice": {"axes": axes, "output_path": other, "rate_hz": 1730.0, "period_samples": 240},
        "too few samples": {"axes": (*axes[:2], axes[3], axes[2]), "output_path": other, "rate_hz": 1730.0},
    }
    for name, options in wrong.items():
        yield refused(name, lambda options=options: read_arrays(one, **options))
    swapped = {"axes": axes, "rate_hz": 1730.0}
    yield refused("other shapes", lambda: read_arrays("swapped.npz", "u", "y", **swapped))
    yield refused("columns", lambda: read_arrays("spaces.dat", **swapped))


# ---------------------------------------------------------------------------------------------------------- hysteresis
BOUC_WEN = {
    "slow": BoucWen(71e-6, 0.0, -13e-6, 0.0, 1.3, 0.4),
    "rate": BoucWen(83e-6, -2.9e-5, -17e-6, 3.7e-4, 2.1, -0.3, 930.0, 0.7),
    "grows": BoucWen(64e-6, 1.7e-5, 11e-6, -2.3e-4, 0.9, 0.35, 1700.0, -0.4),
    "uneven": BoucWen(77e-6, 0.0, -14e-6, 1.1e-4, 1.7, 0.3, 2300.0, 0.2, 0.21, -0.13),
    "round": BoucWen(58e-6, 0.0, -12e-6, 0.0, 1.9, 0.25, gamma_1_v=-0.17, eta_1_v=0.11, exponent=1.6),
    "wrong way": BoucWen(41e-6, 0.0, -29e-6, 4.1e-4, 3.3, 1.2, 800.0),
    "wrong way far": BoucWen(23e-6, 0.0, -37e-6, 0.0, 2.7, 0.9, gamma_1_v=0.19, eta_1_v=0.23, exponent=1.3),
}
PLAYS = {
    "plain": PrandtlIshlinskii((0.0, 0.43, 1.71, 3.3), (51e-6, 7.3e-6, 5.9e-6, 3.1e-6)),
    "widening": PrandtlIshlinskii((0.0, 0.61, 2.3), (47e-6, 9.1e-6, 6.7e-6), 2.9e-4, 610.0),
    "falling": PrandtlIshlinskii((0.0, 0.29, 1.9), (-37e-6, -4.1e-6, -8.3e-6)),
    "mixed": PrandtlIshlinskii((0.0, 0.83, 1.4), (39e-6, -5.7e-6, 4.9e-6)),
    "bent": PrandtlIshlinskii(
        (0.0, 0.7, 1.6), (33e-6, 6.1e-6, 2.3e-6), polynomial_rad=(4e-6, -3e-6, 7e-6), reach_v=4.3
    ),
}
CREEP = Creep((1.3e-6, -0.7e-6, 2.1e-6), (0.013, 0.17, 1.9))
STEP_S = 7.3e-4


def drive(samples: int = 900) -> np.ndarray[Any, Any]:
    """A drive about the bias, uneven and with inner loops (V)."""
    t = STEP_S * np.arange(samples)
    return 3.1 * np.sin(2 * np.pi * 4.7 * t + 0.2) * (0.3 + t) + 1.7 * np.sin(2 * np.pi * 17.3 * t) - 0.9 * t


def hysteresis() -> Iterator[str]:
    """Models of hysteresis by themselves: response, loop, inverse and what is known of them."""
    u = drive()
    facts = ("settled_rad", "admissible", "reversal_swing", "admissible_rate_v_s", "wrong_way_rad")
    for name, model in {**BOUC_WEN, **PLAYS}.items():
        yield from said(f"{name}.response", model.response(u, STEP_S))
        loop = model.loop(3.7, 11.3, 47)
        yield f"{name}: {loop!r}"
        yield from said(f"{name}.loop", loop, "width")
        try:
            yield from said(f"{name}.inverse", model.inverse(53e-6 * u, STEP_S))
        except ValueError as error:
            yield f"{name}.inverse: {error}"
        if isinstance(model, BoucWen):
            yield from said(name, model, *facts)
            yield from said(f"{name}.branches", [model.settled_branch_rad(rising) for rising in (1.0, -1.0)])
            yield from said(f"{name}.slope", [model.reversal_slope_rad_v(rate) for rate in (0.0, 310.0, -4100.0)])
        else:
            yield f"{name}.admissible: {model.admissible}"
    yield from said("widening.inverted", PLAYS["widening"].inverted())
    yield from said("creep.response", CREEP.response(u, STEP_S))
    slow = BOUC_WEN["slow"]
    yield refused("drive of two axes", lambda: slow.response(np.ones((7, 2)), STEP_S))
    yield refused("drive with nan", lambda: slow.response([0.3, math.nan], STEP_S))
    yield refused("no step", lambda: CREEP.response(u, 0.0))
    yield refused("amplitude below 0", lambda: slow.loop(-1.3, 7.0))
    yield refused("frequency of 0", lambda: slow.loop(1.3, 0.0))
    yield refused("few samples", lambda: slow.loop(1.3, 7.0, 7))
    yield refused("parameter of no number", lambda: BoucWen(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0).response(u, STEP_S))
    yield refused("no gain", lambda: BoucWen(0.0, 0.0, -1e-6, 0.0, 1.0, 0.0).inverse(u, STEP_S))
    yield refused("grows beyond all", lambda: BoucWen(1e-6, 0.0, -1e-6, 9.0, 1.0, 0.0).response(900 * u, STEP_S))
    yield refused("falling thresholds", lambda: PrandtlIshlinskii((0.0, 2.0, 1.0), (1e-6, 1e-6, 1e-6)))
    yield refused("weights too few", lambda: PrandtlIshlinskii((0.0, 2.0), (1e-6,)))
    yield refused("narrowing", lambda: PrandtlIshlinskii((0.0,), (1e-6,), -0.1))
    yield refused("stands still", lambda: PrandtlIshlinskii((0.4,), (1e-6,)).inverse(u, STEP_S))
    yield refused("lags without weights", lambda: Creep((1e-6,), (0.1, 0.2)).response(u, STEP_S))


# ------------------------------------------------------------------------------------------------------------- mirrors
def mirrors() -> Iterator[str]:
    """Mirrors made of a model, and those of the files `*-mirror.toml`, which several of the files hold otherwise."""
    u = drive(700)
    resonance = {"numerator": [3.1e-8, 2.3e-4, 1.0], "denominator": [2.1e-11, 6.9e-7, 3.7e-4, 1.0]}
    freq = np.array([0.3, 7.1, 83.0, 310.0, 1700.0])
    for name, model in {**BOUC_WEN, **PLAYS, "gain": 61e-6}.items():
        if name == "widening":
            continue
        mirror = Mirror.of(model, **resonance, creep=CREEP, name=name)
        yield from said(f"{name}.response", mirror.response(u, STEP_S))
        yield from said(f"{name}.frequency response", mirror.frequency_response(freq))
    for path in sorted(Path().glob("*-mirror.toml")):
        try:
            mirror = microrad.read_mirror(path)
        except microrad.MicroradError as error:
            yield f"{path}: {error}"
            continue
        yield from said(str(path), mirror)
        drives = np.column_stack([u, *(np.roll(0.7 * u, 31 * (i + 1)) for i in range(mirror.actuators - 1))])
        yield from said(f"{path}.response", mirror.response(drives, STEP_S / 9))
        yield from said(f"{path}.frequency response", mirror.frequency_response(freq))
        yield from _of_one_axis(path) if mirror.actuators == 1 else _of_several(path, drives)
    bent = Mirror.of(PLAYS["bent"], name="bent")
    yield refused("drives of two", lambda: bent.response(np.ones((7, 2)), STEP_S))
    yield refused("step below 0", lambda: bent.response(u, -STEP_S))
    yield refused("frequencies of no number", lambda: bent.frequency_response([1.0, math.nan]))
    yield refused("unstable", lambda: Mirror.of(1e-6, denominator=[1.0, -3.0, 1.0]))
    yield refused("more zeros than poles", lambda: Mirror.of(1e-6, numerator=[1.0, 3.0, 1.0]))
    yield refused("nothing behind", lambda: Mirror.of(1e-6, denominator=[0.0]))


def _of_one_axis(path: Path) -> Iterator[str]:
    table = load_mirror(path).mirror
    try:
        drawn = spread.drawn(table, 3, 23)
    except ValueError as error:
        yield f"{path}.drawn: {error}"
        return
    for i, (_, factors) in enumerate(drawn):
        yield from said(f"{path}.drawn.{i}", factors)
    yield from said(f"{path}.spread", spread.relative_spread(table))


def _of_several(path: Path, drives: np.ndarray[Any, Any]) -> Iterator[str]:
    mirror = coupled.of(load_coupled_mirror(path))
    for key in ("actuators", "outputs", "delay_s", "rate_hz", "steps_per_sample", "step_s", "excited_hz"):
        yield from said(f"{path}.{key}", getattr(mirror, key))
    yield from said(f"{path}.sampled", mirror.response(drives))
    try:
        yield from said(f"{path}.tilts", coupled.tilts_and_piston(mirror.outputs))
    except ValueError as error:
        yield f"{path}.tilts: {error}"
    yield from (f"{path}: {line}" for line in coupled.text(mirror, ["written again"]).splitlines())
    for i, drawn in enumerate(coupled.draws(mirror, 2, 29)):
        yield from said(f"{path}.drawn.{i}", drawn.mirror)


def found() -> Iterator[str]:
    """The mirror of several axes in `found.toml`, by what it does: three digits, as a search found it."""
    mirror = coupled.of(load_coupled_mirror("found.toml"))
    t = np.arange(400) / mirror.rate_hz
    waves = [0.3 * np.sin(2 * np.pi * 4.7 * t + i) + 0.1 * np.sin(2 * np.pi * 61.0 * t) for i in range(2)]
    for name, values in (
        ("response", mirror.response(np.column_stack(waves))),
        ("gain", np.abs(mirror.mirror.frequency_response([7.0, 90.0, 210.0]))),
    ):
        for at in np.ndindex(values.shape[1:]):
            row = DISTINCT.sub("", curve(values[(slice(None), *at)].tolist(), 3, 1e-3))
            yield f"{name}[:, {', '.join(map(str, at))}]: {row}"


# ---------------------------------------------------------------------------------------------------- linear responses
def table_of(freq: np.ndarray[Any, Any], delay_s: float) -> np.ndarray[Any, Any]:
    """A response of three outputs to two drives, shape (frequencies, 3, 2): three modes behind a delay."""
    s = 2j * np.pi * freq[:, None, None]
    modes = (
        (31.0, 0.9, [1.7, -0.4, 0.8], [1.1, 0.3]),
        (127.0, 0.06, [0.6, 1.3, -0.7], [-0.2, 0.9]),
        (410.0, 0.11, [-0.3, 0.5, 1.2], [0.7, -0.6]),
    )
    found = np.zeros((freq.size, 3, 2), dtype=complex)
    for frequency, damping, outputs, inputs in modes:
        w = 2 * np.pi * frequency
        found += np.outer(outputs, inputs) * w**2 / (s**2 + 2 * damping * w * s + w**2)
    return found * np.exp(-s * delay_s)


def scattered(table: np.ndarray[Any, Any], size: np.ndarray[Any, Any] | float, seed: int) -> np.ndarray[Any, Any]:
    """A table with noise of a standard deviation, that of the complex value."""
    rng = np.random.Generator(np.random.PCG64(seed))
    noise = rng.standard_normal(table.shape) + 1j * rng.standard_normal(table.shape)
    return table + size * noise / math.sqrt(2)


def _fit(name: str, fit: Any, freq: Sequence[float]) -> Iterator[str]:
    """A fit of a frequency response: all that is known of it but the system, whose states may turn."""
    yield f"{name}: {fit!r}"
    for key in ("order", "hold", "rate_hz", "reason", "errors_from", "chi_square", "variance", "strictly_proper"):
        yield from said(f"{name}.{key}", getattr(fit, key))
    for key in ("delay_s", "relative_rms_error", "band_hz", "warnings", "natural"):
        yield from said(f"{name}.{key}", getattr(fit, key))
    yield from said(f"{name}.scan", list(fit.scan))
    yield from said(f"{name}.response", fit.response(freq))
    for key, errors in zip(("gain", "phase"), fit.response_errors(freq), strict=True):
        yield from said(f"{name}.{key} errors", errors)
    yield from said(f"{name}.residual", np.abs(fit.residual))
    for key in ("delay_error_s", "edge_gain", "edge_gain_error"):
        if hasattr(fit.known, key):
            yield from said(f"{name}.{key}", getattr(fit.known, key))
    for key in ("poles_rad_s", "zeros_rad_s"):
        roots = getattr(fit, key)
        yield from said(f"{name}.{key}", np.sort_complex(roots[roots.imag >= 0]))


def frequency_responses() -> Iterator[str]:
    """Models of tables of a measured frequency response."""
    freq = np.geomspace(2.3, 910.0, 71)
    at = [0.9, 17.0, 121.0, 433.0]
    size = 0.004 * (1 + freq / 300)[:, None, None] * np.array([[1.0, 2.0], [0.7, 1.0], [1.5, 0.9]])
    table = scattered(table_of(freq, 0.0), size, 3)
    late = scattered(table_of(freq, 1.9e-4), size, 5)
    one, fit = table[:, 1, 1], microrad.fit_frequency_response
    yield from _fit("scan of one", fit(freq, one), at)
    yield from _fit("one", fit(freq, one, 4, standard_error=0.007, strictly_proper=True), at)
    yield from _fit("too low", fit(freq, one, 3, standard_error=0.007), at)
    yield from _fit("several", fit(freq, table, (4, 6, 7), standard_error=size), at)
    yield from _fit("late", fit(freq, late, 6, standard_error=size[:, :1, :1] + 0 * size, delay=True), at)
    yield from _fit("held", fit(freq, table[:, :, :1], 6, hold="zero-order", rate_hz=2900.0), at)
    yield from _fit("drawn straight", fit(freq, table[:, :2, 1:], 6, hold="first-order", rate_hz=2300.0), at)
    yield refused("shape", lambda: fit(freq, table[:-1]))
    yield refused("falling", lambda: fit(freq[::-1], one))
    yield refused("nan", lambda: fit(freq, np.where(freq > 800, np.nan, one)))
    yield refused("order 0", lambda: fit(freq, one, 0))
    yield refused("order too high", lambda: fit(freq[:9], one[:9], 12))
    yield refused("errors of 0", lambda: fit(freq, one, 4, standard_error=0.0))
    yield refused("hold without a rate", lambda: fit(freq, one, 4, hold="zero-order"))
    yield refused("beyond half the rate", lambda: fit(freq, one, 4, hold="zero-order", rate_hz=1500.0))


def measured() -> Iterator[str]:
    """Frequency responses measured from the files `chirp*.csv` and `lines*.csv`, without a model."""
    names = sorted(Path().glob("chirp*.csv")), sorted(Path().glob("lines*.csv"))
    channels: dict[str, Any] = {"inputs": ["u", "v"], "outputs": ["x", "y", "z"], "rate_hz": 1730.0}
    chirps = [microrad.read_recording(name, **channels, alone=False) for name in names[0]]
    lines = [microrad.read_recording(name, **channels, period_samples=360, alone=False) for name in names[1]]
    yield from said("chirps", microrad.measure_frequency_response(chirps, bands=41))
    yield from said("chirps in a band", microrad.measure_frequency_response(chirps, bands=17, band_hz=(11.0, 230.0)))
    periodic = microrad.measure_frequency_response(lines)
    yield from said("lines", periodic)
    yield from said("lines in a band", microrad.measure_frequency_response(lines, band_hz=(31.0, 170.0)))
    fit = microrad.fit_frequency_response(
        periodic.freq_hz,
        periodic.response,
        4,
        standard_error=periodic.standard_error,
        hold=periodic.hold,
        rate_hz=periodic.rate_hz,
    )
    yield from _fit("fit of lines", fit, [3.0, 71.0, 240.0])
    yield refused("both kinds", lambda: microrad.measure_frequency_response([*chirps, *lines]))
    yield refused("one of two", lambda: microrad.measure_frequency_response(lines[:1]))
    yield refused("no line there", lambda: microrad.measure_frequency_response(lines, band_hz=(0.01, 0.02)))


# --------------------------------------------------------------------------------------------------- fitted hysteresis
FORMS = {
    "uneven": ("bouc_wen", "bouc_wen_classical", "bouc_wen_asymmetric", "bouc_wen_creep", "prandtl_ishlinskii"),
    "widening": ("bouc_wen", "prandtl_ishlinskii_rate", "prandtl_ishlinskii_creep", "prandtl_ishlinskii_rate_creep"),
}
"""What is fitted to a recording of each of two models."""


def fitted() -> Iterator[str]:
    """Each form of hysteresis fitted to a recording of a model of another kind."""
    t = STEP_S * np.arange(800)
    u = 3.7 + 2.3 * np.sin(2 * np.pi * 3.1 * t + 0.4) * (0.5 + 0.6 * t) + 0.8 * np.sin(2 * np.pi * 8.3 * t)
    rng = np.random.Generator(np.random.PCG64(31))
    for kind, model in (("uneven", BOUC_WEN["uneven"]), ("widening", PLAYS["widening"])):
        y = model.response(u - u[0], STEP_S) + CREEP.response(u - u[0], STEP_S) + 2e-7 * rng.standard_normal(u.size)
        recording = microrad.recording_from_arrays(1e3 * np.round(u, 6), np.round(1e6 * y + 17.3, 5), 1 / STEP_S)
        for form in FORMS[kind]:
            fit = microrad.fit_hysteresis(recording, form, output_unit="urad", input_unit="mV", seed=5)
            yield from said(f"{form} to {kind}", fit, "admissible")
    yield refused("no such form", lambda: microrad.fit_hysteresis(recording, "preisach", output_unit="urad"))
    yield refused("no such unit", lambda: microrad.fit_hysteresis(recording, output_unit="um"))


def stiffness() -> Iterator[str]:
    """Hysteretic stiffness of one axis, from periodic drives in `spring*.csv`, after two steps of its search."""
    wanted: dict[str, Any] = {"inputs": "u", "outputs": "x", "rate_hz": 1730.0, "period_samples": 90}
    records = [microrad.read_recording(path, **wanted, alone=False) for path in sorted(Path().glob("spring*.csv"))]
    fit = fit_hysteretic_stiffness(records, order=2, iterations=2, options=StiffnessOptions(few_first=0))
    for key in (
        "rate_hz",
        "sub_steps",
        "order",
        "parameters",
        "redundant",
        "amplitudes",
        "classes",
        "iterations",
        "names",
    ):
        yield from said(key, getattr(fit, key))
    for key in (
        "error_rms",
        "start_error_rms",
        "costs",
    ):  # of a search that goes on, and is elsewhere on each processor
        yield f"{key}: {curve(np.asarray(getattr(fit, key)).tolist(), 3)}"


WORDS = {
    each.__name__: each
    for each in (findings, read, arrays, hysteresis, mirrors, found, frequency_responses, measured, fitted, stiffness)
}


if __name__ == "__main__":
    for line in WORDS[sys.argv[1]]():
        print(line)
