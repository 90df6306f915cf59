"""A linear mirror model of another tool, in a MATLAB file or an object of python-control, as the text of a mirror file.

What a linear model does not say is `Given`, never made up. The mirror file has its poles and zeros as natural
frequencies with damping ratios, which keep their digits, and its gain as one play operator without a threshold: no
hysteresis.
"""

import hashlib
import json
import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from microrad.core.folder import read_bytes
from microrad.core.lti import frequency_response
from microrad.export.linear_import.hold import without_hold
from microrad.export.linear_import.matlab import MOST_BYTES, select
from microrad.export.linear_import.roots import Roots, checked, response, roots_of_control, roots_of_fields
from microrad.export.records import ExportError
from microrad.mirror import model as mirror
from microrad.mission.tables.mirror import Mirror

READ_BACK = 1e-9
"""Largest relative difference of the mirror file's frequency response from the model's; one with more is refused."""
_POINTS = 200


@dataclass(frozen=True, slots=True)
class Given:
    """What a mirror file needs and a linear model does not say; ``output_unit`` is what the model's output counts in.

    The drive of the model is in volts at the amplifier's input, and counts from ``bias_v``. The model was identified
    from ``excited_from_hz`` to ``excited_to_hz``; its gain is taken at ``normalise_at_hz``, between them.
    """

    name: str
    travel_rad: float
    rate_limit_v_s: float
    bias_v: float
    drive_min_v: float
    drive_max_v: float
    excited_from_hz: float
    excited_to_hz: float
    normalise_at_hz: float
    output_unit: Literal["rad", "mrad", "urad"]


def import_mat(path: Path, given: Given, variable: str | None = None) -> str:
    """The text of a mirror file from a MATLAB file that has A B C D, z p k or num den, with Ts where it is sampled.

    They are variables of their own or fields of one structure. Where there are several forms, A B C D count. Of a
    sampled model the mirror is the continuous one that gives it when its drive is held over each sample.

    Args:
        path: The MATLAB file, version 5 to 7.
        given: What a linear model does not say.
        variable: Name of the structure, where the file has several.

    Raises:
        ExportError: What cannot be read, chosen or said in a mirror file, with the reason.
    """
    path = Path(path)
    chosen, found = select(path, variable)
    place = f"{path}, {chosen}" if chosen else str(path)
    said = f"{path.name}, {chosen}" if chosen else path.name
    digest = hashlib.sha256(read_bytes(path, MOST_BYTES)).hexdigest()
    return _text(lambda: roots_of_fields(found, place), given, place, (said, f"#   sha256 {digest}"))


def import_control(system: Any, given: Given, source: str = "python-control") -> str:
    """The text of a mirror file from an object of python-control.

    Args:
        system: A `control.StateSpace` or a `control.TransferFunction`.
        given: What a linear model does not say.
        source: What the file's comments and messages call the model.

    Raises:
        ExportError: What cannot be said in a mirror file, with the reason.
    """
    return _text(lambda: roots_of_control(system, source), given, source, (source,))


def _factored(make: Callable[[], Roots], given: Given, source: str) -> tuple[Roots, float]:
    """The continuous model, and the sample time of the one that it was made of; 0 where that was continuous."""
    try:
        with np.errstate(all="ignore"):  # the file's response is compared with the model's in the end
            made = make()
            if made.period_s:
                _check_band(given, made.period_s, source)
            return checked(without_hold(made, source) if made.period_s else made, source), made.period_s
    except ExportError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExportError(
            f"{source}: its numbers cannot be worked with ({error}); look for sizes that no mirror has, or save zeros, "
            "poles and gain"
        ) from error


# ---------------------------------------------------------------------------------------------------------------- text
def _text(make: Callable[[], Roots], given: Given, source: str, said_of: tuple[str, ...]) -> str:
    """``said_of`` is what the file's comments call the source, then further lines of its head."""
    model, period_s = _factored(make, given, source)
    _check_given(given, source)
    gain = _gain(model, given, source)
    said = "imported from " + "".join(c if c.isprintable() else " " for c in said_of[0])
    stated = "given on import, no linear model says it"
    lines = [
        f"# Mirror {said}: linear, without hysteresis or creep.",
        *said_of[1:],
        *([f"#   sampled there, Ts = {period_s!r} s; its drive counts as held over each sample"] if period_s else []),
        f"name = {_quoted(given.name)}",
        _line("travel", _quoted(f"{given.travel_rad!r} rad"), stated),
        _line("composition", '"cascade"', "the linear part behind a straight gain"),
        _line("rate_limit", _quoted(f"{given.rate_limit_v_s!r} V/s"), stated),
        _line("bias", _quoted(f"{given.bias_v!r} V"), stated),
        _line("drive_min", _quoted(f"{given.drive_min_v!r} V"), stated),
        _line("drive_max", _quoted(f"{given.drive_max_v!r} V"), stated),
        "",
        "[linear]",
        *_roots("pole", model.poles, said),
        *_roots("zero", model.zeros, said),
        _line(
            "normalise_at", _quoted(f"{given.normalise_at_hz!r} Hz"), "given on import: where the gain below is taken"
        ),
        _line("excited_from", _quoted(f"{given.excited_from_hz!r} Hz"), stated),
        _line("excited_to", _quoted(f"{given.excited_to_hz!r} Hz"), stated),
        "",
        "[prandtl_ishlinskii]",
        _line("thresholds", '["0 V"]', "no hysteresis: the linear model has none"),
        _line("weights", f'["{gain!r} {given.output_unit}/V"]', f"its size at normalise_at, {said}"),
    ]
    text = "\n".join(lines) + "\n"
    _check_read_back(text, model, given, source)
    return text


def _check_given(given: Given, source: str) -> None:
    if not given.name.strip():
        raise ExportError(f"{source}: the mirror has no name; give one, it stands in the mirror file and in the report")
    for field in fields(given):
        value = getattr(given, field.name)
        if field.name not in ("name", "output_unit") and not math.isfinite(value):
            raise ExportError(f"{source}: {field.name} = {value} is not finite; give a number")
    if given.output_unit not in ("rad", "mrad", "urad"):
        raise ExportError(f"{source}: output_unit = {given.output_unit!r} is none of rad, mrad, urad; give one of them")
    low, at, high = given.excited_from_hz, given.normalise_at_hz, given.excited_to_hz
    if low >= high:
        raise ExportError(f"{source}: the band begins at {low:g} Hz and ends at {high:g} Hz; give its lower end first")
    if not low <= at <= high:
        raise ExportError(
            f"{source}: the gain is taken at {at:g} Hz (normalise_at), which is not in the band of {low:g} Hz to "
            f"{high:g} Hz that the model was identified in; give a frequency inside it"
        )


def _check_band(given: Given, period_s: float, source: str) -> None:
    if given.excited_to_hz > 0.5 / period_s:
        raise ExportError(
            f"{source}: the band ends at {given.excited_to_hz:g} Hz, and a model that is sampled at Ts = {period_s:g} "
            f"s says nothing beyond {0.5 / period_s:g} Hz; give the band that it was identified in"
        )


def _gain(model: Roots, given: Given, source: str) -> float:
    """Size of the response where the mirror file divides it out; its sign is that of the real part there."""
    there = complex(response(model, np.array([given.normalise_at_hz]))[0])
    if not 0.0 < abs(there) < math.inf:
        raise ExportError(
            f"{source}: the model's response at normalise_at ({given.normalise_at_hz:g} Hz) is {there}, which cannot "
            "be divided out; normalise at another frequency"
        )
    if there.real < 0.0:
        raise ExportError(
            f"{source}: the output falls as the drive rises, the response at normalise_at "
            f"({given.normalise_at_hz:g} Hz) is {there:.4g}; a mirror file describes a mirror whose angle rises with "
            "its drive: turn the sign in the model, or normalise below the resonances if it is only their phase"
        )
    return abs(there)


def _roots(kind: str, roots: Any, said: str) -> list[str]:
    """Natural frequencies and damping ratios, rising; a pair stands once."""
    each = sorted((r for r in roots.tolist() if r.imag >= 0.0), key=lambda r: (abs(r), r.real))
    if not each:
        return []
    frequencies = ", ".join(_quoted(f"{abs(r) / (2.0 * math.pi)!r} Hz") for r in each)
    dampings = ", ".join(repr(-r.real / abs(r) + 0.0) for r in each)
    return [
        f"{kind}s = [{frequencies}] # {said}",
        f"{kind}_dampings = [{dampings}] # {said}; 1 is a real {kind}",
    ]


def _check_read_back(text: str, model: Roots, given: Given, source: str) -> None:
    """Raises ExportError if the file is refused as a mirror, or says something else than the model."""
    try:
        table = Mirror.model_validate(tomllib.loads(text))
        made = mirror.from_mission(
            table, mirror.hysteresis_model(table, table.rate_limit_v_s, table.bias_v)
        ).linear_loop
    except ValueError as error:
        raise ExportError(f"{source}: the mirror file would be refused: {_reasons(error)}") from error
    freq = np.geomspace(0.1 * given.excited_from_hz, 10.0 * given.excited_to_hz, _POINTS)
    scale = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6}[given.output_unit]
    with np.errstate(all="ignore"):
        difference = np.abs(frequency_response(made, freq)[:, 0, 0] / (scale * response(model, freq)) - 1.0)
    worst = int(np.argmax(difference))
    if not difference[worst] <= READ_BACK:
        raise ExportError(
            f"{source}: the mirror file would differ from the model by {difference[worst]:.2g} at {freq[worst]:.4g} Hz "
            f"(at most {READ_BACK:g} is let pass): poles that nearly coincide; reduce the model"
        )


def _reasons(error: ValueError) -> str:
    """What the mirror's table found, key by key."""
    from pydantic import ValidationError

    if not isinstance(error, ValidationError):
        return str(error)
    found = error.errors(include_url=False)
    return "; ".join(
        ": ".join(filter(None, (".".join(map(str, each["loc"])), each["msg"].removeprefix("Value error, "))))
        for each in found
    )


def _line(key: str, value: str, comment: str) -> str:
    return f"{key} = {value}".ljust(44) + f" # {comment}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
