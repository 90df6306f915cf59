"""The chain with this run's numbers on it: orbit, link, pointing, mirror, loop, residual, volume, verdict."""

import math
from dataclasses import dataclass

from microrad.core.units import format_quantity
from microrad.link import pointing
from microrad.loop.controller_study import Scene
from microrad.mirror import Variant
from microrad.mirror.hysteresis import output_amplitude
from microrad.report.marks import with_sign
from microrad.report.quantities import counted, micro, plain, quantity, share_of_time, signed, volume
from microrad.report.study.contributors import worst_axis
from microrad.study.study import Study


@dataclass(frozen=True, slots=True)
class Stage:
    """One box: its name, its numbers, a line each, and PASS, FAIL or nothing."""

    name: str
    lines: tuple[str, ...]
    mark: str = ""


def stages(study: Study) -> tuple[Stage, ...]:
    """The chain's boxes, in the order of the chain."""
    return (
        _orbit(study),
        _link(study),
        _pointing(study),
        _mirror(study),
        _loop(study),
        _residual(study),
        _volume(study),
        _verdict(study),
    )


def _signed(study: Study, text: str, name: str) -> str:
    """A number with the sign that it has in the JSON under a dotted name."""
    return with_sign(text, study.file.sources, name)


def _angle(value_rad: float) -> str:
    return format_quantity(value_rad, "rad", 3)


def _orbit(study: Study) -> Stage:
    m, day = study.file.mission, study.day
    lines = [f"{quantity(m.range_m(m.communication), 'm')} as budgeted"]
    if day is not None:
        reach = max((e.range_most_m for e in day.encounters), default=math.nan)
        lines = [f"{counted(len(day.relay.contacts), 'contact')} in {day.view.days * 24:.4g} h"]
        lines.append(f"{day.relay.contact_s / 60:.0f} min in view of the {day.view.partner}")
        far = "" if math.isnan(reach) else f", up to {quantity(reach, 'm')}"
        lines.append(f"{quantity(m.range_m(m.communication), 'm')}{far}")
    if m.point_ahead is not None:
        ahead = pointing.point_ahead_rad(m.point_ahead.transverse_velocity_m_s)
        lines.append(f"point-ahead {_angle(ahead)}, {'corrected' if m.point_ahead.corrected else 'NOT corrected'}")
    return Stage("Orbit", tuple(lines))


def _link(study: Study) -> Stage:
    m = study.file.mission
    c, kind = m.communication, "margin" if m.jitter is None else "static margin"
    beam = study.links.data.beam.fall.half_angle_rad
    margin = _signed(study, signed(study.static.margin_db, "dB"), "margin_db.communication_static")
    return Stage(
        "Link",
        (
            f"{format_quantity(c.data_rate_bit_s, 'bit/s')} with {format_quantity(c.transmit_power_w, 'W')}",
            f"beam {_angle(beam)} (half, 1/e²)",
            f"{kind} {margin} as budgeted,",
            f"at {_angle(c.pointing_error_rad)} off axis",
        ),
    )


def _pointing(study: Study) -> Stage:
    p, fine = study.open_loop, study.fine_pointing
    cone = next(r for r in study.requirements if r.subject == "cone")
    lines = [
        f"open loop {_angle(p.rss_rad)} (rss)",
        f"beacon's cone {_angle(p.beacon_half_angle_rad)}, covers {quantity(100.0 * _covered(study), '%')}",
    ]
    if fine is not None:
        before = math.hypot(*(d.rms_rad for several in fine.scene.loop.disturbances for d in several))
        lines.append(f"disturbed by {_angle(before)} rms")
    lines.append(f"fine: {_angle(study.file.mission.requirement.pointing_error_rad)} allowed")
    return Stage("Pointing", tuple(lines), cone.mark)


def _covered(study: Study) -> float:
    reading = study.open_loop.reading
    assert reading is not None  # a whole mission has a beacon
    return reading.coverage


def _mirror(study: Study) -> Stage:
    m, fine = study.file.mission, study.fine_pointing
    if fine is not None and not isinstance(fine.scene, Scene):
        of = fine.scene.loop.mirror
        lines = [
            of.name,
            f"{counted(of.actuators, 'actuator')}, {counted(of.axes, 'output')}",
            f"{of.A.shape[0]} states",
        ]
        return _with_stroke(study, lines)
    widths = [100.0 * loop.width for loop in study.loops]
    half = (m.amplifier.output_max_v - m.amplifier.output_min_v) / m.amplifier.gain / 2.0
    lines = [f"reach {_angle(2.0 * output_amplitude(study.summary.model, half))} over {2 * half:g} V"]
    if widths:
        low, high = min(study.loops, key=lambda loop: loop.freq_hz), max(study.loops, key=lambda loop: loop.freq_hz)
        lines.append(f"hysteresis {100 * low.width:.1f} % at {low.freq_hz:g} Hz,")
        lines.append(f"{100 * high.width:.1f} % at {high.freq_hz:g} Hz")
    return Stage("Mirror", tuple(lines)) if fine is None else _with_stroke(study, lines)


def _with_stroke(study: Study, lines: list[str]) -> Stage:
    axis = worst_axis(study)
    lines.append(f"stroke ({axis.name}): {micro(axis.needed_rad)} µrad needed,")
    lines.append(_signed(study, f"{micro(axis.available_rad)} µrad available", "fine_pointing.stroke.x.available_rad"))
    return Stage("Mirror", tuple(lines), next(r.mark for r in study.requirements if r.subject == "stroke"))


def _loop(study: Study) -> Stage:
    m, margins, fine = study.file.mission, study.margins, study.fine_pointing
    lines = [
        f"{study.residual.controller} at {format_quantity(m.control.rate_hz, 'Hz')}",
        f"modulus margin {margins.modulus:.2f}",
    ]
    if fine is not None:
        design = fine.best.design
        lines.append(f"{design.name} at {format_quantity(1.0 / fine.scene.loop.timing.period_s, 'Hz')}")
        modulus = _signed(study, f"{design.loop_margins.modulus:.2f}", "fine_pointing.margins.modulus")
        width = f"{plain(design.loop_margins.bandwidth_hz)} Hz wide"
        width = _signed(study, width, "fine_pointing.margins.bandwidth_hz")
        lines.append(f"modulus {modulus}, {width}")
    return Stage("Loop", tuple(lines))


def _residual(study: Study) -> Stage:
    m, run, fine = study.file.mission, study.residual, study.fine_pointing
    left = study.left_rad(run)
    lines = [f"{_angle(left)} {m.requirement.residual_statistic}, {run.freq_hz:g} Hz sine"]
    if fine is not None:
        quantile_rad = fine.best.simulated[Variant.GIVEN].quantile_rad
        simulated = _signed(study, f"{micro(quantile_rad)} µrad", "fine_pointing.simulated.given.quantile_rad")
        lines = [f"{simulated} at {share_of_time(fine.quantile)}, vibration", f"({lines[0]})"]
    budget = [r.met for r in study.requirements if r.subject == "error budget"]
    met = all((*budget, *(r.met for r in study.requirements if r.subject in ("residual", "fine pointing"))))
    lines.append(f"allowed {_angle(m.requirement.pointing_error_rad)}")
    lines += [f"error budget: {sum(budget)} of {len(budget)} kept"] if budget else []
    return Stage("Residual", tuple(lines), "PASS" if met else "FAIL")


def _volume(study: Study) -> Stage:
    day = study.day
    if day is None:
        rate = study.margin_map.largest_rate_bit_s
        text = "no rate has the required margin" if math.isnan(rate) else f"up to {quantity(rate, 'bit/s')}"
        return Stage("Volume", (text, "no orbits given: no volume a day"))
    relay, direct = day.relay, day.direct
    lines = [
        f"{_signed(study, volume(relay.capacity_bit), 'day.relay.could_carry_bit')} possible by the {day.view.partner}",
        f"{_signed(study, volume(relay.arrived_bit), 'day.relay.arrived_bit')} of the instrument's",
    ]
    if direct is not None:
        lines.append(f"{_signed(study, volume(direct.capacity_bit), 'day.direct.could_carry_bit')} direct to ground")
    if day.optical is not None:
        most = _signed(study, volume(day.optical.capacity_bit), "day.optical.could_carry_bit")
        lines.append(f"{most} by optical stations")
    return Stage("Volume", tuple(lines))


def _verdict(study: Study) -> Stage:
    passed = sum(r.met for r in study.requirements)
    margin = _signed(study, signed(study.margin_db, "dB"), "margin_db.judged")
    lines = (
        f"{passed} of {len(study.requirements)} requirements met",
        f"link at {'the residual' if study.fine_case is None else 'the outage'} {margin},",
        f"{study.file.mission.requirement.margin_db:g} dB required",
    )
    return Stage("Verdict", lines, "PASS" if study.met else "FAIL")
