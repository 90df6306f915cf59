"""The numbers of a study as files: netCDF with units, and a manifest that says what made them."""

import contextlib
import hashlib
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.machine import machine, versions
from microrad.loop.fine_pointing import COUNTERS, FinePointingStudy, Residual
from microrad.loop.paper_cases import Run
from microrad.report import day_results, variables, words
from microrad.report.carried import hash_of_summary
from microrad.report.fine_pointing_data import margins, rms_by_source, sources
from microrad.report.paper_bench import PLAN, SEED
from microrad.report.variables import Group, Variable, coordinate, variable
from microrad.study.study import Study

MOST_INPUT_BYTES = 1_000_000
"""Length up to which a file that the mission names is carried in the manifest."""


def _trace(run: Run) -> Group:
    t, c = run.trace, run.trace.counts
    data = {
        "reference": variable(("time",), t.reference_rad[:, 0], "rad", "pointing reference"),
        "output": variable(("time",), t.output_rad[:, 0], "rad", "mirror output at the line of sight"),
        "command": variable(("time",), t.command_v[:, 0], "V", "controller output about the bias"),
        "drive": variable(("time",), t.drive_v[:, 0], "V", "amplifier output over its gain, about the bias"),
    }
    attributes = {
        "mirror": str(run.mirror),
        "controller": run.controller,
        "frequency_hz": run.freq_hz,
        "peak_error_rad": t.peak_rad,
        "rms_error_rad": t.rms_rad,
        "steady_from_sample": t.steady.start,
        "rate_clamped_steps": c.clamped,
        "rate_clamped_inverse_samples": c.inverse_clamped,
        "saturated_samples": c.saturated,
        "slew_limited_steps": c.slew_limited,
        "alternating_samples": c.alternating,
    }
    return Group(data, {"time": variable(("time",), t.time_s, "s", "time")}, attributes)


def _map(study: Study) -> Group:
    f = study.margin_map
    return Group(
        {"margin": variable(("data_rate", "pointing_error"), f.margin_db, "dB", "margin of the communication link")},
        {
            "data_rate": variable(("data_rate",), f.data_rate_bit_s, "bit/s", "data rate"),
            "pointing_error": variable(("pointing_error",), f.pointing_error_rad, "rad", "pointing error"),
        },
    )


def _loops(study: Study) -> dict[str, Group]:
    bias = study.file.mission.mirror.bias_v
    return {
        f"hysteresis_loops/{loop.freq_hz:g}_hz": Group(
            {
                "drive": variable(("sample",), loop.drive_v + bias, "V", "drive"),
                "output": variable(("sample",), loop.output_rad, "rad", "output about the bias"),
                "hysteresis": variable(("sample",), loop.hysteresis_rad, "rad", "hysteresis h"),
            },
            attributes={"frequency_hz": loop.freq_hz, "width": loop.width, "rate_clamped_samples": loop.clamped},
        )
        for loop in study.loops
    }


def _fine_pointing(fine: FinePointingStudy) -> dict[str, Group]:
    """Spectra, residuals, theory by source, margins, error budget and sines of the fine-pointing loop."""
    groups = {
        "spectra": _spectra(fine),
        "residuals": _residuals(fine),
        "theory": _theory(fine),
        "margins": _loop_margins(fine),
        "error_budget": _error_budget(fine),
        "sines": _sines(fine),
    }
    return {f"fine_pointing/{name}": group for name, group in groups.items()}


def _controllers(fine: FinePointingStudy) -> dict[str, Variable]:
    return coordinate("controller", [v.design.name for v in fine.verified], "controller")


def _spectra(fine: FinePointingStudy) -> Group:
    dims, unit = ("controller", "frequency", "axis"), "rad^2/Hz"
    after = np.stack([v.spectrum_rad2_hz for v in fine.verified])
    predicted = np.stack([v.predicted_rad2_hz for v in fine.verified])
    before = "one-sided spectrum of the disturbances of an axis before the loop, lines left out"
    data = {
        "before": variable(("frequency",), fine.disturbed_rad2_hz, unit, before),
        "residual": variable(dims, after, unit, "one-sided spectrum of the simulated residual, mission's mirror"),
        "predicted": variable(dims, predicted, unit, "one-sided spectrum of the residual in linear theory"),
    }
    freq = {"frequency": variable(("frequency",), fine.freq_hz, "Hz", "frequency")}
    axes = coordinate("axis", _axes(fine), "axis of the line of sight")
    return Group(data, {**_controllers(fine), **freq, **axes})


def _axes(fine: FinePointingStudy) -> tuple[str, ...]:
    return ("x", "y")[: fine.scene.loop.axes]


def _residuals(fine: FinePointingStudy) -> Group:
    variants = tuple(dict.fromkeys(name for v in fine.verified for name in v.simulated))
    limits = tuple(COUNTERS)
    table = [[v.simulated.get(name) for name in variants] for v in fine.verified]

    def gathered(pick: Callable[[Residual], Any], missing: Any = math.nan) -> Floats:
        return np.array([[missing if r is None else pick(r) for r in row] for row in table], dtype=float)

    dims, no_axes = ("controller", "mirror"), [math.nan] * fine.scene.loop.axes
    shares = gathered(lambda r: [r.shares.get(name, 0.0) for name in limits], [math.nan] * len(limits))
    axis_rms = gathered(lambda r: r.axis_rms_rad, no_axes)
    at = f"radial error that {fine.quantile:g} of the time stays below"
    interval = "half width of the 99 % interval of the radial rms over the runs"
    data = {
        "rms": variable(dims, gathered(lambda r: r.rms_rad), "rad", "radial rms"),
        "rms_interval": variable(dims, gathered(lambda r: r.rms_interval_rad), "rad", interval),
        "axis_rms": variable((*dims, "axis"), axis_rms, "rad", "rms by axis"),
        "quantile": variable(dims, gathered(lambda r: r.quantile_rad), "rad", at),
        "largest": variable(dims, gathered(lambda r: r.largest_rad), "rad", "largest radial error"),
        "share": variable((*dims, "limit"), shares, "1", "share of samples or plant steps at which a limit was met"),
    }
    names = {**_controllers(fine), **coordinate("mirror", variants, "variant of the mirror")}
    names |= coordinate("axis", _axes(fine), "axis of the line of sight") | coordinate("limit", limits, "limit")
    return Group(data, names, {"quantile": fine.quantile, "best": fine.best.design.name})


def _theory(fine: FinePointingStudy) -> Group:
    names = sources(fine.verified)
    parts = [rms_by_source(v) for v in fine.verified]
    by_source = np.array([[part.get(name, math.nan) for name in names] for part in parts])
    total = np.array([v.theory.radial_rms_rad for v in fine.verified])
    data = {
        "rms_by_source": variable(("controller", "source"), by_source, "rad", "radial rms that one source leaves"),
        "rms": variable(("controller",), total, "rad", "radial rms of all sources"),
        "bound": variable((), fine.optimum_rad, "rad", "radial rms below which no linear controller comes"),
    }
    return Group(data, {**_controllers(fine), **coordinate("source", names, "source of error")})


_MARGINS = {
    "modulus": ("1", "modulus margin, min |1 + L|"),
    "gain_up_db": ("dB", "gain margin upwards"),
    "phase_rad": ("rad", "phase margin"),
    "delay_s": ("s", "delay margin"),
    "disk": ("1", "symmetric disk margin, 2 / max |S - T|"),
    "bandwidth_hz": ("Hz", "lowest frequency with |S| = 1"),
    "crossover_hz": ("Hz", "highest frequency with |L| = 1"),
}


def _loop_margins(fine: FinePointingStudy) -> Group:
    found = [margins(v.design) for v in fine.verified]
    data = {
        key: variable(("controller",), np.array([each[key] for each in found]), unit, long_name)
        for key, (unit, long_name) in _MARGINS.items()
    }
    return Group(data, _controllers(fine))


def _error_budget(fine: FinePointingStudy) -> Group:
    b = fine.budget
    alone, theory = ([getattr(p, key) for p in b.parts] for key in ("rms_rad", "theory_rad"))
    with_it, without = ([getattr(d, key) for d in b.differences] for key in ("with_rad", "without_rad"))
    data = {
        "rms": variable(("part",), alone, "rad", "radial rms of one part alone, simulated without hysteresis"),
        "theory": variable(("part",), theory, "rad", "radial rms of one part alone in linear theory"),
        "combined": variable((), b.combined_rad, "rad", "root sum square of the parts"),
        "together": variable((), b.together_rad, "rad", "radial rms of all parts together, without hysteresis"),
        "full": variable((), b.full_rad, "rad", "radial rms of the full loop"),
        "with": variable(("left_out",), with_it, "rad", "radial rms of the full loop"),
        "without": variable(("left_out",), without, "rad", "radial rms of the full loop but for what is left out"),
    }
    names = coordinate("part", [p.name for p in b.parts], "part of the error")
    names |= coordinate("left_out", [d.name for d in b.differences], "part that is left out")
    return Group(data, names, {"controller": b.controller})


def _sines(fine: FinePointingStudy) -> Group:
    """One entry a run: not every controller need have run on every mirror."""
    s, run = fine.sines, ("run",)
    at = f"radial error that {fine.quantile:g} of the time stays below"
    data = {
        "controller": variable(run, np.array([each.controller for each in s], dtype=object), "1", "controller"),
        "mirror": variable(run, np.array([each.variant for each in s], dtype=object), "1", "variant of the mirror"),
        "frequency": variable(run, np.array([each.freq_hz for each in s]), "Hz", "frequency of the sine on axis x"),
        "rms": variable(run, np.array([each.rms_rad for each in s]), "rad", "radial rms"),
        "quantile": variable(run, np.array([each.quantile_rad for each in s]), "rad", at),
    }
    return Group(data)


def _performance(study: Study) -> Group:
    """The communication link under each simulated residual, one entry a case."""
    cases, dims = study.performance.cases, ("case",)
    half = "half angle at 1/e2 with the most power at the outage loss"
    quantities = {
        "mean_loss": ("dB", "loss of the mean power by pointing", [c.mean_loss_db for c in cases]),
        "outage_loss": (
            "dB",
            "pointing loss exceeded for the outage's share of time",
            [c.outage_loss_db for c in cases],
        ),
        "uncoded_penalty": (
            "dB",
            "power that the pointing error costs without a code; nan where the receiver's curve is not known",
            [c.uncoded_penalty_db for c in cases],
        ),
        "margin": ("dB", "margin at the outage loss", [c.margin_db for c in cases]),
        "outage": ("1", "share of the time with a margin below 0 dB", [c.outage for c in cases]),
        "below_required": ("1", "share of the time below the required margin", [c.short for c in cases]),
        "data_rate": ("bit/s", "data rate with the required margin there", [c.data_rate_bit_s for c in cases]),
        "best_half_angle": ("rad", half, [c.best.half_angle_rad for c in cases]),
    }
    data = {
        name: variable(dims, np.array([getattr(c, name) for c in cases], dtype=object), "1", what)
        for name, what in (
            ("source", "pointing error"),
            ("controller", "controller"),
            ("mirror", "variant of the mirror"),
        )
    }
    data |= {name: variable(dims, np.array(values), unit, what) for name, (unit, what, values) in quantities.items()}
    return Group(data, attributes={"outage": study.performance.outage})


def netcdf(study: Study) -> bytes:
    """The content of results.nc.

    It has margin map, hysteresis loops, traces, fine-pointing loop and the day; each variable with its unit.
    """
    groups = {"margin_map": _map(study), "link_performance": _performance(study), **_loops(study)}
    for run in study.runs:
        name = f"{run.mirror} {run.controller} {run.freq_hz:g}_hz".replace(" + ", "_").replace(" ", "_").lower()
        groups[f"tracking/{name}"] = _trace(run)
    if study.fine_pointing is not None:
        groups |= _fine_pointing(study.fine_pointing)
    if study.day is not None:
        groups |= day_results.groups(study.day, study.contact, study.plan)
    return variables.netcdf(groups, {"title": study.file.mission.name, "mission_sha256": study.file.sha256})


def manifest(study: Study, folder: Path) -> dict[str, Any]:
    """What made the results, with the numbers of the summary and a hash of each file written so far.

    The mission's text and hash and those of the files that it names, as they were read, and versions. Random numbers
    are drawn for the fine-pointing loop, for acquisition and for the day, from the mission's seeds, and for Fig. 4 and
    5.
    """
    mirror, m = study.file.mirror_file, study.file.mission
    drawn = [
        f"seed {table.seed} of [{name}], {table.runs} runs"
        for name, table in (
            ("fine_pointing", m.fine_pointing),
            ("acquisition", m.acquisition),
            ("operations", m.operations),
        )
        if table is not None
    ]
    summary = finite(words.summary(study))
    named = {each.name: each.content for each in study.file.contents if each.content is not None}
    drawn += [f"seed {SEED} of the virtual bench, {PLAN}"] if study.scan is not None else []
    return {
        "mission": _text_file(study.file.path, study.file.sha256, study.file.text),
        "inputs_sha256": {name: hashlib.sha256(content).hexdigest() for name, content in named.items()},
        "inputs": _input_texts(named),
        "mirror": None if mirror is None else _text_file(mirror.path, mirror.sha256, mirror.text),
        "versions": versions(),
        "machine": machine(),
        "randomness": "; ".join(drawn) or "none",
        "files_sha256": _hashes(folder),
        "summary": summary,
        "summary_sha256": hash_of_summary(summary),
    }


def _text_file(path: Path, sha256: str, text: str) -> dict[str, str]:
    """Name, text and hashes of a file: its bytes', and its text's, whose line ends and mark at the begin may differ."""
    text_sha256 = hashlib.sha256(text.encode()).hexdigest()
    return {"file": path.name, "sha256": sha256, "text_sha256": text_sha256, "text": text}


def _input_texts(named: Mapping[str, bytes]) -> dict[str, str]:
    """The text of each file that the mission names, but for those too long to be carried along."""
    found = {}
    for name, content in named.items():
        if len(content) <= MOST_INPUT_BYTES:
            with contextlib.suppress(UnicodeDecodeError):  # no text: left to its hash
                found[name] = content.decode("utf-8")
    return found


def finite(data: Any) -> Any:
    """Plain data with null for what is no finite number, which JSON cannot say."""
    if isinstance(data, Mapping):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _hashes(folder: Path) -> dict[str, str]:
    """The hash of each file by its place in the folder."""
    return {str(p.relative_to(folder)): _sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def write_manifest(made: Mapping[str, Any], folder: Path, name: str) -> None:
    """A manifest with the hashes of all files, written last, so that its presence says that the folder is whole."""
    text = json.dumps({**made, "files_sha256": _hashes(folder)}, indent=2, ensure_ascii=False)
    (folder / name).write_text(text + "\n", encoding="utf-8")
