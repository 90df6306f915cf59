"""Results of the library as data sets of xarray: named, with units, and whole behind a file."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose, assert_array_equal

import microrad
from microrad.core.labelled import TEXT, Group, variables
from microrad.loop.pointing_loop.ensemble import COUNTERS, bin_edges_rad

PLAYS = microrad.PrandtlIshlinskii((0.0, 1.0), (30e-6, 6e-6))
TWICE = np.random.default_rng(5).standard_normal((2, 8192))
RECORDING = microrad.recording_from_arrays(TWICE.T, (TWICE * [[2.0], [3.0]]).T, 2000.0)
LOOP = microrad.Loop(
    mirror=microrad.Mirror.of(PLAYS), rate_hz=2000.0, sensor_noise_rad=1e-7, drive_range_v=(-1e-6, 1e-6)
)
CONTROLLER = microrad.Controller.pid(0.0, 2e6, rate_hz=2000.0)
FREQ_HZ = np.geomspace(1.0, 100.0, 40)
RESULTS = {
    "measured": microrad.measure_frequency_response(RECORDING),
    "fit": microrad.fit_frequency_response(FREQ_HZ, 1.0 / (1.0 + 1j * FREQ_HZ / 20.0), orders=[1]),
    "loop": PLAYS.loop(5.0, 1.0),
    "trace": LOOP.simulate(CONTROLLER, 0.05, reference_rad=np.full(100, 1e-5)),
    "ensemble": LOOP.ensemble(CONTROLLER, runs=3, duration_s=0.1),
}


@pytest.mark.promise("readme-16")
@pytest.mark.parametrize("name", RESULTS)
def test_each_array_has_its_unit_and_meaning_and_comes_back_from_a_file(name, tmp_path):
    found = RESULTS[name].to_xarray()
    for of in found.variables.values():
        assert of.attrs["units"] and of.attrs["long_name"]
    found.to_netcdf(tmp_path / "found.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "found.nc", engine="h5netcdf") as again:
        assert again.sizes == found.sizes and again.attrs.keys() == found.attrs.keys()
        for key in found.variables:
            assert_array_equal(again[key], found[key])
            assert again[key].attrs["units"] == found[key].attrs["units"]


def test_errors_are_in_the_data_set_where_the_recordings_tell_them():
    """Of two realisations of two periods there are noise and distortion, of one without a period neither."""
    periodic = [
        microrad.recording_from_arrays(
            np.tile(drive, 2), 2.0 * np.tile(drive, 2) + 0.01 * np.roll(drive, k).repeat(2), 2000.0, period_samples=4096
        )
        for k, drive in enumerate(TWICE[:, :4096])
    ]
    response = microrad.measure_frequency_response(periodic)
    found = response.to_xarray()
    for of in ("noise", "distortion"):
        assert_array_equal(found[f"{of}_standard_error"], getattr(response, f"{of}_standard_error"))
        assert found[f"{of}_standard_error"].attrs["long_name"] == f"the part of one sigma that is {of}"
        assert f"{of}_standard_error" not in RESULTS["measured"].to_xarray()


def test_values_are_found_by_their_names():
    measured, fit, loop, trace, ensemble = (each.to_xarray() for each in RESULTS.values())
    straight = measured.response.sel(output=RECORDING.output_names[1], input=RECORDING.input_names[1])
    assert_allclose(straight, 3.0, rtol=1e-6)
    assert_allclose(abs(measured.response.sel(output=RECORDING.output_names[0])[:, 1]), 0.0, atol=1e-6)
    assert_allclose(fit.response.sel(frequency=20.0, method="nearest")[0, 0], 0.5 - 0.5j, atol=0.06)
    assert fit.attrs["order"] == 1 and fit.gain_error.dims == ("frequency", "output", "input")
    assert float(loop.output.max() - loop.output.min()) * loop.attrs["width"] == pytest.approx(
        float(loop.hysteresis.max() - loop.hysteresis.min())
    )
    assert_array_equal(trace.error.sel(axis="x"), RESULTS["trace"].error_rad[:, 0])
    assert float(trace.reference[-1, 0]) == 1e-5 and float(trace.time[-1]) == pytest.approx(0.0495)
    runs = RESULTS["ensemble"]
    assert_array_equal(ensemble.radius, bin_edges_rad()[1:])
    for limit, column in COUNTERS.items():
        assert_array_equal(ensemble.counts.sel(limit=limit), runs.counts[:, column])
    assert float(ensemble.counts.sel(limit="saturated samples").min()) > 0
    assert runs.largest_rad.max() < 1e-9
    assert int(ensemble.histogram.sel(radius=slice(1e-9, None))[:, 1:].sum()) == 0
    assert int(ensemble.histogram.sum()) == runs.histogram.sum() == 3 * 200


def test_texts_have_the_unit_1():
    (found,) = variables("input", name=(TEXT, "what an input is called", ["first", "second"])).values()
    assert (found.units, found.values.tolist()) == ("1", ["first", "second"])


def test_what_is_not_there_is_no_number():
    found = variables("place", limit=("rad", "limit", [2e-6, None]), name=(TEXT, "name", ["a", None]))
    assert found["limit"].values.dtype == float
    assert_array_equal(found["limit"].values, [2e-6, np.nan])
    assert [*found["name"].values] == ["a", None]


def test_a_group_has_its_coordinates_attributes_and_values_picked_from_records():
    places = [
        SimpleNamespace(at=SimpleNamespace(x=2.5), name="a"),
        SimpleNamespace(at=SimpleNamespace(x=None), name="b"),
    ]
    found = variables("place", places, x=("m", "where", "at.x"), twice=("m^2", "area", lambda p: 2 * len(p.name)))
    names = variables("place", places, place=(TEXT, "its name", "name"))
    flat = variables("place of", grid=("V", "a grid", np.arange(6).reshape(2, 3)))
    made = Group({**found, **flat}, names, {"by": "hand", "count": 3}).to_xarray()
    assert made.attrs == {"by": "hand", "count": 3}
    assert made.place.values.tolist() == ["a", "b"] and made.place.attrs == {"units": "1", "long_name": "its name"}
    assert_array_equal(made.x, [2.5, np.nan])
    assert made.twice.attrs == {"units": "m^2", "long_name": "area"} and made.twice.values.tolist() == [2, 2]
    assert made.grid.dims == ("place", "of") and dict(made.sizes) == {"place": 2, "of": 3}
    assert [*made.coords] == ["place"]


SAID = {
    "trace": {
        "reference": ("rad", "pointing reference", ("time", "axis")),
        "disturbance": ("rad", "disturbance before the loop, at the line of sight", ("time", "axis")),
        "error": ("rad", "pointing error at the line of sight", ("time", "axis")),
        "measured": ("rad", "reading of the optical sensor", ("time", "axis")),
        "drive": ("V", "drive behind the amplifier, from the bias", ("time", "actuator")),
        "mirror": ("rad", "outputs of the mirror", ("time", "output")),
        "time": ("s", "time", ("time",)),
        "axis": ("1", "axis of the line of sight", ("axis",)),
    },
    "ensemble": {
        "rms": ("rad", "root mean square of the pointing error, about zero", ("run", "axis")),
        "mean": ("rad", "mean of the pointing error", ("run", "axis")),
        "largest": ("rad", "largest radial error", ("run",)),
        "histogram": ("1", "control samples by their radial error", ("run", "radius")),
        "counts": ("1", "how often a limit was met, of all actuators or elements", ("run", "limit")),
        "spectrum": ("rad^2/Hz", "one-sided spectrum of the residual, first batch of runs", ("frequency", "axis")),
        "axis": ("1", "axis of the line of sight", ("axis",)),
        "radius": ("rad", "radial error, upper edge of its bin", ("radius",)),
        "limit": ("1", "limit", ("limit",)),
        "frequency": ("Hz", "frequency", ("frequency",)),
    },
}


@pytest.mark.parametrize("name", SAID)
def test_a_loops_arrays_say_what_they_are_and_along_what(name):
    found = RESULTS[name].to_xarray()
    said = {key: (of.attrs["units"], of.attrs["long_name"], of.dims) for key, of in found.variables.items()}
    assert said == SAID[name]
    if name == "trace":
        assert dict(found.sizes) == {"time": 100, "axis": 1, "actuator": 1, "output": 1}
    else:
        assert found.sizes["run"] == 3 and found.attrs["controller"] == "PID" and found.attrs["run_s"] == 0.1
