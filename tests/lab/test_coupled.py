"""The ladder for several channels: what it chooses, what it hands on bit for bit, how it stops, what it refuses."""

import re
from dataclasses import replace
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
from microrad.lab.identify.linear.response import response_from_periods
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
    with pytest.raises(IdentificationError, match=r"1 positions for 2 outputs \(x, y\)"):
        identify_coupled(hysteretic_records, output_unit="m", positions_m=[(0.0, 1.0)])
    with pytest.raises(IdentificationError, match=r"2 records for 2 actuators: 1 held out .* leave 1, and at least 2"):
        identify_coupled(hysteretic_records[:2], output_unit="rad")


# ------------------------------------------------------------------------------------------------------------- CubeSpec
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
