"""What the drawings of Fig. 1, 3 and 7 say: the geometry and sequence of the relay, the bench, the control diagram."""

from typing import Any

from microrad.core.units import format_quantity
from microrad.lab import bench
from microrad.mission.model import Mission
from microrad.report.quantities import quantity
from microrad.study.study import Study

_COLOURS = ("#E69F00", "#56B4E9", "#009E73", "#CC79A7")
_BAR = 200.0  # longest bar of the errors, in the units of the drawing


def relay(study: Study) -> dict[str, Any]:
    """Fig. 1: who stands where, the steps until data flow, and the open-loop errors as bars."""
    m, p = study.file.mission, study.open_loop
    errors = [(line.name, line.value, _COLOURS[i % len(_COLOURS)]) for i, line in enumerate(p.lines)]
    errors.append(("root sum square", p.rss_rad, "#1b1f24"))
    errors.append(("cone of the beacon", p.beacon_half_angle_rad, "#0072B2"))
    most = max(value for _, value, _ in errors)
    sequence = _sequence(m)
    said = ", ".join(f"{name} {format_quantity(value, 'rad', 3)}" for name, value, _ in errors)
    return {
        "height": max(420.0, 230.0 + 26.0 * len(errors)),
        "range": quantity(m.range_m(m.communication), "m"),
        "sequence": sequence,
        "errors": [
            {"text": f"{name} {format_quantity(value, 'rad', 3)}", "width": _BAR * value / most, "colour": colour}
            for name, value, colour in errors
        ],
        "words": f"A satellite in low orbit and one in geostationary orbit. Sequence: {'; '.join(sequence)}. "
        f"Open-loop pointing errors: {said}.",
    }


def _sequence(m: Mission) -> list[str]:
    beacon, answer = m.beacon, m.answer
    assert beacon is not None  # a whole mission has all three
    assert answer is not None
    ahead = "" if m.point_ahead is None else ", point-ahead"
    return [
        f"wide beacon, {format_quantity(beacon.divergence_rad, 'rad')}",
        f"answer, {format_quantity(answer.divergence_rad, 'rad')}",
        f"narrow beam back{ahead}",
        f"lock; {format_quantity(m.communication.data_rate_bit_s, 'bit/s')}",
    ]


def setup() -> dict[str, Any]:
    """Fig. 3: the blocks of the virtual bench that plays the paper's experiment, with its numbers."""
    plan = bench.load_plan("paper-experiment")
    b = plan.bench
    low, high = plan.limits.drive_min_v, plan.limits.drive_max_v
    noise = format_quantity(b.sensor.noise_rad or 0.0, "rad")
    rate = format_quantity(plan.limits.rate_hz, "Hz")
    return {
        "generator": ("Generator", f"{low:g} to {high:g} V", "chirp, sines"),
        "amplifier": (
            "Amplifier",
            f"gain {b.amplifier.gain:g}",
            f"{low * b.amplifier.gain:g} to {high * b.amplifier.gain:g} V",
        ),
        "mirror": ("Piezo mirror", "Eq. 2 (chirp)", "Eq. 3 (sines)"),
        "gauge": ("Strain gauge", f"noise {noise} rms"),
        "converter": ("Converters", f"{b.converters.bits} bits, {rate}"),
        "computer": ("Computer", "record, identify"),
        "note": "virtual: each block is a model, no hardware",
        "words": f"Virtual bench: a function generator ({low:g} to {high:g} V) drives an amplifier of gain "
        f"{b.amplifier.gain:g} and the piezo mirror, played by Eq. 2 or Eq. 3; a strain gauge with {noise} of noise "
        f"measures it; drive and output go through converters of {b.converters.bits} bits at {rate} to the computer.",
    }


def control(study: Study) -> dict[str, Any]:
    """Fig. 7: reference, inverse feedforward, PID, plant and sensor, with this run's gains."""
    m = study.file.mission
    c = m.control
    kp, ki, kd = 1e-3 * c.proportional_v_rad, 1e-3 * c.integral_v_rad_s, 1e-3 * c.derivative_v_s_rad
    rate, delay = format_quantity(c.rate_hz, "Hz"), format_quantity(c.delay_s, "s")
    gains = (f"Kp {kp:g} V/mrad", f"Ki {ki:g} V/(mrad s)") + ((f"Kd {kd:g} V s/mrad",) if kd else ())
    amplifier = f"amplifier, {format_quantity(m.amplifier.bandwidth_hz, 'Hz')}"
    linear = ("linear part, Eq. 2",) if m.mirror.linear is not None else ()
    hysteresis = "hysteresis, Eq. 3" if m.mirror.bouc_wen is not None else "hysteresis"
    resolution = f"{1e6 * m.control.sensor_resolution_rad:.3g} µrad steps"
    return {
        "inverse": ("Inverse", "of the hysteresis", "(Eq. 4)"),
        "pid": ("PID", *gains, f"{rate}, {delay} late"),
        "plant": ("Mirror", amplifier, hysteresis, *linear),
        "sensor": ("Strain gauge", resolution),
        "words": "The reference drives an inverse of the hysteresis; its output and that of a PID "
        f"({', '.join(gains)}, at {rate}, {delay} late) on the tracking error add up to the drive of the mirror "
        f"({', '.join((amplifier, hysteresis, *linear))}), whose output a strain gauge feeds back.",
    }
