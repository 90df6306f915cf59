"""The fine-pointing loop of a mission with a mirror of several axes: as it is simulated, and what designs are for."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop import control, disturbance
from microrad.loop.controller_study import scenario
from microrad.loop.coupled_study.whole import alone
from microrad.loop.pointing_loop.design import read_each_sample, whole_plant
from microrad.loop.pointing_loop.loop import PointingLoop, decoupling, in_band_gain, nominal_axis_gain
from microrad.mirror import MirrorParts, Variant, coupled, geometry, hysteresis
from microrad.mirror.coupled import CoupledMirror, Output
from microrad.mirror.model import linearised
from microrad.mission.file import MissionFile, mirror_of_loop
from microrad.mission.tables.fine_pointing import FinePointing

AXES = "xy"
"""Names of the axes of the line of sight."""

DRAWS = 8
"""Mirrors drawn from the identification's covariance that a controller has to hold for."""

SETTLED = 10.0
"""Periods of the body's bandwidth after which what it follows stands still."""


@dataclass(frozen=True, slots=True, eq=False)
class CoupledScene(scenario.AnyScene):
    """The fine-pointing loop of a mission with a mirror of several axes in place of its own.

    ``loop`` has the mirror with its hysteresis. ``linear`` have it with a gain in place of each element, and a sensor
    that delivers each sample: the first one with the gains of small motions about rest, for which controllers are
    built, the second with those of slow motions over the whole drive range, and one for each mirror that is drawn from
    the identification's covariance, about rest. A controller has to hold in each of them.
    """

    mirror: CoupledMirror
    linear: tuple[PointingLoop, ...]

    @property
    def rest(self) -> PointingLoop:
        """The loop for small motions about rest."""
        return self.linear[0]

    @property
    def theory(self) -> PointingLoop:
        """The loop that linear theory is of: that about rest."""
        return self.rest

    @property
    def has(self) -> tuple[Variant, ...]:
        """The variants of its mirror: as it was identified, and without hysteresis."""
        return Variant.GIVEN, Variant.STRAIGHT

    def on(self, variant: Variant) -> PointingLoop:
        """The loop on one variant of the mirror: without hysteresis it has its gains about rest."""
        return self.loop if variant == Variant.GIVEN else replace(self.loop, mirror=self.rest.mirror)

    @property
    def unknown_dynamics(self) -> str:
        """Nothing: a mirror of several axes is identified with its dynamics."""
        return ""

    @property
    def one_axis(self) -> control.DesignPlant:
        """The plant of the first axis while the other rests."""
        return alone(whole_plant(self.rest, decoupling(self.rest)), 0)

    @property
    def reach_v(self) -> tuple[float, float]:
        """How far every drive may go from its bias: within the amplifier's and the recordings' range (V)."""
        low, high = self.loop.drive_range_v
        return max(low, self.loop.drive.minimum_v), min(high, self.loop.drive.maximum_v)

    @property
    def static_v(self) -> tuple[float, ...]:
        """Drives (V, from the bias, no sign) for the known part of the error, once it has settled, and an offset."""
        settled = np.array(
            [float(each.at(np.array(SETTLED / each.body_bandwidth_hz))) for each in self.loop.references]
        )
        if self.loop.unknown:
            settled = settled + [float(each.at(np.array(0.0))) for each in self.loop.unknown]
        drives = decoupling(self.rest) / nominal_axis_gain(self.rest) @ settled
        return tuple(np.abs(drives).tolist())


def scene(
    file: MissionFile,
    mirror: CoupledMirror,
    received_power_w: float | None,
    arrival: disturbance.Arrival | None = None,
) -> CoupledScene:
    """The fine-pointing loop of a mission with a mirror of several axes, assembled once.

    The delay of the mirror's recordings stays out: the mission's own delay and amplifier take its place. The drives
    reach as far as the amplifier and the recordings allow for all actuators alike.

    Args:
        file: The mission; its amplifier, clock, telescope, sensor and disturbances count, its own mirror does not.
        mirror: The mirror.
        received_power_w: Light on the tracking sensor (W), `link.tracking_light_w`; None where the table gives the
            sensor's noise.
        arrival: Spectrum of the angle at which that light arrives, `link.arrival_of`; None where the terminal flies
            or the air is still.

    Raises:
        ValueError: The mission has no such loop, or the mirror cannot be its mirror; says why.
    """
    m, f = file.mission, scenario.table(file.mission.fine_pointing)
    f = f.model_copy(update={"strain_gauge": None})  # the mirror's own sensors belong to the laboratory
    optics, piston = line_of_sight(f, m.conventions.mirror_angle, mirror.outputs)
    base = control.drive_from_mission(m)
    shift = np.array([m.mirror.bias_v - actuator.bias_v for actuator in mirror.actuators])
    drive = replace(
        base,
        minimum_v=float(np.max(base.minimum_v + shift)),
        maximum_v=float(np.min(base.maximum_v + shift)),
        bandwidth_hz=f.amplifier_bandwidth_hz,
        slew_v_s=min(base.slew_v_s, *(a.rate_limit_v_s for a in mirror.actuators)),
        drive_resolution_v=f.drive_resolution_v,
    )
    if not drive.minimum_v < 0.0 < drive.maximum_v:
        raise ValueError(
            f"the amplifier takes the actuators of {mirror.mirror.name!r} from {drive.minimum_v:g} V to "
            f"{drive.maximum_v:g} V about their bias, and rest has to lie inside: set amplifier.output_min, "
            "amplifier.output_max and amplifier.gain for this mirror"
        )
    each_axis = scenario.disturbances(file, f, arrival)
    period = 1.0 / f.rate_hz
    loop = PointingLoop(
        mirror=mirror.mirror,
        optics=optics,
        drive=drive,
        timing=control.Timing(period, round(period / f.plant_step_s), round(f.delay_s / f.plant_step_s)),
        disturbances=(each_axis, each_axis),
        optical=scenario.optical_sensor(f, received_power_w, m.answer.wavelength_m, m.terminals.leo_aperture_m),
        gauge=None,
        references=scenario.references(f),
        drive_range_v=(
            max(a.drive_min_v - a.bias_v for a in mirror.actuators),
            min(a.drive_max_v - a.bias_v for a in mirror.actuators),
        ),
        held=piston,
        unknown=scenario.misalignments(f),
    )
    seen = read_each_sample(loop)
    plain = [linearised(mirror.mirror, gains) for gains in _gains(mirror, loop.drive_range_v)]
    drawn = [each.mirror for each in coupled.draws(mirror, DRAWS, f.seed)]
    plain += [linearised(each, [hysteresis.rest_gain(model) for model in each.bank]) for each in drawn]
    linear = tuple(replace(seen, mirror=each) for each in plain)
    _refuse_unreachable(linear)
    with_it, without = (_stroke(file, f, linear[0], on_mirror) for on_mirror in (True, False))
    freqs = sorted({*m.scenario.pid_frequencies_hz, *m.scenario.inverse_frequencies_hz})
    return CoupledScene(f, loop, with_it, without, m.scenario.amplitude_rad, tuple(freqs), mirror, linear)


def _stroke(
    file: MissionFile, f: FinePointing, rest: PointingLoop, on_mirror: bool
) -> tuple[geometry.StrokeBudget, ...]:
    """What each actuator has to cover, its drive counted as the angle that an axis turns by at that drive."""
    gain = nominal_axis_gain(rest)
    low, high = max(rest.drive_range_v[0], rest.drive.minimum_v), min(rest.drive_range_v[1], rest.drive.maximum_v)
    either_way = 2.0 * gain * min(-low, high)
    return geometry.budgets_of_rows(
        {f"actuator {number}": row for number, row in enumerate(decoupling(rest), 1)},
        f.geometry.magnification,
        scenario.demand(f, file.mission.pointing, on_mirror),
        geometry.Travel("line-of-sight", either_way, either_way),
        scenario.demand_sources(file.mission.pointing, file.sources),
    )


def of_mission(
    file: MissionFile,
    mirrors: MirrorParts,
    received_power_w: float | None,
    arrival: disturbance.Arrival | None = None,
) -> scenario.AnyScene:
    """The fine-pointing loop of a mission: with the mirror of several axes that it names, else its mirror on each axis.

    Args:
        file: The mission.
        mirrors: The mission's mirror, `mirror.of`.
        received_power_w: Light on the tracking sensor (W), `link.tracking_light_w`; None where the table gives the
            sensor's noise.
        arrival: Spectrum of the angle at which that light arrives, `link.arrival_of`; None where the terminal flies
            or the air is still.

    Raises:
        ValueError: The mission has no such loop, or it cannot be built; says why.
    """
    several = mirror_of_loop(file)
    if several is None:
        return scenario.scene(file, mirrors, received_power_w, arrival)
    return scene(file, coupled.of(several), received_power_w, arrival)


def _gains(mirror: CoupledMirror, drive_range_v: tuple[float, float]) -> tuple[list[float], ...]:
    """Gains of all elements for small motions about rest, then for slow motions over the drive range."""
    own = mirror.mirror
    if not own.bank:
        return ([],)
    rest = [hysteresis.rest_gain(model) for model in own.bank]
    still = linearised(own, rest)
    moved = own.G + own.F @ np.linalg.solve(-still.A, still.B)  # q for slow drives
    farthest = max(map(abs, drive_range_v)) * np.sum(np.abs(moved), axis=1)
    return rest, [
        hysteresis.output_amplitude(model, q) / q if q > 0.0 else small
        for model, q, small in zip(own.bank, farthest.tolist(), rest, strict=True)
    ]


def line_of_sight(f: FinePointing, mirror_angle: str, outputs: Sequence[Output]) -> tuple[Floats, Floats | None]:
    """Line-of-sight angles from the mirror's outputs, shape (2, outputs), and its piston, shape (1, outputs).

    Displacements give tilts and piston by their positions. Two angles are those of the axes x and y, counted as
    conventions.mirror_angle says, and know of no piston.

    Args:
        f: The mission's fine-pointing table.
        mirror_angle: What angles count: "mechanical", "optical" or "line-of-sight".
        outputs: The mirror's outputs.

    Raises:
        ValueError: The outputs do not tell two tilts, or the table gives a coupling or a layout that a mirror file of
            several axes has in itself.
    """
    if f.geometry.layout != "two-axis" or f.geometry.coupling != (1.0, 0.0, 0.0, 1.0):
        raise ValueError(
            "fine_pointing.geometry has a tripod or a coupling, and the mirror file of several axes already holds how "
            'its actuators act: set layout = "two-axis" and coupling = [1.0, 0.0, 0.0, 1.0]'
        )
    if all(output.quantity == "angle" for output in outputs):
        if len(outputs) != len(AXES):
            raise ValueError(
                f"the mirror file has {len(outputs)} angles as outputs: two are needed, that of axis x and that of "
                "axis y, or displacements with positions"
            )
        return geometry.line_of_sight_matrix(scenario.optics(f, mirror_angle)), None
    tilts = coupled.tilts_and_piston(outputs)
    leans = np.vstack([tilts[1], -tilts[0]])  # towards x by the tilt about y, towards y by that about x backwards
    return geometry.line_of_sight_matrix(scenario.optics(f, "mechanical")) @ leans, tilts[2:]


def _refuse_unreachable(linear: Sequence[PointingLoop]) -> None:
    """Raise ValueError where the actuators do not move the line of sight both ways."""
    for loop in linear:
        sizes = np.linalg.svd(loop.optics @ in_band_gain(loop.mirror), compute_uv=False)
        if sizes.size < loop.axes or not sizes[-1] * geometry.WORST_CONDITION >= sizes[0] > 0.0:
            raise ValueError(
                f"the {loop.mirror.actuators} actuator(s) of {loop.mirror.name!r} do not move the line of sight in "
                f"both axes: one direction moves more than {geometry.WORST_CONDITION:g} times less than the other; "
                "check matrices.B and the positions of the outputs"
            )
