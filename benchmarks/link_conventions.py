"""Where link budgets differ in convention, and by how many decibels; then the time of the mission's margin map.

    python benchmarks/link_conventions.py

Every number of a peer is computed here and now, by its formula written out below or by the package itself. In budgets a
line carries its sign; where single terms are compared, losses are positive. The difference is microrad less the peer.
"""

import math
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.special import j0, j1

from microrad import link
from microrad.link import beams, gains
from microrad.link.budget import assembly
from microrad.link.gains import dbm, photon_energy_j, watt
from microrad.mission.file import load_mission
from microrad.mission.model import Mission
from microrad.mission.tables.link import BeamShape, Terminals
from microrad.mission.tables.link import Receiver as ReceiverTable
from recorded import record

FILE = load_mission(Path(__file__).resolve().parents[1] / "missions" / "paper.toml")
PAPER = FILE.mission
ERROR_RAD = 10e-6  # required of the paper's fine pointing
TO_INSTALL = "not installed: pip install ogs-linkbudget-live"
BEST = beams.BEST_TRUNCATION
TARGET_S = 0.1


@dataclass(frozen=True)
class Row:
    term: str
    ours: float
    peer: float
    why: str = ""

    @property
    def difference(self) -> float:
        return self.ours - self.peer


# ---------------------------------------------------------------------------------------------------- peers' formulas
@dataclass(frozen=True)
class Chain:
    """What a budget of gains and pointing losses at both ends takes in; errors in rad, one at each end."""

    transmit_dbm: float
    required_dbm: float
    wavelength_m: float
    transmit_aperture_m: float
    receive_aperture_m: float
    distance_m: float
    transmit_efficiency: float
    receive_efficiency: float
    transmit_error_rad: float
    receive_error_rad: float


# "Optical Satellite Communication Link Budget Analysis", Satellite Communications Toolbox, inter-satellite link
# https://www.mathworks.com/help/satcom/ug/optical_satellite_communication_link_budget_analysis.html
MATHWORKS = Chain(17.5, -35.5, 1550e-9, 0.07, 0.06, 1000e3, 0.8, 0.8, 1e-6, 1e-6)

# Liang, Chaudhry, Erdogan, Yanikomeroglu, "Link Budget Analysis for Free-Space Optical Satellite Networks",
# WoWMoM 2022, arXiv 2204.13177, Eq. (1) to (3): 15 urad full angle, 80 mm; 1 W and a margin of 3 dB are quoted as
# 5419 km. Its transmitting aperture does not enter; the 0.15 m here is wide enough for the beam.
LIANG = Chain(30.0, -35.5, 1550e-9, 0.15, 0.08, 5419e3, 0.8, 0.8, 1e-6, 1e-6)
LIANG_FULL_ANGLE_RAD = 15e-6


def of_gains(c: Chain, transmit_gain: float) -> dict[str, float]:
    """Both sources' chain: exp(-G error^2) at both ends, each with its own gain, 4.3429 G error^2 in dB."""
    receive_gain = (math.pi * c.receive_aperture_m / c.wavelength_m) ** 2
    lines = {
        "Transmit power": c.transmit_dbm,
        "Transmit gain": 10 * math.log10(transmit_gain),
        "Transmit optics": 10 * math.log10(c.transmit_efficiency),
        "Transmit pointing": -4.3429 * transmit_gain * c.transmit_error_rad**2,
        "Free space": -20 * math.log10(4 * math.pi * c.distance_m / c.wavelength_m),
        "Receive gain": 10 * math.log10(receive_gain),
        "Receive optics": 10 * math.log10(c.receive_efficiency),
        "Receive pointing": -4.3429 * receive_gain * c.receive_error_rad**2,
    }
    received = sum(lines.values())
    return {**lines, "Received power": received, "Margin": received - c.required_dbm}


def mathworks(c: Chain) -> dict[str, float]:
    return of_gains(c, (math.pi * c.transmit_aperture_m / c.wavelength_m) ** 2)


def liang(c: Chain, full_angle_rad: float) -> dict[str, float]:
    return of_gains(c, 16 / full_angle_rad**2)


def uncut_gaussian_margin_db(c: Chain) -> float:
    """Gaussian beam of 1/e2 radius D/2 that nothing cuts: 2 P / (pi w^2) exp(-2 r^2 / w^2) over the receiver's area."""
    waist = c.transmit_aperture_m / 2
    w = waist * math.hypot(1, c.distance_m * c.wavelength_m / (math.pi * waist**2))
    irradiance = 2 / (math.pi * w**2) * math.exp(-2 * (c.transmit_error_rad * c.distance_m / w) ** 2)
    caught = irradiance * math.pi / 4 * c.receive_aperture_m**2 * c.transmit_efficiency * c.receive_efficiency
    return c.transmit_dbm + 10 * math.log10(caught) - c.required_dbm


def disc_loss_db(c: Chain) -> float:
    """Pattern of a disc lit evenly, (2 J1(x) / x)^2 with x = pi D error / lambda (Airy)."""
    x = math.pi * c.transmit_aperture_m * c.transmit_error_rad / c.wavelength_m
    return -20 * math.log10(2 * j1(x) / x)


def cut_gaussian_gain_db(truncation: float) -> float:
    """Gain of a Gaussian beam cut by its aperture over that of an even light: coupling of the field, by quadrature."""
    field = quad(lambda rho: math.exp(-((truncation * rho) ** 2)) * 2 * rho, 0, 1)[0]
    power = quad(lambda rho: math.exp(-2 * (truncation * rho) ** 2) * 2 * rho, 0, math.inf)[0]
    return 10 * math.log10(field**2 / power)


def cut_gaussian_loss_db(c: Chain, truncation: float) -> float:
    """Pattern of a Gaussian beam cut by its aperture, by adaptive quadrature."""
    x = math.pi * c.transmit_aperture_m * c.transmit_error_rad / c.wavelength_m
    off, on = (
        quad(lambda rho, s=s: math.exp(-((truncation * rho) ** 2)) * j0(s * rho) * rho, 0, 1)[0] for s in (x, 0.0)
    )
    return -20 * math.log10(off / on)


# ------------------------------------------------------------------------------------------------ the same in microrad
def changed(mission: Mission, **tables: dict[str, Any]) -> Mission:
    """A mission with some values of some tables changed."""
    return mission.model_copy(
        update={name: getattr(mission, name).model_copy(update=values) for name, values in tables.items()}
    )


def lit(mission: Mission, truncation: float) -> Mission:
    """The same mission with its far field computed: lit evenly (0), or by a Gaussian beam cut by the aperture."""
    radius = None if truncation == 0.0 else mission.terminals.leo_aperture_m / 2 / truncation
    shape = BeamShape.model_construct(
        profile="gaussian" if radius else "uniform", radius_m=radius, m_squared=1.0 if radius else None
    )
    return changed(mission, conventions={"pointing_loss": "pattern"}, communication={"beam": shape})


def by_gain(mission: Mission) -> Mission:
    return changed(mission, conventions={"pointing_loss": "gain"})


def mission_of(c: Chain) -> Mission:
    """The paper's mission with another link in its place."""
    rate = 10e9
    keys = {
        "transmit_power_w": watt(c.transmit_dbm),
        "wavelength_m": c.wavelength_m,
        "strehl": 0.0,
        "pointing_error_rad": c.transmit_error_rad,
        "distance_m": c.distance_m,
        "transmit_optics_loss_db": -10 * math.log10(c.transmit_efficiency),
        "receive_optics_loss_db": -10 * math.log10(c.receive_efficiency),
    }
    photons = watt(c.required_dbm) / photon_energy_j(c.wavelength_m) / rate
    return changed(
        PAPER,
        terminals={"leo_aperture_m": c.transmit_aperture_m, "geo_aperture_m": c.receive_aperture_m},
        conventions={"strehl": "decibel", "divergence": "full-1/e2"},
        communication={**keys, "data_rate_bit_s": rate, "receiver_sensitivity_photon_bit": photons},
        beacon={**keys, "divergence_rad": LIANG_FULL_ANGLE_RAD, "required_power_w": watt(c.required_dbm)},
    )


def lines_of(budget: link.LinkBudget) -> dict[str, float]:
    """The lines of a budget under the names of the chain above."""
    names = {
        "LEO aperture gain": "Transmit gain",
        "Beam gain": "Transmit gain",
        "Transmit optics loss": "Transmit optics",
        "Pointing loss": "Transmit pointing",
        "Free-space loss": "Free space",
        "GEO aperture gain": "Receive gain",
        "Receive optics loss": "Receive optics",
    }
    return {names.get(line.name, line.name): line.value for line in (*budget.lines, *budget.totals)}


def margin(mission: Mission) -> float:
    return link.communication_budget(link.of(mission), FILE.sources).margin_db


# ---------------------------------------------------------------------------------------------------------- the tables
RECEIVE_SIDE = "none in microrad: a detector whose field of view holds the error keeps the light"


def compared(ours: dict[str, float], peer: dict[str, float], why: dict[str, str]) -> list[Row]:
    """Both budgets term by term; a term that microrad does not have is 0 dB there."""
    return [Row(name, ours.get(name, 0.0), value, why.get(name, "")) for name, value in peer.items()]


def mathworks_rows() -> list[Row]:
    ours, peer = mission_of(MATHWORKS), mathworks(MATHWORKS)
    why = {
        "Transmit pointing": "exp(-G error^2) is twice the decibels of a Gaussian of radius D/2",
        "Receive pointing": RECEIVE_SIDE,
        "Margin": "the two pointing terms",
    }
    readings = (
        ('Margin, microrad with "gain"', by_gain(ours), "the receive-side term alone is left"),
        ('Margin, microrad with "pattern"', lit(ours, 0.0), "even light, exact: a quarter of the example's decibels"),
        ("Margin, best Gaussian cut", lit(ours, BEST), "0.81 of the gain that the others take (Klein, Degnan)"),
    )
    budget = lines_of(link.communication_budget(link.of(ours), FILE.sources))
    rows = [Row(name, margin(each), peer["Margin"], reason) for name, each, reason in readings]
    return [*compared(budget, peer, why), *rows]


def liang_rows() -> list[Row]:
    why = {
        "Transmit gain": "16 / angle^2 is half of a Gaussian's 32 / angle^2 (full angle at 1/e2)",
        "Transmit pointing": "exp(-16 error^2 / angle^2), where a Gaussian has exp(-8 error^2 / angle^2)",
        "Receive pointing": RECEIVE_SIDE,
        "Margin": "the three terms above",
    }
    m = mission_of(LIANG)
    budget = lines_of(link.beam_budget("beacon", link.Shared.of(m), m.beacon, FILE.sources))
    return compared(budget, liang(LIANG, LIANG_FULL_ANGLE_RAD), why)


def paper_chain() -> Chain:
    """The paper's link as the peers take it: the Strehl loss is an efficiency, GEO points without error."""
    beam, terminals = PAPER.communication, PAPER.terminals
    return Chain(
        transmit_dbm=dbm(beam.transmit_power_w),
        required_dbm=float(link.required_dbm(link.of(PAPER), beam.data_rate_bit_s)),
        wavelength_m=beam.wavelength_m,
        transmit_aperture_m=terminals.leo_aperture_m,
        receive_aperture_m=terminals.geo_aperture_m,
        distance_m=beam.distance_m,
        transmit_efficiency=10 ** (-assembly.strehl_db(beam, "decibel") / 10),
        receive_efficiency=1.0,
        transmit_error_rad=ERROR_RAD,
        receive_error_rad=0.0,
    )


def paper_peers() -> dict[str, float]:
    """Margin of the paper's link by each convention, from the formulas above alone."""
    c = paper_chain()
    on_axis = mathworks(replace(c, transmit_error_rad=0.0))["Margin"]
    full_angle = 4 * c.wavelength_m / (math.pi * c.transmit_aperture_m)  # of the Gaussian beam of 1/e2 radius D/2
    return {
        "MathWorks, GEO on axis": mathworks(c)["Margin"],
        "MathWorks, GEO off by 1 urad": mathworks(replace(c, receive_error_rad=1e-6))["Margin"],
        "MathWorks, GEO off by 10 urad": mathworks(replace(c, receive_error_rad=10e-6))["Margin"],
        "MathWorks, Strehl a ratio of 0.4": mathworks(replace(c, transmit_efficiency=0.4))["Margin"],
        "Liang, full angle 4 lambda / (pi D)": liang(c, full_angle)["Margin"],
        "Gaussian of radius D/2, not cut": uncut_gaussian_margin_db(c),
        "Even light, exact": on_axis - disc_loss_db(c),
        "Best Gaussian cut, exact": on_axis + cut_gaussian_gain_db(BEST) - cut_gaussian_loss_db(c, BEST),
    }


def paper_rows() -> list[Row]:
    """The shipped mission's margin against the margin that each other convention gives the same link."""
    why = {
        "MathWorks, GEO on axis": "exp(-G error^2)",
        "MathWorks, GEO off by 1 urad": "and a receive-side loss with 15 cm",
        "MathWorks, GEO off by 10 urad": "as answer.pointing_error has it: 40 dB that a detector keeps",
        "MathWorks, Strehl a ratio of 0.4": 'exp(-G error^2), and "0.4 dB" read as a ratio',
        "Liang, full angle 4 lambda / (pi D)": "16 / angle^2 is (pi D / lambda)^2: the same as MathWorks",
        "Gaussian of radius D/2, not cut": "gain 3 dB above the most that the aperture can have",
        "Even light, exact": "microrad takes this gain, and the loss of a narrower beam",
        "Best Gaussian cut, exact": "less gain, and less loss off the axis",
    }
    shipped = margin(PAPER)
    return [Row(name, shipped, value, why[name]) for name, value in paper_peers().items()]


def reading_rows() -> list[Row]:
    """microrad told to read as a peer does, on the paper's link: what is left is arithmetic."""
    peer = paper_peers()
    ratio = changed(PAPER, conventions={"pointing_loss": "gain", "strehl": "ratio"})
    return [
        Row('"gain"', margin(by_gain(PAPER)), peer["MathWorks, GEO on axis"]),
        Row('"gain", Strehl "ratio"', margin(ratio), peer["MathWorks, Strehl a ratio of 0.4"]),
        Row('"pattern", even light', margin(lit(PAPER, 0.0)), peer["Even light, exact"]),
        Row('"pattern", best Gaussian cut', margin(lit(PAPER, BEST)), peer["Best Gaussian cut, exact"]),
    ]


def term_rows() -> list[Row]:
    """Terms on their own: microrad's default reading against the others, 5 cm, 1.55 um, 10 urad."""
    c = paper_chain()
    d, wavelength = c.transmit_aperture_m, c.wavelength_m
    gain = gains.aperture_gain_db(d, wavelength)
    loss = float(gains.pointing_loss_db(ERROR_RAD, d, wavelength, "gaussian"))
    uniform = mathworks(c)["Transmit gain"]
    uncut = 10 * math.log10(8 / (wavelength / (math.pi * d / 2)) ** 2)
    cut, best = (uniform + cut_gaussian_gain_db(each) for each in (1.0, BEST))
    by_gain_db, disc = -mathworks(c)["Transmit pointing"], disc_loss_db(c)
    cut_loss, best_loss = (cut_gaussian_loss_db(c, each) for each in (1.0, BEST))
    receive = -mathworks(replace(c, receive_error_rad=ERROR_RAD))["Receive pointing"]
    # a single-mode fibre matched to the telescope receives as the best Gaussian cut transmits (reciprocity)
    fibre = cut_gaussian_loss_db(replace(c, transmit_aperture_m=c.receive_aperture_m), BEST)
    return [
        Row("Gain: even light", gain, uniform, "MathWorks, and microrad: an upper bound"),
        Row("Gain: Gaussian of D/2, not cut", gain, uncut, "light outside of the aperture counted as sent"),
        Row("Gain: Gaussian of D/2, cut", gain, cut, "13.5 % stopped, and the edge is dim"),
        Row("Gain: best Gaussian, cut", gain, best, "D/2 is 1.1209 radii (Klein, Degnan 1974)"),
        Row("Loss: exp(-G error^2)", loss, by_gain_db, 'MathWorks, Liang; "gain" in microrad'),
        Row("Loss: even light, exact", loss, disc, "the far field that belongs to the gain taken"),
        Row("Loss: Gaussian of D/2, cut", loss, cut_loss, "the cut beam's core is wider than the whole one's"),
        Row("Loss: best Gaussian, cut", loss, best_loss, "and this one is wider still"),
        Row("Loss: receive side, 15 cm", 0.0, receive, f"MathWorks, Liang; {RECEIVE_SIDE}"),
        Row("Loss: receive side, fibre, exact", 0.0, fibre, "single-mode: belongs into receive_optics_loss"),
        Row("Gain less loss: even light", gain - loss, uniform - disc, "microrad's default is the lower one"),
        Row("Gain less loss: best Gaussian", gain - loss, best - best_loss, "and here"),
        Row(
            "Loss: Strehl 0.4 as a ratio", gains.strehl_loss_db(0.4, "decibel"), -10 * math.log10(0.4), "paper: 0.4 dB"
        ),
    ]


def package_rows() -> list[Row]:
    """The installed peer itself. Raises ImportError where it is not."""
    from ogs_linkbudget.config import default_config
    from ogs_linkbudget.physics import aperture_gain_linear, pointing_loss_db
    from ogs_linkbudget.simulation import run_continuous, run_snapshot

    config = default_config()
    config.link.link_type, config.weather.use_live = "inter-satellite", False
    ours = mission_of(MATHWORKS)
    snapshot = run_snapshot(config)
    space = lines_of(link.communication_budget(link.of(ours), FILE.sources))["Free space"]
    c = paper_chain()
    d, wavelength = c.transmit_aperture_m, c.wavelength_m
    loss = pointing_loss_db(aperture_gain_linear(d, wavelength), ERROR_RAD)
    # its time series takes the error as a bias of a Gaussian beam of half angle 1.22 lambda / D
    config.satellite_a.jitter_sigma_rad = config.satellite_b.jitter_sigma_rad = 0.0
    config.satellite_a.aperture_diameter_m, config.link.boresight_bias_rad = d, ERROR_RAD
    run = run_continuous(config, 1.0, 0.5, "Rician")
    default = float(gains.pointing_loss_db(ERROR_RAD, d, wavelength, "gaussian"))
    return [
        Row("Free space", space, -snapshot.path_loss_db),
        Row("Margin", margin(ours), snapshot.margin_db, "as MathWorks: both pointing terms"),
        Row('Margin, microrad with "gain"', margin(by_gain(ours)), snapshot.margin_db, RECEIVE_SIDE),
        Row("Loss at 10 urad, 5 cm, snapshot", default, loss, "exp(-G error^2)"),
        Row(
            "Loss at 10 urad, 5 cm, time series",
            default,
            run.ideal_margin_db - run.margins_db[0],
            "Gaussian with the disc's first null, 1.22 lambda / D, for its half angle at 1/e2",
        ),
    ]


def written(title: str, rows: Iterable[Row]) -> None:
    print(f"\n{title}")
    print(f"{'term':36} {'microrad':>10} {'peer':>10} {'difference':>10}  why")
    for row in rows:
        difference = 0.0 if abs(row.difference) < 5e-5 else row.difference  # no minus before a rounded nothing
        print(f"{row.term:36} {row.ours:10.4f} {row.peer:10.4f} {difference:10.4f}  {row.why}".rstrip())


def compare() -> None:
    print("levels in dBm, all else in dB")
    written("MathWorks, inter-satellite, 17.5 dBm: inputs of the example, recomputed", mathworks_rows())
    written("Liang et al. 2022, 15 urad full angle, 5419 km: microrad's is a Gaussian beam", liang_rows())
    title = "ogs-linkbudget-live"
    try:
        rows = package_rows()
    except ImportError:
        print(f"\n{title}: {TO_INSTALL}")
    else:
        from importlib.metadata import version

        written(f"{title} {version(title)}, inter-satellite", rows)
    written("Margin of the paper's link at 300 Mbit/s, 10 urad: microrad as shipped", paper_rows())
    written("Margin of the paper's link: microrad told to read likewise", reading_rows())
    written("Terms at 5 cm, 1.55 um, 10 urad: microrad's default reading; losses positive", term_rows())


# --------------------------------------------------------------------------------------------------------------- time
ERRORS_RAD = np.linspace(0.0, 20e-6, 1000)
Maker = Callable[[], np.ndarray]
RATES_BIT_S = np.geomspace(1e6, 4e9, 1000)
PPM = {
    "modulation": "ppm",
    "detector": "photon-counting",
    "order": 16,
    "efficiency": 0.5,
    "dark_count_rate": "10000 1/s",
    "bit_error_ratio": 1e-6,
    "code_gain": "0 dB",
    "code_rate": 1.0,
    "bandwidth": "16 GHz",
    "background": {
        "spectral_radiance": "10 W/(m^2 sr um)",
        "field_of_view": "50 urad",
        "filter_bandwidth": "1 nm",
    },
}


def ppm_mission() -> Mission:
    receiver = ReceiverTable.model_validate(PPM)
    return changed(PAPER, communication={"receiver_sensitivity_photon_bit": None, "receiver": receiver})


def in_numpy(mission: Mission) -> np.ndarray:
    """The shipped map as bare array arithmetic."""
    beam, terminals = mission.communication, mission.terminals
    gain, receive = ((math.pi * each / beam.wavelength_m) ** 2 for each in terminals_m(terminals))
    space = (4 * math.pi * beam.distance_m / beam.wavelength_m) ** 2
    on_axis = 10 * math.log10(beam.transmit_power_w * gain * receive / space) - assembly.strehl_db(beam, "decibel")
    energy = photon_energy_j(beam.wavelength_m) * (beam.receiver_sensitivity_photon_bit or math.nan)
    required = 10 * np.log10(energy * RATES_BIT_S)
    margins: np.ndarray = (on_axis - required)[:, None] - (10 / math.log(10) * gain / 2 * ERRORS_RAD**2)[None, :]
    return margins


def in_a_loop(mission: Mission, rows: int) -> np.ndarray:
    """The first rows of the shipped map, cell by cell in Python, each cell a whole budget of scalars."""
    beam, terminals = mission.communication, mission.terminals
    transmit_m, receive_m = terminals_m(terminals)
    cells = []
    for rate in RATES_BIT_S[:rows].tolist():
        for error in ERRORS_RAD.tolist():
            gain = (math.pi * transmit_m / beam.wavelength_m) ** 2
            receive = (math.pi * receive_m / beam.wavelength_m) ** 2
            space = (4 * math.pi * beam.distance_m / beam.wavelength_m) ** 2
            received = 10 * math.log10(beam.transmit_power_w * gain * receive / space) - assembly.strehl_db(
                beam, "decibel"
            )
            lost = 10 / math.log(10) * gain / 2 * error**2
            needed = photon_energy_j(beam.wavelength_m) * (beam.receiver_sensitivity_photon_bit or math.nan) * rate
            cells.append(received - lost - 10 * math.log10(needed))
    return np.array(cells).reshape(rows, -1)


def rate_by_rate(mission: Mission, rows: int) -> np.ndarray:
    """The first rows of the map of any mission, each in a call of its own."""
    return np.concatenate([link.margin_map(link.of(mission), rate, ERRORS_RAD) for rate in RATES_BIT_S[:rows]])


def terminals_m(terminals: Terminals) -> tuple[float, float]:
    return terminals.leo_aperture_m, terminals.geo_aperture_m


def medians_s(functions: list[Maker], repeats: int) -> tuple[list[np.ndarray], list[float]]:
    """Results and median times of functions that take turns, so that a busy moment meets all of them."""
    results = [function() for function in functions]  # the first call loads what it needs
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(repeats):
        for function, taken in zip(functions, times, strict=True):
            began = time.perf_counter()
            function()
            taken.append(time.perf_counter() - began)
    return results, [statistics.median(taken) for taken in times]


def measure() -> None:
    print(f"\nMargin map, 1000 rates x 1000 errors, medians; the target is {1e3 * TARGET_S:g} ms")
    print(f"{'receiver, pointing loss':36} {'ms':>10} {'ratio':>10}  microrad's time over that of")
    calls = "a call for each rate, 10 of 1000 extrapolated"
    numpy_and_loop: dict[str, Maker] = {
        "the same array arithmetic in bare numpy": partial(in_numpy, PAPER),
        "a loop over cells in Python, 10 of 1000 rates extrapolated": partial(in_a_loop, PAPER, 10),
    }
    cases: dict[str, tuple[Mission, dict[str, Maker]]] = {
        "measured sensitivity, gaussian": (PAPER, numpy_and_loop),
        "measured sensitivity, pattern": (lit(PAPER, BEST), {calls: partial(rate_by_rate, lit(PAPER, BEST), 10)}),
        "16-PPM with background, gaussian": (ppm_mission(), {calls: partial(rate_by_rate, ppm_mission(), 10)}),
    }
    for name, (mission, peers) in cases.items():
        ours = partial(link.margin_map, link.of(mission), RATES_BIT_S, ERRORS_RAD)
        (margins, *others), (seconds, *times) = medians_s([ours, *peers.values()], 21)
        record(f"margin map of 1000 x 1000: {name}", 1e3 * seconds, "ms", at_most=1e3 * TARGET_S)
        print(f"{name:36} {1e3 * seconds:10.2f} {seconds / TARGET_S:10.4f}  the target")
        for peer, found, part_s in zip(peers, others, times, strict=True):
            whole_s = part_s * len(margins) / len(found)
            apart = float(np.max(np.abs(margins[: len(found)] - found)))
            print(f"{'':36} {1e3 * whole_s:10.2f} {seconds / whole_s:10.4f}  {peer}; within {apart:.0e} dB", flush=True)


if __name__ == "__main__":
    compare()
    measure()
