"""Our vector fitting against scikit-rf's on the paper's mirror (Eq. 2): error and time in one run.

    python benchmarks/vector_fitting.py

Both fit five poles to 300 logarithmic points from 1 Hz to 5 kHz, the continuous response (scikit-rf knows no hold),
with and without noise of 0.1 % on each point. "fit" is the rms relative distance to what was fitted, "truth" to Eq. 2.
Unlike scikit-rf, ours can weigh each point by one over its standard error; its unweighted result stands beside. Times
are the best of several runs.
"""

import time
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
import skrf
from skrf.vectorFitting import VectorFitting

from microrad.core.lti import frequency_response, modal_from_polynomials
from microrad.lab.identify.linear.vector_fitting import vector_fit

REPEATS = 7
NOISE = 1e-3


def truth() -> tuple[np.ndarray, np.ndarray]:
    eq2 = modal_from_polynomials((1.979e11, 7.051e13, 2.973e13), (1, 2.15e4, 3.737e8, 2.615e12, 8.489e14, 1.829e14))
    freq_hz = np.geomspace(1, 5000, 300)
    return freq_hz, frequency_response(eq2, freq_hz)[:, 0, 0]


def scikit_rf(freq_hz: np.ndarray, response: np.ndarray) -> np.ndarray:
    network = skrf.Network(f=freq_hz, f_unit="Hz", s=response[:, None, None])
    fit = VectorFitting(network)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit.vector_fit(n_poles_real=3, n_poles_cmplx=1, fit_constant=True, fit_proportional=False)
    return np.asarray(fit.get_model_response(0, 0, freq_hz))


def ours(freq_hz: np.ndarray, response: np.ndarray) -> np.ndarray:
    return vector_fit(freq_hz, response, 5).response(freq_hz)


def ours_weighted(freq_hz: np.ndarray, response: np.ndarray) -> np.ndarray:
    return vector_fit(freq_hz, response, 5, weight=1 / np.abs(response)).response(freq_hz)


def timed(function: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - began)
    return result, min(times)


METHODS = {"microrad, weighted": ours_weighted, "microrad, unweighted": ours, "scikit-rf": scikit_rf}


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def main() -> None:
    freq_hz, exact = truth()
    rng = np.random.Generator(np.random.Philox(0))
    print(f"scikit-rf {skrf.__version__}; order 5; relative rms error")
    print("noise    method                  fit        truth      best time")
    for noise in (0.0, NOISE):
        turned = rng.standard_normal((2, exact.size)) / np.sqrt(2)
        data = exact * (1 + noise * (turned[0] + 1j * turned[1]))
        for name, method in METHODS.items():
            found, seconds = timed(partial(method, freq_hz, data))
            found = found.reshape(-1)
            print(
                f"{100 * noise:4.1f} %   {name:22s} {rms(found / data - 1):9.2e}  {rms(found / exact - 1):9.2e}  "
                f"{1e3 * seconds:8.1f} ms"
            )


if __name__ == "__main__":
    main()
