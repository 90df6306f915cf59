"""From displacements at places that differ from the axes to the tilts of a mirror."""

from collections.abc import Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.mirror.coupled.records import Output
from microrad.mission.tables.coupled_mirror import on_a_line


def tilts_and_piston(outputs: Sequence[Output]) -> Floats:
    """Tilt about x, tilt about y (rad) and piston (m) from the outputs: the matrix, shape (3, outputs), least squares.

    Tilts are small and turn by the right-hand rule about axes through the origin of the positions; a displacement is
    positive along z, out of the mirror's face (x, y and z are right-handed):  d = piston + y tilt_x - x tilt_y.
    Angles, which say nothing of a place, have columns of zeros.

    Args:
        outputs: The outputs, each displacement with its position.

    Raises:
        ValueError: Where a displacement has no position, or the positions do not span the tilts: fewer than three, or
            all on one line.
    """
    places = [output.position_m for output in outputs if output.quantity == "displacement"]
    known = [place for place in places if place is not None]
    if len(known) < max(len(places), 3):
        raise ValueError(
            f"{len(known)} of {len(places)} displacements have a position; two tilts and a piston take at least three, "
            "and the position of each"
        )
    if on_a_line(known):
        raise ValueError("all displacements lie on one line, and a tilt about that line moves none; add one beside it")
    x, y = np.array(known).T
    inverse = np.linalg.pinv(np.column_stack([y, -x, np.ones(x.size)]))
    matrix = np.zeros((3, len(outputs)))
    matrix[:, [i for i, output in enumerate(outputs) if output.quantity == "displacement"]] = inverse
    return matrix
