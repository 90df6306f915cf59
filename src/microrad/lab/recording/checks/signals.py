"""All checks of the values of a recording, in order: what cannot be used at all, then what is a matter of degree."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.lab.recording.checks.channel import clipping, drift, quantisation
from microrad.lab.recording.checks.drive_and_output import excitation, follows
from microrad.lab.recording.records import MIN_SAMPLES, Finding, FloatArray, RecordingError

# The share of an input's variance that the other inputs do not explain; below it the noise of any sensor hides which
# of them moved the mirror.
_OWN_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class Signals:
    """What is judged: channels, how messages call them, the rate, and where in the file a sample stands."""

    where: str
    inputs: Sequence[FloatArray]
    outputs: Sequence[FloatArray]
    input_labels: Sequence[str]
    output_labels: Sequence[str]
    rate_hz: float
    place: Callable[[int], str]

    def labelled(self) -> list[tuple[str, str, FloatArray]]:
        """Role, label and values of each channel, inputs first."""
        inputs = [("input", n, v) for n, v in zip(self.input_labels, self.inputs, strict=True)]
        return inputs + [("output", n, v) for n, v in zip(self.output_labels, self.outputs, strict=True)]


def check_signals(signals: Signals) -> list[Finding]:
    """Findings of degree, refused or not; raises `RecordingError` for what no one can accept."""
    for _, label, values in signals.labelled():
        _check_finite(signals, label, values)
    _check_length(signals)
    for role, label, values in signals.labelled():
        _check_varies(signals, role, label, values)
    _check_separable(signals)
    findings = []
    for role, label, values in signals.labelled():
        findings += clipping(label, values, signals.place, signals.inputs if role == "output" else None)
        findings += quantisation(label, values, signals.inputs if role == "output" else None)
    band, found = excitation(signals.inputs, signals.input_labels, signals.rate_hz)
    findings += found
    for label, values in zip(signals.output_labels, signals.outputs, strict=True):
        findings += drift(label, values, signals.inputs)
        findings += follows(label, values, signals.inputs, signals.input_labels, signals.rate_hz, band)
    return findings


def _check_finite(signals: Signals, label: str, values: FloatArray) -> None:
    # One sum tells: nan and inf survive it. An overflow of the sum alone is caught by the second look.
    if np.isfinite(np.sum(values)):
        return
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{signals.where}: {signals.place(row)} of {label} is {values[row]}, {bad.size} such samples in all; "
            "remove or repair it, because hysteresis remembers what happened in a gap."
        )


def _check_length(signals: Signals) -> None:
    samples = signals.inputs[0].size
    if samples < MIN_SAMPLES:
        raise RecordingError(
            f"{signals.where}: {samples} samples; at least {MIN_SAMPLES} are needed to tell a hysteresis loop from "
            "noise and to hold some back for the check; record longer or faster."
        )


def _check_varies(signals: Signals, role: str, label: str, values: FloatArray) -> None:
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        remedy = "drive the mirror up and down" if role == "input" else "check the sensor's wiring and range"
        named = label if label.startswith(f"the {role}") else f"the {role}, {label}"
        raise RecordingError(
            f"{signals.where}: {named}, is constant at {values[0]:g}, so nothing can be learnt from it; "
            f"choose another column or {remedy}."
        )


def _check_separable(signals: Signals) -> None:
    """Refuse inputs that are linear combinations of the others: their effects cannot be told apart."""
    if len(signals.inputs) < 2:
        return
    covariance = np.cov(np.stack(signals.inputs)) if signals.inputs[0].size <= 1 << 20 else _covariance(signals.inputs)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale)
    for k, label in enumerate(signals.input_labels):
        others = [j for j in range(len(scale)) if j < k]
        if not others:
            continue
        weights = np.linalg.lstsq(correlation[np.ix_(others, others)], correlation[others, k], rcond=None)[0]
        own = 1 - float(correlation[others, k] @ weights)
        if own < _OWN_SHARE:
            strongest = others[int(np.argmax(np.abs(weights)))]
            raise RecordingError(
                f"{signals.where}: {label} is a copy of {signals.input_labels[strongest]}"
                f"{' and others' if np.sum(np.abs(weights) > 0.01) > 1 else ''}: only {100 * max(own, 0.0):.1g} % of "
                "its variance is its own, so their effects cannot be told apart; drive the inputs independently "
                "(orthogonal multisines), or leave one out."
            )


def _covariance(columns: Sequence[FloatArray]) -> FloatArray:
    means = [float(column.mean()) for column in columns]
    total = np.zeros((len(columns), len(columns)))
    for at in range(0, columns[0].size, 1 << 18):
        block = np.stack([c[at : at + (1 << 18)] - m for c, m in zip(columns, means, strict=True)])
        total += block @ block.T
    return total / columns[0].size
