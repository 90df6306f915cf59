"""`fit_frequency_response` against the vector fitting of scikit-rf on ten tables: error, time and stability in one run.

    python benchmarks/frequency_response_fit.py

The tables and their truths are those of tests/response_tables.py. Both get frequencies and response alone and the
true number of poles; scikit-rf gets the true numbers of real poles and pairs as well, and starts at linear and at
logarithmic frequencies, of which the better one counts. "data" and "truth" are the relative rms distance of the model
to the table and to the response behind the noise, root mean square over ten draws of the noise; "weighted" is ours
where it is told the standard errors, which scikit-rf cannot be. With several inputs and outputs a pole of scikit-rf has
a residue of full rank: its model has more "states", and follows more of the noise.

Times are the best of many calls taken in turn, ours without and with its standard errors (they are made when they are
asked for). Where there are not as many outputs as inputs, scikit-rf gets the elements filled up to a square, and its
time counts in proportion to the elements.
"""

import math
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import skrf
from skrf.vectorFitting import VectorFitting

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from microrad import fit_frequency_response
from recorded import record
from response_tables import TABLES, Table, noisy

REPEATS = 25
DRAWS = 10


def distance(found: np.ndarray, to: np.ndarray) -> float:
    return float(np.linalg.norm(found - to) / np.linalg.norm(to))


class ScikitRf:
    """Its fit of a table from one kind of start."""

    def __init__(self, table: Table, response: np.ndarray, spacing: str) -> None:
        self.freq_hz, self.shape, self.spacing = table.freq_hz, response.shape, spacing
        elements = response[0].size
        self.ports = math.isqrt(elements - 1) + 1
        self.share = elements / self.ports**2
        square = np.zeros((len(response), self.ports**2), dtype=complex)
        square[:, :elements] = response.reshape(len(response), -1)
        network = skrf.Network(f=table.freq_hz, f_unit="Hz", s=square.reshape(-1, self.ports, self.ports))
        self.real = int(np.sum(table.poles.imag == 0))
        self.pairs = (table.order - self.real) // 2
        self.fit = VectorFitting(network)

    def __call__(self) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.fit.vector_fit(self.real, self.pairs, init_pole_spacing=self.spacing)

    def response(self) -> np.ndarray:
        places = [(i, j) for i in range(self.ports) for j in range(self.ports)][: self.shape[1] * self.shape[2]]
        elements = [self.fit.get_model_response(i, j, self.freq_hz) for i, j in places]
        return np.array(elements).T.reshape(self.shape)


def best_of(methods: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Least time of each, in ms, all called in turn."""
    best = dict.fromkeys(methods, math.inf)
    for _ in range(REPEATS):
        for name, method in methods.items():
            began = time.perf_counter()
            method()
            best[name] = min(best[name], 1e3 * (time.perf_counter() - began))
    return best


def errors(table: Table) -> tuple[dict[str, np.ndarray], bool, bool]:
    """Root mean squares of (data, truth) by method over the draws; whether all of our and of their fits are stable."""
    found: dict[str, list[tuple[float, float]]] = {"ours": [], "weighted": [], "scikit-rf": []}
    stable = [True, True]
    for seed in range(DRAWS):
        response = noisy(table.true_response, table.standard_error, np.random.default_rng(seed))
        for name, error in (("ours", None), ("weighted", table.standard_error)):
            fit = fit_frequency_response(table.freq_hz, response, table.order, standard_error=error)
            model = fit.response(table.freq_hz)
            found[name].append((distance(model, response), distance(model, table.true_response)))
            stable[0] &= bool((np.linalg.eigvals(fit.system.A).real < 0).all())
        theirs = [ScikitRf(table, response, spacing) for spacing in ("lin", "log")]
        for other in theirs:
            other()
        models = [other.response() for other in theirs]
        nearest = int(np.argmin([distance(model, response) for model in models]))
        stable[1] &= bool((theirs[nearest].fit.poles.real < 0).all())
        found["scikit-rf"].append((distance(models[nearest], response), distance(models[nearest], table.true_response)))
    return {name: np.sqrt(np.mean(np.square(values), axis=0)) for name, values in found.items()}, *stable


def times(table: Table) -> tuple[float, float, float]:
    """Of ours, of ours with its standard errors, and of the faster start of scikit-rf, in ms."""
    theirs = {spacing: ScikitRf(table, table.response, spacing) for spacing in ("lin", "log")}

    def ours() -> object:
        return fit_frequency_response(table.freq_hz, table.response, table.order)

    found = best_of({"ours": ours, "known": lambda: ours().known, **theirs})
    return found["ours"], found["known"], min(found["lin"], found["log"]) * theirs["lin"].share


def main() -> None:
    print(f"scikit-rf {skrf.__version__}; relative rms errors over {DRAWS} draws, times the best of {REPEATS}")
    print(
        f"{'table':28s} states     data: ours / scikit-rf    truth: ours / weighted / scikit-rf    "
        "ms: ours / with errors / scikit-rf    ratio        stable"
    )
    for build in TABLES:
        table = build()
        found, stable, theirs_stable = errors(table)
        fit_ms, known_ms, theirs_ms = times(table)
        data, truth = ({name: value[k] for name, value in found.items()} for k in (0, 1))
        record(f"{table.name}: time over scikit-rf", fit_ms / theirs_ms)
        record(f"{table.name}: error to the truth over scikit-rf", truth["ours"] / truth["scikit-rf"])
        states = f"{table.order}/{table.order * min(table.response.shape[1:])}"
        print(
            f"{table.name:28s} {states:7s} {data['ours']:9.3e} / {data['scikit-rf']:9.3e} "
            f"({data['ours'] / data['scikit-rf']:.3f})   {truth['ours']:9.2e} / {truth['weighted']:9.2e} / "
            f"{truth['scikit-rf']:9.2e} ({truth['ours'] / truth['scikit-rf']:.3f})   {fit_ms:6.2f} / {known_ms:6.2f} / "
            f"{theirs_ms:7.2f}   {fit_ms / theirs_ms:.2f} / {known_ms / theirs_ms:.2f}   {stable} / {theirs_stable}"
        )


if __name__ == "__main__":
    main()
