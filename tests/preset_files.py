"""The shipped presets as link files: what has to be added to each before it can be read."""

from microrad.mission.fields import UNKNOWN
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.mission.toml import scan

NAMES = ("click", "crosslink", "leo-hicali", "oicets-artemis", "paper", "sentinel1-edrs", "spot4-artemis", "tbird")


BODY = {"pointing.lines.body_pointing.error": '"300 urad"'}


LOSSES = {"communication.receive_optics_loss": '"3 dB"', "requirement.pointing_error": '"5 urad"'}


OWN = {"communication.strehl": "0.8", "communication.transmit_optics_loss": '"2 dB"'}


SENSITIVITY = {"communication.receiver_sensitivity": '"200 photon/bit"'}


ERROR = {"communication.pointing_error": '"2 urad"'}


HOLE = {"terminals.geo_obscuration": "0.3"}


EXAMPLES = {
    "paper": {},
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
        "communication.distance": '"800 km"',
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
