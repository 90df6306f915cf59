"""Functions of links and of pointing by numbers."""

import math
from itertools import product

import numpy as np

import microrad
from microrad import link
from microrad.core import units
from microrad.link import beams, coupling, gains, pointing, radial_error, receivers
from microrad.link.acquisition import detection, scan, sequence, times, trade
from microrad.link.pointing import error_classes, fading, statistics, summation
from microrad.link.receivers import base
from microrad.mission.file import load_link
from reference.programs.calls import call, itself

JITTERS = {
    "round": pointing.Jitter((0.0, 0.0), (3.1e-6, 3.1e-6)),
    "generic": pointing.Jitter((1.3e-6, -2.2e-6), (2.7e-6, 4.1e-6)),
    "one axis": pointing.Jitter((-0.7e-6, 1.9e-6), (0.0, 2.3e-6)),
    "still": pointing.Jitter((2.1e-6, 0.4e-6), (0.0, 0.0)),
}
HALF = 11.3e-6
COMMON = {"wavelength_m": 1.31e-6, "bit_error_ratio": 3e-7, "bandwidth_hz": 3.3e9}
KINDS = "bias", "random", "drift", "transient"
STATISTICS = "1-sigma", "2-sigma", "3-sigma", "bound"
AXES = "per-axis", "radial", "x"
RATES = np.array([3.1e6, 47e6, 290e6, 1.7e9])


def coupling_by_numbers() -> None:
    """Light into fibres and onto detectors, and what errors at both ends lose."""
    bent = coupling.Aberrations(47e-9, -33e-9, 61e-9, 29e-9)
    pupil = coupling.Pupil(0.23, 1.31e-6, 0.21, bent, truncation=1.27, shift=0.07)
    cone = coupling.narrowed(coupling.Pupil(0.23, 1.31e-6, 0.21), 0.09, 0.83)
    ends = {
        "fibre": coupling.SingleModeFibre(pupil, 0.6e-6),
        "core": coupling.Disk(cone, 0.4e-6, 7.1e-6),
        "detector": coupling.Disk(coupling.Pupil(0.23, 1.31e-6, 0.21, bent), 0.0, 9.3e-6),
    }
    errors = np.array([0.0, 1.9e-6, -4.3e-6])
    for obscuration in (0.0, 0.31, 0.62):
        call(f"best_truncation {obscuration}", coupling.best_truncation, obscuration)
    call("turbulent_share", coupling.turbulent_share, 1.19, 2.7)
    for name, end in ends.items():
        call(f"share {name}", end.share, errors, 1.3e-6)
        call(f"worst_loss_db {name}", end.worst_loss_db, 3.7e-6)
        call(f"error_rad {name}", end.error_rad, 2.3)
        for of, jitter in JITTERS.items():
            sent = coupling.of_beam(beams.GaussianFall(HALF), *radial_error.radial_steps(JITTERS["generic"]))
            both = coupling.BothEnds(sent, coupling.of_jitter(end, jitter))
            call(f"quantile_db {name} {of}", both.quantile_db, 0.003)
            call(f"beyond {name} {of}", both.beyond, 4.1)
    ours = fading.MovingEnd(JITTERS["generic"], (310e-6, 470e-6), HALF)
    for of in ("round", "generic", "one axis"):
        theirs = fading.MovingEnd(JITTERS[of], (0.0 if of == "one axis" else 190e-6, 260e-6), 7.9e-6)
        call(f"fades_of_both {of}", fading.fades_of_both, ours, theirs, 3.3)


def units_by_name() -> None:
    """Texts with units, and numbers to read."""
    texts = (
        "3.1 urad",
        "-2.7 mrad",
        "12 dB",
        "4e-3 arcsec",
        "7",
        "5 W",
        "1.3",
        " 8 deg ",
        "nan urad",
        "1e400 rad",
        3.1,
    )
    for text, unit in product(texts, ("rad", "dB", "W")):
        call(f"parse_quantity {text!r} {unit}", microrad.parse_quantity, text, unit)
    for value, unit in product(
        (0.0, -3.14159e-7, 2.71828e3, 9.99996e5, 1e-12, 1.0), ("rad", "bit/s", "W", "dB", "s", "")
    ):
        call(f"format_quantity {value} {unit}", units.format_quantity, value, unit)
        call(f"format_input {value} {unit}", units.format_input, value, unit)


def gains_by_numbers() -> None:
    """Gains and losses."""
    errors = np.array([-4.3e-6, 0.0, 1.7e-6, 9.1e-6])
    for power, half, distance, aperture, wavelength, error in (
        (0.71, 8.3e-6, 39.1e6, 0.23, 1.064e-6, 2.9e-6),
        (2.3, 310e-6, 900.0, 0.051, 1.55e-6, 0.0),
        (1.7, 13e-6, 2.1e6, 0.11, 0.81e-6, 17e-6),
        (-1.0, 8e-6, 45e6, 0.25, 1e-6, 0.0),
        (1.0, 8e-6, 45e6, 0.25, 1e-6, -1e-6),
        (1.0, 8e-6, 0.0, 0.25, 1e-6, 1e-6),
    ):
        losses = {"optics": 1.3, "code": 0.4}
        found = call(
            "received_power",
            microrad.received_power,
            power,
            half,
            distance,
            aperture,
            wavelength,
            pointing_error_rad=error,
            losses_db=losses,
        )
        if found is not None:
            call("margin_db", found.margin_db, -44.3)
        call("gaussian_beam_gain_db", gains.gaussian_beam_gain_db, half)
        call("peak_radiant_intensity_w_sr", gains.peak_radiant_intensity_w_sr, power, half)
        call("implied_transmission_db", gains.implied_transmission_db, 0.43e9, power, half)
        call("free_space_loss_db", gains.free_space_loss_db, distance, wavelength)
        call("aperture_gain_db", gains.aperture_gain_db, aperture, wavelength)
        call("far_field_m", gains.far_field_m, aperture, wavelength)
        call("gaussian_pointing_loss_db", gains.gaussian_pointing_loss_db, errors, half)
        call("dbm", gains.dbm, power)
        call("photon_energy_j", gains.photon_energy_j, wavelength)
        for convention in ("gaussian", "gain", "pattern", "none"):
            call(f"pointing_loss_db {convention}", gains.pointing_loss_db, errors, aperture, wavelength, convention)
            call(f"pointing_db_per_rad2 {convention}", gains.pointing_db_per_rad2, aperture, wavelength, convention)
    call("watt", gains.watt, -37.3)
    for strehl, convention in product((0.37, 0.91, 1.0, 1.3, -0.2), ("decibel", "ratio", "other")):
        call(f"strehl_loss_db {strehl} {convention}", gains.strehl_loss_db, strehl, convention)
    for wavefront in (0.0, 83e-9, 310e-9, -1e-9):
        call(f"strehl_ratio {wavefront}", gains.strehl_ratio, wavefront, 1.31e-6)
    for obscuration in (0.0, 0.23, 0.97, 1.0, -0.1):
        call(f"obscuration_loss_db {obscuration}", gains.obscuration_loss_db, obscuration)
    for degrees in (90.0, 37.0, 10.0, 1.3, -2.0, 91.0):
        call(f"air_mass {degrees}", gains.air_mass, math.radians(degrees))
        call(f"clear_sky_loss_db {degrees}", gains.clear_sky_loss_db, 0.83, math.radians(degrees))
    for beam in (
        beams.GaussianFall(HALF),
        beams.LitAperture(0.071, 1.55e-6, 0.0, 0.0),
        beams.LitAperture(0.071, 1.55e-6, 0.93, 0.0),
        beams.LitAperture(0.071, 1.55e-6, 1.41, 0.23),
    ):
        name = type(beam).__name__
        call(name, itself, beam)
        call(f"{name} loss_db", beam.loss_db, [0.0, 3.7e-6, 14.1e-6, 31e-6])
        for loss in (0.7, 2.9, 11.3):
            call(f"{name} error_rad {loss}", beam.error_rad, loss)


def pointing_statistics() -> None:
    """Losses under jitter, and fades."""
    radii, shares, margins = (
        np.array([0.3e-6, 2.9e-6, 7.3e-6, 0.0]),
        np.array([1e-6, 0.003, 0.31]),
        np.array([0.7, 3.3, 9.1]),
    )
    for name, jitter in JITTERS.items():
        call(f"{name} radial_survival", radial_error.radial_survival, jitter, radii)
        call(f"{name} radial_cdf", radial_error.radial_cdf, jitter, radii)
        call(f"{name} radial_quantile", radial_error.radial_quantile, jitter, 1.0 - shares)
        call(f"{name} mean_loss_db", statistics.mean_loss_db, jitter, [HALF, 2.3 * HALF])
        call(f"{name} mean_transmission", statistics.mean_transmission, jitter, HALF)
        call(f"{name} outage_probability", statistics.outage_probability, jitter, HALF, margins)
        call(f"{name} outage_loss_db", microrad.outage_loss_db, jitter, HALF, shares)
        velocity = tuple(rms * 2.0 * math.pi * hz for rms, hz in zip(jitter.rms_rad, (23.0, 41.0), strict=True))
        call(f"{name} level_crossing_rate_hz", fading.level_crossing_rate_hz, jitter, velocity, radii[:3])
        call(f"{name} fades", fading.fades, jitter, velocity, HALF, margins)
        for current in (None, 1.7 * HALF):
            for least in (0.0, 23e-6):
                limits = {"smallest_half_angle_rad": least, "current_half_angle_rad": current}
                call(f"{name} best_divergence {limits}", microrad.best_divergence, jitter, 0.0043, **limits)
                call(f"{name} static {limits}", statistics.best_divergence_for_static_error, 6.1e-6, **limits)
        counting = receivers.OokCounting(
            wavelength_m=1.55e-6, bit_error_ratio=3e-7, bandwidth_hz=3e9, detection_efficiency=0.43
        )
        on_axis = float(counting.required_power_w(200e6))
        for extra in (0.0, 2.3):
            call(
                f"{name} mean_error_ratio {extra}",
                fading.mean_error_ratio,
                jitter,
                HALF,
                extra,
                lambda factor, own=counting, power=on_axis: own.bit_error_ratio_at(power * factor, 200e6),
            )
    call("transmission", statistics.transmission, radii, HALF)
    call("radius_of_loss_rad", statistics.radius_of_loss_rad, HALF, margins)
    frequency = np.geomspace(0.1, 900.0, 300)
    call("motion_of_spectrum", fading.motion_of_spectrum, frequency, 120e-12 / (1.0 + (frequency / 3.1) ** 2))
    call(
        "motion_of_spectrum of two",
        fading.motion_of_spectrum,
        frequency,
        np.stack([1e-12 / frequency, 7e-13 / frequency**0.3]),
    )
    call("Jitter refused", pointing.Jitter, (0.0, 1e-6), (-1e-6, 1e-6))
    call("outage_loss_db refused", microrad.outage_loss_db, JITTERS["round"], HALF, 1.3)


def error_terms() -> None:
    """Errors of each class, statistic and axis, summed up by each rule."""
    stated = [
        error_classes.StatedError(f"{kind} {statistic} {axes}", 1e-6 * (i + 3.1), kind, statistic, axes)
        for i, (kind, statistic, axes) in enumerate(
            product(
                ("bias", "random", "drift", "transient"),
                ("1-sigma", "2-sigma", "3-sigma", "bound"),
                ("per-axis", "radial", "x"),
            )
        )
    ]
    for interpretation in ("temporal", "mixed"):
        terms = [error_classes.error_term(each, interpretation) for each in stated]
        for each, term in zip(stated, terms, strict=True):
            call(f"{interpretation} error_term", itself, term)
            print(error_classes.basis(each, interpretation))
        for some in (terms[::7], terms[1::11], terms[:1], terms[-2:]):
            call("mean_and_sigma", summation.mean_and_sigma, some)
            call("rss_rad", summation.rss_rad, some)
            call("esa_1993_rad", summation.esa_1993_rad, some)
            for confidence in (0.683, 0.9973):
                call("axis_totals_rad", summation.axis_totals_rad, some, confidence)
                call("radial_total_rad", summation.radial_total_rad, some, confidence)
                call("rayleigh_total_rad", summation.rayleigh_total_rad, some, confidence)
                call("exact_total_rad", summation.exact_total_rad, some, confidence)
                call("summations", summation.summations, some, confidence)
        for rule, most in product(("rss", "esa-1993", "ecss-axis", "ecss-radial", "exact"), (30e-6, 90e-6)):
            given = {"rule": rule, "confidence": 0.95, "interpretation": interpretation}
            call(f"allocate {rule} {most}", summation.allocate, stated[::9], most, **given)
    for confidence in (0.5, 0.9973, 1.0):
        call(f"sigma_multiple {confidence}", summation.sigma_multiple, confidence)


def receivers_by_numbers() -> None:
    """Sensitivities of each receiver."""
    coded = {"code_gain_db": 2.3, "code_rate": 0.83}
    counting = {"detection_efficiency": 0.43, "dark_count_rate_hz": 2300.0, "background_power_w": 1.3e-12}
    diode = {"quantum_efficiency": 0.77, "thermal_noise_a_sqrt_hz": 2.2e-12, "dark_current_a": 1.4e-9}
    for kind, own in (
        (receivers.BpskHomodyne, {"quantum_efficiency": 0.68}),
        (receivers.DpskPreamplified, {"noise_figure_db": 4.4}),
        (receivers.OokCounting, counting),
        (receivers.PpmCounting, counting | {"order": 16}),
        (receivers.OokPin, diode),
        (receivers.OokApd, diode | {"gain": 21.0, "ionisation_ratio": 0.23}),
        (receivers.OokPreamplified, {"noise_figure_db": 4.1, "optical_bandwidth_hz": 23e9, "gain_db": 31.0}),
    ):
        for more in ({}, coded, {"bit_error_ratio": 0.6}):
            name = f"{kind.__name__} {' '.join(more)}"
            built = call(name, kind, **(COMMON | own | more))
            if built is None:
                continue
            call(f"{name} required_power_w", built.required_power_w, RATES[:3])
            call(f"{name} photons_per_bit", built.photons_per_bit, RATES[:3])
            call(f"{name} symbol_rate_hz", built.symbol_rate_hz, RATES[:3])
            call(f"{name} too fast", built.photons_per_bit, 17e9)
            call(f"{name} bit_error_ratio_at", built.bit_error_ratio_at, [1.1e-10, 2.3e-9], 290e6)
            call(f"{name} noise_lines", built.noise_lines, 2.3e-9, 290e6)
    call("background_power_w", receivers.background_power_w, 11e6, 0.0193, 93e-6, 1.2e-9)
    call("background_photons_per_mode", receivers.background_photons_per_mode, 11e6, 1.31e-6)
    for gain, ratio in ((21.0, 0.23), (1.0, 0.4), (7.0, 1.0), (0.5, 0.1)):
        call("apd_excess_noise_factor", receivers.apd_excess_noise_factor, gain, ratio)
    call("mark_and_space", base.mark_and_space, 17.3)
    for figure in (3.0, 4.7):
        call("spontaneous_photons", base.spontaneous_photons, figure)


def searches() -> None:
    """Scans, sequences, and the trade between a wide beam and a scan."""
    search, detector = scan.Search(97e-6, 21e-6, 0.23, 0.983), scan.Detector(4.7e-3, 0.87)
    speed = call("highest_speed", scan.highest_speed, search, 4.7e-3)
    for pattern in (
        scan.Spiral(search, detector, 0.87 * speed),
        scan.Raster(search, detector, 0.71 * speed, 2.3e-3),
        scan.StepStare(search, detector, 11.3e-3, 1.7e-3),
    ):
        name = type(pattern).__name__
        call(name, itself, pattern)
        for jitter in (0.0, 5.3e-6):
            call(f"{name} gap_probability", detection.gap_probability, pattern, jitter)
            call(f"{name} detection_times", detection.detection_times, pattern, jitter)
        call(f"{name} beam_at", pattern.beam_at, np.array([0.3, 0.07]), np.array([0.001, 0.0]))
        call(f"{name} simulate_scan", detection.simulate_scan, pattern, 23, 5)
        call(f"{name} shaken", detection.simulate_scan, pattern, 23, 5, detection.Vibration(4.1e-6, 0.013))
    found = call(
        "scan_times", microrad.scan_times, 97e-6, 21e-6, 4.7e-3, jitter_rms_rad=3.1e-6, detection_probability=0.8
    )
    call("scan_times refused", microrad.scan_times, 97e-6, 21e-6, 4.7e-3, overlap=1.0)
    call("scan_times refused", microrad.scan_times, 97e-6, -21e-6, 4.7e-3)
    call("scaled", found.scaled, 0.7)
    call("shifted", found.shifted, 1.3)
    call("followed_by", found.followed_by, times.fixed_time(0.31, 0.9))
    call("joined", times.joined, [found.scaled(0.4), times.fixed_time(2.3, 0.31)])
    call("cumulative", found.cumulative, 0.7)
    for probability in (0.1, 0.63):
        call(f"quantile {probability}", found.quantile, probability)
    timing = call("Timing", sequence.Timing, 39.1e6, 8.7, 11e-3, 73, 1.7, 9e-3, 0.31, 0.23)
    chances = call("Chances", sequence.Chances, 0.87, 0.13, 0.93, 0.79, 0.97, 0.91)
    for attempts in (1, 3):
        for name, stages in (
            ("paper", sequence.paper_sequence(timing, chances)),
            ("scan", (*sequence.scan_stages(timing, found, 19.0), *sequence.answer_stages(timing, chances))),
        ):
            call(f"{name} check_sequence", sequence.check_sequence, stages, attempts)
            call(f"{name} solve_sequence {attempts}", sequence.solve_sequence, stages, attempts)
            call(f"{name} simulate {attempts}", sequence.simulate, stages, attempts, 31, 7)
            call(f"{name} simulate_log {attempts}", sequence.simulate_log, stages, attempts, 7)
    call("frame_detection_probability", sequence.frame_detection_probability, 7.3, 4.1)
    call("frames_detection_probability", sequence.frames_detection_probability, 0.13, 17)
    receiver = call("trade.Receiver", trade.Receiver, 0.0193, 1.3e-11, 7e-3, 0.3e-3)
    light = call("trade.Beams", trade.Beams, 4.3, 39.1e6, 21e-6, 17e-6, 0.23)
    sizes = np.array([23e-6, 97e-6, 310e-6])
    call("wide_against_scan", trade.wide_against_scan, sizes, 0.97, light, receiver, 3.1e-6)


def of_a_mission() -> None:
    """Maps and solutions of a mission's link."""
    file = load_link("links.toml")
    data = link.of(file.mission)
    rates, errors = np.array([90e6, 310e6, 1.3e9]), np.array([0.0, 4.1e-6, 11.7e-6])
    call("margin_map", link.margin_map, data, rates, errors)
    call("margin_of_error", link.margin_of_error, data, errors)
    call("convention_maps", link.convention_maps, data, rates, errors)
    call("implied_sensitivity", link.implied_sensitivity, data)
    call("ideal_receivers", link.ideal_receivers, data, file.sources, 5.3e-6)
    for margin in (0.0, 2.9, 31.0):
        call(f"largest_data_rate {margin}", link.largest_data_rate, data, margin, 5.3e-6)
        call(f"largest_pointing_error {margin}", link.largest_pointing_error, data, margin, 210e6)
    call("required_dbm", link.required_dbm, data, rates)
    tables = file.mission.pointing, link.Shared.of(file.mission), file.mission.beacon
    for interpretation in ("temporal", "mixed"):
        errors_found = call(
            "open_loop_budget", pointing.open_loop_budget, *tables, file.sources, interpretation=interpretation
        )
        for rule in ("rss", "esa-1993", "ecss-axis", "ecss-radial", "exact"):
            call(f"allocation {rule}", errors_found.allocation, 610e-6, rule)
        call("coverage", errors_found.coverage, [190e-6, 510e-6])


if __name__ == "__main__":
    for part in (
        units_by_name,
        gains_by_numbers,
        coupling_by_numbers,
        pointing_statistics,
        error_terms,
        receivers_by_numbers,
        searches,
        of_a_mission,
    ):
        print(f"-- {part.__name__}")
        part()
