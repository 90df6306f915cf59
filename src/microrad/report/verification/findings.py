"""What a verification found: outcomes of all checks, and the status of every registered quantity."""

import os
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from microrad.core.integrity import Integrity, integrity
from microrad.core.progress import Progress
from microrad.report.foundation import shipped
from microrad.report.registry import Quantity, Status, quantities, quantity_of
from microrad.report.verification.check import Check, Outcome, run
from microrad.report.verification.checks import every
from microrad.report.verification.checks.measured import OTHER, held_recordings
from microrad.report.verification.credibility import Factor, factors
from microrad.report.verification.dependences import dependences
from microrad.report.verification.evidence import Referent
from microrad.report.verification.recorded import recorded
from microrad.report.verification.sweeps import swept
from microrad.report.verification.workspace import Workspace


@dataclass(frozen=True, slots=True)
class Standing:
    """A quantity with its status, and the names of the checks that compared it."""

    quantity: Quantity
    status: Status
    checks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Verification:
    """All that was found of this installation.

    Args:
        outcomes: Of each check that was run.
        standings: Of each registered quantity that is a result.
        integrity: Of the package's files.
        full: Whether the domains were swept here.
        domains: Of each part of the chain, those of a full run, else those of the release.
        depends: For each kind of figure the swept inputs that move it, likewise.
        recordings: What recordings excited on which mirror models were compared, likewise; of those that are not here,
            those of the release.
        files: How each recording that can be compared stands to the one of the release.
    """

    outcomes: Sequence[Outcome]
    standings: Sequence[Standing]
    integrity: Integrity
    full: bool
    domains: Mapping[str, Any]
    depends: Mapping[str, Sequence[str]]
    recordings: Mapping[str, Any]
    files: Mapping[str, str]

    @property
    def other_recordings(self) -> Sequence[str]:
        """Recordings that are here, and are not those of the release."""
        return [name for name, stands in self.files.items() if stands == OTHER]

    @property
    def bare(self) -> Sequence[str]:
        """Titles of the quantities that were neither compared nor sourced."""
        return [each.quantity.title for each in self.standings if each.status is Status.NONE]

    @property
    def counts(self) -> Mapping[Status, int]:
        """Quantities by status."""
        found = Counter(each.status for each in self.standings)
        return {status: found[status] for status in Status}

    @property
    def by_subject(self) -> Mapping[str, Mapping[str, int]]:
        """Quantities by subject and status."""
        found: dict[str, Counter[str]] = {}
        for each in self.standings:
            found.setdefault(each.quantity.subject, Counter())[each.status.value] += 1
        return {subject: dict(sorted(counts.items())) for subject, counts in found.items()}

    @property
    def founded(self) -> float:
        """Share of the quantities that are verified or better."""
        return (self.counts[Status.VALIDATED] + self.counts[Status.VERIFIED]) / len(self.standings)

    @property
    def named(self) -> Sequence[Outcome]:
        """The named comparisons with measurements and published output that hold."""
        return [o for o in self.outcomes if o.holds and o.check.referent is not Referent.INDEPENDENT]

    @property
    def holds(self) -> bool:
        """Whether all evidence that could be run holds."""
        return all(o.holds or o.absent for o in self.outcomes)

    @property
    def factors(self) -> Sequence[Factor]:
        """Of credibility."""
        measured = sum(o.check.referent is Referent.MEASUREMENT for o in self.named)
        return factors(self.counts, self.holds, self.integrity.whole, measured, len(self.named) - measured)

    @property
    def ok(self) -> bool:
        """Whether all evidence holds and the files are those that were recorded."""
        return self.holds and self.integrity.whole


def verify(*, full: bool = False, on_progress: Progress = lambda done, total, what: None) -> Verification:
    """Run all evidence in this installation.

    Args:
        full: Whether the domains are swept, too.
        on_progress: Is told how far it is.
    """
    chosen = every()
    named = os.environ.get("MICRORAD_DATA")
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="microrad-verify-") as folder:
        workspace = Workspace(Path(folder), Path(named) if named else None)
        for place, check in enumerate(chosen):
            on_progress(place, len(chosen), check.title)
            outcomes.append(run(check, workspace))
        on_progress(len(chosen), len(chosen), "done")
        measured = shipped()["recordings"] | (recorded(workspace, outcomes) if full else {})
        files = held_recordings(workspace)
    if not full:
        return found(outcomes, integrity(), full, shipped()["domains"], shipped()["depends"], measured, files)
    domains, depends = swept(on_progress=on_progress), dependences(on_progress=on_progress)
    return found(outcomes, integrity(), full, domains, depends, measured, files)


def found(
    outcomes: Sequence[Outcome],
    package: Integrity,
    full: bool,
    domains: Mapping[str, Any],
    depends: Mapping[str, Sequence[str]] = MappingProxyType({}),
    recordings: Mapping[str, Any] = MappingProxyType({}),
    files: Mapping[str, str] = MappingProxyType({}),
) -> Verification:
    """What the outcomes of checks come to.

    Args:
        outcomes: Of each check that was run.
        package: What its files were held against.
        full: Whether the domains were swept here.
        domains: Of each part of the chain.
        depends: For each kind of figure the swept inputs that move it.
        recordings: What recordings excited on which mirror models were compared.
        files: How each recording that can be compared stands to the one of the release.
    """
    standings = tuple(_standing(q, outcomes) for q in quantities() if not q.given)
    return Verification(outcomes, standings, package, full, domains, depends, recordings, files)


def _standing(quantity: Quantity, outcomes: Sequence[Outcome]) -> Standing:
    """The best that any of its comparisons gives; one that does not hold spoils all."""
    by: dict[str, tuple[Check, bool]] = {}
    for outcome in outcomes:
        own = [c for c in outcome.comparisons if quantity_of(c.quantity) is quantity]
        if own:
            by[outcome.check.name] = outcome.check, all(c.holds for c in own)
    if any(not holds for _, holds in by.values()):
        status = Status.FAILED
    elif any(check.referent is Referent.MEASUREMENT for check, _ in by.values()):
        status = Status.VALIDATED
    elif by:
        status = Status.VERIFIED
    else:
        status = Status.TRACED if quantity.source else Status.NONE
    return Standing(quantity, status, tuple(by))
