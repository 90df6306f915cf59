"""What contacts cost: a day of one pair at 1 s, a constellation and how it grows, ground stations, a week of passes.

    python benchmarks/contacts.py

The pair is that of the paper's mission. The constellation sees four slots over one day, each satellite with each slot:
1000 x 4 are 4000 searches. Memory is the largest of this process, before and after.
"""

import math
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from skyfield.api import EarthSatellite, load, wgs84

from microrad import orbit
from microrad.mission.file import load_mission
from microrad.orbit import constellation, files, operations
from microrad.orbit.day.weather import Site
from microrad.orbit.propagation import mean_elements
from recorded import record

FILE = load_mission(Path(__file__).resolve().parents[1] / "missions" / "leo-geo.toml")
DAY_S = 86400.0
FURTHEST_M = 42_002e3  # to where the paper's link has its 3 dB
SITES = (
    ("kiruna", 67.9, 21.0),
    ("tenerife", 28.3, -16.5),
    ("svalbard", 78.2, 15.4),
    ("hartebeesthoek", -25.9, 27.7),
    ("haleakala", 20.7, -156.3),
    ("sutherland", -32.4, 20.8),
    ("nemea", 37.8, 22.6),
    ("fairbanks", 64.8, -147.7),
)  # name, latitude and longitude in degrees
PAIR_TARGET_S, CONSTELLATION_TARGET_S = 0.3, 60.0
ISS = (
    "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991",
    "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482",
)  # the example of the sgp4 package's own documentation


def seconds(job: Callable[[], object], repeats: int) -> float:
    job()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        job()
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def one_pair() -> None:
    pair = orbit.pair(FILE.mission.orbit, FILE.mission.terminals, FILE.path.parent)
    time_s = np.arange(0.0, DAY_S)

    def day_at_1_s() -> None:
        seen = orbit.sight(pair.leo.orbit, pair.geo.orbit, time_s)
        states = (each.orbit.states(time_s).position_m for each in (pair.leo, pair.geo))
        pair.earth.clearance_rad(*states)
        seen.doppler_hz(FILE.mission.communication.wavelength_m)

    took = seconds(day_at_1_s, 9)
    record("one pair, one day at 1 s", took, "s", at_most=PAIR_TARGET_S)
    print(f"one pair, one day at 1 s, sight and visibility: {took:.3f} s (at most {PAIR_TARGET_S} s)")
    took = seconds(lambda: orbit.contacts(pair.leo, pair.geo, pair.earth, pair.epoch, pair.span_s), 9)
    print(f"one pair, one day, contacts by root search, all limits: {took:.3f} s")


def many() -> None:
    m = FILE.mission
    pair = orbit.pair(m.orbit, m.terminals, FILE.path.parent)
    slots = [
        orbit.Terminal(orbit.GeostationarySlot(f"slot {k}", pair.epoch, 0.5 * np.pi * k), pair.geo.limits, f"slot {k}")
        for k in range(4)
    ]
    bare = [orbit.Terminal(each.orbit, orbit.UNLIMITED, each.name) for each in slots]
    print(f"{'satellites':>10} {'contacts':>9} {'Earth alone':>12} {'all limits':>11} {'planned':>11} {'memory':>9}")
    for count in (125, 250, 500, 1000):
        table = m.constellation.model_copy(update={"satellites": count, "planes": 25, "phasing": 1})
        own = list(orbit.satellites(table, m.orbit, pair.epoch, FILE.path.parent))
        free = [orbit.Terminal(each.orbit, orbit.UNLIMITED, each.name) for each in own]
        began = time.perf_counter()
        found = constellation.opportunities(free, bare, pair.earth, pair.epoch, (0.0, DAY_S))
        alone = time.perf_counter() - began
        began = time.perf_counter()
        constellation.opportunities(own, slots, pair.earth, pair.epoch, (0.0, DAY_S))
        limited = time.perf_counter() - began
        began = time.perf_counter()
        reach = constellation.opportunities(own, slots, pair.earth, pair.epoch, (0.0, DAY_S), FURTHEST_M)
        rules = operations.Rules(60.0, 180.0, 600.0)
        operations.schedule(reach, count, len(slots), 1, rules, 0.0)
        planned = time.perf_counter() - began
        times = f"{alone:10.1f} s {limited:9.1f} s {planned:9.1f} s"
        print(f"{count:10d} {found.start_s.size:9d} {times} {megabytes():6.0f} MB")
    record(f"{count} satellites with 4 slots, one day, planned", planned, "s", at_most=CONSTELLATION_TARGET_S)
    print(f"planned: within reach, with sessions; at most {CONSTELLATION_TARGET_S:g} s for 1000 satellites")


def with_stations() -> None:
    """What eight ground stations add to a day of 1000 satellites with four slots: processor time, in turns."""
    m = FILE.mission
    pair = orbit.pair(m.orbit, m.terminals, FILE.path.parent)
    table = m.constellation.model_copy(update={"satellites": 1000, "planes": 25, "phasing": 1})
    own = list(orbit.satellites(table, m.orbit, pair.epoch, FILE.path.parent))
    rates = operations.RateTable((operations.Step(10e9, math.inf),))
    ground = []
    for name, latitude, longitude in SITES:
        station = orbit.Station(name, math.radians(latitude), math.radians(longitude), 500.0, math.radians(10.0))
        site = Site(name, station.latitude_rad, station.longitude_rad, (0.7,))
        ground.append(constellation.Ground(station, site, rates, 1))

    for limits, bar, what in ((pair.geo.limits, 2.0, "all limits"), (orbit.UNLIMITED, None, "Earth alone")):
        slots = [
            orbit.Terminal(orbit.GeostationarySlot(f"slot {k}", pair.epoch, 0.5 * np.pi * k), limits, f"slot {k}")
            for k in range(4)
        ]
        satellites = own if bar else [orbit.Terminal(each.orbit, orbit.UNLIMITED, each.name) for each in own]

        def planned(stations: list[constellation.Ground], satellites=satellites, slots=slots) -> float:
            began = time.process_time()
            span = (0.0, DAY_S)
            seen = constellation.opportunities(
                satellites, slots, pair.earth, pair.epoch, span, FURTHEST_M, stations=stations
            )
            operations.schedule(seen, 1000, 4 + len(stations), 1, operations.Rules(60.0, 180.0, 600.0), 0.0)
            return time.process_time() - began

        alone, both = (sum(times) for times in zip(*((planned([]), planned(ground)) for _ in range(2)), strict=True))
        print(
            f"1000 satellites, 4 slots, {what}: {alone / 2:.1f} s; with 8 stations {both / 2:.1f} s, {both / alone:.2f}"
        )
        if bar:
            record("1000 satellites with 4 slots and 8 stations over 4 slots, time", both / alone, at_most=bar)


def beside_skyfield() -> None:
    """Passes over one station in a week, from the same element set."""
    scale = load.timescale(builtin=True)
    satellite, place = EarthSatellite(*ISS, "ISS", scale), wgs84.latlon(67.86, 20.96, 400.0)
    epoch = orbit.Epoch("2019-12-10T00:00:00Z")
    station = orbit.Station("station", np.radians(67.86), np.radians(20.96), 400.0, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        elements = Path(folder) / "iss.tle"
        elements.write_text("ISS\n" + "\n".join(ISS) + "\n", encoding="ascii")
        own = mean_elements.Sgp4Orbit(files.read_elements(elements)[0], epoch)
    begin, end = scale.utc(2019, 12, 10), scale.utc(2019, 12, 17)
    peer = seconds(lambda: satellite.find_events(place, begin, end, altitude_degrees=0.0), 3)
    ours = seconds(lambda: orbit.passes(own, station, epoch, (0.0, 7 * DAY_S)), 3)
    count = len(orbit.passes(own, station, epoch, (0.0, 7 * DAY_S)))
    record("passes of a week over those of skyfield, time", ours / peer)
    print(f"{count} passes in a week: {ours:.2f} s, skyfield {peer:.2f} s, ratio {ours / peer:.2f}")


def main() -> None:
    one_pair()
    many()
    with_stations()
    beside_skyfield()


if __name__ == "__main__":
    main()
