"""Domains of the evidence: missions around the shipped one, drawn far and wide, for which it holds as well."""

import math
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.errors import MicroradError
from microrad.core.progress import Progress
from microrad.report.verification.check import Check, run
from microrad.report.verification.checks import every
from microrad.report.verification.workspace import Workspace

_SEED = 20_260_104


@dataclass(frozen=True, slots=True)
class Sweep:
    """Inputs that are changed together, each by its own factor, and the checks that are held against each draw.

    Args:
        part: Of the chain, as the domain names it.
        checks: Their names.
        factors: Smallest and largest factor by dotted key of the mission.
        draws: How many missions are drawn.
    """

    part: str
    checks: tuple[str, ...]
    factors: Mapping[str, tuple[float, float]]
    draws: int


SWEEPS = (
    Sweep(
        "The links",
        ("budgets", "tornado", "tracking", "point-ahead"),
        {
            "terminals.leo_aperture": (0.2, 6.0),
            "terminals.geo_aperture": (0.2, 6.0),
            "communication.transmit_power": (0.02, 20.0),
            "communication.distance": (0.005, 3.0),
            "communication.data_rate": (0.01, 30.0),
            "communication.pointing_error": (0.02, 2.0),
            "communication.receiver_sensitivity": (0.1, 20.0),
            "beacon.transmit_power": (0.02, 20.0),
            "beacon.divergence": (0.3, 4.0),
            "beacon.pointing_error": (0.1, 1.5),
            "answer.transmit_power": (0.05, 20.0),
            "answer.divergence": (0.5, 4.0),
        },
        40,
    ),
    Sweep(
        "Totals of the pointing budget",
        ("pointing-totals",),
        {
            "pointing.lines.body_pointing.error": (0.1, 3.0),
            "pointing.lines.orbit_knowledge.error": (0.1, 5.0),
            "pointing.lines.misalignment.error": (0.1, 5.0),
            "beacon.divergence": (0.7, 3.0),
        },
        40,
    ),
    Sweep(
        "Passes, volumes and the loop",
        ("passes", "queue", "margins", "residuals"),
        {
            "orbit.leo.altitude": (0.8, 1.8),
            "orbit.leo.local_time": (0.6, 2.0),
            "operations.instrument_rate": (0.1, 3.0),
            "fine_pointing.amplifier_bandwidth": (0.6, 2.0),
            "answer.transmit_power": (0.5, 4.0),
        },
        6,
    ),
)


def changed(text: str, factors: Mapping[str, float]) -> str:
    """The text of a mission with some of its values multiplied.

    Args:
        text: The mission.
        factors: By dotted key, each of a table that stands under its own heading.

    Raises:
        KeyError: For a key that the text does not have.
    """
    for key, factor in factors.items():
        table, _, name = key.rpartition(".")
        begin = text.index(f"\n[{table}]\n")
        end = text.find("\n[", begin + 2)
        part = text[begin : end if end >= 0 else len(text)]
        found = re.search(rf'^{name} = "([^" ]+) ([^"]+)"', part, re.MULTILINE)
        if found is None:
            raise KeyError(key)
        value = f'{name} = "{float(found[1]) * factor:.6g} {found[2]}"'
        text = text[:begin] + part.replace(found[0], value, 1) + text[begin + len(part) :]
    return text


def swept(sweeps: Sequence[Sweep] = SWEEPS, on_progress: Progress = lambda done, total, what: None) -> dict[str, Any]:
    """The domain of each part: between which values of each input all of its checks held.

    The draws are ordered by how far they are from the shipped mission, as a share of the sweep. The domain ends before
    the first that does not hold. A mission that is refused is no draw.

    Args:
        sweeps: What is changed.
        on_progress: Is told how far it is.
    """
    by_name = {check.name: check for check in every()}
    found: dict[str, Any] = {}
    total, done = sum(sweep.draws for sweep in sweeps), 0
    for sweep in sweeps:
        draw, draws, shares = np.random.default_rng(_SEED), [], np.empty(0)
        for place in range(sweep.draws):  # in pairs on both sides of the shipped mission
            shares = -shares if place % 2 else draw.uniform(-1.0, 1.0, len(sweep.factors))
            factors = {
                key: (low**-share if share < 0.0 else high**share)
                for (key, (low, high)), share in zip(sweep.factors.items(), shares.tolist(), strict=True)
            }
            held = _held([by_name[name] for name in sweep.checks], factors)
            if held is not None:
                draws.append((float(np.max(np.abs(shares))), factors, held))
            done += 1
            on_progress(done, total, "domains")
        found[sweep.part] = {"checks": list(sweep.checks), **_domain(draws, sweep.factors)}
    return found


def _held(checks: Sequence[Check], factors: Mapping[str, float]) -> bool | None:
    """Whether all checks hold for the shipped mission with its values multiplied; None where that is refused."""
    with tempfile.TemporaryDirectory(prefix="microrad-verify-") as folder:
        workspace = Workspace(Path(folder), None)
        try:
            workspace.take(changed(workspace.text, factors))
            _ = workspace.links
        except MicroradError:
            return None
        return all(run(each, workspace).holds for each in checks)


def _domain(draws: Sequence[tuple[float, Mapping[str, float], bool]], keys: Iterable[str]) -> dict[str, Any]:
    """Extents of the inputs over the draws nearer than the first that does not hold, with the shipped values."""
    ends = min((share for share, _, holds in draws if not holds), default=math.inf)
    inside = [factors for share, factors, _ in draws if share < ends]
    extents = {}
    with tempfile.TemporaryDirectory(prefix="microrad-verify-") as folder:
        shipped = Workspace(Path(folder), None).given
    for key in keys:
        values = [shipped(key) * factor for factor in (1.0, *(factors[key] for factors in inside))]
        extents[key] = {
            "unit": shipped.unit(key),
            "least": float(f"{min(values):.4g}"),
            "most": float(f"{max(values):.4g}"),
        }
    return {"draws": len(draws), "inside": len(inside), "extents": extents}
