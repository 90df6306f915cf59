"""Checks of what a loop leaves: spectra, parameters of controllers, room to gain, counts of limits, traces."""

import math
from collections.abc import Iterator

import numpy as np

from microrad.report.verification.check import Check
from microrad.report.verification.checks.loop import Axis, optical
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_ROUNDING = "rounding"


def _room(workspace: Workspace) -> Iterator[Comparison]:
    """What is gained, and what is left to gain, from the residuals that are printed."""
    numbers = workspace.numbers("run")
    name = "fine_pointing.controllers"
    theory = {n.split(".")[2]: numbers[n] for n in numbers if n.startswith(name) and n.endswith(".theory_rms_rad")}
    given = {c: numbers[f"{name}.{c}.simulated.given.rms_rad"] for c in theory}
    bound, first = numbers["fine_pointing.linear_bound_rms_rad"], next(iter(theory))
    chosen = workspace.study.fine_pointing.best.design.name
    for key, expected in (
        ("rms_gained_over_baseline", (given[first] - given[chosen]) / given[first]),
        ("rms_left_to_gain.linear_at_baseline", (theory[first] - bound) / theory[first]),
        ("rms_left_to_gain.linear_at_nearest", (min(theory.values()) - bound) / min(theory.values())),
        ("rms_left_to_gain.baseline_with_hysteresis", (given[first] - bound) / given[first]),
    ):
        yield workspace.compared("run", f"fine_pointing.{key}", max(expected, 0.0), 1e-9, _ROUNDING)


def _tuned(workspace: Workspace) -> Iterator[Comparison]:
    """Integral and zero of the controllers of PI kind from their responses at the two ends of the band."""
    axis, gain = Axis(workspace.given), workspace.given("mirror.bouc_wen.d1")  # Eq. 2 is normalised to a gain of 1
    for each in optical(workspace):
        name = each.design.name
        if not name.startswith("PI") or "notch" in name:
            continue
        response = axis.controller(each.design.tuned.controller.system)
        # slow: the integral alone; at half of the rate it has half a sample's worth
        integral = abs(response[0]) * 2.0 * math.pi * axis.freq_hz[0]
        proportional = float(response[-1].real) - integral * axis.period_s / 2.0
        key = f"fine_pointing.controllers.{name}.parameters"
        crossover = integral * gain / (2.0 * math.pi)
        why = "0.1 %: printed with four digits"
        yield workspace.compared("run", f"{key}.integral frequency.value", crossover, 1e-3 * crossover, why)
        zero = integral / proportional / (2.0 * math.pi)
        yield workspace.compared("run", f"{key}.zero.value", zero, 1e-3 * zero, why)


def _spectra(workspace: Workspace) -> Iterator[Comparison]:
    """Spectra of the residual: predicted by the loop's sensitivities, simulated by the sum over all frequencies."""
    given, fine = workspace.given, workspace.study.fine_pointing
    axis = Axis(given)
    noise_rad = workspace.numbers("budget")["tracking.noise_equivalent_angle_rad"]
    step = math.exp(-2.0 * math.pi * axis.period_s)
    variance = 40.0 * math.pi * 1e-12  # of an axis, OLYMPUS: 160 / (1 + f^2) urad^2/Hz, radial
    shake = 2.0 * axis.period_s * variance * (1.0 - step**2) / np.abs(1.0 - step / axis.z) ** 2
    for each in optical(workspace):
        controller = axis.controller(each.design.tuned.controller.system)
        loop = controller * axis.plant()
        power = (shake + 2.0 * axis.period_s * noise_rad**2 * np.abs(loop) ** 2) / np.abs(1.0 + loop) ** 2
        for freq_hz in (30.0, 100.0, 300.0, 1000.0, 2000.0):
            place = int(np.argmin(np.abs(fine.freq_hz - freq_hz)))
            expected = float(np.interp(fine.freq_hz[place], axis.freq_hz, power))
            what = f"predicted spectrum of the residual at {fine.freq_hz[place]:.4g} Hz under {each.design.name}"
            obtained = float(each.predicted_rad2_hz[place, 1])
            why = "4 %, twice that of an amplitude: vibration within a period"
            yield Comparison(
                "fine_pointing.spectra.predicted.value", what, expected, obtained, 0.04 * expected, "rad^2/Hz", why
            )
        rms = workspace.numbers("run")[f"fine_pointing.controllers.{each.design.name}.simulated.given.rms_rad"]
        if rms > 2.0 * each.theory.radial_rms_rad:  # the observer, which hysteresis carries far from its theory
            continue
        simulated = each.spectrum_rad2_hz.sum(axis=0) * (fine.freq_hz[1] - fine.freq_hz[0])
        for which, (found, own) in enumerate(zip(simulated, each.simulated["given"].axis_rms_rad, strict=True)):
            what = f"simulated spectrum under {each.design.name}, axis {which}: sum over all frequencies"
            expected = float(own) ** 2
            why = "5 %: windows weigh the ends of a run less than its middle, and take off its mean"
            yield Comparison(
                "fine_pointing.spectra.residual.value", what, expected, float(found), 0.05 * expected, "rad^2", why
            )


CHECKS = (
    Check(
        "room",
        "What is gained over the baseline, and what the bound leaves to gain",
        Referent.INDEPENDENT,
        "Ratios of the residuals that are printed.",
        "definition",
        _room,
    ),
    Check(
        "parameters",
        "Parameters of tuned controllers from their responses",
        Referent.INDEPENDENT,
        "Response of the matrices at either end of the band, and the gain in the mission's text.",
        "backward differences of a PI",
        _tuned,
    ),
    Check(
        "spectra",
        "Spectra of the residual, predicted and simulated",
        Referent.INDEPENDENT,
        "Sensitivities by partial fractions; Parseval.",
        "Wittig et al. 1990 for the vibration; Welch 1967",
        _spectra,
    ),
)
