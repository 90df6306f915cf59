"""What an identification of several channels found, in sentences, and the numbers that several of them need."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.units import format_quantity, parse_quantity
from microrad.lab.identify.coupled import Candidate, CoupledIdentification
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.linear.uncertainty import natural
from microrad.report.identification.parameters import to_error, two_digits
from microrad.report.quantities import counted, minus, percent, quantity

USABLE = 0.5
"""Of the rms output: a model that leaves more on records that no fit has seen is none."""
_SENSORS = 4  # from which their places contradict a sensor that is reversed
_MOST_NAMES = 4
_MOST_AMPLITUDES = 4


# --------------------------------------------------------------------------------------------------------------- units
def unit_of(found: CoupledIdentification) -> str:
    """The SI unit of the outputs: m or rad."""
    return "rad" if found.candidate().model.outputs[0].quantity == "angle" else "m"


@dataclass(frozen=True, slots=True)
class Scale:
    """A unit with a prefix in which a column or an axis is read well, and its SI value."""

    unit: str
    size: float

    def text(self, value: float, digits: int = 3) -> str:
        """A value without its unit; "" for nan.

        Args:
            value: in the SI unit.
            digits: significant ones.
        """
        return "" if math.isnan(value) else minus(f"{float(f'{value / self.size:.{digits}g}'):.10g}")


def scale(values: object, unit: str) -> Scale:
    """The unit that leaves the largest of some values one to three digits before the point.

    Args:
        values: in SI units, of any shape; nan does not count.
        unit: their SI unit.
    """
    size = np.abs(np.asarray(values, dtype=np.float64))
    largest = float(size[np.isfinite(size)].max(initial=0.0))
    name = format_quantity(largest, unit).partition(" ")[2] if largest else unit
    return Scale(name, parse_quantity(f"1 {name}", unit))


# ------------------------------------------------------------------------------------------------------------- numbers
def over_outputs(rms: Floats) -> Floats:
    """Rms over the outputs of what has the shape (..., outputs)."""
    return np.asarray(np.sqrt(np.mean(np.square(rms), axis=-1)))


def shares(candidate: Candidate, found: CoupledIdentification) -> Floats:
    """Error of a candidate over the output at each amplitude, rms over the outputs, shape (amplitudes,).

    Args:
        candidate: one model.
        found: what was identified.
    """
    return over_outputs(candidate.error_rms / found.output_rms)


def linear_floor(found: CoupledIdentification) -> Floats:
    """Rms that the best linear model of each amplitude leaves, (amplitudes, outputs), SI; nan where that is not known.

    It is found without a model: what the measured response leaves of the outputs of the fitted records, with the noise
    of a single period.
    """
    floor, _ = _floor_powers(found, np.array([0.0, np.inf]))
    return np.asarray(np.sqrt(floor[:, 0]))


def band_floors(found: CoupledIdentification) -> tuple[Floats, Floats]:
    """The same in each band, and the noise in it, both rms in SI units, (amplitudes, bands, outputs)."""
    floor, noise = _floor_powers(found, found.bands_hz)
    return np.sqrt(floor), np.sqrt(noise)


def _floor_powers(found: CoupledIdentification, edges_hz: Floats) -> tuple[Floats, Floats]:
    """Mean squares of both in each band; nan where they are not known.

    A response is one of the mean of the periods, whose noise is smaller than that of the samples a model is judged by:
    it is raised to what the held-out records have.
    """
    shape = (found.amplitudes_v.size, edges_hz.size - 1, found.output_rms.shape[1])
    floor, noise = np.full(shape, np.nan), np.full(shape, np.nan)
    for k, response in enumerate(found.responses):
        if response is None:
            continue
        floor[k] = _band_sums(response, response.residual_power, edges_hz)
        if response.noise_standard_error is None:
            continue
        error = np.maximum(response.standard_error[:, :, 0], 1e-300)
        of_mean = response.residual_power * (response.noise_standard_error[:, :, 0] / error) ** 2
        raised = np.fmax(found.noise_rms[k] ** 2 / np.maximum(of_mean.sum(axis=0), 1e-300), 1.0)
        in_mean = _band_sums(response, of_mean, edges_hz)
        noise[k] = raised * in_mean
        floor[k] += (raised - 1.0) * in_mean
    return floor, noise


def _band_sums(response: FrequencyResponse, power: Floats, edges_hz: Floats) -> Floats:
    """Sum of a power (frequencies, outputs) over the frequencies in each band, (bands, outputs); nan without any."""
    band = np.searchsorted(edges_hz, response.freq_hz, side="right") - 1
    band[response.freq_hz == edges_hz[-1]] = edges_hz.size - 2
    sums = np.stack([power[band == k].sum(axis=0) for k in range(edges_hz.size - 1)])
    return np.where(sums > 0.0, sums, np.nan)


@dataclass(frozen=True, slots=True)
class Pole:
    """A pole, one of a conjugate pair: natural frequency and damping ratio (1 where it is real), one standard error."""

    freq_hz: float
    freq_error_hz: float
    damping: float
    damping_error: float
    excited: bool

    @property
    def real(self) -> bool:
        """Whether it is real."""
        return self.damping_error == 0.0

    @property
    def texts(self) -> tuple[str, str, str, str]:
        """Frequency (Hz) and damping, each with its standard error and with the digits that this leaves."""
        damping = (f"{self.damping:.0f}", "") if self.real else with_error(self.damping, self.damping_error)
        return *with_error(self.freq_hz, self.freq_error_hz), *damping


def with_error(value: float, error: float) -> tuple[str, str]:
    """A value with the digits that its standard error leaves it, and that error.

    Args:
        value: as it was found.
        error: its standard error in the same unit; nan where it is not known.
    """
    if math.isnan(error):
        return minus(f"{value:.4g}"), "not known"
    return to_error(value, error), two_digits(error)


def poles(candidate: Candidate) -> list[Pole]:
    """The poles at rest by their frequency."""
    low, high = candidate.model.excited_hz
    every = zip(candidate.poles_rad_s, candidate.poles_error_rad_s, strict=True)
    return sorted((_pole(complex(p), complex(e), low, high) for p, e in every), key=lambda pole: pole.freq_hz)


def _pole(pole: complex, error: complex, low_hz: float, high_hz: float) -> Pole:
    """A pole, and whether it lies in the excited band."""
    of = natural(pole, error)
    return Pole(of.freq_hz, of.freq_error_hz, of.damping, of.damping_error, low_hz <= of.freq_hz <= high_hz)


def drawn_amplitude(found: CoupledIdentification) -> int | None:
    """Number of the amplitude whose response is drawn: the middle one of those that have one."""
    known = [k for k, response in enumerate(found.responses) if response is not None]
    return known[len(known) // 2] if known else None


# ----------------------------------------------------------------------------------------------------------- sentences
def part(share: float, of: Candidate | None = None) -> str:
    """An error over the output, in per cent and as many digits as tell candidates apart; "" for nan.

    Args:
        share: the error.
        of: whose it is; where a search was ended before its optimum the third digit hangs on rounding and is left out.
    """
    return "" if math.isnan(share) else percent(share, 2 if of is not None and of.note else 3)


def headline(found: CoupledIdentification) -> str:
    """Which model was chosen, and how well it predicts."""
    own = found.candidate()
    name = f"Stopped before the last model, so the choice so far: {own.name}" if found.stopped else _begun(own.name)
    left = part(own.error_share, own)
    return (
        f"{name} ({counted(own.parameters, 'parameter')}) predicts "
        f"{counted(len(found.held_out), 'record')} that no fit has seen with an error of {left} of the rms output."
    )


def _begun(sentence: str) -> str:
    """A sentence with a capital letter."""
    return f"{sentence[:1].upper()}{sentence[1:]}"


def sound(found: CoupledIdentification) -> bool | None:
    """Whether the choice can be used: it leaves less than half of the output; None where the ladder was stopped."""
    return None if found.stopped else found.candidate().error_share < USABLE


def worst(found: CoupledIdentification) -> tuple[str, str, float]:
    """Held-out record and output with the largest error of the chosen model over the rms output, and that share."""
    share = found.candidate().record_share
    record, output = np.unravel_index(int(np.argmax(share)), share.shape)
    return found.held_out[record], found.candidate().model.outputs[output].name, float(share[record, output])


def worst_text(found: CoupledIdentification) -> str:
    """The same in a sentence."""
    record, output, share = worst(found)
    return f"The worst is {output} of {record}: {part(share, found.candidate())}."


def by_amplitude(found: CoupledIdentification) -> str:
    """The error of the chosen model at each amplitude of the drive, in the outputs' unit and in per cent."""
    own = found.candidate()
    errors, parts = over_outputs(own.error_rms), shares(own, found)
    known = [k for k in range(errors.size) if np.isfinite(errors[k])]
    told = [
        f"{quantity(errors[k], unit_of(found))} rms ({part(parts[k])} of the output) at "
        f"{quantity(found.amplitudes_v[k], 'V')} rms drive"
        for k in known
    ]
    if len(told) > _MOST_AMPLITUDES:
        told = [told[0], told[len(told) // 2], told[-1]]
    return f"It leaves {_listed(told)}." if told else ""


def rests_on(found: CoupledIdentification) -> str:
    """On which records the verdict rests."""
    names = list(found.held_out[:_MOST_NAMES])
    more = len(found.held_out) - len(names)
    names += [f"{more} more"] if more else []
    were = "was" if len(found.fitted) == 1 else "were"
    return f"This rests on {_listed(names)}; {counted(len(found.fitted), 'other record')} {were} fitted."


def _listed(texts: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(texts[:-1]), *texts[-1:]]))


def verdict(found: CoupledIdentification) -> list[str]:
    """What was found and on what it rests, a sentence each; the first is the headline."""
    return [
        *filter(None, (headline(found), by_amplitude(found), worst_text(found), rests_on(found), _begun(found.reason)))
    ]


def delay_text(candidate: Candidate) -> str:
    """The delay of the recording chain in a sentence."""
    delay, error = candidate.model.delay_s, candidate.delay_error_s
    known = f" ± {quantity(error, 's', 2)}" if math.isfinite(error) and error > 0.0 else ""
    return (
        f"The drive acts {quantity(delay, 's')}{known} late. That delay belongs to the recording chain (converters, "
        "filters, amplifier), not to the mirror: the mirror file holds it apart."
    )


def not_held(found: CoupledIdentification) -> list[str]:
    """What the mirror file does not hold because the recordings do not show it, a sentence each."""
    own = found.candidate()
    low, high = own.model.excited_hz
    said = [
        f"Creep: nothing below {quantity(low, 'Hz')} was excited, so what the mirror does within minutes of a step was "
        "not seen.",
        f"Modes above {quantity(high, 'Hz')}: nothing was excited there.",
    ]
    if own.kind != "hysteretic stiffness":
        said.append("Hysteresis: the chosen model is linear, and its gain is the same at every amplitude.")
    outputs = own.model.outputs
    if placeless := any(output.quantity == "displacement" and output.position_m is None for output in outputs):
        said.append(
            "A geometry: where the displacements are measured was not stated, so tilts and piston cannot be had from "
            "them."
        )
    if placeless or len(outputs) < _SENSORS or any(output.quantity == "angle" for output in outputs):
        said.append(
            "Which way round the channels are: a reversed sensor and two swapped channels are another mirror, and show "
            "only against signs that are stated, or against the places of four sensors or more."
        )
    if own.model.known is None:
        said.append("Uncertainty: standard errors of the parameters are not known.")
    return said


def pole_error_text(errors: Complexes) -> str:
    """What the standard errors of poles are, or that there are none."""
    if not np.isfinite(errors).all():
        return "Standard errors that are not known would need more records of each amplitude."
    return "± is one standard error; it says nothing of what the model leaves out."
