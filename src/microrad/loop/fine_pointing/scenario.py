"""From the mission to the fine-pointing loop: mirror, optics, sensors, disturbances, reference, and its stroke."""

import math
from dataclasses import dataclass, replace

import numpy as np

from microrad import link
from microrad.loop import control, disturbance, sensor
from microrad.loop.fine_loop import loop as fine
from microrad.mirror import geometry, hysteresis
from microrad.mirror import model as mirror
from microrad.mission.file import MissionFile, content_of
from microrad.mission.model import Mission, source_text
from microrad.mission.tables.fine_pointing import FinePointing

BODY_POINTING = "body pointing"
VARIANTS = ("given", "comparison", "no hysteresis")
"""The mission's mirror, its comparison model where it has one, and the mirror with its hysteresis left out."""


@dataclass(frozen=True, slots=True)
class Scene:
    """The loop of all axes, the same of one axis for designs, and what they came from."""

    loop: fine.PointingLoop
    axis: fine.PointingLoop
    stroke: tuple[geometry.StrokeBudget, ...]
    stroke_without_point_ahead: tuple[geometry.StrokeBudget, ...]

    def own_stroke(self, m: Mission) -> tuple[geometry.StrokeBudget, ...]:
        """The stroke budgets of the mission as it is: with the point-ahead on the mirror or not."""
        return self.stroke if table(m).reference.point_ahead_on_mirror else self.stroke_without_point_ahead


def scene(file: MissionFile) -> Scene:
    """The fine-pointing loop of a mission that has one. Raises ValueError for what cannot be built, with the reason."""
    m = file.mission
    chain = optics(m)
    one = one_mirror(m, "given")
    both = mirror.combine(*[one] * chain.outputs)
    loop = around(file, both, geometry.line_of_sight_matrix(chain))
    gain = fine.nominal_axis_gain(loop)
    scale = gain / abs(float(fine.in_band_gain(one)[0, 0]))
    axis = replace(
        loop,
        mirror=one,
        optics=np.array([[scale]]),
        disturbances=loop.disturbances[:1],
        references=loop.references[:1],
    )
    with_it, without = (stroke(file, chain, on_mirror) for on_mirror in (True, False))
    return Scene(loop, axis, with_it, without)


def table(m: Mission) -> FinePointing:
    """The mission's fine-pointing table; ValueError without one."""
    if m.fine_pointing is None:
        raise ValueError("the mission has no table [fine_pointing]: microrad init writes one")
    return m.fine_pointing


def optics(m: Mission) -> geometry.Geometry:
    """The chain from the mirror's own angle to the line of sight."""
    g = table(m).geometry
    if m.conventions.mirror_angle == "line-of-sight" and g.magnification != 1.0:
        raise ValueError(
            f"fine_pointing.geometry.magnification = {g.magnification:g}, but conventions.mirror_angle = "
            '"line-of-sight" says that the output is the line of sight already: say "optical" or "mechanical" there'
        )
    return geometry.Geometry(
        angle="mechanical" if m.conventions.mirror_angle == "mechanical" else "optical",
        incidence_rad=g.incidence_rad,
        magnification=g.magnification,
        rotation_rad=g.rotation_rad,
        coupling=((g.coupling[0], g.coupling[1]), (g.coupling[2], g.coupling[3])),
        layout=g.layout,
        actuator_radius_m=g.actuator_radius_m,
    )


def one_mirror(m: Mission, variant: str) -> mirror.Mirror:
    """One axis of the mission's mirror in its own angle, in one of `VARIANTS`."""
    of = m.mirror.comparison if variant == "comparison" and m.mirror.comparison is not None else m.mirror
    model = mirror.hysteresis_model(of, m.mirror.rate_limit_v_s, m.mirror.bias_v)
    return mirror.from_mission(m.mirror, hysteresis.gain_only(model) if variant == "no hysteresis" else model)


def variants(m: Mission) -> tuple[str, ...]:
    """Those of `VARIANTS` that the mission has."""
    return tuple(v for v in VARIANTS if v != "comparison" or m.mirror.comparison is not None)


def with_mirror(loop: fine.PointingLoop, m: Mission, variant: str) -> fine.PointingLoop:
    """The loop with another variant of its mirror."""
    return replace(loop, mirror=mirror.combine(*[one_mirror(m, variant)] * loop.mirror.actuators))


def around(file: MissionFile, mirrors: mirror.Mirror, line_of_sight: fine.Floats) -> fine.PointingLoop:
    """The mission's amplifier, clock, disturbances, sensors and reference around its mirrors."""
    m, f = file.mission, table(file.mission)
    base = control.drive_from_mission(m)
    drive = replace(base, bandwidth_hz=f.amplifier_bandwidth_hz, drive_resolution_v=f.drive_resolution_v)
    period = 1.0 / f.rate_hz
    timing = control.Timing(period, round(period / f.plant_step_s), round(f.delay_s / f.plant_step_s))
    each_axis = disturbances(file)
    gauge = f.strain_gauge
    return fine.PointingLoop(
        mirror=mirrors,
        optics=line_of_sight,
        drive=drive,
        timing=timing,
        disturbances=(each_axis, each_axis),
        optical=optical_sensor(file),
        gauge=None if gauge is None else sensor.StrainGauge(gauge.noise_rad, gauge.resolution_rad),
        references=references(m),
        drive_range_v=(m.mirror.drive_min_v - m.mirror.bias_v, m.mirror.drive_max_v - m.mirror.bias_v),
    )


def disturbances(file: MissionFile) -> tuple[disturbance.Disturbance, ...]:
    """Vibration, wheels and body pointing of one axis, as the mission's table names them."""
    f = table(file.mission)
    body = f.body
    found = [vibration(file)]
    if f.wheels is not None:
        w = f.wheels
        found.append(disturbance.wheels(w.speed_hz, w.harmonics, w.coefficients_rad_hz2, convention=w.convention))
    body_error = disturbance.body_pointing(body.error_rad, body.sigmas, body.bandwidth_hz, convention=body.convention)
    found.append(replace(body_error, name=BODY_POINTING))
    return tuple(found)


def vibration(file: MissionFile) -> disturbance.Disturbance:
    """The platform's vibration of one axis."""
    v = table(file.mission).vibration
    if v.spectrum == "olympus":
        return disturbance.olympus(convention=v.convention)
    if v.spectrum == "first-order":
        assert v.level_rad2_hz is not None and v.corner_hz is not None  # the table's own check
        return disturbance.first_order(v.level_rad2_hz, v.corner_hz, convention=v.convention, name="vibration")
    if v.spectrum == "bands":
        assert v.edges_hz is not None and v.rms_rad is not None
        return disturbance.bands(v.edges_hz, v.rms_rad, convention=v.convention, name="vibration")
    assert v.file is not None
    data = content_of(v.file, file.contents)
    freq_hz, density = disturbance.read_table(file.path.parent / v.file, data=data)
    return disturbance.table(freq_hz, density, convention=v.convention, name="vibration")


def optical_sensor(file: MissionFile) -> sensor.OpticalSensor:
    """The tracking sensor, its noise as given or from the light that it receives."""
    m, f = file.mission, table(file.mission)
    o = f.optical_sensor
    noise = o.noise_rad
    if noise is None:
        assert o.quad_cell is not None  # the table's own check
        cell, spot = quad_cell(m)
        power = o.quad_cell.received_power_w
        if power is None:
            power = link.answer_budget(m, file.sources).received_power_w
        ratio = cell.signal_to_noise(power, sensor.noise_bandwidth_hz(o.rate_hz))
        noise = sensor.noise_equivalent_angle_rad(spot, ratio)
    return sensor.optical_sensor(
        noise,
        o.field_of_view_rad,
        rate_hz=o.rate_hz,
        delay_s=o.delay_s,
        control_rate_hz=f.rate_hz,
        plant_step_s=f.plant_step_s,
        resolution_rad=o.resolution_rad,
    )


def quad_cell(m: Mission) -> tuple[sensor.QuadCell, sensor.AirySpot]:
    """The quad cell of the mission's table and its spot, from the LEO terminal's aperture."""
    q = table(m).optical_sensor.quad_cell
    assert q is not None
    cell = sensor.QuadCell(q.responsivity_a_w, q.background_power_w, q.dark_current_a, q.thermal_noise_a_sqrt_hz)
    return cell, sensor.AirySpot(m.answer.wavelength_m, m.terminals.leo_aperture_m)


def references(m: Mission) -> tuple[disturbance.Reference, ...]:
    """By axis: the point-ahead (x) where the mirror carries it, and what the body leaves of the orbital rate."""
    f = table(m)
    r = f.reference
    ahead = r.point_ahead_rad if r.point_ahead_on_mirror else 0.0
    rate = r.line_of_sight_rate_rad_s * (1.0 - r.rate_feedforward)
    return (
        disturbance.Reference(ahead, rate, f.body.bandwidth_hz),
        disturbance.Reference(0.0, 0.0, f.body.bandwidth_hz),
    )


def stroke(file: MissionFile, chain: geometry.Geometry, on_mirror: bool) -> tuple[geometry.StrokeBudget, ...]:
    """What the mirror has to cover, by axis, with the point-ahead on it or not."""
    m, f = file.mission, table(file.mission)
    r = f.reference
    lag = r.line_of_sight_rate_rad_s * (1.0 - r.rate_feedforward) / (2.0 * math.pi * f.body.bandwidth_hz)
    body = f.body.error_rad / (math.sqrt(2.0) if f.body.convention == "radial" else 1.0)
    demand = geometry.StrokeDemand(
        body_pointing_rad=(body, body),
        point_ahead_rad=(r.point_ahead_rad, 0.0),
        bias_rad=(m.pointing.bias_rad, m.pointing.bias_rad),
        rate_lag_rad=(lag, 0.0),
        point_ahead_on_mirror=on_mirror,
    )
    model = mirror.hysteresis_model(m.mirror, m.mirror.rate_limit_v_s, m.mirror.bias_v)
    swing = min(m.mirror.drive_max_v - m.mirror.bias_v, m.mirror.bias_v - m.mirror.drive_min_v)
    own = {"optical": 1.0, "mechanical": 2.0}
    usable = 2.0 * abs(hysteresis.slow_gain(model)) * swing * own[chain.angle] / own[f.geometry.travel_angle]
    named = {
        "body_pointing_rad": ("fine_pointing.body.error",),
        "point_ahead_rad": ("fine_pointing.reference.point_ahead",),
        "bias_rad": tuple(
            f"pointing.lines.{name}.error" for name, line in m.pointing.lines.items() if line.kind == "bias"
        ),
        "rate_lag_rad": ("fine_pointing.reference.line_of_sight_rate", "fine_pointing.reference.rate_feedforward"),
    }
    return geometry.stroke_budget(
        chain,
        demand,
        travel_rad=m.mirror.travel_rad,
        travel_angle=f.geometry.travel_angle,
        usable_travel_rad=min(usable, m.mirror.travel_rad),
        sources={key: source_text(file.sources, *keys) for key, keys in named.items()},
    )
