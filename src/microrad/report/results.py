"""The numbers of a study as files: netCDF with units, and a manifest that says what made them."""

import hashlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from microrad.study import Study
from microrad.tracking import Run

LIBRARIES = ("microrad", "numpy", "scipy", "numba", "xarray", "h5netcdf", "matplotlib", "pydantic")


def _variable(dims: tuple[str, ...], values: object, units: str, long_name: str) -> xr.Variable:
    return xr.Variable(dims, np.asarray(values), attrs={"units": units, "long_name": long_name})


def _trace(run: Run) -> xr.Dataset:
    t, c = run.trace, run.trace.counts
    data = {
        "reference": _variable(("time",), t.reference_rad[:, 0], "rad", "pointing reference"),
        "output": _variable(("time",), t.output_rad[:, 0], "rad", "mirror output at the line of sight"),
        "command": _variable(("time",), t.command_v[:, 0], "V", "controller output about the bias"),
        "drive": _variable(("time",), t.drive_v[:, 0], "V", "amplifier output over its gain, about the bias"),
    }
    attributes = {
        "mirror": run.mirror,
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
    return xr.Dataset(data, {"time": _variable(("time",), t.time_s, "s", "time")}, attributes)


def _map(study: Study) -> xr.Dataset:
    f = study.margin_map
    return xr.Dataset(
        {"margin": _variable(("data_rate", "pointing_error"), f.margin_db, "dB", "margin of the communication link")},
        {
            "data_rate": _variable(("data_rate",), f.data_rate_bit_s, "bit/s", "data rate"),
            "pointing_error": _variable(("pointing_error",), f.pointing_error_rad, "rad", "pointing error"),
        },
    )


def _loops(study: Study) -> dict[str, xr.Dataset]:
    bias = study.file.mission.mirror.bias_v
    return {
        f"hysteresis_loops/{loop.freq_hz:g}_hz": xr.Dataset(
            {
                "drive": _variable(("sample",), loop.drive_v + bias, "V", "drive"),
                "output": _variable(("sample",), loop.output_rad, "rad", "output about the bias"),
                "hysteresis": _variable(("sample",), loop.hysteresis_rad, "rad", "hysteresis h"),
            },
            attrs={"frequency_hz": loop.freq_hz, "width": loop.width, "rate_clamped_samples": loop.clamped},
        )
        for loop in study.loops
    }


def write_results(study: Study, path: Path) -> None:
    """results.nc: the margin map, the hysteresis loops and every trace, each variable with its unit."""
    groups = {"margin_map": _map(study), **_loops(study)}
    for run in study.runs:
        name = f"{run.mirror} {run.controller} {run.freq_hz:g}_hz".replace(" + ", "_").replace(" ", "_").lower()
        groups[f"tracking/{name}"] = _trace(run)
    tree = xr.DataTree.from_dict({f"/{name}": group for name, group in groups.items()})
    tree.attrs = {"title": study.file.mission.name, "mission_sha256": study.file.sha256}
    tree.to_netcdf(path, engine="h5netcdf")


def manifest(study: Study, folder: Path) -> dict[str, Any]:
    """What made the results: the mission's text and hash, versions, and a hash of each file written so far.

    A study draws no random number; there is no seed to keep.
    """
    mission: dict[str, Any] = {"file": study.file.path.name, "sha256": study.file.sha256, "text": study.file.text}
    files: Mapping[str, Any] = {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }
    mirror = study.file.mirror_file
    return {
        "mission": mission,
        "mirror": None if mirror is None else {"file": mirror.path.name, "sha256": mirror.sha256, "text": mirror.text},
        "versions": versions(),
        "machine": platform.machine(),
        "randomness": "none",
        "files_sha256": files,
    }


def write_manifest(study: Study, folder: Path, name: str) -> None:
    """The manifest, written last, so that its presence says that the folder is whole."""
    text = json.dumps(manifest(study, folder), indent=2, ensure_ascii=False)
    (folder / name).write_text(text + "\n", encoding="utf-8")


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that the numbers depend on."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}
