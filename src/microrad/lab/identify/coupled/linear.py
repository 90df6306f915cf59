"""Linear candidates: each output from one drive, and all of them from all, behind a common delay."""

from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Complexes
from microrad.lab.identify.coupled.records import Kind
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.mirror.coupled import Known
from microrad.mirror.model import Mirror

STEPS = 2
"""Steps of the plant in each sample."""

_GRID = np.arange(0.0, 2.01, 0.25)  # delays tried, in samples


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model of the ladder before it is judged; the fields are those of `Candidate` and of its `CoupledMirror`."""

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
    note: str = ""


def without_delay(response: FrequencyResponse, delay_s: float) -> FrequencyResponse:
    """The response of what is behind a delay, to a drive that is straight over each step of the plant.

    Args:
        response: The measured response.
        delay_s: The delay, in s.
    """
    ahead = np.exp(2j * np.pi * response.freq_hz * delay_s)[:, None, None]
    values = np.asarray(response.response * ahead)
    return replace(response, response=values, hold="first-order", rate_hz=STEPS * response.rate_hz)


def best_delay(response: FrequencyResponse, order: int) -> float:
    """The delay (s) on a grid of a quarter of a sample up to two samples behind which a model fits best.

    Args:
        response: The measured response.
        order: Number of states of the models.
    """
    tried = _GRID / response.rate_hz
    costs = [fit_order(without_delay(response, d), order, exchanges=0, fine=False).cost for d in tried]
    return float(tried[int(np.argmin(costs))])


def coupled_linear(response: FrequencyResponse, order: int, delay_s: float, exchanges: int) -> Fitted:
    """A linear model of all outputs from all drives.

    Args:
        response: The measured response.
        order: Number of states.
        delay_s: The delay in front of it, in s.
        exchanges: Largest number of modes exchanged for better ones, see `fit_order`.
    """
    model = fit_order(without_delay(response, delay_s), order, exchanges=exchanges).model
    outputs, inputs = model.direct.shape
    return Fitted(
        name=f"coupled linear, order {order}",
        kind="coupled linear",
        order=model.order,
        parameters=model.order * (outputs + inputs) + outputs * inputs + 1,
        mirror=linear_mirror(model),
        delay_s=delay_s,
        poles_rad_s=model.poles_rad_s,
        poles_error_rad_s=np.full(model.poles_rad_s.size, complex(np.nan, np.nan)),
        delay_error_s=np.nan,
        known=None,
    )


def per_axis(response: FrequencyResponse, order: int, delay_s: float) -> Fitted:
    """Each output from the one drive that moves it most, independently of the others.

    Args:
        response: The measured response.
        order: Number of states for each output.
        delay_s: The delay in front of all, in s.
    """
    drives = strongest_drives(response)
    models = [fit_order(_of_pair(response, o, i, delay_s), order, exchanges=0).model for o, i in enumerate(drives)]
    outputs, inputs = response.response.shape[1:]
    widened = [_placed(m, (o, outputs), (i, inputs)) for o, (m, i) in enumerate(zip(models, drives, strict=True))]
    model = ModalModel(
        np.concatenate([m.poles_rad_s for m in widened]),
        np.concatenate([m.input_vectors for m in widened]),
        np.concatenate([m.output_vectors for m in widened], axis=1),
        np.sum([m.direct for m in widened], axis=0),
    )
    rank = np.argsort(model.poles_rad_s.imag != 0, kind="stable")  # real poles first
    model = ModalModel(model.poles_rad_s[rank], model.input_vectors[rank], model.output_vectors[:, rank], model.direct)
    return Fitted(
        name=f"per axis, order {order} each",
        kind="per axis",
        order=model.order,
        parameters=2 * model.order + outputs + 1,
        mirror=linear_mirror(model),
        delay_s=delay_s,
        poles_rad_s=model.poles_rad_s,
        poles_error_rad_s=np.full(model.poles_rad_s.size, complex(np.nan, np.nan)),
        delay_error_s=np.nan,
        known=None,
    )


def strongest_drives(response: FrequencyResponse) -> list[int]:
    """For each output the drive that makes most of it."""
    power = np.abs(response.response) ** 2 * np.diagonal(response.drive_power, axis1=1, axis2=2).real[:, None, :]
    return [int(i) for i in np.argmax(power.sum(axis=0), axis=1)]


def linear_mirror(model: ModalModel) -> Mirror:
    """A linear model as a mirror in the plant form, with an empty bank.

    Args:
        model: The modal model.
    """
    system = model.state_space()
    outputs, inputs = model.direct.shape
    return Mirror(
        name="identified",
        A=system.A,
        B=system.B,
        E=np.zeros((model.order, 0)),
        F=np.zeros((0, model.order)),
        G=np.zeros((0, inputs)),
        C=system.C,
        D=system.D,
        K=np.zeros((outputs, 0)),
        bouc_wen=(),
        plays=(),
        inverse=(),
    )


def _of_pair(response: FrequencyResponse, output: int, drive: int, delay_s: float) -> FrequencyResponse:
    """The response of one output to one drive."""
    whole, own = without_delay(response, delay_s), np.ix_(range(response.freq_hz.size), [output], [drive])
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
