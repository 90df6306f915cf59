"""What an identification of several channels found: each candidate with its held-out error, and the one chosen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.amplitude import AmplitudeDependence
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.selection.candidates import Refused
from microrad.mirror.coupled import CoupledMirror

Kind = Literal["per axis", "coupled linear", "hysteretic stiffness"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One model of the ladder, and its error on the records that no fit has seen.

    `parameters` is the number of free numbers without those that change nothing (the scale of a state), with the delay.
    `poles_rad_s` (modes,) are those at rest, of each pair the one with positive frequency; `poles_error_rad_s` are
    their standard errors, real and imaginary part as a complex number, and `delay_error_s` that of the delay; nan where
    the records cannot tell.

    `error_rms` (amplitudes, outputs) is the rms error in the outputs' own SI units (m or rad), nan for an amplitude of
    which nothing is held out, and `band_error_rms` (amplitudes, bands, outputs) the part of it in each band.
    `error_share` is what the candidates are ranked by: the root of the mean, over held-out records and outputs, of the
    mean-square error over the mean-square output. `record_share` (held-out records, outputs) is the rms error over the
    rms output of each record by itself. `note` says what is to be known of the fit, '' where nothing is.
    """

    name: str
    kind: Kind
    order: int
    parameters: int
    model: CoupledMirror
    poles_rad_s: Complexes
    poles_error_rad_s: Complexes
    delay_error_s: float
    error_rms: Floats
    band_error_rms: Floats
    error_share: float
    record_share: Floats
    note: str = ""


@dataclass(frozen=True, eq=False)
class CoupledIdentification:
    """The candidates in the order of their fits, the choice with its reason, and what the recordings themselves show.

    `chosen` is the name of the smallest candidate whose held-out error is within noise of the best, and `within_noise`
    names all of which that holds. `refused` names the models that were not fitted, or that cannot be used.
    `amplitudes_v` (amplitudes,) is the rms drive of each class of records of one amplitude, rising. `bands_hz`
    (bands + 1,) are the edges of the bands of `Candidate.band_error_rms`. `output_rms` and `noise_rms` (amplitudes,
    outputs) are those of the held-out records (SI): the output without its mean, and what changes from period to
    period, nan where nothing is held out or a record has a single period.

    `responses` holds the measured response of each amplitude, None where its records are too few for one, and
    `dependence` how gain and main resonance change from one to the next, None where that cannot be seen. `modelled` has
    for each of `responses` that of the chosen model to the same drives, estimated in the same way. `fitted` and
    `held_out` are the names of the records. `stopped` says that the ladder was interrupted before its end.
    """

    candidates: tuple[Candidate, ...]
    chosen: str
    reason: str
    within_noise: tuple[str, ...]
    warnings: tuple[str, ...]
    refused: tuple[Refused, ...]
    amplitudes_v: Floats
    bands_hz: Floats
    output_rms: Floats
    noise_rms: Floats
    responses: tuple[FrequencyResponse | None, ...]
    modelled: tuple[Complexes | None, ...]
    dependence: AmplitudeDependence | None
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    stopped: bool

    def candidate(self, name: str | None = None) -> Candidate:
        """A candidate by its name, the chosen one by default."""
        names = [candidate.name for candidate in self.candidates]
        if (name or self.chosen) not in names:
            raise IdentificationError(f"no model '{name}' was fitted; there are {', '.join(names)}.")
        return self.candidates[names.index(name or self.chosen)]

    @property
    def best(self) -> Candidate:
        """The candidate with the least held-out error."""
        return self.candidates[int(np.argmin([candidate.error_share for candidate in self.candidates]))]
