"""Checks of the link: budgets by plain formulas from the mission's text, beams by quadrature, jitter by draws."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import integrate

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_ROUNDING = "rounding of a sum of a dozen decibels"
_PLANCK_J_S, _LIGHT_M_S, _CHARGE_C = 6.62607015e-34, 299792458.0, 1.602176634e-19
_APERTURES = {"Communication": ("leo", "geo"), "Beacon": ("leo", "geo"), "Answer": ("geo", "leo")}
_LOSSES = {
    "Transmit optics loss": "transmit_optics_loss",
    "Strehl loss": "strehl",
    "Receive optics loss": "receive_optics_loss",
    "Tracking split loss": "tracking_split_loss",
    "Implementation loss": "implementation_loss",
}


def _db(ratio: float) -> float:
    return 10.0 * math.log10(ratio)


def link(given: Any, name: str, **changed: float) -> dict[str, float]:
    """Lines, totals and what follows of one of the mission's three links, by formulas of textbooks."""
    table = name.lower()

    def value(key: str) -> float:
        return float(changed.get(key, given(f"{table}.{key}")))

    near, far = _APERTURES[name]
    sends, receives = (changed.get(key, given(f"terminals.{key}")) for key in (f"{near}_aperture", f"{far}_aperture"))
    wavelength_m, distance_m, data = value("wavelength"), value("distance"), table == "communication"
    half_angle_rad = 2.0 * wavelength_m / (math.pi * sends) if data else value("divergence") / 2.0
    gain = (math.pi * sends / wavelength_m) ** 2 if data else 8.0 / half_angle_rad**2
    gain_line = f"{near.upper()} aperture gain" if data else "Beam gain"
    lines = {
        "Transmit power": _db(value("transmit_power") / 1e-3),
        gain_line: _db(gain),
        "Pointing loss": -_db(math.exp(2.0 * (value("pointing_error") / half_angle_rad) ** 2)),
        "Point-ahead loss": 0.0,
        "Free-space loss": -20.0 * math.log10(4.0 * math.pi * distance_m / wavelength_m),
        f"{far.upper()} aperture gain": 20.0 * math.log10(math.pi * receives / wavelength_m),
    }
    for line, key in _LOSSES.items():
        if key in given(table):
            lines[line] = -value(key)
    at_receiver = sum(lines.values())
    photon_j = _PLANCK_J_S * _LIGHT_M_S / wavelength_m
    required_w = value("receiver_sensitivity") * photon_j * value("data_rate") if data else value("required_power")
    received_w = 1e-3 * 10.0 ** (at_receiver / 10.0)
    area_m2 = math.pi * receives**2 / 4.0
    behind = sum(lines.get(k, 0.0) for k in ("Receive optics loss", "Tracking split loss", "Implementation loss"))
    irradiance = received_w / 10.0 ** (behind / 10.0) / area_m2
    found = {f"lines.{line}.value": each for line, each in lines.items()}
    found["totals.Received power.value"] = at_receiver
    found["totals.Required power.value"] = _db(required_w / 1e-3)
    found["totals.Margin.value"] = found["margin_db"] = at_receiver - _db(required_w / 1e-3)
    found |= {"received_power_w": received_w, "required_power_w": required_w, "irradiance_w_m2": irradiance}
    pointed = irradiance * 10.0 ** (-lines["Pointing loss"] / 10.0)
    found["irradiance_on_axis_w_m2"] = pointed * 10.0 ** (value("strehl") / 10.0)
    found["radiant_intensity_w_sr"] = pointed * distance_m**2
    found["required_irradiance_w_m2"] = irradiance * required_w / received_w
    if data:
        found["received_photons_per_bit"] = received_w / photon_j / value("data_rate")
    return found


def _budgets(workspace: Workspace) -> Iterator[Comparison]:
    given = workspace.given
    for name in _APERTURES:
        for key, expected in link(given, name).items():
            document = f"budgets.{name}.{key}"
            least = 1e-9 if key.endswith(("value", "_db")) else 0.0
            yield workspace.compared("budget", document, expected, max(least, 1e-9 * abs(expected)), _ROUNDING)
    at_required = link(given, "Communication", pointing_error=given("requirement.pointing_error"))["margin_db"]
    rate_bit_s = given("communication.data_rate") * 10.0 ** ((at_required - given("requirement.margin")) / 10.0)
    yield workspace.compared("budget", "largest_data_rate_bit_s", rate_bit_s, 1e-9 * rate_bit_s, _ROUNDING)


def _standard(workspace: Workspace) -> Iterator[Comparison]:
    """What a standard asks of the light, by the same formulas: a beam's full width at half maximum, other distances."""
    given = workspace.given
    data, beacon = link(given, "Communication"), link(given, "Beacon")
    half_angle_rad = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    optics_db = given("communication.transmit_optics_loss")
    own_m2, wide_m2 = given("communication.distance") ** 2, given("beacon.distance") ** 2
    aimed = data["irradiance_w_m2"] * 10.0 ** (-data["lines.Pointing loss.value"] / 10.0)
    for name, expected in {
        "acquisition_irradiance": beacon["irradiance_w_m2"] * wide_m2 / 5500e3**2,
        "mean_irradiance": data["irradiance_w_m2"] * own_m2 / 5500e3**2,
        "burst_irradiance": data["irradiance_w_m2"] * own_m2 / 20000e3**2,
        "largest_irradiance": aimed,
        "transmit_power": 1e-3 * 10.0 ** ((data["lines.Transmit power.value"] - optics_db) / 10.0),
        "divergence": math.sqrt(2.0 * math.log(2.0)) * half_angle_rad,
        "required_irradiance": data["required_irradiance_w_m2"],
    }.items():
        key = f"standard.clauses.{name}.value"
        yield workspace.compared("standard", key, expected, 1e-9 * expected, _ROUNDING)


def _under_errors(workspace: Workspace) -> Iterator[Comparison]:
    """What follows from the residual of the loop: largest error, rates, ranges, costs; by the same formulas."""
    given, numbers = workspace.given, workspace.numbers("run")
    budget = link(given, "Communication")
    on_axis_db = budget["margin_db"] - budget["lines.Pointing loss.value"]
    half_angle_rad = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    per_square = 2.0 * _db(math.e) / half_angle_rad**2
    required_db = given("requirement.margin")
    largest = math.sqrt((on_axis_db - required_db) / per_square)
    yield workspace.compared("run", "largest_pointing_error_rad", largest, 1e-9 * largest, _ROUNDING)
    for name, error_rad in (
        ("static", given("communication.pointing_error")),
        ("at_residual", numbers["residual.used_rad"]),
    ):
        margin = on_axis_db - per_square * error_rad**2
        yield workspace.compared("run", f"margin_db.communication_{name}", margin, 1e-9, _ROUNDING)
    for place in range(sum(n.startswith("performance.") and n.endswith(".outage_loss_db") for n in numbers)):
        name = f"performance.{place}"
        margin = on_axis_db - numbers[f"{name}.outage_loss_db"]
        yield workspace.compared("run", f"{name}.margin_db", margin, 1e-9, _ROUNDING)
        rate = given("communication.data_rate") * 10.0 ** ((margin - required_db) / 10.0)
        yield workspace.compared("run", f"{name}.data_rate_bit_s", rate, 1e-9 * rate, _ROUNDING)
    for place in range(sum(n.startswith("day.rates.") and n.endswith(".rate_bit_s") for n in numbers)):
        name = f"day.rates.{place}"
        slower_db = _db(given("communication.data_rate") / numbers[f"{name}.rate_bit_s"])
        margin = on_axis_db - numbers["day.pointing_loss_db"] + slower_db
        yield workspace.compared("run", f"{name}.margin_db", margin, 1e-9, _ROUNDING)
        reach = given("communication.distance") * 10.0 ** ((margin - given("operations.margin")) / 20.0)
        yield workspace.compared("run", f"{name}.largest_range_m", reach, 1e-9 * reach, _ROUNDING)
    study = workspace.study.performance
    cases = {(case.source, case.controller, case.mirror): place for place, case in enumerate(study.cases)}
    for place, cost in enumerate(study.costs):
        places = [cases[cost.source, cost.controller, mirror] for mirror in (cost.mirror, "no hysteresis")]
        lost = [numbers[f"performance.{each}.outage_loss_db"] for each in places]
        key = f"hysteresis_costs.{place}.margin_change_db"
        yield workspace.compared("run", key, lost[1] - lost[0], 1e-9, _ROUNDING)
        spare = [(on_axis_db - each - required_db) / 10.0 for each in lost]
        rates = [given("communication.data_rate") * 10.0**each for each in spare]
        key = f"hysteresis_costs.{place}.data_rate_change_bit_s"
        yield workspace.compared("run", key, rates[0] - rates[1], 1e-9 * rates[1], _ROUNDING)


def _tornado(workspace: Workspace) -> Iterator[Comparison]:
    numbers = workspace.numbers("budget")
    ends = [name for name in numbers if name.startswith("tornado.") and name.endswith(("margin_low_db", "high_db"))]
    for name in ends:
        key, _, end = name.removeprefix("tornado.").rpartition(".")
        value = numbers[f"tornado.{key}.{end.split('_')[1]}"]
        expected = link(workspace.given, "Communication", **{key.rpartition(".")[2]: value})["margin_db"]
        yield workspace.compared("budget", name, expected, 1e-9 * max(1.0, abs(expected)), _ROUNDING)


def _far_field(workspace: Workspace) -> Iterator[Comparison]:
    """Gains of apertures on their axis by integrals of their fields."""
    from microrad.link.beams import LitAperture

    wavelength_m, how = workspace.given("communication.wavelength"), "error of the quadrature"
    for end in ("leo", "geo"):
        edge_m = workspace.given(f"terminals.{end}_aperture") / 2.0
        expected = _on_axis_db(lambda radius: 1.0, 0.0, edge_m, wavelength_m)
        name = f"budgets.Communication.lines.{end.upper()} aperture gain.value"
        yield workspace.compared("budget", name, expected, 1e-6, how)
    for obscured in (0.0, 0.2, 0.4):
        lit = LitAperture(0.1, wavelength_m, truncation=1.25, obscuration=obscured)

        def field(radius_m: float) -> float:
            return math.exp(-((radius_m / 0.04) ** 2))

        power = integrate.quad(lambda r: 4.0 * r / 0.04**2 * field(r) ** 2, 0.05 * obscured, 0.05)[0]
        expected = _on_axis_db(field, 0.05 * obscured, 0.05, wavelength_m) + _db(power)
        what = f"gain of a Gaussian beam through an aperture of 0.1 m, obscured by {obscured:g}"
        yield Comparison("budget.budgets.*.lines.Beam gain.value", what, expected, lit.gain_db, 1e-6, "dB", how)


def _on_axis_db(field: Callable[[float], float], inner_m: float, outer_m: float, wavelength_m: float) -> float:
    """Gain on the axis of a field over a ring, over what passes the ring."""
    whole = integrate.quad(lambda r: field(r) * 2.0 * math.pi * r, inner_m, outer_m)[0]
    power = integrate.quad(lambda r: field(r) ** 2 * 2.0 * math.pi * r, inner_m, outer_m)[0]
    return _db(4.0 * math.pi * whole**2 / (wavelength_m**2 * power))


def _tracking(workspace: Workspace) -> Iterator[Comparison]:
    given = workspace.given
    power_w = link(given, "Answer")["received_power_w"]
    bandwidth_hz = given("acquisition.sensor.rate") / 2.0
    current_a = given("acquisition.sensor.responsivity") * power_w
    lines = {
        "Signal shot noise": math.sqrt(2.0 * _CHARGE_C * current_a * bandwidth_hz),
        "Background shot noise": 0.0,
        "Dark-current shot noise": math.sqrt(8.0 * _CHARGE_C * given("acquisition.sensor.dark_current") * bandwidth_hz),
        "Thermal noise": 2.0 * given("acquisition.sensor.thermal_noise") * math.sqrt(bandwidth_hz),
    }
    for line, expected in lines.items():
        yield workspace.compared("budget", f"tracking.lines.{line}.value", expected, 1e-9 * expected, _ROUNDING)
    ratio = current_a / math.sqrt(sum(each**2 for each in lines.values()))
    diameter_m = given("terminals.leo_aperture")
    angle_rad = math.pi * 3.0 / 16.0 * given("answer.wavelength") / diameter_m / ratio
    yield workspace.compared("budget", "tracking.power_w", power_w, 1e-9 * power_w, _ROUNDING)
    yield workspace.compared("budget", "tracking.signal_to_noise", ratio, 1e-9 * ratio, _ROUNDING)
    source = "rounding; Tyler and Fried 1982 without a gap between the cells"
    yield workspace.compared("budget", "tracking.noise_equivalent_angle_rad", angle_rad, 1e-9 * angle_rad, source)


def _point_ahead(workspace: Workspace) -> Iterator[Comparison]:
    given = workspace.given
    angle_rad = 2.0 * given("point_ahead.transverse_velocity") / _LIGHT_M_S
    beam_rad = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    error_rad = given("communication.pointing_error")
    loss_db = _db(math.e) * 2.0 * ((angle_rad + error_rad) ** 2 - error_rad**2) / beam_rad**2
    names = {"angle_rad": angle_rad, "beam_half_angles": angle_rad / beam_rad, "mirror_range_rad": 2.0 * angle_rad}
    for name, expected in {**names, "loss_db": loss_db}.items():
        relativity = "2 v / c against the exact aberration: v / c"
        yield workspace.compared("budget", f"point_ahead.{name}", expected, 1e-4 * expected, relativity)


def _solved(workspace: Workspace) -> Iterator[Comparison]:
    """Values that a key was solved for, put back into the budget made anew: they leave what is required."""
    from microrad.link.study import solve_key
    from microrad.mission.file import load_link

    file, given = load_link(workspace.mission_path), workspace.given
    required = given("requirement.margin")
    for key in ("transmit_power", "data_rate", "distance", "pointing_error", "receive_optics_loss"):
        found = solve_key(file, f"communication.{key}")
        ends = [(each.low, each.low_open) for each in found.solved.intervals]
        ends += [(each.high, each.high_open) for each in found.solved.intervals]
        for value, unbounded in ends:
            if not unbounded:
                margin = _solved_margin(given, key, value)
                what = f"margin at the solved {key.replace('_', ' ')}, {value:.4g}"
                yield Comparison("budget.solved.intervals", what, required, margin, 1e-6, "dB", "end of a search")
        margin = _solved_margin(given, key, found.solved.best)
        what = f"largest margin that {key.replace('_', ' ')} gives"
        yield Comparison("budget.solved.best.value", what, margin, found.solved.best_db, 1e-9, "dB", _ROUNDING)


def _solved_margin(given: Any, key: str, value: float) -> float:
    """Margin of the communication link with another value of one key."""
    if key.endswith("loss"):
        return float(link(given, "Communication")["margin_db"] + given(f"communication.{key}") - value)
    return link(given, "Communication", **{key: value})["margin_db"]


def _map(workspace: Workspace) -> Iterator[Comparison]:
    """The map of the margin over rate and error, and the margins that the residuals leave, by the budget made anew."""
    given, study = workspace.given, workspace.study
    of = study.margin_map
    for row in range(0, len(of.pointing_error_rad), 30):
        for column in range(0, len(of.data_rate_bit_s), 45):
            error, rate = float(of.pointing_error_rad[row]), float(of.data_rate_bit_s[column])
            expected = link(given, "Communication", pointing_error=error, data_rate=rate)["margin_db"]
            what = f"margin at {1e6 * error:.3g} urad and {rate / 1e6:.3g} Mbit/s"
            obtained = float(of.margin_db[column, row])
            yield Comparison("results.margin_map.margin.value", what, expected, obtained, 1e-9, "dB", _ROUNDING)


def _fall(workspace: Workspace) -> Iterator[Comparison]:
    """Margins under residuals without hysteresis, by the tail of two like Gaussian axes."""
    given, study, numbers = workspace.given, workspace.study, workspace.numbers("run")
    half_rad = 2.0 * given("communication.wavelength") / (math.pi * given("terminals.leo_aperture"))
    on_axis = link(given, "Communication", pointing_error=0.0)["margin_db"]
    for case in study.performance.cases:
        name = f"fine_pointing.controllers.{case.controller}.theory_rms_rad"
        if case.mirror != "no hysteresis" or name not in numbers or case.source != study.performance.cases[-1].source:
            continue
        # two like axes: the square of the radius falls off exponentially, with the square of the radial rms
        square = -(numbers[name] ** 2) * math.log(given("requirement.outage"))
        fall = 20.0 * math.log10(math.e) * square / half_rad**2
        what = f"margin under {case.controller}, {case.source}"
        why = "10 % of the fall: its quantile is of 64 runs of 2 s, 5 % of a radius"
        yield Comparison(
            "results.link_performance.margin.value", what, on_axis - fall, case.margin_db, 0.1 * fall, "dB", why
        )


def _uncoded(workspace: Workspace) -> Iterator[Comparison]:
    """Power that pointing errors cost without a code, where the mean error ratio has a closed form."""
    from scipy.special import gammainc

    from microrad.link import pointing

    for rms_rad, half_rad, photons in ((3e-6, 20e-6, 20.0), (4e-6, 20e-6, 10.0), (2e-6, 15e-6, 14.0)):
        steep = (half_rad / (2.0 * rms_rad)) ** 2  # the power h of two like axes has the density g h^(g - 1)
        target = 0.5 * math.exp(-photons)
        low, high = 0.0, 30.0
        for _ in range(100):
            middle = (low + high) / 2.0
            lit = photons * 10.0 ** (middle / 10.0)
            mean = 0.5 * steep * lit**-steep * math.gamma(steep) * float(gammainc(steep, lit))
            low, high = (middle, high) if mean > target else (low, middle)
        jitter = pointing.Jitter((0.0, 0.0), (rms_rad, rms_rad))

        def ratio(power: Any, photons: float = photons) -> Any:
            return 0.5 * np.exp(-photons * power)

        found = pointing.uncoded_penalty_db(jitter, half_rad, ratio)
        what = f"penalty without a code at {1e6 * rms_rad:g} urad, beam of {1e6 * half_rad:g} urad, {photons:g} photons"
        why = "0.01 dB: steps of the radius"
        yield Comparison("budget.under_jitter.uncoded_penalty_db", what, low, found, 0.01, "dB", why)


def _coupling(workspace: Workspace) -> Iterator[Comparison]:
    """Light into fibres and onto a detector, and what random errors of both ends lose, where integrals are closed."""
    from scipy.integrate import quad
    from scipy.special import j0, j1

    from microrad.link import coupling
    from microrad.link.beams import GaussianFall
    from microrad.link.radial_error import Jitter, radial_steps

    name = "budget.budgets.*.lines.Coupling loss.value"
    for hole, truncation, error_urad in ((0.0, 1.12, 0.0), (0.3, 1.5, 4.0), (0.2, 0.8, 9.0)):
        pupil = coupling.Pupil(0.15, 1.55e-6, hole, truncation=truncation)
        x = math.pi * 0.15 / 1.55e-6 * 1e-6 * error_urad

        def light(rho: float, x: float = x, truncation: float = truncation) -> float:
            return float(rho * math.exp(-((truncation * rho) ** 2)) * j0(x * rho))

        share = 8.0 * truncation**2 * quad(light, hole, 1.0, epsabs=1e-12)[0] ** 2 / (1.0 - hole**2)
        found = coupling.SingleModeFibre(pupil).loss_db(1e-6 * error_urad)
        what = f"into a single-mode fibre, obscuration {hole:g}, a = {truncation:g}, {error_urad:g} urad off"
        why = "1e-6 of the light: a spline between angles"
        yield Comparison(name, what, -_db(share), float(found), 5e-6 / share, "dB", why)
    for radius_urad in (8.0, 30.0):
        x = math.pi * 0.15 / 1.55e-6 * 1e-6 * radius_urad
        found = coupling.Disk(coupling.Pupil(0.15, 1.55e-6), radius_rad=1e-6 * radius_urad).loss_db(0.0)
        what = f"onto a detector of {radius_urad:g} urad in an Airy pattern"
        yield Comparison(name, what, -_db(1.0 - j0(x) ** 2 - j1(x) ** 2), float(found), 5e-6, "dB", why)
    # two like round errors in beams of one width: the sum of the squares has four degrees of freedom
    half_rad, rms_rad, outage = 11e-6, 2e-6, 1e-3
    narrow = coupling.SingleModeFibre(coupling.Pupil(0.15, 1.55e-6, truncation=1.12))
    sent, jitter = GaussianFall(half_rad), Jitter((0.0, 0.0), (rms_rad, rms_rad))
    received = coupling.of_jitter(narrow, jitter)
    both = coupling.BothEnds(coupling.of_beam(sent, *radial_steps(jitter)), received)
    steep = 20.0 * math.log10(math.e) * rms_rad**2 / half_rad**2

    def beyond(radius_rad: float, level: float) -> float:
        left = level - float(narrow.loss_db(radius_rad) - narrow.loss_db(0.0))
        density = radius_rad / rms_rad**2 * math.exp(-((radius_rad / rms_rad) ** 2) / 2.0)
        return density * (math.exp(-left / (2.0 * steep)) if left > 0.0 else 1.0)

    low, high = 0.0, 20.0
    for _ in range(40):
        middle = (low + high) / 2.0
        share = quad(beyond, 0.0, 8.0 * rms_rad, args=(middle,), limit=200)[0]
        low, high = (middle, high) if share > outage else (low, middle)
    what, why = "loss of both ends at random, exceeded for 0.1 % of the time", "0.005 dB: steps of the errors"
    name = "budget.budgets.*.lines.Receive pointing loss.value"
    yield Comparison(name, what, low, both.quantile_db(outage), 0.005, "dB", why)


def _lines(workspace: Workspace) -> Iterator[Comparison]:
    """Lines of the pointing budget as the mission states them."""
    given = workspace.given
    for name, key in (
        ("Body pointing", "pointing.lines.body_pointing.error"),
        ("Orbit knowledge", "pointing.lines.orbit_knowledge.error"),
        ("Misalignment", "pointing.lines.misalignment.error"),
        ("Point-ahead", "point_ahead.error"),
    ):
        expected = given(key)
        yield workspace.compared("budget", f"pointing.lines.{name}.value", expected, 1e-12 * expected, _ROUNDING)


CHECKS = (
    Check(
        "budgets",
        "Every line of the shipped mission's three links by textbook formulas from the mission's text",
        Referent.INDEPENDENT,
        "The mission's text is read by a second table of units; gains, losses and powers follow from closed forms.",
        "SPIE 11852, 118523B, Table 2; CODATA 2018",
        _budgets,
    ),
    Check(
        "standard",
        "The shipped mission's light in the terms of the SDA terminal standard",
        Referent.INDEPENDENT,
        "As the budgets; a Gaussian beam is sqrt(2 ln 2) half angles wide at half maximum.",
        "as the budgets",
        _standard,
    ),
    Check(
        "far-field",
        "Gains of apertures on their axis",
        Referent.INDEPENDENT,
        "The field over the aperture is integrated by adaptive quadrature.",
        "Klein and Degnan, Appl. Opt. 13, 2134 (1974), for the definitions",
        _far_field,
    ),
    Check(
        "coupling",
        "Light into a fibre and onto a detector, and the errors of both ends together",
        Referent.INDEPENDENT,
        "The overlap and the share beyond a loss by adaptive quadrature; an Airy pattern's light in closed form.",
        "Ruilier, Proc. SPIE 3350, 319 (1998); Rayleigh (1881)",
        _coupling,
    ),
    Check(
        "tornado",
        "Both ends of each bar of the communication link's sensitivities by a budget made anew",
        Referent.INDEPENDENT,
        "As the budgets; each input is changed by itself.",
        "as the budgets",
        _tornado,
    ),
    Check(
        "under-errors",
        "Margins, rates and ranges at the errors that the loop leaves",
        Referent.INDEPENDENT,
        "The budget made anew, with the fall of a Gaussian beam at each error.",
        "as the budgets",
        _under_errors,
    ),
    Check(
        "tracking",
        "Light and noise on the tracking sensor by closed forms",
        Referent.INDEPENDENT,
        "Shot and thermal noise of four cells; the angle of equal noise of a quad cell.",
        "Tyler and Fried, J. Opt. Soc. Am. 72, 804 (1982)",
        _tracking,
    ),
    Check(
        "point-ahead",
        "Point-ahead from the stated velocity",
        Referent.INDEPENDENT,
        "2 v / c, in beam half angles and as a loss of a Gaussian beam.",
        "special relativity, first order",
        _point_ahead,
    ),
    Check(
        "solved",
        "Values that a key was solved for, put back into the budget made anew",
        Referent.INDEPENDENT,
        "As the budgets; the ends of an interval leave what is required.",
        "as the budgets",
        _solved,
    ),
    Check(
        "margin-map",
        "The map of the margin over data rate and pointing error",
        Referent.INDEPENDENT,
        "As the budgets, point by point.",
        "as the budgets",
        _map,
    ),
    Check(
        "fall",
        "Margins under residuals without hysteresis",
        Referent.INDEPENDENT,
        "Two like Gaussian axes with the rms of linear theory, in a Gaussian beam; the product counts its errors.",
        "Rayleigh's distribution",
        _fall,
    ),
    Check(
        "uncoded",
        "Power that pointing errors cost a link without a code",
        Referent.INDEPENDENT,
        "An error ratio that falls exponentially with the power: its mean is an incomplete gamma function.",
        "closed form; Toyoshima et al., J. Opt. Soc. Am. A 19, 567 (2002), for the density",
        _uncoded,
    ),
    Check(
        "pointing-lines",
        "Lines of the pointing budget from the mission's text",
        Referent.INDEPENDENT,
        "The text is read by a second table of units.",
        "ECSS-E-ST-60-10C, annex B",
        _lines,
    ),
)
