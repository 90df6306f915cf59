"""How gain and main resonance change with the amplitude of the drive: the first sign of hysteresis in a linear fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.records import IdentificationError

_LOW = 0.1


@dataclass(frozen=True, eq=False)
class AmplitudeDependence:
    """Linear models of one mirror at several amplitudes, in rising order; arrays of shape (amplitudes,).

    `drive_rms` is the mean over the inputs. `gain` is the largest singular value of the measured response, its mean
    from the lowest excited frequency to a tenth of the main resonance. `resonance_hz` is the frequency |Im p| / 2 pi
    of the pole of the main resonance, the pair with the highest peak, with its standard error, and `damping_ratio` -Re
    p / |p|.
    """

    drive_rms: Floats
    gain: Floats
    resonance_hz: Floats
    resonance_error_hz: Floats
    damping_ratio: Floats

    @property
    def gain_rise_percent(self) -> float:
        """Change of the gain from the smallest to the largest amplitude."""
        return float(100 * (self.gain[-1] / self.gain[0] - 1))

    @property
    def resonance_shift_hz(self) -> float:
        """Change of the resonance from the smallest to the largest amplitude."""
        return float(self.resonance_hz[-1] - self.resonance_hz[0])


def amplitude_dependence(fits: Sequence[LinearFit]) -> AmplitudeDependence:
    """Compare fits at different amplitudes; raises `IdentificationError` for fewer than two, or without a resonance."""
    if len(fits) < 2:
        raise IdentificationError(f"{len(fits)} amplitude given; at least two are needed to see a dependence.")
    ordered = sorted(fits, key=lambda fit: float(fit.response.drive_rms.mean()))
    main = _main_resonance(ordered[0].modes, ordered[0].excited_hz)
    every = [fit.modes.poles_rad_s for fit in ordered]
    found = [int(np.argmin(np.where(own.imag > 0, np.abs(own - main), np.inf))) for own in every]
    poles = np.array([own[k] for own, k in zip(every, found, strict=True)])
    errors = [fit.poles_error_rad_s[k] for fit, k in zip(ordered, found, strict=True)]
    return AmplitudeDependence(
        np.array([float(fit.response.drive_rms.mean()) for fit in ordered]),
        np.array([_low_gain(fit, abs(main) / (2 * np.pi)) for fit in ordered]),
        poles.imag / (2 * np.pi),
        np.array(errors) / (2 * np.pi),
        -poles.real / np.abs(poles),
    )


def _main_resonance(modes: ModalModel, excited_hz: tuple[float, float]) -> complex:
    """Pole of the pair with the largest |c| |b| / -Re p, the height of its peak, among those in the excited band."""
    freq = modes.poles_rad_s.imag / (2 * np.pi)
    height = np.linalg.norm(modes.output_vectors, axis=0) * np.linalg.norm(modes.input_vectors, axis=1)
    height = np.where((freq > excited_hz[0]) & (freq < excited_hz[1]), height / -modes.poles_rad_s.real, 0.0)
    if not height.any():
        raise IdentificationError("the model has no resonance in the excited band, so there is none to follow.")
    return complex(modes.poles_rad_s[int(np.argmax(height))])


def _low_gain(fit: LinearFit, resonance_hz: float) -> float:
    low = fit.response.freq_hz <= max(_LOW * resonance_hz, fit.response.freq_hz[0])
    return float(np.linalg.svd(fit.response.response[low], compute_uv=False)[:, 0].mean())
