"""Loops, disturbances and orbits by numbers."""

import math
from itertools import product

import numpy as np

import microrad
from microrad import orbit
from microrad.loop import sensor
from microrad.loop.control import filters, sampled
from microrad.loop.disturbance import fits, sources, windows
from reference.programs.calls import call, itself

FREQUENCY = np.geomspace(0.13, 870.0, 90)
LINEAR = [1.0], [1 / 5700.0**2, 2 * 0.11 / 5700.0, 1.0]
STRAIGHT = microrad.Mirror.of(47e-6, *LINEAR, name="straight")
PLAYS = microrad.PrandtlIshlinskii((0.0, 0.9, 2.7), (38e-6, 6.1e-6, 3.7e-6))
BOUC_WEN = microrad.BoucWen(51e-6, -1.7e-10, 9e-6, 3e-7, 2.3, 0.7)
INDICES = (
    windows.ErrorIndex("APE"),
    windows.ErrorIndex("MPE", 0.37),
    windows.ErrorIndex("RPE", 0.0041),
    windows.ErrorIndex("PDE", 0.37, 2.9),
    windows.ErrorIndex("PRE", 0.0041, 0.19),
)


def disturbances() -> list[object]:
    """Spectra of each kind, and their rms in windows."""
    density = 130e-12 / (1.0 + (FREQUENCY / 1.7) ** 2)
    edges, rms = [0.0, 1.3, 11.0, 47.0, 113.0], [8.1e-6, 2.6e-6, 1.7e-6, 0.7e-6]
    found = [
        call("fit_spectrum radial", microrad.fit_spectrum, FREQUENCY, density, convention="radial"),
        call(
            "fit_spectrum per axis", microrad.fit_spectrum, FREQUENCY, density * FREQUENCY**-0.3, convention="per-axis"
        ),
        call("first_order", sources.first_order, 140e-12, 1.7, convention="per-axis"),
        call("olympus", sources.olympus),
        call("olympus per axis", sources.olympus, convention="per-axis"),
        call("body_pointing", sources.body_pointing, 310e-6, 2.7, 0.093, convention="radial"),
        call("wheels", sources.wheels, 47.3, (1.0, 2.3), (1.1e-10, 0.4e-10), convention="radial"),
    ]
    of_bands = fits.fit_bands(edges, rms, convention="radial")
    call("fit_bands", itself, of_bands.achieved_rms_rad)  # more filters than one have these bands
    call("fit_table", fits.fit_table, FREQUENCY, density, convention="per-axis")
    for index in INDICES:
        for each in found:
            call(f"windowed_rms {index.kind} {each.name}", windows.windowed_rms, each, index)
        call(f"rational_rms {index.kind}", windows.rational_rms, found[2], index)
        call(f"tabulated_rms {index.kind}", windows.tabulated_rms, FREQUENCY, density, index, sided="one")
        samples = np.sin(0.013 * np.arange(4000)) + 1e-3 * np.arange(4000)
        call(f"recorded_rms {index.kind}", windows.recorded_rms, samples, 1.7e-3, index)
    call("fit_spectrum refused", microrad.fit_spectrum, FREQUENCY[::-1], density, convention="radial")
    call("fit_spectrum refused", microrad.fit_spectrum, FREQUENCY, -density, convention="radial")
    call("ErrorIndex refused", windows.ErrorIndex, "MPE")
    return found


def controllers(vibration: object) -> None:
    """Loops around mirrors, with controllers by hand and tuned ones."""
    timing = {"rate_hz": 9.1e3, "vibration": vibration, "sensor_noise_rad": 0.23e-6, "steps_per_sample": 7}
    late = timing | {"delay_s": 3.0 / 7.0 / 9.1e3, "sensor_delay_s": 2.0 / 7.0 / 9.1e3}
    limits = {"drive_range_v": (-0.31, 0.27), "amplifier_bandwidth_hz": 2.3e3, "slew_v_s": 900.0}
    loops = {
        "straight": microrad.Loop(mirror=STRAIGHT, **timing),
        "plays": microrad.Loop(mirror=microrad.Mirror.of(PLAYS, *LINEAR), **late, **limits),
        "Bouc-Wen": microrad.Loop(mirror=microrad.Mirror.of(BOUC_WEN, *LINEAR), **late, gauge_noise_rad=0.11e-6),
        "turned": microrad.Loop(mirror=STRAIGHT, **timing, optics=[[-1.7]]),
    }
    made = {
        "slow": call("pid", microrad.Controller.pid, 0.0, 4.7e6, rate_hz=9.1e3),
        "quick": call("pid", microrad.Controller.pid, 900.0, 5.3e6, 0.11, rate_hz=9.1e3, derivative_filter_s=2.3e-4),
        "reversed": call("pid", microrad.Controller.pid, 0.0, -3.1e6, rate_hz=9.1e3),
        "two axes": call("pid", microrad.Controller.pid, 300.0, 3.1e6, rate_hz=9.1e3, axes=2),
        "other rate": call("pid", microrad.Controller.pid, 0.0, 4.7e6, rate_hz=8e3),
    }
    wanted = 31e-6 * np.sin(2.0 * math.pi * 37.0 * np.arange(400) / 9.1e3)
    for (where, loop), (name, controller) in product(loops.items(), made.items()):
        call(f"{where} {name} margins", loop.margins, controller)
        call(f"{where} {name} residual_rms_rad", loop.residual_rms_rad, controller)
        if name in ("slow", "quick"):
            call(f"{where} {name} simulate", loop.simulate, controller, 0.04, reference_rad=wanted, seed=3)
            call(f"{where} {name} ensemble", loop.ensemble, controller, 5, 0.05, settle_s=0.01, seed=4)
    for kind in ("PI", "PI + notch", "resonant damping", "disturbance observer", "LQG", "H-infinity"):
        where = "Bouc-Wen" if kind == "resonant damping" else "straight"
        tuned = call(f"tune {kind}", microrad.tune, loops[where], kind, modulus_margin=0.57, seed=2)
        if tuned is not None:
            print(f"{kind}: {tuned.controller!r}")
    call("tune refused", microrad.tune, loops["straight"], "PI", modulus_margin=1.2)
    for change in ({"rate_hz": 0.0}, {"delay_s": 1.7e-5}, {"drive_range_v": (1.0, 2.0)}, {"optics": [[1.0, 2.0]]}):
        call(f"Loop refused {change}", lambda more=change: microrad.Loop(mirror=STRAIGHT, **(timing | more)) and None)
    call("pid refused", microrad.Controller.pid, math.inf, rate_hz=1e3)
    call("pid refused", microrad.Controller.pid, 1.0, rate_hz=0.0)


def parts() -> None:
    """Filters, sensors and converters."""
    call("notch", filters.notch, 830.0, 0.13, 0.7, 1.1e-4)
    call("low_pass", filters.low_pass, 610.0, 0.63, 1.1e-4)
    call("low_pass with a lead", filters.low_pass, 610.0, 0.63, 1.1e-4, 2300.0)
    call("peak", filters.peak, 83.0, 0.017, 1.3 - 0.4j, 1.1e-4)
    call("notch refused", filters.notch, 8300.0, 0.13, 0.7, 1.1e-4)
    call("pid", sampled.pid, sampled.Gains(310.0, 4.1e5, 0.13, 2.1e-4), 1.1e-4)
    call(
        "optical_sensor",
        sensor.optical_sensor,
        0.9e-6,
        1.9e-3,
        rate_hz=2.5e3,
        delay_s=80e-6,
        control_rate_hz=5e3,
        plant_step_s=40e-6,
    )
    cell = call("QuadCell", sensor.QuadCell, 0.97, 1.3e-12, 1.1e-9, 0.047e-12)
    for spot in (
        sensor.AirySpot(1.31e-6, 0.053),
        sensor.AirySpot(1.31e-6, 0.053, 11e-6),
        sensor.GaussianSpot(37e-6, 0.31),
    ):
        call(f"{type(spot).__name__}", itself, spot)
        call("noise_equivalent_angle_rad", sensor.noise_equivalent_angle_rad, spot, 17.3)
        call("noise_equivalent_angle_line", sensor.noise_equivalent_angle_line, cell, spot, 83e-12, 4.7e3)
    for hysteresis in (PLAYS, BOUC_WEN):
        call(type(hysteresis).__name__, itself, hysteresis)


def orbits() -> None:
    """Contacts of orbits and stations, and where all of them are."""
    epoch = call("Epoch", orbit.Epoch, "2026-06-07T03:41:17.25Z")
    times = np.array([0.0, 1310.7, 40_213.3])
    low = orbit.circular("LOW", epoch, 613e3, inclination_rad=0.97, node_rad=-0.7, phase_rad=2.1, j2=True)
    high = orbit.KeplerOrbit("HIGH", epoch, 26.1e6, 0.61, 1.1, 0.4, 4.7, 0.9, j2=False)
    slot = orbit.GeostationarySlot("SLOT", epoch, longitude_rad=-1.3)
    station = orbit.Station("NORTH", math.radians(61.3), math.radians(-17.9), 213.0, math.radians(7.3))
    for each in (low, high, slot):
        call(f"{each.name} states", each.states, times)
    for first, second in ((low, slot), (high, low), (slot, high)):
        call(f"{first.name} {second.name} sight", orbit.sight, first, second, times)
        call(f"{first.name} {second.name} contacts", microrad.find_contacts, first, second, epoch.text, 31_000.0)
    call("passes", microrad.find_contacts, low, station, epoch.text, 51_000.0)
    call("no time", microrad.find_contacts, low, slot, epoch.text, 0.0)
    call("no date", microrad.find_contacts, low, slot, "2026-13-01T00:00:00Z", 10.0)
    for height in (0.0, 83e3, 7e6):
        call(f"coplanar_contact {height}", orbit.coplanar_contact, 6.99e6, height)
    call("sun_direction", orbit.sun_direction, epoch, times)
    call("subpoint", orbit.subpoint, low.states(times).position_m, np.array([0.3, 1.7, -2.2]))
    for elements in microrad.read_elements("satellites.tle"):
        call(elements.name, itself, elements)
        call(f"{elements.name} contacts", microrad.find_contacts, elements, slot, "2026-03-20T12:00:00Z", 9e3)
        call(f"{elements.name} too late", microrad.find_contacts, elements, slot, epoch.text, 9e3)
    call("read_elements refused", microrad.read_elements, "none.tle")


if __name__ == "__main__":
    controllers(disturbances()[0])
    parts()
    orbits()
