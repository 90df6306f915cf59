"""Comparisons with the published output of other tools, standards and papers, to their printed digits."""

import math
from collections.abc import Iterator
from importlib import resources
from typing import Any

import numpy as np

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, NotHereError, Referent
from microrad.report.verification.workspace import Workspace

_DIGIT = "half of the last printed digit"
_DAY_S = 86400.0


def _printed(quantity: str, what: str, text: str, obtained: float, unit: str) -> Comparison:
    """A figure against the digits that are printed."""
    half = 0.5 * 10.0 ** -len(text.partition(".")[2])
    return Comparison(quantity, what, float(text), float(obtained), half, unit, _DIGIT)


def _sgp4(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.orbit import OrbitError
    from microrad.orbit.files.elements import read_elements
    from microrad.orbit.propagation.mean_elements import Sgp4Orbit

    package = resources.files("sgp4")
    if not package.joinpath("tcppver.out").is_file():
        raise NotHereError("the package sgp4 was installed without its verification files")
    lines = [s for s in package.joinpath("SGP4-VER.TLE").read_text().splitlines() if not s.startswith("#")]
    tables: dict[str, list[list[float]]] = {}
    for words in map(str.split, package.joinpath("tcppver.out").read_text().splitlines()):
        if words and words[-1] == "xx":
            rows = tables.setdefault(words[0], [])
        elif words:
            rows.append([float(word) for word in words[:7]])
    largest_m, largest_m_s, checked = 0.0, 0.0, set[str]()
    for one, two in zip(lines[::2], lines[1::2], strict=True):
        table = np.array(tables[one[2:7].lstrip("0")])
        table = table[np.abs(table[:, 0]) <= 14 * _DAY_S / 60.0]
        text = "\n".join(_summed(line[:69].ljust(69)) for line in (one, two)).encode()
        try:
            found = read_elements(workspace.folder / "satellite.tle", None, text)[0]
            states = Sgp4Orbit(found, found.epoch).states(60.0 * table[:, 0])
        except OrbitError:  # decayed, below the ground, or hardly moving: refused, as it should be
            continue
        largest_m = max(largest_m, float(np.abs(states.position_m - 1e3 * table[:, 1:4].T).max()))
        largest_m_s = max(largest_m_s, float(np.abs(states.velocity_m_s - 1e3 * table[:, 4:7].T).max()))
        checked.add(one[2:7])
    yield Comparison(
        "contacts.contacts.start_s", "satellites that are compared", 27.0, len(checked), 0.0, "", "a count"
    )
    what = f"SGP4, largest difference of a position over {len(checked)} satellites, 14 days"
    yield Comparison(
        "contacts.contacts.range_most_m", what, 0.0, largest_m, 1e-3, "m", "1 mm: digits of the tables, summed"
    )
    what = "largest difference of a velocity"
    yield Comparison("contacts.contacts.range_rate_most_m_s", what, 0.0, largest_m_s, 1e-5, "m/s", "as the places")


def _summed(line: str) -> str:
    """An element line with its checksum."""
    digits = sum(int(c) if c.isdigit() else c == "-" for c in line[:68])
    return f"{line[:68]}{digits % 10}"


def _standard(workspace: Workspace) -> Iterator[Comparison]:
    """The worked example of annex C and the radial factors of annex A."""
    from microrad.link.pointing import summation
    from microrad.link.pointing.error_classes import ErrorTerm

    arcsec = math.pi / 648000.0
    deviations = (
        (10.0, 5.0, 5.0),
        (6.67, 3.33, 3.33),
        (3.16, 3.16, 3.16),
        (1.63, 1.63, 1.63),
        (2.89, 2.89, 2.89),
        (3.54, 0.71, 3.54),
        (2.12, 3.54, 2.12),
    )
    for axes in ((0, 1), (2, 0)):
        terms = [
            ErrorTerm("", "random", 1.0, (0.0, 0.0), (arcsec * each[axes[0]], arcsec * each[axes[1]]))
            for each in deviations
        ]
        sigma = summation.mean_and_sigma(terms).rms_rad[0] / arcsec
        expected, what = (13.51, 8.37, 8.61)[axes[0]], f"worked example, axis {'xyz'[axes[0]]}, deviation"
        why = "1 in the last digit: its parts are printed with three"
        yield Comparison("budget.pointing.totals.*.total_rad", what, expected, sigma, 0.0101, "arcsec", why)
    like = [ErrorTerm("", "random", 1.0, (0.0, 0.0), (1.0, 1.0))]
    for confidence, text in ((0.6827, "1.52"), (0.9545, "2.49"), (0.9973, "3.44")):
        what = f"two like axes, radial at {100 * confidence:.2f} %, in deviations of one"
        total = summation.exact_total_rad(like, confidence)
        yield _printed("budget.pointing.totals.exact.total_rad", what, text, total, "")


def _receivers(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.link import receivers
    from microrad.link.beams import LitAperture

    of: dict[str, Any] = {"wavelength_m": 1.55e-6, "bit_error_ratio": 1e-9, "bandwidth_hz": 1e10}
    name = "budget.budgets.Communication.required_power_w"
    homodyne = receivers.BpskHomodyne(**of, quantum_efficiency=1.0)
    differential = receivers.DpskPreamplified(**of, noise_figure_db=10.0 * math.log10(2.0))
    counting = receivers.PpmCounting(**of, detection_efficiency=1.0, order=16)
    for what, text, receiver in (
        ("homodyne, two phases", "8.99", homodyne),
        ("heterodyne, four phases", "17.99", receivers.QpskHeterodyne(**of, quantum_efficiency=1.0)),
        ("preamplified, differential phase", "20.03", differential),
        ("16 positions, counted without background", "5.01", counting),
    ):
        yield _printed(
            name, f"{what}: photons per bit at 1e-9", text, float(receiver.photons_per_bit(1e9)), "photon/bit"
        )
    lit = LitAperture(0.1, 1.55e-6, truncation=1.1209, obscuration=0.0)
    what = "best efficiency of a Gaussian beam through an aperture"
    yield _printed("budget.budgets.*.lines.Illumination.value", what, "0.81453", lit.efficiency, "")


def _mathworks(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.link import gains

    name = "budget.budgets.*.lines"
    for line, what, text, value in (
        ("GEO aperture gain", "gain of an aperture of 7 cm", "103.0383", gains.aperture_gain_db(0.07, 1550e-9)),
        ("GEO aperture gain", "gain of an aperture of 6 cm", "101.6994", gains.aperture_gain_db(0.06, 1550e-9)),
        ("Free-space loss", "free space over 1000 km", "-258.1776", -gains.free_space_loss_db(1e6, 1550e-9)),
    ):
        yield _printed(f"{name}.{line}.value", what, text, value, "dB")


def _liang(workspace: Workspace) -> Iterator[Comparison]:
    """The published chain, with our loss of space and gain of the receiver between its own gain and pointing."""
    from microrad.link import gains

    transmit, receive = 16.0 / 15e-6**2, (math.pi * 0.08 / 1550e-9) ** 2
    margin = (
        (30.0 + 35.5)
        + 10.0 * math.log10(transmit)
        - 4.3429 * transmit * 1e-12
        - gains.free_space_loss_db(5419e3, 1550e-9)
        + gains.aperture_gain_db(0.08, 1550e-9)
        - 4.3429 * receive * 1e-12
        + 20.0 * math.log10(0.8)
    )
    what = "margin at the distance that is quoted for 3 dB"
    yield _printed("budget.budgets.Communication.margin_db", what, "3.00", margin, "dB")


def _sky(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.link import gains

    name = "budget.budgets.*.lines.Clear-sky loss.value"
    yield _printed(name, "air mass at the horizon", "37.92", gains.air_mass(0.0), "")
    zenith = gains.clear_sky_loss_db(0.9, math.pi / 2.0)
    yield Comparison(
        name,
        "loss at the zenith, transmission 0.9",
        0.4576,
        zenith,
        2e-4,
        "dB",
        "0.04 %: by the formula the zenith has an air mass of 0.9997",
    )


def _avalanche(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.link import receivers

    for gain, ratio, text in ((100.0, 1.0, "100.00"), (100.0, 0.0, "1.99"), (10.0, 0.02, "2.062")):
        what = f"excess noise at a gain of {gain:g}, ionisation ratio {ratio:g}"
        value = receivers.apd_excess_noise_factor(gain, ratio)
        yield _printed("", what, text, value, "")


def _margins(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.core import lti
    from microrad.loop.control import analysis

    satellite = lti.StateSpace(
        np.array([[0.0, 10.0], [-10.0, 0.0]]), np.eye(2), np.array([[1.0, 10.0], [-10.0, 1.0]]), np.zeros((2, 2))
    )
    freq_hz = np.concatenate([[1e-6], np.geomspace(1e-3, 1e3, 4001)])
    loop = lti.frequency_response(satellite, freq_hz) @ np.array([[1.0, -2.0], [0.0, 1.0]])
    disk = analysis.multiloop_disk_margin(freq_hz, loop).disk
    why = "0.3 %: the published bounds are 0.2 % apart"
    yield Comparison(
        "design.margins.disk", "spinning satellite, disk margin of both loops", 0.3754, disk, 1.1e-3, "", why
    )


def _random(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.core.kernels.random_numbers import philox

    known = (
        ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
    )
    for place, texts in enumerate(known, 1):
        counter, key, answer = ([int(word, 16) for word in text.split()] for text in texts)
        words = [int(word) for word in philox(*map(np.uint64, (*counter, *key)))]
        wrong = sum(word != wanted for word, wanted in zip(words, answer, strict=True))
        yield Comparison("", f"Philox 4x32-10, known answer {place}: words that differ", 0, wrong, 0, "", "exact")


CHECKS = (
    Check(
        "sgp4",
        "Places of 27 satellites by the published verification of SGP4",
        Referent.PUBLISHED,
        "The tables come with the package sgp4; element files are read as any of a user's.",
        "Vallado et al., AIAA 2006-6753",
        _sgp4,
    ),
    Check(
        "ecss-example",
        "Worked example and radial factors of the pointing standard",
        Referent.PUBLISHED,
        "The printed deviations of seven sources, summed; radial factors of two like axes.",
        "ECSS-E-ST-60-10C (2008), annexes A.2.4 and C",
        _standard,
    ),
    Check(
        "ideal-receivers",
        "Photons per bit of ideal receivers, and the best truncation of a beam",
        Referent.PUBLISHED,
        "Printed digits.",
        "Humblet and Azizoglu 1991; Agrawal; Hamkins 1999; Klein and Degnan 1974",
        _receivers,
    ),
    Check(
        "mathworks-link",
        "Gains and free-space loss of another tool's example",
        Referent.PUBLISHED,
        "Its printed lines.",
        "MathWorks, Satellite Communications Toolbox, optical inter-satellite link",
        _mathworks,
    ),
    Check(
        "liang-link",
        "Margin of a published link between satellites",
        Referent.PUBLISHED,
        "Its own inputs; where it reads gain and pointing otherwise, its reading takes the place of ours.",
        "Liang et al., IEEE WoWMoM 2022, Eq. (1) to (3)",
        _liang,
    ),
    Check(
        "clear-sky",
        "Air mass and loss of a clear sky",
        Referent.PUBLISHED,
        "The printed value at the horizon, and the definition at the zenith.",
        "Kasten and Young, Appl. Opt. 28, 4735 (1989)",
        _sky,
    ),
    Check(
        "avalanche",
        "Excess noise of avalanche photodiodes",
        Referent.PUBLISHED,
        "Textbook limits and a textbook value.",
        "McIntyre, IEEE Trans. Electron Devices 13, 164 (1966)",
        _avalanche,
    ),
    Check(
        "spinning-satellite",
        "Disk margin of two loops at once",
        Referent.PUBLISHED,
        "Its published value.",
        "Seiler, Packard and Gahinet, IEEE Control Syst. 40, 78 (2020)",
        _margins,
    ),
    Check(
        "random-numbers",
        "Known answers of the generator behind all drawn noise",
        Referent.PUBLISHED,
        "Words of Philox 4x32-10.",
        "Salmon et al. 2011, Random123",
        _random,
    ),
)
