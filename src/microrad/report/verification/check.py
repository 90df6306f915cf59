"""A check with the comparisons that it makes, and what came of it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from microrad.report.verification.evidence import Comparison, NotHereError, Referent
from microrad.report.verification.workspace import Workspace


@dataclass(frozen=True, slots=True)
class Check:
    """A named piece of evidence, run where the report is made.

    Args:
        name: Short and unique, for other pages to lead to.
        title: What is compared with what.
        referent: What kind of thing it is compared with.
        method: How the expected figures come about, and why that is independent.
        source: Who has them: paper, standard, data.
        run: The comparisons; it raises `NotHereError` where something that it needs is not on this machine.
    """

    name: str
    title: str
    referent: Referent
    method: str
    source: str
    run: Callable[[Workspace], Iterator[Comparison]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a check gave: its comparisons, or why there are none."""

    check: Check
    comparisons: Sequence[Comparison]
    trouble: str = ""
    absent: str = ""

    @property
    def holds(self) -> bool:
        """Whether it ran and each of its comparisons holds."""
        return bool(self.comparisons) and not self.trouble and all(c.holds for c in self.comparisons)


def run(check: Check, workspace: Workspace) -> Outcome:
    """Run a check; whatever goes wrong in it is part of the outcome.

    Args:
        check: What to run.
        workspace: The documents that all checks read.
    """
    try:
        found = tuple(check.run(workspace))
    except NotHereError as error:
        return Outcome(check, (), absent=str(error))
    except Exception as error:  # a broken installation may raise anything, and that is what is looked for
        reason = next(iter(str(error).splitlines()), "")
        return Outcome(check, (), trouble=f"{type(error).__name__}: {reason}")
    return Outcome(check, found, trouble="" if found else "it compared nothing")
