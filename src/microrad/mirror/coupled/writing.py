"""The text of a mirror file of version 2: numbers as they read back to the last bit, a matrix a row a line."""

import json
import math
from collections.abc import Iterator, Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.mirror.coupled.records import CoupledMirror, Known, modes
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mission.file import load_coupled_mirror
from microrad.mission.tables.coupled_mirror import MATRICES

_ON_A_LINE = 6  # items of a long list


def text(coupled: CoupledMirror, comments: Sequence[str] = ()) -> str:
    """Text of a mirror file of version 2, of which `of` makes a mirror of the same response to the last bit.

    What a feedforward inverts (`Mirror.inverse`) is no part of it.

    Args:
        coupled: The mirror.
        comments: Lines of a comment that the file begins with.

    Raises:
        MissionError: Where the file would be refused: numbers that are not finite, a mirror that runs away, parameters
            that it does not have.
    """
    lines = [
        *(f"# {_one_line(comment)}" for comment in comments),
        "# Matrices, weights and standard errors are plain numbers in SI units, drives and hysteresis in V.",
        "version = 2",
        f"name = {_quoted(coupled.mirror.name)}",
        "",
        *_channels(coupled),
        *_recording(coupled),
        *_modes(coupled.mirror),
        *_matrices(coupled.mirror),
        *_hysteresis(coupled.mirror),
        *(() if coupled.known is None else _uncertainty(coupled.known)),
    ]
    written = "\n".join(lines).rstrip("\n") + "\n"
    load_coupled_mirror("mirror.toml", text=written)
    return written


def _channels(coupled: CoupledMirror) -> Iterator[str]:
    for number, actuator in enumerate(coupled.actuators, 1):
        yield f"[actuators.{number}]"
        yield f"name = {_quoted(actuator.name)}"
        for key in ("bias", "drive_min", "drive_max"):
            yield f"{key} = {_quantity(getattr(actuator, f'{key}_v'), 'V')}"
        yield f"rate_limit = {_quantity(actuator.rate_limit_v_s, 'V/s')}"
        yield ""
    for number, output in enumerate(coupled.outputs, 1):
        yield f"[outputs.{number}]"
        yield f"name = {_quoted(output.name)}"
        yield f'quantity = "{output.quantity}"'
        if output.position_m is not None:
            yield f"position = [{', '.join(_quantity(place, 'm') for place in output.position_m)}]"
        yield ""


def _recording(coupled: CoupledMirror) -> Iterator[str]:
    yield "[recording]"
    yield f"delay = {_quantity(coupled.delay_s, 's')}"
    yield f"rate = {_quantity(coupled.rate_hz, 'Hz')}"
    yield f"steps_per_sample = {coupled.steps_per_sample}"
    yield f"excited_from = {_quantity(coupled.excited_hz[0], 'Hz')}"
    yield f"excited_to = {_quantity(coupled.excited_hz[1], 'Hz')}"
    yield ""


def _modes(mirror: Mirror) -> Iterator[str]:
    found = modes(mirror.A)
    if not found:
        return
    yield "[modes]"
    yield "decay = ["
    yield from (f"  {_quantity(-s, '1/s')}," for s, _ in found)
    yield "]"
    yield "frequency = ["
    for number, (s, w) in enumerate(found, 1):
        size = math.hypot(s, w)
        kind = f"{size / (2 * math.pi):.6g} Hz, " + (f"damping {-s / size:.4g}" if w else "real")
        yield f"  {_quantity(w, 'rad/s')},".ljust(36) + f" # mode {number}: {kind}"
    yield "]"
    yield ""


def _matrices(mirror: Mirror) -> Iterator[str]:
    yield "[matrices]"
    for name in MATRICES:
        matrix: Floats = getattr(mirror, name)
        if np.any(matrix):
            yield f"{name} = ["
            yield from _rows(matrix)
            yield "]"
    yield ""


def _hysteresis(mirror: Mirror) -> Iterator[str]:
    elements: list[BoucWen | PrandtlIshlinskii] = [*mirror.bouc_wen, *mirror.plays]
    for number, element in enumerate(elements, 1):
        yield f"[hysteresis.{number}]"
        yield from _play_lines(element) if isinstance(element, PrandtlIshlinskii) else _bouc_wen_lines(element)
        yield ""


def _play_lines(play: PrandtlIshlinskii) -> Iterator[str]:
    yield 'model = "plays"'
    yield f"thresholds = [{', '.join(_quantity(r, 'V') for r in play.thresholds_v)}]"
    yield f"weights = [{', '.join(_number(w) for w in play.weights_rad_v)}]"
    if play.widening_s:
        yield f"widening = {_quantity(play.widening_s, 's')}"
    if math.isfinite(play.rate_limit_v_s):
        yield f"rate_limit = {_quantity(play.rate_limit_v_s, 'V/s')}"
    if math.isfinite(play.reach_v):
        yield f"polynomial = [{', '.join(_number(c) for c in play.polynomial_rad)}]"
        yield f"reach = {_quantity(play.reach_v, 'V')}"


def _bouc_wen_lines(model: BoucWen) -> Iterator[str]:
    yield 'model = "bouc-wen"'
    yield f"d1 = {_number(model.d1_rad_v)}"
    yield f"epsilon = {_number(model.epsilon_rad_v)}"
    for key, value, unit in (("alpha", model.alpha_1_v, "1/V"), ("beta", model.beta_1_v, "1/V")):
        yield f"{key} = {_quantity(value, unit)}"
    for key, value, unit in (
        ("d2", model.d2_s_v, "s/V"),
        ("delta", model.delta_s_v, "s/V"),
        ("gamma", model.gamma_1_v, "1/V"),
        ("eta", model.eta_1_v, "1/V"),
        ("bias", model.bias_v, "V"),
    ):
        if value:
            yield f"{key} = {_quantity(value, unit)}"
    if model.exponent != 1.0:
        yield f"exponent = {_number(model.exponent)}"
    if math.isfinite(model.rate_limit_v_s):
        yield f"rate_limit = {_quantity(model.rate_limit_v_s, 'V/s')}"


def _uncertainty(known: Known) -> Iterator[str]:
    yield "[uncertainty]"
    for key, items in (
        ("parameters", [_quoted(name) for name in known.parameters]),
        ("standard_errors", [_number(error) for error in known.standard_errors]),
    ):
        yield f"{key} = ["
        yield from (f"  {', '.join(items[i : i + _ON_A_LINE])}," for i in range(0, len(items), _ON_A_LINE))
        yield "]"
    yield "factor = ["
    yield from _rows(known.factor)
    yield "]"


def _rows(matrix: Floats) -> Iterator[str]:
    return (f"  [{', '.join(map(_number, row))}]," for row in matrix.tolist())


def _number(value: float) -> str:
    return repr(float(value))


def _quantity(value: float, unit: str) -> str:
    return f'"{_number(value)} {unit}"'


def _quoted(words: str) -> str:
    return json.dumps(words, ensure_ascii=False).replace("\x7f", "\\u007f")


def _one_line(words: str) -> str:
    return "".join(c if c.isprintable() else " " for c in words)
