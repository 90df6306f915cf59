"""The ladder for several channels: what it chooses, what it hands on bit for bit, how it stops, what it refuses."""

import re
from dataclasses import astuple, replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from microrad.core import kernels
from microrad.core.periodic import delayed
from microrad.lab.identify.coupled import channels as channels_module
from microrad.lab.identify.coupled import held_out as held_out_module
from microrad.lab.identify.coupled import hysteretic, identify_coupled, ladder, linear, linear_errors, wiring
from microrad.lab.identify.coupled import mirror_file as coupled_mirror_file
from microrad.lab.identify.coupled.channels import _rounded_bias, channels
from microrad.lab.identify.coupled.held_out import held_out_error, smallest_within_noise
from microrad.lab.identify.coupled.ladder import LadderOptions
from microrad.lab.identify.coupled.mirror_file import coupled_file_text
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.response import FrequencyResponse, response_from_periods
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness.fit import amplitude_classes
from microrad.lab.recording import Recording, multisine_recordings
from microrad.mirror import coupled
from microrad.mirror import model as mirror
from microrad.mirror.coupled import Output
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mission.file import load_coupled_mirror
from places import DATA, ROOT

CUBESPEC = DATA / "cubespec"
needs_cubespec = pytest.mark.skipif(not CUBESPEC.exists(), reason=f"real recording cubespec absent: {CUBESPEC}")
RATE_HZ, PERIOD = 1000.0, 512
ORDERS = LadderOptions(axis_orders=(2,), linear_orders=(2, 4), stiffness_orders=(4,))


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def multisine(seed):
    """Random-phase multisine of unit rms on 200 lines, two drives."""
    spectrum = np.zeros((PERIOD // 2 + 1, 2), dtype=complex)
    spectrum[1:201] = np.exp(1j * philox(seed).uniform(0, 2 * np.pi, (200, 2)))
    drive = np.fft.irfft(spectrum, PERIOD, axis=0)
    return drive / drive.std(axis=0)


def truth(hysteresis):
    """Two modes, two drives, two angles; each actuator is a spring that softens by plays of its own strain."""
    A = block_diag(*([[s, -w], [w, s]] for s, w in ((-18.0, 900.0), (-34.0, 1700.0))))
    B = np.array([[0.0, 0.0], [-700.0, -600.0], [0.0, 0.0], [-800.0, 900.0]])
    C = 1e-5 * np.array([[1.0, 0.0, 0.7, 0.0], [0.8, 0.0, -0.8, 0.0]])
    strain = np.linalg.inv(-C @ np.linalg.solve(A, B)) @ C
    play = PrandtlIshlinskii((0.1, 0.3, 0.8, 2.0), (0.01 * hysteresis,) * 4)
    idle = PrandtlIshlinskii((1.0,), (0.0,))  # as many operators as the fit has: then the kernel compiles once
    E, F, G = np.hstack([B, B]), np.vstack([strain, strain]), np.zeros((4, 2))
    D = 1e-6 * np.array([[2.0, 1.0], [1.0, -2.0]])  # without one, a direct term stands in for a part of the delay
    return Mirror("truth", A, B, E, F, G, C, D, np.zeros((2, 4)), (), (play, play, idle, idle), ())


def record_of(plant, amplitude, seed, noise, steps):
    """Two periods in the steady state, behind 0.7 ms, with steps of its own."""
    drive = amplitude * multisine(seed)
    fine = delayed(np.tile(drive, (4, 1)), RATE_HZ, 7e-4, steps)
    discrete = mirror.discretise(plant, 1 / (steps * RATE_HZ))
    output = np.empty_like(fine)
    kernels.open_loop(discrete, mirror.at_rest(discrete), fine, output, np.empty((fine.shape[0], 0)))
    output = output[2 * steps * PERIOD :: steps]
    output = output + noise * output.std() * philox(1000 + seed).standard_normal(output.shape)
    names = ("u0", "u1"), ("x", "y")
    return Recording(f"{amplitude:g} V, {seed}", f"{seed}", np.tile(drive, (2, 1)), output, RATE_HZ, *names, PERIOD)


def records(hysteresis, noise, steps=8):
    plant = truth(hysteresis)
    return [
        record_of(plant, amplitude, 10 * i + k, noise, steps)
        for i, amplitude in enumerate((0.4, 1.2))
        for k in range(4)
    ]


@pytest.fixture(scope="module")
def hysteretic_records():
    return records(1.0, 1e-3)


@pytest.fixture(scope="module")
def found(hysteretic_records):
    told, heard = [], []
    result = identify_coupled(
        hysteretic_records,
        output_unit="rad",
        options=ORDERS,
        on_progress=lambda done, total, what: told.append((done, total, what)),
        on_model=heard.append,
    )
    return result, told, heard


@pytest.mark.promise("identify-65")
def test_the_example_of_the_page_writes_the_file_of_a_mirror(hysteretic_records, monkeypatch, capsys, tmp_path):
    """With the two smallest models of the ladder."""
    quick = partial(identify_coupled, options=LadderOptions(axis_orders=(2,), linear_orders=(2,), stiffness_orders=()))
    monkeypatch.setattr("microrad.lab.identify.coupled.identify_coupled", quick)
    page = (ROOT / "docs" / "identify.md").read_text(encoding="utf-8")
    (code,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "identify_coupled" in each)
    known = {"recordings": hysteretic_records}
    exec(code, known)
    assert known["found"].chosen in capsys.readouterr().out
    mirror_file = load_coupled_mirror(tmp_path / "our.toml", text=known["text"])
    assert (mirror_file.version, mirror_file.name) == (2, "our mirror")


# ----------------------------------------------------------------------------------------------------------- the choice
@pytest.mark.promise("hysteretic-stiffness-15", "hysteretic-stiffness-31")
@pytest.mark.promise("identify-40", "identify-41", "identify-43")
@pytest.mark.promise("identify-61")
def test_hysteretic_stiffness_is_found_where_it_is(found):
    result, _, _ = found
    names = [candidate.name for candidate in result.candidates]
    assert names == [
        "per axis, order 2 each",
        "coupled linear, order 2",
        "coupled linear, order 4",
        "hysteretic stiffness, order 4",
    ]
    assert result.chosen == names[-1] == result.best.name
    axis, _, straight, own = result.candidates
    assert 1e-3 < own.error_share < 0.3 * straight.error_share < 0.3 * axis.error_share
    assert axis.parameters < straight.parameters < own.parameters
    assert result.held_out == ("0.4 V, 3", "1.2 V, 13")
    assert len(result.fitted) == 6 and not set(result.fitted) & set(result.held_out)
    assert f"{100 * own.error_share:.3g} % of the output" in result.reason and "less than any other" in result.reason
    assert not result.stopped and result.refused == ()


@pytest.mark.promise("identify-42", "identify-45")
def test_errors_are_rms_by_amplitude_output_and_band(found, hysteretic_records):
    result, _, _ = found
    own = result.candidate()
    np.testing.assert_allclose(result.amplitudes_v, (0.4, 1.2), rtol=1e-3)
    held = [record for record in hysteretic_records if record.path in result.held_out]
    errors = np.array([held_out_error(own.model, record).std(axis=0) for record in held])
    np.testing.assert_allclose(own.error_rms, errors, rtol=1e-9)
    np.testing.assert_allclose(own.record_share, errors / [r.output.std(axis=0) for r in held], rtol=1e-9)
    np.testing.assert_allclose(own.error_share, np.sqrt(np.mean(own.record_share**2)), rtol=1e-9)
    inside = np.sum(own.band_error_rms**2, axis=1)
    assert (0.3 * own.error_rms**2 < inside).all() and (inside < 1.0001 * own.error_rms**2).all()
    np.testing.assert_allclose(result.noise_rms / result.output_rms, 1e-3, rtol=0.3)
    assert result.bands_hz.size == own.band_error_rms.shape[1] + 1


@pytest.mark.promise("identify-43", "identify-45")
def test_the_linear_model_is_enough_where_the_truth_is_linear():
    result = identify_coupled(records(0.0, 1e-2, linear.STEPS), output_unit="rad", options=ORDERS)
    assert result.chosen == "coupled linear, order 4"
    own, other = result.candidate(), result.candidates[-1]
    assert other.kind == "hysteretic stiffness"
    assert own.error_share == pytest.approx(1e-2, rel=0.2)
    assert own.name in result.within_noise
    known = own.model.known
    index = known.parameters.index("recording.delay")
    assert abs(own.model.delay_s - 7e-4) < 5 * own.delay_error_s < 1e-4
    assert known.standard_errors[index] == pytest.approx(own.delay_error_s)
    poles = own.poles_rad_s[np.argsort(own.poles_rad_s.imag)]
    away = poles - np.array([-18 + 900j, -34 + 1700j])
    size = own.poles_error_rad_s[np.argsort(own.poles_rad_s.imag)]
    assert (np.abs(away.real) < 5 * size.real).all() and (np.abs(away.imag) < 5 * size.imag).all()
    assert (size.real < 1.0).all() and (size.imag < 1.0).all()


@pytest.mark.promise("identify-43")
def test_the_smaller_model_wins_unless_the_difference_is_certain():
    class Own:
        def __init__(self, losses):
            self.losses, self.share = (losses,), float(np.sqrt(losses.mean()))

    noise = philox(0).standard_normal(400)
    small, large = Own((1.001 * noise) ** 2 + 1e-3 * philox(1).standard_normal(400) ** 2), Own(noise**2)
    assert smallest_within_noise([small, large], [10, 20])[:2] == (1, 1)
    near = Own((noise + 0.01 * philox(2).standard_normal(400)) ** 2)
    assert smallest_within_noise([near, large], [10, 20])[0] == 0


@pytest.mark.promise("identify-40")
def test_what_is_held_out_is_seen_by_no_fit(hysteretic_records):
    few = hysteretic_records[:4]
    changed = [*few[:3], replace(few[3], output=1.5 * few[3].output[::-1], sha256="changed")]
    quick = LadderOptions(axis_orders=(2,), linear_orders=(2,))
    one, other = (identify_coupled(each, output_unit="rad", options=quick) for each in (few, changed))
    assert one.held_out == other.held_out == ("0.4 V, 3",)
    for a, b in zip(one.candidates, other.candidates, strict=True):
        for name in "ABCD":
            np.testing.assert_array_equal(getattr(a.model.mirror, name), getattr(b.model.mirror, name))
        assert b.error_share > 1.2 * a.error_share


# ---------------------------------------------------------------------------------------------------- what is handed on
@pytest.mark.promise("hysteretic-stiffness-15")
@pytest.mark.promise("decisions-1")
def test_the_model_is_the_fit_and_the_file_is_the_model(found, tmp_path):
    result, _, _ = found
    for candidate in result.candidates:
        text = coupled.text(candidate.model, ["of a test"])
        read = coupled.of(load_coupled_mirror(tmp_path / "mirror.toml", text=text))
        drive = np.tile(multisine(77), (2, 1))
        np.testing.assert_array_equal(read.response(drive), candidate.model.response(drive))
        assert read.known.parameters == candidate.model.known.parameters
        assert np.abs(read.response(drive)).max() > 0


@pytest.mark.promise("mirror-file-52")
def test_errors_of_the_hysteretic_fit_come_from_its_records(found):
    own = found[0].candidate()
    known = own.model.known
    assert known.factor.shape == (len(known.parameters), 6)  # one column a record
    np.testing.assert_allclose(np.linalg.norm(known.factor, axis=1), 1.0)
    place = known.parameters.index("modes.frequency.1")
    assert 0 < known.standard_errors[place] < 5.0
    assert {"hysteresis.1.weights.1", "hysteresis.1.polynomial.2"} < set(known.parameters)


@pytest.mark.promise("identify-41")
def test_each_amplitude_has_its_response_and_the_models(found):
    result, _, _ = found
    for response, modelled in zip(result.responses, result.modelled, strict=True):
        assert response.response.shape == modelled.shape == (200, 2, 2)
        away = np.linalg.norm(modelled - response.response) / np.linalg.norm(response.response)
        assert away < 0.05
    assert result.dependence.resonance_shift_hz < -0.1 and result.dependence.gain_rise_percent > 0.0


def test_derivatives_of_a_linear_model_against_differences(hysteretic_records):
    response = linear.without_delay(response_from_periods(hysteretic_records), 7e-4, linear.STEPS)
    poles = np.array([-40.0, -20.0 + 900.0j, -30.0 + 1500.0j])
    b = np.array([[1.0, 2.0], [0.5 + 1.0j, -1.0 + 0.3j], [0.2 - 0.1j, 0.8 + 0.4j]])
    c = np.array([[0.5, 1.0 - 0.2j, 0.3 + 0.1j], [-1.0, 0.4 + 0.6j, 0.7 - 0.5j]])
    direct = np.array([[0.1, 0.2], [-0.3, 0.05]])
    exact = linear_errors.jacobian(ModalModel(poles, b, c, direct), response, slice(0, 200, 20))
    plant = linear.side_by_side([ModalModel(poles, b, c, direct)])
    theta = np.concatenate([-poles.real, poles[1:].imag, plant.B.ravel(), plant.C.ravel(), direct.ravel(), [0.0]])
    names = linear_errors.names(ModalModel(poles, b, c, direct), range(2), range(2))
    assert len(names) == theta.size == exact.shape[3]
    of_outputs = [f"matrices.C.{output}.{state}" for output in (1, 2) for state in range(1, 6)]
    assert [name for name in names if name.startswith("matrices.C")] == of_outputs, "as C is ravelled"
    freq = response.freq_hz[slice(0, 200, 20)]

    def modelled(values):
        decay, wide, B, C, D, late = np.split(values, np.cumsum([3, 2, 10, 10, 4]))
        B, C = B.reshape(5, 2), C.reshape(2, 5)
        p = -decay + 1j * np.array([0.0, *wide])
        own = ModalModel(
            p,
            np.array([B[0], B[1] + 1j * B[2], B[3] + 1j * B[4]]),
            np.stack([C[:, 0], (C[:, 1] - 1j * C[:, 2]) / 2, (C[:, 3] - 1j * C[:, 4]) / 2], axis=1),
            D.reshape(2, 2),
        )
        turned = np.exp(-2j * np.pi * freq * late)[:, None, None]
        return own.response(freq, response.hold, response.rate_hz) * turned

    for k, name in enumerate(names):
        step = np.zeros(theta.size)
        step[k] = 1e-8 if name == "recording.delay" else 1e-6 * max(abs(theta[k]), 1e-3)
        expected = (modelled(theta + step) - modelled(theta - step)) / (2 * step[k])
        assert np.abs(expected).max() > 0
        np.testing.assert_allclose(exact[..., k], expected, rtol=0, atol=1e-5 * np.abs(expected).max(), err_msg=name)


# ------------------------------------------------------------------------------------------- progress, and how it stops
@pytest.mark.promise("hysteretic-stiffness-15")
def test_progress_names_the_best_model_so_far(found):
    result, told, heard = found
    assert [candidate.name for candidate in heard] == [candidate.name for candidate in result.candidates]
    assert told[0] == (0, 4, "delay") and told[-1][:2] == (4, 4)
    assert all(done <= total for done, total, _ in told)
    iterations = [what for _, _, what in told if "iteration" in what]
    assert "hysteretic stiffness, order 4, iteration 1 of 25; best so far coupled linear, order 4: " in iterations[0]


@pytest.mark.promise("identify-44")
def test_stopped_it_returns_what_was_found(hysteretic_records):
    def stop(candidate):
        if candidate.kind == "coupled linear":
            raise KeyboardInterrupt

    result = identify_coupled(hysteretic_records, output_unit="rad", options=ORDERS, on_model=stop)
    assert result.stopped and len(result.candidates) == 2
    assert result.chosen in {candidate.name for candidate in result.candidates}

    def at_once(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        identify_coupled(hysteretic_records, output_unit="rad", options=ORDERS, on_progress=at_once)


# ------------------------------------------------------------------------------------------------------------- refusals
SHORT = LadderOptions(axis_orders=(), linear_orders=(4,), stiffness_orders=(4,))


def test_one_amplitude_leaves_linear_models(hysteretic_records):
    result = identify_coupled(hysteretic_records[:3], output_unit="rad", options=SHORT)
    assert result.chosen == "coupled linear, order 4"
    own = result.candidate()  # of as many records as drives: its errors are those of white noise
    assert own.model.known.factor.shape[1] > 10
    assert (own.poles_error_rad_s.real > 0.0).all() and (own.poles_error_rad_s.imag > 0.0).all()
    assert np.abs(own.poles_error_rad_s).max() < 10.0
    (refused,) = result.refused
    assert refused.model == "hysteretic stiffness" and "one amplitude, 0.4 V rms" in refused.reason
    assert result.dependence is None


def test_a_model_that_runs_away_is_listed_with_its_reason(hysteretic_records, monkeypatch):
    def runs_away(*_):
        raise IdentificationError("the fitted mirror runs away.")

    def grows(response, order, *_):
        own = linear.per_axis(response, 2, 0.0, None)
        return replace(own, name=f"coupled linear, order {order}", mirror=replace(own.mirror, A=-500 * own.mirror.A))

    monkeypatch.setattr(ladder, "hysteretic_stiffness", runs_away)
    options = replace(SHORT, axis_orders=(2,))
    result = identify_coupled(hysteretic_records, output_unit="rad", options=options)
    assert [(refused.model, refused.reason) for refused in result.refused] == [
        ("hysteretic stiffness, order 4", "the fitted mirror runs away.")
    ]
    assert result.chosen == "coupled linear, order 4"
    monkeypatch.setattr(ladder, "coupled_linear", grows)
    result = identify_coupled(hysteretic_records, output_unit="rad", options=options)
    assert result.chosen == "per axis, order 2 each"
    assert result.refused[0].model == "coupled linear, order 4"
    assert result.refused[0].reason == "it runs away on a held-out record"
    with pytest.raises(IdentificationError, match=r"no model could be fitted: coupled linear, order 4: it runs away"):
        identify_coupled(hysteretic_records, output_unit="rad", options=SHORT)


def test_drives_that_copy_each_other_are_named(hysteretic_records):
    copied = [replace(r, drive=np.repeat(r.drive[:, :1], 2, axis=1)) for r in hysteretic_records]
    with pytest.raises(ValueError, match=r"u1.*u0|u0.*u1"):
        identify_coupled(copied, output_unit="rad", options=SHORT)


@pytest.mark.promise("identify-39", "identify-40", "identify-50")
def test_chirps_of_each_drive_give_linear_models(hysteretic_records):
    time = np.arange(4096) / RATE_HZ
    chirp = np.sin(2 * np.pi * (5.0 * time + 40.0 * time**2)) * np.minimum(1.0, 20 * np.minimum(time, time[-1] - time))
    made = []
    plant = coupled.CoupledMirror(truth(0.0), *(identify_actuators(hysteretic_records)), 7e-4, RATE_HZ, 2, (1.0, 400.0))
    for k in range(4):
        drive = np.zeros((4096, 2))
        drive[:, k % 2] = (0.5 + 0.1 * (k // 2)) * chirp
        output = plant.response(drive)
        output = output + 1e-3 * output.std() * philox(k).standard_normal(output.shape)
        made.append(Recording(f"chirp {k}", f"chirp {k}", drive, output, RATE_HZ, ("u0", "u1"), ("x", "y")))
    result = identify_coupled(made[:2], validation=made[2:], output_unit="rad", options=SHORT)
    assert result.held_out == ("chirp 2", "chirp 3")
    assert result.candidate().error_share < 0.1
    assert "no record is periodic" in result.refused[0].reason
    with pytest.raises(IdentificationError, match="none can be held out to judge the models by"):
        identify_coupled(made[:2], output_unit="rad", options=SHORT)
    with pytest.raises(IdentificationError, match=r"chirp 0: of this record and .* one is periodic"):
        identify_coupled([hysteretic_records[0], made[0]], output_unit="rad")


def identify_actuators(given):
    actuators = tuple(coupled.Actuator(name, 0.0, -1.0, 1.0, 1e3) for name in given[0].input_names)
    return actuators, tuple(coupled.Output(name, "angle") for name in given[0].output_names)


@pytest.mark.promise("identify-39")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate_hz": 2000.0}, r"0\.4 V, 1: the sample rate is 2000 Hz and that of 0\.4 V, 0 1000 Hz"),
        ({"output": np.zeros((1024, 3)), "output_names": ("x", "y", "z")}, r"0\.4 V, 1: 2 inputs and 3 outputs"),
        ({"period_samples": 256}, r"0\.4 V, 1: 1024 samples in periods of 256, where 0\.4 V, 0 has 1024 samples in"),
        (
            {"drive": np.zeros((512, 2)), "output": np.zeros((512, 2))},
            r"0\.4 V, 1: 512 samples in periods of 512, where 0\.4 V, 0 has 1024 samples .* cut all records",
        ),
        ({"drive": np.zeros((1024, 2))}, r"0\.4 V, 1: the drive does not change"),
    ],
)
def test_records_that_do_not_belong_together_are_named(hysteretic_records, change, message):
    first, second, *rest = hysteretic_records
    with pytest.raises(IdentificationError, match=message):
        identify_coupled([first, replace(second, **change), *rest], output_unit="rad")


def test_other_things_that_cannot_be(hysteretic_records):
    with pytest.raises(IdentificationError, match="no recording was given"):
        identify_coupled([])
    with pytest.raises(IdentificationError, match="output unit 'inch' is not known"):
        identify_coupled(hysteretic_records, output_unit="inch")
    with pytest.raises(IdentificationError, match="input unit 'kV' is not known"):
        identify_coupled(hysteretic_records, drive_unit="kV", output_unit="rad")
    with pytest.raises(IdentificationError, match=r"1 position for 2 outputs \(x, y\)"):
        identify_coupled(hysteretic_records, output_unit="m", positions_m=[(0.0, 1.0)])
    with pytest.raises(IdentificationError, match=r"2 records for 2 actuators: 1 held out .* leave 1, and at least 2"):
        identify_coupled(hysteretic_records[:2], output_unit="rad")


# ------------------------------------------------------------------------------------------------------------- CubeSpec
@pytest.mark.endurance
@needs_cubespec
def test_the_ladder_on_cubespec(monkeypatch):
    """Four realisations, four states and few iterations: the choice needs hysteresis already."""
    monkeypatch.setattr(ladder, "_EXCHANGES", 0)
    monkeypatch.setattr(hysteretic, "FEW", 3)
    monkeypatch.setattr(hysteretic, "ALL", 1)

    def of(amplitude_mv):
        drive, output = (np.load(CUBESPEC / f"{name}_{amplitude_mv}mV_train.npy")[:, :, :4] for name in "uy")
        return multisine_recordings(drive, output, 6400.0, f"{amplitude_mv} mV")

    every = [*of(100), *of(300)]
    options = LadderOptions(axis_orders=(), linear_orders=(), stiffness_orders=(4,))
    result = identify_coupled(every, options=options)
    assert result.held_out == ("100 mV realisation 3", "300 mV realisation 3")
    straight, own = result.candidates
    assert result.chosen == own.name == "hysteretic stiffness, order 4"
    assert 0.2 < own.error_share < straight.error_share < 0.62
    assert amplitude_classes(every)[1] == (0, 0, 0, 0, 1, 1, 1, 1)


@pytest.mark.parametrize("bias", [0.0, 6.0, -37.5])
def test_rounding_in_the_records_is_no_bias(bias):
    """Means of multisines differ in their last bits: flight code asks that all actuators rest at one bias."""
    rng = np.random.Generator(np.random.Philox(4))
    drive = rng.standard_normal((512, 3, 4))
    drive += bias - drive.mean(axis=0)
    assert len({float(v) for v in drive.mean(axis=0).ravel()}) > 1
    output = 2.0 * drive[:, :2] + drive[:, 1:]
    drive, output = (np.repeat(a[..., None], 2, axis=3) for a in (drive, output))
    output = output + 0.01 * rng.standard_normal(output.shape)
    found = channels(multisine_recordings(drive, output, 2000.0), (), "V", "um", None)
    assert [actuator.bias_v for actuator in found.actuators] == [bias, bias, bias]


@pytest.mark.parametrize(("period_samples", "rest"), [(None, 6.0), (256, 6.75)])
def test_a_drive_rests_where_it_begins_and_a_periodic_one_at_its_mean(period_samples, rest):
    """A step up for a quarter of the time: where it began is where it rests, unless it comes again and again."""
    drive = np.full((512, 1), 6.0)
    drive[np.arange(512) % 256 >= 192] = 9.0
    records = [SimpleNamespace(drive=drive, period_samples=period_samples)]
    assert _rounded_bias(records) == pytest.approx([rest])


def test_each_of_four_displacements_needs_its_place():
    places = (0.01, 0.0), (0.0, 0.01), (-0.01, -0.01), None
    outputs = [Output(f"y{k}", "displacement", position_m=place) for k, place in enumerate(places)]
    with pytest.raises(IdentificationError, match=r"u\.npy: .*3 of 4 displacements have a position"):
        wiring._check_places("u.npy", outputs)
    wiring._check_places("u.npy", outputs[:3])


def test_a_bend_that_no_exchange_of_channels_explains_is_taken(hysteretic_records):
    places = (0.01, 0.0), (0.0, 0.01), (-0.01, 0.0), (0.0, -0.01)
    outputs = [Output(name, "displacement", position_m=place) for name, place in zip("abcd", places, strict=True)]
    flat = np.array([[y, -x, 1.0] for x, y in places]) @ philox(3).standard_normal((3, 2))
    response = response_from_periods(hysteretic_records)

    def check(gain):
        names, shape = tuple("abcd"), (response.freq_hz.size, 4, 2)
        moved = np.broadcast_to(gain, shape).astype(complex)
        found = replace(response, response=moved, standard_error=np.full(shape, 1e-6), output_names=names)
        wiring.check_wiring("u.npy", found, outputs, None)

    check(flat)
    check(philox(4).standard_normal((4, 2)))
    with pytest.raises(IdentificationError, match="50 % of what the outputs show is neither tilt nor piston"):
        check(flat * [[1.0], [-1.0], [1.0], [1.0]])


def test_one_record_of_no_period_may_be_left_to_fit_two_actuators(hysteretic_records):
    once = [replace(each, period_samples=None) for each in hysteretic_records[:2]]
    assert len(channels(once, (), "V", "rad", None).fitted) == 1
    with pytest.raises(IdentificationError, match="2 records for 2 actuators: 1 held out"):
        channels(hysteretic_records[:2], (), "V", "rad", None)


def test_hysteretic_stiffness_begins_with_a_linear_model(hysteretic_records):
    for start in (None, SimpleNamespace(modes=None)):
        with pytest.raises(IdentificationError, match="no coupled linear model of this order to begin with"):
            hysteretic.hysteretic_stiffness(hysteretic_records, start, lambda *_: None)


def climbed(monkeypatch, options, *, lines=11, two_amplitudes=True, failing=()):
    """The models that a ladder tries, where each is found unless it fails; the best linear one has the order 4."""

    def judged(self, fit):
        name, *self.left = self.left
        self.done += 1
        told.append((self.done, self.total, name))
        if name in failing:
            return
        self.fits[name] = SimpleNamespace(delay_s=self.done)
        order = int(re.search(r"order (\d+)", name)[1])
        kind = name.split(",")[0]
        losses = np.full(50, 1.0 + 0.1 * (order - 4) ** 2)
        self.found.append(
            (
                SimpleNamespace(kind=kind, order=order, parameters=order),
                SimpleNamespace(losses=(losses,), share=losses.sum()),
            )
        )

    told, delays = [], []
    monkeypatch.setattr(ladder._Ladder, "_judge", judged)
    monkeypatch.setattr(ladder._Ladder, "_so_far", lambda self: "")
    monkeypatch.setattr(ladder, "best_delay", lambda response, order, steps: told.append((0, order, "delay")) or 0.5)
    monkeypatch.setattr(ladder, "line_spectra", lambda *_: None)
    monkeypatch.setattr(ladder, "partial", lambda fit, *given: delays.append((fit.__name__, *given[1:3])))
    amplitudes = SimpleNamespace(
        periodic=True, fitted_class=np.array([0, int(two_amplitudes)]), amplitudes_v=np.array([1.0, 2.0]), fitted=()
    )
    one = ladder._Ladder(amplitudes, SimpleNamespace(freq_hz=np.arange(lines)), np.ones(1), lambda candidate: None)
    reported = []
    one.climb(options, lambda *args: reported.append(args))
    assert reported[0][2] == "delay" and reported[-1] == (one.done, one.total, "done") and one.done == one.total
    return [name for *_, name in told], one, delays, told


def test_the_ladder_goes_from_small_to_large_and_hysteresis_begins_at_the_best_linear_model(monkeypatch):
    names, one, delays, told = climbed(monkeypatch, LadderOptions((2,), (6, 4, 2, 8)))
    assert names == [
        "delay",
        "per axis, order 2 each",
        *(f"coupled linear, order {n}" for n in (2, 4, 6, 8)),
        "hysteretic stiffness, order 4",
        "hysteretic stiffness, order 6",
    ]
    assert [total for _, total, _ in told] == [8, *[7] * 7]
    assert one.refused == []
    # the delay of each coupled linear model is that of the one before it
    assert [given[2] for given in delays[:5]] == [0.5, 0.5, 2, 3, 4]


def test_no_order_is_tried_that_the_lines_of_the_response_cannot_fix(monkeypatch):
    names, *_ = climbed(monkeypatch, LadderOptions((), (4, 10, 11), (6, 12)))
    assert names[1:] == [
        *(f"coupled linear, order {n}" for n in (4, 6, 10)),
        "hysteretic stiffness, order 6",
    ]
    assert climbed(monkeypatch, LadderOptions((), (4, 8), (12,)))[0][-2:] == [
        "hysteretic stiffness, order 4",
        "hysteretic stiffness, order 8",
    ]
    names, *_ = climbed(monkeypatch, LadderOptions((), (12, 16)), lines=5)
    assert names[1:] == ["coupled linear, order 4", "hysteretic stiffness, order 4"]
    assert climbed(monkeypatch, LadderOptions((), (2, 4)))[0][-1:] == ["hysteretic stiffness, order 4"]


def test_the_ladder_goes_on_where_models_fail_and_without_hysteresis_for_one_amplitude(monkeypatch):
    failing = [f"coupled linear, order {n}" for n in (2, 6)]
    names, _, delays, _ = climbed(monkeypatch, LadderOptions((), (2, 6, 8)), failing=failing)
    assert names[-1] == "hysteretic stiffness, order 8"
    assert [given[2] for given in delays[:3]] == [0.5, 0.5, 0.5]
    names, *_ = climbed(monkeypatch, LadderOptions((), (2, 6, 8)), failing=[*failing, "coupled linear, order 8"])
    assert names[-1:] == ["hysteretic stiffness, order 2"]
    names, one, *_ = climbed(monkeypatch, LadderOptions((2,), (2, 4), (6,)), two_amplitudes=False)
    assert names[1:] == ["per axis, order 2 each", "coupled linear, order 2", "coupled linear, order 4"]
    (refused,) = one.refused
    assert refused.model == "hysteretic stiffness"
    assert refused.reason.startswith("all fitted records have one amplitude, 1 V rms: hysteresis cannot be told")


def test_a_search_that_was_ended_is_noted_and_warned_of_and_so_is_the_largest_model():
    assert hysteretic._note(True, 10) == ""
    assert hysteretic._note(False, 10) == "the search was ended before its optimum, after 10 steps on all records"
    small, large, other = (
        SimpleNamespace(name=f"{kind} {order}", kind=kind, order=order, note=note)
        for kind, order, note in (("linear", 2, ""), ("linear", 4, "of note"), ("per axis", 8, ""))
    )
    every = SimpleNamespace(candidates=[small, large, other])
    assert list(ladder._Ladder._warnings(every, small, small)) == []
    told = (
        "The least error is that of the largest model of its kind that was tried, linear 4: a larger one may have less."
    )
    assert list(ladder._Ladder._warnings(every, small, large)) == [told]
    assert list(ladder._Ladder._warnings(every, large, small)) == ["linear 4: of note."]
    assert list(ladder._Ladder._warnings(every, large, large)) == ["linear 4: of note.", told]


def test_records_without_a_period_are_of_one_length():
    first, second = (
        Recording(f"chirp {n}", "", np.zeros((n, 1)), np.zeros((n, 1)), 1.0, ("u",), ("y",)) for n in (900, 1000)
    )
    with pytest.raises(IdentificationError) as caught:
        channels_module._periodic([first, second])
    assert str(caught.value) == (
        "chirp 1000: 1000 samples, where chirp 900 has 900 samples; cut all records to one length and period."
    )
    assert channels_module._periodic([first, first]) is False
    assert channels_module._periodic([replace(first, period_samples=100)]) is True
    with pytest.raises(
        IdentificationError, match="900 samples in periods of 100, where chirp 900 has 900 samples in p"
    ):
        channels_module._periodic([replace(first, period_samples=300), replace(first, period_samples=100)])


def test_a_drive_of_nothing_rests_at_nothing():
    assert _rounded_bias([SimpleNamespace(drive=np.zeros((8, 2)), period_samples=None)]).tolist() == [0.0, 0.0]


def test_the_loss_of_a_record_without_period_has_its_length():
    error, output = np.array([[1.0], [2.0], [3.0], [4.0]]), np.array([[1.0], [-1.0], [1.0], [-1.0]])
    record = Recording("r", "", output, 2.0 * output, 1.0, ("u",), ("y",))
    np.testing.assert_allclose(held_out_module._loss(error, record), [0.25, 1.0, 2.25, 4.0])
    np.testing.assert_allclose(held_out_module._loss(error, replace(record, period_samples=2)), [1.25, 2.5])


def test_a_mirror_file_has_a_name_and_the_errors_that_there_are(found, hysteretic_records):
    result, _, _ = found
    for name in ("", " "):
        with pytest.raises(IdentificationError, match="the mirror has no name; give one"):
            coupled_file_text(result, hysteretic_records, name)
    assert len(re.findall(r" V rms: .*by output", coupled_file_text(result, hysteretic_records, "a"))) == 2
    own = result.candidate()
    errors = np.where(np.arange(2)[:, None] == 0, np.nan, own.error_rms)
    few = replace(result, candidates=(replace(own, error_rms=errors),))
    (line,) = re.findall(r"at (\S+) V rms: .*by output", coupled_file_text(few, hysteretic_records, "a"))
    assert float(line) == pytest.approx(result.amplitudes_v[1], rel=0.01)


def test_a_candidate_is_found_by_its_name(found):
    result, _, _ = found
    assert result.candidate() is result.candidate(result.chosen)
    assert result.candidate("coupled linear, order 2").name == "coupled linear, order 2"
    with pytest.raises(IdentificationError, match="no model 'order 2' was fitted; there are per axis, order 2 each, "):
        result.candidate("order 2")


def test_a_mirror_file_says_what_it_was_found_from_and_what_is_wrong_with_it():
    model = SimpleNamespace(outputs=[Output("y", "displacement"), Output("z", "displacement")])
    own = SimpleNamespace(
        model=model, parameters=7, error_share=0.0123, error_rms=np.array([[1e-9, 2e-9], [np.nan, np.nan]])
    )
    found = SimpleNamespace(
        candidate=lambda: own,
        chosen="linear",
        held_out=("b.csv",),
        amplitudes_v=np.array([0.1, 0.3]),
        stopped=True,
        reason="the least.",
        warnings=("one", "two"),
        refused=[SimpleNamespace(model="plays", reason="too few")],
    )
    recordings = [SimpleNamespace(path=path, sha256=path[0] * 4) for path in ("a.csv", "b.csv")]
    assert list(coupled_mirror_file._origin(found, recordings)) == [
        "Mirror identified from 2 recording(s), model linear.",
        "  a.csv (fitted)",
        "  sha256 aaaa",
        "  b.csv (held out)",
        "  sha256 bbbb",
        "7 parameters; error on held-out records 1.23 % of the output (rms).",
        "  at 0.1 V rms: 1e-09, 2e-09 m (rms, by output)",
        "The identification was stopped before its end: larger models were not fitted.",
        "Choice: the least.",
        "Warning: one",
        "Warning: two",
        "Not fitted: plays, too few",
    ]
    assert coupled_mirror_file._unit(found) == "m"
    model.outputs = [Output("y", "angle")]
    assert coupled_mirror_file._unit(found) == "rad"


def test_squares_of_records_are_averaged_by_their_amplitude():
    """Squares of 1 and 49 at the first amplitude, 4 and none at the last, and no record at the one between."""
    records = SimpleNamespace(amplitudes_v=np.array([0.1, 0.2, 0.3]), held_class=np.array([0, 2, 0]))
    found = held_out_module._rms_by_amplitude(
        records, [np.array([1.0, 9.0]), np.array([4.0, np.nan]), np.array([49.0, 9.0])]
    )
    np.testing.assert_allclose(found, [[5.0, 3.0], [np.nan, np.nan], [2.0, np.nan]])


@pytest.mark.parametrize(("period", "known"), [(None, False), (0, False), (4, True), (6, True), (7, False)])
def test_the_noise_of_a_period_is_known_from_two_on(period, known):
    """What two periods of 6 samples or three of 4 have apart; a mean that drifts from one to the next is none of it."""
    output = np.column_stack([np.arange(12.0), np.tile([1.0, -1.0], 6)])
    output[:6, 1] += [2.0, -2.0, 0.0, 0.0, 0.0, 0.0]
    record = Recording("r", "", output[:, :1], output, 1.0, ("u",), ("y", "z"), period)
    found = held_out_module._period_scatter(record)
    if not known:
        assert np.isnan(found).all() and found.shape == (2,)
    else:
        assert found[0] == pytest.approx(0.0, abs=1e-15)
        periods = output[: 12 // period * period, 1].reshape(-1, period)
        assert found[1] == pytest.approx(np.mean(np.var(periods - periods.mean(axis=1)[:, None], axis=0, ddof=1)))


# ------------------------------------------------------------------------------------------ numbers unlike each other
def drawn_at_random(name, samples=12, inputs=2, seed=0, period=None, size=1.0, rate_hz=250.0):
    """A record of as many drives and two outputs, every number its own."""
    draw = philox(seed)
    drive, output = size * draw.standard_normal((samples, inputs)), draw.standard_normal((samples, 2))
    inputs, outputs = tuple(f"u{k}" for k in range(inputs)), ("x", "y")
    return Recording(name, name, drive, output, rate_hz, inputs, outputs, period)


def test_actuators_have_the_extremes_of_all_records_that_are_not_for_validation():
    """In mV: the first drive is fastest and lowest in the first record, the second one in the second record."""
    first = np.array([[2000.0, 50.0], [1000.0, 60.0], [4000.0, 40.0], [2000.0, 50.0]])
    second = np.array([[1000.0, 70.0], [1500.0, 10.0], [5000.0, 90.0], [1000.0, 70.0]])
    far = 100.0 * first
    output = np.array([[1.0, 10.0], [2.0, 30.0], [4.0, 20.0], [8.0, 40.0]])
    given = [
        Recording(name, name, drive, output + k, 250.0, ("a", "b"), ("x", "y"))
        for k, (name, drive) in enumerate((("one", first), ("two", second), ("far", far)))
    ]
    found = channels(given[:2], given[2:], "mV", "um", [(1, 2), (3, 4)])
    assert [actuator.name for actuator in found.actuators] == ["a", "b"]
    numbers = [astuple(actuator)[1:] for actuator in found.actuators]
    np.testing.assert_allclose(numbers, [[1.5, 1.0, 5.0, 1000.0], [0.06, 0.01, 0.09, 20.0]], rtol=1e-12)
    assert [(o.name, o.quantity, o.position_m) for o in found.outputs] == [
        ("x", "displacement", (1.0, 2.0)),
        ("y", "displacement", (3.0, 4.0)),
    ]
    assert all(isinstance(v, float) for o in found.outputs for v in o.position_m)
    assert [r.path for r in found.fitted] == ["one", "two"] and [r.path for r in found.held_out] == ["far"]
    np.testing.assert_allclose(found.fitted[1].drive[2], [3.5, 0.03], rtol=1e-12)
    np.testing.assert_allclose(found.held_out[0].output[3], [10e-6, 42e-6], rtol=1e-12)
    assert found.periodic is False and found.rate_hz == 250.0


def test_the_last_record_of_each_amplitude_and_set_of_drives_is_held_out():
    """Small and large ones of both drives, and two of the first drive alone; one of the second drive alone."""
    both, first, second = np.ones(2), np.array([1.0, 0.0]), np.array([0.0, 1.0])
    sizes = [
        1.0 * both,
        1.41421356 * first,
        3.0 * both,
        1.0 * both,
        1.41421356 * second,
        1.41421356 * first,
        3.0 * both,
    ]
    one = drawn_at_random("", 400, seed=3)
    drive = one.drive / one.drive.std(axis=0)
    given = [replace(one, path=f"r{k}", sha256=str(k), drive=size * drive) for k, size in enumerate(sizes)]
    found = channels(given, (), "V", "rad", None)
    assert [r.path for r in found.held_out] == ["r3", "r5", "r6"]
    assert [r.path for r in found.fitted] == ["r0", "r1", "r2", "r4"]
    np.testing.assert_allclose(found.amplitudes_v, [1.0, 3.0], rtol=1e-6)
    assert (found.fitted_class.tolist(), found.held_class.tolist()) == ([0, 0, 1, 0], [0, 0, 1])
    assert [r.path for r in found.of_amplitude(0)] == ["r0", "r1", "r4"]
    assert [r.path for r in found.of_amplitude(1)] == ["r2"]


@pytest.mark.parametrize("periods", [(None, None, 4), (4, 4, None)])
def test_the_third_of_three_records_may_be_the_one_of_another_kind(periods):
    given = [drawn_at_random(f"r{k}", seed=k, period=period) for k, period in enumerate(periods)]
    with pytest.raises(IdentificationError) as caught:
        channels(given, (), "V", "rad", None)
    assert str(caught.value) == (
        "r2: of this record and r0 one is periodic and the other is not; fit records of one kind, and give the others "
        "for validation."
    )
    assert channels(given[:2], given[2:], "V", "rad", None).periodic is (periods[0] == 4)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        (("uV", "rad"), "input unit 'uV' is not known; use one of V, mV."),
        (
            ("mV", "deg"),
            "output unit 'deg' is not known; use an angle (rad, mrad, urad) or a length (m, mm, um).",
        ),
    ],
)
def test_a_unit_of_channels_that_is_not_known_is_told_with_those_that_are(units, message):
    with pytest.raises(IdentificationError) as caught:
        channels([drawn_at_random("r")], [drawn_at_random("s", seed=1)], *units, None)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("unit", "quantity", "size"),
    [
        ("rad", "angle", 1.0),
        ("mrad", "angle", 1e-3),
        ("urad", "angle", 1e-6),
        ("m", "displacement", 1.0),
        ("mm", "displacement", 1e-3),
        ("um", "displacement", 1e-6),
    ],
)
@pytest.mark.parametrize(("volt", "volts"), [("V", 1.0), ("mV", 1e-3)])
def test_each_unit_of_channels_has_its_size(unit, quantity, size, volt, volts):
    assert channels_module._units(volt, unit) == (volts, quantity, size)


def test_records_of_which_none_can_be_held_out_are_told_in_full():
    one = drawn_at_random("r", 400, period=200)
    with pytest.raises(IdentificationError) as caught:
        channels([one, replace(one, drive=2 * one.drive), replace(one, drive=4 * one.drive)], (), "V", "rad", None)
    assert str(caught.value) == (
        "3 records, no two of one amplitude with the same channels driven: none can be held out to judge the models "
        "by; record another realisation, or give recordings for validation."
    )
    three = [drawn_at_random(f"r{k}", 400, 3, seed=k, period=200) for k in range(3)]
    with pytest.raises(IdentificationError) as caught:
        channels(three, (), "V", "rad", None)
    assert str(caught.value) == (
        "3 records for 3 actuators: 1 held out to judge the models by leave 2, and at least 3 realisations with "
        "different drives are needed; record more, or give recordings for validation."
    )


@pytest.mark.parametrize(("largest", "rest"), [(80.0, 1.2345679), (8.0, 1.23456789), (800.0, 1.234568)])
def test_a_bias_is_rounded_to_a_billionth_of_the_largest_drive(largest, rest):
    drive = np.array([[1.234567891], [largest], [1.0]])
    assert _rounded_bias([SimpleNamespace(drive=drive, period_samples=None)]).tolist() == [rest]


def test_a_record_that_does_not_repeat_goes_back_to_rest_behind_its_end():
    """An eighth of its length, as half a cosine; a periodic one has one period before it."""
    given = []

    def response(drive):
        given.append(drive)
        return np.arange(2.0 * len(drive)).reshape(-1, 2)

    model, record = SimpleNamespace(response=response), drawn_at_random("r", 35)
    assert held_out_module.modelled_output(model, record).shape == (35, 2)
    moved = record.drive - record.drive[0]
    fall = [0.5 * (1 + np.cos(np.pi * k / 4)) for k in (1, 2, 3, 4)]
    np.testing.assert_allclose(given[0], [*moved, *np.outer(fall, moved[-1])], atol=1e-15)
    behind = held_out_module.modelled_output(model, replace(record, period_samples=10))
    np.testing.assert_allclose(given[1], [*record.drive[:10], *record.drive])
    assert behind[0].tolist() == [20.0, 21.0] and behind.shape == (35, 2)
    left = held_out_error(model, replace(record, period_samples=10))
    np.testing.assert_allclose(left, (record.output - behind) - (record.output - behind).mean(axis=0), atol=1e-12)


OF_LINES = (3.0, 0.5, 2.0, 1.0), (1.5, 4.0, 0.25, 6.0), (0.75, 1.25, 5.0, 2.5)


def test_errors_of_two_amplitudes_are_kept_apart_and_shares_are_of_each_record():
    """A model that stands still: what is left is the output. The last of three lines is on the last edge."""
    time = np.arange(40) / 20.0
    parts = [np.sin(2 * np.pi * f * time) for f in (1.0, 3.0, 5.0)]
    outputs = [
        np.column_stack([a * parts[0] + b * parts[1] + c * parts[2], d * parts[1] + 7.0]) for a, b, c, d in OF_LINES
    ]
    held = [
        Recording(f"r{k}", "", output, output, 20.0, ("u", "v"), ("x", "y"), 20 if k else None)
        for k, output in enumerate(outputs)
    ]
    every = SimpleNamespace(
        held_out=held, amplitudes_v=np.array([1.0, 2.0]), held_class=np.array([1, 0, 1]), rate_hz=20.0
    )
    still = SimpleNamespace(response=lambda drive: np.zeros((len(drive), 2)))
    found = held_out_module.judge(still, every, np.array([0.5, 2.0, 5.0]))
    squares = np.array([[(a * a + b * b + c * c) / 2, d * d / 2] for a, b, c, d in OF_LINES])
    np.testing.assert_allclose(found.error_rms, np.sqrt([squares[1], (squares[0] + squares[2]) / 2]))
    low = np.array([[a * a / 2, 0.0] for a, *_ in OF_LINES])
    high = squares - low
    expected = [[each[1], (each[0] + each[2]) / 2] for each in (low, high)]
    np.testing.assert_allclose(found.band_error_rms, np.sqrt(expected).swapaxes(0, 1), atol=1e-12)
    np.testing.assert_allclose(found.record_share, np.ones((3, 2)))
    assert [loss.size for loss in found.losses] == [40, 20, 20]
    assert isinstance(found.share, float) and found.share == pytest.approx(1.0)
    np.testing.assert_allclose(held_out_module.output_rms(every), found.error_rms)


def test_the_share_is_the_root_of_the_mean_loss_of_records_of_unlike_length():
    one, other = np.full(3, 4.0), np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    own = held_out_module.Judged(np.ones(1), np.ones(1), np.ones(1), (one, other))
    assert own.share == pytest.approx(np.sqrt((4.0 + 3.0) / 2))


def test_of_models_as_small_the_one_with_the_lower_error_is_taken():
    noise = philox(0).standard_normal(400)
    each = [
        SimpleNamespace(losses=(losses,), share=float(np.sqrt(losses.mean())))
        for losses in (9 * noise**2, (noise + 0.02 * philox(2).standard_normal(400)) ** 2, noise**2, noise**2 + 1e-9)
    ]
    best = int(np.argmin([own.share for own in each]))
    assert smallest_within_noise(each, [1, 5, 5, 9])[1:] == (best, [1, 2, 3])
    assert smallest_within_noise(each, [1, 5, 5, 9])[0] == min((1, 2), key=lambda k: each[k].share)
    assert smallest_within_noise(each, [1, 6, 5, 2])[0] == 3


def modelled(name, share, parameters, kind="coupled linear", order=4, note=""):
    """A candidate and its errors, as far as words are made of them."""
    own = SimpleNamespace(name=name, kind=kind, order=order, parameters=parameters, error_share=share, note=note)
    return own, SimpleNamespace(losses=(np.full(50, share**2),), share=share)


def of_models(*found, **of):
    """A ladder that has found them."""
    given = {"records": None, "response": None, "bands_hz": np.ones(1), "on_model": lambda candidate: None}
    return ladder._Ladder(**given | of, found=list(found))


THREE = (
    modelled("large", 0.31, 40, order=8),
    modelled("best", 0.01234567, 30, order=6),
    modelled("small", 0.0125, 20, "per axis", order=12),
)


def test_the_best_so_far_is_told_in_three_digits_behind_what_is_done():
    told = []
    one = of_models(*THREE, done=3, total=7, left=["coupled linear, order 8"])
    one.on_progress = lambda *args: told.append(args)
    one._iteration(2, 25, "the text of the search")
    best = "; best so far best: 1.23 % of the output on held-out records"
    assert told == [(3, 7, f"coupled linear, order 8, iteration 2 of 25{best}")]
    assert of_models()._so_far() == ""


def test_a_choice_says_in_full_what_it_leaves_and_what_the_best_would():
    one = of_models(*THREE)
    assert one._reason(2, 1, [1, 2]) == (
        "small (20 parameters) leaves 1.25 % of the output on the held-out records; the least, 1.23 % by best with 30 "
        "parameters, is less by no more than two standard errors of the difference, so the smaller model is taken."
    )
    assert one._reason(1, 1, [0, 1]).endswith(
        "less than any other; the models within its noise have no fewer parameters."
    )
    assert one._reason(1, 1, [1]) == (
        "best (30 parameters) leaves 1.23 % of the output on the held-out records, less than any other by more than "
        "its noise."
    )


def test_the_largest_model_is_the_largest_of_its_own_kind():
    small, best = modelled("small", 0.2, 20, "per axis", 12)[0], modelled("best", 0.1, 30, order=6, note="so and so")[0]
    least = "The least error is that of the largest model of its kind that was tried, best: a larger one may have less."
    assert list(of_models((small, None), (best, None))._warnings(small, best)) == [least]
    assert list(of_models((small, None), (best, None))._warnings(best, best)) == ["best: so and so.", least]
    other = modelled("other", 0.3, 40, order=8)[0]
    assert list(of_models((small, None), (best, None), (other, None))._warnings(best, best)) == ["best: so and so."]


def test_where_no_model_is_found_the_first_refusal_is_told_with_its_model():
    one = of_models(records=SimpleNamespace(), refused=[ladder.Refused("a", "why not"), ladder.Refused("b", "other")])
    with pytest.raises(IdentificationError, match=r"^no model could be fitted: a: why not$"):
        one.result(stopped=False)


@pytest.mark.parametrize(("first", "size"), [(1, "0.123"), (0, "4.57")])
def test_the_one_amplitude_of_the_fitted_records_is_told_though_others_are_for_validation(first, size):
    records = SimpleNamespace(
        periodic=True, fitted_class=np.array([first, first]), amplitudes_v=np.array([4.56789, 0.1234567])
    )
    assert of_models(records=records)._no_hysteresis() == (
        f"all fitted records have one amplitude, {size} V rms: hysteresis cannot be told from linear stiffness; add "
        "records of another amplitude, twice as large for example"
    )
    assert of_models(records=replace_in(records, fitted_class=np.array([0, 1])))._no_hysteresis() == ""
    assert of_models(records=replace_in(records, periodic=False))._no_hysteresis() == (
        "it takes multisines of at least two amplitudes in their steady state, and no record is periodic"
    )


def replace_in(given, **changes):
    return SimpleNamespace(**vars(given) | changes)


def test_how_gain_and_resonance_change_is_told_by_the_order_that_is_best_of_the_linear_ones(monkeypatch):
    fits = []
    monkeypatch.setattr(ladder, "fit_linear", lambda group, order, **given: fits.append((group, order, given)) or order)
    monkeypatch.setattr(ladder, "amplitude_dependence", lambda each: ("dependence", each))
    groups = SimpleNamespace(of_amplitude=lambda number: [f"records of {number}"])
    stiff = modelled("stiff", 0.001, 50, "hysteretic stiffness", 10)
    one = of_models(*THREE, stiff, records=groups)
    assert one._dependence(["a", None, "c"]) == ("dependence", [6, 6])
    assert fits == [(["records of 0"], 6, {"exchanges": 0}), (["records of 2"], 6, {"exchanges": 0})]
    assert one._dependence(["a", None, None]) is None
    assert of_models(THREE[2], stiff, records=groups)._dependence(["a", "b"]) is None

    def refused(each):
        raise IdentificationError("no resonance")

    monkeypatch.setattr(ladder, "amplitude_dependence", refused)
    assert one._dependence(["a", "b"]) is None


@pytest.mark.parametrize("orders", [[2, 4, 6, 8], [6, 8, 12]])
def test_hysteresis_begins_at_the_linear_order_that_would_be_chosen_of_those_found(orders):
    """A model of each axis and one with hysteresis that are better still count for nothing."""
    axis, stiff = modelled("axis", 1e-3, 2, "per axis", 2), modelled("stiff", 1e-4, 2, "hysteretic stiffness", 8)
    one = of_models(axis, THREE[0], THREE[1], stiff)
    assert one._best_and_next(orders) == orders[orders.index(6) :][:2]
    assert of_models(axis, stiff)._best_and_next(orders) == orders[:1]


def test_a_candidate_and_the_best_are_found_among_several():
    one = object.__new__(ladder.CoupledIdentification)
    vars(one).update(candidates=tuple(own for own, _ in THREE), chosen="small")
    assert (one.candidate().name, one.candidate("large").name, one.best.name) == ("small", "large", "best")
    with pytest.raises(IdentificationError, match=r"^no model 'tiny' was fitted; there are large, best, small\.$"):
        one.candidate("tiny")


# ------------------------------------------------------------------------------------------------- linear candidates
def real_and_pair():
    """A real pole and two pairs, two drives and three outputs, every number its own."""
    poles = np.array([-70.0 + 0j, -18.0 + 900j, -34.0 + 1700j])
    draw = philox(8)
    b, c = draw.standard_normal((3, 2, 2)), draw.standard_normal((2, 3, 3))
    b, c = b[..., 0] + 1j * b[..., 1], c[0] + 1j * c[1]
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    return ModalModel(poles, b, c, draw.standard_normal((3, 2)))


def test_numbers_of_a_model_are_named_as_in_the_file_and_counted_on_behind_others():
    model = real_and_pair()
    own = linear_errors.names(model, [1], [0, 2], states=3, modes=2)
    assert own == (
        *(f"modes.decay.{k}" for k in (3, 4, 5)),
        *(f"modes.frequency.{k}" for k in (4, 5)),
        *(f"matrices.B.{k}.2" for k in (4, 5, 6, 7, 8)),
        *(f"matrices.C.{o}.{k}" for o in (1, 3) for k in (4, 5, 6, 7, 8)),
        *("matrices.D.1.2", "matrices.D.3.2"),
        "recording.delay",
    )
    both = linear_errors.names(model, [0, 1], [1])
    assert both[5:9] == ("matrices.B.1.1", "matrices.B.1.2", "matrices.B.2.1", "matrices.B.2.2")
    assert both[-3:] == ("matrices.D.2.1", "matrices.D.2.2", "recording.delay")


def test_the_errors_of_real_poles_have_no_imaginary_part_and_those_of_pairs_both():
    moved = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 9.0], [0.0, 1.0, 2.0, 3.0, 12.0, 9.0]])
    found = linear._pole_errors(real_and_pair(), moved)
    np.testing.assert_allclose(found, [1.0, np.sqrt(5) + 5j, np.sqrt(13) + 13j])


def test_what_is_known_of_numbers_leaves_those_out_that_no_record_moves():
    moved = np.array([[3.0, 0.0, 1.0], [4.0, 0.0, -2.0]])
    found = linear_errors.known(("a", "b", "c"), moved)
    assert found.parameters == ("a", "c")
    np.testing.assert_allclose(found.standard_errors, [5.0, np.sqrt(5.0)])
    np.testing.assert_allclose(found.factor, [[0.6, 0.8], np.array([1.0, -2.0]) / np.sqrt(5.0)])


def table_of(response, powers, rate_hz=1000.0):
    """A response (lines, outputs, inputs) at 1 Hz, 2 Hz ... to drives of these powers, with cross terms."""
    lines, outputs, inputs = response.shape
    cross = 0.1 * np.array([[0.0, 1j], [-1j, 0.0]]) if inputs == 2 else np.zeros((inputs, inputs))
    return FrequencyResponse(
        np.arange(1.0, lines + 1.0),
        response,
        np.ones(response.shape),
        None,
        None,
        np.ones((lines, outputs)),
        np.tile(np.diag(powers) + cross, (lines, 1, 1)),
        np.zeros((lines, outputs)),
        np.sqrt(np.asarray(powers)),
        (1.0, float(lines)),
        "made up",
        rate_hz,
        tuple(f"u{k}" for k in range(inputs)),
        tuple(f"y{k}" for k in range(outputs)),
    )


def test_the_drive_that_makes_most_of_an_output_counts_by_its_power():
    gain = np.zeros((5, 3, 2), dtype=complex)
    gain[:] = [[3.0, 1.0], [-2.0j, 1.0], [1.0, 1.0j]]
    assert linear.strongest_drives(table_of(gain, (1.0, 3.9))) == [0, 0, 1]
    assert linear.strongest_drives(table_of(gain, (1.0, 4.1))) == [0, 1, 1]
    gain[4] = [[0.0, 9.0], [0.0, 0.0], [9.0, 0.0]]
    assert linear.strongest_drives(table_of(gain, (1.0, 1.0))) == [1, 0, 0]


def test_the_response_of_one_pair_is_without_the_delay_and_of_its_own_drive():
    gain = philox(5).standard_normal((4, 3, 2)) * np.exp(1j)
    own = linear._of_pair(table_of(gain, (2.0, 5.0)), 2, 1, 0.03)
    ahead = np.exp(2j * np.pi * np.arange(1.0, 5.0) * 0.03)
    np.testing.assert_allclose(own.response, (gain[:, 2, 1] * ahead)[:, None, None])
    np.testing.assert_allclose(own.drive_power, np.full((4, 1, 1), 5.0))
    assert (own.hold, own.rate_hz) == ("first-order", 2000.0)


def test_models_placed_among_other_channels_stand_side_by_side():
    poles, direct = np.array([-3.0 + 0j, -2.0 + 7j]), np.array([[-0.25]])
    one = ModalModel(poles, np.array([[1.5], [1 + 2j]]), np.array([[4.0, 3 - 5j]]), direct)
    other = ModalModel(poles[1:] * 2, np.array([[3 + 1j]]), np.array([[2 + 6j]]), 3 * direct)
    plant = linear.side_by_side([linear._placed(one, (1, 3), (1, 2)), linear._placed(other, (2, 3), (0, 2))])
    assert plant.B.tolist() == [[0.0, 1.5], [0.0, 1.0], [0.0, 2.0], [3.0, 0.0], [1.0, 0.0]]
    assert plant.C.tolist() == [[0.0] * 5, [4.0, 6.0, 10.0, 0.0, 0.0], [0.0, 0.0, 0.0, 4.0, -12.0]]
    assert plant.D.tolist() == [[0.0, 0.0], [0.0, -0.25], [-0.75, 0.0]]
    assert np.sort_complex(np.linalg.eigvals(plant.A)) == pytest.approx(
        np.sort_complex([-3.0, -2 + 7j, -2 - 7j, -4 + 14j, -4 - 14j])
    )
    assert [v.shape for v in (plant.E, plant.F, plant.G, plant.K)] == [(5, 0), (0, 5), (0, 2), (3, 0)]
    assert plant.name == "identified"


def test_spectra_of_lines_are_of_the_mean_period_and_one_sided():
    """Two periods of eight samples and a half: 3 cos at the second line and 5 sin at the third one."""
    turn = 2 * np.pi * np.arange(20) / 8
    own = np.column_stack([3 * np.cos(2 * turn), 5 * np.sin(3 * turn)])
    scattered = own + np.where(np.arange(20) < 8, 0.5, -0.5)[:, None] * np.where(np.arange(20) < 16, 1.0, 99.0)[:, None]
    given = [Recording(f"r{k}", "", k * own, (k + 1) * scattered, 80.0, ("u", "v"), ("x", "y"), 8) for k in (1, 2, 4)]
    response = SimpleNamespace(freq_hz=np.array([20.0, 30.0]))
    found = linear_errors.line_spectra(given, response)
    one = np.array([[3.0, 0.0], [0.0, -5j]]) / np.sqrt(2.0)
    np.testing.assert_allclose(found.drive, [one, 2 * one, 4 * one], atol=1e-12)
    np.testing.assert_allclose(found.output, [2 * one, 3 * one, 5 * one], atol=1e-12)
    assert linear_errors.line_spectra(given[:2], response) is None
    assert linear_errors.line_spectra([*given[:2], replace(given[2], period_samples=None)], response) is None


def test_a_long_response_is_worked_on_in_parts_that_are_it_together():
    parts = [range(1100)[part] for part in linear_errors._parts(1100)]
    assert [len(part) for part in parts] == [512, 512, 76]
    assert [k for part in parts for k in part] == list(range(1100))


def test_a_number_that_the_data_do_not_fix_has_no_part_in_the_inverse():
    normal = np.array([[4.0, 2.0, 0.0], [2.0, 9.0, 0.0], [0.0, 0.0, 0.0]]) * 1e6
    inverse, rank = linear_errors._inverse(normal)
    expected = np.zeros((3, 3))
    expected[:2, :2] = np.array([[9.0, -2.0], [-2.0, 4.0]]) / 32e6
    np.testing.assert_allclose(inverse, expected, atol=1e-20)
    assert rank == 2


def test_the_fit_with_hysteresis_is_handed_on_number_by_number(monkeypatch):
    given = {}
    fit = SimpleNamespace(
        order=6,
        parameters=50,
        redundant=7,
        mirror="mirror",
        delay_s=3e-4,
        poles_rad_s=np.array([-1 + 2j]),
        poles_error_rad_s=np.array([0.5]),
        delay_error_s=4e-6,
        moved=np.array([[2.0, 0.0]]),
        names=("a", "b"),
        converged=False,
        iterations=9,
    )
    monkeypatch.setattr(
        hysteretic, "fit_hysteretic_stiffness", lambda records, **own: given.update(own, records=records) or fit
    )
    found = hysteretic.hysteretic_stiffness("records", SimpleNamespace(modes="modes", delay_s=2e-4), "progress")
    assert (found.name, found.kind, found.order) == ("hysteretic stiffness, order 6", "hysteretic stiffness", 6)
    assert (found.parameters, found.mirror, found.delay_s, found.delay_error_s) == (43, "mirror", 3e-4, 4e-6)
    assert (found.poles_rad_s.tolist(), found.poles_error_rad_s.tolist()) == ([-1 + 2j], [0.5 + 0j])
    assert (found.known.parameters, found.known.standard_errors.tolist()) == (("a",), [2.0])
    assert found.note == "the search was ended before its optimum, after 9 steps on all records"
    assert (given["records"], given["on_progress"], given["iterations"]) == ("records", "progress", 10)
    assert given["start"] == ("modes", 2e-4)
    assert (given["options"].sub_steps, given["options"].few_first) == (2, 15)
    fit.moved = None
    assert hysteretic.hysteretic_stiffness("records", SimpleNamespace(modes=1, delay_s=0.0), None).known is None


def test_a_mirror_file_of_angles_that_was_not_stopped_says_so_for_each_amplitude():
    own = SimpleNamespace(
        model=SimpleNamespace(outputs=[Output("y", "angle")]),
        parameters=11,
        error_share=0.2,
        error_rms=np.array([[1e-9, np.nan], [2.34567e-6, 3e-6]]),
    )
    found = SimpleNamespace(
        candidate=lambda: own,
        chosen="m",
        held_out=(),
        amplitudes_v=np.array([0.123456, 3.0]),
        stopped=False,
        reason="it is so.",
        warnings=(),
        refused=[SimpleNamespace(model=k, reason=f"no {k}") for k in "ab"],
    )
    assert list(coupled_mirror_file._origin(found, [])) == [
        "Mirror identified from 0 recording(s), model m.",
        "11 parameters; error on held-out records 20 % of the output (rms).",
        "  at 0.123 V rms: 1e-09, nan rad (rms, by output)",
        "  at 3 V rms: 2.35e-06, 3e-06 rad (rms, by output)",
        "Choice: it is so.",
        "Not fitted: a, no a",
        "Not fitted: b, no b",
    ]


def test_a_model_is_judged_kept_and_told_or_refused_under_its_own_name():
    """The next of two that are left: its fields go from the fit, the records and the response into the candidate."""
    told, heard = [], []
    actuators = tuple(coupled.Actuator(f"u{k}", 0.0, -5.0, 5.0, 1e9) for k in range(2))
    held = drawn_at_random("r", 64)
    records = SimpleNamespace(
        actuators=actuators,
        outputs=(Output("x", "angle"), Output("y", "angle")),
        rate_hz=250.0,
        held_out=[held],
        held_class=np.array([1]),
        amplitudes_v=np.array([0.5, 1.0]),
    )
    one = of_models(
        records=records,
        response=SimpleNamespace(excited_hz=(3.0, 90.0)),
        bands_hz=np.array([3.0, 20.0, 90.0]),
        on_model=heard.append,
        left=["first", "second", "third"],
        total=3,
    )
    one.on_progress = lambda *args: told.append(args)
    poles = np.array([-40.0 + 0j])
    plant = linear.side_by_side([ModalModel(poles, np.ones((1, 2)) + 0j, np.ones((2, 1)) + 0j, np.zeros((2, 2)))])
    fitted = linear.Fitted(
        "own name", "per axis", 1, 17, plant, 2e-3, poles, np.array([0.5 + 0j]), 3e-5, None, note="of note"
    )
    one._judge(lambda: fitted)
    (candidate,) = one.candidates
    assert heard == [candidate] and one.fits == {"first": fitted} and one.left == ["second", "third"]
    kept = ("name", "kind", "order", "parameters", "poles_rad_s", "poles_error_rad_s", "delay_error_s", "note")
    assert all(getattr(candidate, field) is getattr(fitted, field) for field in kept)
    model = candidate.model
    assert (model.mirror, model.actuators, model.outputs) == (plant, actuators, records.outputs)
    assert (model.delay_s, model.rate_hz, model.steps_per_sample) == (2e-3, 250.0, 2)
    assert model.excited_hz == (3.0, 90.0) and model.known is None
    judged = held_out_module.judge(model, records, one.bands_hz)
    np.testing.assert_allclose(candidate.error_rms, judged.error_rms)
    np.testing.assert_allclose(candidate.band_error_rms, judged.band_error_rms)
    np.testing.assert_allclose(candidate.record_share, judged.record_share)
    assert candidate.error_share == judged.share and np.isnan(candidate.error_rms[0]).all()

    def refused():
        raise IdentificationError("it cannot be.")

    one._judge(refused)
    assert (one.refused, one.done) == ([ladder.Refused("second", "it cannot be.")], 2) and one.left == ["third"]
    one._judge(lambda: replace(fitted, name="runs", mirror=replace(plant, A=-900.0 * plant.A)))
    assert one.refused[1:] == [ladder.Refused("runs", "it runs away on a held-out record")]
    assert [what.split(";")[0] for *_, what in told] == ["first", "second", "third"] and len(heard) == 1
    assert [args[:2] for args in told] == [(0, 3), (1, 3), (2, 3)]


@pytest.mark.parametrize("stopped", [False, True])
def test_a_result_has_what_each_amplitude_shows_and_what_the_chosen_model_makes_of_it(monkeypatch, stopped):
    """Of three amplitudes the middle one has no response of its own."""

    def responded(records, periodic):
        if records[0].path == "b":
            raise IdentificationError("too few")
        names = [r.path for r in records]
        return SimpleNamespace(response=("response", *names, float(records[0].output[0, 0]), periodic))

    monkeypatch.setattr(ladder, "_response", responded)
    monkeypatch.setattr(ladder, "modelled_output", lambda model, record: np.full((64, 2), model))
    monkeypatch.setattr(ladder._Ladder, "_dependence", lambda self, responses: len(responses))
    fitted = tuple(drawn_at_random(name, 64, seed=k) for k, name in enumerate("abcd"))
    held = tuple(drawn_at_random(name, 64, seed=9 + k) for k, name in enumerate("vw"))
    records = channels_module.Channels(
        fitted, held, np.array([1.0, 2.0, 4.0]), np.array([0, 1, 2, 2]), np.array([0, 2]), (), (), True
    )
    models = [(SimpleNamespace(**vars(own), model=float(k)), judged) for k, (own, judged) in enumerate(THREE)]
    one = of_models(*models, records=records, refused=[ladder.Refused("other", "why")])
    found = one.result(stopped)
    assert (found.chosen, found.within_noise, found.best.name) == ("best", ("best",), "best")
    assert [own.name for own in found.candidates] == ["large", "best", "small"]
    assert found.responses[0].response == ("response", "a", fitted[0].output[0, 0], True)
    assert found.responses[1] is None and found.responses[2].response[:3] == ("response", "c", "d")
    assert found.modelled == (("response", "a", 1.0, True), None, ("response", "c", "d", 1.0, True))
    assert found.dependence == (None if stopped else 3) and found.stopped is stopped
    assert (found.fitted, found.held_out) == (("a", "b", "c", "d"), ("v", "w"))
    assert found.refused == (ladder.Refused("other", "why"),) and found.bands_hz is one.bands_hz
    np.testing.assert_allclose(found.output_rms[[0, 2]], [r.output.std(axis=0) for r in held])
    assert np.isnan(found.output_rms[1]).all() and np.isnan(found.noise_rms).all()


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ((400, 100), (400, 200), "400 samples in periods of 200, where a has 400 samples in periods of 100"),
        ((400, 100), (300, 100), "300 samples in periods of 100, where a has 400 samples in periods of 100"),
        ((400, None), (399, None), "399 samples, where a has 400 samples"),
        ((400, 100), (400, None), None),
        ((400, None), (400, 100), None),
    ],
)
def test_records_of_other_lengths_and_kinds_are_told_by_both_their_names(first, second, told):
    one, other = (drawn_at_random(n, s, period=p) for n, (s, p) in (("a", first), ("b", second)))
    with pytest.raises(IdentificationError) as caught:
        channels_module._periodic([one, replace(one, path="same"), other])
    assert str(caught.value) == (
        f"b: {told}; cut all records to one length and period."
        if told
        else "b: of this record and a one is periodic and the other is not; fit records of one kind, and give the "
        "others for validation."
    )


@pytest.mark.parametrize(
    ("records", "inputs", "period", "told"),
    [
        (3, 3, 32, "3 records for 3 actuators: 1 held out to judge the models by leave 2, and at least 3 realisations"),
        (2, 2, 16, "2 records for 2 actuators: 1 held out to judge the models by leave 1, and at least 2 realisations"),
        (3, 3, None, ""),
        (4, 3, 32, ""),
        (1, 1, 32, "1 records, no two of one amplitude with the same channels driven: none can be held out to judge"),
    ],
)
def test_what_is_held_out_leaves_as_many_realisations_as_actuators(records, inputs, period, told):
    given = [drawn_at_random(f"r{k}", 64, inputs, seed=k, period=period) for k in range(records)]
    if told:
        with pytest.raises(IdentificationError) as caught:
            channels_module._held_out(given, np.zeros(records, dtype=int))
        assert str(caught.value).startswith(told)
        assert str(caught.value).endswith(", or give recordings for validation.")
    else:
        assert channels_module._held_out(given, np.zeros(records, dtype=int)).tolist() == [records - 1]


@pytest.mark.parametrize(
    ("line", "band"), [(1, None), (2, 0), (3, 0), (4, 1), (9, 1), (10, 2), (16, 2), (17, None), (0, None)]
)
def test_a_line_of_an_error_belongs_to_the_band_that_begins_at_it_or_to_the_last(line, band):
    """64 samples at 128 Hz: the bands are 4, 8, 20 and 32 Hz, of lines 2, 4, 10 and 16."""
    turn = 2 * np.pi * line * np.arange(64) / 64
    error = np.column_stack([3.0 * np.cos(turn), 5.0 * np.sin(turn + 0.4), np.zeros(64)])
    found = held_out_module._band_power(error, 128.0, np.array([4.0, 8.0, 20.0, 32.0]))
    expected = np.zeros((3, 3))
    if band is not None:
        expected[band, :2] = 4.5, 12.5
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_each_output_is_fitted_from_the_drive_that_makes_most_of_it():
    """The first output follows the second drive by a pair of poles, and the other way round."""
    poles = (np.array([-20.0 + 200j]), np.array([-35.0 + 420j]))
    gain = np.zeros((80, 2, 2), dtype=complex)
    freq = np.arange(1.0, 81.0)
    for (o, i), pole in zip(((0, 1), (1, 0)), poles, strict=True):
        one = ModalModel(pole, np.array([[2.0 + 0j]]), np.array([[30.0 - 5j]]), np.zeros((1, 1)))
        gain[:, o, i] = one.response(freq, "first-order", 2000.0)[:, 0, 0]
    fitted = linear.per_axis(table_of(gain, (1.0, 3.0)), 2, 0.0, None)
    assert (fitted.name, fitted.kind, fitted.order, fitted.parameters) == ("per axis, order 2 each", "per axis", 4, 11)
    np.testing.assert_allclose(fitted.poles_rad_s, np.concatenate(poles), rtol=1e-6)
    plant = fitted.mirror
    assert (plant.B[:2, 0].any(), plant.B[2:, 1].any()) == (False, False)
    assert (plant.C[0, 2:].any(), plant.C[1, :2].any()) == (False, False)
    np.testing.assert_allclose(plant.D, 0.0, atol=1e-6)
    seen = np.array([plant.C @ np.linalg.solve(2j * np.pi * f * np.eye(4) - plant.A, plant.B) for f in (3.0, 60.0)])
    exact = [
        [[0.0, m.response(np.array([f]))[0, 0, 0]], [n.response(np.array([f]))[0, 0, 0], 0.0]]
        for m, n in [
            tuple(ModalModel(p, np.array([[2.0 + 0j]]), np.array([[30.0 - 5j]]), np.zeros((1, 1))) for p in poles)
        ]
        for f in (3.0, 60.0)
    ]
    np.testing.assert_allclose(seen, exact, rtol=1e-5, atol=1e-9)
    assert np.isnan(fitted.delay_error_s) and fitted.delay_s == 0.0 and fitted.modes is None and fitted.note == ""
    assert {name for name in fitted.known.parameters if ".B." in name} <= {
        *("matrices.B.1.2", "matrices.B.2.2", "matrices.B.3.1", "matrices.B.4.1")
    }


@pytest.mark.parametrize(
    ("positions", "told"),
    [
        ([(1.0, 2.0)], "1 position for 2 outputs (x, y); give one for each."),
        ([(1.0, 2.0), (1.0,)], "the position of the output 'y' is (1.0,); give x and y in m."),
        ([(1.0, 2.0), 3.0], "the position of the output 'y' is 3.0; give x and y in m."),
        ([(float("nan"), 2.0), (1.0, 2.0)], "the position of the output 'x' is (nan, 2.0); give x and y in m."),
        ([(1.0, 2.0)] * 3, "3 positions for 2 outputs (x, y); give one for each."),
        ([], "0 positions for 2 outputs (x, y); give one for each."),
        (None, None),
        ([(1, -2), (0.5, 4)], [(1.0, -2.0), (0.5, 4.0)]),
    ],
)
@pytest.mark.parametrize("quantity", ["displacement", "angle"])
def test_outputs_have_as_many_positions_or_none(positions, told, quantity):
    record = drawn_at_random("r")
    if isinstance(told, str):
        with pytest.raises(IdentificationError) as caught:
            channels_module._outputs(record, quantity, positions)
        assert str(caught.value) == told
    else:
        found = channels_module._outputs(record, quantity, positions)
        expected = told or [None, None]
        assert found == tuple(Output(name, quantity, place) for name, place in zip("xy", expected, strict=True))


def test_what_is_known_of_each_output_is_what_its_own_drive_and_records_say():
    """Three outputs of two drives: each with its strongest drive as if these two were alone."""
    draw = philox(5).standard_normal
    freq = np.arange(1.0, 61.0)
    gain = 0.01 * (draw((60, 3, 2)) + 1j * draw((60, 3, 2)))
    pairs = ((0, 1), (1, 0), (2, 1))
    for k, (o, i) in enumerate(pairs):
        one = ModalModel(
            np.array([-20.0 + 90j * (k + 1)]), np.array([[2.0 + 0j]]), np.array([[30.0 - 5j]]), np.zeros((1, 1))
        )
        gain[:, o, i] += one.response(freq, "first-order", 2000.0)[:, 0, 0]
    table = table_of(gain, (1.0, 3.0))
    drive, output = (draw((5, 60, n)) + 1j * draw((5, 60, n)) for n in (2, 3))
    fitted = linear.per_axis(table, 2, 1e-4, linear_errors.LineSpectra(drive, output))
    alone = []
    for o, i in pairs:
        own = replace(
            table, response=gain[:, o : o + 1, i : i + 1], drive_power=table.drive_power[:, i:, i:][:, :1, :1]
        )
        spectra = linear_errors.LineSpectra(drive[:, :, i : i + 1], output[:, :, o : o + 1])
        alone.append(linear.per_axis(own, 2, 1e-4, spectra))
    np.testing.assert_allclose(
        fitted.known.standard_errors, np.concatenate([a.known.standard_errors for a in alone]), rtol=1e-5
    )
    factor = np.vstack([a.known.factor for a in alone])
    np.testing.assert_allclose(fitted.known.correlation, factor @ factor.T, atol=1e-5)
    np.testing.assert_allclose(
        fitted.poles_error_rad_s, np.concatenate([a.poles_error_rad_s for a in alone]), rtol=1e-5
    )
    names = [name for name in fitted.known.parameters if ".D." in name or "decay" in name]
    assert names == [
        name for k, (o, i) in enumerate(pairs, 1) for name in (f"modes.decay.{k}", f"matrices.D.{o + 1}.{i + 1}")
    ]


def test_recordings_for_validation_are_checked_with_the_others_and_wiring_by_those_that_are_fitted(monkeypatch):
    """The second of two for validation moves farther than a mirror can; the third recording is held out."""
    asked = []
    monkeypatch.setattr(ladder, "check_travel", lambda *args, **words: asked.append((args, words)))
    monkeypatch.setattr(ladder, "check_together", lambda *args: asked.append(args))

    class WiredError(Exception):
        pass

    def wired(*args):
        raise WiredError(*args)

    monkeypatch.setattr(ladder, "check_wiring", wired)
    names = "abcvw"
    given = [drawn_at_random(name, 128, seed=k, period=32) for k, name in enumerate(names)]
    words = {"drive_unit": "mV", "output_unit": "um", "positions_m": ((0.0, 0.01), (0.02, 0.0))}
    signs = ((1, 0), (0, -1))
    for validation in ((), given[3:]):
        asked.clear()
        with pytest.raises(WiredError) as caught:
            identify_coupled(given[:3], validation=validation, signs=signs, **words)
        (travelled, of), together = asked
        assert [r.path for r in travelled[0]] == list("abc" if not validation else names)
        assert travelled[1:] == ("um",) and of == {"positions_m": words["positions_m"]}
        assert together == (given[:3], validation)
        path, response, outputs, told = caught.value.args
        fitted = given[: 3 if validation else 2]
        assert (path, told) == ("a", signs)
        assert [output.position_m for output in outputs] == [(0.0, 0.01), (0.02, 0.0)]
        expected = response_from_periods(fitted).response * 1e-6 / 1e-3
        np.testing.assert_allclose(response.response, expected)


def test_recordings_for_validation_have_the_rate_and_the_channels_of_the_others():
    fitted = [drawn_at_random(name, 128, seed=k, period=32) for k, name in enumerate("abc")]
    for other, words in (
        (replace(fitted[0], path="v", rate_hz=77.0), "v: the sample rate is 77 Hz and that of a "),
        (replace(fitted[0], path="v", output=fitted[0].output[:, :1]), "v: 2 inputs and 1 output, where a has 2 and 2"),
    ):
        with pytest.raises(IdentificationError) as refused:
            channels(fitted, [fitted[1], other], "V", "m", None)
        assert str(refused.value).startswith(words)


@pytest.mark.parametrize(
    ("steps", "delays", "error"),
    [
        # half a sample at most a quarter at a time, either way, and none below 0; three tenths of an error end it
        ([(5e-4, 1e-5), (-5e-4, 1e-5), (-2e-4, 1e-5), (2.9e-6, 1e-5)], [1e-4, 3.5e-4, 1e-4, 0.0], 1e-5),
        ([(3.1e-6, 1e-5), (-2.9e-6, 1e-5)], [1e-4, 1.031e-4], 1e-5),
        ([(0.0, 4e-6)], [1e-4], 4e-6),
        ([(1e-5, 1e-6 * k) for k in range(1, 10)], [1e-4 + 1e-5 * k for k in range(9)], 9e-6),  # eight rounds
    ],
)
def test_the_delay_of_a_linear_model_goes_on_by_its_own_steps_until_these_are_small(monkeypatch, steps, delays, error):
    model = ModalModel(np.array([-20.0 + 90j]), np.ones((1, 1)) + 0j, np.ones((1, 1)) + 0j, np.ones((1, 1)))
    asked, models, left = [], [], list(steps)

    def behind(response, delay_s, step_count):
        asked.append(delay_s)
        return response, delay_s

    def spread(given, response, delay_s, spectra):
        step, size = left.pop(0)
        models.append((given, response[1], delay_s, spectra))
        return linear_errors.Spread(np.append(np.ones(7), size)[None, :], np.append(np.full(7, 9.0), step))

    kept = replace(model)
    monkeypatch.setattr(linear, "without_delay", behind)
    monkeypatch.setattr(linear, "fit_order", lambda response, order, exchanges: SimpleNamespace(model=model))
    monkeypatch.setattr(linear, "_equations", lambda response: response)
    monkeypatch.setattr(linear, "polish", lambda equations, given, iterations: SimpleNamespace(model=kept))
    monkeypatch.setattr(linear, "spread", spread)
    found = linear.coupled_linear(table_of(np.ones((9, 1, 1)) + 0j, (1.0,)), 2, 1e-4, 5, "spectra")
    assert asked == pytest.approx(delays, abs=1e-12) and left == []
    assert [given is (model if k == 0 else kept) for k, (given, *_) in enumerate(models)] == [True] * len(delays)
    for (_, response_s, delay_s, spectra), expected in zip(models, delays, strict=True):
        assert response_s == delay_s == pytest.approx(expected, abs=1e-12) and spectra == "spectra"
    assert found.delay_s == pytest.approx(delays[-1], abs=1e-12) and found.delay_error_s == pytest.approx(error)
    assert found.modes is models[-1][0] and (found.order, found.parameters) == (2, 6)
    assert found.poles_error_rad_s.tolist() == [1 + 1j] and found.known.parameters[-1] == "recording.delay"


@pytest.mark.parametrize(
    ("classes", "driven", "inputs", "held", "left"),
    [
        ([0, 0, 1, 2], None, 3, [1], 3),
        ([1, 0, 1, 0, 1], None, 3, [3, 4], 3),
        ([0, 0, 1, 2], None, 4, [1], None),
        ([1, 0, 1, 0, 1], None, 4, [3, 4], None),
        ([0, 0, 0, 0, 0], [0, 1, 2, 1, 0], 3, [3, 4], 3),
    ],
)
def test_what_is_left_counts_those_held_out_and_not_the_kinds_that_have_one_record(classes, driven, inputs, held, left):
    """Kinds are amplitudes, or sets of driven channels; of each with two records or more the last one is held out."""
    given = [drawn_at_random(f"r{k}", 64, inputs, seed=k, period=32) for k in range(len(classes))]
    if driven:
        alone = [np.arange(inputs) == channel for channel in driven]
        given = [replace(r, drive=r.drive * own) for r, own in zip(given, alone, strict=True)]
    if left is None:
        with pytest.raises(IdentificationError) as caught:
            channels_module._held_out(given, np.array(classes))
        assert str(caught.value) == (
            f"{len(classes)} records for {inputs} actuators: {len(held)} held out to judge the models by leave "
            f"{len(classes) - len(held)}, and at least {inputs} realisations with different drives are needed; record "
            "more, or give recordings for validation."
        )
    else:
        assert channels_module._held_out(given, np.array(classes)).tolist() == held
        assert len(classes) - len(held) == left


@pytest.mark.parametrize("size", [1e-2, 1.0, 500.0])
def test_a_channel_is_driven_from_a_thousandth_of_the_power_of_the_strongest_on_however_small_that_is(size):
    """The first drive alone, with 3 % of it on the second one, and with 4 %; and the second drive alone."""
    one = drawn_at_random("r", 64, period=32)
    drive = one.drive / one.drive.std(axis=0)
    parts = ((1.0, 0.0), (0.0, 1.0), (1.0, 0.03), (1.0, 0.04))
    given = [replace(one, drive=size * drive * part) for part in parts]
    assert channels_module._held_out(given, np.zeros(4, dtype=int)).tolist() == [2]
    assert channels_module._held_out([*given, given[3], given[1]], np.zeros(6, dtype=int)).tolist() == [2, 4, 5]


def test_a_bias_of_drives_below_nothing_is_rounded_by_the_largest_of_all_records():
    drives = ([[-1.234567891], [-8.0], [-2.0]], [[-1.234567891], [-3.0], [-80.0]])
    records = [SimpleNamespace(drive=np.array(drive), period_samples=None) for drive in drives]
    assert _rounded_bias(records).tolist() == [-1.2345679]
    assert _rounded_bias(records[:1]).tolist() == [-1.23456789]


def test_each_output_counts_by_its_own_size_in_the_loss_of_a_record():
    output = np.array([[1.0, 10.0], [-1.0, -10.0], [1.0, -10.0], [-1.0, 10.0]])
    error = np.array([[1.0, 0.0], [0.0, 10.0], [2.0, 10.0], [0.0, 0.0]])
    record = Recording("r", "", output, output, 1.0, ("u", "v"), ("x", "y"))
    np.testing.assert_allclose(held_out_module._loss(error, record), [0.5, 0.5, 2.5, 0.0])
    np.testing.assert_allclose(held_out_module._loss(error, replace(record, period_samples=2)), [1.5, 0.25])


@pytest.mark.parametrize("start", [None, SimpleNamespace(modes=None, delay_s=1e-3)])
def test_hysteresis_does_not_begin_without_modes(start):
    with pytest.raises(IdentificationError) as refused:
        hysteretic.hysteretic_stiffness([], start, lambda *given: None)
    assert str(refused.value) == "there is no coupled linear model of this order to begin with."


def test_numbers_of_one_output_of_two_drives_are_counted(monkeypatch):
    """Per axis poles, vectors and direct term of one drive; coupled a gain and a direct term of each."""
    freq = np.arange(1.0, 81.0)
    one = ModalModel(np.array([-20.0 + 200j]), np.array([[2.0 + 0j]]), np.array([[30.0 - 5j]]), np.zeros((1, 1)))
    gain = np.zeros((80, 1, 2), dtype=complex)
    gain[:, 0, 1] = one.response(freq, "first-order", 2000.0)[:, 0, 0]
    fitted = linear.per_axis(table_of(gain, (1.0, 3.0)), 2, 0.0, None)
    assert (fitted.order, fitted.parameters, fitted.mirror.B.shape, fitted.mirror.C.shape) == (2, 6, (2, 2), (1, 2))
    model = ModalModel(np.array([-20.0 + 90j]), np.ones((1, 2)) + 0j, np.ones((1, 1)) + 0j, np.ones((1, 2)))
    monkeypatch.setattr(linear, "without_delay", lambda response, delay_s, steps: response)
    monkeypatch.setattr(linear, "fit_order", lambda response, order, exchanges: SimpleNamespace(model=model))
    moved = linear_errors.Spread(np.ones((1, 11)), np.zeros(11))
    monkeypatch.setattr(linear, "spread", lambda *given: moved)
    found = linear.coupled_linear(table_of(gain, (1.0, 3.0)), 2, 1e-4, 5, None)
    assert (found.name, found.order, found.parameters) == ("coupled linear, order 2", 2, 9)
    assert {"matrices.B.2.2", "matrices.C.1.2", "matrices.D.1.2"} < set(found.known.parameters)
    assert len(found.known.parameters) == 11


def test_a_drive_makes_as_much_of_an_output_as_it_has_power_where_the_output_answers():
    gain = np.array([[[9.0, 1.0], [1.0, 3.0]], [[0.0, 2.0], [4.0j, 0.0]]], dtype=complex)
    power = np.array([np.diag([0.01, 1.0]), np.diag([8.0, 1.0])]) + 0j
    table = replace(table_of(gain, (1.0, 1.0)), drive_power=power)
    assert linear.strongest_drives(table) == [1, 0]
    assert linear.strongest_drives(replace(table, drive_power=power[::-1])) == [0, 1]


def test_each_model_with_stiffness_begins_at_the_linear_one_of_its_own_order(monkeypatch):
    _, one, given, _ = climbed(monkeypatch, LadderOptions((2,), (6, 4, 2, 8)))
    assert [each[:2] for each in given[5:]] == [
        ("hysteretic_stiffness", one.fits[f"coupled linear, order {n}"]) for n in (4, 6)
    ]
