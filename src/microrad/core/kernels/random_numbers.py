"""Gaussian random numbers by Philox, one stream for each seed, run and purpose."""

import numpy as np

from microrad.core.kernels.compiler import compiled_loop, inlined
from microrad.core.kernels.ensemble_records import LANES
from microrad.core.kernels.side_by_side import ROW_LENGTH, TO_WHOLE, at_row, bits_of, number_of, row_log

# Philox 4x32 with ten rounds (Salmon et al., SC11): numbers by counter and key, so that no run waits for another.
_LOW32 = np.uint64(0xFFFFFFFF)
_HALF_WORD = np.uint64(32)
_MULTIPLY0, _MULTIPLY1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL0, _WEYL1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_TWO_52_BITS = np.int64(0x4330000000000000)
_TWO_52 = 4503599627370496.0


@inlined
def philox(c0, c1, c2, c3, k0, k1):  # type: ignore[no-untyped-def]
    """Four random words of 32 bits from four words of counter and two of key, each in 64 bits.

    Args:
        c0: Lowest word of the counter.
        c1: Second one.
        c2: Third one.
        c3: Highest one.
        k0: Lower word of the key.
        k1: Higher one.
    """
    for _ in range(10):
        first, second = _MULTIPLY0 * (c0 & _LOW32), _MULTIPLY1 * (c2 & _LOW32)
        c0, c2 = (second >> _HALF_WORD) ^ c1 ^ k0, (first >> _HALF_WORD) ^ c3 ^ k1
        c1, c3 = second, first
        k0, k1 = (k0 + _WEYL0) & _LOW32, (k1 + _WEYL1) & _LOW32
    return c0 & _LOW32, c1 & _LOW32, c2 & _LOW32, c3 & _LOW32


@inlined
def uniform(word):  # type: ignore[no-untyped-def]
    """A word of 32 bits as a number inside (0, 1): (word + 1/2) / 2^32."""
    return (number_of(np.int64(word) | _TWO_52_BITS) - _TWO_52 + 0.5) * (1.0 / 4294967296.0)


@inlined
def cosine_sine(turns):  # type: ignore[no-untyped-def]
    """cos and sin of 2 pi turns, 0 <= turns <= 1, without a branch or a call, to 2.1e-14."""
    shifted = 4.0 * turns + TO_WHOLE
    quarter = bits_of(shifted)
    x = (4.0 * turns - (shifted - TO_WHOLE)) * 1.5707963267948966
    x2 = x * x
    sine = x * (
        1.0
        + x2
        * (
            -1.0 / 6.0
            + x2
            * (
                1.0 / 120.0
                + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362880.0 + x2 * (-1.0 / 39916800.0 + x2 * (1.0 / 6227020800.0))))
            )
        )
    )
    cosine = 1.0 + x2 * (
        -1.0 / 2.0
        + x2
        * (
            1.0 / 24.0
            + x2
            * (
                -1.0 / 720.0
                + x2 * (1.0 / 40320.0 + x2 * (-1.0 / 3628800.0 + x2 * (1.0 / 479001600.0 - x2 * (1.0 / 87178291200.0))))
            )
        )
    )
    odd = (quarter & np.int64(1)) != 0
    c = -sine if odd else cosine
    s = cosine if odd else sine
    turned = (quarter & np.int64(2)) != 0
    return -c if turned else c, -s if turned else s


@compiled_loop
def gaussians(seed, first_run, purpose, block, rows, at):  # type: ignore[no-untyped-def]
    """Four standard normal numbers a run, by Box and Muller, into four rows of runs.

    Counter: block (64 bits), run (its low 32 bits), purpose; key: seed. The largest magnitude is 6.8.

    Args:
        seed: Low and high 32 bits of the seed, shape (2,), unsigned.
        first_run: Number of the first run, unsigned; the others follow it.
        purpose: Which stream of a run, unsigned, of 32 bits.
        block: Which four numbers of the stream, from 0.
        rows: Rows of runs, one behind the other, flat; four are written.
        at: Place where the first of them begins, see `at_row`.
    """
    low, high = np.uint64(block) & _LOW32, np.uint64(block) >> _HALF_WORD
    for r in range(ROW_LENGTH):
        run = (first_run + r) & _LOW32
        a, b, c, d = philox(low, high, run, purpose, seed[0], seed[1])
        near, far = np.sqrt(-2.0 * row_log(uniform(a))), np.sqrt(-2.0 * row_log(uniform(c)))
        cosine, sine = cosine_sine(uniform(b))
        rows[at + r] = near * cosine
        rows[at + at_row(1) + r] = near * sine
        cosine, sine = cosine_sine(uniform(d))
        rows[at + at_row(2) + r] = far * cosine
        rows[at + at_row(3) + r] = far * sine


@compiled_loop
def gaussian_kernel(seed, first_run, purpose, first_block, numbers):  # type: ignore[no-untyped-def]
    """Standard normal numbers of LANES runs from one stream; fills ``numbers``.

    Args:
        seed: Low and high 32 bits of the seed, shape (2,), unsigned.
        first_run: Number of the first run, shape (1,), unsigned; the others follow it.
        purpose: Which stream of a run, unsigned, of 32 bits.
        first_block: Number of the first block, four numbers of the stream each, from 0.
        numbers: Numbers in the order of the stream, a row of runs each, flat (4 x blocks x LANES); written.
    """
    for block in range(numbers.size // (4 * LANES)):
        gaussians(seed, first_run[0], purpose, first_block + block, numbers, at_row(4 * block))
