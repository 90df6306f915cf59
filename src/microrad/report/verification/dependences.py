"""Which printed figures depend on which inputs: those that move where one input is changed by itself."""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from microrad.core.kept import Kept
from microrad.core.progress import Progress
from microrad.report.registry import kind_of
from microrad.report.verification.sweeps import SWEEPS, Sweep, changed
from microrad.report.verification.workspace import Workspace

_STEP = 0.2  # power of a sweep's factor: far enough to move counts, near enough that the links still close
_SAME = 1e-9  # of a number: what is closer has not moved
_DOCUMENTS = "budget", "run"


def dependences(
    sweeps: Sequence[Sweep] = SWEEPS,
    documents: Sequence[str] = _DOCUMENTS,
    on_progress: Progress = lambda done, total, what: None,
) -> dict[str, list[str]]:
    """For each kind of figure of the shipped mission the swept inputs that move it.

    Each input is changed by the fifth root of its largest factor; where that mission is refused, of its smallest.

    Args:
        sweeps: Their inputs are changed, each by itself.
        documents: Those of a `Workspace` that are looked at.
        on_progress: Is told how far it is.
    """
    with tempfile.TemporaryDirectory(prefix="microrad-verify-") as folder:
        return _dependences(sweeps, partial(_numbers, Path(folder), documents), on_progress)


def _dependences(
    sweeps: Sequence[Sweep], numbers_of: Callable[[str, float], dict[str, float] | None], on_progress: Progress
) -> dict[str, list[str]]:
    factors = {key: ends for sweep in sweeps for key, ends in sweep.factors.items()}
    given = numbers_of("", 1.0) or {}
    found: dict[str, list[str]] = {kind_of(name): [] for name in given}
    for done, (key, (low, high)) in enumerate(factors.items()):
        numbers = numbers_of(key, high**_STEP) or numbers_of(key, low**_STEP) or {}
        for kind in {kind_of(name) for name in _moved(given, numbers)}:
            found[kind].append(key)
        on_progress(done + 1, len(factors), "what depends on what")
    return {kind: found[kind] for kind in sorted(found) if kind}


def _moved(one: Mapping[str, float], other: Mapping[str, float]) -> Iterator[str]:
    """Names of the numbers that two documents do not have alike.

    A name that the other one has not is one where others of its kind are there: that of the best controller, or of
    a further contact. A kind that is gone, as all of a link that does not close, says nothing.
    """
    kinds = {kind_of(name) for name in other}
    for name, value in one.items():
        there = other.get(name)
        if there is None:
            if kind_of(name) in kinds:
                yield name
        elif abs(there - value) > _SAME * max(abs(value), abs(there)):
            yield name


def _numbers(folder: Path, documents: Sequence[str], key: str, factor: float) -> dict[str, float] | None:
    """The numbers of the shipped mission with one of its values multiplied; None where that mission is refused."""
    workspace = Workspace(folder, None, Kept(folder))
    try:
        if key:
            workspace.take(changed(workspace.text, {key: factor}))
        return {f"{each}.{name}": value for each in documents for name, value in workspace.numbers(each).items()}
    except ValueError:
        return None
