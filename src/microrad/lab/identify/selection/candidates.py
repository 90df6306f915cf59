"""The models that an identification compares: which ones the recordings support, their fits, and how well they predict.

A static model has hysteresis alone; a joint one has the linear part, hysteresis and creep together.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import shared_out
from microrad.core.units import plain
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, fit_bouc_wen
from microrad.lab.identify.hysteresis.joint import FORMS, JointFit, fit_joint, time_constants
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import fit_prandtl_ishlinskii
from microrad.lab.identify.hysteresis.structures import LinearPoles, poles_of
from microrad.lab.identify.linear.axis import fit_axis
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.linear.modal import Hold
from microrad.lab.identify.records import IdentificationError, SiRecord, Units, no_progress
from microrad.lab.identify.selection.predictions import Fit, Prediction, Score, ScoredModel, predict
from microrad.lab.identify.statistics import may_be_chance, percent
from microrad.lab.recording import Recording

STATIC = ("prandtl_ishlinskii", "bouc_wen", "bouc_wen_admissible")
"""Models of the hysteresis alone; bouc_wen is the paper's Eq. 3."""

MODELS = (*STATIC, *FORMS)
_STARTS = 12
_VAGUE, _BESIDE = 0.03, 0.1  # relative error of a pole, and logarithm of a zero over it, from which it may be spare
_ROUGH = 5  # simulations in which a fit comes near enough to tell whether a pole is needed
_REACH, _POLISHED = 2.0, 2  # by how much a fit may be worse and still be polished, and how many are


@dataclass(frozen=True)
class Refused:
    """A model that the recordings cannot support, and why."""

    model: str
    reason: str


def fit_linear_part(
    response: Sequence[Recording], units: Units, models: Sequence[str], hold: Hold, on_progress: Progress
) -> LinearFit | None:
    """The linear part of the broadband recordings, in volts and radians; None where no model asks for it.

    Args:
        response: Broadband recordings that can be averaged together.
        units: Their units.
        models: The models that are to be fitted.
        hold: What the drives do between samples.
        on_progress: Called with the steps done, their number and what is done.
    """
    if not response or not set(models) & set(FORMS):
        return None
    scaled = [  # about the first drive value, where the mirror rests
        replace(r, drive=(r.drive - r.drive[:1]) * units.volts, output=r.output * units.radians) for r in response
    ]
    return fit_axis(scaled, hold=hold, on_progress=on_progress)


def supported_models(
    models: Sequence[str], records: Sequence[SiRecord], has_linear: bool
) -> tuple[list[str], list[Refused]]:
    """Models that the recordings can support, and the others with the number that speaks against each.

    Args:
        models: The models asked for.
        records: The fitted parts of the loops.
        has_linear: Whether a linear part is known.

    Raises:
        IdentificationError: Where no model is supported.
    """
    names, refused = [], []
    longest = max(r.drive_v.size * r.step_s for r in records)
    short = f"the longest recording lasts {plain(longest)} s, and creep shows over seconds; record a staircase of 10 s"
    for model in models:
        form = FORMS.get(model)
        if form is not None and form.creep and (longest < 1.0 or len(time_constants(records)) < 2):
            refused.append(Refused(model, short))
        elif form is not None and form.needs_linear and not has_linear:
            why = "no recording is broadband, so there is no linear part; record a small chirp or multisine as well"
            refused.append(Refused(model, why))
        else:
            names.append(model)
    if not names:
        raise IdentificationError(f"the recordings do not support {refused[0].model}: {refused[0].reason}.")
    return names, refused


@dataclass(frozen=True, eq=False)
class Candidates:
    """The recordings that the models are fitted to and judged by, and how.

    `heads` are the fitted parts of `loops`, up to `splits`; `span_rad` is the peak-to-peak output that percentages
    refer to, `seed` that of scattered starts, `hold` what a drive does between samples.
    """

    loops: Sequence[Recording]
    splits: Sequence[int]
    heads: Sequence[Recording]
    validation: tuple[Recording, ...]
    broadband: Sequence[Recording]
    linear: LinearFit | None
    units: Units
    span_rad: float
    seed: int
    admissible: bool
    hold: Hold

    def fit_all(
        self, models: Sequence[str], on_progress: Progress, on_fit: Callable[[Fit], None], *, side_by_side: bool = False
    ) -> tuple[list[Fit], list[Refused]]:
        """One fit a model; a joint fit that fails is refused with its reason, a static one raises.

        Args:
            models: The models to fit.
            on_progress: Called with the starts done, their number and what is done.
            on_fit: Called with each fit.
            side_by_side: Whether another process takes part; then the fits are heard of at the end.

        Raises:
            IdentificationError: Where a static fit fails, or every fit.
        """
        poles = None
        if self.linear is not None:
            poles = poles_of(self.linear.system, self.linear.excited_hz, self.linear.rate_hz)
            poles = replace(poles, delay_s=self.linear.delay_s, delay_error_s=self.linear.delay_error_s)
        efforts = [_STARTS if model in ("bouc_wen", "bouc_wen_admissible") else 1 for model in models]
        ahead = self._side_by_side(models, efforts, poles, on_progress) if side_by_side else {}
        fits: list[Fit] = []
        failed = []
        for i, model in enumerate(models):

            def progress(done: int, _total: int, what: str, before: int = sum(efforts[:i])) -> None:
                on_progress(before + done, sum(efforts), what)

            try:
                fit = ahead[model] if ahead else self._fit(model, poles, progress)
                if isinstance(fit, IdentificationError):
                    raise fit
            except IdentificationError as error:
                if model in STATIC:
                    raise
                failed.append(Refused(model, str(error)))
            else:
                fits.append(fit)
                on_fit(fit)
            if not ahead and model not in STATIC:
                progress(1, 1, model)
        if ahead:
            on_progress(sum(efforts), sum(efforts), models[-1])
        if not fits:
            raise IdentificationError(failed[0].reason)
        return fits, failed

    def _side_by_side(
        self, models: Sequence[str], efforts: Sequence[int], poles: LinearPoles | None, on_progress: Progress
    ) -> dict[str, Fit | IdentificationError]:
        """The fit of each model, or its error, made on all cores where that is possible.

        Bouc-Wen forms come in a second round, behind the static fit at which they begin; what takes longest goes first
        in each.
        """
        later = [model for model in models if model in FORMS and FORMS[model].family == "bouc_wen"]
        later.sort(key=lambda model: model != "bouc_wen_classical")
        first = [model for model in models if model not in later]
        first.sort(key=lambda model: not model.startswith("bouc_wen"))
        ahead: dict[str, Fit | IdentificationError] = {}
        order = [*first, *later]

        def fitted(model: str) -> Fit | IdentificationError:
            try:
                return self._fit(model, poles, no_progress)
            except IdentificationError as error:
                return error

        for before, turns in ((0, first), (len(first), later)):
            if turns is later and later:
                with suppress(IdentificationError):  # each form says so
                    _ = self._static_start

            def told(turn: int, before: int = before) -> None:
                begun = sum(efforts[models.index(model)] for model in order[: before + turn])
                on_progress(begun, sum(efforts), f"fitting {order[before + turn]}")

            with shared_out([partial(fitted, model) for model in turns], told) as results:
                ahead |= zip(turns, results(), strict=True)
            if isinstance(fit := ahead.get("bouc_wen"), BoucWenFit):  # another process may have made it
                vars(self)["_static_start"] = fit
        return ahead

    def _fit(self, model: str, poles: LinearPoles | None, progress: Progress) -> Fit:
        if model == "prandtl_ishlinskii":
            plays = fit_prandtl_ishlinskii(self.heads, units=self.units)
            progress(1, 1, "play operators")
            return plays
        if model in STATIC:
            return self._fit_eq_3(progress, admissible=model == "bouc_wen_admissible")
        return self.fit_joint(model, poles, progress)

    def _fit_eq_3(self, progress: Progress, *, admissible: bool = False) -> BoucWenFit:
        fit = fit_bouc_wen(
            self.heads,
            starts=_STARTS,
            seed=self.seed,
            admissible=admissible,
            on_progress=progress,
            units=self.units,
        )
        if not admissible:
            vars(self)["_static_start"] = fit
        return fit

    def fit_joint(self, model: str, poles: LinearPoles | None, progress: Progress) -> JointFit:
        """The fit of one of `FORMS`, its linear part held.

        Args:
            model: Its name.
            poles: The linear part in cascade.
            progress: Called once, before the fit.
        """
        progress(0, 1, f"fitting {model}")
        return fit_joint(
            self.heads,
            model,
            self.units,
            linear=poles,
            admissible=self.admissible,
            static=self._static_start if FORMS[model].family == "bouc_wen" else None,
            hold=self.hold,
            seed=self.seed,
        )

    def freed(self, begin: JointFit, progress: Progress, *, evaluations: int | None = None) -> JointFit:
        """A joint fit with poles, zeros and delay free as well, to the broadband recording and the loops.

        Args:
            begin: Where the search begins.
            progress: Called once, before the fit.
            evaluations: Largest number of simulations in the search; 1 moves nothing, and finds the errors there.
        """
        progress(0, 1, "linear part, hysteresis and creep together")
        return fit_joint(
            self.heads,
            begin.name,
            self.units,
            linear=begin.linear,
            free_linear=True,
            admissible=self.admissible,
            broadband=self.broadband,
            hold=self.hold,
            begin=begin,
            evaluations=evaluations,
        )

    @cached_property
    def _static_start(self) -> BoucWenFit:
        """Where all Bouc-Wen forms begin: the fit of Eq. 3, made once."""
        return self._fit_eq_3(no_progress)

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """All that is judged by."""
        return (*self.loops, *self.validation)

    @property
    def all_splits(self) -> list[int]:
        """First sample of each of them that no fit has seen."""
        return [*self.splits, *(0 for _ in self.validation)]

    def predict(self, fit: Fit) -> tuple[Prediction, ...]:
        """The predictions of a fit, in the order of `recordings`."""
        pairs = zip(self.recordings, self.all_splits, strict=True)
        return tuple(predict(fit, recording, split) for recording, split in pairs)

    def scored(self, fit: Fit, predictions: tuple[Prediction, ...]) -> ScoredModel:
        """A fit with its score, as those who look on are given it.

        Args:
            fit: The fit.
            predictions: Its prediction of each recording: loops, then validation.
        """
        return ScoredModel(fit.name, self.score(fit.name, predictions), predictions, self.recordings)

    def score(self, model: str, predictions: Sequence[Prediction]) -> Score:
        """Residuals of a model on the fitted and on the held-out samples, in per cent of the span.

        Args:
            model: Name of the model.
            predictions: Its prediction of each recording: loops, then validation.
        """
        fitted = [p.residual_rad[p.start : p.split] for p in predictions[: len(self.loops)]]
        unseen = [p.residual_rad[p.split :] for p in predictions]
        return Score(
            model, *(value for parts in (fitted, unseen) for value in percent(np.concatenate(parts), self.span_rad))
        )


def within_reach(fits: Sequence[Fit], predictions: Sequence[Sequence[Prediction]]) -> list[int]:
    """Numbers of the fits that may be the best once everything is free, the best first.

    Those are joint fits with a linear part that leave at most twice of what the best fit leaves on the samples that no
    fit has seen, and no more than two.

    Args:
        fits: The fits.
        predictions: Of each fit, its prediction of each recording.
    """
    squares = [_held_out_squares(each) for each in predictions]
    near = [i for i, fit in enumerate(fits) if has_linear(fit) and squares[i] <= _REACH**2 * min(squares)]
    return sorted(near, key=lambda i: squares[i])[:_POLISHED]


def has_linear(fit: Fit) -> bool:
    """Whether poles and zeros belong to a fit."""
    return isinstance(fit, JointFit) and fit.linear is not None


def refit(
    candidates: Candidates, fit: Fit, predictions: tuple[Prediction, ...], on_progress: Progress
) -> tuple[Fit, tuple[Prediction, ...]]:
    """Fit a model once more with all its numbers free, its linear part among them.

    The new fit is taken where it is no worse on the held-out part, but for chance. Where it is worse the model stays
    where it was, with the errors that all its numbers have there. One without a linear part stays as it is.

    Args:
        candidates: The recordings that the models are fitted to and judged by.
        fit: The fit.
        predictions: Its prediction of each recording.
        on_progress: Called with the starts done, their number and what is done.
    """
    if not isinstance(fit, JointFit) or fit.linear is None:
        return fit, predictions
    begin = fit
    if fit.form.family == "bouc_wen":  # a small loop of it asks for poles that are not needed behind it
        begin = _without_spare_poles(candidates, candidates.freed(fit, on_progress, evaluations=_ROUGH), on_progress)
    free = candidates.freed(begin, on_progress)
    seen = candidates.predict(free)
    if may_be_chance(_losses(seen), _losses(predictions)):
        return free, seen
    there = candidates.freed(fit, on_progress, evaluations=1)
    known = replace(
        there.fit,
        covariance=_held_covariance(there, candidates.linear),
        converged=fit.fit.converged,
        evaluations=fit.fit.evaluations,
    )
    return replace(there, fit=known), predictions


def _held_covariance(fit: JointFit, response: LinearFit | None) -> Floats:
    """Covariance where poles, zeros and delay are those of the response: they are known as it knows them, no better.

    Args:
        fit: The fit, with the errors of everything free.
        response: The linear part that they come from.
    """
    if response is None or fit.linear is None:
        return fit.fit.covariance
    known = {"delay": response.delay_error_s}
    roots = ("pole", fit.linear.poles, response.poles_rad_s, response.poles_error_rad_s)
    others = ("zero", fit.linear.zeros, response.zeros_rad_s, response.zeros_error_rad_s)
    for kind, of, values, errors in (roots, others):
        for number, (f, damping) in enumerate(zip(of.frequencies_hz, of.dampings, strict=True), 1):
            if not values.size:
                continue
            error = float(errors[int(np.argmin(np.abs(np.abs(values) - 2 * np.pi * f)))])
            if abs(damping) < 1.0:  # of a pair half of the squared error lies along the root, half across it
                error /= np.sqrt(2.0)
            known[f"{kind} {number}"] = error / (2 * np.pi)
            known[f"{kind} {number} damping"] = error / (2 * np.pi * f)
    own = fit.fit.standard_errors
    least = np.array([known.get(p.name, 0.0) for p in fit.structure.parameters])
    wider = np.maximum(least / np.maximum(own, 1e-300), 1.0)
    return np.asarray(wider[:, None] * fit.fit.covariance * wider)


def _without_spare_poles(candidates: Candidates, fit: JointFit, on_progress: Progress) -> JointFit:
    """The fit without the poles that the held-out recordings do not need, the least known first.

    Args:
        candidates: The recordings that the models are fitted to and judged by.
        fit: A fit with everything free.
        on_progress: Called with the starts done, their number and what is done.
    """
    while fewer := _fewer_poles(fit):
        other = candidates.freed(replace(fit, linear=fewer[0]), on_progress, evaluations=_ROUGH)
        if not may_be_chance(_losses(candidates.predict(other)), _losses(candidates.predict(fit))):
            break
        fit = other
    return fit


def _fewer_poles(fit: JointFit) -> list[LinearPoles]:
    """The linear part without one of the poles that may be spare, the least known first.

    Those are poles that are hardly known, and poles with a zero beside them, which goes with it. A pole alone leaves
    its turn of phase to the delay.
    """
    assert fit.linear is not None
    poles, zeros = fit.linear.poles, fit.linear.zeros
    errors = {p.name: e for p, e in zip(fit.structure.parameters, fit.fit.standard_errors, strict=True)}
    found: list[tuple[float, LinearPoles]] = []
    for k, (freq_hz, damping) in enumerate(zip(poles.frequencies_hz, poles.dampings, strict=True)):
        error = errors[f"pole {k + 1}"] / freq_hz
        alike = [j for j, other in enumerate(zeros.dampings) if (abs(other) < 1.0) == (damping < 1.0)]
        beside = [j for j in alike if abs(math.log(zeros.frequencies_hz[j] / freq_hz)) < _BESIDE][:1]
        turn_s = 0.0 if beside else (damping if damping < 1.0 else 0.5) / (math.pi * freq_hz)
        delay_s = fit.linear.delay_s + turn_s
        fewer = replace(fit.linear, poles=poles.without(k), zeros=zeros.without(*beside), delay_s=delay_s)
        if (beside or error > _VAGUE) and fewer.poles.values.size > fewer.zeros.values.size:
            found.append((error, fewer))
    return [fewer for _, fewer in sorted(found, key=lambda pair: -pair[0])]


def _losses(predictions: Sequence[Prediction]) -> list[Floats]:
    """Squared residuals on the samples that no fit has seen, of each recording that has some."""
    return [r**2 for p in predictions if (r := p.residual_rad[p.split :]).size]


def _held_out_squares(predictions: Sequence[Prediction]) -> float:
    return float(sum(np.sum(loss) for loss in _losses(predictions)))
