"""From the mission to the fine-pointing loop: mirror, optics, sensors, disturbances, reference, and its stroke."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from microrad import mirror
from microrad.loop import control, disturbance, sensor
from microrad.loop.controller_study import parts
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.design import design_plant
from microrad.mirror import MirrorParts, Variant, geometry, hysteresis, summary
from microrad.mission.file import MissionFile, NamedFile, content_of
from microrad.mission.model import Source, source_text
from microrad.mission.tables.fine_pointing import FinePointing, OpticalSensorTable, VibrationTable
from microrad.mission.tables.pointing import Pointing

BODY_POINTING = "body pointing"
MISALIGNMENT_KEYS = ("fine_pointing.misalignment.offset", "fine_pointing.misalignment.drift")


@dataclass(frozen=True, slots=True, eq=False)
class AnyScene:
    """The fine-pointing loop of a mission with whatever mirror, and what it has to follow.

    ``sine_amplitude_rad`` and ``sine_frequencies_hz`` are those of the paper's sines, which it has to track as well.
    """

    table: FinePointing
    loop: fine.PointingLoop
    stroke: tuple[geometry.StrokeBudget, ...]
    stroke_without_point_ahead: tuple[geometry.StrokeBudget, ...]
    sine_amplitude_rad: float
    sine_frequencies_hz: tuple[float, ...]

    @property
    def own_stroke(self) -> tuple[geometry.StrokeBudget, ...]:
        """The stroke budgets of the mission as it is: with the point-ahead on the mirror or not."""
        return self.stroke if self.table.reference.point_ahead_on_mirror else self.stroke_without_point_ahead

    @property
    def theory(self) -> fine.PointingLoop:
        """The loop that linear theory is of."""
        raise NotImplementedError

    @property
    def has(self) -> tuple[Variant, ...]:
        """The variants of its mirror, the mission's own first."""
        raise NotImplementedError

    def on(self, variant: Variant) -> fine.PointingLoop:
        """The loop on one variant of its mirror, one that it has."""
        raise NotImplementedError

    @property
    def unknown_dynamics(self) -> str:
        """Why no loop around the mirror can be relied on, in a sentence; "" where its dynamics are known."""
        raise NotImplementedError

    @property
    def one_axis(self) -> control.DesignPlant:
        """The plant of one axis, which the parameters of controllers are bounded by."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True, eq=False)
class Scene(AnyScene):
    """The fine-pointing loop of a mission with its mirror on each axis; ``axis`` is one of them, for designs."""

    mirrors: MirrorParts
    axis: fine.PointingLoop

    @property
    def theory(self) -> fine.PointingLoop:
        """The loop itself: theory takes each hysteresis element at its slow gain."""
        return self.loop

    @property
    def has(self) -> tuple[Variant, ...]:
        """The variants of its mirror, the mission's own first."""
        return tuple(self.mirrors.own)

    def on(self, variant: Variant) -> fine.PointingLoop:
        """The loop on one variant of the mirror: without hysteresis each element is its slow gain, as in theory."""
        if variant == Variant.STRAIGHT:
            return parts.without(self.loop, parts.HYSTERESIS)
        return with_mirror(self.loop, self.mirrors, variant)

    @property
    def unknown_dynamics(self) -> str:
        """Why no loop around the mirror can be relied on, in a sentence; "" where its dynamics are known."""
        return summary.unknown_dynamics(self.mirrors.table)

    @property
    def one_axis(self) -> control.DesignPlant:
        """The plant of one axis, which the parameters of controllers are bounded by."""
        return design_plant(self.axis)


def table(given: FinePointing | None) -> FinePointing:
    """The mission's fine-pointing table; ValueError without one."""
    if given is None:
        raise ValueError("the mission has no table [fine_pointing]: microrad init writes one")
    return given


def scene(
    file: MissionFile,
    mirrors: MirrorParts,
    received_power_w: float | None,
    arrival: disturbance.Arrival | None = None,
) -> Scene:
    """The fine-pointing loop of a mission, assembled once.

    Args:
        file: The mission, with the folder that a file of its vibration is looked for in.
        mirrors: The mission's mirror, `mirror.of`.
        received_power_w: Light on the tracking sensor (W), `link.tracking_light_w`; None where the table gives the
            sensor's noise.
        arrival: Spectrum of the angle at which that light arrives, `link.arrival_of`; None where the terminal flies or
            the air is still.

    Raises:
        ValueError: The mission has no such loop, or it cannot be built; says why.
    """
    m, f = file.mission, table(file.mission.fine_pointing)
    chain = optics(f, m.conventions.mirror_angle)
    one = mirrors.own[Variant.GIVEN].plant
    base, period = control.drive_from_mission(m), 1.0 / f.rate_hz
    each_axis = disturbances(file, f, arrival)
    gauge = f.strain_gauge
    loop = fine.PointingLoop(
        mirror=mirror.combine(*[one] * chain.outputs),
        optics=geometry.line_of_sight_matrix(chain),
        drive=replace(base, bandwidth_hz=f.amplifier_bandwidth_hz, drive_resolution_v=f.drive_resolution_v),
        timing=control.Timing(period, round(period / f.plant_step_s), round(f.delay_s / f.plant_step_s)),
        disturbances=(each_axis, each_axis),
        optical=optical_sensor(f, received_power_w, m.answer.wavelength_m, m.terminals.leo_aperture_m),
        gauge=None if gauge is None else sensor.StrainGauge(gauge.noise_rad, gauge.resolution_rad),
        references=references(f),
        drive_range_v=mirrors.drive_range_v,
        unknown=misalignments(f),
    )
    scale = fine.nominal_axis_gain(loop) / abs(float(fine.in_band_gain(one)[0, 0]))
    axis = replace(
        loop,
        mirror=one,
        optics=np.array([[scale]]),
        disturbances=loop.disturbances[:1],
        references=loop.references[:1],
        unknown=loop.unknown[:1],
    )
    with_it, without = (stroke(f, mirrors, chain, m.pointing, file.sources, on_mirror) for on_mirror in (True, False))
    freqs = sorted({*m.scenario.pid_frequencies_hz, *m.scenario.inverse_frequencies_hz})
    return Scene(f, loop, with_it, without, m.scenario.amplitude_rad, tuple(freqs), mirrors, axis)


def optics(f: FinePointing, mirror_angle: str) -> geometry.Geometry:
    """The chain from the mirror's own angle to the line of sight.

    Args:
        f: The mission's fine-pointing table.
        mirror_angle: What the mirror's output counts, as conventions.mirror_angle says: "mechanical", "optical" or
            "line-of-sight".

    Raises:
        ValueError: The output is the line of sight already, and the table has a telescope in between.
    """
    g = f.geometry
    if mirror_angle == "line-of-sight" and g.magnification != 1.0:
        raise ValueError(
            f"fine_pointing.geometry.magnification = {g.magnification:g}, but conventions.mirror_angle = "
            '"line-of-sight" says that the output is the line of sight already: say "optical" or "mechanical" there'
        )
    return geometry.Geometry(
        angle="mechanical" if mirror_angle == "mechanical" else "optical",
        incidence_rad=g.incidence_rad,
        magnification=g.magnification,
        rotation_rad=g.rotation_rad,
        coupling=((g.coupling[0], g.coupling[1]), (g.coupling[2], g.coupling[3])),
        layout=g.layout,
        actuator_radius_m=g.actuator_radius_m,
    )


def with_mirror(loop: fine.PointingLoop, mirrors: MirrorParts, variant: Variant) -> fine.PointingLoop:
    """The loop with another variant of its mirror on each actuator.

    Args:
        loop: The loop.
        mirrors: The mission's mirror in each of its variants.
        variant: The variant, one that the mirror has.
    """
    return replace(loop, mirror=mirror.combine(*[mirrors.own[variant].plant] * loop.mirror.actuators))


def disturbances(
    file: MissionFile, f: FinePointing, arrival: disturbance.Arrival | None
) -> tuple[disturbance.Disturbance, ...]:
    """Vibration, wheels and body pointing of one axis, and the angle at which the tracked light arrives.

    Args:
        file: The mission, with the folder that a file of the vibration is named from, and files that are held already.
        f: Its fine-pointing table.
        arrival: Spectrum of the angle of arrival, None where the tracked light comes through no turbulent air.

    Raises:
        ValueError: The file cannot be read, no filter has its spectrum, or the angle of arrival is missing.
    """
    body = f.body
    found = [vibration(f.vibration, file.path.parent, file.contents)]
    if f.wheels is not None:
        w = f.wheels
        found.append(disturbance.wheels(w.speed_hz, w.harmonics, w.coefficients_rad_hz2, convention=w.convention))
    body_error = disturbance.body_pointing(body.error_rad, body.sigmas, body.bandwidth_hz, convention=body.convention)
    found.append(replace(body_error, name=BODY_POINTING))
    if arrival is not None:
        found.append(disturbance.angle_of_arrival(arrival))
    elif file.mission.loop_in_turbulence:
        raise ValueError(
            "the tracked light comes down through the turbulence of channel.turbulence: give the spectrum of its angle "
            "of arrival, which link.arrival_of has"
        )
    return tuple(found)


def vibration(v: VibrationTable, folder: Path, contents: tuple[NamedFile, ...]) -> disturbance.Disturbance:
    """The platform's vibration of one axis.

    Args:
        v: The mission's table of the vibration.
        folder: Folder that its file is named from.
        contents: Files that are held already; they are not read again.

    Raises:
        ValueError: The file cannot be read, or no filter has its spectrum.
    """
    if v.spectrum == "olympus":
        return disturbance.olympus(convention=v.convention)
    if v.spectrum == "first-order":
        assert v.level_rad2_hz is not None and v.corner_hz is not None  # the table's own check
        return disturbance.first_order(v.level_rad2_hz, v.corner_hz, convention=v.convention, name="vibration")
    if v.spectrum == "bands":
        assert v.edges_hz is not None and v.rms_rad is not None
        return disturbance.fit_bands(v.edges_hz, v.rms_rad, convention=v.convention, name="vibration").disturbance
    assert v.file is not None
    freq_hz, density = disturbance.read_table(folder / v.file, data=content_of(v.file, contents))
    return disturbance.fit_table(freq_hz, density, convention=v.convention, name="vibration").disturbance


def optical_sensor(
    f: FinePointing, received_power_w: float | None, wavelength_m: float, aperture_m: float
) -> sensor.OpticalSensor:
    """The tracking sensor, its noise as given or from the light that it receives through the aperture.

    Args:
        f: The mission's fine-pointing table.
        received_power_w: Light on the sensor; None where the table gives the noise.
        wavelength_m: Wavelength of the light.
        aperture_m: Diameter of the aperture that focuses it.

    Raises:
        ValueError: The noise follows from light and none is given, or rate and delay do not fit the control's.
    """
    o = f.optical_sensor
    noise = o.noise_rad
    if noise is None:
        noise = _noise_of_light(o, received_power_w, wavelength_m, aperture_m)
    return sensor.optical_sensor(
        noise,
        o.field_of_view_rad,
        rate_hz=o.rate_hz,
        delay_s=o.delay_s,
        control_rate_hz=f.rate_hz,
        plant_step_s=f.plant_step_s,
        resolution_rad=o.resolution_rad,
    )


def _noise_of_light(
    o: OpticalSensorTable, received_power_w: float | None, wavelength_m: float, aperture_m: float
) -> float:
    q = o.quad_cell
    assert q is not None  # the table's own check
    if received_power_w is None:
        raise ValueError("the noise of the tracking sensor follows from its light: give the received power in W")
    cell = sensor.QuadCell(q.responsivity_a_w, q.background_power_w, q.dark_current_a, q.thermal_noise_a_sqrt_hz)
    ratio = cell.signal_to_noise(received_power_w, sensor.noise_bandwidth_hz(o.rate_hz))
    return sensor.noise_equivalent_angle_rad(sensor.AirySpot(wavelength_m, aperture_m), ratio)


def references(f: FinePointing) -> tuple[disturbance.Reference, ...]:
    """By axis: the point-ahead (x) where the mirror carries it, and what the body leaves of the orbital rate."""
    r = f.reference
    ahead = r.point_ahead_rad if r.point_ahead_on_mirror else 0.0
    rate = r.line_of_sight_rate_rad_s * (1.0 - r.rate_feedforward)
    return (
        disturbance.Reference(ahead, rate, f.body.bandwidth_hz),
        disturbance.Reference(0.0, 0.0, f.body.bandwidth_hz),
    )


def misalignments(f: FinePointing) -> tuple[disturbance.Misalignment, ...]:
    """By axis: what no controller knows, static and drifting; nothing where the table is not there."""
    of = f.misalignment
    return () if of is None else tuple(map(disturbance.Misalignment, of.offset_rad, of.drift_rad_s))


def stroke(
    f: FinePointing,
    mirrors: MirrorParts,
    chain: geometry.Geometry,
    pointing: Pointing,
    sources: Mapping[str, Source],
    on_mirror: bool,
) -> tuple[geometry.StrokeBudget, ...]:
    """What the mirror has to cover, one budget for each of its outputs.

    Args:
        f: The mission's fine-pointing table.
        mirrors: The mission's mirror, with its gain, drive range and travel.
        chain: What stands between the mirror's outputs and the line of sight.
        pointing: The mission's open-loop pointing errors, of which the bias counts.
        sources: Where the mission's numbers come from, by key.
        on_mirror: Whether the mirror carries the point-ahead.

    Raises:
        ValueError: For a singular geometry.
    """
    of = mirrors.table
    lowest_v, highest_v = mirrors.drive_range_v
    gain = abs(hysteresis.slow_gain(mirrors.own[Variant.GIVEN].model))
    own = {"optical": 1.0, "mechanical": 2.0}
    usable = 2.0 * gain * min(highest_v, -lowest_v) * own[chain.angle] / own[f.geometry.travel_angle]
    return geometry.stroke_budget(
        chain,
        demand(f, pointing, on_mirror),
        travel_rad=of.travel_rad,
        travel_angle=f.geometry.travel_angle,
        usable_travel_rad=min(usable, of.travel_rad),
        sources=demand_sources(pointing, sources),
    )


def demand(f: FinePointing, pointing: Pointing, on_mirror: bool) -> geometry.StrokeDemand:
    """What the mirror has to follow, at the line of sight.

    Args:
        f: The mission's fine-pointing table.
        pointing: The mission's open-loop pointing errors, of which the bias counts.
        on_mirror: Whether the mirror carries the point-ahead.
    """
    r = f.reference
    lag = r.line_of_sight_rate_rad_s * (1.0 - r.rate_feedforward) / (2.0 * math.pi * f.body.bandwidth_hz)
    body = f.body.error_rad / (math.sqrt(2.0) if f.body.convention == "radial" else 1.0)
    own = [abs(each.offset_rad) + abs(each.rate_rad_s) * f.duration_s for each in misalignments(f)] or [0.0, 0.0]
    return geometry.StrokeDemand(
        body_pointing_rad=(body, body),
        point_ahead_rad=(r.point_ahead_rad, 0.0),
        bias_rad=(pointing.bias_rad + own[0], pointing.bias_rad + own[1]),
        rate_lag_rad=(lag, 0.0),
        point_ahead_on_mirror=on_mirror,
    )


def demand_sources(pointing: Pointing, sources: Mapping[str, Source]) -> dict[str, str]:
    """Where each half range of `demand` comes from, by its name.

    Args:
        pointing: The mission's open-loop pointing errors.
        sources: Where the mission's numbers come from, by key.
    """
    named = {
        "body_pointing_rad": ("fine_pointing.body.error",),
        "point_ahead_rad": ("fine_pointing.reference.point_ahead",),
        "bias_rad": (
            *(f"pointing.lines.{name}.error" for name, line in pointing.lines.items() if line.kind == "bias"),
            *(key for key in MISALIGNMENT_KEYS if key in sources),
        ),
        "rate_lag_rad": ("fine_pointing.reference.line_of_sight_rate", "fine_pointing.reference.rate_feedforward"),
    }
    return {key: source_text(sources, *keys) for key, keys in named.items()}
