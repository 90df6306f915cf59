"""Arithmetic on rows of runs: exponentials and logarithms without a branch, places, copies."""

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from microrad.core.kernels.compiler import compiled_loop, inlined, numba_config
from microrad.core.kernels.ensemble_records import LANES

# A Taylor series about 0 of (exp(r) - 1) / r up to r^11, and of log as in the C library fdlibm, for |r| <= ln 2 / 2.
TO_WHOLE = 6755399441055744.0  # 1.5 x 2^52: adding it leaves the nearest whole number in the low bits
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ONE_BITS = np.int64(0x3FF0000000000000)
_ROOT_HALF_BITS = np.int64(0x3FE6A09E667F3BCD)
_ROUND_BITS = np.int64(0x4338000000000000)
_MANTISSA = np.int64(52)

NEAR_EXP, NEAR_DECAY = 2.0, 4.0  # how far the series of `near_row_exp` and `near_row_relaxation` are good for

ROW_LENGTH = np.uint64(LANES)  # unsigned, as every place in a row of runs: no test for a negative index in the loops

if numba_config.DISABLE_JIT:  # set when numba is loaded

    def bits_of(x: Any) -> Any:
        """The 64 bits of a float."""
        return np.float64(x).view(np.int64)

    def number_of(bits: Any) -> Any:
        """The float of 64 bits."""
        return np.int64(bits).view(np.float64)

    def at_row(row: Any) -> Any:
        """Where a row of runs begins."""
        return np.uint64(row) * ROW_LENGTH

else:

    @intrinsic
    def bits_of(typingctx: Any, x: Any) -> Any:
        """The 64 bits of a float as a whole number: no instruction at all, where a union would go through memory."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

        return types.int64(types.float64), generate

    @intrinsic
    def number_of(typingctx: Any, bits: Any) -> Any:
        """The float of 64 bits."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

        return types.float64(types.int64), generate

    @intrinsic
    def at_row(typingctx: Any, row: Any) -> Any:
        """Where a row of runs begins. As an instruction, for it stands at hundreds of places."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.mul(arguments[0], context.get_constant(types.uint64, LANES))

        return types.uint64(types.uint64), generate


@inlined
def _grown(r):  # type: ignore[no-untyped-def]
    """exp(r) - 1 for |r| <= ln 2 / 2, to rounding error."""
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r * (1.0 / 2.0)) + r2 * (1.0 / 6.0 + r * (1.0 / 24.0))
    middle = (1.0 / 120.0 + r * (1.0 / 720.0)) + r2 * (1.0 / 5040.0 + r * (1.0 / 40320.0))
    high = (1.0 / 362880.0 + r * (1.0 / 3628800.0)) + r2 * (1.0 / 39916800.0 + r * (1.0 / 479001600.0))
    return r * (low + r4 * (middle + r4 * high))


@inlined
def row_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) without a branch or a call, held outside -700 to 700: 2^n exp(r) with r = x - n ln 2."""
    x = min(max(x, -700.0), 700.0)
    shifted = x * _LOG2_E + TO_WHOLE
    n = shifted - TO_WHOLE
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    return number_of(bits_of(1.0 + _grown(r)) + (bits_of(shifted) << _MANTISSA))


@inlined
def row_relaxation(k):  # type: ignore[no-untyped-def]
    """(1 - exp(-k)) / k without a branch or a call, 1 at 0: exp(x) - 1 = 2^n (exp(r) - 1) + (2^n - 1)."""
    x = min(max(-k, -700.0), 700.0)
    shifted = x * _LOG2_E + TO_WHOLE
    n = shifted - TO_WHOLE
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    scale = number_of(_ONE_BITS + (bits_of(shifted) << _MANTISSA))
    grown = scale * _grown(r) + (scale - 1.0)
    return 1.0 if x == 0.0 else grown / x


@inlined
def near_row_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) for |x| <= NEAR_EXP: exp(y)^4 with y = x / 4, by its series economised for |y| <= 1/2 (error 5e-18)."""
    y = 0.25 * x
    y2 = y * y
    even = 0.041666666666668815 + y2 * (
        0.001388888888837246 + y2 * (2.480158789165942e-05 + y2 * (2.755697317701901e-07 + y2 * 2.097735036131617e-09))
    )
    odd = 0.16666666666668065 + y2 * (
        0.00833333333288564
        + y2 * (0.00019841270455102898 + y2 * (2.7556910165747336e-06 + y2 * 2.5182902237048238e-08))
    )
    root = (1.0 + y2 * (0.49999999999999994 + y2 * even)) + y * (0.9999999999999999 + y2 * odd)
    square = root * root
    return square * square


@inlined
def near_row_relaxation(k):  # type: ignore[no-untyped-def]
    """(1 - exp(-k)) / k =: f(k) for |k| <= NEAR_DECAY, without a division, as two factors: a f(k) = (a first) second.

    f(2 k) = f(k) (1 - f(k) k / 2), twice, from the series of f(r), r = k / 4, economised for |r| <= 1 (error 1e-16).
    """
    r = 0.25 * k
    r2 = r * r
    even = 0.008333333333481638 + r2 * (
        0.00019841269752333027
        + r2 * (2.7557344614538454e-06 + r2 * (2.5048389313364278e-08 + r2 * 1.6328813678829017e-10))
    )
    odd = 0.001388888888906751 + r2 * (
        2.4801587216571472e-05
        + r2 * (2.7557339990277737e-07 + r2 * (2.0874041838692515e-09 + r2 * 1.1651309874417153e-11))
    )
    odd = 0.5 + r2 * (0.04166666666666501 + r2 * odd)
    quarter = (1.0 + r2 * (0.1666666666666574 + r2 * even)) - r * odd
    half = quarter * (1.0 - 0.5 * r * quarter)
    return half, 1.0 - r * half


@inlined
def row_log(x):  # type: ignore[no-untyped-def]
    """ln(x) for normal x > 0 without a branch or a call."""
    bits = bits_of(x)
    octave = (bits - _ROOT_HALF_BITS) >> _MANTISSA
    n = number_of(octave + _ROUND_BITS) - TO_WHOLE
    f = number_of(bits - (octave << _MANTISSA)) - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (0.3999999999940941908 + w * (0.2222219843214978396 + w * 0.1531383769920937332))
    odd = 0.6666666666666735130 + w * (0.2857142874366239149 + w * (0.1818357216161805012 + w * 0.1479819860511658591))
    half = 0.5 * f * f
    return n * _LN2_HIGH - ((half - (s * (half + even + z * odd) + n * _LN2_LOW)) - f)


@compiled_loop
def copy_rows(source, target, first, count):  # type: ignore[no-untyped-def]
    """The first rows of one array to the rows from ``first`` on of another.

    Args:
        source: Rows of runs, one behind the other, flat.
        target: Rows of runs, flat; written.
        first: Number of its first row that is written.
        count: How many rows are copied.
    """
    at = at_row(first)
    for r in range(at_row(count)):
        target[at + r] = source[r]


@compiled_loop
def take_rows(source, first, target, count):  # type: ignore[no-untyped-def]
    """The rows from ``first`` on of one array to the first rows of another.

    Args:
        source: Rows of runs, one behind the other, flat.
        first: Number of its first row that is copied.
        target: Rows of runs, flat; its first ones are written.
        count: How many rows are copied.
    """
    at = at_row(first)
    for r in range(at_row(count)):
        target[r] = source[at + r]
