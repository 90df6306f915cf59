"""Real block-diagonal form of a matrix, T^-1 A T, with blocks as small as a well-conditioned T allows.

The method is that of Bavely and Stewart, SIAM J. Numer. Anal. 16 (1979) 359: an orthogonal transformation to real Schur
form, quasi-triangular, in which the leading block is parted from the rest by the solution X of a Sylvester equation,

    T11 X - X T22 = -T12,      [T11 T12; 0 T22] [I X; 0 I] = [I X; 0 I] [T11 0; 0 T22].

X is large where eigenvalues of T11 and T22 lie close for their coupling. Then the eigenvalue of the rest nearest to
those of the leading block is moved into it (Bai and Demmel, Linear Algebra Appl. 186 (1993) 73; LAPACK's trexc), and
the step is tried again. A defective cluster, a double pole or a chain of delays, so becomes one triangular block.

Two things are added. Zeros of A are used: what is not connected is treated by itself, and Schur forms are taken of the
strongly connected parts alone (Tarjan, SIAM J. Comput. 1 (1972) 146), so that integrators and delays that nothing feeds
back to keep poles of exactly 1 and 0. And T is refined at extended precision, where the machine has it, with the same
Sylvester equations, so that the blocks are those of A to the rounding of their own entries.
"""

from dataclasses import dataclass
from graphlib import TopologicalSorter
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur, solve_sylvester
from scipy.linalg.lapack import dtrexc, dtrsyl
from scipy.sparse.csgraph import connected_components

from microrad.core.arrays import Floats

Wide = NDArray[np.longdouble]
Mask = NDArray[np.bool_]

_NOISE = 64.0 * float(np.finfo(np.longdouble).eps)
"""Entries below this share of the largest one are rounding of the refined form."""

_SMALL_CORRECTION = 1e-6
"""Refinement moves a basis by less than this; more is the quotient of two rounding errors."""

_LARGEST = 30
"""States of a block up to which what stands below it is taken away at extended precision (n^2 / 2 unknowns)."""


@dataclass(frozen=True, slots=True)
class BlockDiagonal:
    """A = ``basis`` blocks ``inverse``, with blocks of these ``sizes`` down the diagonal.

    Blocks of two with a complex pair are [[a, -w], [w, a]] where that is well conditioned; the other blocks are upper
    quasi-triangular.
    """

    blocks: Wide
    basis: Wide
    inverse: Wide
    sizes: tuple[int, ...]

    @property
    def slices(self) -> list[slice]:
        """Where each block stands."""
        return slices(self.sizes)


def slices(sizes: tuple[int, ...]) -> list[slice]:
    """Where blocks of these sizes stand, one behind the other."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]


def block_diagonal(A: Floats | Wide, C: Floats | Wide, bound: float) -> BlockDiagonal:
    """The block-diagonal form of a square matrix with the smallest blocks that the bound allows.

    With a bound of 0 each connected part of A is one block. Within a block those modes stand first whose eigenvectors
    the outputs show least: a mode that a zero cancels then drives nothing, however large it grows. The
    output that shows a state most rises with it, on each processor.

    Args:
        A: The matrix, finite, shape (states, states), with states of comparable sizes: the bound is absolute.
        C: What the outputs show of the states, shape (outputs, states).
        bound: The most that an entry of a Sylvester solution, or a ratio within a pair of states, may be.
    """
    if not A.size:
        return BlockDiagonal(*(np.zeros(A.shape, dtype=np.longdouble),) * 3, ())
    found = _parts(A.astype(float), C.astype(float), bound)
    parts = sorted(found, key=lambda part: (len(part.kept) == 1, len(part.kept) % 2, len(part.kept)))
    sizes = tuple(len(part.kept) for part in parts)
    kept = np.zeros(A.shape, dtype=bool)
    for each, part in zip(slices(sizes), parts, strict=True):
        kept[each, each] = part.kept
    basis = _refined(A, np.hstack([part.basis for part in parts]), kept, sizes)
    blocks = _inverse(basis) @ A.astype(np.longdouble) @ basis
    noise = _NOISE * np.max(np.abs(blocks))
    blocks = np.where(kept & (np.abs(blocks) > noise), blocks, 0.0)
    for each in slices(sizes):
        if each.stop - each.start == 2:
            basis[:, each], blocks[each, each] = _rotation(basis[:, each], blocks[each, each], bound)
    sign = _signs(C @ basis, sizes)
    basis, blocks = basis * sign, sign[:, None] * blocks * sign
    return BlockDiagonal(blocks, basis, _inverse(basis), sizes)


def _signs(shown: Wide, sizes: tuple[int, ...]) -> Wide:
    """1 or -1 for each state, with which the output that shows it most rises with it; a pair has that of its first."""
    most = np.take_along_axis(shown, np.argmax(np.abs(shown), axis=0)[None], axis=0)[0]
    sign = np.where(most < 0.0, -1.0, 1.0).astype(np.longdouble)
    for each in slices(sizes):
        if each.stop - each.start == 2:
            sign[each] = sign[each.start]
    return sign


@dataclass(frozen=True, slots=True)
class _Part:
    """A basis of an invariant subspace (n, size), and where its block may have something (size, size)."""

    basis: Floats
    kept: Mask


def _parts(A: Floats, C: Floats, bound: float) -> list[_Part]:
    """The blocks, for each connected part of A by itself."""
    found = []
    number, label = connected_components(A != 0.0, connection="weak")
    for own in range(number):
        at = np.flatnonzero(label == own)
        T, Q, sizes = _split(*_schur(A[np.ix_(at, at)]), C[:, at], bound)
        whole = np.zeros((A.shape[0], at.size))
        whole[at] = Q
        below = np.tril(np.ones(T.shape, dtype=bool), -1)
        found += [_Part(whole[:, each], (~below | (T != 0.0))[each, each]) for each in slices(sizes)]
    return found


def _schur(A: Floats) -> tuple[Floats, Floats]:
    """T quasi-triangular and Q orthogonal with A = Q T Q', from the Schur forms of the strongly connected parts."""
    parts = _strong_parts(A)
    places = slices(tuple(at.size for at in parts))
    forms = [schur(A[np.ix_(at, at)]) if at.size > 1 else (A[np.ix_(at, at)], np.ones((1, 1))) for at in parts]
    Q = np.zeros_like(A)
    for at, place, (_, own) in zip(parts, places, forms, strict=True):
        Q[at, place] = own
    T = Q.T @ A @ Q
    T[np.abs(T) <= 4.0 * np.finfo(float).eps * np.max(np.abs(T))] = 0.0
    for place, (own, _) in zip(places, forms, strict=True):
        T[place.start :, place] = 0.0
        T[place, place] = own
    return T, Q


def _strong_parts(A: Floats) -> list[NDArray[np.intp]]:
    """States by strongly connected part, in an order that makes A block upper triangular."""
    number, label = connected_components(A != 0.0, connection="strong")
    before: dict[int, set[int]] = {part: set() for part in range(number)}
    for i, j in zip(*np.nonzero(A), strict=True):
        if label[i] != label[j]:
            before[int(label[j])].add(int(label[i]))
    return [np.flatnonzero(label == part) for part in TopologicalSorter(before).static_order()]


# ----------------------------------------------------------------------------------------------------- parting blocks
def _lead(T: Floats, at: int) -> int:
    """Size of the diagonal block of a quasi-triangular T that begins at a state."""
    return 2 if at + 1 < T.shape[0] and T[at + 1, at] != 0.0 else 1


def _split(T: Floats, Q: Floats, C: Floats, bound: float) -> tuple[Floats, Floats, tuple[int, ...]]:
    """T and the basis with its blocks parted, and their sizes."""
    start, sizes, n = 0, [], T.shape[0]
    while start < n:
        end = start + _lead(T, start)
        while end < n:
            X = _parting(T[start:end, start:end], T[start:end, end:], T[end:, end:])
            if np.max(np.abs(X)) <= bound:
                Q[:, end:] += Q[:, start:end] @ X
                T[start:end, end:] = 0.0
                break
            T, Q = _fetch(T, Q, start, end)
            end += _lead(T, end)
        T, Q = _ordered(T, Q, C, slice(start, end))
        sizes.append(end - start)
        start = end
    return T, Q, tuple(sizes)


def _parting(T11: Floats, T12: Floats, T22: Floats) -> Floats:
    """X of T11 X - X T22 = -T12 for quasi-triangular T11 and T22; infinite where there is none."""
    if not np.any(T12):
        return np.zeros_like(T12)
    X, scale, info = dtrsyl(T11, T22, -T12, isgn=-1)
    return np.asarray(X / scale) if scale > 0.0 and info >= 0 else np.full_like(T12, np.inf)


def _fetch(T: Floats, Q: Floats, start: int, end: int) -> tuple[Floats, Floats]:
    """T and Q with the eigenvalue behind ``end`` that is nearest to those of the block before it moved there."""
    middle = np.mean(np.diag(T)[start:end])
    spread = np.sqrt(np.mean(np.imag(np.linalg.eigvals(T[start:end, start:end])) ** 2))
    nearest, least, at = end, np.inf, end
    while at < T.shape[0]:
        size = _lead(T, at)
        own = np.linalg.eigvals(T[at : at + size, at : at + size])[0]
        distance = abs(complex(own.real, abs(own.imag)) - complex(middle, spread))
        if distance < least:
            nearest, least = at, distance
        at += size
    return _moved(T, Q, nearest, end)


def _ordered(T: Floats, Q: Floats, C: Floats, block: slice) -> tuple[Floats, Floats]:
    """T and Q with the block's modes in the order in which C shows them, the least first."""
    at = block.start
    while at + _lead(T, at) < block.stop:
        tried, place = [], at
        while place < block.stop:
            moved = _moved(T, Q, place, at)
            tried.append((float(np.linalg.norm(C @ moved[1][:, at : at + _lead(moved[0], at)])), *moved))
            place += _lead(T, place)
        _, T, Q = min(tried, key=lambda each: each[0])
        at += _lead(T, at)
    return T, Q


def _moved(T: Floats, Q: Floats, place: int, to: int) -> tuple[Floats, Floats]:
    """T and Q with the diagonal block that begins at a place moved up; where a swap fails, as far as it came."""
    return dtrexc(T, Q, place + 1, to + 1)[:2] if place != to else (T, Q)


# --------------------------------------------------------------------------------------------------------- refinement
def _refined(A: Floats | Wide, basis: Floats, kept: Mask, sizes: tuple[int, ...]) -> Wide:
    """The basis at extended precision, corrected for what it leaves where nothing is to be ``kept``."""
    T = basis.astype(np.longdouble)
    for _ in range(3):
        M = _inverse(T) @ A.astype(np.longdouble) @ T
        T = T + T @ _correction(M, kept, sizes)
    return T


def _correction(M: Wide, kept: Mask, sizes: tuple[int, ...]) -> Wide:
    """First-order change of the basis, in itself, that takes away what M has beside and below its blocks."""
    change, near = np.zeros_like(M), M.astype(float)
    for a in slices(sizes):
        for b in slices(sizes):
            if a == b:
                X = _lowered(near[a, a], kept[a, a])
            elif np.any(M[a, b]):
                X = solve_sylvester(near[a, a], -near[b, b], -near[a, b])
            else:
                continue
            change[a, b] = X if np.max(np.abs(X)) < _SMALL_CORRECTION else 0.0
    return change


def _lowered(M: Floats, kept: Mask) -> Floats:
    """X below the quasi-diagonal of a block with M X - X M = -M there, to first order, by least squares."""
    X, below, one = np.zeros_like(M), ~kept, np.eye(len(M))
    if np.any(M[below]) and len(M) <= _LARGEST:
        columns = [(M[:, i, None] * one[j] - one[:, i, None] * M[j])[below] for i, j in np.argwhere(below)]
        X[below] = np.linalg.lstsq(np.stack(columns, axis=1), -M[below])[0]
    return X


def _inverse(T: Wide) -> Wide:
    """Inverse at extended precision by Newton's iteration from the one in double precision."""
    one, inverse = np.eye(T.shape[0], dtype=np.longdouble), np.linalg.inv(T.astype(float)).astype(np.longdouble)
    for _ in range(3):
        inverse = inverse + inverse @ (one - T @ inverse)
    return inverse


def _rotation(basis: Wide, block: Wide, bound: float) -> tuple[Wide, Wide]:
    """A block of two as a rotation: in the basis (e, J e) with J = (M - a) / w, J J = -1."""
    a = (block[0, 0] + block[1, 1]) / 2
    square = -(((block[0, 0] - block[1, 1]) / 2) ** 2 + block[0, 1] * block[1, 0])
    if square <= 0.0:
        return basis, block
    w = np.sqrt(square)
    J = (block - a * np.eye(2)) / w
    _, stretch, right = np.linalg.svd(J.astype(float))
    if stretch[0] > max(bound, 1.0):
        return basis, block
    e = right[0].astype(np.longdouble)
    return basis @ np.stack([e, J @ e], axis=1), np.array([[a, -w], [w, a]], dtype=np.longdouble)
