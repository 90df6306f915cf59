"""Ten tables of a measured frequency response, with what they were drawn from: for the tests and the benchmark of fits.

Each is a sum of modes, `D + sum_k c_k b_k^T / (s - p_k)` with its conjugates (a column c_k, a row b_k for each pole):
a table of n poles has n states. All are free of delay. They were written before the fit was.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Table:
    """A table and its truth.

    `freq_hz` (frequencies,); `response`, `true_response` and `standard_error` (frequencies, outputs, inputs), the error
    being that of the real and of the imaginary part together (the root of the mean of |noise|^2); `system` the true
    (A, B, C, D), continuous, per second; `poles` its poles in rad/s.
    """

    name: str
    freq_hz: np.ndarray
    response: np.ndarray
    true_response: np.ndarray
    standard_error: np.ndarray
    system: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    poles: np.ndarray

    @property
    def order(self) -> int:
        return len(self.poles)


def pair(freq_hz: float, damping: float) -> complex:
    """The pole above the real axis of a mode, rad/s."""
    return complex(2 * np.pi * freq_hz * complex(-damping, np.sqrt(1 - damping**2)))


def slow_response(system: Sequence[np.ndarray], freq_hz: np.ndarray) -> np.ndarray:
    """C (j w - A)^-1 B + D, one frequency after the other."""
    A, B, C, D = system
    s = 2j * np.pi * np.asarray(freq_hz)
    return np.array([C @ np.linalg.solve(value * np.eye(len(A)) - A, B) + D for value in s])


def modal(poles: Sequence[complex], columns: np.ndarray, rows: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, ...]:
    """(A, B, C, D) in real blocks: a pole with an imaginary part stands for itself and its conjugate."""
    states = sum(1 if np.isreal(pole) else 2 for pole in poles)
    A, B, C = np.zeros((states, states)), np.zeros((states, rows.shape[1])), np.zeros((columns.shape[0], states))
    at = 0
    for pole, column, row in zip(poles, columns.T, rows, strict=True):
        if np.isreal(pole):
            A[at, at], B[at], C[:, at] = np.real(pole), np.real(row), np.real(column)
            at += 1
        else:  # c b^T / (s - p) and its conjugate
            sigma, omega = np.real(pole), np.imag(pole)
            A[at : at + 2, at : at + 2] = [[sigma, omega], [-omega, sigma]]
            B[at : at + 2] = [2 * np.real(row), -2 * np.imag(row)]
            C[:, at], C[:, at + 1] = np.real(column), np.imag(column)
            at += 2
    return A, B, C, np.asarray(D, dtype=float)


def noisy(true_response: np.ndarray, standard_error: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """The table with a circular Gaussian error of that standard deviation on each entry."""
    parts = generator.standard_normal((2, *true_response.shape))
    return true_response + standard_error * (parts[0] + 1j * parts[1]) / np.sqrt(2)


def table(
    name: str,
    freq_hz: np.ndarray,
    system: Sequence[np.ndarray],
    noise: float,
    seed: int,
    proportional: bool = False,
) -> Table:
    """A table of a system: `noise` of each entry, or of the root mean square of its element over the frequencies."""
    truth = slow_response(system, freq_hz)
    level = np.abs(truth) if proportional else np.sqrt(np.mean(np.abs(truth) ** 2, axis=0))
    error = np.broadcast_to(noise * level, truth.shape).copy()
    response = noisy(truth, error, np.random.default_rng(seed))
    A, B, C, D = system
    return Table(name, freq_hz, response, truth, error, (A, B, C, D), np.linalg.eigvals(A))


def drawn(poles: Sequence[complex], outputs: int, inputs: int, seed: int, feedthrough: float) -> tuple[np.ndarray, ...]:
    """Modes of random shapes with gains of about one at their peak (a real pole: at zero), for several axes."""
    generator = np.random.default_rng(seed)
    columns = generator.standard_normal((outputs, len(poles))) + 0j
    rows = generator.standard_normal((len(poles), inputs)) + 0j
    rows *= np.abs(np.real(poles))[:, None] * np.where(np.isreal(poles), 1, -1j)[:, None]
    return modal(poles, columns, rows, feedthrough * generator.standard_normal((outputs, inputs)))


def single(poles: Sequence[complex], residues: Sequence[complex], feedthrough: float = 0.0) -> tuple[np.ndarray, ...]:
    """One element out of its poles and residues."""
    return modal(poles, np.ones((1, len(poles))), np.asarray(residues)[:, None], np.array([[feedthrough]]))


def oscillators(freq_hz: Sequence[float], damping: Sequence[float], gains: Sequence[float]) -> tuple[np.ndarray, ...]:
    """Sum of gain w^2 / (s^2 + 2 zeta w s + w^2): gains of one sign put an anti-resonance between each two modes."""
    poles = [pair(f, z) for f, z in zip(freq_hz, damping, strict=True)]
    return single(poles, [g * abs(p) ** 2 / (2j * p.imag) for g, p in zip(gains, poles, strict=True)])


def one_resonance() -> Table:
    return table("one light resonance", np.geomspace(10, 1000, 200), oscillators([120], [0.01], [1.0]), 1e-3, 1)


def anti_resonances() -> Table:
    system = oscillators([90, 210, 400], [0.005, 0.01, 0.02], [1.0, 0.4, 0.25])
    return table("anti-resonances", np.linspace(5, 600, 500), system, 1e-2, 2, proportional=True)


def real_poles() -> Table:
    poles = [-2 * np.pi * f for f in (1.0, 10.0, 90.0, 1000.0)]
    return table("real poles", np.geomspace(0.1, 1e4, 150), single(poles, [-p for p in poles]), 1e-4, 3)


def heavy_damping() -> Table:
    poles = [pair(40, 0.5), pair(300, 0.8)]
    return table("heavy damping, 2 × 2", np.geomspace(2, 3000, 200), drawn(poles, 2, 2, 14, 0.0), 3e-2, 4)


def close_poles() -> Table:
    system = oscillators([100, 102], [0.005, 0.006], [1.0, 0.8])
    return table("close poles", np.linspace(80, 125, 300), system, 3e-3, 5)


def wide_range() -> Table:
    """From a corner at 0.5 Hz over a resonance down to a hundred-thousandth."""
    poles = [-2 * np.pi * 0.5, -2 * np.pi * 20.0, -2 * np.pi * 3000.0, pair(700, 0.02)]
    system = single(poles, [300.0, 20.0, 5.0, -0.4j])
    return table("wide dynamic range", np.geomspace(0.05, 2e4, 400), system, 1e-3, 6, proportional=True)


def mirror_two_axes() -> Table:
    poles = [pair(f, z) for f, z in ((150, 0.02), (240, 0.03), (700, 0.01), (1100, 0.05))]
    return table("mirror of two axes, 2 × 2", np.geomspace(10, 3000, 400), drawn(poles, 2, 2, 17, 0.3), 1e-2, 7)


def three_axes() -> Table:
    poles = [pair(f, z) for f, z in ((55, 0.03), (80, 0.02), (130, 0.04), (190, 0.01), (260, 0.03), (340, 0.02))]
    return table("three axes, 3 × 3", np.linspace(5, 450, 600), drawn(poles, 3, 3, 18, 0.1), 5e-3, 8)


def one_drive_three_sensors() -> Table:
    poles = [-2 * np.pi * 3.0, -2 * np.pi * 60.0] + [
        pair(f, z) for f, z in ((25, 0.1), (110, 0.01), (450, 0.3), (800, 0.02))
    ]
    return table("one drive, 3 × 1", np.geomspace(0.5, 2000, 350), drawn(poles, 3, 1, 19, 0.2), 3e-4, 9)


def sixteen_states() -> Table:
    freq_hz = (12, 31, 70, 128, 260, 520, 980, 2100)
    damping = (0.05, 0.01, 0.03, 0.2, 0.008, 0.02, 0.01, 0.1)
    poles = [pair(f, z) for f, z in zip(freq_hz, damping, strict=True)]
    return table("sixteen states, 2 × 3", np.geomspace(3, 5000, 800), drawn(poles, 2, 3, 20, 0.1), 1e-3, 10)


TABLES = (
    one_resonance,
    anti_resonances,
    real_poles,
    heavy_damping,
    close_poles,
    wide_range,
    mirror_two_axes,
    three_axes,
    one_drive_three_sensors,
    sixteen_states,
)
