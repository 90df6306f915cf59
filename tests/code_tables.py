"""The two tables of a convolutional code that come from bit-true simulations: `python tests/code_tables.py TABLE`.

`error_ratio` prints bit error ratios at constant power. `share` prints how far the power that does as well as symbols
of several powers is on the way, in dB, from that of the same pairwise error to that of the same mutual information: the
simulated error ratio, read from `error_ratio` as a level, for each kind of `POWERS` at each mean level, and through all
of these by least squares of levels a line between `NODES`. Where errors are rare the pairwise error alone counts: the
last node is 0, and none is below. `CHECKED` are powers that the fit does not see. All draws are seeded.
"""

import sys
from dataclasses import replace

import numpy as np

import viterbi
from microrad.link.fade_series import code
from microrad.link.fade_series.codes import mutual_information

NAME = "ccsds-k7-1-2"
LEAST_ERRORS = 60_000
MOST_BITS = {0.5: 9.8e7, 1.0: 3.2e8}  # 6e7 at the other levels
WORDS, LENGTH = 512, 2048
SHARE_ERRORS, LEAST_SHARE_ERRORS, MOST_RUNS = 8000, 1500, 12
LEVELS_DB = np.arange(-5.0, 6.1, 0.75)
NODES = (-6.0, -5.0, -4.5, -4.0, -3.5, -3.0, -2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0)
POWERS = {
    "exponential": lambda draw, n: draw.exponential(size=n),
    "two, 16 dB apart": lambda draw, n: np.where(draw.random(n) < 0.5, 0.05, 1.95),
    "two, 10 dB apart": lambda draw, n: np.where(draw.random(n) < 0.5, 0.2, 1.8),
    "a quarter dark": lambda draw, n: np.where(draw.random(n) < 0.25, 0.0, 4.0 / 3.0),
}
CHECKED = {
    "log-normal, 3 dB": lambda draw, n: np.exp(0.7 * draw.standard_normal(n)),
    "a tenth 16 dB below": lambda draw, n: np.where(draw.random(n) < 0.1, 0.025, 1.0),
}


def simulated(kind, level_db):
    """Error ratio, wrong bits, and the powers of the symbols of the first run."""
    errors = bits = run = 0
    first = None
    while errors < SHARE_ERRORS and run < MOST_RUNS:
        seed = [run, round(100 * level_db) + 9999]
        power = kind(np.random.default_rng([*seed, 1]), 2 * WORDS * LENGTH)
        first = power if first is None else first
        wrong = viterbi.wrong_bits(power, 10.0 ** (level_db / 10.0), seed, WORDS)
        errors, bits, run = errors + int(wrong.sum()), bits + wrong.size, run + 1
    return errors / bits, errors, first


def levels(coded, power, snr):
    """Constant powers of the same pairwise error and of the same mutual information, in dB."""
    *factors, told = (each.mean(keepdims=True) for each in coded.parts(snr * power))
    none = np.full(1, float(mutual_information(np.array(1e-9))))
    pairs = replace(coded, share=(0.0,) * len(coded.share)).ratio([*factors, told])
    whole = replace(coded, share=(1.0,) * len(coded.share)).ratio([*factors, np.maximum(told, none)])
    return level_of(coded, pairs[0]), level_of(coded, whole[0])


def level_of(coded, ratio):
    """Constant power of an error ratio, in dB."""
    return 10.0 * np.log10(coded.snr_for(float(ratio)))


def samples(coded, kinds):
    """What was simulated: kind, mean level, error ratio, errors, level of the ratio and the two levels of `levels`."""
    for name, kind in kinds.items():
        for level_db in LEVELS_DB:
            ratio, errors, power = simulated(kind, level_db)
            if errors < LEAST_SHARE_ERRORS:
                break
            yield (
                name,
                level_db,
                ratio,
                errors,
                level_of(coded, ratio),
                *levels(coded, power, 10.0 ** (level_db / 10.0)),
            )


def fitted(rows):
    """The share at each node by least squares of levels, the last one 0."""
    spread = np.array(
        [[np.interp(row[6], NODES, line) * (row[5] - row[6]) for line in np.eye(len(NODES))] for row in rows]
    )
    apart = np.array([row[5] - row[4] for row in rows])
    return np.append(np.maximum(np.linalg.lstsq(spread[:, :-1], apart, rcond=None)[0], 0.0), 0.0)


def error_ratios():
    """Print the ratios at constant power."""
    for half in range(-18, 3):
        ratio, errors, places = viterbi.constant(half / 2.0, LEAST_ERRORS, MOST_BITS.get(half / 2.0, 6e7))
        print(f"    [{half / 2.0:.1f}, {ratio:.5g}],  # {errors} wrong bits in {places} places", flush=True)


def shares():
    """Print the shares, and how far each simulation is from what they make of it."""
    coded = code(NAME)
    rows = list(samples(coded, POWERS))
    share = fitted(rows)
    for node, each in zip(NODES, share, strict=True):
        print(f"    [{node:.1f}, {each:.2f}],")
    for seen, of in ((True, rows), (False, list(samples(coded, CHECKED)))):
        for name, level_db, ratio, errors, is_db, pairs_db, mutual_db in of:
            off = pairs_db - np.interp(mutual_db, NODES, share) * (pairs_db - mutual_db) - is_db
            told = "fitted" if seen else "checked"
            print(
                f"# {told}: {name}, {level_db:.2f} dB: {ratio:.3g} of {errors}, pairs {pairs_db:.3f}, "
                f"mutual {mutual_db:.3f}, off by {off:+.3f} dB",
                flush=True,
            )


if __name__ == "__main__":
    {"error_ratio": error_ratios, "share": shares}[sys.argv[1]]()
