"""Rules that sum pointing errors, side by side, each with who authorises it and why it may not hold here."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

from microrad.core.units import format_quantity
from microrad.link.pointing.error_classes import ErrorTerm, Interpretation, StatedError, error_term
from microrad.link.radial_error import Jitter, radial_quantile
from microrad.mission.fields import Quantity, Share

Rule = Literal["rss", "esa-1993", "ecss-axis", "ecss-radial", "exact"]
"""The rules that count every term; the Rayleigh rule of ECSS leaves out the means."""
Terms = Sequence[ErrorTerm]

RAYLEIGH_SIGMAS_PER_MEAN = 10.0
"""How often the standard deviation must hold the mean for "much larger", clause 4.2.4.2.2; the error is then 0.5 %."""
RAYLEIGH_UNLIKE_AXES = 0.1
"""How far the smaller standard deviation may be below the larger to be "about equal"; the rule is then 5 % high."""

NEGLIGIBLE = 1e-9
"""A standard deviation below this part of the largest mean or deviation is taken as 0."""
_LEAST_RAD = 1e-30  # standard deviations below it are no pointing errors, and their squares leave the range of a float

_UNCORRELATED = "terms uncorrelated"


@dataclass(frozen=True, slots=True)
class Summation:
    """The total of a budget by one rule.

    `total_rad` is an angle about one axis when `of` is "axis", off the line of sight when it is "radial"; "stated" adds
    half widths up as they were stated. `authority` says where the rule is authorised. `caveat` says why it does not
    hold for these terms; "" when it does.
    """

    rule: str
    name: str
    of: Literal["stated", "axis", "radial"]
    total_rad: float
    formula: str
    authority: str
    caveat: str = ""


# ------------------------------------------------------------------------------------------------------------- totals
def sigma_multiple(confidence: float) -> float:
    """n_p, the number of standard deviations about its mean within which a Gaussian lies with the confidence.

    ECSS-E-ST-60-10C 4.2.4.1: 1, 2 and 3 for 68.27, 95.45 and 99.73 %. Raises ValueError unless 0 < confidence < 1.
    """
    Share("").check("the confidence", confidence)
    return NormalDist().inv_cdf(0.5 * (1.0 + confidence))


def mean_and_sigma(terms: Terms) -> Jitter:
    """Mean (`bias_rad`) and standard deviation (`rms_rad`) of the sum, per axis: ECSS-E-ST-60-10C 4.2.3.

    Means add (a), standard deviations of uncorrelated terms add in squares (c, d).
    The record is also the Gaussian with these moments, the axes independent, which many errors come close to together.
    A standard deviation that is `NEGLIGIBLE` beside the rest comes out as 0.
    """

    def mean(axis: int) -> float:
        return math.fsum(term.mean_rad[axis] for term in terms)

    def sigma(axis: int) -> float:
        return math.hypot(*(term.sigma_rad[axis] for term in terms))

    means, sigmas = (mean(0), mean(1)), (sigma(0), sigma(1))
    least = max(_LEAST_RAD, NEGLIGIBLE * max(abs(means[0]), abs(means[1]), *sigmas))
    return Jitter(means, (sigmas[0] if sigmas[0] >= least else 0.0, sigmas[1] if sigmas[1] >= least else 0.0))


def rss_rad(terms: Terms) -> float:
    """Root sum square of the half widths as stated, whatever their class, statistic and axes."""
    return math.hypot(*(term.stated_rad for term in terms))


def esa_1993_rad(terms: Terms) -> float:
    """Total of the half widths as stated: the root sum square within each class, and then the sum over the classes."""
    kinds = dict.fromkeys(term.kind for term in terms)
    return math.fsum(rss_rad([term for term in terms if term.kind == kind]) for kind in kinds)


def axis_totals_rad(terms: Terms, confidence: float) -> tuple[float, float]:
    """Total error about x and about y in rad, abs(mean) + n_p sigma: ECSS-E-ST-60-10C 4.2.4.1.

    Args:
        terms: Mean and standard deviation of each error.
        confidence: Share P that the total covers.

    Raises:
        ValueError: For what is no confidence.
    """
    total, multiple = mean_and_sigma(terms), sigma_multiple(confidence)
    x, y = (abs(mean) + multiple * sigma for mean, sigma in zip(total.bias_rad, total.rms_rad, strict=True))
    return x, y


def radial_total_rad(terms: Terms, confidence: float) -> float:
    """Total radial error in rad, for any two axes: ECSS-E-ST-60-10C 4.2.4.2.1.

    It is sqrt(mean_x^2 + mean_y^2) + n_p sqrt(sigma_x^2 + sigma_y^2).

    Args:
        terms: Mean and standard deviation of each error.
        confidence: Share P that the total covers.

    Raises:
        ValueError: For what is no confidence.
    """
    total = mean_and_sigma(terms)
    return total.static_rad + sigma_multiple(confidence) * math.hypot(*total.rms_rad)


def rayleigh_total_rad(terms: Terms, confidence: float) -> float:
    """Total radial error in rad, for means far below the deviations: ECSS-E-ST-60-10C 4.2.4.2.2.

    It is max(sigma_x, sigma_y) sqrt(-2 ln(1 - P)). Whether it may be used is for `rayleigh_caveat` to say.

    Args:
        terms: Mean and standard deviation of each error.
        confidence: Share P that the total covers.

    Raises:
        ValueError: For what is no confidence.
    """
    sigma_multiple(confidence)  # refuses what is no confidence
    return max(mean_and_sigma(terms).rms_rad) * math.sqrt(-2.0 * math.log1p(-confidence))


def exact_total_rad(terms: Terms, confidence: float) -> float:
    """Radial error in rad that the sum of all errors stays within, for the share of the confidence.

    Exact for a Gaussian sum with any means and unequal axes; terms of other shapes are taken as Gaussian. It is the
    reference that shows how conservative each rule is.

    Args:
        terms: Mean and standard deviation of each error.
        confidence: Share that the total covers.

    Raises:
        ValueError: For what is no confidence.
    """
    sigma_multiple(confidence)  # refuses what is no confidence
    return float(radial_quantile(mean_and_sigma(terms), 1.0 - confidence))


TOTALS: dict[Rule, Callable[[Terms, float], float]] = {
    "rss": lambda terms, confidence: rss_rad(terms),
    "esa-1993": lambda terms, confidence: esa_1993_rad(terms),
    "ecss-axis": lambda terms, confidence: max(axis_totals_rad(terms, confidence)),
    "ecss-radial": radial_total_rad,
    "exact": exact_total_rad,
}
"""The total (rad) by each rule, of terms at a confidence."""


# ------------------------------------------------------------------------------------------------------- side by side
def summations(terms: Terms, confidence: float) -> tuple[Summation, ...]:
    """The total by each rule, and whether that rule holds here.

    Args:
        terms: Mean and standard deviation of each error.
        confidence: Share that the totals cover.

    Raises:
        ValueError: For no term, and for no confidence.
    """
    if not terms:
        raise ValueError("the pointing budget has 0 terms; give at least 1")
    totals = {rule: total(terms, confidence) for rule, total in TOTALS.items()}
    shape, standard = shape_caveat(terms), "ECSS-E-ST-60-10C (2008)"
    low = "below the exact radial error, as at confidences under 0.79"
    return (
        Summation(
            "rss",
            "root sum square",
            "stated",
            totals["rss"],
            "sqrt(sum of error^2)",
            f"the paper, section 2.1; {standard} 4.2.3 only for uncorrelated deviations of one level without a mean",
            rss_caveat(terms),
        ),
        Summation(
            "esa-1993",
            "class by class",
            "stated",
            totals["esa-1993"],
            "sum over the classes of sqrt(sum of error^2)",
            "earlier ESA practice, Pointing Error Handbook ESA-NCR-502 (1993)",
            f"{standard} A.2.3: no mathematical justification, can overestimate; not recommended (4.2.3 NOTE 8)",
        ),
        Summation(
            "ecss-axis",
            "ECSS, one axis",
            "axis",
            totals["ecss-axis"],
            "abs(sum of means) + n_p sqrt(sum of sigma^2), the worse axis",
            f"{standard} 4.2.3 and 4.2.4.1; {_UNCORRELATED}",
            shape,
        ),
        Summation(
            "ecss-radial",
            "ECSS, two axes",
            "radial",
            totals["ecss-radial"],
            "sqrt(mean_x^2 + mean_y^2) + n_p sqrt(sigma_x^2 + sigma_y^2)",
            f"{standard} 4.2.3 and 4.2.4.2.1, which calls it extremely conservative; {_UNCORRELATED}",
            low if totals["ecss-radial"] < totals["exact"] * (1.0 - 1e-9) else shape,
        ),
        Summation(
            "rayleigh",
            "ECSS, two like axes",
            "radial",
            rayleigh_total_rad(terms, confidence),
            "max(sigma_x, sigma_y) sqrt(-2 ln(1 - P))",
            f"{standard} 4.2.4.2.2, means far below the deviations",
            rayleigh_caveat(terms),
        ),
        Summation(
            "exact",
            "radial distribution",
            "radial",
            totals["exact"],
            "P(r < total) = P of a Gaussian about the mean, axes independent",
            "the reference for the rules; a sum of many errors (central limit theorem)",
            shape,
        ),
    )


def rss_caveat(terms: Terms) -> str:
    """Why the root sum square of the stated half widths is not the rule of ECSS for these terms; "" when it is."""
    constant = [term.name for term in terms if any(term.mean_rad)]
    if constant:
        have = "has a mean" if len(constant) == 1 else "have means"
        return f"not authorised: {', '.join(constant)} {have}, and means add linearly"
    ratios = [sigma / term.stated_rad for term in terms if term.stated_rad for sigma in term.sigma_rad]
    if ratios and max(ratios) > min(ratios) * (1.0 + 1e-9):
        return "not authorised: the half widths are not the same number of standard deviations"
    return ""


def shape_caveat(terms: Terms) -> str:
    """Which term of another shape holds more than half of the variance, so that the sum is no Gaussian; else "".

    The limit of ECSS-E-ST-60-10C 4.2.1. A uniform spread makes totals high at confidences of 0.9 and more.
    """
    for axis, sigma in enumerate(mean_and_sigma(terms).rms_rad):
        for term in terms:
            if sigma and not term.gaussian and term.sigma_rad[axis] ** 2 > 0.5 * sigma**2:
                return f"approximate: {term.name} is not Gaussian and holds more than half of the variance"
    return ""


def rayleigh_caveat(terms: Terms) -> str:
    """Why the Rayleigh rule does not apply to these terms; "" when it does."""
    total = mean_and_sigma(terms)
    largest, smallest, mean = max(total.rms_rad), min(total.rms_rad), max(abs(bias) for bias in total.bias_rad)
    if mean * RAYLEIGH_SIGMAS_PER_MEAN > smallest:
        return f"does not apply: the mean is not {RAYLEIGH_SIGMAS_PER_MEAN:g} times below the standard deviation"
    if smallest < (1.0 - RAYLEIGH_UNLIKE_AXES) * largest:
        return f"does not apply: the two standard deviations differ by more than {100 * RAYLEIGH_UNLIKE_AXES:g} %"
    return ""


@dataclass(frozen=True, slots=True)
class Allocation:
    """What a fixed total leaves for one line while all others stay as they are.

    `largest_rad` is the largest half width, stated as the line's own, that still meets the total. It is 0 when the
    others alone miss the total, by `missing_rad`, and `note` says so; "" otherwise.
    """

    name: str
    stated_rad: float
    largest_rad: float
    missing_rad: float
    note: str


def allocate(
    stated: Sequence[StatedError],
    total_rad: float,
    *,
    rule: Rule,
    confidence: float,
    interpretation: Interpretation = "temporal",
) -> tuple[Allocation, ...]:
    """For each line, the largest half width with which the total by a rule just meets a given one.

    Totals grow with each line, so that there is one such width.

    Args:
        stated: The errors as they are stated.
        total_rad: The total to meet, in rad.
        rule: The rule by which the errors are summed, out of `TOTALS`.
        confidence: Share that the total covers; it does not matter to the rules of stated half widths.
        interpretation: "temporal" or "mixed", as of `error_term`.

    Raises:
        ValueError: For a total not above 0, an unknown rule, and as `error_term` and the rule do.
    """
    Quantity("rad", above=0.0).check("the total", total_rad, "else nothing is left to allocate")
    if rule not in TOTALS:
        raise ValueError(f'no rule "{rule}" to allocate by; give one of {", ".join(TOTALS)}')

    def total_with(index: int, error_rad: float, alone: bool = False) -> float:
        lines = [] if alone else [*stated[:index], *stated[index + 1 :]]
        terms = [error_term(line, interpretation) for line in (*lines, stated[index].with_error(error_rad))]
        return TOTALS[rule](terms, confidence)

    def one(index: int) -> Allocation:
        line, others = stated[index], total_with(index, 0.0)
        if others > total_rad:
            missing = others - total_rad
            note = f"nothing is left: the other lines alone exceed the total by {format_quantity(missing, 'rad')}"
            return Allocation(line.name, line.error_rad, 0.0, missing, note)
        # alone it would reach the total here; totals are in proportion to a line that is alone
        highest = total_rad / total_with(index, 1.0, alone=True)
        from scipy.optimize import brentq

        low, high = 0.0, highest * (1.0 + 1e-6)
        largest = brentq(lambda error: total_with(index, error) - total_rad, low, high, xtol=1e-9 * highest)
        return Allocation(line.name, line.error_rad, float(largest), 0.0, "")

    return tuple(one(index) for index in range(len(stated)))
