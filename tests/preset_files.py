"""The shipped presets as link files: what has to be added to each before it can be read."""

from microrad.mission.fields import UNKNOWN
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.mission.toml import scan

NAMES = (
    *("click", "crosslink", "dsoc", "ground-downlink", "leo-hicali", "llcd", "oicets-artemis", "opals"),
    *("paper", "qpsk-crosslink", "sda-crosslink", "sentinel1-edrs", "spot4-artemis", "tbird"),
)


BODY = {"pointing.lines.body_pointing.error": '"300 urad"'}


LOSSES = {"communication.receive_optics_loss": '"3 dB"', "requirement.pointing_error": '"5 urad"'}


OWN = {"communication.strehl": "0.8", "communication.transmit_optics_loss": '"2 dB"'}


SENSITIVITY = {"communication.receiver_sensitivity": '"200 photon/bit"'}


ERROR = {"communication.pointing_error": '"2 urad"'}


HOLE = {"terminals.geo_obscuration": "0.3"}


SKY = {"channel.zenith_transmission": "0.9", "channel.elevation": '"40 deg"'}


COUNTER = {
    "communication.receiver.efficiency": "0.5",
    "communication.receiver.dark_count_rate": '"10000 1/s"',
    "communication.receiver.background_power": '"0 pW"',
    "communication.receiver.bit_error_ratio": "1e-6",
    "communication.receiver.code_gain": '"3 dB"',
    "communication.receiver.code_rate": "0.5",
}


EXAMPLES = {
    "paper": {},
    "ground-downlink": {},
    "dsoc": {
        **BODY,
        **LOSSES,
        **OWN,
        **ERROR,
        **HOLE,
        **SKY,
        **COUNTER,
        "communication.receiver.order": "64",
        "communication.receiver.bandwidth": '"2 GHz"',
    },
    "llcd": {
        **BODY,
        **LOSSES,
        **OWN,
        **ERROR,
        **HOLE,
        **SKY,
        **COUNTER,
        "communication.transmit_power": '"1 W"',
        "communication.receiver.order": "16",
        "communication.receiver.bandwidth": '"8 GHz"',
    },
    "qpsk-crosslink": {
        **BODY,
        **OWN,
        **ERROR,
        "communication.receive_optics_loss": '"3 dB"',
        "communication.implementation_loss": '"2 dB"',
        "communication.transmit_power": '"1 W"',
        "communication.receiver.efficiency": "0.5",
        "communication.receiver.code_gain": '"5 dB"',
        "communication.receiver.code_rate": "0.8",
        "communication.receiver.bandwidth": '"4 GHz"',
    },
    "sda-crosslink": {
        **BODY,
        **LOSSES,
        **ERROR,
        "communication.strehl": "0.8",
        "communication.implementation_loss": '"2 dB"',
        "terminals.leo_aperture": '"30 cm"',
        "terminals.geo_aperture": '"8 cm"',
        "communication.receiver.noise_figure": '"5 dB"',
        "communication.receiver.amplifier_gain": '"35 dB"',
        "communication.receiver.optical_bandwidth": '"20 GHz"',
        "communication.receiver.extinction_ratio": '"15 dB"',
        "communication.receiver.code_gain": '"5 dB"',
    },
    "crosslink": {},
    "oicets-artemis": {**LOSSES, **SENSITIVITY, **ERROR, **HOLE},
    "spot4-artemis": {
        **BODY,
        **LOSSES,
        **OWN,
        **SENSITIVITY,
        **ERROR,
        **HOLE,
        "communication.transmit_power": '"50 mW"',
        "communication.distance": '"40000 km"',
    },
    "sentinel1-edrs": {**BODY, **LOSSES, **OWN, **SENSITIVITY, **ERROR, **HOLE},
    "leo-hicali": {**BODY, **LOSSES, **OWN, **SENSITIVITY, **ERROR, **HOLE, "terminals.leo_aperture": '"8 cm"'},
    "tbird": {
        **BODY,
        **LOSSES,
        **OWN,
        **SENSITIVITY,
        **HOLE,
        "jitter.bandwidth": '"1 Hz"',
        "terminals.leo_aperture": '"2 cm"',
        "channel.zenith_transmission": "0.9",
        "channel.elevation": '"40 deg"',
        "communication.transmit_power": '"1 W"',
    },
    "opals": {
        **OWN,
        **SENSITIVITY,
        **ERROR,
        **HOLE,
        **LOSSES,
        "terminals.leo_aperture": '"2 mm"',
        "channel.zenith_transmission": "0.9",
        "channel.turbulence.ground_strength": "1.7e-14",
        "channel.turbulence.wind_rms": '"21 m/s"',
        "answer.pointing_error": '"50 urad"',
        "answer.receive_optics_loss": '"3 dB"',
        "answer.required_power": '"10 pW"',
    },
    "click": {
        **BODY,
        **LOSSES,
        **OWN,
        **SENSITIVITY,
        **ERROR,
        "terminals.leo_aperture": '"4 cm"',
        "terminals.geo_aperture": '"2 cm"',
        "beacon.pointing_error": '"1 mrad"',
        "beacon.transmit_optics_loss": '"1 dB"',
        "beacon.receive_optics_loss": '"1 dB"',
        "beacon.required_power": '"100 pW"',
    },
}


def statements(text):
    return [each for each in scan(text) if each.kind == "key"]


def as_file(folder, name, text):
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def completed(folder, name, **changes):
    """The file of a preset with its unknown values given, those in ``changes`` in place of the examples."""
    given = EXAMPLES[name] | {key.replace("__", "."): value for key, value in changes.items()}
    lines = preset_text(name).split("\n")
    for each in statements(preset_text(name)):
        if each.value == f'"{UNKNOWN}"':
            lines[each.line - 1] = f"{each.key.rpartition('.')[2]} = {given[each.key]}"
    return load_link(as_file(folder, name, "\n".join(lines)))
