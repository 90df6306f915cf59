"""Which version of a mirror file a document holds, of one axis or of several, and the keys that do not belong to it."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from microrad.mission.toml import Document, shown

_VERSION = "version = 2 for a mirror of several axes, and no version for one axis"
_ONE_AXIS_KEYS = {
    "travel": "this line removed",
    "composition": "B, D, G and K in [matrices] in its place",
    **dict.fromkeys(("rate_limit", "bias", "drive_min", "drive_max"), "this line in the table of each actuator"),
    "linear": "the tables [modes] and [matrices] in its place",
    "bouc_wen": 'a table [hysteresis.1] with model = "bouc-wen" in its place',
    "prandtl_ishlinskii": 'a table [hysteresis.1] with model = "plays" in its place',
    "creep": "a real mode in [modes] for each of its lags",
    "comparison": "this table removed",
}
_SEVERAL_AXES_KEYS = ("actuators", "outputs", "recording", "modes", "matrices", "hysteresis")


def is_of_one_axis(document: Document, data: dict[str, Any]) -> bool:
    """Whether a mirror can be read as version 1; notes why not, and takes out the keys that it notes otherwise.

    Args:
        document: The document that holds the mirror.
        data: The keys of the mirror.
    """
    version, foreign = data.get("version"), [key for key in _SEVERAL_AXES_KEYS if key in data]
    if type(version) is int and version == 2:
        reason = f"holds a mirror of several axes{_sizes(data)}, and the paper's loop has one"
        advice = (
            "a mirror file of one axis here, and this one in the fine-pointing loop: fine_pointing.mirror_file; "
            "microrad design and microrad export take it by --mirror, too"
        )
        document.fault("mirror.version", "2", reason, advice)
        return False
    several = bool(foreign) and not _ONE_AXIS_KEYS.keys() & data.keys()
    if version is not None:
        document.fault("mirror.version", shown(version), "is no version of a mirror of one axis", _VERSION)
    elif several:
        reason = f"is missing, and {foreign[0]} is a key of version 2"
        document.fault("mirror.version", "", reason, "version = 2 in the first line")
    if several:
        return False
    for key in foreign:
        reason = "is a key of version 2, in a mirror of one axis"
        document.fault(
            f"mirror.{key}", shown(data[key]), reason, "this table removed, or version = 2 with its keys alone"
        )
    for key in ("version", *foreign):
        data.pop(key, None)
    return True


def is_of_several_axes(document: Document) -> bool:
    """Whether a mirror file can be read as version 2; notes why not, and takes out the keys that it notes otherwise."""
    data, several = document.data, [key for key in _SEVERAL_AXES_KEYS if key in document.data]
    version, foreign = data.get("version"), [key for key in _ONE_AXIS_KEYS if key in data]
    if version is None and foreign and not several:
        reason = f"is missing, and {foreign[0]} is a key of version 1: the file holds a mirror of one axis"
        document.fault(
            "mirror.version", "", reason, "a file of version 2; microrad.mission.file.load_mirror reads this one"
        )
        return False
    if version is None:
        document.fault("mirror.version", "", "is missing", "version = 2 in the first line")
    elif type(version) is not int or version != 2:
        document.fault("mirror.version", shown(version), "is no version of a mirror of several axes", _VERSION)
    for key in foreign:
        document.fault(
            f"mirror.{key}", shown(data.pop(key)), "is a key of version 1, in a file of version 2", _ONE_AXIS_KEYS[key]
        )
    data["version"] = 2
    return True


def _sizes(data: Mapping[str, Any]) -> str:
    """How many channels and states a mirror of several axes has; nothing where its data is not in order."""
    from microrad.mission.tables.coupled_mirror import CoupledMirror

    try:
        mirror = CoupledMirror.model_validate(data)
    except ValidationError:
        return ""
    return f" ({len(mirror.actuators)} actuators, {len(mirror.outputs)} outputs, {mirror.states} states)"
