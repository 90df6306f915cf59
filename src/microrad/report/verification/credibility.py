"""The eleven factors of NASA-STD-7009B for what was found here: level, reason, and what the next level needs."""

from collections.abc import Mapping
from dataclasses import dataclass

from microrad.report.quantities import are
from microrad.report.registry import Status
from microrad.report.verification.standard import level_means

STANDARD = "NASA-STD-7009B (2024), appendix E"
SCALE_FROM = (
    "The scale is told in own words. Some of its levels are quoted publicly: of pedigree, verification, validation,"
    " uncertainty, robustness and reviews. The others, and all of use assessment and of process, are by summaries of"
    " others."
)
CAPABILITY, RESULTS = "Capability: what was built", "Results: what it is used for"


@dataclass(frozen=True, slots=True)
class Factor:
    """A factor with its level from 0, no sufficient evidence, to 4."""

    assessment: str
    name: str
    level: int
    reason: str
    next_needs: str

    @property
    def means(self) -> str:
        """What the level stands for by the standard's own scale."""
        return level_means(self.name, self.level)

    @property
    def next_means(self) -> str:
        """What the next level stands for."""
        return level_means(self.name, self.level + 1) if self.level < 4 else ""


def factors(
    counts: Mapping[Status, int], holds: bool, whole: bool, measured: int, published: int = 0
) -> tuple[Factor, ...]:
    """All eleven, never summed: the standard says that a total is to be avoided.

    Args:
        counts: Of the registered quantities by status.
        holds: Whether all evidence holds that was run.
        whole: Whether the installation is the recorded one.
        measured: How many comparisons with measurements hold.
        published: How many with published output do.
    """
    return *_capability(counts, holds, whole, measured, published), *_results()


def _capability(
    counts: Mapping[Status, int], holds: bool, whole: bool, measured: int, published: int
) -> tuple[Factor, ...]:
    every = sum(counts.values())
    founded = counts[Status.VALIDATED] + counts[Status.VERIFIED]
    verified = 2 if holds and whole and founded == every else 1 if holds else 0
    validated = 1 if holds and measured + published else 0
    return (
        Factor(
            CAPABILITY,
            "Data pedigree",
            1,
            "Each value of the shipped mission says where it comes from: a paper, a data sheet, or an assumption. Most"
            " are assumptions, and few carry an uncertainty.",
            "Formal documents behind the data that matter, with estimates of their uncertainty.",
        ),
        Factor(
            CAPABILITY,
            "Verification",
            verified,
            f"{founded} of {every} printed quantities are held against an independent method, published output or a"
            f" measurement, in this installation; {every - founded} {are(every - founded)} not. All are registered and"
            " kept by references, which show that they have not changed, and not that they are right."
            + ("" if holds else " Some of that evidence failed.")
            + ("" if whole else " The installed files are not the recorded ones, or there is no record of them."),
            {
                0: "That all evidence holds.",
                1: "Evidence for every quantity, in the recorded installation.",
                2: "An estimate of the numerical error of every important quantity, against a requirement on it.",
            }[verified],
        ),
        Factor(
            CAPABILITY,
            "Validation",
            validated,
            "Of the concept alone: its intended use, limits and assumptions are stated, and comparisons hold with"
            f" published output ({published}) and with measurements ({measured}). None of them is of a link, a loop or"
            " a day that flew.",
            "Received power, residual error and delivered data of a similar terminal, inside a domain that is said."
            if validated
            else "That all evidence holds, with a comparison with published output or a measurement in it.",
        ),
        Factor(
            CAPABILITY,
            "Development technical review",
            0,
            "Nobody but its developers has reviewed it. A review by oneself counts as none.",
            "A favourable review by peers who did not develop it.",
        ),
        Factor(
            CAPABILITY,
            "Development process and product management",
            2,
            "A written process: version control, one gate for every change, references for every printed figure, steps"
            " of a release, a changelog that says which numbers moved. There is no plan of the life cycle (M&S 41).",
            "Measured compliance with a process that somebody else has approved.",
        ),
    )


def _results() -> tuple[Factor, ...]:
    return (
        Factor(
            RESULTS,
            "Use assessment",
            0,
            "This report is about an installation, not about a use. Its limits are said above. No use for a terminal"
            " that was built or flown is recorded.",
            "A proposed use, held against purpose, limits and domains.",
        ),
        Factor(
            RESULTS,
            "Input pedigree",
            1,
            "The shipped mission's inputs are told with their sources in every report; many are assumptions.",
            "Inputs of the use with formal sources and their uncertainty.",
        ),
        Factor(
            RESULTS,
            "Uncertainty characterization",
            1,
            "Intervals of simulation and standard errors of identification are printed; campaigns propagate what a"
            " mission states. What the models leave out is said, and not quantified.",
            "Numbers for what the models leave out, sorted by kind and propagated with the inputs.",
        ),
        Factor(
            RESULTS,
            "Results robustness",
            2,
            "Each report says how the margin moves with every input and the day with every assumption, one at a time."
            " Of the loop's results it has none; campaigns have them, together, for the inputs that they draw.",
            "Sensitivities of the loop's and the day's results to all important inputs, as the margin has them.",
        ),
        Factor(
            RESULTS,
            "Use and analysis technical review",
            0,
            "No result has been reviewed by anybody but those who made it.",
            "A favourable review of the results by peers.",
        ),
        Factor(
            RESULTS,
            "Use process and product management",
            2,
            "Every result carries its mission, seeds, versions and machine, and microrad reproduce makes it again.",
            "Measured compliance of the use with an approved process.",
        ),
    )
