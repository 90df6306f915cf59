"""The mirror of a mirror file of version 2."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.mirror.coupled.records import Actuator, CoupledMirror, Known, Output
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mission.tables.coupled_mirror import MATRICES, in_order
from microrad.mission.tables.coupled_mirror import CoupledMirror as Table
from microrad.mission.tables.coupled_parts import HysteresisTable, UncertaintyTable

_BY_ELEMENT = {"E": 3, "K": 3, "F": 2, "G": 2}
"""Where the keys of matrix entries count elements: columns of E and K, rows of F and G."""


def of(table: Table) -> CoupledMirror:
    """The mirror of a mirror file of version 2."""
    actuators, outputs, elements = (in_order(each) for each in (table.actuators, table.outputs, table.hysteresis))
    order = sorted(range(len(elements)), key=lambda e: elements[e].model == "plays")  # Bouc-Wen elements come first
    matrices: dict[str, Any] = {name: _matrix(table, name) for name in MATRICES}
    matrices |= {name: matrices[name][:, order] for name in "EK"} | {name: matrices[name][order] for name in "FG"}
    mirror = Mirror(
        name=table.name,
        A=lti.modal_matrix(() if table.modes is None else table.modes.roots),
        **matrices,
        bouc_wen=tuple(_bouc_wen(each) for each in elements if each.model == "bouc-wen"),
        plays=tuple(_play(each) for each in elements if each.model == "plays"),
        inverse=(),
    )
    recording = table.recording
    return CoupledMirror(
        mirror=mirror,
        actuators=tuple(Actuator(**dict(each)) for each in actuators),
        outputs=tuple(Output(each.name, each.quantity, each.position_m) for each in outputs),
        delay_s=recording.delay_s,
        rate_hz=recording.rate_hz,
        steps_per_sample=recording.steps_per_sample,
        excited_hz=(recording.excited_from_hz, recording.excited_to_hz),
        known=None if table.uncertainty is None else _known(table.uncertainty, order),
    )


def _matrix(table: Table, name: str) -> Floats:
    given, ((rows, _), (columns, _)) = getattr(table.matrices, name), table.shape_of(name)
    return np.zeros((rows, columns)) if given is None else np.array(given)


def _bouc_wen(table: HysteresisTable) -> BoucWen:
    return BoucWen(
        d1_rad_v=table.d1 or 0.0,
        d2_s_v=table.d2_s_v or 0.0,
        epsilon_rad_v=table.epsilon or 0.0,
        delta_s_v=table.delta_s_v or 0.0,
        alpha_1_v=table.alpha_1_v or 0.0,
        beta_1_v=table.beta_1_v or 0.0,
        rate_limit_v_s=math.inf if table.rate_limit_v_s is None else table.rate_limit_v_s,
        bias_v=table.bias_v or 0.0,
        gamma_1_v=table.gamma_1_v or 0.0,
        eta_1_v=table.eta_1_v or 0.0,
        exponent=table.exponent or 1.0,
    )


def _play(table: HysteresisTable) -> PrandtlIshlinskii:
    limit = math.inf if table.rate_limit_v_s is None else table.rate_limit_v_s
    quadratic, signed, cubic = table.polynomial or (0.0, 0.0, 0.0)
    reach = math.inf if table.reach_v is None else table.reach_v
    plays = table.thresholds_v or (), table.weights or ()
    return PrandtlIshlinskii(*plays, table.widening_s or 0.0, limit, (quadratic, signed, cubic), reach)


def _known(table: UncertaintyTable, order: Sequence[int]) -> Known:
    """What is known, with elements counted as the mirror has them: ``order`` says which of the file's stands there."""
    if table.factor is not None:
        factor = np.array(table.factor)
    else:
        factor = lti.covariance_root(table.correlation_matrix)
        factor /= np.linalg.norm(factor, axis=1, keepdims=True)
    own = {str(of + 1): str(place + 1) for place, of in enumerate(order)}
    return Known(tuple(_counted(name, own) for name in table.parameters), np.array(table.standard_errors), factor)


def _counted(parameter: str, own: Mapping[str, str]) -> str:
    """The parameter with its element, if it has one, by its number in the mirror in place of that in the file."""
    parts = parameter.split(".")
    if parts[0] == "hysteresis":
        parts[1] = own[parts[1]]
    elif parts[0] == "matrices" and parts[1] in _BY_ELEMENT:
        at = _BY_ELEMENT[parts[1]]
        parts[at] = own[parts[at]]
    return ".".join(parts)
