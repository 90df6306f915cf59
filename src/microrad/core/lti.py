"""State-space algebra of linear time-invariant systems: polynomials to modal form, discretisation, responses."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.units import counted

EXACT_BITS = 32
"""Significant bits (2e-10) of what a simulated loop is made of. Where its converters and reversals decide, a difference
in the last bit of a matrix grows to one in a hundred thousand; so far before the last bit, processors agree."""

DESIGN_BITS = 44
"""Significant bits (6e-14) of the plant of a design: what a controller cancels in it has to stay cancelled."""

STEEPEST = 1e150
"""Largest coefficient of a transfer function over that of its highest power."""

_MOST_COMBINED = 6


@dataclass(frozen=True, slots=True)
class StateSpace:
    """x' = A x + B u, y = C x + D u (or the same with x[k+1] where a function says discrete)."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])


def modal_from_polynomials(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> StateSpace:
    """Real modal (block-diagonal) realisation of a strictly proper transfer function with distinct poles.

    Coefficient form is ill-conditioned when poles span decades, so only the roots are taken from it and each mode is
    built from its residue.

    Args:
        numerator: Coefficients in powers of s (rad/s), highest first.
        denominator: Those of the denominator, likewise.

    Raises:
        ValueError: When the function is not strictly proper, or two poles coincide or nearly so (no accurate modal form
            exists).
    """
    num = np.trim_zeros(np.asarray(numerator, dtype=float), "f")
    den = np.trim_zeros(np.asarray(denominator, dtype=float), "f")
    if num.size >= den.size:
        raise ValueError(
            f"numerator of order {num.size - 1} over denominator of order {den.size - 1}: not strictly proper"
        )
    if np.max(np.abs(np.concatenate([num, den]))) > STEEPEST * abs(den[0]):
        raise ValueError(f"the highest power of s has a coefficient of {den[0]:g}, which is nothing beside the others")
    poles = np.asarray(np.roots(den), dtype=complex)
    distance = np.abs(poles[:, None] - poles[None, :]) + np.diag(np.full(poles.size, np.inf))
    if poles.size > 1 and np.min(distance / np.abs(poles)[:, None].clip(1e-300)) < 1e-6:
        raise ValueError("two poles coincide: the transfer function has no modal form")
    residues = [np.polyval(num, p) / den[0] / np.prod(p - np.delete(poles, i)) for i, p in enumerate(poles)]
    system = modal_from_residues(poles, np.asarray(residues))
    # Poles that nearly coincide pass the test above and spoil the residues: compare with the polynomials themselves.
    probe = np.geomspace(0.1, 10.0, 9) * float(np.median(np.abs(poles)))
    with np.errstate(all="ignore"):
        exact = np.polyval(num, 1j * probe) / np.polyval(den, 1j * probe)
        off = np.abs(frequency_response(system, probe / (2 * np.pi))[:, 0, 0] / exact - 1.0)
    if not np.max(off) <= 1e-6:
        raise ValueError("poles nearly coincide: the transfer function has no accurate modal form")
    return system


def modal_from_roots(zeros: Complexes, poles: Complexes, unit_at_hz: float) -> StateSpace:
    """Real modal form of a strictly proper function with given zeros and distinct poles.

    It is scaled to a magnitude of 1 at one frequency, with a positive real part there.

    Args:
        zeros: Zeros, rad/s, shape (zeros,); complex ones in conjugate pairs.
        poles: Poles, likewise.
        unit_at_hz: The frequency at which the magnitude is 1, Hz.

    Raises:
        ValueError: Where it is not strictly proper, two poles coincide, or it vanishes at that frequency.
    """
    if zeros.size >= poles.size:
        raise ValueError(f"{counted(zeros.size, 'zero')} over {counted(poles.size, 'pole')}: not strictly proper")
    distance = np.abs(poles[:, None] - poles[None, :]) + np.diag(np.full(poles.size, np.inf))
    if poles.size > 1 and np.min(distance / np.abs(poles)[:, None].clip(1e-300)) < 1e-9:
        raise ValueError("two poles coincide: the transfer function has no modal form")
    at = 2j * np.pi * unit_at_hz
    scale = float(np.exp(np.mean(np.log(np.abs(poles)))))  # keeps the products within range
    there = np.prod((at - zeros) / scale) / np.prod((at - poles) / scale)
    if there == 0.0:
        raise ValueError(f"the transfer function vanishes at {unit_at_hz:g} Hz and cannot be divided by its gain there")
    gain = np.copysign(1.0, there.real) / np.abs(there)
    residues = [
        scale * gain * np.prod((p - zeros) / scale) / np.prod((p - np.delete(poles, i)) / scale)
        for i, p in enumerate(poles)
    ]
    return modal_from_residues(poles, np.asarray(residues))


def modal_from_residues(poles: Complexes, residues: Complexes) -> StateSpace:
    """Sum of residue/(s - pole), conjugate pairs as real 2x2 blocks.

    Args:
        poles: Poles, rad/s, shape (poles,); complex ones in conjugate pairs.
        residues: Residue at each of them, likewise.
    """
    order = poles.size
    A, B, C = np.zeros((order, order)), np.zeros((order, 1)), np.zeros((1, order))
    row = 0
    for p, r in sorted(zip(poles, residues, strict=True), key=lambda mode: -abs(mode[0])):
        if abs(p.imag) <= 1e-12 * abs(p):
            A[row, row], B[row, 0], C[0, row] = p.real, 1.0, r.real
            row += 1
        elif p.imag > 0:
            A[row : row + 2, row : row + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            B[row, 0] = 1.0
            C[0, row : row + 2] = 2 * r.real, 2 * r.imag
            row += 2
    return StateSpace(A, B, C, np.zeros((1, 1)))


def modal_matrix(modes: Sequence[tuple[float, float]]) -> Floats:
    """Block-diagonal A with a block [[s, -w], [w, s]] for each mode, or s alone where w is 0.

    Args:
        modes: Real part s and imaginary part w of each mode, in 1/s and rad/s.
    """
    states = sum(2 if w else 1 for _, w in modes)
    A, row = np.zeros((states, states)), 0
    for s, w in modes:
        A[row, row] = s
        if w:
            A[row + 1, row + 1], A[row, row + 1], A[row + 1, row] = s, -w, w
        row += 2 if w else 1
    return A


def frequency_response(system: StateSpace, freq_hz: Floats, step_s: float | None = None) -> Complexes:
    """Response C (s - A)^-1 B + D, shape (frequencies, outputs, inputs).

    s is 2 pi i f for a continuous system, and exp(2 pi i f step) for a discrete one.

    Args:
        system: The system.
        freq_hz: Frequencies, Hz, shape (frequencies,).
        step_s: Sample time of a discrete system, s; None for a continuous one.
    """
    s = 2j * np.pi * np.atleast_1d(freq_hz)
    points = s if step_s is None else np.exp(s * step_s)
    resolvent = points[:, None, None] * np.eye(system.order) - system.A
    return np.asarray(
        system.C @ np.linalg.solve(resolvent, np.broadcast_to(system.B, (s.size, *system.B.shape))) + system.D
    )


def resolvent_rows(A: Floats, C: Floats, points: Complexes) -> Complexes:
    """C (z - A)^-1 of several systems of one order at points z, shape (systems, rows of C, states, points).

    By forward substitution in their Schur forms A = U T U', all points at once: the rows r (z - T) = C U, then r U'.
    States in volts beside states in radians cost Schur's rotations the digits of the small ones: they are scaled first,
    by powers of 2 that make rows and columns of A alike, and the rows are corrected once by what they leave of C.

    Args:
        A: Matrices of the systems, shape (systems, states, states).
        C: What their outputs show of the states, shape (systems, rows, states).
        points: The points z, shape (points,).
    """
    from scipy.linalg.lapack import dgebal, zgees

    (several, order), outputs = A.shape[:2], C.shape[1]
    balanced, scale = np.empty_like(A), np.empty((several, order))
    T, U = np.empty(A.shape, dtype=complex), np.empty(A.shape, dtype=complex)
    for i, matrix in enumerate(A):
        balanced[i], _, _, scale[i], _ = dgebal(matrix, scale=1, permute=0)
        T[i], _, _, U[i], _, _ = zgees(lambda value: None, balanced[i])
    wide = np.tile(points, outputs)  # one row of C behind the other
    near = 1.0 / (points - np.diagonal(T, axis1=1, axis2=2)[..., None])
    near = np.tile(near, outputs)
    forward, back, across = np.swapaxes(U, 1, 2), U.conj(), np.swapaxes(balanced, 1, 2)

    def rows(right: Complexes) -> Complexes:
        start = forward @ right
        found = np.empty(near.shape, dtype=complex)
        for j in range(order):
            found[:, j] = (start[:, j] + (T[:, None, :j, j] @ found[:, :j])[:, 0]) * near[:, j]
        return np.asarray(back @ found)

    whole = np.repeat(np.swapaxes(C * scale[:, None], 1, 2), points.size, axis=2)
    first = rows(whole.astype(complex))
    second = (first + rows(whole - (first * wide - across @ first))) / scale[..., None]
    return second.reshape(several, order, outputs, points.size).swapaxes(1, 2)


def zeros(system: StateSpace) -> Complexes:
    """Finite invariant zeros of a square system: where [[A - s, B], [C, D]] loses rank."""
    from scipy.linalg import eig

    n = system.order
    pencil = np.block([[system.A, system.B], [system.C, system.D]])
    mass = np.zeros_like(pencil)
    mass[:n, :n] = np.eye(n)
    scale = max(float(np.max(np.abs(system.A), initial=0.0)), 1e-300)
    above, below = eig(pencil, scale * mass, right=False, homogeneous_eigvals=True)
    finite = np.abs(below) > 1e-10 * np.abs(above)
    return np.asarray(scale * above[finite] / below[finite])


def first_order_hold(A: Floats, B: Floats, step_s: float) -> tuple[Floats, Floats, Floats]:
    """Exact step for an input linear over it: x[k+1] = Ad x[k] + B0 u[k] + B1 u[k+1]; returns Ad, B0, B1.

    Args:
        A: Matrix of the continuous system, shape (..., states, states).
        B: Its input matrix, shape (..., states, inputs).
        step_s: The step, s.
    """
    from scipy.linalg import expm

    n, m = B.shape[-2:]
    block = np.zeros((*A.shape[:-2], n + 2 * m, n + 2 * m))
    block[..., :n, :n], block[..., :n, n : n + m] = A * step_s, B * step_s
    block[..., n : n + m, n + m :] = np.eye(m)
    e = expm(block)
    ramp = e[..., :n, n + m :]
    return e[..., :n, :n], e[..., :n, n : n + m] - ramp, ramp


def zero_order_hold(A: Floats, B: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Exact step for an input held over it: x[k+1] = Ad x[k] + Bd u[k]; returns Ad, Bd.

    Args:
        A: Matrix of the continuous system, shape (states, states).
        B: Its input matrix, shape (states, inputs).
        step_s: The step, s.
    """
    Ad, B0, B1 = first_order_hold(A, B, step_s)
    return Ad, B0 + B1


def series(first: StateSpace, second: StateSpace) -> StateSpace:
    """The two systems one behind the other.

    Args:
        first: The one nearest the input.
        second: The one behind it, with as many inputs as the first has outputs; both continuous or both of one sample
            time.
    """
    n1, n2 = first.order, second.order
    A, B = np.zeros((n1 + n2, n1 + n2)), np.empty((n1 + n2, first.B.shape[1]))
    C = np.empty((second.C.shape[0], n1 + n2))
    A[:n1, :n1], A[n1:, :n1], A[n1:, n1:] = first.A, second.B @ first.C, second.A
    B[:n1], B[n1:] = first.B, second.B @ first.D
    C[:, :n1], C[:, n1:] = second.D @ first.C, second.C
    return StateSpace(A, B, C, second.D @ first.D)


def feedback_poles(loop: StateSpace) -> Complexes:
    """Poles of the loop closed with unit negative feedback around ``loop`` (square)."""
    closing = np.linalg.inv(np.eye(loop.D.shape[0]) + loop.D)
    return np.asarray(np.linalg.eigvals(loop.A - loop.B @ closing @ loop.C))


def growth_1_s(A: Floats, E: Floats, F: Floats, gains: Floats) -> float:
    """Largest real part of a pole of x' = (A + E K F) x, each gain in the diagonal K either 0 or as given.

    The gain of plays that slide is the sum of their weights, that of stuck ones 0: above 0 a large drive starts what no
    drive stops. All combinations are tried for up to `_MOST_COMBINED` gains, and all and none beyond.

    Args:
        A: Shape (states, states).
        E: What each element does to the states, shape (states, elements).
        F: What drives each element, shape (elements, states).
        gains: Gain of each element where it slides, shape (elements,).
    """
    sliding = A + (E * (sliding_cases(gains.size) * gains)[:, None, :]) @ F
    return float(np.linalg.eigvals(sliding).real.max())


def sliding_cases(elements: int) -> Floats:
    """Which elements slide (1) or are stuck (0), shape (cases, elements); see `growth_1_s` for which cases."""
    if elements > _MOST_COMBINED:
        return np.array([[0.0] * elements, [1.0] * elements])
    return np.array(list(product((0.0, 1.0), repeat=elements))).reshape(2**elements, elements)


def gramian(A: Floats, Q: Floats) -> Floats:
    """Solution X = A' X A + Q of the discrete Lyapunov equation, of the shape of Q.

    With A' in place of A it is the stationary covariance of x[k+1] = A x[k] + noise of covariance Q.

    Doubling: X is the sum of A'^k Q A^k, and each iteration doubles the number of its terms, so a time constant of 1e5
    samples takes some 22 of them. Source: Smith, SIAM Journal on Applied Mathematics 16 (1968) 198.

    Args:
        A: The matrix, shape (states, states), stable; states that turn without damping may stand beside the stable ones
            where Q has nothing of them. Or a stack of matrices.
        Q: One symmetric matrix, shape (states, states), or a stack of them, for each A its own where both are stacks.
    """
    X, power = Q, A
    for _ in range(64):
        more = power.mT @ X @ power
        X = X + more
        if not np.any(_diagonal(more) > 1e-15 * np.abs(_diagonal(X))):  # rounding leaves values below 0
            break
        power = power @ power
    return X


def reduced(system: StateSpace, error: float) -> StateSpace:
    """A discrete system of lower order whose slow gain is the same: balanced states, the least of them at rest.

    The order is the lowest with which twice the sum of the Hankel singular values that are left out, which bounds the
    error of the response at every frequency, is below ``error``. Source: Liu and Anderson, International Journal of
    Control 50 (1989) 1379 (singular perturbation of balanced realisations).

    Args:
        system: The system, discrete and stable.
        error: Bound on the error of the response, in the unit of its gain.
    """
    reach = covariance_root(gramian(system.A.T, system.B @ system.B.T))
    seen = covariance_root(gramian(system.A, system.C.T @ system.C))
    left, values, right = np.linalg.svd(seen.T @ reach)
    rest = np.append(2.0 * np.cumsum(values[::-1])[::-1], 0.0)
    order, whole = int(np.argmax(rest <= error)), int(np.sum(values > 1e-12 * np.max(values, initial=0.0)))
    scale = 1.0 / np.sqrt(values[:whole])
    into, back = reach @ right[:whole].T * scale, (seen @ left[:, :whole] * scale).T
    A, B, C = back @ system.A @ into, back @ system.B, system.C @ into
    kept, still = slice(0, order), slice(order, whole)
    settled = np.linalg.inv(np.eye(whole - order) - A[still, still])
    return StateSpace(
        A[kept, kept] + A[kept, still] @ settled @ A[still, kept],
        B[kept] + A[kept, still] @ settled @ B[still],
        C[:, kept] + C[:, still] @ settled @ A[still, kept],
        system.D + C[:, still] @ settled @ B[still],
    )


def _diagonal(X: Floats) -> Floats:
    return np.diagonal(X, axis1=-2, axis2=-1)


def to_bits(values: Floats, bits: int) -> Floats:
    """The values rounded to a number of significant bits, above the last ones, in which processors may differ.

    Args:
        values: The values, of any shape.
        bits: Significant bits that are kept.
    """
    share, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(share * 2.0**bits) / 2.0**bits, exponent))


def decay_to_bits(factors: Floats, bits: int) -> Floats:
    """Decay factors of a step, rounded by what is lost in it, so that a slow state keeps its time constant.

    Down to 2^-44 of the state, which is as much above the rounding of the factor itself.

    Args:
        factors: What is left of each state after a step, as a share, of any shape.
        bits: Significant bits that are kept of what is lost.
    """
    return np.asarray(1.0 - np.round(to_bits(1.0 - factors, bits) * 2.0**44) / 2.0**44)


def system_to_bits(system: StateSpace, bits: int) -> StateSpace:
    """The system with its four matrices rounded to a number of significant bits.

    Args:
        system: The system.
        bits: Significant bits that are kept of each entry.
    """
    return StateSpace(*(to_bits(matrix, bits) for matrix in (system.A, system.B, system.C, system.D)))


def covariance_root(matrix: Floats) -> Floats:
    """Lower triangular R with R R' the positive semidefinite matrix; a column is 0 where a state adds nothing.

    Cholesky's factor, row by row, its scale removed first so that small states keep their digits. Unlike a root from
    eigenvectors it is the only one with a diagonal of no sign but plus: what is drawn through it is the same on every
    machine. A pivot below `_NO_PIVOT` of its state's variance is rounding.
    """
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    product = np.outer(scale, scale)
    unit = np.where(product > 0.0, matrix, 0.0) / np.where(product > 0.0, product, 1.0)
    root = np.zeros_like(unit)
    for j in range(unit.shape[0]):
        column = unit[j:, j] - root[j:, :j] @ root[j, :j]
        if column[0] > _NO_PIVOT:
            root[j:, j] = column / np.sqrt(column[0])
    return np.asarray(scale[:, None] * root)


_NO_PIVOT = 1e-12
"""Rounding leaves some 1e-15 of a state's variance; the root of what is cut off is a millionth of its deviation."""


def principal_axes(covariance: Floats) -> tuple[Floats, Floats]:
    """Variances, rising, and principal axes (columns) of a covariance, the same on every machine.

    Each axis points to where its largest entry is above 0. Correlations below `_UNCORRELATED` count as none and
    variances that agree as closely count as equal: without that, axes of two like states would be wherever rounding
    leaves them.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    limit = _UNCORRELATED * np.outer(size, size)
    if np.all(np.abs(covariance - np.diag(np.diag(covariance))) <= limit):
        digits = round(-np.log10(_UNCORRELATED))
        largest = float(np.max(np.diag(covariance), initial=0.0)) or 1.0
        order = np.argsort(np.round(np.diag(covariance) / largest, digits), kind="stable")
        return np.diag(covariance)[order], np.eye(size.size)[:, order]
    values, vectors = np.linalg.eigh(covariance)
    large = np.abs(vectors) > 0.99 * np.max(np.abs(vectors), axis=0)
    first = np.argmax(large, axis=0)  # of entries of one size the first, or rounding would choose
    return values, vectors * np.sign(vectors[first, np.arange(size.size)])


_UNCORRELATED = 1e-9
