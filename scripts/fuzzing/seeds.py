"""Good files, which bad ones are made of; what has fallen before, in tests/corpus/bad, is among them."""

import gzip
import io
import json
import math
import re
import sqlite3
import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import openpyxl
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_omm, export_tle

from budget_files import HEADING, LIST, ROWS, TABLE
from campaign_files import HEAD, LOOP, NOISE, POWER
from link_files import PATTERN, RECEIVERS, SKY, data_with, received_with, written
from microrad.mirror import coupled
from microrad.report.results.manifest import ENDING, OPENING
from preset_files import EXAMPLES, completed
from several_axes import three_actuators
from shipped import DEFAULT, SHIPPED, without_day, without_fine_pointing

ROOT = Path(__file__).resolve().parent.parent.parent
CORPUS = ROOT / "tests" / "corpus"
BAD = CORPUS / "bad"
N, RATE_HZ = 240, 1000.0
TIME_S = np.arange(N) / RATE_HZ
DRIVE = 6.0 + 6.0 * np.sin(2.0 * np.pi * 23.0 * TIME_S)
OUTPUT = 0.08 * np.sin(2.0 * np.pi * 23.0 * TIME_S - 0.1)
START = datetime(2026, 3, 20, 12)


def fallen(name: str) -> tuple[bytes, ...]:
    """What has fallen before of a format: the files of its folder in tests/corpus/bad, in their order."""
    return tuple(path.read_bytes() for path in sorted((BAD / name).glob("*")))


def by_files(name: str, make: Callable[[Path], None]) -> tuple[bytes, ...]:
    """What a function writes into a folder, file by file, and what has fallen before.

    Args:
        name: The format.
        make: Writes files into the folder that it is given.
    """
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder))
        made = [path.read_bytes() for path in sorted(Path(folder).iterdir())]
    return (*made, *fallen(name))


def of_texts(name: str, texts: Sequence[str]) -> tuple[bytes, ...]:
    """Texts as seeds, and what has fallen before.

    Args:
        name: The format.
        texts: Good ones.
    """
    return (*(each.encode("utf-8") for each in texts), *fallen(name))


# ------------------------------------------------------------------------------------------------------------ missions
@cache
def links() -> tuple[bytes, ...]:
    """Files on links: the presets with their unknown values given, each receiver, those of older versions."""

    def make(folder: Path) -> None:
        for name in EXAMPLES:
            completed(folder, name)
        for number, name in enumerate(RECEIVERS):
            written(folder, data_with(received_with(name)), f"receiver-{number}.toml")
        sky = received_with("counting ppm", background_power=None, background=SKY)
        written(folder, data_with(sky), "sky.toml")
        written(folder, data_with(PATTERN), "pattern.toml")

    old = [path.read_text(encoding="utf-8") for path in sorted(CORPUS.glob("[0-9]*/links/*.toml"))]
    return (*by_files("links", make), *(each.encode("utf-8") for each in old))


def _old(kind: str) -> tuple[str, ...]:
    """The files of a kind that older versions wrote or took."""
    return tuple(path.read_text(encoding="utf-8") for path in sorted(CORPUS.glob(f"[0-9]*/{kind}/*.toml")))


@cache
def missions() -> tuple[bytes, ...]:
    """Whole missions: those that are shipped, and those of older versions."""
    shipped = [path.read_text(encoding="utf-8") for path in (SHIPPED, DEFAULT)]
    less = without_fine_pointing(shipped[0]), without_day(shipped[0])
    moved = re.sub(r"# (\[fine_pointing\.misalignment\]\n)# (.*\n)# ", r"\1\2", shipped[1])
    return of_texts("missions", [*shipped, moved, *less, less[0] + TABLE, *_old("missions")])


@cache
def mirrors() -> tuple[bytes, ...]:
    """Mirror files of one axis and of several."""
    page = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
    several = coupled.text(three_actuators())
    return of_texts("mirrors", [*re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL), several, *_old("mirrors")])


@cache
def plans() -> tuple[bytes, ...]:
    """Plans of excitations: those that come with the package, and those of older versions."""
    folder = ROOT / "src" / "microrad" / "lab" / "plans"
    return of_texts("plans", [*(p.read_text(encoding="utf-8") for p in sorted(folder.glob("*.toml"))), *_old("plans")])


@cache
def campaigns() -> tuple[bytes, ...]:
    """Campaign files, beside `beside_campaigns`."""
    shipped = (ROOT / "src" / "microrad" / "mission" / "missions" / "campaign.toml").read_text(encoding="utf-8")
    texts = [re.sub(r'(?m)^mission = ".*"', 'mission = "leo-geo.toml"', shipped)]
    texts += [HEAD + LOOP + POWER, HEAD + LOOP + POWER + NOISE]
    return of_texts("campaigns", [*texts, *(t for t in _old("campaigns") if t.count("mission = "))])


@cache
def beside_campaigns() -> dict[str, bytes]:
    """The missions that campaign files name."""
    links = (CORPUS / "0.2.0" / "campaigns" / "links.toml").read_bytes()
    return {"mission.toml": SHIPPED.read_bytes(), "links.toml": links, "leo-geo.toml": DEFAULT.read_bytes()}


# ---------------------------------------------------------------------------------------------------------- recordings
@cache
def lists() -> tuple[bytes, ...]:
    """Lists of recordings, beside `beside_lists`."""
    texts = [
        """name = "fsm 3"
output = ["x", "y"]
output_unit = "um"
lever_arm = "50 mm"
positions = [["0 mm", "12 mm"], ["10 mm", "-6 mm"]]
signs = [[1, 0], [-1, 1]]

[recording.slow]
file = "both.csv"
input = ["ux", "uy"]
time = "t"

[recording.again]
file = "again.npz"
input = ["u[0]", "u[1]"]
output = ["y[0]", "y[1]"]
role = "validation"
period = 120
""",
        """input = "ux"
output = "x"
rate = "1 kHz"
accept = ["drift"]

[recording.first]
file = "both.csv"
to = "0.21 s"

[recording.second]
file = "both.csv"
from = "0.02 s"
role = "loops"
""",
        """[recording.whole]
file = "again.npz"
axes = ["samples", "channels"]
input = "u"
output = "y"
rate = "1000 Hz"
""",
    ]
    return of_texts("lists", texts)


@cache
def beside_lists() -> dict[str, bytes]:
    """The recordings that lists name."""
    other = 5.0 * np.cos(2.0 * np.pi * 37.0 * TIME_S)
    drives = np.column_stack((DRIVE, other))
    outputs = drives @ np.array([[1.0, -0.3], [0.2, 0.8]])
    table = np.column_stack((TIME_S, drives, outputs)).tolist()
    text = "t,ux,uy,x,y\n" + "".join(",".join(f"{each:.9g}" for each in row) + "\n" for row in table)
    archive = io.BytesIO()
    np.savez(archive, u=drives[::-1], y=outputs[::-1], fs=RATE_HZ)
    return {"both.csv": text.encode(), "again.npz": archive.getvalue()}


@cache
def sources() -> tuple[bytes, ...]:
    """Lists of error sources: all classes, a few of them, and three axes between semicolons."""
    rows = [HEADING, *ROWS]
    few = "\n".join(rows[:3])
    wide = "name;class;size;statistic;axes;x;y;z\na;constant;1 mrad;fixed;each;1;0;-1\n"
    return of_texts("sources", ["\n".join(rows), LIST, few, wide])


@cache
def workbooks() -> tuple[bytes, ...]:
    """The first of these as a workbook."""

    def make(folder: Path) -> None:
        book = openpyxl.Workbook()
        for line in (HEADING, *ROWS):
            book.active.append([cell or None for cell in line.split(",")])
        book.save(folder / "sources.xlsx")

    return by_files("workbooks", make)


@cache
def motions() -> tuple[bytes, ...]:
    """Recorded motions: with a time and a unit, with two axes, and without either."""
    rows = np.column_stack([TIME_S, 1e3 * OUTPUT, -OUTPUT])
    head, two = "time (s),x (urad)\n", "time (s),x (urad),y (mrad)\n"
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    one = head + "".join(f"{line.rpartition(',')[0]}\n" for line in lines)
    alone = "x\n" + "".join(f"{line.split(',')[1]}\n" for line in lines)
    return of_texts("motions", [one, two + "\n".join(lines) + "\n", alone])


@cache
def fades() -> tuple[bytes, ...]:
    """Series of received power: with and without a time, as ratios, in W and as levels."""
    levels = -6.0 + 6.0 * np.sin(2.0 * np.pi * 23.0 * TIME_S)
    texts = []
    for head, values in (("power", 10.0 ** (0.1 * levels)), ("power (W)", 1e-6 + 0.0 * levels), ("power (dB)", levels)):
        texts.append(f"{head}\n" + "".join(f"{each:.6g}\n" for each in values))
        rows = zip(TIME_S.tolist(), values.tolist(), strict=True)
        texts.append(f"time (s),{head}\n" + "".join(f"{t:.3f},{each:.6g}\n" for t, each in rows))
    return of_texts("fades", texts)


@cache
def csv() -> tuple[bytes, ...]:
    """Tables as text: with and without a header, a time column, units, remarks; other separators."""
    rows = list(zip(TIME_S.tolist(), DRIVE.tolist(), OUTPUT.tolist(), strict=True))
    plain = "\n".join(f"{t:.3f},{u:.6g},{y:.6g}" for t, u, y in rows)
    texts = [
        f"time,drive,output\n{plain}\n",
        f"# bench 3\ntime [s],drive [V],output [mrad]\n{plain}\n",
        f"time,drive,output\ns,V,mrad\n{plain}\n",
        "\n".join(f"{u:.6g};{y:.6g}" for _, u, y in rows),
        "Zeit\tStellspannung (V)\tWinkel (µrad)\n" + plain.replace(",", "\t"),
        "\n".join(f"{t:.3f} {u:.3f}   {y:.3e}" for t, u, y in rows),
        f'"t","u","y"\n{plain}\n'.replace(",", ", "),
        "\n".join(f"{t:.3f};{u:.6g};{y:.6g}".replace(".", ",") for t, u, y in rows),
    ]
    return of_texts("csv", texts)


def _lvm(x_columns: str, comma: bool, segments: int) -> str:
    head = ["LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    head += [f"Decimal_Separator\t{',' if comma else '.'}", "Multi_Headings\tYes", f"X_Columns\t{x_columns}"]
    text = "\n".join([*head, "Time_Pref\tAbsolute", "***End_of_Header***", "", ""])
    for part in np.array_split(np.arange(N), segments):
        clock = f"12:00:{TIME_S[part[0]]:010.7f}"
        names = "X_Value\tdrive\tX_Value\toutput" if x_columns == "Multi" else "X_Value\tdrive\toutput"
        tags = ["Channels\t2", f"Samples\t{part.size}\t{part.size}", "Date\t2026/01/01\t2026/01/01"]
        tags += [f"Time\t{clock}\t{clock}", "Y_Unit_Label\tVolts\tum", "X0\t0.0\t0.0", "Delta_X\t1.0E-3\t1.0E-3"]
        body = []
        for i in part:
            u, y, t = f"{DRIVE[i]:.6g}", f"{OUTPUT[i]:.6g}", f"{(i - part[0]) / RATE_HZ:.3f}"
            body.append("\t".join({"No": ["", u, y], "One": [t, u, y], "Multi": [t, u, t, y]}[x_columns]))
        block = "\n".join([*tags, "***End_of_Header***", names, *body]) + "\n\n"
        text += block.replace(".", ",") if comma else block
    return text.replace("\n", "\r\n")


@cache
def lvm() -> tuple[bytes, ...]:
    """LabVIEW measurement files."""
    kinds = (("No", False, 1), ("One", False, 1), ("Multi", True, 1), ("No", False, 3), ("One", True, 2))
    return of_texts("lvm", [_lvm(*kind) for kind in kinds])


@cache
def tdms() -> tuple[bytes, ...]:
    """LabVIEW TDMS files: plain, in segments, of another type, with a scale."""

    def make(folder: Path) -> None:
        scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", "NI_Scale[0]_Scale_Type": "Linear"}
        scale |= {"NI_Scale[0]_Linear_Slope": 2.0, "NI_Scale[0]_Linear_Y_Intercept": 1.0}
        scale |= {"NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF}
        begins = {"wf_start_time": np.datetime64("2026-01-01T00:00:00")}
        for name, parts, kind, more in (
            ("plain", 1, np.float64, {}),
            ("segments", 3, np.float64, begins),
            ("single", 1, np.float32, {"unit_string": "V"}),
            ("scaled", 1, np.float64, scale),
            ("words", 1, np.float64, {"NI_ChannelName": "ä", "wf_samples": N}),
        ):
            with TdmsWriter(folder / name) as file:
                for part in np.array_split(np.arange(N), parts):
                    properties = {"wf_increment": 1 / RATE_HZ, **more}
                    drive = ChannelObject("bench", "drive", DRIVE[part].astype(kind), properties)
                    output = ChannelObject("bench", "output", OUTPUT[part].astype(kind), properties)
                    file.write_segment([drive, output])

    return by_files("tdms", make)


@cache
def mat() -> tuple[bytes, ...]:
    """MATLAB files of version 5 to 7 with a recording: variables, a structure, cells, packed and not."""

    def make(folder: Path) -> None:
        both = np.column_stack((DRIVE, OUTPUT))
        savemat(folder / "a", {"drive": DRIVE, "output": OUTPUT, "fs": RATE_HZ, "note": "hello"})
        savemat(folder / "b", {"both": both.astype(np.float32), "dt": 1 / RATE_HZ}, do_compression=True)
        inner = {"drive": DRIVE, "output": OUTPUT, "dt": 1 / RATE_HZ, "in": {"t": TIME_S}}
        savemat(folder / "c", {"run": inner, "cells": np.array([1.0, "x"], dtype=object)})
        savemat(folder / "d", {"drive": (1000 * DRIVE).astype(np.int16), "output": OUTPUT}, do_compression=True)

    return by_files("mat", make)


def _hdf5(path: Path, userblock: int, **settings: object) -> None:
    with h5py.File(path, "w", userblock_size=userblock, **settings) as file:
        group = file.create_group("run")
        for name, values in (("drive", DRIVE), ("output", OUTPUT)):
            data = group.create_dataset(name, data=values, chunks=(64,), compression="gzip", shuffle=True)
            data.attrs["unit"] = "V"
        file["both"] = np.column_stack((DRIVE, OUTPUT)).T
        file["dt"] = 1 / RATE_HZ
        file.create_dataset("small", data=DRIVE.astype("f4"), chunks=(80,), compression="lzf", fletcher32=True)
        file["words"] = "hello"
    if userblock:
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


@cache
def hdf5() -> tuple[bytes, ...]:
    """HDF5 files, of the oldest and of a newer layout."""

    def make(folder: Path) -> None:
        _hdf5(folder / "a", 0)
        _hdf5(folder / "b", 0, libver="v110")

    return by_files("hdf5", make)


@cache
def mat73() -> tuple[bytes, ...]:
    """MATLAB files of version 7.3."""

    def make(folder: Path) -> None:
        _hdf5(folder / "a", 512)
        with h5py.File(folder / "b", "w", userblock_size=512) as file:
            for name, values in (("drive", DRIVE), ("output", OUTPUT), ("dt", 1 / RATE_HZ)):
                file[name] = np.atleast_2d(values).T
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
        with (folder / "b").open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")

    return by_files("mat73", make)


@cache
def npy() -> tuple[bytes, ...]:
    """Arrays of NumPy: of each order and of several types."""

    def make(folder: Path) -> None:
        both = np.column_stack((DRIVE, OUTPUT))
        np.save(folder / "a.npy", both)
        np.save(folder / "b.npy", np.asfortranarray(both.T.astype(">f4")))
        np.save(folder / "c.npy", (1000 * both).astype(np.int32))
        np.save(folder / "d.npy", np.stack((both, both)))

    return by_files("npy", make)


@cache
def npz() -> tuple[bytes, ...]:
    """Archives of NumPy, packed and not."""

    def make(folder: Path) -> None:
        np.savez(folder / "a.npz", drive=DRIVE, output=OUTPUT, fs=RATE_HZ)
        np.savez_compressed(folder / "b.npz", both=np.column_stack((DRIVE, OUTPUT)), dt=1 / RATE_HZ, note="hello")

    return by_files("npz", make)


@cache
def matrices() -> tuple[bytes, ...]:
    """MATLAB files of version 5 to 7 with linear systems: state space, zeros and poles, fractions; sampled and not."""

    def make(folder: Path) -> None:
        system = {
            "A": np.array([[0.0, 1.0, 0.0], [-4e6, -400.0, 0.0], [0.0, 0.0, -3e3]]),
            "B": np.array([[0.0], [4e6], [3e3]]),
            "C": np.array([[0.04, 0.0, 0.01]]),
            "D": np.zeros((1, 1)),
        }
        held = {"A": np.array([[0.5]]), "B": np.array([[1.0]]), "C": np.array([[0.02]]), "D": np.zeros((1, 1))}
        poles = np.array([[-200.0 + 2000.0j], [-200.0 - 2000.0j]])
        savemat(folder / "a", system)
        savemat(folder / "b", {"s": system, "Ts": 0.0}, do_compression=True)
        savemat(folder / "c", {"z": np.zeros((0, 1)), "p": poles, "k": 1.6e5})
        savemat(folder / "d", {"sys": {"num": np.array([[0.0, 0.0, 1.6e5]]), "den": np.array([[1.0, 400.0, 4.04e6]])}})
        savemat(folder / "e", {**held, "Ts": 1e-4})

    return by_files("matrices", make)


# -------------------------------------------------------------------------------------------------------------- orbits
def _satellite(number: int, inclination_deg: float, mean_motion_rev_day: float, eccentricity: float) -> Satrec:
    made, days = Satrec(), (START - datetime(1949, 12, 31)).total_seconds() / 86400.0
    motion = mean_motion_rev_day * 2.0 * math.pi / 1440.0
    angles = (eccentricity, 1.0, math.radians(inclination_deg), 2.0)
    made.sgp4init(WGS72, "i", number, days, 1e-5, 0.0, 0.0, *angles, motion, 3.0)
    made.classification, made.intldesg, made.ephtype, made.elnum, made.revnum = "U", "26001A", 0, 1, 1
    return made


_ORBITS = ((90001, 97.4, 15.2, 0.001), (90002, 0.1, 1.0027, 0.0003), (90003, 63.4, 2.006, 0.72))


@cache
def tle() -> tuple[bytes, ...]:
    """Two-line elements, with and without names, one and several satellites."""
    sets = ["\n".join(export_tle(_satellite(*each))) for each in _ORBITS]
    texts = [*sets, f"EXAMPLE 1\n{sets[0]}\n", "\n".join(f"0 NAME {n}\n{each}" for n, each in enumerate(sets))]
    return of_texts("tle", texts)


def _omm_xml(messages: Sequence[dict[str, object]]) -> str:
    bodies = "".join(
        '<omm id="CCSDS_OMM_VERS" version="2.0"><body><segment>'
        + "".join(f"<{key}>{value}</{key}>\n" for key, value in each.items())
        + "</segment></body></omm>\n"
        for each in messages
    )
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<ndm>{bodies}</ndm>\n'


@cache
def omm() -> tuple[bytes, ...]:
    """Mean-elements messages as keywords, XML, JSON and CSV."""
    found = [export_omm(_satellite(*each), f"EXAMPLE {n}") for n, each in enumerate(_ORBITS)]
    keywords = [
        "CCSDS_OMM_VERS = 2.0\nCOMMENT invented\n" + "".join(f"{key} = {value}\n" for key, value in each.items())
        for each in found
    ]
    table = ",".join(found[0]) + "\n" + "".join(",".join(map(str, each.values())) + "\n" for each in found)
    texts = [keywords[0], "\n".join(keywords), _omm_xml(found[:1]), _omm_xml(found), json.dumps(found, indent=1)]
    return of_texts("omm", [*texts, json.dumps(found[0]), table])


def _rows(count: int) -> list[tuple[str, list[float]]]:
    radius_m, rows = 7.0e6, []
    rate = math.sqrt(3.986004418e14 / radius_m**3)
    for n in range(count):
        turned, when = rate * 60.0 * n, (START + timedelta(seconds=60 * n)).isoformat()
        place = [radius_m * math.cos(turned), radius_m * math.sin(turned), 0.0]
        speed = [-rate * place[1], rate * place[0], 0.0]
        rows.append((when, [each / 1e3 for each in (*place, *speed)]))
    return rows


@cache
def oem() -> tuple[bytes, ...]:
    """Ephemeris messages as keywords and XML: frames, time systems, methods, covariances."""
    rows, head = _rows(24), "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-03-20T00:00:00\nORIGINATOR = TEST\n\n"

    def keys(frame: str = "TEME", system: str = "UTC", more: str = "") -> list[str]:
        pairs = {"OBJECT_NAME": "EXAMPLE 1", "OBJECT_ID": "2026-001A", "CENTER_NAME": "EARTH", "REF_FRAME": frame}
        pairs |= {"TIME_SYSTEM": system, "START_TIME": rows[0][0], "STOP_TIME": rows[-1][0]}
        return [f"{key} = {value}" for key, value in pairs.items()] + ([more] if more else [])

    def text(*given: str, more: str = "") -> str:
        body = "".join(f"{when} {' '.join(f'{each:.9f}' for each in values)}\n" for when, values in rows)
        return head + "META_START\n" + "\n".join(keys(*given)) + f"\nMETA_STOP\n{body}{more}"

    matrix = "\n".join(" ".join(["1.0e-6"] * n) for n in range(1, 7))
    covariance = f"COVARIANCE_START\nEPOCH = {rows[1][0]}\n{matrix}\nCOVARIANCE_STOP\n"
    metadata = "".join("<{0}>{1}</{0}>\n".format(*each.split(" = ")) for each in keys())
    names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
    states = "".join(
        f"<stateVector><EPOCH>{when}</EPOCH>"
        + "".join(f"<{name}>{value:.9f}</{name}>" for name, value in zip(names, values, strict=True))
        + "</stateVector>\n"
        for when, values in rows
    )
    xml = (
        f'<?xml version="1.0"?>\n<oem id="CCSDS_OEM_VERS" version="2.0"><header/><body><segment><metadata>\n{metadata}'
        f"</metadata><data>\n{states}</data></segment></body></oem>\n"
    )
    lagrange = "INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 5"
    texts = [text(), text("EME2000", "TAI", lagrange), text("ITRF2000", "GPS"), text(more=covariance), xml]
    return of_texts("oem", texts)


# ------------------------------------------------------------------------------------------------- what microrad wrote
@cache
def manifests() -> tuple[bytes, ...]:
    """Manifests of reports, as JSON; those of the pages are in `pages`."""
    old = (CORPUS / "0.1.0" / "reports" / "manifest.json").read_bytes()
    inside = [page.partition(OPENING)[2].partition(ENDING)[0].encode() for page in _pages()]
    return (old, *inside, *fallen("manifests"))


def _pages() -> list[str]:
    return [gzip.decompress(p.read_bytes()).decode() for p in sorted(CORPUS.glob("[0-9]*/reports/report.html.gz"))]


@cache
def pages() -> tuple[bytes, ...]:
    """Pages of reports, without what stands about their manifests."""
    around = [page.partition(OPENING) for page in _pages()]
    texts = ["<!doctype html>microrad study of" + o + r.partition(ENDING)[0] + ENDING + "</html>" for _, o, r in around]
    return of_texts("pages", texts)


@cache
def ledgers() -> tuple[bytes, ...]:
    """Ledgers of campaigns."""
    return (*(path.read_bytes() for path in sorted(CORPUS.glob("[0-9]*/ledgers/*.ledger"))), *fallen("ledgers"))


@cache
def records() -> tuple[tuple[str, bytes], ...]:
    """What stands in those ledgers, chunk by chunk: its kind and its bytes."""
    found: list[tuple[str, bytes]] = []
    for path in sorted(CORPUS.glob("[0-9]*/ledgers/*.ledger")):
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as connection:
            for kind, table in (("head", "head"), ("chunk", "chunks"), ("trace", "traces")):
                found += [(kind, row[0]) for row in connection.execute(f"SELECT payload FROM {table} LIMIT 4")]
    return tuple(found)
