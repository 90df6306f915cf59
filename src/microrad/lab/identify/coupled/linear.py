"""Linear candidates: each output from one drive, and all of them from all, behind a common delay."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.coupled.linear_errors import LineSpectra, known, names, spread
from microrad.lab.identify.coupled.records import Kind
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.polish import FrequencyEquations, polish
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.stiffness.model import without_delay
from microrad.mirror.coupled import Known
from microrad.mirror.model import Mirror

STEPS = 2
"""Steps of the plant in each sample."""

_ROUNDS, _STEP = 8, 0.25  # of the search for the delay; its longest step, in samples
_SETTLED = 0.3  # of the delay's standard error: a step that ends the search


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model of the ladder before it is judged; the fields are those of `Candidate` and of its `CoupledMirror`.

    ``modes`` is a coupled linear model as modes, from which hysteretic stiffness may begin.
    """

    name: str
    kind: Kind
    order: int
    parameters: int
    mirror: Mirror
    delay_s: float
    poles_rad_s: Complexes
    poles_error_rad_s: Complexes
    delay_error_s: float
    known: Known | None
    modes: ModalModel | None = None
    note: str = ""


def coupled_linear(
    response: FrequencyResponse, order: int, delay_s: float, exchanges: int, spectra: LineSpectra | None
) -> Fitted:
    """A linear model of all outputs from all drives, and the delay in front of it.

    Args:
        response: The measured response.
        order: Number of states.
        delay_s: Delay to begin with, in s.
        exchanges: Largest number of modes exchanged for better ones, see `fit_order`.
        spectra: Spectra of the records of the response, see `linear_errors`.
    """
    behind = without_delay(response, delay_s, STEPS)
    model = fit_order(behind, order, exchanges=exchanges).model
    found = spread(model, behind, delay_s, spectra)
    for _ in range(_ROUNDS):
        step, most = float(found.step[-1]), _STEP / response.rate_hz
        if abs(step) < _SETTLED * float(np.linalg.norm(found.moved[:, -1])):
            break
        delay_s = max(delay_s + min(max(step, -most), most), 0.0)
        behind = without_delay(response, delay_s, STEPS)
        model = polish(_equations(behind), model, iterations=10).model
        found = spread(model, behind, delay_s, spectra)
    outputs, inputs = model.direct.shape
    return Fitted(
        name=f"coupled linear, order {order}",
        kind="coupled linear",
        order=model.order,
        parameters=model.order * (outputs + inputs) + outputs * inputs + 1,
        mirror=side_by_side([model]),
        delay_s=delay_s,
        poles_rad_s=model.poles_rad_s,
        poles_error_rad_s=_pole_errors(model, found.moved),
        delay_error_s=float(np.linalg.norm(found.moved[:, -1])),
        known=known(names(model, range(inputs), range(outputs)), found.moved),
        modes=model,
    )


def _equations(response: FrequencyResponse) -> FrequencyEquations:
    return FrequencyEquations(
        response.freq_hz, response.response, response.drive_power, response.hold, response.rate_hz
    )


def _pole_errors(model: ModalModel, moved: Floats) -> Complexes:
    """Standard errors of real and imaginary part of each pole."""
    modes, real = model.poles_rad_s.size, model.real_poles
    size = np.linalg.norm(moved, axis=0)
    errors = np.asarray(size[:modes], dtype=np.complex128)
    errors[real:] += 1j * size[modes : 2 * modes - real]
    return errors


def per_axis(response: FrequencyResponse, order: int, delay_s: float, spectra: LineSpectra | None) -> Fitted:
    """Each output from the one drive that moves it most, independently of the others.

    Args:
        response: The measured response.
        order: Number of states for each output.
        delay_s: The delay in front of all, in s.
        spectra: Spectra of the records of the response, see `linear_errors`.
    """
    from scipy.linalg import block_diag

    outputs, inputs = response.response.shape[1:]
    models: list[ModalModel] = []
    moved: list[Floats] = []
    parameters: list[str] = []
    states = modes = 0
    for o, i in enumerate(strongest_drives(response)):
        pair, own = _of_pair(response, o, i, delay_s), None
        model = fit_order(pair, order, exchanges=0).model
        if spectra is not None:
            own = LineSpectra(spectra.drive[:, :, i : i + 1], spectra.output[:, :, o : o + 1])
        found = spread(model, pair, delay_s, own, fixed_delay=True)
        parameters += names(model, [i], [o], states, modes)[:-1]
        moved.append(found.moved[:, :-1])
        models.append(_placed(model, (o, outputs), (i, inputs)))
        states, modes = states + model.order, modes + model.poles_rad_s.size
    joined = np.hstack(moved) if spectra is not None else block_diag(*moved)
    return Fitted(
        name=f"per axis, order {order} each",
        kind="per axis",
        order=states,
        parameters=2 * states + outputs + 1,
        mirror=side_by_side(models),
        delay_s=delay_s,
        poles_rad_s=np.concatenate([m.poles_rad_s for m in models]),
        poles_error_rad_s=np.concatenate([_pole_errors(m, v) for m, v in zip(models, moved, strict=True)]),
        delay_error_s=np.nan,
        known=known(parameters, joined),
    )


def strongest_drives(response: FrequencyResponse) -> list[int]:
    """For each output the drive that makes most of it."""
    power = np.abs(response.response) ** 2 * np.diagonal(response.drive_power, axis1=1, axis2=2).real[:, None, :]
    return [int(i) for i in np.argmax(power.sum(axis=0), axis=1)]


def side_by_side(models: Sequence[ModalModel]) -> Mirror:
    """Linear models side by side, of the same drives and outputs, as a mirror in the plant form with an empty bank."""
    from scipy.linalg import block_diag

    systems = [model.state_space() for model in models]
    (outputs, inputs), states = models[0].direct.shape, sum(model.order for model in models)
    return Mirror(
        name="identified",
        A=block_diag(*(system.A for system in systems)),
        B=np.vstack([system.B for system in systems]),
        E=np.zeros((states, 0)),
        F=np.zeros((0, states)),
        G=np.zeros((0, inputs)),
        C=np.hstack([system.C for system in systems]),
        D=np.sum([system.D for system in systems], axis=0),
        K=np.zeros((outputs, 0)),
        bouc_wen=(),
        plays=(),
        inverse=(),
    )


def _of_pair(response: FrequencyResponse, output: int, drive: int, delay_s: float) -> FrequencyResponse:
    """The response of one output to one drive."""
    whole, own = without_delay(response, delay_s, STEPS), np.ix_(range(response.freq_hz.size), [output], [drive])
    return replace(
        whole, response=whole.response[own], drive_power=whole.drive_power[:, drive : drive + 1, drive : drive + 1]
    )


def _placed(model: ModalModel, output: tuple[int, int], drive: tuple[int, int]) -> ModalModel:
    """A model of one output and one drive among others: (which, of how many)."""
    (o, outputs), (i, inputs) = output, drive
    b, c = (
        np.zeros(shape, dtype=complex)
        for shape in ((model.poles_rad_s.size, inputs), (outputs, model.poles_rad_s.size))
    )
    direct = np.zeros((outputs, inputs))
    b[:, i], c[o], direct[o, i] = model.input_vectors[:, 0], model.output_vectors[0], model.direct[0, 0]
    return ModalModel(model.poles_rad_s, b, c, direct)
