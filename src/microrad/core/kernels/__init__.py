"""The compiled loops: hysteresis, mirror and sampled closed loop, advanced sample by sample.

Arrays, floats and named tuples in, arrays out; no checks, no units, no input or output. This folder alone imports
numba. Machine code is kept under a hash of all its files: an edit in one compiles the loops of the others anew.
Every kernel has a slow, obvious twin in ``tests/oracles.py`` and runs unchanged under ``NUMBA_DISABLE_JIT=1``.

All quantities are deviations from the operating point (drive bias, output at rest), so zero states are at rest.
"""

from microrad.core.kernels.adjoint import Adjoint, adjoint_kernel
from microrad.core.kernels.compiler import UNROLLED, UNROLLED_CONTROLLER, Count, Floats, by_rows, counts, is_compiled
from microrad.core.kernels.doubling import gramian_kernel, riccati_kernel
from microrad.core.kernels.ensemble import draw_loop, ensemble_loop
from microrad.core.kernels.ensemble_records import (
    ADAPTIVE_COLUMNS,
    BANK_FIELDS,
    BANK_H,
    BANK_Q,
    BANK_Z,
    BINS,
    BINS_LOWEST_OCTAVE,
    BINS_OCTAVE_BITS,
    COUNT_CLAMPED,
    COUNT_FALLBACK,
    COUNT_FIELDS,
    COUNT_INVERSE_CLAMPED,
    COUNT_LOST,
    COUNT_OUTSIDE,
    COUNT_SATURATED,
    COUNT_SLEW,
    COUNTING,
    CYCLE,
    DEAD_ZONE,
    DELAY,
    DRIVE_FIELDS,
    DRIVE_NOW,
    FAST_SUM,
    FROZEN_MISFIT,
    GAIN,
    IN_USE,
    KEEP,
    KEEP_UP,
    LANES,
    LEARNT,
    LEAST_SIZE,
    LEAST_TRAVEL,
    LEAST_WEIGHT,
    MEAN,
    MISFIT,
    MOST_WEIGHT,
    NEXT_RECIPROCAL,
    OFFSET,
    OFFSET_LIMIT,
    PIVOT,
    PLAY,
    PLAY_FIELDS,
    PLAY_SUM,
    RECIPROCAL,
    SENSOR_PURPOSE,
    SHARE,
    SIZE,
    SLOPE,
    SLOW,
    SPEED,
    START_PURPOSE,
    STRIDE,
    SUSPECT,
    SWING,
    SWUNG,
    TAKE_UP,
    THRESHOLD,
    TRACK_FIELDS,
    UNSHIFTED,
    VOLTS,
    WEIGHT,
    Ensemble,
    EnsembleState,
    Shift,
)
from microrad.core.kernels.hysteresis import (
    bouc_wen_power_step,
    bouc_wen_response,
    bouc_wen_step,
    lag_kernel,
    lag_response,
    play_response,
    widening_play_response,
)
from microrad.core.kernels.loop import closed_loop
from microrad.core.kernels.plant import Path, PlayPlant, open_loop, play_path
from microrad.core.kernels.random_numbers import gaussian_kernel
from microrad.core.kernels.records import (
    ALPHA,
    BETA,
    BIAS,
    D1,
    D2,
    DELTA,
    EPSILON,
    ETA,
    GAMMA,
    PER_SIZE,
    POWER,
    RATE_LIMIT,
    SATURATED,
    SLEW_LIMITED,
    H,
    Loop,
    LoopState,
    Plant,
    PlantState,
    Q,
    Rows,
    Z,
    bouc_wen_rows,
    rows,
)
from microrad.core.kernels.tangents import Tangents, tangent_kernel
