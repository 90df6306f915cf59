"""Checks of mirror and loop: hysteresis by an adaptive solver, margins and residuals in the frequency domain."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Given, Workspace

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]


class _Hysteresis:
    """Eq. 3 of the paper with the mission's values."""

    def __init__(self, given: Given) -> None:
        """Of the mission's values."""
        keys = ("d1", "d2", "epsilon", "delta", "alpha", "beta")
        self.d1, self.d2, self.epsilon, self.delta, self.alpha, self.beta = (
            float(given(f"mirror.bouc_wen.{key}")) for key in keys
        )
        self.bias, self.limit = float(given("mirror.bias")), float(given("mirror.rate_limit"))

    def slope(self, rate: float, h: float) -> float:
        """Change of the hysteresis in time, at a rate of the drive."""
        grown = self.epsilon * math.exp(self.delta * abs(rate)) * rate
        return grown - self.beta * rate * abs(h) - self.alpha * abs(rate) * h

    def output(self, drive: Any, rate: Any, h: Any) -> Any:
        """Of the mirror's first part, at a drive about its bias."""
        return self.d1 * (np.exp(-self.d2 * rate) * (drive + self.bias) - self.bias) + h

    @property
    def model(self) -> Any:
        """The same as the product has it."""
        from microrad.mirror.hysteresis import BoucWen

        return BoucWen(
            d1_rad_v=self.d1,
            d2_s_v=self.d2,
            epsilon_rad_v=self.epsilon,
            delta_s_v=self.delta,
            alpha_1_v=self.alpha,
            beta_1_v=self.beta,
            rate_limit_v_s=self.limit,
            bias_v=self.bias,
        )


def _fractions(given: Given, corner_rad_s: float = math.inf) -> tuple[Complexes, Complexes]:
    """Poles and residues of Eq. 2 with a gain of 1 where it is normalised, behind a first-order lag if one is given."""
    top, bottom = given("mirror.linear.numerator"), given("mirror.linear.denominator")
    at = 2j * math.pi * given("mirror.linear.normalise_at")
    scale = 1.0 / abs(np.polyval(top, at) / np.polyval(bottom, at))
    poles = np.roots(bottom).astype(complex)
    if math.isfinite(corner_rad_s):
        poles, scale = np.append(poles, -corner_rad_s), scale * corner_rad_s
    return poles, np.asarray(scale * np.polyval(top, poles) / np.polyval(np.polyder(np.poly(poles)), poles))


# --------------------------------------------------------------------------------------------------------- hysteresis
def _sine(given: Given, freq_hz: float) -> tuple[Floats, Floats]:
    """Output and hysteresis of the second of two periods of a sine, by an adaptive solver."""
    eq_3, amplitude = _Hysteresis(given), given("scenario.loop_amplitude")
    turn = 2.0 * math.pi * freq_hz

    def slope(time_s: float, h: Floats) -> Floats:
        return np.array([eq_3.slope(amplitude * turn * math.cos(turn * time_s), float(h[0]))])

    h, times, inner = np.zeros(1), [], []
    for start, end in itertools.pairwise(np.arange(0.0, 2.25, 0.25) / freq_hz):  # it has corners where the rate turns
        asked = np.linspace(start, end, 501)
        found = integrate.solve_ivp(
            slope, (start, end), h, "LSODA", asked, rtol=1e-10, atol=1e-16, max_step=1e-2 / freq_hz
        )
        h = found.y[:, -1]
        if start >= 0.99 / freq_hz:
            times.append(asked)
            inner.append(found.y[0])
    time_s, swing = np.concatenate(times), np.concatenate(inner)
    rate = amplitude * turn * np.cos(turn * time_s)
    return eq_3.output(amplitude * np.sin(turn * time_s), rate, swing), swing


def _loops(workspace: Workspace) -> Iterator[Comparison]:
    given, printed = workspace.given, _Hysteresis(workspace.given).model
    for freq_hz in (1.0, 60.0, 100.0):
        output, inner = _sine(given, freq_hz)
        loop = printed.loop(given("scenario.loop_amplitude"), freq_hz)
        width = (inner.max() - inner.min()) / (output.max() - output.min())
        how = "0.1 %: both sample a loop at finitely many points"
        what = f"width of the loop at {freq_hz:g} Hz over its height"
        yield Comparison("run.loops.width", what, width, loop.width, 1e-3 * width, "", how)
        largest, obtained = float(np.abs(inner).max()), float(np.abs(loop.hysteresis_rad).max())
        what = f"largest hysteresis at {freq_hz:g} Hz"
        yield Comparison("run.loops.largest_rad", what, largest, obtained, 1e-3 * largest, "rad", how)


# --------------------------------------------------------------------------------------------------------------- loop
class Axis:
    """One axis of the shipped fine-pointing loop, without hysteresis: responses by frequency."""

    def __init__(self, given: Given) -> None:
        """Of the mission's values."""
        self.period_s = 1.0 / given("fine_pointing.rate")
        # each mode held over a period: exact for a command that stays for one
        self._poles, residues = _fractions(given, 2.0 * math.pi * given("fine_pointing.amplifier_bandwidth"))
        self._rest = given("mirror.bouc_wen.d1") * residues / self._poles
        self.fastest_hz = float(np.abs(self._poles).max()) / (2.0 * math.pi)
        self.delay = given("fine_pointing.delay") / self.period_s
        self.freq_hz = np.geomspace(1e-3, 0.5 / self.period_s, 40_001)
        self.z = np.exp(2j * math.pi * self.freq_hz * self.period_s)

    def plant(self, share: float = 0.0) -> Complexes:
        """From command (V) to the mirror (rad) such a share of a period behind each sample, by frequency."""
        found = np.zeros(self.z.size, dtype=complex)
        for pole, rest in zip(self._poles, self._rest, strict=True):
            at_sample = rest * np.expm1(pole * self.period_s) / (self.z - np.exp(pole * self.period_s))
            found += np.exp(pole * share * self.period_s) * at_sample + rest * np.expm1(pole * share * self.period_s)
        return np.asarray(found * self.z**-self.delay)

    def controller(self, system: Any) -> Complexes:
        """From the optical error (rad) to the command (V), by frequency, from matrices."""
        values, right = np.linalg.eig(system.A)
        left = np.linalg.solve(right, system.B[:, :1].astype(complex))[:, 0]
        row = (system.C.astype(complex) @ right)[0]
        return np.array(system.D[0, 0] + ((row * left) / (self.z[:, None] - values)).sum(axis=1))


def _unwrapped(loop: Complexes) -> Floats:
    return np.asarray(np.unwrap(np.angle(loop)))


def _logarithm(loop: Complexes) -> Floats:
    return np.asarray(np.log(np.abs(loop)))


def _margins(workspace: Workspace) -> Iterator[Comparison]:
    axis, step_s = Axis(workspace.given), workspace.given("fine_pointing.plant_step")
    for each in optical(workspace):
        loop = axis.controller(each.design.tuned.controller.system) * axis.plant()
        name, how = f"fine_pointing.controllers.{each.design.name}.margins", "1 %: 40 001 frequencies"
        nearest = float(np.abs(1.0 + loop).min())
        yield workspace.compared("run", f"{name}.modulus", nearest, 0.01 * nearest, how)
        crosses = np.flatnonzero((np.abs(loop[1:]) < 1.0) & (np.abs(loop[:-1]) >= 1.0))
        last = float(axis.freq_hz[crosses[-1]])
        yield workspace.compared("run", f"{name}.crossover_hz", last, 0.01 * last, how)
        level = np.flatnonzero((np.abs(loop[1:]) - 1.0) * (np.abs(loop[:-1]) - 1.0) <= 0.0)
        phases = np.abs(np.angle(-loop[level]))
        # The product's drive is straight within a plant step h, a second-order error: (2 pi f h) (2 pi F h) / 12 of L,
        # F as fast as the plant. Where |L| hardly changes, that moves the crossing far, and the phase with it.
        apart = (2.0 * math.pi * step_s) ** 2 * axis.freq_hz[level] * (axis.freq_hz[level] + axis.fastest_hz) / 12.0
        slopes = [np.gradient(of(loop), np.log(axis.freq_hz))[level] for of in (_unwrapped, _logarithm)]
        moves = apart * (1.0 + np.abs(slopes[0] / slopes[1])) + 1e-3
        why = "second-order error of a plant step in L, by how far that moves the crossing; 1 mrad of the grid"
        least = int(np.argmin(phases))
        yield workspace.compared("run", f"{name}.phase_rad", float(phases[least]), float(moves[least]), why)
        lates = phases / (2.0 * math.pi * axis.freq_hz[level])
        least = int(np.argmin(lates))
        late = float(lates[least])
        slack = late * float(moves[least] / phases[least] + apart[least] / abs(slopes[1][least]))
        yield workspace.compared("run", f"{name}.delay_s", late, slack, why)
        skewed = 2.0 * float((np.abs(1.0 + loop) / np.abs(1.0 - loop)).min())
        yield workspace.compared("run", f"{name}.disk", skewed, 0.01 * skewed, how)
        reach = float(axis.freq_hz[np.flatnonzero(np.abs(1.0 + loop) <= 1.0)[0]])
        yield workspace.compared("run", f"{name}.bandwidth_hz", reach, 0.01 * reach, how)
        turns = np.flatnonzero((loop.imag[1:] * loop.imag[:-1] < 0.0) & (loop.real[:-1] < 0.0))
        gains = 1.0 / np.abs(loop[turns])
        up = 20.0 * math.log10(gains[gains > 1.0].min())
        yield workspace.compared("run", f"{name}.gain_up_db", up, 0.1, "0.1 dB: 40 001 frequencies")


def _residuals(workspace: Workspace) -> Iterator[Comparison]:
    """What vibration and noise leave without hysteresis: integrals over frequency against theory and simulation."""
    axis, numbers = Axis(workspace.given), workspace.numbers("run")
    between = np.arange(5) / 5.0  # the plant's steps in a control period
    noise_rad = workspace.numbers("budget")["tracking.noise_equivalent_angle_rad"]
    step = math.exp(-2.0 * math.pi * axis.period_s)
    variance = 80.0 * math.pi * 1e-12  # radial, of OLYMPUS: 160 / (1 + f^2) urad^2/Hz
    shake = 2.0 * axis.period_s * variance * (1.0 - step**2) / np.abs(1.0 - step / axis.z) ** 2
    for each in optical(workspace):
        controller = axis.controller(each.design.tuned.controller.system)
        loop, name = controller * axis.plant(), f"fine_pointing.controllers.{each.design.name}"
        of = {
            "OLYMPUS": np.trapezoid(shake / np.abs(1.0 + loop) ** 2, axis.freq_hz),
            "optical sensor noise": 4.0
            * axis.period_s
            * noise_rad**2
            * np.mean(
                [
                    np.trapezoid(np.abs(axis.plant(share) * controller / (1.0 + loop)) ** 2, axis.freq_hz)
                    for share in between
                ]
            ),
        }
        for source, squares in of.items():
            key, expected = f"{name}.theory_rms_by_source_rad.{source}", math.sqrt(float(squares))
            yield workspace.compared("run", key, expected, 0.02 * expected, "2 %: vibration within a period")
        others = numbers[f"{name}.theory_rms_by_source_rad.body pointing"]
        total = math.sqrt(sum(map(float, of.values())) + others**2)
        yield workspace.compared("run", f"{name}.theory_rms_rad", total, 0.02 * total, "2 %, as of its parts")
        key = f"{name}.simulated.no hysteresis.rms_rad"
        wide = 2.5 * numbers[f"{name}.simulated.no hysteresis.rms_interval_rad"] + 0.02 * total
        yield workspace.compared("run", key, total, wide, "2 %, and five standard errors of 64 runs")


def _hysteretic(workspace: Workspace) -> Iterator[Comparison]:
    """The shipped loop under PI on the mission's mirror with its hysteresis, in time, by other draws and steps."""
    given, numbers = workspace.given, workspace.numbers("run")
    (chosen,) = [v for v in optical(workspace) if v.design.name == "PI"]
    law = chosen.design.tuned.controller.system
    eq_3, axis, step_s = _Hysteresis(given), Axis(given), 1e-5
    each = round(axis.period_s / step_s)
    lanes, draw = 128, np.random.default_rng(20_260_105)  # 64 runs of two axes
    poles, residues = _fractions(given)
    turn, fed = np.exp(poles * step_s)[:, None], (residues / poles * np.expm1(poles * step_s))[:, None]
    follow = -math.expm1(-2.0 * math.pi * given("fine_pointing.amplifier_bandwidth") * step_s)
    keeps = math.exp(-2.0 * math.pi * step_s)
    sway = math.sqrt(40.0 * math.pi * 1e-12)  # OLYMPUS, of an axis
    noise_rad = workspace.numbers("budget")["tracking.noise_equivalent_angle_rad"]
    modes, h, drive = np.zeros((poles.size, lanes), dtype=complex), np.zeros(lanes), np.zeros(lanes)
    held, command, state = np.zeros(lanes), np.zeros(lanes), np.zeros((law.A.shape[0], lanes))
    moved, found = sway * draw.standard_normal(lanes), []
    settled, total = round(given("fine_pointing.settle") / step_s), round(given("fine_pointing.duration") / step_s)
    for k in range(total):
        error = moved - (modes.sum(axis=0)).real
        if k % each == 0:
            held, seen = command, error + noise_rad * draw.standard_normal(lanes)
            command = law.C[0] @ state + law.D[0, 0] * seen
            state = law.A @ state + law.B[:, :1] * seen
            if k >= settled:
                found.append(error)
        before, drive = drive, drive + follow * (held - drive)
        rate = np.clip((drive - before) / step_s, -eq_3.limit, eq_3.limit)
        side = eq_3.alpha + eq_3.beta * np.sign(rate * h)
        ends = eq_3.epsilon * np.exp(eq_3.delta * np.abs(rate)) * np.sign(rate) / side
        h = ends + (h - ends) * np.exp(-side * np.abs(drive - before))
        behind = eq_3.output(drive, rate, h)
        modes = turn * modes + fed * behind
        moved = keeps * moved + sway * math.sqrt(1.0 - keeps**2) * draw.standard_normal(lanes)
    errors = np.array(found).reshape(len(found), 2, lanes // 2)
    radial = np.hypot(errors[:, 0], errors[:, 1])
    name = "fine_pointing.controllers.PI.simulated.given"
    rms = math.sqrt(float(np.mean(radial**2)))
    spread = 4.0 * numbers[f"{name}.rms_interval_rad"] + 0.02 * rms
    why = "2 % for quantisation and slow body motion, and five standard errors of both ensembles"
    yield workspace.compared("run", f"{name}.rms_rad", rms, spread, why)
    quantile = float(np.quantile(radial, given("fine_pointing.quantile")))
    why = "5 %: the tail of 64 runs of 2 s"
    yield workspace.compared("run", f"{name}.quantile_rad", quantile, 0.05 * quantile, why)


def optical(workspace: Workspace) -> list[Any]:
    """The controllers that look at the optical sensor alone, and whose loop has no inverse in it."""

    def looks(system: Any) -> bool:
        return not (np.any(system.B[:, 1:]) or np.any(system.D[:, 1:]))

    every = workspace.study.fine_pointing.verified
    return [v for v in every if v.design.inverse != "in series" and looks(v.design.tuned.controller.system)]


def _papers_loop(workspace: Workspace) -> Iterator[Comparison]:
    """The paper's cascade under PI at 25 Hz in continuous time, against the exact step at 50 kHz without a delay."""
    from microrad.core import lti
    from microrad.loop import control, sine_run
    from microrad.mirror import model

    given, freq_hz, amplitude, periods = workspace.given, 25.0, workspace.given("scenario.amplitude"), 3
    eq_3, gains = _Hysteresis(given), (given("control.proportional"), given("control.integral"))
    poles, residues = _fractions(given)
    turn, count = 2.0 * math.pi * freq_hz, poles.size

    def error_of(time_s: float, state: Floats) -> float:
        output = float((residues @ (state[:count] + 1j * state[count:-2])).real)
        return float(amplitude) * math.sin(turn * time_s) - output

    def slope(time_s: float, state: Floats) -> Floats:
        modes = state[:count] + 1j * state[count:-2]
        error, h = error_of(time_s, state), state[-1]
        drive = gains[0] * error + gains[1] * state[-2]
        # the output's rate holds no input: three poles more than zeros
        output_rate = float((residues @ (poles * modes)).real)
        rate = gains[0] * (amplitude * turn * math.cos(turn * time_s) - output_rate) + gains[1] * error
        moved = poles * modes + eq_3.output(drive, rate, h)
        return np.concatenate([moved.real, moved.imag, [error, eq_3.slope(rate, h)]])

    last = (periods - 1) / freq_hz
    time_s = last + np.arange(2001) / 2000.0 / freq_hz
    found = integrate.solve_ivp(
        slope, (0.0, periods / freq_hz), np.zeros(2 * count + 2), "LSODA", time_s, rtol=1e-8, atol=1e-14, max_step=1e-4
    )
    errors = np.array([error_of(t, state) for t, state in zip(found.t, found.y.T, strict=True)])
    system = lti.modal_from_polynomials(given("mirror.linear.numerator"), given("mirror.linear.denominator"))
    at = np.array([given("mirror.linear.normalise_at")])
    gain = abs(lti.frequency_response(system, at)[0, 0, 0])
    mirror = model.assemble("paper", "cascade", replace(system, C=system.C / gain), eq_3.model)
    period_s = 1.0 / given("control.rate")
    drive = control.Drive(-math.inf, math.inf, math.inf, math.inf, 0.0, 0.0)
    setup = sine_run.Setup(
        drive, control.Timing(period_s, 1, 0), control.pid(control.Gains(*gains, 0.0, 1e-4), period_s)
    )
    trace = sine_run.track_sine("", mirror, setup, control.no_feedforward(mirror), amplitude, freq_hz)
    why = "1 %: a loop of 50 kHz against one in continuous time"
    for name, what, expected, obtained in (
        ("peak_rad", "peak", float(np.abs(errors).max()), trace.peak_rad),
        ("rms_rad", "rms", math.sqrt(float(np.mean(errors[:-1] ** 2))), trace.rms_rad),
    ):
        title = f"{what} of the error of a sine at {freq_hz:g} Hz, loop of the paper under PI"
        yield Comparison(f"run.runs.0.{name}", title, expected, obtained, 0.01 * expected, "rad", why)
    expected_rad = amplitude * np.sin(turn * time_s) - errors
    off = 0.03 * float(np.abs(errors).max())
    for place in range(0, 2000, 250):
        what = f"output at {place / 2000:g} of a period of {freq_hz:g} Hz"
        obtained = float(trace.output_rad[trace.steady][place, 0])
        why = "3 % of the largest error: a loop of 50 kHz, behind by two samples, against one in continuous time"
        name = "results.tracking.given_pid_25_hz.output.value"
        yield Comparison(name, what, float(expected_rad[place]), obtained, off, "rad", why)


def _limits(workspace: Workspace) -> Iterator[Comparison]:
    """Counts of limits that a sine meets, where the loop hardly closes: shares of a period in closed form."""
    from microrad.core import lti
    from microrad.loop import control, sine_run
    from microrad.mirror import model

    given, freq_hz, size_v = workspace.given, 25.0, 0.01
    amplitude, period_s = given("scenario.amplitude"), 1.0 / given("control.rate")
    system = lti.modal_from_polynomials(given("mirror.linear.numerator"), given("mirror.linear.denominator"))
    fastest = 2.0 * math.pi * freq_hz * size_v
    law = control.pid(control.Gains(size_v / amplitude, 0.0, 0.0, 1e-4), period_s)
    for what, share, limit_v, rate_v_s, expected in (
        ("samples at the drive's limit", "saturated", 0.6 * size_v, math.inf, 1.0 - 2.0 / math.pi * math.asin(0.6)),
        ("plant steps beyond the identified rate", "rate_clamped", 1.0, 0.8, 2.0 / math.pi * math.acos(0.8)),
    ):
        eq_3 = replace(_Hysteresis(given).model, rate_limit_v_s=min(rate_v_s * fastest, given("mirror.rate_limit")))
        mirror = model.assemble("paper", "cascade", system, eq_3)
        drive = control.Drive(-limit_v, limit_v, math.inf, math.inf, 0.0, 0.0)
        setup = sine_run.Setup(drive, control.Timing(period_s, 1, 0), law)
        trace = sine_run.track_sine("", mirror, setup, control.no_feedforward(mirror), amplitude, freq_hz)
        count = trace.counts.saturated if share == "saturated" else trace.counts.clamped
        why = "0.01: a loop gain below 1 %, and the first sample"
        yield Comparison(f"run.runs.0.{share}", what, expected, count / trace.time_s.size, 0.01, "", why)


CHECKS = (
    Check(
        "papers-loop",
        "The paper's loop with its hysteresis, in continuous time by an adaptive solver",
        Referent.INDEPENDENT,
        "Modes of Eq. 2, Eq. 3 and the controller written out and integrated by LSODA.",
        "SPIE 11852, 118523B, Eq. 2 and 3, Fig. 6",
        _papers_loop,
    ),
    Check(
        "limits",
        "Shares of a sine at the limits of drive and rate",
        Referent.INDEPENDENT,
        "The controller is so weak that the command is the sine itself; shares of its period beyond a limit.",
        "closed form",
        _limits,
    ),
    Check(
        "hysteretic-loop",
        "The shipped loop under PI with its hysteresis, by a simulation of its own",
        Referent.INDEPENDENT,
        "64 runs of two axes in steps of 10 us, written from the equations, with another generator of noise.",
        "SPIE 11852, 118523B, Eq. 2 and 3",
        _hysteretic,
    ),
    Check(
        "loops",
        "Loops of the paper's hysteresis by an adaptive solver",
        Referent.INDEPENDENT,
        "Eq. 3 integrated by LSODA between the turns of the drive, against the exact step.",
        "SPIE 11852, 118523B, Eq. 3",
        _loops,
    ),
    Check(
        "margins",
        "Margins of the shipped loop from partial fractions",
        Referent.INDEPENDENT,
        "The plant is held mode by mode from the printed polynomials; controllers enter by their matrices.",
        "textbook definitions",
        _margins,
    ),
    Check(
        "residuals",
        "Residuals without hysteresis by integrals over frequency",
        Referent.INDEPENDENT,
        "The sampled spectrum of OLYMPUS and white noise through the loop's sensitivities; theory here is a covariance,"
        " simulation a loop in time.",
        "Wittig et al. 1990 for the spectrum; Parseval",
        _residuals,
    ),
)
