"""What NASA-STD-7009B wants a report to warn of, found in this installation, with what it does to the results."""

from collections.abc import Iterator
from dataclasses import dataclass

from microrad.report.verification.findings import Verification
from microrad.report.verification.standard import requirements

OCCURRENCES = {
    "a": "acceptance criteria that are not met",
    "b": "assumptions that are violated",
    "c": "limits that are exceeded",
    "d": "warnings and errors of the run",
    "e": "unfavourable assessment of the use",
    "f": "issues of setup and use",
    "g": "waivers",
    "h": "known defects",
}


@dataclass(frozen=True, slots=True)
class Warned:
    """An occurrence, one of `OCCURRENCES` by its letter, and its impact on the results."""

    letter: str
    found: str
    impact: str


def warnings(v: Verification) -> list[Warned]:
    """At least one for each occurrence; where there is none, that is said.

    Args:
        v: What was found of this installation.
    """
    found = list(_found(v))
    seen = {each.letter for each in found}
    found += [Warned(letter, "None found.", "") for letter in OCCURRENCES if letter not in seen]
    return sorted(found, key=lambda each: each.letter)


def _found(v: Verification) -> Iterator[Warned]:
    for o in v.outcomes:
        missed = [c.what or c.quantity for c in o.comparisons if not c.holds]
        if missed:
            impact = "What it compares is wrong, or the check is: quantities of status failed are not to be used."
            yield Warned("a", f"{o.check.name}: beyond tolerance: {', '.join(missed)}.", impact)
        if o.trouble:
            yield Warned(
                "d", f"{o.check.name} did not run: {o.trouble}.", "What it alone compares is not founded here."
            )
    yield Warned(
        "a",
        "Tolerances of comparisons are the only criteria. There are none for uncertainty, sensitivities and levels of"
        " credibility (M&S 43).",
        "That all comparisons hold does not say that a result is good enough for a decision.",
    )
    yield Warned(
        "b", "Not assessed: an installation has no mission.", "Assumptions lists what follows where one does not hold."
    )
    yield Warned(
        "c",
        "Of an installation none. A mission's report names each input beyond a domain.",
        "Figures that depend on such an input are extrapolated, and their error is not known.",
    )
    yield Warned("e", "No use was assessed.", "Whether the numbers suit a decision is open until its owner has judged.")
    yield from _setup(v)
    unmet = ", ".join(map(str, sorted(number for r in requirements() if r.stands == "open" for number in r.numbers)))
    yield Warned(
        "g",
        f"None was granted: there is no authority that could. Not met are M&S {unmet}.",
        "A programme that has to meet them cannot rely on these results without a waiver of its own.",
    )
    if v.bare:
        yield Warned(
            "h",
            "1 quantity was compared with nothing and has no source."
            if len(v.bare) == 1
            else f"{len(v.bare)} quantities were compared with nothing and have no source.",
            "An error in them would not be found here. A mission's report marks them.",
        )
    yield Warned(
        "h",
        "Defects are known here by comparisons that fail. No list of open ones comes with the package.",
        "One that no comparison sees is not in this report.",
    )


def _setup(v: Verification) -> Iterator[Warned]:
    if not v.integrity.whole:
        impact = "The numbers may be others than those of the release."
        yield Warned("f", v.integrity.text, impact)
    absent = [o.check.name for o in v.outcomes if o.absent]
    if absent:
        impact = "What they alone measure is not validated here; what was found at the release is told in its place."
        yield Warned("f", f"Recordings are not at hand for {', '.join(absent)}.", impact)
    if v.other_recordings:
        impact = "What they are compared with is not what the release was; its errors and domains are not theirs."
        yield Warned("f", f"Not the recordings of the release: {', '.join(v.other_recordings)}.", impact)
