"""A controller's modes: blocks of states of comparable size, which modes are superfluous, and it without those."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.export.linear_part.block_diagonal import BlockDiagonal, Wide, block_diagonal
from microrad.export.records import ExportError, FlightController

BOUNDS = (100.0, 10.0, 1.0, 0.0)
"""How far a basis may lean to part two blocks, from the finest form to the coarsest one."""

MOST_CANCELLATION = 100.0
"""Largest sum of the sizes of what the blocks add to an output, over the largest size of their sum."""

LEAST_SHARE = 1e-12
"""A mode that inputs reach, or outputs show, by less than this share of what they could is taken for superfluous."""

NEAR = 1e-7
"""Poles closer than this may be one repeated pole: a double one comes out to the root of rounding."""

NOT_DRIVEN, NOT_SHOWN = "no input and no anti-windup drives", "no output shows"


@dataclass(frozen=True, slots=True)
class Modes:
    """A controller in blocks, from states that are scaled to comparable sizes by powers of two.

    ``found`` are the blocks of the scaled A. ``B`` (states, inputs), ``L`` (states, actuators) and ``C`` (outputs,
    states) belong to them, at their precision; ``driven`` (states, inputs + actuators) gives the states their sizes.
    """

    found: BlockDiagonal
    B: Wide
    L: Wide
    C: Wide
    driven: Floats


def modes(of: FlightController) -> Modes:
    """The finest blocks of a controller that do not cancel each other.

    Raises:
        ExportError: Where the controller has a number that is not finite.
    """
    s = of.system
    matrices = {**{key: getattr(s, key) for key in "ABCD"}, "anti-windup gain L": of.anti_windup}
    for key, matrix in matrices.items():
        bad = np.argwhere(~np.isfinite(matrix))
        if bad.size:
            i, j = bad[0]
            raise ExportError(
                f"controller {of.name!r}: {key} is {matrix[i, j]} in row {i}, column {j} (from 0); code cannot be made "
                "from a number that is not finite: tune the controller anew, or mend its matrices"
            )
    return _parted(s.A, s.B, of.anti_windup, s.C)


def _parted(A: Floats | Wide, B: Floats | Wide, L: Floats | Wide, C: Floats | Wide) -> Modes:
    driven = _driven(B.astype(float), L.astype(float))
    size = sizes(A.astype(float), driven)
    for bound in BOUNDS:
        found = block_diagonal(A * size / size[:, None], C * size, bound)
        W = np.asarray(found.inverse / size, dtype=np.longdouble)
        made = Modes(found, W @ B, W @ L, (C * size) @ found.basis, (W @ driven).astype(float))
        if _cancellation(made) <= MOST_CANCELLATION:
            break
    return made


def sizes(A: Floats, driven: Floats) -> Floats:
    """Powers of two near each state's rms under white noise of 1 at the inputs; 1 for a state that stays at rest.

    The poles are drawn in by a thousandth (and inside the circle, where one is not): an integrator has a size, too.

    Args:
        A: The discrete system's matrix, shape (states, states).
        driven: What each of the noises drives, shape (states, noises).
    """
    if not A.size:
        return np.ones(0)
    radius = float(np.max(np.abs(np.linalg.eigvals(A))))
    power = np.diag(lti.gramian(A.T / (1.001 * max(radius, 1.0)), driven @ driven.T))
    return np.asarray(np.exp2(np.round(0.5 * np.log2(np.where(power > 0.0, power, 1.0)))))


def _driven(B: Floats, L: Floats) -> Floats:
    """B beside L, which is taken times the ratio of their sizes: what a clip takes off has another unit."""
    size, windup = np.linalg.norm(B), np.linalg.norm(L)
    return np.hstack([B, L * (size / windup)]) if size > 0.0 and windup > 0.0 else np.hstack([B, L])


def _cancellation(of: Modes) -> float:
    """Largest size of what the blocks add to an output, over the largest size of the sum, over frequency and inputs."""
    points = np.exp(1j * np.pi * np.geomspace(1e-6, 1.0, 80))
    blocks, C = of.found.blocks.astype(float), of.C.astype(float)
    parts = []
    for at in of.found.slices:
        resolvent = points[:, None, None] * np.eye(at.stop - at.start) - blocks[at, at]
        driven = np.broadcast_to(of.driven[at], (points.size, *of.driven[at].shape))
        parts.append(C[:, at] @ np.linalg.solve(resolvent, driven))
    if not parts:
        return 1.0
    whole = np.max(np.abs(sum(parts)), axis=0)
    added = np.max(sum(np.abs(part) for part in parts), axis=0)
    at = whole > 0.0
    return float(np.max(added[at] / whole[at], initial=1.0))


# ----------------------------------------------------------------------------------------------------- hidden modes
@dataclass(frozen=True, slots=True)
class _Local:
    """One or more blocks in an orthonormal basis; the columns of B and the rows of C have length 1 over all states.

    ``basis`` (states of the blocks, own states) leads back to the blocks, ``inverse`` from them.
    """

    A: Floats
    B: Floats
    C: Floats
    basis: Floats
    inverse: Floats


def hidden(of: Modes) -> tuple[str, complex] | None:
    """What hides a mode (NOT_DRIVEN or NOT_SHOWN) and its pole, if there is one.

    Blocks that share a pole are looked at together: the same input may drive two equal integrators alike.
    """
    for at in _alike(of.found):
        part = _local(of, at)
        for lack, A, B in ((NOT_DRIVEN, part.A, part.B), (NOT_SHOWN, part.A.T, part.C.T)):
            Q, reached = _staircase(A, B)
            if reached < A.shape[0]:
                rest = Q[:, reached:]
                return lack, complex(np.linalg.eigvals(rest.T @ A @ rest)[0])
    return None


def minimal(of: FlightController) -> FlightController:
    """The controller without modes that nothing drives or no output shows; itself where it has none.

    Designs that hold a model of their plant have such modes, where a pole of the model stands on a zero; those for
    several axes have some that hide behind equal poles of other blocks. From rest, the outputs stay the same, but for a
    share of LEAST_SHARE of such a mode.

    Raises:
        ExportError: Where the controller has a number that is not finite.
    """
    found = modes(of)
    made = _without_hidden(of, found, [np.arange(at.start, at.stop) for at in found.found.slices])
    found = modes(made)
    return made if hidden(found) is None else _without_hidden(made, found, _alike(found.found))


def _without_hidden(of: FlightController, found: Modes, groups: Sequence[NDArray[np.intp]]) -> FlightController:
    """The controller without what hides in each of some groups of states; itself where nothing does."""
    kept = [_kept(found, at) for at in groups]
    if sum(len(block) for block, _, _ in kept) == of.system.order:
        return of
    order = np.concatenate(groups)
    A, W, T = (block_diag(*matrices) for matrices in zip(*kept, strict=True))
    made = _parted(A, W @ found.B[order], W @ found.L[order], found.C[:, order] @ T)  # before any rounding
    A, B, C, L = (each.astype(float) for each in (made.found.blocks, made.B, made.C, made.L))
    return replace(of, system=lti.StateSpace(A, B, C, of.system.D), anti_windup=L)


def _kept(of: Modes, at: NDArray[np.intp]) -> tuple[Wide, Wide, Wide]:
    """What remains of a block: its matrix, and the ones that lead from the block's states to its own and back.

    What stands first or last and hides is left out as it is. What else hides, in clusters of poles, is found by the
    staircase, at the cost of some rounding.
    """
    one, inner = np.eye(at.size, dtype=np.longdouble), _stripped(of, at)
    block = of.found.blocks[np.ix_(inner, inner)]
    places = np.flatnonzero(np.isin(at, inner))
    into, back = one[places], one[:, places]
    part = _local(of, inner)
    for reached in (True, False):
        Q, count = _staircase(part.A, part.B) if reached else _staircase(part.A.T, part.C.T)
        Q = Q[:, :count]
        part = _Local(Q.T @ part.A @ Q, Q.T @ part.B, part.C @ Q, part.basis @ Q, Q.T @ part.inverse)
    if len(part.A) == len(block):
        return block, into, back
    return part.A.astype(np.longdouble), part.inverse @ into, back @ part.basis


def _stripped(of: Modes, at: NDArray[np.intp]) -> NDArray[np.intp]:
    """The states of a block without the first ones that no output shows and the last ones that nothing drives."""
    while at.size:
        part, below = _local(of, at), of.found.blocks[at[1:], at[:-1]] != 0.0
        first, last = 1 + int(below[:1].any()), 1 + int(below[-1:].any())
        if np.linalg.norm(part.C[:, :first]) <= LEAST_SHARE:
            at = at[first:]
        elif np.linalg.norm(part.B[-last:]) <= LEAST_SHARE:
            at = at[:-last]
        else:
            break
    return at


def _local(of: Modes, at: NDArray[np.intp]) -> _Local:
    block = of.found.blocks[np.ix_(at, at)].astype(float)
    R = np.asarray(np.linalg.qr(of.found.basis[:, at].astype(float), mode="r"))
    back = np.linalg.inv(R)
    drive, shown = np.hstack([of.B, of.L]), of.C @ of.found.inverse
    whole = np.linalg.norm((of.found.basis @ drive).astype(float), axis=0)
    B = (R @ drive[at].astype(float)) / np.where(whole > 0.0, whole, 1.0)
    rows = np.linalg.norm(shown.astype(float), axis=1)
    C = of.C[:, at].astype(float) @ back / np.where(rows > 0.0, rows, 1.0)[:, None]
    return _Local(R @ block @ back, B, C, back, R)


def _staircase(A: Floats, B: Floats) -> tuple[Floats, int]:
    """An orthonormal basis whose first columns, so many of them, span what B reaches through A.

    Each step decides by its singular values what the states found last drive of the rest. Source: Van Dooren, IEEE
    Trans. Autom. Control 26 (1981) 111.
    """
    Q, n, reached = np.eye(A.shape[0]), A.shape[0], 0
    last, scale = B, 1.0
    while reached < n:
        U, values, _ = np.linalg.svd(last)
        rank = int(np.count_nonzero(values > LEAST_SHARE * scale))
        if rank == 0:
            break
        Q[:, reached:] = Q[:, reached:] @ U
        own, rest = Q[:, reached : reached + rank], Q[:, reached + rank :]
        last, scale, reached = rest.T @ A @ own, float(np.linalg.norm(A, 2)), reached + rank
    return Q, reached


def _alike(found: BlockDiagonal) -> list[NDArray[np.intp]]:
    """States by groups of blocks that share a pole: only those can hide one another's modes."""
    groups: list[tuple[Complexes, list[int]]] = []
    for each in found.slices:
        poles = np.linalg.eigvals(found.blocks[each, each].astype(float)).astype(complex)
        states, apart = list(range(each.start, each.stop)), []
        for other, others in groups:
            if np.min(np.abs(poles[:, None] - other)) < NEAR:
                poles, states = np.concatenate([other, poles]), others + states
            else:
                apart.append((other, others))
        groups = [*apart, (poles, states)]
    return [np.array(states) for _, states in groups]
