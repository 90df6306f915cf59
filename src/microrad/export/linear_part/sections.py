"""A controller's linear part in sections: small blocks of states that go on by themselves, side by side.

In this form a step costs a handful of products for each state, poles are entries of the matrix (no polynomial whose
coefficients would have to be exact), and rounding stays in its block. `block_diagonal` says how the blocks are found.
"""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.export.linear_part.block_diagonal import BlockDiagonal
from microrad.export.linear_part.modes import NEAR, Modes, hidden, modes, sizes
from microrad.export.records import ExportError, FlightController

MODAL, TRIANGULAR = "modal", "triangular"
"""Forms: blocks of one and two states alone; or some larger upper quasi-triangular ones beside them."""

SLOW = 0.99
"""Blocks of a larger spectral radius move by little a sample: in single precision they are compensated sums."""

MOST_OUTSIDE = 1e-9
"""Poles further outside the unit circle than this are unstable."""

DUST = 4.0 * float(np.finfo(float).eps)
"""Numbers of a block below this share of its largest are what rounding left of 0."""


@dataclass(frozen=True, slots=True)
class Sections:
    """x[k+1] = A x + B m + L (clip(v) - v), outputs C x + D m, with a block-diagonal A (see FlightController for m, v).

    ``blocks`` are (first state, size). ``form`` is MODAL where A has nothing but its diagonal and what joins the
    neighbours 0 and 1, 2 and 3, ..., else TRIANGULAR. States are scaled by powers of two to sizes near 1 for white
    noise of 1 at each input.
    """

    form: str
    blocks: tuple[tuple[int, int], ...]
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    L: Floats

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def system(self) -> lti.StateSpace:
        """The same without anti-windup (discrete)."""
        return lti.StateSpace(self.A, self.B, self.C, self.D)


def sections(of: FlightController) -> Sections:
    """The controller's linear part in sections: the finest form whose blocks do not cancel each other.

    Integrators are welcome.

    Raises:
        ExportError: For numbers that are not finite, for poles outside the unit circle or repeated ones on it that
            grow, and for modes that no input and no anti-windup drives or that no output shows.
    """
    found = modes(of)
    _refuse_growing(of, found.found)
    if (lack := hidden(found)) is not None:
        raise ExportError(
            f"controller {of.name!r} is not minimal: {lack[0]} its mode with {_pole(of, lack[1])}, so that the code "
            "would compute it for nothing; take a minimal realisation (`microrad.export.linear_part.modes.minimal` "
            "makes one), or take out the filter or input that the mode belongs to"
        )
    return _sections(found, of.system.D)


def compensated_states(form: Sections) -> list[bool]:
    """By state, whether single precision keeps what rounding leaves out of it: slow blocks and integrators."""
    found, A = [False] * form.order, form.A
    for first, size in form.blocks:
        at = slice(first, first + size)
        found[at] = [float(np.max(np.abs(np.linalg.eigvals(A[at, at])))) > SLOW] * size
    return found


# ------------------------------------------------------------------------------------------------------------ refusals
def _pole(of: FlightController, z: complex) -> str:
    return f"|z| = {abs(z):.9g} at {abs(np.angle(z)) / (2.0 * math.pi * of.period_s):.6g} Hz"


def _refuse_growing(of: FlightController, found: BlockDiagonal) -> None:
    for each in found.slices:
        block = found.blocks[each, each].astype(float)
        poles = np.linalg.eigvals(block)
        worst = poles[np.argmax(np.abs(poles))]
        if abs(worst) > 1.0 + MOST_OUTSIDE:
            raise ExportError(
                f"controller {of.name!r} is unstable: it has a pole with {_pole(of, worst)}, and its states would grow "
                "without bound while the loop is open or clipped; lower the gains or bandwidth that it is tuned for"
            )
        if (repeated := _defective(block, poles)) is not None:
            raise ExportError(
                f"controller {of.name!r} has a repeated pole on the unit circle, {_pole(of, repeated)}, whose states "
                "drive each other and grow without bound; keep one integrator (or undamped oscillator) in a chain, or "
                "draw one of the two inside the circle"
            )


def _defective(block: Floats, poles: Complexes) -> complex | None:
    """A repeated eigenvalue on the circle with fewer eigenvectors than its multiplicity, if there is one."""
    for z in poles[np.abs(poles) > 1.0 - NEAR]:
        near = poles[np.abs(poles - z) < NEAR]
        values = np.linalg.svd(block - np.mean(near) * np.eye(len(poles)), compute_uv=False)
        if np.count_nonzero(values < NEAR) < near.size:
            return complex(np.mean(near))
    return None


# --------------------------------------------------------------------------------------------------------- the sections
def _sections(of: Modes, D: Floats) -> Sections:
    A = of.found.blocks.astype(float)
    size = sizes(A, of.driven)
    for at in of.found.slices:
        block = A[at, at]
        if len(block) == 2 and block[1, 0] != 0.0:  # a rotation has one size, so that it stays one
            size[at] = np.max(size[at])
        block[np.abs(block) < DUST * np.max(np.abs(block))] = 0.0
    A = A * size / size[:, None]
    row, column = np.indices(A.shape)
    beyond = (row != column) & ((row ^ 1) != column)
    return Sections(
        form=TRIANGULAR if np.any(A[beyond]) else MODAL,
        blocks=tuple((at.start, at.stop - at.start) for at in of.found.slices),
        A=A,
        B=of.B.astype(float) / size[:, None],
        C=of.C.astype(float) * size,
        D=D.astype(float),
        L=of.L.astype(float) / size[:, None],
    )
