"""Check of codes over series of received power: two powers, whose fades and cost are known."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from microrad.report.registry import flattened
from microrad.report.verification.check import Check
from microrad.report.verification.checks.light import link
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_SPECTRUM = {10: 36, 12: 211, 14: 1404, 16: 11633, 18: 77433}  # wrong bits by distance, Frenger et al. 1999
_LENGTHS, _CYCLE, _CYCLES, _LOW, _TARGET = (3, 6, 19), 200, 10, 0.4, 1e-7
_TWO_POWERS = """

[communication.fading]
series = "two-powers.csv"
unit = "linear"
normalised = "as-given"
sampling = "100 us"
code = "ccsds-k7-1-2"
interleaving = "{kind}"
{span}bit_error_ratio = 1e-7
"""


def _two_powers(workspace: Workspace, kind: str, span: str) -> dict[str, Any]:
    """What `microrad budget` prints of the shipped mission under fades to one power, of three lengths."""
    from microrad.link.study import run_link_study
    from microrad.mission.file import load_link
    from microrad.report.links.data import links_data

    cycle = np.ones(_CYCLE)
    for begin, length in zip((20, 80, 140), _LENGTHS, strict=True):
        cycle[begin : begin + length] = _LOW
    np.savetxt(workspace.folder / "two-powers.csv", np.tile(cycle, _CYCLES), header="power", comments="")
    path = workspace.folder / "two-powers.toml"
    path.write_text(workspace.text + _TWO_POWERS.format(kind=kind, span=span), encoding="utf-8")
    return dict(flattened(links_data(run_link_study(load_link(path)))))


def _error(distance: float) -> float:
    """How often two paths are mistaken so many times the signal over noise apart."""
    return 0.5 * math.erfc(math.sqrt(distance))


def _falls_to(function: Callable[[float], float], value: float) -> float:
    """Signal over noise (dB) at which a function of its ratio falls to a value, by bisection."""
    low, high = -5.0, 30.0
    for _ in range(100):
        middle = (low + high) / 2.0
        low, high = (middle, high) if function(10.0 ** (middle / 10.0)) > value else (low, middle)
    return low


def _fades(workspace: Workspace) -> Iterator[Comparison]:
    """A coded link under two powers: each sample by itself, and each of ten symbols with the one or the other."""
    share = sum(_LENGTHS) / _CYCLE

    def bound(snr: float) -> float:
        return sum(bits * _error(distance * snr) for distance, bits in _SPECTRUM.items())

    def mixed(snr: float) -> float:
        return share * bound(_LOW * snr) + (1.0 - share) * bound(snr)

    def spread(snr: float) -> float:
        rows = ((math.comb(10, k) * share**k * (1.0 - share) ** (10 - k), 10 - k + k * _LOW) for k in range(11))
        return sum(chance * _error(snr * distance) for chance, distance in rows)

    needed_db = _falls_to(bound, _TARGET)
    alone_db = _falls_to(mixed, _TARGET) - needed_db
    spread_db = _falls_to(spread, _error(10.0 * 10.0 ** (needed_db / 10.0))) - needed_db
    static_db = link(workspace.given, "Communication")["margin_db"]
    none = _two_powers(workspace, "none", "")
    block = _two_powers(workspace, "block", f'interleaver = "{_CYCLE / 10:g} ms"\n')
    why = "0.01 dB: the union bound at an error ratio of 1e-7, and the nearest paths for all"
    for numbers, what, cost_db in ((none, "without an interleaver", alone_db), (block, "spread", spread_db)):
        for key, expected in (
            ("penalty_db", cost_db),
            ("margin_db", static_db - cost_db),
            ("curve.penalty_db.0", alone_db),
        ):
            obtained = numbers[f"fading.{key}"]
            yield Comparison(f"budget.fading.{key}", f"{key}, {what}", expected, obtained, 0.01, "dB", why)
    static = none["fading.static_margin_db"]
    yield Comparison("budget.fading.static_margin_db", "at constant power", static_db, static, 1e-9, "dB", "rounding")
    lost = none["fading.lost"]
    yield Comparison("budget.fading.lost", "samples below what the code needs", share, lost, 1e-12, "", "a count")
    ratio = mixed(10.0 ** ((needed_db + static_db) / 10.0))
    found = none["fading.bit_error_ratio"]
    why = "5 %: the union bound, of which the simulated decoder has a constant share"
    yield Comparison("budget.fading.bit_error_ratio", "without an interleaver", ratio, found, 0.05 * ratio, "", why)
    for key, samples in {
        "mean_s": sum(_LENGTHS) / 3.0,
        "median_s": 6.0,
        "ninetieth_s": 19.0,
        "longest_s": 19.0,
    }.items():
        what = f"{key} of fades of {', '.join(map(str, _LENGTHS))} samples"
        obtained = none[f"fading.fades.{key}"]
        yield Comparison(f"budget.fading.fades.{key}", what, 1e-4 * samples, obtained, 1e-12, "s", "rounding")
    for key, expected in {"share": share, "per_s": 3.0 / (1e-4 * _CYCLE), "unresolved": 0.0}.items():
        unit = "1/s" if key == "per_s" else ""
        obtained = none[f"fading.fades.{key}"]
        yield Comparison(f"budget.fading.fades.{key}", f"fades: {key}", expected, obtained, 1e-9, unit, "a count")


CHECKS = (
    Check(
        "coded-fades",
        "A coded link under a series of two powers, and the fades of that series",
        Referent.INDEPENDENT,
        "Union bounds mixed by the share of each power; nearest paths with a binomial number of faded symbols; counts.",
        "Frenger, Orten and Ottosson, IEEE Commun. Lett. 3, 317 (1999), for the distances",
        _fades,
    ),
)
