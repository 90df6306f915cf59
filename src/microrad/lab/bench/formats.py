"""A recording as the file of a bench: CSV, LabVIEW text and TDMS, MATLAB 5 and 7.3, NumPy, HDF5.

Drives are in V, outputs in mrad, both named in the file where its format has a place for it.
"""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core.installing import advice
from microrad.lab.bench.play import BenchError
from microrad.lab.recording import Recording

Floats = NDArray[np.float64]

_ROWS = 1 << 16  # of text written at once
_NO_CLOCK = ("1904/01/01", "00:00:00")  # the virtual bench has none: LabVIEW's own epoch


def write_file(recording: Recording, form: str, folder: Path) -> Path:
    """Write a recording in one of `FORMATS` under its own name (its `path`), and return the file's path.

    Raises `BenchError` where the format's library is not installed.
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

    with h5py.File(path, "w", userblock_size=512) as file:
        arrays = {name: values[None, :] for name, _, values in _channels(recording)}
        scalars = {name: np.array([[float(value)]]) for name, value in _facts(recording).items()}
        for name, values in {**arrays, **scalars}.items():
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    text = b"MATLAB 7.3 MAT-file, Platform: microrad, HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        # text, no subsystem data, version 2.0, byte order
        file.write(text.ljust(116) + bytes(8) + b"\x00\x02" + b"IM")


def _write_npz(recording: Recording, path: Path) -> None:
    arrays: dict[str, Any] = {name: values for name, _, values in _channels(recording)}
    arrays.update({name: np.array(value) for name, value in _facts(recording).items()})
    np.savez(path, **arrays)


def _write_hdf5(recording: Recording, path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs.update(_facts(recording))
        for name, unit, values in _channels(recording):
            file.create_dataset(name, data=values).attrs["units"] = unit


_WRITERS: dict[str, tuple[str, Callable[[Recording, Path], None]]] = {
    "csv": (".csv", _write_csv),
    "lvm": (".lvm", _write_lvm),
    "tdms": (".tdms", _write_tdms),
    "mat": (".mat", _write_mat),
    "mat73": ("-v73.mat", _write_mat73),  # beside a version 5 of the same record
    "npz": (".npz", _write_npz),
    "hdf5": (".h5", _write_hdf5),
}
