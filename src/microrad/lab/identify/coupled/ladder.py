"""The ladder of models for several channels: fitted from small to large, judged on held-out records, one chosen."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.progress import Progress
from microrad.lab.identify.coupled.channels import Channels, channels
from microrad.lab.identify.coupled.held_out import (
    BANDS,
    Judged,
    judge,
    modelled_output,
    noise_rms,
    output_rms,
    smallest_within_noise,
)
from microrad.lab.identify.coupled.hysteretic import hysteretic_stiffness
from microrad.lab.identify.coupled.linear import STEPS, Fitted, coupled_linear, per_axis
from microrad.lab.identify.coupled.linear_errors import line_spectra
from microrad.lab.identify.coupled.records import Candidate, CoupledIdentification
from microrad.lab.identify.coupled.wiring import check_wiring
from microrad.lab.identify.linear.amplitude import AmplitudeDependence, amplitude_dependence
from microrad.lab.identify.linear.fit import fit_linear
from microrad.lab.identify.linear.response import FrequencyResponse, response_from_periods, response_from_records
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.selection.candidates import Refused
from microrad.lab.identify.stiffness.model import best_delay
from microrad.lab.identify.travel import check_travel
from microrad.lab.recording import Recording, check_together
from microrad.mirror.coupled import CoupledMirror

AXIS_ORDERS = (2, 4)
LINEAR_ORDERS = (4, 8, 12, 16, 20, 24, 28, 36)
_EXCHANGES = 12
_STIFFNESS_ORDERS = 2


@dataclass(frozen=True, slots=True)
class LadderOptions:
    """The orders of the models that are fitted: states of each output, and states of all outputs together.

    Hysteretic stiffness begins with the linear model of its order, which is fitted, too; without orders of its own it
    takes the order that serves best without hysteresis, and the next one in ``linear_orders``.
    """

    axis_orders: tuple[int, ...] = AXIS_ORDERS
    linear_orders: tuple[int, ...] = LINEAR_ORDERS
    stiffness_orders: tuple[int, ...] | None = None


def identify_coupled(  # noqa: PLR0913  all but the first are named options
    recordings: Sequence[Recording],
    *,
    validation: Sequence[Recording] = (),
    drive_unit: str = "V",
    output_unit: str = "m",
    positions_m: Sequence[tuple[float, float]] | None = None,
    signs: Sequence[Sequence[int]] | None = None,
    options: LadderOptions = LadderOptions(),
    on_progress: Progress | None = None,
    on_model: Callable[[Candidate], None] = lambda candidate: None,
) -> CoupledIdentification:
    """Fit a ladder of models to recordings of several channels, and choose the smallest one within noise of the best.

    Args:
        recordings: Multisines (periodic, realisations) or chirps and loops (not periodic), of one rate and length, with
            the same channels. One realisation of each amplitude is held out where nothing is given for validation.
        validation: Recordings that no fit sees; they judge the models.
        drive_unit: Unit of all drives: V or mV.
        output_unit: Unit of all outputs: rad, mrad, urad, m, mm or um.
        positions_m: Where each output is measured on the mirror, (x, y) in m; None where that is not known.
        signs: The way that each output moves with each drive at low frequency, shape (outputs, inputs): 1, -1, or 0
            where nothing is said. With them, and with four positions, swapped channels and reversed sensors are seen.
        options: The orders of the models.
        on_progress: Called with the models done, their number, and the best one so far in words.
        on_model: Given each candidate as soon as it is judged.

    Raises:
        RecordingError: For a drive that moves in no recording, or only as others do, and an output that follows none.
        IdentificationError: For recordings that do not belong together, that excite not all channels independently, or
            of which nothing can be held out; for a drive that moves nothing, an output that moves farther than a mirror
            can, and channels that are not wired as signs or positions say.
    """
    check_travel([*recordings, *validation], output_unit, positions_m=positions_m)
    records = channels(recordings, validation, drive_unit, output_unit, positions_m)
    check_together(recordings, validation)
    response = _response(records.fitted, records.periodic)
    check_wiring(records.fitted[0].path, response, records.outputs, signs)
    low, high = response.excited_hz
    ladder = _Ladder(records, response, np.geomspace(low, high, BANDS + 1), on_model)
    stopped = False
    try:
        ladder.climb(options, on_progress or no_progress)
    except KeyboardInterrupt:
        if not ladder.candidates:
            raise
        stopped = True
    return ladder.result(stopped)


def _response(records: Sequence[Recording], periodic: bool) -> FrequencyResponse:
    return response_from_periods(records) if periodic else response_from_records(records)


@dataclass(eq=False)
class _Ladder:
    """The candidates so far, and what they are fitted to and judged by."""

    records: Channels
    response: FrequencyResponse
    bands_hz: Floats
    on_model: Callable[[Candidate], None]
    found: list[tuple[Candidate, Judged]] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    fits: dict[str, Fitted] = field(default_factory=dict)
    left: list[str] = field(default_factory=list)
    done: int = 0
    total: int = 0
    on_progress: Progress = no_progress

    @property
    def candidates(self) -> list[Candidate]:
        """Those that could be judged."""
        return [candidate for candidate, _ in self.found]

    def climb(self, options: LadderOptions, on_progress: Progress) -> None:
        """Fit and judge all models, from small to large."""
        most, reason = self.response.freq_hz.size - 1, self._no_hysteresis()
        given = () if reason else options.stiffness_orders or ()
        linear = [n for n in sorted({*options.linear_orders, *given}) if n <= most] or [most]
        self.left = [
            *(f"per axis, order {n} each" for n in options.axis_orders),
            *(f"coupled linear, order {n}" for n in linear),
        ]
        few = 0 if reason else min(_STIFFNESS_ORDERS, len(linear))
        self.total, self.on_progress = len(self.left) + (len(given) or few), on_progress
        self._report("delay")
        delay_s = best_delay(self.response, max(linear), STEPS)
        spectra = line_spectra(self.records.fitted, self.response)
        for n in options.axis_orders:
            self._judge(partial(per_axis, self.response, n, delay_s, spectra))
        for n in linear:
            self._judge(partial(coupled_linear, self.response, n, delay_s, _EXCHANGES, spectra))
            delay_s = self.fits[name].delay_s if (name := f"coupled linear, order {n}") in self.fits else delay_s
        if reason:
            self.refused.append(Refused("hysteretic stiffness", reason))
            stiff: list[int] = []
        else:
            stiff = [n for n in given if n <= most] or self._best_and_next(linear)
        self.left, self.total = [f"hysteretic stiffness, order {n}" for n in stiff], self.done + len(stiff)
        for n in stiff:
            start = self.fits.get(f"coupled linear, order {n}")
            self._judge(partial(hysteretic_stiffness, self.records.fitted, start, self._iteration))
        self._report("done")

    def _no_hysteresis(self) -> str:
        """Why the records cannot tell hysteresis from linear stiffness; nothing where they can."""
        if not self.records.periodic:
            return "it takes multisines of at least two amplitudes in their steady state, and no record is periodic"
        if len(set(self.records.fitted_class.tolist())) < 2:
            size = self.records.amplitudes_v[self.records.fitted_class[0]]
            return (
                f"all fitted records have one amplitude, {size:.3g} V rms: hysteresis cannot be told from linear "
                "stiffness; add records of another amplitude, twice as large for example"
            )
        return ""

    def _best_and_next(self, orders: list[int]) -> list[int]:
        """The order of the linear model that would be chosen, and the next one."""
        linear = [(c, own) for c, own in self.found if c.kind == "coupled linear"]
        if not linear:
            return orders[:1]
        best = smallest_within_noise([own for _, own in linear], [c.parameters for c, _ in linear])[0]
        k = orders.index(linear[best][0].order)
        return orders[k : k + _STIFFNESS_ORDERS]

    def _report(self, what: str) -> None:
        self.on_progress(self.done, self.total, what + self._so_far())

    def _iteration(self, done: int, total: int, text: str) -> None:
        self._report(f"{self.left[0]}, iteration {done} of {total}")

    def _so_far(self) -> str:
        if not self.candidates:
            return ""
        best = min(self.candidates, key=lambda candidate: candidate.error_share)
        return f"; best so far {best.name}: {100 * best.error_share:.3g} % of the output on held-out records"

    def _judge(self, fit: Callable[[], Fitted]) -> None:
        """Fit the next model and judge it, or keep the reason why it cannot be."""
        self._report(self.left[0])
        name = self.left[0]
        try:
            self.fits[name] = fitted = fit()
        except IdentificationError as error:
            self.refused.append(Refused(name, str(error)))
            return
        finally:
            self.left, self.done = self.left[1:], self.done + 1
        records = self.records
        model = CoupledMirror(
            mirror=fitted.mirror,
            actuators=records.actuators,
            outputs=records.outputs,
            delay_s=fitted.delay_s,
            rate_hz=records.rate_hz,
            steps_per_sample=STEPS,
            excited_hz=self.response.excited_hz,
            known=fitted.known,
        )
        with np.errstate(all="ignore"):
            judged = judge(model, records, self.bands_hz)
        if not np.isfinite(judged.share):
            self.refused.append(Refused(fitted.name, "it runs away on a held-out record"))
            return
        candidate = Candidate(
            name=fitted.name,
            kind=fitted.kind,
            order=fitted.order,
            parameters=fitted.parameters,
            model=model,
            poles_rad_s=fitted.poles_rad_s,
            poles_error_rad_s=fitted.poles_error_rad_s,
            delay_error_s=fitted.delay_error_s,
            error_rms=judged.error_rms,
            band_error_rms=judged.band_error_rms,
            error_share=judged.share,
            record_share=judged.record_share,
            note=fitted.note,
        )
        self.found.append((candidate, judged))
        self.on_model(candidate)

    def result(self, stopped: bool) -> CoupledIdentification:
        """The choice among the candidates so far."""
        records, candidates = self.records, self.candidates
        if not candidates:
            raise IdentificationError(f"no model could be fitted: {self.refused[0].model}: {self.refused[0].reason}")
        chosen, best, ties = smallest_within_noise([own for _, own in self.found], [c.parameters for c in candidates])
        responses = tuple(self._response_of(k) for k in range(records.amplitudes_v.size))
        return CoupledIdentification(
            candidates=tuple(candidates),
            chosen=candidates[chosen].name,
            reason=self._reason(chosen, best, ties),
            within_noise=tuple(candidates[k].name for k in ties),
            warnings=tuple(self._warnings(candidates[chosen], candidates[best])),
            refused=tuple(self.refused),
            amplitudes_v=records.amplitudes_v,
            bands_hz=self.bands_hz,
            output_rms=output_rms(records),
            noise_rms=noise_rms(records),
            responses=responses,
            modelled=tuple(
                None if own is None else self._modelled(candidates[chosen].model, k) for k, own in enumerate(responses)
            ),
            dependence=None if stopped else self._dependence(responses),
            fitted=tuple(r.path for r in records.fitted),
            held_out=tuple(r.path for r in records.held_out),
            stopped=stopped,
        )

    def _response_of(self, amplitude: int) -> FrequencyResponse | None:
        """The response of one amplitude; None where its records are too few, or drive not all channels."""
        try:
            return _response(self.records.of_amplitude(amplitude), self.records.periodic)
        except IdentificationError:
            return None

    def _modelled(self, model: CoupledMirror, amplitude: int) -> Complexes:
        """The response of a model to the drives of one amplitude, estimated as that of the recordings is."""
        records = [replace(r, output=modelled_output(model, r)) for r in self.records.of_amplitude(amplitude)]
        return _response(records, self.records.periodic).response

    def _dependence(self, responses: Sequence[FrequencyResponse | None]) -> AmplitudeDependence | None:
        """How gain and main resonance change with the amplitude, by linear models of each; None where not seen."""
        linear = [c for c in self.candidates if c.kind == "coupled linear"]
        groups = [self.records.of_amplitude(k) for k, own in enumerate(responses) if own is not None]
        if len(groups) < 2 or not linear:
            return None
        order = min(linear, key=lambda candidate: candidate.error_share).order
        try:
            return amplitude_dependence([fit_linear(group, order, exchanges=0) for group in groups])
        except IdentificationError:  # no resonance in the excited band
            return None

    def _warnings(self, chosen: Candidate, best: Candidate) -> Iterator[str]:
        if chosen.note:
            yield f"{chosen.name}: {chosen.note}."
        if best.order == max(c.order for c in self.candidates if c.kind == best.kind):
            yield (
                f"The least error is that of the largest model of its kind that was tried, {best.name}: a larger one "
                "may have less."
            )

    def _reason(self, chosen: int, best: int, ties: Sequence[int]) -> str:
        own, least = self.found[chosen][0], self.found[best][0]
        text = (
            f"{own.name} ({own.parameters} parameters) leaves {100 * own.error_share:.3g} % of the output on the "
            "held-out records"
        )
        if chosen == best and len(ties) > 1:
            return f"{text}, less than any other; the models within its noise have no fewer parameters."
        if chosen == best:
            return f"{text}, less than any other by more than its noise."
        return (
            f"{text}; the least, {100 * least.error_share:.3g} % by {least.name} with {least.parameters} parameters, "
            "is less by no more than two standard errors of the difference, so the smaller model is taken."
        )
