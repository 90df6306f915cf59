"""Designs whose linear figure the mirror keeps: what its hysteresis breaks is tuned anew for a larger margin.

Hysteresis changes the local gain and phase of a mirror with the size of its motion, which no linear margin at one gain
knows. Behind a reversal the gain may be a half of the slow one, or have the wrong sign. What a design leaves is
therefore simulated, and a controller that leaves much more than its linear figure is tuned for a larger distance from
-1. (The spread of the gain alone does not tell: tuned for the gains at rest and at large motions too, LQG and the
observer leave more on a light resonance than without.)
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol, TypeVar

from microrad.core.progress import Progress
from microrad.loop.controller_study import designs, results
from microrad.loop.controller_study.designs import BASELINE, Design
from microrad.loop.controller_study.results import Outlook
from microrad.loop.controller_study.scenario import Scene

SHARES = (0.2, 0.4, 0.6, 0.8)
"""Shares of the way from the mission's modulus margin to 1 that a tuning is tried for."""


class Figure(Protocol):
    """A linear figure beside a simulated one."""

    @property
    def simulated_rad(self) -> float:
        """What is left on the mirror with its hysteresis."""

    @property
    def holds(self) -> bool:
        """Whether the linear figure is a promise."""


_Design = TypeVar("_Design")
_Figure = TypeVar("_Figure", bound=Figure)


def firmer(
    margin: float, tuned: Callable[[float], _Design], judged: Callable[[Sequence[_Design]], Sequence[_Figure]]
) -> tuple[_Design, _Figure] | None:
    """Of the designs for larger margins whose figure is a promise the one that leaves least; None where there is none.

    Args:
        margin: The modulus margin that was too small.
        tuned: Gives the design for a margin, or raises ValueError.
        judged: Simulates designs.
    """
    found = []
    for share in SHARES:
        with suppress(ValueError):  # out of reach
            found.append(tuned(margin + share * (1.0 - margin)))
    kept = [(design, left) for design, left in zip(found, judged(found), strict=True) if left.holds] if found else []
    return min(kept, key=lambda each: each[1].simulated_rad) if kept else None


def design_and_promise(
    scene: Scene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> tuple[tuple[Design, Outlook], ...]:
    """As `designs.design`, each with what it leaves; tuned for a larger margin where its linear figure is no promise.

    A design for which no larger margin helps stays as it is, and so does the baseline.

    Args:
        scene: The mission's fine-pointing loop.
        on_progress: Called with the controllers that are tuned, their number and what is done.
        only: Names out of `names`, in the order that is wanted; by default all, the baseline first.

    Raises:
        ValueError: For a name that `names` does not list, and where a modulus margin cannot be met; says why.
    """
    found = designs.design(scene, on_progress, only)
    left = results.outlook(scene, found, on_progress)
    return tuple(
        (d, figure) if figure.holds or d.name == BASELINE else _firmer(scene, d, on_progress) or (d, figure)
        for d, figure in zip(found, left, strict=True)
    )


def design(
    scene: Scene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> tuple[Design, ...]:
    """The designs of `design_and_promise` alone."""
    return tuple(d for d, _ in design_and_promise(scene, on_progress, only))


def _firmer(scene: Scene, broken: Design, on_progress: Progress) -> tuple[Design, Outlook] | None:
    of = designs.plants(scene, scene.table.seed)

    def tuned(margin: float) -> Design:
        on_progress(0, 1, f"tuning {broken.name} for a larger margin")
        table = scene.table.model_copy(update={"modulus_margin": margin})
        made = designs.tune(broken.name, table, of)
        return replace(broken, tuned=made, controller=designs.build(broken.name, scene, made.controller), margin=margin)

    return firmer(scene.table.modulus_margin, tuned, lambda each: results.outlook(scene, each))
