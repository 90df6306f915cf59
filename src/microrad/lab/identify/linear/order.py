"""Which modes a model of a given order should have: reduction of a vector fit, and exchange of weak modes for better
ones.

Vector fitting gives every pole a residue of full rank, and so inputs times as many states as poles. Balanced
truncation (B. Moore, IEEE Trans. Automatic Control 26 (1981) 17) cuts that to the order asked for. Least squares from
there ends in a local minimum, for it cannot move a mode across the band. So the weakest modes are exchanged, one at a
time, for the mode that would take most of what is left, for as long as that helps.
"""

from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import ModalModel, order_modes, rank_one_modes
from microrad.lab.identify.linear.polish import (
    Equations,
    FrequencyEquations,
    Polished,
    behind_modes,
    fit_outputs,
    polish,
)
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.linear.vector_fitting import check_order, vector_fit

_DAMPING = (0.003, 0.01, 0.03, 0.1, 0.4)
_CHUNK = 40


class CandidateMode(NamedTuple):
    """A mode that would lower the cost by about `gain`."""

    gain: float
    pole: complex
    inputs: Complexes


def fit_order(
    response: FrequencyResponse,
    order: int,
    *,
    direct: bool = True,
    exchanges: int = 12,
    fine: bool = True,
    smaller: ModalModel | None = None,
) -> Polished:
    """Modal model of a given order with the least output error in a response.

    It is found by vector fit, reduction, exchanges of modes and polish. The error is weighed by the power of the
    drives, so that the sum is the mean-square output error.

    Args:
        response: The measured frequency response with the power of its drives.
        order: Number of states.
        direct: Whether the model has a direct term.
        exchanges: Largest number of modes exchanged from each of two starts (vector fits of `order` and of 1.4 `order`
            poles); 0 for one start and no exchange.
        fine: Whether the result is polished once more on all lines.
        smaller: Model of one input with one state less; with a real pole more it is another start of the last polish,
            so that the fit is never worse than it.

    Raises:
        IdentificationError: For an order below 1, or beyond what the frequencies can fix.
    """
    check_order(response.freq_hz, order)
    freq, values, power = _merged(response)
    coarse = FrequencyEquations(freq, values, power, response.hold, response.rate_hz, direct=direct)
    sizes = [order] if exchanges == 0 else [order, min(round(1.4 * order), freq.size - 1)]
    results = []
    for size in sizes:
        result = polish(
            coarse, _start(response, (freq, values, power), (order, size), direct), iterations=60, tolerance=3e-5
        )
        for _ in range(exchanges):
            better = exchanged(coarse, result, response.excited_hz)
            if better is None:
                break
            result = better
        results.append(result)
    result = min(results, key=lambda found: found.cost)
    if not fine:
        return result
    every = (response.freq_hz, response.response, response.drive_power)
    full = FrequencyEquations(*every, response.hold, response.rate_hz, direct=direct)
    starts = [result.model, *([_grown(full, smaller, response.excited_hz)] if smaller else [])]
    return min((polish(full, m, iterations=40, tolerance=1e-6) for m in starts), key=lambda found: found.cost)


def _start(
    response: FrequencyResponse, merged: tuple[Floats, Complexes, Complexes], orders: tuple[int, int], direct: bool
) -> ModalModel:
    """Vector fit with the second number of poles, reduced to the first number of states."""
    freq, values, power = merged
    found = vector_fit(
        freq,
        values,
        orders[1],
        weight=np.sqrt(np.trace(power, axis1=1, axis2=2).real / power.shape[1]),
        hold=response.hold,
        rate_hz=response.rate_hz,
        strictly_proper=not direct,
        iterations=15,
    )
    return reduced(found.modes(), orders[0])


def _merged(response: FrequencyResponse) -> tuple[Floats, Complexes, Complexes]:
    """The response with neighbouring lines merged to about 900, each weighed by its drive power."""
    freq, values, power = response.freq_hz, response.response, response.drive_power
    size = max(1, freq.size // 900)
    if size == 1:
        return freq, values, power
    marks = np.arange(0, freq.size, size)
    total: Complexes = np.add.reduceat(power, marks)
    merged: Complexes = np.add.reduceat(values @ power, marks) @ np.linalg.inv(total)
    return np.add.reduceat(freq, marks) / np.diff(np.append(marks, freq.size)), merged, total


# ------------------------------------------------------------------------------------------------------------ reduction
def reduced(model: ModalModel, order: int) -> ModalModel:
    """A model cut down to fewer states by balanced truncation, as rank-one modes; itself where it has no more.

    Args:
        model: The modal model.
        order: Largest number of states.
    """
    if model.order <= order:
        return model
    p, (b, c) = model.all_poles_rad_s, model.all_vectors
    reach = _root(-(b @ b.conj().T) / (p[:, None] + p.conj()[None, :]))
    seen = _root(-(c.conj().T @ c) / (p.conj()[:, None] + p[None, :]))
    left, size, right = np.linalg.svd(seen.conj().T @ reach)
    root = np.sqrt(size[:order])
    to_small = (seen @ left[:, :order] / root).conj().T
    to_large = reach @ right[:order].conj().T / root
    poles, vectors = np.linalg.eig(to_small @ (p[:, None] * to_large))
    b, c = np.linalg.solve(vectors, to_small @ b), c @ to_large @ vectors
    real = np.abs(poles.imag) <= 1e-7 * np.abs(poles)
    upper = np.flatnonzero(real | (poles.imag > 0))
    residues = [np.outer(c[:, k], b[k]) for k in upper]
    return rank_one_modes(np.where(real, poles.real, poles)[upper], residues, model.direct, most=1)


def _root(gramian: Complexes) -> Complexes:
    values, vectors = np.linalg.eigh(gramian)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


# -------------------------------------------------------------------------------------------------------------- starts
def _grown(equations: Equations, model: ModalModel, band: tuple[float, float]) -> ModalModel:
    """A model of one input with one real pole more: the one of a grid, a decade beyond the band, that helps most."""
    grid = -2 * np.pi * np.geomspace(0.1 * band[0], 10.0 * band[1], 60)
    inputs = np.vstack([np.ones((1, 1)), model.input_vectors])
    tried = (fit_outputs(equations, np.append(p, model.poles_rad_s), inputs) for p in grid.astype(complex))
    return min(tried, key=lambda found: found[1])[0]


# ------------------------------------------------------------------------------------------------------------- exchange
def exchanged(equations: Equations, now: Polished, band: tuple[float, float]) -> Polished | None:
    """The best of a few exchanges of a weak mode for a promising one, polished; None where none helps.

    Args:
        equations: The equations to be met.
        now: The model whose modes are exchanged.
        band: Lowest frequency above zero and highest one, in Hz, between which modes are sought.
    """
    best: Polished | None = None
    for poles, inputs in _without_weakest(equations, now.model):
        rest, _ = fit_outputs(equations, poles, inputs)
        tried: list[complex] = []
        for candidate in _candidates(equations, rest, band):
            if any(abs(candidate.pole - other) < 0.2 * abs(candidate.pole) for other in tried):
                continue
            tried.append(candidate.pole)
            grown = order_modes(
                np.append(poles, candidate.pole),
                np.vstack([inputs, candidate.inputs]),
                np.ones((rest.direct.shape[0], poles.size + 1), dtype=complex),
                rest.direct,
            )
            trial = polish(equations, grown, iterations=12, tolerance=1e-4)
            if best is None or trial.cost < best.cost:
                best = trial
            if len(tried) == 2:
                break
    if best is None or best.cost > 1.05 * now.cost:
        return None
    best = polish(equations, best.model, iterations=40, tolerance=3e-5)
    return best if best.cost < (1 - 1e-3) * now.cost else None


def _without_weakest(equations: Equations, model: ModalModel) -> list[tuple[Complexes, Complexes]]:
    """Poles and input vectors without one pair, or two real poles: the removals that cost least."""
    m, n = model.real_poles, model.poles_rad_s.size
    costs = []
    for drop in [(k,) for k in range(m, n)] + [(j, k) for j in range(m) for k in range(j + 1, m)]:
        poles, inputs = np.delete(model.poles_rad_s, drop), np.delete(model.input_vectors, drop, axis=0)
        if poles.size:
            costs.append((fit_outputs(equations, poles, inputs)[1], poles, inputs))
    costs.sort(key=lambda item: item[0])
    return [(poles, inputs) for _, poles, inputs in costs[:2]]


def _candidates(equations: Equations, model: ModalModel, band: tuple[float, float]) -> list[CandidateMode]:
    """Rank-one pairs over the band by the cost they would take, the output vectors of all modes refitted; best
    first.
    """
    low, high = band[0], 1.1 * band[1]
    freq = np.unique(np.concatenate([np.geomspace(low, high, 30), np.linspace(low, high, 61)]))
    zeta = np.array(_DAMPING)
    poles = (2 * np.pi * freq[:, None] * (-zeta + 1j * np.sqrt(1 - zeta**2))).ravel()
    found: list[CandidateMode] = []
    own, left = _left_over(equations, model)
    for begin in range(0, poles.size, _CHUNK):
        found += _gains(equations, poles[begin : begin + _CHUNK], own, left)
    return sorted(found, key=lambda candidate: -candidate.gain)


def _left_over(equations: Equations, model: ModalModel) -> tuple[Floats, Floats]:
    """Orthonormal rows of what the model can produce with its input vectors, and the error freed of them."""
    (block,) = equations.blocks(model.poles_rad_s, rates=False)
    own = np.concatenate([behind_modes(block.behind, model.input_vectors, model.real_poles), block.drive])
    basis = np.linalg.qr((own / np.linalg.norm(own, axis=1)[:, None]).T)[0].T
    return basis, block.target - (block.target @ basis.T) @ basis


def _gains(equations: Equations, poles: Complexes, own: Floats, left: Floats) -> list[CandidateMode]:
    (block,) = equations.blocks(poles, rates=False)
    count = poles.size
    inputs = block.behind.shape[1]
    found = []
    for k in range(count):
        rows = np.concatenate([block.behind[k], block.behind[count + k]])
        size = np.linalg.norm(rows, axis=1)[:, None]
        rows = rows / size
        inside = rows @ own.T
        gram = rows @ rows.T - inside @ inside.T
        cross = rows @ left.T
        best = np.linalg.lstsq(gram, cross, rcond=1e-6)[0] / size
        residue = (best[:inputs] + 1j * best[inputs:]).T
        u, s, vh = np.linalg.svd(residue)
        one = s[0] * np.outer(u[:, 0], vh[0]).T
        taken = np.concatenate([one.real, one.imag]) * size
        gain = 2 * float(np.sum(taken * cross)) - float(np.sum(taken * (gram @ taken)))
        found.append(CandidateMode(gain, complex(poles[k]), vh[0]))
    return found
