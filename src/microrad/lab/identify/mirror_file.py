"""The text of a mirror file: the keys of a mission's [mirror] table, each value with its uncertainty and source.

Behind the values stands the table `uncertainty`, their covariance in a form that `mirror.spread` draws mirrors from.
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.lab.identify.hysteresis.bouc_wen import PARAMETERS, BoucWenFit
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.lab.identify.hysteresis.structures import LinearPoles
from microrad.lab.identify.records import IdentificationError, centred, si_records
from microrad.lab.identify.selection.choice import Identification
from microrad.lab.identify.selection.predictions import Fit
from microrad.lab.identify.selection.warnings import fit_warnings
from microrad.lab.identify.statistics import central_differences, correlation, propagated
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii, scaled, sign_reversed, slow_gain

_LOST = 100.0  # relative standard error of a value that is as good as held
_LOOSEST = 1.0  # relative standard error that the file gives to a combination of parameters at most
_STIFFEST = 1e-6  # the same, at least: what is known better keeps no more digits
_IDLE = 1e-3  # share of the sum of weights, below which a play operator counts as without weight
_BOUND = 1e-6  # distance from its bound, over its size, at which the search leaves a parameter


def mirror_file_text(identification: Identification, name: str, *, model: str | None = None) -> str:
    """TOML text of a mirror file of the chosen model, or of the one named.

    The keys stand at the root, without a [mirror] header. Values are printed so that they read back to 1e-12. Where
    the sensor falls with the drive the signs are turned, and a comment says so: a mirror file describes a mirror whose
    angle rises with its drive.

    Args:
        identification: What was found.
        name: Name of the mirror.
        model: The model to write, one of `MODELS`; by default the one chosen.

    Raises:
        IdentificationError: For a blank name, a model that was not fitted, and one that does not move.
    """
    if not name.strip():
        raise IdentificationError("the mirror has no name; give one, it stands in the mirror file and in the report.")
    fit = identification.fit(model)
    if isinstance(fit, PrandtlIshlinskiiFit) and not np.any(fit.weights_rad_per_v > 0):
        raise IdentificationError(
            "every play operator has weight 0: the output does not follow the drive; check that the columns belong "
            "together before writing a mirror file."
        )
    source = _names([s.path for s in identification.sources if s.role == "loops"])
    lines = [
        *_header(identification, fit, model or identification.chosen),
        f"name = {_quoted(name)}",
        _line("travel", _text(float(f"{1e3 * identification.travel_rad:.4g}"), "mrad"), f"fitted range, from {source}"),
        _composition(fit, identification),
        _line("rate_limit", _text(fit.rate_limit_v_per_s, "V/s"), f"fastest rate of the drive, from {source}"),
        _line("bias", _text(identification.bias_v, "V"), f"middle of the drive range, from {source}"),
        _line("drive_min", _text(identification.drive_min_v, "V"), f"lowest drive, from {source}"),
        _line("drive_max", _text(identification.drive_max_v, "V"), f"highest drive, from {source}"),
        "",
        *_tables(fit, identification, source),
        *_uncertainty(fit, identification, source),
    ]
    return "\n".join(lines) + "\n"


def _header(identification: Identification, fit: Fit, model: str) -> list[str]:
    score, line = identification.score(model), identification.straight_line
    lines = [f"Mirror identified from {len(identification.sources)} recording(s), model {model}."]
    for source in identification.sources:
        counts = f"{source.fitted} samples fitted, {source.held_out} held out"
        lines.append(f"  {_one_line(source.path)} ({source.role}): {counts}")
        lines.append(f"  sha256 {source.sha256}")
    lines.append(f"{fit.samples_used} samples used, behind the initial transient of each recording.")
    lines.append("Residual in % of the peak-to-peak output, rms (peak):")
    lines += [
        f"  {s.model}: {s.fit_rms_percent:.3f} ({s.fit_peak_percent:.2f}) on the fitted samples, "
        f"{s.held_out_rms_percent:.3f} ({s.held_out_peak_percent:.2f}) on the held-out samples"
        for s in (score, line)
    ]
    lines.append(f"Choice: {identification.reason}")
    of_chosen = fit_warnings(identification.fit())
    general = [warning for warning in identification.warnings if warning not in of_chosen]
    lines += [f"Warning: {warning}" for warning in (*general, *fit_warnings(fit))]
    lines += [f"Not identified: {parameter}, {why}" for parameter, why in fit.not_identified]
    return [f"# {_one_line(text)}" for text in lines]


def _names(paths: Sequence[str]) -> str:
    """The files by name, or how many they are beyond three: the head of the file has them all."""
    names = [_one_line(Path(path).name) for path in paths]
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more"


def _composition(fit: Fit, identification: Identification) -> str:
    if isinstance(fit, JointFit) and fit.linear is not None:
        return _line("composition", "cascade", "hysteresis drives the linear part below; both were fitted together")
    why = "were not identified" if identification.linear is None else "are not used by this model"
    return _line("composition", "static", f"the linear dynamics of the mirror {why}")


def _tables(fit: Fit, identification: Identification, source: str) -> list[str]:
    if isinstance(fit, BoucWenFit):
        numbers = _bouc_wen_numbers(_rising(fit, fit.model))
        return _bouc_wen(_SCALES * numbers, np.append(_SCALES[:6] * fit.standard_errors, [0.0] * 3), (), source)
    if isinstance(fit, PrandtlIshlinskiiFit):
        # Operators without weight are left out, but the threshold 0 stays first, as a mirror file wants it.
        keep = _kept(fit)
        return _plays(fit.thresholds_v[keep], fit.weights_rad_per_v[keep], fit.standard_errors_rad_per_v[keep], source)
    return _joint(fit, identification, source)


# ----------------------------------------------------------------------------------------------------- joint models
def _joint(fit: JointFit, identification: Identification, source: str) -> list[str]:
    turned = -1.0 if fit.falling else 1.0
    if isinstance(fit.model, BoucWen):

        def values(at: Floats) -> Floats:
            return np.asarray(_SCALES * _bouc_wen_numbers(_rising(fit, fit.structure.parts(at).model)))

        errors = propagated(values, fit.fit.values, fit.fit.covariance)
        lines = _bouc_wen(values(fit.fit.values), errors, fit.form.free, source)
    else:
        lines = _joint_plays(fit, source)
    if fit.creep.weights_rad_v:
        of = zip(fit.structure.parameters, fit.fit.standard_errors, strict=True)
        given = ", ".join(f"{1e3 * error:.2g}" for p, error in of if p.name.startswith("creep "))
        times = _list(fit.creep.time_constants_s, "s")
        weights = _list([turned * 1e3 * w for w in fit.creep.weights_rad_v], "mrad/V")
        lines += [
            "",
            "[creep]",
            f"time_constants = {times} # identified: decades that the recordings cover; from {source}",
            f"weights = {weights} # identified: ± standard error {given} mrad/V, from {source}",
        ]
    if fit.linear is not None:
        lines += ["", *_linear(fit, fit.linear, identification)]
    return lines


_BOUC_WEN_KEYS = (*PARAMETERS, "gamma", "eta", "exponent")
_UNITS = ("mrad/V", "s/V", "mrad/V", "s/V", "1/V", "1/V", "1/V", "1/V", "")
_SCALES = np.array([1e3, 1.0, 1e3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])


def _bouc_wen(values: Floats, errors: Floats, free: Sequence[str], source: str) -> list[str]:
    """The table of the numbers and errors as the file counts them; gamma, eta and exponent only where they are free."""
    lines = ["[bouc_wen]"]
    for key, unit, value, error in zip(_BOUC_WEN_KEYS, _UNITS, values, errors, strict=True):
        if key in ("gamma", "eta", "exponent") and key not in free:
            continue
        given = f"± standard error {error:.2g} {unit}".rstrip() if error > 0.0 else "held, not fitted"
        text = _quoted(_text(float(value), unit)) if unit else repr(float(value))
        lines.append(f"{key} = {text}".ljust(44) + f" # identified: {given}, from {source}")
    return lines


def _bouc_wen_numbers(m: BoucWen | PrandtlIshlinskii) -> Floats:
    assert isinstance(m, BoucWen)
    return np.array([*m.row[:6], m.gamma_1_v, m.eta_1_v, m.exponent])


def _rising(fit: Fit, model: BoucWen | PrandtlIshlinskii) -> BoucWen | PrandtlIshlinskii:
    """The model with its output counted as the mirror file counts it: rising with the drive."""
    if not fit.falling:
        return model
    return sign_reversed(model) if isinstance(model, BoucWen) else scaled(model, -1.0)


def _plays(thresholds_v: ArrayLike, weights_rad_v: ArrayLike, errors_rad_v: Floats, source: str) -> list[str]:
    """The table of play operators; an error that is not finite belongs to a weight at its bound 0."""
    errors = ", ".join(f"{1e3 * e:.2g}" if np.isfinite(e) else "at 0" for e in errors_rad_v)
    weights = _list(1e3 * np.asarray(weights_rad_v), "mrad/V")
    return [
        "[prandtl_ishlinskii]",
        f"thresholds = {_list(np.asarray(thresholds_v), 'V')} # identified: chosen, not fitted; from {source}",
        f"weights = {weights} # identified: ± standard error {errors} mrad/V, from {source}",
    ]


def _joint_plays(fit: JointFit, source: str) -> list[str]:
    model = _rising(fit, fit.model)
    assert isinstance(model, PrandtlIshlinskii)
    least = 1e-9 * slow_gain(model)  # what the search leaves of a weight at its bound
    weights = [w if w > least else 0.0 for w in model.weights_rad_v]
    lines = _plays(model.thresholds_v, weights, fit.fit.standard_errors[: len(weights)], source)
    if model.widening_s:
        names = [p.name for p in fit.structure.parameters]
        error = fit.fit.standard_errors[names.index("widening")]
        lines.append(_line("widening", _text(model.widening_s, "s"), f"± standard error {error:.2g} s, from {source}"))
    return lines


def _linear(fit: JointFit, linear: LinearPoles, identification: Identification) -> list[str]:
    """Poles and zeros; with their standard errors where they were fitted with the rest."""
    of = {p.name: e for p, e in zip(fit.structure.parameters, fit.fit.standard_errors, strict=True)}
    sources = [s for s in identification.sources if s.fitted]  # a loop may be broadband itself
    wide = _names([s.path for s in sources if s.role == "broadband"] or [s.path for s in sources])
    lines = ["[linear]"]
    for kind, roots in (("pole", linear.poles), ("zero", linear.zeros)):
        if not roots.frequencies_hz:
            continue
        numbers = range(1, len(roots.frequencies_hz) + 1)
        errors = ", ".join(f"{of[f'{kind} {i}']:.2g}" for i in numbers if f"{kind} {i}" in of)
        given = f"± standard error {errors} Hz" if errors else "from the frequency response, held in the joint fit"
        lines.append(f"{kind}s = {_list(roots.frequencies_hz, 'Hz')} # identified: {given}, from {wide}")
        dampings = ", ".join(repr(float(d)) for d in roots.dampings)
        lines.append(f"{kind}_dampings = [{dampings}] # identified: 1 is a real {kind}; from {wide}")
    low, high = identification.linear.excited_hz if identification.linear is not None else (0.0, 0.0)
    between = {"zero-order": "held", "first-order": "straight"}.get(fit.hold, fit.hold)
    error_s = f" ± {of['delay']:.2g} s" if "delay" in of else " s"
    return [
        *lines,
        f"# recording: drive {between} between samples, output {linear.delay_s:.3g}{error_s} late, a delay that "
        "belongs to the recording chain and is no part of the mirror",
        _line("normalise_at", _text(linear.normalise_at_hz, "Hz"), "where the linear part has the magnitude 1"),
        _line("excited_from", _text(low, "Hz"), f"lowest frequency with a drive in it, from {wide}"),
        _line("excited_to", _text(high, "Hz"), f"highest frequency with a drive in it, from {wide}"),
    ]


def _kept(fit: PrandtlIshlinskiiFit) -> NDArray[np.bool_]:
    return np.asarray((fit.weights_rad_per_v > 0) | (np.arange(fit.thresholds_v.size) == 0))


# ------------------------------------------------------------------------------------------------------- uncertainty
def _uncertainty(fit: Fit, identification: Identification, source: str) -> list[str]:
    """The table `uncertainty`: standard errors and correlation with as many digits as the covariance needs."""
    if isinstance(fit, JointFit):
        numbers, covariance = _joint_covariance(fit)
    elif isinstance(fit, BoucWenFit):
        signs = np.array([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0]) if fit.falling else np.ones(6)
        numbers = dict(zip([f"bouc_wen.{key}" for key in PARAMETERS], (signs * fit.values).tolist(), strict=True))
        covariance = signs[:, None] * fit.covariance * signs
    else:
        numbers, covariance = _play_covariance(fit, identification)
    keys, relative = _relative(numbers, covariance)
    if not keys:
        return []
    errors, correlations = _rounded(relative)
    rows = [f"  {', '.join(correlations[i][:i])}," for i in range(1, len(keys))]
    return [
        "",
        "[uncertainty]",
        f"parameters = [{', '.join(_quoted(key) for key in keys)}] # identified: those not held or at a bound",
        f"standard_errors = [{', '.join(errors)}] # identified: relative to the values, at most {_LOOSEST:g} in any "
        f"combination, from {source}",
        "correlation = [",
        *rows,
        "] # identified: of the values, lower triangle row by row; a sum may be known far better than its parts",
    ]


def _joint_covariance(fit: JointFit) -> tuple[dict[str, float], Floats]:
    """Numbers of the mirror file (SI) by their keys, and their covariance, parameters at a bound being held."""
    parameters, at = fit.structure.parameters, fit.fit.values
    lower, upper = np.array([(p.lower, p.upper) for p in parameters]).T
    distance = np.minimum(at - lower, upper - at)
    scale = np.array([p.scale for p in parameters])
    step = 1e-6 * scale

    def values(where: Floats) -> Floats:
        return np.array(list(_numbers(fit, where).values()))

    jacobian = central_differences(values, np.clip(at, lower + step, upper - step), step)  # no step beyond a bound
    weight = np.array([p.name.startswith("weight") for p in parameters])
    covariance = _holding(fit.fit.covariance, ~weight & (distance <= _BOUND * scale))
    numbers = _numbers(fit, at)
    jacobian = _with_neighbours(numbers) @ jacobian
    return numbers, np.asarray(jacobian @ covariance @ jacobian.T)


def _with_neighbours(numbers: dict[str, float]) -> Floats:
    """What adds the error of a play operator without weight to that of its nearest neighbour with weight.

    A weight of 0 has no relative error, and held at 0 it would leave the others, and their sum, too certain.
    """
    together = np.eye(len(numbers))
    places = [i for i, key in enumerate(numbers) if key.startswith("prandtl_ishlinskii.weights")]
    sizes = list(numbers.values())
    least = _IDLE * sum(sizes[i] for i in places)
    used = [i for i in places if sizes[i] > least]
    for i in places:
        if i not in used:
            nearest = min(used, key=lambda j: abs(j - i), default=i)
            together[nearest, i], together[i, i] = 1.0, 0.0
    return together


def _numbers(fit: JointFit, at: Floats) -> dict[str, float]:
    axis = fit.structure.parts(at)
    model = _rising(fit, axis.model)
    found: dict[str, float] = {}
    if isinstance(model, BoucWen):
        found |= {f"bouc_wen.{k}": v for k, v in zip(_BOUC_WEN_KEYS, _bouc_wen_numbers(model).tolist(), strict=True)}
    else:
        found |= {f"prandtl_ishlinskii.weights.{i}": w for i, w in enumerate(model.weights_rad_v, 1)}
        found["prandtl_ishlinskii.widening"] = model.widening_s
    turned = -1.0 if fit.falling else 1.0
    found |= {f"creep.weights.{i}": turned * w for i, w in enumerate(axis.creep.weights_rad_v, 1)}
    if axis.linear is not None:
        for kind, roots in (("pole", axis.linear.poles), ("zero", axis.linear.zeros)):
            found |= {f"linear.{kind}s.{i}": f for i, f in enumerate(roots.frequencies_hz, 1)}
            found |= {f"linear.{kind}_dampings.{i}": d for i, d in enumerate(roots.dampings, 1)}
    return found


def _play_covariance(fit: PrandtlIshlinskiiFit, identification: Identification) -> tuple[dict[str, float], Floats]:
    """The standard errors with the correlation that the play states have over the fitted samples."""
    pairs = zip(identification.recordings, identification.predictions[0], strict=True)
    heads = [r.first(p.split) for r, p in pairs if p.split > p.start]
    records = si_records(heads, fit.units)
    used = np.isfinite(fit.standard_errors_rad_per_v) & (fit.weights_rad_per_v > 0)
    thresholds = fit.thresholds_v[used]
    states = [kernels.play_response(r.drive_v, thresholds, np.full(thresholds.size, r.drive_v[0])) for r in records]
    stacked = centred(np.concatenate([s[r.start :] for s, r in zip(states, records, strict=True)]), records)
    errors = fit.standard_errors_rad_per_v[used]
    gram = np.asarray(np.linalg.pinv(stacked.T @ stacked, hermitian=True), dtype=float)
    covariance = errors[:, None] * correlation(gram) * errors
    places = np.cumsum(_kept(fit))[used]
    keys = [f"prandtl_ishlinskii.weights.{place}" for place in places]
    return dict(zip(keys, fit.weights_rad_per_v[used].tolist(), strict=True)), np.asarray(covariance)


def _holding(covariance: Floats, held: NDArray[np.bool_]) -> Floats:
    """The covariance of the other parameters where some are held."""
    size = _deviation(covariance)
    size[size == 0.0] = 1.0
    between = covariance / np.outer(size, size)
    known = between[:, held] @ np.linalg.pinv(between[np.ix_(held, held)], hermitian=True) @ between[held]
    left = size[:, None] * (between - known) * size
    return np.where(held[:, None] | held, 0.0, left)


def _deviation(covariance: Floats) -> Floats:
    """Standard errors; rounding may leave a variance of 0 below it."""
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def _relative(numbers: dict[str, float], covariance: Floats) -> tuple[list[str], Floats]:
    """Keys of the numbers that are known but for an error, and the covariance relative to their sizes.

    A number that is lost in its error is held. Combinations that the recordings leave open (eigenvectors) are cut off
    at the size of the values themselves, beyond which their signs would turn; those that are known keep their variance.
    """
    values = np.array(list(numbers.values()))
    covariance = _holding(covariance, _deviation(covariance) > _LOST * np.abs(values))
    kept = _deviation(covariance) > 1e-12 * np.abs(values)
    size = np.abs(values[kept])
    relative = covariance[np.ix_(kept, kept)] / np.outer(size, size)
    variances, directions = np.linalg.eigh(relative)
    cut = (directions * np.clip(variances, 0.0, _LOOSEST**2)) @ directions.T
    return [key for key, keep in zip(numbers, kept, strict=True) if keep], np.asarray(cut)


def _rounded(covariance: Floats) -> tuple[list[str], list[list[str]]]:
    """Standard errors and correlation as text, with digits enough for the variance of each combination to a tenth."""
    variances, directions = np.linalg.eigh(covariance)
    whiten = directions / np.sqrt(np.maximum(variances, _STIFFEST**2))
    size = _deviation(covariance)
    for digits in range(3, 8):
        errors = [f"{e:.{digits}g}" for e in size]
        between = [[f"{r:.{2 * digits}f}" for r in row] for row in correlation(covariance)]
        read = np.array(errors, dtype=float)
        back = read[:, None] * np.array(between, dtype=float) * read
        if np.abs(np.linalg.eigvalsh(whiten.T @ (back - covariance) @ whiten)).max() < 0.1:
            break
    return errors, between


def _line(key: str, text: str, comment: str) -> str:
    return f"{key} = {_quoted(text)}".ljust(44) + f" # identified: {comment}"


def _list(values: Iterable[float], unit: str) -> str:
    """A list of quantities."""
    return f"[{', '.join(_quoted(_text(value, unit)) for value in values)}]"


def _text(value: float, unit: str) -> str:
    return f"{float(value)!r} {unit}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
