"""The text of a mirror file: the keys of a mission's [mirror] table, each value with its uncertainty and source."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from microrad.identify.bouc_wen import BoucWenFit
from microrad.identify.choice import Fit, Identification, fit_warnings
from microrad.identify.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.identify.records import IdentificationError


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
    source = ", ".join(_one_line(Path(s.path).name) for s in identification.sources)
    lines = [
        *_header(identification, fit, model or identification.chosen),
        f"name = {_quoted(name)}",
        _line("travel", _text(float(f"{1e3 * identification.travel_rad:.4g}"), "mrad"), f"fitted range, from {source}"),
        _line("composition", "static", "the linear dynamics of the mirror were not identified"),
        _line("rate_limit", _text(fit.rate_limit_v_per_s, "V/s"), f"fastest rate of the drive, from {source}"),
        _line("bias", _text(identification.bias_v, "V"), f"middle of the drive range, from {source}"),
        _line("drive_min", _text(identification.drive_min_v, "V"), f"lowest drive, from {source}"),
        _line("drive_max", _text(identification.drive_max_v, "V"), f"highest drive, from {source}"),
        "",
        *(_bouc_wen(fit, source) if isinstance(fit, BoucWenFit) else _prandtl_ishlinskii(fit, source)),
    ]
    return "\n".join(lines) + "\n"


def _header(identification: Identification, fit: Fit, model: str) -> list[str]:
    score, line = identification.score(model), identification.straight_line
    lines = [f"Mirror identified from {len(identification.sources)} recording(s), model {model}."]
    for source in identification.sources:
        lines.append(f"  {_one_line(source.path)}: {source.fitted} samples fitted, {source.held_out} held out")
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
    if _falling(fit):
        lines.append("The sensor's sign was flipped: its reading falls with the drive, and a mirror's angle rises.")
    return [f"# {_one_line(text)}" for text in lines]


def _falling(fit: Fit) -> bool:
    return fit.d1_rad_per_v < 0 if isinstance(fit, BoucWenFit) else fit.sign < 0


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
