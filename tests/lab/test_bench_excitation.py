"""Excitation design: spectra, orthogonality and whole periods as asked for, and refusals that say what would fit."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from microrad.core.units import parse_quantity
from microrad.lab.bench.excitation import (
    DesignError,
    Limits,
    Lines,
    growing_sines,
    logarithmic_chirp,
    multisine,
    samples_in,
    staircase,
)

LIMITS = Limits(rate_hz=10e3, drive_min_v=0.0, drive_max_v=12.0, slew_v_s=20e3, samples_per_period=10.0)
SMALL = {"rms_v": 0.5, "offset_v": 6.0, "periods": 2, "realisations": 1, "seed": 3}


def two_inputs(**changes):
    values = {"rate_hz": 10e3, "drive_min_v": 0.0, "drive_max_v": 12.0, "slew_v_s": 20e3, "samples_per_period": 10.0}
    return Limits(**{**values, "inputs": 2, **changes})


def spectrum(excitation, column=0, start=0):
    """Amplitude and phase of each harmonic of one period, complex."""
    period = excitation.drive[start : start + excitation.period_samples, column]
    return np.fft.rfft(period)[1:] * 2 / period.size


def slew(excitation):
    return np.abs(np.diff(excitation.drive, axis=0, prepend=excitation.rest_v)).max() * excitation.rate_hz


# ---- chirp
@pytest.mark.promise("bench-7")
def test_a_logarithmic_chirp_has_its_limits_amplitude_and_offset():
    chirp = logarithmic_chirp(
        LIMITS, start_hz=1.0, stop_hz=1000.0, duration_s=4.0, amplitude_v=0.5, offset_v=6.0, name="small"
    )
    assert (chirp.name, chirp.rate_hz, chirp.rest_v, chirp.period_samples) == ("small", 10e3, 6.0, None)
    assert chirp.drive.shape == (40_000, 1)
    moved = chirp.drive[:, 0] - 6.0
    assert moved[0] == 0.0
    assert 0.499 < moved.max() <= 0.5 + 1e-12
    assert -0.5 - 1e-12 <= moved.min() < -0.499
    crossings = np.flatnonzero(np.diff(np.signbit(moved))) / 10e3
    # in time equal shares of the record pass equal ratios of frequency: 10, 100 Hz after a third and two thirds
    for share, freq_hz in ((1 / 3, 10.0), (2 / 3, 100.0)):
        near = crossings[np.abs(crossings - share * 4.0) < 0.1]
        assert 0.5 / np.diff(near).mean() == pytest.approx(freq_hz, rel=0.1)
    assert 0.5 / np.diff(crossings[-20:]).mean() == pytest.approx(1000.0, rel=0.02)


def test_a_drive_is_read_only():
    with pytest.raises(ValueError, match="read-only"):
        staircase(LIMITS, levels_v=[0, 1], dwell_s=0.1, rise_s=0.01).drive[0, 0] = 1.0


# ---- multisine
@pytest.mark.promise("bench-7")
@pytest.mark.parametrize("choice", ["all", "odd", "odd-random"])
def test_a_multisine_has_the_lines_asked_for_and_no_others(choice):
    (sines,) = multisine(LIMITS, Lines(0.2, 10.0, 1000.0, choice), **SMALL)
    size = np.abs(spectrum(sines))
    excited = np.flatnonzero(size > 1e-9) + 1
    assert tuple(excited) == sines.lines
    expected = np.arange(2, 201)
    if choice == "all":
        assert np.array_equal(excited, expected)
    odd = expected[expected % 2 == 1]
    if choice == "odd":
        assert np.array_equal(excited, odd)
    if choice == "odd-random":
        assert excited.size == odd.size - odd.size // 4
        assert set(excited) < set(odd)
        groups = np.reshape(np.isin(odd[: odd.size // 4 * 4], excited), (-1, 4))
        assert np.all(groups.sum(axis=1) == 3)
        assert np.all(groups.sum(axis=0) < groups.shape[0])  # each place of the four is left out somewhere
    assert np.allclose(size[excited - 1], 0.5 * math.sqrt(2 / excited.size), rtol=1e-9)
    assert np.std(sines.drive[:, 0]) == pytest.approx(0.5, rel=1e-9)
    assert np.mean(sines.drive) == pytest.approx(6.0, abs=1e-9)


def test_a_multisine_repeats_itself_and_begins_near_its_rest():
    (sines,) = multisine(LIMITS, Lines(0.2, 10.0, 400.0), **{**SMALL, "periods": 3})
    assert sines.period_samples == 2000
    assert sines.samples == 6000
    assert np.array_equal(sines.drive[:2000], sines.drive[4000:])
    crest = np.abs(sines.drive - 6).max() / 0.5
    assert abs(sines.drive[0, 0] - 6.0) < 0.02 * crest
    assert 2.0 < crest < 5.0


@pytest.mark.promise("bench-8")
def test_phases_are_random_over_the_circle_and_told_by_the_seed():
    (one,) = multisine(LIMITS, Lines(1.0, 1.0, 1000.0), **SMALL)
    (same,) = multisine(LIMITS, Lines(1.0, 1.0, 1000.0), **SMALL)
    (other,) = multisine(LIMITS, Lines(1.0, 1.0, 1000.0), **{**SMALL, "seed": 4})
    assert np.array_equal(one.drive, same.drive)
    assert not np.allclose(one.drive, other.drive)
    turns = np.exp(1j * np.angle(spectrum(one)[:1000]))
    assert abs(turns.mean()) < 4 / math.sqrt(1000)
    assert abs((turns[1:] / turns[:-1]).mean()) < 1.0 - 1e-3


@pytest.mark.promise("bench-7")
@pytest.mark.parametrize("inputs", [2, 3])
def test_realisations_are_orthogonal_at_every_line(inputs):
    limits = two_inputs(inputs=inputs)
    sets = multisine(limits, Lines(0.2, 10.0, 400.0), **{**SMALL, "realisations": 2 * inputs})
    assert [s.name for s in sets] == [f"multisine-{k + 1}" for k in range(2 * inputs)]
    assert all(s.drive.shape == (4000, inputs) for s in sets)
    lines = np.array(sets[0].lines) - 1
    for group in (sets[:inputs], sets[inputs:]):
        U = np.array([[spectrum(s, i)[lines] for i in range(inputs)] for s in group])  # (realisation, input, line)
        products = np.einsum("eif,ejf->ijf", U, U.conj())
        size = 0.25 * 2 / lines.size * inputs
        off = products * (1 - np.eye(inputs))[:, :, None]
        assert np.abs(off).max() < 1e-12 * inputs + 1e-9 * size
        assert np.allclose(products[range(inputs), range(inputs)], size)
    first, second = (np.array([spectrum(s)[lines] for s in part]) for part in (sets[:inputs], sets[inputs:]))
    assert not np.allclose(first, second)


# ---- sines and staircases
@pytest.mark.promise("bench-7")
def test_sines_grow_in_whole_periods():
    sines = growing_sines(LIMITS, freq_hz=40.0, amplitudes_v=[1.0, 2.0, 6.0], periods=3, offset_v=6.0)
    assert sines.samples == 3 * 750
    assert sines.period_samples is None
    for k, amplitude in enumerate([1.0, 2.0, 6.0]):
        part = sines.drive[750 * k : 750 * (k + 1), 0] - 6.0
        harmonics = np.abs(np.fft.rfft(part)) * 2 / 750
        assert harmonics[3] == pytest.approx(amplitude, rel=1e-9)
        assert np.delete(harmonics, 3).max() < 1e-9


def test_a_sine_that_fills_samples_in_threes_has_three_periods_as_its_period():
    sines = growing_sines(LIMITS, freq_hz=60.0, amplitudes_v=[6.0], periods=6, offset_v=6.0)
    assert (sines.samples, sines.period_samples) == (1000, 500)
    assert np.allclose(sines.drive[:500], sines.drive[500:], atol=1e-9)
    assert growing_sines(LIMITS, freq_hz=60.0, amplitudes_v=[6.0], periods=3, offset_v=6.0).period_samples is None


@pytest.mark.promise("bench-7")
def test_a_staircase_holds_its_levels_and_ramps_between_them():
    steps = staircase(LIMITS, levels_v=[6.0, 9.0, 3.0], dwell_s=0.1, rise_s=0.005)
    assert steps.rest_v == 6.0
    assert steps.step_samples == (1050, 2100)
    drive = steps.drive[:, 0]
    assert np.all(drive[:1001] == 6.0)
    assert np.all(drive[1050:2051] == 9.0)
    assert np.all(drive[2100:] == 3.0)
    assert np.allclose(np.diff(drive[1000:1051]), 3.0 / 50)
    assert slew(steps) == pytest.approx(6.0 / 0.005)


@pytest.mark.parametrize(("dwell_s", "samples"), [(0.3e-3, 3), (0.26e-3, 3), (0.24e-3, 2), (0.06e-3, 1)])
def test_a_level_lasts_as_many_samples_as_are_nearest_to_its_dwell(dwell_s, samples):
    steps = staircase(LIMITS, levels_v=[6.0, 9.0], dwell_s=dwell_s, rise_s=0.01)
    assert steps.step_samples == (samples + 100,)
    assert steps.drive.shape[0] == 2 * samples + 101


@pytest.mark.promise("bench-8")
def test_only_the_chosen_axis_moves():
    drive = growing_sines(two_inputs(), freq_hz=50.0, amplitudes_v=[2.0], periods=2, offset_v=5.0, axis=1).drive
    assert np.ptp(drive[:, 0]) == 0.0
    assert drive[0, 0] == 5.0
    assert np.ptp(drive[:, 1]) == pytest.approx(4.0, rel=1e-3)


# ---- limits: what is refused would fit with the number that the message gives
def chirp(limits=LIMITS, **changes):
    values = {"start_hz": 1.0, "stop_hz": 500.0, "duration_s": 1.0, "amplitude_v": 1.0, "offset_v": 6.0}
    return logarithmic_chirp(limits, **{**values, **changes})


def sines(limits=LIMITS, **changes):
    values = {"freq_hz": 50.0, "amplitudes_v": [1.0, 2.0], "periods": 2, "offset_v": 6.0}
    return growing_sines(limits, **{**values, **changes})


def steps(limits=LIMITS, **changes):
    return staircase(limits, **{"levels_v": [0.0, 12.0], "dwell_s": 0.1, "rise_s": 0.001, **changes})


def tones(limits=LIMITS, *, lines=None, **changes):
    return multisine(limits, lines or Lines(0.2, 10.0, 400.0), **{**SMALL, **changes})


@pytest.mark.promise("bench-4", "bench-5")
@pytest.mark.parametrize(
    ("design", "message"),
    [
        (lambda: chirp(amplitude_v=7.0), r"chirp: amplitude takes the drive to 13 V, limits.drive_max is 12 V; .* 6 V"),
        (lambda: chirp(amplitude_v=7.0), r"amplitude takes the drive to -1 V, limits.drive_min is 0 V; .* at most 6 V"),
        (lambda: chirp(stop_hz=900.0, amplitude_v=5.5), r"takes the drive to 3\d\.\d+ kV/s, limits.slew is 20 kV/s"),
        (lambda: chirp(stop_hz=1500.0), r"stop reaches 1.5 kHz, 6.67 samples a period at 10 kHz where .* asks for 10"),
        (lambda: chirp(stop_hz=1500.0), r"at most 1 kHz, or a rate of at least 15 kHz"),
        (lambda: chirp(start_hz=500.0), r"stop is not above start; would fit: a frequency above 500 Hz"),
        (
            lambda: chirp(duration_s=9e-4),
            r"duration holds less than a thousandth of a period of 1 Hz; .*: at least 1 ms",
        ),
        (lambda: chirp(offset_v=13.0), r"offset has 13 V, outside .*; would fit: 0 V to 12 V"),
        (lambda: chirp(duration_s=1e5), r"duration makes a record of 100000 s at 10 kHz; would fit: at most 2000 s"),
        (lambda: chirp(axis=1), r"axis is 2, but the bench has 1 input; would fit: 1 to 1"),
        (lambda: chirp(two_inputs(), axis=2), r"axis is 3, but the bench has 2 inputs; would fit: 1 to 2"),
        (lambda: chirp(axis=-1), r"axis is 0, but the bench has 1 input; would fit: 1 to 1"),
        (lambda: chirp(offset_v=12.0), r"amplitude takes the drive to 13 V, .*; would fit: at most 0 V$"),
        (lambda: chirp(offset_v=6.0006, amplitude_v=7.0), r"limits.drive_max is 12 V; would fit: at most 5.999 V"),
        (lambda: chirp(offset_v=-1.0), r"^chirp: offset has -1 V, outside [^;]*; would fit: 0 V to 12 V$"),
        (lambda: sines(amplitudes_v=[1.0, 6.5]), r"amplitudes takes the drive to 12.5 V, .*at most 6 V"),
        (lambda: sines(freq_hz=70.0), r"periods of 70 Hz: 2 of them fill 285.714 samples, no .*: a multiple of 7, or"),
        (lambda: sines(freq_hz=70.0), r"or a frequency of 69.93007 Hz$"),
        (
            lambda: sines(freq_hz=20 * math.pi),
            r"2 of them fill 318.31 samples, no whole .* fit: a frequency of 62.89\d+",
        ),
        (
            lambda: sines(freq_hz=1e12, periods=1),
            r"1 of them fill 1e-08 samples, no whole .* fit: a frequency of 10 kHz$",
        ),
        (lambda: sines(periods=60_000), r"periods makes a record of 2400 s at 10 kHz; would fit: at most 2000 s"),
        (lambda: sines(freq_hz=2000.0, periods=1), r"frequencies reaches 2 kHz, 5 samples a period"),
        (lambda: steps(rise_s=1e-4), r"rise makes the largest step one of 120 kV/s, limits.slew is 20 kV/s; .* 600 µs"),
        (lambda: steps(levels_v=[12.0, 0.0], rise_s=1e-4), r"rise makes the largest step one of 120 kV/s, .* 600 µs"),
        (lambda: steps(levels_v=[0.0, 13.0]), r"levels has 13 V, outside limits.drive_min to limits.drive_max"),
        (lambda: steps(levels_v=[1.0]), r"levels has one item, which is no step; would fit: at least two levels"),
        (lambda: steps(rise_s=1001.0), r"rise makes a record of 2002 s at 10 kHz; would fit: at most 2000 s"),
        (lambda: steps(dwell_s=1200.0), r"dwell makes a record of 2400 s at 10 kHz; would fit: at most 2000 s"),
        (lambda: steps(dwell_s=1e-6), r"dwell is shorter than half a sample; would fit: at least 100 µs"),
        (lambda: tones(rms_v=4.0), r"rms takes the drive to 1\d\.?\d* V, limits.drive_max is 12 V; would fit: at most"),
        (lambda: tones(lines=Lines(0.20003, 10, 400)), r"period is 2000.3 samples, no whole number .*: 200 ms"),
        (lambda: tones(lines=Lines(1e-4, 10, 400)), r"period is 1 sample, no whole number of at least 2; .*: 200 µs"),
        (lambda: tones(lines=Lines(2e-4, 10, 5000)), r"stop reaches 5 kHz, 2 samples a period"),
        (lambda: tones(lines=Lines(0.2, 11, 14, "odd")), r"stop leaves no odd line of a multisine with one every 5 Hz"),
        (lambda: tones(periods=11_000), r"periods makes a record of 2200 s at 10 kHz; .* at most 2000 s"),
        (lambda: tones(lines=Lines(0.2, 11, 14)), r"stop leaves no all line of a multisine with one every 5 Hz"),
        (lambda: tones(lines=Lines(0.2, 10, 5000)), r"stop reaches 5 kHz, 2 samples a period"),
        (lambda: tones(realisations=6000), r"realisations makes a record of 2400 s at 10 kHz; .* at most 2000 s"),
        (lambda: tones(two_inputs(), realisations=3), r"realisations is 3, no multiple of the 2 inputs, .* of 2"),
    ],
)
def test_a_design_beyond_a_limit_is_refused_with_what_would_fit(design, message):
    with pytest.raises(DesignError, match=message):
        design()


@pytest.mark.parametrize(
    "design",
    [
        lambda: chirp(stop_hz=1000.0),  # ten samples a period
        lambda: chirp(stop_hz=100.0, amplitude_v=6.0),  # from 0 to 12 V
        lambda: chirp(stop_hz=2.0, duration_s=0.1, offset_v=0.0),  # it has gone up alone
        lambda: steps(levels_v=[0.0, 12.0 + 1e-8]),  # what rounding may leave
        lambda: steps(levels_v=[0.0 - 1e-8, 12.0]),
        lambda: steps(rise_s=600e-6),
        lambda: tones(two_inputs(), realisations=2, periods=1),
    ],
)
def test_a_limit_that_is_just_met_is_kept(design):
    assert design()


@pytest.mark.parametrize("levels_v", [[0.0, 12.0 + 2e-8], [-2e-8, 12.0]])
def test_a_level_beyond_what_rounding_leaves_is_refused(levels_v):
    with pytest.raises(DesignError, match=r"outside limits.drive_min to limits.drive_max; would fit: 0 V to 12 V"):
        steps(levels_v=levels_v)


def test_a_record_may_have_as_many_samples_as_it_may_over_all_inputs():
    assert samples_in(LIMITS, "a", "duration", 2000.0) == 20_000_000
    assert samples_in(two_inputs(), "a", "duration", 1000.0) == 10_000_000
    assert samples_in(LIMITS, "a", "duration", 1e-9) == 1
    with pytest.raises(
        DesignError, match=r"a: duration makes .* 1001 s .* at most 1000 s \(20 million samples\), or a lo"
    ):
        samples_in(two_inputs(), "a", "duration", 1001.0)


def test_the_shortest_staircase_has_a_sample_at_each_level_and_one_step_between_them():
    made = steps(levels_v=[0.0, 1.0], dwell_s=1e-4, rise_s=1e-9)
    assert made.drive[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert made.step_samples == (2,)


def test_a_multisine_begins_with_its_first_harmonic_however_low_its_band_begins():
    (made,) = tones(lines=Lines(0.2, 1e-7, 10.0))
    assert made.lines == (1, 2)


def test_a_thousandth_of_a_period_is_enough_of_a_chirp():
    assert chirp(duration_s=1e-3, amplitude_v=0.01).samples == 10


def test_every_limit_that_is_broken_is_named_at_once():
    with pytest.raises(DesignError) as refused:
        chirp(amplitude_v=7.0, stop_hz=1500.0)
    assert [p.key for p in refused.value.problems] == ["stop", "amplitude", "amplitude", "amplitude"]


@pytest.mark.promise("bench-4")
def test_the_advice_fits():
    tight = two_inputs(inputs=1, slew_v_s=2e3)
    with pytest.raises(DesignError, match=r"limits.slew is 2 kV/s; would fit: at most (\S+ m?V)") as refused:
        chirp(tight)
    volts = {"m": 1e-3, "V": 1.0}[refused.value.problems[0].expected.split()[-1][0]]
    most = float(refused.value.problems[0].expected.split()[-2]) * volts
    fitting = chirp(tight, amplitude_v=most)
    assert 0.99 * 2e3 < slew(fitting) <= 2e3 * (1 + 1e-9)
    with pytest.raises(DesignError):
        chirp(tight, amplitude_v=most * 1.01)
    assert slew(steps(rise_s=600e-6)) <= 20e3 * (1 + 1e-9)


def test_slew_counts_the_jump_from_rest():
    """Two inputs cannot both begin at rest; what one line of 10 Hz needs within itself is 60 V/s."""
    line, limits = Lines(0.1, 10.0, 10.0), two_inputs(slew_v_s=1e3)
    tones(two_inputs(inputs=1, slew_v_s=1e3), lines=line)
    with pytest.raises(DesignError, match=r"limits\.slew is 1 kV/s"):
        tones(limits, lines=line, realisations=2)


def test_slew_counts_the_step_from_period_to_period():
    line, at_the_seam = Lines(0.01, 100.0, 200.0), 0
    for seed in range(40):
        (made,) = tones(lines=line, seed=seed)
        steps_v = np.abs(np.diff(made.drive[:101, 0]))
        steepest = steps_v.max() * made.rate_hz
        at_the_seam += int(np.argmax(steps_v)) == 99
        with pytest.raises(DesignError, match=r"limits\.slew"):
            tones(two_inputs(inputs=1, slew_v_s=steepest * 0.9999), lines=line, seed=seed)
        tones(two_inputs(inputs=1, slew_v_s=steepest * 1.0001), lines=line, seed=seed)
    assert at_the_seam > 0


@pytest.mark.parametrize(("rate_hz", "fewest"), [(622.08, 9.3), (1234.56, 7.77), (10e3, 10.0)])
def test_what_a_refusal_says_would_do_does(rate_hz, fewest):
    """The nearest of four digits is refused again every other time."""
    limits = Limits(rate_hz, -3.5, 9.25, 7e5, fewest, 2)

    def taken(start_hz, stop_hz, duration_s, within=limits):
        sizes = {"amplitude_v": 1.0, "offset_v": 2.0}
        return logarithmic_chirp(within, start_hz=start_hz, stop_hz=stop_hz, duration_s=duration_s, **sizes)

    def refused(*asked):
        with pytest.raises(DesignError) as caught:
            taken(*asked)
        return re.findall(r"(?:at most|at least) (\S+ [^\s,]+)", str(caught.value))

    (most,) = refused(1.0, 10.0, 1e9)
    assert 0 <= 1e7 - samples_in(limits, "c", "duration", parse_quantity(most, "s")) < 1e4
    most, rate = refused(1.0, 0.6 * rate_hz, 2.0)
    fast = taken(1.0, parse_quantity(most, "Hz"), 2.0)
    assert fast.samples == round(2.0 * rate_hz)
    assert taken(1.0, 0.6 * rate_hz, 2.0, replace(limits, rate_hz=parse_quantity(rate, "Hz"))).samples > fast.samples
    (least,) = refused(rate_hz / 7e7, 10.0, 2.0)
    assert taken(rate_hz / 7e7, 10.0, parse_quantity(least, "s")).samples > fast.samples


# ---- two inputs and a rate with digits: every number unlike the others
ODD = Limits(rate_hz=622.08, drive_min_v=-3.5, drive_max_v=9.25, slew_v_s=700.0, samples_per_period=4.5, inputs=2)


def test_a_chirp_on_the_second_of_two_inputs_is_its_formula():
    made = logarithmic_chirp(
        ODD, start_hz=0.7, stop_hz=33.0, duration_s=3.3, amplitude_v=1.7, offset_v=2.25, axis=1, name="c"
    )
    time_s = np.arange(round(3.3 * 622.08)) / 622.08
    phase = 2 * math.pi * 0.7 * 3.3 / math.log(33 / 0.7) * ((33 / 0.7) ** (time_s / 3.3) - 1)
    np.testing.assert_allclose(made.drive[:, 1], 2.25 + 1.7 * np.sin(phase), atol=1e-12)
    np.testing.assert_array_equal(made.drive[:, 0], 2.25)
    assert (made.name, made.rate_hz, made.rest_v, made.period_samples) == ("c", 622.08, 2.25, None)
    assert (made.lines, made.step_samples, made.samples) == ((), (), 2053)


def test_sines_on_the_second_of_two_inputs_are_their_formula():
    made = growing_sines(ODD, freq_hz=24.8832, amplitudes_v=[0.5, 1.25, 3.0], periods=3, offset_v=1.5, axis=1, name="s")
    expected = np.concatenate([a * np.sin(2 * math.pi * np.arange(75) / 25) for a in (0.5, 1.25, 3.0)]) + 1.5
    np.testing.assert_allclose(made.drive[:, 1], expected, atol=1e-12)
    np.testing.assert_array_equal(made.drive[:, 0], 1.5)
    assert (made.name, made.rest_v, made.period_samples, made.samples) == ("s", 1.5, None, 225)


@pytest.mark.parametrize(
    ("freq_hz", "periods", "period"),
    [(24.8832, 1, None), (24.8832, 2, 25), (49.7664, 6, 25), (46.656, 3, None), (24.8832, 5, 25)],
)
def test_sines_of_one_amplitude_have_the_least_whole_number_of_samples_as_period(freq_hz, periods, period):
    made = growing_sines(ODD, freq_hz=freq_hz, amplitudes_v=[1.0], periods=periods, offset_v=1.5)
    assert made.period_samples == period
    if period:
        np.testing.assert_allclose(made.drive[period:], made.drive[:-period], atol=1e-12)


def test_a_staircase_on_the_second_of_two_inputs_goes_down_and_up_in_its_own_times():
    made = staircase(ODD, levels_v=[2.0, -1.0, 5.0], dwell_s=5 / 622.08, rise_s=8 / 622.08, axis=1, name="steps")
    down, up = np.linspace(2.0, -1.0, 9)[1:], np.linspace(-1.0, 5.0, 9)[1:]
    expected = np.concatenate([[2.0] * 6, down, [-1.0] * 5, up, [5.0] * 5])
    np.testing.assert_allclose(made.drive[:, 1], expected, atol=1e-12)
    np.testing.assert_array_equal(made.drive[:, 0], 2.0)
    assert (made.name, made.rest_v, made.step_samples, made.period_samples) == ("steps", 2.0, (13, 26), None)


def test_multisines_of_two_inputs_are_sums_of_their_lines_turned_from_realisation_to_realisation():
    made = multisine(
        ODD,
        Lines(625 / 622.08, 3.0, 9.0, "odd"),
        rms_v=0.8,
        offset_v=2.5,
        periods=3,
        realisations=4,
        seed=11,
        name="m",
    )
    assert [each.name for each in made] == ["m-1", "m-2", "m-3", "m-4"]
    assert {(each.period_samples, each.lines, each.samples, each.rest_v) for each in made} == {
        (625, (5, 7, 9), 1875, 2.5)
    }
    lines = []
    for each in made:
        np.testing.assert_allclose(each.drive[1250:], each.drive[:625], atol=1e-12)
        moved = each.drive[:625] - 2.5
        np.testing.assert_allclose(np.sqrt(np.mean(moved**2, axis=0)), 0.8, rtol=1e-9)
        found = np.fft.rfft(moved, axis=0)[[5, 7, 9]] * 2 / 625
        np.testing.assert_allclose(np.abs(found), 0.8 * math.sqrt(2 / 3), rtol=1e-9)
        assert np.abs(moved[0]).max() == np.abs(moved).max(axis=1).min()
        lines.append(found[:, 1] / found[:, 0])
    np.testing.assert_allclose(lines[1], -lines[0], atol=1e-9)
    np.testing.assert_allclose(lines[3], -lines[2], atol=1e-9)
    assert np.abs(lines[2] - lines[0]).max() > 0.1


@pytest.mark.parametrize(
    ("design", "message"),
    [
        (
            lambda: chirp(ODD, offset_v=-4.0, stop_hz=200.0, amplitude_v=0.01),
            "chirp: stop reaches 200 Hz, 3.11 samples a period at 622.08 Hz where limits.samples_per_period asks for "
            "4.5; would fit: at most 138.2 Hz, or a rate of at least 900 Hz; offset has -4 V, outside "
            "limits.drive_min to limits.drive_max; would fit: -3.5 V to 9.25 V",
        ),
        (
            lambda: chirp(ODD, start_hz=33.0, stop_hz=33.0),
            "chirp: stop is not above start; would fit: a frequency above 33 Hz",
        ),
        (
            lambda: chirp(ODD, start_hz=0.002, duration_s=0.4),
            "chirp: duration holds less than a thousandth of a period of 2 mHz; would fit: at least 500 ms, or a "
            "higher start",
        ),
        (
            lambda: chirp(replace(ODD, rate_hz=640.0), duration_s=2e4),
            "chirp: duration makes a record of 20000 s at 640 Hz; would fit: at most 15620 s (20 million samples), or "
            "a lower rate",
        ),
        (
            lambda: chirp(ODD, axis=2, amplitude_v=0.1, stop_hz=20.0),
            "chirp: axis is 3, but the bench has 2 inputs; would fit: 1 to 2",
        ),
        (
            lambda: sines(ODD, freq_hz=25.0, periods=3),
            "sines: periods of 25 Hz: 3 of them fill 74.6496 samples, no whole number; would fit: a multiple of 625, "
            "or a frequency of 24.8832 Hz",
        ),
        (
            lambda: sines(ODD, freq_hz=46.656, periods=2),
            "sines: periods of 46.66 Hz: 2 of them fill 26.6667 samples, no whole number; would fit: a multiple of 3, "
            "or a frequency of 46.08 Hz",
        ),
        (
            lambda: steps(ODD, levels_v=[1.0, 9.5, -6.0, 2.0], dwell_s=0.1, rise_s=0.02),
            "staircase: levels has 9.5 V, outside limits.drive_min to limits.drive_max; would fit: -3.5 V to 9.25 V; "
            "rise makes the largest step one of 803.5 V/s, limits.slew is 700 V/s; would fit: at least 22.51 ms",
        ),
        (
            lambda: steps(replace(ODD, drive_max_v=9.25004), levels_v=[1.0, 9.5], dwell_s=0.1, rise_s=1.0),
            "staircase: levels has 9.5 V, outside limits.drive_min to limits.drive_max; would fit: -3.5 V to 9.25004 V",
        ),
        (
            lambda: steps(ODD, levels_v=[1.0, 2.0], dwell_s=7e-4),
            "staircase: dwell is shorter than half a sample; would fit: at least 1.608 ms",
        ),
        (
            lambda: tones(ODD, lines=Lines(1.0, 3.0, 9.0)),
            "multisine: period is 622.08 samples, no whole number of at least 2; would fit: 999.871399 ms",
        ),
        (
            lambda: tones(ODD, lines=Lines(625 / 622.08, 3.0, 9.0), realisations=5),
            "multisine: realisations is 5, no multiple of the 2 inputs, so no orthogonal set; would fit: a multiple of "
            "2",
        ),
        (
            lambda: tones(ODD, lines=Lines(625 / 622.08, 4.1, 4.8, "odd-random"), realisations=2),
            "multisine: stop leaves no odd-random line of a multisine with one every 995.3 mHz; would fit: a wider "
            "band, or a longer period",
        ),
        (
            lambda: tones(ODD, lines=Lines(625 / 622.08, 3.0, 312.0), realisations=2),
            "multisine: stop reaches 311.5 Hz, 2 samples a period at 622.08 Hz where limits.samples_per_period asks "
            "for 4.5; would fit: at most 138.2 Hz, or a rate of at least 1.402 kHz",
        ),
    ],
)
def test_a_design_of_two_inputs_is_refused_in_all_words(design, message):
    with pytest.raises(DesignError) as refused:
        design()
    assert str(refused.value) == message


def test_a_size_beyond_three_limits_is_refused_with_what_fits_all_of_them():
    with pytest.raises(DesignError) as refused:
        chirp(ODD, amplitude_v=8.0, offset_v=2.25, stop_hz=33.0)
    shape = np.sin(2 * math.pi / math.log(33.0) * (33.0 ** (np.arange(622) / 622.08) - 1))
    slew = np.abs(np.diff(shape)).max() * 622.08
    most = f"would fit: at most {math.floor(700e3 / slew) / 1e3:g} V"
    assert str(refused.value) == (
        f"chirp: amplitude takes the drive to 10.25 V, limits.drive_max is 9.25 V; {most}; amplitude takes the drive "
        f"to -5.75 V, limits.drive_min is -3.5 V; {most}; amplitude takes the drive to {8e-3 * slew:.4g} kV/s, "
        f"limits.slew is 700 V/s; {most}"
    )


EVEN = replace(ODD, rate_hz=640.0)
FEWER = "; would fit: at most 15620 s (20 million samples), or a lower rate"
TONES = Lines(625 / 622.08, 3.0, 90.0)
MOST_RMS = "would fit: at most 592.4 mV"


@pytest.mark.parametrize(
    ("design", "message"),
    [
        (
            lambda: tones(EVEN, lines=Lines(2e4, 10.0, 20.0), realisations=2, name="m"),
            f"m: period makes a record of 20000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: tones(EVEN, lines=Lines(1.0, 10.0, 20.0), periods=20_000, realisations=2),
            f"multisine: periods makes a record of 20000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: tones(EVEN, lines=Lines(1.0, 10.0, 20.0), periods=9000, realisations=2),
            f"multisine: realisations makes a record of 18000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: tones(ODD, lines=TONES, realisations=2, rms_v=3.0, offset_v=1.0, name="tone"),
            f"tone: rms takes the drive to 11.48 V, limits.drive_max is 9.25 V; {MOST_RMS}; rms takes the drive to "
            f"-7.341 V, limits.drive_min is -3.5 V; {MOST_RMS}; rms takes the drive to 3.544 kV/s, limits.slew is "
            f"700 V/s; {MOST_RMS}",
        ),
        (
            lambda: tones(ODD, lines=TONES, realisations=2, rms_v=0.3, offset_v=9.5),
            "multisine: offset has 9.5 V, outside limits.drive_min to limits.drive_max; would fit: -3.5 V to 9.25 V",
        ),
        (
            lambda: sines(ODD, freq_hz=51.84, amplitudes_v=[0.5, 3.0, 4.5], periods=3, offset_v=-1.25, name="s"),
            "s: amplitudes takes the drive to -5.75 V, limits.drive_min is -3.5 V; would fit: at most 2.25 V; "
            "amplitudes takes the drive to 1.4 kV/s, limits.slew is 700 V/s; would fit: at most 2.25 V",
        ),
        (
            lambda: sines(ODD, freq_hz=207.36, amplitudes_v=[0.5], periods=3),
            "sines: frequencies reaches 207.4 Hz, 3 samples a period at 622.08 Hz where limits.samples_per_period asks "
            "for 4.5; would fit: at most 138.2 Hz, or a rate of at least 933.2 Hz",
        ),
        (
            lambda: sines(EVEN, freq_hz=16.0, amplitudes_v=[0.5], periods=320_000),
            f"sines: periods makes a record of 20000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: sines(EVEN, freq_hz=16.0, amplitudes_v=[0.5, 0.75, 1.0], periods=90_000),
            f"sines: periods makes a record of 16880 s at 640 Hz{FEWER}",
        ),
        (
            lambda: sines(ODD, freq_hz=51.84, axis=5, amplitudes_v=[0.5]),
            "sines: axis is 6, but the bench has 2 inputs; would fit: 1 to 2",
        ),
        (
            lambda: steps(ODD, levels_v=[-3.5, -3.6, 9.3], rise_s=0.1, name="stairs"),
            "stairs: levels has -3.6 V, outside limits.drive_min to limits.drive_max; would fit: -3.5 V to 9.25 V",
        ),
        (
            lambda: steps(ODD, levels_v=[-3.5, 9.0], rise_s=0.0),
            "staircase: rise makes the largest step one of 7.776 kV/s, limits.slew is 700 V/s; would fit: at least "
            "19.3 ms",
        ),
        (
            lambda: steps(EVEN, levels_v=[1.0, 2.0, 3.0], rise_s=6000.0),
            f"staircase: rise makes a record of 18000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: steps(EVEN, levels_v=[1.0, 2.0, 3.0], rise_s=1000.0, dwell_s=5000.0),
            f"staircase: dwell makes a record of 18000 s at 640 Hz{FEWER}",
        ),
        (
            lambda: steps(ODD, levels_v=[1.0, 2.0], axis=-1),
            "staircase: axis is 0, but the bench has 2 inputs; would fit: 1 to 2",
        ),
        (
            lambda: chirp(ODD, amplitude_v=6.0, offset_v=-3.5, stop_hz=12.0),
            "chirp: amplitude takes the drive to -9.5 V, limits.drive_min is -3.5 V; would fit: at most 0 V",
        ),
        (
            lambda: chirp(replace(ODD, slew_v_s=40.0), amplitude_v=0.5, offset_v=1.0, stop_hz=138.0),
            "chirp: amplitude takes the drive to 386.3 V/s, limits.slew is 40 V/s; would fit: at most 51.77 mV",
        ),
    ],
)
def test_a_design_beyond_its_length_size_or_slope_is_refused_in_all_words(design, message):
    with pytest.raises(DesignError) as refused:
        design()
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("design", "name", "rest_v", "period"),
    [
        (chirp, "chirp", 6.0, None),
        (lambda: sines(amplitudes_v=[1.5]), "sines", 6.0, 200),
        (lambda: sines(amplitudes_v=[1.5], periods=1), "sines", 6.0, None),
        (lambda: steps(levels_v=[2.5, 4.0, 3.0]), "staircase", 2.5, None),
        (lambda: tones()[0], "multisine", 6.0, 2000),
    ],
)
def test_a_design_has_its_name_its_rest_and_its_period_without_being_told(design, name, rest_v, period):
    made = design()
    assert (made.name, made.rest_v, made.rate_hz, made.period_samples) == (name, rest_v, 10e3, period)
    assert made.drive.shape == (made.samples, 1)


@pytest.mark.parametrize(
    ("start_hz", "stop_hz", "choice", "lines"),
    [
        (2.0, 7.0, "all", [2, 3, 4, 5, 6, 7]),
        (1.6, 6.9, "all", [2, 3, 4, 5, 6]),
        (2.0, 8.0, "odd", [3, 5, 7]),
        (0.0, 3.0, "all", [1, 2, 3]),
        (4.0, 4.0, "all", [4]),
        (2.9999999, 5.0000001, "odd", [3, 5]),
    ],
)
def test_a_multisine_has_each_line_of_its_band_the_ends_included(start_hz, stop_hz, choice, lines):
    (made,) = tones(lines=Lines(1.0, start_hz, stop_hz, choice))
    assert list(made.lines) == lines


@pytest.mark.parametrize(("odd", "kept"), [(3, 3), (4, 3), (7, 6), (8, 6), (11, 9)])
def test_of_each_four_odd_lines_one_is_left_out_and_of_fewer_none(odd, kept):
    (made,) = tones(lines=Lines(1.0, 5.0, 5.0 + 2 * (odd - 1), "odd-random"))
    every = np.arange(5, 5 + 2 * odd, 2)
    groups = [set(every[4 * k : 4 * k + 4].tolist()) for k in range(odd // 4)]
    assert len(made.lines) == kept and set(made.lines) <= set(every.tolist())
    assert all(len(group - set(made.lines)) == 1 for group in groups)


def test_each_of_three_pairs_of_realisations_has_phases_of_its_own():
    made = multisine(ODD, TONES, rms_v=0.1, offset_v=2.5, periods=1, realisations=6, seed=4)
    phases = [np.fft.rfft(each.drive - 2.5, axis=0)[4:50] for each in made]
    ratios = [found[:, 1] / found[:, 0] for found in phases]
    assert [each.name for each in made] == [f"multisine-{k}" for k in range(1, 7)]
    for a, b in ((0, 1), (2, 3), (4, 5)):
        np.testing.assert_allclose(ratios[a], -ratios[b], atol=1e-8)
    assert min(np.abs(ratios[a] - ratios[b]).max() for a, b in ((0, 2), (0, 4), (2, 4))) > 0.1


@pytest.mark.parametrize(
    ("design", "limits", "value"),
    [
        *((lambda *a, **k: sines(*a, freq_hz=k["value"], periods=20), LIMITS, f) for f in (7.3, 0.9, 11.1, 33.7)),
        *((lambda *a, **k: tones(*a, lines=Lines(k["value"], 1, 9), realisations=2), ODD, s) for s in (1.0, 100.7)),
    ],
)
def test_the_frequency_or_period_that_would_fit_is_taken(design, limits, value):
    with pytest.raises(DesignError, match="no whole number") as refused:
        design(limits, value=value)
    (problem,) = refused.value.problems
    filled = float(re.search(r"([\d.]+) samples", problem.reason)[1])
    assert filled != round(filled)
    number, unit = re.search(r"([\d.]+) (m?s|m?Hz)$", problem.expected).groups()
    design(limits, value=float(number) * (1e-3 if unit.startswith("m") else 1.0))


@pytest.mark.parametrize(
    ("design", "words"),
    [
        (
            lambda: chirp(ODD, stop_hz=138.25, amplitude_v=0.1),
            "stop reaches 138.25 Hz, 4.4997 samples a period at 622.08 Hz where limits.samples_per_period asks for "
            "4.5; would fit: at most 138.2 Hz, or a rate of at least 622.2 Hz",
        ),
        (lambda: chirp(amplitude_v=6.00001), "takes the drive to 12.00001 V, limits.drive_max is 12 V"),
        (lambda: chirp(offset_v=12.00001), "offset has 12.00001 V, outside"),
        (lambda: steps(rise_s=6e-4, levels_v=[0.0, 12.0], limits=replace(LIMITS, slew_v_s=19999.0)), "of 20 kV/s, "),
        (lambda: steps(rise_s=6e-4, limits=replace(LIMITS, slew_v_s=19999.0)), "limits.slew is 19.999 kV/s; "),
        (lambda: chirp(duration_s=2000.01), "makes a record of 2000.01 s at 10 kHz; would fit: at most 2000 s"),
    ],
)
def test_what_breaks_a_limit_is_not_told_as_the_limit(design, words):
    with pytest.raises(DesignError) as refused:
        design()
    assert words in str(refused.value)


def test_a_chirp_that_begins_too_fast_is_told_of_both_ends():
    with pytest.raises(DesignError) as refused:
        chirp(ODD, start_hz=200.0, stop_hz=300.0, amplitude_v=0.1)
    assert [(p.key, p.expected.split(",")[0]) for p in refused.value.problems[:2]] == [
        ("start", "at most 138.2 Hz"),
        ("stop", "at most 138.2 Hz"),
    ]


def test_sines_may_fall_and_their_limits_are_those_of_the_largest():
    """A tenth of a second at each amplitude; the largest one stands in the middle."""
    made = growing_sines(LIMITS, freq_hz=20.0, amplitudes_v=[2.0, 5.0, 1.0], periods=2, offset_v=6.0)
    tops = [np.abs(part - 6.0).max() for part in np.split(made.drive[:, 0], 3)]
    assert tops == pytest.approx([2.0, 5.0, 1.0], rel=1e-9) and made.samples == 3000
    with pytest.raises(DesignError, match=r"amplitudes takes the drive to 13 V, .*at most 6 V"):
        growing_sines(LIMITS, freq_hz=20.0, amplitudes_v=[2.0, 7.0, 1.0], periods=2, offset_v=6.0)


def test_a_ramp_may_be_as_steep_as_the_limit_though_rounding_passes_it():
    """4.9 V in 7 ms at 700 V/s: in floating point the quotient lies above the limit."""
    limits = Limits(rate_hz=1000.0, drive_min_v=0.0, drive_max_v=9.0, slew_v_s=700.0, samples_per_period=4.0)
    assert 4.9 / 7 * 1000.0 > 700.0
    made = staircase(limits, levels_v=[1.0, 1.0 + 4.9, 1.0], dwell_s=5e-3, rise_s=7e-3)
    assert made.step_samples == (12, 24) and made.samples == 30
    with pytest.raises(DesignError, match=r"rise makes the largest step one of 816\.7 V/s, .*would fit: at least 7 ms"):
        staircase(limits, levels_v=[1.0, 5.9, 1.0], dwell_s=5e-3, rise_s=6e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_rounding_leaves_is_a_share_of_the_whole_range_of_a_drive_of_both_signs(side):
    """From -10 V to 10 V a billionth of the range is 20 nV."""
    limits = replace(LIMITS, drive_min_v=-10.0, drive_max_v=10.0)
    assert steps(limits, levels_v=[0.0, side * (10.0 + 1.9e-8)]).drive[-1, 0] == side * (10.0 + 1.9e-8)
    with pytest.raises(DesignError, match=r"levels has -?10 V, outside .*; would fit: -10 V to 10 V$"):
        steps(limits, levels_v=[0.0, side * (10.0 + 2.1e-8)])
