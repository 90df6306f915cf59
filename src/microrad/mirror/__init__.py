"""The mirror as one plant form: `of` takes a mission and assembles its mirror once, in each of its variants."""

from microrad.mirror.model import (
    Mirror,
    assemble,
    at_rest,
    combine,
    discretise,
    from_mission,
    from_table,
    hysteresis_model,
    respond,
    retimed,
    unrolled,
)
from microrad.mirror.reading import read_mirror
from microrad.mirror.variants import MirrorAxis, MirrorParts, Variant, of

__all__ = [
    "Mirror",
    "MirrorAxis",
    "MirrorParts",
    "Variant",
    "assemble",
    "at_rest",
    "combine",
    "discretise",
    "from_mission",
    "from_table",
    "hysteresis_model",
    "of",
    "read_mirror",
    "respond",
    "retimed",
    "unrolled",
]
