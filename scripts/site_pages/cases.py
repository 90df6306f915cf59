"""Published cases: what a paper, a standard or an independent computation has, and what microrad makes of the same."""

import importlib.util
import math
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Case:
    """One case: the digits that its source has, those obtained here, how far they may be apart, and what tests it."""

    name: str
    source: str
    expected: str
    obtained: float
    test: str
    tolerance: float

    @property
    def difference(self) -> float:
        """What was obtained less what is expected."""
        return self.obtained - float(self.expected)

    @property
    def met(self) -> bool:
        """Whether both are within the tolerance."""
        return abs(self.difference) <= self.tolerance * (1.0 + 1e-9)

    @property
    def shown(self) -> str:
        """What was obtained, with two digits more than its source has."""
        return f"{self.obtained:.{_digits(self.expected) + 2}f}"


def _digits(text: str) -> int:
    return len(text.partition(".")[2])


def _half_digit(text: str) -> float:
    """Half of the last digit that is printed."""
    return 0.5 * 10.0 ** -_digits(text)


def case(name: str, source: str, expected: str, obtained: float, test: str, tolerance: float | None = None) -> Case:
    """A case; without a tolerance the digits must be those of the source.

    Args:
        name: What it is, with its unit.
        source: Who has the digits.
        expected: The digits.
        obtained: What microrad computes, in the same unit.
        test: The test that checks it, file::function.
        tolerance: How far they may be apart, in the same unit.
    """
    return Case(
        name, source, expected, float(obtained), test, _half_digit(expected) if tolerance is None else tolerance
    )


@cache
def module(path: str) -> ModuleType:
    """A file of tests or a benchmark as a module."""
    for folder in (ROOT / "tests", ROOT / "scripts", (ROOT / path).parent):
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
    spec = importlib.util.spec_from_file_location(f"cases_{Path(path).stem}", ROOT / path)
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = made
    spec.loader.exec_module(made)
    return made


def _parametrised(test: Callable[..., None]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Names of the arguments and values of each case of a parametrised test."""
    for mark in getattr(test, "pytestmark", ()):
        if mark.name == "parametrize":
            names = mark.args[0] if isinstance(mark.args[0], tuple) else (mark.args[0],)
            for each in mark.args[1]:
                yield names, each


def evidence(*names: str) -> Iterator[Case]:
    """What these checks of `microrad verify` compare, one case each.

    Args:
        names: Of the checks.
    """
    from microrad.report.verification.checks import every
    from microrad.report.verification.workspace import Workspace

    by_name = {check.name: check for check in every()}
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder), None)
        for check in (by_name[name] for name in names):
            for each in check.run(workspace):
                what = f"{each.what} ({each.unit})" if each.unit else each.what
                yield case(what, check.source, f"{each.expected:.10g}", each.obtained, _EVIDENCE, each.tolerance)


_EVIDENCE = "tests/report/test_verification.py::test_all_evidence_holds"


# ---------------------------------------------------------------------------------------------------------- link
def link() -> Iterator[Case]:
    """All cases of tests/link/test_facts_link.py that hold a number against printed digits."""
    path = "tests/link/test_facts_link.py"
    for name, test in vars(module(path)).items():
        for names, each in _parametrised(test) if name.startswith("test_") else ():
            if names != ("value", "text"):
                continue
            (value, text), (source, _, what) = each.values, each.id.partition(": ")
            source = {"checked": "computed by two independent methods"}.get(source, source.replace("paper", _PAPER))
            yield case(f"{_ABOUT[name]}: {what}", source, text, value, f"{path}::{name}")


_PAPER = "SPIE 11852, 118523B"
_ABOUT = {
    "test_gains_and_losses_are_those_of_the_papers_link": "gain, loss, level or margin (dB, dBm)",
    "test_photons_per_bit_are_those_implied_and_those_of_ideal_receivers": "photons per bit",
    "test_the_beacons_irradiance_is_that_of_its_reading": "irradiance of the beacon (nW/m^2)",
    "test_beams_have_their_published_gain": "beam",
    "test_jitter_costs_what_was_checked": "jitter, mean transmission or loss (dB)",
    "test_olympus_leaves_what_was_checked": "vibration of OLYMPUS behind a first-order loop (µrad)",
    "test_the_fitted_motion_of_micius_has_its_bands": "vibration of Micius by band (µrad)",
    "test_the_spiral_is_that_of_the_worked_example": "spiral scan, radius (µrad) or dwells",
    "test_sensor_and_point_ahead_have_their_published_numbers": "quad cell or point-ahead",
}


def conventions() -> Iterator[Case]:
    """Link budgets that others publish, by their own formulas, and what microrad has for the same link."""
    peers, path = module("benchmarks/link_conventions.py"), "tests/link/test_link_conventions.py"
    source = "MathWorks, inter-satellite example: its formulas, recomputed"
    ours = {row.term: row.ours for row in peers.mathworks_rows()}
    gain = ours['Margin, microrad with "gain"'] + peers.mathworks(peers.MATHWORKS)["Receive pointing"]
    same = f"{path}::test_told_to_read_likewise_microrad_has_the_peers_margin"
    yield case("margin, read as the example reads pointing (dB)", source, "-2.5297", gain, same, 1e-4)
    yield from evidence("mathworks-link", "liang-link")


def pointing() -> Iterator[Case]:
    """The worked example and the factors of ECSS-E-ST-60-10C."""
    from microrad.link.pointing import summation

    path = "tests/link/test_pointing_budget.py"
    tests = module(path)
    worked = tests.test_the_standards_worked_example_comes_out
    for _, (names, once, twice) in _parametrised(worked):
        part = "all errors" if len(names) > 3 else "relative errors"
        for axes in ((0, 1), (2, 0)):
            terms = [
                tests.term(sigma=tuple(tests.ANNEX_C[name][axis] * tests.ARCSEC for axis in axes)) for name in names
            ]
            total, limits = summation.mean_and_sigma(terms), summation.axis_totals_rad(terms, 0.954499736103642)
            for index, axis in enumerate(axes if axes == (0, 1) else axes[:1]):
                for what, text, value in (
                    ("1 sigma", once[axis], total.rms_rad[index]),
                    ("95 %", twice[axis], limits[index]),
                ):
                    yield case(
                        f"{part}, axis {'xyz'[axis]}, {what} (arcsec)",
                        "ECSS-E-ST-60-10C, Annex C",
                        f"{text:.2f}",
                        value / tests.ARCSEC,
                        f"{path}::{worked.__name__}",
                        0.0101,
                    )
    for test, total in (
        (tests.test_two_like_axes_have_the_rayleigh_totals_that_the_standard_prints, summation.rayleigh_total_rad),
        (tests.test_two_like_axes_have_the_general_totals_that_the_standard_prints, summation.radial_total_rad),
    ):
        for _, (confidence, printed) in _parametrised(test):
            name = f"two like axes, {test.__name__.split('_')[6]} rule, at {100 * confidence:.2f} % (sigma of one axis)"
            value = total([tests.term(sigma=(1.0, 1.0))], confidence)
            where = f"{path}::{test.__name__}"
            yield case(name, "ECSS-E-ST-60-10C, A.2.4", f"{printed:.2f}", value, where, 5e-3)


def receivers() -> Iterator[Case]:
    """Photons per bit at 1e-9, the noise of avalanches, and the air mass."""
    from microrad.link import receivers as built

    common = {"wavelength_m": 1.55e-6, "bit_error_ratio": 1e-9, "bandwidth_hz": 1e10}
    pin = built.OokPin(**common, quantum_efficiency=1.0, thermal_noise_a_sqrt_hz=0.0)
    path = "tests/link/test_receivers.py"
    half_q = f"{path}::test_a_photodiode_without_noise_of_its_own_needs_half_q_squared"
    yield case(
        "photodiode, shot noise of the signal alone (photons per bit)",
        "Q^2 / 2",
        "18.0",
        pin.photons_per_bit(1e9),
        half_q,
    )
    yield from evidence("ideal-receivers", "avalanche", "clear-sky")


# -------------------------------------------------------------------------------------------------------- orbit
def orbit() -> Iterator[Case]:
    """The published verification of SGP4, and the geometry of a low orbit and a slot."""
    yield from evidence("sgp4")
    from microrad.core.earth import EARTH_RADIUS_M
    from microrad.orbit.propagation import analytic
    from microrad.orbit.visibility.contacts import coplanar_contact

    path, source = "tests/orbit/test_contacts.py", "closed form, computed by two independent methods"
    for grazing_m, text in ((0.0, "58.12"), (100e3, "56.72")):
        found = coplanar_contact(EARTH_RADIUS_M + 500e3, grazing_m)
        name = f"contact of an equatorial orbit at 500 km and a slot, grazing height {grazing_m / 1e3:g} km (min)"
        test = f"{path}::test_a_coplanar_contact_takes_as_long_by_search_as_by_hand"
        yield case(name, source, text, found.duration_s / 60.0, test)
    found = coplanar_contact(EARTH_RADIUS_M + 500e3, 0.0)
    test = f"{path}::test_the_range_in_a_coplanar_contact_goes_from_35286_to_44253_km"
    yield case("its shortest range (km)", source, "35286", found.shortest_range_m / 1e3, test, 1.0)
    yield case("its longest range (km)", source, "44253", found.longest_range_m / 1e3, test, 1.0)
    yield case(
        "inclination of a sun-synchronous orbit at 500 km (deg)",
        "textbook value",
        "97.4",
        math.degrees(analytic.sun_synchronous_inclination_rad(500e3)),
        "tests/orbit/test_orbit.py::test_the_sun_synchronous_inclination_at_500_km_is_97_4_degrees",
    )


# --------------------------------------------------------------------------------------------- mirror and control
def mirror() -> Iterator[Case]:
    """The paper's mirror: its linear part, loops of its hysteresis, its control loop; digits by other solvers."""
    from microrad.core import lti

    path = "tests/loop/test_simulate.py"
    tests = module(path)
    system = lti.modal_from_polynomials(tests.NUMERATOR, tests.DENOMINATOR)
    gains = "tests/core/test_lti.py::test_gains_of_eq_2"
    paper = "SPIE 11852, 118523B, Eq. 2"
    rest = abs(lti.frequency_response(system, np.zeros(1)))[0, 0, 0]
    band = np.abs(lti.frequency_response(system, np.geomspace(1, 100, 200)))[:, 0, 0]
    for name, text, value in (
        ("gain at rest (mrad/V)", "0.16255", rest),
        ("largest gain, 1 to 100 Hz (mrad/V)", "0.08315", band.max()),
        ("least gain, 1 to 100 Hz (mrad/V)", "0.08022", band.min()),
    ):
        yield case(name, f"{paper}: exact arithmetic", text, value, gains)
    source = "Eq. 3 with the printed parameters: independent adaptive solver"
    for _, (freq_hz, width, peak) in _parametrised(tests.test_hysteresis_loops):
        loop = tests.PRINTED.loop(6.0, freq_hz, 50_000 // int(freq_hz))
        test = f"{path}::test_hysteresis_loops"
        yield case(f"loop width at {freq_hz:g} Hz (%)", source, f"{width:.2f}", 100 * loop.width, test, 2e-3 * width)
        largest = 1e3 * np.max(np.abs(loop.hysteresis_rad))
        yield case(f"largest hysteresis at {freq_hz:g} Hz (mrad)", source, f"{peak:.6f}", largest, test, 2e-3 * peak)
    source = "the paper's loop under PI: independent adaptive solver"
    rms = {freq: value for _, (freq, value) in _parametrised(tests.test_rms_errors_of_the_papers_loop)}
    for _, (freq_hz, peak, straight) in _parametrised(tests.test_peaks_of_the_papers_loop):
        test, trace = f"{path}::test_peaks_of_the_papers_loop", tests.track(tests.PRINTED, freq_hz)
        yield case(
            f"peak error of a sine at {freq_hz:g} Hz (µrad)", source, f"{peak}", 1e6 * trace.peak_rad, test, 0.01 * peak
        )
        alone = 1e6 * tests.track(tests.STRAIGHT, freq_hz).peak_rad
        yield case(
            f"the same without hysteresis, {freq_hz:g} Hz (µrad)", source, f"{straight}", alone, test, 0.01 * straight
        )
        if freq_hz in rms:
            test, want = f"{path}::test_rms_errors_of_the_papers_loop", rms[freq_hz]
            yield case(
                f"rms error at {freq_hz:g} Hz (µrad)", source, f"{want:.2f}", 1e6 * trace.rms_rad, test, 0.01 * want
            )


def control() -> Iterator[Case]:
    """Margins of several loops at once."""
    return evidence("spinning-satellite")


def random_numbers() -> Iterator[Case]:
    """The generator behind all simulated noise."""
    return evidence("random-numbers")


GROUPS: dict[str, Callable[[], Iterator[Case]]] = {
    "Light, pointing statistics, acquisition and disturbances": link,
    "Link budgets of others": conventions,
    "Summation of pointing errors": pointing,
    "Receivers and sky": receivers,
    "Orbits": orbit,
    "The paper's mirror and loop": mirror,
    "Margins": control,
    "Random numbers": random_numbers,
}


@cache
def all_cases() -> dict[str, tuple[Case, ...]]:
    """All cases by what they are about."""
    return {title: tuple(group()) for title, group in GROUPS.items()}


def recorded(page: str, first_cell: str, heading: str = "") -> list[str]:
    """The cells behind the first one of a row of a table in a page of docs/.

    Args:
        page: Name of the page.
        first_cell: What stands in the row's first cell.
        heading: What stands in the heading of the table, where several have such a row.

    Raises:
        LookupError: Where no table of the page has such a row.
    """
    title = last = ""
    for line in (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines():
        if line.startswith("|") and not last.startswith("|"):
            title = line
        last = line
        cells = [each.strip() for each in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
        if line.startswith("|") and cells[0] == first_cell and heading in title:
            return cells[1:]
    raise LookupError(f"docs/{page} has no row that begins with {first_cell!r}; correct it in scripts/site_pages")
