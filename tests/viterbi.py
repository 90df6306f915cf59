"""Bit by bit: the convolutional code K = 7, rate 1/2 (171, 133 octal) over a series of powers, and its soft Viterbi.

Random bits, encoder, a permutation of symbols for an interleaver, white Gaussian noise, and the most likely path with
floating-point metrics. Nothing of microrad is in it. Code words, each from the state 0 back to it, are decoded side by
side.
"""

import numpy as np

TAIL = 6  # zeros that lead back to the state 0
STATES = 64
TAPS = (0o171, 0o133)


def signs(register):
    """The two code symbols, +1 or -1, of seven bits of which the newest is the highest."""
    return tuple(1.0 - 2.0 * (bin(register & taps).count("1") % 2) for taps in TAPS)


def encoded(bits):
    """Code symbols of words of bits, shape (words, bits), to (words, 2 bits)."""
    words, length = bits.shape
    padded = np.zeros((words, length + TAIL), dtype=np.uint8)
    padded[:, TAIL:] = bits
    out = np.empty((words, length, 2))
    for branch, taps in enumerate(TAPS):
        late = [k for k in range(TAIL + 1) if taps >> (TAIL - k) & 1]  # delays of the bits that are added
        out[:, :, branch] = 1.0 - 2.0 * (sum(padded[:, TAIL - k : TAIL - k + length] for k in late) % 2)
    return out.reshape(words, 2 * length)


_BEFORE = np.array([(state << 1) % STATES for state in range(STATES)])
_SIGNS = [np.array([signs((state << 1) | oldest) for state in range(STATES)]) for oldest in (0, 1)]
_WHICH = [((s[:, 0] < 0) * 2 + (s[:, 1] < 0)).astype(int) for s in _SIGNS]  # of a + b, a - b, -a + b, -a - b


def decoded(soft):
    """Bits of the paths that have the largest correlation with soft values, shape (words, 2 bits)."""
    words, length = soft.shape[0], soft.shape[1] // 2
    pairs = np.ascontiguousarray(soft.reshape(words, length, 2).transpose(1, 2, 0), dtype=np.float32)
    metric = np.full((STATES, words), -1e6, dtype=np.float32)
    metric[0] = 0.0
    came = np.empty((length, STATES // 8, words), dtype=np.uint8)
    zero, one = np.empty_like(metric), np.empty_like(metric)
    for k in range(length):
        a, b = pairs[k]
        branch = np.stack([a + b, a - b, b - a, -a - b])
        np.take(metric, _BEFORE, axis=0, out=zero)
        np.take(metric, _BEFORE + 1, axis=0, out=one)
        zero += branch[_WHICH[0]]
        one += branch[_WHICH[1]]
        came[k] = np.packbits(one > zero, axis=0, bitorder="little")
        np.maximum(zero, one, out=metric)
        if k % 64 == 0:
            metric -= metric.max(axis=0)
    state, lane = np.zeros(words, dtype=np.int64), np.arange(words)
    out = np.empty((length, words), dtype=np.uint8)
    for k in range(length - 1, -1, -1):
        out[k] = state >> (TAIL - 1)
        oldest = came[k, state >> 3, lane] >> (state & 7) & 1
        state = (state << 1) % STATES | oldest
    return out.T


def wrong_bits(power, snr, seed, words, order=None):
    """Which bits come out wrong, shape (words, bits): power by symbol on the line, times `snr` (Es/N0).

    `order` says to which place on the line each code symbol goes.
    """
    rng = np.random.default_rng(seed)
    length = power.size // 2 // words
    bits = rng.integers(0, 2, (words, length), dtype=np.uint8)
    bits[:, -TAIL:] = 0
    symbols = encoded(bits).reshape(-1)
    place = np.arange(symbols.size) if order is None else order
    sent = np.empty_like(symbols)
    sent[place] = symbols
    amplitude = np.sqrt(2.0 * snr * power[: symbols.size])
    soft = amplitude * (amplitude * sent + rng.standard_normal(symbols.size))  # the channel's state is known
    return (decoded(soft[place].reshape(words, -1)) != bits)[:, :-TAIL]


def block_order(symbols, length, seed):
    """A permutation that spreads symbols at random over blocks of so many, one behind the other."""
    rng = np.random.default_rng(seed)
    return np.concatenate([at + rng.permutation(min(length, symbols - at)) for at in range(0, symbols, length)])


def constant(snr_db, least_errors, most_bits, words=512, length=4096):
    """Error ratio at constant power, the number of wrong bits and of runs of them, from as many bits as it takes."""
    errors = bits = runs = 0
    while errors < least_errors and bits < most_bits:
        wrong = wrong_bits(
            np.ones(2 * words * length), 10.0 ** (snr_db / 10.0), (round(snr_db * 100) + 9999, bits), words
        )
        errors, bits = errors + int(wrong.sum()), bits + wrong.size
        runs += int(np.sum(np.add.reduceat(wrong, np.arange(0, wrong.shape[1], 16), axis=1) > 0))
    return errors / bits, errors, runs
