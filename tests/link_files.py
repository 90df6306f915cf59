"""The paper's links as a file of their own, with keys given, replaced or taken out, and one receiver of each kind."""

import json
import tomllib
from copy import deepcopy

from microrad.mission.file import load_link
from microrad.mission.model import LinkMission
from microrad.mission.presets import preset_text

COMMON = {"bit_error_ratio": 1e-6, "code_gain": "5 dB", "code_rate": 0.8, "bandwidth": "4 GHz"}
COUNTER = {"detector": "photon-counting", "efficiency": 0.4, "dark_count_rate": "2000 1/s", "background_power": "1 pW"}
DIODE = {
    "efficiency": 0.8,
    "dark_current": "1 nA",
    "thermal_noise": "2 pA/sqrt(Hz)",
    "background_power": "10 pW",
    "extinction_ratio": "20 dB",
}
RECEIVERS = {
    "homodyne bpsk": {"modulation": "bpsk", "detector": "homodyne", "efficiency": 0.7},
    "heterodyne bpsk": {"modulation": "bpsk", "detector": "heterodyne", "efficiency": 0.7, "phase_error": "0.2 rad"},
    "homodyne qpsk": {"modulation": "qpsk", "detector": "homodyne", "efficiency": 0.7, "polarisations": 2},
    "heterodyne qpsk": {
        "modulation": "qpsk",
        "detector": "heterodyne",
        "efficiency": 0.7,
        "phase_error": "5 deg",
        "polarisations": 2,
    },
    "preamplified dpsk": {"modulation": "dpsk", "detector": "preamplified", "noise_figure": "4 dB"},
    "preamplified ook": {
        "modulation": "ook",
        "detector": "preamplified",
        "noise_figure": "4 dB",
        "optical_bandwidth": "20 GHz",
        "amplifier_gain": "35 dB",
        "extinction_ratio": "20 dB",
    },
    "counting ppm": {"modulation": "ppm", **COUNTER, "order": 16},
    "counting ook": {"modulation": "ook", **COUNTER, "extinction_ratio": "20 dB"},
    "pin ook": {"modulation": "ook", "detector": "pin", **DIODE},
    "apd ook": {"modulation": "ook", "detector": "apd", **DIODE, "avalanche_gain": 20, "ionisation_ratio": 0.2},
}
RECEIVERS = {name: COMMON | table for name, table in RECEIVERS.items()}
OPTIONAL = {"polarisations", "phase_error"}  # of receivers with an oscillator
SKY = {"spectral_radiance": "10 W/(m^2 sr um)", "field_of_view": "100 urad", "filter_bandwidth": "1 nm"}
FADING = """
[communication.fading]
series = "fades.csv"
unit = "linear"
normalised = "mean"
sampling = "100 us"
code = "ccsds-k7-1-2"
interleaving = "block"
interleaver = "5 ms"
bit_error_ratio = 1e-6
"""
GAUSSIAN = {"profile": "gaussian", "radius": "2 cm", "m_squared": 1.2}
PATTERN = {"conventions.pointing_loss": "pattern", "communication.beam": GAUSSIAN}


def received_with(name, **others):
    """Changes that put a receiver in place of the sensitivity; a value of None takes its key out."""
    table = {key: value for key, value in {**RECEIVERS[name], **others}.items() if value is not None}
    return {"communication.receiver_sensitivity": None, "communication.receiver": table}


def data_with(changes):
    """The tables of the paper's links with dotted keys given; None takes a key out."""
    whole = tomllib.loads(preset_text("paper"))
    data = {name: table for name, table in whole.items() if name in LinkMission.model_fields}
    for key in ("conventions.residual", "conventions.mirror_angle", "requirement.residual_statistic"):
        table, _, name = key.partition(".")
        del data[table][name]  # of the loop
    return with_keys(data, changes)


def with_keys(data, *changes):
    """The tables, with dotted keys given in them; None takes a key out."""
    for dotted, value in [item for each in changes for item in each.items()]:
        *tables, key = dotted.split(".")
        table = data
        for name in tables:
            table = table.setdefault(name, {})
        if value is None:
            table.pop(key, None)
        else:
            table[key] = deepcopy(value)
    return data


def written(folder, data, name="link.toml"):
    """Path of a file with these tables."""
    path = folder / name
    path.write_text("".join(f"{line}\n" for line in _lines(data, "")), encoding="utf-8")
    return path


def link_file(folder, *changes):
    """The paper's links with changes, read from a file."""
    merged = {}
    for each in changes:
        merged |= each
    return load_link(written(folder, data_with(merged)))


def _lines(table, name):
    inner = {key: value for key, value in table.items() if isinstance(value, dict)}
    yield from (f"{key} = {json.dumps(value)}" for key, value in table.items() if key not in inner)
    for key, value in inner.items():
        dotted = f"{name}.{key}" if name else key
        yield f"[{dotted}]"
        yield from _lines(value, dotted)
