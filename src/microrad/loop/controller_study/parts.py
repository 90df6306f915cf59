"""What a loop is made of, part by part, so that each can be left out: the cases of an error budget."""

import math
from collections.abc import Callable
from dataclasses import replace

from microrad.loop.control import Drive
from microrad.loop.disturbance import NO_REFERENCE
from microrad.loop.pointing_loop.loop import PointingLoop, without_hysteresis

REFERENCE, MISALIGNMENT, OPTICAL_NOISE, GAUGE_NOISE = "reference", "misalignment", "optical sensor noise", "gauge noise"
QUANTISATION, LIMITS, HYSTERESIS, DELAY = "quantisation", "limits", "hysteresis", "computation delay"


def _without_reference(loop: PointingLoop) -> PointingLoop:
    return replace(loop, references=tuple(NO_REFERENCE for _ in loop.references))


def _without_misalignment(loop: PointingLoop) -> PointingLoop:
    return replace(loop, unknown=())


def _without_optical_noise(loop: PointingLoop) -> PointingLoop:
    return replace(loop, optical=replace(loop.optical, noise_rad=0.0))


def _without_gauge_noise(loop: PointingLoop) -> PointingLoop:
    return loop if loop.gauge is None else replace(loop, gauge=replace(loop.gauge, noise_rad=0.0))


def _without_quantisation(loop: PointingLoop) -> PointingLoop:
    gauge = None if loop.gauge is None else replace(loop.gauge, resolution_rad=0.0)
    drive = replace(loop.drive, drive_resolution_v=0.0)
    return replace(loop, drive=drive, optical=replace(loop.optical, resolution_rad=0.0), gauge=gauge)


def _without_limits(loop: PointingLoop) -> PointingLoop:
    d = loop.drive
    free = Drive(-math.inf, math.inf, d.bandwidth_hz, math.inf, d.drive_resolution_v, d.sensor_resolution_rad)
    seeing = replace(loop.optical, field_of_view_rad=math.inf)
    return replace(loop, drive=free, optical=seeing)


def _without_delay(loop: PointingLoop) -> PointingLoop:
    timing = replace(loop.timing, delay_steps=0)
    return replace(loop, timing=timing, optical=replace(loop.optical, delay_steps=0))


SWITCHES: dict[str, Callable[[PointingLoop], PointingLoop]] = {
    REFERENCE: _without_reference,
    MISALIGNMENT: _without_misalignment,
    OPTICAL_NOISE: _without_optical_noise,
    GAUGE_NOISE: _without_gauge_noise,
    QUANTISATION: _without_quantisation,
    LIMITS: _without_limits,
    HYSTERESIS: without_hysteresis,
    DELAY: _without_delay,
}
"""What leaves each part out, by its name; a disturbance goes by its own name (`without`)."""


def without(loop: PointingLoop, *names: str) -> PointingLoop:
    """The loop without the named parts or disturbances.

    Args:
        loop: The loop.
        names: Keys of `SWITCHES`, or names of the loop's disturbances.

    Raises:
        ValueError: For a name that the loop does not have.
    """
    known = {each.name for several in loop.disturbances for each in several}
    for name in names:
        if name in SWITCHES:
            loop = SWITCHES[name](loop)
        elif name in known:
            kept = tuple(tuple(d for d in several if d.name != name) for several in loop.disturbances)
            loop = replace(loop, disturbances=kept)
        else:
            raise ValueError(f"the loop has no part {name!r}; it has {', '.join([*SWITCHES, *sorted(known)])}")
    return loop


def sources(loop: PointingLoop) -> tuple[str, ...]:
    """What brings error into the loop by itself: its disturbances, noises, misalignment and reference.

    Quantisation is none: in a loop at rest it does nothing.
    """
    names = dict.fromkeys(each.name for several in loop.disturbances for each in several)
    gauge = () if loop.gauge is None else (GAUGE_NOISE,)
    unknown = (MISALIGNMENT,) if loop.unknown else ()
    return (*names, OPTICAL_NOISE, *gauge, *unknown, REFERENCE)
