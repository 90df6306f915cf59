"""Time and peak memory of reading and checking ten million samples of two channels, one fresh process per format.

python benchmarks/recording.py [samples]
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RATE_HZ = 50_000.0
FORMATS = ("csv", "lvm", "tdms", "mat", "v73.mat", "npy", "npz", "h5")


def signals(samples: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.Generator(np.random.Philox(1))
    phase = 2 * np.pi * 100 / RATE_HZ * np.arange(samples)
    return 6 + 6 * np.sin(phase), 0.5 * np.sin(phase - 0.1) + 1e-3 * rng.standard_normal(samples)


def write(path: Path, samples: int) -> None:
    drive, output = signals(samples)
    kind = path.name.partition(".")[2]
    if kind in ("csv", "lvm"):
        with path.open("w") as file:
            if kind == "lvm":
                file.write(
                    "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n\t\nChannels\t2\n"
                )
                steps = f"{1 / RATE_HZ}\t{1 / RATE_HZ}"
                file.write(f"Channels\t2\nDelta_X\t{steps}\n***End_of_Header***\t\t\nX_Value\tdrive\toutput\n")
            else:
                file.write("drive,output\n")
            row = "\t{:.6f}\t{:.6f}\n" if kind == "lvm" else "{:.6f},{:.6f}\n"
            file.writelines(row.format(u, y) for u, y in zip(drive.tolist(), output.tolist(), strict=True))
    elif kind == "tdms":
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(path) as file:
            for name, values in (("drive", drive), ("output", output)):
                file.write_segment([ChannelObject("bench", name, values, {"wf_increment": 1 / RATE_HZ})])
    elif kind == "mat":
        from scipy.io import savemat

        savemat(path, {"drive": drive, "output": output, "fs": RATE_HZ})
    elif kind in ("h5", "v73.mat"):
        import h5py

        matlab = kind == "v73.mat"
        with h5py.File(path, "w", userblock_size=512 if matlab else 0) as file:
            for name, values in (("drive", drive), ("output", output), ("fs", np.array([RATE_HZ]))):
                file[name] = values[None, :] if matlab else values
        if matlab:
            with path.open("r+b") as file:
                file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    elif kind == "npy":
        np.save(path, np.column_stack((drive, output)))
    else:
        np.savez(path, drive=drive, output=output, fs=RATE_HZ)


def measure(path: Path) -> None:
    from microrad.lab.recording import read_recording

    by_number = path.suffix == ".npy"
    stated = path.suffix not in (".npy", ".csv")
    began, busy = time.perf_counter(), time.process_time()
    read = read_recording(path, 0 if by_number else "drive", 1 if by_number else "output", None if stated else RATE_HZ)
    seconds, busy = time.perf_counter() - began, time.process_time() - busy
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    kind, size = path.name.partition(".")[2], path.stat().st_size / 1e6
    print(f"{kind:8} {size:8.0f} {read.samples:10d} {seconds:8.2f} {busy:8.2f} {peak:8.2f}")


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000
    print(f"{'format':8} {'MB':>8} {'samples':>10} {'s':>8} {'CPU s':>8} {'peak GB':>8}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for kind in FORMATS:
            path = Path(folder) / f"record.{kind}"
            write_here = [sys.executable, __file__, "--write", str(path), str(samples)]
            subprocess.run(write_here, check=True)
            subprocess.run([sys.executable, __file__, "--measure", str(path)], check=True)
            path.unlink()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--write"]:
        write(Path(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:2] == ["--measure"]:
        measure(Path(sys.argv[2]))
    else:
        main()
