"""Whether an output moves no farther than a mirror can: a wrong unit is found before anything is fitted."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from microrad.core.units import format_quantity
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording
from microrad.mission.tables.mirror import ANGLE_MOST

_RADIANS = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6}
_METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6}


def check_travel(
    recordings: Sequence[Recording],
    output_unit: str,
    lever_arm_m: float | None = None,
    positions_m: Sequence[tuple[float, float]] | None = None,
) -> None:
    """Check that each output stays within the quarter turn that a mirror file holds.

    A displacement is judged by its tilt over the lever arm, or over the largest distance between the positions of
    several; where neither is known it is not judged, nor is a unit that is not known.

    Args:
        recordings: The recordings, outputs in `output_unit`.
        output_unit: rad, mrad, urad, m, mm or um.
        lever_arm_m: Distance from the axis of rotation to the point measured, in m, where there is one.
        positions_m: Where each output is measured on the mirror, (x, y) in m; None where that is not known.

    Raises:
        IdentificationError: If an output moves farther, naming file and output.
    """
    arm_m = lever_arm_m or _largest_distance_m(positions_m or ())
    scale = _RADIANS.get(output_unit) or (_METRES[output_unit] / arm_m if arm_m and output_unit in _METRES else 0.0)
    for recording in recordings:
        for name, moved in zip(recording.output_names, np.ptp(recording.output, axis=0).tolist(), strict=True):
            if moved * scale > ANGLE_MOST:
                over = f" over {format_quantity(arm_m, 'm')}" if output_unit in _METRES else ""
                raise IdentificationError(
                    f"{recording.path}: the output '{name}' moves by {moved:.4g} {output_unit}{over}, a tilt of "
                    f"{moved * scale:.4g} rad, and no mirror turns by more than {ANGLE_MOST:.4g} rad (a quarter turn); "
                    "correct the unit of the output (--output-unit, output_unit)"
                    f"{' or what it stands over (--lever-arm, --position)' if over else ''}."
                )


def _largest_distance_m(positions_m: Sequence[tuple[float, float]]) -> float:
    return max((math.dist(a, b) for a, b in itertools.combinations(positions_m, 2)), default=0.0)
