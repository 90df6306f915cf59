"""Checks of campaigns: rows against their distributions, statistics by plain sums, tails that have a closed form."""

import math
import statistics
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate

from microrad.report.verification.check import Check
from microrad.report.verification.checks.light import link
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

Floats = NDArray[np.float64]

_ROUNDING = "rounding"
_SIGMAS = 5.0
_POWER, _LOSS, _ERROR = (f"communication.{key}" for key in ("transmit_power", "transmit_optics_loss", "pointing_error"))
_MEAN_W, _DEVIATION_W, _MOST_DB = 5.0, 0.15, 0.5
_ERRORS_RAD = {4e-6: 0.2, 6e-6: 0.6, 8e-6: 0.2}
_ALL = """mission = "leo-geo.toml"
seed = 11
runs = {runs}
sampling = "{sampling}"
keep = ["margin", "answer_margin", "beacon_margin"]

[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.15 W"

[inputs."communication.transmit_optics_loss"]
distribution = "uniform"
low = "0 dB"
high = "0.5 dB"

[inputs."communication.pointing_error"]
distribution = "table"
values = ["4 urad", "6 urad", "8 urad"]
weights = [0.2, 0.6, 0.2]

[limits.margin]
least = "3 dB"
"""
_WEIGHTED = """mission = "leo-geo.toml"
seed = 12
runs = 1024
sampling = "random"
keep = ["margin"]

[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.15 W"

[inputs."communication.transmit_power".drawn_as]
distribution = "normal"
mean = "4.6 W"
deviation = "0.25 W"

[limits.margin]
least = "{least:.12g} dB"
"""
_ROWS = 1024


def _campaign(workspace: Workspace, name: str, text: str) -> Any:
    """A campaign file on the shipped mission, as it is read."""
    from microrad.campaign.file import load_campaign

    path = workspace.folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return load_campaign(path)


def _found(campaign: Any, rows: int) -> tuple[Mapping[str, Floats], Any]:
    """Columns of a campaign's first rows, and what its command says of them."""
    from microrad.campaign.rows.evaluator import Evaluator
    from microrad.campaign.statistics.cell import CellRows

    chunk = Evaluator(campaign, {}).rows(0, range(rows), lambda: None)
    return chunk.columns, CellRows(campaign, 0, [chunk]).summary()


def _phi(x: float) -> float:
    return math.erfc(-x / math.sqrt(2.0)) / 2.0


def _distance(values: Floats, below: Any) -> float:
    """Kolmogorov's distance of values from a distribution, by its two sides at each of them."""
    expected = np.array([below(value) for value in np.sort(values)])
    places = np.arange(values.size + 1) / values.size
    return float(max(np.max(places[1:] - expected), np.max(expected - places[:-1])))


def _rows(workspace: Workspace) -> Iterator[Comparison]:
    """Drawn inputs against the distributions in the file, and margins of rows by the budget made anew."""
    from microrad.campaign.rows import sampling

    count = 8192
    for how in ("random", "latin-hypercube"):
        campaign = _campaign(workspace, how, _ALL.format(runs=count, sampling=how))
        columns, weights = sampling.rows(campaign, 0, 0, count)
        if how == "random":
            # Massart 1990: P(distance > x) <= 2 exp(-2 n x^2)
            far, why = math.sqrt(math.log(2e6) / 2.0 / count), "a distance that one set of draws in a million exceeds"
        else:
            far, why = 1.0 / campaign.block, "each of a block's strata has one row"
        for key, below in (
            (_POWER, lambda x: _phi((x - _MEAN_W) / _DEVIATION_W)),
            (_LOSS, lambda x: min(max(x / _MOST_DB, 0.0), 1.0)),
        ):
            what = f"{key}, {how}: distance from its distribution"
            yield Comparison(f"campaign.rows.{key}.value", what, 0.0, _distance(columns[key], below), far, "", why)
        for value, share in _ERRORS_RAD.items():
            what = f"{_ERROR}, {how}: share of {1e6 * value:g} urad"
            obtained = float(np.mean(np.abs(columns[_ERROR] - value) < 1e-12))
            yield Comparison(f"campaign.rows.{_ERROR}.value", what, share, obtained, 2.0 * far, "", f"twice {why}")
        yield Comparison("campaign.rows.weight", f"largest weight, {how}", 1.0, float(weights.max()), 0.0, "", "exact")
    campaign = _campaign(workspace, "all", _ALL.format(runs=_ROWS, sampling="random"))
    found, _ = _found(campaign, 64)
    for row in range(0, 64, 9):
        drawn = {key: float(found[f"communication.{key}"][row]) for key in ("transmit_power", "pointing_error")}
        given = workspace.given
        loss_db = given(_LOSS) - float(found[_LOSS][row])
        expected = link(given, "Communication", **drawn)["margin_db"] + loss_db
        yield Comparison(
            "campaign.rows.margin.value",
            f"margin of row {row}",
            expected,
            float(found["margin"][row]),
            1e-9,
            "dB",
            _ROUNDING,
        )


def _summary(workspace: Workspace) -> Iterator[Comparison]:
    """Mean, spread, quantiles and share below a limit: by exact sums of the rows, and by their closed forms."""
    columns, found = _found(_campaign(workspace, "all", _ALL.format(runs=_ROWS, sampling="random")), _ROWS)
    margins = [float(x) for x in columns["margin"]]
    ranked, of = sorted(margins), found.outputs["margin"]
    mean, deviation = statistics.fmean(margins), statistics.stdev(margins)
    name = "campaign.cells.0.outputs.margin"
    for key, expected, obtained in (
        ("mean.value", mean, of.mean.value),
        ("deviation", deviation, of.deviation),
        ("least", ranked[0], of.least),
        ("most", ranked[-1], of.most),
    ):
        yield Comparison(f"{name}.{key}", f"margin, {key}, by sums of rows", expected, obtained, 1e-9, "dB", _ROUNDING)
    for share, quantile in of.quantiles.items():
        expected = ranked[math.ceil(round(share * _ROWS, 9)) - 1]
        what = f"margin, quantile of {100.0 * share:g} %, by sorting"
        yield Comparison(f"{name}.quantiles.{share}.value", what, expected, quantile.value, 0.0, "dB", "a row")
        # ends of an interval for any distribution: sums of the binomial distribution from either side
        low, high = (_rank(share, (1.0 - quantile.confidence) / 2.0, end) for end in (-1, 1))
        for end, rank, value in (("low", low, quantile.low), ("high", high, quantile.high)):
            if rank is not None:
                what = f"margin, {end} end of the quantile of {100.0 * share:g} %, by binomial sums"
                yield Comparison(f"{name}.quantiles.{share}.{end}", what, ranked[rank], value, 0.0, "dB", "a row")
    # closed form: the power's decibels by quadrature, the loss by its moments, the fall over three errors
    fixed = link(workspace.given, "Communication", transmit_power=1.0, pointing_error=0.0)["margin_db"]
    fixed += workspace.given(_LOSS)
    half_rad = 2.0 * workspace.given("communication.wavelength") / (math.pi * workspace.given("terminals.leo_aperture"))
    falls = {20.0 * math.log10(math.e) * (e / half_rad) ** 2: share for e, share in _ERRORS_RAD.items()}
    level = [_over_power(lambda x, n=n: (10.0 * math.log10(x)) ** n) for n in (1, 2)]
    fall = [sum(share * f**n for f, share in falls.items()) for n in (1, 2)]
    variance = level[1] - level[0] ** 2 + _MOST_DB**2 / 12.0 + fall[1] - fall[0] ** 2
    expected, spread = fixed + level[0] - _MOST_DB / 2.0 - fall[0], math.sqrt(variance)
    why = f"five standard errors of {_ROWS} rows"
    off = _SIGMAS * spread / math.sqrt(_ROWS)
    yield Comparison(f"{name}.mean.value", "margin, mean, closed form", expected, of.mean.value, off, "dB", why)
    # (kurtosis - 1) / 4 < 1 / 2, as no part has longer tails than a normal one
    off = _SIGMAS * spread / math.sqrt(2.0 * _ROWS)
    yield Comparison(f"{name}.deviation", "margin, deviation, closed form", spread, of.deviation, off, "dB", why)

    def below(margin_db: float) -> float:
        found = 0.0
        for fall_db, share in falls.items():
            over = [
                _phi((10.0 ** ((margin_db - fixed + fall_db + loss) / 10.0) - _MEAN_W) / _DEVIATION_W)
                for loss in _NODES
            ]
            found += share * float(np.dot(over, _NODE_WEIGHTS))
        return found

    far = math.sqrt(math.log(2e6) / 2.0 / _ROWS)
    what = "margin: distance of the quantiles from the distribution in closed form"
    away = max(abs(below(q.value) - share) for share, q in of.quantiles.items())
    yield Comparison(
        f"{name}.quantiles.value", what, 0.0, away, far + 1.0 / _ROWS, "", "one set of rows in a million exceeds it"
    )
    missed = below(3.0)
    off = _SIGMAS * math.sqrt(missed * (1.0 - missed) / _ROWS)
    what = "share of rows below the limit, closed form"
    yield Comparison("campaign.cells.0.missed.value", what, missed, found.missed.value, off, "", why)


_NODES, _NODE_WEIGHTS = (
    each / scale for each, scale in zip(np.polynomial.legendre.leggauss(16), (1.0, 2.0), strict=True)
)
_NODES = (1.0 + _NODES) * _MOST_DB / 2.0


def _over_power(of: Any) -> float:
    """Mean of a function of the drawn power."""

    def weighted(x: float) -> float:
        return float(of(x) * math.exp(-(((x - _MEAN_W) / _DEVIATION_W) ** 2) / 2.0))

    ends = _MEAN_W - 10.0 * _DEVIATION_W, _MEAN_W + 10.0 * _DEVIATION_W
    whole = integrate.quad(weighted, *ends, epsabs=1e-12)[0]
    return float(whole) / (_DEVIATION_W * math.sqrt(2.0 * math.pi))


@cache
def _rank(share: float, beyond: float, end: int) -> int | None:
    """Place of the order statistic at an end of a quantile's interval; None where so few rows have none.

    The rank K of the quantile is binomial. The low end is the last row with P(K < its number) below the level, the high
    one the first with P(K >= its number) below it.
    """
    terms = [
        math.exp(_log_binomial(_ROWS, k) + k * math.log(share) + (_ROWS - k) * math.log1p(-share))
        for k in range(_ROWS + 1)
    ]
    if end < 0:
        fits = [n for n in range(1, _ROWS + 1) if math.fsum(terms[:n]) < beyond]
        return fits[-1] - 1 if fits else None
    fits = [n for n in range(1, _ROWS + 1) if math.fsum(terms[n:]) < beyond]
    return fits[0] - 1 if fits else None


def _log_binomial(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


def _tails(workspace: Workspace) -> Iterator[Comparison]:
    """Rare events by weighted draws, against normal and Rayleigh distributions."""
    from microrad.campaign.statistics import tails

    given = workspace.given
    limit_w = 4.55
    least = link(given, "Communication", transmit_power=limit_w)["margin_db"]
    _, found = _found(_campaign(workspace, "rare", _WEIGHTED.format(least=least)), _ROWS)
    share = _phi((limit_w - _MEAN_W) / _DEVIATION_W)

    # weights p / q; the mean of their squares below the limit is an integral of p^2 / q
    def square(x: float) -> float:
        p = math.exp(-(((x - _MEAN_W) / _DEVIATION_W) ** 2) / 2.0) / _DEVIATION_W
        q = math.exp(-(((x - 4.6) / 0.25) ** 2) / 2.0) / 0.25
        return p * p / q / math.sqrt(2.0 * math.pi)

    variance = integrate.quad(square, limit_w - 3.0, limit_w)[0] - share**2
    off = _SIGMAS * math.sqrt(variance / _ROWS)
    why = f"five standard errors of {_ROWS} weighted rows, by an integral"
    what = f"share of powers below {limit_w:g} W, {share:.2e}"
    yield Comparison("campaign.cells.0.missed.value", what, share, found.missed.value, off, "", why)
    wide, count = 2.0, 20_000
    radius = wide * np.hypot(*np.random.default_rng(20_260_107).standard_normal((2, count)))
    log_weight = 2.0 * math.log(wide) - (1.0 - wide**-2) * radius**2 / 2.0
    shares = (1e-2, 1e-4, 1e-6)
    errors = tuple(math.sqrt(-2.0 * math.log(p)) for p in shares)
    tail = tails.tail_weighted(radius, log_weight, shares, 0.99, errors)
    rate = 1.0 - wide**-2 / 2.0
    for place, (share, error) in enumerate(zip(shares, errors, strict=True)):
        variance = (wide**2 / (2.0 * rate) * math.exp(-rate * error**2) - share**2) / count
        off = _SIGMAS * math.sqrt(variance)
        why = f"five standard errors of {count} weighted draws, in closed form"
        what = f"probability beyond {error:.3g} deviations of two axes"
        name = f"campaign.cells.0.tail.{place}"
        yield Comparison(f"{name}.probability", what, share, tail.beyond[error].value, off, "", why)
        what = f"variance of it over that of the closed form, {share:g}"
        # the sum of squares varies by the fourth moment of the weights beyond
        fourth = wide**6 / (2.0 * (2.0 - 1.5 * wide**-2)) * math.exp(-(2.0 - 1.5 * wide**-2) * error**2)
        off_variance = _SIGMAS * math.sqrt(fourth / count) / count
        yield Comparison(
            f"{name}.variance", what, 1.0, tail.variance[error] / variance, off_variance / variance, "", why
        )
        what = f"radius that is exceeded with probability {share:g}, in deviations"
        slack = off / (error * share)  # the density of the radius is r times the share
        yield Comparison(f"{name}.value", what, error, tail.wanted[share].value, slack, "", why)


def _shares(workspace: Workspace) -> Iterator[Comparison]:
    """Sensitivities of functions that have them in closed form."""
    from microrad.campaign.statistics.sensitivity import sensitivity

    count, fewer = 16_384, 4096  # total indices are of no more than these
    draw = np.random.default_rng(20_260_108)
    x = draw.uniform(-math.pi, math.pi, (3, count))
    a, b = 7.0, 0.1
    y = np.sin(x[0]) + a * np.sin(x[1]) ** 2 + b * x[2] ** 4 * np.sin(x[0])
    both = b**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    ones = (0.5 * (1.0 + b * math.pi**4 / 5.0) ** 2, a**2 / 8.0, 0.0)
    whole = sum(ones) + both
    of = sensitivity({f"x{i}": column for i, column in enumerate(x)}, y, "ishigami")
    why = "five standard errors of a share of n rows, 2 sqrt(S) (1 - S) / sqrt(n), and 1 / n for 20 bins"
    for i, one in enumerate(ones):
        total = (one + (both if i != 1 else 0.0)) / whole
        for kind, expected, found, n in (
            ("first", one / whole, of.first, count),
            ("total", total, of.total, fewer),
        ):
            off = _SIGMAS * 2.0 * math.sqrt(expected / n) * (1.0 - expected) + 20.0 / n
            what = f"Ishigami's function, input {i + 1}, {kind}"
            key = f"x{i}"
            yield Comparison(
                f"campaign.sensitivities.{kind}.{key}.value", what, expected, found[key].value, off, "", why
            )
    x = draw.standard_normal((2, count))
    for tilt in (0.5, 2.0):
        of = sensitivity({"a": x[0], "b": x[1]}, x[0] + tilt * x[1], "straight")
        pearson = 1.0 / math.hypot(1.0, tilt)
        spearman = 6.0 / math.pi * math.asin(pearson / 2.0)
        off = _SIGMAS / math.sqrt(count) * (1.0 - spearman**2) * math.sqrt(1.0 + spearman**2 / 2.0)
        what = f"rank correlation of normal inputs with their sum, slope {tilt:g}"
        why_ranks = f"five standard errors of {count} rows (Bonett and Wright 2000)"
        yield Comparison(
            "campaign.sensitivities.rank_correlation.a.value",
            what,
            spearman,
            of.rank_correlation["a"].value,
            off,
            "",
            why_ranks,
        )


CHECKS = (
    Check(
        "drawn-rows",
        "Drawn rows against the distributions in the file, and their margins",
        Referent.INDEPENDENT,
        "Kolmogorov's distance; margins by the budget made anew with each row's values.",
        "Massart, Ann. Probab. 18, 1269 (1990), for the level",
        _rows,
    ),
    Check(
        "campaign",
        "Mean, spread, quantiles and share below a limit of a campaign of links",
        Referent.INDEPENDENT,
        "Exact sums, sorting and binomial sums of the rows; the distribution of the margin by quadrature.",
        "David and Nagaraja, Order Statistics, 2003, 7.1; closed form",
        _summary,
    ),
    Check(
        "tails",
        "Rare events by weighted draws",
        Referent.INDEPENDENT,
        "Normal powers and Rayleigh's distribution, whose tails have a closed form, as have the errors of the draws.",
        "closed form",
        _tails,
    ),
    Check(
        "sensitivities",
        "Sobol indices and rank correlations of functions that have them in closed form",
        Referent.INDEPENDENT,
        "Ishigami's function, and sums of normal inputs.",
        "Ishigami and Homma, Proc. ISUMA 1990, 398; Pearson 1907 for ranks of normal pairs",
        _shares,
    ),
)
