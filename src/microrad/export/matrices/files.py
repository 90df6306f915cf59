"""Linear models as MATLAB files, as JSON and as objects of python-control."""

import io
import json
import math
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from microrad.core.folder import write_whole
from microrad.core.installing import advice
from microrad.export.matrices.forms import Forms, LinearModel, Port, forms
from microrad.export.records import ExportError, Origin

FORMAT = "microrad linear models"
"""What a JSON text of models says that it is."""

_KEYWORDS = re.compile(
    "break|case|catch|classdef|continue|else|elseif|end|for|function|global|if|otherwise|parfor|persistent|return|spmd|"
    "switch|try|while"
)
_Entries = Sequence[Sequence[Any]]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")


# -------------------------------------------------------------------------------------------------------------- MATLAB
def write_mat(models: Sequence[LinearModel], path: Path) -> None:
    """Write models to a MATLAB file of version 5, one structure each, whole or not at all; the same ones, same bytes.

    Fields: A B C D Ts (0: continuous), InputName InputUnit OutputName OutputUnit StateName StateUnit, L (anti-windup,
    empty without), z p k and num den (arrays of one input and output, else cells [output, input]) with the largest
    error of the response that they give and its frequency (zpkError zpkErrorHz, tfError tfErrorHz), tfCondition,
    zpkRefused and tfRefused (why a form is missing), meaning, Mission MissionSha256 Mirror.

    Args:
        models: What to write.
        path: The file.

    Raises:
        ExportError: A name that MATLAB does not take, the same name twice, or a file that cannot be written.
    """
    _check_names(models)
    draft = io.BytesIO()
    savemat(draft, {each.name: _structure(each) for each in models}, format="5", oned_as="row")
    title = f"MATLAB 5.0 MAT-file, {FORMAT}, microrad {version('microrad')}".ljust(116)
    try:
        write_whole(
            path, title.encode("ascii") + draft.getvalue()[116:]
        )  # without the date and platform of scipy's title
    except OSError as error:
        raise ExportError(f"{path} could not be written ({error.strerror or error}), so nothing is") from error


def _check_names(models: Sequence[LinearModel]) -> None:
    names = [each.name for each in models]
    for name in names:
        if not _NAME.fullmatch(name) or _KEYWORDS.fullmatch(name):
            raise ExportError(
                f"{name!r} is no name of a variable in MATLAB: a letter, then at most 30 letters, digits or _, and no "
                "keyword; rename the model"
            )
        if names.count(name) > 1:
            raise ExportError(f"two models are called {name!r}; rename one of them")


def _structure(model: LinearModel) -> dict[str, Any]:
    s, origin = model.system, model.origin or Origin("", "", "")
    return {
        **{key: getattr(s, key) for key in "ABCD"},
        "Ts": model.period_s,
        **_port_fields("Input", model.inputs),
        **_port_fields("Output", model.outputs),
        **_port_fields("State", model.states),
        "L": np.zeros((0, 0)) if model.anti_windup is None else model.anti_windup,
        **_form_fields(forms(model)),
        "meaning": model.meaning,
        "Mission": origin.mission,
        "MissionSha256": origin.mission_sha256,
        "Mirror": origin.mirror,
    }


def _port_fields(kind: str, ports: Sequence[Port]) -> dict[str, Any]:
    texts = {"Name": [p.name for p in ports], "Unit": [p.unit for p in ports]}
    return {f"{kind}{key}": np.array(each, dtype=object).reshape(-1, 1) for key, each in texts.items()}


def _form_fields(of: Forms) -> dict[str, Any]:
    """What MATLAB's zpk and tf take: arrays of one input and output, cells of several."""
    by_roots, by_powers = of.zero_pole_gain, of.transfer_function
    fields: dict[str, Any] = {}
    if not isinstance(by_roots, str):
        fields |= {
            "z": _cells(by_roots, lambda each: each.zeros[:, None]),
            "p": _cells(by_roots, lambda each: each.poles[:, None]),
            **_numbers(by_roots, {"k": "gain", "zpkError": "largest_error", "zpkErrorHz": "at_hz"}),
        }
    if not isinstance(by_powers, str):
        fields |= {
            "num": _cells(by_powers, lambda each: each.numerator[None]),
            "den": _cells(by_powers, lambda each: each.denominator[None]),
            **_numbers(by_powers, {"tfError": "largest_error", "tfErrorHz": "at_hz", "tfCondition": "condition"}),
        }
    refused = (("zpkRefused", by_roots), ("tfRefused", by_powers))
    return fields | {key: form if isinstance(form, str) else "" for key, form in refused}


def _numbers(rows: _Entries, names: dict[str, str]) -> dict[str, Any]:
    return {key: np.array([[getattr(each, name) for each in row] for row in rows]) for key, name in names.items()}


def _cells(rows: _Entries, of: Callable[[Any], Any]) -> Any:
    if len(rows) == len(rows[0]) == 1:
        return of(rows[0][0])
    found = np.empty((len(rows), len(rows[0])), dtype=object)
    for o, i in np.ndindex(found.shape):
        found[o, i] = of(rows[o][i])
    return found


# ---------------------------------------------------------------------------------------------------------------- JSON
def json_text(models: Sequence[LinearModel]) -> str:
    """The models as JSON: matrices by row, complex numbers as [re, im], each float so that it reads back the same.

    Raises:
        ExportError: For a model with a number that is not finite.
    """
    whole = {"format": FORMAT, "version": 1, "microrad": version("microrad"), "models": [_data(m) for m in models]}
    try:
        return json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    except ValueError as error:
        raise ExportError(
            f"one of the models {', '.join(m.name for m in models)} holds a number that is not finite ({error}); "
            "JSON has none, write a .mat file"
        ) from error


def _data(model: LinearModel) -> dict[str, Any]:
    s, origin, found = model.system, model.origin, forms(model)
    return {
        "name": model.name,
        "meaning": model.meaning,
        "mission": None if origin is None else origin.mission,
        "mission_sha256": None if origin is None else origin.mission_sha256,
        "mirror": None if origin is None else origin.mirror,
        "Ts_s": model.period_s,
        "inputs": [{"name": p.name, "unit": p.unit} for p in model.inputs],
        "outputs": [{"name": p.name, "unit": p.unit} for p in model.outputs],
        "states": [{"name": p.name, "unit": p.unit} for p in model.states],
        **{key: getattr(s, key).tolist() for key in "ABCD"},
        "anti_windup": None if model.anti_windup is None else model.anti_windup.tolist(),
        "zero_pole_gain": _form_data(found.zero_pole_gain),
        "transfer_function": _form_data(found.transfer_function),
    }


def _form_data(form: Any) -> dict[str, Any]:
    if isinstance(form, str):
        return {"refused": form}
    return {"entries": [[{key: _plain(getattr(e, key)) for key in e.__slots__} for e in row] for row in form]}


def _plain(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value if math.isfinite(value) else None  # an error without bound
    return [[z.real, z.imag] for z in value.tolist()] if np.iscomplexobj(value) else value.tolist()


# ------------------------------------------------------------------------------------------------------ python-control
def python_control() -> Any:
    """The library python-control.

    Raises:
        ExportError: Where it is not installed.
    """
    try:
        return import_module("control")
    except ImportError as error:
        raise ExportError(
            "python-control is not installed, and its objects cannot be made or read without it: install it "
            f"{advice('control')}"
        ) from error


def to_control(model: LinearModel) -> Any:
    """The model as a `control.StateSpace` with its names and its sample time (0: continuous).

    Raises:
        ExportError: Where python-control is not installed.
    """
    s = model.system
    return python_control().ss(
        *(getattr(s, key).copy() for key in "ABCD"),
        dt=model.period_s or 0,
        name=model.name,
        inputs=[p.name for p in model.inputs],
        outputs=[p.name for p in model.outputs],
        states=[p.name for p in model.states],
        remove_useless_states=False,
    )
