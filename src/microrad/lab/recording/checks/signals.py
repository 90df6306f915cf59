"""All checks of the values of a recording, in order: what cannot be used at all, then what is a matter of degree."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import counted
from microrad.lab.recording.checks.channel import clipping, drift, quantisation
from microrad.lab.recording.checks.drive_and_output import excitation, follows
from microrad.lab.recording.records import MIN_SAMPLES, Finding, RecordingError

# The share of an input's variance that the other inputs do not explain; below it the noise of any sensor hides which
# of them moved the mirror.
_OWN_SHARE = 1e-6
# Largest sample of a channel, in whatever unit: what lies beyond is no measurement, and its square no number.
_LEAST, _MOST = 1e-30, 1e30


def check_signals(
    where: str,
    inputs: Mapping[str, Floats],
    outputs: Mapping[str, Floats],
    rate_hz: float,
    place: Callable[[int], str],
    alone: bool,
) -> list[Finding]:
    """Findings of degree, refused or not.

    Args:
        where: The file, as messages name it.
        inputs: The drives (samples,) by the words in which messages call them.
        outputs: The sensors, in the same way.
        rate_hz: Samples per second.
        place: The words for where a sample stands in the file.
        alone: Whether the recording has to do by itself. Where it is one of several that `check_together` judges, an
            input may rest or copy another one, and a sensor of an axis that is not driven be dead.

    Raises:
        RecordingError: For what no one can accept.
    """
    drives = list(inputs.values())
    everything = [("input", *item) for item in inputs.items()] + [("output", *item) for item in outputs.items()]
    for _, label, values in everything:
        _check_size(where, label, values, place)
    if (samples := drives[0].size) < MIN_SAMPLES:
        raise RecordingError(
            f"{where}: {samples} samples; at least {MIN_SAMPLES} are needed to tell a hysteresis loop from "
            "noise and to hold some back for the check; record longer or faster."
        )
    vary = list(inputs) if alone else [label for label, values in inputs.items() if not _is_constant(values)]
    for role, label, values in everything:
        if role == "output" or label in vary or not vary:
            _check_varies(where, role, label, values)
    labels = list(inputs)
    band, moving, findings = excitation(drives, labels, rate_hz, alone)
    if alone:
        check_separable(where, covariance(drives), labels)
    drives, labels = [drives[k] for k in moving], [labels[k] for k in moving]
    for label, values in zip(labels, drives, strict=True):
        findings += clipping(label, values, place, None)
        findings += quantisation(label, values, None)
    rests = len(drives) < len(inputs)
    for number, (label, values) in enumerate(outputs.items()):
        found = [
            *clipping(label, values, place, drives),
            *quantisation(label, values, drives),
            *drift(label, values, drives),
            *follows(label, values, drives, labels, rate_hz, band),
        ]
        for each in found:
            excused = rests and each.kind in ("dead", "quantisation")
            findings.append(replace(each, refused=each.refused and not excused, output=number))
    return findings


def _is_constant(values: Floats) -> bool:
    low, high = float(values.min()), float(values.max())
    return high - low <= 1e-12 * max(abs(low), abs(high))


def _check_size(where: str, label: str, values: Floats, place: Callable[[int], str]) -> None:
    size = max(-float(values.min()), float(values.max()))  # nan where one is
    if size == 0.0 or _LEAST <= size <= _MOST:
        return
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{where}: {place(row)} of {label} is {values[row]}, {counted(bad.size, 'such sample')} in all; "
            "remove or repair it, because hysteresis remembers what happened in a gap."
        )
    row = int(np.argmax(np.abs(values)))
    raise RecordingError(
        f"{where}: {place(row)} of {label} is {values[row]:.4g}, its largest sample, and no converter gives a channel "
        f"of less than {_LEAST:g} or more than {_MOST:g}; check its unit and scale, or remove or repair the sample."
    )


def _check_varies(where: str, role: str, label: str, values: Floats) -> None:
    if _is_constant(values):
        remedy = "drive the mirror up and down" if role == "input" else "check the sensor's wiring and range"
        named = label if label.startswith(f"the {role}") else f"the {role}, {label}"
        raise RecordingError(
            f"{where}: {named}{',' * (',' in named)} is constant at {values[0]:g}, so nothing can be learnt from it; "
            f"choose another column or {remedy}."
        )


def covariance(inputs: Sequence[Floats]) -> Floats:
    """Covariance of inputs, times the number of samples; shape (inputs, inputs).

    Args:
        inputs: Samples of each input, each of shape (samples,).
    """
    centred = [column - column.mean() for column in inputs]
    return np.array([[float(a @ b) for b in centred] for a in centred])


def check_separable(where: str, covariance: Floats, labels: Sequence[str]) -> None:
    """Check that no input is a linear combination of those before it.

    Args:
        where: The file or files, as messages name them.
        covariance: Covariance of the inputs, each of which moves, shape (inputs, inputs).
        labels: The inputs in the words of a message, in the same order.

    Raises:
        RecordingError: For an input that is, naming both.
    """
    if len(labels) < 2:
        return
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale)
    for k, label in enumerate(labels[1:], 1):
        weights = np.linalg.lstsq(correlation[:k, :k], correlation[:k, k], rcond=None)[0]
        own = 1 - float(correlation[:k, k] @ weights)
        if own < _OWN_SHARE:
            raise RecordingError(
                f"{where}: {label} is a copy of {labels[int(np.argmax(np.abs(weights)))]}"
                f"{' and others' if np.sum(np.abs(weights) > 0.01) > 1 else ''}: only {100 * max(own, 0.0):.1g} % of "
                "its variance is its own, so their effects cannot be told apart; drive the inputs independently "
                "(orthogonal multisines), or leave one out."
            )
