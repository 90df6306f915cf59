"""The text of a mirror file: the keys of a mission's [mirror] table, each value with its uncertainty and source."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from microrad.hysteresis import BoucWen, Play, scaled, slow_gain
from microrad.identify.bouc_wen import BoucWenFit
from microrad.identify.choice import Identification
from microrad.identify.doubts import fit_warnings
from microrad.identify.joint import JointFit, turned_over
from microrad.identify.plant_structures import LinearPoles, propagated
from microrad.identify.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.identify.predictions import Fit
from microrad.identify.records import FloatArray, IdentificationError


def mirror_file_text(identification: Identification, name: str, *, model: str | None = None) -> str:
    """TOML text of a mirror file of the chosen model, or of the one named.

    The keys stand at the root, without a [mirror] header. Values are printed so that they read back to 1e-12. Where
    the sensor falls with the drive the signs are turned, and a comment says so: a mirror file describes a mirror whose
    angle rises with its drive. Raises `IdentificationError` for a blank name, a model that was not fitted,
    and one that does not move.
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
        *_composition(fit, identification),
        _line("rate_limit", _text(fit.rate_limit_v_per_s, "V/s"), f"fastest rate of the drive, from {source}"),
        _line("bias", _text(identification.bias_v, "V"), f"middle of the drive range, from {source}"),
        _line("drive_min", _text(identification.drive_min_v, "V"), f"lowest drive, from {source}"),
        _line("drive_max", _text(identification.drive_max_v, "V"), f"highest drive, from {source}"),
        "",
        *_tables(fit, identification, source),
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
    if isinstance(fit, BoucWenFit):
        lines += [f"Not identified: {item.name}, {item.reason}" for item in fit.not_identified]
    if isinstance(fit, JointFit):
        lines += [f"Not identified: {parameter}, {why}" for parameter, why in fit.not_identified]
    if _falling(fit):
        lines.append("The sensor's sign was flipped: its reading falls with the drive, and a mirror's angle rises.")
    return [f"# {_one_line(text)}" for text in lines]


def _names(paths: Sequence[str]) -> str:
    """The files by name, or how many they are beyond three: the head of the file has them all."""
    names = [_one_line(Path(path).name) for path in paths]
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more"


def _falling(fit: Fit) -> bool:
    if isinstance(fit, JointFit):
        return slow_gain(fit.model) < 0
    return fit.d1_rad_per_v < 0 if isinstance(fit, BoucWenFit) else fit.sign < 0


def _composition(fit: Fit, identification: Identification) -> list[str]:
    if isinstance(fit, JointFit) and fit.linear is not None:
        return [_line("composition", "cascade", "hysteresis drives the linear part below; both were fitted together")]
    why = "were not identified" if identification.linear is None else "are not used by this model"
    return [_line("composition", "static", f"the linear dynamics of the mirror {why}")]


def _tables(fit: Fit, identification: Identification, source: str) -> list[str]:
    if isinstance(fit, BoucWenFit):
        return _bouc_wen(fit, source)
    if isinstance(fit, PrandtlIshlinskiiFit):
        return _prandtl_ishlinskii(fit, source)
    return _joint(fit, identification, source)


# ----------------------------------------------------------------------------------------------------- joint models
def _joint(fit: JointFit, identification: Identification, source: str) -> list[str]:
    turned = -1.0 if _falling(fit) else 1.0
    lines = _joint_bouc_wen(fit, source) if isinstance(fit.model, BoucWen) else _joint_plays(fit, turned, source)
    if fit.creep.weights_rad_v:
        error = fit.fit.standard_errors[[p.name for p in fit.structure.parameters].index("creep")]
        weights = [_quoted(_text(turned * 1e3 * w, "mrad/V")) for w in fit.creep.weights_rad_v]
        times = [_quoted(_text(t, "s")) for t in fit.creep.time_constants_s]
        lines += [
            "",
            "[creep]",
            f"time_constants = [{', '.join(times)}] # identified: decades that the recordings cover; from {source}",
            f"weights = [{', '.join(weights)}] # identified: one weight, ± standard error {1e3 * error:.2g} mrad/V, "
            f"from {source}",
        ]
    if fit.linear is not None:
        lines += ["", *_linear(fit, fit.linear, identification)]
    return lines


def _joint_bouc_wen(fit: JointFit, source: str) -> list[str]:
    keys = ("d1", "d2", "epsilon", "delta", "alpha", "beta", "gamma", "eta", "exponent")
    units = ("mrad/V", "s/V", "mrad/V", "s/V", "1/V", "1/V", "1/V", "1/V", "")
    scales = np.array([1e3, 1.0, 1e3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])

    def values(at: FloatArray) -> FloatArray:
        model = fit.structure.parts(at).model
        assert isinstance(model, BoucWen)
        m = turned_over(model) if _falling(fit) else model
        linear = (m.d1_rad_v, m.d2_s_v, m.epsilon_rad_v, m.delta_s_v)
        return np.asarray(scales * np.array([*linear, m.alpha_1_v, m.beta_1_v, m.gamma_1_v, m.eta_1_v, m.exponent]))

    errors = propagated(values, fit.fit.values, fit.fit.covariance)
    lines = ["[bouc_wen]"]
    for key, unit, value, error in zip(keys, units, values(fit.fit.values), errors, strict=True):
        if key in ("gamma", "eta", "exponent") and key not in fit.form.free:
            continue
        given = f"± standard error {error:.2g} {unit}".rstrip() if error > 0.0 else "held, not fitted"
        text = _quoted(_text(float(value), unit)) if unit else repr(float(value))
        lines.append(f"{key} = {text}".ljust(44) + f" # identified: {given}, from {source}")
    return lines


def _joint_plays(fit: JointFit, turned: float, source: str) -> list[str]:
    model = scaled(fit.model, turned)
    assert isinstance(model, Play)
    errors = fit.fit.standard_errors[: len(model.thresholds_v)]
    thresholds = [_quoted(_text(r, "V")) for r in model.thresholds_v]
    least = 1e-9 * slow_gain(model)  # what the search leaves of a weight at its bound
    weights = [_quoted(_text(1e3 * w if w > least else 0.0, "mrad/V")) for w in model.weights_rad_v]
    shown = ", ".join(f"{1e3 * e:.2g}" for e in errors)
    lines = [
        "[prandtl_ishlinskii]",
        f"thresholds = [{', '.join(thresholds)}] # identified: chosen, not fitted; from {source}",
        f"weights = [{', '.join(weights)}] # identified: ± standard error {shown} mrad/V, from {source}",
    ]
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
        frequencies = ", ".join(_quoted(_text(f, "Hz")) for f in roots.frequencies_hz)
        errors = ", ".join(f"{of[f'{kind} {i}']:.2g}" for i in numbers if f"{kind} {i}" in of)
        given = f"± standard error {errors} Hz" if errors else "from the frequency response, held in the joint fit"
        lines.append(f"{kind}s = [{frequencies}] # identified: {given}, from {wide}")
        dampings = ", ".join(repr(float(d)) for d in roots.dampings)
        lines.append(f"{kind}_dampings = [{dampings}] # identified: 1 is a real {kind}; from {wide}")
    low, high = identification.linear.excited_hz if identification.linear is not None else (0.0, 0.0)
    return [
        *lines,
        _line("normalise_at", _text(linear.normalise_at_hz, "Hz"), "where the linear part has the magnitude 1"),
        _line("excited_from", _text(low, "Hz"), f"lowest frequency with a drive in it, from {wide}"),
        _line("excited_to", _text(high, "Hz"), f"highest frequency with a drive in it, from {wide}"),
    ]


def _bouc_wen(fit: BoucWenFit, source: str) -> list[str]:
    """Turning the output over turns d1, epsilon and beta: h' of -h has the terms of h with -epsilon and -beta."""
    signs = np.array([-1, 1, -1, 1, 1, -1]) if _falling(fit) else np.ones(6)
    keys = ("d1", "d2", "epsilon", "delta", "alpha", "beta")
    units = ("mrad/V", "s/V", "mrad/V", "s/V", "1/V", "1/V")
    scales = (1e3, 1.0, 1e3, 1.0, 1.0, 1.0)
    lines = ["[bouc_wen]"]
    for key, unit, scale, value, error in zip(
        keys, units, scales, signs * fit.values, fit.standard_errors, strict=True
    ):
        comment = f"± standard error {scale * error:.2g} {unit}, from {source}"
        lines.append(_line(key, _text(scale * float(value), unit), comment))
    return lines


def _prandtl_ishlinskii(fit: PrandtlIshlinskiiFit, source: str) -> list[str]:
    """Operators without weight are left out, but the threshold 0 stays first, as a mirror file wants it."""
    keep = fit.weights_rad_per_v > 0
    keep[0] = True
    thresholds = [_quoted(_text(float(v), "V")) for v in fit.thresholds_v[keep]]
    weights = [_quoted(_text(1e3 * float(w), "mrad/V")) for w in fit.weights_rad_per_v[keep]]
    errors = ", ".join(f"{1e3 * e:.2g}" if np.isfinite(e) else "at 0" for e in fit.standard_errors_rad_per_v[keep])
    return [
        "[prandtl_ishlinskii]",
        f"thresholds = [{', '.join(thresholds)}] # identified: chosen, not fitted; from {source}",
        f"weights = [{', '.join(weights)}] # identified: ± standard error {errors} mrad/V, from {source}",
    ]


def _line(key: str, text: str, comment: str) -> str:
    return f"{key} = {_quoted(text)}".ljust(44) + f" # identified: {comment}"


def _text(value: float, unit: str) -> str:
    return f"{float(value)!r} {unit}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
