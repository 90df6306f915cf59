"""Linear models as MATLAB files, JSON and objects of python-control, and back."""

import io
import json
import math
import re
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core import lti
from microrad.core.folder import write_whole
from microrad.core.installing import advice
from microrad.export.matrices_forms import Forms, LinearModel, Port, forms
from microrad.export.matrices_mat import Structure, load
from microrad.export.records import ExportError, Origin

FORMAT = "microrad linear models"
"""What a JSON text of models says that it is."""

_KEYWORDS = re.compile(
    "break|case|catch|classdef|continue|else|elseif|end|for|function|global|if|otherwise|parfor|persistent|return|spmd|"
    "switch|try|while"
)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
_Cells = Any  # an array of MATLAB's cells is one of Python objects


# -------------------------------------------------------------------------------------------------------------- MATLAB
def write_mat(models: Sequence[LinearModel], path: Path) -> None:
    """Write models to a MATLAB file of version 5, one structure each, whole or not at all; the same ones, same bytes.

    Fields: A B C D Ts (0: continuous), InputName InputUnit OutputName OutputUnit StateName StateUnit, L (anti-windup,
    empty without), z p k and num den (arrays of one input and output, else cells [output, input]) with the largest
    error of the response that they give and its frequency (zpkError zpkErrorHz, tfError tfErrorHz), tfCondition,
    zpkRefused and tfRefused (why a form is missing), meaning, Mission MissionSha256 Mirror. Raises ExportError for
    names that MATLAB does not take, the same name twice, and a file that cannot be written.
    """
    from scipy.io import savemat  # slow to import, not needed to show help

    _check_names(models)
    draft = io.BytesIO()
    savemat(draft, {each.name: _structure(each) for each in models}, format="5", oned_as="row")
    title = f"MATLAB 5.0 MAT-file, {FORMAT}, microrad {version('microrad')}".ljust(116)
    _write(path, title.encode("ascii") + draft.getvalue()[116:])  # without the date and platform of scipy's title


def _write(path: Path, data: bytes) -> None:
    try:
        write_whole(path, data)
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
    refusals = {"zpkRefused": _refusal(by_roots), "tfRefused": _refusal(by_powers)}
    fields: dict[str, Any] = {}
    if not isinstance(by_roots, str):
        fields |= {
            "z": _cells([[each.zeros[:, None] for each in row] for row in by_roots]),
            "p": _cells([[each.poles[:, None] for each in row] for row in by_roots]),
            "k": np.array([[each.gain for each in row] for row in by_roots]),
            "zpkError": np.array([[each.largest_error for each in row] for row in by_roots]),
            "zpkErrorHz": np.array([[each.at_hz for each in row] for row in by_roots]),
        }
    if not isinstance(by_powers, str):
        fields |= {
            "num": _cells([[each.numerator[None] for each in row] for row in by_powers]),
            "den": _cells([[each.denominator[None] for each in row] for row in by_powers]),
            "tfError": np.array([[each.largest_error for each in row] for row in by_powers]),
            "tfErrorHz": np.array([[each.at_hz for each in row] for row in by_powers]),
            "tfCondition": np.array([[each.condition for each in row] for row in by_powers]),
        }
    return fields | refusals


def _refusal(form: object) -> str:
    return form if isinstance(form, str) else ""


def _cells(rows: list[list[Any]]) -> _Cells:
    if len(rows) == len(rows[0]) == 1:
        return rows[0][0]
    found = np.empty((len(rows), len(rows[0])), dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = rows[place[0]][place[1]]
    return found


def read_mat(path: Path) -> tuple[LinearModel, ...]:
    """The models of a file that `write_mat` wrote, to the last bit, in its order.

    Their state spaces alone are read: zeros, poles and coefficients follow from them. Raises ExportError for a file
    that cannot be read, and for a variable that is no such model.
    """
    return tuple(_model(path, name, value) for name, value in load(path).items())


def _model(path: Path, name: str, value: Any) -> LinearModel:
    record = value.fields if isinstance(value, Structure) and value.size == 1 else {}
    wanted = ("A", "B", "C", "D", "Ts", "InputName", "OutputName", "StateName", "L", "meaning", "MissionSha256")
    missing = [key for key in wanted if key not in record]
    if missing:
        raise ExportError(
            f"{path}: variable {name!r} is no model that microrad wrote, it lacks {', '.join(missing)}; a linear "
            "mirror of another tool is imported instead"
        )
    try:
        A, B, C, D, L = (np.asarray(record[key], dtype=float, order="C") for key in ("A", "B", "C", "D", "L"))
        origin = Origin(*(_text(record.get(key)) for key in ("Mission", "MissionSha256", "Mirror")))
        return LinearModel(
            name=name,
            meaning=_text(record["meaning"]),
            system=lti.StateSpace(A, B, C, D),
            period_s=float(record["Ts"].item()),
            inputs=_ports(record, "Input"),
            outputs=_ports(record, "Output"),
            states=_ports(record, "State"),
            origin=origin if any((origin.mission, origin.mission_sha256, origin.mirror)) else None,
            anti_windup=L if L.size else None,
        )
    except (ValueError, TypeError, AttributeError, KeyError) as error:
        raise ExportError(f"{path}: variable {name!r} is damaged ({error}); export it again") from error


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and not value.size:
        return ""
    if not isinstance(value, str):
        raise TypeError("there is no text where text should be")
    return value


def _ports(record: Any, kind: str) -> tuple[Port, ...]:
    names, units = (record[f"{kind}{key}"].reshape(-1) for key in ("Name", "Unit"))
    return tuple(Port(_text(name), _text(unit)) for name, unit in zip(names, units, strict=True))


# ---------------------------------------------------------------------------------------------------------------- JSON
def json_text(models: Sequence[LinearModel]) -> str:
    """The models as JSON: matrices by row, complex numbers as [re, im], each float so that it reads back the same.

    Raises ExportError for a model with a number that is not finite.
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
    """The library python-control. Raises ExportError where it is not installed."""
    try:
        return import_module("control")  # slow to import, and an extra
    except ImportError as error:
        raise ExportError(
            "python-control is not installed, and its objects cannot be made or read without it: install it "
            f"{advice('control')}"
        ) from error


def to_control(model: LinearModel) -> Any:
    """The model as a `control.StateSpace` with its names and its sample time (0: continuous).

    Raises ExportError where python-control is not installed.
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


def from_control(system: Any) -> LinearModel:
    """A `control.StateSpace` as a model, its units and its origin not known.

    Raises ExportError for another kind of object, and for one without a sample time (dt None or True).
    """
    library = python_control()
    if not isinstance(system, library.StateSpace):
        raise ExportError(
            f"a {type(system).__name__} is no state space; make one of it (control.ss), or import a mirror from it"
        )
    return LinearModel(
        name=str(system.name),
        meaning=f"imported from python-control, {system.name}",
        system=lti.StateSpace(*(np.array(getattr(system, key), dtype=float) for key in "ABCD")),
        period_s=sample_time_s(system),
        inputs=_labels(system.input_labels),
        outputs=_labels(system.output_labels),
        states=_labels(system.state_labels),
        origin=None,
    )


def sample_time_s(system: Any) -> float:
    """The sample time of an object of python-control; ExportError where it is left open."""
    if system.dt is None or system.dt is True:
        raise ExportError(
            f"{system.name} has dt = {system.dt}: continuous, or sampled how fast? Give it dt = 0 or its period in s"
        )
    return float(system.dt)


def _labels(names: Sequence[str]) -> tuple[Port, ...]:
    return tuple(Port(str(name), "") for name in names)
