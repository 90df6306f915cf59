"""Every formula of link, pointing and acquisition beside its source: whether it is the source's, and what differs."""

import inspect
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Literal

from microrad import link
from microrad.link import beams, gains
from microrad.link import receivers as receiver
from microrad.link.pointing import open_loop_budget
from microrad.mission.file import load_mission
from site_pages.cases import ROOT, module
from site_pages.tables import code, plain, table

Status = Literal["exact", "reduction", "other source", "in conflict"]

_HEAD = """# Formulas and their sources

Every formula of `microrad.link` and of the tracking sensor's noise, beside its source. Differences were computed when
this page was made, for the paper's link where nothing else is said: 5 cm, 1.55 µm, an error of 10 µrad. In the
formulas a is the truncation of a beam, o an obscuration, and the angle of a beam is its half angle at 1/e2.

| status | what it says |
| --- | --- |
| exact | the formula of the source, evaluated as it stands |
| reduction | follows from the source under the assumption that is named |
| other source | another source than usual, or our own where no source has one |
| in conflict | sources contradict each other; the difference is that to the other one |
"""


@dataclass(frozen=True)
class Formula:
    """One formula: where it stands in `microrad`, itself as TeX, its source, its status and what differs."""

    where: str
    formula: str
    source: str
    status: Status
    difference: str = ""


_D, _WAVE, _ERROR = 0.05, 1.55e-6, 10e-6
_NOT_FORMULAS = {"checked", "dbm", "watt", "shape_caveat", "rss_caveat", "rayleigh_caveat", "summations", "allocate"}
_COVERED = (
    "link.gains",
    "link.pointing.statistics",
    "link.pointing.summation",
    "link.pointing.fading",
    "link.coupling.ends",
)


def _db(ratio: float) -> float:
    return 10.0 * math.log10(ratio)


def _gains() -> Iterator[Formula]:
    g, klein = "link.gains.", "Klein and Degnan, Appl. Opt. 13 (1974) 2134"
    best = beams.LitAperture(_D, _WAVE, beams.BEST_TRUNCATION, 0.0)
    gaussian, gain = (float(gains.pointing_loss_db(_ERROR, _D, _WAVE, each)) for each in ("gaussian", "gain"))
    even = float(beams.LitAperture(_D, _WAVE, 0.0, 0.0).loss_db(_ERROR))
    yield Formula(
        f"{g}aperture_gain_db",
        r"G = (\pi D / \lambda)^2",
        "aperture lit evenly; MathWorks, Liang et al. 2022",
        "in conflict",
        f"{-_db(best.efficiency):.2f} dB more than the best Gaussian beam that the aperture cuts ({klein})",
    )
    yield Formula(
        f"{g}gaussian_beam_gain_db",
        r"G = 8 / \theta^2",
        "Gaussian beam, half angle at 1/e2",
        "in conflict",
        f"{_db(8 / (16 / 4)):.2f} dB more than 16 / (full angle)^2 of Liang et al. 2022, Eq. (2)",
    )
    yield Formula(
        f"{g}peak_radiant_intensity_w_sr", r"I = 2 P / (\pi \theta^2)", "Gaussian beam: G P / (4 pi)", "exact"
    )
    yield Formula(
        f"{g}implied_transmission_db",
        r"10 \lg (I / (2 P / (\pi \theta^2)))",
        "ratio of a measured peak to the lossless beam's",
        "reduction",
        "optics, truncation and wavefront as one number",
    )
    yield Formula(f"{g}free_space_loss_db", r"(4 \pi R / \lambda)^2", "Friis 1946", "exact")
    yield Formula(f"{g}far_field_m", r"2 D^2 / \lambda", "Fraunhofer", "exact")
    yield Formula(
        f"{g}gaussian_pointing_loss_db", r"\exp(-2 (\epsilon / \theta)^2)", "Gaussian beam off its axis", "exact"
    )
    yield Formula(
        f"{g}pointing_loss_db",
        r"\exp(-G \epsilon^2 / 2),\quad \theta = 2 \lambda / (\pi D)",
        "Gaussian beam of 1/e2 radius D/2 that nothing cuts",
        "in conflict",
        f"{gaussian:.2f} dB; exp(-G error^2) of MathWorks and Liang et al. has {gain:.2f} dB, even light {even:.2f} dB",
    )
    yield Formula(
        f"{g}pointing_db_per_rad2",
        r"4.343\, G / 2 \ \text{or}\ 4.343\, G",
        "the two conventions of the row above",
        "exact",
    )
    yield Formula(
        f"{g}strehl_loss_db",
        r"s \ \text{or}\ -10 \lg s",
        "the paper's Table 2 prints 0.4 dB",
        "in conflict",
        f"{gains.strehl_loss_db(0.4, 'ratio') - gains.strehl_loss_db(0.4, 'decibel'):.2f} dB where 0.4 is a ratio",
    )
    short = 1.0 - (2 * math.pi / 14) ** 2
    own = gains.strehl_ratio(1.0 / 14.0, 1.0)
    yield Formula(
        f"{g}strehl_ratio",
        r"S = \exp(-(2 \pi \sigma / \lambda)^2)",
        "Maréchal, as extended by Mahajan",
        "other source",
        f"{_db(own / short):.2f} dB above 1 - (2 pi sigma / lambda)^2 at lambda / 14",
    )
    yield Formula(f"{g}obscuration_loss_db", r"1 - o^2", "area of the opening", "exact")
    sky = float(gains.clear_sky_loss_db(0.9, math.radians(10)))
    secant = -_db(0.9) / math.sin(math.radians(10))
    yield Formula(
        f"{g}air_mass",
        r"1 / (\sin h + 0.50572 (h + 6.07995^\circ)^{-1.6364})",
        "Kasten and Young 1989, Eq. 3",
        "exact",
        f"{sky - secant:+.2f} dB against 1 / sin h at 10 deg and a zenith transmission of 0.9",
    )
    yield Formula(
        f"{g}clear_sky_loss_db", r"-10\, m \lg T", "Beer and Lambert", "reduction", "one transmission for the whole sky"
    )
    yield Formula(
        f"{g}rayleigh_depth",
        r"0.008569\, \lambda^{-4} (1 + 0.0113 \lambda^{-2} + 0.00013 \lambda^{-4})\, e^{-h / 8434.5\,\mathrm{m}}",
        "Hansen and Travis 1974",
        "exact",
        "lambda in um; the pressure falls with an isothermal scale height",
    )
    yield Formula(f"{g}aerosol_depth", r"\beta\, \lambda^{-\alpha}", "Angstrom 1929", "exact", "lambda in um")
    yield Formula(f"{g}photon_energy_j", r"h c / \lambda", "Planck", "exact")


def _beams() -> Iterator[Formula]:
    b = "link.beams.LitAperture."
    yield Formula(
        f"{b}efficiency",
        r"\frac{2}{a^2} (e^{-a^2} - e^{-a^2 o^2})^2",
        "Klein and Degnan, Appl. Opt. 13 (1974) 2134",
        "exact",
    )
    yield Formula(f"{b}passed", r"e^{-2 a^2 o^2} - e^{-2 a^2}", "power of a Gaussian beam through a ring", "exact")
    yield Formula(
        f"{b}loss_db",
        r"(A(x) / A(0))^2,\ A = \int e^{-a^2 \rho^2} J_0(x \rho) \rho\, d\rho,\ x = \pi D \epsilon / \lambda",
        "diffraction integral of a round aperture; (2 J1(x) / x)^2 for even light (Airy)",
        "exact",
    )
    yield Formula(
        f"{b}gain_db",
        r"G\, \eta / M^4",
        "embedded Gaussian",
        "reduction",
        "angles grow with M2, the gain falls with its square",
    )
    beam = beams.LitAperture(_D, _WAVE, 0.0, 0.0)
    curved = float(beams.GaussianFall(beam.half_angle_rad).loss_db(_ERROR)) - float(beam.loss_db(_ERROR))
    yield Formula(
        f"{b}half_angle_rad",
        r"\theta = 2 / (x_1 \sqrt{\langle \rho^2 \rangle})",
        "Gaussian of the same curvature on the axis",
        "reduction",
        f"{curved:+.3f} dB against the pattern of even light",
    )


def _receivers() -> Iterator[Formula]:
    r, common = "link.receivers.", {"wavelength_m": _WAVE, "bit_error_ratio": 1e-9, "bandwidth_hz": 1e10}
    counting = float(receiver.OokCounting(**common, detection_efficiency=1.0).photons_per_bit(1e9))
    pin = receiver.OokPin(**common, quantum_efficiency=1.0, thermal_noise_a_sqrt_hz=0.0)
    shot = float(pin.photons_per_bit(1e9))
    agrawal = "Agrawal, Fiber-Optic Communication Systems"
    yield Formula(f"{r}OokCounting", r"P_b = \frac{1}{2} e^{-2 q n}", f"Poisson counts; {agrawal}", "exact")
    yield Formula(
        f"{r}PpmCounting",
        r"P_w = \frac{M - 1}{M} e^{-q n}",
        "erasure channel; with background the sum over all counts and ties",
        "exact",
    )
    yield Formula(
        f"{r}OokPin",
        r"P_b = \frac{1}{2} \mathrm{erfc}(Q / \sqrt{2})",
        f"{agrawal}; Personick 1973",
        "reduction",
        f"Gaussian noise: without thermal noise {_db(shot / counting):.2f} dB more than counting, {shot:.1f} photons",
    )
    yield Formula(
        f"{r}OokApd",
        r"F = k M + (1 - k)(2 - 1/M)",
        "McIntyre, IEEE T-ED 13 (1966) 164",
        "reduction",
        "Gaussian: the long tail of the avalanche's gain is left out",
    )
    yield Formula(f"{r}apd_excess_noise_factor", r"k M + (1 - k)(2 - 1/M)", "McIntyre 1966", "exact")
    ideal = receiver.OokPreamplified(
        **common, noise_figure_db=3.0, gain_db=60.0, optical_bandwidth_hz=1e9, polarisations=1
    )
    beats = float(ideal.photons_per_bit(1e9))
    yield Formula(
        f"{r}OokPreamplified",
        r"Q = (i_1 - i_0) / (\sigma_1 + \sigma_0)",
        f"{agrawal}; Olsson, J. Lightwave Technol. 7 (1989) 1071",
        "in conflict",
        f"{_db(beats / 38.3):.2f} dB more than the chi-square laws (38.3 photons, 1e-9, one polarisation)",
    )
    yield Formula(
        f"{r}DpskPreamplified",
        r"P_b = \frac{1}{2} e^{-n / (n_{sp} + N)}",
        "Humblet and Azizoglu, J. Lightwave Technol. 9 (1991) 1576",
        "exact",
    )
    yield Formula(
        f"{r}BpskHomodyne",
        r"P_b = \frac{1}{2} \mathrm{erfc} \sqrt{2 q n / (1 + 2 q N)}",
        agrawal,
        "exact",
    )
    yield Formula(f"{r}BpskHeterodyne", r"P_b = \frac{1}{2} \mathrm{erfc} \sqrt{q n / (1 + 2 q N)}", agrawal, "exact")
    yield Formula(
        f"{r}QpskHomodyne",
        r"P_b = \left\langle \frac{1}{2} \mathrm{erfc} \left[ \sqrt{q n / (1 + q N)} \right. \right. "
        r"\left. \left. (\cos \phi - \sin \phi) \right] \right\rangle",
        "both quadratures: Yuen and Shapiro 1980; phase error: Prabhu, IEEE Trans. AES-12 (1976) 275",
        "exact",
    )
    yield Formula(
        f"{r}QpskHeterodyne",
        r"P_b = \left\langle \frac{1}{2} \mathrm{erfc} \left[ \sqrt{q n / (1 + 2 q N)} \right. \right. "
        r"\left. \left. (\cos \phi - \sin \phi) \right] \right\rangle",
        "as above, with the image band",
        "exact",
    )
    yield Formula(
        f"{r}background_power_w", r"L A \pi \sin^2(\phi / 2)\, d", "radiance over the cone of the field", "exact"
    )
    yield Formula(f"{r}background_photons_per_mode", r"L \lambda^5 / (2 h c^2)", "one mode, one polarisation", "exact")


def _pointing() -> Iterator[Formula]:
    s, toyoshima = "link.pointing.statistics.", "Toyoshima et al. 2002"
    yield Formula(f"{s}transmission", r"h = \exp(-2 r^2 / \theta^2)", "Gaussian beam", "exact")
    mean = r"\prod \frac{\exp(-2 b^2 / (\theta^2 + 4 \sigma^2))}{\sqrt{1 + 4 \sigma^2 / \theta^2}}"
    yield Formula(
        f"{s}mean_transmission", mean, f"{toyoshima}: 1 / (1 + 4 s^2 / theta^2) of equal axes without bias", "exact"
    )
    yield Formula(f"{s}mean_loss_db", r"-10 \lg E[h]", toyoshima, "exact")
    yield Formula(
        f"{s}outage_probability",
        r"P(h < x) = x^{\theta^2 / (4 \sigma^2)}",
        f"{toyoshima}; any bias and axes by quadrature",
        "exact",
    )
    yield Formula(f"{s}outage_loss_db", r"8.686\, (r_p / \theta)^2", "quantile of the radial error", "exact")
    yield Formula(f"{s}radius_of_loss_rad", r"r = \theta \sqrt{L / 8.686}", "Gaussian beam", "exact")
    yield Formula(
        f"{s}best_divergence_for_outage",
        r"\theta = 2 \sigma \sqrt{\ln (1 / p)}",
        "largest gain less loss; 4.343 dB are lost there",
        "exact",
    )
    yield Formula(f"{s}best_divergence_for_static_error", r"\theta = \sqrt{2}\, \epsilon", "as above", "exact")
    f = "link.pointing.fading."
    yield Formula(
        f"{f}level_crossing_rate_hz",
        r"\frac{\dot\sigma}{\sqrt{2 \pi}} \frac{R}{\sigma^2} e^{-R^2 / (2 \sigma^2)}",
        "Rice 1944, for two axes; any bias and axes by quadrature",
        "exact",
    )
    yield Formula(f"{f}motion_of_spectrum", r"\int (2 \pi f)^2 S\, df", "variance of a derivative", "exact")
    yield Formula(f"{f}fades", r"\bar t = P / \nu", "share of time over rate", "exact")
    yield Formula(f"{f}mean_error_ratio", r"\int P_b(h)\, p(h)\, dh", "mean over slow fades", "exact")
    yield Formula(f"{f}uncoded_penalty_db", r"E[P_b(10^{x/10} h)] = P_b(1)", "solved for x", "exact")
    yield Formula(f"{f}penalty_db", r"\sum_k p_k P_b(10^{x/10} h_k) = P_b(1)", "solved for x", "exact")
    yield Formula(
        f"{f}fades_of_both",
        r"\frac{1}{\sqrt{2 \pi}} \int \int p(\mathbf{u})\, p(\mathbf{v})\, |\nabla L \cdot \dot{\boldsymbol\sigma}|\, "
        r"\delta(L - L_0)\, d\mathbf{u}\, d\mathbf{v}",
        "Rice 1944, for the four axes of two ends, whose losses L add up; by quadrature",
        "exact",
    )
    e = "link.coupling.ends."
    yield Formula(
        f"{e}best_truncation",
        r"2 a^2 (e^{-a^2} - e^2 e^{-a^2 e^2}) = e^{-a^2 e^2} - e^{-a^2}",
        "most of \\(2 (e^{-a^2 e^2} - e^{-a^2})^2 / a^2\\), Ruilier 1998",
        "exact",
    )
    yield Formula(f"{e}truncation_of_mode", r"a = \frac{\pi w D}{2 \lambda f}", "Gaussian mode in the focus", "exact")
    yield Formula(
        f"{e}turbulent_share",
        r"8 a^2 \int_0^1 \int_0^1 e^{-(a^2 + A)(u^2 + v^2)} I_0(2 A u v)\, u v\, du\, dv",
        "Dikmelik and Davidson 2005, for a Gaussian coherence of the field; by quadrature",
        "exact",
    )
    yield Formula(f"{e}narrowed", r"2 f \tan \arcsin NA", "cone of a fibre in the aperture", "exact")
    yield Formula(
        "link.radial_error.radial_cdf",
        r"P(r < R)",
        "two Gaussian axes with any bias and rms, by quadrature; noncentral chi-square of like axes",
        "exact",
    )
    yield from _summation()
    yield Formula(
        "link.pointing.error_classes.error_term",
        r"\mu = W,\ \sigma = E / k",
        "ECSS-E-ST-60-10C, Tables B-2, B-3, B-7 (random, bias); drift and transient are ours",
        "other source",
        "the standard has no drift and no transient",
    )
    yield Formula("mission.tables.pointing.point_ahead_rad", r"2 v / c", "first order in v / c", "exact")


def _summation() -> Iterator[Formula]:
    file = load_mission(ROOT / "missions" / "paper.toml")
    m = file.mission
    budget = open_loop_budget(m.pointing, link.Shared.of(m), m.beacon, file.sources)
    named = {each.rule: each for each in budget.summations}
    exact = named["exact"].total_rad
    functions = {
        "rss": ("rss_rad", r"\sqrt{\sum E^2}", "in conflict"),
        "esa-1993": ("esa_1993_rad", r"\sum_{c} \sqrt{\sum_{c} E^2}", "in conflict"),
        "ecss-axis": ("axis_totals_rad", r"\lvert \sum \mu \rvert + n_p \sqrt{\sum \sigma^2}", "exact"),
        "ecss-radial": ("radial_total_rad", r"\sqrt{\mu_x^2 + \mu_y^2} + n_p \sqrt{\sigma_x^2 + \sigma_y^2}", "exact"),
        "rayleigh": ("rayleigh_total_rad", r"\sigma \sqrt{-2 \ln (1 - P)}", "reduction"),
        "exact": ("exact_total_rad", r"P(r < R) = P", "exact"),
    }
    for rule, (name, formula, status) in functions.items():
        each = named[rule]
        shown = f"{each.total_rad * 1e6:.0f} µrad for the paper's mission"
        beside = (
            "" if rule == "exact" else f", {20 * math.log10(each.total_rad / exact):+.2f} dB of area to the exact total"
        )
        yield Formula(f"link.pointing.summation.{name}", formula, each.authority, status, shown + beside)
    yield Formula(
        "link.pointing.summation.mean_and_sigma", r"\sum \mu,\ \sqrt{\sum \sigma^2}", "ECSS-E-ST-60-10C 4.2.3", "exact"
    )
    yield Formula(
        "link.pointing.summation.sigma_multiple", r"n_p = \Phi^{-1}((1 + P) / 2)", "ECSS-E-ST-60-10C 4.2.4.1", "exact"
    )


def _acquisition() -> Iterator[Formula]:
    a = "link.acquisition."
    facts = module("tests/link/test_facts_link.py")
    yield Formula(f"{a}scan.Search.radius_rad", r"R = \sigma \sqrt{-2 \ln (1 - P)}", "Rayleigh distribution", "exact")
    yield Formula(
        f"{a}scan.Spiral.duration_s",
        r"T = \pi R^2 / (p\, v)",
        "area over pitch and speed",
        "reduction",
        "constant speed along the track",
    )
    yield Formula(
        f"{a}scan.StepStare.dwells",
        r"\pi R^2 / (\frac{\sqrt{3}}{2} p^2)",
        "hexagonal grid",
        "in conflict",
        f"budgets that count dwells of half a radius have {facts.HALF_RADIUS_STEPS} for 300 µrad and a beam of 20 µrad",
    )
    yield Formula(
        f"{a}scan.Detector.crossing_probability", r"1 - (1 - p)^n", "independent looks in a crossing", "exact"
    )
    yield Formula(
        f"{a}detection.gap_probability",
        r"\prod_k (1 - q(u + k p))",
        "ours: a vibration that stands still in a crossing",
        "other source",
        "simulate_scan has any correlation time",
    )
    yield Formula(
        f"{a}detection.detection_times",
        r"P(T < t)",
        "ours: crossings in their order",
        "other source",
        "as the row above",
    )
    yield Formula(
        f"{a}sequence.frame_detection_probability",
        r"\frac{1}{2} \mathrm{erfc}((t - s) / \sqrt{2})",
        "Gaussian tail",
        "exact",
    )
    yield Formula(f"{a}sequence.frames_detection_probability", r"1 - (1 - p)^n", "independent frames", "exact")
    yield Formula(f"{a}sequence.solve_sequence", r"(I - Q)^{-1} R", "absorbing chain of the paper's stages", "exact")
    yield Formula(
        f"{a}trade.Receiver.detection_time_s",
        r"t \propto P^{-2}",
        "matched integration",
        "reduction",
        "white noise that does not depend on the light",
    )
    yield Formula(
        f"{a}trade.Beams.irradiance_w_m2",
        r"\frac{2 P}{\pi \theta^2 L^2} e^{-2 (\epsilon / \theta)^2}",
        "Gaussian beam",
        "exact",
    )
    yield Formula(
        "loop.sensor.AirySpot.per_noise_rad",
        r"\pi \sqrt{(3/16)^2 + (n/8)^2}\ \lambda / D",
        "Tyler and Fried, JOSA 72 (1982) 804",
        "exact",
        "within 4.2 % of the integral over the transfer function",
    )
    yield Formula("loop.sensor.GaussianSpot.per_noise_rad", r"W / (\sqrt{8 / \pi} f)", "Gaussian spot, 1.596", "exact")


_GROUPS = {
    "Gains and losses": _gains,
    "Beams": _beams,
    "Receivers": _receivers,
    "Pointing": _pointing,
    "Acquisition and tracking sensor": _acquisition,
}


def formulas() -> dict[str, tuple[Formula, ...]]:
    """All formulas by what they are about.

    Raises:
        LookupError: Where one stands for nothing in the package, or a function of these modules has no row.
    """
    found = {title: tuple(group()) for title, group in _GROUPS.items()}
    every = [each for group in found.values() for each in group]
    for each in every:
        _resolved(each.where)
    missing = sorted(_expected() - {each.where for each in every})
    if missing:
        raise LookupError(
            f"no row of scripts/site_pages/formulas.py has {', '.join(missing)}; add one, with its source"
        )
    return found


def _resolved(where: str) -> object:
    parts = where.split(".")
    for cut in range(len(parts) - 1, 0, -1):
        try:
            found: object = import_module(".".join(("microrad", *parts[:cut])))
        except ModuleNotFoundError:
            continue
        for name in parts[cut:]:
            found = getattr(found, name)
        return found
    raise LookupError(f"microrad.{where} is not there")


def _expected() -> set[str]:
    """Public functions of the modules that hold nothing but formulas, and all receivers."""
    found = {f"link.receivers.{name}" for name in receiver.__all__ if name not in ("Receiver", "RateError")}
    for name in _COVERED:
        members = vars(import_module(f"microrad.{name}"))
        found |= {
            f"{name}.{each}"
            for each, value in members.items()
            if inspect.isfunction(value) and value.__module__ == f"microrad.{name}" and not each.startswith("_")
        }
    return {each for each in found if each.rpartition(".")[2] not in _NOT_FORMULAS}


def pages() -> dict[str, str]:
    """The page of all formulas."""
    found = formulas()
    every = [each.status for group in found.values() for each in group]
    counted = ", ".join(
        f"{every.count(status)} {status}" for status in ("exact", "reduction", "other source", "in conflict")
    )
    parts = [_HEAD, f"{len(every)} formulas: {counted}."]
    for title, group in found.items():
        parts += [f"## {title}", table(("where", "formula", "source", "status", "difference"), _rows(group), wide=True)]
    return {"formulas.md": "\n\n".join(parts) + "\n"}


def _rows(group: Iterable[Formula]) -> Iterator[tuple[str, ...]]:
    for each in group:
        yield code(each.where), f"${each.formula}$", plain(each.source), each.status, plain(each.difference)
