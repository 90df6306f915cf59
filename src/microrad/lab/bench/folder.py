"""The folder of an experiment: a file for each record, the plan, and a manifest; whole or not at all."""

import hashlib
import io
import json
import math
import platform
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.folder import MANIFEST, read_bytes, whole_folder
from microrad.core.folder import check_folder as check
from microrad.core.installing import advice
from microrad.core.progress import Progress
from microrad.lab.bench.plan import MAT73, Plan, Record
from microrad.lab.bench.play import BenchError, play_records
from microrad.lab.recording import Recording, read_recording

_ROWS = 1 << 16  # of text written at once
_NO_CLOCK = ("1904/01/01", "00:00:00")  # the virtual bench has none: LabVIEW's own epoch


def write_file(recording: Recording, form: str, folder: Path) -> Path:
    """Write a recording under its own name (its `path`), and return the file's path.

    Args:
        recording: The recording.
        form: One of `FORMATS`.
        folder: Where the file goes.

    Raises:
        BenchError: If the format's library is not installed.
    """
    suffix, writer = _WRITERS[form]
    path = folder / f"{recording.path}{suffix}"
    writer(recording, path)
    return path


def _channels(recording: Recording) -> Iterator[tuple[str, str, Floats]]:
    """Name, unit and values of each channel, drives first."""
    for i, name in enumerate(recording.input_names):
        yield name, recording.input_units[i], np.ascontiguousarray(recording.drive[:, i])
    for i, name in enumerate(recording.output_names):
        yield name, recording.output_units[i], np.ascontiguousarray(recording.output[:, i])


def _facts(recording: Recording) -> dict[str, float | int]:
    """What a reader of bare arrays has to know."""
    facts: dict[str, float | int] = {"rate_hz": recording.rate_hz}
    return facts if recording.period_samples is None else {**facts, "period_samples": recording.period_samples}


# ----------------------------------------------------------------------------------------------------------------- text
def _rows(recording: Recording, separator: str) -> Iterator[str]:
    """Rows of time and channels; nine digits hold any code of a converter of up to 28 bits.

    The times are printed to a ten-thousandth of the sample period, so that their jitter is that of no clock.
    """
    columns = [values for _, _, values in _channels(recording)]
    decimals = max(4 + math.ceil(math.log10(recording.rate_hz)), 4)
    row = separator.join([f"%.{decimals}f", *(["%.9g"] * len(columns))])
    for start in range(0, recording.samples, _ROWS):
        stop = min(start + _ROWS, recording.samples)
        time_s = np.arange(start, stop) / recording.rate_hz
        table = np.stack([time_s, *(column[start:stop] for column in columns)], axis=1)
        yield "".join([f"{row % tuple(values)}\n" for values in table.tolist()])


def _write_csv(recording: Recording, path: Path) -> None:
    names, units, _ = zip(*_channels(recording), strict=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(["time", *names]) + "\n" + ",".join(["s", *units]) + "\n")
        file.writelines(_rows(recording, ","))


def _write_lvm(recording: Recording, path: Path) -> None:
    """Tags by National Instruments' specification of the LabVIEW measurement file, version 2."""
    names, units, _ = zip(*_channels(recording), strict=True)
    count = len(names)
    date, clock = _NO_CLOCK
    head = [
        ("LabVIEW Measurement", ""),
        ("Writer_Version", "2"),
        ("Reader_Version", "2"),
        ("Separator", "Tab"),
        ("Decimal_Separator", "."),
        ("Multi_Headings", "No"),
        ("X_Columns", "One"),
        ("Time_Pref", "Relative"),
        ("Date", date),
        ("Time", clock),
        ("***End_of_Header***", ""),
        ("", ""),
        ("Channels", str(count)),
        ("Samples", *[str(recording.samples)] * count),
        ("Date", *[date] * count),
        ("Time", *[clock] * count),
        ("Y_Unit_Label", *units),
        ("X_Dimension", *["Time"] * count),
        ("X0", *["0.0"] * count),
        ("Delta_X", *[f"{recording.step_s:.15g}"] * count),
        ("***End_of_Header***", ""),
        ("X_Value", *names),
    ]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines("\t".join(cells) + "\n" for cells in head)
        file.writelines(_rows(recording, "\t"))


# --------------------------------------------------------------------------------------------------------------- binary
def _write_tdms(recording: Recording, path: Path) -> None:
    try:
        from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
    except ImportError:
        raise BenchError(
            f"{path.name}: writing TDMS needs npTDMS, which is not installed: choose another of the plan's formats, or "
            f"install it {advice('lab')}"
        ) from None
    group = "bench"
    waveform = {
        "wf_start_offset": 0.0,
        "wf_increment": recording.step_s,
        "wf_samples": recording.samples,
        "wf_xname": "Time",
        "wf_xunit_string": "s",
    }
    channels = [
        ChannelObject(group, name, values, {**waveform, "unit_string": unit})
        for name, unit, values in _channels(recording)
    ]
    with TdmsWriter(str(path)) as writer:
        root = RootObject({"name": recording.path})
        writer.write_segment([root, GroupObject(group, _facts(recording)), *channels])


def _write_mat(recording: Recording, path: Path) -> None:
    from scipy.io import savemat

    arrays: dict[str, Any] = {name: values for name, _, values in _channels(recording)}
    savemat(path, {**arrays, **_facts(recording)}, appendmat=False, oned_as="column")


def _write_mat73(recording: Recording, path: Path) -> None:
    """HDF5 behind MATLAB's own block of 512 bytes; a column of MATLAB is a row here, because HDF5 counts by rows."""
    import h5py

    content = io.BytesIO()  # on a full disk HDF5 cannot close a file, and crashes at exit
    with h5py.File(content, "w", userblock_size=512) as file:
        arrays = {name: values[None, :] for name, _, values in _channels(recording)}
        scalars = {name: np.array([[float(value)]]) for name, value in _facts(recording).items()}
        for name, values in {**arrays, **scalars}.items():
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    text = b"MATLAB 7.3 MAT-file, Platform: microrad, HDF5 schema 1.00 ."
    content.seek(0)
    # text, no subsystem data, version 2.0, byte order
    content.write(text.ljust(116) + bytes(8) + b"\x00\x02" + b"IM")
    path.write_bytes(content.getbuffer())


def _write_npz(recording: Recording, path: Path) -> None:
    arrays: dict[str, Any] = {name: values for name, _, values in _channels(recording)}
    arrays.update({name: np.array(value) for name, value in _facts(recording).items()})
    np.savez(path, **arrays)


def _write_hdf5(recording: Recording, path: Path) -> None:
    import h5py

    content = io.BytesIO()  # as above
    with h5py.File(content, "w") as file:
        file.attrs.update(_facts(recording))
        for name, unit, values in _channels(recording):
            file.create_dataset(name, data=values).attrs["units"] = unit
    path.write_bytes(content.getbuffer())


_WRITERS: dict[str, tuple[str, Callable[[Recording, Path], None]]] = {
    "csv": (".csv", _write_csv),
    "lvm": (".lvm", _write_lvm),
    "tdms": (".tdms", _write_tdms),
    "mat": (".mat", _write_mat),
    "mat73": (f"{MAT73}.mat", _write_mat73),
    "npz": (".npz", _write_npz),
    "hdf5": (".h5", _write_hdf5),
}

PLAN = "plan.toml"
_MOST_MANIFEST = 16_000_000


def write_folder(
    plan: Plan, folder: str | Path, seed: int, overwrite: bool = False, on_progress: Progress | None = None
) -> tuple[Path, ...]:
    """Play a plan into a folder: the files of its records in the plan's formats, plan.toml and manifest.json.

    The manifest has seed, versions, and of each record its use (identification or validation), rate, period and files.
    The folder appears whole or not at all.

    Args:
        plan: The plan to play.
        folder: The folder to write.
        seed: Seed of the sensor's noise, 0 or more.
        overwrite: Whether a folder that a bench wrote may be replaced.
        on_progress: Called with the records done, their number and the name of the next one.

    Returns:
        The files of the records, in the order of the plan.

    Raises:
        FolderError: For a folder that is there already and must stay.
    """
    folder = Path(folder)
    entries: list[dict[str, Any]] = []
    with whole_folder(folder, overwrite, "plan", "recordings") as draft:
        for record, recording in play_records(plan, seed, on_progress):
            files = [write_file(recording, form, draft).name for form in plan.formats]
            entries.append(_entry(record, recording, files))
        (draft / PLAN).write_text(plan.text, encoding="utf-8", newline="\n")
        text = json.dumps(_manifest(plan, seed, entries, draft), indent=2, ensure_ascii=False)
        (draft / MANIFEST).write_text(text + "\n", encoding="utf-8")
    return tuple(folder / name for entry in entries for name in entry["files"])


def _entry(record: Record, recording: Recording, files: list[str]) -> dict[str, Any]:
    excitation = record.excitation
    return {
        "name": excitation.name,
        "kind": record.kind,
        "use": record.use,
        "truth": record.truth,
        "files": files,
        "inputs": list(recording.input_names),
        "outputs": list(recording.output_names),
        "rate_hz": recording.rate_hz,
        "samples": recording.samples,
        "period_samples": recording.period_samples,
        "rest_v": excitation.rest_v,
        "lines": list(excitation.lines),
        "step_samples": list(excitation.step_samples),
    }


def _manifest(plan: Plan, seed: int, entries: list[dict[str, Any]], draft: Path) -> dict[str, Any]:
    files = sorted(path for path in draft.iterdir() if path.is_file())
    libraries = ("microrad", "numpy", "scipy", "numba")
    return {
        "plan": {"name": plan.name, "file": PLAN, "source": plan.path.name, "sha256": plan.sha256},
        "seed": seed,
        "drive_unit": "V",
        "output_unit": "mrad",
        "records": entries,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in libraries}},
        "files_sha256": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files},
    }


def check_folder(folder: Path, overwrite: bool) -> None:
    """Check that a folder may be written.

    Args:
        folder: The folder to write.
        overwrite: Whether a folder that a bench wrote may be replaced.

    Raises:
        FolderError: If the folder holds something that must not be replaced.
    """
    check(folder, overwrite, "plan", "recordings")


def read_folder(folder: Path, accept: tuple[str, ...] = ()) -> tuple[tuple[Recording, str], ...]:
    """Recordings of a folder that `write_folder` made, each with its use ("identification" or "validation").

    Of several formats the first is read. Where there are several drives, each may rest while another one is played:
    `check_together` judges all recordings.

    Args:
        folder: The folder.
        accept: Findings of degree to take on, see `read_recording`.

    Raises:
        BenchError: For a folder without the manifest of a bench.
        RecordingError: For a file that cannot be read.
    """
    manifest = folder / MANIFEST
    try:
        entries = json.loads(read_bytes(manifest, _MOST_MANIFEST))["records"]
        wanted = [(folder / e["files"][0], e["inputs"], e["outputs"], e["period_samples"], e["use"]) for e in entries]
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        raise BenchError(
            f"{folder}: no {MANIFEST} of microrad bench in it; name the recordings themselves (--input, --output)"
        ) from None
    return tuple(
        (read_recording(path, inputs, outputs, period_samples=period, accept=accept, alone=False), use)
        for path, inputs, outputs, period, use in wanted
    )
